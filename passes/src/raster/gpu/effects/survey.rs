//! Which planes of glass a picture shows, asked on the device where the G-buffer is there.

use super::inputs::{Inputs, Ready};
use super::programs::compute_pipeline;
use super::shader::{self, GROUP, SEGMENT, SurveyUniform};
use super::table::Table;
use crate::raster::effects::mirrors::{Seen, Survey};
use crate::raster::effects::planes::{GlassPlane, Glazing};
use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::{BackendError, EffectJob};
use glam::Vec4;
use std::num::NonZeroU64;

/// Numbers of a plane in the shader.
const FIELDS: usize = 5;

/// The question, and what it is asked with.
#[derive(Debug)]
pub struct Surveyor {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    params: wgpu::Buffer,
    normals: Table,
    /// What is found, and where the host reads it.
    seen: [wgpu::Buffer; 2],
    found: Vec<u32>,
}

impl Surveyor {
    pub fn new(gpu: &Gpu, inputs: &Inputs) -> Result<Self, BackendError> {
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
        let label = Some("survey");
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label,
            entries: &[
                buffer(0, wgpu::BufferBindingType::Uniform, size_of::<SurveyUniform>()),
                buffer(1, storage(true), 0),
                buffer(2, storage(true), 0),
                buffer(3, storage(false), 0),
            ],
        });
        let pipeline = compute_pipeline(gpu, label, shader::survey_source(), [&inputs.layout, &layout]);
        let doing = "building the survey of the glass";
        gpu.check(doing)?;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let params = gpu.buffer(doing, usage, size_of::<SurveyUniform>() as u64)?;
        let seen = Self::buffers(gpu, 1024)?;
        Ok(Self { pipeline, layout, params, normals: Table::new(gpu)?, seen, found: Vec::new() })
    }

    fn buffers(gpu: &Gpu, bytes: u64) -> Result<[wgpu::Buffer; 2], BackendError> {
        use wgpu::BufferUsages as Usage;
        let doing = "building the survey of the glass";
        let found = gpu.buffer(doing, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC, bytes)?;
        Ok([found, gpu.buffer(doing, Usage::MAP_READ | Usage::COPY_DST, bytes)?])
    }

    /// Looks at all pixels, and waits. `runs` is the table of the glazing's runs.
    pub fn look(
        &mut self,
        gpu: &Gpu,
        ready: &Ready<'_>,
        job: &EffectJob<'_>,
        glazing: &Glazing,
        runs: &wgpu::Buffer,
    ) -> Result<Survey, BackendError> {
        let doing = "looking for the planes of glass";
        let normals: Vec<Vec4> = glazing.planes.iter().map(GlassPlane::agreement).collect();
        self.normals.write(gpu, bytemuck::cast_slice(&normals))?;
        self.found.clear();
        self.found.resize(FIELDS * (normals.len() + 1), 0);
        let bytes = size_of_val(self.found.as_slice()) as u64;
        if self.seen[0].size() < bytes {
            self.seen = Self::buffers(gpu, bytes.next_power_of_two())?;
        }
        let [seen, readable] = &self.seen;
        let resources = [&self.params, runs, &self.normals.buffer, seen].map(wgpu::Buffer::as_entire_binding);
        let entries: Vec<_> =
            (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let descriptor = wgpu::BindGroupDescriptor { label: Some("survey"), layout: &self.layout, entries: &entries };
        let group = gpu.device.create_bind_group(&descriptor);
        let size = [job.width, job.height];
        let params = SurveyUniform { size, id_base: ready.id_base, runs: glazing.runs.len() as u32 };
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("survey") });
        encoder.clear_buffer(seen, 0, None);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, ready.group, &[]);
            pass.set_bind_group(1, &group, &[]);
            pass.dispatch_workgroups(job.width.div_ceil(GROUP * SEGMENT), job.height.div_ceil(GROUP), 1);
        }
        encoder.copy_buffer_to_buffer(seen, 0, readable, 0, bytes);
        let found = &mut self.found;
        gpu.read_mapped(readable, bytes, Some(encoder.finish()), doing, |bytes| {
            bytemuck::cast_slice_mut(found).copy_from_slice(bytes);
        })?;
        let (all, planes) = self.found.as_chunks::<FIELDS>().0.split_first().unwrap_or((&[0; FIELDS], &[]));
        let planes = planes.iter().map(|&[pixels, left, top, right, bottom]| match pixels {
            0 => Seen::NONE,
            _ => Seen { pixels, low: [!left, !top], high: [right, bottom] },
        });
        Ok(Survey { planes: planes.collect(), glass: u64::from(all[0]) })
    }
}
