//! Setters of a renderer: cameras, lights, size, parameters, passes, files.
//!
//! A setter makes and checks a new plan; the renderer adopts it when the next frame begins. There is no list of which setter
//! affects which pass: each pass compares its inputs with those of its last run ([`super::dirty`]).

use super::textures::mapped_textures;
use super::{Observer, RenderError, Renderer, prepare};
use crate::backend::{Attachments, GBuffer, NO_TRIANGLE};
use crate::memory::Refused;
use crate::pixel_samples::PixelSamples;
use crate::plan::{Plan, PlanError, PlannedTarget, Preview, Settings, Work};
pub use crate::project::Pose;
use crate::project::{Project, SourceError, names_scenes};
use glam::{DVec3, Vec3};

/// Why a setter failed. The renderer keeps its previous state.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChangeError {
    /// The project lacks what was named, or the result would be too large.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The project or its scenes could not be read again.
    #[error(transparent)]
    Source(#[from] SourceError),
}

impl ChangeError {
    fn new(message: String) -> Self {
        Self::Plan(PlanError { message, help: None })
    }
}

/// A change to a camera or a light of the project, which [`Settings`] do not hold.
#[derive(Debug, Clone)]
pub(super) enum Edit {
    Pose(String, Pose),
    Light(String, Vec3, Vec3),
}

impl Edit {
    fn apply(&self, project: &mut Project) -> Result<(), ChangeError> {
        let result = match self {
            Self::Pose(camera, pose) => project.set_pose(camera, *pose),
            Self::Light(light, direction, color) => project.set_light(light, *direction, *color),
        };
        result.map_err(ChangeError::new)
    }

    /// Whether this edit replaces an earlier one.
    fn replaces(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Pose(name, _), Self::Pose(other, _)) | (Self::Light(name, ..), Self::Light(other, ..)) => {
                name.eq_ignore_ascii_case(other)
            }
            _ => false,
        }
    }
}

/// Sizes of the buffers of a plan.
pub(super) struct Sizes {
    pub targets: Vec<[u32; 2]>,
    pub window: [u32; 2],
}

/// Sizes of the buffers that a plan needs; if the picture is rendered in parts, the size of the largest part.
pub(super) fn buffer_sizes(plan: &Plan) -> Sizes {
    if plan.in_parts() {
        let largest = plan.parts.largest().into();
        return Sizes { targets: vec![largest; plan.targets.len()], window: largest };
    }
    let targets = plan.targets.iter().map(|target| [target.width, target.height]).collect();
    Sizes { targets, window: plan.window }
}

/// The previous state of a renderer, while it adopts another plan.
struct Before {
    plan: Plan,
    scenes: Vec<super::LoadedScenes>,
    structures: Vec<bool>,
    materials: Vec<super::PassMaterials>,
    warnings: crate::diagnostic::Warnings,
    notes: super::SceneNotes,
}

/// Setters. Each is checked at once and takes effect with the next frame; [`Renderer::update`] then runs only the passes that
/// depend on the change. The picture after a setter equals, bit for bit, that of a renderer opened with the same setting.
impl Renderer {
    /// The plan of the next frame: the proposed one if something was set, otherwise the current one.
    fn upcoming(&self) -> &Plan {
        self.next.as_ref().unwrap_or(&self.plan)
    }

    /// The settings of the next frame.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.upcoming().settings
    }

    /// The project of the next frame, with all changes to its cameras and lights.
    #[must_use]
    #[expect(clippy::misnamed_getters, reason = "a plan's own `project` has the settings in it")]
    pub fn project(&self) -> &Project {
        &self.upcoming().declared
    }

    pub(super) fn propose(&mut self, project: Project, settings: Settings) -> Result<(), ChangeError> {
        let mut plan = Plan::new(project, settings)?;
        plan.fit((self.engines.raster.name(), self.engines.raster.limits()), self.engines.ray_limits(&plan))?;
        if self.shows_everything {
            plan.read_back_everything();
        }
        self.next = Some(plan);
        Ok(())
    }

    fn set(&mut self, change: impl FnOnce(&mut Settings)) -> Result<(), ChangeError> {
        let mut settings = self.settings().clone();
        change(&mut settings);
        self.propose(self.project().clone(), settings)
    }

    fn edit(&mut self, edit: Edit) -> Result<(), ChangeError> {
        let mut project = self.project().clone();
        edit.apply(&mut project)?;
        self.propose(project, self.settings().clone())?;
        self.edits.retain(|other| !edit.replaces(other));
        self.edits.push(edit);
        Ok(())
    }

    /// Reads the project again and applies the edits.
    fn reopened(&self, settings: &Settings) -> Result<Project, ChangeError> {
        let mut project = settings.open(&self.project().source)?;
        self.edits.iter().try_for_each(|edit| edit.apply(&mut project))?;
        Ok(project)
    }

    /// Uses the camera of this name for every pass; with `None` each pass uses its own.
    ///
    /// # Errors
    /// If the project has no such camera.
    pub fn set_camera(&mut self, name: Option<&str>) -> Result<(), ChangeError> {
        self.set(|settings| settings.camera = name.map(str::to_owned))
    }

    /// Moves a camera of the project.
    ///
    /// # Errors
    /// If the project has no such camera, or the pose is degenerate.
    pub fn set_pose(&mut self, camera: &str, pose: Pose) -> Result<(), ChangeError> {
        self.edit(Edit::Pose(camera.to_owned(), pose))
    }

    /// Sets the direction in which a light of the project travels, and its linear colour. Of a spot light, `direction` is the axis of its cone. A
    /// point light has no direction, and keeps none.
    ///
    /// # Errors
    /// If the project has no such light, or the values are not finite.
    pub fn set_light(&mut self, light: &str, direction: Vec3, color: Vec3) -> Result<(), ChangeError> {
        self.edit(Edit::Light(light.to_owned(), direction, color))
    }

    /// Sets the size of the window in pixels; render targets scale with it. A project made from scene files is made again.
    ///
    /// # Errors
    /// If a side is not 1 to [`MAX_SIDE`](crate::image::MAX_SIDE), or the targets take more memory than allowed.
    pub fn set_size(&mut self, size: [u32; 2]) -> Result<(), ChangeError> {
        let settings = Settings { size: Some(size), ..self.settings().clone() };
        // The camera of a project made from scene files depends on the aspect ratio of the window.
        let project = match names_scenes(&self.project().source) {
            true => self.reopened(&settings)?,
            false => self.project().clone(),
        };
        self.propose(project, settings)
    }

    /// Sets a parameter of a ray or effect pass, as `--set PASS.NAME=VALUE` does; with the name of a texture and `format`, the
    /// format of a channel.
    ///
    /// # Errors
    /// If there is no such pass or parameter, or the value is not valid.
    pub fn set_parameter(&mut self, pass: &str, name: &str, value: &str) -> Result<(), ChangeError> {
        let key = format!("{pass}.{name}=");
        self.set(|settings| {
            settings.set.retain(|assignment| !assignment.starts_with(&key));
            settings.set.push(format!("{key}{value}"));
        })
    }

    /// Keeps the named channels of render targets for inspection; names may be full or short, and `all` keeps every channel.
    /// [`Self::channel`] reads them after the next frame.
    ///
    /// # Errors
    /// If a channel does not exist, or no pass writes it.
    pub fn set_shown(&mut self, channels: &[String]) -> Result<(), ChangeError> {
        self.set(|settings| settings.show = channels.to_vec())
    }

    /// Switches a pass off or on. [`Settings::off`] says what a pass writes while it is off.
    ///
    /// # Errors
    /// If there is no such pass, or another pass reads a channel that no pass would write any more.
    pub fn set_enabled(&mut self, pass: &str, enabled: bool) -> Result<(), ChangeError> {
        self.set(|settings| {
            settings.off.retain(|name| name != pass);
            if !enabled {
                settings.off.push(pass.to_owned());
            }
        })
    }

    /// Sets the number of samples of every pixel, over which the picture is averaged.
    ///
    /// # Errors
    /// If positions or normals are kept for inspection, which have no meaningful mean, or there is no memory for the sums.
    pub fn set_pixel_samples(&mut self, samples: PixelSamples) -> Result<(), ChangeError> {
        self.set(|settings| settings.aa = samples)
    }

    /// Renders fewer pixels and samples than the other settings ask for, until the preview is set to `None`. The cameras of a project made
    /// from scene files stay where they were placed for the whole size, and scene files are not read again.
    ///
    /// # Errors
    /// If the preview is not valid, or has fewer pixels although only a part of the picture is written.
    pub fn set_preview(&mut self, preview: Option<Preview>) -> Result<(), ChangeError> {
        self.set(|settings| settings.preview = preview)
    }

    /// Sets the seed of random numbers for the following frames.
    pub fn set_seed(&mut self, seed: u32) {
        self.plan.settings.seed = seed;
        if let Some(next) = &mut self.next {
            next.settings.seed = seed;
        }
    }

    /// Reads the project at once, and its scenes and the images of its shaders again with the next frame; settings and edits are kept. If
    /// the scenes cannot be read then, that frame fails, and later frames show the previous scenes.
    ///
    /// # Errors
    /// If the project cannot be read, or lacks something that was set.
    pub fn reload(&mut self) -> Result<(), ChangeError> {
        let settings = self.settings().clone();
        self.propose(self.reopened(&settings)?, settings)?;
        self.stale = true;
        self.settings().scenes.clear();
        Ok(())
    }

    /// Adopts the plan that setters proposed since the last frame.
    pub(super) fn settle(&mut self, observer: &mut dyn Observer) -> Result<(), RenderError> {
        let Some(next) = self.next.take() else { return Ok(()) };
        let keeps = !std::mem::take(&mut self.stale) && self.scenes_serve(&next);
        let mut before = Before {
            plan: std::mem::replace(&mut self.plan, next),
            scenes: Vec::new(),
            structures: self.scenes.iter().map(|loaded| loaded.structure).collect(),
            materials: std::mem::take(&mut self.materials),
            warnings: std::mem::take(&mut self.warnings),
            notes: self.scene_notes.clone(),
        };
        if !keeps {
            before.scenes = std::mem::take(&mut self.scenes);
        }
        match self.take_up(&before, keeps, observer) {
            Ok(()) => Ok(()),
            Err(error) => {
                let other_plan = &before.plan;
                match self.engines.serve(other_plan) {
                    Ok(false) => {}
                    Ok(true) => self.built = None,
                    // Passes run on no other backend than they name. So the previous plan is proposed again, and the next frame reports
                    // the missing backend.
                    Err(_) => self.next = Some(other_plan.clone()),
                }
                if !keeps {
                    self.scenes = before.scenes;
                    (self.uploaded, self.built) = (None, None);
                }
                for (loaded, structure) in self.scenes.iter_mut().zip(before.structures) {
                    loaded.structure = structure;
                }
                (self.plan, self.materials, self.warnings) = (before.plan, before.materials, before.warnings);
                self.scene_notes = before.notes;
                self.decide_showing_quad();
                Err(error)
            }
        }
    }

    /// Whether the plan `next` can use the loaded scenes as they are.
    fn scenes_serve(&self, next: &Plan) -> bool {
        let now = &self.plan;
        let asks = |plan: &Plan| -> Vec<usize> {
            let passes = plan.passes.iter().filter(|planned| plan.asks_materials(planned));
            let mut sets: Vec<usize> = passes
                .filter_map(|planned| match planned.work {
                    Work::Rays { scene_set, .. } => Some(scene_set),
                    _ => None,
                })
                .collect();
            sets.sort_unstable();
            sets.dedup();
            sets
        };
        // The remaining memory at load time is not compared: it does not affect the contents of scenes.
        let maps_the_same = |set| mapped_textures(now, set).eq(mapped_textures(next, set));
        now.scene_sets == next.scene_sets
            && same_lines(now, next)
            && now.needs == next.needs
            && asks(now) == asks(next)
            && (0..now.scene_sets.len()).all(maps_the_same)
    }

    /// Adopts the plan. Steps that may fail come first.
    fn take_up(&mut self, before: &Before, keeps: bool, observer: &mut dyn Observer) -> Result<(), RenderError> {
        self.warnings = self.plan.warnings.clone();
        if keeps {
            self.plan.move_origin(before.plan.origin);
            self.plan.decisions.extend(self.scene_notes.decisions.iter().cloned());
            self.warnings.append(self.scene_notes.warnings.clone());
            self.scenes.iter_mut().for_each(|loaded| loaded.structure = false);
        } else {
            self.load_scenes(observer)?;
            (self.uploaded, self.built) = (None, None);
        }
        for index in 0..self.plan.passes.len() {
            self.resolve_materials(index);
        }
        self.check_drawn()?;
        let others = self.engines.serve(&self.plan);
        let others = others.map_err(|(pass, error)| RenderError::Pass { pass, frame: None, error })?;
        if others {
            self.built = None;
        }
        if let Some((pass, error)) = self.unsupported() {
            self.stand_in(&pass, error, observer)?;
        }
        let (targets, window) = self.new_buffers(&before.plan, keeps)?;
        let is_new = |pass: &String| !self.built_for.iter().any(|other| self.engines.is_shared(pass, other));
        let built_otherwise = |set: usize| {
            self.scenes[set].structure
                && (self.filtered_materials(set) != self.built_filtered
                    || self.engines.first_traced(&self.plan, Some(set)).iter().any(is_new))
        };
        if self.built.is_some_and(built_otherwise) {
            self.built = None;
        }
        let passes = self.plan.project.pipelines[self.plan.pipeline].passes.len();
        if !keeps || self.ran.len() != passes {
            self.ran = vec![None; passes];
        }
        self.part = 0;
        if !keeps {
            self.quad_images.clear();
        }
        // A target that the plan before lacked has a new buffer, which takes the place of an empty one.
        self.targets.resize_with(self.plan.targets.len(), GBuffer::default);
        for (target, buffer) in targets.into_iter().enumerate() {
            if let Some(buffer) = buffer {
                self.targets[target] = buffer;
                self.forget_writers(Some(target));
            }
        }
        if let Some(window) = window {
            self.window = window;
            self.forget_writers(None);
        }
        self.clear_what_nobody_writes(&before.plan);
        self.join_again(&before.plan, others);
        Ok(())
    }

    /// New buffers for targets (by index) and the window, in place of those that have another size or lack a channel. `None` keeps a buffer.
    fn new_buffers(&self, before: &Plan, keeps: bool) -> Result<(Vec<Option<GBuffer>>, Option<GBuffer>), Refused> {
        let (had, needed) = (buffer_sizes(before), buffer_sizes(&self.plan));
        let several = |plan: &Plan| plan.parts.list.len() > 1;
        // With other scenes no picture is kept; buffers of bands have the size of the last band.
        let all = !keeps || several(before) || several(&self.plan) || before.in_parts() != self.plan.in_parts();
        let target = |(index, (planned, size)): (usize, (&PlannedTarget, &[u32; 2]))| {
            let serves = !all
                && had.targets.get(index) == Some(size)
                && self.targets.get(index).is_some_and(|held| stored(held).union(planned.stored) == stored(held));
            if serves { Ok(None) } else { GBuffer::try_new(size[0], size[1], planned.stored).map(Some) }
        };
        let targets =
            self.plan.targets.iter().zip(&needed.targets).enumerate().map(target).collect::<Result<_, _>>()?;
        let window = if all || had.window != needed.window { Some(prepare::window(needed.window)?) } else { None };
        Ok((targets, window))
    }

    /// Marks the outputs of all passes that wrote to a target (`None` for the window) as lost.
    fn forget_writers(&mut self, target: Option<usize>) {
        let passes = &self.plan.project.pipelines[self.plan.pipeline].passes;
        for (ran, _) in self.ran.iter_mut().zip(passes).filter(|(_, pass)| pass.target == target) {
            *ran = None;
        }
    }

    /// Clears the window, and each target that other passes still write, if a pass that wrote to it no longer runs, or draws into another part
    /// of it than in the plan `before`.
    fn clear_what_nobody_writes(&mut self, before: &Plan) {
        let passes = &self.plan.project.pipelines[self.plan.pipeline].passes;
        let part = |plan: &Plan, index: usize| {
            plan.passes.iter().find(|planned| planned.pass == index).map(|planned| plan.drawn_by(planned))
        };
        let gone = |index: usize| {
            let (was, now) = (part(before, index), part(&self.plan, index));
            now.is_none() && self.ran[index].is_some() || was.is_some() && was != now
        };
        let shared = |target: Option<usize>| {
            target.is_none() || self.plan.passes.iter().any(|planned| self.plan.pass(planned).target == target)
        };
        let gone = passes.iter().enumerate().filter(|(index, _)| gone(*index));
        let mut cleared: Vec<Option<usize>> = gone.map(|(_, pass)| pass.target).filter(|t| shared(*t)).collect();
        cleared.dedup();
        for target in cleared {
            let buffer = self.buffer(target);
            buffer.color.fill(prepare::undrawn(target));
            buffer.position.fill([0.0; 4]);
            buffer.normal.fill([0.0; 4]);
            buffer.triangle.fill(NO_TRIANGLE);
            self.forget_writers(target);
        }
    }

    /// Lets the engines share a G-buffer again, if the new plan shares another G-buffer than the plan `before`, or if a pass has another
    /// ray backend (`others`).
    fn join_again(&mut self, before: &Plan, others: bool) {
        if !others && shared_gbuffer(before) == shared_gbuffer(&self.plan) {
            self.decide_showing_quad();
            return;
        }
        let joined = self.joined.take();
        self.join_engines();
        if joined.is_some() || self.joined.is_some() {
            self.ran.fill(None);
        }
    }
}

/// Whether the lines that passes draw are the same in two plans of the same sets of scenes.
fn same_lines(now: &Plan, next: &Plan) -> bool {
    fn of(plan: &Plan) -> impl Iterator<Item = (DVec3, &[Vec3], Vec<&str>)> {
        plan.lines().map(|scene| {
            let materials = scene.materials.iter().map(|material| material.name.as_str()).collect();
            (scene.origin, scene.meshes[0].positions.as_slice(), materials)
        })
    }
    of(now).eq(of(next))
}

/// The attachments that a G-buffer holds.
fn stored(buffer: &GBuffer) -> Attachments {
    Attachments {
        color: !buffer.color.is_empty(),
        position: !buffer.position.is_empty(),
        normal: !buffer.normal.is_empty(),
        triangle: !buffer.triangle.is_empty(),
    }
}

/// The G-buffer that engines may share.
#[derive(Debug, PartialEq)]
struct Shareable {
    target: usize,
    size: [u32; 2],
    /// For each raster pass that draws into the target: the attachments that ray passes may read in place.
    traced: Vec<Attachments>,
    in_parts: bool,
    /// Whether the shared memory also has room for the picture of a ray pass.
    picture: bool,
}

fn shared_gbuffer(plan: &Plan) -> Option<Shareable> {
    let target = plan.target_to_share()?;
    let drawn = plan.passes.iter().filter(|planned| plan.pass(planned).target == Some(target));
    let traced = drawn.filter_map(|planned| match planned.work {
        Work::Raster { traced, .. } => Some(traced),
        _ => None,
    });
    Some(Shareable {
        target,
        size: plan.target_size(Some(target)),
        traced: traced.collect(),
        in_parts: plan.in_parts() || plan.block.is_some(),
        picture: plan.shares_picture(),
    })
}
