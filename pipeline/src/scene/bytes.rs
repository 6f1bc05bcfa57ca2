//! A little-endian reader that never reads past the end. It copies only strings and numbers, after checking that the file has enough bytes
//! for them.

use super::error::{Place, SceneError};
use std::path::Path;

/// A cursor over a file's bytes.
#[derive(Debug, Clone)]
pub(crate) struct Reader<'a> {
    file: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(file: &'a Path, bytes: &'a [u8]) -> Self {
        Self { file, bytes, at: 0 }
    }

    pub(crate) fn position(&self) -> u64 {
        self.at as u64
    }

    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    pub(crate) fn error(&self, what: impl Into<String>) -> SceneError {
        SceneError::new(self.file, Place::Byte(self.position()), what)
    }

    /// The next `count * size` bytes.
    pub(crate) fn block(&mut self, count: usize, size: usize, what: &str) -> Result<&'a [u8], SceneError> {
        match count.checked_mul(size).filter(|bytes| *bytes <= self.left()) {
            Some(bytes) => {
                let block = &self.bytes[self.at..self.at + bytes];
                self.at += bytes;
                Ok(block)
            }
            None => {
                let items = if count == 1 { "item" } else { "items" };
                let bytes = if size == 1 { "byte" } else { "bytes" };
                Err(self.error(format!("{what} announces {count} {items} of {size} {bytes}; {} are left", self.left())))
            }
        }
    }

    /// The next `length` bytes as a separate reader, whose positions also count from the start of the file.
    pub(crate) fn part(&mut self, length: usize, what: &str) -> Result<Reader<'a>, SceneError> {
        let at = self.at;
        self.block(length, 1, what)?;
        Ok(Reader { file: self.file, bytes: &self.bytes[..self.at], at })
    }

    pub(crate) fn u16(&mut self, what: &str) -> Result<u16, SceneError> {
        let block = self.block(1, 2, what)?;
        Ok(u16::from_le_bytes([block[0], block[1]]))
    }

    pub(crate) fn u32(&mut self, what: &str) -> Result<u32, SceneError> {
        let block = self.block(1, 4, what)?;
        Ok(u32::from_le_bytes([block[0], block[1], block[2], block[3]]))
    }

    pub(crate) fn count(&mut self, what: &str) -> Result<usize, SceneError> {
        Ok(self.u32(what)? as usize)
    }

    pub(crate) fn floats<const N: usize>(&mut self, what: &str) -> Result<[f32; N], SceneError> {
        let block = self.block(N, 4, what)?;
        Ok(std::array::from_fn(|i| f32_at(block, i)))
    }

    /// A Latin-1 string: its length, its bytes and a NUL.
    pub(crate) fn string(&mut self, what: &str) -> Result<String, SceneError> {
        let length = self.count(what)?;
        let text: String = self.block(length, 1, what)?.iter().map(|byte| char::from(*byte)).collect();
        match self.block(1, 1, what)? {
            [0] => Ok(text),
            other => Err(self.error(format!("{what}: a NUL must end the string, not {}", other[0]))),
        }
    }
}

/// The `index`th little-endian `f32` of a block.
pub(crate) fn f32_at(block: &[u8], index: usize) -> f32 {
    f32::from_le_bytes([block[4 * index], block[4 * index + 1], block[4 * index + 2], block[4 * index + 3]])
}
