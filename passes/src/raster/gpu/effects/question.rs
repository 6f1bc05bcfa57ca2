//! Questions about a picture that is on the device: a shader reads all pixels of the G-buffer and writes a few numbers.

use super::bindings::{bind, layout, storage, uniform};
use super::inputs::Inputs;
use super::programs::compute_pipeline;
use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::BackendError;

/// The names of a question in error messages.
#[derive(Debug, Clone, Copy)]
pub struct Words {
    pub label: &'static str,
    /// What is done while the question is compiled.
    pub building: &'static str,
    /// What is done while the question runs.
    pub asking: &'static str,
}

/// A compiled question. Group 1 of the shader holds the shader's uniforms, the tables that the shader reads, and the answer.
#[derive(Debug)]
pub struct Question {
    words: Words,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    params: wgpu::Buffer,
    /// The buffer into which the device writes the answer, and the copy of it that the host reads.
    answer: [wgpu::Buffer; 2],
    /// The tables of the last call, and the bind group made for them.
    group: Option<(Vec<wgpu::Buffer>, wgpu::BindGroup)>,
}

impl Question {
    /// Compiles a shader that reads `params` bytes of uniforms and as many tables as `tables`.
    pub fn new(
        gpu: &Gpu,
        inputs: &Inputs,
        words: Words,
        source: String,
        params: usize,
        tables: usize,
    ) -> Result<Self, BackendError> {
        let read = (0..tables).map(|_| storage(true));
        let layout =
            layout(&gpu.device, words.label, [uniform(params)].into_iter().chain(read).chain([storage(false)]));
        let pipeline = compute_pipeline(gpu, Some(words.label), source, &[&inputs.layout, &layout]);
        gpu.check(words.building)?;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let params = gpu.buffer(words.building, usage, params as u64)?;
        let answer = Self::buffers(gpu, words, 1024)?;
        Ok(Self { words, pipeline, layout, params, answer, group: None })
    }

    fn buffers(gpu: &Gpu, words: Words, bytes: u64) -> Result<[wgpu::Buffer; 2], BackendError> {
        use wgpu::BufferUsages as Usage;
        let written = gpu.buffer(words.building, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC, bytes)?;
        Ok([written, gpu.buffer(words.building, Usage::MAP_READ | Usage::COPY_DST, bytes)?])
    }

    /// Runs the question in `columns` x `rows` workgroups, and waits for the answer. The device clears the answer to
    /// zeros first.
    pub fn ask(
        &mut self,
        gpu: &Gpu,
        gbuffer: &wgpu::BindGroup,
        tables: &[&wgpu::Buffer],
        params: &[u8],
        [columns, rows]: [u32; 2],
        answer: &mut [u32],
    ) -> Result<(), BackendError> {
        let Words { label, asking, .. } = self.words;
        let bytes = size_of_val(answer) as u64;
        if self.answer[0].size() < bytes {
            self.answer = Self::buffers(gpu, self.words, bytes.next_power_of_two())?;
            self.group = None;
        }
        let [written, readable] = &self.answer;
        let is_bound = |(bound, _): &(Vec<wgpu::Buffer>, _)| bound.iter().eq(tables.iter().copied());
        let (_, group) = match self.group.take().filter(is_bound) {
            Some(known) => self.group.insert(known),
            None => {
                let all = [&self.params].into_iter().chain(tables.iter().copied()).chain([written]);
                let group = bind(&gpu.device, label, &self.layout, all.map(wgpu::Buffer::as_entire_binding));
                self.group.insert((tables.iter().copied().cloned().collect(), group))
            }
        };
        gpu.queue.write_buffer(&self.params, 0, params);
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some(label) };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        encoder.clear_buffer(written, 0, Some(bytes));
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, gbuffer, &[]);
            pass.set_bind_group(1, &*group, &[]);
            pass.dispatch_workgroups(columns, rows, 1);
        }
        encoder.copy_buffer_to_buffer(written, 0, readable, 0, bytes);
        gpu.read_mapped(readable, bytes, Some(encoder.finish()), asking, |bytes| {
            bytemuck::cast_slice_mut(answer).copy_from_slice(bytes);
        })
    }
}
