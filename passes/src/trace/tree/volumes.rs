//! Volumes that boxes and triangles are compared with: bounds, the side of a plane, a ball around points.

use crate::trace::rounding::{BALL_MARGIN, END_ERROR, RIM_ERROR, SIDE_ERROR, SLAB_ERROR, SLAB_ORIGIN_ERROR};
use crate::trace::simd::{Mask, Simd};
use glam::Vec3;

/// Axis-aligned bounds; `low > high` when empty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) low: Vec3,
    pub(crate) high: Vec3,
}

impl Bounds {
    pub(crate) const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    pub(crate) fn of(points: &[Vec3]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, &point| bounds.union(Self { low: point, high: point }))
    }

    #[inline(always)]
    pub(crate) fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Whether both bounds have a point in common.
    pub(crate) fn touches(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Half the surface area; 0 when empty.
    pub(crate) fn half_area(&self) -> f32 {
        let side = (self.high - self.low).max(Vec3::ZERO);
        side.x * side.y + side.y * side.z + side.z * side.x
    }

    /// The middle of the bounds, which does not overflow; NaN if they are empty.
    pub(crate) fn middle(&self) -> Vec3 {
        self.low * 0.5 + self.high * 0.5
    }
}

/// A plane through the origin of rays that all leave to the side of its normal.
///
/// Such a ray meets only points on that side, so no ray hits a triangle whose corners are all on the other side. For occlusion rays this
/// culls exactly the flat surface that they leave and everything coplanar with it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plane {
    pub(crate) origin: Vec3,
    pub(crate) normal: Vec3,
}

impl Plane {
    /// A plane such that whatever lies behind it also lies behind the parallel planes through all points of a box.
    pub(crate) fn behind_all(origins: &Bounds, normal: Vec3) -> Self {
        Self { origin: Vec3::select(normal.cmpge(Vec3::ZERO), origins.low, origins.high), normal }
    }

    /// The lanes whose points certainly all lie behind the plane or on it. `low` and `high` are the bounds of each lane's points by axis.
    ///
    /// The sum is compared with its own rounding error: four operations deep, each off by at most half a unit in the last place of a term.
    #[inline(always)]
    pub(crate) fn behind<S: Simd>(&self, simd: S, low: [S::Vector; 3], high: [S::Vector; 3]) -> Mask {
        let zero = simd.splat(0.0);
        let (mut height, mut size) = (zero, zero);
        for axis in 0..3 {
            // The corner of the bounds that is farthest along the normal.
            let corner = if self.normal[axis] >= 0.0 { high[axis] } else { low[axis] };
            let part = simd.mul(simd.sub(corner, simd.splat(self.origin[axis])), simd.splat(self.normal[axis]));
            let minus = simd.sub(zero, part);
            height = simd.sub(height, minus);
            size = simd.sub(size, simd.min_or(part, minus));
        }
        simd.at_most(simd.about_mul_add(size, simd.splat(SIDE_ERROR), height), zero)
    }
}

/// The volume that rays of some length from the points of a box stay in: all points within that distance of the box, grown by more than the
/// rounding errors. For a single point it is a ball.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ball {
    pub(crate) origins: Bounds,
    /// The square of the radius.
    pub(crate) square: f32,
}

impl Ball {
    /// `pad`: by how much, along each axis, a ray may miss a box although it hits the triangle inside by the watertight test.
    pub(crate) fn new(origins: Bounds, radius: f32, pad: Vec3) -> Self {
        let grown = radius * BALL_MARGIN + 2.0 * pad.length();
        Self { origins, square: grown * grown }
    }

    /// The lanes of boxes that certainly lie outside the ball; unused lanes, which hold NaN, are not among them.
    #[inline(always)]
    pub(crate) fn misses<S: Simd>(&self, simd: S, low: [S::Vector; 3], high: [S::Vector; 3]) -> Mask {
        let zero = simd.splat(0.0);
        let mut distance = zero;
        for axis in 0..3 {
            let below = simd.sub(low[axis], simd.splat(self.origins.high[axis]));
            let above = simd.sub(simd.splat(self.origins.low[axis]), high[axis]);
            let outside = simd.max_or(simd.max_or(below, above), zero);
            distance = simd.about_mul_add(outside, outside, distance);
        }
        simd.at_most(simd.splat(self.square), distance)
    }
}

/// Error of the watertight test along each axis, for a ray from `origin`. `reach` holds the largest distances of the scene from the origin
/// by axis, and `along` is the one along the ray's main axis. See [`PreparedRay`](super::PreparedRay).
#[inline(always)]
pub(crate) fn slab_padding(origin: Vec3, reach: Vec3, along: f32) -> Vec3 {
    (reach + Vec3::splat(along)) * SLAB_ERROR + origin.abs() * SLAB_ORIGIN_ERROR
}

/// By how much, along each axis, a ray from a point of `origins` may miss a box although it hits the triangle inside by the watertight
/// test.
pub(crate) fn slack(scene: &Bounds, origins: &Bounds) -> Vec3 {
    let reach = (scene.low - origins.high).abs().max((scene.high - origins.low).abs());
    let reach = reach.max((scene.low - origins.low).abs()).max((scene.high - origins.high).abs());
    let size = origins.low.abs().max(origins.high.abs());
    slab_padding(size, reach, reach.max_element())
}

/// Bounds of half balls of the given radius: one around each point of the box `origins`, on the side of `normal`. The bounds are grown by
/// more than the rounding error of a ray's end point, and by `slack`. `None` if a bound is not finite.
#[inline(always)]
pub(crate) fn half_balls(origins: &Bounds, normal: Vec3, radius: f32, slack: Vec3) -> Option<([f32; 3], [f32; 3])> {
    let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
    for axis in 0..3 {
        let normal = normal[axis];
        // The extreme point of the half ball against the normal lies on its rim.
        let rim = (1.0 - normal * normal).max(0.0).sqrt() + RIM_ERROR;
        let (back, front) = if normal >= 0.0 { (rim.min(1.0), 1.0) } else { (1.0, rim.min(1.0)) };
        let size = origins.low[axis].abs().max(origins.high[axis].abs());
        let pad = (radius + size) * END_ERROR + slack[axis];
        low[axis] = origins.low[axis] - radius * back - pad;
        high[axis] = origins.high[axis] + radius * front + pad;
    }
    let finite = low.iter().chain(&high).all(|value| value.is_finite());
    finite.then_some((low, high))
}
