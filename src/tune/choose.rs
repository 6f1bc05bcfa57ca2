//! Which of several measured variants is the best.

use super::{Run, Variant};
use crate::bench::Interval;
use crate::pipeline::executor::median;

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// The least error of frames that take at most so many milliseconds.
    Time(f64),
    /// The least time of frames whose error is at most this.
    Error(f64),
}

/// A variant and what was measured of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Which.
    pub variant: Variant,
    /// Times of all frames measured, milliseconds.
    pub frames_ms: Vec<f64>,
    /// The picture's error.
    pub error: f64,
}

impl Trial {
    /// Of a first run.
    #[must_use]
    pub fn new(variant: Variant, run: Run) -> Self {
        Self { variant, frames_ms: run.frames_ms, error: run.error }
    }

    /// The median of the frame times, milliseconds.
    #[must_use]
    pub fn median(&self) -> f64 {
        median(&self.frames_ms)
    }

    /// Where that lies, as far as the frames tell.
    #[must_use]
    pub fn interval(&self) -> Interval {
        Interval::of_median(&self.frames_ms).unwrap_or(Interval { low: f64::INFINITY, high: f64::INFINITY })
    }

    /// Whether it is within the goal; of a time the whole interval has to be.
    #[must_use]
    pub fn fits(&self, goal: Goal) -> bool {
        match goal {
            Goal::Time(most) => self.interval().high <= most && self.error.is_finite(),
            Goal::Error(most) => self.error <= most && self.median().is_finite(),
        }
    }
}

/// Variants that take longer than the fastest by more than this factor are slower, however uncertain their times.
const ALIKE: f64 = 1.05;

/// The variants that are within the goal, the best first, as indices.
///
/// Of a time: by their errors, and by their times where these are equal. Of an error: by their times; those that cannot be told from the
/// fastest one come first by their errors. These are the ones whose interval reaches its interval and whose median is at most
/// `ALIKE` times its median: the interval of a variant of few frames is wide, and reaches far.
#[must_use]
pub fn ranked(trials: &[Trial], goal: Goal) -> Vec<usize> {
    let mut fit: Vec<usize> = (0..trials.len()).filter(|index| trials[*index].fits(goal)).collect();
    let by_error = |a: &usize, b: &usize| {
        let key = |index: &usize| (trials[*index].error, trials[*index].median());
        let (a, b) = (key(a), key(b));
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    };
    match goal {
        Goal::Time(_) => fit.sort_by(by_error),
        Goal::Error(_) => {
            fit.sort_by(|a, b| trials[*a].median().total_cmp(&trials[*b].median()));
            if let Some(fastest) = fit.first() {
                let (reach, longest) = (trials[*fastest].interval().high, ALIKE * trials[*fastest].median());
                let (mut alike, slower): (Vec<usize>, Vec<usize>) = fit.iter().partition(|index| {
                    let trial = &trials[**index];
                    trial.interval().low <= reach && trial.median() <= longest
                });
                alike.sort_by(by_error);
                fit = [alike, slower].concat();
            }
        }
    }
    fit
}
