//! Box tests of several rays at once, by the extremes of what they compute with: of a beam against eight boxes, and of
//! sixteen beams against one.
//!
//! All operations of a ray's own test are monotone, so rounding included no box is left out that a ray's test would enter.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::class::Class;
use super::lanes::{F8, F16, LANES, Mask, Simd, WIDE};

/// Extremes of what the box test of a ray computes with, of several rays.
#[derive(Clone, Copy)]
pub(super) struct Extremes {
    /// The origin that gives the least distance to a near plane, and the greatest to a far one.
    pub(super) near_origin: [f32; 3],
    pub(super) far_origin: [f32; 3],
    /// Least and greatest reciprocals of directions, and the same for far planes.
    pub(super) inverse: [[f32; 3]; 2],
    pub(super) far_inverse: [[f32; 3]; 2],
    /// Per axis: 1 where rays run towards lower coordinates, else 0.
    pub(super) backward: [usize; 3],
    pub(super) t_min: f32,
    pub(super) t_max: f32,
}

impl Extremes {
    pub(super) const NONE: Self = Self {
        near_origin: [0.0; 3],
        far_origin: [0.0; 3],
        inverse: [[0.0; 3]; 2],
        far_inverse: [[0.0; 3]; 2],
        backward: [0; 3],
        t_min: 0.0,
        t_max: 0.0,
    };

    /// Widens them to those of other rays of the octant.
    pub(super) fn join(&mut self, other: &Self) {
        for axis in 0..3 {
            let (near, far) = (&mut self.near_origin[axis], &mut self.far_origin[axis]);
            if self.backward[axis] == 0 {
                (*near, *far) = (near.max(other.near_origin[axis]), far.min(other.far_origin[axis]));
            } else {
                (*near, *far) = (near.min(other.near_origin[axis]), far.max(other.far_origin[axis]));
            }
            self.inverse[0][axis] = self.inverse[0][axis].min(other.inverse[0][axis]);
            self.inverse[1][axis] = self.inverse[1][axis].max(other.inverse[1][axis]);
            self.far_inverse[0][axis] = self.far_inverse[0][axis].min(other.far_inverse[0][axis]);
            self.far_inverse[1][axis] = self.far_inverse[1][axis].max(other.far_inverse[1][axis]);
        }
        self.t_min = self.t_min.min(other.t_min);
        self.t_max = self.t_max.max(other.t_max);
    }

    /// The lanes of boxes that any ray may be in, and below which distance it does not enter them.
    #[inline(always)]
    pub(super) fn meets<S: Simd>(&self, simd: S, planes: [[S::Vector; 3]; 2]) -> (Mask, S::Vector) {
        let mut enter = simd.splat(self.t_min);
        let mut leave = simd.splat(self.t_max);
        for axis in 0..3 {
            let side = self.backward[axis] & 1;
            let near = simd.sub(planes[side][axis], simd.splat(self.near_origin[axis]));
            let far = simd.sub(planes[1 - side][axis], simd.splat(self.far_origin[axis]));
            let (low, high) = (simd.splat(self.inverse[0][axis]), simd.splat(self.inverse[1][axis]));
            enter = simd.max_or(simd.min_or(simd.mul(near, low), simd.mul(near, high)), enter);
            let (low, high) = (simd.splat(self.far_inverse[0][axis]), simd.splat(self.far_inverse[1][axis]));
            leave = simd.min_or(simd.max_or(simd.mul(far, low), simd.mul(far, high)), leave);
        }
        (simd.at_most(enter, leave), enter)
    }
}

/// The extremes of sixteen beams, a beam a lane.
pub(super) struct BeamLanes {
    near_origin: [F16; 3],
    far_origin: [F16; 3],
    inverse: [[F16; 3]; 2],
    far_inverse: [[F16; 3]; 2],
    t_min: F16,
    /// The distances up to which beams look; lanes without a beam meet nothing.
    pub(super) limit: F16,
}

impl BeamLanes {
    pub(super) const NONE: Self = Self {
        near_origin: [F16::ZERO; 3],
        far_origin: [F16::ZERO; 3],
        inverse: [[F16::ZERO; 3]; 2],
        far_inverse: [[F16::ZERO; 3]; 2],
        t_min: F16::ZERO,
        limit: F16([f32::NEG_INFINITY; WIDE]),
    };

    pub(super) fn set(&mut self, lane: usize, extremes: &Extremes) {
        for axis in 0..3 {
            self.near_origin[axis].0[lane] = extremes.near_origin[axis];
            self.far_origin[axis].0[lane] = extremes.far_origin[axis];
            for side in 0..2 {
                self.inverse[side][axis].0[lane] = extremes.inverse[side][axis];
                self.far_inverse[side][axis].0[lane] = extremes.far_inverse[side][axis];
            }
        }
        self.t_min.0[lane] = extremes.t_min;
        self.limit.0[lane] = extremes.t_max;
    }

    /// The beams of which any ray may be in a box, by the operations of [`Extremes::meets`].
    #[inline(always)]
    pub(super) fn meets<S: Simd>(&self, simd: S, planes: &[[F8; 3]; 2], box_lane: usize, class: Class) -> Mask {
        let lane = box_lane & (LANES - 1);
        let backward = class.backward();
        let mut enter = simd.wide_load(&self.t_min);
        let mut leave = simd.wide_load(&self.limit);
        for axis in 0..3 {
            let side = backward[axis] & 1;
            let (near, far) = (planes[side][axis].0[lane], planes[1 - side][axis].0[lane]);
            let near = simd.wide_sub(simd.wide_splat(near), simd.wide_load(&self.near_origin[axis]));
            let far = simd.wide_sub(simd.wide_splat(far), simd.wide_load(&self.far_origin[axis]));
            let (low, high) = (simd.wide_load(&self.inverse[0][axis]), simd.wide_load(&self.inverse[1][axis]));
            let least = simd.wide_min_or(simd.wide_mul(near, low), simd.wide_mul(near, high));
            enter = simd.wide_max_or(least, enter);
            let (low, high) = (simd.wide_load(&self.far_inverse[0][axis]), simd.wide_load(&self.far_inverse[1][axis]));
            let most = simd.wide_max_or(simd.wide_mul(far, low), simd.wide_mul(far, high));
            leave = simd.wide_min_or(most, leave);
        }
        simd.wide_at_most(enter, leave)
    }
}
