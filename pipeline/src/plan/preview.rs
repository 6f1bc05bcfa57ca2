//! Previews: pictures with fewer pixels and samples, shown while a camera moves.

use crate::programs::RayParams;

/// Fewer pixels and samples than the settings ask for, for pictures that are soon replaced by others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preview {
    /// Divisor of the window's sides, at least 1. The quotients are rounded up. Targets that scale with the window shrink with it.
    pub divisor: u32,
    /// Greatest number of samples of each kind (occlusion, the light's disc, paths) that a ray pass takes at a point. At least 1, and a square
    /// number, since some passes place their samples in square strata.
    pub samples: u32,
}

impl Preview {
    /// Limits the samples of each kind to [`Self::samples`], and turns adaptive sampling off.
    pub(super) fn limit(&self, params: &mut RayParams) {
        for samples in [&mut params.samples, &mut params.sun_samples, &mut params.paths] {
            *samples = self.samples.min(*samples);
        }
        params.error = 0.0;
    }

    /// The size with both sides divided by [`Self::divisor`], rounded up.
    pub(super) fn divide(&self, size: [u32; 2]) -> [u32; 2] {
        size.map(|side| side.div_ceil(self.divisor))
    }
}
