//! The rounds in which pixels are sampled.
//!
//! One path of every pixel is followed first. A pixel whose path made no random choice keeps that colour, to the bit. The other pixels are
//! sampled in rounds until the error is what was asked for, or no pixel may have more paths. Decisions between two rounds depend on sums in
//! the order of the pixels, so the picture is the same for any number of threads.

use super::allocation::{Sampled, doubled, error, first_count, most_of_half};
use crate::effects::dielectric::Met;
use curitiba_pipeline::backend::{BackendError, PathsSpent, RayJob};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::{Refused, with_capacity};
use curitiba_pipeline::programs::Fidelity;
use glam::{DVec3, Vec4};

/// Greatest number of ways that a path follows at once from the first surface that divides it. For further ways, the path up to that surface is
/// followed again.
pub(super) const WAYS: u32 = 4;

/// Number of steps in which the progress towards the error is counted.
const PARTS: u64 = 1000;

/// The error that a job requests; `None` if it requests none, or if no glass of its scene is stochastic.
#[must_use]
pub fn asked(job: &RayJob<'_>) -> Option<f32> {
    let error = job.program.sampled_to(&job.params).filter(|_| job.fidelity == Fidelity::Corrected)?;
    job.program.has_stochastic_glass(&job.params, job.dielectrics).then_some(error)
}

/// A backend that follows paths of pixels.
pub trait FollowPaths {
    /// Follows path 0 of the first half of every pixel, and writes its colour. Returns the pixels whose paths met stochastic events, in
    /// ascending order ([`stochastic`]).
    ///
    /// # Errors
    /// If the backend fails, or if there is not enough memory.
    fn first(&mut self, output: &mut Image) -> Result<Vec<Sampled>, BackendError>;

    /// Follows further paths until each pixel has `count(place, pixel)` paths in each half; `place` is the pixel's index in `pixels`. A pixel
    /// that has as many is left alone.
    ///
    /// # Errors
    /// If the backend fails, or if there is not enough memory.
    fn extend(
        &mut self,
        pixels: &mut [Sampled],
        count: &(dyn Fn(usize, &Sampled) -> u32 + Sync),
        progress: &Progress,
    ) -> Result<(), BackendError>;
}

/// Samples all pixels to the error `error_asked`, and returns what was spent. A pixel has at most `most_paths` paths, or 4 if that is less.
///
/// # Errors
/// Those of `backend`.
pub fn sample(
    backend: &mut dyn FollowPaths,
    (error_asked, most_paths): (f32, u32),
    output: &mut Image,
    progress: &Progress,
) -> Result<PathsSpent, BackendError> {
    let asked = f64::from(error_asked);
    let mut pixels = backend.first(output)?;
    let most = most_of_half(most_paths);
    let first = first_count(pixels.len(), most);
    backend.extend(&mut pixels, &|_, _| first, progress)?;
    progress.start(PARTS);
    let mut shown_parts = 0;
    let met = loop {
        let reached = error(&pixels);
        let parts = (PARTS as f64 * (asked / reached.bound).powi(2).min(1.0)) as u64;
        progress.advance(parts.saturating_sub(shown_parts));
        shown_parts = shown_parts.max(parts);
        let full = pixels.iter().all(|pixel| pixel.count >= most);
        if reached.bound <= asked || full || progress.is_cancelled() {
            break reached.bound <= asked;
        }
        let doubled = doubled(&pixels, output.width, most, reached.bound / asked);
        backend.extend(&mut pixels, &|place, pixel| if doubled[place] { 2 * pixel.count } else { 0 }, progress)?;
    };
    for pixel in &pixels {
        output.pixels[pixel.index as usize] = pixel.color().as_vec3().extend(1.0).to_array();
    }
    let counts = || pixels.iter().map(Sampled::paths);
    Ok(PathsSpent {
        asked: error_asked,
        error: error(&pixels).estimate,
        met,
        pixels: pixels.len() as u64,
        paths: counts().map(u64::from).sum(),
        most: counts().max().unwrap_or(0),
        exhausted: pixels.iter().filter(|pixel| pixel.count >= most).count() as u64,
    })
}

/// The pixels whose paths met stochastic events, with their first path. `met` returns the events of each pixel.
///
/// # Errors
/// If there is not enough memory.
pub fn stochastic(output: &Image, met: impl Fn(usize) -> Met) -> Result<Vec<Sampled>, Refused> {
    let found = || (0..output.pixels.len()).filter(|index| met(*index).stochastic());
    let first = |index: usize| {
        let sums = [color_of(output.pixels[index]), DVec3::ZERO];
        Sampled { index: index as u32, divided: met(index).divided, sums, count: 1 }
    };
    let mut pixels = with_capacity(found().count())?;
    pixels.extend(found().map(first));
    Ok(pixels)
}

/// Calls `visit` with paths of a pixel until each half has `count` paths: with the half, the number of the first way, and the number of
/// ways, which are followed together. A pixel whose halves have `count` paths or more is left alone.
pub fn each_path(pixel: &mut Sampled, count: u32, mut visit: impl FnMut(&mut Sampled, u32, u32, u32)) {
    if count <= pixel.count {
        return;
    }
    for half in [0, 1] {
        // The pass over all pixels follows one path, of the first half only. So the count 1 means no path of the second half; all later counts are
        // even.
        let mut first = if half == 0 { pixel.count } else { pixel.count & !1 };
        while first < count {
            let ways = if pixel.divided { WAYS.min(count - first).min(first.max(1)) } else { 1 };
            visit(pixel, half, first, ways);
            first += ways;
        }
    }
    pixel.count = count;
}

impl Sampled {
    /// Adds the mean colour of some ways of a half, and what their path met.
    pub fn add(&mut self, half: u32, color: [f32; 4], ways: u32, met: Met) {
        self.divided |= met.divided;
        self.sums[half as usize] += color_of(color) * f64::from(ways);
    }
}

fn color_of(color: [f32; 4]) -> DVec3 {
    Vec4::from_array(color).truncate().as_dvec3()
}
