//! Allocation of paths to pixels.
//!
//! A pixel has two halves of equally many independent paths. Where A and B are the mean colours of the halves, the pixel's colour is (A + B) / 2.
//! The error needs no model: (A - B) / 2 has the variance of (A + B) / 2.
//!
//! In each round, some pixels get twice as many paths: first those where one more path reduces the squared error most. If the squared error
//! falls as a power of the number of paths, this reduction is the squared error over that number, times the power. The allocation is best
//! when the reduction is the same for all pixels. Numbers of paths are powers of two, for which the Sobol points of a half are a net.
//!
//! A colour is unbiased only if the number of its paths does not depend on their values. So a pixel's error is estimated from its neighbours
//! alone. Two weak dependences remain: on the neighbours of its neighbours, which include the pixel itself, and on the sum over the picture,
//! which one pixel hardly changes. No path is thrown away.

use glam::DVec3;
use rayon::prelude::*;

/// Least number of paths of a half before the first round, if a half may have this many.
pub(super) const FIRST: u32 = 4;

/// Lower bound on a pixel's squared error times its number of paths, as a share of the mean of this product over all pixels: the pixel's
/// neighbours may have missed rare paths.
const LEAST: f64 = 0.05;

/// Least number of paths of the whole picture for which an error estimate is trusted: fewer may agree by chance.
const LEAST_PATHS: f64 = 8192.0;

/// Least and greatest number of paths that a round adds, as shares of the number of paths before the round.
const ROUND: [f64; 2] = [0.05, 0.5];

/// The 97.7 % quantile of the normal distribution. The error is tested after each round, and must not end the rounds by chance in more than
/// 5 % of all cases.
const QUANTILE: f64 = 2.0;

/// A pixel whose glass is stochastic.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sampled {
    /// Its index in the picture.
    pub index: u32,
    /// Whether rough or dispersive glass divided a path of this pixel into several ways; if not, its paths differ only by Russian roulette.
    pub divided: bool,
    /// Sums of the colours of the paths of each half.
    pub sums: [DVec3; 2],
    /// Number of paths of each half.
    pub count: u32,
}

impl Sampled {
    /// The colour: the mean of all paths.
    pub fn color(&self) -> DVec3 {
        0.5 * (self.sums[0] + self.sums[1]) / f64::from(self.count.max(1))
    }

    /// Estimated squared error of the colour, averaged over the channels. 0 for a colour that is not finite, which more paths cannot repair.
    fn square(&self) -> f64 {
        let off = 0.5 * (self.sums[0] - self.sums[1]) / f64::from(self.count.max(1));
        let square = off.length_squared() / 3.0;
        if square.is_finite() { square } else { 0.0 }
    }

    /// Number of paths.
    pub fn paths(&self) -> u32 {
        2 * self.count
    }
}

/// Number of paths in each half of every pixel before the error is first estimated: a power of two, up to `most`.
pub(super) fn first_count(pixels: usize, most: u32) -> u32 {
    let least = LEAST_PATHS / (2 * pixels).max(1) as f64;
    let mut count = FIRST;
    while f64::from(count) < least && count < most {
        count *= 2;
    }
    count.min(most)
}

/// Greatest number of paths of a half where a pixel may have `paths`, which counts as 4 if it is less: a power of two.
pub(super) fn most_of_half(paths: u32) -> u32 {
    1 << (paths / 2).max(2).ilog2()
}

/// For each pixel, whether its number of paths is doubled; a half gets at most `most`. `pixels` must be in ascending order of their index, in a
/// picture of width `width`. `reached` is the bound of the error after the last round, relative to the error that the job requests.
pub(super) fn doubled(pixels: &[Sampled], width: u32, most: u32, reached: f64) -> Vec<bool> {
    let mut squares: Vec<f64> =
        pixels.par_iter().map(|pixel| square_of_path(pixels, pixel, i64::from(width))).collect();
    let least = LEAST * squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    for (square, pixel) in squares.iter_mut().zip(pixels) {
        *square = square.max(least) / f64::from(pixel.count).powi(2);
    }
    let mut order: Vec<usize> = (0..pixels.len()).filter(|place| pixels[*place].count < most).collect();
    order.par_sort_unstable_by(|one, other| squares[*other].total_cmp(&squares[*one]).then(one.cmp(other)));
    // With Sobol points, the squared error falls at best as the number of paths to the power of -1.5. So `share` is the least share of additional
    // paths that can reach the requested error.
    let [low, high] = ROUND;
    let share = ((reached * reached).cbrt().powi(2) - 1.0).clamp(low, high);
    let mut more = (share * pixels.iter().map(|pixel| f64::from(pixel.count)).sum::<f64>()).max(1.0);
    let mut doubled = vec![false; pixels.len()];
    for place in order {
        if more <= 0.0 {
            break;
        }
        doubled[place] = true;
        more -= f64::from(pixels[place].count);
    }
    doubled
}

/// The squared error times the number of paths, averaged over a pixel's neighbours; 0 without neighbours.
fn square_of_path(pixels: &[Sampled], pixel: &Sampled, width: i64) -> f64 {
    let index = i64::from(pixel.index);
    let (mut sum, mut count) = (0.0, 0.0);
    for row in [index - width, index, index + width] {
        let from = pixels.partition_point(|near| i64::from(near.index) < row - 1);
        let near = pixels[from..].iter().take_while(|near| i64::from(near.index) <= row + 1);
        // Excludes pixels that are adjacent by index but lie beyond the border, in another row.
        let beside = |near: &&Sampled| (i64::from(near.index) % width - index % width).abs() <= 1;
        for near in near.filter(beside).filter(|near| near.index != pixel.index) {
            sum += near.square() * f64::from(near.count);
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// The error of a picture, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Error {
    /// The root mean square error, as estimated.
    pub estimate: f64,
    /// Upper bound that the error exceeds in no round, with a probability of 95 %. It is above the estimate, since estimate and true error scatter.
    pub bound: f64,
}

/// The error of the picture, over its stochastic pixels.
pub(super) fn error(pixels: &[Sampled]) -> Error {
    let (mut sum, mut squares) = (0.0, 0.0);
    for square in pixels.iter().map(Sampled::square) {
        sum += square;
        squares += square * square;
    }
    let count = pixels.len().max(1) as f64;
    let mean = sum / count;
    // Twice the relative variance of the sum: the true squared errors scatter like the estimated ones, and independently of them.
    let seen = if sum > 0.0 { 2.0 * squares / (sum * sum) } else { 0.0 };
    // With few pixels, this variance is itself uncertain, so it has a lower bound. For normal variables, the mean fourth power is 3 times the
    // squared variance (a pixel whose channels vary together). The last factor keeps the bound above the quantile of the ratio of two such means
    // for one, two and three pixels.
    let least = 6.0 / count * (1.0 + 1.0 / count);
    Error { estimate: mean.sqrt(), bound: (mean * (QUANTILE * seen.max(least).sqrt()).exp()).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(index: u32, apart: f64, count: u32) -> Sampled {
        let sums = [0.0, apart * f64::from(count)].map(DVec3::splat);
        Sampled { index, sums, count, ..Sampled::default() }
    }

    #[test]
    fn numbers_are_powers_of_two_up_to_the_most() {
        assert_eq!([2, 4, 5, 7, 8, 16, 100, 4096].map(most_of_half), [2, 2, 2, 2, 4, 8, 32, 2048]);
        // With few pixels, each gets enough paths for the error to be trusted.
        let first = [(100_000, 2048), (100_000, 2), (1000, 2048), (100, 2048), (1, 2048), (0, 2048)];
        assert_eq!(first.map(|(pixels, most)| first_count(pixels, most)), [4, 2, 8, 64, 2048, 2048]);
    }

    /// Three adjacent pixels in a row of five; only the middle one has an error.
    #[test]
    fn a_pixel_is_given_paths_by_the_error_of_its_neighbours() {
        let pixels = [pixel(1, 0.0, 4), pixel(2, 2.0, 4), pixel(3, 0.0, 4)];
        let found = pixels.map(|pixel| square_of_path(&pixels, &pixel, 5));
        assert_eq!(found, [4.0, 0.0, 4.0], "a pixel's own error does not count");
        // Half as many paths again are 6: doubling the first pixel adds only 4.
        assert_eq!(doubled(&pixels, 5, 64, 9.0), [true, false, true]);
        assert_eq!(doubled(&pixels, 5, 64, 1.0), [true, false, false]);
        // Pixels with the most paths stay. The other pixel gets more, although its neighbours show no error.
        let full = [pixel(1, 0.0, 64), pixel(2, 2.0, 4), pixel(3, 0.0, 64)];
        assert_eq!(doubled(&full, 5, 64, 9.0), [false, true, false]);
        // One more path reduces the error less where there are more paths: a quarter at twice the number.
        let more = [pixel(1, 1.0, 8), pixel(2, 0.0, 4), pixel(11, 1.9, 4), pixel(12, 0.0, 4)];
        assert_eq!(doubled(&more, 10, 64, 1.01), [false, true, false, false]);
        // The last pixel of a row and the first of the next one are no neighbours; those above and below are.
        let apart = [pixel(4, 1.0, 4), pixel(5, 0.0, 4), pixel(9, 0.0, 4)];
        let found = apart.map(|pixel| square_of_path(&apart, &pixel, 5));
        assert!(found[1] == 0.0 && found[2] > 0.0, "{found:?}");
        assert_eq!(doubled(&[pixel(4, 0.0, 4)], 5, 64, 2.0), [true], "all agree");
        assert!(doubled(&[], 5, 64, 2.0).is_empty());
    }

    #[test]
    fn a_pixel_takes_what_plans_count() {
        // Per pixel: its data, its error, its place in the order, and whether it is doubled. The marks of stochastic pixels are dropped before.
        let bytes = (size_of::<Sampled>() + size_of::<f64>() + size_of::<usize>() + 1) as u64;
        assert!((bytes..bytes + 8).contains(&curitiba_pipeline::programs::ADAPTIVE_BYTES), "{bytes}");
    }

    #[test]
    fn the_error_is_half_the_difference_of_the_halves() {
        let pixels: Vec<Sampled> = (0..10_000).map(|index| pixel(index, 0.1, 8)).collect();
        let Error { estimate, bound } = error(&pixels);
        assert!((estimate - 0.05).abs() < 1e-9 && bound > estimate && bound < 1.03 * estimate, "{estimate} {bound}");
        assert!((pixels[0].color() - DVec3::splat(0.05)).abs().max_element() < 1e-12);
        // Only one pixel is noisy, so the estimate is uncertain.
        let Error { estimate, bound } = error(&[pixel(0, 0.0, 8), pixel(1, 9.0, 8)]);
        assert!(bound > 3.0 * estimate, "{estimate} {bound}");
        assert_eq!(error(&[]), Error { estimate: 0.0, bound: 0.0 });
        let broken = [f64::NAN, f64::INFINITY].map(|color| pixel(2, color, 8));
        assert!(broken.iter().all(|broken| error(&[pixel(0, 0.1, 8), *broken]).estimate < 0.05));
    }
}
