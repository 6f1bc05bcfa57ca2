//! References on demand: of the picture, or of the effect with a chosen number of samples; as a whole, or the blocks of a shard.

use super::blocks::{Blocks, Done, Part};
use super::picture;
use super::plan::{Kind, Request};
use super::{
    Held, PICTURE_BLOCK, Reference, ReferenceError, References, from_the_camera, material, picture_material,
    picture_reference,
};
use crate::bench::Case;
use crate::passes::reference as renderer_of_pictures;
use crate::pipeline::executor::{Observer, Progress, StepKind};
use crate::shard::Shard;
use std::sync::Arc;
use std::time::Duration;

/// Kind of reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Of {
    /// Reference of the picture.
    Picture,
    /// Reference of the effect.
    Effect,
}

/// Result of [`References::make`].
#[derive(Debug, Clone)]
pub enum Made {
    /// The reference, and the time of rendering it; `None` if it was stored already.
    Whole(Reference, Option<Duration>),
    /// The blocks of a shard.
    Part(Part),
}

impl References {
    /// Renders and stores a reference of a case, unless it is stored already. For the picture `samples` is the number of samples a pixel, a power
    /// of two within [`PICTURE_SAMPLES`](super::PICTURE_SAMPLES), and a stored reference with more is returned instead. For the effect, `samples`
    /// is the number in each of the two renders, 1 to [`MOST_SAMPLES`](super::MOST_SAMPLES), and a stored reference must have exactly that number.
    ///
    /// Large numbers of samples are divided into blocks. A shard renders and stores its blocks; a later request for the whole joins
    /// the stored blocks and renders missing ones. The picture is the same, bit for bit, whoever rendered the blocks.
    ///
    /// # Errors
    /// If the picture contains something that the reference renderer does not support, the effect has no noise, rendering fails, or
    /// a block of a shard cannot be stored.
    pub fn make(
        &mut self,
        case: &Case,
        of: Of,
        samples: u32,
        shard: Shard,
        observer: &mut dyn Observer,
    ) -> Result<Made, ReferenceError> {
        match of {
            Of::Picture => self.make_picture(case, samples, shard, observer),
            Of::Effect => self.make_effect(case, samples, shard, observer),
        }
    }

    fn make_picture(
        &mut self,
        case: &Case,
        samples: u32,
        shard: Shard,
        observer: &mut dyn Observer,
    ) -> Result<Made, ReferenceError> {
        let request = Request::of_picture(case)?;
        if let Some(why) = picture::unsupported(&request.plan) {
            return Err(ReferenceError::Picture(why));
        }
        let base = self.base_of_picture(&request, observer)?;
        let old = self.kept_picture(&request, &base).map(|reference| reference.samples);
        if let Some(reference) = self.pictures.get(&base).filter(|reference| reference.samples >= samples) {
            return Ok(Made::Whole(reference.clone(), None));
        }
        let block = samples.min(PICTURE_BLOCK);
        let folder = self.folder_of_pictures.clone();
        let blocks = Blocks {
            folder: &folder,
            base: format!("{}, blocks of {block} samples", from_the_camera(&base)),
            count: samples / block,
            size: request.plan.window,
        };
        let mut warnings = Vec::new();
        let open = self.open(&request, observer)?;
        let done = blocks.work(shard, &mut warnings, &mut |index| {
            // Each of the two estimates takes half of the samples.
            let range = index * (block / 2)..(index + 1) * (block / 2);
            let job = picture::job(&open.renderer, range).map_err(ReferenceError::Picture)?;
            let progress = Arc::new(Progress::until(&open.renderer.cancellation()));
            let name =
                if blocks.count == 1 { String::new() } else { format!(", block {} of {}", index + 1, blocks.count) };
            observer.begin(StepKind::Rays, &format!("reference of the picture{name}"), &progress);
            let rendered = renderer_of_pictures::render(&job, &progress);
            observer.end();
            Ok(rendered?)
        })?;
        self.warnings.append(&mut warnings);
        let entry = match done {
            Done::Part(part) => return Ok(Made::Part(part)),
            Done::Whole(entry) => entry,
        };
        let took = entry.took;
        match folder.store(&picture_material(&base, samples), &entry) {
            Err(why) => self.warnings.push(why),
            Ok(()) => {
                old.iter().for_each(|old| folder.forget(&picture_material(&base, *old)));
                blocks.forget();
            }
        }
        let reference = picture_reference(&base, samples, entry);
        self.pictures.insert(base, reference.clone());
        Ok(Made::Whole(reference, Some(took)))
    }

    fn make_effect(
        &mut self,
        case: &Case,
        samples: u32,
        shard: Shard,
        observer: &mut dyn Observer,
    ) -> Result<Made, ReferenceError> {
        let request = Request::new(case)?;
        if request.kind != Kind::Converged {
            return Err(ReferenceError::NoNoise);
        }
        let base = self.base(&request, observer)?;
        match self.folder.load(&material(&base, samples), request.plan.window) {
            Ok(Some(entry)) => {
                self.hold(&request, &base, samples, entry, Duration::ZERO);
                return Ok(Made::Whole(self.held[&base].reference.clone(), None));
            }
            Ok(None) => {}
            Err(why) => self.warnings.push(format!("{why}; it is rendered again")),
        }
        if let Some(part) = self.render(&request, &base, samples, shard, observer)? {
            return Ok(Made::Part(part));
        }
        let Held { reference, took, .. } = &self.held[&base];
        Ok(Made::Whole(reference.clone(), Some(*took)))
    }
}
