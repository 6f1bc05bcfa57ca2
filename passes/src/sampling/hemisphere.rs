//! Directions of a hemisphere from points of the unit square.

use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_PI_4;

/// Three perpendicular unit vectors, the third one given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Basis {
    /// First tangent.
    pub tangent: Vec3,
    /// Second tangent.
    pub bitangent: Vec3,
    /// The given unit vector.
    pub normal: Vec3,
}

impl Basis {
    /// A right-handed basis around a unit vector, without a singular direction.
    ///
    /// Duff, Burgess, Christensen, Hery, Kensler, Liani and Villemin 2017, "Building an Orthonormal Basis, Revisited",
    /// JCGT 6(1), listing 3.
    #[must_use]
    pub fn around(normal: Vec3) -> Self {
        let Vec3 { x, y, z } = normal;
        let sign = 1f32.copysign(z);
        let a = -1.0 / (sign + z);
        let b = x * y * a;
        Self {
            tangent: Vec3::new(1.0 + sign * x * x * a, sign * b, -sign * x),
            bitangent: Vec3::new(b, sign + y * y * a, -y),
            normal,
        }
    }

    /// The world-space vector with the coordinates `v` in this basis.
    #[must_use]
    #[inline(always)]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.tangent * v.x + self.bitangent * v.y + self.normal * v.z
    }
}

/// Maps the unit square to the unit disk. It preserves areas, and nearly preserves neighbourhoods: concentric squares become concentric
/// circles (Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square", JGT 2(3)).
#[must_use]
#[inline(always)]
pub fn concentric_disk(point: Vec2) -> Vec2 {
    let Vec2 { x, y } = 2.0 * point - Vec2::ONE;
    // Selections instead of branches: the outcome is random, and loops over many points are vectorised.
    let upright = x.abs() > y.abs();
    let (radius, other) = if upright { (x, y) } else { (y, x) };
    let (sin, cos) = sin_cos_eighth(FRAC_PI_4 * (other / radius));
    let (along, across) = (radius * cos, radius * sin);
    let disk = if upright { Vec2::new(along, across) } else { Vec2::new(across, along) };
    if radius == 0.0 { Vec2::ZERO } else { disk }
}

/// A cosine-distributed direction around z: a point of the disk, projected up to the hemisphere (Malley's method).
#[must_use]
#[inline(always)]
pub fn cosine(point: Vec2) -> Vec3 {
    let disk = concentric_disk(point);
    disk.extend((1.0 - disk.length_squared()).max(0.0).sqrt())
}

/// The direction, mirrored at the plane of a unit normal if it points away from the normal.
#[must_use]
#[inline(always)]
pub fn mirrored(direction: Vec3, normal: Vec3) -> Vec3 {
    let below = direction.dot(normal).min(0.0);
    direction - 2.0 * below * normal
}

/// Sine and cosine for angles up to π/4, by the Cephes library's polynomials for single precision (error below 1e-7).
///
/// The standard library's results differ in the last bit from platform to platform.
#[inline(always)]
fn sin_cos_eighth(angle: f32) -> (f32, f32) {
    let square = angle * angle;
    let sin = ((-1.951_529_6e-4 * square + 8.332_161e-3) * square - 1.666_665_5e-1) * square * angle + angle;
    let cos = ((2.443_315_7e-5 * square - 1.388_731_6e-3) * square + 4.166_664_6e-2) * square * square;
    (sin, cos - 0.5 * square + 1.0)
}
