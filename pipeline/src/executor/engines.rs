//! What does the work: a rasteriser, a ray backend, and those that stand in for it.

use crate::backend::{BackendError, Limits, Rasteriser, RayBackend};
use crate::plan::Plan;
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

/// Makes the ray backend of a name, for passes that name one of their own.
type MakeNamed = Box<dyn FnMut(&str) -> Result<Box<dyn RayBackend>, BackendError>>;

/// A ray backend of some passes, in the place of that of all.
struct OwnRays {
    /// By which name the passes ask for it.
    asked: String,
    passes: Vec<String>,
    rays: Box<dyn RayBackend>,
}

/// What does the work.
pub struct Engines {
    /// Draws triangles.
    pub raster: Box<dyn Rasteriser>,
    /// Traces rays, of all passes that name no other backend.
    pub rays: Box<dyn RayBackend>,
    /// Ray backends of single passes.
    own: Vec<OwnRays>,
    /// Makes them.
    make_named: Option<MakeNamed>,
    /// What stands in where the ray backend fails, in this order; empty unless the user allowed it.
    pub spares: VecDeque<Spare>,
    /// Ray backends that failed so far.
    pub fallbacks: Vec<Fallback>,
}

impl Engines {
    /// A rasteriser and a ray backend that nothing stands in for.
    #[must_use]
    pub fn new(raster: Box<dyn Rasteriser>, rays: Box<dyn RayBackend>) -> Self {
        Self { raster, rays, own: Vec::new(), make_named: None, spares: VecDeque::new(), fallbacks: Vec::new() }
    }

    /// Lets passes have a ray backend of their own ([`Plan::backend_of`]): `make` is given its name, once for all passes that ask
    /// for it.
    #[must_use]
    pub fn with_own(self, make: impl FnMut(&str) -> Result<Box<dyn RayBackend>, BackendError> + 'static) -> Self {
        Self { make_named: Some(Box::new(make)), ..self }
    }

    /// The ray backend of a pass.
    #[must_use]
    pub fn rays_of(&self, pass: &str) -> &dyn RayBackend {
        let own = self.own.iter().find(|own| own.passes.iter().any(|name| name == pass));
        own.map_or(&*self.rays, |own| &*own.rays)
    }

    /// The same, to work with.
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

    /// Of the ray backends that trace for a plan, in a scene set if one is named, the first pass of each.
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

    /// The limits of the ray backends of a plan: of the first that traces whole pictures only, else of the first.
    #[must_use]
    pub fn ray_limits(&self, plan: &Plan) -> (&'static str, Limits) {
        let firsts = self.first_traced(plan, None);
        let mut all = firsts.iter().map(|pass| self.rays_of(pass)).map(|rays| (rays.name(), rays.limits()));
        let first = all.clone().next().unwrap_or((self.rays.name(), self.rays.limits()));
        all.find(|(_, limits)| !limits.parts).unwrap_or(first)
    }

    /// Makes the ray backends that passes of a plan name and that are not there, and drops those that none names any more. Returns
    /// whether any pass has another one than before.
    ///
    /// # Errors
    /// If one cannot be made; with the first pass that asks for it. Nothing is changed then.
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
