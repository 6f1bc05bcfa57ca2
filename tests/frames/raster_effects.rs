//! The raster effects on the shipped square give the same pictures with both rasterisers, maps included.
//!
//! Needs a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one, tests print `skipped` and test only what the
//! processor does alone, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`. `CURITIBA_PICTURES=DIR` writes the pictures.

use crate::own_shaders::has_driver;
use curitiba::pipeline::backend::Answers;
use curitiba::pipeline::executor::{Engines, Renderer, Silent, StepKind};
use curitiba::pipeline::image::{Image, write_png};
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::path::Path;

const SIDE: u32 = 192;

/// Greatest difference of a component that counts as rounding: devices may round the weights of a texture's texels and
/// levels to 1/256 (Vulkan 1.3, section 16.9.1).
const ROUNDING: f32 = 0.02;

/// A project, the number of its steps that draw maps, and the greatest share of pixels that may differ by more than
/// [`ROUNDING`]. Such pixels are at outlines in the picture and in the maps, where G-buffers and depths of the two
/// rasterisers are a pixel apart. On lavapipe 22.3.6 the share is at most 0.0012, and 0.0077 for depth differences,
/// which magnify every outline.
const PROJECTS: [(&str, usize, f64); 8] = [
    ("ShadowMap", 1, 0.003),
    ("CubeReflect", 1, 0.003),
    ("CubeRefract", 1, 0.003),
    ("PlanarReflect", 1, 0.0015),
    ("ScreenReflect", 1, 0.003),
    ("ScreenRefract", 1, 0.003),
    ("DepthOcclusion", 0, 0.012),
    ("GTAO", 0, 0.003),
];

/// The engines of a choice, taken back from every renderer: a device is opened, and its shaders are compiled, once.
struct Shared(Option<Engines>);

impl Shared {
    fn of(choice: Choice) -> Self {
        Self(Some(curitiba::engines::choose(choice).expect("the engines are there")))
    }

    /// The result of `look` for the renderer of a file in `xml_projects`.
    fn with<T>(&mut self, file: &str, settings: Settings, look: impl FnOnce(&mut Renderer) -> T) -> T {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(file);
        let project = settings.open(&path).unwrap_or_else(|error| panic!("{file}: {error}"));
        let plan = Plan::new(project, settings).unwrap_or_else(|error| panic!("{file}: {error}"));
        let engines = self.0.take().expect("the engines came back");
        let mut renderer = Renderer::new(plan, engines, &mut Silent).unwrap_or_else(|error| panic!("{file}: {error}"));
        let found = look(&mut renderer);
        self.0 = Some(renderer.into_engines());
        found
    }
}

fn settings(camera: Option<&str>, set: &[&str], off: &[&str]) -> Settings {
    let list = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect();
    Settings {
        size: Some([SIDE, SIDE]),
        camera: camera.map(str::to_owned),
        set: list(set),
        off: list(off),
        ..Settings::default()
    }
}

/// The share of pixels with a component that differs by more than [`ROUNDING`].
fn outliers(a: &Image, b: &Image) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let agree = |a: &[f32; 4], b: &[f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= ROUNDING);
    let differing = a.pixels.iter().zip(&b.pixels).filter(|(a, b)| !agree(a, b)).count();
    differing as f64 / a.pixels.len() as f64
}

fn keep_picture(name: &str, image: &Image) {
    if let Some(folder) = std::env::var_os("CURITIBA_PICTURES") {
        write_png(&Path::new(&folder).join(format!("{name}.png")), image).expect("the picture is written");
    }
}

#[test]
fn both_rasterisers_compute_the_same_effects_on_the_square() {
    if !has_driver() {
        return;
    }
    let mut cpu = Shared::of(Choice::CPU);
    let mut wgpu = Shared::of(Choice { raster: RasterChoice::Wgpu, ..Choice::CPU });
    let mut failed = Vec::new();
    for (name, maps, allowed) in PROJECTS {
        let set: &[&str] = match name {
            "PlanarReflect" => &[],
            _ if maps > 0 => &["pass2.mapsize=256"],
            _ => &["pass2.steps=6"],
        };
        for camera in [None, Some("Vidro")] {
            let render = |engines: &mut Shared| {
                engines.with(&format!("raster/Scene{name}.xml"), settings(camera, set, &[]), |renderer| {
                    let image = renderer.frame(&mut Silent).expect("the frame renders");
                    let rows = &renderer.timeline().rows;
                    let drawn = rows.iter().filter(|row| row.kind == StepKind::Maps).count();
                    let effects = rows.iter().filter(|row| row.kind == StepKind::Effect).count();
                    (image, drawn, effects)
                })
            };
            let (of_cpu, cpu_maps, effects) = render(&mut cpu);
            let (of_gpu, gpu_maps, _) = render(&mut wgpu);
            let share = outliers(&of_cpu, &of_gpu);
            println!("{name}, camera {camera:?}: {share:.5} of the pixels differ");
            keep_picture(&format!("square {name} {} cpu", camera.unwrap_or("Fonte")), &of_cpu);
            keep_picture(&format!("square {name} {} gpu", camera.unwrap_or("Fonte")), &of_gpu);
            assert_eq!((cpu_maps, effects), (maps, 1), "{name}, camera {camera:?}");
            assert_eq!(gpu_maps, maps, "{name}, camera {camera:?}");
            if share > allowed {
                failed.push((name, camera, share));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn another_parameter_is_found_out() {
    let mut engines = Shared::of(Choice::CPU);
    // Both pictures are rendered on the processor, because this tests the comparison.
    for (name, camera, a, b) in [
        ("ShadowMap", None, "pass2.mapsize=1024", "pass2.mapsize=16"),
        ("CubeReflect", Some("Vidro"), "pass2.mapsize=256", "pass2.mapsize=16"),
        ("GTAO", None, "pass2.radius=0.5", "pass2.radius=2"),
        ("PlanarReflect", None, "pass2.planes=16", "pass2.planes=1"),
        ("ScreenReflect", Some("Vidro"), "pass2.missing=cube", "pass2.missing=none"),
        ("ScreenRefract", Some("Vidro"), "pass2.missing=cube", "pass2.missing=none"),
    ] {
        let mut render = |set: &str| {
            engines.with(&format!("raster/Scene{name}.xml"), settings(camera, &[set], &[]), |renderer| {
                renderer.frame(&mut Silent).expect("the frame renders")
            })
        };
        let share = outliers(&render(a), &render(b));
        let allowed = PROJECTS.iter().find(|project| project.0 == name).expect("in the list").2;
        assert!(share > allowed, "{name}: {share}");
    }
}

/// The rasterisers and ray backends of the processor and of `wgpu`, in all combinations. Without a driver these are the processor's alone,
/// and it is printed that the others are skipped.
fn all_engines() -> Vec<(RasterChoice, BackendChoice)> {
    let mut all = vec![(RasterChoice::Cpu, BackendChoice::Cpu)];
    if has_driver() {
        all.extend([
            (RasterChoice::Wgpu, BackendChoice::Cpu),
            (RasterChoice::Cpu, BackendChoice::Wgpu),
            (RasterChoice::Wgpu, BackendChoice::Wgpu),
        ]);
    }
    all
}

/// The picture of one of the shipped square's projects, and the statistics of what answered its glass pixels.
fn rendered(engines: &mut Shared, file: &str, settings: Settings) -> (Image, Option<Answers>) {
    engines.with(file, settings, |renderer| {
        let image = renderer.frame(&mut Silent).expect("the frame renders");
        (image, renderer.timeline().rows.iter().find_map(|row| row.answers))
    })
}

#[test]
fn what_the_screen_leaves_to_rays_is_bit_for_bit_what_the_ray_pass_writes() {
    for (raster, backend) in all_engines() {
        let mut engines = Shared::of(Choice { raster, backend, ..Choice::CPU });
        for (screen, rays) in [("ScreenReflect", "SceneReflect.xml"), ("ScreenRefract", "SceneRefract.xml")] {
            let screen = format!("raster/Scene{screen}.xml");
            // On a software driver, rays take minutes in the view where most pixels are glass.
            let cameras: &[Option<&str>] =
                if backend == BackendChoice::Wgpu { &[None] } else { &[None, Some("Vidro")] };
            for camera in cameras.iter().copied() {
                let what = format!("{screen}, camera {camera:?}, {raster:?} and {backend:?}");
                let (own, _) = rendered(&mut engines, &screen, settings(camera, &[], &["pass2"]));
                let (marched, kept) = rendered(&mut engines, &screen, settings(camera, &["pass2.missing=none"], &[]));
                let (mixed, left) = rendered(&mut engines, &screen, settings(camera, &["pass2.missing=rays"], &[]));
                let (traced, _) = rendered(&mut engines, rays, settings(camera, &[], &[]));
                let (kept, left) = (kept.expect("counted"), left.expect("counted"));
                assert_eq!((kept.screen, kept.kept, kept.cube), (left.screen, left.rays, 0), "{what}");
                assert!(left.screen > 0 && left.rays > 0 && left.kept == 0, "{what}: {left:?}");
                let bits = |image: &Image, index: usize| image.pixels[index].map(f32::to_bits);
                let (mut by_rays, mut by_screen, mut off) = (0, 0, 0);
                for index in 0..own.pixels.len() {
                    let is = |other: &Image| bits(&mixed, index) == bits(other, index);
                    // Where only one of the two rays of refraction has no answer, the pixel still shows the other. So pixels are
                    // compared with both pictures.
                    if is(&traced) {
                        by_rays += u64::from(bits(&traced, index) != bits(&own, index));
                    } else if is(&marched) {
                        by_screen += 1;
                    } else {
                        off += 1;
                    }
                }
                println!("{what}: {left}; {by_rays} pixels as by rays, {by_screen} as marched");
                assert_eq!(off, 0, "{what}: a pixel is neither");
                assert!(
                    by_screen <= left.screen && by_rays + by_screen <= left.glass() && by_rays >= left.rays * 9 / 10,
                    "{what}"
                );
            }
        }
    }
}

#[test]
fn shadow_maps_with_rays_at_the_borders_are_nearly_what_the_ray_pass_writes() {
    for (raster, backend) in all_engines() {
        let mut engines = Shared::of(Choice { raster, backend, ..Choice::CPU });
        let maps = "raster/SceneShadowMap.xml";
        for camera in [None, Some("Vidro")] {
            let what = format!("camera {camera:?}, {raster:?} and {backend:?}");
            let mut with = |file: &str, set: &[&str]| {
                engines.with(file, settings(camera, set, &[]), |renderer| {
                    let image = renderer.frame(&mut Silent).expect("the frame renders");
                    let rows = &renderer.timeline().rows;
                    let note = rows.iter().find(|row| row.kind == StepKind::Effect).map(|row| row.note.clone());
                    let traced = rows.iter().any(|row| row.kind == StepKind::Rays);
                    (image, note.unwrap_or_default(), traced)
                })
            };
            let (mean, _, traced) = with(maps, &["pass2.mapsize=512"]);
            assert!(!traced, "{what}");
            let (mixed, note, traced) = with(maps, &["pass2.mapsize=512", "pass2.border=rays"]);
            assert!(traced && note.contains("pixels left to rays"), "{what}: {note}");
            let (rays, ..) = with("SceneShadows.xml", &[]);
            let [of_mean, of_mixed] = [&mean, &mixed].map(|image| outliers(image, &rays));
            println!("{what}: {note}; {of_mean:.5} of the pixels differ from rays, with rays at borders {of_mixed:.5}");
            assert!(of_mean > 0.01 && of_mixed < 0.1 * of_mean, "{what}: {of_mean} {of_mixed}");
        }
    }
}

#[test]
fn thesis_fidelity_leaves_no_pixel_to_rays() {
    for (name, set, instead) in
        [("ScreenReflect", "missing=rays", "missing=cube"), ("ShadowMap", "border=rays", "border=map")]
    {
        let error = refused(name, &[set], Fidelity::Thesis);
        assert!(error.contains(&format!("Scene{name}.xml:")) && error.contains(instead), "{error}");
    }
}

#[test]
fn soft_shadows_have_no_border_for_rays() {
    let error = refused("ShadowMap", &["border=rays", "sun=2"], Fidelity::Corrected);
    assert!(error.contains("SceneShadowMap.xml:") && error.contains("set sun=0, border=map"), "{error}");
}

/// The error of opening one of the shipped square's projects with these parameters.
fn refused(name: &str, set: &[&str], fidelity: Fidelity) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("xml_projects/raster/Scene{name}.xml"));
    let set = set.iter().map(|set| format!("pass2.{set}")).collect();
    let settings = Settings { set, fidelity, ..Settings::default() };
    curitiba::open(path, settings, Choice::CPU, &mut Silent).err().expect("refused").to_string()
}
