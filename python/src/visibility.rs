//! Visibility between triangles.

use crate::arrays::{indices, points, vectors};
use crate::tracer::geometry;
use crate::{invalid, work};
use curitiba::passes::trace::{Bvh, Quality};
use curitiba::passes::visibility::{Effort, Estimator, Facing, Options, Row, Surfaces};
use curitiba::pipeline::executor::Progress;
use numpy::{IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Number of pairs that are estimated between two checks for a request to stop.
const BLOCK: usize = 8192;

/// Visibility between pairs of triangles: `positions` (n, 3), `triangles` (m, 3), `pairs` (k, 2) of triangles.
///
/// "visibility" (k,) is the share of open segments between the two (NaN where no segment leaves the front of both), "error" (k,) its standard
/// error, 0 where it is exact. "class" says how it was found, "samples" (k,) counts segments. `form_factors` adds "form_factors" and
/// "form_factor_errors", both (k, 2): from the first to the second and back. `samples` (a multiple of 8) or `error` set the effort; the
/// default is 64 samples.
#[pyfunction]
#[pyo3(signature = (positions, triangles, pairs, *, samples = None, error = None, facing = "skip", form_factors = false, seed = 0))]
#[expect(clippy::too_many_arguments, reason = "they have names in Python")]
pub fn visibility<'py>(
    py: Python<'py>,
    positions: &Bound<'py, PyAny>,
    triangles: &Bound<'py, PyAny>,
    pairs: &Bound<'py, PyAny>,
    samples: Option<u32>,
    error: Option<f64>,
    facing: &str,
    form_factors: bool,
    seed: u32,
) -> PyResult<Bound<'py, PyDict>> {
    let effort = match (samples, error) {
        (Some(_), Some(_)) => return Err(invalid("`samples` and `error` are both given; valid: one of them")),
        (None, Some(error)) => Effort::Error(error),
        (samples, None) => Effort::Samples(samples.unwrap_or(64)),
    };
    let facing = match facing {
        "skip" => Facing::Skip,
        "zero" => Facing::Zero,
        _ => return Err(invalid(format!("`facing` is `{facing}`; valid: skip, zero"))),
    };
    let options = Options { effort, facing, form_factors, seed, ..Options::default() };
    options.check().map_err(invalid)?;
    let positions = points("positions", positions)?;
    let positions = vectors(&positions)?;
    let corners = indices::<3>("triangles", triangles, positions.len(), "positions")?;
    let pairs = indices::<2>("pairs", pairs, corners.len(), "triangles")?;
    let rows = work::run(py, "visibility", |progress| estimate(positions, corners, &pairs, options, progress))?
        .map_err(invalid)?;
    let found = PyDict::new(py);
    let floats = |value: &dyn Fn(&Row) -> f64| rows.iter().map(value).collect::<Vec<_>>().into_pyarray(py);
    found.set_item("visibility", floats(&|row| row.visibility.unwrap_or(f64::NAN)))?;
    found.set_item("error", floats(&|row| row.error))?;
    found.set_item("class", rows.iter().map(|row| row.class.name()).collect::<Vec<_>>())?;
    found.set_item("samples", rows.iter().map(|row| row.samples).collect::<Vec<_>>().into_pyarray(py))?;
    if form_factors {
        let both = |value: &dyn Fn(&Row) -> [f64; 2]| {
            PyArray1::from_vec(py, rows.iter().flat_map(value).collect()).reshape([rows.len(), 2])
        };
        found.set_item("form_factors", both(&|row| row.form_factors.unwrap_or([f64::NAN; 2]))?)?;
        found.set_item("form_factor_errors", both(&|row| row.form_factor_errors)?)?;
    }
    Ok(found)
}

fn estimate(
    positions: &[glam::Vec3],
    corners: Vec<[u32; 3]>,
    pairs: &[[u32; 2]],
    options: Options,
    progress: &Progress,
) -> Result<Vec<Row>, String> {
    let surfaces = Surfaces::new(&geometry(positions, corners), &[]);
    // Without a complete tree there is nothing to estimate: the exception of Ctrl-C is raised instead of returning the rows.
    let Some(bvh) = Bvh::build_until(surfaces.geometry(), &surfaces.marks(), Quality::default(), progress) else {
        return Ok(Vec::new());
    };
    let estimator = Estimator::new(&surfaces, &bvh, options)?;
    let mut rows = Vec::with_capacity(pairs.len());
    let mut part = Vec::new();
    progress.start(pairs.len() as u64);
    for pairs in pairs.chunks(BLOCK) {
        if progress.is_cancelled() {
            break;
        }
        estimator.rows(pairs, &mut part);
        rows.append(&mut part);
        progress.advance(pairs.len() as u64);
    }
    Ok(rows)
}
