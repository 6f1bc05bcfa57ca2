//! Telling error from noise: are two noisy pictures estimates of the same one?
//!
//! Each picture comes with the variance of its mean, pixel by pixel. Under the null hypothesis both have the same expectation, and the
//! noise of pixels is independent. Then the difference of a value divided by its standard deviation follows Student's t with the degrees
//! of freedom of Welch (Biometrika 34, 1947), or the standard normal distribution where variances are known. Each quotient is converted to
//! the normal value of the same tail probability by Wallace's formula (Annals of Mathematical Statistics 30, 1959). So one expectation
//! holds for all values: 4.55 % lie beyond 2 standard deviations, and 0.27 % beyond 3.
//!
//! A pixel with few samples is not normally distributed: where nine in ten rays agree, all samples of a pixel often agree, and its
//! estimated variance is 0. The verdict therefore sums over tiles of 8 x 8 pixels. Their noise is nearly normal, their estimated
//! variance is seldom 0, and they gather a small common bias that no single pixel shows.

use super::{MetricError, Which, check_pair};
use crate::image::Image;
use serde::{Deserialize, Serialize};

/// Share of values beyond 2 standard deviations under the null hypothesis.
pub const EXPECTED_BEYOND_2: f64 = 0.045_500_263_896_358_4;
/// Share of values beyond 3 standard deviations under the null hypothesis.
pub const EXPECTED_BEYOND_3: f64 = 0.002_699_796_063_260_19;

/// Side of a tile, pixels.
const TILE: usize = 8;
/// Threshold of the verdict in standard deviations of a normal distribution: pictures with equal expectations exceed it in 1 of 30,000
/// pairs.
const VERDICT_SIGMA: f64 = 4.0;

/// A noisy picture.
#[derive(Debug, Clone, Copy)]
pub struct Estimate<'a> {
    /// Mean of its samples.
    pub mean: &'a Image,
    /// Variance of that mean (the samples' variance divided by their number), of the same size.
    pub variance_of_mean: &'a Image,
    /// How many independent samples the variance was estimated from, at least 2; `None` if the variance is known.
    pub samples: Option<u32>,
}

/// Conclusion of the test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The differences are as large as the noise makes them: nothing speaks against equal expectations.
    Noise,
    /// The differences are larger than the noise explains.
    Different,
    /// Neither picture has noise, and the sums of all tiles are equal: there is nothing to test.
    Equal,
}

/// Result of [`z_test`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ZTest {
    /// Values (pixels times colours) with noise.
    pub values: u64,
    /// Values without noise in both pictures that are equal: they carry no information.
    pub equal_without_noise: u64,
    /// Values whose estimated noise is 0 in both pictures and that differ.
    pub different_without_noise: u64,
    /// Share of [`Self::values`] beyond 2 standard deviations; [`EXPECTED_BEYOND_2`] under the null hypothesis.
    pub beyond_2: f64,
    /// Share of [`Self::values`] beyond 3 standard deviations; [`EXPECTED_BEYOND_3`] under the null hypothesis.
    pub beyond_3: f64,
    /// Tiles of 8 x 8 pixels with noise.
    pub tiles: u64,
    /// Sums of one colour over a tile, without noise in both pictures, that differ: one is enough for [`Verdict::Different`].
    pub tiles_different_without_noise: u64,
    /// Mean of the tiles' squared z values, averaged over colours: chi-square divided by its degrees of freedom, 1 under
    /// the null hypothesis.
    pub chi_square: f64,
    /// `(chi_square - 1) sqrt(tiles / 2)`: standard deviations above the expectation for noise. The colours of a pixel are counted as
    /// one, since their noise is often the same, so this errs on the side of noise.
    pub sigma: f64,
    /// [`Verdict::Different`] if [`Self::sigma`] is above 4, or [`Self::tiles_different_without_noise`] above 0.
    pub verdict: Verdict,
}

/// Tests whether two noisy pictures have the same expectation.
///
/// # Errors
/// If sizes differ, the pictures are empty, a value is not finite, a variance is negative, or a number of samples is below 2.
pub fn z_test(test: Estimate<'_>, reference: Estimate<'_>) -> Result<ZTest, MetricError> {
    check_pair(test.mean, reference.mean)?;
    check_pair(test.variance_of_mean, reference.variance_of_mean)?;
    check_pair(test.mean, test.variance_of_mean)?;
    for (which, estimate) in [(Which::Test, test), (Which::Reference, reference)] {
        check_variance(which, estimate.variance_of_mean)?;
        if estimate.samples.is_some_and(|samples| samples < 2) {
            let value = estimate.samples.map_or(0.0, f64::from);
            return Err(MetricError::Option { name: "the number of samples", value, valid: "2 or more" });
        }
    }
    let (width, height) = (test.mean.width as usize, test.mean.height as usize);
    let mut counts = Counts::default();
    for top in (0..height).step_by(TILE) {
        for left in (0..width).step_by(TILE) {
            let mut sums = [Term::default(); 3];
            for y in top..(top + TILE).min(height) {
                for index in y * width + left..y * width + (left + TILE).min(width) {
                    for (channel, sum) in sums.iter_mut().enumerate() {
                        let term = Term::new(&test, &reference, index, channel);
                        counts.value(&term);
                        sum.add(&term);
                    }
                }
            }
            counts.tile(&sums);
        }
    }
    Ok(counts.result())
}

fn check_variance(which: Which, variance: &Image) -> Result<(), MetricError> {
    let negative = |pixel: &[f32; 4]| pixel[..3].iter().copied().find(|value| *value < 0.0);
    let found = variance.pixels.iter().enumerate().find_map(|(index, pixel)| Some((index, negative(pixel)?)));
    let Some((index, value)) = found else { return Ok(()) };
    let width = variance.width as usize;
    Err(MetricError::Variance { which, x: (index % width) as u32, y: (index / width) as u32, value })
}

/// A difference and its variance.
#[derive(Clone, Copy, Default)]
struct Term {
    difference: f64,
    variance: f64,
    /// Sum of `variance^2 / degrees of freedom` over the estimated variances (Welch).
    spread: f64,
}

impl Term {
    fn new(test: &Estimate<'_>, reference: &Estimate<'_>, index: usize, channel: usize) -> Self {
        let mean = |estimate: &Estimate<'_>| f64::from(estimate.mean.pixels[index][channel]);
        let mut term = Self { difference: mean(test) - mean(reference), ..Self::default() };
        for estimate in [test, reference] {
            let variance = f64::from(estimate.variance_of_mean.pixels[index][channel]);
            term.variance += variance;
            term.spread += estimate.samples.map_or(0.0, |samples| variance * variance / f64::from(samples - 1));
        }
        term
    }

    fn add(&mut self, other: &Self) {
        self.difference += other.difference;
        self.variance += other.variance;
        self.spread += other.spread;
    }

    /// The difference divided by its standard deviation, converted to the normal value of the same tail probability; `None` if the variance
    /// is 0.
    fn z(&self) -> Option<f64> {
        (self.variance > 0.0).then(|| {
            let t = self.difference / self.variance.sqrt();
            if self.spread > 0.0 { normal_of_student(t, self.variance * self.variance / self.spread) } else { t }
        })
    }
}

/// Wallace's approximation: the normal value with the same tail probability as Student's `t`. Error below 0.02 for 6 degrees of
/// freedom up to 4 standard deviations.
fn normal_of_student(t: f64, freedom: f64) -> f64 {
    let scale = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0);
    (scale * (freedom * (t * t / freedom).ln_1p()).sqrt()).copysign(t)
}

#[derive(Default)]
struct Counts {
    values: u64,
    equal: u64,
    different: u64,
    beyond_2: u64,
    beyond_3: u64,
    tiles: u64,
    tiles_different: u64,
    squares: f64,
}

impl Counts {
    fn value(&mut self, term: &Term) {
        match term.z() {
            Some(z) => {
                self.values += 1;
                self.beyond_2 += u64::from(z.abs() > 2.0);
                self.beyond_3 += u64::from(z.abs() > 3.0);
            }
            None if term.difference == 0.0 => self.equal += 1,
            None => self.different += 1,
        }
    }

    fn tile(&mut self, sums: &[Term; 3]) {
        let (mut squares, mut noisy) = (0.0, 0_u32);
        for sum in sums {
            match sum.z() {
                Some(z) => {
                    squares += z * z;
                    noisy += 1;
                }
                None if sum.difference != 0.0 => self.tiles_different += 1,
                None => {}
            }
        }
        if noisy > 0 {
            self.tiles += 1;
            self.squares += squares / f64::from(noisy);
        }
    }

    fn result(&self) -> ZTest {
        let share = |count: u64, of: u64| if of > 0 { count as f64 / of as f64 } else { 0.0 };
        let chi_square = if self.tiles > 0 { self.squares / self.tiles as f64 } else { 1.0 };
        let sigma = (chi_square - 1.0) * (self.tiles as f64 / 2.0).sqrt();
        let verdict = if self.tiles_different > 0 || sigma > VERDICT_SIGMA {
            Verdict::Different
        } else if self.tiles == 0 {
            Verdict::Equal
        } else {
            Verdict::Noise
        };
        ZTest {
            values: self.values,
            equal_without_noise: self.equal,
            different_without_noise: self.different,
            beyond_2: share(self.beyond_2, self.values),
            beyond_3: share(self.beyond_3, self.values),
            tiles: self.tiles,
            tiles_different_without_noise: self.tiles_different,
            chi_square,
            sigma,
            verdict,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard normal numbers by the method of Box and Muller on a linear congruential generator.
    struct Normal(u64);

    impl Normal {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        }

        fn next(&mut self) -> f64 {
            (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
        }
    }

    fn image(side: u32, mut value: impl FnMut(u32) -> f32) -> Image {
        let pixels = (0..side * side).map(|index| [value(index), value(index), value(index), 1.0]).collect();
        Image { width: side, height: side, pixels }
    }

    /// The mean of `samples` noisy pictures and the variance of that mean. Values have expectation 0.5 + `shift` and standard
    /// deviation 0.1.
    fn sampled(normal: &mut Normal, samples: u32, shift: f64) -> [Image; 2] {
        let mut mean = Image::filled(64, 64, [0.0; 4]);
        let mut variance = mean.clone();
        for (mean, variance) in mean.pixels.iter_mut().zip(&mut variance.pixels) {
            for channel in 0..3 {
                let values: Vec<f64> = (0..samples).map(|_| 0.5 + shift + 0.1 * normal.next()).collect();
                let average = values.iter().sum::<f64>() / f64::from(samples);
                let squares: f64 = values.iter().map(|value| (value - average).powi(2)).sum();
                mean[channel] = average as f32;
                variance[channel] = (squares / f64::from(samples - 1) / f64::from(samples)) as f32;
            }
        }
        [mean, variance]
    }

    fn of(images: &[Image; 2], samples: Option<u32>) -> Estimate<'_> {
        Estimate { mean: &images[0], variance_of_mean: &images[1], samples }
    }

    #[test]
    fn a_known_difference_has_its_z_value() {
        let side = 8;
        let pair = |mean: f32, variance: f32| [image(side, |_| mean), image(side, |_| variance)];
        // Every value is 2.5 standard deviations off; a tile of 64 sums to 2.5 * 8.
        let found = z_test(of(&pair(0.75, 0.0064), None), of(&pair(0.5, 0.0036), None)).expect("comparable");
        assert_eq!((found.values, found.beyond_2, found.beyond_3), (192, 1.0, 0.0));
        assert!((found.chi_square - 400.0).abs() < 1e-3, "{found:?}");
        assert_eq!(found.verdict, Verdict::Different);
    }

    #[test]
    fn equal_expectations_pass_with_known_and_with_estimated_variance() {
        let mut normal = Normal(1);
        for samples in [4, 32] {
            let (a, b) = (sampled(&mut normal, samples, 0.0), sampled(&mut normal, samples, 0.0));
            let found = z_test(of(&a, Some(samples)), of(&b, Some(samples))).expect("comparable");
            assert_eq!(found.verdict, Verdict::Noise, "{found:?}");
            assert!((found.chi_square - 1.0).abs() < 0.35, "{found:?}");
            assert!((found.beyond_2 - EXPECTED_BEYOND_2).abs() < 0.01, "{found:?}");
            assert!((found.beyond_3 - EXPECTED_BEYOND_3).abs() < 0.003, "{found:?}");
        }
        let known = |normal: &mut Normal| [image(64, |_| (0.1 * normal.next()) as f32), image(64, |_| 0.01)];
        let found = z_test(of(&known(&mut normal), None), of(&known(&mut normal), None)).expect("comparable");
        assert_eq!(found.verdict, Verdict::Noise, "{found:?}");
        assert!((found.beyond_2 - EXPECTED_BEYOND_2).abs() < 0.006, "{found:?}");
    }

    #[test]
    fn a_bias_of_a_fifth_of_the_noise_is_found() {
        let mut normal = Normal(2);
        let (a, b) = (sampled(&mut normal, 4, 0.02), sampled(&mut normal, 4, 0.0));
        let found = z_test(of(&a, Some(4)), of(&b, Some(4))).expect("comparable");
        assert_eq!(found.verdict, Verdict::Different, "{found:?}");
    }

    #[test]
    fn few_samples_taken_for_known_variances_would_look_like_a_difference() {
        let mut normal = Normal(3);
        let (a, b) = (sampled(&mut normal, 2, 0.0), sampled(&mut normal, 2, 0.0));
        let share = |samples| z_test(of(&a, samples), of(&b, samples)).expect("comparable").beyond_3;
        assert!(share(None) > 10.0 * EXPECTED_BEYOND_3);
        assert!(share(Some(2)) < 4.0 * EXPECTED_BEYOND_3);
    }

    #[test]
    fn pictures_without_noise_are_equal_or_different() {
        let pair = |value: f32| [image(16, |_| value), image(16, |_| 0.0)];
        let equal = z_test(of(&pair(0.5), None), of(&pair(0.5), None)).expect("comparable");
        assert_eq!((equal.verdict, equal.values, equal.equal_without_noise), (Verdict::Equal, 0, 768));
        let different = z_test(of(&pair(0.5), None), of(&pair(0.501), None)).expect("comparable");
        assert_eq!((different.verdict, different.different_without_noise), (Verdict::Different, 768));
    }

    #[test]
    fn wallace_agrees_with_tables_of_student() {
        // t of the two-sided tail probabilities 0.05 and 0.002.
        for (freedom, t, z) in
            [(6.0, 2.447, 1.960), (6.0, 5.208, 3.090), (10.0, 2.228, 1.960), (30.0, 3.385, 3.090), (2.0, 4.303, 1.960)]
        {
            assert!(
                (normal_of_student(t, freedom) - z).abs() < 0.04,
                "{freedom} {t}: {}",
                normal_of_student(t, freedom)
            );
            assert_eq!(normal_of_student(-t, freedom), -normal_of_student(t, freedom));
        }
    }

    #[test]
    fn wrong_variances_are_refused() {
        let good = [image(4, |_| 0.0), image(4, |_| 1.0)];
        let negative = [image(4, |_| 0.0), image(4, |index| if index == 6 { -1.0 } else { 1.0 })];
        let found = z_test(of(&good, None), of(&negative, None));
        assert_eq!(found, Err(MetricError::Variance { which: Which::Reference, x: 2, y: 1, value: -1.0 }));
        assert!(matches!(z_test(of(&good, Some(1)), of(&good, None)), Err(MetricError::Option { .. })));
    }
}
