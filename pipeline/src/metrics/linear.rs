//! Errors of linear values.

use super::Options;
use crate::image::Image;
use rayon::prelude::*;

/// Added to the square of the reference in the relative error, so that black pixels do not dominate it.
const RELATIVE_FLOOR: f64 = 0.01;

/// Errors of linear values.
pub(super) struct Errors {
    /// Pixels compared.
    pub pixels: u64,
    /// Mean square error.
    pub mse: f64,
    /// Relative mean square error.
    pub relative_mse: f64,
    /// Largest difference.
    pub max: f64,
    /// Sum of the test divided by the sum of the reference.
    pub energy_ratio: f64,
    /// Share of outlier pixels.
    pub outliers: f64,
}

#[derive(Default, Clone, Copy)]
struct Sums {
    pixels: u64,
    squares: f64,
    relative: f64,
    max: f64,
    test: f64,
    reference: f64,
    outliers: u64,
}

impl Sums {
    fn add(&mut self, test: &[f32; 4], reference: &[f32; 4], threshold: f64) {
        let mut largest = 0.0_f64;
        for (test, reference) in test[..3].iter().zip(&reference[..3]) {
            let (test, reference) = (f64::from(*test), f64::from(*reference));
            let square = (test - reference).powi(2);
            self.squares += square;
            self.relative += square / (reference * reference + RELATIVE_FLOOR);
            self.test += test;
            self.reference += reference;
            largest = largest.max((test - reference).abs());
        }
        self.max = self.max.max(largest);
        self.outliers += u64::from(largest > threshold);
        self.pixels += 1;
    }

    fn merge(self, other: Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            squares: self.squares + other.squares,
            relative: self.relative + other.relative,
            max: self.max.max(other.max),
            test: self.test + other.test,
            reference: self.reference + other.reference,
            outliers: self.outliers + other.outliers,
        }
    }
}

/// The errors of pictures that are known to be comparable.
pub(super) fn errors(test: &Image, reference: &Image, options: &Options<'_>) -> Errors {
    let width = test.width as usize;
    let row = |y: usize| {
        let mut sums = Sums::default();
        for index in y * width..(y + 1) * width {
            if options.mask.is_none_or(|mask| mask[index]) {
                sums.add(&test.pixels[index], &reference.pixels[index], options.outlier_threshold);
            }
        }
        sums
    };
    // Rows are summed in order, whichever thread computed them.
    let rows: Vec<Sums> = (0..test.height as usize).into_par_iter().map(row).collect();
    let sums = rows.into_iter().fold(Sums::default(), Sums::merge);
    let values = 3.0 * sums.pixels as f64;
    Errors {
        pixels: sums.pixels,
        mse: sums.squares / values,
        relative_mse: sums.relative / values,
        max: sums.max,
        energy_ratio: match (sums.test, sums.reference) {
            (0.0, 0.0) => 1.0,
            (_, 0.0) => f64::INFINITY,
            (test, reference) => test / reference,
        },
        outliers: sums.outliers as f64 / sums.pixels as f64,
    }
}
