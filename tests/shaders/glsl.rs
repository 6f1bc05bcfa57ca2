//! Own shaders of projects: pictures with known pixels, and errors with their places in the source.
//!
//! Needs the feature `glsl`. Pictures need a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one,
//! tests print `skipped`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::own_shaders::{SIDE, assert_near, has_driver};
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::Settings;
use curitiba::{Choice, OpenError, RasterChoice};
use std::path::Path;
use tempfile::TempDir;

/// A project of one pass in a folder of its own. A square of side 2 faces the camera in the plane z = 0, with the
/// texture coordinates of the engine's `SQUARE`; a larger square is behind it.
struct Scene {
    folder: TempDir,
}

/// The shaders of the materials, and the `<values>` of the project without the matrix, which is always mapped to `pvm`.
struct Shader<'a> {
    vertex: &'a str,
    fragment: &'a str,
    values: &'a str,
    /// The fragment shader of the material `depth`, which draws depth maps.
    depth: &'a str,
}

impl Default for Shader<'_> {
    fn default() -> Self {
        Self { vertex: VERTEX, fragment: "", values: "", depth: "#version 330\nvoid main() {}\n" }
    }
}

const VERTEX: &str =
    "#version 330\nuniform mat4 pvm;\nin vec4 position;\nvoid main() { gl_Position = pvm * position; }\n";

impl Scene {
    fn new(shader: &Shader<'_>, pass: &str) -> Self {
        Self::with_passes(
            shader,
            &format!(r#"<pass class="default" name="draw">{pass}<lights><light name="Sun"/></lights></pass>"#),
        )
    }

    /// A pass that draws the ball into a target, with the own shader if `own` is set, and a pass that shows one of the
    /// target's channels.
    fn ball(shader: &Shader<'_>, own: bool, channel: &str) -> Self {
        let map = r#"<injectionMaps><map toMaterial="*"><shader fromMaterial="own" fromLibrary="Own"/></map></injectionMaps>"#;
        let passes = format!(
            r#"<pass class="default" name="draw"><scenes><scene name="Ball"/></scenes><renderTarget name="buffers" fromLibrary="Own"/>
<lights><light name="Sun"/></lights>{}</pass>
<pass class="quad" name="show"><texture name="{channel}" fromLibrary="Own"/></pass>"#,
            if own { map } else { "" }
        );
        Self::with_passes(shader, &passes)
    }

    fn with_passes(shader: &Shader<'_>, passes: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        write("own.vert", shader.vertex);
        write("own.frag", shader.fragment);
        write("depth.vert", VERTEX);
        write("depth.frag", shader.depth);
        write(
            "own.mlib",
            &format!(
                r#"<materialLib name="Own">
<textures><texture name="rows" filename="rows.png"/></textures>
<renderTargets><renderTarget name="buffers"><SIZE width="{SIDE}" height="{SIDE}"/><CLEAR_VALUES r="0" g="0" b="0" a="0"/>
<colors><color name="shaded" internalFormat="RGBA32F"/><color name="place" internalFormat="RGBA32F"/><color name="side" internalFormat="RGBA32F"/></colors>
<depth name="depth" internalFormat="DEPTH_COMPONENT32F"/></renderTarget>
<renderTarget name="map"><SIZE width="256" height="256"/><depth name="seen" internalFormat="DEPTH_COMPONENT32F"/></renderTarget></renderTargets>
<shaders><shader name="own" vs="own.vert" ps="own.frag"/><shader name="depth" vs="depth.vert" ps="depth.frag"/></shaders>
<materials><material name="depth"><shader name="depth"><values>
<valueof uniform="pvm" type="RENDERER" context="CURRENT" component="PROJECTION_VIEW_MODEL"/></values></shader></material>
<material name="own">
<color><DIFFUSE r="0.25" g="0.5" b="0.75"/><SHININESS value="7"/></color>
<shader name="own"><values>
<valueof uniform="pvm" type="RENDERER" context="CURRENT" component="PROJECTION_VIEW_MODEL"/>
{}
</values></shader>
<textures><texture UNIT="0" name="rows"/><texture UNIT="1" name="shaded"/></textures>
</material></materials>
</materialLib>"#,
                shader.values
            ),
        );
        // The lower row is red, and the upper one blue.
        let mut rows = Image::filled(1, 2, [0.0, 0.0, 1.0, 1.0]);
        rows.pixels[1] = [1.0, 0.0, 0.0, 1.0];
        curitiba::pipeline::image::write_png(&folder.path().join("rows.png"), &rows).expect("written");
        write(
            "own.xml",
            &format!(
                r#"<project name="own" width="{SIDE}" height="{SIDE}">
<assets>
<attributes><attribute name="level" type="RENDERER" data="FLOAT" value="0.625"/>
<attribute name="FROM" type="PASS" data="FLOAT" value="1"/><attribute name="TO" type="PASS" data="FLOAT" value="9"/></attributes>
<scenes>
<scene name="Square"><geometry name="near" type="SQUARE" material="near"><ROTATE x="1" y="0" z="0" w="90"/></geometry></scene>
<scene name="Ball"><geometry name="ball" type="SPHERE" slices="24" stacks="16" material="ball"/></scene>
<scene name="Step">
<geometry name="near" type="SQUARE" material="near"><ROTATE x="1" y="0" z="0" w="90"/><SCALE x="0.5" y="0.5" z="0.5"/></geometry>
<geometry name="far" type="SQUARE" material="far"><ROTATE x="1" y="0" z="0" w="90"/><SCALE x="3" y="3" z="3"/><TRANSLATE x="0" y="0" z="-1"/></geometry>
<geometry name="behind" type="SQUARE" material="near"><ROTATE x="1" y="0" z="0" w="90"/><SCALE x="0.2" y="0.2" z="0.2"/><TRANSLATE x="-6" y="0" z="6"/></geometry>
</scene>
<scene name="Both">
<geometry name="near" type="SQUARE" material="near"><ROTATE x="1" y="0" z="0" w="90"/></geometry>
<geometry name="far" type="SQUARE" material="far"><ROTATE x="1" y="0" z="0" w="90"/><SCALE x="3" y="3" z="3"/><TRANSLATE x="0" y="0" z="-1"/></geometry>
</scene>
</scenes>
<viewports><viewport name="V"><CLEAR_COLOR r="0" g="0" b="0"/></viewport></viewports>
<cameras><camera name="C"><viewport name="V"/><projection TYPE="ORTHO" LEFT="-1" RIGHT="1" BOTTOM="-1" TOP="1" NEAR="1" FAR="9"/>
<POSITION x="0" y="0" z="5"/><VIEW x="0" y="0" z="-1"/><UP x="0" y="1" z="0"/></camera></cameras>
<lights><light name="Sun" type="directional"><DIRECTION x="0.6" y="0" z="-0.8"/><COLOR r="1" g="1" b="1"/></light></lights>
<materialLibs><materialLib filename="own.mlib"/></materialLibs>
</assets>
<pipelines><pipeline name="p" default="true" defaultCamera="C">
{passes}
</pipeline></pipelines>
</project>"#
            ),
        );
        Self { folder }
    }

    /// A pass that draws the whole square with the own shader.
    fn square(shader: &Shader<'_>) -> Self {
        let map = r#"<materialMaps><map fromMaterial="*" toLibrary="Own" toMaterial="own"/></materialMaps>"#;
        Self::new(shader, &format!(r#"<scenes><scene name="Square"/></scenes>{map}"#))
    }

    fn path(&self) -> std::path::PathBuf {
        self.folder.path().join("own.xml")
    }

    fn open(&self, raster: RasterChoice) -> Result<Renderer, OpenError> {
        let choice = Choice { raster, ..Choice::CPU };
        curitiba::open(self.path(), Settings::default(), choice, &mut Silent)
    }

    /// The rendered picture; `None` where there is no driver.
    fn picture(&self) -> Option<Image> {
        if !has_driver() {
            return None;
        }
        let mut renderer = self.open(RasterChoice::Auto).unwrap_or_else(|error| panic!("{}", error.joined()));
        assert_eq!(renderer.engines().raster.name(), "wgpu", "auto takes what draws own shaders");
        Some(renderer.frame(&mut Silent).expect("it renders"))
    }

    /// The error message with which the project is refused.
    fn refused(&self, raster: RasterChoice) -> String {
        match self.open(raster) {
            Ok(_) => panic!("it is refused"),
            Err(error) => error.joined(),
        }
    }
}

mod drawn {
    use super::*;

    fn value(uniform: &str, kind: &str, context: &str, component: &str) -> String {
        format!(r#"<valueof uniform="{uniform}" type="{kind}" context="{context}" component="{component}"/>"#)
    }

    /// Uniforms from mapped values, and uniforms with initial values in the shader.
    #[test]
    fn uniforms_are_what_the_project_maps_to_them() {
        let fragment = "#version 330\nlayout(std140) uniform Paint { float unused; vec4 diffuse; };\nuniform float level;\n\
                        uniform float shine;\nuniform vec3 own = vec3(0.5, 1, 1);\nuniform int two;\nout vec4 color;\n\
                        void main() { color = vec4(diffuse.rgb * own, level); if (two == 2 && shine == 7.0) color.g = 0.125; }\n";
        let values = value("level", "RENDERER", "CURRENT", "level")
            + &value("shine", "COLOR", "CURRENT", "SHININESS")
            + &value("two", "RENDERER", "CURRENT", "TEXTURE_COUNT")
            + r#"<valueof uniform="diffuse" block="Paint" type="COLOR" context="CURRENT" component="DIFFUSE"/>"#;
        let scene = Scene::square(&Shader { vertex: VERTEX, fragment, values: &values, ..Shader::default() });
        let Some(picture) = scene.picture() else { return };
        // The project binds two textures, so `two` is 2 and no other number.
        assert_near(&picture, |_, _| [0.125, 0.125, 0.75, 0.625], 1e-6);
        let one = fragment.replace("two == 2", "two == 1");
        let scene = Scene::square(&Shader { vertex: VERTEX, fragment: &one, values: &values, ..Shader::default() });
        assert_near(&scene.picture().expect("a driver"), |_, _| [0.125, 0.5, 0.75, 0.625], 1e-6);
    }

    /// Own shaders and `deferred` draw over each other's output, by colour and depth: half of the ball stands out of the square.
    #[test]
    fn own_shaders_start_from_what_earlier_passes_left() {
        let fragment = "#version 330\nout vec4 color;\nvoid main() { color = vec4(0.125, 0.75, 0.25, 1); }\n";
        let own = r#"<scenes><scene name="Ball"/></scenes><materialMaps><map fromMaterial="*" toLibrary="Own" toMaterial="own"/></materialMaps>"#;
        let square = r#"<scenes><scene name="Square"/></scenes>"#;
        let picture = |passes: &[(&str, &str, &str)]| {
            let pass = |(name, drawn, kept): &(&str, &str, &str)| {
                format!(
                    r#"<pass class="default" name="{name}">{drawn}<lights><light name="Sun"/></lights>{kept}</pass>"#
                )
            };
            let passes: String = passes.iter().map(pass).collect();
            let scene = Scene::with_passes(&Shader { fragment, ..Shader::default() }, &passes);
            let opened = has_driver().then(|| scene.open(RasterChoice::Wgpu))?;
            let mut renderer = opened.unwrap_or_else(|error| panic!("{}", error.joined()));
            Some(renderer.frame(&mut Silent).expect("it renders"))
        };
        let (color, depth) = (r#"<COLOR_CLEAR value="false"/>"#, r#"<DEPTH_CLEAR value="false"/>"#);
        let both = [color, depth].concat();
        let Some(flat) = picture(&[("square", square, "")]) else { return };
        let behind = flat.pixels[0];
        let known = |x: u32, y: u32| {
            let [x, y] = [x, y].map(|at| (at as f32 + 0.5) / (SIDE as f32 / 2.0) - 1.0);
            // The ball has flat faces, so pixels at its edge are not tested.
            match x.hypot(y) {
                from if from < 0.95 => Some([0.125, 0.75, 0.25, 1.0]),
                from if from > 1.0 => Some(behind),
                _ => None,
            }
        };
        for (passes, what) in [
            ([("ball", own, ""), ("square", square, &*both)], "deferred over own"),
            ([("square", square, ""), ("ball", own, &*both)], "own over deferred"),
        ] {
            let drawn = picture(&passes).expect("a driver");
            let known = |x, y| known(x, y).unwrap_or(drawn.pixels[(y * SIDE + x) as usize]);
            assert_near(&drawn, known, 1e-6);
            assert_ne!(drawn, flat, "{what}");
        }
        // Controls: if the depth is not kept, the square covers the ball; if the colour is not kept, the ball stands alone.
        assert_eq!(picture(&[("ball", own, ""), ("square", square, color)]).expect("a driver"), flat);
        let alone = picture(&[("square", square, ""), ("ball", own, depth)]).expect("a driver");
        assert_near(
            &alone,
            |x, y| match known(x, y) {
                Some(pixel) if pixel == behind => [0.0, 0.0, 0.0, 1.0],
                Some(pixel) => pixel,
                None => alone.pixels[(y * SIDE + x) as usize],
            },
            1e-6,
        );
    }

    /// Rows count upwards in `gl_FragCoord`, in clip space, in derivatives and in textures.
    #[test]
    fn the_picture_is_the_right_way_up() {
        let fragment = "#version 330\nin vec2 place;\nout vec4 color;\n\
                        void main() { color = vec4(gl_FragCoord.xy / 64.0, dFdy(place.y) * 32.0, 1.0); }\n";
        let vertex = "#version 330\nuniform mat4 pvm;\nin vec4 position;\nout vec2 place;\n\
                      void main() { place = position.xy; gl_Position = pvm * position; }\n";
        let Some(picture) = Scene::square(&Shader { vertex, fragment, values: "", ..Shader::default() }).picture()
        else {
            return;
        };
        let centre = |pixel: u32| (pixel as f32 + 0.5) / SIDE as f32;
        assert_near(&picture, |x, y| [centre(x), 1.0 - centre(y), 1.0, 1.0], 1e-4);
        let fragment = "#version 330\nuniform sampler2D rows;\nin vec2 place;\nout vec4 color;\n\
                        void main() { color = texelFetch(rows, ivec2(0, place.y > 0.0 ? 1 : 0), 0); }\n";
        let values = r#"<valueof uniform="rows" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="0"/>"#;
        let picture =
            Scene::square(&Shader { vertex, fragment, values, ..Shader::default() }).picture().expect("a driver");
        // The upper row of the file is blue.
        let beside = fragment.replace(
            "texelFetch(rows, ivec2(0, place.y > 0.0 ? 1 : 0), 0)",
            "place.y > 0.0 ? texelFetchOffset(rows, ivec2(0), 0, ivec2(0, 1)) : texelFetchOffset(rows, ivec2(0, 1), 0, ivec2(0, -1))",
        );
        assert_ne!(beside, fragment);
        let offset = Scene::square(&Shader { vertex, fragment: &beside, values, ..Shader::default() });
        assert_eq!(offset.picture().expect("a driver").pixels, picture.pixels);
        assert_near(&picture, |_, y| if y < SIDE / 2 { [0.0, 0.0, 1.0, 1.0] } else { [1.0, 0.0, 0.0, 1.0] }, 1e-6);
    }

    /// Depth has OpenGL's range. Own materials and others hide each other by depth as usual.
    #[test]
    fn depth_is_kept_beside_materials_that_deferred_draws() {
        for own in ["near", "far"] {
            let fragment =
                "#version 330\nout vec4 color;\nvoid main() { color = vec4(0.0, 0.0, 1.0, gl_FragCoord.z); }\n";
            let map =
                format!(r#"<materialMaps><map fromMaterial="{own}" toLibrary="Own" toMaterial="own"/></materialMaps>"#);
            let pass = format!(r#"<scenes><scene name="Both"/></scenes>{map}"#);
            let Some(picture) =
                Scene::new(&Shader { vertex: VERTEX, fragment, values: "", ..Shader::default() }, &pass).picture()
            else {
                return;
            };
            // With the near plane at 1, the far plane at 9 and the camera at 5, z = 0 has the middle depth.
            let inside = picture.pixels[(SIDE * SIDE / 2 + SIDE / 2) as usize];
            if own == "near" {
                assert!((inside[3] - 0.5).abs() < 1e-6 && inside[2] == 1.0, "{inside:?}");
            } else {
                assert!(inside[2] < 0.9, "the near square hides it: {inside:?}");
            }
        }
    }

    /// A shader that computes light, ambient light, position and normal as the material `deferred` does draws the same picture.
    #[test]
    fn a_shader_that_says_what_deferred_does_draws_what_it_does() {
        let vertex = "#version 330\nuniform mat4 pvm, model, view; uniform mat3 normals; uniform vec4 light;\n\
                      in vec4 position; in vec3 normal; out Lit { vec3 side; vec3 place; vec3 eyed; vec3 lit; } lit;\n\
                      void main() { lit.side = normal; lit.place = vec3(model * position); lit.eyed = normals * normal;\n\
                      lit.lit = vec3(view * -light); gl_Position = pvm * position; }\n";
        let fragment = "#version 330\nuniform vec4 diffuse;\n\
                        in Lit { vec3 side; vec3 place; vec3 eyed; vec3 lit; } lit;\n\
                        layout(location = 0) out vec4 color; layout(location = 1) out vec4 place; layout(location = 2) out vec4 side;\n\
                        void main() { float cosine = max(dot(normalize(lit.eyed), lit.lit), 0);\n\
                        color = diffuse * cosine + 0.3 * diffuse; place = vec4(lit.place, cosine); side = vec4(normalize(lit.side), 0); }\n";
        let values = value("view", "RENDERER", "CURRENT", "VIEW")
            + &value("model", "RENDERER", "CURRENT", "MODEL")
            + &value("normals", "RENDERER", "CURRENT", "NORMAL")
            + &value("light", "LIGHT", "Sun", "DIRECTION")
            + &value("diffuse", "COLOR", "CURRENT", "DIFFUSE");
        let shader = Shader { vertex, fragment, values: &values, ..Shader::default() };
        for channel in ["shaded", "place", "side"] {
            let Some(own) = Scene::ball(&shader, true, channel).picture() else { return };
            let plain = Scene::ball(&shader, false, channel);
            let mut deferred = plain.open(RasterChoice::Wgpu).unwrap_or_else(|error| panic!("{}", error.joined()));
            let deferred = deferred.frame(&mut Silent).expect("it renders");
            assert!(deferred.pixels.iter().filter(|pixel| pixel[0] != 0.0).count() > 1000, "the ball is seen");
            assert_near(
                &own,
                |x, y| deferred.pixels[(y * SIDE + x) as usize],
                if channel == "shaded" { 1.0 / 255.0 } else { 1e-5 },
            );
            // Control: a shader that computes something else is detected.
            let other = fragment
                .replace("0.3 *", "0.31 *")
                .replace("vec4(lit.place", "vec4(lit.place.zyx")
                .replace("vec4(normalize(lit.side)", "vec4(-normalize(lit.side)");
            let other = Scene::ball(&Shader { fragment: &other, ..shader }, true, channel).picture().expect("a driver");
            let differs = |(a, b): (&[f32; 4], &[f32; 4])| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1.0 / 255.0);
            assert!(other.pixels.iter().zip(&deferred.pixels).any(differs), "{channel}");
        }
    }

    /// Flat values come from a triangle's last corner, as in OpenGL.
    #[test]
    fn flat_values_are_those_of_the_last_corner() {
        let vertex = "#version 330\nuniform mat4 pvm;\nin vec4 position;\nflat out vec4 corner;\nout vec4 place;\n\
                      void main() { place = position; corner = position; gl_Position = pvm * position; }\n";
        let fragment = "#version 330\nflat in vec4 corner;\nin vec4 place;\nout vec4 color;\n\
                        void main() { color = vec4(corner.xy * 0.5 + 0.5, 0, 1); }\n";
        let scene = Scene::square(&Shader { vertex, fragment, values: "", ..Shader::default() });
        let Some(picture) = scene.picture() else { return };
        let renderer = scene.open(RasterChoice::Wgpu).unwrap_or_else(|error| panic!("{}", error.joined()));
        let geometry = &renderer.scenes().next().expect("a scene").geometry;
        let last: Vec<[f32; 2]> = geometry
            .triangles
            .iter()
            .map(|triangle| geometry.positions[triangle[2] as usize])
            .map(|corner| [corner.x * 0.5 + 0.5, corner.y * 0.5 + 0.5])
            .collect();
        let first: Vec<[f32; 2]> = geometry
            .triangles
            .iter()
            .map(|triangle| geometry.positions[triangle[0] as usize])
            .map(|corner| [corner.x * 0.5 + 0.5, corner.y * 0.5 + 0.5])
            .collect();
        assert_ne!(last, first, "the corners tell");
        let near =
            |pixel: &[f32; 4], corner: &[f32; 2]| (pixel[0] - corner[0]).abs().max((pixel[1] - corner[1]).abs()) < 1e-5;
        for pixel in &picture.pixels {
            assert!(last.iter().any(|corner| near(pixel, corner)), "{pixel:?} of {last:?}");
        }
    }

    /// Four instances of one square, each in a colour that encodes its number.
    #[test]
    fn instances_are_drawn_where_the_shader_puts_them() {
        let vertex = "#version 330\nuniform mat4 pvm;\nin vec4 position;\nout vec4 tint;\n\
                      void main() { int n = gl_InstanceID; vec2 at = vec2(n % 2, n / 2) - 0.5;\n\
                      tint = vec4(float(n + 1) * 0.25, float(n % 2), 0.0, 1.0);\n\
                      gl_Position = pvm * vec4(position.xy * 0.25 + at, position.z, 1.0); }\n";
        let fragment = "#version 330\nin vec4 tint;\nout vec4 color;\nvoid main() { color = tint; }\n";
        let map = r#"<materialMaps><map fromMaterial="*" toLibrary="Own" toMaterial="own"/></materialMaps>"#;
        for instances in [1, 3, 4] {
            let shader = Shader { vertex, fragment, ..Shader::default() };
            let pass = format!(r#"<scenes instances="{instances}"><scene name="Square"/></scenes>{map}"#);
            let Some(picture) = Scene::new(&shader, &pass).picture() else { return };
            let known = |x: u32, y: u32| {
                // The picture has four quarters, the lower row first; a square fills the middle half of its quarter.
                let (half, row) = (SIDE / 2, SIDE - 1 - y);
                let inside = |at: u32| (half / 4..half * 3 / 4).contains(&(at % half));
                let number = x / half + 2 * (row / half);
                let drawn = inside(x) && inside(row) && number < instances;
                let tint = [(number + 1) as f32 * 0.25, (number % 2) as f32, 0.0, 1.0];
                if drawn { tint } else { [0.0, 0.0, 0.0, 1.0] }
            };
            assert_near(&picture, known, 1e-6);
        }
        let refused = Scene::new(&Shader { vertex, fragment, ..Shader::default() }, "<scenes instances=\"0\"/>");
        assert!(refused.refused(RasterChoice::Auto).contains("draws its scenes 0 times"));
    }

    /// Three overlapping squares in the middle of the picture. They are blended with the colours below them, or hidden by
    /// nearer ones.
    #[test]
    fn states_blend_and_leave_depth_alone() {
        let vertex = "#version 330\nuniform mat4 pvm;\nin vec4 position;\n\
                      void main() { gl_Position = pvm * vec4(position.xy * 0.5, float(gl_InstanceID) * -0.5, 1.0); }\n";
        let fragment = "#version 330\nout vec4 color;\nvoid main() { color = vec4(0.25, 0.125, 0.0, 0.5); }\n";
        let map = r#"<materialMaps><map fromMaterial="*" toLibrary="Own" toMaterial="own"/></materialMaps>"#;
        let pass = format!(r#"<scenes instances="3"><scene name="Square"/></scenes>{map}"#);
        let adds = r#"<BLEND value="true"/><BLEND_SRC value="ONE"/><BLEND_DST value="ONE"/>"#;
        let over = r#"<BLEND value="1"/><BLEND_SRC value="SRC_ALPHA"/><BLEND_DST value="ONE_MINUS_SRC_ALPHA"/>"#;
        // The first square is the nearest. Alpha, which starts at 1, is blended like the colours.
        let layers = |factor: f32| (0..3).fold(0.0, |there: f32, _| factor * 0.5 + there * 0.5);
        let mixed = [layers(0.25), layers(0.125), 0.0, (0..3).fold(1.0, |there: f32, _| 0.25 + there * 0.5)];
        for (state, known) in [
            (String::new(), [0.25, 0.125, 0.0, 0.5]),
            (adds.to_owned(), [0.25, 0.125, 0.0, 1.5]),
            (format!(r#"{adds}<DEPTH_MASK value="false"/>"#), [0.75, 0.375, 0.0, 2.5]),
            (format!(r#"{adds}<DEPTH_TEST value=0 />"#), [0.75, 0.375, 0.0, 2.5]),
            (format!(r#"{over}<DEPTH_MASK value="false"/>"#), mixed),
        ] {
            let scene = Scene::new(&Shader { vertex, fragment, ..Shader::default() }, &pass);
            let library = scene.folder.path().join("own.mlib");
            let text = std::fs::read_to_string(&library).expect("read");
            let states = format!(r#"<states><state name="drawn">{state}</state></states><materials>"#);
            let text = text.replace("<materials>", &states);
            let text = text.replace(r#"<material name="own">"#, r#"<material name="own"><state name="drawn"/>"#);
            std::fs::write(&library, text).expect("written");
            let Some(picture) = scene.picture() else { return };
            let inside = |at: u32| (SIDE / 4..SIDE * 3 / 4).contains(&at);
            let known = |x, y| if inside(x) && inside(y) { known } else { [0.0, 0.0, 0.0, 1.0] };
            assert_near(&picture, known, 1e-6);
        }
    }

    /// One quad stores a value for each pixel and counts pixels; another quad shows the stored picture, mirrored.
    #[test]
    fn quads_store_to_buffers_and_count() {
        const QUAD: &str = "#version 430\nin vec4 position;\nin vec4 texCoord0;\nout vec2 at;\n\
                            void main() { gl_Position = position; at = texCoord0.xy; }\n";
        let store = "#version 430\nlayout(binding = 1, offset = 4) uniform atomic_uint all;\n\
                     struct pair { vec4 a; vec4 b; };\nlayout(std430, binding = 2) buffer Pairs { pair pairs[]; };\n\
                     in vec2 at;\nout vec4 color;\nvoid main() { ivec2 c = ivec2(at * 64.0);\n\
                     pair p; p.a = vec4(1.0); p.b = vec4(at, 0.5, 1.0); pairs[c.y * 64 + c.x] = p;\n\
                     atomicCounterIncrement(all); memoryBarrier(); color = vec4(1.0); }\n";
        let show = "#version 430\nlayout(binding = 1, offset = 4) uniform atomic_uint all;\n\
                    struct pair { vec4 a; vec4 b; };\n\
                    layout(std430, binding = 2) readonly buffer Pairs { pair pairs[]; };\n\
                    in vec2 at;\nout vec4 color;\nvoid main() { ivec2 c = ivec2(at * 64.0);\n\
                    color = pairs[c.y * 64 + 63 - c.x].b;\ncolor.z = float(atomicCounter(all)) / 8192.0; }\n";
        let map = |name: &str| {
            format!("<materialMaps><map fromMaterial=\"*\" toLibrary=\"Own\" toMaterial=\"{name}\"/></materialMaps>")
        };
        let passes = format!(
            "<pass class=\"quad\" name=\"store\"><renderTarget name=\"buffers\" fromLibrary=\"Own\"/>{}</pass>\
             <pass class=\"quad\" name=\"show\">{}</pass>",
            map("own"),
            map("depth")
        );
        let made = |bound: &str, size: &str| {
            let shader = Shader { vertex: QUAD, fragment: store, depth: show, ..Shader::default() };
            let scene = Scene::with_passes(&shader, &passes);
            std::fs::write(scene.folder.path().join("depth.vert"), QUAD).expect("written");
            let library = scene.folder.path().join("own.mlib");
            let text = std::fs::read_to_string(&library).expect("read");
            let declared = format!(
                "<buffers><buffer name=\"counts\"><SIZE value=\"16\"/></buffer><buffer name=\"pairs\">{size}</buffer></buffers><materials>"
            );
            let bind = |name: &str, kind: &str, point: u32| {
                format!("<buffer name=\"{name}\"><TYPE value=\"{kind}\"/><BINDING_POINT value=\"{point}\"/></buffer>")
            };
            let bindings = format!(
                "<buffers>{}{}</buffers>",
                bind("counts", "ATOMIC_COUNTER", 1),
                bind(bound, "SHADER_STORAGE", 2)
            );
            let text = text.replace("<materials>", &declared);
            let text = ["own", "depth"].iter().fold(text, |text, name| {
                let material = format!("<material name=\"{name}\">");
                text.replace(&material, &format!("{material}{bindings}"))
            });
            std::fs::write(&library, text).expect("written");
            scene
        };
        let size =
            "<DIM x=\"64\" y=\"64\" z=\"1\"/><structure><field value=\"VEC4\"/><field value=\"VEC4\"/></structure>";
        let refused = made("pears", size).refused(RasterChoice::Auto);
        assert!(refused.contains("there is no buffer `pears`"), "{refused}");
        let refused = made("pairs", "").refused(RasterChoice::Auto);
        assert!(refused.contains("the size of the buffer `pairs` cannot be read"), "{refused}");
        let scene = made("pairs", size);
        let Some(picture) = scene.picture() else { return };
        let side = SIDE as f32;
        let known = |x, y| [(side - x as f32 - 0.5) / side, (side - y as f32 - 0.5) / side, 0.5, 1.0];
        assert_near(&picture, known, 1e-6);
        // Every frame starts from zeros, so the next frame counts the same.
        let mut renderer = scene.open(RasterChoice::Auto).unwrap_or_else(|error| panic!("{}", error.joined()));
        renderer.frame(&mut Silent).expect("it renders");
        assert_eq!(renderer.frame(&mut Silent).expect("it renders").pixels, picture.pixels);
        assert_eq!(renderer.update(&mut Silent).expect("it renders").pixels, picture.pixels);
    }

    #[test]
    fn a_depth_that_is_not_kept_is_not_among_what_was_written() {
        let fragment = "#version 330\nout vec4 color;\nvoid main() { color = vec4(1.0); }\n";
        let said = Scene::ball(&Shader { fragment, ..Shader::default() }, true, "seen").refused(RasterChoice::Auto);
        assert!(said.contains("reads `Own::seen`, which no pass writes"), "{said}");
    }

    #[test]
    fn only_what_the_maps_are_for_is_drawn_with_them_and_what_is_not_bound_is_black() {
        let fragment = "#version 330\nuniform sampler2D t;\nout vec4 color;\nvoid main() { color = texture(t, vec2(0.5)) + vec4(0.25, 0, 0, 0); }\n";
        let values = r#"<valueof uniform="t" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="3"/>"#;
        let Some(picture) = Scene::square(&Shader { vertex: VERTEX, fragment, values, ..Shader::default() }).picture()
        else {
            return;
        };
        assert_near(&picture, |_, _| [0.25, 0.0, 0.0, 1.0], 1e-6);
    }

    #[test]
    fn the_processor_s_rasteriser_says_which_one_runs_them() {
        let fragment = "#version 330\nout vec4 color;\nvoid main() { color = vec4(1); }\n";
        let said = Scene::square(&Shader { vertex: VERTEX, fragment, values: "", ..Shader::default() })
            .refused(RasterChoice::Cpu);
        assert!(said.contains("pass `draw`") && said.contains("own.xml:") && said.contains("--raster wgpu"), "{said}");
    }

    /// Errors are reported when the project is read, with the shader's file, line and column.
    #[test]
    fn errors_are_in_the_shader_s_own_file() {
        let fragment = "#version 330\nout vec4 color;\n\nvoid main() {\n    color = vec4(nothing, 1);\n}\n";
        let said = Scene::square(&Shader { vertex: VERTEX, fragment, values: "", ..Shader::default() })
            .refused(RasterChoice::Wgpu);
        assert!(said.contains("own.frag:5:18") && said.contains("nothing"), "{said}");
        let fine = "#version 330\nuniform vec4 tint;\nout vec4 color;\nvoid main() { color = tint; }\n";
        for (values, expected) in [
            (
                value("tint", "RENDERER", "CURRENT", "CLOCK"),
                "the uniform `tint` is the `CLOCK` of RENDERER, which is not known",
            ),
            (value("tint", "WEATHER", "CURRENT", "RAIN"), "the uniform `tint` is a value of WEATHER"),
            (value("tint", "LIGHT", "Moon", "COLOR"), "there is no light `Moon`"),
            (value("tint", "RENDERER", "CURRENT", "VIEW"), "declare it as mat4"),
        ] {
            let said = Scene::square(&Shader { vertex: VERTEX, fragment: fine, values: &values, ..Shader::default() })
                .refused(RasterChoice::Wgpu);
            assert!(said.contains(expected) && said.contains("own.mlib:"), "{said}");
        }
        // An unmapped uniform is 0, and there is a warning about it.
        let scene = Scene::square(&Shader { vertex: VERTEX, fragment: fine, values: "", ..Shader::default() });
        let project = Settings::default().open(&scene.path()).expect("it is read");
        let warnings = project.problems.to_string();
        assert!(
            warnings.contains("own.frag:2:14") && warnings.contains("nothing is mapped to the uniform `tint`"),
            "{warnings}"
        );
        let Some(picture) = scene.picture() else { return };
        assert_near(&picture, |_, _| [0.0; 4], 0.0);
    }

    #[test]
    fn what_own_shaders_cannot_be_joined_with_is_refused_before_anything_is_loaded() {
        let fragment = "#version 330\nout vec4 color;\nvoid main() { color = vec4(1); }\n";
        let scene = Scene::square(&Shader { vertex: VERTEX, fragment, values: "", ..Shader::default() });
        let linear = Settings { color: Some(curitiba::pipeline::color::ColorSpace::Linear), ..Settings::default() };
        let thesis = Settings { fidelity: curitiba::pipeline::programs::Fidelity::Thesis, ..Settings::default() };
        for (settings, expected) in [(linear, "--color report"), (thesis, "--fidelity corrected")] {
            let choice = Choice { raster: RasterChoice::Wgpu, ..Choice::CPU };
            let said = match curitiba::open(scene.path(), settings, choice, &mut Silent) {
                Ok(_) => panic!("it is refused"),
                Err(error) => error.joined(),
            };
            assert!(said.contains("draws with own shaders") && said.contains(expected), "{said}");
        }
    }

    /// A quad inverts the colours that an earlier pass drew, the right way up; pixels that it discards keep their
    /// value.
    #[test]
    fn a_quad_shows_what_its_shader_makes_of_a_texture() {
        let vertex = "#version 130\nin vec4 position;\nin vec4 texCoord0;\nout vec2 uv;\n\
                      void main() { gl_Position = position; uv = vec2(texCoord0); }\n";
        let fragment = "#version 130\nuniform sampler2D drawn;\nuniform vec4 tint;\nin vec2 uv;\nout vec4 color;\n\
                        void main() { if (gl_FragCoord.y < 8.0) discard; color = vec4(vec3(1.0) - texture(drawn, uv).rgb, tint.g); }\n";
        let values = r#"<valueof uniform="drawn" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="1"/>"#
            .to_owned()
            + &value("tint", "COLOR", "CURRENT", "DIFFUSE");
        let quad = |material: &str| {
            format!(
                r#"<pass class="default" name="draw"><scenes><scene name="Ball"/></scenes><renderTarget name="buffers" fromLibrary="Own"/>
<lights><light name="Sun"/></lights></pass><pass class="quad" name="fill">{material}</pass>"#
            )
        };
        let own = r#"<material name="own" fromLibrary="Own"/>"#;
        // The matrix is not used, so it need not be mapped.
        let shader = Shader { vertex, fragment, values: &values, ..Shader::default() };
        let Some(picture) = Scene::with_passes(&shader, &quad(own)).picture() else { return };
        let shown = Scene::with_passes(&shader, &quad(r#"<texture name="shaded" fromLibrary="Own"/>"#));
        let shown = shown.open(RasterChoice::Cpu).expect("it opens").frame(&mut Silent).expect("it renders");
        let known = |x: u32, y: u32| {
            let [r, g, b, _] = shown.pixels[(y * SIDE + x) as usize];
            if y >= SIDE - 8 { [0.0, 0.0, 0.0, 1.0] } else { [1.0 - r, 1.0 - g, 1.0 - b, 0.5] }
        };
        // The two rasterisers may differ at the ball's edge, which is therefore left out.
        let differs = |x: u32, y: u32| {
            let at = |x: u32, y: u32| shown.pixels[(y.min(SIDE - 1) * SIDE + x.min(SIDE - 1)) as usize][0] > 0.0;
            [(x + 1, y), (x, y + 1), (x.saturating_sub(1), y), (x, y.saturating_sub(1))]
                .iter()
                .any(|(u, v)| at(*u, *v) != at(x, y))
        };
        let (drawn, mut picture) = (picture.pixels.clone(), picture);
        for index in 0..SIDE * SIDE {
            let (x, y) = (index % SIDE, index / SIDE);
            if differs(x, y) {
                picture.pixels[index as usize] = known(x, y);
            }
        }
        assert_near(&picture, known, 2e-3);
        assert!(shown.pixels.iter().filter(|pixel| pixel[0] > 0.0).count() > 1000, "the ball is seen");
        let said = Scene::with_passes(&shader, &quad(own)).refused(RasterChoice::Cpu);
        assert!(said.contains("pass `fill`") && said.contains("--raster wgpu"), "{said}");
        let moved = vertex
            .replace("in vec4 position;", "uniform mat4 pvm; in vec4 position;")
            .replace("= position", "= pvm * position");
        // The matrices of a quad are the identity.
        let pvm = format!("{values}{}", value("pvm", "RENDERER", "CURRENT", "PROJECTION_VIEW_MODEL"));
        let moved = Scene::with_passes(&Shader { vertex: &moved, values: &pvm, ..shader }, &quad(own)).picture();
        assert_eq!(moved.map(|moved| moved.pixels), Some(drawn), "where it is");
    }

    /// A step lit from the side: first the depths from the light are drawn, then every pixel is compared with them.
    fn lit_step(fragment: &str, pass: &str, textures: &str) -> Scene {
        let vertex = "#version 330\nuniform mat4 pvm, model, toMap;\nin vec4 position;\nout vec4 inMap;\n\
                      void main() { inMap = toMap * model * position; gl_Position = pvm * position; }\n";
        let values = value("model", "RENDERER", "CURRENT", "MODEL")
            + &value("toMap", "CAMERA", "p#light-LightCam", "TS05_PVM_MATRIX")
            + &value("reach", "PASS", "p#light", "TO")
            + r#"<valueof uniform="seen" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="3"/>"#;
        let passes = format!(
            r#"{pass}<pass class="default" name="draw"><scenes><scene name="Step"/><scene name="C"/></scenes>
<injectionMaps><map toMaterial="*"><shader fromMaterial="own" fromLibrary="Own"/><textures>{textures}</textures></map></injectionMaps></pass>"#
        );
        Scene::with_passes(&Shader { vertex, fragment, values: &values, ..Shader::default() }, &passes)
    }

    const LIT: &str = "#version 330\nuniform sampler2DShadow seen;\nuniform float reach;\nin vec4 inMap;\nout vec4 color;\n\
                       void main() { color = vec4(vec3(textureProj(seen, inMap - vec4(0, 0, 0.01, 0))), reach); }\n";
    const SEEN: &str = r#"<texture name="seen" fromLibrary="Own" toUnit="3"/>"#;

    fn seen_by(light: &str, inside: &str, map: &str) -> String {
        format!(
            r#"<pass class="depthmap" name="light"><scenes><scene name="Step"/></scenes>{inside}<camera name="C"/>
<lights><light name="{light}"/></lights><renderTarget name="map" fromLibrary="Own"/>{map}</pass>"#
        )
    }

    const DEPTHS: &str = r#"<materialMaps><map fromMaterial="*" toLibrary="Own" toMaterial="depth"/></materialMaps>"#;

    /// The light travels along (0.6, 0, -0.8), so a shadow moves 0.75 to the right for each unit of depth. The square
    /// behind the camera is in front of the map's near plane, and still casts its shadow.
    #[test]
    fn a_depth_map_throws_the_shadows_that_its_light_does() {
        let scene = lit_step(LIT, &seen_by("Sun", r#"<TO value="8"/>"#, DEPTHS), SEEN);
        let Some(picture) = scene.picture() else { return };
        let (mut lit, mut dark) = (0, 0);
        for (index, pixel) in (0..).zip(&picture.pixels) {
            let at = |pixel: u32| (pixel as f32 + 0.5) / (SIDE / 2) as f32 - 1.0;
            let (x, y) = (at(index % SIDE), -at(index / SIDE));
            // Distance inside the border of a square centred at `middle`.
            let inside = |middle: f32, half: f32| half - (x - middle).abs().max(y.abs());
            let (step, shadow, behind) = (inside(0.0, 0.5), inside(0.75, 0.5), inside(-0.75, 0.2));
            if [step, shadow, behind].iter().any(|edge| edge.abs() < 0.09) {
                continue;
            }
            let is_dark = step < 0.0 && (shadow > 0.0 || behind > 0.0);
            *(if is_dark { &mut dark } else { &mut lit }) += 1;
            assert_eq!(pixel[0], f32::from(u8::from(!is_dark)), "at {x}, {y}");
            // The value is that of the pass itself, not the project's.
            assert_eq!(pixel[3], 8.0);
        }
        assert!(lit > 1000 && dark > 200, "{lit} lit pixels and {dark} in shadow");
    }

    #[test]
    fn depth_maps_that_cannot_be_drawn_are_refused_with_their_places() {
        let injected = r#"<injectionMaps><map toMaterial="near"><shader fromMaterial="depth" fromLibrary="Own"/></map></injectionMaps>"#;
        let greater = r#"<texture name="seen" fromLibrary="Own" toUnit="3"><COMPARE_FUNC value="GREATER"/></texture>"#;
        let drawn = seen_by("Sun", "", DEPTHS).replace("depthmap", "default");
        for (pass, textures, expected) in [
            (seen_by("Sun", "", ""), SEEN, "draws a depth map by other shaders than own ones"),
            (seen_by("Sun", "", injected), SEEN, "draws a depth map by other shaders than own ones"),
            (seen_by("Sun", r#"<FROM value="5"/><TO value="3"/>"#, DEPTHS), SEEN, "covers distances FROM 5 TO 3"),
            (seen_by("Moon", "", DEPTHS), SEEN, "there is no light `Moon`"),
            (seen_by("Sun", "", DEPTHS), greater, "COMPARE_FUNC `GREATER` of `seen` is not supported"),
            (drawn, SEEN, "there is no camera `p#light-LightCam`"),
            (seen_by("Sun", "", "").replace("depthmap", "default"), SEEN, "has no colour channel"),
        ] {
            let said = lit_step(LIT, &pass, textures).refused(RasterChoice::Wgpu);
            // A camera that no pass creates is reported with its place in the library.
            let file = if expected.contains("LightCam") { "own.mlib:" } else { "own.xml:" };
            assert!(said.contains(file) && said.contains(expected), "{expected}: {said}");
        }
    }

    /// The depths of a pass, in a target without colours, shown by a quad: 0 at the near plane, 1 at the far plane.
    #[test]
    fn a_depth_is_a_texture_of_later_passes() {
        let passes = format!(
            r#"<pass class="default" name="draw"><scenes><scene name="Step"/></scenes><renderTarget name="map" fromLibrary="Own"/>{DEPTHS}</pass>
<pass class="quad" name="show"><texture name="Own::seen"/></pass>"#
        );
        let Some(picture) = Scene::with_passes(&Shader::default(), &passes).picture() else { return };
        // The camera is at z = 5, with near plane 1 and far plane 9; the two squares are at z = 0 and z = -1.
        let known = |x: u32, y: u32| {
            let near = (16..48).contains(&x) && (16..48).contains(&y);
            let depth = if near { 0.5 } else { 0.625 };
            [depth, depth, depth, 1.0]
        };
        assert_near(&picture, known, 1e-6);
        let depth = "#version 330\nout vec4 nowhere;\nvoid main() { nowhere = vec4(7.0); gl_FragDepth = gl_FragCoord.z * 0.5; }\n";
        let scene = Scene::with_passes(&Shader { depth, ..Shader::default() }, &passes);
        let half = |x, y| known(x, y).map(|value| if value == 1.0 { 1.0 } else { value * 0.5 });
        assert_near(&scene.picture().expect("a driver"), half, 1e-6);
        // The depth buffer of a pass that `deferred` draws is not kept.
        let other = passes.replace(DEPTHS, "").replace(r#"name="map""#, r#"name="buffers""#);
        let other = other
            .replace("Own::seen", "Own::depth")
            .replace("</scenes>", r#"</scenes><lights><light name="Sun"/></lights>"#);
        let said = Scene::with_passes(&Shader::default(), &other).refused(RasterChoice::Wgpu);
        assert!(said.contains("`depth`") || said.contains("depth buffer"), "{said}");
    }

    /// On the engine's square the texture's `u` runs along x, also after a rotation.
    #[test]
    fn tangents_point_along_u_in_the_world() {
        let vertex = "#version 330\nuniform mat4 pvm;\nin vec4 position;\nin vec4 tangent;\nin vec3 normal;\nout vec4 t;\nout vec3 n;\n\
                      void main() { t = tangent; n = normal; gl_Position = pvm * position; }\n";
        let fragment = "#version 330\nin vec4 t;\nin vec3 n;\nout vec4 color;\n\
                        void main() { color = vec4(abs(t.x), length(t.yz), abs(dot(t.xyz, n)), t.w); }\n";
        let Some(picture) = Scene::square(&Shader { vertex, fragment, ..Shader::default() }).picture() else { return };
        assert_near(&picture, |_, _| [1.0, 0.0, 0.0, 0.0], 1e-6);
    }

    /// A raster pass reads the output of another, both the right way up; booleans and arrays have the values in the files.
    #[test]
    fn a_raster_pass_samples_what_another_drew() {
        let fragment = "#version 330\nuniform sampler2D shaded;\nuniform bool on = true;\nuniform float w[2] = { 0.25, 0.75 };\n\
                        out vec4 color;\nvoid main() { vec4 p = texelFetch(shaded, ivec2(gl_FragCoord.xy), 0);\n\
                        color = vec4(p.rgb * (on ? w[0] + w[1] : 0.0), 1.0); }\n";
        let values = r#"<valueof uniform="shaded" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="1"/>"#;
        let drawn = |second: &str| {
            format!(
                r#"<pass class="default" name="draw"><scenes><scene name="Ball"/></scenes><renderTarget name="buffers" fromLibrary="Own"/>
<lights><light name="Sun"/></lights></pass>{second}"#
            )
        };
        let own = r#"<pass class="default" name="again"><scenes><scene name="Square"/></scenes>
<materialMaps><map fromMaterial="*" toLibrary="Own" toMaterial="own"/></materialMaps></pass>"#;
        let show = r#"<pass class="quad" name="show"><texture name="shaded" fromLibrary="Own"/></pass>"#;
        let shader = Shader { fragment, values, ..Shader::default() };
        let picture = |passes: &str| Scene::with_passes(&shader, &drawn(passes)).open(RasterChoice::Wgpu);
        if Scene::with_passes(&shader, &drawn(own)).picture().is_none() {
            return;
        }
        let [sampled, shown] =
            [own, show].map(|passes| picture(passes).expect("it opens").frame(&mut Silent).expect("it renders"));
        assert_near(
            &sampled,
            |x, y| {
                let [r, g, b, _] = shown.pixels[(y * SIDE + x) as usize];
                [r, g, b, 1.0]
            },
            1e-5,
        );
        assert!(shown.pixels.iter().filter(|pixel| pixel[0] > 0.0).count() > 1000, "the ball is seen");
        let said = Scene::with_passes(&shader, own).refused(RasterChoice::Wgpu);
        assert!(said.contains("reads `Own::shaded`, which no pass writes"), "{said}");
        let mapped = values.to_owned() + &value("w", "RENDERER", "CURRENT", "level");
        let said = Scene::with_passes(&Shader { values: &mapped, ..shader }, &drawn(own)).refused(RasterChoice::Wgpu);
        assert!(said.contains("own.mlib:") && said.contains("`w` is an array"), "{said}");
    }

    #[test]
    fn the_shipped_projects_render() {
        shipped("Bands.xml");
        shipped("DepthMap.xml");
    }

    fn shipped(name: &str) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/shaders").join(name);
        let settings = Settings { size: Some([SIDE; 2]), ..Settings::default() };
        let choice = Choice { raster: RasterChoice::Wgpu, ..Choice::CPU };
        if let Err(error) = curitiba::engines::rasteriser(choice) {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
            println!("skipped: {error}");
            return;
        }
        let mut renderer =
            curitiba::open(path, settings, choice, &mut Silent).unwrap_or_else(|e| panic!("{}", e.joined()));
        let picture = renderer.frame(&mut Silent).expect("it renders");
        let sky = [0.55, 0.7, 0.9];
        let is_sky = |pixel: &[f32; 4]| pixel.iter().zip(sky).all(|(a, b)| (a - b).abs() < 1e-6);
        let share = picture.pixels.iter().filter(|pixel| !is_sky(pixel)).count() as f32 / picture.pixels.len() as f32;
        assert!(share > 0.3, "{share} of the picture shows the square");
    }
}
