//! Many short rays from one origin: the triangles in reach are gathered once and all rays are tested against them alone.

use super::block::Block;
use super::bundle::OccludedPackets;
use super::bvh::{Bvh, occluded};
use super::clear::{Ball, Plane, half_ball, slack};
use super::dispatch::Work;
use super::facet::{CHUNK, Facet, LONGEST, Rays};
use super::lanes::{Mask, NO_LANES, Simd, first_lane, without_first};
use super::node::Child;
use super::query::{Query, UNIT_ROUNDOFF};
use super::stack::Stack;
use super::{Fan, Hit, PACKET, Packet, Ray};
use glam::Vec3;

/// Triangles gathered at most; with more in reach, rays are traced.
const GATHERED: usize = 160;
/// Triangles gathered for however few rays, to which come three for each two rays. With 160 for sixteen rays, short rays
/// on a scan and in Sponza took more than twice as long as by themselves.
const FEW_GATHERED: usize = 16;
/// How many times longer than the rays a scene must be for triangles to be gathered.
const LONG: f32 = 4.0;
/// Rays from which on they are taken down the tree together where their triangles are too many to gather.
const MANY: usize = 32;
/// Nodes and blocks looked into at most before giving up.
const VISITS: usize = 96;

/// See [`Tracer::count_open`](super::Tracer::count_open).
pub(super) struct CountOpen<'a, A> {
    pub(super) bvh: &'a Bvh,
    pub(super) fan: &'a Fan<'a>,
    pub(super) accept: A,
}

/// Blocks and the lanes of their triangles that are in reach.
struct Found {
    sources: [(Child, Mask); VISITS],
    len: usize,
}

impl<A: FnMut(&Hit) -> bool> Work<u32> for CountOpen<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> u32 {
        let mut entry = self.bvh.root;
        let several = self.fan.directions.len() > 1;
        match if several { self.gather(simd, &mut entry) } else { None } {
            Some(found) => {
                let mut open = 0;
                for rays in self.fan.directions.chunks(CHUNK) {
                    open += self.test(simd, &found, rays);
                }
                open
            }
            None if self.fan.directions.len() >= MANY => self.count_together(simd),
            None => self.count_one_by_one(simd, entry),
        }
    }
}

impl<A: FnMut(&Hit) -> bool> CountOpen<'_, A> {
    /// Traces the rays by themselves, from the lowest node that all of them are under.
    // A loop, not a closure: what is not inlined here is not compiled for the instruction set.
    #[inline(always)]
    fn count_one_by_one<S: Simd>(&mut self, simd: S, entry: Child) -> u32 {
        let Fan { origin, t_min, t_max, directions, .. } = *self.fan;
        let mut open = 0;
        for &direction in directions {
            let ray = Ray { origin, direction, t_min, t_max };
            let stopped = match Query::new(&ray, &self.bvh.bounds) {
                Some(query) => occluded(simd, self.bvh, entry, &query, &mut self.accept),
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

    /// How many rays none of the triangles stops.
    #[inline(always)]
    fn test<S: Simd>(&mut self, simd: S, found: &Found, directions: &[Vec3]) -> u32 {
        let Fan { origin, t_min, t_max, .. } = *self.fan;
        let mut rays = Rays::new(directions);
        for &(source, mut lanes) in &found.sources[..found.len] {
            let block = &self.bvh.blocks[source.index()];
            while lanes != NO_LANES {
                let lane = first_lane(lanes);
                lanes = without_first(lanes);
                let facet = Facet::new(block.corners(lane), block.is_transparent(lane), origin, t_min, t_max);
                let left = rays.close(simd, &facet, |index| {
                    let ray = Ray { origin, direction: directions[index], t_min, t_max };
                    Query::new(&ray, &self.bvh.bounds)
                        .is_some_and(|query| stopped_by(simd, block, lane, &query, &mut self.accept))
                });
                if !left {
                    return 0;
                }
            }
        }
        rays.count()
    }

    /// Finds the triangles whose bounds meet the box around all rays; nothing if they are too many or too hard to find.
    /// `entry` becomes the lowest node that all of them are under.
    ///
    /// The box is grown by more than the rounding of the triangle test, so that what a ray would hit is in it.
    #[inline(always)]
    fn gather<S: Simd>(&self, simd: S, entry: &mut Child) -> Option<Found> {
        let interval = self.fan.t_min < self.fan.t_max && self.fan.t_max > 0.0;
        if !interval || !within(self.fan.directions, LONGEST) {
            return None;
        }
        let (bounds, origin) = (&self.bvh.bounds, self.fan.origin);
        // Long rays have too many triangles in reach.
        if self.fan.t_max * LONG >= (bounds.high - bounds.low).max_element() {
            return None;
        }
        let pad = slack(bounds, origin);
        let ball = Ball::new(origin, self.fan.t_max * LONGEST, pad);
        let plane = self.fan.above.map(|normal| Plane { origin, normal });
        let (low, high) = match plane {
            // The directions of a hemisphere fill it: its box is cheaper to have than theirs.
            Some(plane) => half_ball(plane, self.fan.t_max * LONGEST, pad)?,
            None => {
                let (mut low, mut high) = (Vec3::ZERO, Vec3::ZERO);
                for direction in self.fan.directions {
                    (low, high) = (low.min(*direction), high.max(*direction));
                }
                let t = self.fan.t_max * (1.0 + 16.0 * UNIT_ROUNDOFF);
                let (low, high) = (origin + low * t - pad, origin + high * t + pad);
                if !(low.is_finite() && high.is_finite()) {
                    return None;
                }
                (low.to_array(), high.to_array())
            }
        };

        let mut found = Found { sources: [(Child::NONE, NO_LANES); VISITS], len: 0 };
        let most = GATHERED.min(FEW_GATHERED + 3 * self.fan.directions.len() / 2);
        let mut triangles = 0;
        let mut stack = Stack::new();
        let mut current = self.bvh.root;
        if current == Child::NONE {
            return Some(found);
        }
        for _ in 0..VISITS.min(most) {
            if current.is_block() {
                let block = &self.bvh.blocks[current.index()];
                let mut lanes = block.overlapping(simd, &low, &high);
                if let Some(plane) = plane
                    && lanes != NO_LANES
                {
                    lanes &= !block.behind(simd, plane);
                }
                if lanes != NO_LANES {
                    lanes &= !block.outside(simd, &ball);
                }
                if lanes != NO_LANES {
                    triangles += lanes.count_ones();
                    found.sources[found.len] = (current, lanes);
                    found.len += 1;
                }
            } else {
                let node = &self.bvh.nodes[current.index()];
                let mut lanes = node.overlapping(simd, &low, &high);
                if let Some(plane) = plane
                    && lanes != NO_LANES
                {
                    lanes &= !node.behind(simd, plane);
                }
                if lanes.count_ones() == 1 && current == *entry {
                    *entry = node.children[first_lane(lanes)];
                }
                while lanes != NO_LANES {
                    stack.push(u64::from(node.children[first_lane(lanes)].0));
                    lanes = without_first(lanes);
                }
            }
            if triangles as usize > most {
                return None;
            }
            match stack.pop() {
                Some(entry) => current = Child(entry as u32),
                None => return Some(found),
            }
        }
        None
    }
}

/// Whether all components are numbers of this size at most.
#[inline(always)]
fn within(directions: &[Vec3], most: f32) -> bool {
    // Sixteen at a time: a loop of fixed length becomes vector code.
    let (chunks, rest) = bytemuck::cast_slice::<Vec3, f32>(directions).as_chunks::<16>();
    let (mut longest, mut zero) = ([0.0_f32; 16], [0.0_f32; 16]);
    for chunk in chunks {
        for lane in 0..16 {
            let size = chunk[lane].abs();
            longest[lane] = if size > longest[lane] { size } else { longest[lane] };
            zero[lane] += chunk[lane] * 0.0;
        }
    }
    let whole = (0..16).all(|lane| longest[lane] <= most && zero[lane] == 0.0);
    whole && rest.iter().all(|value| value.abs() <= most)
}

/// Whether the triangle in one lane of a block stops a ray.
#[inline(always)]
fn stopped_by<S: Simd>(
    simd: S,
    block: &Block,
    lane: usize,
    query: &Query,
    accept: &mut impl FnMut(&Hit) -> bool,
) -> bool {
    let triangle = block.triangle(lane);
    let mut limit = query.t_max;
    block.intersect(simd, query, &mut limit, |hit, transparent, _| {
        hit.triangle == triangle && hit.t < query.t_max && (!transparent || accept(&hit))
    })
}
