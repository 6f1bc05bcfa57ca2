//! The draw calls of a pass, and their uniforms.

use super::covered::covered;
use super::device::Gpu;
use super::faults::failure;
use super::geometry::{DeviceGeometry, Part, Vertices, union};
use super::pipelines::{BUFFERS, FIRST_ATTACHMENT, Layouts, Pipelines, VISIBLE, slots};
use super::resources::entry;
use super::shader::{DrawUniform, FrameUniform, LIGHTS_BYTES, Variant, lights_uniform};
use super::targets::{Stored, Targets};
use super::textures::DeviceTextures;
use curitiba_pipeline::backend::{Attachments, BackendError, Light, RasterJob, Rect, Sun, View};
use glam::{Vec3, Vec4};
use std::num::NonZeroU64;

/// Side of the square of pixels that a workgroup of a shading program shades.
const SHADING_GROUP: u32 = 16;

/// One draw call.
#[derive(Debug, Clone, Copy)]
struct Draw {
    variant: Variant,
    /// Indices of the textures of groups 1 to 3, where the variant has them: colour, glow, normal map.
    textures: [Option<u32>; 3],
    chunk: usize,
    /// Index in the scene of the first triangle.
    first: u32,
    count: u32,
    /// Offset of the draw's uniforms in the buffer of uniforms.
    offset: u32,
    /// Corners of the box around its triangles.
    bounds: [Vec3; 2],
    /// Width and height of the rectangle of pixels in which a program shades the draw's triangles.
    shaded: [u32; 2],
}

/// The draw calls of the current pass. The buffers are kept from frame to frame.
#[derive(Debug)]
pub(super) struct DrawList {
    draws: Vec<Draw>,
    /// The attachments that the draws write.
    stored: Stored,
    /// By material: whether its triangles are left out.
    left_out: Vec<bool>,
    /// `Draw` uniforms, `stride` bytes apart.
    bytes: Vec<u8>,
    /// Contents of the device's buffer of `Draw` uniforms.
    written: Vec<u8>,
    stride: usize,
    frame: wgpu::Buffer,
    uniforms: wgpu::Buffer,
    /// Buffer of `Lights`; made for the first job with several lights or a positional light.
    lights: Option<wgpu::Buffer>,
    /// Whether the listed draws bind `Lights`.
    many: bool,
    /// Whether the depth of the listed draws is computed on the planes of their triangles.
    planes: bool,
    /// Bind groups of the listed draws: one for each chunk if their depth is computed on planes, else a single one.
    bindings: Vec<wgpu::BindGroup>,
    /// Bind groups of the program that computes planes, by chunk. Empty if the depth of the listed draws is not computed on planes.
    plane_bindings: Vec<wgpu::BindGroup>,
    /// The part of the picture whose pixels are shaded once each, from the visibility buffer; `None` if triangles are drawn.
    shaded: Option<Rect>,
    /// Colour of pixels that show nothing.
    background: Vec4,
    /// Whether the triangle ids of a sky are written, too.
    sky_ids: bool,
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
            plane_bindings: Vec::new(),
            shaded: None,
            background: Vec4::ZERO,
            sky_ids: false,
        })
    }

    /// A list of draws that write the triangle ids of a sky, too.
    pub fn with_sky_ids(self) -> Self {
        Self { sky_ids: true, ..self }
    }

    /// Sets how the following jobs are drawn. With a `part` of the picture, each pixel of the part is shaded once, from the visibility buffer.
    /// With `None`, triangles are drawn.
    pub fn shade(&mut self, part: Option<Rect>) {
        self.shaded = part;
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
        self.planes = !job.snapped_depth && gpu.has_plane_depth() && self.shaded.is_none();
        for part in &geometry.parts {
            if self.left_out.get(part.material as usize).copied().unwrap_or(false) {
                continue;
            }
            let Some(shade) = job.shades.get(part.material as usize) else {
                return Err(failure(&format!("the job has no shade for material {}", part.material)));
            };
            let culled = job.culled.get(part.material as usize) == Some(&true);
            let mut variant = Variant::new(job.attachments, geometry.has_normals, shade);
            if self.shaded.is_some() {
                variant = variant.per_pixel();
            }
            let beyond = |texture: Option<u32>| {
                texture
                    .and_then(|texture| job.scene.textures.get(texture as usize))
                    .is_some_and(|texture| !texture.repeats())
            };
            let glow_texture = shade.glow.and_then(|glow| glow.texture).filter(|_| variant.glow_textured);
            let normal_texture = shade.normal_map.map(|map| map.texture).filter(|_| variant.bent);
            let wrapped =
                beyond(shade.texture.filter(|_| variant.textured)) || beyond(glow_texture) || beyond(normal_texture);
            let mirrored = job.view.clip_plane.is_some() && !variant.per_pixel;
            let culled = culled && !variant.per_pixel;
            let (many, plane_depth) = (self.many, self.planes);
            let early = plane_depth && gpu.has(wgpu::Features::SHADER_EARLY_DEPTH_TEST);
            let sky = job.scene.materials.get(part.material as usize).is_some_and(|material| material.sky);
            let sky = sky && variant.writes() && !self.sky_ids;
            let variant = Variant { culled, wrapped, mirrored, many, sky, plane_depth, early, ..variant };
            if let Some(last) = self.draws.last_mut() {
                let adjacent = last.chunk == part.chunk && last.first + last.count == part.first;
                if adjacent && last.variant == variant && !variant.reads_material() {
                    last.count += part.count;
                    last.bounds = union(last.bounds, part.bounds);
                    DrawUniform::set_count(&mut self.bytes[last.offset as usize..], last.count);
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
            let uniform = DrawUniform::new(shade, part.first, first_of_chunk, part.count);
            self.bytes.extend_from_slice(bytemuck::bytes_of(&uniform));
            self.bytes.resize(offset as usize + self.stride, 0);
            let Part { chunk, first, count, bounds, .. } = *part;
            self.draws.push(Draw {
                variant,
                textures: textures_read,
                chunk,
                first,
                count,
                offset,
                bounds,
                shaded: [0; 2],
            });
        }
        if !self.draws.is_empty() {
            DrawUniform::set_clears(&mut self.bytes);
        }
        if let Some(part) = self.shaded {
            self.cover(&job.view, [job.viewport.width, job.viewport.height], part);
        }
        self.background = job.clear_color;
        self.write(gpu)?;
        if self.many {
            self.write_lights(gpu, job.lights)?;
        }
        self.bind(gpu, layouts, geometry)?;
        self.look(gpu, &job.view, [job.viewport.width, job.viewport.height], job.sun)
    }

    /// Sets which pixels of a part of the picture are shaded for each draw.
    fn cover(&mut self, view: &View, size: [u32; 2], part: Rect) {
        for (index, draw) in self.draws.iter_mut().enumerate() {
            // The first draw also writes the pixels that show nothing.
            let pixels = match index {
                0 => Rect { x: 0, y: 0, ..part },
                _ => covered(view, size, part, draw.bounds),
            };
            draw.shaded = [pixels.width, pixels.height];
            DrawUniform::set_corner(&mut self.bytes[draw.offset as usize..], [pixels.x, pixels.y]);
        }
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

    /// Binds the buffers that the listed draws read. This is repeated for each job, because buffers may have been replaced since the last job.
    fn bind(&mut self, gpu: &Gpu, layouts: &Layouts, geometry: &DeviceGeometry) -> Result<(), BackendError> {
        self.bindings.clear();
        self.plane_bindings.clear();
        let layout = layouts.uniforms(self.many, self.planes);
        match layouts.planes.as_ref().filter(|_| self.planes) {
            _ if self.shaded.is_some() => {}
            Some(program) => {
                for chunk in &geometry.chunks {
                    let mut entries = self.uniforms();
                    entries.push(entry(3, chunk.planes(gpu)?));
                    self.bindings.push(group(gpu, layout, &entries));
                    self.plane_bindings.push(program.bind(gpu, &self.frame, geometry, chunk)?);
                }
            }
            None => {
                let group = group(gpu, layout, &self.uniforms());
                self.bindings.push(group);
            }
        }
        gpu.check("binding of the uniforms")
    }

    /// Bindings of `Frame`, `Draw` and, for several lights or a positional light, `Lights`.
    fn uniforms(&self) -> Vec<wgpu::BindGroupEntry<'_>> {
        let size = NonZeroU64::new(size_of::<DrawUniform>() as u64);
        let draw = wgpu::BufferBinding { buffer: &self.uniforms, offset: 0, size };
        let mut entries = vec![
            entry(0, &self.frame),
            wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Buffer(draw) },
        ];
        entries.extend(self.lights.as_ref().filter(|_| self.many).map(|lights| entry(2, lights)));
        entries
    }

    /// `Frame` of the listed draws and, for several lights or a positional light, `Lights`.
    pub fn shared_uniforms(&self) -> (&wgpu::Buffer, Option<&wgpu::Buffer>) {
        (&self.frame, self.lights.as_ref().filter(|_| self.many))
    }

    /// Changes the camera of the listed draws, for a picture of `size` pixels. Work that was submitted before keeps its camera.
    pub fn look(&self, gpu: &Gpu, view: &View, size: [u32; 2], sun: Option<Sun>) -> Result<(), BackendError> {
        let part = (self.shaded.unwrap_or(Rect { x: 0, y: 0, width: 0, height: 0 }), self.background);
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&FrameUniform::new(view, size, sun, part)));
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

    /// Whether depth is computed on planes, which [`Self::record_planes`] computes for each camera.
    pub fn has_planes(&self) -> bool {
        !self.plane_bindings.is_empty()
    }

    /// Records the computation of the planes, if the draws read planes. It must come before the draws.
    pub fn record_planes(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        layouts: &Layouts,
        geometry: &DeviceGeometry,
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) {
        if let Some(program) = layouts.planes.as_ref().filter(|_| self.has_planes()) {
            let descriptor = wgpu::ComputePassDescriptor { label: Some("planes"), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            let counts = geometry.chunks.iter().map(|chunk| chunk.count);
            program.record(gpu, &mut pass, self.plane_bindings.iter().zip(counts));
        }
    }

    /// Records the shading of each pixel, from the visibility buffer of `targets`.
    pub fn record_shading(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        pipelines: &Pipelines,
        (geometry, textures): (&DeviceGeometry, &DeviceTextures),
        targets: &Targets,
    ) -> Result<(), BackendError> {
        let Some(layout) = pipelines.shading_layout(self.many, self.stored) else { return Ok(()) };
        let visible = targets.visible(gpu)?;
        let view = |binding, view| wgpu::BindGroupEntry { binding, resource: wgpu::BindingResource::TextureView(view) };
        let mut bindings = Vec::with_capacity(geometry.chunks.len());
        for chunk in &geometry.chunks {
            let Vertices { positions, normals, texcoords, colors, tangents } = &geometry.vertices[chunk.vertices];
            // A program reads no attribute that the scene lacks; anything may be bound in its place.
            let [normals, texcoords, colors, tangents] =
                [normals, texcoords, colors, tangents].map(|attribute| attribute.as_ref().unwrap_or(positions));
            let buffers = [&chunk.indices, positions, normals, texcoords, colors, tangents];
            let mut entries = self.uniforms();
            entries.push(view(VISIBLE, visible));
            entries.extend(BUFFERS.into_iter().zip(buffers).map(|(binding, buffer)| entry(binding, buffer)));
            let attachments = (FIRST_ATTACHMENT..).zip(targets.views());
            entries.extend(attachments.filter_map(|(binding, attachment)| Some(view(binding, attachment?))));
            bindings.push(group(gpu, layout, &entries));
        }
        for draw in self.draws.iter().filter(|draw| !draw.shaded.contains(&0)) {
            let groups = draw.shaded.map(|side| side.div_ceil(SHADING_GROUP));
            let Some(pipeline) = pipelines.get_shading(draw.variant, self.stored) else { continue };
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bindings[draw.chunk], &[draw.offset]);
            for (group, texture) in (1..).zip(draw.textures) {
                if let Some(texture) = texture {
                    pass.set_bind_group(group, textures.binding(texture), &[]);
                }
            }
            pass.dispatch_workgroups(groups[0], groups[1], 1);
        }
        gpu.check("binding of what is shaded")
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

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.draws.is_empty()
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

fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, entries: &[wgpu::BindGroupEntry<'_>]) -> wgpu::BindGroup {
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("uniforms"), layout, entries })
}
