//! Wall time and processor time of the steps of a frame, measured by an observer.

use crate::pipeline::backend::RayJob;
use crate::pipeline::executor::{Fallback, Observer, Output, Progress, StepKind, Triangles};
use crate::pipeline::image::Image;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Processor time of all threads of this process so far, including ended ones; `None` if the system does not report it.
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

/// A reading of both clocks.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    wall: Instant,
    processor: Option<Duration>,
}

/// A duration in milliseconds, by both clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clocked {
    /// Wall time.
    pub wall_ms: f64,
    /// Processor time of all threads, including busy waiting; `None` if the system does not report it.
    pub processor_ms: Option<f64>,
}

impl Clocked {
    /// A reading of both clocks now, for [`Self::since`].
    #[must_use]
    pub fn now() -> Moment {
        Moment { wall: Instant::now(), processor: processor_time() }
    }

    /// The time since `begun`.
    #[must_use]
    pub fn since(begun: Moment) -> Self {
        let processor = processor_time().zip(begun.processor).map(|(now, then)| now.saturating_sub(then));
        Self {
            wall_ms: begun.wall.elapsed().as_secs_f64() * 1e3,
            processor_ms: processor.map(|time| time.as_secs_f64() * 1e3),
        }
    }
}

/// Samples of whole frames, and of each step in the order of first runs.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// Samples of whole frames.
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

    /// Appends the samples of another round.
    pub fn extend(&mut self, other: Self) {
        self.frames.extend(other.frames);
        other.steps.into_iter().for_each(|(kind, name, samples)| self.add(kind, name, samples));
    }
}

/// An observer that measures every step from its beginning to its end, and forwards all notifications.
///
/// For the cpu engines the wall time equals the executor's own host time within a microsecond. For other engines it includes a
/// step's copies, which the executor records separately.
pub struct Clock<'o> {
    shown: &'o mut dyn Observer,
    running: Option<(StepKind, String, Moment)>,
    is_paused: bool,
    samples: Samples,
}

impl<'o> Clock<'o> {
    /// A running clock that forwards to `shown`.
    pub fn new(shown: &'o mut dyn Observer) -> Self {
        Self { shown, running: None, is_paused: false, samples: Samples::default() }
    }

    /// From now on steps are not measured.
    pub fn pause(&mut self) {
        self.is_paused = true;
    }

    /// From now on steps are measured again.
    pub fn go_on(&mut self) {
        self.is_paused = false;
    }

    /// Records a frame that ends now.
    pub fn frame(&mut self, begun: Moment) {
        self.samples.frames.push(Clocked::since(begun));
    }

    /// All samples.
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
