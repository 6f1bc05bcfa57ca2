//! Runs every ray pass of some projects on the cpu, and on `wgpu`, `cuda` and `optix` where they are available, with the same G-buffer. Compares
//! the pictures pixel by pixel in full precision, prints rays per second of device time, and writes the results as JSON. For NVIDIA GPUs see
//! `cuda/conformance.sh`.
//!
//! Fails where a picture differs by more than its limit: see `curitiba::conformance`.

use clap::Parser;
use curitiba::args::FidelityArg;
use curitiba::conformance::{Beside, Build, Found, LIMITS, Limit, Record};
use curitiba::engines::ray_backend;
use curitiba::environment::Environment;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::executor::{Engines, Renderer, Silent};
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project;
use curitiba::{BackendChoice, Choice, Gpus};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::time::{SystemTime, UNIX_EPOCH};

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
    #[arg(long, value_enum, default_values_t = [FidelityArg::Corrected, FidelityArg::Thesis])]
    fidelity: Vec<FidelityArg>,
    /// GPUs that share the rows of each pass: a number, or all
    #[arg(long, default_value_t = Gpus::default())]
    gpus: Gpus,
    /// Leave the comparison with the cpu out: time only
    #[arg(long)]
    time_only: bool,
    /// Where the JSON goes
    #[arg(long, short)]
    output: PathBuf,
}

#[derive(Serialize)]
struct Report {
    unix_s: u64,
    environment: Environment,
    devices: Vec<(String, String)>,
    unavailable: Vec<String>,
    size: Vec<u32>,
    set: Vec<String>,
    gpus: String,
    limits: [Limit; LIMITS.len()],
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
                for choice in [BackendChoice::Wgpu, BackendChoice::Cuda, BackendChoice::Optix] {
                    match ray_backend(Choice { gpus: arguments.gpus, ..Choice::CPU.traced_by(choice) }) {
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
                    fidelity: match fidelity {
                        FidelityArg::Corrected => Fidelity::Corrected,
                        FidelityArg::Thesis => Fidelity::Thesis,
                    },
                    set,
                    max_memory: 64 << 30,
                    ..Settings::default()
                };
                let beside = Beside {
                    cpu: ray_backend(Choice::CPU)?,
                    others,
                    found: Arc::clone(&found),
                    project: path.file_stem().map_or(String::new(), |stem| stem.to_string_lossy().into_owned()),
                    camera: camera.clone(),
                    runs: arguments.runs,
                    compare: !arguments.time_only,
                };
                let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(beside));
                let before = found.lock().map_or(0, |found| found.records.len());
                Renderer::new(Plan::new(project, settings)?, engines, &mut Silent)?.frame(&mut Silent)?;
                if let Ok(found) = found.lock() {
                    found.records[before..].iter().for_each(|record| eprintln!("{}", record.in_words()));
                }
            }
        }
    }
    let found = std::mem::take(&mut *found.lock().expect("no panic while it is held"));
    let ran = !found.records.is_empty();
    let within = found.records.iter().all(|record| record.within_limits);
    let report = Report {
        unix_s: SystemTime::now().duration_since(UNIX_EPOCH)?.as_secs(),
        environment: Environment::here(),
        devices,
        unavailable,
        size: arguments.size.clone(),
        set: arguments.set.clone(),
        gpus: arguments.gpus.to_string(),
        limits: LIMITS,
        builds: found.builds,
        records: found.records,
    };
    std::fs::write(&arguments.output, serde_json::to_string_pretty(&report)?)?;
    Ok(ran && within)
}

/// Whether the project has the pass, and the pass's program has the parameter. Other assignments are skipped, because one list serves all projects.
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
