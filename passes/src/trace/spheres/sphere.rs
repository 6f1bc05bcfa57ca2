//! Intersection of a ray and a sphere.

use crate::trace::ray::Ray;
use curitiba_pipeline::scene::Sphere;

/// The distances at which a ray's line meets a sphere, the lower first; `None` if it misses.
///
/// Haines, Günther and Akenine-Möller, "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019, chapter 7. The
/// discriminant is r² - |f - (f·d) d|², where f leads from the centre to the origin. The usual (f·d)² - f² + r² has terms that cancel where
/// the sphere is far away. One root is q = b ± √ with b = -f·d, with the sign for which nothing cancels; the other is (f² - r²) / q.
#[inline(always)]
pub(crate) fn roots(ray: &Ray, sphere: &Sphere) -> Option<[f32; 2]> {
    let (from, direction) = (ray.origin - sphere.center, ray.direction);
    let b = -from.dot(direction);
    let nearest = from + b * direction;
    let discriminant = sphere.radius * sphere.radius - nearest.dot(nearest);
    // `None` for a negative discriminant and for NaN.
    let half = (discriminant >= 0.0).then(|| discriminant.sqrt())?;
    let distance = from.length();
    let product = (distance - sphere.radius) * (distance + sphere.radius);
    let q = if b < 0.0 { b - half } else { b + half };
    // q is 0 only if the origin is on the sphere and the direction tangent to it: then both roots are 0.
    let other = if q == 0.0 { 0.0 } else { product / q };
    Some(if b < 0.0 { [q, other] } else { [other, q] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

    /// Random numbers from -1 to 1.
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    /// A random ray that starts about `distance` from the sphere's centre and whose line passes the centre at `share` radii.
    fn aimed(sphere: &Sphere, distance: f64, share: f64, mut random: impl FnMut() -> f64) -> Ray {
        let mut unit = || loop {
            let v = DVec3::new(random(), random(), random());
            if (0.01..1.0).contains(&v.length()) {
                return v.normalize();
            }
        };
        let (direction, aside) = (unit(), unit());
        let aside = (aside - aside.dot(direction) * direction).normalize();
        let origin = sphere.center.as_dvec3() + aside * share * f64::from(sphere.radius) - direction * distance;
        Ray { origin: origin.as_vec3(), direction: direction.as_vec3(), t_min: 0.0, t_max: f32::INFINITY }
    }

    /// How far the line of a ray passes from the centre, in radii, and the two roots: in `f64`, where cancellation leaves at least eight
    /// digits.
    fn exact(ray: &Ray, sphere: &Sphere) -> (f64, [f64; 2]) {
        let direction = ray.direction.as_dvec3().normalize();
        let from = ray.origin.as_dvec3() - sphere.center.as_dvec3();
        let b = -from.dot(direction);
        let nearest = (from + b * direction).length();
        let radius = f64::from(sphere.radius);
        let half = (radius * radius - nearest * nearest).max(0.0).sqrt();
        (nearest / radius, [b - half, b + half])
    }

    #[test]
    fn no_sphere_is_missed_or_met_wrongly_from_ten_thousand_radii_away() {
        let mut random = numbers();
        for (radius, distance) in [(1.0, 10.0), (1.0, 1e3), (1.0, 1e4), (1e-4, 1.0), (1e-4, 1e-2), (100.0, 1e6)] {
            let (mut worst, mut naive_wrong) = (0.0_f64, 0);
            for index in 0..40_000 {
                let center = Vec3::new(random() as f32, random() as f32, random() as f32) * (distance * 0.1) as f32;
                let sphere = Sphere { center, radius: radius as f32, material: 0 };
                let share = if index % 2 == 0 { 0.999 * random().abs() } else { 1.001 + 0.1 * random().abs() };
                let ray = aimed(&sphere, distance, share, &mut random);
                let (share, roots_64) = exact(&ray, &sphere);
                let found = roots(&ray, &sphere);
                if share <= 0.999 {
                    let found = found.unwrap_or_else(|| panic!("r {radius} D {distance}: missed at {share}"));
                    for (found, exact) in found.iter().zip(roots_64) {
                        worst = worst.max((f64::from(*found) - exact).abs() / radius);
                    }
                } else if share >= 1.001 {
                    assert_eq!(found, None, "r {radius} D {distance}: met at {share}");
                }
                let from = ray.origin - sphere.center;
                let b = from.dot(ray.direction);
                let naive = b * b - (from.dot(from) - sphere.radius * sphere.radius) >= 0.0;
                naive_wrong += usize::from((share <= 0.999 && !naive) || (share >= 1.001 && naive));
            }
            // The rounding of the distance itself is 2^-24 of it; near the rim of a sphere it counts 1 / sin times as much.
            let allowed = 40.0 * 2.0_f64.powi(-24) * (distance / radius).max(1.0);
            assert!(worst <= allowed, "r {radius} D {distance}: {worst} radii, {allowed} allowed");
            assert!(distance / radius < 1e4 || naive_wrong > 2000, "control: the usual formula errs: {naive_wrong}");
        }
    }

    #[test]
    fn from_inside_one_root_is_ahead_and_from_on_it_one_is_where_the_ray_starts() {
        let mut random = numbers();
        let sphere = Sphere { center: Vec3::new(3.0, -2.0, 7.0), radius: 2.5, material: 0 };
        for _ in 0..20_000 {
            let ray = aimed(&sphere, 0.9 * random(), 0.4 * random().abs(), &mut random);
            let [behind, ahead] = roots(&ray, &sphere).expect("it is inside");
            let (_, exact) = exact(&ray, &sphere);
            assert!(behind < 0.0 && ahead > 0.0);
            assert!((f64::from(behind) - exact[0]).abs() < 4e-6 && (f64::from(ahead) - exact[1]).abs() < 4e-6);
        }
        let on = Ray { origin: Vec3::new(0.5, -2.0, 7.0), direction: Vec3::X, t_min: 0.0, t_max: 9.0 };
        assert_eq!(roots(&on, &sphere), Some([0.0, 5.0]));
        assert_eq!(roots(&Ray { direction: Vec3::NEG_X, ..on }, &sphere), Some([-5.0, 0.0]));
        assert_eq!(roots(&Ray { direction: Vec3::Y, ..on }, &sphere), Some([0.0, 0.0]));
        for broken in [f32::NAN, f32::INFINITY] {
            assert_eq!(roots(&Ray { origin: Vec3::splat(broken), ..on }, &sphere), None);
        }
    }
}
