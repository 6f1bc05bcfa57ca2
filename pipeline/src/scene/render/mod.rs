//! From a scene as its files describe it to what passes use: flat geometry in world space and decoded textures.

mod flatten;
mod normals;
mod spheres;
mod tangents;
pub(crate) mod texture;

use super::error::{Budget, SceneError};
use super::{Geometry, Material, Needs, RenderScene, Scene};
use crate::color::{BRIGHTEST, ColorSpace, in_range};
use crate::diagnostic::Warnings;
use glam::{DVec3, Mat4, Vec3, Vec4};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// How a scene is made ready.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BuildOptions {
    /// What passes read.
    pub needs: Needs,
    /// Normals stay in model space, as the report's program wrote them.
    pub model_space_normals: bool,
    /// `(x, y, z)` becomes `(x, z, -y)`, for models with z up; normals turn with it in both spaces, because the engine
    /// turns the vertex data itself.
    pub swap_yz: bool,
    /// The scene's box is centred at the origin and scaled uniformly until its longest side is [-1, 1]; after
    /// [`Self::swap_yz`].
    pub unitize: bool,
    /// What places the whole scene in the world, after [`Self::unitize`]; normals in model space do not turn with it.
    pub transform: Mat4,
    /// The origin of the positions, in the world: 0 unless another is asked for, or that of an earlier scene. `None`: 0, or near the
    /// scene if that is farther from 0 than 16 times its longest side.
    pub origin: Option<DVec3>,
    /// What colours and textures are made: in a scene they are display values, whatever its files have.
    pub color: ColorSpace,
    /// Bytes that the geometry and textures may hold.
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
    /// - Triangles with an index outside the mesh, a corner that is not finite in world space, or no area (twice the
    ///   area, in double precision, is below the smallest normal `f32`) are left out and counted, by object.
    /// - Vertices that no triangle uses are dropped. The order of triangles is that of objects and groups, sorted by
    ///   material without exchanging equals; ids therefore do not depend on the number of threads.
    /// - Where a transform mirrors (its determinant is below 0), triangles of single-sided materials are turned, so that they still
    ///   face where their mesh has them face (glTF 2.0, section 3.7.4).
    /// - Normals are transformed by the inverse transpose and made unit length. Where a mesh has none, each vertex gets
    ///   the mean of the normals of its faces, weighted by the face's angle there (Thürmer and Wüthrich, "Computing
    ///   Vertex Normals from Polygonal Facets", 1998); faces on both sides of a crease of more than
    ///   60 degrees are not averaged, and the vertices there are split; vertices that are not shared stay flat.
    /// - Where [`Scene::origin`] or the origin of the result is not 0, positions are placed in `f64` and rounded once, relative to the
    ///   latter.
    /// - Textures that no triangle's material uses are not decoded; a texture that cannot be decoded is counted, and
    ///   its material has none.
    /// - Exact spheres are sorted by material. They are shown without textures, since they have no texture coordinates; those of a
    ///   material that has one are counted.
    /// - Vertex colours are there where a mesh that is placed has some; the vertices of the others are white.
    /// - Tangents are there where a material that is placed has a normal map: those of the file, or else by MikkTSpace, which splits
    ///   vertices. A tangent turns with the surface; where a transform mirrors, its bitangent changes sides. A material without a tangent
    ///   on any of its triangles has no normal map.
    /// - Colours of materials are kept within [`BRIGHTEST`]; those that were not are counted.
    /// - In linear light colours of materials are decoded from sRGB, and textures when they are read ([`Texture::space`](super::texture::Texture::space)).
    ///   What light keeps in a filter, and what is absorbed, is linear as it is.
    ///
    /// # Errors
    /// If the geometry has more than 2^32 - 2 vertices or triangles, or more memory is needed than allowed; if an exact sphere is not scaled
    /// alike along all axes.
    ///
    /// # Panics
    /// If an index of the scene (of a mesh, material or texture) leads nowhere; [`super::load`] makes no such scene.
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
    /// Whether the colours of texels are decoded from sRGB when they are read: those of all textures of a scene, or of none.
    #[must_use]
    pub fn decodes_texels(&self) -> bool {
        self.textures.iter().any(|texture| texture.space == ColorSpace::Linear)
    }
}

/// Says of each material whether some of its triangles have colours.
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

/// Takes normal maps away from materials none of whose triangles has tangents.
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

/// The colours of a material that are display values.
fn colors(material: &mut Material) -> [&mut Vec4; 4] {
    let Material { diffuse, ambient, specular, emission, .. } = material;
    [diffuse, ambient, specular, emission]
}

/// Keeps the colours of a material within [`BRIGHTEST`]; whether they were.
fn bounded(material: &mut Material) -> bool {
    let mut bounded = true;
    for color in colors(material).into_iter().filter(|color| !in_range(color.truncate())) {
        *color = color.truncate().clamp(Vec3::splat(-BRIGHTEST), Vec3::splat(BRIGHTEST)).extend(color.w);
        bounded = false;
    }
    bounded
}

/// Makes the colours of a material those of a space.
fn to_space(material: &mut Material, space: ColorSpace) {
    colors(material).into_iter().for_each(|color| *color = space.of_display(*color));
}

/// Which file an object is of, for messages.
struct FilesOfObjects {
    /// The first object that is not of the file any more, and the file.
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

    /// The only file, or the word "scene".
    fn whole_scene(&self) -> &Path {
        &self.whole
    }
}
