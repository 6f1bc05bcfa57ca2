//! Typed values from buffers. Every range is checked before it is read.

use super::super::context::Context;
use super::super::error::SceneError;
use ::gltf::json::{
    self, Index,
    accessor::{Accessor, ComponentType, Type},
    buffer,
    validation::{Checked, USize64},
};
use std::borrow::Cow;

/// The buffers of an asset and the JSON that describes them.
pub(super) struct Data<'a> {
    pub(super) root: &'a json::Root,
    pub(super) buffers: &'a [Cow<'a, [u8]>],
    /// By buffer view: the decompressed bytes of a compressed view. Empty if no view is compressed.
    pub(super) decoded: &'a [Option<Vec<u8>>],
}

/// Elements at a constant stride.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Data<'a> {
    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: Index<buffer::View>) -> Result<&'a [u8], String> {
        if let Some(Some(decoded)) = self.decoded.get(index.value()) {
            return Ok(decoded);
        }
        let name = format!("buffer view {}", index.value());
        let view = self.root.buffer_views.get(index.value()).ok_or_else(|| format!("{name} does not exist"))?;
        let buffer = self
            .buffers
            .get(view.buffer.value())
            .ok_or_else(|| format!("{name}: buffer {} does not exist", view.buffer.value()))?;
        let start = to_usize(view.byte_offset.unwrap_or_default());
        let end = start.checked_add(to_usize(view.byte_length));
        end.and_then(|end| buffer.get(start..end))
            .ok_or_else(|| format!("{name} reaches beyond the {} bytes of its buffer", buffer.len()))
    }

    fn elements(
        &self,
        view: Index<buffer::View>,
        offset: USize64,
        count: usize,
        size: usize,
    ) -> Result<Elements<'a>, String> {
        let bytes = self.view(view)?;
        let stride = self.root.buffer_views[view.value()].byte_stride.map_or(size, |stride| stride.0);
        if stride < size {
            return Err(format!("buffer view {}: a stride of {stride} for elements of {size} bytes", view.value()));
        }
        let start = to_usize(offset);
        let length = match count {
            0 => Some(0),
            _ => (count - 1).checked_mul(stride).and_then(|last| last.checked_add(size)),
        };
        let end = length.and_then(|length| start.checked_add(length));
        let bytes = end.and_then(|end| bytes.get(start..end)).ok_or_else(|| {
            format!(
                "buffer view {}: {count} elements of {size} bytes reach beyond its {} bytes",
                view.value(),
                bytes.len()
            )
        })?;
        Ok(Elements { bytes, stride })
    }

    fn accessor(&self, index: Index<Accessor>) -> Result<&'a Accessor, String> {
        self.root.accessors.get(index.value()).ok_or_else(|| "it does not exist".to_owned())
    }

    /// Reads vectors of `N` components. Integers are converted to their value, or to fractions if they are normalised.
    pub(super) fn vectors<const N: usize>(
        &self,
        index: Index<Accessor>,
        context: &mut Context<'_>,
    ) -> Result<Vec<[f32; N]>, SceneError> {
        let file = context.file;
        let fail = |what: String| SceneError::file(file, format!("accessor {}: {what}", index.value()));
        let accessor = self.accessor(index).map_err(fail)?;
        let component = component_type(accessor).map_err(fail)?;
        let components = match accessor.type_ {
            Checked::Valid(Type::Vec2) => 2,
            Checked::Valid(Type::Vec3) => 3,
            Checked::Valid(Type::Vec4) => 4,
            Checked::Valid(Type::Mat4) => 16,
            _ => 0,
        };
        if components != N {
            let kind = if N == 16 { "MAT4".to_owned() } else { format!("VEC{N}") };
            return Err(fail(format!("it is not of type {kind}")));
        }
        let number = reader_of(component, accessor.normalized);
        let width = width(component);
        let read = |element: &[u8]| std::array::from_fn(|i| number(&element[i * width..]));
        self.values(accessor, N * width, [0.0; N], &read, context, &fail)
    }

    /// Number of components of an accessor's vectors; 0 if it holds no vectors or does not exist.
    pub(super) fn components(&self, index: Index<Accessor>) -> usize {
        match self.root.accessors.get(index.value()).map(|accessor| accessor.type_) {
            Some(Checked::Valid(Type::Vec2)) => 2,
            Some(Checked::Valid(Type::Vec3)) => 3,
            Some(Checked::Valid(Type::Vec4)) => 4,
            _ => 0,
        }
    }

    /// Reads vertex indices.
    pub(super) fn indices(&self, index: Index<Accessor>, context: &mut Context<'_>) -> Result<Vec<u32>, SceneError> {
        let file = context.file;
        let fail = |what: String| SceneError::file(file, format!("accessor {}: {what}", index.value()));
        let accessor = self.accessor(index).map_err(fail)?;
        let component = component_type(accessor).map_err(fail)?;
        let read: fn(&[u8]) -> u32 = match (component, accessor.type_) {
            (ComponentType::U8, Checked::Valid(Type::Scalar)) => |bytes| u32::from(bytes[0]),
            (ComponentType::U16, Checked::Valid(Type::Scalar)) => |bytes| u32::from(u16::from_le_bytes(first(bytes))),
            (ComponentType::U32, Checked::Valid(Type::Scalar)) => |bytes| u32::from_le_bytes(first(bytes)),
            _ => return Err(fail("indices are unsigned integers of type SCALAR".to_owned())),
        };
        self.values(accessor, width(component), 0, &read, context, &fail)
    }

    /// Reads the values of the accessor's view (zeros without a view), then overwrites the sparse ones.
    fn values<T: Clone>(
        &self,
        accessor: &Accessor,
        size: usize,
        zero: T,
        read: &dyn Fn(&[u8]) -> T,
        context: &mut Context<'_>,
        fail: &dyn Fn(String) -> SceneError,
    ) -> Result<Vec<T>, SceneError> {
        let count = to_usize(accessor.count);
        let elements = accessor
            .buffer_view
            .map(|view| self.elements(view, accessor.byte_offset.unwrap_or_default(), count, size))
            .transpose()
            .map_err(fail)?;
        context.take("an accessor's values", count, size_of::<T>())?;
        let mut values = match elements {
            Some(Elements { bytes, stride }) => bytes.chunks(stride).map(read).collect(),
            None => vec![zero; count],
        };
        if let Some(sparse) = &accessor.sparse {
            let changes = to_usize(sparse.count);
            let Checked::Valid(json::accessor::IndexComponentType(component)) = sparse.indices.component_type else {
                return Err(fail("its sparse indices are not unsigned integers".to_owned()));
            };
            let indices = self
                .elements(sparse.indices.buffer_view, sparse.indices.byte_offset, changes, width(component))
                .map_err(fail)?;
            let changed =
                self.elements(sparse.values.buffer_view, sparse.values.byte_offset, changes, size).map_err(fail)?;
            let index_of = |bytes: &[u8]| match component {
                ComponentType::U8 => usize::from(bytes[0]),
                ComponentType::U16 => usize::from(u16::from_le_bytes(first(bytes))),
                _ => u32::from_le_bytes(first(bytes)) as usize,
            };
            for (index, value) in indices.bytes.chunks(indices.stride).zip(changed.bytes.chunks(changed.stride)) {
                let index = index_of(index);
                *values
                    .get_mut(index)
                    .ok_or_else(|| fail(format!("its sparse index {index} is not below {count}")))? = read(value);
            }
        }
        Ok(values)
    }
}

fn to_usize(value: USize64) -> usize {
    usize::try_from(value.0).unwrap_or(usize::MAX)
}

fn component_type(accessor: &Accessor) -> Result<ComponentType, String> {
    match accessor.component_type {
        Checked::Valid(json::accessor::GenericComponentType(component)) => Ok(component),
        Checked::Invalid => Err("its component type is not one of glTF's".to_owned()),
    }
}

fn width(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
    std::array::from_fn(|i| bytes[i])
}

/// The conversion of a component to a number (glTF 2.0, section 3.6.2.2).
fn reader_of(component: ComponentType, normalized: bool) -> fn(&[u8]) -> f32 {
    match (component, normalized) {
        (ComponentType::F32, _) => |bytes| f32::from_le_bytes(first(bytes)),
        (ComponentType::U32, _) => |bytes| u32::from_le_bytes(first(bytes)) as f32,
        (ComponentType::U8, false) => |bytes| f32::from(bytes[0]),
        (ComponentType::U8, true) => |bytes| f32::from(bytes[0]) / 255.0,
        (ComponentType::I8, false) => |bytes| f32::from(bytes[0] as i8),
        (ComponentType::I8, true) => |bytes| (f32::from(bytes[0] as i8) / 127.0).max(-1.0),
        (ComponentType::U16, false) => |bytes| f32::from(u16::from_le_bytes(first(bytes))),
        (ComponentType::U16, true) => |bytes| f32::from(u16::from_le_bytes(first(bytes))) / 65535.0,
        (ComponentType::I16, false) => |bytes| f32::from(i16::from_le_bytes(first(bytes))),
        (ComponentType::I16, true) => |bytes| (f32::from(i16::from_le_bytes(first(bytes))) / 32767.0).max(-1.0),
    }
}
