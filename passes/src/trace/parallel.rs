//! Rays of one direction that start near each other, as those of a tile to a distant light do: the triangles that may be in
//! their way are gathered once, and what is certain of sixteen rays is found without testing them.
//!
//! Seen along the direction, a ray is a point and a tile's rays a small rectangle: coordinates are sheared as the watertight
//! test shears them, `x - sx z` and `y - sy z` where z is the direction's longest axis. The tree is searched for the triangles
//! whose bounds meet the rectangle. Of those, a packet's own rectangle is compared with sixteen at a time, by their bounds and
//! by their edges (the separating axes of two convex shapes); and rays that start above a triangle that looks towards the light
//! pass it. What remains is put to the watertight test ([`Beam`]), so every ray gets the answer that it gets alone.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::Hit;
use super::beam::Beam;
use super::bvh::Bvh;
use super::class::{Class, Classes};
use super::descent::Descent;
use super::lanes::{F16, Mask, NO_LANES, Simd, WIDE, first_lane, first_wide_lane, without_first};
use super::node::Child;
use super::outline::{Outlines, Seen, View, Zone};
use super::packet::{PACKET, Packet, TOGETHER};
use super::stack::Stack;
use std::ops::Range;

/// Triangles in a list, at most.
const MOST: usize = 256;
/// How many packets share a list, and its longest length; where it is longer, fewer share one, and in the end none is made.
const LEVELS: [(usize, usize); 3] = [(TOGETHER, MOST), (4, 160), (1, 96)];
/// Lists of one length that were too long, one after the other, after which no more of that length are tried in a tile.
const ENOUGH: u32 = 2;
/// Rays below which a list is not worth it.
const FEW: u32 = 16;

/// Answers for the rays of up to [`TOGETHER`] packets, one bit a ray, where they have one direction; else does nothing and
/// returns false. `accept` is told the ray as 16 times its packet plus its lane.
#[inline(always)]
pub(super) fn occluded<S: Simd>(
    simd: S,
    bvh: &Bvh,
    packets: &[Packet],
    blocked: &mut [u16],
    accept: &mut impl FnMut(usize, &Hit) -> bool,
) -> bool {
    if bvh.root == Child::NONE {
        return false;
    }
    let Some((rays, center, direction)) = Rays::of(simd, packets) else { return false };
    let mut view = View::new(rays.class, center, direction);
    let mut seen = [Seen::NONE; TOGETHER];
    for (index, packet) in packets.iter().enumerate() {
        if rays.valid[index] != NO_LANES {
            seen[index] = view.packet(simd, packet, rays.valid[index]);
        }
    }
    if !view.settle(&bvh.bounds, &mut seen) {
        return false;
    }
    let hits_are_certain = packets[0].t_min == 0.0 && packets[0].t_max == f32::INFINITY;
    let tile = Tile { bvh, rays: &rays, view: &view, seen: &seen, hits_are_certain };
    let mut list = List::EMPTY;
    tile.answer(simd, 0..packets.len(), &mut list, blocked, accept);
    true
}

/// What the rays of some packets have in common.
struct Rays<'a> {
    packets: &'a [Packet],
    class: Class,
    /// The rays of each packet that can meet anything.
    valid: [Mask; TOGETHER],
}

impl<'a> Rays<'a> {
    /// The rays, and their direction; nothing if they have not one, or are too few.
    #[inline(always)]
    fn of<S: Simd>(simd: S, packets: &'a [Packet]) -> Option<(Self, [f32; 3], [f32; 3])> {
        let model = packets.iter().find(|packet| packet.active != 0)?;
        let classes = Classes::of(model);
        let valid = classes.valid() & Mask::from(model.active);
        if valid == NO_LANES {
            return None;
        }
        let lane = first_wide_lane(valid);
        let [origin, direction] = [&model.origin, &model.direction].map(|v| [v[0][lane], v[1][lane], v[2][lane]]);
        let mut rays = Self { packets, class: classes.get(lane), valid: [NO_LANES; TOGETHER] };
        let mut count = 0;
        for (index, packet) in packets.iter().enumerate() {
            if packet.t_min.to_bits() != model.t_min.to_bits() || packet.t_max.to_bits() != model.t_max.to_bits() {
                return None;
            }
            let zero = simd.wide_splat(0.0);
            let (mut same, mut sum) = (!NO_LANES, zero);
            for axis in 0..3 {
                let (own, common) = (simd.wide_load(&F16(packet.direction[axis])), simd.wide_splat(direction[axis]));
                same &= simd.wide_at_most(own, common) & simd.wide_at_most(common, own);
                // The product is 0, or NaN where the origin is not finite.
                sum = simd.wide_about_mul_add(simd.wide_load(&F16(packet.origin[axis])), zero, sum);
            }
            let valid = Mask::from(packet.active) & simd.wide_at_most(sum, zero);
            if valid & !same != NO_LANES {
                return None;
            }
            rays.valid[index] = valid;
            count += valid.count_ones();
        }
        (count >= FEW && rays.zeros_have_one_sign(direction)).then_some((rays, origin, direction))
    }

    /// Comparison does not tell zeros of either sign apart, but the box test does.
    #[inline(always)]
    fn zeros_have_one_sign(&self, direction: [f32; 3]) -> bool {
        (0..3).filter(|&axis| direction[axis] == 0.0).all(|axis| {
            let bits = direction[axis].to_bits();
            self.packets.iter().all(|packet| packet.lanes().all(|lane| packet.direction[axis][lane].to_bits() == bits))
        })
    }
}

/// The triangles that may be in the way of some packets.
struct List {
    /// Blocks, and which of their triangles.
    found: [(u32, Mask); MOST],
    outlines: [Outlines; MOST / WIDE],
    /// Block and lane.
    places: [(u32, u32); MOST],
    len: usize,
}

impl List {
    const EMPTY: Self =
        Self { found: [(0, NO_LANES); MOST], outlines: [Outlines::EMPTY; MOST / WIDE], places: [(0, 0); MOST], len: 0 };

    /// Collects the triangles that rays of a zone may meet; false if they are more than `most`.
    #[inline(always)]
    fn gather<S: Simd>(&mut self, simd: S, tile: &Tile<'_>, zone: &Zone, most: usize) -> bool {
        let Tile { bvh, view, .. } = tile;
        let (mut blocks, mut triangles) = (0, 0);
        let mut stack = Stack::<u32>::new();
        let mut current = bvh.root;
        loop {
            if current.is_block() {
                let lanes = view.triangles(simd, &bvh.blocks[current.index()], zone);
                triangles += lanes.count_ones() as usize;
                if triangles > most {
                    return false;
                }
                if lanes != NO_LANES {
                    self.found[blocks] = (current.index() as u32, lanes);
                    blocks += 1;
                }
            } else {
                let node = &bvh.nodes[current.index()];
                let mut lanes = view.children(simd, node, zone);
                while lanes != NO_LANES {
                    let child = node.children[first_lane(lanes)];
                    lanes = without_first(lanes);
                    bvh.prefetch(simd, child);
                    stack.push(child.0);
                }
            }
            match stack.pop() {
                Some(child) => current = Child(child),
                None => break,
            }
        }
        self.prepare(simd, tile, zone, blocks);
        true
    }

    /// Computes what is asked of the triangles that were found.
    #[inline(always)]
    fn prepare<S: Simd>(&mut self, simd: S, tile: &Tile<'_>, zone: &Zone, blocks: usize) {
        self.len = 0;
        let mut triangles = [[F16::ZERO; 3]; 3];
        let mut opaque = NO_LANES;
        for &(index, mut lanes) in &self.found[..blocks] {
            let block = &tile.bvh.blocks[index as usize];
            while lanes != NO_LANES {
                let lane = first_lane(lanes);
                lanes = without_first(lanes);
                let place = self.len % WIDE;
                let corners = block.corners(lane);
                for corner in 0..3 {
                    for axis in 0..3 {
                        triangles[corner][axis].0[place] = corners[corner][axis];
                    }
                }
                opaque |= Mask::from(tile.hits_are_certain && !block.is_transparent(lane)) << place;
                self.places[self.len] = (index, lane as u32);
                self.len += 1;
                if place == WIDE - 1 {
                    self.outlines[self.len / WIDE - 1] = Outlines::new(simd, tile.view, zone, &triangles, opaque);
                    opaque = NO_LANES;
                }
            }
        }
        if !self.len.is_multiple_of(WIDE) {
            self.outlines[self.len / WIDE] = Outlines::new(simd, tile.view, zone, &triangles, opaque);
        }
    }
}

/// Rays that are answered together.
struct Tile<'a> {
    bvh: &'a Bvh,
    rays: &'a Rays<'a>,
    view: &'a View,
    seen: &'a [Seen; TOGETHER],
    /// Whether a ray that meets an opaque triangle ahead is stopped, however far it is.
    hits_are_certain: bool,
}

impl Tile<'_> {
    /// The zone of some packets; nothing if no ray of theirs can meet anything.
    #[inline(always)]
    fn zone(&self, packets: Range<usize>) -> Option<Zone> {
        let mut packets = packets.filter(|&packet| self.rays.valid[packet] != NO_LANES);
        let mut zone = self.seen[packets.next()?].zone;
        for packet in packets {
            zone.join(&self.seen[packet].zone, self.view.is_backward);
        }
        Some(zone)
    }

    /// Answers for some packets from lists, those of a level at first.
    #[inline(always)]
    fn answer<S: Simd>(
        &self,
        simd: S,
        packets: Range<usize>,
        list: &mut List,
        blocked: &mut [u16],
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) {
        let mut todo = packets;
        // By level, the packet up to which it has been tried in vain; and how large the last such zone was.
        let mut tried = [0; LEVELS.len()];
        let mut too_large = [f32::INFINITY; LEVELS.len()];
        // How many lists of a level in a row were too long.
        let mut in_vain = [0; LEVELS.len()];
        while !todo.is_empty() {
            let level = (0..LEVELS.len()).find(|&level| tried[level] <= todo.start);
            let (together, most) = level.map_or((1, 0), |level| LEVELS[level]);
            let some = todo.start..todo.end.min(todo.start - todo.start % together + together);
            if let Some(zone) = self.zone(some.clone()) {
                match level {
                    // What is nearly as large as what it is a part of would hold as much, and so would what is like others.
                    Some(level)
                        if level > 0 && zone.area() > 0.5 * too_large[level - 1] || in_vain[level] >= ENOUGH =>
                    {
                        (tried[level], too_large[level]) = (some.end, zone.area());
                        continue;
                    }
                    Some(level) if !list.gather(simd, self, &zone, most) => {
                        (tried[level], too_large[level]) = (some.end, zone.area());
                        in_vain[level] += 1;
                        continue;
                    }
                    Some(level) => {
                        in_vain[level] = 0;
                        self.test(simd, some.clone(), list, blocked, accept);
                    }
                    None => self.descend(simd, todo.start, blocked, accept),
                }
            }
            todo.start = some.end;
        }
    }

    /// Answers for some packets from a list.
    #[inline(always)]
    fn test<S: Simd>(
        &self,
        simd: S,
        packets: Range<usize>,
        list: &List,
        blocked: &mut [u16],
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) {
        let mut beam = Beam::EMPTY;
        for index in packets {
            let valid = self.rays.valid[index];
            let seen = &self.seen[index];
            let mut open = valid;
            let mut is_prepared = false;
            let mut accept = |lane: usize, hit: &Hit| accept(index * PACKET + lane, hit);
            let mut first = 0;
            while first < list.len && open != NO_LANES {
                let outlines = &list.outlines[first / WIDE];
                let used = ((1_u64 << WIDE.min(list.len - first)) - 1) as Mask;
                let mut lanes = outlines.meeting(simd, &seen.zone) & used;
                while lanes != NO_LANES && open != NO_LANES {
                    let lane = first_wide_lane(lanes);
                    lanes = without_first(lanes);
                    let (stopped, possible) = outlines.stops(simd, lane, seen, open);
                    open &= !stopped;
                    if possible != NO_LANES {
                        if !is_prepared {
                            let scene = &self.bvh.bounds;
                            beam.prepare(simd, &self.rays.packets[index], (valid, self.rays.class), scene);
                            is_prepared = true;
                        }
                        let (block, lane) = list.places[first + lane];
                        beam.open = possible;
                        beam.stop(simd, (&self.bvh.blocks[block as usize], lane as usize), &mut accept);
                        open &= !(possible & !beam.open);
                    }
                }
                first += WIDE;
            }
            blocked[index] = (valid & !open) as u16;
        }
    }

    /// Answers for a packet without a list.
    #[inline(always)]
    fn descend<S: Simd>(
        &self,
        simd: S,
        index: usize,
        blocked: &mut [u16],
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) {
        let valid = self.rays.valid[index];
        let mut beam = Beam::EMPTY;
        beam.prepare(simd, &self.rays.packets[index], (valid, self.rays.class), &self.bvh.bounds);
        let accept = |lane: usize, hit: &Hit| accept(index * PACKET + lane, hit);
        blocked[index] = (Descent { bvh: self.bvh, accept }).stopped(simd, &mut beam) as u16;
    }
}
