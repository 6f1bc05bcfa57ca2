//! Wall time and processor time of the steps of a frame, taken by an observer.

use crate::pipeline::backend::RayJob;
use crate::pipeline::executor::{Fallback, Observer, Output, Progress, StepKind, Triangles};
use crate::pipeline::image::Image;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The processor time that all threads of this process have used so far, those that ended too; `None` where the system
/// does not tell.
#[must_use]
pub fn processor_time() -> Option<Duration> {
    #[cfg(unix)]
    {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Some(Duration::new(u64::try_from(now.tv_sec).ok()?, u32::try_from(now.tv_nsec).ok()?))
    }
    #[cfg(not(unix))]
    {
        None
    }
}

/// Both clocks at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    wall: Instant,
    processor: Option<Duration>,
}

/// How long something took, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clocked {
    /// By the clock on the wall.
    pub wall_ms: f64,
    /// Of all threads together, those that wait busily included; `None` where the system does not tell.
    pub processor_ms: Option<f64>,
}

impl Clocked {
    /// The moment from which [`Self::since`] counts.
    #[must_use]
    pub fn now() -> Moment {
        Moment { wall: Instant::now(), processor: processor_time() }
    }

    /// What has passed since.
    #[must_use]
    pub fn since(begun: Moment) -> Self {
        let processor = processor_time().zip(begun.processor).map(|(now, then)| now.saturating_sub(then));
        Self {
            wall_ms: begun.wall.elapsed().as_secs_f64() * 1e3,
            processor_ms: processor.map(|time| time.as_secs_f64() * 1e3),
        }
    }
}

/// Samples of whole frames and of each step, in the order in which each was first run.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// Whole frames.
    pub frames: Vec<Clocked>,
    /// Kind, name and samples of each step.
    pub steps: Vec<(StepKind, String, Vec<Clocked>)>,
}

impl Samples {
    fn add(&mut self, kind: StepKind, name: String, samples: impl IntoIterator<Item = Clocked>) {
        match self.steps.iter_mut().find(|step| step.0 == kind && step.1 == name) {
            Some((_, _, known)) => known.extend(samples),
            None => self.steps.push((kind, name, samples.into_iter().collect())),
        }
    }

    /// Appends those of another round.
    pub fn extend(&mut self, other: Self) {
        self.frames.extend(other.frames);
        other.steps.into_iter().for_each(|(kind, name, samples)| self.add(kind, name, samples));
    }
}

/// An observer that takes the time of every step between its beginning and its end, and passes on what it hears.
///
/// On the cpu engines that is the executor's own host time, give or take a microsecond. On others a step's copies are in
/// it, which the executor counts apart.
pub struct Clock<'o> {
    shown: &'o mut dyn Observer,
    running: Option<(StepKind, String, Moment)>,
    is_paused: bool,
    samples: Samples,
}

impl<'o> Clock<'o> {
    /// A clock that runs.
    pub fn new(shown: &'o mut dyn Observer) -> Self {
        Self { shown, running: None, is_paused: false, samples: Samples::default() }
    }

    /// Steps that begin from now on are not counted.
    pub fn pause(&mut self) {
        self.is_paused = true;
    }

    /// Steps that begin from now on are counted again.
    pub fn go_on(&mut self) {
        self.is_paused = false;
    }

    /// Counts a frame that ends now.
    pub fn frame(&mut self, begun: Moment) {
        self.samples.frames.push(Clocked::since(begun));
    }

    /// Everything counted.
    #[must_use]
    pub fn samples(self) -> Samples {
        self.samples
    }
}

impl Observer for Clock<'_> {
    fn begin(&mut self, kind: StepKind, name: &str, progress: &Arc<Progress>) {
        self.shown.begin(kind, name, progress);
        self.running = (!self.is_paused).then(|| (kind, name.to_owned(), Clocked::now()));
    }

    fn end(&mut self) {
        if let Some((kind, name, begun)) = self.running.take() {
            let sample = Clocked::since(begun);
            self.samples.add(kind, name, [sample]);
        }
        self.shown.end();
    }

    fn wrote(&mut self, output: &Output<'_>) {
        self.shown.wrote(output);
    }

    fn wrote_triangles(&mut self, triangles: &Triangles<'_>) {
        self.shown.wrote_triangles(triangles);
    }

    fn traced(&mut self, pass: &str, job: &RayJob<'_>, picture: &Image) {
        self.shown.traced(pass, job, picture);
    }

    fn fell_back(&mut self, fallback: &Fallback) {
        self.shown.fell_back(fallback);
    }
}
