//! Transforms of nodes with all digits of the file. The crate `gltf` rounds numbers to `f32`.

use super::super::Scene;
use super::super::context::Context;
use super::super::error::SceneError;
use super::super::origin::move_near;
use super::rotation;
use ::gltf::json;
use glam::{DMat4, DQuat, DVec3, Vec3};

/// If all components of translations are below this in absolute value, the crate's `f32` numbers are used: their spacing is at most 1 /
/// 16384 there.
const LARGE: f32 = 1024.0;

/// The numbers of a node that the crate's `f32` would round too much.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default)]
struct Node {
    translation: Option<[f64; 3]>,
    matrix: Option<[f64; 16]>,
}

#[derive(Debug, Default, serde::Deserialize)]
#[serde(default)]
struct Nodes {
    nodes: Vec<Node>,
}

/// Transforms in `f64`.
pub(super) struct Places {
    /// By node of the asset; empty if no node has a large translation.
    nodes: Vec<Node>,
    /// Exact transform of each object of the scene.
    pub objects: Vec<DMat4>,
    /// Exact position of each camera of the scene.
    pub cameras: Vec<DVec3>,
    /// Exact position of each light of the scene.
    pub lights: Vec<DVec3>,
}

impl Places {
    /// Parses the nodes' numbers again, in `f64`, if a translation is large.
    ///
    /// # Errors
    /// If that takes more memory than is left.
    pub fn new(root: &json::Root, text: &[u8], context: &mut Context<'_>) -> Result<Self, SceneError> {
        let far = |numbers: &[f32]| numbers.iter().any(|number| number.abs() >= LARGE);
        let is_far = |node: &json::Node| {
            node.translation.is_some_and(|translation| far(&translation))
                || node.matrix.is_some_and(|matrix| far(&matrix[12..15]))
        };
        let mut nodes = Vec::new();
        if root.nodes.iter().any(is_far) {
            context.take("the nodes", root.nodes.len(), size_of::<Node>())?;
            nodes = serde_json::from_slice(text).map(|Nodes { nodes }| nodes).unwrap_or_default();
        }
        Ok(Self { nodes, objects: Vec::new(), cameras: Vec::new(), lights: Vec::new() })
    }

    /// The local transform of `node`, which has this index in the asset.
    pub fn local(&self, index: usize, node: &json::Node) -> DMat4 {
        let exact = self.nodes.get(index);
        if let Some(matrix) = exact.and_then(|exact| exact.matrix).or(node.matrix.map(|matrix| matrix.map(f64::from))) {
            return DMat4::from_cols_array(&matrix);
        }
        let rounded = || node.translation.map(|translation| translation.map(f64::from));
        let translation = exact.and_then(|exact| exact.translation).or_else(rounded).map_or(DVec3::ZERO, DVec3::from);
        let scale = node.scale.map_or(Vec3::ONE, Vec3::from).as_dvec3();
        let turn = DQuat::from_vec4(rotation(node).as_dquat().into());
        DMat4::from_scale_rotation_translation(scale, turn.normalize(), translation)
    }

    /// Moves the scene's origin near its contents, if they lie far from 0.
    pub fn move_origin(self, scene: &mut Scene) {
        let origin = move_near(scene, &self.objects);
        if origin == DVec3::ZERO {
            return;
        }
        for (camera, exact) in scene.cameras.iter_mut().zip(self.cameras) {
            camera.position = (exact - origin).as_vec3();
        }
        for (light, exact) in scene.lights.iter_mut().zip(self.lights) {
            light.position = light.position.map(|_| (exact - origin).as_vec3());
        }
    }
}
