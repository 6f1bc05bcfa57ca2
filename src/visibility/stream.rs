//! Streams blocks of pairs to a file, with a journal from which a run after a kill continues.
//!
//! Rows are appended to `OUT.part`. After each block a line is appended to `OUT.part.journal`: the number of complete bytes, the
//! position of the next pairs, and the hash of the block; a hash of the line itself reveals a truncated line. At the end the file
//! is synchronised and renamed, and the journal removed. A resumed run recomputes everything after the last complete line of the journal
//! whose block is intact.

use super::Format;
use crate::passes::visibility::{Cursor, PairSource, Row, RowFinder};
use crate::pipeline::backend::BackendError;
use crate::pipeline::executor::Progress;
use crate::pipeline::files::{Growing, Resumable};
use crate::pipeline::scene::fnv1a;
use rayon::prelude::*;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

/// Number of pairs in a block.
pub const BLOCK: usize = 1 << 16;
/// Number of rows that a task formats.
const GRAIN: usize = 1 << 12;

/// Destination of the rows.
#[derive(Debug, Clone)]
pub struct Target {
    /// The file.
    pub path: PathBuf,
    /// Format of the file.
    pub format: Format,
    /// A line with everything that the rows depend on; only an interrupted run with the same line is continued.
    pub about: String,
    /// Whether to continue an interrupted run, if there is one.
    pub resume: bool,
}

/// Why rows could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StreamError {
    /// A file cannot be read or written.
    #[error("{path}: {error}")]
    File {
        /// The file.
        path: String,
        /// The reason.
        error: io::Error,
    },
    /// The list of pairs is in error.
    #[error("{0}")]
    Pairs(String),
    /// An interrupted run exists and may not be continued: resuming was not requested, or it is a different run.
    #[error("{0}")]
    Interrupted(String),
    /// The engine failed.
    #[error("{0}")]
    Engine(#[from] BackendError),
}

/// Numbers of pairs and segments of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Summary {
    /// Number of pairs of each class: never, open, closed, sampled.
    pub classes: [u64; 4],
    /// Number of segments of sampled pairs.
    pub samples: u64,
    /// Number of pairs that the interrupted run had completed.
    pub resumed: u64,
}

impl Summary {
    /// Number of all pairs.
    #[must_use]
    pub fn pairs(&self) -> u64 {
        self.classes.iter().sum()
    }
}

/// A line of the journal.
#[derive(Debug, Clone, Copy, Default)]
struct Mark {
    bytes: u64,
    cursor: Cursor,
    summary: Summary,
    /// Length and hash of the last block.
    block: u64,
    hash: u128,
}

impl Mark {
    fn line(&self) -> String {
        let Self { bytes, cursor: [a, b], summary, block, hash } = self;
        let [never, open, closed, sampled] = summary.classes;
        let text = format!("{bytes} {a} {b} {never} {open} {closed} {sampled} {} {block} {hash}", summary.samples);
        format!("{text} {:032x}\n", fnv1a(text.as_bytes()))
    }

    /// Parses a line; `None` for a truncated one.
    fn parse(line: &str) -> Option<Self> {
        let (text, hash) = line.strip_suffix('\n')?.rsplit_once(' ')?;
        if format!("{:032x}", fnv1a(text.as_bytes())) != hash {
            return None;
        }
        let words: Vec<&str> = text.split(' ').collect();
        let number = |index: usize| words.get(index)?.parse::<u64>().ok();
        let classes = [number(3)?, number(4)?, number(5)?, number(6)?];
        Some(Self {
            bytes: number(0)?,
            cursor: [number(1)?, number(2)?],
            summary: Summary { classes, samples: number(7)?, resumed: 0 },
            block: number(8)?,
            hash: words.get(9)?.parse().ok()?,
        })
    }
}

/// The file of rows and the journal of a run.
struct Files {
    output: Resumable,
    rows: Growing,
    marks: Growing,
}

fn failed(path: &Path) -> impl Fn(io::Error) -> StreamError + '_ {
    |error| StreamError::File { path: path.display().to_string(), error }
}

/// Does `work` on an open file; an error names the file.
fn at<T>(file: &mut Growing, work: impl FnOnce(&mut Growing) -> io::Result<T>) -> Result<T, StreamError> {
    work(file).map_err(failed(file.path()))
}

impl Files {
    /// Begins a run, or finds the last valid mark of an interrupted one.
    fn open(target: &Target, header: &[u8]) -> Result<(Self, Mark), StreamError> {
        let output = Resumable::at(&target.path).map_err(failed(&target.path))?;
        if output.is_begun() && !target.resume {
            return Err(StreamError::Interrupted(format!(
                "{} is there from a run that was interrupted; --resume goes on with it, or delete it",
                output.part().display()
            )));
        }
        let [rows, marks] = output.open().map_err(|(path, error)| failed(&path)(error))?;
        let mut files = Self { output, rows, marks };
        let title = format!("{}\n", target.about);
        let found = files.last_mark(&title)?;
        let Self { rows, marks, .. } = &mut files;
        let mark = match found {
            Some((mark, whole)) => {
                at(rows, |rows| rows.shorten(mark.bytes))?;
                at(marks, |marks| marks.shorten(whole))?;
                mark
            }
            None => {
                at(rows, |rows| rows.shorten(0))?;
                at(marks, |marks| marks.shorten(0))?;
                at(rows, |rows| rows.write_all(header))?;
                at(marks, |marks| marks.write_all(title.as_bytes()))?;
                Mark { bytes: header.len() as u64, ..Mark::default() }
            }
        };
        Ok((files, mark))
    }

    /// The last mark whose block is intact, and the length of the journal up to it; `None` if there is none.
    fn last_mark(&mut self, title: &str) -> Result<Option<(Mark, u64)>, StreamError> {
        let length = at(&mut self.rows, |rows| rows.size())?;
        let mut text = Vec::new();
        at(&mut self.marks, |marks| marks.read_to_end(&mut text))?;
        let text = String::from_utf8_lossy(&text);
        if length == 0 || !text.contains('\n') {
            // The file of rows is empty, or the journal's first line is not complete.
            return Ok(None);
        }
        let Some(lines) = text.strip_prefix(title) else {
            let before = text.lines().next().unwrap_or_default();
            return Err(StreamError::Interrupted(format!(
                "{} is of another run and cannot be gone on with; delete it and {} to begin anew\n       then: {before}\n       now:  {}",
                self.rows.path().display(),
                self.marks.path().display(),
                title.trim_end()
            )));
        };
        let mut marks: Vec<(Mark, u64)> = Vec::new();
        let mut end = title.len() as u64;
        for line in lines.split_inclusive('\n') {
            let Some(mark) = Mark::parse(line) else { break };
            end += line.len() as u64;
            marks.push((mark, end));
        }
        let mut block = Vec::new();
        while let Some((mark, end)) = marks.pop() {
            if mark.bytes > length || mark.block > mark.bytes {
                continue;
            }
            block.resize(mark.block as usize, 0);
            at(&mut self.rows, |rows| rows.seek(SeekFrom::Start(mark.bytes - mark.block)))?;
            at(&mut self.rows, |rows| rows.read_exact(&mut block))?;
            if fnv1a(&block) == mark.hash {
                return Ok(Some((mark, end)));
            }
        }
        Ok(None)
    }
}

/// Writes the rows of all pairs of a source; `progress` counts in the units of [`PairSource::progress`].
///
/// Holds the rows of one block at a time, whatever the number of pairs.
///
/// # Errors
/// If a file cannot be read or written, the pairs are in error, the engine fails, or an interrupted run exists and may not be continued. The rows
/// written so far stay, so that the run can be continued.
pub fn stream(
    finder: &mut dyn RowFinder,
    source: &mut dyn PairSource,
    target: &Target,
    progress: &Progress,
) -> Result<Summary, StreamError> {
    let form_factors = finder.options().form_factors;
    let header = |rows: u64| target.format.header(&target.about, form_factors, rows);
    let (mut files, mut mark) = Files::open(target, &header(0))?;
    let mut summary = Summary { resumed: mark.summary.pairs(), ..mark.summary };
    if summary.resumed > 0 {
        source.seek(mark.cursor).map_err(StreamError::Pairs)?;
    }
    let [mut done, total] = source.progress();
    progress.start(total);
    progress.advance(done);
    let (mut pairs, mut rows) = (Vec::with_capacity(BLOCK), Vec::new());
    loop {
        pairs.clear();
        source.fill(BLOCK, &mut pairs).map_err(StreamError::Pairs)?;
        if pairs.is_empty() {
            break;
        }
        let (mut written, mut hashes) = (0, Vec::new());
        // A source may return more than a block at once.
        for pairs in pairs.chunks(BLOCK) {
            finder.rows(pairs, &mut rows)?;
            for row in &rows {
                summary.classes[row.class as usize] += 1;
                summary.samples += u64::from(row.samples);
            }
            let bytes = bytes(target.format, &rows);
            at(&mut files.rows, |rows| rows.write_all(&bytes))?;
            written += bytes.len() as u64;
            hashes.push((bytes.len() as u64, fnv1a(&bytes)));
        }
        let (block, hash) = hashes.pop().unwrap_or_default();
        mark = Mark { bytes: mark.bytes + written, cursor: source.cursor(), summary, block, hash };
        at(&mut files.marks, |marks| marks.write_all(mark.line().as_bytes()))?;
        let [now, _] = source.progress();
        progress.advance(now.saturating_sub(done));
        done = now;
    }
    if target.format.counts() {
        at(&mut files.rows, |rows| rows.seek(SeekFrom::Start(0)))?;
        at(&mut files.rows, |rows| rows.write_all(&header(summary.pairs())))?;
    }
    files.output.commit(files.rows).map_err(failed(&target.path))?;
    Ok(summary)
}

fn bytes(format: Format, rows: &[Row]) -> Vec<u8> {
    let some = |rows: &[Row]| {
        let mut bytes = Vec::new();
        rows.iter().for_each(|row| format.write(row, &mut bytes));
        bytes
    };
    let parts: Vec<Vec<u8>> = rows.par_chunks(GRAIN).map(some).collect();
    parts.concat()
}
