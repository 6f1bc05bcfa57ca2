//! Progressive rendering: ray passes that take samples continue the same sample sequence, batch after batch.
//!
//! Owen-scrambled Sobol points form a sequence: its first 64 points are the first 4 points, the next 4, and so on. So 16 batches of 4
//! samples, each of which continues where the batch before ended, trace the same rays as 64 samples at once. New seeds for each batch
//! would lose the advantage of the sequence: an error that falls like n^-0.75 instead of n^-0.5.
//!
//! Shadow rays over the light's disc are accumulated in the same way. Each batch shoots new photons, which continue their sequence as
//! well and are averaged over smaller and smaller discs.
//!
//! Where a pass writes a share of light raised to an exponent, its batches are traced with exponent 1. The exponent is applied to their
//! mean, since the mean of powers is not the power of the mean. With batches of 2^k samples the result equals that of all samples at
//! once, bit for bit; with other batches each share is rounded once more (by at most 2^-24 of it). A program that mixes shares into
//! colours can be accumulated only with `intensity=1`, where colours are linear in the shares; rounding of the batches then causes errors
//! of a few 2^-24.

use super::goal::{Batch, Goal, MAX_SAMPLES, WholeGoal};
use super::{Estimate, Observer, RenderError, Renderer, StepKind, dirty::spread, rays::Traced};
use crate::image::Image;
use crate::plan::{Access, Plan, PlanError, PlannedPass, Work};
use crate::programs::{Fidelity, MOST_PATHS, RayParams, RayProgramInfo, Sampler, Writes};
use crate::project::{PassKind, RayPass};
use std::time::Instant;

/// A ray pass whose samples are accumulated.
#[derive(Debug, Clone)]
pub struct AccumulatedPass {
    /// Name of the pass.
    pub name: String,
    /// Index in the plan's passes.
    index: usize,
    params: RayParams,
    /// Exponent applied to the mean: the exponent of shares, or the inverse gamma of colours.
    exponent: f32,
    estimate: Estimate,
}

impl AccumulatedPass {
    /// Mean and scatter of the pass's picture.
    #[must_use]
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// The pass's picture, not yet rounded to the format of its target.
    #[must_use]
    pub fn picture(&self) -> Image {
        let [width, height] = self.estimate.size();
        Image { width, height, pixels: self.estimate.mean(self.exponent) }
    }

    /// The standard error of each pixel of [`Self::picture`], from the scatter of the batches: `sqrt(M2 / ((batches - 1)
    /// samples))`. NaN before the second batch.
    ///
    /// The formula holds for independent batches. Batches of one Sobol sequence are not independent: they fill each other's gaps.
    /// In smooth surroundings the picture is therefore better than this estimate, increasingly so with more samples. It is an upper
    /// estimate on average, and no bound for a single pixel.
    #[must_use]
    pub fn standard_error(&self) -> Image {
        let [width, height] = self.estimate.size();
        Image { width, height, pixels: self.estimate.standard_error(self.exponent) }
    }

    /// The root mean square of [`Self::standard_error`] over all pixels and their red, green and blue, without values that are not finite;
    /// NaN before the second batch, and if no value is finite.
    #[must_use]
    pub fn error(&self) -> f64 {
        self.estimate.error(self.exponent)
    }
}

/// Accumulated samples of a frame, with the settings at the start of the accumulation.
#[derive(Debug, Clone)]
pub struct Accumulation {
    passes: Vec<AccumulatedPass>,
    /// By index of the plan's passes: whether a pass depends on an accumulated one.
    behind: Vec<bool>,
}

impl Accumulation {
    /// The accumulated passes; empty if no pass of the plan takes samples.
    #[must_use]
    pub fn passes(&self) -> &[AccumulatedPass] {
        &self.passes
    }

    /// Samples a point so far; 0 if no pass takes any.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.passes.first().map_or(0, |pass| pass.estimate.samples())
    }

    /// The largest error of the passes ([`AccumulatedPass::error`]) that is a number; 0 without passes, NaN before the second batch.
    #[must_use]
    pub fn error(&self) -> f64 {
        let none = if self.passes.is_empty() { 0.0 } else { f64::NAN };
        self.passes.iter().map(AccumulatedPass::error).fold(none, f64::max)
    }

    /// Takes one more batch of `samples` samples a point in every accumulated pass.
    ///
    /// # Errors
    /// As [`Renderer::frame`], or if `samples` is 0 or there would be more than [`MAX_SAMPLES`] in all. After an error the accumulation
    /// must not be used any more.
    ///
    /// # Panics
    /// If something other than the seed was set since the last frame; possibly if the accumulation belongs to another renderer.
    pub fn add(
        &mut self,
        renderer: &mut Renderer,
        samples: u32,
        observer: &mut dyn Observer,
    ) -> Result<(), RenderError> {
        assert!(renderer.next.is_none(), "an accumulation is of the frame as it was set when it began");
        if self.samples() + u64::from(samples) > u64::from(MAX_SAMPLES) || samples == 0 {
            let message = format!("{samples} more samples than {}", self.samples());
            return Err(PlanError { message, help: Some(format!("valid: 1 to {MAX_SAMPLES} in all")) }.into());
        }
        for pass in &mut self.passes {
            renderer.trace_batch(pass, samples, observer)?;
        }
        Ok(())
    }

    /// Writes the accumulated pictures into their targets, and runs the passes that depend on them. The window then shows the
    /// result.
    ///
    /// # Errors
    /// As [`Renderer::frame`].
    ///
    /// # Panics
    /// As [`Self::add`].
    pub fn show(&self, renderer: &mut Renderer, observer: &mut dyn Observer) -> Result<(), RenderError> {
        assert!(renderer.next.is_none(), "an accumulation is of the frame as it was set when it began");
        for pass in &self.passes {
            let planned = &renderer.plan.passes[pass.index];
            let target = renderer.plan.pass(planned).target;
            if pass.estimate.samples() > 0 {
                if let Some(buffer) = renderer.plan.pass(planned).kind.linear() {
                    renderer.fill_linear(buffer, pass.estimate.size()[0], &pass.estimate.mean(1.0));
                }
                renderer.buffer(target).color = pass.picture().pixels;
                renderer.round_to_formats(target);
            }
        }
        renderer.draw_part(0, self.behind.clone(), observer)
    }
}

impl Renderer {
    /// Prepares an accumulation: runs the outdated passes that neither take samples nor depend on a pass that takes samples.
    ///
    /// # Errors
    /// As [`Self::frame`], or where samples cannot be accumulated: with strata, which form no sequence, and so in thesis fidelity; for
    /// colours with an exponent (`final` with an `intensity` other than 1); for glass that is sampled to an error ([`RayParams::error`]);
    /// for a pass that depends on another accumulated pass; for pictures in bands, and with several samples a pixel; on a backend that
    /// does not [continue sequences](crate::backend::RayBackend::continues_sequences).
    pub fn accumulation(&mut self, observer: &mut dyn Observer) -> Result<Accumulation, RenderError> {
        self.settle(observer)?;
        if self.samples().are_several() {
            let message =
                format!("samples are accumulated at one place of every pixel, and {} are asked for", self.samples());
            let help = "leave --accumulate out: samples of passes go on from one sample of a pixel to the next; --set PASS.samples=N says \
                        how many each takes";
            return Err(PlanError { message, help: Some(help.to_owned()) }.into());
        }
        if self.plan.parts.list.len() > 1 {
            let message = "samples are accumulated over a whole picture, and this one is rendered in bands".to_owned();
            return Err(PlanError { message, help: Some("raise --max-memory, or leave --bands out".to_owned()) }.into());
        }
        let mut passes = Vec::new();
        for (index, planned) in self.plan.passes.iter().enumerate() {
            let Some((params, info)) = accumulates(&self.plan, planned)? else { continue };
            let pass = self.plan.pass(planned);
            let Some(target) = pass.target else { continue };
            let rays = self.engines.rays_of(&pass.name);
            if !rays.continues_sequences() {
                let (name, backend) = (&pass.name, rays.name());
                let message = format!(
                    "samples of pass `{name}` cannot be accumulated: the ray backend `{backend}` does not continue a sequence of samples"
                );
                let help = format!("use --set {name}.backend=cpu, or all samples at once: --set {name}.samples=N");
                return Err(PlanError { message, help: Some(help) }.into());
            }
            let (width, height) = (self.targets[target].width, self.targets[target].height);
            let is_share = info.writes == Writes::Share;
            let channels = if is_share { 1 } else { 4 };
            let exponent = match () {
                () if is_share && info.reads("intensity") => params.intensity,
                () if info.reads("gamma") => params.camera.gamma.recip(),
                () => 1.0,
            };
            let estimate = Estimate::new(width, height, channels)?;
            passes.push(AccumulatedPass { name: pass.name.clone(), index, params, exponent, estimate });
        }
        let accesses: Vec<Access> = self.plan.passes.iter().map(|planned| self.plan.access(planned)).collect();
        let mut behind = vec![false; accesses.len()];
        passes.iter().for_each(|pass| behind[pass.index] = true);
        spread(&accesses, &mut behind);
        self.check_separate(&passes, &accesses, &behind)?;
        passes.iter().for_each(|pass| behind[pass.index] = false);
        let accumulation = Accumulation { passes, behind };
        self.begin_frame();
        self.run_before(&accumulation.passes, &accumulation.behind, observer)?;
        self.end_frame();
        Ok(accumulation)
    }

    /// Accumulates until the goal is reached, and shows the result: see [`Self::window_image`] and [`Self::save`]. The table of
    /// times has one row for each pass, with the sum of all batches. Passes without samples are rendered once.
    ///
    /// # Errors
    /// As [`Self::accumulation`].
    pub fn accumulate(&mut self, goal: Goal, observer: &mut dyn Observer) -> Result<Accumulation, RenderError> {
        let start = Instant::now();
        self.settle(observer)?;
        self.timeline.begin_parts();
        let mut accumulation = self.accumulation(observer)?;
        if !accumulation.passes.is_empty() {
            let names: Vec<&str> = accumulation.passes.iter().map(|pass| pass.name.as_str()).collect();
            let progress = self.progress();
            observer.begin(StepKind::Rays, &names.join(", "), &progress);
            let reached =
                self.accumulate_batches(goal, start, &mut accumulation, &mut WholeGoal::new(observer, progress));
            observer.end();
            reached?;
        }
        accumulation.show(self, observer)?;
        self.timeline.end_parts();
        Ok(accumulation)
    }

    /// Adds batches until the goal is reached; at least one pass must accumulate. The observer sees all batches as one step.
    fn accumulate_batches(
        &mut self,
        goal: Goal,
        start: Instant,
        accumulation: &mut Accumulation,
        observer: &mut WholeGoal<'_>,
    ) -> Result<(), RenderError> {
        loop {
            let done = (accumulation.samples() as u32, accumulation.passes[0].estimate.batches());
            let next = Batch::next(goal, done, start.elapsed(), || accumulation.error());
            let Some(Batch { samples, shares }) = next else { return Ok(()) };
            observer.expect(shares, accumulation.passes.len());
            accumulation.add(self, samples, observer)?;
            if observer.wants_picture() {
                accumulation.show(self, observer)?;
            }
        }
    }

    /// Fails if an accumulated pass depends on another accumulated pass, or if a later pass overwrites the inputs of an accumulated pass.
    fn check_separate(
        &self,
        passes: &[AccumulatedPass],
        accesses: &[Access],
        behind: &[bool],
    ) -> Result<(), PlanError> {
        let first = passes.first().map_or(0, |pass| pass.index);
        let refused = |pass: &str, why: &str| {
            let help = "render with samples=N of each pass instead".to_owned();
            Err(PlanError {
                message: format!("samples of pass `{pass}` cannot be accumulated: {why}"),
                help: Some(help),
            })
        };
        if behind[..first].contains(&true) {
            return refused(&passes[0].name, "a later pass writes over what it reads");
        }
        for pass in passes {
            let mut alone = vec![false; accesses.len()];
            alone[pass.index] = true;
            spread(accesses, &mut alone);
            if let Some(other) = passes.iter().find(|other| other.index != pass.index && alone[other.index]) {
                return refused(&other.name, &format!("it depends on pass `{}`, which takes samples, too", pass.name));
            }
        }
        Ok(())
    }

    /// Runs the outdated passes that neither accumulate nor depend on accumulated ones.
    fn run_before(
        &mut self,
        passes: &[AccumulatedPass],
        behind: &[bool],
        observer: &mut dyn Observer,
    ) -> Result<(), RenderError> {
        let mut run = self.outdated();
        for (index, run) in run.iter_mut().enumerate() {
            *run &= !behind[index] && passes.iter().all(|pass| pass.index != index);
        }
        self.draw_part(0, run, observer)
    }

    /// Traces one batch of samples of one pass.
    fn trace_batch(
        &mut self,
        pass: &mut AccumulatedPass,
        samples: u32,
        observer: &mut dyn Observer,
    ) -> Result<(), RenderError> {
        let mut planned = self.plan.passes[pass.index].clone();
        let PassKind::Ray(RayPass { program, .. }) = self.plan.pass(&planned).kind else {
            unreachable!("a ray pass was chosen")
        };
        let info = program.info();
        let Work::Rays { params, scene_set, .. } = &mut planned.work else { unreachable!("a ray pass was chosen") };
        let scene_set = *scene_set;
        // For rough glass, a batch follows as many paths as it takes samples, since the mean weights batches by their samples.
        let paths = samples.min(MOST_PATHS);
        let first = pass.estimate.samples() as u32;
        let of_occlusion = if info.samples(&pass.params) > 0 { samples } else { 0 };
        *params = RayParams {
            samples: of_occlusion,
            paths,
            sun_samples: samples,
            first,
            first_path: first,
            first_sun: first,
            photon_batch: pass.estimate.batches(),
            ..pass.params
        };
        if info.writes == Writes::Share && info.reads("intensity") {
            params.intensity = 1.0;
        }
        params.camera.gamma = 1.0;
        // The target no longer holds the result of an ordinary frame.
        self.ran[planned.pass] = None;
        self.check_cancelled()?;
        let traced =
            self.rays(pass.index, &planned, scene_set, &pass.name, Some((&mut pass.estimate, samples)), observer);
        self.check_cancelled()?;
        match traced? {
            Traced::Done => Ok(()),
            Traced::NothingInHost => {
                let error = crate::backend::BackendError::Device {
                    backend: self.engines.rays_of(&pass.name).name(),
                    message: "it took over in the middle of an accumulation, and the G-buffer is not in host memory; begin again"
                        .to_owned(),
                };
                self.ran.fill(None);
                Err(RenderError::Pass { pass: pass.name.clone(), frame: Some(self.frame), error })
            }
        }
    }
}

/// Parameters and program of a pass whose samples are accumulated, by the tables of programs and parameters. `None` if the pass
/// traces neither occlusion rays, camera rays nor shadow rays over the light's disc, and shoots no photons.
fn accumulates(plan: &Plan, planned: &PlannedPass) -> Result<Option<(RayParams, &'static RayProgramInfo)>, PlanError> {
    let pass = plan.pass(planned);
    let (Work::Rays { params, .. }, PassKind::Ray(ray)) = (&planned.work, &pass.kind) else { return Ok(None) };
    let info = ray.program.info();
    let of_occlusion = info.samples(params) > 0;
    if !of_occlusion && info.sun_samples(params) == 0 && ray.program.photons(params) == 0 {
        return Ok(None);
    }
    let refused = |why: String, help: String| {
        Err(PlanError {
            message: format!("samples of pass `{}` cannot be accumulated: {why}", pass.name),
            help: Some(help),
        })
    };
    if plan.settings.fidelity == Fidelity::Thesis {
        return refused(
            "in thesis fidelity they lie in strata, which are no sequence".to_owned(),
            "use --fidelity corrected".to_owned(),
        );
    }
    if let Some(error) = ray.program.sampled_to(params) {
        let help = format!("use --set {}.error=0, and `--accumulate` for an error of all of the picture", pass.name);
        return refused(format!("its glass is sampled to an error of its own, error={error}"), help);
    }
    if of_occlusion && params.sampler == Sampler::Strata {
        let help = format!("use --set {}.sampler=sobol", pass.name);
        return refused("they lie in strata, which are no sequence".to_owned(), help);
    }
    if info.reads("intensity") && of_occlusion && info.writes == Writes::Color && params.intensity != 1.0 {
        let why = format!(
            "`{}` puts the exponent intensity={} on shares before it mixes them, and a mean of powers is not the power of the mean",
            info.stem, params.intensity
        );
        let name = &pass.name;
        return refused(why, format!("use --set {name}.intensity=1, or all samples at once: --set {name}.samples=N"));
    }
    Ok(Some((*params, info)))
}
