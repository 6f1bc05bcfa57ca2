//! The triangles that may block the rays of a tile, gathered from the tree.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::projection::{ProjectedTriangles, Projection, Zone};
use crate::trace::simd::{F16, LANES, Mask, NO_LANES, Simd, WIDE};
use crate::trace::tree::{Child, WideTree};

/// Greatest number of triangles in a list.
pub(crate) const MOST: usize = 512;
/// How many leaves ahead data is prefetched.
const AHEAD: usize = 3;
/// Vectors of sixteen triangles that packets are compared with at a time: with more of them, fewer loop ends are mispredicted.
pub(crate) const GROUP: usize = 4;

/// The triangles that may block the rays of some packets.
#[derive(Debug)]
pub(crate) struct List {
    /// Work lists of the search: indices of nodes, visited and not, and of leaves.
    nodes: [u32; MOST + LANES],
    leaves: [u32; MOST + LANES],
    /// Coordinates of the triangles, `[corner][axis]`.
    corners: [[Coordinates; 3]; 3],
    pub(crate) ids: [u32; MOST + WIDE],
    /// Projections of the triangles that are being compared.
    pub(crate) projected: [ProjectedTriangles; GROUP],
    /// For each triangle, the index of its leaf and its lane there. `lane_of` is filled only if `gather` was called with `LANES_TOO`.
    pub(crate) leaf_of: [u32; MOST + WIDE],
    pub(crate) lane_of: [u32; MOST + WIDE],
    pub(crate) len: usize,
}

/// One coordinate of all triangles.
type Coordinates = [F16; MOST / WIDE + 1];

impl Default for List {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl List {
    #[expect(clippy::large_stack_arrays, reason = "there once a thread: tracing runs no other work meanwhile")]
    pub(crate) const EMPTY: Self = Self {
        nodes: [0; MOST + LANES],
        leaves: [0; MOST + LANES],
        corners: [[[F16::ZERO; MOST / WIDE + 1]; 3]; 3],
        ids: [0; MOST + WIDE],
        projected: [ProjectedTriangles::EMPTY; GROUP],
        leaf_of: [0; MOST + WIDE],
        lane_of: [0; MOST + WIDE],
        len: 0,
    };

    /// Collects the triangles that rays of a zone may hit. Returns false if there are more than `longest` triangles, nodes or leaves.
    ///
    /// All nodes are visited before all leaves, in the order in which they are found, so the next node is known before the visit of the
    /// previous one ends. Children are appended without a branch. `LANES_TOO` says whether `lane_of` is needed.
    #[inline(always)]
    pub(crate) fn gather<S: Simd, const LANES_TOO: bool>(
        &mut self,
        simd: S,
        (tree, projection): (&WideTree, &Projection),
        zone: &Zone,
        longest: usize,
    ) -> bool {
        let (mut nodes, mut leaves) = (0, 0);
        if tree.root.is_leaf() {
            (self.leaves[0], leaves) = (tree.root.0, 1);
        } else {
            (self.nodes[0], nodes) = (tree.root.0, 1);
        }
        let mut next = 0;
        while next < nodes {
            let node = &tree.nodes[self.nodes[next] as usize];
            next += 1;
            let lanes = projection.children(simd, node, zone);
            let numbers = node.numbers();
            let ends = simd.negative(numbers) & lanes;
            leaves = append(simd, &mut self.leaves, leaves, (numbers, ends));
            nodes = append(simd, &mut self.nodes, nodes, (numbers, lanes & !ends));
            if nodes > longest || leaves > longest {
                return false;
            }
        }
        self.len = 0;
        for place in 0..leaves {
            if place + AHEAD < leaves {
                simd.prefetch(&tree.leaves[Child(self.leaves[place + AHEAD]).index()]);
            }
            let index = Child(self.leaves[place]).index();
            let leaf = &tree.leaves[index];
            let lanes = projection.triangles(simd, leaf, zone);
            for corner in 0..3 {
                for axis in 0..3 {
                    let values: &mut [u32] = bytemuck::cast_slice_mut(&mut self.corners[corner][axis]);
                    append(simd, values, self.len, (leaf.bits(corner, axis), lanes));
                }
            }
            self.leaf_of[self.len..self.len + LANES].copy_from_slice(&[index as u32; LANES]);
            if LANES_TOO {
                append(simd, &mut self.lane_of, self.len, (&[0, 1, 2, 3, 4, 5, 6, 7], lanes));
            }
            self.len = append(simd, &mut self.ids, self.len, (leaf.ids(), lanes));
            if self.len > longest {
                return false;
            }
        }
        true
    }

    /// Projects sixteen of the triangles.
    #[inline(always)]
    pub(crate) fn project<S: Simd>(
        &self,
        simd: S,
        (projection, hits_are_certain): (&Projection, bool),
        zone: &Zone,
        chunk: usize,
    ) -> ProjectedTriangles {
        let [a, b, c] = &self.corners;
        let triangles = [
            [&a[0][chunk], &a[1][chunk], &a[2][chunk]],
            [&b[0][chunk], &b[1][chunk], &b[2][chunk]],
            [&c[0][chunk], &c[1][chunk], &c[2][chunk]],
        ];
        let mut opaque = NO_LANES;
        if hits_are_certain {
            let (ids, _) = self.ids[chunk * WIDE..].as_chunks::<LANES>();
            opaque = !(simd.negative(&ids[0]) | simd.negative(&ids[1]) << LANES);
        }
        ProjectedTriangles::new(simd, projection, zone, &triangles, opaque)
    }
}

/// Appends the chosen ones of eight numbers to a list of length `len`, and returns its new length.
#[inline(always)]
fn append<S: Simd>(simd: S, list: &mut [u32], len: usize, (numbers, chosen): (&[u32; LANES], Mask)) -> usize {
    list[len..len + LANES].copy_from_slice(&simd.compress(numbers, chosen));
    len + chosen.count_ones() as usize
}
