//! Whether rays that pass through a triangle meet it between `t_min` and `t_max`, without the distance: an estimate in `f32`
//! with a bound on its error, for rays that ask only whether something is in the way.
//!
//! The distance at which a ray meets the plane of a triangle is `n · (a - o) / n · d`. The answer of the watertight test is
//! that this distance, computed in `f64` and kept within the triangle's bounds as the box test sees them, lies between
//! `t_min` and `t_max`. It is the sign of two numbers, without a division:
//!
//! * `p = n · (a - o) - t_min n · d`,
//! * `q = n · d - n · (a - o) / t_max`:
//!
//! both positive or both negative for a hit. Let `n` be scaled to a largest component of 1, `u` be 2⁻²⁴, and `R` the sum,
//! over the axes, of the largest distances of the scene's bounds from the origin. In `f32` the first product is off by at most
//! 18 u R, and the second, for a unit direction, by 18 u. The watertight test takes a ray to pass through the triangle
//! whose line passes it by 10 u R along two axes, so the bounds that it keeps the distance in may be those of a plane
//! that is 25 u R away; rounding makes them 3 u wider, and the conversion of the distance from `f64` adds 1 u. Where `p`
//! and `q` are farther from 0 than [`DOUBT`] times these units, nothing of this matters, and the watertight test agrees.
//! The others are put to it. `t_max` may be infinite; then `q` is `n · d`.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::beam::Beam;
use super::block::Block;
use super::facet::Verdict;
use super::lanes::Simd;
use super::query::{Line, UNIT_ROUNDOFF};
use glam::DVec3;

/// Bound on the error of `p` and `q` in units of `u R`, and of `u`: above the sum of what is named above.
pub(super) const DOUBT: f32 = 64.0;
/// Largest component of a direction that the bounds hold for.
pub(super) const LONGEST: f32 = 1.0 + 1.0e-3;
/// Triangles that are thinner than this share of their length are left to the watertight test: their normal, in `f64`, is
/// less precise than the above has it.
const THIN: f64 = 1.0e-7;

/// The plane of a triangle.
pub(super) struct Face {
    /// Largest component 1, or not a number, with which nothing is certain.
    normal: [f32; 3],
    corner: [f32; 3],
}

impl Face {
    #[inline(always)]
    pub(super) fn new(corners: &[[f32; 3]; 3]) -> Self {
        let point = |p: &[f32; 3]| DVec3::new(p[0].into(), p[1].into(), p[2].into());
        let [a, b, c] = [point(&corners[0]), point(&corners[1]), point(&corners[2])];
        let (b, c) = (b - a, c - a);
        let normal = b.cross(c);
        let longest = b.abs().max(c.abs()).max_element();
        let most = normal.abs().max_element();
        let scale = if most >= THIN * (longest * longest) { 1.0 / most } else { f64::NAN };
        Self { normal: (normal * scale).as_vec3().to_array(), corner: corners[0] }
    }

    /// What is certain of sixteen rays whose lines pass through the triangle. Comparisons with what is not a number are false, so nothing is.
    #[inline(always)]
    pub(super) fn decide<S: Simd>(&self, simd: S, beam: &Beam) -> Verdict {
        let (origin, direction, t_min, shortness, doubt) = beam.decided_by();
        let (mut height, mut slope) = (simd.wide_splat(0.0), simd.wide_splat(0.0));
        for axis in 0..3 {
            let normal = simd.wide_splat(self.normal[axis]);
            let to = simd.wide_sub(simd.wide_splat(self.corner[axis]), simd.wide_load(&origin[axis]));
            height = simd.wide_about_mul_add(normal, to, height);
            slope = simd.wide_about_mul_add(normal, simd.wide_load(&direction[axis]), slope);
        }
        let zero = simd.wide_splat(0.0);
        let shortness = simd.wide_splat(shortness);
        let p = simd.wide_sub(height, simd.wide_mul(simd.wide_splat(t_min), slope));
        let q = simd.wide_sub(slope, simd.wide_mul(height, shortness));
        let parallel = simd.wide_splat(DOUBT * UNIT_ROUNDOFF);
        let of_p = simd.wide_load(doubt);
        let of_q = simd.wide_about_mul_add(of_p, shortness, parallel);
        let (minus_p, minus_q) = (simd.wide_sub(zero, of_p), simd.wide_sub(zero, of_q));
        let (above_p, below_p) = (simd.wide_below(of_p, p), simd.wide_below(p, minus_p));
        let (above_q, below_q) = (simd.wide_below(of_q, q), simd.wide_below(q, minus_q));
        // Where a ray is parallel to the plane the distance is no number, and the bounds decide.
        let meets = simd.wide_below(parallel, slope) | simd.wide_below(slope, simd.wide_sub(zero, parallel));
        Verdict { hit: above_p & above_q | below_p & below_q, miss: (above_p & below_q | below_p & above_q) & meets }
    }
}

/// Sums of squared edges, and bounds, between which nothing underflows or overflows that matters.
const SMALLEST: f32 = 1.0e-25;
const LARGEST: f32 = 1.0e25;

/// What is certain of a ray whose line passes through triangles of a block.
///
/// Here the normal `n` is the product of two edges, in `f32` and not scaled. With `w` half the sum of their squares, which is at least
/// the product of their lengths and so any component of `n`, a component errs by 4 u w, the first product of the two above by 8 u w R
/// and the second by 13 u w: less than what is counted for the scaled normal, times `w`. The other terms scale with `n`, at most `w`.
#[inline(always)]
pub(super) fn decide<S: Simd>(simd: S, block: &Block, line: &Line) -> Verdict {
    let zero = simd.splat(0.0);
    let (mut edges, mut to, mut square) = ([[zero; 3]; 2], [zero; 3], zero);
    for axis in 0..3 {
        let [a, b, c] = block.coordinates(simd, axis);
        to[axis] = simd.sub(a, simd.splat(line.origin[axis]));
        for (edge, corner) in [b, c].into_iter().enumerate() {
            let along = simd.sub(corner, a);
            square = simd.about_mul_add(along, along, square);
            edges[edge][axis] = along;
        }
    }
    let (mut height, mut slope) = (zero, zero);
    for axis in 0..3 {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        let [b, c] = &edges;
        let normal = simd.sub(simd.mul(b[next], c[last]), simd.mul(b[last], c[next]));
        height = simd.about_mul_add(normal, to[axis], height);
        slope = simd.about_mul_add(normal, simd.splat(line.direction[axis]), slope);
    }
    let shortness = simd.splat(line.shortness);
    let p = simd.sub(height, simd.mul(simd.splat(line.t_min), slope));
    let q = simd.sub(slope, simd.mul(height, shortness));
    let parallel = simd.mul(square, simd.splat(0.5 * DOUBT * UNIT_ROUNDOFF));
    let of_p = simd.mul(square, simd.splat(line.doubt));
    let of_q = simd.about_mul_add(of_p, shortness, parallel);
    let bounded = simd.at_most(simd.splat(SMALLEST), square)
        & simd.at_most(simd.splat(SMALLEST), of_p)
        & simd.at_most(of_p, simd.splat(LARGEST));
    let (above_p, below_p) = (simd.at_most(of_p, p), simd.at_most(p, simd.sub(zero, of_p)));
    let (above_q, below_q) = (simd.at_most(of_q, q), simd.at_most(q, simd.sub(zero, of_q)));
    let meets = simd.at_most(parallel, slope) | simd.at_most(slope, simd.sub(zero, parallel));
    Verdict {
        hit: (above_p & above_q | below_p & below_q) & bounded,
        miss: (above_p & below_q | below_p & above_q) & meets & bounded,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::class::Classes;
    use crate::trace::lanes::{NO_LANES, Plain, WIDE};
    use crate::trace::query::{Bounds, Query};
    use crate::trace::wave::Rays as _;
    use crate::trace::{PACKET, Packet};
    use glam::Vec3;

    struct Random(u64);

    impl Random {
        fn unit(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f32 / 16_777_216.0
        }

        fn cube(&mut self) -> Vec3 {
            Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
        }
    }

    /// Verdicts, and those that the watertight test contradicts.
    #[derive(Debug, Default, Clone, Copy)]
    struct Tally {
        rays: u32,
        certain: u32,
        wrong_hits: u32,
        wrong_misses: u32,
    }

    impl Tally {
        fn count(&mut self, Verdict { hit, miss }: Verdict, lane: usize, met: bool) {
            assert_eq!(hit & miss, NO_LANES);
            self.rays += 1;
            self.certain += (hit | miss) >> lane & 1;
            self.wrong_hits += hit >> lane & u32::from(!met) & 1;
            self.wrong_misses += miss >> lane & u32::from(met) & 1;
        }
    }

    /// Of sixteen rays and a triangle, and of a ray and a block: triangles that start and end near them, of many sizes and angles.
    fn tally(doubt: f32) -> [Tally; 2] {
        let mut random = Random(9);
        let mut tallies = [Tally::default(); 2];
        for round in 0..40_000 {
            let center = random.cube() * [0.0, 1.0, 100.0][round % 3];
            let size = [1.0, 0.01][round % 2];
            let mut corners = [0, 1, 2].map(|_| center + random.cube() * size);
            if round % 7 == 0 {
                corners[2] = corners[0].lerp(corners[1], random.unit()) + random.cube() * 1e-6;
            }
            let scene = Bounds::of(&[center - Vec3::splat(2.0), center + Vec3::splat(2.0)]);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            let main = random.cube();
            // Some nearly in the plane of the triangle.
            let main = if round % 5 == 0 { main - normal * main.dot(normal) * (1.0 - 1e-6) } else { main };
            let near = [1.0, 1e-3, 1e-6, 0.0][round / 3 % 4];
            let (t_min, t_max) = if round % 4 == 0 { (0.5, 0.7) } else { (0.0, [f32::INFINITY, 0.5][round % 2]) };
            let mut packet = Packet::new(t_min, t_max);
            for lane in 0..PACKET {
                let (u, v) = (random.unit(), random.unit());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let target = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
                let direction = (main + random.cube() * 1e-3).normalize_or(Vec3::X);
                let end = if lane % 2 == 0 || t_max == f32::INFINITY { t_min } else { t_max };
                let distance = end + (random.unit() * 2.0 - 1.0) * near;
                packet.set(lane, target - direction * distance, direction);
            }
            let mut block = Block::EMPTY;
            block.set(0, corners, 7);
            let classes = Classes::of(&packet);
            let mut left = classes.valid();
            while left != NO_LANES {
                let class = classes.get(left.trailing_zeros() as usize);
                let lanes = left & classes.lanes(class);
                left &= !lanes;
                let mut beam = Beam::EMPTY;
                beam.prepare(Plain, &packet, (lanes, class), &scene);
                let prepared = beam;
                beam.scale_doubt(doubt);
                for lane in (0..WIDE).filter(|lane| beam.passing(Plain, &block.corners(0)) >> lane & 1 == 1) {
                    let query = Query::new(&packet.ray(lane), &scene).unwrap();
                    assert_eq!(prepared.query(lane), query);
                    let mut limit = t_max;
                    let met = block.intersect(Plain, &query, &mut limit, |found, _, _| found.t < t_max);
                    tallies[0].count(Face::new(&block.corners(0)).decide(Plain, &beam), lane, met);
                    let line = Line { doubt: query.line.doubt * doubt, ..query.line };
                    tallies[1].count(decide(Plain, &block, &line), 0, met);
                }
            }
        }
        tallies
    }

    #[test]
    fn what_is_certain_is_what_the_watertight_test_finds() {
        for Tally { rays, certain, wrong_hits, wrong_misses } in tally(1.0) {
            assert_eq!((wrong_hits, wrong_misses), (0, 0));
            // Half of the rays start or end within a millionth of the plane: of those, little can be certain.
            assert!(rays > 300_000 && certain > rays / 3, "{certain} of {rays}");
        }
    }

    #[test]
    fn without_the_bound_the_estimate_contradicts_the_watertight_test() {
        for tally in tally(1.0e-4) {
            assert!(tally.wrong_hits > 100 && tally.wrong_misses > 100, "{tally:?}");
        }
    }
}
