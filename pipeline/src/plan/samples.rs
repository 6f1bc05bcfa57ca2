//! Several samples a pixel: their cost, and channels that cannot be averaged.

use super::{Plan, PlanError, PlannedPass};
use crate::backend::Rect;
use crate::color::ColorSpace;
use crate::image::Content;
use crate::memory::mebibytes;
use crate::pixel_samples::PixelSamples;
use crate::plan::Work;
use crate::programs::{Fidelity, RayParams};
use crate::project::{ChannelRef, PassKind};

/// Bytes of the sum of a pixel's samples: four `f64` numbers.
const SUM: u64 = 32;

impl Plan {
    /// The content of a channel, which decides its false colours. Channels 1 and 2 of a target that a raster pass draws hold positions and
    /// normals; all other channels hold colours.
    #[must_use]
    pub fn content(&self, channel: ChannelRef) -> Content {
        let by_raster = self.passes.iter().any(|planned| {
            matches!(planned.work, Work::Raster { .. }) && self.pass(planned).target == Some(channel.target)
        });
        match channel.channel {
            1 if by_raster => Content::Position,
            2 if by_raster => Content::Normal,
            _ => Content::Color,
        }
    }

    /// Adds the decision about several samples a pixel; fails if a shown channel has no meaningful mean.
    pub(super) fn explain_samples(&mut self) -> Result<(), PlanError> {
        let samples = self.settings.aa;
        if !samples.are_several() {
            return Ok(());
        }
        for channel in &self.shown {
            let what = match self.content(*channel) {
                Content::Color => continue,
                Content::Position => "positions",
                Content::Normal => "normals",
            };
            let target = &self.project.targets[channel.target];
            let name = &target.channels[channel.channel].name;
            return Err(PlanError::new(
                format!(
                    "--show keeps the {what} of `{}::{name}`, and {samples} samples a pixel are asked for: where a pixel shows two \
                     surfaces, their mean is on neither",
                    target.library
                ),
                "leave --aa out for them; of the channels that --show names, colours are averaged as the window is",
            ));
        }
        self.check_adaptive_samples()?;
        if let Some(why) = self.cost_of_samples() {
            self.decide(format!("{samples} samples a pixel"), true, format!("--aa asks for them: {why}"));
        }
        Ok(())
    }

    /// With an adaptive number of samples, fails if ray passes cannot skip pixels whose first samples are alike, or would skip none.
    fn check_adaptive_samples(&self) -> Result<(), PlanError> {
        let samples = self.settings.aa;
        if samples.tolerance().is_none() {
            return Ok(());
        }
        let refused = |why: String| {
            let help = format!("use --aa {}, which traces all samples of every pixel", samples.count());
            Err(PlanError::new(format!("--aa {samples}: {why}"), help))
        };
        if self.settings.fidelity == Fidelity::Thesis {
            return refused("the report's programs trace from every pixel's position, surface or not".to_owned());
        }
        if self.settings.crop.is_some() || self.in_parts() {
            return refused(
                "the picture is rendered in parts, and a pixel's neighbours decide how much is traced for it"
                    .to_owned(),
            );
        }
        for (planned, _) in self.skipping() {
            let pass = self.pass(planned);
            if self.filter_levels(planned) > 0 {
                return refused(format!(
                    "{}: pass `{}` filters what it traced for a pixel's neighbours",
                    pass.place, pass.name
                ));
            }
        }
        match self.skipping().next() {
            Some(_) => Ok(()),
            None => {
                refused("no pass traces rays from what a raster pass drew, so that it would save nothing".to_owned())
            }
        }
    }

    /// The ray passes that can skip pixels, with their constants.
    fn skipping(&self) -> impl Iterator<Item = (&PlannedPass, &RayParams)> {
        self.passes.iter().filter_map(|planned| match &planned.work {
            Work::Rays { reads_triangle: true, params, .. } => Some((planned, params)),
            _ => None,
        })
    }

    /// Bytes of the data that decide which pixels ray passes skip, with an adaptive number of samples; 0 without.
    pub(super) fn share_bytes(&self) -> u64 {
        let bytes = |(planned, _): (&PlannedPass, &RayParams)| {
            PixelSamples::SHARE_BYTES * self.held_pixels(self.target_size(self.pass(planned).target))
        };
        self.settings.aa.tolerance().map_or(0, |_| self.skipping().map(bytes).sum())
    }

    /// Description of the effect and cost of several samples a pixel; `None` for one sample.
    #[must_use]
    pub fn cost_of_samples(&self) -> Option<String> {
        let samples = self.settings.aa;
        let of = match self.display.space {
            ColorSpace::Report => "of display values as they are",
            ColorSpace::Linear => "of linear radiance, before exposure and tone curve",
        };
        let (bytes, side) = (mebibytes(self.sum_bytes() + self.share_bytes()), samples.side());
        let times = match samples.tolerance() {
            None => format!("every pass runs {samples} times"),
            Some(tolerance) => format!(
                "every pass runs {} times, of which ray passes trace {} where shadows, occlusion and glass differ by at most {tolerance}",
                samples.count(),
                PixelSamples::FIRST
            ),
        };
        samples.are_several().then(|| {
            format!(
                "{times}; the picture is the mean {of}; the sums take {bytes}; textures are filtered over {side:.2} of a pixel's width"
            )
        })
    }

    /// Bytes of the sums of several samples a pixel, for the largest part; 0 for one sample.
    pub(super) fn sum_bytes(&self) -> u64 {
        if !self.settings.aa.are_several() {
            return 0;
        }
        let shown = self.shown.iter().map(|channel| self.held_pixels(self.target_size(Some(channel.target))));
        SUM * (self.held_pixels(self.window) + shown.sum::<u64>())
    }

    /// The rectangle that the camera of a pass covers: the whole G-buffer of an effect pass, or the whole target of a ray pass that starts
    /// at the camera; empty for other passes.
    #[must_use]
    pub(crate) fn seen_by(&self, planned: &PlannedPass) -> Rect {
        let pass = self.pass(planned);
        let target = match &pass.kind {
            PassKind::Effect(effect) => effect.position.map(|position| position.target),
            PassKind::Ray(ray) if ray.from_camera.is_some() => pass.target,
            _ => return Rect { x: 0, y: 0, width: 0, height: 0 },
        };
        let [width, height] = self.target_size(target);
        Rect { x: 0, y: 0, width, height }
    }
}
