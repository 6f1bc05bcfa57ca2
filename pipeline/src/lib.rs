//! Curitiba's pipeline: what a project declares, what its scene contains, what must therefore be done (the
//! [`plan`]), and the [`executor`] that does it and times every step.
//!
//! This crate knows no GPU interface and holds no `unsafe` code. What a step does is behind the two traits of
//! [`backend`]; `curitiba-passes` implements them.
#![forbid(unsafe_code)]

#[macro_use]
mod named;

pub mod backend;
pub mod camera_programs;
pub mod color;
pub mod device_quad;
pub mod diagnostic;
pub mod executor;
pub mod files;
pub mod gbuffer;
pub mod glass;
pub mod glsl;
mod guard;
pub mod image;
pub mod memory;
pub mod metrics;
pub mod paths;
pub mod pixel_samples;
pub mod plan;
pub mod programs;
pub mod progress;
pub mod project;
pub mod raster_effects;
pub mod scene;
pub mod shared;
pub mod square;
