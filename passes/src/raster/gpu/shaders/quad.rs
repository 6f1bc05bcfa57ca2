//! Quads that own shaders fill.

use super::super::device::{Gpu, TextureUpload};
use super::super::faults::failure;
use super::super::resources;
use super::super::targets::Staging;
use super::pipelines::{Groups, Into, Pipelines, QUAD_FORMAT};
use super::textures::{Sampled, Textures, upload, upload_cube};
use super::uniforms;
use curitiba_pipeline::backend::{BackendError, MipLevel, QuadJob, QuadTexture};
use curitiba_pipeline::glsl::{Attribute, Program, Sampler, SamplerKind};

/// Texture coordinates of the corners of two triangles; the positions in clip space follow from these.
const CORNERS: [[f32; 2]; 6] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// The outputs of a quad: its pixels, and the contents of each storage buffer of the program.
pub(super) type Filled<'a> = (&'a mut [[f32; 4]], &'a mut [Vec<[f32; 4]>]);

/// The corners of a quad in device memory.
#[derive(Debug)]
pub(super) struct Quad {
    positions: wgpu::Buffer,
    texcoords: wgpu::Buffer,
}

impl Quad {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let usage = wgpu::BufferUsages::VERTEX;
        let positions = CORNERS.map(|[u, v]| [2.0 * u - 1.0, 2.0 * v - 1.0, 0.0]);
        Ok(Self {
            positions: gpu.upload_buffer("upload of a quad", usage, bytemuck::cast_slice(&positions))?,
            texcoords: gpu.upload_buffer("upload of a quad", usage, bytemuck::cast_slice(&CORNERS))?,
        })
    }

    /// Fills `pixels`, top row first.
    pub fn fill(
        &self,
        gpu: &Gpu,
        staging: &mut Staging,
        (pipelines, textures, nothing): (&mut Pipelines, &Textures, &wgpu::Buffer),
        job: &QuadJob<'_>,
        (pixels, buffers): Filled<'_>,
    ) -> Result<(), BackendError> {
        let QuadJob { program, width, height, .. } = *job;
        let filters = gpu.has(wgpu::Features::FLOAT32_FILTERABLE);
        let exact = unfiltered(program, job.textures, filters);
        let missing = [Attribute::Normal, Attribute::Tangent];
        let built = pipelines.require(gpu, program, Into::quad(exact.clone()), &missing)?;
        let blocks = uniforms(gpu, &built.groups, program, job.uniforms)?;
        let sampled = bind_sampled(gpu, (&built.groups, program), textures, job.textures, &exact)?;
        let storage = upload_storage(gpu, buffers)?;
        let stored = bind_storage(gpu, &built.groups, &storage);
        let copied = wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::COPY_DST;
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | copied;
        let target = resources::texture(gpu, "quad", QUAD_FORMAT, [width, height], usage);
        gpu.check("creation of a quad's target")?;
        // Pixels that the shader discards keep these values.
        gpu.fill_texture(&target, bytemuck::cast_slice(pixels), "upload of what a quad covers")?;
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("quad") });
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("quad"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
                })],
                depth_stencil_attachment: None,
                timestamp_writes: None,
                occlusion_query_set: None,
                multiview_mask: None,
            });
            pass.set_pipeline(&built.pipeline);
            pass.set_bind_group(0, &blocks, &[]);
            pass.set_bind_group(1, &sampled, &[]);
            if let Some(stored) = &stored {
                pass.set_bind_group(2, stored, &[]);
            }
            for (slot, attribute) in (0..).zip(&program.attributes) {
                let buffer = match attribute {
                    Attribute::Position => &self.positions,
                    Attribute::TexCoord => &self.texcoords,
                    Attribute::Normal | Attribute::Tangent => nothing,
                };
                pass.set_vertex_buffer(slot, buffer.slice(..));
            }
            pass.draw(0..CORNERS.len() as u32, 0..1);
        }
        gpu.submit_and_wait(Some(encoder.finish()), "filling a quad")?;
        read_stored(gpu, program, &storage, buffers)?;
        staging.read(gpu, &target, pixels)
    }
}

/// By sampler: whether it reads its texture unfiltered.
pub(super) fn unfiltered(program: &Program, textures: &[QuadTexture<'_>], filters: bool) -> Vec<bool> {
    let exact = |(sampler, texture): (&Sampler, &QuadTexture<'_>)| {
        sampler.kind == SamplerKind::Compared
            || !filters && matches!(texture, QuadTexture::Channel { .. } | QuadTexture::Levels(_))
    };
    program.samplers.iter().zip(textures).map(exact).collect()
}

/// Uploads the textures that samplers read, and binds them. `exact` says which samplers do not filter.
pub(super) fn bind_sampled(
    gpu: &Gpu,
    (groups, program): (&Groups, &Program),
    textures: &Textures,
    read: &[QuadTexture<'_>],
    exact: &[bool],
) -> Result<wgpu::BindGroup, BackendError> {
    let filters = gpu.has(wgpu::Features::FLOAT32_FILTERABLE);
    let mut own = Vec::with_capacity(read.len());
    for texture in read {
        own.push(match texture {
            QuadTexture::Nothing => None,
            other => Some(channel_texture(gpu, other, filters)?),
        });
    }
    let bound = own
        .iter()
        .zip(&program.samplers)
        .map(|(own, declared)| own.as_ref().unwrap_or(textures.nothing(declared.kind)));
    let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
        .zip(bound.zip(exact))
        .flat_map(|(index, (Sampled { view, sampler }, exact)): (u32, _)| {
            let sampler = if *exact { &textures.nearest } else { sampler };
            let view = wgpu::BindingResource::TextureView(view);
            let sampler = wgpu::BindingResource::Sampler(sampler);
            [(2 * index, view), (2 * index + 1, sampler)]
                .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
        })
        .collect();
    Ok(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("textures of an own shader"),
        layout: &groups.textures,
        entries: &entries,
    }))
}

/// Binds storage buffers, in the order of the program's declarations. `None` if the program has none.
pub(super) fn bind_storage<'a>(
    gpu: &Gpu,
    groups: &Groups,
    storage: impl IntoIterator<Item = &'a wgpu::Buffer>,
) -> Option<wgpu::BindGroup> {
    let layout = groups.storage.as_ref()?;
    let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
        .zip(storage)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let label = Some("buffers of an own shader");
    Some(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries: &entries }))
}

/// Reads back the buffers that a program stored to.
pub(super) fn read_stored(
    gpu: &Gpu,
    program: &Program,
    storage: &[wgpu::Buffer],
    buffers: &mut [Vec<[f32; 4]>],
) -> Result<(), BackendError> {
    for ((device, host), of) in storage.iter().zip(buffers).zip(&program.storage) {
        if of.written {
            read_storage(gpu, device, host)?;
        }
    }
    Ok(())
}

pub(super) fn upload_storage(gpu: &Gpu, buffers: &[Vec<[f32; 4]>]) -> Result<Vec<wgpu::Buffer>, BackendError> {
    let most = gpu.limits.max_storage_buffer_binding_size.min(gpu.max_buffer_bytes);
    let upload = |buffer: &Vec<[f32; 4]>| {
        let bytes: &[u8] = bytemuck::cast_slice(buffer);
        if bytes.len() as u64 > most {
            let (needed, device) = (bytes.len(), &gpu.adapter);
            return Err(failure(&format!("a buffer has {needed} bytes, {device} takes {most} at most")));
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        gpu.upload_buffer("upload of a storage buffer", usage, bytes)
    };
    buffers.iter().map(upload).collect()
}

pub(super) fn read_storage(gpu: &Gpu, device: &wgpu::Buffer, host: &mut [[f32; 4]]) -> Result<(), BackendError> {
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let read = gpu.buffer("read-back of a storage buffer", usage, device.size())?;
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read back") });
    encoder.copy_buffer_to_buffer(device, 0, &read, 0, device.size());
    let commands = Some(encoder.finish());
    gpu.read_mapped(&read, device.size(), commands, "read-back of a storage buffer", |bytes| {
        bytemuck::cast_slice_mut(host).copy_from_slice(bytes);
    })
}

/// Uploads the texture of a sampler; [`QuadTexture::Nothing`] is opaque black.
pub(super) fn channel_texture(gpu: &Gpu, texture: &QuadTexture<'_>, filters: bool) -> Result<Sampled, BackendError> {
    match texture {
        QuadTexture::Nothing => {
            channel(gpu, &[MipLevel { width: 1, height: 1, texels: &[[0.0, 0.0, 0.0, 1.0]] }], filters)
        }
        QuadTexture::Image(image) => upload(gpu, &image.name, &[&image.levels], image.sampling),
        QuadTexture::Cube(images) => upload_cube(gpu, *images),
        QuadTexture::Channel { width, height, texels } => {
            channel(gpu, &[MipLevel { width: *width, height: *height, texels }], filters)
        }
        QuadTexture::Levels(levels) => channel(gpu, levels, filters),
    }
}

/// A channel as a texture, with its mip levels: the bottom row first.
fn channel(gpu: &Gpu, levels: &[MipLevel<'_>], filters: bool) -> Result<Sampled, BackendError> {
    let doing = "upload of a channel";
    let [width, height] = levels.first().map_or([1; 2], |level| [level.width, level.height]);
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("channel"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: QUAD_FORMAT,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    gpu.check(doing)?;
    let mut upload = TextureUpload::new(gpu, &texture, doing);
    for (mip_level, level) in (0..).zip(levels) {
        let rows = level.texels.chunks_exact(level.width.max(1) as usize).rev().flatten();
        upload.level(0, mip_level, bytemuck::cast_slice(&rows.copied().collect::<Vec<[f32; 4]>>()))?;
    }
    upload.end()?;
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let filter = if filters { wgpu::FilterMode::Linear } else { wgpu::FilterMode::Nearest };
    let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("channel"),
        address_mode_u: wgpu::AddressMode::Repeat,
        address_mode_v: wgpu::AddressMode::Repeat,
        mag_filter: filter,
        min_filter: filter,
        ..Default::default()
    });
    gpu.check("upload of a channel")?;
    Ok(Sampled { view, sampler })
}
