//! The case that a row of a benchmark measures.

use super::model::Technique;
use crate::pipeline::color::Display;
use crate::pipeline::executor::{Observer, Renderer};
use crate::pipeline::plan::{Plan, PlannedPass, Settings, Work};
use crate::pipeline::programs::{Fidelity, RayProgram, Traces};
use crate::pipeline::project::PassKind;
use crate::{Choice, OpenError};
use std::path::{Path, PathBuf};

/// A project with its settings on one set of engines.
#[derive(Debug, Clone)]
pub struct Case {
    /// Identifies the case among all cases of a benchmark.
    pub key: String,
    /// Name for readers: `AO, 100 samples`.
    pub label: String,
    /// Name of the effect: `none`, or the short name of the ray program that computes it or corresponds to it, such as `ao` or `all`. `-but-ao`
    /// follows the name of a program of several effects that takes 0 occlusion samples. Reports also use `soft-shadows`.
    pub effect: String,
    /// Whether the effect is computed by rays or by rasterisation.
    pub technique: Technique,
    /// The view: `Fonte`, `Vidro`, or the camera's name.
    pub view: String,
    /// Project file, or scene files from which a project is made.
    pub project: PathBuf,
    /// The settings.
    pub settings: Settings,
    /// The choice of engines.
    pub choice: Choice,
    /// Colour space of the picture, and its conversion to display values.
    pub display: Display,
}

/// Name of a camera's view: as in the report, `Fonte` for the camera `MainCamera`.
fn view_of(camera: &str) -> String {
    if camera == "MainCamera" { "Fonte".to_owned() } else { camera.to_owned() }
}

impl Case {
    /// Determines what the project computes, and names the case accordingly. Scenes are not loaded, unless a project is made from
    /// them.
    ///
    /// # Errors
    /// All problems of the project's files together, or the reason why its plan cannot be made.
    pub fn new(path: &Path, settings: Settings, choice: Choice) -> Result<Self, OpenError> {
        let plan = Plan::new(settings.open(path)?, settings)?;
        let camera = plan.passes.iter().find_map(|planned| match &plan.pass(planned).kind {
            PassKind::Raster(raster) => Some(raster.camera),
            _ => None,
        });
        let camera = plan.settings.camera.clone().or_else(|| Some(plan.project.cameras[camera?].name.clone()));
        let (effect, technique) = effect(&plan);
        let samples = plan.passes.iter().find_map(|planned| samples(&plan, planned));
        let view = view_of(camera.as_deref().unwrap_or_default());
        let label = label(&effect, samples, &plan);
        let label =
            if plan.settings.aa.are_several() { format!("{label}, {} a pixel", plan.settings.aa) } else { label };
        let settings = plan.settings.clone();
        let key = key(path, &plan, &view, choice);
        let display = plan.display;
        Ok(Self { key, label, effect, technique, view, project: path.to_owned(), settings, choice, display })
    }

    /// A renderer of the case.
    ///
    /// # Errors
    /// All problems of the project's files together, or the reason why it cannot be rendered.
    pub fn open(&self, observer: &mut dyn Observer) -> Result<Renderer, OpenError> {
        crate::open(&self.project, self.settings.clone(), self.choice, observer)
    }
}

/// The name of a fidelity in files and on the command line.
#[must_use]
pub fn fidelity_name(fidelity: Fidelity) -> &'static str {
    match fidelity {
        Fidelity::Corrected => "corrected",
        Fidelity::Thesis => "thesis",
    }
}

/// The name of an effect in files and reports.
#[must_use]
pub fn effect_name(program: RayProgram) -> &'static str {
    program.info().short
}

fn effect(plan: &Plan) -> (String, Technique) {
    for planned in &plan.passes {
        if let (Work::Rays { params, .. }, PassKind::Ray(ray)) = (&planned.work, &plan.pass(planned).kind) {
            let (info, name) = (ray.program.info(), effect_name(ray.program));
            // With 0 occlusion samples the program computes the other effects only.
            let without_occlusion = info.traces != Traces::Samples && info.reads("samples") && params.samples == 0;
            return (if without_occlusion { format!("{name}-but-ao") } else { name.to_owned() }, Technique::Rays);
        }
        if let PassKind::Effect(effect) = &plan.pass(planned).kind {
            return (effect_name(effect.program.info().counterpart).to_owned(), Technique::Raster);
        }
    }
    ("none".to_owned(), Technique::None)
}

fn samples(plan: &Plan, planned: &PlannedPass) -> Option<u32> {
    match (&planned.work, &plan.pass(planned).kind) {
        (Work::Rays { params, .. }, PassKind::Ray(ray)) if ray.program.info().params.contains(&"samples") => {
            Some(params.samples)
        }
        _ => None,
    }
}

fn label(effect: &str, samples: Option<u32>, plan: &Plan) -> String {
    let name = match effect {
        "none" => "no effects",
        "dummy" => "no effects, through the ray pass",
        "ao" => "AO",
        "all-but-ao" => "all but AO",
        other => other,
    };
    let by_raster = plan.passes.iter().find_map(|planned| match &plan.pass(planned).kind {
        PassKind::Effect(effect) => Some(effect.program.info().name),
        _ => None,
    });
    match (by_raster, samples) {
        (Some(program), _) => format!("{name}, {program}"),
        (_, Some(1)) => format!("{name}, 1 sample"),
        (_, Some(samples)) if samples > 0 => format!("{name}, {samples} samples"),
        _ => name.to_owned(),
    }
}

fn key(path: &Path, plan: &Plan, view: &str, choice: Choice) -> String {
    let [width, height] = plan.window;
    let settings = &plan.settings;
    let mut parts = vec![
        path.display().to_string(),
        plan.project.pipelines[plan.pipeline].name.clone(),
        view.to_owned(),
        format!("{width}x{height}"),
        fidelity_name(settings.fidelity).to_owned(),
        format!("seed {}", settings.seed),
        format!("raster {}", choice.raster.name()),
        format!("rays {}", choice.rays_in_words()),
    ];
    parts.extend(choice.adapter_name().map(|name| format!("adapter {name}")));
    parts.extend(settings.aa.are_several().then(|| format!("aa {}", settings.aa)));
    parts.extend(settings.color.map(|color| format!("color {color}")));
    parts.extend(settings.set.iter().cloned());
    parts.extend(settings.scene.words());
    parts.join(" | ")
}
