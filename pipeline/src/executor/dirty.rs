//! Which passes have to run again: those whose inputs changed since their last run, and those that depend on them.

use super::{PassMaterials, Renderer};
use crate::backend::{Attachments, OwnMaterial};
use crate::image::PixelFormat;
use crate::pixel_samples::PixelSamples;
use crate::plan::{Access, Shining, Work};
use crate::project::{ChannelRef, PassKind, QuadPass};

/// The inputs of a pass when it last ran. Its picture stays valid as long as these inputs, and the channels that it reads, are
/// unchanged.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Given {
    /// The pass's work; for a raster pass without its attachments, which are in [`Self::drawn`].
    work: Work,
    shining: Shining,
    /// The seed, for effect passes and for ray passes whose result may depend on it; `None` for other passes.
    seed: Option<u32>,
    /// Name of the ray backend that the pass asks for; `None` for the common one.
    backend: Option<String>,
    materials: PassMaterials,
    /// Inputs of own shaders, by material.
    own: Vec<Option<OwnMaterial>>,
    /// Uniform blocks of the own shader of a quad or compute pass.
    quad: Vec<Vec<u8>>,
    /// Formats of the target's channels, to which the result is rounded.
    formats: Vec<PixelFormat>,
    /// For a raster pass: first the attachments that it draws, second the ones among them that are in host memory.
    drawn: [Attachments; 2],
    /// Whether the picture exists only on the rasteriser's device.
    stays: bool,
    /// Samples a pixel and, if there are several, the channels that hold their mean.
    averaged: (PixelSamples, Vec<ChannelRef>),
    /// Whether other passes have run while the plan left this one out: what it reads may have changed.
    outlived: bool,
}

impl Given {
    /// Whether a run with these inputs produced everything that a run with the inputs `now` would produce.
    fn serves(&self, now: &Self) -> bool {
        let has = |held: Attachments, wanted: Attachments| held.union(wanted) == held;
        let drawn = self.drawn.iter().zip(now.drawn).all(|(held, wanted)| has(*held, wanted));
        drawn && *self == Self { drawn: self.drawn, ..now.clone() }
    }
}

impl Renderer {
    /// Whether the last run of the pass at an index of the pipeline left its picture on the rasteriser's device only.
    pub(super) fn left_on_device(&self, pass: usize) -> bool {
        self.ran.get(pass).and_then(Option::as_ref).is_some_and(|ran| ran.stays)
    }

    /// The attachments that the last run of a raster pass copied into host memory, if that is known.
    pub(super) fn was_in_host(&self, pass: usize) -> Option<Attachments> {
        self.ran.get(pass)?.as_ref().map(|ran| ran.drawn[1])
    }

    /// The current inputs of the pass at an index of the plan.
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
        let random = match (&work, &pass.kind) {
            // With `glass=auto` materials may be rough, and only then are there photons and Russian roulette.
            (Work::Rays { params, .. }, PassKind::Ray(ray)) => {
                ray.program.info().has_noise(params) || self.plan.asks_materials(planned)
            }
            (Work::Effect { .. }, _) => true,
            _ => false,
        };
        let samples = self.samples();
        let kept = if samples.are_several() { self.plan.shown.clone() } else { Vec::new() };
        let channels = pass.target.map_or(&[][..], |target| &self.plan.project.targets[target].channels);
        Given {
            work,
            shining: self.plan.shining(pass.kind.lights()),
            seed: random.then_some(self.plan.settings.seed),
            backend: self.plan.backend_of(planned).map(str::to_owned),
            materials: self.materials[index].clone(),
            own: self.own_shaders(index, planned).1,
            quad: match (&planned.work, &pass.kind) {
                (Work::Quad { viewport }, PassKind::Quad(QuadPass { shader: Some(shader), .. })) => {
                    self.quad_uniforms(shader, *viewport, self.plan.target_size(pass.target)[1])
                }
                (Work::Compute, PassKind::Compute(compute)) => self.compute_uniforms(&compute.shader),
                _ => Vec::new(),
            },
            formats: channels.iter().map(|channel| channel.format).collect(),
            drawn,
            stays: self.stays(index) && !matches!(planned.work, Work::Raster { .. }),
            averaged: (samples, kept),
            outlived: false,
        }
    }

    /// Notes for the passes that the plan leaves out that others run.
    pub(super) fn outlive_absent(&mut self) {
        let planned: Vec<usize> = self.plan.passes.iter().map(|planned| planned.pass).collect();
        let absent = self.ran.iter_mut().enumerate().filter(|(pass, _)| !planned.contains(pass));
        absent.filter_map(|(_, ran)| ran.as_mut()).for_each(|ran| ran.outlived = true);
    }

    /// The passes that must run to bring the picture up to date, by index of the plan.
    pub(super) fn outdated(&self) -> Vec<bool> {
        let stale = |(index, planned): (usize, &crate::plan::PlannedPass)| {
            let ran = self.ran.get(planned.pass).and_then(Option::as_ref);
            !ran.is_some_and(|ran| ran.serves(&self.given(index)))
        };
        let mut run: Vec<bool> = self.plan.passes.iter().enumerate().map(stale).collect();
        // Buffers begin a frame with zeros, and each pass stores on top of what earlier passes stored. So all passes run or none.
        let stores = |planned| self.plan.pass(planned).kind.buffers_stored().next().is_some();
        if run.contains(&true) && self.plan.passes.iter().any(stores) {
            run.fill(true);
            return run;
        }
        let accesses: Vec<Access> = self.plan.passes.iter().map(|planned| self.plan.access(planned)).collect();
        spread(&accesses, &mut run);
        // A rasteriser on a device keeps one G-buffer. If several are drawn, it keeps the G-buffer of an effect only until the next
        // raster pass.
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

/// Extends the set of passes to run by all passes that must run with them. For each pass P of the set, later passes that read or overwrite
/// an output of P are added. If P or a later pass overwrites an input of P, earlier passes that write this input are added too.
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
                if passes[index..].iter().any(|later| touches(&later.writes, slot)) {
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
        // A pass that draws over the picture of another pass needs that picture again.
        let over = [access(&[], &[WINDOW]), access(&[WINDOW], &[WINDOW])];
        assert_eq!(closed(&over, 1), [0, 1]);
        // Without a reader: if two passes write the same slot, the first makes the second run, but not the reverse.
        let twice = [access(&[], &[WINDOW]), access(&[], &[WINDOW]), access(&[], &[SHARE])];
        assert_eq!(closed(&twice, 0), [0, 1]);
        assert_eq!(closed(&twice, 1), [1]);
    }
}
