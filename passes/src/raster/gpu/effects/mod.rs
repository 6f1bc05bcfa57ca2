//! Raster effects on the device: maps drawn with the rasteriser's own pipelines, and one compute shader for each program.
//!
//! What a program computes is written once, in [`crate::raster::effects`]: the host's part is called from here, and what
//! the shaders repeat is tested against it.
//!
//! A G-buffer that was drawn last is read where it lies. Everything on the device stays for the next frame.

mod inputs;
mod kept;
mod maps;
mod programs;
mod shader;

use super::device::{Gpu, failure};
use super::draws::DrawList;
use super::geometry::DeviceGeometry;
use super::pipelines::{Layouts, Pipelines};
use super::targets::{Staging, Targets};
use super::textures::DeviceTextures;
use super::timer::Timer;
use curitiba_pipeline::backend::{BackendError, EffectJob, EffectStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::raster_effects::EffectProgram;
use inputs::Inputs;
use kept::Kept;
use maps::Maps;
use programs::{OUTPUT_FORMAT, Program, Task};
use std::collections::HashMap;
use std::time::Instant;

/// What of the rasteriser effects use.
pub(super) struct Context<'a> {
    pub gpu: &'a Gpu,
    pub layouts: &'a Layouts,
    pub pipelines: &'a mut Pipelines,
    pub timer: Option<&'a Timer>,
    pub geometry: &'a DeviceGeometry,
    pub textures: &'a mut DeviceTextures,
}
