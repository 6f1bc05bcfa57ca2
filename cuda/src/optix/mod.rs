//! OptiX from NVIDIA's driver: no SDK, only a table of functions that is requested by version.

mod abi;
mod api;
mod entries;
mod tracer;

pub use tracer::{OptixTracer, SegmentPipeline};
