//! Definition of measured times: every step's host time with synchronisation, and the device's own clock if it has one.

use crate::backend::{Answers, PathsSpent, RayCounts};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// The kind of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum StepKind {
    /// Reading scene files and preparing their geometry and textures.
    Load,
    /// Building the acceleration structure.
    Build,
    /// Uploading the scene to the rasteriser's device.
    Upload,
    /// Drawing triangles.
    Raster,
    /// Drawing the maps of a raster effect.
    Maps,
    /// Computing the pixels of a raster effect.
    Effect,
    /// Copying attachments or pictures into host memory.
    ReadBack,
    /// Copying attachments to the device that traces rays.
    Join,
    /// Tracing rays.
    Rays,
    /// Filling a rectangle, or running a compute shader.
    Quad,
    /// Writing files.
    Write,
}

impl StepKind {
    /// The name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::Build => "build",
            Self::Upload => "upload",
            Self::Raster => "raster",
            Self::Maps => "maps",
            Self::Effect => "effect",
            Self::ReadBack => "read-back",
            Self::Join => "join",
            Self::Rays => "rays",
            Self::Quad => "quad",
            Self::Write => "write",
        }
    }

    /// Whether the step is repeated for every frame.
    #[must_use]
    pub fn per_frame(self) -> bool {
        matches!(self, Self::Raster | Self::Maps | Self::Effect | Self::ReadBack | Self::Join | Self::Rays | Self::Quad)
    }
}

/// A step and its times, of one run or of every frame.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The kind of the step.
    pub kind: StepKind,
    /// Name of the pass, the scene or the file.
    pub name: String,
    /// Host time of each run, in milliseconds; if a frame runs the step several times, their sum.
    pub host_ms: Vec<f64>,
    /// Device time of each run, in milliseconds; empty if the device has no clock of its own.
    pub device_ms: Vec<f64>,
    /// Rays of the last run; if a frame runs the step several times, the sum of its runs.
    pub rays: Option<RayCounts>,
    /// Numbers of the glass pixels of the last run, by the source of their colours; only of effects that march rays through screen space.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answers: Option<Answers>,
    /// What adaptive sampling of stochastic glass spent, for the same runs as [`Self::rays`]; only of ray passes with `error`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<PathsSpent>,
    /// Share of the pixels that took all samples in the last frame, 0 to 1; only of ray passes, with an
    /// [adaptive](crate::pixel_samples::PixelSamples::within) number of samples a pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub all_samples: Option<f64>,
    /// Bytes of memory held by the step's result: an acceleration structure, maps, or the lists of a ray pass.
    pub bytes: u64,
    /// Further details, such as numbers of triangles or bytes.
    pub note: String,
    /// Every single run, even if a frame runs the step several times.
    #[serde(skip)]
    pub spans: Vec<Span>,
}

/// Start and duration of a run of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Start in milliseconds since the start of the timeline's first step.
    pub start_ms: f64,
    /// Host time in milliseconds.
    pub ms: f64,
}

impl Row {
    /// Median host time, milliseconds.
    #[must_use]
    pub fn median_ms(&self) -> f64 {
        median(&self.host_ms)
    }

    /// Millions of rays per second of host time; `None` for a step that traces none.
    #[must_use]
    pub fn mrays_per_second(&self) -> Option<f64> {
        let rays = self.rays?.total();
        (rays > 0).then(|| rays as f64 / 1e3 / self.median_ms().max(1e-6))
    }
}

/// The median: the middle value, or the mean of the two middle ones; NaN for an empty list.
#[must_use]
pub fn median(samples: &[f64]) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => f64::midpoint(sorted[n / 2 - 1], sorted[n / 2]),
    }
}

/// All steps so far, in the order of their first runs.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Timeline {
    /// The steps.
    pub rows: Vec<Row>,
    /// When the first step began.
    #[serde(skip)]
    began: Option<Instant>,
    /// By row: number of host times and of device times when the current frame began, if the frame runs steps several times.
    #[serde(skip)]
    before: Vec<[usize; 2]>,
}

impl Timeline {
    /// Records a run of a step that ends now.
    pub fn record(&mut self, kind: StepKind, name: &str, host: Duration) -> &mut Row {
        self.record_run(kind, name, host, 1)
    }

    /// Records a run, which ends now, of a step that scripts repeat. `run` is the number of the run within the frame, from 1. The times of
    /// all runs of a frame are summed to one measurement.
    pub fn record_run(&mut self, kind: StepKind, name: &str, host: Duration, run: u32) -> &mut Row {
        let now = Instant::now();
        let start = now.checked_sub(host).unwrap_or(now);
        let began = *self.began.get_or_insert(start);
        let index = self.rows.iter().position(|row| row.kind == kind && row.name == name).unwrap_or_else(|| {
            self.rows.push(Row {
                kind,
                name: name.to_owned(),
                host_ms: Vec::new(),
                device_ms: Vec::new(),
                rays: None,
                answers: None,
                adaptive: None,
                all_samples: None,
                bytes: 0,
                note: String::new(),
                spans: Vec::new(),
            });
            self.rows.len() - 1
        });
        let row = &mut self.rows[index];
        let ms = host.as_secs_f64() * 1e3;
        row.spans.push(Span { start_ms: start.saturating_duration_since(began).as_secs_f64() * 1e3, ms });
        match row.host_ms.last_mut().filter(|_| run > 1) {
            Some(sum) => *sum += ms,
            None => row.host_ms.push(ms),
        }
        row
    }

    /// Begins a frame that is rendered in parts or with several samples a pixel, or an accumulation.
    pub(super) fn begin_parts(&mut self) {
        self.before = self.rows.iter().map(|row| [row.host_ms.len(), row.device_ms.len()]).collect();
    }

    /// Ends the frame of [`Self::begin_parts`]: the times of each step are summed over its parts, samples and batches.
    pub(super) fn end_parts(&mut self) {
        let before = std::mem::take(&mut self.before);
        for (index, row) in self.rows.iter_mut().enumerate().filter(|(_, row)| row.kind.per_frame()) {
            let starts = before.get(index).copied().unwrap_or_default();
            for (samples, start) in [&mut row.host_ms, &mut row.device_ms].into_iter().zip(starts) {
                if samples.len() > start + 1 {
                    let sum = samples.drain(start..).sum();
                    samples.push(sum);
                }
            }
        }
    }

    /// Forgets the steps that are repeated for every frame, such as those of a warm-up.
    pub fn forget_frames(&mut self) {
        self.rows.retain(|row| !row.kind.per_frame());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_one_step_share_a_row_and_its_median() {
        let mut timeline = Timeline::default();
        for ms in [5, 1, 3] {
            timeline.record(StepKind::Rays, "pass2", Duration::from_millis(ms)).rays =
                Some(RayCounts { shadow: 3000, ..RayCounts::default() });
        }
        timeline.record(StepKind::Quad, "pass2", Duration::from_millis(9));
        assert_eq!(timeline.rows.len(), 2);
        let lengths: Vec<f64> = timeline.rows[0].spans.iter().map(|span| span.ms).collect();
        assert_eq!(lengths, timeline.rows[0].host_ms);
        assert_eq!(timeline.rows[0].median_ms(), 3.0);
        assert_eq!(timeline.rows[0].mrays_per_second(), Some(1.0));
        assert_eq!(timeline.rows[1].mrays_per_second(), None);
    }

    #[test]
    fn forgetting_frames_keeps_what_is_done_once() {
        let mut timeline = Timeline::default();
        timeline.record(StepKind::Load, "scene", Duration::from_millis(7));
        timeline.record(StepKind::Rays, "pass2", Duration::from_millis(5));
        timeline.forget_frames();
        timeline.record(StepKind::Rays, "pass2", Duration::from_millis(3));
        let left: Vec<_> = timeline.rows.iter().map(|row| (row.kind, row.host_ms.clone())).collect();
        assert_eq!(left, [(StepKind::Load, vec![7.0]), (StepKind::Rays, vec![3.0])]);
    }

    #[test]
    fn the_median_of_an_even_number_is_the_mean_of_the_middle_two() {
        assert_eq!(median(&[4.0, 1.0, 3.0, 2.0]), 2.5);
        assert!(median(&[]).is_nan());
    }
}
