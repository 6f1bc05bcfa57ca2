//! The surface of a body: light is reflected and refracted, and where colours are bent apart each wavelength goes its own way.

use super::media::{Border, Crossing, Media};
use super::walk::{Branch, Met, Path, Walk};
use crate::effects::optics::{interface, reflect};
use crate::effects::surface::Surface;
use crate::effects::{Coverage, Workspace};
use crate::trace::{Hit, Purpose, Tracer};
use curitiba_pipeline::glass::{Dielectric, Stratum};
use glam::Vec3;

/// Both ways on from a surface, for light of one wavelength.
#[derive(Clone, Copy)]
struct Ways {
    /// Share of the light that is reflected; the rest enters.
    reflectance: f32,
    /// Where what is reflected goes.
    mirrored: Vec3,
    /// Where what enters goes; `None` at total reflection.
    refracted: Option<Vec3>,
}

impl<T: Tracer, C: Coverage, F: Fn(&Hit, &Surface, Media, u32, &mut Workspace) -> Vec3> Walk<'_, '_, T, C, F> {
    /// What the surface of a body shows.
    pub(super) fn solid(
        &self,
        met: Met<'_>,
        (material, dielectric): (u32, &Dielectric),
        path: Path,
        work: &mut Workspace,
    ) -> Vec3 {
        let dielectrics = self.pass.job.dielectrics;
        let Met { hit, surface, view } = met;
        let crossing = Crossing { material, enters: surface.is_front() };
        let border = path.media.cross(crossing, dielectrics);
        work.rays.lost += u64::from(border.overflows);
        let straight = |weight| Branch { purpose: Purpose::Refracted, direction: view, weight, media: border.after };
        let Some(ratio) = border.ratio else { return self.follow(surface, &straight(Vec3::ONE), path, 0, work) };
        let filter = self.pass.filter(hit, dielectric);
        if path.wavelength.is_none() && !self.pass.spectrum.is_empty() && border.disperses(dielectrics) {
            return self.dispersed(met, dielectric, (&border, filter), path, work);
        }
        let ratio = path.wavelength.map_or(ratio, |wavelength| border.ratio_at(dielectrics, wavelength));
        if ratio == 1.0 {
            let through = self.follow(surface, &straight(filter), path, 0, work);
            return through + self.veil(met, dielectric, Vec3::ONE, path, work);
        }
        let Ways { reflectance, mirrored, refracted } = self.ways(met, ratio);
        let reflected = Branch {
            purpose: Purpose::Reflected,
            direction: mirrored,
            weight: Vec3::splat(reflectance),
            media: path.media,
        };
        let through = refracted.map(|direction| Branch { direction, ..straight((1.0 - reflectance) * filter) });
        let color = self.split(surface, Some(reflected), through, path, work);
        color + self.veil(met, dielectric, Vec3::splat(1.0 - reflectance), path, work)
    }

    /// Where a surface sends light; `ratio` is the index behind it over that before.
    fn ways(&self, Met { surface, view, .. }: Met<'_>, ratio: f32) -> Ways {
        let bend = |normal: Vec3| {
            let interface = interface(self.pass.job.params.fresnel, -normal.dot(view), ratio);
            (normal, interface, interface.refract(view, normal, ratio))
        };
        let bent = bend(surface.interface_normal(view));
        // Refracted back to the viewer's side, which a bent normal can do: the flat surface serves.
        let returns = bent.2.is_some_and(|direction| direction.dot(surface.facing) >= 0.0);
        let (normal, interface, refracted) = if returns { bend(surface.facing) } else { bent };
        Ways { reflectance: interface.reflectance, mirrored: reflect(view, normal), refracted }
    }

    /// The surface of a body that bends colours apart, to light of all of them: what enters goes on by wavelength, what is reflected
    /// stays together.
    #[inline(never)]
    fn dispersed(
        &self,
        met: Met<'_>,
        dielectric: &Dielectric,
        (border, filter): (&Border, Vec3),
        path: Path,
        work: &mut Workspace,
    ) -> Vec3 {
        let splits = self.splits(path);
        let mut together: Option<Branch> = None;
        let (mut color, mut entering, mut split) = (Vec3::ZERO, Vec3::ZERO, false);
        for Stratum { wavelength, weight } in &self.pass.spectrum {
            let ratio = border.ratio_at(self.pass.job.dielectrics, *wavelength);
            let Ways { reflectance, mirrored, refracted } = self.ways(met, ratio);
            entering += *weight * (1.0 - reflectance);
            let (mut back, mut through) = (*weight * reflectance, *weight * (1.0 - reflectance) * filter);
            if refracted.is_some() && !splits {
                // Beyond the depth light goes through, with the weight of both.
                (back, through) = (Vec3::ZERO, back + through);
            }
            let own = Path { wavelength: Some(*wavelength), ..path };
            let branch = Branch { purpose: Purpose::Reflected, direction: mirrored, weight: back, media: path.media };
            match &mut together {
                None => together = Some(branch),
                Some(first) if first.direction == mirrored => first.weight += back,
                // By another normal, which few surfaces have.
                Some(_) => color += self.split(met.surface, Some(branch), None, own, work),
            }
            if let Some(direction) = refracted {
                split |= back != Vec3::ZERO;
                let purpose = Purpose::Refracted;
                let branch = Branch { purpose, direction, weight: through, media: border.after };
                color += self.follow(met.surface, &branch, own, u32::from(splits), work);
            }
        }
        if let Some(branch) = together.filter(|branch| branch.weight != Vec3::ZERO) {
            color += self.follow(met.surface, &branch, path, u32::from(split), work);
        }
        color + self.veil(met, dielectric, entering, path, work)
    }
}
