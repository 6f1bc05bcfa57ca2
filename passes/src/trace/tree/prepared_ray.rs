//! Numbers that are computed once for each ray: the shear of the triangle test and the padded origins of the slab test.

use super::volumes::{Bounds, slab_padding};
use crate::trace::ray::Ray;
use crate::trace::rounding::{DOUBT, FAR, FUSED_SLAB_ERROR, LARGEST_REACH, LONGEST_DIRECTION, UNIT_ROUNDOFF};
use crate::trace::simd::{F8, Mask, Simd, higher, lower};
use glam::{DVec3, Vec3};

/// The common origin and interval of several rays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    origin: [f32; 3],
    pub(crate) t_min: f32,
    pub(crate) t_max: f32,
    /// For each longest axis of a direction, the origin moved towards higher and towards lower coordinates; see [`PreparedRay`].
    moved: [[[f32; 3]; 2]; 3],
    /// How much farther the origin is moved for the fused slab test; see [`Self::farthest`].
    fused: [f32; 3],
    /// As in [`Line`].
    shortness: f32,
    doubt: f32,
}

impl Start {
    /// `None` if no ray from the origin can hit anything.
    #[inline(always)]
    pub(crate) fn new(origin: Vec3, (t_min, t_max): (f32, f32), scene: &Bounds) -> Option<Self> {
        let zero_or_nan = (origin * 0.0).element_sum();
        if !(zero_or_nan == 0.0 && t_min < t_max && t_max > 0.0) {
            return None;
        }
        let reach = reach(origin, scene);
        let moved = [0, 1, 2].map(|axis: usize| {
            let pad = slab_padding(origin, reach, reach[axis]);
            [(origin + pad).to_array(), (origin - pad).to_array()]
        });
        let fused = ((reach + origin.abs()) * FUSED_SLAB_ERROR).to_array();
        let (t_min, shortness) = (t_min.max(0.0) + 0.0, 1.0 / t_max);
        Some(Self { origin: origin.to_array(), t_min, t_max, moved, fused, shortness, doubt: doubt(reach, t_min) })
    }

    /// The common origin.
    #[inline(always)]
    pub(crate) fn origin(&self) -> [f32; 3] {
        self.origin
    }

    /// The origin, moved towards higher and towards lower coordinates, for slab tests of the form `plane * inverse - origin * inverse` with
    /// any rounding (fused or not). Each is moved at least as far as the moved origin of any direction.
    ///
    /// With an inverse `i`, such a test errs by `u |plane i|` where the product is rounded, by `u |origin i|`, and by `u` times the result,
    /// which is `u |(plane - origin) i|`: as if the origin were off by `2 u reach + 2 u |origin|`. The test of [`PreparedRay::slabs`] errs
    /// by 3 u of the distance, and its far side by 8 u more: `11 u reach`. This origin is moved by more than the two errors together, so no
    /// box is culled that [`PreparedRay::slabs`] enters.
    #[inline(always)]
    pub(crate) fn farthest(&self) -> [[f32; 3]; 2] {
        let [[a, b], [c, d], [e, f]] = self.moved;
        let most = |axis: usize| a[axis].max(c[axis]).max(e[axis]) + self.fused[axis];
        let least = |axis: usize| b[axis].min(d[axis]).min(f[axis]) - self.fused[axis];
        [[most(0), most(1), most(2)], [least(0), least(1), least(2)]]
    }

    /// The same line as in [`PreparedRay::new`]. `longest` is the axis of the largest component of the direction. [`PreparedRay::new`] must
    /// accept the direction and flush no component of it to 0, and no component may be above [`LONGEST_DIRECTION`].
    #[inline(always)]
    pub(crate) fn line(&self, direction: [f32; 3], shear: [f32; 2], longest: usize) -> Line {
        Line {
            origin: self.origin,
            direction,
            axes: permutation(longest),
            shear,
            t_min: self.t_min,
            t_max: self.t_max,
            shortness: self.shortness,
            doubt: self.doubt,
        }
    }

    /// The prepared ray for a line; `inverse` holds the reciprocals of its direction.
    #[inline(always)]
    pub(crate) fn prepared(&self, line: Line, inverse: [f32; 3]) -> PreparedRay {
        let backward = inverse.map(|i| usize::from(i.is_sign_negative()));
        let moved = &self.moved[line.axes[2]];
        let side = |side: usize, axis: usize| moved[(backward[axis] ^ side) & 1][axis];
        PreparedRay {
            line,
            backward,
            near_origin: [side(0, 0), side(0, 1), side(0, 2)],
            far_origin: [side(1, 0), side(1, 1), side(1, 2)],
            near_inverse: inverse,
            far_inverse: inverse.map(|inverse| inverse * FAR),
        }
    }
}

/// The three axes in cyclic order, `longest` last.
#[inline(always)]
pub(crate) fn permutation(longest: usize) -> [usize; 3] {
    // A table: a branch would be mispredicted most of the time.
    const AXES: [[usize; 3]; 4] = [[1, 2, 0], [2, 0, 1], [0, 1, 2], [0, 1, 2]];
    AXES[longest & 3]
}

/// The largest distances of the scene's bounds from an origin, by axis. They are clamped to be finite: the planes of unused lanes are
/// infinite, and would give NaN.
#[inline(always)]
fn reach(origin: Vec3, scene: &Bounds) -> Vec3 {
    (scene.low - origin).abs().max((scene.high - origin).abs()).min(Vec3::splat(LARGEST_REACH))
}

/// The value of [`Line::doubt`]; `t_min` is 0 or more.
#[inline(always)]
fn doubt(reach: Vec3, t_min: f32) -> f32 {
    0.5 * DOUBT * UNIT_ROUNDOFF * (reach.element_sum() + t_min)
}

/// The data of a ray that the triangle tests use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    pub(crate) origin: [f32; 3],
    pub(crate) direction: [f32; 3],
    /// The axes in cyclic order; the last is the one of the direction's component of largest magnitude.
    pub(crate) axes: [usize; 3],
    /// `d.x/d.z` and `d.y/d.z` in permuted axes.
    pub(crate) shear: [f32; 2],
    pub(crate) t_min: f32,
    pub(crate) t_max: f32,
    /// `1 / t_max`.
    pub(crate) shortness: f32,
    /// For [`decide`](crate::trace::single::leaf_test): the error of `p`, in units of the sum of the edges' squared lengths. Infinite where
    /// the direction is too long for the bound to hold.
    pub(crate) doubt: f32,
}

/// A ray prepared for the tests of nodes and triangles.
///
/// The triangle test uses corners relative to the origin, sheared so that the ray is an axis (Woop, Benthin and Wald, "Watertight
/// Ray/Triangle Intersection", JCGT 2(1), 2013). The rounding of the shear moves a corner sideways by at most `5 u (|x| + |z|)`, where `x`
/// and `z` are its distances from the origin along the two axes and `u` = 2⁻²⁴. The slab test must not cull what the triangle test would
/// hit, so the origin of its slabs is moved outward by `8 u` times the largest such distances in the scene, plus one unit in the last place
/// of the origin itself (their section 4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PreparedRay {
    pub(crate) line: Line,
    /// Per axis: 1 where the ray runs towards lower coordinates, else 0.
    pub(crate) backward: [usize; 3],
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    near_inverse: [f32; 3],
    far_inverse: [f32; 3],
}

impl PreparedRay {
    /// The prepared ray, from data that a packet has prepared.
    #[inline(always)]
    pub(crate) fn of_packet(
        line: Line,
        backward: [usize; 3],
        (near_origin, far_origin): ([f32; 3], [f32; 3]),
        (near_inverse, far_inverse): ([f32; 3], [f32; 3]),
    ) -> Self {
        Self { line, backward, near_origin, far_origin, near_inverse, far_inverse }
    }

    /// Prepares a ray; `None` if it cannot hit anything (a number that is not finite, no direction, or an empty interval).
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, scene: &Bounds) -> Option<Self> {
        let zero_or_nan = (ray.origin * 0.0 + ray.direction * 0.0).element_sum();
        if !(zero_or_nan == 0.0 && ray.t_min < ray.t_max && ray.t_max > 0.0) {
            return None;
        }
        // Components whose reciprocal would overflow count as zero, in the slab test and in the triangle test alike.
        let flush = |d: f32| if d.abs() < f32::MIN_POSITIVE { d * 0.0 } else { d };
        let direction = Vec3::new(flush(ray.direction.x), flush(ray.direction.y), flush(ray.direction.z));
        let length = direction.abs();
        let longest = length.max_element();
        if longest == 0.0 {
            return None;
        }
        let [x, y, z] = permutation(if length.x == longest {
            0
        } else if length.y == longest {
            1
        } else {
            2
        });
        let inverse = direction.recip();
        let reach = reach(ray.origin, scene);
        let toward = slab_padding(ray.origin, reach, reach[z]).copysign(inverse);
        let far_inverse = inverse * FAR;
        let backward = |i: f32| usize::from(i.is_sign_negative());
        // Adding zero turns -0 into 0: entry distances are compared by their bits.
        let t_min = ray.t_min.max(0.0) + 0.0;
        let line = Line {
            origin: ray.origin.to_array(),
            direction: direction.to_array(),
            axes: [x, y, z],
            shear: [direction[x] / direction[z], direction[y] / direction[z]],
            t_min,
            t_max: ray.t_max,
            shortness: 1.0 / ray.t_max,
            doubt: if longest <= LONGEST_DIRECTION { doubt(reach, t_min) } else { f32::INFINITY },
        };
        Some(Self {
            line,
            backward: [backward(inverse.x), backward(inverse.y), backward(inverse.z)],
            near_origin: (ray.origin + toward).to_array(),
            far_origin: (ray.origin - toward).to_array(),
            near_inverse: inverse.to_array(),
            far_inverse: far_inverse.to_array(),
        })
    }

    /// The lanes of the boxes, given as planes `[low, high][axis]`, that the ray may meet between `t_min` and `t_limit`; and lower bounds
    /// of the distances at which it enters them, which are at least `t_min`.
    ///
    /// A direction of zero along an axis gives infinite distances, or `0 * inf = NaN` for a plane through the padded origin. The operand
    /// order of the comparisons drops NaN: such a slab does not restrict the ray.
    #[inline(always)]
    pub(crate) fn slabs<S: Simd>(&self, simd: S, planes: &[[F8; 3]; 2], t_limit: f32) -> (Mask, S::Vector) {
        let [near_x, near_y, near_z] = [self.backward[0] & 1, self.backward[1] & 1, self.backward[2] & 1];
        let mut enter = simd.splat(self.line.t_min);
        enter = simd.max_or(self.near(simd, 0, &planes[near_x][0]), enter);
        enter = simd.max_or(self.near(simd, 1, &planes[near_y][1]), enter);
        enter = simd.max_or(self.near(simd, 2, &planes[near_z][2]), enter);
        let mut leave = simd.splat(t_limit);
        leave = simd.min_or(self.far(simd, 0, &planes[1 - near_x][0]), leave);
        leave = simd.min_or(self.far(simd, 1, &planes[1 - near_y][1]), leave);
        leave = simd.min_or(self.far(simd, 2, &planes[1 - near_z][2]), leave);
        (simd.at_most(enter, leave), enter)
    }

    #[inline(always)]
    fn near<S: Simd>(&self, simd: S, axis: usize, planes: &F8) -> S::Vector {
        let from_origin = simd.sub(simd.load(planes), simd.splat(self.near_origin[axis]));
        simd.mul(from_origin, simd.splat(self.near_inverse[axis]))
    }

    #[inline(always)]
    fn far<S: Simd>(&self, simd: S, axis: usize, planes: &F8) -> S::Vector {
        let from_origin = simd.sub(simd.load(planes), simd.splat(self.far_origin[axis]));
        simd.mul(from_origin, simd.splat(self.far_inverse[axis]))
    }

    /// The interval in which the ray is inside the bounds of a triangle, by the operations of [`Self::slabs`], so that the interval of any
    /// box around those bounds contains it.
    #[inline(always)]
    pub(crate) fn span(&self, [a, b, c]: &[[f32; 3]; 3]) -> (f32, f32) {
        let (mut enter, mut leave) = (self.line.t_min, f32::INFINITY);
        for axis in 0..3 {
            let least = lower(lower(a[axis], b[axis]), c[axis]);
            let most = higher(higher(a[axis], b[axis]), c[axis]);
            let (near, far) = if self.backward[axis] == 0 { (least, most) } else { (most, least) };
            let near = (near - self.near_origin[axis]) * self.near_inverse[axis];
            let far = (far - self.far_origin[axis]) * self.far_inverse[axis];
            enter = if near > enter { near } else { enter };
            leave = if far < leave { far } else { leave };
        }
        (enter, leave)
    }

    /// Distance at which the ray meets the plane of a triangle, computed in `f64`; not finite where it is parallel to the plane.
    #[inline(always)]
    pub(crate) fn plane_distance(&self, [a, b, c]: &[[f32; 3]; 3]) -> f32 {
        let point = |p: &[f32; 3]| DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
        let a = point(a);
        let normal = (point(b) - a).cross(point(c) - a);
        (normal.dot(a - point(&self.line.origin)) / normal.dot(point(&self.line.direction))) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::simd::Plain;
    use crate::trace::tree::{Child, Node};

    fn random(state: &mut u64) -> f32 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 40) as f32 / 16_777_216.0
    }

    /// Whether the ray meets the box, in `f64`, where the differences of `f32` and their products with reciprocals have errors far below
    /// those under test; touching counts.
    fn meets(ray: &Ray, bounds: &Bounds) -> bool {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, d) = (f64::from(ray.origin[axis]), f64::from(ray.direction[axis]));
            let (low, high) = (f64::from(bounds.low[axis]) - o, f64::from(bounds.high[axis]) - o);
            if d == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return false;
                }
            } else {
                enter = enter.max((low / d).min(high / d));
                leave = leave.min((low / d).max(high / d));
            }
        }
        enter <= leave
    }

    #[test]
    fn a_common_start_prepares_what_each_ray_would() {
        let mut state = 3;
        for round in 0..20_000 {
            let mut point = || Vec3::new(random(&mut state), random(&mut state), random(&mut state)) * 2.0 - 1.0;
            let scene = Bounds::of(&[point() * 10.0, point() * 10.0]);
            let (origin, mut direction) = (point() * 5.0, point());
            if round % 5 == 0 {
                // Two components are equal.
                direction[round % 3] = direction[(round + 1) % 3];
            }
            let direction = direction.normalize();
            let (t_min, t_max) = ([-1.0, 0.0, 0.5][round % 3], 2.0);
            let start = Start::new(origin, (t_min, t_max), &scene).unwrap();
            let expected = PreparedRay::new(&Ray { origin, direction, t_min, t_max }, &scene).unwrap();
            let [x, y, z] = expected.line.axes;
            let shear = [direction[x] / direction[z], direction[y] / direction[z]];
            let prepared = start.prepared(start.line(direction.to_array(), shear, z), direction.recip().to_array());
            assert_eq!(prepared, expected);
            let [higher, lower] = start.farthest().map(Vec3::from);
            for padded in [expected.near_origin, expected.far_origin].map(Vec3::from) {
                assert!(lower.cmple(padded).all() && padded.cmple(higher).all());
            }
        }
        assert!(Start::new(Vec3::NAN, (0.0, 1.0), &Bounds::EMPTY).is_none());
        assert!(Start::new(Vec3::ZERO, (1.0, 1.0), &Bounds::EMPTY).is_none());
    }

    const LANE: usize = 5;

    /// The planes of one box, in one lane of a node.
    fn planes(bounds: &Bounds) -> [[F8; 3]; 2] {
        let mut node = Node::EMPTY;
        node.set(LANE, *bounds, Child::NONE);
        node.planes
    }

    /// The textbook slab test, without padding.
    fn plain(ray: &Ray, bounds: &Bounds) -> bool {
        let (low, high) = ((bounds.low - ray.origin) / ray.direction, (bounds.high - ray.origin) / ray.direction);
        low.min(high).max_element().max(0.0) <= low.max(high).min_element()
    }

    #[test]
    fn no_ray_at_a_corner_or_an_edge_of_a_box_misses_it() {
        let mut state = 1;
        let (mut meeting, mut missed, mut missed_by_plain, mut passed, mut total) = (0, 0, 0, 0, 0);
        for center in [0.0, 100.0, 1.0e4] {
            for index in 0..500_000 {
                let mut point = || Vec3::new(random(&mut state), random(&mut state), random(&mut state));
                let middle = point() * 2.0 - 1.0 + center;
                let mut bounds = Bounds::of(&[middle, middle + point() * 0.02, middle - point() * 0.02]);
                if index % 3 == 0 {
                    bounds.high[index % 9 / 3] = bounds.low[index % 9 / 3];
                }
                let side = point();
                let mut target = Vec3::select(side.cmplt(Vec3::splat(0.5)), bounds.low, bounds.high);
                if index % 2 == 0 {
                    target[index % 3] = bounds.low[index % 3].midpoint(bounds.high[index % 3]);
                }
                let mut origin = Vec3::splat(center) + (point() * 2.0 - 1.0) * 3.0;
                // Every fifth ray runs along an axis or within a plane of the box, with zeros of both signs.
                let zeros = if index % 5 == 0 { 1 + index % 2 } else { 0 };
                for axis in 0..zeros {
                    origin[axis] = target[axis];
                }
                let mut direction = (target - origin).normalize_or_zero();
                for axis in 0..zeros {
                    direction[axis] = [0.0, -0.0, 1e-40, -1e-40][index % 4];
                }
                if direction.abs().max_element() < 0.1 {
                    continue;
                }
                let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
                let planes = planes(&bounds);
                let prepared = PreparedRay::new(&ray, &bounds).unwrap();
                let (lanes, _) = prepared.slabs(Plain, &planes, ray.t_max);
                assert_eq!(lanes & !(1 << LANE), 0, "an empty lane was met");
                total += 1;
                passed += usize::from(lanes != 0);
                if meets(&ray, &bounds) {
                    meeting += 1;
                    missed += usize::from(lanes == 0);
                    missed_by_plain += usize::from(!plain(&ray, &bounds));
                }
            }
        }
        assert!(meeting > 500_000, "{meeting}");
        assert_eq!(missed, 0, "of {meeting}");
        assert!(missed_by_plain > meeting / 1000, "{missed_by_plain} of {meeting}");
        assert!(passed > meeting && passed <= total);
    }

    #[test]
    fn boxes_that_are_clearly_missed_are_missed() {
        let bounds = Bounds { low: Vec3::splat(-1.0), high: Vec3::splat(1.0) };
        let planes = planes(&bounds);
        for direction in [Vec3::X, Vec3::new(0.8, 0.6, 0.0), Vec3::new(0.6, -0.0, 0.8)] {
            let ray = |origin| Ray { origin, direction, t_min: 0.0, t_max: 100.0 };
            let lanes = |ray: Ray, limit| PreparedRay::new(&ray, &bounds).unwrap().slabs(Plain, &planes, limit).0;
            assert_eq!(lanes(ray(-5.0 * direction), 100.0), 1 << LANE);
            assert_eq!(lanes(ray(-5.0 * direction), 3.0), 0, "beyond the limit");
            assert_eq!(lanes(ray(5.0 * direction), 100.0), 0, "behind");
            assert_eq!(lanes(ray(-5.0 * direction + Vec3::new(0.0, 1.001, 0.0) * 3.0), 100.0), 0, "beside");
        }
    }
}
