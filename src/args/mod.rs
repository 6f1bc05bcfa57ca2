//! Command-line arguments that `curitiba` and `curitiba-view` share: those that name a project or scene, and its options.

#[cfg(feature = "cli")]
mod project;
#[cfg(feature = "cli")]
mod scene;
mod words;

#[cfg(feature = "cli")]
pub use project::{Backend, FidelityArg, ProjectArgs, Raster, parse_bytes, parse_pixel, parse_size};
#[cfg(feature = "cli")]
pub use scene::SceneFlags;
pub use words::{parse_error_bound, quoted};

/// Default limit of a command's memory, bytes.
pub const MAX_MEMORY: u64 = 8 << 30;
