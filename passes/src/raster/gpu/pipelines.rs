//! Bind group layouts, and one render pipeline for each shader variant.

use super::device::Gpu;
use super::planes::PlaneProgram;
use super::shader::{DrawUniform, FrameUniform, LIGHTS_BYTES, Variant};
use super::targets::{DEPTH_FORMAT, Stored};
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::scene::texture::{Magnification, Sampling, Wrap};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::num::NonZeroU64;

/// The layouts and the sampler that all pipelines share.
#[derive(Debug)]
pub(super) struct Layouts {
    /// Group 0: `Frame`, and `Draw` at a dynamic offset. The second of each pair also has `Lights`, for several lights or a positional
    /// light. The second pair also has the planes of triangles, for depth on them.
    uniforms: [[wgpu::BindGroupLayout; 2]; 2],
    /// Groups 1 to 3: a texture and the sampler.
    pub texture: wgpu::BindGroupLayout,
    /// Repeating sampler, linear within a level and between two levels.
    pub trilinear: wgpu::Sampler,
    /// Pipeline layouts: for each layout of [`Self::uniforms`], by the number of textures.
    pipelines: [[[wgpu::PipelineLayout; 4]; 2]; 2],
    /// The program that computes the planes of triangles; `None` if the device cannot have depth on planes.
    pub planes: Option<PlaneProgram>,
}

impl Layouts {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let device = &gpu.device;
        let uniforms = |lights: bool, planes: bool| {
            let mut entries = uniforms(wgpu::ShaderStages::VERTEX_FRAGMENT, lights);
            if planes {
                entries.push(storage(3, wgpu::ShaderStages::FRAGMENT));
            }
            let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some("uniforms"), entries: &entries };
            device.create_bind_group_layout(&descriptor)
        };
        // A device without depth on planes may lack the storage buffers for layouts with planes. Then the second pair is made without
        // planes, and no pipeline uses it.
        let has_planes = gpu.has_plane_depth();
        let uniforms = [false, has_planes].map(|planes| [false, true].map(|lights| uniforms(lights, planes)));
        let fragment = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE,
            ty,
            count: None,
        };
        let texture = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("texture"),
            entries: &[
                fragment(
                    0,
                    wgpu::BindingType::Texture {
                        sample_type: wgpu::TextureSampleType::Float { filterable: true },
                        view_dimension: wgpu::TextureViewDimension::D2,
                        multisampled: false,
                    },
                ),
                fragment(1, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
            ],
        });
        let trilinear = trilinear(device, Sampling::default());
        let layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            let descriptor = wgpu::PipelineLayoutDescriptor {
                label: Some("gbuffer"),
                bind_group_layouts: groups,
                immediate_size: 0,
            };
            device.create_pipeline_layout(&descriptor)
        };
        let pipelines = uniforms.each_ref().map(|pair| {
            pair.each_ref().map(|first| {
                let groups = [Some(first), Some(&texture), Some(&texture), Some(&texture)];
                [1, 2, 3, 4].map(|count: usize| layout(&groups[..count]))
            })
        });
        gpu.check("creation of the layouts")?;
        let planes = has_planes.then(|| PlaneProgram::new(gpu)).transpose()?;
        Ok(Self { uniforms, texture, trilinear, pipelines, planes })
    }

    /// The layout of group 0, with or without `Lights` and planes.
    pub fn uniforms(&self, lights: bool, planes: bool) -> &wgpu::BindGroupLayout {
        &self.uniforms[usize::from(planes)][usize::from(lights)]
    }
}

/// `Frame`, `Draw` at a dynamic offset and, for several lights or a positional light, `Lights`.
fn uniforms(visibility: wgpu::ShaderStages, lights: bool) -> Vec<wgpu::BindGroupLayoutEntry> {
    let uniform = |binding, size: usize, has_dynamic_offset| wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset,
            min_binding_size: NonZeroU64::new(size as u64),
        },
        count: None,
    };
    let mut entries = vec![uniform(0, size_of::<FrameUniform>(), false), uniform(1, size_of::<DrawUniform>(), true)];
    if lights {
        entries.push(uniform(2, LIGHTS_BYTES, false));
    }
    entries
}

fn storage(binding: u32, visibility: wgpu::ShaderStages) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: true },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}

/// A sampler that is linear within a level and between two levels, unless the texture is magnified and `sampling` selects the nearest texel.
pub(super) fn trilinear(device: &wgpu::Device, sampling: Sampling) -> wgpu::Sampler {
    let [address_mode_u, address_mode_v] = sampling.wrap.map(|wrap| match wrap {
        Wrap::Repeat => wgpu::AddressMode::Repeat,
        Wrap::Mirror => wgpu::AddressMode::MirrorRepeat,
        Wrap::Clamp => wgpu::AddressMode::ClampToEdge,
    });
    device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("trilinear"),
        address_mode_u,
        address_mode_v,
        mag_filter: match sampling.magnification {
            Magnification::Linear => wgpu::FilterMode::Linear,
            Magnification::Nearest => wgpu::FilterMode::Nearest,
        },
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..Default::default()
    })
}

/// The pipelines built so far.
#[derive(Debug, Default)]
pub(super) struct Pipelines {
    drawing: HashMap<(Variant, Stored), wgpu::RenderPipeline>,
    shading: HashMap<(Variant, Stored), wgpu::ComputePipeline>,
    /// Layouts of group 0 of [`Self::shading`], with and without `Lights`.
    shading_layouts: HashMap<(bool, Stored), wgpu::BindGroupLayout>,
}

impl Pipelines {
    /// Builds the pipeline of a variant unless it exists already.
    pub fn require(
        &mut self,
        gpu: &Gpu,
        layouts: &Layouts,
        variant: Variant,
        stored: Stored,
    ) -> Result<(), BackendError> {
        if variant.per_pixel {
            let group = self.shading_layouts.entry((variant.many, stored));
            let group = group.or_insert_with(|| shading_layout(gpu, variant.many, stored));
            if let Entry::Vacant(entry) = self.shading.entry((variant, stored)) {
                entry.insert(build_shading(gpu, layouts, group, variant, stored));
            }
        } else if let Entry::Vacant(entry) = self.drawing.entry((variant, stored)) {
            entry.insert(build(gpu, layouts, variant, stored));
        }
        gpu.check("building a pipeline")
    }

    /// The pipeline of a variant that was [required](Self::require) before.
    pub fn get(&self, variant: Variant, stored: Stored) -> Option<&wgpu::RenderPipeline> {
        self.drawing.get(&(variant, stored))
    }

    /// The compute pipeline of a variant that shades each pixel once and was [required](Self::require) before.
    pub fn get_shading(&self, variant: Variant, stored: Stored) -> Option<&wgpu::ComputePipeline> {
        self.shading.get(&(variant, stored))
    }

    /// The layout of group 0 of the variants that shade each pixel once, with or without `Lights`.
    pub fn shading_layout(&self, many: bool, stored: Stored) -> Option<&wgpu::BindGroupLayout> {
        self.shading_layouts.get(&(many, stored))
    }
}

/// How many of the groups 1 to 3, of textures, a variant has. A pipeline with a group also has all groups before it.
fn textures(variant: Variant) -> usize {
    match variant {
        Variant { bent: true, .. } => 3,
        Variant { glow_textured: true, .. } => 2,
        Variant { textured: true, .. } => 1,
        _ => 0,
    }
}

/// Binding of the first attachment in a program that shades each pixel once; the others follow.
pub(super) const FIRST_ATTACHMENT: u32 = 10;
/// Bindings of the visibility buffer, and of indices, positions, normals, texture coordinates, colours and tangents.
pub(super) const VISIBLE: u32 = 3;
pub(super) const BUFFERS: [u32; 6] = [4, 5, 6, 7, 8, 9];

fn shading_layout(gpu: &Gpu, many: bool, stored: Stored) -> wgpu::BindGroupLayout {
    let visibility = wgpu::ShaderStages::COMPUTE;
    let mut entries = uniforms(visibility, many);
    entries.push(wgpu::BindGroupLayoutEntry {
        binding: VISIBLE,
        visibility,
        ty: wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Uint,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        count: None,
    });
    entries.extend(BUFFERS.map(|binding| storage(binding, visibility)));
    for (binding, format) in (FIRST_ATTACHMENT..).zip(stored.formats()) {
        entries.extend(format.map(|format| wgpu::BindGroupLayoutEntry {
            binding,
            visibility,
            ty: wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format,
                view_dimension: wgpu::TextureViewDimension::D2,
            },
            count: None,
        }));
    }
    let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some("shading"), entries: &entries };
    gpu.device.create_bind_group_layout(&descriptor)
}

fn build_shading(
    gpu: &Gpu,
    layouts: &Layouts,
    group: &wgpu::BindGroupLayout,
    variant: Variant,
    stored: Stored,
) -> wgpu::ComputePipeline {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("gbuffer.wgsl"),
        source: wgpu::ShaderSource::Wgsl(variant.shading_source(stored).into()),
    });
    let groups = [Some(group), Some(&layouts.texture), Some(&layouts.texture), Some(&layouts.texture)];
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("shading"),
        bind_group_layouts: &groups[..=textures(variant)],
        immediate_size: 0,
    });
    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("shading"),
        layout: Some(&layout),
        module: &module,
        entry_point: Some("pixel_main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

/// Vertex buffer slots of normals, texture coordinates, colours and tangents, `None` where the variant reads none; slot 0 holds positions.
pub(super) fn slots(variant: Variant) -> [Option<u32>; 4] {
    let mut next = 0;
    [variant.vertex_normal, variant.texcoord(), variant.vertex_color, variant.bent].map(|read| {
        next += u32::from(read);
        read.then_some(next)
    })
}

/// Bias that makes the device's own depth nearer where fragments write the depth of planes. It is greater than the change of depth by
/// snapping corners (to 1/16 pixel at the coarsest) and by rounding. The shader subtracts it.
const DEPTH_BIAS: wgpu::DepthBiasState = wgpu::DepthBiasState { constant: 16, slope_scale: 0.0625, clamp: 0.0 };

fn build(gpu: &Gpu, layouts: &Layouts, variant: Variant, stored: Stored) -> wgpu::RenderPipeline {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("gbuffer.wgsl"),
        source: wgpu::ShaderSource::Wgsl(variant.source().into()),
    });
    const POSITIONS: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![0 => Float32x3];
    const NORMALS: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![1 => Float32x3];
    const TEXCOORDS: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![2 => Float32x2];
    const COLORS: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![3 => Float32x4];
    const TANGENTS: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![4 => Float32x4];
    let buffer = |attributes: &'static [wgpu::VertexAttribute]| {
        let array_stride = attributes.iter().map(|attribute| attribute.format.size()).sum();
        Some(wgpu::VertexBufferLayout { array_stride, step_mode: wgpu::VertexStepMode::Vertex, attributes })
    };
    let mut buffers = vec![buffer(&POSITIONS)];
    if variant.vertex_normal {
        buffers.push(buffer(&NORMALS));
    }
    if variant.texcoord() {
        buffers.push(buffer(&TEXCOORDS));
    }
    if variant.vertex_color {
        buffers.push(buffer(&COLORS));
    }
    if variant.bent {
        buffers.push(buffer(&TANGENTS));
    }
    let targets = stored.formats().map(|format| format.map(wgpu::ColorTargetState::from));
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("gbuffer"),
        layout: Some(
            &layouts.pipelines[usize::from(variant.plane_depth)][usize::from(variant.many)][textures(variant)],
        ),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &buffers,
        },
        // Triangles with counter-clockwise corners face the front.
        primitive: wgpu::PrimitiveState { cull_mode: variant.culled.then_some(wgpu::Face::Back), ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            // Depth is reversed. Of equal depths the first drawn stays, which has the lower triangle id.
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: if variant.early { DEPTH_BIAS } else { wgpu::DepthBiasState::default() },
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: variant.has_fragment_stage().then(|| wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: if variant.writes() { &targets } else { &[] },
        }),
        multiview_mask: None,
        cache: None,
    })
}
