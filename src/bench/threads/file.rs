//! What a sweep over threads writes: curves with all their samples, and the machine that they were taken on.

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
/// What [`ThreadsFile::kind`] says.
pub const KIND: &str = "time against threads";

/// A sweep, whole or interrupted.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ThreadsFile {
    /// [`FORMAT`].
    pub format: u32,
    /// [`KIND`]: tells the file from those of other benchmarks.
    pub kind: String,
    /// The command that wrote it.
    pub command: String,
    /// When it was begun, seconds since 1970.
    pub started_unix_s: u64,
    /// Where.
    pub environment: Environment,
    /// How often each case was opened with each number of threads.
    pub rounds: u32,
    /// Frames measured of each round.
    pub frames: u32,
    /// Frames rendered before them, and not counted.
    pub warmup: u32,
    /// Whether every case that was asked for is there.
    pub complete: bool,
    /// The cases, in the order in which they were measured.
    pub cases: Vec<ThreadsCase>,
}

/// The curves of a project with its settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThreadsCase {
    /// What tells it from all other cases.
    pub key: String,
    /// What a reader calls it: `AO, 100 samples`.
    pub label: String,
    /// The view: `Fonte`, `Vidro`, or the camera's name.
    pub view: String,
    /// Project file.
    pub project: PathBuf,
    /// `PASS.NAME=VALUE`.
    pub set: Vec<String>,
    /// Window, pixels.
    pub size: [u32; 2],
    /// Triangles of the scene.
    pub triangles: u64,
    /// Textures of the scene.
    pub textures: u64,
    /// Whole frames, by threads.
    pub frame: Vec<ThreadsPoint>,
    /// Each step, those that are done once first.
    pub steps: Vec<ThreadsStep>,
}

/// The curve of a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThreadsStep {
    /// What it is.
    pub kind: StepKind,
    /// Its pass, scene or engine.
    pub name: String,
    /// By threads, in the order in which they were asked for.
    pub points: Vec<ThreadsPoint>,
}

/// A place on a curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThreadsPoint {
    /// Threads of the pool.
    pub threads: usize,
    /// Wall time, milliseconds.
    pub wall: Stats,
    /// Processor time of all threads together, milliseconds; `None` where the system does not tell.
    pub processor: Option<Stats>,
}

/// How many times as fast the median is as on the fewest threads; `None` without two points.
#[must_use]
pub fn speed_up(points: &[ThreadsPoint], point: &ThreadsPoint) -> Option<f64> {
    let first = points.iter().min_by_key(|point| point.threads)?;
    (first.threads != point.threads).then(|| first.wall.median / point.wall.median.max(1e-9))
}

impl ThreadsFile {
    /// A sweep that begins now.
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
    /// If it cannot be read or holds anything else.
    pub fn read(path: &Path) -> Result<Option<Self>, FileError> {
        let text = files::read_if_there(path, MOST_BYTES)
            .map_err(|error| FileError::Io { path: path.to_owned(), message: error.to_string() })?;
        // An empty file is one that something made to be written into.
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
