//! A ray backend that implements only what every backend must.

use curitiba::passes::cpu::CpuRays;
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use curitiba::pipeline::executor::Progress;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::programs::{Fidelity, RayProgram};
use curitiba::pipeline::scene::RenderScene;
use std::sync::Arc;

/// The processor's backend without any optional ability.
pub struct Plain(pub CpuRays);

impl RayBackend for Plain {
    fn name(&self) -> &'static str {
        "plain"
    }

    fn device(&self) -> String {
        "made up".to_owned()
    }

    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.0.build(scene, filtered)
    }

    fn bytes_per_triangle(&self) -> u64 {
        self.0.bytes_per_triangle()
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        self.0.run(job, output, progress)
    }
}
