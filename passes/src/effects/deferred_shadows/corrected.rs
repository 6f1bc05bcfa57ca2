//! With the geometric normal deciding the side, and exact origins.

use crate::effects::lights::{Known, prepare as prepare_lights};
use crate::effects::occlusion::SHADOWED;
use crate::effects::{Area, Coverage, Pass, Pixel, Workspace, material, opaque};
use crate::trace::Tracer;
use glam::Vec3;

/// The light's share, alpha 1.
///
/// The cosine is the shading normal's, so the geometric normal is turned to its side where the scene has vertex normals,
/// and else to the viewer. A triangle turned away from the light is in its own shadow: no ray.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    if let Some(share) = work.lights.known().light {
        return opaque(Vec3::splat(share));
    }
    let share = match light(pass, pixel) {
        Light::Certain(share) => share,
        Light::Ray(origin) => {
            work.rays.shadow += 1;
            if pass.sees_light(origin, |hit| pass.coverage.covers(hit)) { 1.0 } else { SHADOWED }
        }
    };
    opaque(Vec3::splat(share))
}

/// Traces the rays of a tile together, before its pixels ask.
pub fn prepare<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, area: Area, work: &mut Workspace) {
    work.lights.clear();
    let origin = |pixel, _: &Known| match light(pass, pixel) {
        Light::Certain(share) => (Some(share), None),
        Light::Ray(origin) => (None, Some(origin)),
    };
    work.rays.shadow += prepare_lights(pass, area, &mut work.lights, origin, |_, hit, _| pass.coverage.covers(hit));
}

/// What a pixel's light depends on.
enum Light {
    /// Nothing: it has this share.
    Certain(f32),
    /// A ray from here.
    Ray(Vec3),
}

fn light<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel) -> Light {
    let Some(triangle) = pass.triangle(pixel) else { return Light::Certain(1.0) };
    let position = pass.position(pixel);
    if position.w <= 0.0 || position.w.is_nan() {
        return Light::Certain(1.0);
    }
    let point = pass.point_at(pixel, triangle);
    let geometry = &pass.job.scene.geometry;
    let side = if geometry.normals.is_empty() {
        pass.job.eye - point.position
    } else {
        material::interpolate(geometry, &geometry.normals, &material::locate(geometry, triangle, point.position))
    };
    let towards = point.normal.dot(pass.to_light) * 1f32.copysign(point.normal.dot(side));
    if towards <= 0.0 { Light::Certain(SHADOWED) } else { Light::Ray(point.spawn(pass.to_light)) }
}
