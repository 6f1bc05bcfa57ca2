//! Photons: which passes shoot them at glass meshes, and how much memory they take.

use super::{Plan, PlannedPass, Work};
use crate::memory::mebibytes;
use crate::programs::PHOTON_BYTES;
use crate::project::PassKind;

impl Plan {
    /// Number of photons that a ray pass shoots at glass meshes in one run; 0 where it shoots none.
    #[must_use]
    pub fn photons(&self, planned: &PlannedPass) -> u32 {
        match (&planned.work, &self.pass(planned).kind) {
            (Work::Rays { params, .. }, PassKind::Ray(ray)) => ray.program.photons(params),
            _ => 0,
        }
    }

    /// Greatest number of bytes that photons take on the processor: those of one pass, since passes run one after another.
    pub(super) fn photon_bytes(&self) -> u64 {
        let most = self.passes.iter().map(|planned| self.photons(planned)).max();
        PHOTON_BYTES * u64::from(most.unwrap_or(0))
    }

    /// Adds the decisions which passes shoot photons, and which ask for them without effect.
    pub(super) fn explain_photons(&mut self) {
        let mut decisions = Vec::new();
        for planned in &self.passes {
            let (Work::Rays { params, .. }, PassKind::Ray(ray)) = (&planned.work, &self.pass(planned).kind) else {
                continue;
            };
            if params.photons == 0 || !ray.program.info().reads("photons") {
                continue;
            }
            let what = format!("photons of pass `{}`", self.pass(planned).name);
            let photons = self.photons(planned);
            let why = match photons {
                0 => "they bring the light that meshes focus: they count with glass=auto and shadow=caustic".to_owned(),
                _ => {
                    let bytes = mebibytes(PHOTON_BYTES * u64::from(photons));
                    format!(
                        "{photons} are shot by the processor at the bodies of solid meshes; they hold up to {bytes}"
                    )
                }
            };
            decisions.push((what, photons > 0, why));
        }
        for (what, does, why) in decisions {
            self.decide(what, does, why);
        }
    }
}
