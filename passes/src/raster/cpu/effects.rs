//! The raster effects on the processor: maps are drawn as any picture is, pixels are computed in bands of rows by all threads.

use super::surface::{DepthMap, Target};
use super::{CpuRasteriser, refused};
use crate::effects::{interface, reflect};
use crate::raster::effects::cascades::{self, Cascades};
use crate::raster::effects::occlusion::{Occlusion, Shown};
use crate::raster::effects::panes::{Probe, Probes, nearest};
use crate::raster::effects::{self, SceneCache, cube};
use curitiba_pipeline::backend::{
    Attachments, BackendError, EffectJob, EffectStats, GBuffer, Part, RasterJob, Rasteriser, Rect, Sun, View,
};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::RasterProgram;
use curitiba_pipeline::raster_effects::EffectProgram;
use curitiba_pipeline::scene::{RenderScene, TriangleRanges};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Rows of a band, and columns of the blocks that it is computed in: neighbours read the same parts of maps.
const BLOCK: usize = 16;

/// The maps, kept from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Effects {
    scene: SceneCache,
    /// From near to far.
    shadows: Vec<DepthMap>,
    probes: Probes,
    /// Six for each probe.
    faces: Vec<GBuffer>,
}

impl Effects {
    /// Forgets what is known of another scene.
    pub fn upload(&mut self, scene: &Arc<RenderScene>) {
        if !self.scene.is_of(scene) {
            self.scene = SceneCache::new(scene);
        }
    }

    /// Runs an effect, drawing its maps with `raster`.
    pub fn run(
        &mut self,
        raster: &mut CpuRasteriser,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
    ) -> Result<EffectStats, BackendError> {
        let refuse = |why: String| BackendError::Unsupported {
            backend: raster.name(),
            what: job.program.info().name.to_owned(),
            why,
        };
        effects::check(job, output, false).map_err(refuse)?;
        if !self.scene.is_of(job.scene) {
            return Err(refuse("its scene was not uploaded".to_owned()));
        }
        let mut stats = EffectStats::default();
        match job.program {
            EffectProgram::ShadowMap => self.shadows(raster, job, output, progress, &mut stats)?,
            EffectProgram::CubeReflection | EffectProgram::CubeRefraction => {
                self.cubes(raster, job, output, progress, &mut stats)?;
            }
            EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => {
                let occlusion = Occlusion::new(job);
                let depths = job.program == EffectProgram::DepthOcclusion;
                progress.start(bands(output));
                stats.pixels = each_pixel(output, progress, |x, y, index| {
                    let [position, normal] = [job.position[index], job.normal[index]].map(Vec4::from_array);
                    let shown = Shown { x, y, position: position.truncate(), normal: normal.truncate() };
                    let read = |index: usize| job.position[index];
                    let share =
                        if depths { occlusion.by_depths(shown, read) } else { occlusion.by_horizons(shown, read) };
                    [share, share, share, 1.0]
                });
            }
        }
        Ok(stats)
    }

    fn shadows(
        &mut self,
        raster: &mut CpuRasteriser,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
        stats: &mut EffectStats,
    ) -> Result<(), BackendError> {
        let bounds = self.scene.bounds(job.scene);
        // In a picture without a lit pixel nothing asks the maps.
        let lit = job.sun.zip(cascades::lit_depths(job));
        let cascades = lit.map(|(sun, depths)| Cascades::new(&sun, &bounds, &job.view, depths, &job.params));
        let cascades = cascades.unwrap_or_default();
        let maps = cascades.fits.len();
        progress.start(bands(output) + maps as u64);
        if maps == 0 {
            stats.pixels = each_pixel(output, progress, |_, _, _| [1.0; 4]);
            return Ok(());
        }
        let size = job.params.map_size;
        stats.bytes = maps as u64 * u64::from(size) * u64::from(size) * size_of::<f32>() as u64;
        check_bytes(raster, job, stats.bytes)?;
        let start = Instant::now();
        if self.shadows.len() < maps {
            self.shadows.resize_with(maps, DepthMap::default);
        }
        for (fit, map) in cascades.fits.iter().zip(&mut self.shadows) {
            map.resize(size);
            let map_job = map_job(job, fit.view, None, size, Attachments::default());
            let drawn = raster.render(&map_job, &[], Target::Depth(map))?;
            stats.triangles += drawn.triangles;
            progress.advance(1);
        }
        stats.maps = Some(Part { host: start.elapsed(), device: None });
        stats.map_count = maps as u32;
        let maps = &self.shadows;
        stats.pixels = each_pixel(output, progress, |_, _, index| {
            let [x, y, z, cos] = job.position[index];
            if cos <= 0.0 || cos.is_nan() {
                return [1.0; 4];
            }
            let map = |index: usize| maps[index].depths();
            let value = 0.5 + 0.5 * cascades.lit_share(map, Vec3::new(x, y, z), cos, &job.params);
            [value, value, value, 1.0]
        });
        Ok(())
    }

    fn cubes(
        &mut self,
        raster: &mut CpuRasteriser,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
        stats: &mut EffectStats,
    ) -> Result<(), BackendError> {
        let bounds = self.scene.bounds(job.scene);
        // In a picture without a pixel of glass nothing asks the maps.
        let glazed = TriangleRanges::new(&job.scene.geometry, job.glass);
        let wanted = !glazed.as_slice().is_empty() && job.triangle.par_iter().any(|id| glazed.contains(*id));
        let panes = if wanted { self.scene.panes(job.scene, job.glass) } else { &[] };
        let probes = self.probes.choose(panes, &bounds, &job.view, job.params.probes);
        let maps = probes.len() * cube::FACES;
        progress.start(bands(output) + maps as u64);
        if probes.is_empty() {
            stats.pixels = each_pixel(output, progress, |_, _, index| job.color[index]);
            return Ok(());
        }
        let size = job.params.map_size;
        stats.bytes = maps as u64 * u64::from(size) * u64::from(size) * size_of::<[f32; 4]>() as u64;
        check_bytes(raster, job, stats.bytes)?;
        let start = Instant::now();
        let attachments = Attachments { color: true, ..Attachments::default() };
        if self.faces.first().is_some_and(|face| face.width != size) {
            self.faces.clear();
        }
        while self.faces.len() < maps {
            self.faces.push(GBuffer::try_new(size, size, attachments).map_err(refused)?);
        }
        let faces = probes.iter().flat_map(|probe| (0..cube::FACES).map(|face| probe.view(face)));
        for (view, face) in faces.zip(&mut self.faces) {
            let map_job = map_job(job, view, job.sun, size, attachments);
            raster.render(&map_job, job.glass, Target::Attachments(face, attachments))?;
            progress.advance(1);
        }
        let seen =
            job.scene.geometry.batches.iter().filter(|batch| job.glass.get(batch.material as usize) != Some(&true));
        stats.triangles = maps as u64 * seen.map(|batch| u64::from(batch.count)).sum::<u64>();
        stats.map_count = probes.len() as u32;
        stats.maps = Some(Part { host: start.elapsed(), device: None });
        let refracts = job.program == EffectProgram::CubeRefraction;
        let faces = &self.faces;
        stats.pixels = each_pixel(output, progress, |_, _, index| {
            if glazed.contains(job.triangle[index]) {
                glass(job, probes, faces, index, refracts)
            } else {
                job.color[index]
            }
        });
        Ok(())
    }
}

/// What a pixel of glass shows: the reflected colour, or both by their Fresnel weights.
fn glass(job: &EffectJob<'_>, probes: &[Probe], faces: &[GBuffer], index: usize, refracts: bool) -> [f32; 4] {
    let [position, normal] = [job.position[index], job.normal[index]].map(|value| Vec4::from_array(value).truncate());
    let (Some(probe), Some((view, normal))) =
        (nearest(probes, position), effects::facing(job.view.eye, position, normal))
    else {
        return job.color[index];
    };
    let look_up = |direction: Vec3| {
        let (face, at) = cube::locate(direction);
        cube::sample(&faces[probe * cube::FACES + face].color, job.params.map_size, at)
    };
    let reflected = reflect(view, normal);
    if !refracts {
        return look_up(reflected).extend(1.0).to_array();
    }
    let interface = interface(job.params.fresnel, -normal.dot(view), job.params.index);
    let mut color = interface.reflectance * look_up(reflected);
    if let Some(refracted) = interface.refract(view, normal, job.params.index) {
        color += (1.0 - interface.reflectance) * look_up(refracted);
    }
    color.extend(1.0).to_array()
}

/// Refuses maps that would take too much memory.
fn check_bytes(raster: &CpuRasteriser, job: &EffectJob<'_>, bytes: u64) -> Result<(), BackendError> {
    effects::check_map_bytes(job.program, bytes).map_err(|why| BackendError::Unsupported {
        backend: raster.name(),
        what: job.program.info().name.to_owned(),
        why,
    })
}

/// A draw of the job's scene into a whole square map.
fn map_job<'a>(
    job: &EffectJob<'a>,
    view: View,
    sun: Option<Sun>,
    size: u32,
    attachments: Attachments,
) -> RasterJob<'a> {
    RasterJob {
        scene: job.scene,
        program: RasterProgram::Deferred,
        view,
        sun,
        shades: job.shades,
        // Maps show what rays meet: both sides of everything.
        culled: &[],
        viewport: Rect { x: 0, y: 0, width: size, height: size },
        clear_color: Vec4::ZERO,
        attachments,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: true,
    }
}

fn bands(output: &Image) -> u64 {
    u64::from(output.height).div_ceil(BLOCK as u64)
}

/// Computes every pixel from its column, row and index, on all threads.
fn each_pixel(output: &mut Image, progress: &Progress, pixel: impl Fn(u32, u32, usize) -> [f32; 4] + Sync) -> Part {
    let start = Instant::now();
    let width = output.width as usize;
    if width > 0 {
        output.pixels.par_chunks_mut(width * BLOCK).enumerate().with_max_len(1).for_each(|(band, pixels)| {
            if progress.is_cancelled() {
                return;
            }
            let first_row = band * BLOCK;
            for left in (0..width).step_by(BLOCK) {
                let right = (left + BLOCK).min(width);
                for (row, pixels) in pixels.chunks_mut(width).enumerate() {
                    let y = first_row + row;
                    for (x, out) in (left..right).zip(&mut pixels[left..right]) {
                        *out = pixel(x as u32, y as u32, y * width + x);
                    }
                }
            }
            progress.advance(1);
        });
    }
    Part { host: start.elapsed(), device: None }
}
