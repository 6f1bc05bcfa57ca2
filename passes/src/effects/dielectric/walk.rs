//! Paths through glass: each surface splits a path in two, down to the depth of the pass.

use super::branch::Branch;
use super::facets::Facet;
use super::media::Media;
use super::slab::{kept_across, slab};
use super::ways::{Met as Noted, Ways};
use crate::effects::interpolate::locate;
use crate::effects::optics::{Interface, REFLECTED, REFRACTED, interface, interface_of, reflect};
use crate::effects::surface::{FootprintOf, Surface};
use crate::effects::thesis::BOUNCE;
use crate::effects::{Cone, Coverage, Pass, Pixel, Workspace};
use crate::sampling::hash::path_key;
use crate::trace::{Announcement, Hit, Purpose, Tracer};
use curitiba_pipeline::glass::{Dielectric, Shape, transmittance};
use glam::Vec3;

/// Greatest number of glass surfaces that a path meets; beyond it, the path is lost. In a body of many faces light may be reflected for long.
pub const MOST_SURFACES: u32 = 128;

/// A path that has arrived at a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Path<K> {
    /// The bodies that the path is in before the surface.
    pub(super) media: Media,
    /// Number of glass surfaces met before.
    pub(super) surfaces: u32,
    /// How often the path was split in two.
    pub(super) splits: u32,
    pub(super) key: u32,
    /// The wavelength of its light, nanometres; `None` until a body has dispersed it.
    pub(super) wavelength: Option<f32>,
    /// The number of its way, once rough glass or the spectrum of a sample has divided the path; `None` before.
    pub(super) sample: Option<u32>,
    /// The share of the pixel's colour that the path contributes; raised to the cut-off where Russian roulette has decided about the path.
    pub(super) importance: f32,
    /// Numbers of reflections and of refractions before.
    pub(super) bounces: [u32; 2],
    /// Its cone at the surface.
    pub(super) cone: K,
}

/// The surface that a path has arrived at, and the path's direction.
#[derive(Clone, Copy)]
pub(super) struct Met<'h, F> {
    pub(super) hit: &'h Hit,
    pub(super) surface: &'h Surface,
    /// Unit direction of the path, towards the surface.
    pub(super) view: Vec3,
    /// The path's footprint on the surface's textures.
    pub(super) footprint: F,
}

/// Follows paths. `shade` gives the colour of surfaces that are not glass, and of the light that glass scatters back. It is given the key
/// of the path.
///
/// Down to the depth of the pass both ways on are followed. Beyond it light goes on through the surface where it can, with the weight of
/// both ways. So no light is lost there, and the cost of a path of many surfaces is proportional to its length.
pub(in crate::effects) struct Walk<'p, 'a, T, C, F, W> {
    pub pass: &'p Pass<'a, T, C>,
    pub shade: F,
    /// Which ways are followed.
    pub ways: W,
}

impl<T, C, F, W> Walk<'_, '_, T, C, F, W>
where
    T: Tracer,
    C: Coverage,
    F: Fn(&Hit, FootprintOf<C>, &Surface, Media, u32, &mut Workspace) -> Vec3,
    W: Ways,
{
    /// The colour of a pixel that shows glass.
    pub fn pixel(&self, pixel: Pixel, triangle: u32, seen: (Surface, Vec3), key: u32, work: &mut Workspace) -> Vec3 {
        let (surface, view) = seen;
        let stored = self.pass.position(pixel).truncate();
        let hit = match self.pass.sphere(triangle) {
            Some(_) => Hit { t: 0.0, triangle, u: 0.0, v: 0.0 },
            None => locate(&self.pass.job.scene.geometry, triangle, stored),
        };
        let path = Path {
            media: self.pass.around_eye,
            surfaces: 0,
            splits: 0,
            key,
            wavelength: None,
            sample: None,
            importance: 1.0,
            bounces: [0; 2],
            cone: self.pass.cone_at(&surface),
        };
        let footprint = self.pass.footprint(path.cone, &hit, view);
        self.pass.kept_to_eye(pixel) * self.glass(Met { hit: &hit, surface: &surface, view, footprint }, path, work)
    }

    fn extinction(&self, media: Media) -> Vec3 {
        media.top().map_or(Vec3::ZERO, |material| self.pass.job.dielectrics[material as usize].extinction)
    }

    /// The colour of glass that a ray meets.
    fn glass(&self, met: Met<'_, FootprintOf<C>>, path: Path<C::Cone>, work: &mut Workspace) -> Vec3 {
        if path.surfaces >= MOST_SURFACES {
            work.rays.lost += 1;
            return Vec3::ZERO;
        }
        let material = self.pass.material_of(met.hit.triangle);
        let dielectric = &self.pass.job.dielectrics[material as usize];
        match dielectric.shape {
            Shape::Solid => self.solid(met, (material, dielectric), path, work),
            Shape::Thin => self.thin(met, dielectric, path, work),
            Shape::Pane | Shape::Opaque => self.pane(met, path, work),
        }
    }

    /// The light that a surface scatters back, of the light that enters; `entering` is the share of light that enters.
    pub(super) fn veil(
        &self,
        met: Met<'_, FootprintOf<C>>,
        dielectric: &Dielectric,
        entering: Vec3,
        path: Path<C::Cone>,
        work: &mut Workspace,
    ) -> Vec3 {
        let veil = self.pass.veil_at(met.hit, met.footprint, dielectric);
        if veil <= 0.0 {
            return Vec3::ZERO;
        }
        veil * entering * (self.shade)(met.hit, met.footprint, met.surface, path.media, self.own_key(&path), work)
    }

    /// A wall with two faces.
    fn thin(
        &self,
        met: Met<'_, FootprintOf<C>>,
        dielectric: &Dielectric,
        path: Path<C::Cone>,
        work: &mut Workspace,
    ) -> Vec3 {
        if self.scatters(met, dielectric, path) {
            return self.scattered(path, work, |path, work| self.thin(met, dielectric, path, work));
        }
        let Met { hit, surface, view, footprint } = met;
        let facet = self.facet(met, dielectric, path);
        let normal = facet.map_or(surface.interface_normal(view), |facet| facet.normal);
        let ratio = dielectric.index / path.media.index_at(self.pass.job.dielectrics, path.wavelength);
        let Interface { reflectance, cos_refracted } =
            interface_of(dielectric, self.pass.job.params.fresnel, -normal.dot(view), ratio);
        let wall = slab(reflectance, kept_across(dielectric, cos_refracted));
        let mirrored = Branch {
            purpose: Purpose::Reflected,
            direction: reflect(view, normal),
            weight: wall.reflected * dielectric.mirrors(),
            media: path.media,
            cone: path.cone.mirrored(|| self.pass.curvature(hit.triangle, surface), -normal.dot(view)),
        };
        let through = Branch {
            purpose: Purpose::Refracted,
            direction: view,
            weight: wall.transmitted * self.pass.filter(hit, footprint, dielectric),
            media: path.media,
            // The refractions at the two faces of the wall cancel.
            cone: path.cone,
        };
        let (mirrored, through) = match facet {
            Some(facet) => facet.of_wall(surface.facing, mirrored, through),
            None => (Some(mirrored), Some(through)),
        };
        let color = self.split(surface, mirrored, through, path, work);
        color + self.veil(met, dielectric, wall.transmitted, path, work)
    }

    /// The report's pane: light enters glass at every bounce, and each bounce after the first dims it.
    fn pane(&self, met: Met<'_, FootprintOf<C>>, path: Path<C::Cone>, work: &mut Workspace) -> Vec3 {
        let Met { hit, surface, view, .. } = met;
        let (index, weights) = (self.pass.job.params.index, self.pass.job.params.fresnel);
        let bend = |normal: Vec3| {
            let interface = interface(weights, -normal.dot(view), index);
            (normal, interface, interface.refract(view, normal, index))
        };
        let bent = bend(surface.interface_normal(view));
        let returns = bent.2.is_some_and(|direction| direction.dot(surface.facing) >= 0.0);
        let (normal, interface, refracted) = if returns { bend(surface.facing) } else { bent };
        let Interface { reflectance, cos_refracted } = interface;
        let kept = if path.surfaces > 0 { BOUNCE } else { 1.0 };
        let branch = |purpose, direction, share: f32, cone| Branch {
            purpose,
            direction,
            weight: Vec3::splat(kept * share),
            media: path.media,
            cone,
        };
        let (curvature, cos) = (|| self.pass.curvature(hit.triangle, surface), -normal.dot(view));
        let cone = path.cone.mirrored(curvature, cos);
        let mirrored = branch(Purpose::Reflected, reflect(view, normal), reflectance, cone);
        let cone = || path.cone.refracted(curvature, [cos, cos_refracted], index);
        let through = refracted.map(|direction| branch(Purpose::Refracted, direction, 1.0 - reflectance, cone()));
        self.split(surface, Some(mirrored), through, path, work)
    }

    /// Whether a surface is rough and divides the path, because nothing has divided it before.
    pub(super) fn scatters(&self, met: Met<'_, FootprintOf<C>>, dielectric: &Dielectric, path: Path<C::Cone>) -> bool {
        let may = dielectric.alpha > 0.0 && path.sample.is_none() && !self.pass.facets.is_empty();
        may && self.pass.alpha(met.hit, met.footprint, dielectric) > 0.0
    }

    /// The mean colour of the ways on from rough glass; `each` returns the colour of one way.
    #[inline(never)]
    pub(super) fn scattered(
        &self,
        path: Path<C::Cone>,
        work: &mut Workspace,
        each: impl Fn(Path<C::Cone>, &mut Workspace) -> Vec3,
    ) -> Vec3 {
        self.ways.note(Noted::DIVIDED);
        let numbers = self.ways.numbers(self.pass.facets.len() as u32);
        let count = numbers.len() as u32;
        // In a sample the importance is not divided among the ways, so that cut-offs do not depend on the number of ways.
        let importance = if W::SAMPLED { path.importance } else { path.importance / count as f32 };
        let sum: Vec3 = numbers.map(|sample| each(Path { sample: Some(sample), importance, ..path }, work)).sum();
        sum / count as f32
    }

    /// The microfacet that a path meets; `None` where the surface is smooth.
    pub(super) fn facet(
        &self,
        met: Met<'_, FootprintOf<C>>,
        dielectric: &Dielectric,
        path: Path<C::Cone>,
    ) -> Option<Facet> {
        let way = path.sample.filter(|_| dielectric.alpha > 0.0)?;
        let alpha = self.pass.alpha(met.hit, met.footprint, dielectric);
        if alpha <= 0.0 {
            return None;
        }
        let point = self.ways.facet(&self.pass.facets, way, path.key)?;
        Some(Facet::seen(alpha, met.surface.interface_normal(met.view), met.view, point))
    }

    /// The key of the random numbers that are drawn where a path ends.
    pub(super) fn own_key(&self, path: &Path<C::Cone>) -> u32 {
        self.ways.own_key(path.key, path.sample)
    }

    /// Follows the reflected and the transmitted branch; beyond the depth only the transmitted one, if there is one, with the weight of both. A
    /// branch of weight 0 is not followed.
    pub(super) fn split(
        &self,
        surface: &Surface,
        reflected: Option<Branch<C::Cone>>,
        through: Option<Branch<C::Cone>>,
        path: Path<C::Cone>,
        work: &mut Workspace,
    ) -> Vec3 {
        let counts = |branch: &Branch<C::Cone>| branch.weight != Vec3::ZERO;
        match (reflected.filter(counts), through.filter(counts)) {
            (None, None) => Vec3::ZERO,
            (Some(branch), None) | (None, Some(branch)) => self.follow(surface, &branch, path, 0, work),
            (Some(reflected), Some(through)) if self.splits(path) => {
                self.follow(surface, &reflected, path, 1, work) + self.follow(surface, &through, path, 1, work)
            }
            (Some(reflected), Some(through)) => {
                let weight = reflected.weight + through.weight;
                self.follow(surface, &Branch { weight, ..through }, path, 0, work)
            }
        }
    }

    /// Whether both branches at a surface are followed.
    pub(super) fn splits(&self, path: Path<C::Cone>) -> bool {
        path.splits < self.pass.job.params.depth
    }

    /// What a branch adds to the colour.
    pub(super) fn follow(
        &self,
        surface: &Surface,
        branch: &Branch<C::Cone>,
        path: Path<C::Cone>,
        splits: u32,
        work: &mut Workspace,
    ) -> Vec3 {
        let reflected = branch.purpose == Purpose::Reflected;
        let mut path = Path {
            media: branch.media,
            cone: branch.cone,
            surfaces: path.surfaces + 1,
            splits: path.splits + splits,
            key: path_key(path.key, if reflected { REFLECTED } else { REFRACTED }),
            ..path
        };
        let weight = match self.kept(branch, &mut path) {
            None => return self.cut_off(branch),
            Some(0.0) => return Vec3::ZERO,
            Some(more) => more * branch.weight,
        };
        let counter = if reflected { &mut work.rays.reflected } else { &mut work.rays.refracted };
        *counter += 1;
        let announced =
            Announcement { purpose: branch.purpose, bounce: path.surfaces - 1, weight: weight.max_element() };
        self.pass.tracer.announce(announced);
        weight * self.radiance(surface, branch.direction, path, work)
    }

    /// Radiance that arrives at the surface `at` along the ray that leaves it in a direction.
    fn radiance(&self, at: &Surface, direction: Vec3, path: Path<C::Cone>, work: &mut Workspace) -> Vec3 {
        let extinction = self.extinction(path.media);
        let (ray, Some(hit)) = self.pass.closest(at.origin(direction), direction) else {
            return transmittance(extinction, f32::INFINITY) * self.pass.job.beyond;
        };
        let cone = path.cone.along(hit.t);
        let footprint = self.pass.footprint(cone, &hit, direction);
        let surface = self.pass.surface_hit(&ray, &hit, footprint);
        // Measured from surface to surface, because the ray starts a little off its own surface.
        let length = (surface.position() - at.position()).dot(direction).max(0.0);
        let kept = transmittance(extinction, length);
        kept * if self.pass.is_glass(hit.triangle) {
            let path = Path { importance: path.importance * kept.max_element(), cone, ..path };
            self.glass(Met { hit: &hit, surface: &surface, view: direction, footprint }, path, work)
        } else {
            (self.shade)(&hit, footprint, &surface, path.media, self.own_key(&path), work)
        }
    }
}
