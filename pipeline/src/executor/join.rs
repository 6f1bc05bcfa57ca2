//! Sharing G-buffers: ray passes read them in the memory where they were drawn.

use super::{Renderer, StepKind};
use crate::backend::{Attachments, HandOver, Rect};
use crate::plan::Work;
use std::time::Instant;

impl Renderer {
    /// Lets the rasteriser and the ray backend share the G-buffer of the first ray pass that can read it in place, if both run on
    /// one device. If sharing fails, there is a warning, and the G-buffer is copied through the host.
    pub(super) fn join_engines(&mut self) {
        (self.lent, self.shares_picture) = (false, false);
        self.join_gbuffer();
        self.decide_showing_quad();
    }

    fn join_gbuffer(&mut self) {
        // A part of a picture does not have the layout of the whole G-buffer. With several ray backends the G-buffer passes through the
        // host.
        if self.engines.differ() || self.plan.in_parts() || self.plan.block.is_some() {
            return;
        }
        let Some(target) = self.plan.target_to_share() else { return };
        let (width, height) = (self.plan.targets[target].width, self.plan.targets[target].height);
        if self.is_drawn_at_once(target)
            && let Some(lent) = self.engines.raster.lends()
            && self.engines.rays.reads(&lent)
        {
            (self.joined, self.lent) = (Some(target), true);
            return;
        }
        if !self.engines.raster.shares().is_some_and(|device| self.engines.rays.joins(device)) {
            return;
        }
        let traced = |work: &Work| match work {
            Work::Raster { traced, .. } => *traced,
            _ => Attachments::default(),
        };
        let drawn = self.plan.passes.iter().filter(|planned| self.plan.pass(planned).target == Some(target));
        let attachments = drawn.map(|planned| traced(&planned.work)).fold(Attachments::default(), Attachments::union);
        let start = Instant::now();
        let picture = self.engines.rays.shares_pictures() && self.plan.shares_picture();
        let shared = self.engines.raster.share(width, height, attachments, picture);
        match shared.and_then(|shared| self.engines.rays.join(shared)) {
            Ok(()) => {
                (self.joined, self.shares_picture) = (Some(target), picture);
                let row = self.timeline.record(StepKind::Upload, "shared G-buffer", start.elapsed());
                row.note = format!("{width} x {height}, read by {} where it was drawn", self.engines.rays.name());
            }
            Err(error) => {
                let (what, remedy) = ("G-buffers that cannot be shared", "they pass through the host");
                self.warnings.add(&self.plan.project.path, what, remedy, || error.to_string());
            }
        }
    }

    /// Whether exactly one raster pass draws into a target, and fills it. Then the attachments of that pass are the whole G-buffer.
    fn is_drawn_at_once(&self, target: usize) -> bool {
        let (width, height) = (self.plan.targets[target].width, self.plan.targets[target].height);
        let whole = Rect { x: 0, y: 0, width, height };
        let drawn = self.plan.passes.iter().filter(|planned| self.plan.pass(planned).target == Some(target));
        let viewports: Vec<_> = drawn
            .filter_map(|planned| match planned.work {
                Work::Raster { viewport, .. } => Some(viewport),
                _ => None,
            })
            .collect();
        viewports == [whole]
    }

    /// Whether ray passes read the G-buffer of a target in place. False as soon as a fallback has taken over.
    pub(super) fn is_joined(&self, target: Option<usize>) -> bool {
        target.is_some() && target == self.joined
    }

    /// The attachments of a raster pass that are read in host memory.
    pub(super) fn in_host(&self, target: Option<usize>, host: Attachments, traced: Attachments) -> Attachments {
        let host = host.without(self.read_in_place(target));
        if self.is_joined(target) { host } else { host.union(traced) }
    }

    /// The attachments of a raster pass that are copied into shared memory, or lent.
    pub(super) fn in_shared_memory(&self, target: Option<usize>, traced: Attachments) -> Attachments {
        let traced = if self.is_joined(target) { traced } else { Attachments::default() };
        // With shared memory the quad reads attachments where they were drawn, so attachments that only the quad reads are not copied.
        if self.shares_picture { traced } else { traced.union(self.read_in_place(target)) }
    }

    /// Records the time of a copy into shared memory.
    pub(super) fn record_hand_over(&mut self, name: &str, handed: HandOver) {
        self.drawn_value = handed.value;
        if self.joined.is_none() {
            return;
        }
        self.handed_over = handed.value;
        let row = self.timeline.record(StepKind::Join, name, handed.host);
        row.device_ms.extend(handed.device.map(|time| time.as_secs_f64() * 1e3));
        row.note = "in device memory".to_owned();
    }
}
