//! A plane-parallel wall.

use curitiba_pipeline::glass::Dielectric;
use glam::Vec3;

/// The shares of unpolarised light, by colour, that a wall reflects and transmits after all reflections between its two faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slab {
    /// Share reflected.
    pub reflected: Vec3,
    /// Share transmitted; the rest is absorbed.
    pub transmitted: Vec3,
}

/// A wall whose faces reflect the share R = `reflectance`, and where light keeps the share a = `kept` from one face to the other. It reflects R +
/// (1-R)² R a² / (1 - R² a²) and transmits (1-R)² a / (1 - R² a²), the sums of the geometric series (Born and Wolf, Principles of Optics, section
/// 7.6, without interference).
///
/// Faces that reflect everything let nothing pass.
#[must_use]
pub fn slab(reflectance: f32, kept: Vec3) -> Slab {
    let (r, a) = (Vec3::splat(reflectance), kept);
    if reflectance >= 1.0 {
        return Slab { reflected: Vec3::ONE, transmitted: Vec3::ZERO };
    }
    let through = (1.0 - r) * (1.0 - r) * a / (1.0 - r * r * a * a);
    Slab { reflected: r + r * a * through, transmitted: through }
}

/// Transmittance from one face of a thin wall to the other, by colour.
pub(super) fn kept_across(dielectric: &Dielectric, cos_refracted: f32) -> Vec3 {
    dielectric.transmittance(dielectric.thickness / cos_refracted.max(f32::MIN_POSITIVE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clear_wall_has_the_closed_form() {
        // Normal incidence at index 1.5: 2R/(1+R) and (1-R)/(1+R) with R = 0.04.
        let wall = slab(0.04, Vec3::ONE);
        assert!((wall.reflected.x - 0.076_923).abs() < 1e-6 && (wall.transmitted.x - 0.923_077).abs() < 1e-6);
        // Control: one face alone is 4 %.
        assert!((wall.reflected.x - 0.04).abs() > 0.03);
        for reflectance in [0.0, 0.001, 0.3, 0.999, 1.0] {
            let Slab { reflected, transmitted } = slab(reflectance, Vec3::ONE);
            assert!((reflected + transmitted - 1.0).abs().max_element() < 1e-6, "{reflectance}");
        }
    }

    /// Hard case 13: thickness 2, sigma .1, .5, 2, index 1.5, normal incidence, an environment of 1 on both sides.
    #[test]
    fn an_absorbing_wall_between_two_white_sides_has_the_values_of_the_table() {
        let kept = Vec3::new(-0.2_f32, -1.0, -4.0).map(f32::exp);
        let Slab { reflected, transmitted } = slab(0.04, kept);
        let expected = Vec3::new(0.820_090, 0.384_101, 0.056_892);
        assert!((reflected + transmitted - expected).abs().max_element() < 2e-6, "{}", reflected + transmitted);
    }

    #[test]
    fn the_sums_are_those_of_the_reflections_one_by_one() {
        for (reflectance, kept) in [(0.04_f64, 0.9_f64), (0.3, 0.5), (0.9, 1.0), (0.5, 0.0)] {
            let (mut reflected, mut transmitted, mut inside) = (reflectance, 0.0, 1.0 - reflectance);
            for bounce in 0..400 {
                inside *= kept;
                let leaves = inside * (1.0 - reflectance);
                if bounce % 2 == 0 {
                    transmitted += leaves
                } else {
                    reflected += leaves
                }
                inside *= reflectance;
            }
            let wall = slab(reflectance as f32, Vec3::splat(kept as f32));
            assert!((f64::from(wall.reflected.x) - reflected).abs() < 1e-6, "{reflectance} {kept}");
            assert!((f64::from(wall.transmitted.x) - transmitted).abs() < 1e-6, "{reflectance} {kept}");
        }
    }
}
