//! Which passes have to run again: those that were given something else since they last ran, and those that depend on them.

use super::{PassMaterials, Renderer};
use crate::backend::{Attachments, OwnMaterial, Sun};
use crate::image::PixelFormat;
use crate::pixel_samples::PixelSamples;
use crate::plan::{Access, Work};
use crate::project::{ChannelRef, PassKind, QuadPass};

/// What a pass was given when it last ran. Its picture is that of the last frame as long as this, and what it reads, is the same.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Given {
    /// What it does; of a raster pass without the attachments, which are in [`Self::drawn`].
    work: Work,
    sun: Option<Sun>,
    /// The seed; `None` for a pass that draws no random numbers.
    seed: Option<u32>,
    /// The ray backend that it asks for.
    backend: Option<String>,
    materials: PassMaterials,
    /// What own shaders are given.
    own: Vec<Option<OwnMaterial>>,
    /// What the own shader of a quad is given.
    quad: Vec<Vec<u8>>,
    /// Formats of its target: what it writes is rounded to them.
    formats: Vec<PixelFormat>,
    /// What a raster pass draws, and what of it is in host memory.
    drawn: [Attachments; 2],
    /// Whether its picture is on the rasteriser's device alone.
    stays: bool,
    /// Samples a pixel and, where there are several, the channels that hold their mean.
    averaged: (PixelSamples, Vec<ChannelRef>),
}

impl Given {
    /// Whether a pass that ran with this left all that one with `now` would.
    fn serves(&self, now: &Self) -> bool {
        let has = |held: Attachments, wanted: Attachments| held.union(wanted) == held;
        let drawn = self.drawn.iter().zip(now.drawn).all(|(held, wanted)| has(*held, wanted));
        drawn && *self == Self { drawn: self.drawn, ..now.clone() }
    }
}

impl Renderer {
    /// Whether the pass at an index of the pipeline left its picture on the rasteriser's device when it last ran.
    pub(super) fn left_on_device(&self, pass: usize) -> bool {
        self.ran.get(pass).and_then(Option::as_ref).is_some_and(|ran| ran.stays)
    }

    /// What of a raster pass was brought into host memory when it last ran, if that is known.
    pub(super) fn was_in_host(&self, pass: usize) -> Option<Attachments> {
        self.ran.get(pass)?.as_ref().map(|ran| ran.drawn[1])
    }

    /// What the pass at an index of the plan is given now.
    pub(super) fn given(&self, index: usize) -> Given {
        let planned = &self.plan.passes[index];
        let pass = self.plan.pass(planned);
        let mut work = planned.work.clone();
        let mut drawn = [Attachments::default(); 2];
        if let Work::Raster { attachments, host, traced, .. } = &mut work {
            let in_host = match self.engines.raster.needs_read_back() {
                true => self.in_host(pass.target, *host, *traced),
                false => *attachments,
            };
            drawn = [*attachments, in_host];
            (*attachments, *host, *traced) = Default::default();
        }
        let light = match &pass.kind {
            PassKind::Raster(raster) => raster.light,
            PassKind::Ray(ray) => ray.light,
            PassKind::Effect(effect) => effect.light,
            PassKind::Quad(_) => None,
        };
        let random = match (&work, &pass.kind) {
            (Work::Rays { params, .. }, PassKind::Ray(ray)) => ray.program.info().samples(params) > 0,
            (Work::Effect { .. }, _) => true,
            _ => false,
        };
        let samples = self.samples();
        let kept = if samples.are_several() { self.plan.shown.clone() } else { Vec::new() };
        let channels = pass.target.map_or(&[][..], |target| &self.plan.project.targets[target].channels);
        Given {
            work,
            sun: light.and_then(|light| self.sun(light)),
            seed: random.then_some(self.plan.settings.seed),
            backend: self.plan.backend_of(planned).map(str::to_owned),
            materials: self.materials[index].clone(),
            own: self.own_shaders(index, planned).1,
            quad: match (&planned.work, &pass.kind) {
                (Work::Quad { viewport }, PassKind::Quad(QuadPass { shader: Some(shader), .. })) => {
                    self.quad_uniforms(shader, *viewport, self.plan.target_size(pass.target)[1])
                }
                _ => Vec::new(),
            },
            formats: channels.iter().map(|channel| channel.format).collect(),
            drawn,
            stays: self.stays(index) && !matches!(planned.work, Work::Raster { .. }),
            averaged: (samples, kept),
        }
    }

    /// By index of the plan: the passes that have to run for the picture to be that of all that was set.
    pub(super) fn outdated(&self) -> Vec<bool> {
        let stale = |(index, planned): (usize, &crate::plan::PlannedPass)| {
            let ran = self.ran.get(planned.pass).and_then(Option::as_ref);
            !ran.is_some_and(|ran| ran.serves(&self.given(index)))
        };
        let mut run: Vec<bool> = self.plan.passes.iter().enumerate().map(stale).collect();
        // What passes store to buffers is added to what others stored, from zeros on.
        let stores = self.plan.passes.iter().any(
            |planned| matches!(&self.plan.pass(planned).kind, PassKind::Quad(quad) if quad.stored(false).next().is_some()),
        );
        if stores && run.contains(&true) {
            run.fill(true);
            return run;
        }
        let accesses: Vec<Access> = self.plan.passes.iter().map(|planned| self.plan.access(planned)).collect();
        spread(&accesses, &mut run);
        // A rasteriser with a device keeps one G-buffer: where several are drawn, an effect finds its own only just behind its pass.
        let raster = |planned: &crate::plan::PlannedPass| matches!(planned.work, Work::Raster { .. });
        let several = self.plan.passes.iter().filter(|planned| raster(planned)).count() > 1;
        let resident = |index: usize| matches!(self.plan.passes[index].work, Work::Effect { resident: true, .. });
        if several && self.engines.raster.needs_read_back() && (0..run.len()).any(|index| run[index] && resident(index))
        {
            for (index, planned) in self.plan.passes.iter().enumerate() {
                run[index] |= raster(planned);
            }
            spread(&accesses, &mut run);
        }
        run
    }
}

/// Adds to the passes that run those which have to run with them: what reads what they write, what writes to the same place after them,
/// and what wrote what they read, if that has been written over since.
pub(super) fn spread(passes: &[Access], run: &mut [bool]) {
    let touches = |slots: &[_], slot: &_| slots.contains(slot);
    loop {
        let before = run.iter().filter(|runs| **runs).count();
        for index in 0..passes.len() {
            if !run[index] {
                continue;
            }
            let pass = &passes[index];
            for (later, access) in passes.iter().enumerate().skip(index + 1) {
                run[later] |=
                    pass.writes.iter().any(|slot| touches(&access.writes, slot) || touches(&access.reads, slot));
            }
            for slot in &pass.reads {
                if passes[index + 1..].iter().any(|later| touches(&later.writes, slot)) {
                    for (earlier, access) in passes.iter().enumerate().take(index) {
                        run[earlier] |= touches(&access.writes, slot);
                    }
                }
            }
        }
        if run.iter().filter(|runs| **runs).count() == before {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Slot;

    const COLOR: Slot = (Some(0), 0);
    const POSITION: Slot = (Some(0), 1);
    const SHARE: Slot = (Some(1), 0);
    const WINDOW: Slot = (None, 0);

    fn access(reads: &[Slot], writes: &[Slot]) -> Access {
        Access { reads: reads.to_vec(), writes: writes.to_vec() }
    }

    fn closed(passes: &[Access], first: usize) -> Vec<usize> {
        let mut run = vec![false; passes.len()];
        run[first] = true;
        spread(passes, &mut run);
        (0..run.len()).filter(|index| run[*index]).collect()
    }

    #[test]
    fn what_reads_runs_again_and_what_is_read_does_not() {
        let passes =
            [access(&[], &[COLOR, POSITION]), access(&[POSITION], &[SHARE]), access(&[COLOR, SHARE], &[WINDOW])];
        assert_eq!(closed(&passes, 0), [0, 1, 2]);
        assert_eq!(closed(&passes, 1), [1, 2]);
        assert_eq!(closed(&passes, 2), [2]);
    }

    #[test]
    fn what_was_written_over_is_made_again_for_a_pass_that_reads_it() {
        // The second pass reads a colour that the third replaces.
        let passes = [
            access(&[], &[COLOR, POSITION]),
            access(&[COLOR], &[SHARE]),
            access(&[SHARE], &[COLOR]),
            access(&[COLOR], &[WINDOW]),
        ];
        assert_eq!(closed(&passes, 1), [0, 1, 2, 3]);
        assert_eq!(closed(&passes, 2), [2, 3]);
        // Without the reader, writing one place twice makes the later pass run, not the earlier.
        let twice = [access(&[], &[WINDOW]), access(&[], &[WINDOW]), access(&[], &[SHARE])];
        assert_eq!(closed(&twice, 0), [0, 1]);
        assert_eq!(closed(&twice, 1), [1]);
    }
}
