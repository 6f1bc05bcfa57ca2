//! The rasterisers: the same G-buffers from the processor and from the GPU.

pub mod gpu;
