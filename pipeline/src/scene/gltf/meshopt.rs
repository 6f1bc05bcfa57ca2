//! Buffer views compressed with `EXT_meshopt_compression`, decoded by the crate `meshoptimizer-rs`.

use super::super::context::Context;
use super::super::error::SceneError;
use crate::guard;
use ::gltf::json;
use meshoptimizer_rs::codec::{BufferView, Filter, Mode};
use meshoptimizer_rs::{Limits, Workspace};
use serde_json::Value;
use std::borrow::Cow;

pub(super) const EXTENSION: &str = "EXT_meshopt_compression";

/// Whether a buffer is declared as a fallback for compressed views. Such a buffer need not have bytes of its own.
pub(super) fn is_fallback(buffer: &json::Buffer) -> bool {
    let extension = buffer.extensions.as_ref().and_then(|extensions| extensions.others.get(EXTENSION));
    extension.and_then(|extension| extension.get("fallback")).and_then(Value::as_bool) == Some(true)
}

/// Whether a buffer has views and all of them are compressed. Such a buffer is a fallback even if it is not declared as one.
pub(super) fn is_compressed_only(root: &json::Root, buffer: usize) -> bool {
    let mut views = root.buffer_views.iter().filter(|view| view.buffer.value() == buffer).peekable();
    views.peek().is_some() && views.all(|view| written(view).is_some())
}

/// The extension of a buffer view.
fn written(view: &json::buffer::View) -> Option<&Value> {
    view.extensions.as_ref()?.others.get(EXTENSION)
}

/// The decompressed bytes of each compressed buffer view. Empty if no view is compressed.
pub(super) fn views(
    root: &json::Root,
    buffers: &[Cow<'_, [u8]>],
    context: &mut Context<'_>,
) -> Result<Vec<Option<Vec<u8>>>, SceneError> {
    if !root.buffer_views.iter().any(|view| written(view).is_some()) {
        return Ok(Vec::new());
    }
    let mut views = Vec::with_capacity(root.buffer_views.len());
    for (index, view) in root.buffer_views.iter().enumerate() {
        views.push(match written(view) {
            Some(written) => Some(decode(index, written, buffers, context)?),
            None => None,
        });
    }
    Ok(views)
}

fn decode(
    index: usize,
    written: &Value,
    buffers: &[Cow<'_, [u8]>],
    context: &mut Context<'_>,
) -> Result<Vec<u8>, SceneError> {
    let file = context.file;
    let fail = |what: String| SceneError::file(file, format!("buffer view {index}, {EXTENSION}: {what}"));
    let number = |name: &str| match written.get(name) {
        None if name == "byteOffset" => Ok(0),
        value => value
            .and_then(Value::as_u64)
            .and_then(|value| usize::try_from(value).ok())
            .ok_or_else(|| fail(format!("`{name}` is missing or no whole number"))),
    };
    let word = |name: &str| written.get(name).and_then(Value::as_str);
    let mode = word("mode").and_then(|mode| Mode::parse(mode).ok());
    let mode =
        mode.ok_or_else(|| fail("its mode is not known".to_owned()).help("valid: ATTRIBUTES, TRIANGLES, INDICES"))?;
    let filter = Filter::parse(word("filter").unwrap_or("NONE")).map_err(|_| {
        fail("its filter is not known".to_owned()).help("valid: NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL")
    })?;
    let (count, stride) = (number("count")?, number("byteStride")?);
    let (buffer, start, length) = (number("buffer")?, number("byteOffset")?, number("byteLength")?);
    let bytes = buffers.get(buffer).ok_or_else(|| fail(format!("buffer {buffer} does not exist")))?;
    let source = start.checked_add(length).and_then(|end| bytes.get(start..end));
    let source = source.ok_or_else(|| fail(format!("it reaches beyond the {} bytes of its buffer", bytes.len())))?;
    if count == 0 {
        return Ok(Vec::new());
    }
    let layout = BufferView::new(mode, filter, count, stride)
        .map_err(|error| fail(format!("{count} elements of {stride} bytes: {error}")))?;
    context.take("a decoded buffer view", layout.byte_length(), 1)?;
    let limits = Limits { max_bytes: layout.byte_length(), max_work: u64::MAX };
    let decoded = guard::call("meshoptimizer-rs", || layout.decode(source, &mut Workspace::new(limits)));
    decoded.map_err(fail)?.map_err(|error| fail(error.to_string()))
}
