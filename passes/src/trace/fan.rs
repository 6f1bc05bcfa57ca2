//! Many rays from one origin, traced.

use super::bundle::OccludedPackets;
use super::bvh::{Bvh, occluded};
use super::dispatch::Work;
use super::lanes::{Simd, WIDE};
use super::query::Query;
use super::{Fan, Hit, PACKET, Packet, Ray};

/// Rays from which on they are taken down the tree together.
const MANY: usize = 32;
/// Rays that are taken down the tree together at most.
const CHUNK: usize = 8 * WIDE;

/// See [`Tracer::count_open`](super::Tracer::count_open).
pub(super) struct CountOpen<'a, A> {
    pub(super) bvh: &'a Bvh,
    pub(super) fan: &'a Fan<'a>,
    pub(super) accept: A,
}

impl<A: FnMut(&Hit) -> bool> Work<u32> for CountOpen<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> u32 {
        if self.fan.directions.len() >= MANY { self.count_together(simd) } else { self.count_one_by_one(simd) }
    }
}

impl<A: FnMut(&Hit) -> bool> CountOpen<'_, A> {
    /// Traces the rays by themselves.
    // A loop, not a closure: what is not inlined here is not compiled for the instruction set.
    #[inline(always)]
    fn count_one_by_one<S: Simd>(&mut self, simd: S) -> u32 {
        let Fan { origin, t_min, t_max, directions, .. } = *self.fan;
        let mut open = 0;
        for &direction in directions {
            let ray = Ray { origin, direction, t_min, t_max };
            let stopped = match Query::new(&ray, &self.bvh.bounds) {
                Some(query) => occluded(simd, self.bvh, self.bvh.root, &query, &mut self.accept),
                None => false,
            };
            open += u32::from(!stopped);
        }
        open
    }

    /// Takes the rays down the tree together, those that run into one octant side by side.
    #[inline(always)]
    fn count_together<S: Simd>(&mut self, simd: S) -> u32 {
        let Fan { origin, t_min, t_max, directions, .. } = *self.fan;
        let mut packets = [const { Packet::NONE }; CHUNK / PACKET];
        let mut open = 0;
        for directions in directions.chunks(CHUNK) {
            let mut blocked = [0; CHUNK / PACKET];
            let used = directions.len().div_ceil(PACKET);
            for (packet, directions) in packets.iter_mut().zip(directions.chunks(PACKET)) {
                (packet.t_min, packet.t_max, packet.active) = (t_min, t_max, 0);
                for (lane, &direction) in directions.iter().enumerate() {
                    packet.set(lane, origin, direction);
                }
            }
            let accept = &mut self.accept;
            let accept = |_, hit: &Hit| accept(hit);
            let (packets, blocked) = (&packets[..used], &mut blocked[..used]);
            OccludedPackets { bvh: self.bvh, packets, blocked, accept }.run(simd);
            open += directions.len() as u32;
            for blocked in &*blocked {
                open -= u16::count_ones(*blocked);
            }
        }
        open
    }
}
