//! Vertex normals of a mesh: normalised, and computed if they are missing or have no direction.

use super::super::Mesh;
use super::super::parallel::concatenate;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Number of vertices that one task computes.
const BLOCK: usize = 1 << 14;
/// Least number of faces per task.
const GRAIN: usize = 1 << 12;

/// Cosine of the crease angle, 60 degrees: faces that meet at an edge with a larger angle between their normals are not smoothed
/// into each other. So boxes stay flat, whether or not their file shares the corners, and round shapes become smooth.
const CREASE_COSINE: f64 = 0.5;

/// Gives each vertex of the mesh a unit normal, in model space. If the mesh has no normals, computed ones split its vertices on creases.
/// Returns the number of normals of the file that had no direction and were replaced by computed ones.
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

/// The normalised vector; zero if it has no direction. The vector is scaled first, so it never overflows.
pub(super) fn unit(vector: Vec3) -> Vec3 {
    let scaled = vector / vector.abs().max_element();
    if scaled.is_finite() { scaled.normalize_or_zero() } else { Vec3::ZERO }
}

/// Normals computed from faces.
struct Smooth {
    /// The normal of each vertex; if the vertex is split, the normal of its first part.
    normals: Vec<Vec3>,
    /// The other parts of split vertices, sorted by vertex.
    splits: Vec<Split>,
}

/// Corners at a vertex that a crease separates from its first corners.
struct Split {
    vertex: u32,
    normal: Vec3,
    /// Corners as `3 * face + place in the face`; faces are counted through all groups.
    corners: Vec<u64>,
}

/// Averages face normals at each vertex, weighted by the corner's angle. Where the weighted normals cancel, the result is the first face's
/// normal; without faces, +z. With `creases`, only faces that are connected around the vertex by edges below the crease angle are averaged.
/// Sums are formed in the order of the triangles, whatever the number of threads.
fn smooth(mesh: &Mesh, creases: bool) -> Smooth {
    let lists: Vec<&[[u32; 3]]> = mesh.groups.iter().map(|group| &group.triangles[..]).collect();
    let copied;
    let faces: &[[u32; 3]] = match lists[..] {
        [only] => only,
        _ => {
            copied = concatenate(&lists);
            &copied
        }
    };
    let vertices = mesh.positions.len();
    let around = Around::new(faces, vertices);
    let mut normals = vec![Vec3::Z; vertices];
    let splits: Vec<Vec<Split>> = normals
        .par_chunks_mut(BLOCK)
        .enumerate()
        .map(|(block, normals)| {
            let (mut fan, mut splits, mut corners) = (Fan::default(), Vec::new(), Vec::new());
            for (offset, normal) in normals.iter_mut().enumerate() {
                let vertex = block * BLOCK + offset;
                around.corners(vertex, &mut corners);
                fan.gather(&mesh.positions, faces, &corners);
                if creases {
                    fan.unite_across_edges(faces);
                }
                fan.unite_parts();
                let [first, others @ ..] = &fan.parts[..] else { continue };
                *normal = first.normal;
                if others.is_empty() {
                    continue;
                }
                let begun = splits.len();
                let split = |part: &FanPart| Split { vertex: vertex as u32, normal: part.normal, corners: Vec::new() };
                splits.extend(others.iter().map(split));
                fan.deal(&mut splits[begun..]);
            }
            splits
        })
        .collect();
    Smooth { normals, splits: splits.into_iter().flatten().collect() }
}

/// The corners around each vertex.
struct Around {
    /// First index of each vertex's corners in the list; the last entry is the end.
    starts: Vec<u64>,
    corners: Vec<AtomicU64>,
}

impl Around {
    /// Lists the corners of all faces; indices beyond the vertices are skipped.
    fn new(faces: &[[u32; 3]], vertices: usize) -> Self {
        let mut left: Vec<AtomicU32> = Vec::new();
        left.par_extend((0..vertices).into_par_iter().map(|_| AtomicU32::new(0)));
        let slots = |triangle: &[u32; 3]| triangle.map(|vertex| left.get(vertex as usize));
        faces.par_iter().with_min_len(GRAIN).for_each(|triangle| {
            slots(triangle).into_iter().flatten().for_each(|slot| {
                slot.fetch_add(1, Ordering::Relaxed);
            });
        });
        let mut starts = Vec::with_capacity(vertices + 1);
        let mut end = 0;
        starts.push(end);
        starts.extend(left.iter().map(|count| {
            end += u64::from(count.load(Ordering::Relaxed));
            end
        }));
        let mut corners: Vec<AtomicU64> = Vec::new();
        corners.par_extend((0..end as usize).into_par_iter().map(|_| AtomicU64::new(0)));
        faces.par_iter().with_min_len(GRAIN).enumerate().for_each(|(face, triangle)| {
            for (place, vertex) in triangle.iter().enumerate() {
                let Some(left) = left.get(*vertex as usize) else { continue };
                let slot = starts[*vertex as usize] + u64::from(left.fetch_sub(1, Ordering::Relaxed) - 1);
                corners[slot as usize].store(3 * face as u64 + place as u64, Ordering::Relaxed);
            }
        });
        Self { starts, corners }
    }

    /// Fills `list` with the corners of a vertex in ascending order; threads stored them in any order.
    fn corners(&self, vertex: usize, list: &mut Vec<u64>) {
        let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        list.clear();
        list.extend(self.corners[range].iter().map(|corner| corner.load(Ordering::Relaxed)));
        list.sort_unstable();
    }
}

/// Gives each part beyond a crease a vertex of its own, as long as the number of vertices fits an index.
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
        if let Some(color) = mesh.colors.get(from).copied() {
            mesh.colors.push(color);
        }
        if let Some(tangent) = mesh.tangents.get(from).copied() {
            mesh.tangents.push(tangent);
        }
        moved.extend(split.corners.iter().map(|corner| (*corner, to)));
    }
    moved.par_sort_unstable();
    let mut first = 0;
    for group in &mut mesh.groups {
        let begun = first;
        first += group.triangles.len();
        group.triangles.par_chunks_mut(BLOCK).enumerate().for_each(|(block, triangles)| {
            let before = 3 * (begun + block * BLOCK) as u64;
            let end = before + 3 * triangles.len() as u64;
            let here = |place: u64| moved.partition_point(|(corner, _)| *corner < place);
            for (corner, to) in &moved[here(before)..here(end)] {
                let place = (corner - before) as usize;
                triangles[place / 3][place % 3] = *to;
            }
        });
    }
}

/// A corner of a face that has an area.
struct FanCorner {
    corner: u64,
    /// Unit normal of the face.
    normal: DVec3,
    /// Angle of the face here, radians.
    angle: f64,
    /// Parent in the union-find forest: an earlier corner of the same part, or itself.
    parent: usize,
}

/// Corners that edges below the crease angle connect.
struct FanPart {
    /// Its first corner.
    root: usize,
    normal: Vec3,
}

/// The faces around a vertex. It is reused for many vertices, to keep its lists allocated.
#[derive(Default)]
struct Fan {
    corners: Vec<FanCorner>,
    parts: Vec<FanPart>,
    /// Edges of the fan: the vertex at the other end, and a corner whose face has the edge.
    edges: Vec<(u32, usize)>,
}

impl Fan {
    /// Collects the corners, all in one part.
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

    /// Divides the corners into parts: faces connected by edges below the crease angle are in one.
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
                // The earliest corner is the root of its part.
                let (early, late) = (first.min(second), first.max(second));
                self.corners[late].parent = early;
            }
        }
        // A parent precedes its children, so one pass leads every corner to its root.
        for index in 0..self.corners.len() {
            self.corners[index].parent = self.corners[self.corners[index].parent].parent;
        }
    }

    /// Sums the weighted normals of each part, in the order of the parts' first corners.
    fn unite_parts(&mut self) {
        self.parts.clear();
        for corner in &self.corners {
            let weighted = (corner.normal * corner.angle).as_vec3();
            match self.parts.binary_search_by_key(&corner.parent, |part| part.root) {
                Ok(part) => self.parts[part].normal += weighted,
                // Roots precede their other corners, hence appear in ascending order.
                Err(end) => self.parts.insert(end, FanPart { root: corner.parent, normal: weighted }),
            }
        }
        for part in &mut self.parts {
            let normal = unit(part.normal);
            part.normal = if normal == Vec3::ZERO { self.corners[part.root].normal.as_vec3() } else { normal };
        }
    }

    /// Gives the corners of all parts but the first to their splits, which are in the order of the parts.
    fn deal(&self, splits: &mut [Split]) {
        for corner in &self.corners {
            let part = self.parts.binary_search_by_key(&corner.parent, |part| part.root).unwrap_or(0);
            if let Some(split) = part.checked_sub(1).and_then(|part| splits.get_mut(part)) {
                split.corners.push(corner.corner);
            }
        }
    }
}

/// The root of a corner in the union-find forest.
fn root(corners: &mut [FanCorner], mut index: usize) -> usize {
    while corners[index].parent != index {
        // Path halving keeps large fans fast.
        corners[index].parent = corners[corners[index].parent].parent;
        index = corners[index].parent;
    }
    index
}

fn corners_of(positions: &[Vec3], triangle: [u32; 3]) -> Option<[DVec3; 3]> {
    let [a, b, c] = triangle.map(|vertex| positions.get(vertex as usize).map(|p| p.as_dvec3()));
    Some([a?, b?, c?])
}
