//! The report's device code and the OptiX functions it calls, for thesis fidelity: the same meaning, with the report's
//! fixed distances.

use super::coverage::Coverage;
use super::interpolate::interpolate;
use super::pass::Pass;
use crate::trace::{Hit, Purpose, Ray, Tracer};
use glam::{Vec3, Vec4};

/// Hits nearer than this are skipped.
pub const EPSILON: f32 = 1e-4;
/// The same limit for the refracted ray of a pixel.
pub const REFRACTED_EPSILON: f32 = 1e-3;
/// Factor of the colour of a secondary glass bounce.
pub const BOUNCE: f32 = 0.99;

/// Whether a G-buffer colour is the mask of a glass pixel.
pub fn is_glass_mask(color: [f32; 4]) -> bool {
    let [x, y, z, w] = color;
    x > 0.0 && y == 0.0 && z > 0.0 && w == 0.0
}

/// OptiX's `refract`: the sign of `dot(i, n)` decides the side; `None` at total reflection.
pub fn refract(i: Vec3, n: Vec3, index: f32) -> Option<Vec3> {
    let cos = i.dot(n);
    let (n, cos, eta) = if cos > 0.0 { (-n, -cos, index) } else { (n, cos, 1.0 / index) };
    let k = 1.0 - eta * eta * (1.0 - cos * cos);
    if k < 0.0 {
        return None;
    }
    let refracted = eta * i - (eta * cos + k.sqrt()) * n;
    Some(refracted * refracted.length_recip())
}

/// OptiX's `faceforward`: `n` if the dot product of `i` and `reference` is not negative, else `-n`.
pub fn face_forward(n: Vec3, i: Vec3, reference: Vec3) -> Vec3 {
    n * 1f32.copysign(i.dot(reference))
}

/// The report's weight of the refracted colour: `1 - K² (1 - dot(n, -d)²)`. Negative at grazing angles.
pub fn coefficient(index: f32, n: Vec3, d: Vec3) -> f32 {
    let cos = n.dot(-d);
    1.0 - index * index * (1.0 - cos * cos)
}

/// Point where a ray hits a triangle: `ray.origin + t_hit * ray.direction`.
pub fn position(ray: &Ray, hit: &Hit) -> Vec3 {
    ray.origin + hit.t * ray.direction
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The first hit farther than `t_min`. A ray with a NaN or an infinity hits nothing.
    pub(super) fn thesis_closest(&self, origin: Vec3, direction: Vec3, t_min: f32) -> (Ray, Option<Hit>) {
        let ray = Ray { origin, direction, t_min, t_max: f32::INFINITY };
        let traceable = origin.is_finite() && direction.is_finite();
        (ray, if traceable { self.tracer.closest(&ray, |_| true) } else { None })
    }

    /// The geometric normal, by winding, and the interpolated shading normal.
    pub(super) fn thesis_normals(&self, hit: &Hit) -> (Vec3, Vec3) {
        let geometry = &self.job.scene.geometry;
        let [a, b, c] = geometry.corners(hit.triangle);
        let shading: Vec3 = interpolate(geometry, &geometry.normals, hit);
        ((b - a).cross(c - a).normalize_or_zero(), shading.normalize_or_zero())
    }

    /// Whether the ray from a position to the light has no hit for which `stops` is true. Also true for a position that is not finite.
    pub(super) fn thesis_sees_light(&self, position: Vec3, stops: impl FnMut(&Hit) -> bool) -> bool {
        self.announce_visibility(Purpose::Shadow, 1.0);
        let ray = Ray { origin: position, direction: self.to_light, t_min: EPSILON, t_max: f32::INFINITY };
        !position.is_finite() || !self.tracer.occluded(&ray, stops)
    }
}

/// Position and unit viewing direction of a pixel.
pub fn view(position: Vec4, eye: Vec3) -> (Vec3, Vec3) {
    let position = position.truncate();
    let direction = position - eye;
    (position, direction * direction.length_recip())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(degrees: f32) -> (Vec3, Vec3) {
        let (sin, cos) = degrees.to_radians().sin_cos();
        (Vec3::Z, Vec3::new(sin, 0.0, -cos))
    }

    #[test]
    fn the_coefficient_has_the_reports_values() {
        let table = [
            (0.0, 1.0),
            (15.0, 0.919),
            (30.0, 0.698),
            (45.0, 0.395),
            (60.0, 0.093),
            (65.0, 0.006),
            (75.0, -0.129),
            (85.0, -0.201),
        ];
        for (degrees, expected) in table {
            let (n, d) = at(degrees);
            assert!((coefficient(1.1, n, d) - expected).abs() < 6e-4, "{degrees}");
        }
        let (n, d) = at(65.37);
        assert!(coefficient(1.1, n, d) > 0.0);
        let (n, d) = at(65.39);
        assert!(coefficient(1.1, n, d) < 0.0);
    }

    #[test]
    fn refraction_takes_its_side_from_the_normal() {
        let (n, d) = at(40.0);
        let entering = refract(d, n, 1.1).expect("no total reflection");
        assert!((entering.x * 1.1 - d.x).abs() < 1e-6 && entering.z < 0.0);
        let leaving = refract(d, -n, 1.1).expect("below the critical angle");
        assert!((leaving.x - d.x * 1.1).abs() < 1e-6 && leaving.z < 0.0);
        assert_eq!(refract(at(66.0).1, -n, 1.1), None);
    }

    #[test]
    fn faces_turn_by_the_reference() {
        assert_eq!(face_forward(Vec3::X, Vec3::Y, Vec3::Y), Vec3::X);
        assert_eq!(face_forward(Vec3::X, Vec3::Y, -Vec3::Y), -Vec3::X);
    }

    #[test]
    fn the_glass_mask_wants_two_positive_and_two_zero_channels() {
        assert!(is_glass_mask([1.0, 0.0, 1.0, 0.0]));
        assert!(is_glass_mask([0.2, -0.0, 0.1, 0.0]));
        for other in [[1.0, 0.0, 1.0, 1.0], [1.0, 0.1, 1.0, 0.0], [0.0; 4], [0.0, 0.0, 1.0, 0.0]] {
            assert!(!is_glass_mask(other));
        }
    }
}
