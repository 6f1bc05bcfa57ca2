//! What of a job this rasteriser refuses.

use super::frame::MAX_TRIANGLES;
use super::vertex::MAX_SIDE;
use curitiba_pipeline::backend::{BackendError, GBuffer, RasterJob};

fn refuse(what: &str, why: String) -> Result<(), BackendError> {
    Err(BackendError::Unsupported { backend: "cpu", what: what.to_owned(), why })
}

/// Refuses targets that lack an attachment.
pub(super) fn target(job: &RasterJob<'_>, target: &GBuffer) -> Result<(), BackendError> {
    let asked = job.attachments;
    let pixels = target.width as usize * target.height as usize;
    let sizes = [
        ("color", asked.color, target.color.len()),
        ("position", asked.position, target.position.len()),
        ("normal", asked.normal, target.normal.len()),
        ("triangle", asked.triangle, target.triangle.len()),
    ];
    if let Some((name, ..)) = sizes.into_iter().find(|(_, asked, len)| *asked && *len != pixels) {
        return refuse("this target", format!("its attachment `{name}` is not allocated"));
    }
    Ok(())
}

/// Refuses jobs that this rasteriser cannot do or whose parts do not fit together.
pub(super) fn scene(job: &RasterJob<'_>, (width, height): (u32, u32)) -> Result<(), BackendError> {
    let (view, geometry, asked) = (job.viewport, &job.scene.geometry, job.attachments);
    let inside = |start: u32, side: u32, whole: u32| start.checked_add(side).is_some_and(|end| end <= whole);
    if !inside(view.x, view.width, width) || !inside(view.y, view.height, height) {
        return refuse("this viewport", format!("{view:?} is not inside {} x {}", width, height));
    }
    if width > MAX_SIDE || height > MAX_SIDE {
        return refuse("this size", format!("sides are at most {MAX_SIDE} pixels; render it in parts"));
    }
    if geometry.triangles.len() > MAX_TRIANGLES {
        return refuse("this scene", format!("it has more than {MAX_TRIANGLES} triangles; split it"));
    }
    let vertices = geometry.positions.len();
    if asked.normal && geometry.normals.len() != vertices {
        return refuse("the attachment `normal`", "the scene was loaded without normals".to_owned());
    }
    if !geometry.normals.is_empty() && geometry.normals.len() != vertices {
        return refuse("this scene", "it has not as many normals as positions".to_owned());
    }
    for batch in &geometry.batches {
        let Some(shade) = job.shades.get(batch.material as usize) else {
            return refuse("this scene", format!("material {} has no colours", batch.material));
        };
        if (batch.first as usize).saturating_add(batch.count as usize) > geometry.triangles.len() {
            return refuse("this scene", "a batch reaches beyond the triangles".to_owned());
        }
        if let Some(texture) = shade.texture.filter(|_| asked.color || shade.alpha_cutoff.is_some()) {
            if texture as usize >= job.scene.textures.len() {
                return refuse("this scene", format!("it has no texture {texture}"));
            }
            if geometry.texcoords.len() != vertices {
                return refuse("a textured material", "the scene was loaded without texture coordinates".to_owned());
            }
        }
    }
    Ok(())
}
