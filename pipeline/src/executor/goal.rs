//! When an accumulation ends, and how much of it is done.

use super::{Fallback, Observer, Output, Progress, StepKind, Triangles};
use crate::backend::RayJob;
use crate::image::Image;
use std::sync::Arc;
use std::time::Duration;

/// Greatest number of samples a point that can be accumulated.
pub const MAX_SAMPLES: u32 = 1 << 24;

/// Samples of a batch when their total is not known in advance. At 16 the cost per ray is little above that of larger batches.
const BATCH: u32 = 16;

/// Parts in which the progress of an accumulation is counted.
const PARTS: u64 = 10_000;

/// When accumulation stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// After this number of samples a point, 1 to [`MAX_SAMPLES`].
    Samples(u32),
    /// After the first batch that ends later than this, but not before the second batch.
    Time(Duration),
    /// When the root mean square of the pixels' standard errors is at most this in every pass, but not before the fourth batch; or after
    /// [`MAX_SAMPLES`]. Values that are not finite are left out. Without a finite value the fourth batch is the last.
    Error(f64),
}

impl std::str::FromStr for Goal {
    type Err = String;

    /// Parses `64` (samples), `2s` or `500ms` (time), or `0.002` (error).
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is no goal; valid: a number of samples (64, up to {MAX_SAMPLES}), a time (2s, 500ms), or a standard error \
                 below 1 with a point (0.002)"
            )
        };
        let number = |text: &str| text.parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0);
        if let Some(time) = text
            .strip_suffix("ms")
            .map(|ms| number(ms).map(|ms| ms / 1e3))
            .or_else(|| text.strip_suffix('s').map(number))
        {
            let time = time.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
            return time.map(Self::Time).ok_or_else(wrong);
        }
        if text.contains('.') || text.contains(['e', 'E']) {
            return number(text).filter(|error| *error < 1.0).map(Self::Error).ok_or_else(wrong);
        }
        text.parse().ok().filter(|samples| (1..=MAX_SAMPLES).contains(samples)).map(Self::Samples).ok_or_else(wrong)
    }
}

/// A batch of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Batch {
    /// Samples a point.
    pub samples: u32,
    /// Shares of the goal that are reached before the batch and, as expected, after it; 0 to 1.
    pub shares: [f64; 2],
}

impl Batch {
    /// The next batch, given the samples and batches so far, the elapsed time and the current error; `None` when the goal is reached.
    pub fn next(
        goal: Goal,
        (done, batches): (u32, u32),
        elapsed: Duration,
        error: impl FnOnce() -> f64,
    ) -> Option<Self> {
        if done >= MAX_SAMPLES {
            return None;
        }
        match goal {
            // Powers of two, at most 64, so that each batch is well distributed by itself. From 16 samples on there are at least sixteen
            // batches, to estimate the scatter.
            Goal::Samples(wanted) if done < wanted => {
                let samples = (1 << (wanted / 16).max(1).ilog2().min(6)).min(wanted - done);
                Some(Self { samples, shares: [done, done + samples].map(|n| f64::from(n) / f64::from(wanted)) })
            }
            Goal::Time(time) if batches < 2 || elapsed < time => {
                let share = elapsed.as_secs_f64() / time.as_secs_f64();
                Some(Self::more(share, done))
            }
            Goal::Error(wanted) => {
                let error = error();
                // The estimated error falls with the root of the samples.
                let share = if error.is_nan() { 0.0 } else { (wanted / error).powi(2) };
                (batches < 4 || error > wanted).then(|| Self::more(share, done))
            }
            _ => None,
        }
    }

    /// The next batch if the number of batches is not known.
    fn more(share: f64, done: u32) -> Self {
        let before = share.clamp(0.0, 1.0);
        let after = if done == 0 { before } else { before * f64::from(done + BATCH) / f64::from(done) };
        Self { samples: BATCH, shares: [before, after.min(1.0)] }
    }
}

/// Shows an observer all batches as one step, whose progress is the share of the goal.
pub(super) struct WholeGoal<'o> {
    observer: &'o mut dyn Observer,
    progress: Arc<Progress>,
    /// The current batch's shares of the goal, as in [`Batch::shares`].
    shares: [f64; 2],
    /// Number of passes that run for a batch.
    passes: usize,
    /// Number of passes of the current batch that have begun.
    ran: usize,
}

impl<'o> WholeGoal<'o> {
    /// `progress` is the one that the observer got when the step began.
    pub fn new(observer: &'o mut dyn Observer, progress: Arc<Progress>) -> Self {
        progress.start(PARTS);
        Self { observer, progress, shares: [0.0; 2], passes: 1, ran: 0 }
    }

    /// Begins a batch for which `passes` passes run. If the batch before reached less than expected, the share of the goal does not go
    /// back.
    pub fn expect(&mut self, [before, after]: [f64; 2], passes: usize) {
        let before = before.max(self.shares[1]);
        (self.shares, self.passes, self.ran) = ([before, after.max(before)], passes, 0);
    }
}

impl Observer for WholeGoal<'_> {
    fn begin(&mut self, kind: StepKind, _: &str, progress: &Arc<Progress>) {
        if kind == StepKind::Rays && self.ran < self.passes {
            let [before, after] = self.shares;
            let at = |ran: usize| before + (after - before) * ran as f64 / self.passes as f64;
            self.progress.follow(progress, [at(self.ran), at(self.ran + 1)]);
            self.ran += 1;
        }
    }

    fn end(&mut self) {}

    fn wrote(&mut self, output: &Output<'_>) {
        self.observer.wrote(output);
    }

    fn wrote_triangles(&mut self, triangles: &Triangles<'_>) {
        self.observer.wrote_triangles(triangles);
    }

    fn traced(&mut self, pass: &str, job: &RayJob<'_>, picture: &Image) {
        self.observer.traced(pass, job, picture);
    }

    fn wants_picture(&mut self) -> bool {
        self.observer.wants_picture()
    }

    fn fell_back(&mut self, fallback: &Fallback) {
        self.observer.fell_back(fallback);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goals_are_told_apart_by_how_they_are_written() {
        for (text, goal) in [
            ("64", Goal::Samples(64)),
            ("2s", Goal::Time(Duration::from_secs(2))),
            ("0.5s", Goal::Time(Duration::from_millis(500))),
            ("500ms", Goal::Time(Duration::from_millis(500))),
            ("0.002", Goal::Error(0.002)),
            ("2e-3", Goal::Error(0.002)),
        ] {
            assert_eq!(text.parse(), Ok(goal));
        }
        for text in ["", "0", "-1", "1.5", "s", "-2s", "nan", "infs", "1e40s", "0.0", "16777217", "64 samples"] {
            assert!(text.parse::<Goal>().is_err_and(|error| error.contains("500ms")), "{text}");
        }
    }
}
