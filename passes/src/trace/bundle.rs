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

use super::beam::{Beam, Class, Classes, FAR};
use super::block::Block;
use super::bvh::{Bvh, occluded};
use super::dispatch::Work;
use super::lanes::{F8, F16, LANES, Mask, NO_LANES, Simd, WIDE, first_lane, without_first};
use super::node::Child;
use super::packet::{Packet, PacketHits};
use super::query::Query;
use super::stack::STACK;
use super::{Hit, PACKET, Tracer};

/// Beams that go down the tree together.
const BEAMS: usize = WIDE;
/// Packets sorted together.
const PACKETS: usize = 16;
/// Rays of a class and a packet below which each is traced by itself.
const FEW: u32 = 3;

/// See [`Tracer::closest_packets`].
pub(super) struct ClosestPackets<'a, A> {
    pub(super) bvh: &'a Bvh,
    pub(super) packets: &'a [Packet],
    pub(super) hits: &'a mut [PacketHits],
    pub(super) accept: A,
}

/// See [`Tracer::occluded_packets`].
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
        if self.bvh.root == Child::NONE {
            return;
        }
        let mut beams = [Beam::EMPTY; BEAMS];
        let hits = self.hits;
        let sorted = Sorted { bvh: self.bvh, packets: self.packets };
        let accept = &mut self.accept;
        sorted.each(simd, &mut beams, |found| match found {
            Part::Beams(beams) => {
                walk::<S, true>(simd, self.bvh, self.packets, beams, accept);
                for beam in beams {
                    beam.report(&mut hits[beam.packet]);
                }
            }
            Part::Ray(packet, lane) => {
                let hit = self.bvh.closest(&self.packets[packet].ray(lane), |hit| accept(packet * PACKET + lane, hit));
                if let Some(hit) = hit {
                    hits[packet].set(lane, &hit);
                }
            }
        });
    }
}

impl<A: FnMut(usize, &Hit) -> bool> Work<()> for OccludedPackets<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        self.blocked.fill(0);
        if self.bvh.root == Child::NONE {
            return;
        }
        let mut beams = [Beam::EMPTY; BEAMS];
        let blocked = self.blocked;
        let sorted = Sorted { bvh: self.bvh, packets: self.packets };
        let accept = &mut self.accept;
        sorted.each(simd, &mut beams, |found| match found {
            Part::Beams(beams) => {
                let before: [Mask; BEAMS] = std::array::from_fn(|beam| beams.get(beam).map_or(NO_LANES, |b| b.open));
                walk::<S, false>(simd, self.bvh, self.packets, beams, accept);
                for (beam, before) in beams.iter().zip(before) {
                    blocked[beam.packet] |= (before & !beam.open) as u16;
                }
            }
            Part::Ray(packet, lane) => {
                let Some(query) = Query::new(&self.packets[packet].ray(lane), &self.bvh.bounds) else { return };
                let mut ask = |hit: &Hit| accept(packet * PACKET + lane, hit);
                if occluded(simd, self.bvh, self.bvh.root, &query, &mut ask) {
                    blocked[packet] |= 1 << lane;
                }
            }
        });
    }
}

/// What rays were sorted into.
enum Part<'b> {
    /// Beams of one octant.
    Beams(&'b mut [Beam]),
    /// A lone ray: its packet and its lane.
    Ray(usize, usize),
}

/// Packets, sorted into beams.
struct Sorted<'a> {
    bvh: &'a Bvh,
    packets: &'a [Packet],
}

impl Sorted<'_> {
    /// Calls `each` with all rays that can meet anything.
    #[inline(always)]
    fn each<S: Simd>(&self, simd: S, beams: &mut [Beam; BEAMS], mut each: impl FnMut(Part<'_>)) {
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
                                each(Part::Ray(packet, lanes.trailing_zeros() as usize));
                                lanes &= lanes - 1;
                            }
                            continue;
                        }
                        beams[len].prepare(simd, &packets[index], (packet, lanes, class), &self.bvh.bounds);
                        len += 1;
                        if len == BEAMS {
                            each(Part::Beams(beams));
                            len = 0;
                        }
                    }
                }
                if len > 0 {
                    each(Part::Beams(&mut beams[..len]));
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
    /// Least and greatest reciprocals of directions.
    inverse: [[V; 3]; 2],
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
        Self { beams: each, all, backward }
    }

    /// The lanes of boxes that any ray may be in, and below which distance it does not enter them.
    #[inline(always)]
    fn boxes<S: Simd>(&self, simd: S, extremes: &Extremes<f32>, planes: [[S::Vector; 3]; 2]) -> (Mask, S::Vector) {
        let mut enter = simd.splat(extremes.t_min);
        let mut leave = simd.splat(extremes.limit);
        for axis in 0..3 {
            let [near, far] = [self.backward[axis], 1 - self.backward[axis]].map(|side| planes[side & 1][axis]);
            let near = simd.sub(near, simd.splat(extremes.near_origin[axis]));
            let far = simd.sub(far, simd.splat(extremes.far_origin[axis]));
            let [low, high] = [0, 1].map(|end| simd.splat(extremes.inverse[end][axis]));
            enter = simd.max_or(simd.min_or(simd.mul(near, low), simd.mul(near, high)), enter);
            let stretched = simd.splat(FAR);
            let (low, high) = (simd.mul(low, stretched), simd.mul(high, stretched));
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
            let [near, far] = [self.backward[axis], 1 - self.backward[axis]].map(|side| planes[side & 1][axis]);
            let near = simd.wide_sub(simd.wide_splat(near), simd.wide_load(&extremes.near_origin[axis]));
            let far = simd.wide_sub(simd.wide_splat(far), simd.wide_load(&extremes.far_origin[axis]));
            let [low, high] = [0, 1].map(|end| simd.wide_load(&extremes.inverse[end][axis]));
            let least = simd.wide_min_or(simd.wide_mul(near, low), simd.wide_mul(near, high));
            enter = simd.wide_max_or(least, enter);
            let stretched = simd.wide_splat(FAR);
            let (low, high) = (simd.wide_mul(low, stretched), simd.wide_mul(high, stretched));
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
        let Extremes { near_origin, far_origin, inverse, t_min, limit } = &self.beams;
        Extremes {
            near_origin: lanes(near_origin),
            far_origin: lanes(far_origin),
            inverse: [lanes(&inverse[0]), lanes(&inverse[1])],
            t_min: lane(t_min),
            limit: lane(limit),
        }
    }
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
    let mut stack = [(0_u64, NO_LANES); STACK];
    let mut depth = 0;
    let (mut current, mut mask) = (bvh.root, alive);
    loop {
        if current.is_block() {
            leaf::<S, NEAREST>(
                simd,
                (bvh, packets),
                &bvh.blocks[current.index()],
                (beams, &mut intervals, &mut alive),
                mask,
                accept,
            );
            if alive == NO_LANES {
                return;
            }
        } else {
            let node = &bvh.nodes[current.index()];
            let planes = node.planes.each_ref().map(|side| side.each_ref().map(|plane| simd.load(plane)));
            let (mut lanes, enter) = if mask & (mask - 1) == 0 {
                let own = intervals.of_beam(mask.trailing_zeros() as usize);
                intervals.boxes(simd, &own, planes)
            } else {
                intervals.boxes(simd, &intervals.all, planes)
            };
            let enter = simd.store(enter);
            let bottom = depth;
            while lanes != NO_LANES {
                let lane = first_lane(lanes);
                lanes = without_first(lanes);
                let met = if mask & (mask - 1) == 0 {
                    mask
                } else {
                    let bounds = [0, 1].map(|side| [0, 1, 2].map(|axis| node.planes[side][axis].0[lane]));
                    intervals.beams(simd, bounds) & mask
                };
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
    (beams, intervals, alive): (&mut [Beam], &mut Intervals, &mut Mask),
    mask: Mask,
    accept: &mut impl FnMut(usize, &Hit) -> bool,
) {
    let bounds = block.bounds(simd);
    let lone = mask & (mask - 1) == 0;
    let (mut lanes, _) = if lone {
        let own = intervals.of_beam(mask.trailing_zeros() as usize);
        intervals.boxes(simd, &own, bounds)
    } else {
        intervals.boxes(simd, &intervals.all, bounds)
    };
    // Unused lanes are not numbers, which restrict nothing.
    lanes &= simd.at_most(bounds[0][0], bounds[0][0]);
    if lanes == NO_LANES {
        return;
    }
    let stored: [[F8; 3]; 2] = bounds.map(|side| side.map(|values| simd.store(values)));
    let mut changed = false;
    while lanes != NO_LANES {
        let lane = first_lane(lanes) & (LANES - 1);
        lanes = without_first(lanes);
        let mut met = if lone {
            mask
        } else {
            intervals.beams(simd, [0, 1].map(|side| [0, 1, 2].map(|axis| stored[side][axis].0[lane]))) & mask
        };
        met &= *alive;
        while met != NO_LANES {
            let index = met.trailing_zeros() as usize;
            met &= met - 1;
            let beam = &mut beams[index];
            if NEAREST {
                if beam.approach(simd, (block, lane), (packets, &bvh.bounds), accept) {
                    intervals.beams.limit.0[index & (WIDE - 1)] = beam.range(simd, &beam.limit).1;
                    changed = true;
                }
            } else {
                beam.stop(simd, (block, lane), (packets, &bvh.bounds), accept);
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
