//! Segments between triangles: the processor makes the segments, and the device finds which of them are blocked.

use super::NAME;
use super::kernels::compile;
use super::launches::{next_size, wanted};
use super::programs;
use super::scene::{TreeBuffers, too_large};
use super::selftest;
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::faults::of_rays;
use crate::raster::gpu::resources::{entry, rectangle};
use crate::raster::gpu::{AdapterChoice, SharedDevice};
use crate::trace::{Segment, SegmentTracer, Segments};
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::scene::Geometry;
use std::sync::Arc;
use std::time::Instant;

/// Segments that a workgroup traces.
const GROUP: u32 = 64;
/// Workgroups of the first launch, when the speed of the device is unknown.
const FIRST_GROUPS: u32 = 64;
/// Size in bytes of the buffer that holds a launch's range of segments.
const PART_BYTES: u64 = 16;

/// Traces segments on a GPU, or on a software driver that acts as one.
#[derive(Debug)]
pub struct WgpuSegments {
    gpu: Arc<Gpu>,
    tree: TreeBuffers,
    pipeline: wgpu::ComputePipeline,
    parameters: wgpu::Buffer,
    part: wgpu::Buffer,
    /// Buffers for segments, the ids of each pair of triangles, the results (one bit a segment), and the copy of the results that the host reads;
    /// `None` before the first call.
    room: Option<[wgpu::Buffer; 4]>,
    /// Number of workgroups of the next launch.
    groups: u32,
}

impl WgpuSegments {
    /// A tracer for the triangles of a scene, on the best device that `choice` allows; triangles of materials that `see_through` marks
    /// block nothing.
    ///
    /// # Errors
    /// If there is no device, it lacks something, or it cannot hold the scene; the message says what, and what to do.
    pub fn new(choice: AdapterChoice, geometry: &Geometry, see_through: &[bool]) -> Result<Self, BackendError> {
        let gpu = SharedDevice::open(choice).map_err(of_rays)?.0;
        let found = gpu.limits.max_storage_buffers_per_shader_stage;
        if found < 5 || gpu.limits.max_compute_invocations_per_workgroup < GROUP {
            let why = format!(
                "it binds {found} storage buffers, and the program needs 5 in groups of {GROUP} threads; `--backend cpu` traces \
                 without a GPU"
            );
            return Err(BackendError::Unsupported { backend: NAME, what: format!("on {}", gpu.adapter), why });
        }
        Self::prepare(gpu, geometry, see_through).map_err(of_rays)
    }

    fn prepare(gpu: Arc<Gpu>, geometry: &Geometry, see_through: &[bool]) -> Result<Self, BackendError> {
        let tree = TreeBuffers::new(&gpu, geometry, see_through)?;
        let source = programs::segments(selftest::arithmetic(&gpu)?);
        let pipeline = compile(&gpu, None, &source, "compiling the program of segments")?;
        let (usage, copied) = (gpu.parameters.usage(), wgpu::BufferUsages::COPY_DST);
        Ok(Self {
            parameters: gpu.upload_buffer("parameters", usage, bytemuck::bytes_of(&tree.params))?,
            part: gpu.buffer("part", usage | copied, PART_BYTES)?,
            gpu,
            tree,
            pipeline,
            room: None,
            groups: FIRST_GROUPS,
        })
    }

    /// Buffers of at least these sizes in bytes, for segments, pairs of triangles and results.
    fn room(&mut self, bytes: [u64; 3]) -> Result<[wgpu::Buffer; 4], BackendError> {
        let fits = |room: &[wgpu::Buffer; 4]| room.iter().zip(bytes).all(|(buffer, bytes)| buffer.size() >= bytes);
        if let Some(room) = self.room.as_ref().filter(|room| fits(room)) {
            return Ok(room.clone());
        }
        self.room = None;
        let most = self.gpu.limits.max_storage_buffer_binding_size.min(self.gpu.max_buffer_bytes);
        let [segments, own, answers] = bytes;
        for (what, bytes) in [("the segments", segments), ("the pairs of the segments", own)] {
            if bytes > most {
                return Err(too_large(&self.gpu, what, bytes, most));
            }
        }
        let (storage, to) = (wgpu::BufferUsages::STORAGE, wgpu::BufferUsages::COPY_DST);
        let (from, read) = (wgpu::BufferUsages::COPY_SRC, wgpu::BufferUsages::MAP_READ);
        let room = [
            self.gpu.buffer("segments", storage | to, segments)?,
            self.gpu.buffer("pairs of segments", storage | to, own)?,
            self.gpu.buffer("answers", storage | from, answers)?,
            self.gpu.buffer("answers", read | to, answers)?,
        ];
        self.room = Some(room.clone());
        Ok(room)
    }

    fn trace(&mut self, segments: &[Segment], own: &[[u32; 2]], bits: &mut [u32]) -> Result<(), BackendError> {
        let answers = size_of_val(bits) as u64;
        let sizes = [size_of_val(segments) as u64, size_of_val(own) as u64, answers];
        // Empty buffers cannot be bound, and sizes must be multiples of the largest element.
        let sizes = sizes.map(|bytes| bytes.next_multiple_of(16).max(16));
        let [all, pairs, found, readable] = self.room(sizes)?;
        let gpu = Arc::clone(&self.gpu);
        gpu.queue.write_buffer(&all, 0, bytemuck::cast_slice(segments));
        gpu.queue.write_buffer(&pairs, 0, bytemuck::cast_slice(own));
        let group = |index: u32, buffers: &[(u32, &wgpu::Buffer)]| {
            let entries: Vec<_> = buffers.iter().map(|(binding, buffer)| entry(*binding, buffer)).collect();
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("segments"),
                layout: &self.pipeline.get_bind_group_layout(index),
                entries: &entries,
            })
        };
        let buffers = [(0, &self.parameters), (8, &all), (9, &pairs), (10, &found), (11, &self.part)];
        let groups = [group(0, &buffers), group(1, &[(0, &self.tree.nodes), (1, &self.tree.triangles)])];
        gpu.check("binding of the segments")?;
        let count = segments.len() as u32;
        let mut first = 0;
        while first < count {
            let taken = self.groups.min((count - first).div_ceil(GROUP)).max(1);
            let end = count.min(first + taken * GROUP);
            gpu.queue.write_buffer(&self.part, 0, bytemuck::bytes_of(&[first, end, 0, 0]));
            let [across, down] = rectangle(taken, gpu.limits.max_compute_workgroups_per_dimension);
            let descriptor = wgpu::CommandEncoderDescriptor { label: Some("segments") };
            let mut encoder = gpu.device.create_command_encoder(&descriptor);
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_pipeline(&self.pipeline);
                for (index, group) in (0..).zip(&groups) {
                    pass.set_bind_group(index, group, &[]);
                }
                pass.dispatch_workgroups(across, down, 1);
            }
            let start = Instant::now();
            gpu.submit_and_wait(Some(encoder.finish()), "tracing segments")?;
            if taken == self.groups {
                self.groups = next_size(taken, start.elapsed(), wanted(&self.gpu));
            }
            first = end;
        }
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("answers") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        encoder.copy_buffer_to_buffer(&found, 0, &readable, 0, answers);
        gpu.read_mapped(&readable, answers, Some(encoder.finish()), "reading the answers", |bytes| {
            bits.copy_from_slice(bytemuck::cast_slice(bytes));
        })
    }
}

impl SegmentTracer for WgpuSegments {
    fn name(&self) -> &'static str {
        NAME
    }

    fn device(&self) -> String {
        self.gpu.adapter.to_string()
    }

    fn blocked(&mut self, segments: &Segments, bits: &mut Vec<u32>) -> Result<(), BackendError> {
        bits.clear();
        bits.resize(segments.all.len().div_ceil(32), 0);
        let most = self.gpu.limits.max_storage_buffer_binding_size.min(self.gpu.max_buffer_bytes);
        // Whole words of results, and few enough segments to be counted in 32 bits.
        let most = (most / size_of::<Segment>() as u64).clamp(1, 1 << 24) as usize / 64 * 64;
        for (all, bits) in segments.all.chunks(most).zip(bits.chunks_mut(most / 32)) {
            self.trace(all, &segments.own, bits).map_err(of_rays)?;
        }
        Ok(())
    }
}
