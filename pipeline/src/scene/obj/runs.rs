//! The runs of a whole file, assembled from those of its pieces.

use super::faces::{Faces, Names, Part, Run};
use std::ops::Range;

/// The triangles of a run that lie in one piece.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    pub(super) piece: u32,
    /// The triangles' place in the lists of the piece. The name indices in [`Part::run`] refer to the piece's names.
    pub(super) part: Part,
}

/// All runs in order.
#[derive(Default)]
pub(super) struct Runs {
    /// Each run with its range in [`Self::segments`].
    pub(super) list: Vec<(Run, Range<usize>)>,
    pub(super) segments: Vec<Segment>,
    /// The names that the indices in [`Run`] refer to.
    pub(super) objects: Vec<String>,
    pub(super) materials: Vec<String>,
}

/// Assembles the runs. A run ends where object, material or attributes change, and once it has `max_run` triangles or more.
pub(super) fn runs(faces: &[Faces], max_run: usize) -> Runs {
    let mut runs = Runs::default();
    let (mut objects, mut materials) = (Names::default(), Names::default());
    let mut length = 0;
    for (piece, faces) in faces.iter().enumerate() {
        let object_index: Vec<u32> = faces.objects.list.iter().map(|name| objects.index_of(name)).collect();
        let material_index: Vec<u32> = faces.materials.list.iter().map(|name| materials.index_of(name)).collect();
        for part in &faces.parts {
            let run = Run {
                object: object_index[part.run.object as usize],
                material: material_index[part.run.material as usize],
                ..part.run
            };
            let mut rest = *part;
            while rest.count > 0 {
                if length >= max_run || runs.list.last().is_none_or(|(last, _)| *last != run) {
                    runs.list.push((run, runs.segments.len()..runs.segments.len()));
                    length = 0;
                }
                let (taken, left) = split(rest, max_run - length, &faces.polygons);
                length += taken.count as usize;
                runs.segments.push(Segment { piece: piece as u32, part: taken });
                if let Some((_, segments)) = runs.list.last_mut() {
                    segments.end = runs.segments.len();
                }
                rest = left;
            }
        }
    }
    (runs.objects, runs.materials) = (objects.list, materials.list);
    runs
}

/// Splits a part: first the polygons that begin within its first `room` triangles, then the rest.
fn split(part: Part, room: usize, polygons: &[[u32; 2]]) -> (Part, Part) {
    if part.count as usize <= room {
        return (part, Part { count: 0, ..part });
    }
    let cut = part.first + room as u32;
    let end = match polygons[..polygons.partition_point(|[first, _]| *first < cut)].last() {
        Some([first, count]) if first + count > cut => first + count,
        _ => cut,
    };
    let taken = end - part.first;
    let left = Part {
        first: end,
        first_texcoords: part.first_texcoords + taken,
        first_normals: part.first_normals + taken,
        count: part.count - taken,
        ..part
    };
    (Part { count: taken, ..part }, left)
}
