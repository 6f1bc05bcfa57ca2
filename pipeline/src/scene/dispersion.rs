//! Dispersion: the index of refraction as a function of wavelength, in the forms that files use.

/// 1 / (1 / F² - 1 / C²) of the lines F (486.13 nm) and C (656.27 nm), square nanometres.
pub const CAUCHY: f32 = 523_655.0;
/// [`CAUCHY`] over the square of the wavelength of the line d, 587.56 nm.
pub const CAUCHY_AT_D: f32 = 1.5168;

/// Index at the line d and [`Dielectric::spread`](crate::glass::Dielectric::spread) of a material whose index is A + B / λ², with λ in micrometres.
#[cfg(any(feature = "gltf", test))]
#[must_use]
pub fn of_cauchy([a, b]: [f64; 2]) -> [f64; 2] {
    let spread = b * 1e6 / f64::from(CAUCHY);
    [a + spread * f64::from(CAUCHY_AT_D), spread]
}
