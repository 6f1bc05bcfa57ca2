//! The program in corrected fidelity: it corrects the differences that are numbered in the documentation of `effects`.

use crate::effects::light::SHADOWED;
use crate::effects::lights::{Asked, Shading, Way};
use crate::effects::refraction::corrected::{Glass, Seen};
use crate::effects::surface::{FootprintOf, Surface};
use crate::effects::tile_surfaces::{Known, prepare_light};
use crate::effects::{Area, Coverage, Pass, Pixel, Workspace, opaque, tile_occlusion};
use crate::trace::{Hit, Tracer};
use glam::{Vec3, Vec4};

/// The colour of glass, or else the shadowed and occluded colour; alpha 1. Background pixels keep their colour.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let color = pass.job.color[pixel.index];
    let Some(triangle) = pass.triangle(pixel) else { return color };
    let stored_normal = pass.normal(pixel);
    let known = work.surfaces.known(work.place);
    let (surface, view) = known.surface.unwrap_or_else(|| pass.surface_at(pixel, triangle, stored_normal));
    let key = pass.key(pixel);
    if pass.is_glass(triangle) {
        let shade = |hit: &Hit, footprint: FootprintOf<C>, surface: &Surface, key: u32, work: &mut Workspace| {
            let color = pass.met_color(hit, footprint, surface);
            let side = Side { facing: surface.facing, id: hit.triangle, shading: met(hit, surface) };
            visible(pass, color, surface, (side, Known::NOTHING), key, work)
        };
        let seen = Seen { triangle, surface: &surface, view, cone: pass.cone_at(&surface) };
        return opaque(Glass { pass, shade }.blend(seen, 0, key, work));
    }
    let side = Side { facing: lit_side(&surface, stored_normal), id: triangle, shading: seen(stored_normal) };
    opaque(visible(pass, Vec4::from_array(color).truncate(), &surface, (side, known), key, work))
}

/// Prepares a tile: traces the shadow rays of its opaque pixels together and computes their occlusion.
pub fn prepare<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, area: Area, work: &mut Workspace) {
    work.surfaces.survey(pass, area, |pixel, triangle| {
        !pass.is_glass(triangle) && Vec4::from_array(pass.job.color[pixel.index]).truncate() != Vec3::ZERO
    });
    // With a disc or several lights, a pixel has enough shadow rays to trace them by itself.
    if pass.disc.is_some() || pass.has_lights() {
        return tile_occlusion::prepare(pass, area, work, |hit| pass.stops_light(hit));
    }
    let origin = |pixel: Pixel, known: &Known| {
        let Some(((surface, _), triangle)) = known.surface.zip(pass.triangle(pixel)) else { return (None, None) };
        let facing = lit_side(&surface, pass.normal(pixel));
        if pass.is_turned(triangle, surface.point(), (facing, pass.to_light)) {
            // A pixel whose triangle faces away may still be lit if the surface is round: it is left to compute its own light.
            let is_dark = facing.dot(pass.to_light) > 0.0 || pass.job.scene.geometry.normals.is_empty();
            return (is_dark.then_some(SHADOWED), None);
        }
        (None, Some(surface.origin(pass.to_light)))
    };
    let stops =
        |ray: u32, hit: &Hit, crossings: &mut Vec<(u32, f32)>| pass.blocks_light(hit, || crossings.push((ray, hit.t)));
    work.rays.shadow += prepare_light(pass, area, &mut work.surfaces, origin, stops);
    tile_occlusion::prepare(pass, area, work, |hit| pass.stops_light(hit));
}

/// The lit side of a surface: the side on which the stored normal lies, because the pixel's colour was lit by that normal.
pub(super) fn lit_side(surface: &Surface, stored_normal: Vec3) -> Vec3 {
    if stored_normal.dot(surface.facing) < 0.0 { -surface.facing } else { surface.facing }
}

/// The side of a surface whose light is computed.
#[derive(Clone, Copy)]
pub(super) struct Side {
    /// Unit geometric normal on this side.
    pub facing: Vec3,
    /// Id of the triangle or sphere.
    pub id: u32,
    pub shading: Shading,
}

/// The shading of a pixel, by its stored normal.
pub(super) fn seen(stored_normal: Vec3) -> Shading {
    Shading { normal: stored_normal, hit: None }
}

/// The shading of a surface that a ray hits.
pub(super) fn met(hit: &Hit, surface: &Surface) -> Shading {
    Shading { normal: surface.normal, hit: Some(*hit) }
}

/// The point of a surface, on one side, whose share of several lights is computed.
pub(super) fn asked<'s>(surface: &'s Surface, Side { facing, id, shading }: Side, key: u32) -> Asked<'s> {
    Asked { point: surface.point(), facing, id, shading, key }
}

/// A colour times the light's share and the ambient occlusion on a side of the surface. The light or the occlusion is computed if `known` lacks it.
/// Black and the colour of a sky are returned unchanged, without a ray.
pub(super) fn visible<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    color: Vec3,
    surface: &Surface,
    (side, known): (Side, Known),
    key: u32,
    work: &mut Workspace,
) -> Vec3 {
    if color == Vec3::ZERO || pass.is_sky(side.id) {
        return color;
    }
    if pass.has_lights() && known.light.is_none() {
        let stops = |hit: &Hit| pass.stops_light(hit);
        let passes = |way: &Way<'_>, work: &mut Workspace| pass.passes(way, work);
        let light = pass.share_of_lights(&asked(surface, side, key), work, stops, passes);
        let open = known.occlusion.unwrap_or_else(|| pass.occlusion(surface, key, work, stops));
        return color * light * open;
    }
    let light = known.light.unwrap_or_else(|| pass.light_share(surface, (side.facing, side.id), key, work));
    let open = known.occlusion.unwrap_or_else(|| pass.occlusion(surface, key, work, |hit| pass.stops_light(hit)));
    color * light * open
}
