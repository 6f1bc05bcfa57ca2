//! Exact spheres: which passes show them, and which engines cannot.

use super::{Plan, PlanError, PlannedPass, Work};
use crate::backend::{BackendError, Rasteriser, RayBackend};
use crate::programs::{Fidelity, RayProgram};
use crate::project::PassKind;

impl Plan {
    /// The place where the first exact sphere that a pass shows is declared; `None` if it shows none.
    #[must_use]
    pub fn exact_sphere(&self, planned: &PlannedPass) -> Option<&str> {
        let (Work::Raster { scene_set, .. }
        | Work::Rays { scene_set, .. }
        | Work::Effect { scene_set, .. }
        | Work::Intersection { scene_set }) = planned.work
        else {
            return None;
        };
        self.scene_sets.get(scene_set)?.iter().find_map(|scene| self.project.scenes[*scene].exact_sphere())
    }

    /// Fails if an effect pass, or a pass in thesis fidelity, shows exact spheres: no engine supports these combinations.
    pub(super) fn check_spheres(&self) -> Result<(), PlanError> {
        for planned in &self.passes {
            let Some(place) = self.exact_sphere(planned) else { continue };
            let name = &self.pass(planned).name;
            let what = match (&planned.work, self.settings.fidelity) {
                (Work::Effect { .. }, _) => "draws maps of triangles",
                (_, Fidelity::Thesis) => "is in thesis fidelity, which knows triangles only",
                _ => continue,
            };
            let message = format!("{place}: pass `{name}` shows exact spheres, and {what}");
            let instead = match planned.work {
                Work::Effect { .. } => "let a ray pass do what the raster pass does",
                _ => "use --fidelity corrected",
            };
            return Err(PlanError::new(message, format!("{instead}, or declare the spheres without exact=\"true\"")));
        }
        Ok(())
    }

    /// The name of the first raster pass that shows exact spheres, if the rasteriser cannot draw them, and the error with a remedy.
    #[must_use]
    pub fn undrawn_spheres(&self, raster: &dyn Rasteriser) -> Option<(String, BackendError)> {
        self.first_refused(|planned| {
            if raster.draws_spheres() || !matches!(planned.work, Work::Raster { .. }) {
                return None;
            }
            Some(BackendError::no_spheres(
                raster.name(),
                "a pass",
                self.exact_sphere(planned)?,
                "draw with --raster cpu",
            ))
        })
    }

    /// The name of the first ray pass that shows exact spheres which its ray backend cannot trace, and the error with a remedy.
    /// `rays_of` returns the ray backend for the name of a pass.
    #[must_use]
    pub fn untraced_spheres<'a>(&self, rays_of: impl Fn(&str) -> &'a dyn RayBackend) -> Option<(String, BackendError)> {
        self.first_refused(|planned| {
            let pass = self.pass(planned);
            let PassKind::Ray(ray) = &pass.kind else { return None };
            let rays = rays_of(&pass.name);
            let runs = matches!(planned.work, Work::Rays { .. });
            if rays.traces_spheres() || !runs || ray.program == RayProgram::Dummy {
                return None;
            }
            let help = "use --backend cpu, or allow it with --fallback cpu";
            Some(BackendError::no_spheres(rays.name(), ray.program.info().stem, self.exact_sphere(planned)?, help))
        })
    }

    /// The name of the first ray pass that asks for a feature which its ray backend lacks, and the error with the reason `why`.
    /// `rays_of` returns the ray backend for the name of a pass, `asked` the feature that a pass asks for, and `has` whether a
    /// backend has it.
    pub(super) fn first_lacking<'a>(
        &self,
        rays_of: impl Fn(&str) -> &'a dyn RayBackend,
        asked: impl Fn(&PlannedPass) -> Option<String>,
        has: impl Fn(&dyn RayBackend) -> bool,
        why: &str,
    ) -> Option<(String, BackendError)> {
        self.first_refused(|planned| {
            let pass = self.pass(planned);
            let PassKind::Ray(ray) = &pass.kind else { return None };
            let rays = rays_of(&pass.name);
            let asked = asked(planned).filter(|_| !has(rays))?;
            let what = format!("{} with {asked}", ray.program.info().stem);
            Some(BackendError::Unsupported { backend: rays.name(), what, why: why.to_owned() })
        })
    }

    /// The name of the first pass for which `why` returns an error, with that error.
    pub(super) fn first_refused(
        &self,
        why: impl Fn(&PlannedPass) -> Option<BackendError>,
    ) -> Option<(String, BackendError)> {
        self.passes.iter().find_map(|planned| Some((self.pass(planned).name.clone(), why(planned)?)))
    }
}
