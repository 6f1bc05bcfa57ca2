//! The quad that shows the picture, and whether the rasteriser's device may fill it.

use super::{Plan, PlannedPass, Slot, Work};
use crate::backend::{Attachments, Rasteriser, RayBackend, Rect};
use crate::device_quad::QuadPlace;
use crate::diagnostic::Decision;
use crate::project::{ChannelRef, PassKind, QuadSource};

/// The memory in which the pictures of ray passes can lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RayPictures {
    /// On the rasteriser's device, if the ray backend reads what the rasteriser lends.
    Lent,
    /// One picture is in memory that the rasteriser shares with another programming interface of its device.
    Shared,
    /// In the memory of the ray backends alone.
    Apart,
}

/// A channel that a quad reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QuadInput {
    /// The channel.
    pub channel: ChannelRef,
    /// Index into [`Plan::passes`] of the only pass that writes it.
    pub writer: usize,
}

/// The quad pass that shows the picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShowingQuad {
    /// Index of the quad pass, into [`Plan::passes`].
    pub index: usize,
    /// The channel that the quad shows.
    pub color: QuadInput,
    /// The channel whose red component multiplies the colour; `None` to show the colour as it is.
    pub factor: Option<QuadInput>,
}

impl ShowingQuad {
    /// The channels that the quad reads.
    pub fn inputs(&self) -> impl Iterator<Item = QuadInput> {
        [Some(self.color), self.factor].into_iter().flatten()
    }

    /// Whether the quad reads a channel that the pass at index `writer` of [`Plan::passes`] writes.
    #[must_use]
    pub fn reads(&self, writer: usize) -> bool {
        self.inputs().any(|input| input.writer == writer)
    }

    /// The attachments of a target that the quad reads.
    #[must_use]
    pub fn attachments(&self, target: Option<usize>) -> Attachments {
        let reads = |channel| self.inputs().any(|i| Some(i.channel.target) == target && i.channel.channel == channel);
        Attachments { color: reads(0), position: reads(1), normal: reads(2), triangle: false }
    }
}

impl Plan {
    /// The index of the last pass that writes the window, and the quad if a device may run it. The error says why it may not, for
    /// example because another pass reads an input in host memory. `None` if that pass is not a quad pass.
    #[must_use]
    pub fn showing_quad(&self) -> Option<(usize, Result<ShowingQuad, String>)> {
        let window = |planned: &PlannedPass| self.pass(planned).target.is_none();
        let index = self.passes.iter().rposition(window)?;
        let PassKind::Quad(quad) = &self.pass(&self.passes[index]).kind else { return None };
        Some((index, self.for_device(index, quad.source)))
    }

    /// The target whose G-buffer a rasteriser may share with a ray backend: that of the first ray pass that can read it in place.
    #[must_use]
    pub fn target_to_share(&self) -> Option<usize> {
        self.passes.iter().find_map(|planned| self.reads_shared(planned))
    }

    /// The target whose G-buffer a ray pass can read in place.
    fn reads_shared(&self, planned: &PlannedPass) -> Option<usize> {
        match planned.work {
            Work::Rays { resident, .. } => resident,
            _ => None,
        }
    }

    /// Whether the quad that shows the picture can read a ray pass's picture in the memory that is shared for the G-buffer.
    #[must_use]
    pub fn shares_picture(&self) -> bool {
        self.showing_quad().and_then(|(_, quad)| quad.ok()).is_some_and(|quad| self.reads_one_picture(&quad))
    }

    /// Whether a quad's inputs are the picture of exactly one ray pass and otherwise only what raster passes drew. That ray pass must
    /// read the shared G-buffer. The G-buffer must be drawn once in a frame, so that the quad waits for a single picture.
    fn reads_one_picture(&self, quad: &ShowingQuad) -> bool {
        let shared = self.target_to_share();
        let draws =
            |planned: &&PlannedPass| matches!(planned.work, Work::Raster { .. }) && self.pass(planned).target == shared;
        if self.passes.iter().filter(draws).count() != 1 {
            return false;
        }
        let (mut pictures, mut others) = (0, false);
        for input in quad.inputs() {
            let writer = &self.passes[input.writer];
            match writer.work {
                Work::Raster { .. } => {}
                Work::Rays { .. } if shared.is_some() && self.reads_shared(writer) == shared => pictures += 1,
                _ => others = true,
            }
        }
        pictures == 1 && !others
    }

    /// Decides whether the rasteriser's device fills the quad of [`Self::showing_quad`], and adds the decision. Returns the quad or
    /// the reason why not; `None` without a quad, or if the rasteriser never fills quads on a device.
    pub fn decide_showing_quad(
        &mut self,
        raster: &mut dyn Rasteriser,
        rays: &mut dyn RayBackend,
        pictures: RayPictures,
    ) -> Option<Result<ShowingQuad, String>> {
        let (index, planned) = self.showing_quad()?;
        let decided = match raster.fills_quads() {
            QuadPlace::Host => return None,
            QuadPlace::Software => {
                Err("its driver runs on the processor, where the host's own loop is faster".to_owned())
            }
            QuadPlace::Device => planned.and_then(|quad| self.engines_fill(quad, raster, rays, pictures)),
        };
        let what = format!("pass `{}` on the rasteriser's device", self.pass(&self.passes[index]).name);
        let why = match &decided {
            Ok(_) => "what it reads is there; a PNG file takes 4 bytes a pixel of the window, an EXR file 16",
            Err(why) => why.as_str(),
        };
        let decision = Decision { what, built: decided.is_ok(), why: why.to_owned() };
        self.decisions.retain(|before| before.what != decision.what);
        self.decisions.push(decision);
        Some(decided)
    }

    fn engines_fill(
        &self,
        quad: ShowingQuad,
        raster: &mut dyn Rasteriser,
        rays: &mut dyn RayBackend,
        pictures: RayPictures,
    ) -> Result<ShowingQuad, String> {
        let is_traced = |input: QuadInput| matches!(self.passes[input.writer].work, Work::Rays { .. });
        let traced = quad.inputs().any(is_traced);
        match pictures {
            RayPictures::Shared if self.reads_one_picture(&quad) => return Ok(quad),
            RayPictures::Lent => {}
            _ if traced => return Err("ray passes leave their pictures in memory of their own backends".to_owned()),
            _ => {}
        }
        let lent = if pictures == RayPictures::Lent { raster.lends() } else { None };
        match lent {
            Some(lent) if !traced || rays.reads(&lent) => Ok(quad),
            _ => Err(format!("{} leaves its pictures in memory of its own", rays.name())),
        }
    }

    fn for_device(&self, index: usize, source: QuadSource) -> Result<ShowingQuad, String> {
        let (color, factor) = match source {
            QuadSource::Show(channel) => (channel, None),
            QuadSource::Combine { color, factor } => (color, Some(factor)),
            QuadSource::Own => return Err("its own shader reads copies of the textures".into()),
        };
        let [width, height] = self.window;
        let Work::Quad { viewport } = self.passes[index].work else { return Err("it is switched off".into()) };
        if viewport != (Rect { x: 0, y: 0, width, height }) || self.passes.iter().filter(|p| self.fills(p)).count() > 1
        {
            return Err("several passes share the window".into());
        }
        if self.in_parts()
            || self.parts.list.len() != 1
            || self.parts.list[0].written != viewport
            || self.block.is_some()
        {
            return Err("a part of the picture is rendered at a time, or written".into());
        }
        if self.settings.aa.are_several() {
            return Err("samples of a pixel are summed in f64".into());
        }
        if self.combines_colors(source) {
            return Err("the share of light that it multiplies by differs by colour".into());
        }
        let color = self.input(index, color)?;
        let factor = factor.map(|channel| self.input(index, channel)).transpose()?;
        Ok(ShowingQuad { index, color, factor })
    }

    fn fills(&self, planned: &PlannedPass) -> bool {
        self.pass(planned).target.is_none()
    }

    fn input(&self, quad: usize, channel: ChannelRef) -> Result<QuadInput, String> {
        let target = &self.project.targets[channel.target];
        let name = target.channels.get(channel.channel).map_or("?", |channel| &channel.name);
        let refuse = |why: &str| Err(format!("`{}::{name}` {why}", target.library));
        if self.target_size(Some(channel.target)) != self.window {
            return refuse("has another size than the window, and is filtered");
        }
        if self.shown.contains(&channel) {
            return refuse("is shown, too");
        }
        let slot: Slot = (Some(channel.target), channel.channel);
        let writes = |(_, planned): &(usize, &PlannedPass)| self.access(planned).writes.contains(&slot);
        let writers: Vec<(usize, &PlannedPass)> = self.passes.iter().enumerate().filter(writes).collect();
        let [(writer, planned)] = writers[..] else { return refuse("is written by several passes, or by none") };
        match &planned.work {
            Work::Raster { viewport, .. } => {
                let [width, height] = self.window;
                let whole = *viewport == Rect { x: 0, y: 0, width, height };
                let drawn = self.passes.iter().filter(|planned| matches!(planned.work, Work::Raster { .. })).count();
                if !whole || drawn > 1 {
                    return refuse("is not all of what is drawn in a frame");
                }
            }
            Work::Effect { .. } if self.traced(planned).is_some() => {
                return refuse("has pixels that rays add in host memory");
            }
            Work::Rays { .. } if self.sampled_to(planned).is_some() => {
                return refuse("is sampled adaptively, and collected in host memory");
            }
            Work::Rays { .. } | Work::Effect { .. } => {}
            Work::Off { .. } | Work::Quad { .. } | Work::Intersection { .. } | Work::Compute => {
                return refuse("is filled in host memory");
            }
        }
        for (index, planned) in self.passes.iter().enumerate() {
            let in_place = match planned.work {
                Work::Rays { resident, .. } => resident == Some(channel.target),
                Work::Effect { resident, .. } => resident,
                _ => false,
            };
            if index != quad && !in_place && self.access(planned).reads.contains(&slot) {
                return Err(format!(
                    "pass `{}` reads `{}::{name}` in host memory",
                    self.pass(planned).name,
                    target.library
                ));
            }
        }
        Ok(QuadInput { channel, writer })
    }
}
