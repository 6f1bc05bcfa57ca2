//! Scenes: what the files hold ([`Scene`]) and what the passes use ([`RenderScene`]).

mod bytes;
mod cbo;
mod collada;
mod context;
pub(crate) mod dispersion;
mod error;
mod fingerprint;
#[cfg(feature = "gltf")]
mod gltf;
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

pub use cbo::{Layout, write_cbo};
pub use error::{Place, SceneError};
pub use fingerprint::fnv1a;
pub use load::{LoadOptions, LoadProgress, load};
pub use render::BuildOptions;
pub(crate) use render::texture::image_file;
pub use shapes::{Placement, Shape, ShapeKind};
pub use statistics::{FileStatistics, MaterialStatistics, Statistics, statistics};

use crate::color::ColorSpace;
use crate::diagnostic::Warnings;
use glam::{DMat4, DVec3, Mat4, Vec2, Vec3, Vec4};
use reflectance::Reflectance;
use std::path::PathBuf;
use texture::{Texture, Wrap};

/// A scene as its files describe it: shared meshes, placed by objects.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Geometry, each stored once however often it is placed.
    pub meshes: Vec<Mesh>,
    /// Placed meshes.
    pub objects: Vec<Object>,
    /// Materials; names are unique.
    pub materials: Vec<Material>,
    /// Where the textures come from; decoded by [`texture`] when a program reads them.
    pub textures: Vec<TextureSource>,
    /// Placed exact spheres, which no mesh stands for.
    pub spheres: Vec<PlacedSphere>,
    /// Perspective cameras of the files, placed. Projects have cameras of their own; one that is made from the scene takes these.
    pub cameras: Vec<SceneCamera>,
    /// Directional lights of the files, placed; taken as the cameras are.
    pub lights: Vec<SceneLight>,
    /// Where, in the files' coordinates, the origin of the placed objects and cameras lies: what is placed at 0 is there. 0, unless
    /// the files lie so far from theirs that `f32` would lose digits that they have.
    pub origin: DVec3,
    /// What was left out or replaced while loading.
    pub warnings: Warnings,
    /// The files it was loaded from, in order: the first [`LoadedFile::objects`] objects are of the first file, and so
    /// on. Empty for a scene made in memory.
    pub files: Vec<LoadedFile>,
}

/// A file that a scene was loaded from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LoadedFile {
    /// The file.
    pub path: PathBuf,
    /// How many of [`Scene::meshes`] are its.
    pub meshes: u32,
    /// How many of [`Scene::objects`] are its.
    pub objects: u32,
}

/// Indexed triangles, grouped by material.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Name in the file.
    pub name: String,
    /// Positions in model space.
    pub positions: Vec<Vec3>,
    /// Normals in model space, as the file has them ([`RenderScene::build`] makes them unit length): as many as
    /// positions, or none where the file has none or none were asked for.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of unit 0, `v = 0` at the bottom row: as many as positions, or none.
    pub texcoords: Vec<Vec2>,
    /// What the colour and alpha of the surface are multiplied by, display values in 0..=1: as many as positions, or none.
    pub colors: Vec<Vec4>,
    /// Where u grows, in model space, and in w on which side the bitangent is: `w * cross(normal, tangent)` is where v grows. As the
    /// file has them: as many as positions, or none; [`RenderScene::build`] computes what is missing.
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
    /// Near plane distance, above 0.
    pub near: f32,
    /// Far plane distance, above [`Self::near`]; `None` where the file leaves it open.
    pub far: Option<f32>,
}

/// A directional light of a scene file.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneLight {
    /// Name in the file.
    pub name: String,
    /// Unit direction in which the light travels, world.
    pub direction: Vec3,
    /// Colour times strength, as the file has it.
    pub color: Vec3,
}

/// A mesh placed in the world.
#[derive(Debug, Clone)]
pub struct Object {
    /// Name in the file.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Model to world, relative to [`Scene::origin`].
    pub transform: Mat4,
}

/// The sphere of radius 1 about the origin, placed in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedSphere {
    /// Name, for messages.
    pub name: String,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Model to world, relative to [`Scene::origin`]: turns, moves, and scales alike along all axes.
    pub transform: Mat4,
}

impl Scene {
    /// Model to the files' own coordinates, of one of its objects.
    #[must_use]
    pub fn to_world(&self, object: &Object) -> DMat4 {
        DMat4::from_translation(self.origin) * object.transform.as_dmat4()
    }
}

/// Where a texture's bytes are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TextureSource {
    /// A file that exists.
    File(PathBuf),
    /// An encoded image inside a scene file (GLB, data URI), with a name for messages.
    Embedded {
        /// `file.glb#image3`.
        name: String,
        /// PNG or JPEG bytes.
        bytes: Vec<u8>,
    },
    /// Two files that exist: the colours of one, and the other's red channel as alpha (MTL `map_d`).
    Masked {
        /// The colours.
        color: PathBuf,
        /// The alpha; resampled to the size of the colours.
        mask: PathBuf,
    },
    /// Another source, seen otherwise beyond its sides than by repeating it.
    Wrapped {
        /// The texels.
        source: Box<TextureSource>,
        /// Along u and v.
        wrap: [Wrap; 2],
    },
    /// Another source whose texels are numbers and no colours (normals): never decoded from sRGB.
    Data {
        /// The texels.
        source: Box<TextureSource>,
    },
}

impl TextureSource {
    /// The file it is in, or the name of an embedded image.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Embedded { name, .. } => name.clone(),
            Self::Masked { color, mask } => format!("{} with {}", color.display(), mask.display()),
            Self::Wrapped { source, .. } | Self::Data { source } => source.name(),
        }
    }

    /// This source as numbers and no colours.
    #[must_use]
    pub fn data(self) -> Self {
        Self::Data { source: Box::new(self) }
    }

    /// Whether the texels are numbers and no colours.
    #[must_use]
    pub fn is_data(&self) -> bool {
        matches!(self, Self::Data { .. })
    }

    /// This source with something else beyond its sides.
    #[must_use]
    pub fn wrapped(self, wrap: [Wrap; 2]) -> Self {
        if wrap == [Wrap::Repeat; 2] { self } else { Self::Wrapped { source: Box::new(self), wrap } }
    }

    /// Where the texels are, and what lies beyond the sides.
    #[must_use]
    pub fn texels(&self) -> (&Self, [Wrap; 2]) {
        match self {
            Self::Wrapped { source, wrap } => (source.texels().0, *wrap),
            Self::Data { source } => source.texels(),
            source => (source, [Wrap::Repeat; 2]),
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
    /// Emitted colour. In CBO and NBO it adds to the light that the texture is seen in, as the report's programs have it.
    pub emission: Vec4,
    /// Whether the emitted colour is added to what is seen, times [`Self::emission_texture`] (glTF, MTL).
    pub emission_added: bool,
    /// What the emitted colour is multiplied by, at the coordinates of [`Self::texture`]: index into [`Scene::textures`].
    pub emission_texture: Option<u32>,
    /// Phong exponent.
    pub shininess: f32,
    /// Texture of unit 0: index into [`Scene::textures`].
    pub texture: Option<u32>,
    /// Normal map: unit vectors in the frame of tangent, bitangent and normal, at the coordinates of [`Self::texture`], green towards
    /// growing v. Index into [`Scene::textures`].
    pub normal_texture: Option<u32>,
    /// What the normal map's x and y are multiplied by; finite.
    pub normal_scale: f32,
    /// Where the texture's alpha times [`Self::diffuse`]'s is below this, there is no surface. `None`: opaque.
    pub alpha_cutoff: Option<f32>,
    /// Whether some of its triangles have vertex colours ([`Geometry::colors`]). Found by [`RenderScene::build`]; `false` before.
    pub vertex_colors: bool,
    /// Whether the camera does not see its triangles from behind, where their corners go clockwise (glTF unless `doubleSided`).
    /// Rays meet both sides: light that entered glass must leave it, and a wall keeps light off from either side.
    pub single_sided: bool,
    /// Share of the light that enters (glTF `KHR_materials_transmission`), 0..=1.
    pub transmission: f32,
    /// Whether the surface is the border of a body, and not a thin wall (glTF `thicknessFactor` above 0; MTL `illum` 6 and 7). This
    /// and what follows is shaded with `glass=auto`; a pane has the program's index, and nothing else.
    pub volume: bool,
    /// Share of the light by colour that passes the surface, beside Fresnel's, each time that light passes it: glTF's base colour;
    /// MTL's `Tf`, of which a body has the square root, since light enters and leaves it. Linear, 0..=1.
    pub filter: Vec3,
    /// What is kept of reflected light by colour, each time that glass reflects it (glTF `extras.reflectionColor`). Linear, 0..=1.
    pub reflection: Vec3,
    /// What glass reflects in the place of Fresnel's share (glTF `extras.schlick`); `None` where that serves.
    pub reflectance: Option<Reflectance>,
    /// Whether the texture's colour is part of the filter (glTF) and not only of the diffuse colour (MTL).
    pub filter_textured: bool,
    /// Share of the light that enters and is scattered back by the diffuse colour, 0..=1.
    pub veil: f32,
    /// Where bodies overlap, the one of the highest rank fills the place, and of several alike the one that was entered last (glTF
    /// `extras.priority`, 0 to 255).
    pub priority: u8,
    /// Index of refraction (MTL `Ni`, glTF `KHR_materials_ior`), 1..=∞.
    pub ior: f32,
    /// 20 over Abbe's number (glTF `KHR_materials_dispersion`), 0 or more: by how much a body bends blue light more than red.
    pub dispersion: f32,
    /// Roughness of the surface as glass (glTF `roughnessFactor`, MTL `Pr`), 0..=1: its square is the width alpha of the distribution of
    /// microfacets.
    pub roughness: f32,
    /// What the roughness is multiplied by: the green channel, as a number, at the coordinates of [`Self::texture`] (glTF
    /// `metallicRoughnessTexture`, MTL `map_Pr`). Index into [`Scene::textures`].
    pub roughness_texture: Option<u32>,
    /// Thickness (glTF `KHR_materials_volume`), of use only where a surface with a volume is not closed. In scene units, as the file
    /// has it.
    pub thickness: f32,
    /// Colour that white light has after [`Self::attenuation_distance`], linear.
    pub attenuation_color: Vec3,
    /// In scene units; infinite where nothing is absorbed.
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
            single_sided: false,
            transmission: 0.0,
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
    pub(crate) fn textures_mut(&mut self) -> [&mut Option<u32>; 4] {
        [&mut self.texture, &mut self.emission_texture, &mut self.normal_texture, &mut self.roughness_texture]
    }

    /// Every texture.
    pub(crate) fn textures(&self) -> impl Iterator<Item = u32> + use<> {
        [self.texture, self.emission_texture, self.normal_texture, self.roughness_texture].into_iter().flatten()
    }

    /// What the alpha of texture and vertices alone is compared with, from [`Self::alpha_cutoff`] and the diffuse opacity;
    /// infinite where the opacity is 0. `None` where nothing is cut.
    pub(crate) fn cutoff(&self) -> Option<f32> {
        let opacity = self.diffuse.w;
        let scaled = |cutoff: f32| if opacity > 0.0 { cutoff / opacity } else { f32::INFINITY };
        let cuts = self.texture.is_some() || self.vertex_colors;
        self.alpha_cutoff.filter(|cutoff| *cutoff > 0.0 && cuts).map(scaled)
    }
}

/// What of a scene is wanted; what is not is neither read nor stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// Vertex normals (computed where the file has none).
    pub normals: bool,
    /// Texture coordinates of unit 0, and the textures.
    pub textures: bool,
    /// Vertex colours, where files have them.
    pub colors: bool,
    /// Normal maps, where materials have them, and the tangents and texture coordinates that they take; only with [`Self::normals`].
    pub normal_maps: bool,
    /// Textures of the roughness of glass, where materials have them; only with [`Self::textures`].
    pub roughness_maps: bool,
    /// Tangents of all meshes, for shaders that read them; only with [`Self::normals`] and [`Self::textures`].
    pub tangents: bool,
}

impl Needs {
    /// Everything that files hold, for conversions.
    pub const ALL: Needs =
        Needs { normals: true, textures: true, colors: true, normal_maps: true, roughness_maps: true, tangents: false };

    /// Positions alone.
    pub const NOTHING: Needs = Needs {
        normals: false,
        textures: false,
        colors: false,
        normal_maps: false,
        roughness_maps: false,
        tangents: false,
    };
}

/// Triangles and spheres in world space, sorted by material: what rasterisers draw and tracers build on.
///
/// Surfaces have ids: that of a triangle is its position in [`Self::triangles`]; those of the spheres follow, in their order.
///
/// Every index is below `positions.len()`, every position is finite, no triangle has zero area, and `normals`, `texcoords`,
/// `colors` and `tangents` are either empty (not needed, or without contents) or as long as `positions`. Normals are unit length.
#[derive(Debug, Clone, Default)]
pub struct Geometry {
    /// Positions, relative to [`RenderScene::origin`].
    pub positions: Vec<Vec3>,
    /// Shading normals, in world space or (thesis fidelity) in model space as the report's program wrote them.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of unit 0, `v = 0` at the bottom row.
    pub texcoords: Vec<Vec2>,
    /// What the colour and alpha of the surface are multiplied by, in the scene's colour space; white where a mesh has none. Empty
    /// where no mesh has any.
    pub colors: Vec<Vec4>,
    /// Unit directions in which u grows, at right angles to the normals or nearly, and in w on which side the bitangent is:
    /// `w * cross(normal, tangent)`, where v grows. 0 where a mesh has no normal map. Empty where no mesh has any.
    pub tangents: Vec<Vec4>,
    /// The colour space of [`Self::colors`].
    pub color_space: ColorSpace,
    /// Vertex indices; the position in this list is the triangle's id everywhere.
    pub triangles: Vec<[u32; 3]>,
    /// Runs of triangles with one material, in ascending order, covering all of them.
    pub batches: Vec<Batch>,
    /// Exact spheres, in ascending order of their materials. Their normals look outwards; they have neither texture coordinates nor
    /// colours of vertices.
    pub spheres: Vec<Sphere>,
}

/// An exact sphere in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Relative to [`RenderScene::origin`]; finite.
    pub center: Vec3,
    /// Above 0 and finite.
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
    /// Index of the material of a triangle.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[inline]
    #[must_use]
    pub fn material_of(&self, triangle: u32) -> u32 {
        let next = self.batches.partition_point(|batch| batch.first <= triangle);
        self.batches[next - 1].material
    }

    /// The sphere of an id; `None` for triangles, and where there is none.
    #[inline]
    #[must_use]
    pub fn sphere(&self, id: u32) -> Option<&Sphere> {
        self.spheres.get((id as usize).checked_sub(self.triangles.len())?)
    }

    /// Number of triangles and spheres: no id is as large.
    #[must_use]
    pub fn surfaces(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// The material of each triangle, in their order.
    pub fn materials(&self) -> impl Iterator<Item = u32> {
        self.batches.iter().flat_map(|batch| std::iter::repeat_n(batch.material, batch.count as usize))
    }

    /// The corners of a triangle.
    #[inline]
    #[must_use]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|vertex| self.positions[vertex as usize])
    }
}

/// The triangles and spheres of some materials. Both are sorted by material, so these are few ranges of ids, and whether one is among them
/// takes a comparison or two where its material would have to be looked for among all.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TriangleRanges(Vec<[u32; 2]>);

impl TriangleRanges {
    /// Those of the materials that are marked.
    #[must_use]
    pub fn new(geometry: &Geometry, marked: &[bool]) -> Self {
        let mut ranges = Self::default();
        ranges.find(geometry, marked);
        ranges
    }

    /// Replaces them by those of the materials that are marked; a material beyond the list is not.
    pub fn find(&mut self, geometry: &Geometry, marked: &[bool]) {
        self.0.clear();
        let is_marked = |batch: &&Batch| batch.count > 0 && marked.get(batch.material as usize) == Some(&true);
        for &Batch { first, count, .. } in geometry.batches.iter().filter(is_marked) {
            self.add(first, count);
        }
        for (sphere, id) in geometry.spheres.iter().zip(geometry.triangles.len() as u32..) {
            if marked.get(sphere.material as usize) == Some(&true) {
                self.add(id, 1);
            }
        }
    }

    fn add(&mut self, first: u32, count: u32) {
        match self.0.last_mut() {
            Some([_, end]) if *end == first => *end += count,
            _ => self.0.push([first, first + count]),
        }
    }

    /// First and end of each, in ascending order; none is empty, and no two touch.
    #[must_use]
    pub fn as_slice(&self) -> &[[u32; 2]] {
        &self.0
    }

    /// Whether a triangle is in one of them.
    #[inline]
    #[must_use]
    pub fn contains(&self, triangle: u32) -> bool {
        let next = self.0.partition_point(|[first, _]| *first <= triangle);
        next > 0 && triangle < self.0[next - 1][1]
    }
}

/// A scene made ready for rendering: flat geometry, materials, and decoded textures.
#[derive(Debug, Clone, Default)]
pub struct RenderScene {
    /// All triangles.
    pub geometry: Geometry,
    /// Materials, in the order that [`Batch::material`] counts. [`Material::texture`] indexes [`Self::textures`].
    pub materials: Vec<Material>,
    /// Decoded textures.
    pub textures: Vec<Texture>,
    /// Where the origin of [`Geometry::positions`] lies in the world: 0, or near a scene that is far from it. Cameras are moved with it.
    pub origin: DVec3,
}

impl RenderScene {
    /// Adds another scene's triangles, materials and textures after this one's.
    ///
    /// # Panics
    /// If the two were made for different [`Needs`] or origins, or together have more than 2^32 vertices or triangles.
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
        // A scene that only normal maps ask for coordinates has none without such a map.
        join(&mut geometry.texcoords, &other.geometry.texcoords, before, whole, Vec2::ZERO);
        join(&mut geometry.tangents, &other.geometry.tangents, before, whole, Vec4::ZERO);
        let (vertices, triangles) = (index(geometry.positions.len()), index(geometry.triangles.len()));
        let (materials, textures) = (index(self.materials.len()), index(self.textures.len()));
        index(whole);
        index(geometry.surfaces() + other.geometry.surfaces());
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
