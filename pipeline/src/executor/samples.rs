//! Several samples a pixel: the passes run once for each sample, and the mean of the pictures is shown.
//!
//! Each sample is a complete picture with one sample a pixel, from a camera that is shifted so that the sample positions are its
//! pixel centres. So every pass works as without supersampling, whatever engine runs it, and only the sums take additional memory.
//! With an adaptive number of samples, ray passes skip pixels, which takes memory for their [`shares`](super::shares).

use super::{Observer, RenderError, Renderer};
use crate::image::Image;
use crate::memory::{self, Refused};
use crate::pixel_samples::PixelSamples;
use crate::plan::{PlanError, PlannedPass, Work};
use crate::programs::{Fidelity, RayParams, RayProgram, Sampler};
use crate::project::ChannelRef;
use rayon::prelude::*;

/// The averaged output: `None` for the window, or a channel that is kept for inspection.
type Averaged = Option<ChannelRef>;

/// Sums of the samples' pictures in `f64`. Up to 64 samples add up without rounding, unless one is below 2^-23 of the largest, so
/// the mean is rounded once.
struct Sums {
    of: Averaged,
    pixels: Vec<[f64; 4]>,
}

impl Sums {
    /// Sums of no samples.
    fn new(of: Averaged, pixels: usize) -> Result<Self, Refused> {
        Ok(Self { of, pixels: memory::zeroed(pixels)? })
    }

    fn add(&mut self, picture: &[[f32; 4]]) {
        self.pixels.par_iter_mut().zip(picture).with_min_len(4096).for_each(|(sum, pixel)| {
            sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += f64::from(*value));
        });
    }

    /// Writes the mean of `count` samples into `picture`.
    fn mean(&self, count: u32, picture: &mut [[f32; 4]]) {
        let count = f64::from(count);
        picture.par_iter_mut().zip(&self.pixels).with_min_len(4096).for_each(|(pixel, sum)| {
            *pixel = sum.map(|sum| (sum / count) as f32);
        });
    }
}

impl Renderer {
    /// Number of samples a pixel.
    pub(super) fn samples(&self) -> PixelSamples {
        self.plan.settings.aa
    }

    /// Renders the picture of one sample of every pixel, of [`aa`](crate::plan::Settings::aa) samples. The mean of all samples, added in
    /// `f64`, equals the picture of [`Self::frame`], bit for bit. This is for programs that show each sample as soon as it is complete,
    /// or that distribute samples over machines.
    ///
    /// # Errors
    /// As [`Self::frame`]; if `sample` is not below the number of samples, that number is adaptive, or the picture is rendered in bands.
    pub fn sample(&mut self, sample: u32, observer: &mut dyn Observer) -> Result<Image, RenderError> {
        self.settle(observer)?;
        let samples = self.samples();
        if sample >= samples.count() {
            let (message, most) = (format!("there is no sample {sample} of {samples} a pixel"), samples.count() - 1);
            return Err(PlanError { message, help: Some(format!("valid: 0 to {most}")) }.into());
        }
        if samples.tolerance().is_some() {
            let message = format!("what a sample of {samples} is depends on those before");
            let help = format!("use --aa {}, of which each is a picture of its own", samples.count());
            return Err(PlanError { message, help: Some(help) }.into());
        }
        if self.plan.parts.list.len() > 1 {
            let message = "a sample is a whole picture, and this one is rendered in bands".to_owned();
            return Err(PlanError { message, help: Some("raise --max-memory, or leave --bands out".to_owned()) }.into());
        }
        self.begin_frame();
        // Ray counts are summed over the samples of a frame; this sample belongs to no frame.
        self.timeline.rows.iter_mut().for_each(|row| row.rays = None);
        self.taken = 0;
        let drawn = self.draw_sample(0, sample, self.all_passes(), observer);
        if samples.are_several() {
            // The passes' results are those of this sample alone.
            self.ran.fill(None);
        }
        drawn?;
        self.end_frame();
        Ok(self.picture(self.plan.parts.list[0].written)?)
    }

    /// Runs passes for a part of the picture. `run` says by index of the plan's passes which passes run. With several samples a pixel
    /// either all passes run or none, because only the mean is kept.
    pub(super) fn draw_part(
        &mut self,
        part: usize,
        run: Vec<bool>,
        observer: &mut dyn Observer,
    ) -> Result<(), RenderError> {
        self.taken = 0;
        if !self.samples().are_several() {
            return self.draw_sample(part, 0, run, observer);
        }
        if !run.contains(&true) {
            self.passes_run.clear();
            return Ok(());
        }
        let drawn = self.draw_samples(part, observer);
        self.shares.clear();
        if drawn.is_err() {
            // After a failure the results are those of one sample, and the window holds no mean.
            self.ran.fill(None);
        }
        drawn
    }

    /// Runs all passes for each sample of a part, and stores the mean in the window and in the shown channels.
    fn draw_samples(&mut self, part: usize, observer: &mut dyn Observer) -> Result<(), RenderError> {
        self.place_targets(part)?;
        let averaged = [None].into_iter().chain(self.plan.shown.iter().copied().map(Some));
        let mut sums: Vec<Sums> =
            averaged.map(|of| Sums::new(of, self.averaged(of).len())).collect::<Result<_, _>>()?;
        let samples = self.samples();
        for (taken, sample) in (0..).zip(samples.order()) {
            self.taken = taken;
            self.draw_sample(part, sample, self.all_passes(), observer)?;
            sums.iter_mut().for_each(|sums| sums.add(self.averaged(sums.of)));
        }
        for sums in &sums {
            let (_, pixels) = self.pixels_mut(sums.of);
            sums.mean(samples.count(), pixels);
        }
        Ok(())
    }

    fn averaged(&self, of: Averaged) -> &[[f32; 4]] {
        of.map_or(&self.window.color, |channel| self.channel(channel))
    }

    /// The work of a planned pass, adapted to the current sample.
    pub(super) fn for_sample(&self, planned: &PlannedPass) -> PlannedPass {
        let mut planned = planned.clone();
        let (samples, sample) = (self.samples(), self.sample);
        if samples.are_several() {
            let gbuffer = self.plan.seen_by(&planned);
            match &mut planned.work {
                Work::Raster { view, viewport, .. } => *view = view.of_sample(*viewport, samples, sample),
                Work::Effect { view, .. } => *view = view.of_sample(gbuffer, samples, sample),
                Work::Rays { view, .. } if gbuffer.width > 0 => *view = view.of_sample(gbuffer, samples, sample),
                // These rays start at the points of the G-buffer, which was drawn with the sample's shift. All samples have the same eye.
                Work::Rays { .. }
                | Work::Off { .. }
                | Work::Quad { .. }
                | Work::Intersection { .. }
                | Work::Compute => {}
            }
        }
        planned
    }

    /// Constants and seed of a ray pass for the current sample. Sobol sequences continue where the sequence of the previous sample ended.
    /// In thesis fidelity, with other samplers, or on a backend that cannot continue sequences, each sample has its own seed.
    pub(super) fn random_of_sample(&self, pass: &str, program: RayProgram, params: RayParams) -> (RayParams, u32) {
        let (settings, sample) = (&self.plan.settings, self.sample);
        if sample == 0 {
            return (params, settings.seed);
        }
        let params = RayParams { photon_batch: sample, ..params };
        let sequence = settings.fidelity == Fidelity::Corrected && params.sampler == Sampler::Sobol;
        if !(sequence && self.engines.rays_of(pass).continues_sequences()) {
            return (params, PixelSamples::seed(settings.seed, sample));
        }
        let info = program.info();
        let [first, first_path, first_sun] =
            [info.samples(&params), params.paths, info.sun_samples(&params)].map(|samples| sample * samples);
        (RayParams { first, first_path, first_sun, ..params }, settings.seed)
    }

    /// The seed of an effect pass for the current sample.
    pub(super) fn seed_of_sample(&self) -> u32 {
        PixelSamples::seed(self.plan.settings.seed, self.sample)
    }
}
