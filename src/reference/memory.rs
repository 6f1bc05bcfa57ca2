//! References of pictures of projects in memory.

use super::cache::Folder;
use super::plan::Request;
use super::{Reference, ReferenceError, References, mean_of_two, picture, picture_material};
use crate::passes::reference as renderer_of_pictures;
use crate::pipeline::color::Display;
use crate::pipeline::executor::{Cancellation, Observer, Progress, StepKind};
use crate::pipeline::plan::Settings;
use crate::pipeline::project::Project;
use std::sync::Arc;

/// A reference of the picture of a project in memory.
#[derive(Debug, Clone)]
pub struct InMemory {
    /// The reference.
    pub reference: Reference,
    /// How its picture is displayed.
    pub display: Display,
}

impl References {
    /// The reference of the picture of a project in memory, such as one whose camera was moved: the stored one with the most samples, if
    /// there is one and [`confine`](crate::pipeline::files::confine) lets its folder be read; otherwise one with `samples` a pixel, an
    /// even number, which is rendered and not stored. `stop` cancels it.
    ///
    /// # Errors
    /// If the picture contains something that the reference renderer does not support, or rendering fails or is cancelled.
    pub fn picture_of(
        &mut self,
        project: Project,
        settings: &Settings,
        samples: u32,
        stop: &Cancellation,
        observer: &mut dyn Observer,
    ) -> Result<InMemory, ReferenceError> {
        let request = Request::of_picture_of(project, settings)?;
        if let Some(why) = picture::unsupported(&request.plan) {
            return Err(ReferenceError::Picture(why));
        }
        let display = request.plan.display;
        let base = self.base_of_picture(&request, observer)?;
        if self.folder_of_pictures.is_allowed()
            && let Some(reference) = self.kept_picture(&request, &base)
        {
            return Ok(InMemory { reference: reference.clone(), display });
        }
        let open = self.open(&request, observer)?;
        // Each of the two estimates takes half of the samples.
        let job = picture::job(&open.renderer, 0..(samples / 2).max(1)).map_err(ReferenceError::Picture)?;
        let progress = Arc::new(Progress::until(stop));
        observer.begin(StepKind::Rays, "reference of the picture", &progress);
        let rendered = renderer_of_pictures::render(&job, &progress);
        observer.end();
        let [first, second] = rendered?;
        let (picture, own_error) = mean_of_two(first, &second);
        let (what, key) = (picture::words(samples), Folder::key(&picture_material(&base, samples)));
        Ok(InMemory { reference: Reference { picture, what, key, own_error, samples }, display })
    }
}
