//! Passes that are switched off.

use super::{Plan, PlanError};
use crate::diagnostic::valid_names;
use crate::programs::Writes;
use crate::project::{ChannelRef, Pass, PassKind, Project};

/// What a ray or effect pass that is switched off writes instead of its picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Instead {
    /// A copy of the colour channel that the pass would have read, without the pass's contribution.
    Copy(ChannelRef),
    /// A constant: 1 for shares of light, as without occluders; opaque black for colours.
    Fill([f32; 4]),
}

/// Fails if a name in [`Settings::off`](super::Settings::off) is no pass.
pub(super) fn check_names(project: &Project, pipeline: usize, off: &[String]) -> Result<(), PlanError> {
    let passes = &project.pipelines[pipeline].passes;
    match off.iter().find(|name| passes.iter().all(|pass| pass.name != **name)) {
        None => Ok(()),
        Some(name) => Err(PlanError::new(
            format!("there is no pass `{name}` that could be switched off"),
            valid_names(name, passes.iter().map(|pass| pass.name.as_str())),
        )),
    }
}

impl Plan {
    /// Whether a pass is switched off.
    pub(super) fn is_off(&self, pass: &Pass) -> bool {
        self.settings.off.contains(&pass.name)
    }
}

/// The substitute for a pass; `None` for raster, quad, intersection and compute passes, which leave their targets unchanged when switched off.
pub(super) fn instead(pass: &Pass) -> Option<Instead> {
    let color = match &pass.kind {
        PassKind::Ray(ray) => ray.color,
        PassKind::Effect(effect) => effect.color,
        PassKind::Raster(_) | PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => None,
    };
    Some(match (pass.kind.writes()?, color) {
        (Writes::Color, Some(color)) => Instead::Copy(color),
        (Writes::Color, None) => Instead::Fill([0.0, 0.0, 0.0, 1.0]),
        (Writes::Share, _) => Instead::Fill([1.0; 4]),
    })
}
