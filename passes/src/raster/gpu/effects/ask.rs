//! Tests whether a picture needs maps at all, on the device that holds the G-buffer.

use super::inputs::Inputs;
use super::question::{Question, Words};
use super::shader::{self, GROUP};
use super::uniforms::AskUniform;
use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::BackendError;

const WORDS: Words = Words {
    label: "ask",
    building: "building the question whether maps are called for",
    asking: "asking whether maps are called for",
};

/// The question whether any pixel needs maps, for one kind of effect: shadow maps, or effects on glass.
#[derive(Debug)]
pub struct Ask {
    question: Question,
    glass: bool,
}

impl Ask {
    /// With `glass`, the question for pixels that show glass; else for pixels that face the light.
    pub fn new(gpu: &Gpu, inputs: &Inputs, glass: bool) -> Result<Self, BackendError> {
        let source = shader::ask_source(glass);
        let question = Question::new(gpu, inputs, WORDS, source, size_of::<AskUniform>(), 1)?;
        Ok(Self { question, glass })
    }

    /// Nearest and farthest depth of the pixels that need maps, both 0 for effects on glass; `None` if no pixel needs
    /// maps. Waits for the device. `glass` is the table of glass triangles.
    pub fn any(
        &mut self,
        gpu: &Gpu,
        gbuffer: &wgpu::BindGroup,
        glass: &wgpu::Buffer,
        params: AskUniform,
    ) -> Result<Option<[f32; 2]>, BackendError> {
        // The members of `Found` in the shader.
        let mut found = [0_u32; 3];
        let groups = params.size.map(|pixels| pixels.div_ceil(GROUP));
        self.question.ask(gpu, gbuffer, &[glass], bytemuck::bytes_of(&params), groups, &mut found)?;
        let [any, nearest, farthest] = found;
        let depths = if self.glass { [0.0; 2] } else { [!nearest, farthest].map(f32::from_bits) };
        Ok((any != 0).then_some(depths))
    }
}
