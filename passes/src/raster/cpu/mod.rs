//! The rasteriser on the processor: tiles, vectors, all cores, no device and no driver.
//!
//! A draw has three stages, each run on all threads of the current rayon pool:
//!
//! 1. `vertex`: every vertex is projected and snapped to 1/256 pixel.
//! 2. `bins`: runs of triangles are sorted into tiles of 64 x 64 pixels, in their order. Those that need it are
//!    clipped, those that contain no pixel centre dropped.
//! 3. `tile`: each tile finds the nearest triangle of each pixel, then shades each pixel once.
//!
//! Scenes of many triangles are drawn in several rounds of 2 and 3 so that the bins' memory is bounded; tiles then keep
//! their depth from round to round. Nothing is allocated in a draw of a size that was drawn before. The result is the
//! same bit by bit for every number of threads and every instruction set.

mod bins;
mod clip;
mod frame;
mod shade;
mod simd;
mod surface;
#[cfg(test)]
mod tests;
mod tile;
mod vertex;

pub use simd::InstructionSet;

use bins::Bins;
use clip::ClippedTriangle;
use curitiba_pipeline::backend::{
    Attachments, BackendError, DrawStats, EffectJob, EffectStats, GBuffer, RasterJob, Rasteriser,
};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::scene::RenderScene;
use frame::{BIN_TRIANGLES, Frame, MAX_TRIANGLES, is_cut};
use rayon::prelude::*;
use simd::{Detected, Kernel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use surface::{Grid, TileSurface};
use tile::Tile;
use vertex::{MAX_SIDE, Project, Projection, ScreenVertex};

/// Vertices that a thread projects at once.
const VERTEX_RUN: usize = 4096;

/// Bins of a round: half a million triangles.
const ROUND: usize = 64;

/// Where the time of a draw went.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Stages {
    /// Projecting the vertices.
    pub vertices: Duration,
    /// Sorting the triangles into tiles.
    pub bins: Duration,
    /// Finding the nearest triangles, and shading.
    pub tiles: Duration,
}

/// Draws on the processor.
pub struct CpuRasteriser {
    detected: Detected,
    vertices: Vec<ScreenVertex>,
    cuts: Vec<bool>,
    bins: Vec<Bins>,
    clipped: Vec<Vec<ClippedTriangle>>,
    /// By thread where a draw has one round, otherwise by tile.
    tiles: Vec<Mutex<Tile>>,
    /// By thread.
    rows: Vec<Mutex<shade::Rows>>,
    stages: Stages,
    round: usize,
}

impl Default for CpuRasteriser {
    fn default() -> Self {
        Self::new()
    }
}

impl CpuRasteriser {
    /// In the widest instruction set that this processor has.
    #[must_use]
    pub fn new() -> Self {
        let detected = Detected::new(InstructionSet::best()).expect("the best instruction set is available");
        Self::detected(detected)
    }

    /// In a given instruction set; `None` if this processor lacks it.
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
            stages: Stages::default(),
            round: ROUND,
        }
    }

    /// Where the time of the last draw went.
    #[must_use]
    pub fn stages(&self) -> Stages {
        self.stages
    }
}

impl Rasteriser for CpuRasteriser {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn device(&self) -> String {
        let threads = rayon::current_num_threads();
        let plural = if threads == 1 { "" } else { "s" };
        format!("{}, {threads} thread{plural}, {}", processor(), self.detected.set().name())
    }

    fn upload(&mut self, _scene: &Arc<RenderScene>) -> Result<(), BackendError> {
        Ok(())
    }

    fn draw(&mut self, job: &RasterJob<'_>, target: &mut GBuffer) -> Result<DrawStats, BackendError> {
        check(job, target)?;
        self.stages = Stages::default();
        let geometry = &job.scene.geometry;
        let triangles = geometry.triangles.len();
        let stats = DrawStats { device_time: None, triangles: triangles as u64 };
        if job.viewport.width == 0 || job.viewport.height == 0 {
            return Ok(stats);
        }
        let projection = Projection::new(&job.view, job.viewport);
        let grid = Grid::new(job.viewport);
        let detected = self.detected;

        let start = Instant::now();
        self.vertices.resize(geometry.positions.len(), ScreenVertex::default());
        let outputs = self.vertices.par_chunks_mut(VERTEX_RUN);
        outputs.zip(geometry.positions.par_chunks(VERTEX_RUN)).for_each(|(output, positions)| {
            detected.run(Project { projection: &projection, positions, output });
        });
        self.stages.vertices = start.elapsed();

        self.cuts.clear();
        self.cuts.extend(job.shades.iter().map(is_cut));
        let bins = triangles.div_ceil(BIN_TRIANGLES);
        let rounds = bins.div_ceil(self.round).max(1);
        let threads = rayon::current_num_threads();
        grow(&mut self.rows, threads);
        grow(&mut self.tiles, if rounds == 1 { threads } else { grid.len() });
        grow(&mut self.clipped, bins);
        grow(&mut self.bins, bins.min(self.round));

        for round in 0..rounds {
            let start = Instant::now();
            let first = round * self.round;
            let last = (first + self.round).min(bins);
            let filled = &mut self.bins[..last - first];
            let clipped = self.clipped[first..last].par_iter_mut();
            filled.par_iter_mut().zip(clipped).enumerate().with_max_len(1).for_each(|(offset, (bins, clipped))| {
                let index = first + offset;
                detected.run(bins::Fill {
                    geometry,
                    vertices: &self.vertices,
                    projection: &projection,
                    grid: &grid,
                    cuts: &self.cuts,
                    triangles: index * BIN_TRIANGLES..((index + 1) * BIN_TRIANGLES).min(triangles),
                    index,
                    bins,
                    clipped,
                });
            });
            self.stages.bins += start.elapsed();

            let start = Instant::now();
            let clipped = &self.clipped;
            let frame = Frame { job, geometry, vertices: &self.vertices, clipped };
            let (tiles, rows) = (&self.tiles, &self.rows);
            surface::for_each_tile(target, job.attachments, &grid, |index, surface| {
                let thread = rayon::current_thread_index().unwrap_or(0);
                let tile = &tiles[if rounds == 1 { thread } else { index }];
                let mut tile = tile.lock().unwrap_or_else(PoisonError::into_inner);
                let mut rows = rows[thread].lock().unwrap_or_else(PoisonError::into_inner);
                detected.run(DrawTile {
                    frame: &frame,
                    bins: filled,
                    index,
                    first: round == 0,
                    last: round + 1 == rounds,
                    tile: &mut tile,
                    rows: &mut rows,
                    surface,
                });
            });
            self.stages.tiles += start.elapsed();
        }
        Ok(stats)
    }

    fn needs_read_back(&self) -> bool {
        false
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
        _output: &mut Image,
        _progress: &Progress,
    ) -> Result<EffectStats, BackendError> {
        let what = job.program.info().name.to_owned();
        Err(BackendError::Unsupported { backend: self.name(), what, why: "not written".to_owned() })
    }
}

/// One round of one tile.
struct DrawTile<'a> {
    frame: &'a Frame<'a>,
    bins: &'a [Bins],
    index: usize,
    first: bool,
    last: bool,
    tile: &'a mut Tile,
    rows: &'a mut shade::Rows,
    surface: TileSurface<'a>,
}

impl Kernel for DrawTile<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        if self.first {
            self.tile.clear();
        }
        for bins in self.bins {
            self.tile.draw_bins(self.frame, bins, self.index, &self.surface);
        }
        if self.last {
            shade::shade(self.frame, self.tile, self.rows, &mut self.surface);
        }
    }
}

/// Makes a list at least so long; what is there stays, with its memory.
fn grow<T: Default>(list: &mut Vec<T>, len: usize) {
    if list.len() < len {
        list.resize_with(len, T::default);
    }
}

/// Refuses jobs that this rasteriser cannot do or whose parts do not fit together.
fn check(job: &RasterJob<'_>, target: &GBuffer) -> Result<(), BackendError> {
    let refuse = |what: &str, why: String| {
        Err(BackendError::Unsupported { backend: "cpu", what: what.to_owned(), why: why.to_owned() })
    };
    let (view, geometry, asked) = (job.viewport, &job.scene.geometry, job.attachments);
    let inside = |start: u32, side: u32, whole: u32| start.checked_add(side).is_some_and(|end| end <= whole);
    if !inside(view.x, view.width, target.width) || !inside(view.y, view.height, target.height) {
        return refuse("this viewport", format!("{view:?} is not inside {} x {}", target.width, target.height));
    }
    if target.width > MAX_SIDE || target.height > MAX_SIDE {
        return refuse("this size", format!("sides are at most {MAX_SIDE} pixels; render it in parts"));
    }
    let pixels = target.width as usize * target.height as usize;
    let sizes = [
        ("color", asked.color, target.color.len()),
        ("position", asked.position, target.position.len()),
        ("normal", asked.normal, target.normal.len()),
        ("triangle", asked.triangle, target.triangle.len()),
    ];
    if let Some((name, ..)) = sizes.into_iter().find(|(_, asked, len)| *asked && *len != pixels) {
        return refuse("this target", format!("its attachment `{name}` is not allocated"));
    }
    if geometry.triangles.len() > MAX_TRIANGLES {
        return refuse("this scene", format!("it has more than {MAX_TRIANGLES} triangles; split it"));
    }
    let vertices = geometry.positions.len();
    if asked.normal && geometry.normals.len() != vertices {
        return refuse("the attachment `normal`", "the scene was loaded without normals".to_owned());
    }
    if !geometry.normals.is_empty() && geometry.normals.len() != vertices {
        return refuse("this scene", "it has not as many normals as positions".to_owned());
    }
    for batch in &geometry.batches {
        let Some(shade) = job.shades.get(batch.material as usize) else {
            return refuse("this scene", format!("material {} has no colours", batch.material));
        };
        if (batch.first as usize).saturating_add(batch.count as usize) > geometry.triangles.len() {
            return refuse("this scene", "a batch reaches beyond the triangles".to_owned());
        }
        if let Some(texture) = shade.texture.filter(|_| asked.color || shade.alpha_cutoff.is_some()) {
            if texture as usize >= job.scene.textures.len() {
                return refuse("this scene", format!("it has no texture {texture}"));
            }
            if geometry.texcoords.len() != vertices {
                return refuse("a textured material", "the scene was loaded without texture coordinates".to_owned());
            }
        }
    }
    Ok(())
}

/// The processor's name where the system tells it in a file, else its architecture.
fn processor() -> String {
    let name = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    name.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}
