//! Where glass is what each material says (`glass=auto`).

use super::corrected;
use crate::effects::dielectric::{Media, Walk};
use crate::effects::surface::Surface;
use crate::effects::tile_surfaces::Known;
use crate::effects::{Area, Coverage, Pass, Pixel, Workspace, opaque};
use crate::trace::{Hit, Tracer};
use curitiba_pipeline::glass::GlassShadow;
use glam::{Vec3, Vec4};

/// As [`corrected::pixel`].
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let color = pass.job.color[pixel.index];
    let Some(triangle) = pass.triangle(pixel) else { return color };
    let stored_normal = pass.normal(pixel);
    let known = work.surfaces.known(work.place);
    let seen @ (surface, _) = known.surface.unwrap_or_else(|| pass.surface_at(pixel, triangle, stored_normal));
    let key = pass.key(pixel);
    if pass.is_glass(triangle) {
        let shade = |hit: &Hit, surface: &Surface, _: Media, key: u32, work: &mut Workspace| {
            let color = pass.lit_color(hit, surface.normal);
            visible(pass, color, surface, ((surface.facing, hit.triangle), Known::NOTHING), key, work)
        };
        return opaque(Walk { pass, shade }.pixel(pixel, triangle, seen, key, work));
    }
    let lit_side = (corrected::lit_side(&surface, stored_normal), triangle);
    opaque(visible(pass, Vec4::from_array(color).truncate(), &surface, (lit_side, known), key, work))
}

/// As [`corrected::prepare`]; light that falls through glass is left to the pixels where its colour matters.
pub fn prepare<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, area: Area, work: &mut Workspace) {
    corrected::prepare(pass, area, work);
    if falls_straight(pass) {
        work.surfaces.forget_light_through_glass();
    }
}

fn falls_straight<T, C>(pass: &Pass<'_, T, C>) -> bool {
    pass.job.params.shadow == GlassShadow::Straight
}

/// As [`corrected::visible`], with coloured light behind glass.
fn visible<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    color: Vec3,
    surface: &Surface,
    (lit_side, known): ((Vec3, u32), Known),
    key: u32,
    work: &mut Workspace,
) -> Vec3 {
    if color == Vec3::ZERO || known.light.is_some() || !falls_straight(pass) {
        return corrected::visible(pass, color, surface, (lit_side, known), key, work);
    }
    let light = pass.straight_light(surface, lit_side, key, work);
    // Occlusion alone is left to be found out.
    light * corrected::visible(pass, color, surface, (lit_side, Known { light: Some(1.0), ..known }), key, work)
}
