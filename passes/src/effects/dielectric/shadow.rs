//! Light that falls straight through glass.

use super::media::{Border, Crossing, Media};
use super::slab::{kept_across, slab};
use crate::effects::interpolate::interpolate;
use crate::effects::light::{SHADOWED, THROUGH_GLASS};
use crate::effects::optics::interface_of;
use crate::effects::sun::{Disc, LitSide};
use crate::effects::surface::Surface;
use crate::effects::{Coverage, LevelZero, Pass, Workspace};
use crate::trace::{Hit, Purpose, Ray, Tracer};
use curitiba_pipeline::glass::{Dielectric, Shape};
use glam::Vec3;

/// Greatest difference of the distances of two hits that count as one, as a share of the distance.
const ROUNDING: f32 = 8.0 * f32::EPSILON;

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The light that reaches a surface, by colour: [`SHADOWED`] where its side faces away from the light or something opaque is in the way. Else
    /// it lies between [`SHADOWED`] and 1, by the share of the light that falls straight through glass ([`Self::straight`]). For a light with a
    /// disc it is the mean over the disc, at the points of `key`.
    pub(in crate::effects) fn straight_light(
        &self,
        surface: &Surface,
        side: (Vec3, u32),
        key: u32,
        work: &mut Workspace,
    ) -> Vec3 {
        let (facing, triangle) = side;
        let Some(disc) = self.disc_of_sun(key, LitSide { point: surface.point(), facing, triangle }) else {
            let Some(origin) = self.light_origin(surface, side, work) else { return Vec3::splat(SHADOWED) };
            return SHADOWED + (1.0 - SHADOWED) * self.straight_along(&self.light_ray(origin), 1.0, None, work);
        };
        SHADOWED + (1.0 - SHADOWED) * self.straight_over(&disc, work)
    }

    /// The share of a disc's light that comes straight to a surface, by colour: the mean of [`Self::straight_along`].
    pub(in crate::effects) fn straight_over(&self, disc: &Disc<'_>, work: &mut Workspace) -> Vec3 {
        let (weight, mut rays, mut sum) = (disc.weight(), 0, Vec3::ZERO);
        self.to_disc(
            disc,
            &mut rays,
            |hit| self.stops_light(hit),
            |origin, direction| {
                let ray = Ray { direction, ..self.light_ray(origin) };
                sum += self.straight_along(&ray, weight, None, work);
            },
        );
        work.rays.shadow += rays;
        weight * sum
    }

    /// The share of light that comes along a ray, by colour: 0 where something opaque is in the way, or glass that sends the light elsewhere.
    /// `weight` is the ray's weight, for tracers that record it. The sphere `without` is ignored.
    pub(in crate::effects) fn straight_along(
        &self,
        ray: &Ray,
        weight: f32,
        without: Option<u32>,
        work: &mut Workspace,
    ) -> Vec3 {
        work.rays.shadow += 1;
        let mut through = std::mem::take(&mut work.through);
        through.clear();
        self.announce_visibility(Purpose::Shadow, weight);
        let blocked = self.tracer.occluded(ray, |hit| {
            let there = without != Some(hit.triangle);
            let sends_away = || self.focuses(hit.triangle, ray.origin) && self.covers(hit);
            there && (sends_away() || self.blocks_light(hit, || through.push(*hit)))
        });
        let passes = if blocked { Vec3::ZERO } else { self.straight(ray, &mut through, work) };
        work.through = through;
        passes
    }

    /// The share of light that passes these surfaces of glass, by colour, as if they bent nothing: 1 - F and the filter of the surface at each
    /// border between two media, times absorption over each distance inside. Thin walls and panes pass [`Self::passes_straight`]. F takes the
    /// cosine on the side of the lower index: with the cosine on the other side, a sphere would be black from the critical angle on. The hits may
    /// come in any order, and each may be given more than once.
    fn straight(&self, ray: &Ray, hits: &mut Vec<Hit>, work: &mut Workspace) -> Vec3 {
        let (geometry, dielectrics) = (&self.job.scene.geometry, self.job.dielectrics);
        let material = |hit: &Hit| self.material_of(hit.triangle);
        let enters = |hit: &Hit| {
            if let Some(normal) = self.sphere_normal(ray, hit) {
                return normal.dot(ray.direction) < 0.0;
            }
            let [a, b, c] = geometry.corners(hit.triangle).map(|corner| corner.as_dvec3());
            (b - a).cross(c - a).dot(ray.direction.as_dvec3()) < 0.0
        };
        hits.sort_unstable_by(|one, two| one.t.total_cmp(&two.t).then(one.triangle.cmp(&two.triangle)));
        hits.dedup_by(|later, kept| {
            later.t - kept.t <= ROUNDING * later.t && material(later) == material(kept) && enters(later) == enters(kept)
        });
        let is_solid = |hit: &&Hit| dielectrics[material(hit) as usize].shape == Shape::Solid;
        let crossing = |hit: &Hit| Crossing { material: material(hit), enters: enters(hit) };
        let mut media = Media::at_start_of(hits.iter().filter(is_solid).map(crossing), dielectrics);
        let (mut passes, mut from) = (Vec3::ONE, 0.0);
        for hit in hits.iter() {
            passes *= self.on_the_way(media, hit.t - from);
            from = hit.t;
            let dielectric = &dielectrics[material(hit) as usize];
            let normal = self
                .sphere_normal(ray, hit)
                .unwrap_or_else(|| interpolate(geometry, &geometry.normals, hit).normalize_or_zero());
            let cos = normal.dot(ray.direction).abs();
            let share = |ratio: f32| interface_of(dielectric, self.job.params.fresnel, cos, ratio);
            passes *= match dielectric.shape {
                Shape::Solid => {
                    let Border { after, ratio, overflows, .. } = media.cross(crossing(hit), dielectrics);
                    work.rays.lost += u64::from(overflows);
                    media = after;
                    ratio.map_or(Vec3::ONE, |ratio| {
                        (1.0 - share(ratio.max(1.0 / ratio)).reflectance) * self.filter(hit, LevelZero, dielectric)
                    })
                }
                Shape::Thin | Shape::Pane | Shape::Opaque => self.passes_straight(hit, dielectric, cos, media),
            };
        }
        passes * self.on_the_way(media, ray.t_max - from)
    }

    /// The share of light that a thin wall or a pane in these media lets straight on, at an angle of this cosine.
    pub(super) fn passes_straight(&self, hit: &Hit, dielectric: &Dielectric, cos: f32, media: Media) -> Vec3 {
        if dielectric.shape != Shape::Thin {
            return Vec3::splat(THROUGH_GLASS);
        }
        let ratio = dielectric.index / media.index(self.job.dielectrics);
        let face = interface_of(dielectric, self.job.params.fresnel, cos, ratio.max(1.0 / ratio));
        slab(face.reflectance, kept_across(dielectric, face.cos_refracted)).transmitted
            * self.filter(hit, LevelZero, dielectric)
    }

    /// Transmittance over a distance in these media, by colour.
    pub(super) fn on_the_way(&self, media: Media, length: f32) -> Vec3 {
        media.top().map_or(Vec3::ONE, |material| self.job.dielectrics[material as usize].transmittance(length))
    }
}
