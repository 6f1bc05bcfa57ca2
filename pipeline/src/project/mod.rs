//! Projects: the XML files and material libraries, read into checked and resolved data.
//!
//! Two dialects of the format are read, the engine's of 2014 and today's. Names of elements and attributes are read in
//! any letters' case, so most of what differs between them needs no care; the rest is both spellings side by side.
//! Declared names are compared as written; where only the letters' case differs they are found, and a note says so.
//!
//! Where a project is silent:
//!
//! | what | is |
//! |---|---|
//! | window | 1024 x 1024 |
//! | `color` | `report`: colours and textures are used as stored |
//! | viewport rectangle, its clear colour | the whole window, opaque black |
//! | clear colour of a render target | opaque black |
//! | height of a viewport with a `ratio` | `ratio` times its width |
//! | camera of a pass | the pipeline's `defaultCamera`; without one, an error |
//! | projection | 60 degrees, near 1, far 10,000 |
//! | position, view, up of a camera | the origin, -z (each with a note), +y |
//! | colour of a light | white |
//! | pipeline that runs | the one with `default="true"`, or else the first |
//! | program of a `default` pass | the first of [`RASTER_PROGRAMS`](crate::programs::RASTER_PROGRAMS) |
//! | colours of a library material | diffuse 0.8, emission 0 |
//!
//! The library `curitiba_material_lib` (today `__nau_material_lib`) is built in: `__Black`, `__White`, `__Grey`, `__Red`,
//! `__Green`, `__Blue`, and `__Emission White`, `Red`, `Green`, `Blue`, `Yellow`.
//!
//! Files are bounded (16 MiB, 64 levels of elements, 65,536 elements), and so is what is reported.

mod assets;
mod buffers;
mod camera_pass;
mod cameras;
mod dom;
mod draw;
mod edit;
mod effect;
mod file;
mod from_scene;
mod handed;
mod libraries;
mod library;
mod light_cameras;
mod loader;
mod order;
mod parameters;
mod passes;
mod ray;
mod report;
mod scenes;
mod shader_values;
mod shaders;
mod source;
mod values;
mod write;

pub use edit::Pose;
pub use from_scene::{Effects, FromSceneError, SceneOptions, SceneProjects, Up};
pub use source::{SCENE_EXTENSIONS, SourceError, names_scenes, open, open_scenes, scene_files};
pub use write::WriteError;

use crate::camera_programs::SurfaceKind;
use crate::color::ColorSpace;
use crate::diagnostic::Problems;
use crate::glsl;
use crate::image::PixelFormat;
use crate::programs::{RasterProgram, RayParams, RayProgram, Writes};
use crate::raster_effects::{EffectParams, EffectProgram};
use crate::scene::{self, BuildOptions, LoadOptions, LoadProgress, Placement, Scene, SceneError, Shape, shapes};
use glam::{DVec3, Vec3, Vec4};
use report::{Found, Names, shown, suggest};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A project whose references are resolved: every index below is valid.
#[derive(Debug, Clone)]
pub struct Project {
    /// The file it was read from; the first scene file where it was made from scenes.
    pub path: PathBuf,
    /// What was named to open it: the project file, a scene file, or a folder of them.
    pub source: PathBuf,
    /// Its name.
    pub name: String,
    /// Window size, pixels: what a pass without a render target draws into.
    pub window: [u32; 2],
    /// What its colours are, unless the user asks for something else.
    pub color: ColorSpace,
    /// Scenes.
    pub scenes: Vec<SceneDecl>,
    /// Viewports.
    pub viewports: Vec<Viewport>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Those of the cameras that a light has, to draw its depth map: what they see follows from another camera.
    pub light_cameras: Vec<LightCamera>,
    /// Render targets of all material libraries.
    pub targets: Vec<RenderTarget>,
    /// Pipelines.
    pub pipelines: Vec<Pipeline>,
    /// Index of the pipeline that runs unless another is asked for.
    pub default_pipeline: usize,
    /// Notes and warnings met while reading (never errors).
    pub problems: Problems,
}

/// Loads a project and its material libraries.
///
/// # Errors
/// All problems of all files, each with its place, if any of them is an error.
pub fn load(path: &Path) -> Result<Project, Problems> {
    loader::load(path)
}

/// The scenes of a project file that could be read, though other parts of it are wrong: so that what is wrong with their files can be
/// said at the same time.
#[must_use]
pub fn declared_scenes(path: &Path) -> Vec<SceneDecl> {
    loader::scenes(path)
}

impl Project {
    /// Index of a pipeline by its name, in any letters' case; without a name, the default one.
    ///
    /// # Errors
    /// What would be valid, and the nearest name; why it cannot run.
    pub fn pipeline(&self, name: Option<&str>) -> Result<usize, String> {
        let names = self.pipelines.iter().map(|pipeline| pipeline.name.as_str());
        let index = name.map_or(Ok(self.default_pipeline), |name| find("pipeline", name, names))?;
        match &self.pipelines[index].broken {
            Some(why) => Err(format!("pipeline `{}` cannot run: {why}", shown(&self.pipelines[index].name))),
            None => Ok(index),
        }
    }

    /// Index of a camera by its name, in any letters' case.
    ///
    /// # Errors
    /// What would be valid, and the nearest name.
    pub fn camera(&self, name: &str) -> Result<usize, String> {
        find("camera", name, self.cameras.iter().map(|camera| camera.name.as_str()))
    }
}

fn find<'a>(what: &'static str, name: &str, valid: impl Iterator<Item = &'a str>) -> Result<usize, String> {
    let mut names = Names::new(what);
    valid.for_each(|name| names.declare_built_in(name));
    match names.find(name) {
        Found::Exact(index) | Found::OtherCase(index) => Ok(index),
        Found::Missing => Err(format!("there is no {what} `{}`; {}", shown(name), suggest(name, names.iter()))),
    }
}

/// A scene and its files.
#[derive(Debug, Clone)]
pub struct SceneDecl {
    /// Name.
    pub name: String,
    /// Files, resolved against the project's folder; they may not exist (the loader says so).
    pub files: Vec<SceneFile>,
    /// A scene that was made in memory, in the place of files.
    pub memory: Option<Arc<Scene>>,
    /// `<geometry>` primitives.
    pub shapes: Vec<Shape>,
    /// Where the first exact sphere is declared: `project.xml:12:17`, for messages. `None` where no primitive is one.
    pub exact: Option<String>,
    /// What places all of it in the world: `<TRANSLATE>`, `<ROTATE>`, `<SCALE>`.
    pub place: Placement,
    /// `param="SWAP_YZ"`: y and z are exchanged (z negated), for models with z up.
    pub swap_yz: bool,
    /// `param="UNITIZE"`: centred at the origin and scaled into [-1, 1].
    pub unitize: bool,
}

impl SceneDecl {
    /// Reads its files and adds its primitives.
    ///
    /// # Errors
    /// As [`scene::load`]; primitives that need more memory than allowed.
    pub fn load(&self, options: &LoadOptions, progress: &dyn Fn(LoadProgress<'_>)) -> Result<Scene, SceneError> {
        let files: Vec<PathBuf> = self.files.iter().map(|file| file.path.clone()).collect();
        let mut scene = match &self.memory {
            Some(scene) => Scene::clone(scene),
            None => scene::load(&files, options, progress)?,
        };
        let named = self.files.first().map_or(Path::new(&self.name), |file| &file.path);
        shapes::add(&mut scene, &self.shapes, named, options.max_bytes)?;
        Ok(scene)
    }

    /// Where its first exact sphere is declared; `None` without any. What a scene made in memory has counts.
    #[must_use]
    pub fn exact_sphere(&self) -> Option<&str> {
        let in_memory = self.memory.as_ref().filter(|scene| !scene.spheres.is_empty());
        self.exact.as_deref().or(in_memory.map(|_| self.name.as_str()))
    }

    /// How it is made ready: as `options` say, and turned, fitted and placed as the project does.
    #[must_use]
    pub fn build_options(&self, options: BuildOptions) -> BuildOptions {
        BuildOptions { swap_yz: self.swap_yz, unitize: self.unitize, transform: self.place.matrix(), ..options }
    }
}

/// A scene file and where it is named.
#[derive(Debug, Clone)]
pub struct SceneFile {
    /// The file.
    pub path: PathBuf,
    /// `project.xml:12:17`, for messages.
    pub place: String,
}

/// A rectangle of a target.
#[derive(Debug, Clone)]
pub struct Viewport {
    /// Name.
    pub name: String,
    /// Left and bottom edge: a fraction of the target up to 1, pixels above.
    pub origin: [f32; 2],
    /// Width and height: a fraction of the target up to 1, pixels above.
    pub size: [f32; 2],
    /// Clear colour.
    pub clear_color: Vec4,
}

/// The sides of what a camera without perspective sees, in world units from its axis; `left < right`, `bottom < top`. They are stretched over
/// the viewport, whatever its shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orthographic {
    /// Along the camera's right vector.
    pub left: f32,
    /// Along the camera's right vector.
    pub right: f32,
    /// Along the camera's up vector.
    pub bottom: f32,
    /// Along the camera's up vector.
    pub top: f32,
}

/// A camera.
#[derive(Debug, Clone)]
pub struct Camera {
    /// Name.
    pub name: String,
    /// Position, world, with the digits of the file.
    pub position: DVec3,
    /// Unit viewing direction.
    pub direction: Vec3,
    /// Up vector, not parallel to [`Self::direction`].
    pub up: Vec3,
    /// Vertical field of view, radians, in (0, π).
    pub fov_y: f32,
    /// Near plane distance, above 0 with perspective.
    pub near: f32,
    /// Far plane distance, above [`Self::near`].
    pub far: f32,
    /// What it sees where it has no perspective; the angle then means nothing.
    pub orthographic: Option<Orthographic>,
    /// Index of its viewport, used by passes that name none.
    pub viewport: Option<usize>,
}

/// A camera without perspective that sees, in the direction of a light, what another camera sees between two distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightCamera {
    /// Index into [`Project::cameras`]: the camera that it is. Its place and shape are decided by the plan.
    pub camera: usize,
    /// Index of the light, which has a direction.
    pub light: usize,
    /// Index of the camera whose view it covers.
    pub covers: usize,
    /// From which distance on; [`Camera::near`] of that camera if `None`.
    pub from: Option<f32>,
    /// Up to which distance; [`Camera::far`] of that camera if `None`.
    pub to: Option<f32>,
}

/// A light.
#[derive(Debug, Clone)]
pub struct Light {
    /// Name.
    pub name: String,
    /// Unit direction in which the light travels; `None` for a light that has only a position.
    pub direction: Option<Vec3>,
    /// Where it is, world; `None` for a light that has only a direction.
    pub position: Option<DVec3>,
    /// Colour (`COLOR`, `DIFFUSE`).
    pub color: Vec3,
}

/// A render target of a material library.
#[derive(Debug, Clone)]
pub struct RenderTarget {
    /// Name of the library.
    pub library: String,
    /// Name in the library.
    pub name: String,
    /// Declared size, pixels.
    pub size: [u32; 2],
    /// What the colour is cleared to before a pass draws into it.
    pub clear_color: Vec4,
    /// Of a storage buffer its bytes: its only channel holds them, 16 a pixel. `None` of what passes draw into.
    pub buffer: Option<u64>,
    /// Colour channels, in order; behind them the depth, where it has a name and no more than two colours are before it.
    pub channels: Vec<Channel>,
}

impl RenderTarget {
    /// The channel that holds the depth: 0 at the near plane, 1 at the far plane.
    #[must_use]
    pub fn depth(&self) -> Option<usize> {
        self.channels.iter().position(|channel| channel.depth)
    }
}

/// A colour channel of a render target.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Name: the texture that later passes read.
    pub name: String,
    /// Declared storage.
    pub format: PixelFormat,
    /// Whether it is the target's depth, which only passes write that own shaders draw all of.
    pub depth: bool,
}

/// A channel of a render target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChannelRef {
    /// Index into [`Project::targets`].
    pub target: usize,
    /// Index into [`RenderTarget::channels`].
    pub channel: usize,
}

/// A sequence of passes.
#[derive(Debug, Clone)]
pub struct Pipeline {
    /// Name.
    pub name: String,
    /// Index of the camera of passes that name none.
    pub camera: Option<usize>,
    /// Passes, in order.
    pub passes: Vec<Pass>,
    /// Why it cannot run: what is wrong with its first pass that could not be read, which then is not among the passes. Never of the default
    /// pipeline.
    pub broken: Option<String>,
}

/// A pass.
#[derive(Debug, Clone)]
pub struct Pass {
    /// Name: the key of its timing row and of `--set`.
    pub name: String,
    /// `project.xml:52:13`, for messages.
    pub place: String,
    /// Index of the viewport it names.
    pub viewport: Option<usize>,
    /// Index of the render target; `None` is the window.
    pub target: Option<usize>,
    /// What it does.
    pub kind: PassKind,
}

/// What a pass does.
#[derive(Debug, Clone)]
pub enum PassKind {
    /// `class="default"`.
    Raster(RasterPass),
    /// `class="optix"` or `"rt"`.
    Ray(RayPass),
    /// `class="effect"`.
    Effect(EffectPass),
    /// `class="quad"`.
    Quad(QuadPass),
}

impl PassKind {
    /// How many channels of its target a pass writes, from the first.
    #[must_use]
    pub fn channels_written(&self) -> usize {
        match self {
            Self::Raster(_) => 3,
            Self::Ray(_) | Self::Effect(_) | Self::Quad(_) => 1,
        }
    }

    /// Of a target with these channels, how many a pass writes, from the first.
    #[must_use]
    pub fn channels_of(&self, target: &RenderTarget) -> usize {
        let keeps_depth = matches!(self, Self::Raster(raster) if raster.is_all_own());
        let channels = target.channels.iter().filter(|channel| keeps_depth || !channel.depth).count();
        channels.min(self.channels_written())
    }

    /// What the program of a ray or effect pass writes; an effect writes what its counterpart by rays does.
    #[must_use]
    pub fn writes(&self) -> Option<Writes> {
        match self {
            Self::Ray(ray) => Some(ray.program.info().writes),
            Self::Effect(effect) => Some(effect.program.info().counterpart.info().writes),
            Self::Raster(_) | Self::Quad(_) => None,
        }
    }
}

/// Draws scenes.
#[derive(Debug, Clone)]
pub struct RasterPass {
    /// Indices of the scenes drawn.
    pub scenes: Vec<usize>,
    /// How often they are drawn, at least once. Own shaders alone tell one time from another.
    pub instances: u32,
    /// Index of the camera.
    pub camera: usize,
    /// Index of the first light, if any.
    pub light: Option<usize>,
    /// What runs per pixel.
    pub program: RasterProgram,
    /// Colours put in the place of materials' own, applied in order.
    pub colors: Vec<ColorMap>,
    /// The project's own shaders, which run instead; of several that fit a material the last one counts.
    pub shaders: Vec<ShaderMap>,
}

/// An own shader of the project, and what it is for.
#[derive(Debug, Clone)]
pub struct ShaderMap {
    /// For which materials.
    pub to: MaterialPattern,
    /// What runs.
    pub shader: Arc<OwnShader>,
}

/// A compiled shader of the project's own, and what it is given.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnShader {
    /// Its material: `Library::material`.
    pub name: String,
    /// `project.xml:52:13`: where a pass names it, for messages.
    pub place: String,
    /// What runs.
    pub program: Arc<glsl::Program>,
    /// By block and member of the program: what a uniform is given; `None` for what it has by itself.
    pub values: Vec<Vec<Option<glsl::Value>>>,
    /// By sampler of the program.
    pub textures: Vec<ShaderTexture>,
    /// By buffer of the program: what is bound, an index into [`Project::targets`].
    pub storage: Vec<usize>,
    /// Textures that are bound; `None` where it is the scene's material that binds them.
    pub bound: Option<u32>,
    /// Textures that are bound beside those of the scene's material.
    pub injected: u32,
    /// How its triangles are drawn.
    pub drawn: glsl::Drawn,
}

impl RasterPass {
    /// The own shader that draws a material, by its index.
    #[must_use]
    pub fn own_shader(&self, material: &str) -> Option<usize> {
        self.shaders.iter().rposition(|map| map.to.matches(material))
    }

    /// Whether own shaders draw all that it draws.
    #[must_use]
    pub fn is_all_own(&self) -> bool {
        self.shaders.iter().any(|map| map.to == MaterialPattern::All)
    }
}

/// What a sampler of an own shader reads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ShaderTexture {
    /// The texture of the scene's material.
    Material,
    /// An image file.
    File(PathBuf),
    /// What an earlier pass wrote; in quad passes.
    Channel(ChannelRef),
    /// Nothing is bound: black and opaque, as OpenGL has it.
    Nothing,
}

/// What the engine calls the material of OBJ triangles that name none, and what it is called here.
const ENGINES_PLAIN: &str = "DefaultOBJMaterial";
const PLAIN: &str = "default";

/// Which materials a map is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MaterialPattern {
    /// `*`.
    All,
    /// One name. `DefaultOBJMaterial` is also the material of OBJ triangles that name none.
    Named(String),
    /// Names that begin so.
    Beginning(String),
}

impl MaterialPattern {
    /// Whether a material's name matches.
    #[must_use]
    pub fn matches(&self, name: &str) -> bool {
        match self {
            Self::All => true,
            Self::Named(named) => named == name || named == ENGINES_PLAIN && name == PLAIN,
            Self::Beginning(beginning) => name.starts_with(beginning.as_str()),
        }
    }
}

/// Colours that replace a material's own (`injectionMaps`, `materialMaps`). `None` leaves one as it is.
#[derive(Debug, Clone)]
pub struct ColorMap {
    /// For which materials.
    pub to: MaterialPattern,
    /// New diffuse colour.
    pub diffuse: Option<Vec4>,
    /// New emission.
    pub emission: Option<Vec4>,
    /// What own shaders alone read.
    pub phong: PhongMap,
    /// Whether the material's texture is dropped too (a `materialMaps` entry replaces the whole material).
    pub drops_texture: bool,
}

/// Other colours of a [`ColorMap`], which own shaders alone read. `None` leaves one as it is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PhongMap {
    /// New ambient colour.
    pub ambient: Option<Vec4>,
    /// New specular colour.
    pub specular: Option<Vec4>,
    /// New Phong exponent.
    pub shininess: Option<f32>,
}

/// What a pass has whose rays start at the camera.
#[derive(Debug, Clone)]
pub struct CameraStart {
    /// What rays do at which materials; of several that fit the last one counts.
    pub surfaces: Vec<(MaterialPattern, SurfaceKind)>,
    /// Whether the light shines from its place, and not along its direction.
    pub lamp: bool,
    /// Why the program was taken; empty where the project names it.
    pub why: String,
}

/// Traces rays, from a G-buffer or from the camera.
#[derive(Debug, Clone)]
pub struct RayPass {
    /// Indices of the scenes that rays meet.
    pub scenes: Vec<usize>,
    /// Index of the camera.
    pub camera: usize,
    /// Index of the first light, if any.
    pub light: Option<usize>,
    /// What runs per pixel.
    pub program: RayProgram,
    /// Its constants, after the XML's attributes.
    pub params: RayParams,
    /// What `pos_buffer` reads.
    pub position: Option<ChannelRef>,
    /// What `norm_buffer` reads.
    pub normal: Option<ChannelRef>,
    /// What `color_buffer` reads.
    pub color: Option<ChannelRef>,
    /// Colours that replace those of the materials hit.
    pub colors: Vec<ColorMap>,
    /// Materials on which rays bounce (`closest_hit_glass`).
    pub glass: Vec<MaterialPattern>,
    /// Materials through which shadow rays pass (`any_hit_shadow_glass`).
    pub shadow_glass: Vec<MaterialPattern>,
    /// What a program reads whose rays start at the camera; `None` for one that starts from a G-buffer.
    pub from_camera: Option<CameraStart>,
}

/// Computes by raster what a ray pass computes by rays, from the same G-buffer.
#[derive(Debug, Clone)]
pub struct EffectPass {
    /// Indices of the scenes that its maps show.
    pub scenes: Vec<usize>,
    /// Index of the camera: the one that the G-buffer was drawn with.
    pub camera: usize,
    /// Index of the first light, if any.
    pub light: Option<usize>,
    /// What runs per pixel.
    pub program: EffectProgram,
    /// Its constants, after the XML's attributes.
    pub params: EffectParams,
    /// What `pos_buffer` reads.
    pub position: Option<ChannelRef>,
    /// What `norm_buffer` reads.
    pub normal: Option<ChannelRef>,
    /// What `color_buffer` reads.
    pub color: Option<ChannelRef>,
    /// Colours that replace those of the materials that maps show.
    pub colors: Vec<ColorMap>,
    /// Materials that are glass.
    pub glass: Vec<MaterialPattern>,
}

/// Fills a viewport from textures.
#[derive(Debug, Clone)]
pub struct QuadPass {
    /// What it shows.
    pub source: QuadSource,
    /// The own shader of [`QuadSource::Own`].
    pub shader: Option<Arc<OwnShader>>,
}

impl OwnShader {
    /// The channels of storage buffers that it reads (`read`), or else those that it stores to.
    pub fn stored(&self, read: bool) -> impl Iterator<Item = ChannelRef> + '_ {
        let bound = self.storage.iter().zip(&self.program.storage);
        let used = bound.filter(move |(_, buffer)| if read { buffer.read } else { buffer.written });
        used.map(|(target, _)| ChannelRef { target: *target, channel: 0 })
    }
}

impl QuadPass {
    /// The storage buffers that it reads (`read`), or else those that it stores to.
    pub fn stored(&self, read: bool) -> impl Iterator<Item = ChannelRef> + '_ {
        self.shader.iter().flat_map(move |shader| shader.stored(read))
    }

    /// A pass without a shader of the project's own.
    #[must_use]
    pub fn new(source: QuadSource) -> Self {
        Self { source, shader: None }
    }
}

/// What a quad pass shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QuadSource {
    /// One channel.
    Show(ChannelRef),
    /// Unit 0 times the `x` of unit 1.
    Combine {
        /// Unit 0.
        color: ChannelRef,
        /// Unit 1.
        factor: ChannelRef,
    },
    /// What [`QuadPass::shader`] makes of the textures that it samples.
    Own,
}
