//! Curitiba: rasterisation and ray tracing in one deferred pipeline, driven by XML projects.
//!
//! ```no_run
//! use curitiba::pipeline::executor::Silent;
//! use curitiba::pipeline::image::write_png;
//! use curitiba::pipeline::plan::Settings;
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let settings = Settings { size: Some([512, 512]), ..Settings::default() };
//!     let mut renderer = curitiba::open("xml_projects/SceneFinal.xml", settings, curitiba::Choice::default(), &mut Silent)?;
//!     let picture = renderer.frame(&mut Silent)?;
//!     write_png("final.png".as_ref(), &picture)?;
//!     for row in &renderer.timeline().rows {
//!         println!("{:9} {:20} {:8.2} ms", row.kind.name(), row.name, row.median_ms());
//!     }
//!     Ok(())
//! }
//! ```
//!
//! A [`Renderer`] has setters. `update` runs only the passes that depend on a change, `accumulate` takes more and more samples of a
//! sequence, and `cancellation` cancels a frame: see `docs/library.md`.
//!
//! Everything that the command line (`curitiba --help`) does is available in this library: [`open`] reads a project, makes its plan
//! and loads its scenes; [`Renderer::frame`](pipeline::executor::Renderer::frame) renders.
#![forbid(unsafe_code)]

pub mod args;
pub mod bench;
pub mod camera_path;
pub mod compare;
pub mod conformance;
pub mod engines;
pub mod environment;
pub mod fastest;
pub mod reference;
pub mod report;
pub mod shard;
pub mod spec;
pub mod threads;
pub mod trace_events;
pub mod tune;
pub mod visibility;

#[cfg(feature = "cuda")]
pub use curitiba_cuda as cuda;
pub use curitiba_passes as passes;
pub use curitiba_pipeline as pipeline;
pub use engines::{BackendChoice, Choice, Gpus, RasterChoice};

/// The examples of `docs/architecture.md`, which are compiled.
#[cfg(doctest)]
#[doc = include_str!("../docs/architecture.md")]
pub struct Architecture;

use pipeline::diagnostic::Problems;
use pipeline::executor::{Engines, Observer, RenderError, Renderer};
use pipeline::plan::{Plan, PlanError, PlannedPass, Settings};
use pipeline::project::{Project, SourceError};
use pipeline::scene::SceneError;
use std::path::Path;

/// Why a project could not be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The project file or a material library is in error; contains all problems.
    #[error(transparent)]
    Project(#[from] Problems),
    /// A scene file is in error, or the file is neither a scene nor a project.
    #[error(transparent)]
    Source(#[from] SceneError),
    /// Options for scene files were given for a project, a project was named with other files, or options do not fit the scene.
    #[error("{0}")]
    Option(String),
    /// The settings do not fit the project.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A requested engine is not available; the error concerns no particular pass.
    #[error(transparent)]
    Engine(#[from] pipeline::backend::BackendError),
    /// A scene could not be loaded, or a backend failed.
    #[error(transparent)]
    Render(#[from] RenderError),
}

impl OpenError {
    /// The message in one line, for tables: problems are joined by semicolons.
    #[must_use]
    pub fn joined(&self) -> String {
        match self {
            Self::Project(problems) => problems.0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
            other => other.to_string(),
        }
    }
}

impl From<SourceError> for OpenError {
    fn from(error: SourceError) -> Self {
        match error {
            SourceError::Project(problems) => Self::Project(problems),
            SourceError::Scene(error) => Self::Source(error),
            SourceError::Option(message) => Self::Option(message),
            error => Self::Option(error.to_string()),
        }
    }
}

/// Reads a project, makes its plan, chooses engines, loads the scenes and builds what the plan needs. `project` may also be a scene
/// file or a folder of scene files: [`Settings::scene`] then says how to make a project.
///
/// # Errors
/// All problems of the project's files together, or the first error of the later steps.
pub fn open(
    project: impl AsRef<Path>,
    settings: Settings,
    choice: Choice,
    observer: &mut dyn Observer,
) -> Result<Renderer, OpenError> {
    let project = settings.open(project.as_ref())?;
    open_project(project, settings, choice, observer)
}

/// [`open`] for a project in memory, such as one that was read and changed.
///
/// # Errors
/// The first error of the steps after reading.
pub fn open_project(
    project: Project,
    settings: Settings,
    choice: Choice,
    observer: &mut dyn Observer,
) -> Result<Renderer, OpenError> {
    let plan = Plan::new(project, settings)?;
    let (raster, rays, own) = engines::parts(choice.for_plan(&plan))?;
    let engines = Engines::first_of(raster, rays).map_err(|error| {
        // A missing ray backend is reported for the first pass that needs it.
        let rays = |planned: &&PlannedPass| plan.traced(planned).is_some();
        match plan.passes.iter().find(rays) {
            Some(planned) => RenderError::Pass { pass: plan.pass(planned).name.clone(), frame: None, error }.into(),
            None => OpenError::Engine(error),
        }
    })?;
    Ok(Renderer::new(plan, engines.with_own(own), observer)?)
}
