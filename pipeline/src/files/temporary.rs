//! Temporary files and folders, and what is left of them.
//!
//! All that exist are listed, so that [`abandon`] can remove them. Each is locked as long as its program lives: one that
//! nobody holds locked was left by a program that was killed, and is removed when its folder is next written into.

use super::confine;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::{NamedTempFile, TempDir};

/// What the name of a temporary file or folder starts with.
const PREFIX: &str = ".curitiba-";
/// What it ends with.
const SUFFIX: &str = ".part";
/// Random letters and digits between the two.
const RANDOM: usize = 8;
/// Entries of a folder that are looked at for what killed programs left.
const MOST_ENTRIES: usize = 100_000;
/// How often a lock is tried for: another program may be looking whether the new file is an abandoned one.
const TRIES: usize = 100;

/// What exists now, and the folders that were searched for what killed programs left.
#[derive(Debug, Default)]
struct Known {
    temporaries: BTreeSet<PathBuf>,
    searched: BTreeSet<PathBuf>,
}

static KNOWN: Mutex<Known> = Mutex::new(Known { temporaries: BTreeSet::new(), searched: BTreeSet::new() });

/// While this is held no temporary file or folder is made, renamed or removed.
fn known() -> MutexGuard<'static, Known> {
    KNOWN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A locked temporary file.
#[derive(Debug)]
pub(super) struct TemporaryFile {
    /// `None` once it is renamed.
    file: Option<NamedTempFile>,
    path: PathBuf,
}

impl TemporaryFile {
    /// Makes one in `folder`, which is free of symbolic links.
    pub fn new(folder: &Path) -> io::Result<Self> {
        let mut known = known();
        search(folder, &mut known);
        for _ in 0..TRIES {
            let mut builder = tempfile::Builder::new();
            builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt as _;
                // As `File::create` would: temporary files are private otherwise. The umask still applies.
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

    /// The file.
    pub fn file(&self) -> &File {
        // Only `rename`, which consumes this, takes it out.
        self.file.as_ref().map(NamedTempFile::as_file).expect("the file is there until it is renamed")
    }

    /// Gives it its name; a file of that name is replaced.
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

/// The name of a temporary file means nothing to anybody.
fn without_path(error: io::Error) -> io::Error {
    let text = error.to_string();
    match text.split_once(" at path ") {
        Some((reason, _)) => io::Error::new(error.kind(), reason.to_owned()),
        None => error,
    }
}

/// Locks a new temporary file or folder; `false` if another program took it for an abandoned one and removed it.
fn lock(file: &File, path: &Path) -> bool {
    // Where the file system has no locks nobody else can lock it either, and it is never taken for an abandoned one.
    let _ = file.lock();
    path.exists()
}

/// A folder that is filled under a temporary name, beside the place that it will have. Dropped, it vanishes with all that
/// it holds.
#[derive(Debug)]
pub struct TemporaryFolder {
    folder: Option<TempDir>,
    path: PathBuf,
    /// Holds the lock.
    _lock: Option<File>,
}

impl TemporaryFolder {
    /// Makes one in `parent`, which only the user may enter.
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
            // Folders cannot be opened, and so not be locked, on every system.
            let held = File::open(folder.path()).ok();
            if held.as_ref().is_none_or(|held| lock(held, folder.path())) {
                let path = folder.path().to_owned();
                known.temporaries.insert(path.clone());
                return Ok(Self { folder: Some(folder), path, _lock: held });
            }
        }
        Err(io::Error::other("other programs remove each temporary folder"))
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives it its name, in the place of a folder of that name. Where the system can exchange two folders in one step, one
    /// of the two is there at every moment; elsewhere the old one is first renamed, and put back if the second step fails.
    ///
    /// # Errors
    /// Whatever the file system reports; then the old folder is still there.
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
                // The name is gone, so there is nothing to remove.
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
        // What was there before has the temporary name now, and goes when this is dropped.
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

/// Exchanges two folders in one step; `false` where the system or the file system cannot.
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

/// Sees to it that the names of a folder's files are on the disk. Not every system can do that, or has to.
pub(super) fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        // A folder that may be written and not read, and file systems without this.
        Err(error) if matches!(error.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::InvalidInput) => Ok(()),
        result => result,
    }
}

/// Removes what killed programs left in a folder, once in the life of the process. What cannot be removed harms nobody.
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

/// Whether a name is one of those that this module makes.
fn is_temporary(name: &OsStr) -> bool {
    let random = name.to_str().and_then(|name| name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX));
    random.is_some_and(|random| random.len() == RANDOM && random.bytes().all(|byte| byte.is_ascii_alphanumeric()))
}

/// Removes all temporary files and folders of this process, and lets it make no more and rename none: for the last moment
/// before a signal ends it. Threads that write wait from here on.
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
