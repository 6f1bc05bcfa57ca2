//! Segments between the triangles of a pair, and what blocks them.

use super::points::{REPLICATES, Table, seeds};
use super::shaft::{Blocker, Pair};
use crate::trace::{Detected, Kernel, Simd};
use glam::DVec3;
use std::f64::consts::PI;

/// Segments that are tested together: eight of each replicate.
pub(super) const BATCH: usize = 8 * REPLICATES;
/// Number of blockers after which it is checked whether any segment is still open.
const LOOK: usize = 8;

/// Segments by axis, relative to the pair's origin. The lane of a segment is `8 replicate + point`.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct Batch {
    pub(super) from: [[f64; BATCH]; 3],
    pub(super) to: [[f64; BATCH]; 3],
    /// What a segment carries: `cos cos / (π r²)` between uniform points; `Sampling::towards` sets other weights.
    pub(super) weight: [f64; BATCH],
    /// 1 where a segment leaves both fronts, else 0.
    pub(super) valid: [u64; BATCH],
    /// 1 where the segment is blocked; meaningless where `valid` is 0.
    pub(super) blocked: [u64; BATCH],
}

impl Default for Batch {
    fn default() -> Self {
        Self {
            from: [[0.0; BATCH]; 3],
            to: [[0.0; BATCH]; 3],
            weight: [0.0; BATCH],
            valid: [0; BATCH],
            blocked: [0; BATCH],
        }
    }
}

impl Batch {
    /// Fills the batch with points `first` to `first + 8` of every replicate, from sets of `points` points; lanes with points beyond the
    /// set are marked as not valid.
    pub(super) fn fill(&mut self, table: &Table, pair: &Pair, (key, seed): ([u32; 2], u32), first: u32, points: u32) {
        Detected::cached().run(Fill { batch: self, table, pair, key, seed, first, points });
    }

    /// Puts a segment into a lane.
    pub(super) fn set(&mut self, lane: usize, from: DVec3, to: DVec3) {
        for axis in 0..3 {
            self.from[axis][lane] = from[axis];
            self.to[axis][lane] = to[axis];
        }
        self.valid[lane] = 1;
    }

    /// The ends of a segment.
    pub(super) fn get(&self, lane: usize) -> [DVec3; 2] {
        [&self.from, &self.to].map(|ends| DVec3::new(ends[0][lane], ends[1][lane], ends[2][lane]))
    }

    /// Computes which segments are blocked.
    pub(super) fn block(&mut self, blockers: &[Blocker]) {
        self.block_first::<BATCH>(blockers);
    }

    /// As [`Self::block`], for the first `LANES` lanes only.
    pub(super) fn block_first<const LANES: usize>(&mut self, blockers: &[Blocker]) {
        self.blocked = [0; BATCH];
        for some in blockers.chunks(LOOK) {
            Detected::cached().run(Block::<LANES> { batch: self, blockers: some });
            let both = self.valid[..LANES].iter().zip(&self.blocked);
            let open: u64 = both.map(|(valid, blocked)| valid & !blocked).sum();
            if open == 0 {
                return;
            }
        }
    }
}

struct Fill<'a> {
    batch: &'a mut Batch,
    table: &'a Table,
    pair: &'a Pair,
    key: [u32; 2],
    seed: u32,
    first: u32,
    points: u32,
}

impl Kernel<()> for Fill<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { batch, table, pair, key, seed, first, points } = self;
        let [a, b] = &pair.sides;
        for replicate in 0..REPLICATES {
            let seeds = seeds(key, seed, replicate as u32);
            let axes = [0, 1, 2, 3].map(|d: usize| table.eight(d, first as usize, points, seeds[d]));
            place([&axes[0], &axes[1]], &a.start, 8 * replicate, &mut batch.from);
            place([&axes[2], &axes[3]], &b.start, 8 * replicate, &mut batch.to);
        }
        let (n, m) = (a.normal, b.normal);
        for lane in 0..BATCH {
            let x = batch.to[0][lane] - batch.from[0][lane];
            let y = batch.to[1][lane] - batch.from[1][lane];
            let z = batch.to[2][lane] - batch.from[2][lane];
            let leaving = n.x * x + n.y * y + n.z * z;
            let arriving = -(m.x * x + m.y * y + m.z * z);
            let square = x * x + y * y + z * z;
            let valid = (leaving > 0.0) & (arriving > 0.0) & ((lane as u32 & 7) + first < points);
            batch.valid[lane] = u64::from(valid);
            batch.weight[lane] = if valid { leaving * arriving / (PI * square * square) } else { 0.0 };
        }
    }
}

/// Uniform points of a triangle (Osada, Funkhouser, Chazelle and Dobkin, "Shape Distributions", 2002, section 4.2).
#[inline(always)]
fn place([xs, ys]: [&[f64; 8]; 2], &[a, b, c]: &[DVec3; 3], first: usize, points: &mut [[f64; BATCH]; 3]) {
    let (ab, ac) = (b - a, c - a);
    let (mut us, mut vs) = ([0.0; 8], [0.0; 8]);
    for index in 0..8 {
        let root = xs[index].sqrt();
        us[index] = root * (1.0 - ys[index]);
        vs[index] = root * ys[index];
    }
    for axis in 0..3 {
        let points = &mut points[axis][first..first + 8];
        for index in 0..8 {
            points[index] = a[axis] + us[index] * ab[axis] + vs[index] * ac[axis];
        }
    }
}

struct Block<'a, const LANES: usize> {
    batch: &'a mut Batch,
    blockers: &'a [Blocker],
}

impl<const LANES: usize> Kernel<()> for Block<'_, LANES> {
    /// A segment crosses a triangle if its ends are on different sides of the plane and its line passes all edges on the same side. Edges
    /// belong to the triangle, so nothing passes between two triangles that share one.
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { batch, blockers } = self;
        for Blocker { corners: [a, b, c] } in blockers {
            let normal = (*b - *a).cross(*c - *a);
            let offset = normal.dot(*a);
            // Plücker coordinates of the edges.
            let edges = [(*a, *b), (*b, *c), (*c, *a)].map(|(from, to)| (to - from, from.cross(to)));
            for lane in 0..LANES {
                let p = DVec3::new(batch.from[0][lane], batch.from[1][lane], batch.from[2][lane]);
                let q = DVec3::new(batch.to[0][lane], batch.to[1][lane], batch.to[2][lane]);
                let d = q - p;
                let moment = p.cross(q);
                let heights = (normal.dot(p) - offset) * (normal.dot(q) - offset);
                let [x, y, z] = edges.map(|(along, own)| d.dot(own) + moment.dot(along));
                let low = if x < y { x } else { y };
                let low = if z < low { z } else { low };
                let high = if x > y { x } else { y };
                let high = if z > high { z } else { high };
                let crosses = (heights < 0.0) & ((low >= 0.0) | (high <= 0.0));
                batch.blocked[lane] |= u64::from(crosses);
            }
        }
    }
}
