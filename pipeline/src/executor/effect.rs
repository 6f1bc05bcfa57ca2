//! Effect passes: raster effects on the G-buffer that the rasteriser drew.

use super::{Observer, Progress, Renderer, StepKind, channel_of};
use crate::backend::{BackendError, EffectJob, EffectStats, GBuffer};
use crate::image::Image;
use crate::memory::mebibytes;
use crate::plan::{PlannedPass, Work};
use crate::project::{ChannelRef, EffectPass, PassKind};
use std::sync::Arc;
use std::time::Duration;

impl Renderer {
    pub(super) fn effect(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let Work::Effect { scene_set, view, params, reads_triangle, resident } = planned.work else { return Ok(()) };
        let pass = self.plan.pass(planned);
        let (PassKind::Effect(effect), Some(target)) = (&pass.kind, pass.target) else { return Ok(()) };
        let effect = effect.clone();
        self.upload(scene_set, observer)?;
        let buffer = std::mem::take(&mut self.targets[target]);
        let mut output = Image { width: buffer.width, height: buffer.height, pixels: buffer.color };
        // What the rasteriser keeps to itself was not copied into the targets.
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
            sun: effect.light.filter(|_| info.lit).and_then(|light| self.sun(light)),
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
        let progress = Arc::new(Progress::until(&self.cancellation));
        observer.begin(StepKind::Effect, name, &progress);
        let computed = self.engines.raster.effect(&job, &mut output, &progress);
        observer.end();
        self.targets[target] = GBuffer { color: output.pixels, ..buffer };
        self.round_to_formats(Some(target));
        self.record_effect(name, &effect, computed?);
        Ok(())
    }

    /// Maps, pixels and copies are steps of their own.
    fn record_effect(&mut self, name: &str, effect: &EffectPass, stats: EffectStats) {
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
        if let Some(transfer) = stats.transfer {
            self.timeline.record(StepKind::ReadBack, name, transfer);
        }
    }
}
