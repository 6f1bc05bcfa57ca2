//! With every difference mended.

use crate::effects::refraction::corrected::Glass;
use crate::effects::surface::Surface;
use crate::effects::{Coverage, Pass, Pixel, Workspace, opaque};
use crate::sampling::hash::pixel_key;
use crate::trace::{Hit, Tracer};
use glam::{Vec3, Vec4};

/// Glass, or the shadowed and occluded colour, alpha 1; background pixels as they are.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let color = pass.job.color[pixel.index];
    let Some(triangle) = pass.triangle(pixel) else { return color };
    let stored_normal = pass.normal(pixel);
    let (surface, view) = pass.surface_at(pixel, triangle, stored_normal);
    let key = pixel_key(pixel.x, pixel.y, pass.job.seed);
    if pass.is_glass(triangle) {
        let shade = |hit: &Hit, surface: &Surface, key: u32, work: &mut Workspace| {
            visible(pass, pass.lit_color(hit, surface.normal), surface, surface.facing, key, work)
        };
        return opaque(Glass { pass, shade }.blend(&surface, view, 0, key, work));
    }
    // The colour was lit by the stored normal, so the side that it looks to is the one to be shadowed.
    let lit_side = if stored_normal.dot(surface.facing) < 0.0 { -surface.facing } else { surface.facing };
    opaque(visible(pass, Vec4::from_array(color).truncate(), &surface, lit_side, key, work))
}

/// A colour times the light's share and ambient occlusion. Black stays black, without a ray.
fn visible<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    color: Vec3,
    surface: &Surface,
    lit_side: Vec3,
    key: u32,
    work: &mut Workspace,
) -> Vec3 {
    if color == Vec3::ZERO {
        return color;
    }
    let light = pass.light_share(surface, lit_side, work);
    color * light * pass.occlusion(surface, key, work, |hit| pass.stops_light(hit))
}
