//! The rasteriser's errors: the device failed, or cannot do something.

use curitiba_pipeline::backend::BackendError;

/// The rasteriser's name.
pub(crate) const NAME: &str = "wgpu";

/// What the user can do if the device fails or lacks something.
const REMEDY: &str = "`--raster cpu` draws without a GPU";

/// The same error with another remedy: the one for the ray backend, which has the rasteriser's name.
pub(crate) fn of_rays(error: BackendError) -> BackendError {
    const OF_RAYS: &str = "`--backend cpu` traces without a GPU";
    match error {
        BackendError::Device { backend, message } => {
            BackendError::Device { backend, message: message.replace(REMEDY, OF_RAYS) }
        }
        BackendError::Unsupported { backend, what, why } => {
            BackendError::Unsupported { backend, what, why: why.replace(REMEDY, OF_RAYS) }
        }
    }
}

/// The error for a device failure; the message ends with the remedy.
pub(crate) fn failure(message: &str) -> BackendError {
    BackendError::Device { backend: NAME, message: format!("{message}; {REMEDY}") }
}

/// The error for an operation, `what`, that the device cannot do. The remedy is appended to the reason `why`.
pub(crate) fn unsupported(what: &str, why: &str) -> BackendError {
    BackendError::Unsupported { backend: NAME, what: what.to_owned(), why: format!("{why} {REMEDY}") }
}
