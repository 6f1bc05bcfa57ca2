//! Pixel programs: compute shaders that read the G-buffer and maps, and write every output pixel.

use super::bindings::{bind, layout, storage, texture, uniform};
use super::inputs::Inputs;
use super::maps::{gives_up, submit};
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::faults::unsupported;
use crate::raster::gpu::timer::Timer;
use curitiba_pipeline::backend::{BackendError, Part};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::raster_effects::EffectProgram;
use std::time::Instant;

use super::shader::{self, LARGE_GROUP, Variant};
use super::uniforms::{self, FrameUniform};

/// The output's format.
pub const OUTPUT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
/// The format of the shares that a filter reads.
pub const SHARE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;
/// Approximate number of texels that one submission reads. Drivers abort work that runs for seconds; this much takes a
/// tenth of a second on slow hardware.
const TEXELS_PER_SUBMISSION: u64 = 1 << 30;

/// A compiled program, and its uniforms on the device.
#[derive(Debug)]
pub struct Program {
    pipeline: wgpu::ComputePipeline,
    /// Pixels along a side of a workgroup.
    group: u32,
    /// Layout of group 1.
    layout: wgpu::BindGroupLayout,
    frame: wgpu::Buffer,
    params: wgpu::Buffer,
}

/// Compiles a shader of this folder. Group 0 is the G-buffer, group 1 the program's own resources; some shaders have a
/// second G-buffer as group 2.
pub fn compute_pipeline(
    gpu: &Gpu,
    label: Option<&str>,
    source: String,
    layouts: &[&wgpu::BindGroupLayout],
) -> wgpu::ComputePipeline {
    let module = gpu
        .device
        .create_shader_module(wgpu::ShaderModuleDescriptor { label, source: wgpu::ShaderSource::Wgsl(source.into()) });
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &layouts.iter().copied().map(Some).collect::<Vec<_>>(),
        immediate_size: 0,
    });
    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&layout),
        module: &module,
        entry_point: Some(shader::ENTRY),
        compilation_options: wgpu::PipelineCompilationOptions {
            // Programs write workgroup memory before they read it.
            zero_initialize_workgroup_memory: false,
            ..wgpu::PipelineCompilationOptions::default()
        },
        cache: None,
    })
}

/// The types of a program's resources besides its uniforms and the output, in the order of their bindings from 3 on.
fn resources(variant: Variant) -> Vec<wgpu::BindingType> {
    use wgpu::TextureViewDimension::D2Array;
    match variant.program {
        _ if variant.filter => {
            vec![texture(wgpu::TextureSampleType::Float { filterable: false }, wgpu::TextureViewDimension::D2)]
        }
        EffectProgram::ShadowMap => vec![texture(wgpu::TextureSampleType::Depth, D2Array)],
        EffectProgram::CubeReflection | EffectProgram::CubeRefraction | EffectProgram::PlanarReflection => {
            let colors = wgpu::TextureSampleType::Float { filterable: false };
            vec![texture(colors, D2Array), storage(true), storage(true)]
        }
        EffectProgram::ScreenReflection | EffectProgram::ScreenRefraction => {
            let colors = wgpu::TextureSampleType::Float { filterable: false };
            vec![texture(colors, D2Array), storage(true), storage(true), storage(true), storage(false)]
        }
        EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => {
            vec![texture(wgpu::TextureSampleType::Float { filterable: false }, wgpu::TextureViewDimension::D2)]
        }
    }
}

/// The bind groups of a program, and the work that must run before the program.
pub struct Bound<'a> {
    /// The program's bind groups, by index.
    pub groups: &'a [&'a wgpu::BindGroup],
    /// Records the computation that must run before the program; `None` if there is none.
    pub before: Option<&'a dyn Fn(&mut wgpu::ComputePass<'_>)>,
}

impl Program {
    pub fn new(gpu: &Gpu, inputs: &Inputs, variant: Variant) -> Result<Self, BackendError> {
        let program = variant.program;
        let limits = &gpu.limits;
        let most = limits.max_compute_invocations_per_workgroup;
        let group = variant.group();
        if most < group * group || limits.max_compute_workgroup_size_x.min(limits.max_compute_workgroup_size_y) < group
        {
            let why = format!("{} has no compute shaders of {group} x {group} threads;", gpu.adapter);
            return Err(unsupported(program.info().name, &why));
        }
        let output = wgpu::BindingType::StorageTexture {
            access: wgpu::StorageTextureAccess::WriteOnly,
            format: if variant.share { SHARE_FORMAT } else { OUTPUT_FORMAT },
            view_dimension: wgpu::TextureViewDimension::D2,
        };
        let params_bytes = uniforms::params_bytes(variant);
        let types = [uniform(size_of::<FrameUniform>()), uniform(params_bytes), output];
        let label = program.info().name;
        let layout = layout(&gpu.device, label, types.into_iter().chain(resources(variant)));
        let source = shader::source(variant);
        let layouts = [&inputs.layout, &layout, &inputs.layout];
        let count = if shader::reads_behind(program) { 3 } else { 2 };
        let pipeline = compute_pipeline(gpu, Some(label), source, &layouts[..count]);
        gpu.check(&format!("building the program {label}"))?;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let frame = gpu.buffer("creation of an effect's uniforms", usage, size_of::<FrameUniform>() as u64)?;
        let params = gpu.buffer("creation of an effect's uniforms", usage, params_bytes as u64)?;
        Ok(Self { pipeline, group, layout, frame, params })
    }

    /// Binds the output, and the program's resources besides the G-buffer.
    pub fn bind(
        &self,
        gpu: &Gpu,
        output: &wgpu::TextureView,
        resources: &[wgpu::BindingResource<'_>],
    ) -> Result<wgpu::BindGroup, BackendError> {
        let own = [
            self.frame.as_entire_binding(),
            self.params.as_entire_binding(),
            wgpu::BindingResource::TextureView(output),
        ];
        let group = bind(&gpu.device, "effect", &self.layout, own.into_iter().chain(resources.iter().cloned()));
        gpu.check("binding of an effect's maps")?;
        Ok(group)
    }

    /// Computes every pixel, split into short submissions, and waits. If the pass is given up, the remaining rows are not computed.
    pub fn run(
        &self,
        gpu: &Gpu,
        timer: Option<&Timer>,
        bound: &Bound<'_>,
        params: &[u8],
        task: &Task,
        progress: &Progress,
    ) -> Result<Part, BackendError> {
        let start = Instant::now();
        let doing = "computing an effect";
        gpu.queue.write_buffer(&self.params, 0, params);
        let mut device = None;
        for band in task.bands() {
            if gives_up(gpu, progress, doing)? {
                return Ok(Part { host: start.elapsed(), device: None });
            }
            let frame = FrameUniform::new(task.width, task.height, band.start, task.id_base);
            gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
            gpu.check(doing)?;
            let (is_first, is_last) = (band.start == 0, band.end == task.height);
            let descriptor = wgpu::CommandEncoderDescriptor { label: Some("effect") };
            let mut encoder = gpu.device.create_command_encoder(&descriptor);
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("effect"),
                    timestamp_writes: timer.and_then(|timer| timer.compute_span(is_first, is_last)),
                });
                if let Some(before) = bound.before.filter(|_| is_first) {
                    before(&mut pass);
                }
                pass.set_pipeline(&self.pipeline);
                for (index, group) in (0..).zip(bound.groups.iter().copied()) {
                    pass.set_bind_group(index, group, &[]);
                }
                let groups = |pixels: u32| pixels.div_ceil(self.group * task.apart) * task.apart;
                pass.dispatch_workgroups(groups(task.width), groups(band.end - band.start), 1);
            }
            device = submit(gpu, timer, encoder, is_last, doing)?;
            progress.advance(1);
        }
        Ok(Part { host: start.elapsed(), device })
    }
}

/// The size of a program's work.
#[derive(Debug, Clone, Copy)]
pub struct Task {
    pub width: u32,
    pub height: u32,
    pub id_base: u32,
    /// Approximate number of texels read for each pixel.
    pub texels: u64,
    /// Distance in the picture between pixels that are neighbours in a workgroup.
    pub apart: u32,
}

impl Task {
    /// The rows of each submission; whole workgroups, except for the last.
    fn bands(self) -> impl Iterator<Item = std::ops::Range<u32>> {
        let per_row = self.texels.max(1) * u64::from(self.width);
        let rows = u32::try_from(TEXELS_PER_SUBMISSION / per_row.max(1)).unwrap_or(u32::MAX);
        let rows = (rows.min(self.height) / LARGE_GROUP * LARGE_GROUP).max(LARGE_GROUP);
        let height = self.height;
        (0..height).step_by(rows as usize).map(move |first| first..first.saturating_add(rows).min(height))
    }

    /// Number of submissions.
    pub fn submissions(self) -> u64 {
        self.bands().count() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn submissions_cover_every_row_once_and_are_short() {
        for (width, height, texels) in
            [(1, 1, 1), (1024, 1024, 3), (3840, 2160, 8192), (16_384, 16_384, 8192), (8, 9, 9)]
        {
            let task = Task { width, height, id_base: 0, texels, apart: 1 };
            let mut next = 0;
            for band in task.bands() {
                assert_eq!(band.start, next);
                assert!(band.end > band.start && (band.end % LARGE_GROUP == 0 || band.end == height));
                let work = u64::from(band.end - band.start) * u64::from(width) * texels;
                assert!(
                    work <= TEXELS_PER_SUBMISSION || band.end - band.start <= LARGE_GROUP,
                    "{width} {height} {work}"
                );
                next = band.end;
            }
            assert_eq!(next, height);
        }
    }
}
