//! The shared memory, and the shader that writes to it.
//!
//! A compute shader writes the attachments into dense buffers, because the memory layout of textures is known only to
//! the driver, and copies from textures to buffers pad their rows. Limit: ownership is not transferred between queue
//! families. NVIDIA's driver does not require this transfer.

use super::vulkan::{self, Semaphore};
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::faults::failure;
use crate::raster::gpu::quads::{Source, absent};
use crate::raster::gpu::targets::{CHANNELS, TRIANGLE, Targets, in_order};
use crate::raster::gpu::timer::Timer;
use curitiba_pipeline::backend::{Attachments, BackendError, HandOver, RasterJob};
use curitiba_pipeline::device_quad::{DeviceQuad, DeviceSource, OnDevice};
use curitiba_pipeline::shared::{DeviceUuid, Offsets, SharedGBuffer, after_picture};
use std::fmt::Write as _;
use std::num::NonZeroU64;
use std::time::Instant;

/// Pixels along a side of a workgroup.
const GROUP: u32 = 8;

/// The shared memory, the shader that writes to it, and the semaphore that is signalled after the write.
#[derive(Debug)]
pub struct Sharing {
    pub(super) packer: Packer,
    semaphore: Semaphore,
    /// Value of the semaphore after the last hand-over.
    value: u64,
    /// Offset in the packer's buffer of the space for the picture of a ray pass; `None` if there is no such space.
    picture: Option<u64>,
}

impl Sharing {
    pub fn new(
        gpu: &Gpu,
        device: DeviceUuid,
        [width, height]: [u32; 2],
        attachments: Attachments,
        picture: bool,
    ) -> Result<(Self, SharedGBuffer), BackendError> {
        let Offsets { picture: picture_at, end: bytes, .. } = Offsets::new(width, height, attachments, picture);
        let wrong = |why: String| failure(&format!("sharing {bytes} bytes on {}: {why}", gpu.adapter));
        let largest = gpu.max_buffer_bytes.min(gpu.limits.max_storage_buffer_binding_size);
        if bytes == 0 || bytes > largest {
            return Err(wrong(format!("between 1 and {largest} bytes can be shared")));
        }
        let (buffer, memory, bytes) = vulkan::buffer(&gpu.device, bytes).map_err(wrong)?;
        let (semaphore, handle) = Semaphore::new(&gpu.device).map_err(wrong)?;
        let packer = Packer::new(buffer, [width, height], attachments);
        gpu.check("sharing memory")?;
        let shared = SharedGBuffer { device, width, height, attachments, picture, memory, bytes, semaphore: handle };
        Ok((Self { packer, semaphore, value: 0, picture: picture_at }, shared))
    }
}

/// Records in `encoder`, after the draw, the copy of the attachments to shared memory. The next submission also signals the
/// semaphore. `None` if the job shares nothing.
pub fn hand_over(
    gpu: &Gpu,
    sharing: Option<&mut Sharing>,
    timer: Option<&Timer>,
    targets: &Targets,
    job: &RasterJob<'_>,
    encoder: &mut wgpu::CommandEncoder,
) -> Result<Option<HandOver>, BackendError> {
    if job.shared == Attachments::default() {
        return Ok(None);
    }
    let sharing = sharing.ok_or_else(|| failure("no memory is shared"))?;
    let start = Instant::now();
    sharing.packer.encode(gpu, timer, targets, job.shared, encoder)?;
    // The semaphore's value between those of two hand-overs belongs to the ray pass's picture.
    sharing.value = after_picture(sharing.value) + 1;
    if !sharing.semaphore.signal_after_next(&gpu.queue, sharing.value) {
        return Err(failure("the device's queue is not Vulkan's"));
    }
    Ok(Some(HandOver { value: sharing.value, host: start.elapsed(), device: None }))
}

/// The source of a quad: an attachment of the last draw, or the picture that a ray pass wrote into the shared memory. An error if it is
/// missing or does not have the quad's size.
pub fn quad_source(
    sharing: &Sharing,
    drawn: Option<&Targets>,
    quad: &DeviceQuad,
    source: DeviceSource,
) -> Result<Source, BackendError> {
    let size = (quad.width, quad.height);
    let found = match source.place {
        OnDevice::Drawn { value, channel } => {
            let drawn = drawn.filter(|drawn| sharing.value == value && drawn.size() == size && channel < TRIANGLE);
            drawn.and_then(|drawn| drawn.views()[channel].cloned()).map(Source::Texture)
        }
        OnDevice::Made(_) => {
            let at = sharing.picture.filter(|_| (sharing.packer.width, sharing.packer.height) == size);
            at.map(|at| Source::Buffer(sharing.packer.buffer.clone(), at))
        }
    };
    found.ok_or_else(|| absent(source))
}

/// Makes the next submission wait until a ray pass has written its picture into the shared memory, if the quad reads it.
pub fn wait_for_picture(sharing: &Sharing, gpu: &Gpu, quad: &DeviceQuad) -> Result<(), BackendError> {
    let is_picture = |source: DeviceSource| matches!(source.place, OnDevice::Made(_));
    if !(is_picture(quad.color) || quad.factor.is_some_and(is_picture))
        || sharing.semaphore.wait_before_next(&gpu.queue, after_picture(sharing.value))
    {
        return Ok(());
    }
    Err(failure("the device's queue is not Vulkan's"))
}

/// Writes attachments into a buffer, densely and one after the other.
#[derive(Debug)]
pub(super) struct Packer {
    pub(super) buffer: wgpu::Buffer,
    width: u32,
    height: u32,
    attachments: Attachments,
    /// One program for each choice of attachments, with its last bind group.
    programs: Vec<Program>,
}

#[derive(Debug)]
struct Program {
    wanted: Attachments,
    pipeline: wgpu::ComputePipeline,
    views: [Option<wgpu::TextureView>; 4],
    group: wgpu::BindGroup,
}

impl Packer {
    /// A packer for pictures of this size into `buffer`.
    pub(super) fn new(buffer: wgpu::Buffer, [width, height]: [u32; 2], attachments: Attachments) -> Self {
        Self { buffer, width, height, attachments, programs: Vec::new() }
    }

    pub(super) fn encode(
        &mut self,
        gpu: &Gpu,
        timer: Option<&Timer>,
        targets: &Targets,
        wanted: Attachments,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), BackendError> {
        let drawn = targets.stored().attachments;
        let has = |all: Attachments| all.union(wanted) == all;
        if targets.size() != (self.width, self.height) || !has(self.attachments) || !has(drawn) {
            let (width, height) = targets.size();
            let found = format!("{width} x {height} pixels with {drawn:?}");
            return Err(failure(&format!("{wanted:?} cannot be handed over: what is drawn is {found}")));
        }
        let index = self.program(gpu, targets, wanted)?;
        let Program { pipeline, group, .. } = &self.programs[index];
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("hand-over"),
                timestamp_writes: timer.map(Timer::second_span),
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(self.width.div_ceil(GROUP), self.height.div_ceil(GROUP), 1);
        }
        Ok(())
    }

    /// The index of the program that writes these attachments, bound to the drawn textures.
    fn program(&mut self, gpu: &Gpu, targets: &Targets, wanted: Attachments) -> Result<usize, BackendError> {
        let flags = in_order(wanted);
        let all = targets.views();
        let views: [_; 4] = std::array::from_fn(|channel| all[channel].filter(|_| flags[channel]).cloned());
        let known = self.programs.iter().position(|program| program.wanted == wanted);
        if let Some(index) = known {
            if self.programs[index].views != views {
                let layout = self.programs[index].pipeline.get_bind_group_layout(0);
                self.programs[index].group = self.bind(gpu, &layout, &views)?;
                self.programs[index].views = views;
            }
            return Ok(index);
        }
        let text = source(flags, self.width, self.height);
        let pipeline = gpu.compute_program("hand-over", text.into(), "hand_over")?;
        let group = self.bind(gpu, &pipeline.get_bind_group_layout(0), &views)?;
        self.programs.push(Program { wanted, pipeline, views, group });
        Ok(self.programs.len() - 1)
    }

    fn bind(
        &self,
        gpu: &Gpu,
        layout: &wgpu::BindGroupLayout,
        views: &[Option<wgpu::TextureView>; 4],
    ) -> Result<wgpu::BindGroup, BackendError> {
        let Offsets { color, position, normal, triangle, .. } =
            Offsets::new(self.width, self.height, self.attachments, false);
        let offsets = [color, position, normal, triangle];
        let pixels = u64::from(self.width) * u64::from(self.height);
        let mut entries = Vec::new();
        for (channel, view) in views.iter().enumerate() {
            let (Some(view), Some(offset)) = (view, offsets[channel]) else { continue };
            let binding = 2 * channel as u32;
            entries.push(wgpu::BindGroupEntry { binding, resource: wgpu::BindingResource::TextureView(view) });
            let bytes = pixels * if channel == TRIANGLE { 4 } else { 16 };
            let range = wgpu::BufferBinding { buffer: &self.buffer, offset, size: NonZeroU64::new(bytes) };
            entries.push(wgpu::BindGroupEntry { binding: binding + 1, resource: wgpu::BindingResource::Buffer(range) });
        }
        let label = Some("hand-over");
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries: &entries });
        gpu.check("binding the hand-over")?;
        Ok(group)
    }
}

/// The shader that writes the chosen channels of a picture of this size. The texture stores triangle ids plus 1.
fn source(flags: [bool; 4], width: u32, height: u32) -> String {
    let (mut declarations, mut stores) = (String::new(), String::new());
    for (channel, name) in CHANNELS.iter().enumerate().filter(|(channel, _)| flags[*channel]) {
        let [scalar, element, value] = match channel {
            TRIANGLE => ["u32", "u32", ".x - 1u"],
            _ => ["f32", "vec4<f32>", ""],
        };
        let binding = 2 * channel;
        let _ = writeln!(
            declarations,
            "@group(0) @binding({binding}) var {name}: texture_2d<{scalar}>;\n\
             @group(0) @binding({}) var<storage, read_write> dense_{name}: array<{element}>;",
            binding + 1
        );
        let _ = writeln!(stores, "    dense_{name}[index] = textureLoad({name}, at.xy, 0){value};");
    }
    format!(
        "{declarations}
@compute @workgroup_size({GROUP}, {GROUP})
fn hand_over(@builtin(global_invocation_id) at: vec3<u32>) {{
    if (at.x >= {width}u || at.y >= {height}u) {{
        return;
    }}
    let index = at.y * {width}u + at.x;
{stores}}}
"
    )
}
