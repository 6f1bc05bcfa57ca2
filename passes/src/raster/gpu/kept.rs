//! Copies to the device the contents with which a pass starts if its attachments are not cleared, and copies back the depth that the pass
//! leaves.

use super::device::Gpu;
use super::faults::unsupported;
use super::resources;
use super::targets::{CHANNELS, DEPTH_FORMAT, TRIANGLE, Targets};
use curitiba_pipeline::backend::{BackendError, GBuffer, Rect};
use curitiba_pipeline::image::narrow;

/// Shader that writes the depths of a texture into the depth buffer, which no copy command can do.
const PROGRAM: &str = "
@group(0) @binding(0) var depths: texture_2d<f32>;

@vertex
fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let at = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4<f32>(at * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn depth(@builtin(position) at: vec4<f32>) -> @builtin(frag_depth) f32 {
    return textureLoad(depths, vec2<i32>(at.xy), 0).r;
}
";

/// Bytes that are copied to the device at once.
const PIECE: usize = 64 << 20;

/// The pipeline that loads depths.
#[derive(Debug)]
pub(super) struct DepthLoader {
    pipeline: wgpu::RenderPipeline,
}

impl DepthLoader {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("kept depth"),
            source: wgpu::ShaderSource::Wgsl(PROGRAM.into()),
        });
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("kept depth"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: false },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            }],
        });
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("kept depth"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("kept depth"),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("corner"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Always),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("depth"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[],
            }),
            multiview_mask: None,
            cache: None,
        });
        gpu.check("compiling the program that loads depths")?;
        Ok(Self { pipeline })
    }

    /// Writes the depths that `target` holds of a part of the viewport into the depth buffer of `targets`. The part is relative to the
    /// viewport's corner.
    pub fn load(
        &self,
        gpu: &Gpu,
        targets: &Targets,
        (viewport, part): (Rect, Rect),
        target: &GBuffer,
    ) -> Result<(), BackendError> {
        let (width, height) = targets.size();
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let format = wgpu::TextureFormat::R32Float;
        let texture = resources::texture(gpu, "kept depth", format, [width, height], usage);
        gpu.check("creation of the kept depth")?;
        upload(gpu, &texture, (viewport, part), target, |pixels| bytemuck::cast_slice(&target.depth[pixels]).to_vec())?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("kept depth"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) }],
        });
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("kept depth") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("kept depth"),
                color_attachments: &[],
                depth_stencil_attachment: Some(targets.depth_attachment(false, true)),
                timestamp_writes: None,
                occlusion_query_set: None,
                multiview_mask: None,
            });
            pass.set_scissor_rect(part.x, part.y, part.width, part.height);
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..3, 0..1);
        }
        gpu.submit_and_wait(Some(encoder.finish()), "loading the depth")
    }
}

/// Copies a part of the viewport from `target` into those of the device's attachments that are `wanted`.
pub(super) fn load_colors(
    gpu: &Gpu,
    targets: &Targets,
    rects: (Rect, Rect),
    target: &GBuffer,
    wanted: [bool; 4],
) -> Result<(), BackendError> {
    let formats = targets.stored().formats();
    let floats = [&target.color, &target.position, &target.normal];
    for channel in (0..CHANNELS.len()).filter(|channel| wanted[*channel]) {
        let (Some(texture), Some(format)) = (targets.texture(channel), formats[channel]) else { continue };
        let half = format == wgpu::TextureFormat::Rgba16Float;
        upload(gpu, texture, rects, target, |pixels| match channel {
            // The device stores ids plus 1; 0 means none.
            TRIANGLE => target.triangle[pixels].iter().flat_map(|id| id.wrapping_add(1).to_ne_bytes()).collect(),
            _ if half => narrow(floats[channel][pixels].as_flattened()),
            _ => bytemuck::cast_slice(&floats[channel][pixels]).to_vec(),
        })?;
    }
    Ok(())
}

/// Copies rows of the target to a part of a texture. `bytes` returns the texels of a range of the target's pixels.
fn upload(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    (viewport, part): (Rect, Rect),
    target: &GBuffer,
    bytes: impl Fn(std::ops::Range<usize>) -> Vec<u8>,
) -> Result<(), BackendError> {
    let (left, top) = (viewport.x + part.x - target.origin[0], viewport.y + part.y - target.origin[1]);
    let texel = texture.format().block_copy_size(None).unwrap_or(16);
    let row = texel * part.width;
    let most = (PIECE / row as usize).max(1) as u32;
    for first in (0..part.height).step_by(most as usize) {
        let rows = most.min(part.height - first);
        let mut data = Vec::with_capacity(row as usize * rows as usize);
        for line in first..first + rows {
            let start = (top + line) as usize * target.width as usize + left as usize;
            data.extend(bytes(start..start + part.width as usize));
        }
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: part.x, y: part.y + first, z: 0 },
                aspect: wgpu::TextureAspect::All,
            },
            &data,
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            wgpu::Extent3d { width: part.width, height: rows, depth_or_array_layers: 1 },
        );
        gpu.submit_and_wait(None, "loading the target")?;
    }
    Ok(())
}

/// Copies a part of the viewport from the depth buffer to the depths of `target`. Devices can copy only whole depth buffers.
pub(super) fn read_depth(
    gpu: &Gpu,
    targets: &Targets,
    (viewport, part): (Rect, Rect),
    target: &mut GBuffer,
) -> Result<(), BackendError> {
    let (width, height) = targets.size();
    let pitch = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let bytes = u64::from(pitch) * u64::from(height);
    if bytes > gpu.max_buffer_bytes {
        let why =
            format!("its depth takes {bytes} bytes, and {} copies {} at most;", gpu.adapter, gpu.max_buffer_bytes);
        return Err(unsupported("a pass that leaves its depth for another", &why));
    }
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let buffer = gpu.buffer("the depth that is left", usage, bytes)?;
    let descriptor = wgpu::CommandEncoderDescriptor { label: Some("depth that is left") };
    let mut encoder = gpu.device.create_command_encoder(&descriptor);
    encoder.copy_texture_to_buffer(
        wgpu::TexelCopyTextureInfo {
            texture: targets.depth_texture(),
            mip_level: 0,
            origin: wgpu::Origin3d::ZERO,
            aspect: wgpu::TextureAspect::DepthOnly,
        },
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(pitch), rows_per_image: None },
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
    let (left, top) = (viewport.x + part.x - target.origin[0], viewport.y + part.y - target.origin[1]);
    let row_of_target = target.width as usize;
    gpu.read_mapped(&buffer, bytes, Some(encoder.finish()), "reading the depth", |bytes| {
        for row in 0..part.height {
            let source = &bytes[(part.y + row) as usize * pitch as usize + 4 * part.x as usize..];
            let start = (top + row) as usize * row_of_target + left as usize;
            let line = &mut target.depth[start..start + part.width as usize];
            let line: &mut [u8] = bytemuck::cast_slice_mut(line);
            line.copy_from_slice(&source[..line.len()]);
        }
    })
}
