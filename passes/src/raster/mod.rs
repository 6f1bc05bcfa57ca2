//! The rasterisers on the processor and on the GPU. Both draw the same G-buffers and compute the same effects.

mod check;
pub mod cpu;
pub mod effects;
#[cfg(feature = "wgpu")]
pub mod gpu;
mod spheres;
