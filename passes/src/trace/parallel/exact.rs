//! Rays of one direction that start near each other, such as the shadow rays of a tile to a distant light. The triangles that may block
//! them are gathered once, and most rays are decided sixteen at a time, without the watertight test.
//!
//! Projected along the direction, a ray is a point and a tile's rays lie in a small rectangle. Coordinates are sheared as in the watertight
//! test, `x - sx z` and `y - sy z`, where z is the direction's longest axis. The tree is searched for the triangles whose bounds meet the
//! rectangle. A packet's own rectangle is compared with sixteen of those triangles at a time, by their bounds and by their edges (the
//! separating axes of two convex shapes). Rays that start above a triangle that faces the light miss it. Undecided rays go to the
//! watertight test ([`PreparedPacket`]), so every ray gets the result that it would get alone.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::list::List;
use super::projection::{ProjectedRays, Projection};
use super::tile::{LEVELS, Tile, Undecided};
use crate::trace::packet::{Descent, Octant, Octants, PreparedPacket};
use crate::trace::ray::{Hit, PACKET, Packet, TOGETHER};
use crate::trace::simd::{F16, Mask, NO_LANES, Simd, first_wide_lane};
use crate::trace::tree::{Child, WideTree};

/// With fewer rays than this, a list is not worth it.
const FEW: u32 = 16;

/// Finds the blocked rays of up to [`TOGETHER`] packets, one bit a ray. Does nothing and returns false if the rays do not all have one
/// direction and interval, if there are fewer than [`FEW`] rays or no triangles, or if numbers might overflow. `accept` also receives the
/// ray's number: 16 times the index of its packet, plus its lane.
#[inline(always)]
pub(crate) fn occluded<S: Simd>(
    simd: S,
    tree: &WideTree,
    packets: &[Packet],
    blocked: &mut [u16],
    accept: &mut impl FnMut(usize, &Hit) -> bool,
) -> bool {
    if tree.root == Child::NONE {
        return false;
    }
    let Some((rays, center, direction)) = Rays::of(simd, packets) else { return false };
    let mut projection = Projection::new(rays.octant, center, direction);
    let mut seen = [ProjectedRays::NONE; TOGETHER];
    for (index, packet) in packets.iter().enumerate() {
        if rays.valid[index] != NO_LANES {
            seen[index] = projection.packet(simd, packet, rays.valid[index]);
        }
    }
    if !projection.settle(&tree.bounds, &mut seen) {
        return false;
    }
    let hits_are_certain = packets[0].t_min == 0.0 && packets[0].t_max == f32::INFINITY;
    let tile = Tile { tree, valid: &rays.valid, projection: &projection, seen: &seen, hits_are_certain };
    let mut exact = Exact { tree, rays: &rays, accept };
    let mut list = List::EMPTY;
    tile.answer(simd, 0..packets.len(), &mut list, blocked, &mut exact);
    true
}

/// Traces undecided rays exactly.
struct Exact<'a, A> {
    tree: &'a WideTree,
    rays: &'a Rays<'a>,
    accept: &'a mut A,
}

impl<A: FnMut(usize, &Hit) -> bool> Undecided for Exact<'_, A> {
    const LONGEST: [usize; LEVELS.len()] = [256, 160, 96];
    const ESTIMATED: bool = false;

    #[inline(always)]
    fn stopped_by<S: Simd>(&mut self, simd: S, rays: (usize, Mask), (leaf, lane): (usize, usize)) -> Mask {
        let mut packet = PreparedPacket::EMPTY;
        packet.prepare(simd, &self.rays.packets[rays.0], (rays.1, self.rays.octant), &self.tree.bounds);
        let mut accept = |lane: usize, hit: &Hit| (self.accept)(rays.0 * PACKET + lane, hit);
        packet.stop(simd, (&self.tree.leaves[leaf], lane), &mut accept);
        rays.1 & !packet.open
    }

    #[inline(always)]
    fn stopped<S: Simd>(&mut self, simd: S, rays: (usize, Mask)) -> Mask {
        let mut packet = PreparedPacket::EMPTY;
        packet.prepare(simd, &self.rays.packets[rays.0], (rays.1, self.rays.octant), &self.tree.bounds);
        let accept = |lane: usize, hit: &Hit| (self.accept)(rays.0 * PACKET + lane, hit);
        (Descent { tree: self.tree, accept }).stopped(simd, &mut packet)
    }
}

/// The data that the rays of some packets share.
struct Rays<'a> {
    packets: &'a [Packet],
    octant: Octant,
    /// The rays of each packet that can hit anything.
    valid: [Mask; TOGETHER],
}

impl<'a> Rays<'a> {
    /// The common data, the origin of one of the rays, and the direction; `None` if directions or intervals differ, or there are fewer than
    /// [`FEW`] rays.
    #[inline(always)]
    fn of<S: Simd>(simd: S, packets: &'a [Packet]) -> Option<(Self, [f32; 3], [f32; 3])> {
        let model = packets.iter().find(|packet| packet.active != 0)?;
        let octants = Octants::of(model);
        let valid = octants.valid() & Mask::from(model.active);
        if valid == NO_LANES {
            return None;
        }
        let lane = first_wide_lane(valid);
        let [origin, direction] = [&model.origin, &model.direction].map(|v| [v[0][lane], v[1][lane], v[2][lane]]);
        let mut rays = Self { packets, octant: octants.get(lane), valid: [NO_LANES; TOGETHER] };
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

    /// Whether components that are zero have the same sign in all rays: comparison does not distinguish -0 from 0, but the slab test does.
    #[inline(always)]
    fn zeros_have_one_sign(&self, direction: [f32; 3]) -> bool {
        (0..3).filter(|&axis| direction[axis] == 0.0).all(|axis| {
            let bits = direction[axis].to_bits();
            self.packets.iter().all(|packet| packet.lanes().all(|lane| packet.direction[axis][lane].to_bits() == bits))
        })
    }
}
