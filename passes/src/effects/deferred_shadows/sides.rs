//! On which side of a triangle its shading normals lie, eight triangles at a time.

use super::light::CLEARLY;
use crate::trace::{F16, LANES, Mask, Simd, half_of};

/// Mask of all eight lanes.
pub(super) const ALL: Mask = (1 << LANES) - 1;

/// As [`Vec3::dot`].
#[inline(always)]
pub(super) fn dot<S: Simd>(simd: S, [ax, ay, az]: [S::Vector; 3], [bx, by, bz]: [S::Vector; 3]) -> S::Vector {
    simd.add(simd.add(simd.mul(ax, bx), simd.mul(ay, by)), simd.mul(az, bz))
}

/// The lanes above 0, and the lanes below 0.
#[inline(always)]
pub(super) fn signs<S: Simd>(simd: S, a: S::Vector) -> (Mask, Mask) {
    let zero = simd.splat(0.0);
    let (not_above, not_below) = (simd.at_most(a, zero), simd.at_most(zero, a));
    (not_below & !not_above, not_above & !not_below)
}

/// For one half of sixteen triangles: the lanes where the normals at all three corners are clearly on the side of the
/// triangle's normal, and the lanes where all are clearly on the other side.
#[inline(always)]
pub(super) fn sides_of_corners<S: Simd>(
    simd: S,
    normal: [S::Vector; 3],
    [a, b, c]: &[[F16; 3]; 3],
    half: usize,
) -> (Mask, Mask) {
    let (above_a, below_a) = sides(simd, normal, half_of(simd, a, half));
    let (above_b, below_b) = sides(simd, normal, half_of(simd, b, half));
    let (above_c, below_c) = sides(simd, normal, half_of(simd, c, half));
    (above_a & above_b & above_c, below_a & below_b & below_c)
}

/// The lanes where the normal at a corner is clearly on the side of the triangle's normal, and those where it is
/// clearly on the other side.
#[inline(always)]
fn sides<S: Simd>(simd: S, normal: [S::Vector; 3], corner: [S::Vector; 3]) -> (Mask, Mask) {
    let cosine = dot(simd, normal, corner);
    let least = simd.mul(simd.splat(CLEARLY), simd.max_or(dot(simd, corner, corner), simd.splat(1.0)));
    let opposite = simd.sub(simd.splat(0.0), cosine);
    let above = simd.at_most(least, cosine) & !simd.at_most(cosine, least);
    (above, simd.at_most(least, opposite) & !simd.at_most(opposite, least))
}
