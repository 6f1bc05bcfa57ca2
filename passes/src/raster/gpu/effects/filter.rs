//! The edge-avoiding filter on the device: [`crate::raster::effects::filter`]. Ambient occlusions and ray passes share it.

use super::inputs::Inputs;
use super::programs::{Bound, Program, Task};
use super::shader::Variant;
use super::together;
use super::uniforms::FilterUniform;
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::timer::Timer;
use curitiba_pipeline::backend::{BackendError, Part};
use curitiba_pipeline::executor::Progress;
use std::time::Duration;

/// The compiled filter.
#[derive(Debug)]
pub(crate) struct ShareFilter {
    /// The program of the last level: writes a colour.
    last: Program,
    /// The program of the levels before: writes one number per pixel, for the next level.
    between: Option<Program>,
}

/// The inputs, outputs and parameters of a filter run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Filtered<'a> {
    /// Columns and rows of the pictures.
    pub size: (u32, u32),
    /// The bind group with positions and normals.
    pub gbuffer: &'a wgpu::BindGroup,
    /// The shares to filter, followed by the output of each level.
    pub pictures: &'a [&'a wgpu::TextureView],
    /// Whether all pictures but the last hold one number per pixel instead of a colour.
    pub shares: bool,
    /// Exponent that the last level applies to its averages.
    pub exponent: f32,
}

impl ShareFilter {
    pub fn new(gpu: &Gpu, inputs: &Inputs) -> Result<Self, BackendError> {
        Ok(Self { last: Program::new(gpu, inputs, Variant::filter(true))?, between: None })
    }

    /// Runs one filter level for each picture but the last, and waits.
    pub fn run(
        &mut self,
        gpu: &Gpu,
        inputs: &Inputs,
        timer: Option<&Timer>,
        filtered: &Filtered<'_>,
        progress: &Progress,
    ) -> Result<Part, BackendError> {
        let levels = filtered.pictures.len().saturating_sub(1);
        if filtered.shares && levels > 1 && self.between.is_none() {
            self.between = Some(Program::new(gpu, inputs, Variant::filter(false))?);
        }
        let mut part = Part::default();
        for (level, pair) in (0..).zip(filtered.pictures.windows(2)) {
            let is_last = level as usize + 1 == levels;
            let program = self.between.as_ref().filter(|_| filtered.shares && !is_last).unwrap_or(&self.last);
            let group = program.bind(gpu, pair[1], &[wgpu::BindingResource::TextureView(pair[0])])?;
            let uniform = FilterUniform { level, exponent: if is_last { filtered.exponent } else { 1.0 } };
            let bound = Bound { groups: &[filtered.gbuffer, &group], before: None };
            let task = task(filtered.size, level);
            part = together(part, program.run(gpu, timer, &bound, bytemuck::bytes_of(&uniform), &task, progress)?);
        }
        Ok(part)
    }
}

/// Number of submissions of one filter level.
pub(super) fn submissions(size: (u32, u32)) -> u64 {
    task(size, 0).submissions()
}

/// The work of one filter level: for each pixel, a weight for each of 25 pixels.
fn task((width, height): (u32, u32), level: u32) -> Task {
    Task { width, height, id_base: 0, texels: 25, apart: 1 << level }
}

/// The filter after ray passes, with a timer and a G-buffer layout of its own.
#[derive(Debug)]
pub(crate) struct RayFilter {
    inputs: Inputs,
    filter: ShareFilter,
    timer: Option<Timer>,
}

impl RayFilter {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let inputs = Inputs::new(gpu)?;
        Ok(Self { filter: ShareFilter::new(gpu, &inputs)?, timer: Timer::new(gpu)?, inputs })
    }

    /// Filters shares over the surfaces of these positions and normals, and waits. The levels write alternately to the second picture
    /// and the first. The last level applies the exponent. Returns the time by the device's clock, if it has one.
    pub fn run(
        &mut self,
        gpu: &Gpu,
        [position, normal]: [&wgpu::TextureView; 2],
        pictures: [&wgpu::Texture; 2],
        (levels, exponent): (u32, f32),
    ) -> Result<Option<Duration>, BackendError> {
        let gbuffer = self.inputs.bind(gpu, [None, Some(position), Some(normal), None]);
        let size = (pictures[0].width(), pictures[0].height());
        let views = pictures.map(|picture| picture.create_view(&wgpu::TextureViewDescriptor::default()));
        let pictures: Vec<&wgpu::TextureView> = (0..=levels as usize).map(|level| &views[level % 2]).collect();
        let filtered = Filtered { size, gbuffer: &gbuffer, pictures: &pictures, shares: false, exponent };
        Ok(self.filter.run(gpu, &self.inputs, self.timer.as_ref(), &filtered, &Progress::default())?.device)
    }
}
