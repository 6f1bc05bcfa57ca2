//! One pipeline for each own shader and each state and set of attachments that it is drawn with.

use super::super::device::Gpu;
use super::super::targets::{DEPTH_FORMAT, Stored};
use curitiba_pipeline::backend::{BackendError, OwnShaders};
use curitiba_pipeline::glsl::{Attribute, Blend, BlendFactor, Drawn, Program, SamplerKind, Stage};
use std::num::NonZeroU64;
use std::ptr;
use std::sync::{Arc, Weak};

/// A pipeline and the layouts of its groups.
#[derive(Debug)]
pub(super) struct Built {
    pub pipeline: wgpu::RenderPipeline,
    pub groups: Groups,
}

/// The layouts of a program's groups.
#[derive(Debug)]
pub(super) struct Groups {
    pub uniforms: wgpu::BindGroupLayout,
    pub textures: wgpu::BindGroupLayout,
    /// Layout of the storage buffers, if there are any.
    pub storage: Option<wgpu::BindGroupLayout>,
}

/// The attachments that a pipeline draws into, and its state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Into {
    formats: Vec<Option<wgpu::TextureFormat>>,
    depth: bool,
    culled: Option<wgpu::Face>,
    drawn: Drawn,
    /// Index of the attachment that receives depth; `None` if none does.
    kept: Option<usize>,
    /// Depth clamp: geometry beyond the near or far plane is drawn at that plane's depth instead of being clipped.
    clamped: bool,
    /// By sampler: whether it reads a texture unfiltered.
    exact: Vec<bool>,
    /// Whether several programs of the pass bind storage buffers. A pass cannot bind a buffer both as read-only and as read-write, so buffers
    /// that are only read are then bound as read-write, too.
    shares_storage: bool,
}

impl Into {
    /// The attachments and the state of a draw in a raster pass.
    pub fn attachments(
        stored: Stored,
        drawn: Drawn,
        culled: Option<wgpu::Face>,
        own: &OwnShaders<'_>,
        exact: Vec<bool>,
    ) -> Self {
        let (formats, kept, clamped) = (stored.formats().to_vec(), own.depth, own.clamped);
        let shares_storage = own.programs.iter().filter(|program| !program.storage.is_empty()).count() > 1;
        Self { formats, depth: true, culled, drawn, kept, clamped, exact, shares_storage }
    }

    /// The target of a quad: one texture of full precision, without a depth buffer.
    pub fn quad(exact: Vec<bool>) -> Self {
        let (formats, drawn) = (vec![Some(QUAD_FORMAT)], Drawn::default());
        let (culled, kept, clamped, shares_storage) = (None, None, false, false);
        Self { formats, depth: false, culled, drawn, kept, clamped, exact, shares_storage }
    }
}

/// Format of the texture that a quad is drawn into.
pub(super) const QUAD_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// The key of a pipeline among those of one program.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Key {
    into: Into,
    missing: Vec<Attribute>,
}

/// The pipelines of the programs that still exist. A weak reference does not keep a program alive, but it keeps the program's address from
/// being reused.
#[derive(Debug, Default)]
pub(super) struct Pipelines(Vec<(Weak<Program>, Key, Built)>);

impl Pipelines {
    /// The pipeline of a program, built unless it exists. An attribute that is `missing` in the scene has the same value at every vertex.
    /// Before a pipeline is built, those of programs that are gone, as after a project was read again, are dropped.
    pub fn require(
        &mut self,
        gpu: &Gpu,
        program: &Arc<Program>,
        into: Into,
        missing: &[Attribute],
    ) -> Result<&Built, BackendError> {
        let key = Key { into, missing: missing.to_vec() };
        let found =
            self.0.iter().position(|(known, of, _)| ptr::eq(known.as_ptr(), Arc::as_ptr(program)) && *of == key);
        let index = match found {
            Some(index) => index,
            None => {
                self.0.retain(|(known, ..)| known.strong_count() > 0);
                let built = build(gpu, program, &key);
                gpu.check("building the pipeline of an own shader")?;
                self.0.push((Arc::downgrade(program), key, built));
                self.0.len() - 1
            }
        };
        Ok(&self.0[index].2)
    }
}

/// The layouts of a program's groups, and the layout of its pipeline. `exact` holds, by sampler, whether it reads a texture
/// unfiltered.
/// With `shares_storage`, no buffer is bound as read-only.
pub(super) fn groups(
    gpu: &Gpu,
    program: &Program,
    exact: &[bool],
    shares_storage: bool,
) -> (Groups, wgpu::PipelineLayout) {
    let device = &gpu.device;
    let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let (sampling, storing) = match program.compute {
        Some(_) => (wgpu::ShaderStages::COMPUTE, wgpu::ShaderStages::COMPUTE),
        None => (wgpu::ShaderStages::VERTEX_FRAGMENT, wgpu::ShaderStages::FRAGMENT),
    };
    let blocks: Vec<wgpu::BindGroupLayoutEntry> = (0..)
        .zip(&program.blocks)
        .map(|(binding, block)| {
            let visibility = match block.stage {
                Stage::Vertex => wgpu::ShaderStages::VERTEX,
                Stage::Fragment => wgpu::ShaderStages::FRAGMENT,
                Stage::Compute => wgpu::ShaderStages::COMPUTE,
            };
            let ty = wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: NonZeroU64::new(block.size.into()),
            };
            entry(binding, visibility, ty)
        })
        .collect();
    let samplers: Vec<wgpu::BindGroupLayoutEntry> = (0..)
        .zip(&program.samplers)
        .flat_map(|(index, sampler): (u32, _)| {
            let exact = exact.get(index as usize) == Some(&true);
            let texture = wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: !exact },
                view_dimension: match sampler.kind {
                    SamplerKind::Cube => wgpu::TextureViewDimension::Cube,
                    SamplerKind::Color | SamplerKind::Compared => wgpu::TextureViewDimension::D2,
                },
                multisampled: false,
            };
            let sampler = wgpu::BindingType::Sampler(match exact {
                true => wgpu::SamplerBindingType::NonFiltering,
                false => wgpu::SamplerBindingType::Filtering,
            });
            [entry(2 * index, sampling, texture), entry(2 * index + 1, sampling, sampler)]
        })
        .collect();
    let group = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
    };
    let (uniforms, textures) = (group("own uniforms", &blocks), group("own textures", &samplers));
    let stored: Vec<wgpu::BindGroupLayoutEntry> = (0..)
        .zip(&program.storage)
        .map(|(binding, buffer)| {
            let ty = wgpu::BufferBindingType::Storage { read_only: buffer.readonly && !shares_storage };
            let ty = wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
            entry(binding, storing, ty)
        })
        .collect();
    let storage = (!stored.is_empty()).then(|| group("own buffers", &stored));
    let mut listed = vec![Some(&uniforms), Some(&textures)];
    listed.extend(storage.as_ref().map(Some));
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("own shader"),
        bind_group_layouts: &listed,
        immediate_size: 0,
    });
    (Groups { uniforms, textures, storage }, layout)
}

fn build(gpu: &Gpu, program: &Program, key: &Key) -> Built {
    let device = &gpu.device;
    let (groups, layout) = groups(gpu, program, &key.into.exact, key.into.shares_storage);
    let module = |label, text: &str| {
        // `var<storage>` means read-only. The source must agree with the layout, which is read-write for shared storage.
        let text = match key.into.shares_storage {
            true => text.replace("var<storage>", "var<storage, read_write>").into(),
            false => text.into(),
        };
        device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(text),
        })
    };
    let (vertex, fragment) =
        (module("own vertex shader", &program.vertex), module("own fragment shader", &program.fragment));
    let attributes: Vec<[wgpu::VertexAttribute; 1]> = program
        .attributes
        .iter()
        .map(|attribute| {
            let format = match attribute {
                Attribute::Position | Attribute::Normal => wgpu::VertexFormat::Float32x3,
                Attribute::TexCoord => wgpu::VertexFormat::Float32x2,
                // Shaders read only the direction, not the handedness in the fourth component.
                Attribute::Tangent => wgpu::VertexFormat::Float32x4,
            };
            [wgpu::VertexAttribute { format, offset: 0, shader_location: attribute.location() }]
        })
        .collect();
    let buffers: Vec<Option<wgpu::VertexBufferLayout<'_>>> = attributes
        .iter()
        .zip(&program.attributes)
        .map(|(attributes, attribute)| {
            let array_stride = if key.missing.contains(attribute) { 0 } else { attributes[0].format.size() };
            Some(wgpu::VertexBufferLayout { array_stride, step_mode: wgpu::VertexStepMode::Vertex, attributes })
        })
        .collect();
    let written = |location: usize| program.outputs.get(location) == Some(&true);
    let (formats, drawn) = (&key.into.formats, key.into.drawn);
    let hides = drawn.tests_depth && drawn.writes_depth;
    let targets: Vec<Option<wgpu::ColorTargetState>> = (0..formats.len())
        .map(|location| {
            let kept = key.into.kept == Some(location);
            let writes = written(location) && (!kept || hides);
            let write_mask = if writes { wgpu::ColorWrites::ALL } else { wgpu::ColorWrites::empty() };
            let blend = drawn.blend.filter(|_| written(location) && !kept).map(blend_state);
            formats[location].map(|format| wgpu::ColorTargetState { format, blend, write_mask })
        })
        .collect();
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("own shader"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &vertex,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &buffers,
        },
        primitive: wgpu::PrimitiveState {
            cull_mode: key.into.culled,
            unclipped_depth: key.into.clamped,
            ..Default::default()
        },
        depth_stencil: key.into.depth.then(|| wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(hides),
            depth_compare: Some(match drawn.tests_depth {
                true => wgpu::CompareFunction::Greater,
                false => wgpu::CompareFunction::Always,
            }),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &fragment,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    });
    Built { pipeline, groups }
}

/// Alpha is blended with the same factors as the colours.
fn blend_state(Blend { source, destination }: Blend) -> wgpu::BlendState {
    let factor = |factor| match factor {
        BlendFactor::Zero => wgpu::BlendFactor::Zero,
        BlendFactor::One => wgpu::BlendFactor::One,
        BlendFactor::SrcColor => wgpu::BlendFactor::Src,
        BlendFactor::OneMinusSrcColor => wgpu::BlendFactor::OneMinusSrc,
        BlendFactor::DstColor => wgpu::BlendFactor::Dst,
        BlendFactor::OneMinusDstColor => wgpu::BlendFactor::OneMinusDst,
        BlendFactor::SrcAlpha => wgpu::BlendFactor::SrcAlpha,
        BlendFactor::OneMinusSrcAlpha => wgpu::BlendFactor::OneMinusSrcAlpha,
        BlendFactor::DstAlpha => wgpu::BlendFactor::DstAlpha,
        BlendFactor::OneMinusDstAlpha => wgpu::BlendFactor::OneMinusDstAlpha,
    };
    let operation = wgpu::BlendOperation::Add;
    let added = wgpu::BlendComponent { src_factor: factor(source), dst_factor: factor(destination), operation };
    wgpu::BlendState { color: added, alpha: added }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::gpu::tests::{own_program, rasteriser};

    #[test]
    fn pipelines_of_programs_that_are_gone_are_dropped() {
        let Some(rasteriser) = rasteriser() else { return };
        let mut pipelines = Pipelines::default();
        let mut require = |program: &Arc<Program>, exact: Vec<bool>| {
            pipelines.require(&rasteriser.gpu, program, Into::quad(exact), &[]).expect("builds");
            pipelines.0.len()
        };
        let kept = own_program(None);
        // Two pipelines of one program.
        assert_eq!([Vec::new(), vec![true], Vec::new()].map(|exact| require(&kept, exact)), [1, 2, 2]);
        for _ in 0..3 {
            assert_eq!(require(&own_program(None), Vec::new()), 3);
        }
        assert_eq!(require(&kept, vec![true]), 3);
    }
}
