//! Writing whole files.

use super::target::Target;
use super::temporary::{TemporaryFile, sync_folder};
use super::{confine, fault};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

/// A file that is written in place of another, or anew: into a temporary file in the same folder, which takes the name
/// when all of it is on the disk. Dropped before that, it leaves everything as it was.
///
/// The new file has the mode of the one that it replaces. A symbolic link stays one: the file that it leads to is replaced.
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
        if let Some(permissions) = &target.permissions {
            temporary.file().set_permissions(permissions.clone())?;
        }
        Ok(Self { target, temporary, faults })
    }

    /// Puts the file in its place: synchronised to disk, renamed, and the folder synchronised.
    ///
    /// # Errors
    /// Whatever the file system reports; then the old file, if any, is still there, unless only the last step failed.
    pub fn commit(mut self) -> io::Result<()> {
        self.faults.on_write()?;
        self.temporary.file().sync_all()?;
        self.faults.on_write()?;
        self.temporary.rename(&self.target.path)?;
        sync_folder(&self.target.folder)
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
/// Whatever the file system reports; nothing is left behind.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = Replacement::begin(path)?;
    file.write_all(bytes)?;
    file.commit()
}

/// Makes a folder and those above it that are missing.
///
/// # Errors
/// Whatever the file system reports, or if it lies outside the folder of [`confine`](super::confine).
pub fn create_folder(path: &Path) -> io::Result<()> {
    confine::check_place(path)?;
    fault::watch(path).on_write()?;
    std::fs::create_dir_all(path)
}
