//! Computes the directions of a whole point set at once, compiled for the instruction set of the processor.

use super::hash::unit;
use super::hemisphere::{Basis, cosine, mirrored};
use super::owen_sobol::scramble_reversed;
use crate::trace::{Detected, Directions, F16, Kernel, Simd};
use glam::{Vec2, Vec3};

/// Points that are computed together; loops of this fixed length are vectorised.
const BLOCK: usize = 16;

/// Replaces `directions` by cosine-distributed ones for `points`, scrambled by `seeds`. If `above`, a unit vector, is given, directions with
/// `direction · above < 0` are mirrored at the plane of `above`. `above` is a reference: a copy would be read as a whole just after its parts were
/// written, which stalls some processors.
///
/// Never inlined: programs are generic, and each would contain a copy for processors without AVX2.
#[inline(never)]
pub(super) fn fill(
    points: &[[u32; 2]],
    seeds: [u32; 2],
    basis: &Basis,
    above: Option<&Vec3>,
    directions: &mut Directions,
) {
    Detected::cached().run(Fill { points, seeds, basis, above, directions });
}

struct Fill<'a> {
    points: &'a [[u32; 2]],
    seeds: [u32; 2],
    basis: &'a Basis,
    above: Option<&'a Vec3>,
    directions: &'a mut Directions,
}

impl Kernel<()> for Fill<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { points, seeds, basis, above, directions } = self;
        let (blocks, rest) = points.as_chunks::<BLOCK>();
        let vectors = directions.begin(points.len());
        for (points, vector) in blocks.iter().zip(&mut *vectors) {
            block(points, seeds, basis, above, vector);
        }
        if let Some(vector) = vectors.get_mut(blocks.len()) {
            let mut last = [[0; 2]; BLOCK];
            last[..rest.len()].copy_from_slice(rest);
            block(&last, seeds, basis, above, vector);
        }
        directions.end();
    }
}

/// Computes one block by axis, stage by stage. Every number is computed as for a single point.
#[allow(clippy::needless_range_loop, reason = "a lane indexes several arrays side by side")]
#[inline(always)]
fn block(points: &[[u32; 2]; BLOCK], seeds: [u32; 2], basis: &Basis, above: Option<&Vec3>, vector: &mut [F16; 3]) {
    let mut bits = [[0; BLOCK]; 2];
    for index in 0..BLOCK {
        bits[0][index] = scramble_reversed(points[index][0], seeds[0]);
        bits[1][index] = scramble_reversed(points[index][1], seeds[1]);
    }
    let mut axes = [[0.0; BLOCK]; 3];
    for index in 0..BLOCK {
        let direction = basis.to_world(cosine(Vec2::new(unit(bits[0][index]), unit(bits[1][index]))));
        [axes[0][index], axes[1][index], axes[2][index]] = direction.to_array();
    }
    if let Some(above) = above {
        for index in 0..BLOCK {
            let direction = mirrored(Vec3::new(axes[0][index], axes[1][index], axes[2][index]), *above);
            [axes[0][index], axes[1][index], axes[2][index]] = direction.to_array();
        }
    }
    *vector = axes.map(F16);
}
