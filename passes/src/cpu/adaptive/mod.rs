//! Adaptive sampling of stochastic glass: each pixel gets as many paths as the error asked for requires.
//!
//! One path of every pixel is traced first, tile by tile. A pixel whose path made no random choice keeps that colour, to the bit. The other
//! pixels are sampled in rounds until the error is what was asked for, or no pixel may have more paths. Decisions between two rounds depend
//! on sums in the order of the pixels, so the picture is the same for any number of threads.

mod allocation;
#[cfg(test)]
mod tests;

use super::{NAME, Rows, WORKSPACE, Whole, alone, before, check, each_tile, in_host, new_pass};
use crate::effects::dielectric::{Met, Sample};
use crate::effects::{AlphaTested, Area, ByCones, Coverage, Pass, Pixel, Workspace, combined, opaque, refraction};
use crate::trace::{DynTracer, Erased, Tracer};
use allocation::{Sampled, doubled, error, first_count, most_of_half};
use curitiba_pipeline::backend::{BackendError, PathsSpent, RayCounts, RayJob, RayStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::{Refused, with_capacity, zeroed};
use curitiba_pipeline::programs::{Fidelity, RayProgram, TextureLod};
use glam::{DVec3, Vec4};
use rayon::prelude::*;
use std::cell::Cell;
use std::sync::atomic::{AtomicU8, Ordering};

/// Greatest number of ways that a path follows at once from the first surface that divides it. For further ways, the path up to that surface is
/// followed again.
const WAYS: u32 = 4;

/// Number of steps in which the progress towards the error is counted.
const PARTS: u64 = 1000;

/// Pixels that a thread takes at a time.
const PIXELS: usize = 16;

/// The error that a job requests; `None` if it requests none, or if no glass of its scene is stochastic.
pub(super) fn asked(job: &RayJob<'_>) -> Option<f32> {
    let error = job.program.sampled_to(&job.params).filter(|_| job.fidelity == Fidelity::Corrected)?;
    job.program.has_stochastic_glass(&job.params, job.dielectrics).then_some(error)
}

/// Runs a job whose glass is sampled to this error.
///
/// # Errors
/// [`BackendError::Unsupported`] if the job lacks something that its program reads, or if there is not enough memory.
pub(super) fn trace(
    tracer: &dyn DynTracer,
    job: &RayJob<'_>,
    asked: f32,
    output: &mut Image,
    progress: &Progress,
) -> Result<RayStats, BackendError> {
    in_host(job)?;
    check::scene(NAME, job, tracer.knows_spheres())?;
    let tracer = &Erased::<true>::new(tracer);
    let coverage = AlphaTested { scene: job.scene, shades: job.shades };
    match job.texture_lod() {
        TextureLod::Cones => trace_pass(&new_pass(job, tracer, ByCones(coverage), Some(progress))?, asked, output),
        TextureLod::Zero => trace_pass(&new_pass(job, tracer, coverage, Some(progress))?, asked, output),
    }
}

fn trace_pass<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    asked: f32,
    output: &mut Image,
) -> Result<RayStats, BackendError> {
    match pass.job.program {
        RayProgram::Final => {
            let prepare = |area: Area, work: &mut Workspace| combined::bodies::prepare(pass, area, work);
            sample(pass, asked, output, before(prepare), |pixel, sample, work| {
                combined::bodies::sample(pass, pixel, sample, work)
            })
        }
        _ => sample(pass, asked, output, alone, |pixel, sample, work| {
            refraction::corrected::sample(pass, pixel, sample, work)
        }),
    }
}

/// Samples all pixels. `tile` is called for each tile before its pixels. `shown` returns the mean colour of the paths of a sample.
fn sample<T: Tracer, C: Sync>(
    pass: &Pass<'_, T, C>,
    error_asked: f32,
    output: &mut Image,
    tile: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
    shown: impl Fn(Pixel, Sample<'_>, &mut Workspace) -> [f32; 4] + Sync,
) -> Result<RayStats, BackendError> {
    let job = pass.job;
    let asked = f64::from(error_asked);
    let nobody = Progress::default();
    let progress = pass.progress.unwrap_or(&nobody);
    let refused = |refused: Refused| check::missing(NAME, job, &refused.to_string());
    let offset = job.params.first_path;
    let follow = |pixel, half, first, ways, work: &mut Workspace| {
        let met = Cell::new(Met::default());
        let color = shown(pixel, Sample { half, first, ways, offset, met: &met }, work);
        (color, met.get())
    };
    let marks: Vec<u8> = zeroed(output.pixels.len()).map_err(refused)?;
    let marks: Vec<AtomicU8> = marks.into_iter().map(AtomicU8::new).collect();
    let mut rays = each_tile(Whole { output: &mut *output, progress, tiles: 1 }, tile, |pixel, work| {
        let (color, met) = follow(pixel, 0, 0, 1, work);
        marks[pixel.index].store(u8::from(met.stochastic()) | u8::from(met.divided) << 1, Ordering::Relaxed);
        color
    });
    let mut pixels = marked(&marks, output).map_err(refused)?;
    drop(marks);
    let width = output.width;
    // Follows paths until each pixel has `count(place, pixel)` paths in each half; `place` is the pixel's index in `pixels`.
    let sample_to = |pixels: &mut [Sampled], count: &(dyn Fn(usize, &Sampled) -> u32 + Sync)| {
        let each = |(place, pixel): (usize, &mut Sampled)| {
            let count = count(place, pixel);
            if count <= pixel.count || progress.is_cancelled() {
                return RayCounts::default();
            }
            let at = place_of(pixel.index, width);
            WORKSPACE.with_borrow_mut(|work| {
                work.begin();
                fill(pixel, count, |half, first, ways| follow(at, half, first, ways, work));
                work.rays
            })
        };
        let traced = pixels.par_iter_mut().enumerate().with_min_len(PIXELS).with_max_len(PIXELS).map(each);
        traced.reduce(RayCounts::default, |mut sum, rays| {
            sum += rays;
            sum
        })
    };
    let most = most_of_half(job.params.paths);
    let first = first_count(pixels.len(), most);
    rays += sample_to(&mut pixels, &|_, _| first);
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
        let doubled = doubled(&pixels, width, most, reached.bound / asked);
        rays += sample_to(&mut pixels, &|place, pixel| if doubled[place] { 2 * pixel.count } else { 0 });
    };
    for pixel in &pixels {
        output.pixels[pixel.index as usize] = opaque(pixel.color().as_vec3());
    }
    let counts = || pixels.iter().map(Sampled::paths);
    let spent = PathsSpent {
        asked: error_asked,
        error: error(&pixels).estimate,
        met,
        pixels: pixels.len() as u64,
        paths: counts().map(u64::from).sum(),
        most: counts().max().unwrap_or(0),
        exhausted: pixels.iter().filter(|pixel| pixel.count >= most).count() as u64,
    };
    rays.photons += pass.focused.photons.counts;
    Ok(RayStats { rays, adaptive: Some(spent), ..RayStats::default() })
}

/// Follows paths until both halves of a pixel have `count`. `follow(half, first, ways)` returns the mean colour of `ways` paths of a half, from
/// path `first` on, and the stochastic events that the paths met.
fn fill(pixel: &mut Sampled, count: u32, mut follow: impl FnMut(u32, u32, u32) -> ([f32; 4], Met)) {
    for half in [0, 1] {
        // The pass over all pixels follows one path, of the first half only. So the count 1 means no path of the second half; all later counts are
        // even.
        let mut first = if half == 0 { pixel.count } else { pixel.count & !1 };
        while first < count {
            let ways = if pixel.divided { WAYS.min(count - first).min(first.max(1)) } else { 1 };
            let (mean, met) = follow(half, first, ways);
            pixel.divided |= met.divided;
            pixel.sums[half as usize] += color_of(mean) * f64::from(ways);
            first += ways;
        }
    }
    pixel.count = count;
}

fn color_of(color: [f32; 4]) -> DVec3 {
    Vec4::from_array(color).truncate().as_dvec3()
}

/// The pixels whose marks say that they are stochastic, with their first path.
fn marked(marks: &[AtomicU8], output: &Image) -> Result<Vec<Sampled>, Refused> {
    let marks = || marks.iter().map(|mark| mark.load(Ordering::Relaxed)).enumerate().filter(|(_, mark)| *mark != 0);
    let first = |(index, mark): (usize, u8)| {
        let sums = [color_of(output.pixels[index]), DVec3::ZERO];
        Sampled { index: index as u32, divided: mark & 2 != 0, sums, count: 1 }
    };
    let mut pixels = with_capacity(marks().count())?;
    pixels.extend(marks().map(first));
    Ok(pixels)
}

/// The pixel of this index in a picture of this width.
fn place_of(index: u32, width: u32) -> Pixel {
    Pixel { x: index % width, y: index / width, index: index as usize }
}
