//! Triangles as cones: sixteen triangles seen from one origin, each tested against sixteen rays at a time. The test is cheap, and decides
//! all but a few rays.
//!
//! Seen from a common origin, a triangle is bounded by the three planes through the origin and its edges, and by its own plane. A ray is
//! tested by its dot products with the four normals. These are computed in `f32`, with a bound on the sum of their error and of the error
//! of the watertight test of [`Leaf`]. Where a product is farther from 0 than the bound, the two tests agree; all other rays go to the
//! watertight test. So the result is the same, bit for bit, as testing each ray by itself.

use crate::trace::rounding::{
    DISTANCE_MARGIN, EDGE_ERROR, EDGE_ON, HEIGHT_ERROR, LARGEST, LONGEST, PLANE_ERROR, SHARPEST, SIDE_ERROR, SMALLEST,
    Verdict,
};
use crate::trace::simd::{F16, Mask, NO_LANES, Simd, WIDE, load_axes, vector_at};
use crate::trace::tree::{Ball, Leaf, Plane, TRANSPARENT};
use glam::{DVec3, Vec3};

/// Up to sixteen triangles, with the numbers that do not depend on the rays' origin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TriangleGroup {
    /// `[corner][axis]`.
    corners: [[F16; 3]; 3],
    /// Normals whose largest component is 1; NaN for triangles so thin that the cone test must not decide by their planes.
    normal: [F16; 3],
    /// Lengths of the normals.
    length: F16,
    /// Height of each triangle's plane above the neighbourhood's centre, along the normal.
    height: F16,
    ids: [u32; WIDE],
    /// Lanes in use, one bit a triangle, transparent triangles included.
    used: Mask,
    transparent: Mask,
}

/// An origin and the interval of its rays, in the form that the tests use.
pub(crate) struct Viewpoint {
    pub(crate) origin: Vec3,
    /// No ray goes behind this plane.
    pub(crate) plane: Option<Plane>,
    /// All rays stay in this ball.
    pub(crate) ball: Ball,
    pub(crate) t_min: f32,
    pub(crate) t_max: f32,
    /// The centre that heights are measured from.
    pub(crate) center: Vec3,
}

/// The triangles of a group, seen from one origin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cones {
    /// Normals of the planes through the origin and each edge, pointing towards the triangle, divided by their error bounds.
    edges: [[F16; 3]; 3],
    /// Normals of the triangles, away from the origin, largest component 1.
    normal: [F16; 3],
    /// A ray with `direction · normal` at most this certainly misses the triangle: it meets the plane beyond `t_max`, or behind the origin.
    /// Nearly parallel rays are included, unless the triangle is seen edge-on: then the watertight test may find a hit.
    miss: F16,
    /// A ray with `direction · normal` of at least this certainly meets the plane before `t_max`; NaN for transparent triangles, whose hits
    /// need `accept`.
    hit: F16,
    /// A ray with `direction · normal` at most this certainly meets the plane after `t_min`.
    after: F16,
    /// Triangles that a ray may hit.
    pub(crate) seen: Mask,
    /// Triangles for which it is certain on which side of their plane the origin is. For the others, not even the signs of the edge normals
    /// are certain.
    sided: Mask,
    /// Index of the group.
    pub(crate) group: u32,
}

impl TriangleGroup {
    pub(crate) const EMPTY: Self = Self {
        corners: [[F16::ZERO; 3]; 3],
        normal: [F16::ZERO; 3],
        length: F16::ZERO,
        height: F16::ZERO,
        ids: [0; WIDE],
        used: NO_LANES,
        transparent: NO_LANES,
    };

    /// Empties the group. The data of its lanes stays, and is not read.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        (self.used, self.transparent) = (NO_LANES, NO_LANES);
    }

    /// The lanes in use.
    #[inline(always)]
    pub(crate) fn used(&self) -> Mask {
        self.used
    }

    /// Puts a triangle into a lane; [`Self::finish`] must follow before the group is tested.
    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, corners: [[f32; 3]; 3], id: u32, transparent: bool) {
        for (own, corner) in self.corners.iter_mut().zip(corners) {
            for axis in 0..3 {
                own[axis].0[lane] = corner[axis];
            }
        }
        self.ids[lane] = id;
        self.used |= 1 << lane;
        self.transparent |= u32::from(transparent) << lane;
    }

    /// Computes the triangles' planes, once for all origins.
    #[inline(always)]
    pub(crate) fn finish(&mut self, center: Vec3) {
        let center = center.as_dvec3();
        let (mut normals, mut lengths, mut heights) = ([[0.0; WIDE]; 3], [0.0; WIDE], [0.0; WIDE]);
        // A loop of fixed length over arrays is vectorised.
        for lane in 0..WIDE {
            let at = |corner: &[F16; 3]| {
                let [x, y, z] = [corner[0].0[lane], corner[1].0[lane], corner[2].0[lane]];
                DVec3::new(f64::from(x), f64::from(y), f64::from(z))
            };
            let [a, b, c] = [at(&self.corners[0]), at(&self.corners[1]), at(&self.corners[2])];
            let (ab, ac) = (b - a, c - a);
            let normal = ab.cross(ac);
            let size = normal.abs().max_element();
            let trusted = size > SHARPEST * ab.abs().max_element() * ac.abs().max_element();
            let normal = normal * if trusted { 1.0 / size } else { f64::NAN };
            normals[0][lane] = normal.x as f32;
            normals[1][lane] = normal.y as f32;
            normals[2][lane] = normal.z as f32;
            lengths[lane] = normal.length() as f32;
            heights[lane] = normal.dot(a - center) as f32;
        }
        self.normal = normals.map(F16);
        self.length = F16(lengths);
        self.height = F16(heights);
    }

    /// Computes the cones of the triangles in `near`, leaving out those that no ray can hit. Returns `false` if none is left. For a
    /// degenerate triangle no hit is certain, and a miss only by the planes of the edges.
    ///
    /// With `o` the origin, `a`, `b`, `c` the corners relative to it, `n` the normal (largest component 1, away from the origin) and
    /// `h = n · a` its height above the origin, whose error is at most `ε`:
    ///
    /// * the planes through the origin and the edges are `b x c`, `c x a`, `a x b`, each divided by its error `EDGE_ERROR max|b| max|c|`,
    ///   and negated where `n` was negated. If the dot product of a plane and a direction `d` is above 1, the edge function is certainly
    ///   positive; if it is below -1, certainly negative;
    /// * a ray meets the plane at `t = h / n · d`. It is met before `t_max` if `n · d >= h / t_max + m` (`hit`), and beyond it if
    ///   `n · d <= h / t_max - m` (`miss`), with the margin `m = ε / t_max + MARGIN h / t_max + PLANE_ERROR`. With `t_min` in place of
    ///   `t_max`, the second condition says that the plane is met after `t_min` (`after`);
    /// * where `h` is below `EDGE_ON max(|a|, |b|, |c|)`, the triangle is seen edge-on, and `miss` is only certain behind the origin.
    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]
    pub(crate) fn seen_from<S: Simd>(&self, simd: S, near: Mask, view: &Viewpoint, cones: &mut Cones) -> bool {
        let zero = simd.wide_splat(0.0);
        let mut seen = near & self.near(simd, &view.ball, view.plane);
        if seen == NO_LANES {
            return false;
        }
        let corners = self.seen_from_point(simd, view.origin);
        let moved = view.origin - view.center;
        let mut height = simd.wide_load(&self.height);
        let error = simd.wide_about_mul_add(
            simd.wide_abs(height),
            simd.wide_splat(HEIGHT_ERROR),
            simd.wide_splat(HEIGHT_ERROR * moved.abs().element_sum()),
        );
        let mut normal = [zero; 3];
        for axis in 0..3 {
            normal[axis] = simd.wide_load(&self.normal[axis]);
            height = simd.wide_about_mul_add(simd.wide_splat(-moved[axis]), normal[axis], height);
        }
        // Normals must point away from the origin; the edge normals change sign with them.
        let turned = simd.wide_below(height, zero);
        for axis in 0..3 {
            let opposite = simd.wide_sub(zero, normal[axis]);
            cones.normal[axis] = simd.wide_store(simd.wide_select(turned, opposite, normal[axis]));
        }
        let sizes = [largest(simd, &corners[0]), largest(simd, &corners[1]), largest(simd, &corners[2])];
        let least = simd.wide_min_or(simd.wide_min_or(sizes[0], sizes[1]), sizes[2]);
        let most = simd.wide_max_or(simd.wide_max_or(sizes[0], sizes[1]), sizes[2]);
        let bounded =
            simd.wide_at_most(simd.wide_splat(SMALLEST), least) & simd.wide_at_most(most, simd.wide_splat(LARGEST));
        let unit = simd.wide_select(turned, simd.wide_splat(-EDGE_ERROR), simd.wide_splat(EDGE_ERROR));
        let unit = simd.wide_select(bounded, unit, simd.wide_splat(f32::NAN));
        for (edge, (from, to)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
            let scale = simd.wide_mul(simd.wide_mul(unit, sizes[from]), sizes[to]);
            let scale = simd.wide_div(simd.wide_splat(1.0), scale);
            let (from, to) = (&corners[from], &corners[to]);
            for axis in 0..3 {
                let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
                let (a, b) = (simd.wide_mul(from[next], to[last]), simd.wide_mul(from[last], to[next]));
                cones.edges[edge][axis] = simd.wide_store(simd.wide_mul(simd.wide_sub(a, b), scale));
            }
        }

        let height = simd.wide_abs(height);
        let sided = simd.wide_below(error, height);
        let broad = sided & simd.wide_at_most(simd.wide_mul(most, simd.wide_splat(EDGE_ON)), height);
        let (least, margin) = interval(simd, height, error, view.t_max);
        let beyond = simd.wide_sub(least, margin);
        // No direction is longer than `LONGEST`, so no ray reaches a plane that is at least this far.
        let reach = simd.wide_mul(simd.wide_load(&self.length), simd.wide_splat(LONGEST * LONGEST));
        seen &= !(broad & simd.wide_at_most(reach, beyond));
        let after = if view.t_min > 0.0 {
            let (most, margin) = interval(simd, height, error, view.t_min);
            simd.wide_sub(most, margin)
        } else {
            simd.wide_splat(f32::INFINITY)
        };
        cones.miss = simd.wide_store(simd.wide_select(broad, beyond, simd.wide_splat(-PLANE_ERROR)));
        let within = simd.wide_add(least, margin);
        cones.hit = simd.wide_store(simd.wide_select(self.transparent, simd.wide_splat(f32::NAN), within));
        cones.after = simd.wide_store(after);
        cones.sided = sided;
        cones.seen = seen;
        seen != NO_LANES
    }

    /// The triangles whose bounds meet a ball and that are not wholly behind a plane.
    #[inline(always)]
    pub(crate) fn near<S: Simd>(&self, simd: S, ball: &Ball, plane: Option<Plane>) -> Mask {
        let zero = simd.wide_splat(0.0);
        let mut distance = zero;
        for axis in 0..3 {
            let [a, b, c] = [&self.corners[0][axis], &self.corners[1][axis], &self.corners[2][axis]];
            let [a, b, c] = [simd.wide_load(a), simd.wide_load(b), simd.wide_load(c)];
            let least = simd.wide_min_or(simd.wide_min_or(a, b), c);
            let most = simd.wide_max_or(simd.wide_max_or(a, b), c);
            let below = simd.wide_sub(simd.wide_splat(ball.origins.low[axis]), most);
            let above = simd.wide_sub(least, simd.wide_splat(ball.origins.high[axis]));
            let away = simd.wide_max_or(simd.wide_max_or(below, above), zero);
            distance = simd.wide_about_mul_add(away, away, distance);
        }
        let mut near = self.used & !simd.wide_at_most(simd.wide_splat(ball.square), distance);
        if let Some(plane) = plane
            && near != NO_LANES
        {
            near &= !behind(simd, &self.seen_from_point(simd, plane.origin), plane.normal);
        }
        near
    }

    /// The corners relative to a point.
    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]
    fn seen_from_point<S: Simd>(&self, simd: S, point: Vec3) -> [[S::Wide; 3]; 3] {
        let mut corners = [[simd.wide_splat(0.0); 3]; 3];
        for axis in 0..3 {
            let origin = simd.wide_splat(point[axis]);
            for corner in 0..3 {
                corners[corner][axis] = simd.wide_sub(simd.wide_load(&self.corners[corner][axis]), origin);
            }
        }
        corners
    }

    /// One triangle, in the first lane of a leaf, for the watertight test.
    pub(crate) fn leaf(&self, lane: usize) -> Leaf {
        let mut leaf = Leaf::EMPTY;
        let corners = self.corners.each_ref().map(|corner| vector_at(corner, lane));
        let flag = if self.transparent >> lane & 1 == 1 { TRANSPARENT } else { 0 };
        leaf.set(0, corners, self.ids[lane] | flag);
        leaf
    }
}

/// The lanes whose triangles certainly lie behind a plane or on it. `corners` are relative to a point of the plane. Each sum is compared
/// with its own rounding error, as in [`Plane::behind`].
#[inline(always)]
fn behind<S: Simd>(simd: S, corners: &[[S::Wide; 3]; 3], normal: Vec3) -> Mask {
    let zero = simd.wide_splat(0.0);
    let mut lanes = !NO_LANES;
    for corner in corners {
        let mut sum = zero;
        for axis in 0..3 {
            let product = simd.wide_mul(corner[axis], simd.wide_splat(normal[axis]));
            let above = simd.wide_about_mul_add(simd.wide_abs(product), simd.wide_splat(SIDE_ERROR), product);
            sum = simd.wide_add(sum, above);
        }
        lanes &= simd.wide_at_most(sum, zero);
    }
    lanes
}

/// The value of `direction · normal` for which a ray meets planes of these heights at `distance`, and the error bound of that value.
#[inline(always)]
fn interval<S: Simd>(simd: S, height: S::Wide, error: S::Wide, distance: f32) -> (S::Wide, S::Wide) {
    let nearness = simd.wide_splat(1.0 / distance);
    let at = simd.wide_mul(height, nearness);
    let margin = simd.wide_about_mul_add(at, simd.wide_splat(DISTANCE_MARGIN), simd.wide_splat(PLANE_ERROR));
    (at, simd.wide_about_mul_add(error, nearness, margin))
}

#[inline(always)]
fn largest<S: Simd>(simd: S, [x, y, z]: &[S::Wide; 3]) -> S::Wide {
    simd.wide_max_or(simd.wide_max_or(simd.wide_abs(*x), simd.wide_abs(*y)), simd.wide_abs(*z))
}

/// One triangle of [`Cones`], each of its numbers in all lanes of a vector.
pub(crate) struct Cone<S: Simd> {
    edges: [[S::Wide; 3]; 3],
    normal: [S::Wide; 3],
    miss: S::Wide,
    hit: S::Wide,
    after: S::Wide,
    /// Whether the origin lies clearly off the triangle's plane.
    pub(crate) is_sided: bool,
}

impl<S: Simd> Cone<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, cones: &Cones, lane: usize) -> Self {
        let [a, b, c] = &cones.edges;
        Self {
            edges: [splat(simd, a, lane), splat(simd, b, lane), splat(simd, c, lane)],
            normal: splat(simd, &cones.normal, lane),
            miss: simd.wide_splat(cones.miss.0[lane]),
            hit: simd.wide_splat(cones.hit.0[lane]),
            after: simd.wide_splat(cones.after.0[lane]),
            is_sided: cones.sided >> lane & 1 == 1,
        }
    }

    /// The certain verdicts on sixteen rays. `AFTER` must be set if `t_min > 0`, and `SIDED` must equal [`Self::is_sided`]. Comparisons with NaN
    /// are false, so they decide nothing.
    #[inline(always)]
    pub(crate) fn test<const AFTER: bool, const SIDED: bool>(&self, simd: S, directions: &[F16; 3]) -> Verdict {
        let rays = load_axes(simd, directions);
        let (a, b, c) =
            (dot(simd, &rays, &self.edges[0]), dot(simd, &rays, &self.edges[1]), dot(simd, &rays, &self.edges[2]));
        let least = simd.wide_min_or(simd.wide_min_or(a, b), c);
        let (one, minus_one) = (simd.wide_splat(1.0), simd.wide_splat(-1.0));
        let beside = simd.wide_at_most(least, minus_one);
        if !SIDED {
            let most = simd.wide_max_or(simd.wide_max_or(a, b), c);
            return Verdict { hit: NO_LANES, miss: beside & simd.wide_at_most(one, most) };
        }
        let along = dot(simd, &rays, &self.normal);
        let miss = beside | simd.wide_at_most(along, self.miss);
        let mut hit = simd.wide_at_most(one, least) & simd.wide_at_most(self.hit, along);
        if AFTER {
            hit &= simd.wide_at_most(along, self.after);
        }
        Verdict { hit, miss }
    }
}

impl Cones {
    pub(crate) const EMPTY: Self = Self {
        edges: [[F16::ZERO; 3]; 3],
        normal: [F16::ZERO; 3],
        miss: F16::ZERO,
        hit: F16::ZERO,
        after: F16::ZERO,
        seen: NO_LANES,
        sided: NO_LANES,
        group: 0,
    };
}

/// Each of three components of a lane, in all lanes of a vector.
#[inline(always)]
fn splat<S: Simd>(simd: S, values: &[F16; 3], lane: usize) -> [S::Wide; 3] {
    [simd.wide_splat(values[0].0[lane]), simd.wide_splat(values[1].0[lane]), simd.wide_splat(values[2].0[lane])]
}

#[inline(always)]
fn dot<S: Simd>(simd: S, [x, y, z]: &[S::Wide; 3], normal: &[S::Wide; 3]) -> S::Wide {
    simd.wide_about_mul_add(*z, normal[2], simd.wide_about_mul_add(*y, normal[1], simd.wide_mul(*x, normal[0])))
}
