//! Which of several measured variants is the best.

use super::{Run, Variant};
use crate::bench::Interval;
use crate::pipeline::executor::median;

/// The goal of a choice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// The least error of frames that take at most this time in milliseconds.
    Time(f64),
    /// The least time of frames whose error is at most this.
    Error(f64),
}

/// A variant and its measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// The variant.
    pub variant: Variant,
    /// Times of all frames measured, milliseconds.
    pub frames_ms: Vec<f64>,
    /// The picture's error, the largest of all runs; infinite if a later run failed.
    pub error: f64,
}

impl Trial {
    /// A trial with the measurements of its first run.
    #[must_use]
    pub fn new(variant: Variant, run: Run) -> Self {
        Self { variant, frames_ms: run.frames_ms, error: run.error }
    }

    /// The median of the frame times, milliseconds.
    #[must_use]
    pub fn median(&self) -> f64 {
        median(&self.frames_ms)
    }

    /// Confidence interval of the median; both ends are infinite if there is no interval.
    #[must_use]
    pub fn interval(&self) -> Interval {
        Interval::of_median(&self.frames_ms).unwrap_or(Interval { low: f64::INFINITY, high: f64::INFINITY })
    }

    /// Whether the trial is within the goal. For a goal of time, the whole interval of the median has to be within it.
    #[must_use]
    pub fn fits(&self, goal: Goal) -> bool {
        match goal {
            Goal::Time(most) => self.interval().high <= most && self.error.is_finite(),
            Goal::Error(most) => self.error <= most && self.median().is_finite(),
        }
    }
}

/// Variants whose median is longer than the fastest one's by more than this factor count as slower, however uncertain their times.
const ALIKE: f64 = 1.05;

/// The variants that are within the goal, as indices, the best first.
///
/// For a goal of time they are ordered by error, and by time where errors are equal. For a goal of error they are ordered by time, except that
/// variants that cannot be distinguished from the fastest one come first, ordered by error. These are the variants whose interval overlaps that of
/// the fastest, and whose median is at most `ALIKE` times the fastest median: few frames give wide intervals, and overlap alone would admit too
/// many variants.
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
