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
use super::block::TRANSPARENT;
use super::bvh::Bvh;
use super::class::{Class, Classes};
use super::descent::Descent;
use super::estimate::{Decided, Estimates};
use super::lanes::{F16, LANES, Mask, NO_LANES, Simd, WIDE, first_wide_lane, load_axes};
use super::node::Child;
use super::outline::{Outlines, Seen, View, Zone};
use super::packet::{PACKET, Packet, TOGETHER};
use std::ops::Range;

/// Triangles in a list, at most.
const MOST: usize = 512;
/// How many packets share a list; where it is too long, fewer share one, and in the end none is made.
const LEVELS: [usize; 3] = [TOGETHER, 4, 1];
/// Blocks that are brought near before they are looked at.
const AHEAD: usize = 3;
/// Sixteens of triangles that packets are compared with at a time: the more, the fewer ends of loops are guessed wrongly.
const GROUP: usize = 4;
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
    let tile = Tile { bvh, valid: &rays.valid, view: &view, seen: &seen, hits_are_certain };
    let mut exact = Exact { bvh, rays: &rays, accept };
    let mut list = List::EMPTY;
    tile.answer(simd, 0..packets.len(), &mut list, blocked, &mut exact);
    true
}

/// See [`Tracer::decide`](super::Tracer::decide).
#[inline(always)]
pub(super) fn decide<S: Simd>(simd: S, bvh: &Bvh, estimates: &Estimates, decided: &mut Decided) {
    decided.clear();
    let Estimates { origin, triangle, valid, center, error, direction } = estimates;
    let mut model = Packet::new(0.0, f32::INFINITY);
    model.set(0, *center, *direction);
    let classes = Classes::of(&model);
    if bvh.root == Child::NONE || classes.valid() == NO_LANES || !error.is_finite() {
        return;
    }
    let valid = valid.map(Mask::from);
    let mut view = View::new(classes.get(0), center.to_array(), direction.to_array()).blurred(*error);
    let Decided { stopped, open, list, seen: Many(seen) } = decided;
    for (index, valid) in valid.iter().enumerate() {
        seen[index] = view.rays(simd, load_axes(simd, &origin[index]), *valid);
    }
    if !view.settle(&bvh.bounds, seen) {
        return;
    }
    let mut doubts = Doubts { triangle, open: valid };
    let tile = Tile { bvh, valid: &valid, view: &view, seen, hits_are_certain: true };
    tile.answer(simd, 0..TOGETHER, list, stopped, &mut doubts);
    for index in 0..TOGETHER {
        open[index] = doubts.open[index] as u16 & !stopped[index];
    }
}

/// What becomes of the rays of a packet of which lists say nothing certain.
trait Undecided {
    /// The longest list, by how many packets share it.
    const LONGEST: [usize; LEVELS.len()];
    /// Whether origins are estimates. Then to compare and to ask is also cheaper than to find out whether there is anything to compare
    /// and to ask.
    const ESTIMATED: bool;

    /// Those that do not meet a triangle, whatever the list says.
    #[inline(always)]
    fn leaving<S: Simd>(&self, _simd: S, _packet: usize, _triangle: u32) -> Mask {
        NO_LANES
    }

    /// Which of some rays a triangle, the lane of a block, stops.
    fn stopped_by<S: Simd>(&mut self, simd: S, rays: (usize, Mask), triangle: (usize, usize)) -> Mask;

    /// Which of some rays anything stops: there is no list for them.
    fn stopped<S: Simd>(&mut self, simd: S, rays: (usize, Mask)) -> Mask;
}

/// They are traced.
struct Exact<'a, A> {
    bvh: &'a Bvh,
    rays: &'a Rays<'a>,
    accept: &'a mut A,
}

impl<A: FnMut(usize, &Hit) -> bool> Undecided for Exact<'_, A> {
    const LONGEST: [usize; LEVELS.len()] = [256, 160, 96];
    const ESTIMATED: bool = false;

    #[inline(always)]
    fn stopped_by<S: Simd>(&mut self, simd: S, rays: (usize, Mask), (block, lane): (usize, usize)) -> Mask {
        let mut beam = Beam::EMPTY;
        beam.prepare(simd, &self.rays.packets[rays.0], (rays.1, self.rays.class), &self.bvh.bounds);
        let mut accept = |lane: usize, hit: &Hit| (self.accept)(rays.0 * PACKET + lane, hit);
        beam.stop(simd, (&self.bvh.blocks[block], lane), &mut accept);
        rays.1 & !beam.open
    }

    #[inline(always)]
    fn stopped<S: Simd>(&mut self, simd: S, rays: (usize, Mask)) -> Mask {
        let mut beam = Beam::EMPTY;
        beam.prepare(simd, &self.rays.packets[rays.0], (rays.1, self.rays.class), &self.bvh.bounds);
        let accept = |lane: usize, hit: &Hit| (self.accept)(rays.0 * PACKET + lane, hit);
        (Descent { bvh: self.bvh, accept }).stopped(simd, &mut beam)
    }
}

/// They are left.
struct Doubts<'a> {
    /// The triangle that each ray leaves.
    triangle: &'a [[u32; PACKET]; TOGETHER],
    /// The rays that are certainly open, if nothing stops them.
    open: [Mask; TOGETHER],
}

impl Undecided for Doubts<'_> {
    // To trace what is left takes more than to trace what is known, so lists may be longer.
    const LONGEST: [usize; LEVELS.len()] = [MOST; 3];
    const ESTIMATED: bool = true;

    #[inline(always)]
    fn leaving<S: Simd>(&self, simd: S, packet: usize, triangle: u32) -> Mask {
        simd.wide_equal(&self.triangle[packet], triangle)
    }

    #[inline(always)]
    fn stopped_by<S: Simd>(&mut self, _: S, (packet, lanes): (usize, Mask), _: (usize, usize)) -> Mask {
        self.open[packet] &= !lanes;
        NO_LANES
    }

    #[inline(always)]
    fn stopped<S: Simd>(&mut self, _: S, (packet, lanes): (usize, Mask)) -> Mask {
        self.open[packet] &= !lanes;
        NO_LANES
    }
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

/// All packets, as they are seen.
#[derive(Debug)]
pub(super) struct Many([Seen; TOGETHER]);

impl Default for Many {
    fn default() -> Self {
        Self([Seen::NONE; TOGETHER])
    }
}

/// The triangles that may be in the way of some packets.
#[derive(Debug)]
pub(super) struct List {
    /// Nodes to look at, those that were looked at, and blocks.
    nodes: [u32; MOST + LANES],
    blocks: [u32; MOST + LANES],
    /// By corner and axis.
    corners: [[Coordinates; 3]; 3],
    ids: [u32; MOST + WIDE],
    /// What is asked of those that are looked at.
    outlines: [Outlines; GROUP],
    /// The block of each, and its lane there where it is to be asked for.
    block_of: [u32; MOST + WIDE],
    lane_of: [u32; MOST + WIDE],
    len: usize,
}

/// A coordinate of triangles.
type Coordinates = [F16; MOST / WIDE + 1];

impl Default for List {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl List {
    const EMPTY: Self = Self {
        nodes: [0; MOST + LANES],
        blocks: [0; MOST + LANES],
        corners: [[[F16::ZERO; MOST / WIDE + 1]; 3]; 3],
        ids: [0; MOST + WIDE],
        outlines: [Outlines::EMPTY; GROUP],
        block_of: [0; MOST + WIDE],
        lane_of: [0; MOST + WIDE],
        len: 0,
    };

    /// Collects the triangles that rays of a zone may meet; false if they are too many, or too much has to be looked at.
    ///
    /// All nodes come before all blocks, in the order in which they are found, so that one need not be waited for to look at the
    /// next; and what is found is added without a jump.
    #[inline(always)]
    fn gather<S: Simd, U: Undecided>(&mut self, simd: S, tile: &Tile<'_>, zone: &Zone, longest: usize) -> bool {
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
            if nodes > longest || blocks > longest {
                return false;
            }
        }
        self.len = 0;
        for place in 0..blocks {
            if place + AHEAD < blocks {
                simd.prefetch(&bvh.blocks[Child(self.blocks[place + AHEAD]).index()]);
            }
            let index = Child(self.blocks[place]).index();
            let block = &bvh.blocks[index];
            let lanes = view.triangles(simd, block, zone);
            for corner in 0..3 {
                for axis in 0..3 {
                    let values: &mut [u32] = bytemuck::cast_slice_mut(&mut self.corners[corner][axis]);
                    append(simd, values, self.len, (block.bits(corner, axis), lanes));
                }
            }
            self.block_of[self.len..self.len + LANES].copy_from_slice(&[index as u32; LANES]);
            if !U::ESTIMATED {
                append(simd, &mut self.lane_of, self.len, (&[0, 1, 2, 3, 4, 5, 6, 7], lanes));
            }
            self.len = append(simd, &mut self.ids, self.len, (block.ids(), lanes));
            if self.len > longest {
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
    /// The rays of each packet that can meet anything.
    valid: &'a [Mask; TOGETHER],
    view: &'a View,
    seen: &'a [Seen; TOGETHER],
    /// Whether a ray that meets an opaque triangle ahead is stopped, however far it is.
    hits_are_certain: bool,
}

impl Tile<'_> {
    /// The zone of some packets; nothing if no ray of theirs can meet anything.
    #[inline(always)]
    fn zone(&self, packets: Range<usize>) -> Option<Zone> {
        let mut packets = packets.filter(|&packet| self.valid[packet] != NO_LANES);
        let mut zone = self.seen[packets.next()?].zone;
        for packet in packets {
            zone.join(&self.seen[packet].zone, self.view.is_backward);
        }
        Some(zone)
    }

    /// Answers for some packets from lists, those of a level at first.
    #[inline(always)]
    fn answer<S: Simd, U: Undecided>(
        &self,
        simd: S,
        packets: Range<usize>,
        list: &mut List,
        blocked: &mut [u16],
        undecided: &mut U,
    ) {
        let mut todo = packets;
        // By level, the packet up to which it has been tried in vain; and how large the last such zone was.
        let mut tried = [0; LEVELS.len()];
        let mut too_large = [f32::INFINITY; LEVELS.len()];
        // Levels of which a list was too long: no more of it are tried.
        let mut in_vain = [false; LEVELS.len()];
        while !todo.is_empty() {
            let level = (0..LEVELS.len()).find(|&level| tried[level] <= todo.start);
            let (together, longest) = level.map_or((1, 0), |level| (LEVELS[level], U::LONGEST[level]));
            let some = todo.start..todo.end.min(todo.start - todo.start % together + together);
            if let Some(zone) = self.zone(some.clone()) {
                match level {
                    // What is nearly as large as what it is a part of would hold as much, and so would what is like others.
                    Some(level) if level > 0 && zone.area() > 0.5 * too_large[level - 1] || in_vain[level] => {
                        (tried[level], too_large[level]) = (some.end, zone.area());
                        continue;
                    }
                    Some(level) if !list.gather::<S, U>(simd, self, &zone, longest) => {
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

    /// Answers for some packets, whose zone is given, from a list.
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
                list.outlines[chunk] = list.outlines(simd, self, zone, first / WIDE + chunk);
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
                    lanes |= u64::from(list.outlines[chunk].meeting(simd, seen) as u16) << (chunk * WIDE);
                }
                lanes &= used;
                while lanes != 0 && open_rays != NO_LANES {
                    let lane = lanes.trailing_zeros() as usize % (GROUP * WIDE);
                    lanes &= lanes - 1;
                    let (stopped, mut possible) = list.outlines[lane / WIDE].stops(simd, lane % WIDE, seen, open_rays);
                    open_rays &= !stopped;
                    if U::ESTIMATED || possible != NO_LANES {
                        possible &= !undecided.leaving(simd, index, list.ids[first + lane] & !TRANSPARENT);
                        if U::ESTIMATED || possible != NO_LANES {
                            let place = (list.block_of[first + lane] as usize, list.lane_of[first + lane] as usize);
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
