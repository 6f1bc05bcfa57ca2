//! Estimated ray origins: approximations in `f32`, with an error bound, of the origins that
//! [`SurfacePoint::spawn`](crate::trace::SurfacePoint::spawn) gives for positions near visible triangles. They serve tests whose result is
//! the same for all origins within the bound.
//!
//! Let `q` be a position relative to a centre, `n` the unit normal of a triangle's plane, `h` the height of `q` above it, and `L` the
//! distance that rays are moved off the plane. `L` is a linear function of the barycentric coordinates, except for its part from the
//! largest distance to a corner. The origin is `q + (L - h) n`: two dot products with vectors that are the same for all positions on a
//! triangle. With `u` = 2⁻²⁴, `E` the largest `|q|` by axis, and `Q` a bound of `|L - h|`, the error of an estimate along an axis is the
//! sum of
//!
//! * 2 u times the largest coordinate, for the exact origin, which is rounded twice;
//! * 2 u E for `q` and the sum;
//! * `|n|` times the sum of 9 u Q for the two products and their coefficients, 3 u L for the exact offset, and [`OFFSET_UNITS`] u
//!   [`OFFSET_REACH`] / 4 of the triangle's extent: the distance to a corner is taken as the middle of its range, which is half the extent
//!   wide.
//!
//! The code uses a bound about twice as large. It holds on two conditions: the projection of the position is farther from the triangle's
//! borders than rays are moved inward, and the triangle is wide enough that `f64` loses less than `f32` does. Other positions get no
//! estimate.

use super::list::List;
use super::projection::ProjectedRays;
use crate::trace::origin::{double, higher, largest, unit_or_zero};
use crate::trace::ray::{PACKET, TOGETHER};
use crate::trace::rounding::{
    COORDINATES_ERROR, OFFSET_MARGIN, OFFSET_REACH, OFFSET_UNITS, SHIFT_ERROR, THIN_SQUARE, UNIT_ROUNDOFF,
};
use crate::trace::simd::{F16, LANES, Mask, Simd};
use glam::Vec3;
use std::slice::from_mut;

/// Rays of one direction whose origins are known within an error bound, and the triangle that each leaves.
#[derive(Debug, Clone, Default)]
pub struct Estimates {
    /// Estimated origins, relative to the centre.
    pub(crate) origin: [[F16; 3]; TOGETHER],
    /// Id of the triangle that each ray leaves; a ray never hits that triangle.
    pub(crate) triangle: [[u32; PACKET]; TOGETHER],
    /// The rays that have an estimate, one bit a ray.
    pub(crate) valid: [u16; TOGETHER],
    pub(crate) center: Vec3,
    /// Bound on the error of the origins, by axis.
    pub(crate) error: Vec3,
    pub(crate) direction: Vec3,
}

/// Decisions about rays, one bit a ray, and buffers for making them.
#[derive(Debug, Default)]
pub struct Decided {
    /// Rays that are certainly blocked.
    pub stopped: [u16; TOGETHER],
    /// Rays that are certainly not blocked.
    pub open: [u16; TOGETHER],
    pub(crate) list: List,
    pub(crate) seen: [ProjectedRays; TOGETHER],
}

impl Decided {
    /// Marks all rays as undecided.
    pub fn clear(&mut self) {
        (self.stopped, self.open) = ([0; TOGETHER], [0; TOGETHER]);
    }
}

/// Sixteen triangles, with the coefficients of the estimates on them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Faces {
    /// Unit normals, those of [`SurfacePoint`](crate::trace::SurfacePoint), on the side of the light.
    pub(crate) normal: [F16; 3],
    /// Coefficients `(cx, cy, cz, c1)`: a position `q` relative to the centre is moved by `cx q.x + cy q.y + cz q.z + c1` along the normal.
    shift: [F16; 4],
    /// Coefficients, of the same form, of the barycentric coordinates of corners 1 and 2.
    shares: [[F16; 4]; 2],
    /// Least barycentric coordinate of a position that is far enough from the borders; infinite for thin triangles.
    least: F16,
    /// Error along the normal, in units of [`UNIT_ROUNDOFF`].
    units: F16,
}

impl Faces {
    /// Sets half 0 or 1 of the sixteen triangles from their corners, for positions within `extent` of the centre along each axis.
    ///
    /// Let `a` be corner 0 relative to the centre, `e₁` and `e₂` the edges from it, `N = e₁ x e₂`, `n = N / |N|` on the side of the light,
    /// and `q` a position relative to the centre. Then
    ///
    /// * the barycentric coordinates are `u = U · (q - a)`, `U = (e₂ x N) / N²`, and `v = V · (q - a)`, `V = (N x e₁) / N²`;
    /// * the height above the plane is `n · (q - a)`;
    /// * the offset is `L = k (|n| · (|a₀| + u |e₁| + v |e₂|) + r REACH)`, with `k = UNITS u` and `a₀` corner 0 in the world. `r`, the
    ///   distance to the farthest corner, is replaced by the middle of its range, `3/4` of the extent.
    ///
    /// So the shift `L - n · (q - a)` is linear in `q`: its gradient is `k (|n| · |e₁| U + |n| · |e₂| V) - n`.
    #[inline(always)]
    pub(crate) fn set(&mut self, [a, b, c]: &[[F16; 3]; 3], half: usize, light: Vec3, (center, extent): (Vec3, Vec3)) {
        let (light, center, extent) = (light.as_dvec3(), center.as_dvec3(), extent.as_dvec3());
        let unit = f64::from(UNIT_ROUNDOFF);
        let units = f64::from(OFFSET_UNITS) * unit;
        let (mut normals, mut shifts, mut shares) = ([[0.0; LANES]; 3], [[0.0; LANES]; 4], [[[0.0; LANES]; 4]; 2]);
        let (mut leasts, mut errors) = ([0.0; LANES], [0.0; LANES]);
        // A loop of fixed length over arrays is vectorised.
        for lane in 0..LANES {
            let of = half * LANES + lane;
            let [a, b, c] = [double(a, of), double(b, of), double(c, of)];
            let (e1, e2) = (b - a, c - a);
            let e3 = e2 - e1;
            let cross = e1.cross(e2);
            let area = cross.dot(cross);
            let longest = higher(higher(e1.dot(e1), e2.dot(e2)), e3.dot(e3));
            let normal = unit_or_zero(cross);
            let normal = normal * if normal.dot(light) < 0.0 { -1.0 } else { 1.0 };
            let (tall, long1, long2) = (normal.abs(), e1.abs(), e2.abs());
            let reciprocal = 1.0 / area;
            let (u, v) = (e2.cross(cross) * reciprocal, cross.cross(e1) * reciprocal);
            let size = higher(higher(largest(long1), largest(long2)), largest(e3.abs()));
            let from = a - center;
            let shift = units * (tall.dot(long1) * u + tall.dot(long2) * v) - normal;
            let constant = units * (tall.dot(a.abs()) + 0.75 * OFFSET_REACH * size) - shift.dot(from);
            let (of_u, of_v) = (u.dot(from), v.dot(from));
            let height = shift.abs().dot(extent) + constant.abs();
            let margin = OFFSET_MARGIN * unit * (largest(a.abs() + long1 + long2) + OFFSET_REACH * size);
            let of_shares = (u.abs() + v.abs()).dot(extent) + of_u.abs() + of_v.abs();
            let least = 1.5 * margin * (longest * reciprocal).sqrt() + 16.0 * unit * of_shares;
            let error = 0.5 * f64::from(OFFSET_UNITS) * OFFSET_REACH * size + SHIFT_ERROR * height;
            let is_broad = area > THIN_SQUARE * longest * longest;
            for axis in 0..3 {
                normals[axis][lane] = normal[axis] as f32;
                shifts[axis][lane] = shift[axis] as f32;
                shares[0][axis][lane] = u[axis] as f32;
                shares[1][axis][lane] = v[axis] as f32;
            }
            shifts[3][lane] = constant as f32;
            shares[0][3][lane] = -of_u as f32;
            shares[1][3][lane] = -of_v as f32;
            leasts[lane] = if is_broad { least as f32 } else { f32::INFINITY };
            errors[lane] = if is_broad { error as f32 } else { 0.0 };
        }
        set_half(&mut self.normal, half, &normals);
        set_half(&mut self.shift, half, &shifts);
        for (own, shares) in self.shares.iter_mut().zip(&shares) {
            set_half(own, half, shares);
        }
        set_half(from_mut(&mut self.least), half, &[leasts]);
        set_half(from_mut(&mut self.units), half, &[errors]);
    }

    /// Error bound, by axis, of estimates on any of the triangles `of`.
    #[inline(always)]
    pub(crate) fn error<S: Simd>(&self, simd: S, of: Mask, center: Vec3, extent: Vec3) -> Vec3 {
        let zero = simd.wide_splat(0.0);
        let mut error = (center.abs() + 2.0 * extent) * (COORDINATES_ERROR * UNIT_ROUNDOFF);
        let units = simd.wide_mul(simd.wide_load(&self.units), simd.wide_splat(UNIT_ROUNDOFF));
        for axis in 0..3 {
            let along = simd.wide_mul(simd.wide_abs(simd.wide_load(&self.normal[axis])), units);
            error[axis] += simd.wide_most(simd.wide_select(of, along, zero));
        }
        error
    }
}

impl Estimates {
    /// Replaces the positions of some rays (a mask for each packet) by estimated origins. All these positions lie on the triangle in lane
    /// `lane` of `faces`; positions near a border get no estimate. Returns whether any ray got one.
    #[inline(always)]
    pub(crate) fn estimate<S: Simd>(
        &mut self,
        simd: S,
        rays: &[u16; TOGETHER],
        (faces, lane): (&Faces, usize),
    ) -> bool {
        let least = simd.wide_splat(faces.least.0[lane]);
        let (mut packets, mut any) = (0_u32, 0);
        for (packet, rays) in rays.iter().enumerate() {
            packets |= u32::from(*rays != 0) << packet;
        }
        while packets != 0 {
            let packet = packets.trailing_zeros() as usize % TOGETHER;
            packets &= packets - 1;
            let origin = &mut self.origin[packet];
            let position = [simd.wide_load(&origin[0]), simd.wide_load(&origin[1]), simd.wide_load(&origin[2])];
            let u = linear(simd, &faces.shares[0], lane, &position);
            let v = linear(simd, &faces.shares[1], lane, &position);
            let w = simd.wide_sub(simd.wide_splat(1.0), simd.wide_add(u, v));
            let inside =
                simd.wide_at_most(least, simd.wide_min_or(simd.wide_min_or(u, v), w)) & Mask::from(rays[packet]);
            let shift = linear(simd, &faces.shift, lane, &position);
            for axis in 0..3 {
                let normal = simd.wide_splat(faces.normal[axis].0[lane]);
                let moved = simd.wide_about_mul_add(normal, shift, position[axis]);
                origin[axis] = simd.wide_store(simd.wide_select(inside, moved, position[axis]));
            }
            self.valid[packet] |= inside as u16;
            any |= inside;
        }
        any != 0
    }
}

/// Sets half 0 or 1 of some vectors.
#[inline(always)]
fn set_half(vectors: &mut [F16], half: usize, values: &[[f32; LANES]]) {
    for (vector, values) in vectors.iter_mut().zip(values) {
        vector.0.as_chunks_mut().0[half] = *values;
    }
}

/// `(position, 1) · factors`, with the factors of one lane.
#[inline(always)]
fn linear<S: Simd>(simd: S, factors: &[F16; 4], lane: usize, position: &[S::Wide; 3]) -> S::Wide {
    let mut sum = simd.wide_splat(factors[3].0[lane]);
    for axis in 0..3 {
        sum = simd.wide_about_mul_add(simd.wide_splat(factors[axis].0[lane]), position[axis], sum);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::simd::{Detected, InstructionSet, Kernel, vector_at};
    use crate::trace::{Bvh, Quality, Ray, SurfacePoint, Tracer as _};
    use curitiba_pipeline::scene::{Batch, Geometry};

    struct Random(u32);

    impl Random {
        fn signed(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (self.0 >> 8) as f32 / 8_388_608.0 - 1.0
        }

        fn vector(&mut self) -> Vec3 {
            Vec3::new(self.signed(), self.signed(), self.signed())
        }
    }

    /// Computes estimates for sixteen positions on each of sixteen triangles.
    struct Estimate<'a> {
        geometry: &'a Geometry,
        positions: &'a [[Vec3; PACKET]; TOGETHER],
        light: Vec3,
    }

    impl Kernel<Estimates> for Estimate<'_> {
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Estimates {
            let Self { geometry, positions, light } = self;
            let mut estimates = Estimates { direction: light, center: positions[0][0], ..Estimates::default() };
            let (mut corners, mut extent) = ([[F16::ZERO; 3]; 3], Vec3::ZERO);
            for (packet, positions) in positions.iter().enumerate() {
                for (corner, point) in geometry.corners(packet as u32).into_iter().enumerate() {
                    for axis in 0..3 {
                        corners[corner][axis].0[packet] = point[axis];
                    }
                }
                for (lane, position) in positions.iter().enumerate() {
                    let from = *position - estimates.center;
                    extent = extent.max(from.abs());
                    for axis in 0..3 {
                        estimates.origin[packet][axis].0[lane] = from[axis];
                    }
                }
            }
            let mut faces = Faces::default();
            for half in 0..2 {
                faces.set(&corners, half, light, (estimates.center, extent));
            }
            estimates.error = faces.error(simd, Mask::from(u16::MAX), estimates.center, extent);
            for packet in 0..TOGETHER {
                let mut rays = [0; TOGETHER];
                rays[packet] = u16::MAX;
                estimates.estimate(simd, &rays, (&faces, packet));
            }
            estimates
        }
    }

    /// Triangles of many sizes and shapes around a point, and positions on them, many near borders and some off the plane.
    fn case(round: usize, random: &mut Random) -> (Geometry, [[Vec3; PACKET]; TOGETHER]) {
        let scale = [1.0, 1e-3, 1e3][round % 3];
        let middle = random.vector() * scale * [0.0, 1.0, 30.0, 1e3][round % 4];
        let flat = round.is_multiple_of(5);
        let mut geometry = Geometry::default();
        let positions = std::array::from_fn(|index| {
            let size = scale * [1.0, 0.1, 10.0][index % 3];
            let center = middle + random.vector() * scale;
            let mut corners = [0, 1, 2].map(|_| center + random.vector() * size);
            if index % 8 == 7 {
                corners[2] = corners[0].midpoint(corners[1]) + random.vector() * size * [1e-2, 1e-4][round % 2];
            }
            if flat {
                corners = corners.map(|corner| Vec3::new(corner.x, middle.y, corner.z));
            }
            geometry.positions.extend(corners);
            geometry.triangles.push([0, 1, 2].map(|corner| (3 * index + corner) as u32));
            let [a, b, c] = corners;
            std::array::from_fn(|lane| {
                let near = [1.0, 1e-3, 1e-5, 1e-6][lane % 4];
                let u = random.signed().abs() * near;
                let v = random.signed().abs() * (1.0 - u) * [1.0, 1e-5][lane / 4 % 2];
                let off = [0.0, 1e-7, 1e-4, 1e-2][lane / 8 * 2 + lane % 2];
                a + (b - a) * u + (c - a) * v + random.vector() * size * off
            })
        });
        (geometry, positions)
    }

    #[test]
    fn exact_origins_are_no_farther_than_the_error_of_estimates() {
        let (mut of, mut valid, mut most) = (0, 0, 0.0_f64);
        for simd in [InstructionSet::Avx512, InstructionSet::Avx2, InstructionSet::Portable]
            .into_iter()
            .filter_map(Detected::new)
        {
            let mut random = Random(11);
            for round in 0..600 {
                let (geometry, positions) = case(round, &mut random);
                let light = random.vector().normalize();
                let estimates = simd.run(Estimate { geometry: &geometry, positions: &positions, light });
                for (packet, positions) in positions.iter().enumerate() {
                    for (lane, position) in positions.iter().enumerate() {
                        of += 1;
                        let point = SurfacePoint::snap(&geometry, packet as u32, *position);
                        if estimates.valid[packet] >> lane & 1 == 0 || point.normal.dot(light).abs() < 1e-4 {
                            continue;
                        }
                        valid += 1;
                        assert!(!point.is_drawn_in(), "{simd:?}, round {round}: {point:?}");
                        let from = vector_at(&estimates.origin[packet], lane).as_dvec3();
                        let off = (estimates.center.as_dvec3() + from - point.spawn(light).as_dvec3()).abs();
                        let share = (off / estimates.error.as_dvec3()).max_element();
                        assert!(share < 1.0, "{simd:?}, round {round}: {off} of {}, {point:?}", estimates.error);
                        most = most.max(share);
                    }
                }
            }
        }
        assert!(valid * 5 > of, "{valid} of {of} have an estimate");
        assert!((0.1..0.8).contains(&most), "the largest error is {most} of the bound");
    }

    /// For origins that are off by up to `off` where the error bound `error` is given: the number of verdicts, and how many of them the
    /// exact rays contradict.
    fn verdicts(off: f32, error: f32) -> (u32, u32) {
        let mut random = Random(7);
        let mut geometry = Geometry::default();
        for index in 0..400 {
            let center = random.vector() * 2.0;
            geometry.positions.extend([0, 1, 2].map(|_| center + random.vector() * 0.5));
            geometry.triangles.push([3 * index, 3 * index + 1, 3 * index + 2]);
        }
        geometry.batches.push(Batch { material: 0, first: 0, count: 400 });
        let tree = Bvh::build(&geometry, &[], Quality::default());
        let (mut certain, mut wrong) = (0, 0);
        for _ in 0..60 {
            let direction = random.vector().normalize();
            let mut estimates = Estimates {
                direction,
                center: random.vector(),
                error: Vec3::splat(error),
                triangle: [[u32::MAX; PACKET]; TOGETHER],
                valid: [u16::MAX; TOGETHER],
                ..Estimates::default()
            };
            let mut origins = [[Vec3::ZERO; PACKET]; TOGETHER];
            for (packet, origins) in origins.iter_mut().enumerate() {
                let near = estimates.center + random.vector() * 0.3;
                for (lane, origin) in origins.iter_mut().enumerate() {
                    *origin = near + random.vector() * 0.05;
                    let from = *origin - estimates.center + random.vector() * off;
                    for axis in 0..3 {
                        estimates.origin[packet][axis].0[lane] = from[axis];
                    }
                }
            }
            let mut decided = Decided::default();
            tree.decide(&estimates, &mut decided);
            for (packet, origins) in origins.iter().enumerate() {
                for (lane, &origin) in origins.iter().enumerate() {
                    let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
                    let stopped = tree.occluded(&ray, |_| true);
                    let [said_stopped, said_open] =
                        [decided.stopped, decided.open].map(|lanes| lanes[packet] >> lane & 1 == 1);
                    assert!(!(said_stopped && said_open));
                    certain += u32::from(said_stopped || said_open);
                    wrong += u32::from(said_stopped && !stopped || said_open && stopped);
                }
            }
        }
        (certain, wrong)
    }

    #[test]
    fn what_is_certain_of_estimates_is_so_of_all_origins_within_the_error() {
        let (certain, wrong) = verdicts(2e-3, 2.001e-3);
        assert!(certain > 4000 && wrong == 0, "{wrong} of {certain} are wrong");
        let (certain, wrong) = verdicts(2e-3, 0.0);
        assert!(wrong > 20, "without the error {wrong} of {certain} are wrong");
    }
}
