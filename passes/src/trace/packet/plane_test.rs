//! Decides, for occlusion rays whose lines pass through a triangle, whether they meet it between `t_min` and `t_max`: without a division,
//! in `f32`, with a bound on the error.
//!
//! The distance at which a ray meets the plane of a triangle is `n · (a - o) / n · d`. By the watertight test, the ray is stopped if this
//! distance, computed in `f64` and clamped to the distances of the triangle's bounds by the slab test, lies between `t_min` and `t_max`.
//! The same follows from the signs of two numbers:
//!
//! * `p = n · (a - o) - t_min n · d`,
//! * `q = n · d - n · (a - o) / t_max`:
//!
//! both positive or both negative for a hit. Let `n` be scaled to a largest component of 1, `u` be 2⁻²⁴, and `R` the sum, over the axes, of
//! the largest distances of the scene's bounds from the origin. In `f32`, `n · (a - o)` errs by at most 18 u R and, for a unit direction,
//! `n · d` by 18 u. The watertight test may accept a ray whose line misses the triangle by 10 u R along two axes, so the bounds that it
//! clamps the distance to may be those of a plane that is 25 u R away; rounding makes them 3 u wider, and the conversion of the distance
//! from `f64` adds 1 u. Where `p` and `q` are farther from 0 than [`DOUBT`] times the units `u R` and `u`, these errors do not change the
//! verdict, and the watertight test agrees. All other rays go to the watertight test. `t_max` may be infinite; then `q` is `n · d`.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::prepared_packet::PreparedPacket;
use crate::trace::rounding::{DOUBT, THIN, UNIT_ROUNDOFF, Verdict};
use crate::trace::simd::Simd;
use glam::DVec3;

/// The plane of a triangle.
pub(crate) struct TrianglePlane {
    /// Normal with largest component 1; NaN for a thin triangle, which makes all rays undecided.
    normal: [f32; 3],
    corner: [f32; 3],
}

impl TrianglePlane {
    #[inline(always)]
    pub(crate) fn new(corners: &[[f32; 3]; 3]) -> Self {
        let point = |p: &[f32; 3]| DVec3::new(p[0].into(), p[1].into(), p[2].into());
        let [a, b, c] = [point(&corners[0]), point(&corners[1]), point(&corners[2])];
        let (b, c) = (b - a, c - a);
        let normal = b.cross(c);
        let longest = b.abs().max(c.abs()).max_element();
        let most = normal.abs().max_element();
        let scale = if most >= THIN * (longest * longest) { 1.0 / most } else { f64::NAN };
        Self { normal: (normal * scale).as_vec3().to_array(), corner: corners[0] }
    }

    /// The certain verdicts on sixteen rays whose lines pass through the triangle. Comparisons with NaN are false, so they decide nothing.
    #[inline(always)]
    pub(crate) fn decide<S: Simd>(&self, simd: S, packet: &PreparedPacket) -> Verdict {
        let (origin, direction, t_min, shortness, doubt) = packet.decided_by();
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
        // If a ray is parallel to the plane within the error bound, the watertight test clamps its distance and may find a hit: no certain miss.
        let meets = simd.wide_below(parallel, slope) | simd.wide_below(slope, simd.wide_sub(zero, parallel));
        Verdict { hit: above_p & above_q | below_p & below_q, miss: (above_p & below_q | below_p & above_q) & meets }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::packet::octant::Octants;
    use crate::trace::ray::{PACKET, Packet};
    use crate::trace::simd::{NO_LANES, Plain, WIDE};
    use crate::trace::single::{QueuedRays as _, decide};
    use crate::trace::tree::{Bounds, Leaf, Line, PreparedRay};
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

    /// Counts of rays, of certain verdicts, and of verdicts that the watertight test contradicts.
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

    /// Tallies of the test of sixteen rays and a triangle, and of the test of a ray and a leaf. The rays start and end near triangles of
    /// many sizes and orientations. The error bounds are scaled by `doubt`.
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
            // Every fifth main direction is nearly parallel to the triangle.
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
            let mut leaf = Leaf::EMPTY;
            leaf.set(0, corners, 7);
            let octants = Octants::of(&packet);
            let mut left = octants.valid();
            while left != NO_LANES {
                let octant = octants.get(left.trailing_zeros() as usize);
                let lanes = left & octants.lanes(octant);
                left &= !lanes;
                let mut shaken = PreparedPacket::EMPTY;
                shaken.prepare(Plain, &packet, (lanes, octant), &scene);
                let prepared = shaken;
                shaken.scale_doubt(doubt);
                for lane in (0..WIDE).filter(|lane| shaken.passing(Plain, &leaf.corners(0)) >> lane & 1 == 1) {
                    let alone = PreparedRay::new(&packet.ray(lane), &scene).unwrap();
                    assert_eq!(prepared.prepared(lane), alone);
                    let mut limit = t_max;
                    let met = leaf.intersect(Plain, &alone, &mut limit, |found, _, _| found.t < t_max);
                    tallies[0].count(TrianglePlane::new(&leaf.corners(0)).decide(Plain, &shaken), lane, met);
                    let line = Line { doubt: alone.line.doubt * doubt, ..alone.line };
                    tallies[1].count(decide(Plain, &leaf, &line), 0, met);
                }
            }
        }
        tallies
    }

    #[test]
    fn what_is_certain_is_what_the_watertight_test_finds() {
        for Tally { rays, certain, wrong_hits, wrong_misses } in tally(1.0) {
            assert_eq!((wrong_hits, wrong_misses), (0, 0));
            // Half of the rays start or end within a millionth of the plane, where few verdicts can be certain.
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
