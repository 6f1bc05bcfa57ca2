//! The data of a benchmark file: rows with all their samples, and the machine.

use super::interval::Interval;
use super::outliers::Outliers;
use crate::environment::Environment;
use crate::pipeline::backend::{Answers, PathsSpent, RayCounts};
use crate::pipeline::executor::{StepKind, median};
use crate::pipeline::metrics::Comparison;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Version of the layout below. Files of other versions are not resumed.
pub const FORMAT: u32 = 1;

/// A benchmark, whole or interrupted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BenchFile {
    /// [`FORMAT`].
    pub format: u32,
    /// The command that wrote the file.
    pub command: String,
    /// Start time, seconds since 1970.
    pub started_unix_s: u64,
    /// Machine and build.
    pub environment: Environment,
    /// Frames measured of each row, in each round.
    pub frames: u32,
    /// Number of frames rendered before the measured ones of each round.
    pub warmup: u32,
    /// Number of rounds over all rows; 1 in files from before 2026-11-27.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub rounds: u32,
    /// Whether nothing is left to measure. A row that an engine does not support is in [`Self::unavailable`] and does not count as left.
    pub complete: bool,
    /// The rows, in the order in which they were measured.
    pub rows: Vec<BenchRow>,
    /// Requested rows and engines that are missing, each with the reason.
    pub unavailable: Vec<Unavailable>,
    /// Rows that were measured against each other; empty in files of `bench`, and in those from before 2026-11-28.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub paired: Vec<PairedRounds>,
    /// Machines of a merged file, to which [`BenchRow::machine`] is an index; empty in other files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub machines: Vec<Environment>,
    /// Identifies the row of a file that holds a single row of a benchmark; `None` in other files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<PartOf>,
}

/// Rows that were measured alternately: each round measures every row once, in the reverse order of the round before. A slowdown of the
/// machine that lasts longer than a round affects all rows of the round alike, so the ratios of their times stay the same.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PairedRounds {
    /// Keys of the rows.
    pub rows: Vec<String>,
    /// For each round the median time of a frame of each row, milliseconds, in the order of [`Self::rows`].
    pub rounds: Vec<Vec<f64>>,
    /// Why there are no rounds, or only a few of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing: Option<String>,
}

impl PairedRounds {
    /// The times of the row with key `row` in all rounds, milliseconds; `None` if the key is not in [`Self::rows`], or a round lacks the row's
    /// time.
    #[must_use]
    pub fn of(&self, row: &str) -> Option<Vec<f64>> {
        let index = self.rows.iter().position(|key| key == row)?;
        self.rounds.iter().map(|round| round.get(index).copied()).collect()
    }
}

/// The row that a file of a single row holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartOf {
    /// Id of the row.
    pub id: String,
    /// Index of the row, from 0.
    pub index: usize,
    /// Number of rows of the benchmark.
    pub of: usize,
}

/// Identifies the inputs of a row, so that rows of different projects with the same name are distinguished.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs {
    /// Hash of the project's declarations: passes, cameras, lights, targets, placement of scenes.
    pub project: String,
    /// The attributes of the scene files that are read.
    pub needs: String,
    /// Hash of the parts of the scenes' contents that are read.
    pub scenes: String,
}

/// An engine or a row that could not be measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unavailable {
    /// Name of the engine or row.
    pub what: String,
    /// The reason, and a remedy.
    pub why: String,
}

/// How an effect is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Technique {
    /// No effect.
    None,
    /// By tracing rays.
    Rays,
    /// By maps or loops over the G-buffer.
    Raster,
}

/// One row: a project with its settings on one set of engines.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BenchRow {
    /// Identifies the row; a row that a file already has is not measured again.
    pub key: String,
    /// Name for readers: `AO, 100 samples`.
    pub label: String,
    /// Name of the effect, as in [`Case::effect`](super::case::Case::effect).
    pub effect: String,
    /// Whether the effect is computed by rays or by rasterisation.
    pub technique: Technique,
    /// The view: `Fonte`, `Vidro`, or the camera's name.
    pub view: String,
    /// Project file.
    pub project: PathBuf,
    /// Parameters set by the user, as `PASS.NAME=VALUE`.
    pub set: Vec<String>,
    /// Width and height of the window in pixels.
    pub size: [u32; 2],
    /// `corrected` or `thesis`.
    pub fidelity: String,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Triangles of the scene.
    pub triangles: u64,
    /// The rasteriser.
    pub raster: EngineName,
    /// The ray backend; `None` if no ray pass runs.
    pub rays: Option<EngineName>,
    /// Host time of whole frames.
    pub frame: Stats,
    /// 95 % confidence interval of the median of [`Self::frame`]; `None` in files from before 2026-11-27.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<Interval>,
    /// Frames whose host time is far from the others'; `None` in files from before 2026-11-27.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outliers: Option<Outliers>,
    /// Device time of whole frames; `None` if a step of the frame, other than a copy, has no device time.
    pub frame_device: Option<Stats>,
    /// Processor time of whole frames, summed over all threads; `None` if the system does not report it.
    #[serde(default)]
    pub frame_processor: Option<Stats>,
    /// Steps of the frame.
    pub steps: Vec<BenchStep>,
    /// Steps done once: load, upload, build.
    pub setup: Vec<BenchStep>,
    /// Share of a frame's host time in ray passes, 0 to 1; `None` without ray passes.
    pub ray_share: Option<f64>,
    /// Peak memory of the process so far, in bytes, including rows measured before; `None` if the system does not report it.
    pub peak_memory_bytes: Option<u64>,
    /// Bytes of targets, acceleration structure, maps, and memory that ray passes hold on their device.
    pub held_bytes: u64,
    /// Error of the effect, against a reference that uses the same G-buffer, programs and formulas.
    pub error: RowError,
    /// Error of the picture, against a reference rendered from the camera in `f64` with many samples a pixel. `None` in files from
    /// before 2026-11-24.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture_error: Option<RowError>,
    /// The figure of the report of 2014 for this row; `None` if that report has no such row.
    pub thesis: Option<ThesisFigure>,
    /// Identity of the inputs; `None` in files from before 2026-11-23, and in reports.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inputs: Option<Inputs>,
    /// Hash of the last frame's picture, bit for bit; `None` as for [`Self::inputs`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
    /// Index into [`BenchFile::machines`]; 0 if that list is empty.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub machine: usize,
}

fn one() -> u32 {
    1
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_one(number: &u32) -> bool {
    *number == 1
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(number: &usize) -> bool {
    *number == 0
}

impl BenchRow {
    /// Adds the samples of another round of the same row. Device and processor times that only one of the rounds has become `None`;
    /// steps that the other round lacks keep their samples.
    pub fn add(&mut self, more: &Self) {
        let both = |old: &Option<Stats>, new: &Option<Stats>| Some(old.as_ref()?.joined(new.as_ref()?));
        let rays_ms = |row: &Self| row.ray_share.map(|share| share * row.frame.mean * row.frame.n() as f64);
        let in_rays = rays_ms(self).zip(rays_ms(more));
        self.frame = self.frame.joined(&more.frame);
        (self.interval, self.outliers) = (self.frame.interval(), Some(self.frame.outliers()));
        if let Some(thesis) = &mut self.thesis {
            thesis.ratio = thesis.ratio.map(|_| thesis.frame_ms / self.frame.median.max(1e-9));
        }
        self.ray_share = in_rays.map(|(old, new)| (old + new) / (self.frame.mean * self.frame.n() as f64).max(1e-9));
        self.frame_device = both(&self.frame_device, &more.frame_device);
        self.frame_processor = both(&self.frame_processor, &more.frame_processor);
        self.peak_memory_bytes = self.peak_memory_bytes.max(more.peak_memory_bytes);
        for (steps, more) in [(&mut self.steps, &more.steps), (&mut self.setup, &more.setup)] {
            for step in steps {
                if let Some(more) = more.iter().find(|more| more.kind == step.kind && more.name == step.name) {
                    step.host = step.host.joined(&more.host);
                    step.device = both(&step.device, &more.device);
                    let rays = step.rays.map(RayCounts::total).filter(|rays| *rays > 0);
                    step.mrays_per_second = rays.map(|rays| rays as f64 / 1e3 / step.host.median.max(1e-6));
                }
            }
        }
    }
}

/// An engine and its device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct EngineName {
    /// Name of the engine: `cpu`, `wgpu`, `cuda`, `optix`.
    pub name: String,
    /// Description of device and driver.
    pub device: String,
}

/// Error of a row's picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowError {
    /// The error was computed.
    Against {
        /// Description of the reference.
        reference: String,
        /// Key of the reference in the cache.
        key: String,
        /// Estimated root mean square error of the reference itself; 0 for a reference without noise.
        own_error: f64,
        /// The metrics of the row's picture against the reference.
        comparison: Comparison,
    },
    /// There is no error; contains the reason.
    Missing(String),
}

impl RowError {
    /// The metrics, with the estimated error of the reference itself; `None` if there is no error.
    #[must_use]
    pub fn found(&self) -> Option<(&Comparison, f64)> {
        match self {
            Self::Against { own_error, comparison, .. } => Some((comparison, *own_error)),
            Self::Missing(_) => None,
        }
    }

    /// Whether the error is only an upper bound, because much of it may be the reference's own: the root mean square error is less
    /// than twice the reference's.
    #[must_use]
    pub fn is_at_most(&self) -> bool {
        self.found().is_some_and(|(comparison, own_error)| comparison.rmse < 2.0 * own_error)
    }
}

/// A step of a row.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BenchStep {
    /// Kind of the step.
    pub kind: StepKind,
    /// Name of its pass, scene or engine.
    pub name: String,
    /// Host time.
    pub host: Stats,
    /// Device time; `None` if the step has none.
    pub device: Option<Stats>,
    /// Number of rays of one frame; `None` for steps that trace none.
    pub rays: Option<RayCounts>,
    /// Millions of rays per second of median host time.
    pub mrays_per_second: Option<f64>,
    /// Numbers of glass pixels of one frame by the source of their colour: screen space, cube map, rays or none. `None` for effects that do not
    /// march rays through screen space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answers: Option<Answers>,
    /// Number of paths of adaptive sampling of stochastic glass in one frame; only for ray passes with `error`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<PathsSpent>,
    /// Further details.
    pub note: String,
}

/// A figure of the report of 2014.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThesisFigure {
    /// Milliseconds per frame.
    pub frame_ms: f64,
    /// Percentage of the frame time in the ray pass; `None` if the report does not give it.
    pub ray_percent: Option<f64>,
    /// The machine of the report of 2014.
    pub machine: String,
    /// The time in the report of 2014 divided by our median: above 1 if this program is faster. `None` if the row has another size than the
    /// report's, since times of different numbers of pixels have no meaningful ratio.
    pub ratio: Option<f64>,
}

/// Statistics of a time, in milliseconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stats {
    /// All samples, in order of measurement.
    pub samples: Vec<f64>,
    /// Median.
    pub median: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation of the samples (divided by n - 1; 0 for one sample).
    pub sd: f64,
    /// Smallest sample.
    pub min: f64,
    /// Largest sample.
    pub max: f64,
    /// Numbers of samples of the rounds, in the order of [`Self::samples`]. Empty if all samples are of one round, and in files from
    /// before 2026-11-28.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rounds: Vec<usize>,
}

impl Stats {
    /// The statistics of `samples`; `None` if there are none.
    #[must_use]
    pub fn new(samples: Vec<f64>) -> Option<Self> {
        let n = samples.len() as f64;
        let (min, max) =
            samples.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), s| (min.min(*s), max.max(*s)));
        let mean = samples.iter().sum::<f64>() / n;
        let squares: f64 = samples.iter().map(|sample| (sample - mean).powi(2)).sum();
        let sd = if samples.len() > 1 { (squares / (n - 1.0)).sqrt() } else { 0.0 };
        (!samples.is_empty()).then(|| {
            let rounds = Vec::new();
            Self { median: median(&samples), samples, mean, sd, min, max, rounds }
        })
    }

    /// The statistics of the samples of `self` and `more` together; their rounds stay separate.
    #[must_use]
    pub fn joined(&self, more: &Self) -> Self {
        let joined = Self::new([self.samples.as_slice(), &more.samples].concat());
        let lengths = self.by_round().into_iter().chain(more.by_round()).map(<[f64]>::len).collect();
        joined.map_or_else(|| self.clone(), |joined| Self { rounds: lengths, ..joined })
    }

    /// The samples of each round; all samples as one round if [`Self::rounds`] is empty or does not add up to them.
    #[must_use]
    pub fn by_round(&self) -> Vec<&[f64]> {
        let total = self.rounds.iter().try_fold(0_usize, |sum, length| sum.checked_add(*length));
        if self.rounds.is_empty() || total != Some(self.samples.len()) {
            return vec![&self.samples];
        }
        let mut rest = self.samples.as_slice();
        let next = |length: &usize| {
            let (round, after) = rest.split_at(*length);
            rest = after;
            round
        };
        self.rounds.iter().map(next).filter(|round| !round.is_empty()).collect()
    }

    /// 95 % confidence interval of the median; `None` if a sample is not finite. If there are several rounds, rounds are resampled as well
    /// as samples, so that a machine that changes between rounds widens the interval.
    #[must_use]
    pub fn interval(&self) -> Option<Interval> {
        Interval::of_rounds(&self.by_round())
    }

    /// Numbers of samples that are far from the others.
    #[must_use]
    pub fn outliers(&self) -> Outliers {
        Outliers::of(&self.samples)
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

    #[test]
    fn rounds_are_told_apart_and_widen_the_interval() {
        let [fast, slow] = [10.0, 15.0].map(|ms| Stats::new(vec![ms; 9]).expect("samples"));
        assert_eq!(fast.by_round().len(), 1);
        let both = fast.joined(&slow);
        assert_eq!((both.rounds.as_slice(), both.by_round()), ([9, 9].as_slice(), vec![&[10.0; 9][..], &[15.0; 9]]));
        assert_eq!(both.joined(&fast).rounds, [9, 9, 9]);
        assert_eq!(both.interval(), Some(Interval { low: 10.0, high: 15.0 }));
        // Round lengths that do not add up to the samples, as in a file changed by hand, are ignored.
        for rounds in [vec![9], vec![usize::MAX, 2]] {
            assert_eq!(Stats { rounds, ..both.clone() }.by_round().len(), 1);
        }
        let text = serde_json::to_string(&fast).expect("JSON");
        assert!(!text.contains("rounds"), "{text}");
        assert_eq!(serde_json::from_str::<Stats>(&text).expect("read"), fast);
        let text = serde_json::to_string(&both).expect("JSON");
        assert_eq!(serde_json::from_str::<Stats>(&text).expect("read"), both);
    }

    #[test]
    fn the_times_of_a_row_in_paired_rounds() {
        let rows = vec!["a".to_owned(), "b".to_owned()];
        let paired = PairedRounds { rows, rounds: vec![vec![1.0, 2.0], vec![3.0, 4.0]], missing: None };
        assert_eq!(
            (paired.of("a"), paired.of("b"), paired.of("c")),
            (Some(vec![1.0, 3.0]), Some(vec![2.0, 4.0]), None)
        );
        let torn = PairedRounds { rounds: vec![vec![1.0, 2.0], vec![3.0]], ..paired };
        assert_eq!(torn.of("b"), None);
    }
}
