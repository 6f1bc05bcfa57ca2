//! Showing and comparing pictures.

use crate::{arrays, failed, invalid, work};
use curitiba::pipeline::color::{ColorSpace, Display, Tone};
use curitiba::pipeline::metrics::{METRICS, Options, compare as compare_images};
use numpy::PyArray3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The content of a PNG of a picture (height, width, 3 or 4): (height, width, 4), 8 bits. `color` is the colour space of the picture's numbers.
///
/// Linear radiance is multiplied by 2 to the power of `exposure`; then follow the tone curve and the transfer function of sRGB.
#[pyfunction]
#[pyo3(signature = (picture, *, color = "report", exposure = 0.0, tone = "none"))]
pub fn displayed<'py>(
    py: Python<'py>,
    picture: &Bound<'py, PyAny>,
    color: &str,
    exposure: f32,
    tone: &str,
) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let image = arrays::image("picture", picture)?;
    let space = color.parse().map_err(invalid)?;
    let exposure = Display::parse_exposure(&exposure.to_string()).map_err(invalid)?;
    let tone: Tone = tone.parse().map_err(invalid)?;
    if space == ColorSpace::Report && (exposure != 0.0 || tone != Tone::None) {
        return Err(invalid("`exposure` and `tone` are for linear light; valid: color=\"linear\", or neither of them"));
    }
    let display = Display { space, exposure, tone };
    let steps = |value: f32| (value * 255.0).round() as u8;
    let bytes = image.pixels.iter().flat_map(|pixel| display.stored(*pixel).map(steps)).collect();
    arrays::bytes(py, [image.height as usize, image.width as usize], bytes)
}

/// Compares a picture with a reference, both (height, width, 3 or 4): the metrics of `curitiba compare` by name. `color` is the colour space of
/// their numbers; ssim and flip compare displayed values.
///
/// The keys are rmse, relmse, max, psnr (decibels), ssim, flip, energy, outliers; and pixels, the number compared.
#[pyfunction]
#[pyo3(signature = (test, reference, *, color = "report", outlier_threshold = 2.5 / 255.0, pixels_per_degree = 67.0))]
pub fn compare<'py>(
    py: Python<'py>,
    test: &Bound<'py, PyAny>,
    reference: &Bound<'py, PyAny>,
    color: &str,
    outlier_threshold: f64,
    pixels_per_degree: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let (test, reference) = (arrays::image("test", test)?, arrays::image("reference", reference)?);
    let display = Display::of(color.parse().map_err(invalid)?);
    let found = work::run(py, "compare", |_| {
        let options = Options { outlier_threshold, pixels_per_degree, display, ..Options::default() };
        compare_images(&test, &reference, &options)
    })?;
    let found = found.map_err(failed)?;
    let metrics = PyDict::new(py);
    metrics.set_item("pixels", found.pixels)?;
    for metric in METRICS {
        metrics.set_item(metric.name, (metric.value)(&found))?;
    }
    Ok(metrics)
}
