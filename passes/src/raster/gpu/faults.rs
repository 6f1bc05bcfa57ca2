//! What the rasteriser says when the device fails, or cannot do something.

use curitiba_pipeline::backend::BackendError;

/// The rasteriser's name.
pub(crate) const NAME: &str = "wgpu";

/// What to do where the device cannot.
const REMEDY: &str = "`--raster cpu` draws without a GPU";

/// An error of the device, as the ray backend of the same name has it.
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

/// The device failed; ends with the remedy.
pub(crate) fn failure(message: &str) -> BackendError {
    BackendError::Device { backend: NAME, message: format!("{message}; {REMEDY}") }
}

/// The device cannot do `what`; `why` is continued with the remedy.
pub(crate) fn unsupported(what: &str, why: &str) -> BackendError {
    BackendError::Unsupported { backend: NAME, what: what.to_owned(), why: format!("{why} {REMEDY}") }
}
