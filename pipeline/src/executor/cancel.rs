//! Giving up a frame while it is rendered.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A request to stop, shared between who renders and who may ask: clones are one request.
///
/// It is asked for between passes, between parts of a picture, and on the processor between the tiles of a ray pass. A frame that is
/// given up ends in [`RenderError::Cancelled`](super::RenderError::Cancelled). The request stands until [`Self::reset`], so that one
/// that arrives between two frames is not lost.
#[derive(Debug, Clone, Default)]
pub struct Cancellation(Arc<AtomicBool>);

impl Cancellation {
    /// Nothing is asked for.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks to stop. May be called from any thread, and from a signal handler.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Takes the request back: frames that begin from now on are rendered.
    pub fn reset(&self) {
        self.0.store(false, Ordering::Relaxed);
    }

    /// Whether it was asked to stop.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
