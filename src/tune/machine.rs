//! This machine: variants as project files, rendered and compared with their reference.

use super::candidates::{Slot, slots};
use super::{Machine, Run};
use crate::bench::model::RowError;
use crate::bench::{Case, MeasureOptions, measure};
use crate::pipeline::executor::Observer;
use crate::pipeline::kept_scenes::KeptScenes;
use crate::pipeline::metrics::MetricInfo;
use crate::pipeline::plan::{Plan, Settings, resize};
use crate::pipeline::project::{Project, SceneOptions};
use crate::reference::{Of, ReferenceError, References};
use crate::{Choice, OpenError};
use std::path::{Path, PathBuf};

/// A project whose variants are measured.
pub struct Bench<'a> {
    project: Project,
    pipeline: usize,
    slots: Vec<Slot>,
    settings: Settings,
    choice: Choice,
    options: MeasureOptions,
    metric: &'static MetricInfo,
    of: Of,
    /// The declared project. If whole pictures are judged, all variants are compared with the reference of its picture.
    declared: Case,
    references: References,
    folder: PathBuf,
    observer: &'a mut dyn Observer,
}

/// What stays the same for all variants.
pub struct Request<'a> {
    /// Path of the project or scene.
    pub path: &'a Path,
    /// Settings of the project.
    pub settings: Settings,
    /// The choice of engines.
    pub choice: Choice,
    /// Frames of each run.
    pub options: MeasureOptions,
    /// Metric of a picture's error; lower is better.
    pub metric: &'static MetricInfo,
    /// Whether the error is that of the effect or of the whole picture.
    pub of: Of,
}

impl<'a> Bench<'a> {
    /// Reads a project and finds its candidates. Variants are written into `folder`, which must be empty.
    ///
    /// # Errors
    /// All problems of the project's files together, or why its plan cannot be made.
    pub fn open(
        request: Request<'_>,
        references: References,
        folder: &Path,
        observer: &'a mut dyn Observer,
    ) -> Result<Self, OpenError> {
        let Request { path, settings, choice, options, metric, of } = request;
        let declared = Case::new(path, settings.clone(), choice)?;
        let plan = Plan::new(settings.open(path)?, settings)?;
        let slots = slots(&plan);
        let Plan { mut project, pipeline, mut settings, .. } = plan;
        // The candidates contain the parameters already, and written projects contain camera and size.
        if let Some(size) = settings.size {
            resize(&mut project, pipeline, size);
        }
        settings.set.retain(|assignment| assignment.split('=').next().is_some_and(|key| key.ends_with(".format")));
        settings.scene = SceneOptions::default();
        settings.scenes = KeptScenes::shared();
        let folder = folder.to_owned();
        Ok(Self {
            project,
            pipeline,
            slots,
            settings,
            choice,
            options,
            metric,
            of,
            declared,
            references,
            folder,
            observer,
        })
    }

    /// The passes that have candidates.
    #[must_use]
    pub fn slots(&self) -> &[Slot] {
        &self.slots
    }

    /// The project with the candidates of a variant.
    #[must_use]
    pub fn project(&self, variant: &[usize]) -> Project {
        let mut project = self.project.clone();
        for (slot, candidate) in self.slots.iter().zip(variant) {
            project.pipelines[self.pipeline].passes[slot.pass].kind = slot.candidates[*candidate].kind.clone();
        }
        project
    }

    /// The standard error of the reference with which whole pictures are compared. `None` where effects are judged, since references of effects are
    /// made when they are needed.
    ///
    /// # Errors
    /// If the reference of the picture is not stored, with the command that makes it; or if the picture cannot have a reference.
    pub fn check_reference(&mut self) -> Result<Option<f64>, ReferenceError> {
        match self.of {
            Of::Effect => Ok(None),
            Of::Picture => Ok(Some(self.references.picture(&self.declared, self.observer)?.own_error)),
        }
    }

    /// Renders a project file and judges its picture, in the same way as for a variant.
    ///
    /// # Errors
    /// Why it cannot be rendered or judged.
    pub fn run_file(&mut self, path: &Path) -> Result<Run, String> {
        let case = Case::new(path, self.settings.clone(), self.choice).map_err(|error| error.joined())?;
        let measured = measure(&case, &self.options, self.observer).map_err(|error| error.joined())?;
        let (frames_ms, picture) = (measured.row.frame.samples, measured.picture);
        // Frees the project's scene before the reference's scene is loaded.
        drop(measured.renderer);
        let compared = match self.of {
            Of::Effect => self.references.compare(&case, &picture, self.observer),
            Of::Picture => self.references.compare_picture(&self.declared, &picture, self.observer),
        };
        match compared.map_err(|error| error.to_string())? {
            RowError::Against { comparison, .. } => Ok(Run { frames_ms, error: (self.metric.value)(&comparison) }),
            RowError::Missing(why) => Err(why),
        }
    }

    /// Returns and clears warnings about the references' folder.
    pub fn take_warnings(&mut self) -> Vec<String> {
        self.references.take_warnings()
    }
}

impl Machine for Bench<'_> {
    fn run(&mut self, variant: &[usize]) -> Result<Run, String> {
        let name: Vec<String> = variant.iter().map(ToString::to_string).collect();
        let path = self.folder.join(format!("variant-{}.xml", name.join("-")));
        if !path.exists() {
            self.project(variant).write(&path).map_err(|error| error.to_string())?;
        }
        self.run_file(&path)
    }
}
