//! Vertex attributes of a primitive, compressed or not.

use super::super::context::Context;
use super::super::error::SceneError;
use super::accessor::Data;
use super::draco;
use ::gltf::json::{Index, accessor::Accessor};

/// Sources of a primitive's vertex attributes.
pub(super) struct Vectors<'a> {
    pub(super) data: &'a Data<'a>,
    pub(super) packed: Option<&'a draco::Decoded<'a>>,
}

impl Vectors<'_> {
    /// Reads an attribute from the compressed stream if the stream contains it, otherwise from the accessor's buffer view.
    pub(super) fn read<const N: usize>(
        &self,
        accessor: Index<Accessor>,
        semantic: &str,
        context: &mut Context<'_>,
    ) -> Result<Vec<[f32; N]>, SceneError> {
        if let Some(packed) = self.packed {
            let declared = self.data.root.accessors.get(accessor.value());
            let normalized = declared.is_some_and(|accessor| accessor.normalized);
            if let Some(vectors) = packed.vectors(semantic, normalized, context)? {
                return Ok(vectors);
            }
        }
        self.data.vectors::<N>(accessor, context)
    }
}
