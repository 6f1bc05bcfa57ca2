//! Soft shadows: which passes ask for a light with a disc, and which backends cannot trace it.

use super::{Plan, PlannedPass, Work};
use crate::backend::{BackendError, RayBackend};
use crate::project::PassKind;

impl Plan {
    /// The light's disc that a ray pass asks for, for messages; `None` for a light without a disc.
    #[must_use]
    pub fn asks_of_sun(&self, planned: &PlannedPass) -> Option<String> {
        match (&planned.work, &self.pass(planned).kind) {
            (Work::Rays { params, .. }, PassKind::Ray(ray)) => ray.program.asks_of_sun(params),
            _ => None,
        }
    }

    /// The name of the first pass that asks for a light with a disc which its ray backend cannot trace, and the error with a remedy.
    /// `rays_of` returns the ray backend for the name of a pass.
    #[must_use]
    pub fn untraced_sun<'a>(&self, rays_of: impl Fn(&str) -> &'a dyn RayBackend) -> Option<(String, BackendError)> {
        let why = "its programs know a light that is a point; use --backend cpu, or allow it with --fallback cpu, or set sun=0 on \
                       the pass";
        self.first_lacking(rays_of, |planned| self.asks_of_sun(planned), |rays| rays.traces_sun_discs(), why)
    }
}
