//! The seam between the executor and what does the work: rasterisers and ray tracers.

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

/// A camera ready for a viewport. World positions are those of a scene as it is held: relative to [`RenderScene::origin`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// World to clip, right-handed, depth reversed: 1 at the near plane, 0 at the far plane.
    pub clip_from_world: Mat4,
    /// Camera position, world.
    pub eye: Vec3,
    /// The same as [`Self::clip_from_world`] for positions from which the eye was subtracted: what rasterisers project with where it is
    /// given. A product with a matrix that moves by a large distance loses digits that the difference keeps.
    pub clip_from_eye: Option<Mat4>,
    /// Side of the square of the picture over which textures are filtered, in pixels: below 1 where a pixel has several samples.
    pub footprint: f32,
    /// Nothing is drawn where the dot product of this and `(p, 1)` is below 0: the mirror before a mirrored camera, which sees nothing
    /// of what lies behind it. `p` is a position less what [`Self::projection`] says.
    pub clip_plane: Option<Vec4>,
}

impl View {
    /// A camera not far from the origin.
    #[must_use]
    pub fn new(clip_from_world: Mat4, eye: Vec3) -> Self {
        Self { clip_from_world, eye, clip_from_eye: None, footprint: 1.0, clip_plane: None }
    }

    /// The same camera for one of the samples of every pixel of a viewport: where the pixel's sample was is its centre now.
    #[must_use]
    pub fn of_sample(self, viewport: Rect, samples: PixelSamples, sample: u32) -> Self {
        let [right, down] = samples.offset(sample).map(f64::from);
        let [width, height] = [viewport.width, viewport.height].map(|side| f64::from(side.max(1)));
        // Clip space is 2 wide and 2 high, and goes up; what is seen moves against the sample.
        let moved = DMat4::from_translation(DVec3::new(-2.0 * right / width, 2.0 * down / height, 0.0));
        Self { footprint: samples.side(), ..self.mapped(moved) }
    }

    /// The same camera with its clip space mapped by a matrix, which is multiplied in `f64`.
    #[must_use]
    pub fn mapped(self, map: DMat4) -> Self {
        let of = |matrix: Mat4| (map * matrix.as_dmat4()).as_mat4();
        Self { clip_from_world: of(self.clip_from_world), clip_from_eye: self.clip_from_eye.map(of), ..self }
    }

    /// What rasterisers project with: a matrix, and what is subtracted from positions before.
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
    /// Its colour.
    pub color: Vec3,
}

/// The light of a pass that shines from a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lamp {
    /// Where it is, world.
    pub position: Vec3,
    /// Its colour.
    pub color: Vec3,
}

/// What programs read whose rays start at the camera.
#[derive(Debug, Clone, Copy)]
pub struct FromCamera<'a> {
    /// The camera, with perspective.
    pub view: View,
    /// Pixels a row and rows of the whole picture, of which a job may be a part.
    pub picture: [u32; 2],
    /// The light, where it shines from a place; else it is [`RayJob::sun`].
    pub lamp: Option<Lamp>,
    /// By material: what rays do there.
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
    /// What bends the shading normal. `None` in thesis fidelity.
    pub normal_map: Option<NormalMap>,
    /// Whether what the surface reflects, and its alpha, is multiplied by the colours of its vertices
    /// ([`Geometry::colors`](crate::scene::Geometry::colors)).
    pub vertex_colors: bool,
    /// Where the alpha of texture and vertices alone is below this, there is no surface, whatever the diffuse colour's alpha;
    /// infinite where nothing is left of the material. `None` in thesis fidelity and for opaque materials; without effect where
    /// there are neither.
    pub alpha_cutoff: Option<f32>,
    /// Light that the surface adds to what it reflects. `None` in thesis fidelity and where it sends out none.
    pub glow: Option<Glow>,
}

impl Default for Shade {
    fn default() -> Self {
        Self::WHITE
    }
}

impl Shade {
    /// White and whole, without a texture and light of its own.
    pub const WHITE: Self = Self {
        diffuse: Vec4::ONE,
        emission: Vec4::ZERO,
        texture: None,
        normal_map: None,
        vertex_colors: false,
        alpha_cutoff: None,
        glow: None,
    };

    /// Whether an alpha says where the surface is.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.alpha_cutoff.is_some() && (self.texture.is_some() || self.vertex_colors)
    }
}

/// A texture that bends the shading normal; [`crate::scene::normal_map`] says how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalMap {
    /// Index into [`RenderScene::textures`], read where [`Shade::texture`] is.
    pub texture: u32,
    /// What x and y of its vectors are multiplied by: finite, of at most 1e6.
    pub scale: f32,
}

/// Light that a surface sends out by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glow {
    /// Its colour, added to that of the surface.
    pub color: Vec3,
    /// What that is multiplied by: index into [`RenderScene::textures`], read where [`Shade::texture`] is.
    pub texture: Option<u32>,
}

/// The largest pictures that an engine can do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Pixels a side.
    pub side: u32,
    /// Whether it does a part of a picture as it would do the whole.
    pub parts: bool,
}

impl Limits {
    /// As large as memory allows, and parts.
    pub const NONE: Self = Self { side: u32::MAX, parts: true };
}

/// One raster pass.
#[derive(Debug, Clone, Copy)]
pub struct RasterJob<'a> {
    /// What is drawn.
    pub scene: &'a RenderScene,
    /// What runs per pixel.
    pub program: RasterProgram,
    /// From where.
    pub view: View,
    /// The light; without one the cosine is 0.
    pub sun: Option<Sun>,
    /// By material index.
    pub shades: &'a [Shade],
    /// By material index: whether triangles are left out that are seen from behind, where their corners go clockwise. None where
    /// it is empty.
    pub culled: &'a [bool],
    /// The part of the picture that is seen by [`Self::view`]. What of it the target holds is cleared and drawn into: the
    /// whole viewport, unless the target is cut at multiples of [`ALIGNMENT`](crate::gbuffer::ALIGNMENT) pixels from its corner.
    pub viewport: Rect,
    /// What clears the colour; the other attachments are cleared to 0, and the triangle id to [`NO_TRIANGLE`].
    pub clear_color: Vec4,
    /// What is written.
    pub attachments: Attachments,
    /// What of it is also written into the memory that [`Rasteriser::share`] made, whose size is the viewport's.
    pub shared: Attachments,
    /// What of it is declared in 16-bit floats. A rasteriser that keeps attachments of its own stores these so, and effects
    /// read them so; in host memory the executor rounds them. Whether a device rounds to the nearest is its own affair.
    pub half: Attachments,
    /// Whether depth is that of planes through snapped corners, as it was; else of the triangles' own. A device has its own rule.
    pub snapped_depth: bool,
}

/// What a material is given whose triangles an own shader of the project draws.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnMaterial {
    /// Index into [`OwnShaders::programs`].
    pub program: usize,
    /// By block of the program: its bytes.
    pub uniforms: Vec<Vec<u8>>,
    /// By sampler of the program.
    pub textures: Vec<OwnTexture>,
    /// How its triangles are drawn.
    pub drawn: Drawn,
}

/// What a sampler of an own shader reads in a raster pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OwnTexture {
    /// Black and opaque.
    Nothing,
    /// Index into [`RenderScene::textures`].
    Scene(u32),
    /// Index into [`OwnShaders::channels`].
    Channel(usize),
}

/// The own shaders of a raster pass.
#[derive(Debug, Clone, Copy)]
pub struct OwnShaders<'a> {
    /// What runs.
    pub programs: &'a [Arc<Program>],
    /// By material index; `None` for what the job's own program draws.
    pub materials: &'a [Option<OwnMaterial>],
    /// What earlier passes wrote.
    pub channels: &'a [QuadTexture<'a>],
    /// The attachment that holds depth, of colour, position and normal: it is cleared to 1, the far plane. `None` where depth is not kept.
    pub depth: Option<usize>,
    /// Whether what lies before the near plane or behind the far plane is drawn at that plane's depth, instead of left out.
    pub clamped: bool,
    /// How often each triangle is drawn: `gl_InstanceID` counts from 0.
    pub instances: u32,
}

impl OwnShaders<'_> {
    /// None.
    pub const NONE: Self =
        Self { programs: &[], materials: &[], channels: &[], depth: None, clamped: false, instances: 1 };
}

/// What a sampler of a quad's own shader reads.
#[derive(Debug, Clone, Copy)]
pub enum QuadTexture<'a> {
    /// Black and opaque.
    Nothing,
    /// An image file.
    Image(&'a Texture),
    /// What an earlier pass wrote.
    Channel {
        /// Pixels a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Top row first.
        texels: &'a [[f32; 4]],
    },
}

/// One quad that an own shader of the project fills.
#[derive(Debug, Clone, Copy)]
pub struct QuadJob<'a> {
    /// What runs. `position` is in clip space, from -1 to 1, and `texCoord0` from 0 to 1.
    pub program: &'a Arc<Program>,
    /// By block of the program: its bytes.
    pub uniforms: &'a [Vec<u8>],
    /// By sampler of the program.
    pub textures: &'a [QuadTexture<'a>],
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// Why a backend could not do its work.
#[derive(Debug, Clone, thiserror::Error)]
pub enum BackendError {
    /// The backend cannot do this at all; says why, and what would.
    #[error("{backend} cannot run {what}: {why}")]
    Unsupported {
        /// Its name.
        backend: &'static str,
        /// Pass or feature.
        what: String,
        /// Reason and remedy.
        why: String,
    },
    /// The device failed.
    #[error("{backend}: {message}")]
    Device {
        /// Its name.
        backend: &'static str,
        /// What the device said.
        message: String,
    },
}

impl BackendError {
    /// That a pass shows exact spheres, of which the first is declared at `place`, and the backend knows triangles only; `what` of it does.
    #[must_use]
    pub fn no_spheres(backend: &'static str, what: &str, place: &str, help: &str) -> Self {
        let why = format!("it knows triangles only; {help}, or declare them without exact=\"true\"");
        Self::Unsupported { backend, what: format!("{what} with exact spheres ({place})"), why }
    }

    /// That a pass draws with own shaders of the project, of which the first is named at `place`, and the rasteriser runs none.
    #[must_use]
    pub fn no_shaders(backend: &'static str, place: &str) -> Self {
        let why = "it runs no GLSL; draw with --raster wgpu, on any Vulkan, Metal or DirectX 12 driver".to_owned();
        Self::Unsupported { backend, what: format!("own shaders ({place})"), why }
    }

    /// The name of the backend that it is of.
    #[must_use]
    pub fn backend(&self) -> &'static str {
        match self {
            Self::Unsupported { backend, .. } | Self::Device { backend, .. } => backend,
        }
    }

    /// What is wrong, for a line that names the backend already.
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
    /// `cpu` or `wgpu`.
    fn name(&self) -> &'static str;
    /// The largest viewport that it draws.
    fn limits(&self) -> Limits;
    /// The device and driver, in words.
    fn device(&self) -> String;
    /// Makes the scene ready to draw; the executor times it as an upload.
    ///
    /// # Errors
    /// If the device cannot hold it.
    fn upload(&mut self, scene: &Arc<RenderScene>) -> Result<(), BackendError>;
    /// Draws, and waits until it is done. `target` has the job's attachments allocated; a rasteriser in host memory writes
    /// them here, another keeps its own until [`Rasteriser::read_back`]. Pixels outside the viewport are left as they are.
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
    /// [`Rasteriser::draw`] with own shaders for some materials. They write no triangle ids.
    ///
    /// # Errors
    /// If the device fails, or it draws with none.
    fn draw_with(
        &mut self,
        job: &RasterJob<'_>,
        shaders: &OwnShaders<'_>,
        target: &mut GBuffer,
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
    /// Whether [`Rasteriser::read_back`] has anything to do.
    fn needs_read_back(&self) -> bool;
    /// Copies those of the attachments drawn last that are wanted into `target`; the others of `target` stay as they are.
    ///
    /// # Errors
    /// If the device fails.
    fn read_back(&mut self, job: &RasterJob<'_>, wanted: Attachments, target: &mut GBuffer)
    -> Result<(), BackendError>;
    /// Whether it draws exact spheres ([`Geometry::spheres`](crate::scene::Geometry::spheres)); none draws them into maps.
    fn draws_spheres(&self) -> bool {
        false
    }
    /// What a ray backend on the same device reads attachments by, without a copy: those of the last job that named some in
    /// [`RasterJob::shared`].
    fn lends(&mut self) -> Option<InPlace> {
        None
    }
    /// The device, if other interfaces of it can read what is drawn where it is.
    fn shares(&self) -> Option<DeviceUuid> {
        None
    }
    /// Makes memory for G-buffers of that size, in place of what was made before; jobs name in [`RasterJob::shared`] what
    /// is written there.
    ///
    /// # Errors
    /// If the device cannot share so much, or nothing at all.
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
    /// Where it fills quads; only on a device it runs [`Rasteriser::effect_in_place`] and [`Rasteriser::fill_on_device`].
    fn fills_quads(&self) -> QuadPlace {
        QuadPlace::Host
    }
    /// Runs a raster effect whose picture stays on the device under a number, for [`Rasteriser::fill_on_device`].
    ///
    /// # Errors
    /// As [`Rasteriser::effect`]; if pictures do not stay.
    fn effect_in_place(&mut self, _: &EffectJob<'_>, _: usize, _: &Progress) -> Result<EffectStats, BackendError> {
        Err(not_in_place(self.name()))
    }
    /// Fills a quad from what was drawn, computed and traced on the device, waits, and brings it into host memory in the form that is asked for.
    ///
    /// # Errors
    /// If the device fails, or what the quad reads is not there.
    fn fill_on_device(&mut self, _: &DeviceQuad, _: Shown<'_>) -> Result<DeviceQuadStats, BackendError> {
        Err(not_in_place(self.name()))
    }
}

/// The error of an engine whose pictures are in host memory.
fn not_in_place(backend: &'static str) -> BackendError {
    let (what, why) = ("pictures that stay on a device".to_owned(), "it leaves them in host memory".to_owned());
    BackendError::Unsupported { backend, what, why }
}

/// One effect pass. All images have the same size.
#[derive(Debug, Clone, Copy)]
pub struct EffectJob<'a> {
    /// What is drawn into maps; it was uploaded.
    pub scene: &'a RenderScene,
    /// What runs per pixel.
    pub program: EffectProgram,
    /// Its constants.
    pub params: EffectParams,
    /// Seed of the random numbers.
    pub seed: u32,
    /// The camera that drew the G-buffer, over the whole of it.
    pub view: View,
    /// The light, for programs that read it.
    pub sun: Option<Sun>,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Whether the G-buffer is what this rasteriser drew last, whole and unchanged, with every attachment that the program
    /// reads. Then it may use its own copy, and the slices below are empty if it needs read-back.
    pub resident: bool,
    /// World position and light cosine, 0 where nothing is seen; empty where the program does not read it.
    pub position: &'a [[f32; 4]],
    /// Shading normal; empty where the program does not read it.
    pub normal: &'a [[f32; 4]],
    /// Shaded colour; empty where the program does not read it.
    pub color: &'a [[f32; 4]],
    /// Triangle ids; empty where the program looks for no glass.
    pub triangle: &'a [u32],
    /// By material: what maps show.
    pub shades: &'a [Shade],
    /// By material: whether it is glass. Glass is in no cube map and in no mirror.
    pub glass: &'a [bool],
}

/// What a part of an effect took.
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
    /// Drawing the maps; `None` for an effect that has none, or drew none because nothing calls for it.
    pub maps: Option<Part>,
    /// Computing the pixels.
    pub pixels: Part,
    /// Copying the G-buffer to the device and the result back; `None` in host memory.
    pub transfer: Option<Duration>,
    /// Maps drawn; a cube map is one.
    pub map_count: u32,
    /// Triangles submitted for the maps.
    pub triangles: u64,
    /// Bytes that the maps take.
    pub bytes: u64,
    /// Pixels of glass, and those of them that no map serves: they keep their colour. Both 0 for a program whose maps serve all glass.
    pub glass_pixels: [u64; 2],
    /// Which way the pixels of glass were answered, in a program that marches rays through the picture.
    pub answers: Option<Answers>,
}

/// Pixels of glass, by what answered their rays. With [`Missing::Rays`](crate::raster_effects::Missing) the rasteriser writes an alpha of
/// [`Answers::LEFT`] to those of [`Answers::rays`], and the executor has them traced; all others have an alpha of 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Answers {
    /// The screen, all of them.
    pub screen: u64,
    /// A cube map, one of them at least.
    pub cube: u64,
    /// The counterpart program on the ray backend.
    pub rays: u64,
    /// None: one of them at least shows the glass's own colour.
    pub kept: u64,
}

impl Answers {
    /// Alpha of pixels that are left to the ray backend.
    pub const LEFT: f32 = -1.0;

    /// All pixels of glass.
    #[must_use]
    pub fn glass(self) -> u64 {
        self.screen + self.cube + self.rays + self.kept
    }

    /// Of so many pixels of glass, of which the screen answers some, some keep something of their colour, and `missing` stands for the rest.
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
    /// `glass: screen 41.20 %, cube 58.80 %`, without what answered none.
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

/// Attachments on their way into shared memory.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HandOver {
    /// What the memory's semaphore reaches when they are there.
    pub value: u64,
    /// Host time with synchronisation: not in that of the draw.
    pub host: Duration,
    /// Time on the device's own clock, where it has one: not in that of the draw.
    pub device: Option<Duration>,
}

/// What a draw did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DrawStats {
    /// Time on the device's own clock, where it has one.
    pub device_time: Option<Duration>,
    /// What bringing attachments into shared memory took, if that was asked for.
    pub shared: Option<HandOver>,
    /// Triangles submitted.
    pub triangles: u64,
}

/// One ray pass. All images have the same size.
#[derive(Debug, Clone, Copy)]
pub struct RayJob<'a> {
    /// What is traced.
    pub scene: &'a RenderScene,
    /// What runs per pixel.
    pub program: RayProgram,
    /// Its constants.
    pub params: RayParams,
    /// Mended or as written.
    pub fidelity: Fidelity,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Camera position, world.
    pub eye: Vec3,
    /// The light, for programs that read it.
    pub sun: Option<Sun>,
    /// Column and row, in the picture, of the images' top left pixel: random numbers belong to a pixel's place in the picture.
    pub origin: [u32; 2],
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// World position and light cosine; empty where the program does not read it.
    pub position: &'a [[f32; 4]],
    /// Shading normal; empty where the program does not read it.
    pub normal: &'a [[f32; 4]],
    /// Shaded colour; empty where the program does not read it.
    pub color: &'a [[f32; 4]],
    /// Triangle ids; empty in thesis fidelity and where the program traces no ray.
    pub triangle: &'a [u32],
    /// The G-buffer lies in shared memory, complete when its semaphore reaches this value, and the slices above are empty.
    pub shared: Option<u64>,
    /// What rays show that leave the scene, linear; black in the report's projects.
    pub beyond: Vec3,
    /// By material: what glass is, with `glass=auto` in corrected fidelity; empty where all glass is panes of the pass's index.
    pub dielectrics: &'a [Dielectric],
    /// By material: what closest hits shade with.
    pub shades: &'a [Shade],
    /// By material: whether rays bounce on it (`closest_hit_glass`).
    pub glass: &'a [bool],
    /// By material: whether shadow rays pass through it, dimmed (`any_hit_shadow_glass`).
    pub shadow_glass: &'a [bool],
    /// What a program reads whose rays start at the camera; `None` for one that starts from a G-buffer.
    pub from_camera: Option<FromCamera<'a>>,
}

/// Rays traced, by kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct RayCounts {
    /// Towards the light.
    pub shadow: u64,
    /// Ambient occlusion.
    pub occlusion: u64,
    /// Reflected.
    pub reflected: u64,
    /// Refracted.
    pub refracted: u64,
    /// From the camera.
    #[serde(default)]
    pub camera: u64,
    /// Occlusion rays that were not traced, because it was certain that nothing is in reach; not in the total.
    pub certain: u64,
    /// Paths in glass whose colour is not what it should be, not in the total: given up as black after too many surfaces, or in more
    /// bodies at once than are kept.
    #[serde(default)]
    pub lost: u64,
}

impl RayCounts {
    /// All that were traced.
    #[must_use]
    pub fn total(self) -> u64 {
        self.shadow + self.occlusion + self.reflected + self.refracted + self.camera
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.shadow += other.shadow;
        self.occlusion += other.occlusion;
        self.reflected += other.reflected;
        self.refracted += other.refracted;
        self.camera += other.camera;
        self.certain += other.certain;
        self.lost += other.lost;
    }
}

/// What a ray pass did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RayStats {
    /// Rays traced.
    pub rays: RayCounts,
    /// What copying the G-buffer to the device took, on the host, or to another device from the one that drew it, on its own
    /// clock; `None` where nothing was copied.
    pub upload: Option<Duration>,
    /// What copying the picture back took, on the host; `None` in host memory.
    pub read_back: Option<Duration>,
    /// Time on the device's own clock, where it has one.
    pub device_time: Option<Duration>,
    /// Bytes of device memory that the backend's passes hold from one to the next, besides what building gave: pictures,
    /// tables, lists. 0 for the processor.
    pub held_bytes: u64,
}

/// What building an acceleration structure gave.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BuildStats {
    /// Bytes held.
    pub bytes: u64,
    /// Nodes.
    pub nodes: u64,
}

/// A graphics device, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Gpu {
    /// Its name and what it has.
    pub name: String,
    /// Its driver.
    pub driver: String,
}

/// Runs ray programs.
pub trait RayBackend {
    /// `cpu`, and later `wgpu`, `cuda`, `optix`.
    fn name(&self) -> &'static str;
    /// The largest job that it runs.
    fn limits(&self) -> Limits {
        Limits::NONE
    }
    /// Whether it goes on with sequences of samples where another job ended: [`RayParams::first`] above 0.
    fn continues_sequences(&self) -> bool {
        true
    }
    /// The device and driver, in words.
    fn device(&self) -> String;
    /// The graphics devices among what it uses; none for the processor.
    fn gpus(&self) -> Vec<Gpu> {
        Vec::new()
    }
    /// Why a program cannot run here, or `Ok`.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with the reason.
    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError>;
    /// Why a program cannot run here with what these parameters ask of glass (corrected fidelity, in a scene that has glass), which
    /// the materials are ([`RayJob::dielectrics`]), or `Ok`. A backend knows the report's panes alone, unless it says otherwise.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with the reason, and what would help.
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
    /// Whether it traces exact spheres ([`Geometry::spheres`](crate::scene::Geometry::spheres)), in corrected fidelity.
    fn traces_spheres(&self) -> bool {
        false
    }
    /// Whether it traces soft shadows, of a light with a disc ([`RayParams::sun`] above 0).
    fn traces_sun_discs(&self) -> bool {
        false
    }
    /// Whether it filters the share that a program writes ([`RayParams::filter`] above 0).
    fn filters_shares(&self) -> bool {
        false
    }
    /// Builds the acceleration structure; the executor times it. `filtered` tells by material whether some pass may let
    /// rays through it (alpha-cut textures, glass that shadow rays pass).
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
    /// Whether the backend can read attachments where a rasteriser leaves them; from then on jobs with [`RayJob::shared`] do.
    fn reads(&mut self, _lent: &InPlace) -> bool {
        false
    }
    /// Whether the backend can read G-buffers in the memory of that device.
    fn joins(&self, _device: DeviceUuid) -> bool {
        false
    }
    /// Opens a shared G-buffer, in place of the one opened before; jobs with [`RayJob::shared`] read it.
    ///
    /// # Errors
    /// If the device refuses it.
    fn join(&mut self, _shared: SharedGBuffer) -> Result<(), BackendError> {
        let (what, why) = ("a shared G-buffer".to_owned(), "it reads host memory".to_owned());
        Err(BackendError::Unsupported { backend: self.name(), what, why })
    }
    /// Runs one pass into `output`, which has the job's size, and moves `progress` while it does.
    ///
    /// # Errors
    /// If the device fails or the job lacks what the program reads.
    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError>;
    /// Runs one pass whose picture stays, under a number, on the device of the rasteriser that lent what [`RayBackend::reads`] accepted.
    ///
    /// # Errors
    /// As [`RayBackend::run`]; if nothing was accepted.
    fn run_in_place(&mut self, _: &RayJob<'_>, _: usize, _: &Progress) -> Result<RayStats, BackendError> {
        Err(not_in_place(self.name()))
    }
}
