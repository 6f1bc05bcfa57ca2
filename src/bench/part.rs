//! A benchmark in parts: a folder with a file for each row, named by the row's id, and a list of all rows.
//!
//! A part is written whole or not at all, so after a process dies the next one continues with the folder. The files do not record
//! which process measured a row, or how many processes there were.

use super::case::Case;
use super::file::{FileError, MOST_BYTES};
use super::inputs::short_hash;
use super::model::{BenchFile, FORMAT, PartOf};
use crate::environment::Environment;
use crate::pipeline::files::{self, write_atomically};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the file with the list of all rows, in the folder of the parts.
pub const LIST: &str = "rows.json";

/// Why parts of a benchmark cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PartError {
    /// The system reports an error.
    #[error("{}: {message}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        message: String,
    },
    /// The file is no part of a benchmark, or truncated.
    #[error("{}: this is no part of a benchmark: {message}\n       remove the file, and measure its rows again", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// What is wrong, and at which place.
        message: String,
    },
    /// The file belongs to another benchmark.
    #[error("{0}")]
    Other(Box<Difference>),
}

/// A difference between a file and the benchmark that it should belong to.
#[derive(Debug, thiserror::Error)]
#[error("{}: {field} differs: `{found}` there, and `{wanted}` {wanted_by}\n       {help}", path.display())]
pub struct Difference {
    /// The file.
    pub path: PathBuf,
    /// The field that differs.
    pub field: String,
    /// Value of the field in the file.
    pub found: String,
    /// Value that was expected.
    pub wanted: String,
    /// Where the expected value comes from: `here`, or `in FILE`.
    pub wanted_by: String,
    /// What to do about it.
    pub help: String,
}

impl From<Difference> for PartError {
    fn from(difference: Difference) -> Self {
        Self::Other(Box::new(difference))
    }
}

/// All rows of a benchmark, in order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RowList {
    /// [`FORMAT`].
    pub format: u32,
    /// The command of the benchmark, without the options that select rows.
    pub command: String,
    /// The rows.
    pub rows: Vec<ListedRow>,
}

/// A row in the list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListedRow {
    /// Id of the row, a hash of its key: it does not depend on the machine or on the number of processes.
    pub id: String,
    /// Identifies the row among all rows.
    pub key: String,
    /// Name for readers.
    pub label: String,
    /// The view.
    pub view: String,
}

impl RowList {
    /// The rows of a benchmark.
    #[must_use]
    pub fn new<'a>(command: String, cases: impl Iterator<Item = &'a Case>) -> Self {
        let row = |case: &Case| ListedRow {
            id: short_hash(&case.key),
            key: case.key.clone(),
            label: case.label.clone(),
            view: case.view.clone(),
        };
        Self { format: FORMAT, command, rows: cases.map(row).collect() }
    }

    /// Reads the list of a folder; `None` if there is none.
    ///
    /// # Errors
    /// If it cannot be read, or is no list.
    pub fn read(folder: &Path) -> Result<Option<Self>, PartError> {
        let path = folder.join(LIST);
        let Some(text) = text_of(&path)? else { return Ok(None) };
        let list: Self = serde_json::from_slice(&text)
            .map_err(|error| PartError::Broken { path: path.clone(), message: error.to_string() })?;
        if list.format != FORMAT {
            let message = format!("format: it is {}, and this program writes {FORMAT}", list.format);
            return Err(PartError::Broken { path, message });
        }
        Ok(Some(list))
    }

    /// The first field in which `other` differs: its name, the value in `other`, and the value here. `None` if the lists are equal.
    pub(super) fn differs_from(&self, other: &Self) -> Option<(String, String, String)> {
        if self.command != other.command {
            return Some(("command".to_owned(), other.command.clone(), self.command.clone()));
        }
        if self.rows.len() != other.rows.len() {
            return Some(("number of rows".to_owned(), other.rows.len().to_string(), self.rows.len().to_string()));
        }
        let index = self.rows.iter().zip(&other.rows).position(|(a, b)| a != b)?;
        Some((format!("rows[{index}].key"), other.rows[index].key.clone(), self.rows[index].key.clone()))
    }
}

/// The folder of a benchmark in parts.
pub struct Parts {
    folder: PathBuf,
    list: RowList,
}

impl Parts {
    /// Makes the folder and writes the list, if they do not exist.
    ///
    /// # Errors
    /// If the folder holds another benchmark, or cannot be written.
    pub fn open(folder: &Path, list: RowList) -> Result<Self, PartError> {
        let path = folder.join(LIST);
        let wrong = |message: String| PartError::Io { path: path.clone(), message };
        match RowList::read(folder)? {
            Some(found) => {
                if let Some((field, found, wanted)) = list.differs_from(&found) {
                    let help = "start with the same arguments, or name another folder with --parts".to_owned();
                    return Err(Difference { path, field, found, wanted, wanted_by: "here".to_owned(), help }.into());
                }
            }
            None => {
                files::create_folder(folder).map_err(|error| wrong(error.to_string()))?;
                let text = serde_json::to_string_pretty(&list).map_err(|error| wrong(error.to_string()))?;
                write_atomically(&path, text.as_bytes()).map_err(|error| wrong(error.to_string()))?;
            }
        }
        Ok(Self { folder: folder.to_owned(), list })
    }

    /// Path of the file for the row at an index of the list.
    #[must_use]
    pub fn path(&self, index: usize) -> PathBuf {
        self.folder.join(format!("{}.json", self.list.rows[index].id))
    }

    /// The part of a row, if it exists.
    ///
    /// # Errors
    /// If the file is no part of this benchmark, or was measured by another build of the program.
    pub fn find(&self, index: usize) -> Result<Option<BenchFile>, PartError> {
        let path = self.path(index);
        let Some(file) = read(&path)? else { return Ok(None) };
        let wanted = self.part_of(index);
        let differs = file.part.as_ref().filter(|part| **part != wanted).map(|part| {
            ("part".to_owned(), format!("row {} of {}", part.index, part.of), format!("row {index} of {}", wanted.of))
        });
        let command = || {
            let differs = file.command != self.list.command;
            differs.then(|| ("command".to_owned(), file.command.clone(), self.list.command.clone()))
        };
        let build = || {
            let (field, here, there) = Environment::here().build_differs_from(&file.environment)?;
            Some((format!("environment.{field}"), there, here))
        };
        if file.part.is_none() {
            return Err(PartError::Broken { path, message: "part: it is missing".to_owned() });
        }
        match differs.or_else(command).or_else(build) {
            None => Ok(Some(file)),
            Some((field, found, wanted)) => {
                let help = "name another folder with --parts, or remove this one to start again".to_owned();
                Err(Difference { path, field, found, wanted, wanted_by: "here".to_owned(), help }.into())
            }
        }
    }

    /// Writes the part of a row, whole or not at all.
    ///
    /// # Errors
    /// Whatever the system reports.
    pub fn write(&self, index: usize, file: BenchFile) -> Result<(), PartError> {
        let path = self.path(index);
        let file = BenchFile { part: Some(self.part_of(index)), complete: true, ..file };
        file.write(&path).map_err(|error| match error {
            FileError::Io { message, .. } => PartError::Io { path, message },
            other => PartError::Io { path, message: other.to_string() },
        })
    }

    fn part_of(&self, index: usize) -> PartOf {
        PartOf { id: self.list.rows[index].id.clone(), index, of: self.list.rows.len() }
    }
}

/// Reads a benchmark, whole or in part; `None` if there is no file.
pub(super) fn read(path: &Path) -> Result<Option<BenchFile>, PartError> {
    let Some(text) = text_of(path)? else { return Ok(None) };
    BenchFile::parse(&text).map(Some).map_err(|message| PartError::Broken { path: path.to_owned(), message })
}

fn text_of(path: &Path) -> Result<Option<Vec<u8>>, PartError> {
    files::read_if_there(path, MOST_BYTES)
        .map_err(|error| PartError::Io { path: path.to_owned(), message: error.to_string() })
}
