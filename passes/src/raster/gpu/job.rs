//! Checks whether the scene and the target of a job have the data that the job needs.

use super::faults::unsupported;
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

/// Refuses scenes that lack data that the job reads.
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
        if shade.vertex_colors
            && (job.attachments.color || shade.alpha_cutoff.is_some())
            && geometry.colors.len() != vertices
        {
            return Err(unsupported("vertex colours", "the scene was loaded without;"));
        }
        let color = shade.texture.filter(|_| job.attachments.color || shade.alpha_cutoff.is_some());
        let glow = shade.glow.and_then(|glow| glow.texture).filter(|_| job.attachments.color);
        let Attachments { color: lit, position, normal, .. } = job.attachments;
        let bends = (lit || position || normal) && !geometry.normals.is_empty();
        let normals = shade.normal_map.map(|map| map.texture).filter(|_| bends);
        if normals.is_some() && geometry.tangents.len() != vertices {
            return Err(unsupported("normal maps", "the scene was loaded without tangents;"));
        }
        for texture in [color, glow, normals].into_iter().flatten() {
            if texture as usize >= job.scene.textures.len() {
                return Err(unsupported("this scene", &format!("it has no texture {texture};")));
            }
            if geometry.texcoords.len() != vertices {
                let why = "the scene was loaded without texture coordinates;";
                return Err(unsupported("a textured material", why));
            }
        }
    }
    Ok(())
}
