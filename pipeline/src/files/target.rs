//! Where an output file really lies, and whether it can be written.

use super::{confine, fault, temporary};
use std::fs::{File, OpenOptions, Permissions};
use std::io;
use std::path::{Path, PathBuf};

/// Greatest number of symbolic links that are followed, as on Linux.
const MOST_LINKS: usize = 40;

/// A file that is to be written.
#[derive(Debug)]
pub(super) struct Target {
    /// The file itself: no symbolic link.
    pub path: PathBuf,
    /// The folder that holds it, without symbolic links.
    pub folder: PathBuf,
    /// Permissions of the existing file; `None` if there is none.
    pub permissions: Option<Permissions>,
}

/// Why an output cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The file system reports an error.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
    /// Two outputs have the same path.
    #[error("{}: this file would be written twice, as {first} and as {second}\n       leave one of the two out, or name another file", path.display())]
    Twice {
        /// The file.
        path: PathBuf,
        /// Description of the first output.
        first: String,
        /// Description of the second output.
        second: String,
    },
    /// The output is also an input of the same run.
    #[error("{}: this file is read, and would be replaced\n       name another file", path.display())]
    Read {
        /// The file.
        path: PathBuf,
    },
}

impl Target {
    /// Resolves symbolic links, whether or not a file exists at their end.
    ///
    /// # Errors
    /// If the folder is missing, the target is a folder, a pipe or a device, or it lies outside the folder of
    /// [`confine`](super::confine).
    pub fn of(path: &Path) -> io::Result<Self> {
        let mut path = path.to_owned();
        for _ in 0..MOST_LINKS {
            let Some(name) = path.file_name().map(ToOwned::to_owned) else {
                return Err(io::Error::new(io::ErrorKind::IsADirectory, "this is a folder"));
            };
            let folder = existing_folder(&path)?;
            path = folder.join(name);
            let metadata = match std::fs::symlink_metadata(&path) {
                Ok(metadata) => Some(metadata),
                Err(error) if error.kind() == io::ErrorKind::NotFound => None,
                Err(error) => return Err(error),
            };
            match metadata {
                Some(metadata) if metadata.is_symlink() => path = folder.join(std::fs::read_link(&path)?),
                Some(metadata) if metadata.is_dir() => {
                    return Err(io::Error::new(io::ErrorKind::IsADirectory, "this is a folder"));
                }
                Some(metadata) if !metadata.is_file() => {
                    return Err(io::Error::new(io::ErrorKind::InvalidInput, "this is not a regular file"));
                }
                found => {
                    confine::check(&path)?;
                    return Ok(Self { path, folder, permissions: found.map(|found| found.permissions()) });
                }
            }
        }
        Err(io::Error::other("its symbolic links lead in a circle"))
    }

    /// Gives a new file the mode of the file that it is to replace.
    pub fn keep_mode(&self, new: &File) -> io::Result<()> {
        self.permissions.as_ref().map_or(Ok(()), |permissions| new.set_permissions(permissions.clone()))
    }

    /// Puts a new file of the same folder in the target's place: synchronised to disk, renamed, and the folder synchronised.
    /// `file` is the open file of `new`.
    ///
    /// # Errors
    /// Whatever the file system reports. The old file, if any, is then unchanged, unless only the sync of the folder failed.
    pub fn replace_with<New>(
        &self,
        new: New,
        faults: &mut fault::Watch,
        file: impl FnOnce(&New) -> &File,
        rename: impl FnOnce(New, &Path) -> io::Result<()>,
    ) -> io::Result<()> {
        faults.on_write()?;
        file(&new).sync_all()?;
        faults.on_write()?;
        rename(new, &self.path)?;
        temporary::sync_folder(&self.folder)
    }

    /// Fails if the file cannot be replaced or made. The test makes a temporary file in its folder and removes it.
    fn try_out(&self) -> io::Result<()> {
        if self.permissions.is_some() {
            // A read-only file is not replaced, although the permissions of its folder would allow it.
            OpenOptions::new().write(true).open(&self.path)?;
        }
        temporary::TemporaryFile::new(&self.folder)
            .map(drop)
            .map_err(|error| io::Error::new(error.kind(), format!("nothing can be written into its folder: {error}")))
    }
}

/// The folder of a path, without symbolic links.
fn existing_folder(path: &Path) -> io::Result<PathBuf> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let real = folder.canonicalize().map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => io::Error::new(error.kind(), format!("there is no folder {}", folder.display())),
        _ => error,
    })?;
    if !real.is_dir() {
        return Err(io::Error::new(io::ErrorKind::NotADirectory, format!("{} is not a folder", folder.display())));
    }
    Ok(real)
}

/// Checks before the work whether all outputs can be written. Each output is a path and a description. Its folder must exist and be
/// writable; the path must not be a folder, a pipe, a device or a read-only file; no two outputs may share a path; and no output
/// may be a file that was read since [`record_files_read`](super::record_files_read). Nothing is changed.
///
/// # Errors
/// The error of the first output that fails a check.
pub fn check_outputs<'a>(outputs: impl IntoIterator<Item = (&'a Path, &'a str)>) -> Result<(), OutputError> {
    let mut known: Vec<(PathBuf, &str)> = Vec::new();
    for (path, what) in outputs {
        let wrong = |error| OutputError::Io { path: path.to_owned(), error };
        let target = Target::of(path).map_err(wrong)?;
        if let Some((_, first)) = known.iter().find(|(real, _)| *real == target.path) {
            let (first, second) = ((*first).to_owned(), what.to_owned());
            return Err(OutputError::Twice { path: path.to_owned(), first, second });
        }
        if confine::was_read(&target.path) {
            return Err(OutputError::Read { path: path.to_owned() });
        }
        target.try_out().map_err(wrong)?;
        known.push((target.path, what));
    }
    Ok(())
}

/// Checks before the work whether files can be written into a folder that may not exist yet. Nothing is changed.
///
/// # Errors
/// If the folder, or its nearest existing ancestor, is no folder or cannot be written.
pub fn check_folder(path: &Path) -> Result<(), OutputError> {
    let wrong = |error| OutputError::Io { path: path.to_owned(), error };
    confine::check_place(path).map_err(wrong)?;
    let absolute = std::path::absolute(path).map_err(wrong)?;
    let Some(existing) = absolute.ancestors().find(|ancestor| ancestor.symlink_metadata().is_ok()) else {
        return Err(wrong(io::ErrorKind::NotFound.into()));
    };
    let real = existing.canonicalize().map_err(wrong)?;
    temporary::TemporaryFile::new(&real).map(drop).map_err(wrong)
}
