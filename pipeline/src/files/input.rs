//! Reading regular files.

use super::{confine, fault};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// A regular file open for reading. Its size is fixed when it is opened: bytes appended later are not read, and an earlier end of
/// the file is an error.
#[derive(Debug)]
pub struct Input {
    file: File,
    size: u64,
    position: u64,
    faults: fault::Watch,
}

/// Opens a regular file.
///
/// # Errors
/// If it is missing, a folder, a pipe or a device, lies outside the folder of [`confine`](super::confine), or the system
/// refuses it.
pub fn open(path: &Path) -> io::Result<Input> {
    let mut faults = fault::watch(path);
    faults.on_open()?;
    let real = if confine::asks_for_real_paths() {
        let real = path.canonicalize()?;
        confine::check(&real).inspect_err(|_| confine::note_refused(&real))?;
        confine::note(&real);
        Some(real)
    } else {
        None
    };
    let path = real.as_deref().unwrap_or(path);
    // Checked before the file is opened, since opening a pipe waits for its writer.
    let metadata = std::fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "this is a folder and not a regular file"));
    }
    if !metadata.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "this is not a regular file"));
    }
    Ok(Input { file: File::open(path)?, size: metadata.len(), position: 0, faults })
}

/// Reads a whole file of at most `most` bytes.
///
/// # Errors
/// As [`open`]; if the file is larger; if it cannot be read to its end.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut input = open(path)?;
    if input.size() > most {
        let most = if most >> 20 > 0 { format!("{} MiB", most >> 20) } else { format!("{} KiB", most >> 10) };
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("it is larger than {most}")));
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(usize::try_from(input.size()).unwrap_or(usize::MAX))?;
    input.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Like [`read`], but returns `None` if the file does not exist.
///
/// # Errors
/// As [`read`], except for a missing file.
pub fn read_if_there(path: &Path, most: u64) -> io::Result<Option<Vec<u8>>> {
    match read(path, most) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

impl Input {
    /// Size of the file in bytes.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.size
    }
}

impl Read for Input {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.size.saturating_sub(self.position);
        let most = usize::try_from(left).unwrap_or(usize::MAX).min(buffer.len());
        if most == 0 {
            return Ok(0);
        }
        let read = if self.faults.on_read()? { self.file.read(&mut buffer[..most])? } else { 0 };
        if read == 0 {
            return Err(io::Error::new(
                io::ErrorKind::UnexpectedEof,
                format!("the file ended after {} of {} bytes", self.position, self.size),
            ));
        }
        self.position += read as u64;
        Ok(read)
    }
}

impl Seek for Input {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        // Relative to the end that the file had when it was opened.
        let to = match to {
            SeekFrom::End(offset) => {
                let outside = || io::Error::new(io::ErrorKind::InvalidInput, "this lies before the file's start");
                SeekFrom::Start(self.size.checked_add_signed(offset).ok_or_else(outside)?)
            }
            other => other,
        };
        self.position = self.file.seek(to)?;
        Ok(self.position)
    }
}
