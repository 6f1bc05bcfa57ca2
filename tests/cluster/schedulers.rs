//! The scripts of `examples/cluster`, as schedulers run them.

use super::{clean, json, names, project, root, rows, text, twelve_rows};
use std::path::Path;
use std::process::{Command, Stdio};

fn installed(program: &str) -> bool {
    let found = Command::new(program).arg("--version").stdin(Stdio::null()).output();
    found.is_ok_and(|output| output.status.success())
}

/// Runs a script of `examples/cluster`.
fn script(folder: &Path, name: &str, arguments: &[&str]) -> String {
    let mut command = Command::new("bash");
    command.current_dir(folder).arg(root("examples/cluster").join(name)).args(arguments);
    clean(&mut command);
    command.env("CURITIBA", env!("CARGO_BIN_EXE_curitiba")).env("CURITIBA_CACHE", folder.join("references"));
    // GNU parallel keeps a folder of its own.
    command.env("JOBS", "2").env("HOME", folder).stdin(Stdio::null());
    let output = command.output().expect("bash starts");
    assert!(output.status.success(), "{name}:\n{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

#[test]
fn gnu_parallel_runs_a_benchmark_and_the_frames_of_a_path() {
    if !installed("parallel") {
        println!("skipped: GNU parallel is not installed");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let arguments = twelve_rows();
    let arguments: Vec<&str> = ["4", "parts"].into_iter().chain(arguments[1..].iter().map(String::as_str)).collect();
    let printed = script(folder, "parallel.sh", &arguments);
    assert!(printed.contains("12 rows of 1 machine\n"), "{printed}");
    let file = json(&folder.join("parts.json"));
    assert_eq!((rows(&file).len(), file["complete"].as_bool()), (12, Some(true)));
    assert!(names(&folder.join("parts")).contains(&"jobs.log".to_owned()));

    let shadows = project("SceneShadows.xml");
    let fixed =
        ["--size", "32x32", "--raster", "cpu", "--backend", "cpu", "--path", "orbit:0,4,0,30,6,15", "-o", "f.png"];
    let printed = script(folder, "frames.sh", &[&["3", &shadows][..], &fixed].concat());
    assert!(printed.contains("6 of 6 frames, 6 of them were there"), "{printed}");
}

#[test]
fn every_script_is_one_that_bash_reads() {
    for name in names(&root("examples/cluster")) {
        let output =
            Command::new("bash").arg("-n").arg(root("examples/cluster").join(&name)).output().expect("bash starts");
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
    }
}
