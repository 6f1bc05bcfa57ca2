//! Packets of rays down the tree: sorted into beams, up to sixteen of which share the upper part.
//!
//! A beam is up to sixteen rays of a packet that run into one octant along one main axis. Where many beams go the same way, a
//! node's eight children are tested against the interval of all of them, and a child that is met against the intervals of the
//! sixteen beams, a beam a lane; from where few of them are left each goes on by itself ([`Descent`]).

use super::beam::{Beam, Class, Classes, Extremes};
use super::bvh::{Bvh, Closest, occluded};
use super::descent::Descent;
use super::dispatch::Work;
use super::lanes::{F8, F16, LANES, Mask, NO_LANES, Simd, WIDE, first_lane, without_first};
use super::node::Child;
use super::packet::{Packet, PacketHits};
use super::query::Query;
use super::stack::Stack;
use super::{Hit, PACKET, parallel};
use std::ops::Range;

/// Beams that go down the tree together, and packets that are sorted together.
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

/// See [`Tracer::occluded_packets`](super::Tracer::occluded_packets). Compiled once, for whatever `accept` is.
pub(super) fn occluded_packets(
    bvh: &Bvh,
    packets: &[Packet],
    blocked: &mut [u16],
    accept: &mut dyn FnMut(usize, &Hit) -> bool,
) {
    bvh.lanes.run(OccludedPackets { bvh, packets, blocked, accept });
}

struct ClosestPackets<'a, A> {
    bvh: &'a Bvh,
    packets: &'a [Packet],
    hits: &'a mut [PacketHits],
    accept: A,
}

struct OccludedPackets<'a, A> {
    bvh: &'a Bvh,
    packets: &'a [Packet],
    blocked: &'a mut [u16],
    accept: A,
}

impl<A: FnMut(usize, &Hit) -> bool> Work<()> for ClosestPackets<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        self.hits.fill(PacketHits::NONE);
        let some = 0..self.packets.len();
        (Sorted { bvh: self.bvh, packets: self.packets, some }).each(simd, &mut self);
    }
}

impl<A: FnMut(usize, &Hit) -> bool> Work<()> for OccludedPackets<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        self.blocked.fill(0);
        for first in (0..self.packets.len()).step_by(BEAMS) {
            let some = first..self.packets.len().min(first + BEAMS);
            let (packets, blocked) = (&self.packets[some.clone()], &mut self.blocked[some.clone()]);
            let accept = &mut self.accept;
            let mut accept = |ray: usize, hit: &Hit| accept(first * PACKET + ray, hit);
            if !parallel::occluded(simd, self.bvh, packets, blocked, &mut accept) {
                (Sorted { bvh: self.bvh, packets: self.packets, some }).each(simd, &mut self);
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

impl<A: FnMut(usize, &Hit) -> bool> Part for OccludedPackets<'_, A> {
    /// Nothing is shared: rays that look for anything leave their common way early, and intervals let too much through.
    #[inline(always)]
    fn beams<S: Simd>(&mut self, simd: S, beams: &mut [Beam], packet_of: &[usize; BEAMS]) {
        for (beam, &packet) in beams.iter_mut().zip(packet_of) {
            let (before, extremes, accept) = (beam.open, beam.extremes(simd), &mut self.accept);
            let accept = |lane: usize, hit: &Hit| accept(packet * PACKET + lane, hit);
            (Descent { bvh: self.bvh, accept }).descend::<S, false>(simd, beam, &extremes, self.bvh.root);
            self.blocked[packet] |= (before & !beam.open) as u16;
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

/// Some of the packets, sorted into beams.
struct Sorted<'a> {
    bvh: &'a Bvh,
    packets: &'a [Packet],
    some: Range<usize>,
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
        for (chunk, packets) in self.packets[self.some.clone()].chunks(BEAMS).enumerate() {
            let mut classes = [Classes::NONE; BEAMS];
            let mut left = [NO_LANES; BEAMS];
            for (index, packet) in packets.iter().enumerate() {
                classes[index] = Classes::of(packet);
                left[index] = classes[index].valid() & Mask::from(packet.active);
            }
            let mut from = 0;
            while let Some(first) = (from..packets.len()).find(|&index| left[index] != NO_LANES) {
                from = first;
                let octant = class_of(&classes[first], left[first]).octant();
                let mut len = 0;
                for index in first..packets.len() {
                    let mut others = left[index];
                    while others != NO_LANES {
                        let class = class_of(&classes[index], others);
                        let lanes = others & classes[index].lanes(class);
                        others &= !lanes;
                        if class.octant() != octant {
                            continue;
                        }
                        left[index] &= !lanes;
                        let packet = self.some.start + chunk * BEAMS + index;
                        if lanes.count_ones() < FEW {
                            let mut lanes = lanes;
                            while lanes != NO_LANES {
                                part.ray(simd, packet, lanes.trailing_zeros() as usize & (WIDE - 1));
                                lanes &= lanes - 1;
                            }
                            continue;
                        }
                        beams[len].prepare(simd, &packets[index], (lanes, class), &self.bvh.bounds);
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
}

#[inline(always)]
fn class_of(classes: &Classes, lanes: Mask) -> Class {
    classes.get(lanes.trailing_zeros() as usize & (WIDE - 1))
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
                let index = mask.trailing_zeros() as usize & (BEAMS - 1);
                mask &= mask - 1;
                let accept = |lane: usize, hit: &Hit| accept(packet_of[index] * PACKET + lane, hit);
                let beam = &mut beams[index];
                (Descent { bvh, accept }).descend::<S, true>(simd, beam, &extremes[index], current);
                lanes_of_beams.limit.0[index] = beam.farthest(simd);
            }
            all.limit_to(lanes_of_beams.limit.0[..beams.len()].iter().fold(f32::NEG_INFINITY, |most, t| most.max(*t)));
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

/// The extremes of sixteen beams, a beam a lane.
struct BeamLanes {
    near_origin: [F16; 3],
    far_origin: [F16; 3],
    inverse: [[F16; 3]; 2],
    far_inverse: [[F16; 3]; 2],
    t_min: F16,
    /// The distances up to which beams look; lanes without a beam meet nothing.
    limit: F16,
}

const ZERO: F16 = F16([0.0; WIDE]);

impl BeamLanes {
    const NONE: Self = Self {
        near_origin: [ZERO; 3],
        far_origin: [ZERO; 3],
        inverse: [[ZERO; 3]; 2],
        far_inverse: [[ZERO; 3]; 2],
        t_min: ZERO,
        limit: F16([f32::NEG_INFINITY; WIDE]),
    };

    fn set(&mut self, lane: usize, extremes: &Extremes) {
        for axis in 0..3 {
            self.near_origin[axis].0[lane] = extremes.near_origin[axis];
            self.far_origin[axis].0[lane] = extremes.far_origin[axis];
            for side in 0..2 {
                self.inverse[side][axis].0[lane] = extremes.inverse[side][axis];
                self.far_inverse[side][axis].0[lane] = extremes.far_inverse[side][axis];
            }
        }
        self.t_min.0[lane] = extremes.t_min;
        self.limit.0[lane] = extremes.t_max;
    }

    /// The beams of which any ray may be in a box, by the operations of [`Extremes::meets`].
    #[inline(always)]
    fn meets<S: Simd>(&self, simd: S, planes: &[[F8; 3]; 2], box_lane: usize, class: Class) -> Mask {
        let lane = box_lane & (LANES - 1);
        let backward = class.backward();
        let mut enter = simd.wide_load(&self.t_min);
        let mut leave = simd.wide_load(&self.limit);
        for axis in 0..3 {
            let side = backward[axis] & 1;
            let (near, far) = (planes[side][axis].0[lane], planes[1 - side][axis].0[lane]);
            let near = simd.wide_sub(simd.wide_splat(near), simd.wide_load(&self.near_origin[axis]));
            let far = simd.wide_sub(simd.wide_splat(far), simd.wide_load(&self.far_origin[axis]));
            let (low, high) = (simd.wide_load(&self.inverse[0][axis]), simd.wide_load(&self.inverse[1][axis]));
            let least = simd.wide_min_or(simd.wide_mul(near, low), simd.wide_mul(near, high));
            enter = simd.wide_max_or(least, enter);
            let (low, high) = (simd.wide_load(&self.far_inverse[0][axis]), simd.wide_load(&self.far_inverse[1][axis]));
            let most = simd.wide_max_or(simd.wide_mul(far, low), simd.wide_mul(far, high));
            leave = simd.wide_min_or(most, leave);
        }
        simd.wide_at_most(enter, leave)
    }
}
