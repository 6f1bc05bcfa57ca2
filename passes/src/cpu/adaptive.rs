//! Adaptive sampling of stochastic glass on the processor: the pixels are sampled in parallel, each by one thread.

#[cfg(test)]
mod tests;

use super::{NAME, Rows, Whole, alone, before, check, each_tile, in_host, new_pass, with_workspace};
use crate::adaptive::{FollowPaths, Sampled, each_path, stochastic};
use crate::effects::dielectric::{Met, Sample};
use crate::effects::{AlphaTested, Area, ByCones, Coverage, Pass, Pixel, Workspace, combined, refraction};
use crate::trace::{DynTracer, Erased, Tracer};
use curitiba_pipeline::backend::{BackendError, RayCounts, RayJob, RayStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::{Refused, zeroed};
use curitiba_pipeline::programs::{RayProgram, TextureLod};
use rayon::prelude::*;
use std::cell::Cell;
use std::sync::atomic::{AtomicU8, Ordering};

/// Pixels that a thread takes at a time.
const PIXELS: usize = 16;

/// Runs a job whose glass is sampled to the error `asked`.
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
    asked: f32,
    output: &mut Image,
    tile: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
    shown: impl Fn(Pixel, Sample<'_>, &mut Workspace) -> [f32; 4] + Sync,
) -> Result<RayStats, BackendError> {
    let job = pass.job;
    let nobody = Progress::default();
    let progress = pass.progress.unwrap_or(&nobody);
    let follow = |pixel, half, first, ways, work: &mut Workspace| {
        let met = Cell::new(Met::default());
        let color = shown(pixel, Sample { half, first, ways, offset: job.params.first_path, met: &met }, work);
        (color, met.get())
    };
    let mut paths = Paths { job, progress, tile, follow, rays: RayCounts::default() };
    let spent = crate::adaptive::sample(&mut paths, (asked, job.params.paths), output, progress)?;
    let mut rays = paths.rays;
    rays.photons += pass.focused.photons.counts;
    Ok(RayStats { rays, adaptive: Some(spent), ..RayStats::default() })
}

/// The paths of a pass. `follow` takes a pixel, a half, the number of the first way and the number of ways. It returns the mean colour of
/// these ways, and the stochastic events that they met.
struct Paths<'p, 'a, P, F> {
    job: &'p RayJob<'a>,
    progress: &'p Progress,
    tile: P,
    follow: F,
    rays: RayCounts,
}

impl<P, F> FollowPaths for Paths<'_, '_, P, F>
where
    P: Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
    F: Fn(Pixel, u32, u32, u32, &mut Workspace) -> ([f32; 4], Met) + Sync,
{
    fn first(&mut self, output: &mut Image) -> Result<Vec<Sampled>, BackendError> {
        let refused = |refused: Refused| check::missing(NAME, self.job, &refused.to_string());
        let marks: Vec<u8> = zeroed(output.pixels.len()).map_err(refused)?;
        let marks: Vec<AtomicU8> = marks.into_iter().map(AtomicU8::new).collect();
        let whole = Whole { output: &mut *output, progress: self.progress, tiles: 1 };
        self.rays += each_tile(whole, &self.tile, |pixel, work| {
            let (color, met) = (self.follow)(pixel, 0, 0, 1, work);
            marks[pixel.index].store(met.bits(), Ordering::Relaxed);
            color
        });
        stochastic(output, |index| Met::of_bits(marks[index].load(Ordering::Relaxed))).map_err(refused)
    }

    fn extend(
        &mut self,
        pixels: &mut [Sampled],
        count: &(dyn Fn(usize, &Sampled) -> u32 + Sync),
        progress: &Progress,
    ) -> Result<(), BackendError> {
        let each = |(place, pixel): (usize, &mut Sampled)| {
            let count = count(place, pixel);
            if count <= pixel.count || progress.is_cancelled() {
                return RayCounts::default();
            }
            let (at, width) = (pixel.index, self.job.width);
            let at = Pixel { x: at % width, y: at / width, index: at as usize };
            with_workspace(|work| {
                work.begin();
                each_path(pixel, count, |pixel, half, first, ways| {
                    let (color, met) = (self.follow)(at, half, first, ways, work);
                    pixel.add(half, color, ways, met);
                });
                work.rays
            })
        };
        let traced = pixels.par_iter_mut().enumerate().with_min_len(PIXELS).with_max_len(PIXELS).map(each);
        let rays = traced.reduce(RayCounts::default, |mut sum, rays| {
            sum += rays;
            sum
        });
        self.rays += rays;
        Ok(())
    }
}
