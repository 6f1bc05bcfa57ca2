//! Passes that do not clear their target (`COLOR_CLEAR`, `DEPTH_CLEAR` `false`) draw over the output of earlier passes. Pictures of two passes
//! are compared with pictures of one, on the processor and on a device.
//!
//! Pictures of the device need a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one the tests print `skipped`,
//! or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::own_shaders::has_driver;
use curitiba::pipeline::backend::Rect;
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::pixel_samples::PixelSamples;
use curitiba::pipeline::plan::Settings;
use curitiba::{Choice, OpenError, RasterChoice};
use tempfile::TempDir;

/// Sides that are no multiple of a tile's side.
const SIZE: [u32; 2] = [150, 100];

/// A project of one pipeline. The ball `A` is red; the box `B`, which half overlaps it, is green.
struct Scene(TempDir);

const COLOR: &str = r#"<COLOR_CLEAR value="false"/>"#;
const DEPTH: &str = r#"<DEPTH_CLEAR value="false"/>"#;
const SHOW: &str = r#"<pass class="quad" name="show"><texture name="shaded" fromLibrary="L"/></pass>"#;

impl Scene {
    fn new(format: &str, passes: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let [width, height] = SIZE;
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        write(
            "l.mlib",
            &format!(
                r#"<materialLib name="L"><renderTargets>
<renderTarget name="buffers"><SIZE width="{width}" height="{height}"/><CLEAR_VALUES r="0.125" g="0.25" b="0.5" a="1"/>
<colors><color name="shaded" internalFormat="{format}"/><color name="place" internalFormat="RGBA32F"/><color name="side" internalFormat="RGBA32F"/></colors></renderTarget>
<renderTarget name="rays"><SIZE width="{width}" height="{height}"/><colors><color name="share" internalFormat="RGBA32F"/></colors></renderTarget>
</renderTargets>
<materials><material name="red"><color><DIFFUSE r="1" g="0.1" b="0.2"/></color></material>
<material name="green"><color><DIFFUSE r="0.1" g="1" b="0.3"/></color></material></materials></materialLib>"#
            ),
        );
        write(
            "p.xml",
            &format!(
                r#"<project name="p" width="{width}" height="{height}"><assets>
<scenes><scene name="A"><geometry name="a" type="SPHERE" slices="24" stacks="16" material="red"/></scene>
<scene name="B"><geometry name="b" type="BOX" material="green"><SCALE x="0.6" y="0.6" z="0.6"/><ROTATE x="1" y="1" z="0" w="30"/><TRANSLATE x="0.9" y="0.2" z="0.2"/></geometry></scene></scenes>
<viewports><viewport name="V"><CLEAR_COLOR r="0.125" g="0.25" b="0.5"/></viewport>
<viewport name="Right"><CLEAR_COLOR r="0.125" g="0.25" b="0.5"/><ORIGIN x="0.5" y="0"/><SIZE width="0.5" height="1"/></viewport></viewports>
<cameras><camera name="C"><viewport name="V"/><projection TYPE="PERSPECTIVE" FOV="50" NEAR="1" FAR="20"/>
<POSITION x="0.4" y="0.3" z="4"/><VIEW x="0" y="0" z="-1"/><UP x="0" y="1" z="0"/></camera></cameras>
<lights><light name="Sun" type="directional"><DIRECTION x="0.9" y="-0.1" z="-0.15"/><COLOR r="1" g="1" b="1"/></light></lights>
<materialLibs><materialLib filename="l.mlib"/></materialLibs></assets>
<pipelines><pipeline name="p" default="true" defaultCamera="C">{passes}</pipeline></pipelines></project>"#
            ),
        );
        Self(folder)
    }

    fn open(&self, raster: RasterChoice, settings: Settings) -> Result<Renderer, OpenError> {
        let choice = Choice { raster, ..Choice::CPU };
        curitiba::open(self.0.path().join("p.xml"), settings, choice, &mut Silent)
    }

    fn picture(&self, raster: RasterChoice) -> Image {
        let mut renderer = self.open(raster, Settings::default()).unwrap_or_else(|error| panic!("{}", error.joined()));
        let first = renderer.frame(&mut Silent).expect("it renders");
        // Later frames do not start from the output of earlier frames.
        assert_eq!(first, renderer.frame(&mut Silent).expect("it renders"), "the second frame");
        first
    }

    fn refused(&self) -> String {
        self.open(RasterChoice::Cpu, Settings::default()).err().map(|error| error.joined()).unwrap_or_default()
    }
}

/// A pass that draws scenes into the target, or into the window.
fn draw(name: &str, scenes: &[&str], window: bool, more: &str) -> String {
    let target = if window { "" } else { r#"<renderTarget name="buffers" fromLibrary="L"/>"# };
    let scenes: String = scenes.iter().map(|scene| format!(r#"<scene name="{scene}"/>"#)).collect();
    format!(
        r#"<pass class="default" name="{name}"><scenes>{scenes}</scenes>{target}<lights><light name="Sun"/></lights>
<materialMaps><map fromMaterial="red" toLibrary="L" toMaterial="red"/><map fromMaterial="green" toLibrary="L" toMaterial="green"/></materialMaps>{more}</pass>"#
    )
}

/// A pipeline of drawing passes, and a quad pass that shows their target.
fn pipeline(window: bool, passes: &[(&str, &[&str], &str)]) -> String {
    let drawn: String = passes.iter().map(|(name, scenes, more)| draw(name, scenes, window, more)).collect();
    if window { drawn } else { drawn + SHOW }
}

fn rasterisers() -> Vec<RasterChoice> {
    if has_driver() { vec![RasterChoice::Cpu, RasterChoice::Wgpu] } else { vec![RasterChoice::Cpu] }
}

/// A picture whose pixels are taken from others.
fn made(of: &Image, pixel: impl Fn(usize) -> [f32; 4]) -> Image {
    Image { pixels: (0..of.pixels.len()).map(pixel).collect(), ..of.clone() }
}

#[test]
fn two_passes_that_keep_colour_and_depth_draw_what_one_pass_draws() {
    for raster in rasterisers() {
        for format in ["RGBA32F", "RGBA16F", "RGBA8"] {
            for window in [false, true] {
                let picture =
                    |passes: &[(&str, &[&str], &str)]| Scene::new(format, &pipeline(window, passes)).picture(raster);
                let (a, b): (&[&str], &[&str]) = (&["A"], &["B"]);
                let both = [COLOR, DEPTH].concat();
                let one = picture(&[("one", &["A", "B"], "")]);
                let (only_a, only_b) = (picture(&[("a", a, "")]), picture(&[("b", b, "")]));
                let background = only_a.pixels[0];
                // Control: each of the two hides a part of the other, so drawing one over the other does not give the picture.
                let share = |hidden: &Image| {
                    let seen = |index: &usize| hidden.pixels[*index] != background;
                    let other = |index: &usize| one.pixels[*index] != hidden.pixels[*index];
                    (0..one.pixels.len()).filter(|index| seen(index) && other(index)).count()
                };
                assert!(share(&only_a) > 100 && share(&only_b) > 100, "{} {}", share(&only_a), share(&only_b));

                assert_eq!(picture(&[("a", a, ""), ("b", b, &both)]), one, "{raster:?} {format} {window}");
                assert_eq!(picture(&[("b", b, ""), ("a", a, &both)]), one, "{raster:?} {format} {window}");
                // A third pass is tested against the depth of both.
                let thrice = picture(&[("a", a, ""), ("b", b, &both), ("again", a, &both)]);
                assert_eq!(thrice, one, "{raster:?} {format} {window}");
                // The older notation for the depth's state.
                let older = [COLOR, r#"<depth test="true" write="true" clear="false"/>"#].concat();
                assert_eq!(picture(&[("a", a, ""), ("b", b, &older)]), one, "{raster:?} {format} {window}");

                // If only the colour is kept, the second pass is on top.
                let on_top = made(&one, |index| match only_b.pixels[index] {
                    pixel if pixel == background => only_a.pixels[index],
                    pixel => pixel,
                });
                assert_ne!(on_top, one);
                assert_eq!(picture(&[("a", a, ""), ("b", b, COLOR)]), on_top, "{raster:?} {format} {window}");
                // If only the depth is kept, the second pass is visible where it is nearer.
                let nearer = made(&one, |index| match only_b.pixels[index] {
                    pixel if pixel == one.pixels[index] => pixel,
                    _ => background,
                });
                assert_ne!(nearer, only_b);
                assert_eq!(picture(&[("a", a, ""), ("b", b, DEPTH)]), nearer, "{raster:?} {format} {window}");
                // A first pass that keeps everything still starts from a cleared target.
                assert_eq!(picture(&[("a", a, &both)]), only_a, "{raster:?} {format} {window}");
            }
        }
    }
}

#[test]
fn a_quad_between_leaves_the_far_plane_and_a_second_viewport_keeps_the_first() {
    for raster in rasterisers() {
        let (a, b) = (draw("a", &["A"], true, ""), |more: &str| draw("b", &["B"], true, more));
        let both = [COLOR, DEPTH].concat();
        let filled = format!("{}{SHOW}", draw("fill", &["A"], false, ""));
        let picture = |passes: String| Scene::new("RGBA32F", &passes).picture(raster);
        let on_top = picture([&*a, &b(COLOR)].concat());
        assert_eq!(picture([&*a, &filled, &b(&both)].concat()), on_top, "{raster:?}: the quad clears the depth");
        let kept = filled.replace("name=\"show\">", &format!("name=\"show\">{DEPTH}"));
        let one = picture(draw("one", &["A", "B"], true, ""));
        assert_eq!(picture([&*a, &kept, &b(&both)].concat()), one, "{raster:?}: the quad keeps the depth");
        // The second pass draws only the right half, with the aspect of that viewport. The left half still shows the first pass.
        let right = picture([&*a, &b(&format!(r#"{both}<viewport name="Right"/>"#))].concat());
        let whole = picture(a);
        let [width, _] = SIZE.map(|side| side as usize);
        let differs = |index: &usize| right.pixels[*index] != whole.pixels[*index];
        let columns: Vec<usize> = (0..whole.pixels.len()).filter(differs).map(|index| index % width).collect();
        assert!(columns.len() > 100 && columns.iter().all(|column| *column >= width / 2), "{raster:?}");
    }
}

#[test]
fn parts_and_samples_are_those_of_one_pass() {
    for raster in rasterisers() {
        let both = [COLOR, DEPTH].concat();
        let two = Scene::new("RGBA16F", &pipeline(false, &[("a", &["A"], ""), ("b", &["B"], &both)]));
        let one = Scene::new("RGBA16F", &pipeline(false, &[("one", &["A", "B"], "")]));
        let crop = Rect { x: 70, y: 30, width: 40, height: 50 };
        for (crop, samples) in [(Some(crop), 1), (None, 4)] {
            let picture = |scene: &Scene| {
                let opened = scene.open(raster, Settings { crop, ..Settings::default() });
                let mut renderer = opened.unwrap_or_else(|error| panic!("{}", error.joined()));
                renderer.set_pixel_samples(PixelSamples::new(samples).expect("a power of two")).expect("they are set");
                renderer.frame(&mut Silent).expect("it renders")
            };
            assert_eq!(picture(&two), picture(&one), "{raster:?}");
        }
    }
}

/// If only the second pass changes, the first is drawn again as well.
#[test]
fn a_change_starts_from_what_the_first_pass_drew() {
    let both = [COLOR, DEPTH].concat();
    let passes = pipeline(false, &[("a", &["A"], ""), ("b", &["B"], &both)]);
    let scene = Scene::new("RGBA32F", &passes);
    for raster in rasterisers() {
        let mut renderer = scene.open(raster, Settings::default()).unwrap_or_else(|error| panic!("{}", error.joined()));
        let first = renderer.frame(&mut Silent).expect("it renders");
        let only_a = Scene::new("RGBA32F", &pipeline(false, &[("a", &["A"], "")])).picture(raster);
        let only_b = Scene::new("RGBA32F", &pipeline(false, &[("b", &["B"], "")])).picture(raster);
        for (pass, left) in [("b", only_a), ("a", only_b)] {
            renderer.set_enabled(pass, false).expect("it is switched off");
            assert_eq!(renderer.frame(&mut Silent).expect("it renders"), left, "{raster:?} without {pass}");
            renderer.set_enabled(pass, true).expect("it is switched on");
            assert_eq!(renderer.frame(&mut Silent).expect("it renders"), first, "{raster:?} with {pass} again");
        }
    }
}

/// The program of shadows for these scenes on the target's positions, and a quad that shows its output.
pub(crate) fn shadows(scenes: &[&str]) -> String {
    let scenes: String = scenes.iter().map(|scene| format!(r#"<scene name="{scene}"/>"#)).collect();
    format!(
        r#"<pass class="optix" name="shadows"><scenes>{scenes}</scenes>
<renderTarget name="rays" fromLibrary="L"/><lights><light name="Sun"/></lights>
<optixEntryPoint><optixProgram type="RayGen" file="optix/deferredShadows.ptx" proc="buffer_camera"/></optixEntryPoint>
<optixDefaultMaterial><optixProgram type="Any_Hit" ray="Shadow" file="optix/deferredShadows.ptx" proc="any_hit_shadow"/></optixDefaultMaterial>
<optixVertexAttributes><attribute name="position"/></optixVertexAttributes>
<optixGlobalAttributes><valueof optixVar="lightDir" type="CURRENT" context="LIGHT" id="0" component="DIRECTION"/></optixGlobalAttributes>
<optixInput><buffer var="pos_buffer" texture="L::place"/></optixInput></pass>
<pass class="quad" name="show"><texture name="share" fromLibrary="L"/></pass>"#
    )
}

/// Positions and triangle ids are kept as colours are, because rays start from them.
#[test]
fn rays_start_from_what_is_kept() {
    let both = [COLOR, DEPTH].concat();
    let first = draw("a", &["A", "B"], false, "");
    for raster in rasterisers() {
        let picture =
            |more: &str| Scene::new("RGBA32F", &[&*first, more, &shadows(&["A", "B"])].concat()).picture(raster);
        // The second pass draws the same triangles, none of them nearer.
        let one = picture("");
        assert_eq!(picture(&draw("again", &["A", "B"], false, &both)), one, "{raster:?}");
        let dark = one.pixels.iter().filter(|pixel| pixel[0] < 1.0).count();
        assert!(dark > 50 && dark < one.pixels.len() / 2, "{dark} pixels are in the shadow");
    }
    let other = Scene::new(
        "RGBA32F",
        &[&*draw("a", &["A"], false, ""), &draw("b", &["A", "B"], false, &both), &shadows(&["A", "B"])].concat(),
    );
    let text = other.refused();
    assert!(text.contains("pass `b` draws over what pass `a` drew of other scenes"), "{text}");
}

#[test]
fn what_cannot_be_kept_is_refused_with_the_reason() {
    let half = draw("half", &["A"], true, r#"<viewport name="Right"/>"#);
    let text = Scene::new("RGBA8", &[half, draw("b", &["B"], true, COLOR)].concat()).refused();
    let wanted = "pass `b` has COLOR_CLEAR false, and pass `half` wrote only a part of what it draws over";
    assert!(text.contains(wanted) && text.contains("p.xml:"), "{text}");
    let value = Scene::new("RGBA8", &draw("a", &["A"], true, r#"<COLOR_CLEAR value="maybe"/>"#)).refused();
    assert!(value.contains("maybe") && value.contains("p.xml:"), "{value}");
    let missing = Scene::new("RGBA8", &draw("a", &["A"], true, "<DEPTH_CLEAR/>")).refused();
    assert!(missing.contains("lacks `value`"), "{missing}");
}

#[test]
fn a_camera_with_another_viewport_leaves_nothing_of_the_first() {
    let scene = Scene::new("RGBA32F", &pipeline(true, &[("a", &["A"], "")]));
    let file = scene.0.path().join("p.xml");
    let text = std::fs::read_to_string(&file).expect("read");
    let other = r#"<camera name="R"><viewport name="Right"/><projection TYPE="PERSPECTIVE" FOV="50" NEAR="1" FAR="20"/>
<POSITION x="0.4" y="0.3" z="4"/><VIEW x="0" y="0" z="-1"/><UP x="0" y="1" z="0"/></camera></cameras>"#;
    std::fs::write(&file, text.replace("</cameras>", other)).expect("written");
    let open = |settings| scene.open(RasterChoice::Cpu, settings).unwrap_or_else(|error| panic!("{}", error.joined()));
    let fresh = Settings { camera: Some("R".to_owned()), ..Settings::default() };
    let expected = open(fresh).frame(&mut Silent).expect("it renders");
    let mut renderer = open(Settings::default());
    renderer.frame(&mut Silent).expect("it renders");
    renderer.set_camera(Some("R")).expect("a camera");
    assert_eq!(renderer.update(&mut Silent).expect("it renders"), expected);
}
