//! The eight triangles of a leaf as cones seen from one origin: finds rays that certainly miss all of them.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use crate::trace::rounding::{EDGE_ERROR, LARGEST, SMALLEST};
use crate::trace::simd::{Mask, NO_LANES, Simd};
use crate::trace::tree::{Leaf, Plane};

/// The triangles of a leaf seen from one point: each is the cone of the planes through the point and its edges.
pub(crate) struct LeafCones<S: Simd> {
    /// Normals of the planes through the point and each edge.
    edges: [[S::Vector; 3]; 3],
    /// For each edge, a bound on the sum of two errors: of a direction's dot product with the normal, and of the watertight test.
    errors: [S::Vector; 3],
    /// Triangles that a ray may hit.
    possible: Mask,
    /// Triangles for which the error bounds hold.
    bounded: Mask,
}

impl<S: Simd> LeafCones<S> {
    /// The cones of a leaf's triangles. If `plane` is given, no ray goes behind it.
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

    /// Whether certainly no ray hits the leaf.
    #[inline(always)]
    pub(crate) fn are_missed(&self) -> bool {
        self.possible == NO_LANES
    }

    /// Whether a ray may hit the leaf. If `false`, it certainly misses all triangles.
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
