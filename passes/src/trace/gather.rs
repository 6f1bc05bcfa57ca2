//! Many short rays from one origin: the triangles in reach are gathered once and each ray is tested against them alone.

use super::block::Block;
use super::bvh::{Bvh, blocked, occluded};
use super::dispatch::Work;
use super::lanes::{LANES, Mask, NO_LANES, Simd, first_lane, without_first};
use super::node::Child;
use super::query::{Query, UNIT_ROUNDOFF};
use super::stack::Stack;
use super::{Hit, Ray};
use glam::Vec3;

/// Blocks that the gathered triangles may fill; with more in reach, each ray is traced by itself. A block costs a ray
/// about a tenth of what tracing it costs.
const GATHERED: usize = 6;
/// Nodes and blocks looked into at most before giving up.
const VISITS: usize = 20;

/// See [`Tracer::count_open`](super::Tracer::count_open).
pub(super) struct CountOpen<'a, A> {
    pub(super) bvh: &'a Bvh,
    pub(super) origin: Vec3,
    pub(super) t_min: f32,
    pub(super) t_max: f32,
    pub(super) directions: &'a [Vec3],
    pub(super) accept: A,
}

impl<A: FnMut(&Hit) -> bool> Work<u32> for CountOpen<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> u32 {
        let mut blocks = [Block::EMPTY; GATHERED];
        let mut entry = self.bvh.root;
        let several = self.directions.len() > 1;
        let gathered = if several { self.gather(simd, &mut entry, &mut blocks) } else { None };
        if gathered == Some(0) {
            return self.directions.len() as u32;
        }
        let mut open = 0;
        for &direction in self.directions {
            let ray = Ray { origin: self.origin, direction, t_min: self.t_min, t_max: self.t_max };
            let stopped = match (Query::new(&ray, &self.bvh.bounds), gathered) {
                (None, _) => false,
                (Some(query), None) => occluded(simd, self.bvh, entry, &query, &mut self.accept),
                (Some(query), Some(count)) => {
                    let mut stopped = false;
                    for block in &blocks[..count] {
                        if blocked(simd, block, &query, &mut self.accept) {
                            stopped = true;
                            break;
                        }
                    }
                    stopped
                }
            };
            open += u32::from(!stopped);
        }
        open
    }
}

impl<A> CountOpen<'_, A> {
    /// Packs the triangles whose bounds meet the box around all rays into `blocks` and returns how many blocks they
    /// fill; nothing if they do not fit or take too long to find. `entry` becomes the lowest node that all of them are
    /// under.
    ///
    /// The box is grown by more than the rounding of the triangle test, so that what a ray would hit is in it.
    #[inline(always)]
    fn gather<S: Simd>(&self, simd: S, entry: &mut Child, blocks: &mut [Block; GATHERED]) -> Option<usize> {
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
        let mut found = [(Child::NONE, NO_LANES); VISITS];
        let (mut sources, mut triangles) = (0, 0);
        for _ in 0..VISITS {
            if current.is_block() {
                let lanes = self.bvh.blocks[current.index()].overlapping(simd, &low, &high);
                triangles += lanes.count_ones() as usize;
                found[sources] = (current, lanes);
                sources += 1;
            } else {
                let node = &self.bvh.nodes[current.index()];
                let mut lanes = node.overlapping(simd, &low, &high);
                if lanes.count_ones() == 1 && current == *entry {
                    *entry = node.children[first_lane(lanes)];
                }
                while lanes != NO_LANES {
                    stack.push(u64::from(node.children[first_lane(lanes)].0));
                    lanes = without_first(lanes);
                }
            }
            if triangles + stack.len() > GATHERED * LANES {
                return None;
            }
            match stack.pop() {
                Some(entry) => current = Child(entry as u32),
                None => return Some(self.pack(&found[..sources], blocks)),
            }
        }
        None
    }

    /// Copies the triangles in the lanes of some blocks together, and returns how many blocks they fill.
    #[inline(always)]
    fn pack(&self, found: &[(Child, Mask)], blocks: &mut [Block; GATHERED]) -> usize {
        let mut count = 0;
        for &(source, mut lanes) in found {
            while lanes != NO_LANES {
                blocks[count / LANES].copy_lane(count % LANES, &self.bvh.blocks[source.index()], first_lane(lanes));
                lanes = without_first(lanes);
                count += 1;
            }
        }
        count.div_ceil(LANES)
    }
}
