//! Previews: pictures with fewer pixels and samples, for while a camera moves.

use crate::programs::RayParams;

/// Fewer pixels and samples than the settings ask for, for pictures that are soon replaced by others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preview {
    /// By how much the sides of the window are divided, and those of targets that scale with it; at least 1. Fractions are rounded up.
    pub divisor: u32,
    /// Most samples that a ray pass takes for a point, of each kind: occlusion, the light's disc, paths. At least 1, and a square, for passes
    /// whose samples lie in square strata.
    pub samples: u32,
}

impl Preview {
    /// The parameters with at most [`Self::samples`] of each kind, and no error to reach.
    pub(super) fn limit(&self, params: &mut RayParams) {
        for samples in [&mut params.samples, &mut params.sun_samples, &mut params.paths] {
            *samples = self.samples.min(*samples);
        }
        params.error = 0.0;
    }

    /// The size with its sides divided.
    pub(super) fn divide(&self, size: [u32; 2]) -> [u32; 2] {
        size.map(|side| side.div_ceil(self.divisor))
    }
}
