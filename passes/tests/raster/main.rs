//! Both rasterisers and the effects that rasterise: each against an independent answer, and against each other.
//!
//! What the wgpu rasteriser draws needs a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one, tests print
//! `skipped: why`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

#[cfg(feature = "wgpu")]
mod agree;
mod common;
mod cpu;
mod effects;
#[cfg(feature = "wgpu")]
mod effects_gpu;
#[cfg(feature = "wgpu")]
mod gpu;
mod magnified;
mod scenes;
mod spheres;
#[cfg(feature = "wgpu")]
mod spheres_gpu;
#[cfg(feature = "wgpu")]
mod support;
