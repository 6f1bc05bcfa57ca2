//! Positions of the samples within a pixel.
//!
//! The samples are Hammersley points with a digital shift: sample `i` of `N = 2^m` lies `(i + 1/2) / N` of a pixel from the left
//! and `(v + 1/2) / N` from the top, where `v` is `i` with its `m` binary digits reversed and then the `⌊m/2⌋` most significant
//! digits flipped. They form a (0, m, 2)-net in base 2 (Niederreiter 1987, "Point sets and sequences with small discrepancy",
//! Monatshefte für Mathematik 104): each of the `N` columns, each of the `N` rows, and each box of area `1/N` from repeatedly
//! halving the pixel contains one sample. So:
//!
//! * A vertical or horizontal edge has `N + 1` shades; a regular grid of as many samples has `√N + 1`.
//! * The mean of the samples is the pixel's centre, and the set is symmetric under half turns; with 4, 16 and 64 samples also under
//!   quarter turns. With 4 samples it is the rotated grid of graphics hardware.
//! * The coordinates are multiples of 1/128 of a pixel: rasterisers that snap corners to 1/256 treat every sample's picture alike.
//!
//! The flipped digits were chosen among all `N` possibilities by the coverage error of half-planes at all angles and distances.
//!
//! With an adaptive number, rays are first traced for four samples of every pixel. Two of them are the samples nearest to the first two
//! samples of a pixel with four samples. The other two are the images of these two under a rotation by 180 degrees. For the remaining
//! samples rays are traced only at pixels whose first four results differ from each other or from the results of neighbours.

use std::fmt;
use std::str::FromStr;

/// Number of samples a pixel: 1, 2, 4, 8, 16, 32 or 64. With an adaptive number, rays are traced for only four of the samples at pixels
/// where these four have like results.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PixelSamples {
    count: u32,
    /// The bits of the tolerance, which is not negative; `None` for a number that is not adaptive.
    within: Option<u32>,
}

impl PixelSamples {
    /// One sample, at the pixel's centre.
    pub const ONE: Self = Self { count: 1, within: None };

    /// The valid numbers.
    pub const COUNTS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];

    /// With an adaptive number: for how many samples rays are traced at every pixel.
    pub const FIRST: u32 = 4;

    /// The largest tolerance.
    pub const LARGEST_TOLERANCE: f32 = 1.0;

    /// Bytes a pixel that a ray pass keeps to decide where rays are traced, with an adaptive number.
    pub(crate) const SHARE_BYTES: u64 = 64 + 1 + 4;

    /// `count` samples; `None` if it is not in [`Self::COUNTS`].
    #[must_use]
    pub fn new(count: u32) -> Option<Self> {
        Self::COUNTS.contains(&count).then_some(Self { count, within: None })
    }

    /// The adaptive number with this count. Rays are traced for only four samples where the share of a ray pass, its output divided by
    /// the colour, differs by at most `tolerance`, 0 to 1, within a pixel and between the pixel and its neighbours. `None` if the
    /// tolerance is out of range, or if there are at most four samples.
    #[must_use]
    pub fn within(self, tolerance: f32) -> Option<Self> {
        let valid = self.count > Self::FIRST && (0.0..=Self::LARGEST_TOLERANCE).contains(&tolerance);
        // Adding 0 turns -0 into 0: the bits of -0 are those of a large number.
        valid.then_some(Self { within: Some((tolerance + 0.0).to_bits()), ..self })
    }

    /// The tolerance of an adaptive number; `None` for any other.
    #[must_use]
    pub fn tolerance(self) -> Option<f32> {
        self.within.map(f32::from_bits)
    }

    /// The same number of samples, with rays for all of them.
    #[must_use]
    pub fn of_every_pixel(self) -> Self {
        Self { within: None, ..self }
    }

    /// Number of samples.
    #[must_use]
    pub fn count(self) -> u32 {
        self.count
    }

    /// The samples in the order in which they are rendered. With an adaptive number, the four with rays at every pixel come first.
    #[must_use]
    pub fn order(self) -> Vec<u32> {
        let all = 0..self.count;
        if self.within.is_none() {
            return all.collect();
        }
        let nearest = |[x, y]: [f32; 2]| {
            let away = |sample: &u32| {
                let [left, top] = self.offset(*sample);
                (left - x).hypot(top - y)
            };
            all.clone().min_by(|a, b| away(a).total_cmp(&away(b))).expect("there are samples")
        };
        let four = Self { count: Self::FIRST, within: None };
        let [a, b] = [0, 1].map(|sample| nearest(four.offset(sample)));
        let first = [a, b, self.count - 1 - b, self.count - 1 - a];
        first.into_iter().chain(all.filter(|sample| !first.contains(sample))).collect()
    }

    /// Whether there is more than one sample.
    #[must_use]
    pub fn are_several(self) -> bool {
        self.count > 1
    }

    /// Position of a sample: offset in pixels to the right of the pixel's centre and below it, in -1/2..1/2; exact.
    ///
    /// # Panics
    /// If `sample` is not below the number of samples.
    #[must_use]
    pub fn offset(self, sample: u32) -> [f32; 2] {
        assert!(sample < self.count, "sample {sample} of {}", self.count);
        let digits = self.count.trailing_zeros();
        let reversed = sample.reverse_bits().checked_shr(32 - digits).unwrap_or(0);
        let flipped = reversed ^ (self.count - (self.count >> (digits / 2)));
        [sample, flipped].map(|cell| (cell as f32 + 0.5) / self.count as f32 - 0.5)
    }

    /// Side of the square that a sample represents, in pixels: the footprint of texture filtering. All samples together then filter
    /// as much as a single sample for the whole pixel.
    #[must_use]
    pub fn side(self) -> f32 {
        (self.count as f32).sqrt().recip()
    }

    /// Seed for a sample whose random numbers do not continue those of the sample before. The first sample has the picture's own
    /// seed.
    #[must_use]
    pub fn seed(seed: u32, sample: u32) -> u32 {
        seed.wrapping_add(sample.wrapping_mul(0x85eb_ca6b))
    }
}

impl Default for PixelSamples {
    fn default() -> Self {
        Self::ONE
    }
}

impl fmt::Display for PixelSamples {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.count.fmt(f)?;
        self.tolerance().map_or(Ok(()), |tolerance| write!(f, ":{tolerance}"))
    }
}

impl FromStr for PixelSamples {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let counts = Self::COUNTS.map(|count| count.to_string()).join(", ");
        let (number, tolerance) = text.split_once(':').map_or((text, None), |(number, within)| (number, Some(within)));
        let samples = number.parse().ok().and_then(Self::new).ok_or_else(|| {
            format!("`{number}` is no number of samples a pixel; valid: {counts} (powers of two, of which every row and column of a pixel has one)")
        })?;
        let Some(tolerance) = tolerance else { return Ok(samples) };
        tolerance.parse().ok().and_then(|tolerance| samples.within(tolerance)).ok_or_else(|| {
            format!(
                "`{text}` is no number of samples with a tolerance; valid: 8, 16, 32 or 64, a colon, and by how much shadows, occlusion and glass \
                 may differ, 0 to 1, such as 16:0.02"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn all() -> impl Iterator<Item = PixelSamples> {
        PixelSamples::COUNTS.into_iter().map(|count| PixelSamples::new(count).expect("there are so many"))
    }

    fn offsets(samples: PixelSamples) -> Vec<[f32; 2]> {
        (0..samples.count()).map(|sample| samples.offset(sample)).collect()
    }

    #[test]
    fn every_box_of_an_equal_share_has_one_sample() {
        for samples in all() {
            let digits = samples.count().trailing_zeros();
            for columns in 0..=digits {
                let cell = |offset: f32, count: u32| ((offset + 0.5) * count as f32) as u32;
                let (across, down) = (1 << columns, samples.count() >> columns);
                let cells: BTreeSet<_> =
                    offsets(samples).iter().map(|[x, y]| (cell(*x, across), cell(*y, down))).collect();
                assert_eq!(cells.len(), samples.count() as usize, "{samples}: {across} columns and {down} rows");
            }
        }
    }

    #[test]
    fn samples_lie_around_the_centre() {
        assert_eq!(offsets(PixelSamples::ONE), [[0.0, 0.0]]);
        for samples in all() {
            let points = offsets(samples);
            assert!(points.iter().flatten().all(|value| value.abs() < 0.5 && (value * 128.0).fract() == 0.0));
            assert_eq!([0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f32>()), [0.0; 2]);
            assert!(points.iter().all(|[x, y]| points.contains(&[-x, -y])), "{samples}: half a turn");
            let quarter = points.iter().all(|[x, y]| points.contains(&[-y, *x]));
            assert_eq!(quarter, samples.count().trailing_zeros() % 2 == 0, "{samples}: a quarter turn");
        }
        let four = PixelSamples::new(4).map(offsets).expect("four");
        assert_eq!(four, [[-0.375, 0.125], [-0.125, -0.375], [0.125, 0.375], [0.375, -0.125]]);
    }

    /// The area of a pixel on one side of a line at `distance` from its centre: the distribution of a sum of two uniform numbers.
    fn share(normal: [f64; 2], distance: f64) -> f64 {
        let [a, b] = normal.map(f64::abs);
        let ramp = |value: f64| value.max(0.0).powi(2);
        let [plus, minus] = [(a + b) / 2.0, (a - b) / 2.0];
        (ramp(distance + plus) - ramp(distance + minus) - ramp(distance - minus) + ramp(distance - plus))
            / (2.0 * a * b)
    }

    /// Root mean square error and largest error of the coverage of half-planes at `angles`.
    fn error(points: &[[f32; 2]], angles: impl Iterator<Item = f64>) -> [f64; 2] {
        let (mut squares, mut largest, mut count) = (0.0, 0.0_f64, 0);
        for angle in angles {
            let normal = [angle.cos(), angle.sin()];
            for step in -120..=120 {
                let distance = f64::from(step) / 160.0;
                let exact = share(normal, distance);
                if !(1e-9..1.0 - 1e-9).contains(&exact) {
                    continue;
                }
                let inside = |[x, y]: &&[f32; 2]| f64::from(*x) * normal[0] + f64::from(*y) * normal[1] < distance;
                let off = points.iter().filter(inside).count() as f64 / points.len() as f64 - exact;
                (squares, largest, count) = (squares + off * off, largest.max(off.abs()), count + 1);
            }
        }
        [(squares / f64::from(count)).sqrt(), largest]
    }

    /// At all angles half-planes have the error of a regular grid; nearly vertical and horizontal edges have far less.
    #[test]
    fn half_planes_are_covered_as_by_a_grid_and_better_along_the_axes() {
        let everywhere = || (0..90).map(|step| (f64::from(step) + 0.5) * 2.0_f64.to_radians());
        let near_axes = || (0..8).map(|step| f64::from(step / 2) * 90.0 + if step % 2 == 0 { 0.25 } else { -0.4 });
        for (count, side) in [(4, 2), (16, 4), (64, 8)] {
            let samples = PixelSamples::new(count).expect("so many");
            let axis = |index: i32| (index as f32 + 0.5) / side as f32 - 0.5;
            let grid: Vec<[f32; 2]> = (0..side * side).map(|index| [axis(index % side), axis(index / side)]).collect();
            let net = offsets(samples);
            let [ours, largest] = error(&net, everywhere());
            let [theirs, _] = error(&grid, everywhere());
            let along = error(&net, near_axes().map(f64::to_radians))[0];
            let grid_along = error(&grid, near_axes().map(f64::to_radians))[0];
            println!(
                "{count}: {ours:.4}, largest {largest:.4}, grid {theirs:.4}; near axes {along:.4}, grid {grid_along:.4}"
            );
            assert!(
                ours < 1.15 * theirs && largest < 0.75 * f64::from(count).powf(-0.625),
                "{ours} {theirs} {largest}"
            );
            assert!(along < 1.3 * grid_along / f64::from(side), "{along} {grid_along}");
        }
    }

    /// The first four samples lie in one quarter of the pixel each, and their mean is its centre. So values that change evenly are not
    /// shifted.
    #[test]
    fn an_adaptive_number_takes_four_samples_around_the_centre_first() {
        for samples in all() {
            assert_eq!(samples.order(), Vec::from_iter(0..samples.count()));
            let Some(adaptive) = samples.within(0.02) else {
                assert!(samples.count() <= PixelSamples::FIRST);
                continue;
            };
            let order = adaptive.order();
            assert_eq!(BTreeSet::from_iter(order.iter().copied()), BTreeSet::from_iter(0..samples.count()));
            let first = order[..4].iter().map(|sample| samples.offset(*sample));
            let first: Vec<_> = first.collect();
            assert_eq!([0, 1].map(|axis| first.iter().map(|point| point[axis]).sum::<f32>()), [0.0; 2], "{samples}");
            let quarters: BTreeSet<_> = first.iter().map(|point| point.map(|side| side < 0.0)).collect();
            assert_eq!(quarters.len(), 4, "{samples}: {first:?}");
            assert_eq!((adaptive.to_string().parse(), adaptive.tolerance()), (Ok(adaptive), Some(0.02)));
            assert_eq!(adaptive.of_every_pixel(), samples);
        }
        assert_eq!("16:-0".parse::<PixelSamples>(), "16:0".parse());
        for text in ["4:0.02", "16:", "16:2", "16:-0.1", "16:nan", "16:0.02:1", ":0.02"] {
            let error = text.parse::<PixelSamples>().expect_err(text);
            assert!(error.contains("valid"), "{error}");
        }
    }

    #[test]
    fn other_numbers_are_refused_with_those_that_there_are() {
        for samples in all() {
            assert_eq!(samples.to_string().parse(), Ok(samples));
        }
        for text in ["0", "3", "9", "128", "-4", "4x", "", "4294967296"] {
            let error = text.parse::<PixelSamples>().expect_err(text);
            assert!(error.contains("1, 2, 4, 8, 16, 32, 64"), "{error}");
        }
    }

    #[test]
    fn the_first_sample_has_the_pictures_seed_and_no_other_has_the_same() {
        let seeds: BTreeSet<u32> = (0..64).map(|sample| PixelSamples::seed(7, sample)).collect();
        assert_eq!((PixelSamples::seed(7, 0), seeds.len()), (7, 64));
    }
}
