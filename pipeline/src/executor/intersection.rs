//! Intersection passes: the rays of a storage buffer are traced, and their hits written into another.

use super::rays::{Traced, by_kind};
use super::{Observer, RenderError, Renderer, StepKind};
use crate::backend::{BackendError, IntersectionJob};
use crate::plan::PlannedPass;
use crate::project::{IntersectionPass, PassKind, RaysTraced};
use bytemuck::cast_slice;
use std::sync::Arc;
use std::time::Instant;

impl Renderer {
    /// Builds what the rays need and traces them. If a backend fails, an allowed fallback takes over.
    pub(super) fn intersect(
        &mut self,
        planned: &PlannedPass,
        scene_set: usize,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<Traced, RenderError> {
        let PassKind::Intersection(pass) = self.plan.pass(planned).kind.clone() else { return Ok(Traced::Done) };
        let before = (self.joined, self.in_place().is_some());
        loop {
            self.build_or_stand_in(scene_set, name, observer)?;
            if (self.joined, self.in_place().is_some()) != before {
                return Ok(Traced::NothingInHost);
            }
            match self.trace_buffer((&pass, planned.pass), scene_set, name, observer) {
                Ok(()) => return Ok(Traced::Done),
                Err(_) if self.cancellation.is_cancelled() => return Err(RenderError::Cancelled),
                Err(error) => self.stand_in(name, error, observer)?,
            }
        }
    }

    fn trace_buffer(
        &mut self,
        (pass, index): (&IntersectionPass, usize),
        scene_set: usize,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let count = self.rays_of_buffer(pass.count);
        let mut hits = std::mem::take(&mut self.targets[pass.hits].color);
        // A frame begins with zeros in all buffers.
        if self.is_first_to_bind(pass.hits, index) {
            hits.fill([0.0; 4]);
        }
        let scene = Arc::clone(&self.scenes[scene_set].scene);
        let rays = self.targets[pass.rays].color.as_chunks().0;
        let count = count.min(rays.len()).min(hits.len());
        let job = IntersectionJob { scene: &scene, rays: &rays[..count] };
        let progress = self.progress();
        observer.begin(StepKind::Rays, name, &progress);
        let start = Instant::now();
        let traced = self.engines.rays_of_mut(name).intersect(&job, &mut hits[..count], &progress);
        let elapsed = start.elapsed();
        observer.end();
        self.given_up |= progress.is_given_up();
        self.targets[pass.hits].color = hits;
        let stats = traced?;
        let sums = self.sample > 0;
        let backend = self.engines.rays_of(name).name();
        let row = self.timeline.record(StepKind::Rays, name, elapsed);
        let mut rays = stats.rays;
        if sums {
            rays += row.rays.unwrap_or_default();
        }
        row.rays = Some(rays);
        row.note = format!("intersections on {backend}{}", by_kind(rays));
        Ok(())
    }

    /// The number of rays to trace.
    fn rays_of_buffer(&self, count: RaysTraced) -> usize {
        match count {
            RaysTraced::Fixed(count) => count as usize,
            RaysTraced::Counted { buffer, offset, most } => {
                let words: &[i32] = cast_slice(&self.targets[buffer].color);
                let found = words.get(offset as usize / 4).copied().unwrap_or_default();
                u64::try_from(found).map_or(most, |found| found.min(most)) as usize
            }
        }
    }
}
