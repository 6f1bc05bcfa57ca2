//! Ambient occlusion and light: rays that only test whether something is in the way.

use super::coverage::Coverage;
use super::light::{SHADOWED, share_of_light};
use super::pass::Pass;
use super::sun::{Disc, LitSide};
use super::surface::Surface;
use super::thesis;
use super::workspace::Workspace;
use crate::sampling::sine_noise;
use crate::trace::{Fan, Hit, Neighbourhood, Purpose, Tracer};
use glam::Vec3;

/// The ambient occlusion factor for each number of open samples: `(open / samples)^intensity`.
#[must_use]
pub fn open_shares(samples: u32, intensity: f32) -> Vec<f32> {
    (0..=samples).map(|open| (open as f32 / samples as f32).powf(intensity)).collect()
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// Ambient occlusion of a surface: the open share of its cosine-weighted hemisphere within the radius, to the power
    /// of the intensity. 1 where occlusion is off.
    ///
    /// The hemisphere lies around the shading normal. Directions below the triangle would start inside the object, so they are mirrored at the
    /// triangle's plane. A smooth surface is then no darker than a flat one, and an unoccluded surface has exactly 1. Where nothing is in reach
    /// above the triangle, no ray is traced.
    pub(super) fn occlusion(
        &self,
        surface: &Surface,
        key: u32,
        work: &mut Workspace,
        stops: impl FnMut(&Hit) -> bool,
    ) -> f32 {
        let Some(sampler) = &self.occlusion else { return 1.0 };
        let (origin, facing) = (surface.origin(surface.facing), surface.facing);
        let around = self.around([origin; 2], Some(facing), 0.0, sampler.samples() as usize);
        let gathered = self.tracer.gather(&around, &mut work.candidates);
        self.hemisphere(gathered, origin, surface, key, work, stops)
    }

    /// As [`Self::occlusion`], for rays from `origin`. If `gathered`, the candidates of `work` must hold all triangles near `origin`, and rays are
    /// tested against these. Otherwise rays traverse the tree.
    pub(super) fn hemisphere(
        &self,
        gathered: bool,
        origin: Vec3,
        surface: &Surface,
        key: u32,
        work: &mut Workspace,
        stops: impl FnMut(&Hit) -> bool,
    ) -> f32 {
        let Some(sampler) = &self.occlusion else { return 1.0 };
        let (samples, above) = (sampler.samples(), Some(surface.facing));
        let clear = if gathered {
            !work.candidates.turn_to(origin, above)
        } else {
            self.tracer.clear_above(origin, surface.facing, self.job.params.radius)
        };
        if clear {
            work.rays.certain += u64::from(samples);
            return 1.0;
        }
        sampler.directions(key, surface.normal, above, &mut work.directions);
        work.rays.occlusion += u64::from(samples);
        self.announce_visibility(Purpose::Occlusion, 1.0 / samples as f32);
        self.open_share[self.count_open(gathered, (origin, above, 0.0), work, stops) as usize]
    }

    pub(super) fn around(&self, origins: [Vec3; 2], above: Option<Vec3>, t_min: f32, rays: usize) -> Neighbourhood {
        Neighbourhood { origins, above, t_min, t_max: self.job.params.radius, rays }
    }

    /// The number of directions in `work` in which no hit stops the ray. Rays start at `origin`. Hits below the plane with
    /// normal `above`, and hits nearer than `t_min`, do not count.
    fn count_open(
        &self,
        gathered: bool,
        (origin, above, t_min): (Vec3, Option<Vec3>, f32),
        work: &mut Workspace,
        mut stops: impl FnMut(&Hit) -> bool,
    ) -> u32 {
        if gathered && let Some(open) = work.candidates.count_open(&work.directions, &mut stops) {
            return open;
        }
        work.loose.clear();
        work.directions.append_to(&mut work.loose);
        let fan = Fan { origin, above, t_min, t_max: self.job.params.radius, directions: &work.loose };
        self.tracer.count_open(&fan, stops)
    }

    /// Ambient occlusion as the report computes it.
    pub(super) fn thesis_occlusion(
        &self,
        position: Vec3,
        normal: Vec3,
        work: &mut Workspace,
        stops: impl FnMut(&Hit) -> bool,
    ) -> f32 {
        if self.strata == 0 {
            return 1.0;
        }
        let samples = self.strata * self.strata;
        let mut open = samples;
        if position.is_finite() {
            let invalid = sine_noise::directions(position, normal, self.strata, &mut work.directions);
            let traced = work.directions.len();
            work.rays.occlusion += traced as u64;
            self.announce_visibility(Purpose::Occlusion, 1.0 / samples as f32);
            let around = self.around([position; 2], None, thesis::EPSILON, traced);
            let gathered = self.tracer.gather(&around, &mut work.candidates);
            if gathered {
                work.candidates.turn_to(position, None);
            }
            open = self.count_open(gathered, (position, None, thesis::EPSILON), work, stops) + invalid;
        }
        self.open_share[open as usize]
    }

    /// The light's share at a surface in `final`: [`SHADOWED`] where the side of normal `facing` faces away or
    /// something opaque is in the way, else 0.9 for each glass surface on the way. For a disc it is the mean over the
    /// disc's points for `key`. `triangle` is the id of the surface's triangle or sphere.
    pub(super) fn light_share(
        &self,
        surface: &Surface,
        (facing, triangle): (Vec3, u32),
        key: u32,
        work: &mut Workspace,
    ) -> f32 {
        if let Some(disc) = self.disc_of_sun(key, LitSide { point: surface.point(), facing, triangle }) {
            return self.dimmed_disc((&disc, SHADOWED), work);
        }
        let Some(origin) = self.light_origin(surface, (facing, triangle), work) else { return SHADOWED };
        work.rays.shadow += 1;
        let ray = self.light_ray(origin);
        let crossings = &mut work.crossings;
        crossings.clear();
        self.announce_visibility(Purpose::Shadow, 1.0);
        let blocked = self.tracer.occluded(&ray, |hit| self.blocks_light(hit, || crossings.push(hit.t)));
        share_of_light(SHADOWED, blocked, crossings)
    }

    /// The share of a disc's light in `final`, with 0.9 for each glass surface on the way; hidden parts of the disc count as `hidden`.
    pub(super) fn dimmed_disc(&self, of: (&Disc<'_>, f32), work: &mut Workspace) -> f32 {
        let stops =
            |ray, hit: &Hit, crossings: &mut Vec<(u32, f32)>| self.blocks_light(hit, || crossings.push((ray, hit.t)));
        self.disc_share(of, (&mut work.disc, &mut work.rays.shadow), |hit| self.stops_light(hit), stops)
    }

    /// Origin of the ray to the light from the side of normal `facing`. `None` where that side is dark without a ray to the
    /// light: the round surface that the triangle approximates faces away; or the triangle faces away and
    /// approximates no round surface; or something opaque lies between the triangle and the round surface.
    pub(super) fn light_origin(
        &self,
        surface: &Surface,
        (facing, triangle): (Vec3, u32),
        work: &mut Workspace,
    ) -> Option<Vec3> {
        if !self.is_turned(triangle, surface.point(), (facing, self.to_light)) {
            return Some(surface.origin(self.to_light));
        }
        let lifted = self.lifted(triangle, surface.point(), (facing, self.to_light))?;
        let is_cut_off = self.is_cut_off(&lifted, &mut work.rays.shadow, |hit| self.stops_light(hit));
        (!is_cut_off).then(|| lifted.origin())
    }
}
