//! Directions in a cone: samples of a light that is a disc in the sky.

use super::hash::{self, unit};
use super::hemisphere::{Basis, concentric_disk};
use super::{owen_sobol, sequence};
use glam::{Vec2, Vec3};

/// Samples directions in cones of one width, uniform in solid angle, from Owen-scrambled Sobol points of the unit square.
#[derive(Debug, Clone, PartialEq)]
pub struct ConeSampler {
    /// Unscrambled points with reversed bits, sorted so that neighbours are adjacent.
    points: Vec<[u32; 2]>,
    /// Height of the spherical cap: 1 minus the cosine of the half angle.
    height: f32,
}

impl ConeSampler {
    /// A sampler of the `samples` directions that follow the `first` ones of the sequence, in cones with a full opening angle of `degrees`,
    /// 0 to 180.
    ///
    /// # Errors
    /// If the range goes beyond the 2^32 points of the sequence.
    pub fn new(degrees: f32, first: u32, samples: u32) -> Result<Self, String> {
        // 1 - cos a = 2 sin² (a/2), which does not cancel for small angles.
        let quarter = (f64::from(degrees) * 0.25).to_radians().sin();
        let height = (2.0 * quarter * quarter) as f32;
        Ok(Self { points: sequence(first, samples)?, height })
    }

    /// Number of directions for each shaded point.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.points.len() as u32
    }

    /// The points of the unit square before they are scrambled, bits reversed, one a direction.
    #[must_use]
    pub fn points(&self) -> &[[u32; 2]] {
        &self.points
    }

    /// Height of the cones' spherical cap: 1 minus the cosine of the half angle.
    #[must_use]
    pub fn height(&self) -> f32 {
        self.height
    }

    /// The unit directions around `axis` (unit length) that belong to `key`.
    pub fn directions(&self, axis: Vec3, key: u32) -> impl Iterator<Item = Vec3> {
        let (basis, seeds) = (Basis::around(axis), hash::dimensions(key, hash::DISC));
        self.points.iter().map(move |point| {
            let [x, y] = [0, 1].map(|d| unit(owen_sobol::scramble_reversed(point[d], seeds[d])));
            basis.to_world(in_cone(Vec2::new(x, y), self.height))
        })
    }
}

/// Maps a uniform point of the unit square to a direction around z, uniform in the solid angle of a cone.
///
/// Heights on a sphere are uniform (Archimedes), so 1 - cos θ is the squared radius r² of a uniform point of the unit disk times the
/// `height` h of the cone's cap: 1 - cos θ = r² h, and sin θ = r √(h (2 - r² h)). Shirley, Wang and Zimmerman 1996, "Monte Carlo Techniques
/// for Direct Lighting Calculations", ACM TOG 15(1), section 3.2, sample a luminaire's cone in this way, with the polar map instead of the
/// concentric one.
pub(crate) fn in_cone(point: Vec2, height: f32) -> Vec3 {
    let disk = concentric_disk(point);
    let below = disk.length_squared() * height;
    (disk * (height * (2.0 - below)).sqrt()).extend(1.0 - below)
}
