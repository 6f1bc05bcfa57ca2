//! Lines of OBJ and MTL files.

use memchr::{memchr, memchr_iter};
use rayon::prelude::*;
use std::borrow::Cow;

/// Logical lines: without line ends, comments and surrounding blanks; lines that end in `\` are joined with the next.
#[derive(Clone)]
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    next_number: u64,
    about: Counts,
}

/// Estimated number of statements of each kind in a piece, from the first letters of its lines. Lists are allocated with these
/// sizes: growing a list step by step makes other threads wait for the system's allocator.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) positions: usize,
    pub(super) texcoords: usize,
    pub(super) normals: usize,
    pub(super) faces: usize,
}

/// Cuts a file into pieces of about `size` bytes. Each piece consists of whole logical lines and stores the number of its first line.
pub(super) fn pieces(bytes: &[u8], size: usize) -> Vec<Lines<'_>> {
    let mut rest = Lines::new(bytes).rest;
    let mut parts = Vec::with_capacity(rest.len() / size.max(1) + 1);
    while !rest.is_empty() {
        let (part, after) = rest.split_at(end_of_line(rest, size.max(1)));
        parts.push(part);
        rest = after;
    }
    let counts: Vec<(u64, Counts)> = parts.par_iter().with_max_len(1).map(|part| count(part)).collect();
    let mut next_number = 1;
    let mut pieces = Vec::with_capacity(parts.len());
    for (rest, (ends, about)) in parts.into_iter().zip(counts) {
        pieces.push(Lines { rest, next_number, about });
        next_number += ends;
    }
    pieces
}

/// The number of line ends in a piece, and its estimated statements.
fn count(part: &[u8]) -> (u64, Counts) {
    let (mut ends, mut about) = (0, Counts::default());
    let mut line = |start: usize| match part[start..] {
        [b'v', b' ' | b'\t', ..] => about.positions += 1,
        [b'v', b't', ..] => about.texcoords += 1,
        [b'v', b'n', ..] => about.normals += 1,
        [b'f', ..] => about.faces += 1,
        _ => {}
    };
    line(0);
    for end in memchr_iter(b'\n', part) {
        ends += 1;
        line(end + 1);
    }
    (ends, about)
}

/// End of the logical line that contains the byte before `from`.
fn end_of_line(bytes: &[u8], mut from: usize) -> usize {
    loop {
        let Some(end) = bytes.get(from - 1..).and_then(|rest| memchr(b'\n', rest)) else { return bytes.len() };
        let end = from - 1 + end;
        let last = bytes[..end].iter().rfind(|byte| **byte == b'\n' || !byte.is_ascii_whitespace());
        if last != Some(&b'\\') {
            return end + 1;
        }
        from = end + 2;
    }
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let rest = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        Self { rest, next_number: 1, about: Counts::default() }
    }

    /// Estimated statements of the piece; zeros for lines that were not made by [`pieces`].
    pub(super) fn about(&self) -> Counts {
        self.about
    }

    /// The next line with the number of its first physical line; `None` at the end.
    pub(super) fn next(&mut self) -> Option<(u64, Cow<'a, [u8]>)> {
        if self.rest.is_empty() {
            return None;
        }
        let number = self.next_number;
        let first = self.physical();
        let Some(mut start) = continued(first) else {
            return Some((number, Cow::Borrowed(without_comment(first))));
        };
        let mut joined = Vec::new();
        loop {
            joined.extend_from_slice(start);
            joined.push(b' ');
            let line = self.physical();
            match continued(line) {
                Some(part) if !self.rest.is_empty() => start = part,
                part => {
                    joined.extend_from_slice(part.unwrap_or(line));
                    let length = without_comment(&joined).len();
                    joined.truncate(length);
                    return Some((number, Cow::Owned(joined)));
                }
            }
        }
    }

    fn physical(&mut self) -> &'a [u8] {
        self.next_number += 1;
        let end = memchr(b'\n', self.rest).unwrap_or(self.rest.len());
        let line = &self.rest[..end];
        self.rest = self.rest.get(end + 1..).unwrap_or_default();
        line.trim_ascii()
    }
}

fn continued(line: &[u8]) -> Option<&[u8]> {
    line.strip_suffix(b"\\")
}

/// Removes a comment. A `#` starts a comment only at the start of a line or after a blank; file names may contain it elsewhere.
fn without_comment(line: &[u8]) -> &[u8] {
    let comment = |at: &usize| *at == 0 || line[*at - 1].is_ascii_whitespace();
    match memchr_iter(b'#', line).find(comment) {
        Some(at) => line[..at].trim_ascii_end(),
        None => line,
    }
}

/// The first word and the rest.
pub(super) fn split_word(line: &[u8]) -> (&[u8], &[u8]) {
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    (&line[..end], line[end..].trim_ascii_start())
}

pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Decodes UTF-8 if the bytes are valid UTF-8, otherwise Latin-1.
pub(super) fn text(bytes: &[u8]) -> String {
    std::str::from_utf8(bytes).map_or_else(|_| bytes.iter().map(|byte| char::from(*byte)).collect(), str::to_owned)
}

/// Parses a number, including infinities and NaN; `None` if it is not a number.
pub(super) fn number(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Vec<(u64, String)> {
        let mut lines = Lines::new(text.as_bytes());
        std::iter::from_fn(|| lines.next()).map(|(number, line)| (number, super::text(&line))).collect()
    }

    #[test]
    fn lines_are_joined_trimmed_and_numbered_by_their_first_physical_line() {
        let lines = all("v 1\t2 3\r\nf 1 2 \\\r\n 3 \\\n4\n # note\nmap_Kd a#b.png # the wall\nf 5 \\");
        let expected = [(1, "v 1\t2 3"), (2, "f 1 2  3  4"), (5, ""), (6, "map_Kd a#b.png"), (7, "f 5")];
        let lines: Vec<_> = lines.iter().map(|(number, line)| (*number, line.trim_end())).collect();
        assert_eq!(lines, expected);
    }

    #[test]
    fn text_that_is_not_utf_8_is_read_as_latin_1() {
        assert_eq!(text(b"\xC1gua"), "Água");
        assert_eq!(text("Água".as_bytes()), "Água");
    }
}
