//! Directional lights that are discs in the sky, not points: directions to points of the disc.

use super::job::Traced;
use super::points::{Points, Purpose, branch};
use glam::DVec3;
use std::f64::consts::TAU;
use std::iter::Sum;
use std::ops::Div;

/// Number of directions to the disc of a light that a sample takes at a point.
const DIRECTIONS: u32 = 4;

/// The discs of a pass's directional lights, as a sample sees them from a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Discs {
    /// Height of the cone's spherical cap: 1 minus the cosine of the half angle.
    height: f64,
    /// Key of the path to the point.
    key: u64,
    /// Index in the sequence of samples.
    index: u32,
}

impl Discs {
    /// The discs of a pass; `None` where its lights have no disc.
    pub fn of(pass: &Traced<'_>, key: u64, index: u32) -> Option<Self> {
        if pass.program.info().sun_samples(&pass.params) == 0 {
            return None;
        }
        let quarter = (f64::from(pass.params.sun) / 4.0).to_radians().sin();
        Some(Self { height: 2.0 * quarter * quarter, key, index })
    }

    /// The mean of a share over unit directions to light number `light`, uniform in the solid angle of its disc around the direction
    /// `center`.
    pub fn mean<S: Sum + Div<f64, Output = S>>(self, light: usize, center: DVec3, share: impl Fn(DVec3) -> S) -> S {
        let points = Points::new(branch(self.key, light as u64), Purpose::Disc);
        let (tangent, bitangent) = center.any_orthonormal_pair();
        let direction = |number: u32| {
            let point = points.at(self.index * DIRECTIONS + number);
            // Heights on a sphere are uniform (Archimedes).
            let below = point.x * self.height;
            let radius = (below * (2.0 - below)).sqrt();
            let (sin, cos) = (TAU * point.y).sin_cos();
            tangent * (radius * cos) + bitangent * (radius * sin) + center * (1.0 - below)
        };
        (0..DIRECTIONS).map(|number| share(direction(number))).sum::<S>() / f64::from(DIRECTIONS)
    }
}

/// The mean of `share` over the directions to the disc of light number `light` around `center`; without `discs`, its value for `center`.
pub(super) fn over<S: Sum + Div<f64, Output = S>>(
    discs: Option<Discs>,
    light: usize,
    center: DVec3,
    share: impl Fn(DVec3) -> S,
) -> S {
    match discs {
        Some(discs) => discs.mean(light, center, share),
        None => share(center),
    }
}
