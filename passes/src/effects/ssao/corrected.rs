//! With hashed samples, exact origins, and the hemisphere on the viewer's side.

use crate::effects::{Coverage, Pass, Pixel, Workspace, opaque};
use crate::sampling::hash::pixel_key;
use crate::trace::Tracer;
use glam::Vec3;

/// The occlusion, alpha 1; background pixels are 1.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let Some(triangle) = pass.triangle(pixel) else { return [1.0; 4] };
    let (surface, _) = pass.surface_at(pixel, triangle, pass.normal(pixel));
    let key = pixel_key(pixel.x, pixel.y, pass.job.seed);
    opaque(Vec3::splat(pass.occlusion(&surface, key, work, |hit| pass.coverage.covers(hit))))
}
