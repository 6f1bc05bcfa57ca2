//! The file of a benchmark: written whole after every row, and continued.

use super::model::{BenchFile, BenchRow, FORMAT, Unavailable};
use crate::environment::Environment;
use crate::pipeline::files::{self, write_atomically};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Largest file that is read, bytes.
pub(super) const MOST_BYTES: u64 = 1 << 30;

/// Why a benchmark's file cannot be read, continued or written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system.
    #[error("{}: {message}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        message: String,
    },
    /// It is no benchmark, or not a whole one.
    #[error("{}: this is no benchmark file: {message}\n       name another file; without --resume, --overwrite replaces it", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// Where reading ended.
        message: String,
    },
    /// It holds another benchmark.
    #[error("{}: cannot be continued: {message}\n       start with the same arguments, or name another file", path.display())]
    Other {
        /// The file.
        path: PathBuf,
        /// What differs.
        message: String,
    },
    /// It holds rows that starting again would throw away.
    #[error(
        "{}: holds an interrupted benchmark of {rows} rows\n       --resume continues it; --overwrite starts again", path.display()
    )]
    Interrupted {
        /// The file.
        path: PathBuf,
        /// Rows that it has.
        rows: usize,
    },
}

impl BenchFile {
    /// A benchmark that begins now.
    #[must_use]
    pub fn begin(command: String, environment: Environment, frames: u32, warmup: u32) -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
        Self {
            format: FORMAT,
            command,
            started_unix_s: now,
            environment,
            frames,
            warmup,
            complete: false,
            rows: Vec::new(),
            unavailable: Vec::new(),
        }
    }

    /// Reads a file; `None` if there is none.
    ///
    /// # Errors
    /// If it cannot be read or holds anything else.
    pub fn read(path: &Path) -> Result<Option<Self>, FileError> {
        let text = match files::read(path, MOST_BYTES) {
            // An empty file is one that something made to be written into.
            Ok(text) if text.is_empty() => return Ok(None),
            Ok(text) => text,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(FileError::Io { path: path.to_owned(), message: error.to_string() }),
        };
        let broken = |message: String| FileError::Broken { path: path.to_owned(), message };
        let value: serde_json::Value = serde_json::from_slice(&text).map_err(|error| broken(error.to_string()))?;
        match value["format"].as_u64() {
            Some(format) if format == u64::from(FORMAT) => {}
            Some(format) => return Err(broken(format!("its format is {format}, and this program writes {FORMAT}"))),
            None => return Err(broken("it has no `format`".to_owned())),
        }
        serde_json::from_value(value).map(Some).map_err(|error| broken(error.to_string()))
    }

    /// What a benchmark that is begun as `self` goes on from: the rows of the file at `path` with `resume`, none without.
    ///
    /// # Errors
    /// If the file is no benchmark of this program or is broken, holds another benchmark, or (without `resume`) an
    /// interrupted one: none of these is replaced.
    pub fn continued(self, path: &Path, resume: bool) -> Result<Self, FileError> {
        let Some(found) = Self::read(path)? else { return Ok(self) };
        if !resume {
            return if found.complete || found.rows.is_empty() {
                Ok(self)
            } else {
                Err(FileError::Interrupted { path: path.to_owned(), rows: found.rows.len() })
            };
        }
        match self.differs_from(&found) {
            Some(message) => Err(FileError::Other { path: path.to_owned(), message }),
            None => Ok(Self { unavailable: Vec::new(), complete: false, ..found }),
        }
    }

    fn differs_from(&self, found: &Self) -> Option<String> {
        if self.command != found.command {
            return Some(format!(
                "it was made by\n         {}\n       and this is\n         {}",
                found.command, self.command
            ));
        }
        if (self.frames, self.warmup) != (found.frames, found.warmup) {
            return Some(format!("it has {} frames and {} of warm-up a row", found.frames, found.warmup));
        }
        self.environment.differs_from(&found.environment)
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

    /// The row with a key.
    #[must_use]
    pub fn row(&self, key: &str) -> Option<&BenchRow> {
        self.rows.iter().find(|row| row.key == key)
    }

    /// Notes that something is not there.
    pub fn miss(&mut self, what: impl Into<String>, why: impl Into<String>) {
        self.unavailable.push(Unavailable { what: what.into(), why: why.into() });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begun(command: &str) -> BenchFile {
        BenchFile::begin(command.to_owned(), Environment::here(), 3, 1)
    }

    #[test]
    fn only_the_same_benchmark_is_continued() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("bench.json");
        assert!(begun("a").continued(&path, true).is_ok(), "there is no file yet");
        begun("a").write(&path).expect("written");
        assert!(begun("a").continued(&path, true).is_ok());
        let other = begun("b").continued(&path, true).expect_err("another command").to_string();
        assert!(other.contains("made by"), "{other}");
        let frames = BenchFile { frames: 4, ..begun("a") };
        assert!(frames.continued(&path, true).is_err());
        let mut elsewhere = begun("a");
        elsewhere.environment.cpu = "another".to_owned();
        assert!(elsewhere.continued(&path, true).expect_err("another machine").to_string().contains("cpu"));
    }

    #[test]
    fn a_file_that_is_cut_off_is_refused_and_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("bench.json");
        begun("a").write(&path).expect("written");
        let whole = std::fs::read_to_string(&path).expect("text");
        let cut = &whole[..whole.len() / 2];
        std::fs::write(&path, cut).expect("written");
        let message = begun("a").continued(&path, true).expect_err("it is cut off").to_string();
        assert!(message.contains("no benchmark file"), "{message}");
        assert_eq!(std::fs::read_to_string(&path).expect("text"), cut);
        let newer = whole.replacen("\"format\": 1", "\"format\": 99", 1);
        std::fs::write(&path, newer).expect("written");
        assert!(begun("a").continued(&path, true).expect_err("another format").to_string().contains("99"));
    }
}
