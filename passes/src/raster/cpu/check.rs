//! Checks of jobs, and the errors for those that this rasteriser refuses.

use super::frame::MAX_TRIANGLES;
use super::surface::TILE;
use super::vertex::MAX_SIDE;
use crate::raster::check;
use curitiba_pipeline::backend::{BackendError, GBuffer, RasterJob, Rect};

fn refuse(what: &str, why: String) -> Result<(), BackendError> {
    Err(BackendError::Unsupported { backend: "cpu", what: what.to_owned(), why })
}

/// Refuses targets in which an attachment of the job does not have one value for each pixel. The same holds for the depth, if the job loads or
/// stores it or the target has one.
pub(super) fn target(job: &RasterJob<'_>, target: &GBuffer) -> Result<(), BackendError> {
    let asked = job.attachments;
    let pixels = target.width as usize * target.height as usize;
    let sizes = [
        ("color", asked.color, target.color.len()),
        ("position", asked.position, target.position.len()),
        ("normal", asked.normal, target.normal.len()),
        ("triangle", asked.triangle, target.triangle.len()),
    ];
    let depth = job.load_store.load_depth || job.load_store.store_depth || !target.depth.is_empty();
    let sizes = sizes.into_iter().chain([("depth", depth, target.depth.len())]);
    if let Some((name, ..)) = sizes.into_iter().find(|(_, asked, len)| *asked && *len != pixels) {
        return refuse("this target", format!("its attachment `{name}` is not allocated"));
    }
    Ok(())
}

/// The error for a target that does not end with whole tiles.
pub(super) fn between_tiles(viewport: Rect, held: Rect) -> BackendError {
    let why = format!("{held:?} of {viewport:?} does not end with tiles of {TILE} x {TILE} pixels");
    BackendError::Unsupported { backend: "cpu", what: "a part of the picture".to_owned(), why }
}

/// Refuses jobs that this rasteriser cannot draw, or whose parts do not fit together.
pub(super) fn scene(job: &RasterJob<'_>, held: Rect) -> Result<(), BackendError> {
    let view = job.viewport;
    // The grid of tiles checks that viewport and target overlap in whole tiles.
    let ends = |rect: Rect| rect.x.checked_add(rect.width).is_some() && rect.y.checked_add(rect.height).is_some();
    if !ends(view) || !ends(held) {
        return refuse("this viewport", format!("{view:?} or {held:?} ends beyond all pixels"));
    }
    if view.width > MAX_SIDE || view.height > MAX_SIDE {
        let size = format!("{} x {} pixels", view.width, view.height);
        return refuse("this size", format!("a viewport of {size} has a side above {MAX_SIDE}; draw it in blocks"));
    }
    if job.scene.geometry.triangles.len() > MAX_TRIANGLES {
        return refuse("this scene", format!("it has more than {MAX_TRIANGLES} triangles; split it"));
    }
    check::scene(job).or_else(|(what, why)| refuse(what, why))
}
