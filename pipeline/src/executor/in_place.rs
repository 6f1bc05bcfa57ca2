//! Pictures that stay on the rasteriser's device until the final quad pass has filled the window from them.
//!
//! This applies to frames whose caller takes only the picture ([`Renderer::displayed_frame`], [`Renderer::draw_frame_for`]):
//! channels that only the quad pass reads then stay where they were made. All other frames leave them in the targets.

use super::{Observer, Progress, RenderError, Renderer, StepKind};
use crate::backend::{Attachments, BackendError};
use crate::device_quad::{DeviceQuad, DeviceSource, OnDevice, Shown};
use crate::image::{Codes, Image};
use crate::memory::{self, Refused};
use crate::plan::{PlannedPass, QuadInput, RayPictures, ShowingQuad, Work};
use crate::project::ChannelRef;
use std::path::Path;
use std::sync::Arc;

/// What the caller takes of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Takes {
    /// The picture, and the targets of all passes.
    #[default]
    Everything,
    /// Only the picture, as 32-bit floats.
    Picture,
    /// Only the picture, as 8-bit display codes.
    Codes,
}

/// A picture that was converted to display codes on a device.
#[derive(Debug)]
pub(super) struct DisplayedWindow {
    pub codes: Codes,
    pub not_finite: usize,
    pub is_blank: bool,
}

impl Renderer {
    /// Decides whether the rasteriser's device fills the window, by plan and engines, and records the decision.
    pub(super) fn decide_showing_quad(&mut self) {
        self.showing = None;
        let pictures = match self.joined {
            _ if self.engines.differ() => RayPictures::Apart,
            Some(_) if self.shares_picture => RayPictures::Shared,
            Some(_) if !self.lent => RayPictures::Apart,
            _ => RayPictures::Lent,
        };
        let (raster, rays) = (&mut *self.engines.raster, &mut *self.engines.rays);
        let decided = self.plan.decide_showing_quad(raster, rays, pictures);
        self.showing = decided.and_then(Result::ok);
    }

    /// The quad that the device fills in this frame; `None` if the host fills the window.
    pub(super) fn in_place(&self) -> Option<&ShowingQuad> {
        self.showing.as_ref().filter(|_| self.takes != Takes::Everything && !self.shows_everything)
    }

    /// Whether the output of the pass at an index of the plan stays on the device, for the quad.
    pub(super) fn stays(&self, index: usize) -> bool {
        self.in_place().is_some_and(|quad| quad.reads(index))
    }

    /// The attachments of a target that the quad reads on the device.
    pub(super) fn read_in_place(&self, target: Option<usize>) -> Attachments {
        self.in_place().map_or_else(Attachments::default, |quad| quad.attachments(target))
    }

    /// Whether the rasteriser's device fills the window in frames whose caller takes only the picture.
    #[must_use]
    pub fn fills_window_on_device(&self) -> bool {
        self.showing.is_some() && !self.shows_everything
    }

    /// Renders a frame, with every pass, and returns the written part of the picture as 8-bit display codes. If the plan's
    /// decisions say that the last quad pass runs on the rasteriser's device, only these 4 bytes a pixel are copied into host memory. Then
    /// [`Self::holds`] is false for the channels that the quad reads, and [`Self::window_image`] is decoded from the codes.
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
            // A fallback took over within the frame, so the host filled the window.
            None => Ok(Codes::of(&self.picture(self.plan.parts.list[0].written)?, self.plan.display)?),
        }
    }

    /// [`Self::draw_frame`] for a picture that will only be written to `path` by [`Self::save`]. Whatever is not in that file may
    /// stay on the device, as in [`Self::displayed_frame`]; for a PNG file only 4 bytes a pixel are copied.
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

    /// The displayed picture, decoded from its codes to floats; `None` if the last frame has no codes, or there is no memory.
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
        // Reuses the memory of the last picture.
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
