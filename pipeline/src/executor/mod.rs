//! The executor: carries out a plan with a rasteriser and a ray backend, and times every step.

mod effect;
mod fallback;
mod join;
mod output;
mod parts;
mod prepare;
mod quad;
mod save;
mod timeline;

pub use fallback::{Fallback, Spare};
pub use output::{Faults, Output, Range, Triangles};
pub use save::{Saved, Written};
pub use timeline::{Observer, Progress, Row, Silent, StepKind, Timeline, median};

use crate::backend::{
    Attachments, BackendError, GBuffer, RasterJob, Rasteriser, RayBackend, RayCounts, RayJob, Rect, Shade, Sun,
};
use crate::diagnostic::Warnings;
use crate::glass::Dielectric;
use crate::image::{Image, PixelFormat};
use crate::memory::{self, Refused};
use crate::plan::{Decision, Plan, PlanError, PlannedPass, PlannedTarget, Work};
use crate::project::{ChannelRef, PassKind};
use crate::scene::{RenderScene, SceneError};
use fallback::of_frame;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What does the work.
pub struct Engines {
    /// Draws triangles.
    pub raster: Box<dyn Rasteriser>,
    /// Traces rays.
    pub rays: Box<dyn RayBackend>,
    /// What stands in where the ray backend fails, in this order; empty unless the user allowed it.
    pub spares: VecDeque<Spare>,
    /// Ray backends that failed so far.
    pub fallbacks: Vec<Fallback>,
}

/// Why a frame could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A scene that the project names in these places.
    #[error("{place}: {error}")]
    Scene {
        /// `project.xml:12:17`, for each of its files.
        place: String,
        /// What is wrong with it.
        error: SceneError,
    },
    /// A backend, while working for a pass.
    #[error("pass `{pass}`{}: {error}", of_frame(*frame))]
    Pass {
        /// The pass.
        pass: String,
        /// The frame, counted from 1; `None` before the first, when backends are made and structures built.
        frame: Option<u32>,
        /// What went wrong.
        error: BackendError,
    },
    /// Scenes and acceleration structure together do not fit.
    #[error(
        "{what} would take about {needed}, and {left} is left of --max-memory\n       raise --max-memory, or use a smaller scene"
    )]
    Memory {
        /// What was about to be built.
        what: String,
        /// How much it would take.
        needed: String,
        /// What is left.
        left: String,
    },
    /// Memory for targets, pictures or the acceleration structure.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// A picture that is written while it is rendered.
    #[error(transparent)]
    Write(#[from] std::io::Error),
    /// What the plan asks for is more than an engine can do.
    #[error(transparent)]
    Plan(#[from] PlanError),
}

/// A scene that is loaded, and what passes see of its materials.
struct LoadedScenes {
    scene: Arc<RenderScene>,
    /// By material, what it is as glass; empty where no pass asks.
    dielectrics: Vec<Dielectric>,
    /// Whether a pass that runs traces rays in it.
    structure: bool,
}

/// What a pass needs of the materials, by material index.
#[derive(Default)]
struct PassMaterials {
    shades: Vec<Shade>,
    /// Those whose back faces a raster pass leaves out.
    culled: Vec<bool>,
    glass: Vec<bool>,
    shadow_glass: Vec<bool>,
    /// What glass is, where the materials decide.
    dielectrics: Vec<Dielectric>,
}

/// How far a ray pass came.
enum Traced {
    /// It is done.
    Done,
    /// Another backend has taken over which reads host memory, where the G-buffer is not: the frame begins again.
    NothingInHost,
}

/// A plan with everything loaded and built, ready to render frames.
pub struct Renderer {
    plan: Plan,
    engines: Engines,
    scenes: Vec<LoadedScenes>,
    /// By planned pass.
    materials: Vec<PassMaterials>,
    targets: Vec<GBuffer>,
    window: GBuffer,
    /// The scene sets that the rasteriser and the ray backend hold now.
    uploaded: Option<usize>,
    built: Option<usize>,
    /// The target whose G-buffer the rasteriser and the ray backend share.
    joined: Option<usize>,
    /// What its semaphore reaches when the last G-buffer is there.
    handed_over: u64,
    /// Frames begun.
    frame: u32,
    /// The part of the picture that the targets hold: an index of its list.
    part: usize,
    timeline: Timeline,
    warnings: Warnings,
}

impl Renderer {
    /// Loads the scenes and builds what the plan needs.
    ///
    /// # Errors
    /// If a scene cannot be loaded, or a backend cannot run a pass.
    pub fn new(mut plan: Plan, engines: Engines, observer: &mut dyn Observer) -> Result<Self, RenderError> {
        let (raster, rays) = (&engines.raster, &engines.rays);
        plan.fit((raster.name(), raster.limits()), (rays.name(), rays.limits()))?;
        let in_parts = plan.in_parts();
        let largest = plan.parts.largest();
        let target = |target: &PlannedTarget| {
            let (width, height) = if in_parts { largest } else { (target.width, target.height) };
            GBuffer::try_new(width, height, target.stored)
        };
        let mut renderer = Self {
            scenes: Vec::new(),
            materials: Vec::new(),
            targets: plan.targets.iter().map(target).collect::<Result<_, _>>()?,
            window: prepare::window(if in_parts { largest.into() } else { plan.window })?,
            uploaded: None,
            built: None,
            joined: None,
            handed_over: 0,
            frame: 0,
            part: 0,
            timeline: Timeline::default(),
            warnings: plan.warnings.clone(),
            plan,
            engines,
        };
        renderer.tell_of_fallbacks(observer);
        if let Some((pass, error)) = renderer.unsupported() {
            renderer.stand_in(&pass, error, observer)?;
        }
        renderer.prepare(observer)?;
        Ok(renderer)
    }

    /// The plan, with the decisions that depend on the scene.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Every choice and its reason.
    #[must_use]
    pub fn decisions(&self) -> &[Decision] {
        &self.plan.decisions
    }

    /// Every step so far.
    #[must_use]
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Forgets the times of the frames so far: what follows a warm-up is measured by itself.
    pub fn forget_frames(&mut self) {
        self.timeline.forget_frames();
    }

    /// What was left out or replaced while loading.
    #[must_use]
    pub fn warnings(&self) -> &Warnings {
        &self.warnings
    }

    /// What does the work.
    #[must_use]
    pub fn engines(&self) -> &Engines {
        &self.engines
    }

    /// The scenes that passes use, one for each of [`Plan::scene_sets`].
    pub fn scenes(&self) -> impl Iterator<Item = &Arc<RenderScene>> {
        self.scenes.iter().map(|loaded| &loaded.scene)
    }

    /// Sets the seed of the random numbers of the frames that follow.
    pub fn set_seed(&mut self, seed: u32) {
        self.plan.settings.seed = seed;
    }

    /// Renders a frame and returns the window's picture.
    ///
    /// # Errors
    /// If a backend fails and no other may stand in for it; names the pass and the frame. What was rendered before stays.
    pub fn frame(&mut self, observer: &mut dyn Observer) -> Result<Image, RenderError> {
        let parts = self.plan.parts.clone();
        if let [part] = parts.list[..] {
            self.draw_frame(observer)?;
            return Ok(self.picture(part.written)?);
        }
        let mut pixels = memory::with_capacity(parts.crop.width as usize * parts.crop.height as usize)?;
        self.begin_frame();
        for (index, part) in parts.list.iter().enumerate() {
            self.draw_part(index, observer)?;
            self.copy_rows(part.written, &mut pixels);
        }
        self.end_frame();
        Ok(Image { width: parts.crop.width, height: parts.crop.height, pixels })
    }

    /// [`Self::frame`] without a copy of the picture: of one that is rendered in bands only the last one is kept.
    ///
    /// # Errors
    /// As [`Self::frame`].
    pub fn draw_frame(&mut self, observer: &mut dyn Observer) -> Result<(), RenderError> {
        self.begin_frame();
        for index in 0..self.plan.parts.list.len() {
            self.draw_part(index, observer)?;
        }
        self.end_frame();
        Ok(())
    }

    /// Runs every pass for a part of the picture.
    fn draw_part(&mut self, part: usize, observer: &mut dyn Observer) -> Result<(), RenderError> {
        self.place_targets(part)?;
        let frame = Some(self.frame);
        let mut index = 0;
        while index < self.plan.passes.len() {
            let planned = self.plan.passes[index].clone();
            let name = self.plan.pass(&planned).name.clone();
            let result = match &planned.work {
                Work::Raster { .. } => self.raster(index, &planned, &name, observer),
                Work::Rays { scene_set, .. } => match self.rays(index, &planned, *scene_set, &name, observer)? {
                    Traced::Done => Ok(()),
                    Traced::NothingInHost => {
                        index = 0;
                        continue;
                    }
                },
                Work::Effect { .. } => self.effect(index, &planned, &name, observer),
                Work::Quad { viewport } => {
                    self.quad(&planned, &name, *viewport, observer);
                    Ok(())
                }
            };
            result.map_err(|error| RenderError::Pass { pass: name, frame, error })?;
            self.show_outputs(&planned, observer);
            index += 1;
        }
        Ok(())
    }

    /// The picture as the last frame left it, what is cut off left out; black before the first. Of one that is rendered in
    /// bands, the last band.
    ///
    /// # Panics
    /// If there is no memory for it.
    #[must_use]
    pub fn window_image(&self) -> Image {
        self.picture(self.plan.parts.list[self.part].written).unwrap_or_else(|error| panic!("{error}"))
    }

    /// A channel that the plan keeps for inspection or for a later pass.
    #[must_use]
    pub fn channel(&self, channel: ChannelRef) -> &[[f32; 4]] {
        channel_of(&self.targets[channel.target], channel.channel)
    }

    fn raster(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let Work::Raster { scene_set, view, viewport, clear_color, attachments, host, traced } = planned.work else {
            return Ok(());
        };
        let pass = self.plan.pass(planned);
        let PassKind::Raster(raster) = &pass.kind else { return Ok(()) };
        let (program, target) = (raster.program, pass.target);
        let sun = raster.light.and_then(|light| self.sun(light));
        self.upload(scene_set, observer)?;
        let mut buffer = std::mem::take(self.buffer(target));
        let scene = Arc::clone(&self.scenes[scene_set].scene);
        let PassMaterials { shades, culled, .. } = &self.materials[index];
        let (shared, half) = (self.in_shared_memory(target, traced), self.half_floats(target));
        let blocks = self.blocks(view, viewport, &buffer);
        let job = RasterJob {
            scene: &scene,
            program,
            view,
            sun,
            shades,
            culled,
            viewport,
            clear_color,
            attachments,
            shared,
            half,
        };
        if self.plan.block.is_some() {
            let (host, raster) = (self.in_host(target, host, traced), &mut self.engines.raster);
            observer.begin(StepKind::Raster, name, &Arc::new(Progress::default()));
            let start = Instant::now();
            let drawn = parts::draw_blocks(raster.as_mut(), &job, &blocks, host, &mut buffer);
            let elapsed = start.elapsed();
            observer.end();
            *self.buffer(target) = buffer;
            self.round_to_formats(target);
            let (triangles, blocks) = (drawn?, blocks.len());
            let engine = self.engines.raster.name();
            self.timeline.record(StepKind::Raster, name, elapsed).note =
                format!("{triangles} triangles on {engine}, in {blocks} blocks");
            return Ok(());
        }
        let progress = Arc::new(Progress::default());
        observer.begin(StepKind::Raster, name, &progress);
        let start = Instant::now();
        let drawn = self.engines.raster.draw(&job, &mut buffer);
        let elapsed = start.elapsed();
        observer.end();
        let handed = drawn.as_ref().ok().and_then(|stats| stats.shared);
        let mut result = drawn.map(|stats| {
            let joining = handed.map_or(Duration::ZERO, |handed| handed.host);
            let row = self.timeline.record(StepKind::Raster, name, elapsed.saturating_sub(joining));
            row.device_ms.extend(stats.device_time.map(|time| time.as_secs_f64() * 1e3));
            row.note = format!("{} triangles on {}", stats.triangles, self.engines.raster.name());
        });
        let host = self.in_host(target, host, traced);
        if result.is_ok() && self.engines.raster.needs_read_back() && host != Attachments::default() {
            let start = Instant::now();
            result = self.engines.raster.read_back(&job, host, &mut buffer);
            self.timeline.record(StepKind::ReadBack, name, start.elapsed());
        }
        if let Some(handed) = handed {
            self.record_hand_over(name, handed);
        }
        *self.buffer(target) = buffer;
        self.round_to_formats(target);
        result
    }

    /// Builds what a ray pass needs and runs it, with another backend where one fails and another is allowed.
    fn rays(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        scene_set: usize,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<Traced, RenderError> {
        let joined = self.joined;
        loop {
            self.build_or_stand_in(scene_set, name, observer)?;
            if self.joined != joined {
                return Ok(Traced::NothingInHost);
            }
            match self.trace(index, planned, name, observer) {
                Ok(()) => return Ok(Traced::Done),
                Err(error) => self.stand_in(name, error, observer)?,
            }
        }
    }

    fn trace(
        &mut self,
        index: usize,
        planned: &PlannedPass,
        name: &str,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let Work::Rays { scene_set, view, params, beyond, reads_triangle, resident } = planned.work else {
            return Ok(());
        };
        let pass = self.plan.pass(planned);
        let (PassKind::Ray(ray), Some(target)) = (&pass.kind, pass.target) else { return Ok(()) };
        let ray = ray.clone();
        let in_host = !self.is_joined(resident);
        let buffer = std::mem::take(&mut self.targets[target]);
        let mut output = Image { width: buffer.width, height: buffer.height, pixels: buffer.color };
        let targets = &self.targets;
        let read = |channel: Option<ChannelRef>, name: &str| match channel {
            Some(channel) if in_host && ray.program.info().buffers.contains(&name) => {
                channel_of(&targets[channel.target], channel.channel)
            }
            _ => &[],
        };
        let triangle = match ray.position {
            Some(position) if in_host && reads_triangle => targets[position.target].triangle.as_slice(),
            _ => &[],
        };
        let materials = &self.materials[index];
        let scene = Arc::clone(&self.scenes[scene_set].scene);
        let job = RayJob {
            scene: &scene,
            program: ray.program,
            params,
            fidelity: self.plan.settings.fidelity,
            seed: self.plan.settings.seed,
            eye: view.eye,
            sun: ray.light.and_then(|light| self.sun(light)),
            origin: buffer.origin,
            width: output.width,
            height: output.height,
            position: read(ray.position, "pos_buffer"),
            normal: read(ray.normal, "norm_buffer"),
            color: read(ray.color, "color_buffer"),
            triangle,
            shared: (!in_host).then_some(self.handed_over),
            beyond,
            dielectrics: &materials.dielectrics,
            shades: &materials.shades,
            glass: &materials.glass,
            shadow_glass: &materials.shadow_glass,
        };
        let progress = Arc::new(Progress::default());
        observer.begin(StepKind::Rays, name, &progress);
        let start = Instant::now();
        let traced = self.engines.rays.run(&job, &mut output, &progress);
        let elapsed = start.elapsed();
        observer.end();
        if traced.is_ok() && in_host {
            observer.traced(name, &job, &output);
        }
        self.targets[target] = GBuffer { color: output.pixels, ..buffer };
        self.round_to_formats(Some(target));
        let stats = traced?;
        if let Some(upload) = stats.upload {
            let from = if in_host { "copied from the host" } else { "copied from GPU to GPU" };
            self.timeline.record(StepKind::Join, name, upload).note = from.to_owned();
        }
        let copies = stats.upload.unwrap_or_default() + stats.read_back.unwrap_or_default();
        // What the backend holds is one number for all of its passes: it stands in the row of the last.
        self.timeline.rows.iter_mut().filter(|row| row.kind == StepKind::Rays).for_each(|row| row.bytes = 0);
        let row = self.timeline.record(StepKind::Rays, name, elapsed.saturating_sub(copies));
        row.device_ms.extend(stats.device_time.map(|time| time.as_secs_f64() * 1e3));
        let mut rays = stats.rays;
        if self.part > 0 {
            rays += row.rays.unwrap_or_default();
        }
        row.rays = Some(rays);
        row.bytes = stats.held_bytes;
        row.note = format!("{} on {}{}", ray.program.info().stem, self.engines.rays.name(), by_kind(rays));
        // Times of two backends stand in one row.
        for fallback in &self.engines.fallbacks {
            if let Some(frame) = fallback.frame.filter(|frame| *frame > 1) {
                row.note += &format!("; before frame {frame} on {}", fallback.failed);
            }
        }
        if let Some(read_back) = stats.read_back {
            self.timeline.record(StepKind::ReadBack, name, read_back);
        }
        Ok(())
    }

    fn quad(&mut self, planned: &PlannedPass, name: &str, viewport: Rect, observer: &mut dyn Observer) {
        let pass = self.plan.pass(planned);
        let PassKind::Quad(quad) = &pass.kind else { return };
        let (source, target) = (quad.source, pass.target);
        observer.begin(StepKind::Quad, name, &Arc::new(Progress::default()));
        let start = Instant::now();
        let mut buffer = std::mem::take(self.buffer(target));
        let width = buffer.width;
        // Of a part all is filled: passes that fill a part of the whole are not rendered in parts.
        let viewport = match self.plan.in_parts() {
            true => Rect { x: 0, y: 0, width, height: buffer.height },
            false => viewport,
        };
        quad::fill(&mut buffer.color, width, viewport, source, |channel| {
            let read = &self.targets[channel.target];
            (read.width, read.height, channel_of(read, channel.channel))
        });
        *self.buffer(target) = buffer;
        self.round_to_formats(target);
        let elapsed = start.elapsed();
        observer.end();
        self.timeline.record(StepKind::Quad, name, elapsed);
    }

    fn buffer(&mut self, target: Option<usize>) -> &mut GBuffer {
        match target {
            Some(target) => &mut self.targets[target],
            None => &mut self.window,
        }
    }

    /// The channels of a target that are declared in 16-bit floats.
    fn half_floats(&self, target: Option<usize>) -> Attachments {
        let channels = target.map_or(&[][..], |target| &self.plan.project.targets[target].channels);
        let half = |channel: usize| channels.get(channel).is_some_and(|c| c.format == PixelFormat::Rgba16Float);
        Attachments { color: half(0), position: half(1), normal: half(2), triangle: false }
    }

    /// What a later pass reads has the precision of the declared format. The window keeps its floats until it is written.
    fn round_to_formats(&mut self, target: Option<usize>) {
        let Some(target) = target else { return };
        let buffer = &mut self.targets[target];
        let channels = [&mut buffer.color, &mut buffer.position, &mut buffer.normal];
        for (declared, pixels) in self.plan.project.targets[target].channels.iter().zip(channels) {
            declared.format.round(pixels);
        }
    }

    fn sun(&self, light: usize) -> Option<Sun> {
        let light = &self.plan.project.lights[light];
        light.direction.map(|direction| Sun { direction, color: light.color })
    }
}

fn channel_of(buffer: &GBuffer, channel: usize) -> &[[f32; 4]] {
    match channel {
        0 => &buffer.color,
        1 => &buffer.position,
        _ => &buffer.normal,
    }
}

/// `: 12 shadow, 3 reflected`, the kinds that were traced.
fn by_kind(rays: RayCounts) -> String {
    let kinds = [
        (rays.shadow, "shadow"),
        (rays.occlusion, "occlusion"),
        (rays.reflected, "reflected"),
        (rays.refracted, "refracted"),
        (rays.certain, "occlusion certain without"),
        (rays.lost, "lost in glass"),
    ];
    let traced: Vec<String> =
        kinds.iter().filter(|(count, _)| *count > 0).map(|(count, kind)| format!("{count} {kind}")).collect();
    if traced.is_empty() { String::new() } else { format!(": {}", traced.join(", ")) }
}
