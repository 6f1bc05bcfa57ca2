//! Messages of a load, and declared names with their places.

use crate::diagnostic::{Problem, Problems, Severity, Source, valid_names};
use std::collections::HashMap;

/// A byte range of one of the files of a load.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Span {
    /// Index into [`Report::sources`].
    pub file: u32,
    /// First byte; files are limited to far below 4 GiB.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

/// Problems of a load. Those beyond [`Report::MOST`] are counted but not kept.
#[derive(Debug, Default)]
pub(super) struct Report {
    sources: Vec<Source>,
    found: Vec<(Span, Problem)>,
    errors: usize,
    remarks: usize,
}

/// A point in the sequence of reports.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    found: usize,
    errors: usize,
}

impl Report {
    /// Greatest number of errors that are kept, and of notes and warnings together.
    pub const MOST: usize = 100;

    /// Adds a file and returns its index for [`Span::file`].
    pub fn add_source(&mut self, source: Source) -> u32 {
        self.sources.push(source);
        u32::try_from(self.sources.len() - 1).expect("the number of files is capped")
    }

    /// A file by its index.
    pub fn source(&self, file: u32) -> &Source {
        &self.sources[file as usize]
    }

    /// Whether an error was reported.
    pub fn has_errors(&self) -> bool {
        self.errors > 0
    }

    /// Records a problem, unless the same problem is recorded already. `help` is called at most once, and only if the problem is kept.
    /// The function is not generic, so that it is compiled once for its hundreds of callers.
    fn push(&mut self, severity: Severity, at: Span, message: String, help: &mut dyn FnMut() -> Option<String>) {
        // A pass that a script repeats is read for each run; its problems are reported once.
        let same = |(place, problem): &(Span, Problem)| {
            *place == at && problem.severity == severity && problem.message == message
        };
        if self.found.iter().any(same) {
            return;
        }
        let count = if severity == Severity::Error { &mut self.errors } else { &mut self.remarks };
        *count += 1;
        if *count > Self::MOST {
            return;
        }
        let place = Some((self.sources[at.file as usize].clone(), at.start as usize..at.end as usize));
        self.found.push((at, Problem { severity, place, message, help: help() }));
    }

    /// Reports an error without a hint.
    pub fn error(&mut self, at: Span, message: impl Into<String>) {
        self.push(Severity::Error, at, message.into(), &mut || None);
    }

    /// Reports an error with a hint. `help` is called only if the error is kept.
    pub fn error_help(&mut self, at: Span, message: impl Into<String>, help: impl FnOnce() -> String) {
        let mut help = Some(help);
        self.push(Severity::Error, at, message.into(), &mut || help.take().map(|help| help()));
    }

    /// Reports a warning: something was left out or replaced.
    pub fn warning(&mut self, at: Span, message: impl Into<String>, help: impl FnOnce() -> Option<String>) {
        let mut help = Some(help);
        self.push(Severity::Warning, at, message.into(), &mut || help.take().and_then(|help| help()));
    }

    /// Reports a note.
    pub fn note(&mut self, at: Span, message: impl Into<String>) {
        self.push(Severity::Note, at, message.into(), &mut || None);
    }

    /// The current point in the sequence of reports.
    pub fn mark(&self) -> Mark {
        Mark { found: self.found.len(), errors: self.errors }
    }

    /// Turns errors reported since a mark into warnings, because they concern something unused. Returns the first of these errors
    /// with its place; `None` if there were none.
    pub fn excuse(&mut self, since: Mark, what: &str) -> Option<String> {
        let mut first = None;
        for (_, problem) in self.found[since.found..].iter_mut().filter(|(_, p)| p.severity == Severity::Error) {
            problem.severity = Severity::Warning;
            let place = problem.place.as_ref().map_or(String::new(), |(source, range)| {
                let (line, column) = source.line_column(range.start);
                format!("{}:{line}:{column}: ", source.path.display())
            });
            first.get_or_insert_with(|| format!("{place}{}", problem.message));
            problem.message = format!("{what}: {}", problem.message);
        }
        self.remarks += self.errors - since.errors;
        self.errors = since.errors;
        first
    }

    /// Line and column of a span.
    pub fn line_column(&self, at: Span) -> (usize, usize) {
        self.source(at.file).line_column(at.start as usize)
    }

    /// All reports, sorted by file and place.
    pub fn finish(mut self) -> Problems {
        self.found.sort_by_key(|(at, problem)| (at.file, at.start, std::cmp::Reverse(problem.severity)));
        let mut problems: Vec<Problem> = self.found.into_iter().map(|(_, problem)| problem).collect();
        for (count, severity, what) in
            [(self.errors, Severity::Error, "errors"), (self.remarks, Severity::Note, "notes and warnings")]
        {
            if let Some(more) = count.checked_sub(Self::MOST).filter(|more| *more > 0) {
                let message = format!("{more} more {what} are not listed");
                problems.push(Problem { severity, place: None, message, help: None });
            }
        }
        Problems(problems)
    }
}

/// Greatest number of characters of a text that messages show, and that are compared with valid names.
const SHOWN: usize = 64;

/// A text for messages, shortened if it is long.
pub(super) fn shown(text: &str) -> String {
    match text.char_indices().nth(SHOWN) {
        None => text.to_owned(),
        Some((end, _)) => format!("{}…", &text[..end]),
    }
}

/// [`valid_names`] in bounded time: long texts are shortened, and of long lists only the length is given.
pub(super) fn suggest<'a>(written: &str, valid: impl IntoIterator<Item = &'a str>) -> String {
    const MOST: usize = 256;
    let names: Vec<&str> = valid.into_iter().collect();
    if names.len() > MOST {
        return format!("{} names are declared", names.len());
    }
    let written = shown(written);
    let names: Vec<String> = names.into_iter().map(shown).collect();
    valid_names(&written, names.iter().map(String::as_str))
}

/// Result of a name look-up.
pub(super) enum Found {
    /// Found as written.
    Exact(usize),
    /// Found with different case.
    OtherCase(usize),
    /// Not found.
    Missing,
}

/// Declared names of one kind, in order.
#[derive(Debug)]
pub(super) struct Names {
    /// The kind, for messages: `camera`.
    pub what: &'static str,
    list: Vec<(String, Option<Span>)>,
    exact: HashMap<String, usize>,
    folded: HashMap<String, usize>,
}

impl Names {
    pub fn new(what: &'static str) -> Self {
        Self { what, list: Vec::new(), exact: HashMap::new(), folded: HashMap::new() }
    }

    /// Declares the next name. A repeated name is an error; the repeated name still gets an index, but look-ups find the first.
    pub fn declare(&mut self, report: &mut Report, name: &str, at: Span) {
        let index = self.list.len();
        if let Some(&first) = self.exact.get(name) {
            let first = self.list[first].1.map(|first| (report.source(first.file).clone(), first.start as usize));
            report.error_help(at, format!("a second {} is named `{}`", self.what, shown(name)), || match first {
                Some((source, offset)) => {
                    let (line, column) = source.line_column(offset);
                    format!("the first is at {}:{line}:{column}", source.path.display())
                }
                None => "that name is built in".to_owned(),
            });
        }
        self.push(index, name, Some(at));
    }

    /// Declares the next name, without a place in a file.
    pub fn declare_built_in(&mut self, name: &str) {
        self.push(self.list.len(), name, None);
    }

    fn push(&mut self, index: usize, name: &str, at: Option<Span>) {
        self.exact.entry(name.to_owned()).or_insert(index);
        self.folded.entry(name.to_lowercase()).or_insert(index);
        self.list.push((name.to_owned(), at));
    }

    /// All names.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        self.list.iter().map(|(name, _)| name.as_str())
    }

    /// Looks a name up.
    pub fn find(&self, name: &str) -> Found {
        if let Some(&index) = self.exact.get(name) {
            return Found::Exact(index);
        }
        self.folded.get(&name.to_lowercase()).map_or(Found::Missing, |&index| Found::OtherCase(index))
    }

    /// Looks up a name that a file mentions, and returns its index. A different case is reported as a note; an unknown name is reported as
    /// an error and gives `None`.
    pub fn resolve(&self, report: &mut Report, name: &str, at: Span) -> Option<usize> {
        match self.find(name) {
            Found::Exact(index) => Some(index),
            Found::OtherCase(index) => {
                let (declared, what) = (&self.list[index].0, self.what);
                report.note(at, format!("`{}` stands for the {what} `{}`", shown(name), shown(declared)));
                Some(index)
            }
            Found::Missing => {
                report.error_help(at, format!("there is no {} `{}`", self.what, shown(name)), || {
                    suggest(name, self.iter())
                });
                None
            }
        }
    }
}
