//! Lights of passes: which lights shine, and which passes do not support several lights or positional ones.

use super::{Plan, PlanError, PlannedPass, Work};
use crate::backend::{BackendError, Cone, Light, RayBackend, Sun};
use crate::glass::GlassShadow;
use crate::image::PixelFormat;
use crate::programs::{Fidelity, RayParams, RayProgram};
use crate::project::{self, ChannelRef, PassKind, QuadSource};
use crate::raster_effects::EffectProgram;
use glam::Vec3;

/// Greatest number of lights that a message names.
const NAMED: usize = 4;

/// The lights that shine in a pass.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Shining {
    /// The light, if it is the only one that shines and is directional; otherwise `None`.
    pub sun: Option<Sun>,
    /// The lights, if they are several or one positional light; otherwise empty.
    pub lights: Vec<Light>,
}

/// What the lights of a pass shade.
#[derive(Clone, Copy)]
enum Shaded<'a> {
    /// What a rasteriser draws.
    Drawn,
    /// The result of rays from a G-buffer.
    Traced(RayProgram, &'a RayParams),
    /// The result of a raster effect on a G-buffer.
    Estimated(EffectProgram),
}

impl Plan {
    /// The lights with these indices, in the form that engines support. In thesis fidelity only the first directional light shines.
    #[must_use]
    pub fn shining(&self, lights: &[usize]) -> Shining {
        let of_project = |light: &usize| &self.project.lights[*light];
        let directional =
            |light: &project::Light| light.direction.map(|direction| Sun { direction, color: light.color });
        if self.settings.fidelity == Fidelity::Thesis {
            let sun = lights.iter().map(of_project).find_map(directional);
            return Shining { sun, lights: Vec::new() };
        }
        match self.are_many(lights) {
            true => Shining { sun: None, lights: lights.iter().map(|light| self.light(of_project(light))).collect() },
            false => Shining { sun: lights.first().map(of_project).and_then(directional), lights: Vec::new() },
        }
    }

    fn light(&self, light: &project::Light) -> Light {
        let cosine = |degrees: f32| f64::from(degrees).to_radians().cos() as f32;
        let project::Falloff { attenuation, range, spot } = light.falloff;
        let place = light.position.filter(|_| light.direction.is_none());
        Light {
            place: place.map(|place| (place - self.origin).as_vec3()),
            direction: light.direction.or(spot.map(|spot| spot.axis)).unwrap_or(Vec3::ZERO),
            color: light.color,
            attenuation,
            range,
            cone: spot.map(|spot| Cone {
                inner: cosine(spot.inner),
                outer: cosine(spot.cutoff),
                exponent: spot.exponent,
            }),
        }
    }

    /// Whether these are several lights, or a light that is not directional.
    fn are_more(&self, lights: &[usize]) -> bool {
        lights.len() > 1 || lights.iter().any(|light| self.project.lights[*light].direction.is_none())
    }

    /// As `are_more`, but false in thesis fidelity, which supports a single directional light only.
    fn are_many(&self, lights: &[usize]) -> bool {
        self.settings.fidelity == Fidelity::Corrected && self.are_more(lights)
    }

    /// What several lights or positional lights shade in a pass, in any fidelity. `None` if the pass has a single directional light or no
    /// light, or if it reads no lights.
    fn shaded<'a>(&'a self, planned: &'a PlannedPass) -> Option<Shaded<'a>> {
        let pass = self.pass(planned);
        let shaded = match (&planned.work, &pass.kind) {
            (Work::Raster { attachments, .. }, PassKind::Raster(raster)) => {
                let lit = (attachments.color || attachments.position) && !raster.is_all_own();
                lit.then_some(Shaded::Drawn)
            }
            (Work::Rays { params, .. }, PassKind::Ray(ray)) => {
                let reads = ray.program.info().globals.contains(&"lightDir") && ray.from_camera.is_none();
                reads.then_some(Shaded::Traced(ray.program, params))
            }
            (Work::Effect { .. }, PassKind::Effect(effect)) => {
                effect.program.info().lit.then_some(Shaded::Estimated(effect.program))
            }
            _ => None,
        };
        shaded.filter(|_| self.are_more(pass.kind.lights()))
    }

    /// The several or positional lights of a ray pass that starts from a G-buffer, in words for messages. `None` for other passes, in
    /// thesis fidelity, or if the pass reads a single directional light or none.
    #[must_use]
    pub fn asks_of_lights(&self, planned: &PlannedPass) -> Option<String> {
        matches!(self.shaded(planned)?, Shaded::Traced(..)).then(|| self.lights_in_words(planned)).flatten()
    }

    /// The several or positional lights of a pass, in words for messages. `None` in thesis fidelity, or if the pass reads a single
    /// directional light or none.
    #[must_use]
    pub fn lights_in_words(&self, planned: &PlannedPass) -> Option<String> {
        let known = self.shaded(planned).is_some() && self.settings.fidelity == Fidelity::Corrected;
        known.then(|| self.in_words(self.pass(planned).kind.lights()))
    }

    /// The name of the first pass with several or positional lights that its ray backend does not support, and the error with a remedy.
    /// `rays_of` returns the ray backend for the name of a pass.
    #[must_use]
    pub fn unlit<'a>(&self, rays_of: impl Fn(&str) -> &'a dyn RayBackend) -> Option<(String, BackendError)> {
        let why = "its programs know one directional light; use --backend cpu, or allow it with --fallback cpu, or leave one light \
                   with a direction in the pass";
        self.first_lacking(rays_of, |planned| self.asks_of_lights(planned), |rays| rays.knows_lights(), why)
    }

    /// Whether a quad multiplies by a share of light that differs by colour channel: lights of several colours cast different shadows.
    #[must_use]
    pub fn combines_colors(&self, source: QuadSource) -> bool {
        let QuadSource::Combine { factor: ChannelRef { target, channel: 0 }, .. } = source else { return false };
        let format = self.project.targets[target].channels.first().map(|channel| channel.format);
        if !matches!(format, Some(PixelFormat::Rgba32Float | PixelFormat::Rgba16Float | PixelFormat::Rgba8Unorm)) {
            return false;
        }
        let colored = |planned: &PlannedPass| match &self.pass(planned).kind {
            PassKind::Ray(ray) => ray.program == RayProgram::DeferredShadows && self.asks_of_lights(planned).is_some(),
            _ => false,
        };
        self.passes.iter().any(|planned| self.pass(planned).target == Some(target) && colored(planned))
    }

    fn in_words(&self, lights: &[usize]) -> String {
        let named = lights.iter().take(NAMED).map(|light| &self.project.lights[*light]);
        let named: Vec<String> = named.map(|light| format!("`{}`, {}", light.name, light.kind())).collect();
        let more = match lights.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!("; and {more} more"),
        };
        match lights.len() {
            1 => format!("the light {}", named.join("")),
            count => format!("{count} lights ({}{more})", named.join("; ")),
        }
    }

    /// Adds the decisions which lights shine in passes that have several lights or a positional one.
    ///
    /// # Errors
    /// If a pass computes something that does not support its lights.
    pub(super) fn explain_lights(&mut self) -> Result<(), PlanError> {
        let mut decisions = Vec::new();
        for planned in &self.passes {
            let Some(shaded) = self.shaded(planned) else { continue };
            let pass = self.pass(planned);
            let lights = pass.kind.lights();
            let (what, words) = (format!("lights of pass `{}`", pass.name), self.in_words(lights));
            if self.settings.fidelity == Fidelity::Thesis {
                let first = lights.iter().map(|light| &self.project.lights[*light]).find(|l| l.direction.is_some());
                let Some(first) = first else {
                    return Err(PlanError::new(
                        format!(
                            "{}: pass `{}` has {words}, and the report's programs know directions alone",
                            pass.place, pass.name
                        ),
                        "use --fidelity corrected, or give a light of the pass a <direction>",
                    ));
                };
                let why =
                    format!("of {words} the first with a direction shines, `{}`: thesis fidelity has one", first.name);
                decisions.push((what, false, why));
                continue;
            }
            if let Shaded::Estimated(program) = shaded {
                return Err(PlanError::new(
                    format!(
                        "{}: pass `{}` has {words}, and raster effects know one directional light",
                        pass.place, pass.name
                    ),
                    format!(
                        "leave one light with a direction in it, or take rays: `{}`",
                        program.info().counterpart.info().stem
                    ),
                ));
            }
            if let Shaded::Traced(program, params) = shaded {
                let refused = |what: String, remedy: &str| {
                    Err(PlanError::new(
                        format!(
                            "{}: pass `{}` has {words}, and {what} is of one directional light",
                            pass.place, pass.name
                        ),
                        remedy,
                    ))
                };
                // The filter works on one share for all colours; several lights give a share for each colour.
                if let Some(asked) = program.asks_of_filter(params) {
                    return refused(asked, "set filter=0 on the pass, or leave one light with a direction in it");
                }
                if program.info().reads("shadow") && params.shadow == GlassShadow::Caustic {
                    return refused("shadow=caustic".to_owned(), "set shadow=straight or shadow=report on the pass");
                }
            }
            let why = match shaded {
                Shaded::Traced(program, params) if program.info().names("any_hit_shadow") => {
                    let rays = match program.info().sun_samples(params) {
                        0 => String::new(),
                        rays => format!(", {rays} to the disc of each with a direction"),
                    };
                    format!("{words}; a shadow ray for each whose light arrives at a point{rays}")
                }
                _ => format!("{words}; their light is added"),
            };
            decisions.push((what, true, why));
        }
        for (what, does, why) in decisions {
            self.decide(what, does, why);
        }
        Ok(())
    }
}
