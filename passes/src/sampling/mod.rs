//! Random numbers without state, points in the unit square and directions of a hemisphere.
//!
//! Every number is a hash of (pixel, bounce path, sample, dimension, seed), so a picture depends neither on the order in which pixels are
//! computed nor on the number of threads. All integer steps are exact on every machine.

pub mod cone;
mod directions;
pub mod hash;
pub mod hemisphere;
pub mod owen_sobol;
pub mod paths;
pub mod sine_noise;

use crate::trace::Directions;
use curitiba_pipeline::programs::Sampler;
use glam::{Vec2, Vec3};
use hemisphere::Basis;

/// Samples the occlusion directions of a shaded point.
#[derive(Debug, Clone, PartialEq)]
pub enum HemisphereSampler {
    /// Owen-scrambled Sobol points. Stored are the unscrambled points with reversed bits, sorted so that neighbours are adjacent.
    /// Scrambling keeps the points of a cell together, so the directions of one vector are similar and meet the same triangles.
    Sobol(Vec<[u32; 2]>),
    /// `side` x `side` cells with one jittered point each.
    Strata {
        /// Number of cells along a side.
        side: u32,
    },
}

impl HemisphereSampler {
    /// A sampler of `samples` directions for each shaded point.
    ///
    /// # Errors
    /// If strata are requested and `samples` is not a square number; the message says what would be valid.
    pub fn new(sampler: Sampler, samples: u32) -> Result<Self, String> {
        Self::from(sampler, 0, samples)
    }

    /// A sampler of the `samples` directions that follow the `first` ones of the sequence.
    ///
    /// # Errors
    /// As [`Self::new`]; for strata with `first > 0`, since they are not a sequence; and beyond the 2^32 points of the sequence.
    pub fn from(sampler: Sampler, first: u32, samples: u32) -> Result<Self, String> {
        match sampler {
            Sampler::Sobol => Ok(Self::Sobol(sequence(first, samples)?)),
            Sampler::Strata if first > 0 => Err("strata are no sequence that could be continued".to_owned()),
            Sampler::Strata => Ok(Self::Strata { side: square_root(samples)? }),
        }
    }

    /// Number of directions for each shaded point.
    #[must_use]
    pub fn samples(&self) -> u32 {
        match self {
            Self::Sobol(points) => points.len() as u32,
            Self::Strata { side } => side * side,
        }
    }

    /// Calls `each` with the points of the unit square, [0, 1), that belong to `key`.
    pub fn points(&self, key: u32, mut each: impl FnMut(Vec2)) {
        match self {
            Self::Sobol(points) => {
                let seeds = hash::dimensions(key, hash::SCRAMBLE);
                for point in points {
                    let [x, y] = [0, 1].map(|d| hash::unit(owen_sobol::scramble_reversed(point[d], seeds[d])));
                    each(Vec2::new(x, y));
                }
            }
            Self::Strata { side } => {
                let width = 1.0 / *side as f32;
                for i in 0..*side {
                    for j in 0..*side {
                        let [x, y] = hash::dimensions(key, i * side + j).map(hash::unit);
                        let point = Vec2::new(i as f32 + x, j as f32 + y) * width;
                        // Rounding may give the edge of the next cell, and 1 in the last cell.
                        each(point.min(Vec2::splat(ONE_BELOW)));
                    }
                }
            }
        }
    }

    /// Replaces `directions` by cosine-distributed unit directions around `normal` (unit length) that belong to `key`. If `above` is given,
    /// directions with `direction · above < 0` are mirrored at the plane of `above`, a unit vector.
    pub fn directions(&self, key: u32, normal: Vec3, above: Option<Vec3>, directions: &mut Directions) {
        let basis = Basis::around(normal);
        match self {
            Self::Sobol(points) => {
                let seeds = hash::dimensions(key, hash::SCRAMBLE);
                directions::fill(points, seeds, &basis, above.as_ref(), directions);
            }
            Self::Strata { .. } => {
                directions.clear();
                self.points(key, |point| {
                    let direction = basis.to_world(hemisphere::cosine(point));
                    directions.push(above.map_or(direction, |above| hemisphere::mirrored(direction, above)));
                });
            }
        }
    }
}

/// The `samples` points that follow the `first` ones of the Sobol sequence, with reversed bits, sorted so that neighbours are adjacent.
///
/// # Errors
/// If the range goes beyond the 2^32 points of the sequence.
fn sequence(first: u32, samples: u32) -> Result<Vec<[u32; 2]>, String> {
    let end = first.checked_add(samples).ok_or("the sequence has 2^32 points")?;
    let mut points: Vec<_> = (first..end).map(owen_sobol::reversed_sobol).collect();
    points.sort_by_cached_key(|&point| cell(point));
    Ok(points)
}

/// Position of a point (bits reversed) on the Z-order curve through 16 x 16 cells.
fn cell([x, y]: [u32; 2]) -> u32 {
    (0..4).fold(0, |cell, digit| cell << 2 | (x >> digit & 1) << 1 | y >> digit & 1)
}

/// The largest number below 1.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

/// The square root of a square number.
///
/// # Errors
/// If `samples` is not a square number; the message names the nearest square numbers.
pub fn square_root(samples: u32) -> Result<u32, String> {
    let side = samples.isqrt();
    if side * side == samples {
        return Ok(side);
    }
    let (below, above) = (u64::from(side).pow(2), (u64::from(side) + 1).pow(2));
    Err(format!("strata need a square number of samples, not {samples}; the nearest are {below} and {above}"))
}

#[cfg(test)]
mod tests;
