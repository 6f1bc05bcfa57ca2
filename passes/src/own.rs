//! Ray passes with a function of the caller's instead of a program; the function gets the G-buffer and the scene's
//! tracer.

use crate::cpu::{CpuRays, empty, trace_pixels};
use crate::effects::Pixel;
use crate::trace::Bvh;
use curitiba_pipeline::backend::{BackendError, BuildStats, IntersectionJob, RayBackend, RayCounts, RayJob, RayStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::Dielectric;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba_pipeline::scene::RenderScene;
use std::sync::Arc;

/// The arguments of the function for a pixel.
pub struct At<'a> {
    /// The pass: scene, camera, light, parameters, and the attachments that the replaced program reads, indexed by
    /// [`Pixel::index`].
    pub job: &'a RayJob<'a>,
    /// The tracer of the scene's triangles.
    pub tracer: &'a Bvh,
    /// The pixel to compute.
    pub pixel: Pixel,
    /// Counts of the rays that the function traces, which it keeps itself; they appear in the table of the pass.
    pub rays: &'a mut RayCounts,
}

/// The processor's backend with a function of the caller's instead of one program: all passes of that program compute
/// the function.
///
/// The replaced program decides what the pass may read ([`RayProgram::info`]). For example, `final` has position,
/// normal and colour; `dummy` has the colour alone. The plan, the other passes and the parameters are those of the project.
///
/// Where the replaced program would trace no ray ([`may_trace`](crate::cpu::may_trace)), for example `dummy` or `ssao` with `samples=0`,
/// no structure may have been built. The tracer is then that of an empty scene.
///
/// Scenes with exact spheres are refused, because the function gets only triangles.
///
/// The function runs on many threads at once, for pixels in any order; its result should depend only on its arguments.
/// A panic in it becomes a panic of [`RayBackend::run`].
pub struct OwnProgram<F> {
    rays: CpuRays,
    replaced: RayProgram,
    pixel: F,
}

impl<F: Fn(At<'_>) -> [f32; 4] + Sync> OwnProgram<F> {
    /// `pixel` returns the four linear numbers that a pass of `replaced` writes at a pixel.
    #[must_use]
    pub fn new(replaced: RayProgram, pixel: F) -> Self {
        Self { rays: CpuRays::new(), replaced, pixel }
    }
}

impl<F: Fn(At<'_>) -> [f32; 4] + Sync> RayBackend for OwnProgram<F> {
    fn name(&self) -> &'static str {
        self.rays.name()
    }

    fn device(&self) -> String {
        self.rays.device()
    }

    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        self.rays.supports(program, fidelity)
    }

    fn supports_glass(
        &self,
        program: RayProgram,
        params: &RayParams,
        dielectrics: &[Dielectric],
    ) -> Result<(), BackendError> {
        self.rays.supports_glass(program, params, dielectrics)
    }

    fn traces_sun_discs(&self) -> bool {
        self.rays.traces_sun_discs()
    }

    fn knows_lights(&self) -> bool {
        self.rays.knows_lights()
    }

    fn filters_shares(&self) -> bool {
        self.rays.filters_shares()
    }

    fn samples_adaptively(&self) -> bool {
        self.rays.samples_adaptively()
    }

    fn sees_skies(&self) -> bool {
        self.rays.sees_skies()
    }

    fn traces_cones(&self) -> bool {
        self.rays.traces_cones()
    }

    fn shoots_photons(&self) -> bool {
        self.rays.shoots_photons()
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.rays.build(scene, filtered)
    }

    fn build_until(
        &mut self,
        scene: &Arc<RenderScene>,
        filtered: &[bool],
        progress: &Progress,
    ) -> Result<BuildStats, BackendError> {
        self.rays.build_until(scene, filtered, progress)
    }

    fn bytes_per_triangle(&self) -> u64 {
        self.rays.bytes_per_triangle()
    }

    fn supports_intersections(&self) -> Result<(), BackendError> {
        self.rays.supports_intersections()
    }

    fn intersect(
        &mut self,
        job: &IntersectionJob<'_>,
        hits: &mut [[f32; 4]],
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        self.rays.intersect(job, hits, progress)
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        if job.program != self.replaced {
            return self.rays.run(job, output, progress);
        }
        let none = empty();
        let tracer = &self.rays.tracer(job)?.unwrap_or(&none).triangles;
        let pixel = |pixel, rays: &mut RayCounts| (self.pixel)(At { job, tracer, pixel, rays });
        let rays = trace_pixels(job, output, progress, pixel)?;
        Ok(RayStats { rays, ..RayStats::default() })
    }
}
