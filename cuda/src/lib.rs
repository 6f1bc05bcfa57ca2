//! The ray programs on NVIDIA GPUs.
//!
//! Two tracers run the same device programs (`programs/`, one file an effect): `cuda` traverses our own wide tree, `optix` uses the OptiX
//! in the driver. Both need only NVIDIA's driver, and look for it when they are made, so a program with this crate starts on every machine.
//!
//! Results are those of the processor backend, whose module [`curitiba_passes::effects`] describes them: random numbers are equal bit for
//! bit, and with `cuda` hits are, too.

pub mod bvh;
pub mod device;
pub mod fault;
pub mod focused;
mod images;
pub mod layout;
pub mod multi_gpu;
mod nodes;
pub mod one_gpu;
pub mod optix;
mod peers;
pub mod programs;
pub mod scene;
pub mod segments;
mod shared_gbuffer;
pub mod sobol_table;
pub mod spheres;
mod staging;
mod stripes;
pub mod ways;

pub use multi_gpu::{CudaRays, DeviceRays, OptixRays};
pub use segments::{CudaSegments, OptixSegments};
