//! Checks whether the scene and the target of a job have the data that the job needs.

use super::faults::unsupported;
use crate::raster::check;
use curitiba_pipeline::backend::{Attachments, BackendError, GBuffer, RasterJob, drawn_part};

/// Whether the job draws nothing.
pub(super) fn is_empty(job: &RasterJob<'_>) -> bool {
    job.attachments == Attachments::default() || job.viewport.width == 0 || job.viewport.height == 0
}

/// Refuses targets whose part of the job's viewport is empty or does not end with whole tiles, and targets that lack an attachment that the job
/// writes, or the depth that it loads or stores.
pub(super) fn check_target(job: &RasterJob<'_>, target: &GBuffer) -> Result<(), BackendError> {
    if !is_empty(job) && drawn_part(job.viewport, target.held()).is_none() {
        let held = format!("{} x {} from {:?}", target.width, target.height, target.origin);
        return Err(unsupported("this viewport", &format!("{:?} is not inside {held};", job.viewport)));
    }
    let pixels = target.width as usize * target.height as usize;
    let Attachments { color, position, normal, triangle } = job.attachments;
    let channels = [
        ("color", color, target.color.len()),
        ("position", position, target.position.len()),
        ("normal", normal, target.normal.len()),
        ("triangle", triangle, target.triangle.len()),
        ("depth", job.load_store.load_depth || job.load_store.store_depth, target.depth.len()),
    ];
    match channels.into_iter().find(|(_, wanted, length)| *wanted && *length != pixels) {
        Some((name, _, length)) => {
            let why = format!("its attachment `{name}` has {length} pixels, not {pixels};");
            Err(unsupported("this target", &why))
        }
        None => Ok(()),
    }
}

/// Refuses jobs whose scene lacks data that the job reads, or whose parts do not fit together.
pub(super) fn check_scene(job: &RasterJob<'_>) -> Result<(), BackendError> {
    check::scene(job).map_err(|(what, why)| unsupported(what, &format!("{why};")))
}
