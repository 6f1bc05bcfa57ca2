//! The command line. Exit codes: 0 success; 1 the work failed, or a comparison exceeds a limit; 2 wrong command line; 3 a project,
//! scene or picture file is in error.
mod allocator;
mod cli;

use clap::{CommandFactory as _, Parser as _};
use cli::Failure;
use cli::args::{Cli, Command};
use std::process::ExitCode;

// Loaders turn panics of the crates that they call into errors (`pipeline/src/guard.rs`).
const _: () = assert!(cfg!(panic = "unwind"), "the program has to be built with panic = \"unwind\"");

#[global_allocator]
static ALLOCATOR: allocator::Counting = allocator::Counting;

/// Stack size of the thread that runs the command, bytes. It is allocated at once: if a memory limit left no room for the main
/// thread's stack to grow, the system would end the process without a message.
const STACK: usize = 8 << 20;

fn main() -> ExitCode {
    allocator::end_with_an_error();
    allocator::refuse_as_the_environment_says();
    match std::thread::Builder::new().stack_size(STACK).spawn(command) {
        // The panic has printed its message.
        Ok(thread) => thread.join().unwrap_or(ExitCode::from(101)),
        Err(error) => {
            let failure = Failure::Work(format!("no thread can be started: {error}"));
            failure.print();
            failure.exit_code()
        }
    }
}

fn command() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return cli::usage(&error),
    };
    let code = match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            failure.print();
            failure.exit_code()
        }
    };
    if code == ExitCode::SUCCESS && cli::unheard() { ExitCode::FAILURE } else { code }
}

fn run(cli: Cli) -> Result<(), Failure> {
    if let Some(bytes) = cli.command.max_memory() {
        allocator::limit(bytes);
        curitiba::pipeline::memory::count_outside_by(allocator::outside);
    }
    #[cfg(unix)]
    cli::signals::handle().map_err(Failure::work)?;
    cli::confine(cli.confine.as_deref())?;
    match cli.command {
        Command::Render(args) => cli::render::run(&args),
        Command::Plan(args) => cli::plan::run(&args),
        Command::Check(args) => cli::check::run(&args),
        Command::List { program } => cli::list::run(program.as_deref()),
        Command::Compare(args) => cli::compare::run(&args),
        Command::Reference(args) => cli::reference::run(&args),
        Command::Report(args) => cli::report::run(&args),
        Command::Tune(args) => cli::tune::run(&args),
        Command::Scene(args) => cli::scene::run(&args),
        Command::Bench(args) => cli::bench::run(&args),
        Command::Merge(args) => cli::merge::run(&args),
        Command::Visibility(args) => cli::visibility::run(&args),
        Command::View { arguments } => cli::view::run(cli.confine.as_deref(), &arguments),
        Command::Man(args) => cli::man::run(&args, Cli::command()),
        Command::Completions { shell } => cli::completions(shell),
    }
}
