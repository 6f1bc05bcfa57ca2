//! Shared state of the readers of all formats: the file, the memory budget, textures and materials.

use super::error::{Budget, SceneError};
use super::{Material, Needs, TextureSource};
use crate::diagnostic::Warnings;
use crate::paths::{MAX_WRITTEN, resolve_path};
use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Greatest number of components of a path's suffix that is searched for in the scene's folder.
const MAX_SUFFIX: usize = 16;
/// Alpha cutoff of materials that a texture cuts out, where the file gives no number.
pub(crate) const MASK_CUTOFF: f32 = 0.5;

/// Input of every format's reader.
pub(crate) struct Context<'a> {
    pub(crate) file: &'a Path,
    pub(crate) needs: Needs,
    pub(crate) budget: &'a mut Budget,
}

impl Context<'_> {
    /// The folder that the file's relative paths start from.
    pub(crate) fn folder(&self) -> &Path {
        self.file.parent().unwrap_or(Path::new(""))
    }

    /// Books memory for `count` items of `size` bytes.
    pub(crate) fn take(&mut self, what: &str, count: usize, size: usize) -> Result<(), SceneError> {
        self.budget.take(self.file, what, (count as u64).saturating_mul(size as u64))
    }
}

/// Reads the first `size` bytes of a file, after booking that memory. Special files (such as those in `/proc`) claim 0 bytes and
/// may never end; bytes that are appended meanwhile are not read.
pub(crate) fn read_file(file: &Path, size: u64, budget: &mut Budget) -> Result<Vec<u8>, SceneError> {
    budget.take(file, "the file's bytes", size)?;
    let failed = |error: std::io::Error| SceneError::file(file, error.to_string());
    let length = usize::try_from(size).unwrap_or(usize::MAX);
    let mut bytes = crate::memory::with_capacity(length).map_err(|error| SceneError::file(file, error.to_string()))?;
    let opened = crate::files::open(file).map_err(failed)?;
    opened.take(size).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 != size {
        return Err(SceneError::file(file, "its size changed while it was read"));
    }
    Ok(bytes)
}

/// Fails if a file was refused because it lies outside the folder of [`confine`](crate::files::confine). A load continues
/// without a texture that cannot be read, but fails if a texture was refused.
pub(crate) fn no_file_refused() -> Result<(), SceneError> {
    crate::files::refused().map_or(Ok(()), |file| {
        Err(SceneError::file(&file, "this file is named by the scene and lies outside the folder of --confine")
            .help("copy it into that folder, or name a wider one"))
    })
}

/// The index of a texture source; an equal source that is already listed is shared.
pub(crate) fn add_texture(textures: &mut Vec<TextureSource>, source: TextureSource) -> u32 {
    let index = textures.iter().position(|known| *known == source).unwrap_or_else(|| {
        textures.push(source);
        textures.len() - 1
    });
    index as u32
}

/// Finds a texture file that a scene file names; counts a warning if it does not exist.
pub(crate) fn texture_file(
    context: &Context<'_>,
    written: &str,
    warnings: &mut Warnings,
    material: &str,
) -> Option<PathBuf> {
    texture_file_or(context, written, warnings, (material, "the diffuse colour serves"))
}

/// [`texture_file`] for a material; the warning says what is used instead of a missing texture.
pub(crate) fn texture_file_or(
    context: &Context<'_>,
    written: &str,
    warnings: &mut Warnings,
    (material, remedy): (&str, &'static str),
) -> Option<PathBuf> {
    let Some(resolved) = resolve_path(context.folder(), written).filter(|resolved| resolved.path.is_file()) else {
        warnings.add(context.file, "missing textures", remedy, || format!("`{written}` of material `{material}`"));
        return None;
    };
    if resolved.case_differs {
        warnings.add(context.file, "texture paths with other letter case", "the file was found all the same", || {
            format!("`{written}` is {}", resolved.path.display())
        });
    }
    Some(resolved.path)
}

/// [`texture_file`] for formats whose paths are those of the machine that wrote the file. If a path does not exist, its suffixes
/// are tried relative to the scene's folder, the longest first (`Texturas/water.jpg`, then `water.jpg`).
pub(crate) fn texture_file_or_suffix(
    context: &Context<'_>,
    written: &str,
    warnings: &mut Warnings,
    material: &str,
) -> Option<PathBuf> {
    let find = |path: &str| resolve_path(context.folder(), path).filter(|resolved| resolved.path.is_file());
    if written.len() <= MAX_WRITTEN && find(written).is_none() {
        let portable = crate::paths::portable(written);
        let written_path = portable.to_str().unwrap_or_default();
        let names: Vec<&str> = written_path.split('/').filter(|name| !name.is_empty() && *name != ".").collect();
        let first = names.iter().rposition(|name| *name == "..").map_or(0, |last| last + 1);
        // Each suffix costs a search, so their number is limited.
        let first = first.max(names.len().saturating_sub(MAX_SUFFIX));
        let found = (first..names.len()).find_map(|start| find(&names[start..].join("/")));
        if let Some(found) = found {
            let what = "texture paths that lead nowhere";
            warnings.add(context.file, what, "a file of that name beside the scene serves", || {
                format!("`{written}` of material `{material}` is {}", found.path.display())
            });
            return Some(found.path);
        }
    }
    texture_file(context, written, warnings, material)
}

/// Checks the scale of a normal map's x and y. Magnitudes up to 1e6 are kept and larger ones clamped to 1e6: with larger scales the normals
/// would point in all directions and squares would overflow. NaN becomes 1.
pub(crate) fn normal_scale(context: &Context<'_>, written: f32, material: &str, warnings: &mut Warnings) -> f32 {
    const MOST: f32 = 1e6;
    if written.abs() <= MOST {
        return written;
    }
    let what = "normal maps with a scale that is not from -1e6 to 1e6";
    warnings.add(context.file, what, "the nearest number that is serves, 1 for none", || format!("`{material}`"));
    if written.is_nan() { 1.0 } else { written.clamp(-MOST, MOST) }
}

/// The materials of one file, by name.
#[derive(Debug, Default)]
pub(crate) struct MaterialTable {
    pub(crate) materials: Vec<Material>,
    by_name: HashMap<String, u32>,
}

impl MaterialTable {
    /// Adds a material. Returns `false` if one of that name exists; the existing one is kept.
    pub(crate) fn declare(&mut self, material: Material) -> bool {
        if self.by_name.contains_key(&material.name) {
            return false;
        }
        self.by_name.insert(material.name.clone(), self.materials.len() as u32);
        self.materials.push(material);
        true
    }

    pub(crate) fn get(&self, name: &str) -> Option<u32> {
        self.by_name.get(name).copied()
    }

    /// The material with a name. If there is none, a default material is added and a warning counts it.
    pub(crate) fn get_or_default(&mut self, name: &str, file: &Path, warnings: &mut Warnings) -> u32 {
        if let Some(index) = self.get(name) {
            return index;
        }
        warnings
            .add(file, "materials that are used but not declared", "a light grey one serves", || format!("`{name}`"));
        self.declare(Material { name: name.to_owned(), ..Material::default() });
        self.materials.len() as u32 - 1
    }
}
