//! The program as the report's `deferredShadows.cu` has it.

use crate::effects::light::SHADOWED;
use crate::effects::{Coverage, Pass, Pixel, Workspace};
use crate::trace::Tracer;

/// The light's share, in all four channels.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let position = pass.position(pixel);
    if position.w > 0.0 {
        work.rays.shadow += 1;
        if !pass.thesis_sees_light(position.truncate(), |_| true) {
            return [SHADOWED; 4];
        }
    }
    [1.0; 4]
}
