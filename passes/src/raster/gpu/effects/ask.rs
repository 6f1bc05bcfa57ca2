//! Whether a picture calls for maps at all, asked on the device where the G-buffer is there.

use super::inputs::Inputs;
use super::question::{Question, Words};
use super::shader::{self, AskUniform, GROUP};
use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::BackendError;

const WORDS: Words = Words {
    label: "ask",
    building: "building the question whether maps are called for",
    asking: "asking whether maps are called for",
};

/// The question for one kind of map.
#[derive(Debug)]
pub struct Ask {
    question: Question,
    glass: bool,
}

impl Ask {
    /// For a pixel that shows glass, or one that faces the light.
    pub fn new(gpu: &Gpu, inputs: &Inputs, glass: bool) -> Result<Self, BackendError> {
        let source = shader::ask_source(glass);
        let question = Question::new(gpu, inputs, WORDS, source, size_of::<AskUniform>(), 1)?;
        Ok(Self { question, glass })
    }

    /// The least and the largest depth of the pixels that do, 0 in the question for glass; `None` if no pixel does. Waits.
    /// `glass` is the table of glass.
    pub fn any(
        &mut self,
        gpu: &Gpu,
        gbuffer: &wgpu::BindGroup,
        glass: &wgpu::Buffer,
        params: AskUniform,
    ) -> Result<Option<[f32; 2]>, BackendError> {
        // `Found` of the shader.
        let mut found = [0_u32; 3];
        let groups = params.size.map(|pixels| pixels.div_ceil(GROUP));
        self.question.ask(gpu, gbuffer, &[glass], bytemuck::bytes_of(&params), groups, &mut found)?;
        let [any, nearest, farthest] = found;
        let depths = if self.glass { [0.0; 2] } else { [!nearest, farthest].map(f32::from_bits) };
        Ok((any != 0).then_some(depths))
    }
}
