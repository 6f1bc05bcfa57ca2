//! The folder of a report, which is written whole or not at all.

use super::page::GENERATOR;
use crate::pipeline::files::{self, TemporaryFolder, write_atomically};
use std::io;
use std::path::{Path, PathBuf};

/// Entries of a report's folder.
const ENTRIES: [&str; 6] = ["index.html", "data.json", "data.csv", "data.md", "pictures", "plots"];

/// Largest page that is read, bytes.
const MOST_PAGE: u64 = 64 << 20;

/// Why a report cannot be written to its place.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FolderError {
    /// The place holds something else.
    #[error("{path}: {why}; name another folder with -o, or remove this one first", path = path.display())]
    Occupied {
        /// The place.
        path: PathBuf,
        /// What is there.
        why: String,
    },
    /// The file system failed.
    #[error("{path}: {error}", path = path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
}

/// A report under construction in a temporary folder beside its target.
#[derive(Debug)]
pub struct Folder {
    target: PathBuf,
    staging: TemporaryFolder,
}

impl Folder {
    /// Checks that `target` is free, empty, or holds nothing but an earlier report, and makes the temporary folder.
    ///
    /// # Errors
    /// If `target` holds something else, or the folder beside it cannot be written.
    pub fn begin(target: &Path) -> Result<Self, FolderError> {
        check(target)?;
        let parent = target.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let staging =
            TemporaryFolder::new(parent).map_err(|error| FolderError::Io { path: parent.to_owned(), error })?;
        for sub in ["pictures", "plots"] {
            make(&staging.path().join(sub))?;
        }
        Ok(Self { target: target.to_owned(), staging })
    }

    /// The temporary folder that holds the files until the report is complete.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.staging.path()
    }

    /// A temporary folder on the same disk, for intermediate files.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn scratch(&self) -> io::Result<TemporaryFolder> {
        TemporaryFolder::new(self.path().parent().unwrap_or(Path::new(".")))
    }

    /// Writes a file of the report; `name` is relative, with `/`.
    ///
    /// # Errors
    /// If the file system fails.
    ///
    /// # Panics
    /// If the name does not belong to a report: the next report would refuse the folder as one with other contents.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), FolderError> {
        let entry = name.split('/').next().unwrap_or(name);
        assert!(ENTRIES.contains(&entry), "`{entry}` is no part of a report");
        let path = self.path().join(name);
        write_atomically(&path, bytes).map_err(|error| FolderError::Io { path, error })
    }

    /// Moves the complete report to its place. An earlier report there is replaced only once the new one is complete.
    ///
    /// # Errors
    /// If something else was written there in the meantime, or the file system fails.
    pub fn finish(self) -> Result<PathBuf, FolderError> {
        check(&self.target)?;
        let failed = |error| FolderError::Io { path: self.target.clone(), error };
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            // Temporary folders are private. The report gets the permissions of the one it replaces, or of any new folder of the user.
            let permissions = match std::fs::metadata(&self.target) {
                Ok(old) => old.permissions(),
                Err(_) => std::fs::Permissions::from_mode(0o755),
            };
            std::fs::set_permissions(self.staging.path(), permissions).map_err(failed)?;
        }
        self.staging.rename(&self.target).map_err(failed)?;
        Ok(self.target)
    }
}

fn make(path: &Path) -> Result<(), FolderError> {
    files::create_folder(path).map_err(|error| FolderError::Io { path: path.to_owned(), error })
}

/// Checks that `target` is free, empty, or holds nothing but an earlier report.
fn check(target: &Path) -> Result<(), FolderError> {
    let occupied = |why: String| Err(FolderError::Occupied { path: target.to_owned(), why });
    if target.file_name().is_none() {
        return occupied("only a folder that is named can be replaced as a whole".to_owned());
    }
    if !target.exists() {
        return Ok(());
    }
    if !target.is_dir() {
        return occupied("this is a file".to_owned());
    }
    let entries = std::fs::read_dir(target).map_err(|error| FolderError::Io { path: target.to_owned(), error })?;
    let mut names: Vec<String> =
        entries.filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned())).collect();
    if names.is_empty() {
        return Ok(());
    }
    names.sort();
    if let Some(other) = names.iter().find(|name| !ENTRIES.contains(&name.as_str())) {
        return occupied(format!("the folder holds `{other}`, which is no part of a report"));
    }
    let marker = format!("<meta name=\"generator\" content=\"{GENERATOR}\">");
    match files::read(&target.join("index.html"), MOST_PAGE) {
        Ok(page) if String::from_utf8_lossy(&page).contains(&marker) => Ok(()),
        _ => occupied("the folder is not empty and its index.html is not a report of this program".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(text: &str) -> String {
        format!("<html><meta name=\"generator\" content=\"{GENERATOR}\">{text}</html>")
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).expect("a folder");
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn a_report_replaces_an_older_one_only_when_it_is_complete() {
        let place = tempfile::tempdir().expect("a folder");
        let target = place.path().join("report");
        let first = Folder::begin(&target).expect("free");
        first.write("index.html", page("first").as_bytes()).expect("written");
        assert!(!target.exists());
        first.finish().expect("renamed");

        let second = Folder::begin(&target).expect("a report of ours");
        second.write("index.html", page("second").as_bytes()).expect("written");
        let read = || std::fs::read_to_string(target.join("index.html")).expect("a page");
        assert!(read().contains("first"));
        second.finish().expect("renamed");
        assert!(read().contains("second"));

        drop(Folder::begin(&target).expect("a report of ours"));
        assert!(read().contains("second"));
        assert_eq!(names(place.path()), ["report"], "nothing is left behind");
    }

    #[test]
    fn folders_and_files_of_others_are_refused_and_stay_as_they_are() {
        let place = tempfile::tempdir().expect("a folder");
        let holds = |name: &str, file: &str, text: &str| {
            let folder = place.path().join(name);
            std::fs::create_dir(&folder).expect("a folder");
            std::fs::write(folder.join(file), text).expect("a file");
            Folder::begin(&folder).map(drop).expect_err("occupied").to_string()
        };
        assert!(holds("photos", "cat.jpg", "x").contains("`cat.jpg`"));
        assert!(holds("site", "index.html", "<html>mine</html>").contains("not a report of this program"));
        let file = place.path().join("file");
        std::fs::write(&file, "x").expect("a file");
        assert!(Folder::begin(&file).expect_err("a file").to_string().contains("this is a file"));
        let empty = place.path().join("empty");
        std::fs::create_dir(&empty).expect("a folder");
        Folder::begin(&empty).expect("an empty folder is free");
        for nameless in ["", ".", ".."] {
            let error = Folder::begin(Path::new(nameless)).expect_err("it has no name").to_string();
            assert!(error.contains("is named"), "{error}");
        }
        let missing = place.path().join("no/such/place");
        assert!(matches!(Folder::begin(&missing), Err(FolderError::Io { .. })));
    }
}
