//! The crates as published: the metadata of a package, and whether it builds from its own files. See `docs/publishing.md`.

use flate2::{Compression, write::GzEncoder};
use serde_json::Value;
use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::{Component, Path, PathBuf};
use std::process::Command;

/// Greatest compressed size of a package that the registry accepts.
const MOST_BYTES: u64 = 10 << 20;

fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO")).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    let output = output.expect("cargo starts");
    assert!(output.status.success(), "cargo {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// The packages of this workspace that can be published.
fn published() -> Vec<Value> {
    let metadata = cargo(&["metadata", "--no-deps", "--format-version", "1", "--locked", "--offline"]);
    let metadata: Value = serde_json::from_str(&metadata).expect("JSON");
    // A package that must not be published has an empty list of registries.
    let packages =
        metadata["packages"].as_array().expect("a list").iter().filter(|package| package["publish"].is_null());
    packages.cloned().collect()
}

fn name(package: &Value) -> &str {
    package["name"].as_str().expect("a name")
}

/// The files of a package, relative to its folder.
fn files(package: &Value) -> BTreeSet<PathBuf> {
    let listed = cargo(&["package", "--list", "--allow-dirty", "--locked", "--offline", "-p", name(package)]);
    listed.lines().map(PathBuf::from).collect()
}

fn folder(package: &Value) -> PathBuf {
    Path::new(package["manifest_path"].as_str().expect("a path")).parent().expect("a folder").to_owned()
}

/// A path such as `a/b/../c` with `..` resolved; `None` if it leaves the root.
fn joined(folder: &Path, path: &str) -> Option<PathBuf> {
    let mut joined = PathBuf::new();
    for part in folder.join(path).components() {
        match part {
            Component::Normal(part) => joined.push(part),
            Component::ParentDir if joined.pop() => {}
            Component::CurDir => {}
            _ => return None,
        }
    }
    Some(joined)
}

/// Files that a source names to the compiler and that are missing from its package. If a macro composes the name
/// (`concat!("programs/", $stem)`), only the folder is checked.
fn outside(source: &Path, text: &str, files: &BTreeSet<PathBuf>) -> Vec<String> {
    let folder = source.parent().unwrap_or(Path::new(""));
    let mut found = Vec::new();
    for marker in ["include_str!(", "include_bytes!(", "include!(", "#[path ="] {
        for rest in text.split(marker).skip(1) {
            let Some(path) = rest.split('"').nth(1) else { continue };
            let is_part = rest.trim_start().starts_with("concat!");
            let is_there = joined(folder, path).is_some_and(|path| match is_part {
                true => files.iter().any(|file| file.starts_with(&path)),
                false => files.contains(&path),
            });
            if !is_there {
                found.push(format!("{}: {marker} \"{path}\"", source.display()));
            }
        }
    }
    found
}

#[test]
fn every_package_says_what_it_is() {
    let packages = published();
    let names: Vec<&str> = packages.iter().map(name).collect();
    assert_eq!(names, ["curitiba-pipeline", "curitiba-passes", "curitiba-cuda", "curitiba", "curitiba-view"]);
    for package in &packages {
        let name = name(package);
        for field in ["description", "license", "readme", "rust_version"] {
            assert!(package[field].as_str().is_some_and(|text| !text.is_empty()), "{name} has no {field}");
        }
        let words = |field: &str| -> Vec<&str> {
            package[field].as_array().expect("a list").iter().filter_map(Value::as_str).collect()
        };
        let keywords = words("keywords");
        // Limits of the registry.
        assert!(
            (1..=5).contains(&keywords.len()) && keywords.iter().all(|word| word.len() <= 20),
            "{name}: {keywords:?}"
        );
        let categories = words("categories");
        let known = ["rendering", "graphics", "command-line-utilities", "visualization"];
        assert!(!categories.is_empty() && categories.iter().all(|word| known.contains(word)), "{name}: {categories:?}");
        for dependency in package["dependencies"].as_array().expect("a list") {
            let of_ours = dependency["path"].is_string();
            let version = dependency["req"].as_str().unwrap_or_default();
            assert!(!of_ours || version != "*", "{name}: {} has no version", dependency["name"]);
        }
    }
}

/// Upper bound of a file's bytes in an archive: compressed alone, and as thoroughly as cargo compresses.
fn compressed(bytes: &[u8]) -> u64 {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).expect("it is in memory");
    encoder.finish().expect("it is in memory").len() as u64
}

#[test]
fn every_package_is_built_from_its_own_files() {
    for package in published() {
        let (name, folder, files) = (name(&package), folder(&package), files(&package));
        for needed in ["Cargo.toml", "README.md", "LICENSE-MIT", "LICENSE-APACHE", "src/lib.rs"] {
            assert!(files.contains(Path::new(needed)), "{name} lacks {needed}");
        }
        let mut bytes = 0;
        for file in &files {
            // Files that cargo generates do not exist in the folder.
            let Ok(held) = std::fs::read(folder.join(file)) else { continue };
            bytes += compressed(&held);
            if file.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(folder.join(file)).expect("UTF-8");
                let outside = outside(file, &text, &files);
                assert!(outside.is_empty(), "{name} is not whole: {outside:?}");
            }
        }
        assert!(bytes < MOST_BYTES, "{name}: {bytes} bytes");
        println!("{name}: {} files, {bytes} bytes compressed", files.len());
    }
}

#[test]
fn a_file_that_is_left_out_is_found() {
    let files: BTreeSet<PathBuf> = ["src/a.rs", "src/b/c.wgsl", "x.md"].map(PathBuf::from).into();
    let check = |text: &str| outside(Path::new("src/a.rs"), text, &files);
    let kept = r#"include_str!("b/c.wgsl") #[doc = include_str!("../x.md")] include_bytes!(concat!("b/", $stem))"#;
    assert!(check(kept).is_empty(), "{:?}", check(kept));
    for lost in [
        r#"include_str!("b/d.wgsl")"#,
        r#"include_str!("../../x.md")"#,
        r#"include_str!(concat!("d/", $stem))"#,
        r#"#[path = "../b.rs"] mod b;"#,
    ] {
        assert_eq!(check(lost).len(), 1, "{lost}");
    }
}
