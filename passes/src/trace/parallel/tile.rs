//! Finds the blocked rays of a tile's packets by lists of triangles.

use super::list::{GROUP, List};
use super::projection::{ProjectedRays, Projection, Zone};
use crate::trace::ray::TOGETHER;
use crate::trace::simd::{Mask, NO_LANES, Simd, WIDE};
use crate::trace::tree::{TRANSPARENT, WideTree};
use std::ops::Range;

/// Number of packets that share a list, by level. Where a list would be too long, fewer packets share one; if it is too long even for a
/// single packet, no list is made.
pub(crate) const LEVELS: [usize; 3] = [TOGETHER, 4, 1];

/// How rays that a list leaves undecided are handled.
pub(crate) trait Undecided {
    /// Greatest length of a list, by level.
    const LONGEST: [usize; LEVELS.len()];
    /// Whether origins are estimates. If so, undecided rays are only marked, which is cheaper than a branch on whether there are any.
    const ESTIMATED: bool;

    /// The rays of a packet that start on this triangle, and therefore never hit it.
    #[inline(always)]
    fn leaving<S: Simd>(&self, _simd: S, _packet: usize, _triangle: u32) -> Mask {
        NO_LANES
    }

    /// Which of the rays `(packet, mask)` a triangle, given by its leaf and lane, stops.
    fn stopped_by<S: Simd>(&mut self, simd: S, rays: (usize, Mask), triangle: (usize, usize)) -> Mask;

    /// Which of the rays `(packet, mask)` any triangle stops; called where no list was made.
    fn stopped<S: Simd>(&mut self, simd: S, rays: (usize, Mask)) -> Mask;
}

/// Rays that are tested together.
pub(crate) struct Tile<'a> {
    pub(crate) tree: &'a WideTree,
    /// The rays of each packet that can hit anything.
    pub(crate) valid: &'a [Mask; TOGETHER],
    pub(crate) projection: &'a Projection,
    pub(crate) seen: &'a [ProjectedRays; TOGETHER],
    /// Whether a ray that meets an opaque triangle in front of its origin is stopped at any distance (`t_min` is 0 and `t_max` infinite).
    pub(crate) hits_are_certain: bool,
}

impl Tile<'_> {
    /// The joint zone of some packets; `None` if no ray of theirs can hit anything.
    #[inline(always)]
    fn zone(&self, packets: Range<usize>) -> Option<Zone> {
        let mut packets = packets.filter(|&packet| self.valid[packet] != NO_LANES);
        let mut zone = self.seen[packets.next()?].zone;
        for packet in packets {
            zone.join(&self.seen[packet].zone, self.projection.is_backward);
        }
        Some(zone)
    }

    /// Fills a list for a zone; false if the list would be too long.
    #[inline(always)]
    fn gather<S: Simd, U: Undecided>(&self, simd: S, list: &mut List, zone: &Zone, longest: usize) -> bool {
        if U::ESTIMATED {
            list.gather::<S, false>(simd, (self.tree, self.projection), zone, longest)
        } else {
            list.gather::<S, true>(simd, (self.tree, self.projection), zone, longest)
        }
    }

    /// Finds the blocked rays of some packets by lists of triangles.
    ///
    /// Packets are taken in order; `todo.start` is the first that is not done. At level `l` the next `LEVELS[l]` packets share a list;
    /// their zone is `Z`, with area `A(Z)`. The levels are tried from the largest group to the smallest:
    ///
    /// * `tried[l]` is the packet up to which level `l` failed. The first level with `tried[l] <= todo.start` is tried.
    /// * A level is skipped if `A(Z) > A(Z') / 2`, where `Z'` is the zone of the next larger group, which failed: a zone of more than half
    ///   the area holds about as many triangles. It is also skipped once a list of its level was too long (`in_vain`).
    /// * Where no level is left, the rays of the packet are tested without a list.
    #[inline(always)]
    pub(crate) fn answer<S: Simd, U: Undecided>(
        &self,
        simd: S,
        packets: Range<usize>,
        list: &mut List,
        blocked: &mut [u16],
        undecided: &mut U,
    ) {
        let mut todo = packets;
        let mut tried = [0; LEVELS.len()];
        let mut too_large = [f32::INFINITY; LEVELS.len()];
        let mut in_vain = [false; LEVELS.len()];
        while !todo.is_empty() {
            let level = (0..LEVELS.len()).find(|&level| tried[level] <= todo.start);
            let (together, longest) = level.map_or((1, 0), |level| (LEVELS[level], U::LONGEST[level]));
            let some = todo.start..todo.end.min(todo.start - todo.start % together + together);
            if let Some(zone) = self.zone(some.clone()) {
                match level {
                    Some(level) if level > 0 && zone.area() > 0.5 * too_large[level - 1] || in_vain[level] => {
                        (tried[level], too_large[level]) = (some.end, zone.area());
                        continue;
                    }
                    Some(level) if !self.gather::<S, U>(simd, list, &zone, longest) => {
                        (tried[level], too_large[level]) = (some.end, zone.area());
                        in_vain[level] = true;
                        continue;
                    }
                    Some(_) => self.test(simd, (some.clone(), &zone), list, blocked, undecided),
                    None => {
                        let rays = (todo.start, self.valid[todo.start]);
                        blocked[todo.start] = undecided.stopped(simd, rays) as u16;
                    }
                }
            }
            todo.start = some.end;
        }
    }

    /// Finds the blocked rays of some packets by the list of their zone.
    #[inline(always)]
    fn test<S: Simd, U: Undecided>(
        &self,
        simd: S,
        (packets, zone): (Range<usize>, &Zone),
        list: &mut List,
        blocked: &mut [u16],
        undecided: &mut U,
    ) {
        let mut open = *self.valid;
        for first in (0..list.len).step_by(GROUP * WIDE) {
            let count = (list.len - first).min(GROUP * WIDE);
            let chunks = count.div_ceil(WIDE);
            for chunk in 0..chunks {
                let of = (self.projection, self.hits_are_certain);
                list.projected[chunk] = list.project(simd, of, zone, first / WIDE + chunk);
            }
            let used = u64::MAX >> (GROUP * WIDE - count);
            for index in packets.clone() {
                let seen = &self.seen[index];
                let mut open_rays = open[index];
                if open_rays == NO_LANES {
                    continue;
                }
                let mut lanes = 0;
                for chunk in 0..chunks {
                    lanes |= u64::from(list.projected[chunk].meeting(simd, seen) as u16) << (chunk * WIDE);
                }
                lanes &= used;
                while lanes != 0 && open_rays != NO_LANES {
                    let lane = lanes.trailing_zeros() as usize % (GROUP * WIDE);
                    lanes &= lanes - 1;
                    let (stopped, mut possible) = list.projected[lane / WIDE].stops(simd, lane % WIDE, seen, open_rays);
                    open_rays &= !stopped;
                    if U::ESTIMATED || possible != NO_LANES {
                        possible &= !undecided.leaving(simd, index, list.ids[first + lane] & !TRANSPARENT);
                        if U::ESTIMATED || possible != NO_LANES {
                            let place = (list.leaf_of[first + lane] as usize, list.lane_of[first + lane] as usize);
                            open_rays &= !undecided.stopped_by(simd, (index, possible), place);
                        }
                    }
                }
                open[index] = open_rays;
            }
        }
        for index in packets {
            blocked[index] = (self.valid[index] & !open[index]) as u16;
        }
    }
}
