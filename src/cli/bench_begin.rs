//! Start of a benchmark: machine, engines, the folder of references, and files that may be replaced.

use super::bench_args::{BenchArgs, EngineArg};
use super::bench_jobs::engines;
use super::{Failure, check_references, failure};
use curitiba::Choice;
use curitiba::bench::model::BenchFile;
use curitiba::engines::{rasteriser, ray_backend};
use curitiba::environment::Environment;
use curitiba::pipeline::files;
use curitiba::reference::References;
use std::io::{ErrorKind, Read as _};
use std::path::{Path, PathBuf};

/// A new benchmark on this machine.
pub(super) fn begin(args: &BenchArgs) -> BenchFile {
    let environment = Environment::probe(if args.compare.is_empty() { args.choice() } else { Choice::CPU });
    let environment = Environment { host: args.host.clone(), ..environment };
    BenchFile { rounds: args.rounds(), ..BenchFile::begin(args.command(), environment, args.frames, args.warmup) }
}

/// Checks before the work whether references can be stored.
pub(super) fn check_folder_of_references(args: &BenchArgs) -> Result<(), Failure> {
    if args.no_error {
        return Ok(());
    }
    check_references(&references_folder(args), "--references names another folder, and --no-error does without")
}

/// The folder of references.
pub(super) fn references_folder(args: &BenchArgs) -> PathBuf {
    args.references.clone().unwrap_or_else(References::default_folder)
}

/// Fails if a file would be replaced that is neither empty nor a table of an earlier benchmark. `is_ours` judges how the file begins.
pub(super) fn check_ours(path: &Path, is_ours: fn(&[u8]) -> bool) -> Result<(), Failure> {
    let begin = match files::open(path) {
        Ok(file) => {
            let mut begin = Vec::new();
            file.take(1024).read_to_end(&mut begin).map(|_| begin)
        }
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => Err(error),
    };
    match begin {
        Ok(begin) if begin.is_empty() || is_ours(&begin) => Ok(()),
        Ok(_) => Err(Failure::Usage(format!(
            "{}: this file is no table of a benchmark\n       name another file, or replace it with --overwrite",
            path.display()
        ))),
        Err(error) => Err(Failure::Work(format!("{}: {error}", path.display()))),
    }
}

/// The engines on which every row is measured. Missing engines are recorded in the file.
pub(super) fn choices(args: &BenchArgs, choice: Choice, file: &mut BenchFile) -> Vec<Choice> {
    let mut choices = Vec::new();
    if args.compare.is_empty() {
        choices.push(choice);
    }
    for (engine, asked) in engines(args, choice) {
        let made = match engine {
            EngineArg::Cpu => Ok(asked),
            EngineArg::Wgpu => rasteriser(asked)
                .map(|gpu| {
                    let note = format!("`wgpu` is {}", gpu.device());
                    if gpu.device().contains("software") && !file.environment.fallbacks.contains(&note) {
                        file.environment.fallbacks.push(note);
                    }
                    asked
                })
                .map_err(|error| error.to_string()),
            EngineArg::WgpuRays | EngineArg::Cuda | EngineArg::Optix => traced_by(asked, file),
        };
        match made {
            Ok(choice) => choices.push(choice),
            Err(why) => {
                failure::print_warning(&format!("{}: {why}", engine.name()));
                file.miss(engine.name(), why);
            }
        }
    }
    choices
}

/// Returns the choice if its ray backend is available, and records the backend's devices in the file. The error is the reason.
fn traced_by(choice: Choice, file: &mut BenchFile) -> Result<Choice, String> {
    let rays = ray_backend(choice).map_err(|error| error.to_string())?;
    file.environment.add_gpus(rays.as_ref());
    Ok(choice)
}
