//! A reference renderer: whole pictures from the camera, in `f64`, with many samples in a pixel.
//!
//! It computes what the passes of a project *mean*, as a reference for rendered pictures. It shares as little as
//! possible with the renderer: no G-buffer, no kernel, no tracer in `f32`, no texture filter, no sampler. It shares the
//! loaded scene, the materials as passes see them, the constants, and the tables that decode sRGB. It is written to be
//! right, not fast.
//!
//! * Each sample is a ray through a place of the pixel. Its hit is found in `f64`; positions, normals, texture
//!   coordinates and colours are interpolated between the corners.
//! * Textures are read at level 0, bilinear: the samples of the pixel are the filter.
//! * The pixel is the mean over its square.
//! * The samples form two estimates of half of them each, with independent random numbers. So half the root mean square
//!   difference of the two is the standard error of their mean. A pixel's random numbers depend only on its place.
//! * Occlusion takes 16 directions for a sample (fewer behind glass with a small weight); its sequence continues from
//!   sample to sample.
//!
//! | program | here |
//! |---|---|
//! | `deferredShadows`, `reflection`, `refraction`, `ssao`, `final`, `dummy` | as in corrected fidelity |
//! | `glass=auto` | as in `docs/glass.md`, on all paths, without the limits that trade light for time |
//! | samples of `glass=auto` | four facets of the first rough surface, and eight wavelengths |
//! | exact spheres | intersected directly |
//! | soft shadows | four directions to the disc of a light for a sample; its sequence continues from sample to sample |
//! | rays from the camera, light that exact spheres focus or photons bring (`shadow=caustic`) | [not known](Traced::unsupported) |
//!
//! May use: `trace` (the tree in `f64`, [`Double`](crate::trace::Double), alone).

mod bodies;
mod camera;
mod disc;
mod facets;
mod glass;
mod job;
mod light;
mod lights;
mod media;
mod optics;
mod points;
mod programs;
mod spectrum;
mod spheres;
mod straight;
mod texture;
mod world;

#[cfg(test)]
mod tests;

pub use camera::Camera;
pub use job::{Job, Look, Seen, Traced, Value};

use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::{self, Refused};
use curitiba_pipeline::progress::Progress;
use glam::{DVec2, DVec4};
use points::{Points, Purpose, mix};
use programs::Sample;
use rayon::prelude::*;
use world::World;

/// Why no picture was rendered.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// There is not enough memory for the trees or the pictures.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// Rendering was cancelled through [`Progress::is_cancelled`].
    #[error("cancelled")]
    Cancelled,
}

/// Renders two independent estimates of a picture; the picture is their mean. Each has as many samples per pixel as the
/// job's range. Consecutive ranges continue the same sequences.
///
/// # Errors
/// If there is not enough memory, or rendering was cancelled.
///
/// # Panics
/// If the range of samples is empty, or a slice of a ray pass's [`Look`] is shorter than the scene's materials.
pub fn render(job: &Job<'_>, progress: &Progress) -> Result<[Image; 2], ReferenceError> {
    assert!(!job.samples.is_empty(), "no samples");
    let [width, height] = job.size;
    let world = World::new(job.seen.scene, &looked_at(job))?;
    let count = width as usize * height as usize;
    let mut halves = [memory::filled([0.0_f32; 4], count)?, memory::filled([0.0_f32; 4], count)?];
    progress.start(u64::from(height));
    let [first, second] = &mut halves;
    let row_length = (width as usize).max(1);
    let rows = first.par_chunks_mut(row_length).zip(second.par_chunks_mut(row_length)).enumerate();
    rows.with_max_len(1).for_each(|(y, (first, second))| {
        if progress.is_cancelled() {
            return;
        }
        for (half, row) in [first, second].into_iter().enumerate() {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = mean(job, &world, [x as u32, y as u32], half as u64).as_vec4().to_array();
            }
        }
        progress.advance(1);
    });
    if progress.is_cancelled() {
        return Err(ReferenceError::Cancelled);
    }
    Ok(halves.map(|pixels| Image { width, height, pixels }))
}

/// The mean of a pixel's samples, for one estimate.
fn mean(job: &Job<'_>, world: &World<'_>, [x, y]: [u32; 2], half: u64) -> DVec4 {
    let key = mix(mix(u64::from(x) << 32 | u64::from(y)) ^ half);
    let places = Points::new(key, Purpose::Pixel);
    let size = DVec2::new(job.size[0].into(), job.size[1].into());
    let corner = DVec2::new(x.into(), y.into());
    let samples = job.samples.clone();
    let count = f64::from(samples.end - samples.start);
    let sum: DVec4 = samples
        .map(|index| {
            let place = (corner + places.at(index)) / size;
            Sample::new(world, job, place, (key, index)).value(job, &job.value)
        })
        .sum();
    sum / count
}

/// Marks the materials whose hits must be judged one by one: alpha-tested ones, those that light passes, and those
/// whose back faces are culled.
fn looked_at(job: &Job<'_>) -> Vec<bool> {
    fn looks<'v, 'a>(value: &'v Value<'a>, found: &mut Vec<&'v Look<'a>>) {
        match value {
            Value::Constant(_) | Value::Drawn => {}
            Value::Traced(pass, color) => {
                found.push(&pass.look);
                looks(color, found);
            }
            Value::Product(color, factor) => {
                looks(color, found);
                looks(factor, found);
            }
            Value::Held(_, value) => looks(value, found),
        }
    }
    let mut found = vec![&job.seen.look];
    looks(&job.value, &mut found);
    let of = |material: usize| {
        job.seen.culled.get(material).is_some_and(|culled| *culled)
            || found.iter().any(|look| {
                look.shades[material].is_cut() || look.shadow_glass.get(material).is_some_and(|glass| *glass)
            })
    };
    (0..job.seen.scene.materials.len().max(job.seen.look.shades.len())).map(of).collect()
}
