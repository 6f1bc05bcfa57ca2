//! Files that grow over several runs of the program.

use super::fault;
use super::target::Target;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The paths of an output file that a killed run leaves unfinished and a later run continues. Until the output is complete, its
/// bytes are in a file beside it, whose name has `.part` appended. A journal, whose name has `.part.journal` appended, says how far
/// the run came. Neither of these two files may be a symbolic link.
///
/// As with [`Replacement`](super::Replacement), the new file takes the mode of the file that it replaces, and a symbolic link stays
/// while its target is replaced: `.part` and the journal then lie beside the target.
#[derive(Debug)]
pub struct Resumable {
    target: Target,
    part: PathBuf,
    journal: PathBuf,
}

impl Resumable {
    /// Finds the paths of the file, of `.part` and of the journal. No file is opened or made.
    ///
    /// # Errors
    /// If the folder is missing; if one of the three is a folder, a pipe or a device, or lies outside the folder of
    /// [`confine`](super::confine); if `.part` or the journal is a symbolic link.
    pub fn at(path: &Path) -> io::Result<Self> {
        let target = Target::of(path)?;
        let (part, journal) = (beside(&target, ".part")?, beside(&target, ".part.journal")?);
        Ok(Self { target, part, journal })
    }

    /// Path of the unfinished file.
    #[must_use]
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// Path of the journal.
    #[must_use]
    pub fn journal(&self) -> &Path {
        &self.journal
    }

    /// Whether a run left an unfinished file.
    #[must_use]
    pub fn is_begun(&self) -> bool {
        self.part.exists()
    }

    /// Opens the unfinished file and the journal, or makes them empty.
    ///
    /// # Errors
    /// Whatever the file system reports, with the path concerned.
    pub fn open(&self) -> Result<[Growing; 2], (PathBuf, io::Error)> {
        let open = |path: &Path| Growing::open(path).map_err(|error| (path.to_owned(), error));
        let part = open(&self.part)?;
        self.target.keep_mode(&part.file).map_err(|error| (self.part.clone(), error))?;
        Ok([part, open(&self.journal)?])
    }

    /// Puts the finished file in its place: synchronised to disk, renamed, and the folder synchronised. Then removes the journal.
    ///
    /// # Errors
    /// Whatever the file system reports. The unfinished file and the journal then stay, unless only the sync of the folder
    /// failed.
    pub fn commit(self, part: Growing) -> io::Result<()> {
        let Growing { file, path, mut faults } = part;
        self.target.replace_with(file, &mut faults, |file| file, |_, target| std::fs::rename(path, target))?;
        // A journal that remains is ignored if there is no `.part` file.
        let _ = std::fs::remove_file(self.journal);
        Ok(())
    }
}

/// The path of a file beside the target, which must not be a symbolic link.
fn beside(target: &Target, ending: &str) -> io::Result<PathBuf> {
    let mut path = target.path.clone().into_os_string();
    path.push(ending);
    let path = PathBuf::from(path);
    let found = Target::of(&path).and_then(|found| match found.path == path {
        true => Ok(()),
        false => Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "this is a symbolic link and not a regular file\n       delete the link, or name another output",
        )),
    });
    found.map_err(|error| io::Error::new(error.kind(), format!("its unfinished part {}: {error}", path.display())))?;
    Ok(path)
}

/// An open file of [`Resumable`].
#[derive(Debug)]
pub struct Growing {
    file: File,
    path: PathBuf,
    faults: fault::Watch,
}

impl Growing {
    fn open(path: &Path) -> io::Result<Self> {
        let mut faults = fault::watch(path);
        faults.on_open()?;
        faults.on_write()?;
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        Ok(Self { file, path: path.to_owned(), faults })
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Size of the file in bytes.
    ///
    /// # Errors
    /// Whatever the file system reports.
    pub fn size(&self) -> io::Result<u64> {
        self.file.metadata().map(|metadata| metadata.len())
    }

    /// Shortens the file to `size` bytes; what is written next follows them.
    ///
    /// # Errors
    /// Whatever the file system reports.
    pub fn shorten(&mut self, size: u64) -> io::Result<()> {
        self.faults.on_write()?;
        self.file.set_len(size)?;
        self.file.seek(SeekFrom::Start(size)).map(drop)
    }
}

impl Read for Growing {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.faults.on_read()? { self.file.read(buffer) } else { Ok(0) }
    }
}

impl Write for Growing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.faults.on_write()?;
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Growing {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
