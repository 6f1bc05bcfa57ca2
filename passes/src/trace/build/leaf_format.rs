//! What the builder asks of a leaf: how many triangles it holds, and what it costs.

use super::input::{Extent, Triangles};
use crate::trace::simd::LANES;
use crate::trace::tree::{Bounds, Leaf};

/// Cost of testing a leaf of triangles, where opening a node costs 1.
const LEAF_COST: f32 = 1.3;
/// Cost of a child for each time its node is opened: what it takes of caches and stack. It fills leaves: of 100 bytes a
/// triangle at a million triangles 14 are saved, at the same speed.
const CHILD_COST: f32 = 0.05;

/// A leaf of the wide tree, and what it costs.
pub(crate) trait LeafFormat: Sized + Send {
    /// Triangles in a leaf at most.
    const MOST: usize;
    /// What each child adds to the cost of opening its node, which is 1.
    const CHILD_COST: f32;
    /// What testing a leaf of so many triangles costs, where opening a node costs 1.
    fn cost(triangles: usize) -> f32;
    /// The leaf of some triangles, at most as many as it holds, and their bounds.
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
