//! The properties of a leaf format that the builder needs: how many triangles a leaf holds, and what it costs.

use super::input::{Extent, Triangles};
use crate::trace::simd::LANES;
use crate::trace::tree::{Bounds, Leaf};

/// Cost of testing a leaf of triangles, where opening a node costs 1.
const LEAF_COST: f32 = 1.3;
/// What each child adds to the cost of opening its node: its share of caches and stack. This fills leaves better: at a
/// million triangles it saves 14 of 100 bytes a triangle, at the same speed.
const CHILD_COST: f32 = 0.05;

/// A format of leaves of the wide tree, with their costs.
pub(crate) trait LeafFormat: Sized + Send {
    /// Greatest number of triangles in a leaf.
    const MOST: usize;
    /// What each child adds to the cost of opening its node, where opening costs 1.
    const CHILD_COST: f32;
    /// Cost of testing a leaf of that many triangles, where opening a node costs 1.
    fn cost(triangles: usize) -> f32;
    /// A leaf of the triangles `members`, at most [`Self::MOST`], and their bounds.
    fn new(triangles: &Triangles<'_>, members: &[u32]) -> (Self, Bounds);
}

impl LeafFormat for Leaf {
    const MOST: usize = LANES;
    const CHILD_COST: f32 = CHILD_COST;

    fn cost(_: usize) -> f32 {
        LEAF_COST
    }

    #[inline]
    fn new(triangles: &Triangles<'_>, members: &[u32]) -> (Self, Bounds) {
        let (mut leaf, mut extent) = (Self::EMPTY, Extent::EMPTY);
        for (lane, &id) in members.iter().enumerate().take(LANES) {
            leaf.set(lane, triangles.corners(id), triangles.marked(id));
            extent = extent.union(triangles.extent(id));
        }
        (leaf, extent.bounds())
    }
}
