//! The rasteriser on the processor: tiles, vectors, all cores, no device and no driver.
//!
//! A draw has three stages, each run on all threads of the current rayon pool:
//!
//! 1. `vertex`: every vertex is projected and snapped to 1/256 pixel.
//! 2. `bins`: runs of triangles are sorted into tiles of 64 x 64 pixels, in their order. Triangles that need it are
//!    clipped; triangles whose bounding box contains no pixel centre are dropped.
//! 3. `tile`: each tile finds the nearest triangle of each pixel, and shades each pixel once; `spheres` draws exact
//!    spheres over the triangles.
//!
//! Stages 2 and 3 run in several rounds for scenes of many triangles, which bounds the memory of the bins; tiles keep
//! their depths from round to round. A draw without spheres allocates nothing if it repeats an earlier draw. The result
//! is the same bit for bit for every number of threads and every instruction set.

mod bins;
mod check;
mod clip;
mod effects;
mod frame;
mod interpolate;
mod shade;
mod simd;
mod spheres;
mod surface;
#[cfg(test)]
mod tests;
mod tile;
mod vertex;

pub use simd::InstructionSet;

#[cfg(feature = "wgpu")]
pub(in crate::raster) use effects::find_proxy;

use bins::Bins;
use clip::ClippedTriangle;
use curitiba_pipeline::backend::{
    Attachments, BackendError, DrawStats, EffectJob, EffectStats, GBuffer, Limits, RasterJob, Rasteriser, Shade,
};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::{Refused, resize};
use curitiba_pipeline::scene::RenderScene;
use frame::{BIN_TRIANGLES, Frame};
use rayon::prelude::*;
use simd::{Detected, Kernel};
use spheres::Screen;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use surface::{Grid, Target, TileSurface};
use tile::Tile;
use vertex::{Behind, Project, Projection, ScreenVertex};

/// Vertices that a thread projects in one step.
const VERTEX_RUN: usize = 1024;

/// Greatest number of bins in a round, which is half a million triangles. Fewer triangles are divided among up to
/// as many bins, so that all threads have work.
const ROUND: usize = 64;

/// Least number of triangles in a bin; only the last bin may have fewer.
const MIN_BIN: usize = 512;

/// Time that each stage of a draw took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Stages {
    /// Projecting the vertices.
    pub vertices: Duration,
    /// Sorting the triangles into tiles.
    pub bins: Duration,
    /// Finding the nearest triangles, and shading.
    pub tiles: Duration,
}

/// The rasteriser on the processor.
pub struct CpuRasteriser {
    detected: Detected,
    vertices: Vec<ScreenVertex>,
    cuts: Vec<bool>,
    bins: Vec<Bins>,
    clipped: Vec<Vec<ClippedTriangle>>,
    /// Depths and visible parts: one tile for each thread in draws of one round, otherwise one for each drawn tile.
    tiles: Vec<Mutex<Tile>>,
    /// One row for each thread, in which the thread shades.
    rows: Vec<Mutex<shade::Rows>>,
    /// One for each thread: the spheres that the pixels of a tile show.
    shown: Vec<Mutex<Vec<u32>>>,
    stages: Stages,
    round: usize,
    effects: effects::Effects,
}

impl Default for CpuRasteriser {
    fn default() -> Self {
        Self::new()
    }
}

impl std::fmt::Debug for CpuRasteriser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CpuRasteriser").field("set", &self.detected.set()).finish_non_exhaustive()
    }
}

impl CpuRasteriser {
    /// A rasteriser with the widest instruction set of this processor.
    #[must_use]
    pub fn new() -> Self {
        let detected = Detected::new(InstructionSet::best()).expect("the best instruction set is available");
        Self::detected(detected)
    }

    /// A rasteriser with a given instruction set; `None` if this processor lacks it.
    #[must_use]
    pub fn with_instruction_set(set: InstructionSet) -> Option<Self> {
        Detected::new(set).map(Self::detected)
    }

    fn detected(detected: Detected) -> Self {
        Self {
            detected,
            vertices: Vec::new(),
            cuts: Vec::new(),
            bins: Vec::new(),
            clipped: Vec::new(),
            tiles: Vec::new(),
            rows: Vec::new(),
            shown: Vec::new(),
            stages: Stages::default(),
            round: ROUND,
            effects: effects::Effects::default(),
        }
    }

    /// Time that each stage of the last draw took.
    #[must_use]
    pub fn stages(&self) -> Stages {
        self.stages
    }

    /// Draws a job, without the triangles of hidden materials, into a target that holds the job's viewport, or a part of it that ends with
    /// whole tiles. Progress advances by one for each bin and each tile. If it is cancelled, the draw ends early and the target's contents
    /// are undefined.
    fn render(
        &mut self,
        job: &RasterJob<'_>,
        hidden: &[bool],
        mut target: Target<'_>,
        progress: &Progress,
    ) -> Result<DrawStats, BackendError> {
        let held = target.held();
        check::scene(job, held)?;
        self.stages = Stages::default();
        let geometry = &job.scene.geometry;
        let triangles = geometry.triangles.len();
        let stats = DrawStats { triangles: triangles as u64, ..DrawStats::default() };
        if job.viewport.width == 0 || job.viewport.height == 0 {
            return Ok(stats);
        }
        let projection = Projection::new(&job.view, job.viewport);
        let grid = Grid::new(job.viewport, held).ok_or_else(|| check::between_tiles(job.viewport, held))?;
        let detected = self.detected;

        let start = Instant::now();
        resize(&mut self.vertices, geometry.positions.len(), ScreenVertex::default()).map_err(refused)?;
        let outputs = self.vertices.par_chunks_mut(VERTEX_RUN);
        outputs.zip(geometry.positions.par_chunks(VERTEX_RUN)).for_each(|(output, positions)| {
            if !progress.is_cancelled() {
                detected.run(Project { projection: &projection, positions, output });
            }
        });
        if let Some(plane) = projection.plane {
            let outputs = self.vertices.par_chunks_mut(VERTEX_RUN);
            outputs.zip(geometry.positions.par_chunks(VERTEX_RUN)).for_each(|(output, positions)| {
                detected.run(Behind { projection: &projection, plane, positions, output });
            });
        }
        self.stages.vertices = start.elapsed();
        // A cancelled thread has skipped vertices that the next stage would read.
        if progress.is_given_up() {
            return Ok(stats);
        }

        self.cuts.clear();
        self.cuts.extend(job.shades.iter().map(Shade::is_cut));
        // The division into bins does not affect the picture: parts are drawn in the order of their triangles.
        let per_bin = triangles.div_ceil(self.round).clamp(MIN_BIN, BIN_TRIANGLES);
        let bins = triangles.div_ceil(per_bin);
        let rounds = bins.div_ceil(self.round).max(1);
        let threads = rayon::current_num_threads();
        grow(&mut self.rows, threads);
        let spheres = Screen::new(job, hidden);
        grow(&mut self.shown, threads);
        grow(&mut self.tiles, if rounds == 1 { threads } else { grid.drawn() });
        grow(&mut self.clipped, bins);
        grow(&mut self.bins, bins.min(self.round));
        progress.start((bins + rounds * grid.drawn()) as u64);

        for round in 0..rounds {
            let start = Instant::now();
            let first = round * self.round;
            let last = (first + self.round).min(bins);
            let filled = &mut self.bins[..last - first];
            let clipped = self.clipped[first..last].par_iter_mut();
            filled.par_iter_mut().zip(clipped).enumerate().with_max_len(1).for_each(|(offset, (bins, clipped))| {
                if progress.is_cancelled() {
                    return;
                }
                let index = first + offset;
                detected.run(bins::Fill {
                    geometry,
                    vertices: &self.vertices,
                    projection: &projection,
                    grid: &grid,
                    cuts: &self.cuts,
                    hidden,
                    culled: job.culled,
                    triangles: index * per_bin..((index + 1) * per_bin).min(triangles),
                    index,
                    bins,
                    clipped,
                });
                progress.advance(1);
            });
            self.stages.bins += start.elapsed();
            if progress.is_given_up() {
                return Ok(stats);
            }

            let start = Instant::now();
            let clipped = &self.clipped;
            let frame = Frame { job, geometry, vertices: &self.vertices, clipped };
            let (tiles, rows, shown) = (&self.tiles, &self.rows, &self.shown);
            let spheres = spheres.as_ref().filter(|_| round + 1 == rounds);
            surface::for_each_tile(&mut target, &grid, |number, index, surface| {
                if progress.is_cancelled() {
                    return;
                }
                let thread = rayon::current_thread_index().unwrap_or(0);
                let tile = &tiles[if rounds == 1 { thread } else { number }];
                let mut tile = tile.lock().unwrap_or_else(PoisonError::into_inner);
                let mut rows = rows[thread].lock().unwrap_or_else(PoisonError::into_inner);
                let mut shown = shown[thread].lock().unwrap_or_else(PoisonError::into_inner);
                detected.run(DrawTile {
                    frame: &frame,
                    bins: filled,
                    index,
                    first: round == 0,
                    last: round + 1 == rounds,
                    tile: &mut tile,
                    rows: &mut rows,
                    spheres: spheres.map(|screen| (screen, &mut *shown)),
                    surface,
                });
                progress.advance(1);
            });
            self.stages.tiles += start.elapsed();
            if progress.is_given_up() {
                return Ok(stats);
            }
        }
        Ok(stats)
    }
}

impl Rasteriser for CpuRasteriser {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn limits(&self) -> Limits {
        Limits { side: vertex::MAX_SIDE, parts: true }
    }

    fn device(&self) -> String {
        let threads = rayon::current_num_threads();
        let plural = if threads == 1 { "" } else { "s" };
        format!("{}, {threads} thread{plural}, {}", processor(), self.detected.set().name())
    }

    fn upload(&mut self, scene: &Arc<RenderScene>) -> Result<(), BackendError> {
        self.effects.upload(scene);
        Ok(())
    }

    fn draw(&mut self, job: &RasterJob<'_>, target: &mut GBuffer) -> Result<DrawStats, BackendError> {
        self.draw_until(job, target, &Progress::default())
    }

    fn draw_until(
        &mut self,
        job: &RasterJob<'_>,
        target: &mut GBuffer,
        progress: &Progress,
    ) -> Result<DrawStats, BackendError> {
        check::target(job, target)?;
        self.render(job, &[], Target::Attachments(target, job.attachments), progress)
    }

    fn needs_read_back(&self) -> bool {
        false
    }

    fn draws_spheres(&self) -> bool {
        true
    }

    fn read_back(
        &mut self,
        _job: &RasterJob<'_>,
        _wanted: Attachments,
        _target: &mut GBuffer,
    ) -> Result<(), BackendError> {
        Ok(())
    }

    fn effect(
        &mut self,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
    ) -> Result<EffectStats, BackendError> {
        // Taken out while it runs, because it draws its maps with this rasteriser.
        let mut effects = std::mem::take(&mut self.effects);
        let result = effects.run(self, job, output, progress);
        self.effects = effects;
        result
    }
}

/// The error for a refused memory allocation.
fn refused(error: Refused) -> BackendError {
    BackendError::Device { backend: "cpu", message: error.to_string() }
}

/// Kernel for one round of one tile.
struct DrawTile<'a> {
    frame: &'a Frame<'a>,
    bins: &'a [Bins],
    index: usize,
    first: bool,
    last: bool,
    tile: &'a mut Tile,
    rows: &'a mut shade::Rows,
    /// The spheres, and memory for the spheres that the tile shows. Set in the last round of a draw with spheres.
    spheres: Option<(&'a Screen<'a>, &'a mut Vec<u32>)>,
    surface: TileSurface<'a>,
}

impl Kernel for DrawTile<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        if self.first {
            self.tile.clear();
            if self.frame.job.load_store.load_depth {
                for row in 0..self.surface.height {
                    if let Some(depths) = self.surface.left(row) {
                        self.tile.load_depths(row, depths);
                    }
                }
            }
        }
        for bins in self.bins {
            self.tile.draw_bins(self.frame, bins, self.index, &self.surface);
        }
        if let Some((screen, shown)) = &mut self.spheres {
            screen.draw(self.tile, &self.surface, shown);
        }
        if self.last && self.frame.job.load_store.store_depth {
            store_depths(self.tile, &mut self.surface, TileSurface::left);
        }
        if self.last && self.surface.is_depth() {
            store_depths(self.tile, &mut self.surface, TileSurface::depth);
        } else if self.last {
            shade::shade(self.frame, self.tile, self.rows, &mut self.surface);
            if let Some((screen, shown)) = &self.spheres {
                screen.shade(shown, &mut self.surface);
            }
        }
    }
}

/// Copies the depths of a tile to the rows of its surface that `plane` returns; nothing if `plane` returns `None`.
#[inline(always)]
fn store_depths<'a>(
    tile: &Tile,
    surface: &mut TileSurface<'a>,
    plane: for<'s> fn(&'s mut TileSurface<'a>, usize) -> Option<&'s mut [f32]>,
) {
    for row in 0..surface.height {
        let Some(pixels) = plane(surface, row) else { return };
        match tile.depths(row) {
            Some(bits) => pixels.iter_mut().zip(bits).for_each(|(pixel, bits)| *pixel = f32::from_bits(*bits as u32)),
            None => pixels.fill(0.0),
        }
    }
}

/// Extends a list to at least `len` elements; existing elements keep their memory.
fn grow<T: Default>(list: &mut Vec<T>, len: usize) {
    if list.len() < len {
        list.resize_with(len, T::default);
    }
}

/// The processor's name from `/proc/cpuinfo`, or else its architecture.
fn processor() -> String {
    let name = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    name.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}
