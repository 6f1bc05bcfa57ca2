//! The outputs of passes, and checks for invalid values in them.

use crate::backend::NO_TRIANGLE;
use rayon::prelude::*;

/// Tolerance of a normal's length: the error from 16-bit floats and from interpolating unit normals.
const NORMAL_TOLERANCE: f32 = 1e-2;

/// The valid values of an output. NaN and infinities are always invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Range {
    /// Every channel is 0 or more. All may exceed 1, even alpha, because the raster pass lights all four channels alike.
    Color,
    /// Every channel is a share in 0..=1, such as visibility of the light or ambient occlusion.
    Share,
    /// A position; every finite value is valid. The fourth channel is a cosine, 0..=1.
    Position,
    /// A unit vector (its length within 0.01 of 1) and a fourth channel of 0; or all 0 where no surface is seen.
    Normal,
}

/// A channel of a render target, or the window, as a pass left it.
#[derive(Debug, Clone)]
pub struct Output<'a> {
    /// The pass that wrote it.
    pub pass: &'a str,
    /// Name of the channel: `library::texture`, or `window`.
    pub channel: String,
    /// The valid values.
    pub range: Range,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The pixels, top row first, rounded to the declared format as later passes read them.
    pub pixels: &'a [[f32; 4]],
}

/// Counts of invalid values of one component of an output.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Faults {
    /// Values that are not a number.
    pub nan: u64,
    /// Values that are infinite.
    pub infinite: u64,
    /// Negative values where the least valid one is 0, as in colours and shares.
    pub negative: u64,
    /// Other finite values outside the range.
    pub out_of_range: u64,
    /// Index of the first pixel with an invalid value.
    pub first: Option<usize>,
}

impl Faults {
    /// Number of all invalid values.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.nan + self.infinite + self.negative + self.out_of_range
    }

    /// Checks a value that must be in `low..=high`.
    fn count(&mut self, index: usize, value: f32, low: f32, high: f32) {
        let counter = if value.is_nan() {
            &mut self.nan
        } else if value.is_infinite() {
            &mut self.infinite
        } else if value < 0.0 && low >= 0.0 {
            &mut self.negative
        } else if value < low || value > high {
            &mut self.out_of_range
        } else {
            return;
        };
        *counter += 1;
        self.first.get_or_insert(index);
    }

    /// The sum of two counts: of two parts of an output, or of two frames.
    #[must_use]
    pub fn and(self, later: Self) -> Self {
        Self {
            nan: self.nan + later.nan,
            infinite: self.infinite + later.infinite,
            negative: self.negative + later.negative,
            out_of_range: self.out_of_range + later.out_of_range,
            first: match (self.first, later.first) {
                (Some(a), Some(b)) => Some(a.min(b)),
                (a, b) => a.or(b),
            },
        }
    }
}

impl Output<'_> {
    /// Names of the four components.
    #[must_use]
    pub fn components(&self) -> [&'static str; 4] {
        match self.range {
            Range::Color | Range::Share => ["red", "green", "blue", "alpha"],
            Range::Position => ["x", "y", "z", "cosine"],
            Range::Normal => ["x", "y", "z", "w"],
        }
    }

    /// Counts invalid values by component. A normal of a wrong length is counted once, in its first component.
    #[must_use]
    pub fn faults(&self) -> [Faults; 4] {
        let count = |(index, pixel): (usize, &[f32; 4])| {
            let mut faults = [Faults::default(); 4];
            let limits = match self.range {
                Range::Color => [(0.0, f32::MAX); 4],
                Range::Share => [(0.0, 1.0); 4],
                Range::Position => [(f32::MIN, f32::MAX), (f32::MIN, f32::MAX), (f32::MIN, f32::MAX), (0.0, 1.0)],
                Range::Normal => {
                    let side = (-1.0 - NORMAL_TOLERANCE, 1.0 + NORMAL_TOLERANCE);
                    [side, side, side, (-0.0, 0.0)]
                }
            };
            for ((faults, value), (low, high)) in faults.iter_mut().zip(pixel).zip(limits) {
                faults.count(index, *value, low, high);
            }
            if self.range == Range::Normal && faults.iter().all(|faults| faults.total() == 0) {
                let length = pixel[..3].iter().map(|value| value * value).sum::<f32>().sqrt();
                if length != 0.0 {
                    faults[0].count(index, length, 1.0 - NORMAL_TOLERANCE, 1.0 + NORMAL_TOLERANCE);
                }
            }
            faults
        };
        let merge = |a: [Faults; 4], b: [Faults; 4]| std::array::from_fn(|i| a[i].and(b[i]));
        let pixels = self.pixels.par_iter().enumerate().with_min_len(4096);
        pixels.map(count).reduce(|| [Faults::default(); 4], merge)
    }
}

/// The triangle ids that a raster pass wrote.
#[derive(Debug, Clone)]
pub struct Triangles<'a> {
    /// The pass.
    pub pass: &'a str,
    /// Number of triangles in the pass's scene. Valid ids are below this, or [`NO_TRIANGLE`].
    pub count: usize,
    /// Pixels a row.
    pub width: u32,
    /// The ids of all pixels, top row first.
    pub ids: &'a [u32],
}

impl Triangles<'_> {
    /// Counts ids that name no triangle.
    #[must_use]
    pub fn faults(&self) -> Faults {
        let mut faults = Faults::default();
        for (index, id) in self.ids.iter().enumerate() {
            if *id != NO_TRIANGLE && *id as usize >= self.count {
                faults.out_of_range += 1;
                faults.first.get_or_insert(index);
            }
        }
        faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(range: Range, pixels: &[[f32; 4]]) -> [Faults; 4] {
        let channel = "library::texture".to_owned();
        Output { pass: "pass1", channel, range, width: pixels.len() as u32, height: 1, pixels }.faults()
    }

    #[test]
    fn sound_values_of_every_range_have_no_fault() {
        let none = [Faults::default(); 4];
        assert_eq!(faults(Range::Color, &[[0.0, 7.5, 0.2, 1.0], [-0.0; 4]]), none);
        assert_eq!(faults(Range::Share, &[[0.0, 1.0, 0.5, 1.0]]), none);
        assert_eq!(faults(Range::Position, &[[-1e30, 3.0, 0.0, 1.0], [0.0; 4]]), none);
        assert_eq!(faults(Range::Normal, &[[0.0, -1.0, 0.0, 0.0], [0.0; 4], [0.6, 0.0, 0.801, -0.0]]), none);
    }

    #[test]
    fn each_kind_of_wrong_value_is_counted_where_it_is() {
        let mut pixels = vec![[0.5, 0.5, 0.5, 1.0]; 10_000];
        pixels[9000][1] = f32::NAN;
        pixels[77][1] = f32::NAN;
        pixels[50][2] = f32::NEG_INFINITY;
        pixels[60][0] = -1e-20;
        pixels[70][3] = -0.25;
        let found = faults(Range::Color, &pixels);
        let clean = Faults::default();
        assert_eq!(found[0], Faults { negative: 1, first: Some(60), ..clean });
        assert_eq!(found[1], Faults { nan: 2, first: Some(77), ..clean });
        assert_eq!(found[2], Faults { infinite: 1, first: Some(50), ..clean });
        assert_eq!(found[3], Faults { negative: 1, first: Some(70), ..clean });
        assert_eq!(
            faults(Range::Share, &[[0.5, 0.5, 0.5, 1.001]])[3],
            Faults { out_of_range: 1, first: Some(0), ..clean }
        );
        assert_eq!(faults(Range::Share, &[[1.5, 0.5, -0.5, 1.0]]).map(|faults| faults.total()), [1, 0, 1, 0]);
        // Colours may exceed 1 and shares may not; positions may be negative and their cosine may not.
        assert_eq!(faults(Range::Color, &[[1.5, 0.5, 0.5, 1.0]]), [clean; 4]);
        assert_eq!(faults(Range::Position, &[[-1.0, 0.0, 0.0, -0.5]])[3].negative, 1);
        assert_eq!(faults(Range::Normal, &[[0.5, 0.5, 0.5, 0.0]])[0].out_of_range, 1);
        assert_eq!(faults(Range::Normal, &[[0.0, 0.0, 1.0, 0.25]])[3].out_of_range, 1);
    }

    #[test]
    fn ids_of_no_triangle_are_counted() {
        let triangles = Triangles { pass: "pass1", count: 5, width: 4, ids: &[0, 4, NO_TRIANGLE, 5] };
        assert_eq!(triangles.faults(), Faults { out_of_range: 1, first: Some(3), ..Faults::default() });
    }
}
