//! Prepared rays that go on by themselves, a step of each at a time.
//!
//! A ray alone waits: for its node, for the test of the children, for which of them to visit next; and the processor guesses how
//! many there are, wrongly most of the time. Here the rays take turns, so that no step needs what the step before it finds,
//! and children go to the ray's stack by one vector instruction, however many they are. The blocks that are met are kept
//! aside and tested after each round.

use super::Hit;
use super::bvh::{Bvh, occluded};
use super::fan::{Apex, Lanes};
use super::lanes::{LANES, Mask, NO_LANES, Simd, WIDE, first_wide_lane, without_first};
use super::node::Child;
use super::stack::{List, STACKED, Stacks};

/// Parts of the tree that are collected before their rays take turns: at first and as long as half of them stop their rays,
/// since what a ray has no more to visit costs nothing; and where fewer do.
const EARLY: u32 = 8;
const LATE: u32 = 32;
const FEW_EARLY: u32 = 3;
const FEW_LATE: u32 = 6;
/// Blocks that may wait besides those of a round.
const WAITING: usize = 64;

/// What up to sixteen rays have yet to visit by themselves.
///
/// The stacks and the list are elsewhere, because they would be copied into it, though there is nothing in them yet.
pub(super) struct Wave<'a> {
    stacks: &'a mut Stacks,
    /// The rays whose stacks are not empty.
    busy: Mask,
    /// Blocks to be tested, each with its ray.
    blocks: &'a mut Blocks,
    /// Parts left to rays since they last took turns, and how many may be.
    parts: u32,
    limit: u32,
}

/// Blocks with the ray of each.
pub(super) type Blocks = List<{ WAITING + WIDE * LANES }>;

impl<'a> Wave<'a> {
    /// With stacks and a list that are empty.
    #[inline(always)]
    pub(super) fn new(stacks: &'a mut Stacks, blocks: &'a mut Blocks) -> Self {
        Self { stacks, busy: NO_LANES, blocks, parts: 0, limit: EARLY }
    }

    /// Rays up to which those in a part of the tree are to be left to it.
    #[inline(always)]
    pub(super) fn few(&self) -> u32 {
        if self.limit == EARLY { FEW_EARLY } else { FEW_LATE }
    }

    /// Whether anything is left to be visited.
    #[inline(always)]
    pub(super) fn is_waiting(&self) -> bool {
        self.parts > 0
    }

    /// Leaves a part of the tree to some rays. Returns whether it is time for [`Self::finish`].
    #[inline(always)]
    pub(super) fn leave(&mut self, part: Child, mut rays: Mask) -> bool {
        self.parts += rays.count_ones();
        let mut room = true;
        if part.is_block() {
            while rays != NO_LANES {
                self.blocks.push(part.0, rays.trailing_zeros());
                rays = without_first(rays);
            }
            room = self.blocks.len() + WIDE <= WAITING;
        } else {
            self.busy |= rays;
            while rays != NO_LANES {
                room &= self.stacks.push(first_wide_lane(rays), part.0) + LANES < STACKED;
                rays = without_first(rays);
            }
        }
        self.parts >= self.limit || !room
    }

    /// Takes all rays to their ends. Returns those that are still open.
    #[inline(always)]
    pub(super) fn finish<S: Simd>(
        &mut self,
        simd: S,
        bvh: &Bvh,
        (apex, lanes): (&Apex, &Lanes),
        mut open: Mask,
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> Mask {
        let before = open;
        loop {
            for index in 0..self.blocks.len() {
                let (block, ray) = self.blocks.get(index);
                let ray = ray & (WIDE - 1);
                if open >> ray & 1 == 1 {
                    let block = &bvh.blocks[Child(block).index()];
                    let stopped = lanes.is_stopped(simd, &apex.start, ray, block, accept);
                    open &= !(Mask::from(stopped) << ray);
                }
            }
            self.blocks.clear();
            let mut rays = self.busy & open;
            if rays == NO_LANES {
                break;
            }
            while rays != NO_LANES {
                let ray = first_wide_lane(rays);
                rays = without_first(rays);
                if self.stacks.len(ray) + LANES < STACKED {
                    self.step(simd, bvh, (apex, lanes), ray);
                } else if self.goes_on_alone(simd, bvh, (apex, lanes), ray, accept) {
                    open &= !(1 << ray);
                }
            }
        }
        self.stacks.clear();
        self.busy = NO_LANES;
        let closed = (before & !open).count_ones();
        self.limit = if 2 * closed >= self.parts { EARLY } else { LATE };
        self.parts = 0;
        open
    }

    /// Looks into the node on top of a ray's stack.
    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, bvh: &Bvh, (apex, lanes): (&Apex, &Lanes), ray: usize) {
        let node = &bvh.nodes[Child(self.stacks.pop(ray)).index()];
        let met = lanes.meeting(simd, node, apex, ray);
        let children = node.numbers();
        let blocks = met & simd.negative(children);
        let nodes = met & !blocks;
        let left = self.stacks.append(ray, simd.compress(children, nodes), nodes.count_ones());
        self.busy = self.busy & !(1 << ray) | Mask::from(left > 0) << ray;
        self.blocks.append(simd.compress(children, blocks), ray as u8, blocks.count_ones());
    }

    /// Takes a ray to its end whose stack could overflow. Returns whether anything stops it.
    #[cold]
    #[inline(never)]
    fn goes_on_alone<S: Simd>(
        &mut self,
        simd: S,
        bvh: &Bvh,
        (apex, lanes): (&Apex, &Lanes),
        ray: usize,
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> bool {
        let query = lanes.query(&apex.start, ray);
        self.busy &= !(1 << ray);
        while self.stacks.len(ray) > 0 {
            if occluded(simd, bvh, Child(self.stacks.pop(ray)), &query, accept) {
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::dispatch::{Detected, Work};

    struct Chosen<'a>(&'a [u32; LANES], Mask);

    impl Work<(Mask, [u32; LANES])> for Chosen<'_> {
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> (Mask, [u32; LANES]) {
            (simd.negative(self.0), simd.compress(self.0, self.1))
        }
    }

    #[test]
    fn children_are_chosen_alike_on_every_instruction_set() {
        use crate::trace::Lanes::{Avx2, Avx512, Portable};
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
