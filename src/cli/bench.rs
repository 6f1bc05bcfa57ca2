//! `curitiba bench`: what each effect costs, and what error it has.

use super::bench_args::{BenchArgs, EngineArg};
use super::bench_table::Table;
use super::progress::Bars;
use super::{Failure, bench_threads, check_references, failure, set_threads};
use curitiba::bench::model::{BenchFile, RowError};
use curitiba::bench::table2::{self, TableRow};
use curitiba::bench::{Case, FileError, MeasureOptions, measure, text};
use curitiba::engines::ray_backend;
use curitiba::environment::Environment;
use curitiba::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use curitiba::pipeline::backend::{BackendError, Rasteriser as _};
use curitiba::pipeline::diagnostic::WarningGroup;
use curitiba::pipeline::executor::RenderError;
use curitiba::pipeline::files::{self, check_outputs, write_atomically};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::PassKind;
use curitiba::reference::References;
use curitiba::{BackendChoice, Choice, OpenError, RasterChoice};
use std::collections::BTreeSet;
use std::io::{ErrorKind, Read as _};
use std::path::Path;
use std::time::{Duration, Instant};

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Io { .. } => Self::work(error),
            FileError::Other { .. } | FileError::Interrupted { .. } => Self::Usage(error.to_string()),
            FileError::Broken { .. } => Self::Input(error.to_string()),
        }
    }
}

/// A case, and the row of the report's table that it is.
struct Job {
    case: Case,
    row: Option<TableRow>,
}

/// Measures row after row; prints and writes each as soon as it is there.
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    if !args.sweep_threads.is_empty() {
        return bench_threads::run(args);
    }
    set_threads(args.threads)?;
    let choice = args.project(Path::new("").to_owned(), None).choice();
    let environment = Environment::probe(if args.compare.is_empty() { choice } else { Choice::CPU });
    let mut file = BenchFile::begin(args.command(), environment, args.frames, args.warmup);
    let outputs = [(&args.json, "--json"), (&args.csv, "--csv"), (&args.markdown, "--markdown")];
    check_outputs(outputs.iter().filter_map(|(path, what)| Some((path.as_deref()?, *what))))?;
    if !args.no_error {
        let folder = args.references.clone().unwrap_or_else(References::default_folder);
        check_references(&folder, "--references names another folder, and --no-error does without")?;
    }
    if !args.overwrite {
        [&args.csv, &args.markdown].into_iter().flatten().try_for_each(|path| check_ours(path))?;
        if let Some(path) = &args.json {
            file = file.continued(path, args.resume)?;
        }
    }
    let choices = choices(args, choice, &mut file);
    let jobs = jobs(args, &choices)?;
    write(args, &file)?;
    let failure = measure_all(args, &jobs, &mut file)?;
    file.complete = failure.is_none();
    write(args, &file)?;
    if choices.is_empty() {
        return Err(Failure::Work("none of the engines that were asked for is there".to_owned()));
    }
    failure.map_or(Ok(()), Err)
}

/// Refuses to replace a file that is neither empty nor a table that an earlier benchmark wrote.
fn check_ours(path: &Path) -> Result<(), Failure> {
    let begin = match files::open(path) {
        Ok(file) => {
            let mut begin = Vec::new();
            file.take(256).read_to_end(&mut begin).map(|_| begin)
        }
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => Err(error),
    };
    match begin {
        Ok(begin) if begin.is_empty() || text::is_ours(&begin) => Ok(()),
        Ok(_) => Err(Failure::Usage(format!(
            "{}: this file is no table of a benchmark\n       name another file, or replace it with --overwrite",
            path.display()
        ))),
        Err(error) => Err(Failure::Work(format!("{}: {error}", path.display()))),
    }
}

/// The engines on which every row is measured. Those that are not there are noted in the file.
fn choices(args: &BenchArgs, choice: Choice, file: &mut BenchFile) -> Vec<Choice> {
    if args.compare.is_empty() {
        return vec![choice];
    }
    let mut choices = Vec::new();
    for engine in &args.compare {
        let made = match engine {
            EngineArg::Cpu => Ok(Choice::CPU),
            EngineArg::Wgpu => WgpuRasteriser::new(AdapterChoice::Any)
                .map(|gpu| {
                    let note = format!("`wgpu` is {}", gpu.device());
                    if gpu.device().contains("software") && !file.environment.fallbacks.contains(&note) {
                        file.environment.fallbacks.push(note);
                    }
                    Choice { raster: RasterChoice::Wgpu, ..Choice::CPU }
                })
                .map_err(|error| error.to_string()),
            EngineArg::WgpuRays => traced_by(choice.traced_by(BackendChoice::Wgpu), file),
            EngineArg::Cuda => traced_by(choice.traced_by(BackendChoice::Cuda), file),
            EngineArg::Optix => traced_by(choice.traced_by(BackendChoice::Optix), file),
        };
        match made {
            Ok(choice) if choices.contains(&choice) => {}
            Ok(choice) => choices.push(choice),
            Err(why) => {
                failure::print_warning(&format!("{}: {why}", engine.name()));
                file.miss(engine.name(), why);
            }
        }
    }
    choices
}

/// The choice, if its ray backend is there; the file names its devices.
fn traced_by(choice: Choice, file: &mut BenchFile) -> Result<Choice, String> {
    let rays = ray_backend(choice).map_err(|error| error.to_string())?;
    file.environment.add_gpus(rays.as_ref());
    Ok(choice)
}

/// Everything that is to be measured, checked before anything is.
fn jobs(args: &BenchArgs, choices: &[Choice]) -> Result<Vec<Job>, Failure> {
    let mut jobs = Vec::new();
    if args.table2 {
        if !args.folder.join(table2::ROWS[0].project).is_file() {
            return Err(Failure::Usage(format!(
                "{}: there is no {} in this folder\n       --projects names the folder of the report's projects",
                args.folder.display(),
                table2::ROWS[0].project
            )));
        }
        for row in table2::ROWS {
            // Parameters set from outside hold where the row's pass reads them.
            let settings = args.project(args.folder.join(row.project), None).settings();
            for choice in choices {
                let case = row.case(&args.folder, &settings, *choice)?;
                jobs.push(Job { case, row: Some(row) });
            }
        }
    }
    let cameras: Vec<Option<String>> =
        if args.camera.is_empty() { vec![None] } else { args.camera.iter().cloned().map(Some).collect() };
    for path in &args.projects {
        for camera in &cameras {
            let settings = args.project(path.clone(), camera.clone()).settings();
            let sweep = match &args.sweep {
                Some(sweep) => swept(path, sweep, &settings)?.into_iter().map(Some).collect(),
                None => vec![None],
            };
            for set in sweep {
                let mut settings = settings.clone();
                let value = set.as_deref().and_then(|set| set.split_once('.')).map(|(_, value)| value.to_owned());
                settings.set.extend(set);
                for choice in choices {
                    let mut case = Case::new(path, settings.clone(), *choice)?;
                    if let Some(value) = value.as_ref().filter(|value| !value.starts_with("samples=")) {
                        case.label = format!("{}, {value}", case.label);
                    }
                    if !jobs.iter().any(|job: &Job| job.case.key == case.key) {
                        jobs.push(Job { case, row: None });
                    }
                }
            }
        }
    }
    Ok(jobs)
}

/// The assignments of a sweep: `PASS.NAME=VALUE` for each of its values.
fn swept(path: &Path, sweep: &str, settings: &Settings) -> Result<Vec<String>, Failure> {
    let wrong = |help: &str| Failure::Usage(format!("`--sweep {sweep}`: {help}"));
    let Some((name, values)) = sweep.split_once('=') else {
        return Err(wrong("this is not NAME=A,B,… such as samples=1,4,9"));
    };
    let pass = if name.contains('.') {
        name.to_owned()
    } else {
        let project = settings.open(path).map_err(OpenError::from)?;
        let index = project.pipeline(settings.pipeline.as_deref()).map_err(Failure::Usage)?;
        let reads = |kind: &PassKind| match kind {
            PassKind::Ray(ray) => ray.program.info().params.contains(&name),
            PassKind::Effect(effect) => effect.program.info().params.contains(&name),
            PassKind::Raster(_) | PassKind::Quad(_) => false,
        };
        let pass = project.pipelines[index].passes.iter().find(|pass| reads(&pass.kind));
        let Some(pass) = pass else {
            return Err(wrong(&format!(
                "no pass of {} reads `{name}`; `curitiba list` names what each program reads",
                path.display()
            )));
        };
        format!("{}.{name}", pass.name)
    };
    let assignments: Vec<String> = values
        .split(',')
        .map(str::trim)
        .filter(|value| !value.is_empty())
        .map(|value| format!("{pass}={value}"))
        .collect();
    if assignments.is_empty() { Err(wrong("it names no value")) } else { Ok(assignments) }
}

/// Measures what the file lacks. Returns the first failure of a row; the others are measured all the same.
fn measure_all(args: &BenchArgs, jobs: &[Job], file: &mut BenchFile) -> Result<Option<Failure>, Failure> {
    let folder = args.references.clone().unwrap_or_else(References::default_folder);
    let mut references = References::new(folder, Duration::from_secs(args.reference_seconds.into()));
    let options = MeasureOptions { frames: args.frames, warmup: args.warmup };
    let labels = jobs.iter().map(|job| job.case.label.as_str());
    let mut table = Table::new(labels, file);
    let mut first_failure = None;
    let mut warned = BTreeSet::new();
    let start = Instant::now();
    for (index, job) in jobs.iter().enumerate() {
        let case = &job.case;
        if let Some(row) = file.row(&case.key) {
            table.print(row);
            continue;
        }
        crate::tell!(
            "row {} of {}: {}, {} ({:.0} s so far)",
            index + 1,
            jobs.len(),
            case.label,
            case.view,
            start.elapsed().as_secs_f64()
        );
        let mut bars = Bars::default();
        let measured = match measure(case, &options, &mut bars) {
            Ok(measured) => measured,
            Err(error) => {
                drop(bars);
                let choice = case.choice;
                let engines = format!("{} and {}", choice.raster.name(), choice.rays_in_words());
                let what = format!("{}, {} on {engines}", case.label, case.view);
                file.miss(what.clone(), error_text(&error));
                failure::print_warning(&format!("{what}: {}", error_text(&error)));
                if !is_unsupported(&error) {
                    first_failure.get_or_insert(Failure::from(error));
                }
                write(args, file)?;
                continue;
            }
        };
        for text in measured.renderer.warnings().groups().iter().map(WarningGroup::to_string) {
            if warned.insert(text.clone()) {
                failure::print_warning(&text);
            }
        }
        let (mut row, picture) = (measured.row, measured.picture);
        // Its scene need not stay beside the reference's.
        drop(measured.renderer);
        row.thesis = job.row.map(|of_table| of_table.figure(&row));
        row.error = if args.no_error {
            RowError::Missing("--no-error".to_owned())
        } else {
            references.compare(case, &picture, &mut bars).unwrap_or_else(|error| {
                failure::print_warning(&error.to_string());
                RowError::Missing(error.to_string())
            })
        };
        drop(bars);
        references.take_warnings().iter().for_each(|warning| failure::print_warning(warning));
        table.print(&row);
        file.rows.push(row);
        write(args, file)?;
    }
    table.end(file);
    Ok(first_failure)
}

fn error_text(error: &OpenError) -> String {
    match error {
        OpenError::Project(problems) => problems.0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
        other => other.to_string(),
    }
}

/// Whether an engine says that it cannot do this at all, which is an answer and no failure.
fn is_unsupported(error: &OpenError) -> bool {
    matches!(
        error,
        OpenError::Engine(BackendError::Unsupported { .. })
            | OpenError::Render(RenderError::Pass { error: BackendError::Unsupported { .. }, .. })
    )
}

/// Writes every file that was asked for.
fn write(args: &BenchArgs, file: &BenchFile) -> Result<(), Failure> {
    if let Some(path) = &args.json {
        file.write(path)?;
    }
    for (path, text) in [(&args.csv, text::csv as fn(&BenchFile) -> String), (&args.markdown, text::markdown)] {
        if let Some(path) = path {
            write_atomically(path, text(file).as_bytes())
                .map_err(|error| Failure::Work(format!("{}: {error}", path.display())))?;
        }
    }
    Ok(())
}
