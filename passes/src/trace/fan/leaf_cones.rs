//! The eight triangles of a leaf as rays from one origin see them: which of the rays certainly pass by all of them.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use crate::trace::rounding::{EDGE_ERROR, LARGEST, SMALLEST};
use crate::trace::simd::{Mask, NO_LANES, Simd};
use crate::trace::tree::{Leaf, Plane};

/// Triangles as rays from one point see them: each is the cone of the planes through the point and its edges.
pub(crate) struct LeafCones<S: Simd> {
    /// Normals of these planes.
    edges: [[S::Vector; 3]; 3],
    /// How far a direction's dot products with them, and the watertight test, may be from the truth.
    errors: [S::Vector; 3],
    /// Triangles that any ray may meet.
    possible: Mask,
    /// Those for which the errors are bounded.
    bounded: Mask,
}

impl<S: Simd> LeafCones<S> {
    /// Those of a leaf. With a plane, no ray goes to its far side.
    #[inline(always)]
    pub(crate) fn new(simd: S, leaf: &Leaf, origin: [f32; 3], plane: Option<Plane>) -> Self {
        let zero = simd.splat(0.0);
        let mut corners = [[zero; 3]; 3];
        let mut sizes = [zero; 3];
        for corner in 0..3 {
            for axis in 0..3 {
                let value = simd.sub(simd.load(&leaf.corners[corner][axis]), simd.splat(origin[axis]));
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
        let mut possible = leaf.used(simd);
        if let Some(plane) = plane {
            possible &= !leaf.behind(simd, plane);
        }
        Self { edges, errors, possible, bounded }
    }

    /// Whether certainly no ray is stopped.
    #[inline(always)]
    pub(crate) fn are_missed(&self) -> bool {
        self.possible == NO_LANES
    }

    /// Whether a ray may be stopped; its line certainly passes by all triangles where not.
    #[inline(always)]
    pub(crate) fn may_stop(&self, simd: S, direction: [f32; 3]) -> bool {
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
