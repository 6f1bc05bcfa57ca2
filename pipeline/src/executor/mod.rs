//! The executor: carries out a plan with a rasteriser and a ray backend, and times every step.

mod accumulate;
mod change;
mod compute;
mod dirty;
mod effect;
mod engines;
mod estimate;
mod fallback;
mod goal;
mod in_place;
mod intersection;
mod join;
mod observer;
mod output;
mod parts;
mod prepare;
mod quad;
mod raster;
mod rays;
mod samples;
mod save;
mod shaders;
mod shares;
mod show;
mod storage;
mod textures;
mod timeline;

pub use crate::progress::{Cancellation, Progress};
pub use accumulate::{AccumulatedPass, Accumulation};
pub use change::{ChangeError, Pose};
pub use engines::{Engines, Fallback, Spare};
pub use estimate::Estimate;
pub use goal::{Goal, MAX_SAMPLES};
pub use observer::{Observer, Silent};
pub use output::{Faults, Output, Range, Triangles};
pub use save::{Saved, Written};
pub use timeline::{Row, Span, StepKind, Timeline, median};

use crate::backend::{Attachments, BackendError, GBuffer, Lamp, Rect, Shade};
use crate::camera_programs::SurfaceKind;
use crate::diagnostic::{Decision, Warnings};
use crate::glass::Dielectric;
use crate::image::{Image, PixelFormat};
use crate::memory::{self, Refused};
use crate::plan::{Instead, Plan, PlanError, PlannedPass, PlannedTarget, ShowingQuad, Work};
use crate::project::{ChannelRef, PassKind, QuadSource};
use crate::scene::texture::Texture;
use crate::scene::{RenderScene, SceneError, TextureSource};
use engines::of_frame;
use glam::Vec4;
use in_place::{DisplayedWindow, Takes};
use rays::Traced;
use shares::Shares;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Why a frame could not be rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// A scene could not be loaded.
    #[error("{place}: {error}")]
    Scene {
        /// Where the project names the scene's files: `project.xml:12:17` for each.
        place: String,
        /// What is wrong with the scene.
        error: SceneError,
    },
    /// A backend failed while it worked for a pass.
    #[error("pass `{pass}`{}: {error}", of_frame(*frame))]
    Pass {
        /// The pass.
        pass: String,
        /// The frame, counted from 1; `None` before the first, when backends are made and structures built.
        frame: Option<u32>,
        /// What went wrong.
        error: BackendError,
    },
    /// Scene and acceleration structure together do not fit into the allowed memory.
    #[error(
        "{what} would take about {needed}, and {left} is left of --max-memory\n       raise --max-memory, or use a smaller scene"
    )]
    Memory {
        /// What was about to be built.
        what: String,
        /// How much memory it would take.
        needed: String,
        /// How much is left.
        left: String,
    },
    /// There is no memory for targets, pictures or the acceleration structure.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// A picture could not be written while it was rendered.
    #[error(transparent)]
    Write(#[from] std::io::Error),
    /// The frame was cancelled through [`Renderer::cancellation`]. The results of passes that were complete stay.
    #[error("cancelled")]
    Cancelled,
    /// The plan exceeds the limits of an engine.
    #[error(transparent)]
    Plan(#[from] PlanError),
}

/// A loaded scene set, and what the plan's passes need of its materials and textures.
struct LoadedScenes {
    scene: Arc<RenderScene>,
    /// Glass properties by material; empty if no pass asks for them.
    dielectrics: Vec<Dielectric>,
    /// Image files that own shaders read, with their indices in the scene's textures.
    images: Vec<(PathBuf, u32)>,
    /// The textures that the project maps to materials, with their indices in the scene's textures.
    mapped: Vec<(TextureSource, u32)>,
    /// Whether a pass that runs traces rays in the scene.
    structure: bool,
}

/// A material that an own shader draws.
#[derive(Debug, Clone, PartialEq)]
struct Surface {
    /// Index into [`RasterPass::shaders`](crate::project::RasterPass::shaders).
    shader: usize,
    diffuse: Vec4,
    ambient: Vec4,
    specular: Vec4,
    emission: Vec4,
    shininess: f32,
    /// Index into [`RenderScene::textures`].
    texture: Option<u32>,
}

/// The materials as a pass sees them, by material index.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PassMaterials {
    /// Colours and textures.
    pub shades: Vec<Shade>,
    /// Whether a raster pass culls the back faces of a material; empty in thesis fidelity, and for passes of other kinds.
    pub culled: Vec<bool>,
    /// Whether a ray or effect pass treats the material as glass: rays of a ray pass bounce on it.
    pub glass: Vec<bool>,
    /// Whether shadow rays of a ray pass go through the material.
    pub shadow_glass: Vec<bool>,
    /// Glass properties of the materials; empty unless the pass has `glass=auto`.
    pub dielectrics: Vec<Dielectric>,
    /// How rays that start at the camera behave at the material; empty for passes whose rays start elsewhere.
    pub surfaces: Vec<SurfaceKind>,
    /// Materials that own shaders draw in a raster pass; empty if there are none.
    own: Vec<Option<Surface>>,
}

/// Decisions about scenes, and warnings about parts that were left out.
#[derive(Debug, Clone, Default)]
struct SceneNotes {
    decisions: Vec<Decision>,
    warnings: Warnings,
}

/// A plan with its scenes loaded and its structures built, ready to render frames.
pub struct Renderer {
    plan: Plan,
    engines: Engines,
    scenes: Vec<LoadedScenes>,
    /// Image files that own shaders of quad and compute passes read. A pass loads those that are missing. All are dropped when scenes are
    /// read again.
    quad_images: Vec<(PathBuf, Texture)>,
    /// The materials as each planned pass sees them.
    materials: Vec<PassMaterials>,
    targets: Vec<GBuffer>,
    window: GBuffer,
    /// Decisions and warnings from loading the scenes.
    scene_notes: SceneNotes,
    /// Index of the scene set that the rasteriser holds.
    uploaded: Option<usize>,
    /// Index of the scene set whose acceleration structure the ray backends hold.
    built: Option<usize>,
    /// By material: whether rays may pass through it in the structure that is built.
    built_filtered: Vec<bool>,
    /// For each ray backend that holds the structure, a pass that traces with it.
    built_for: Vec<String>,
    /// The target whose G-buffer the rasteriser and the ray backend share.
    joined: Option<usize>,
    /// Whether the G-buffer of [`Self::joined`] is the rasteriser's own attachments, lent to the ray backend, instead of shared memory.
    lent: bool,
    /// Whether the shared memory has room for the picture of a ray pass, which the showing quad reads.
    shares_picture: bool,
    /// Value of the shared memory's semaphore once the last G-buffer is complete.
    handed_over: u64,
    /// The quad that the rasteriser's device may fill.
    showing: Option<ShowingQuad>,
    /// Number of the rasteriser's last draw for the quad [`Self::showing`], as in [`HandOver::value`](crate::backend::HandOver::value).
    drawn_value: u64,
    /// What the caller takes of the current frame.
    takes: Takes,
    /// The picture of the last frame, if a device converted it to display codes.
    displayed: Option<DisplayedWindow>,
    room_for_codes: Vec<[u8; 4]>,
    /// Number of frames begun.
    frame: u32,
    /// Index of the part of the picture that the targets hold.
    part: usize,
    /// Index of the sample that passes render, among the samples of a pixel.
    sample: u32,
    /// Number of samples a pixel of the current frame that are done.
    taken: u32,
    /// With an adaptive number of samples a pixel: the [`Shares`] of ray passes, by index of the plan's passes.
    shares: BTreeMap<usize, Shares>,
    /// By index of the pipeline's passes: the inputs of the pass's last run; `None` if the picture of that run no longer exists.
    ran: Vec<Option<dirty::Given>>,
    /// The passes that the last frame ran, as indices into the plan's passes.
    passes_run: Vec<usize>,
    /// The plan that setters proposed since the last frame.
    next: Option<Plan>,
    /// Changes to the project that no [`Settings`] hold; they are applied again when the project is read again.
    edits: Vec<change::Edit>,
    /// Whether the scene files must be read again.
    stale: bool,
    shows_everything: bool,
    cancellation: Cancellation,
    /// Whether a step of this frame was given up, even if the cancellation was withdrawn since.
    given_up: bool,
    timeline: Timeline,
    warnings: Warnings,
}

impl Renderer {
    /// Loads the scenes and builds what the plan needs.
    ///
    /// # Errors
    /// If a scene cannot be loaded, or a backend cannot run a pass.
    pub fn new(mut plan: Plan, mut engines: Engines, observer: &mut dyn Observer) -> Result<Self, RenderError> {
        engines.serve(&plan).map_err(|(pass, error)| RenderError::Pass { pass, frame: None, error })?;
        plan.fit((engines.raster.name(), engines.raster.limits()), engines.ray_limits(&plan))?;
        let sizes = change::buffer_sizes(&plan);
        let target =
            |(target, [width, height]): (&PlannedTarget, &[u32; 2])| GBuffer::try_new(*width, *height, target.stored);
        let mut renderer = Self {
            scenes: Vec::new(),
            quad_images: Vec::new(),
            materials: Vec::new(),
            targets: plan.targets.iter().zip(&sizes.targets).map(target).collect::<Result<_, _>>()?,
            window: prepare::window(sizes.window)?,
            scene_notes: SceneNotes::default(),
            built_filtered: Vec::new(),
            built_for: Vec::new(),
            ran: vec![None; plan.project.pipelines[plan.pipeline].passes.len()],
            passes_run: Vec::new(),
            next: None,
            edits: Vec::new(),
            stale: false,
            shows_everything: false,
            cancellation: Cancellation::new(),
            given_up: false,
            uploaded: None,
            built: None,
            joined: None,
            lent: false,
            shares_picture: false,
            handed_over: 0,
            showing: None,
            drawn_value: 0,
            takes: Takes::default(),
            displayed: None,
            room_for_codes: Vec::new(),
            frame: 0,
            part: 0,
            sample: 0,
            taken: 0,
            shares: BTreeMap::new(),
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

    /// The plan of the last frame, with the decisions that depend on the scene. Settings made since are not in it.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Every decision with its reason.
    #[must_use]
    pub fn decisions(&self) -> &[Decision] {
        &self.plan.decisions
    }

    /// The times of all steps so far.
    #[must_use]
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Forgets the times of the frames so far, such as those of a warm-up.
    pub fn forget_frames(&mut self) {
        self.timeline.forget_frames();
    }

    /// Warnings of the plan ([`Plan::warnings`]), and about contents that were left out or replaced while loading.
    #[must_use]
    pub fn warnings(&self) -> &Warnings {
        &self.warnings
    }

    /// The rasteriser and the ray backends.
    #[must_use]
    pub fn engines(&self) -> &Engines {
        &self.engines
    }

    /// The rasteriser and the ray backends, for the next renderer, which then need not open the devices again.
    #[must_use]
    pub fn into_engines(self) -> Engines {
        self.engines
    }

    /// The scenes that passes use, one for each of [`Plan::scene_sets`].
    pub fn scenes(&self) -> impl Iterator<Item = &Arc<RenderScene>> {
        self.scenes.iter().map(|loaded| &loaded.scene)
    }

    /// The materials as the pass at an index of [`Plan::passes`] sees them.
    ///
    /// # Panics
    /// If there is no such pass.
    #[must_use]
    pub fn materials(&self, index: usize) -> &PassMaterials {
        &self.materials[index]
    }

    /// A handle with which another thread can cancel a frame while it is rendered.
    #[must_use]
    pub fn cancellation(&self) -> Cancellation {
        self.cancellation.clone()
    }

    /// The passes that ran for the last frame, in order.
    pub fn passes_run(&self) -> impl Iterator<Item = &str> {
        self.passes_run.iter().map(|index| self.plan.pass(&self.plan.passes[*index]).name.as_str())
    }

    /// The up-to-date picture: runs the passes whose inputs changed since they last ran, and those that depend on them. It equals
    /// the picture of [`Self::frame`], bit for bit. A picture rendered in bands is rendered anew as a whole, and with several
    /// samples a pixel either all passes run or none.
    ///
    /// # Errors
    /// As [`Self::frame`].
    pub fn update(&mut self, observer: &mut dyn Observer) -> Result<Image, RenderError> {
        self.settle(observer)?;
        if self.plan.parts.list.len() > 1 {
            return self.frame(observer);
        }
        self.refresh(observer)?;
        Ok(self.picture(self.plan.parts.list[0].written)?)
    }

    /// [`Self::update`] without a copy of the picture.
    ///
    /// # Errors
    /// As [`Self::frame`].
    pub fn refresh(&mut self, observer: &mut dyn Observer) -> Result<(), RenderError> {
        self.settle(observer)?;
        if self.plan.parts.list.len() > 1 {
            return self.draw_frame(observer);
        }
        self.begin_frame();
        let run = self.outdated();
        self.draw_part(0, run, observer)?;
        self.end_frame();
        Ok(())
    }

    /// Renders a frame, with every pass, and returns the window's picture; with several samples a pixel it is their mean.
    ///
    /// # Errors
    /// If a backend fails and there is no fallback; the error names pass and frame. Earlier results stay.
    pub fn frame(&mut self, observer: &mut dyn Observer) -> Result<Image, RenderError> {
        self.settle(observer)?;
        let parts = self.plan.parts.clone();
        if let [part] = parts.list[..] {
            self.draw_frame(observer)?;
            return Ok(self.picture(part.written)?);
        }
        let mut pixels = memory::with_capacity(parts.crop.width as usize * parts.crop.height as usize)?;
        self.begin_frame();
        for (index, part) in parts.list.iter().enumerate() {
            self.draw_part(index, self.all_passes(), observer)?;
            self.copy_rows(part.written, &mut pixels);
        }
        self.end_frame();
        Ok(Image { width: parts.crop.width, height: parts.crop.height, pixels })
    }

    /// [`Self::frame`] without a copy of the picture. Of a picture rendered in bands only the last band is kept.
    ///
    /// # Errors
    /// As [`Self::frame`].
    pub fn draw_frame(&mut self, observer: &mut dyn Observer) -> Result<(), RenderError> {
        self.settle(observer)?;
        self.begin_frame();
        for index in 0..self.plan.parts.list.len() {
            self.draw_part(index, self.all_passes(), observer)?;
        }
        self.end_frame();
        Ok(())
    }

    /// The set of all passes, for frames that run every pass.
    fn all_passes(&self) -> Vec<bool> {
        vec![true; self.plan.passes.len()]
    }

    /// Runs passes for one sample of every pixel of a part of the picture. `run` says by index of the plan's passes which passes run. If a
    /// pass finds that its inputs are not in host memory ([`Traced::NothingInHost`]), all passes run again from the first.
    fn draw_sample(
        &mut self,
        part: usize,
        sample: u32,
        mut run: Vec<bool>,
        observer: &mut dyn Observer,
    ) -> Result<(), RenderError> {
        self.place_targets(part)?;
        self.sample = sample;
        if part == 0 {
            self.passes_run.clear();
        }
        if run.contains(&true) {
            self.fill_textures();
            self.outlive_absent();
        }
        let mut index = 0;
        while index < self.plan.passes.len() {
            if run[index] {
                match self.run_pass(index, observer)? {
                    Traced::Done => self.note_run(index, part),
                    Traced::NothingInHost => {
                        run.fill(true);
                        self.passes_run.clear();
                        index = 0;
                        continue;
                    }
                }
            }
            index += 1;
        }
        Ok(())
    }

    /// Records the inputs of a pass that is done.
    fn note_run(&mut self, index: usize, part: usize) {
        if part == 0 {
            self.passes_run.push(index);
        }
        // With several parts, the targets hold only the last part, so no inputs are recorded. A window that a device displayed holds no
        // floats, so the inputs of the pass that writes it are not recorded.
        let displayed = self.displayed.is_some() && self.plan.pass(&self.plan.passes[index]).target.is_none();
        if self.plan.parts.list.len() == 1 && !displayed {
            self.ran[self.plan.passes[index].pass] = Some(self.given(index));
        }
    }

    /// Runs the pass at an index of the plan.
    fn run_pass(&mut self, index: usize, observer: &mut dyn Observer) -> Result<Traced, RenderError> {
        self.check_cancelled()?;
        let planned = self.for_sample(&self.plan.passes[index]);
        let name = self.plan.pass(&planned).name.clone();
        // If the pass fails, its target holds no valid picture.
        self.ran[planned.pass] = None;
        let frame = Some(self.frame);
        let done = |()| Traced::Done;
        let result = match &planned.work {
            Work::Raster { .. } => self.raster(index, &planned, &name, observer).map(done),
            Work::Rays { scene_set, .. } => Ok(self.rays(index, &planned, *scene_set, &name, None, observer)?),
            Work::Effect { .. } => Ok(self.effect(index, &planned, &name, observer)?),
            Work::Intersection { scene_set } => Ok(self.intersect(&planned, *scene_set, &name, observer)?),
            Work::Off { instead } => {
                self.switched_off(&planned, &name, *instead, observer);
                Ok(Traced::Done)
            }
            Work::Quad { .. } if self.in_place().is_some_and(|quad| quad.index == index) => {
                self.fill_on_device(&planned, &name, observer).map(done)
            }
            Work::Quad { viewport } => self.quad(&planned, &name, *viewport, observer).map(done),
            Work::Compute => self.compute(&planned, &name, observer).map(done),
        };
        if let Ok(Traced::NothingInHost) = result {
            return Ok(Traced::NothingInHost);
        }
        self.check_cancelled()?;
        result.map_err(|error| RenderError::Pass { pass: name, frame, error })?;
        self.show_outputs(index, &planned, observer);
        Ok(Traced::Done)
    }

    fn check_cancelled(&mut self) -> Result<(), RenderError> {
        let given_up = std::mem::take(&mut self.given_up);
        if given_up || self.cancellation.is_cancelled() { Err(RenderError::Cancelled) } else { Ok(()) }
    }

    /// The progress of a step. The step advances it, and reads from it whether the frame is cancelled.
    fn progress(&self) -> Arc<Progress> {
        Arc::new(Progress::until(&self.cancellation))
    }

    /// The written part of the last frame's picture; black before the first frame. If the picture was rendered in bands, this is the last
    /// band. If a device displayed it ([`Self::displayed_frame`]), this is decoded from 8-bit codes.
    ///
    /// # Panics
    /// If there is no memory for it.
    #[must_use]
    pub fn window_image(&self) -> Image {
        let picture = || self.picture(self.plan.parts.list[self.part].written);
        self.displayed_image().unwrap_or_else(|| picture().unwrap_or_else(|error| panic!("{error}")))
    }

    /// The pixels of a channel that the plan keeps for inspection or for a later pass, top row first. [`Self::holds`] says whether they are
    /// those of the last frame.
    #[must_use]
    pub fn channel(&self, channel: ChannelRef) -> &[[f32; 4]] {
        channel_of(&self.targets[channel.target], channel.channel)
    }

    fn quad(
        &mut self,
        planned: &PlannedPass,
        name: &str,
        viewport: Rect,
        observer: &mut dyn Observer,
    ) -> Result<(), BackendError> {
        let pass = self.plan.pass(planned);
        let PassKind::Quad(quad) = &pass.kind else { return Ok(()) };
        let (source, target) = (quad.source, pass.target);
        let (shader, writes_color) = (quad.shader.clone(), quad.writes_color);
        let progress = self.progress();
        observer.begin(StepKind::Quad, name, &progress);
        let start = Instant::now();
        let mut buffer = std::mem::take(self.buffer(target));
        let width = buffer.width;
        // In parts the whole buffer is filled: passes with a viewport of their own are not rendered in parts.
        let viewport = match self.plan.in_parts() {
            true => Rect { x: 0, y: 0, width, height: buffer.height },
            false => viewport,
        };
        // What an own shader discards shows no earlier frame or sample.
        let starts_over = !self.plan.access(planned).reads.contains(&(target, 0));
        if shader.is_some() && writes_color && starts_over {
            let (left, right) = (viewport.x as usize, (viewport.x + viewport.width) as usize);
            let rows = buffer.color.chunks_exact_mut((width as usize).max(1));
            let seen = rows.skip(viewport.y as usize).take(viewport.height as usize);
            seen.for_each(|row| row[left..right].fill(prepare::undrawn(target)));
        }
        let filled = shader
            .map_or(Ok(()), |shader| self.fill_quad((&shader, planned.pass, writes_color), viewport, &mut buffer));
        let by_color = self.plan.combines_colors(source);
        quad::fill(&mut buffer.color, width, viewport, (source, by_color), &progress, |channel| {
            let read = &self.targets[channel.target];
            (read.width, read.height, channel_of(read, channel.channel))
        });
        *self.buffer(target) = buffer;
        self.round_to_formats(target);
        self.round_stored(planned);
        let elapsed = start.elapsed();
        observer.end();
        self.given_up |= progress.is_given_up();
        let run = self.plan.pass(planned).run();
        let row = self.timeline.record_run(StepKind::Quad, name, elapsed, run);
        if source == QuadSource::Own {
            row.note = format!("own shader on {}", self.engines.raster.name());
        }
        filled
    }

    /// Writes the substitute for the picture of a pass that is switched off.
    fn switched_off(&mut self, planned: &PlannedPass, name: &str, instead: Instead, observer: &mut dyn Observer) {
        let target = self.plan.pass(planned).target;
        observer.begin(StepKind::Quad, name, &Arc::new(Progress::default()));
        let start = Instant::now();
        let mut buffer = std::mem::take(self.buffer(target));
        match instead {
            Instead::Fill(value) => buffer.color.fill(value),
            Instead::Copy(read) => buffer.color.copy_from_slice(channel_of(&self.targets[read.target], read.channel)),
        }
        if let Some(linear) = self.plan.pass(planned).kind.linear() {
            self.fill_linear(linear, buffer.width, &buffer.color);
        }
        *self.buffer(target) = buffer;
        self.round_to_formats(target);
        let elapsed = start.elapsed();
        observer.end();
        self.timeline.record(StepKind::Quad, name, elapsed).note = "switched off".to_owned();
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

    /// Rounds a target to its declared formats, whose precision later passes read. The window keeps its floats until it is written.
    pub(super) fn round_to_formats(&mut self, target: Option<usize>) {
        let Some(target) = target else { return };
        let buffer = &mut self.targets[target];
        let channels = [&mut buffer.color, &mut buffer.position, &mut buffer.normal];
        for (declared, pixels) in self.plan.project.targets[target].channels.iter().zip(channels) {
            declared.format.round(pixels);
        }
    }

    /// A light with a position, relative to the origin of the scenes; `None` for directional lights.
    fn lamp(&self, light: usize) -> Option<Lamp> {
        let light = &self.plan.project.lights[light];
        let position = (light.position? - self.plan.origin).as_vec3();
        Some(Lamp { position, color: light.color })
    }
}

fn channel_of(buffer: &GBuffer, channel: usize) -> &[[f32; 4]] {
    match channel {
        0 => &buffer.color,
        1 => &buffer.position,
        _ => &buffer.normal,
    }
}
