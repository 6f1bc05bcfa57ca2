//! Screen-space rays from glass.

use super::super::{CpuRasteriser, refused};
use super::{Effects, Target, bands, check_bytes, each_pixel, each_span, glass_seen, map_job, unglazed, weighted};
use crate::raster::effects::facing;
use crate::raster::effects::panes::nearest;
use crate::raster::effects::screen::camera::ScreenCamera;
use crate::raster::effects::screen::march::{Answer, Screen};
use curitiba_pipeline::backend::{Answers, Attachments, BackendError, EffectJob, EffectStats, Part, RasterJob, Rect};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::gbuffer::GBuffer;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::raster_effects::Missing;
use glam::{Vec3, Vec4};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Instant;

impl Effects {
    /// Finds the colours that the rays of every glass pixel hit in the picture; with refraction, in the picture as it would
    /// be without the glass.
    pub(super) fn screen(
        &mut self,
        raster: &mut CpuRasteriser,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
        stats: &mut EffectStats,
    ) -> Result<(), BackendError> {
        stats.answers = Some(Answers::default());
        let camera = ScreenCamera::new(&job.view, job.width, job.height);
        let (Some(glazed), Some(camera)) = (glass_seen(job), camera) else {
            progress.start(bands(output));
            stats.pixels = each_pixel(output, progress, |index| job.color[index]);
            return Ok(());
        };
        let refracts = job.program.refracts();
        let mut behind = std::mem::take(&mut self.behind);
        if refracts {
            draw_behind(raster, job, &mut behind, progress, stats)?;
        }
        let mut pyramid = std::mem::take(&mut self.pyramid);
        let (position, normal, color): (&[_], &[_], &[_]) = match refracts {
            true => (&behind.position, &behind.normal, &behind.color),
            false => (job.position, job.normal, job.color),
        };
        let size = [job.width, job.height];
        let start = Instant::now();
        pyramid.build(&camera, size, position, normal).map_err(refused)?;
        let building = start.elapsed();
        let cubes = match job.params.missing {
            Missing::Cube => Some(self.cube_maps(raster, job, bands(output), progress, stats)?),
            Missing::Own | Missing::Rays => {
                progress.start(bands(output));
                None
            }
        };
        let screen = Screen {
            camera: &camera,
            size,
            position,
            normal,
            pyramid: &pyramid,
            glass: (!refracts).then_some((job.triangle, &glazed)),
            thickness: job.params.thickness,
        };
        let rays_stand_in = job.params.missing == Missing::Rays;
        // Counts of glass pixels, of glass pixels whose rays all hit a surface of the picture or leave the scene, and of glass pixels that
        // keep some of their own colour.
        let counts = [const { AtomicU64::new(0) }; 3];
        let mut part = each_span(output, progress, |x, y, pixels| {
            let mut here = [0; 3];
            let first = y as usize * job.width as usize + x as usize;
            for (index, out) in (first..).zip(pixels) {
                *out = job.color[index];
                if !glazed.contains(job.triangle[index]) {
                    continue;
                }
                here[0] += 1;
                let at = |buffer: &[[f32; 4]]| Vec4::from_array(buffer[index]).truncate();
                let (place, own) = (at(job.position), at(job.color));
                let (mut missing, mut keeps) = (false, false);
                if let Some((view, facing)) = facing(job.view.eye, place, at(job.normal)) {
                    let probe = cubes.as_ref().and_then(|cubes| nearest(cubes.probes, place));
                    let shown = weighted(job, view, facing, |direction| match screen.ask(place, direction, refracts) {
                        Answer::Pixel(pixel) => Vec4::from_array(color[pixel]).truncate(),
                        Answer::Nothing => Vec3::ZERO,
                        Answer::Missing => {
                            missing = true;
                            match (&cubes, probe) {
                                (Some(cubes), Some(probe)) => cubes.look_up(probe, place, direction),
                                _ => {
                                    keeps = true;
                                    own
                                }
                            }
                        }
                    });
                    *out = shown.extend(1.0).to_array();
                } else {
                    (missing, keeps) = (true, true);
                }
                if missing && rays_stand_in {
                    *out = own.extend(Answers::LEFT).to_array();
                } else {
                    here[1] += u64::from(!missing);
                    here[2] += u64::from(keeps);
                }
            }
            if here[0] > 0 {
                counts.iter().zip(here).for_each(|(all, here)| _ = all.fetch_add(here, Relaxed));
            }
        });
        part.host += building;
        stats.pixels = part;
        stats.answers = Some(Answers::new(counts.map(AtomicU64::into_inner), job.params.missing));
        (self.pyramid, self.behind) = (pyramid, behind);
        Ok(())
    }
}

/// Draws the picture as it would be without the glass.
fn draw_behind(
    raster: &mut CpuRasteriser,
    job: &EffectJob<'_>,
    behind: &mut GBuffer,
    progress: &Progress,
    stats: &mut EffectStats,
) -> Result<(), BackendError> {
    let attachments = Attachments { color: true, position: true, normal: true, triangle: false };
    let pixels = u64::from(job.width) * u64::from(job.height);
    stats.bytes = pixels * 3 * size_of::<[f32; 4]>() as u64;
    check_bytes(raster, job, stats.bytes)?;
    let start = Instant::now();
    if (behind.width, behind.height) != (job.width, job.height) {
        // The old buffer is freed first, so that both need not fit in memory at once.
        *behind = GBuffer::default();
        *behind = GBuffer::try_new(job.width, job.height, attachments).map_err(refused)?;
    }
    let whole = Rect { x: 0, y: 0, width: job.width, height: job.height };
    // Depth is that of the corners before snapping, as in the picture itself, so that the nearer of two close layers is seen.
    let map_job = RasterJob { snapped_depth: false, ..map_job(job, job.view, job.sun, whole, attachments) };
    raster.render(&map_job, job.glass, Target::Attachments(behind, attachments), &progress.part())?;
    stats.maps = Some(Part { host: start.elapsed(), device: None });
    (stats.map_count, stats.triangles) = (1, unglazed(job));
    Ok(())
}
