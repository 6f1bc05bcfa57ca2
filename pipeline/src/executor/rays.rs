//! Ray passes: building their acceleration structure, and running them.

use super::{Estimate, Observer, RenderError, Renderer, Row, StepKind, channel_of};
use crate::backend::{BackendError, FromCamera, GBuffer, PixelCone, RayCounts, RayJob, RayStats, View};
use crate::camera_programs::with_gamma;
use crate::image::Image;
use crate::plan::{PlannedPass, Shining, Work};
use crate::project::{ChannelRef, PassKind};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The estimate to which a batch is added before rounding to the target's format, and the batch's number of samples. `None` for
/// ordinary frames.
pub(super) type Batch<'a> = Option<(&'a mut Estimate, u32)>;

/// Outcome of a pass that may trace rays.
pub(super) enum Traced {
    /// The pass is done.
    Done,
    /// A fallback that reads host memory took over, and the G-buffer is not in host memory: all passes of the frame must run again.
    NothingInHost,
}

impl Renderer {
    /// Builds the acceleration structure for a ray pass, and runs the pass. If a backend fails, an allowed fallback takes over.
    pub(super) fn rays(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        scene_set: usize,
        name: &str,
        mut batch: Batch<'_>,
        observer: &mut dyn Observer,
    ) -> Result<Traced, RenderError> {
        self.build_and_trace(scene_set, name, observer, |renderer, observer| {
            renderer.trace(index, planned, name, &mut batch, observer)
        })
    }

    /// Builds the acceleration structure for a pass, and calls `trace`. If a backend fails, an allowed fallback takes over.
    pub(super) fn build_and_trace(
        &mut self,
        scene_set: usize,
        name: &str,
        observer: &mut dyn Observer,
        mut trace: impl FnMut(&mut Self, &mut dyn Observer) -> Result<(), BackendError>,
    ) -> Result<Traced, RenderError> {
        let before = (self.joined, self.in_place().is_some());
        loop {
            self.build_or_stand_in(scene_set, name, observer)?;
            if (self.joined, self.in_place().is_some()) != before {
                return Ok(Traced::NothingInHost);
            }
            match trace(self, observer) {
                Ok(()) => return Ok(Traced::Done),
                Err(_) if self.cancellation.is_cancelled() => return Err(RenderError::Cancelled),
                Err(error) => self.stand_in(name, error, observer)?,
            }
        }
    }

    pub(super) fn trace(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        name: &str,
        batch: &mut Batch<'_>,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let Work::Rays { scene_set, view, viewport, params, beyond, reads_triangle, resident } = planned.work else {
            return Ok(());
        };
        let mut shares = match reads_triangle && batch.is_none() {
            true => self.shares_of(index, planned, name)?,
            false => None,
        };
        let pass = self.plan.pass(planned);
        let (PassKind::Ray(ray), Some(target)) = (&pass.kind, pass.target) else { return Ok(()) };
        let ray = ray.clone();
        let in_host = !self.is_joined(resident);
        let buffer = std::mem::take(&mut self.targets[target]);
        let mut output = Image { width: buffer.width, height: buffer.height, pixels: buffer.color };
        let targets = &self.targets;
        let read = |channel: Option<ChannelRef>, name: &str| match channel {
            Some(channel) if in_host && ray.program.info().buffers.contains(&name) => {
                channel_of(&targets[channel.target], channel.channel)
            }
            _ => &[],
        };
        let colors = read(ray.color, "color_buffer");
        let triangle = match ray.position {
            Some(position) if in_host && reads_triangle => targets[position.target].triangle.as_slice(),
            _ => &[],
        };
        let triangle = match &mut shares {
            Some(shares) => shares.traced(self.taken, triangle),
            None => triangle,
        };
        let materials = &self.materials[index];
        let scene = Arc::clone(&self.scenes[scene_set].scene);
        let (mut params, seed) = self.random_of_sample(name, ray.program, params);
        let linear = pass.kind.linear();
        // With a linear buffer the gamma is applied after tracing. An accumulation applies it to the mean of its batches.
        let gamma = params.camera.gamma;
        if linear.is_some() {
            params.camera.gamma = 1.0;
        }
        let is_lamp = ray.from_camera.as_ref().is_some_and(|start| start.lamp);
        let shining = if is_lamp { Shining::default() } else { self.plan.shining(&ray.lights) };
        let job = RayJob {
            scene: &scene,
            program: ray.program,
            params,
            fidelity: self.plan.settings.fidelity,
            seed,
            eye: view.eye,
            cone: self.pixel_cone(&view, [viewport.width, viewport.height]),
            sun: shining.sun,
            lights: &shining.lights,
            origin: buffer.origin,
            width: output.width,
            height: output.height,
            position: read(ray.position, "pos_buffer"),
            normal: read(ray.normal, "norm_buffer"),
            color: colors,
            triangle,
            shared: (!in_host).then_some(self.handed_over),
            beyond,
            dielectrics: &materials.dielectrics,
            shades: &materials.shades,
            glass: &materials.glass,
            shadow_glass: &materials.shadow_glass,
            from_camera: ray.from_camera.as_ref().map(|start| FromCamera {
                view,
                picture: self.plan.target_size(pass.target),
                lamp: ray.lights.first().filter(|_| start.lamp).and_then(|light| self.lamp(*light)),
                surfaces: &materials.surfaces,
            }),
        };
        let progress = self.progress();
        observer.begin(StepKind::Rays, name, &progress);
        let start = Instant::now();
        let stays = self.stays(index);
        let traced = match stays {
            true => self.engines.rays_of_mut(name).run_in_place(&job, target, &progress),
            false => self.engines.rays_of_mut(name).run(&job, &mut output, &progress),
        };
        let elapsed = start.elapsed();
        observer.end();
        self.given_up |= progress.is_given_up();
        if traced.is_ok() && in_host && !stays {
            observer.traced(name, &job, &output);
        }
        if let (Ok(_), Some(shares)) = (&traced, &mut shares) {
            shares.take(&mut output.pixels, colors, output.width, self.taken);
        }
        if let (Ok(_), Some(buffer), None) = (&traced, linear, &batch) {
            self.fill_linear(buffer, output.width, &output.pixels);
            output.pixels.par_iter_mut().for_each(|pixel| {
                let [r, g, b, a] = *pixel;
                *pixel = with_gamma(Vec3::new(r, g, b), gamma).extend(a).to_array();
            });
        }
        let mut sums = self.part > 0 || self.taken > 0;
        let given_up = self.given_up || self.cancellation.is_cancelled();
        if let (Ok(_), Some((estimate, samples)), false) = (&traced, batch, given_up) {
            sums |= estimate.batches() > 0;
            estimate.add(&output.pixels, *samples);
        }
        self.targets[target] = GBuffer { color: output.pixels, ..buffer };
        if !stays {
            self.round_to_formats(Some(target));
        }
        let stats = traced?;
        if let Some(upload) = stats.upload {
            let from = if in_host { "copied from the host" } else { "copied from GPU to GPU" };
            self.timeline.record(StepKind::Join, name, upload).note = from.to_owned();
        }
        let what = format!("{} on {}", ray.program.info().stem, self.engines.rays_of(name).name());
        self.record_rays(name, elapsed, stats, &what, sums);
        if let Some(shares) = shares {
            self.keep_shares(index, name, shares);
        }
        Ok(())
    }
}

impl Renderer {
    /// The ray cone of one sample of a pixel, for a viewport of this width and height in pixels. The cone covers the sample's part of the
    /// pixel.
    pub(super) fn pixel_cone(&self, view: &View, size: [u32; 2]) -> PixelCone {
        PixelCone::of(&View { footprint: self.samples().side(), ..*view }, size)
    }

    /// Records rays and their copy to the host as separate steps. `what` names program and backend; with `sums` the rays are added to those
    /// of earlier runs in this frame.
    pub(super) fn record_rays(&mut self, name: &str, elapsed: Duration, stats: RayStats, what: &str, sums: bool) {
        let copies = stats.upload.unwrap_or_default() + stats.read_back.unwrap_or_default();
        self.forget_held_bytes(name);
        let row = self.timeline.record(StepKind::Rays, name, elapsed.saturating_sub(copies));
        row.device_ms.extend(stats.device_time.map(|time| time.as_secs_f64() * 1e3));
        let mut rays = stats.rays;
        if sums {
            rays += row.rays.unwrap_or_default();
        }
        row.rays = Some(rays);
        row.all_samples = None;
        row.bytes = stats.held_bytes;
        row.note = format!("{what}{}", by_kind(rays));
        row.adaptive = match (stats.adaptive, row.adaptive.filter(|_| sums)) {
            (Some(spent), Some(before)) => Some(before.together(spent)),
            (spent, before) => spent.or(before),
        };
        if let Some(spent) = row.adaptive {
            row.note += &format!("; {spent}");
        }
        // After a fallback the row contains times of two backends: the note names the failed backend and the frame of its failure.
        for fallback in &self.engines.fallbacks {
            if let Some(frame) = fallback.frame.filter(|frame| *frame > 1) {
                row.note += &format!("; before frame {frame} on {}", fallback.failed);
            }
        }
        if let Some(read_back) = stats.read_back {
            self.timeline.record(StepKind::ReadBack, name, read_back);
        }
    }

    /// Clears the held bytes in all rows of the ray backend that the pass `name` uses. A backend holds memory for all its passes together,
    /// so only the row that is recorded last shows the bytes.
    fn forget_held_bytes(&mut self, name: &str) {
        let engines = &self.engines;
        let of_backend = |row: &&mut Row| row.kind == StepKind::Rays && engines.is_shared(&row.name, name);
        self.timeline.rows.iter_mut().filter(of_backend).for_each(|row| row.bytes = 0);
    }
}

/// Counts by kind, such as `: 12 shadow, 3 reflected`, without kinds that were not traced.
fn by_kind(rays: RayCounts) -> String {
    let kinds = [
        (rays.camera, "from the camera"),
        (rays.buffer, "from a buffer"),
        (rays.shadow, "shadow"),
        (rays.occlusion, "occlusion"),
        (rays.reflected, "reflected"),
        (rays.refracted, "refracted"),
        (rays.certain, "occlusion certain without"),
        (rays.lost, "lost in glass"),
    ];
    let mut traced: Vec<String> =
        kinds.iter().filter(|(count, _)| *count > 0).map(|(count, kind)| format!("{count} {kind}")).collect();
    if !rays.photons.is_empty() {
        traced.push(rays.photons.to_string());
    }
    if traced.is_empty() { String::new() } else { format!(": {}", traced.join(", ")) }
}
