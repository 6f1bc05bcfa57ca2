//! Paths through glass: each surface splits a path in two, down to the depth of the pass.

use super::media::{Border, Crossing, Media};
use super::slab::{kept_across, slab};
use crate::effects::interpolate::locate;
use crate::effects::optics::{Interface, REFLECTED, REFRACTED, interface, reflect};
use crate::effects::surface::Surface;
use crate::effects::thesis::BOUNCE;
use crate::effects::{Coverage, Pass, Pixel, Workspace};
use crate::sampling::hash::path_key;
use crate::trace::{Announcement, Hit, Purpose, Tracer};
use curitiba_pipeline::glass::{Dielectric, Shape, transmittance};
use glam::Vec3;

/// Surfaces of glass that a path meets, at most: beyond, it is lost. Light that is mirrored in a body of many faces may take long.
const MOST_SURFACES: u32 = 128;

/// A path that has come to a surface.
#[derive(Debug, Clone, Copy)]
struct Path {
    /// The bodies before the surface.
    media: Media,
    /// Surfaces of glass met before.
    surfaces: u32,
    /// How often it was split.
    splits: u32,
    key: u32,
}

/// One of the two ways on from a surface.
struct Branch {
    purpose: Purpose,
    direction: Vec3,
    /// What its radiance counts, by colour.
    weight: Vec3,
    media: Media,
}

/// Follows paths; `shade` gives the colour of everything that is not glass, given the key of the path.
///
/// Down to the depth of the pass both ways on are followed. Beyond it light goes on through the surface where it can, with the weight of
/// both: none is lost there, and a path of many surfaces costs no more than its length.
pub(in crate::effects) struct Walk<'p, 'a, T, C, F> {
    pub pass: &'p Pass<'a, T, C>,
    pub shade: F,
}

impl<T: Tracer, C: Coverage, F: Fn(&Hit, &Surface, Media, u32, &mut Workspace) -> Vec3> Walk<'_, '_, T, C, F> {
    /// What a pixel of glass shows.
    pub fn pixel(&self, pixel: Pixel, triangle: u32, seen: (Surface, Vec3), key: u32, work: &mut Workspace) -> Vec3 {
        let (surface, view) = seen;
        let geometry = &self.pass.job.scene.geometry;
        let stored = self.pass.position(pixel).truncate();
        let hit = locate(geometry, triangle, stored);
        let path = Path { media: self.pass.around_eye, surfaces: 0, splits: 0, key };
        let length = stored.distance(self.pass.job.eye);
        transmittance(self.extinction(path.media), length) * self.glass(&hit, &surface, view, path, work)
    }

    fn extinction(&self, media: Media) -> Vec3 {
        media.top().map_or(Vec3::ZERO, |material| self.pass.job.dielectrics[material as usize].extinction)
    }

    /// What glass shows to a ray of direction `view` that meets it.
    fn glass(&self, hit: &Hit, surface: &Surface, view: Vec3, path: Path, work: &mut Workspace) -> Vec3 {
        if path.surfaces >= MOST_SURFACES {
            work.rays.lost += 1;
            return Vec3::ZERO;
        }
        let material = self.pass.job.scene.geometry.material_of(hit.triangle);
        let dielectric = &self.pass.job.dielectrics[material as usize];
        match dielectric.shape {
            Shape::Solid => self.solid((hit, surface), view, (material, dielectric), path, work),
            Shape::Thin => self.thin((hit, surface), view, dielectric, path, work),
            Shape::Pane | Shape::Opaque => self.pane(surface, view, path, work),
        }
    }

    fn veil(
        &self,
        (hit, surface): (&Hit, &Surface),
        dielectric: &Dielectric,
        entering: Vec3,
        path: Path,
        work: &mut Workspace,
    ) -> Vec3 {
        if dielectric.veil <= 0.0 {
            return Vec3::ZERO;
        }
        dielectric.veil * entering * (self.shade)(hit, surface, path.media, path.key, work)
    }

    /// The surface of a body.
    fn solid(
        &self,
        (hit, surface): (&Hit, &Surface),
        view: Vec3,
        (material, dielectric): (u32, &Dielectric),
        path: Path,
        work: &mut Workspace,
    ) -> Vec3 {
        let crossing = Crossing { material, enters: surface.is_front() };
        let Border { after, ratio, overflows } = path.media.cross(crossing, self.pass.job.dielectrics);
        work.rays.lost += u64::from(overflows);
        let straight = |weight| Branch { purpose: Purpose::Refracted, direction: view, weight, media: after };
        let Some(ratio) = ratio else { return self.follow(surface, &straight(Vec3::ONE), path, 0, work) };
        let filter = self.pass.filter(hit, dielectric);
        if ratio == 1.0 {
            let through = self.follow(surface, &straight(filter), path, 0, work);
            return through + self.veil((hit, surface), dielectric, Vec3::ONE, path, work);
        }
        let bend = |normal: Vec3| {
            let interface = interface(self.pass.job.params.fresnel, -normal.dot(view), ratio);
            (normal, interface, interface.refract(view, normal, ratio))
        };
        let bent = bend(surface.interface_normal(view));
        // Refracted back to the viewer's side, which a bent normal can do: the flat surface serves.
        let returns = bent.2.is_some_and(|direction| direction.dot(surface.facing) >= 0.0);
        let (normal, Interface { reflectance, .. }, refracted) = if returns { bend(surface.facing) } else { bent };
        let reflected = Branch {
            purpose: Purpose::Reflected,
            direction: reflect(view, normal),
            weight: Vec3::splat(reflectance),
            media: path.media,
        };
        let refracted = refracted.map(|direction| Branch { direction, ..straight((1.0 - reflectance) * filter) });
        let color = self.split(surface, &reflected, refracted.as_ref(), path, work);
        color + self.veil((hit, surface), dielectric, Vec3::splat(1.0 - reflectance), path, work)
    }

    /// A wall with two faces.
    fn thin(
        &self,
        (hit, surface): (&Hit, &Surface),
        view: Vec3,
        dielectric: &Dielectric,
        path: Path,
        work: &mut Workspace,
    ) -> Vec3 {
        let normal = surface.interface_normal(view);
        let ratio = dielectric.index / path.media.index(self.pass.job.dielectrics);
        let Interface { reflectance, cos_refracted } =
            interface(self.pass.job.params.fresnel, -normal.dot(view), ratio);
        let wall = slab(reflectance, kept_across(dielectric, cos_refracted));
        let mirrored = Branch {
            purpose: Purpose::Reflected,
            direction: reflect(view, normal),
            weight: wall.reflected,
            media: path.media,
        };
        let through = Branch {
            purpose: Purpose::Refracted,
            direction: view,
            weight: wall.transmitted * self.pass.filter(hit, dielectric),
            media: path.media,
        };
        let color = self.split(surface, &mirrored, Some(&through), path, work);
        color + self.veil((hit, surface), dielectric, wall.transmitted, path, work)
    }

    /// The report's pane: light enters it at every bounce, and those after the first dim it.
    fn pane(&self, surface: &Surface, view: Vec3, path: Path, work: &mut Workspace) -> Vec3 {
        let (index, weights) = (self.pass.job.params.index, self.pass.job.params.fresnel);
        let bend = |normal: Vec3| {
            let interface = interface(weights, -normal.dot(view), index);
            (normal, interface.reflectance, interface.refract(view, normal, index))
        };
        let bent = bend(surface.interface_normal(view));
        let returns = bent.2.is_some_and(|direction| direction.dot(surface.facing) >= 0.0);
        let (normal, reflectance, refracted) = if returns { bend(surface.facing) } else { bent };
        let kept = if path.surfaces > 0 { BOUNCE } else { 1.0 };
        let branch = |purpose, direction, share: f32| Branch {
            purpose,
            direction,
            weight: Vec3::splat(kept * share),
            media: path.media,
        };
        let mirrored = branch(Purpose::Reflected, reflect(view, normal), reflectance);
        let through = refracted.map(|direction| branch(Purpose::Refracted, direction, 1.0 - reflectance));
        self.split(surface, &mirrored, through.as_ref(), path, work)
    }

    /// Both ways on, or beyond the depth the one through the surface, where there is one.
    fn split(
        &self,
        surface: &Surface,
        reflected: &Branch,
        through: Option<&Branch>,
        path: Path,
        work: &mut Workspace,
    ) -> Vec3 {
        let through = through.filter(|branch| branch.weight != Vec3::ZERO);
        let Some(through) = through else { return self.follow(surface, reflected, path, 0, work) };
        if reflected.weight == Vec3::ZERO {
            return self.follow(surface, through, path, 0, work);
        }
        if path.splits < self.pass.job.params.depth {
            return self.follow(surface, reflected, path, 1, work) + self.follow(surface, through, path, 1, work);
        }
        let weight = reflected.weight + through.weight;
        self.follow(surface, &Branch { weight, ..*through }, path, 0, work)
    }

    /// What a branch adds to the colour.
    fn follow(&self, surface: &Surface, branch: &Branch, path: Path, splits: u32, work: &mut Workspace) -> Vec3 {
        let reflected = branch.purpose == Purpose::Reflected;
        let counter = if reflected { &mut work.rays.reflected } else { &mut work.rays.refracted };
        *counter += 1;
        let announced =
            Announcement { purpose: branch.purpose, bounce: path.surfaces, weight: branch.weight.max_element() };
        self.pass.tracer.announce(announced);
        let path = Path {
            media: branch.media,
            surfaces: path.surfaces + 1,
            splits: path.splits + splits,
            key: path_key(path.key, if reflected { REFLECTED } else { REFRACTED }),
        };
        branch.weight * self.radiance(surface, branch.direction, path, work)
    }

    /// What arrives at a surface from a direction.
    fn radiance(&self, at: &Surface, direction: Vec3, path: Path, work: &mut Workspace) -> Vec3 {
        let extinction = self.extinction(path.media);
        let (ray, Some(hit)) = self.pass.closest(at.origin(direction), direction) else {
            return transmittance(extinction, f32::INFINITY) * self.pass.job.beyond;
        };
        let surface = self.pass.surface_hit(&ray, &hit);
        let color = if self.pass.is_glass(hit.triangle) {
            self.glass(&hit, &surface, direction, path, work)
        } else {
            (self.shade)(&hit, &surface, path.media, path.key, work)
        };
        // From surface to surface: the ray starts a little off its own.
        let length = (surface.position() - at.position()).dot(direction).max(0.0);
        transmittance(extinction, length) * color
    }
}
