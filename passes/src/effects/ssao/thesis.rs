//! The program as the report's `ssao.cu` has it: every pixel is computed, background included.

use crate::effects::{Coverage, Pass, Pixel, Workspace};
use crate::trace::Tracer;

/// The occlusion, in all four channels.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let position = pass.position(pixel).truncate();
    [pass.thesis_occlusion(position, pass.normal(pixel), work, |_| true); 4]
}
