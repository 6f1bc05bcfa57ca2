//! The draw calls of a pass, and their uniforms.

use super::device::Gpu;
use super::faults::failure;
use super::geometry::{Chunk, DeviceGeometry};
use super::pipelines::{Layouts, Pipelines, slots};
use super::shader::{DrawUniform, FrameUniform, LIGHTS_BYTES, Variant, lights_uniform};
use super::targets::Stored;
use super::textures::DeviceTextures;
use curitiba_pipeline::backend::{Attachments, BackendError, Light, RasterJob, Sun, View};
use std::num::NonZeroU64;

/// One draw call.
#[derive(Debug, Clone, Copy)]
struct Draw {
    variant: Variant,
    /// Indices of the textures of groups 1 to 3, where the variant has them: colour, glow, normal map.
    textures: [Option<u32>; 3],
    chunk: usize,
    /// First triangle of the scene.
    first: u32,
    count: u32,
    /// Offset of its uniforms.
    offset: u32,
}

/// The draw calls of the current pass. The buffers are kept from frame to frame.
#[derive(Debug)]
pub(super) struct DrawList {
    draws: Vec<Draw>,
    /// The attachments that the draws write.
    stored: Stored,
    /// By material: whether it is left out.
    left_out: Vec<bool>,
    /// `Draw` uniforms, `stride` bytes apart.
    bytes: Vec<u8>,
    /// Contents of the device's buffer.
    written: Vec<u8>,
    stride: usize,
    frame: wgpu::Buffer,
    uniforms: wgpu::Buffer,
    /// `Lights`; made for the first job with several lights, or one with a place.
    lights: Option<wgpu::Buffer>,
    /// Whether the listed draws are of such a job.
    many: bool,
    /// Whether the depth of the listed draws is that of planes.
    planes: bool,
    /// What the listed draws are bound to: by chunk if their depth is that of planes, else one.
    bindings: Vec<wgpu::BindGroup>,
}

impl DrawList {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let alignment = gpu.limits.min_uniform_buffer_offset_alignment as usize;
        let stride = size_of::<DrawUniform>().next_multiple_of(alignment.max(1));
        let frame = gpu.buffer("creation of the frame's uniforms", usage, size_of::<FrameUniform>() as u64)?;
        let uniforms = gpu.buffer("creation of the uniforms", usage, 64 * stride as u64)?;
        Ok(Self {
            draws: Vec::new(),
            stored: Stored::new(Attachments::default(), Attachments::default()),
            left_out: Vec::new(),
            bytes: Vec::new(),
            written: Vec::new(),
            stride,
            frame,
            uniforms,
            lights: None,
            many: false,
            planes: false,
            bindings: Vec::new(),
        })
    }

    /// Sets which materials, by index, the following jobs leave out; materials beyond the end are drawn.
    pub fn leave_out(&mut self, materials: &[bool]) {
        self.left_out.clear();
        self.left_out.extend_from_slice(materials);
    }

    /// Lists the draws of a job without the materials that are [left out](Self::leave_out), and uploads their uniforms.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        layouts: &Layouts,
        pipelines: &mut Pipelines,
        geometry: &DeviceGeometry,
        textures: &mut DeviceTextures,
        job: &RasterJob<'_>,
    ) -> Result<(), BackendError> {
        self.draws.clear();
        self.bytes.clear();
        self.stored = Stored::of(job);
        self.many = !job.lights.is_empty();
        self.planes = !job.snapped_depth && gpu.has_plane_depth();
        for part in &geometry.parts {
            if self.left_out.get(part.material as usize).copied().unwrap_or(false) {
                continue;
            }
            let Some(shade) = job.shades.get(part.material as usize) else {
                return Err(failure(&format!("the job has no shade for material {}", part.material)));
            };
            let culled = job.culled.get(part.material as usize) == Some(&true);
            let variant = Variant::new(job.attachments, geometry.has_normals, shade);
            let beyond = |texture: Option<u32>| {
                texture
                    .and_then(|texture| job.scene.textures.get(texture as usize))
                    .is_some_and(|texture| !texture.repeats())
            };
            let glow_texture = shade.glow.and_then(|glow| glow.texture).filter(|_| variant.glow_textured);
            let normal_texture = shade.normal_map.map(|map| map.texture).filter(|_| variant.bent);
            let wrapped =
                beyond(shade.texture.filter(|_| variant.textured)) || beyond(glow_texture) || beyond(normal_texture);
            let (mirrored, many, plane_depth) = (job.view.clip_plane.is_some(), self.many, self.planes);
            let sky = job.scene.materials.get(part.material as usize).is_some_and(|material| material.sky);
            let sky = sky && variant.writes();
            let variant = Variant { culled, wrapped, mirrored, many, sky, plane_depth, ..variant };
            if let Some(last) = self.draws.last_mut() {
                let adjacent = last.chunk == part.chunk && last.first + last.count == part.first;
                if adjacent && last.variant == variant && !variant.reads_material() {
                    last.count += part.count;
                    continue;
                }
            }
            pipelines.require(gpu, layouts, variant, self.stored)?;
            // A pipeline with a group also has all groups before it, whether it reads them or not.
            let glow = glow_texture.or(normal_texture);
            let textures_read = [if variant.textured { shade.texture } else { glow }, glow, normal_texture];
            for texture in textures_read.into_iter().flatten() {
                textures.require(gpu, layouts, job.scene, texture)?;
            }
            let Ok(offset) = u32::try_from(self.bytes.len()) else {
                return Err(failure("too many materials for one pass"));
            };
            let first_of_chunk = part.first - geometry.chunks[part.chunk].first;
            self.bytes.extend_from_slice(bytemuck::bytes_of(&DrawUniform::new(shade, part.first, first_of_chunk)));
            self.bytes.resize(offset as usize + self.stride, 0);
            let (chunk, first, count) = (part.chunk, part.first, part.count);
            self.draws.push(Draw { variant, textures: textures_read, chunk, first, count, offset });
        }
        self.write(gpu)?;
        if self.many {
            self.write_lights(gpu, job.lights)?;
        }
        self.bind(gpu, layouts, geometry)?;
        self.look(gpu, &job.view, [job.viewport.width, job.viewport.height], job.sun)
    }

    fn write_lights(&mut self, gpu: &Gpu, lights: &[Light]) -> Result<(), BackendError> {
        let Some(bytes) = lights_uniform(lights) else {
            return Err(failure(&format!("the pass has {} lights, more than its shader has room for", lights.len())));
        };
        let buffer = match self.lights.take() {
            Some(buffer) => buffer,
            None => {
                let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
                gpu.buffer("creation of the lights' uniforms", usage, LIGHTS_BYTES as u64)?
            }
        };
        gpu.queue.write_buffer(&buffer, 0, &bytes);
        gpu.check("upload of the lights")?;
        self.lights = Some(buffer);
        Ok(())
    }

    /// Binds what the listed draws read. It is bound for each job, because the buffers may be others by now.
    fn bind(&mut self, gpu: &Gpu, layouts: &Layouts, geometry: &DeviceGeometry) -> Result<(), BackendError> {
        let layout = layouts.uniforms(self.many, self.planes);
        let buffers = (&self.frame, &self.uniforms, self.lights.as_ref().filter(|_| self.many));
        let of_chunk = |chunk: &Chunk| {
            let positions = &geometry.vertices[chunk.vertices].positions;
            bind(gpu, layout, buffers, Some([&chunk.indices, positions]))
        };
        self.bindings = match self.planes {
            true => geometry.chunks.iter().map(of_chunk).collect(),
            false => vec![bind(gpu, layout, buffers, None)],
        };
        gpu.check("binding of the uniforms")
    }

    /// Changes the camera of the listed draws, for a picture of `size` pixels. Work that was submitted before keeps its camera.
    pub fn look(&self, gpu: &Gpu, view: &View, size: [u32; 2], sun: Option<Sun>) -> Result<(), BackendError> {
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&FrameUniform::new(view, size, sun)));
        gpu.check("upload of the frame's uniforms")
    }

    fn write(&mut self, gpu: &Gpu) -> Result<(), BackendError> {
        if self.bytes == self.written {
            return Ok(());
        }
        self.written.clear();
        if self.bytes.len() as u64 > self.uniforms.size() {
            let size = (self.bytes.len() as u64).next_power_of_two().min(gpu.limits.max_buffer_size);
            let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            self.uniforms = gpu.buffer("creation of the uniforms", usage, size)?;
        }
        gpu.queue.write_buffer(&self.uniforms, 0, &self.bytes);
        gpu.check("upload of the uniforms")?;
        self.written.extend_from_slice(&self.bytes);
        Ok(())
    }

    /// Records the draws in the order of their triangles.
    pub fn record(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipelines: &Pipelines,
        geometry: &DeviceGeometry,
        textures: &DeviceTextures,
    ) {
        let (mut bound_chunk, mut bound_variant, mut bound_textures) = (None, None, [None; 3]);
        for draw in &self.draws {
            let chunk = &geometry.chunks[draw.chunk];
            let new_variant = bound_variant != Some(draw.variant);
            if new_variant {
                let Some(pipeline) = pipelines.get(draw.variant, self.stored) else { continue };
                pass.set_pipeline(pipeline);
                bound_variant = Some(draw.variant);
            }
            if new_variant || bound_chunk != Some(draw.chunk) {
                let vertices = &geometry.vertices[chunk.vertices];
                let optional = [&vertices.normals, &vertices.texcoords, &vertices.colors, &vertices.tangents];
                pass.set_vertex_buffer(0, vertices.positions.slice(..));
                for (slot, buffer) in slots(draw.variant).into_iter().zip(optional) {
                    if let (Some(slot), Some(buffer)) = (slot, buffer) {
                        pass.set_vertex_buffer(slot, buffer.slice(..));
                    }
                }
                pass.set_index_buffer(chunk.indices.slice(..), wgpu::IndexFormat::Uint32);
                bound_chunk = Some(draw.chunk);
            }
            pass.set_bind_group(0, &self.bindings[if self.planes { draw.chunk } else { 0 }], &[draw.offset]);
            let asked = draw.textures;
            if new_variant || bound_textures != asked {
                for (group, texture) in (1..).zip(asked) {
                    if let Some(texture) = texture {
                        pass.set_bind_group(group, textures.binding(texture), &[]);
                    }
                }
                bound_textures = asked;
            }
            let first = 3 * (draw.first - chunk.first);
            pass.draw_indexed(first..first + 3 * draw.count, 0, 0..1);
        }
    }

    /// Number of draw calls.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.draws.len()
    }

    /// Number of triangles of all draws.
    pub fn triangles(&self) -> u64 {
        self.draws.iter().map(|draw| u64::from(draw.count)).sum()
    }
}

fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    (frame, uniforms, lights): (&wgpu::Buffer, &wgpu::Buffer, Option<&wgpu::Buffer>),
    corners: Option<[&wgpu::Buffer; 2]>,
) -> wgpu::BindGroup {
    let draw =
        wgpu::BufferBinding { buffer: uniforms, offset: 0, size: NonZeroU64::new(size_of::<DrawUniform>() as u64) };
    let mut entries = vec![
        wgpu::BindGroupEntry { binding: 0, resource: frame.as_entire_binding() },
        wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Buffer(draw) },
    ];
    let [indices, positions] = corners.map_or([None; 2], |corners| corners.map(Some));
    let others = [(2, lights), (3, indices), (4, positions)]
        .into_iter()
        .filter_map(|(binding, buffer)| Some(wgpu::BindGroupEntry { binding, resource: buffer?.as_entire_binding() }));
    entries.extend(others);
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("uniforms"), layout, entries: &entries })
}
