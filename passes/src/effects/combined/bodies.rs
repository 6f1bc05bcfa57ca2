//! The program where each material says what kind of glass it is (`glass=auto`).

use super::corrected::{self, Side};
use crate::effects::dielectric::{AllWays, Lit, Media, Sample, Walk, Ways};
use crate::effects::light::SHADOWED;
use crate::effects::lights::Way;
use crate::effects::surface::{FootprintOf, Surface};
use crate::effects::tile_surfaces::Known;
use crate::effects::{Area, Coverage, Pass, Pixel, Workspace, opaque};
use crate::trace::{Hit, Tracer};
use curitiba_pipeline::glass::GlassShadow;
use glam::{Vec3, Vec4};

/// As [`corrected::pixel`], with glass whose kind each material states. A body that the camera is in absorbs light from opaque surfaces too.
/// The background has no position and keeps its colour.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    pixel_of(pass, pixel, AllWays, work)
}

/// One sample of [`pixel`]; the mean of samples over all ways is the pixel's colour. A sample without stochastic events equals that colour to the
/// bit.
pub fn sample<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    pixel: Pixel,
    sample: Sample<'_>,
    work: &mut Workspace,
) -> [f32; 4] {
    pixel_of(pass, pixel, sample, work)
}

fn pixel_of<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    pixel: Pixel,
    ways: impl Ways,
    work: &mut Workspace,
) -> [f32; 4] {
    let color = pass.job.color[pixel.index];
    let Some(triangle) = pass.triangle(pixel) else { return color };
    let stored_normal = pass.normal(pixel);
    let known = work.surfaces.known(work.place);
    let seen @ (surface, _) = known.surface.unwrap_or_else(|| pass.surface_at(pixel, triangle, stored_normal));
    let key = ways.key(pass.key(pixel));
    if pass.is_glass(triangle) {
        let shade =
            |hit: &Hit, footprint: FootprintOf<C>, surface: &Surface, _: Media, key: u32, work: &mut Workspace| {
                let color = pass.met_color(hit, footprint, surface);
                let normal = surface.normal;
                let lit = || Lit { normal, cosine: pass.light_cosine(hit, normal), tint: pass.tint(hit.triangle) };
                let side = Side { facing: surface.facing, id: hit.triangle, shading: corrected::met(hit, surface) };
                visible(pass, (color, lit), (surface, side), Known::NOTHING, key, work)
            };
        return opaque(Walk { pass, shade, ways }.pixel(pixel, triangle, seen, key, work));
    }
    let facing = corrected::lit_side(&surface, stored_normal);
    let side = Side { facing, id: triangle, shading: corrected::seen(stored_normal) };
    let lit = || {
        let cosine = pass.position(pixel).w.max(0.0);
        Lit { normal: stored_normal.normalize_or(facing), cosine, tint: pass.tint(triangle) }
    };
    let color = pass.kept_to_eye(pixel) * Vec4::from_array(color).truncate();
    opaque(visible(pass, (color, lit), (&surface, side), known, key, work))
}

/// As [`corrected::prepare`]; where the colour of light matters, pixels that are lit through glass are left to compute
/// their own light.
pub fn prepare<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, area: Area, work: &mut Workspace) {
    corrected::prepare(pass, area, work);
    if matters(pass) {
        work.surfaces.forget_light_through_glass();
    }
}

/// Whether the colour of light behind glass matters, by the kind of shadow that the job requests.
fn matters<T, C>(pass: &Pass<'_, T, C>) -> bool {
    matches!(pass.job.params.shadow, GlassShadow::Straight | GlassShadow::Caustic)
}

/// As [`corrected::visible`], with coloured light behind glass and the light that spheres and meshes focus.
fn visible<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    (color, lit): (Vec3, impl FnOnce() -> Lit),
    (surface, side): (&Surface, Side),
    known: Known,
    key: u32,
    work: &mut Workspace,
) -> Vec3 {
    let focuses = !pass.focused.is_empty();
    let is_certain = color == Vec3::ZERO || pass.is_sky(side.id);
    if is_certain || !matters(pass) || (known.light.is_some() && !focuses) {
        return corrected::visible(pass, color, surface, (side, known), key, work);
    }
    let mut light = match known.light {
        Some(share) => Vec3::splat(share),
        None if pass.has_lights() => {
            let straight = |way: &Way<'_>, work: &mut Workspace| match way {
                Way::Ray(ray) => pass.straight_along(ray, 1.0, None, work),
                Way::Disc(disc) => pass.straight_over(disc, work),
            };
            pass.share_of_lights(&corrected::asked(surface, side, key), work, |hit| pass.stops_light(hit), straight)
        }
        None => pass.straight_light(surface, (side.facing, side.id), key, work),
    };
    if focuses {
        let lit = lit();
        light += (1.0 - SHADOWED) * pass.focused_light(surface, side.facing, &lit, work);
        light += (1.0 - SHADOWED) * pass.photon_light(surface, side.facing, &lit);
    }
    // The light is in the first factor; a share of 1 leaves only the occlusion to compute.
    light * corrected::visible(pass, color, surface, (side, Known { light: Some(1.0), ..known }), key, work)
}
