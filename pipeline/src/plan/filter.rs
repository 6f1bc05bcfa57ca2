//! The filter over shares of light: which passes ask for it, how much memory it takes, and which backends lack it.

use super::{Plan, PlannedPass, Work};
use crate::backend::{BackendError, RayBackend};
use crate::memory::mebibytes;
use crate::programs::FILTER_BYTES;
use crate::project::PassKind;

/// Up to this number of samples a filter can pay off at any occlusion radius, as measured. With more samples the remaining noise is
/// less than the blur of the filter, except at long radii.
const FEW: u32 = 16;

impl Plan {
    /// Number of levels of the filter over a pass's output; 0 without a filter.
    #[must_use]
    pub fn filter_levels(&self, planned: &PlannedPass) -> u32 {
        match (&planned.work, &self.pass(planned).kind) {
            (Work::Rays { params, .. }, PassKind::Ray(ray)) => ray.program.info().filter_levels(params),
            (Work::Effect { params, .. }, PassKind::Effect(effect))
                if effect.program.info().params.contains(&"filter") =>
            {
                params.filter
            }
            _ => 0,
        }
    }

    /// The filter that a ray pass asks for, for messages; `None` where it asks for none.
    #[must_use]
    pub fn asks_of_filter(&self, planned: &PlannedPass) -> Option<String> {
        match (&planned.work, &self.pass(planned).kind) {
            (Work::Rays { params, .. }, PassKind::Ray(ray)) => ray.program.asks_of_filter(params),
            _ => None,
        }
    }

    /// The name of the first ray pass that asks for a filter which its ray backend does not have, and the error with a remedy.
    /// `rays_of` returns the ray backend for the name of a pass.
    #[must_use]
    pub fn unfiltered<'a>(&self, rays_of: impl Fn(&str) -> &'a dyn RayBackend) -> Option<(String, BackendError)> {
        let why = "it has no filter; use --backend cpu, or allow it with --fallback cpu, or set filter=0 on the pass";
        self.first_lacking(rays_of, |planned| self.asks_of_filter(planned), |rays| rays.filters_shares(), why)
    }

    /// Bytes of the filters' buffers on the processor: all ray passes share one buffer, and all raster effects share a second one. Each
    /// buffer has room for the largest target that is filtered in it.
    pub(super) fn filter_bytes(&self) -> u64 {
        let largest = |of_rays: bool| {
            let of_kind = |planned: &&PlannedPass| matches!(planned.work, Work::Rays { .. }) == of_rays;
            let filtered = self.passes.iter().filter(of_kind).filter(|planned| self.filter_levels(planned) > 0);
            let pixels = filtered.map(|planned| self.held_pixels(self.target_size(self.pass(planned).target)));
            FILTER_BYTES * pixels.max().unwrap_or(0)
        };
        largest(true) + largest(false)
    }

    /// Adds the decisions which passes are filtered and how much memory that takes, and which ask for a filter without effect.
    pub(super) fn explain_filters(&mut self) {
        let mut decisions = Vec::new();
        for planned in &self.passes {
            let name = &self.pass(planned).name;
            let levels = self.filter_levels(planned);
            let pixels = self.held_pixels(self.target_size(self.pass(planned).target));
            let what = format!("filter of pass `{name}`");
            if levels > 0 {
                let plural = if levels == 1 { "" } else { "s" };
                let bytes = mebibytes(FILTER_BYTES * pixels);
                let mut why = format!(
                    "{levels} level{plural} average its share of light over its surface; on the cpu it holds {bytes}"
                );
                if self.samples_of(planned).is_some_and(|samples| samples > FEW) {
                    why += &format!(
                        "; of more than {FEW} samples it pays at long radii alone: measure with `curitiba tune`"
                    );
                }
                decisions.push((what, true, why));
            } else if let Work::Rays { params, .. } = &planned.work
                && let PassKind::Ray(ray) = &self.pass(planned).kind
                && ray.program.info().reads("filter")
                && params.filter > 0
            {
                decisions.push((what, false, "without samples there is no noise to average".to_owned()));
            }
        }
        for (what, does, why) in decisions {
            self.decide(what, does, why);
        }
    }

    /// The number of samples of a ray pass's program, or over the light's disc if that is larger; `None` for other passes.
    fn samples_of(&self, planned: &PlannedPass) -> Option<u32> {
        let (Work::Rays { params, .. }, PassKind::Ray(ray)) = (&planned.work, &self.pass(planned).kind) else {
            return None;
        };
        let info = ray.program.info();
        Some(info.samples(params).max(info.sun_samples(params)))
    }
}
