//! Frame times of every effect, by rays and by raster, pass by pass, on the code paths of `curitiba bench`.
//!
//! `cargo bench --bench effects` renders at 256 x 256 with 16 occlusion samples; `CURITIBA_BENCH_SIZE=1024` and
//! `CURITIBA_BENCH_SAMPLES=100` give the report's own frame.

use criterion::{BenchmarkId, Criterion, SamplingMode, criterion_group, criterion_main};
use curitiba::Choice;
use curitiba::bench::Case;
use curitiba::bench::model::Technique;
use curitiba::pipeline::executor::{Renderer, Silent, StepKind};
use curitiba::pipeline::plan::Settings;
use std::path::Path;
use std::time::Duration;

/// The projects, and whether their pass `pass2` takes occlusion samples.
const PROJECTS: [(&str, bool); 15] = [
    ("SceneNoEffects.xml", false),
    ("SceneDummy.xml", false),
    ("SceneShadows.xml", false),
    ("SceneReflect.xml", false),
    ("SceneRefract.xml", false),
    ("SceneSSAO.xml", true),
    ("SceneFinal.xml", true),
    ("raster/SceneShadowMap.xml", false),
    ("raster/SceneCubeReflect.xml", false),
    ("raster/SceneCubeRefract.xml", false),
    ("raster/ScenePlanarReflect.xml", false),
    ("raster/SceneScreenReflect.xml", false),
    ("raster/SceneScreenRefract.xml", false),
    ("raster/SceneDepthOcclusion.xml", false),
    ("raster/SceneGTAO.xml", false),
];

fn number(variable: &str, default: u32) -> u32 {
    std::env::var(variable).ok().and_then(|value| value.parse().ok()).unwrap_or(default)
}

/// All projects as cases of `curitiba bench`. The names are those of the first measurements.
fn cases() -> Vec<(String, Case)> {
    let (side, samples) = (number("CURITIBA_BENCH_SIZE", 256), number("CURITIBA_BENCH_SAMPLES", 16));
    let choice = Choice::CPU;
    let case = |(project, sampled): (&str, bool)| {
        let set = if sampled { vec![format!("pass2.samples={samples}")] } else { Vec::new() };
        let settings = Settings { size: Some([side, side]), set, ..Settings::default() };
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(project);
        let name = project.rsplit('/').next().unwrap_or(project).trim_start_matches("Scene").trim_end_matches(".xml");
        (name.to_owned(), Case::new(&path, settings, choice).expect("the project is valid"))
    };
    PROJECTS.into_iter().map(case).collect()
}

fn open(case: &Case) -> Renderer {
    curitiba::open(&case.project, case.settings.clone(), case.choice, &mut Silent).expect("the project opens")
}

/// The name of the measured engine, with the number of its threads.
fn engine() -> String {
    format!("cpu, {} threads", rayon::current_num_threads())
}

/// Measures whole frames.
fn frames(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    for (name, case) in cases() {
        let mut renderer = open(&case);
        group.bench_function(BenchmarkId::new(name, engine()), |bencher| {
            bencher.iter(|| renderer.draw_frame(&mut Silent).expect("a frame"));
        });
    }
    group.finish();
}

/// Measures the effect alone, as the executor times it: the ray pass, or the maps and pixels of a raster effect.
fn effects(criterion: &mut Criterion) {
    for (technique, name) in [(Technique::Rays, "ray pass"), (Technique::Raster, "raster effect")] {
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10).sampling_mode(SamplingMode::Flat);
        for (name, case) in cases().into_iter().filter(|(_, case)| case.technique == technique) {
            let mut renderer = open(&case);
            group.bench_function(BenchmarkId::new(name, engine()), |bencher| {
                bencher.iter_custom(|iterations| (0..iterations).map(|_| effect_time(&mut renderer)).sum());
            });
        }
        group.finish();
    }
}

fn effect_time(renderer: &mut Renderer) -> Duration {
    renderer.forget_frames();
    renderer.draw_frame(&mut Silent).expect("a frame");
    let steps = renderer.timeline().rows.iter();
    let steps = steps.filter(|row| matches!(row.kind, StepKind::Rays | StepKind::Maps | StepKind::Effect));
    let ms: f64 = steps.flat_map(|row| row.host_ms.iter()).sum();
    assert!(ms > 0.0, "no step computed an effect");
    Duration::from_secs_f64(ms / 1e3)
}

criterion_group!(benches, frames, effects);
criterion_main!(benches);
