//! Whether a picture calls for maps at all, asked on the device where the G-buffer is there.

use super::inputs::Inputs;
use super::programs::compute_pipeline;
use super::shader::GROUP;
use super::shader::{self, AskUniform};
use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::BackendError;
use std::num::NonZeroU64;

/// Of `Found` in the shader.
const BYTES: u64 = size_of::<[u32; 3]>() as u64;

/// The question for one kind of map.
#[derive(Debug)]
pub struct Ask {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    params: wgpu::Buffer,
    found: wgpu::Buffer,
    readable: wgpu::Buffer,
    /// With the table of glass that it was bound to.
    group: Option<(wgpu::Buffer, wgpu::BindGroup)>,
    glass: bool,
}

impl Ask {
    /// For a pixel that shows glass, or one that faces the light.
    pub fn new(gpu: &Gpu, inputs: &Inputs, glass: bool) -> Result<Self, BackendError> {
        let buffer = |binding, ty, size: usize| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty,
                has_dynamic_offset: false,
                min_binding_size: NonZeroU64::new(size as u64),
            },
            count: None,
        };
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let label = Some("ask");
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label,
            entries: &[
                buffer(0, wgpu::BufferBindingType::Uniform, size_of::<AskUniform>()),
                buffer(1, storage(true), 0),
                buffer(2, storage(false), BYTES as usize),
            ],
        });
        let pipeline = compute_pipeline(gpu, label, shader::ask_source(glass), [&inputs.layout, &layout]);
        let doing = "building the question whether maps are called for";
        gpu.check(doing)?;
        use wgpu::BufferUsages as Usage;
        let params = gpu.buffer(doing, Usage::UNIFORM | Usage::COPY_DST, size_of::<AskUniform>() as u64)?;
        let found = gpu.buffer(doing, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC, BYTES)?;
        let readable = gpu.buffer(doing, Usage::MAP_READ | Usage::COPY_DST, BYTES)?;
        Ok(Self { pipeline, layout, params, found, readable, group: None, glass })
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
        let doing = "asking whether maps are called for";
        let group = match self.group.take().filter(|(table, _)| table == glass) {
            Some((_, group)) => group,
            None => {
                let resources = [&self.params, glass, &self.found].map(wgpu::Buffer::as_entire_binding);
                let entries: Vec<_> = (0..)
                    .zip(resources)
                    .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                    .collect();
                let descriptor =
                    wgpu::BindGroupDescriptor { label: Some("ask"), layout: &self.layout, entries: &entries };
                gpu.device.create_bind_group(&descriptor)
            }
        };
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("ask") });
        encoder.clear_buffer(&self.found, 0, None);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, gbuffer, &[]);
            pass.set_bind_group(1, &group, &[]);
            let [width, height] = params.size;
            pass.dispatch_workgroups(width.div_ceil(GROUP), height.div_ceil(GROUP), 1);
        }
        encoder.copy_buffer_to_buffer(&self.found, 0, &self.readable, 0, BYTES);
        self.group = Some((glass.clone(), group));
        let mut found = [0_u32; 3];
        gpu.read_mapped(&self.readable, BYTES, Some(encoder.finish()), doing, |bytes| {
            bytemuck::cast_slice_mut(&mut found).copy_from_slice(bytes);
        })?;
        let [any, nearest, farthest] = found;
        let depths = if self.glass { [0.0; 2] } else { [!nearest, farthest].map(f32::from_bits) };
        Ok((any != 0).then_some(depths))
    }
}
