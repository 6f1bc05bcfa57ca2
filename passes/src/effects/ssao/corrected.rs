//! The program with hashed samples, exact ray origins, and the hemisphere on the viewer's side.

use crate::effects::{Area, Coverage, Pass, Pixel, Workspace, opaque, tile_occlusion};
use crate::trace::Tracer;
use glam::Vec3;

/// The occlusion in the colour channels, alpha 1; background pixels are 1.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let Some(triangle) = pass.triangle(pixel) else { return [1.0; 4] };
    let known = work.surfaces.known(work.place);
    if let Some(open) = known.occlusion {
        return opaque(Vec3::splat(open));
    }
    let (surface, _) = known.surface.unwrap_or_else(|| pass.surface_at(pixel, triangle, pass.normal(pixel)));
    let key = pass.key(pixel);
    opaque(Vec3::splat(pass.occlusion(&surface, key, work, |hit| pass.covers(hit))))
}

/// Computes the occlusion of a tile's pixels together, before the pixels need it.
pub fn prepare<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, area: Area, work: &mut Workspace) {
    work.surfaces.survey(pass, area, |_, _| true);
    tile_occlusion::prepare(pass, area, work, |hit| pass.covers(hit));
}
