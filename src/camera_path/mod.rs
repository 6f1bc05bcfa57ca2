//! Camera paths: where a camera stands in every frame of a sequence.
//!
//! A path is a function of the number of the frame and nothing else, so a frame is the same whether it is rendered alone, after others, or
//! on another machine.
//!
//! | path | frame `k` |
//! |---|---|
//! | `orbit:CX,CY,CZ,R,N` | on a circle of radius R around C, looking at C, at `k / N` of a turn |
//! | a file of keyframes | positions by a Catmull-Rom spline, directions along great circles |
//!
//! A file is JSON: `{"keys": [{"frame": 0, "position": [0, 2, 9], "look_at": [0, 1, 0]}, …]}`. `frame` is whole, 0 in the first key and more in
//! each that follows; the path ends with the last. Each key has `direction` or `look_at`, and may have `fov` (vertical, degrees); all keys
//! may have `up`. What they do not have is the camera's own. `camera` beside `keys` names the camera that is moved.

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

/// Most frames of a path.
pub const MOST_FRAMES: u32 = 1_000_000;

/// Largest file of keyframes, bytes.
const MOST_BYTES: u64 = 16 << 20;

/// Why there is no path.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PathError {
    /// What names it is wrong.
    #[error("{0}")]
    Named(String),
    /// The file is wrong, or cannot be read.
    #[error("{0}")]
    File(String),
}

/// Where a camera stands in every frame.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraPath {
    /// A circle.
    Orbit(Orbit),
    /// Keyframes.
    Keys(Keyframes),
}

impl CameraPath {
    /// Reads `orbit:CX,CY,CZ,R,N`, or the file that `text` names.
    ///
    /// # Errors
    /// What is wrong, where, and what would be valid.
    pub fn open(text: &str) -> Result<Self, PathError> {
        if let Some(numbers) = text.strip_prefix("orbit:") {
            return Orbit::parse(numbers).map(Self::Orbit).map_err(PathError::Named);
        }
        let wrong = |message: String| PathError::File(format!("{text}: {message}"));
        let bytes = files::read(Path::new(text), MOST_BYTES).map_err(|error| wrong(error.to_string()))?;
        Keyframes::parse(&bytes).map(Self::Keys).map_err(wrong)
    }

    /// How many frames it has, from 0: 1 to [`MOST_FRAMES`].
    #[must_use]
    pub fn frames(&self) -> u32 {
        match self {
            Self::Orbit(orbit) => orbit.frames,
            Self::Keys(keys) => keys.frames(),
        }
    }

    /// The camera that it moves, where it names one.
    #[must_use]
    pub fn camera(&self) -> Option<&str> {
        match self {
            Self::Orbit(_) => None,
            Self::Keys(keys) => keys.camera.as_deref(),
        }
    }

    /// Where the camera stands in a frame below [`Self::frames`]; `own` is where it stands without the path.
    #[must_use]
    pub fn pose(&self, frame: u32, own: Pose) -> Pose {
        match self {
            Self::Orbit(orbit) => orbit.pose(frame, own),
            Self::Keys(keys) => keys.pose(frame, own),
        }
    }
}
