//! The user's settings in addition to the project file, and their checks.

use super::{Plan, PlannedPass, Preview};
use crate::backend::Rect;
use crate::color::{ColorSpace, Display, Tone};
use crate::diagnostic::valid_names;
use crate::image::MAX_SIDE;
use crate::image::PixelFormat;
use crate::kept_scenes::KeptScenes;
use crate::pixel_samples::PixelSamples;
use crate::programs::{Fidelity, Fresnel, LEAST_ADAPTIVE_PATHS, ParamInfo, RayParams, Sampler, Values};
use crate::project::{self, ChannelRef, Pass, PassKind, Project, SceneOptions, SourceError};
use crate::raster_effects::EffectParams;
use std::path::Path;

/// The user's settings in addition to the project file.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Pipeline to run; the project's default if `None`.
    pub pipeline: Option<String>,
    /// Camera of every pass; each pass's own if `None`.
    pub camera: Option<String>,
    /// Window size; the project's if `None`. Render targets are scaled with it.
    pub size: Option<[u32; 2]>,
    /// Corrected programs, or those of the report.
    pub fidelity: Fidelity,
    /// Colour space; the project's if `None`.
    pub color: Option<ColorSpace>,
    /// Exposure in stops: linear radiance is multiplied by 2 to the power of this before it is displayed.
    pub exposure: f32,
    /// Tone curve for linear radiance above 1.
    pub tone: Tone,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Channels to keep for inspection, `target channel` names or `library::channel`; `all` keeps every one.
    pub show: Vec<String>,
    /// Assignments: parameters of ray and effect passes, `pass.name=value`; ray backends of single passes, `pass.backend=cpu`;
    /// formats of channels of render targets, `texture.format=RGBA16F`.
    pub set: Vec<String>,
    /// Names of passes that are switched off. A ray or effect pass then writes a neutral result: the colour that it reads (black if
    /// it reads none), or 1 for a share of light. Other passes leave their targets unchanged.
    pub off: Vec<String>,
    /// Memory that the process may use at most, bytes.
    pub max_memory: u64,
    /// How to make a project from scene files, if scene files are named instead of a project.
    pub scene: SceneOptions,
    /// The rectangle of the window that is written; all of it if `None`.
    pub crop: Option<Rect>,
    /// Largest number of bands of rows, which are rendered one after another. `None` cuts the picture into bands only if its targets
    /// take more than half of the allowed memory.
    pub bands: Option<u32>,
    /// Number of samples of every pixel; the picture is their mean. A ray pass takes all of its own samples at each of them.
    pub aa: PixelSamples,
    /// Fewer pixels and samples than the other settings ask for; `None` renders all.
    pub preview: Option<Preview>,
    /// Scenes that renderers with clones of these settings share.
    pub scenes: KeptScenes,
}

impl Settings {
    /// Opens the project at a path: a project file, or scene files from which a project is made ([`project::open`]).
    ///
    /// # Errors
    /// As [`project::open`].
    pub fn open(&self, path: &Path) -> Result<Project, SourceError> {
        project::open(path, &self.scene, self.size, self.max_memory)
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            pipeline: None,
            camera: None,
            size: None,
            fidelity: Fidelity::Corrected,
            color: None,
            exposure: 0.0,
            tone: Tone::None,
            seed: 0,
            show: Vec::new(),
            set: Vec::new(),
            off: Vec::new(),
            max_memory: 8 << 30,
            scene: SceneOptions::default(),
            crop: None,
            bands: None,
            aa: PixelSamples::ONE,
            preview: None,
            scenes: KeptScenes::default(),
        }
    }
}

/// Why no plan can be made.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{message}{}", help.as_ref().map(|help| format!("\n       {help}")).unwrap_or_default())]
pub struct PlanError {
    /// What is wrong.
    pub message: String,
    /// What would be valid.
    pub help: Option<String>,
}

impl PlanError {
    pub(super) fn new(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: Some(help.into()) }
    }
}

pub(super) fn check_size(what: &str, size: [u32; 2]) -> Result<(), PlanError> {
    if size.iter().any(|side| !(1..=MAX_SIDE).contains(side)) {
        let message = format!("{what} would be {} x {} pixels", size[0], size[1]);
        return Err(PlanError::new(message, format!("valid: 1 to {MAX_SIDE} a side")));
    }
    Ok(())
}

/// Fails if the settings' preview is not valid.
pub(super) fn check_preview(settings: &Settings) -> Result<(), PlanError> {
    let Some(Preview { divisor, samples }) = settings.preview else { return Ok(()) };
    if divisor == 0 || samples == 0 || samples.isqrt().pow(2) != samples {
        let message = format!("a preview has its sides divided by {divisor}, and {samples} samples a point");
        return Err(PlanError::new(message, "valid: a divisor of at least 1, and a square number such as 1 or 4"));
    }
    if divisor > 1 && settings.crop.is_some() {
        let message = "a preview of fewer pixels is of the whole picture, and --crop is a part of one";
        return Err(PlanError::new(message, "leave --crop out, or use a divisor of 1"));
    }
    Ok(())
}

/// Colour space of the pixels, and their conversion to display values.
pub(super) fn display(project: &Project, settings: &Settings) -> Result<Display, PlanError> {
    let &Settings { exposure, tone, .. } = settings;
    let space = settings.color.unwrap_or(project.color);
    let valid = -Display::MAX_EXPOSURE..=Display::MAX_EXPOSURE;
    if !valid.contains(&exposure) {
        let help = format!("valid: {} to {}", valid.start(), valid.end());
        return Err(PlanError::new(format!("the exposure is {exposure} stops"), help));
    }
    if space == ColorSpace::Report && (exposure != 0.0 || tone != Tone::None) {
        return Err(PlanError::new(
            "exposure and tone curves are of linear light, and the colours are display values (color=report)",
            "add --color linear, or leave --exposure and --tone out",
        ));
    }
    Ok(Display { space, exposure, tone })
}

/// Constants of a pass's program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Constants {
    /// Constants of a ray pass.
    Ray(RayParams),
    /// Constants of a raster effect.
    Effect(EffectParams),
}

/// The program of a pass: its name and the parameters that it reads.
fn program(kind: &PassKind) -> Option<(&'static str, &'static [&'static str])> {
    match kind {
        PassKind::Ray(ray) => Some((ray.program.info().stem, ray.program.info().params)),
        PassKind::Effect(effect) => Some((effect.program.info().name, effect.program.info().params)),
        PassKind::Raster(_) | PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => None,
    }
}

/// The word after the dot in `--set TEXTURE.format=FORMAT`, which sets the format of a channel.
const FORMAT: &str = "format";

/// Name after the dot in an assignment of a pass's ray backend.
const BACKEND: &str = "backend";

/// Names of the ray backends that a single pass may ask for. `auto`, the first, selects the common backend of all passes.
const BACKENDS: &[&str] = &["auto", "cpu", "wgpu", "cuda", "optix"];

/// The parameter with which `--set PASS.backend=NAME` selects a ray backend for one pass. Every pass that [`may_trace`] has it.
pub const OWN_BACKEND: ParamInfo = ParamInfo {
    name: BACKEND,
    about: "ray backend of this pass alone; auto is that of all passes",
    valid: "auto, cpu, wgpu, cuda, optix",
    values: Values::Names(BACKENDS),
};

/// Whether a pass traces rays, or may leave pixels to rays.
#[must_use]
pub fn may_trace(kind: &PassKind) -> bool {
    match kind {
        PassKind::Ray(_) | PassKind::Intersection(_) => true,
        PassKind::Effect(effect) => effect.program.may_leave_to_rays(),
        PassKind::Raster(_) | PassKind::Quad(_) | PassKind::Compute(_) => false,
    }
}

/// Splits `KEY.NAME=VALUE` into its parts.
fn parts(assignment: &str) -> Result<(&str, &str, &str), PlanError> {
    let parts = assignment.split_once('=').and_then(|(key, value)| Some((key.rsplit_once('.')?, value.trim())));
    let Some(((key, name), value)) = parts else {
        let message = format!("`--set {assignment}` is neither PASS.NAME=VALUE nor TEXTURE.format=FORMAT");
        return Err(PlanError::new(message, "examples: --set pass2.samples=49, --set norm.format=RGBA16F"));
    };
    Ok((key, name, value))
}

/// Applies the formats in `--set` to channels of render targets.
pub(super) fn set_formats(project: &mut Project, pipeline: usize, settings: &Settings) -> Result<(), PlanError> {
    for assignment in &settings.set {
        let (texture, FORMAT, value) = parts(assignment)? else { continue };
        let ChannelRef { target, channel } = find_written(&written_channels(project, pipeline), texture, None)?;
        let format = PixelFormat::named(value).ok_or_else(|| {
            let names = PixelFormat::NAMED.iter().map(|(name, _)| *name);
            PlanError::new(format!("`{assignment}`: there is no format `{value}`"), valid_names(value, names))
        })?;
        project.targets[target].channels[channel].format = format;
    }
    Ok(())
}

/// Widens channels of bytes that hold colours of linear light to 16-bit floats: steps of 1/255 are coarse near black, and values
/// above 1 would be lost. Channels whose format the user sets are kept. Returns the names of the widened channels.
pub(super) fn widen_colors(project: &mut Project, pipeline: usize, settings: &Settings) -> Vec<String> {
    let by_user = |name: &str| {
        settings.set.iter().any(|set| parts(set).is_ok_and(|(key, what, _)| what == FORMAT && key == name))
    };
    let mut widened = Vec::new();
    for (ChannelRef { target, channel }, name) in written_channels(project, pipeline) {
        let own = name.rsplit("::").next().unwrap_or(&name);
        let declared = &mut project.targets[target].channels[channel].format;
        if channel == 0 && *declared == PixelFormat::Rgba8Unorm && !by_user(&name) && !by_user(own) {
            *declared = PixelFormat::Rgba16Float;
            widened.push(name);
        }
    }
    widened
}

/// The constants of each pass of the pipeline, after `--set` and the preview; `None` for passes without constants.
pub(super) fn constants(
    project: &Project,
    pipeline: usize,
    settings: &Settings,
) -> Result<Vec<Option<Constants>>, PlanError> {
    let passes = &project.pipelines[pipeline].passes;
    let mut constants: Vec<Option<Constants>> = passes
        .iter()
        .map(|pass| match &pass.kind {
            PassKind::Ray(ray) => Some(Constants::Ray(ray.params)),
            PassKind::Effect(effect) => Some(Constants::Effect(effect.params)),
            PassKind::Raster(_) | PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => None,
        })
        .collect();
    let tunable: Vec<&str> =
        passes.iter().filter(|pass| program(&pass.kind).is_some()).map(|pass| pass.name.as_str()).collect();
    let tunable = || tunable.iter().copied();
    for assignment in &settings.set {
        let (pass, name, value) = parts(assignment)?;
        if name == FORMAT {
            continue;
        }
        if name == BACKEND {
            check_backend(passes, pass, value)?;
            continue;
        }
        let Some(index) = passes.iter().position(|candidate| candidate.name == pass) else {
            return Err(PlanError::new(format!("there is no pass `{pass}`"), valid_names(pass, tunable())));
        };
        let (Some((program, read)), Some(values)) = (program(&passes[index].kind), constants[index].as_mut()) else {
            return Err(PlanError::new(format!("pass `{pass}` has no parameters"), valid_names(pass, tunable())));
        };
        if !read.contains(&name) {
            let message = format!("pass `{pass}` runs `{program}`, which reads no `{name}`");
            return Err(PlanError::new(message, valid_names(name, read.iter().copied())));
        }
        let result = match values {
            Constants::Ray(params) => params.set(name, value),
            Constants::Effect(params) => params.set(name, value),
        };
        result.map_err(|help| PlanError::new(format!("`{assignment}` is not valid"), help))?;
    }
    for constants in &mut constants {
        if let (Some(preview), Some(Constants::Ray(params))) = (settings.preview, constants) {
            preview.limit(params);
        }
    }
    for (pass, constants) in passes.iter().zip(&constants) {
        let (PassKind::Ray(ray), Some(Constants::Ray(params))) = (&pass.kind, constants) else { continue };
        let approximate = params.fresnel != Fresnel::Exact && ray.program.info().params.contains(&"fresnel");
        if approximate && settings.fidelity == Fidelity::Thesis {
            return Err(PlanError::new(
                format!("{}: pass `{}` sets fresnel={}", pass.place, pass.name, params.fresnel.name()),
                "thesis fidelity has the report's own weight: leave `fresnel` out, or use --fidelity corrected",
            ));
        }
        if let Some(error) = ray.program.sampled_to(params).filter(|_| params.paths < LEAST_ADAPTIVE_PATHS) {
            return Err(PlanError::new(
                format!("{}: pass `{}` sets error={error} with paths={}", pass.place, pass.name, params.paths),
                format!("valid: paths={LEAST_ADAPTIVE_PATHS} or more; 4096 leaves the error room"),
            ));
        }
        let strata = params.sampler == Sampler::Strata || settings.fidelity == Fidelity::Thesis;
        if strata && ray.program.info().params.contains(&"samples") && params.samples.isqrt().pow(2) != params.samples {
            return Err(PlanError::new(
                format!("{}: pass `{}` takes {} samples in square strata", pass.place, pass.name, params.samples),
                format!("valid: a square number such as {}", params.samples.isqrt().pow(2)),
            ));
        }
    }
    Ok(constants)
}

/// Fails if a pass for which `--set` names a ray backend traces no rays, or if there is no such pass or backend.
fn check_backend(passes: &[Pass], pass: &str, value: &str) -> Result<(), PlanError> {
    let tracing = || passes.iter().filter(|pass| may_trace(&pass.kind)).map(|pass| pass.name.as_str());
    if !tracing().any(|name| name == pass) {
        let message = match passes.iter().any(|other| other.name == pass) {
            true => format!("pass `{pass}` traces no rays, so it has no ray backend"),
            false => format!("there is no pass `{pass}`"),
        };
        return Err(PlanError::new(message, valid_names(pass, tracing())));
    }
    if !BACKENDS.contains(&value) {
        return Err(PlanError::new(
            format!("there is no ray backend `{value}`"),
            valid_names(value, BACKENDS.iter().copied()),
        ));
    }
    Ok(())
}

impl Plan {
    /// The ray backend that `--set PASS.backend=NAME` selects for a pass; `None` for the backend of all passes.
    #[must_use]
    pub fn backend_of(&self, planned: &PlannedPass) -> Option<&str> {
        let name = &self.pass(planned).name;
        let of_pass = |set: &String| match parts(set) {
            Ok((pass, BACKEND, value)) if pass == name => BACKENDS.iter().copied().find(|backend| *backend == value),
            _ => None,
        };
        self.settings.set.iter().rev().find_map(of_pass).filter(|backend| *backend != BACKENDS[0])
    }
}

/// The channels that passes of a pipeline write, with their full names `library::channel`.
fn written_channels(project: &Project, pipeline: usize) -> Vec<(ChannelRef, String)> {
    let mut writable: Vec<(ChannelRef, String)> = Vec::new();
    for pass in &project.pipelines[pipeline].passes {
        let Some(target) = pass.target else { continue };
        let declared = &project.targets[target];
        let written = pass.kind.channels_of(declared);
        for (channel, declared_channel) in declared.channels.iter().take(written).enumerate() {
            let channel = ChannelRef { target, channel };
            if !writable.iter().any(|(known, _)| *known == channel) {
                writable.push((channel, format!("{}::{}", declared.library, declared_channel.name)));
            }
        }
    }
    writable
}

/// Finds a channel by its full or short name. An error lists the valid names, and `extra` with them.
fn find_written(writable: &[(ChannelRef, String)], name: &str, extra: Option<&str>) -> Result<ChannelRef, PlanError> {
    let short = |full: &str| full.rsplit("::").next().unwrap_or(full).to_owned();
    match writable.iter().find(|(_, full)| full == name || short(full) == name) {
        Some((channel, _)) => Ok(*channel),
        None => {
            let names: Vec<String> =
                writable.iter().map(|(_, full)| short(full)).chain(extra.map(str::to_owned)).collect();
            let help = valid_names(name, names.iter().map(String::as_str));
            Err(PlanError::new(format!("no pass of this pipeline writes a texture `{name}`"), help))
        }
    }
}

impl Plan {
    /// The channel of a render target by a name of [`Settings::show`]: its short name, or `library::channel`.
    ///
    /// # Errors
    /// If no pass of the pipeline writes it; the message lists what passes write, and the nearest name.
    pub fn channel_named(&self, name: &str) -> Result<ChannelRef, PlanError> {
        find_written(&written_channels(&self.project, self.pipeline), name, None)
    }
}

/// The channels that `--show` names.
pub(super) fn shown_channels(
    project: &Project,
    pipeline: usize,
    show: &[String],
) -> Result<Vec<ChannelRef>, PlanError> {
    let writable = written_channels(project, pipeline);
    if show.iter().any(|name| name == "all") {
        return Ok(writable.into_iter().map(|(channel, _)| channel).collect());
    }
    let mut shown = Vec::new();
    for name in show {
        let channel = find_written(&writable, name, Some("all"))?;
        if !shown.contains(&channel) {
            shown.push(channel);
        }
    }
    Ok(shown)
}
