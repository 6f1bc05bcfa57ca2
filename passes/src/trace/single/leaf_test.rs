//! The watertight test of one ray against the eight triangles of a leaf.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use crate::trace::ray::Hit;
use crate::trace::rounding::{DOUBT, LARGEST_SQUARE, SMALLEST_SQUARE, UNIT_ROUNDOFF, Verdict};
use crate::trace::simd::{F8, Mask, NO_LANES, Simd, first_lane, without_first};
use crate::trace::tree::{Leaf, Line, PreparedRay};

impl Leaf {
    /// One corner of all triangles, relative to the ray's origin and sheared. The coordinate along the main axis is not needed.
    #[inline(always)]
    fn shear<S: Simd>(&self, simd: S, line: &Line, corner: usize) -> [S::Vector; 2] {
        let [x, y, z] = line.axes;
        let position = &self.corners[corner];
        let along = simd.sub(simd.load(&position[z]), simd.splat(line.origin[z]));
        let across_x = simd.sub(simd.load(&position[x]), simd.splat(line.origin[x]));
        let across_y = simd.sub(simd.load(&position[y]), simd.splat(line.origin[y]));
        [
            simd.sub(across_x, simd.mul(simd.splat(line.shear[0]), along)),
            simd.sub(across_y, simd.mul(simd.splat(line.shear[1]), along)),
        ]
    }

    /// Calls `found` for the hits of the leaf with `t_min < t <= t_limit`, until it returns true.
    ///
    /// `found` receives the hit, whether its triangle is transparent, and `t_limit`, which it may lower. `found` returns whether to stop,
    /// and this function returns whether it stopped.
    #[inline(always)]
    pub(crate) fn intersect<S: Simd>(
        &self,
        simd: S,
        ray: &PreparedRay,
        t_limit: &mut f32,
        found: impl FnMut(Hit, bool, &mut f32) -> bool,
    ) -> bool {
        let Some(Passed { lanes, edges, .. }) = self.passed(simd, &ray.line) else { return false };
        let edges = [simd.store(edges[0]), simd.store(edges[1]), simd.store(edges[2])];
        self.solve_all(ray, lanes, &edges, t_limit, found)
    }

    /// Whether a triangle of the leaf stops a ray. The result is that of [`Self::intersect`], but distances are computed only where
    /// [`decide`] is not certain. `ray` returns the fully prepared ray; it is called only where distances are computed.
    #[inline(always)]
    pub(crate) fn stops<S: Simd>(
        &self,
        simd: S,
        line: &Line,
        ray: impl FnOnce() -> PreparedRay,
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> bool {
        let Some(Passed { lanes, inside, edges }) = self.passed(simd, line) else { return false };
        let Verdict { hit, miss } = decide(simd, self, line);
        if hit & inside & !simd.negative(&self.ids) != NO_LANES {
            return true;
        }
        let lanes = lanes & !miss;
        let edges = [simd.store(edges[0]), simd.store(edges[1]), simd.store(edges[2])];
        lanes != NO_LANES && self.stops_surely(&ray(), lanes, &edges, accept)
    }

    /// Whether one of the triangles in `lanes`, which the ray's line passes through, stops it. Computes distances.
    #[inline(never)]
    fn stops_surely(
        &self,
        ray: &PreparedRay,
        lanes: Mask,
        edges: &[F8; 3],
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> bool {
        let t_max = ray.line.t_max;
        self.solve_all(ray, lanes, edges, &mut { t_max }, |hit, transparent, _| {
            hit.t < t_max && (!transparent || accept(&hit))
        })
    }

    /// Whether a triangle whose id `blocks` accepts stops a ray. The result is that of [`Self::stops`] where all triangles are transparent
    /// and the closure decides by the id; but here the closure is called before a distance is computed.
    #[inline(always)]
    pub(crate) fn stops_by<S: Simd>(&self, simd: S, ray: &PreparedRay, blocks: &mut impl FnMut(u32) -> bool) -> bool {
        let Some(Passed { lanes, inside, edges }) = self.passed(simd, &ray.line) else { return false };
        let Verdict { hit, miss } = decide(simd, self, &ray.line);
        let mut sure = hit & inside;
        while sure != NO_LANES {
            if blocks(self.triangle(first_lane(sure))) {
                return true;
            }
            sure = without_first(sure);
        }
        let lanes = lanes & !miss & !(hit & inside);
        let edges = [simd.store(edges[0]), simd.store(edges[1]), simd.store(edges[2])];
        lanes != NO_LANES && self.stops_surely_by(ray, lanes, &edges, blocks)
    }

    #[inline(never)]
    fn stops_surely_by(
        &self,
        ray: &PreparedRay,
        lanes: Mask,
        edges: &[F8; 3],
        blocks: &mut impl FnMut(u32) -> bool,
    ) -> bool {
        let t_max = ray.line.t_max;
        self.solve_all(ray, lanes, edges, &mut { t_max }, |hit, _, _| hit.t < t_max && blocks(hit.triangle))
    }

    /// The triangles that a ray's line passes through; `None` if there are none.
    #[inline(always)]
    fn passed<S: Simd>(&self, simd: S, line: &Line) -> Option<Passed<S>> {
        let a = self.shear(simd, line, 0);
        let b = self.shear(simd, line, 1);
        let c = self.shear(simd, line, 2);
        let edge_a = simd.sub(simd.mul(c[0], b[1]), simd.mul(c[1], b[0]));
        let edge_b = simd.sub(simd.mul(a[0], c[1]), simd.mul(a[1], c[0]));
        let edge_c = simd.sub(simd.mul(b[0], a[1]), simd.mul(b[1], a[0]));
        let least = simd.min_or(simd.min_or(edge_a, edge_b), edge_c);
        let most = simd.max_or(simd.max_or(edge_a, edge_b), edge_c);
        let zero = simd.splat(0.0);
        let lanes = simd.at_most(zero, least) | simd.at_most(most, zero);
        if lanes == NO_LANES {
            return None;
        }
        let inside = !(simd.at_most(least, zero) & simd.at_most(zero, most));
        Some(Passed { lanes, inside, edges: [edge_a, edge_b, edge_c] })
    }

    /// Calls `found` for the hits on the triangles in some lanes; see [`Self::intersect`].
    #[inline(always)]
    fn solve_all(
        &self,
        ray: &PreparedRay,
        mut lanes: Mask,
        edges: &[F8; 3],
        t_limit: &mut f32,
        mut found: impl FnMut(Hit, bool, &mut f32) -> bool,
    ) -> bool {
        while lanes != NO_LANES {
            let lane = first_lane(lanes);
            lanes = without_first(lanes);
            let edges = [edges[0].0[lane], edges[1].0[lane], edges[2].0[lane]];
            let Some((t, u, v)) = self.solve(ray, lane, edges, *t_limit) else { continue };
            let hit = Hit { t, triangle: self.triangle(lane), u, v };
            if found(hit, self.is_transparent(lane), t_limit) {
                return true;
            }
        }
        false
    }

    /// Distance and barycentric coordinates for a lane that passed the sign tests; `None` unless `t_min < t <= t_limit`.
    ///
    /// The edge functions decide whether the triangle is hit. The distance comes from its plane in `f64`: computed from sheared corners,
    /// its error would grow with the triangle, and rays would hit the large walls they start from.
    #[inline(always)]
    fn solve(&self, ray: &PreparedRay, lane: usize, [a, b, c]: [f32; 3], t_limit: f32) -> Option<(f32, f32, f32)> {
        let corners = self.corners(lane);
        let t = ray.plane_distance(&corners);
        let t_min = ray.line.t_min;
        if !(t > t_min && t <= t_limit) && t.is_finite() {
            return None;
        }
        let (u, v) = if a == 0.0 || b == 0.0 || c == 0.0 {
            solve_exactly(&ray.line, &corners)?
        } else {
            let determinant = a + b + c;
            (b / determinant, c / determinant)
        };
        // The distance is clamped to the triangle's own bounds: for a triangle seen edge-on, the plane may be met anywhere. So a ray enters
        // every box around the triangle at or before its hit, and culling by distance does not depend on the tree.
        let (enter, leave) = ray.span(&corners);
        let t = if t < leave { t } else { leave };
        let t = if t < enter { enter } else { t };
        (t > t_min && t <= t_limit).then_some((t, u, v))
    }
}

/// The triangles of a leaf that a ray's line passes through.
struct Passed<S: Simd> {
    /// Triangles whose three edge functions have the same sign. An edge function of 0 matches both signs; it is computed again in `f64`.
    lanes: Mask,
    /// Triangles with no edge function of 0. Lanes outside `lanes` have no meaning.
    inside: Mask,
    edges: [S::Vector; 3],
}

/// The certain verdicts on a ray whose line passes through triangles of a leaf. See `packet/plane_test.rs` for the test and its error bounds.
///
/// Here the normal `n` is the cross product of two edges, in `f32` and not scaled. Let `w` be half the sum of their squared lengths; it is
/// at least the product of their lengths, and so at least any component of `n`. A component of `n` errs by 4 u w, `n · (a - o)` by 8 u w R,
/// and `n · d` by 13 u w: less than the bounds for the scaled normal, times `w`. The other terms scale with `n`, which is at most `w`.
#[inline(always)]
pub(crate) fn decide<S: Simd>(simd: S, leaf: &Leaf, line: &Line) -> Verdict {
    let zero = simd.splat(0.0);
    let (mut edges, mut to, mut square) = ([[zero; 3]; 2], [zero; 3], zero);
    for axis in 0..3 {
        let [a, b, c] = leaf.coordinates(simd, axis);
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
    let bounded = simd.at_most(simd.splat(SMALLEST_SQUARE), square)
        & simd.at_most(simd.splat(SMALLEST_SQUARE), of_p)
        & simd.at_most(of_p, simd.splat(LARGEST_SQUARE));
    let (above_p, below_p) = (simd.at_most(of_p, p), simd.at_most(p, simd.sub(zero, of_p)));
    let (above_q, below_q) = (simd.at_most(of_q, q), simd.at_most(q, simd.sub(zero, of_q)));
    let meets = simd.at_most(parallel, slope) | simd.at_most(slope, simd.sub(zero, parallel));
    Verdict {
        hit: (above_p & above_q | below_p & below_q) & bounded,
        miss: (above_p & below_q | below_p & above_q) & meets & bounded,
    }
}

/// The barycentric coordinates of corners 1 and 2 by edge functions in `f64`, where products of `f32` are exact and the sign of their
/// difference is right; `None` where the signs differ, or all edge functions are 0. This makes shared edges and vertices watertight. In
/// `f32`, the rounded difference of rounded products has the right sign unless it is zero.
#[cold]
#[inline(never)]
fn solve_exactly(line: &Line, corners: &[[f32; 3]; 3]) -> Option<(f32, f32)> {
    let [x, y, z] = line.axes;
    // The operations of `Leaf::shear`, with the same results.
    let [[ax, ay], [bx, by], [cx, cy]] = corners.map(|position| {
        let along = position[z] - line.origin[z];
        let across_x = position[x] - line.origin[x] - line.shear[0] * along;
        let across_y = position[y] - line.origin[y] - line.shear[1] * along;
        [f64::from(across_x), f64::from(across_y)]
    });
    let [a, b, c] = [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax];
    let determinant = a + b + c;
    if (a < 0.0 || b < 0.0 || c < 0.0) && (a > 0.0 || b > 0.0 || c > 0.0) || determinant == 0.0 {
        return None;
    }
    Some(((b / determinant) as f32, (c / determinant) as f32))
}
