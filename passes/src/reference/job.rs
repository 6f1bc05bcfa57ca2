//! What is asked of the reference renderer.

use super::camera::Camera;
use curitiba_pipeline::backend::{Shade, Sun};
use curitiba_pipeline::glass::GlassShadow;
use curitiba_pipeline::image::PixelFormat;
use curitiba_pipeline::programs::{RayParams, RayProgram};
use curitiba_pipeline::scene::RenderScene;
use glam::{DVec3, DVec4};
use std::ops::Range;

/// How a pass sees the materials and the light. All slices are by material index.
#[derive(Debug, Clone, Copy)]
pub struct Look<'a> {
    /// What materials look like.
    pub shades: &'a [Shade],
    /// Those on which rays bounce; for raster passes none.
    pub glass: &'a [bool],
    /// Those through which shadow rays pass; for raster passes none.
    pub shadow_glass: &'a [bool],
    /// The light.
    pub sun: Option<Sun>,
}

/// What the camera sees: the one raster pass of a picture.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// What is drawn.
    pub scene: &'a RenderScene,
    /// From where.
    pub camera: Camera,
    /// How it looks.
    pub look: Look<'a>,
    /// By material: whether triangles are left out that are seen from behind; empty where none are.
    pub culled: &'a [bool],
    /// Where nothing is.
    pub clear_color: DVec4,
}

/// A ray pass.
#[derive(Debug, Clone, Copy)]
pub struct Traced<'a> {
    /// Its program.
    pub program: RayProgram,
    /// Its constants.
    pub params: RayParams,
    /// How its rays see materials and light.
    pub look: Look<'a>,
    /// What rays show that leave the scene.
    pub beyond: DVec3,
}

impl Traced<'_> {
    /// Why the reference renderer does not know what the pass computes, and what would help; `None` where it does.
    #[must_use]
    pub fn unsupported(program: RayProgram, params: &RayParams, has_bodies: bool) -> Option<String> {
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
        if info.sun_samples(params) > 0 {
            return Some("soft shadows have no reference of the picture: set sun=0".to_owned());
        }
        if has_bodies && info.reads("glass") {
            return Some(
                "glass as its materials say (glass=auto) has no reference of the picture: set glass=pane".to_owned(),
            );
        }
        if matches!(params.shadow, GlassShadow::Straight | GlassShadow::Caustic) && info.reads("shadow") {
            let rule = params.shadow.name();
            return Some(format!(
                "light that falls through glass by shadow={rule} has no reference of the picture: set shadow=report"
            ));
        }
        None
    }
}

/// A channel of a pass as a function of a place of the picture.
#[derive(Debug, Clone)]
pub enum Value<'a> {
    /// The same everywhere.
    Constant(DVec4),
    /// The colour that the raster pass draws.
    Drawn,
    /// What a ray pass writes, and the colour that it reads; black where it reads none.
    Traced(Traced<'a>, Box<Value<'a>>),
    /// The first times the `x` of the second.
    Product(Box<Value<'a>>, Box<Value<'a>>),
    /// What the format of a target leaves of a value: bytes cut it at 0 and 1. It is not rounded.
    Held(PixelFormat, Box<Value<'a>>),
}

/// A picture.
#[derive(Debug, Clone)]
pub struct Job<'a> {
    /// What the camera sees.
    pub seen: Seen<'a>,
    /// What of it the picture shows.
    pub value: Value<'a>,
    /// Pixels a row, and rows.
    pub size: [u32; 2],
    /// Which samples of every pixel each of the two estimates takes: at least one.
    pub samples: Range<u32>,
}
