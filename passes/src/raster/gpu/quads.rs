//! Quads that fill a window from drawn or traced pictures, computed on the device. The result is read back once, as
//! floats or as display codes.

use super::device::Gpu;
use super::faults::failure;
use super::lend::Lending;
use super::timer::Timer;
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::color::{ColorSpace, Display, Tone};
use curitiba_pipeline::device_quad::{
    DeviceQuad, DeviceQuadStats, DeviceSource, OnDevice, Shown, byte_steps, code_steps,
};
use curitiba_pipeline::image::PixelFormat;
use rayon::prelude::*;
use std::num::NonZeroU64;
use std::time::Instant;

/// Threads along a side of a workgroup.
const GROUP: u32 = 16;
/// Greatest number of bytes of pixels of a launch; larger pictures take several launches.
const MOST_BYTES: u64 = 64 << 20;
/// Greatest number of pixels of a launch, which takes about 1 ms on a GPU, and 50 ms with a software driver on two cores.
const MOST_PIXELS: u64 = 1 << 22;
/// Bytes of the results besides the pixels, which precede the pixels in the staging buffer.
const FOUND_BYTES: u64 = 8;
/// Offset of the pixels in the staging buffer.
const PIXELS_AT: u64 = 256;
/// Bytes that one task copies from the memory that the device wrote.
const COPIED_AT_ONCE: usize = 256 << 10;
/// Format number of the factor for a quad without a factor.
const NO_FACTOR: u32 = 99;

/// `Params` of `quads.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Params {
    width: u32,
    first_row: u32,
    rows: u32,
    unused: u32,
    formats: [u32; 2],
    codes: u32,
    linear: u32,
    exposure: u32,
    tone: u32,
    end: [u32; 2],
}

/// A picture that a quad reads; it has the quad's size.
#[derive(Debug, Clone)]
pub(super) enum Source {
    /// A texture.
    Texture(wgpu::TextureView),
    /// Four floats a pixel without gaps, from an offset in bytes.
    #[cfg_attr(
        not(any(test, all(feature = "share", unix))),
        expect(dead_code, reason = "such pictures lie in shared memory alone")
    )]
    Buffer(wgpu::Buffer, u64),
}

impl Source {
    fn is_buffer(&self) -> bool {
        matches!(self, Self::Buffer(..))
    }

    fn binding(&self, pixels: u64) -> wgpu::BindingResource<'_> {
        match self {
            Self::Texture(view) => wgpu::BindingResource::TextureView(view),
            Self::Buffer(buffer, offset) => {
                let size = NonZeroU64::new(16 * pixels);
                wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: *offset, size })
            }
        }
    }
}

/// The declaration of a source and the function that reads a pixel of it, in WGSL.
fn declaration(name: &str, binding: u32, is_buffer: bool) -> String {
    let (kind, pixel) = match is_buffer {
        true => ("var<storage, read> NAME: array<vec4u>", "NAME[at.y * params.width + at.x]"),
        false => ("var NAME: texture_2d<f32>", "bitcast<vec4u>(textureLoad(NAME, at, 0))"),
    };
    let text = format!(
        "@group(0) @binding({binding}) {kind};\nfn load_{name}(at: vec2u) -> vec4u {{\n    return {pixel};\n}}\n"
    );
    text.replace("NAME", &format!("{name}_source"))
}

/// The programs, and the buffers that are kept from frame to frame.
#[derive(Debug)]
pub(super) struct Quads {
    /// Pipelines by whether the quad's colour and factor are buffers (`true`) or textures.
    pipelines: Vec<([bool; 2], wgpu::ComputePipeline)>,
    uniform: wgpu::Buffer,
    found: wgpu::Buffer,
    /// The tables of the colour space that was used last.
    tables: Option<(ColorSpace, wgpu::Buffer)>,
    pixels: Option<wgpu::Buffer>,
    staging: Option<wgpu::Buffer>,
}

/// The number of a format in `quads.wgsl`.
fn number(format: PixelFormat) -> u32 {
    match format {
        PixelFormat::Rgba32Float => 0,
        PixelFormat::Rgba16Float => 1,
        PixelFormat::Rgba8Unorm => 2,
        PixelFormat::R8Unorm => 3,
        PixelFormat::R32Float => 4,
        PixelFormat::Rg32Float => 5,
    }
}

/// The tables of `quads.wgsl`, of 256 words each: steps of codes, steps of bytes, bytes divided by 255, steps of alpha.
fn words(space: ColorSpace) -> Vec<u32> {
    let mut words = Vec::with_capacity(4 * 256);
    let mut part = |table: &[u32]| {
        words.extend_from_slice(table);
        words.resize(words.len().next_multiple_of(256), u32::MAX);
    };
    part(&code_steps(space));
    part(&byte_steps());
    let byte = |byte: u16| (f32::from(byte) / 255.0).to_bits();
    part(&(0..256).map(byte).collect::<Vec<_>>());
    part(&code_steps(ColorSpace::Report));
    words
}

/// The buffer in a slot; replaced by a larger buffer if it has less than `bytes` bytes.
fn kept<'a>(
    gpu: &Gpu,
    slot: &'a mut Option<wgpu::Buffer>,
    label: &str,
    usage: wgpu::BufferUsages,
    bytes: u64,
) -> Result<&'a wgpu::Buffer, BackendError> {
    if slot.as_ref().is_none_or(|buffer| buffer.size() < bytes) {
        // The old buffer is freed first, so that both need not fit in memory at once.
        *slot = None;
        *slot = Some(gpu.buffer(label, usage, bytes)?);
    }
    slot.as_ref().ok_or_else(|| failure(label))
}

impl Quads {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let copy_to = wgpu::BufferUsages::COPY_DST;
        let found = wgpu::BufferUsages::STORAGE | copy_to | wgpu::BufferUsages::COPY_SRC;
        Ok(Self {
            pipelines: Vec::new(),
            uniform: gpu.buffer("quads", wgpu::BufferUsages::UNIFORM | copy_to, size_of::<Params>() as u64)?,
            found: gpu.buffer("quads", found, FOUND_BYTES)?,
            tables: None,
            pixels: None,
            staging: None,
        })
    }

    /// Bytes of device memory of the pixels and of the staging buffer.
    pub fn bytes(&self) -> u64 {
        self.pixels.iter().chain(&self.staging).map(wgpu::Buffer::size).sum()
    }

    /// The index of the program for sources that are `buffers` or textures; builds the program if needed.
    fn pipeline(&mut self, gpu: &Gpu, buffers: [bool; 2]) -> Result<usize, BackendError> {
        if let Some(index) = self.pipelines.iter().position(|(known, _)| *known == buffers) {
            return Ok(index);
        }
        let [color, factor] = [("color", 1, buffers[0]), ("factor", 2, buffers[1])]
            .map(|(name, binding, is_buffer)| declaration(name, binding, is_buffer));
        let text = [include_str!("quads.wgsl"), &color, &factor].concat();
        let pipeline = gpu.compute_program("quads", text.into(), "main")?;
        self.pipelines.push((buffers, pipeline));
        Ok(self.pipelines.len() - 1)
    }

    /// Fills a quad, waits, and copies it to host memory. `sources` are its colour and, if it has one, its factor.
    pub fn fill(
        &mut self,
        gpu: &Gpu,
        timer: Option<&Timer>,
        sources: (&Source, Option<&Source>),
        quad: &DeviceQuad,
        mut shown: Shown<'_>,
    ) -> Result<DeviceQuadStats, BackendError> {
        let (display, pixel_bytes, length) = match &shown {
            Shown::Floats(pixels) => (Display::default(), 16_u64, pixels.len()),
            Shown::Codes(display, pixels) => (*display, 4, pixels.len()),
        };
        if length as u64 != u64::from(quad.width) * u64::from(quad.height) {
            let (width, height) = (quad.width, quad.height);
            return Err(failure(&format!("a quad of {width} x {height} pixels into a place for {length}")));
        }
        if self.tables.as_ref().is_none_or(|(space, _)| *space != display.space) {
            let words = words(display.space);
            let usage = wgpu::BufferUsages::STORAGE;
            self.tables = Some((display.space, gpu.upload_buffer("quads", usage, bytemuck::cast_slice(&words))?));
        }
        let most = MOST_BYTES.min(gpu.limits.max_storage_buffer_binding_size).min(gpu.max_buffer_bytes - PIXELS_AT);
        let row = pixel_bytes * u64::from(quad.width.max(1));
        let rows = (most / row).min(MOST_PIXELS / u64::from(quad.width.max(1))).clamp(1, u64::from(quad.height.max(1)));
        let capacity = row * rows;
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        kept(gpu, &mut self.pixels, "the picture of a quad", storage, capacity)?;
        let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        kept(gpu, &mut self.staging, "the read-back of a quad", read, PIXELS_AT + capacity)?;
        let sources = [sources.0, sources.1.unwrap_or(sources.0)];
        let pipeline = self.pipeline(gpu, sources.map(Source::is_buffer))?;
        let group = self.group(gpu, pipeline, sources, length as u64)?;
        let mut params = Params {
            width: quad.width,
            first_row: 0,
            rows: 0,
            unused: 0,
            formats: [number(quad.color.format), quad.factor.map_or(NO_FACTOR, |factor| number(factor.format))],
            codes: u32::from(pixel_bytes == 4),
            linear: u32::from(display.space == ColorSpace::Linear),
            exposure: display.exposure.exp2().to_bits(),
            tone: u32::from(display.tone == Tone::Reinhard),
            end: [0; 2],
        };
        let mut stats = DeviceQuadStats::default();
        let mut found = [0; 2];
        for first in (0..quad.height).step_by(rows as usize) {
            (params.first_row, params.rows) = (first, (quad.height - first).min(rows as u32));
            let pixels = first as usize * quad.width as usize..;
            let pixels = pixels.start..pixels.start + params.rows as usize * quad.width as usize;
            let place: &mut [u8] = match &mut shown {
                Shown::Floats(floats) => bytemuck::cast_slice_mut(&mut floats[pixels]),
                Shown::Codes(_, codes) => bytemuck::cast_slice_mut(&mut codes[pixels]),
            };
            let (counted, launched) = self.launch(gpu, timer, (pipeline, &group), params, place)?;
            found[0] += counted[0];
            found[1] |= counted[1];
            stats.host += launched.host;
            stats.read_back += launched.read_back;
            stats.device = launched.device.map(|device| device + stats.device.unwrap_or_default());
        }
        (stats.not_finite, stats.is_blank) = (found[0], found[1] == 0 && length > 0);
        Ok(stats)
    }

    fn group(
        &self,
        gpu: &Gpu,
        pipeline: usize,
        [color, factor]: [&Source; 2],
        length: u64,
    ) -> Result<wgpu::BindGroup, BackendError> {
        let (Some((_, tables)), Some(pixels)) = (&self.tables, &self.pixels) else {
            return Err(failure("the buffers of a quad are not there"));
        };
        let resources = [
            self.uniform.as_entire_binding(),
            color.binding(length),
            factor.binding(length),
            tables.as_entire_binding(),
            pixels.as_entire_binding(),
            self.found.as_entire_binding(),
        ];
        let entries: Vec<wgpu::BindGroupEntry<'_>> =
            (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let layout = self.pipelines[pipeline].1.get_bind_group_layout(0);
        let descriptor = wgpu::BindGroupDescriptor { label: Some("quads"), layout: &layout, entries: &entries };
        let group = gpu.device.create_bind_group(&descriptor);
        gpu.check("binding of a quad")?;
        Ok(group)
    }

    /// Fills some rows, waits, and copies their pixels to `place`. Returns the number of pixels that are not finite, a number that is 0 if all
    /// pixels have the same colour, and the times.
    fn launch(
        &self,
        gpu: &Gpu,
        timer: Option<&Timer>,
        (pipeline, group): (usize, &wgpu::BindGroup),
        params: Params,
        place: &mut [u8],
    ) -> Result<([u32; 2], DeviceQuadStats), BackendError> {
        let doing = "filling a quad";
        let (Some(pixels), Some(staging)) = (&self.pixels, &self.staging) else { return Err(failure(doing)) };
        let start = Instant::now();
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&params));
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(doing) });
        encoder.clear_buffer(&self.found, 0, None);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(doing),
                timestamp_writes: timer.and_then(|timer| timer.compute_span(true, true)),
            });
            pass.set_pipeline(&self.pipelines[pipeline].1);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(params.width.div_ceil(GROUP), params.rows.div_ceil(GROUP), 1);
        }
        let bytes = place.len() as u64;
        encoder.copy_buffer_to_buffer(&self.found, 0, staging, 0, FOUND_BYTES);
        encoder.copy_buffer_to_buffer(pixels, 0, staging, PIXELS_AT, bytes);
        if let Some(timer) = timer {
            timer.resolve(&mut encoder, false);
        }
        let (mut found, mut stats) = ([0; 2], DeviceQuadStats::default());
        gpu.read_mapped(staging, PIXELS_AT + bytes, Some(encoder.finish()), doing, |mapped| {
            stats.host = start.elapsed();
            found.copy_from_slice(bytemuck::cast_slice(&mapped[..FOUND_BYTES as usize]));
            let pieces = mapped[PIXELS_AT as usize..].par_chunks(COPIED_AT_ONCE);
            place.par_chunks_mut(COPIED_AT_ONCE).zip(pieces).for_each(|(to, from)| to.copy_from_slice(from));
            stats.read_back = start.elapsed() - stats.host;
        })?;
        if let Some(timer) = timer {
            stats.device = Some(timer.read(gpu, None, false, doing)?[0]);
        }
        Ok((found, stats))
    }
}

/// The lent texture that a quad reads. An error if it is missing or does not have the quad's size.
pub(super) fn lent(lending: &Lending, quad: &DeviceQuad, source: DeviceSource) -> Result<Source, BackendError> {
    let size = (quad.width, quad.height);
    let view = match source.place {
        OnDevice::Drawn { value, channel } => {
            let last = lending.last();
            let is_it = last.value == value && last.size == size && channel < 3;
            if is_it { last.channels[channel].clone() } else { None }
        }
        OnDevice::Made(number) => lending
            .picture(number)
            .filter(|picture| (picture.width(), picture.height()) == size)
            .map(|picture| picture.create_view(&wgpu::TextureViewDescriptor::default())),
    };
    view.map(Source::Texture).ok_or_else(|| absent(source))
}

/// The error for a missing source.
pub(super) fn absent(source: DeviceSource) -> BackendError {
    failure(&format!("a quad reads what is not on the device: {source:?}"))
}

#[cfg(test)]
mod tests;
