//! Inputs of ray passes.

use super::light::Light;
use super::shade::Shade;
use super::view::{Lamp, PixelCone, Sun, View};
use crate::camera_programs::SurfaceKind;
use crate::glass::Dielectric;
use crate::programs::{Fidelity, Query, RayParams, RayProgram, TextureLod};
use crate::scene::RenderScene;
use glam::Vec3;

/// Further inputs of programs whose rays start at the camera.
#[derive(Debug, Clone, Copy)]
pub struct FromCamera<'a> {
    /// The camera, with perspective.
    pub view: View,
    /// Width and height of the whole picture, in pixels. A job may cover only a part of it.
    pub picture: [u32; 2],
    /// The point light of the pass, if it has one; otherwise the light is [`RayJob::sun`].
    pub lamp: Option<Lamp>,
    /// How rays behave at each material, by material index.
    pub surfaces: &'a [SurfaceKind],
}

/// One ray pass. All images have the same size.
#[derive(Debug, Clone, Copy)]
pub struct RayJob<'a> {
    /// The scene to trace.
    pub scene: &'a RenderScene,
    /// The program that runs per pixel.
    pub program: RayProgram,
    /// Constants of the program.
    pub params: RayParams,
    /// Corrected programs, or those of the report.
    pub fidelity: Fidelity,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Camera position in world space.
    pub eye: Vec3,
    /// The cone of rays through a pixel, for texture lookups that are filtered by ray cones.
    pub cone: PixelCone,
    /// The single directional light, for programs that read it; `None` if the pass has none.
    pub sun: Option<Sun>,
    /// The lights that replace [`Self::sun`] if the pass has several lights or a light with a position; otherwise empty.
    pub lights: &'a [Light],
    /// Column and row of the job's top left pixel in the whole picture. Random numbers depend on a pixel's place in the whole
    /// picture.
    pub origin: [u32; 2],
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// World position, and light cosine in the fourth component. Empty if the program does not read it.
    pub position: &'a [[f32; 4]],
    /// Shading normal. Empty if the program does not read it.
    pub normal: &'a [[f32; 4]],
    /// Shaded colour. Empty if the program does not read it.
    pub color: &'a [[f32; 4]],
    /// Triangle ids. Empty in thesis fidelity and if the program traces no rays.
    pub triangle: &'a [u32],
    /// If set, the G-buffer lies in shared memory, is complete once its semaphore reaches this value, and the slices above are
    /// empty.
    pub shared: Option<u64>,
    /// Linear colour of rays that miss the scene; black in thesis fidelity.
    pub beyond: Vec3,
    /// Glass properties by material index, for `glass=auto` in corrected fidelity. Empty: all glass is thin panes with the pass's
    /// index of refraction.
    pub dielectrics: &'a [Dielectric],
    /// Colours that hits are shaded with, by material index.
    pub shades: &'a [Shade],
    /// Whether rays bounce on the material (`closest_hit_glass`), by material index.
    pub glass: &'a [bool],
    /// Whether shadow rays pass through the material, dimmed (`any_hit_shadow_glass`), by material index.
    pub shadow_glass: &'a [bool],
    /// Inputs of a program whose rays start at the camera; `None` for programs that start from a G-buffer.
    pub from_camera: Option<FromCamera<'a>>,
}

impl RayJob<'_> {
    /// How the job selects the mip level of textures at hits. It is level 0 unless all of these hold: the program supports ray cones and
    /// its parameters ask for them, fidelity is corrected, the scene has textures, and glass or rays from the camera show them.
    #[must_use]
    pub fn texture_lod(&self) -> TextureLod {
        let asks = self.fidelity == Fidelity::Corrected
            && !self.scene.textures.is_empty()
            && (self.from_camera.is_some() || self.glass.contains(&true))
            && self.program.asks_of_cones(&self.params).is_some();
        if asks { self.params.texture_lod } else { TextureLod::Zero }
    }
}

/// Rays in host memory, each traced for one hit. Every surface stops them, cut-outs and glass as well.
#[derive(Debug, Clone, Copy)]
pub struct IntersectionJob<'a> {
    /// The scene, for which a structure was built.
    pub scene: &'a RenderScene,
    /// Two vectors for each ray: its origin in the world and, as fourth component, the least distance; its direction and, as fourth
    /// component, the greatest distance. Distances are multiples of the direction's length, which is not 0. A ray with a number that is
    /// not finite (except for the greatest distance) hits nothing.
    pub rays: &'a [[[f32; 4]; 2]],
    /// Which hit of a ray is returned.
    pub query: Query,
}

/// What [`RayBackend::intersect`](super::RayBackend::intersect) writes for a ray without a hit: the distance -1, and the bits of the
/// integer -1 as the id.
pub const NO_HIT: [f32; 4] = [-1.0, f32::from_bits(u32::MAX), 0.0, 0.0];
