//! Packets of rays: sorted into beams, which go down the tree together.

use super::beam::{Beam, Classes};
use super::bvh::{Bvh, Closest, occluded};
use super::descent::Descent;
use super::dispatch::Work;
use super::lanes::{Mask, NO_LANES, Simd, WIDE};
use super::node::Child;
use super::packet::{Packet, PacketHits};
use super::query::Query;
use super::{Hit, PACKET};

/// Rays of a class below which each is traced by itself.
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
    fn run<S: Simd>(self, simd: S) {
        let Self { bvh, packets, hits, mut accept } = self;
        hits.fill(PacketHits::NONE);
        let mut beam = Beam::EMPTY;
        for (index, (packet, hits)) in packets.iter().zip(hits).enumerate() {
            let mut parts = Parts::of(bvh, packet);
            while let Some((lanes, few)) = parts.next(simd, bvh, packet, &mut beam) {
                let mut accept = |lane: usize, hit: &Hit| accept(index * PACKET + lane, hit);
                if few {
                    let mut lanes = lanes;
                    while lanes != NO_LANES {
                        let lane = lanes.trailing_zeros() as usize & (WIDE - 1);
                        lanes &= lanes - 1;
                        let (ray, accept) = (packet.ray(lane), |hit: &Hit| accept(lane, hit));
                        if let Some(hit) = (Closest { bvh, ray: &ray, accept }).run(simd) {
                            hits.set(lane, &hit);
                        }
                    }
                } else {
                    (Descent { bvh, accept }).descend::<S, true>(simd, &mut beam);
                    beam.report(hits);
                }
            }
        }
    }
}

impl<A: FnMut(usize, &Hit) -> bool> Work<()> for OccludedPackets<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { bvh, packets, blocked, mut accept } = self;
        blocked.fill(0);
        let mut beam = Beam::EMPTY;
        for (index, (packet, blocked)) in packets.iter().zip(blocked).enumerate() {
            let mut parts = Parts::of(bvh, packet);
            while let Some((lanes, few)) = parts.next(simd, bvh, packet, &mut beam) {
                let mut accept = |lane: usize, hit: &Hit| accept(index * PACKET + lane, hit);
                if few {
                    let mut lanes = lanes;
                    while lanes != NO_LANES {
                        let lane = lanes.trailing_zeros() as usize & (WIDE - 1);
                        lanes &= lanes - 1;
                        let Some(query) = Query::new(&packet.ray(lane), &bvh.bounds) else { continue };
                        let mut accept = |hit: &Hit| accept(lane, hit);
                        *blocked |= u16::from(occluded(simd, bvh, bvh.root, &query, &mut accept)) << lane;
                    }
                } else {
                    (Descent { bvh, accept }).descend::<S, false>(simd, &mut beam);
                    *blocked |= (lanes & !beam.open) as u16;
                }
            }
        }
    }
}

/// The classes of a packet's rays that are still to be traced.
struct Parts {
    classes: Classes,
    left: Mask,
}

impl Parts {
    #[inline(always)]
    fn of(bvh: &Bvh, packet: &Packet) -> Self {
        let classes = Classes::of(packet);
        let left = if bvh.root == Child::NONE { NO_LANES } else { classes.valid() & Mask::from(packet.active) };
        Self { classes, left }
    }

    /// The rays of the next class, and whether they are few; where they are not, the beam is made of them.
    #[inline(always)]
    fn next<S: Simd>(&mut self, simd: S, bvh: &Bvh, packet: &Packet, beam: &mut Beam) -> Option<(Mask, bool)> {
        if self.left == NO_LANES {
            return None;
        }
        let class = self.classes.get(self.left.trailing_zeros() as usize & (WIDE - 1));
        let lanes = self.left & self.classes.lanes(class);
        self.left &= !lanes;
        let few = lanes.count_ones() < FEW;
        if !few {
            beam.prepare(simd, packet, (lanes, class), &bvh.bounds);
        }
        Some((lanes, few))
    }
}
