//! The two sides of a comparison: each is chosen from the same things.

use super::picture::Picture;
use curitiba::pipeline::executor::StepKind;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::path::PathBuf;
use std::sync::Arc;

/// A side of a comparison.
#[derive(Debug, Clone)]
pub enum Side {
    /// A picture of the project with its present settings.
    Rendered {
        /// Which one.
        what: What,
        /// By which engines.
        on: On,
    },
    /// A picture of a file.
    File(PathBuf),
    /// A picture as it was at a moment.
    Kept(Arc<Picture>),
    /// The result from the camera in `f64`: the stored one of `curitiba reference`, or one that is rendered.
    Reference,
}

/// A picture of the project.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum What {
    /// The output that is hovered or pinned; the result where none is.
    Shown,
    /// The result.
    Result,
    /// An output, by its full name.
    Output(String),
}

/// Engines of a side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum On {
    /// Those of the window.
    #[default]
    Here,
    /// The same with another rasteriser.
    Raster(RasterChoice),
    /// The same with another ray backend, for all passes.
    Rays(BackendChoice),
}

impl PartialEq for Side {
    /// Kept pictures are equal if they are one: their pixels are not looked at.
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
    /// What is looked at, by the window's engines.
    pub const SHOWN: Self = Self::Rendered { what: What::Shown, on: On::Here };

    /// The picture of a pass, or of the result, by the window's engines.
    #[must_use]
    pub fn here(what: What) -> Self {
        Self::Rendered { what, on: On::Here }
    }

    /// Whether another renderer makes it.
    #[must_use]
    pub fn is_far(&self) -> bool {
        matches!(self, Self::Reference | Self::Rendered { on: On::Raster(_) | On::Rays(_), .. })
    }

    /// What the window calls it without its engines.
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
    /// What the window calls it.
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
    /// What the window calls it.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Here => "as here".to_owned(),
            Self::Raster(raster) => format!("raster {}", raster.name()),
            Self::Rays(backend) => format!("rays {}", backend.name()),
        }
    }

    /// The choice of engines, given the window's.
    pub(super) fn choice(self, here: Choice) -> Choice {
        match self {
            Self::Here => here,
            Self::Raster(raster) => Choice { raster, ..here },
            Self::Rays(backend) => here.traced_by(backend),
        }
    }
}

/// A side as it is drawn.
#[derive(Debug, Clone, Default)]
pub struct Obtained {
    /// Its picture, once it is there.
    pub picture: Option<Arc<Picture>>,
    /// What a frame of it took; `None` for what no frame was timed of.
    pub times: Option<Times>,
    /// Why there is no picture.
    pub missing: Option<String>,
}

impl Obtained {
    pub(super) fn missing(why: impl Into<String>) -> Self {
        Self { missing: Some(why.into()), ..Self::default() }
    }
}

/// Host time of the steps of a frame by kind, milliseconds, in order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Times(pub Vec<(StepKind, f64)>);

impl Times {
    pub(super) fn add(&mut self, kind: StepKind, ms: f64) {
        match self.0.iter_mut().find(|(other, _)| *other == kind) {
            Some((_, sum)) => *sum += ms,
            None => self.0.push((kind, ms)),
        }
    }

    /// Of the whole frame.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.0.iter().map(|(_, ms)| ms).sum()
    }

    /// Of the steps of a kind; `None` where there is none.
    #[must_use]
    pub fn of(&self, kind: StepKind) -> Option<f64> {
        self.0.iter().find(|(other, _)| *other == kind).map(|(_, ms)| *ms)
    }
}
