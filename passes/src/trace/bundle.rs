//! Many rays down the tree together.
//!
//! Rays of some packets are sorted into beams of up to sixteen that run into one octant, and up to sixteen beams go down
//! the tree at once. A node's eight children are tested against the interval of all of them; a child that is met, against
//! the intervals of the sixteen beams, one a lane; a triangle, against the sixteen rays of each beam that its bounds are
//! met by. So the tree is walked once for 256 rays. (Interval arithmetic for packets: Boulos, Wald and Shirley, "Geometric
//! and Arithmetic Culling Methods for Entire Ray Packets", 2006.)
//!
//! Every bound is computed by the operations of the single ray's box test, which are monotone, from the extremes of their
//! operands: rounding included, no box is left out that any single ray's test would enter.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::beam::{Beam, Class, Classes, FAR};
use super::block::Block;
use super::bvh::{Bvh, Closest, occluded};
use super::dispatch::Work;
use super::lanes::{F8, F16, LANES, Mask, NO_LANES, Simd, WIDE, first_lane, without_first};
use super::node::Child;
use super::packet::{Packet, PacketHits};
use super::query::Query;
use super::stack::STACK;
use super::{Hit, PACKET};

/// Beams that go down the tree together.
const BEAMS: usize = WIDE;
/// Packets sorted together.
const PACKETS: usize = 16;
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

/// See [`Tracer::closest_packets`](super::Tracer::closest_packets).
pub(super) struct ClosestPackets<'a, A> {
    pub(super) bvh: &'a Bvh,
    pub(super) packets: &'a [Packet],
    pub(super) hits: &'a mut [PacketHits],
    pub(super) accept: A,
}

/// See [`Tracer::occluded_packets`](super::Tracer::occluded_packets).
pub(super) struct OccludedPackets<'a, A> {
    pub(super) bvh: &'a Bvh,
    pub(super) packets: &'a [Packet],
    pub(super) blocked: &'a mut [u16],
    pub(super) accept: A,
}

impl<A: FnMut(usize, &Hit) -> bool> Work<()> for ClosestPackets<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        self.hits.fill(PacketHits::NONE);
        if self.bvh.root != Child::NONE {
            let sorted = Sorted { bvh: self.bvh, packets: self.packets };
            sorted.each(simd, &mut self);
        }
    }
}

impl<A: FnMut(usize, &Hit) -> bool> Work<()> for OccludedPackets<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        self.blocked.fill(0);
        if self.bvh.root != Child::NONE {
            let sorted = Sorted { bvh: self.bvh, packets: self.packets };
            sorted.each(simd, &mut self);
        }
    }
}

/// What is done with sorted rays. Not closures: those are compiled for the instruction set only where they are inlined.
trait Part {
    /// Beams of one octant.
    fn beams<S: Simd>(&mut self, simd: S, beams: &mut [Beam]);
    /// A lone ray: its packet and its lane.
    fn ray<S: Simd>(&mut self, simd: S, packet: usize, lane: usize);
}

impl<A: FnMut(usize, &Hit) -> bool> Part for ClosestPackets<'_, A> {
    #[inline(always)]
    fn beams<S: Simd>(&mut self, simd: S, beams: &mut [Beam]) {
        walk::<S, true>(simd, self.bvh, self.packets, beams, &mut self.accept);
        for beam in beams {
            beam.report(&mut self.hits[beam.packet]);
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
    #[inline(always)]
    fn beams<S: Simd>(&mut self, simd: S, beams: &mut [Beam]) {
        let mut before = [NO_LANES; BEAMS];
        for (before, beam) in before.iter_mut().zip(&*beams) {
            *before = beam.open;
        }
        walk::<S, false>(simd, self.bvh, self.packets, beams, &mut self.accept);
        for (beam, before) in beams.iter().zip(before) {
            self.blocked[beam.packet] |= (before & !beam.open) as u16;
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

/// Packets, sorted into beams.
struct Sorted<'a> {
    bvh: &'a Bvh,
    packets: &'a [Packet],
}

impl Sorted<'_> {
    /// Hands over all rays that can meet anything.
    #[inline(always)]
    fn each<S: Simd>(&self, simd: S, part: &mut impl Part) {
        let mut beams = [Beam::EMPTY; BEAMS];
        for (chunk, packets) in self.packets.chunks(PACKETS).enumerate() {
            let mut classes = [Classes::NONE; PACKETS];
            let mut left = [NO_LANES; PACKETS];
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
                        let packet = chunk * PACKETS + index;
                        if lanes.count_ones() < FEW {
                            let mut lanes = lanes;
                            while lanes != NO_LANES {
                                part.ray(simd, packet, lanes.trailing_zeros() as usize);
                                lanes &= lanes - 1;
                            }
                            continue;
                        }
                        beams[len].prepare(simd, &packets[index], (packet, lanes, class), &self.bvh.bounds);
                        len += 1;
                        if len == BEAMS {
                            part.beams(simd, &mut beams);
                            len = 0;
                        }
                    }
                }
                if len > 0 {
                    part.beams(simd, &mut beams[..len]);
                }
            }
        }
    }
}

#[inline(always)]
fn class_of(classes: &Classes, lanes: Mask) -> Class {
    classes.get(lanes.trailing_zeros() as usize & (WIDE - 1))
}

/// Extremes of what the box test of a ray computes with, of several rays.
#[derive(Clone, Copy)]
struct Extremes<V> {
    /// The origin that gives the least distance to a near plane, and the greatest to a far one.
    near_origin: [V; 3],
    far_origin: [V; 3],
    /// Least and greatest reciprocals of directions, and the same for far planes.
    inverse: [[V; 3]; 2],
    far_inverse: [[V; 3]; 2],
    t_min: V,
    limit: V,
}

/// Beams as their boxes see them, a beam a lane, and all of them together.
struct Intervals {
    beams: Extremes<F16>,
    all: Extremes<f32>,
    backward: [usize; 3],
}

const NOWHERE: F16 = F16([f32::NEG_INFINITY; WIDE]);

impl Intervals {
    #[inline(always)]
    fn new<S: Simd>(simd: S, beams: &[Beam]) -> Self {
        let backward = beams[0].class.backward();
        let zero = F16([0.0; WIDE]);
        let mut each = Extremes {
            near_origin: [zero; 3],
            far_origin: [zero; 3],
            inverse: [[zero; 3]; 2],
            far_inverse: [[zero; 3]; 2],
            t_min: zero,
            // Lanes without a beam meet nothing.
            limit: NOWHERE,
        };
        let (low, high) = (f32::INFINITY, f32::NEG_INFINITY);
        let start = [0, 1, 2].map(|axis| if backward[axis] == 0 { high } else { low });
        let opposite = [0, 1, 2].map(|axis| if backward[axis] == 0 { low } else { high });
        let mut all = Extremes {
            near_origin: start,
            far_origin: opposite,
            inverse: [[low; 3], [high; 3]],
            far_inverse: [[low; 3], [high; 3]],
            t_min: low,
            limit: high,
        };
        for (index, beam) in beams.iter().enumerate() {
            for axis in 0..3 {
                let near = beam.range(simd, &beam.near_origin[axis]);
                let far = beam.range(simd, &beam.far_origin[axis]);
                let inverse = beam.range(simd, &beam.inverse[axis]);
                let (near, far) = if backward[axis] == 0 { (near.1, far.0) } else { (near.0, far.1) };
                each.near_origin[axis].0[index] = near;
                each.far_origin[axis].0[index] = far;
                each.inverse[0][axis].0[index] = inverse.0;
                each.inverse[1][axis].0[index] = inverse.1;
                each.far_inverse[0][axis].0[index] = inverse.0 * FAR;
                each.far_inverse[1][axis].0[index] = inverse.1 * FAR;
                let of_all = if backward[axis] == 0 {
                    (all.near_origin[axis].max(near), all.far_origin[axis].min(far))
                } else {
                    (all.near_origin[axis].min(near), all.far_origin[axis].max(far))
                };
                (all.near_origin[axis], all.far_origin[axis]) = of_all;
                all.inverse[0][axis] = all.inverse[0][axis].min(inverse.0);
                all.inverse[1][axis] = all.inverse[1][axis].max(inverse.1);
            }
            let (t_min, t_max) = beam.interval_of_rays();
            each.t_min.0[index] = t_min;
            each.limit.0[index] = t_max;
            all.t_min = all.t_min.min(t_min);
            all.limit = all.limit.max(t_max);
        }
        all.far_inverse = all.inverse.map(|side| side.map(|inverse| inverse * FAR));
        Self { beams: each, all, backward }
    }

    /// The lanes of boxes that any ray may be in, and below which distance it does not enter them: a ray of the one beam in
    /// `mask`, or with more than one of any beam.
    #[inline(always)]
    fn boxes<S: Simd>(&self, simd: S, mask: Mask, planes: [[S::Vector; 3]; 2]) -> (Mask, S::Vector) {
        let extremes = if is_lone(mask) { self.of_beam(mask.trailing_zeros() as usize) } else { self.all };
        let mut enter = simd.splat(extremes.t_min);
        let mut leave = simd.splat(extremes.limit);
        for axis in 0..3 {
            let side = self.backward[axis] & 1;
            let (near, far) = (planes[side][axis], planes[1 - side][axis]);
            let near = simd.sub(near, simd.splat(extremes.near_origin[axis]));
            let far = simd.sub(far, simd.splat(extremes.far_origin[axis]));
            let low = simd.splat(extremes.inverse[0][axis]);
            let high = simd.splat(extremes.inverse[1][axis]);
            enter = simd.max_or(simd.min_or(simd.mul(near, low), simd.mul(near, high)), enter);
            let low = simd.splat(extremes.far_inverse[0][axis]);
            let high = simd.splat(extremes.far_inverse[1][axis]);
            leave = simd.min_or(simd.max_or(simd.mul(far, low), simd.mul(far, high)), leave);
        }
        (simd.at_most(enter, leave), enter)
    }

    /// The beams of which any ray may be in a box.
    #[inline(always)]
    fn beams<S: Simd>(&self, simd: S, planes: [[f32; 3]; 2]) -> Mask {
        let extremes = &self.beams;
        let mut enter = simd.wide_load(&extremes.t_min);
        let mut leave = simd.wide_load(&extremes.limit);
        for axis in 0..3 {
            let side = self.backward[axis] & 1;
            let (near, far) = (planes[side][axis], planes[1 - side][axis]);
            let near = simd.wide_sub(simd.wide_splat(near), simd.wide_load(&extremes.near_origin[axis]));
            let far = simd.wide_sub(simd.wide_splat(far), simd.wide_load(&extremes.far_origin[axis]));
            let low = simd.wide_load(&extremes.inverse[0][axis]);
            let high = simd.wide_load(&extremes.inverse[1][axis]);
            let least = simd.wide_min_or(simd.wide_mul(near, low), simd.wide_mul(near, high));
            enter = simd.wide_max_or(least, enter);
            let low = simd.wide_load(&extremes.far_inverse[0][axis]);
            let high = simd.wide_load(&extremes.far_inverse[1][axis]);
            let most = simd.wide_max_or(simd.wide_mul(far, low), simd.wide_mul(far, high));
            leave = simd.wide_min_or(most, leave);
        }
        simd.wide_at_most(enter, leave)
    }

    /// The extremes of one beam.
    #[inline(always)]
    fn of_beam(&self, beam: usize) -> Extremes<f32> {
        let lane = |values: &F16| values.0[beam & (WIDE - 1)];
        let lanes = |values: &[F16; 3]| [lane(&values[0]), lane(&values[1]), lane(&values[2])];
        let Extremes { near_origin, far_origin, inverse, far_inverse, t_min, limit } = &self.beams;
        Extremes {
            near_origin: lanes(near_origin),
            far_origin: lanes(far_origin),
            inverse: [lanes(&inverse[0]), lanes(&inverse[1])],
            far_inverse: [lanes(&far_inverse[0]), lanes(&far_inverse[1])],
            t_min: lane(t_min),
            limit: lane(limit),
        }
    }
}

/// Whether a mask, which has a bit, has no other.
#[inline(always)]
fn is_lone(mask: Mask) -> bool {
    mask & (mask - 1) == 0
}

/// The box in one lane of boxes.
#[inline(always)]
fn box_in(planes: &[[F8; 3]; 2], lane: usize) -> [[f32; 3]; 2] {
    let corner = |[x, y, z]: &[F8; 3]| [x.0[lane], y.0[lane], z.0[lane]];
    [corner(&planes[0]), corner(&planes[1])]
}

/// Takes beams of one octant down the tree: for the nearest hits, or until every ray is stopped.
#[inline(always)]
fn walk<S: Simd, const NEAREST: bool>(
    simd: S,
    bvh: &Bvh,
    packets: &[Packet],
    beams: &mut [Beam],
    accept: &mut impl FnMut(usize, &Hit) -> bool,
) {
    let mut intervals = Intervals::new(simd, beams);
    // Beams with rays that are still looking.
    let mut alive: Mask = (1 << beams.len()) - 1;
    // Beams whose interval lately let through what none of their rays meets: a wide one, as at the edge of a roof. Their
    // rays are tested too, until that proves needless.
    let mut loose: Mask = NO_LANES;
    let mut stack = [(0_u64, NO_LANES); STACK];
    let mut depth = 0;
    let (mut current, mut mask) = (bvh.root, alive);
    loop {
        if current.is_block() {
            leaf::<S, NEAREST>(
                simd,
                (bvh, packets),
                &bvh.blocks[current.index()],
                (beams, &mut intervals, &mut alive, &mut loose),
                mask,
                accept,
            );
            if alive == NO_LANES {
                return;
            }
        } else {
            let node = &bvh.nodes[current.index()];
            let mut planes = [[simd.splat(0.0); 3]; 2];
            for axis in 0..3 {
                planes[0][axis] = simd.load(&node.planes[0][axis]);
                planes[1][axis] = simd.load(&node.planes[1][axis]);
            }
            let lone = is_lone(mask);
            let (mut lanes, enter) = intervals.boxes(simd, mask, planes);
            let enter = simd.store(enter);
            let bottom = depth;
            while lanes != NO_LANES {
                let lane = first_lane(lanes);
                lanes = without_first(lanes);
                let bounds = box_in(&node.planes, lane);
                let mut met = if lone { mask } else { intervals.beams(simd, bounds) & mask };
                let mut doubtful = met & loose;
                while doubtful != NO_LANES {
                    let index = doubtful.trailing_zeros() as usize;
                    let beam: Mask = 1 << index;
                    doubtful &= !beam;
                    if beams[index].enters(simd, &bounds) {
                        loose &= !beam;
                    } else {
                        met &= !beam;
                    }
                }
                if met == NO_LANES {
                    continue;
                }
                let entry = (u64::from(enter.0[lane].to_bits()) << 32 | u64::from(node.children[lane].0), met);
                let mut slot = depth;
                if NEAREST {
                    // The nearest is popped first.
                    while slot > bottom && stack[slot - 1].0 < entry.0 {
                        stack[slot] = stack[slot - 1];
                        slot -= 1;
                    }
                }
                stack[slot] = entry;
                depth += 1;
            }
        }
        loop {
            let Some(top) = depth.checked_sub(1) else { return };
            depth = top;
            let (entry, met) = stack[top];
            mask = met & alive;
            let near = !NEAREST || f32::from_bits((entry >> 32) as u32) <= intervals.all.limit;
            if mask != NO_LANES && near {
                current = Child(entry as u32);
                break;
            }
        }
    }
}

/// Tests the triangles of a block against the beams of a mask.
#[inline(always)]
fn leaf<S: Simd, const NEAREST: bool>(
    simd: S,
    (bvh, packets): (&Bvh, &[Packet]),
    block: &Block,
    (beams, intervals, alive, loose): (&mut [Beam], &mut Intervals, &mut Mask, &mut Mask),
    mask: Mask,
    accept: &mut impl FnMut(usize, &Hit) -> bool,
) {
    let bounds = block.bounds(simd);
    let lone = is_lone(mask);
    let (mut lanes, _) = intervals.boxes(simd, mask, bounds);
    // Unused lanes are not numbers, which restrict nothing.
    lanes &= simd.at_most(bounds[0][0], bounds[0][0]);
    if lanes == NO_LANES {
        return;
    }
    let mut stored = [[F8([0.0; LANES]); 3]; 2];
    for axis in 0..3 {
        stored[0][axis] = simd.store(bounds[0][axis]);
        stored[1][axis] = simd.store(bounds[1][axis]);
    }
    let mut changed = false;
    while lanes != NO_LANES {
        let lane = first_lane(lanes) & (LANES - 1);
        lanes = without_first(lanes);
        let mut met = if lone { mask } else { intervals.beams(simd, box_in(&stored, lane)) & mask };
        met &= *alive;
        let mut face = None;
        while met != NO_LANES {
            let index = met.trailing_zeros() as usize;
            met &= met - 1;
            let beam = &mut beams[index];
            if NEAREST {
                let (met, nearer) = beam.approach(simd, (block, lane), (packets, &bvh.bounds), accept);
                *loose |= Mask::from(!met) << index;
                if nearer {
                    intervals.beams.limit.0[index & (WIDE - 1)] = beam.range(simd, &beam.limit).1;
                    changed = true;
                }
            } else {
                let met = beam.stop(simd, (block, lane, &mut face), (packets, &bvh.bounds), accept);
                *loose |= Mask::from(!met) << index;
                if beam.open == NO_LANES {
                    *alive &= !(1 << index);
                }
            }
        }
    }
    if NEAREST && changed {
        intervals.all.limit = intervals.beams.limit.0.iter().fold(f32::NEG_INFINITY, |most, limit| most.max(*limit));
    }
}
