//! Several lights, and positional lights: the light that arrives at a surface, and the share of the surface's colour that shadows leave.
//!
//! A surface reflects `tint * (ambient + lights)`, where `lights` is the sum of the lights that arrive, each by its colour, attenuation,
//! cone and cosine. A shadow takes away an occluded light; ambient light stays. So the share of the colour that is left, for each channel, is
//! `(ambient + lights that are seen) / (ambient + lights)`. Of a directional light with a disc, `sun` finds the part that is seen.

use super::coverage::Coverage;
use super::interpolate::locate;
use super::light::{SHADOWED, share_of_light};
use super::material::AMBIENT;
use super::pass::Pass;
use super::ray_cone::Footprint;
use super::sun::{Disc, LitSide};
use super::surface::Surface;
use super::workspace::Workspace;
use crate::sampling::hash::light_key;
use crate::trace::{Hit, Purpose, Ray, SurfacePoint, Tracer};
use curitiba_pipeline::backend::{Light, RayJob, Sun};
use curitiba_pipeline::programs::Fidelity;
use glam::Vec3;

/// Share of the distance to a positional light by which shadow rays end before the light, so that a ceiling at the light's place does not block it.
pub const BEFORE_LIGHT: f32 = 1.0 / 1024.0;

/// The kind of lights that a device program is generated for. Programs for one directional light do not pay for several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Lighting {
    /// One directional light that is a point, or no light that the program reads.
    Sun,
    /// Several lights, positional lights, or directional lights that are discs.
    Lights,
}

impl Lighting {
    /// The lighting that a job needs.
    #[must_use]
    pub fn of(job: &RayJob<'_>) -> Self {
        let reads = job.program.info().globals.contains(&"lightDir");
        if reads && (disc_samples(job) > 0 || !job.lights.is_empty()) { Self::Lights } else { Self::Sun }
    }
}

/// The lights of a job as device programs for [`Lighting::Lights`] take them.
#[derive(Debug, Clone, PartialEq)]
pub struct LightTable {
    /// All lights; a single directional one is the only entry.
    pub lights: Vec<Light>,
    /// Share of a light that is left behind something opaque. Above 0, the job has a single directional light, and programs write that light's
    /// share, as the programs for [`Lighting::Sun`] do. At 0, they write the share of the colour that the shadows of all lights leave.
    pub hidden: f32,
}

impl LightTable {
    /// The table of a job; `None` if the job's programs are those for [`Lighting::Sun`].
    #[must_use]
    pub fn of(job: &RayJob<'_>) -> Option<Self> {
        if Lighting::of(job) == Lighting::Sun {
            return None;
        }
        Some(match job.sun.filter(|_| job.lights.is_empty()) {
            None => Self { lights: job.lights.to_vec(), hidden: 0.0 },
            Some(Sun { direction, color }) => {
                let range = f32::INFINITY;
                let sun = Light { place: None, direction, color, attenuation: [1.0, 0.0, 0.0], range, cone: None };
                Self { lights: vec![sun], hidden: SHADOWED }
            }
        })
    }
}

/// Number of rays from a point to the disc of each directional light; 0 where these lights are points, as in thesis fidelity.
pub(super) fn disc_samples(job: &RayJob<'_>) -> u32 {
    match job.fidelity {
        Fidelity::Corrected => job.program.info().sun_samples(&job.params),
        Fidelity::Thesis => 0,
    }
}

/// Number of rays from a point to the discs of all lights, in device programs.
#[must_use]
pub fn disc_rays(job: &RayJob<'_>) -> u32 {
    let is_directional = |light: &&Light| light.place.is_none();
    let discs = LightTable::of(job).map_or(0, |table| table.lights.iter().filter(is_directional).count());
    (discs as u32).saturating_mul(disc_samples(job))
}

/// The normal by which a surface is shaded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shading {
    /// Unit shading normal: the stored one at a point that the camera sees; at a hit, the one on the viewer's side.
    pub normal: Vec3,
    /// The hit of a ray; `None` at a point that the camera sees.
    pub hit: Option<Hit>,
}

/// A point whose light is computed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked<'s> {
    pub point: &'s SurfacePoint,
    /// Unit geometric normal on the side that is lit.
    pub facing: Vec3,
    /// Id of the triangle or sphere.
    pub id: u32,
    pub shading: Shading,
    /// The key of the point's random numbers.
    pub key: u32,
}

/// The rays from a point to a light.
#[derive(Debug, Clone, Copy)]
pub(super) enum Way<'p> {
    /// One ray, to a light without a disc.
    Ray(Ray),
    /// Rays to the disc of a directional light.
    Disc(Disc<'p>),
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// Whether the pass has several lights, or a positional one.
    #[inline(always)]
    pub(super) fn has_lights(&self) -> bool {
        !self.job.lights.is_empty()
    }

    /// The colour of a surface that a ray hits, in the light of all lights of the pass; with a single directional light,
    /// [`Self::lit_color`].
    pub(super) fn met_color(&self, hit: &Hit, footprint: impl Footprint, surface: &Surface) -> Vec3 {
        if !self.has_lights() {
            return self.lit_color(hit, footprint, surface.normal);
        }
        let mut sum = Vec3::ZERO;
        for light in self.job.lights {
            let arriving = light.at(surface.position());
            sum += light.color * (arriving.factor * self.cosine_to(hit, surface.normal, arriving.towards));
        }
        let shade = &self.job.shades[self.material_of(hit.triangle) as usize];
        self.reflected_color(hit, footprint, (shade, shade.diffuse.truncate() * sum))
    }

    /// The cosine of a light at a point.
    fn cosine_at(&self, asked: &Asked<'_>, towards: Vec3) -> f32 {
        let Shading { normal, hit } = asked.shading;
        let shade = &self.job.shades[self.material_of(asked.id) as usize];
        let has_normals = !self.job.scene.geometry.normals.is_empty();
        if shade.normal_map.is_some() && has_normals && self.sphere(asked.id).is_none() {
            let located = || locate(&self.job.scene.geometry, asked.id, asked.point.position);
            return self.cosine_to(&hit.unwrap_or_else(located), normal, towards).min(1.0);
        }
        towards.dot(normal).clamp(0.0, 1.0)
    }

    /// The share of a point's colour that shadows leave, for each channel. `reaches` traces the rays from the surface to one light and returns the
    /// share of the light that passes. `stops` says whether a hit separates a point from the round surface that its triangle approximates.
    pub(super) fn share_of_lights(
        &self,
        asked: &Asked<'_>,
        work: &mut Workspace,
        stops: impl Fn(&Hit) -> bool,
        mut reaches: impl FnMut(&Way<'_>, &mut Workspace) -> Vec3,
    ) -> Vec3 {
        let (mut whole, mut left) = (Vec3::ZERO, Vec3::ZERO);
        for (number, light) in (0..).zip(self.job.lights) {
            let arriving = light.at(asked.point.position);
            if arriving.factor <= 0.0 {
                continue;
            }
            let color = light.color * (arriving.factor * self.cosine_at(asked, arriving.towards));
            if color == Vec3::ZERO {
                continue;
            }
            whole += color;
            let way = match &self.disc {
                Some(sampler) if light.place.is_none() => {
                    let Asked { point, facing, id: triangle, key, .. } = *asked;
                    let side = LitSide { point, facing, triangle };
                    Some(Way::Disc(Disc { sampler, center: arriving.towards, key: light_key(key, number), side }))
                }
                _ => self.ray_to(light, arriving.towards, asked, work, &stops).map(Way::Ray),
            };
            if let Some(way) = way {
                left += color * reaches(&way, work);
            }
        }
        let shade = &self.job.shades[self.material_of(asked.id) as usize];
        let diffuse = shade.diffuse.truncate();
        let ambient = match shade.texture.filter(|_| self.sphere(asked.id).is_none()) {
            None => AMBIENT * diffuse,
            Some(_) if asked.shading.hit.is_none() => shade.emission.truncate() + AMBIENT,
            Some(_) => Vec3::splat(AMBIENT),
        };
        let (left, whole) = (ambient + diffuse * left, ambient + diffuse * whole);
        Vec3::select(whole.cmpgt(Vec3::ZERO), left / whole, Vec3::ONE)
    }

    /// The ray from a point to a light. `None` where the triangle faces away from the light, unless the point can be lifted onto the round
    /// surface ([`Self::lifted`]) and nothing lies in between.
    fn ray_to(
        &self,
        light: &Light,
        towards: Vec3,
        asked: &Asked<'_>,
        work: &mut Workspace,
        stops: impl Fn(&Hit) -> bool,
    ) -> Option<Ray> {
        let origin = if asked.facing.dot(towards) > 0.0 {
            asked.point.spawn(towards)
        } else {
            let lifted = self.lifted(asked.id, asked.point, (asked.facing, towards))?;
            if self.is_cut_off(&lifted, &mut work.rays.shadow, stops) {
                return None;
            }
            lifted.origin()
        };
        let Some(place) = light.place else {
            return Some(Ray { origin, direction: towards, t_min: 0.0, t_max: f32::INFINITY });
        };
        let way = place - origin;
        let t_max = way.length() * (1.0 - BEFORE_LIGHT);
        Some(Ray { origin, direction: way.normalize_or(towards), t_min: 0.0, t_max })
    }

    /// The share of a light that passes along its rays in `final`: 0 where something opaque is in the way, else 0.9 for each glass surface.
    pub(super) fn passes(&self, way: &Way<'_>, work: &mut Workspace) -> Vec3 {
        let ray = match way {
            Way::Ray(ray) => ray,
            Way::Disc(disc) => return Vec3::splat(self.dimmed_disc((disc, 0.0), work)),
        };
        work.rays.shadow += 1;
        let crossings = &mut work.crossings;
        crossings.clear();
        self.announce_visibility(Purpose::Shadow, 1.0);
        let blocked = self.tracer.occluded(ray, |hit| self.blocks_light(hit, || crossings.push(hit.t)));
        Vec3::splat(share_of_light(0.0, blocked, crossings))
    }
}
