//! The G-buffer as programs read it: the attachments of the last draw, or textures uploaded from host memory.

use super::bindings;
use crate::raster::gpu::cache::Kept;
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::faults::{failure, unsupported};
use crate::raster::gpu::resources::texture;
use crate::raster::gpu::targets::{CHANNEL_FORMATS, CHANNELS, TRIANGLE, Targets};
use curitiba_pipeline::backend::{BackendError, EffectJob};
use std::time::{Duration, Instant};

const UPLOADED: wgpu::TextureUsages = wgpu::TextureUsages::TEXTURE_BINDING.union(wgpu::TextureUsages::COPY_DST);

/// Whether a program reads the colour, position, normal and triangle channels.
pub fn wanted(job: &EffectJob<'_>) -> [bool; 4] {
    let info = job.program.info();
    let reads = |buffer| info.buffers.contains(&buffer);
    [reads("color_buffer"), reads("pos_buffer"), reads("norm_buffer"), info.glass && job.glass.contains(&true)]
}

/// The layout of group 0, and placeholder textures for channels that a program does not read.
#[derive(Debug)]
pub struct Inputs {
    pub layout: wgpu::BindGroupLayout,
    unread: [wgpu::TextureView; 4],
    uploads: Kept<(u32, u32, [bool; 4]), Upload>,
}

/// A G-buffer that is bound and can be read.
#[derive(Debug)]
pub struct Ready<'a> {
    pub group: &'a wgpu::BindGroup,
    /// Offset of stored triangle ids: the stored value is the id plus this number.
    pub id_base: u32,
    /// Time of the copy from host memory; `None` if nothing was copied.
    pub upload: Option<Duration>,
}

/// Textures uploaded from host memory.
#[derive(Debug)]
struct Upload {
    channels: [Option<wgpu::Texture>; 4],
    group: wgpu::BindGroup,
    bytes: u64,
}

impl Inputs {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let types = (0..4).map(|channel| {
            let sample_type = match channel {
                TRIANGLE => wgpu::TextureSampleType::Uint,
                _ => wgpu::TextureSampleType::Float { filterable: false },
            };
            bindings::texture(sample_type, wgpu::TextureViewDimension::D2)
        });
        let layout = bindings::layout(&gpu.device, "G-buffer", types);
        let unread = CHANNEL_FORMATS.map(|format| {
            let texture = texture(gpu, "unread", format, [1, 1], UPLOADED);
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        });
        gpu.check("creation of the inputs of effects")?;
        Ok(Self { layout, unread, uploads: Kept::default() })
    }

    /// Binds the job's G-buffer: the attachments of `drawn` if the job says that it is on the device, else an upload.
    pub fn ready<'a>(
        &'a mut self,
        gpu: &Gpu,
        drawn: Option<&'a Targets>,
        job: &EffectJob<'_>,
    ) -> Result<Ready<'a>, BackendError> {
        let wanted = wanted(job);
        if !job.resident {
            let start = Instant::now();
            let upload = self.upload(gpu, job, wanted)?;
            return Ok(Ready { group: &upload.group, id_base: 0, upload: Some(start.elapsed()) });
        }
        let targets = drawn.filter(|targets| targets.size() == (job.width, job.height));
        let Some(targets) = targets else {
            return Err(failure("the G-buffer that the effect reads is not what was drawn last"));
        };
        let views = targets.views();
        if let Some(missing) = (0..4).find(|channel| wanted[*channel] && views[*channel].is_none()) {
            let channel = CHANNELS[missing];
            return Err(failure(&format!("what was drawn last has no `{channel}`, which the effect reads")));
        }
        let group = targets.group.get_or_init(|| self.bind(gpu, views));
        gpu.check("binding of the G-buffer")?;
        // The attachment stores ids plus 1, because it is cleared to 0, see `Targets`.
        Ok(Ready { group, id_base: 1, upload: None })
    }

    /// The bind group of a G-buffer with these channels.
    pub fn bind(&self, gpu: &Gpu, views: [Option<&wgpu::TextureView>; 4]) -> wgpu::BindGroup {
        let view = |channel: usize| views[channel].unwrap_or(&self.unread[channel]);
        let resources = (0..4).map(|channel| wgpu::BindingResource::TextureView(view(channel)));
        bindings::bind(&gpu.device, "G-buffer", &self.layout, resources)
    }

    fn upload(&mut self, gpu: &Gpu, job: &EffectJob<'_>, wanted: [bool; 4]) -> Result<&Upload, BackendError> {
        let data: [&[u8]; 4] = [
            bytemuck::cast_slice(job.color),
            bytemuck::cast_slice(job.position),
            bytemuck::cast_slice(job.normal),
            bytemuck::cast_slice(job.triangle),
        ];
        let mut uploads = std::mem::take(&mut self.uploads);
        // The bind group of an upload belongs to the upload, so there is nothing else to release.
        let release = || {};
        let result = uploads.require(gpu, (job.width, job.height, wanted), release, |(width, height, wanted)| {
            let channels: [Option<wgpu::Texture>; 4] = std::array::from_fn(|channel| {
                let format = CHANNEL_FORMATS[channel];
                wanted[channel].then(|| texture(gpu, CHANNELS[channel], format, [*width, *height], UPLOADED))
            });
            gpu.check("creation of the uploaded G-buffer")?;
            let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
            let views = channels.each_ref().map(|channel| channel.as_ref().map(view));
            let group = self.bind(gpu, views.each_ref().map(Option::as_ref));
            gpu.check("binding of the uploaded G-buffer")?;
            let texels = channels.iter().flatten().map(|t| u64::from(t.format().block_copy_size(None).unwrap_or(16)));
            let bytes = u64::from(*width) * u64::from(*height) * texels.sum::<u64>();
            Ok(Upload { channels, group, bytes })
        });
        let filled = result.and_then(|upload| {
            let channels = upload.channels.iter().zip(data);
            channels
                .filter_map(|(channel, data)| Some((channel.as_ref()?, data)))
                .try_for_each(|(texture, data)| gpu.fill_texture(texture, data, "upload of the G-buffer"))
        });
        self.uploads = uploads;
        filled?;
        self.uploads.last().ok_or_else(|| failure("the uploaded G-buffer is gone"))
    }

    /// Bytes of device memory of all uploads.
    pub fn bytes(&self) -> u64 {
        self.uploads.values().map(|upload| upload.bytes).sum()
    }
}

/// Refuses pictures larger than the device's greatest texture.
pub fn check_size(gpu: &Gpu, job: &EffectJob<'_>) -> Result<(), BackendError> {
    let largest = gpu.limits.max_texture_dimension_2d;
    if job.width.max(job.height) <= largest {
        return Ok(());
    }
    let what = format!("{} on {} x {} pixels", job.program.info().name, job.width, job.height);
    Err(unsupported(&what, &format!("{} takes {largest} x {largest} pixels at most;", gpu.adapter)))
}
