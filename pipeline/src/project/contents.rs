//! Textures that the engine fills with random numbers: `<CONTENT value="RANDOM_UNIFORM"/>`.
//!
//! The engine takes the numbers from the C library, so they differ from machine to machine. Here SplitMix64 (Steele, Lea and
//! Flood 2014) generates them, the same on every machine, thread and run.

use crate::image::PixelFormat;
use rayon::prelude::*;

/// Increment of SplitMix64's state: 2⁶⁴ divided by the golden ratio, rounded to an odd number.
const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// How random numbers are distributed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Distribution {
    /// Evenly from 0 to 1, both included, in steps of 1 / (2²⁴ - 1).
    Uniform,
    /// Normally, with mean 0 and variance 1, by Box and Muller (1958).
    Normal,
}

impl Distribution {
    /// The names of distributions in project files; `None` for zeros.
    pub(super) const NAMED: [(&'static str, Option<Self>); 3] =
        [("NONE", None), ("RANDOM_UNIFORM", Some(Self::Uniform)), ("RANDOM_NORMAL", Some(Self::Normal))];
}

/// The random numbers that a texture holds when a frame begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Contents {
    /// Their distribution.
    pub distribution: Distribution,
    /// Initial state of SplitMix64. 0 unless the project says otherwise.
    pub seed: u64,
}

impl Contents {
    /// The format that holds the numbers: 32-bit floats, with as many channels as `declared`, as in the engine.
    #[must_use]
    pub fn format(declared: PixelFormat) -> PixelFormat {
        match declared {
            PixelFormat::R8Unorm | PixelFormat::R32Float => PixelFormat::R32Float,
            PixelFormat::Rg32Float => PixelFormat::Rg32Float,
            PixelFormat::Rgba8Unorm | PixelFormat::Rgba16Float | PixelFormat::Rgba32Float => PixelFormat::Rgba32Float,
        }
    }

    /// Fills a texture of `width` texels a row, whose top row is first in `texels`. The sequence starts in the bottom row. It
    /// goes from texel to texel and, within a texel, from red to alpha. Channels that the format (one of [`Self::format`])
    /// lacks are 0, and alpha is 1.
    pub fn fill(self, format: PixelFormat, width: u32, texels: &mut [[f32; 4]]) {
        let count = match format {
            PixelFormat::R8Unorm | PixelFormat::R32Float => 1,
            PixelFormat::Rg32Float => 2,
            PixelFormat::Rgba8Unorm | PixelFormat::Rgba16Float | PixelFormat::Rgba32Float => 4,
        };
        let width = width.max(1) as usize;
        let rows = texels.len() / width;
        texels.par_chunks_mut(width).enumerate().for_each(|(row, texels)| {
            let first = (rows - 1 - row) * width;
            for (column, texel) in texels.iter_mut().enumerate() {
                *texel = [0.0, 0.0, 0.0, 1.0];
                for (part, value) in texel[..count].iter_mut().enumerate() {
                    *value = self.number(((first + column) * count + part) as u64);
                }
            }
        });
    }

    /// The number at an index of the sequence, from 0.
    fn number(self, index: u64) -> f32 {
        match self.distribution {
            Distribution::Uniform => uniform(self.seed, index),
            Distribution::Normal => {
                // The logarithm of 0 is not finite.
                let [length, turn] = [index & !1, index | 1].map(|index| f64::from(uniform(self.seed, index)));
                let (sine, cosine) = (std::f64::consts::TAU * turn).sin_cos();
                let length = (-2.0 * length.max(1e-8).ln()).sqrt();
                (length * if index.is_multiple_of(2) { cosine } else { sine }) as f32
            }
        }
    }
}

/// The upper 24 bits of a number of the sequence, scaled to 0 to 1.
fn uniform(seed: u64, index: u64) -> f32 {
    const MOST: f32 = ((1_u32 << 24) - 1) as f32;
    (random(seed, index) >> 40) as f32 / MOST
}

/// SplitMix64's number at an index, from 0, of the sequence that begins with the state `seed`.
fn random(seed: u64, index: u64) -> u64 {
    let state = seed.wrapping_add(STEP.wrapping_mul(index.wrapping_add(1)));
    let mixed = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    mixed ^ mixed >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers that the generator's authors and the Java library give.
    #[test]
    fn the_sequence_is_splitmix64() {
        let first: Vec<u64> = (0..5).map(|index| random(1_234_567, index)).collect();
        let known = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        assert_eq!(first, known);
        assert_eq!(random(0, 0), 0xE220_A839_7B1D_CDAF);
    }

    fn filled(distribution: Distribution, format: PixelFormat, [width, height]: [u32; 2]) -> Vec<[f32; 4]> {
        let mut texels = vec![[7.0; 4]; (width * height) as usize];
        Contents { distribution, seed: 0 }.fill(format, width, &mut texels);
        texels
    }

    #[test]
    fn numbers_go_from_the_bottom_row_up_and_formats_have_as_many_as_they_hold() {
        let at = |index: u64| uniform(0, index);
        let four = filled(Distribution::Uniform, PixelFormat::Rgba32Float, [3, 2]);
        assert_eq!(four[3], [at(0), at(1), at(2), at(3)], "the first of the bottom row");
        assert_eq!(four[2], [at(20), at(21), at(22), at(23)], "the last of the top row");
        let two = filled(Distribution::Uniform, PixelFormat::Rg32Float, [3, 2]);
        assert_eq!((two[3], two[4]), ([at(0), at(1), 0.0, 1.0], [at(2), at(3), 0.0, 1.0]));
        let one = filled(Distribution::Uniform, PixelFormat::R32Float, [3, 2]);
        assert_eq!((one[3], one[0]), ([at(0), 0.0, 0.0, 1.0], [at(3), 0.0, 0.0, 1.0]));
    }

    /// Checks that the moments of `values`, and the mean product of neighbours, differ from `known` by less than five standard
    /// errors. `squares` are the known mean squares of the same quantities.
    fn check(values: &[f64], known: [f64; 4], squares: [f64; 4]) {
        let count = values.len() as f64;
        let mean = |of: &dyn Fn(usize) -> f64| (0..values.len()).map(of).sum::<f64>() / count;
        let next = |index: usize| values[(index + 1) % values.len()];
        let found = [
            mean(&|index| values[index]),
            mean(&|index| values[index].powi(2)),
            mean(&|index| values[index].powi(4)),
            mean(&|index| values[index] * next(index)),
        ];
        for ((found, known), square) in found.into_iter().zip(known).zip(squares) {
            let error = ((square - known * known) / count).sqrt();
            assert!((found - known).abs() < 5.0 * error, "{found}, and {known} within {error} is right");
        }
    }

    #[test]
    fn uniform_and_normal_numbers_have_the_moments_of_their_distributions() {
        let all = |distribution| -> Vec<f64> {
            let texels = filled(distribution, PixelFormat::Rgba32Float, [512, 256]);
            texels.as_flattened().iter().map(|value| f64::from(*value)).collect()
        };
        let uniform = all(Distribution::Uniform);
        assert!(uniform.iter().all(|value| (0.0..=1.0).contains(value)));
        // The mean of x^n is 1 / (n + 1); products of neighbours have the mean 1/4 and the mean square 1/9.
        check(&uniform, [0.5, 1.0 / 3.0, 0.2, 0.25], [1.0 / 3.0, 0.2, 1.0 / 9.0, 1.0 / 9.0]);
        let normal = all(Distribution::Normal);
        // The means of x^2, x^4, x^8 are 1, 3, 105.
        check(&normal, [0.0, 1.0, 3.0, 0.0], [1.0, 3.0, 105.0, 1.0]);
        // Shares of a normal distribution within one, two and three standard deviations.
        for (within, share) in [(1.0, 0.682_689), (2.0, 0.954_500), (3.0, 0.997_300)] {
            let found = normal.iter().filter(|value| value.abs() < within).count() as f64 / normal.len() as f64;
            assert!((found - share).abs() < 5.0 * (share * (1.0 - share) / normal.len() as f64).sqrt(), "{found}");
        }
    }
}
