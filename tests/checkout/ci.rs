//! The counts of `.ci/run`, and that it runs the commands shown in the README. Also that `cuda/conformance.sh` runs every test that needs
//! an NVIDIA GPU.

use std::collections::BTreeSet;
use std::os::unix::fs::PermissionsExt;
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
    // The output of a failing test is not counted as skipped.
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

/// The output of `cargo test` for a program whose test `a` passed and printed `shown`.
fn part(program: &str, shown: &str) -> String {
    let printed = if shown.is_empty() { String::new() } else { format!("---- a stdout ----\n{shown}\n") };
    format!(
        "     Running {program}\n\nrunning 1 test\ntest a ... ok\n\nsuccesses:\n\n{printed}successes:\n    a\n\n\
         test result: ok. 1 passed; 0 failed; 0 ignored\n\n"
    )
}

#[test]
fn the_tests_that_were_skipped_are_named_with_their_programs() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log.txt");
    let skipped = "skipped: no GPU\n";
    let parts = [
        part("unittests src/lib.rs (target/debug/deps/some_passes-0a1b)", skipped),
        part("tests/deep.rs (target/debug/deps/deep-2c3d)", "not skipped: 1\n"),
        part("tests/own_rays/main.rs (/else where/target/debug/deps/own_rays-4e5f)", &skipped.repeat(2)),
        part("unittests src/lib.rs (target/debug/deps/other-6a7b)", "")
            .replace("test a ", "test parts::b ")
            .replace("successes:\n\n", &format!("successes:\n\n---- parts::b stdout ----\n{skipped}\n")),
        part("unittests src/lib.rs (target/debug/deps/another-6a7b)", "").replace("test a ", "test c "),
        part("unittests src/main.rs (target/debug/deps/program-8c9d)", skipped)
            .replace("test a ", "test d ")
            .replace("- a s", "- d s"),
    ];
    std::fs::write(&log, parts.concat()).expect("written");
    let lines = |option: &str| {
        let output = bash(&root(".ci/count"), &[option, log.to_str().expect("a path in UTF-8")]);
        text(&output.stdout).lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let sorted = |mut lines: Vec<String>| {
        lines.sort_unstable();
        lines
    };
    assert_eq!(sorted(lines("--programs")), ["--bins", "--lib", "--test", "own_rays"]);
    assert_eq!(sorted(lines("--skipped")), ["a", "d", "parts::b"]);
}

#[test]
fn a_doc_test_that_was_skipped_is_an_error_because_it_is_not_run_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log.txt");
    let name = "src/lib.rs - open (line 5)";
    let tests = part("tests/rays.rs (target/debug/deps/rays-2c3d)", "skipped: no GPU\n");
    let docs = tests.replace("     Running tests/rays.rs (target/debug/deps/rays-2c3d)", "   Doc-tests some_passes");
    let docs = docs.replace("test a ", &format!("test {name} ")).replace("- a s", &format!("- {name} s"));
    std::fs::write(&log, tests + &docs).expect("written");
    let log = log.to_str().expect("a path in UTF-8");
    let programs = bash(&root(".ci/count"), &["--programs", log]);
    assert_eq!((programs.status.code(), text(&programs.stdout)), (Some(1), "--test\nrays\n".to_owned()));
    assert!(text(&programs.stderr).contains(&format!("the doc test `{name}`")), "{}", text(&programs.stderr));
    assert_eq!(text(&bash(&root(".ci/count"), &[log]).stdout), "0 passed, 0 failed, 2 skipped\n");
}

#[test]
fn a_test_that_is_run_again_counts_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let logs = ["first.txt", "second.txt"].map(|name| folder.path().join(name));
    let skipped = "skipped: no GPU\n";
    let rays = "tests/rays.rs (target/debug/deps/rays-2c3d)";
    let other = "tests/other.rs (target/debug/deps/other-2c3d)";
    let counted = |first: String, second: String| {
        std::fs::write(&logs[0], first).expect("written");
        std::fs::write(&logs[1], second).expect("written");
        let paths = [&logs[0], &logs[1]].map(|path| path.to_str().expect("a path in UTF-8"));
        text(&bash(&root(".ci/count"), &paths).stdout)
    };
    // The test is first skipped, then run. A test of the same name in another program does not replace it.
    assert_eq!(counted(part(rays, skipped) + &part(other, skipped), part(rays, "")), "1 passed, 0 failed, 1 skipped\n");
    assert_eq!(counted(part(rays, skipped), part(rays, skipped)), "0 passed, 0 failed, 1 skipped\n");
    assert_eq!(counted(part(rays, ""), part(rays, "")), "1 passed, 0 failed, 0 skipped\n");
    assert_eq!(
        counted(part(rays, ""), "test result: FAILED. 0 passed; 1 failed\n".to_owned()),
        "1 passed, 1 failed, 0 skipped\n"
    );
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

/// Other workspaces need this profile to reuse the dependencies that are compiled already.
#[test]
fn the_profile_of_tests_is_printed_whole_save_for_what_a_variable_sets() {
    let printed = |variable: Option<&str>| {
        let mut command = Command::new("bash");
        command.arg(root(".ci/profile")).env_remove("CARGO_PROFILE_DEV_DEBUG");
        if let Some(value) = variable {
            command.env("CARGO_PROFILE_DEV_DEBUG", value);
        }
        text(&command.output().expect("bash starts").stdout)
    };
    let manifest = std::fs::read_to_string(root("Cargo.toml")).expect("read");
    let settings = |text: &str| {
        let lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    let start = manifest.find("[profile.dev]").expect("a profile");
    let end = manifest.find("[profile.release]").expect("another after it");
    let mut expected = settings(&manifest[start..end]);
    assert!(expected.len() > 20, "{expected:?}");
    assert_eq!(settings(&printed(None)), expected);
    expected.retain(|line| !line.starts_with("debug = "));
    assert_eq!(settings(&printed(Some("0"))), expected);
}

/// Runs `.ci/api`; `None` where Python is not installed.
fn api(arguments: &[&Path]) -> Option<Output> {
    let output = Command::new("python3").arg(root(".ci/api")).args(arguments).output();
    if output.is_err() {
        println!("skipped: python3 is not installed");
    }
    output.ok()
}

/// Words of the error about a format of rustdoc that `.ci/api` does not read.
const OTHER_FORMAT: &str = "rustdoc wrote format";

/// Writes rustdoc's description of a crate as a list of its public items; `None` if rustdoc's format is not the
/// expected one.
fn interface(folder: &Path, name: &str, code: &str) -> Option<PathBuf> {
    let source = folder.join("small.rs");
    std::fs::write(&source, code).expect("written");
    let rustdoc = std::env::var_os("RUSTDOC").unwrap_or_else(|| "rustdoc".into());
    let output = Command::new(rustdoc)
        .args(["--edition", "2024", "--crate-type", "lib", "-Z", "unstable-options", "--output-format", "json", "-o"])
        .args([folder, &source])
        .env("RUSTC_BOOTSTRAP", "1")
        .output()
        .expect("rustdoc starts");
    assert!(output.status.success(), "{}", text_of(&output));
    let listed = api(&[Path::new("--of"), &folder.join("small.json")])?;
    if text(&listed.stderr).contains(OTHER_FORMAT) {
        println!("skipped: {}", text(&listed.stderr));
        return None;
    }
    assert!(listed.status.success(), "{}", text_of(&listed));
    let list = text(&listed.stdout);
    let path = folder.join(name);
    std::fs::write(&path, list).expect("written");
    Some(path)
}

fn text_of(output: &Output) -> String {
    text(&output.stdout) + &text(&output.stderr)
}

#[test]
fn a_change_of_the_public_interface_is_noticed() {
    const BEFORE: &str = "
        pub mod shapes {
            /// Grows.
            #[derive(Clone)]
            #[non_exhaustive]
            pub enum Kind { Round, Flat { sides: u32 } }
            pub enum Axis { X, Y }
            pub struct Ball<'a> { pub radius: f32, pub name: &'a str }
            pub struct Handle(u32);
            impl Handle { pub const NONE: u32 = 0; pub fn get(&self, at: [usize; 2]) -> Option<&u32> { Some(&self.0).filter(|_| at[0] > 0) } }
            pub trait Shape { fn area(&self) -> f64; fn name(&self) -> String { String::new() } }
            impl Shape for Handle { fn area(&self) -> f64 { 1.0 } }
            fn private() {}
        }
        pub use shapes::Handle;
        pub fn sum(values: impl IntoIterator<Item = f64>) -> f64 { values.into_iter().sum() }";
    let folder = tempfile::tempdir().expect("a folder");
    let Some(before) = interface(folder.path(), "before.txt", BEFORE) else { return };
    let kept = std::fs::read_to_string(&before).expect("a list");
    for line in
        ["small::shapes::Axis: enum { X, Y }", "small::Handle::get: fn(self: &Self, [usize; 2]) -> Option<&u32>"]
    {
        assert!(kept.lines().any(|found| found == line), "{line}: {kept}");
    }
    // Text to replace, its replacement, and whether the change breaks programs.
    for (old, new, breaks) in [
        ("fn private() {}", "pub fn public() {}", false),
        ("Kind { Round,", "Kind { Round, Square,", false),
        (
            "fn name(&self) -> String { String::new() }",
            "fn name(&self) -> String { String::new() } fn more(&self) {}",
            false,
        ),
        ("Axis { X, Y }", "Axis { X, Y, Z }", true),
        ("pub name: &'a str", "pub name: &'a str, pub color: u8", true),
        ("fn area(&self) -> f64; ", "fn area(&self) -> f64; fn rim(&self) -> f64; ", true),
        ("at: [usize; 2]", "at: [usize; 2], _by: u8", true),
        ("-> Option<&u32>", "-> Option<&'_ u32>", false),
        ("#[derive(Clone)]", "", true),
        ("Handle(u32)", "Handle(u32, std::marker::PhantomData<*const u8>)", true),
        ("pub use shapes::Handle;", "", true),
    ] {
        let mut changed = BEFORE.replace(old, new);
        assert_ne!(changed, BEFORE, "{old} is not there");
        if new.contains("fn rim") {
            changed = changed.replace("for Handle {", "for Handle { fn rim(&self) -> f64 { 0.0 }");
        }
        let after = interface(folder.path(), "after.txt", &changed).expect("as before");
        let compared = api(&[Path::new("--compare"), &before, &after]).expect("as before");
        assert_eq!(compared.status.success(), !breaks, "{old} became {new}:\n{}", text_of(&compared));
    }
}

#[test]
fn another_format_of_rustdoc_is_an_error_with_advice() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("small.json");
    std::fs::write(&file, r#"{"format_version": 1}"#).expect("written");
    let Some(listed) = api(&[Path::new("--of"), &file]) else { return };
    let error = text(&listed.stderr);
    assert_eq!((listed.status.code(), text(&listed.stdout)), (Some(1), String::new()), "{error}");
    for words in ["small.json", OTHER_FORMAT, "format 1,", "RUSTUP_TOOLCHAIN="] {
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn the_versions_of_two_released_lists_are_no_items() {
    let folder = tempfile::tempdir().expect("a folder");
    let [old, new, without] =
        [("old", "0.1.0\nsmall::sum: fn()\n"), ("new", "0.2.0\nsmall::sum: fn()\n"), ("without", "small::sum: fn()\n")]
            .map(|(name, list)| {
                let path = folder.path().join(name);
                std::fs::write(&path, list).expect("written");
                path
            });
    for (old, new) in [(&old, &new), (&old, &without), (&without, &new)] {
        let Some(compared) = api(&[Path::new("--compare"), old, new]) else { return };
        assert!(compared.status.success(), "{}", text_of(&compared));
        assert_eq!(text(&compared.stdout), "crate: 0 lines are gone, 0 are new\n");
    }
}

/// The Rust files in a folder and in the folders below it.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("readable").path());
    let files = |path: PathBuf| if path.is_dir() { rust_files(&path) } else { vec![path] };
    entries.flat_map(files).filter(|path| path.extension().is_some_and(|extension| extension == "rs")).collect()
}

/// The test programs that ask for an NVIDIA GPU. Where a program has other tests as well, checks that these have the word in their names by
/// which `cuda/conformance.sh` chooses them.
fn programs_with_nvidia_tests() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for folder in ["tests", "cuda/tests", "passes/tests", "pipeline/tests", "view/tests"].map(root) {
        for path in rust_files(&folder) {
            let text = std::fs::read_to_string(&path).expect("text");
            if !["nvidia::there", "var_os(\"CURITIBA_REQUIRE_CUDA_TESTS\")"].iter().any(|words| text.contains(words)) {
                continue;
            }
            let below = path.strip_prefix(&folder).expect("below it");
            let program = below.iter().next().and_then(|first| Path::new(first).file_stem()?.to_str()).expect("a name");
            let rule = match program {
                "frames" | "shaders" => Some(("nvidia::there", "nvidia_gpus")),
                "faults" => Some(("there(", "goes_on_with_the_cpu")),
                _ => None,
            };
            if let Some((asks, word)) = rule {
                for test in text.split("#[test]\nfn ").skip(1).filter(|test| test.contains(asks)) {
                    let name = test.split('(').next().unwrap_or_default();
                    assert!(name.contains(word), "{}: rename `{name}`: …_{word}_…", path.display());
                }
            }
            found.insert(program.to_owned());
        }
    }
    // What the tests share, and this file.
    found.remove("nvidia");
    found.remove("checkout");
    found
}

#[test]
fn every_test_that_needs_an_nvidia_gpu_is_run_by_the_script_for_them() {
    let folder = tempfile::tempdir().expect("a folder");
    // A stand-in for a program: prints its name and arguments, or lists its tests.
    let write = |name: &str, tests: &str| {
        let path = folder.path().join(name);
        let listed = format!("if [ \"$1\" = --list ]; then echo \"{tests}\"; exit; fi\n");
        std::fs::write(&path, format!("#!/bin/sh\n{listed}echo \"$(basename \"$0\") $*\"\n")).expect("written");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("made executable");
    };
    let run = || {
        let binaries = folder.path().to_str().expect("a path in UTF-8");
        bash(&root("cuda/conformance.sh"), &[binaries, "unwritten.json"])
    };
    let programs = programs_with_nvidia_tests();
    assert!(programs.len() >= 5, "{programs:?}");
    for name in ["curitiba", "conformance"] {
        write(name, "");
    }
    for name in &programs {
        write(&format!("{name}-0a1b"), "some: test");
    }
    let all = run();
    assert!(all.status.success(), "{}", text_of(&all));
    let ran = text(&all.stdout);
    let ran: BTreeSet<&str> = ran.lines().filter_map(|line| Some(line.split_once("-0a1b")?.0)).collect();
    assert_eq!(ran, programs.iter().map(String::as_str).collect::<BTreeSet<_>>());
    // A program without such tests, and one that is missing.
    write("frames-0a1b", "0 tests");
    std::fs::remove_file(folder.path().join("segments-0a1b")).expect("removed");
    let some = run();
    let error = text(&some.stderr);
    assert_eq!(some.status.code(), Some(1), "{error}");
    for words in ["frames-… has tests named `…nvidia_gpus…`", "segments-… has tests:"] {
        assert!(error.contains(words), "{words}: {error}");
    }
}
