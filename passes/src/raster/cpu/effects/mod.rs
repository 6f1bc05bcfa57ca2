//! The raster effects on the processor. Maps are drawn like any picture; pixels are computed in bands of rows, on all
//! threads.

mod screen;

use super::surface::{DepthMap, Target};
use super::{CpuRasteriser, refused};
use crate::effects::{SHADOWED, interface, reflect};
use crate::raster::effects::cascades::{self, Cascades};
use crate::raster::effects::filter::Filter;
use crate::raster::effects::mirrors::{Mirror, Mirrors, Survey};
use crate::raster::effects::occlusion::{Method, Occlusion, SPAN, open_shares, power};
use crate::raster::effects::panes::{Probe, Probes, nearest};
use crate::raster::effects::proxy::{self, Proxy};
use crate::raster::effects::screen::pyramid::Pyramid;
use crate::raster::effects::{self, SceneCache, cube};
use curitiba_pipeline::backend::{
    Answers, Attachments, BackendError, EffectJob, EffectStats, GBuffer, LoadStore, Part, RasterJob, Rasteriser, Rect,
    Sun, View,
};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::gbuffer::ALIGNMENT;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::resize;
use curitiba_pipeline::programs::RasterProgram;
use curitiba_pipeline::raster_effects::{Border, EffectProgram, Parallax};
use curitiba_pipeline::scene::{RenderScene, TriangleRanges};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Rows of a band of the picture, and columns of the blocks that a band consists of. Blocks are computed one after the other, because
/// neighbouring pixels read the same parts of maps.
const BLOCK: usize = SPAN;

/// The maps and other buffers of the effects, kept from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Effects {
    scene: SceneCache,
    /// The shadow maps, from near to far.
    shadows: Vec<DepthMap>,
    probes: Probes,
    /// The faces of the cube maps, probe by probe, six for each.
    faces: Vec<GBuffer>,
    /// The map of one mirror, used for all mirrors in turn.
    mirror: GBuffer,
    /// By pixel: index of the plane of glass that it shows, as in [`Survey::new`].
    plane_of: Vec<u32>,
    filter: Filter,
    /// The pyramid of depths that screen-space rays are marched through.
    pyramid: Pyramid,
    /// The picture as it would be without the glass, for screen-space refraction.
    behind: GBuffer,
}

impl Effects {
    /// Drops the data that was derived from another scene.
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
        effects::check(job, Some(output), false).map_err(refuse)?;
        if !self.scene.is_of(job.scene) {
            return Err(refuse("its scene was not uploaded".to_owned()));
        }
        let mut stats = EffectStats::default();
        match job.program {
            EffectProgram::ShadowMap => self.shadows(raster, job, output, progress, &mut stats)?,
            EffectProgram::CubeReflection | EffectProgram::CubeRefraction => {
                self.cubes(raster, job, output, progress, &mut stats)?;
            }
            EffectProgram::PlanarReflection => self.mirrors(raster, job, output, progress, &mut stats)?,
            EffectProgram::ScreenReflection | EffectProgram::ScreenRefraction => {
                self.screen(raster, job, output, progress, &mut stats)?;
            }
            EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => {
                stats.pixels = self.occlusion(job, output, progress)?;
            }
        }
        Ok(stats)
    }

    /// Writes the share of each pixel's hemisphere that is not occluded, filtered if the job has filter levels.
    fn occlusion(
        &mut self,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
    ) -> Result<Part, BackendError> {
        let (levels, exponent) = (job.params.filter, job.params.intensity);
        let mut occlusion = Occlusion::new(job);
        if levels > 0 {
            // The exponent is applied after the filter, because the mean of powers is not the power of the mean.
            occlusion = occlusion.plain();
        }
        let method = Method::of(job);
        progress.start(bands(output) * if levels > 0 { 2 } else { 1 });
        let mut part = each_span(output, progress, |x, y, pixels| {
            for (pixel, share) in pixels.iter_mut().zip(open_shares(&occlusion, method, x, y)) {
                *pixel = [share, share, share, 1.0];
            }
        });
        if levels > 0 {
            let start = Instant::now();
            let three = |[x, y, z, _]: [f32; 4]| [x, y, z];
            let surface = |index: usize| [three(job.position[index]), three(job.normal[index])];
            self.filter.load(job.width, &output.pixels, surface).map_err(refused)?;
            let shares = self.filter.run(levels, progress);
            let width = job.width as usize;
            let filtering = start.elapsed();
            let finish = each_span(output, progress, |x, y, pixels| {
                let first = y as usize * width + x as usize;
                for (pixel, share) in pixels.iter_mut().zip(&shares[first..]) {
                    let share = power(share.clamp(0.0, 1.0), exponent);
                    *pixel = [share, share, share, 1.0];
                }
            });
            part.host += filtering + finish.host;
        }
        Ok(part)
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
        // Without a lit pixel, no map is needed.
        let lit = job.sun.zip(cascades::lit_depths(job));
        let cascades = lit.map(|(sun, depths)| Cascades::new(&sun, &bounds, &job.view, depths, &job.params));
        let cascades = cascades.unwrap_or_default();
        let maps = cascades.fits.len();
        progress.start(bands(output) + maps as u64);
        if maps == 0 {
            stats.pixels = each_pixel(output, progress, |_| [1.0; 4]);
            return Ok(());
        }
        let size = job.params.map_size;
        stats.bytes = maps as u64 * u64::from(size) * u64::from(size) * size_of::<f32>() as u64;
        check_bytes(raster, job, stats.bytes)?;
        let start = Instant::now();
        if self.shadows.len() < maps {
            self.shadows.resize_with(maps, DepthMap::default);
        }
        let skies = job.scene.skies();
        for (fit, map) in cascades.fits.iter().zip(&mut self.shadows) {
            map.resize(size);
            let map_job = map_job(job, fit.view, None, square(size), Attachments::default());
            let drawn = raster.render(&map_job, &skies, Target::Depth(map), &progress.part())?;
            stats.triangles += drawn.triangles;
            progress.advance(1);
        }
        stats.maps = Some(Part { host: start.elapsed(), device: None });
        stats.map_count = maps as u32;
        let maps = &self.shadows;
        let map = |index: usize| maps[index].depths();
        let by_rays = job.params.border == Border::Rays;
        stats.pixels = each_pixel(output, progress, |index| {
            let [x, y, z, cos] = job.position[index];
            if cos <= 0.0 || cos.is_nan() {
                return [1.0; 4];
            }
            let position = Vec3::new(x, y, z);
            if by_rays {
                return match cascades.agreed(map, position, cos, &job.params) {
                    Some(true) => [1.0; 4],
                    Some(false) => [SHADOWED, SHADOWED, SHADOWED, 1.0],
                    None => [1.0, 1.0, 1.0, Answers::LEFT],
                };
            }
            let value = SHADOWED + (1.0 - SHADOWED) * cascades.lit_share(map, position, cos, &job.params);
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
        let Some(glazed) = glass_seen(job) else {
            progress.start(bands(output));
            stats.pixels = each_pixel(output, progress, |index| job.color[index]);
            return Ok(());
        };
        let maps = self.cube_maps(raster, job, bands(output), progress, stats)?;
        stats.pixels = each_pixel(output, progress, |index| {
            let color = glazed.contains(job.triangle[index]).then(|| {
                let (position, view, normal, probe) = maps.seen(job, index)?;
                Some(weighted(job, view, normal, |direction| maps.look_up(probe, position, direction)))
            });
            color.flatten().map_or(job.color[index], |color| color.extend(1.0).to_array())
        });
        Ok(())
    }

    /// Draws the cube maps of a picture that shows glass. `after` is the number of progress steps that follow the maps.
    fn cube_maps(
        &mut self,
        raster: &mut CpuRasteriser,
        job: &EffectJob<'_>,
        after: u64,
        progress: &Progress,
        stats: &mut EffectStats,
    ) -> Result<CubeMaps<'_>, BackendError> {
        let bounds = self.scene.bounds(job.scene);
        let panes = self.scene.panes(job.scene, job.glass);
        self.probes.choose(panes, &bounds, &job.view, job.params.probes);
        if job.params.parallax == Parallax::Box {
            self.scene.add_proxies(self.probes.chosen_mut(), |probe| find_proxy(raster, job, probe))?;
        }
        let probes = self.probes.chosen();
        let maps = probes.len() * cube::FACES;
        progress.start(after + maps as u64);
        let size = job.params.map_size;
        if probes.is_empty() {
            return Ok(CubeMaps { probes, faces: &[], size });
        }
        let bytes = maps as u64 * u64::from(size) * u64::from(size) * size_of::<[f32; 4]>() as u64;
        stats.bytes += bytes;
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
            let map_job = map_job(job, view, job.sun, square(size), attachments);
            raster.render(&map_job, job.glass, Target::Attachments(face, attachments), &progress.part())?;
            progress.advance(1);
        }
        stats.triangles += maps as u64 * unglazed(job);
        stats.map_count += probes.len() as u32;
        stats.maps = Some(Part { host: stats.maps.unwrap_or_default().host + start.elapsed(), device: None });
        Ok(CubeMaps { probes, faces: &self.faces, size })
    }

    /// Draws the mirrors one after the other into the same map, and copies each mirror's pixels from the map to the output.
    fn mirrors(
        &mut self,
        raster: &mut CpuRasteriser,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
        stats: &mut EffectStats,
    ) -> Result<(), BackendError> {
        let bounds = self.scene.bounds(job.scene);
        let glazing = self.scene.glazing(job.scene, job.glass).map_err(refused)?;
        progress.start(bands(output));
        let start = Instant::now();
        let survey = match glazing.runs.is_empty() {
            true => Survey::default(),
            false => Survey::new(job, glazing, &mut self.plane_of).map_err(refused)?,
        };
        let mirrors = Mirrors::choose(glazing, &survey, &bounds, &job.view, job.params.planes);
        let choosing = start.elapsed();
        stats.glass_pixels = mirrors.glass_pixels;
        progress.start(bands(output) + mirrors.chosen.len() as u64);
        stats.pixels = each_pixel(output, progress, |index| job.color[index]);
        stats.pixels.host += choosing;
        if mirrors.chosen.is_empty() {
            return Ok(());
        }
        let texels = |mirror: &Mirror| {
            let held = on_tiles(mirror.pixels, job);
            u64::from(held.width) * u64::from(held.height)
        };
        stats.bytes = mirrors.chosen.iter().map(texels).max().unwrap_or(0) * size_of::<[f32; 4]>() as u64;
        check_bytes(raster, job, stats.bytes)?;
        let attachments = Attachments { color: true, ..Attachments::default() };
        let whole = Rect { x: 0, y: 0, width: job.width, height: job.height };
        let mut drawing = std::time::Duration::ZERO;
        for mirror in &mirrors.chosen {
            let start = Instant::now();
            let held = on_tiles(mirror.pixels, job);
            let map = &mut self.mirror;
            (map.origin, map.width, map.height) = ([held.x, held.y], held.width, held.height);
            resize(&mut map.color, held.width as usize * held.height as usize, [0.0; 4]).map_err(refused)?;
            // Depth is that of the corners before snapping, as in the picture itself, so that the nearer of two close layers is seen.
            let map_job = RasterJob { snapped_depth: false, ..map_job(job, mirror.view, job.sun, whole, attachments) };
            raster.render(&map_job, job.glass, Target::Attachments(map, attachments), &progress.part())?;
            drawing += start.elapsed();
            let start = Instant::now();
            take(output, &self.plane_of, mirror, map);
            stats.pixels.host += start.elapsed();
            progress.advance(1);
        }
        stats.map_count = mirrors.chosen.len() as u32;
        stats.triangles = u64::from(stats.map_count) * unglazed(job);
        stats.maps = Some(Part { host: drawing, device: None });
        Ok(())
    }
}

/// The smallest rectangle of whole tiles of the picture that contains the pixels.
fn on_tiles(pixels: Rect, job: &EffectJob<'_>) -> Rect {
    let axis = |first: u32, count: u32, side: u32| {
        let start = first / ALIGNMENT * ALIGNMENT;
        (start, (first + count).next_multiple_of(ALIGNMENT).min(side) - start)
    };
    let (x, width) = axis(pixels.x, pixels.width, job.width);
    let (y, height) = axis(pixels.y, pixels.height, job.height);
    Rect { x, y, width, height }
}

/// Copies the output pixels that show a mirror from the mirror's map.
fn take(output: &mut Image, plane_of: &[u32], mirror: &Mirror, map: &GBuffer) {
    let width = output.width as usize;
    let Rect { x, y, width: columns, height: rows } = mirror.pixels;
    let (first, last) = (y as usize * width, (y + rows) as usize * width);
    let shown = output.pixels[first..last].par_chunks_mut(width).zip(plane_of[first..last].par_chunks(width));
    shown.enumerate().with_min_len(8).for_each(|(row, (pixels, planes))| {
        let from = (y - map.origin[1]) as usize + row;
        let texels = &map.color[from * map.width as usize..][(x - map.origin[0]) as usize..][..columns as usize];
        let columns = x as usize..(x + columns) as usize;
        for ((pixel, plane), [r, g, b, _]) in pixels[columns.clone()].iter_mut().zip(&planes[columns]).zip(texels) {
            if *plane == mirror.plane {
                *pixel = [*r, *g, *b, 1.0];
            }
        }
    });
}

/// Number of triangles drawn into a map of an effect on glass: those that are not glass.
fn unglazed(job: &EffectJob<'_>) -> u64 {
    let seen = job.scene.geometry.batches.iter().filter(|batch| job.glass.get(batch.material as usize) != Some(&true));
    seen.map(|batch| u64::from(batch.count)).sum()
}

/// The viewport of a square map.
fn square(size: u32) -> Rect {
    Rect { x: 0, y: 0, width: size, height: size }
}

/// The glass triangles of the scene; `None` if no pixel shows glass, so that no map is needed.
fn glass_seen(job: &EffectJob<'_>) -> Option<TriangleRanges> {
    let glazed = TriangleRanges::new(&job.scene.geometry, job.glass);
    let seen = !glazed.as_slice().is_empty() && job.triangle.par_iter().any(|id| glazed.contains(*id));
    seen.then_some(glazed)
}

/// The drawn cube maps.
struct CubeMaps<'a> {
    probes: &'a [Probe],
    /// The faces, probe by probe, six for each.
    faces: &'a [GBuffer],
    size: u32,
}

impl CubeMaps<'_> {
    /// For a glass pixel: its position, the viewing direction, the normal, and the index of the nearest probe. `None` if there is no probe,
    /// or [`effects::facing`] is `None`.
    fn seen(&self, job: &EffectJob<'_>, index: usize) -> Option<(Vec3, Vec3, Vec3, usize)> {
        let [position, normal] =
            [job.position[index], job.normal[index]].map(|value| Vec4::from_array(value).truncate());
        let probe = nearest(self.probes, position)?;
        let (view, normal) = effects::facing(job.view.eye, position, normal)?;
        Some((position, view, normal, probe))
    }

    fn look_up(&self, probe: usize, position: Vec3, direction: Vec3) -> Vec3 {
        let (face, at) = cube::locate(self.probes[probe].toward(position, direction));
        cube::sample(&self.faces[probe * cube::FACES + face].color, self.size, at)
    }
}

/// The colour of glass: the reflected colour or, if the program refracts, the sum of the reflected and the refracted
/// colour, each times its Fresnel weight. `look_up` returns the colour in a direction.
fn weighted(job: &EffectJob<'_>, view: Vec3, normal: Vec3, mut look_up: impl FnMut(Vec3) -> Vec3) -> Vec3 {
    let reflected = reflect(view, normal);
    if !job.program.refracts() {
        return look_up(reflected);
    }
    let interface = interface(job.params.fresnel, -normal.dot(view), job.params.index);
    let mut color = Vec3::ZERO;
    if interface.reflectance > 0.0 {
        color += interface.reflectance * look_up(reflected);
    }
    if let Some(refracted) = interface.refract(view, normal, job.params.index) {
        color += (1.0 - interface.reflectance) * look_up(refracted);
    }
    color
}

/// Refuses maps that would take too much memory.
fn check_bytes(raster: &CpuRasteriser, job: &EffectJob<'_>, bytes: u64) -> Result<(), BackendError> {
    effects::check_map_bytes(job.program, bytes).map_err(|why| BackendError::Unsupported {
        backend: raster.name(),
        what: job.program.info().name.to_owned(),
        why,
    })
}

/// The box that approximates a probe's surroundings. The device's effects call this, too, so that boxes are the same on
/// every backend.
pub(in crate::raster) fn find_proxy(
    raster: &mut CpuRasteriser,
    job: &EffectJob<'_>,
    probe: &Probe,
) -> Result<Proxy, BackendError> {
    Proxy::find(&probe.eye(), |view, buffer| {
        let map_job = map_job(job, view, None, square(proxy::FACE), proxy::ATTACHMENTS);
        // Not cancelled with the frame, because proxies are kept for later frames.
        let progress = Progress::default();
        raster.render(&map_job, job.glass, Target::Attachments(buffer, proxy::ATTACHMENTS), &progress).map(drop)
    })
}

/// A job that draws the scene of `job` into a map.
fn map_job<'a>(
    job: &EffectJob<'a>,
    view: View,
    sun: Option<Sun>,
    viewport: Rect,
    attachments: Attachments,
) -> RasterJob<'a> {
    RasterJob {
        scene: job.scene,
        program: RasterProgram::Deferred,
        view,
        lights: &[],
        sun,
        shades: job.shades,
        // Maps show what rays hit, so both sides of every triangle are drawn.
        culled: &[],
        viewport,
        clear_color: Vec4::ZERO,
        attachments,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: true,
        load_store: LoadStore::default(),
    }
}

fn bands(output: &Image) -> u64 {
    u64::from(output.height).div_ceil(BLOCK as u64)
}

/// Computes every pixel from its index, on all threads.
fn each_pixel(output: &mut Image, progress: &Progress, pixel: impl Fn(usize) -> [f32; 4] + Sync) -> Part {
    let width = output.width as usize;
    each_span(output, progress, |x, y, pixels| {
        let first = y as usize * width + x as usize;
        for (index, out) in (first..).zip(pixels) {
            *out = pixel(index);
        }
    })
}

/// Computes all rows on all threads, in spans of up to [`BLOCK`] pixels. `span` gets the column and row of its first
/// pixel, and the pixels.
fn each_span(output: &mut Image, progress: &Progress, span: impl Fn(u32, u32, &mut [[f32; 4]]) + Sync) -> Part {
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
                    span(left as u32, (first_row + row) as u32, &mut pixels[left..right]);
                }
            }
            progress.advance(1);
        });
    }
    Part { host: start.elapsed(), device: None }
}
