//! How far a picture is from its reference.

use serde::{Deserialize, Serialize};

/// What a comparison found. All but [`Self::ssim`] and [`Self::flip`] are of linear values over the three colours of the
/// pixels compared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Pixels compared.
    pub pixels: u64,
    /// Root mean square error.
    pub rmse: f64,
    /// Mean of `(test - reference)^2 / (reference^2 + 0.01)`.
    pub relative_mse: f64,
    /// Largest absolute difference of a value.
    pub max: f64,
    /// Peak signal-to-noise ratio for a peak of 1, decibels; infinite, written as null, where both are equal.
    #[serde(with = "infinite_as_null")]
    pub psnr: f64,
    /// Structural similarity of the luminance (Wang et al. 2004), at most 1.
    pub ssim: f64,
    /// Mean FLIP error of what is displayed (Andersson et al. 2020), 0 to 1.
    pub flip: f64,
    /// Sum of the test divided by the sum of the reference; 1 where both are black.
    pub energy_ratio: f64,
    /// Share of pixels, 0 to 1, one of whose values differs by more than the outlier threshold.
    pub outliers: f64,
}

mod infinite_as_null {
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        Some(*value).filter(|value| value.is_finite()).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}
