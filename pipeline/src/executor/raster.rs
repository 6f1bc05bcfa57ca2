//! Raster passes.

use super::storage::give;
use super::{Observer, PassMaterials, Renderer, StepKind, channel_of, parts, shaders};
use crate::backend::{Attachments, BackendError, OwnShaders, QuadTexture, RasterJob};
use crate::memory;
use crate::plan::{PlannedPass, Shining, Work};
use crate::programs::Fidelity;
use crate::project::PassKind;
use std::sync::Arc;
use std::time::{Duration, Instant};

impl Renderer {
    pub(super) fn raster(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let Work::Raster { scene_set, view, viewport, clear_color, attachments, host, traced, load_store } =
            planned.work
        else {
            return Ok(());
        };
        let pass = self.plan.pass(planned);
        let PassKind::Raster(raster) = &pass.kind else { return Ok(()) };
        let (program, target) = (raster.program, pass.target);
        let (sampled, instances) = (shaders::own_channels(raster), raster.instances);
        let bound = shaders::own_bound(pass);
        let clamped = self.plan.project.is_of_light(raster.camera);
        let Shining { sun, lights } = self.plan.shining(&raster.lights);
        self.upload(scene_set, observer)?;
        let mut buffer = std::mem::take(self.buffer(target));
        let scene = Arc::clone(&self.scenes[scene_set].scene);
        let mut buffers: Vec<_> = bound.iter().map(|bound| self.take_bound(*bound, planned.pass)).collect();
        let PassMaterials { shades, culled, .. } = &self.materials[index];
        let (shared, half) = (self.in_shared_memory(target, traced), self.half_floats(target));
        let blocks = self.blocks(view, viewport, &buffer);
        let (own_programs, own_materials) = self.own_shaders(index, planned);
        let sampled = if own_materials.is_empty() { Vec::new() } else { sampled };
        let channels: Vec<QuadTexture<'_>> = sampled
            .iter()
            .map(|channel| {
                let read = &self.targets[channel.target];
                let texels = channel_of(read, channel.channel);
                QuadTexture::Channel { width: read.width, height: read.height, texels }
            })
            .collect();
        let depth = target.and_then(|target| self.plan.project.targets[target].depth());
        // `clamped`: depth maps keep occluders between the light and the view volume, as in the report's engine.
        let (programs, materials, channels) = (&own_programs[..], &own_materials[..], &channels[..]);
        let own = OwnShaders { programs, materials, channels, depth, clamped, instances };
        let job = RasterJob {
            scene: &scene,
            program,
            view,
            sun,
            lights: &lights,
            shades,
            culled,
            viewport,
            clear_color,
            attachments,
            shared,
            half,
            snapped_depth: self.plan.settings.fidelity == Fidelity::Thesis,
            load_store,
        };
        if load_store.store_depth || load_store.load_depth {
            let pixels = buffer.width as usize * buffer.height as usize;
            if let Err(refused) = memory::resize(&mut buffer.depth, pixels, 0.0) {
                bound.iter().zip(buffers).for_each(|(bound, bytes)| give(&mut self.targets, *bound, bytes));
                *self.buffer(target) = buffer;
                return Err(BackendError::Device { backend: self.engines.raster.name(), message: refused.to_string() });
            }
        }
        if self.plan.block.is_some() {
            let progress = self.progress();
            let (host, raster) = (self.in_host(target, host, traced), &mut self.engines.raster);
            observer.begin(StepKind::Raster, name, &progress);
            let start = Instant::now();
            let drawn = parts::draw_blocks(raster.as_mut(), &job, &blocks, host, &mut buffer, &progress);
            let elapsed = start.elapsed();
            observer.end();
            bound.iter().zip(buffers).for_each(|(bound, bytes)| give(&mut self.targets, *bound, bytes));
            self.given_up |= progress.is_given_up();
            *self.buffer(target) = buffer;
            self.round_to_formats(target);
            let (triangles, blocks) = (drawn?, blocks.len());
            let engine = self.engines.raster.name();
            self.timeline.record(StepKind::Raster, name, elapsed).note =
                format!("{triangles} triangles on {engine}, in {blocks} blocks");
            return Ok(());
        }
        let progress = self.progress();
        observer.begin(StepKind::Raster, name, &progress);
        let start = Instant::now();
        let drawn = match own_materials.is_empty() {
            true => self.engines.raster.draw_until(&job, &mut buffer, &progress),
            false => self.engines.raster.draw_with(&job, &own, &mut buffer, &mut buffers),
        };
        let elapsed = start.elapsed();
        observer.end();
        bound.iter().zip(buffers).for_each(|(bound, bytes)| give(&mut self.targets, *bound, bytes));
        self.given_up |= progress.is_given_up();
        let handed = drawn.as_ref().ok().and_then(|stats| stats.shared);
        let mut result = drawn.map(|stats| {
            let joining = handed.map_or(Duration::ZERO, |handed| handed.host);
            let row = self.timeline.record(StepKind::Raster, name, elapsed.saturating_sub(joining));
            row.device_ms.extend(stats.device_time.map(|time| time.as_secs_f64() * 1e3));
            row.note = format!("{} triangles on {}", stats.triangles, self.engines.raster.name());
        });
        let host = self.in_host(target, host, traced);
        if result.is_ok()
            && self.engines.raster.needs_read_back()
            && (host != Attachments::default() || load_store.store_depth)
        {
            let start = Instant::now();
            result = self.engines.raster.read_back(&job, host, &mut buffer);
            self.timeline.record(StepKind::ReadBack, name, start.elapsed());
        }
        if let Some(handed) = handed {
            self.record_hand_over(name, handed);
        }
        *self.buffer(target) = buffer;
        self.round_to_formats(target);
        self.round_stored(planned);
        result
    }
}
