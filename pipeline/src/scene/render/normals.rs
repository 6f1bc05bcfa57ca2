//! Vertex normals of a mesh: made unit length, and computed where they are missing or useless.

use super::super::Mesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Vertices that one task computes.
const BLOCK: usize = 1 << 14;

/// Cosine of the crease angle, 60 degrees: faces that meet at an edge with a larger angle between their normals are not
/// smoothed into each other. Boxes stay flat so, whether or not their file shares the corners, and round things smooth.
const CREASE_COSINE: f64 = 0.5;

/// Gives the mesh one unit normal a vertex, in model space. Computed normals split the vertices on creases. Returns how many of those in the file had no direction
/// and were replaced by computed ones.
pub(super) fn ensure(mesh: &mut Mesh) -> u64 {
    if mesh.normals.len() != mesh.positions.len() {
        let Smooth { normals, splits } = smooth(mesh, true);
        mesh.normals = normals;
        split(mesh, &splits);
        return 0;
    }
    mesh.normals.par_iter_mut().for_each(|normal| *normal = unit(*normal));
    let replaced = mesh.normals.par_iter().filter(|normal| **normal == Vec3::ZERO).count();
    if replaced > 0 {
        let computed = smooth(mesh, false).normals;
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

/// Normals computed from faces.
struct Smooth {
    /// By vertex: the normal, or that of the first part where it is to be split.
    normals: Vec<Vec3>,
    /// The corners that become other vertices, by vertex.
    splits: Vec<Split>,
}

/// Corners of one vertex that lie beyond a crease from its first ones.
struct Split {
    vertex: u32,
    normal: Vec3,
    /// Face times 3 plus place in the face; faces are counted through all groups.
    corners: Vec<u64>,
}

/// Face normals averaged at each vertex with the corner's angle as weight. Where they cancel, the first face's normal;
/// where there is none, +z. With `creases`, only faces are averaged that are connected around the vertex by edges below
/// the crease angle. Each vertex's sum is formed in the order of the triangles, whatever the number of threads.
fn smooth(mesh: &Mesh, creases: bool) -> Smooth {
    let faces: Vec<[u32; 3]> = mesh.groups.iter().flat_map(|group| group.triangles.iter().copied()).collect();
    let vertices = mesh.positions.len();
    // The corners of each vertex, in order, as one list with the place where each vertex starts.
    let mut starts = vec![0_usize; vertices + 1];
    let valid = |vertex: &u32| (*vertex as usize) < vertices;
    for vertex in faces.iter().flatten().copied().filter(valid) {
        starts[vertex as usize + 1] += 1;
    }
    for vertex in 0..vertices {
        starts[vertex + 1] += starts[vertex];
    }
    let mut corners = vec![0_u64; starts[vertices]];
    let mut next = starts.clone();
    for (number, vertex) in faces.iter().flatten().enumerate().filter(|(_, vertex)| valid(vertex)) {
        corners[next[*vertex as usize]] = number as u64;
        next[*vertex as usize] += 1;
    }
    drop(next);

    let mut normals = vec![Vec3::Z; vertices];
    let splits: Vec<Vec<Split>> = normals
        .par_chunks_mut(BLOCK)
        .enumerate()
        .map(|(block, normals)| {
            let (mut fan, mut splits) = (Fan::default(), Vec::new());
            for (offset, normal) in normals.iter_mut().enumerate() {
                let vertex = block * BLOCK + offset;
                fan.gather(&mesh.positions, &faces, &corners[starts[vertex]..starts[vertex + 1]]);
                if creases {
                    fan.unite_across_edges(&faces);
                }
                let mut parts = fan.parts();
                if let Some((first, _)) = parts.next() {
                    *normal = first;
                }
                splits.extend(parts.map(|(normal, corners)| Split { vertex: vertex as u32, normal, corners }));
            }
            splits
        })
        .collect();
    Smooth { normals, splits: splits.into_iter().flatten().collect() }
}

/// Gives each part beyond a crease a vertex of its own, as long as vertices can be counted.
fn split(mesh: &mut Mesh, splits: &[Split]) {
    if splits.is_empty() || mesh.positions.len() + splits.len() >= u32::MAX as usize {
        return;
    }
    let mut moved = Vec::new();
    for split in splits {
        let (from, to) = (split.vertex as usize, mesh.positions.len() as u32);
        mesh.positions.push(mesh.positions[from]);
        mesh.normals.push(split.normal);
        if let Some(texcoord) = mesh.texcoords.get(from).copied() {
            mesh.texcoords.push(texcoord);
        }
        moved.extend(split.corners.iter().map(|corner| (*corner, to)));
    }
    moved.sort_unstable();
    let mut moved = moved.into_iter().peekable();
    let corners = mesh.groups.iter_mut().flat_map(|group| group.triangles.iter_mut().flatten());
    for (number, vertex) in corners.enumerate() {
        if let Some((_, to)) = moved.next_if(|(corner, _)| *corner == number as u64) {
            *vertex = to;
        }
    }
}

/// One corner of a face with an area.
struct FanCorner {
    corner: u64,
    /// Unit normal of the face.
    normal: DVec3,
    /// Angle of the face here, radians.
    angle: f64,
    /// An earlier corner (or itself) of the same part; a union-find forest.
    parent: usize,
}

/// The faces around a vertex.
#[derive(Default)]
struct Fan {
    corners: Vec<FanCorner>,
    /// The vertex at the edge's other end, and a corner whose face has the edge.
    edges: Vec<(u32, usize)>,
}

impl Fan {
    /// All in one part.
    fn gather(&mut self, positions: &[Vec3], faces: &[[u32; 3]], corners: &[u64]) {
        self.corners.clear();
        for corner in corners {
            let (face, place) = (faces[(corner / 3) as usize], (corner % 3) as usize);
            let turned = [face[place], face[(place + 1) % 3], face[(place + 2) % 3]];
            let Some([a, b, c]) = corners_of(positions, turned) else { continue };
            let cross = (b - a).cross(c - a);
            let Some(normal) = cross.try_normalize() else { continue };
            // atan2 keeps its precision at angles near 0 and π, where acos loses it.
            let angle = cross.length().atan2((b - a).dot(c - a));
            self.corners.push(FanCorner { corner: *corner, normal, angle, parent: 0 });
        }
    }

    /// One part for each set of faces that edges below the crease angle connect.
    fn unite_across_edges(&mut self, faces: &[[u32; 3]]) {
        self.edges.clear();
        for (index, corner) in self.corners.iter_mut().enumerate() {
            corner.parent = index;
            let (face, place) = (faces[(corner.corner / 3) as usize], (corner.corner % 3) as usize);
            self.edges.extend([1, 2].map(|step| (face[(place + step) % 3], index)));
        }
        self.edges.sort_unstable();
        for pair in self.edges.windows(2) {
            let [(end, first), (other_end, second)] = [pair[0], pair[1]];
            if end == other_end && self.corners[first].normal.dot(self.corners[second].normal) >= CREASE_COSINE {
                let (first, second) = (root(&mut self.corners, first), root(&mut self.corners, second));
                // The earliest corner stands for its part.
                let (early, late) = (first.min(second), first.max(second));
                self.corners[late].parent = early;
            }
        }
        // Parents come first, so that one pass leads every corner to its root.
        for index in 0..self.corners.len() {
            self.corners[index].parent = self.corners[self.corners[index].parent].parent;
        }
    }

    /// The normal and corners of each part, in the order of their first corners.
    fn parts(&self) -> impl Iterator<Item = (Vec3, Vec<u64>)> {
        let mut parts: Vec<(usize, Vec3, Vec<u64>)> = Vec::new();
        for corner in &self.corners {
            let weighted = (corner.normal * corner.angle).as_vec3();
            match parts.binary_search_by_key(&corner.parent, |(root, ..)| *root) {
                Ok(part) => {
                    parts[part].1 += weighted;
                    parts[part].2.push(corner.corner);
                }
                // Roots come before their corners, hence in ascending order.
                Err(end) => parts.insert(end, (corner.parent, weighted, vec![corner.corner])),
            }
        }
        parts.into_iter().map(|(root, sum, corners)| {
            let normal = unit(sum);
            let normal = if normal == Vec3::ZERO { self.corners[root].normal.as_vec3() } else { normal };
            (normal, corners)
        })
    }
}

/// The corner that stands for the part of another.
fn root(corners: &mut [FanCorner], mut index: usize) -> usize {
    while corners[index].parent != index {
        // Halving the path keeps large fans fast.
        corners[index].parent = corners[corners[index].parent].parent;
        index = corners[index].parent;
    }
    index
}

fn corners_of(positions: &[Vec3], triangle: [u32; 3]) -> Option<[DVec3; 3]> {
    let [a, b, c] = triangle.map(|vertex| positions.get(vertex as usize).map(|p| p.as_dvec3()));
    Some([a?, b?, c?])
}
