//! The seven projects, end to end at small size, against stored reference pictures.
//!
//! The references in `tests/golden/` were rendered by this program with the brute-force f64 tracer instead of the
//! acceleration structure. So they share the effects' code, but neither the hierarchy nor the f32 intersection. Update
//! them with `CURITIBA_UPDATE_GOLDEN=1 cargo test --release --test frames projects`, and look at every picture.

use curitiba::passes::cpu::{self, CpuRays};
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::trace::BruteForce;
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use curitiba::pipeline::executor::{Engines, Progress, Renderer, Silent};
use curitiba::pipeline::image::{Image, write_png};
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayProgram};
use curitiba::pipeline::project;
use curitiba::pipeline::scene::RenderScene;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const SIDE: u32 = 96;

/// Greatest root mean square error in display values: as if one ambient occlusion sample of 16 differed in one pixel of
/// a hundred.
const RMSE: f64 = 0.004;

/// Greatest share of pixels that may differ by more than 0.05 in any channel, because their rays graze an edge.
const OUTLIERS: f64 = 0.002;

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn settings(name: &str, fidelity: Fidelity) -> Settings {
    let set = match name {
        "SSAO" | "Final" => vec!["pass2.samples=16".to_owned()],
        _ => Vec::new(),
    };
    Settings { size: Some([SIDE, SIDE]), fidelity, set, ..Settings::default() }
}

/// The effects on the f64 tracer that tests every triangle.
#[derive(Default)]
struct BruteRays(Option<BruteForce>);

impl RayBackend for BruteRays {
    fn name(&self) -> &'static str {
        "brute"
    }

    fn device(&self) -> String {
        "every triangle, in f64".to_owned()
    }

    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.0 = Some(BruteForce::new(&scene.geometry, filtered));
        Ok(BuildStats::default())
    }

    fn bytes_per_triangle(&self) -> u64 {
        100
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        match &self.0 {
            Some(tracer) => cpu::trace(tracer, job, output, progress),
            None => CpuRays::new().run(job, output, progress),
        }
    }
}

fn render(name: &str, settings: Settings, rays: impl RayBackend + 'static) -> Image {
    let project = project::load(&root(&format!("xml_projects/Scene{name}.xml"))).expect("the project loads");
    let plan = Plan::new(project, settings).expect("the plan stands");
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(rays));
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("the scene loads");
    renderer.frame(&mut Silent).expect("the frame renders")
}

fn golden(name: &str, fidelity: Fidelity) -> PathBuf {
    let suffix = if fidelity == Fidelity::Thesis { "-thesis" } else { "" };
    root(&format!("tests/golden/Scene{name}{suffix}.png"))
}

/// Root mean square error and share of outliers, after both pictures are rounded to 8 bits.
fn difference(rendered: &Image, reference: &image::RgbImage) -> (f64, f64) {
    assert_eq!((rendered.width, rendered.height), reference.dimensions(), "the sizes differ");
    let (mut squares, mut outliers) = (0.0, 0);
    for (pixel, reference) in rendered.pixels.iter().zip(reference.pixels()) {
        let mut worst: f64 = 0.0;
        for (value, reference) in pixel.iter().zip(reference.0) {
            assert!(value.is_finite(), "a pixel is not finite");
            let value = f64::from((value.clamp(0.0, 1.0) * 255.0).round());
            let error = (value - f64::from(reference)).abs() / 255.0;
            squares += error * error;
            worst = worst.max(error);
        }
        outliers += usize::from(worst > 0.05);
    }
    let pixels = rendered.pixels.len() as f64;
    ((squares / (3.0 * pixels)).sqrt(), outliers as f64 / pixels)
}

fn matches_its_reference(name: &str, fidelity: Fidelity) {
    let path = golden(name, fidelity);
    if std::env::var_os("CURITIBA_UPDATE_GOLDEN").is_some() {
        let reference = render(name, settings(name, fidelity), BruteRays::default());
        write_png(&path, &reference).expect("the reference is written");
    }
    let reference = image::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).to_rgb8();
    let rendered = render(name, settings(name, fidelity), CpuRays::new());
    let (rmse, outliers) = difference(&rendered, &reference);
    assert!(rmse <= RMSE && outliers <= OUTLIERS, "Scene{name} {fidelity:?}: RMSE {rmse:.5}, outliers {outliers:.5}");
}

macro_rules! projects {
    ($($test:ident: $name:literal, $fidelity:ident;)*) => {
        $(#[test]
        fn $test() {
            matches_its_reference($name, Fidelity::$fidelity);
        })*
    };
}

projects! {
    no_effects_matches_its_reference: "NoEffects", Corrected;
    dummy_matches_its_reference: "Dummy", Corrected;
    shadows_match_their_reference: "Shadows", Corrected;
    reflection_matches_its_reference: "Reflect", Corrected;
    refraction_matches_its_reference: "Refract", Corrected;
    ambient_occlusion_matches_its_reference: "SSAO", Corrected;
    all_effects_match_their_reference: "Final", Corrected;
    shadows_as_written_match_their_reference: "Shadows", Thesis;
    reflection_as_written_matches_its_reference: "Reflect", Thesis;
    refraction_as_written_matches_its_reference: "Refract", Thesis;
    ambient_occlusion_as_written_matches_its_reference: "SSAO", Thesis;
    all_effects_as_written_match_their_reference: "Final", Thesis;
}

#[test]
fn the_comparison_refuses_another_seed_camera_effect_or_fidelity() {
    let reference = image::open(golden("Final", Fidelity::Corrected)).expect("the reference").to_rgb8();
    let refused = |what: &str, settings: Settings, name: &str| {
        let (rmse, outliers) = difference(&render(name, settings, CpuRays::new()), &reference);
        assert!(rmse > RMSE || outliers > OUTLIERS, "{what} passes: RMSE {rmse:.5}, outliers {outliers:.5}");
    };
    let base = || settings("Final", Fidelity::Corrected);
    refused("another seed", Settings { seed: 1, ..base() }, "Final");
    refused("another camera", Settings { camera: Some("Vidro".into()), ..base() }, "Final");
    refused("thesis fidelity", settings("Final", Fidelity::Thesis), "Final");
    refused("another effect", settings("Shadows", Fidelity::Corrected), "Shadows");
}
