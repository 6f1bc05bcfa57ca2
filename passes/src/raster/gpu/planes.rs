//! The program that computes the planes of triangles, for depth on them.

use super::device::Gpu;
use super::geometry::{Chunk, DeviceGeometry};
use curitiba_pipeline::backend::BackendError;

/// Threads of a group of the program.
const GROUP: u32 = 64;
/// Greatest number of groups in a direction that every device has.
const MOST_GROUPS: u32 = 65_535;

/// The program, and what it reads.
#[derive(Debug)]
pub(super) struct PlaneProgram(wgpu::ComputePipeline);

impl PlaneProgram {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("planes.wgsl"),
            source: wgpu::ShaderSource::Wgsl(include_str!("planes.wgsl").into()),
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("planes"),
            layout: None,
            module: &module,
            entry_point: Some("plane_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        gpu.check("building the program of planes")?;
        Ok(Self(pipeline))
    }

    /// Binds the triangles of a chunk, and a camera's uniforms `frame`.
    pub fn bind(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        geometry: &DeviceGeometry,
        chunk: &Chunk,
    ) -> Result<wgpu::BindGroup, BackendError> {
        let buffers = [frame, &chunk.indices, &geometry.vertices[chunk.vertices].positions, chunk.planes(gpu)?];
        let entries = [0, 1, 2, 3]
            .map(|binding| wgpu::BindGroupEntry { binding, resource: buffers[binding as usize].as_entire_binding() });
        Ok(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("planes"),
            layout: &self.0.get_bind_group_layout(0),
            entries: &entries,
        }))
    }

    /// Computes the planes of chunks, whose numbers of triangles come with what was [bound](Self::bind).
    pub fn record<'a>(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        chunks: impl Iterator<Item = (&'a wgpu::BindGroup, u32)>,
    ) {
        pass.set_pipeline(&self.0);
        for (group, triangles) in chunks {
            let groups = triangles.div_ceil(GROUP);
            let rows = groups.div_ceil(MOST_GROUPS);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(groups.div_ceil(rows.max(1)), rows, 1);
        }
    }
}
