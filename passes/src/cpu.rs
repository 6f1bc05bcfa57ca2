//! Ray programs on the processor: tiles of pixels over rayon's global pool.

pub mod check;

use crate::effects::{
    AlphaTested, Area, Coverage, Opaque, Pass, Pixel, TILE, Workspace, combined, deferred_shadows, open_shares,
    reflection, refraction, ssao,
};
use crate::sampling::{HemisphereSampler, square_root};
use crate::trace::{Bvh, Quality, Tracer};
use curitiba_pipeline::backend::{BackendError, BuildStats, RayBackend, RayCounts, RayJob, RayStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RayProgram};
use curitiba_pipeline::scene::{Geometry, RenderScene, TriangleRanges};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

const NAME: &str = "cpu";

/// The most that building the structure takes, as [`Bvh`] documents it.
const BYTES_PER_TRIANGLE: u64 = 270;

/// The ray backend of the processor. Results do not depend on the number of threads.
#[derive(Default)]
pub struct CpuRays {
    built: Option<(Arc<RenderScene>, Bvh)>,
}

impl CpuRays {
    /// A backend with nothing built.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}

impl RayBackend for CpuRays {
    fn name(&self) -> &'static str {
        NAME
    }

    fn device(&self) -> String {
        let threads = rayon::current_num_threads();
        format!("{threads} thread{}", if threads == 1 { "" } else { "s" })
    }

    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        // The old structure is released first: two would not always fit.
        self.built = None;
        let bvh = Bvh::build(&scene.geometry, filtered, Quality::default());
        let stats = BuildStats { bytes: bvh.bytes() as u64, nodes: bvh.node_count() as u64 };
        self.built = Some((Arc::clone(scene), bvh));
        Ok(stats)
    }

    fn bytes_per_triangle(&self) -> u64 {
        BYTES_PER_TRIANGLE
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        if job.program == RayProgram::Dummy {
            in_host(job)?;
            check::images(NAME, job, output)?;
            output.pixels.copy_from_slice(job.color);
            return Ok(RayStats::default());
        }
        match &self.built {
            Some((scene, bvh)) if std::ptr::eq(&raw const **scene, job.scene) => trace(bvh, job, output, progress),
            _ if !may_trace(job) => trace(&empty(), job, output, progress),
            _ => Err(check::missing(NAME, job, "its scene's acceleration structure was not built")),
        }
    }
}

fn empty() -> Bvh {
    Bvh::build(&Geometry::default(), &[], Quality::default())
}

fn in_host(job: &RayJob<'_>) -> Result<(), BackendError> {
    match job.shared {
        None => Ok(()),
        Some(_) => Err(check::missing(NAME, job, "its G-buffer is not in host memory")),
    }
}

/// Whether a job can trace any ray: where it cannot, the executor builds no structure.
#[must_use]
pub fn may_trace(job: &RayJob<'_>) -> bool {
    let needs_glass = matches!(job.program, RayProgram::Reflection | RayProgram::Refraction);
    let finds_glass = job.fidelity == Fidelity::Thesis || job.glass.contains(&true);
    job.program.can_trace(&job.params) && (!needs_glass || finds_glass)
}

/// Runs a program other than `dummy` on any tracer of the job's scene.
///
/// # Errors
/// [`BackendError::Unsupported`] if the job lacks what the program reads; says what.
pub fn trace<T: Tracer>(
    tracer: &T,
    job: &RayJob<'_>,
    output: &mut Image,
    progress: &Progress,
) -> Result<RayStats, BackendError> {
    check::images(NAME, job, output)?;
    let rays = run(tracer, job, Whole { output, progress })?;
    Ok(RayStats { rays, ..RayStats::default() })
}

/// What a program other than `dummy` writes at one pixel, which lies inside the job's images.
///
/// # Errors
/// As [`trace`].
pub fn trace_pixel<T: Tracer>(tracer: &T, job: &RayJob<'_>, x: u32, y: u32) -> Result<[f32; 4], BackendError> {
    check::buffers(NAME, job)?;
    run(tracer, job, One(Pixel { x, y, index: y as usize * job.width as usize + x as usize }))
}

fn run<T: Tracer, R: Runner>(tracer: &T, job: &RayJob<'_>, runner: R) -> Result<R::Output, BackendError> {
    in_host(job)?;
    check::scene(NAME, job)?;
    let cut = job.fidelity == Fidelity::Corrected && job.shades.iter().any(|shade| shade.alpha_cutoff.is_some());
    Ok(if cut {
        let coverage = AlphaTested { scene: job.scene, shades: job.shades };
        run_program(&new_pass(job, tracer, coverage)?, runner)
    } else {
        run_program(&new_pass(job, tracer, Opaque)?, runner)
    })
}

fn new_pass<'a, T, C>(job: &'a RayJob<'a>, tracer: &'a T, coverage: C) -> Result<Pass<'a, T, C>, BackendError> {
    let samples = if job.program.info().params.contains(&"samples") { job.params.samples } else { 0 };
    let wrong = |why: String| check::missing(NAME, job, &why);
    let (occlusion, strata) = match job.fidelity {
        _ if samples == 0 => (None, 0),
        Fidelity::Corrected => (Some(HemisphereSampler::new(job.params.sampler, samples).map_err(wrong)?), 0),
        Fidelity::Thesis => (None, square_root(samples).map_err(wrong)?),
    };
    let (to_light, light_color) = job.sun.map_or((Vec3::ZERO, Vec3::ZERO), |sun| (-sun.direction, sun.color));
    let open_share = if samples == 0 { Vec::new() } else { open_shares(samples, job.params.intensity) };
    let [glass, shadow_glass] =
        [job.glass, job.shadow_glass].map(|glass| TriangleRanges::new(&job.scene.geometry, glass));
    Ok(Pass { job, tracer, coverage, to_light, light_color, occlusion, strata, open_share, glass, shadow_glass })
}

/// The pixels for which a program is run.
trait Runner {
    type Output;

    /// Computes them; where they are computed in tiles, `tile` is shown each before its pixels, with its rows. It may write them all
    /// itself, and says so.
    fn each(
        self,
        tile: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
        pixel: impl Fn(Pixel, &mut Workspace) -> [f32; 4] + Sync,
    ) -> Self::Output;
}

/// The rows of a tile, [`TILE`] each; those that one at the lower border lacks are empty.
type Rows<'o> = [&'o mut [[f32; 4]]; TILE];

/// For programs whose pixels have nothing in common.
fn alone(_: Area, _: &mut Rows<'_>, _: &mut Workspace) -> bool {
    false
}

/// All of them, over rayon's global pool.
struct Whole<'o> {
    output: &'o mut Image,
    progress: &'o Progress,
}

impl Runner for Whole<'_> {
    type Output = RayCounts;

    fn each(
        self,
        tile: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
        pixel: impl Fn(Pixel, &mut Workspace) -> [f32; 4] + Sync,
    ) -> RayCounts {
        each_tile((self.output, self.progress), tile, pixel)
    }
}

/// One.
struct One(Pixel);

impl Runner for One {
    type Output = [f32; 4];

    fn each(
        self,
        _: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
        pixel: impl Fn(Pixel, &mut Workspace) -> [f32; 4] + Sync,
    ) -> [f32; 4] {
        pixel(self.0, &mut Workspace::default())
    }
}

fn run_program<T: Tracer, C: Coverage, R: Runner>(pass: &Pass<'_, T, C>, pixels: R) -> R::Output {
    use Fidelity::{Corrected, Thesis};
    match (pass.job.program, pass.job.fidelity) {
        (RayProgram::Dummy, _) => unreachable!("dummy traces nothing"),
        (RayProgram::DeferredShadows, Thesis) => pixels.each(alone, |p, w| deferred_shadows::thesis::pixel(pass, p, w)),
        (RayProgram::DeferredShadows, Corrected) => {
            let tile = |area, rows: &mut Rows<'_>, work: &mut Workspace| {
                deferred_shadows::corrected::tile(pass, area, rows, work);
                true
            };
            pixels.each(tile, |p, w| deferred_shadows::corrected::pixel(pass, p, w))
        }
        (RayProgram::Reflection, Thesis) => pixels.each(alone, |p, w| reflection::thesis::pixel(pass, p, w)),
        (RayProgram::Reflection, Corrected) => pixels.each(alone, |p, w| reflection::corrected::pixel(pass, p, w)),
        (RayProgram::Refraction, Thesis) => pixels.each(alone, |p, w| refraction::thesis::pixel(pass, p, w)),
        (RayProgram::Refraction, Corrected) => pixels.each(alone, |p, w| refraction::corrected::pixel(pass, p, w)),
        (RayProgram::Ssao, Thesis) => pixels.each(alone, |p, w| ssao::thesis::pixel(pass, p, w)),
        (RayProgram::Ssao, Corrected) => {
            let tile = |area, _: &mut Rows<'_>, work: &mut Workspace| {
                ssao::corrected::prepare(pass, area, work);
                false
            };
            pixels.each(tile, |p, w| ssao::corrected::pixel(pass, p, w))
        }
        (RayProgram::Final, Thesis) => pixels.each(alone, |p, w| combined::thesis::pixel(pass, p, w)),
        (RayProgram::Final, Corrected) => {
            let tile = |area, _: &mut Rows<'_>, work: &mut Workspace| {
                combined::corrected::prepare(pass, area, work);
                false
            };
            pixels.each(tile, |p, w| combined::corrected::pixel(pass, p, w))
        }
    }
}

/// Tiles side by side that a thread takes at a time.
const RUN: usize = 8;

/// The rows of an image, cut into runs of tiles: those of the first row of tiles come first.
fn runs_of_tiles(image: &mut Image) -> Vec<Rows<'_>> {
    let width = (image.width as usize).max(1);
    let across = width.div_ceil(RUN * TILE);
    let mut runs = Vec::new();
    runs.resize_with(across * image.pixels.len().div_ceil(width).div_ceil(TILE), Rows::default);
    for (y, row) in image.pixels.chunks_mut(width).enumerate() {
        for (column, part) in row.chunks_mut(RUN * TILE).enumerate() {
            runs[y / TILE * across + column][y % TILE] = part;
        }
    }
    runs
}

/// A workspace on the heap. A worker that waits for a part of its work runs other parts on the same stack, and a workspace in each of
/// these frames overflows it. Not inlined, so that none of them has the room in which it is made.
#[inline(never)]
fn workspace() -> Box<Workspace> {
    Box::default()
}

fn each_tile(
    (output, progress): (&mut Image, &Progress),
    tile: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
    pixel: impl Fn(Pixel, &mut Workspace) -> [f32; 4] + Sync,
) -> RayCounts {
    let (width, height) = (output.width as usize, output.height as usize);
    let across = width.div_ceil(RUN * TILE).max(1);
    let mut runs = runs_of_tiles(output);
    progress.start((width.div_ceil(TILE) * height.div_ceil(TILE)) as u64);
    let each = |work: &mut Workspace, (left, top): (usize, usize), rows: &mut Rows<'_>| {
        let area =
            Area { x: left, y: top, width: TILE.min(width - left), height: TILE.min(height - top), stride: width };
        if tile(area, rows, work) {
            return;
        }
        for (down, row) in rows.iter_mut().enumerate() {
            for (right, out) in row.iter_mut().enumerate() {
                let (x, y) = (left + right, top + down);
                work.place = down * TILE + right;
                *out = pixel(Pixel { x: x as u32, y: y as u32, index: y * width + x }, work);
            }
        }
    };
    runs.par_iter_mut()
        .enumerate()
        .map_init(workspace, |work, (index, run)| {
            work.rays = RayCounts::default();
            let (left, top) = (index % across * RUN * TILE, index / across * TILE);
            for left in (left..width.min(left + RUN * TILE)).step_by(TILE) {
                let mut rows = Rows::default();
                for (row, rest) in rows.iter_mut().zip(run.iter_mut()) {
                    let columns = TILE.min(rest.len());
                    (*row, *rest) = std::mem::take(rest).split_at_mut(columns);
                }
                each(work, (left, top), &mut rows);
                progress.advance(1);
            }
            work.rays
        })
        .reduce(RayCounts::default, |mut sum, rays| {
            sum += rays;
            sum
        })
}

#[cfg(test)]
mod tests;
