//! Rasterisers: triangles into G-buffers. Both compute the same thing, stated here once.
//!
//! * Clip coordinates are `clip_from_world * (p, 1)` in 32-bit floats; depth is reversed (1 near, 0 far); `0 <= z <= w` is
//!   kept, nothing is culled by its facing.
//! * Corners are snapped to 1/256 pixel; coverage is exact on the snapped corners, sampled at pixel centres, with the
//!   top-left rule, so that triangles that share an edge cover each pixel once.
//! * The depth test is "greater"; of equal depths the lower triangle id stays.
//! * Attributes are interpolated perspective-correctly.

pub mod cpu;
pub mod gpu;
