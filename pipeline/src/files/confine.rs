//! The folder that all files must lie in, and the record of what was read.

use std::collections::BTreeSet;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// The folder of [`confine`]. Set once, before any file is read.
static FOLDER: OnceLock<PathBuf> = OnceLock::new();
/// The first file that was refused since [`refused`] was asked.
static REFUSED: Mutex<Option<PathBuf>> = Mutex::new(None);
/// Files that were read, while they are recorded.
static FILES_READ: Mutex<Option<BTreeSet<PathBuf>>> = Mutex::new(None);

/// From now on this process reads and writes no file outside `folder`, wherever symbolic links lead. This cannot be undone.
///
/// A path is resolved before its file is opened. Another program that can change folders inside `folder` could put a link in
/// between: the check guards against paths named in files, not against other programs.
///
/// # Errors
/// If `folder` is no folder, or another folder was named before.
pub fn confine(folder: &Path) -> io::Result<()> {
    let real = folder.canonicalize()?;
    if !real.is_dir() {
        return Err(io::Error::new(io::ErrorKind::NotADirectory, "this is not a folder"));
    }
    if *FOLDER.get_or_init(|| real.clone()) != real {
        return Err(io::Error::other("the process is confined to another folder already"));
    }
    Ok(())
}

/// The folder that [`confine`] named, without symbolic links.
#[must_use]
pub fn confined_to() -> Option<&'static Path> {
    FOLDER.get().map(PathBuf::as_path)
}

/// Takes the first file since the last call that was refused because it lies outside the folder of [`confine`]. Loaders skip some unreadable
/// files, such as textures; they call this before and afterwards, because a refused file must end the load that names it, and no other.
#[must_use]
pub fn refused() -> Option<PathBuf> {
    REFUSED.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Records a file that [`check`] kept from being read.
pub(super) fn note_refused(real: &Path) {
    REFUSED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| real.to_owned());
}

/// Fails if [`confine`] forbids to open a file. `real` is its path without symbolic links.
pub(super) fn check(real: &Path) -> io::Result<()> {
    match confined_to() {
        Some(folder) if !real.starts_with(folder) => {
            Err(io::Error::new(io::ErrorKind::PermissionDenied, refusal(real, folder)))
        }
        _ => Ok(()),
    }
}

/// Fails if [`confine`] forbids a path. The last components of the path need not exist.
///
/// # Errors
/// If the path lies outside the folder.
pub fn check_place(path: &Path) -> io::Result<()> {
    if confined_to().is_none() {
        return Ok(());
    }
    let absolute = std::path::absolute(path)?;
    let mut missing = PathBuf::new();
    for existing in absolute.ancestors() {
        if let Ok(real) = existing.canonicalize() {
            missing = absolute.strip_prefix(existing).map(Path::to_owned).unwrap_or(missing);
            if missing.components().any(|part| part == Component::ParentDir) {
                break;
            }
            return check(&real.join(missing));
        }
    }
    Err(io::Error::new(
        io::ErrorKind::NotFound,
        format!("`..` follows a missing folder, so --confine cannot tell where {} leads", path.display()),
    ))
}

/// The message about a refused file.
fn refusal(real: &Path, folder: &Path) -> String {
    format!("{} lies outside {}, which --confine names", real.display(), folder.display())
}

fn files_read() -> MutexGuard<'static, Option<BTreeSet<PathBuf>>> {
    FILES_READ.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins to record which files are read, for [`outside`].
pub fn record_files_read() {
    files_read().get_or_insert_default();
}

/// Whether real paths are needed: for [`confine`] or for the record of files read.
pub(super) fn asks_for_real_paths() -> bool {
    confined_to().is_some() || files_read().is_some()
}

/// Adds a file to the record of files read.
pub(super) fn note(real: &Path) {
    if let Some(files) = &mut *files_read() {
        files.insert(real.to_owned());
    }
}

/// Whether a file, named without symbolic links, was read since [`record_files_read`].
pub(super) fn was_read(real: &Path) -> bool {
    files_read().as_ref().is_some_and(|files| files.contains(real))
}

/// The files read since [`record_files_read`], symbolic links resolved, in the order of their paths.
#[must_use]
pub fn read_so_far() -> Vec<PathBuf> {
    files_read().iter().flatten().cloned().collect()
}

/// The files that lie outside `folder`, among `more` and the files read since [`record_files_read`]. Symbolic links are resolved;
/// the result is sorted by path.
#[must_use]
pub fn outside(folder: &Path, more: impl IntoIterator<Item = PathBuf>) -> Vec<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let mut files = files_read().clone().unwrap_or_default();
    files.extend(more.into_iter().filter_map(|path| path.canonicalize().ok()));
    files.retain(|path| !path.starts_with(&folder));
    files.into_iter().collect()
}
