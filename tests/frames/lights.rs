//! Several lights, point lights and spot lights, from a project file to the picture: compared with the reference of the picture and with closed
//! forms, on the processor and on a device. Also settings with which they are refused.
//!
//! Pictures of the device need a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one those tests print `skipped`,
//! or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`. Pictures of an NVIDIA GPU are skipped without one, or fail with
//! `CURITIBA_REQUIRE_CUDA_TESTS=1`.

use crate::own_shaders::has_driver;
use curitiba::bench::Case;
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::metrics::{self, Options};
use curitiba::pipeline::pixel_samples::PixelSamples;
use curitiba::pipeline::plan::Settings;
use curitiba::reference::{Made, Of, References};
use curitiba::shard::Shard;
use curitiba::{BackendChoice, Choice, RasterChoice};
use glam::Vec3;
use std::path::PathBuf;
use std::time::Duration;
use tempfile::TempDir;

/// Sides that are no multiple of a tile's side.
const SIZE: [u32; 2] = [90, 70];

const LIGHTS: &str = r#"<light name="Sun" type="directional"><DIRECTION x="0.6" y="-1" z="-0.4"/><COLOR r="0.4" g="0.4" b="0.35"/></light>
<light name="Bulb"><POSITION x="-1.2" y="1.5" z="0.6"/><COLOR r="0.9" g="0.3" b="0.1"/><CONSTANT_ATT value="0.2"/><QUADRATIC_ATT value="0.5"/></light>
<light name="Spot"><POSITION x="1.5" y="3" z="1"/><COLOR r="0.1" g="0.4" b="0.9"/><SPOT_DIRECTION x="-0.4" y="-1" z="-0.3"/>
<SPOT_CUTOFF value="35"/><SPOT_INNER value="15"/></light>"#;

const ALL: &str = "<light>Sun</light><light>Bulb</light><light>Spot</light>";

/// A floor, a ball, a box and a square of glass.
struct Scene(TempDir);

impl Scene {
    fn new(lights: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let [width, height] = SIZE;
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        write(
            "l.mlib",
            &format!(
                r#"<materialLib name="L"><renderTargets>
<renderTarget name="buffers"><SIZE width="{width}" height="{height}"/><CLEAR_VALUES r="0.1" g="0.2" b="0.3" a="1"/>
<colors><color name="shaded" internalFormat="RGBA32F"/><color name="pos" internalFormat="RGBA32F"/><color name="norm" internalFormat="RGBA32F"/></colors></renderTarget>
<renderTarget name="rays"><SIZE width="{width}" height="{height}"/><colors><color name="share" internalFormat="RGBA32F"/></colors></renderTarget>
</renderTargets>
<shaders><shader name="combine" ps="combine.frag" vs="combine.vert"/></shaders>
<materials><material name="red"><color><DIFFUSE r="0.9" g="0.3" b="0.2"/></color></material>
<material name="green"><color><DIFFUSE r="0.2" g="0.8" b="0.4"/></color></material>
<material name="grey"><color><DIFFUSE r="0.7" g="0.7" b="0.7"/></color></material>
<material name="pane"><color><DIFFUSE r="1" g="0" b="1" a="0"/></color></material>
<material name="combine"><shader name="combine"/><textures><texture unit="0" name="shaded"/><texture unit="1" name="share"/></textures></material>
</materials></materialLib>"#
            ),
        );
        let pass = |class: &str, name: &str, target: &str, rest: &str| {
            format!(
                r#"<pass class="{class}" name="{name}"><scenes><scene>Main</scene></scenes>
<renderTarget name="{target}" fromLibrary="L"/><lights>{lights}</lights>{rest}</pass>"#
            )
        };
        let program = |kind: &str, ray: &str, stem: &str, name: &str| {
            format!(r#"<optixProgram type="{kind}" ray="{ray}" file="{stem}.ptx" proc="{name}"/>"#)
        };
        let entry = |stem: &str| {
            format!(
                r#"<optixEntryPoint><optixProgram type="RayGen" file="{stem}.ptx" proc="buffer_camera"/></optixEntryPoint>"#
            )
        };
        let light = r#"<valueof optixVar="lightDir" type="CURRENT" context="LIGHT" id="0" component="DIRECTION"/>"#;
        let color = r#"<valueof optixVar="lightColor" type="CURRENT" context="LIGHT" id="0" component="COLOR"/>"#;
        let buffer = |name: &str, texture: &str| format!(r#"<buffer var="{name}" texture="L::{texture}"/>"#);
        let shadows = [
            entry("deferredShadows"),
            format!(
                "<optixDefaultMaterial>{}</optixDefaultMaterial>",
                program("Any_Hit", "Shadow", "deferredShadows", "any_hit_shadow")
            ),
            r#"<optixVertexAttributes><attribute name="position"/></optixVertexAttributes>"#.to_owned(),
            format!(
                "<optixGlobalAttributes>{light}</optixGlobalAttributes><optixInput>{}</optixInput>",
                buffer("pos_buffer", "pos")
            ),
        ]
        .concat();
        let glass = [("Closest_Hit", "Phong", "closest_hit_glass"), ("Any_Hit", "Shadow", "any_hit_shadow_glass")]
            .map(|(kind, ray, name)| program(kind, ray, "final", name))
            .concat();
        let procs = [
            ("Closest_Hit", "Phong", "closest_hit"),
            ("Miss", "Phong", "miss"),
            ("Any_Hit", "Shadow", "any_hit_shadow"),
            ("Miss", "Shadow", "miss_shadow"),
        ]
        .map(|(kind, ray, name)| program(kind, ray, "final", name))
        .concat();
        let combined = [
            entry("final"),
            format!("<optixDefaultMaterial>{procs}</optixDefaultMaterial>"),
            format!(r#"<optixMaterialMap><optixMap to="pane">{glass}</optixMap></optixMaterialMap>"#),
            r#"<optixVertexAttributes><attribute name="position"/><attribute name="normal"/><attribute name="texCoord0"/></optixVertexAttributes>"#.to_owned(),
            r#"<optixMaterialAttributes><valueof optixVar="diffuse" type="CURRENT" context="COLOR" component="DIFFUSE"/>
<valueof optixVar="texCount" type="CURRENT" context="TEXTURE" component="COUNT"/></optixMaterialAttributes>"#.to_owned(),
            format!("<optixGlobalAttributes>{light}{color}</optixGlobalAttributes><optixInput>"),
            [buffer("pos_buffer", "pos"), buffer("norm_buffer", "norm"), buffer("color_buffer", "shaded")].concat(),
            "</optixInput>".to_owned(),
        ]
        .concat();
        let map = r#"<program name="shadowMap"/><input><buffer var="pos_buffer" texture="L::pos"/><buffer var="norm_buffer" texture="L::norm"/></input>"#;
        let drawn = pass("default", "draw", "buffers", "");
        let product = r#"<pass class="quad" name="show"><material name="combine" fromLibrary="L"/></pass>"#;
        let shown =
            |name: &str| format!(r#"<pass class="quad" name="show"><texture name="{name}" fromLibrary="L"/></pass>"#);
        let pipelines = [
            ("drawn", [drawn.clone(), shown("shaded")].concat()),
            ("shadows", [&drawn, &pass("optix", "trace", "rays", &shadows), product].concat()),
            ("final", [drawn.clone(), pass("optix", "trace", "rays", &combined), shown("share")].concat()),
            ("map", [&drawn, &pass("effect", "trace", "rays", map), product].concat()),
        ]
        .map(|(name, passes)| format!(r#"<pipeline name="{name}" defaultCamera="C">{passes}</pipeline>"#))
        .concat();
        write(
            "p.xml",
            &format!(
                r#"<project name="p" width="{width}" height="{height}" color="linear"><assets>
<scenes><scene name="Main">
<geometry name="floor" type="SQUARE" material="grey"><SCALE x="6" y="6" z="6"/><ROTATE x="1" y="0" z="0" w="-90"/><TRANSFORM_ORDER value="T_R_S"/></geometry>
<geometry name="ball" type="SPHERE" slices="48" stacks="32" material="red"><SCALE x="0.6" y="0.6" z="0.6"/><TRANSLATE x="-0.2" y="0.6" z="0"/></geometry>
<geometry name="box" type="BOX" material="green"><SCALE x="0.3" y="0.5" z="0.3"/><TRANSLATE x="1" y="0.5" z="-0.4"/></geometry>
<geometry name="glass" type="SQUARE" material="pane"><SCALE x="0.5" y="0.5" z="0.5"/><TRANSLATE x="0.3" y="0.5" z="1"/></geometry></scene></scenes>
<viewports><viewport name="V"/></viewports>
<cameras><camera name="C"><viewport name="V"/><projection TYPE="PERSPECTIVE" FOV="50" NEAR="0.1" FAR="50"/>
<POSITION x="0.4" y="2" z="4"/><VIEW x="-0.08" y="-0.42" z="-1"/><UP x="0" y="1" z="0"/></camera></cameras>
<lights>{LIGHTS}</lights>
<materialLibs><materialLib filename="l.mlib"/></materialLibs></assets>
<pipelines default="drawn">{pipelines}</pipelines></project>"#
            ),
        );
        Self(folder)
    }

    /// The same scene with the lit side of the floor up.
    fn on_lit_floor(lights: &str) -> Self {
        let scene = Self::new(lights);
        let text = std::fs::read_to_string(scene.path()).expect("written before");
        std::fs::write(scene.path(), text.replace(r#"w="-90""#, r#"w="90""#)).expect("written");
        scene
    }

    fn path(&self) -> PathBuf {
        self.0.path().join("p.xml")
    }

    fn open(&self, pipeline: &str, settings: Settings, choice: Choice) -> Result<Renderer, String> {
        let settings = Settings { pipeline: Some(pipeline.to_owned()), ..settings };
        curitiba::open(self.path(), settings, choice, &mut Silent).map_err(|error| error.joined())
    }

    fn picture(&self, pipeline: &str, settings: Settings, raster: RasterChoice) -> Image {
        let mut renderer = self.open(pipeline, settings, Choice { raster, ..Choice::CPU }).expect("opened");
        renderer.frame(&mut Silent).expect("it renders")
    }
}

fn rmse(a: &Image, b: &Image) -> f64 {
    metrics::compare(a, b, &Options::default()).expect("comparable").rmse
}

#[test]
fn many_samples_agree_with_the_reference_of_the_picture_and_fewer_lights_do_not() {
    let (scene, folder) = (Scene::new(ALL), tempfile::tempdir().expect("a folder"));
    for (pipeline, set, most) in
        [("drawn", vec![], 0.003), ("shadows", vec![], 0.005), ("final", vec!["trace.samples=0"], 0.006)]
    {
        let set = set.into_iter().map(str::to_owned).collect();
        let settings = Settings { pipeline: Some(pipeline.to_owned()), set, ..Settings::default() };
        let case = Case::new(&scene.path(), settings.clone(), Choice::CPU).expect("a valid project");
        let mut references = References::new(folder.path().to_owned(), Duration::ZERO);
        let made = references.make(&case, Of::Picture, 64, Shard::WHOLE, &mut Silent).expect("rendered");
        let Made::Whole(reference, _) = made else { panic!("a part") };
        let several = Settings { aa: PixelSamples::new(64).expect("so many"), ..settings.clone() };
        let picture = scene.picture(pipeline, several.clone(), RasterChoice::Cpu);
        let error = rmse(&picture, &reference.picture);
        let fewer = Scene::new("<light>Sun</light><light>Spot</light>").picture(pipeline, several, RasterChoice::Cpu);
        let control = rmse(&fewer, &reference.picture);
        println!("{pipeline}: {error:.5}, own error {:.5}, without a lamp {control:.4}", reference.own_error);
        assert!(error < most && control > 4.0 * most, "{pipeline}: {error} {control}");
    }
}

#[test]
fn the_rasteriser_of_a_device_shows_the_same_shadows_of_several_lights() {
    if !has_driver() {
        return;
    }
    let scene = Scene::new(ALL);
    let [cpu, gpu] =
        [RasterChoice::Cpu, RasterChoice::Wgpu].map(|raster| scene.picture("shadows", Settings::default(), raster));
    let error = rmse(&cpu, &gpu);
    // Some pixels at edges show another triangle.
    assert!(error < 0.01, "{error}");
    let fewer =
        Scene::new("<light>Sun</light><light>Spot</light>").picture("shadows", Settings::default(), RasterChoice::Wgpu);
    assert!(rmse(&cpu, &fewer) > 0.02);
}

fn shows_the_same_lights(backend: BackendChoice) {
    let [scene, fewer] = [ALL, "<light>Sun</light><light>Spot</light>"].map(Scene::new);
    // Software drivers need half a minute to compile `final`, which the tests of the backend compare.
    let pipelines = if backend == BackendChoice::Wgpu { &["shadows"][..] } else { &["shadows", "final"] };
    for pipeline in pipelines {
        let set = if *pipeline == "final" { vec!["trace.samples=0".to_owned()] } else { Vec::new() };
        let settings = Settings { set, ..Settings::default() };
        let picture = |scene: &Scene, choice: Choice| {
            let mut renderer = scene.open(pipeline, settings.clone(), choice).expect("opened");
            renderer.frame(&mut Silent).expect("it renders")
        };
        let device = picture(&scene, Choice::CPU.traced_by(backend));
        // Some rays at edges hit another triangle.
        let error = rmse(&picture(&scene, Choice::CPU), &device);
        assert!(error < 0.005, "{backend:?} {pipeline}: {error}");
        assert!(rmse(&picture(&fewer, Choice::CPU), &device) > 0.02, "{backend:?} {pipeline}");
    }
}

#[test]
fn rays_of_a_device_show_the_same_lights_and_ask_for_no_fallback() {
    if has_driver() {
        shows_the_same_lights(BackendChoice::Wgpu);
    }
}

#[test]
fn rays_on_nvidia_gpus_show_the_same_lights_and_ask_for_no_fallback() {
    for backend in [BackendChoice::Cuda, BackendChoice::Optix] {
        if crate::nvidia::there(Choice::CPU.traced_by(backend)).is_some() {
            shows_the_same_lights(backend);
        }
    }
}

fn shows_the_same_discs(backend: BackendChoice) {
    for scene in [ALL, "<light>Sun</light>"].map(Scene::on_lit_floor) {
        let picture = |sun: &str, choice: Choice| {
            let set = vec![format!("trace.sun={sun}"), "trace.sunsamples=8".to_owned()];
            let mut renderer = scene.open("shadows", Settings { set, ..Settings::default() }, choice).expect("opened");
            renderer.frame(&mut Silent).expect("it renders")
        };
        let device = picture("8", Choice::CPU.traced_by(backend));
        let error = rmse(&picture("8", Choice::CPU), &device);
        let hard = rmse(&picture("0", Choice::CPU), &device);
        assert!(error < 0.25 * hard && hard > 0.002, "{backend:?}: {error} {hard}");
    }
}

#[test]
fn rays_of_a_device_show_the_same_discs_of_one_light_and_of_several() {
    if has_driver() {
        shows_the_same_discs(BackendChoice::Wgpu);
    }
}

#[test]
fn rays_on_nvidia_gpus_show_the_same_discs_of_one_light_and_of_several() {
    for backend in [BackendChoice::Cuda, BackendChoice::Optix] {
        if crate::nvidia::there(Choice::CPU.traced_by(backend)).is_some() {
            shows_the_same_discs(backend);
        }
    }
}

#[test]
fn a_light_that_moves_or_changes_its_colour_is_seen_and_a_share_is_multiplied_by_colour() {
    let scene = Scene::new("<light>Bulb</light><light>Spot</light>");
    let mut renderer = scene.open("shadows", Settings::default(), Choice::CPU).expect("opened");
    let first = renderer.frame(&mut Silent).expect("rendered");
    // In the shadow of the red bulb only the blue spot light is left, and vice versa.
    let ratio = |pixel: &[f32; 4]| pixel[0] / pixel[2].max(1e-6);
    let ratios: Vec<f32> = first.pixels.iter().map(ratio).collect();
    let (least, most) = ratios.iter().fold((f32::MAX, 0.0_f32), |(a, b), ratio| (a.min(*ratio), b.max(*ratio)));
    assert!(least < 0.5 && most > 3.0, "{least} {most}");
    let turned = Vec3::new(0.3, -1.0, 0.2).normalize();
    let blue = renderer.project().lights[renderer.project().light("Spot").expect("declared")].color;
    renderer.set_light("Spot", turned * 3.0, blue).expect("there is such a light");
    let elsewhere = renderer.frame(&mut Silent).expect("rendered");
    assert!(rmse(&first, &elsewhere) > 0.02, "the turn goes unnoticed");
    renderer.set_light("Bulb", Vec3::NEG_Y, Vec3::ZERO).expect("there is such a light");
    let of = |name: &str| renderer.project().lights[renderer.project().light(name).expect("declared")].clone();
    assert_eq!((of("Spot").kind(), of("Bulb").kind()), ("spot", "point"), "a light keeps its kind");
    assert!(of("Spot").falloff.spot.expect("a cone").axis.distance(turned) < 1e-6);
    renderer.set_light("Spot", Vec3::NEG_Y, Vec3::ZERO).expect("there is such a light");
    let dark = renderer.frame(&mut Silent).expect("rendered");
    assert!(rmse(&first, &dark) > 0.02, "the change goes unnoticed");
}

#[test]
fn among_several_lights_the_sun_may_be_a_disc() {
    let set = |sun: &str| Settings { set: vec![format!("trace.sun={sun}")], ..Settings::default() };
    let picture = |lights: &str, sun: &str| Scene::on_lit_floor(lights).picture("shadows", set(sun), RasterChoice::Cpu);
    let [hard, soft] = ["0", "8"].map(|sun| picture(ALL, sun));
    let apart = rmse(&hard, &soft);
    assert!(apart > 0.002 && apart < 0.05, "{apart}");
    // Lamps have no disc.
    let lamps = "<light>Bulb</light><light>Spot</light>";
    assert_eq!(picture(lamps, "0"), picture(lamps, "8"));
    let renderer = Scene::new(ALL).open("shadows", set("8"), Choice::CPU).expect("opened");
    let decisions = format!("{:?}", renderer.plan().decisions);
    assert!(decisions.contains("16 to the disc of each with a direction"), "{decisions}");
}

#[test]
fn what_knows_one_directional_light_refuses_others_with_a_remedy() {
    let scene = Scene::new(ALL);
    let refused = |pipeline: &str, settings: Settings| match scene.open(pipeline, settings, Choice::CPU) {
        Err(error) => error,
        Ok(_) => panic!("{pipeline} is not refused"),
    };
    let error = refused("map", Settings::default());
    assert!(
        error.contains("raster effects know one directional light") && error.contains("deferredShadows"),
        "{error}"
    );
    let set = |set: &[&str]| Settings { set: set.iter().map(|one| (*one).to_owned()).collect(), ..Settings::default() };
    let error = refused("shadows", set(&["trace.sun=0.5", "trace.filter=1"]));
    assert!(error.contains("3 lights") && error.contains("set filter=0"), "{error}");
    let error = refused("final", set(&["trace.shadow=caustic"]));
    assert!(error.contains("3 lights") && error.contains("set shadow=straight"), "{error}");
    // Thesis fidelity uses the first directional light as if it were the only light.
    let thesis = Settings { fidelity: curitiba::pipeline::programs::Fidelity::Thesis, ..Settings::default() };
    let [all, first] = [ALL, "<light>Sun</light>"]
        .map(|lights| Scene::new(lights).picture("shadows", thesis.clone(), RasterChoice::Cpu));
    assert_eq!(all, first);
    let lamps = Scene::new("<light>Bulb</light>").open("shadows", thesis, Choice::CPU);
    let Err(error) = lamps else { panic!("a lamp without a direction is not refused") };
    assert!(error.contains("--fidelity corrected"), "{error}");
}
