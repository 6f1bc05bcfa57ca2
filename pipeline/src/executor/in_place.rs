//! Pictures that stay on the rasteriser's device until its quad pass has made the window of them.
//!
//! A frame of which the caller takes the picture alone ([`Renderer::displayed_frame`], [`Renderer::draw_frame_for`]) leaves what only the quad
//! pass reads where it was made. All other frames leave it in the targets, as ever.

use super::{Observer, Progress, RenderError, Renderer, StepKind};
use crate::backend::{Attachments, BackendError};
use crate::device_quad::{DeviceQuad, DeviceSource, OnDevice, Shown};
use crate::image::{Codes, Image};
use crate::memory::{self, Refused};
use crate::plan::{PlannedPass, QuadInput, ShowingQuad, Work};
use crate::project::ChannelRef;
use std::path::Path;
use std::sync::Arc;

/// What of a frame its caller takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Takes {
    /// The picture, and the targets that passes leave.
    #[default]
    Everything,
    /// The picture in 32-bit floats.
    Picture,
    /// The picture as a screen shows it.
    Codes,
}

/// A picture that a device displayed.
#[derive(Debug)]
pub(super) struct DisplayedWindow {
    pub codes: Codes,
    pub not_finite: usize,
    pub is_blank: bool,
}

impl Renderer {
    /// Lets the rasteriser's device fill the window, where the plan and the engines allow it, and says what was decided.
    pub(super) fn decide_showing_quad(&mut self) {
        self.showing = None;
        let apart = (self.joined.is_some() && !self.lent) || self.engines.differ();
        let (raster, rays) = (&mut *self.engines.raster, &mut *self.engines.rays);
        let decided = self.plan.decide_showing_quad(raster, rays, apart);
        self.showing = decided.and_then(Result::ok);
    }

    /// The quad that a device fills in this frame.
    pub(super) fn in_place(&self) -> Option<&ShowingQuad> {
        self.showing.as_ref().filter(|_| self.takes != Takes::Everything && !self.shows_everything)
    }

    /// Whether what the pass at an index of the plan writes stays on the device, for the quad.
    pub(super) fn stays(&self, index: usize) -> bool {
        self.in_place().is_some_and(|quad| quad.reads(index))
    }

    /// What of a target the quad reads on the device.
    pub(super) fn read_in_place(&self, target: Option<usize>) -> Attachments {
        self.in_place().map_or_else(Attachments::default, |quad| quad.attachments(target))
    }

    /// Whether the device of the rasteriser fills the window of frames of which the picture alone is taken.
    #[must_use]
    pub fn fills_window_on_device(&self) -> bool {
        self.showing.is_some() && !self.shows_everything
    }

    /// Renders a frame, every pass of it, and gives the picture as a screen shows it, what is cut off left out. Where the plan's decisions say
    /// that the last quad pass runs on the rasteriser's device, only these 4 bytes a pixel are brought into host memory: then
    /// [`Self::holds`] is false for what the quad reads, and [`Self::window_image`] knows what is displayed alone.
    ///
    /// # Errors
    /// As [`Self::frame`].
    pub fn displayed_frame(&mut self, observer: &mut dyn Observer) -> Result<Codes, RenderError> {
        self.settle(observer)?;
        if !self.fills_window_on_device() {
            let image = self.frame(observer)?;
            return Ok(Codes::of(&image, self.plan.display)?);
        }
        self.draw_taking(Takes::Codes, observer)?;
        match &self.displayed {
            Some(displayed) => {
                let mut pixels = memory::with_capacity(displayed.codes.pixels.len())?;
                pixels.extend_from_slice(&displayed.codes.pixels);
                Ok(Codes { pixels, ..displayed.codes })
            }
            // Another backend took over within the frame.
            None => Ok(Codes::of(&self.picture(self.plan.parts.list[0].written)?, self.plan.display)?),
        }
    }

    /// [`Self::draw_frame`] for a picture that [`Self::save`] writes to `path`, and nothing else: what is not in that file may stay on the
    /// device, as in [`Self::displayed_frame`]; of a PNG file that is all but 4 bytes a pixel.
    ///
    /// # Errors
    /// As [`Self::draw_frame`]; if the path ends neither in `.png` nor in `.exr`.
    pub fn draw_frame_for(&mut self, path: &Path, observer: &mut dyn Observer) -> Result<(), RenderError> {
        let takes = if super::save::is_exr(path)? { Takes::Picture } else { Takes::Codes };
        self.draw_taking(takes, observer)
    }

    fn draw_taking(&mut self, takes: Takes, observer: &mut dyn Observer) -> Result<(), RenderError> {
        self.takes = takes;
        let drawn = self.draw_frame(observer);
        self.takes = Takes::Everything;
        drawn
    }

    /// The picture that a device displayed, in floats.
    pub(super) fn displayed_image(&self) -> Option<Image> {
        let codes = &self.displayed.as_ref()?.codes;
        codes.decoded(self.plan.display.space).ok()
    }

    /// Fills the window on the device.
    pub(super) fn fill_on_device(
        &mut self,
        planned: &PlannedPass,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let Some(quad) = self.in_place().cloned() else { return Ok(()) };
        let [width, height] = self.plan.target_size(self.plan.pass(planned).target);
        let source = |input: QuadInput| {
            let ChannelRef { target, channel } = input.channel;
            let place = match self.plan.passes[input.writer].work {
                Work::Raster { .. } => OnDevice::Drawn { value: self.drawn_value, channel },
                _ => OnDevice::Made(target),
            };
            DeviceSource { place, format: self.plan.project.targets[target].channels[channel].format }
        };
        let job = DeviceQuad { width, height, color: source(quad.color), factor: quad.factor.map(source) };
        let (takes, display, frame) = (self.takes, self.plan.display, &mut self.window.color);
        // The last picture's memory.
        let mut codes = Codes { width, height, pixels: std::mem::take(&mut self.room_for_codes) };
        if takes == Takes::Codes {
            let backend = self.engines.raster.name();
            let refused = |refused: Refused| BackendError::Device { backend, message: refused.to_string() };
            memory::resize(&mut codes.pixels, width as usize * height as usize, [0; 4]).map_err(refused)?;
        }
        let shown = match takes {
            Takes::Codes => Shown::Codes(display, &mut codes.pixels),
            _ => Shown::Floats(frame),
        };
        observer.begin(StepKind::Quad, name, &Arc::new(Progress::default()));
        let filled = self.engines.raster.fill_on_device(&job, shown);
        observer.end();
        let stats = filled?;
        let row = self.timeline.record(StepKind::Quad, name, stats.host);
        row.device_ms.extend(stats.device.map(|time| time.as_secs_f64() * 1e3));
        row.note = format!("on {}", self.engines.raster.name());
        let bytes = if takes == Takes::Codes { 4 } else { 16 };
        self.timeline.record(StepKind::ReadBack, name, stats.read_back).note = format!("{bytes} bytes a pixel");
        if takes == Takes::Codes {
            let (not_finite, is_blank) = (stats.not_finite as usize, stats.is_blank);
            self.displayed = Some(DisplayedWindow { codes, not_finite, is_blank });
        }
        Ok(())
    }
}
