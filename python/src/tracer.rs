//! Ray queries without rendering.

use crate::arrays::{PerRay, indices, points, vectors};
use crate::{failed, invalid, work};
use curitiba::passes::trace::{Bvh, Hit, Quality, Ray, Tracer as _};
use curitiba::pipeline::executor::Progress;
use curitiba::pipeline::scene::{Batch, Geometry};
use glam::Vec3;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

/// Number of rays that are traced between two checks for a request to stop.
const BLOCK: usize = 4096;

/// A geometry of positions and corners, with one material.
pub fn geometry(positions: &[Vec3], triangles: Vec<[u32; 3]>) -> Geometry {
    let batches = vec![Batch { material: 0, first: 0, count: triangles.len() as u32 }];
    Geometry { positions: positions.to_vec(), triangles, batches, ..Geometry::default() }
}

/// Triangles that rays can be asked about: `positions` (n, 3) float32 in scene units, `indices` (m, 3) of corners.
///
/// Watertight; both sides of a triangle are hit; results do not depend on the number of threads.
#[pyclass(frozen, module = "curitiba")]
pub struct Tracer {
    bvh: Bvh,
    triangles: usize,
}

/// Rays from arrays.
struct Rays<'a> {
    origins: &'a [Vec3],
    directions: &'a [Vec3],
    t_min: crate::arrays::Values<'a>,
    t_max: crate::arrays::Values<'a>,
}

impl Rays<'_> {
    fn at(&self, index: usize) -> Ray {
        let origin = self.origins[if self.origins.len() == 1 { 0 } else { index }];
        Ray { origin, direction: self.directions[index], t_min: self.t_min.at(index), t_max: self.t_max.at(index) }
    }

    /// The result of `ask` for each ray, in order; `none` for rays that were not traced because of a request to stop.
    fn each<T: Clone + Send>(&self, progress: &Progress, none: T, ask: impl Fn(&Ray) -> T + Sync) -> Vec<T> {
        let mut results = vec![none; self.directions.len()];
        progress.start(results.len() as u64);
        results.par_chunks_mut(BLOCK).enumerate().for_each(|(block, results)| {
            if !progress.is_cancelled() {
                for (index, result) in results.iter_mut().enumerate() {
                    *result = ask(&self.at(block * BLOCK + index));
                }
                progress.advance(results.len() as u64);
            }
        });
        results
    }
}

impl Tracer {
    fn trace<T: Clone + Send>(
        py: Python<'_>,
        [origins, directions, t_min, t_max]: [&Bound<'_, PyAny>; 4],
        none: T,
        ask: impl Fn(&Ray) -> T + Sync + Send,
    ) -> PyResult<Vec<T>> {
        let (origins, directions) = (points("origins", origins)?, points("directions", directions)?);
        let (origins, directions) = (vectors(&origins)?, vectors(&directions)?);
        if origins.len() != directions.len() && origins.len() != 1 {
            let (origins, directions) = (origins.len(), directions.len());
            return Err(invalid(format!(
                "{origins} origins for {directions} directions; valid: as many, or one for all"
            )));
        }
        let (t_min, t_max) =
            (PerRay::new("t_min", t_min, directions.len())?, PerRay::new("t_max", t_max, directions.len())?);
        let rays = Rays { origins, directions, t_min: t_min.values()?, t_max: t_max.values()? };
        work::run(py, "rays", |progress| rays.each(progress, none, ask))
    }
}

#[pymethods]
impl Tracer {
    #[new]
    #[pyo3(signature = (positions, indices))]
    fn new(py: Python<'_>, positions: &Bound<'_, PyAny>, indices: &Bound<'_, PyAny>) -> PyResult<Self> {
        let positions = points("positions", positions)?;
        let positions = vectors(&positions)?;
        let corners = self::indices::<3>("indices", indices, positions.len(), "positions")?;
        if corners.len() >= 1 << 31 {
            return Err(invalid("2^31 triangles or more"));
        }
        let triangles = corners.len();
        let bvh = work::run(py, "build", |progress| {
            Bvh::build_until(&geometry(positions, corners), &[], Quality::default(), progress)
        })?
        .ok_or_else(|| failed("the tree was given up"))?;
        Ok(Self { bvh, triangles })
    }

    /// Number of triangles.
    fn __len__(&self) -> usize {
        self.triangles
    }

    /// Bytes of the tree.
    #[getter]
    fn nbytes(&self) -> usize {
        self.bvh.bytes()
    }

    /// The nearest hit of each ray with t_min < t < t_max.
    ///
    /// `origins` (n, 3), or (1, 3) for all rays, and `directions` (n, 3) of unit length (distances count in their lengths) are float32; other types
    /// are converted, which copies them. `t_min` and `t_max` are numbers or (n,); the defaults are 0 and infinity.
    #[pyo3(signature = (origins, directions, *, t_min = None, t_max = None))]
    fn closest<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (near, far) = limits(py, t_min, t_max)?;
        let hits: Vec<Option<Hit>> =
            Self::trace(py, [origins, directions, &near, &far], None, |ray| self.bvh.closest(ray, |_| true))?;
        let found = PyDict::new(py);
        let distance: Vec<f32> = hits.iter().map(|hit| hit.map_or(f32::INFINITY, |hit| hit.t)).collect();
        let triangle: Vec<i32> = hits.iter().map(|hit| hit.map_or(-1, |hit| hit.triangle as i32)).collect();
        let uv: Vec<f32> = hits.iter().flat_map(|hit| hit.map_or([f32::NAN; 2], |hit| [hit.u, hit.v])).collect();
        let uv: Bound<'py, PyArray2<f32>> = PyArray1::from_vec(py, uv).reshape([hits.len(), 2])?;
        found.set_item("t", distance.into_pyarray(py))?;
        found.set_item("triangle", triangle.into_pyarray(py))?;
        found.set_item("uv", uv)?;
        Ok(found)
    }

    /// (n,): whether anything lies on each ray. The arguments are those of `closest`.
    #[pyo3(signature = (origins, directions, *, t_min = None, t_max = None))]
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let (near, far) = limits(py, t_min, t_max)?;
        let blocked =
            Self::trace(py, [origins, directions, &near, &far], false, |ray| self.bvh.occluded(ray, |_| true))?;
        Ok(blocked.into_pyarray(py))
    }

    fn __repr__(&self) -> String {
        format!("<curitiba.Tracer: {} triangles, {} bytes>", self.triangles, self.bvh.bytes())
    }
}

/// The limits of rays; the defaults are 0 and infinity.
fn limits<'py>(
    py: Python<'py>,
    t_min: Option<&Bound<'py, PyAny>>,
    t_max: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let or = |value: Option<&Bound<'py, PyAny>>, default: f32| match value {
        Some(value) => Ok::<_, PyErr>(value.clone()),
        None => Ok(default.into_pyobject(py)?.into_any()),
    };
    Ok((or(t_min, 0.0)?, or(t_max, f32::INFINITY)?))
}
