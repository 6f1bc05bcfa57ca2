//! The crates that the program is built from: their origin, their licences, the compiler that they need, and whether
//! `docs/dependencies.md` gives a reason for each. Known vulnerabilities are not checked here, because their list is on the
//! network.

use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;
use std::process::Command;

/// Licences that require only a notice; the fonts of the window have font licences.
const ALLOWED: [&str; 12] = [
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "MIT",
    "OFL-1.1",
    "Ubuntu-font-1.0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// Cargo's metadata of every crate in a build for this system with all features, including tests and benches. Crates
/// for other systems may be missing.
fn packages() -> Vec<Value> {
    let version = Command::new(env!("CARGO")).arg("-vV").output().expect("cargo starts");
    let version = String::from_utf8(version.stdout).expect("text");
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).expect("cargo tells its host");
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version",
            "1",
            "--locked",
            "--offline",
            "--all-features",
            "--filter-platform",
            host,
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let packages = metadata["packages"].as_array().expect("a list of packages").clone();
    assert!(packages.len() > 100, "cargo lists {} packages", packages.len());
    packages
}

/// Whether a licence expression (SPDX, or the older `A/B` for a choice) can be satisfied by [`ALLOWED`] licences.
fn allowed(expression: &str) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut rest = words.as_slice();
    either(&mut rest) == Some(true) && rest.is_empty()
}

/// Parses `A OR B`; `None` for a malformed expression.
fn either(words: &mut &[&str]) -> Option<bool> {
    let mut any = both(words)?;
    while let ["OR", rest @ ..] = *words {
        *words = rest;
        any |= both(words)?;
    }
    Some(any)
}

/// Parses `A AND B`, which binds more tightly.
fn both(words: &mut &[&str]) -> Option<bool> {
    let mut all = single(words)?;
    while let ["AND", rest @ ..] = *words {
        *words = rest;
        all &= single(words)?;
    }
    Some(all)
}

/// Parses a licence with its exception, or an expression in brackets.
fn single(words: &mut &[&str]) -> Option<bool> {
    let (name, rest) = match *words {
        ["(", rest @ ..] => {
            *words = rest;
            let inner = either(words)?;
            let [")", rest @ ..] = *words else { return None };
            *words = rest;
            return Some(inner);
        }
        [license, "WITH", exception, rest @ ..] => (format!("{license} WITH {exception}"), rest),
        [license, rest @ ..] => ((*license).to_owned(), rest),
        [] => return None,
    };
    *words = rest;
    Some(ALLOWED.contains(&name.as_str()))
}

/// The numbers of a version such as `1.95` or `1.95.0`.
fn version(text: &str) -> Vec<u32> {
    let mut parts: Vec<u32> = text.split('.').map(|part| part.parse().expect("a number")).collect();
    parts.resize(3, 0);
    parts
}

#[test]
fn every_crate_is_of_the_registry_under_a_permissive_licence_and_for_the_declared_compiler() {
    let packages = packages();
    let declared = packages.iter().find(|package| package["name"] == "curitiba").expect("this package");
    let declared = version(declared["rust_version"].as_str().expect("the manifest declares a minimum"));
    for package in &packages {
        let (name, license) = (&package["name"], package["license"].as_str().unwrap_or_default());
        assert!(allowed(license), "{name} is under `{license}`; valid: {}", ALLOWED.join(", "));
        if let Some(needed) = package["rust_version"].as_str() {
            assert!(version(needed) <= declared, "{name} needs Rust {needed}, and this package declares {declared:?}");
        }
        let source = package["source"].as_str();
        let ours = package["name"].as_str().is_some_and(|name| name.split('-').next() == Some("curitiba"));
        assert!(
            if ours {
                source.is_none()
            } else {
                source == Some("registry+https://github.com/rust-lang/crates.io-index")
            },
            "{name} comes from {source:?}"
        );
    }
}

#[test]
fn the_documentation_names_every_direct_dependency_and_no_other() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/dependencies.md");
    let page = std::fs::read_to_string(page).expect("the page is there");
    // The first column of the table has the crates' names in backticks.
    let rows = page.lines().filter(|line| line.starts_with("| `")).filter_map(|line| line.split('|').nth(1));
    let named: Vec<&str> = rows.flat_map(|column| column.split('`').skip(1).step_by(2)).collect();
    let mut direct: HashMap<String, &str> = HashMap::new();
    let packages = packages();
    for package in packages.iter().filter(|package| package["source"].is_null()) {
        for dependency in package["dependencies"].as_array().expect("a list") {
            let name = dependency["name"].as_str().expect("a name");
            if !name.starts_with("curitiba") {
                direct.insert(name.to_owned(), package["name"].as_str().expect("a name"));
            }
        }
    }
    for (name, by) in &direct {
        assert!(named.contains(&name.as_str()), "{by} depends on `{name}`, of which docs/dependencies.md has no row");
    }
    for name in &named {
        // Other names in backticks: features, folders, pages, and crates that only `fuzz/` and `python/` use.
        const OTHERS: [&str; 12] = [
            "cuda",
            "embree",
            "glsl",
            "fuzz/",
            "robustness.md",
            "libfuzzer-sys",
            "python/",
            "python.md",
            "pyo3",
            "numpy",
            "view/",
            "viewer.md",
        ];
        let known = direct.contains_key(*name) || OTHERS.contains(name);
        assert!(known, "docs/dependencies.md has a row for `{name}`, on which no crate depends");
    }
}

#[test]
fn licence_expressions_are_read_as_written() {
    for expression in [
        "MIT",
        "MIT/Apache-2.0",
        "MIT OR GPL-3.0-only",
        "(MIT OR GPL-3.0-only) AND Unicode-3.0",
        "GPL-2.0-only AND MIT OR Zlib",
        "Apache-2.0 WITH LLVM-exception OR GPL-2.0-only",
    ] {
        assert!(allowed(expression), "{expression}");
    }
    for expression in [
        "",
        "GPL-3.0-only",
        "MIT AND GPL-3.0-only",
        "MIT AND (GPL-3.0-only OR LGPL-2.1-only)",
        "GPL-2.0-only WITH Classpath-exception-2.0",
        "MIT OR",
        "(MIT",
        "MIT MIT",
    ] {
        assert!(!allowed(expression), "{expression}");
    }
}
