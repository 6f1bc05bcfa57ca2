//! The file of a thread sweep: curves with all their samples, and the machine.

use crate::bench::file::{FileError, MOST_BYTES};
use crate::bench::model::Stats;
use crate::environment::Environment;
use crate::pipeline::executor::StepKind;
use crate::pipeline::files::{self, write_atomically};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Version of the layout below.
pub const FORMAT: u32 = 1;
/// Value of [`ThreadsFile::kind`].
pub const KIND: &str = "time against threads";

/// A sweep, whole or interrupted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ThreadsFile {
    /// [`FORMAT`].
    pub format: u32,
    /// [`KIND`], which distinguishes the file from other benchmarks.
    pub kind: String,
    /// The command that wrote the file.
    pub command: String,
    /// Start time, seconds since 1970.
    pub started_unix_s: u64,
    /// Machine and build.
    pub environment: Environment,
    /// Number of times each case was opened with each number of threads.
    pub rounds: u32,
    /// Number of frames measured in each round.
    pub frames: u32,
    /// Number of frames rendered before the measured ones of each round.
    pub warmup: u32,
    /// Whether every requested case is present.
    pub complete: bool,
    /// The cases, in the order in which they were measured.
    pub cases: Vec<ThreadsCase>,
}

/// The curves of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThreadsCase {
    /// Identifies the case among all cases.
    pub key: String,
    /// Name for readers: `AO, 100 samples`.
    pub label: String,
    /// The view: `Fonte`, `Vidro`, or the camera's name.
    pub view: String,
    /// Project file.
    pub project: PathBuf,
    /// Parameters set by the user, as `PASS.NAME=VALUE`.
    pub set: Vec<String>,
    /// Width and height of the window in pixels.
    pub size: [u32; 2],
    /// Number of triangles of the scene.
    pub triangles: u64,
    /// Number of textures of the scene.
    pub textures: u64,
    /// The curve of whole frames.
    pub frame: Vec<ThreadsPoint>,
    /// The curve of each step; steps that run once come first.
    pub steps: Vec<ThreadsStep>,
}

/// The curve of a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThreadsStep {
    /// Kind of the step.
    pub kind: StepKind,
    /// Name of its pass, scene or engine.
    pub name: String,
    /// The points, in the order in which the numbers of threads were given.
    pub points: Vec<ThreadsPoint>,
}

/// A point on a curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThreadsPoint {
    /// Number of threads of the pool.
    pub threads: usize,
    /// Wall time, milliseconds.
    pub wall: Stats,
    /// Processor time of all threads, milliseconds; `None` if the system does not report it.
    pub processor: Option<Stats>,
}

/// Speed-up of the median wall time over the point with the fewest threads; `None` without two points.
#[must_use]
pub fn speed_up(points: &[ThreadsPoint], point: &ThreadsPoint) -> Option<f64> {
    let first = points.iter().min_by_key(|point| point.threads)?;
    (first.threads != point.threads).then(|| first.wall.median / point.wall.median.max(1e-9))
}

impl ThreadsFile {
    /// A new sweep without cases.
    #[must_use]
    pub fn begin(command: String, environment: Environment, rounds: u32, frames: u32, warmup: u32) -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
        Self {
            format: FORMAT,
            kind: KIND.to_owned(),
            command,
            started_unix_s: now,
            environment,
            rounds,
            frames,
            warmup,
            complete: false,
            cases: Vec::new(),
        }
    }

    /// Reads a file; `None` if there is none.
    ///
    /// # Errors
    /// If it cannot be read, or is no sweep.
    pub fn read(path: &Path) -> Result<Option<Self>, FileError> {
        let text = files::read_if_there(path, MOST_BYTES)
            .map_err(|error| FileError::Io { path: path.to_owned(), message: error.to_string() })?;
        // An empty file counts as missing: some tool created it as a place to write to.
        let Some(text) = text.filter(|text| !text.is_empty()) else { return Ok(None) };
        let broken = |message: String| FileError::Broken { path: path.to_owned(), message };
        let file: Self = serde_json::from_slice(&text).map_err(|error| broken(error.to_string()))?;
        match (file.format, &file.kind[..]) {
            (FORMAT, KIND) => Ok(Some(file)),
            (format, kind) => Err(broken(format!("it is format {format} of `{kind}`, not {FORMAT} of `{KIND}`"))),
        }
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// Whatever the system reports.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let wrong = |message: String| FileError::Io { path: path.to_owned(), message };
        let text = serde_json::to_string_pretty(self).map_err(|error| wrong(error.to_string()))?;
        write_atomically(path, text.as_bytes()).map_err(|error| wrong(error.to_string()))
    }
}
