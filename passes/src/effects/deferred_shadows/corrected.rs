//! With the geometric normal deciding the side, and exact origins.

use crate::effects::occlusion::SHADOWED;
use crate::effects::{Coverage, Pass, Pixel, Workspace, material, opaque};
use crate::trace::Tracer;
use glam::Vec3;

/// The light's share, alpha 1.
///
/// The cosine is the shading normal's, so the geometric normal is turned to its side where the scene has vertex normals,
/// and else to the viewer. A triangle turned away from the light is in its own shadow: no ray.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let Some(triangle) = pass.triangle(pixel) else { return [1.0; 4] };
    let position = pass.position(pixel);
    if position.w <= 0.0 || position.w.is_nan() {
        return [1.0; 4];
    }
    let point = pass.point_at(pixel, triangle);
    let geometry = &pass.job.scene.geometry;
    let side = if geometry.normals.is_empty() {
        pass.job.eye - point.position
    } else {
        material::interpolate(geometry, &geometry.normals, &material::locate(geometry, triangle, point.position))
    };
    let towards = point.normal.dot(pass.to_light) * 1f32.copysign(point.normal.dot(side));
    if towards <= 0.0 {
        return opaque(Vec3::splat(SHADOWED));
    }
    work.rays.shadow += 1;
    let lit = pass.sees_light(point.spawn(pass.to_light), |hit| pass.coverage.covers(hit));
    opaque(Vec3::splat(if lit { 1.0 } else { SHADOWED }))
}
