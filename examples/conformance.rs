//! Runs every ray pass of some projects on the cpu, on `cuda` and on `optix` with the same G-buffer, compares the pictures
//! pixel by pixel in full precision, and writes what was found as JSON. Needs an NVIDIA GPU; see `cuda/conformance.sh`.
//!
//! Fails where a picture differs by more than it may: see [`LIMITS`].

use clap::Parser;
use curitiba::BackendChoice;
use curitiba::engines::ray_backend;
use curitiba::environment::Environment;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayCounts, RayJob, RayStats};
use curitiba::pipeline::executor::{Engines, Progress, Renderer, Silent, median};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayProgram};
use curitiba::pipeline::project;
use curitiba::pipeline::scene::RenderScene;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// The share of pixels that may be off by more than a number.
///
/// Our own tracer finds what the processor finds; what is left is the order in which the colours of glass are summed. OptiX
/// tests triangles by its own arithmetic: rays through edges and grazing rays may differ, and the report's noise, the
/// fraction of a sine times 43758, makes other occlusion rays of a hit that is off by its last bit.
const LIMITS: [Limit; 3] = [
    Limit { backend: "cuda", noise_at_hits: false, difference: 1e-5, share: 1e-4 },
    Limit { backend: "optix", noise_at_hits: false, difference: 1e-2, share: 2e-3 },
    Limit { backend: "optix", noise_at_hits: true, difference: 1e-2, share: 0.15 },
];

#[derive(Debug, Clone, Copy, Serialize)]
struct Limit {
    backend: &'static str,
    /// Whether it is of `final` in thesis fidelity.
    noise_at_hits: bool,
    difference: f32,
    share: f64,
}

impl Limit {
    fn of(backend: &str, job: &RayJob<'_>) -> Self {
        let noise = backend == "optix" && (job.program, job.fidelity) == (RayProgram::Final, Fidelity::Thesis);
        let fits = |limit: &Self| limit.backend == backend && limit.noise_at_hits == noise;
        LIMITS.into_iter().find(fits).unwrap_or(LIMITS[0])
    }
}

#[derive(Debug, Parser)]
struct Arguments {
    /// Project files
    #[arg(required = true)]
    projects: Vec<PathBuf>,
    /// Cameras; each project's own passes if none is named
    #[arg(long)]
    camera: Vec<String>,
    /// Window width and height
    #[arg(long, num_args = 2, default_values_t = [1024, 1024])]
    size: Vec<u32>,
    /// Runs of each pass on the devices; the first is not timed
    #[arg(long, default_value_t = 6)]
    runs: u32,
    /// Parameters: PASS.NAME=VALUE
    #[arg(long)]
    set: Vec<String>,
    /// Fidelities
    #[arg(long, default_values_t = ["corrected".to_owned(), "thesis".to_owned()])]
    fidelity: Vec<String>,
    /// Leave the comparison with the cpu out: time only
    #[arg(long)]
    time_only: bool,
    /// Where the JSON goes
    #[arg(long, short)]
    output: PathBuf,
}

#[derive(Debug, Clone, Serialize)]
struct Comparison {
    pixels: usize,
    /// Pixels whose four numbers are equal bit by bit.
    identical: usize,
    max_difference: f32,
    rmse: f64,
    above_1e_6: usize,
    above_1e_5: usize,
    above_1e_3: usize,
    above_1e_2: usize,
}

#[derive(Debug, Clone, Serialize)]
struct Record {
    project: String,
    camera: Option<String>,
    fidelity: String,
    backend: &'static str,
    program: &'static str,
    triangles: usize,
    device_ms: Vec<f64>,
    device_ms_median: f64,
    host_ms_median: f64,
    cpu_ms: Option<f64>,
    rays: RayCounts,
    cpu_rays: Option<RayCounts>,
    mrays_per_second: f64,
    comparison: Option<Comparison>,
    within_limits: bool,
}

#[derive(Debug, Clone, Serialize)]
struct Build {
    project: String,
    backend: &'static str,
    triangles: usize,
    ms: f64,
    bytes: u64,
    nodes: u64,
}

#[derive(Debug, Default)]
struct Found {
    records: Vec<Record>,
    builds: Vec<Build>,
}

/// The processor backend, whose pictures are handed on, with others beside it that run the same jobs.
struct Beside {
    cpu: Box<dyn RayBackend>,
    others: Vec<Box<dyn RayBackend>>,
    found: Arc<Mutex<Found>>,
    project: String,
    camera: Option<String>,
    runs: u32,
    compare: bool,
}

impl Beside {
    fn record(
        &mut self,
        index: usize,
        job: &RayJob<'_>,
        cpu: Option<(&Image, f64, RayCounts)>,
    ) -> Result<(), BackendError> {
        let other = &mut self.others[index];
        let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
        let (mut device_ms, mut host_ms, mut rays) = (Vec::new(), Vec::new(), RayCounts::default());
        for run in 0..self.runs.max(2) {
            let start = Instant::now();
            let stats = other.run(job, &mut output, &Progress::default())?;
            let host = start.elapsed().as_secs_f64() * 1e3;
            rays = stats.rays;
            if run > 0 {
                host_ms.push(host);
                device_ms.extend(stats.device_time.map(|time| time.as_secs_f64() * 1e3));
            }
        }
        let comparison = cpu.map(|(picture, ..)| compare(&picture.pixels, &output.pixels));
        let device_ms_median = median(&device_ms);
        let limit = Limit::of(other.name(), job);
        let within_limits = comparison.as_ref().is_none_or(|found| {
            let above = if limit.difference > 1e-3 { found.above_1e_2 } else { found.above_1e_5 };
            above as f64 <= limit.share * found.pixels as f64
        });
        let record = Record {
            project: self.project.clone(),
            camera: self.camera.clone(),
            fidelity: format!("{:?}", job.fidelity).to_lowercase(),
            backend: other.name(),
            program: job.program.info().stem,
            triangles: job.scene.geometry.triangles.len(),
            device_ms_median,
            host_ms_median: median(&host_ms),
            device_ms,
            cpu_ms: cpu.map(|(_, ms, _)| ms),
            rays,
            cpu_rays: cpu.map(|(.., rays)| rays),
            mrays_per_second: rays.total() as f64 / device_ms_median.max(1e-9) / 1e3,
            comparison,
            within_limits,
        };
        eprintln!(
            "{} {:?} {} {}: {:.3} ms on the device, {:.0} Mrays/s, {}",
            record.project,
            record.camera,
            record.fidelity,
            record.backend,
            record.device_ms_median,
            record.mrays_per_second,
            record.comparison.as_ref().map_or("not compared".to_owned(), |found| format!("{found:?}"))
        );
        self.found.lock().expect("no panic while it is held").records.push(record);
        Ok(())
    }
}

fn compare(expected: &[[f32; 4]], found: &[[f32; 4]]) -> Comparison {
    let mut result = Comparison {
        pixels: expected.len(),
        identical: 0,
        max_difference: 0.0,
        rmse: 0.0,
        above_1e_6: 0,
        above_1e_5: 0,
        above_1e_3: 0,
        above_1e_2: 0,
    };
    for (a, b) in expected.iter().zip(found) {
        if a.map(f32::to_bits) == b.map(f32::to_bits) {
            result.identical += 1;
            continue;
        }
        // What is a number on one side only is as far off as can be.
        let difference = |a: f32, b: f32| {
            let difference = (a - b).abs();
            if difference.is_nan() && !(a.is_nan() && b.is_nan()) { f32::INFINITY } else { difference.max(0.0) }
        };
        let worst = (0..4).map(|channel| difference(a[channel], b[channel])).fold(0.0, f32::max);
        result.max_difference = result.max_difference.max(worst);
        result.rmse += (0..4).map(|channel| f64::from(difference(a[channel], b[channel])).powi(2)).sum::<f64>() / 4.0;
        result.above_1e_6 += usize::from(worst > 1e-6);
        result.above_1e_5 += usize::from(worst > 1e-5);
        result.above_1e_3 += usize::from(worst > 1e-3);
        result.above_1e_2 += usize::from(worst > 1e-2);
    }
    result.rmse = (result.rmse / expected.len().max(1) as f64).sqrt();
    result
}

impl RayBackend for Beside {
    fn name(&self) -> &'static str {
        self.cpu.name()
    }

    fn device(&self) -> String {
        self.cpu.device()
    }

    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        self.others.iter().try_for_each(|other| other.supports(program, fidelity))
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        for other in &mut self.others {
            let start = Instant::now();
            let stats = other.build(scene, filtered)?;
            let ms = start.elapsed().as_secs_f64() * 1e3;
            let triangles = scene.geometry.triangles.len();
            let (project, backend) = (self.project.clone(), other.name());
            let build = Build { project, backend, triangles, ms, bytes: stats.bytes, nodes: stats.nodes };
            self.found.lock().expect("no panic while it is held").builds.push(build);
        }
        if self.compare { self.cpu.build(scene, filtered) } else { Ok(BuildStats::default()) }
    }

    fn bytes_per_triangle(&self) -> u64 {
        self.others.iter().map(|other| other.bytes_per_triangle()).sum::<u64>() + self.cpu.bytes_per_triangle()
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        let start = Instant::now();
        let stats = if self.compare { self.cpu.run(job, output, progress)? } else { RayStats::default() };
        let ms = start.elapsed().as_secs_f64() * 1e3;
        for index in 0..self.others.len() {
            let cpu = self.compare.then_some((&*output, ms, stats.rays));
            self.record(index, job, cpu)?;
        }
        Ok(stats)
    }
}

#[derive(Serialize)]
struct Report {
    unix_s: u64,
    environment: Environment,
    devices: Vec<(String, String)>,
    unavailable: Vec<String>,
    size: Vec<u32>,
    set: Vec<String>,
    limits: [Limit; 3],
    builds: Vec<Build>,
    records: Vec<Record>,
}

fn run(arguments: &Arguments) -> Result<bool, Box<dyn std::error::Error>> {
    let found = Arc::new(Mutex::new(Found::default()));
    let (mut devices, mut unavailable) = (Vec::new(), Vec::new());
    let own = std::slice::from_ref(&None);
    let cameras: Vec<Option<String>> = arguments.camera.iter().cloned().map(Some).collect();
    for path in &arguments.projects {
        for camera in if cameras.is_empty() { own } else { &cameras } {
            for fidelity in &arguments.fidelity {
                let mut others = Vec::new();
                for choice in [BackendChoice::Cuda, BackendChoice::Optix] {
                    match ray_backend(choice) {
                        Ok(backend) => {
                            let known = (backend.name().to_owned(), backend.device());
                            if !devices.contains(&known) {
                                devices.push(known);
                            }
                            others.push(backend);
                        }
                        Err(error) => {
                            let error = error.to_string();
                            if !unavailable.contains(&error) {
                                eprintln!("{error}");
                                unavailable.push(error);
                            }
                        }
                    }
                }
                let project = project::load(path)?;
                let set = arguments.set.iter().filter(|assignment| applies(assignment, &project)).cloned().collect();
                let settings = Settings {
                    camera: camera.clone(),
                    size: Some([arguments.size[0], arguments.size[1]]),
                    fidelity: if fidelity == "thesis" { Fidelity::Thesis } else { Fidelity::Corrected },
                    set,
                    max_memory: 64 << 30,
                    ..Settings::default()
                };
                let beside = Beside {
                    cpu: ray_backend(BackendChoice::Cpu)?,
                    others,
                    found: Arc::clone(&found),
                    project: path.file_stem().map_or(String::new(), |stem| stem.to_string_lossy().into_owned()),
                    camera: camera.clone(),
                    runs: arguments.runs,
                    compare: !arguments.time_only,
                };
                let engines = Engines { raster: Box::new(CpuRasteriser::new()), rays: Box::new(beside) };
                Renderer::new(Plan::new(project, settings)?, engines, &mut Silent)?.frame(&mut Silent)?;
            }
        }
    }
    let found = std::mem::take(&mut *found.lock().expect("no panic while it is held"));
    let ran = !devices.is_empty();
    let within = found.records.iter().all(|record| record.within_limits);
    let report = Report {
        unix_s: SystemTime::now().duration_since(UNIX_EPOCH)?.as_secs(),
        environment: Environment::here(),
        devices,
        unavailable,
        size: arguments.size.clone(),
        set: arguments.set.clone(),
        limits: LIMITS,
        builds: found.builds,
        records: found.records,
    };
    std::fs::write(&arguments.output, serde_json::to_string_pretty(&report)?)?;
    Ok(ran && within)
}

/// Whether the project has the pass and its program the parameter: one list serves all projects.
fn applies(assignment: &str, project: &project::Project) -> bool {
    let Some((pass, name)) = assignment.split_once('=').and_then(|(key, _)| key.rsplit_once('.')) else { return true };
    let passes = project.pipelines.iter().flat_map(|pipeline| &pipeline.passes);
    passes.filter(|candidate| candidate.name == pass).any(|candidate| match &candidate.kind {
        project::PassKind::Ray(ray) => ray.program.info().params.contains(&name),
        _ => false,
    })
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => {
            eprintln!("no device ran, or a picture is farther off than it may be");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
