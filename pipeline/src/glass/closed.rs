//! Tests whether the triangles of a material form closed surfaces, and their orientation.

use crate::scene::Geometry;
use glam::{DVec3, Vec3};
use std::collections::{HashMap, HashSet};

/// An edge: the indices of two welded positions, the lower index first.
type Edge = [u32; 2];

/// Whether the surface of a material is closed.
#[derive(Debug, Clone, PartialEq)]
pub enum Closedness {
    /// Each edge is used equally often in both directions, so inside and outside are defined everywhere.
    Closed {
        /// Ids of the triangles that must be flipped: those of bodies that face inwards (negative volume) and lie inside no other
        /// body, and those of all bodies inside them.
        inside_out: Vec<u32>,
    },
    /// Some edges are not used equally often in both directions.
    Open {
        /// Number of such edges.
        edges: usize,
        /// Midpoint of the first such edge, in the order of triangles.
        first: Vec3,
    },
}

/// Examines the given triangles. Corners with bitwise equal positions count as one (0 and -0 are equal too), so vertices that are
/// duplicated for their normals do not open a surface.
///
/// Takes linear time if no part faces inwards: it fills a hash table of all edges. If some parts do, all parts are sorted along an axis and
/// compared with those that overlap them on it.
#[must_use]
pub fn closedness(geometry: &Geometry, triangles: &[u32]) -> Closedness {
    let (corners, points) = weld(geometry, triangles);
    // For each edge: uses in ascending minus uses in descending direction, and the first triangle that has it.
    let mut balance: HashMap<Edge, (i32, usize)> = HashMap::with_capacity(triangles.len() * 3 / 2);
    for (index, [a, b, c]) in corners.iter().enumerate() {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let (edge, step) = if from < to { ([*from, *to], 1) } else { ([*to, *from], -1) };
            balance.entry(edge).or_insert((0, index)).0 += step;
        }
    }
    let open = balance.iter().filter(|(edge, (balance, _))| *balance != 0 && edge[0] != edge[1]);
    let edges = open.clone().count();
    if let Some((edge, _)) = open.min_by_key(|(edge, (_, triangle))| (*triangle, **edge)) {
        return Closedness::Open { edges, first: points[edge[0] as usize].midpoint(points[edge[1] as usize]) };
    }
    let parts = parts(&corners, points.len());
    Closedness::Closed { inside_out: inside_out(triangles, &corners, &points, &parts) }
}

/// The corners of the triangles as indices of distinct positions, and these positions.
fn weld(geometry: &Geometry, triangles: &[u32]) -> (Vec<[u32; 3]>, Vec<Vec3>) {
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(triangles.len());
    let mut points = Vec::new();
    let corners = triangles.iter().map(|triangle| {
        geometry.corners(*triangle).map(|position| {
            // Adding 0 turns -0 into 0.
            *known.entry((position + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert_with(|| {
                points.push(position);
                points.len() as u32 - 1
            })
        })
    });
    (corners.collect(), points)
}

/// For each triangle of the list, the number of its connected part of the surface. Parts are numbered from 0 in the order of their first
/// triangles. Corners are joined as in [`closedness`].
#[must_use]
pub fn connected(geometry: &Geometry, triangles: &[u32]) -> Vec<u32> {
    let (corners, points) = weld(geometry, triangles);
    let mut numbers = HashMap::new();
    let number = |part: u32| {
        let next = numbers.len() as u32;
        *numbers.entry(part).or_insert(next)
    };
    parts(&corners, points.len()).into_iter().map(number).collect()
}

/// By triangle: its connected part of the surface, identified by one of the part's points (union-find).
fn parts(corners: &[[u32; 3]], points: usize) -> Vec<u32> {
    fn root(parents: &mut [u32], mut point: u32) -> u32 {
        while parents[point as usize] != point {
            let above = parents[parents[point as usize] as usize];
            parents[point as usize] = above;
            point = above;
        }
        point
    }
    let mut parents: Vec<u32> = (0..points as u32).collect();
    for [a, b, c] in corners {
        for other in [b, c] {
            let (one, two) = (root(&mut parents, *a), root(&mut parents, *other));
            parents[one.max(two) as usize] = one.min(two);
        }
    }
    corners.iter().map(|[a, ..]| root(&mut parents, *a)).collect()
}

/// A connected part of a surface.
#[derive(Clone, Copy)]
struct Part {
    /// One of the part's points, which identifies it.
    name: u32,
    /// Six times the enclosed volume; negative if the part faces inwards.
    volume: f64,
    low: Vec3,
    high: Vec3,
}

impl Part {
    fn is_within(&self, other: &Part) -> bool {
        self.low.cmpge(other.low).all() && self.high.cmple(other.high).all()
    }
}

/// The triangles to flip: those of parts that face inwards and lie inside no other part, and of the parts within them. A part lies
/// inside another if its bounding box does. So a mirrored copy of a body with cavities is flipped as a whole, and the cavity of a
/// body that faces outwards stays as it is.
fn inside_out(triangles: &[u32], corners: &[[u32; 3]], points: &[Vec3], of: &[u32]) -> Vec<u32> {
    let mut found: HashMap<u32, Part> = HashMap::new();
    let center = points.first().map_or(DVec3::ZERO, |point| point.as_dvec3());
    for (corners, part) in corners.iter().zip(of) {
        let [a, b, c] = corners.map(|point| points[point as usize]);
        let part = found.entry(*part).or_insert(Part { name: *part, volume: 0.0, low: a, high: a });
        let [x, y, z] = [a, b, c].map(|point| point.as_dvec3() - center);
        part.volume += x.dot(y.cross(z));
        part.low = part.low.min(a).min(b).min(c);
        part.high = part.high.max(a).max(b).max(c);
    }
    let mut found: Vec<Part> = found.into_values().collect();
    if !found.iter().any(|part| part.volume < 0.0) {
        return Vec::new();
    }
    let low = found.iter().fold(Vec3::INFINITY, |low, part| low.min(part.low));
    let high = found.iter().fold(Vec3::NEG_INFINITY, |high, part| high.max(part.high));
    // The axis on which the parts are shortest in comparison with the whole: there the fewest overlap.
    let lengths: Vec3 = found.iter().map(|part| part.high - part.low).sum();
    let shares = Vec3::select((high - low).cmpgt(Vec3::ZERO), lengths / (high - low), Vec3::INFINITY);
    let axis = shares.min_position();
    found.sort_unstable_by(|a, b| a.low[axis].total_cmp(&b.low[axis]));
    let inwards: Vec<Part> = found.iter().filter(|part| part.volume < 0.0).copied().collect();
    let within = are_within(&inwards, &found, axis);
    let outermost: Vec<Part> =
        inwards.into_iter().zip(within).filter(|(_, within)| !within).map(|(part, _)| part).collect();
    let within = are_within(&found, &outermost, axis);
    let inner = found.iter().zip(within).filter(|(_, within)| *within).map(|(part, _)| part.name);
    let turned: HashSet<u32> = outermost.iter().map(|part| part.name).chain(inner).collect();
    triangles.iter().zip(of).filter(|(_, part)| turned.contains(*part)).map(|(triangle, _)| *triangle).collect()
}

/// For each part: whether it lies inside another one of `others`. Both lists are sorted by their low ends on the axis, so that each part is
/// compared only with those that have begun on the axis where it begins, and have not ended.
fn are_within(parts: &[Part], others: &[Part], axis: usize) -> Vec<bool> {
    let mut waiting = others.iter().peekable();
    let mut begun: Vec<&Part> = Vec::new();
    let is_within = |part: &Part| {
        while let Some(other) = waiting.next_if(|other| other.low[axis] <= part.low[axis]) {
            begun.push(other);
        }
        begun.retain(|other| other.high[axis] >= part.low[axis]);
        begun.iter().any(|other| other.name != part.name && part.is_within(other))
    };
    parts.iter().map(is_within).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Batch;

    /// Boxes of 12 triangles, with separate corners for every face. Each entry: low corner, high corner, whether the box faces
    /// inwards.
    fn boxes(list: &[(f32, f32, bool)]) -> Geometry {
        let mut geometry = Geometry::default();
        for (low, high, inwards) in list {
            for axis in 0..3 {
                for (side, flip) in [(*low, true), (*high, false)] {
                    let at = |u: f32, v: f32| {
                        let mut point = [side; 3];
                        (point[(axis + 1) % 3], point[(axis + 2) % 3]) = (u, v);
                        Vec3::from(point)
                    };
                    let quad = [at(*low, *low), at(*high, *low), at(*high, *high), at(*low, *high)];
                    let first = geometry.positions.len() as u32;
                    geometry.positions.extend(quad);
                    for triangle in [[0, 1, 2], [0, 2, 3]] {
                        let [a, b, c] = triangle.map(|corner| corner + first);
                        geometry.triangles.push(if flip != *inwards { [a, c, b] } else { [a, b, c] });
                    }
                }
            }
        }
        geometry.batches = vec![Batch { material: 0, first: 0, count: geometry.triangles.len() as u32 }];
        geometry
    }

    fn look(geometry: &Geometry) -> Closedness {
        closedness(geometry, &(0..geometry.triangles.len() as u32).collect::<Vec<_>>())
    }

    #[test]
    fn a_box_is_closed_until_a_triangle_is_missing_or_turned() {
        let whole = boxes(&[(-1.0, 1.0, false)]);
        assert_eq!(look(&whole), Closedness::Closed { inside_out: Vec::new() });
        let mut lacking = whole.clone();
        lacking.triangles.pop();
        assert!(matches!(look(&lacking), Closedness::Open { edges: 3, .. }), "{:?}", look(&lacking));
        let mut turned = whole.clone();
        turned.triangles[5].swap(0, 1);
        assert!(matches!(look(&turned), Closedness::Open { edges: 3, .. }), "{:?}", look(&turned));
        // Moving a corner by one bit opens the surface.
        let mut moved = whole;
        moved.positions[0].x = moved.positions[0].x.next_up();
        assert!(matches!(look(&moved), Closedness::Open { .. }));
    }

    #[test]
    fn zeros_of_both_signs_are_one_corner() {
        let mut geometry = boxes(&[(0.0, 1.0, false)]);
        let negative = |value: f32| if value == 0.0 { -0.0 } else { value };
        geometry
            .positions
            .iter_mut()
            .step_by(3)
            .for_each(|position| *position = position.to_array().map(negative).into());
        assert_eq!(look(&geometry), Closedness::Closed { inside_out: Vec::new() });
    }

    #[test]
    fn bodies_that_face_inwards_are_found_and_cavities_are_not() {
        // A body with a cavity; a body that faces inwards; and a mirrored body with a cavity.
        let at = |list: &[(f32, f32, bool)]| look(&boxes(list));
        let Closedness::Closed { inside_out } = at(&[(-2.0, 2.0, false), (-1.0, 1.0, true)]) else { panic!("closed") };
        assert_eq!(inside_out, [0_u32; 0]);
        let Closedness::Closed { inside_out } = at(&[(5.0, 6.0, true), (-1.0, 1.0, false)]) else { panic!("closed") };
        assert_eq!(inside_out, (0..12).collect::<Vec<_>>());
        let Closedness::Closed { inside_out } = at(&[(-2.0, 2.0, true), (-1.0, 1.0, false), (7.0, 8.0, false)]) else {
            panic!("closed")
        };
        assert_eq!(inside_out, (0..24).collect::<Vec<_>>());
    }

    #[test]
    fn parts_in_others_are_found_as_by_comparing_all() {
        // Boxes whose corners have few values, so that many begin and end alike.
        let mut state = 1_u32;
        let mut digit = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 24) % 5) as f32
        };
        let mut point = || Vec3::new(digit(), digit(), digit());
        let part = |name| {
            let (one, two) = (point(), point());
            Part { name, volume: 1.0, low: one.min(two), high: one.max(two) }
        };
        let mut parts: Vec<Part> = (0..200).map(part).collect();
        for axis in 0..3 {
            parts.sort_unstable_by(|a, b| a.low[axis].total_cmp(&b.low[axis]));
            let others: Vec<Part> = parts.iter().step_by(3).copied().collect();
            let is_in_any = |part: &Part| others.iter().any(|other| other.name != part.name && part.is_within(other));
            let expected: Vec<bool> = parts.iter().map(is_in_any).collect();
            assert!(expected.contains(&true) && expected.contains(&false), "control");
            assert_eq!(are_within(&parts, &others, axis), expected);
        }
    }

    #[test]
    fn beads_in_a_row_are_turned_with_their_bubbles() {
        const BEADS: u32 = 5000;
        let bead = |number: u32| {
            let low = 4.0 * number as f32;
            [(low, low + 3.0, true), (low + 1.0, low + 2.0, false)]
        };
        let list: Vec<_> = (0..BEADS).flat_map(bead).chain([(-5.0, -1.0, false)]).collect();
        let Closedness::Closed { inside_out } = look(&boxes(&list)) else { panic!("closed") };
        assert_eq!(inside_out, (0..24 * BEADS).collect::<Vec<_>>());
    }

    #[test]
    fn bodies_are_told_apart_by_their_corners() {
        let geometry = boxes(&[(-1.0, 1.0, false), (2.0, 3.0, false), (1.0, 2.0, true)]);
        let all: Vec<u32> = (0..36).collect();
        // The third box touches both others at a corner, so that all of them are one part.
        assert_eq!(connected(&geometry, &all), [0; 36]);
        let apart = connected(&geometry, &all[..24]);
        assert!(apart[..12].iter().all(|part| *part == 0) && apart[12..].iter().all(|part| *part == 1), "{apart:?}");
        assert_eq!(connected(&geometry, &[20, 3, 21]), [0, 1, 0], "numbered as they come");
        assert_eq!(connected(&geometry, &[]), [0_u32; 0]);
    }

    #[test]
    fn no_triangle_is_the_border_of_nothing() {
        assert_eq!(look(&Geometry::default()), Closedness::Closed { inside_out: Vec::new() });
    }
}
