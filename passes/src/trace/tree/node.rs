//! Nodes of the wide tree.

use super::volumes::{Bounds, Plane};
use crate::trace::simd::{F8, LANES, Mask, Simd};

/// Reference to a child: the index of a node; or the index of a leaf, with the top bit set; or [`Child::NONE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub(crate) struct Child(pub(crate) u32);

impl Child {
    /// No child.
    pub(crate) const NONE: Self = Self(u32::MAX);
    const LEAF: u32 = 1 << 31;

    pub(crate) fn node(index: usize) -> Self {
        debug_assert!(index < Self::LEAF as usize);
        Self(index as u32)
    }

    pub(crate) fn leaf(index: usize) -> Self {
        debug_assert!(index < Self::LEAF as usize);
        Self(index as u32 | Self::LEAF)
    }

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

impl Default for Child {
    fn default() -> Self {
        Self::NONE
    }
}

/// Eight children as a structure of arrays. Unused lanes have empty bounds, which no ray meets.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// `[low, high][axis]`.
    pub(crate) planes: [[F8; 3]; 2],
    pub(crate) children: [Child; LANES],
}

impl Node {
    pub(crate) const EMPTY: Self = Self {
        planes: [[F8([f32::INFINITY; LANES]); 3], [F8([f32::NEG_INFINITY; LANES]); 3]],
        children: [Child::NONE; LANES],
    };

    /// Loads the planes into registers.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S) -> [[S::Vector; 3]; 2] {
        let [[a, b, c], [d, e, f]] = &self.planes;
        [[simd.load(a), simd.load(b), simd.load(c)], [simd.load(d), simd.load(e), simd.load(f)]]
    }

    /// The children whose bounds meet a box.
    #[inline(always)]
    pub(crate) fn overlapping<S: Simd>(&self, simd: S, low: &[f32; 3], high: &[f32; 3]) -> Mask {
        let zero = simd.splat(0.0);
        let mut outside = zero;
        for axis in 0..3 {
            let above = simd.sub(simd.load(&self.planes[0][axis]), simd.splat(high[axis]));
            let below = simd.sub(simd.splat(low[axis]), simd.load(&self.planes[1][axis]));
            outside = simd.max_or(simd.max_or(above, below), outside);
        }
        simd.at_most(outside, zero)
    }

    /// The lanes in use.
    #[inline(always)]
    pub(crate) fn used<S: Simd>(&self, simd: S) -> Mask {
        simd.at_most(simd.load(&self.planes[0][0]), simd.load(&self.planes[1][0]))
    }

    /// The children as numbers; leaves have the top bit set.
    #[inline(always)]
    pub(crate) fn numbers(&self) -> &[u32; LANES] {
        bytemuck::cast_ref(&self.children)
    }

    /// The children that certainly lie behind a plane or on it: no ray into the half space in front of it hits anything
    /// in them.
    #[inline(always)]
    pub(crate) fn behind<S: Simd>(&self, simd: S, plane: Plane) -> Mask {
        let [low, high] = self.load(simd);
        plane.behind(simd, low, high)
    }

    /// Bounds of the child in a lane.
    pub(crate) fn bounds(&self, lane: usize) -> Bounds {
        let [low, high] = [0, 1].map(|side: usize| [0, 1, 2].map(|axis: usize| self.planes[side][axis].0[lane]));
        Bounds { low: low.into(), high: high.into() }
    }

    /// Bounds of all children; unused lanes add nothing.
    pub(crate) fn whole(&self) -> Bounds {
        (0..LANES).fold(Bounds::EMPTY, |all, lane| all.union(self.bounds(lane)))
    }

    /// Puts a child into a lane.
    pub(crate) fn set(&mut self, lane: usize, bounds: Bounds, child: Child) {
        for axis in 0..3 {
            self.planes[0][axis].0[lane] = bounds.low[axis];
            self.planes[1][axis].0[lane] = bounds.high[axis];
        }
        self.children[lane] = child;
    }
}
