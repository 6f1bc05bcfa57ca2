//! Curitiba's pipeline. It reads projects and scenes, makes a [`plan`] of the work that they require, and the [`executor`] carries
//! out the plan and times every step.
//!
//! This crate uses no GPU interface and contains no `unsafe` code. The work of a step is done by the two traits in [`backend`],
//! which `curitiba-passes` implements.
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
pub mod kept_scenes;
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
#[cfg(feature = "glsl")]
mod script;
pub mod shared;
pub mod square;
