//! The interface between the executor and its engines: rasterisers ([`Rasteriser`]) and ray tracers ([`RayBackend`]).

pub use crate::gbuffer::{Attachments, GBuffer, NO_TRIANGLE, Rect, drawn_part};

use crate::camera_programs::SurfaceKind;
use crate::device_quad::{DeviceQuad, DeviceQuadStats, QuadPlace, Shown};
use crate::glass::Dielectric;
use crate::glsl::{Drawn, Program};
use crate::image::Image;
use crate::pixel_samples::PixelSamples;
use crate::programs::{Fidelity, RasterProgram, RayParams, RayProgram};
use crate::progress::Progress;
use crate::raster_effects::{EffectParams, EffectProgram, Missing};
use crate::scene::RenderScene;
use crate::scene::texture::Texture;
use crate::shared::{DeviceUuid, InPlace, SharedGBuffer};
use glam::{DMat4, DVec3, Mat4, Vec3, Vec4};
use std::sync::Arc;
use std::time::Duration;

/// A camera ready for a viewport. World positions are relative to [`RenderScene::origin`], as the scene holds them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// World to clip space, right-handed, with reversed depth: 1 at the near plane, 0 at the far plane.
    pub clip_from_world: Mat4,
    /// Camera position in world space.
    pub eye: Vec3,
    /// Like [`Self::clip_from_world`], but for positions minus [`Self::eye`]. Rasterisers project with it where it is given: a
    /// camera far from the origin has a large translation in its matrix, and the product loses digits that the difference keeps.
    pub clip_from_eye: Option<Mat4>,
    /// Side of the square over which a texture lookup is filtered, in pixels: 1 for one sample a pixel, below 1 for several.
    pub footprint: f32,
    /// Clip plane of a mirrored camera: the plane of its mirror. Fragments with `dot(plane, (p, 1)) < 0` lie behind the mirror and
    /// are not drawn. `p` is the position minus the offset that [`Self::projection`] returns. `None` clips nothing.
    pub clip_plane: Option<Vec4>,
}

impl View {
    /// A camera near the origin: without [`Self::clip_from_eye`] and without a clip plane, with a footprint of one pixel.
    #[must_use]
    pub fn new(clip_from_world: Mat4, eye: Vec3) -> Self {
        Self { clip_from_world, eye, clip_from_eye: None, footprint: 1.0, clip_plane: None }
    }

    /// The camera for sample number `sample` of every pixel of a viewport: shifted so that this sample falls on the pixel's centre.
    #[must_use]
    pub fn of_sample(self, viewport: Rect, samples: PixelSamples, sample: u32) -> Self {
        let [right, down] = samples.offset(sample).map(f64::from);
        let [width, height] = [viewport.width, viewport.height].map(|side| f64::from(side.max(1)));
        // Clip space is 2 wide and 2 high, with y upwards. The picture moves in the direction opposite to the sample's offset.
        let moved = DMat4::from_translation(DVec3::new(-2.0 * right / width, 2.0 * down / height, 0.0));
        Self { footprint: samples.side(), ..self.mapped(moved) }
    }

    /// The same camera with `map` applied after its projection. The matrices are multiplied in `f64`.
    #[must_use]
    pub fn mapped(self, map: DMat4) -> Self {
        let of = |matrix: Mat4| (map * matrix.as_dmat4()).as_mat4();
        Self { clip_from_world: of(self.clip_from_world), clip_from_eye: self.clip_from_eye.map(of), ..self }
    }

    /// The projection for rasterisers: a matrix, and the offset to subtract from positions before it is applied.
    #[must_use]
    pub fn projection(&self) -> (Mat4, Vec3) {
        self.clip_from_eye.map_or((self.clip_from_world, Vec3::ZERO), |matrix| (matrix, self.eye))
    }
}

/// The directional light of a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Unit direction in which the light travels.
    pub direction: Vec3,
    /// Colour of the light.
    pub color: Vec3,
}

/// A point light of a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lamp {
    /// Position in world space.
    pub position: Vec3,
    /// Colour of the light.
    pub color: Vec3,
}

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

/// Colours of a material as a pass sees them, after the project's injections and maps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shade {
    /// Diffuse colour.
    pub diffuse: Vec4,
    /// Emitted colour.
    pub emission: Vec4,
    /// Index into [`RenderScene::textures`], where the material has a texture and the pass reads it.
    pub texture: Option<u32>,
    /// Normal map. `None` in thesis fidelity.
    pub normal_map: Option<NormalMap>,
    /// Whether the reflected colour and the alpha are multiplied by the vertex colours
    /// ([`Geometry::colors`](crate::scene::Geometry::colors)).
    pub vertex_colors: bool,
    /// Alpha test: where texture alpha times vertex alpha is below this, the surface has a hole. The diffuse opacity is divided out
    /// of the value beforehand; it is infinite for an opacity of 0. `None` in thesis fidelity and for opaque materials. Without
    /// effect on a material that has neither a texture nor vertex colours.
    pub alpha_cutoff: Option<f32>,
    /// Light that the surface emits in addition to what it reflects. `None` in thesis fidelity and for surfaces that emit none.
    pub glow: Option<Glow>,
}

impl Default for Shade {
    fn default() -> Self {
        Self::WHITE
    }
}

impl Shade {
    /// Opaque white, without textures, vertex colours, alpha test and emission.
    pub const WHITE: Self = Self {
        diffuse: Vec4::ONE,
        emission: Vec4::ZERO,
        texture: None,
        normal_map: None,
        vertex_colors: false,
        alpha_cutoff: None,
        glow: None,
    };

    /// Whether an alpha test can cut holes into the surface.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.alpha_cutoff.is_some() && (self.texture.is_some() || self.vertex_colors)
    }
}

/// A normal map; [`crate::scene::normal_map`] says how it bends the shading normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalMap {
    /// Index into [`RenderScene::textures`], sampled at the same coordinates as [`Shade::texture`].
    pub texture: u32,
    /// Factor of the x and y components of the map's vectors: finite, at most 1e6.
    pub scale: f32,
}

/// Emission of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glow {
    /// Emitted colour, added to the reflected one.
    pub color: Vec3,
    /// Texture that multiplies the emitted colour: index into [`RenderScene::textures`], sampled at the coordinates of
    /// [`Shade::texture`].
    pub texture: Option<u32>,
}

/// The largest pictures that an engine can make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Most pixels along a side.
    pub side: u32,
    /// Whether a picture can be made in parts: whether each part equals that region of the whole picture.
    pub parts: bool,
}

impl Limits {
    /// No limit but memory; parts are possible.
    pub const NONE: Self = Self { side: u32::MAX, parts: true };
}

/// One raster pass.
#[derive(Debug, Clone, Copy)]
pub struct RasterJob<'a> {
    /// The scene to draw.
    pub scene: &'a RenderScene,
    /// The program that runs per fragment.
    pub program: RasterProgram,
    /// The camera.
    pub view: View,
    /// The light. Without a light the cosine that shading multiplies with is 0.
    pub sun: Option<Sun>,
    /// Colours of the materials, by material index.
    pub shades: &'a [Shade],
    /// Whether back faces (corners clockwise on the screen) are culled, by material index. Empty: nothing is culled.
    pub culled: &'a [bool],
    /// The part of the picture that [`Self::view`] covers. It is cleared and drawn as far as the target holds it. A target that
    /// cuts the viewport must do so at multiples of [`ALIGNMENT`](crate::gbuffer::ALIGNMENT) pixels from the viewport's corner.
    pub viewport: Rect,
    /// Clear value of the colour. The other attachments are cleared to 0 and the triangle id to [`NO_TRIANGLE`].
    pub clear_color: Vec4,
    /// The attachments to write.
    pub attachments: Attachments,
    /// Those of [`Self::attachments`] that are also written into the memory made by [`Rasteriser::share`], which has the viewport's
    /// size.
    pub shared: Attachments,
    /// Those of [`Self::attachments`] that are declared as 16-bit floats. A rasteriser with attachments of its own stores them so,
    /// and effects read the rounded values; in host memory the executor rounds them. The rounding mode of a device is its own
    /// choice.
    pub half: Attachments,
    /// Whether depth is interpolated between corners snapped to the subpixel grid (thesis fidelity), or between the exact corners.
    /// Only the processor's rasteriser obeys this; devices have their own rule.
    pub snapped_depth: bool,
}

/// Inputs of a material whose triangles are drawn by an own shader of the project.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnMaterial {
    /// Index into [`OwnShaders::programs`].
    pub program: usize,
    /// Bytes of each uniform block of the program.
    pub uniforms: Vec<Vec<u8>>,
    /// Texture of each sampler of the program.
    pub textures: Vec<OwnTexture>,
    /// By storage buffer of the program: the index of what is bound, into the buffers of [`Rasteriser::draw_with`]; `None` of an image that
    /// holds nothing.
    pub storage: Vec<Option<usize>>,
    /// How its triangles are drawn.
    pub drawn: Drawn,
}

/// The texture of a sampler of an own shader, in a raster pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OwnTexture {
    /// No texture: reads opaque black.
    Nothing,
    /// Index into [`RenderScene::textures`].
    Scene(u32),
    /// Indices into [`RenderScene::textures`] of a cube map's images, square and of one size: +x, -x, +y, -y, +z, -z.
    Cube([u32; 6]),
    /// Index into [`OwnShaders::channels`].
    Channel(usize),
}

/// The own shaders of a raster pass.
#[derive(Debug, Clone, Copy)]
pub struct OwnShaders<'a> {
    /// The compiled programs.
    pub programs: &'a [Arc<Program>],
    /// Own shader of each material, by material index; `None` for materials that the job's own program draws.
    pub materials: &'a [Option<OwnMaterial>],
    /// Channels that earlier passes wrote.
    pub channels: &'a [QuadTexture<'a>],
    /// Index of the attachment (0 colour, 1 position, 2 normal) that receives depth. It is cleared to 1, the far plane. `None`:
    /// depth is not stored.
    pub depth: Option<usize>,
    /// Depth clamp: geometry beyond the near or far plane is drawn at that plane's depth instead of being clipped.
    pub clamped: bool,
    /// How often each triangle is drawn: `gl_InstanceID` counts from 0.
    pub instances: u32,
}

impl OwnShaders<'_> {
    /// None.
    pub const NONE: Self =
        Self { programs: &[], materials: &[], channels: &[], depth: None, clamped: false, instances: 1 };
}

/// The texture of a sampler of a quad's own shader.
#[derive(Debug, Clone, Copy)]
pub enum QuadTexture<'a> {
    /// No texture: reads opaque black.
    Nothing,
    /// An image file.
    Image(&'a Texture),
    /// The images of a cube map, square and of one size: +x, -x, +y, -y, +z, -z.
    Cube([&'a Texture; 6]),
    /// A channel that an earlier pass wrote.
    Channel {
        /// Pixels a row.
        width: u32,
        /// Rows.
        height: u32,
        /// `width * height` texels, top row first.
        texels: &'a [[f32; 4]],
    },
}

/// A full-screen quad that an own shader of the project fills.
#[derive(Debug, Clone, Copy)]
pub struct QuadJob<'a> {
    /// The compiled program. Its `position` is in clip space, -1 to 1, and its `texCoord0` runs from 0 to 1.
    pub program: &'a Arc<Program>,
    /// Bytes of each uniform block of the program.
    pub uniforms: &'a [Vec<u8>],
    /// Texture of each sampler of the program.
    pub textures: &'a [QuadTexture<'a>],
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// A compute shader of the project that runs for many work groups.
#[derive(Debug, Clone, Copy)]
pub struct ComputeJob<'a> {
    /// The compiled program; it has a [`Program::compute`].
    pub program: &'a Arc<Program>,
    /// Bytes of each uniform block of the program.
    pub uniforms: &'a [Vec<u8>],
    /// Texture of each sampler of the program.
    pub textures: &'a [QuadTexture<'a>],
    /// Work groups in each direction.
    pub groups: [u32; 3],
}

/// Why a backend could not do its work.
#[derive(Debug, Clone, thiserror::Error)]
pub enum BackendError {
    /// The backend lacks the feature; the message names the reason and a remedy.
    #[error("{backend} cannot run {what}: {why}")]
    Unsupported {
        /// Name of the backend.
        backend: &'static str,
        /// Pass or feature.
        what: String,
        /// Reason and remedy.
        why: String,
    },
    /// The device reported a failure.
    #[error("{backend}: {message}")]
    Device {
        /// Name of the backend.
        backend: &'static str,
        /// What the device said.
        message: String,
    },
}

impl BackendError {
    /// The error of a backend without exact spheres. `what` names the pass, `place` the declaration of its first sphere, `help` a
    /// remedy.
    #[must_use]
    pub fn no_spheres(backend: &'static str, what: &str, place: &str, help: &str) -> Self {
        let why = format!("it knows triangles only; {help}, or declare them without exact=\"true\"");
        Self::Unsupported { backend, what: format!("{what} with exact spheres ({place})"), why }
    }

    /// The error of a rasteriser that runs no GLSL, for a pass with own shaders; `place` is where the first of them is named.
    #[must_use]
    pub fn no_shaders(backend: &'static str, place: &str) -> Self {
        let why = "it runs no GLSL; draw with --raster wgpu, on any Vulkan, Metal or DirectX 12 driver".to_owned();
        Self::Unsupported { backend, what: format!("own shaders ({place})"), why }
    }

    /// The name of the backend that failed.
    #[must_use]
    pub fn backend(&self) -> &'static str {
        match self {
            Self::Unsupported { backend, .. } | Self::Device { backend, .. } => backend,
        }
    }

    /// The message for a line that already names the backend.
    #[must_use]
    pub fn reason(&self) -> String {
        match self {
            Self::Device { message, .. } => message.clone(),
            Self::Unsupported { .. } => self.to_string(),
        }
    }
}

/// Draws triangles into G-buffers.
pub trait Rasteriser {
    /// Short name: `cpu` or `wgpu`.
    fn name(&self) -> &'static str;
    /// The largest viewport that it draws.
    fn limits(&self) -> Limits;
    /// Description of the device and its driver.
    fn device(&self) -> String;
    /// Uploads the scene; the executor times this step.
    ///
    /// # Errors
    /// If the device cannot hold it.
    fn upload(&mut self, scene: &Arc<RenderScene>) -> Result<(), BackendError>;
    /// Draws, and waits until it is done. The attachments of the job are allocated in `target`. A rasteriser in host memory writes
    /// them directly; others keep their own until [`Rasteriser::read_back`]. Pixels outside the viewport keep their values.
    ///
    /// # Errors
    /// If the device fails.
    fn draw(&mut self, job: &RasterJob<'_>, target: &mut GBuffer) -> Result<DrawStats, BackendError>;
    /// [`Rasteriser::draw`] that moves `progress`, and may be given up between parts of the work when [`Progress::is_cancelled`] says so:
    /// it returns early then, and what `target` holds is not defined. A rasteriser that has no parts draws to the end.
    ///
    /// # Errors
    /// As [`Rasteriser::draw`].
    fn draw_until(
        &mut self,
        job: &RasterJob<'_>,
        target: &mut GBuffer,
        _progress: &Progress,
    ) -> Result<DrawStats, BackendError> {
        self.draw(job, target)
    }
    /// Whether it draws with own shaders of the project.
    fn draws_shaders(&self) -> bool {
        false
    }
    /// [`Rasteriser::draw`], with own shaders for some materials. Their fragments write no triangle ids. `buffers` are the storage buffers
    /// and images of the pass, 16 bytes each; what is stored is there afterwards. Every fragment of every triangle stores, hidden or not.
    ///
    /// # Errors
    /// If the device fails, or the rasteriser cannot draw with own shaders.
    fn draw_with(
        &mut self,
        job: &RasterJob<'_>,
        shaders: &OwnShaders<'_>,
        target: &mut GBuffer,
        _buffers: &mut [Vec<[f32; 4]>],
    ) -> Result<DrawStats, BackendError> {
        if shaders.materials.iter().all(Option::is_none) {
            return self.draw(job, target);
        }
        Err(BackendError::no_shaders(self.name(), "a pass"))
    }
    /// Fills a quad by an own shader of the project: every pixel of `pixels`, top row first, of which there are as many as the job says.
    /// What the shader discards stays. `buffers` are what is bound to the program's storage buffers, 16 bytes each; what is stored is there
    /// afterwards.
    ///
    /// # Errors
    /// If the device fails, or it runs none.
    fn fill(
        &mut self,
        _job: &QuadJob<'_>,
        _pixels: &mut [[f32; 4]],
        _buffers: &mut [Vec<[f32; 4]>],
    ) -> Result<(), BackendError> {
        Err(BackendError::no_shaders(self.name(), "a quad"))
    }
    /// Runs a compute shader of the project. `buffers` are what is bound to the program's storage buffers, 16 bytes each; what is stored is
    /// there afterwards.
    ///
    /// # Errors
    /// If the device fails, or it runs none.
    fn compute(&mut self, _job: &ComputeJob<'_>, _buffers: &mut [Vec<[f32; 4]>]) -> Result<(), BackendError> {
        Err(BackendError::no_shaders(self.name(), "a compute pass"))
    }
    /// Whether attachments reach host memory only through [`Rasteriser::read_back`].
    fn needs_read_back(&self) -> bool;
    /// Copies the `wanted` attachments of the last draw into `target`. Other attachments of `target` keep their values.
    ///
    /// # Errors
    /// If the device fails.
    fn read_back(&mut self, job: &RasterJob<'_>, wanted: Attachments, target: &mut GBuffer)
    -> Result<(), BackendError>;
    /// Whether the rasteriser draws exact spheres ([`Geometry::spheres`](crate::scene::Geometry::spheres)). No rasteriser draws
    /// them into the maps of effects.
    fn draws_spheres(&self) -> bool {
        false
    }
    /// A handle through which a ray backend on the same device reads attachments without a copy. It refers to the last job that
    /// named attachments in [`RasterJob::shared`].
    fn lends(&mut self) -> Option<InPlace> {
        None
    }
    /// The device, if other interfaces (CUDA, OptiX) can read its attachments in place.
    fn shares(&self) -> Option<DeviceUuid> {
        None
    }
    /// Allocates shared memory for G-buffers of this size, replacing the previous allocation. Jobs name the attachments to store
    /// there in [`RasterJob::shared`].
    ///
    /// # Errors
    /// If the device has too little memory, or shares none at all.
    fn share(&mut self, width: u32, height: u32, attachments: Attachments) -> Result<SharedGBuffer, BackendError> {
        let what = format!("a shared G-buffer of {width} x {height} pixels with {attachments:?}");
        Err(BackendError::Unsupported { backend: self.name(), what, why: "it shares no memory".to_owned() })
    }
    /// Runs a raster effect: draws the maps that it needs, then computes every pixel of `output`, which has the job's size.
    ///
    /// # Errors
    /// If the device fails, or the job lacks what the program reads.
    fn effect(
        &mut self,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
    ) -> Result<EffectStats, BackendError>;
    /// Where the rasteriser fills quads. Only [`QuadPlace::Device`] allows [`Rasteriser::effect_in_place`] and
    /// [`Rasteriser::fill_on_device`].
    fn fills_quads(&self) -> QuadPlace {
        QuadPlace::Host
    }
    /// Runs a raster effect and keeps its picture on the device under the given number, for [`Rasteriser::fill_on_device`].
    ///
    /// # Errors
    /// As [`Rasteriser::effect`], or if the rasteriser keeps no pictures on a device.
    fn effect_in_place(&mut self, _: &EffectJob<'_>, _: usize, _: &Progress) -> Result<EffectStats, BackendError> {
        Err(not_in_place(self.name()))
    }
    /// Fills a quad from pictures on the device (drawn, computed or traced), waits, and copies it into host memory in the form
    /// asked for.
    ///
    /// # Errors
    /// If the device fails, or a picture that the quad reads is missing.
    fn fill_on_device(&mut self, _: &DeviceQuad, _: Shown<'_>) -> Result<DeviceQuadStats, BackendError> {
        Err(not_in_place(self.name()))
    }
}

/// The error of an engine whose pictures are always in host memory.
fn not_in_place(backend: &'static str) -> BackendError {
    let (what, why) = ("pictures that stay on a device".to_owned(), "it leaves them in host memory".to_owned());
    BackendError::Unsupported { backend, what, why }
}

/// One effect pass. All images have the same size.
#[derive(Debug, Clone, Copy)]
pub struct EffectJob<'a> {
    /// The scene drawn into maps; it is uploaded already.
    pub scene: &'a RenderScene,
    /// The program that runs per pixel.
    pub program: EffectProgram,
    /// Constants of the program.
    pub params: EffectParams,
    /// Seed of the random numbers.
    pub seed: u32,
    /// The camera that drew the G-buffer; the G-buffer covers its whole viewport.
    pub view: View,
    /// The light, for programs that read it.
    pub sun: Option<Sun>,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Whether the G-buffer is the unchanged result of this rasteriser's last draw, with every attachment that the program reads.
    /// The rasteriser may then use its own copy, and if it needs read-back the slices below are empty.
    pub resident: bool,
    /// World position, and light cosine in the fourth component; 0 where no surface is seen. Empty if the program does not read it.
    pub position: &'a [[f32; 4]],
    /// Shading normal. Empty if the program does not read it.
    pub normal: &'a [[f32; 4]],
    /// Shaded colour. Empty if the program does not read it.
    pub color: &'a [[f32; 4]],
    /// Triangle ids. Empty if the program does not distinguish glass.
    pub triangle: &'a [u32],
    /// Colours of the materials in maps, by material index.
    pub shades: &'a [Shade],
    /// Whether a material is glass, by material index. Glass is not drawn into cube maps and mirrors.
    pub glass: &'a [bool],
}

/// Time of a part of an effect.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Part {
    /// Host time with synchronisation.
    pub host: Duration,
    /// Time on the device's own clock, where it has one.
    pub device: Option<Duration>,
}

/// What an effect pass did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EffectStats {
    /// Time to draw the maps; `None` if no map was drawn.
    pub maps: Option<Part>,
    /// Time to compute the pixels.
    pub pixels: Part,
    /// Time to copy the G-buffer to the device and the result back; `None` for a rasteriser in host memory.
    pub transfer: Option<Duration>,
    /// Number of maps drawn; a cube map counts as one.
    pub map_count: u32,
    /// Triangles submitted for the maps.
    pub triangles: u64,
    /// Bytes of the maps.
    pub bytes: u64,
    /// Number of glass pixels, and how many of them no map covers: those keep their colour. `[0, 0]` for a program whose maps cover
    /// all glass.
    pub glass_pixels: [u64; 2],
    /// How the rays of glass pixels were answered; only of programs that march rays through screen space.
    pub answers: Option<Answers>,
}

/// Number of glass pixels, by what answered their rays. With [`Missing::Rays`](crate::raster_effects::Missing) the rasteriser marks
/// the pixels counted in [`Answers::rays`] with an alpha of [`Answers::LEFT`], and the executor traces them. Other pixels have
/// alpha 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Answers {
    /// Pixels whose rays all hit something in screen space.
    pub screen: u64,
    /// Pixels with at least one ray answered by a cube map.
    pub cube: u64,
    /// Pixels left to the counterpart program on the ray backend.
    pub rays: u64,
    /// Pixels with at least one ray that nothing answered: it shows the glass's own colour.
    pub kept: u64,
}

impl Answers {
    /// Alpha that marks a pixel for the ray backend.
    pub const LEFT: f32 = -1.0;

    /// Number of all glass pixels.
    #[must_use]
    pub fn glass(self) -> u64 {
        self.screen + self.cube + self.rays + self.kept
    }

    /// Counts of `glass` pixels, of which `screen` were answered in screen space and `kept` show some of their own colour.
    /// `missing` says what answers the rest.
    #[must_use]
    pub fn new([glass, screen, kept]: [u64; 3], missing: Missing) -> Self {
        let left = glass.saturating_sub(screen + kept);
        let mut answers = Self { screen, kept, ..Self::default() };
        match missing {
            Missing::Cube => answers.cube = left,
            Missing::Rays => answers.rays = left,
            Missing::Own => answers.kept += left,
        }
        answers
    }
}

impl std::fmt::Display for Answers {
    /// Such as `1000 pixels of glass: screen 41.20 %, cube 58.80 %`. Counts of 0 are left out.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let all = self.glass();
        let ways = [(self.screen, "screen"), (self.cube, "cube"), (self.rays, "rays"), (self.kept, "kept")];
        write!(f, "{all} pixels of glass")?;
        let shown = ways.into_iter().filter(|(count, _)| *count > 0);
        for (index, (count, way)) in shown.enumerate() {
            let percent = 100.0 * count as f64 / all as f64;
            write!(f, "{} {way} {percent:.2} %", if index == 0 { ":" } else { "," })?;
        }
        Ok(())
    }
}

/// The copy of attachments into shared memory.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HandOver {
    /// Value of the shared memory's semaphore once the copy is complete.
    pub value: u64,
    /// Host time with synchronisation; not part of the draw's time.
    pub host: Duration,
    /// Time on the device's own clock, if it has one; not part of the draw's time.
    pub device: Option<Duration>,
}

/// What a draw did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DrawStats {
    /// Time on the device's own clock, if it has one.
    pub device_time: Option<Duration>,
    /// The copy into shared memory, if the job asked for one.
    pub shared: Option<HandOver>,
    /// Triangles submitted.
    pub triangles: u64,
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
    /// Corrected, or as the thesis has it.
    pub fidelity: Fidelity,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Camera position in world space.
    pub eye: Vec3,
    /// The light, for programs that read it.
    pub sun: Option<Sun>,
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
    /// Linear colour of rays that miss the scene; black in the report's projects.
    pub beyond: Vec3,
    /// Glass properties by material index, for `glass=auto` in corrected fidelity. Empty: all glass is thin panes of the pass's
    /// index.
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

/// Rays in host memory that are traced for their nearest hits. Every surface stops them, cut-outs and glass as well.
#[derive(Debug, Clone, Copy)]
pub struct IntersectionJob<'a> {
    /// The scene, for which a structure was built.
    pub scene: &'a RenderScene,
    /// Origin in the world and least distance; direction and greatest distance. Distances are multiples of the direction's length,
    /// which is not 0. A ray with a number that is not finite (but for the greatest distance) meets nothing.
    pub rays: &'a [[[f32; 4]; 2]],
}

/// What [`RayBackend::intersect`] writes for a ray that meets nothing: the distance -1, and the bits of the integer -1 as the id.
pub const NO_HIT: [f32; 4] = [-1.0, f32::from_bits(u32::MAX), 0.0, 0.0];

/// Number of rays traced, by kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct RayCounts {
    /// Shadow rays towards the light.
    pub shadow: u64,
    /// Ambient occlusion rays.
    pub occlusion: u64,
    /// Reflected rays.
    pub reflected: u64,
    /// Refracted rays.
    pub refracted: u64,
    /// Camera rays.
    #[serde(default)]
    pub camera: u64,
    /// Rays of a storage buffer.
    #[serde(default)]
    pub buffer: u64,
    /// Occlusion rays that were skipped because they certainly miss. Not part of the total.
    pub certain: u64,
    /// Paths in glass with a wrong colour: paths given up as black after too many surfaces, and paths inside more nested bodies
    /// than are tracked. Not part of the total.
    #[serde(default)]
    pub lost: u64,
}

impl RayCounts {
    /// Number of all rays traced.
    #[must_use]
    pub fn total(self) -> u64 {
        self.shadow + self.occlusion + self.reflected + self.refracted + self.camera + self.buffer
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.shadow += other.shadow;
        self.occlusion += other.occlusion;
        self.reflected += other.reflected;
        self.refracted += other.refracted;
        self.camera += other.camera;
        self.buffer += other.buffer;
        self.certain += other.certain;
        self.lost += other.lost;
    }
}

/// What adaptive sampling of stochastic glass spent, and the error that it came to.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PathsSpent {
    /// The error that was asked for.
    pub asked: f32,
    /// The error reached, as it is estimated from two independent halves of the paths: the root mean square over [`Self::pixels`] and their
    /// red, green and blue.
    pub error: f64,
    /// Whether the error is with a probability of 95 % at most what was asked for. If not, the most paths of a pixel ran out before.
    pub met: bool,
    /// Pixels whose glass is stochastic.
    pub pixels: u64,
    /// Paths of all of these pixels.
    pub paths: u64,
    /// Most paths of one of them.
    pub most: u32,
    /// Pixels with the most paths that the pass allows.
    pub exhausted: u64,
}

impl PathsSpent {
    /// Mean number of paths of a pixel whose glass is stochastic; 0 without such pixels.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.paths as f64 / self.pixels.max(1) as f64
    }

    /// Of several pictures together: sums, the largest error, and whether all met theirs.
    #[must_use]
    pub fn together(self, other: Self) -> Self {
        Self {
            asked: self.asked.max(other.asked),
            error: self.error.max(other.error),
            met: self.met && other.met,
            pixels: self.pixels + other.pixels,
            paths: self.paths + other.paths,
            most: self.most.max(other.most),
            exhausted: self.exhausted + other.exhausted,
        }
    }
}

impl std::fmt::Display for PathsSpent {
    /// Such as `error 0.0098 for 0.01 asked, 37.2 paths a pixel at 12000 pixels of stochastic glass, at most 512`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { asked, error, met, pixels, most, exhausted, .. } = self;
        if *pixels == 0 {
            return write!(f, "no stochastic glass is seen: nothing was sampled to the error of {asked}");
        }
        if !met {
            write!(f, "ERROR NOT MET, paths ran out at {exhausted} pixels: ")?;
        }
        let mean = self.mean();
        write!(
            f,
            "error {error:.2e} for {asked} asked, {mean:.1} paths a pixel at {pixels} pixels of stochastic glass, at most {most}"
        )
    }
}

/// What a ray pass did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RayStats {
    /// Rays traced.
    pub rays: RayCounts,
    /// What adaptive sampling spent; `None` where every pixel has the same number of paths.
    pub adaptive: Option<PathsSpent>,
    /// Time to copy the G-buffer to the device: host time, or the clock of the drawing device for a copy between two devices.
    /// `None` if nothing was copied.
    pub upload: Option<Duration>,
    /// Time to copy the picture back, on the host; `None` in host memory.
    pub read_back: Option<Duration>,
    /// Time on the device's own clock, if it has one.
    pub device_time: Option<Duration>,
    /// Device memory that the backend keeps between passes, in bytes: pictures, tables, lists. The acceleration structure is not
    /// included. 0 for the processor.
    pub held_bytes: u64,
}

/// Size of an acceleration structure.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BuildStats {
    /// Bytes of the structure.
    pub bytes: u64,
    /// Number of nodes.
    pub nodes: u64,
}

/// Description of a graphics device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Gpu {
    /// Name and capabilities, in words.
    pub name: String,
    /// The driver, in words.
    pub driver: String,
}

/// Runs ray programs.
pub trait RayBackend {
    /// Short name, such as `cpu`, `wgpu`, `cuda` or `optix`.
    fn name(&self) -> &'static str;
    /// The largest job that it runs.
    fn limits(&self) -> Limits {
        Limits::NONE
    }
    /// Whether the backend can continue sample sequences where another job ended: [`RayParams::first`] above 0.
    fn continues_sequences(&self) -> bool {
        true
    }
    /// Description of the device and its driver.
    fn device(&self) -> String;
    /// The graphics devices that the backend uses; empty for the processor.
    fn gpus(&self) -> Vec<Gpu> {
        Vec::new()
    }
    /// Whether the backend can run a program.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with the reason.
    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError>;
    /// Whether the backend can run a program with the glass features that these parameters and materials ([`RayJob::dielectrics`])
    /// ask for. Applies to corrected fidelity and scenes with glass. By default a backend supports only the thin panes of the
    /// report.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with the reason and a remedy.
    fn supports_glass(
        &self,
        program: RayProgram,
        params: &RayParams,
        _dielectrics: &[Dielectric],
    ) -> Result<(), BackendError> {
        let Some(asked) = program.asks_of_glass(params) else { return Ok(()) };
        let why = "its programs know the report's panes only; use --backend cpu, or allow it with --fallback cpu, or set \
                   glass=pane, background=black and shadow=report on the pass";
        let what = format!("{} with {asked}", program.info().stem);
        Err(BackendError::Unsupported { backend: self.name(), what, why: why.to_owned() })
    }
    /// Whether the backend traces exact spheres ([`Geometry::spheres`](crate::scene::Geometry::spheres)), in corrected fidelity.
    fn traces_spheres(&self) -> bool {
        false
    }
    /// Whether the backend traces the rays of a storage buffer.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with a remedy.
    fn supports_intersections(&self) -> Result<(), BackendError> {
        let why = "its programs start their rays themselves; use --backend cpu, or allow it with --fallback cpu";
        let what = "the rays of a storage buffer".to_owned();
        Err(BackendError::Unsupported { backend: self.name(), what, why: why.to_owned() })
    }
    /// Whether the backend traces soft shadows: lights with a disc ([`RayParams::sun`] above 0).
    fn traces_sun_discs(&self) -> bool {
        false
    }
    /// Whether it filters the share that a program writes ([`RayParams::filter`] above 0).
    fn filters_shares(&self) -> bool {
        false
    }
    /// Whether it samples stochastic glass until an error is reached ([`RayParams::error`]).
    fn samples_adaptively(&self) -> bool {
        false
    }
    /// Builds the acceleration structure; the executor times this step. `filtered` says by material index whether rays of any pass
    /// may pass through it (alpha-cut textures, glass that shadow rays pass), so that hits need an any-hit test.
    ///
    /// # Errors
    /// If the device cannot hold it.
    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError>;
    /// [`RayBackend::build`] that may be given up between parts of the work when [`Progress::is_cancelled`] says so: it returns early
    /// then, and nothing is built. A backend whose work has no parts builds to the end.
    ///
    /// # Errors
    /// As [`RayBackend::build`].
    fn build_until(
        &mut self,
        scene: &Arc<RenderScene>,
        filtered: &[bool],
        _progress: &Progress,
    ) -> Result<BuildStats, BackendError> {
        self.build(scene, filtered)
    }
    /// About how many bytes a triangle takes in the structure and while it is built.
    fn bytes_per_triangle(&self) -> u64;
    /// Accepts a rasteriser's handle to attachments in place. Returns whether the backend can read them; if so, later jobs with
    /// [`RayJob::shared`] read there.
    fn reads(&mut self, _lent: &InPlace) -> bool {
        false
    }
    /// Whether the backend can read G-buffers in shared memory of that device.
    fn joins(&self, _device: DeviceUuid) -> bool {
        false
    }
    /// Opens a shared G-buffer and closes the previous one. Jobs with [`RayJob::shared`] read it.
    ///
    /// # Errors
    /// If the device refuses it.
    fn join(&mut self, _shared: SharedGBuffer) -> Result<(), BackendError> {
        let (what, why) = ("a shared G-buffer".to_owned(), "it reads host memory".to_owned());
        Err(BackendError::Unsupported { backend: self.name(), what, why })
    }
    /// Runs one pass into `output`, which has the job's size. Advances `progress` meanwhile.
    ///
    /// # Errors
    /// If the device fails or the job lacks what the program reads.
    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError>;
    /// Traces rays of a storage buffer into `hits`, which is as long: the distance, the triangle's id as the bits of an integer, and
    /// the barycentric coordinates of corners 1 and 2, or [`NO_HIT`]. Advances `progress` meanwhile.
    ///
    /// # Errors
    /// If [`RayBackend::supports_intersections`] says so, or the structure was not built.
    fn intersect(
        &mut self,
        _: &IntersectionJob<'_>,
        _hits: &mut [[f32; 4]],
        _: &Progress,
    ) -> Result<RayStats, BackendError> {
        self.supports_intersections().map(|()| RayStats::default())
    }
    /// Runs one pass and keeps its picture under the given number on the device of the rasteriser whose handle
    /// [`RayBackend::reads`] accepted.
    ///
    /// # Errors
    /// As [`RayBackend::run`], or if no handle was accepted.
    fn run_in_place(&mut self, _: &RayJob<'_>, _: usize, _: &Progress) -> Result<RayStats, BackendError> {
        Err(not_in_place(self.name()))
    }
}
