//! Errors of loading a scene, and the memory budget of a load.

use std::fmt;
use std::path::{Path, PathBuf};

/// Position of a problem in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// Byte offset in a binary file, from 0.
    Byte(u64),
    /// Line of a text file, from 1.
    Line(u64),
    /// Line and column of a text file, both from 1; columns count characters. Larger values are clamped to 2³² - 1.
    Column(u32, u32),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Byte(offset) => write!(f, " at byte {offset}"),
            Self::Line(line) => write!(f, ":{line}"),
            Self::Column(line, column) => write!(f, ":{line}:{column}"),
        }
    }
}

/// Why a scene file could not be read or written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{place}: {what}{}", .file.display(), HelpLine(.help.as_deref()))]
pub struct SceneError {
    /// The file.
    pub file: PathBuf,
    /// Position in the file.
    pub place: Place,
    /// What is wrong, in one sentence without a full stop.
    pub what: String,
    /// What would be valid, or what to do.
    pub help: Option<String>,
}

struct HelpLine<'a>(Option<&'a str>);

impl fmt::Display for HelpLine<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.map_or(Ok(()), |help| write!(f, "\n       {help}"))
    }
}

impl SceneError {
    pub(crate) fn new(file: &Path, place: Place, what: impl Into<String>) -> Self {
        Self { file: file.to_owned(), place, what: what.into(), help: None }
    }

    pub(crate) fn file(file: &Path, what: impl Into<String>) -> Self {
        Self::new(file, Place::File, what)
    }

    /// The error with its byte position replaced by line and column in `text`, the contents of the file.
    pub(crate) fn in_text(mut self, text: &[u8]) -> Self {
        if let Place::Byte(at) = self.place {
            // A byte order mark does not count as a column.
            let (mark, rest) = text.split_at(if text.starts_with("\u{feff}".as_bytes()) { 3 } else { 0 });
            let before =
                &rest[..usize::try_from(at).map_or(rest.len(), |at| at.saturating_sub(mark.len()).min(rest.len()))];
            let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
            let start = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
            // All bytes of a character after its first are 0x80 to 0xbf.
            let column = 1 + before[start..].iter().filter(|byte| **byte & 0xc0 != 0x80).count();
            self.place =
                Place::Column(u32::try_from(line).unwrap_or(u32::MAX), u32::try_from(column).unwrap_or(u32::MAX));
        }
        self
    }

    pub(crate) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// The memory budget of a load, in bytes. It counts large blocks (files, vertices, triangles, texels), but not every small allocation.
#[derive(Debug, Clone)]
pub(crate) struct Budget {
    limit: u64,
    used: u64,
}

impl Budget {
    pub(crate) fn new(limit: u64) -> Self {
        Self { limit, used: 0 }
    }

    /// Books `bytes` for `what`, before they are allocated. Fails if the limit would be exceeded.
    pub(crate) fn take(&mut self, file: &Path, what: &str, bytes: u64) -> Result<(), SceneError> {
        let used = self.used.saturating_add(bytes);
        if used > self.limit {
            return Err(SceneError::file(
                file,
                format!("{what} need {}, which makes {} in all", Mebibytes(bytes), Mebibytes(used)),
            )
            .help(format!("the limit is {}; `--max-memory` raises it", Mebibytes(self.limit))));
        }
        self.used = used;
        Ok(())
    }

    /// Bytes that may still be booked.
    pub(crate) fn left(&self) -> u64 {
        self.limit.saturating_sub(self.used)
    }

    /// Returns bytes that [`Self::take`] booked.
    pub(crate) fn give_back(&mut self, bytes: u64) {
        self.used = self.used.saturating_sub(bytes);
    }
}

struct Mebibytes(u64);

impl fmt::Display for Mebibytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} MiB", self.0 as f64 / f64::from(1 << 20))
    }
}
