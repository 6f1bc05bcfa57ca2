//! Raster effects on the device: maps drawn with the rasteriser's own pipelines, and one compute shader for each program.
//!
//! The host code in [`crate::raster::effects`] defines what a program computes: cameras, probes and biases come from
//! there. Where shaders must repeat host code, tests compare the results. Differences come from rounding;
//! `tests/raster/effects_gpu.rs` limits how many pixels they change.
//!
//! The G-buffer of the last draw is read in place. Textures, pipelines, bind groups and buffers are kept for the next
//! frame.

mod ask;
mod bindings;
mod depths;
pub(crate) mod filter;
mod inputs;
mod maps;
mod prepare;
mod programs;
mod question;
mod screen;
mod shader;
mod survey;
mod table;
mod uniforms;

use super::cache::Kept;
use super::device::Gpu;
use super::draws::DrawList;
use super::faults::{failure, unsupported};
use super::geometry::DeviceGeometry;
use super::pipelines::{Layouts, Pipelines};
use super::resources::texture;
use super::targets::{Staging, Targets};
use super::textures::DeviceTextures;
use super::timer::Timer;
use crate::raster::cpu::CpuRasteriser;
use crate::raster::effects::cascades;
use crate::raster::effects::mirrors::Mirrors;
use crate::raster::effects::panes::Probes;
use crate::raster::effects::soft::{FILTER_TAPS, SEARCH_TAPS};
use crate::raster::effects::{SceneCache, check};
use ask::Ask;
use curitiba_pipeline::backend::{Answers, BackendError, EffectJob, EffectStats, Part};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::raster_effects::EffectProgram;
use curitiba_pipeline::scene::TriangleRanges;
use depths::Depths;
use filter::{Filtered, ShareFilter};
use inputs::{Inputs, Ready};
use maps::{Maps, MapsKey, Shot};
use programs::{Bound, OUTPUT_FORMAT, Program, SHARE_FORMAT, Task};
use rayon::prelude::*;
use screen::Marching;
use shader::Variant;
use std::collections::HashMap;
use std::time::{Duration, Instant};
use survey::Surveyor;
use table::Table;
use uniforms::AskUniform;

/// The parts of the rasteriser that effects use.
pub(super) struct Context<'a> {
    pub gpu: &'a Gpu,
    pub layouts: &'a Layouts,
    pub pipelines: &'a mut Pipelines,
    pub timer: Option<&'a Timer>,
    pub geometry: &'a DeviceGeometry,
    pub textures: &'a mut DeviceTextures,
    pub staging: &'a mut Staging,
    pub cache: &'a mut SceneCache,
}

/// Resources that effects keep on the device.
#[derive(Debug)]
pub(super) struct Effects {
    inputs: Inputs,
    draws: DrawList,
    programs: HashMap<Variant, Program>,
    /// The questions whether any pixel faces the light, and whether any shows glass.
    asks: [Option<Ask>; 2],
    maps: Kept<MapsKey, Maps>,
    outputs: Kept<(u32, u32), Output>,
    /// Pictures that filter levels read. The second has the result of the first, third, … level; the first has the occlusion, and then the
    /// result of the second, fourth, … level.
    shares: [Kept<(u32, u32), Output>; 2],
    /// Bind group 1 of programs, by output and maps. Groups keep their resources in memory, so they are removed before resources are
    /// dropped.
    groups: HashMap<GroupKey, wgpu::BindGroup>,
    glass: Table,
    boxes: Table,
    /// The runs of glass triangles by plane; `mirrors` has the mirrors of the current frame.
    runs: Table,
    mirrors: Table,
    surveyor: Option<Surveyor>,
    marching: Option<Marching>,
    depths: Option<Depths>,
    filter: Option<ShareFilter>,
    plane_of: Vec<u32>,
    probes: Probes,
    /// The rasteriser that draws the surroundings from which proxies are computed; set when the first proxy is
    /// computed.
    surroundings: Option<Box<CpuRasteriser>>,
    shots: Vec<Shot>,
    /// The ranges of glass triangles that [`Self::glass`] holds.
    ranges: TriangleRanges,
}

/// The variant of a program, the size of its output, its maps, and the size of its pyramid.
type GroupKey = (Variant, (u32, u32), Option<MapsKey>, Option<[u32; 2]>);

/// The output of a program.
#[derive(Debug)]
struct Output {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
}

impl Output {
    fn new(gpu: &Gpu, format: wgpu::TextureFormat, (width, height): (u32, u32)) -> Result<Self, BackendError> {
        let read = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let usage = wgpu::TextureUsages::STORAGE_BINDING | read;
        let texture = texture(gpu, "effect", format, [width, height], usage);
        gpu.check("creation of an effect's output")?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self { texture, view })
    }
}

/// The drawn maps of a pass, and the uniforms of the program that reads them.
#[derive(Debug, Default)]
struct Prepared {
    maps: Option<MapsKey>,
    params: Vec<u8>,
    /// Time that building the pyramid took; `None` if none was built.
    building: Option<Part>,
}

/// Approximate number of texels that a program reads for each pixel.
fn texels(job: &EffectJob<'_>) -> u64 {
    let params = &job.params;
    match job.program {
        EffectProgram::ShadowMap if params.sun > 0.0 => 1 + (SEARCH_TAPS + 4 * FILTER_TAPS) as u64,
        EffectProgram::ShadowMap => 1 + (2 * u64::from(params.pcf) + 2).pow(2),
        EffectProgram::CubeReflection | EffectProgram::CubeRefraction => 12 + u64::from(params.probes),
        // An estimate: a ray usually crosses hundreds of pixels, but skips whole blocks of them.
        EffectProgram::ScreenReflection | EffectProgram::ScreenRefraction => 256,
        EffectProgram::PlanarReflection => 4,
        EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => {
            2 + 2 * u64::from(params.slices) * u64::from(params.steps)
        }
    }
}

impl Effects {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        Ok(Self {
            inputs: Inputs::new(gpu)?,
            draws: DrawList::new(gpu)?,
            programs: HashMap::new(),
            asks: [None, None],
            maps: Kept::default(),
            outputs: Kept::default(),
            shares: Default::default(),
            groups: HashMap::new(),
            glass: Table::new(gpu)?,
            boxes: Table::new(gpu)?,
            runs: Table::new(gpu)?,
            mirrors: Table::new(gpu)?,
            surveyor: None,
            marching: None,
            depths: None,
            filter: None,
            plane_of: Vec::new(),
            probes: Probes::default(),
            surroundings: None,
            shots: Vec::new(),
            ranges: TriangleRanges::default(),
        })
    }

    /// Bytes of device memory: maps, outputs, pyramids, depths and uploaded G-buffers.
    pub fn bytes(&self) -> u64 {
        let maps: u64 = self.maps.values().map(|maps| maps.bytes).sum();
        let pixels = |output: &Output| u64::from(output.texture.width()) * u64::from(output.texture.height());
        let marching = self.marching.as_ref().map_or(0, Marching::bytes);
        let depths = self.depths.as_ref().map_or(0, Depths::bytes);
        let outputs: u64 = self.outputs.values().map(pixels).sum();
        let shares: u64 = self.shares.iter().flat_map(Kept::values).map(pixels).sum();
        maps + marching + depths + 16 * outputs + 4 * shares + self.inputs.bytes()
    }

    /// Runs a pass. `drawn` is the last draw, if that is a whole picture. Without an `output` the picture stays on the
    /// device as [`Self::picture`]. If the pass is given up, the picture is not whole, and the `output` keeps its pixels.
    pub fn run(
        &mut self,
        context: &mut Context<'_>,
        drawn: Option<&Targets>,
        job: &EffectJob<'_>,
        output: Option<&mut Image>,
        progress: &Progress,
    ) -> Result<EffectStats, BackendError> {
        let gpu = context.gpu;
        let what = job.program.info().name;
        check(job, output.as_deref(), job.resident).map_err(|why| unsupported(what, &format!("{why};")))?;
        inputs::check_size(gpu, job)?;
        if job.width == 0 || job.height == 0 {
            return Ok(EffectStats::default());
        }
        let variant = Variant::of(job);
        if !self.programs.contains_key(&variant) {
            self.programs.insert(variant, Program::new(gpu, &self.inputs, variant)?);
        }
        let ready = self.inputs.ready(gpu, drawn, job)?;
        let (id_base, upload) = (ready.id_base, ready.upload);
        let gbuffer = ready.group.clone();
        let ready = Ready { group: &gbuffer, ..ready };
        let start = Instant::now();
        let called = self.called_for(gpu, job, &gbuffer, id_base)?;
        let mirrors = match job.program {
            EffectProgram::PlanarReflection => self.choose_mirrors(context, job, &ready)?,
            _ => Mirrors::default(),
        };
        let asking = start.elapsed();

        let task = Task { width: job.width, height: job.height, id_base, texels: texels(job), apart: 1 };
        let mut stats = EffectStats::default();
        // Programs that draw maps restart the progress.
        progress.start(task.submissions() + filter::submissions((job.width, job.height)) * u64::from(levels(job)));
        let prepared = match job.program {
            EffectProgram::ShadowMap => self.shadow_maps(context, job, called, &task, &mut stats, progress)?,
            EffectProgram::CubeReflection | EffectProgram::CubeRefraction => {
                self.cube_maps(context, job, called.is_some(), &task, &mut stats, progress)?
            }
            EffectProgram::ScreenReflection | EffectProgram::ScreenRefraction => {
                self.screen(context, job, called.is_some(), &gbuffer, &task, &mut stats, progress)?
            }
            EffectProgram::PlanarReflection => self.pictures(context, job, &mirrors, &task, &mut stats, progress)?,
            EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => self.occlusion(gpu, job)?,
        };

        let size = (job.width, job.height);
        self.outputs.require(gpu, size, || self.groups.clear(), |size| Output::new(gpu, OUTPUT_FORMAT, *size))?;
        for shares in self.shares.iter_mut().take(levels(job).min(2) as usize) {
            shares.require(gpu, size, || self.groups.clear(), |size| Output::new(gpu, SHARE_FORMAT, *size))?;
        }
        let group = self.group(gpu, variant, size, prepared.maps)?;
        let Some(program) = self.programs.get(&variant) else { return Ok(stats) };
        let behind = match (&self.marching, shader::reads_behind(job.program)) {
            (Some(marching), true) => marching.behind_group(gpu, &self.inputs),
            _ => None,
        };
        let groups: Vec<&wgpu::BindGroup> = [&gbuffer, &group].into_iter().chain(&behind).collect();
        let depths = self.depths.as_ref().filter(|_| occludes(job.program));
        let before = |pass: &mut wgpu::ComputePass<'_>| {
            if let Some(depths) = depths {
                depths.record(pass, &gbuffer);
            }
        };
        let bound = Bound { groups: &groups, before: Some(&before) };
        let part = program.run(gpu, context.timer, &bound, &prepared.params, &task, progress)?;
        stats.pixels = together(part, prepared.building.unwrap_or_default());
        if levels(job) > 0 {
            let part = self.average(context, job, &gbuffer, progress)?;
            stats.pixels = together(stats.pixels, part);
        }
        stats.pixels.host += asking;
        if progress.is_given_up() {
            return Ok(stats);
        }
        if let (Some(marching), true) = (&self.marching, job.program.marches()) {
            // Building the pyramid clears the counts. Without a pyramid they are those of an earlier run.
            let counted = if prepared.building.is_some() { marching.counted(gpu)? } else { [0; 3] };
            stats.answers = Some(Answers::new(counted, job.params.missing));
        }

        let start = Instant::now();
        let Some(output) = output else {
            stats.transfer = upload;
            return Ok(stats);
        };
        if let Some(texture) = self.picture() {
            context.staging.read(gpu, texture, &mut output.pixels)?;
        }
        stats.transfer = Some(upload.unwrap_or(Duration::ZERO) + start.elapsed());
        Ok(stats)
    }

    /// The output of the last pass; `None` before the first.
    pub fn picture(&self) -> Option<&wgpu::Texture> {
        self.outputs.last().map(|output| &output.texture)
    }

    /// Filters an ambient occlusion, in the job's number of filter levels.
    fn average(
        &mut self,
        context: &Context<'_>,
        job: &EffectJob<'_>,
        gbuffer: &wgpu::BindGroup,
        progress: &Progress,
    ) -> Result<Part, BackendError> {
        let gpu = context.gpu;
        let filter = match &mut self.filter {
            Some(filter) => filter,
            none => none.insert(ShareFilter::new(gpu, &self.inputs)?),
        };
        let size = (job.width, job.height);
        let levels = levels(job) as usize;
        // The levels write alternately to the two shares, and the last level writes the output.
        let mut pictures = Vec::new();
        for level in 0..=levels {
            let kept = if level == levels { &self.outputs } else { &self.shares[level % 2] };
            pictures.push(&kept.last().ok_or_else(|| failure("a filter was not prepared"))?.view);
        }
        let filtered = Filtered { size, gbuffer, pictures: &pictures, shares: true, exponent: job.params.intensity };
        filter.run(gpu, &self.inputs, context.timer, &filtered, progress)
    }

    /// Nearest and farthest depth of the pixels that need the program's maps; both are 0 if glass pixels need them. `None`
    /// if no pixel needs maps, so that no maps are drawn.
    fn called_for(
        &mut self,
        gpu: &Gpu,
        job: &EffectJob<'_>,
        gbuffer: &wgpu::BindGroup,
        id_base: u32,
    ) -> Result<Option<[f32; 2]>, BackendError> {
        if job.program == EffectProgram::PlanarReflection {
            return Ok(None);
        }
        let glass = job.program.info().glass;
        if glass {
            self.ranges.find(&job.scene.geometry, job.glass);
            if self.glass.write(gpu, bytemuck::cast_slice(self.ranges.as_slice()))? {
                self.groups.clear();
            }
            if self.ranges.as_slice().is_empty() {
                return Ok(None);
            }
        } else if job.program != EffectProgram::ShadowMap {
            return Ok(None);
        }
        if !job.resident {
            return Ok(match glass {
                true => job.triangle.par_iter().any(|triangle| self.ranges.contains(*triangle)).then_some([0.0; 2]),
                false => cascades::lit_depths(job),
            });
        }
        let ask = match &mut self.asks[usize::from(glass)] {
            Some(ask) => ask,
            none => none.insert(Ask::new(gpu, &self.inputs, glass)?),
        };
        let ranges = self.ranges.as_slice().len() as u32;
        let depth_plane = cascades::depth_plane(&job.view);
        let params = AskUniform { depth_plane, size: [job.width, job.height], id_base, ranges };
        ask.any(gpu, gbuffer, &self.glass.buffer, params)
    }

    /// Bind group 1 of a program, with the output, maps and pyramid that were required last.
    fn group(
        &mut self,
        gpu: &Gpu,
        variant: Variant,
        size: (u32, u32),
        maps: Option<MapsKey>,
    ) -> Result<wgpu::BindGroup, BackendError> {
        let marching = self.marching.as_ref().filter(|_| variant.program.marches());
        let key = (variant, size, maps, marching.and_then(Marching::size));
        if let Some(group) = self.groups.get(&key) {
            return Ok(group.clone());
        }
        let outputs = if variant.share { &self.shares[0] } else { &self.outputs };
        let (Some(output), Some(compiled)) = (outputs.last(), self.programs.get(&variant)) else {
            return Err(failure("an effect was not prepared"));
        };
        let mut resources = Vec::new();
        if let Some(maps) = self.maps.last().filter(|_| maps.is_some()) {
            resources.push(wgpu::BindingResource::TextureView(&maps.read));
        }
        if matches!(maps, Some(MapsKey::Cubes { .. })) {
            resources.push(self.glass.buffer.as_entire_binding());
            resources.push(self.boxes.buffer.as_entire_binding());
        }
        if let Some(marching) = marching {
            resources.extend(marching.resources().into_iter().flatten());
        }
        if let (Some(depths), true) = (self.depths.as_ref(), occludes(variant.program)) {
            resources.extend(depths.view().map(wgpu::BindingResource::TextureView));
        }
        if matches!(maps, Some(MapsKey::Mirrors { .. })) {
            resources.push(self.runs.buffer.as_entire_binding());
            resources.push(self.mirrors.buffer.as_entire_binding());
        }
        let group = compiled.bind(gpu, &output.view, &resources)?;
        self.groups.insert(key, group.clone());
        Ok(group)
    }
}

/// Whether a program is an ambient occlusion.
fn occludes(program: EffectProgram) -> bool {
    matches!(program, EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion)
}

/// Number of filter levels after an ambient occlusion.
fn levels(job: &EffectJob<'_>) -> u32 {
    if occludes(job.program) { job.params.filter } else { 0 }
}

/// The sum of the times of two consecutive parts. A part for which nothing was submitted has no device time.
fn together(a: Part, b: Part) -> Part {
    let device = match (a.device, b.device) {
        (Some(a), Some(b)) => Some(a + b),
        (a, b) => a.or(b),
    };
    Part { host: a.host + b.host, device }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_without_device_time_takes_none_from_the_other() {
        let of = |device: Option<u64>| Part { host: Duration::ZERO, device: device.map(Duration::from_millis) };
        for (a, b, sum) in
            [(Some(2), Some(3), Some(5)), (None, Some(3), Some(3)), (Some(2), None, Some(2)), (None, None, None)]
        {
            assert_eq!(together(of(a), of(b)).device, of(sum).device, "{a:?}, {b:?}");
        }
    }
}
