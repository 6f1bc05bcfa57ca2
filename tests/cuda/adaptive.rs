//! Adaptive sampling of stochastic glass, compared with the processor's.

use super::{loaded, there};
use curitiba::cuda::{CudaRays, OptixRays};
use curitiba::passes::cpu::CpuRays;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use curitiba::pipeline::backend::{BackendError, PathsSpent, Rasteriser, RayBackend};
use curitiba::pipeline::executor::{Engines, Renderer, Silent, StepKind};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::{BackendChoice, Choice};
use std::time::Instant;

/// The error that passes ask for.
const ERROR: f64 = 0.02;

/// Projects of stochastic glass, with their settings: rough glass with and without occlusion, a prism, roulette, and rough glass that focuses light.
const CASES: [(&str, &[&str]); 5] = [
    ("glass/Frosted", &["pass2.samples=0", "pass2.paths=1024"]),
    ("glass/Frosted", &["pass2.samples=9", "pass2.paths=256", "pass2.depth=2"]),
    ("glass/Prism", &["pass2.samples=0", "pass2.paths=256", "pass2.depth=3"]),
    ("glass/balls", &["pass2.samples=0", "pass2.paths=256", "pass2.cutoff=0.05", "pass2.roulette=on"]),
    ("glass/Frosted", &["pass2.samples=0", "pass2.paths=64", "pass2.shadow=caustic", "pass2.photons=50000"]),
];

/// The picture of the second frame, and the paths that the frame spent.
fn frame(raster: Box<dyn Rasteriser>, rays: Box<dyn RayBackend>, (name, set): (&str, &[&str])) -> (Image, PathsSpent) {
    let mut set: Vec<String> = set.iter().map(|one| (*one).to_owned()).collect();
    set.push(format!("pass2.error={ERROR}"));
    let settings = Settings { size: Some([203, 149]), set, ..Settings::default() };
    let engines = Engines::new(raster, rays);
    let plan = Plan::new(loaded(name), settings).expect("the plan stands");
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("ready");
    renderer.frame(&mut Silent).expect("rendered");
    let start = Instant::now();
    let picture = renderer.frame(&mut Silent).expect("rendered");
    let row = renderer.timeline().rows.iter().find(|row| row.kind == StepKind::Rays).expect("a ray pass ran");
    println!(
        "{name}: {:.1} ms, of the device {:?} ms; {}",
        start.elapsed().as_secs_f64() * 1e3,
        row.device_ms,
        row.note
    );
    (picture, row.adaptive.expect("it samples adaptively"))
}

fn differences(found: &Image, expected: &Image) -> (usize, f64) {
    let pairs = found.pixels.iter().zip(&expected.pixels);
    let square = |(found, expected): (&[f32; 4], &[f32; 4])| -> f64 {
        (0..3).map(|channel| f64::from(found[channel] - expected[channel]).powi(2)).sum::<f64>() / 3.0
    };
    let squares: Vec<f64> = pairs.map(square).collect();
    let differ = squares.iter().filter(|square| **square > 1e-8).count();
    (differ, (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

fn agrees(backend: BackendChoice, on: impl Fn(&[usize]) -> Result<Box<dyn RayBackend>, BackendError>) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    for case in CASES {
        let cpu = || Box::new(CpuRasteriser::new());
        let (expected, theirs) = frame(cpu(), Box::new(CpuRays::new()), case);
        let (found, mine) = frame(cpu(), on(&[0]).expect("made"), case);
        let (differ, off) = differences(&found, &expected);
        println!("{case:?}: {differ} pixels differ, by {off}");
        assert!(mine.met == theirs.met && mine.pixels > 500, "{case:?}: {mine}; {theirs}");
        assert!(mine.pixels.abs_diff(theirs.pixels) <= theirs.pixels / 100, "{case:?}: {mine}; {theirs}");
        assert!(mine.paths.abs_diff(theirs.paths) <= theirs.paths / 10, "{case:?}: {mine}; {theirs}");
        // Most pixels have the paths of the processor.
        assert!(off < 0.5 * ERROR && differ < expected.pixels.len() / 5, "{case:?}: {differ} pixels differ, by {off}");
        let several = frame(cpu(), on(&[0, 0]).expect("made"), case);
        assert!(several.0.pixels == found.pixels && several.1 == mine, "{case:?}: another picture on two GPUs");
    }
    // A G-buffer that is drawn on the same GPU passes through the host.
    if let Ok(raster) = WgpuRasteriser::new(AdapterChoice::RealGpu) {
        assert!(frame(Box::new(raster), on(&[0]).expect("made"), CASES[0]).1.met);
    }
}

#[test]
fn adaptive_sampling_on_our_own_tracer_follows_the_paths_of_the_processor() {
    agrees(BackendChoice::Cuda, |set| Ok(Box::new(CudaRays::on(set)?)));
}

#[test]
fn adaptive_sampling_on_optix_follows_the_paths_of_the_processor() {
    agrees(BackendChoice::Optix, |set| Ok(Box::new(OptixRays::on(set)?)));
}
