//! Several samples a pixel: the passes run for one sample of every pixel after the other, and the mean of the pictures is shown.
//!
//! Each sample is a picture of its own, with one sample a pixel, of a camera whose pixels' centres are where the samples lie. So every pass
//! means what it does without, whatever runs it, and memory grows by the sums alone.

use super::{Observer, RenderError, Renderer};
use crate::image::Image;
use crate::memory::{self, Refused};
use crate::pixel_samples::PixelSamples;
use crate::plan::{PlanError, PlannedPass, Work};
use crate::programs::{Fidelity, RayParams, RayProgram, Sampler};
use crate::project::ChannelRef;
use rayon::prelude::*;

/// The window, or a channel that is kept for inspection.
type Averaged = Option<ChannelRef>;

/// Sums of the samples' pictures, in f64: up to 64 samples of which none is below 2^-23 of the largest add up without rounding, so that the
/// mean is rounded once.
struct Sums {
    of: Averaged,
    pixels: Vec<[f64; 4]>,
}

impl Sums {
    /// Of nothing yet.
    fn new(of: Averaged, pixels: usize) -> Result<Self, Refused> {
        Ok(Self { of, pixels: memory::zeroed(pixels)? })
    }

    fn add(&mut self, picture: &[[f32; 4]]) {
        self.pixels.par_iter_mut().zip(picture).with_min_len(4096).for_each(|(sum, pixel)| {
            sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += f64::from(*value));
        });
    }

    /// Writes the mean of so many.
    fn mean(&self, count: u32, picture: &mut [[f32; 4]]) {
        let count = f64::from(count);
        picture.par_iter_mut().zip(&self.pixels).with_min_len(4096).for_each(|(pixel, sum)| {
            *pixel = sum.map(|sum| (sum / count) as f32);
        });
    }
}

impl Renderer {
    /// Samples a pixel.
    pub(super) fn samples(&self) -> PixelSamples {
        self.plan.settings.aa
    }

    /// One of the [`samples`](crate::plan::Settings::aa) of every pixel: the picture of which [`Self::frame`] gives the mean of all. For
    /// programs that show each as soon as it is there, or have several machines render a picture: the mean of the samples is
    /// [`Self::frame`]'s picture, bit for bit, where they are added in `f64`.
    ///
    /// # Errors
    /// As [`Self::frame`]; if there are not so many samples, or the picture is rendered in bands.
    pub fn sample(&mut self, sample: u32, observer: &mut dyn Observer) -> Result<Image, RenderError> {
        self.settle(observer)?;
        let samples = self.samples();
        if sample >= samples.count() {
            let (message, most) = (format!("there is no sample {sample} of {samples} a pixel"), samples.count() - 1);
            return Err(PlanError { message, help: Some(format!("valid: 0 to {most}")) }.into());
        }
        if self.plan.parts.list.len() > 1 {
            let message = "a sample is a whole picture, and this one is rendered in bands".to_owned();
            return Err(PlanError { message, help: Some("raise --max-memory, or leave --bands out".to_owned()) }.into());
        }
        self.begin_frame();
        // Rays are counted over the samples of a frame, and this is one of none.
        self.timeline.rows.iter_mut().for_each(|row| row.rays = None);
        let drawn = self.draw_sample(0, sample, self.all_passes(), observer);
        if samples.are_several() {
            // What the passes left is of this sample alone.
            self.ran.fill(None);
        }
        drawn?;
        self.end_frame();
        Ok(self.picture(self.plan.parts.list[0].written)?)
    }

    /// Runs passes for a part of the picture: those that `run` says, by index of the plan. With several samples a pixel it is all or none of
    /// them, because only the mean is kept.
    pub(super) fn draw_part(
        &mut self,
        part: usize,
        run: Vec<bool>,
        observer: &mut dyn Observer,
    ) -> Result<(), RenderError> {
        if !self.samples().are_several() {
            return self.draw_sample(part, 0, run, observer);
        }
        if !run.contains(&true) {
            self.passes_run.clear();
            return Ok(());
        }
        let drawn = self.draw_samples(part, observer);
        if drawn.is_err() {
            // What the passes left is of one sample, and the window has no mean.
            self.ran.fill(None);
        }
        drawn
    }

    /// Runs all passes for each sample of a part, and leaves the mean in the window and in the channels that are kept.
    fn draw_samples(&mut self, part: usize, observer: &mut dyn Observer) -> Result<(), RenderError> {
        self.place_targets(part)?;
        let averaged = [None].into_iter().chain(self.plan.shown.iter().copied().map(Some));
        let mut sums: Vec<Sums> =
            averaged.map(|of| Sums::new(of, self.averaged(of).len())).collect::<Result<_, _>>()?;
        let samples = self.samples().count();
        for sample in 0..samples {
            self.draw_sample(part, sample, self.all_passes(), observer)?;
            sums.iter_mut().for_each(|sums| sums.add(self.averaged(sums.of)));
        }
        for sums in &sums {
            let (_, pixels) = self.pixels_mut(sums.of);
            sums.mean(samples, pixels);
        }
        Ok(())
    }

    fn averaged(&self, of: Averaged) -> &[[f32; 4]] {
        of.map_or(&self.window.color, |channel| self.channel(channel))
    }

    /// The work of a planned pass for the sample that is being rendered.
    pub(super) fn for_sample(&self, planned: &PlannedPass) -> PlannedPass {
        let mut planned = planned.clone();
        let (samples, sample) = (self.samples(), self.sample);
        if samples.are_several() {
            let gbuffer = self.plan.seen_by(&planned);
            match &mut planned.work {
                Work::Raster { view, viewport, .. } => *view = view.of_sample(*viewport, samples, sample),
                Work::Effect { view, .. } => *view = view.of_sample(gbuffer, samples, sample),
                Work::Rays { view, .. } if gbuffer.width > 0 => *view = view.of_sample(gbuffer, samples, sample),
                // Rays leave from the G-buffer's points, and from the eye.
                Work::Rays { .. } | Work::Off { .. } | Work::Quad { .. } => {}
            }
        }
        planned
    }

    /// The constants and the seed of a ray pass for the sample that is being rendered: sequences go on where the sample before ended;
    /// what is no sequence, or is continued by no engine, has other random numbers.
    pub(super) fn random_of_sample(&self, pass: &str, program: RayProgram, params: RayParams) -> (RayParams, u32) {
        let (settings, sample) = (&self.plan.settings, self.sample);
        if sample == 0 {
            return (params, settings.seed);
        }
        let sequence = settings.fidelity == Fidelity::Corrected && params.sampler == Sampler::Sobol;
        if !(sequence && self.engines.rays_of(pass).continues_sequences()) {
            return (params, PixelSamples::seed(settings.seed, sample));
        }
        let info = program.info();
        let [first, first_path, first_sun] =
            [info.samples(&params), params.paths, info.sun_samples(&params)].map(|samples| sample * samples);
        (RayParams { first, first_path, first_sun, ..params }, settings.seed)
    }

    /// The seed of an effect pass for the sample that is being rendered.
    pub(super) fn seed_of_sample(&self) -> u32 {
        PixelSamples::seed(self.plan.settings.seed, self.sample)
    }
}
