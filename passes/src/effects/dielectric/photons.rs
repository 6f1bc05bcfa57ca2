//! Shoots photons at the bodies of glass meshes, and lights surfaces by them.
//!
//! The photons of a target start on a disc that is perpendicular to the light and covers the target, each with the light of an equal part of the
//! disc. A photon goes straight through glass that is no target, up to the first surface that is opaque or belongs to a target. If this
//! surface does not belong to the photon's own target, the photon is dropped: its light meets no target first, or the photons of another
//! target carry it. So photons carry exactly the light that meets a target first, and targets block straight light ([`Pass::focuses`]).
//!
//! At each surface of a body a photon is either reflected or refracted, each with a probability equal to its share of the light. So its power
//! changes only by absorption, filters, masking by microfacets, and the weight of its wavelength. Thin glass lets it straight on, as it does
//! straight light. A photon ends at the first surface that is not glass. All of its choices are Owen-scrambled Sobol points of its number; at each
//! surface the points have another order.

use super::branch::Branch;
use super::caustic::Lit;
use super::eye::around;
use super::media::{Crossing, Media};
use super::photon_map::{Cloud, Photon, PhotonMap, radius};
use super::solid::Onward;
use super::targets::{Target, Targets};
use super::walk::{MOST_SURFACES, Met, Path, Walk};
use super::ways::{Sample, Ways, in_order};
use crate::effects::surface::{FootprintOf, Surface};
use crate::effects::{Cone, Coverage, Pass, Workspace};
use crate::sampling::cone::in_cone;
use crate::sampling::hash::{PHOTON_DIRECTION, PHOTON_PLACE, PHOTON_WAY, dimensions, path_key, photon_key, unit};
use crate::sampling::hemisphere::{Basis, concentric_disk};
use crate::sampling::owen_sobol::{reversed_sobol, scramble_reversed};
use crate::trace::{Hit, Purpose, Ray, Tracer};
use curitiba_pipeline::backend::{PhotonCounts, PixelCone, RayJob};
use curitiba_pipeline::glass::{Shape, Stratum, first_target};
use curitiba_pipeline::memory::{Refused, filled, with_capacity};
use curitiba_pipeline::programs::Fidelity;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::cell::Cell;

/// Photons that a thread takes at a time.
const PART: usize = 1 << 12;

/// The irradiance across a photon's direction is its power divided by its cosine at the surface. This is the lower bound of that cosine: without
/// it, the irradiance would have no upper bound.
pub const GRAZING: f32 = 0.05;

/// How the path of a photon ends.
enum End {
    /// On a surface that is no glass.
    Landed(Photon),
    /// It missed its target, was in a shadow, was absorbed, or left the scene.
    Gone,
    /// It met too many surfaces.
    Lost,
}

/// Whether a job shoots photons: it requests some, and its scene has meshes of glass that bend light.
#[must_use]
pub fn shoots_photons(job: &RayJob<'_>) -> bool {
    let asks = job.fidelity == Fidelity::Corrected && job.program.photons(&job.params) > 0;
    asks && first_target(job.scene, job.dielectrics).is_some()
}

/// The bodies at which photons are shot; none where a pass does not ask for them.
pub(crate) fn targets<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>) -> Targets {
    let job = pass.job;
    if !shoots_photons(job) || pass.to_light == Vec3::ZERO {
        return Targets::default();
    }
    let along = -pass.to_light.as_dvec3().normalize_or_zero();
    Targets::of(&job.scene.geometry, job.dielectrics, along, pass.disc.is_some())
}

/// Shoots the photons that a pass requests at its targets.
///
/// # Errors
/// If there is too little memory.
pub(crate) fn photons<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>) -> Result<PhotonMap, Refused> {
    let targets = pass.targets.list();
    if targets.is_empty() {
        return Ok(PhotonMap::default());
    }
    let params = &pass.job.params;
    let mut clouds = with_capacity(targets.len())?;
    let mut counts = PhotonCounts::default();
    for ((number, target), count) in targets.iter().enumerate().zip(pass.targets.shares(params.photons)) {
        let mut photons = filled(Photon::NONE, count as usize)?;
        let shoot =
            |(part, photons): (usize, &mut [Photon])| pass.shoot_part((number, target, count), part * PART, photons);
        let parts = photons.par_chunks_mut(PART).enumerate().with_max_len(1).map(shoot);
        counts += parts.reduce(PhotonCounts::default, |mut sum, part| {
            sum += part;
            sum
        });
        clouds.push(Cloud::new(photons, radius(params.photon_radius, target.radius, count, params.photon_batch))?);
    }
    Ok(PhotonMap::new(clouds, counts))
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// Shoots the photons from number `first` on into `photons`. `of` is the number of the target, the target, and the target's number of photons.
    #[inline(never)]
    fn shoot_part(&self, of: (usize, &Target, u32), first: usize, photons: &mut [Photon]) -> PhotonCounts {
        let mut work = Box::<Workspace>::default();
        let mut counts = PhotonCounts::default();
        for (place, photon) in photons.iter_mut().enumerate() {
            if self.progress.is_some_and(|progress| progress.is_cancelled()) {
                break;
            }
            counts.shot += 1;
            match self.shot(of, (first + place) as u32, &mut work) {
                End::Landed(landed) => {
                    counts.landed += 1;
                    *photon = landed;
                }
                End::Lost => counts.lost += 1,
                End::Gone => {}
            }
        }
        counts.lost += work.rays.lost;
        counts.rays = work.rays.total();
        counts
    }

    /// Follows one photon of a target; `count` is the target's number of photons, and `index` the photon's number among them.
    fn shot(&self, (number, target, count): (usize, &Target, u32), index: u32, work: &mut Workspace) -> End {
        let params = &self.job.params;
        let place = u64::from(params.photon_batch) * u64::from(count) + u64::from(index);
        // A sequence has 2^32 points, so the high bits select another sequence.
        let key = photon_key(number as u32, (place >> 32) as u32, self.job.seed);
        let place = place as u32;
        let direction = self.photon_direction(key, place);
        let basis = Basis::around(direction);
        let across = concentric_disk(point(key, PHOTON_PLACE, place)).as_dvec2() * target.radius;
        let across = basis.tangent.as_dvec3() * across.x + basis.bitangent.as_dvec3() * across.y;
        // A little before all bodies of the target.
        let before = 1.001 * target.reach;
        let origin = (target.center + across - direction.as_dvec3() * before).as_vec3();
        let ray = Ray { origin, direction, t_min: 0.0, t_max: (2.1 * target.reach) as f32 };
        work.rays.camera += 1;
        let stops =
            |hit: &Hit| self.covers(hit) && (!self.passes_light(hit) || self.targets.at(hit.triangle).is_some());
        let Some(hit) = self.tracer.closest(&ray, stops) else { return End::Gone };
        if self.targets.at(hit.triangle) != Some(number) {
            return End::Gone;
        }
        let cone = C::Cone::of_pixel(PixelCone::default(), 0.0);
        let surface = self.surface_hit(&ray, &hit, self.footprint(cone, &hit, direction));
        if !surface.is_front() {
            return End::Gone;
        }
        let back = -direction;
        let to_light = Ray { origin: surface.origin(back), direction: back, t_min: 0.0, t_max: f32::INFINITY };
        let arrives = self.straight_along(&to_light, 1.0, None, work);
        if arrives == Vec3::ZERO {
            return End::Gone;
        }
        let media = if target.among_bodies { around(self, to_light.origin) } else { Media::NONE };
        let power = arrives * (std::f64::consts::PI * target.radius * target.radius / f64::from(count)) as f32;
        let path = Path {
            media,
            surfaces: 0,
            splits: 0,
            key,
            wavelength: None,
            sample: Some(place),
            importance: 1.0,
            bounces: [0; 2],
            cone,
        };
        self.through_glass((hit, surface, direction), (path, power), index, work)
    }

    /// The unit direction in which a photon is shot.
    fn photon_direction(&self, key: u32, place: u32) -> Vec3 {
        match &self.disc {
            None => -self.to_light,
            Some(disc) => {
                let within = in_cone(point(key, PHOTON_DIRECTION, place), disc.height());
                -Basis::around(self.to_light).to_world(within)
            }
        }
    }

    /// Follows a photon from its first surface of glass, `hit`, to its end.
    fn through_glass(
        &self,
        (mut hit, mut surface, mut direction): (Hit, Surface, Vec3),
        (mut path, mut power): (Path<C::Cone>, Vec3),
        index: u32,
        work: &mut Workspace,
    ) -> End {
        let met = Cell::default();
        let ways = Sample { half: 0, first: 0, ways: 1, offset: 0, met: &met };
        let shade = |_: &Hit, _: FootprintOf<C>, _: &Surface, _: Media, _: u32, _: &mut Workspace| Vec3::ZERO;
        let walk = Walk { pass: self, shade, ways };
        let first = path.key;
        loop {
            if path.surfaces >= MOST_SURFACES {
                return End::Lost;
            }
            path.key = path_key(first, path.surfaces);
            let footprint = self.footprint(path.cone, &hit, direction);
            let met = Met { hit: &hit, surface: &surface, view: direction, footprint };
            let Some(branch) = walk.way_of_photon(met, &mut path, work) else { return End::Gone };
            power *= branch.weight;
            if power == Vec3::ZERO {
                return End::Gone;
            }
            (path.media, path.surfaces, direction) = (branch.media, path.surfaces + 1, branch.direction);
            work.rays.refracted += 1;
            let (ray, Some(next)) = self.closest(surface.origin(direction), direction) else { return End::Gone };
            let before = surface.position();
            surface = self.surface_hit(&ray, &next, self.footprint(path.cone, &next, direction));
            hit = next;
            power *= self.on_the_way(path.media, (surface.position() - before).dot(direction).max(0.0));
            if !self.is_glass(hit.triangle) {
                let lands = !self.is_sky(hit.triangle) && power != Vec3::ZERO;
                let landed = Photon::new(surface.position(), (direction, surface.facing), power, index);
                return if lands { End::Landed(landed) } else { End::Gone };
            }
        }
    }

    /// The light that photons add at a point of a surface, as a multiple of the surface's own colour. Each photon that landed nearby, on the side with
    /// the unit normal `facing`, acts as a directional light with the photon's direction. Its irradiance is weighted by the kernel.
    #[inline(never)]
    pub(in crate::effects) fn photon_light(&self, surface: &Surface, facing: Vec3, lit: &Lit) -> Vec3 {
        let mut light = Vec3::ZERO;
        self.focused.photons.each_near(surface.position(), facing, |photon, weight| {
            let cosine = (-photon.direction.dot(photon.normal)).max(GRAZING);
            light += photon.power * (weight / cosine) * lit.share(self.light_color, -photon.direction);
        });
        light
    }
}

/// A point of the unit square for one of a photon's choices; `place` is the photon's place in the sequence.
fn point(key: u32, choice: u32, place: u32) -> Vec2 {
    // The place on the disc takes the sequence in its own order: 2^k photons in a row cover the disc evenly.
    let place = if choice == PHOTON_PLACE { place } else { in_order(place, dimensions(key, choice - 1)[0]) };
    let (sobol, seeds) = (reversed_sobol(place), dimensions(key, choice));
    let [x, y] = [0, 1].map(|axis| unit(scramble_reversed(sobol[axis], seeds[axis])));
    Vec2::new(x, y)
}

/// A number from 0 to 1 that decides whether the photon of a place in the sequence is reflected at the surface of this key.
fn chance(key: u32, place: u32) -> f32 {
    let [seed, order] = dimensions(key, PHOTON_WAY);
    unit(scramble_reversed(in_order(place, order), seed))
}

impl<T, C, F, W> Walk<'_, '_, T, C, F, W>
where
    T: Tracer,
    C: Coverage,
    F: Fn(&Hit, FootprintOf<C>, &Surface, Media, u32, &mut Workspace) -> Vec3,
    W: Ways,
{
    /// The branch that a photon takes where it meets glass; `None` if none of its light goes on. Where the surface disperses light, the photon has
    /// one wavelength from then on.
    fn way_of_photon(
        &self,
        met: Met<'_, FootprintOf<C>>,
        path: &mut Path<C::Cone>,
        work: &mut Workspace,
    ) -> Option<Branch<C::Cone>> {
        let (job, place) = (self.pass.job, path.sample?);
        let Met { hit, surface, view, footprint } = met;
        let material = self.pass.material_of(hit.triangle);
        let dielectric = &job.dielectrics[material as usize];
        let (purpose, cone) = (Purpose::Refracted, path.cone);
        if dielectric.shape != Shape::Solid {
            let weight = self.pass.passes_straight(hit, dielectric, surface.normal.dot(view).abs(), path.media);
            return Some(Branch { purpose, direction: view, weight, media: path.media, cone });
        }
        let border = path.media.cross(Crossing { material, enters: surface.is_front() }, job.dielectrics);
        work.rays.lost += u64::from(border.overflows);
        let straight = |weight| Branch { purpose, direction: view, weight, media: border.after, cone };
        let Some(mut ratio) = border.ratio else { return Some(straight(Vec3::ONE)) };
        let mut weight = Vec3::ONE;
        if path.wavelength.is_none() && !self.pass.spectrum.is_empty() && border.disperses(job.dielectrics) {
            let spectrum = &self.pass.spectrum;
            let Stratum { wavelength, weight: share } =
                spectrum[self.ways.part_of_spectrum(place, path.key, spectrum.len())];
            path.wavelength = Some(wavelength);
            weight = share * spectrum.len() as f32;
        }
        if let Some(wavelength) = path.wavelength {
            ratio = border.ratio_at(job.dielectrics, wavelength);
        }
        let filter = || weight * self.pass.filter(hit, footprint, dielectric);
        if ratio == 1.0 {
            return Some(straight(filter()));
        }
        let Onward { reflectance, mirrored, refracted, kept, .. } = self.ways(met, dielectric, ratio, *path);
        if chance(path.key, place) < reflectance {
            let weight = weight * kept[0] * dielectric.mirrors();
            return Some(Branch { purpose: Purpose::Reflected, direction: mirrored, weight, media: path.media, cone });
        }
        refracted.map(|direction| Branch { purpose, direction, weight: filter() * kept[1], media: border.after, cone })
    }
}
