//! `curitiba tune` as a user runs it: the project that it writes meets the goal.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn project(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name)
}

fn curitiba(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).args(arguments).env("NO_COLOR", "1");
    // A cache of its own, so that references of other runs have no effect.
    command.env("CURITIBA_CACHE", folder.join("cache")).output().expect("the program starts")
}

fn tune(folder: &Path, name: &str, arguments: &[&str]) -> Output {
    let path = project(name);
    let path = path.to_str().expect("a path in UTF-8");
    let common = ["tune", path, "--size", "40x32", "--raster", "cpu", "--backend", "cpu", "--frames", "2"];
    curitiba(folder, &[&common[..], arguments].concat())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("output is UTF-8")
}

/// For each row of the output: its mark, its error, and the settings after it.
fn rows(output: &str) -> Vec<(char, f64, String)> {
    let row = |line: &str| {
        let (times, rest) = line.split_once(')')?;
        let mut words = rest.split_whitespace();
        let error = words.next()?.parse().ok()?;
        times
            .contains(" to ")
            .then(|| (line.chars().next().unwrap_or(' '), error, words.skip(1).collect::<Vec<_>>().join(" ")))
    };
    output.lines().filter(|line| !line.starts_with("rendered")).filter_map(row).collect()
}

#[test]
fn the_project_written_keeps_the_error_that_was_asked_for() {
    let place = tempfile::tempdir().expect("a folder");
    let made = tune(place.path(), "SceneSSAO.xml", &["--error", "0.05", "-o", "ao.xml"]);
    let (output, told) = (text(&made.stdout), text(&made.stderr));
    assert!(made.status.success(), "{output}\n{told}");
    assert!(told.lines().any(|line| line.starts_with("load average ") && line.contains(" thread")), "{told}");
    let rows = rows(&output);
    assert!(rows.len() > 20, "{output}");
    let marked = |mark: char| rows.iter().filter(|row| row.0 == mark).collect::<Vec<_>>();
    let [(_, error, chosen)] = marked('*')[..] else { panic!("{output}") };
    assert!(*error <= 0.05 && marked('+').len() == 2, "{output}");
    assert!(rows.iter().any(|row| row.1 > 0.05), "the goal leaves something out\n{output}");
    assert!(rows.iter().any(|row| row.2.starts_with("gtao")) && output.contains("(as declared)"), "{output}");
    assert!(output.contains("rendered again: "), "{output}");
    // The written project is the chosen row: it renders at the size that was measured, and its parameters are the chosen ones.
    let listed = curitiba(place.path(), &["plan", "ao.xml"]);
    let plan = text(&listed.stdout);
    assert!(listed.status.success(), "{}", text(&listed.stderr));
    assert!(plan.contains("window 40 x 32"), "{plan}");
    let passes: Vec<_> = plan.lines().filter(|line| line.starts_with("  pass")).collect();
    assert!(passes.len() >= 3 && passes.iter().all(|line| line.ends_with(", 40 x 32")), "{plan}");
    let xml = std::fs::read_to_string(place.path().join("ao.xml")).expect("the project");
    for setting in chosen.split_whitespace().filter_map(|word| word.split_once('=')) {
        let (name, value) = setting;
        assert!(xml.contains(&format!("{name}=\"{value}\"")) || value == "100", "{chosen}\n{xml}");
    }
    let temporary = std::fs::read_dir(place.path()).expect("a folder").filter_map(Result::ok);
    assert!(temporary.map(|entry| entry.file_name()).all(|name| !name.to_string_lossy().starts_with(".curitiba")));
}

#[test]
fn pictures_are_judged_as_a_whole_where_their_reference_is_kept() {
    let place = tempfile::tempdir().expect("a folder");
    let arguments = ["--time", "10s", "--of", "picture", "-o", "shadows.xml"];
    let refused = tune(place.path(), "SceneShadows.xml", &arguments);
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused.stderr));
    let told = text(&refused.stderr);
    assert!(told.contains("--of picture: ") && told.contains("curitiba reference "), "{told}");
    let path = project("SceneShadows.xml");
    let made = curitiba(place.path(), &["reference", path.to_str().expect("UTF-8"), "--size", "40x32"]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let tuned = tune(place.path(), "SceneShadows.xml", &arguments);
    let (output, told) = (text(&tuned.stdout), text(&tuned.stderr));
    assert!(tuned.status.success() && told.contains("whose own standard error is"), "{output}\n{told}");
    // Measured by the whole picture, rays have an error too: that of edges with one sample.
    let found = rows(&output);
    assert!(found.len() > 5 && found.iter().all(|row| row.1 > 0.01), "{output}");
    let effect = tune(place.path(), "SceneShadows.xml", &["--time", "10s", "-o", "other.xml"]);
    let of_rays = rows(&text(&effect.stdout)).into_iter().find(|row| row.2.starts_with("deferredShadows"));
    assert!(of_rays.is_some_and(|row| row.1 < 1e-3), "{}", text(&effect.stdout));
}

#[test]
fn what_nothing_reaches_is_said_with_what_comes_nearest() {
    let place = tempfile::tempdir().expect("a folder");
    let made = tune(place.path(), "raster/SceneShadowMap.xml", &["--time", "0.001ms"]);
    assert_eq!(made.status.code(), Some(1));
    let told = text(&made.stderr);
    assert!(told.contains("nothing measured gives the least RMSE within 0.001 ms; nearest: "), "{told}");
    assert!(!place.path().join("tuned.xml").exists());
}

#[test]
fn what_cannot_be_tuned_is_refused_before_anything_is_measured() {
    let place = tempfile::tempdir().expect("a folder");
    std::fs::write(place.path().join("there.xml"), "mine").expect("a file");
    let time = "--time=1s";
    for (name, arguments, message) in [
        ("SceneNoEffects.xml", [time, "-oa.xml"], "no pass that runs has anything in its place"),
        ("SceneSSAO.xml", [time, "-othere.xml"], "there already"),
        ("SceneSSAO.xml", [time, "-oa.txt"], "written as .xml"),
        ("SceneSSAO.xml", [time, "-onowhere/a.xml"], "nowhere"),
        ("SceneSSAO.xml", [time, "--bands=2"], "whole frames are measured"),
        ("SceneSSAO.xml", ["--time=1", "-oa.xml"], "16.6ms"),
        ("SceneSSAO.xml", ["--error=-1", "-oa.xml"], "a number from 0 on"),
        ("SceneSSAO.xml", [time, "--error=0.1"], "cannot be used with"),
        ("SceneSSAO.xml", ["--metric=flip", "-oa.xml"], "--time"),
    ] {
        let refused = tune(place.path(), name, &arguments);
        assert_eq!(refused.status.code(), Some(2), "{arguments:?}: {}", text(&refused.stderr));
        assert!(text(&refused.stderr).contains(message), "{arguments:?}: {}", text(&refused.stderr));
        let loads = name == "SceneNoEffects.xml";
        assert_eq!(text(&refused.stderr).contains("load average "), loads, "nothing is timed: {arguments:?}");
    }
    assert_eq!(std::fs::read_to_string(place.path().join("there.xml")).expect("it stays"), "mine");
}
