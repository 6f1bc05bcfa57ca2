//! Adaptive numbers of samples: pixels whose first samples hardly differ reuse the result of ray passes in later samples.
//!
//! The share of a sample is the pass's output divided by the colour that it reads, or the output itself if it reads no colour. Shares are
//! shadow, occlusion, or the light that glass adds. Textures and the outlines of surfaces are in the colour, which the rasteriser draws
//! for every sample. A pixel is settled if the shares of its first samples are near each other, and near those of its neighbours. In
//! later samples a settled pixel has no triangle, so no backend traces rays for it; its output is the sample's colour times the mean
//! share.

use super::{Renderer, StepKind};
use crate::backend::BackendError;
use crate::gbuffer::NO_TRIANGLE;
use crate::memory::{self, Refused};
use crate::pixel_samples::PixelSamples;
use crate::plan::PlannedPass;
use rayon::prelude::*;

/// A colour channel of at most this is dark: the share of a dark channel is not defined.
const DARK: f32 = 1e-4;

/// Least number of pixels that a thread takes.
const TOGETHER: usize = 4096;

/// The shares of a ray pass's pixels in a frame.
#[derive(Debug)]
pub(super) struct Shares {
    /// Largest difference between the shares of a settled pixel.
    tolerance: f32,
    pixels: Vec<Share>,
    /// Which pixels are settled; none until all first samples are there.
    settled: Vec<bool>,
    /// Triangle ids of a sample, without those of settled pixels.
    triangles: Vec<u32>,
}

/// The shares of a pixel's first samples, by channel: red, green, blue, alpha.
#[derive(Debug, Clone, Copy)]
struct Share {
    least: [f32; 4],
    largest: [f32; 4],
    /// Sums of output and colour over the first samples.
    output: [f32; 4],
    color: [f32; 4],
}

impl Share {
    const NONE: Self =
        Self { least: [f32::INFINITY; 4], largest: [f32::NEG_INFINITY; 4], output: [0.0; 4], color: [0.0; 4] };

    fn add(&mut self, output: [f32; 4], color: [f32; 4]) {
        for channel in 0..4 {
            let (output, color) = (output[channel], color[channel]);
            if color > DARK {
                let share = output / color;
                self.least[channel] = self.least[channel].min(share);
                self.largest[channel] = self.largest[channel].max(share);
            } else if output.abs() > DARK {
                self.largest[channel] = f32::INFINITY;
            }
            self.output[channel] += output;
            self.color[channel] += color;
        }
    }

    /// Whether the samples have shares that differ by at most `tolerance`; true for channels whose colour and output are dark.
    fn is_narrow(&self, tolerance: f32) -> bool {
        (0..4).all(|channel| self.largest[channel] - self.least[channel] <= tolerance)
    }

    /// Whether the gap between the ranges of two pixels' shares is at most `tolerance`, or one of the pixels is dark, in each channel. Where
    /// shares change evenly from pixel to pixel, the gap is a third of the range of each.
    fn is_near(&self, other: &Self, tolerance: f32) -> bool {
        (0..4).all(|channel| {
            let is_dark = |share: &Self| share.least[channel] > share.largest[channel];
            let gap = (self.least[channel] - other.largest[channel]).max(other.least[channel] - self.largest[channel]);
            gap <= tolerance || is_dark(self) || is_dark(other)
        })
    }

    /// The output for the colour of another sample: the colour times the mean share, by channel. A dark colour channel has the mean share
    /// of the other colour channels, or 1 if all three are dark. A dark alpha has the share 1.
    fn output(&self, color: [f32; 4]) -> [f32; 4] {
        let shares: [Option<f32>; 4] = std::array::from_fn(|channel| {
            (self.color[channel] > PixelSamples::FIRST as f32 * DARK)
                .then(|| self.output[channel] / self.color[channel])
        });
        let known = shares[..3].iter().flatten();
        let count = known.clone().count();
        let mean = if count > 0 { known.sum::<f32>() / count as f32 } else { 1.0 };
        let [r, g, b] = [0, 1, 2].map(|channel| color[channel] * shares[channel].unwrap_or(mean));
        [r, g, b, color[3] * shares[3].unwrap_or(1.0)]
    }
}

const _: () = assert!(size_of::<Share>() + size_of::<bool>() + size_of::<u32>() == PixelSamples::SHARE_BYTES as usize);

/// The colour at an index; 1 in each channel if the pass reads no colour.
fn color(colors: &[[f32; 4]], index: usize) -> [f32; 4] {
    colors.get(index).copied().unwrap_or([1.0; 4])
}

impl Shares {
    /// The shares of this number of pixels, before the first sample.
    fn new(pixels: usize, tolerance: f32) -> Result<Self, Refused> {
        Ok(Self {
            tolerance,
            pixels: memory::filled(Share::NONE, pixels)?,
            settled: memory::filled(false, pixels)?,
            triangles: memory::zeroed(pixels)?,
        })
    }

    /// The triangle ids for which a sample is traced: `shown`; after the first samples, without those of settled pixels.
    pub(super) fn traced<'a>(&'a mut self, taken: u32, shown: &'a [u32]) -> &'a [u32] {
        if taken < PixelSamples::FIRST {
            return shown;
        }
        let pixels = self.triangles.par_iter_mut().zip(&self.settled).zip(shown).with_min_len(TOGETHER);
        pixels.for_each(|((traced, settled), shown)| *traced = if *settled { NO_TRIANGLE } else { *shown });
        &self.triangles
    }

    /// Adds the traced output of one of the first samples to the shares. After the last of the first samples, decides which pixels are
    /// settled. In later samples, overwrites the output of settled pixels with [`Share::output`]. `taken` is the number of samples before
    /// this one, and a row has `width` pixels.
    pub(super) fn take(&mut self, output: &mut [[f32; 4]], colors: &[[f32; 4]], width: u32, taken: u32) {
        if taken >= PixelSamples::FIRST {
            let pixels = output.par_iter_mut().zip(&self.pixels).zip(&self.settled).enumerate();
            pixels
                .with_min_len(TOGETHER)
                .filter(|(_, (_, settled))| **settled)
                .for_each(|(index, ((output, share), _))| *output = share.output(color(colors, index)));
            return;
        }
        let pixels = self.pixels.par_iter_mut().zip(&*output).enumerate().with_min_len(TOGETHER);
        pixels.for_each(|(index, (share, output))| share.add(*output, color(colors, index)));
        if taken + 1 == PixelSamples::FIRST {
            self.settle(width as usize);
        }
    }

    fn settle(&mut self, width: usize) {
        let (pixels, tolerance) = (&self.pixels, self.tolerance);
        let height = pixels.len().checked_div(width).unwrap_or(0);
        self.settled.par_iter_mut().enumerate().with_min_len(TOGETHER).for_each(|(index, settled)| {
            let around = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
            let is_near = |row: usize, column: usize| pixels[index].is_near(&pixels[row * width + column], tolerance);
            *settled = pixels[index].is_narrow(tolerance)
                && around(index / width, height)
                    .all(|row| around(index % width, width).all(|column| is_near(row, column)));
        });
    }

    /// Fraction of the pixels that are not settled, 0 to 1.
    fn unsettled(&self) -> f64 {
        let settled = self.settled.iter().filter(|settled| **settled).count();
        1.0 - settled as f64 / self.settled.len().max(1) as f64
    }
}

impl Renderer {
    /// Takes the shares of the ray pass at this index of the plan out of the renderer, or makes empty ones; `None` if the number of samples is not
    /// adaptive. [`Self::keep_shares`] puts them back.
    pub(super) fn shares_of(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        name: &str,
    ) -> Result<Option<Shares>, BackendError> {
        let (target, tolerance) = (self.plan.pass(planned).target, self.samples().tolerance());
        let (Some(target), Some(tolerance)) = (target, tolerance) else { return Ok(None) };
        if let Some(known) = self.shares.remove(&index) {
            return Ok(Some(known));
        }
        Shares::new(self.targets[target].color.len(), tolerance).map(Some).map_err(|refused| {
            let backend = self.engines.rays_of(name).name();
            BackendError::Device { backend, message: refused.to_string() }
        })
    }

    /// Keeps the shares of a pass for its next sample, and notes the fraction of pixels with all samples in the pass's row of the timeline.
    pub(super) fn keep_shares(&mut self, index: usize, name: &str, shares: Shares) {
        let share = shares.unsettled();
        let row = self.timeline.rows.iter_mut().find(|row| row.kind == StepKind::Rays && row.name == name);
        row.into_iter().for_each(|row| {
            row.all_samples = Some(share);
            row.note += &format!("; all samples in {:.1} % of the pixels", 100.0 * share);
        });
        self.shares.insert(index, shares);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: f32 = 0.02;

    /// Four samples of a row of pixels, each an output and a colour.
    fn of(pixels: &[[([f32; 4], [f32; 4]); 4]]) -> Shares {
        let mut shares = Shares::new(pixels.len(), TOLERANCE).expect("memory");
        for taken in 0..4 {
            let mut output: Vec<_> = pixels.iter().map(|samples| samples[taken].0).collect();
            let colors: Vec<_> = pixels.iter().map(|samples| samples[taken].1).collect();
            shares.take(&mut output, &colors, pixels.len() as u32, taken as u32);
        }
        shares
    }

    fn gray(value: f32) -> [f32; 4] {
        [value, value, value, 1.0]
    }

    #[test]
    fn a_texture_under_an_even_shadow_is_settled_and_keeps_its_samples() {
        let pixel = [0.1, 0.9, 0.4, 0.2].map(|color| (gray(0.5 * color), gray(color)));
        let mut shares = of(&[pixel]);
        assert_eq!(shares.unsettled(), 0.0);
        assert_eq!(shares.traced(4, &[7]), [NO_TRIANGLE]);
        assert_eq!(shares.traced(3, &[7]), [7]);
        let mut output = [gray(1.0)];
        shares.take(&mut output, &[gray(0.8)], 1, 4);
        assert_eq!(output, [gray(0.4)]);
    }

    #[test]
    fn an_edge_within_a_pixel_or_beside_it_is_not_settled() {
        let lit = [(gray(1.0), gray(1.0)); 4];
        let dark = [(gray(0.5), gray(1.0)); 4];
        let mut both = lit;
        both[2] = dark[2];
        let settled = |row: &[[([f32; 4], [f32; 4]); 4]]| of(row).settled;
        assert_eq!(settled(&[lit, lit, lit]), [true; 3]);
        assert_eq!(settled(&[lit, lit, dark, dark, dark]), [true, false, false, true, true]);
        assert_eq!(settled(&[lit, both, lit, lit]), [true, false, true, true]);
        // Shares that change evenly, by less than the tolerance within a pixel.
        let ramp = |start: f32| [0.0, 0.25, 0.5, 0.75].map(|part| (gray(0.5 + 0.02 * (start + part)), gray(1.0)));
        assert_eq!(settled(&[ramp(0.0), ramp(1.0), ramp(2.0)]), [true; 3]);
        let mut no_number = lit;
        no_number[1].0[2] = f32::NAN;
        assert_eq!(settled(&[no_number])[..], [true], "a sum that is no number stays none");
        assert!(of(&[no_number]).pixels[0].output(gray(1.0))[2].is_nan());
    }

    #[test]
    fn dark_channels_have_the_share_of_the_others() {
        let red = [([0.3, 0.0, 0.0, 1.0], [0.6, 0.0, 0.0, 1.0]); 4];
        let black = [(gray(0.0), gray(0.0)); 4];
        let shares = of(&[black, red, black]);
        assert_eq!(shares.unsettled(), 0.0);
        assert_eq!(shares.pixels[1].output([0.2, 0.4, 0.0, 1.0]), [0.1, 0.2, 0.0, 1.0]);
        assert_eq!(shares.pixels[0].output(gray(0.3)), gray(0.3));
        // Light that a pass adds to a black colour has no share, so the pixel is not settled.
        assert_eq!(of(&[[(gray(0.2), gray(0.0)); 4]]).unsettled(), 1.0);
    }
}
