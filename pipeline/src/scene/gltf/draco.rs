//! Primitives compressed with `KHR_draco_mesh_compression`, decoded by the crate `draco-core`.

use super::super::context::Context;
use super::super::error::SceneError;
use super::accessor::Data;
use crate::guard;
use ::gltf::json::{Index, buffer, mesh::Primitive};
use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use serde_json::{Map, Value};

pub(super) const EXTENSION: &str = "KHR_draco_mesh_compression";

/// Upper bound of the decoder's tables, in bytes per triangle or vertex: corners, opposite corners, and maps of both for each
/// attribute.
const TABLES: u64 = 256;

/// A decoded stream.
pub(super) struct Decoded<'a> {
    mesh: Mesh,
    /// The id of each attribute in the stream, by glTF semantic.
    ids: &'a Map<String, Value>,
}

/// Decodes the stream of a primitive; `None` if it is not compressed.
pub(super) fn decode<'a>(
    primitive: &'a Primitive,
    data: &Data<'_>,
    context: &mut Context<'_>,
) -> Result<Option<Decoded<'a>>, SceneError> {
    let Some(written) = primitive.extensions.as_ref().and_then(|extensions| extensions.others.get(EXTENSION)) else {
        return Ok(None);
    };
    let fail = |what: String| SceneError::file(context.file, format!("{EXTENSION}: {what}"));
    let view = written.get("bufferView").and_then(Value::as_u64).and_then(|view| u32::try_from(view).ok());
    let (Some(view), Some(ids)) = (view, written.get("attributes").and_then(Value::as_object)) else {
        return Err(fail("a primitive lacks `bufferView` or `attributes`".to_owned()));
    };
    let bytes = data.view(Index::<buffer::View>::new(view)).map_err(fail)?;
    // The size of the decoded mesh has no bound in the stream's length, so the remaining memory bounds it.
    let left = context.budget.left();
    let limits = DecodeLimits::default()
        .with_max_points(left / TABLES)
        .with_max_faces(left / TABLES)
        .with_max_decoded_bytes(left / 4);
    let decoded = guard::call("draco-core", || {
        let mut mesh = Mesh::new();
        MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh).map(|()| mesh)
    });
    match decoded.map_err(fail)? {
        Ok(mesh) => Ok(Some(Decoded { mesh, ids })),
        Err(error) => Err(fail(format!("buffer view {view} cannot be decoded: {error}"))
            .help("if it is too large, `--max-memory` raises the limit")),
    }
}

impl Decoded<'_> {
    /// The triangles, as indices of vertices.
    pub(super) fn triangles(&self, context: &mut Context<'_>) -> Result<Vec<[u32; 3]>, SceneError> {
        context.take("the triangles", self.mesh.num_faces(), 12)?;
        Ok(self.mesh.faces().iter().map(|corners| corners.map(|point| point.0)).collect())
    }

    /// The vectors of an attribute by vertex; `None` if the extension does not list the attribute. Integers are converted to fractions if
    /// the accessor is `normalized`.
    pub(super) fn vectors<const N: usize>(
        &self,
        semantic: &str,
        normalized: bool,
        context: &mut Context<'_>,
    ) -> Result<Option<Vec<[f32; N]>>, SceneError> {
        let Some(id) = self.ids.get(semantic) else { return Ok(None) };
        let file = context.file;
        let fail = |what: &str| SceneError::file(file, format!("{EXTENSION}: attribute {semantic} {what}"));
        let id = id.as_u64().and_then(|id| u32::try_from(id).ok());
        let attribute = id.and_then(|id| self.mesh.attribute_by_unique_id(id));
        let attribute = attribute.ok_or_else(|| fail("is not in the stream"))?;
        if usize::from(attribute.num_components()) != N {
            return Err(fail(&format!("has {} components; valid: {N}", attribute.num_components())));
        }
        let points = self.mesh.num_points();
        context.take("a decoded attribute", points, 2 * N * size_of::<f32>())?;
        let mut values = guard::call("draco-core", || attribute.read_f32s(points, N)).map_err(|panic| fail(&panic))?;
        if let Some(largest) = largest(attribute.data_type()).filter(|_| normalized) {
            values.iter_mut().for_each(|value| *value = (*value / largest).max(-1.0));
        }
        let vectors = values.as_chunks().0.to_vec();
        context.budget.give_back((values.len() * size_of::<f32>()) as u64);
        Ok(Some(vectors))
    }
}

/// The integer of a type that represents 1 in normalised values (glTF 2.0, section 3.6.2.2).
fn largest(of: DataType) -> Option<f32> {
    match of {
        DataType::Int8 => Some(127.0),
        DataType::Uint8 => Some(255.0),
        DataType::Int16 => Some(32767.0),
        DataType::Uint16 => Some(65535.0),
        _ => None,
    }
}
