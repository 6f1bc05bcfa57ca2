//! Texture lookups that are filtered by ray cones: which passes ask for the filtering, and which backends support it.

use super::{Plan, PlannedPass};
use crate::backend::{BackendError, RayBackend};

impl Plan {
    /// The filtering of texture lookups at hits that a pass asks for, in words for messages; `None` if lookups read mip level 0.
    #[must_use]
    pub fn asks_of_cones(&self, planned: &PlannedPass) -> Option<String> {
        let (program, params) = self.traced(planned)?.program?;
        program.asks_of_cones(&params)
    }

    /// The name of the first pass that asks for ray cones which its ray backend does not support, and the error with a remedy.
    /// `rays_of` returns the ray backend for the name of a pass.
    #[must_use]
    pub fn without_cones<'a>(&self, rays_of: impl Fn(&str) -> &'a dyn RayBackend) -> Option<(String, BackendError)> {
        let why = "at hits it reads textures at level 0; use --backend cpu, or allow it with --fallback cpu, or set texturelod=zero on \
                       the pass";
        self.first_lacking(rays_of, |planned| self.asks_of_cones(planned), |rays| rays.traces_cones(), why)
    }

    /// Adds the decisions which passes filter texture lookups by ray cones.
    pub(super) fn explain_cones(&mut self) {
        let asks = |planned: &&PlannedPass| self.asks_of_cones(planned).is_some();
        let names: Vec<String> =
            self.passes.iter().filter(asks).map(|planned| self.pass(planned).name.clone()).collect();
        for name in names {
            let why = "texturelod=cones: at hits textures are read at the mip level of the pixel's part of the surface";
            self.decide(format!("ray cones of pass `{name}`"), true, why.to_owned());
        }
    }
}
