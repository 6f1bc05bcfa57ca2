//! Frame times of the seven projects, pass by pass, on the code paths of `curitiba render`.
//!
//! `cargo bench --bench effects` renders at 256 x 256 with 16 occlusion samples; `CURITIBA_BENCH_SIZE=1024` and
//! `CURITIBA_BENCH_SAMPLES=100` give the report's own frame.

use criterion::{BenchmarkId, Criterion, SamplingMode, criterion_group, criterion_main};
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::plan::Settings;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::path::Path;
use std::time::Duration;

fn number(variable: &str, default: u32) -> u32 {
    std::env::var(variable).ok().and_then(|value| value.parse().ok()).unwrap_or(default)
}

fn open(name: &str) -> Renderer {
    let side = number("CURITIBA_BENCH_SIZE", 256);
    let samples = number("CURITIBA_BENCH_SAMPLES", 16);
    let set = match name {
        "SSAO" | "Final" => vec![format!("pass2.samples={samples}")],
        _ => Vec::new(),
    };
    let settings = Settings { size: Some([side, side]), set, ..Settings::default() };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("xml_projects/Scene{name}.xml"));
    let choice = Choice { raster: RasterChoice::Cpu, backend: BackendChoice::Cpu };
    curitiba::open(path, settings, choice, &mut Silent).expect("the project opens")
}

/// Whole frames.
fn frames(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    for name in ["NoEffects", "Dummy", "Shadows", "Reflect", "Refract", "SSAO", "Final"] {
        let mut renderer = open(name);
        group.bench_function(BenchmarkId::new(name, "cpu"), |bencher| {
            bencher.iter(|| renderer.frame(&mut Silent).expect("a frame"));
        });
    }
    group.finish();
}

/// The ray pass alone, as the executor times it.
fn ray_passes(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("ray pass");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    for name in ["Dummy", "Shadows", "Reflect", "Refract", "SSAO", "Final"] {
        let mut renderer = open(name);
        group.bench_function(BenchmarkId::new(name, "cpu"), |bencher| {
            bencher.iter_custom(|iterations| (0..iterations).map(|_| ray_pass(&mut renderer)).sum());
        });
    }
    group.finish();
}

fn ray_pass(renderer: &mut Renderer) -> Duration {
    renderer.frame(&mut Silent).expect("a frame");
    let row = renderer.timeline().rows.iter().find(|row| row.rays.is_some()).expect("a ray pass ran");
    Duration::from_secs_f64(row.host_ms.last().expect("a sample") / 1e3)
}

criterion_group!(benches, frames, ray_passes);
criterion_main!(benches);
