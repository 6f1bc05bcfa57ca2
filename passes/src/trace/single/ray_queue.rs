//! A queue of single rays, each with the nodes that it has yet to visit. The queue takes several steps at a time.
//!
//! The steps of a single ray depend on each other: each waits for its node from memory, for the test of the children, and for the choice of
//! the next child. Most of the time, the processor also mispredicts how many children are met. Here the pending nodes of several rays are
//! in one list, and eight are taken from its end at a time, so that no step needs the result of the step before it. Children are appended
//! by one vector instruction, however many they are. Leaves that are met go to a second list, and are tested before more nodes are taken.

use super::traverse::occluded;
use crate::trace::ray::Hit;
use crate::trace::simd::{LANES, Mask, NO_LANES, Simd, without_first};
use crate::trace::tree::{Child, Leaf, List, Node, PreparedRay, WideTree};

/// Up to sixteen prepared occlusion rays.
pub(crate) trait QueuedRays {
    /// The children of a node that a ray meets.
    fn meeting<S: Simd>(&self, simd: S, node: &Node, ray: usize) -> Mask;
    /// Whether a triangle of a leaf stops a ray.
    fn is_stopped<S: Simd>(&self, simd: S, ray: usize, leaf: &Leaf, accept: &mut impl FnMut(&Hit) -> bool) -> bool;
    /// A ray in the form in which it is prepared alone.
    fn prepared(&self, ray: usize) -> PreparedRay;
}

/// Where at most this many rays are left in a subtree, they go on singly.
pub(crate) const FEW: usize = 4;
/// Pairs of subtree and ray that are collected before the rays go on. More would keep the processor busier, but would waste work on rays
/// that are stopped early: the nodes that they have yet to visit are dropped.
const ENOUGH: u32 = 8;
/// Capacity of the list of nodes and of the list of leaves.
const WAITING: usize = 256;

/// Pending nodes or leaves, each with its ray.
pub(crate) type Waiting = List<WAITING>;

/// The pending nodes and leaves of up to sixteen single rays.
///
/// The lists are borrowed: as fields they would be copied when the queue is made, although they are empty.
pub(crate) struct RayQueue<'a> {
    nodes: &'a mut Waiting,
    leaves: &'a mut Waiting,
    /// Pairs of subtree and ray that were added since the last [`Self::finish`].
    parts: u32,
}

impl<'a> RayQueue<'a> {
    /// An empty queue; both lists must be empty.
    #[inline(always)]
    pub(crate) fn new(nodes: &'a mut Waiting, leaves: &'a mut Waiting) -> Self {
        Self { nodes, leaves, parts: 0 }
    }

    /// Whether anything is pending.
    #[inline(always)]
    pub(crate) fn is_waiting(&self) -> bool {
        self.parts > 0
    }

    /// Adds a subtree for at most [`FEW`] rays. Returns whether it is time for [`Self::finish`].
    #[inline(always)]
    pub(crate) fn leave(&mut self, part: Child, mut rays: Mask) -> bool {
        let count = rays.count_ones();
        let list = if part.is_leaf() { &mut *self.leaves } else { &mut *self.nodes };
        let mut some = [0; FEW];
        for ray in &mut some {
            *ray = rays.trailing_zeros() as u8;
            rays = without_first(rays);
        }
        list.append_rays(part.0, some, count);
        self.parts += count;
        self.parts >= ENOUGH
    }

    /// Traces all pending rays to their ends. Returns those of `open` that are still open. `accept` also receives the ray.
    #[inline(always)]
    pub(crate) fn finish<S: Simd>(
        &mut self,
        simd: S,
        tree: &WideTree,
        rays: &impl QueuedRays,
        mut open: Mask,
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) -> Mask {
        self.parts = 0;
        loop {
            while self.leaves.len() > 0 {
                let (leaf, ray) = self.leaves.pop();
                if open >> ray & 1 == 1 {
                    let leaf = &tree.leaves[Child(leaf).index()];
                    let stopped = rays.is_stopped(simd, ray, leaf, &mut |hit: &Hit| accept(ray, hit));
                    open &= !(Mask::from(stopped) << ray);
                }
            }
            if self.nodes.len() == 0 {
                return open;
            }
            if self.nodes.len() > WAITING - LANES * LANES {
                open &= !self.alone(simd, tree, rays, open, accept);
                continue;
            }
            let some = self.nodes.take();
            for index in 0..some.len() {
                let (node, ray) = some.get(index);
                if open >> ray & 1 == 1 {
                    self.step(simd, tree, rays, (node, ray));
                }
            }
        }
    }

    /// Visits a node for a ray: appends the children that it meets.
    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, tree: &WideTree, rays: &impl QueuedRays, (node, ray): (u32, usize)) {
        let node = &tree.nodes[Child(node).index()];
        let met = rays.meeting(simd, node, ray);
        let children = node.numbers();
        let leaves = met & simd.negative(children);
        let nodes = met & !leaves;
        self.nodes.append(simd.compress(children, nodes), ray as u8, nodes.count_ones());
        self.leaves.append(simd.compress(children, leaves), ray as u8, leaves.count_ones());
    }

    /// Traces the pending nodes to their ends, ray by ray, when the list might have no room for more nodes. Returns the rays that are
    /// stopped.
    #[cold]
    #[inline(never)]
    fn alone<S: Simd>(
        &mut self,
        simd: S,
        tree: &WideTree,
        rays: &impl QueuedRays,
        open: Mask,
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) -> Mask {
        let mut stopped = NO_LANES;
        while self.nodes.len() > 0 {
            let (node, ray) = self.nodes.pop();
            if (open & !stopped) >> ray & 1 == 1 {
                let mut accept = |hit: &Hit| accept(ray, hit);
                stopped |= Mask::from(occluded(simd, tree, Child(node), &rays.prepared(ray), &mut accept)) << ray;
            }
        }
        stopped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::packet::{Octants, PreparedPacket};
    use crate::trace::simd::{Detected, Kernel, Plain};
    use crate::trace::{Bvh, Packet, Quality, Ray, Tracer};
    use curitiba_pipeline::scene::{Batch, Geometry};
    use glam::Vec3;

    struct Chosen<'a>(&'a [u32; LANES], Mask);

    impl Kernel<(Mask, [u32; LANES])> for Chosen<'_> {
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> (Mask, [u32; LANES]) {
            (simd.negative(self.0), simd.compress(self.0, self.1))
        }
    }

    /// Slivers along a diagonal, one above the other: rays beside the diagonal enter all boxes but hit nothing, except for the last
    /// triangle.
    fn pile(count: u32) -> Geometry {
        let mut geometry = Geometry::default();
        for index in 0..count {
            let z = index as f32;
            let sliver = [Vec3::new(-1.0, -1.0, z), Vec3::new(1.0, 1.0, z), Vec3::new(1.0, 1.001, z)];
            let stop = [Vec3::new(0.2, -0.9, z), Vec3::new(0.9, -0.9, z), Vec3::new(0.9, -0.2, z)];
            geometry.positions.extend(if index + 1 < count { sliver } else { stop });
            geometry.triangles.push([3 * index, 3 * index + 1, 3 * index + 2]);
        }
        geometry.batches.push(Batch { material: 0, first: 0, count });
        geometry
    }

    #[test]
    fn rays_come_to_their_ends_though_more_waits_than_there_is_room_for() {
        let bvh = Bvh::build(&pile(4096), &[], Quality::Fast);
        let mut packet = Packet::new(0.0, f32::INFINITY);
        for lane in 0..16 {
            let away = lane as f32 * 0.01;
            let stopped = lane % 3 == 0;
            let (x, y) = if stopped { (0.7 + away, -0.7 + 0.5 * away) } else { (-0.5 - away, 0.5) };
            packet.set(lane, Vec3::new(x, y, -1.0), Vec3::Z);
        }
        let octants = Octants::of(&packet);
        let mut rays = PreparedPacket::EMPTY;
        rays.prepare(Plain, &packet, (octants.valid(), octants.get(0)), &bvh.tree.bounds);
        let (mut nodes, mut leaves) = (Waiting::new(), Waiting::new());
        let mut queue = RayQueue::new(&mut nodes, &mut leaves);
        // The root is added repeatedly: each batch of eight nodes appends 64 nodes, and none of these 64 is visited before the batch ends.
        assert!(
            bvh.tree.nodes[bvh.tree.root.index()]
                .children
                .iter()
                .all(|child| *child != Child::NONE && !child.is_leaf())
        );
        for round in 0..40 {
            queue.leave(bvh.tree.root, 0b1111 << (4 * (round % 4)));
        }
        let open = queue.finish(Plain, &bvh.tree, &rays, rays.open, &mut |_, _| true);
        for lane in 0..16 {
            let ray: Ray = packet.ray(lane);
            assert_eq!(open >> lane & 1 == 0, bvh.occluded(&ray, |_| true), "{lane}");
            assert_eq!(open >> lane & 1 == 0, lane % 3 == 0);
        }
        assert!(!queue.is_waiting());
    }

    #[test]
    fn children_are_chosen_alike_on_every_instruction_set() {
        use crate::trace::simd::InstructionSet::{Avx2, Avx512, Portable};
        let children = [5, 1 << 31, 7, 8 | 1 << 31, 9, 10, u32::MAX, 0];
        for detected in [Avx512, Avx2, Portable].into_iter().filter_map(Detected::new) {
            for mask in 0..1 << LANES {
                let (negative, chosen) = detected.run(Chosen(&children, mask));
                assert_eq!(negative, 0b0100_1010);
                let expected: Vec<u32> =
                    (0..LANES).filter(|lane| mask >> lane & 1 == 1).map(|lane| children[lane]).collect();
                assert_eq!(chosen[..expected.len()], expected, "{mask:b}");
            }
        }
    }
}
