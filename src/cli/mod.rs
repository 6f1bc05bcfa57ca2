//! The commands of the program, one module each, and what they share.

pub mod args;
pub mod bench;
mod bench_args;
mod bench_begin;
mod bench_jobs;
mod bench_parts;
mod bench_rows;
mod bench_table;
mod bench_threads;
pub mod check;
pub mod compare;
mod compare_args;
mod display;
mod failure;
mod inspect;
pub mod list;
mod load;
pub mod man;
pub mod merge;
pub mod plan;
mod progress;
pub mod reference;
mod reference_args;
pub mod render;
mod render_output;
mod render_path;
pub mod report;
pub mod scene;
#[cfg(unix)]
pub mod signals;
mod table;
pub mod tune;
mod tune_args;
pub mod view;
pub mod visibility;
mod visibility_args;
mod width;

pub use failure::Failure;

use clap::CommandFactory as _;
use curitiba::pipeline::diagnostic::Warnings;
use curitiba::pipeline::files;
use curitiba::pipeline::plan::{Plan, RayPictures};
use curitiba::{Choice, engines, fastest};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Prints a line to the output stream, with colours only on a terminal. On a terminal the last column of a table is
/// [wrapped](width::wrapped).
///
/// A closed pipe is no error, as with `head`: files are still written. A full disk ends the program with a message.
#[macro_export]
macro_rules! say {
    ($($argument:tt)*) => { $crate::cli::print_line(format_args!($($argument)*)) };
}

/// Prints a line to the error stream, with colours only on a terminal. See [`unheard`].
#[macro_export]
macro_rules! tell {
    ($($argument:tt)*) => { $crate::cli::tell_line(format_args!($($argument)*)) };
}

/// Whether the error stream failed.
static UNHEARD: AtomicBool = AtomicBool::new(false);

/// See [`say!`].
pub fn print_line(line: std::fmt::Arguments<'_>) {
    let lines = match width::of_terminal() {
        Some(columns) => width::wrapped(&line.to_string(), columns).join("\n"),
        None => line.to_string(),
    };
    if let Err(failure) = printed(writeln!(anstream::stdout(), "{lines}")) {
        failure.print();
        // `exit` runs no destructors, so temporary files are removed here.
        files::abandon();
        std::process::exit(1);
    }
}

/// See [`tell!`].
pub fn tell_line(line: std::fmt::Arguments<'_>) {
    if printed(writeln!(anstream::stderr(), "{line}")).is_err() {
        UNHEARD.store(true, Ordering::Relaxed);
    }
}

/// Prints prose, folded at words to the width of a terminal; continuation lines are indented by `indent` spaces.
pub fn say_prose(text: &str, indent: usize) {
    width::folded_by(text, indent, width::of_terminal()).iter().for_each(|line| crate::say!("{line}"));
}

/// [`say_prose`] to the error stream.
pub fn tell_prose(text: &str, indent: usize) {
    width::folded_by(text, indent, width::of_error_stream()).iter().for_each(|line| crate::tell!("{line}"));
}

/// Whether writing to the error stream failed, other than because its reader went away. Only the exit code can report that.
pub fn unheard() -> bool {
    UNHEARD.load(Ordering::Relaxed)
}

/// Turns an error of writing to a stream into a failure. A closed pipe is no failure.
fn printed(result: std::io::Result<()>) -> Result<(), Failure> {
    match result {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::Work(format!("the output stream cannot be written: {error}")))
        }
        _ => Ok(()),
    }
}

/// Prints the completions of a shell.
pub fn completions(shell: clap_complete::Shell) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut args::Cli::command(), "curitiba", &mut script);
    let mut stream = std::io::stdout().lock();
    printed(stream.write_all(&script).and_then(|()| stream.flush()))
}

/// Prints help, or the error of the command line, and returns the exit code.
pub fn usage(error: &clap::Error) -> ExitCode {
    match printed(error.print().and_then(|()| std::io::stdout().flush())) {
        // Help was requested.
        Err(failure) if error.exit_code() == 0 => {
            failure.print();
            failure.exit_code()
        }
        _ => ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2)),
    }
}

/// Confines the process to the folder of `--confine`.
pub fn confine(folder: Option<&Path>) -> Result<(), Failure> {
    let Some(folder) = folder else { return Ok(()) };
    files::confine(folder).map_err(|error| Failure::Usage(format!("--confine {}: {error}", folder.display())))
}

/// Checks that references can be stored in their folder, if the process is confined.
fn check_references(folder: &Path, remedy: &str) -> Result<(), Failure> {
    files::check_place(folder)
        .map_err(|error| Failure::Usage(format!("references cannot be kept: {error}\n       {remedy}")))
}

/// Prints the files that were read and lie outside the project's folder and its subfolders.
fn print_outside(project: &Path, more: impl IntoIterator<Item = PathBuf>) {
    let outside = files::outside(project.parent().unwrap_or(Path::new("")), more);
    if outside.is_empty() {
        return;
    }
    crate::say!("\nfiles outside the project's folder: {} (--confine DIR refuses those outside DIR)", outside.len());
    for path in outside {
        crate::say!("  {}", path.display());
    }
}

/// Starts the threads of the cpu engines: all cores, unless a number is given.
fn set_threads(threads: Option<u16>) -> Result<(), Failure> {
    curitiba::threads::start(threads).map_err(Failure::Work)
}

/// Prints which ray backend was found to be the fastest, if that was asked for. The argument is not used, but to compute it the caller
/// measures the backends, so the threads must be started already.
fn tell_fastest(_: Choice) {
    if let Some(found) = fastest::taken() {
        crate::tell!("{found}");
    }
}

/// Checks whether the engines support the plan: before anything is loaded, rather than at the first frame. A missing engine only causes a
/// warning here; only `render` fails for it.
fn ask_engines(plan: &mut Plan, choice: Choice) -> Result<(), Failure> {
    let mut engines = match engines::exactly(Choice { raster: choice.for_plan(plan).raster, ..choice }, plan) {
        Ok(engines) => engines,
        Err(error) => {
            failure::print_warning(&format!("what it cannot do is not known here: {error}"));
            return Ok(());
        }
    };
    plan.fit((engines.raster.name(), engines.raster.limits()), engines.ray_limits(plan))
        .map_err(|error| Failure::Usage(error.to_string()))?;
    let shared = engines.raster.shares().is_some_and(|device| engines.rays.joins(device));
    let pictures = match shared {
        _ if engines.differ() => RayPictures::Apart,
        true if engines.rays.shares_pictures() => RayPictures::Shared,
        true => RayPictures::Apart,
        false => RayPictures::Lent,
    };
    _ = plan.decide_showing_quad(&mut *engines.raster, &mut *engines.rays, pictures);
    let (raster, rays_of) = (&*engines.raster, |pass: &str| engines.rays_of(pass));
    // If a fallback is allowed, it takes over.
    let stands_in = choice.for_plan(plan).fallback.iter().any(Option::is_some);
    let for_the_cpu =
        || plan.untraced_sun(rays_of).or_else(|| plan.unlit(rays_of)).or_else(|| plan.unfiltered(rays_of));
    let for_the_cpu = || for_the_cpu().or_else(|| plan.unsampled(rays_of));
    let for_the_cpu = || for_the_cpu().or_else(|| plan.without_cones(rays_of));
    let left = || if stands_in { None } else { for_the_cpu() };
    let refused = plan
        .undrawn_spheres(raster)
        .or_else(|| plan.undrawn_shaders(raster))
        .or_else(|| plan.untraced_spheres(rays_of))
        .or_else(left);
    if let Some((pass, error)) = refused {
        return Err(Failure::Work(format!("pass `{pass}`: {error}")));
    }
    for planned in &plan.passes {
        let pass = &plan.pass(planned).name;
        if let Some(traced) = plan.traced(planned) {
            let rays = rays_of(pass);
            let supported = match traced.program {
                Some((program, _)) => rays.supports(program, plan.settings.fidelity),
                // If a fallback is allowed, it takes over.
                None if stands_in => Ok(()),
                None => rays.supports_intersections(),
            };
            supported.map_err(|error| Failure::Work(format!("pass `{pass}`: {error}")))?;
        }
    }
    Ok(())
}

/// Prints counted warnings to the terminal's error stream.
fn print_warnings(warnings: &Warnings) {
    for group in warnings.groups() {
        failure::print_warning(&group.to_string());
    }
}
