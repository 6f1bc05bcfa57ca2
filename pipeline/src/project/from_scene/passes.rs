//! Render targets and passes: the G-buffer, the passes that read it, and the window.

use super::Effects;
use crate::glass::{GlassRule, GlassShadow};
use crate::image::PixelFormat;
use crate::programs::{RasterProgram, RayParams, RayProgram, Writes};
use crate::project::{
    Channel, ChannelRef, Clears, ColorMap, EffectPass, MaterialPattern, Pass, PassKind, PhongMap, Pipeline, QuadPass,
    QuadSource, RasterPass, RayPass, RenderTarget, TextureMap,
};
use crate::raster_effects::{EffectParams, EffectProgram};
use glam::{Vec3, Vec4};

/// Name of the only material library.
const LIBRARY: &str = "Targets";
/// The colour with which the report marks glass; no other surface has it.
const GLASS_MARK: Vec4 = Vec4::new(1.0, 0.0, 1.0, 0.0);

/// A pass that reads the G-buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// By tracing rays.
    Rays(RayProgram),
    /// By rasterisation.
    Raster(EffectProgram),
}

impl Step {
    fn name(self) -> &'static str {
        match self {
            Self::Rays(program) => program.info().stem,
            Self::Raster(program) => program.info().name,
        }
    }

    /// Whether it is a raster effect that reads a light.
    pub fn is_lit_raster(&self) -> bool {
        matches!(self, Self::Raster(program) if program.info().lit)
    }

    /// Whether the pass writes a factor for the colour instead of a colour.
    fn is_factor(self) -> bool {
        let program = match self {
            Self::Rays(program) => program,
            Self::Raster(program) => program.info().counterpart,
        };
        program.info().writes == Writes::Share
    }
}

/// The passes for a set of effects. Shadows together with another effect take the program `final`, which can compute all of them;
/// glass and occlusion without shadows are two passes.
pub(super) fn steps(effects: Effects) -> Vec<Step> {
    let Effects { shadows, occlusion, glass } = effects;
    let programs: &[RayProgram] = match (shadows, occlusion, glass) {
        (false, false, false) => &[],
        (true, false, false) => &[RayProgram::DeferredShadows],
        (false, true, false) => &[RayProgram::Ssao],
        (false, false, true) => &[RayProgram::Refraction],
        (false, true, true) => &[RayProgram::Refraction, RayProgram::Ssao],
        (true, true, _) | (true, _, true) => &[RayProgram::Final],
    };
    programs.iter().map(|program| Step::Rays(*program)).collect()
}

/// Common properties of a project's passes. The project has one scene, one viewport and one camera in use, each the
/// first of its list.
pub(super) struct Common<'a> {
    /// Size of the window and of the targets, pixels.
    pub window: [u32; 2],
    /// Colour where nothing is drawn.
    pub background: Vec3,
    /// Indices of the lights.
    pub lights: Vec<usize>,
    /// Names of the materials that are glass.
    pub glass: &'a [String],
    /// Longest distance to an occluder.
    pub radius: f32,
    /// Whether the program `final` computes occlusion.
    pub occlusion: bool,
    /// Whether glass is treated as its materials say (`glass=auto`), also in front of the background, with coloured shadows
    /// (`shadow=straight`) and textures filtered at hits. If not, all glass is treated as the report's panes.
    pub bodies: bool,
}

impl Common<'_> {
    /// The targets and the pipeline. Passes have the names of the report's projects, so that the report's commands work:
    /// `pass1` draws, `pass2` (and `pass3`) compute, `pass5` fills the window.
    pub fn pipeline(&self, steps: &[Step]) -> (Vec<RenderTarget>, Pipeline) {
        let channel = |name: &str| Channel { name: name.to_owned(), format: PixelFormat::Rgba32Float, depth: false };
        let target = |name: &str, channels: Vec<Channel>| RenderTarget {
            buffer: None,
            contents: None,
            library: LIBRARY.to_owned(),
            name: name.to_owned(),
            size: self.window,
            clear_color: self.background.extend(1.0),
            channels,
        };
        let mut targets = vec![target("deferred", ["color", "pos", "norm"].map(channel).into())];
        let pass = |name: String, target: Option<usize>, kind: PassKind| {
            let place = format!("pass `{name}` of a project made from scene files");
            Pass { name, place, viewport: Some(0), target, clears: Clears::default(), scripted: None, kind }
        };
        let drawn = RasterPass {
            frusta: Vec::new(),
            scenes: vec![0],
            instances: 1,
            camera: 0,
            lights: self.lights.clone(),
            program: RasterProgram::Deferred,
            colors: if steps.is_empty() { Vec::new() } else { self.marks() },
            shaders: Vec::new(),
        };
        let mut passes = vec![pass("pass1".to_owned(), Some(0), PassKind::Raster(drawn))];
        let mut color = ChannelRef { target: 0, channel: 0 };
        let mut factor = None;
        for (index, step) in steps.iter().enumerate() {
            let written = ChannelRef { target: targets.len(), channel: 0 };
            targets.push(target(step.name(), vec![channel(step.name())]));
            let kind = match step {
                Step::Rays(program) => PassKind::Ray(self.rays(*program, color)),
                Step::Raster(program) => PassKind::Effect(self.effect(*program, color)),
            };
            passes.push(pass(format!("pass{}", index + 2), Some(written.target), kind));
            if step.is_factor() {
                factor = Some(written);
            } else {
                color = written;
            }
        }
        let source = match factor {
            Some(factor) => QuadSource::Combine { color, factor },
            None => QuadSource::Show(color),
        };
        passes.push(pass("pass5".to_owned(), None, PassKind::Quad(QuadPass::new(source))));
        (targets, Pipeline { name: "deferred".to_owned(), camera: Some(0), passes, broken: None })
    }

    fn patterns(&self) -> Vec<MaterialPattern> {
        self.glass.iter().cloned().map(MaterialPattern::Named).collect()
    }

    /// Colours that mark glass in the G-buffer: the report's programs recognise glass by them.
    fn marks(&self) -> Vec<ColorMap> {
        let mark = |to| ColorMap {
            to,
            diffuse: Some(GLASS_MARK),
            emission: Some(GLASS_MARK),
            phong: PhongMap::default(),
            texture: TextureMap::Kept,
        };
        self.patterns().into_iter().map(mark).collect()
    }

    fn rays(&self, program: RayProgram, color: ChannelRef) -> RayPass {
        let info = program.info();
        let mut params = RayParams { radius: self.radius, ..RayParams::default() };
        if program == RayProgram::Final && !self.occlusion {
            params.samples = 0;
        }
        if self.bodies && !self.glass.is_empty() {
            params.glass = GlassRule::Auto;
            params.shadow = GlassShadow::Straight;
        }
        let calls = |proc: &str| info.procs.iter().any(|known| known.proc == proc);
        let patterns = |called: bool| if called { self.patterns() } else { Vec::new() };
        RayPass {
            scenes: vec![0],
            camera: 0,
            lights: if info.globals.is_empty() { Vec::new() } else { self.lights.clone() },
            program,
            params: as_written(params, info.params),
            position: read(info.buffers, "pos_buffer", 1),
            normal: read(info.buffers, "norm_buffer", 2),
            color: info.buffers.contains(&"color_buffer").then_some(color),
            colors: Vec::new(),
            glass: patterns(calls("closest_hit_glass")),
            shadow_glass: patterns(calls("any_hit_shadow_glass")),
            from_camera: None,
        }
    }

    fn effect(&self, program: EffectProgram, color: ChannelRef) -> EffectPass {
        let info = program.info();
        let mut params = EffectParams::default();
        if info.params.contains(&"radius") {
            params.radius = self.radius;
        }
        EffectPass {
            scenes: vec![0],
            camera: 0,
            lights: if info.lit { self.lights.clone() } else { Vec::new() },
            program,
            params,
            position: read(info.buffers, "pos_buffer", 1),
            normal: read(info.buffers, "norm_buffer", 2),
            color: info.buffers.contains(&"color_buffer").then_some(color),
            colors: Vec::new(),
            glass: if info.glass { self.patterns() } else { Vec::new() },
        }
    }
}

/// A channel of the G-buffer, if the program reads it.
fn read(buffers: &[&str], name: &str, channel: usize) -> Option<ChannelRef> {
    buffers.contains(&name).then_some(ChannelRef { target: 0, channel })
}

/// The parameters that a program reads; others have their defaults, as after reading a project file.
fn as_written(params: RayParams, names: &[&str]) -> RayParams {
    let defaults = RayParams::default();
    RayParams {
        samples: if names.contains(&"samples") { params.samples } else { defaults.samples },
        radius: if names.contains(&"radius") { params.radius } else { defaults.radius },
        glass: if names.contains(&"glass") { params.glass } else { defaults.glass },
        background: if names.contains(&"background") { params.background } else { defaults.background },
        shadow: if names.contains(&"shadow") { params.shadow } else { defaults.shadow },
        ..defaults
    }
}
