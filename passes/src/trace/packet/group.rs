//! Traverses the tree with packets: sorts their rays into prepared packets, up to sixteen of which share the upper part of the tree.
//!
//! A prepared packet is up to sixteen rays of one packet that have the same octant and main axis. Up to sixteen prepared packets of the
//! same octant are a group. In closest-hit queries, a node's eight children are tested against the interval of the whole group, and each
//! child that is met against the intervals of the members, one member a lane. Where few members are left, each goes on by itself
//! ([`Descent`]).

use super::interval::{Interval, Intervals};
use super::octant::{Octant, Octants};
use super::prepared_packet::PreparedPacket;
use super::traverse::Descent;
use crate::trace::ray::{Hit, PACKET, Packet, PacketHits, TOGETHER};
use crate::trace::simd::{Kernel as _, Mask, NO_LANES, Simd, WIDE, first_lane, first_wide_lane, without_first};
use crate::trace::single::{Closest, occluded};
use crate::trace::tree::{Child, PreparedRay, Stack, WideTree};

/// Greatest number of prepared packets in a group, one a lane.
const GROUP: usize = WIDE;
/// In closest-hit queries, members go on by themselves where at most this many of a group are left.
const ALONE: u32 = 6;
/// Rays of one packet and octant are traced singly if there are fewer of them than this.
const FEW: u32 = 3;

/// The nearest hits of the rays of packets. `accept` also receives the ray's number: 16 times the index of its packet, plus its lane.
#[inline(always)]
pub(crate) fn closest_packets<S: Simd>(
    simd: S,
    tree: &WideTree,
    packets: &[Packet],
    hits: &mut [PacketHits],
    accept: impl FnMut(usize, &Hit) -> bool,
) {
    hits.fill(PacketHits::NONE);
    let mut nearest = Nearest { tree, packets, hits, accept };
    for (chunk, packets) in packets.chunks(TOGETHER).enumerate() {
        (Sorted { tree, packets, first: chunk * TOGETHER }).each(simd, &mut nearest);
    }
}

/// Which rays of up to [`TOGETHER`] packets are blocked, one bit a ray; `accept` as in [`closest_packets`].
#[inline(always)]
pub(crate) fn occluded_packets<S: Simd>(
    simd: S,
    tree: &WideTree,
    packets: &[Packet],
    blocked: &mut [u16],
    accept: impl FnMut(usize, &Hit) -> bool,
) {
    (Sorted { tree, packets, first: 0 }).each(simd, &mut Any { tree, packets, blocked, accept });
}

struct Nearest<'a, A> {
    tree: &'a WideTree,
    packets: &'a [Packet],
    hits: &'a mut [PacketHits],
    accept: A,
}

struct Any<'a, A> {
    tree: &'a WideTree,
    packets: &'a [Packet],
    blocked: &'a mut [u16],
    accept: A,
}

/// A query on sorted rays. A trait instead of closures, because a closure is compiled for the instruction set only where it is inlined.
trait Part {
    /// Traces a group of one octant; `packet_of` holds the index of each member's packet.
    fn group<S: Simd>(&mut self, simd: S, group: &mut [PreparedPacket], packet_of: &[usize; GROUP]);
    /// Traces a single ray, given by its packet and lane.
    fn ray<S: Simd>(&mut self, simd: S, packet: usize, lane: usize);
}

impl<A: FnMut(usize, &Hit) -> bool> Part for Nearest<'_, A> {
    #[inline(always)]
    fn group<S: Simd>(&mut self, simd: S, group: &mut [PreparedPacket], packet_of: &[usize; GROUP]) {
        share(simd, self.tree, (group, packet_of), &mut self.accept);
        for (prepared, packet) in group.iter().zip(packet_of) {
            prepared.report(&mut self.hits[*packet]);
        }
    }

    #[inline(always)]
    fn ray<S: Simd>(&mut self, simd: S, packet: usize, lane: usize) {
        let (ray, accept) = (self.packets[packet].ray(lane), &mut self.accept);
        let accept = |hit: &Hit| accept(packet * PACKET + lane, hit);
        if let Some(hit) = (Closest { tree: self.tree, ray: &ray, accept }).run(simd) {
            self.hits[packet].set(lane, &hit);
        }
    }
}

impl<A: FnMut(usize, &Hit) -> bool> Part for Any<'_, A> {
    /// Members are traced one after the other: occlusion rays of a group soon diverge, and the intervals of a whole group would reject too
    /// few boxes.
    #[inline(always)]
    fn group<S: Simd>(&mut self, simd: S, group: &mut [PreparedPacket], packet_of: &[usize; GROUP]) {
        for (prepared, &packet) in group.iter_mut().zip(packet_of) {
            let accept = &mut self.accept;
            let accept = |lane: usize, hit: &Hit| accept(packet * PACKET + lane, hit);
            self.blocked[packet] |= (Descent { tree: self.tree, accept }).stopped(simd, prepared) as u16;
        }
    }

    #[inline(always)]
    fn ray<S: Simd>(&mut self, simd: S, packet: usize, lane: usize) {
        let Some(prepared) = PreparedRay::new(&self.packets[packet].ray(lane), &self.tree.bounds) else { return };
        let accept = &mut self.accept;
        let mut accept = |hit: &Hit| accept(packet * PACKET + lane, hit);
        if occluded(simd, self.tree, self.tree.root, &prepared, &mut accept) {
            self.blocked[packet] |= 1 << lane;
        }
    }
}

/// Up to [`TOGETHER`] packets, whose rays are sorted into groups.
struct Sorted<'a> {
    tree: &'a WideTree,
    packets: &'a [Packet],
    /// Index of the first of these packets among all packets of the query.
    first: usize,
}

impl Sorted<'_> {
    /// Passes every ray that can hit anything to `part`, in a group or singly.
    #[expect(clippy::large_stack_arrays, reason = "there once a thread: tracing runs no other work meanwhile")]
    #[inline(always)]
    fn each<S: Simd>(&self, simd: S, part: &mut impl Part) {
        if self.tree.root == Child::NONE {
            return;
        }
        let mut group = [PreparedPacket::EMPTY; GROUP];
        let mut packet_of = [0; GROUP];
        let mut octants = [Octants::NONE; TOGETHER];
        let mut left = [NO_LANES; TOGETHER];
        for (index, packet) in self.packets.iter().enumerate() {
            octants[index] = Octants::of(packet);
            left[index] = octants[index].valid() & Mask::from(packet.active);
        }
        let mut from = 0;
        while let Some(first) = (from..self.packets.len()).find(|&index| left[index] != NO_LANES) {
            from = first;
            let signs = octant_of(&octants[first], left[first]).signs();
            let mut len = 0;
            for index in first..self.packets.len() {
                let mut others = left[index];
                while others != NO_LANES {
                    let octant = octant_of(&octants[index], others);
                    let mut lanes = others & octants[index].lanes(octant);
                    others &= !lanes;
                    if octant.signs() != signs {
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
                    group[len].prepare(simd, &self.packets[index], (lanes, octant), &self.tree.bounds);
                    packet_of[len] = packet;
                    len += 1;
                    if len == GROUP {
                        part.group(simd, &mut group, &packet_of);
                        len = 0;
                    }
                }
            }
            if len > 0 {
                part.group(simd, &mut group[..len], &packet_of);
            }
        }
    }
}

#[inline(always)]
fn octant_of(octants: &Octants, lanes: Mask) -> Octant {
    octants.get(first_wide_lane(lanes))
}

/// Finds the nearest hits of a group of one octant.
#[inline(always)]
fn share<S: Simd>(
    simd: S,
    tree: &WideTree,
    (group, packet_of): (&mut [PreparedPacket], &[usize; GROUP]),
    accept: &mut impl FnMut(usize, &Hit) -> bool,
) {
    let mut interval_of = [Interval::NONE; GROUP];
    let mut intervals = Intervals::NONE;
    for (index, prepared) in group.iter().enumerate() {
        interval_of[index] = prepared.interval(simd);
        intervals.set(index, &interval_of[index]);
    }
    let mut all = interval_of[0];
    for other in &interval_of[1..group.len()] {
        all.join(other);
    }
    let mut stack = Stack::<(u32, u32, Mask)>::new();
    let (mut current, mut mask): (Child, Mask) = (tree.root, (1 << group.len()) - 1);
    loop {
        if current.is_leaf() || mask.count_ones() <= ALONE {
            while mask != NO_LANES {
                let index = first_wide_lane(mask);
                mask = without_first(mask);
                let accept = |lane: usize, hit: &Hit| accept(packet_of[index] * PACKET + lane, hit);
                let packet = &mut group[index];
                (Descent { tree, accept }).descend(simd, packet, &interval_of[index], current);
                intervals.limit.0[index] = packet.farthest(simd);
            }
            all.t_max = intervals.limit.0[..group.len()].iter().fold(f32::NEG_INFINITY, |most, t| most.max(*t));
        } else {
            let node = &tree.nodes[current.index()];
            let (mut lanes, enter) = all.meets(simd, node.load(simd));
            let enter = simd.store(enter);
            let bottom = stack.len();
            while lanes != NO_LANES {
                let lane = first_lane(lanes);
                lanes = without_first(lanes);
                let met = intervals.meets(simd, &node.planes, lane, group[0].octant) & mask;
                if met != NO_LANES {
                    stack.push((enter.0[lane].to_bits(), node.children[lane].0, met));
                }
            }
            stack.sort_from(bottom);
        }
        loop {
            let Some((enter, child, met)) = stack.pop() else { return };
            let enter = simd.wide_splat(f32::from_bits(enter));
            mask = met & simd.wide_at_most(enter, simd.wide_load(&intervals.limit));
            if mask != NO_LANES {
                current = Child(child);
                break;
            }
        }
    }
}
