//! The parts of a glTF asset: its JSON, its buffers, and the data that URIs refer to.

use super::super::bytes::Reader;
use super::super::context::{Context, read_file};
use super::super::error::SceneError;
use super::meshopt;
use crate::guard;
use crate::paths::resolve_path;
use ::gltf::json;
use std::borrow::Cow;

const GLB_MAGIC: &[u8] = b"glTF";
const GZIP_MAGIC: &[u8] = &[0x1F, 0x8B];
const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;

/// Splits a file into its JSON and, for GLB, its binary chunk.
pub(super) fn split<'a>(bytes: &'a [u8], context: &Context<'a>) -> Result<(&'a [u8], Option<&'a [u8]>), SceneError> {
    if !bytes.starts_with(GLB_MAGIC) {
        // A byte order mark may be ignored (RFC 8259, section 8.1).
        return Ok((bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes), None));
    }
    let mut reader = Reader::new(context.file, bytes);
    reader.block(GLB_MAGIC.len(), 1, "the magic number")?;
    let version = reader.u32("the version")?;
    if version != 2 {
        return Err(reader.error(format!("this is GLB version {version}")).help("valid: 2"));
    }
    reader.u32("the length")?;
    let (mut text, mut binary) = (None, None);
    while reader.left() >= 8 {
        let length = reader.count("a chunk's length")?;
        let kind = reader.u32("a chunk's type")?;
        let chunk = reader.block(length, 1, "a chunk")?;
        match kind {
            CHUNK_JSON if text.is_none() => text = Some(chunk),
            CHUNK_BIN if binary.is_none() => binary = Some(chunk),
            // Chunks of other types are to be skipped (glTF 2.0, section 4.4.3).
            _ => {}
        }
    }
    let text = text.ok_or_else(|| reader.error("the file has no JSON chunk"))?;
    Ok((text, binary))
}

/// Parses the JSON. An upper bound of the tree's memory is derived from the JSON text and booked before parsing.
pub(super) fn parse(text: &[u8], context: &mut Context<'_>) -> Result<json::Root, SceneError> {
    let count = |byte: u8| text.iter().filter(|other| **other == byte).count();
    // No object of the tree is larger than 512 bytes, and no element of an array than 64.
    context.take("the JSON tree", 1, text.len() + 512 * count(b'{') + 64 * count(b','))?;
    let root = guard::call("gltf", || json::deserialize::from_slice(text));
    root.map_err(|panic| SceneError::file(context.file, panic))?.map_err(|error| {
        let what = match version(text) {
            Some(version) if !version.starts_with("2.") => format!("this is glTF version {}", shortened(&version)),
            _ if text.starts_with(GZIP_MAGIC) => "the file is compressed by gzip".to_owned(),
            _ => format!("the JSON is not a glTF asset: {error}"),
        };
        SceneError::file(context.file, what).help("valid: glTF 2.0")
    })
}

/// The version that an asset of any version declares. Files of version 1.0 may declare none; they are recognised by `meshes`, which is an
/// object with names as keys.
fn version(text: &[u8]) -> Option<String> {
    #[derive(serde::Deserialize)]
    struct Asset {
        version: Option<String>,
    }
    #[derive(serde::Deserialize)]
    struct Any {
        asset: Option<Asset>,
        nodes: Option<serde::de::IgnoredAny>,
        meshes: Option<Named>,
    }
    /// Deserialised from a JSON object, never from an array.
    #[derive(serde::Deserialize)]
    struct Named {}
    let any: Any = serde_json::from_slice(text).ok()?;
    let is_named = any.nodes.is_some() && any.meshes.is_some();
    any.asset.and_then(|asset| asset.version).or_else(|| is_named.then(|| "1.0".to_owned()))
}

/// Reads all buffers and checks their lengths.
pub(super) fn buffers<'a>(
    root: &json::Root,
    binary: Option<&'a [u8]>,
    context: &mut Context<'a>,
) -> Result<Vec<Cow<'a, [u8]>>, SceneError> {
    let mut buffers = Vec::with_capacity(root.buffers.len());
    for (index, buffer) in root.buffers.iter().enumerate() {
        let fail = |what: String| SceneError::file(context.file, format!("buffer {index} {what}"));
        let bytes: Cow<'a, [u8]> = match &buffer.uri {
            Some(uri) => Cow::Owned(match uri_target(uri) {
                Ok(Target::Data(data)) => {
                    context.take("a buffer", data.len(), 1)?;
                    base64(data).ok_or_else(|| fail("is not valid base64".to_owned()))?
                }
                Ok(Target::Path(path)) => {
                    let resolved = resolve_path(context.folder(), &path)
                        .filter(|resolved| resolved.path.is_file())
                        .ok_or_else(|| fail(format!("is the file `{path}`, which is missing")))?;
                    let failed = |error: std::io::Error| SceneError::file(&resolved.path, error.to_string());
                    let size = std::fs::metadata(&resolved.path).map_err(failed)?.len();
                    read_file(&resolved.path, size, context.budget)?
                }
                Err(why) => {
                    return Err(
                        fail(format!("{why}: `{}`", shortened(uri))).help("valid: a relative path or a data URI")
                    );
                }
            }),
            None => match binary.filter(|_| index == 0 && !meshopt::is_fallback(buffer)) {
                Some(binary) => Cow::Borrowed(binary),
                // The views of a fallback buffer are compressed, and their data lie in another buffer.
                None if meshopt::is_fallback(buffer) || meshopt::is_compressed_only(root, index) => {
                    buffers.push(Cow::Borrowed(&[][..]));
                    continue;
                }
                None => {
                    return Err(
                        fail("has no data".to_owned()).help("valid: a `uri`, or the binary chunk of a GLB file")
                    );
                }
            },
        };
        let length = usize::try_from(buffer.byte_length.0).unwrap_or(usize::MAX);
        if bytes.len() < length {
            return Err(fail(format!("says it has {length} bytes but has {}", bytes.len())));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// What a URI refers to.
pub(super) enum Target<'a> {
    /// Base64 text.
    Data(&'a str),
    /// A relative path, with percent escapes decoded.
    Path(String),
}

/// Parses a URI; the error says why it cannot be read.
pub(super) fn uri_target(uri: &str) -> Result<Target<'_>, &'static str> {
    if let Some(data) = uri.strip_prefix("data:") {
        return match data.split_once(";base64,") {
            Some((_, data)) => Ok(Target::Data(data)),
            None => Err("is a data URI without base64"),
        };
    }
    let scheme = uri.split(['/', '?', '#']).next().is_some_and(|first| first.contains(':'));
    let path = percent_decoded(uri).ok_or("is a URI with a broken % escape")?;
    if scheme || path.starts_with(['/', '\\']) || path.contains('\0') {
        return Err("is not a relative path");
    }
    Ok(Target::Path(path))
}

/// The start of a text that may be megabytes long, for messages.
pub(super) fn shortened(text: &str) -> String {
    const SHOWN: usize = 60;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        rest = tail;
        if *first == b'%' {
            let digits = std::str::from_utf8(tail.get(..2)?).ok()?;
            // `from_str_radix` would accept a sign.
            if !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
                return None;
            }
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
            rest = &tail[2..];
        } else {
            bytes.push(*first);
        }
    }
    String::from_utf8(bytes).ok()
}

/// Decodes base64 (RFC 4648, section 4), with or without padding.
pub(super) fn base64(text: &str) -> Option<Vec<u8>> {
    let text = text.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 2);
    for group in text.chunks(4) {
        let mut bits = 0_u32;
        for letter in group {
            let value = match letter {
                b'A'..=b'Z' => letter - b'A',
                b'a'..=b'z' => letter - b'a' + 26,
                b'0'..=b'9' => letter - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(value);
        }
        bits <<= 6 * (4 - group.len());
        let [_, decoded @ ..] = bits.to_be_bytes();
        match group.len() {
            1 => return None,
            letters => bytes.extend_from_slice(&decoded[..letters - 1]),
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_follows_the_test_vectors_of_its_standard() {
        for (text, bytes) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg==", "foob"), ("Zm9vYmE", "fooba")]
        {
            assert_eq!(base64(text).as_deref(), Some(bytes.as_bytes()), "{text}");
        }
        assert_eq!(base64("Zm9v*g=="), None);
        assert_eq!(base64("Zm9vY"), None);
    }

    #[test]
    fn only_relative_paths_and_data_are_read_from_uris() {
        assert!(matches!(uri_target("a%20b/..%2Fc.png"), Ok(Target::Path(path)) if path == "a b/../c.png"));
        assert!(matches!(uri_target("data:image/png;base64,AAAA"), Ok(Target::Data("AAAA"))));
        for uri in
            ["https://example.org/a.png", "file:a.png", "C:/a.png", "/etc/a.png", "%2Fetc", "a%2", "a%+1", "data:,x"]
        {
            assert!(uri_target(uri).is_err(), "{uri}");
        }
    }
}
