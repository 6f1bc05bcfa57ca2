//! Problems of an input file, each with its place, warnings counted by kind, and decisions with their reasons.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The text of one input file, shared by every problem found in it.
#[derive(Debug, Clone)]
pub struct Source {
    /// The file, as it is to be printed.
    pub path: PathBuf,
    /// Its whole text.
    pub text: Arc<str>,
}

impl Source {
    /// Line and column of a byte offset, both counted from 1; the column counts characters.
    #[must_use]
    pub fn line_column(&self, offset: usize) -> (usize, usize) {
        let mut end = offset.min(self.text.len());
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        let before = &self.text[..end];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// Severity of a problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Information only; the result is as the file specifies.
    Note,
    /// Something was left out or replaced.
    Warning,
    /// Nothing can be rendered.
    Error,
}

/// A problem: its place, a message, and a hint.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Severity.
    pub severity: Severity,
    /// The file and the byte range in it; `None` if the problem has no place in a text file.
    pub place: Option<(Source, std::ops::Range<usize>)>,
    /// What is wrong, in one sentence without a full stop.
    pub message: String,
    /// What would be valid, with the nearest name if there is one.
    pub help: Option<String>,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.severity {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        write!(f, "{kind}: ")?;
        if let Some((source, range)) = &self.place {
            let (line, column) = source.line_column(range.start);
            write!(f, "{}:{line}:{column}: ", source.path.display())?;
        }
        f.write_str(&self.message)?;
        if let Some(help) = &self.help {
            write!(f, "\n       {help}")?;
        }
        Ok(())
    }
}

/// Every problem of an input, reported together.
#[derive(Debug, Clone, Default)]
pub struct Problems(pub Vec<Problem>);

impl Problems {
    /// Whether there is an error among them.
    #[must_use]
    pub fn has_errors(&self) -> bool {
        self.0.iter().any(|problem| problem.severity == Severity::Error)
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.0.iter().enumerate() {
            if index > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}

/// A hint: the list of valid names, of at most 24, and `did you mean …?` with the valid name that is most similar to `written`, if one is
/// similar.
#[must_use]
pub fn valid_names<'a>(written: &str, valid: impl IntoIterator<Item = &'a str>) -> String {
    let mut names: Vec<&str> = valid.into_iter().collect();
    names.sort_unstable();
    names.dedup();
    if names.is_empty() {
        return "none is declared".to_owned();
    }
    let nearest = names
        .iter()
        .map(|name| (strsim::normalized_damerau_levenshtein(&name.to_lowercase(), &written.to_lowercase()), *name))
        .filter(|(similarity, _)| *similarity >= 0.5)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    const SHOWN: usize = 24;
    let mut list = names[..names.len().min(SHOWN)].join(", ");
    if names.len() > SHOWN {
        list.push_str(&format!(", … ({} in all)", names.len()));
    }
    match nearest {
        Some((_, name)) => format!("valid: {list}; did you mean `{name}`?"),
        None => format!("valid: {list}"),
    }
}

/// Warnings of one kind with one remedy in one file: their number, and the first few places.
#[derive(Debug, Clone)]
pub struct WarningGroup {
    /// The file.
    pub file: PathBuf,
    /// What was found, in the plural: `degenerate triangles`, `missing textures`.
    pub what: &'static str,
    /// What was done about it: `left out`, `the diffuse colour serves`.
    pub remedy: &'static str,
    /// Number of such warnings.
    pub count: u64,
    /// The first [`WarningGroup::PLACES`] places: an object, a line, a texture name.
    pub places: Vec<String>,
}

impl WarningGroup {
    /// Number of places that are kept.
    pub const PLACES: usize = 5;
}

impl fmt::Display for WarningGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} {}: {}", self.file.display(), self.count, self.what, self.places.join("; "))?;
        let more = self.count - self.places.len() as u64;
        if more > 0 {
            write!(f, "; and {more} more")?;
        }
        write!(f, " ({})", self.remedy)
    }
}

/// Counted warnings of a load, in the order in which their kinds were met.
#[derive(Debug, Clone, Default)]
pub struct Warnings {
    groups: Vec<WarningGroup>,
}

impl Warnings {
    /// Counts a warning `what` in `file`. `place` is called only while places are still kept.
    pub fn add(&mut self, file: &Path, what: &'static str, remedy: &'static str, place: impl FnOnce() -> String) {
        let group = self.group(file, what, remedy);
        group.count += 1;
        if group.places.len() < WarningGroup::PLACES {
            group.places.push(place());
        }
    }

    fn group(&mut self, file: &Path, what: &'static str, remedy: &'static str) -> &mut WarningGroup {
        let is_same = |group: &WarningGroup| (group.what, group.remedy) == (what, remedy) && group.file == file;
        let index = self.groups.iter().position(is_same).unwrap_or_else(|| {
            self.groups.push(WarningGroup { file: file.to_owned(), what, remedy, count: 0, places: Vec::new() });
            self.groups.len() - 1
        });
        &mut self.groups[index]
    }

    /// Appends the groups of `other`. Groups of the same kind, remedy and file are not merged.
    pub fn append(&mut self, mut other: Warnings) {
        self.groups.append(&mut other.groups);
    }

    /// Merges the warnings of a later part of the same work, as if both had been counted together.
    pub(crate) fn merge(&mut self, other: Warnings) {
        for mut later in other.groups {
            let is_same = |group: &&mut WarningGroup| {
                (group.what, group.remedy) == (later.what, later.remedy) && group.file == later.file
            };
            match self.groups.iter_mut().find(is_same) {
                Some(group) => {
                    group.count += later.count;
                    later.places.truncate(WarningGroup::PLACES - group.places.len());
                    group.places.append(&mut later.places);
                }
                None => self.groups.push(later),
            }
        }
    }

    /// The groups.
    #[must_use]
    pub fn groups(&self) -> &[WarningGroup] {
        &self.groups
    }

    /// Whether there are no warnings.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }
}
/// A decision and its reason.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Decision {
    /// Subject of the decision: a channel, a pass, an attribute.
    pub what: String,
    /// Whether the subject is built, written or run.
    pub built: bool,
    /// The reason.
    pub why: String,
}
