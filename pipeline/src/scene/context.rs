//! What the readers of all formats share: the file, its memory, its textures and materials.

use super::error::{Budget, SceneError};
use super::{Material, Needs, TextureSource};
use crate::diagnostic::Warnings;
use crate::paths::{MAX_WRITTEN, resolve_path};
use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Most components of an end of a path that is looked for beside the scene.
const MAX_SUFFIX: usize = 16;
/// The cutoff of materials that are cut out by a texture, where the file names no number.
pub(crate) const MASK_CUTOFF: f32 = 0.5;

/// What every format's reader works with.
pub(crate) struct Context<'a> {
    pub(crate) file: &'a Path,
    pub(crate) needs: Needs,
    pub(crate) budget: &'a mut Budget,
}

impl Context<'_> {
    /// The folder that relative paths of the file start from.
    pub(crate) fn folder(&self) -> &Path {
        self.file.parent().unwrap_or(Path::new(""))
    }

    /// Books the memory of a block of `count` items of `size` bytes.
    pub(crate) fn take(&mut self, what: &str, count: usize, size: usize) -> Result<(), SceneError> {
        self.budget.take(self.file, what, (count as u64).saturating_mul(size as u64))
    }
}

/// Reads as much of a file as it said to hold, after booking that. Files that the system makes up say 0 and may never
/// end; a file that grows meanwhile is read as it was.
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

/// A load goes on without a texture that it cannot read; one that lies outside the folder of
/// [`confine`](crate::files::confine) ends it.
pub(crate) fn no_file_refused() -> Result<(), SceneError> {
    crate::files::refused().map_or(Ok(()), |file| {
        Err(SceneError::file(file, "this file is named by the scene and lies outside the folder of --confine")
            .help("copy it into that folder, or name a wider one"))
    })
}

/// The index of a texture source, shared with an equal one that is there already.
pub(crate) fn add_texture(textures: &mut Vec<TextureSource>, source: TextureSource) -> u32 {
    let index = textures.iter().position(|known| *known == source).unwrap_or_else(|| {
        textures.push(source);
        textures.len() - 1
    });
    index as u32
}

/// Finds a texture file that a scene file names, and counts a warning where there is none.
pub(crate) fn texture_file(
    context: &Context<'_>,
    written: &str,
    warnings: &mut Warnings,
    material: &str,
) -> Option<PathBuf> {
    texture_file_or(context, written, warnings, (material, "the diffuse colour serves"))
}

/// [`texture_file`] of a material, and what serves without.
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

/// [`texture_file`] for the engine's own files, whose paths are those of the machine that wrote them: where one leads
/// nowhere, its ends serve from the scene's folder on, the longest first (`Texturas/water.jpg`, then `water.jpg`).
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
        // Each end that is tried costs a search; nobody's scene lies deeper.
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

/// The multiplier of a normal map's x and y as a file has it: one that is finite and of no more than this, beyond which a surface is a
/// wall of needles and squares leave the range of numbers.
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
    /// Adds a material; `false` if one of its name is there already, which stays as it is.
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

    /// The material of that name; where there is none, a default one is declared and counted as a warning.
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
