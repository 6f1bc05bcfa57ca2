//! The record beside each frame of a path: the frame's inputs, and its times.
//!
//! The record is written after the pictures, whole or not at all; its existence means that the frame is complete.

use crate::Choice;
use crate::bench::model::Inputs;
use crate::environment::Environment;
use crate::pipeline::executor::{Renderer, StepKind, Written};
use crate::pipeline::files::{self, write_atomically};
use crate::pipeline::plan::Settings;
use crate::pipeline::project::Pose;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Largest record that is read, bytes.
const MOST_BYTES: u64 = 16 << 20;

/// Everything that a frame's picture depends on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Version and commit of the program.
    pub program: String,
    /// Hashes of project and scenes.
    pub inputs: Inputs,
    /// Window, settings and engines.
    pub settings: String,
    /// Position, direction, up vector and vertical field of view (radians) of the camera.
    pub pose: [f32; 10],
}

/// The record of a complete frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Frame number, from 0.
    pub frame: u32,
    /// The inputs of the frame.
    pub origin: Origin,
    /// Processor, threads and engines. Times of different machines are not comparable.
    pub machine: String,
    /// Host time of all passes, milliseconds.
    pub ms: f64,
    /// The part of [`Self::ms`] in ray passes, milliseconds.
    pub ray_ms: f64,
    /// Time to write the pictures, milliseconds.
    pub write_ms: f64,
    /// Number of rays.
    pub rays: u64,
    /// The pictures: names in the record's folder, with sizes in bytes.
    pub files: Vec<(PathBuf, u64)>,
}

/// Why an existing frame cannot be used, or a record cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The system reports an error.
    #[error("{}: {message}", path.display())]
    Io {
        /// The record.
        path: PathBuf,
        /// What the system says.
        message: String,
    },
    /// The file is no record.
    #[error("{}: this is no record of a frame: {message}\n       name another output, or replace it with --overwrite", path.display())]
    Broken {
        /// The record.
        path: PathBuf,
        /// What is wrong, and at which place.
        message: String,
    },
    /// The record belongs to a different picture.
    #[error("{}: this frame was rendered from something else: {field} differs\n       name another output, or replace it with --overwrite", path.display())]
    Other {
        /// The record.
        path: PathBuf,
        /// The field that differs.
        field: &'static str,
    },
}

impl Origin {
    /// The origin of a renderer's frames, before its camera is moved.
    #[must_use]
    pub fn of(renderer: &Renderer, choice: Choice) -> Self {
        let here = Environment::here();
        // The memory limit and the number of bands do not affect the picture.
        let settings = Settings { max_memory: 0, bands: None, ..renderer.settings().clone() };
        Self {
            program: format!("{} {}", here.version, here.commit),
            inputs: Inputs::of(renderer),
            settings: format!("{:?} {settings:?} {choice:?}", renderer.plan().window),
            pose: [0.0; 10],
        }
    }

    /// This origin with the camera's pose in a frame.
    #[must_use]
    pub fn with_pose(&self, pose: Pose) -> Self {
        let [p, d, u] = [pose.position, pose.direction, pose.up];
        let pose = [p.x, p.y, p.z, d.x, d.y, d.z, u.x, u.y, u.z, pose.fov_y];
        Self { pose, ..self.clone() }
    }

    fn differs_from(&self, other: &Self) -> Option<&'static str> {
        let fields = [
            ("origin.program", self.program != other.program),
            ("origin.inputs.project", self.inputs.project != other.inputs.project),
            ("origin.inputs", self.inputs != other.inputs),
            ("origin.settings", self.settings != other.settings),
            ("origin.pose", self.pose != other.pose),
        ];
        fields.into_iter().find(|(_, differs)| *differs).map(|(field, _)| field)
    }
}

impl FrameRecord {
    /// The record of the frame that a renderer has just rendered and written. The timeline must contain only that frame.
    #[must_use]
    pub fn new(frame: u32, origin: Origin, renderer: &Renderer, written: &[Written]) -> Self {
        let rows = &renderer.timeline().rows;
        let last = |kind: &dyn Fn(StepKind) -> bool| -> f64 {
            rows.iter().filter(|row| kind(row.kind)).filter_map(|row| row.host_ms.last()).sum()
        };
        let wrote = |row: &&crate::pipeline::executor::Row| {
            row.kind == StepKind::Write && written.iter().any(|file| file.path.display().to_string() == row.name)
        };
        let engines = renderer.engines();
        let size = |path: &Path| std::fs::metadata(path).map_or(0, |data| data.len());
        let name = |path: &Path| PathBuf::from(path.file_name().unwrap_or_default());
        Self {
            frame,
            origin,
            machine: format!(
                "{}; raster {}: {}; rays {}: {}",
                Environment::here().machine(),
                engines.raster.name(),
                engines.raster.device(),
                engines.rays.name(),
                engines.rays.device()
            ),
            ms: last(&StepKind::per_frame),
            ray_ms: last(&|kind| kind == StepKind::Rays),
            write_ms: rows.iter().filter(wrote).filter_map(|row| row.host_ms.last()).sum(),
            rays: rows
                .iter()
                .filter(|row| row.kind == StepKind::Rays)
                .filter_map(|row| row.rays)
                .map(|r| r.total())
                .sum(),
            files: written.iter().map(|file| (name(&file.path), size(&file.path))).collect(),
        }
    }

    /// The record at `path`; `None` if the frame is not complete, that is if the record or one of the pictures `files` with its recorded size
    /// does not exist.
    ///
    /// # Errors
    /// If the file is no record, or belongs to a different picture.
    pub fn find(path: &Path, origin: &Origin, files: &[PathBuf]) -> Result<Option<Self>, RecordError> {
        let text = files::read_if_there(path, MOST_BYTES)
            .map_err(|error| RecordError::Io { path: path.to_owned(), message: error.to_string() })?;
        let Some(text) = text else { return Ok(None) };
        let record: Self = serde_json::from_slice(&text)
            .map_err(|error| RecordError::Broken { path: path.to_owned(), message: error.to_string() })?;
        if let Some(field) = origin.differs_from(&record.origin) {
            return Err(RecordError::Other { path: path.to_owned(), field });
        }
        let whole = |file: &PathBuf| {
            let name = Path::new(file.file_name().unwrap_or_default());
            let size = record.files.iter().find(|(known, _)| known == name).map(|(_, size)| *size);
            size.is_some() && std::fs::metadata(file).ok().map(|data| data.len()) == size
        };
        Ok(files.iter().all(whole).then_some(record))
    }

    /// Writes the record, whole or not at all.
    ///
    /// # Errors
    /// Whatever the system reports.
    pub fn write(&self, path: &Path) -> Result<(), RecordError> {
        let wrong = |message: String| RecordError::Io { path: path.to_owned(), message };
        let text = serde_json::to_string_pretty(self).map_err(|error| wrong(error.to_string()))?;
        write_atomically(path, text.as_bytes()).map_err(|error| wrong(error.to_string()))
    }
}

/// Mean and 99th percentile of times; `None` for an empty list. The percentile is by nearest rank: with fewer than 100 times it is the largest
/// time.
#[must_use]
pub fn mean_and_p99(times: &[f64]) -> Option<(f64, f64)> {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (sorted.len() * 99).div_ceil(100);
    let p99 = *sorted.get(rank.checked_sub(1)?)?;
    Some((times.iter().sum::<f64>() / times.len() as f64, p99))
}

#[cfg(test)]
mod tests {
    use super::mean_and_p99;

    #[test]
    fn the_99th_percentile_is_by_nearest_rank() {
        let times: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        assert_eq!(mean_and_p99(&times), Some((100.5, 198.0)));
        assert_eq!(mean_and_p99(&times[..50]), Some((175.5, 200.0)));
        assert_eq!(mean_and_p99(&[3.0]), Some((3.0, 3.0)));
        assert_eq!(mean_and_p99(&[]), None);
    }
}
