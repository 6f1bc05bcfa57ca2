//! Comparing pictures.

use crate::{arrays, failed, work};
use curitiba::pipeline::executor::Cancellation;
use curitiba::pipeline::metrics::{METRICS, Options, compare as compare_images};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The metrics of `curitiba compare`, by name.
#[pyfunction]
#[pyo3(signature = (test, reference, *, outlier_threshold = 2.5 / 255.0, pixels_per_degree = 67.0))]
pub fn compare<'py>(
    py: Python<'py>,
    test: &Bound<'py, PyAny>,
    reference: &Bound<'py, PyAny>,
    outlier_threshold: f64,
    pixels_per_degree: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let (test, reference) = (arrays::image("test", test)?, arrays::image("reference", reference)?);
    let found = work::run(py, &Cancellation::new(), || {
        let options = Options { outlier_threshold, pixels_per_degree, ..Options::default() };
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
