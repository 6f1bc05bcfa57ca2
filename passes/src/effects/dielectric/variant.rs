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
    /// In corrected fidelity, with glass as each material says and a background.
    Bodies,
}

impl Variant {
    /// The programs that have a variant for bodies. `reflection` knows a background anyway, and the others see no glass.
    pub const OF_BODIES: [RayProgram; 2] = [RayProgram::Refraction, RayProgram::Final];

    /// The one that a job needs.
    #[must_use]
    pub fn of(job: &RayJob<'_>) -> Self {
        let asks = !job.dielectrics.is_empty() || job.beyond != Vec3::ZERO;
        let has = Self::OF_BODIES.contains(&job.program);
        if asks && has && job.fidelity == Fidelity::Corrected { Self::Bodies } else { Self::Panes(job.fidelity) }
    }
}

/// Refuses what device programs lack of the glass that a pass finds: bodies that bend colours apart, rough surfaces, paths that are
/// cut off, and light that spheres focus.
///
/// # Errors
/// [`BackendError::Unsupported`], with what would help.
pub fn check_glass(backend: &'static str, params: &RayParams, dielectrics: &[Dielectric]) -> Result<(), BackendError> {
    let disperses = params.wavelengths > 1 && dielectrics.iter().any(|dielectric| dielectric.spread > 0.0);
    let rough = dielectrics.iter().any(|dielectric| dielectric.alpha > 0.0);
    let cut = params.limits.cut() && !dielectrics.is_empty();
    let focuses = params.shadow == GlassShadow::Caustic && !dielectrics.is_empty();
    let (what, help) = match () {
        () if disperses => ("glass that bends colours apart", "set wavelengths=1 on the pass, use --backend cpu"),
        () if rough => ("rough glass", "use --backend cpu"),
        () if cut => {
            ("glass whose paths are cut off", "leave out cutoff, reflections and refractions, use --backend cpu")
        }
        () if focuses => ("shadow=caustic", "set shadow=straight on the pass, use --backend cpu"),
        () => return Ok(()),
    };
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
        assert!(check_glass("cuda", &all, &[]).is_ok() && check_glass("cuda", &all, &[plain]).is_ok());
        let flint = [plain, Dielectric { spread: 0.02, ..plain }];
        let refused = check_glass("wgpu", &all, &flint).expect_err("it disperses").to_string();
        assert!(refused.contains("bends colours apart") && refused.contains("wavelengths=1"), "{refused}");
        assert!(check_glass("wgpu", &RayParams { wavelengths: 1, ..all }, &flint).is_ok());
        let frosted = check_glass("optix", &all, &[Dielectric { alpha: 0.2, ..plain }]).expect_err("it is rough");
        assert!(frosted.to_string().contains("rough glass"), "{frosted}");
        let caustic = RayParams { shadow: GlassShadow::Caustic, ..all };
        let focused = check_glass("cuda", &caustic, &[plain]).expect_err("it focuses").to_string();
        assert!(focused.contains("shadow=caustic") && focused.contains("shadow=straight"), "{focused}");
        assert!(check_glass("cuda", &caustic, &[]).is_ok());
        let limits = PathLimits { cutoff: 0.01, ..PathLimits::DEFAULT };
        let cut = check_glass("wgpu", &RayParams { limits, ..all }, &[plain]).expect_err("it cuts off").to_string();
        assert!(cut.contains("cut off") && cut.contains("leave out cutoff"), "{cut}");
    }
}
