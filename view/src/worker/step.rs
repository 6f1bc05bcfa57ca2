//! One step of the renderer's thread: a frame, a batch of samples, a look into a pixel, a comparison.

use super::facts::{camera_in_use, ray_parameters};
use super::inspect::{Inspector, PixelRays};
use super::pace::Lets;
use super::picture::Picture;
use super::session::Session;
use super::side::What;
use super::{Activity, NO_SAMPLES, Refinement, lock};
use curitiba::pipeline::executor::{Accumulation, RenderError, Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::Preview;
use curitiba::pipeline::project::{PassKind, Pose};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Samples per point in the first batch.
const FEW: u32 = 4;
/// Greatest number of samples per point in a batch, so that a batch does not delay other work for long.
const BATCH: u64 = 16;
/// Least number of samples at which accumulation at rest ends. A power of two, at which the picture equals that of all samples at once.
const GOAL: u64 = 256;

impl Session {
    /// Does the most urgent work.
    pub fn step(&mut self) {
        if self.opening {
            self.open();
        } else if self.renderer.is_none() || self.paused {
            self.look_at_files();
        } else if let Some(pose) = self.pose.take() {
            self.tell_activity(Activity::Moving);
            self.move_camera(pose);
        } else if self.rested() {
            self.end_moving();
        } else if self.moved.is_some() {
        } else if self.frame_due {
            self.tell_activity(Activity::Rendering);
            self.frame();
        } else if self.show_due {
            self.show();
        } else if self.pixel_due {
            self.look_into_pixel();
        } else if self.near_due() {
            self.obtain_near(false);
        } else if self.refine_due {
            self.tell_activity(Activity::Refining);
            self.refine();
        } else if self.far_due() {
            self.start_far();
        } else if self.compare_due {
            self.compare();
        } else {
            self.look_at_files();
        }
        if self.patience() != Some(Duration::ZERO) && self.moved.is_none() {
            self.tell_activity(match (&self.renderer, self.paused) {
                (None, _) => Activity::Failed,
                (_, true) => Activity::Paused,
                _ if self.job.is_some() => Activity::Comparing,
                _ => Activity::Resting,
            });
        } else if lock(&self.shared.state).activity == Activity::Resting {
            // Reported before the commands are counted as taken: otherwise a caller that waits until its command is taken and the thread rests
            // would see the earlier state of rest.
            self.tell_activity(Activity::Rendering);
        }
    }

    fn look_at_files(&mut self) {
        if self.source.watch && self.watch.changed() {
            self.take(super::Command::Reload);
        }
    }

    /// Allows commands to cancel the current step from now on.
    fn may_be_given_up(&self) {
        lock(&self.shared.busy).since = Some(Instant::now());
    }

    /// Reports a failure of the step. A cancelled step is not reported, but stays due.
    fn fail(&mut self, error: &RenderError) {
        if !matches!(error, RenderError::Cancelled) {
            (self.frame_due, self.refine_due, self.pixel_due) = (false, false, false);
            let error = error.to_string();
            self.shared.change(|state| state.error = Some(error));
        }
    }

    /// Renders a complete picture with the settings: the picture of `curitiba render`.
    fn frame(&mut self) {
        self.may_be_given_up();
        let Some(renderer) = &mut self.renderer else { return };
        renderer.forget_frames();
        match renderer.update(&mut Silent) {
            Ok(image) => {
                self.frame_due = false;
                (self.samples, self.accumulated) = (self.samples_of_settings(), false);
                self.note_times();
                self.times_are_whole = true;
                self.scene_changed();
                lock(&self.shared.state).refinement = None;
                self.tell_picture(image);
            }
            Err(error) => {
                self.fail(&error);
                self.tell_facts();
            }
        }
    }

    /// The largest number of occlusion samples per point of any pass; 0 if no pass takes any.
    fn samples_of_settings(&self) -> u64 {
        let most = |renderer: &Renderer| taking_samples(renderer).map(|[occlusion, _]| occlusion).max();
        self.renderer.as_ref().and_then(most).unwrap_or_default().into()
    }

    /// Stores the times of the passes of the last frame.
    fn note_times(&mut self) {
        let Some(renderer) = &self.renderer else { return };
        let plan = renderer.plan();
        let passes = &plan.project.pipelines[plan.pipeline].passes;
        self.times.resize(passes.len(), Default::default());
        let ran: Vec<&str> = renderer.passes_run().collect();
        let mut frame = vec![0.0; passes.len()];
        for (index, pass) in passes.iter().enumerate().filter(|(_, pass)| ran.contains(&pass.name.as_str())) {
            let rows = renderer.timeline().rows.iter().filter(|row| row.kind.per_frame() && row.name == pass.name);
            self.times[index].take(rows);
            frame[index] = self.times[index].host_ms as f32;
        }
        if !ran.is_empty() {
            self.history.push(frame);
        }
        let history = Arc::new(self.history.clone());
        let mut state = lock(&self.shared.state);
        state.history = history;
        state.frames += u64::from(!ran.is_empty());
    }

    /// Stores the result, and sends facts and shown picture to the window.
    fn tell_picture(&mut self, image: Image) {
        let Some(renderer) = &self.renderer else { return };
        self.result = Some(Arc::new(Picture::of_result(image, renderer.plan())));
        self.tell_facts();
        self.show();
    }

    /// Sends the shown output to the window. If it is not in host memory, requests it with another frame.
    fn show(&mut self) {
        self.show_due = false;
        match self.rendered(&What::Shown) {
            Ok(Some(picture)) => {
                self.shared.put(&picture);
                self.shared.change(|state| state.picture = Some(picture));
            }
            // The frame that writes the output is due.
            Ok(None) => return,
            Err(why) => {
                self.shown = None;
                let picture = self.result.clone();
                picture.iter().for_each(|picture| self.shared.put(picture));
                self.shared.change(|state| (state.error, state.picture) = (Some(why), picture));
            }
        }
        self.obtain_near(true);
    }

    /// Renders a frame with a moved camera. The durations of the last frames determine how many samples and pixels it has.
    fn move_camera(&mut self, pose: Pose) {
        let start = Instant::now();
        self.begin_moving();
        let preview = self.pace.preview();
        let Some(renderer) = &mut self.renderer else { return };
        let camera = camera_in_use(renderer);
        let placed =
            renderer.set_pose(&camera, pose).and_then(|()| match renderer.settings().preview == Some(preview) {
                true => Ok(()),
                false => renderer.set_preview(Some(preview)),
            });
        if let Err(error) = placed {
            self.shared.change(|state| state.error = Some(error.to_string()));
            return;
        }
        self.poses.retain(|(name, _)| *name != camera);
        self.poses.push((camera, pose));
        renderer.forget_frames();
        match renderer.update(&mut Silent) {
            Ok(image) => {
                self.note_times();
                self.times_are_whole = false;
                self.tell_picture(image);
            }
            Err(error) => self.fail(&error),
        }
        self.pace.note(start.elapsed(), self.lets());
        self.moved = Some(Instant::now());
    }

    /// What may be reduced while the camera moves.
    fn lets(&self) -> Lets {
        // A crop is given in pixels of the full size, so a cropped picture keeps its size. So does one that is made of textures of random numbers.
        let scales = |renderer: &Renderer| {
            let is_random = renderer.project().targets.iter().any(|target| target.contents.is_some());
            renderer.settings().crop.is_none() && !is_random
        };
        let size = self.renderer.as_ref().is_some_and(scales);
        let samples = self
            .renderer
            .as_ref()
            .is_some_and(|renderer| taking_samples(renderer).flatten().any(|samples| samples > 1));
        Lets { samples, size }
    }

    fn begin_moving(&mut self) {
        self.look_away();
        self.changed();
        (self.frame_due, self.moved) = (false, Some(Instant::now()));
        // The metrics and the map of a comparison belong to the picture before the move.
        self.shared.change(|state| (state.refinement, state.error, state.compared) = (None, None, None));
    }

    /// Ends the move: everything is rendered again at full quality. Returns the reduction that was in effect; `None` if the camera did not move.
    pub fn stop_moving(&mut self) -> Option<Preview> {
        self.moved.take()?;
        let renderer = self.renderer.as_mut()?;
        let left_out = renderer.settings().preview;
        if let Err(error) = renderer.set_preview(None) {
            self.shared.change(|state| state.error = Some(error.to_string()));
        }
        self.changed();
        left_out
    }

    /// Ends a move after which the camera rests. If possible, samples are accumulated in batches from then on; otherwise a complete frame takes
    /// all of them.
    fn end_moving(&mut self) {
        self.may_be_given_up();
        let Some(preview) = self.stop_moving() else { return };
        // If times are compared with those of another renderer, a complete frame is rendered so that it can be timed.
        if self.samples_of_settings() <= preview.samples.into() || !self.refine || self.compares_times() {
            return;
        }
        let begun = self.renderer.as_mut().and_then(|renderer| renderer.accumulation(&mut Silent).ok());
        if let Some(accumulation) = begun.filter(|accumulation| !accumulation.passes().is_empty()) {
            (self.accumulation, self.frame_due, self.accumulated) = (Some(accumulation), false, false);
            self.samples = preview.samples.into();
            if preview.divisor > 1 {
                // There is no picture of the full size yet, so the first samples are shown at once.
                self.samples = 0;
                self.refine();
            }
        }
    }

    /// Accumulates one more batch of samples.
    fn refine(&mut self) {
        self.may_be_given_up();
        let goal = GOAL.max(self.samples_of_settings().next_power_of_two());
        let Some(renderer) = &mut self.renderer else { return };
        let begun = match self.accumulation.take() {
            Some(accumulation) => Ok(accumulation),
            None => renderer.accumulation(&mut Silent),
        };
        let mut accumulation = match begun {
            Ok(accumulation) if accumulation.passes().is_empty() => {
                return self.end_refinement(NO_SAMPLES);
            }
            Ok(accumulation) => accumulation,
            // Settings that exclude accumulation are no failure: the picture has all samples that were asked for.
            Err(RenderError::Plan(error)) => return self.end_refinement(&error.to_string()),
            Err(error) => return self.fail(&error),
        };
        let taken = accumulation.samples();
        if taken >= goal {
            // Refinement was asked for again after it had ended.
            (self.accumulation, self.refine_due) = (Some(accumulation), false);
            return;
        }
        let batch = taken.clamp(FEW.into(), BATCH).min(goal - taken);
        let mut result = accumulation.add(renderer, batch as u32, &mut Silent);
        let samples = accumulation.samples();
        let shows = result.is_ok() && samples > self.samples;
        if shows {
            result = accumulation.show(renderer, &mut Silent);
        }
        match result {
            Ok(()) => {
                let image = shows.then(|| renderer.window_image());
                self.tell_refinement(&accumulation, goal);
                self.refine_due = samples < goal;
                self.accumulation = Some(accumulation);
                if let Some(image) = image {
                    (self.samples, self.accumulated) = (samples, true);
                    self.tell_picture(image);
                }
            }
            Err(error) => {
                // The accumulated samples are lost, so the picture is rendered again.
                self.frame_due = self.accumulated || shows;
                self.fail(&error);
            }
        }
    }

    fn tell_refinement(&self, accumulation: &Accumulation, goal: u64) {
        let refinement = Refinement { samples: accumulation.samples(), goal, error: accumulation.error() };
        self.shared.change(|state| (state.refinement, state.not_refined) = (Some(refinement), None));
    }

    fn end_refinement(&mut self, why: &str) {
        self.refine_due = false;
        self.shared.change(|state| (state.refinement, state.not_refined) = (None, Some(why.to_owned())));
    }

    /// Renders every pass again, and collects values and rays of a pixel.
    fn look_into_pixel(&mut self) {
        self.may_be_given_up();
        let (Some(renderer), Some(pixel)) = (&mut self.renderer, self.pixel) else { return };
        if renderer.plan().in_parts() {
            self.pixel_due = false;
            let error = "rays of a pixel are of whole pictures; leave --crop and --bands out".to_owned();
            return self.shared.change(|state| state.error = Some(error));
        }
        let radius = self.bounds.map_or(1.0, |bounds| bounds.radius());
        let found = PixelRays { pixel, ..PixelRays::default() };
        let mut inspector = Inspector { found, radius, failed: None };
        let copies = renderer.engines().raster.needs_read_back();
        if copies {
            renderer.read_back_everything();
        }
        let result = renderer.draw_frame(&mut inspector);
        let back = if copies { renderer.read_back_as_planned() } else { Ok(()) };
        // The frame has replaced the accumulated samples.
        (self.accumulation, self.refine_due) = (None, self.refine);
        match result {
            Ok(()) => {
                self.pixel_due = false;
                self.frame_due = self.accumulated;
                let Inspector { found, failed, .. } = inspector;
                self.shared.change(|state| {
                    state.pixel = Some(Arc::new(found));
                    state.error = failed.or(back.err().map(|error| error.to_string()));
                });
            }
            Err(error) => self.fail(&error),
        }
    }
}

/// For each ray pass, its number of occlusion samples and of samples of the light's disc at full quality.
fn taking_samples(renderer: &Renderer) -> impl Iterator<Item = [u32; 2]> {
    let (plan, settings) = (renderer.plan(), renderer.settings());
    plan.project.pipelines[plan.pipeline].passes.iter().filter_map(|pass| match &pass.kind {
        PassKind::Ray(ray) => {
            let values = ray_parameters(&pass.name, ray.params, settings);
            Some([ray.program.info().samples(&values), ray.program.info().sun_samples(&values)])
        }
        _ => None,
    })
}
