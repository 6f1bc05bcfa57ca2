//! Fallbacks: ray backends that take over after a failure, if the user allowed it.

use super::{Fallback, Observer, RenderError, Renderer};
use crate::backend::{BackendError, RayBackend};
use crate::glass::first_target;
use crate::plan::Traced;
use crate::programs::{RayParams, RayProgram};

impl Renderer {
    /// Every ray backend that failed so far, and its replacement.
    #[must_use]
    pub fn fallbacks(&self) -> &[Fallback] {
        &self.engines.fallbacks
    }

    /// Reports the ray backends that could not be made, each with the first pass of the plan that traces rays.
    pub(super) fn tell_of_fallbacks(&mut self, observer: &mut dyn Observer) {
        let mut passes = self.plan.passes.iter();
        let pass = passes.find(|planned| self.plan.traced(planned).is_some());
        let pass = pass.map(|planned| self.plan.pass(planned).name.clone());
        for fallback in &mut self.engines.fallbacks {
            fallback.pass.clone_from(&pass);
            observer.fell_back(fallback);
        }
    }

    /// Replaces the ray backend after a failure by the next fallback that can be made and can run every pass. The fallback has no
    /// acceleration structure yet.
    ///
    /// # Errors
    /// The failure itself, if no fallback is left: none was allowed, or all have failed.
    pub(super) fn stand_in(
        &mut self,
        pass: &str,
        error: BackendError,
        observer: &mut dyn Observer,
    ) -> Result<(), RenderError> {
        let (mut failed, mut error) = (self.engines.rays_of(pass).name(), error);
        let frame = (self.frame > 0).then_some(self.frame);
        loop {
            self.engines.spares.retain(|spare| spare.name != failed);
            let Some(spare) = self.engines.spares.pop_front() else {
                return Err(RenderError::Pass { pass: pass.to_owned(), frame, error });
            };
            let fallback = Fallback {
                pass: Some(pass.to_owned()),
                frame,
                failed: failed.to_owned(),
                why: error.to_string(),
                instead: spare.name.to_owned(),
            };
            observer.fell_back(&fallback);
            self.engines.fallbacks.push(fallback);
            failed = spare.name;
            error = match (spare.make)() {
                Ok(rays) => {
                    *self.engines.rays_of_mut(pass) = rays;
                    self.built = None;
                    (self.joined, self.lent, self.shares_picture) = (None, false, false);
                    self.decide_showing_quad();
                    match self.unsupported() {
                        None => return Ok(()),
                        Some((_, error)) => error,
                    }
                }
                Err(error) => error,
            };
        }
    }

    /// The first pass that its ray backend cannot run, with the reason. Glass features are checked once the scenes are loaded.
    pub(super) fn unsupported(&self) -> Option<(String, BackendError)> {
        let rays_of = |pass: &str| self.engines.rays_of(pass);
        let plan = &self.plan;
        let refused = plan.untraced_spheres(rays_of).or_else(|| plan.untraced_sun(rays_of));
        let refused = refused.or_else(|| plan.unlit(rays_of)).or_else(|| plan.without_cones(rays_of));
        if let Some(refused) = refused.or_else(|| plan.unfiltered(rays_of)).or_else(|| plan.unsampled(rays_of)) {
            return Some(refused);
        }
        self.plan.passes.iter().enumerate().find_map(|(index, planned)| {
            let pass = self.plan.pass(planned);
            let Traced { program, scene_set, .. } = self.plan.traced(planned)?;
            let rays = rays_of(&pass.name);
            let Some((program, params)) = program else {
                return Some((pass.name.clone(), rays.supports_intersections().err()?));
            };
            let materials = self.materials.get(index).filter(|materials| materials.glass.contains(&true));
            let glass = || materials.map_or(Ok(()), |m| rays.supports_glass(program, &params, &m.dielectrics));
            let sky = || self.unseen_sky(index, scene_set, (program, rays)).map_or(Ok(()), Err);
            let photons = || self.unshot_photons(index, scene_set, (program, &params, rays)).map_or(Ok(()), Err);
            let supported = rays.supports(program, self.plan.settings.fidelity);
            let error = supported.and_then(|()| glass()).and_then(|()| photons()).and_then(|()| sky()).err()?;
            Some((pass.name.clone(), error))
        })
    }

    /// The error if a pass shoots photons at meshes and its backend cannot.
    fn unshot_photons(
        &self,
        index: usize,
        scene_set: usize,
        (program, params, rays): (RayProgram, &RayParams, &dyn RayBackend),
    ) -> Option<BackendError> {
        let photons = program.photons(params);
        if photons == 0 || rays.shoots_photons() {
            return None;
        }
        let materials = &self.materials.get(index)?.dielectrics;
        let target = first_target(&self.scenes.get(scene_set)?.scene, materials)?;
        Some(BackendError::no_photons(rays.name(), program.info().stem, photons, target))
    }

    /// The error if the glass of a pass would show a sky, and the rays of its backend do not hit skies.
    fn unseen_sky(
        &self,
        index: usize,
        scene_set: usize,
        (program, rays): (RayProgram, &dyn RayBackend),
    ) -> Option<BackendError> {
        let mirrors = program.info().names("closest_hit_glass") && self.materials.get(index)?.glass.contains(&true);
        let is_there = !self.scenes.get(scene_set)?.scene.geometry.sky.is_empty();
        (mirrors && is_there && !rays.sees_skies()).then(|| {
            let what = format!("{} with a sky that its glass shows", program.info().stem);
            let why = "its rays do not see skies; use --backend cpu, or allow it with --fallback cpu, or leave <sky> out of \
                       the scene, which then throws shadows as any surface does";
            BackendError::Unsupported { backend: rays.name(), what, why: why.to_owned() }
        })
    }
}
