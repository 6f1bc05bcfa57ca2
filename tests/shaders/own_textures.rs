//! Cube maps of six files, and textures of random numbers, in own shaders: pictures with known pixels, and errors with their places in the
//! files.
//!
//! Pictures need the feature `glsl` and a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without a driver, the tests print
//! `skipped`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::own_shaders::{assert_near, has_driver};
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::{Image, PixelFormat, write_png};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::{Contents, Distribution};
use curitiba::{Choice, OpenError, RasterChoice};

const FACES: [&str; 6] = ["PosX", "NegX", "PosY", "NegY", "PosZ", "NegZ"];

const LIBRARY: &str = r#"<materialLib name="L">
<textures>
<cubeMap name="cube" FILES mipmap="true"/>
<texture name="flat" filename="0.png"/>
<texture name="random"><WIDTH value="64"/><HEIGHT value="64"/>CONTENT</texture>
</textures>
<shaders><shader name="quad" vs="quad.vert" ps="own.frag"/><shader name="scene" vs="scene.vert" ps="own.frag"/><shader name="make" cs="make.comp"/></shaders>
<materials>
<material name="quad"><shader name="quad"><values>VALUES</values></shader>BOUND</material>
<material name="scene"><shader name="scene"><values>VALUES
<valueof uniform="pvm" type="RENDERER" context="CURRENT" component="PROJECTION_VIEW_MODEL"/></values></shader>BOUND</material>
<material name="make"><shader name="make"/><imageTextures><imageTexture UNIT="1" texture="random"/></imageTextures></material>
</materials></materialLib>"#;

const VALUES: &str = r#"<valueof uniform="read" type="TEXTURE_BINDING" context="CURRENT" component="UNIT" id="0"/>"#;

const PROJECT: &str = r#"<project name="p" width="64" height="64"><assets>
<scenes><scene name="S"><geometry name="s" type="SQUARE" material="s"><ROTATE x="1" y="0" z="0" w="90"/></geometry></scene></scenes>
<cameras><camera name="C"><projection TYPE="ORTHO" LEFT="-1" RIGHT="1" BOTTOM="-1" TOP="1" NEAR="1" FAR="9"/>
<POSITION x="0" y="0" z="5"/><VIEW x="0" y="0" z="-1"/><UP x="0" y="1" z="0"/></camera></cameras>
<lights><light name="Sun" type="directional"><DIRECTION x="0" y="0" z="-1"/></light></lights>
<materialLibs><materialLib filename="p.mlib"/></materialLibs>
</assets><pipelines><pipeline name="p" default="true" defaultCamera="C">
PASSES
</pipeline></pipelines></project>"#;

const QUAD: &str = r#"<pass class="quad" name="quad"><material name="quad" fromLibrary="L"/></pass>"#;
const SCENE: &str = r#"<pass class="default" name="scene"><scenes><scene name="S"/></scenes><lights><light name="Sun"/></lights>
<materialMaps><map fromMaterial="*" toLibrary="L" toMaterial="scene"/></materialMaps></pass>"#;

/// Ten columns of pixels for each face of the cube, and 16 rows for each of its four texels: `LOOK` gets the direction to a texel's
/// centre. The tables are those of the OpenGL specification, section 8.13.
const CUBE: &str = "#version 430
uniform samplerCube read;
out vec4 color;
const vec3 major[6] = vec3[6](vec3(1, 0, 0), vec3(-1, 0, 0), vec3(0, 1, 0), vec3(0, -1, 0), vec3(0, 0, 1), vec3(0, 0, -1));
const vec3 across[6] = vec3[6](vec3(0, 0, -1), vec3(0, 0, 1), vec3(1, 0, 0), vec3(1, 0, 0), vec3(1, 0, 0), vec3(-1, 0, 0));
const vec3 up[6] = vec3[6](vec3(0, -1, 0), vec3(0, -1, 0), vec3(0, 0, 1), vec3(0, 0, -1), vec3(0, -1, 0), vec3(0, -1, 0));
void main() {
    int face = min(int(gl_FragCoord.x) / 10, 5), texel = int(gl_FragCoord.y) / 16;
    vec2 st = vec2(float(texel % 2), float(texel / 2)) - 0.5;
    vec3 direction = major[face] + st.x * across[face] + st.y * up[face];
    color = LOOK;
}
";

/// The colour of a texel of a face: the face, and whether the texel is in the right column and in the upper row.
fn texel(face: u32, right: bool, upper: bool) -> [f32; 4] {
    [face as f32 * 32.0 / 255.0, f32::from(u8::from(right)), f32::from(u8::from(upper)), 1.0]
}

struct Project {
    folder: tempfile::TempDir,
}

impl Project {
    fn new(passes: &str, texture: &str, fragment: &str) -> Self {
        Self { folder: tempfile::tempdir().expect("a folder") }.made(passes, texture, fragment)
    }

    fn made(self, passes: &str, texture: &str, fragment: &str) -> Self {
        for face in 0..6 {
            let mut image = Image::filled(2, 2, [0.0; 4]);
            for (index, pixel) in image.pixels.iter_mut().enumerate() {
                *pixel = texel(face, index % 2 == 1, index < 2);
            }
            write_png(&self.folder.path().join(format!("{face}.png")), &image).expect("written");
        }
        let files = (0..).zip(FACES).map(|(index, face): (u32, _)| format!("file{face}=\"{index}.png\" "));
        let bound = format!(r#"<textures><texture UNIT="0" name="{texture}"/></textures>"#);
        let library =
            LIBRARY.replace("FILES", &files.collect::<String>()).replace("VALUES", VALUES).replace("BOUND", &bound);
        let scene =
            "#version 430\nuniform mat4 pvm;\nin vec4 position;\nvoid main() { gl_Position = pvm * position; }\n";
        let quad = "#version 430\nin vec4 position;\nvoid main() { gl_Position = position; }\n";
        self.with("p.xml", &PROJECT.replace("PASSES", passes))
            .with("p.mlib", &library.replace("CONTENT", r#"<CONTENT value="RANDOM_UNIFORM"/>"#))
            .with("scene.vert", scene)
            .with("quad.vert", quad)
            .with("own.frag", fragment)
    }

    fn with(self, name: &str, text: &str) -> Self {
        std::fs::write(self.folder.path().join(name), text).expect("written");
        self
    }

    /// With a text of the library replaced.
    fn edited(self, from: &str, to: &str) -> Self {
        let library = std::fs::read_to_string(self.folder.path().join("p.mlib")).expect("it is there");
        assert!(library.contains(from), "{from}");
        self.with("p.mlib", &library.replace(from, to))
    }

    fn open(&self, settings: Settings) -> Result<Renderer, OpenError> {
        let choice = Choice { raster: RasterChoice::Auto, ..Choice::CPU };
        curitiba::open(self.folder.path().join("p.xml"), settings, choice, &mut Silent)
    }

    /// The picture of the first frame. The second frame is the same.
    fn picture(&self) -> Image {
        let mut renderer = self.open(Settings::default()).unwrap_or_else(|error| panic!("{}", error.joined()));
        let first = renderer.frame(&mut Silent).expect("it renders");
        assert_eq!(renderer.frame(&mut Silent).expect("it renders").pixels, first.pixels, "a second frame");
        first
    }

    fn refused(&self) -> String {
        self.open(Settings::default()).err().map_or_else(|| panic!("it is refused"), |error| error.joined())
    }
}

#[test]
fn cube_maps_are_looked_up_by_direction() {
    if !has_driver() {
        return;
    }
    // As in every texture of the engine, rows count upwards from the bottom of each image: the lower rows of pixels show lower texels.
    let known = |x: u32, y: u32| {
        let texel_of = (63 - y) / 16;
        texel((x / 10).min(5), texel_of % 2 == 1, texel_of / 2 == 1)
    };
    // The mean of the four texels, in bytes.
    let mean = |x: u32, _| [(x / 10).min(5) as f32 * 32.0 / 255.0, 0.5, 0.5, 1.0];
    let look = |look: &str, passes: &str| Project::new(passes, "cube", &CUBE.replace("LOOK", look)).picture();
    for passes in [QUAD, SCENE] {
        assert_near(&look("textureLod(read, direction, 0.0)", passes), known, 1e-6);
        assert_near(&look("textureLod(read, 7.0 * direction, 0.0)", passes), known, 1e-6);
        // At the middle of each face, because near its borders the adjacent faces have a share.
        assert_near(&look("textureLod(read, major[face], 1.0)", passes), mean, 0.6 / 255.0);
        assert_near(&look("textureGrad(read, direction, vec3(0.0), vec3(0.0))", passes), known, 1e-6);
        let size = "vec4(float(textureSize(read, 0).x) / 4.0, float(textureSize(read, 1).y), 0.0, 1.0)";
        assert_near(&look(size, passes), |_, _| [0.5, 1.0, 0.0, 1.0], 0.0);
    }
    // Neighbouring pixels of a block have the same direction.
    let picture = look("texture(read, direction)", QUAD);
    for (x, y) in [(5, 8), (15, 24), (25, 40), (35, 56), (45, 8), (55, 40)] {
        let close = picture.pixels[(y * 64 + x) as usize].iter().zip(known(x, y)).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(close, "{x}, {y}: {:?}", picture.pixels[(y * 64 + x) as usize]);
    }
    let old = CUBE.replace("LOOK", "textureCubeLod(read, direction, 0.0)");
    assert_near(&Project::new(QUAD, "cube", &old).picture(), known, 1e-6);
    // A unit without a bound texture is black.
    let unbound = Project::new(QUAD, "cube", &CUBE.replace("LOOK", "texture(read, direction)"))
        .edited("UNIT=\"0\"", "UNIT=\"3\"");
    assert_near(&unbound.picture(), |_, _| [0.0, 0.0, 0.0, 1.0], 1e-6);
}

#[test]
fn what_is_wrong_with_a_cube_map_is_said_with_its_place() {
    let project = |look: &str| Project::new(QUAD, "cube", &CUBE.replace("LOOK", look));
    let look = "texture(read, direction)";
    let flat =
        "#version 430\nuniform sampler2D read;\nout vec4 color;\nvoid main() { color = texture(read, vec2(0.5)); }\n";
    let cases = [
        (project(look).edited("fileNegY=\"3.png\" ", "").refused(), "p.mlib:3:1", "<cubeMap> lacks `fileNegY`"),
        (project(look).edited("\"3.png\"", "\"9.png\"").refused(), "p.mlib:3:", "9.png: there is no such file"),
        (Project::new(QUAD, "flat", &CUBE.replace("LOOK", look)).refused(), "p.mlib:", "`flat` is no cube map"),
        (Project::new(QUAD, "cube", flat).refused(), "p.mlib:", "`cube` is a cube map, which a samplerCube samples"),
        (
            Project::new(QUAD, "cube", &flat.replace("texture(read, vec2(0.5))", "textureCube(read, vec3(0.5))"))
                .refused(),
            "own.frag:4:",
            "is no samplerCube",
        ),
        (
            project("texelFetch(read, ivec2(0), 0)").refused(),
            "own.frag:11:",
            "valid: texture, textureLod, textureGrad, textureSize",
        ),
    ];
    for (said, place, what) in cases {
        assert!(said.contains(place) && said.contains(what), "`{place}` and `{what}`: {said}");
    }
    // The two stages declare one sampler with two types.
    let vertex = "#version 430\nuniform sampler2D read;\nin vec4 position;\nvoid main() { gl_Position = position + texelFetch(read, ivec2(0), 0) * 0.0; }\n";
    let said = project(look).with("quad.vert", vertex).refused();
    assert!(said.contains("own.frag:2:") && said.contains("a sampler of another type in the vertex shader"), "{said}");
    if !has_driver() {
        return;
    }
    // The contents of the files are checked when they are read.
    let project = project(look);
    for size in [[2, 1], [4, 4]] {
        write_png(&project.folder.path().join("4.png"), &Image::filled(size[0], size[1], [0.5; 4])).expect("written");
        let mut renderer = project.open(Settings::default()).unwrap_or_else(|error| panic!("{}", error.joined()));
        let said = renderer.frame(&mut Silent).expect_err("it is refused").to_string();
        let what = format!("4.png: an image of a cube map has {} x {} texels", size[0], size[1]);
        assert!(said.contains("p.xml:") && said.contains(&what) && said.contains("valid: 2 x 2"), "{said}");
    }
}

/// The numbers of a texture of 64 x 64; their generator has tests of its own.
fn random(distribution: Distribution, seed: u64, format: PixelFormat) -> Vec<[f32; 4]> {
    let mut texels = vec![[0.0; 4]; 64 * 64];
    Contents { distribution, seed }.fill(format, 64, &mut texels);
    texels
}

const FETCH: &str = "#version 430\nuniform sampler2D read;\nout vec4 color;\nvoid main() { color = texelFetch(read, ivec2(gl_FragCoord.xy), 0); }\n";

#[test]
fn textures_hold_the_random_numbers_of_their_seed() {
    if !has_driver() {
        return;
    }
    let uniform = random(Distribution::Uniform, 0, PixelFormat::Rgba32Float);
    for passes in [QUAD, SCENE, r#"<pass class="quad" name="quad"><texture name="random" fromLibrary="L"/></pass>"#] {
        assert_eq!(Project::new(passes, "random", FETCH).picture().pixels, uniform, "{passes}");
    }
    let content = r#"<CONTENT value="RANDOM_UNIFORM"/>"#;
    let of = |to: &str| Project::new(QUAD, "random", FETCH).edited(content, to).picture().pixels;
    assert_eq!(
        of(&format!(r#"{content}<SEED value="7"/>"#)),
        random(Distribution::Uniform, 7, PixelFormat::Rgba32Float)
    );
    assert_eq!(of(r#"<CONTENT value="RANDOM_NORMAL"/>"#), random(Distribution::Normal, 0, PixelFormat::Rgba32Float));
    // As in the engine, the numbers are 32-bit floats, whatever format is declared, and there are as many as the format has channels.
    assert_eq!(of(&format!(r#"{content}<INTERNAL_FORMAT value="RGBA8"/>"#)), uniform);
    let red = random(Distribution::Uniform, 0, PixelFormat::R32Float);
    assert_eq!(of(&format!(r#"{content}<INTERNAL_FORMAT value="R8"/>"#)), red);
    assert!(red.iter().all(|texel| texel[1..] == [0.0, 0.0, 1.0]) && red[0] != uniform[0]);
    // The texture has the project's size, whatever the window's size.
    let settings = Settings { size: Some([32, 16]), ..Settings::default() };
    let mut renderer =
        Project::new(QUAD, "random", FETCH).open(settings).unwrap_or_else(|error| panic!("{}", error.joined()));
    let small = renderer.frame(&mut Silent).expect("it renders");
    let rows: Vec<[f32; 4]> = (48..64).flat_map(|y| uniform[y * 64..][..32].to_vec()).collect();
    assert_eq!((small.width, small.height, small.pixels), (32, 16, rows), "the lower left of it");
}

/// Every frame starts with the random numbers, although a pass stores to them.
#[test]
fn passes_store_to_random_numbers() {
    if !has_driver() {
        return;
    }
    let make = "#version 430
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 1) uniform image2D numbers;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID);
    if (at.x < 32) imageStore(numbers, at, imageLoad(numbers, at) + vec4(1.0));
}
";
    let pass = r#"<pass class="compute" name="make"><material name="make" fromLibrary="L" dimX="8" dimY="8"/></pass>"#;
    let uniform = random(Distribution::Uniform, 0, PixelFormat::Rgba32Float);
    let project = Project::new(&format!("{pass}{QUAD}"), "random", FETCH).with("make.comp", make);
    let known = |x: u32, y: u32| uniform[(y * 64 + x) as usize].map(|value| if x < 32 { value + 1.0 } else { value });
    assert_near(&project.picture(), known, 0.0);
    // A pass before the storing one reads the original numbers.
    let target = r#"<renderTargets><renderTarget name="t"><SIZE width="64" height="64"/><colors><color name="copy" internalFormat="RGBA32F"/></colors></renderTarget></renderTargets><shaders>"#;
    let copy = QUAD.replace("name=\"quad\">", "name=\"copy\"><renderTarget name=\"t\" fromLibrary=\"L\"/>");
    let show = r#"<pass class="quad" name="show"><texture name="copy" fromLibrary="L"/></pass>"#;
    let both = r#"<pass class="quad" name="both"><texture name="random" fromLibrary="L"/></pass>"#;
    let project = Project::new(&format!("{copy}{pass}{both}{show}"), "random", FETCH)
        .edited("<shaders>", target)
        .with("make.comp", make);
    assert_eq!(project.picture().pixels, uniform);
}

#[test]
fn what_is_wrong_with_contents_is_said_with_its_place() {
    let content = r#"<CONTENT value="RANDOM_UNIFORM"/>"#;
    let say = |to: &str| Project::new(QUAD, "random", FETCH).edited(content, to).refused();
    let said = say(r#"<CONTENT value="RANDOM"/>"#);
    assert!(
        said.contains("p.mlib:5:") && said.contains("filled with `RANDOM`") && said.contains("RANDOM_NORMAL"),
        "{said}"
    );
    let said = say(&format!(r#"{content}<SEED value="-1"/>"#));
    assert!(said.contains("p.mlib:5:") && said.contains("`-1` is no seed"), "{said}");
    // Without contents, the texture holds only what a pass has stored.
    let said = say(r#"<CONTENT value="NONE"/><INTERNAL_FORMAT value="RGBA32F"/>"#);
    assert!(said.contains("p.xml:") && said.contains("reads `L::random`, which no pass writes"), "{said}");
}
