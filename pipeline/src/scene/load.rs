//! Loading scene files of any format, and merging several into one scene.

use super::context::{Context, add_texture, no_file_refused, read_file};
use super::error::{Budget, SceneError};
use super::{LoadedFile, Material, Mesh, Needs, Object, Scene};
use crate::diagnostic::Warnings;
use crate::paths::resolve_path;
use glam::{DMat4, DVec3};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Options for loading scene files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoadOptions {
    /// The contents that are read and stored.
    pub needs: Needs,
    /// Greatest number of bytes that the load may hold at once.
    pub max_bytes: u64,
}

impl LoadOptions {
    /// Default of [`Self::max_bytes`]: 8 GiB.
    pub const DEFAULT_MAX_BYTES: u64 = 8 << 30;
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { needs: Needs::ALL, max_bytes: Self::DEFAULT_MAX_BYTES }
    }
}

/// Progress, reported before each file is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoadProgress<'a> {
    /// The file that is read next.
    pub file: &'a Path,
    /// Bytes of the files already read.
    pub bytes_done: u64,
    /// Bytes of all files.
    pub bytes_total: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Cbo,
    Obj,
    Gltf,
    Studio,
    Ogre,
    Collada,
}

/// Known file formats, for messages.
const FORMATS: &str = "valid: .cbo, .nbo, .obj, .gltf, .glb, .3ds, .dae, .mesh.xml";

/// The format of a file: by its first bytes if they identify it, otherwise by its extension.
fn format_of(file: &Path, bytes: &[u8]) -> Result<Format, SceneError> {
    if bytes.starts_with(b"glTF") {
        return Ok(Format::Gltf);
    }
    let name = file.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    if name.ends_with(super::ogre::SUFFIX) {
        return Ok(Format::Ogre);
    }
    let extension = file.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
    match extension.as_str() {
        "cbo" | "nbo" => Ok(Format::Cbo),
        "obj" => Ok(Format::Obj),
        "gltf" | "glb" => Ok(Format::Gltf),
        "3ds" => Ok(Format::Studio),
        "dae" => Ok(Format::Collada),
        other => Err(SceneError::file(file, format!("`.{other}` is not a scene format")).help(FORMATS)),
    }
}

/// Loads scene files and merges them into one scene.
///
/// Materials of the same name and contents are shared. Of materials with the same name and different contents the first is kept,
/// and a warning counts the others: the report's engine has one material table for all files.
///
/// # Errors
/// An error for the first file that is missing, of unknown format, damaged, or in need of more memory than allowed; otherwise for a file
/// that was refused because it lies outside the folder of `--confine`.
pub fn load(
    files: &[PathBuf],
    options: &LoadOptions,
    progress: &dyn Fn(LoadProgress<'_>),
) -> Result<Scene, SceneError> {
    // What earlier loads were refused is no fault of this one.
    drop(crate::files::refused());
    let mut scene = Scene::default();
    let mut budget = Budget::new(options.max_bytes);
    let mut found = Vec::with_capacity(files.len());
    let mut bytes_total = 0;
    for file in files {
        let (path, size) = find(file, &mut scene.warnings)?;
        found.push((path, size));
        bytes_total += size;
    }
    let mut bytes_done = 0;
    for (file, size) in &found {
        progress(LoadProgress { file, bytes_done, bytes_total });
        merge(&mut scene, file, load_one(file, *size, options.needs, &mut budget)?);
        bytes_done += size;
    }
    no_file_refused()?;
    Ok(scene)
}

fn find(file: &Path, warnings: &mut Warnings) -> Result<(PathBuf, u64), SceneError> {
    let written = file.to_str().unwrap_or_default();
    let path = if file.exists() || written.is_empty() {
        file.to_owned()
    } else {
        let resolved = resolve_path(Path::new(""), written)
            .ok_or_else(|| SceneError::file(file, "there is no such file").help(crate::paths::nearest_help(file)))?;
        if resolved.case_differs {
            warnings.add(file, "paths with other letter case", "the file was found all the same", || {
                resolved.path.display().to_string()
            });
        }
        resolved.path
    };
    let metadata = std::fs::metadata(&path).map_err(|error| SceneError::file(&path, error.to_string()))?;
    if !metadata.is_file() {
        return Err(SceneError::file(&path, "this is not a file").help(FORMATS));
    }
    Ok((path, metadata.len()))
}

fn load_one(file: &Path, size: u64, needs: Needs, budget: &mut Budget) -> Result<Scene, SceneError> {
    let bytes = read_file(file, size, budget)?;
    let format = format_of(file, &bytes)?;
    let mut context = Context { file, needs, budget };
    let scene = match format {
        Format::Cbo => super::cbo::read(&bytes, &mut context),
        Format::Obj => super::obj::read(&bytes, &mut context),
        #[cfg(feature = "gltf")]
        Format::Gltf => super::gltf::read(&bytes, &mut context),
        #[cfg(not(feature = "gltf"))]
        Format::Gltf => Err(SceneError::file(file, "this program was built without glTF")
            .help("build it with the feature `gltf` of curitiba-pipeline")),
        Format::Studio => super::studio::read(&bytes, &mut context),
        Format::Ogre => super::ogre::read(&bytes, &mut context),
        Format::Collada => super::collada::read(&bytes, &mut context),
    };
    drop(bytes);
    budget.give_back(size);
    scene
}

/// Makes a scene's transforms relative to another origin.
fn move_origin(scene: &mut Scene, origin: DVec3) {
    let moved = scene.origin - origin;
    if moved == DVec3::ZERO {
        return;
    }
    for object in &mut scene.objects {
        object.transform = (DMat4::from_translation(moved) * object.transform.as_dmat4()).as_mat4();
    }
    for camera in &mut scene.cameras {
        camera.position = (camera.position.as_dvec3() + moved).as_vec3();
    }
    for light in &mut scene.lights {
        light.position = light.position.map(|position| (position.as_dvec3() + moved).as_vec3());
    }
    scene.origin = origin;
}

/// Appends the contents of `file` to `scene`.
fn merge(scene: &mut Scene, file: &Path, mut other: Scene) {
    let first_mesh = scene.meshes.len() as u32;
    if scene.files.is_empty() {
        scene.origin = other.origin;
    }
    move_origin(&mut other, scene.origin);
    leave_out_unplaced(&mut other, file);
    let has_none = |mesh: &Mesh| mesh.groups.iter().all(|group| group.triangles.is_empty());
    let empty: Vec<bool> = other.meshes.iter().map(has_none).collect();
    let is_empty = |object: &Object| empty[object.mesh as usize];
    if other.objects.iter().all(is_empty) {
        other.warnings.add(file, "scenes without triangles", "nothing of them is drawn", || file.display().to_string());
    }
    scene.warnings.append(std::mem::take(&mut other.warnings));
    scene.files.push(LoadedFile {
        path: file.to_owned(),
        meshes: other.meshes.len() as u32,
        objects: other.objects.len() as u32,
    });

    let mut by_name: HashMap<String, u32> =
        scene.materials.iter().enumerate().map(|(index, material)| (material.name.clone(), index as u32)).collect();
    let textures: Vec<u32> = other.textures.drain(..).map(|source| add_texture(&mut scene.textures, source)).collect();
    let mut materials = Vec::with_capacity(other.materials.len());
    for mut material in other.materials {
        for texture in material.textures_mut().into_iter().flatten() {
            *texture = textures[*texture as usize];
        }
        if replace_non_finite(&mut material) {
            scene.warnings.add(
                file,
                "materials with numbers that are not finite",
                "those of a light grey one serve",
                || format!("`{}`", material.name),
            );
        }
        let known = by_name.get(&material.name).copied();
        materials.push(known.unwrap_or(scene.materials.len() as u32));
        match known {
            Some(index) if scene.materials[index as usize] == material => {}
            Some(_) => scene.warnings.add(
                file,
                "materials that an earlier file declares otherwise",
                "the earlier declaration serves",
                || material.name.clone(),
            ),
            None => {
                by_name.insert(material.name.clone(), scene.materials.len() as u32);
                scene.materials.push(material);
            }
        }
    }
    for mesh in &mut other.meshes {
        for group in &mut mesh.groups {
            group.material = materials[group.material as usize];
        }
    }
    for object in &mut other.objects {
        object.mesh += first_mesh;
    }
    scene.meshes.append(&mut other.meshes);
    scene.objects.append(&mut other.objects);
    scene.cameras.append(&mut other.cameras);
    scene.lights.append(&mut other.lights);
}

/// Leaves out the objects whose transforms hold a number that is not finite. No vertex of such an object has a finite position.
fn leave_out_unplaced(scene: &mut Scene, file: &Path) {
    let Scene { objects, warnings, .. } = scene;
    objects.retain(|object| {
        let placed = object.transform.is_finite();
        if !placed {
            let remedy = "they are left out: they have no place";
            warnings.add(file, "objects whose transforms hold numbers that are not finite", remedy, || {
                format!("`{}`", object.name)
            });
        }
        placed
    });
}

/// Replaces colours, shininess and thickness that are not finite by the defaults; returns whether any was replaced. An infinite index
/// of refraction, attenuation distance or alpha cutoff is meaningful and stays.
fn replace_non_finite(material: &mut Material) -> bool {
    let defaults = Material::default();
    let mut replaced = false;
    let mut mend = |bad: bool| {
        replaced |= bad;
        bad
    };
    for (color, default) in [
        (&mut material.diffuse, defaults.diffuse),
        (&mut material.ambient, defaults.ambient),
        (&mut material.specular, defaults.specular),
        (&mut material.emission, defaults.emission),
    ] {
        if mend(!color.is_finite()) {
            *color = default;
        }
    }
    if mend(!material.attenuation_color.is_finite()) {
        material.attenuation_color = defaults.attenuation_color;
    }
    for (value, default) in
        [(&mut material.shininess, defaults.shininess), (&mut material.thickness, defaults.thickness)]
    {
        if mend(!value.is_finite()) {
            *value = default;
        }
    }
    replaced
}
