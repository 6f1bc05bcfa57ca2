//! Decides which rays are blocked where their origins are known only within an error bound.

use super::estimate::{Decided, Estimates};
use super::list::MOST;
use super::projection::Projection;
use super::tile::{LEVELS, Tile, Undecided};
use crate::trace::packet::Octants;
use crate::trace::ray::{PACKET, Packet, TOGETHER};
use crate::trace::simd::{Mask, NO_LANES, Simd, load_axes};
use crate::trace::tree::{Child, WideTree};

/// See [`Tracer::decide`](crate::trace::Tracer::decide).
#[inline(always)]
pub(crate) fn decide<S: Simd>(simd: S, tree: &WideTree, estimates: &Estimates, decided: &mut Decided) {
    decided.clear();
    let Estimates { origin, triangle, valid, center, error, direction } = estimates;
    let mut model = Packet::new(0.0, f32::INFINITY);
    model.set(0, *center, *direction);
    let octants = Octants::of(&model);
    if tree.root == Child::NONE || octants.valid() == NO_LANES || !error.is_finite() {
        return;
    }
    let valid = valid.map(Mask::from);
    let mut projection = Projection::new(octants.get(0), center.to_array(), direction.to_array()).blurred(*error);
    let Decided { stopped, open, list, seen } = decided;
    for (index, valid) in valid.iter().enumerate() {
        seen[index] = projection.rays(simd, load_axes(simd, &origin[index]), *valid);
    }
    if !projection.settle(&tree.bounds, seen) {
        return;
    }
    let mut doubts = Doubts { triangle, open: valid };
    let tile = Tile { tree, valid: &valid, projection: &projection, seen, hits_are_certain: true };
    tile.answer(simd, 0..TOGETHER, list, stopped, &mut doubts);
    for index in 0..TOGETHER {
        open[index] = doubts.open[index] as u16 & !stopped[index];
    }
}

/// Keeps track of undecided rays, which are traced later.
struct Doubts<'a> {
    /// Id of the triangle that each ray leaves.
    triangle: &'a [[u32; PACKET]; TOGETHER],
    /// Rays that no test has left undecided. Those of them that are not blocked are open.
    open: [Mask; TOGETHER],
}

impl Undecided for Doubts<'_> {
    // Tracing the undecided rays costs more here, since their origins must be computed first, so longer lists are worth
    // it.
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
