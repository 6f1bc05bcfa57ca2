//! The wide tree from obvhs's binary one.

use super::Quality;
use super::binary::binary_tree;
use super::block::Block;
use super::collapse::Plan;
use super::emit::{Emitted, emit};
use super::lanes::LANES;
use super::node::{Child, Node};
use super::query::Bounds;
use super::triangles::{Extent, Survey, Triangles};
use obvhs::ploc::PlocSearchDistance;

/// Levels of nodes that follow the binary tree; below them, subtrees are rebuilt by halving, whose depth is bounded.
pub(super) const FREE_DEPTH: usize = 24;
/// Levels of nodes at most: 2³¹ triangles cut into 8 equal parts until 8 are left take 10 levels, until 3 are left 11.
pub(super) const MAX_DEPTH: usize = FREE_DEPTH + 11;
/// Every node on the way down leaves at most 7 siblings on the stack, and asks for room for eight.
const _: () = assert!(MAX_DEPTH * (LANES - 1) + LANES <= super::stack::STACK);

/// Cost of testing a block of triangles, where opening a node costs 1.
const BLOCK_COST: f32 = 1.3;
/// Cost of a child for each time its node is opened: what it takes of caches and stack. It fills blocks: of 100 bytes a
/// triangle at a million triangles 14 are saved, at the same speed.
const CHILD_COST: f32 = 0.05;

/// Nodes or leaves that a thread takes at a time, where each costs little.
pub(super) const GRAIN: usize = 4096;

/// How much time to spend on the tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    pub(super) search: PlocSearchDistance,
    /// Passes that look at direct neighbours only.
    pub(super) threshold: usize,
    /// Share of the nodes that are put elsewhere where that is better, in a first pass; later passes take fewer.
    pub(super) reinsertion: f32,
}

/// A leaf of the wide tree, and what it costs.
pub(super) trait Leaf: Sized + Send {
    /// Triangles in a leaf at most.
    const MOST: usize;
    /// What each child adds to the cost of opening its node, which is 1.
    const CHILD_COST: f32;
    /// What testing a leaf of so many triangles costs, where opening a node costs 1.
    fn cost(triangles: usize) -> f32;
    /// The leaf of some triangles, at most as many as it holds, and their bounds.
    fn new(triangles: &Triangles<'_>, members: &[u32]) -> (Self, Bounds);
}

impl Leaf for Block {
    const MOST: usize = LANES;
    const CHILD_COST: f32 = CHILD_COST;

    fn cost(_: usize) -> f32 {
        BLOCK_COST
    }

    #[inline]
    fn new(triangles: &Triangles<'_>, members: &[u32]) -> (Self, Bounds) {
        let (mut block, mut extent) = (Self::EMPTY, Extent::EMPTY);
        for (lane, &id) in members.iter().enumerate().take(LANES) {
            block.set(lane, triangles.corners(id), triangles.marked(id));
            extent = extent.union(triangles.extent(id));
        }
        (block, extent.bounds())
    }
}

/// The tree.
pub(super) struct Built<L> {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<L>,
    pub(super) root: Child,
    pub(super) bounds: Bounds,
    /// How many triangles are in it.
    pub(super) triangles: usize,
}

/// Builds the tree over the triangles with finite corners. The result does not depend on the number of threads.
pub(super) fn build<L: Leaf>(triangles: &Triangles<'_>, quality: Quality) -> Built<L> {
    let survey = Survey::new(triangles, L::MOST);
    let (bounds, count) = (survey.bounds, survey.triangles);
    let tree = binary_tree(triangles, survey, quality.effort(count));
    if tree.nodes.is_empty() {
        return Built { nodes: Vec::new(), leaves: Vec::new(), root: Child::NONE, bounds, triangles: 0 };
    }
    let plan = Plan::new::<L>(&tree);
    drop(tree);
    let Emitted { nodes, leaves, root } = emit(&plan, triangles);
    Built { nodes, leaves, root, bounds, triangles: count }
}

#[cfg(test)]
mod tests {
    use super::super::{Bvh, Quality};
    use super::*;
    use curitiba_pipeline::scene::{Batch, Geometry};
    use glam::Vec3;

    /// Waves of triangles, some of them on one spot, enough of them that the work is shared.
    fn waves(count: u32) -> Geometry {
        let mut geometry = Geometry::default();
        for triangle in 0..count {
            let (x, z) = ((triangle % 181) as f32, (triangle / 181) as f32);
            let y = (x * 0.3).sin() + (z * 0.2).cos();
            for [dx, dz] in [[0.0, 0.0], [1.0, 0.1], [0.3, 1.0]] {
                geometry.positions.push(if triangle % 97 == 0 {
                    Vec3::new(dx, 9.0, dz)
                } else {
                    Vec3::new(x + dx, y, z + dz)
                });
            }
            geometry.triangles.push([3 * triangle, 3 * triangle + 1, 3 * triangle + 2]);
        }
        geometry.batches.push(Batch { material: 0, first: 0, count });
        geometry
    }

    fn bytes(bvh: &Bvh) -> (String, String) {
        (format!("{:?}", bvh.nodes), format!("{:?}", bvh.blocks))
    }

    #[test]
    fn the_tree_is_the_same_bit_by_bit_whatever_the_number_of_threads() {
        let geometry = waves(40_000);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| Bvh::build(&geometry, &[], Quality::Balanced))
        };
        let one = with(1);
        let all = bytes(&one);
        for threads in [2, 3, 8] {
            assert!(bytes(&with(threads)) == all, "{threads} threads");
        }
        // The comparison can fail: another effort gives another tree.
        assert!(bytes(&Bvh::build(&geometry, &[], Quality::Fast)) != all);
    }

    #[test]
    fn every_triangle_is_in_one_block_and_every_box_holds_what_is_below_it() {
        for count in [1, 2, 9, 500, 40_000] {
            let geometry = waves(count);
            let bvh = Bvh::build(&geometry, &[], Quality::Balanced);
            let mut seen = vec![0; count as usize];
            let mut pending = vec![(bvh.root, bvh.bounds)];
            let inside = |outer: Bounds, inner: Bounds| outer.union(inner) == outer;
            while let Some((child, bounds)) = pending.pop() {
                if child.is_block() {
                    let block = &bvh.blocks[child.index()];
                    for lane in (0..LANES).filter(|&lane| !block.corners(lane)[0][0].is_nan()) {
                        seen[block.triangle(lane) as usize] += 1;
                        assert!(inside(bounds, Bounds::of(&block.corners(lane).map(Vec3::from))));
                    }
                    continue;
                }
                let node = &bvh.nodes[child.index()];
                for lane in (0..LANES).filter(|&lane| node.children[lane] != Child::NONE) {
                    let own = node.bounds(lane);
                    assert!(inside(bounds, own));
                    pending.push((node.children[lane], own));
                }
            }
            assert!(seen.iter().all(|&times| times == 1), "{count} triangles");
        }
    }
}
