//! The arguments by which command lines name a project or scene and what is asked of it: those of `curitiba` and of `curitiba-view`.

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

/// Most memory that a command may take, unless it is told otherwise.
pub const MAX_MEMORY: u64 = 8 << 30;
