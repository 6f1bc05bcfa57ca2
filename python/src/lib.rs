//! Python bindings: `import curitiba`. The arguments and results of each function are documented in `curitiba/_native.pyi`.

mod arrays;
mod machine;
mod metrics;
mod renderer;
mod tracer;
mod visibility;
mod work;

use pyo3::prelude::*;

pyo3::create_exception!(
    curitiba,
    CuritibaError,
    pyo3::exceptions::PyRuntimeError,
    "What the renderer says where something cannot be done: what, where, what would be valid, and what to do."
);

/// Curitiba: rasterisation and ray tracing in one deferred pipeline.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::CuritibaError;
    #[pymodule_export]
    use super::machine::{backends, confine, gpus};
    #[pymodule_export]
    use super::metrics::{compare, displayed};
    #[pymodule_export]
    use super::renderer::{Renderer, open};
    #[pymodule_export]
    use super::tracer::Tracer;
    #[pymodule_export]
    use super::visibility::visibility;
}

/// An error of the renderer.
pub(crate) fn failed(error: impl std::fmt::Display) -> PyErr {
    CuritibaError::new_err(error.to_string())
}

/// An argument that is not valid.
pub(crate) fn invalid(message: impl std::fmt::Display) -> PyErr {
    pyo3::exceptions::PyValueError::new_err(message.to_string())
}
