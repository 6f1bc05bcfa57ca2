//! The plan of a reference: the row's project with every pass at its best quality.

use super::FORMAT;
use crate::OpenError;
use crate::bench::Case;
use crate::pipeline::color::ColorSpace;
use crate::pipeline::image::PixelFormat;
use crate::pipeline::pixel_samples::PixelSamples;
use crate::pipeline::plan::{Plan, PlanError, PlannedPass, Settings, Work};
use crate::pipeline::programs::{Fidelity, Fresnel, Sampler};
use crate::pipeline::project::{ChannelRef, EffectPass, Pass, PassKind, Project, RayPass};

/// Kind of rendering.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Without ray tracing.
    Raster,
    /// By tracing rays in `f64`.
    Exact,
    /// By many samples.
    Converged,
}

/// A request for a reference.
pub(super) struct Request {
    pub plan: Plan,
    pub kind: Kind,
}

impl Request {
    /// The plan of a case's reference: corrected programs, rays in place of raster effects, Sobol points, exact Fresnel
    /// reflectance, and 32-bit floats in place of 16-bit ones.
    pub fn new(case: &Case) -> Result<Self, OpenError> {
        Self::of(case.settings.open(&case.project)?, &case.settings)
    }

    /// [`Self::new`] for a project in memory.
    fn of(mut project: Project, settings: &Settings) -> Result<Self, OpenError> {
        let wrong = |message: String| OpenError::Plan(PlanError { message, help: None });
        let pipeline = project.pipeline(settings.pipeline.as_deref()).map_err(wrong)?;
        for pass in &mut project.pipelines[pipeline].passes {
            at_its_best(pass, &settings.set).map_err(wrong)?;
        }
        for channel in project.targets.iter_mut().flat_map(|target| &mut target.channels) {
            if channel.format == PixelFormat::Rgba16Float {
                channel.format = PixelFormat::Rgba32Float;
            }
        }
        let settings = Settings {
            fidelity: Fidelity::Corrected,
            seed: 0,
            show: Vec::new(),
            set: Vec::new(),
            aa: settings.aa.of_every_pixel(),
            ..settings.clone()
        };
        let plan = Plan::new(project, settings)?;
        let kind = plan.passes.iter().fold(Kind::Raster, |kind, planned| match (kind, kind_of(&plan, planned)) {
            (Kind::Converged, _) | (_, Kind::Converged) => Kind::Converged,
            (Kind::Exact, _) | (_, Kind::Exact) => Kind::Exact,
            _ => Kind::Raster,
        });
        Ok(Self { plan, kind })
    }

    /// The plan of the reference of a case's picture: as [`Self::new`], for the whole window, with one sample a pixel, since the
    /// reference renderer takes its own samples.
    pub fn of_picture(case: &Case) -> Result<Self, OpenError> {
        Self::of_picture_of(case.settings.open(&case.project)?, &case.settings)
    }

    /// [`Self::of_picture`] for a project in memory.
    pub fn of_picture_of(project: Project, settings: &Settings) -> Result<Self, OpenError> {
        Self::of(project, &Settings { aa: PixelSamples::ONE, crop: None, bands: None, ..settings.clone() })
    }

    /// Identifies the request as long as the scene files do not change.
    pub fn identity(&self) -> String {
        format!("{:?}\n{}", self.plan.project.scenes, self.base(&[]))
    }

    /// Text of everything that determines the picture, except the number of samples. `scenes` are hashes of the scenes' contents.
    pub fn base(&self, scenes: &[String]) -> String {
        let plan = &self.plan;
        let mut lines = vec![
            format!("curitiba {}, format {FORMAT}, {:?}", env!("CARGO_PKG_VERSION"), self.kind),
            format!("window {:?}", plan.window),
        ];
        // Display values, the default, add no line: references that were stored before the line existed keep their names.
        if plan.display.space != ColorSpace::Report {
            lines.push(format!("color {}", plan.display.space));
        }
        if plan.settings.aa.are_several() {
            lines.push(format!("samples a pixel {}", plan.settings.aa));
        }
        lines.extend(scenes.iter().map(|hash| format!("scene {hash}")));
        lines.extend(plan.project.lights.iter().map(|light| format!("{:?} {:?}", light.direction, light.color)));
        let placed = plan.project.lights.iter().filter(|light| light.direction.is_none());
        lines.extend(placed.map(|light| format!("{:?} {:?}", light.position, light.falloff)));
        for (target, planned) in plan.project.targets.iter().zip(&plan.targets) {
            let formats: Vec<_> = target.channels.iter().map(|channel| channel.format).collect();
            lines.push(format!("{planned:?} {formats:?}"));
            lines.extend(target.contents.map(|contents| format!("{contents:?}")));
        }
        for planned in &plan.passes {
            let pass = plan.pass(planned);
            lines.push(format!("{:?} {:?} {:?}", planned.work, pass.target, pass.kind));
        }
        lines.join("\n")
    }

    /// Description of the reference.
    pub fn words(&self, samples: u32) -> String {
        match self.kind {
            Kind::Raster => {
                "the cpu rasteriser's picture: nothing is traced, and that rasteriser's own rows agree with it by \
                 construction"
                    .to_owned()
            }
            Kind::Exact => "corrected programs, rays in f64 from the cpu rasteriser's G-buffer".to_owned(),
            Kind::Converged => {
                format!("corrected programs, mean of 2 renders of {samples} samples from the cpu rasteriser's G-buffer")
            }
        }
    }
}

/// Replaces a pass by its best version: raster effects by rays. The pass's own number of samples is replaced later, by
/// [`ReferenceRays`](super::rays::ReferenceRays).
fn at_its_best(pass: &mut Pass, set: &[String]) -> Result<(), String> {
    let own = set.iter().filter_map(|assignment| {
        let (key, value) = assignment.split_once('=')?;
        let (name, parameter) = key.rsplit_once('.')?;
        // `TEXTURE.format` is no parameter of a pass: references keep the formats that the project declares.
        (name == pass.name && parameter != "format").then_some((parameter, value.trim()))
    });
    match &mut pass.kind {
        PassKind::Ray(ray) => {
            for (name, value) in own {
                ray.params.set(name, value)?;
            }
        }
        PassKind::Effect(effect) => {
            for (name, value) in own {
                effect.params.set(name, value)?;
            }
            pass.kind = PassKind::Ray(by_rays(effect));
        }
        PassKind::Raster(_) | PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => {}
    }
    if let PassKind::Ray(ray) = &mut pass.kind {
        ray.params.sampler = Sampler::Sobol;
        if ray.params.fresnel == Fresnel::Schlick {
            ray.params.fresnel = Fresnel::Exact;
        }
        ray.params.samples = ray.params.samples.min(1);
        ray.params.sun_samples = 1;
        ray.params.filter = 0;
        // No adaptive sampling: every pixel takes all `paths`.
        ray.params.error = 0.0;
    }
    Ok(())
}

/// The ray pass that corresponds to an effect pass, with the constants that both have.
fn by_rays(effect: &EffectPass) -> RayPass {
    let EffectPass { scenes, camera, lights, position, normal, color, colors, glass, program, .. } = effect.clone();
    let counterpart = program.info().counterpart;
    // Channels that the rays do not read need not be drawn, so the reference equals that of the ray project.
    let read = |channel: Option<ChannelRef>, name: &str| channel.filter(|_| counterpart.info().buffers.contains(&name));
    RayPass {
        scenes,
        camera,
        lights,
        program: counterpart,
        params: effect.params.by_rays(),
        position: read(position, "pos_buffer"),
        normal: read(normal, "norm_buffer"),
        color: read(color, "color_buffer"),
        colors,
        glass,
        shadow_glass: Vec::new(),
        from_camera: None,
    }
}

fn kind_of(plan: &Plan, planned: &PlannedPass) -> Kind {
    match (&planned.work, &plan.pass(planned).kind) {
        (Work::Rays { params, .. }, PassKind::Ray(ray)) if ray.program.can_trace(params) => {
            let info = ray.program.info();
            let noise = info.samples(params) > 0 || info.sun_samples(params) > 0;
            if noise { Kind::Converged } else { Kind::Exact }
        }
        _ => Kind::Raster,
    }
}
