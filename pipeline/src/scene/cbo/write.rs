//! The writer for both layouts. Scenes are written as lists of objects (`OctreeUnified`), never as octrees.

use super::super::context::MASK_CUTOFF;
use super::super::error::SceneError;
use super::super::texture::{Sampling, Wrap};
use super::super::{Material, Mesh, Object, Scene, TextureSource};
use super::{Layout, NO_TEXTURE, NULL_OBJECT, alpha_test};
use crate::diagnostic::Warnings;
use crate::files::{Replacement, write_atomically};
use crate::paths::relative_to;
use glam::Vec3;
use std::collections::HashSet;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Default render state of a 2014 material: depth test and culling as the engine sets them.
const STATE_BOOLS: [u8; 7] = [0, 0, 0, 1, 1, 0, 1];
const STATE_ENUMS: [i32; 9] = [0, 0, 0x201, 0x405, 0, 1, 0, 0x8006, 0];
const STATE_INTS: [i32; 1] = [0];
const STATE_FLOATS: [f32; 4] = [0.0, 1.0, 1.0, 0.0];
const STATE_VECTORS: [f32; 8] = [0.0; 8];
const STATE_BOOL4S: [u8; 4] = [1; 4];

/// Writes a scene. The file is written whole or not at all, and then replaces a file of that name.
///
/// Objects that place the same mesh share it. Texture paths are stored relative to the file; images that are embedded in scene files, or
/// combined from two files, are written to the file's folder as `NAME.texture0.png`. The returned warnings count, by kind, what the
/// format cannot store: properties of glass, emissive textures, emission that is added, normal maps, single-sided materials, alpha
/// cutoffs (today's layout only), wrap modes, magnification, vertex colours, and letters outside Latin-1. Cameras, lights and exact
/// spheres are left out without a warning.
///
/// # Errors
/// If a count does not fit the format, a texture's path is not valid Unicode, an image cannot be stored, or a file cannot be written.
///
/// # Panics
/// If an index of the scene (of a mesh, material or texture) is out of range; [`super::super::load`] makes no such scene.
pub fn write_cbo(scene: &Scene, path: &Path, layout: Layout) -> Result<Warnings, SceneError> {
    let failed = |error: std::io::Error| SceneError::file(path, format!("cannot be written: {error}"));
    let mut warnings = Warnings::default();
    let textures = texture_paths(scene, path, &mut warnings)?;
    let replacement = Replacement::begin(path).map_err(failed)?;
    let meshes = scene.meshes.iter().map(|mesh| mesh.name.as_str());
    let renderables = unique_names(meshes, HashSet::from([NULL_OBJECT.to_owned()]), path, &mut warnings);
    let names = scene.materials.iter().map(|material| material.name.as_str());
    let materials = unique_names(names, HashSet::new(), path, &mut warnings);
    let out = BufWriter::new(replacement);
    let mut writer =
        SceneWriter { out, path, layout, scene, textures, renderables, materials, warnings: &mut warnings };
    writer.scene().map_err(failed)?;
    let replacement = writer.out.into_inner().map_err(|error| failed(error.into_error()))?;
    replacement.commit().map_err(failed)?;
    Ok(warnings)
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Makes names unique after their conversion to Latin-1, by appending an index where a name is taken. In the file, objects refer
/// to meshes and triangles to materials by name, and two different names may be equal in Latin-1.
fn unique_names<'a>(
    names: impl Iterator<Item = &'a str>,
    mut taken: HashSet<String>,
    path: &Path,
    warnings: &mut Warnings,
) -> Vec<String> {
    names
        .enumerate()
        .map(|(index, written)| {
            let mut name = latin_1(written, path, warnings);
            while !taken.insert(name.clone()) {
                name = format!("{name}#{index}");
            }
            name
        })
        .collect()
}

/// The text with `?` for each letter outside Latin-1; a warning counts them.
fn latin_1(text: &str, path: &Path, warnings: &mut Warnings) -> String {
    let letter = |letter: char| if u8::try_from(letter).is_ok() { letter } else { '?' };
    let kept: String = text.chars().map(letter).collect();
    if kept != text {
        warnings.add(path, "names with letters outside Latin-1", "written with `?`", || format!("`{text}`"));
    }
    kept
}

/// The path of each colour texture, relative to the file; empty for textures of data. Images that are not files yet are written.
fn texture_paths(scene: &Scene, path: &Path, warnings: &mut Warnings) -> Result<Vec<String>, SceneError> {
    let folder = folder_of(path);
    let mut paths = Vec::with_capacity(scene.textures.len());
    for (index, source) in scene.textures.iter().enumerate() {
        if source.is_data() {
            paths.push(String::new());
            continue;
        }
        if let TextureSource::File(file) = source.texels().0 {
            let relative = relative_to(folder, file).or_else(|| file.to_str().map(str::to_owned)).ok_or_else(|| {
                SceneError::file(path, format!("the texture path {} is not valid Unicode", file.display()))
            })?;
            paths.push(relative);
            continue;
        }
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or("scene");
        let (bytes, extension) = super::super::render::texture::encoded(source)
            .map_err(|why| SceneError::file(path, format!("the texture {} cannot be stored: {why}", source.name())))?;
        let name = format!("{stem}.texture{index}.{extension}");
        let failed =
            |error: std::io::Error| SceneError::file(&folder.join(&name), format!("cannot be written: {error}"));
        write_atomically(&folder.join(&name), &bytes).map_err(failed)?;
        warnings.add(path, "textures written beside the file", "the file names them", || name.clone());
        paths.push(name);
    }
    Ok(paths)
}

/// Properties of a material that a layout cannot store: whether the material has each, its description, and the remedy.
fn losses(material: &Material, scene: &Scene, layout: Layout) -> [(bool, &'static str, &'static str); 11] {
    // Every field is named, so that adding a property to materials forces a decision here on whether its loss is reported.
    let Material {
        name: _,
        diffuse: _,
        ambient: _,
        specular: _,
        emission,
        emission_added,
        emission_texture,
        shininess: _,
        texture,
        normal_texture,
        normal_scale: _,
        alpha_cutoff,
        vertex_colors: _,
        sky: _,
        single_sided,
        transmission,
        transmission_texture,
        volume,
        filter,
        reflection,
        reflectance,
        filter_textured: _,
        veil,
        priority,
        ior,
        dispersion,
        roughness,
        roughness_texture,
        thickness,
        attenuation_color,
        attenuation_distance,
    } = material;
    let usual = Material::default();
    // The properties that `body` and `rough` test have no meaning for opaque materials.
    let glass = *transmission != usual.transmission;
    let absorbs = *thickness != usual.thickness
        || *attenuation_color != usual.attenuation_color
        || *attenuation_distance != usual.attenuation_distance;
    let body = (*volume, *veil, *priority) != (usual.volume, usual.veil, usual.priority)
        || (*filter, *reflection, *reflectance) != (usual.filter, usual.reflection, usual.reflectance)
        || (*ior, *dispersion) != (usual.ior, usual.dispersion)
        || transmission_texture.is_some();
    let rough = *roughness != usual.roughness || roughness_texture.is_some();
    let sampling = texture.map_or(Sampling::default(), |index| scene.textures[index as usize].texels().1);
    [
        (glass, "materials with transmission", "not written"),
        (absorbs, "materials with absorption", "not written"),
        (glass && body, "materials with an index, colours, dispersion or rank of glass", "not written"),
        (glass && rough, "materials of rough glass", "not written"),
        (emission_texture.is_some(), "emissive textures", "not written; the colour alone is"),
        (
            *emission_added && emission.truncate() != Vec3::ZERO,
            "materials that send out light of their own",
            "read as light in which their texture is seen",
        ),
        (normal_texture.is_some(), "normal maps", "not written"),
        (*single_sided, "materials that are seen from one side", "read as seen from both"),
        (sampling.wrap != [Wrap::Repeat; 2], "textures that are clamped or mirrored", "read as repeating"),
        (sampling.is_nearest(), "textures that are magnified without blending", "read with blending"),
        (
            alpha_cutoff.is_some() && !layout.is_2014(),
            "materials with an alpha cutoff",
            "not written; read as 0.5 where the texture has texels below that",
        ),
    ]
}

struct SceneWriter<'a> {
    out: BufWriter<Replacement>,
    path: &'a Path,
    layout: Layout,
    scene: &'a Scene,
    textures: Vec<String>,
    renderables: Vec<String>,
    materials: Vec<String>,
    warnings: &'a mut Warnings,
}

impl SceneWriter<'_> {
    fn scene(&mut self) -> std::io::Result<()> {
        let scene = self.scene;
        self.count(scene.materials.len())?;
        for (index, material) in scene.materials.iter().enumerate() {
            self.string(&self.materials[index].clone())?;
            self.material(material)?;
        }
        self.string("OctreeUnified")?;
        self.count(scene.objects.len())?;
        let mut written = vec![false; scene.meshes.len()];
        for object in &scene.objects {
            let seen = std::mem::replace(&mut written[object.mesh as usize], true);
            self.object(object, &scene.meshes[object.mesh as usize], seen)?;
        }
        self.out.flush()
    }

    /// Writes a material, without its name.
    fn material(&mut self, material: &Material) -> std::io::Result<()> {
        self.warn_about_losses(material);
        for color in [material.ambient, material.specular, material.diffuse, material.emission] {
            self.floats(&color.to_array())?;
        }
        self.floats(&[material.shininess])?;
        match material.texture {
            Some(texture) => self.string(&self.textures[texture as usize].clone())?,
            None => self.string(NO_TEXTURE)?,
        }
        for _ in 1..8 {
            self.string(NO_TEXTURE)?;
        }
        if self.layout.is_2014() {
            for _ in ["program", "vertex", "geometry", "fragment"] {
                self.string("")?;
            }
            self.count(0)?;
            self.string("")?;
            let (mut bools, mut enums, mut floats) = (STATE_BOOLS, STATE_ENUMS, STATE_FLOATS);
            // Materials that are blended texel by texel are cut out at half alpha, as passes without glass draw them.
            let blended = material.transmission_texture;
            let blended = blended.is_some_and(|texture| self.scene.textures[texture as usize].is_clear());
            let half = MASK_CUTOFF * material.diffuse.w;
            if let Some(cutoff) = material.alpha_cutoff.map(|cutoff| if blended { half } else { cutoff }) {
                bools[alpha_test::ENABLED] = 1;
                enums[alpha_test::FUNCTION] = alpha_test::GREATER_OR_EQUAL;
                floats[alpha_test::VALUE] = cutoff;
            }
            self.count(bools.len())?;
            self.out.write_all(&bools)?;
            for values in [&enums[..], &STATE_INTS[..]] {
                self.count(values.len())?;
                for value in values {
                    self.out.write_all(&value.to_le_bytes())?;
                }
            }
            self.count(floats.len())?;
            self.floats(&floats)?;
            self.count(STATE_VECTORS.len() / 4)?;
            self.floats(&STATE_VECTORS)?;
            self.count(STATE_BOOL4S.len() / 4)?;
            self.out.write_all(&STATE_BOOL4S)?;
        }
        Ok(())
    }

    fn warn_about_losses(&mut self, material: &Material) {
        for (_, what, remedy) in losses(material, self.scene, self.layout).into_iter().filter(|(lost, ..)| *lost) {
            self.warnings.add(self.path, what, remedy, || format!("`{}`", material.name));
        }
    }

    fn object(&mut self, object: &Object, mesh: &Mesh, seen: bool) -> std::io::Result<()> {
        self.string("SimpleObject")?;
        self.string(&object.name)?;
        self.string("BoundingBox")?;
        let (low, high) = bounds(&mesh.positions);
        self.count(2)?;
        self.floats(&low.to_array())?;
        self.floats(&high.to_array())?;
        if self.layout.is_2014() {
            self.string("SimpleTransform")?;
        }
        self.floats(&self.scene.to_world(object).as_mat4().to_cols_array())?;
        self.string(&self.renderables[object.mesh as usize].clone())?;
        if seen {
            return Ok(());
        }
        if !mesh.colors.is_empty() {
            self.warnings.add(self.path, "meshes with vertex colours", "not written", || format!("`{}`", mesh.name));
        }
        self.string("Mesh")?;
        let attributes = 1 + usize::from(!mesh.normals.is_empty()) + usize::from(!mesh.texcoords.is_empty());
        self.count(attributes)?;
        self.attribute("position", mesh.positions.iter().map(|p| p.extend(1.0).to_array()))?;
        if !mesh.normals.is_empty() {
            self.attribute("normal", mesh.normals.iter().map(|n| n.extend(0.0).to_array()))?;
        }
        if !mesh.texcoords.is_empty() {
            self.attribute("texCoord0", mesh.texcoords.iter().map(|t| [t.x, t.y, 0.0, 1.0]))?;
        }
        self.count(0)?;
        // An empty index list would mean "all vertices in order", so empty groups are skipped.
        let groups = || mesh.groups.iter().filter(|group| !group.triangles.is_empty());
        self.count(groups().count())?;
        for group in groups() {
            self.string(&self.materials[group.material as usize].clone())?;
            self.count(0)?;
            self.count(group.triangles.len() * 3)?;
            for index in group.triangles.iter().flatten() {
                self.out.write_all(&index.to_le_bytes())?;
            }
        }
        Ok(())
    }

    fn attribute(&mut self, name: &str, values: impl ExactSizeIterator<Item = [f32; 4]>) -> std::io::Result<()> {
        self.string(name)?;
        self.count(values.len())?;
        for value in values {
            self.floats(&value)?;
        }
        Ok(())
    }

    fn count(&mut self, count: usize) -> std::io::Result<()> {
        let count = u32::try_from(count)
            .map_err(|_| std::io::Error::other(format!("{count} items are more than the format can count")))?;
        self.out.write_all(&count.to_le_bytes())
    }

    fn floats(&mut self, values: &[f32]) -> std::io::Result<()> {
        values.iter().try_for_each(|value| self.out.write_all(&value.to_le_bytes()))
    }

    fn string(&mut self, text: &str) -> std::io::Result<()> {
        let text = latin_1(text, self.path, self.warnings);
        let bytes: Vec<u8> = text.chars().map(|letter| u8::try_from(letter).unwrap_or(b'?')).collect();
        self.count(bytes.len())?;
        self.out.write_all(&bytes)?;
        self.out.write_all(&[0])
    }
}

/// The bounding box of the finite positions; a point at the origin if there are none.
fn bounds(positions: &[Vec3]) -> (Vec3, Vec3) {
    positions
        .iter()
        .filter(|position| position.is_finite())
        .fold(None, |bounds: Option<(Vec3, Vec3)>, position| {
            let (low, high) = bounds.unwrap_or((*position, *position));
            Some((low.min(*position), high.max(*position)))
        })
        .unwrap_or_default()
}
