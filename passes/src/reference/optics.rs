//! Smooth interfaces and walls of glass: Fresnel's and Snell's laws, the sum of a wall's reflections, and Beer's law.

use super::world::Surface;
use curitiba_pipeline::glass::{CAUCHY, CAUCHY_AT_D, Dielectric};
use glam::DVec3;

/// The mirrored direction.
pub(super) fn mirrored(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - 2.0 * direction.dot(normal) * normal
}

/// The normal by which an interface mirrors and refracts. It is the shading normal, unless that looks away from the
/// viewer or would mirror into the surface; then the triangle's.
pub(super) fn interface_normal(surface: &Surface, direction: DVec3) -> DVec3 {
    let usable = surface.normal.dot(direction) < 0.0 && mirrored(direction, surface.normal).dot(surface.facing) > 0.0;
    if usable { surface.normal } else { surface.facing }
}

/// The effect of an interface on unpolarised light at an angle of incidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interface {
    /// Share of the light that is reflected.
    pub share: f64,
    /// Cosine of the refracted angle; `None` at total reflection.
    pub inner: Option<f64>,
}

impl Interface {
    /// The interface by the laws of Fresnel and Snell, for a cosine of the angle of incidence. `index` is the refractive index of the far side
    /// over that of the near side.
    pub fn new(cosine: f64, index: f64) -> Self {
        let near = cosine.clamp(0.0, 1.0);
        // Squared sine of the refracted angle, by Snell's law.
        let sine_squared = (1.0 - near * near) / (index * index);
        if sine_squared >= 1.0 {
            return Self { share: 1.0, inner: None };
        }
        let far = (1.0 - sine_squared).sqrt();
        let across = (near - index * far) / (near + index * far);
        let parallel = (index * near - far) / (index * near + far);
        Self { share: (across * across + parallel * parallel) / 2.0, inner: Some(far) }
    }

    /// The interface of a material, which may have a reflectance of its own where reflection is not total.
    pub fn of(dielectric: &Dielectric, cosine: f64, index: f64) -> Self {
        let fresnel = Self::new(cosine, index);
        let (Some(own), Some(inner)) = (dielectric.reflectance, fresnel.inner) else { return fresnel };
        // The angle on the side of the lower index.
        let cosine = if index < 1.0 { inner } else { cosine.clamp(0.0, 1.0) };
        let [minimum, maximum, exponent] = [own.minimum, own.maximum, own.exponent].map(f64::from);
        Self { share: minimum + (maximum - minimum) * (1.0 - cosine).powf(exponent), ..fresnel }
    }

    /// The refracted unit direction; `None` at total reflection.
    pub fn refracted(&self, direction: DVec3, normal: DVec3, index: f64) -> Option<DVec3> {
        let along = direction - normal * direction.dot(normal);
        (along / index - normal * self.inner?).try_normalize()
    }
}

/// Fresnel reflectance for unpolarised light, and the refracted direction; `None` at total reflection. `index` is the
/// refractive index of the far side over that of the near side.
pub(super) fn split(direction: DVec3, normal: DVec3, index: f64) -> (f64, Option<DVec3>) {
    let interface = Interface::new(-direction.dot(normal), index);
    (interface.share, interface.refracted(direction, normal, index))
}

/// The transmittance of a length, by colour, by Beer's law. Where nothing is absorbed it is 1 for any length.
pub(super) fn kept(dielectric: &Dielectric, length: f64) -> DVec3 {
    let of = |extinction: f32| if extinction > 0.0 { (-f64::from(extinction) * length).exp() } else { 1.0 };
    DVec3::from(dielectric.extinction.to_array().map(of))
}

/// The shares of light that a wall with two parallel faces reflects and transmits, by colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wall {
    /// Share reflected.
    pub reflected: DVec3,
    /// Share transmitted.
    pub transmitted: DVec3,
}

impl Wall {
    /// The sum over all reflections between the faces, each of which reflects the share `R` of `face`. With the transmittance `a` of one
    /// crossing, light that crosses the wall once, and does not return, is `(1 - R)^2 a`; each pair of reflections inside adds a factor of
    /// `R^2 a^2`.
    pub fn new(dielectric: &Dielectric, face: &Interface) -> Self {
        let Some(inner) = face.inner.filter(|_| face.share < 1.0) else {
            return Self { reflected: DVec3::ONE, transmitted: DVec3::ZERO };
        };
        let across = kept(dielectric, f64::from(dielectric.thickness) / inner);
        let entering = 1.0 - face.share;
        let rounds = 1.0 / (1.0 - (face.share * across) * (face.share * across));
        Self {
            reflected: face.share + entering * entering * face.share * across * across * rounds,
            transmitted: entering * entering * across * rounds,
        }
    }
}

/// The refractive index of a material for a wavelength in nanometres; without a wavelength, the index at the Fraunhofer line d.
pub(super) fn index(dielectric: &Dielectric, wavelength: Option<f64>) -> f64 {
    let [at_d, spread] = [dielectric.index, dielectric.spread].map(f64::from);
    let Some(wavelength) = wavelength.filter(|_| spread > 0.0) else { return at_d };
    (at_d + spread * (f64::from(CAUCHY) / (wavelength * wavelength) - f64::from(CAUCHY_AT_D))).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shares_are_those_of_the_textbook() {
        for index in [1.1_f64, 1.5, 1.0 / 1.5] {
            let (straight, _) = split(-DVec3::Z, DVec3::Z, index);
            assert!((straight - ((index - 1.0) / (index + 1.0)).powi(2)).abs() < 1e-15);
            // At Brewster's angle only light polarised perpendicular to the plane of incidence is reflected.
            let brewster = index.atan();
            let (share, refracted) = split(DVec3::new(brewster.sin(), 0.0, -brewster.cos()), DVec3::Z, index);
            let expected = 0.5 * ((index * index - 1.0) / (index * index + 1.0)).powi(2);
            assert!((share - expected).abs() < 1e-15, "{share} {expected}");
            let refracted = refracted.expect("no total reflection");
            assert!((refracted.x * index - brewster.sin()).abs() < 1e-15 && refracted.z < 0.0);
        }
        let grazing = DVec3::new(0.99, 0.0, -(1.0 - 0.99_f64.powi(2)).sqrt());
        assert_eq!(split(grazing, DVec3::Z, 1.0 / 1.5), (1.0, None));
    }
}
