//! Statistics of a scene's contents.

use super::Scene;
use glam::{DVec3, Vec3};
use serde::Serialize;
use std::path::PathBuf;

/// Contents of a scene. Triangles and vertices count once for each object that places them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistics {
    /// Statistics of each file.
    pub files: Vec<FileStatistics>,
    /// Number of stored meshes.
    pub meshes: u64,
    /// Number of objects, that is placed meshes.
    pub objects: u64,
    /// Number of placed vertices.
    pub vertices: u64,
    /// Number of placed triangles.
    pub triangles: u64,
    /// Lowest and highest corner of the bounding box of all placed, finite vertices; `None` if there are none.
    pub bounds: Option<[[f32; 3]; 2]>,
    /// Statistics of each material, in the scene's order.
    pub materials: Vec<MaterialStatistics>,
}

/// Contents of one file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FileStatistics {
    /// The file.
    pub path: PathBuf,
    /// Number of stored meshes.
    pub meshes: u64,
    /// Number of objects, that is placed meshes.
    pub objects: u64,
    /// Number of placed vertices.
    pub vertices: u64,
    /// Number of placed triangles.
    pub triangles: u64,
}

/// How a material is used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MaterialStatistics {
    /// Name of the material.
    pub name: String,
    /// Number of placed triangles with this material.
    pub triangles: u64,
    /// Path or name of the texture; `None` without one.
    pub texture: Option<String>,
}

/// Counts the contents of a scene as its files have them, including triangles that [`super::RenderScene::build`] leaves out.
#[must_use]
pub fn statistics(scene: &Scene) -> Statistics {
    let mut by_material = vec![0_u64; scene.materials.len()];
    let mut bounds: Option<(Vec3, Vec3)> = None;
    let mut by_object = Vec::with_capacity(scene.objects.len());
    for object in &scene.objects {
        let mesh = &scene.meshes[object.mesh as usize];
        let mut triangles = 0;
        for group in &mesh.groups {
            by_material[group.material as usize] += group.triangles.len() as u64;
            triangles += group.triangles.len() as u64;
        }
        by_object.push((mesh.positions.len() as u64, triangles));
        let place = |position: &Vec3| match scene.origin == DVec3::ZERO {
            true => object.transform.transform_point3(*position),
            false => scene.to_world(object).transform_point3(position.as_dvec3()).as_vec3(),
        };
        for position in mesh.positions.iter().map(place) {
            if position.is_finite() {
                let (low, high) = bounds.unwrap_or((position, position));
                bounds = Some((low.min(position), high.max(position)));
            }
        }
    }

    let mut objects = by_object.iter();
    let files = scene
        .files
        .iter()
        .map(|file| {
            let own = objects.by_ref().take(file.objects as usize);
            let (vertices, triangles) = own.fold((0, 0), |sum, object| (sum.0 + object.0, sum.1 + object.1));
            FileStatistics {
                path: file.path.clone(),
                meshes: u64::from(file.meshes),
                objects: u64::from(file.objects),
                vertices,
                triangles,
            }
        })
        .collect();
    let materials = scene
        .materials
        .iter()
        .zip(&by_material)
        .map(|(material, triangles)| MaterialStatistics {
            name: material.name.clone(),
            triangles: *triangles,
            texture: material.texture.map(|texture| scene.textures[texture as usize].name()),
        })
        .collect();
    Statistics {
        files,
        meshes: scene.meshes.len() as u64,
        objects: scene.objects.len() as u64,
        vertices: by_object.iter().map(|object| object.0).sum(),
        triangles: by_object.iter().map(|object| object.1).sum(),
        bounds: bounds.map(|(low, high)| [low.to_array(), high.to_array()]),
        materials,
    }
}
