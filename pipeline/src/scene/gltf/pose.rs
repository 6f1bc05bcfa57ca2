//! Meshes in the default pose of a file: first morph targets with their default weights (glTF 2.0, section 3.7.2.2), then skins
//! with the transforms of their joints (section 3.7.3).
//!
//! Matrices and sums use `f64`: a joint's world transform and its inverse bind matrix may be large and nearly cancel.

use super::super::Mesh;
use super::super::context::Context;
use super::super::error::SceneError;
use super::vectors::Vectors;
use crate::diagnostic::Warnings;
use ::gltf::json::{
    self, Index,
    accessor::Accessor,
    mesh::{Primitive, Semantic},
    validation::Checked,
};
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4, Vec3};
use rayon::prelude::*;

/// What deforms a mesh in addition to its node's transform: a skin and morph targets.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub(super) struct Pose {
    /// Index of the skin.
    pub(super) skin: Option<usize>,
    /// Bits of the morph targets' weights; empty if all weights are 0.
    weights: Vec<u32>,
}

impl Pose {
    /// The pose of a node's mesh, with the weights of the node, or else those of the mesh.
    pub(super) fn of(node: &json::Node, mesh: &json::Mesh) -> Self {
        let weights = node.weights.as_ref().or(mesh.weights.as_ref()).map_or(&[][..], Vec::as_slice);
        let moved = weights.iter().any(|weight| *weight != 0.0);
        let weights = if moved { weights.iter().map(|weight| weight.to_bits()).collect() } else { Vec::new() };
        Self { skin: node.skin.map(|skin| skin.value()), weights }
    }

    /// Adds the displacements of a primitive's morph targets whose weights are not 0.
    pub(super) fn morph(
        &self,
        mesh: &mut Mesh,
        primitive: &Primitive,
        vectors: &Vectors<'_>,
        context: &mut Context<'_>,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        let targets = primitive.targets.as_deref().unwrap_or_default();
        if self.weights.is_empty() || targets.is_empty() {
            return Ok(());
        }
        if targets.len() != self.weights.len() {
            let what = "primitives with another number of morph targets than weights";
            warnings.add(context.file, what, "targets without a weight are not drawn", || {
                format!("`{}` has {} and {}", mesh.name, targets.len(), self.weights.len())
            });
        }
        let vertices = mesh.positions.len();
        context.take("the morphed vertices", 3 * vertices, size_of::<DVec3>())?;
        let [positions, normals] =
            [&mesh.positions, &mesh.normals].map(|list| list.iter().map(|vector| vector.as_dvec3()).collect());
        let tangents = mesh.tangents.iter().map(|tangent| tangent.truncate().as_dvec3()).collect();
        let mut sums: [Vec<DVec3>; 3] = [positions, normals, tangents];
        for (number, (target, weight)) in targets.iter().zip(&self.weights).enumerate() {
            let weight = f64::from(f32::from_bits(*weight));
            if weight == 0.0 {
                continue;
            }
            for (sum, accessor) in sums.iter_mut().zip([target.positions, target.normals, target.tangents]) {
                // Normals and tangents that are missing in the file, or not needed, have no displacements.
                let Some(accessor) = accessor.filter(|_| !sum.is_empty()) else { continue };
                let displacements = vectors.data.vectors::<3>(accessor, context)?;
                if displacements.len() != vertices {
                    let what = format!(
                        "morph target {number} of `{}` has {} displacements for {vertices} positions",
                        mesh.name,
                        displacements.len()
                    );
                    return Err(SceneError::file(context.file, what));
                }
                let add = |(sum, displacement): (&mut DVec3, &[f32; 3])| {
                    *sum += weight * Vec3::from(*displacement).as_dvec3();
                };
                sum.par_iter_mut().zip(&displacements).for_each(add);
                context.budget.give_back((vertices * size_of::<[f32; 3]>()) as u64);
            }
        }
        let [positions, normals, tangents] = sums;
        mesh.positions = positions.into_iter().map(|position| position.as_vec3()).collect();
        mesh.normals = normals.into_iter().map(|normal| normal.as_vec3()).collect();
        for (tangent, moved) in mesh.tangents.iter_mut().zip(tangents) {
            *tangent = moved.as_vec3().extend(tangent.w);
        }
        context.budget.give_back((3 * vertices * size_of::<DVec3>()) as u64);
        Ok(())
    }
}

/// The joint matrices of an asset's skins.
#[derive(Debug, Default)]
pub(super) struct Skins {
    /// World transform of each node; `None` for a node that is its own ancestor. Empty until the first call of [`Self::meet`].
    globals: Vec<Option<DMat4>>,
    /// By skin and joint: the matrix from the stored mesh to the world. Empty until [`Self::meet`] is called for the skin.
    joints: Vec<Vec<DMat4>>,
}

impl Skins {
    /// Computes the matrices of a skin, unless that was done before.
    pub(super) fn meet(
        &mut self,
        skin: usize,
        vectors: &Vectors<'_>,
        context: &mut Context<'_>,
    ) -> Result<(), SceneError> {
        let root = vectors.data.root;
        let file = context.file;
        let fail = |what: String| SceneError::file(file, format!("skin {skin} {what}"));
        let written = root.skins.get(skin).ok_or_else(|| fail("does not exist".to_owned()))?;
        if self.joints.get(skin).is_some_and(|joints| !joints.is_empty()) {
            return Ok(());
        }
        if written.joints.is_empty() {
            return Err(fail("has no joint".to_owned()));
        }
        if self.globals.is_empty() {
            context.take("the transforms of nodes", root.nodes.len(), size_of::<Option<DMat4>>())?;
            self.globals = globals(root);
            self.joints.resize_with(root.skins.len(), Vec::new);
        }
        let inverse = match written.inverse_bind_matrices {
            Some(accessor) => vectors.data.vectors::<16>(accessor, context)?,
            None => Vec::new(),
        };
        if written.inverse_bind_matrices.is_some() && inverse.len() < written.joints.len() {
            let (joints, matrices) = (written.joints.len(), inverse.len());
            return Err(fail(format!("has {joints} joints and {matrices} inverse bind matrices")));
        }
        context.take("the joints of a skin", written.joints.len(), size_of::<DMat4>())?;
        let mut joints = Vec::with_capacity(written.joints.len());
        for (number, joint) in written.joints.iter().enumerate() {
            let global = self
                .globals
                .get(joint.value())
                .ok_or_else(|| fail(format!("has node {} as a joint, which does not exist", joint.value())))?;
            let global = global.ok_or_else(|| {
                fail(format!("has node {} as a joint, which is its own ancestor", joint.value()))
                    .help("valid: nodes form trees")
            })?;
            let inverse =
                inverse.get(number).map_or(DMat4::IDENTITY, |inverse| DMat4::from_cols_array(&inverse.map(f64::from)));
            joints.push(global * inverse);
        }
        self.joints[skin] = joints;
        Ok(())
    }

    /// Moves a primitive's vertices into world space by a skin that was [met](Self::meet). Returns `false` if the primitive names
    /// no joints.
    pub(super) fn apply(
        &self,
        skin: usize,
        mesh: &mut Mesh,
        primitive: &Primitive,
        vectors: &Vectors<'_>,
        context: &mut Context<'_>,
        warnings: &mut Warnings,
    ) -> Result<bool, SceneError> {
        let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let file = context.file;
        let vertices = mesh.positions.len();
        let mut sets = Vec::new();
        for set in 0.. {
            let (joints, weights) = (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set)));
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            let mut read = |accessor: Index<Accessor>, semantic: String| {
                let values = vectors.read::<4>(accessor, &semantic, context)?;
                if values.len() == vertices {
                    return Ok(values);
                }
                let what = format!("`{}` has {vertices} positions but {} of {semantic}", mesh.name, values.len());
                Err(SceneError::file(file, what))
            };
            sets.push((read(joints, format!("JOINTS_{set}"))?, read(weights, format!("WEIGHTS_{set}"))?));
        }
        if sets.is_empty() {
            let what = "primitives without joints in skinned meshes";
            warnings.add(file, what, "placed by their node", || format!("`{}`", mesh.name));
            return Ok(false);
        }
        let matrices = &self.joints[skin];
        let blend = |vertex: usize| blended(&sets, vertex, matrices);
        context.take("the matrices of vertices", vertices, size_of::<DMat4>() + 8)?;
        let blended: Vec<Result<(DMat4, bool), String>> = (0..vertices).into_par_iter().map(blend).collect();
        let unmoved = blended.iter().filter(|blend| matches!(blend, Ok((_, true)))).count();
        if unmoved > 0 {
            let what = "meshes with vertices whose weights are all 0";
            warnings.add(file, what, "they follow their first joint", || format!("{unmoved} in `{}`", mesh.name));
        }
        let mut mirrored = vec![false; vertices];
        for (vertex, blend) in blended.into_iter().enumerate() {
            let (matrix, _) =
                blend.map_err(|what| SceneError::file(file, format!("`{}`, vertex {vertex}: {what}", mesh.name)))?;
            let linear = DMat3::from_mat4(matrix);
            mirrored[vertex] = linear.determinant() < 0.0;
            mesh.positions[vertex] = matrix.transform_point3(mesh.positions[vertex].as_dvec3()).as_vec3();
            if let Some(normal) = mesh.normals.get_mut(vertex) {
                *normal = turned(&linear, normal.as_dvec3()).as_vec3();
            }
            if let Some(tangent) = mesh.tangents.get_mut(vertex) {
                let moved = scaled(linear * tangent.truncate().as_dvec3()).as_vec3();
                *tangent = moved.extend(if mirrored[vertex] { -tangent.w } else { tangent.w });
            }
        }
        if mirrored.contains(&true) {
            let is_mirrored = |vertex: u32| mirrored.get(vertex as usize) == Some(&true);
            for triangle in mesh.groups.iter_mut().flat_map(|group| &mut group.triangles) {
                if is_mirrored(triangle[0]) {
                    triangle.swap(1, 2);
                }
            }
        }
        context.budget.give_back((vertices * (size_of::<DMat4>() + 8)) as u64);
        Ok(true)
    }
}

/// Joints and weights of all vertices, four of each a vertex.
type Set = (Vec<[f32; 4]>, Vec<[f32; 4]>);

/// The weighted mean of a vertex's joint matrices, and whether all weights are 0; the matrix is then that of the first joint. The mean is
/// divided by the sum of the weights, since files round them.
fn blended(sets: &[Set], vertex: usize, matrices: &[DMat4]) -> Result<(DMat4, bool), String> {
    let (mut sum, mut total) = (DMat4::ZERO, 0.0);
    let mut first = None;
    for (joints, weights) in sets {
        for (joint, weight) in joints[vertex].into_iter().zip(weights[vertex]) {
            if !(weight >= 0.0 && weight.is_finite()) {
                return Err(format!("the weight {weight} is no number from 0 on"));
            }
            let matrix = matrices.get(joint as usize).filter(|_| joint >= 0.0 && joint.fract() == 0.0);
            let matrix = matrix.ok_or_else(|| {
                format!("joint {joint} is none of the skin's {}; valid: 0 to {}", matrices.len(), matrices.len() - 1)
            })?;
            first.get_or_insert(*matrix);
            total += f64::from(weight);
            sum += *matrix * f64::from(weight);
        }
    }
    if total > 0.0 { Ok((sum * total.recip(), false)) } else { Ok((first.unwrap_or(DMat4::IDENTITY), true)) }
}

/// Transforms a normal by the inverse transpose of a linear map, up to a positive factor.
fn turned(linear: &DMat3, normal: DVec3) -> DVec3 {
    let DMat3 { x_axis, y_axis, z_axis } = *linear;
    let cofactors = DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis));
    let turned = cofactors * normal;
    let unit = scaled(turned);
    if linear.determinant() < 0.0 { -unit } else { unit }
}

/// A vector scaled to a largest component of 1, since results of tiny or huge matrices overflow `f32`; 0 if it has no direction.
fn scaled(vector: DVec3) -> DVec3 {
    let unit = vector / vector.abs().max_element();
    if unit.is_finite() { unit } else { DVec3::ZERO }
}

/// The world transform of every node; `None` for nodes that are their own ancestors.
fn globals(root: &json::Root) -> Vec<Option<DMat4>> {
    let mut globals: Vec<Option<DMat4>> = vec![None; root.nodes.len()];
    let mut is_child = vec![false; root.nodes.len()];
    for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        if let Some(is_child) = is_child.get_mut(child.value()) {
            *is_child = true;
        }
    }
    let roots = (0..root.nodes.len()).filter(|node| !is_child[*node]);
    let mut stack: Vec<(usize, DMat4)> = roots.map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((index, parent)) = stack.pop() {
        let (Some(node), Some(global)) = (root.nodes.get(index), globals.get_mut(index)) else { continue };
        if global.is_none() {
            let own = parent * local(node);
            *global = Some(own);
            stack.extend(node.children.iter().flatten().map(|child| (child.value(), own)));
        }
    }
    globals
}

/// A node's local transform (glTF 2.0, section 3.5.3).
fn local(node: &json::Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let vector = |written: Option<[f32; 3]>, otherwise: DVec3| {
        written.map_or(otherwise, |written| Vec3::from(written).as_dvec3())
    };
    // Files round quaternions; one of length 0 means no rotation.
    let rotation = node.rotation.and_then(|rotation| DVec4::from(rotation.0.map(f64::from)).try_normalize());
    DMat4::from_scale_rotation_translation(
        vector(node.scale, DVec3::ONE),
        rotation.map_or(DQuat::IDENTITY, DQuat::from_vec4),
        vector(node.translation, DVec3::ZERO),
    )
}
