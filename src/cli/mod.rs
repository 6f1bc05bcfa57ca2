//! The verbs of the command line, one module each, and what they share.

pub mod args;
pub mod bench;
mod bench_args;
mod bench_table;
pub mod check;
pub mod compare;
mod failure;
mod inspect;
pub mod list;
pub mod plan;
mod progress;
pub mod render;
pub mod report;
pub mod scene;
mod table;

pub use failure::Failure;

use curitiba::pipeline::diagnostic::Warnings;

/// Prints a line to the output stream, with colours only where it is a terminal.
///
/// A closed pipe is no error, as `head` expects: the files are still written. A full disk ends the program with a message.
#[macro_export]
macro_rules! say {
    ($($argument:tt)*) => { $crate::cli::print_line(format_args!($($argument)*)) };
}

/// See [`say!`].
pub fn print_line(line: std::fmt::Arguments<'_>) {
    use std::io::Write as _;
    match writeln!(anstream::stdout(), "{line}") {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Failure::Work(format!("the output stream cannot be written: {error}")).print();
            std::process::exit(1);
        }
        _ => {}
    }
}

/// Sets the number of threads of the cpu engines.
fn set_threads(threads: Option<u16>) -> Result<(), Failure> {
    let Some(threads) = threads else { return Ok(()) };
    rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global().map_err(Failure::work)
}

/// Prints counted warnings to the terminal's error stream.
fn print_warnings(warnings: &Warnings) {
    for group in warnings.groups() {
        failure::print_warning(&group.to_string());
    }
}
