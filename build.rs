//! Tells the program what it was built from: the commit and the compiler's flags. The crate `curitiba-passes` tells how far it is optimised.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo:rustc-env=CURITIBA_COMMIT={}", commit().unwrap_or_else(|| "unknown".to_owned()));
    println!("cargo:rustc-env=CURITIBA_FLAGS={}", flags());
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=CARGO_ENCODED_RUSTFLAGS");
}

/// The commit, marked where tracked files differ from it; `None` without git or outside a repository of our own.
fn commit() -> Option<String> {
    // A package unpacked inside somebody else's repository is not of its commit.
    if !Path::new(".git").exists() {
        println!("cargo:rerun-if-changed=Cargo.toml");
        return None;
    }
    let hash = git(&["rev-parse", "--short", "HEAD"])?;
    // These change with commits and branches; the sources, because they decide whether the tree is that of the commit.
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name])
            && Path::new(&path).exists()
        {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    for path in ["Cargo.lock", "src", "pipeline/src", "passes/src"] {
        println!("cargo:rerun-if-changed={path}");
    }
    let changed = git(&["status", "--porcelain", "--untracked-files=no"])?;
    Some(if changed.is_empty() { hash } else { format!("{hash}-dirty") })
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn flags() -> String {
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    let flags = variable("CARGO_ENCODED_RUSTFLAGS").replace('\u{1f}', " ");
    let flags = if flags.is_empty() { "none".to_owned() } else { flags };
    let features = variable("CARGO_CFG_TARGET_FEATURE");
    format!("rustflags {flags}, target features {features}")
}
