//! The proof that a pair does not see each other at all.
//!
//! Take triangles whose planes have one side of the pair strictly in front and the other strictly behind, and that have no border
//! inside the shaft: each edge belongs to as many of them in one direction as in the other, or lies outside the shaft. A
//! segment of the pair that moves never loses such a surface over a border, nor over an end of the segment. So how often it
//! crosses the surface is the same number for all segments, and one of them tells it. The surface may be a wall of many triangles, and
//! need not be flat.

use super::shaft::{Blocker, Pair, Shaft};
use glam::DVec3;

/// What the proof needs.
#[derive(Debug, Default)]
pub(super) struct Walls {
    edges: Vec<Edge>,
    /// Of each edge: directed uses by triangles that are left.
    alive: Vec<bool>,
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    /// Bits of both ends, the lower first.
    ends: [[u64; 3]; 2],
    /// Place of the triangle in the list.
    triangle: usize,
    /// 1 from the lower to the higher end, else -1.
    direction: i32,
    inside: bool,
}

impl Walls {
    /// Whether some of the blockers surely stop every segment. False says nothing.
    pub(super) fn cover(&mut self, blockers: &[Blocker], pair: &Pair, shaft: &Shaft) -> bool {
        [1.0, -1.0].into_iter().any(|sign| {
            self.alive.clear();
            self.alive.extend(blockers.iter().map(|blocker| separates(blocker, pair, shaft, sign)));
            self.collect(blockers, shaft);
            self.peel();
            self.is_crossed(blockers, pair)
        })
    }

    /// The edges of the triangles that are left, those of one place beside each other.
    fn collect(&mut self, blockers: &[Blocker], shaft: &Shaft) {
        self.edges.clear();
        for (triangle, blocker) in blockers.iter().enumerate().filter(|(index, _)| self.alive[*index]) {
            let [a, b, c] = blocker.corners;
            for (from, to) in [(a, b), (b, c), (c, a)] {
                // Adding 0 makes both zeros one.
                let [f, t] = [from, to].map(|end| (end + 0.0).to_array().map(f64::to_bits));
                let (ends, direction) = if f <= t { ([f, t], 1) } else { ([t, f], -1) };
                self.edges.push(Edge { ends, triangle, direction, inside: meets(shaft, from, to) });
            }
        }
        self.edges.sort_unstable_by_key(|edge| (edge.ends, edge.triangle, edge.direction));
    }

    /// Leaves out triangles with a border inside the shaft until there are none.
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

    /// Whether a segment between the fronts surely crosses what is left: one of a few, since each may meet an edge.
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
                // Far beyond rounding.
                let least = 1e-9 * sides.iter().map(|side| side.abs()).sum::<f64>();
                sides.iter().all(|side| *side > least) || sides.iter().all(|side| *side < -least)
            })
        })
    }
}

/// Whether the plane of a triangle has the first side strictly in front and the second behind, or for a negative sign the other way
/// round.
fn separates(blocker: &Blocker, pair: &Pair, shaft: &Shaft, sign: f64) -> bool {
    let [a, b, c] = blocker.corners;
    let normal = sign * (b - a).cross(c - a).normalize_or_zero();
    let slack = slack(shaft, &blocker.corners);
    let [first, second] = &pair.sides;
    let height = |corner: &DVec3| normal.dot(*corner - a);
    first.front.corners().iter().all(|corner| height(corner) > slack)
        && second.front.corners().iter().all(|corner| height(corner) < -slack)
}

/// Whether a segment has a point inside the shaft; as for triangles, touching its surface does not count.
fn meets(shaft: &Shaft, from: DVec3, to: DVec3) -> bool {
    let slack = slack(shaft, &[from, to]);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (normal, offset) in shaft.faces() {
        let (start, end) = (normal.dot(from) - offset + slack, normal.dot(to) - offset + slack);
        if start >= 0.0 && end >= 0.0 {
            return false;
        }
        if start > 0.0 {
            enter = enter.max(start / (start - end) - 1e-12);
        } else if end > 0.0 {
            leave = leave.min(start / (start - end) + 1e-12);
        }
    }
    enter <= leave
}

fn slack(shaft: &Shaft, points: &[DVec3]) -> f64 {
    shaft.slack(points.iter().fold(0.0, |size, point| size.max(point.abs().max_element())))
}
