//! Facts about a project and its passes that the window shows.

use crate::camera::Bounds;
use curitiba::Choice;
use curitiba::pipeline::diagnostic::Severity;
use curitiba::pipeline::executor::{Renderer, Row, StepKind};
use curitiba::pipeline::plan::{OWN_BACKEND, Plan, Settings, Work, may_trace};
use curitiba::pipeline::programs::{PARAMS, ParamInfo, RayParams};
use curitiba::pipeline::project::{Pass, PassKind, Pose};
use curitiba::pipeline::raster_effects::{EFFECT_PARAMS, EffectParams};
use glam::Mat4;
use std::path::PathBuf;

/// Facts of a project, as of the last frame.
#[derive(Debug, Clone)]
pub struct Facts {
    /// The project or scene.
    pub source: PathBuf,
    /// The pipeline that runs.
    pub pipeline: String,
    /// Size of the window's picture at rest, pixels.
    pub window: [u32; 2],
    /// The passes, in the order of the pipeline.
    pub passes: Vec<PassFacts>,
    /// Names of the cameras.
    pub cameras: Vec<String>,
    /// The camera that every pass was given; `None` where each has its own.
    pub camera: Option<String>,
    /// The camera through which the first raster pass sees.
    pub seen_by: String,
    /// The pose of the camera [`Self::seen_by`]; `None` if there is no such camera.
    pub pose: Option<Pose>,
    /// Distance of the far plane of the camera [`Self::seen_by`], behind which nothing is drawn; infinite if there is no such camera.
    pub far: f32,
    /// The matrix from world space to clip space, of the first raster pass; `None` if none runs.
    pub clip_from_world: Option<Mat4>,
    /// The bounding box of all scenes, in world space; `None` if they have no vertices.
    pub bounds: Option<Bounds>,
    /// The camera [`Self::seen_by`] as an element of a project, or why it cannot be written as one.
    pub camera_xml: Result<String, String>,
    /// The requested choice of engines, in which `auto` is not resolved.
    pub choice: Choice,
    /// Name of the rasteriser, and of its device.
    pub raster: [String; 2],
    /// Name of the ray backend, and of its device.
    pub rays: [String; 2],
    /// Everything that was replaced or left out, and every backend that a fallback replaced.
    pub warnings: Vec<String>,
    /// The steps of loading and building, with milliseconds.
    pub once: Vec<(String, f64)>,
    /// The settings with which `curitiba render` gives this picture, except for cameras that were moved.
    pub settings: Settings,
}

/// A pass.
#[derive(Debug, Clone)]
pub struct PassFacts {
    /// Its name.
    pub name: String,
    /// `raster`, `rays`, `effect`, `quad`, `intersections` or `compute`.
    pub kind: &'static str,
    /// Its program, if the project chooses one.
    pub program: Option<&'static str>,
    /// A description of what it does.
    pub about: &'static str,
    /// Whether it runs, or why it does not.
    pub state: PassState,
    /// Its outputs.
    pub outputs: Vec<PassOutput>,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
    /// Times of its last run.
    pub times: PassTimes,
}

/// Whether a pass runs, or why it does not.
#[derive(Debug, Clone, PartialEq)]
pub enum PassState {
    /// It runs.
    Runs,
    /// The user switched it off.
    Off,
    /// The plan leaves it out, for this reason.
    LeftOut(String),
}

/// An output of a pass.
#[derive(Debug, Clone, PartialEq)]
pub struct PassOutput {
    /// Its own name, such as `pos` or `result`.
    pub name: String,
    /// Its full name, `library::texture`; `None` for the result, which is written to the window.
    pub full: Option<String>,
}

/// A parameter of a pass.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Its entry in the table.
    pub info: &'static ParamInfo,
    /// Its value, as written in projects.
    pub value: String,
}

/// Times of a pass when it last ran.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PassTimes {
    /// How often it has run.
    pub runs: u64,
    /// Host time of all its steps, milliseconds.
    pub host_ms: f64,
    /// Device time, milliseconds; `None` if the device has no clock.
    pub device_ms: Option<f64>,
    /// Number of rays; `None` if the pass traces none.
    pub rays: Option<u64>,
    /// Its steps, with milliseconds and notes.
    pub steps: Vec<(StepKind, f64, String)>,
}

impl PassTimes {
    /// Replaces the times by those of a frame; `rows` are the rows of the timeline for this pass.
    pub(super) fn take<'a>(&mut self, rows: impl Iterator<Item = &'a Row>) {
        let runs = self.runs + 1;
        *self = Self { runs, ..Self::default() };
        for row in rows {
            let host: f64 = row.host_ms.iter().sum();
            self.host_ms += host;
            if !row.device_ms.is_empty() {
                *self.device_ms.get_or_insert_default() += row.device_ms.iter().sum::<f64>();
            }
            if let Some(rays) = row.rays {
                *self.rays.get_or_insert_default() += rays.total();
            }
            self.steps.push((row.kind, host, row.note.clone()));
        }
    }

    /// Millions of rays a second of host time; `None` if the pass traced none.
    #[must_use]
    pub fn mrays_per_second(&self) -> Option<f64> {
        self.rays.filter(|rays| *rays > 0).map(|rays| rays as f64 / 1e3 / self.host_ms.max(1e-6))
    }
}

impl Facts {
    /// Facts of a renderer after a frame; `times` is in the order of the pipeline.
    pub(super) fn of(renderer: &Renderer, choice: Choice, times: &[PassTimes], bounds: Option<Bounds>) -> Self {
        let plan = renderer.plan();
        let project = renderer.project();
        let pipeline = &plan.project.pipelines[plan.pipeline];
        let engines = renderer.engines();
        let seen_by = camera_in_use(renderer);
        let passes = pipeline.passes.iter().enumerate().map(|(index, pass)| {
            let times = times.get(index).cloned().unwrap_or_default();
            pass_facts(plan, renderer.settings(), index, pass, times)
        });
        let problems = plan.project.problems.0.iter().filter(|problem| problem.severity != Severity::Note);
        let mut warnings: Vec<String> = renderer.fallbacks().iter().map(ToString::to_string).collect();
        warnings.extend(problems.map(ToString::to_string));
        warnings.extend(renderer.warnings().groups().iter().map(ToString::to_string));
        let once = renderer.timeline().rows.iter().filter(|row| matches!(row.kind, StepKind::Load | StepKind::Build));
        Self {
            source: plan.project.source.clone(),
            pipeline: pipeline.name.clone(),
            window: plan.whole_size(None),
            passes: passes.collect(),
            cameras: project.cameras.iter().map(|camera| camera.name.clone()).collect(),
            camera: renderer.settings().camera.clone(),
            pose: project.pose(&seen_by).ok(),
            clip_from_world: plan.passes.iter().find_map(|planned| match planned.work {
                Work::Raster { view, .. } => Some(view.clip_from_world),
                _ => None,
            }),
            bounds,
            far: project
                .cameras
                .iter()
                .find(|camera| camera.name == seen_by)
                .map_or(f32::INFINITY, |camera| camera.far),
            camera_xml: project.camera_xml(&seen_by),
            seen_by,
            choice,
            raster: [engines.raster.name().to_owned(), engines.raster.device()],
            rays: [engines.rays.name().to_owned(), engines.rays.device()],
            warnings,
            once: once.map(|row| (format!("{} {}", row.kind.name(), row.name), row.median_ms())).collect(),
            settings: renderer.settings().clone(),
        }
    }

    /// Sum of the host times of the passes that run, each as of its last run, milliseconds.
    #[must_use]
    pub fn frame_ms(&self) -> f64 {
        self.passes.iter().filter(|pass| pass.state == PassState::Runs).map(|pass| pass.times.host_ms).sum()
    }

    /// Of the passes that run, the last one that writes an output; for `None`, the last one that writes the result.
    #[must_use]
    pub fn last_writer(&self, output: Option<&str>) -> Option<&PassFacts> {
        let writes = |pass: &&PassFacts| pass.outputs.iter().any(|written| written.full.as_deref() == output);
        self.passes.iter().filter(writes).rfind(|pass| pass.state == PassState::Runs)
    }
}

/// The name of the camera through which the first raster pass sees; without a raster pass, that of the first camera.
pub(super) fn camera_in_use(renderer: &Renderer) -> String {
    let project = renderer.project();
    if let Some(camera) = &renderer.settings().camera {
        return camera.clone();
    }
    let plan = renderer.plan();
    let of_pass = plan.project.pipelines[plan.pipeline].passes.iter().find_map(|pass| match &pass.kind {
        PassKind::Raster(raster) => Some(raster.camera),
        _ => None,
    });
    project.cameras.get(of_pass.unwrap_or_default()).map_or(String::new(), |camera| camera.name.clone())
}

fn pass_facts(plan: &Plan, settings: &Settings, index: usize, pass: &Pass, times: PassTimes) -> PassFacts {
    let (kind, program, about) = match &pass.kind {
        PassKind::Raster(_) => ("raster", None, "draws triangles"),
        PassKind::Ray(ray) => ("rays", Some(ray.program.info().stem), ray.program.info().about),
        PassKind::Effect(effect) => ("effect", Some(effect.program.info().name), effect.program.info().about),
        PassKind::Quad(_) => ("quad", None, "fills a rectangle from one texture, or from the product of two"),
        PassKind::Intersection(_) => {
            ("intersections", None, "traces the rays of a storage buffer for their nearest hits")
        }
        PassKind::Compute(_) => ("compute", None, "runs a compute shader, which stores to images and buffers"),
    };
    let written = if kind == "raster" { 3 } else { 1 };
    let outputs = match pass.target {
        None => vec![PassOutput { name: "result".to_owned(), full: None }],
        Some(target) => {
            let target = &plan.project.targets[target];
            let output =
                |name: &String| PassOutput { name: name.clone(), full: Some(format!("{}::{name}", target.library)) };
            target.channels.iter().take(written).map(|channel| output(&channel.name)).collect()
        }
    };
    let what = format!("pass `{}`", pass.name);
    let state = if settings.off.contains(&pass.name) {
        PassState::Off
    } else if plan.passes.iter().any(|planned| planned.pass == index) {
        PassState::Runs
    } else {
        let why = plan.decisions.iter().find(|decision| decision.what == what && !decision.built);
        PassState::LeftOut(why.map_or("the plan leaves it out".to_owned(), |decision| decision.why.clone()))
    };
    let parameters = parameters(pass, settings);
    PassFacts { name: pass.name.clone(), kind, program, about, state, outputs, parameters, times }
}

/// The parameters of a ray pass with the values that the settings assign.
pub(super) fn ray_parameters(pass: &str, mut values: RayParams, settings: &Settings) -> RayParams {
    let prefix = format!("{pass}.");
    for (name, value) in settings.set.iter().filter_map(|set| set.strip_prefix(&prefix)?.split_once('=')) {
        // Invalid values were refused when they were assigned.
        let _ = values.set(name, value);
    }
    values
}

/// The parameters of a pass with the values that the settings assign, even if the pass is switched off.
fn parameters(pass: &Pass, settings: &Settings) -> Vec<Parameter> {
    let prefix = format!("{}.", pass.name);
    let set = settings.set.iter().filter_map(|set| set.strip_prefix(&prefix)?.split_once('='));
    let backend = set.clone().rfind(|(name, _)| *name == OWN_BACKEND.name).map_or("auto", |(_, value)| value);
    let backend = may_trace(&pass.kind).then(|| Parameter { info: &OWN_BACKEND, value: backend.to_owned() });
    let mut parameters: Vec<Parameter> = match &pass.kind {
        PassKind::Ray(ray) => {
            let values = ray_parameters(&pass.name, ray.params, settings);
            let read = PARAMS.iter().filter(|info| ray.program.heeds(info.name, &values));
            read.map(|info| Parameter { info, value: values.get(info.name) }).collect()
        }
        PassKind::Effect(effect) => {
            let mut values: EffectParams = effect.params;
            for (name, value) in set {
                let _ = values.set(name, value);
            }
            let read = EFFECT_PARAMS.iter().filter(|info| effect.program.info().params.contains(&info.name));
            read.map(|info| Parameter { info, value: values.get(info.name) }).collect()
        }
        PassKind::Raster(_) | PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => Vec::new(),
    };
    parameters.extend(backend);
    parameters
}
