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
//! [`Renderer`] has setters, `update` runs only the passes that depend on what was set, `accumulate` takes more and more samples of one
//! sequence, and `cancellation` gives a frame up: `docs/library.md`.
//!
//! The command line (`curitiba --help`) does nothing that this library cannot: [`open`] reads a project, makes its plan
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
    /// The project file or a material library; holds every problem of them.
    #[error(transparent)]
    Project(#[from] Problems),
    /// A scene file of which a project was to be made, or a file that is neither.
    #[error(transparent)]
    Source(#[from] SceneError),
    /// Options that do not fit what is named.
    #[error("{0}")]
    Option(String),
    /// The settings do not fit the project.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// No engine of the kind that was asked for, and no pass that would use it.
    #[error(transparent)]
    Engine(#[from] pipeline::backend::BackendError),
    /// A scene, or a backend.
    #[error(transparent)]
    Render(#[from] RenderError),
}

impl OpenError {
    /// The message for a row of a table: problems are joined by semicolons.
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

/// Reads a project, makes its plan, chooses engines, loads the scenes and builds what the plan needs. `project` may also be a
/// scene file or a folder of them: [`Settings::scene`] says what project is made of it.
///
/// # Errors
/// All problems of the project's files together; or the first of what follows.
pub fn open(
    project: impl AsRef<Path>,
    settings: Settings,
    choice: Choice,
    observer: &mut dyn Observer,
) -> Result<Renderer, OpenError> {
    let project = settings.open(project.as_ref())?;
    open_project(project, settings, choice, observer)
}

/// [`open`] for a project that is there already: one that was read and changed, or made in memory.
///
/// # Errors
/// The first of what follows reading.
pub fn open_project(
    project: Project,
    settings: Settings,
    choice: Choice,
    observer: &mut dyn Observer,
) -> Result<Renderer, OpenError> {
    let plan = Plan::new(project, settings)?;
    let (raster, rays, own) = engines::parts(choice.for_plan(&plan))?;
    let engines = Engines::first_of(raster, rays).map_err(|error| {
        // What is missing matters to the pass that would use it.
        let rays = |planned: &&PlannedPass| plan.traced(planned).is_some();
        match plan.passes.iter().find(rays) {
            Some(planned) => RenderError::Pass { pass: plan.pass(planned).name.clone(), frame: None, error }.into(),
            None => OpenError::Engine(error),
        }
    })?;
    Ok(Renderer::new(plan, engines.with_own(own), observer)?)
}
