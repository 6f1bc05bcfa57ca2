//! The text of XML files, which declare their encoding themselves.

use super::context::Context;
use super::error::{Place, SceneError};
use crate::guard;
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};

/// Number of bytes after `<?xml` that are searched for the end of an XML declaration.
const DECLARATION: usize = 1024;

/// Calls `read` with a file's text. Errors of `read` have byte positions in the text that it gets, which is UTF-8. In the returned errors
/// they are converted to lines and columns.
///
/// The encoding is that of the byte order mark, or else of the XML declaration, or else UTF-8 (XML 1.0, appendix F). The names of encodings
/// are those of the WHATWG's standard: `ISO-8859-1` is read as the Windows-1252 that contains it.
///
/// # Errors
/// If the encoding is not known, the bytes are not valid in it, or the text needs more memory than is left.
pub(super) fn with_text<T>(
    bytes: &[u8],
    context: &mut Context<'_>,
    read: impl FnOnce(&str, &mut Context<'_>) -> Result<T, SceneError>,
) -> Result<T, SceneError> {
    let encoding = match Encoding::for_bom(bytes) {
        Some((encoding, _)) => encoding,
        None => match declared(bytes) {
            Some(label) => Encoding::for_label(label).ok_or_else(|| {
                let label = String::from_utf8_lossy(label);
                let error =
                    SceneError::file(context.file, format!("`{}` is no encoding that is known", label.escape_debug()));
                error.help("valid: UTF-8, ISO-8859-1, windows-1252 and the other names of the WHATWG's encodings")
            })?,
            None => UTF_8,
        },
    };
    // A declaration that can be read as single bytes is not in UTF-16, whatever it says.
    let is_wide = encoding == UTF_16LE || encoding == UTF_16BE;
    if encoding == UTF_8 || is_wide && Encoding::for_bom(bytes).is_none() {
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let wrong = SceneError::new(context.file, Place::Byte(error.valid_up_to() as u64), "this is not UTF-8");
            wrong.help("valid: UTF-8, or another encoding that the XML declaration names").in_text(bytes)
        })?;
        return read(text, context).map_err(|error| error.in_text(bytes));
    }
    let needed = 3 * bytes.len() as u64;
    context.budget.take(context.file, "the text", needed)?;
    let decoded = guard::call("encoding_rs", || encoding.decode(bytes));
    let (text, _, is_wrong) = decoded.map_err(|why| SceneError::file(context.file, why))?;
    if is_wrong {
        let what = format!("this is not {}, as the file says", encoding.name());
        return Err(SceneError::file(context.file, what).help("convert the file to UTF-8"));
    }
    let result = read(&text, context).map_err(|error| error.in_text(text.as_bytes()));
    context.budget.give_back(needed);
    result
}

/// The encoding that the XML declaration at the beginning of a file names.
fn declared(bytes: &[u8]) -> Option<&[u8]> {
    let declaration = bytes.strip_prefix(b"<?xml")?;
    let declaration = &declaration[..declaration.len().min(DECLARATION)];
    let declaration = &declaration[..declaration.windows(2).position(|pair| pair == b"?>")?];
    let name = b"encoding";
    let at = declaration.windows(name.len()).position(|window| window == name)?;
    let value = declaration[at + name.len()..].trim_ascii_start().strip_prefix(b"=")?.trim_ascii_start();
    let (quote, value) = value.split_first().filter(|(quote, _)| matches!(**quote, b'"' | b'\''))?;
    Some(&value[..value.iter().position(|byte| byte == quote)?])
}
