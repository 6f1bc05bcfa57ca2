//! The file of a benchmark. It is written whole after every row, and an interrupted benchmark can be continued from it.

use super::model::{BenchFile, BenchRow, FORMAT, Unavailable};
use crate::environment::Environment;
use crate::pipeline::files::{self, write_atomically};
use serde::Deserialize as _;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Largest file that is read, bytes.
pub(super) const MOST_BYTES: u64 = 1 << 30;

/// Why a benchmark's file cannot be read, continued or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The system reports an error.
    #[error("{}: {message}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        message: String,
    },
    /// The file is no benchmark, or truncated.
    #[error("{}: this is no benchmark file: {message}\n       name another file; without --resume, --overwrite replaces it", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the field or with the line and column.
        message: String,
    },
    /// The file holds a different benchmark.
    #[error("{}: cannot be continued: {message}\n       start with the same arguments, or name another file", path.display())]
    Other {
        /// The file.
        path: PathBuf,
        /// What differs.
        message: String,
    },
    /// The file holds rows that starting again would discard.
    #[error(
        "{}: holds an interrupted benchmark of {rows} rows\n       --resume continues it; --overwrite starts again", path.display()
    )]
    Interrupted {
        /// The file.
        path: PathBuf,
        /// Number of rows in it.
        rows: usize,
    },
}

impl BenchFile {
    /// A new benchmark without rows.
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
            rounds: 1,
            complete: false,
            rows: Vec::new(),
            unavailable: Vec::new(),
            paired: Vec::new(),
            machines: Vec::new(),
            part: None,
        }
    }

    /// Reads a file; `None` if there is none.
    ///
    /// # Errors
    /// If it cannot be read, or is no benchmark.
    pub fn read(path: &Path) -> Result<Option<Self>, FileError> {
        let text = files::read_if_there(path, MOST_BYTES)
            .map_err(|error| FileError::Io { path: path.to_owned(), message: error.to_string() })?;
        // An empty file counts as missing: some tool created it as a place to write to.
        let Some(text) = text.filter(|text| !text.is_empty()) else { return Ok(None) };
        Self::parse(&text).map(Some).map_err(|message| FileError::Broken { path: path.to_owned(), message })
    }

    /// Parses the text of a file.
    ///
    /// # Errors
    /// What is wrong, with line and column, or with the field.
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        match serde_json::from_slice::<Self>(text) {
            Ok(file) if file.format == FORMAT => match file.rows.iter().position(|row| !file.has_machine(row)) {
                None => Ok(file),
                Some(row) => Err(format!("rows[{row}].machine: {} machines are listed", file.machines.len())),
            },
            Ok(file) => Err(other_format(&file.format.to_string())),
            Err(error) => {
                Err(serde_json::from_slice(text).map_or_else(|error| error.to_string(), |v| wrong(&v, &error)))
            }
        }
    }

    fn has_machine(&self, row: &BenchRow) -> bool {
        row.machine < self.machines.len().max(1)
    }

    /// The machine on which a row of the file was measured.
    #[must_use]
    pub fn environment_of(&self, row: &BenchRow) -> &Environment {
        self.machines.get(row.machine).unwrap_or(&self.environment)
    }

    /// The benchmark to continue: with `resume` the rows of the file at `path`, otherwise no rows.
    ///
    /// # Errors
    /// If the file is broken or no benchmark of this program. With `resume` also if its benchmark differs in arguments, build or machine;
    /// without `resume` also if its benchmark is interrupted and has rows. Such files are not replaced.
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
        if !found.machines.is_empty() || found.part.is_some() {
            return Some("it is a part of a benchmark, or was merged of parts".to_owned());
        }
        if self.command != found.command {
            return Some(format!(
                "it was made by\n         {}\n       and this is\n         {}",
                found.command, self.command
            ));
        }
        if (self.frames, self.warmup, self.rounds) != (found.frames, found.warmup, found.rounds) {
            let (frames, warmup, rounds) = (found.frames, found.warmup, found.rounds);
            return Some(format!("it has {rounds} rounds of {frames} frames and {warmup} of warm-up a row"));
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

    /// The first row with a key; `None` if the file has none.
    #[must_use]
    pub fn row(&self, key: &str) -> Option<&BenchRow> {
        self.rows.iter().find(|row| row.key == key)
    }

    /// Records that something could not be measured.
    pub fn miss(&mut self, what: impl Into<String>, why: impl Into<String>) {
        self.unavailable.push(Unavailable { what: what.into(), why: why.into() });
    }
}

fn other_format(format: &str) -> String {
    format!("format: it is {format}, and this program writes {FORMAT}")
}

/// Name of the field that does not parse.
fn wrong(value: &Value, error: &serde_json::Error) -> String {
    fn each<T: DeserializeOwned>(value: &Value, name: &str) -> Option<String> {
        let list = value[name].as_array()?;
        let found = |(index, item): (usize, &Value)| Some(format!("{name}[{index}]: {}", T::deserialize(item).err()?));
        list.iter().enumerate().find_map(found)
    }
    match &value["format"] {
        Value::Null => return "format: it is missing".to_owned(),
        format if *format != FORMAT => return other_format(&format.to_string()),
        _ => {}
    }
    let environment = || Some(format!("environment: {}", Environment::deserialize(value.get("environment")?).err()?));
    let row = || each::<BenchRow>(value, "rows").or_else(|| each::<Unavailable>(value, "unavailable"));
    environment().or_else(row).or_else(|| each::<Environment>(value, "machines")).unwrap_or_else(|| error.to_string())
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

    #[test]
    fn what_is_wrong_is_named_with_its_field_or_place() {
        let whole = serde_json::to_value(begun("a")).expect("JSON");
        let wrong = |change: &dyn Fn(&mut Value)| {
            let mut value = whole.clone();
            change(&mut value);
            BenchFile::parse(value.to_string().as_bytes()).expect_err("it is wrong")
        };
        assert_eq!(wrong(&|v| v["format"] = Value::Null), "format: it is missing");
        assert!(wrong(&|v| v["format"] = 99.into()).starts_with("format: it is 99"));
        assert_eq!(wrong(&|v| v["environment"]["cpu"] = Value::Null).split(':').next(), Some("environment"));
        assert_eq!(wrong(&|v| v["rows"] = serde_json::json!([{}])), "rows[0]: missing field `key`");
        assert!(wrong(&|v| v["frames"] = "3".into()).contains("expected u32"));
        assert_eq!(wrong(&|v| *v = serde_json::json!({"rows": []})), "format: it is missing");
        assert_eq!(wrong(&|v| *v = serde_json::json!([1])), "format: it is missing");
        let text = whole.to_string();
        let cut = BenchFile::parse(&text.as_bytes()[..text.len() / 2]).expect_err("it is cut off");
        assert!(cut.contains("line 1 column"), "{cut}");
    }

    #[test]
    fn numbers_stay_the_same_to_the_bit() {
        let mut file = begun("a");
        for step in 1..2000_u64 {
            let load = f64::from_bits(0x3fb9_9999_9999_999a + step * 0x0000_1234_5678_9abc);
            file.environment.load_average = Some(load);
            let text = serde_json::to_vec(&file).expect("JSON");
            let read = BenchFile::parse(&text).expect("a file").environment.load_average.expect("a number");
            assert_eq!(read.to_bits(), load.to_bits());
        }
    }
}
