//! Leaves of up to eight triangles, and the tests of their triangles against boxes, planes and balls.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::volumes::{Ball, Plane};
use crate::trace::simd::{F8, LANES, Mask, NO_LANES, Simd};
use glam::Vec3;

/// Flag in the id of a triangle whose hits need the accept closure; the other bits are the id.
pub(crate) const TRANSPARENT: u32 = 1 << 31;

/// Up to eight triangles, structure of arrays. Unused lanes hold NaN, which no comparison accepts.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Leaf {
    /// `[corner][axis]`.
    pub(crate) corners: [[F8; 3]; 3],
    /// Triangle ids, with [`TRANSPARENT`].
    pub(crate) ids: [u32; LANES],
}

impl Leaf {
    pub(crate) const EMPTY: Self = Self { corners: [[F8([f32::NAN; LANES]); 3]; 3], ids: [0; LANES] };

    /// Puts a triangle into a lane.
    pub(crate) fn set(&mut self, lane: usize, corners: [Vec3; 3], id: u32) {
        for (corner, position) in corners.iter().enumerate() {
            for axis in 0..3 {
                self.corners[corner][axis].0[lane] = position[axis];
            }
        }
        self.ids[lane] = id;
    }

    /// The corners of the triangle in a lane.
    #[inline(always)]
    pub(crate) fn corners(&self, lane: usize) -> [[f32; 3]; 3] {
        [self.corner(0, lane), self.corner(1, lane), self.corner(2, lane)]
    }

    /// The coordinates of the three corners of all triangles along an axis; unused lanes hold NaN.
    #[inline(always)]
    pub(crate) fn coordinates<S: Simd>(&self, simd: S, axis: usize) -> [S::Vector; 3] {
        let [a, b, c] = &self.corners;
        [simd.load(&a[axis]), simd.load(&b[axis]), simd.load(&c[axis])]
    }

    /// One coordinate of all triangles, as bits.
    #[inline(always)]
    pub(crate) fn bits(&self, corner: usize, axis: usize) -> &[u32; LANES] {
        bytemuck::cast_ref(&self.corners[corner][axis].0)
    }

    /// The ids of all triangles, with [`TRANSPARENT`].
    #[inline(always)]
    pub(crate) fn ids(&self) -> &[u32; LANES] {
        &self.ids
    }

    /// The id of the triangle in a lane.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> u32 {
        self.ids[lane] & !TRANSPARENT
    }

    /// Whether hits on the triangle in a lane need the accept closure.
    #[inline(always)]
    pub(crate) fn is_transparent(&self, lane: usize) -> bool {
        self.ids[lane] & TRANSPARENT != 0
    }

    /// The lanes in use.
    #[inline(always)]
    pub(crate) fn used<S: Simd>(&self, simd: S) -> Mask {
        let first = simd.load(&self.corners[0][0]);
        simd.at_most(first, first)
    }

    /// Bounds of each triangle, one a lane, `[low, high][axis]`; unused lanes hold NaN.
    #[inline(always)]
    pub(crate) fn bounds<S: Simd>(&self, simd: S) -> [[S::Vector; 3]; 2] {
        let mut bounds = [[simd.splat(0.0); 3]; 2];
        for axis in 0..3 {
            let a = simd.load(&self.corners[0][axis]);
            let b = simd.load(&self.corners[1][axis]);
            let c = simd.load(&self.corners[2][axis]);
            bounds[0][axis] = simd.min_or(simd.min_or(a, b), c);
            bounds[1][axis] = simd.max_or(simd.max_or(a, b), c);
        }
        bounds
    }

    /// The lanes whose bounds meet a box.
    #[inline(always)]
    pub(crate) fn overlapping<S: Simd>(&self, simd: S, low: &[f32; 3], high: &[f32; 3]) -> Mask {
        let zero = simd.splat(0.0);
        // The product is 0, or NaN in unused lanes.
        let mut outside = simd.mul(simd.load(&self.corners[0][0]), zero);
        for axis in 0..3 {
            let a = simd.load(&self.corners[0][axis]);
            let b = simd.load(&self.corners[1][axis]);
            let c = simd.load(&self.corners[2][axis]);
            let above = simd.sub(simd.min_or(simd.min_or(a, b), c), simd.splat(high[axis]));
            let below = simd.sub(simd.splat(low[axis]), simd.max_or(simd.max_or(a, b), c));
            outside = simd.max_or(simd.max_or(above, below), outside);
        }
        simd.at_most(outside, zero)
    }

    /// The lanes whose triangles certainly lie behind a plane or on it: no ray into the half space in front of it hits
    /// them.
    #[inline(always)]
    pub(crate) fn behind<S: Simd>(&self, simd: S, plane: Plane) -> Mask {
        let mut lanes = !NO_LANES;
        for corner in &self.corners {
            let position = [simd.load(&corner[0]), simd.load(&corner[1]), simd.load(&corner[2])];
            lanes &= plane.behind(simd, position, position);
        }
        lanes
    }

    /// The lanes whose triangles' bounds certainly lie outside a ball.
    #[inline(always)]
    pub(crate) fn outside<S: Simd>(&self, simd: S, ball: &Ball) -> Mask {
        let [low, high] = self.bounds(simd);
        ball.misses(simd, low, high)
    }

    #[inline(always)]
    fn corner(&self, corner: usize, lane: usize) -> [f32; 3] {
        let [x, y, z] = &self.corners[corner];
        [x.0[lane], y.0[lane], z.0[lane]]
    }
}
