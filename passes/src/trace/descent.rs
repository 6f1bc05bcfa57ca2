//! Up to sixteen rays of one octant down the tree together, a ray a lane, until few of them are left; those go on alone.
//!
//! A node's eight children are first tested at once against the interval of all rays of the beam (Boulos, Wald and Shirley,
//! "Geometric and Arithmetic Culling Methods for Entire Ray Packets", 2006), those that it meets against the sixteen rays;
//! with the triangles of a block it is the same. Every bound is computed by the operations of the single ray's box test,
//! which are monotone, from the extremes of their operands: rounding included, no box is left out that any single ray's test
//! would enter. What is hit, and where, has the bits that it has ray by ray.

use super::Hit;
use super::beam::Beam;
use super::block::Block;
use super::bvh::{Bvh, approach, closest};
use super::extremes::Extremes;
use super::lanes::{Mask, NO_LANES, Simd, first_lane, first_wide_lane, without_first};
use super::node::{Child, Node};
use super::stack::Stack;
use super::wave::{self, Rays as _, Waiting, Wave};

/// Rays up to which those that look for the nearest hits in a part of the tree, or at a block, go on alone.
const FEW: u32 = 3;

/// What is still to be visited: where the first ray may enter it (the bits of the distance, which order as it does), the child
/// and its rays.
type Entry = (u32, u32, Mask);

/// Takes beams down a tree. `accept` is told the lane of the ray.
pub(super) struct Descent<'a, A> {
    pub(super) bvh: &'a Bvh,
    pub(super) accept: A,
}

impl<A: FnMut(usize, &Hit) -> bool> Descent<'_, A> {
    /// Closes the open rays of a beam that anything stops, and says which they are.
    #[inline(always)]
    pub(super) fn stopped<S: Simd>(&mut self, simd: S, beam: &mut Beam) -> Mask {
        let (asked, extremes) = (beam.open, beam.extremes(simd));
        let mut stack = Stack::<Entry>::new();
        let mut nodes = Waiting::new();
        let mut blocks = Waiting::new();
        let mut wave = Wave::new(&mut nodes, &mut blocks);
        let (mut current, mut mask) = (self.bvh.root, beam.open);
        loop {
            if mask.count_ones() as usize <= wave::FEW {
                if wave.leave(current, mask) {
                    beam.open = wave.finish(simd, self.bvh, beam, beam.open, &mut self.accept);
                }
            } else if current.is_block() {
                self.test::<S, false>(simd, beam, (current, mask), &extremes);
            } else {
                self.visit::<S, false>(simd, beam, (current, mask), &extremes, &mut stack);
            }
            loop {
                let Some((_, child, met)) = stack.pop() else {
                    if wave.is_waiting() {
                        beam.open = wave.finish(simd, self.bvh, beam, beam.open, &mut self.accept);
                    }
                    return asked & !beam.open;
                };
                mask = met & beam.open;
                if mask != NO_LANES {
                    current = Child(child);
                    break;
                }
            }
        }
    }

    /// Finds the nearest hits of all open rays below `entry`.
    #[inline(always)]
    pub(super) fn descend<S: Simd>(&mut self, simd: S, beam: &mut Beam, extremes: &Extremes, entry: Child) {
        let mut stack = Stack::<Entry>::new();
        let (mut current, mut mask) = (entry, beam.open);
        loop {
            if mask.count_ones() <= FEW {
                self.one_by_one(simd, beam, current, mask);
            } else if current.is_block() {
                self.test::<S, true>(simd, beam, (current, mask), extremes);
            } else {
                self.visit::<S, true>(simd, beam, (current, mask), extremes, &mut stack);
            }
            loop {
                let Some((enter, child, met)) = stack.pop() else { return };
                mask = met & beam.open & beam.reaching(simd, f32::from_bits(enter));
                if mask != NO_LANES {
                    current = Child(child);
                    break;
                }
            }
        }
    }

    /// Takes rays on alone.
    #[inline(always)]
    fn one_by_one<S: Simd>(&mut self, simd: S, beam: &mut Beam, current: Child, mut mask: Mask) {
        let Self { bvh, accept } = self;
        while mask != NO_LANES {
            let ray = first_wide_lane(mask);
            mask = without_first(mask);
            let query = beam.query(ray);
            let mut accept = |hit: &Hit| accept(ray, hit);
            let mut best = beam.best(ray);
            if current.is_block() {
                let mut limit = best.map_or(query.line.t_max, |best| best.t);
                let block = &bvh.blocks[current.index()];
                approach(simd, block, &query, (&mut limit, &mut best), &mut accept);
            } else {
                closest(simd, bvh, current, &query, &mut best, &mut accept);
            }
            if let Some(best) = best {
                beam.keep(ray, &best);
            }
        }
    }

    /// Tests the triangles of a block, sixteen rays at a time.
    #[inline(always)]
    fn test<S: Simd, const NEAREST: bool>(
        &mut self,
        simd: S,
        beam: &mut Beam,
        (current, mask): (Child, Mask),
        extremes: &Extremes,
    ) {
        let block: &Block = &self.bvh.blocks[current.index()];
        // Unused lanes are not numbers, which restrict nothing.
        let mut lanes = block.used(simd) & extremes.meets(simd, block.bounds(simd)).0;
        while lanes != NO_LANES {
            let lane = first_lane(lanes);
            lanes = without_first(lanes);
            if NEAREST {
                beam.approach(simd, (block, lane), &mut self.accept);
            } else {
                beam.stop(simd, (block, lane), &mut self.accept);
                if beam.open & mask == NO_LANES {
                    return;
                }
            }
        }
    }

    /// Pushes the children that any of the rays meets, with those that do.
    #[inline(always)]
    fn visit<S: Simd, const NEAREST: bool>(
        &self,
        simd: S,
        beam: &Beam,
        (current, mask): (Child, Mask),
        extremes: &Extremes,
        stack: &mut Stack<Entry>,
    ) {
        let node: &Node = &self.bvh.nodes[current.index()];
        let (mut lanes, enter) = extremes.meets(simd, node.load(simd));
        let enter = simd.store(enter);
        let bottom = stack.len();
        while lanes != NO_LANES {
            let lane = first_lane(lanes);
            lanes = without_first(lanes);
            let met = beam.entering(simd, &node.planes, lane) & mask;
            if met != NO_LANES {
                let child = node.children[lane];
                self.bvh.prefetch(simd, child);
                stack.push((enter.0[lane].to_bits(), child.0, met));
            }
        }
        if NEAREST {
            stack.sort_from(bottom);
        }
    }
}
