//! The surface of a body: light is reflected and refracted, and dispersed light is refracted in another direction for each wavelength.

use super::branch::Branch;
use super::facets::Facet;
use super::media::{Border, Crossing, Media};
use super::walk::{Met, Path, Walk};
use super::ways::{Met as Noted, Ways};
use crate::effects::optics::{Interface, interface_of, reflect};
use crate::effects::surface::{FootprintOf, Surface};
use crate::effects::{Cone, Coverage, Workspace};
use crate::trace::{Hit, Purpose, Tracer};
use curitiba_pipeline::glass::{Dielectric, Stratum};
use glam::Vec3;

/// The wavelength in nanometres at which materials state their index: the Fraunhofer line d.
pub const REFERENCE: f32 = 587.6;

/// The reflected and the refracted light at a surface, for one wavelength.
#[derive(Clone, Copy)]
pub(super) struct Onward<K> {
    /// Share of the light that is reflected; the rest enters.
    pub(super) reflectance: f32,
    /// Direction of the reflected light.
    pub(super) mirrored: Vec3,
    /// Direction of the light that enters; `None` at total reflection.
    pub(super) refracted: Option<Vec3>,
    /// The shares of the reflected and of the refracted light that the other facets of a rough surface let pass; 1 where the surface is smooth.
    pub(super) kept: [f32; 2],
    /// The cones of the reflected light and of the light that enters.
    cones: [K; 2],
}

impl<T, C, F, W> Walk<'_, '_, T, C, F, W>
where
    T: Tracer,
    C: Coverage,
    F: Fn(&Hit, FootprintOf<C>, &Surface, Media, u32, &mut Workspace) -> Vec3,
    W: Ways,
{
    /// The colour that the surface of a body shows.
    pub(super) fn solid(
        &self,
        met: Met<'_, FootprintOf<C>>,
        (material, dielectric): (u32, &Dielectric),
        path: Path<C::Cone>,
        work: &mut Workspace,
    ) -> Vec3 {
        let dielectrics = self.pass.job.dielectrics;
        let Met { hit, surface, view, footprint } = met;
        let crossing = Crossing { material, enters: surface.is_front() };
        let border = path.media.cross(crossing, dielectrics);
        work.rays.lost += u64::from(border.overflows);
        let straight = |weight| Branch {
            purpose: Purpose::Refracted,
            direction: view,
            weight,
            media: border.after,
            cone: path.cone,
        };
        let Some(ratio) = border.ratio else { return self.follow(surface, &straight(Vec3::ONE), path, 0, work) };
        let filter = self.pass.filter(hit, footprint, dielectric);
        let disperses = path.wavelength.is_none() && !self.pass.spectrum.is_empty() && border.disperses(dielectrics);
        let ratio = path.wavelength.map_or(ratio, |wavelength| border.ratio_at(dielectrics, wavelength));
        if ratio == 1.0 && !disperses {
            let through = self.follow(surface, &straight(filter), path, 0, work);
            return through + self.veil(met, dielectric, Vec3::ONE, path, work);
        }
        let ways = |path: Path<C::Cone>, work: &mut Workspace| {
            if disperses && W::SAMPLED {
                return self.sampled_spectrum(met, dielectric, (&border, ratio, filter), path, work);
            }
            if disperses {
                return self.dispersed(met, dielectric, (&border, filter), path, work);
            }
            let ways = self.ways(met, dielectric, ratio, path);
            self.follow_ways(met, dielectric, (&ways, filter), (border.after, path), work)
        };
        if self.scatters(met, dielectric, path) { self.scattered(path, work, ways) } else { ways(path, work) }
    }

    /// The colour that the surface of a body shows in light of one wavelength, or of all wavelengths where it disperses none.
    fn follow_ways(
        &self,
        met: Met<'_, FootprintOf<C>>,
        dielectric: &Dielectric,
        (ways, filter): (&Onward<C::Cone>, Vec3),
        (after, path): (Media, Path<C::Cone>),
        work: &mut Workspace,
    ) -> Vec3 {
        let Onward { reflectance, mirrored, refracted, kept, cones: [back, onward] } = *ways;
        let reflected = Branch {
            purpose: Purpose::Reflected,
            direction: mirrored,
            weight: reflectance * kept[0] * dielectric.mirrors(),
            media: path.media,
            cone: back,
        };
        let through = refracted.map(|direction| Branch {
            purpose: Purpose::Refracted,
            direction,
            weight: (1.0 - reflectance) * kept[1] * filter,
            media: after,
            cone: onward,
        });
        let color = self.split(met.surface, Some(reflected), through, path, work);
        color + self.veil(met, dielectric, Vec3::splat(1.0 - reflectance), path, work)
    }

    /// The reflected and the refracted light at a surface; `ratio` is the index behind it over the index before it.
    pub(super) fn ways(
        &self,
        met: Met<'_, FootprintOf<C>>,
        dielectric: &Dielectric,
        ratio: f32,
        path: Path<C::Cone>,
    ) -> Onward<C::Cone> {
        match self.facet(met, dielectric, path) {
            Some(facet) => self.rough_ways(met, dielectric, (&facet, ratio), path.cone),
            None => self.smooth_ways(met, dielectric, ratio, path.cone),
        }
    }

    /// The reflected and the refracted light at a microfacet. Light that it would send to the wrong side of the interface normal or of the triangle
    /// is lost.
    fn rough_ways(
        &self,
        met: Met<'_, FootprintOf<C>>,
        dielectric: &Dielectric,
        (facet, ratio): (&Facet, f32),
        cone: C::Cone,
    ) -> Onward<C::Cone> {
        let Met { surface, view, .. } = met;
        let interface = interface_of(dielectric, self.pass.job.params.fresnel, -facet.normal.dot(view), ratio);
        let side = |direction: Vec3| {
            let [whole, flat] = [surface.interface_normal(view), surface.facing].map(|normal| direction.dot(normal));
            if whole * flat > 0.0 { flat.signum() } else { 0.0 }
        };
        let mirrored = reflect(view, facet.normal);
        let refracted = interface.refract(view, facet.normal, ratio).filter(|direction| side(*direction) < 0.0);
        let back = if side(mirrored) > 0.0 { facet.passes(mirrored) } else { 0.0 };
        let kept = [back, refracted.map_or(0.0, |direction| facet.passes(direction))];
        let cones = self.cones(met, (facet.normal, &interface), ratio, cone);
        Onward { reflectance: interface.reflectance, mirrored, refracted, kept, cones }
    }

    /// The reflected and the refracted light at a smooth surface.
    fn smooth_ways(
        &self,
        met: Met<'_, FootprintOf<C>>,
        dielectric: &Dielectric,
        ratio: f32,
        cone: C::Cone,
    ) -> Onward<C::Cone> {
        let Met { surface, view, .. } = met;
        let bend = |normal: Vec3| {
            let interface = interface_of(dielectric, self.pass.job.params.fresnel, -normal.dot(view), ratio);
            (normal, interface, interface.refract(view, normal, ratio))
        };
        let bent = bend(surface.interface_normal(view));
        // A bent normal can refract light back to the viewer's side; then the geometric normal is used.
        let returns = bent.2.is_some_and(|direction| direction.dot(surface.facing) >= 0.0);
        let (normal, interface, refracted) = if returns { bend(surface.facing) } else { bent };
        let cones = self.cones(met, (normal, &interface), ratio, cone);
        let mirrored = reflect(view, normal);
        Onward { reflectance: interface.reflectance, mirrored, refracted, kept: [1.0; 2], cones }
    }

    /// The cones of the light reflected by this normal and of the light that enters.
    fn cones(
        &self,
        Met { hit, surface, view, .. }: Met<'_, FootprintOf<C>>,
        (normal, interface): (Vec3, &Interface),
        ratio: f32,
        cone: C::Cone,
    ) -> [C::Cone; 2] {
        let (curvature, cos) = (|| self.pass.curvature(hit.triangle, surface), -normal.dot(view));
        [cone.mirrored(curvature, cos), cone.refracted(curvature, [cos, interface.cos_refracted], ratio)]
    }

    /// The colour of the surface of a dispersive body in light of all wavelengths. The light that enters goes on by wavelength; the reflected
    /// light stays together.
    #[inline(never)]
    fn dispersed(
        &self,
        met: Met<'_, FootprintOf<C>>,
        dielectric: &Dielectric,
        (border, filter): (&Border, Vec3),
        path: Path<C::Cone>,
        work: &mut Workspace,
    ) -> Vec3 {
        let splits = self.splits(path);
        let mut together: Option<Branch<C::Cone>> = None;
        let (mut color, mut entering, mut split) = (Vec3::ZERO, Vec3::ZERO, false);
        for Stratum { wavelength, weight } in &self.pass.spectrum {
            let ratio = border.ratio_at(self.pass.job.dielectrics, *wavelength);
            let Onward { reflectance, mirrored, refracted, kept, cones } = self.ways(met, dielectric, ratio, path);
            entering += *weight * (1.0 - reflectance);
            let mut back = *weight * (reflectance * kept[0]) * dielectric.mirrors();
            let mut through = *weight * ((1.0 - reflectance) * kept[1]) * filter;
            if refracted.is_some() && !splits {
                // Beyond the depth all light goes through, with the weight of both ways.
                (back, through) = (Vec3::ZERO, back + through);
            }
            let own = Path { wavelength: Some(*wavelength), ..path };
            let branch = Branch {
                purpose: Purpose::Reflected,
                direction: mirrored,
                weight: back,
                media: path.media,
                cone: cones[0],
            };
            match &mut together {
                None => together = Some(branch),
                Some(first) if first.direction == mirrored => first.weight += back,
                // Reflected about another normal than the light of the first wavelength, which is rare.
                Some(_) => color += self.split(met.surface, Some(branch), None, own, work),
            }
            if let Some(direction) = refracted {
                split |= back != Vec3::ZERO;
                let purpose = Purpose::Refracted;
                let branch = Branch { purpose, direction, weight: through, media: border.after, cone: cones[1] };
                color += self.follow(met.surface, &branch, own, u32::from(splits), work);
            }
        }
        if let Some(branch) = together.filter(|branch| branch.weight != Vec3::ZERO) {
            color += self.follow(met.surface, &branch, path, u32::from(split), work);
        }
        color + self.veil(met, dielectric, entering, path, work)
    }

    /// As [`Self::dispersed`], for the parts of the spectrum that the ways of a sample have.
    ///
    /// The weights of these few wavelengths do not add up to 1. Light of [`REFERENCE`] gets the difference from 1, as a control variate. So there
    /// is no noise from the choice of wavelengths where the colour is the same at all of them.
    #[inline(never)]
    fn sampled_spectrum(
        &self,
        met: Met<'_, FootprintOf<C>>,
        dielectric: &Dielectric,
        (border, ratio, filter): (&Border, f32, Vec3),
        path: Path<C::Cone>,
        work: &mut Workspace,
    ) -> Vec3 {
        self.ways.note(Noted::DIVIDED);
        let spectrum = &self.pass.spectrum;
        let splits = self.splits(path);
        let numbers = path.sample.map_or_else(|| self.ways.numbers(self.pass.job.params.paths), |way| way..way + 1);
        let scale = spectrum.len() as f32 / numbers.len() as f32;
        let reference = self.ways(met, dielectric, ratio, path);
        let mut together = Branch {
            purpose: Purpose::Reflected,
            direction: reference.mirrored,
            weight: Vec3::ZERO,
            media: path.media,
            cone: reference.cones[0],
        };
        let (mut color, mut entering, mut split, mut rest) = (Vec3::ZERO, Vec3::ZERO, false, Vec3::ONE);
        let mut add = |ways: &Onward<C::Cone>, weight: Vec3, own: Path<C::Cone>, work: &mut Workspace| {
            let Onward { reflectance, mirrored, refracted, kept, cones } = *ways;
            entering += weight * (1.0 - reflectance);
            let mut back = weight * (reflectance * kept[0]) * dielectric.mirrors();
            let mut through = weight * ((1.0 - reflectance) * kept[1]) * filter;
            if refracted.is_some() && !splits {
                // Beyond the depth all light goes through, with the weight of both ways.
                (back, through) = (Vec3::ZERO, back + through);
            }
            // The importance excludes the weight of the wavelength, so that cut-offs do not depend on the number of sampled wavelengths.
            let own = Path { importance: own.importance / weight.abs().max_element(), ..own };
            if mirrored == together.direction {
                together.weight += back;
            } else {
                // Reflected about another normal than light of [`REFERENCE`], which is rare.
                let branch = Branch { direction: mirrored, weight: back, cone: cones[0], ..together };
                color += self.split(met.surface, Some(branch), None, own, work);
            }
            if let Some(direction) = refracted {
                split |= back != Vec3::ZERO;
                let branch = Branch {
                    purpose: Purpose::Refracted,
                    direction,
                    weight: through,
                    media: border.after,
                    cone: cones[1],
                };
                color += self.follow(met.surface, &branch, own, u32::from(splits), work);
            }
        };
        for way in numbers {
            let part = self.ways.part_of_spectrum(way, path.key, spectrum.len());
            let Stratum { wavelength, weight } = spectrum[part];
            let weight = weight * scale;
            rest -= weight;
            let own = Path { wavelength: Some(wavelength), sample: Some(way), ..path };
            let ways = self.ways(met, dielectric, border.ratio_at(self.pass.job.dielectrics, wavelength), own);
            if weight != Vec3::ZERO {
                add(&ways, weight, own, work);
            }
        }
        if rest != Vec3::ZERO {
            add(&reference, rest, Path { wavelength: Some(REFERENCE), ..path }, work);
        }
        if together.weight != Vec3::ZERO {
            color += self.follow(met.surface, &together, path, u32::from(split), work);
        }
        color + self.veil(met, dielectric, entering, path, work)
    }
}
