//! What a benchmark writes: one file of rows, each with all its samples, and the machine that they were taken on.

use crate::environment::Environment;
use crate::pipeline::backend::{Answers, RayCounts};
use crate::pipeline::executor::{StepKind, median};
use crate::pipeline::metrics::Comparison;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Version of the layout below: files of another version are not resumed.
pub const FORMAT: u32 = 1;

/// A benchmark, whole or interrupted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BenchFile {
    /// [`FORMAT`].
    pub format: u32,
    /// The command that wrote it.
    pub command: String,
    /// When it was begun, seconds since 1970.
    pub started_unix_s: u64,
    /// Where.
    pub environment: Environment,
    /// Frames measured of each row.
    pub frames: u32,
    /// Frames rendered before, and not counted.
    pub warmup: u32,
    /// Whether every row that was asked for is there.
    pub complete: bool,
    /// The rows, in the order in which they were measured.
    pub rows: Vec<BenchRow>,
    /// What was asked for and is not there, with the reason.
    pub unavailable: Vec<Unavailable>,
    /// In a file that was merged of others, their machines; empty in all other files. [`BenchRow::machine`] is an index of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub machines: Vec<Environment>,
    /// In a file that holds one row of many, which; `None` in all other files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<PartOf>,
}

/// Which row of a benchmark a file holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartOf {
    /// The row's id.
    pub id: String,
    /// Its index, from 0.
    pub index: usize,
    /// How many rows there are.
    pub of: usize,
}

/// What a row was measured from, so that rows of one project can be told from rows of another of the same name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs {
    /// Hash of all that the project declares: passes, cameras, lights, targets, where scenes lie.
    pub project: String,
    /// Which attributes of the scene files are read.
    pub needs: String,
    /// Hash of the content of its scenes, as far as it is read.
    pub scenes: String,
}

/// An engine or a row that could not be measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unavailable {
    /// What.
    pub what: String,
    /// Why not, and what would help.
    pub why: String,
}

/// How an effect is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Technique {
    /// No effect at all.
    None,
    /// By rays.
    Rays,
    /// By maps or loops over the G-buffer.
    Raster,
}

/// One row: a project with its settings on one set of engines.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BenchRow {
    /// What tells it from all other rows: a row that a file has already is not measured again.
    pub key: String,
    /// What a reader calls it: `AO, 100 samples`.
    pub label: String,
    /// `none`, `dummy`, `shadows`, `reflection`, `refraction`, `ao`, `all-but-ao`, `all`.
    pub effect: String,
    /// By rays or by raster.
    pub technique: Technique,
    /// The view: `Fonte`, `Vidro`, or the camera's name.
    pub view: String,
    /// Project file.
    pub project: PathBuf,
    /// `PASS.NAME=VALUE`.
    pub set: Vec<String>,
    /// Window, pixels.
    pub size: [u32; 2],
    /// `corrected` or `thesis`.
    pub fidelity: String,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Triangles of the scene.
    pub triangles: u64,
    /// What drew.
    pub raster: EngineName,
    /// What traced; `None` where no ray pass runs.
    pub rays: Option<EngineName>,
    /// Host time of whole frames.
    pub frame: Stats,
    /// Device time of whole frames, where every step of the frame but copies has one.
    pub frame_device: Option<Stats>,
    /// Processor time of whole frames, of all threads together; `None` where the system does not tell.
    #[serde(default)]
    pub frame_processor: Option<Stats>,
    /// Steps of the frame.
    pub steps: Vec<BenchStep>,
    /// Steps done once: load, upload, build.
    pub setup: Vec<BenchStep>,
    /// Share of the frame's host time spent in ray passes, 0 to 1; `None` without a ray pass.
    pub ray_share: Option<f64>,
    /// Most memory that the process has held so far, bytes; rows measured before count too.
    pub peak_memory_bytes: Option<u64>,
    /// Bytes of targets, acceleration structure, maps, and what ray passes hold on their device.
    pub held_bytes: u64,
    /// The error of the effect: against a reference that shares the G-buffer, the programs and their formulas.
    pub error: RowError,
    /// The error of the picture: against a reference from the camera, in `f64`, of many samples a pixel. `None` in files of before 2026-11-24.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture_error: Option<RowError>,
    /// The report's figure for the same row.
    pub thesis: Option<ThesisFigure>,
    /// What it was measured from; `None` in files of before 2026-11-23, and in reports.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inputs: Option<Inputs>,
    /// Hash of the last frame's numbers, bit for bit; `None` as for [`Self::inputs`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
    /// Index into [`BenchFile::machines`]; 0 where that is empty.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub machine: usize,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(number: &usize) -> bool {
    *number == 0
}

impl BenchRow {
    /// Takes over the samples of another round of the same row. What only one of the two has is dropped.
    pub fn add(&mut self, more: &Self) {
        let both = |old: &Option<Stats>, new: &Option<Stats>| Some(old.as_ref()?.joined(new.as_ref()?));
        let rays_ms = |row: &Self| row.ray_share.map(|share| share * row.frame.mean * row.frame.n() as f64);
        let in_rays = rays_ms(self).zip(rays_ms(more));
        self.frame = self.frame.joined(&more.frame);
        self.ray_share = in_rays.map(|(old, new)| (old + new) / (self.frame.mean * self.frame.n() as f64).max(1e-9));
        self.frame_device = both(&self.frame_device, &more.frame_device);
        self.frame_processor = both(&self.frame_processor, &more.frame_processor);
        self.peak_memory_bytes = self.peak_memory_bytes.max(more.peak_memory_bytes);
        for (steps, more) in [(&mut self.steps, &more.steps), (&mut self.setup, &more.setup)] {
            for step in steps {
                if let Some(more) = more.iter().find(|more| more.kind == step.kind && more.name == step.name) {
                    step.host = step.host.joined(&more.host);
                    step.device = both(&step.device, &more.device);
                    step.mrays_per_second =
                        step.rays.map(|rays| rays.total() as f64 / 1e3 / step.host.median.max(1e-6));
                }
            }
        }
    }
}

/// Name of an engine and its device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct EngineName {
    /// `cpu`, `wgpu`, `cuda`, `optix`.
    pub name: String,
    /// Device and driver.
    pub device: String,
}

/// Error of a row's picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowError {
    /// Measured.
    Against {
        /// What the reference is, in words.
        reference: String,
        /// Its key in the cache.
        key: String,
        /// Estimated root mean square error of the reference itself; 0 for one that has no noise.
        own_error: f64,
        /// Test against reference.
        comparison: Comparison,
    },
    /// Not measured, and why.
    Missing(String),
}

impl RowError {
    /// What was found, with the estimated error of the reference itself; `None` where nothing was measured.
    #[must_use]
    pub fn found(&self) -> Option<(&Comparison, f64)> {
        match self {
            Self::Against { own_error, comparison, .. } => Some((comparison, *own_error)),
            Self::Missing(_) => None,
        }
    }

    /// Whether so much of the root mean square error is the reference's own that it tells only what the error is at most: less than twice
    /// that.
    #[must_use]
    pub fn is_at_most(&self) -> bool {
        self.found().is_some_and(|(comparison, own_error)| comparison.rmse < 2.0 * own_error)
    }
}

/// One step.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BenchStep {
    /// What it is.
    pub kind: StepKind,
    /// Its pass, scene or engine.
    pub name: String,
    /// Host time.
    pub host: Stats,
    /// Device time.
    pub device: Option<Stats>,
    /// Rays of one frame.
    pub rays: Option<RayCounts>,
    /// Millions of rays a second of median host time.
    pub mrays_per_second: Option<f64>,
    /// What answered the pixels of glass of one frame, in an effect that marches rays through the picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answers: Option<Answers>,
    /// What was done.
    pub note: String,
}

/// The report's own figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThesisFigure {
    /// Milliseconds a frame.
    pub frame_ms: f64,
    /// Percentage of it in the ray pass.
    pub ray_percent: Option<f64>,
    /// The machine of the report.
    pub machine: String,
    /// The report's time divided by our median: above 1 where ours is faster. `None` where the row has another size than
    /// the report's: times of different numbers of pixels have no ratio.
    pub ratio: Option<f64>,
}

/// Times of one thing, milliseconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stats {
    /// All samples, in order.
    pub samples: Vec<f64>,
    /// The middle one.
    pub median: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation of the samples (divided by n - 1; 0 for one sample).
    pub sd: f64,
    /// Least.
    pub min: f64,
    /// Most.
    pub max: f64,
}

impl Stats {
    /// Of at least one sample; `None` for none.
    #[must_use]
    pub fn new(samples: Vec<f64>) -> Option<Self> {
        let n = samples.len() as f64;
        let (min, max) =
            samples.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), s| (min.min(*s), max.max(*s)));
        let mean = samples.iter().sum::<f64>() / n;
        let squares: f64 = samples.iter().map(|sample| (sample - mean).powi(2)).sum();
        let sd = if samples.len() > 1 { (squares / (n - 1.0)).sqrt() } else { 0.0 };
        (!samples.is_empty()).then(|| Self { median: median(&samples), samples, mean, sd, min, max })
    }

    /// Of these samples and more of the same.
    #[must_use]
    pub fn joined(&self, more: &Self) -> Self {
        Self::new([self.samples.as_slice(), &more.samples].concat()).unwrap_or_else(|| self.clone())
    }

    /// Number of samples.
    #[must_use]
    pub fn n(&self) -> usize {
        self.samples.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_known_samples() {
        let stats = Stats::new(vec![2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).expect("samples");
        assert_eq!((stats.median, stats.mean, stats.min, stats.max, stats.n()), (4.5, 5.0, 2.0, 9.0, 8));
        assert!((stats.sd - (32.0_f64 / 7.0).sqrt()).abs() < 1e-12);
        assert_eq!(Stats::new(vec![3.0]).expect("one").sd, 0.0);
        assert_eq!(Stats::new(Vec::new()), None);
    }
}
