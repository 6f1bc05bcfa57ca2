//! Temporary files and folders, and the removal of those that killed programs left.
//!
//! The process keeps a list of its temporaries, so that [`abandon`] can remove them. Each is locked while its program lives. A
//! temporary without a lock was left by a killed program and is removed when its folder is next written into.

use super::confine;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::{NamedTempFile, TempDir};

/// Start of the name of a temporary file or folder.
const PREFIX: &str = ".curitiba-";
/// End of the name of a temporary file or folder.
const SUFFIX: &str = ".part";
/// Number of random letters and digits between [`PREFIX`] and [`SUFFIX`].
const RANDOM: usize = 8;
/// Greatest number of entries of a folder that are searched for leftovers of killed programs.
const MOST_ENTRIES: usize = 100_000;
/// Attempts to make a temporary file: another program may take a new file for a leftover and remove it before it is locked.
const TRIES: usize = 100;

/// This process's temporary files and folders that exist now, and the folders that were searched for leftovers of killed programs.
#[derive(Debug, Default)]
struct Known {
    temporaries: BTreeSet<PathBuf>,
    searched: BTreeSet<PathBuf>,
}

static KNOWN: Mutex<Known> = Mutex::new(Known { temporaries: BTreeSet::new(), searched: BTreeSet::new() });

/// Locks the list. While the guard is held no temporary file or folder is made, renamed or removed.
fn known() -> MutexGuard<'static, Known> {
    KNOWN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A locked temporary file.
#[derive(Debug)]
pub(super) struct TemporaryFile {
    /// `None` once the file is renamed.
    file: Option<NamedTempFile>,
    path: PathBuf,
}

impl TemporaryFile {
    /// Makes a temporary file in `folder`, a path without symbolic links.
    pub fn new(folder: &Path) -> io::Result<Self> {
        let mut known = known();
        search(folder, &mut known);
        for _ in 0..TRIES {
            let mut builder = tempfile::Builder::new();
            builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt as _;
                // The mode of `File::create`; temporary files are private by default. The umask still applies.
                builder.permissions(std::fs::Permissions::from_mode(0o666));
            }
            let file = builder.tempfile_in(folder).map_err(without_path)?;
            if lock(file.as_file(), file.path()) {
                let path = file.path().to_owned();
                known.temporaries.insert(path.clone());
                return Ok(Self { file: Some(file), path });
            }
        }
        Err(io::Error::other("other programs remove each temporary file"))
    }

    /// The open file.
    pub fn file(&self) -> &File {
        // Only `rename`, which consumes this, takes it out.
        self.file.as_ref().map(NamedTempFile::as_file).expect("the file is there until it is renamed")
    }

    /// Renames the file to `to`, replacing a file of that name.
    pub fn rename(mut self, to: &Path) -> io::Result<()> {
        let mut known = known();
        let Some(file) = self.file.take() else { return Ok(()) };
        let result = file.persist(to).map(drop).map_err(|error| error.error);
        known.temporaries.remove(&self.path);
        result
    }
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        if let Some(file) = self.file.take() {
            let mut known = known();
            drop(file);
            known.temporaries.remove(&self.path);
        }
    }
}

/// Removes the temporary file's path from an error message: it means nothing to the user.
fn without_path(error: io::Error) -> io::Error {
    let text = error.to_string();
    match text.split_once(" at path ") {
        Some((reason, _)) => io::Error::new(error.kind(), reason.to_owned()),
        None => error,
    }
}

/// Locks a new temporary file or folder. Returns `false` if another program took it for a leftover and removed it.
fn lock(file: &File, path: &Path) -> bool {
    // Without file locks on this file system no other program gets the lock either, so none takes the file for a leftover.
    let _ = file.lock();
    path.exists()
}

/// A folder that is filled under a temporary name, beside its final place. Dropping it deletes it with its contents.
#[derive(Debug)]
pub struct TemporaryFolder {
    folder: Option<TempDir>,
    path: PathBuf,
    /// Open handle that holds the lock.
    _lock: Option<File>,
}

impl TemporaryFolder {
    /// Makes a temporary folder in `parent`; only the user may enter it.
    ///
    /// # Errors
    /// If `parent` is missing, cannot be written, or lies outside the folder of [`confine`](super::confine).
    pub fn new(parent: &Path) -> io::Result<Self> {
        let parent = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
        let parent = parent.canonicalize()?;
        confine::check(&parent)?;
        super::fault::watch(&parent.join(PREFIX)).on_write()?;
        let mut known = known();
        search(&parent, &mut known);
        for _ in 0..TRIES {
            let mut builder = tempfile::Builder::new();
            builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
            let folder = builder.tempdir_in(&parent).map_err(without_path)?;
            // Some systems cannot open folders; there the folder stays unlocked.
            let held = File::open(folder.path()).ok();
            if held.as_ref().is_none_or(|held| lock(held, folder.path())) {
                let path = folder.path().to_owned();
                known.temporaries.insert(path.clone());
                return Ok(Self { folder: Some(folder), path, _lock: held });
            }
        }
        Err(io::Error::other("other programs remove each temporary folder"))
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Renames the folder to `to`, replacing a folder of that name. Where the system can exchange two folders atomically, one of
    /// the two exists at `to` at every moment. Elsewhere the old folder is renamed first, and put back if the second step fails.
    ///
    /// # Errors
    /// Whatever the file system reports. The old folder is then still at `to`, unless the new one had already taken its place, or the old
    /// one could not be put back: it then has the extension `old`.
    pub fn rename(mut self, to: &Path) -> io::Result<()> {
        let parent = to.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let to = match to.file_name() {
            Some(name) => parent.canonicalize()?.join(name),
            None => to.canonicalize()?,
        };
        confine::check(&to)?;
        super::fault::watch(&to).on_write()?;
        sync_folder(&self.path)?;
        {
            let mut known = known();
            if !to.exists() {
                std::fs::rename(&self.path, &to)?;
                // The temporary name no longer exists, so there is nothing to remove.
                known.temporaries.remove(&self.path);
                if let Some(folder) = self.folder.take() {
                    let _ = folder.keep();
                }
            } else if !exchange(&self.path, &to)? {
                let aside = self.path.with_extension("old");
                std::fs::rename(&to, &aside)?;
                if let Err(error) = std::fs::rename(&self.path, &to) {
                    std::fs::rename(&aside, &to)?;
                    return Err(error);
                }
                std::fs::rename(&aside, &self.path)?;
            }
        }
        // The old folder has the temporary name now, and is removed when `self` is dropped.
        sync_folder(to.parent().unwrap_or(Path::new(".")))
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        if let Some(folder) = self.folder.take() {
            let mut known = known();
            drop(folder);
            known.temporaries.remove(&self.path);
        }
    }
}

/// Exchanges two folders atomically. Returns `false` where the system or the file system cannot.
#[cfg(any(target_os = "linux", target_os = "android", target_vendor = "apple"))]
fn exchange(one: &Path, other: &Path) -> io::Result<bool> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    use rustix::io::Errno;
    match renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE) {
        Ok(()) => Ok(true),
        Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

#[cfg(not(any(target_os = "linux", target_os = "android", target_vendor = "apple")))]
fn exchange(_: &Path, _: &Path) -> io::Result<bool> {
    Ok(false)
}

/// Flushes the directory entries of a folder to the disk. Not every system can do that, or needs it.
pub(super) fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        // Folders that may be written but not read, and file systems that cannot sync a folder.
        Err(error) if matches!(error.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::InvalidInput) => Ok(()),
        result => result,
    }
}

/// Removes leftovers of killed programs from a folder, once per process. Failures to remove are ignored.
fn search(folder: &Path, known: &mut Known) {
    if !known.searched.insert(folder.to_owned()) {
        return;
    }
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.take(MOST_ENTRIES).flatten() {
        let (path, Ok(kind)) = (entry.path(), entry.file_type()) else { continue };
        if !is_temporary(&entry.file_name()) || !(kind.is_file() || kind.is_dir()) || known.temporaries.contains(&path)
        {
            continue;
        }
        let Ok(file) = File::open(&path) else { continue };
        if file.try_lock().is_ok() {
            let _ = if kind.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
        }
    }
}

/// Whether a name has the form of this module's temporary names.
fn is_temporary(name: &OsStr) -> bool {
    let random = name.to_str().and_then(|name| name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX));
    random.is_some_and(|random| random.len() == RANDOM && random.bytes().all(|byte| byte.is_ascii_alphanumeric()))
}

/// Removes all temporary files and folders of this process, and blocks further ones: for the last moment before a signal ends the
/// process. The lock stays held, so threads that make or rename a temporary wait from here on.
pub fn abandon() {
    let known = known();
    for path in &known.temporaries {
        // Another thread may be copying a file into the folder at this moment.
        for _ in 0..3 {
            let _ = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
            if !path.exists() {
                break;
            }
        }
    }
    std::mem::forget(known);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nobody_holds_is_taken_for_abandoned() {
        let place = tempfile::tempdir().expect("a folder");
        let made = |name: &str| {
            let path = place.path().join(name);
            std::fs::write(&path, "x").expect("written");
            path
        };
        let abandoned = made(".curitiba-abandon1.part");
        let held = made(".curitiba-inuse111.part");
        let lock = File::open(&held).expect("there");
        lock.lock().expect("locked");
        let others =
            [".curitiba-notes.part", ".curitiba-abandon1.txt", "curitiba-abandon1.part", ".curitiba-aban.on1.part"];
        let others = others.map(made);
        let folder = place.path().join(".curitiba-abandon2.part");
        std::fs::create_dir(&folder).expect("a folder");
        std::fs::write(folder.join("x"), "x").expect("written");

        drop(TemporaryFile::new(place.path()).expect("a file"));
        assert!(!abandoned.exists() && !folder.exists());
        assert!(held.exists() && others.iter().all(|path| path.exists()));
    }
}
