//! Visibility of many pairs of triangles: from a stream of pairs to a file, resumable after a kill.

mod engine;
mod format;
mod list;
mod stream;

pub use engine::segment_tracer;
pub use format::Format;
pub use list::ListedPairs;
pub use stream::{BLOCK, StreamError, Summary, Target, stream};

use pipeline::diagnostic::Warnings;
use pipeline::project::{PassKind, Project};
use pipeline::scene::{self, BuildOptions, LoadOptions, Material, Needs, RenderScene, Scene, SceneError};

use crate::pipeline;
use std::path::PathBuf;

/// The triangles of a scene, and its materials that are not opaque.
#[derive(Debug, Default)]
pub struct Loaded {
    /// Triangles and materials, without textures.
    pub scene: RenderScene,
    /// By material: whether its triangles never occlude.
    pub see_through: Vec<bool>,
    /// Warnings about contents left out while loading.
    pub warnings: Warnings,
}

/// Whether a material is not fully opaque: by transmission, by opacity, or by an alpha cutoff above 0.
#[must_use]
pub fn is_see_through(material: &Material) -> bool {
    let cut = material.alpha_cutoff.is_some_and(|cutoff| cutoff > 0.0);
    cut || material.transmission > 0.0 || material.diffuse.w < 1.0
}

/// Loads scene files that are merged into one scene.
///
/// # Errors
/// As [`scene::load`] and [`RenderScene::build`].
pub fn load_files(files: &[PathBuf], max_bytes: u64) -> Result<Loaded, SceneError> {
    load(
        &|options| scene::load(files, options, &|_| {}),
        BuildOptions { needs: NEEDS, max_bytes, ..BuildOptions::default() },
    )
}

/// Loads all scenes of a project, in order. Materials that a ray pass maps to glass count as not opaque too.
///
/// # Errors
/// As [`scene::load`] and [`RenderScene::build`].
pub fn load_project(project: &Project, max_bytes: u64) -> Result<Loaded, SceneError> {
    let mut all = Loaded::default();
    for declared in &project.scenes {
        let options = BuildOptions { needs: NEEDS, max_bytes, ..BuildOptions::default() };
        let part = load(&|load| declared.load(load, &|_| {}), declared.build_options(options))?;
        all.warnings.append(part.warnings);
        all.see_through.extend(part.see_through);
        all.scene.append(part.scene);
    }
    for pass in project.pipelines.iter().flat_map(|pipeline| &pipeline.passes) {
        let PassKind::Ray(ray) = &pass.kind else { continue };
        for (material, see_through) in all.scene.materials.iter().zip(&mut all.see_through) {
            *see_through |= ray.glass.iter().any(|pattern| pattern.matches(&material.name));
        }
    }
    Ok(all)
}

const NEEDS: Needs = Needs::NOTHING;

fn load(read: &dyn Fn(&LoadOptions) -> Result<Scene, SceneError>, options: BuildOptions) -> Result<Loaded, SceneError> {
    // Textures and vertex colours are requested because they determine which materials are cut out; textures are not decoded.
    let load =
        LoadOptions { needs: Needs { textures: true, colors: true, ..Needs::NOTHING }, max_bytes: options.max_bytes };
    let mut read = read(&load)?;
    let see_through = read.materials.iter().map(is_see_through).collect();
    let mut warnings = std::mem::take(&mut read.warnings);
    let (scene, more) = RenderScene::build(read, &options)?;
    warnings.append(more);
    Ok(Loaded { scene, see_through, warnings })
}
