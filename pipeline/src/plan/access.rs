//! Reads and writes of passes: their dependencies.

use super::{Instead, Plan, PlanError, PlannedPass, Work, effect, liveness};
use crate::backend::LoadStore;
use crate::project::{ChannelRef, PassKind};

/// A place that passes read and write: a render target (`None` for the window) and its channel, [`TRIANGLES`] for the triangle
/// ids, or [`DEPTH`].
pub type Slot = (Option<usize>, usize);

/// Channel number of the triangle ids in a [`Slot`].
pub const TRIANGLES: usize = 3;

/// Channel number, in a [`Slot`], of the depth that a later pass loads instead of clearing it.
pub const DEPTH: usize = 4;

/// The slots that a planned pass reads and writes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Access {
    /// Slots that are read.
    pub reads: Vec<Slot>,
    /// Slots that are written, wholly or in part.
    pub writes: Vec<Slot>,
}

impl Plan {
    /// Requests every attachment of raster passes in host memory, where observers see them.
    pub(crate) fn read_back_everything(&mut self) {
        for planned in &mut self.passes {
            match &mut planned.work {
                Work::Raster { attachments, host, .. } => *host = *attachments,
                // Observers also see the inputs of ray passes, so these passes do not read them in place.
                Work::Rays { resident, .. } => *resident = None,
                Work::Effect { .. }
                | Work::Off { .. }
                | Work::Quad { .. }
                | Work::Intersection { .. }
                | Work::Compute => {}
            }
        }
    }

    /// The slots that a planned pass reads and writes.
    #[must_use]
    pub fn access(&self, planned: &PlannedPass) -> Access {
        let pass = self.pass(planned);
        let slot = |channel: ChannelRef| (Some(channel.target), channel.channel);
        let ids = |reads: bool, position: Option<ChannelRef>| {
            position.filter(|_| reads).map(|position| (Some(position.target), TRIANGLES))
        };
        let reads: Vec<Slot> = match (&planned.work, &pass.kind) {
            (Work::Rays { params, reads_triangle, .. }, PassKind::Ray(ray)) => {
                let read = liveness::inputs(ray, params).into_iter().map(slot);
                read.chain(ids(*reads_triangle, ray.position)).collect()
            }
            (Work::Effect { reads_triangle, .. }, PassKind::Effect(pass)) => {
                effect::inputs(pass).map(slot).chain(ids(*reads_triangle, pass.position)).collect()
            }
            (Work::Raster { .. }, PassKind::Raster(raster)) => {
                liveness::sampled(raster).chain(pass.kind.buffers_read()).map(slot).collect()
            }
            (Work::Off { instead: Instead::Copy(channel) }, _) => vec![slot(*channel)],
            (Work::Quad { .. }, PassKind::Quad(quad)) => liveness::sources(quad).into_iter().map(slot).collect(),
            (Work::Intersection { .. }, PassKind::Intersection(intersection)) => {
                intersection.reads().map(slot).collect()
            }
            (Work::Compute, PassKind::Compute(compute)) => {
                compute.shader.sampled().chain(compute.shader.buffers_read()).map(slot).collect()
            }
            _ => Vec::new(),
        };
        let kept = match &planned.work {
            Work::Raster { load_store, .. } => *load_store,
            _ => LoadStore::default(),
        };
        let mut reads = reads;
        let written_before = || {
            let earlier = self.passes.iter().filter(|other| other.pass < planned.pass);
            earlier.map(|other| self.pass(other)).any(|other| other.target == pass.target)
        };
        if matches!(planned.work, Work::Quad { .. }) && !liveness::Wanted::starts_over(pass) && written_before() {
            reads.push((pass.target, 0));
        }
        if kept.load_color {
            let channels = if pass.target.is_some() { TRIANGLES + 1 } else { 1 };
            reads.extend((0..channels).map(|channel| (pass.target, channel)));
        }
        if kept.load_depth {
            reads.push((pass.target, DEPTH));
        }
        let stored: Vec<Slot> = pass.kind.buffers_stored().map(slot).collect();
        let mut writes: Vec<Slot> = match (&planned.work, pass.target) {
            (Work::Raster { .. }, Some(_)) => (0..=TRIANGLES).map(|channel| (pass.target, channel)).collect(),
            _ => vec![(pass.target, 0)],
        };
        if kept.store_depth {
            writes.push((pass.target, DEPTH));
        }
        // A slot that the pass itself stores to does not count as read: it is no dependency on another pass.
        let reads = reads.into_iter().filter(|slot| !stored.contains(slot)).collect();
        writes.extend(stored);
        Access { reads, writes }
    }

    /// Fails if a ray or effect pass, switched off or not, reads a channel of another size than its target has. A project declares both in
    /// one size, but textures of random numbers do not scale with the window.
    pub(super) fn check_sizes_read(&self) -> Result<(), PlanError> {
        for planned in &self.passes {
            if !matches!(planned.work, Work::Rays { .. } | Work::Effect { .. } | Work::Off { .. }) {
                continue;
            }
            let pass = self.pass(planned);
            let own = self.target_size(pass.target);
            let reads = self.access(planned).reads;
            let Some((Some(target), channel)) = reads.iter().find(|(target, _)| self.target_size(*target) != own)
            else {
                continue;
            };
            let ([width, height], [own_width, own_height]) = (self.target_size(Some(*target)), own);
            let [window_width, window_height] = self.project.window;
            let target = &self.project.targets[*target];
            let name = target.channels.get(*channel).map_or("the triangle ids", |channel| &channel.name);
            return Err(PlanError::new(
                format!(
                    "{}: pass `{}` reads `{}::{name}` of {width} x {height} and writes a target of {own_width} x {own_height}",
                    pass.place, pass.name, target.library
                ),
                format!(
                    "`{name}` does not scale with the window: take the project's own --size {window_width}x{window_height}, or let the pass \
                     read the channel of a render target"
                ),
            ));
        }
        Ok(())
    }

    /// Fails if a pass reads a slot that no pass writes because the writer is switched off.
    pub(super) fn check_switched_off(&self) -> Result<(), PlanError> {
        let mut written: Vec<Slot> = Vec::new();
        for planned in &self.passes {
            let access = self.access(planned);
            let filled =
                |(target, _): &Slot| target.is_some_and(|target| self.project.targets[target].contents.is_some());
            let missing = access.reads.iter().find(|slot| !written.contains(slot) && !filled(slot));
            if let Some((Some(target), channel)) = missing {
                let target = &self.project.targets[*target];
                let what = target.channels.get(*channel).map_or("the triangle ids", |channel| &channel.name);
                let (reader, library, off) =
                    (&self.pass(planned).name, &target.library, self.settings.off.join("`, `"));
                return Err(PlanError::new(
                    format!(
                        "pass `{reader}` reads `{library}::{what}`, which nothing writes with `{off}` switched off"
                    ),
                    format!("switch `{reader}` off as well, or leave on what writes `{library}::{what}`"),
                ));
            }
            written.extend(access.writes);
        }
        Ok(())
    }
}
