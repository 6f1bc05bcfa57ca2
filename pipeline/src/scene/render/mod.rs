//! Builds a render scene (flat geometry in world space, decoded textures) from a scene as files describe it.

pub(super) mod alphas;
mod flatten;
mod normals;
mod spheres;
mod tangents;
pub(crate) mod texture;

use super::error::{Budget, SceneError};
use super::{Geometry, Material, Needs, RenderScene, Scene, TriangleRanges};
use crate::color::{BRIGHTEST, ColorSpace, in_range};
use crate::diagnostic::Warnings;
use glam::{DVec3, Mat4, Vec3, Vec4};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Options of [`RenderScene::build`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BuildOptions {
    /// The attributes and maps that passes read.
    pub needs: Needs,
    /// Whether normals stay in model space, as in the report's program.
    pub model_space_normals: bool,
    /// Maps `(x, y, z)` to `(x, z, -y)`, for models with z up. Normals are mapped too, also in model space, because the report's
    /// engine converts the vertex data itself.
    pub swap_yz: bool,
    /// Centres the scene's box at the origin and scales it uniformly so that its longest side reaches from -1 to 1; after
    /// [`Self::swap_yz`].
    pub unitize: bool,
    /// Placement of the whole scene in the world, after [`Self::unitize`]. It does not transform normals that stay in model space.
    pub transform: Mat4,
    /// World position of the positions' origin: normally 0, or the origin of an earlier scene. `None` chooses 0, or a point near
    /// the scene if the scene is farther from 0 than 16 times its longest side.
    pub origin: Option<DVec3>,
    /// Colour space to which colours and textures are converted; in a [`Scene`] they are display values, whatever its files have.
    pub color: ColorSpace,
    /// Greatest number of bytes that geometry and textures may take.
    pub max_bytes: u64,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            needs: Needs::ALL,
            model_space_normals: false,
            swap_yz: false,
            unitize: false,
            transform: Mat4::IDENTITY,
            origin: Some(DVec3::ZERO),
            color: ColorSpace::Report,
            max_bytes: super::LoadOptions::DEFAULT_MAX_BYTES,
        }
    }
}

impl RenderScene {
    /// Places all objects in the world, sorts the triangles by material and decodes the textures in use.
    ///
    /// - Triangles are left out and counted, by object, if an index is out of the mesh's range, a corner is not finite in world
    ///   space, or the triangle has no area (twice its area, in `f64`, is below the smallest normal `f32`).
    /// - Vertices that no triangle uses are dropped. Triangles keep the order of objects and groups and are sorted by material with
    ///   a stable sort, so ids do not depend on the number of threads.
    /// - Where a transform mirrors (determinant below 0), the winding of triangles of single-sided materials is reversed, so that
    ///   their front stays the side that is the front in the mesh (glTF 2.0, section 3.7.4).
    /// - Normals are transformed by the inverse transpose and normalised. For a mesh without normals each vertex gets the mean of
    ///   the normals of its faces, weighted by the face's angle there (Thürmer and Wüthrich, "Computing Vertex Normals from Polygonal
    ///   Facets", 1998). Faces on both sides of a crease of more than 60 degrees are not averaged: the vertices there are split.
    ///   Vertices that are not shared stay flat.
    /// - If [`Scene::origin`] or the origin of the result is not 0, positions are placed in `f64` and rounded once, relative to the
    ///   result's origin.
    /// - Textures that no triangle's material uses are not decoded. A texture that cannot be decoded is counted, and its material
    ///   then has none.
    /// - The triangles of materials that are [a sky](Material::sky) are noted in [`Geometry::sky`].
    /// - Exact spheres are sorted by material. They have no texture coordinates and are shown without textures; spheres of textured
    ///   materials are counted.
    /// - If a placed mesh has vertex colours, the vertices of meshes without them are white.
    /// - If a placed material has a normal map, vertices have tangents: those of the file, or else computed by MikkTSpace, which
    ///   splits vertices. Tangents are transformed with the surface; a mirroring transform flips the sign of the bitangent. A
    ///   material none of whose triangles has tangents loses its normal map.
    /// - Colours of materials are clamped to [`BRIGHTEST`]; clamped ones are counted.
    /// - In linear light, colours of materials are decoded from sRGB here, and textures when they are read
    ///   ([`Texture::space`](super::texture::Texture::space)). Filter and attenuation colours are linear already.
    ///
    /// # Errors
    /// If the geometry has more than 2^32 - 2 vertices or triangles, if more memory is needed than allowed, or if the scale of an
    /// exact sphere is not uniform.
    ///
    /// # Panics
    /// If an index of the scene (of a mesh, material or texture) is out of range; [`super::load`] makes no such scene.
    pub fn build(scene: Scene, options: &BuildOptions) -> Result<(RenderScene, Warnings), SceneError> {
        let files = FilesOfObjects::new(&scene);
        let mut warnings = Warnings::default();
        let mut budget = Budget::new(options.max_bytes);
        let Scene { meshes, objects, spheres, mut materials, textures: sources, origin, .. } = scene;

        let placed = flatten::Placed { objects: &objects, spheres: &spheres, origin };
        let (mut geometry, scale, origin) =
            flatten::flatten(meshes, (placed, &materials), options, &files, &mut budget, &mut warnings)?;

        geometry.color_space = options.color;
        if options.color == ColorSpace::Linear {
            geometry.colors.par_iter_mut().for_each(|color| *color = options.color.of_display(*color));
        }
        mark_colored(&geometry, &mut materials);
        keep_normal_maps(&geometry, &mut materials);
        let sky: Vec<bool> = materials.iter().map(|material| material.sky).collect();
        geometry.sky = TriangleRanges::of_triangles(&geometry, &sky);
        for sphere in geometry.spheres.iter().filter(|_| options.needs.textures) {
            let material = &materials[sphere.material as usize];
            if material.textures().next().is_some() {
                let what = "exact spheres of a material with a texture";
                warnings.add(files.whole_scene(), what, "shown without it", || format!("`{}`", material.name));
            }
        }
        let mut in_use = vec![false; materials.len()];
        for batch in &geometry.batches {
            in_use[batch.material as usize] = true;
        }
        for (material, in_use) in materials.iter_mut().zip(in_use) {
            material.attenuation_distance *= scale;
            material.thickness *= scale;
            if !bounded(material) {
                let what = "materials with a colour above 1e9";
                warnings.add(files.whole_scene(), what, "1e9 serves", || format!("`{}`", material.name));
            }
            to_space(material, options.color);
            if !in_use {
                material.textures_mut().into_iter().for_each(|texture| *texture = None);
            } else if !options.needs.textures {
                (material.texture, material.emission_texture) = (None, None);
            }
        }
        let file = files.whole_scene();
        let textures = texture::decode_used(&mut materials, &sources, options.color, file, &mut budget, &mut warnings)?;
        Ok((RenderScene { geometry, materials, textures, origin }, warnings))
    }
}

impl RenderScene {
    /// Whether the colours of texels are decoded from sRGB when they are read. All colour textures of a scene agree in this; textures of data
    /// are never decoded.
    #[must_use]
    pub fn decodes_texels(&self) -> bool {
        self.textures.iter().any(|texture| texture.space == ColorSpace::Linear)
    }
}

/// Sets, for each material, whether some of its triangles have vertex colours other than white.
fn mark_colored(geometry: &Geometry, materials: &mut [Material]) {
    if geometry.colors.is_empty() {
        return;
    }
    for batch in &geometry.batches {
        let triangles = &geometry.triangles[batch.first as usize..][..batch.count as usize];
        let colored =
            |triangle: &[u32; 3]| triangle.iter().any(|vertex| geometry.colors[*vertex as usize] != Vec4::ONE);
        materials[batch.material as usize].vertex_colors |= triangles.par_iter().any(colored);
    }
}

/// Removes normal maps from materials none of whose triangles has tangents.
fn keep_normal_maps(geometry: &Geometry, materials: &mut [Material]) {
    let mut kept = vec![false; materials.len()];
    if !geometry.tangents.is_empty() {
        for batch in geometry.batches.iter().filter(|batch| materials[batch.material as usize].normal_texture.is_some())
        {
            let triangles = &geometry.triangles[batch.first as usize..][..batch.count as usize];
            let turned =
                |triangle: &[u32; 3]| triangle.iter().any(|corner| geometry.tangents[*corner as usize].w != 0.0);
            kept[batch.material as usize] |= triangles.par_iter().any(turned);
        }
    }
    for (material, kept) in materials.iter_mut().zip(kept) {
        material.normal_texture = material.normal_texture.filter(|_| kept);
    }
}

/// The colours of a material that are stored as display values.
fn colors(material: &mut Material) -> [&mut Vec4; 4] {
    let Material { diffuse, ambient, specular, emission, .. } = material;
    [diffuse, ambient, specular, emission]
}

/// Clamps the colours of a material to [`BRIGHTEST`] in absolute value; returns whether all were in this range.
fn bounded(material: &mut Material) -> bool {
    let mut bounded = true;
    for color in colors(material).into_iter().filter(|color| !in_range(color.truncate())) {
        *color = color.truncate().clamp(Vec3::splat(-BRIGHTEST), Vec3::splat(BRIGHTEST)).extend(color.w);
        bounded = false;
    }
    bounded
}

/// Converts the colours of a material from display values to a colour space.
fn to_space(material: &mut Material, space: ColorSpace) {
    colors(material).into_iter().for_each(|color| *color = space.of_display(*color));
}

/// The file that each object comes from, for messages.
struct FilesOfObjects {
    /// By file: the index after its last object, and its path.
    ends: Vec<(usize, PathBuf)>,
    whole: PathBuf,
}

impl FilesOfObjects {
    fn new(scene: &Scene) -> Self {
        let mut end = 0;
        let ends: Vec<_> = scene
            .files
            .iter()
            .map(|file| {
                end += file.objects as usize;
                (end, file.path.clone())
            })
            .collect();
        let whole = match &ends[..] {
            [(_, only)] => only.clone(),
            _ => PathBuf::from("scene"),
        };
        Self { ends, whole }
    }

    fn of(&self, object: usize) -> &Path {
        let index = self.ends.partition_point(|(end, _)| *end <= object);
        self.ends.get(index).map_or(&self.whole, |(_, file)| file)
    }

    /// The path of the only file, or the word "scene".
    fn whole_scene(&self) -> &Path {
        &self.whole
    }
}
