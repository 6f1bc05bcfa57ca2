//! Screen-space rays from glass on the device: the pyramid, the picture without glass, and the counts of pixels.

use super::Context;
use super::bindings::{bind, layout, storage, uniform};
use super::inputs::Inputs;
use super::maps::submit;
use super::programs::compute_pipeline;
use super::shader::{self, GROUP, SUMS};
use super::uniforms::PyramidUniform;
use crate::raster::effects::screen::camera::ScreenCamera;
use crate::raster::effects::screen::pyramid::{Level, levels};
use crate::raster::gpu::cache::Kept;
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::draws::DrawList;
use crate::raster::gpu::faults::{failure, unsupported};
use crate::raster::gpu::job::check_scene;
use crate::raster::gpu::targets::{Stored, Targets};
use crate::raster::gpu::timer::Timer;
use curitiba_pipeline::backend::{Attachments, BackendError, EffectJob, LoadStore, Part, RasterJob, Rect};
use curitiba_pipeline::programs::RasterProgram;
use glam::Vec4;
use std::num::NonZeroU64;
use std::time::Instant;

/// Bytes between the uniforms of consecutive levels: the greatest alignment that devices require.
const STRIDE: u64 = 256;
/// Number of counts: glass pixels, glass pixels whose rays all hit a surface of the picture or leave the scene, and glass pixels that keep
/// some of their own colour.
const COUNTS: usize = 3;

/// Resources kept from picture to picture.
#[derive(Debug)]
pub struct Marching {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    pyramids: Kept<[u32; 2], Pyramid>,
    behind: Kept<[u32; 2], Targets>,
    /// The buffer of counts to which the program adds, and the copy of it that the host reads.
    counts: [wgpu::Buffer; 2],
}

/// The pyramid for pictures of one size.
#[derive(Debug)]
struct Pyramid {
    nearest: wgpu::Buffer,
    uniforms: wgpu::Buffer,
    levels: Vec<Level>,
    /// Bind groups of the program that builds the pyramid, one for each level.
    groups: Vec<wgpu::BindGroup>,
}

impl Marching {
    pub fn new(gpu: &Gpu, inputs: &Inputs) -> Result<Self, BackendError> {
        let doing = "building the march through the picture";
        let types = [uniform(size_of::<PyramidUniform>()), storage(false)];
        let layout = layout(&gpu.device, "pyramid", types);
        let pipeline = compute_pipeline(gpu, Some("pyramid"), shader::pyramid_source(), &[&inputs.layout, &layout]);
        gpu.check(doing)?;
        use wgpu::BufferUsages as Usage;
        let bytes = (SUMS as usize * COUNTS * size_of::<u32>()) as u64;
        let counts = [
            gpu.buffer(doing, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC, bytes)?,
            gpu.buffer(doing, Usage::MAP_READ | Usage::COPY_DST, bytes)?,
        ];
        Ok(Self { pipeline, layout, pyramids: Kept::default(), behind: Kept::default(), counts })
    }

    /// Bytes of device memory of all pyramids and pictures.
    pub fn bytes(&self) -> u64 {
        let pyramids: u64 = self.pyramids.values().map(|pyramid| pyramid.nearest.size()).sum();
        pyramids + self.behind.values().map(Targets::bytes).sum::<u64>()
    }

    /// The resources that the program binds: the last required pyramid and the counts; `None` before the first pyramid.
    pub fn resources(&self) -> Option<[wgpu::BindingResource<'_>; 2]> {
        Some([self.pyramids.last()?.nearest.as_entire_binding(), self.counts[0].as_entire_binding()])
    }

    /// Columns and rows of the picture of the last required pyramid; `None` before the first.
    pub fn size(&self) -> Option<[u32; 2]> {
        self.levels().first().map(|level| [level.width, level.height])
    }

    /// The levels of the last required pyramid; empty before the first.
    pub fn levels(&self) -> &[Level] {
        self.pyramids.last().map_or(&[], |pyramid| &pyramid.levels)
    }

    /// The bind group of the last required picture without glass; `None` before the first.
    pub fn behind_group(&self, gpu: &Gpu, inputs: &Inputs) -> Option<wgpu::BindGroup> {
        let targets = self.behind.last()?;
        Some(targets.group.get_or_init(|| inputs.bind(gpu, targets.views())).clone())
    }

    /// Makes a pyramid for pictures of this size available. `release` is as in [`Kept::require`].
    pub fn require(
        &mut self,
        gpu: &Gpu,
        size: [u32; 2],
        what: &str,
        release: impl FnOnce(),
    ) -> Result<(), BackendError> {
        let binding_layout = &self.layout;
        self.pyramids.require(gpu, size, release, |size| {
            let doing = "creation of the pyramid of depths";
            let known = levels(size[0], size[1]);
            let most = gpu.limits.max_storage_buffer_binding_size.min(gpu.max_buffer_bytes);
            let Some((levels, blocks)) = known.filter(|(_, blocks)| 4 * *blocks as u64 <= most) else {
                let why = format!("the depths of so many pixels are more than {} binds;", gpu.adapter);
                return Err(unsupported(&format!("{what} on {} x {} pixels", size[0], size[1]), &why));
            };
            use wgpu::BufferUsages as Usage;
            let nearest = gpu.buffer(doing, Usage::STORAGE, 4 * blocks as u64)?;
            let uniforms = gpu.buffer(doing, Usage::UNIFORM | Usage::COPY_DST, STRIDE * levels.len() as u64)?;
            let group = |index: usize| {
                let size = NonZeroU64::new(size_of::<PyramidUniform>() as u64);
                let own = wgpu::BufferBinding { buffer: &uniforms, offset: STRIDE * index as u64, size };
                let resources = [wgpu::BindingResource::Buffer(own), nearest.as_entire_binding()];
                bind(&gpu.device, "pyramid", binding_layout, resources)
            };
            let groups = (0..levels.len()).map(group).collect();
            gpu.check(doing)?;
            Ok(Pyramid { nearest, uniforms, levels, groups })
        })?;
        Ok(())
    }

    /// Fills the last required pyramid from a G-buffer of its size, and waits.
    pub fn build(
        &self,
        gpu: &Gpu,
        timer: Option<&Timer>,
        gbuffer: &wgpu::BindGroup,
        camera: &ScreenCamera,
    ) -> Result<Part, BackendError> {
        let start = Instant::now();
        let doing = "building the pyramid of depths";
        let Some(pyramid) = self.pyramids.last() else { return Err(failure("there is no pyramid")) };
        let mut bytes = vec![0_u8; STRIDE as usize * pyramid.levels.len()];
        for (index, (to, bytes)) in pyramid.levels.iter().zip(bytes.chunks_mut(STRIDE as usize)).enumerate() {
            let from = pyramid.levels[index.saturating_sub(1)];
            let params = PyramidUniform::new(camera, from, *to, index == 0);
            bytes[..size_of::<PyramidUniform>()].copy_from_slice(bytemuck::bytes_of(&params));
        }
        gpu.queue.write_buffer(&pyramid.uniforms, 0, &bytes);
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("pyramid") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        encoder.clear_buffer(&self.counts[0], 0, None);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("pyramid"),
                timestamp_writes: timer.and_then(|timer| timer.compute_span(true, true)),
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, gbuffer, &[]);
            for (level, group) in pyramid.levels.iter().zip(&pyramid.groups) {
                pass.set_bind_group(1, group, &[]);
                pass.dispatch_workgroups(level.width.div_ceil(GROUP), level.height.div_ceil(GROUP), 1);
            }
        }
        let device = submit(gpu, timer, encoder, true, doing)?;
        Ok(Part { host: start.elapsed(), device })
    }

    /// The counts since the pyramid was built: glass pixels, glass pixels whose rays all hit a surface of the picture or leave the scene, and
    /// glass pixels that keep some of their own colour.
    pub fn counted(&self, gpu: &Gpu) -> Result<[u64; COUNTS], BackendError> {
        let [written, readable] = &self.counts;
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("counts") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        encoder.copy_buffer_to_buffer(written, 0, readable, 0, readable.size());
        let mut sums = [0_u64; COUNTS];
        gpu.read_mapped(readable, readable.size(), Some(encoder.finish()), "counting pixels of glass", |bytes| {
            let counts: &[[u32; COUNTS]] = bytemuck::cast_slice(bytes);
            for count in counts {
                sums.iter_mut().zip(count).for_each(|(sum, count)| *sum += u64::from(*count));
            }
        })?;
        Ok(sums)
    }

    /// Makes the attachments of a picture without glass of this size available.
    pub fn require_behind(&mut self, gpu: &Gpu, size: [u32; 2]) -> Result<(), BackendError> {
        let stored = Stored::new(BEHIND, Attachments::default());
        // The bind group of the attachments belongs to them, so there is nothing else to release.
        self.behind.require(gpu, size, || {}, |[width, height]| Targets::new(gpu, *width, *height, stored))?;
        Ok(())
    }

    /// Draws the last required picture without glass, and waits. Returns the time, the number of triangles submitted,
    /// and the picture's bytes.
    pub fn draw_behind(
        &self,
        context: &mut Context<'_>,
        draws: &mut DrawList,
        job: &EffectJob<'_>,
    ) -> Result<(Part, u64, u64), BackendError> {
        let start = Instant::now();
        let Some(targets) = self.behind.last() else { return Err(failure("there is no picture without glass")) };
        let raster = RasterJob {
            scene: job.scene,
            program: RasterProgram::Deferred,
            view: job.view,
            lights: &[],
            sun: job.sun,
            shades: job.shades,
            // The picture shows what rays hit, so both sides of every triangle are drawn.
            culled: &[],
            viewport: Rect { x: 0, y: 0, width: job.width, height: job.height },
            clear_color: Vec4::ZERO,
            attachments: BEHIND,
            shared: Attachments::default(),
            half: Attachments::default(),
            snapped_depth: false,
            load_store: LoadStore::default(),
        };
        check_scene(&raster)?;
        let Context { gpu, layouts, pipelines, timer, geometry, textures, .. } = context;
        draws.leave_out(job.glass);
        draws.prepare(gpu, layouts, pipelines, geometry, textures, &raster)?;
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("behind glass") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        draws.record_planes(
            gpu,
            &mut encoder,
            layouts,
            geometry,
            timer.and_then(|timer| timer.compute_span(true, false)),
        );
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("behind glass"),
                color_attachments: &targets.color_attachments(raster.clear_color, None, [false; 4]),
                depth_stencil_attachment: Some(targets.depth_attachment(false, false)),
                timestamp_writes: timer.and_then(|timer| timer.render_span(!draws.has_planes(), true)),
                occlusion_query_set: None,
                multiview_mask: None,
            });
            draws.record(&mut pass, pipelines, geometry, textures);
        }
        let device = submit(gpu, *timer, encoder, true, "drawing what is behind glass")?;
        Ok((Part { host: start.elapsed(), device }, draws.triangles(), targets.bytes()))
    }
}

/// The attachments of the picture without glass.
const BEHIND: Attachments = Attachments { color: true, position: true, normal: true, triangle: false };
