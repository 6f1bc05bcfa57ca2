//! Rough interfaces: microfacets whose normals have the distribution GGX (Walter and others, "Microfacet Models for Refraction through Rough
//! Surfaces", EGSR 2007). Each is a smooth interface. Light that meets several facets of one surface is not followed.

use super::optics::mirrored;
use super::world::Surface;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// A microfacet that a viewer sees.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    /// Unit normal of the facet.
    pub normal: DVec3,
    /// Unit normal of the interface, on the viewer's side.
    mean: DVec3,
    /// Width alpha of the distribution.
    width: f64,
    /// Smith's auxiliary function for the direction to the viewer.
    masked: f64,
}

impl Facet {
    /// The facet that a uniform point of the unit square chooses among those that the viewer sees. The interface is stretched until its width
    /// is 1. Its visible normals are then those of a half sphere, which the viewer sees as two half discs (Heitz, "Sampling the GGX Distribution
    /// of Visible Normals", JCGT 7(4), 2018).
    pub fn seen(width: f64, mean: DVec3, direction: DVec3, point: DVec2) -> Self {
        let (tangent, bitangent) = mean.any_orthonormal_pair();
        let to_viewer = DVec3::new(-direction.dot(tangent), -direction.dot(bitangent), (-direction.dot(mean)).max(0.0));
        let viewer = DVec3::new(width * to_viewer.x, width * to_viewer.y, to_viewer.z).normalize_or(DVec3::Z);
        let across = DVec3::new(-viewer.y, viewer.x, 0.0).normalize_or(DVec3::X);
        let along = viewer.cross(across);
        let (sin, cos) = (TAU * point.y).sin_cos();
        let x = point.x.sqrt() * cos;
        let edge = (1.0 - x * x).sqrt();
        // Along `y` the visible part reaches from `edge` only to `-edge` times the height of the viewer (`viewer.z`).
        let y = edge + 0.5 * (1.0 + viewer.z) * (point.x.sqrt() * sin - edge);
        let half = across * x + along * y + viewer * (1.0 - x * x - y * y).max(0.0).sqrt();
        let local = DVec3::new(width * half.x, width * half.y, half.z.max(0.0)).normalize_or(DVec3::Z);
        let normal = (tangent * local.x + bitangent * local.y + mean * local.z).normalize();
        Self { normal, mean, width, masked: smith(width, to_viewer.z) }
    }

    /// Of the light that the facet sends in a direction, the share that no other facet blocks, given that the viewer sees this facet: Smith's
    /// masking and shadowing with correlated heights.
    pub fn passes(&self, direction: DVec3) -> f64 {
        (1.0 + self.masked) / (1.0 + self.masked + smith(self.width, direction.dot(self.mean).abs()))
    }

    /// 1 for a direction to the viewer's side of the interface and of the triangle, -1 for one to the other side of both, else 0.
    pub fn side(&self, surface: &Surface, direction: DVec3) -> f64 {
        let [mean, flat] = [self.mean, surface.facing].map(|normal| direction.dot(normal));
        if mean * flat > 0.0 { flat.signum() } else { 0.0 }
    }

    /// The directions in which a facet of a wall sends reflected and transmitted light. The second is the mirror image of the first behind the wall.
    pub fn of_wall(&self, direction: DVec3) -> [DVec3; 2] {
        let back = mirrored(direction, self.normal);
        [back, mirrored(back, self.mean)]
    }
}

/// Smith's auxiliary function of GGX, for a direction with this cosine to the mean normal.
fn smith(width: f64, cosine: f64) -> f64 {
    let cosine = cosine.clamp(1e-9, 1.0);
    let slope = width * width * (1.0 / (cosine * cosine) - 1.0);
    0.5 * ((1.0 + slope).sqrt() - 1.0)
}

#[cfg(test)]
mod tests {
    use super::super::points::{Points, Purpose};
    use super::*;

    /// The density of visible normals is D(m) max(0, v m) G1(v) / cos v, with GGX's D. Returns the mean of a function under this density, by a sum
    /// over the half sphere.
    fn by_density(width: f64, viewer: DVec3, of: impl Fn(DVec3) -> f64) -> f64 {
        const STEPS: usize = 1500;
        let (mut sum, mut whole) = (0.0, 0.0);
        for step in 0..STEPS * STEPS {
            let [x, y] = [step % STEPS, step / STEPS].map(|at| (at as f64 + 0.5) / STEPS as f64);
            // More steps near the pole, where the distribution is.
            let z = 1.0 - y * y * y;
            let (sin, cos) = (TAU * x).sin_cos();
            let normal = DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
            let spread = z * z * (width * width - 1.0) + 1.0;
            let weight = 3.0 * y * y * (width / spread).powi(2) * normal.dot(viewer).max(0.0);
            sum += weight * of(normal);
            whole += weight;
        }
        sum / whole
    }

    #[test]
    fn facets_have_the_distribution_of_visible_normals() {
        let points = Points::new(5, Purpose::Facet);
        for (width, degrees) in [(0.1, 20.0_f64), (0.5, 70.0), (1.0, 45.0)] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let viewer = DVec3::new(sin, 0.0, cos);
            let count = 1 << 16;
            let mean = |of: &dyn Fn(DVec3) -> f64| {
                let each = |index| of(Facet::seen(width, DVec3::Z, -viewer, points.at(index)).normal);
                (0..count).map(each).sum::<f64>() / f64::from(count)
            };
            let moments: [&dyn Fn(DVec3) -> f64; 4] = [&|m| m.x, &|m| m.z, &|m| m.x * m.x, &|m| m.y * m.y];
            for (number, of) in moments.into_iter().enumerate() {
                let (found, expected) = (mean(of), by_density(width, viewer, of));
                assert!((found - expected).abs() < 1e-3, "{width} {degrees}, moment {number}: {found} {expected}");
            }
            let narrower = by_density(0.9 * width, viewer, |m| m.y * m.y);
            let found = mean(&|m| m.y * m.y);
            assert!((found - narrower).abs() > 1e-3 || width < 0.2, "control: another width: {found} {narrower}");
        }
    }
}
