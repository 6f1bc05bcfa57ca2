//! Intersection passes: the rays of a storage buffer are traced, and their hits written into another.

use super::rays::Traced;
use super::{Observer, RenderError, Renderer, StepKind};
use crate::backend::{BackendError, IntersectionJob};
use crate::plan::PlannedPass;
use crate::project::{IntersectionPass, PassKind, RaysTraced};
use bytemuck::cast_slice;
use std::sync::Arc;
use std::time::Instant;

impl Renderer {
    /// Builds the acceleration structure for the rays, and traces them. If a backend fails, an allowed fallback takes over.
    pub(super) fn intersect(
        &mut self,
        planned: &PlannedPass,
        scene_set: usize,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<Traced, RenderError> {
        let PassKind::Intersection(pass) = self.plan.pass(planned).kind.clone() else { return Ok(Traced::Done) };
        self.build_and_trace(scene_set, name, observer, |renderer, observer| {
            renderer.trace_buffer((&pass, planned.pass), scene_set, name, observer)
        })
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
        let job = IntersectionJob { scene: &scene, rays: &rays[..count], query: pass.query };
        let progress = self.progress();
        observer.begin(StepKind::Rays, name, &progress);
        let start = Instant::now();
        let traced = self.engines.rays_of_mut(name).intersect(&job, &mut hits[..count], &progress);
        let elapsed = start.elapsed();
        observer.end();
        self.given_up |= progress.is_given_up();
        self.targets[pass.hits].color = hits;
        let stats = traced?;
        let what = format!("intersections on {}", self.engines.rays_of(name).name());
        self.record_rays(name, elapsed, stats, &what, self.taken > 0);
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
