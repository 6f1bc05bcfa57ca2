//! Curitiba: rasterisation and ray tracing in one deferred pipeline.
pub use curitiba_passes as passes;
pub use curitiba_pipeline as pipeline;
