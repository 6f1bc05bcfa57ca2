//! Values that a pass prepares from its job, once for all pixels and on every backend.

use super::lights::disc_samples;
use super::occlusion::open_shares;
use crate::sampling::HemisphereSampler;
use crate::sampling::cone::ConeSampler;
use curitiba_pipeline::backend::RayJob;
use curitiba_pipeline::programs::{Fidelity, RayParams, Sampler};
use glam::Vec3;

/// Values that all pixels of a pass share, beside the scene.
#[derive(Debug)]
pub struct Preparation {
    /// Directions of the occlusion rays of a point; thesis fidelity always takes strata. `None` switches occlusion off.
    pub sampler: Option<HemisphereSampler>,
    /// See [`open_shares`]; empty where occlusion is off.
    pub open_share: Vec<f32>,
    /// Unit vector towards the job's `sun`; 0 where it has none.
    pub to_light: Vec3,
    /// Directions of the rays to the discs of directional lights; `None` where these are points, and in thesis fidelity.
    pub disc: Option<ConeSampler>,
    /// Linear colour of the job's `sun`; 0 where it has none.
    pub light_color: Vec3,
}

impl Preparation {
    /// The preparation of a job.
    ///
    /// # Errors
    /// If a sampler cannot have the number of samples that the job requests; the error says why.
    pub fn of(job: &RayJob<'_>) -> Result<Self, String> {
        let samples = job.program.info().samples(&job.params);
        let kind = match job.fidelity {
            Fidelity::Corrected => job.params.sampler,
            Fidelity::Thesis => Sampler::Strata,
        };
        let sampler = (samples > 0).then(|| HemisphereSampler::from(kind, job.params.first, samples)).transpose()?;
        let open_share = if samples == 0 { Vec::new() } else { open_shares(samples, job.params.intensity) };
        let (to_light, light_color) = job.sun.map_or((Vec3::ZERO, Vec3::ZERO), |sun| (-sun.direction, sun.color));
        let over_disc = disc_samples(job);
        let RayParams { sun, first_sun, .. } = job.params;
        let disc = (over_disc > 0).then(|| ConeSampler::new(sun, first_sun, over_disc)).transpose()?;
        Ok(Self { sampler, open_share, to_light, disc, light_color })
    }
}
