//! Attachments in device memory, and their copies to the host.

use super::cache::Kept;
use super::device::Gpu;
use super::faults::unsupported;
use super::resources::texture;
use curitiba_pipeline::backend::{Attachments, BackendError, GBuffer, RasterJob, Rect};
use curitiba_pipeline::image::widen;
use glam::Vec4;
use rayon::prelude::*;
use std::sync::OnceLock;

/// Full-precision formats of colour, position, normal and triangle id, in the order of the shader's locations.
pub(crate) const CHANNEL_FORMATS: [wgpu::TextureFormat; 4] = [
    wgpu::TextureFormat::Rgba32Float,
    wgpu::TextureFormat::Rgba32Float,
    wgpu::TextureFormat::Rgba32Float,
    wgpu::TextureFormat::R32Uint,
];
/// Format of colour, position and normal in 16-bit floats.
const HALF_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Names of the channels.
pub(crate) const CHANNELS: [&str; 4] = ["color", "position", "normal", "triangle"];
/// Index of the channel of triangle ids, the only one without floats.
pub(crate) const TRIANGLE: usize = 3;
/// The depth buffer's format.
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Greatest buffer for reading back; larger frames are read in several pieces.
const STAGING_BYTES: u64 = 256 << 20;

pub(super) fn in_order(attachments: Attachments) -> [bool; 4] {
    let Attachments { color, position, normal, triangle } = attachments;
    [color, position, normal, triangle]
}

/// The attachments that a pass writes, and their formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Stored {
    /// The attachments that are written.
    pub attachments: Attachments,
    /// The attachments that are written as 16-bit floats.
    half: Attachments,
    /// Whether ray passes read the attachments in place. Then passes that are not lent draw into other attachments.
    lent: bool,
}

impl Stored {
    /// Formats of a pass that writes `attachments`; those also in `half` are 16-bit floats.
    pub fn new(attachments: Attachments, half: Attachments) -> Self {
        let half = Attachments {
            color: attachments.color && half.color,
            position: attachments.position && half.position,
            normal: attachments.normal && half.normal,
            triangle: false,
        };
        Self { attachments, half, lent: false }
    }

    /// Attachments and formats of a job.
    pub fn of(job: &RasterJob<'_>) -> Self {
        Self { lent: job.shared != Attachments::default(), ..Self::new(job.attachments, job.half) }
    }

    /// Formats of the written attachments, in the order of [`CHANNEL_FORMATS`].
    pub fn formats(self) -> [Option<wgpu::TextureFormat>; 4] {
        let (written, half) = (in_order(self.attachments), in_order(self.half));
        std::array::from_fn(|channel| {
            written[channel].then_some(if half[channel] { HALF_FORMAT } else { CHANNEL_FORMATS[channel] })
        })
    }
}

fn texel_bytes(format: wgpu::TextureFormat) -> u32 {
    format.block_copy_size(None).unwrap_or(16)
}

/// One attachment.
#[derive(Debug)]
struct Channel {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
}

impl Channel {
    fn new(
        gpu: &Gpu,
        label: &str,
        size: [u32; 2],
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> Result<Self, BackendError> {
        let texture = texture(gpu, label, format, size, wgpu::TextureUsages::RENDER_ATTACHMENT | usage);
        gpu.check("creation of the attachments")?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self { texture, view })
    }
}

/// The attachments of a pass, in the size of its viewport.
#[derive(Debug)]
pub(super) struct Targets {
    width: u32,
    height: u32,
    stored: Stored,
    channels: [Option<Channel>; 4],
    depth: Channel,
    /// Bytes of device memory of the attachments and the depth buffer.
    bytes: u64,
    /// Visibility buffer: ids plus 1 of the triangles that are seen. Made by the first pass that shades each pixel once.
    visible: OnceLock<Channel>,
    /// The bind group by which effects read the attachments; set on first use.
    pub group: OnceLock<wgpu::BindGroup>,
}

impl Targets {
    pub fn new(gpu: &Gpu, width: u32, height: u32, stored: Stored) -> Result<Self, BackendError> {
        let formats = stored.formats();
        let pixel_bytes: u32 = formats.into_iter().flatten().map(texel_bytes).sum();
        let limits = &gpu.limits;
        if pixel_bytes > limits.max_color_attachment_bytes_per_sample {
            let most = limits.max_color_attachment_bytes_per_sample;
            let why = format!("{} writes {most} bytes a pixel at most;", gpu.adapter);
            return Err(unsupported(&format!("attachments of {pixel_bytes} bytes a pixel"), &why));
        }
        let largest = limits.max_texture_dimension_2d;
        if width.max(height) > largest {
            let why = format!("{} draws {largest} x {largest} pixels at most;", gpu.adapter);
            return Err(unsupported(&format!("a frame of {width} x {height} pixels"), &why));
        }
        let create = |label, format, usage| Channel::new(gpu, label, [width, height], format, usage);
        let written = match gpu.shades_pixels() {
            true => wgpu::TextureUsages::STORAGE_BINDING,
            false => wgpu::TextureUsages::empty(),
        };
        let mut channels = [const { None }; 4];
        for (index, label) in CHANNELS.into_iter().enumerate() {
            if let Some(format) = formats[index] {
                // Effects read the attachments in place.
                let usage = wgpu::TextureUsages::COPY_SRC
                    | wgpu::TextureUsages::COPY_DST
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | written;
                channels[index] = Some(create(label, format, usage)?);
            }
        }
        let depth = create("depth", DEPTH_FORMAT, wgpu::TextureUsages::COPY_SRC)?;
        let bytes = u64::from(width) * u64::from(height) * u64::from(pixel_bytes + 4);
        gpu.check("creation of the attachments")?;
        let (visible, group) = (OnceLock::new(), OnceLock::new());
        Ok(Self { width, height, stored, channels, depth, bytes, visible, group })
    }

    /// The visibility buffer: ids plus 1 of the triangles that are seen.
    pub fn visible(&self, gpu: &Gpu) -> Result<&wgpu::TextureView, BackendError> {
        if let Some(visible) = self.visible.get() {
            return Ok(&visible.view);
        }
        let usage = wgpu::TextureUsages::TEXTURE_BINDING;
        let size = [self.width, self.height];
        let visible = Channel::new(gpu, "visible triangles", size, CHANNEL_FORMATS[TRIANGLE], usage)?;
        Ok(&self.visible.get_or_init(|| visible).view)
    }

    /// The attachments of the render pass. Those that are not `loaded` are cleared first: triangle ids to 0, which means "none"
    /// until [`Self::read_back`], and the attachment `depth`, which receives depth, to the far plane.
    pub fn color_attachments(
        &self,
        clear_color: Vec4,
        depth: Option<usize>,
        loaded: [bool; 4],
    ) -> [Option<wgpu::RenderPassColorAttachment<'_>>; 4] {
        let [r, g, b, a] = clear_color.as_dvec4().to_array();
        let mut clears =
            [wgpu::Color { r, g, b, a }, wgpu::Color::TRANSPARENT, wgpu::Color::TRANSPARENT, wgpu::Color::TRANSPARENT];
        if let Some(clear) = depth.filter(|depth| *depth < TRIANGLE).map(|depth| &mut clears[depth]) {
            *clear = wgpu::Color::WHITE;
        }
        std::array::from_fn(|index| {
            self.channels[index].as_ref().map(|channel| wgpu::RenderPassColorAttachment {
                view: &channel.view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: if loaded[index] { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(clears[index]) },
                    store: wgpu::StoreOp::Store,
                },
            })
        })
    }

    /// The visibility buffer, [`Self::visible`], as the render pass's only attachment, cleared to no triangle.
    pub fn visible_attachment(
        &self,
        gpu: &Gpu,
    ) -> Result<[Option<wgpu::RenderPassColorAttachment<'_>>; 4], BackendError> {
        let attachment = wgpu::RenderPassColorAttachment {
            view: self.visible(gpu)?,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store },
        };
        Ok([None, None, None, Some(attachment)])
    }

    /// The depth buffer, cleared to the far plane unless it is `loaded`, and kept if it is `stored`.
    pub fn depth_attachment(&self, loaded: bool, stored: bool) -> wgpu::RenderPassDepthStencilAttachment<'_> {
        wgpu::RenderPassDepthStencilAttachment {
            view: &self.depth.view,
            depth_ops: Some(wgpu::Operations {
                load: if loaded { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(0.0) },
                store: if stored { wgpu::StoreOp::Store } else { wgpu::StoreOp::Discard },
            }),
            stencil_ops: None,
        }
    }

    /// Bytes of device memory, including the depth buffer.
    pub fn bytes(&self) -> u64 {
        let id_bytes = u64::from(texel_bytes(CHANNEL_FORMATS[TRIANGLE]));
        let visible = self.visible.get().map_or(0, |_| id_bytes * u64::from(self.width) * u64::from(self.height));
        self.bytes + visible
    }

    /// The attachments that are written, and their formats.
    pub fn stored(&self) -> Stored {
        self.stored
    }

    /// Pixels in a row, and number of rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// The texture of a channel; `None` where the attachment does not exist.
    pub fn texture(&self, channel: usize) -> Option<&wgpu::Texture> {
        self.channels.get(channel)?.as_ref().map(|channel| &channel.texture)
    }

    /// The texture of the depth buffer.
    pub fn depth_texture(&self) -> &wgpu::Texture {
        &self.depth.texture
    }

    /// Views for shaders: colour, position, normal and triangle id (plus 1); `None` where the attachment does not
    /// exist.
    pub fn views(&self) -> [Option<&wgpu::TextureView>; 4] {
        self.channels.each_ref().map(|channel| channel.as_ref().map(|channel| &channel.view))
    }

    /// Copies a part of the wanted attachments into `target`, whose channels must be allocated. The part is relative to the
    /// viewport's corner.
    pub fn read_back(
        &self,
        gpu: &Gpu,
        staging: &mut Staging,
        (viewport, part): (Rect, Rect),
        wanted: Attachments,
        target: &mut GBuffer,
    ) -> Result<(), BackendError> {
        let wanted = in_order(wanted);
        let formats = self.stored.formats();
        let pitches = formats.map(|format| {
            (format.map_or(0, texel_bytes) * part.width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
        });
        let present = |channel: &usize| wanted[*channel] && self.channels[*channel].is_some();
        let total = (0..4).filter(present).map(|c| u64::from(pitches[c]) * u64::from(part.height)).sum::<u64>();
        let widest = pitches.into_iter().max().map_or(0, u64::from);
        let capacity = total.min(STAGING_BYTES.min(gpu.max_buffer_bytes).max(widest));
        staging.reserve(gpu, capacity)?;
        for channel in (0..4).filter(present) {
            let pitch = pitches[channel];
            let mut row = 0;
            while row < part.height {
                let fit = (capacity - staging.used) / u64::from(pitch);
                let rows = u32::try_from(fit).unwrap_or(u32::MAX).min(part.height - row);
                if rows == 0 {
                    self.flush(gpu, staging, (viewport, part), target)?;
                    continue;
                }
                let half = formats[channel] == Some(HALF_FORMAT);
                staging.bands.push(Band { channel, half, row, rows, pitch, offset: staging.used });
                staging.used += u64::from(rows) * u64::from(pitch);
                row += rows;
            }
        }
        self.flush(gpu, staging, (viewport, part), target)
    }

    /// Submits the pending copies, waits, and moves their pixels into `target`.
    fn flush(
        &self,
        gpu: &Gpu,
        staging: &mut Staging,
        (viewport, part): (Rect, Rect),
        target: &mut GBuffer,
    ) -> Result<(), BackendError> {
        let Some(buffer) = &staging.buffer else { return Ok(()) };
        // The part's rectangle relative to the target's corner.
        let place =
            Rect { x: viewport.x + part.x - target.origin[0], y: viewport.y + part.y - target.origin[1], ..part };
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read back") });
        for band in &staging.bands {
            let Some(channel) = &self.channels[band.channel] else { continue };
            let source = wgpu::TexelCopyTextureInfo {
                texture: &channel.texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: part.x, y: part.y + band.row, z: 0 },
                aspect: wgpu::TextureAspect::All,
            };
            let layout = wgpu::TexelCopyBufferLayout {
                offset: band.offset,
                bytes_per_row: Some(band.pitch),
                rows_per_image: None,
            };
            let size = wgpu::Extent3d { width: part.width, height: band.rows, depth_or_array_layers: 1 };
            encoder.copy_texture_to_buffer(source, wgpu::TexelCopyBufferInfo { buffer, layout }, size);
        }
        gpu.read_mapped(buffer, staging.used, Some(encoder.finish()), "read-back", |bytes| {
            for band in &staging.bands {
                band.copy_to(bytes, place, target);
            }
        })?;
        staging.bands.clear();
        staging.used = 0;
        Ok(())
    }
}

/// Host-visible memory through which attachments are copied, kept between frames.
#[derive(Debug, Default)]
pub(crate) struct Staging {
    buffer: Option<wgpu::Buffer>,
    /// Pending copies, and the number of bytes that they take.
    bands: Vec<Band>,
    used: u64,
}

impl Staging {
    fn reserve(&mut self, gpu: &Gpu, bytes: u64) -> Result<(), BackendError> {
        self.bands.clear();
        self.used = 0;
        if self.buffer.as_ref().is_none_or(|buffer| buffer.size() < bytes) {
            self.buffer = None;
            let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
            self.buffer = Some(gpu.buffer("creation of the read-back buffer", usage, bytes)?);
        }
        Ok(())
    }
}

impl Staging {
    /// Copies a whole texture of format [`wgpu::TextureFormat::Rgba32Float`] to `pixels`, which has its size.
    pub fn read(&mut self, gpu: &Gpu, texture: &wgpu::Texture, pixels: &mut [[f32; 4]]) -> Result<(), BackendError> {
        let (width, height) = (texture.width(), texture.height());
        let pitch = (16 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let most = STAGING_BYTES.min(gpu.max_buffer_bytes) / u64::from(pitch);
        let band = u32::try_from(most).unwrap_or(u32::MAX).clamp(1, height.max(1));
        self.reserve(gpu, u64::from(pitch) * u64::from(band))?;
        let Some(buffer) = &self.buffer else { return Ok(()) };
        for (index, pixels) in (0..).zip(pixels.chunks_mut(width as usize * band as usize)) {
            let first = index * band;
            let rows = band.min(height - first);
            let descriptor = wgpu::CommandEncoderDescriptor { label: Some("read back") };
            let mut encoder = gpu.device.create_command_encoder(&descriptor);
            encoder.copy_texture_to_buffer(
                wgpu::TexelCopyTextureInfo {
                    texture,
                    mip_level: 0,
                    origin: wgpu::Origin3d { x: 0, y: first, z: 0 },
                    aspect: wgpu::TextureAspect::All,
                },
                wgpu::TexelCopyBufferInfo {
                    buffer,
                    layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(pitch), rows_per_image: None },
                },
                wgpu::Extent3d { width, height: rows, depth_or_array_layers: 1 },
            );
            let bytes = u64::from(pitch) * u64::from(rows);
            gpu.read_mapped(buffer, bytes, Some(encoder.finish()), "read-back", |bytes| {
                let rows = bytes.par_chunks_exact(pitch as usize);
                pixels.par_chunks_exact_mut(width as usize).zip(rows).for_each(|(line, row)| {
                    let line: &mut [u8] = bytemuck::cast_slice_mut(line);
                    line.copy_from_slice(&row[..line.len()]);
                });
            })?;
        }
        Ok(())
    }
}

/// Rows of an attachment in the staging buffer.
#[derive(Debug, Clone, Copy)]
struct Band {
    channel: usize,
    /// Whether the rows are 16-bit floats.
    half: bool,
    row: u32,
    rows: u32,
    pitch: u32,
    offset: u64,
}

impl Band {
    fn copy_to(&self, bytes: &[u8], viewport: Rect, target: &mut GBuffer) {
        let length = self.rows as usize * self.pitch as usize;
        let source = &bytes[self.offset as usize..][..length];
        let first_row = (viewport.y + self.row) as usize;
        let (image_width, x, width) = (target.width as usize, viewport.x as usize, viewport.width as usize);
        let rows = source.par_chunks_exact(self.pitch as usize);
        if self.channel == TRIANGLE {
            let lines = target.triangle[first_row * image_width..].par_chunks_exact_mut(image_width);
            lines.zip(rows).for_each(|(line, row)| {
                for (id, stored) in line[x..x + width].iter_mut().zip(row.as_chunks().0) {
                    *id = u32::from_ne_bytes(*stored).wrapping_sub(1);
                }
            });
        } else {
            let image = [&mut target.color, &mut target.position, &mut target.normal];
            let [color, position, normal] = image;
            let image = match self.channel {
                0 => color,
                1 => position,
                _ => normal,
            };
            let lines = image[first_row * image_width..].par_chunks_exact_mut(image_width);
            lines.zip(rows).for_each(|(line, row)| {
                let line = &mut line[x..x + width];
                if self.half {
                    widen(&row[..8 * width], line);
                } else {
                    let line: &mut [u8] = bytemuck::cast_slice_mut(line);
                    line.copy_from_slice(&row[..line.len()]);
                }
            });
        }
    }
}

/// Sets of attachments that are kept between frames, for passes of several sizes or with different attachments.
#[derive(Debug, Default)]
pub(super) struct TargetCache(Kept<(u32, u32, Stored), Targets>);

impl TargetCache {
    /// The attachments for a pass, reused or new.
    pub fn require(&mut self, gpu: &Gpu, viewport: Rect, stored: Stored) -> Result<&Targets, BackendError> {
        let key = (viewport.width, viewport.height, stored);
        // The bind groups of a set belong to the set. The set that was lent last stays in memory until another is lent.
        self.0.require(gpu, key, || {}, |(width, height, stored)| Targets::new(gpu, *width, *height, *stored))
    }

    /// The attachments of the last pass; `None` before the first.
    pub fn last(&self) -> Option<&Targets> {
        self.0.last()
    }

    /// Bytes of device memory of all sets.
    pub fn bytes(&self) -> u64 {
        self.0.values().map(Targets::bytes).sum()
    }
}
