//! Traverses the tree with up to sixteen rays of one octant, one a lane, until few of them are left; those go on singly.
//!
//! A node's eight children are first tested at once against the interval of all rays of the packet (Boulos, Wald and Shirley, "Geometric
//! and Arithmetic Culling Methods for Entire Ray Packets", 2006); the children that it meets are tested against the sixteen rays. The
//! triangles of a leaf are treated likewise. The interval test uses the operations of the single ray's slab test, which are monotone, on
//! the interval of their operands. So, rounding included, no box is culled that a single ray's test would enter, and the results are bit
//! for bit those of single rays.

use super::interval::Interval;
use super::prepared_packet::PreparedPacket;
use crate::trace::ray::Hit;
use crate::trace::simd::{Mask, NO_LANES, Simd, first_lane, first_wide_lane, without_first};
use crate::trace::single::{self, QueuedRays as _, RayQueue, Waiting, approach, closest};
use crate::trace::tree::{Child, Leaf, Node, Stack, WideTree};

/// In closest-hit queries, rays go on singly where at most this many are left in a subtree or at a leaf.
const FEW: u32 = 3;

/// A pending visit: a lower bound of the distance at which any ray enters the child (as bits, which order like the non-negative
/// distance), the child, and the mask of its rays.
type Entry = (u32, u32, Mask);

/// Traverses the tree with a packet. `accept` also receives the lane of the ray.
pub(crate) struct Descent<'a, A> {
    pub(crate) tree: &'a WideTree,
    pub(crate) accept: A,
}

impl<A: FnMut(usize, &Hit) -> bool> Descent<'_, A> {
    /// Removes the blocked rays from `packet.open`, and returns their mask.
    #[inline(always)]
    pub(crate) fn stopped<S: Simd>(&mut self, simd: S, packet: &mut PreparedPacket) -> Mask {
        let (asked, interval) = (packet.open, packet.interval(simd));
        let mut stack = Stack::<Entry>::new();
        let mut nodes = Waiting::new();
        let mut leaves = Waiting::new();
        let mut queue = RayQueue::new(&mut nodes, &mut leaves);
        let (mut current, mut mask) = (self.tree.root, packet.open);
        loop {
            if mask.count_ones() as usize <= single::FEW {
                if queue.leave(current, mask) {
                    packet.open = queue.finish(simd, self.tree, packet, packet.open, &mut self.accept);
                }
            } else if current.is_leaf() {
                self.test::<S, false>(simd, packet, (current, mask), &interval);
            } else {
                self.visit::<S, false>(simd, packet, (current, mask), &interval, &mut stack);
            }
            loop {
                let Some((_, child, met)) = stack.pop() else {
                    if queue.is_waiting() {
                        packet.open = queue.finish(simd, self.tree, packet, packet.open, &mut self.accept);
                    }
                    return asked & !packet.open;
                };
                mask = met & packet.open;
                if mask != NO_LANES {
                    current = Child(child);
                    break;
                }
            }
        }
    }

    /// Finds the nearest hits of all open rays below `entry`.
    #[inline(always)]
    pub(crate) fn descend<S: Simd>(&mut self, simd: S, packet: &mut PreparedPacket, interval: &Interval, entry: Child) {
        let mut stack = Stack::<Entry>::new();
        let (mut current, mut mask) = (entry, packet.open);
        loop {
            if mask.count_ones() <= FEW {
                self.one_by_one(simd, packet, current, mask);
            } else if current.is_leaf() {
                self.test::<S, true>(simd, packet, (current, mask), interval);
            } else {
                self.visit::<S, true>(simd, packet, (current, mask), interval, &mut stack);
            }
            loop {
                let Some((enter, child, met)) = stack.pop() else { return };
                mask = met & packet.open & packet.reaching(simd, f32::from_bits(enter));
                if mask != NO_LANES {
                    current = Child(child);
                    break;
                }
            }
        }
    }

    /// Traces the rays of a mask singly, below `current`.
    #[inline(always)]
    fn one_by_one<S: Simd>(&mut self, simd: S, packet: &mut PreparedPacket, current: Child, mut mask: Mask) {
        let Self { tree, accept } = self;
        while mask != NO_LANES {
            let ray = first_wide_lane(mask);
            mask = without_first(mask);
            let prepared = packet.prepared(ray);
            let mut accept = |hit: &Hit| accept(ray, hit);
            let mut best = packet.best(ray);
            if current.is_leaf() {
                let mut limit = best.map_or(prepared.line.t_max, |best| best.t);
                let leaf = &tree.leaves[current.index()];
                approach(simd, leaf, &prepared, (&mut limit, &mut best), &mut accept);
            } else {
                closest(simd, tree, current, &prepared, &mut best, &mut accept);
            }
            if let Some(best) = best {
                packet.keep(ray, &best);
            }
        }
    }

    /// Tests the triangles of a leaf, sixteen rays at a time.
    #[inline(always)]
    fn test<S: Simd, const NEAREST: bool>(
        &mut self,
        simd: S,
        packet: &mut PreparedPacket,
        (current, mask): (Child, Mask),
        interval: &Interval,
    ) {
        let leaf: &Leaf = &self.tree.leaves[current.index()];
        // Unused lanes hold NaN, which the interval test does not reject, so they are masked out.
        let mut lanes = leaf.used(simd) & interval.meets(simd, leaf.bounds(simd)).0;
        while lanes != NO_LANES {
            let lane = first_lane(lanes);
            lanes = without_first(lanes);
            if NEAREST {
                packet.approach(simd, (leaf, lane), &mut self.accept);
            } else {
                packet.stop(simd, (leaf, lane), &mut self.accept);
                if packet.open & mask == NO_LANES {
                    return;
                }
            }
        }
    }

    /// Pushes the children that any ray meets, each with the mask of the rays that meet it.
    #[inline(always)]
    fn visit<S: Simd, const NEAREST: bool>(
        &self,
        simd: S,
        packet: &PreparedPacket,
        (current, mask): (Child, Mask),
        interval: &Interval,
        stack: &mut Stack<Entry>,
    ) {
        let node: &Node = &self.tree.nodes[current.index()];
        let (mut lanes, enter) = interval.meets(simd, node.load(simd));
        let enter = simd.store(enter);
        let bottom = stack.len();
        while lanes != NO_LANES {
            let lane = first_lane(lanes);
            lanes = without_first(lanes);
            let met = packet.entering(simd, &node.planes, lane) & mask;
            if met != NO_LANES {
                let child = node.children[lane];
                self.tree.prefetch(simd, child);
                stack.push((enter.0[lane].to_bits(), child.0, met));
            }
        }
        if NEAREST {
            stack.sort_from(bottom);
        }
    }
}
