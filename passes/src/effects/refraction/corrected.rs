//! The program with Fresnel weights, and with the reflected and the refracted colour blended at every bounce. Weights are exact unless the pass
//! asks for Schlick's. `final` uses the same glass.

use crate::effects::dielectric::{AllWays, Media, Sample, Walk, Ways};
use crate::effects::optics::{REFLECTED, REFRACTED, interface, reflect};
use crate::effects::surface::{FootprintOf, Surface};
use crate::effects::thesis::BOUNCE;
use crate::effects::{Cone, Coverage, Pass, Pixel, Workspace, opaque};
use crate::sampling::hash::path_key;
use crate::trace::{Announcement, Hit, Purpose, Tracer};
use glam::{Vec3, Vec4};

/// The blended colour of a glass pixel; other pixels keep their colour.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let Some(triangle) = pass.triangle(pixel).filter(|triangle| pass.is_glass(*triangle)) else {
        return pass.job.color[pixel.index];
    };
    let (surface, view) = pass.surface_at(pixel, triangle, pass.normal(pixel));
    let shade = |hit: &Hit, footprint: FootprintOf<C>, surface: &Surface, _: u32, _: &mut Workspace| {
        pass.met_color(hit, footprint, surface)
    };
    let seen = Seen { triangle, surface: &surface, view, cone: pass.cone_at(&surface) };
    opaque(Glass { pass, shade }.blend(seen, 0, 0, work))
}

/// As [`pixel`], with glass whose kind each material states. A body that the camera is in absorbs light from other surfaces too. The
/// background has no position and keeps its colour.
pub fn pixel_of_bodies<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    of_bodies(pass, pixel, AllWays, work)
}

/// One sample of [`pixel_of_bodies`]; the mean of samples over all ways is the pixel's colour. A sample without stochastic events equals that
/// colour to the bit.
pub fn sample<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    pixel: Pixel,
    sample: Sample<'_>,
    work: &mut Workspace,
) -> [f32; 4] {
    of_bodies(pass, pixel, sample, work)
}

fn of_bodies<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    pixel: Pixel,
    ways: impl Ways,
    work: &mut Workspace,
) -> [f32; 4] {
    let stored = pass.job.color[pixel.index];
    let Some(triangle) = pass.triangle(pixel) else { return stored };
    if !pass.is_glass(triangle) {
        return (Vec4::from_array(stored) * pass.kept_to_eye(pixel).extend(1.0)).to_array();
    }
    let seen = pass.surface_at(pixel, triangle, pass.normal(pixel));
    let shade = |hit: &Hit, footprint: FootprintOf<C>, surface: &Surface, _: Media, _: u32, _: &mut Workspace| {
        pass.met_color(hit, footprint, surface)
    };
    opaque(Walk { pass, shade, ways }.pixel(pixel, triangle, seen, ways.key(pass.key(pixel)), work))
}

/// The recursion over glass. `shade` computes the colour of other surfaces, with the key of the path.
pub(in crate::effects) struct Glass<'p, 'a, T, C, F> {
    pub pass: &'p Pass<'a, T, C>,
    pub shade: F,
}

/// A surface of glass at which a path has arrived.
#[derive(Clone, Copy)]
pub(in crate::effects) struct Seen<'s, K> {
    pub triangle: u32,
    pub surface: &'s Surface,
    /// Unit direction in which the surface is seen.
    pub view: Vec3,
    /// The path's cone at the surface.
    pub cone: K,
}

impl<T, C, F> Glass<'_, '_, T, C, F>
where
    T: Tracer,
    C: Coverage,
    F: Fn(&Hit, FootprintOf<C>, &Surface, u32, &mut Workspace) -> Vec3,
{
    /// The colour that glass shows after `bounces` glass hits: reflected and refracted colours by their Fresnel weights.
    /// A branch of weight 0 is not traced.
    pub fn blend(&self, seen: Seen<'_, C::Cone>, bounces: u32, key: u32, work: &mut Workspace) -> Vec3 {
        let Seen { triangle, surface, view, cone } = seen;
        let (index, weights) = (self.pass.job.params.index, self.pass.job.params.fresnel);
        let split = |normal: Vec3| {
            let interface = interface(weights, -normal.dot(view), index);
            (normal, interface, interface.refract(view, normal, index))
        };
        let bent = split(surface.interface_normal(view));
        // With an index below 1, a bent normal can refract the ray back to the viewer's side; then the geometric normal
        // is used.
        let returns = bent.2.is_some_and(|direction| direction.dot(surface.facing) >= 0.0);
        let (normal, interface, refracted) = if returns { split(surface.facing) } else { bent };
        let (curvature, cos) = (|| self.pass.curvature(triangle, surface), -normal.dot(view));
        let mut color = Vec3::ZERO;
        if interface.reflectance > 0.0 {
            work.rays.reflected += 1;
            self.announce(Purpose::Reflected, bounces, interface.reflectance);
            let direction = reflect(view, normal);
            let onward = (direction, cone.mirrored(curvature, cos));
            let radiance = self.radiance(surface, onward, bounces, path_key(key, REFLECTED), work);
            color += interface.reflectance * radiance;
        }
        if let Some(direction) = refracted {
            work.rays.refracted += 1;
            self.announce(Purpose::Refracted, bounces, 1.0 - interface.reflectance);
            let onward = (direction, cone.refracted(curvature, [cos, interface.cos_refracted], index));
            let radiance = self.radiance(surface, onward, bounces, path_key(key, REFRACTED), work);
            color += (1.0 - interface.reflectance) * radiance;
        }
        color
    }

    fn announce(&self, purpose: Purpose, bounce: u32, share: f32) {
        let weight = if bounce == 0 { share } else { BOUNCE * share };
        self.pass.tracer.announce(Announcement { purpose, bounce, weight });
    }

    /// Radiance that arrives at the surface `from` along the ray that leaves it in a direction; the cone is the one of that ray.
    fn radiance(
        &self,
        from: &Surface,
        (direction, cone): (Vec3, C::Cone),
        bounces: u32,
        key: u32,
        work: &mut Workspace,
    ) -> Vec3 {
        let (ray, Some(hit)) = self.pass.closest(from.origin(direction), direction) else {
            return self.pass.job.beyond;
        };
        let glass = self.pass.is_glass(hit.triangle);
        if glass && bounces >= self.pass.job.params.depth {
            return Vec3::ZERO;
        }
        let cone = cone.along(hit.t);
        let footprint = self.pass.footprint(cone, &hit, direction);
        let surface = self.pass.surface_hit(&ray, &hit, footprint);
        if glass {
            let seen = Seen { triangle: hit.triangle, surface: &surface, view: direction, cone };
            BOUNCE * self.blend(seen, bounces + 1, key, work)
        } else {
            (self.shade)(&hit, footprint, &surface, key, work)
        }
    }
}
