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
mod join;
pub mod layout;
mod nodes;
pub mod optix;
mod peers;
mod points;
pub mod programs;
pub mod rays;
pub mod scene;
pub mod split;
mod staging;

pub use split::{CudaRays, DeviceRays, OptixRays};
