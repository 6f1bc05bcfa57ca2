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
use super::lanes::{F16, LANES, Mask, NO_LANES, Simd, WIDE, first_wide_lane, without_first};
use super::node::Child;
use super::outline::{Outlines, Seen, View, Zone};
use super::packet::{PACKET, Packet, TOGETHER};
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
    /// Nodes to look at, those that were looked at, and blocks.
    nodes: [u32; MOST + LANES],
    blocks: [u32; MOST + LANES],
    /// By corner and axis.
    corners: [[Coordinates; 3]; 3],
    ids: [u32; MOST + WIDE],
    /// The block and the lane of each.
    places: [[u32; MOST + WIDE]; 2],
    len: usize,
}

/// A coordinate of triangles.
type Coordinates = [F16; MOST / WIDE + 1];

impl List {
    const EMPTY: Self = Self {
        nodes: [0; MOST + LANES],
        blocks: [0; MOST + LANES],
        corners: [[[F16::ZERO; MOST / WIDE + 1]; 3]; 3],
        ids: [0; MOST + WIDE],
        places: [[0; MOST + WIDE]; 2],
        len: 0,
    };

    /// Collects the triangles that rays of a zone may meet; false if they are more than `most`, or too much has to be looked at.
    ///
    /// All nodes come before all blocks, in the order in which they are found, so that one need not be waited for to look at the
    /// next; and what is found is added without a jump.
    #[inline(always)]
    fn gather<S: Simd>(&mut self, simd: S, tile: &Tile<'_>, zone: &Zone, most: usize) -> bool {
        let Tile { bvh, view, .. } = tile;
        let (mut nodes, mut blocks) = (0, 0);
        if bvh.root.is_block() {
            (self.blocks[0], blocks) = (bvh.root.0, 1);
        } else {
            (self.nodes[0], nodes) = (bvh.root.0, 1);
        }
        let mut next = 0;
        while next < nodes {
            let node = &bvh.nodes[self.nodes[next] as usize];
            next += 1;
            let lanes = view.children(simd, node, zone);
            let numbers = node.numbers();
            let leaves = simd.negative(numbers) & lanes;
            blocks = append(simd, &mut self.blocks, blocks, (numbers, leaves));
            nodes = append(simd, &mut self.nodes, nodes, (numbers, lanes & !leaves));
            if nodes > MOST || blocks > MOST {
                return false;
            }
        }
        self.len = 0;
        for &block in &self.blocks[..blocks] {
            let index = Child(block).index();
            let block = &bvh.blocks[index];
            let lanes = view.triangles(simd, block, zone);
            for corner in 0..3 {
                for axis in 0..3 {
                    let values: &mut [u32] = bytemuck::cast_slice_mut(&mut self.corners[corner][axis]);
                    append(simd, values, self.len, (block.bits(corner, axis), lanes));
                }
            }
            let [blocks, lanes_of_blocks] = &mut self.places;
            append(simd, blocks, self.len, (&[index as u32; LANES], lanes));
            append(simd, lanes_of_blocks, self.len, (&[0, 1, 2, 3, 4, 5, 6, 7], lanes));
            self.len = append(simd, &mut self.ids, self.len, (block.ids(), lanes));
            if self.len > most {
                return false;
            }
        }
        true
    }

    /// Computes what is asked of sixteen of the triangles.
    #[inline(always)]
    fn outlines<S: Simd>(&self, simd: S, tile: &Tile<'_>, zone: &Zone, chunk: usize) -> Outlines {
        let [a, b, c] = &self.corners;
        let triangles = [
            [&a[0][chunk], &a[1][chunk], &a[2][chunk]],
            [&b[0][chunk], &b[1][chunk], &b[2][chunk]],
            [&c[0][chunk], &c[1][chunk], &c[2][chunk]],
        ];
        let mut opaque = NO_LANES;
        if tile.hits_are_certain {
            let (ids, _) = self.ids[chunk * WIDE..].as_chunks::<LANES>();
            opaque = !(simd.negative(&ids[0]) | simd.negative(&ids[1]) << LANES);
        }
        Outlines::new(simd, tile.view, zone, &triangles, opaque)
    }
}

/// Adds those of eight numbers that are chosen to a list of so many, and returns how many it has then.
#[inline(always)]
fn append<S: Simd>(simd: S, list: &mut [u32], len: usize, (numbers, chosen): (&[u32; LANES], Mask)) -> usize {
    list[len..len + LANES].copy_from_slice(&simd.compress(numbers, chosen));
    len + chosen.count_ones() as usize
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
                        self.test(simd, (some.clone(), &zone), list, blocked, accept);
                    }
                    None => self.descend(simd, todo.start, blocked, accept),
                }
            }
            todo.start = some.end;
        }
    }

    /// Answers for some packets, whose zone is given, from a list.
    #[inline(always)]
    fn test<S: Simd>(
        &self,
        simd: S,
        (packets, zone): (Range<usize>, &Zone),
        list: &List,
        blocked: &mut [u16],
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) {
        let mut open = self.rays.valid;
        for first in (0..list.len).step_by(WIDE) {
            let outlines = list.outlines(simd, self, zone, first / WIDE);
            let used = ((1_u64 << WIDE.min(list.len - first)) - 1) as Mask;
            for index in packets.clone() {
                let seen = &self.seen[index];
                let mut open_rays = open[index];
                let mut lanes =
                    if open_rays == NO_LANES { NO_LANES } else { outlines.meeting(simd, &seen.zone) & used };
                while lanes != NO_LANES && open_rays != NO_LANES {
                    let lane = first_wide_lane(lanes);
                    lanes = without_first(lanes);
                    let (stopped, possible) = outlines.stops(simd, lane, seen, open_rays);
                    open_rays &= !stopped;
                    if possible != NO_LANES {
                        let [block, lane] = [0, 1].map(|part: usize| list.places[part][first + lane] as usize);
                        open_rays &= !self.stopped(simd, (index, possible), (block, lane), accept);
                    }
                }
                open[index] = open_rays;
            }
        }
        for index in packets {
            blocked[index] = (self.rays.valid[index] & !open[index]) as u16;
        }
    }

    /// Which of some rays of a packet a triangle stops, by the watertight test.
    #[inline(always)]
    fn stopped<S: Simd>(
        &self,
        simd: S,
        (index, possible): (usize, Mask),
        (block, lane): (usize, usize),
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) -> Mask {
        let mut beam = Beam::EMPTY;
        let lanes = (possible, self.rays.class);
        beam.prepare(simd, &self.rays.packets[index], lanes, &self.bvh.bounds);
        let mut accept = |lane: usize, hit: &Hit| accept(index * PACKET + lane, hit);
        beam.stop(simd, (&self.bvh.blocks[block], lane), &mut accept);
        possible & !beam.open
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
