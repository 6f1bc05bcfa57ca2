//! Storage buffers: declared in libraries, bound by materials. Like an image, a buffer is held as a target of one channel; a
//! pixel holds 16 bytes.

use super::dom::{Element, Value};
use super::libraries::{BufferBinding, Library, ValueOf};
use super::loader::Loader;
use super::report::Found;
use super::shaders::ShaderUse;
use super::{Bound, Channel, RenderTarget};
use crate::glsl::{self, Held, Program};
use crate::image::PixelFormat;
use glam::Vec4;

/// Bytes of a pixel of the target that holds a buffer.
const PIXEL: u64 = 16;
/// Greatest number of pixels in a row of that target.
const ROW: u64 = 4096;
/// Largest buffer, bytes.
const MOST: u64 = 1 << 30;

/// Bytes of a field of a structure, by its type.
const FIELDS: [(&str, u64); 14] = [
    ("FLOAT", 4),
    ("INT", 4),
    ("UINT", 4),
    ("VEC2", 8),
    ("IVEC2", 8),
    ("UIVEC2", 8),
    ("VEC3", 12),
    ("IVEC3", 12),
    ("UIVEC3", 12),
    ("VEC4", 16),
    ("IVEC4", 16),
    ("UIVEC4", 16),
    ("MAT3", 36),
    ("MAT4", 64),
];

impl Loader {
    /// Reads `<buffers>` of a library. A size that cannot be read is reported where the buffer is bound.
    pub fn buffers(&mut self, library: &mut Library, root: &Element) {
        let lists = root.children_named(&["buffers"]).filter(|_| glsl::AVAILABLE);
        for buffer in lists.flat_map(|list| list.children_named(&["buffer"])) {
            let Some(name) = self.required(buffer, "name") else { continue };
            library.buffer_names.declare(&mut self.report, &name.text, name.span);
            let bytes = self.bytes_of(buffer).filter(|bytes| (1..=MOST).contains(bytes));
            library.buffer_indices.push(bytes.map(|bytes| {
                let pixels = bytes.div_ceil(PIXEL);
                let width = pixels.min(ROW);
                let channel = Channel { name: name.text.clone(), format: PixelFormat::Rgba32Float, depth: false };
                self.libraries.targets.push(RenderTarget {
                    library: library.name.clone(),
                    name: name.text.clone(),
                    size: [width as u32, pixels.div_ceil(width) as u32],
                    clear_color: Vec4::ZERO,
                    buffer: Some(bytes),
                    contents: None,
                    channels: vec![channel],
                });
                self.libraries.targets.len() - 1
            }));
        }
    }

    /// Size of a buffer in bytes: `<SIZE value="…"/>`, or the product of the sides of `<DIM x y z/>` and the bytes of all fields of
    /// `<structure>`. `None` if neither can be read.
    fn bytes_of(&mut self, buffer: &Element) -> Option<u64> {
        let number = |loader: &Self, element: &Element, name: &str| {
            let text = &element.attribute(name)?.text;
            // An f32 would round a large whole number.
            let number: f64 = text.parse().ok().or_else(|| loader.constants.get(text).copied().map(f64::from))?;
            (number >= 1.0 && number < MOST as f64 * 2.0).then_some(number as u64)
        };
        if let Some(size) = buffer.children_named(&["size"]).next() {
            return number(self, size, "value");
        }
        let dim = buffer.children_named(&["dim"]).next()?;
        let sides = ["x", "y", "z"].map(|name| number(self, dim, name));
        let mut bytes = 0;
        for field in buffer.children_named(&["structure"]).flat_map(|structure| structure.children_named(&["field"])) {
            let kind = &field.attribute("value")?.text;
            bytes += FIELDS.iter().find(|(known, _)| known.eq_ignore_ascii_case(kind))?.1;
        }
        sides.into_iter().try_fold(bytes, |bytes, side| bytes.checked_mul(side?))
    }

    /// The buffers that `<buffers>` of a material binds.
    pub fn bound_buffers(&mut self, material: &Element) -> Vec<BufferBinding> {
        let mut found = Vec::new();
        let lists = material.children_named(&["buffers"]).filter(|_| glsl::AVAILABLE);
        for buffer in lists.flat_map(|list| list.children_named(&["buffer"])) {
            let point = buffer.child_value("binding_point").and_then(|value| value.text.parse().ok());
            let counters =
                buffer.child_value("type").is_some_and(|value| value.text.eq_ignore_ascii_case("ATOMIC_COUNTER"));
            if let (Some(point), Some(name)) = (point, buffer.attribute("name")) {
                let library = buffer.attribute("fromLibrary").cloned();
                found.push(BufferBinding { point, counters, library, name: name.clone() });
            }
        }
        found
    }

    /// What is bound to each buffer and image, in the order of [`Program::storage`]. Inner `None` for an image to which nothing is bound,
    /// outer `None` after an error.
    pub(super) fn storage(
        &mut self,
        program: &Program,
        file: u32,
        values: &[(ValueOf, glsl::Value)],
        used: &ShaderUse<'_>,
    ) -> Option<Vec<Option<Bound>>> {
        let mut found: Option<Vec<Option<Bound>>> = Some(Vec::new());
        for buffer in &program.storage {
            let bound = self.storage_of(buffer, file, values, used);
            let twice = |found: &Vec<Option<Bound>>| {
                let own = bound.flatten().map(|bound| bound.target);
                own.is_some_and(|own| found.iter().flatten().any(|bound| bound.target == own))
            };
            if found.as_ref().is_some_and(twice) {
                let message = format!("what `{}` stands for is bound a second time in this shader", buffer.name);
                self.report.error_help(Self::span_in(file, buffer.at), message, || "bind it once".to_owned());
                return None;
            }
            found = found.zip(bound).map(|(mut found, bound)| {
                found.push(bound);
                found
            });
        }
        found
    }

    fn storage_of(
        &mut self,
        buffer: &glsl::StorageBuffer,
        file: u32,
        values: &[(ValueOf, glsl::Value)],
        used: &ShaderUse<'_>,
    ) -> Option<Option<Bound>> {
        let at = Self::span_in(file, buffer.at);
        let bound = match buffer.held {
            Held::Image => Some(self.image_of(buffer, at, values, used)?),
            Held::Block | Held::Counters => None,
        };
        if bound.is_some() {
            return bound;
        }
        let counters = buffer.held == Held::Counters;
        let fits = |bound: &&BufferBinding| (bound.point, bound.counters) == (buffer.point, counters);
        let Some(bound) = used.buffers().iter().rev().find(fits).cloned() else {
            let kind = if counters { "ATOMIC_COUNTER" } else { "SHADER_STORAGE" };
            let material = &used.material.name;
            let (binder, list) = match used.replaces {
                true => (format!("material `{material}`"), "its <buffers>"),
                false => (format!("the injection of `{material}`"), "the <buffers> of the <map>"),
            };
            let message = format!("{binder} binds no {kind} to point {} of `{}`", buffer.point, buffer.name);
            let help = "valid: <buffer name=\"…\"><TYPE value=\"…\"/><BINDING_POINT value=\"…\"/></buffer> in";
            self.report.error_help(at, message, || format!("{help} {list}"));
            return None;
        };
        let library = match &bound.library {
            Some(library) => self.find_library(library)?,
            None => used.library,
        };
        let target = self.find_buffer(library, &bound.name.text, &bound.name)?;
        Some(Some(Bound { target, cleared: false }))
    }

    /// The buffer that `value`, written as `Library::name`, names; an index into [`super::Project::targets`]. `None` after an error.
    pub(super) fn find_buffer_of(&mut self, value: &Value) -> Option<usize> {
        let Some((library, name)) = value.text.split_once("::") else {
            let message = format!("`{}` names no library", value.shown());
            self.report.error_help(value.span, message, || format!("valid: Library::{}", value.shown()));
            return None;
        };
        let from = Value { text: library.trim().to_owned(), joined: None, span: value.span };
        let library = self.find_library(&from)?;
        self.find_buffer(library, name.trim(), value)
    }

    /// The buffer `name` of a library, an index into [`super::Project::targets`]. `value` is the value that names the buffer, for messages.
    /// `None` after an error.
    fn find_buffer(&mut self, library: usize, name: &str, value: &Value) -> Option<usize> {
        let library = self.libraries.get(library);
        let index = match library.buffer_names.find(name) {
            Found::Exact(index) | Found::OtherCase(index) => index,
            Found::Missing => {
                let help = super::report::suggest(name, library.buffer_names.iter());
                self.report.error_help(value.span, format!("there is no buffer `{}`", value.shown()), || help);
                return None;
            }
        };
        let target = library.buffer_indices[index];
        if target.is_none() {
            let message = format!("the size of the buffer `{}` cannot be read", value.shown());
            let help = "valid: <SIZE value=\"…\"/> in bytes up to 1073741824, or <DIM x=\"…\" y=\"…\" z=\"…\"/> with a <structure> of fields";
            self.report.error_help(value.span, message, || help.to_owned());
        }
        target
    }
}
