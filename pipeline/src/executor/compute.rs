//! Compute passes: a compute shader of the project's own runs on the rasteriser's device, and stores to images and buffers.

use super::textures::sampled;
use super::{Observer, Renderer, StepKind};
use crate::backend::{BackendError, ComputeJob};
use crate::plan::PlannedPass;
use crate::project::PassKind;
use std::time::Instant;

impl Renderer {
    /// Runs a compute pass.
    pub(super) fn compute(
        &mut self,
        planned: &PlannedPass,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let run_of_script = self.plan.pass(planned).run();
        let PassKind::Compute(pass) = self.plan.pass(planned).kind.clone() else { return Ok(()) };
        self.load_sampled(&pass.shader)?;
        observer.begin(StepKind::Quad, name, &self.progress());
        let start = Instant::now();
        let uniforms = self.compute_uniforms(&pass.shader);
        let mut buffers = self.take_buffers(&pass.shader, planned.pass);
        let textures = sampled(&pass.shader, &self.targets, &self.quad_images);
        let job =
            ComputeJob { program: &pass.shader.program, uniforms: &uniforms, textures: &textures, groups: pass.groups };
        let run = self.engines.raster.compute(&job, &mut buffers);
        self.give_buffers(&pass.shader, buffers);
        self.round_stored(planned);
        let elapsed = start.elapsed();
        observer.end();
        let row = self.timeline.record_run(StepKind::Quad, name, elapsed, run_of_script);
        row.note = format!("compute shader on {}", self.engines.raster.name());
        run
    }
}
