//! The light of a pixel, which the side of its triangle and a ray decide.

use crate::effects::coverage::Coverage;
use crate::effects::interpolate::{interpolate, locate};
use crate::effects::light::SHADOWED;
use crate::effects::pass::{Pass, Pixel};
use crate::effects::terminator::Lifted;
use crate::trace::{SurfacePoint, Tracer};
use glam::Vec3;

/// Least cosine between a triangle's normal and the normal at a corner for which the corner normal's side is certain.
pub(super) const CLEARLY: f32 = 1.0e-2;

/// What is left to find out about the light at a point.
pub(super) enum Light {
    /// Nothing: the light has this share.
    Certain(f32),
    /// A shadow ray from this origin.
    Ray(Vec3),
    /// Two rays, for a point whose triangle faces away from the light although the round surface that it approximates does not.
    Lifted(Lifted),
}

/// Whether a pixel's shading normal faces the light. If not, its colour is dark already.
pub(super) fn is_lit<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel) -> bool {
    pass.position(pixel).w > 0.0
}

/// What is left to find out about the light of a pixel.
pub(super) fn light<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel) -> Light {
    let Some(triangle) = pass.triangle(pixel).filter(|_| is_lit(pass, pixel)) else { return Light::Certain(1.0) };
    light_at(pass, triangle, &pass.point_at(pixel, triangle))
}

/// What is left to find out about the light at a point of a triangle.
pub(super) fn light_at<T: Tracer, C>(pass: &Pass<'_, T, C>, triangle: u32, point: &SurfacePoint) -> Light {
    let side = side(pass, triangle, point);
    let is_turned_away = point.normal.dot(pass.to_light) * side <= 0.0;
    if !is_turned_away {
        return Light::Ray(point.spawn(pass.to_light));
    }
    pass.lifted(triangle, point, (point.normal * side, pass.to_light)).map_or(Light::Certain(SHADOWED), Light::Lifted)
}

/// 1 where the triangle's normal is on the shaded side, else -1.
pub(super) fn side<T: Tracer, C>(pass: &Pass<'_, T, C>, triangle: u32, point: &SurfacePoint) -> f32 {
    if pass.sphere(triangle).is_some() {
        return 1.0;
    }
    let geometry = &pass.job.scene.geometry;
    if geometry.normals.is_empty() {
        return 1f32.copysign(point.normal.dot(pass.job.eye - point.position));
    }
    // Where the normals at all three corners are clearly on one side, their interpolation is on that side.
    let of_corners = geometry.triangles[triangle as usize].map(|corner| {
        let normal = geometry.normals[corner as usize];
        (point.normal.dot(normal), CLEARLY * normal.length_squared().max(1.0))
    });
    if of_corners.iter().all(|(cosine, least)| cosine > least) {
        1.0
    } else if of_corners.iter().all(|(cosine, least)| -cosine > *least) {
        -1.0
    } else {
        let hit = locate(geometry, triangle, point.position);
        1f32.copysign(point.normal.dot(interpolate(geometry, &geometry.normals, &hit)))
    }
}
