//! The report's noise, for thesis fidelity only: the fractional part of a large multiple of a sine.
//!
//! Its flaws are kept: numbers are negative as often as positive, few distinct values remain far from the origin, and neighbours are alike
//! there.

use super::hemisphere::Basis;
use crate::trace::Directions;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// The report's `rand`, in (-1, 1): the fraction keeps the sign of the sine.
///
/// The dot product is rounded after each step, as printed (a device compiler may fuse them). The sine is taken in double
/// precision and rounded once, so that platforms agree; the factor 43758.5453 is a double in the report, too.
#[must_use]
pub fn rand(co: Vec2) -> f32 {
    let angle = co.x * 12.9898 + co.y * 78.233;
    let sine = f64::from(angle).sin() as f32;
    let product = (f64::from(sine) * 43_758.545_3) as f32;
    product.fract()
}

/// The unit-square point of stratum (`i`, `j`) of `side` x `side` at a position. It may lie outside the square.
#[must_use]
pub fn stratum(position: Vec3, i: u32, j: u32, side: u32) -> Vec2 {
    let (a, b) = ((i + 1) as f32, (j + 1) as f32);
    let rand1 = rand(Vec2::new(position.x * a, position.y * b));
    let rand2 = rand(Vec2::new(position.x * b, position.z * a));
    let rand3 = rand(Vec2::new(position.y * a, position.z * b));
    let rand4 = rand(Vec2::new(rand1 * b, rand2 * a));
    let rand5 = rand(Vec2::new(rand3 * a, rand4 * b));
    Vec2::new(i as f32 + rand5, j as f32 + rand4) * (1.0 / side as f32)
}

/// OptiX's `cosine_sample_hemisphere`: the polar map. NaN where `point.x` is negative, as in OptiX.
#[must_use]
pub fn polar_cosine(point: Vec2) -> Vec3 {
    let radius = point.x.sqrt();
    let (sin, cos) = (2.0 * PI * point.y).sin_cos();
    let (x, y) = (radius * cos, radius * sin);
    Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// OptiX's `Onb`. NaN for a zero normal, as in OptiX.
#[must_use]
pub fn optix_basis(normal: Vec3) -> Basis {
    let bitangent = if normal.x.abs() > normal.z.abs() {
        Vec3::new(-normal.y, normal.x, 0.0)
    } else {
        Vec3::new(0.0, -normal.z, normal.y)
    };
    let bitangent = bitangent * bitangent.length_recip();
    Basis { tangent: bitangent.cross(normal), bitangent, normal }
}

/// Replaces `directions` by the finite ones of the report's `side` x `side` occlusion directions at a position, and returns how many are
/// not finite.
///
/// Where the noise leaves the unit square, a direction is NaN. On the report's device such a ray hit nothing (every comparison of its
/// intersection test is false) and counted as open.
pub fn directions(position: Vec3, normal: Vec3, side: u32, directions: &mut Directions) -> u32 {
    directions.clear();
    let basis = optix_basis(normal);
    let mut invalid = 0;
    for i in 0..side {
        for j in 0..side {
            let direction = basis.to_world(polar_cosine(stratum(position, i, j, side)));
            if direction.is_finite() {
                directions.push(direction);
            } else {
                invalid += 1;
            }
        }
    }
    invalid
}
