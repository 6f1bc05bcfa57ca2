//! The vertices of each run: one for each distinct tuple of indices, in order of first use.

use super::faces::{Faces, Part, Run};
use super::runs::{Runs, Segment};
use super::scan::Numbers;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;

/// The triangles of a run, with their vertices.
#[derive(Default)]
pub(super) struct Welded {
    pub(super) positions: Vec<Vec3>,
    /// As many as positions, or none.
    pub(super) normals: Vec<Vec3>,
    /// As many as positions, or none.
    pub(super) texcoords: Vec<Vec2>,
    /// As many as positions, or none.
    pub(super) colors: Vec<Vec4>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Marks no vertex, and a missing index of a corner.
const NONE: u32 = u32::MAX;

/// Welds the runs in parallel.
pub(super) fn weld(runs: &Runs, faces: &[Faces], numbers: &Numbers) -> Vec<Welded> {
    let weld =
        |(run, segments): &(Run, _)| weld_run(*run, &runs.segments[std::ops::Range::clone(segments)], faces, numbers);
    runs.list.par_iter().map(weld).collect()
}

fn weld_run(run: Run, segments: &[Segment], faces: &[Faces], numbers: &Numbers) -> Welded {
    let positions_of = |segment: &Segment| {
        let Part { first, count, .. } = segment.part;
        &faces[segment.piece as usize].positions[first as usize..][..count as usize]
    };
    let count: usize = segments.iter().map(|segment| segment.part.count as usize).sum();
    let mut vertices = Vertices::new(segments.iter().flat_map(positions_of).flatten().copied(), 3 * count);
    // A mesh has about half as many vertices as triangles; without shared edges it has more.
    let expected = vertices.first.len().min(count);
    let list = |wanted: bool| if wanted { expected } else { 0 };
    let mut welded = Welded {
        positions: Vec::with_capacity(expected),
        normals: Vec::with_capacity(list(run.normals)),
        texcoords: Vec::with_capacity(list(run.texcoords)),
        colors: Vec::with_capacity(list(!numbers.colors.is_empty())),
        triangles: Vec::with_capacity(count),
    };
    for segment in segments {
        let piece = &faces[segment.piece as usize];
        let Part { first_texcoords, first_normals, .. } = segment.part;
        for (triangle, positions) in positions_of(segment).iter().enumerate() {
            let texcoords =
                if run.texcoords { piece.texcoords[first_texcoords as usize + triangle] } else { [NONE; 3] };
            let normals = if run.normals { piece.normals[first_normals as usize + triangle] } else { [NONE; 3] };
            welded.triangles.push(std::array::from_fn(|corner| {
                let [position, texcoord, normal] = [positions[corner], texcoords[corner], normals[corner]];
                let next = welded.positions.len() as u32;
                let vertex = vertices.find_or_insert([position, texcoord, normal], next);
                if vertex == next {
                    welded.positions.push(numbers.positions[position as usize]);
                    welded.colors.extend(numbers.colors.get(position as usize));
                    welded.texcoords.extend(run.texcoords.then(|| numbers.texcoords[texcoord as usize]));
                    welded.normals.extend(run.normals.then(|| numbers.normals[normal as usize]));
                }
                vertex
            }));
        }
    }
    welded
}

/// The vertex of each tuple of indices.
struct Vertices {
    /// The first vertex of each position, indexed from the position `least`: texture coordinate, normal and number of the vertex.
    /// Empty if the range of the positions' indices is too wide.
    first: Vec<[u32; 3]>,
    least: u32,
    /// All further vertices.
    others: HashMap<[u32; 3], u32>,
}

impl Vertices {
    fn new(positions: impl Iterator<Item = u32>, count: usize) -> Self {
        let (least, most) = positions.fold((NONE, 0), |(least, most), p| (least.min(p), most.max(p)));
        let span = most.saturating_sub(least) as usize + 1;
        let first = if span <= 4 * count { vec![[NONE; 3]; span] } else { Vec::new() };
        Self { first, least, others: HashMap::new() }
    }

    /// The vertex with these indices; a new vertex gets the number `next`.
    fn find_or_insert(&mut self, indices: [u32; 3], next: u32) -> u32 {
        let [position, texcoord, normal] = indices;
        match self.first.get_mut((position - self.least) as usize) {
            Some(slot) if slot[2] == NONE => {
                *slot = [texcoord, normal, next];
                next
            }
            Some([t, n, vertex]) if (*t, *n) == (texcoord, normal) => *vertex,
            _ => *self.others.entry(indices).or_insert(next),
        }
    }
}
