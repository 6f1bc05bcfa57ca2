//! OptiX, as NVIDIA's driver carries it: no SDK, a table of functions that is asked for by version.

mod abi;
mod api;
mod entries;
mod tracer;

pub use tracer::{OptixTracer, SegmentPipeline};
