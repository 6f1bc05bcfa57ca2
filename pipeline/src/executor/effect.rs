//! Effect passes: raster effects on the G-buffer.

use super::rays::Traced;
use super::{Observer, RenderError, Renderer, StepKind, channel_of};
use crate::backend::{Answers, BackendError, EffectJob, EffectStats, GBuffer, NO_TRIANGLE, RayJob};
use crate::image::Image;
use crate::memory::{self, mebibytes};
use crate::plan::{PlannedPass, Work};
use crate::project::{ChannelRef, EffectPass, PassKind};
use crate::scene::TriangleRanges;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::{Duration, Instant};

impl Renderer {
    /// Runs an effect, and traces the pixels that it leaves to rays. If a backend fails, an allowed fallback takes over.
    pub(super) fn effect(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<Traced, RenderError> {
        let (Work::Effect { scene_set, .. }, Some(target)) = (&planned.work, self.plan.pass(planned).target) else {
            return Ok(Traced::Done);
        };
        let frame = Some(self.frame);
        let failed = |error| RenderError::Pass { pass: name.to_owned(), frame, error };
        let left = self.by_raster(index, planned, name, observer).map_err(failed)?;
        let traced = match left {
            0 => Traced::Done,
            _ => self.left_to_rays(index, planned, *scene_set, name, observer)?,
        };
        if !self.stays(index) {
            self.round_to_formats(Some(target));
        }
        Ok(traced)
    }

    /// Builds the acceleration structure that tracing needs, and traces.
    fn left_to_rays(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        scene_set: usize,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<Traced, RenderError> {
        self.build_and_trace(scene_set, name, observer, |renderer, observer| {
            renderer.trace_left(index, planned, name, observer)
        })
    }

    /// Runs the raster part of an effect, into a target that is not yet rounded to its format. Returns the number of pixels that are
    /// left to rays.
    fn by_raster(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<u64, BackendError> {
        let Work::Effect { scene_set, view, params, reads_triangle, resident } = planned.work else { return Ok(0) };
        let pass = self.plan.pass(planned);
        let (PassKind::Effect(effect), Some(target)) = (&pass.kind, pass.target) else { return Ok(0) };
        let effect = effect.clone();
        self.upload(scene_set, observer)?;
        let buffer = std::mem::take(&mut self.targets[target]);
        let mut output = Image { width: buffer.width, height: buffer.height, pixels: buffer.color };
        // Attachments that the rasteriser keeps on its device were not copied into the targets.
        let in_host = !(resident && self.engines.raster.needs_read_back());
        let info = effect.program.info();
        let targets = &self.targets;
        let read = |channel: Option<ChannelRef>, name: &str| match channel {
            Some(channel) if in_host && info.buffers.contains(&name) => {
                channel_of(&targets[channel.target], channel.channel)
            }
            _ => &[],
        };
        let triangle = match effect.position {
            Some(position) if in_host && reads_triangle => targets[position.target].triangle.as_slice(),
            _ => &[],
        };
        let scene = Arc::clone(&self.scenes[scene_set].scene);
        let materials = &self.materials[index];
        let job = EffectJob {
            scene: &scene,
            program: effect.program,
            params,
            seed: self.seed_of_sample(),
            view,
            sun: if info.lit { self.plan.shining(&effect.lights).sun } else { None },
            width: output.width,
            height: output.height,
            resident,
            position: read(effect.position, "pos_buffer"),
            normal: read(effect.normal, "norm_buffer"),
            color: read(effect.color, "color_buffer"),
            triangle,
            shades: &materials.shades,
            glass: &materials.glass,
        };
        let progress = self.progress();
        observer.begin(StepKind::Effect, name, &progress);
        let computed = match self.stays(index) {
            true => self.engines.raster.effect_in_place(&job, target, &progress),
            false => self.engines.raster.effect(&job, &mut output, &progress),
        };
        observer.end();
        self.given_up |= progress.is_given_up();
        self.targets[target] = GBuffer { color: output.pixels, ..buffer };
        let stats = computed?;
        let left = match stats.answers {
            _ if !params.leaves_to_rays(effect.program) => 0,
            Some(answers) => answers.rays,
            None => self.targets[target].color.par_iter().filter(|color| color[3] == Answers::LEFT).count() as u64,
        };
        self.record_effect(name, &effect, stats, left);
        Ok(left)
    }

    /// Traces the pixels that an effect left to the ray backend, and no others.
    fn trace_left(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let Work::Effect { scene_set, view, .. } = planned.work else { return Ok(()) };
        let pass = self.plan.pass(planned);
        let (PassKind::Effect(effect), Some(target)) = (&pass.kind, pass.target) else { return Ok(()) };
        let (Some(traced), Some(position)) = (self.plan.traced(planned), effect.position) else { return Ok(()) };
        let Some((program, params)) = traced.program else { return Ok(()) };
        let backend = self.engines.rays_of(name).name();
        let refused = |refused: memory::Refused| BackendError::Device { backend, message: refused.to_string() };
        let materials = &self.materials[index];
        let scene = Arc::clone(&self.scenes[scene_set].scene);
        let glazed = TriangleRanges::new(&scene.geometry, &materials.glass);
        let of_glass = effect.program.info().glass;
        let is_left =
            |triangle: u32, color: &[f32; 4]| color[3] == Answers::LEFT && (!of_glass || glazed.contains(triangle));
        let (ids, written) = (&self.targets[position.target].triangle, &self.targets[target]);
        let mut triangle = memory::with_capacity(ids.len()).map_err(refused)?;
        let left = ids.iter().zip(&written.color);
        triangle.extend(left.map(|(id, color)| if is_left(*id, color) { *id } else { NO_TRIANGLE }));
        let (width, height) = (written.width, written.height);
        let mut output =
            Image { width, height, pixels: memory::zeroed(width as usize * height as usize).map_err(refused)? };
        let read = |channel: Option<ChannelRef>, name: &str| match channel {
            Some(channel) if program.info().buffers.contains(&name) => {
                channel_of(&self.targets[channel.target], channel.channel)
            }
            _ => &[],
        };
        let (params, seed) = self.random_of_sample(name, program, params);
        let job = RayJob {
            scene: &scene,
            program,
            params,
            fidelity: self.plan.settings.fidelity,
            seed,
            eye: view.eye,
            cone: self.pixel_cone(&view, self.plan.target_size(Some(target))),
            sun: self.plan.shining(&effect.lights).sun,
            lights: &[],
            from_camera: None,
            origin: written.origin,
            width,
            height,
            position: read(effect.position, "pos_buffer"),
            normal: read(effect.normal, "norm_buffer"),
            color: read(effect.color, "color_buffer"),
            triangle: &triangle,
            shared: None,
            beyond: Vec3::ZERO,
            dielectrics: &materials.dielectrics,
            shades: &materials.shades,
            glass: &materials.glass,
            shadow_glass: &materials.shadow_glass,
        };
        let progress = self.progress();
        observer.begin(StepKind::Rays, name, &progress);
        let start = Instant::now();
        let result = self.engines.rays_of_mut(name).run(&job, &mut output, &progress);
        let elapsed = start.elapsed();
        observer.end();
        let stats = result?;
        self.given_up |= progress.is_given_up();
        if self.given_up {
            return Ok(());
        }
        for ((pixel, traced), id) in self.targets[target].color.iter_mut().zip(&output.pixels).zip(&triangle) {
            if *id != NO_TRIANGLE {
                *pixel = *traced;
            }
        }
        if let Some(upload) = stats.upload {
            self.timeline.record(StepKind::Join, name, upload).note = "copied from the host".to_owned();
        }
        let unanswered =
            if of_glass { "for what the screen does not answer" } else { "where tests of the maps differ" };
        let what = format!("{} on {backend}, {unanswered}", program.info().stem);
        self.record_rays(name, elapsed, stats, &what, self.taken > 0);
        Ok(())
    }

    /// Records maps, pixels and copies of an effect as separate steps.
    fn record_effect(&mut self, name: &str, effect: &EffectPass, stats: EffectStats, left: u64) {
        let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
        let (program, engine) = (effect.program.info().name, self.engines.raster.name());
        if let Some(maps) = stats.maps {
            let row = self.timeline.record(StepKind::Maps, name, maps.host);
            row.device_ms.extend(maps.device.map(milliseconds));
            row.bytes = stats.bytes;
            let plural = if stats.map_count == 1 { "" } else { "s" };
            row.note =
                format!("{} map{plural}, {} triangles, {}", stats.map_count, stats.triangles, mebibytes(stats.bytes));
        }
        let row = self.timeline.record(StepKind::Effect, name, stats.pixels.host);
        row.device_ms.extend(stats.pixels.device.map(milliseconds));
        row.note = format!("{program} on {engine}");
        let [glass, without] = stats.glass_pixels;
        if without > 0 {
            let percent = 100.0 * without as f64 / glass as f64;
            row.note += &format!(", {without} of {glass} pixels of glass ({percent:.2} %) in no mirror");
        }
        if let Some(answers) = stats.answers {
            row.note += &format!(", {answers}");
            row.answers = Some(answers);
        } else if left > 0 {
            row.note += &format!(", {left} pixels left to rays");
        }
        if let Some(transfer) = stats.transfer {
            self.timeline.record(StepKind::ReadBack, name, transfer);
        }
    }
}
