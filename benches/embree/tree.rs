//! Embree's trees over a scene.

use crate::api::{Build, Embree, Scene};
use curitiba::pipeline::scene::Geometry;
use std::sync::Arc;

/// The arrays that Embree shares with us.
pub struct Input {
    positions: Vec<[f32; 4]>,
    triangles: [Vec<[u32; 3]>; 2],
    ids: [Vec<u32>; 2],
}

/// The triangles, separated into opaque and transparent ones.
pub fn input(geometry: &Geometry, transparent: &[bool]) -> Input {
    let mut triangles = [Vec::new(), Vec::new()];
    let mut ids = [Vec::new(), Vec::new()];
    for ((id, triangle), material) in (0_u32..).zip(&geometry.triangles).zip(geometry.materials()) {
        let group = usize::from(transparent.get(material as usize).copied().unwrap_or(false));
        triangles[group].push(*triangle);
        ids[group].push(id);
    }
    let positions = geometry.positions.iter().map(|p| [p.x, p.y, p.z, 0.0]).collect();
    Input { positions, triangles, ids }
}

/// Builds a tree.
///
/// # Errors
/// What Embree reports.
pub fn commit(embree: &Arc<Embree>, input: Input, build: Build) -> Result<Scene, String> {
    Scene::build(embree, input.positions, input.triangles, input.ids, build)
}
