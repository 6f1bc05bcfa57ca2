//! Directions from a point towards a triangle, uniform in solid angle. Near pairs need them: the variance of their form
//! factors is unbounded when sampled by area.

use glam::DVec3;
use std::f64::consts::PI;

/// A spherical triangle that directions are sampled in (Arvo, "Stratified Sampling of Spherical Triangles", 1995).
#[derive(Debug, Clone, Copy)]
pub(super) struct Spherical {
    corners: [DVec3; 3],
    /// The angle at the first corner.
    alpha: f64,
    /// The solid angle.
    pub(super) area: f64,
}

impl Spherical {
    /// The triangle as seen from `from`; `None` if its solid angle is too small to be distinguished from rounding.
    pub(super) fn new(from: DVec3, corners: [DVec3; 3]) -> Option<Self> {
        let corners = corners.map(|corner| (corner - from).normalize_or_zero());
        let [a, b, c] = corners;
        let [ab, bc, ca] = [a.cross(b), b.cross(c), c.cross(a)].map(DVec3::normalize_or_zero);
        let [alpha, beta, gamma] = [(ab, ca), (bc, ab), (ca, bc)].map(|(n, m)| n.dot(-m).clamp(-1.0, 1.0).acos());
        // The solid angle without cancellation: Van Oosterom and Strackee, 1983.
        let area = 2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        let sum = alpha + beta + gamma - PI;
        let sound = area > 1e-7 && (sum - area).abs() < 1e-6 + 1e-3 * area;
        sound.then_some(Self { corners, alpha, area })
    }

    /// Maps a point of the unit square to a direction, uniformly in solid angle.
    pub(super) fn direction(&self, u: f64, v: f64) -> DVec3 {
        let [a, b, c] = self.corners;
        let (sin, cos) = self.alpha.sin_cos();
        let (s, t) = {
            let (s, t) = (u * self.area).sin_cos();
            // Sine and cosine of (`u` times the area, minus alpha).
            (s * cos - t * sin, t * cos + s * sin)
        };
        let (k, l) = (t - cos, s + sin * a.dot(b));
        let q = ((l * t - k * s) * cos - l) / ((l * s + k * t) * sin);
        let q = q.clamp(-1.0, 1.0);
        let part = q * a + (1.0 - q * q).max(0.0).sqrt() * (c - c.dot(a) * a).normalize_or_zero();
        let z = 1.0 - v * (1.0 - part.dot(b));
        z * b + (1.0 - z * z).max(0.0).sqrt() * (part - part.dot(b) * b).normalize_or_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_octant_is_sampled_evenly() {
        let octant = Spherical::new(DVec3::ZERO, [DVec3::X * 2.0, DVec3::Y, DVec3::Z * 3.0]).expect("it is large");
        assert!((octant.area - PI / 2.0).abs() < 1e-12);
        let (mut mean, mut above, side) = (DVec3::ZERO, 0, 256);
        for i in 0..side * side {
            let at = |n: i32| (f64::from(n) + 0.5) / f64::from(side);
            let direction = octant.direction(at(i % side), at(i / side));
            assert!((direction.length() - 1.0).abs() < 1e-9 && direction.min_element() > -1e-9);
            mean += direction / f64::from(side * side);
            above += i32::from(direction.z > 0.5);
        }
        // By Archimedes, each coordinate is uniform over the octant.
        assert!((mean - DVec3::splat(0.5)).abs().max_element() < 1e-4, "{mean}");
        assert!((f64::from(above) / f64::from(side * side) - 0.5).abs() < 1e-2);
    }

    #[test]
    fn a_small_triangle_keeps_its_directions_inside() {
        let corners = [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.01, 0.0, 1.0), DVec3::new(0.003, 0.02, 1.1)];
        let small = Spherical::new(DVec3::ZERO, corners).expect("it is large enough");
        let [a, b, c] = corners;
        for i in 0..400 {
            let direction = small.direction((f64::from(i % 20) + 0.5) / 20.0, (f64::from(i / 20) + 0.5) / 20.0);
            let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|n| n.dot(direction));
            let sign = a.dot(b.cross(c)).signum();
            assert!(sides.iter().all(|side| side * sign > -1e-9), "{sides:?}");
        }
        assert!(Spherical::new(DVec3::ZERO, corners.map(|corner| corner * DVec3::new(1e-5, 1e-5, 1.0))).is_none());
    }
}
