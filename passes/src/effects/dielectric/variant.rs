//! Variants of device programs by the glass that they support, so that panes do not pay for what bodies need.

use curitiba_pipeline::backend::RayJob;
use curitiba_pipeline::glass::{Dielectric, MOST_STRATA};
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
use glam::Vec3;

/// The features of a device program that is generated for a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Variant {
    /// In a fidelity, with the report's panes.
    Panes(Fidelity),
    /// In corrected fidelity, with smooth glass whose kind each material states, and a background or a sky.
    Bodies,
    /// As [`Self::Bodies`], with glass that is rough, disperses light or has a reflectance of its own, and with limits that cut paths off.
    Ways,
}

impl Variant {
    /// The programs that have variants for bodies. `reflection` supports a background in every variant, and the other device programs show no glass.
    pub const OF_BODIES: [RayProgram; 2] = [RayProgram::Refraction, RayProgram::Final];

    /// The variant that a job needs.
    #[must_use]
    pub fn of(job: &RayJob<'_>) -> Self {
        let asks = !job.dielectrics.is_empty() || job.beyond != Vec3::ZERO || !job.scene.geometry.sky.is_empty();
        let has = Self::OF_BODIES.contains(&job.program);
        match () {
            () if !(asks && has && job.fidelity == Fidelity::Corrected) => Self::Panes(job.fidelity),
            () if asks_of_ways(&job.params, job.dielectrics) => Self::Ways,
            () => Self::Bodies,
        }
    }

    /// Whether the variant supports bodies.
    #[must_use]
    pub fn knows_bodies(self) -> bool {
        matches!(self, Self::Bodies | Self::Ways)
    }
}

/// Whether a pass requests dispersion, and any glass disperses light.
pub(crate) fn disperses(params: &RayParams, dielectrics: &[Dielectric]) -> bool {
    params.wavelengths > 1 && dielectrics.iter().any(|dielectric| dielectric.spread > 0.0)
}

/// Whether any glass is rough.
pub(crate) fn is_rough(dielectrics: &[Dielectric]) -> bool {
    dielectrics.iter().any(|dielectric| dielectric.alpha > 0.0)
}

/// Greatest number of ways into which rough glass and the spectrum divide a path of a pixel; 1 where nothing divides it.
#[must_use]
pub fn ways_of_path(job: &RayJob<'_>) -> u32 {
    if Variant::of(job) != Variant::Ways {
        return 1;
    }
    let facets = if is_rough(job.dielectrics) { job.params.paths.max(1) } else { 1 };
    let strata = if disperses(&job.params, job.dielectrics) { job.params.wavelengths.min(MOST_STRATA) } else { 1 };
    facets.saturating_mul(strata)
}

/// Whether a pass needs more than smooth glass of one index and paths that are not cut off.
fn asks_of_ways(params: &RayParams, dielectrics: &[Dielectric]) -> bool {
    let own = dielectrics.iter().any(|dielectric| dielectric.reflectance.is_some() || dielectric.reflection.is_some());
    let cut = params.limits.cut() && !dielectrics.is_empty();
    disperses(params, dielectrics) || is_rough(dielectrics) || own || cut
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::glass::{PathLimits, Reflectance};

    #[test]
    fn each_kind_of_glass_and_each_limit_asks_for_ways_by_itself() {
        let (plain, all) = (Dielectric::default(), RayParams::default());
        assert!(!asks_of_ways(&all, &[plain]) && !asks_of_ways(&all, &[]));
        let flint = [plain, Dielectric { spread: 0.02, ..plain }];
        assert!(asks_of_ways(&all, &flint) && !asks_of_ways(&RayParams { wavelengths: 1, ..all }, &flint));
        let curve = Reflectance::of_index(1.5);
        for glass in [
            Dielectric { alpha: 0.2, ..plain },
            Dielectric { reflectance: Some(curve), ..plain },
            Dielectric { reflection: Some(Vec3::ONE), ..plain },
        ] {
            assert!(asks_of_ways(&all, &[plain, glass]), "{glass:?}");
        }
        for limits in [
            PathLimits { cutoff: 0.01, ..PathLimits::DEFAULT },
            PathLimits { reflections: 3, ..PathLimits::DEFAULT },
            PathLimits { refractions: 3, ..PathLimits::DEFAULT },
        ] {
            assert!(asks_of_ways(&RayParams { limits, ..all }, &[plain]), "{limits:?}");
            assert!(!asks_of_ways(&RayParams { limits, ..all }, &[]), "no glass");
        }
    }
}
