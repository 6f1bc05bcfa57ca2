//! Exact spheres: from their placement in files and projects to world space.

use super::super::error::SceneError;
use super::super::origin::Bounds;
use super::super::{PlacedSphere, Sphere};
use crate::diagnostic::Warnings;
use glam::{DMat4, DVec3};
use std::path::Path;

/// Tolerance for the scales along the axes, relative, and for the cosines between the axes: far above the rounding of a product of
/// `f32` matrices.
const ALIKE: f64 = 1e-5;

/// A sphere in `f64`, before rounding.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    center: DVec3,
    radius: f64,
    material: u32,
}

impl Ball {
    /// The transformed sphere of radius 1 about the origin; `None` if the transform does not scale uniformly.
    fn unit(material: u32, placed: DMat4) -> Option<Self> {
        Some(Self { center: placed.w_axis.truncate(), radius: scale_of(placed)?, material })
    }

    pub fn bounds(&self) -> Bounds {
        [self.center - self.radius, self.center + self.radius]
    }

    /// The sphere moved by a transform; `None` if its scale is not uniform.
    pub fn moved(&self, by: DMat4) -> Option<Self> {
        Some(Self { center: by.transform_point3(self.center), radius: self.radius * scale_of(by)?, ..*self })
    }

    /// The sphere translated, then scaled.
    pub fn fitted(&self, by: DVec3, scale: f64) -> Self {
        Self { center: (self.center + by) * scale, radius: self.radius * scale, ..*self }
    }
}

/// The factor by which a transform scales; `None` if it depends on the direction.
fn scale_of(transform: DMat4) -> Option<f64> {
    let axes = [transform.x_axis, transform.y_axis, transform.z_axis].map(|axis| axis.truncate());
    let scale = axes[0].length();
    let alike = axes.iter().all(|axis| (axis.length() - scale).abs() <= ALIKE * scale);
    let pairs = [(0, 1), (0, 2), (1, 2)];
    let square = pairs.iter().all(|(a, b)| axes[*a].dot(axes[*b]).abs() <= ALIKE * scale * scale);
    // Transforms that are not finite pass here; their spheres are left out and counted later.
    (alike && square || !transform.is_finite()).then_some(scale)
}

/// The spheres of a scene, each moved by its own transform and then by `after`.
pub(super) fn placed(spheres: &[PlacedSphere], after: DMat4, file: &Path) -> Result<Vec<Ball>, SceneError> {
    let ball = |sphere: &PlacedSphere| {
        Ball::unit(sphere.material, after * sphere.transform.as_dmat4()).ok_or_else(|| stretched(&sphere.name, file))
    };
    spheres.iter().map(ball).collect()
}

/// The error of a sphere whose transform would make it an ellipsoid.
pub(super) fn stretched(name: &str, file: &Path) -> SceneError {
    SceneError::file(file, format!("the exact sphere `{name}` is not scaled alike along all axes"))
        .help("scale it by one number, or make it a mesh")
}

/// The bounding box of all finite spheres.
pub(super) fn bounds(balls: impl Iterator<Item = Ball>) -> Option<Bounds> {
    let finite = balls.map(|ball| ball.bounds()).filter(|[low, high]| low.is_finite() && high.is_finite());
    finite.reduce(|[low, high], [a, b]| [low.min(a), high.max(b)])
}

/// The spheres in world space, sorted by material. Spheres without a valid centre or radius are left out and counted.
pub(super) fn finished(
    balls: &[Ball],
    (names, origin): (&[PlacedSphere], DVec3),
    file: &Path,
    warnings: &mut Warnings,
) -> Vec<Sphere> {
    let mut spheres = Vec::with_capacity(balls.len());
    for (ball, placed) in balls.iter().zip(names) {
        let sphere =
            Sphere { center: (ball.center - origin).as_vec3(), radius: ball.radius as f32, material: ball.material };
        // The radius squared must neither overflow nor underflow.
        if sphere.center.is_finite() && (1e-18..1e18).contains(&sphere.radius) {
            spheres.push(sphere);
        } else {
            let what = "exact spheres without a place or with a radius outside of 1e-18 to 1e18";
            warnings.add(file, what, "left out", || format!("`{}`", placed.name));
        }
    }
    spheres.sort_by_key(|sphere| sphere.material);
    spheres
}
