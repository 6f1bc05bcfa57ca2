//! `curitiba bench --sweep-threads`: how the time of each step falls with the number of threads.

use super::bench_args::BenchArgs;
use super::bench_begin::check_ours;
use super::progress::Bars;
use super::{Failure, load, say_prose, table};
use anstyle::Style;
use curitiba::bench::threads::{SweepError, SweepOptions, ThreadsCase, ThreadsFile, sweep, text};
use curitiba::bench::{Case, MeasureOptions};
use curitiba::environment::Environment;
use curitiba::pipeline::files::{check_outputs, create_folder, write_atomically};
use curitiba::report::plots::threads_plot;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::path::{Path, PathBuf};

const HEADER: Style = Style::new().bold();

impl From<SweepError> for Failure {
    fn from(error: SweepError) -> Self {
        match error {
            SweepError::Open(error) => error.into(),
            error => Self::work(error),
        }
    }
}

/// Measures each project and camera; prints each one as soon as it is measured, and writes all so far.
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    let cases = cases(args)?;
    let mut threads: Vec<usize> = args.sweep_threads.iter().map(|threads| usize::from(*threads)).collect();
    threads.sort_unstable();
    threads.dedup();
    let outputs = [(&args.json, "--json"), (&args.markdown, "--markdown")];
    check_outputs(outputs.iter().filter_map(|(path, what)| Some((path.as_deref()?, *what))))?;
    if !args.overwrite {
        args.markdown.iter().try_for_each(|path| check_ours(path, text::is_ours))?;
        if let Some(path) = &args.json {
            // Reading fails for a file that is no sweep, so that such a file is not replaced.
            ThreadsFile::read(path)?;
        }
    }
    if let Some(folder) = &args.plots {
        create_folder(folder).map_err(|error| wrong(folder, &error))?;
    }
    let frames = MeasureOptions { frames: args.frames, warmup: args.warmup };
    let options = SweepOptions { threads, rounds: args.rounds(), frames };
    let environment = Environment::here();
    load::tell(&environment);
    let mut file = ThreadsFile::begin(args.command(), environment, args.rounds(), args.frames, args.warmup);
    introduce(&file);
    let mut plots: Vec<PathBuf> = Vec::new();
    for case in &cases {
        let told = |round: u32, threads: usize| {
            let (label, view) = (&case.label, &case.view);
            crate::tell!("{label}, {view}: round {round} of {}, {threads} threads", args.rounds());
        };
        let measured = sweep(case, &options, || Box::new(Bars::default()), told)?;
        print(&measured);
        if let Some(folder) = &args.plots {
            plots.extend(plot(folder, &measured, &plots)?);
        }
        file.cases.push(measured);
        file.complete = file.cases.len() == cases.len();
        write(args, &file)?;
    }
    plots.iter().for_each(|path| crate::say!("wrote {}", path.display()));
    Ok(())
}

/// All cases to be measured. They are checked before any is measured.
fn cases(args: &BenchArgs) -> Result<Vec<Case>, Failure> {
    let cameras: Vec<Option<String>> =
        if args.camera.is_empty() { vec![None] } else { args.camera.iter().cloned().map(Some).collect() };
    let mut cases: Vec<Case> = Vec::new();
    for path in &args.projects {
        for camera in &cameras {
            let project = args.project(path.clone(), camera.clone());
            let case = Case::new(path, project.settings(), on_cpu(project.choice()))?;
            if !cases.iter().any(|known| known.key == case.key) {
                cases.push(case);
            }
        }
    }
    Ok(cases)
}

/// The choice with `auto` replaced by `cpu`: only the cpu engines use these threads.
fn on_cpu(choice: Choice) -> Choice {
    Choice {
        raster: if choice.raster == RasterChoice::Auto { RasterChoice::Cpu } else { choice.raster },
        backend: if choice.backend == BackendChoice::Auto { BackendChoice::Cpu } else { choice.backend },
        ..choice
    }
}

fn wrong(path: &Path, error: &std::io::Error) -> Failure {
    Failure::Work(format!("{}: {error}", path.display()))
}

fn write(args: &BenchArgs, file: &ThreadsFile) -> Result<(), Failure> {
    if let Some(path) = &args.json {
        file.write(path)?;
    }
    if let Some(path) = &args.markdown {
        write_atomically(path, text::markdown(file).as_bytes()).map_err(|error| wrong(path, &error))?;
    }
    Ok(())
}

/// Draws the curves into a file named after project and view, with a number if this command has `written` that file. `None` without curves.
fn plot(folder: &Path, case: &ThreadsCase, written: &[PathBuf]) -> Result<Option<PathBuf>, Failure> {
    let Some(plot) = threads_plot(case) else { return Ok(None) };
    let project = case.project.file_stem().and_then(|stem| stem.to_str()).unwrap_or("project");
    let keep = |c: char| if c.is_alphanumeric() || c == '-' || c == '_' { c } else { '_' };
    let stem: String = format!("threads_{project}_{}", case.view).chars().map(keep).collect();
    let names = std::iter::once(format!("{stem}.svg")).chain((2..).map(|number| format!("{stem}_{number}.svg")));
    let Some(path) = names.map(|name| folder.join(name)).find(|path| !written.contains(path)) else { return Ok(None) };
    write_atomically(&path, plot.file.as_bytes()).map_err(|error| wrong(&path, &error))?;
    Ok(Some(path))
}

fn introduce(file: &ThreadsFile) {
    let machine = &file.environment;
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let of = format!(
        "{}, {cores} processors, {} build, commit {}; {} rounds of {} frames after {} of warm-up",
        machine.cpu, machine.profile, machine.commit, file.rounds, file.frames, file.warmup
    );
    say_prose(&of, 2);
    say_prose("ms on the wall (times as fast as on the fewest threads, ms of processor time of all threads)", 2);
    if machine.profile == "debug" {
        crate::say!("this is no release build: times say little");
    }
}

fn print(case: &ThreadsCase) {
    crate::say!("{HEADER}{}{HEADER:#}", text::heading(case));
    let lines = text::lines(case);
    let mut rows = vec![vec!["threads".to_owned()]];
    rows[0].extend(case.frame.iter().map(|point| point.threads.to_string()));
    for (name, points) in &lines {
        let mut row = vec![name.clone()];
        row.extend(points.iter().map(|point| text::cell(points, point)));
        rows.push(row);
    }
    table::print_aligned(&rows, 1);
}
