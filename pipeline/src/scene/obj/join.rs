//! Joins runs into meshes: runs with the same object name and the same attributes become one mesh, and equal vertices of different
//! runs are shared.

use super::super::context::Context;
use super::super::error::SceneError;
use super::super::parallel::{parts as cut, zeros};
use super::super::{Group, Mesh, Object, Scene};
use super::runs::Runs;
use super::weld::Welded;
use bytemuck::Zeroable;
use glam::{Mat4, Vec2};
use rayon::prelude::*;
use std::collections::HashMap;

/// All components of a vertex as bits, to find equal vertices.
type Key = [u32; 11];

/// Number of vertex hashes that one task examines.
const CHUNK: usize = 1 << 14;

/// Makes a mesh and an object of each set of runs that belong together, in the order of their first runs.
///
/// `materials` has the material of each run. `coordinates` has, by material, the scale and offset of texture coordinates; `None` keeps the
/// coordinates.
pub(super) fn join(
    runs: &Runs,
    mut welded: Vec<Welded>,
    materials: &[u32],
    coordinates: &[Option<(Vec2, Vec2)>],
    context: &mut Context<'_>,
) -> Result<Scene, SceneError> {
    welded.par_iter_mut().zip(materials).for_each(|(part, material)| {
        if let Some((scale, offset)) = coordinates.get(*material as usize).copied().flatten() {
            part.texcoords.iter_mut().for_each(|texcoord| *texcoord = *texcoord * scale + offset);
        }
    });
    let mut sets: Vec<(u32, Vec<(u32, Welded)>)> = Vec::new();
    let mut by_key = HashMap::new();
    for (((run, _), part), material) in runs.list.iter().zip(welded).zip(materials) {
        let set = *by_key.entry((run.object, run.texcoords, run.normals)).or_insert_with(|| {
            sets.push((run.object, Vec::new()));
            sets.len() - 1
        });
        sets[set].1.push((*material, part));
    }
    let mut scene = Scene::default();
    for (object, parts) in sets {
        let name = runs.objects[object as usize].clone();
        let index = scene.meshes.len() as u32;
        scene.meshes.push(Mesh { name: name.clone(), ..mesh_of(parts, context)? });
        scene.objects.push(Object { name, mesh: index, transform: Mat4::IDENTITY });
    }
    Ok(scene)
}

fn mesh_of(mut parts: Vec<(u32, Welded)>, context: &mut Context<'_>) -> Result<Mesh, SceneError> {
    if parts.len() == 1 {
        let (material, Welded { positions, normals, texcoords, colors, triangles }) = parts.remove(0);
        return Ok(Mesh {
            positions,
            normals,
            texcoords,
            colors,
            groups: vec![Group { material, triangles }],
            ..Mesh::default()
        });
    }
    // First vertex of each run, counted through all runs; the last entry is the total.
    let mut starts = Vec::with_capacity(parts.len() + 1);
    let (mut vertices, mut triangles) = (0_u64, 0_u64);
    for (_, part) in &parts {
        starts.push(vertices as u32);
        vertices += part.positions.len() as u64;
        triangles += part.triangles.len() as u64;
    }
    let limit = u64::from(u32::MAX);
    if vertices >= limit {
        return Err(SceneError::file(context.file, format!("{vertices} vertices of one object are too many"))
            .help(format!("valid: fewer than {limit}")));
    }
    starts.push(vertices as u32);
    // During the joining each vertex exists twice, and a pair of its hash and its number is stored.
    let bytes = vertices * (16 + size_of::<Key>() as u64) + triangles * 12;
    context.budget.take(context.file, "joining the faces of an object", bytes)?;
    let shared = shared_vertices(&parts, &starts);
    let index = Index { starts: &starts, shared: &shared };

    let mut mesh = Mesh {
        positions: index.gather(&parts, |part| &part.positions),
        normals: index.gather(&parts, |part| &part.normals),
        texcoords: index.gather(&parts, |part| &part.texcoords),
        colors: index.gather(&parts, |part| &part.colors),
        ..Mesh::default()
    };
    let mut group_of = HashMap::new();
    let mut lengths: Vec<(u32, usize)> = Vec::new();
    for (material, part) in &parts {
        let group = *group_of.entry(*material).or_insert_with(|| {
            lengths.push((*material, 0));
            lengths.len() - 1
        });
        lengths[group].1 += part.triangles.len();
    }
    let group = |&(material, length): &(u32, usize)| Group { material, triangles: zeros(length) };
    mesh.groups = lengths.iter().map(group).collect();
    let mut rests: Vec<&mut [[u32; 3]]> = mesh.groups.iter_mut().map(|group| &mut group.triangles[..]).collect();
    let mut places = Vec::with_capacity(parts.len());
    for (material, part) in &parts {
        let rest = &mut rests[group_of[material]];
        let (place, after) = std::mem::take(rest).split_at_mut(part.triangles.len());
        places.push(place);
        *rest = after;
    }
    places.into_par_iter().zip(&parts).enumerate().for_each(|(run, (place, (_, part)))| {
        let new_index = index.of_run(run);
        for (out, triangle) in place.iter_mut().zip(&part.triangles) {
            *out = triangle.map(|vertex| new_index[vertex as usize]);
        }
    });
    context.budget.give_back(bytes);
    Ok(mesh)
}

/// The vertices that equal a vertex of an earlier run, ascending, each with the first vertex that it equals. Vertices are counted
/// through all runs. Equal vertices of one run are not shared: where a file lists a vertex twice, the two are meant to be separate.
fn shared_vertices(parts: &[(u32, Welded)], starts: &[u32]) -> Vec<(u32, u32)> {
    let run_of = |vertex: u32| starts.partition_point(|start| *start <= vertex) - 1;
    let contents = |vertex: u32| {
        let run = run_of(vertex);
        key(&parts[run].1, (vertex - starts[run]) as usize)
    };
    let mut hashes: Vec<(u64, u32)> = zeros(starts[parts.len()] as usize);
    let places = cut(&mut hashes, parts.iter().map(|(_, part)| part.positions.len()));
    places.into_par_iter().zip(parts).zip(starts).for_each(|((place, (_, part)), start)| {
        for (vertex, out) in place.iter_mut().enumerate() {
            *out = (hash(&key(part, vertex)), start + vertex as u32);
        }
    });
    hashes.par_sort_unstable();

    let chunks = (0..hashes.len().div_ceil(CHUNK)).into_par_iter();
    let mut shared: Vec<(u32, u32)> = chunks
        .flat_map_iter(|chunk| {
            let mut found = Vec::new();
            let mut same: Vec<(Key, u32)> = Vec::new();
            // The chunk that contains the first vertex of a hash handles all vertices of that hash.
            let begins = |at: usize| at == 0 || hashes[at - 1].0 != hashes[at].0;
            let firsts = (chunk * CHUNK..((chunk + 1) * CHUNK).min(hashes.len())).filter(|at| begins(*at));
            for first in firsts {
                let end = first + hashes[first..].iter().take_while(|(hash, _)| *hash == hashes[first].0).count();
                if end - first == 1 {
                    continue;
                }
                same.clear();
                same.extend(hashes[first..end].iter().map(|(_, vertex)| (contents(*vertex), *vertex)));
                // Different vertices may have the same hash.
                same.sort_unstable();
                for equal in same.chunk_by(|a, b| a.0 == b.0) {
                    let (_, original) = equal[0];
                    let end_of_run = starts[run_of(original) + 1];
                    let later = equal.iter().filter(|(_, vertex)| *vertex >= end_of_run);
                    found.extend(later.map(|(_, vertex)| (*vertex, original)));
                }
            }
            found
        })
        .collect();
    shared.par_sort_unstable();
    shared
}

/// Maps the vertices of runs to their indices in the joined mesh.
struct Index<'a> {
    starts: &'a [u32],
    shared: &'a [(u32, u32)],
}

impl Index<'_> {
    /// Number of shared vertices before this one.
    fn shared_before(&self, vertex: u32) -> usize {
        self.shared.partition_point(|(shared, _)| *shared < vertex)
    }

    /// The shared vertices of a run, each with the vertex that replaces it.
    fn shared_of(&self, run: usize) -> &[(u32, u32)] {
        &self.shared[self.shared_before(self.starts[run])..self.shared_before(self.starts[run + 1])]
    }

    /// The index in the mesh of each vertex of a run.
    fn of_run(&self, run: usize) -> Vec<u32> {
        let mut shared = self.shared_of(run).iter().peekable();
        let mut next = self.starts[run] - self.shared_before(self.starts[run]) as u32;
        let place = |vertex: u32| match shared.next_if(|(shared, _)| *shared == vertex) {
            Some((_, original)) => original - self.shared_before(*original) as u32,
            None => {
                next += 1;
                next - 1
            }
        };
        (self.starts[run]..self.starts[run + 1]).map(place).collect()
    }

    /// Collects an attribute of all vertices that are not shared.
    fn gather<T: Copy + Zeroable + Send + Sync>(
        &self,
        parts: &[(u32, Welded)],
        list: impl Fn(&Welded) -> &Vec<T> + Sync,
    ) -> Vec<T> {
        if parts.iter().all(|(_, part)| list(part).is_empty()) {
            return Vec::new();
        }
        let kept = |(run, (_, part)): (usize, &(u32, Welded))| part.positions.len() - self.shared_of(run).len();
        let mut all = zeros(self.starts[parts.len()] as usize - self.shared.len());
        let places = cut(&mut all, parts.iter().enumerate().map(kept));
        places.into_par_iter().zip(parts).enumerate().for_each(|(run, (place, (_, part)))| {
            let mut shared =
                self.shared_of(run).iter().map(|(vertex, _)| (vertex - self.starts[run]) as usize).peekable();
            let kept = list(part).iter().enumerate().filter(|(vertex, _)| shared.next_if_eq(vertex).is_none());
            place.iter_mut().zip(kept).for_each(|(out, (_, value))| *out = *value);
        });
        all
    }
}

fn key(part: &Welded, vertex: usize) -> Key {
    let [x, y, z] = part.positions[vertex].to_array();
    let [nx, ny, nz] = part.normals.get(vertex).copied().unwrap_or_default().to_array();
    let [u, v] = part.texcoords.get(vertex).copied().unwrap_or_default().to_array();
    let [red, green, blue, _] = part.colors.get(vertex).copied().unwrap_or_default().to_array();
    [x, y, z, nx, ny, nz, u, v, red, green, blue].map(f32::to_bits)
}

/// FNV-1a on words with an additional rotation. Collisions only cost a comparison of the keys.
fn hash(key: &Key) -> u64 {
    let words = key.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, word| {
        (hash ^ u64::from(*word)).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(23)
    });
    words ^ words >> 29
}
