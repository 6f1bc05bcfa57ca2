//! The program that computes the planes of triangles, for depth on them.

use super::device::Gpu;
use super::geometry::{Chunk, DeviceGeometry};
use super::resources::{entry, rectangle};
use curitiba_pipeline::backend::BackendError;

/// Threads of a workgroup of the program.
const GROUP: u32 = 64;

/// The program's WGSL source.
pub(super) const TEXT: &str = concat!(include_str!("camera_planes.wgsl"), "\n", include_str!("planes.wgsl"));

/// The compiled program.
#[derive(Debug)]
pub(super) struct PlaneProgram(wgpu::ComputePipeline);

impl PlaneProgram {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        Ok(Self(gpu.compute_program("planes", TEXT.into(), "plane_main")?))
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
        let entries = [0, 1, 2, 3].map(|binding| entry(binding, buffers[binding as usize]));
        Ok(gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("planes"),
            layout: &self.0.get_bind_group_layout(0),
            entries: &entries,
        }))
    }

    /// Records the computation of the planes of chunks. Each chunk is given by its [bind group](Self::bind) and its number of triangles.
    pub fn record<'a>(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        chunks: impl Iterator<Item = (&'a wgpu::BindGroup, u32)>,
    ) {
        pass.set_pipeline(&self.0);
        for (group, triangles) in chunks {
            let [across, down] = rectangle(triangles.div_ceil(GROUP), gpu.limits.max_compute_workgroups_per_dimension);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(across, down, 1);
        }
    }
}
