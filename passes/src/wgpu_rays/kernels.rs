//! Compiled programs, and the layouts of their bindings.

use super::images::{OUTPUT_FORMAT, sample_type};
use super::programs::{self, Arithmetic, Kind, Stage};
use super::split::Split;
use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::{BackendError, RayJob};
use curitiba_pipeline::programs::TextureLod;
use std::collections::HashMap;

/// The layouts, and the programs compiled so far.
#[derive(Debug)]
pub struct Kernels {
    /// Layouts of the bind groups: 0 parameters and images, 1 the scene, 2 the pass's tables.
    pub groups: [wgpu::BindGroupLayout; 3],
    /// How the scene's arrays are spread over bindings.
    pub split: Split,
    layout: wgpu::PipelineLayout,
    compiled: HashMap<(Kind, Stage, (Arithmetic, TextureLod)), wgpu::ComputePipeline>,
}

fn entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

fn read_only() -> wgpu::BindingType {
    buffer(wgpu::BufferBindingType::Storage { read_only: true })
}

impl Kernels {
    pub fn new(gpu: &Gpu, split: Split) -> Result<Self, BackendError> {
        let channel = |channel: u32| {
            let ty = wgpu::BindingType::Texture {
                sample_type: sample_type(channel as usize),
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            };
            entry(1 + channel, ty)
        };
        let picture = wgpu::BindingType::StorageTexture {
            access: wgpu::StorageTextureAccess::WriteOnly,
            format: OUTPUT_FORMAT,
            view_dimension: wgpu::TextureViewDimension::D2,
        };
        let counts = buffer(wgpu::BufferBindingType::Storage { read_only: false });
        let mut images = vec![entry(0, buffer(gpu.parameters.binding()))];
        images.extend((0..4).map(channel));
        images.extend([entry(5, picture), entry(6, counts), entry(7, counts)]);
        let scene: Vec<_> = (0..split.count()).map(|binding| entry(binding, read_only())).collect();
        let tables = vec![entry(0, read_only())];
        let groups =
            [("rays: images", images), ("rays: scene", scene), ("rays: tables", tables)].map(|(label, entries)| {
                let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
                gpu.device.create_bind_group_layout(&descriptor)
            });
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("rays"),
            bind_group_layouts: &groups.each_ref().map(Some),
            ..Default::default()
        });
        gpu.check("creation of the layouts of rays")?;
        Ok(Self { groups, split, layout, compiled: HashMap::new() })
    }

    /// The kernels of a job in their order, compiled on first use.
    pub fn require(
        &mut self,
        gpu: &Gpu,
        job: &RayJob<'_>,
        (kind, stages): (Kind, &[Stage]),
        arithmetic: Arithmetic,
    ) -> Result<Vec<(Stage, &wgpu::ComputePipeline)>, BackendError> {
        let lod = job.texture_lod();
        let key = |stage: Stage| (kind.at(stage), stage, (arithmetic, lod));
        for &stage in stages {
            if self.compiled.contains_key(&key(stage)) {
                continue;
            }
            let source = programs::source(kind, stage, (arithmetic, lod), self.split);
            let source = source.ok_or_else(|| programs::not_written(super::NAME, job.program))?;
            let doing = format!("compiling `{}` ({stage:?})", job.program.info().stem);
            let pipeline = compile(gpu, Some(&self.layout), &source, &doing)?;
            self.compiled.insert(key(stage), pipeline);
        }
        Ok(stages.iter().map(|stage| (*stage, &self.compiled[&key(*stage)])).collect())
    }
}

/// Compiles a WGSL source with the entry `main`. The source declares its parameters as uniform; for devices that need it, the declaration
/// is changed to a storage buffer. Without a layout, the layout is derived from what the entry uses.
pub fn compile(
    gpu: &Gpu,
    layout: Option<&wgpu::PipelineLayout>,
    source: &str,
    doing: &str,
) -> Result<wgpu::ComputePipeline, BackendError> {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(doing),
        source: wgpu::ShaderSource::Wgsl(gpu.parameters.declared(source)),
    });
    gpu.check(doing)?;
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(doing),
        layout,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions {
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        },
        cache: None,
    });
    gpu.check_made(doing)?;
    Ok(pipeline)
}
