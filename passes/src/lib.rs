//! What the steps of a plan do: rasterisers, the ray tracer, and one module per effect.

pub mod cpu;
pub mod effects;
pub mod explain;
pub mod raster;
pub mod sampling;
pub mod trace;
