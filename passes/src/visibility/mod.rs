//! How much two triangles see of each other.
//!
//! The visibility of a pair is the share of the segments between its triangles that nothing blocks: of the segments that leave both front
//! sides, or of all (see [`Facing`]). The form factor weights each segment by what it carries:
//! `F_ab = 1/A_a ∫∫ V cos θ_a cos θ_b / (π r²) dA_b dA_a`.
//!
//! A pair is decided before a ray is traced where that is exact:
//!
//! 1. [`Class::Never`]: no part of one triangle is in front of the other.
//! 2. [`Class::Open`]: the shaft, which is the convex hull of both (Haines and Wallace, "Shaft Culling for Efficient Ray-Traced
//!    Radiosity", 1991), meets no triangle. The form factor then needs no rays: it is a sum by Gauss rules where
//!    the gap is large enough, else the contour integral of Sparrow and Lambert.
//! 3. [`Class::Closed`]: a surface without a border inside the shaft crosses it.
//! 4. [`Class::Sampled`]: everything else. Segments between the triangles, given by four-dimensional points, are tested in `f64` against
//!    the triangles in the shaft, or traced where those are many.
//!
//! Properties of the results:
//!
//! * Segments run between error-bounded offset points of both triangles ([`SurfacePoint`](crate::trace::SurfacePoint)): no distance is
//!   multiplied by an epsilon. What is nearer to a triangle than that offset is not seen.
//! * The triangles of the pair are excluded by their ids. A copy of a triangle in the same place is at distance 0 and does not block;
//!   [`Surfaces::duplicates`] counts the copies.
//! * The points of a pair come from a hash of the seed and of both triangles' corners. Results are equal, bit by bit, for `(a, b)` and
//!   `(b, a)`, for any number of threads, and for any order of the triangles.
//! * Triangles are one-sided: light that leaves the back of one is not counted.
//!
//! Light that is reflected between the triangles by others is not computed, and textures are not read: triangles of materials that are not
//! opaque block nothing.

mod contour;
mod cover;
mod estimate;
mod on_device;
mod pairs;
mod points;
mod rules;
mod sampling;
mod segments;
mod shaft;
mod sphere;
mod surfaces;
mod tree;

use curitiba_pipeline::backend::BackendError;

pub use estimate::{Estimator, Room};
pub use on_device::DeviceEstimator;
pub use pairs::{AllPairs, Cursor, NearPairs, PairSource, RowPairs};
pub use points::REPLICATES;
pub use surfaces::Surfaces;

/// How segments count if they do not leave the front of both triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Facing {
    /// They are left out: the visibility is that of the parts that face each other, and absent if there are none.
    #[default]
    Skip,
    /// They count as blocked: the result is divided by the number of all segments.
    Zero,
}

/// The point set that is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sampler {
    /// Owen-scrambled Sobol points.
    #[default]
    Sobol,
    /// Hammersley points with the rotation of Cranley and Patterson.
    Hammersley,
}

/// When a pair is sampled well enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effort {
    /// A fixed number of segments: a multiple of [`REPLICATES`] in [`Options::SAMPLES`].
    Samples(u32),
    /// 64 segments, doubled until the standard error of the visibility (of the form factors, if those are computed) is at most this, or
    /// until there are [`Options::MOST`].
    Error(f64),
}

/// Options of an estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// When a pair is sampled well enough.
    pub effort: Effort,
    /// How segments count if they leave the back of a triangle.
    pub facing: Facing,
    /// The point set.
    pub sampler: Sampler,
    /// Whether form factors are computed too.
    pub form_factors: bool,
    /// Seed of the points.
    pub seed: u32,
}

impl Options {
    /// Valid numbers of segments for a pair.
    pub const SAMPLES: std::ops::RangeInclusive<u32> = 8..=Self::MOST;
    /// Greatest number of segments for a pair.
    pub const MOST: u32 = 1 << 16;

    /// Checks the options.
    ///
    /// # Errors
    /// If the effort is out of range; the message says what would be valid.
    pub fn check(&self) -> Result<(), String> {
        match self.effort {
            Effort::Samples(samples)
                if !Self::SAMPLES.contains(&samples) || !samples.is_multiple_of(REPLICATES as u32) =>
            {
                Err(format!(
                    "{samples} samples: a multiple of {REPLICATES} from 8 to {} is valid, such as 64",
                    Self::MOST
                ))
            }
            Effort::Error(error) if !(1e-4..=1.0).contains(&error) => {
                Err(format!("an error of {error}: 0.0001 to 1 is valid, such as 0.01"))
            }
            _ => Ok(()),
        }
    }

    /// Greatest number of segments that a pair may need: the number of points of all its point sets together.
    pub(crate) fn most(&self) -> u32 {
        match self.effort {
            Effort::Samples(samples) => samples,
            Effort::Error(_) => Self::MOST,
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            effort: Effort::Samples(64),
            facing: Facing::Skip,
            sampler: Sampler::Sobol,
            form_factors: false,
            seed: 0,
        }
    }
}

/// Computes the visibility of many pairs of triangles, on the processor or on a device. Each pair gives one [`Row`].
pub trait RowFinder {
    /// The options of the finder.
    fn options(&self) -> &Options;

    /// Replaces `rows` by the rows of the pairs, in their order.
    ///
    /// # Errors
    /// If a device fails.
    ///
    /// # Panics
    /// If there is no triangle with such an id.
    fn rows(&mut self, pairs: &[[u32; 2]], rows: &mut Vec<Row>) -> Result<(), BackendError>;
}

/// How the visibility of a pair was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Class {
    /// No part of one triangle is in front of the other, or one has no area.
    Never = 0,
    /// Nothing is between the triangles: exact.
    Open = 1,
    /// Something blocks every segment between the triangles: exact.
    Closed = 2,
    /// Estimated from samples, with a standard error.
    Sampled = 3,
}

impl Class {
    /// All classes, by their number.
    pub const ALL: [Self; 4] = [Self::Never, Self::Open, Self::Closed, Self::Sampled];

    /// The name as it is written to files.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["never", "open", "closed", "sampled"][self as usize]
    }
}

/// The result of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// The triangles, in the order of the request.
    pub pair: [u32; 2],
    /// How the visibility was found.
    pub class: Class,
    /// The visibility, 0 to 1; `None` if no segment leaves the front of both and such segments are skipped.
    pub visibility: Option<f64>,
    /// Standard error of the visibility; 0 where it is exact. Where all counted segments are open, or all are blocked, it is the bound of
    /// the rule of three: 3 divided by their number, but at most 1. The visibility ± [`Self::QUANTILE`] times the error is a 95 % interval.
    pub error: f64,
    /// The form factors from the first to the second triangle and back, if they were requested: the share of the light leaving the one
    /// triangle that reaches the other.
    pub form_factors: Option<[f64; 2]>,
    /// Standard errors of the form factors; 0 where they are exact.
    pub form_factor_errors: [f64; 2],
    /// Number of segments that were sampled for the visibility; 0 where it is exact.
    pub samples: u32,
    /// Number of those segments that leave the front of both triangles.
    pub valid: u32,
}

impl Row {
    /// The 97.5 % quantile of Student's distribution with seven degrees of freedom (one less than the number of replicates).
    pub const QUANTILE: f64 = 2.364_624;

    /// Placeholder for a row that is not known yet.
    pub(crate) const NONE: Self = Self {
        pair: [0; 2],
        class: Class::Never,
        visibility: None,
        error: 0.0,
        form_factors: None,
        form_factor_errors: [0.0; 2],
        samples: 0,
        valid: 0,
    };

    /// The row of the same pair in the other order.
    #[must_use]
    pub(crate) fn swapped(self) -> Self {
        let ([a, b], [e, f]) = (self.pair, self.form_factor_errors);
        Self {
            pair: [b, a],
            form_factors: self.form_factors.map(|[ab, ba]| [ba, ab]),
            form_factor_errors: [f, e],
            ..self
        }
    }
}
