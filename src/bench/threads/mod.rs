//! Scaling with threads: wall time and processor time of every step of a project, on thread pools of different sizes.

pub mod clock;
pub mod file;
pub mod text;

pub use file::{ThreadsCase, ThreadsFile, ThreadsPoint, ThreadsStep};

use super::case::Case;
use super::measure::{AS_WRITTEN, MeasureOptions};
use super::model::Stats;
use crate::OpenError;
use crate::pipeline::executor::{Observer, StepKind};
use clock::{Clock, Clocked, Samples};

/// Options of a sweep.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SweepOptions {
    /// The numbers of threads; each is at least 1.
    pub threads: Vec<usize>,
    /// Number of times the project is opened with each number of threads, which gives the samples of steps that run once. At least
    /// 1.
    pub rounds: u32,
    /// Frames of each round.
    pub frames: MeasureOptions,
}

/// Why a sweep ended early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// The project cannot be opened, or a frame failed.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The system cannot start a pool of that size.
    #[error("a pool of {threads} threads cannot be had: {message}\n       name fewer with --sweep-threads")]
    Pool {
        /// Number of threads.
        threads: usize,
        /// What the system says.
        message: String,
    },
}

/// Samples of a round, and facts about its scene.
struct Round {
    samples: Samples,
    window: [u32; 2],
    triangles: u64,
    textures: u64,
}

/// Measures a case with every number of threads. Each round uses every number of threads once, so that a slowdown of the machine affects all
/// numbers alike. The renderer is dropped after each opening, so memory holds one scene at a time.
///
/// `told` is called with the round, from 1, and the number of threads before each opening. `observer` makes an observer for each opening.
///
/// # Errors
/// If a pool cannot be started, the case cannot be opened, or a frame fails.
pub fn sweep(
    case: &Case,
    options: &SweepOptions,
    observer: impl Fn() -> Box<dyn Observer> + Sync,
    mut told: impl FnMut(u32, usize),
) -> Result<ThreadsCase, SweepError> {
    let mut by_threads: Vec<(usize, Samples)> =
        options.threads.iter().map(|threads| (*threads, Samples::default())).collect();
    let mut measured = ThreadsCase::new(case);
    for round in 1..=options.rounds.max(1) {
        for (threads, samples) in &mut by_threads {
            told(round, *threads);
            let found = open_and_render(case, *threads, &options.frames, &observer)?;
            (measured.size, measured.triangles) = (found.window, found.triangles);
            measured.textures = found.textures;
            samples.extend(found.samples);
        }
    }
    measured.fill(&by_threads);
    Ok(measured)
}

/// Opens a case and renders its frames on a separate thread pool; serial parts run on one of the pool's threads.
fn open_and_render(
    case: &Case,
    threads: usize,
    options: &MeasureOptions,
    observer: &(impl Fn() -> Box<dyn Observer> + Sync),
) -> Result<Round, SweepError> {
    let failed = |error: rayon::ThreadPoolBuildError| SweepError::Pool { threads, message: error.to_string() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(failed)?;
    pool.install(|| {
        let mut shown = observer();
        let mut clock = Clock::new(shown.as_mut());
        let mut renderer = case.open(&mut clock)?;
        clock.pause();
        for _ in 0..options.warmup {
            renderer.draw_frame_for(AS_WRITTEN.as_ref(), &mut clock).map_err(OpenError::from)?;
        }
        clock.go_on();
        for _ in 0..options.frames.max(1) {
            let begun = Clocked::now();
            renderer.draw_frame_for(AS_WRITTEN.as_ref(), &mut clock).map_err(OpenError::from)?;
            clock.frame(begun);
        }
        let samples = clock.samples();
        let scenes = || renderer.scenes();
        Ok(Round {
            samples,
            window: renderer.plan().window,
            triangles: scenes().map(|scene| scene.geometry.triangles.len() as u64).sum(),
            textures: scenes().map(|scene| scene.textures.len() as u64).sum(),
        })
    })
}

impl ThreadsCase {
    fn new(case: &Case) -> Self {
        Self {
            key: case.key.clone(),
            label: case.label.clone(),
            view: case.view.clone(),
            project: case.project.clone(),
            set: case.settings.set.clone(),
            size: [0; 2],
            triangles: 0,
            textures: 0,
            frame: Vec::new(),
            steps: Vec::new(),
        }
    }

    /// Adds the samples of each number of threads to the curves; steps are in the order in which they ran.
    fn fill(&mut self, by_threads: &[(usize, Samples)]) {
        let Some((_, first)) = by_threads.first() else { return };
        let names: Vec<(StepKind, String)> = first.steps.iter().map(|(kind, name, _)| (*kind, name.clone())).collect();
        for (kind, name) in names {
            let points = by_threads.iter().filter_map(|(threads, samples)| {
                let same = |step: &&(StepKind, String, Vec<Clocked>)| step.0 == kind && step.1 == name;
                point(*threads, &samples.steps.iter().find(same)?.2)
            });
            self.steps.push(ThreadsStep { kind, points: points.collect(), name });
        }
        self.frame = by_threads.iter().filter_map(|(threads, samples)| point(*threads, &samples.frames)).collect();
    }
}

fn point(threads: usize, samples: &[Clocked]) -> Option<ThreadsPoint> {
    let processor: Option<Vec<f64>> = samples.iter().map(|sample| sample.processor_ms).collect();
    Some(ThreadsPoint {
        threads,
        wall: Stats::new(samples.iter().map(|sample| sample.wall_ms).collect())?,
        processor: processor.and_then(Stats::new),
    })
}

#[cfg(test)]
mod tests;
