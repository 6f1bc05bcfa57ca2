//! The engines: a rasteriser, ray backends, and their fallbacks.

use crate::backend::{BackendError, Limits, Rasteriser, RayBackend};
use crate::plan::Plan;
use serde::Serialize;
use std::collections::VecDeque;
use std::fmt;

/// Constructor of a ray backend.
type Make = Box<dyn FnOnce() -> Result<Box<dyn RayBackend>, BackendError>>;

/// Name and constructor of a ray backend, which is made only when it is needed: as the first one, or as a fallback.
pub struct Spare {
    pub(super) name: &'static str,
    pub(super) make: Make,
}

impl Spare {
    /// `name` is the backend's name for users; `make` is called at most once.
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

/// A ray backend that failed, and its replacement.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Fallback {
    /// The pass for which it failed; `None` if no pass of the plan traces rays.
    pub pass: Option<String>,
    /// The frame, counted from 1; `None` before the first, when backends are made and structures built.
    pub frame: Option<u32>,
    /// Name of the failed backend, such as `cuda`.
    pub failed: String,
    /// Reason of the failure.
    pub why: String,
    /// Name of the backend that replaces it, such as `cpu`.
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

/// ` of frame 3`, or an empty string before the first frame.
pub(super) fn of_frame(frame: Option<u32>) -> String {
    frame.map_or(String::new(), |frame| format!(" of frame {frame}"))
}

/// Constructor of a ray backend by name, for passes that name their own.
type MakeNamed = Box<dyn FnMut(&str) -> Result<Box<dyn RayBackend>, BackendError>>;

/// A ray backend for some passes only, in place of the common one.
struct OwnRays {
    /// The backend's name in the settings of the passes.
    asked: String,
    passes: Vec<String>,
    rays: Box<dyn RayBackend>,
}

/// The rasteriser and the ray backends.
pub struct Engines {
    /// Draws triangles.
    pub raster: Box<dyn Rasteriser>,
    /// The common ray backend, for all passes that name no other.
    pub rays: Box<dyn RayBackend>,
    /// Ray backends of the passes that name their own.
    own: Vec<OwnRays>,
    /// Constructor of the ray backends in `own`, called with a backend's name; `None` if passes cannot have their own.
    make_named: Option<MakeNamed>,
    /// Fallbacks of the common ray backend, in order; empty unless the user allowed fallbacks.
    pub spares: VecDeque<Spare>,
    /// Ray backends that failed so far.
    pub fallbacks: Vec<Fallback>,
}

impl Engines {
    /// A rasteriser and a ray backend, without fallbacks.
    #[must_use]
    pub fn new(raster: Box<dyn Rasteriser>, rays: Box<dyn RayBackend>) -> Self {
        Self { raster, rays, own: Vec::new(), make_named: None, spares: VecDeque::new(), fallbacks: Vec::new() }
    }

    /// Allows passes to have their own ray backend ([`Plan::backend_of`]). `make` is called with the name of a backend, once for all passes
    /// that name it.
    #[must_use]
    pub fn with_own(self, make: impl FnMut(&str) -> Result<Box<dyn RayBackend>, BackendError> + 'static) -> Self {
        Self { make_named: Some(Box::new(make)), ..self }
    }

    /// The ray backend that a pass uses.
    #[must_use]
    pub fn rays_of(&self, pass: &str) -> &dyn RayBackend {
        let own = self.own.iter().find(|own| own.passes.iter().any(|name| name == pass));
        own.map_or(&*self.rays, |own| &*own.rays)
    }

    /// [`Self::rays_of`], mutable.
    pub(super) fn rays_of_mut(&mut self, pass: &str) -> &mut Box<dyn RayBackend> {
        let own = self.own.iter_mut().find(|own| own.passes.iter().any(|name| name == pass));
        own.map_or(&mut self.rays, |own| &mut own.rays)
    }

    /// Whether two passes share a ray backend.
    pub(super) fn is_shared(&self, one: &str, other: &str) -> bool {
        std::ptr::addr_eq(self.rays_of(one), self.rays_of(other))
    }

    /// Whether some passes have a ray backend of their own.
    #[must_use]
    pub fn differ(&self) -> bool {
        !self.own.is_empty()
    }

    /// For each ray backend that the plan uses, the name of the first pass that traces with it. If `set` is given, only passes that trace
    /// in this scene set count.
    pub(super) fn first_traced(&self, plan: &Plan, set: Option<usize>) -> Vec<String> {
        let mut firsts: Vec<String> = Vec::new();
        for planned in &plan.passes {
            let name = &plan.pass(planned).name;
            let traces = plan.traced(planned).is_some_and(|traced| set.is_none_or(|set| traced.scene_set == set));
            if traces && !firsts.iter().any(|first| self.is_shared(first, name)) {
                firsts.push(name.clone());
            }
        }
        firsts
    }

    /// Name and limits of the ray backend that restricts the plan most: the first that traces only whole pictures, otherwise the
    /// first.
    #[must_use]
    pub fn ray_limits(&self, plan: &Plan) -> (&'static str, Limits) {
        let firsts = self.first_traced(plan, None);
        let mut all = firsts.iter().map(|pass| self.rays_of(pass)).map(|rays| (rays.name(), rays.limits()));
        let first = all.clone().next().unwrap_or((self.rays.name(), self.rays.limits()));
        all.find(|(_, limits)| !limits.parts).unwrap_or(first)
    }

    /// Makes the ray backends that passes of the plan name and that do not exist yet, and drops those that no pass names any more.
    /// Returns whether the backend of any pass changed.
    ///
    /// # Errors
    /// If a backend cannot be made: the first pass that asks for it, and the error. Nothing is changed then.
    pub fn serve(&mut self, plan: &Plan) -> Result<bool, (String, BackendError)> {
        let mut wanted: Vec<(String, Vec<String>)> = Vec::new();
        for planned in &plan.passes {
            let pass = &plan.pass(planned).name;
            let Some(asked) = plan.backend_of(planned).filter(|asked| *asked != self.rays.name()) else { continue };
            match wanted.iter_mut().find(|(name, _)| name == asked) {
                Some((_, passes)) => passes.push(pass.clone()),
                None => wanted.push((asked.to_owned(), vec![pass.clone()])),
            }
        }
        let now = || self.own.iter().map(|own| (&own.asked, &own.passes));
        if wanted.iter().map(|(asked, passes)| (asked, passes)).eq(now()) {
            return Ok(false);
        }
        let mut made = Vec::new();
        for (asked, passes) in &wanted {
            if !self.own.iter().any(|own| own.asked == *asked) {
                let make = self.make_named.as_mut().ok_or_else(|| {
                    let message = "these engines were made without other ray backends for single passes".to_owned();
                    (passes[0].clone(), BackendError::Device { backend: self.rays.name(), message })
                })?;
                made.push((asked.clone(), make(asked).map_err(|error| (passes[0].clone(), error))?));
            }
        }
        let held = std::mem::take(&mut self.own).into_iter().map(|own| (own.asked, own.rays));
        let mut there: Vec<_> = held.chain(made).collect();
        for (asked, passes) in wanted {
            if let Some(index) = there.iter().position(|(name, _)| *name == asked) {
                self.own.push(OwnRays { passes, rays: there.swap_remove(index).1, asked });
            }
        }
        Ok(true)
    }

    /// A rasteriser and the first of the given ray backends that can be made. The ones after it become its fallbacks, each used at
    /// most once. Those that could not be made are listed in [`Engines::fallbacks`].
    ///
    /// # Errors
    /// If none can be made: the error of the last.
    ///
    /// # Panics
    /// If `backends` is empty.
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
                Ok(rays) => return Ok(Self { spares, fallbacks, ..Self::new(raster, rays) }),
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
