//! The wide tree: nodes of eight children above leaves of eight triangles.

use super::leaf::Leaf;
use super::node::{Child, Node};
use super::volumes::Bounds;
use crate::trace::simd::Simd;

/// A tree of nodes with eight children and leaves of eight triangles. Data only: [`build`](crate::trace) makes it, and every traversal
/// reads it.
pub(crate) struct WideTree {
    /// Nodes, each before its subtrees.
    pub(crate) nodes: Vec<Node>,
    pub(crate) leaves: Vec<Leaf>,
    pub(crate) root: Child,
    /// Bounds of all triangles.
    pub(crate) bounds: Bounds,
}

impl WideTree {
    /// Prefetches a node or leaf that will be visited later.
    #[inline(always)]
    pub(crate) fn prefetch<S: Simd>(&self, simd: S, child: Child) {
        if child.is_leaf() {
            simd.prefetch(&self.leaves[child.index()]);
        } else {
            simd.prefetch(&self.nodes[child.index()]);
        }
    }
}
