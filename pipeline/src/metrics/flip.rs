//! FLIP, the difference that a person sees when two pictures are shown in turn at one place: Andersson, Nilsson,
//! Akenine-Möller, Oskarsson, Åström, Fairchild: FLIP, A Difference Evaluator for Alternating Images, Proceedings of the
//! ACM on Computer Graphics and Interactive Techniques 3(2), 2020. Written from the paper's formulas, for displayed
//! (low-dynamic-range) pictures; sections below are the paper's.

use super::color_spaces::{lab, opponent, rgb_of_opponent};
use super::filter::{Kernel, Plane, bands};
use super::{ErrorMap, MetricError, Options, check, displayed};
use crate::color::decode_f64;
use crate::image::Image;
use std::f64::consts::PI;

/// Contrast sensitivity as sums of Gaussians `a sqrt(pi / b) exp(-pi^2 x^2 / b)`, x in degrees (section 4.1, table 1):
/// amplitudes and widths of the achromatic, the red-green and the blue-yellow channel.
const SENSITIVITY: [&[[f64; 2]]; 3] = [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];

/// Exponent of the colour difference (section 4.1).
const Q_COLOR: f64 = 0.7;
/// Share of the largest colour difference that is mapped to [`P_T`] (section 4.1).
const P_C: f64 = 0.4;
const P_T: f64 = 0.95;
/// Width of the feature detector, degrees (section 4.2).
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent of the feature difference (section 4.2).
const Q_FEATURE: f64 = 0.5;

/// The error of every pixel, 0 to 1.
///
/// # Errors
/// As [`compare`](super::compare). A mask does not change the map.
pub fn flip_map(test: &Image, reference: &Image, options: &Options<'_>) -> Result<ErrorMap, MetricError> {
    check(test, reference, options)?;
    let [test, reference] = &super::displays([test, reference], options.display)?;
    Ok(map(test, reference, options))
}

/// CIE L*, 0 to 100, of a displayed colour taken as encoded in sRGB.
#[must_use]
pub fn perceived_lightness(color: [f32; 3]) -> f64 {
    lab(color.map(|value| decode_f64(displayed(value))))[0]
}

/// The FLIP map of pictures that are known to be comparable.
pub(super) fn map(test: &Image, reference: &Image, options: &Options<'_>) -> ErrorMap {
    let filters = Filters::new(options.pixels_per_degree);
    let redistribution = Redistribution::new();
    let height = test.height as usize;
    let parts = bands(height, |rows| {
        let (test, reference) = (filters.see(test, &rows), filters.see(reference, &rows));
        let differences = test.iter().zip(&reference).map(|(test, reference)| {
            let color = redistribution.apply(hyab(test.color, reference.color).powf(Q_COLOR));
            let edge = (test.edge - reference.edge).abs();
            let point = (test.point - reference.point).abs();
            let feature = (edge.max(point) / std::f64::consts::SQRT_2).powf(Q_FEATURE);
            // Rounding aside, the colour and the feature difference lie in 0..=1 (section 4.3).
            color.powf(1.0 - feature.min(1.0)).clamp(0.0, 1.0)
        });
        differences.collect::<Vec<f64>>()
    });
    ErrorMap { width: test.width, height: test.height, values: parts.concat() }
}

/// What a person sees of a pixel.
struct Seen {
    /// CIELAB, Hunt-adjusted, after contrast-sensitivity filtering.
    color: [f64; 3],
    /// Strength of an edge.
    edge: f64,
    /// Strength of a point or line.
    point: f64,
}

struct Filters {
    /// For each channel the Gaussians of its sensitivity: a kernel along rows and one down columns, whose product sums to
    /// the Gaussian's share of the channel.
    sensitivity: [Vec<(Kernel, Kernel)>; 3],
    /// Gaussian, its first and its second derivative.
    features: [Kernel; 3],
}

impl Filters {
    fn new(pixels_per_degree: f64) -> Self {
        // One radius for all: three standard deviations of the widest Gaussian.
        let widest = SENSITIVITY.iter().copied().flatten().map(|[_, b]| *b).fold(0.0, f64::max);
        let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as usize;
        let sensitivity = SENSITIVITY.map(|gaussians| {
            let kernels: Vec<(f64, Kernel)> = gaussians
                .iter()
                .map(|[a, b]| {
                    let gauss = |x: f64| (-(PI * x / pixels_per_degree).powi(2) / b).exp();
                    (a * (PI / b).sqrt(), Kernel::new(radius, gauss))
                })
                .collect();
            // The two-dimensional filter sums to 1.
            let total: f64 = kernels.iter().map(|(weight, kernel)| weight * kernel.sum().powi(2)).sum();
            kernels.into_iter().map(|(weight, kernel)| (kernel.clone(), kernel.scaled(weight / total))).collect()
        });
        let sigma = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let radius = (3.0 * sigma).ceil() as usize;
        let gauss = move |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
        let features = [
            Kernel::new(radius, gauss).normalised(),
            Kernel::new(radius, |x| -x * gauss(x)).balanced(),
            Kernel::new(radius, |x| (x * x / (sigma * sigma) - 1.0) * gauss(x)).balanced(),
        ];
        Self { sensitivity, features }
    }

    /// What a person sees of some rows of a picture.
    fn see(&self, image: &Image, rows: &std::ops::Range<usize>) -> Vec<Seen> {
        let (width, height) = (image.width as usize, image.height as usize);
        let halo = self.sensitivity[0][0].0.radius().max(self.features[0].radius());
        let planes = Plane::stack(width, height, rows, halo, |index| {
            let pixel = &image.pixels[index];
            opponent([0, 1, 2].map(|channel| decode_f64(displayed(pixel[channel]))))
        });
        let sensed: [Vec<(Plane, &Kernel)>; 3] = std::array::from_fn(|channel| {
            let gaussians = self.sensitivity[channel].iter();
            gaussians.map(|(across, down)| (planes[channel].along_rows(across), down)).collect()
        });
        // The luminance without its offset and scale, 0 to 1: see `opponent`.
        let luminance = planes[0].map(|value| (value + 16.0) / 116.0);
        let [gauss, first, second] = &self.features;
        let (smooth, slope, bend) =
            (luminance.along_rows(gauss), luminance.along_rows(first), luminance.along_rows(second));
        let mut seen = Vec::with_capacity(rows.len() * width);
        let mut lines: [Vec<f64>; 7] = std::array::from_fn(|_| vec![0.0; width]);
        for y in rows.clone() {
            lines.iter_mut().for_each(|line| line.fill(0.0));
            for (channel, gaussians) in sensed.iter().enumerate() {
                for (plane, down) in gaussians {
                    plane.down_columns(y, down, &mut lines[channel]);
                }
            }
            slope.down_columns(y, gauss, &mut lines[3]);
            smooth.down_columns(y, first, &mut lines[4]);
            bend.down_columns(y, gauss, &mut lines[5]);
            smooth.down_columns(y, second, &mut lines[6]);
            seen.extend((0..width).map(|x| {
                let rgb = rgb_of_opponent([lines[0][x], lines[1][x], lines[2][x]]);
                Seen {
                    color: hunt(lab(rgb.map(|value| value.clamp(0.0, 1.0)))),
                    edge: lines[3][x].hypot(lines[4][x]),
                    point: lines[5][x].hypot(lines[6][x]),
                }
            }));
        }
        seen
    }
}

/// Spreads colour differences over 0..=1 (section 4.1, equation 6).
struct Redistribution {
    largest: f64,
}

impl Redistribution {
    /// The largest difference is that of sRGB green and blue.
    fn new() -> Self {
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|rgb| hunt(lab(rgb)));
        Self { largest: hyab(green, blue).powf(Q_COLOR) }
    }

    fn apply(&self, difference: f64) -> f64 {
        let knee = P_C * self.largest;
        if difference < knee {
            P_T / knee * difference
        } else {
            P_T + (difference - knee) / (self.largest - knee) * (1.0 - P_T)
        }
    }
}

/// Distance for large colour differences (section 4.1; Abasi et al. 2020).
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// The Hunt effect: differences of colour grow with luminance (section 4.1).
fn hunt([l, a, b]: [f64; 3]) -> [f64; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_redistribution_meets_at_its_knee_and_ends_at_one() {
        let spread = Redistribution::new();
        assert!((spread.apply(spread.largest) - 1.0).abs() < 1e-12);
        let knee = P_C * spread.largest;
        assert!((spread.apply(knee) - P_T).abs() < 1e-12);
        assert!((spread.apply(knee * (1.0 - 1e-12)) - P_T).abs() < 1e-9);
        assert_eq!(spread.apply(0.0), 0.0);
    }

    #[test]
    fn every_sensitivity_filter_sums_to_one() {
        for pixels_per_degree in [1.0, 30.0, 67.0, 1000.0] {
            let filters = Filters::new(pixels_per_degree);
            for channel in &filters.sensitivity {
                let sum: f64 = channel.iter().map(|(across, down)| across.sum() * down.sum()).sum();
                assert!((sum - 1.0).abs() < 1e-12, "{sum} at {pixels_per_degree}");
            }
        }
    }
}
