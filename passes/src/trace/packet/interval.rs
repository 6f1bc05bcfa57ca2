//! Slab tests of several rays at once, by interval arithmetic: of a packet against eight boxes, and of sixteen packets against one box.
//!
//! The slab test is monotone in each operand, rounding included. So a test of the extreme operands enters every box that the test of any
//! ray with operands between the extremes enters.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::octant::Octant;
use crate::trace::simd::{F8, F16, LANES, Mask, Simd, WIDE};

/// The least and the greatest operands of the slab tests of several rays of one octant.
#[derive(Clone, Copy)]
pub(crate) struct Interval {
    /// By axis: the moved origin that is nearest to near planes, and the one that is farthest from far planes.
    pub(crate) near_origin: [f32; 3],
    pub(crate) far_origin: [f32; 3],
    /// Least and greatest reciprocals of the directions, for near planes and for far planes.
    pub(crate) inverse: [[f32; 3]; 2],
    pub(crate) far_inverse: [[f32; 3]; 2],
    /// Per axis: 1 where the rays run towards lower coordinates, else 0.
    pub(crate) backward: [usize; 3],
    pub(crate) t_min: f32,
    pub(crate) t_max: f32,
}

impl Interval {
    pub(crate) const NONE: Self = Self {
        near_origin: [0.0; 3],
        far_origin: [0.0; 3],
        inverse: [[0.0; 3]; 2],
        far_inverse: [[0.0; 3]; 2],
        backward: [0; 3],
        t_min: 0.0,
        t_max: 0.0,
    };

    /// Widens the interval to include other rays of the octant.
    pub(crate) fn join(&mut self, other: &Self) {
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

    /// The lanes of boxes that any ray may enter, and lower bounds of the distances at which rays enter them.
    #[inline(always)]
    pub(crate) fn meets<S: Simd>(&self, simd: S, planes: [[S::Vector; 3]; 2]) -> (Mask, S::Vector) {
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

/// The intervals of up to sixteen packets, one a lane.
pub(crate) struct Intervals {
    near_origin: [F16; 3],
    far_origin: [F16; 3],
    inverse: [[F16; 3]; 2],
    far_inverse: [[F16; 3]; 2],
    t_min: F16,
    /// Greatest distance up to which any ray of each packet still searches for hits; -∞ in lanes without a packet, which therefore enter no
    /// box.
    pub(crate) limit: F16,
}

impl Intervals {
    pub(crate) const NONE: Self = Self {
        near_origin: [F16::ZERO; 3],
        far_origin: [F16::ZERO; 3],
        inverse: [[F16::ZERO; 3]; 2],
        far_inverse: [[F16::ZERO; 3]; 2],
        t_min: F16::ZERO,
        limit: F16([f32::NEG_INFINITY; WIDE]),
    };

    pub(crate) fn set(&mut self, lane: usize, interval: &Interval) {
        for axis in 0..3 {
            self.near_origin[axis].0[lane] = interval.near_origin[axis];
            self.far_origin[axis].0[lane] = interval.far_origin[axis];
            for side in 0..2 {
                self.inverse[side][axis].0[lane] = interval.inverse[side][axis];
                self.far_inverse[side][axis].0[lane] = interval.far_inverse[side][axis];
            }
        }
        self.t_min.0[lane] = interval.t_min;
        self.limit.0[lane] = interval.t_max;
    }

    /// The packets with any ray that may enter a box, by the operations of [`Interval::meets`].
    #[inline(always)]
    pub(crate) fn meets<S: Simd>(&self, simd: S, planes: &[[F8; 3]; 2], box_lane: usize, octant: Octant) -> Mask {
        let lane = box_lane & (LANES - 1);
        let backward = octant.backward();
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
