//! `dummy`: writes the input colour. Its cost is the cost of connecting the rasteriser to the ray tracer.

use crate::effects::{Pixel, Workspace};
use curitiba_pipeline::backend::RayJob;

/// The pixel's colour, alpha included. A backend in host memory copies the whole image instead.
#[must_use]
pub fn pixel(job: &RayJob<'_>, pixel: Pixel, _: &mut Workspace) -> [f32; 4] {
    job.color[pixel.index]
}
