//! Benchmarks: what each effect costs per frame, and what error it has against which reference.

pub mod case;
pub mod measure;
pub mod model;

pub use case::Case;
pub use measure::{MeasureOptions, Measured, measure};
