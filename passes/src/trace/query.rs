//! What is computed once per ray: the shear of the triangle test and the padded slabs of the box test.

use super::Ray;
use super::lanes::F8;
use glam::Vec3;

/// Unit roundoff of `f32`.
pub(super) const UNIT_ROUNDOFF: f32 = 1.0 / 16_777_216.0;

/// Axis-aligned bounds; `low > high` when empty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub(super) low: Vec3,
    pub(super) high: Vec3,
}

impl Bounds {
    pub(super) const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    pub(super) fn of(points: &[Vec3]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, &point| bounds.union(Self { low: point, high: point }))
    }

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Half the surface area; 0 when empty.
    pub(super) fn half_area(self) -> f32 {
        let size = (self.high - self.low).max(Vec3::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

/// A ray prepared for the tests of nodes and triangles.
///
/// The triangle test sees the corners relative to the origin, sheared so that the ray is an axis (Woop, Benthin and Wald,
/// "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013). The rounding of the shear moves a corner sideways by at most
/// `5 u (|x| + |z|)`, `x` and `z` being its distances from the origin along the two axes and `u` = 2⁻²⁴. The box test
/// must not cut away what the triangle test would hit, so the origin of its slabs is moved outward by `8 u` times the
/// largest such distances in the scene, plus one unit in the last place of the origin itself (their section 4).
#[derive(Debug, Clone, Copy)]
pub(super) struct Query {
    pub(super) origin: [f32; 3],
    /// The two other axes and the axis along which the direction is longest.
    pub(super) axes: [usize; 3],
    /// `d.x/d.z`, `d.y/d.z` and `1/d.z` in permuted axes.
    pub(super) shear: [f32; 3],
    pub(super) t_min: f32,
    pub(super) t_max: f32,
    /// Per axis: 1 where the ray runs towards lower coordinates, else 0.
    pub(super) backward: [usize; 3],
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    near_inverse: [f32; 3],
    far_inverse: [f32; 3],
}

impl Query {
    /// Prepares a ray; nothing if it cannot hit anything (not finite, no direction, an empty interval).
    #[inline(always)]
    pub(super) fn new(ray: &Ray, scene: &Bounds) -> Option<Self> {
        if !(ray.origin.is_finite() && ray.direction.is_finite() && ray.t_min < ray.t_max && ray.t_max > 0.0) {
            return None;
        }
        // Components whose reciprocal would overflow count as zero, in both tests alike.
        let direction = ray.direction.to_array().map(|d| if d.abs() < f32::MIN_POSITIVE { d * 0.0 } else { d });
        let length = direction.map(f32::abs);
        let z = if length[0] > length[1] {
            if length[0] > length[2] { 0 } else { 2 }
        } else if length[1] > length[2] {
            1
        } else {
            2
        };
        if length[z] == 0.0 {
            return None;
        }
        let [x, y] = [[1, 2], [2, 0], [0, 1]][z];
        let inverse = direction.map(|d| 1.0 / d);
        let shear = [direction[x] / direction[z], direction[y] / direction[z], inverse[z]];

        // Finite, or the planes of unused lanes, which are infinite, would give NaN.
        let reach = (scene.low - ray.origin).abs().max((scene.high - ray.origin).abs()).min(Vec3::splat(1.0e30));
        let pad = (reach + Vec3::splat(reach[z])) * (8.0 * UNIT_ROUNDOFF) + ray.origin.abs() * (2.0 * UNIT_ROUNDOFF);
        let toward = Vec3::from_array(inverse.map(|i| 1.0_f32.copysign(i))) * pad;
        let backward = inverse.map(|i| usize::from(i.is_sign_negative()));
        // Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013: the far distance grows by twice the error of a slab, 6 u.
        let far_inverse = inverse.map(|i| i * (1.0 + 8.0 * UNIT_ROUNDOFF));
        Some(Self {
            origin: ray.origin.to_array(),
            axes: [x, y, z],
            shear,
            // Adding zero turns -0 into 0: entry distances are compared by their bits.
            t_min: ray.t_min.max(0.0) + 0.0,
            t_max: ray.t_max,
            backward,
            near_origin: (ray.origin + toward).to_array(),
            far_origin: (ray.origin - toward).to_array(),
            near_inverse: inverse,
            far_inverse,
        })
    }

    /// Where the ray enters and leaves eight boxes, given as planes `[low, high][axis]`; entering is never below `t_min`.
    ///
    /// A direction of zero along an axis gives infinite distances, or `0 * inf = NaN` for a plane through the padded
    /// origin, which the operand order of the comparisons drops: such a slab does not restrict the ray.
    #[inline(always)]
    pub(super) fn slabs(&self, planes: &[[F8; 3]; 2]) -> (F8, F8) {
        let mut enter = F8::splat(self.t_min);
        let mut leave = F8::splat(f32::INFINITY);
        for axis in 0..3 {
            let side = self.backward[axis] & 1;
            let near = (planes[side][axis] - F8::splat(self.near_origin[axis])) * F8::splat(self.near_inverse[axis]);
            let far = (planes[1 - side][axis] - F8::splat(self.far_origin[axis])) * F8::splat(self.far_inverse[axis]);
            enter = near.max_or(enter);
            leave = far.min_or(leave);
        }
        (enter, leave)
    }

    /// The distance at which [`Self::slabs`] says that the ray enters the bounds of a triangle: the same operations, so
    /// that it is never below the entry of a box around those bounds.
    #[inline(always)]
    pub(super) fn entry(&self, corners: &[[f32; 3]; 3]) -> f32 {
        let mut enter = self.t_min;
        for axis in 0..3 {
            let [a, b, c] = corners.map(|corner| corner[axis]);
            let plane = if self.backward[axis] == 0 { a.min(b).min(c) } else { a.max(b).max(c) };
            let near = (plane - self.near_origin[axis]) * self.near_inverse[axis];
            enter = if near > enter { near } else { enter };
        }
        enter
    }
}
