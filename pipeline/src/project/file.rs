//! Reading project and library files, and resolving the paths in them.

use super::dom::Value;
use super::report::{Report, Span};
use crate::diagnostic::Source;
use std::path::{Path, PathBuf};

/// Largest project or library file, bytes.
pub(super) const MAX_FILE: u64 = 16 << 20;

/// Reads a text file into [`Report::sources`] and returns its index. `named_at` is the place where another file names this file. `None`
/// after an error.
pub(super) fn read(report: &mut Report, path: &Path, named_at: Option<Span>) -> Option<u32> {
    let bytes = match read_bytes(path) {
        Ok(bytes) => bytes,
        Err(why) => {
            let message = format!("cannot read {}: {why}", path.display());
            let at = named_at.unwrap_or_else(|| {
                let file = report.add_source(Source { path: path.to_owned(), text: "".into() });
                Span { file, start: 0, end: 0 }
            });
            if path.exists() {
                report.error(at, message);
            } else {
                report.error_help(at, message, || crate::paths::nearest_help(path));
            }
            return None;
        }
    };
    let body = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
    let wrong = undecodable(body);
    let text = String::from_utf8_lossy(body);
    // Offsets up to the invalid byte are those of the file. The character that replaces this byte is three bytes long.
    let end = wrong.as_ref().and_then(|(offset, ..)| Some(offset + text.get(*offset..)?.chars().next()?.len_utf8()));
    let file = report.add_source(Source { path: path.to_owned(), text: text.into() });
    if let Some((offset, message, help)) = wrong {
        let at = Span { file, start: offset as u32, end: end.unwrap_or(offset) as u32 };
        report.error_help(at, message, || help.to_owned());
        return None;
    }
    Some(file)
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, String> {
    crate::files::read(path, MAX_FILE).map_err(|error| error.to_string())
}

/// The first fault in bytes that are not a text allowed in XML: its offset, a message and a hint.
fn undecodable(bytes: &[u8]) -> Option<(usize, String, &'static str)> {
    let utf8 = "valid: UTF-8, with or without a byte-order mark; convert the file";
    if bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") {
        return Some((0, "the file is UTF-16: its first two bytes are that byte-order mark".to_owned(), utf8));
    }
    match std::str::from_utf8(bytes) {
        Err(error) => {
            let offset = error.valid_up_to();
            let message = format!("byte {offset} (0x{:02X}) is not UTF-8", bytes[offset]);
            Some((offset, message, "valid: UTF-8; Latin-1 and Windows-1252 must be converted"))
        }
        Ok(text) => {
            let control = |c: char| c.is_ascii_control() && !matches!(c, '\t' | '\n' | '\r');
            let offset = text.find(control)?;
            let message = format!("byte {offset} (0x{:02X}) is a control character", bytes[offset]);
            Some((offset, message, utf8))
        }
    }
}

/// The folder that a project's paths are relative to.
pub(super) struct Folder {
    folder: PathBuf,
    /// Number of case-insensitive look-ups so far.
    lookups: u32,
}

impl Folder {
    /// The folder of a project file.
    pub fn of(project: &Path) -> Self {
        Self { folder: project.parent().unwrap_or(Path::new("")).to_owned(), lookups: 0 }
    }

    /// The file that `value` names, relative to the folder; it need not exist. If the path is empty, starts with the letter of a
    /// Windows drive, or is a network path, an error is reported and the result is `None`.
    ///
    /// Backslashes count as slashes. Paths that a printed page wrapped are joined. If an existing file differs only in case, or has a
    /// name in Latin-1, that file is taken and a note says so.
    pub fn resolve(&mut self, report: &mut Report, value: &Value) -> Option<PathBuf> {
        let mut nominal = None;
        for text in std::iter::once(&value.text).chain(&value.joined) {
            let text = text.replace('\\', "/");
            let bytes = text.as_bytes();
            if text.is_empty() {
                report.error(value.span, "this path is empty");
                return None;
            }
            if bytes.len() >= 2 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':' || text.starts_with("//") {
                report.error_help(value.span, format!("`{}` is a path of one Windows machine", value.shown()), || {
                    "valid: a path relative to this file".to_owned()
                });
                return None;
            }
            let path = tidy(&self.folder, &text);
            if path.exists() {
                return Some(path);
            }
            nominal = Some(path);
        }
        let nominal = nominal?;
        let Some(actual) = self.any_case(&value.joined.as_ref().unwrap_or(&value.text).replace('\\', "/")) else {
            return Some(nominal);
        };
        report.note(value.span, format!("`{}` stands for {}", value.shown(), actual.display()));
        Some(actual)
    }

    /// An existing path that differs from `text` in the folder only by case, or by names in Latin-1.
    fn any_case(&mut self, text: &str) -> Option<PathBuf> {
        /// Greatest number of look-ups: a project with thousands of missing files must not cause a search for each.
        const MOST_LOOKUPS: u32 = 64;
        self.lookups += 1;
        if text.starts_with('/') || self.lookups > MOST_LOOKUPS {
            return None;
        }
        let mut path = self.folder.clone();
        for part in text.split('/').filter(|part| !matches!(*part, "" | ".")) {
            let next = path.join(part);
            if next.exists() {
                path = next;
                continue;
            }
            let entry = crate::paths::entry_in_any_case(&path, part)?;
            path.push(entry);
        }
        Some(path)
    }
}

/// `folder/text` without empty and `.` components; `..` is kept, because it may follow a symbolic link.
fn tidy(folder: &Path, text: &str) -> PathBuf {
    let mut path = folder.to_owned();
    if text.starts_with('/') {
        path.push("/");
    }
    path.extend(text.split('/').filter(|part| !matches!(*part, "" | ".")));
    path
}

/// The stem of a program or shader file, without folder and extension: `final` for `optix\final.ptx`.
pub(super) fn stem(value: &Value) -> &str {
    let text = value.joined.as_deref().unwrap_or(&value.text);
    let name = text.rsplit(['/', '\\']).next().unwrap_or(text).trim();
    match name.rfind('.') {
        Some(dot) if dot > 0 => &name[..dot],
        _ => name,
    }
}
