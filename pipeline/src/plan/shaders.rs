//! Own shaders of projects: which passes use them, what they read of scenes, and what they cannot be combined with.

use super::{Plan, PlanError, PlannedPass, Work};
use crate::backend::{Attachments, BackendError, Rasteriser, Rect};
use crate::color::ColorSpace;
use crate::glsl::Attribute;
use crate::programs::Fidelity;
use crate::project::{Camera, OwnShader, Pass, PassKind, RasterPass, ShaderTexture};
use crate::scene::Needs;

impl Plan {
    /// Whether a planned pass draws with own shaders of the project.
    #[must_use]
    pub fn draws_own(&self, planned: &PlannedPass) -> bool {
        self.own_raster(planned).is_some() || self.own_shader(planned).is_some()
    }

    /// The own shader of a quad or compute pass.
    fn own_shader(&self, planned: &PlannedPass) -> Option<&OwnShader> {
        match &planned.work {
            Work::Quad { .. } | Work::Compute => self.pass(planned).kind.shader(),
            _ => None,
        }
    }

    /// Adds the decision which shader a quad or compute pass runs.
    pub(super) fn explain_shader(&mut self, pass: &Pass, shader: &OwnShader) {
        if pass.scripted.as_ref().is_some_and(|scripted| scripted.run > 1) {
            return;
        }
        let why = format!("GLSL of the project, named at {}", shader.place);
        self.decide(format!("own shader `{}` in pass `{}`", shader.name, pass.name), true, why);
    }

    fn own_raster(&self, planned: &PlannedPass) -> Option<&RasterPass> {
        match (&planned.work, &self.pass(planned).kind) {
            (Work::Raster { .. }, PassKind::Raster(raster)) if !raster.shaders.is_empty() => Some(raster),
            _ => None,
        }
    }

    /// Whether a planned pass draws everything with own shaders.
    pub(super) fn draws_own_alone(&self, planned: &PlannedPass) -> bool {
        self.own_raster(planned).is_some_and(RasterPass::is_all_own)
    }

    /// The contents of scenes that own shaders read.
    pub(super) fn needs_of_shaders(&self) -> Needs {
        let mut needs = Needs::NOTHING;
        for map in self.passes.iter().filter_map(|planned| self.own_raster(planned)).flat_map(|raster| &raster.shaders)
        {
            let reads = |attribute| map.shader.program.attributes.contains(&attribute);
            // Tangents are computed from normals and texture coordinates.
            needs.tangents |= reads(Attribute::Tangent);
            needs.normals |= reads(Attribute::Normal) || needs.tangents;
            needs.textures |=
                needs.tangents || reads(Attribute::TexCoord) || map.shader.textures.contains(&ShaderTexture::Material);
        }
        needs
    }

    /// Adds the decisions which shaders a pass draws with; fails if they are combined with something unsupported.
    pub(super) fn check_shaders(
        &mut self,
        pass: &Pass,
        raster: &RasterPass,
        live: Attachments,
    ) -> Result<(), PlanError> {
        for map in raster.shaders.iter().rev() {
            let why = format!("GLSL of the project, named at {}", map.shader.place);
            self.decide(format!("own shader `{}` in pass `{}`", map.shader.name, pass.name), true, why);
        }
        let Some(map) = raster.shaders.first() else { return Ok(()) };
        let refused = |why: &str, help: &str| {
            let place = &map.shader.place;
            Err(PlanError::new(format!("{place}: pass `{}` draws with own shaders, and {why}", pass.name), help))
        };
        if live.triangle {
            return refused(
                "a ray pass reads its triangle ids, which they do not write",
                "let a material `deferred` draw what rays start from, or use --fidelity thesis for other programs",
            );
        }
        if self.settings.fidelity == Fidelity::Thesis {
            return refused("in thesis fidelity normals are in model space", "use --fidelity corrected");
        }
        if self.display.space == ColorSpace::Linear {
            return refused("colours are linear light, which they do not know of", "use --color report");
        }
        Ok(())
    }

    /// The name of the first pass with own shaders, if the rasteriser cannot draw with them, and the error with a remedy.
    #[must_use]
    pub fn undrawn_shaders(&self, raster: &dyn Rasteriser) -> Option<(String, BackendError)> {
        self.first_refused(|planned| {
            let drawn = self.own_raster(planned).and_then(|own| own.shaders.first()).map(|map| &*map.shader);
            let own = drawn.or_else(|| self.own_shader(planned)).filter(|_| !raster.draws_shaders())?;
            Some(BackendError::no_shaders(raster.name(), &own.place))
        })
    }

    /// The index of the camera of a raster pass, after `--camera`.
    pub(crate) fn camera_of(&self, raster: &RasterPass) -> usize {
        let chosen = self.settings.camera.as_deref().and_then(|name| self.project.camera(name).ok());
        self.seen_from(chosen, raster.camera)
    }

    /// The camera of a pass, after `--camera`. Depth maps keep the camera of their light.
    pub(super) fn seen_from(&self, chosen: Option<usize>, own: usize) -> usize {
        chosen.filter(|_| !self.project.is_of_light(own)).unwrap_or(own)
    }

    /// View and viewport of a camera in the window, relative to the scenes' origin.
    pub(crate) fn view_of(&self, camera: &Camera) -> (super::View, Rect) {
        let viewport = camera.viewport.map(|viewport| &self.project.viewports[viewport]);
        let rect = super::rectangle(viewport, self.window);
        (super::view(camera, rect, self.origin), rect)
    }
}
