//! Writing whole files.

use super::target::Target;
use super::temporary::TemporaryFile;
use super::{confine, fault};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

/// A file that is written whole or not at all. The bytes go to a temporary file in the same folder, which is renamed by
/// [`Self::commit`] once all of it is on the disk. Dropped before that, it leaves everything as it was.
///
/// The new file takes the mode of the file that it replaces. If the path is a symbolic link, the link stays and its target is
/// replaced.
#[derive(Debug)]
pub struct Replacement {
    target: Target,
    temporary: TemporaryFile,
    faults: fault::Watch,
}

impl Replacement {
    /// Makes the temporary file.
    ///
    /// # Errors
    /// If the folder is missing or cannot be written, or `path` is a folder, a pipe or a device or lies outside the folder
    /// of [`confine`](super::confine).
    pub fn begin(path: &Path) -> io::Result<Self> {
        let target = Target::of(path)?;
        let mut faults = fault::watch(&target.path);
        faults.on_write()?;
        let temporary = TemporaryFile::new(&target.folder)?;
        target.keep_mode(temporary.file())?;
        Ok(Self { target, temporary, faults })
    }

    /// Puts the file in its place: synchronised to disk, renamed, and the folder synchronised.
    ///
    /// # Errors
    /// Whatever the file system reports. The old file, if any, is then unchanged, unless only the sync of the folder failed.
    pub fn commit(mut self) -> io::Result<()> {
        self.target.replace_with(self.temporary, &mut self.faults, TemporaryFile::file, TemporaryFile::rename)
    }
}

impl Write for Replacement {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.faults.on_write()?;
        self.temporary.file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.temporary.file().flush()
    }
}

impl Seek for Replacement {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.temporary.file().seek(to)
    }
}

/// Writes a file whole or not at all; see [`Replacement`].
///
/// # Errors
/// As [`Replacement::begin`] and [`Replacement::commit`]; no temporary file is left behind.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = Replacement::begin(path)?;
    file.write_all(bytes)?;
    file.commit()
}

/// Makes a folder, and the missing folders above it.
///
/// # Errors
/// Whatever the file system reports, or if it lies outside the folder of [`confine`](super::confine).
pub fn create_folder(path: &Path) -> io::Result<()> {
    confine::check_place(path)?;
    fault::watch(path).on_write()?;
    std::fs::create_dir_all(path)
}
