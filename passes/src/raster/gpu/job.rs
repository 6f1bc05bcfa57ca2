//! Whether the parts of a job fit together.

use super::device::unsupported;
use curitiba_pipeline::backend::{Attachments, BackendError, GBuffer, RasterJob, Rect};

/// Whether nothing is to be drawn.
pub(super) fn is_empty(job: &RasterJob<'_>) -> bool {
    job.attachments == Attachments::default() || job.viewport.width == 0 || job.viewport.height == 0
}

/// Refuses targets that lack what the job writes.
pub(super) fn check_target(job: &RasterJob<'_>, target: &GBuffer) -> Result<(), BackendError> {
    let Rect { x, y, width, height } = job.viewport;
    let inside = |start: u32, length: u32, size: u32| start.checked_add(length).is_some_and(|end| end <= size);
    if !inside(x, width, target.width) || !inside(y, height, target.height) {
        let why = format!("{:?} is not inside {} x {};", job.viewport, target.width, target.height);
        return Err(unsupported("this viewport", &why));
    }
    let pixels = target.width as usize * target.height as usize;
    let Attachments { color, position, normal, triangle } = job.attachments;
    let channels = [
        ("color", color, target.color.len()),
        ("position", position, target.position.len()),
        ("normal", normal, target.normal.len()),
        ("triangle", triangle, target.triangle.len()),
    ];
    match channels.into_iter().find(|(_, wanted, length)| *wanted && *length != pixels) {
        Some((name, _, length)) => {
            let why = format!("its attachment `{name}` has {length} pixels, not {pixels};");
            Err(unsupported("this target", &why))
        }
        None => Ok(()),
    }
}

/// Refuses scenes that lack what the job reads.
pub(super) fn check_scene(job: &RasterJob<'_>) -> Result<(), BackendError> {
    let geometry = &job.scene.geometry;
    let vertices = geometry.positions.len();
    if job.attachments.normal && geometry.normals.len() != vertices {
        return Err(unsupported("the attachment `normal`", "the scene was loaded without normals;"));
    }
    for batch in &geometry.batches {
        let Some(shade) = job.shades.get(batch.material as usize) else {
            return Err(unsupported("this scene", &format!("material {} has no colours;", batch.material)));
        };
        let Some(texture) = shade.texture.filter(|_| job.attachments.color || shade.alpha_cutoff.is_some()) else {
            continue;
        };
        if texture as usize >= job.scene.textures.len() {
            return Err(unsupported("this scene", &format!("it has no texture {texture};")));
        }
        if geometry.texcoords.len() != vertices {
            let why = "the scene was loaded without texture coordinates;";
            return Err(unsupported("a textured material", why));
        }
    }
    Ok(())
}
