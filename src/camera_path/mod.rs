//! Camera paths: the pose of a camera in every frame of a sequence.
//!
//! The pose in a frame depends only on the path, the frame number and the camera's own pose. So a frame is the same whether it is rendered
//! alone, after others, or on another machine.
//!
//! | path | frame `k` |
//! |---|---|
//! | `orbit:CX,CY,CZ,R,N` | at distance R from C, looking at C, after `k / N` of a turn |
//! | a file of keyframes | positions by a Catmull-Rom spline, directions along great circles |
//!
//! The file is JSON: `{"keys": [{"frame": 0, "position": [0, 2, 9], "look_at": [0, 1, 0]}, …]}`. `frame` is a whole number, 0 for
//! the first key and increasing; the path ends with the last key. Each key has `direction` or `look_at`, and may have `fov`
//! (vertical, degrees); either all keys or none have `up`. Missing values are the camera's own. `camera` beside `keys` names the
//! camera that is moved.

mod curve;
mod keys;
mod orbit;
mod record;

pub use keys::Keyframes;
pub use orbit::Orbit;
pub use record::{FrameRecord, Origin, RecordError, mean_and_p99};

use crate::pipeline::files;
use crate::pipeline::project::Pose;
use std::path::Path;

/// Greatest number of frames of a path.
pub const MOST_FRAMES: u32 = 1_000_000;

/// Largest file of keyframes, bytes.
const MOST_BYTES: u64 = 16 << 20;

/// Why a path could not be opened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PathError {
    /// The argument that describes the path is wrong.
    #[error("{0}")]
    Named(String),
    /// The file is wrong, or cannot be read.
    #[error("{0}")]
    File(String),
}

/// The pose of a camera in every frame.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraPath {
    /// A circle around a point.
    Orbit(Orbit),
    /// A path through keyframes.
    Keys(Keyframes),
}

impl CameraPath {
    /// Opens `orbit:CX,CY,CZ,R,N`, or the file named `text`.
    ///
    /// # Errors
    /// What is wrong and where, with what would be valid.
    pub fn open(text: &str) -> Result<Self, PathError> {
        if let Some(numbers) = text.strip_prefix("orbit:") {
            return Orbit::parse(numbers).map(Self::Orbit).map_err(PathError::Named);
        }
        let wrong = |message: String| PathError::File(format!("{text}: {message}"));
        let bytes = files::read(Path::new(text), MOST_BYTES).map_err(|error| wrong(error.to_string()))?;
        Keyframes::parse(&bytes).map(Self::Keys).map_err(wrong)
    }

    /// Number of frames, 1 to [`MOST_FRAMES`].
    #[must_use]
    pub fn frames(&self) -> u32 {
        match self {
            Self::Orbit(orbit) => orbit.frames,
            Self::Keys(keys) => keys.frames(),
        }
    }

    /// The camera that the path moves, if it names one.
    #[must_use]
    pub fn camera(&self) -> Option<&str> {
        match self {
            Self::Orbit(_) => None,
            Self::Keys(keys) => keys.camera.as_deref(),
        }
    }

    /// The pose in a frame below [`Self::frames`]. `own` is the camera's pose without the path.
    #[must_use]
    pub fn pose(&self, frame: u32, own: Pose) -> Pose {
        match self {
            Self::Orbit(orbit) => orbit.pose(frame, own),
            Self::Keys(keys) => keys.pose(frame, own),
        }
    }
}
