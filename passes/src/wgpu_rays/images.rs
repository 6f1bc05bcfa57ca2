//! The images of a pass in device memory: the G-buffer that it reads, and the picture that it writes.

use super::NAME;
use crate::cpu::check;
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::lend::PICTURE_USAGE;
use crate::raster::gpu::resources::texture;
use crate::raster::gpu::targets::{CHANNEL_FORMATS, CHANNELS, TRIANGLE};
use curitiba_pipeline::backend::{BackendError, RayJob};

/// The format of the picture.
pub const OUTPUT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// The views of a G-buffer: colour, position, normal and triangle id; `None` for a channel that is absent.
#[derive(Debug, Clone)]
pub struct Views {
    pub channels: [Option<wgpu::TextureView>; 4],
    /// Offset of stored triangle ids: id + `id_base` is stored.
    pub id_base: u32,
}

/// Textures that are kept from pass to pass.
#[derive(Debug)]
pub struct Images {
    /// Bound in place of channels that are absent.
    unread: [wgpu::TextureView; 4],
    channels: [Option<wgpu::Texture>; 4],
    output: Option<wgpu::Texture>,
    /// Textures of a filter: the normals of the visible surfaces, and the picture that its levels write in turn with the output.
    filter: [Option<wgpu::Texture>; 2],
}

fn whole(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// The texture in a slot; a new one if the slot is empty or its texture's size differs from `size`.
fn kept(slot: &mut Option<wgpu::Texture>, size: [u32; 2], make: impl FnOnce() -> wgpu::Texture) -> &wgpu::Texture {
    if slot.as_ref().is_some_and(|texture| [texture.width(), texture.height()] != size) {
        // The old texture is released first: memory may not hold both.
        *slot = None;
    }
    slot.get_or_insert_with(make)
}

const READ: wgpu::TextureUsages = wgpu::TextureUsages::TEXTURE_BINDING.union(wgpu::TextureUsages::COPY_DST);

impl Images {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let unread = CHANNEL_FORMATS.map(|format| whole(&texture(gpu, "unread", format, [1, 1], READ)));
        gpu.check("creation of the images of rays")?;
        Ok(Self { unread, channels: [const { None }; 4], output: None, filter: [const { None }; 2] })
    }

    /// Refuses pictures that are larger than the device's textures may be.
    pub fn check_size(gpu: &Gpu, job: &RayJob<'_>) -> Result<(), BackendError> {
        let largest = gpu.limits.max_texture_dimension_2d;
        if job.width.max(job.height) <= largest {
            return Ok(());
        }
        let (width, height) = (job.width, job.height);
        let why = format!("the picture is {width} x {height}, and {} takes {largest} x {largest} at most", gpu.adapter);
        Err(check::missing(NAME, job, &why))
    }

    /// Copies the channels that the job has in host memory to the device.
    pub fn upload(&mut self, gpu: &Gpu, job: &RayJob<'_>) -> Result<Views, BackendError> {
        let data: [&[u8]; 4] = [
            bytemuck::cast_slice(job.color),
            bytemuck::cast_slice(job.position),
            bytemuck::cast_slice(job.normal),
            bytemuck::cast_slice(job.triangle),
        ];
        let mut channels = [const { None }; 4];
        for (channel, data) in data.into_iter().enumerate().filter(|(_, data)| !data.is_empty()) {
            let size = [job.width, job.height];
            let make = || texture(gpu, CHANNELS[channel], CHANNEL_FORMATS[channel], size, READ);
            let texture = kept(&mut self.channels[channel], size, make);
            gpu.check("creation of the uploaded G-buffer")?;
            gpu.fill_texture(texture, data, "upload of the G-buffer")?;
            channels[channel] = Some(whole(texture));
        }
        Ok(Views { channels, id_base: 0 })
    }

    /// The texture that the picture is written to.
    pub fn output(&mut self, gpu: &Gpu, job: &RayJob<'_>) -> Result<&wgpu::Texture, BackendError> {
        let size = [job.width, job.height];
        let output = kept(&mut self.output, size, || texture(gpu, "picture", OUTPUT_FORMAT, size, PICTURE_USAGE));
        gpu.check("creation of the picture")?;
        Ok(output)
    }

    /// The textures of a filter: the normals of the visible surfaces, and the picture that levels write in turn with the output.
    pub fn for_filter(&mut self, gpu: &Gpu, job: &RayJob<'_>) -> Result<[&wgpu::Texture; 2], BackendError> {
        let size = [job.width, job.height];
        let textures = self
            .filter
            .each_mut()
            .map(|slot| kept(slot, size, || texture(gpu, "filter of rays", OUTPUT_FORMAT, size, PICTURE_USAGE)));
        gpu.check("creation of the pictures of a filter")?;
        Ok(textures)
    }

    /// Makes the filter's picture the output, because the last level wrote to that picture.
    pub fn swap_filtered(&mut self) {
        std::mem::swap(&mut self.output, &mut self.filter[1]);
    }

    /// Replaces the picture's texture (`None`: a new one is made when needed), and returns the previous one.
    pub fn exchange_output(&mut self, other: Option<wgpu::Texture>) -> Option<wgpu::Texture> {
        std::mem::replace(&mut self.output, other)
    }

    /// The bindings of group 0 from binding 1 on: the channels of a G-buffer, and the picture that is written.
    pub fn views(&self, views: &Views, picture: &wgpu::Texture) -> [wgpu::TextureView; 5] {
        let [color, position, normal, triangle] = std::array::from_fn(|channel| self.channel(views, channel).clone());
        [color, position, normal, triangle, whole(picture)]
    }

    /// A channel of a G-buffer, or the texture that is bound in its place.
    fn channel<'a>(&'a self, views: &'a Views, channel: usize) -> &'a wgpu::TextureView {
        views.channels[channel].as_ref().unwrap_or(&self.unread[channel])
    }

    /// The positions of a G-buffer.
    pub fn positions<'a>(&'a self, views: &'a Views) -> &'a wgpu::TextureView {
        self.channel(views, 1)
    }

    /// Device memory, in bytes, of the uploaded channels, the picture and the textures of a filter.
    pub fn bytes(&self) -> u64 {
        let textures = self.channels.iter().chain([&self.output]).chain(&self.filter).flatten();
        let bytes = |texture: &wgpu::Texture| {
            let texel = texture.format().block_copy_size(None).unwrap_or(16);
            u64::from(texture.width()) * u64::from(texture.height()) * u64::from(texel)
        };
        textures.map(bytes).sum()
    }
}

/// The sample type of a channel's texture.
pub fn sample_type(channel: usize) -> wgpu::TextureSampleType {
    match channel {
        TRIANGLE => wgpu::TextureSampleType::Uint,
        _ => wgpu::TextureSampleType::Float { filterable: false },
    }
}
