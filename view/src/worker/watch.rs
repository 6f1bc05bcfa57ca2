//! Detects changes of files.

use curitiba::pipeline::files;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Period of checking the files.
pub const PERIOD: Duration = Duration::from_millis(500);

/// Time and size of a file, which change when it is written; `None` if the file cannot be found.
type Stamp = Option<(SystemTime, u64)>;

fn stamp(path: &Path) -> Stamp {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.modified().ok()?, metadata.len()))
}

/// The files that were read, each as it was then.
#[derive(Debug, Default)]
pub struct Watch {
    files: Vec<(PathBuf, Stamp)>,
    /// Stamps of the files at the last check; `None` if no file had changed by then. A file that is still being written changes again.
    changing: Option<Vec<Stamp>>,
}

impl Watch {
    /// Remembers the files that were read so far, and the project.
    pub fn remember(&mut self, project: &Path) {
        let mut paths = files::read_so_far();
        paths.push(project.to_owned());
        self.files = paths.into_iter().map(|path| (path.clone(), stamp(&path))).collect();
        self.changing = None;
    }

    /// Checks all files. Returns whether any has changed since it was read and none has changed since the last check.
    pub fn changed(&mut self) -> bool {
        let now: Vec<Stamp> = self.files.iter().map(|(path, _)| stamp(path)).collect();
        let same = self.files.iter().zip(&now).all(|((_, then), now)| then == now);
        let settled = self.changing.as_ref() == Some(&now);
        self.changing = (!same).then_some(now);
        !same && settled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_told_once_it_has_settled() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("p.xml");
        std::fs::write(&path, "a").expect("written");
        let mut watch = Watch::default();
        watch.remember(&path);
        assert!(!watch.changed() && !watch.changed());
        std::fs::write(&path, "ab").expect("written");
        assert!(!watch.changed(), "it may still be written");
        std::fs::write(&path, "abc").expect("written");
        assert!(!watch.changed(), "it is still written");
        assert!(watch.changed());
        watch.remember(&path);
        assert!(!watch.changed() && !watch.changed());
    }
}
