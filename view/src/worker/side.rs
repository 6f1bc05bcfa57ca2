//! The two sides of a comparison, with the same choices for each.

use super::picture::Picture;
use curitiba::pipeline::executor::StepKind;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::path::PathBuf;
use std::sync::Arc;

/// A side of a comparison.
#[derive(Debug, Clone)]
pub enum Side {
    /// A picture of the project, rendered with its present settings.
    Rendered {
        /// Which picture.
        what: What,
        /// The engines.
        on: On,
    },
    /// A picture from a file.
    File(PathBuf),
    /// A picture that was kept.
    Kept(Arc<Picture>),
    /// The result, rendered from the camera in `f64`: the stored reference of `curitiba reference`, or one that is rendered now.
    Reference,
}

/// A picture of the project.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum What {
    /// The output that is hovered or pinned; the result if there is none.
    Shown,
    /// The result.
    Result,
    /// An output, by its full name.
    Output(String),
}

/// Engines of a side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum On {
    /// The window's engines.
    #[default]
    Here,
    /// The window's engines with another rasteriser.
    Raster(RasterChoice),
    /// The window's engines with another ray backend, for all passes.
    Rays(BackendChoice),
}

impl PartialEq for Side {
    /// Kept pictures are equal if they are the same object; pixels are not compared.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Rendered { what, on }, Self::Rendered { what: other, on: also }) => (what, on) == (other, also),
            (Self::File(path), Self::File(other)) => path == other,
            (Self::Kept(picture), Self::Kept(other)) => Arc::ptr_eq(picture, other),
            (Self::Reference, Self::Reference) => true,
            _ => false,
        }
    }
}

impl Side {
    /// The shown picture, by the window's engines.
    pub const SHOWN: Self = Self::Rendered { what: What::Shown, on: On::Here };

    /// A picture of the project by the window's engines.
    #[must_use]
    pub fn here(what: What) -> Self {
        Self::Rendered { what, on: On::Here }
    }

    /// Whether a renderer other than the window's has to make this side.
    #[must_use]
    pub fn is_far(&self) -> bool {
        matches!(self, Self::Reference | Self::Rendered { on: On::Raster(_) | On::Rays(_), .. })
    }

    /// Its name in the window, without its engines.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Rendered { what, .. } => what.name().to_owned(),
            Self::File(path) => {
                path.file_name().map_or_else(|| path.display().to_string(), |name| name.display().to_string())
            }
            Self::Kept(picture) => format!("{}, kept", picture.name),
            Self::Reference => "reference in f64".to_owned(),
        }
    }
}

impl What {
    /// Its name in the window.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Shown => "what is shown",
            Self::Result => "result",
            Self::Output(name) => name,
        }
    }
}

impl On {
    /// Its name in the window.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Here => "as here".to_owned(),
            Self::Raster(raster) => format!("raster {}", raster.name()),
            Self::Rays(backend) => format!("rays {}", backend.name()),
        }
    }

    /// The side's choice of engines, given the window's choice.
    pub(super) fn choice(self, here: Choice) -> Choice {
        match self {
            Self::Here => here,
            Self::Raster(raster) => Choice { raster, ..here },
            Self::Rays(backend) => here.traced_by(backend),
        }
    }
}

/// A side with its picture, or the reason why there is none.
#[derive(Debug, Clone, Default)]
pub struct Obtained {
    /// The picture, once it exists.
    pub picture: Option<Arc<Picture>>,
    /// Times of one frame of the picture; `None` if no frame was timed.
    pub times: Option<Times>,
    /// Why there is no picture; `None` also before the side is obtained.
    pub missing: Option<String>,
}

impl Obtained {
    pub(super) fn missing(why: impl Into<String>) -> Self {
        Self { missing: Some(why.into()), ..Self::default() }
    }
}

/// Host time of a frame's steps by kind, milliseconds, in the order in which kinds first occur in the frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Times(pub Vec<(StepKind, f64)>);

impl Times {
    pub(super) fn add(&mut self, kind: StepKind, ms: f64) {
        match self.0.iter_mut().find(|(other, _)| *other == kind) {
            Some((_, sum)) => *sum += ms,
            None => self.0.push((kind, ms)),
        }
    }

    /// Host time of the whole frame.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.0.iter().map(|(_, ms)| ms).sum()
    }

    /// Host time of the steps of a kind; `None` if there are none.
    #[must_use]
    pub fn of(&self, kind: StepKind) -> Option<f64> {
        self.0.iter().find(|(other, _)| *other == kind).map(|(_, ms)| *ms)
    }
}
