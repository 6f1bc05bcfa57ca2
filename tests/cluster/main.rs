//! Work distributed over processes: rows of a benchmark, frames of a camera path, and runs under schedulers.

mod frames;
mod killed;
mod merge;
mod schedulers;
mod shards;

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn project(name: &str) -> String {
    root("xml_projects").join(name).to_str().expect("test paths are UTF-8").to_owned()
}

/// The program in a folder, with its own references, and without the variables of a scheduler that these tests may run under.
fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).args(arguments);
    clean(&mut command);
    command.env("CURITIBA_CACHE", folder.join("references"));
    command
}

fn clean(command: &mut Command) {
    for name in ["SLURM_ARRAY_TASK_ID", "SGE_TASK_ID", "OMPI_COMM_WORLD_RANK", "PMI_RANK", "PBS_ARRAY_INDEX"] {
        command.env_remove(name);
    }
    command.env_remove("HQ_TASK_ID").env_remove("PARALLEL_SEQ").env("NO_COLOR", "1");
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("output is UTF-8")
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().expect("the program starts")
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) -> (String, String) {
    let output = run(folder, arguments);
    assert!(output.status.success(), "{arguments:?} failed:\n{}", text(&output.stderr));
    (text(&output.stdout), text(&output.stderr))
}

#[track_caller]
fn fails_with(code: i32, folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let printed = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?} printed:\n{printed}");
    printed
}

fn json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The names of a folder's entries, sorted.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<String> = entries.map(|name| name.to_str().expect("UTF-8").to_owned()).collect();
    names.sort();
    names
}

fn rows(file: &Value) -> &Vec<Value> {
    file["rows"].as_array().expect("rows")
}

/// The arguments of a benchmark with 12 rows that take almost no time.
fn twelve_rows() -> Vec<String> {
    let words =
        ["--sweep", "samples=1,4,9", "--camera", "MainCamera", "--camera", "Vidro", "--size", "24x24", "--frames", "1"];
    let fixed = ["--warmup", "0", "--raster", "cpu", "--backend", "cpu", "--reference-samples", "128"];
    ["bench".to_owned(), project("SceneSSAO.xml"), project("SceneFinal.xml")]
        .into_iter()
        .chain(words.into_iter().chain(fixed).map(str::to_owned))
        .collect()
}

fn with<'a>(base: &'a [String], more: &[&'a str]) -> Vec<&'a str> {
    base.iter().map(String::as_str).chain(more.iter().copied()).collect()
}
