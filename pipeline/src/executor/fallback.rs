//! Ray backends that stand in where one fails, if the user allowed it.

use super::{Engines, Observer, RenderError, Renderer};
use crate::backend::{BackendError, Rasteriser, RayBackend};
use crate::plan::Work;
use crate::project::PassKind;
use serde::Serialize;
use std::collections::VecDeque;
use std::fmt;

/// Makes a ray backend.
type Make = Box<dyn FnOnce() -> Result<Box<dyn RayBackend>, BackendError>>;

/// A ray backend that is made when it is needed: the first, or one that stands in for another.
pub struct Spare {
    name: &'static str,
    make: Make,
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

impl Renderer {
    /// Every ray backend that failed so far, and what was tried in its place.
    #[must_use]
    pub fn fallbacks(&self) -> &[Fallback] {
        &self.engines.fallbacks
    }

    /// Tells of the backends that could not be made, now that the plan knows for which pass.
    pub(super) fn tell_of_fallbacks(&mut self, observer: &mut dyn Observer) {
        let mut passes = self.plan.passes.iter().map(|planned| self.plan.pass(planned));
        let pass = passes.find(|pass| matches!(pass.kind, PassKind::Ray(_))).map(|pass| pass.name.clone());
        for fallback in &mut self.engines.fallbacks {
            fallback.pass.clone_from(&pass);
            observer.fell_back(fallback);
        }
    }

    /// After a failure of the ray backend: the next one that can be made and runs every pass takes its place, with nothing
    /// built yet.
    ///
    /// # Errors
    /// The failure, if no other is left: the user allowed none, or all have failed.
    pub(super) fn stand_in(
        &mut self,
        pass: &str,
        error: BackendError,
        observer: &mut dyn Observer,
    ) -> Result<(), RenderError> {
        let (mut failed, mut error) = (self.engines.rays.name(), error);
        let frame = (self.frame > 0).then_some(self.frame);
        loop {
            self.engines.spares.retain(|spare| spare.name != failed);
            let Some(spare) = self.engines.spares.pop_front() else {
                return Err(RenderError::Pass { pass: pass.to_owned(), frame, error });
            };
            let fallback = Fallback {
                pass: Some(pass.to_owned()),
                frame,
                failed: failed.to_owned(),
                why: error.to_string(),
                instead: spare.name.to_owned(),
            };
            observer.fell_back(&fallback);
            self.engines.fallbacks.push(fallback);
            failed = spare.name;
            error = match (spare.make)() {
                Ok(rays) => {
                    self.engines.rays = rays;
                    self.built = None;
                    self.joined = None;
                    match self.unsupported() {
                        None => return Ok(()),
                        Some((_, error)) => error,
                    }
                }
                Err(error) => error,
            };
        }
    }

    /// The first pass that the ray backend does not run, with its reason; what glass takes counts once the scenes are loaded.
    pub(super) fn unsupported(&self) -> Option<(String, BackendError)> {
        self.plan.passes.iter().enumerate().find_map(|(index, planned)| {
            let pass = self.plan.pass(planned);
            let (PassKind::Ray(ray), Work::Rays { params, .. }) = (&pass.kind, &planned.work) else { return None };
            let rays = &self.engines.rays;
            let shows_glass = self.materials.get(index).is_some_and(|materials| materials.glass.contains(&true));
            let glass = || if shows_glass { rays.supports_glass(ray.program, params) } else { Ok(()) };
            let error = rays.supports(ray.program, self.plan.settings.fidelity).and_then(|()| glass()).err()?;
            Some((pass.name.clone(), error))
        })
    }
}
