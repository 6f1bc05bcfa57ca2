//! The ray programs on NVIDIA GPUs.
//!
//! Two tracers run the same device programs (`programs/`, one text an effect): `cuda` traverses our own wide tree, `optix`
//! asks the OptiX that the driver carries. Both need NVIDIA's driver and nothing else, and look for it when they are made:
//! a program that holds this crate starts everywhere.
//!
//! Results are those of the processor backend, whose module [`curitiba_passes::effects`] describes them: random numbers are
//! equal bit for bit, and with our own tracer so is what rays hit.

pub mod bvh;
pub mod device;
pub mod fault;
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
mod sobol_table;
mod staging;

pub use multi_gpu::{CudaRays, DeviceRays, OptixRays};
pub use segments::{CudaSegments, OptixSegments};
