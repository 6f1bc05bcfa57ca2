//! Blocks of up to eight triangles and the watertight test of one ray against all of them.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::Hit;
use super::clear::{Ball, Plane};
use super::face::decide;
use super::facet::{EDGE_ERROR, LARGEST, SMALLEST, Verdict};
use super::lanes::{F8, LANES, Mask, NO_LANES, Simd, first_lane, without_first};
use super::query::{Line, Query};
use glam::Vec3;

/// Marks a triangle whose hits need the accept closure; the other bits are its id.
pub(super) const TRANSPARENT: u32 = 1 << 31;

/// Up to eight triangles, structure of arrays. Unused lanes hold NaN, which no comparison accepts.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Block {
    /// `[corner][axis]`.
    corners: [[F8; 3]; 3],
    /// Triangle ids, with [`TRANSPARENT`].
    ids: [u32; LANES],
}

impl Block {
    pub(super) const EMPTY: Self = Self { corners: [[F8([f32::NAN; LANES]); 3]; 3], ids: [0; LANES] };

    /// Puts a triangle into a lane.
    pub(super) fn set(&mut self, lane: usize, corners: [Vec3; 3], id: u32) {
        for (corner, position) in corners.iter().enumerate() {
            for axis in 0..3 {
                self.corners[corner][axis].0[lane] = position[axis];
            }
        }
        self.ids[lane] = id;
    }

    /// The corners of the triangle in a lane.
    #[inline(always)]
    pub(super) fn corners(&self, lane: usize) -> [[f32; 3]; 3] {
        [self.corner(0, lane), self.corner(1, lane), self.corner(2, lane)]
    }

    /// The coordinates of the three corners of all triangles along an axis; unused lanes hold NaN.
    #[inline(always)]
    pub(super) fn coordinates<S: Simd>(&self, simd: S, axis: usize) -> [S::Vector; 3] {
        let [a, b, c] = &self.corners;
        [simd.load(&a[axis]), simd.load(&b[axis]), simd.load(&c[axis])]
    }

    /// The bits of a coordinate of all triangles.
    #[inline(always)]
    pub(super) fn bits(&self, corner: usize, axis: usize) -> &[u32; LANES] {
        bytemuck::cast_ref(&self.corners[corner][axis].0)
    }

    /// The ids of all triangles, with [`TRANSPARENT`].
    #[inline(always)]
    pub(super) fn ids(&self) -> &[u32; LANES] {
        &self.ids
    }

    /// The id of the triangle in a lane.
    #[inline(always)]
    pub(super) fn triangle(&self, lane: usize) -> u32 {
        self.ids[lane] & !TRANSPARENT
    }

    /// Whether hits on the triangle in a lane need the accept closure.
    #[inline(always)]
    pub(super) fn is_transparent(&self, lane: usize) -> bool {
        self.ids[lane] & TRANSPARENT != 0
    }

    /// The lanes that are used.
    #[inline(always)]
    pub(super) fn used<S: Simd>(&self, simd: S) -> Mask {
        let first = simd.load(&self.corners[0][0]);
        simd.at_most(first, first)
    }

    /// Bounds of all triangles, `[low, high][axis]`; unused lanes hold NaN.
    #[inline(always)]
    pub(super) fn bounds<S: Simd>(&self, simd: S) -> [[S::Vector; 3]; 2] {
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
    pub(super) fn overlapping<S: Simd>(&self, simd: S, low: &[f32; 3], high: &[f32; 3]) -> Mask {
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

    /// The lanes whose triangles are certainly met by no ray that leaves to the near side of a plane.
    #[inline(always)]
    pub(super) fn behind<S: Simd>(&self, simd: S, plane: Plane) -> Mask {
        let mut lanes = !NO_LANES;
        for corner in &self.corners {
            let position = [simd.load(&corner[0]), simd.load(&corner[1]), simd.load(&corner[2])];
            lanes &= plane.behind(simd, position, position);
        }
        lanes
    }

    /// The lanes whose triangles' bounds certainly lie outside a ball.
    #[inline(always)]
    pub(super) fn outside<S: Simd>(&self, simd: S, ball: &Ball) -> Mask {
        let [low, high] = self.bounds(simd);
        ball.misses(simd, low, high)
    }

    /// One corner of all triangles as the ray sees it: sheared. Where it lies along the main axis is not needed.
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

    /// Shows `found` the hits of the block with `t_min < t <= t_limit`, and stops when it returns true.
    ///
    /// `found` gets the hit and whether its triangle is transparent, and returns whether to stop; `t_limit` is what it
    /// left. Returns whether it stopped.
    #[inline(always)]
    pub(super) fn intersect<S: Simd>(
        &self,
        simd: S,
        query: &Query,
        t_limit: &mut f32,
        found: impl FnMut(Hit, bool, &mut f32) -> bool,
    ) -> bool {
        let Some(Passed { lanes, edges, .. }) = self.passed(simd, &query.line) else { return false };
        let edges = [simd.store(edges[0]), simd.store(edges[1]), simd.store(edges[2])];
        self.solve_all(query, lanes, &edges, t_limit, found)
    }

    /// Whether anything stops a ray, as [`Self::intersect`] has it, but without distances where bounds on their errors tell
    /// ([`decide`]). `query` is asked for the rest of what is prepared of the ray if it is needed.
    #[inline(always)]
    pub(super) fn stops<S: Simd>(
        &self,
        simd: S,
        line: &Line,
        query: impl FnOnce() -> Query,
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> bool {
        let Some(Passed { lanes, inside, edges }) = self.passed(simd, line) else { return false };
        let Verdict { hit, miss } = decide(simd, self, line);
        if hit & inside & !simd.negative(&self.ids) != NO_LANES {
            return true;
        }
        let lanes = lanes & !miss;
        let edges = [simd.store(edges[0]), simd.store(edges[1]), simd.store(edges[2])];
        lanes != NO_LANES && self.stops_surely(&query(), lanes, &edges, accept)
    }

    /// Whether one of some triangles that a ray's line passes through stops it.
    #[inline(never)]
    fn stops_surely(&self, query: &Query, lanes: Mask, edges: &[F8; 3], accept: &mut impl FnMut(&Hit) -> bool) -> bool {
        let t_max = query.line.t_max;
        self.solve_all(query, lanes, edges, &mut { t_max }, |hit, transparent, _| {
            hit.t < t_max && (!transparent || accept(&hit))
        })
    }

    /// The triangles that a ray's line passes through, if there are any.
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

    /// Shows `found` what is hit of the triangles in some lanes, see [`Self::intersect`].
    #[inline(always)]
    fn solve_all(
        &self,
        query: &Query,
        mut lanes: Mask,
        edges: &[F8; 3],
        t_limit: &mut f32,
        mut found: impl FnMut(Hit, bool, &mut f32) -> bool,
    ) -> bool {
        while lanes != NO_LANES {
            let lane = first_lane(lanes);
            lanes = without_first(lanes);
            let edges = [edges[0].0[lane], edges[1].0[lane], edges[2].0[lane]];
            let Some((t, u, v)) = self.solve(query, lane, edges, *t_limit) else { continue };
            let hit = Hit { t, triangle: self.triangle(lane), u, v };
            if found(hit, self.is_transparent(lane), t_limit) {
                return true;
            }
        }
        false
    }

    /// Distance and barycentric coordinates in one lane that passed the sign tests.
    ///
    /// The edge functions say whether the triangle is hit. The distance comes from its plane in `f64`: from sheared
    /// corners it would have an error that grows with the triangle, and rays would hit the large walls they start from.
    #[inline(always)]
    fn solve(&self, query: &Query, lane: usize, [a, b, c]: [f32; 3], t_limit: f32) -> Option<(f32, f32, f32)> {
        let corners = self.corners(lane);
        let t = query.plane_distance(&corners);
        let t_min = query.line.t_min;
        if !(t > t_min && t <= t_limit) && t.is_finite() {
            return None;
        }
        let (u, v) = if a == 0.0 || b == 0.0 || c == 0.0 {
            solve_exactly(&query.line, &corners)?
        } else {
            let determinant = a + b + c;
            (b / determinant, c / determinant)
        };
        // The distance is kept within the triangle's own bounds: seen edge-on, the plane may be met anywhere. So no box
        // around the triangle is entered beyond its hit, and culling by distance does not depend on the tree.
        let (enter, leave) = query.interval(&corners);
        let t = if t < leave { t } else { leave };
        let t = if t < enter { enter } else { t };
        (t > t_min && t <= t_limit).then_some((t, u, v))
    }

    /// The triangles as rays from one point see them. With a plane, no ray goes to its far side.
    #[inline(always)]
    pub(super) fn cones<S: Simd>(&self, simd: S, origin: [f32; 3], plane: Option<Plane>) -> Cones<S> {
        let zero = simd.splat(0.0);
        let mut corners = [[zero; 3]; 3];
        let mut sizes = [zero; 3];
        for corner in 0..3 {
            for axis in 0..3 {
                let value = simd.sub(simd.load(&self.corners[corner][axis]), simd.splat(origin[axis]));
                corners[corner][axis] = value;
                sizes[corner] = simd.max_or(simd.max_or(value, simd.sub(zero, value)), sizes[corner]);
            }
        }
        let mut edges = [[zero; 3]; 3];
        let mut errors = [zero; 3];
        for (edge, (from, to)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
            for axis in 0..3 {
                let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
                let a = simd.mul(corners[from][next], corners[to][last]);
                edges[edge][axis] = simd.sub(a, simd.mul(corners[from][last], corners[to][next]));
            }
            errors[edge] = simd.mul(simd.mul(sizes[from], sizes[to]), simd.splat(EDGE_ERROR));
        }
        let least = simd.min_or(simd.min_or(sizes[0], sizes[1]), sizes[2]);
        let most = simd.max_or(simd.max_or(sizes[0], sizes[1]), sizes[2]);
        let bounded = simd.at_most(simd.splat(SMALLEST), least) & simd.at_most(most, simd.splat(LARGEST));
        let mut possible = self.used(simd);
        if let Some(plane) = plane {
            possible &= !self.behind(simd, plane);
        }
        Cones { edges, errors, possible, bounded }
    }

    #[inline(always)]
    fn corner(&self, corner: usize, lane: usize) -> [f32; 3] {
        let [x, y, z] = &self.corners[corner];
        [x.0[lane], y.0[lane], z.0[lane]]
    }
}

/// Triangles that a ray's line passes through.
struct Passed<S: Simd> {
    /// All of them: where the edge functions have one sign, or are 0 and have to be looked at more closely.
    lanes: Mask,
    /// Those where none is 0, if it is one of them.
    inside: Mask,
    edges: [S::Vector; 3],
}

/// Triangles as rays from one point see them: each is the cone of the planes through the point and its edges.
pub(super) struct Cones<S: Simd> {
    /// Normals of these planes.
    edges: [[S::Vector; 3]; 3],
    /// How far a direction's dot products with them, and the watertight test, may be from the truth.
    errors: [S::Vector; 3],
    /// Triangles that any ray may meet.
    possible: Mask,
    /// Those for which the errors are bounded.
    bounded: Mask,
}

impl<S: Simd> Cones<S> {
    /// Whether certainly no ray is stopped.
    #[inline(always)]
    pub(super) fn are_missed(&self) -> bool {
        self.possible == NO_LANES
    }

    /// Whether a ray may be stopped; its line certainly passes by all triangles where not.
    #[inline(always)]
    pub(super) fn may_stop(&self, simd: S, direction: [f32; 3]) -> bool {
        let (x, y, z) = (simd.splat(direction[0]), simd.splat(direction[1]), simd.splat(direction[2]));
        let (mut above, mut below) = (NO_LANES, NO_LANES);
        let zero = simd.splat(0.0);
        for edge in 0..3 {
            let [a, b, c] = self.edges[edge];
            let side = simd.about_mul_add(c, z, simd.about_mul_add(b, y, simd.mul(a, x)));
            above |= simd.at_most(self.errors[edge], side);
            below |= simd.at_most(side, simd.sub(zero, self.errors[edge]));
        }
        self.possible & !(above & below & self.bounded) != NO_LANES
    }
}

/// The barycentric coordinates of corners 1 and 2 by edge functions in `f64`, where products of `f32` are exact and the
/// sign of their difference is right: what makes shared edges and vertices watertight. In `f32`, the rounded difference of
/// rounded products has the right sign unless it is zero.
#[cold]
#[inline(never)]
fn solve_exactly(line: &Line, corners: &[[f32; 3]; 3]) -> Option<(f32, f32)> {
    let [x, y, z] = line.axes;
    // The operations of `Block::shear`, with the same results.
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
