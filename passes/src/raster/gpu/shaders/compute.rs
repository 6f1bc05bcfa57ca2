//! Compute shaders of projects.

use super::super::device::Gpu;
use super::super::faults::{failure, unsupported};
use super::pipelines::{Groups, groups};
use super::quad::{bind_sampled, bind_storage, read_stored, unfiltered, upload_storage};
use super::textures::Textures;
use super::uniforms;
use curitiba_pipeline::backend::{BackendError, ComputeJob};
use curitiba_pipeline::glsl::Program;
use std::ptr;
use std::sync::{Arc, Weak};

/// The pipeline of a compute shader, and the layouts of its bind groups.
#[derive(Debug)]
struct Kernel {
    /// Keeps the program's address from being reused, but not the program alive.
    program: Weak<Program>,
    /// By sampler: whether it reads a texture unfiltered.
    exact: Vec<bool>,
    pipeline: wgpu::ComputePipeline,
    groups: Groups,
}

/// The pipelines of the programs that still exist.
#[derive(Debug, Default)]
pub(super) struct Kernels(Vec<Kernel>);

impl Kernels {
    /// Runs a compute shader, and reads back what it stored.
    pub fn run(
        &mut self,
        gpu: &Gpu,
        textures: &Textures,
        job: &ComputeJob<'_>,
        buffers: &mut [Vec<[f32; 4]>],
    ) -> Result<(), BackendError> {
        let most = gpu.limits.max_compute_workgroups_per_dimension;
        if let Some(many) = job.groups.iter().find(|count| **count > most) {
            let why = format!("{} takes {most} in one direction at most;", gpu.adapter);
            return Err(unsupported(&format!("{many} work groups"), &why));
        }
        let exact = unfiltered(job.program, job.textures, gpu.has(wgpu::Features::FLOAT32_FILTERABLE));
        let kernel = self.require(gpu, job.program, &exact)?;
        let blocks = uniforms(gpu, &kernel.groups, job.program, job.uniforms)?;
        let sampled = bind_sampled(gpu, (&kernel.groups, job.program), textures, job.textures, &exact)?;
        let storage = upload_storage(gpu, buffers)?;
        let stored = bind_storage(gpu, &kernel.groups, &storage);
        gpu.check("binding of what a compute shader reads")?;
        let label = Some("compute");
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label });
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
            pass.set_pipeline(&kernel.pipeline);
            pass.set_bind_group(0, &blocks, &[]);
            pass.set_bind_group(1, &sampled, &[]);
            if let Some(stored) = &stored {
                pass.set_bind_group(2, stored, &[]);
            }
            let [x, y, z] = job.groups;
            pass.dispatch_workgroups(x, y, z);
        }
        gpu.submit_and_wait(Some(encoder.finish()), "a compute shader")?;
        read_stored(gpu, job.program, &storage, buffers)
    }

    /// The pipeline of a program, built unless it exists. Before it is built, pipelines of programs that are gone are dropped.
    fn require(&mut self, gpu: &Gpu, program: &Arc<Program>, exact: &[bool]) -> Result<&Kernel, BackendError> {
        let same = |kernel: &Kernel| ptr::eq(kernel.program.as_ptr(), Arc::as_ptr(program)) && kernel.exact == exact;
        let index = match self.0.iter().position(same) {
            Some(index) => index,
            None => {
                self.0.retain(|kernel| kernel.program.strong_count() > 0);
                let Some(compute) = &program.compute else { return Err(failure("this is no compute shader")) };
                let (groups, layout) = groups(gpu, program, exact, false);
                let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some("own compute shader"),
                    source: wgpu::ShaderSource::Wgsl(compute.text.as_str().into()),
                });
                let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some("own compute shader"),
                    layout: Some(&layout),
                    module: &module,
                    entry_point: Some("main"),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    cache: None,
                });
                gpu.check("building the pipeline of a compute shader")?;
                self.0.push(Kernel { program: Arc::downgrade(program), exact: exact.to_vec(), pipeline, groups });
                self.0.len() - 1
            }
        };
        Ok(&self.0[index])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::gpu::tests::{own_program, rasteriser};
    use curitiba_pipeline::glsl::Compute;

    #[test]
    fn kernels_of_programs_that_are_gone_are_dropped() {
        let Some(rasteriser) = rasteriser() else { return };
        let mut kernels = Kernels::default();
        let mut require = |program: &Arc<Program>| {
            kernels.require(&rasteriser.gpu, program, &[]).expect("builds");
            kernels.0.len()
        };
        let program = || {
            let text = "@compute @workgroup_size(1) fn main() {}".to_owned();
            own_program(Some(Compute { text, group: [1; 3] }))
        };
        let kept = program();
        assert_eq!([require(&kept), require(&kept)], [1, 1]);
        for _ in 0..3 {
            assert_eq!(require(&program()), 2);
        }
        assert_eq!(require(&kept), 2);
    }
}
