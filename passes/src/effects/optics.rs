//! Smooth dielectric interfaces.

use curitiba_pipeline::glass::Dielectric;
use curitiba_pipeline::programs::Fresnel;
use glam::Vec3;

/// Number of the reflected branch of a split ray in the key of a path.
pub const REFLECTED: u32 = 0;
/// Number of the refracted branch.
pub const REFRACTED: u32 = 1;
/// Number, in the key of a path, of the first direction in which rough glass scatters.
pub const SCATTERED: u32 = 2;

/// Mirrors the direction `i` at a surface with unit normal `n`, for either sign of `n`.
#[must_use]
pub fn reflect(i: Vec3, n: Vec3) -> Vec3 {
    i - 2.0 * n * n.dot(i)
}

/// What an interface does with light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// Reflected share of the light, 0..=1; the rest is refracted.
    pub reflectance: f32,
    /// Cosine of the refracted direction with the inward normal; 0 at total reflection.
    pub cos_refracted: f32,
}

/// Fresnel's equations for unpolarised light on an interface: the mean of both polarisations ([`polarised`]). `cos` is the cosine of the angle of
/// incidence (clamped to 0..=1), and `index` the refractive index of the far side over that of the near side (above 0).
///
/// Total reflection, possible for `index < 1` only, is a reflectance of exactly 1. Evaluated in double precision: next to
/// the critical angle the square root magnifies a rounding error of the discriminant.
#[must_use]
pub fn fresnel(cos: f32, index: f32) -> Interface {
    weighted(cos, index, |[s, p]| 0.5 * (s + p))
}

/// As [`fresnel`], for light whose electric field is perpendicular to the plane of incidence ([`Fresnel::S`]) or lies in it ([`Fresnel::P`]). At
/// Brewster's angle, whose tangent is the index, nothing of the latter is reflected.
#[must_use]
pub fn polarised(cos: f32, index: f32) -> [Interface; 2] {
    [0, 1].map(|polarisation| weighted(cos, index, |shares| shares[polarisation]))
}

/// An interface whose reflectance is made of those of both polarisations.
#[inline(always)]
fn weighted(cos: f32, index: f32, weigh: impl Fn([f64; 2]) -> f64) -> Interface {
    let (cos, index) = (f64::from(cos.clamp(0.0, 1.0)), f64::from(index));
    // index² cos²(refracted), by Snell's law.
    let discriminant = index * index - 1.0 + cos * cos;
    if discriminant <= 0.0 {
        return Interface { reflectance: 1.0, cos_refracted: 0.0 };
    }
    let cos_refracted = discriminant.sqrt() / index;
    let perpendicular = (cos - index * cos_refracted) / (cos + index * cos_refracted);
    let parallel = (index * cos - cos_refracted) / (index * cos + cos_refracted);
    let reflectance = weigh([perpendicular * perpendicular, parallel * parallel]);
    Interface { reflectance: reflectance as f32, cos_refracted: cos_refracted as f32 }
}

/// Schlick's approximation of [`fresnel`] ("An Inexpensive BRDF Model for Physically-based Rendering", Computer Graphics Forum 13, 1994), in single
/// precision: `R0 + (1 - R0) (1 - cos)^5` with `R0 = ((index - 1) / (index + 1))^2`. The cosine is the one on the side of the lower index. So light
/// that enters and light that leaves on the same path have the same weight, and total reflection is a reflectance of exactly 1.
///
/// The refracted direction follows Snell's law, as in [`fresnel`]. Next to the critical angle, single precision may
/// decide wrongly whether reflection is total.
#[must_use]
pub fn schlick(cos: f32, index: f32) -> Interface {
    let cos = cos.clamp(0.0, 1.0);
    // Factored, so that the first term loses no digits for an index near 1.
    let discriminant = (index - 1.0) * (index + 1.0) + cos * cos;
    if discriminant <= 0.0 {
        return Interface { reflectance: 1.0, cos_refracted: 0.0 };
    }
    let cos_refracted = (discriminant.sqrt() / index).min(1.0);
    let root = (index - 1.0) / (index + 1.0);
    let zero = root * root;
    let away = 1.0 - if index < 1.0 { cos_refracted } else { cos };
    let square = away * away;
    Interface { reflectance: (zero + (1.0 - zero) * (square * square * away)).min(1.0), cos_refracted }
}

/// [`fresnel`], [`schlick`] or one of [`polarised`].
#[must_use]
pub fn interface(weights: Fresnel, cos: f32, index: f32) -> Interface {
    match weights {
        Fresnel::Exact => fresnel(cos, index),
        Fresnel::Schlick => schlick(cos, index),
        Fresnel::S => polarised(cos, index)[0],
        Fresnel::P => polarised(cos, index)[1],
    }
}

/// The [`interface`] of a material. Its own reflectance, if it has one, replaces Fresnel's except at total reflection.
/// The refracted direction follows Snell's law in both cases.
#[must_use]
#[inline]
pub fn interface_of(dielectric: &Dielectric, weights: Fresnel, cos: f32, index: f32) -> Interface {
    let smooth = interface(weights, cos, index);
    let total = smooth.cos_refracted == 0.0 && smooth.reflectance >= 1.0;
    let Some(curve) = dielectric.reflectance.filter(|_| !total) else { return smooth };
    let cos = if index < 1.0 { smooth.cos_refracted } else { cos.clamp(0.0, 1.0) };
    Interface { reflectance: curve.at(1.0 - cos), ..smooth }
}

impl Interface {
    /// The refracted unit direction of `i`, a unit direction that comes against the unit normal `n`; `index` as for
    /// [`fresnel`]. `None` at total reflection.
    pub fn refract(&self, i: Vec3, n: Vec3, index: f32) -> Option<Vec3> {
        if self.reflectance >= 1.0 {
            return None;
        }
        let along = i - n * n.dot(i);
        (along / index - n * self.cos_refracted).try_normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INDICES: [f32; 4] = [1.1, 1.33, 1.5, 2.42];

    /// The other textbook form of the reflectance, from both angles (Hecht, Optics, section 4.6), in double precision.
    fn reflectance_by_angles(angle: f64, index: f64) -> f64 {
        let sine = angle.sin() / index;
        if sine >= 1.0 {
            return 1.0;
        }
        let refracted = sine.asin();
        let perpendicular = (angle - refracted).sin() / (angle + refracted).sin();
        let parallel = (angle - refracted).tan() / (angle + refracted).tan();
        0.5 * (perpendicular * perpendicular + parallel * parallel)
    }

    #[test]
    fn reflectance_at_normal_incidence_is_the_closed_form() {
        for index in INDICES {
            let expected = ((index - 1.0) / (index + 1.0)).powi(2);
            for index in [index, 1.0 / index] {
                assert!((fresnel(1.0, index).reflectance - expected).abs() < 1e-7, "{index}");
            }
        }
        assert!((fresnel(1.0, 1.1).reflectance - 0.002_268).abs() < 1e-6);
        assert!((fresnel(1.0, 1.5).reflectance - 0.04).abs() < 1e-7);
    }

    #[test]
    fn parallel_light_is_not_reflected_at_brewsters_angle() {
        for index in INDICES {
            let index = f64::from(index);
            let brewster = index.atan();
            // At Brewster's angle only the perpendicular part remains, and half of it counts:
            // ((index² - 1) / (index² + 1))² / 2.
            let expected = 0.5 * ((index * index - 1.0) / (index * index + 1.0)).powi(2);
            let reflectance = fresnel(brewster.cos() as f32, index as f32).reflectance;
            assert!((f64::from(reflectance) - expected).abs() < 1e-6, "{index}: {reflectance} {expected}");
            // Of polarised light, all of the perpendicular part and nothing of the parallel one.
            for (cos, index) in [(brewster.cos(), index), (brewster.sin(), 1.0 / index)] {
                let [s, p] = polarised(cos as f32, index as f32).map(|interface| f64::from(interface.reflectance));
                assert!((s - 2.0 * expected).abs() < 1e-6 && p < 1e-6, "{index}: {s} {p}");
            }
        }
    }

    #[test]
    fn unpolarised_light_is_the_mean_of_both_polarisations() {
        for index in INDICES.into_iter().flat_map(|index| [index, 1.0 / index]) {
            for step in 0..=100 {
                let cos = step as f32 / 100.0;
                let [s, p] = polarised(cos, index);
                let mean = fresnel(cos, index);
                assert!((0.5 * (s.reflectance + p.reflectance) - mean.reflectance).abs() < 1e-6, "{index} {cos}");
                assert!(s.reflectance >= p.reflectance && s.reflectance <= 1.0, "{index} {cos}");
                assert_eq!([s, p].map(|interface| interface.cos_refracted), [mean.cos_refracted; 2]);
                for (weights, expected) in [(Fresnel::S, s), (Fresnel::P, p), (Fresnel::Exact, mean)] {
                    assert_eq!(interface(weights, cos, index), expected);
                }
            }
        }
    }

    #[test]
    fn grazing_light_is_reflected_wholly() {
        for index in INDICES {
            assert_eq!(fresnel(0.0, index).reflectance, 1.0);
            assert_eq!(fresnel(-0.1, index).reflectance, 1.0);
        }
    }

    #[test]
    fn fresnel_agrees_with_double_precision_both_ways() {
        for index in INDICES {
            for relative in [index, 1.0 / index] {
                for tenth in 1..900 {
                    let cos = (f64::from(tenth) * 0.1).to_radians().cos() as f32;
                    let expected = reflectance_by_angles(f64::from(cos).acos(), f64::from(relative));
                    let found = f64::from(fresnel(cos, relative).reflectance);
                    assert!((found - expected).abs() < 1e-5, "{relative} {tenth}: {found} {expected}");
                }
            }
        }
        assert!((reflectance_by_angles(1.0, 1.5) - reflectance_by_angles(1.0, 1.1)).abs() > 0.05, "control");
    }

    #[test]
    fn total_reflection_starts_at_the_critical_angle() {
        for (index, critical) in [(1.1f64, 65.380f64), (1.33, 48.754), (1.5, 41.810), (2.42, 24.408)] {
            let relative = (1.0 / index) as f32;
            let at = |degrees: f64| fresnel(degrees.to_radians().cos() as f32, relative);
            assert!(at(critical - 0.01).reflectance < 1.0, "{index}");
            assert_eq!(at(critical + 0.01), Interface { reflectance: 1.0, cos_refracted: 0.0 }, "{index}");
        }
    }

    #[test]
    fn refracted_directions_obey_snell() {
        let normal = Vec3::new(2.0, -1.0, 3.0).normalize();
        let tangent = normal.any_orthonormal_vector();
        for index in INDICES.into_iter().chain(INDICES.map(|index| 1.0 / index)) {
            for degree in 0..90 {
                let (sin, cos) = (degree as f32).to_radians().sin_cos();
                let incoming = tangent * sin - normal * cos;
                let interface = fresnel(cos, index);
                let Some(refracted) = interface.refract(incoming, normal, index) else {
                    assert!(sin / index > 1.0 - 1e-6, "{index} {degree}");
                    continue;
                };
                assert!((refracted.length() - 1.0).abs() < 1e-6);
                assert!((refracted.dot(tangent) * index - sin).abs() < 2e-6, "{index} {degree}");
                assert!(refracted.dot(normal) < 0.0);
                assert!(refracted.dot(normal.cross(tangent)).abs() < 1e-6, "stays in the plane of incidence");
            }
        }
    }

    #[test]
    fn mirrored_directions_keep_the_angle() {
        let (i, n) = (Vec3::new(1.0, -2.0, 0.5).normalize(), Vec3::new(0.1, 1.0, 0.2).normalize());
        let mirrored = reflect(i, n);
        assert!((mirrored.dot(n) + i.dot(n)).abs() < 1e-6 && (mirrored - reflect(i, -n)).length() < 1e-6);
        assert!((mirrored.cross(n) - i.cross(n)).length() < 1e-6);
    }
}
