//! Own shaders of projects: their pipelines, bind groups and draw calls.
//!
//! Vertex attributes that a shader does not read are not bound. Attachments that a shader does not write keep their
//! previous contents.

mod compute;
mod pipelines;
mod quad;
mod textures;

use super::device::Gpu;
use super::faults::{failure, unsupported};
use super::geometry::{DeviceGeometry, Vertices};
use super::targets::{Staging, Stored};
use compute::Kernels;
use curitiba_pipeline::backend::{BackendError, ComputeJob, OwnMaterial, OwnShaders, OwnTexture, QuadJob, RasterJob};
use curitiba_pipeline::glsl::{Attribute, Program, Sampler, SamplerKind, Side};
use curitiba_pipeline::scene::Geometry;
use pipelines::{Groups, Into, Pipelines};
use quad::{Filled, Quad, bind_storage, channel_texture, read_storage, upload_storage};
use std::sync::Arc;
use textures::{Sampled, Textures};

/// Greatest number of triangles of a pass with several instances; each instance counts.
const MAX_DRAWN: u64 = 1 << 32;

/// One draw call.
#[derive(Debug)]
struct Draw {
    pipeline: wgpu::RenderPipeline,
    uniforms: wgpu::BindGroup,
    textures: wgpu::BindGroup,
    /// Bind group of storage buffers and images.
    storage: Option<wgpu::BindGroup>,
    attributes: Vec<Attribute>,
    chunk: usize,
    /// Index in the scene of the first triangle.
    first: u32,
    count: u32,
    /// Whether the triangles are drawn with the indices of [`Shaders::turned`], which list the last corner first.
    turned: bool,
    blends: bool,
}

/// The resources of draws with own shaders; kept from frame to frame.
#[derive(Debug)]
pub(super) struct Shaders {
    pipelines: Pipelines,
    textures: Textures,
    draws: Vec<Draw>,
    /// The storage buffers and images of the pass, and whether a draw stores to them.
    storage: Vec<(wgpu::Buffer, bool)>,
    /// How often each triangle is drawn.
    instances: u32,
    /// By chunk of the scene: indices of the triangles with the last corner first, made when a shader first needs them.
    turned: Vec<Option<wgpu::Buffer>>,
    /// Zeros, for attributes that a scene lacks.
    nothing: wgpu::Buffer,
    /// Set when the first quad is filled.
    quad: Option<Quad>,
    /// Pipelines of compute passes.
    kernels: Kernels,
}

impl Shaders {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let nothing = gpu.upload_buffer("creation of an empty attribute", wgpu::BufferUsages::VERTEX, &[0; 16])?;
        Ok(Self {
            pipelines: Pipelines::default(),
            textures: Textures::new(gpu)?,
            draws: Vec::new(),
            storage: Vec::new(),
            instances: 1,
            turned: Vec::new(),
            nothing,
            quad: None,
            kernels: Kernels::default(),
        })
    }

    /// Fills a quad.
    pub fn fill(
        &mut self,
        gpu: &Gpu,
        staging: &mut Staging,
        job: &QuadJob<'_>,
        filled: Filled<'_>,
    ) -> Result<(), BackendError> {
        let quad = match &mut self.quad {
            Some(quad) => quad,
            none => none.insert(Quad::new(gpu)?),
        };
        quad.fill(gpu, staging, (&mut self.pipelines, &self.textures, &self.nothing), job, filled)
    }

    /// Runs a compute shader.
    pub fn compute(
        &mut self,
        gpu: &Gpu,
        job: &ComputeJob<'_>,
        buffers: &mut [Vec<[f32; 4]>],
    ) -> Result<(), BackendError> {
        self.kernels.run(gpu, &self.textures, job, buffers)
    }

    /// Drops everything that belongs to the scene.
    pub fn forget_scene(&mut self) {
        self.textures.forget();
        self.turned.clear();
        self.draws.clear();
        self.storage.clear();
    }

    /// Bytes of device memory that textures take.
    pub fn texture_bytes(&self) -> u64 {
        self.textures.bytes
    }

    /// Number of triangles of the listed draws.
    pub fn triangles(&self) -> u64 {
        self.draws.iter().map(|draw| u64::from(draw.count) * u64::from(self.instances)).sum()
    }

    /// Lists the draws of the materials with own shaders, and uploads the data that the shaders read. `buffers` are the storage buffers.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        geometry: &DeviceGeometry,
        job: &RasterJob<'_>,
        own: &OwnShaders<'_>,
        buffers: &[Vec<[f32; 4]>],
    ) -> Result<(), BackendError> {
        self.draws.clear();
        self.storage = upload_storage(gpu, buffers)?.into_iter().map(|buffer| (buffer, false)).collect();
        let stored = Stored::of(job);
        if stored.attachments.triangle {
            return Err(unsupported("triangle ids of own shaders", "they write none;"));
        }
        self.instances = own.instances;
        let triangles: u64 = geometry.parts.iter().map(|part| u64::from(part.count)).sum();
        if own.instances > 1 && triangles.saturating_mul(own.instances.into()) > MAX_DRAWN {
            let what = format!("{triangles} triangles drawn {} times", own.instances);
            let why = format!("{MAX_DRAWN} triangles a pass are drawn at most; draw fewer instances");
            return Err(unsupported(&what, &why));
        }
        if own.clamped && !gpu.has(wgpu::Features::DEPTH_CLIP_CONTROL) {
            let why = format!("{} does not clamp depth;", gpu.adapter);
            return Err(unsupported("a depth map", &why));
        }
        let filters = gpu.has(wgpu::Features::FLOAT32_FILTERABLE);
        let channels: Vec<Sampled> =
            own.channels.iter().map(|channel| channel_texture(gpu, channel, filters)).collect::<Result<_, _>>()?;
        for part in &geometry.parts {
            let material = own.materials.get(part.material as usize).and_then(Option::as_ref);
            let Some(material) = material else { continue };
            let program = own.programs.get(material.program).ok_or_else(|| failure("a material has no program"))?;
            let drawn = material.drawn;
            if drawn.blend.is_some() && !gpu.has(wgpu::Features::FLOAT32_BLENDABLE) {
                let why = format!("{} does not blend 32-bit floats;", gpu.adapter);
                return Err(unsupported("a state that blends", &why));
            }
            let culled = match drawn.culled {
                Some(Side::Front) => Some(wgpu::Face::Front),
                Some(Side::Back) => Some(wgpu::Face::Back),
                None => (job.culled.get(part.material as usize) == Some(&true)).then_some(wgpu::Face::Back),
            };
            let exact = |(sampler, texture): (&Sampler, &OwnTexture)| {
                sampler.kind == SamplerKind::Compared || !filters && matches!(texture, OwnTexture::Channel(_))
            };
            let exact: Vec<bool> = program.samplers.iter().zip(&material.textures).map(exact).collect();
            let vertices = &geometry.vertices[geometry.chunks[part.chunk].vertices];
            let has = |attribute: &Attribute| match attribute {
                Attribute::Position => true,
                Attribute::Normal => vertices.normals.is_some(),
                Attribute::TexCoord => vertices.texcoords.is_some(),
                Attribute::Tangent => vertices.tangents.is_some(),
            };
            let missing: Vec<Attribute> = program.attributes.iter().copied().filter(|a| !has(a)).collect();
            let built = self.pipelines.require(
                gpu,
                program,
                Into::attachments(stored, drawn, culled, own, exact.clone()),
                &missing,
            )?;
            let uniforms = uniforms(gpu, &built.groups, program, &material.uniforms)?;
            let textures = self.textures.bind(gpu, &built.groups, (program, material, &exact), job.scene, &channels)?;
            let storage = bind_stored(gpu, &built.groups, (program, material), &mut self.storage)?;
            let turned = program.flat;
            if turned {
                turn(gpu, geometry, &job.scene.geometry, &mut self.turned, part.chunk)?;
            }
            self.draws.push(Draw {
                pipeline: built.pipeline.clone(),
                uniforms,
                textures,
                storage,
                attributes: program.attributes.clone(),
                chunk: part.chunk,
                first: part.first,
                count: part.count,
                turned,
                blends: drawn.blend.is_some(),
            });
        }
        // Draws that blend come last, so that they are blended over the others.
        self.draws.sort_by_key(|draw| draw.blends);
        Ok(())
    }

    /// Reads back the storage buffers that the draws stored to.
    pub fn read_stored(&self, gpu: &Gpu, buffers: &mut [Vec<[f32; 4]>]) -> Result<(), BackendError> {
        for ((device, written), host) in self.storage.iter().zip(buffers) {
            if *written {
                read_storage(gpu, device, host)?;
            }
        }
        Ok(())
    }

    /// Records the draws.
    pub fn record<'a>(&'a self, pass: &mut wgpu::RenderPass<'a>, geometry: &'a DeviceGeometry) {
        for draw in &self.draws {
            let chunk = &geometry.chunks[draw.chunk];
            let vertices = &geometry.vertices[chunk.vertices];
            pass.set_pipeline(&draw.pipeline);
            pass.set_bind_group(0, &draw.uniforms, &[]);
            pass.set_bind_group(1, &draw.textures, &[]);
            if let Some(storage) = &draw.storage {
                pass.set_bind_group(2, storage, &[]);
            }
            for (slot, attribute) in (0..).zip(&draw.attributes) {
                pass.set_vertex_buffer(slot, self.buffer(vertices, *attribute).slice(..));
            }
            let turned = self.turned.get(draw.chunk).and_then(Option::as_ref).filter(|_| draw.turned);
            let indices = turned.unwrap_or(&chunk.indices);
            pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
            let first = 3 * (draw.first - chunk.first);
            pass.draw_indexed(first..first + 3 * draw.count, 0, 0..self.instances);
        }
    }

    fn buffer<'a>(&'a self, vertices: &'a Vertices, attribute: Attribute) -> &'a wgpu::Buffer {
        match attribute {
            Attribute::Position => &vertices.positions,
            Attribute::Normal => vertices.normals.as_ref().unwrap_or(&self.nothing),
            Attribute::TexCoord => vertices.texcoords.as_ref().unwrap_or(&self.nothing),
            Attribute::Tangent => vertices.tangents.as_ref().unwrap_or(&self.nothing),
        }
    }
}

/// Binds the storage buffers and images of a draw, out of the pass's `buffers`, and marks those that the draw stores to.
fn bind_stored(
    gpu: &Gpu,
    groups: &Groups,
    (program, material): (&Program, &OwnMaterial),
    buffers: &mut [(wgpu::Buffer, bool)],
) -> Result<Option<wgpu::BindGroup>, BackendError> {
    if material.storage.len() != program.storage.len() {
        return Err(failure("a material binds other buffers than its shader has"));
    }
    // A storage binding for which the material has no buffer gets a buffer of one texel, which no shader reaches.
    let nothing = upload_storage(gpu, &vec![vec![[0.0; 4]]; program.storage.len()])?;
    let mut bound = Vec::with_capacity(program.storage.len());
    for ((index, of), nothing) in material.storage.iter().zip(&program.storage).zip(nothing) {
        bound.push(match index.map(|index| buffers.get_mut(index)) {
            None => nothing,
            Some(Some((buffer, written))) => {
                *written |= of.written;
                buffer.clone()
            }
            Some(None) => return Err(failure("a material binds a buffer that its pass has not")),
        });
    }
    let group = bind_storage(gpu, groups, &bound);
    gpu.check("binding of the buffers of an own shader")?;
    Ok(group)
}

/// The bind group of the uniform buffers of a draw.
fn uniforms(
    gpu: &Gpu,
    groups: &Groups,
    program: &Arc<Program>,
    blocks: &[Vec<u8>],
) -> Result<wgpu::BindGroup, BackendError> {
    let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
    let mut buffers = Vec::with_capacity(program.blocks.len());
    for (block, bytes) in program.blocks.iter().zip(blocks) {
        let buffer =
            gpu.buffer("creation of the uniforms of an own shader", usage, u64::from(block.size.next_multiple_of(16)))?;
        gpu.queue.write_buffer(&buffer, 0, bytes);
        buffers.push(buffer);
    }
    let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
        .zip(&buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let descriptor =
        wgpu::BindGroupDescriptor { label: Some("own uniforms"), layout: &groups.uniforms, entries: &entries };
    let group = gpu.device.create_bind_group(&descriptor);
    gpu.check("binding of the uniforms of an own shader")?;
    Ok(group)
}

/// Makes the indices of a chunk's triangles with the last corner first. Values that are not interpolated come from the first corner in wgpu,
/// and from the last corner in OpenGL. Rotating the corners by one keeps the winding.
fn turn(
    gpu: &Gpu,
    geometry: &DeviceGeometry,
    scene: &Geometry,
    turned: &mut Vec<Option<wgpu::Buffer>>,
    chunk: usize,
) -> Result<(), BackendError> {
    turned.resize_with(geometry.chunks.len(), || None);
    if turned[chunk].is_none() {
        if geometry.vertices.len() > 1 {
            let why = "the scene is held in several pieces of vertices;";
            return Err(unsupported("values that an own shader does not interpolate", why));
        }
        let first = geometry.chunks[chunk].first as usize;
        let end = geometry.chunks.get(chunk + 1).map_or(scene.triangles.len(), |next| next.first as usize);
        let corners: Vec<[u32; 3]> = scene.triangles[first..end].iter().map(|[a, b, c]| [*c, *a, *b]).collect();
        let bytes = bytemuck::cast_slice(&corners);
        turned[chunk] = Some(gpu.upload_buffer("upload of turned triangles", wgpu::BufferUsages::INDEX, bytes)?);
    }
    Ok(())
}
