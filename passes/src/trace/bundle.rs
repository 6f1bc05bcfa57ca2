//! Packets of rays down the tree: sorted into beams, up to sixteen of which share the upper part.
//!
//! A beam is up to sixteen rays of a packet that run into one octant along one main axis. Where many beams go the same way, a
//! node's eight children are tested against the interval of all of them, and a child that is met against the intervals of the
//! sixteen beams, a beam a lane; from where few of them are left each goes on by itself ([`Descent`]).

use super::beam::Beam;
use super::bvh::{Bvh, Closest, occluded};
use super::class::{Class, Classes};
use super::descent::Descent;
use super::dispatch::Work;
use super::extremes::{BeamLanes, Extremes};
use super::lanes::{Mask, NO_LANES, Simd, WIDE, first_lane, first_wide_lane, without_first};
use super::node::Child;
use super::packet::{Packet, PacketHits, TOGETHER};
use super::query::Query;
use super::stack::Stack;
use super::{Hit, PACKET, parallel};

/// Beams that go down the tree together, a beam a lane.
const BEAMS: usize = WIDE;
/// Beams up to which each goes on by itself, where nearest hits are looked for.
const ALONE: u32 = 6;
/// Rays of a class and a packet below which each is traced by itself.
const FEW: u32 = 3;

/// See [`Tracer::closest_packets`](super::Tracer::closest_packets). Compiled once, for whatever `accept` is.
pub(super) fn closest_packets(
    bvh: &Bvh,
    packets: &[Packet],
    hits: &mut [PacketHits],
    accept: &mut dyn FnMut(usize, &Hit) -> bool,
) {
    bvh.lanes.run(ClosestPackets { bvh, packets, hits, accept });
}

/// See [`Tracer::occluded_packets`](super::Tracer::occluded_packets); with `LISTS`, those of rays of one direction are tried first.
/// Compiled once, for whatever `accept` is.
pub(super) fn occluded_packets<const LISTS: bool>(
    bvh: &Bvh,
    packets: &[Packet],
    blocked: &mut [u16],
    accept: &mut dyn FnMut(usize, &Hit) -> bool,
) {
    bvh.lanes.run(OccludedPackets::<_, LISTS> { bvh, packets, blocked, accept });
}

struct ClosestPackets<'a, A> {
    bvh: &'a Bvh,
    packets: &'a [Packet],
    hits: &'a mut [PacketHits],
    accept: A,
}

struct OccludedPackets<'a, A, const LISTS: bool> {
    bvh: &'a Bvh,
    packets: &'a [Packet],
    blocked: &'a mut [u16],
    accept: A,
}

impl<A: FnMut(usize, &Hit) -> bool> Work<()> for ClosestPackets<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        self.hits.fill(PacketHits::NONE);
        for (chunk, packets) in self.packets.chunks(TOGETHER).enumerate() {
            (Sorted { bvh: self.bvh, packets, first: chunk * TOGETHER }).each(simd, &mut self);
        }
    }
}

impl<A: FnMut(usize, &Hit) -> bool, const LISTS: bool> Work<()> for OccludedPackets<'_, A, LISTS> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        self.blocked.fill(0);
        for (chunk, packets) in self.packets.chunks(TOGETHER).enumerate() {
            let first = chunk * TOGETHER;
            let (blocked, accept) = (&mut self.blocked[first..][..packets.len()], &mut self.accept);
            let mut accept = |ray: usize, hit: &Hit| accept(first * PACKET + ray, hit);
            if !(LISTS && parallel::occluded(simd, self.bvh, packets, blocked, &mut accept)) {
                (Sorted { bvh: self.bvh, packets, first }).each(simd, &mut self);
            }
        }
    }
}

/// What is done with sorted rays. Not closures: those are compiled for the instruction set only where they are inlined.
trait Part {
    /// Beams of one octant, and the packet of each.
    fn beams<S: Simd>(&mut self, simd: S, beams: &mut [Beam], packet_of: &[usize; BEAMS]);
    /// A lone ray: its packet and its lane.
    fn ray<S: Simd>(&mut self, simd: S, packet: usize, lane: usize);
}

impl<A: FnMut(usize, &Hit) -> bool> Part for ClosestPackets<'_, A> {
    #[inline(always)]
    fn beams<S: Simd>(&mut self, simd: S, beams: &mut [Beam], packet_of: &[usize; BEAMS]) {
        share(simd, self.bvh, (beams, packet_of), &mut self.accept);
        for (beam, packet) in beams.iter().zip(packet_of) {
            beam.report(&mut self.hits[*packet]);
        }
    }

    #[inline(always)]
    fn ray<S: Simd>(&mut self, simd: S, packet: usize, lane: usize) {
        let (ray, accept) = (self.packets[packet].ray(lane), &mut self.accept);
        let accept = |hit: &Hit| accept(packet * PACKET + lane, hit);
        if let Some(hit) = (Closest { bvh: self.bvh, ray: &ray, accept }).run(simd) {
            self.hits[packet].set(lane, &hit);
        }
    }
}

impl<A: FnMut(usize, &Hit) -> bool, const LISTS: bool> Part for OccludedPackets<'_, A, LISTS> {
    /// Nothing is shared: rays that look for anything leave their common way early, and intervals let too much through.
    #[inline(always)]
    fn beams<S: Simd>(&mut self, simd: S, beams: &mut [Beam], packet_of: &[usize; BEAMS]) {
        for (beam, &packet) in beams.iter_mut().zip(packet_of) {
            let accept = &mut self.accept;
            let accept = |lane: usize, hit: &Hit| accept(packet * PACKET + lane, hit);
            self.blocked[packet] |= (Descent { bvh: self.bvh, accept }).stopped(simd, beam) as u16;
        }
    }

    #[inline(always)]
    fn ray<S: Simd>(&mut self, simd: S, packet: usize, lane: usize) {
        let Some(query) = Query::new(&self.packets[packet].ray(lane), &self.bvh.bounds) else { return };
        let accept = &mut self.accept;
        let mut accept = |hit: &Hit| accept(packet * PACKET + lane, hit);
        if occluded(simd, self.bvh, self.bvh.root, &query, &mut accept) {
            self.blocked[packet] |= 1 << lane;
        }
    }
}

/// Up to [`TOGETHER`] packets, sorted into beams.
struct Sorted<'a> {
    bvh: &'a Bvh,
    packets: &'a [Packet],
    /// The number of the first packet.
    first: usize,
}

impl Sorted<'_> {
    /// Hands over all rays that can meet anything.
    #[inline(always)]
    fn each<S: Simd>(&self, simd: S, part: &mut impl Part) {
        if self.bvh.root == Child::NONE {
            return;
        }
        let mut beams = [Beam::EMPTY; BEAMS];
        let mut packet_of = [0; BEAMS];
        let mut classes = [Classes::NONE; TOGETHER];
        let mut left = [NO_LANES; TOGETHER];
        for (index, packet) in self.packets.iter().enumerate() {
            classes[index] = Classes::of(packet);
            left[index] = classes[index].valid() & Mask::from(packet.active);
        }
        let mut from = 0;
        while let Some(first) = (from..self.packets.len()).find(|&index| left[index] != NO_LANES) {
            from = first;
            let octant = class_of(&classes[first], left[first]).octant();
            let mut len = 0;
            for index in first..self.packets.len() {
                let mut others = left[index];
                while others != NO_LANES {
                    let class = class_of(&classes[index], others);
                    let mut lanes = others & classes[index].lanes(class);
                    others &= !lanes;
                    if class.octant() != octant {
                        continue;
                    }
                    left[index] &= !lanes;
                    let packet = self.first + index;
                    if lanes.count_ones() < FEW {
                        while lanes != NO_LANES {
                            part.ray(simd, packet, first_wide_lane(lanes));
                            lanes = without_first(lanes);
                        }
                        continue;
                    }
                    beams[len].prepare(simd, &self.packets[index], (lanes, class), &self.bvh.bounds);
                    packet_of[len] = packet;
                    len += 1;
                    if len == BEAMS {
                        part.beams(simd, &mut beams, &packet_of);
                        len = 0;
                    }
                }
            }
            if len > 0 {
                part.beams(simd, &mut beams[..len], &packet_of);
            }
        }
    }
}

#[inline(always)]
fn class_of(classes: &Classes, lanes: Mask) -> Class {
    classes.get(first_wide_lane(lanes))
}

/// Finds the nearest hits of beams of one octant.
#[inline(always)]
fn share<S: Simd>(
    simd: S,
    bvh: &Bvh,
    (beams, packet_of): (&mut [Beam], &[usize; BEAMS]),
    accept: &mut impl FnMut(usize, &Hit) -> bool,
) {
    let mut extremes = [Extremes::NONE; BEAMS];
    let mut lanes_of_beams = BeamLanes::NONE;
    for (index, beam) in beams.iter().enumerate() {
        extremes[index] = beam.extremes(simd);
        lanes_of_beams.set(index, &extremes[index]);
    }
    let mut all = extremes[0];
    for other in &extremes[1..beams.len()] {
        all.join(other);
    }
    let mut stack = Stack::<(u32, u32, Mask)>::new();
    let (mut current, mut mask): (Child, Mask) = (bvh.root, (1 << beams.len()) - 1);
    loop {
        if current.is_block() || mask.count_ones() <= ALONE {
            while mask != NO_LANES {
                let index = first_wide_lane(mask);
                mask = without_first(mask);
                let accept = |lane: usize, hit: &Hit| accept(packet_of[index] * PACKET + lane, hit);
                let beam = &mut beams[index];
                (Descent { bvh, accept }).descend(simd, beam, &extremes[index], current);
                lanes_of_beams.limit.0[index] = beam.farthest(simd);
            }
            all.t_max = lanes_of_beams.limit.0[..beams.len()].iter().fold(f32::NEG_INFINITY, |most, t| most.max(*t));
        } else {
            let node = &bvh.nodes[current.index()];
            let (mut lanes, enter) = all.meets(simd, node.load(simd));
            let enter = simd.store(enter);
            let bottom = stack.len();
            while lanes != NO_LANES {
                let lane = first_lane(lanes);
                lanes = without_first(lanes);
                let met = lanes_of_beams.meets(simd, &node.planes, lane, beams[0].class) & mask;
                if met != NO_LANES {
                    stack.push((enter.0[lane].to_bits(), node.children[lane].0, met));
                }
            }
            stack.sort_from(bottom);
        }
        loop {
            let Some((enter, child, met)) = stack.pop() else { return };
            let enter = simd.wide_splat(f32::from_bits(enter));
            mask = met & simd.wide_at_most(enter, simd.wide_load(&lanes_of_beams.limit));
            if mask != NO_LANES {
                current = Child(child);
                break;
            }
        }
    }
}
