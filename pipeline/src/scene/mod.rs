//! Scenes: as files describe them ([`Scene`]), and as passes use them ([`RenderScene`]).

mod bytes;
mod cbo;
mod collada;
mod context;
pub(crate) mod dispersion;
mod error;
mod fingerprint;
#[cfg(feature = "gltf")]
mod gltf;
pub(crate) mod lines;
mod load;
pub mod normal_map;
mod obj;
mod ogre;
mod origin;
mod parallel;
pub(crate) mod reflectance;
mod render;
pub(crate) mod shapes;
mod statistics;
mod studio;
pub mod texture;
mod xml_text;

pub use cbo::{Layout, write_cbo};
pub use error::{Place, SceneError};
pub use fingerprint::fnv1a;
pub use load::{LoadOptions, LoadProgress, load};
pub use render::BuildOptions;
#[cfg(feature = "glsl")]
pub(crate) use render::texture::image_channels;
pub(crate) use render::texture::{image_file, image_files};
pub use shapes::{Placement, Shape, ShapeKind};
pub use statistics::{FileStatistics, MaterialStatistics, Statistics, statistics};

use crate::color::ColorSpace;
use crate::diagnostic::Warnings;
use glam::{DMat4, DVec3, Mat4, Vec2, Vec3, Vec4};
use reflectance::Reflectance;
use std::path::PathBuf;
use std::sync::Arc;
use texture::{Sampling, Texture, Wrap};

/// A scene as files describe it: shared meshes, placed by objects.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Meshes. Each is stored once, however often it is placed.
    pub meshes: Vec<Mesh>,
    /// Placed meshes.
    pub objects: Vec<Object>,
    /// Materials; names are unique.
    pub materials: Vec<Material>,
    /// Sources of the textures. [`RenderScene::build`] decodes those in use (see [`texture`]).
    pub textures: Vec<TextureSource>,
    /// Placed exact spheres; they have no mesh.
    pub spheres: Vec<PlacedSphere>,
    /// Perspective cameras of the files, in scene coordinates. They are used by a project that is made from the scene; other
    /// projects have cameras of their own.
    pub cameras: Vec<SceneCamera>,
    /// Lights of the files, used like the cameras.
    pub lights: Vec<SceneLight>,
    /// Position of the scene's origin in the files' coordinates. It is 0 unless the files' contents lie so far from 0 that `f32`
    /// would lose digits of them.
    pub origin: DVec3,
    /// Warnings about contents that were skipped or replaced while loading.
    pub warnings: Warnings,
    /// The files that the scene was loaded from, in order. The first [`LoadedFile::objects`] objects belong to the first file, and
    /// so on. Empty for a scene made in memory.
    pub files: Vec<LoadedFile>,
}

/// A file that a scene was loaded from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LoadedFile {
    /// The file.
    pub path: PathBuf,
    /// Number of [`Scene::meshes`] that come from this file.
    pub meshes: u32,
    /// Number of [`Scene::objects`] that come from this file.
    pub objects: u32,
}

/// Indexed triangles, grouped by material.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Name in the file.
    pub name: String,
    /// Positions in model space.
    pub positions: Vec<Vec3>,
    /// Normals in model space as the file has them; [`RenderScene::build`] normalises them. As many as positions, or none if the
    /// file has none or the load needs none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of unit 0, `v = 0` at the bottom row: as many as positions, or none.
    pub texcoords: Vec<Vec2>,
    /// Vertex colours, display values, which multiply the surface's colour and alpha: as many as positions, or none. [`RenderScene::build`]
    /// clamps them to 0..=1.
    pub colors: Vec<Vec4>,
    /// Tangents in model space: xyz is the direction of growing u, w the sign of the bitangent `w * cross(normal, tangent)`, the
    /// direction of growing v. As the file has them: as many as positions, or none; [`RenderScene::build`] computes missing ones.
    pub tangents: Vec<Vec4>,
    /// Triangles by material.
    pub groups: Vec<Group>,
}

/// The triangles of a mesh that share a material.
#[derive(Debug, Clone, Default)]
pub struct Group {
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

/// A perspective camera of a scene file.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneCamera {
    /// Name in the file.
    pub name: String,
    /// Position, relative to [`Scene::origin`].
    pub position: Vec3,
    /// Unit viewing direction.
    pub direction: Vec3,
    /// Unit up vector.
    pub up: Vec3,
    /// Vertical field of view, radians, in (0, π).
    pub fov_y: f32,
    /// Width of the camera's picture divided by its height, above 0; `None` where the file leaves it open.
    pub aspect: Option<f32>,
    /// Near plane distance, above 0.
    pub near: f32,
    /// Far plane distance, above [`Self::near`]; `None` where the file leaves it open.
    pub far: Option<f32>,
}

/// A light of a scene file.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneLight {
    /// Name in the file.
    pub name: String,
    /// Unit direction in which the light travels, world; 0 for a point light.
    pub direction: Vec3,
    /// Colour times intensity, as the file has it: in lux for a directional light, in candela for others.
    pub color: Vec3,
    /// Position, relative to [`Scene::origin`]; `None` for a directional light. Light from a position falls off with the square of the
    /// distance.
    pub position: Option<Vec3>,
    /// Distance beyond which light from a position has no effect; infinity without a limit.
    pub range: f32,
    /// Angles to the axis of a spot light, in radians, at which its light begins to fade and at which it is 0. `None` for other lights.
    pub cone: Option<[f32; 2]>,
}

/// A mesh placed in the world.
#[derive(Debug, Clone)]
pub struct Object {
    /// Name in the file.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Model to world, relative to [`Scene::origin`]. [`load`] leaves out objects whose transforms are not finite.
    pub transform: Mat4,
}

/// The sphere of radius 1 about the origin, placed in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedSphere {
    /// Name, for messages.
    pub name: String,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Model to world, relative to [`Scene::origin`]: rotation, translation and uniform scale only.
    pub transform: Mat4,
}

impl Scene {
    /// The transform of one of the scene's objects to the files' coordinates.
    #[must_use]
    pub fn to_world(&self, object: &Object) -> DMat4 {
        DMat4::from_translation(self.origin) * object.transform.as_dmat4()
    }
}

/// Source of a texture's texels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TextureSource {
    /// An existing file.
    File(PathBuf),
    /// An encoded image inside a scene file (GLB, data URI).
    Embedded {
        /// Name for messages, such as `file.glb#image3`.
        name: String,
        /// Bytes of the encoded image (PNG, JPEG). Sources with different samplings share them.
        bytes: Arc<[u8]>,
    },
    /// Two existing files: colours from one, alpha from the red channel of the other (MTL `map_d`).
    Masked {
        /// The colours.
        color: PathBuf,
        /// The alpha, resampled to the size of the colours.
        mask: PathBuf,
    },
    /// Another source whose sampling is not repetition with trilinear filtering.
    Sampled {
        /// The texels.
        source: Box<TextureSource>,
        /// Wrap modes, and the magnification mode.
        sampling: Sampling,
    },
    /// Another source whose texels are data, not colours (normals, roughness): never decoded from sRGB.
    Data {
        /// The texels.
        source: Box<TextureSource>,
    },
    /// Transmittance of another source's alpha: 1 - `opacity` * alpha, in all channels. Always within [`Self::Data`].
    Clear {
        /// The texels.
        source: Box<TextureSource>,
        /// The factor of alpha, in 65,535ths.
        opacity: u16,
    },
}

impl TextureSource {
    /// The path of the file, or the name of the embedded image.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Embedded { name, .. } => name.clone(),
            Self::Masked { color, mask } => format!("{} with {}", color.display(), mask.display()),
            Self::Sampled { source, .. } | Self::Data { source } => source.name(),
            Self::Clear { source, .. } => format!("the alpha of {}", source.name()),
        }
    }

    /// This source, marked as data instead of colours.
    #[must_use]
    pub fn data(self) -> Self {
        Self::Data { source: Box::new(self) }
    }

    /// Whether the texels are data instead of colours.
    #[must_use]
    pub fn is_data(&self) -> bool {
        matches!(self, Self::Data { .. })
    }

    /// The transmittance of this source's alpha ([`Self::Clear`]), as data. `opacity` is the factor of alpha, in 65,535ths.
    #[must_use]
    pub fn clear(self, opacity: u16) -> Self {
        Self::Clear { source: Box::new(self), opacity }.data()
    }

    /// Whether the texels are the transmittance of another source's alpha.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        matches!(self, Self::Data { source } if matches!(**source, Self::Clear { .. }))
    }

    /// This source with a sampling. It must not have one already.
    #[must_use]
    pub fn sampled(self, sampling: Sampling) -> Self {
        if sampling == Sampling::default() { self } else { Self::Sampled { source: Box::new(self), sampling } }
    }

    /// This source with other wrap modes.
    #[must_use]
    pub fn wrapped(self, wrap: [Wrap; 2]) -> Self {
        self.sampled(Sampling::wrapped(wrap))
    }

    /// The innermost source, which holds the texels, and the sampling with which they are read.
    #[must_use]
    pub fn texels(&self) -> (&Self, Sampling) {
        match self {
            Self::Sampled { source, sampling } => (source.texels().0, *sampling),
            Self::Data { source } | Self::Clear { source, .. } => source.texels(),
            source => (source, Sampling::default()),
        }
    }
}

/// A surface's parameters, as the report's programs and the glTF extensions name them.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Unique name; project files map materials by it.
    pub name: String,
    /// Diffuse colour and opacity.
    pub diffuse: Vec4,
    /// Ambient colour.
    pub ambient: Vec4,
    /// Specular colour.
    pub specular: Vec4,
    /// Emitted colour. In CBO and NBO it is added to the light that multiplies the texture, as in the report's programs.
    pub emission: Vec4,
    /// Whether the emitted colour, times [`Self::emission_texture`], is added to the shaded colour (glTF, MTL, COLLADA).
    pub emission_added: bool,
    /// Texture that multiplies the emitted colour, at the coordinates of [`Self::texture`]: index into [`Scene::textures`].
    pub emission_texture: Option<u32>,
    /// Phong exponent.
    pub shininess: f32,
    /// Texture of unit 0: index into [`Scene::textures`].
    pub texture: Option<u32>,
    /// Normal map: vectors in tangent space (tangent, bitangent, normal), at the coordinates of [`Self::texture`]; green points to
    /// growing v. Index into [`Scene::textures`].
    pub normal_texture: Option<u32>,
    /// Factor of x and y of the normal map's vectors; finite.
    pub normal_scale: f32,
    /// Alpha test: the surface has a hole where the product of the alphas of texture, vertex colour and [`Self::diffuse`] is below this. `None`
    /// cuts no holes.
    pub alpha_cutoff: Option<f32>,
    /// Whether some triangles of the material have vertex colours ([`Geometry::colors`]) other than white. [`RenderScene::build`] sets it;
    /// `false` before.
    pub vertex_colors: bool,
    /// Whether it is a sky around the scene. In corrected fidelity a sky is shown in its own colours whatever the light, and blocks neither
    /// shadow nor ambient occlusion rays. Projects declare skies ([`SceneDecl::sky`](crate::project::SceneDecl::sky)), scene files do not.
    pub sky: bool,
    /// Whether cameras cull its back faces, whose corners run clockwise on screen (glTF unless `doubleSided`). Rays hit both sides:
    /// light that entered glass must leave it, and a wall blocks light from either side.
    pub single_sided: bool,
    /// Share of the light that enters (glTF `KHR_materials_transmission`), 0..=1.
    pub transmission: f32,
    /// Texture whose red channel, which is not decoded from sRGB, multiplies the share of light that is not scattered back (1 - [`Self::veil`]), at the
    /// coordinates of [`Self::texture`] (glTF `transmissionTexture`). Index into [`Scene::textures`].
    pub transmission_texture: Option<u32>,
    /// Whether the surface bounds a solid body instead of being a thin wall (glTF `thicknessFactor` above 0; MTL `illum` 6 and 7).
    /// This field and the following ones apply with `glass=auto`; a pane of the rule `glass=pane` has only the pass's index of refraction.
    pub volume: bool,
    /// Share of light, by colour, that passes the surface at each crossing, in addition to Fresnel's term: glTF's base colour, or
    /// the square root of MTL's `Tf` for a body, since light crosses its surface twice. Linear, 0..=1.
    pub filter: Vec3,
    /// Share of reflected light, by colour, that is kept at each reflection by glass (glTF `extras.reflectionColor`). Linear, 0..=1.
    pub reflection: Vec3,
    /// Reflectance of glass that replaces Fresnel's equations (glTF `extras.schlick`); `None`: that of the pass's `fresnel`.
    pub reflectance: Option<Reflectance>,
    /// Whether the texture's colour is part of the filter (glTF) and not only of the diffuse colour (MTL).
    pub filter_textured: bool,
    /// Share of the entering light that is scattered back with the diffuse colour, 0..=1.
    pub veil: f32,
    /// Rank of a body where bodies overlap: the highest rank wins, and among equal ranks the body entered last (glTF
    /// `extras.priority`, 0 to 255).
    pub priority: u8,
    /// Index of refraction (MTL `Ni`, glTF `KHR_materials_ior`), 1..=∞.
    pub ior: f32,
    /// Dispersion: 20 divided by the Abbe number (glTF `KHR_materials_dispersion`), 0 or more.
    pub dispersion: f32,
    /// Roughness of the surface as glass (glTF `roughnessFactor`, MTL `Pr`), 0..=1. Its square is the width alpha of the microfacet
    /// distribution.
    pub roughness: f32,
    /// Texture whose green channel, as a number, multiplies the roughness, at the coordinates of [`Self::texture`] (glTF
    /// `metallicRoughnessTexture`, MTL `map_Pr`). Index into [`Scene::textures`].
    pub roughness_texture: Option<u32>,
    /// Thickness in scene units, as the file has it (glTF `KHR_materials_volume`). Used only for a surface with a volume that is
    /// not a closed mesh.
    pub thickness: f32,
    /// Colour of white light after [`Self::attenuation_distance`] inside the body, linear.
    pub attenuation_color: Vec3,
    /// Distance in scene units; infinite without absorption.
    pub attenuation_distance: f32,
}

impl Default for Material {
    /// The engine's own default: a light grey diffuse surface.
    fn default() -> Self {
        Self {
            name: String::new(),
            diffuse: Vec4::new(0.8, 0.8, 0.8, 1.0),
            ambient: Vec4::new(0.2, 0.2, 0.2, 1.0),
            specular: Vec4::new(0.0, 0.0, 0.0, 1.0),
            emission: Vec4::new(0.0, 0.0, 0.0, 1.0),
            emission_added: false,
            emission_texture: None,
            shininess: 0.0,
            texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            alpha_cutoff: None,
            vertex_colors: false,
            sky: false,
            single_sided: false,
            transmission: 0.0,
            transmission_texture: None,
            volume: false,
            filter: Vec3::ONE,
            reflection: Vec3::ONE,
            reflectance: None,
            filter_textured: false,
            priority: 0,
            veil: 0.0,
            ior: 1.5,
            dispersion: 0.0,
            roughness: 0.0,
            roughness_texture: None,
            thickness: 0.0,
            attenuation_color: Vec3::ONE,
            attenuation_distance: f32::INFINITY,
        }
    }
}

impl Material {
    /// Every reference to a texture.
    pub(crate) fn textures_mut(&mut self) -> [&mut Option<u32>; 5] {
        [
            &mut self.texture,
            &mut self.emission_texture,
            &mut self.normal_texture,
            &mut self.roughness_texture,
            &mut self.transmission_texture,
        ]
    }

    /// The indices of all textures that the material has.
    pub(crate) fn textures(&self) -> impl Iterator<Item = u32> + use<> {
        let of_glass = [self.roughness_texture, self.transmission_texture];
        [self.texture, self.emission_texture, self.normal_texture].into_iter().chain(of_glass).flatten()
    }

    /// Alpha cutoff for the alpha of texture and vertices alone: [`Self::alpha_cutoff`] divided by the diffuse opacity, infinite
    /// for an opacity of 0. `None` if nothing is cut.
    pub(crate) fn cutoff(&self) -> Option<f32> {
        let opacity = self.diffuse.w;
        let scaled = |cutoff: f32| if opacity > 0.0 { cutoff / opacity } else { f32::INFINITY };
        let cuts = self.texture.is_some() || self.vertex_colors;
        self.alpha_cutoff.filter(|cutoff| *cutoff > 0.0 && cuts).map(scaled)
    }
}

/// The parts of a scene that are needed; others are neither read nor stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// Vertex normals; computed if the file has none.
    pub normals: bool,
    /// Texture coordinates of unit 0, and the textures.
    pub textures: bool,
    /// Vertex colours, if files have them.
    pub colors: bool,
    /// Normal maps of materials that have them, with their tangents and texture coordinates; only with [`Self::normals`].
    pub normal_maps: bool,
    /// Roughness and transmission textures of glass, and the alpha of blended texels; only with [`Self::textures`].
    pub glass_maps: bool,
    /// Tangents of all meshes, for shaders that read them; only with [`Self::normals`] and [`Self::textures`].
    pub tangents: bool,
}

impl Needs {
    /// Everything that files hold, for conversions, except tangents that no normal map uses.
    pub const ALL: Needs =
        Needs { normals: true, textures: true, colors: true, normal_maps: true, glass_maps: true, tangents: false };

    /// Positions only.
    pub const NOTHING: Needs = Needs {
        normals: false,
        textures: false,
        colors: false,
        normal_maps: false,
        glass_maps: false,
        tangents: false,
    };
}

/// Triangles and spheres in world space, sorted by material: the input of rasterisers and ray tracers.
///
/// Surface ids: the id of a triangle is its index in [`Self::triangles`]; the ids of the spheres follow, in their order.
///
/// Invariants: every index is below `positions.len()`, every position is finite, no triangle has zero area, normals are unit
/// length, and `normals`, `texcoords`, `colors` and `tangents` are as long as `positions`, or empty if they are not needed or no
/// mesh has them.
#[derive(Debug, Clone, Default)]
pub struct Geometry {
    /// Positions, relative to [`RenderScene::origin`].
    pub positions: Vec<Vec3>,
    /// Shading normals in world space; in thesis fidelity in model space, as the report's program wrote them.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of unit 0, `v = 0` at the bottom row.
    pub texcoords: Vec<Vec2>,
    /// Vertex colours, which multiply the surface's colour and alpha, in [`Self::color_space`]; white for vertices of meshes
    /// without colours. Empty if no mesh has any.
    pub colors: Vec<Vec4>,
    /// Tangents: xyz is the unit direction of growing u, about perpendicular to the normal; w is the sign of the bitangent `w *
    /// cross(normal, tangent)`, the direction of growing v. 0 for meshes without a normal map. Empty if no mesh has one.
    pub tangents: Vec<Vec4>,
    /// The colour space of [`Self::colors`].
    pub color_space: ColorSpace,
    /// Vertex indices; the position in this list is the triangle's id everywhere.
    pub triangles: Vec<[u32; 3]>,
    /// Runs of triangles with one material, in ascending order of materials, covering all triangles.
    pub batches: Vec<Batch>,
    /// Exact spheres, in ascending order of their materials. Their normals point outwards; they have neither texture coordinates
    /// nor vertex colours.
    pub spheres: Vec<Sphere>,
    /// The triangles of a sky ([`Material::sky`]). Cameras and the rays of mirrors and glass see them; shadow and occlusion rays do not.
    /// Rasterisers write only their colour, as if nothing were drawn there.
    pub sky: TriangleRanges,
}

/// An exact sphere in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Centre, relative to [`RenderScene::origin`]; finite.
    pub center: Vec3,
    /// Radius; finite and above 0.
    pub radius: f32,
    /// Index into [`RenderScene::materials`].
    pub material: u32,
}

/// A run of triangles with one material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Batch {
    /// Index into [`RenderScene::materials`].
    pub material: u32,
    /// First triangle.
    pub first: u32,
    /// Number of triangles.
    pub count: u32,
}

impl Geometry {
    /// Material index of a triangle.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[inline]
    #[must_use]
    pub fn material_of(&self, triangle: u32) -> u32 {
        let next = self.batches.partition_point(|batch| batch.first <= triangle);
        self.batches[next - 1].material
    }

    /// The sphere with a surface id; `None` for ids of triangles and for ids out of range.
    #[inline]
    #[must_use]
    pub fn sphere(&self, id: u32) -> Option<&Sphere> {
        self.spheres.get((id as usize).checked_sub(self.triangles.len())?)
    }

    /// Number of triangles and spheres: all surface ids are below it.
    #[must_use]
    pub fn surfaces(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// The material of each triangle, in their order.
    pub fn materials(&self) -> impl Iterator<Item = u32> {
        self.batches.iter().flat_map(|batch| std::iter::repeat_n(batch.material, batch.count as usize))
    }

    /// The corner positions of a triangle.
    #[inline]
    #[must_use]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|vertex| self.positions[vertex as usize])
    }
}

/// The surface ids of some materials, as ranges. Surfaces are sorted by material, so there are few ranges, and testing an id takes
/// a few comparisons instead of a search for its material among all batches.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TriangleRanges(Vec<[u32; 2]>);

impl TriangleRanges {
    /// The surfaces whose material is marked.
    #[must_use]
    pub fn new(geometry: &Geometry, marked: &[bool]) -> Self {
        let mut ranges = Self::default();
        ranges.find(geometry, marked);
        ranges
    }

    /// Replaces the ranges by those of the marked materials; materials beyond the end of `marked` are not marked.
    pub fn find(&mut self, geometry: &Geometry, marked: &[bool]) {
        self.0.clear();
        self.find_triangles(geometry, marked);
        for (sphere, id) in geometry.spheres.iter().zip(geometry.triangles.len() as u32..) {
            if marked.get(sphere.material as usize) == Some(&true) {
                self.add(id, 1);
            }
        }
    }

    /// The triangles whose material is marked, without the spheres.
    #[must_use]
    pub fn of_triangles(geometry: &Geometry, marked: &[bool]) -> Self {
        let mut ranges = Self::default();
        ranges.find_triangles(geometry, marked);
        ranges
    }

    fn find_triangles(&mut self, geometry: &Geometry, marked: &[bool]) {
        let is_marked = |batch: &&Batch| batch.count > 0 && marked.get(batch.material as usize) == Some(&true);
        for &Batch { first, count, .. } in geometry.batches.iter().filter(is_marked) {
            self.add(first, count);
        }
    }

    fn add(&mut self, first: u32, count: u32) {
        match self.0.last_mut() {
            Some([_, end]) if *end == first => *end += count,
            _ => self.0.push([first, first + count]),
        }
    }

    /// The ranges `[first, end)`, in ascending order; none is empty, and no two are adjacent.
    #[must_use]
    pub fn as_slice(&self) -> &[[u32; 2]] {
        &self.0
    }

    /// Whether there are no ranges.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether a surface id is in one of the ranges.
    #[inline]
    #[must_use]
    pub fn contains(&self, triangle: u32) -> bool {
        let next = self.0.partition_point(|[first, _]| *first <= triangle);
        next > 0 && triangle < self.0[next - 1][1]
    }
}

/// A scene ready for rendering: flat geometry, materials, and decoded textures.
#[derive(Debug, Clone, Default)]
pub struct RenderScene {
    /// All surfaces.
    pub geometry: Geometry,
    /// Materials; [`Batch::material`] is an index into this list, and [`Material::texture`] one into [`Self::textures`].
    pub materials: Vec<Material>,
    /// Decoded textures.
    pub textures: Vec<Texture>,
    /// World position of the origin of [`Geometry::positions`]: 0, or near a scene that is far from 0. Cameras are relative to it
    /// too.
    pub origin: DVec3,
}

impl RenderScene {
    /// By material: whether it is [a sky](Material::sky).
    #[must_use]
    pub fn skies(&self) -> Vec<bool> {
        self.materials.iter().map(|material| material.sky).collect()
    }

    /// Appends another scene's triangles, materials and textures.
    ///
    /// # Panics
    /// If the two were made for different [`Needs`] or origins, or together have 2^32 or more vertices or surfaces.
    pub fn append(&mut self, other: RenderScene) {
        let index =
            |length: usize| u32::try_from(length).expect("at most 2^32 vertices, triangles, materials and textures");
        assert!(self.origin == other.origin, "both scenes have the same origin");
        let geometry = &mut self.geometry;
        let whole = geometry.positions.len() + other.geometry.positions.len();
        if !other.geometry.colors.is_empty() {
            geometry.color_space = other.geometry.color_space;
        }
        fn join<T: Clone>(list: &mut Vec<T>, other: &[T], before: usize, whole: usize, missing: T) {
            if !(list.is_empty() && other.is_empty()) {
                list.resize(before, missing.clone());
                list.extend_from_slice(other);
                list.resize(whole, missing);
            }
        }
        let before = geometry.positions.len();
        join(&mut geometry.colors, &other.geometry.colors, before, whole, Vec4::ONE);
        // If only normal maps need texture coordinates, a scene without normal maps may have none.
        join(&mut geometry.texcoords, &other.geometry.texcoords, before, whole, Vec2::ZERO);
        join(&mut geometry.tangents, &other.geometry.tangents, before, whole, Vec4::ZERO);
        let (vertices, triangles) = (index(geometry.positions.len()), index(geometry.triangles.len()));
        let (materials, textures) = (index(self.materials.len()), index(self.textures.len()));
        index(whole);
        index(geometry.surfaces() + other.geometry.surfaces());
        for &[first, end] in other.geometry.sky.as_slice() {
            geometry.sky.add(first + triangles, end - first);
        }
        geometry.positions.extend(other.geometry.positions);
        geometry.normals.extend(other.geometry.normals);
        let normals = geometry.normals.len();
        assert!(normals == 0 || normals == geometry.positions.len(), "both scenes have the same needs");
        geometry
            .triangles
            .extend(other.geometry.triangles.iter().map(|corners| corners.map(|vertex| vertex + vertices)));
        geometry.batches.extend(other.geometry.batches.iter().map(|batch| Batch {
            material: batch.material + materials,
            first: batch.first + triangles,
            count: batch.count,
        }));
        geometry.spheres.extend(
            other.geometry.spheres.iter().map(|sphere| Sphere { material: sphere.material + materials, ..*sphere }),
        );
        self.materials.extend(other.materials.into_iter().map(|mut material| {
            material.textures_mut().into_iter().flatten().for_each(|texture| *texture += textures);
            material
        }));
        self.textures.extend(other.textures);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_of_marked_materials_are_found_as_by_their_materials() {
        let batch = |material, first, count| Batch { material, first, count };
        let geometry = Geometry {
            batches: vec![batch(4, 0, 3), batch(1, 3, 2), batch(2, 5, 0), batch(0, 5, 4), batch(3, 9, 1)],
            triangles: vec![[0; 3]; 10],
            ..Geometry::default()
        };
        for marks in 0..32_u32 {
            let marked: Vec<bool> = (0..5).map(|material| marks >> material & 1 == 1).collect();
            let found = TriangleRanges::new(&geometry, &marked);
            for triangle in 0..10 {
                assert_eq!(
                    found.contains(triangle),
                    marked[geometry.material_of(triangle) as usize],
                    "{marks:b} {triangle}"
                );
            }
            assert!(found.as_slice().len() <= 3 && !found.contains(10) && !found.contains(u32::MAX));
        }
        assert!((0..10).all(|triangle| !TriangleRanges::new(&geometry, &[]).contains(triangle)));
    }

    #[test]
    fn spheres_come_after_the_triangles() {
        let sphere = |material| Sphere { center: Vec3::ZERO, radius: 1.0, material };
        let mut geometry = Geometry {
            triangles: vec![[0; 3]; 4],
            batches: vec![Batch { material: 0, first: 0, count: 2 }, Batch { material: 2, first: 2, count: 2 }],
            spheres: [0, 1, 2, 2].map(sphere).to_vec(),
            ..Geometry::default()
        };
        assert_eq!(
            (geometry.sphere(3), geometry.sphere(5).map(|s| s.material), geometry.sphere(8)),
            (None, Some(1), None)
        );
        assert_eq!(geometry.surfaces(), 8);
        let found = |marked: &[bool], geometry: &Geometry| TriangleRanges::new(geometry, marked).as_slice().to_vec();
        assert_eq!(found(&[true, false, false], &geometry), [[0, 2], [4, 5]]);
        assert_eq!(found(&[false, false, true], &geometry), [[2, 4], [6, 8]]);
        assert_eq!(found(&[true; 3], &geometry), [[0, 8]]);
        geometry.spheres.clear();
        assert_eq!(found(&[true; 3], &geometry), [[0, 4]]);
        let mut scene = RenderScene { materials: vec![Material::default(); 3], ..RenderScene::default() };
        scene.geometry.spheres.push(sphere(2));
        scene.append(scene.clone());
        assert_eq!(scene.geometry.spheres.iter().map(|sphere| sphere.material).collect::<Vec<_>>(), [2, 5]);
    }
}
