//! Projects' own shaders, images and storage, and textures of their material libraries.
//!
//! Pictures need a Vulkan, Metal or DirectX 12 driver (a software driver will do), some an NVIDIA GPU. Without, tests print `skipped: why`,
//! or fail with `CURITIBA_REQUIRE_GPU_TESTS=1` and `CURITIBA_REQUIRE_CUDA_TESTS=1`.

#[cfg(feature = "glsl")]
mod compute;
#[cfg(feature = "glsl")]
mod glsl;
#[cfg(feature = "glsl")]
mod intersections;
mod mapped_textures;
#[path = "../nvidia/mod.rs"]
mod nvidia;
#[path = "../own_shaders/mod.rs"]
mod own_shaders;
#[cfg(feature = "glsl")]
mod own_storage;
#[cfg(feature = "glsl")]
mod own_textures;
#[cfg(feature = "glsl")]
mod patterns;
#[cfg(feature = "glsl")]
mod scripts;
