//! Dispersion: the index of refraction as a function of wavelength, in the forms that files use.

/// `1 / (1 / F² - 1 / C²)` for the spectral lines F (486.13 nm) and C (656.27 nm), in square nanometres; and the same divided by
/// the square of the line d (587.56 nm).
pub(crate) const CAUCHY: f32 = 523_655.0;
pub(crate) const CAUCHY_AT_D: f32 = 1.5168;

/// Converts Cauchy's formula A + B / λ² (λ in micrometres) to the index at the line d and to
/// [`Dielectric::spread`](crate::glass::Dielectric::spread).
#[must_use]
pub fn of_cauchy([a, b]: [f64; 2]) -> [f64; 2] {
    let spread = b * 1e6 / f64::from(CAUCHY);
    [a + spread * f64::from(CAUCHY_AT_D), spread]
}
