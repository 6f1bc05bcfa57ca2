//! An edge-avoiding filter of the noise of occlusions and of soft shadows.
//!
//! Dammertz, Sewtz, Hanika and Lensch, "Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination Filtering", HPG 2010: a
//! level averages 5 x 5 pixels that are `2^level` apart. Their weights are those of the B3 spline, 1/16, 1/4, 3/8, 1/4, 1/16 along
//! each axis, times a measure of how likely two pixels show the same surface. Differences from the paper:
//! - Edges are found in the G-buffer alone, never in the noisy values.
//! - Weights are polynomials that are exactly 0 beyond a bound. Two pixels do not mix if the cosine between their normals is less than
//!   [`LEAST_COSINE`], or if one position is off the other's tangent plane by more than [`MOST_OFF`] of their distance. A bound
//!   relative to the distance does not depend on the scale of the scene or the picture.
//! - Differences from the pixel's own value are averaged, so a constant stays the same to the bit.

#![allow(clippy::needless_range_loop, reason = "a pixel indexes several lists side by side")]

use crate::trace::{Detected, Kernel, Simd};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::memory::{Refused, resize};
use curitiba_pipeline::programs::{FILTER_BYTES, MAX_FILTER_LEVELS};
use rayon::prelude::*;

/// The B3 spline at distances of 0, 1 and 2 pixels.
pub const SPLINE: [f32; 3] = [0.375, 0.25, 0.0625];
/// The cosine of 45 degrees between two normals, at which their weight is 0.
pub const LEAST_COSINE: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Least distance of a position from another position's tangent plane at which their weight is 0, as a part of the distance between the
/// two positions.
pub const MOST_OFF: f32 = 0.2;

/// A share for each pixel, and the surfaces in which edges are found. The memory is kept from picture to picture.
#[derive(Debug, Default)]
pub struct Filter {
    width: usize,
    /// By component: position, then unit normal, which is 0 where there is no surface.
    surfaces: [Vec<f32>; 6],
    shares: Vec<f32>,
    next: Vec<f32>,
}

impl Filter {
    /// Loads the first component of each pixel of `values`. `surface` returns a pixel's position and normal (of any length) by its index.
    ///
    /// # Errors
    /// If there is not enough memory.
    pub fn load(
        &mut self,
        width: u32,
        values: &[[f32; 4]],
        surface: impl Fn(usize) -> [[f32; 3]; 2] + Sync,
    ) -> Result<(), Refused> {
        self.width = width as usize;
        for list in self.surfaces.iter_mut().chain([&mut self.shares, &mut self.next]) {
            resize(list, values.len(), 0.0)?;
        }
        const { assert!(FILTER_BYTES == 8 * size_of::<f32>() as u64, "eight lists") }
        let row = self.width.max(1);
        let [px, py, pz, nx, ny, nz] = self.surfaces.each_mut().map(|list| list.par_chunks_mut(row));
        let rows = (px, py, pz, nx, ny, nz, self.shares.par_chunks_mut(row), values.par_chunks(row));
        rows.into_par_iter().enumerate().for_each(|(down, (px, py, pz, nx, ny, nz, shares, values))| {
            for across in 0..values.len() {
                let [[x, y, z], [a, b, c]] = surface(down * row + across);
                let scale = 1.0 / (a * a + b * b + c * c).sqrt();
                // The normal is neither 0 nor too long nor NaN, and the position is finite.
                let shown = scale > 0.0 && scale.is_finite() && x.is_finite() && y.is_finite() && z.is_finite();
                [px[across], py[across], pz[across]] = if shown { [x, y, z] } else { [0.0; 3] };
                [nx[across], ny[across], nz[across]] = if shown { [a * scale, b * scale, c * scale] } else { [0.0; 3] };
                shares[across] = values[across][0];
            }
        });
        Ok(())
    }

    /// Filters `levels` levels, at most [`MAX_FILTER_LEVELS`], and returns the filtered shares. After a cancellation, rows are
    /// skipped, and the shares are meaningless.
    pub fn run(&mut self, levels: u32, progress: &Progress) -> &[f32] {
        let width = self.width;
        for level in 0..levels.min(MAX_FILTER_LEVELS) {
            if width == 0 {
                break;
            }
            let (surfaces, shares) = (&self.surfaces, &self.shares);
            self.next.par_chunks_mut(width).enumerate().for_each_init(
                || [vec![0.0; width], vec![0.0; width]],
                |sums, (row, output)| {
                    if progress.is_cancelled() {
                        return;
                    }
                    let [sum, weight] = sums;
                    Detected::cached().run(Row { surfaces, shares, row, step: 1 << level, sum, weight, output });
                },
            );
            std::mem::swap(&mut self.shares, &mut self.next);
        }
        &self.shares
    }
}

/// Kernel that filters one row of a level.
struct Row<'a> {
    surfaces: &'a [Vec<f32>; 6],
    shares: &'a [f32],
    row: usize,
    step: usize,
    sum: &'a mut [f32],
    weight: &'a mut [f32],
    output: &'a mut [f32],
}

impl Kernel<()> for Row<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { surfaces, shares, row, step, sum, weight, output } = self;
        let width = output.len();
        let height = shares.len() / width;
        let own = row * width;
        sum.fill(0.0);
        weight.fill(SPLINE[0] * SPLINE[0]);
        for down in 0..5_usize {
            // Rows above the first (`None`) and below the last have no tap.
            let Some(other) = (row + down * step).checked_sub(2 * step).filter(|other| *other < height) else {
                continue;
            };
            for across in 0..5_usize {
                if (down, across) == (2, 2) {
                    continue;
                }
                let spline = SPLINE[down.abs_diff(2)] * SPLINE[across.abs_diff(2)];
                // Columns whose tap is inside the picture.
                let first = (2 * step).saturating_sub(across * step).min(width);
                let last = (width + 2 * step).saturating_sub(across * step).min(width);
                if first >= last {
                    continue;
                }
                let count = last - first;
                let (here, there) = (own + first, other * width + first + across * step - 2 * step);
                let a = surfaces.each_ref().map(|list| &list[here..here + count]);
                let b = surfaces.each_ref().map(|list| &list[there..there + count]);
                let (share, others) = (&shares[here..here + count], &shares[there..there + count]);
                let (sum, weight) = (&mut sum[first..last], &mut weight[first..last]);
                for i in 0..count {
                    let d = [b[0][i] - a[0][i], b[1][i] - a[1][i], b[2][i] - a[2][i]];
                    let cosine = a[3][i] * b[3][i] + a[4][i] * b[4][i] + a[5][i] * b[5][i];
                    let off_a = d[0] * a[3][i] + d[1] * a[4][i] + d[2] * a[5][i];
                    let off_b = d[0] * b[3][i] + d[1] * b[4][i] + d[2] * b[5][i];
                    let (off_a, off_b) = (off_a * off_a, off_b * off_b);
                    let off = if off_a > off_b { off_a } else { off_b };
                    let bound = MOST_OFF * MOST_OFF * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
                    let alike = (cosine - LEAST_COSINE) * (1.0 / (1.0 - LEAST_COSINE));
                    let alike = if alike > 0.0 { alike } else { 0.0 };
                    let alike = alike * alike;
                    let alike = alike * alike;
                    let flat = 1.0 - off / bound;
                    let w = spline * (alike * alike) * (flat * flat);
                    let w = if flat > 0.0 { w } else { 0.0 };
                    sum[i] += w * (others[i] - share[i]);
                    weight[i] += w;
                }
            }
        }
        for i in 0..width {
            output[i] = shares[own + i] + sum[i] / weight[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::{pcg4d, unit};

    const SIDE: u32 = 64;

    fn noise(index: u32) -> f32 {
        unit(pcg4d([index, 7, 0, 0])[0])
    }

    /// A picture of a wall in the left half and another surface in the right half, offset by `behind` in z and rotated by the angle `turned`.
    fn walls(behind: f32, turned: f32) -> [Vec<[f32; 4]>; 2] {
        let pixels = 0..SIDE * SIDE;
        let left = |index: u32| index % SIDE < SIDE / 2;
        let position = |index: u32| {
            let (x, y) = ((index % SIDE) as f32, (index / SIDE) as f32);
            let z = if left(index) { 0.0 } else { behind + (x - (SIDE / 2) as f32 + 0.5) * turned.tan() };
            [x, y, z, 1.0]
        };
        let normal =
            |index: u32| if left(index) { [0.0, 0.0, 1.0, 0.0] } else { [-turned.sin(), 0.0, turned.cos(), 0.0] };
        [pixels.clone().map(position).collect(), pixels.map(normal).collect()]
    }

    fn first_three(pixel: [f32; 4]) -> [f32; 3] {
        [pixel[0], pixel[1], pixel[2]]
    }

    fn filtered(values: &[[f32; 4]], scene: &[Vec<[f32; 4]>; 2], levels: u32) -> Vec<f32> {
        let mut filter = Filter::default();
        let surface = |index: usize| scene.each_ref().map(|list| first_three(list[index]));
        filter.load(SIDE, values, surface).expect("host memory");
        filter.run(levels, &Progress::default()).to_vec()
    }

    #[test]
    fn a_constant_stays_the_same_to_the_bit() {
        for value in [0.1f32, 1.0, 1.0 / 3.0] {
            let values = vec![[value; 4]; (SIDE * SIDE) as usize];
            for levels in 0..=MAX_FILTER_LEVELS {
                for scene in [walls(0.0, 0.0), walls(3.0, 0.4), walls(0.5, 1.2)] {
                    assert!(filtered(&values, &scene, levels).iter().all(|found| *found == value));
                }
            }
        }
    }

    #[test]
    fn nothing_mixes_across_a_step_or_a_fold() {
        let dark = |index: u32| if index % SIDE < SIDE / 2 { 0.0 } else { 1.0 };
        let values: Vec<[f32; 4]> = (0..SIDE * SIDE).map(|index| [dark(index); 4]).collect();
        let kept = |scene: &[Vec<[f32; 4]>; 2]| {
            let found = filtered(&values, scene, 3);
            (0..SIDE * SIDE).zip(&found).all(|(index, found)| *found == dark(index))
        };
        assert!(kept(&walls(20.0, 0.0)) && kept(&walls(-20.0, 0.0)), "a step");
        assert!(kept(&walls(0.0, 0.8)) && kept(&walls(0.0, 1.4)), "a fold of more than 45 degrees");
        // The control: in one plane the filter mixes the two halves.
        assert!(!kept(&walls(0.0, 0.0)));
    }

    #[test]
    fn variance_falls_by_the_sum_of_the_squared_weights_and_the_mean_stays() {
        let values: Vec<[f32; 4]> = (0..SIDE * SIDE).map(|index| [noise(index); 4]).collect();
        let inner = |index: &u32| [index % SIDE, index / SIDE].iter().all(|at| (16..SIDE - 16).contains(at));
        let moments = |found: &[f32]| {
            let inside: Vec<f64> =
                (0..SIDE * SIDE).filter(inner).map(|index| f64::from(found[index as usize])).collect();
            let mean = inside.iter().sum::<f64>() / inside.len() as f64;
            let square = inside.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / inside.len() as f64;
            (mean, square)
        };
        // One level is a product of two splines: its squared weights sum to the square of (2 / 16² + 2 / 4² + 9 / 8²).
        let along: f64 = 2.0 / 256.0 + 2.0 / 16.0 + 9.0 / 64.0;
        let (mean, variance) = moments(&filtered(&values, &walls(0.0, 0.0), 0));
        let (after, less) = moments(&filtered(&values, &walls(0.0, 0.0), 1));
        println!("{mean} {after} {} {}", less / variance, along * along);
        assert!((less / variance / (along * along) - 1.0).abs() < 0.15);
        assert!((after - mean).abs() < 5e-3);
        // Two levels are the convolution of one spline with another whose taps are two pixels apart.
        let mut two = [0.0f64; 13];
        let taps = [1.0 / 16.0, 0.25, 0.375, 0.25, 1.0 / 16.0];
        (0..5).for_each(|a| (0..5).for_each(|b| two[a + 2 * b] += taps[a] * taps[b]));
        let along: f64 = two.iter().map(|weight| weight * weight).sum();
        let (_, less) = moments(&filtered(&values, &walls(0.0, 0.0), 2));
        println!("{} {}", less / variance, along * along);
        assert!((less / variance / (along * along) - 1.0).abs() < 0.3);
        // Over the whole picture, only the borders change the mean.
        let mean = |values: &[f32]| values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len() as f64;
        let [before, after] = [0, 2].map(|levels| mean(&filtered(&values, &walls(0.0, 0.0), levels)));
        assert!((before - after).abs() < 1e-3, "{before} {after}");
    }

    #[test]
    fn a_ramp_in_a_plane_keeps_its_slope_and_pixels_without_a_surface_are_left_alone() {
        let ramp = |index: u32| 0.2 + 0.01 * (index % SIDE) as f32;
        let values: Vec<[f32; 4]> = (0..SIDE * SIDE).map(|index| [ramp(index); 4]).collect();
        let found = filtered(&values, &walls(0.0, 0.0), 2);
        let inner = (0..SIDE * SIDE).filter(|index| (8..SIDE - 8).contains(&(index % SIDE)));
        assert!(inner.into_iter().all(|index| (found[index as usize] - ramp(index)).abs() < 1e-5));
        let mut scene = walls(0.0, 0.0);
        scene[1][77] = [0.0; 4];
        scene[0][99] = [f32::NAN; 4];
        let mut noisy = values.clone();
        (noisy[77], noisy[99]) = ([0.9; 4], [0.8; 4]);
        let found = filtered(&noisy, &scene, 3);
        assert!(found[77] == 0.9 && found[99] == 0.8 && found.iter().all(|value| value.is_finite()));
        assert!((found[78] - ramp(78)).abs() < 0.05, "they reach no neighbour");
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits_for_pictures_of_any_width() {
        for width in [1usize, 3, 17, 64] {
            let values: Vec<[f32; 4]> = (0..width as u32 * 9).map(|index| [noise(index); 4]).collect();
            let place = |index: usize| [(index % width) as f32, (index / width) as f32, 0.1 * noise(index as u32), 1.0];
            let position: Vec<[f32; 4]> = (0..values.len()).map(place).collect();
            let normal = vec![[0.0, 0.1, 1.0, 0.0]; values.len()];
            let mut filter = Filter::default();
            let surface = |index: usize| [first_three(position[index]), first_three(normal[index])];
            filter.load(width as u32, &values, surface).expect("host memory");
            let mut level = |set| {
                let simd = Detected::new(set)?;
                let (surfaces, shares) = (&filter.surfaces, &filter.shares);
                let rows = filter.next.chunks_mut(width).enumerate().flat_map(|(row, output)| {
                    let [mut sum, mut weight] = [vec![0.0; width], vec![0.0; width]];
                    let (sum, weight) = (&mut sum, &mut weight);
                    simd.run(Row { surfaces, shares, row, step: 2, sum, weight, output });
                    output.iter().map(|value| value.to_bits()).collect::<Vec<u32>>()
                });
                Some(rows.collect::<Vec<u32>>())
            };
            use crate::trace::InstructionSet::{Avx2, Avx512, Portable};
            let plain = level(Portable).expect("every processor has it");
            assert!([Avx2, Avx512].into_iter().filter_map(&mut level).all(|found| found == plain));
        }
    }
}
