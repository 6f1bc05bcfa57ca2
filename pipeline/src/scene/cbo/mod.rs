//! CBO and NBO: the engine's binary scene files, little endian, in the two layouts met.
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
//! A `str` is a `u32` length, that many Latin-1 bytes and a NUL; a `mat4` is 16 `f32`, column by column. The extension
//! does not tell the layout. Neither layout keeps transmission or refraction. Of the 2014 layout's render states the
//! alpha test is read and written, as [`Material::alpha_cutoff`](super::Material::alpha_cutoff); today's has no states,
//! and a texture with texels that are less than half opaque is cut out at 0.5 there.

mod read;
mod write;

use super::Scene;
use super::context::Context;
use super::error::SceneError;
pub use write::write_cbo;

/// What "no texture" is called in a material.
const NO_TEXTURE: &str = "<no texture>";
/// The scene type whose objects lie in the nodes of an octree.
const OCTREE_SCENE: &str = "OctreeByMatScene";
/// The renderable of an object without geometry.
const NULL_OBJECT: &str = "NULLOBJECT";

/// Where the alpha test stands in the lists of a 2014 render state, and OpenGL's names of its comparisons.
mod alpha_test {
    /// In the bools: whether it is on.
    pub(super) const ENABLED: usize = 2;
    /// In the enums: the comparison.
    pub(super) const FUNCTION: usize = 8;
    /// In the floats: what the texture's alpha is compared with.
    pub(super) const VALUE: usize = 3;
    /// `GL_GREATER`.
    pub(super) const GREATER: i32 = 0x204;
    /// `GL_GEQUAL`.
    pub(super) const GREATER_OR_EQUAL: i32 = 0x206;
}

/// Which engine's files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// `.cbo`, of 2014: materials hold shader names and a render state, objects name the class of their transform.
    Cbo2014,
    /// `.nbo`, of today.
    NboToday,
}

impl Layout {
    fn is_2014(self) -> bool {
        self == Self::Cbo2014
    }
}

/// Reads a file in the layout in which it parses to its last byte.
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
    // The layout that explains more of the file tells the more useful story.
    read::read(bytes, layouts[1], context).map_err(|second| {
        let failure = if second.reached > first.reached { second } else { first };
        failure.error.help("neither the 2014 layout nor today's reads this file to its end; is it cut off or damaged?")
    })
}
