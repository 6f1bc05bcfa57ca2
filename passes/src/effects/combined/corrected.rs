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
            let color = pass.lit_color(hit, surface.normal);
            if color == Vec3::ZERO { color } else { color * visibility(pass, surface, surface.facing, key, work) }
        };
        return opaque(Glass { pass, shade }.blend(&surface, view, 0, key, work));
    }
    // The colour was lit by the stored normal, so the side that it looks to is the one to be shadowed.
    let lit_side = if stored_normal.dot(surface.facing) < 0.0 { -surface.facing } else { surface.facing };
    opaque(Vec4::from_array(color).truncate() * visibility(pass, &surface, lit_side, key, work))
}

/// Light share times ambient occlusion.
fn visibility<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    surface: &Surface,
    lit_side: Vec3,
    key: u32,
    work: &mut Workspace,
) -> f32 {
    pass.light_share(surface, lit_side, work) * pass.occlusion(surface, key, work, |hit| pass.stops_light(hit))
}
