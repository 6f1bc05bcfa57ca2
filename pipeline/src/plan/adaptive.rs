//! Adaptive sampling of stochastic glass: which passes ask for it, and how much memory it takes.

use super::{Plan, PlannedPass, Work};
use crate::backend::{BackendError, RayBackend};
use crate::memory::mebibytes;
use crate::programs::{ADAPTIVE_BYTES, LEAST_ADAPTIVE_PATHS, RayParams};
use crate::project::PassKind;

impl Plan {
    /// The error that the glass of a ray pass is sampled to; `None` where every pixel has the same number of paths.
    #[must_use]
    pub fn sampled_to(&self, planned: &PlannedPass) -> Option<f32> {
        match (&planned.work, &self.pass(planned).kind) {
            (Work::Rays { params, .. }, PassKind::Ray(ray)) => ray.program.sampled_to(params),
            _ => None,
        }
    }

    /// The name of the first ray pass that asks for adaptive sampling of glass which its ray backend does not support, and the error
    /// with a remedy. `rays_of` returns the ray backend for the name of a pass.
    #[must_use]
    pub fn unsampled<'a>(&self, rays_of: impl Fn(&str) -> &'a dyn RayBackend) -> Option<(String, BackendError)> {
        let why = "it gives every pixel the same number of paths; use --backend cpu, or allow it with --fallback cpu, or set error=0 \
                       on the pass";
        self.first_lacking(
            rays_of,
            |planned| Some(format!("error={}", self.sampled_to(planned)?)),
            |rays| rays.samples_adaptively(),
            why,
        )
    }

    /// Greatest number of bytes that adaptive sampling takes in host memory: those for the largest target of a pass that asks for it, since
    /// passes run one after another.
    pub(super) fn adaptive_bytes(&self) -> u64 {
        let sampled = self.passes.iter().filter(|planned| self.sampled_to(planned).is_some());
        let pixels = sampled.map(|planned| self.held_pixels(self.target_size(self.pass(planned).target)));
        ADAPTIVE_BYTES * pixels.max().unwrap_or(0)
    }

    /// Adds the decisions which passes sample adaptively, and which ask for it without effect.
    pub(super) fn explain_adaptive_sampling(&mut self) {
        let mut decisions = Vec::new();
        for planned in &self.passes {
            let (Work::Rays { params, .. }, PassKind::Ray(ray)) = (&planned.work, &self.pass(planned).kind) else {
                continue;
            };
            let what = format!("adaptive sampling of pass `{}`", self.pass(planned).name);
            let RayParams { error, paths, .. } = params;
            if *error <= 0.0 {
                continue;
            }
            if ray.program.sampled_to(params).is_none() {
                let why = "the report's panes leave nothing to chance: it counts with glass=auto".to_owned();
                decisions.push((what, false, why));
                continue;
            }
            let pixels = self.held_pixels(self.target_size(self.pass(planned).target));
            let bytes = mebibytes(ADAPTIVE_BYTES * pixels);
            let why = format!(
                "an error of {error}: {LEAST_ADAPTIVE_PATHS} to {paths} paths at each pixel whose glass is rough, disperses or is followed \
                 by chance; it holds up to {bytes} in host memory"
            );
            decisions.push((what, true, why));
        }
        for (what, does, why) in decisions {
            self.decide(what, does, why);
        }
    }
}
