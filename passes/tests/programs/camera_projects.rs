//! The projects of `xml_projects/camera`, end to end at small size.

use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::RayCounts;
use curitiba_pipeline::executor::{Engines, Goal, RenderError, Renderer, Silent};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::pixel_samples::PixelSamples;
use curitiba_pipeline::plan::{Plan, Settings, Work};
use curitiba_pipeline::programs::Fidelity;
use curitiba_pipeline::project;
use std::path::Path;

const SIDE: u32 = 48;

const NAMES: [&str; 9] = [
    "SquareColors",
    "SquareLit",
    "SquareShadows",
    "SquareOcclusion",
    "RoomMirrors",
    "RoomSoftShadows",
    "RoomGloss",
    "RoomLens",
    "RoomPaths",
];

fn open(name: &str, settings: Settings) -> Result<Renderer, RenderError> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../xml_projects/camera/{name}.xml"));
    let project = project::load(&path).expect("the project loads");
    let plan = Plan::new(project, Settings { size: Some([SIDE; 2]), ..settings })?;
    Renderer::new(plan, Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new())), &mut Silent)
}

fn set(values: &[&str]) -> Settings {
    Settings { set: values.iter().map(|value| (*value).to_owned()).collect(), ..Settings::default() }
}

fn render(name: &str, settings: Settings) -> Image {
    let mut renderer = open(name, settings).expect("engines");
    renderer.frame(&mut Silent).expect("a frame");
    renderer.window_image()
}

/// Greatest difference of a component, and root mean square difference.
fn differ(a: &Image, b: &Image) -> (f32, f64) {
    let each = a.pixels.iter().flatten().zip(b.pixels.iter().flatten()).map(|(a, b)| (a - b).abs());
    let (worst, sum) = each.fold((0.0_f32, 0.0), |(worst, sum), off| (worst.max(off), sum + f64::from(off * off)));
    (worst, (sum / (4 * a.pixels.len()) as f64).sqrt())
}

#[test]
fn every_project_renders_by_rays_alone() {
    for name in NAMES {
        let mut renderer = open(name, Settings::default()).expect("engines");
        let image = renderer.frame(&mut Silent).expect("a frame");
        assert!(renderer.warnings().is_empty(), "{name}: {:?}", renderer.warnings());
        assert!(renderer.plan().passes.iter().all(|pass| !matches!(pass.work, Work::Raster { .. })), "{name}");
        let mut rays = RayCounts::default();
        renderer.timeline().rows.iter().filter_map(|row| row.rays).for_each(|of_row| rays += of_row);
        assert!(rays.camera >= u64::from(SIDE * SIDE), "{name}: {rays:?}");
        let mut shades: Vec<u32> = image.pixels.iter().map(|pixel| (pixel[0] * 32.0) as u32).collect();
        shades.sort_unstable();
        shades.dedup();
        assert!(shades.len() > 4 && image.pixels.iter().flatten().all(|value| value.is_finite()), "{name}: {shades:?}");
    }
}

#[test]
fn batches_go_on_with_the_sequence() {
    for name in ["RoomPaths", "SquareOcclusion"] {
        let whole = render(name, set(&["pass1.samples=8"]));
        let mut renderer = open(name, Settings::default()).expect("engines");
        renderer.accumulate(Goal::Samples(8), &mut Silent).expect("batches");
        let batches = renderer.window_image();
        let (worst, _) = differ(&whole, &batches);
        // The target's half floats are 2^-11 apart.
        assert!(worst < 2e-3, "{name}: {worst}");
        let other = render(name, Settings { seed: 1, ..set(&["pass1.samples=8"]) });
        assert!(differ(&whole, &other).0 > 0.02, "control: another seed");
    }
    // Gamma is applied to the mean, not to each batch.
    let gamma = |samples: &str| set(&["pass1.gamma=2.2", samples]);
    let whole = render("RoomPaths", gamma("pass1.samples=8"));
    let mut renderer = open("RoomPaths", gamma("pass1.samples=1")).expect("engines");
    renderer.accumulate(Goal::Samples(8), &mut Silent).expect("batches");
    let (worst, _) = differ(&whole, &renderer.window_image());
    assert!(worst < 2e-3, "{worst}");
}

#[test]
fn several_samples_a_pixel_move_the_camera() {
    let aa = |count| Settings { aa: PixelSamples::new(count).expect("a power of two"), ..Settings::default() };
    let [one, four, many] = [1, 4, 64].map(|count| render("SquareColors", aa(count)));
    let [(_, coarse), (_, fine)] = [differ(&one, &many), differ(&four, &many)];
    println!("errors {coarse} with one sample, {fine} with four");
    assert!(fine < 0.6 * coarse, "{coarse} {fine}");
    // Rays inside the pixel give the same mean.
    let rays = render("SquareColors", set(&["pass1.samples=256"]));
    assert!(differ(&rays, &many).1 < 0.3 * fine.max(0.02), "{:?}", differ(&rays, &many));
}

#[test]
fn thesis_fidelity_has_none_of_them() {
    let settings = Settings { fidelity: Fidelity::Thesis, ..Settings::default() };
    let error = match open("SquareShadows", settings) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("the report has no such program"),
    };
    assert!(error.contains("whitted") && error.contains("--fidelity corrected"), "{error}");
}
