//! The rasterisers. They draw the same G-buffers.

pub mod cpu;
pub mod gpu;
