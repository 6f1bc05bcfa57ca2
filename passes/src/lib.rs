//! The steps of a plan: rasterisers, the ray tracer, one module for each effect, and visibility between triangles.
//!
//! From the ground up: `trace`, `sampling`, `effects`, `adaptive`, `raster`, `cpu`, `own`, `wgpu_rays`, `explain`, `visibility`; imports run down.
//! `reference` renders reference pictures, and uses `trace` alone. `docs/architecture.md` is the map.

pub mod adaptive;
pub mod cpu;
pub mod effects;
pub mod explain;
pub mod own;
pub mod raster;
pub mod reference;
pub mod sampling;
pub mod trace;
pub mod visibility;
#[cfg(feature = "wgpu")]
pub mod wgpu_rays;

/// The optimisation level that this crate was compiled with: `0` to `3`, `s` or `z`. Reported beside measured times.
pub const OPT_LEVEL: &str = env!("CURITIBA_PASSES_OPT_LEVEL");
