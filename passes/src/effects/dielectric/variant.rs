//! What device programs know of glass: they exist in variants, so that panes do not pay for what bodies take.

use curitiba_pipeline::backend::{BackendError, RayJob};
use curitiba_pipeline::glass::{Dielectric, GlassShadow};
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
use glam::Vec3;

/// How a device program was written for a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Variant {
    /// In a fidelity, with the report's panes.
    Panes(Fidelity),
    /// In corrected fidelity, with smooth glass as each material says, and a background or a sky.
    Bodies,
    /// The same with glass that is rough, bends colours apart or has a reflectance of its own, and with paths that are cut off.
    Ways,
}

impl Variant {
    /// The programs that have variants for bodies. `reflection` knows a background anyway, and the others see no glass.
    pub const OF_BODIES: [RayProgram; 2] = [RayProgram::Refraction, RayProgram::Final];

    /// The one that a job needs.
    #[must_use]
    pub fn of(job: &RayJob<'_>) -> Self {
        let asks = !job.dielectrics.is_empty() || job.beyond != Vec3::ZERO || !job.scene.geometry.sky.is_empty();
        let has = Self::OF_BODIES.contains(&job.program);
        match () {
            () if !(asks && has && job.fidelity == Fidelity::Corrected) => Self::Panes(job.fidelity),
            () if asks_of_ways(&job.params, job.dielectrics).is_some() => Self::Ways,
            () => Self::Bodies,
        }
    }

    /// Whether it knows bodies.
    #[must_use]
    pub fn knows_bodies(self) -> bool {
        matches!(self, Self::Bodies | Self::Ways)
    }
}

/// What a pass asks that smooth glass of one index and whole paths do not answer: what it is, and what would help.
fn asks_of_ways(params: &RayParams, dielectrics: &[Dielectric]) -> Option<(&'static str, &'static str)> {
    let disperses = params.wavelengths > 1 && dielectrics.iter().any(|dielectric| dielectric.spread > 0.0);
    let rough = dielectrics.iter().any(|dielectric| dielectric.alpha > 0.0);
    let own = dielectrics.iter().any(|dielectric| dielectric.reflectance.is_some() || dielectric.reflection.is_some());
    let cut = params.limits.cut() && !dielectrics.is_empty();
    match () {
        () if disperses => Some(("glass that bends colours apart", "set wavelengths=1 on the pass, use --backend cpu")),
        () if own => Some(("glass with a reflectance or a colour of reflections of its own", "use --backend cpu")),
        () if rough => Some(("rough glass", "use --backend cpu")),
        () if cut => {
            Some(("glass whose paths are cut off", "leave out cutoff, reflections and refractions, use --backend cpu"))
        }
        () => None,
    }
}

/// Refuses what device programs lack of the glass that a pass finds where they know no [`Variant::Ways`]: light that spheres focus, bodies that bend
/// colours apart, rough surfaces, reflectances of their own, and paths that are cut off.
///
/// # Errors
/// [`BackendError::Unsupported`], with what would help.
pub fn check_glass(
    backend: &'static str,
    knows_ways: bool,
    params: &RayParams,
    dielectrics: &[Dielectric],
) -> Result<(), BackendError> {
    if knows_ways {
        return Ok(());
    }
    let focuses = params.shadow == GlassShadow::Caustic && !dielectrics.is_empty();
    let focused = focuses.then_some(("shadow=caustic", "set shadow=straight on the pass, use --backend cpu"));
    let Some((what, help)) = asks_of_ways(params, dielectrics).or(focused) else { return Ok(()) };
    let why = format!(
        "its programs know smooth glass of one index, and shadows of straight light; {help}, or allow it with --fallback cpu"
    );
    Err(BackendError::Unsupported { backend, what: what.to_owned(), why })
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::glass::PathLimits;

    #[test]
    fn what_devices_lack_is_refused_by_name() {
        let (plain, all) = (Dielectric::default(), RayParams::default());
        assert!(check_glass("cuda", false, &all, &[]).is_ok() && check_glass("cuda", false, &all, &[plain]).is_ok());
        let flint = [plain, Dielectric { spread: 0.02, ..plain }];
        let refused = check_glass("cuda", false, &all, &flint).expect_err("it disperses").to_string();
        assert!(refused.contains("bends colours apart") && refused.contains("wavelengths=1"), "{refused}");
        assert!(check_glass("cuda", false, &RayParams { wavelengths: 1, ..all }, &flint).is_ok());
        let frosted =
            check_glass("optix", false, &all, &[Dielectric { alpha: 0.2, ..plain }]).expect_err("it is rough");
        assert!(frosted.to_string().contains("rough glass"), "{frosted}");
        let caustic = RayParams { shadow: GlassShadow::Caustic, ..all };
        let focused = check_glass("cuda", false, &caustic, &[plain]).expect_err("it focuses").to_string();
        assert!(focused.contains("shadow=caustic") && focused.contains("shadow=straight"), "{focused}");
        assert!(check_glass("cuda", false, &caustic, &[]).is_ok());
        let limits = PathLimits { cutoff: 0.01, ..PathLimits::DEFAULT };
        let cut =
            check_glass("cuda", false, &RayParams { limits, ..all }, &[plain]).expect_err("it cuts off").to_string();
        assert!(cut.contains("cut off") && cut.contains("leave out cutoff"), "{cut}");
    }

    #[test]
    fn who_follows_all_ways_knows_focused_light_too() {
        let glass = [Dielectric { spread: 0.02, alpha: 0.2, ..Dielectric::default() }];
        let limits = PathLimits { cutoff: 0.01, ..PathLimits::DEFAULT };
        let params = RayParams { limits, ..RayParams::default() };
        assert!(check_glass("wgpu", true, &params, &glass).is_ok());
        let caustic = RayParams { shadow: GlassShadow::Caustic, ..params };
        assert!(check_glass("wgpu", true, &caustic, &glass).is_ok());
        assert!(check_glass("cuda", false, &caustic, &glass).is_err(), "control");
    }
}
