//! The program with the side decided by the geometric normal, and with exact ray origins.

use super::light::{Light, light};
use crate::effects::light::SHADOWED;
use crate::effects::{Area, Coverage, Pass, Pixel, TILE, Workspace, opaque};
use crate::trace::Tracer;
use glam::Vec3;

/// The light's share, alpha 1.
///
/// The colour was lit by the shading normal's cosine. So the shaded side is that of the shading normal if the scene has
/// vertex normals, and else the viewer's. A triangle facing away from the light is in its own shadow, without a ray,
/// unless the round surface that it approximates faces the light (`effects::terminator`).
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let share = match light(pass, pixel) {
        Light::Certain(share) => share,
        Light::Ray(origin) => {
            work.rays.shadow += 1;
            if pass.sees_light(origin, |hit| pass.covers(hit)) { 1.0 } else { SHADOWED }
        }
        Light::Lifted(lifted) => pass.light_at_lifted(&lifted, &mut work.rays.shadow),
    };
    opaque(Vec3::splat(share))
}

/// Computes all pixels of a tile, and traces their rays together.
pub fn tile<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    area: Area,
    rows: &mut [&mut [[f32; 4]]; TILE],
    work: &mut Workspace,
) {
    work.rays.shadow += work.shadows.prepare(pass, &area);
    work.shadows.write(rows);
}
