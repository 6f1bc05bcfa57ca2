//! Ray programs on the processor: tiles of pixels over rayon's global pool.

mod adaptive;
pub mod check;
mod filter;
mod focused;
mod intersections;

pub use focused::FindsFocused;

use crate::effects::{
    AlphaTested, Area, ByCones, Coverage, Opaque, Pass, Pixel, Preparation, TILE, Workspace, camera, combined,
    deferred_shadows, dielectric,
    dielectric::{Focused, Media, Targets},
    reflection, refraction, ssao,
};
use crate::raster::effects::filter::Filter;
use crate::sampling::HemisphereSampler;
use crate::trace::{Bvh, DynTracer, Erased, Quality, SphereTree, Tracer, WithSpheres};
use curitiba_pipeline::backend::{
    BackendError, BuildStats, IntersectionJob, PhotonCounts, RayBackend, RayCounts, RayJob, RayStats,
};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::Dielectric;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram, TextureLod};
use curitiba_pipeline::scene::{Geometry, RenderScene, TriangleRanges};
use rayon::prelude::*;
use std::cell::Cell;
use std::sync::Arc;

const NAME: &str = "cpu";

/// Greatest memory while the structure is built, in bytes a triangle. It is above the 110 to 160 that [`Bvh`] documents.
const BYTES_PER_TRIANGLE: u64 = 270;

/// The acceleration structure that rays are traced in.
pub(crate) struct Structure {
    pub(crate) triangles: Bvh,
    spheres: SphereTree,
}

/// The ray backend of the processor. Results do not depend on the number of threads.
#[derive(Default)]
pub struct CpuRays {
    built: Option<(Arc<RenderScene>, Structure)>,
    /// Kept, so that its memory is reused from frame to frame.
    filter: Filter,
}

impl Structure {
    /// The structure of a scene; `None` if `progress` was cancelled. The arguments are those of [`RayBackend::build_until`].
    pub(crate) fn build_until(scene: &RenderScene, filtered: &[bool], progress: &Progress) -> Option<Self> {
        let triangles = Bvh::build_until(&scene.geometry, filtered, Quality::default(), progress)?;
        Some(Self { triangles, spheres: SphereTree::build(&scene.geometry, filtered) })
    }
}

impl CpuRays {
    /// A backend without an acceleration structure.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The structure of a job's scene; `None` where no structure was built and the job cannot trace a ray.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] if the job may trace rays and the structure was not built.
    pub(crate) fn tracer(&self, job: &RayJob<'_>) -> Result<Option<&Structure>, BackendError> {
        match &self.built {
            Some((scene, built)) if std::ptr::eq(&raw const **scene, job.scene) => Ok(Some(built)),
            _ if !may_trace(job) => Ok(None),
            _ => Err(check::missing(NAME, job, "its scene's acceleration structure was not built")),
        }
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

    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        check::fidelity(NAME, program, fidelity)
    }

    fn supports_glass(&self, _: RayProgram, _: &RayParams, _: &[Dielectric]) -> Result<(), BackendError> {
        Ok(())
    }

    fn traces_sun_discs(&self) -> bool {
        true
    }

    fn knows_lights(&self) -> bool {
        true
    }

    fn filters_shares(&self) -> bool {
        true
    }

    fn samples_adaptively(&self) -> bool {
        true
    }

    fn sees_skies(&self) -> bool {
        true
    }

    fn traces_cones(&self) -> bool {
        true
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.build_until(scene, filtered, &Progress::default())
    }

    fn build_until(
        &mut self,
        scene: &Arc<RenderScene>,
        filtered: &[bool],
        progress: &Progress,
    ) -> Result<BuildStats, BackendError> {
        // The old structure is released first: two would not always fit.
        self.built = None;
        let Some(built) = Structure::build_until(scene, filtered, progress) else {
            return Ok(BuildStats::default());
        };
        let Structure { triangles, spheres } = &built;
        let (bytes, nodes) = (triangles.bytes() + spheres.bytes(), triangles.node_count() + spheres.node_count());
        self.built = Some((Arc::clone(scene), built));
        Ok(BuildStats { bytes: bytes as u64, nodes: nodes as u64 })
    }

    fn traces_spheres(&self) -> bool {
        true
    }

    fn shoots_photons(&self) -> bool {
        true
    }

    fn bytes_per_triangle(&self) -> u64 {
        BYTES_PER_TRIANGLE
    }

    fn supports_intersections(&self) -> Result<(), BackendError> {
        Ok(())
    }

    fn intersect(
        &mut self,
        job: &IntersectionJob<'_>,
        hits: &mut [[f32; 4]],
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        let built = self.built.as_ref().filter(|(scene, _)| std::ptr::eq(&raw const **scene, job.scene));
        let Some((_, Structure { triangles, spheres })) = built else {
            let message = "its scene's acceleration structure was not built".to_owned();
            return Err(BackendError::Device { backend: NAME, message });
        };
        let buffer = match job.scene.geometry.spheres.is_empty() {
            true => intersections::trace(triangles, job, hits, progress),
            false => intersections::trace(&WithSpheres { triangles, spheres }, job, hits, progress),
        };
        Ok(RayStats { rays: RayCounts { buffer, ..RayCounts::default() }, ..RayStats::default() })
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        if job.program == RayProgram::Dummy {
            in_host(job)?;
            check::images(NAME, job, output)?;
            output.pixels.copy_from_slice(job.color);
            return Ok(RayStats::default());
        }
        let mut filter = std::mem::take(&mut self.filter);
        let traced = match self.tracer(job) {
            Ok(Some(built)) => trace_in(built, job, output, (&mut filter, progress)),
            Ok(None) => trace_in(&empty(), job, output, (&mut filter, progress)),
            Err(error) => Err(error),
        };
        self.filter = filter;
        traced
    }
}

/// The structure of an empty scene.
pub(crate) fn empty() -> Structure {
    let triangles = Bvh::build(&Geometry::default(), &[], Quality::default());
    Structure { triangles, spheres: SphereTree::default() }
}

fn trace_in(
    Structure { triangles, spheres }: &Structure,
    job: &RayJob<'_>,
    output: &mut Image,
    (filter, progress): (&mut Filter, &Progress),
) -> Result<RayStats, BackendError> {
    let with_spheres = WithSpheres { triangles, spheres };
    let tracer: &dyn DynTracer = if job.scene.geometry.spheres.is_empty() { triangles } else { &with_spheres };
    trace_with(tracer, job, output, (filter, progress))
}

fn in_host(job: &RayJob<'_>) -> Result<(), BackendError> {
    match job.shared {
        None => Ok(()),
        Some(_) => Err(check::missing(NAME, job, "its G-buffer is not in host memory")),
    }
}

/// Whether a job can trace any ray. If not, the executor builds no structure.
#[must_use]
pub fn may_trace(job: &RayJob<'_>) -> bool {
    // In thesis fidelity, glass is recognised by a pixel's colour, whatever its material.
    let finds_glass = job.fidelity == Fidelity::Thesis || job.glass.contains(&true);
    job.program.info().needs_structure(&job.params, finds_glass).0
}

/// Runs a program other than `dummy` on any tracer of the job's scene. Programs call the tracer through a pointer, so that they are compiled once
/// for all tracers. The indirect calls cost little: tracing a packet, a fan or a ray takes far longer.
///
/// # Errors
/// [`BackendError::Unsupported`] if the job lacks something that the program reads; the error names it.
pub fn trace(
    tracer: &dyn DynTracer,
    job: &RayJob<'_>,
    output: &mut Image,
    progress: &Progress,
) -> Result<RayStats, BackendError> {
    trace_with(tracer, job, output, (&mut Filter::default(), progress))
}

fn trace_with(
    tracer: &dyn DynTracer,
    job: &RayJob<'_>,
    output: &mut Image,
    (filter, progress): (&mut Filter, &Progress),
) -> Result<RayStats, BackendError> {
    check::images(NAME, job, output)?;
    if let Some(error) = crate::adaptive::asked(job) {
        return adaptive::trace(tracer, job, error, output, progress);
    }
    let tiles = tiles_at_a_time(job);
    let rays = filter::filtered((filter, progress), job, output, |job, output| {
        run(tracer, job, Whole { output, progress, tiles })
    })?;
    Ok(RayStats { rays, ..RayStats::default() })
}

/// Computes each pixel of a job by a function, tile by tile, and sums the rays that the function counts.
///
/// # Errors
/// [`BackendError::Unsupported`] if the job lacks something that its program reads; the error names it.
pub(crate) fn trace_pixels(
    job: &RayJob<'_>,
    output: &mut Image,
    progress: &Progress,
    pixel: impl Fn(Pixel, &mut RayCounts) -> [f32; 4] + Sync,
) -> Result<RayCounts, BackendError> {
    check::images(NAME, job, output)?;
    check::filter(NAME, job)?;
    check::adaptive(NAME, job)?;
    check::cones(NAME, job)?;
    in_host(job)?;
    check::scene(NAME, job, false)?;
    let tiles = tiles_at_a_time(job);
    Ok(each_tile(Whole { output, progress, tiles }, alone, |at, work| pixel(at, &mut work.rays)))
}

/// The colour that a program other than `dummy` writes at one pixel, which must lie inside the job's images. With a filter, the result is
/// the pixel's own share before filtering.
///
/// # Errors
/// As [`trace`]. Also if the job samples glass adaptively or shoots photons: adaptive sampling and photons need the whole picture.
pub fn trace_pixel(tracer: &dyn DynTracer, job: &RayJob<'_>, x: u32, y: u32) -> Result<[f32; 4], BackendError> {
    check::buffers(NAME, job)?;
    check::adaptive(NAME, job)?;
    check::photons(NAME, job)?;
    run(tracer, job, One(Pixel { x, y, index: y as usize * job.width as usize + x as usize }))
}

/// Runs the program of a job. Programs are compiled with and without exact spheres, cut-outs and ray cones, so that scenes without them do not
/// pay. Each combination takes the compiler a minute; those with spheres or cones always test cut-outs.
fn run<'o, R: Runner<'o>>(tracer: &dyn DynTracer, job: &RayJob<'_>, runner: R) -> Result<R::Output, BackendError> {
    in_host(job)?;
    check::scene(NAME, job, tracer.knows_spheres())?;
    let (triangles, all) = (Erased::<false>::new(tracer), Erased::<true>::new(tracer));
    let has_spheres = !job.scene.geometry.spheres.is_empty();
    let cutouts = AlphaTested { scene: job.scene, shades: job.shades };
    let cut = job.fidelity == Fidelity::Corrected && job.shades.iter().any(|shade| shade.alpha_cutoff.is_some());
    let progress = runner.progress();
    Ok(match job.texture_lod() {
        TextureLod::Cones => run_textured(&new_pass(job, &all, ByCones(cutouts), progress)?, runner),
        TextureLod::Zero if has_spheres => run_corrected(&new_pass(job, &all, cutouts, progress)?, runner),
        TextureLod::Zero if cut => run_corrected(&new_pass(job, &triangles, cutouts, progress)?, runner),
        TextureLod::Zero => run_program(&new_pass(job, &triangles, Opaque, progress)?, runner),
    })
}

pub(crate) fn new_pass<'a, T: Tracer, C: Coverage>(
    job: &'a RayJob<'a>,
    tracer: &'a T,
    coverage: C,
    progress: Option<&'a Progress>,
) -> Result<Pass<'a, T, C>, BackendError> {
    let prepared = Preparation::of(job).map_err(|why| check::missing(NAME, job, &why))?;
    let Preparation { sampler, open_share, to_light, disc, light_color } = prepared;
    let (occlusion, strata) = match (job.fidelity, sampler) {
        (Fidelity::Thesis, Some(HemisphereSampler::Strata { side })) => (None, side),
        (_, sampler) => (sampler, 0),
    };
    let [glass, shadow_glass] =
        [job.glass, job.shadow_glass].map(|glass| TriangleRanges::new(&job.scene.geometry, glass));
    let around_eye = Media::NONE;
    let lens = &job.params.camera;
    let eye = job.from_camera.map(|from| camera::Eye::new(&from.view, from.picture, lens.aperture, lens.focus));
    let mut pass = Pass {
        job,
        tracer,
        coverage,
        to_light,
        light_color,
        occlusion,
        strata,
        open_share,
        glass,
        shadow_glass,
        around_eye,
        spectrum: dielectric::spectrum(job),
        facets: dielectric::facets(job),
        targets: Targets::default(),
        focused: Focused::default(),
        disc,
        eye,
        progress,
    };
    if !job.dielectrics.is_empty() {
        pass.around_eye = dielectric::around_eye(&pass);
        pass.focused.lenses = dielectric::lenses(&pass).map_err(|why| check::missing(NAME, job, &why))?;
        pass.targets = dielectric::targets(&pass);
        pass.focused.photons =
            dielectric::photons(&pass).map_err(|refused| check::missing(NAME, job, &refused.to_string()))?;
    }
    Ok(pass)
}

/// The pixels for which a program is run: all, or one.
trait Runner<'o> {
    type Output;

    /// Adds the counts of the photons that the pass has shot to the output of its pixels; by default, adds nothing.
    fn with_photons(output: Self::Output, _: PhotonCounts) -> Self::Output {
        output
    }

    /// The progress through which a caller may cancel the pixels; `None` if they cannot be cancelled.
    fn progress(&self) -> Option<&'o Progress> {
        None
    }

    /// Computes the pixels. Where they are computed in tiles, `tile` is called for each tile before its pixels, with the tile's rows. `tile`
    /// returns true if it has written all of the tile's pixels itself.
    fn each(
        self,
        tile: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
        pixel: impl Fn(Pixel, &mut Workspace) -> [f32; 4] + Sync,
    ) -> Self::Output;
}

/// The rows of a tile, or of a run of adjacent tiles. Rows beyond the lower border of the image are empty.
type Rows<'o> = [&'o mut [[f32; 4]]; TILE];

/// The `tile` function of programs whose pixels are independent: it prepares nothing and writes no pixel.
fn alone(_: Area, _: &mut Rows<'_>, _: &mut Workspace) -> bool {
    false
}

/// The `tile` function of programs that prepare a tile before its pixels are computed.
fn before(prepare: impl Fn(Area, &mut Workspace)) -> impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool {
    move |area, _, work| {
        prepare(area, work);
        false
    }
}

/// All pixels, computed on rayon's global pool.
struct Whole<'o> {
    output: &'o mut Image,
    progress: &'o Progress,
    /// Number of adjacent tiles that a thread takes at a time.
    tiles: usize,
}

impl<'o> Runner<'o> for Whole<'o> {
    type Output = RayCounts;

    fn with_photons(mut rays: RayCounts, photons: PhotonCounts) -> RayCounts {
        rays.photons += photons;
        rays
    }

    fn progress(&self) -> Option<&'o Progress> {
        Some(self.progress)
    }

    fn each(
        self,
        tile: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
        pixel: impl Fn(Pixel, &mut Workspace) -> [f32; 4] + Sync,
    ) -> RayCounts {
        each_tile(self, tile, pixel)
    }
}

/// One pixel.
struct One(Pixel);

impl Runner<'_> for One {
    type Output = [f32; 4];

    fn each(
        self,
        _: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
        pixel: impl Fn(Pixel, &mut Workspace) -> [f32; 4] + Sync,
    ) -> [f32; 4] {
        pixel(self.0, &mut Workspace::default())
    }
}

/// Selects the implementation of the program. For each program and fidelity, this is the function that computes a pixel and, where pixels of
/// a tile share work, the function that is called first for the tile.
fn run_program<'o, T: Tracer, C: Coverage, R: Runner<'o>>(pass: &Pass<'_, T, C>, pixels: R) -> R::Output {
    match pass.job.fidelity {
        Fidelity::Corrected => run_corrected(pass, pixels),
        Fidelity::Thesis => run_thesis(pass, pixels),
    }
}

fn run_thesis<'o, T: Tracer, C: Coverage, R: Runner<'o>>(pass: &Pass<'_, T, C>, pixels: R) -> R::Output {
    match pass.job.program {
        RayProgram::Dummy => pixels.each(alone, |p, _| pass.job.color[p.index]),
        RayProgram::DeferredShadows => pixels.each(alone, |p, w| deferred_shadows::thesis::pixel(pass, p, w)),
        RayProgram::Reflection => pixels.each(alone, |p, w| reflection::thesis::pixel(pass, p, w)),
        RayProgram::Refraction => pixels.each(alone, |p, w| refraction::thesis::pixel(pass, p, w)),
        RayProgram::Ssao => pixels.each(alone, |p, w| ssao::thesis::pixel(pass, p, w)),
        RayProgram::Final => pixels.each(alone, |p, w| combined::thesis::pixel(pass, p, w)),
        RayProgram::Albedo
        | RayProgram::Lambert
        | RayProgram::Whitted
        | RayProgram::CameraOcclusion
        | RayProgram::PathTracing => unreachable!("`check::scene` refuses them in thesis fidelity"),
    }
}

fn run_corrected<'o, T: Tracer, C: Coverage, R: Runner<'o>>(pass: &Pass<'_, T, C>, pixels: R) -> R::Output {
    match pass.job.program {
        RayProgram::Dummy => pixels.each(alone, |p, _| pass.job.color[p.index]),
        RayProgram::DeferredShadows if !pass.job.lights.is_empty() => {
            pixels.each(alone, |p, w| deferred_shadows::lights::pixel(pass, p, w))
        }
        RayProgram::DeferredShadows if pass.disc.is_some() => {
            pixels.each(alone, |p, w| deferred_shadows::soft::pixel(pass, p, w))
        }
        RayProgram::DeferredShadows => {
            let tile = |area, rows: &mut Rows<'_>, work: &mut Workspace| {
                deferred_shadows::corrected::tile(pass, area, rows, work);
                true
            };
            pixels.each(tile, |p, w| deferred_shadows::corrected::pixel(pass, p, w))
        }
        RayProgram::Ssao => {
            let prepare = |area, work: &mut Workspace| ssao::corrected::prepare(pass, area, work);
            pixels.each(before(prepare), |p, w| ssao::corrected::pixel(pass, p, w))
        }
        _ => run_textured(pass, pixels),
    }
}

/// Selects the implementation, in corrected fidelity, of the programs that read textures at hits. Only these programs can use ray cones.
fn run_textured<'o, T: Tracer, C: Coverage, R: Runner<'o>>(pass: &Pass<'_, T, C>, pixels: R) -> R::Output {
    // With `glass=auto` separate functions run, so that scenes with the report's panes do not become slower.
    let bodies = !pass.job.dielectrics.is_empty();
    match pass.job.program {
        RayProgram::Reflection => pixels.each(alone, |p, w| reflection::corrected::pixel(pass, p, w)),
        RayProgram::Refraction if bodies => {
            pixels.each(alone, |p, w| refraction::corrected::pixel_of_bodies(pass, p, w))
        }
        RayProgram::Refraction => pixels.each(alone, |p, w| refraction::corrected::pixel(pass, p, w)),
        RayProgram::Final if bodies => {
            let prepare = |area, work: &mut Workspace| combined::bodies::prepare(pass, area, work);
            let computed = pixels.each(before(prepare), |p, w| combined::bodies::pixel(pass, p, w));
            R::with_photons(computed, pass.focused.photons.counts)
        }
        RayProgram::Final => {
            let prepare = |area, work: &mut Workspace| combined::corrected::prepare(pass, area, work);
            pixels.each(before(prepare), |p, w| combined::corrected::pixel(pass, p, w))
        }
        RayProgram::Albedo
        | RayProgram::Lambert
        | RayProgram::Whitted
        | RayProgram::CameraOcclusion
        | RayProgram::PathTracing => pixels.each(alone, |p, w| camera::pixel(pass, p, w)),
        RayProgram::Dummy | RayProgram::DeferredShadows | RayProgram::Ssao => {
            unreachable!("they have no parameter `texturelod`")
        }
    }
}

/// Number of adjacent tiles that a thread takes at a time. Hard shadows take about 70 cycles a pixel, so taking many tiles at a time reduces the
/// overhead of starting tasks. In other programs a pixel may take a thousand times as long as its neighbour, and the last tile of a frame keeps 15
/// of 16 threads waiting: with two tiles at a time, the wait took 4 % of the time of ambient occlusion and 7 % of the time of `final`.
fn tiles_at_a_time(job: &RayJob<'_>) -> usize {
    let is_soft = job.program.info().sun_samples(&job.params) > 0;
    if job.program == RayProgram::DeferredShadows && !is_soft && job.lights.is_empty() { 8 } else { 1 }
}

/// The rows of an image, cut into runs of up to `tiles` adjacent tiles, in row-major order.
fn runs_of_tiles(image: &mut Image, tiles: usize) -> Vec<Rows<'_>> {
    let width = (image.width as usize).max(1);
    let across = width.div_ceil(tiles * TILE);
    let mut runs = Vec::new();
    runs.resize_with(across * image.pixels.len().div_ceil(width).div_ceil(TILE), Rows::default);
    for (y, row) in image.pixels.chunks_mut(width).enumerate() {
        for (column, part) in row.chunks_mut(tiles * TILE).enumerate() {
            runs[y / TILE * across + column][y % TILE] = part;
        }
    }
    runs
}

thread_local! {
    /// Buffers for the tiles of this thread, kept from frame to frame. The buffers are on the heap: a thread that waits for other threads may run
    /// the tiles of other threads on its own stack, nested many deep.
    static WORKSPACE: Cell<Option<Box<Workspace>>> = const { Cell::new(None) };
}

/// Runs `task` with the buffers of this thread. A task that waits for other threads may be given another task meanwhile, which gets new buffers.
fn with_workspace<R>(task: impl FnOnce(&mut Workspace) -> R) -> R {
    let mut work = WORKSPACE.take().unwrap_or_default();
    let result = task(&mut work);
    WORKSPACE.set(Some(work));
    result
}

fn each_tile(
    Whole { output, progress, tiles }: Whole<'_>,
    tile: impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool + Sync,
    pixel: impl Fn(Pixel, &mut Workspace) -> [f32; 4] + Sync,
) -> RayCounts {
    let (width, height) = (output.width as usize, output.height as usize);
    let across = width.div_ceil(tiles * TILE).max(1);
    let mut runs = runs_of_tiles(output, tiles);
    progress.start((width.div_ceil(TILE) * height.div_ceil(TILE)) as u64);
    let each = |index: usize, run: &mut Rows<'_>| {
        let corner = (index % across * tiles * TILE, index / across * TILE);
        with_workspace(|work| run_of_tiles(work, (width, height), corner, run, progress, &tile, &pixel))
    };
    in_parallel(&mut runs, &each)
}

/// Computes runs of tiles, and counts their rays. Not generic: rayon's loop, which is several functions, is compiled once, and not once for
/// each program and kind of scene.
fn in_parallel(runs: &mut [Rows<'_>], each: &(dyn Fn(usize, &mut Rows<'_>) -> RayCounts + Sync)) -> RayCounts {
    let add = |mut sum: RayCounts, rays| {
        sum += rays;
        sum
    };
    let counts = runs.par_iter_mut().enumerate().with_max_len(1).map(|(index, run)| each(index, run));
    counts.reduce(RayCounts::default, add)
}

/// Computes a run of tiles; the upper left pixel of the first tile is `(left, top)`.
///
/// Never inlined: its stack frame would become part of the frame of the function that splits the work, which may be on the stack many times.
#[inline(never)]
fn run_of_tiles(
    work: &mut Workspace,
    (width, height): (usize, usize),
    (left, top): (usize, usize),
    run: &mut Rows<'_>,
    progress: &Progress,
    tile: &impl Fn(Area, &mut Rows<'_>, &mut Workspace) -> bool,
    pixel: &impl Fn(Pixel, &mut Workspace) -> [f32; 4],
) -> RayCounts {
    work.begin();
    let end = left + run[0].len();
    for left in (left..end).step_by(TILE) {
        // After a cancellation the output is discarded.
        if progress.is_cancelled() {
            break;
        }
        let mut rows = Rows::default();
        for (row, rest) in rows.iter_mut().zip(run.iter_mut()) {
            let columns = TILE.min(rest.len());
            (*row, *rest) = std::mem::take(rest).split_at_mut(columns);
        }
        let area =
            Area { x: left, y: top, width: TILE.min(width - left), height: TILE.min(height - top), stride: width };
        if !tile(area, &mut rows, work) {
            for (down, row) in rows.iter_mut().enumerate() {
                for (right, out) in row.iter_mut().enumerate() {
                    // A cancelled `tile` returns false; the pixels that it left out are not computed here.
                    if progress.is_cancelled() {
                        return work.rays;
                    }
                    let (x, y) = (left + right, top + down);
                    work.place = down * TILE + right;
                    *out = pixel(Pixel { x: x as u32, y: y as u32, index: y * width + x }, work);
                }
            }
        }
        progress.advance(1);
    }
    work.rays
}

#[cfg(test)]
mod tests;
