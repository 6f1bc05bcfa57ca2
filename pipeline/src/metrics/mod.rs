//! How far a picture is from its reference: errors of the linear values, and of what a person sees.
//!
//! [`compare`] computes every metric at once, [`METRICS`] names them with their formulas, [`flip_map`] and
//! [`absolute_error`] show where the error is, and [`z_test`] separates error from noise for pictures with known variance. Sums use
//! 64-bit floats in an order that does not depend on the number of threads.
//!
//! # What is displayed
//! SSIM and FLIP compare display values. [`write_png`](crate::image::write_png) clamps values to 0..=1 and stores them without a
//! transfer function, as the report's engine showed its frame buffer, and a screen decodes them as sRGB. The metrics do the same: a
//! display value is the value clamped to 0..=1, and FLIP decodes it as sRGB. For linear radiance ([`Options::display`]) the display
//! value is [`Display::displayed`]. Values are not rounded to 8 bits first. Alpha is not compared.

mod color_spaces;
mod filter;
mod flip;
mod linear;
mod maps;
mod registry;
mod ssim;
mod z_test;

pub use flip::{flip_map, perceived_lightness};
pub use maps::{ErrorMap, absolute_error, heat_map, strip};
pub use registry::{Better, METRICS, MetricInfo};
pub use z_test::{EXPECTED_BEYOND_2, EXPECTED_BEYOND_3, Estimate, Verdict, ZTest, z_test};

use crate::color::{ColorSpace, Display};
use crate::image::{self, Image};
use crate::memory::Refused;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;

/// Result of a comparison. All metrics but [`Self::ssim`] and [`Self::flip`] use the linear values of the three colours of the
/// compared pixels.
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
    /// Peak signal-to-noise ratio for a peak of 1, decibels. Infinite for equal pictures, which is written as null.
    #[serde(with = "infinite_as_null")]
    pub psnr: f64,
    /// Structural similarity of the luminance (Wang et al. 2004), at most 1.
    pub ssim: f64,
    /// Mean FLIP error of what is displayed (Andersson et al. 2020), 0 to 1.
    pub flip: f64,
    /// Sum of the test divided by the sum of the reference. 1 where both sums are 0; infinite, written as null, where only the
    /// reference's sum is 0.
    #[serde(with = "infinite_as_null")]
    pub energy_ratio: f64,
    /// Share of outliers among the pixels, 0 to 1: see [`Options::outlier_threshold`].
    pub outliers: f64,
}

/// How pictures are compared.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// A pixel is an outlier if one of its values differs by more than this. The default, 2.5 / 255, is 2.5 steps of 8 bits. Values
    /// that differ by one step before both pictures are rounded to 8 bits stay below it; values three steps apart exceed it.
    pub outlier_threshold: f64,
    /// The pixels to compare, top row first; `None` compares all. SSIM and FLIP look at a neighbourhood, so pixels just outside the
    /// mask still affect them.
    pub mask: Option<&'a [bool]>,
    /// Least number of pixels that a result may rest on; at least 1.
    pub min_pixels: u64,
    /// Pixels in a degree of visual angle, 1 to 1000, for FLIP. The default, 67, is the paper's: a 4K screen 0.7 m wide
    /// seen from 0.7 m.
    pub pixels_per_degree: f64,
    /// Colour space of the pixels, and their conversion to display values.
    pub display: Display,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self {
            outlier_threshold: 2.5 / 255.0,
            mask: None,
            min_pixels: 1,
            pixels_per_degree: 67.0,
            display: Display::default(),
        }
    }
}

/// Which of two pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// The picture that is judged.
    Test,
    /// The picture with which the test picture is compared.
    Reference,
}

impl fmt::Display for Which {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Test => "the test picture",
            Self::Reference => "the reference picture",
        })
    }
}

/// Why two pictures cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricError {
    /// The sizes differ.
    #[error("the test picture is {} x {} pixels and the reference {} x {}; only pictures of one size can be compared",
            test[0], test[1], reference[0], reference[1])]
    Size {
        /// Width and height of the test.
        test: [u32; 2],
        /// Width and height of the reference.
        reference: [u32; 2],
    },
    /// The pictures have no pixels.
    #[error("the pictures are empty ({width} x {height} pixels); nothing can be compared")]
    Empty {
        /// Pixels a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The number of pixels does not match the picture's size.
    #[error("{which} holds {pixels} pixels, and its size of {width} x {height} needs another number of them")]
    Malformed {
        /// Which picture.
        which: Which,
        /// Pixels a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Pixels held.
        pixels: usize,
    },
    /// A value is NaN or infinite.
    #[error(
        "{which} holds {count} pixel{} with a value that is not finite, the first at x {x}, y {y} (from the top left, \
         counted from 0): {channel} is {value}",
        if *count == 1 { "" } else { "s" }
    )]
    NotFinite {
        /// Which picture.
        which: Which,
        /// Column of the first such pixel.
        x: u32,
        /// Row of the first such pixel.
        y: u32,
        /// `red`, `green` or `blue`.
        channel: &'static str,
        /// NaN or an infinity.
        value: f32,
        /// How many pixels hold such a value.
        count: usize,
    },
    /// The mask is not of the picture's size.
    #[error("the mask has {mask} entries and the pictures {pixels} pixels")]
    Mask {
        /// Entries.
        mask: usize,
        /// Pixels.
        pixels: usize,
    },
    /// The mask leaves too few pixels, or without a mask the pictures have too few.
    #[error(
        "there are {left} pixels to compare, and a comparison must rest on {floor}; compare larger pictures, or use a wider mask"
    )]
    TooFew {
        /// Pixels left.
        left: u64,
        /// Fewest allowed.
        floor: u64,
    },
    /// An option is out of range.
    #[error("{name} is {value}; valid: {valid}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The valid range.
        valid: &'static str,
    },
    /// The display values of the pictures do not fit into memory.
    #[error(transparent)]
    Memory(Refused),
    /// A variance is below 0.
    #[error("{which} has a variance of {value} at x {x}, y {y}; a variance is 0 or more")]
    Variance {
        /// Which picture.
        which: Which,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// The variance.
        value: f32,
    },
}

/// Computes every metric.
///
/// # Errors
/// If the sizes differ, there are too few pixels to compare, a value is not finite (masked or not: SSIM and FLIP look at
/// neighbours), an option is out of range, or the display values do not fit into memory.
pub fn compare(test: &Image, reference: &Image, options: &Options<'_>) -> Result<Comparison, MetricError> {
    Ok(compare_with_map(test, reference, options)?.0)
}

/// Like [`compare`], and also returns the FLIP error of every pixel, as [`flip_map`] computes it.
///
/// # Errors
/// As [`compare`].
pub fn compare_with_map(
    test: &Image,
    reference: &Image,
    options: &Options<'_>,
) -> Result<(Comparison, ErrorMap), MetricError> {
    check(test, reference, options)?;
    let linear = linear::errors(test, reference, options);
    let [test, reference] = &displays([test, reference], options.display)?;
    let map = flip::map(test, reference, options);
    let comparison = Comparison {
        pixels: linear.pixels,
        rmse: linear.mse.sqrt(),
        relative_mse: linear.relative_mse,
        max: linear.max,
        psnr: -10.0 * linear.mse.log10(),
        ssim: ssim::mean(test, reference, options.mask),
        flip: map.mean(options.mask),
        energy_ratio: linear.energy_ratio,
        outliers: linear.outliers,
    };
    Ok((comparison, map))
}

/// The display values of two pictures; pictures that hold display values are not copied.
fn displays<'a>(pictures: [&'a Image; 2], display: Display) -> Result<[Cow<'a, Image>; 2], MetricError> {
    let shown = |picture: &'a Image| match display.space {
        ColorSpace::Report => Ok(Cow::Borrowed(picture)),
        ColorSpace::Linear => image::displayed(picture, display).map(Cow::Owned).map_err(MetricError::Memory),
    };
    let [test, reference] = pictures;
    Ok([shown(test)?, shown(reference)?])
}

/// Fails if two pictures cannot be compared.
fn check(test: &Image, reference: &Image, options: &Options<'_>) -> Result<(), MetricError> {
    check_pair(test, reference)?;
    let positive = |name, value: f64, range: std::ops::RangeInclusive<f64>, valid| {
        if range.contains(&value) { Ok(()) } else { Err(MetricError::Option { name, value, valid }) }
    };
    positive("the outlier threshold", options.outlier_threshold, 0.0..=f64::MAX, "0 or more, and finite")?;
    positive("pixels per degree", options.pixels_per_degree, 1.0..=1000.0, "1 to 1000")?;
    if let Some(mask) = options.mask {
        if mask.len() != test.pixels.len() {
            return Err(MetricError::Mask { mask: mask.len(), pixels: test.pixels.len() });
        }
        let left = mask.iter().filter(|compared| **compared).count() as u64;
        let floor = options.min_pixels.max(1);
        if left < floor {
            return Err(MetricError::TooFew { left, floor });
        }
    } else if (test.pixels.len() as u64) < options.min_pixels {
        return Err(MetricError::TooFew { left: test.pixels.len() as u64, floor: options.min_pixels });
    }
    Ok(())
}

/// Fails unless two pictures have the same size, are not empty, and are finite.
fn check_pair(test: &Image, reference: &Image) -> Result<(), MetricError> {
    let sizes = [test, reference].map(|image| [image.width, image.height]);
    if sizes[0] != sizes[1] {
        return Err(MetricError::Size { test: sizes[0], reference: sizes[1] });
    }
    let [width, height] = sizes[0];
    if width == 0 || height == 0 {
        return Err(MetricError::Empty { width, height });
    }
    for (which, image) in [(Which::Test, test), (Which::Reference, reference)] {
        if image.pixels.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(MetricError::Malformed { which, width, height, pixels: image.pixels.len() });
        }
        check_finite(which, image)?;
    }
    Ok(())
}

fn check_finite(which: Which, image: &Image) -> Result<(), MetricError> {
    let bad = |pixel: &[f32; 4]| pixel[..3].iter().any(|value| !value.is_finite());
    let Some(first) = image.pixels.iter().position(bad) else { return Ok(()) };
    let pixel = image.pixels[first];
    let channel = pixel.iter().position(|value| !value.is_finite()).unwrap_or_default();
    let width = image.width as usize;
    Err(MetricError::NotFinite {
        which,
        x: (first % width) as u32,
        y: (first / width) as u32,
        channel: ["red", "green", "blue", "alpha"][channel],
        value: pixel[channel],
        count: image.pixels[first..].iter().filter(|pixel| bad(pixel)).count(),
    })
}

/// The display value of a value: see the module's documentation.
fn displayed(value: f32) -> f64 {
    f64::from(value.clamp(0.0, 1.0))
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

#[cfg(test)]
mod tests;
