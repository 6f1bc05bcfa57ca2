//! The proof that the triangles of a pair do not see each other at all.
//!
//! Take triangles whose planes have one triangle of the pair strictly in front and the other strictly behind, and which form a surface
//! without a border inside the shaft: each edge in the shaft is used as often in one direction as in the other. As a segment of the pair
//! moves, its crossings with such a surface cannot vanish over a border or over an end of the segment. So all segments cross the surface
//! equally often, and testing one of them is enough. The surface may be a wall of many triangles, and need not be flat.

use super::shaft::{Blocker, Pair, Shaft};
use crate::trace::{Detected, Kernel, Simd};
use glam::DVec3;

/// Buffers of the proof.
#[derive(Debug, Default)]
pub(super) struct Walls {
    places: Vec<Place>,
    edges: Vec<Edge>,
    /// For each blocker, whether it is still part of the surface.
    alive: Vec<bool>,
}

/// How a blocker lies relative to the pair.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// 1 if the pair's first side is strictly in front of the triangle's plane and the second strictly behind it, -1 for the reverse, else
    /// 0.
    between: i8,
    /// For each edge, whether it has a point inside the shaft. Computed only where `between` is not 0.
    inside: [bool; 3],
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    /// Both end points as bits, the lower first.
    ends: [[u64; 3]; 2],
    /// Index of the triangle in the list of blockers.
    triangle: usize,
    /// 1 if the edge runs from the lower to the higher end, else -1.
    direction: i32,
    inside: bool,
}

impl Walls {
    /// Whether some of the blockers certainly stop every segment. `false` means "not known".
    pub(super) fn cover(&mut self, blockers: &[Blocker], pair: &Pair, shaft: &Shaft) -> bool {
        self.places.clear();
        Detected::cached().run(Places { blockers, shaft, places: &mut self.places });
        [1, -1].into_iter().any(|sign| {
            self.alive.clear();
            self.alive.extend(self.places.iter().map(|place| place.between == sign));
            if !self.alive.contains(&true) {
                return false;
            }
            self.collect(blockers);
            self.peel();
            self.is_crossed(blockers, pair)
        })
    }

    /// Collects the edges of the triangles that are left, sorted so that equal edges are adjacent.
    fn collect(&mut self, blockers: &[Blocker]) {
        self.edges.clear();
        for (triangle, blocker) in blockers.iter().enumerate().filter(|(index, _)| self.alive[*index]) {
            let [a, b, c] = blocker.corners;
            let inside = self.places[triangle].inside;
            for ((from, to), inside) in [(a, b), (b, c), (c, a)].into_iter().zip(inside) {
                // Adding 0 turns -0 into 0.
                let [f, t] = [from, to].map(|end| (end + 0.0).to_array().map(f64::to_bits));
                let (ends, direction) = if f <= t { ([f, t], 1) } else { ([t, f], -1) };
                self.edges.push(Edge { ends, triangle, direction, inside });
            }
        }
        self.edges.sort_unstable_by_key(|edge| (edge.ends, edge.triangle, edge.direction));
    }

    /// Removes triangles with a border inside the shaft until there are none.
    fn peel(&mut self) {
        loop {
            let mut changed = false;
            for edges in self.edges.chunk_by(|a, b| a.ends == b.ends) {
                let balance: i32 =
                    edges.iter().filter(|edge| self.alive[edge.triangle]).map(|edge| edge.direction).sum();
                if balance != 0 && edges.iter().any(|edge| edge.inside) {
                    for edge in edges {
                        changed |= std::mem::replace(&mut self.alive[edge.triangle], false);
                    }
                }
            }
            if !changed {
                return;
            }
        }
    }

    /// Whether a segment between the fronts certainly crosses the surface. Tries several, since each may meet an edge.
    fn is_crossed(&self, blockers: &[Blocker], pair: &Pair) -> bool {
        const SHARES: [f64; 4] = [0.53, 0.29, 0.13, 0.05];
        let left = || blockers.iter().zip(&self.alive).filter(|(_, alive)| **alive).map(|(blocker, _)| blocker);
        (0..3).any(|turn| {
            let [from, to] = pair.sides.map(|side| {
                let corners = side.front.corners();
                let sum: DVec3 = (0..corners.len()).map(|i| corners[(i + turn) % corners.len()] * SHARES[i]).sum();
                sum / SHARES[..corners.len()].iter().sum::<f64>()
            });
            left().any(|blocker| {
                let [a, b, c] = blocker.corners.map(|corner| corner - from);
                let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|normal| normal.dot(to - from));
                // A margin far above rounding.
                let least = 1e-9 * sides.iter().map(|side| side.abs()).sum::<f64>();
                sides.iter().all(|side| *side > least) || sides.iter().all(|side| *side < -least)
            })
        })
    }
}

struct Places<'a> {
    blockers: &'a [Blocker],
    shaft: &'a Shaft,
    places: &'a mut Vec<Place>,
}

impl Kernel<()> for Places<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { blockers, shaft, places } = self;
        for Blocker { corners } in blockers {
            let between = between(shaft, corners);
            let [a, b, c] = *corners;
            let mut inside = [false; 3];
            if between != 0 {
                // Calls, not closures: a closure would be compiled for the baseline instruction set.
                inside = [meets(shaft, (a, b)), meets(shaft, (b, c)), meets(shaft, (c, a))];
            }
            places.push(Place { between, inside });
        }
    }
}

/// The value of [`Place::between`].
#[inline(always)]
fn between(shaft: &Shaft, corners: &[DVec3; 3]) -> i8 {
    let [a, b, c] = *corners;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let slack = slack(shaft, corners);
    let heights = shaft.ends_over(normal, a);
    // For each side of the pair, the number of its corners in front of the triangle's plane and behind it.
    let (mut front, mut back) = ([0_u64; 2], [0_u64; 2]);
    for lane in 0..8 {
        front[lane / 4] += u64::from(heights[lane] > slack);
        back[lane / 4] += u64::from(heights[lane] < -slack);
    }
    match (front, back) {
        ([4, _], [_, 4]) => 1,
        ([_, 4], [4, _]) => -1,
        _ => 0,
    }
}

/// Whether a segment has a point inside the shaft; touching the shaft's surface does not count.
#[inline(always)]
fn meets(shaft: &Shaft, (from, to): (DVec3, DVec3)) -> bool {
    let slack = slack(shaft, &[from, to]);
    let (starts, ends) = (shaft.heights(from), shaft.heights(to));
    let (mut enter, mut leave, mut out) = (0.0_f64, 1.0_f64, 0_u64);
    for (start, end) in starts.into_iter().zip(ends) {
        let (start, end) = (start + slack, end + slack);
        out |= u64::from((start >= 0.0) & (end >= 0.0));
        let share = start / (start - end);
        let (late, early) = (share - 1e-12, share + 1e-12);
        enter = if (start > 0.0) & (late > enter) { late } else { enter };
        leave = if (start <= 0.0) & (end > 0.0) & (early < leave) { early } else { leave };
    }
    out == 0 && enter <= leave
}

#[inline(always)]
fn slack(shaft: &Shaft, points: &[DVec3]) -> f64 {
    shaft.slack(points.iter().fold(0.0, |size, point| size.max(point.abs().max_element())))
}
