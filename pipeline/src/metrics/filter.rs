//! Separable filters over bands of rows. Memory depends on the width but not on the height of a picture, and the result does not
//! depend on the number of threads.

use rayon::prelude::*;
use std::ops::Range;

/// Number of rows that a band writes. A band also reads the rows within the radius of its filters.
const ROWS: usize = 64;

/// The results of `band` for the row ranges of a picture's bands, from top to bottom. The bands are computed in parallel.
pub fn bands<T: Send>(height: usize, band: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    (0..height.div_ceil(ROWS))
        .into_par_iter()
        .map(|index| band(index * ROWS..((index + 1) * ROWS).min(height)))
        .collect()
}

/// The taps of a filter, an odd number.
#[derive(Debug, Clone)]
pub struct Kernel(Vec<f64>);

impl Kernel {
    /// The taps `weight(x)` for `x` from `-radius` to `radius`.
    pub fn new(radius: usize, weight: impl Fn(f64) -> f64) -> Self {
        let radius = radius as i64;
        Self((-radius..=radius).map(|x| weight(x as f64)).collect())
    }

    /// Number of taps on each side of the centre.
    pub fn radius(&self) -> usize {
        self.0.len() / 2
    }

    /// Sum of the taps.
    pub fn sum(&self) -> f64 {
        self.0.iter().sum()
    }

    /// Scaled to a sum of 1.
    pub fn normalised(self) -> Self {
        let sum = self.sum();
        Self(self.0.into_iter().map(|tap| tap / sum).collect())
    }

    /// Positive taps scaled to a sum of 1, negative ones to -1.
    pub fn balanced(self) -> Self {
        let positive: f64 = self.0.iter().filter(|tap| **tap > 0.0).sum();
        let negative: f64 = -self.0.iter().filter(|tap| **tap < 0.0).sum::<f64>();
        let scale = |tap: f64| match tap {
            tap if tap > 0.0 => tap / positive,
            tap if tap < 0.0 => tap / negative,
            _ => 0.0,
        };
        Self(self.0.into_iter().map(scale).collect())
    }

    /// All taps times `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        Self(self.0.into_iter().map(|tap| tap * factor).collect())
    }
}

/// Values of one quantity over some rows of a picture; `first` is the picture's row of the first values.
pub struct Plane {
    width: usize,
    first: i64,
    values: Vec<f64>,
}

impl Plane {
    /// Planes of N quantities over the given rows of a picture, and over `halo` more rows above and below. `values` computes all
    /// quantities of a pixel from its index. Rows outside the picture repeat the nearest row inside.
    pub fn stack<const N: usize>(
        width: usize,
        height: usize,
        rows: &Range<usize>,
        halo: usize,
        values: impl Fn(usize) -> [f64; N],
    ) -> [Self; N] {
        let first = rows.start as i64 - halo as i64;
        let last = rows.end as i64 + halo as i64;
        let size = width * (last - first) as usize;
        let mut planes: [Self; N] = std::array::from_fn(|_| Self { width, first, values: Vec::with_capacity(size) });
        for y in first..last {
            let start = y.clamp(0, height as i64 - 1) as usize * width;
            for index in start..start + width {
                for (plane, value) in planes.iter_mut().zip(values(index)) {
                    plane.values.push(value);
                }
            }
        }
        planes
    }

    /// Applies `of` to each value.
    pub fn map(&self, of: impl Fn(f64) -> f64) -> Self {
        Self { values: self.values.iter().map(|value| of(*value)).collect(), ..*self }
    }

    /// Filters along the rows; values beyond the sides repeat the outermost.
    pub fn along_rows(&self, kernel: &Kernel) -> Self {
        let radius = kernel.radius();
        let mut padded = vec![0.0; self.width + 2 * radius];
        let mut values = vec![0.0; self.values.len()];
        for (row, out) in self.values.chunks_exact(self.width).zip(values.chunks_exact_mut(self.width)) {
            padded[..radius].fill(row[0]);
            padded[radius..radius + self.width].copy_from_slice(row);
            padded[radius + self.width..].fill(row[self.width - 1]);
            // Tap by tap, so that the inner loop runs over neighbours in memory.
            for (offset, tap) in kernel.0.iter().enumerate() {
                accumulate(out, &padded[offset..offset + self.width], *tap);
            }
        }
        Self { values, ..*self }
    }

    /// Filters down the columns at row `y` of the picture and adds the result to `out`. The plane must hold [`Kernel::radius`] rows above
    /// and below `y`.
    pub fn down_columns(&self, y: usize, kernel: &Kernel, out: &mut [f64]) {
        let top = (y as i64 - self.first) as usize - kernel.radius();
        for (offset, tap) in kernel.0.iter().enumerate() {
            let start = (top + offset) * self.width;
            accumulate(out, &self.values[start..start + self.width], *tap);
        }
    }
}

fn accumulate(out: &mut [f64], values: &[f64], tap: f64) {
    for (out, value) in out.iter_mut().zip(values) {
        *out += tap * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_separable_filter_is_the_sum_over_its_window_with_repeated_edges() {
        let (width, height) = (7_usize, 140_usize);
        let value = |x: usize, y: usize| ((x * 31 + y * 17) % 23) as f64;
        let across = Kernel::new(2, |x| 1.0 + x * 0.25);
        let down = Kernel::new(3, |y| 2.0 - y * 0.125);
        let filtered: Vec<Vec<f64>> = bands(height, |rows| {
            let [plane] = Plane::stack(width, height, &rows, 3, |index| [value(index % width, index / width)]);
            let plane = plane.along_rows(&across);
            let mut out = Vec::new();
            for y in rows {
                let mut row = vec![0.0; width];
                plane.down_columns(y, &down, &mut row);
                out.extend(row);
            }
            out
        });
        let filtered: Vec<f64> = filtered.into_iter().flatten().collect();
        for y in 0..height {
            for x in 0..width {
                let mut sum = 0.0;
                for dy in -3..=3_i64 {
                    for dx in -2..=2_i64 {
                        let at = |v: usize, d: i64, side: usize| (v as i64 + d).clamp(0, side as i64 - 1) as usize;
                        let weight = (1.0 + dx as f64 * 0.25) * (2.0 - dy as f64 * 0.125);
                        sum += weight * value(at(x, dx, width), at(y, dy, height));
                    }
                }
                assert!((filtered[y * width + x] - sum).abs() < 1e-9, "at {x}, {y}");
            }
        }
    }

    #[test]
    fn balanced_taps_answer_to_a_step_by_one_and_to_a_constant_by_nothing() {
        let kernel = Kernel::new(4, |x| x * (-x * x / 4.0).exp()).balanced();
        assert!(kernel.sum().abs() < 1e-12);
        assert!((kernel.0.iter().filter(|tap| **tap > 0.0).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!((Kernel::new(3, |x| (-x * x).exp()).normalised().sum() - 1.0).abs() < 1e-12);
    }
}
