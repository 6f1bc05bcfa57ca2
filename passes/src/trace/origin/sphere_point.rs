//! Where secondary rays start on exact spheres.

use super::surface_point::SurfacePoint;
use crate::trace::ray::Ray;
use crate::trace::rounding::{OFFSET_UNITS, SPHERE_OFFSET, UNIT_ROUNDOFF};
use curitiba_pipeline::scene::Sphere;
use glam::{DVec3, Vec3};

impl SurfacePoint {
    /// The point of a sphere nearest to a computed or stored position, which lies near the sphere but not exactly on it. Its normal points
    /// outwards.
    #[must_use]
    pub fn on_sphere(sphere: &Sphere, position: Vec3) -> Self {
        Self::towards(sphere, position.as_dvec3() - sphere.center.as_dvec3())
    }

    /// The point at which a ray meets a sphere at about the distance `t`. It is computed from the ray's line in `f64`, so it does not
    /// inherit the error of `t`; `t` only selects the nearer or the farther of the two intersections.
    #[must_use]
    pub fn on_sphere_by(sphere: &Sphere, ray: &Ray, t: f32) -> Self {
        let from = ray.origin.as_dvec3() - sphere.center.as_dvec3();
        let direction = ray.direction.as_dvec3().normalize_or_zero();
        let b = -from.dot(direction);
        let nearest = from + b * direction;
        let radius = f64::from(sphere.radius);
        let half = (radius * radius - nearest.length_squared()).max(0.0).sqrt();
        Self::towards(sphere, nearest + direction * if f64::from(t) < b { -half } else { half })
    }

    /// The point of the sphere in a direction from its centre.
    fn towards(sphere: &Sphere, direction: DVec3) -> Self {
        let normal = direction.normalize_or(DVec3::Y);
        let (center, radius) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
        let reach = sphere.center.abs().max_element() + sphere.radius;
        let error = UNIT_ROUNDOFF * reach * (SPHERE_OFFSET / OFFSET_UNITS);
        Self::inside((center + normal * radius).as_vec3(), normal.as_vec3(), error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_lie_on_the_sphere_and_on_the_ray() {
        let mut state = 11_u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        };
        for scale in [1e-3, 1.0, 1e3] {
            for _ in 0..5000 {
                let mut vector = || Vec3::new(random(), random(), random()) * scale;
                let sphere = Sphere { center: vector(), radius: 0.3 * scale, material: 0 };
                let (origin, target) = (vector() * 4.0, sphere.center + vector() * 0.1);
                let direction = (target - origin).normalize();
                let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
                let b = (sphere.center - origin).dot(direction);
                for t in [b - 0.1 * scale, b + 0.1 * scale] {
                    let point = SurfacePoint::on_sphere_by(&sphere, &ray, t);
                    let (at, center) = (point.position.as_dvec3(), sphere.center.as_dvec3());
                    let reach = f64::from(sphere.center.abs().max_element() + sphere.radius);
                    assert!((at.distance(center) - f64::from(sphere.radius)).abs() <= 1.8 * reach * 2.0_f64.powi(-24));
                    let aside = (at - origin.as_dvec3()).cross(direction.as_dvec3().normalize()).length();
                    assert!(aside < 4e-7 * f64::from(scale), "{point:?} {aside}");
                    assert_eq!((point.position - origin).dot(direction) > b, t > b);
                    assert!(point.normal.distance((at - center).normalize().as_vec3()) < 2e-6);
                    assert_eq!(
                        SurfacePoint::on_sphere(&sphere, point.position + point.normal * 0.01 * scale).error,
                        point.error
                    );
                }
            }
        }
    }
}
