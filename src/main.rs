//! The command line. Exit codes: 0 done; 1 the work failed, or a comparison is beyond a limit; 2 the
//! command line is wrong; 3 a project, scene or picture file is wrong.
#![forbid(unsafe_code)]

mod cli;

use clap::{CommandFactory as _, Parser as _};
use cli::args::{Cli, Command};
use std::process::ExitCode;

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Render(args) => cli::render::run(&args),
        Command::Plan(args) => cli::plan::run(&args),
        Command::Check(args) => cli::check::run(&args),
        Command::List { program } => cli::list::run(program.as_deref()),
        Command::Compare(args) => cli::compare::run(&args),
        Command::Report(args) => cli::report::run(&args),
        Command::Scene(args) => cli::scene::run(&args),
        Command::Bench(args) => cli::bench::run(&args),
        Command::Completions { shell } => {
            clap_complete::generate(shell, &mut Cli::command(), "curitiba", &mut std::io::stdout());
            Ok(())
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            failure.print();
            failure.exit_code()
        }
    }
}
