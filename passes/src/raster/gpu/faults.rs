//! What the rasteriser says when the device fails, or cannot do something.

use curitiba_pipeline::backend::BackendError;

/// The rasteriser's name.
pub(super) const NAME: &str = "wgpu";

/// The device failed; ends with the remedy.
pub(super) fn failure(message: &str) -> BackendError {
    BackendError::Device { backend: NAME, message: format!("{message}; `--raster cpu` draws without a GPU") }
}

/// The device cannot do `what`; `why` is continued with the remedy.
pub(super) fn unsupported(what: &str, why: &str) -> BackendError {
    BackendError::Unsupported {
        backend: NAME,
        what: what.to_owned(),
        why: format!("{why} `--raster cpu` draws without a GPU"),
    }
}
