//! CBO and NBO, the binary scene files of the report's engine, little endian, in two layouts.
//!
//! ```text
//! file        := u32 material_count, material[material_count], str scene_type, scene
//! material    := str name, f32[4] ambient, specular, diffuse, emission, f32 shininess, str texture[8], [2014] state
//! scene       := scene_type == "OctreeByMatScene" ? octree : u32 object_count, object[object_count]
//! object      := str class, str name, str volume_class, u32 n, f32[3n], [2014] str transform_class, mat4, str renderable,
//!                (unless "NULLOBJECT" or seen before: str renderable_class, vertices, u32 n, (str material, indices)[n])
//! vertices    := u32 n, (str attribute, u32 n, f32[4n])[n], u32 ignored
//! indices     := u32 ignored, u32 n, u32[n]               n = 0: the vertices are taken in order
//! octree      := f32[6] bounds, str name, node
//! node        := f32[12] bounds, u32 n, (str key, octree_object)[n], i32 child_count, id, depth, node[child_count]
//! octree_object := str name, f32[6] bounds, [2014] str transform_class, mat4, str renderable, vertices, str material, indices
//! ```
//! A `str` is a `u32` length, that many Latin-1 bytes and a NUL; a `mat4` is 16 `f32`, column by column. The file extension does
//! not determine the layout. Neither layout stores transmission or refraction. Of the render states of the 2014 layout only the
//! alpha test is read and written, as [`Material::alpha_cutoff`](super::Material::alpha_cutoff). Today's layout has no render
//! states: there a material gets a cutoff of 0.5 if its texture has texels of less than half opacity.

mod read;
mod write;

use super::Scene;
use super::context::Context;
use super::error::SceneError;
pub use write::write_cbo;

/// Name of "no texture" in a material.
const NO_TEXTURE: &str = "<no texture>";
/// Scene type of files that store their objects in an octree.
const OCTREE_SCENE: &str = "OctreeByMatScene";
/// Renderable type of an object without geometry.
const NULL_OBJECT: &str = "NULLOBJECT";

/// Positions of the alpha test in the lists of a 2014 render state, and OpenGL's numbers of its comparisons.
mod alpha_test {
    /// Index in the list of bools: whether the test is enabled.
    pub(super) const ENABLED: usize = 2;
    /// Index in the list of enums: the comparison function.
    pub(super) const FUNCTION: usize = 8;
    /// Index in the list of floats: the reference value for the texture's alpha.
    pub(super) const VALUE: usize = 3;
    /// `GL_GREATER`.
    pub(super) const GREATER: i32 = 0x204;
    /// `GL_GEQUAL`.
    pub(super) const GREATER_OR_EQUAL: i32 = 0x206;
}

/// The layout of a scene file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// `.cbo` of 2014: materials hold shader names and a render state, objects name the class of their transform.
    Cbo2014,
    /// `.nbo`, today's layout.
    NboToday,
}

impl Layout {
    fn is_2014(self) -> bool {
        self == Self::Cbo2014
    }
}

/// Reads a file in the first of the two layouts in which it can be read to its last byte. The extension only decides which layout is tried
/// first.
pub(crate) fn read(bytes: &[u8], context: &mut Context<'_>) -> Result<Scene, SceneError> {
    let extension = context.file.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let layouts = if extension.eq_ignore_ascii_case("nbo") {
        [Layout::NboToday, Layout::Cbo2014]
    } else {
        [Layout::Cbo2014, Layout::NboToday]
    };
    let before = context.budget.clone();
    let first = match read::read(bytes, layouts[0], context) {
        Ok(scene) => return Ok(scene),
        Err(failure) => failure,
    };
    *context.budget = before;
    // If both layouts fail, the one that got further in the file gives the more useful error.
    read::read(bytes, layouts[1], context).map_err(|second| {
        let failure = if second.reached > first.reached { second } else { first };
        failure.error.help("neither the 2014 layout nor today's reads this file to its end; is it cut off or damaged?")
    })
}
