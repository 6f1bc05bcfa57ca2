//! Mean and scatter of pictures that arrive in batches.

use crate::memory::{self, Refused};
use rayon::prelude::*;

/// Running mean and sum of squared deviations of a picture's values, in f64, by Welford's method with weights.
///
/// A batch of `w` samples brings a mean `x`: with `W` the samples so far, `w` among them, `mean += w/W (x - mean)` and
/// `M2 += w (x - old mean) (x - new mean)` (West 1979, "Updating mean and variance estimates", CACM 22(9)).
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Pixels a row.
    width: u32,
    /// Rows.
    height: u32,
    /// Values a pixel: 1 if red, green and blue are equal and alpha is 1, otherwise 4.
    channels: usize,
    samples: u64,
    batches: u32,
    mean: Vec<f64>,
    m2: Vec<f64>,
}

impl Estimate {
    /// An empty estimate.
    ///
    /// # Errors
    /// If there is no memory: 16 bytes for every value of every pixel.
    pub(super) fn new(width: u32, height: u32, channels: usize) -> Result<Self, Refused> {
        let values = width as usize * height as usize * channels;
        let (mean, m2) = (memory::filled(0.0, values)?, memory::filled(0.0, values)?);
        Ok(Self { width, height, channels, samples: 0, batches: 0, mean, m2 })
    }

    /// Samples a point so far.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Number of batches so far; the standard error is estimated from their scatter.
    #[must_use]
    pub fn batches(&self) -> u32 {
        self.batches
    }

    /// Width and height of the picture in pixels.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Adds a batch: the mean picture of `samples` further samples.
    pub(super) fn add(&mut self, pixels: &[[f32; 4]], samples: u32) {
        self.samples += u64::from(samples);
        self.batches += 1;
        let (weight, share) = (f64::from(samples), f64::from(samples) / self.samples as f64);
        let channels = self.channels;
        let values = self.mean.par_chunks_mut(channels).zip(self.m2.par_chunks_mut(channels)).zip(pixels);
        values.with_min_len(4096).for_each(|((mean, m2), pixel)| {
            for ((mean, m2), value) in mean.iter_mut().zip(m2).zip(pixel) {
                let before = f64::from(*value) - *mean;
                *mean += share * before;
                *m2 += weight * before * (f64::from(*value) - *mean);
            }
        });
    }

    /// Calls `shown` for each pixel with the mean and the standard error of its four channels, and collects the results.
    fn each<T: Send>(&self, shown: impl Fn([f64; 4], [f64; 4]) -> T + Sync) -> Vec<T> {
        let scale = 1.0 / ((f64::from(self.batches) - 1.0) * self.samples as f64);
        let values = self.mean.par_chunks(self.channels).zip(self.m2.par_chunks(self.channels));
        let four = |values: &[f64], alpha: f64| match values {
            [one] => [*one, *one, *one, alpha],
            more => [more[0], more[1], more[2], more[3]],
        };
        let pixel = |(mean, m2): (&[f64], &[f64])| {
            let error = four(m2, 0.0).map(|m2| (m2 * scale).sqrt());
            shown(four(mean, 1.0), error)
        };
        values.with_min_len(4096).map(pixel).collect()
    }

    /// The mean picture, with red, green and blue raised to `exponent`. Negative colours count as 0 if the exponent is not 1.
    pub(super) fn mean(&self, exponent: f32) -> Vec<[f32; 4]> {
        let raised = |value: f64| (value as f32).powf(exponent);
        let of_color = |value: f64| if exponent == 1.0 { value as f32 } else { raised(value.max(0.0)) };
        self.each(|[red, green, blue, alpha], _| match self.channels {
            1 => [raised(red), raised(green), raised(blue), 1.0],
            _ => [of_color(red), of_color(green), of_color(blue), alpha as f32],
        })
    }

    /// The standard error of the picture that `mean` returns. The error of a power follows from its derivative at the mean. NaN before
    /// the second batch.
    pub(super) fn standard_error(&self, exponent: f32) -> Vec<[f32; 4]> {
        let power = f64::from(exponent);
        let slope = |mean: f64| if power != 1.0 && mean > 0.0 { power * mean.powf(power - 1.0) } else { 1.0 };
        self.each(|mean, error| std::array::from_fn(|i| (error[i] * if i < 3 { slope(mean[i]) } else { 1.0 }) as f32))
    }

    /// The root mean square of [`Self::standard_error`] over the red, green and blue of all pixels. Values that are not finite are left
    /// out, because no further sample makes them finite. NaN without a finite value, as before the second batch.
    pub(super) fn error(&self, exponent: f32) -> f64 {
        let errors = self.standard_error(exponent);
        let finite = errors.iter().flat_map(|pixel| &pixel[..3]).filter(|error| error.is_finite());
        let (sum, count) =
            finite.fold((0.0, 0_u64), |(sum, count), error| (sum + f64::from(*error).powi(2), count + 1));
        (sum / count as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_error_are_those_of_the_textbook() {
        // Batches of 4, 4 and 2 samples of two pixels, with these means.
        let batches = [(4_u32, [0.25_f32, 0.5]), (4, [0.75, 0.5]), (2, [0.5, 0.0])];
        let mut estimate = Estimate::new(2, 1, 1).expect("little memory");
        for (samples, values) in batches {
            estimate.add(&values.map(|value| [value, value, value, 1.0]), samples);
        }
        assert_eq!((estimate.samples(), estimate.batches()), (10, 3));
        for pixel in 0..2 {
            let weighted = |of: &dyn Fn(f64) -> f64| -> f64 {
                batches.iter().map(|(w, values)| f64::from(*w) * of(f64::from(values[pixel]))).sum()
            };
            let mean = weighted(&|x| x) / 10.0;
            let error = (weighted(&|x| (x - mean).powi(2)) / (2.0 * 10.0)).sqrt();
            assert!((f64::from(estimate.mean(1.0)[pixel][1]) - mean).abs() < 1e-7);
            assert!((f64::from(estimate.standard_error(1.0)[pixel][2]) - error).abs() < 1e-7);
            // The error of a square: twice the value times the error.
            assert!((f64::from(estimate.mean(2.0)[pixel][0]) - mean * mean).abs() < 1e-7);
            assert!((f64::from(estimate.standard_error(2.0)[pixel][0]) - 2.0 * mean * error).abs() < 1e-7);
            assert_eq!((estimate.mean(2.0)[pixel][3], estimate.standard_error(2.0)[pixel][3]), (1.0, 0.0));
        }
    }

    #[test]
    fn four_values_are_kept_apart_and_one_batch_has_no_error() {
        let mut estimate = Estimate::new(1, 1, 4).expect("little memory");
        estimate.add(&[[1.0, 2.0, 3.0, 0.5]], 16);
        assert_eq!(estimate.mean(1.0), [[1.0, 2.0, 3.0, 0.5]]);
        assert_eq!(estimate.mean(2.0), [[1.0, 4.0, 9.0, 0.5]], "alpha has no exponent");
        assert!(estimate.standard_error(1.0)[0].iter().all(|value| value.is_nan()));
        estimate.add(&[[1.0, 4.0, 3.0, 0.5]], 16);
        assert_eq!(estimate.mean(1.0), [[1.0, 3.0, 3.0, 0.5]]);
        // Two values 2 and 4: the standard error of their mean is sqrt(2 / 2) = 1.
        assert_eq!(estimate.standard_error(1.0), [[0.0, 1.0, 0.0, 0.0]]);
    }

    #[test]
    fn a_pixel_that_is_not_finite_does_not_hide_the_error_of_the_others() {
        let mut estimate = Estimate::new(3, 1, 1).expect("little memory");
        let batch = |values: [f32; 3]| values.map(|value| [value, value, value, 1.0]);
        estimate.add(&batch([2.0, f32::NAN, 1.0]), 16);
        assert!(estimate.error(1.0).is_nan(), "one batch has no error");
        estimate.add(&batch([4.0, 0.5, f32::INFINITY]), 16);
        assert_eq!(estimate.error(1.0), 1.0);
        let mut nowhere = Estimate::new(1, 1, 1).expect("little memory");
        (0..2).for_each(|_| nowhere.add(&[[f32::NAN; 4]], 16));
        assert!(nowhere.error(1.0).is_nan());
    }
}
