//! The jobs of the reference renderer.

use super::camera::Camera;
use curitiba_pipeline::backend::{Light, Shade, Sun};
use curitiba_pipeline::glass::{Dielectric, GlassShadow};
use curitiba_pipeline::image::PixelFormat;
use curitiba_pipeline::programs::{Fresnel, RayParams, RayProgram};
use curitiba_pipeline::scene::{RenderScene, Sphere};
use glam::{DVec3, DVec4};
use std::ops::Range;

/// The materials and the light as a pass sees them. All slices are by material index.
#[derive(Debug, Clone)]
pub struct Look<'a> {
    /// Appearance of the materials.
    pub shades: &'a [Shade],
    /// Materials that rays mirror or refract at; in raster passes none is marked.
    pub glass: &'a [bool],
    /// Materials that shadow rays pass through; in raster passes none is marked.
    pub shadow_glass: &'a [bool],
    /// Properties of glass, where the materials decide about it (`glass=auto`); else empty, and all glass is the report's panes.
    pub dielectrics: &'a [Dielectric],
    /// The directional light; `None` if there is none.
    pub sun: Option<Sun>,
    /// Several lights, or a light with a place, in place of [`Self::sun`]; empty if [`Self::sun`] is used.
    pub lights: Vec<Light>,
}

/// The view of the camera: the one raster pass of a picture.
#[derive(Debug, Clone)]
pub struct Seen<'a> {
    /// The scene that is drawn.
    pub scene: &'a RenderScene,
    /// The camera.
    pub camera: Camera,
    /// Materials and light.
    pub look: Look<'a>,
    /// By material: whether its back faces are culled; empty if none are.
    pub culled: &'a [bool],
    /// The value where nothing is drawn.
    pub clear_color: DVec4,
}

/// A ray pass.
#[derive(Debug, Clone)]
pub struct Traced<'a> {
    /// The program of the pass.
    pub program: RayProgram,
    /// Its parameters.
    pub params: RayParams,
    /// Materials and light as its rays see them.
    pub look: Look<'a>,
    /// The colour of rays that leave the scene.
    pub beyond: DVec3,
}

impl Traced<'_> {
    /// Why the reference renderer cannot compute a pass of this program, and what would help; `None` where it can. `look` is how the pass sees
    /// the materials, and `spheres` are those of the scene.
    #[must_use]
    pub fn unsupported(program: RayProgram, params: &RayParams, look: &Look<'_>, spheres: &[Sphere]) -> Option<String> {
        let known = [
            RayProgram::Dummy,
            RayProgram::DeferredShadows,
            RayProgram::Reflection,
            RayProgram::Refraction,
            RayProgram::Ssao,
            RayProgram::Final,
        ];
        let info = program.info();
        if !known.contains(&program) {
            return Some(format!("`{}`, whose rays start at the camera, has no reference of its picture", info.stem));
        }
        let is_polarised = matches!(params.fresnel, Fresnel::S | Fresnel::P) && info.reads("fresnel");
        if is_polarised && look.glass.contains(&true) {
            let weights = params.fresnel.name();
            return Some(format!(
                "polarised light (fresnel={weights}) has no reference of the picture: set fresnel=exact"
            ));
        }
        let is_ruled = matches!(params.shadow, GlassShadow::Straight | GlassShadow::Caustic) && info.reads("shadow");
        // The rule matters only where light may pass glass.
        if !(is_ruled && look.shadow_glass.contains(&true)) {
            return None;
        }
        let rule = params.shadow.name();
        if look.dielectrics.is_empty() {
            return Some(format!(
                "light that falls through the report's panes by shadow={rule} has no reference of the picture: set shadow=report, or \
                 glass=auto"
            ));
        }
        let focuses =
            |sphere: &Sphere| look.dielectrics.get(sphere.material as usize).is_some_and(Dielectric::bends_light);
        let what = if params.shadow == GlassShadow::Caustic && spheres.iter().any(focuses) {
            "exact spheres focus (shadow=caustic)".to_owned()
        } else if program.photons(params) > 0 && look.dielectrics.iter().any(Dielectric::bends_light) {
            format!("photons bring (photons={})", params.photons)
        } else {
            return None;
        };
        Some(format!("light that {what} has no reference of the picture: set shadow=straight"))
    }
}

/// A channel of a pass, as a function of the place in the picture.
#[derive(Debug, Clone)]
pub enum Value<'a> {
    /// The same value everywhere.
    Constant(DVec4),
    /// The colour that the raster pass draws.
    Drawn,
    /// The result of a ray pass, and the colour that the pass reads; black if it reads none.
    Traced(Box<Traced<'a>>, Box<Value<'a>>),
    /// The first value times the `x` of the second, or channel by channel where the second is the share of [several lights](Value::is_colored).
    Product(Box<Value<'a>>, Box<Value<'a>>),
    /// A value as the format of a target holds it: byte formats clamp it to 0..1. It is not rounded.
    Held(PixelFormat, Box<Value<'a>>),
}

impl Value<'_> {
    /// Whether the value is a share of light that differs by colour.
    #[must_use]
    pub fn is_colored(&self) -> bool {
        match self {
            Self::Held(PixelFormat::R8Unorm | PixelFormat::R32Float | PixelFormat::Rg32Float, _) => false,
            Self::Held(_, value) => value.is_colored(),
            Self::Traced(pass, _) => pass.program == RayProgram::DeferredShadows && !pass.look.lights.is_empty(),
            Self::Constant(_) | Self::Drawn | Self::Product(..) => false,
        }
    }
}

/// A picture to render.
#[derive(Debug, Clone)]
pub struct Job<'a> {
    /// The view of the camera.
    pub seen: Seen<'a>,
    /// The value that the picture shows.
    pub value: Value<'a>,
    /// Pixels in a row, and number of rows.
    pub size: [u32; 2],
    /// Indices of the samples that each of the two estimates takes in every pixel; at least one.
    pub samples: Range<u32>,
}
