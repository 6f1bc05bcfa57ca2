//! What the steps of a plan do: rasterisers, the ray tracer, and one module per effect.

pub mod raster;
pub mod trace;
