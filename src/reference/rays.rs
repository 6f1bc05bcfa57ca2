//! The ray backend of references.

use crate::passes::cpu::{self, CpuRays};
use crate::passes::trace::Double;
use crate::pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use crate::pipeline::executor::Progress;
use crate::pipeline::glass::Dielectric;
use crate::pipeline::image::Image;
use crate::pipeline::programs::{Fidelity, RayParams, RayProgram};
use crate::pipeline::scene::RenderScene;
use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

/// Approximate memory of [`Double`] per triangle, bytes; building needs as much in addition.
const BYTES_PER_TRIANGLE: u64 = 400;

/// Samples and seed of a reference with noise, in place of the pass's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sampling {
    /// Total number of samples of the reference.
    pub all: u32,
    /// Index of the first sample of this render.
    pub first: u32,
    /// Number of samples of this render.
    pub samples: u32,
    pub seed: u32,
}

/// Runs the programs of the cpu backend on the `f64` tracer, or on the fast tracer with a given number of samples.
///
/// The structure is built when rays are first traced: a reference that is found in its folder needs none.
pub(super) struct ReferenceRays {
    exact: bool,
    sampling: Rc<Cell<Sampling>>,
    scene: Option<(Arc<RenderScene>, Vec<bool>)>,
    double: Option<Double>,
    fast: Option<CpuRays>,
}

impl ReferenceRays {
    pub fn new(exact: bool, sampling: Rc<Cell<Sampling>>) -> Self {
        Self { exact, sampling, scene: None, double: None, fast: None }
    }
}

impl RayBackend for ReferenceRays {
    fn name(&self) -> &'static str {
        "reference"
    }

    fn device(&self) -> String {
        if self.exact { "rays in f64" } else { "cpu, many samples" }.to_owned()
    }

    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }

    fn supports_glass(&self, _: RayProgram, _: &RayParams, _: &[Dielectric]) -> Result<(), BackendError> {
        Ok(())
    }

    fn traces_sun_discs(&self) -> bool {
        true
    }

    fn knows_lights(&self) -> bool {
        true
    }

    fn sees_skies(&self) -> bool {
        true
    }

    /// References of the picture do not use this backend, and references of many samples trace spheres. For references in `f64`, [`Self::run`]
    /// refuses spheres.
    fn traces_spheres(&self) -> bool {
        true
    }

    fn traces_cones(&self) -> bool {
        true
    }

    fn shoots_photons(&self) -> bool {
        true
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        (self.double, self.fast) = (None, None);
        self.scene = Some((Arc::clone(scene), filtered.to_vec()));
        Ok(BuildStats::default())
    }

    fn bytes_per_triangle(&self) -> u64 {
        BYTES_PER_TRIANGLE
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        let Some((scene, filtered)) = &self.scene else { return CpuRays::new().run(job, output, progress) };
        if self.exact {
            if job.program == RayProgram::Dummy {
                return CpuRays::new().run(job, output, progress);
            }
            if !scene.geometry.spheres.is_empty() {
                let what = format!("{} with exact spheres", job.program.info().stem);
                let why = "the reference of an effect without noise knows triangles only; the picture has one: curitiba reference PROJECT";
                return Err(BackendError::Unsupported { backend: self.name(), what, why: why.to_owned() });
            }
            let double = self.double.get_or_insert_with(|| Double::build(&scene.geometry, filtered));
            return cpu::trace(double, job, output, progress);
        }
        if self.fast.is_none() {
            let mut fast = CpuRays::new();
            fast.build(scene, filtered)?;
            self.fast = Some(fast);
        }
        let Sampling { all, first, samples, seed } = self.sampling.get();
        // Each sample of a pixel uses `all` consecutive numbers of the sequence; `before` is the number of pixel samples before this one.
        let [first, first_sun] = [job.params.first, job.params.first_sun].map(|before| before * all + first);
        let of_occlusion = if job.params.samples > 0 { samples } else { 0 };
        let params = RayParams { samples: of_occlusion, sun_samples: samples, first, first_sun, ..job.params };
        let job = RayJob { params, seed, ..*job };
        match &mut self.fast {
            Some(fast) => fast.run(&job, output, progress),
            None => unreachable!("it was built above"),
        }
    }
}
