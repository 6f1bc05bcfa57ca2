//! Many short rays from one origin: the triangles in reach are gathered once and each ray is tested against them alone.

use super::block::Block;
use super::bvh::{Bvh, blocked, occluded};
use super::dispatch::{Stack, Work};
use super::lanes::{F8, LANES, Mask, NO_LANES, first_lane, without_first};
use super::node::{Child, Node};
use super::query::{Query, UNIT_ROUNDOFF};
use super::{Hit, Ray};
use glam::Vec3;

/// Blocks gathered at most; with more triangles in reach, each ray is traced by itself.
const GATHERED: usize = 6;
/// Nodes and blocks looked into at most before giving up.
const VISITS: usize = 24;

/// See [`Tracer::count_open`](super::Tracer::count_open).
pub(super) struct CountOpen<'a, A> {
    pub(super) bvh: &'a Bvh,
    pub(super) origin: Vec3,
    pub(super) t_min: f32,
    pub(super) t_max: f32,
    pub(super) directions: &'a [Vec3],
    pub(super) accept: A,
}

impl<A: FnMut(&Hit) -> bool> Work for CountOpen<'_, A> {
    type Output = u32;

    #[inline(always)]
    fn run(mut self) -> u32 {
        let mut blocks = [Block::EMPTY; GATHERED];
        let gathered = if self.directions.len() > 1 { self.gather(&mut blocks) } else { None };
        if gathered == Some(0) {
            return self.directions.len() as u32;
        }
        let mut open = 0;
        for &direction in self.directions {
            let ray = Ray { origin: self.origin, direction, t_min: self.t_min, t_max: self.t_max };
            let stopped = Query::new(&ray, &self.bvh.bounds).is_some_and(|query| match gathered {
                Some(count) => blocks[..count].iter().any(|block| blocked(block, &query, &mut self.accept)),
                None => occluded(self.bvh, &query, &mut self.accept),
            });
            open += u32::from(!stopped);
        }
        open
    }
}

impl<A> CountOpen<'_, A> {
    /// Packs the triangles whose bounds meet the box around all rays into `blocks` and returns how many blocks they
    /// fill; nothing if they do not fit or take too long to find.
    ///
    /// The box is grown by more than the rounding of the triangle test, so that what a ray would hit is in it.
    #[inline(always)]
    fn gather(&self, blocks: &mut [Block; GATHERED]) -> Option<usize> {
        let (mut low, mut high) = (Vec3::ZERO, Vec3::ZERO);
        for direction in self.directions {
            (low, high) = (low.min(*direction), high.max(*direction));
        }
        let bounds = &self.bvh.bounds;
        let reach = (bounds.low - self.origin).abs().max((bounds.high - self.origin).abs());
        let pad = (reach + Vec3::splat(reach.max_element())) * (8.0 * UNIT_ROUNDOFF)
            + self.origin.abs() * (2.0 * UNIT_ROUNDOFF);
        let t = self.t_max * (1.0 + 16.0 * UNIT_ROUNDOFF);
        let (low, high) = (self.origin + low * t - pad, self.origin + high * t + pad);
        if !(low.is_finite() && high.is_finite()) {
            return None;
        }
        let (low, high) = (low.to_array(), high.to_array());

        let mut stack = Stack::new();
        let mut current = self.bvh.root;
        if current == Child::NONE {
            return Some(0);
        }
        let (mut count, mut visits) = (0, 0);
        loop {
            visits += 1;
            if visits > VISITS {
                return None;
            }
            if current.is_block() {
                let block = &self.bvh.blocks[current.index()];
                let mut lanes = block.overlapping(&low, &high);
                while lanes != NO_LANES {
                    let lane = first_lane(lanes);
                    lanes = without_first(lanes);
                    blocks.get_mut(count / LANES)?.copy_lane(count % LANES, block, lane);
                    count += 1;
                }
            } else {
                let node = &self.bvh.nodes[current.index()];
                let mut lanes = overlapping(node, &low, &high);
                while lanes != NO_LANES {
                    stack.push(u64::from(node.children[first_lane(lanes)].0));
                    lanes = without_first(lanes);
                }
            }
            match stack.pop() {
                Some(entry) => current = Child(entry as u32),
                None => return Some(count.div_ceil(LANES)),
            }
        }
    }
}

/// The children whose bounds meet a box.
#[inline(always)]
fn overlapping(node: &Node, low: &[f32; 3], high: &[f32; 3]) -> Mask {
    let mut outside = F8::splat(0.0);
    for axis in 0..3 {
        outside = (node.planes[0][axis] - F8::splat(high[axis]))
            .max_or(F8::splat(low[axis]) - node.planes[1][axis])
            .max_or(outside);
    }
    outside.at_most(F8::splat(0.0))
}
