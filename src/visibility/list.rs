//! Pairs from a file.

use crate::passes::visibility::{Cursor, PairSource};
use crate::pipeline::files::{self, Input};
use crate::pipeline::scene::fnv1a;
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

/// Longest line that is read, bytes.
const LONGEST: u64 = 4096;
/// Bytes hashed at a time.
const CHUNK: usize = 1 << 20;

/// Pairs in a text file: two ids a line, separated by a comma, a semicolon or blanks. Empty lines and lines that begin with `#` are
/// skipped, as are column names: a first line that does not begin with a number, or any line that begins with `a,b`. Anything after two
/// ids is ignored, so a file of rows is a valid list.
#[derive(Debug)]
pub struct ListedPairs {
    path: PathBuf,
    reader: BufReader<Input>,
    triangles: usize,
    /// Offset and number (from 0) of the next line.
    next: Cursor,
    bytes: u64,
    hash: u128,
}

impl ListedPairs {
    /// Opens a list for a scene with `triangles` triangles. It is read once to its end, so that errors are found before the work.
    ///
    /// # Errors
    /// The first error, with file, line and column.
    pub fn open(path: &Path, triangles: usize) -> Result<Self, String> {
        let wrong = |error: std::io::Error| format!("{}: {error}", path.display());
        let mut file = files::open(path).map_err(wrong)?;
        let (mut hashes, mut chunk, mut bytes) = (Vec::new(), Vec::with_capacity(CHUNK), 0);
        loop {
            chunk.clear();
            let read = file.by_ref().take(CHUNK as u64).read_to_end(&mut chunk).map_err(wrong)?;
            if read == 0 {
                break;
            }
            bytes += read as u64;
            hashes.extend(fnv1a(&chunk).to_be_bytes());
        }
        file.seek(SeekFrom::Start(0)).map_err(wrong)?;
        let mut list = Self {
            path: path.to_owned(),
            reader: BufReader::new(file),
            triangles,
            next: [0, 0],
            bytes,
            hash: fnv1a(&hashes),
        };
        let mut pairs = Vec::new();
        loop {
            pairs.clear();
            list.fill(1 << 16, &mut pairs)?;
            if pairs.is_empty() {
                break;
            }
        }
        list.seek([0, 0])?;
        Ok(list)
    }

    /// Hash of the file's contents.
    #[must_use]
    pub fn hash(&self) -> u128 {
        self.hash
    }

    fn pair(&self, line: &str) -> Result<Option<[u32; 2]>, String> {
        let separator = |c: char| c == ',' || c == ';' || c.is_whitespace();
        let text = line.trim();
        if text.is_empty() || text.starts_with('#') {
            return Ok(None);
        }
        let mut words = text.split(separator).filter(|word| !word.is_empty());
        let mut pair = [0; 2];
        for (index, id) in pair.iter_mut().enumerate() {
            let word = words.next().unwrap_or_default();
            // Words are slices of the line, so pointer differences give the column.
            let column =
                if word.is_empty() { line.trim_end().len() } else { word.as_ptr() as usize - line.as_ptr() as usize };
            let place = format!("{}:{}:{}", self.path.display(), self.next[1] + 1, column + 1);
            let valid = format!(
                "a pair is two ids of triangles, from 0 to {}, such as `3,14`",
                self.triangles.saturating_sub(1)
            );
            *id = match word.parse::<u32>() {
                Ok(id) if (id as usize) < self.triangles => id,
                Ok(id) => return Err(format!("{place}: there is no triangle {id}; {valid}")),
                // A line of column names.
                Err(_) if self.next[1] == 0 && index == 0 => return Ok(None),
                Err(_) if text.starts_with("a,b") => return Ok(None),
                Err(_) if word.is_empty() => return Err(format!("{place}: the second id is missing; {valid}")),
                Err(_) => {
                    let word: String = word.chars().take(40).collect();
                    return Err(format!("{place}: `{word}` is not an id; {valid}"));
                }
            };
        }
        Ok(Some(pair))
    }
}

impl PairSource for ListedPairs {
    fn fill(&mut self, most: usize, pairs: &mut Vec<[u32; 2]>) -> Result<(), String> {
        let mut line = Vec::new();
        let end = pairs.len() + most;
        while pairs.len() < end {
            line.clear();
            let place = format_args!("{}:{}", self.path.display(), self.next[1] + 1).to_string();
            let read = self.reader.by_ref().take(LONGEST).read_until(b'\n', &mut line);
            let read = read.map_err(|error| format!("{place}: {error}"))? as u64;
            if read == 0 {
                break;
            }
            if read == LONGEST && line.last() != Some(&b'\n') {
                return Err(format!(
                    "{place}:1: the line is longer than {LONGEST} bytes; a pair is two ids, such as `3,14`"
                ));
            }
            let text = std::str::from_utf8(&line)
                .map_err(|error| format!("{place}:{}: the line is not UTF-8 text", error.valid_up_to() + 1))?;
            pairs.extend(self.pair(text)?);
            self.next = [self.next[0] + read, self.next[1] + 1];
        }
        Ok(())
    }

    fn cursor(&self) -> Cursor {
        self.next
    }

    fn seek(&mut self, cursor: Cursor) -> Result<(), String> {
        self.next = cursor;
        let sought = self.reader.seek(SeekFrom::Start(cursor[0]));
        sought.map(|_| ()).map_err(|error| format!("{}: {error}", self.path.display()))
    }

    fn progress(&self) -> [u64; 2] {
        [self.next[0], self.bytes]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(text: &str) -> Result<Vec<[u32; 2]>, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("pairs.csv");
        std::fs::write(&path, text).expect("written");
        let mut list =
            ListedPairs::open(&path, 10).map_err(|error| error.replace(&format!("{}", path.display()), "F"))?;
        let (mut pairs, mut all) = (Vec::new(), Vec::new());
        loop {
            pairs.clear();
            // Reads one pair at a time, each time after seeking to the cursor.
            list.fill(1, &mut pairs)?;
            let cursor = list.cursor();
            list.seek(cursor)?;
            all.extend_from_slice(&pairs);
            if pairs.is_empty() {
                return Ok(all);
            }
        }
    }

    #[test]
    fn lists_are_read_with_any_separator_and_their_errors_have_places() {
        let expected = Ok(vec![[1, 2], [3, 4], [5, 6]]);
        assert_eq!(list("a,b,class\n1,2,open\n# note\n\n 3\t4\r\n5;6"), expected);
        assert_eq!(list("# about\na,b\n1,2\n3 4\n5,6\n"), expected);
        assert_eq!(list(""), Ok(Vec::new()));
        let error = |text: &str| list(text).expect_err("it is wrong");
        assert!(
            error("1,2\n3,10")
                .starts_with("F:2:3: there is no triangle 10; a pair is two ids of triangles, from 0 to 9")
        );
        assert!(error("1,2\n3").starts_with("F:2:2: the second id is missing"));
        assert!(error("1,2\n  x,1").starts_with("F:2:3: `x` is not an id"));
        assert!(error("1,-2").starts_with("F:1:3: `-2` is not an id"));
        assert!(error(&"9".repeat(5000)).starts_with("F:1:1: the line is longer than 4096 bytes"));
    }
}
