//! Tangents of meshes with normal maps: those of the file, or else computed from positions, normals and texture coordinates by
//! MikkTSpace (Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008), the method that programs bake normal maps with.

use super::super::Mesh;
use super::normals::unit;
use crate::guard;
use bevy_mikktspace::{Geometry, TangentSpace};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;

/// Greatest number of triangle corners that may share position, normal and texture coordinates: the crate recurses around a vertex and compares
/// all its triangles with each other.
const MOST_CORNERS: u32 = 1024;

/// Upper bound of the memory per triangle while tangents are computed, in the crate and in [`Faces`], bytes.
pub(super) const BYTES_PER_TRIANGLE: u64 = 1024;

/// Number of vertices without a tangent, by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Bare {
    /// The file's tangent has no direction or is not finite.
    pub of_file: u64,
    /// More than [`MOST_CORNERS`] triangle corners share the vertex.
    pub crowded: u64,
}

/// Whether a mesh needs tangents: whether some of its triangles have a material that `mapped` marks (materials with a normal map, or all
/// materials if shaders read tangents).
pub(super) fn is_mapped(mesh: &Mesh, mapped: &[bool]) -> bool {
    mesh.groups.iter().any(|group| is_group_mapped(group.material, mapped) && !group.triangles.is_empty())
}

fn is_group_mapped(material: u32, mapped: &[bool]) -> bool {
    mapped.get(material as usize) == Some(&true)
}

/// Gives each vertex of the mesh a tangent: a unit vector and a sign of 1 or -1 as in [`Mesh::tangents`], or 0 where there is none.
/// The mesh must have unit normals and finite texture coordinates. Computed tangents split vertices where they differ, such as
/// along the seams of mirrored textures.
///
/// # Errors
/// If the crate fails.
pub(super) fn ensure(mesh: &mut Mesh, mapped: &[bool]) -> Result<Bare, String> {
    let vertices = mesh.positions.len();
    if mesh.tangents.len() == vertices {
        let of_file = mesh.tangents.par_iter_mut().map(|tangent| {
            let direction = unit(tangent.truncate());
            let usable = direction != Vec3::ZERO && !tangent.w.is_nan();
            *tangent = if usable { direction.extend(1f32.copysign(tangent.w)) } else { Vec4::ZERO };
            u64::from(!usable)
        });
        return Ok(Bare { of_file: of_file.sum(), crowded: 0 });
    }
    let mut faces = Faces { mesh, places: Vec::new(), tangents: Vec::new() };
    let crowded = faces.collect(mapped);
    if !faces.places.is_empty() {
        faces.tangents = vec![[Vec4::ZERO; 3]; faces.places.len()];
        match guard::call("bevy_mikktspace", || bevy_mikktspace::generate_tangents(&mut faces))? {
            Ok(()) => {}
            Err(error) => return Err(error.to_string()),
        }
    }
    let Faces { places, tangents, .. } = faces;
    split(mesh, &places, &tangents);
    Ok(Bare { of_file: 0, crowded })
}

/// The triangles of a mesh whose tangents are computed.
struct Faces<'a> {
    mesh: &'a Mesh,
    /// Each triangle as group and index within the group.
    places: Vec<(u32, u32)>,
    /// Computed tangents, by triangle and corner.
    tangents: Vec<[Vec4; 3]>,
}

impl Faces<'_> {
    /// Collects the triangles of mapped materials that have finite, distinct corners. Triangles at vertices with too many corners
    /// are left out; returns the number of such vertices.
    fn collect(&mut self, mapped: &[bool]) -> u64 {
        let mesh = self.mesh;
        for (number, group) in
            mesh.groups.iter().enumerate().filter(|(_, group)| is_group_mapped(group.material, mapped))
        {
            let whole = |triangle: &[u32; 3]| {
                let corners = triangle.map(|vertex| mesh.positions.get(vertex as usize).copied());
                matches!(corners, [Some(a), Some(b), Some(c)]
                    if a.is_finite() && b.is_finite() && c.is_finite() && a != b && b != c && c != a)
            };
            let triangles = group.triangles.iter().enumerate().filter(|(_, triangle)| whole(triangle));
            self.places.extend(triangles.map(|(triangle, _)| (number as u32, triangle as u32)));
        }
        let mut corners: HashMap<[u32; 8], u32> = HashMap::new();
        for place in &self.places {
            for vertex in triangle_at(mesh, *place) {
                *corners.entry(contents(mesh, vertex)).or_insert(0) += 1;
            }
        }
        let crowded = corners.values().filter(|count| **count > MOST_CORNERS).count();
        if crowded > 0 {
            let fits = |vertex: u32| corners.get(&contents(mesh, vertex)).is_some_and(|count| *count <= MOST_CORNERS);
            self.places.retain(|place| triangle_at(mesh, *place).into_iter().all(fits));
        }
        crowded as u64
    }

    fn vertex(&self, face: usize, corner: usize) -> usize {
        triangle_at(self.mesh, self.places[face])[corner] as usize
    }
}

fn triangle_at(mesh: &Mesh, (group, triangle): (u32, u32)) -> [u32; 3] {
    mesh.groups[group as usize].triangles[triangle as usize]
}

/// Position, normal and texture coordinates of a vertex as bits: vertices that agree in them are the same to MikkTSpace.
fn contents(mesh: &Mesh, vertex: u32) -> [u32; 8] {
    let vertex = vertex as usize;
    let ([x, y, z], [nx, ny, nz], [u, v]) =
        (mesh.positions[vertex].to_array(), mesh.normals[vertex].to_array(), mesh.texcoords[vertex].to_array());
    [x, y, z, nx, ny, nz, u, v].map(f32::to_bits)
}

impl Geometry for Faces<'_> {
    fn num_faces(&self) -> usize {
        self.places.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, vert)].to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, vert)].to_array()
    }

    /// Texture coordinates with v upwards, as everywhere here. The bitangent is then the direction in which v grows, to which green points.
    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.mesh.texcoords[self.vertex(face, vert)].to_array()
    }

    fn set_tangent(&mut self, tangent_space: Option<TangentSpace>, face: usize, vert: usize) {
        let tangent = tangent_space.map_or(Vec4::ZERO, |space| Vec4::from(space.tangent_encoded()));
        let has_direction = (tangent.truncate().length_squared() - 1.0).abs() < 1e-3;
        self.tangents[face][vert] = if has_direction { tangent } else { Vec4::ZERO };
    }
}

/// Gives each vertex the tangent of its first corner. Corners with another tangent get a vertex of their own, as long as the number
/// of vertices fits an index.
fn split(mesh: &mut Mesh, places: &[(u32, u32)], tangents: &[[Vec4; 3]]) {
    let first = mesh.positions.len();
    let mut known = vec![false; first];
    let mut others: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    mesh.tangents = vec![Vec4::ZERO; first];
    for (&(group, triangle), tangents) in places.iter().zip(tangents) {
        for (corner, tangent) in tangents.iter().enumerate() {
            let vertex = mesh.groups[group as usize].triangles[triangle as usize][corner];
            let index = vertex as usize;
            if !std::mem::replace(&mut known[index], true) {
                mesh.tangents[index] = *tangent;
            }
            if mesh.tangents[index] == *tangent || mesh.positions.len() >= u32::MAX as usize {
                continue;
            }
            let own = *others.entry((vertex, tangent.to_array().map(f32::to_bits))).or_insert_with(|| {
                copy_vertex(mesh, index);
                mesh.tangents.push(*tangent);
                mesh.positions.len() as u32 - 1
            });
            mesh.groups[group as usize].triangles[triangle as usize][corner] = own;
        }
    }
}

/// Appends a copy of a vertex, without its tangent.
fn copy_vertex(mesh: &mut Mesh, index: usize) {
    mesh.positions.push(mesh.positions[index]);
    mesh.normals.push(mesh.normals[index]);
    mesh.texcoords.push(mesh.texcoords[index]);
    if let Some(color) = mesh.colors.get(index).copied() {
        mesh.colors.push(color);
    }
}
