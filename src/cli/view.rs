//! `curitiba view`: starts the window, which is a separate program.

use super::Failure;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Name of the window's program.
const PROGRAM: &str = "curitiba-view";

/// Starts the program with these arguments, waits, and exits with its exit code.
pub fn run(confine: Option<&Path>, arguments: &[OsString]) -> Result<(), Failure> {
    let program = beside().unwrap_or_else(|| PROGRAM.into());
    let mut command = Command::new(&program);
    if let Some(folder) = confine {
        command.arg("--confine").arg(folder);
    }
    match command.args(arguments).status() {
        Ok(status) if status.success() => Ok(()),
        // The program has printed its error; a program ended by a signal has no exit code.
        Ok(status) => std::process::exit(status.code().unwrap_or(1)),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(Failure::Work(format!(
            "the window is a program of its own, `{PROGRAM}`, which is neither beside this one nor on PATH\n       \
             build it where curitiba was built: cargo build --release --package curitiba-view"
        ))),
        Err(error) => Err(Failure::Work(format!("{}: {error}", program.display()))),
    }
}

/// The window's program in the folder of this program, if it exists.
fn beside() -> Option<PathBuf> {
    let own = std::env::current_exe().ok()?;
    let program = own.with_file_name(format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX));
    program.is_file().then_some(program)
}
