//! The ray backends of NVIDIA GPUs against the processor's, and several GPUs against one.
//!
//! Without a GPU, these tests print `skipped: why` and pass; with `CURITIBA_REQUIRE_CUDA_TESTS=1` they fail instead.
//! The binary runs on any machine: where the source folder is missing, it looks for the projects in the current folder.

mod accumulate;
mod adaptive;
mod caustics;
mod conformance;
#[path = "../lamps/mod.rs"]
mod lamps;
#[path = "../nvidia/mod.rs"]
mod nvidia;
mod scenes;
mod several;
mod spheres;
mod ways;

use curitiba::pipeline::project::Project;
use nvidia::there;
use std::path::{Path, PathBuf};

/// The six projects with a ray pass.
const PROJECTS: [&str; 6] = ["SceneDummy", "SceneShadows", "SceneReflect", "SceneRefract", "SceneSSAO", "SceneFinal"];

fn project(name: &str) -> PathBuf {
    file(&format!("xml_projects/{name}.xml"))
}

fn loaded(name: &str) -> Project {
    curitiba::pipeline::project::load(&project(name)).expect("the project loads")
}

/// A file of the source folder.
fn file(path: &str) -> PathBuf {
    let built = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = if built.is_dir() { built } else { Path::new(".") };
    root.join(path)
}
