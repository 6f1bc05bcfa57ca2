//! Directions of a whole point set at once, compiled for the instruction set of the processor.

use super::hash::unit;
use super::hemisphere::{Basis, cosine};
use super::owen_sobol::scramble_reversed;
use crate::trace::{Detected, Simd, Work};
use glam::{Vec2, Vec3};

/// Points that are computed together: loops of this fixed length become vector code.
const BLOCK: usize = 16;

/// Fills `directions` with the cosine-distributed directions of the scrambled `points`; both have one length.
pub(super) fn fill(points: &[[u32; 2]], seeds: [u32; 2], basis: &Basis, directions: &mut [Vec3]) {
    Detected::cached().run(Fill { points, seeds, basis, directions });
}

struct Fill<'a> {
    points: &'a [[u32; 2]],
    seeds: [u32; 2],
    basis: &'a Basis,
    directions: &'a mut [Vec3],
}

impl Work<()> for Fill<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let (points, rest) = self.points.as_chunks::<BLOCK>();
        let (directions, rest_of_directions) = self.directions.as_chunks_mut::<BLOCK>();
        for (points, directions) in points.iter().zip(directions) {
            block(points, self.seeds, self.basis, directions);
        }
        if !rest.is_empty() {
            let (mut last, mut directions) = ([[0; 2]; BLOCK], [Vec3::ZERO; BLOCK]);
            last[..rest.len()].copy_from_slice(rest);
            block(&last, self.seeds, self.basis, &mut directions);
            rest_of_directions.copy_from_slice(&directions[..rest.len()]);
        }
    }
}

/// One block, stage by stage. Every number is computed as for a single point.
#[inline(always)]
fn block(points: &[[u32; 2]; BLOCK], seeds: [u32; 2], basis: &Basis, directions: &mut [Vec3; BLOCK]) {
    let mut bits = [[0; BLOCK]; 2];
    for index in 0..BLOCK {
        bits[0][index] = scramble_reversed(points[index][0], seeds[0]);
        bits[1][index] = scramble_reversed(points[index][1], seeds[1]);
    }
    let mut local = [[0.0; BLOCK]; 3];
    for index in 0..BLOCK {
        let direction = cosine(Vec2::new(unit(bits[0][index]), unit(bits[1][index])));
        local[0][index] = direction.x;
        local[1][index] = direction.y;
        local[2][index] = direction.z;
    }
    for (index, direction) in directions.iter_mut().enumerate() {
        *direction = basis.to_world(Vec3::new(local[0][index], local[1][index], local[2][index]));
    }
}
