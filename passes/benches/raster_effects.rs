//! The raster effects on the processor: times of maps and pixels, on the projects that declare them.
//!
//! `cargo bench -p curitiba-passes --bench raster_effects` renders at 1024 x 1024 (`CURITIBA_BENCH_SIZE` sets another
//! side). Times are those that the executor records for the effect pass, so they exclude the G-buffer. They are also
//! printed once before each benchmark.

use criterion::{BenchmarkId, Criterion, SamplingMode, criterion_group, criterion_main};
use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::executor::{Engines, Renderer, Silent, StepKind};
use curitiba_pipeline::plan::{Plan, Settings};
use std::path::Path;
use std::time::Duration;

fn open(name: &str, camera: &str) -> Renderer {
    let side = std::env::var("CURITIBA_BENCH_SIZE").ok().and_then(|side| side.parse().ok()).unwrap_or(1024);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../xml_projects/raster/Scene{name}.xml"));
    let settings = Settings { size: Some([side, side]), camera: Some(camera.to_owned()), ..Settings::default() };
    let project = curitiba_pipeline::project::load(&path).expect("the project is valid");
    let plan = Plan::new(project, settings).expect("the project has a plan");
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new()));
    Renderer::new(plan, engines, &mut Silent).expect("the scene loads")
}

/// Host time of the effect's maps and pixels in one more frame.
fn effect(renderer: &mut Renderer) -> [Duration; 2] {
    renderer.frame(&mut Silent).expect("a frame");
    [StepKind::Maps, StepKind::Effect].map(|kind| {
        let row = renderer.timeline().rows.iter().find(|row| row.kind == kind);
        row.map_or(Duration::ZERO, |row| Duration::from_secs_f64(row.host_ms.last().expect("a sample") / 1e3))
    })
}

fn effects(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("raster effect");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    for camera in ["MainCamera", "Vidro"] {
        for name in [
            "ShadowMap",
            "CubeReflect",
            "CubeRefract",
            "PlanarReflect",
            "ScreenReflect",
            "ScreenRefract",
            "DepthOcclusion",
            "GTAO",
        ] {
            let mut renderer = open(name, camera);
            effect(&mut renderer);
            let [maps, pixels] = effect(&mut renderer);
            println!("{name}, {camera}: maps {maps:.2?}, pixels {pixels:.2?}");
            let id = BenchmarkId::new(name, format!("{camera}, {} threads", rayon::current_num_threads()));
            group.bench_function(id, |bencher| {
                bencher.iter_custom(|frames| (0..frames).flat_map(|_| effect(&mut renderer)).sum());
            });
        }
    }
    group.finish();
}

criterion_group!(benches, effects);
criterion_main!(benches);
