//! What does the work: a rasteriser, a ray backend, and those that stand in for it.

use crate::backend::{BackendError, Rasteriser, RayBackend};
use serde::Serialize;
use std::collections::VecDeque;
use std::fmt;

/// Makes a ray backend.
type Make = Box<dyn FnOnce() -> Result<Box<dyn RayBackend>, BackendError>>;

/// A ray backend that is made when it is needed: the first, or one that stands in for another.
pub struct Spare {
    pub(super) name: &'static str,
    pub(super) make: Make,
}

impl Spare {
    /// `name` is what users call it; `make` is called at most once.
    #[must_use]
    pub fn new(name: &'static str, make: impl FnOnce() -> Result<Box<dyn RayBackend>, BackendError> + 'static) -> Self {
        Self { name, make: Box::new(make) }
    }
}

impl fmt::Debug for Spare {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Spare").field("name", &self.name).finish_non_exhaustive()
    }
}

/// A ray backend that failed, and what was tried in its place.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Fallback {
    /// The pass that it failed for; `None` where no pass of the plan traces rays.
    pub pass: Option<String>,
    /// The frame, counted from 1; `None` before the first, when backends are made and structures built.
    pub frame: Option<u32>,
    /// What failed: `cuda`.
    pub failed: String,
    /// Why.
    pub why: String,
    /// What goes on in its place: `cpu`.
    pub instead: String,
}

impl fmt::Display for Fallback {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.pass {
            Some(pass) => write!(f, "pass `{pass}`{}: ", of_frame(self.frame))?,
            None => write!(f, "rays: ")?,
        }
        write!(f, "{}; {} is not used again in this run, {} takes its place", self.why, self.failed, self.instead)
    }
}

/// ` of frame 3`, or nothing before the first.
pub(super) fn of_frame(frame: Option<u32>) -> String {
    frame.map_or(String::new(), |frame| format!(" of frame {frame}"))
}

/// What does the work.
pub struct Engines {
    /// Draws triangles.
    pub raster: Box<dyn Rasteriser>,
    /// Traces rays.
    pub rays: Box<dyn RayBackend>,
    /// What stands in where the ray backend fails, in this order; empty unless the user allowed it.
    pub spares: VecDeque<Spare>,
    /// Ray backends that failed so far.
    pub fallbacks: Vec<Fallback>,
}

impl Engines {
    /// A rasteriser and a ray backend that nothing stands in for.
    #[must_use]
    pub fn new(raster: Box<dyn Rasteriser>, rays: Box<dyn RayBackend>) -> Self {
        Self { raster, rays, spares: VecDeque::new(), fallbacks: Vec::new() }
    }

    /// A rasteriser and the first of some ray backends that can be made; those behind it stand in where it fails, each at
    /// most once. What could not be made is in [`Engines::fallbacks`].
    ///
    /// # Errors
    /// If none can be made: the last one's.
    ///
    /// # Panics
    /// If none is named.
    pub fn first_of(
        raster: Box<dyn Rasteriser>,
        backends: impl IntoIterator<Item = Spare>,
    ) -> Result<Self, BackendError> {
        let mut spares: VecDeque<Spare> = backends.into_iter().collect();
        let mut fallbacks = Vec::new();
        let mut spare = spares.pop_front().expect("at least one backend is named");
        loop {
            let failed = spare.name;
            let error = match (spare.make)() {
                Ok(rays) => return Ok(Self { raster, rays, spares, fallbacks }),
                Err(error) => error,
            };
            spares.retain(|other| other.name != failed);
            let Some(next) = spares.pop_front() else { return Err(error) };
            let (failed, why, instead) = (failed.to_owned(), error.to_string(), next.name.to_owned());
            fallbacks.push(Fallback { pass: None, frame: None, failed, why, instead });
            spare = next;
        }
    }
}
