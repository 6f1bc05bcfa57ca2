//! What `.ci/run` counts, and that it runs the commands that the README shows.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn bash(script: &Path, arguments: &[&str]) -> Output {
    Command::new("bash").arg(script).args(arguments).output().expect("bash starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

#[test]
fn a_passing_test_that_says_skipped_is_counted_as_skipped_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = folder.path().join("first.txt");
    let second = folder.path().join("second.txt");
    let passing = "successes:\n\n---- a stdout ----\nskipped: no GPU\nskipped: no other GPU\n\n---- b stdout ----\n3 skipped: x\n\n\
                   successes:\n    a\n    b\n\n";
    // What a failing test prints does not make it a skipped one.
    let failing = "failures:\n\n---- c stdout ----\nskipped: no GPU\n\nfailures:\n    c\n\n";
    let result = "test result: FAILED. 2 passed; 1 failed; 4 ignored; 0 measured; 0 filtered out; finished in 0.00s\n";
    std::fs::write(&first, format!("test a ... ok\n{passing}{failing}{result}")).expect("written");
    let alone = "successes:\n\n---- d stdout ----\nskipped: no GPU\n\nsuccesses:\n    d\n\ntest result: ok. 1 passed; 0 failed; 0 ignored\n";
    std::fs::write(&second, alone).expect("written");
    let files = [&first, &second].map(|path| path.to_str().expect("a path in UTF-8"));
    let counted = bash(&root(".ci/count"), &files);
    assert_eq!(text(&counted.stdout), "1 passed, 1 failed, 6 skipped\n", "{}", text(&counted.stderr));
    let reasons = bash(&root(".ci/count"), &["--reasons", files[0], files[1]]);
    let reasons = text(&reasons.stdout);
    let lines: Vec<&str> = reasons.lines().map(str::trim).collect();
    assert_eq!(lines, ["4  ignored", "2  skipped: no GPU"]);
}

#[test]
fn every_command_of_the_readme_is_run_or_said_not_to_be() {
    let listed = bash(&root(".ci/readme"), &["--list"]);
    assert!(listed.status.success(), "{}", text(&listed.stderr));
    let listed = text(&listed.stdout);
    let readme = std::fs::read_to_string(root("README.md")).expect("the README");
    let blocks = readme.split("```").skip(1).step_by(2).filter_map(|block| block.strip_prefix("sh\n"));
    let commands: Vec<&str> = blocks.flat_map(str::lines).collect();
    assert!(commands.len() >= 5, "{commands:?}");
    let fates: Vec<&str> = listed.lines().collect();
    assert_eq!(fates.len(), 2 * commands.len(), "{listed}");
    for (command, fate) in commands.iter().zip(fates.chunks(2)) {
        assert_eq!(fate[0], *command);
        assert!(fate[1].starts_with("  run: ") || fate[1].starts_with("  not run: "), "{fate:?}");
    }
    for command in
        ["cargo run --release -- render xml_projects/SceneFinal.xml", "cargo run --release -- report --quick"]
    {
        assert!(fates.contains(&format!("  run: {command}").as_str()), "{listed}");
    }
}

#[test]
fn a_command_that_nobody_runs_is_found_out() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join(".ci")).expect("a folder");
    let script = folder.path().join(".ci/readme");
    std::fs::copy(root(".ci/readme"), &script).expect("copied");
    let readme = std::fs::read_to_string(root("README.md")).expect("the README");
    let with = |text: &str| {
        std::fs::write(folder.path().join("README.md"), text).expect("written");
        bash(&script, &["--list"])
    };
    assert!(with(&readme).status.success());
    let unknown = with(&format!("{readme}\n```sh\ncargo run --release -- dance\n```\n"));
    assert_eq!(unknown.status.code(), Some(1));
    assert!(text(&unknown.stderr).contains("cargo run --release -- dance"), "{}", text(&unknown.stderr));
    assert_eq!(with("no blocks at all\n").status.code(), Some(1), "a README without commands is noticed");
}
