//! Frames that the library draws: their pixels, what plans say about them, and which results one frame takes over from another.
//!
//! Some tests need a Vulkan, Metal or DirectX 12 driver (a software driver will do), some an NVIDIA GPU. Without these they print
//! `skipped: why`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1` and `CURITIBA_REQUIRE_CUDA_TESTS=1`.

mod aa;
mod adaptive;
mod clears;
mod color;
mod cones;
mod cracks;
mod fallback;
mod far;
mod filter;
#[cfg(unix)]
mod joined;
#[path = "../lamps/mod.rs"]
mod lamps;
mod library;
mod lights;
mod lines;
#[path = "../nvidia/mod.rs"]
mod nvidia;
mod oracle;
mod own_backend;
#[path = "../own_shaders/mod.rs"]
mod own_shaders;
mod picture;
mod plain;
mod projects;
#[cfg(feature = "glsl")]
mod quad_images;
mod raster_effects;
mod rasterisers;
mod stacks;
#[cfg(feature = "glsl")]
mod targets;
mod wgpu_rays;
