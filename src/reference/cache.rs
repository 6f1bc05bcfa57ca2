//! The folder in which references are stored.

use crate::pipeline::files;
use crate::pipeline::image::{Image, Layer, read_image, write_exr};
use crate::pipeline::scene::fnv1a;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Largest JSON file of a reference, bytes.
const MOST_SIDECAR: u64 = 16 << 20;
/// Largest EXR file that is read, bytes: twice the size of four floats for each of 16384 x 16384 pixels, the most that [`read_image`] reads.
const MOST_EXR: u64 = 8 << 30;

/// A folder of EXR files. Each has a JSON file that describes it and contains a hash of its bytes.
#[derive(Debug, Clone)]
pub(super) struct Folder(PathBuf);

/// A stored reference.
#[derive(Debug)]
pub(super) struct Entry {
    pub picture: Image,
    pub own_error: f64,
    pub took: Duration,
}

#[derive(Serialize, Deserialize)]
struct Sidecar {
    /// Everything that determines the picture; its hash is the file's name.
    material: Vec<String>,
    /// Estimated root mean square error of the picture.
    own_error: f64,
    /// Time of rendering, seconds.
    seconds: f64,
    /// Hash of the EXR file.
    exr: String,
}

impl Folder {
    pub fn new(path: PathBuf) -> Self {
        Self(path)
    }

    /// Whether the folder lies where this process may read.
    pub fn is_allowed(&self) -> bool {
        files::check_place(&self.0).is_ok()
    }

    /// Whether the folder is empty or missing.
    pub fn is_empty(&self) -> bool {
        std::fs::read_dir(&self.0).map_or(true, |mut files| files.next().is_none())
    }

    /// The file name of a reference.
    pub fn key(material: &str) -> String {
        format!("{:032x}", fnv1a(material.as_bytes()))
    }

    pub fn files(&self, material: &str) -> (PathBuf, PathBuf) {
        let key = Self::key(material);
        (self.0.join(format!("{key}.exr")), self.0.join(format!("{key}.json")))
    }

    /// Whether a reference exists and was completely written.
    pub fn has(&self, material: &str) -> bool {
        self.files(material).1.exists()
    }

    /// A reference of this size, if there is one. The error says why an existing one is not trusted.
    pub fn load(&self, material: &str, size: [u32; 2]) -> Result<Option<Entry>, String> {
        let (exr, json) = self.files(material);
        // The JSON file is written last: without it there is no reference, or only the rest of an interrupted run.
        let text = files::read_if_there(&json, MOST_SIDECAR).map_err(|error| damaged(&json, error))?;
        let Some(text) = text else { return Ok(None) };
        let sidecar: Sidecar = serde_json::from_slice(&text).map_err(|error| damaged(&json, error))?;
        if sidecar.material.join("\n") != material {
            return Err(damaged(&json, "it is of another reference"));
        }
        if !(sidecar.own_error.is_finite() && sidecar.own_error >= 0.0) {
            return Err(damaged(&json, "its error is not a number"));
        }
        let took = Duration::try_from_secs_f64(sidecar.seconds).map_err(|error| damaged(&json, error))?;
        let bytes = files::read(&exr, MOST_EXR).map_err(|error| damaged(&exr, error))?;
        if format!("{:032x}", fnv1a(&bytes)) != sidecar.exr {
            return Err(damaged(&exr, "its bytes are not those that were written"));
        }
        let picture = read_image(&exr).map_err(|error| damaged(&exr, error.message))?.image;
        if [picture.width, picture.height] != size {
            return Err(damaged(&exr, "it has another size"));
        }
        Ok(Some(Entry { picture, own_error: sidecar.own_error, took }))
    }

    /// Stores a reference.
    pub fn store(&self, material: &str, entry: &Entry) -> Result<(), String> {
        let (exr, json) = self.files(material);
        let wrong =
            |error: &dyn std::fmt::Display| format!("the reference cannot be kept in {}: {error}", self.0.display());
        files::create_folder(&self.0).map_err(|error| wrong(&error))?;
        let layer = Layer { name: "reference", channels: ["R", "G", "B", "A"], image: &entry.picture };
        write_exr(&exr, layer).map_err(|error| wrong(&error))?;
        let bytes = files::read(&exr, MOST_EXR).map_err(|error| wrong(&error))?;
        let sidecar = Sidecar {
            material: material.split('\n').map(str::to_owned).collect(),
            own_error: entry.own_error,
            seconds: entry.took.as_secs_f64(),
            exr: format!("{:032x}", fnv1a(&bytes)),
        };
        let text = serde_json::to_string_pretty(&sidecar).map_err(|error| wrong(&error))?;
        files::write_atomically(&json, text.as_bytes()).map_err(|error| wrong(&error))
    }

    /// Removes a reference or block that is no longer needed. A failure is ignored, since the files do no harm.
    pub fn forget(&self, material: &str) {
        let (exr, json) = self.files(material);
        let _ = std::fs::remove_file(json);
        let _ = std::fs::remove_file(exr);
    }
}

fn damaged(path: &Path, why: impl std::fmt::Display) -> String {
    format!("the cached reference {} cannot be used: {why}", path.display())
}
