//! Projects: XML files and material libraries, read into checked and resolved data.
//!
//! Two dialects of the format are read, the engine's of 2014 and today's. Case is ignored in names of elements and attributes,
//! which covers most of the differences; otherwise both spellings are accepted. Declared names are case-sensitive, but if a name
//! differs only in case it is found, and a note says so.
//!
//! Defaults:
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
//! | attenuation of a positional light | none: constant 1, linear 0, quadratic 0 |
//! | pipeline that runs | the one with `default="true"`, or else the one that `<pipelines default="…">` names, or else the first |
//! | program of a `default` pass | the first of [`RASTER_PROGRAMS`](crate::programs::RASTER_PROGRAMS) |
//! | colours of a library material | diffuse 0.8, emission 0 |
//!
//! The library `curitiba_material_lib`, in today's dialect `__nau_material_lib`, is built in: `__Black`, `__White`,
//! `__Grey`, `__Red`, `__Green`, `__Blue`, and `__Emission White`, `Red`, `Green`, `Blue`, `Yellow`.
//!
//! Files are limited to 16 MiB, 64 levels of elements and 65,536 elements. The number of reported problems is limited too.

mod assets;
#[cfg(feature = "glsl")]
mod attribute_access;
mod attributes;
mod buffers;
mod camera_pass;
mod cameras;
mod compute;
mod contents;
mod dom;
mod draw;
mod edit;
mod effect;
mod file;
mod from_scene;
mod handed;
mod images;
mod intersection;
mod libraries;
mod library;
mod light_cameras;
mod lights;
mod loader;
mod order;
mod parameters;
mod passes;
mod pattern_pass;
mod ray;
mod report;
mod run_state;
mod running;
mod scenes;
#[cfg(feature = "glsl")]
mod scripts;
mod shader_values;
mod shaders;
mod source;
mod values;
mod write;

pub use contents::{Contents, Distribution};
pub use edit::Pose;
pub use from_scene::{Effects, FromSceneError, SceneOptions, SceneProjects, Up};
pub(crate) use light_cameras::frustum_corners;
pub use source::{SCENE_EXTENSIONS, SourceError, names_scenes, open, open_scenes, scene_files};
pub use write::WriteError;

use crate::camera_programs::SurfaceKind;
use crate::color::ColorSpace;
use crate::diagnostic::Problems;
use crate::glsl;
use crate::image::PixelFormat;
use crate::programs::{Query, RasterProgram, RayParams, RayProgram, Writes};
use crate::raster_effects::{EffectParams, EffectProgram};
use crate::scene::texture::{Magnification, Sampling};
use crate::scene::{
    self, BuildOptions, LoadOptions, LoadProgress, Placement, Scene, SceneError, Shape, TextureSource, shapes,
};
use glam::{DVec3, Vec3, Vec4};
use report::{Found, Names, shown, suggest};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A project whose references are resolved: every index below is valid.
#[derive(Debug, Clone)]
pub struct Project {
    /// The project file; for a project made from scenes, the first scene file.
    pub path: PathBuf,
    /// The path that was opened: a project file, a scene file, or a folder of scene files.
    pub source: PathBuf,
    /// Its name.
    pub name: String,
    /// Size of the window in pixels. Passes without a render target draw into the window.
    pub window: [u32; 2],
    /// Colour space, unless the user selects another.
    pub color: ColorSpace,
    /// Scenes.
    pub scenes: Vec<SceneDecl>,
    /// Viewports.
    pub viewports: Vec<Viewport>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Lights.
    pub lights: Vec<Light>,
    /// The cameras that belong to lights, for depth maps; their views follow from another camera.
    pub light_cameras: Vec<LightCamera>,
    /// Render targets of all material libraries.
    pub targets: Vec<RenderTarget>,
    /// Pipelines.
    pub pipelines: Vec<Pipeline>,
    /// Index of the default pipeline.
    pub default_pipeline: usize,
    /// Notes and warnings from reading (no errors).
    pub problems: Problems,
}

/// Loads a project and its material libraries.
///
/// # Errors
/// All problems of all files, each with its place, if there is an error among them.
pub fn load(path: &Path) -> Result<Project, Problems> {
    loader::load(path)
}

/// The scenes of a project file that could be read, even if other parts are in error, so that problems of the scene files can be
/// reported at the same time.
#[must_use]
pub fn declared_scenes(path: &Path) -> Vec<SceneDecl> {
    loader::scenes(path)
}

impl Project {
    /// Index of a pipeline by its name, ignoring case; without a name, the default pipeline.
    ///
    /// # Errors
    /// If there is no such pipeline (with the nearest name and the valid ones), or it cannot run (with the reason).
    pub fn pipeline(&self, name: Option<&str>) -> Result<usize, String> {
        let names = self.pipelines.iter().map(|pipeline| pipeline.name.as_str());
        let index = name.map_or(Ok(self.default_pipeline), |name| find("pipeline", name, names))?;
        match &self.pipelines[index].broken {
            Some(why) => Err(format!("pipeline `{}` cannot run: {why}", shown(&self.pipelines[index].name))),
            None => Ok(index),
        }
    }

    /// Index of a camera by its name, ignoring case.
    ///
    /// # Errors
    /// If there is no such camera; the message gives the nearest name and the valid ones.
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
    /// Files, relative paths resolved against the project's folder. They may not exist; the scene loader reports that.
    pub files: Vec<SceneFile>,
    /// A scene made in memory, in place of files.
    pub memory: Option<Arc<Scene>>,
    /// `<geometry>` primitives.
    pub shapes: Vec<Shape>,
    /// Where the first exact sphere is declared, for messages: `project.xml:12:17`. `None` if there is none.
    pub exact: Option<String>,
    /// Placement in the world: `<TRANSLATE>`, `<ROTATE>`, `<SCALE>`.
    pub place: Placement,
    /// `param="SWAP_YZ"`: maps `(x, y, z)` to `(x, z, -y)`, for models with z up.
    pub swap_yz: bool,
    /// `param="UNITIZE"`: centres the scene at the origin and scales it into [-1, 1].
    pub unitize: bool,
    /// `<sky material="…"/>`: the materials that are a sky around the scene ([`Material::sky`](scene::Material::sky)).
    pub sky: Vec<MaterialPattern>,
}

impl SceneDecl {
    /// A scene without files, primitives or a placement.
    pub(crate) fn empty(name: String) -> Self {
        Self {
            name,
            files: Vec::new(),
            memory: None,
            shapes: Vec::new(),
            exact: None,
            place: Placement::default(),
            swap_yz: false,
            unitize: false,
            sky: Vec::new(),
        }
    }

    /// Reads the scene's files, or copies the scene made in memory; adds the primitives; marks the materials of the sky.
    ///
    /// # Errors
    /// As [`scene::load`], or if the primitives need more memory than allowed.
    pub fn load(&self, options: &LoadOptions, progress: &dyn Fn(LoadProgress<'_>)) -> Result<Scene, SceneError> {
        let files: Vec<PathBuf> = self.files.iter().map(|file| file.path.clone()).collect();
        let mut scene = match &self.memory {
            Some(scene) => Scene::clone(scene),
            None => scene::load(&files, options, progress)?,
        };
        let named = self.files.first().map_or(Path::new(&self.name), |file| &file.path);
        shapes::add(&mut scene, &self.shapes, named, options.max_bytes)?;
        for pattern in &self.sky {
            let mut skies = scene.materials.iter_mut().filter(|material| pattern.matches(&material.name)).peekable();
            if let (None, MaterialPattern::Named(name)) = (skies.peek(), pattern) {
                let what = "skies of a material that the scene does not have";
                scene.warnings.add(named, what, "overlooked", || format!("`{}`", shown(name)));
            }
            skies.for_each(|material| material.sky = true);
        }
        Ok(scene)
    }

    /// Where its first exact sphere is declared; `None` without one. For exact spheres of a scene made in memory this is the scene's name.
    #[must_use]
    pub fn exact_sphere(&self) -> Option<&str> {
        let in_memory = self.memory.as_ref().filter(|scene| !scene.spheres.is_empty());
        self.exact.as_deref().or(in_memory.map(|_| self.name.as_str()))
    }

    /// Options to build the scene: `options`, with the project's axes, fitting and placement.
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
    /// Left and bottom edge: values up to 1 are fractions of the target, larger ones pixels.
    pub origin: [f32; 2],
    /// Width and height: values up to 1 are fractions of the target, larger ones pixels.
    pub size: [f32; 2],
    /// Clear colour.
    pub clear_color: Vec4,
}

/// Sides of the box that an orthographic camera sees, in world units from its axis; `left < right`, `bottom < top`. The box is
/// stretched to the viewport, whatever its aspect ratio.
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
    /// Position in world space, in `f64` as in the file.
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
    /// The orthographic projection, if it is one; [`Self::fov_y`] is then unused.
    pub orthographic: Option<Orthographic>,
    /// Index of its viewport, used by passes that name none.
    pub viewport: Option<usize>,
}

/// An orthographic camera that looks in the direction of a light and covers another camera's view between two distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightCamera {
    /// Index into [`Project::cameras`] of this camera. The plan decides its position and size.
    pub camera: usize,
    /// Index of the light, which is directional.
    pub light: usize,
    /// Index of the camera whose view it covers.
    pub covers: usize,
    /// Near distance of the covered part; [`Camera::near`] of the covered camera if `None`.
    pub from: Option<f32>,
    /// Far distance of the covered part; [`Camera::far`] of the covered camera if `None`.
    pub to: Option<f32>,
}

/// A light.
#[derive(Debug, Clone)]
pub struct Light {
    /// Name.
    pub name: String,
    /// Unit direction in which the light travels; `None` for a point or spot light.
    pub direction: Option<Vec3>,
    /// Position in world space; `None` for a light without one. A directional light may have a position.
    pub position: Option<DVec3>,
    /// Colour (`COLOR`, `DIFFUSE`).
    pub color: Vec3,
    /// Falloff of a positional light; the default, which is no falloff, for a directional light.
    pub falloff: Falloff,
}

impl Light {
    /// Its kind, for messages.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match (self.direction, self.falloff.spot) {
            (Some(_), _) => "directional",
            (None, Some(_)) => "spot",
            (None, None) => "point",
        }
    }
}

/// Falloff of a positional light with distance and direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Falloff {
    /// Constant, linear and quadratic coefficient of the polynomial in the distance by which the light is divided
    /// (`CONSTANT_ATT`, `LINEAR_ATT`, `QUADRATIC_ATT`). None is negative, and at least one is above 0.
    pub attenuation: [f32; 3],
    /// Distance beyond which the light has no effect (`RANGE`), above 0; infinity without a limit.
    pub range: f32,
    /// The cone of a spot light; `None` for a point light.
    pub spot: Option<Spot>,
}

impl Default for Falloff {
    /// OpenGL's default: no falloff.
    fn default() -> Self {
        Self { attenuation: [1.0, 0.0, 0.0], range: f32::INFINITY, spot: None }
    }
}

/// The cone of a spot light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Unit vector along the axis, pointing as the light travels (`SPOT_DIRECTION`).
    pub axis: Vec3,
    /// Angle between the axis and the edge of the light, in degrees (`SPOT_CUTOFF`), above 0 and at most 180. At 180 there is no cone, but
    /// [`Self::exponent`] applies.
    pub cutoff: f32,
    /// Angle to the axis up to which the light has its full strength, in degrees (`SPOT_INNER`), at most [`Self::cutoff`].
    pub inner: f32,
    /// Exponent of the cosine of the angle to the axis, by whose power the light is multiplied (`SPOT_EXPONENT`).
    pub exponent: f32,
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
    /// Clear value of the colour.
    pub clear_color: Vec4,
    /// Size of a storage buffer in bytes; its only channel holds them, 16 bytes a pixel. `None` for other targets.
    pub buffer: Option<u64>,
    /// Initial contents of a texture without a file at the start of a frame; `None` for zeros.
    pub contents: Option<Contents>,
    /// Colour channels, in order. The depth is the last channel if it has a name and there are at most two colours.
    pub channels: Vec<Channel>,
}

impl RenderTarget {
    /// Index of the channel that holds the depth, which is 0 at the near plane and 1 at the far plane; `None` without such a channel.
    #[must_use]
    pub fn depth(&self) -> Option<usize> {
        self.channels.iter().position(|channel| channel.depth)
    }
}

/// A colour or depth channel of a render target.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Name, by which later passes read it as a texture.
    pub name: String,
    /// Declared storage.
    pub format: PixelFormat,
    /// Whether it is the target's depth. Only passes whose own shaders draw all materials write it.
    pub depth: bool,
}

/// Reference to a channel of a render target.
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
    /// Index of the default camera of its passes.
    pub camera: Option<usize>,
    /// Passes, in order.
    pub passes: Vec<Pass>,
    /// Why the pipeline cannot run: the error of its first pass that could not be read. That pass, and possibly all others, are
    /// missing from [`Self::passes`]. Always `None` for the default pipeline.
    pub broken: Option<String>,
}

/// A pass.
#[derive(Debug, Clone)]
pub struct Pass {
    /// Name, as in the table of times and in `--set`.
    pub name: String,
    /// Place in the file, for messages: `project.xml:52:13`.
    pub place: String,
    /// Index of the pass's own viewport.
    pub viewport: Option<usize>,
    /// Index of the render target; `None` is the window.
    pub target: Option<usize>,
    /// What it clears before it draws.
    pub clears: Clears,
    /// What scripts decide about it; `None` for a pass without a test script for which scripts set nothing.
    pub scripted: Option<Scripted>,
    /// Kind and details.
    pub kind: PassKind,
}

impl Pass {
    /// Number of this run among the runs of the pass that scripts request, from 1 on.
    #[must_use]
    pub fn run(&self) -> u32 {
        self.scripted.as_ref().map_or(1, |scripted| scripted.run)
    }
}

/// What scripts decide about a pass. A pass that they repeat is in the pipeline once for each run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scripted {
    /// Number of the run, from 1 on.
    pub run: u32,
    /// Why it runs, and what scripts set for it, in words.
    pub told: String,
}

/// Kind and details of a pass.
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
    /// `class="optixPrime"` or `"embree"`.
    Intersection(IntersectionPass),
    /// `class="compute"`.
    Compute(ComputePass),
}

impl PassKind {
    /// The colours that replace those of materials.
    #[must_use]
    pub fn colors(&self) -> &[ColorMap] {
        match self {
            Self::Raster(raster) => &raster.colors,
            Self::Ray(ray) => &ray.colors,
            Self::Effect(effect) => &effect.colors,
            Self::Quad(_) | Self::Intersection(_) | Self::Compute(_) => &[],
        }
    }

    /// The own shader that fills a quad, or that a compute pass runs.
    #[must_use]
    pub fn shader(&self) -> Option<&OwnShader> {
        match self {
            Self::Quad(quad) => quad.shader.as_deref(),
            Self::Compute(compute) => Some(&compute.shader),
            Self::Raster(_) | Self::Ray(_) | Self::Effect(_) | Self::Intersection(_) => None,
        }
    }

    /// The own shaders of a pass that draws scenes, fills a quad or computes.
    pub fn shaders(&self) -> impl Iterator<Item = &OwnShader> + '_ {
        let drawing = match self {
            Self::Raster(raster) => &raster.shaders[..],
            _ => &[],
        };
        drawing.iter().map(|map| &*map.shader).chain(self.shader())
    }

    /// The channels of the storage buffers and images to which the pass's shaders store, and of the buffer
    /// [`CameraStart::linear`]. A channel may occur several times. The hits of an intersection pass are not among them: they are
    /// its target.
    pub fn buffers_stored(&self) -> impl Iterator<Item = ChannelRef> + '_ {
        let linear = self.linear().map(|target| ChannelRef { target, channel: 0 });
        self.shaders().flat_map(OwnShader::buffers_stored).chain(linear)
    }

    /// The buffer of [`CameraStart::linear`].
    #[must_use]
    pub fn linear(&self) -> Option<usize> {
        match self {
            Self::Ray(ray) => ray.from_camera.as_ref()?.linear,
            _ => None,
        }
    }

    /// The channels of the storage buffers and images that the pass's shaders read.
    pub fn buffers_read(&self) -> impl Iterator<Item = ChannelRef> + '_ {
        self.shaders().flat_map(OwnShader::buffers_read)
    }

    /// The buffers and images that the pass's shaders bind, each once.
    #[must_use]
    pub fn bound(&self) -> Vec<Bound> {
        let mut found: Vec<Bound> = Vec::new();
        for bound in self.shaders().flat_map(|shader| &shader.storage).flatten() {
            match found.iter_mut().find(|known| known.target == bound.target) {
                Some(known) => known.cleared |= bound.cleared,
                None => found.push(*bound),
            }
        }
        found
    }

    /// Indices of the lights that it names; empty for kinds of passes that read no lights.
    #[must_use]
    pub fn lights(&self) -> &[usize] {
        match self {
            Self::Raster(raster) => &raster.lights,
            Self::Ray(ray) => &ray.lights,
            Self::Effect(effect) => &effect.lights,
            Self::Quad(_) | Self::Intersection(_) | Self::Compute(_) => &[],
        }
    }

    /// Largest number of channels that a pass of this kind writes, counted from the first, if its target has as many.
    #[must_use]
    pub fn channels_written(&self) -> usize {
        match self {
            Self::Raster(_) => 3,
            Self::Quad(quad) => usize::from(quad.writes_color),
            Self::Ray(_) | Self::Effect(_) | Self::Intersection(_) | Self::Compute(_) => 1,
        }
    }

    /// Number of channels of `target` that the pass writes, counted from the first.
    #[must_use]
    pub fn channels_of(&self, target: &RenderTarget) -> usize {
        let keeps_depth = matches!(self, Self::Raster(raster) if raster.is_all_own());
        let channels = target.channels.iter().filter(|channel| keeps_depth || !channel.depth).count();
        channels.min(self.channels_written())
    }

    /// The kind of output of a ray or effect pass; an effect writes the same as its ray counterpart.
    #[must_use]
    pub fn writes(&self) -> Option<Writes> {
        match self {
            Self::Ray(ray) => Some(ray.program.info().writes),
            Self::Effect(effect) => Some(effect.program.info().counterpart.info().writes),
            Self::Raster(_) | Self::Quad(_) | Self::Intersection(_) | Self::Compute(_) => None,
        }
    }
}

/// The parts of its target that a raster or quad pass clears before it draws: `COLOR_CLEAR` and `DEPTH_CLEAR`. Parts that are not
/// cleared stay as earlier passes left them. Other kinds of passes clear nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Clears {
    /// All colour channels, and the triangle ids.
    pub color: bool,
    /// The depth.
    pub depth: bool,
}

impl Default for Clears {
    /// Everything.
    fn default() -> Self {
        Self { color: true, depth: true }
    }
}

/// Draws scenes.
#[derive(Debug, Clone)]
pub struct RasterPass {
    /// Indices of the scenes drawn.
    pub scenes: Vec<usize>,
    /// Indices of the cameras that the pass names among its scenes. The edges of their view frusta are drawn.
    pub frusta: Vec<usize>,
    /// How often the scenes are drawn, at least once. Only own shaders can distinguish the instances.
    pub instances: u32,
    /// Index of the camera.
    pub camera: usize,
    /// Indices of the lights, in order.
    pub lights: Vec<usize>,
    /// The program that runs per fragment.
    pub program: RasterProgram,
    /// Colour maps that replace colours of materials, applied in order.
    pub colors: Vec<ColorMap>,
    /// Own shaders of the project, which run instead of the program. If several match a material, the last one applies.
    pub shaders: Vec<ShaderMap>,
}

/// An own shader of the project and its materials.
#[derive(Debug, Clone)]
pub struct ShaderMap {
    /// The materials that it draws.
    pub to: MaterialPattern,
    /// The shader.
    pub shader: Arc<OwnShader>,
}

/// A compiled own shader of the project, and its inputs.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnShader {
    /// Name of the library material that contains it: `Library::material`.
    pub name: String,
    /// Where a pass names it, for messages: `project.xml:52:13`.
    pub place: String,
    /// The compiled program.
    pub program: Arc<glsl::Program>,
    /// Values of uniforms, by block and member; `None` keeps the uniform's own default.
    pub values: Vec<Vec<Option<glsl::Value>>>,
    /// Texture of each sampler.
    pub textures: Vec<ShaderTexture>,
    /// What is bound to each buffer and image of the program. No target is bound twice. `None` for an image to which nothing is
    /// bound: it is empty.
    pub storage: Vec<Option<Bound>>,
    /// Number of bound textures; `None` if the scene's material binds them.
    pub bound: Option<u32>,
    /// Number of textures bound in addition to those of the scene's material.
    pub injected: u32,
    /// How its triangles are drawn.
    pub drawn: glsl::Drawn,
}

impl RasterPass {
    /// Index of the own shader that draws a material; `None` if none does.
    #[must_use]
    pub fn own_shader(&self, material: &str) -> Option<usize> {
        self.shaders.iter().rposition(|map| map.to.matches(material))
    }

    /// Whether own shaders draw all materials.
    #[must_use]
    pub fn is_all_own(&self) -> bool {
        self.shaders.iter().any(|map| map.to == MaterialPattern::All)
    }
}

/// The texture of a sampler of an own shader.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ShaderTexture {
    /// The texture of the scene's material.
    Material,
    /// An image file.
    File(PathBuf),
    /// Six image files of a cube map, by direction: +x, -x, +y, -y, +z, -z.
    Cube([PathBuf; 6]),
    /// A channel that an earlier pass wrote, or a texture of random numbers.
    Channel(ChannelRef),
    /// A channel that an earlier pass wrote, and its mip levels from 1 on, to which earlier passes stored. Each side of a level
    /// is half of that of the level before, rounded down, and at least 1.
    Levels(Vec<ChannelRef>),
    /// No texture: reads opaque black, as in OpenGL.
    Nothing,
}

impl ShaderTexture {
    /// The image files that it is made of.
    #[must_use]
    pub fn files(&self) -> &[PathBuf] {
        match self {
            Self::File(path) => std::slice::from_ref(path),
            Self::Cube(paths) => paths,
            Self::Material | Self::Channel(_) | Self::Levels(_) | Self::Nothing => &[],
        }
    }
}

/// `ENGINES_PLAIN`: the engine's name for the material of OBJ triangles that name none. `PLAIN`: the name of this material here.
const ENGINES_PLAIN: &str = "DefaultOBJMaterial";
const PLAIN: &str = "default";

/// Which materials a map is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MaterialPattern {
    /// `*`: all materials.
    All,
    /// One name. `DefaultOBJMaterial` is also the material of OBJ triangles that name none.
    Named(String),
    /// All names with this beginning.
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

/// Colours that replace those of a material (`injectionMaps`, `materialMaps`). `None` keeps the material's own.
#[derive(Debug, Clone)]
pub struct ColorMap {
    /// The materials.
    pub to: MaterialPattern,
    /// New diffuse colour.
    pub diffuse: Option<Vec4>,
    /// New emission.
    pub emission: Option<Vec4>,
    /// Colours that only own shaders read.
    pub phong: PhongMap,
    /// What happens to the material's texture.
    pub texture: TextureMap,
}

/// What a [`ColorMap`] does to a material's texture, vertex colours and holes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum TextureMap {
    /// The texture, the vertex colours and the holes stay.
    #[default]
    Kept,
    /// The texture, the vertex colours and the holes are removed: a `materialMaps` entry replaces the whole material.
    Removed,
    /// This image file, with this filter for magnification, replaces the texture; vertex colours and holes are removed.
    File(PathBuf, Magnification),
}

impl TextureMap {
    /// The texture that takes the place of the material's own; `None` if the own texture stays or is removed.
    pub(crate) fn source(&self) -> Option<TextureSource> {
        match self {
            Self::File(path, magnification) => {
                let sampling = Sampling { magnification: *magnification, ..Sampling::default() };
                Some(TextureSource::File(path.clone()).sampled(sampling))
            }
            Self::Kept | Self::Removed => None,
        }
    }
}

/// Further colours of a [`ColorMap`], which only own shaders read. `None` keeps the material's own.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PhongMap {
    /// New ambient colour.
    pub ambient: Option<Vec4>,
    /// New specular colour.
    pub specular: Option<Vec4>,
    /// New Phong exponent.
    pub shininess: Option<f32>,
}

/// Properties of a pass whose rays start at the camera.
#[derive(Debug, Clone)]
pub struct CameraStart {
    /// The behaviour of rays at materials. If several patterns match, the last one applies.
    pub surfaces: Vec<(MaterialPattern, SurfaceKind)>,
    /// Whether the light is a point light instead of a directional one.
    pub lamp: bool,
    /// Why this program was chosen; empty if the project names it.
    pub why: String,
    /// Index into [`Project::targets`] of the storage buffer that also gets the pass's colours: before `gamma`, not rounded to
    /// the target's format, a vec4 a pixel, the bottom row first. It has room for the whole target. `None` if no pass reads such
    /// a buffer.
    pub linear: Option<usize>,
}

/// Traces rays, from a G-buffer or from the camera.
#[derive(Debug, Clone)]
pub struct RayPass {
    /// Indices of the scenes that rays can hit.
    pub scenes: Vec<usize>,
    /// Index of the camera.
    pub camera: usize,
    /// Indices of the lights, in order. Programs whose rays start at the camera have only the first light.
    pub lights: Vec<usize>,
    /// The program that runs per pixel.
    pub program: RayProgram,
    /// Constants of the program, with the XML's attributes applied.
    pub params: RayParams,
    /// The channel bound to `pos_buffer`.
    pub position: Option<ChannelRef>,
    /// The channel bound to `norm_buffer`.
    pub normal: Option<ChannelRef>,
    /// The channel bound to `color_buffer`.
    pub color: Option<ChannelRef>,
    /// Colour maps that replace colours of the hit materials.
    pub colors: Vec<ColorMap>,
    /// Materials on which rays bounce (`closest_hit_glass`).
    pub glass: Vec<MaterialPattern>,
    /// Materials through which shadow rays pass (`any_hit_shadow_glass`).
    pub shadow_glass: Vec<MaterialPattern>,
    /// Properties of a pass whose rays start at the camera; `None` for rays from a G-buffer.
    pub from_camera: Option<CameraStart>,
}

/// Computes by rasterisation what a ray pass computes by tracing rays, from the same G-buffer.
#[derive(Debug, Clone)]
pub struct EffectPass {
    /// Indices of the scenes that the pass draws into its maps, such as shadow maps and cube maps.
    pub scenes: Vec<usize>,
    /// Index of the camera with which the G-buffer was drawn.
    pub camera: usize,
    /// Indices of the lights, in order.
    pub lights: Vec<usize>,
    /// The program that runs per pixel.
    pub program: EffectProgram,
    /// Constants of the program, with the XML's attributes applied.
    pub params: EffectParams,
    /// The channel bound to `pos_buffer`.
    pub position: Option<ChannelRef>,
    /// The channel bound to `norm_buffer`.
    pub normal: Option<ChannelRef>,
    /// The channel bound to `color_buffer`.
    pub color: Option<ChannelRef>,
    /// Colour maps that replace colours of the materials in the pass's maps.
    pub colors: Vec<ColorMap>,
    /// Materials that are glass.
    pub glass: Vec<MaterialPattern>,
}

/// Traces the rays in a storage buffer, and writes their hits into another buffer, which is the pass's target.
///
/// A ray is eight floats: its origin, the least distance, its direction and the greatest distance. Distances are multiples of the
/// direction's length. A hit is the distance, the triangle's id as the bits of an integer, and the barycentric coordinates of the
/// triangle's second and third corner; a ray that hits nothing has the distance -1 and the id -1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IntersectionPass {
    /// Indices of the scenes that rays can hit.
    pub scenes: Vec<usize>,
    /// Index of the buffer of rays, into [`Project::targets`].
    pub rays: usize,
    /// Index of the buffer of hits, into [`Project::targets`].
    pub hits: usize,
    /// How many rays of the buffer are traced, from the first on.
    pub count: RaysTraced,
    /// Which hit of each ray is written.
    pub query: Query,
}

impl IntersectionPass {
    /// Bytes of a ray.
    pub const RAY: u64 = 32;
    /// Bytes of a hit.
    pub const HIT: u64 = 16;

    /// The channels of the buffers that it reads.
    pub fn reads(&self) -> impl Iterator<Item = ChannelRef> {
        let count = match self.count {
            RaysTraced::Counted { buffer, .. } => Some(buffer),
            RaysTraced::Fixed(_) => None,
        };
        [self.rays].into_iter().chain(count).map(|target| ChannelRef { target, channel: 0 })
    }

    /// Whether it writes its whole buffer of hits.
    #[must_use]
    pub fn fills(&self, hits: &RenderTarget) -> bool {
        self.count == RaysTraced::Fixed(hits.buffer.unwrap_or_default() / Self::HIT)
    }

    /// Whether it binds a buffer.
    #[must_use]
    pub fn binds(&self, target: usize) -> bool {
        self.hits == target || self.reads().any(|channel| channel.target == target)
    }
}

/// How many rays of a buffer are traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RaysTraced {
    /// This number of rays.
    Fixed(u64),
    /// As many as a 32-bit integer in a buffer says, at most `most`; all `most` if it is negative.
    Counted {
        /// Index of the buffer, into [`Project::targets`].
        buffer: usize,
        /// Where the integer lies in it, bytes from the start.
        offset: u64,
        /// Number of rays and of hits for which both buffers have room.
        most: u64,
    },
}

impl RaysTraced {
    /// The largest possible number of rays.
    #[must_use]
    pub fn most(self) -> u64 {
        match self {
            Self::Fixed(count) | Self::Counted { most: count, .. } => count,
        }
    }
}

/// Fills a viewport from textures.
#[derive(Debug, Clone)]
pub struct QuadPass {
    /// Source of the pixels.
    pub source: QuadSource,
    /// The own shader of [`QuadSource::Own`].
    pub shader: Option<Arc<OwnShader>>,
    /// Whether the pass writes colours to its target. If not, only what its shader stores remains.
    pub writes_color: bool,
}

impl OwnShader {
    /// Whether it is a built-in shader, which replaces a ray pass that traces no rays.
    #[must_use]
    pub fn is_pattern(&self) -> bool {
        self.name.split_once("::").is_some_and(|(library, _)| library == libraries::BUILT_IN[0])
    }

    /// The channels of the storage buffers and images that it reads.
    pub fn buffers_read(&self) -> impl Iterator<Item = ChannelRef> + '_ {
        self.buffers(|buffer| buffer.read)
    }

    /// The channels of the storage buffers and images that it stores to.
    pub fn buffers_stored(&self) -> impl Iterator<Item = ChannelRef> + '_ {
        self.buffers(|buffer| buffer.written)
    }

    fn buffers(&self, used: fn(&glsl::StorageBuffer) -> bool) -> impl Iterator<Item = ChannelRef> + '_ {
        let bound = self.storage.iter().zip(&self.program.storage).filter(move |(_, buffer)| used(buffer));
        bound.filter_map(|(bound, _)| Some(ChannelRef { target: bound.as_ref()?.target, channel: 0 }))
    }

    /// Whether it binds the buffer or image that is held in a target.
    #[must_use]
    pub fn binds(&self, target: usize) -> bool {
        self.storage.iter().flatten().any(|bound| bound.target == target)
    }

    /// The channels of targets that it samples: those that earlier passes wrote, and textures of random numbers.
    pub fn sampled(&self) -> impl Iterator<Item = ChannelRef> + '_ {
        self.textures
            .iter()
            .flat_map(|texture| match texture {
                ShaderTexture::Channel(channel) => std::slice::from_ref(channel),
                ShaderTexture::Levels(levels) => levels,
                ShaderTexture::Material | ShaderTexture::File(_) | ShaderTexture::Cube(_) | ShaderTexture::Nothing => {
                    &[]
                }
            })
            .copied()
    }
}

/// The target that is bound to a storage buffer or an image of a shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bound {
    /// Index into [`Project::targets`]. Of a target with several channels, the first is bound.
    pub target: usize,
    /// Whether it is filled with zeros before the pass.
    pub cleared: bool,
}

/// Runs a compute shader of the project's own, which stores to images and buffers.
#[derive(Debug, Clone)]
pub struct ComputePass {
    /// The shader.
    pub shader: Arc<OwnShader>,
    /// Number of workgroups in each direction, at least 1.
    pub groups: [u32; 3],
    /// The first image or buffer that it stores to, an index into [`Project::targets`]: the pass's target.
    pub stored: usize,
}

impl QuadPass {
    /// A pass without a shader of the project's own.
    #[must_use]
    pub fn new(source: QuadSource) -> Self {
        Self { source, shader: None, writes_color: true }
    }
}

/// Source of a quad pass's pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QuadSource {
    /// A single channel.
    Show(ChannelRef),
    /// Texture unit 0 times the `x` of texture unit 1.
    Combine {
        /// Channel of unit 0.
        color: ChannelRef,
        /// Channel of unit 1.
        factor: ChannelRef,
    },
    /// The result of [`QuadPass::shader`].
    Own,
}

#[cfg(test)]
mod tests;
