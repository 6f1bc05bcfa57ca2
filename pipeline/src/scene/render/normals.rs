//! Vertex normals of a mesh: made unit length, and computed where they are missing or useless.

use super::super::Mesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Triangles whose contributions are computed at once, before they are added in order.
const BLOCK: usize = 1 << 16;

/// Gives the mesh one unit normal a vertex, in model space. Returns how many of those in the file had no direction
/// and were replaced by computed ones.
pub(super) fn ensure(mesh: &mut Mesh) -> u64 {
    if mesh.normals.len() != mesh.positions.len() {
        mesh.normals = smooth(mesh);
        return 0;
    }
    mesh.normals.par_iter_mut().for_each(|normal| *normal = unit(*normal));
    let replaced = mesh.normals.par_iter().filter(|normal| **normal == Vec3::ZERO).count();
    if replaced > 0 {
        let computed = smooth(mesh);
        for (normal, computed) in mesh.normals.iter_mut().zip(computed) {
            if *normal == Vec3::ZERO {
                *normal = computed;
            }
        }
    }
    replaced as u64
}

/// The unit vector of that direction; zero if it has none. Never overflows: the vector is scaled first.
pub(super) fn unit(vector: Vec3) -> Vec3 {
    let scaled = vector / vector.abs().max_element();
    if scaled.is_finite() { scaled.normalize_or_zero() } else { Vec3::ZERO }
}

/// Face normals averaged at each vertex with the corner's angle as weight. Where they cancel, the first face's normal;
/// where there is none, +z. The sum is formed in the order of the triangles, whatever the number of threads.
fn smooth(mesh: &Mesh) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    let mut weighted = Vec::new();
    for triangles in mesh.groups.iter().flat_map(|group| group.triangles.chunks(BLOCK)) {
        triangles.par_iter().map(|triangle| corner_normals(&mesh.positions, triangle)).collect_into_vec(&mut weighted);
        for (triangle, corners) in triangles.iter().zip(&weighted) {
            if let Some(corners) = corners {
                for (vertex, normal) in triangle.iter().zip(corners) {
                    sums[*vertex as usize] += *normal;
                }
            }
        }
    }
    sums.par_iter_mut().for_each(|sum| *sum = unit(*sum));
    if sums.par_iter().any(|normal| *normal == Vec3::ZERO) {
        for triangle in mesh.groups.iter().flat_map(|group| &group.triangles) {
            let Some(face) = face_normal(&mesh.positions, triangle) else { continue };
            for vertex in triangle {
                let normal = &mut sums[*vertex as usize];
                if *normal == Vec3::ZERO {
                    *normal = face;
                }
            }
        }
        sums.iter_mut().filter(|normal| **normal == Vec3::ZERO).for_each(|normal| *normal = Vec3::Z);
    }
    sums
}

fn corners(positions: &[Vec3], triangle: &[u32; 3]) -> Option<[DVec3; 3]> {
    let [a, b, c] = triangle.map(|vertex| positions.get(vertex as usize).map(|p| p.as_dvec3()));
    Some([a?, b?, c?])
}

fn face_normal(positions: &[Vec3], triangle: &[u32; 3]) -> Option<Vec3> {
    let [a, b, c] = corners(positions, triangle)?;
    (b - a).cross(c - a).try_normalize().map(DVec3::as_vec3)
}

/// The face normal times the angle at each corner; `None` for a face without area or with an index out of range.
fn corner_normals(positions: &[Vec3], triangle: &[u32; 3]) -> Option<[Vec3; 3]> {
    let [a, b, c] = corners(positions, triangle)?;
    let cross = (b - a).cross(c - a);
    let normal = cross.try_normalize()?;
    let twice_area = cross.length();
    // atan2 keeps its precision at angles near 0 and π, where acos loses it.
    let angle = |p: DVec3, q: DVec3, r: DVec3| twice_area.atan2((q - p).dot(r - p));
    Some([angle(a, b, c), angle(b, c, a), angle(c, a, b)].map(|angle| (normal * angle).as_vec3()))
}
