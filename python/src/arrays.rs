//! Conversion from and to NumPy arrays.

use crate::invalid;
use curitiba::pipeline::image::Image;
use glam::Vec3;
use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// An array-like as a C-contiguous array of a type. An array that already is one is returned as it is; others are copied.
fn contiguous<'py>(value: &Bound<'py, PyAny>, dtype: &str) -> PyResult<Bound<'py, PyAny>> {
    let options = PyDict::new(value.py());
    options.set_item("dtype", dtype)?;
    value.py().import("numpy")?.call_method("ascontiguousarray", (value,), Some(&options))
}

fn shaped(what: &str, expected: &str, found: &[usize]) -> PyErr {
    invalid(format!("`{what}` has the shape {found:?}; valid: {expected}"))
}

/// An array of floats of shape (n, 3).
pub fn points<'py>(what: &str, value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArray2<'py, f32>> {
    let array = contiguous(value, "float32")?;
    let shape = array.getattr("shape")?.extract::<Vec<usize>>()?;
    match array.extract::<PyReadonlyArray2<'py, f32>>() {
        Ok(points) if points.shape()[1] == 3 => Ok(points),
        _ => Err(shaped(what, "(n, 3)", &shape)),
    }
}

/// The rows of [`points`], without a copy.
pub fn vectors<'a>(points: &'a PyReadonlyArray2<'_, f32>) -> PyResult<&'a [Vec3]> {
    Ok(bytemuck::cast_slice(points.as_slice().map_err(invalid)?))
}

/// An array of indices of shape (n, `COLUMNS`), each below `count`.
pub fn indices<const COLUMNS: usize>(
    what: &str,
    value: &Bound<'_, PyAny>,
    count: usize,
    of: &str,
) -> PyResult<Vec<[u32; COLUMNS]>> {
    // As 64-bit integers, so that no index is truncated.
    let array = contiguous(value, "int64")?;
    let shape = array.getattr("shape")?.extract::<Vec<usize>>()?;
    let array = match array.extract::<PyReadonlyArray2<'_, i64>>() {
        Ok(array) if array.shape()[1] == COLUMNS => array,
        _ => return Err(shaped(what, &format!("(n, {COLUMNS})"), &shape)),
    };
    let rows = array.as_slice().map_err(invalid)?.chunks_exact(COLUMNS).enumerate();
    let row = |(index, row): (usize, &[i64])| {
        let mut out = [0; COLUMNS];
        for (out, value) in out.iter_mut().zip(row) {
            *out = u32::try_from(*value).ok().filter(|value| (*value as usize) < count).ok_or_else(|| {
                invalid(format!(
                    "`{what}[{index}]` names {value}; there are {count} {of}, so 0 to {} is valid",
                    count as i64 - 1
                ))
            })?;
        }
        Ok(out)
    };
    rows.map(row).collect()
}

/// One number for all of `count` rays, or one for each.
pub struct PerRay<'py>(Result<f32, PyReadonlyArray1<'py, f32>>);

impl<'py> PerRay<'py> {
    pub fn new(what: &str, value: &Bound<'py, PyAny>, count: usize) -> PyResult<Self> {
        if let Ok(one) = value.extract::<f32>() {
            return Ok(Self(Ok(one)));
        }
        let array = contiguous(value, "float32")?;
        let shape = array.getattr("shape")?.extract::<Vec<usize>>()?;
        match array.extract::<PyReadonlyArray1<'py, f32>>() {
            Ok(each) if each.len() == count => Ok(Self(Err(each))),
            _ => Err(shaped(what, &format!("a number, or ({count},)"), &shape)),
        }
    }

    /// The values; a single value applies to all rays.
    pub fn values(&self) -> PyResult<Values<'_>> {
        Ok(match &self.0 {
            Ok(one) => Values::One(*one),
            Err(each) => Values::Each(each.as_slice().map_err(invalid)?),
        })
    }
}

/// See [`PerRay::values`].
#[derive(Clone, Copy)]
pub enum Values<'a> {
    One(f32),
    Each(&'a [f32]),
}

impl Values<'_> {
    pub fn at(self, index: usize) -> f32 {
        match self {
            Self::One(value) => value,
            Self::Each(values) => values[index],
        }
    }
}

/// A picture as an array (height, width, 4), which takes over the picture's memory.
pub fn picture(py: Python<'_>, image: Image) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let (width, height) = (image.width as usize, image.height as usize);
    PyArray1::from_vec(py, bytemuck::cast_vec(image.pixels)).reshape([height, width, 4])
}

/// Four bytes for each pixel as an array (height, width, 4), which takes over their memory.
pub fn bytes(py: Python<'_>, [height, width]: [usize; 2], bytes: Vec<u8>) -> PyResult<Bound<'_, PyArray3<u8>>> {
    PyArray1::from_vec(py, bytes).reshape([height, width, 4])
}

/// An array (height, width, 3 or 4) as a picture; alpha is 1 where there is none.
pub fn image(what: &str, value: &Bound<'_, PyAny>) -> PyResult<Image> {
    let array = contiguous(value, "float32")?;
    let shape = array.getattr("shape")?.extract::<Vec<usize>>()?;
    let array = match array.extract::<PyReadonlyArray3<'_, f32>>() {
        Ok(array) if matches!(array.shape()[2], 3 | 4) => array,
        _ => return Err(shaped(what, "(height, width, 3) or (height, width, 4)", &shape)),
    };
    let [height, width, channels] = [array.shape()[0], array.shape()[1], array.shape()[2]];
    let side = |side: usize| u32::try_from(side).map_err(|_| invalid(format!("`{what}` is too large")));
    let pixel = |values: &[f32]| [values[0], values[1], values[2], values.get(3).copied().unwrap_or(1.0)];
    let pixels = array.as_slice().map_err(invalid)?.chunks_exact(channels).map(pixel).collect();
    Ok(Image { width: side(width)?, height: side(height)?, pixels })
}
