//! Rough interfaces: microfacets after Walter, Marschner, Li and Torrance ("Microfacet Models for Refraction through Rough Surfaces",
//! EGSR 2007), whose normals have the distribution GGX.
//!
//! A facet is chosen among those that the viewer sees. It is a smooth interface, which reflects and refracts by Fresnel's equations at its own
//! angle. Light from the facet that other facets block is lost (see [`Facet::passes`]): the model has no light that meets several facets.

use super::branch::Branch;
use crate::effects::reflect;
use crate::sampling::hemisphere::{Basis, concentric_disk};
use glam::{Vec2, Vec3};

/// A microfacet of a rough interface, as it is seen.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    /// Its unit normal, on the viewer's side.
    pub normal: Vec3,
    surface: Vec3,
    alpha: f32,
    /// Smith's auxiliary function of the viewer.
    viewer: f32,
}

impl Facet {
    /// The facet for a point of the unit square, by the distribution of visible normals. The interface has the unit normal `normal` and the GGX
    /// width `alpha` (above 0, at most 1). `view` is the unit direction from the viewer to the interface; its dot product with the normal is
    /// negative.
    ///
    /// Spherical caps (Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps", Computer Graphics Forum 42(8), 2023),
    /// with a map from square to cap that keeps neighbours together.
    #[must_use]
    pub fn seen(alpha: f32, normal: Vec3, view: Vec3, point: Vec2) -> Self {
        let basis = Basis::around(normal);
        let back = -view;
        let viewer = Vec3::new(back.dot(basis.tangent), back.dot(basis.bitangent), back.dot(normal).max(0.0));
        let stretched = Vec3::new(alpha * viewer.x, alpha * viewer.y, viewer.z).normalize_or(Vec3::Z);
        let disk = concentric_disk(point);
        let height = 1.0 + stretched.z;
        let depth = disk.length_squared() * height;
        let half = (disk * (height * (2.0 - depth).max(0.0)).sqrt()).extend(1.0 - depth) + stretched;
        let local = Vec3::new(alpha * half.x, alpha * half.y, half.z.max(0.0)).normalize_or(Vec3::Z);
        let facet = basis.to_world(local).normalize();
        Self { normal: facet, surface: normal, alpha, viewer: smith(alpha, viewer.z) }
    }

    /// The share of the light sent in this unit direction, to either side, that no other facet stops: G2 / G1, with heights correlated (Heitz,
    /// "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), 2014). As is usual, refracted light is treated like
    /// reflected light. Never above 1.
    #[must_use]
    pub fn passes(&self, direction: Vec3) -> f32 {
        (1.0 + self.viewer) / (1.0 + self.viewer + smith(self.alpha, direction.dot(self.surface).abs()))
    }
}

impl Facet {
    /// The reflected and the transmitted branch at a facet of a wall; `None` for a branch that would leave on the wrong side. `facing` is the unit
    /// geometric normal on the viewer's side. The direction of the transmitted branch is that of the reflected one, mirrored to the other side of
    /// the wall (glTF `KHR_materials_transmission`).
    pub(super) fn of_wall<K>(
        &self,
        facing: Vec3,
        mirrored: Branch<K>,
        through: Branch<K>,
    ) -> (Option<Branch<K>>, Option<Branch<K>>) {
        let kept = self.passes(mirrored.direction);
        let above = mirrored.direction.dot(self.surface) > 0.0;
        let behind = reflect(mirrored.direction, self.surface);
        let mirrored = Branch { weight: mirrored.weight * kept, ..mirrored };
        let through = Branch { direction: behind, weight: through.weight * kept, ..through };
        let stays = above && mirrored.direction.dot(facing) > 0.0;
        (stays.then_some(mirrored), (above && behind.dot(facing) < 0.0).then_some(through))
    }
}

/// Smith's auxiliary function of GGX for a direction of this cosine with the normal: (sqrt(1 + alpha² tan²) - 1) / 2.
fn smith(alpha: f32, cos: f32) -> f32 {
    let cos = cos.clamp(1e-6, 1.0);
    let slope = alpha * alpha * (1.0 - cos * cos) / (cos * cos);
    0.5 * slope / ((1.0 + slope).sqrt() + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::fresnel;
    use crate::sampling::HemisphereSampler;
    use curitiba_pipeline::programs::Sampler;
    use glam::{DVec2, DVec3};

    const INDEX: f32 = 1.5;

    /// The shares that an interface reflects and lets pass, as means over 2^16 facets, and the largest sum of both at one facet.
    fn albedo(alpha: f32, index: f32, view: Vec3) -> ([f64; 2], f64) {
        let sampler = HemisphereSampler::new(Sampler::Sobol, 1 << 16).expect("any count is valid");
        let (mut sums, mut most, mut count) = ([0.0; 2], 0.0_f64, 0.0);
        sampler.points(7, |point| {
            let facet = Facet::seen(alpha, Vec3::Z, view, point);
            let interface = fresnel(-view.dot(facet.normal), index);
            let mirrored = reflect(view, facet.normal);
            let back = if mirrored.z > 0.0 { interface.reflectance * facet.passes(mirrored) } else { 0.0 };
            let refracted = interface.refract(view, facet.normal, index).filter(|direction| direction.z < 0.0);
            let through = refracted.map_or(0.0, |direction| (1.0 - interface.reflectance) * facet.passes(direction));
            sums = [sums[0] + f64::from(back), sums[1] + f64::from(through)];
            most = most.max(f64::from(back + through));
            count += 1.0;
        });
        (sums.map(|sum| sum / count), most)
    }

    /// R + T / n² with light of 1 on both sides; .466667 would be lossless. Values of Mitsuba 3.9.1, each within .0009.
    #[test]
    fn what_is_lost_at_normal_incidence_is_what_single_scattering_loses() {
        for (alpha, expected) in [(0.05, 0.46737), (0.1, 0.46668), (0.2, 0.46364), (0.3, 0.45917), (0.5, 0.44592)] {
            let ([reflected, passed], _) = albedo(alpha, INDEX, Vec3::NEG_Z);
            let found = reflected + passed / f64::from(INDEX * INDEX);
            assert!((found - expected).abs() < 9e-4 + 1e-4, "{alpha}: {found}");
        }
    }

    #[test]
    fn no_facet_sends_on_more_than_it_gets() {
        for alpha in [1e-4, 0.01, 0.2, 1.0] {
            for index in [1.0 / 2.42, 1.0 / 1.5, 1.0, 1.33, 2.42] {
                for degrees in [0.0_f32, 40.0, 75.0, 89.0, 89.99] {
                    let (sin, cos) = degrees.to_radians().sin_cos();
                    let ([reflected, passed], most) = albedo(alpha, index, Vec3::new(sin, 0.0, -cos));
                    let what = format!("alpha {alpha}, index {index}, {degrees} degrees");
                    assert!(most <= 1.0 + 1e-6 && reflected >= 0.0 && passed >= 0.0, "{what}: {most}");
                    assert!(reflected + passed > 0.3, "{what}: {reflected} {passed}");
                }
            }
        }
    }

    #[test]
    fn a_narrow_distribution_is_a_smooth_interface() {
        for degrees in [0.0_f32, 30.0, 60.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let ([reflected, passed], _) = albedo(1e-4, INDEX, Vec3::new(sin, 0.0, -cos));
            let expected = f64::from(fresnel(cos, INDEX).reflectance);
            assert!((reflected - expected).abs() < 1e-5 && (passed - 1.0 + expected).abs() < 1e-5, "{degrees}");
        }
    }

    fn smith_64(alpha: f64, cos: f64) -> f64 {
        0.5 * ((1.0 + (alpha / cos).powi(2) * (1.0 - cos * cos)).sqrt() - 1.0)
    }

    /// D times G, and F, of a half vector, in `f64`.
    fn parts(alpha: f64, index: f64, half: DVec3, [one, other]: [DVec3; 2]) -> (f64, f64) {
        let spread = half.z * half.z * (alpha * alpha - 1.0) + 1.0;
        let density = alpha * alpha / (std::f64::consts::PI * spread * spread);
        let masking = 1.0 / (1.0 + smith_64(alpha, one.z.abs()) + smith_64(alpha, other.z.abs()));
        let cos = one.dot(half);
        let inner = (index * index - 1.0 + cos * cos).max(0.0).sqrt() / index;
        let (s, p) = ((cos - index * inner) / (cos + index * inner), (index * cos - inner) / (index * cos + inner));
        (density * masking, 0.5 * (s * s + p * p))
    }

    /// R and T of an interface by the formulas of the paper for BRDF and BTDF, integrated over all directions.
    fn integrals(alpha: f64, index: f64, viewer: DVec3) -> [f64; 2] {
        let (rings, sectors) = (600, 600);
        let (mut reflected, mut passed) = (0.0, 0.0);
        for ring in 0..rings {
            // Uniform in the cosine, so that all steps have the same solid angle.
            let cos = (f64::from(ring) + 0.5) / f64::from(rings);
            for sector in 0..sectors {
                let angle = (f64::from(sector) + 0.5) / f64::from(sectors) * std::f64::consts::TAU;
                let side = DVec2::from_angle(angle) * (1.0 - cos * cos).sqrt();
                let up = side.extend(cos);
                let half = (viewer + up).normalize();
                let (spread, share) = parts(alpha, index, half, [viewer, up]);
                reflected += spread * share / (4.0 * viewer.z);
                let down = side.extend(-cos);
                let half = -(viewer + index * down).normalize();
                let (from, to) = (viewer.dot(half), down.dot(half));
                if half.z > 0.0 && from > 0.0 && to < 0.0 {
                    let (spread, share) = parts(alpha, index, half, [viewer, down]);
                    let jacobian = index * index * to.abs() / (from + index * to).powi(2);
                    passed += spread * (1.0 - share) * from / viewer.z * jacobian;
                }
            }
        }
        let step = std::f64::consts::TAU / f64::from(rings * sectors);
        [reflected * step, passed * step]
    }

    #[test]
    fn seen_facets_give_the_integrals_of_the_papers_formulas() {
        for (alpha, degrees) in [(0.3_f32, 50.0_f32), (0.5, 75.0)] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let expected = integrals(f64::from(alpha), 1.5, Vec3::new(sin, 0.0, cos).as_dvec3());
            let (found, _) = albedo(alpha, INDEX, Vec3::new(-sin, 0.0, -cos));
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 5e-4, "{alpha} {degrees}: {found} {expected}");
            }
            let smooth = f64::from(fresnel(cos, INDEX).reflectance);
            assert!((found[0] - smooth).abs() > 5e-3, "control: {alpha} {degrees}: {} {smooth}", found[0]);
        }
    }
}
