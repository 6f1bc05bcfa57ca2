//! Shows the outputs of passes to observers.

use super::{ChangeError, Observer, Output, Range, Renderer, Triangles, channel_of};
use crate::backend::GBuffer;
use crate::plan::{PlannedPass, Work};
use crate::programs::Writes;
use crate::project::ChannelRef;

impl Renderer {
    /// From now on copies every attachment of raster passes into host memory, so that observers see everything. Without this,
    /// attachments that only the rasteriser's device reads are not shown.
    pub fn read_back_everything(&mut self) {
        self.shows_everything = true;
        self.plan.read_back_everything();
        if let Some(next) = &mut self.next {
            next.read_back_everything();
        }
    }

    /// Reverts [`Self::read_back_everything`]: only what the plan asks for is copied into host memory.
    ///
    /// # Errors
    /// As the setters. After an error everything is still copied.
    pub fn read_back_as_planned(&mut self) -> Result<(), ChangeError> {
        let before = std::mem::replace(&mut self.shows_everything, false);
        let result = self.propose(self.project().clone(), self.settings().clone());
        if result.is_err() {
            self.shows_everything = before;
        }
        result
    }

    /// Whether [`Self::channel`] returns the channel of the last frame: a pass of that frame's plan wrote it, and it was copied
    /// into host memory if a device drew it. A picture in bands leaves no whole channel. Settings made since are not considered.
    #[must_use]
    pub fn holds(&self, channel: ChannelRef) -> bool {
        let slot = (Some(channel.target), channel.channel);
        let mut writers = self.plan.passes.iter().filter(|planned| self.plan.access(planned).writes.contains(&slot));
        let held = |planned: &PlannedPass| {
            let Work::Raster { attachments, host, traced, .. } = planned.work else {
                return !self.left_on_device(planned.pass);
            };
            let held = match self.was_in_host(planned.pass) {
                Some(held) => held,
                None => match self.engines.raster.needs_read_back() {
                    true => self.in_host(Some(channel.target), host, traced),
                    false => attachments,
                },
            };
            [held.color, held.position, held.normal].get(channel.channel) == Some(&true)
        };
        let is_whole = self.plan.parts.list.len() == 1;
        // Of several writers the last one decides.
        is_whole && writers.next_back().is_some_and(held) && !self.channel(channel).is_empty()
    }

    /// Shows the outputs of a pass to an observer.
    pub(super) fn show_outputs(&self, index: usize, planned: &PlannedPass, observer: &mut dyn Observer) {
        let pass = self.plan.pass(planned);
        let buffer: &GBuffer = pass.target.map_or(&self.window, |target| &self.targets[target]);
        let mut show = |channel: usize, range: Range| {
            let name = match pass.target {
                Some(target) => {
                    let target = &self.plan.project.targets[target];
                    let texture = target.channels.get(channel).map_or("no texture", |texture| texture.name.as_str());
                    format!("{}::{texture}", target.library)
                }
                None => "window".to_owned(),
            };
            let (width, height) = (buffer.width, buffer.height);
            let pixels = channel_of(buffer, channel);
            observer.wrote(&Output { pass: &pass.name, channel: name, range, width, height, pixels });
        };
        match &planned.work {
            Work::Raster { scene_set, attachments, host, traced, .. } => {
                let held = match self.engines.raster.needs_read_back() {
                    true => self.in_host(pass.target, *host, *traced),
                    false => *attachments,
                };
                for (channel, (shown, range)) in
                    [(held.color, Range::Color), (held.position, Range::Position), (held.normal, Range::Normal)]
                        .into_iter()
                        .enumerate()
                {
                    if shown {
                        show(channel, range);
                    }
                }
                if held.triangle {
                    let count = self.scenes[*scene_set].scene.geometry.triangles.len();
                    let (width, ids) = (buffer.width, buffer.triangle.as_slice());
                    observer.wrote_triangles(&Triangles { pass: &pass.name, count, width, ids });
                }
            }
            Work::Rays { .. } | Work::Effect { .. } if self.stays(index) => {}
            Work::Quad { .. } if self.displayed.is_some() && pass.target.is_none() => {}
            _ => show(
                0,
                match pass.kind.writes() {
                    Some(Writes::Share) => Range::Share,
                    Some(Writes::Color) | None => Range::Color,
                },
            ),
        }
    }
}
