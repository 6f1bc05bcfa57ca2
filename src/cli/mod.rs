//! The verbs of the command line, one module each, and what they share.

pub mod args;
pub mod check;
mod failure;
pub mod list;
pub mod plan;
mod progress;
pub mod render;
pub mod scene;
mod table;

pub use failure::Failure;

use curitiba::pipeline::diagnostic::Warnings;

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
