//! Benchmarks: the cost of each effect per frame, and its error against a reference.

pub mod case;
pub mod columns;
pub mod file;
pub mod inputs;
pub mod interval;
pub mod measure;
pub mod merge;
pub mod model;
pub mod outliers;
pub mod part;
pub mod table2;
pub mod text;
pub mod threads;

pub use case::Case;
pub use file::FileError;
pub use interval::Interval;
pub use measure::{MeasureOptions, Measured, measure};
pub use outliers::Outliers;
