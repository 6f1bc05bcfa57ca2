//! The check of jobs that both rasterisers make.

use curitiba_pipeline::backend::RasterJob;

/// What cannot be drawn, and why.
pub(in crate::raster) type Refusal = (&'static str, String);

/// Refuses jobs whose scene lacks data that the job reads, or whose parts do not fit together.
pub(in crate::raster) fn scene(job: &RasterJob<'_>) -> Result<(), Refusal> {
    let (geometry, asked) = (&job.scene.geometry, job.attachments);
    let vertices = geometry.positions.len();
    if asked.normal && geometry.normals.len() != vertices {
        return Err(("the attachment `normal`", "the scene was loaded without normals".to_owned()));
    }
    if !geometry.normals.is_empty() && geometry.normals.len() != vertices {
        return Err(("this scene", "it has not as many normals as positions".to_owned()));
    }
    if let Some(sphere) = geometry.spheres.iter().find(|sphere| sphere.material as usize >= job.shades.len()) {
        return Err(("this scene", format!("material {} has no colours", sphere.material)));
    }
    for batch in &geometry.batches {
        let Some(shade) = job.shades.get(batch.material as usize) else {
            return Err(("this scene", format!("material {} has no colours", batch.material)));
        };
        if (batch.first as usize).saturating_add(batch.count as usize) > geometry.triangles.len() {
            return Err(("this scene", "a batch reaches beyond the triangles".to_owned()));
        }
        let tested = asked.color || shade.alpha_cutoff.is_some();
        if shade.vertex_colors && tested && geometry.colors.len() != vertices {
            return Err(("vertex colours", "the scene was loaded without".to_owned()));
        }
        let color = shade.texture.filter(|_| tested);
        let glow = shade.glow.and_then(|glow| glow.texture).filter(|_| asked.color);
        let bends = (asked.color || asked.position || asked.normal) && !geometry.normals.is_empty();
        let normals = shade.normal_map.map(|map| map.texture).filter(|_| bends);
        if normals.is_some() && geometry.tangents.len() != vertices {
            return Err(("normal maps", "the scene was loaded without tangents".to_owned()));
        }
        for texture in [color, glow, normals].into_iter().flatten() {
            if texture as usize >= job.scene.textures.len() {
                return Err(("this scene", format!("it has no texture {texture}")));
            }
            if geometry.texcoords.len() != vertices {
                return Err(("a textured material", "the scene was loaded without texture coordinates".to_owned()));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::backend::{Attachments, Glow, LoadStore, NormalMap, Rect, Shade, View};
    use curitiba_pipeline::programs::RasterProgram;
    use curitiba_pipeline::scene::texture::Texture;
    use curitiba_pipeline::scene::{Batch, Geometry, RenderScene, Sphere};
    use glam::{Mat4, Vec2, Vec3, Vec4};

    const COLOR: Attachments = Attachments { color: true, position: false, normal: false, triangle: false };
    const TRIANGLE: Attachments = Attachments { color: false, triangle: true, ..COLOR };

    /// The refusal of a job for one triangle with one texture, without vertex colours and tangents, after `edit`.
    fn refusal(attachments: Attachments, edit: impl FnOnce(&mut RenderScene, &mut Shade)) -> Option<Refusal> {
        let geometry = Geometry {
            positions: vec![Vec3::ZERO; 3],
            normals: vec![Vec3::Y; 3],
            texcoords: vec![Vec2::ZERO; 3],
            triangles: vec![[0, 1, 2]],
            batches: vec![Batch { material: 0, first: 0, count: 1 }],
            ..Geometry::default()
        };
        let textures = vec![Texture::new("white".to_owned(), 1, 1, vec![[255; 4]])];
        let (mut changed, mut shade) = (RenderScene { geometry, textures, ..RenderScene::default() }, Shade::WHITE);
        edit(&mut changed, &mut shade);
        let job = RasterJob {
            scene: &changed,
            program: RasterProgram::Deferred,
            view: View::new(Mat4::IDENTITY, Vec3::ZERO),
            lights: &[],
            sun: None,
            shades: &[shade],
            culled: &[],
            viewport: Rect { x: 0, y: 0, width: 8, height: 8 },
            clear_color: Vec4::ZERO,
            attachments,
            shared: Attachments::default(),
            half: Attachments::default(),
            snapped_depth: false,
            load_store: LoadStore::default(),
        };
        scene(&job).err()
    }

    #[test]
    fn jobs_whose_parts_do_not_fit_are_refused_by_name() {
        type Edit = fn(&mut RenderScene, &mut Shade);
        let cases: [(Edit, &str, &str); 12] = [
            (|scene, _| scene.geometry.normals.truncate(2), "this scene", "as many normals as positions"),
            (|scene, _| scene.geometry.batches[0].material = 4, "this scene", "material 4 has no colours"),
            (|scene, _| scene.geometry.batches[0].count = 2, "this scene", "beyond the triangles"),
            (|scene, _| scene.geometry.batches[0].first = u32::MAX, "this scene", "beyond the triangles"),
            (
                |scene, _| {
                    scene.geometry.spheres.push(Sphere { center: Vec3::ZERO, radius: 1.0, material: 1 });
                },
                "this scene",
                "material 1 has no colours",
            ),
            (|_, shade| shade.vertex_colors = true, "vertex colours", "loaded without"),
            (|_, shade| shade.texture = Some(7), "this scene", "no texture 7"),
            (|_, shade| shade.glow = Some(Glow { color: Vec3::ONE, texture: Some(3) }), "this scene", "no texture 3"),
            (
                |_, shade| shade.normal_map = Some(NormalMap { texture: 0, scale: 1.0 }),
                "normal maps",
                "loaded without tangents",
            ),
            (
                |scene, shade| {
                    scene.geometry.tangents = vec![Vec4::X; 3];
                    shade.normal_map = Some(NormalMap { texture: 2, scale: 1.0 });
                },
                "this scene",
                "no texture 2",
            ),
            (
                |scene, shade| {
                    scene.geometry.texcoords.clear();
                    shade.texture = Some(0);
                },
                "a textured material",
                "loaded without texture coordinates",
            ),
            (
                |scene, shade| {
                    scene.geometry.texcoords.clear();
                    shade.glow = Some(Glow { color: Vec3::ONE, texture: Some(0) });
                },
                "a textured material",
                "loaded without texture coordinates",
            ),
        ];
        for (edit, what, why) in cases {
            let refused = refusal(COLOR, edit).unwrap_or_else(|| panic!("{what}: {why}"));
            assert!(refused.0 == what && refused.1.contains(why), "{refused:?}");
        }
        let normal = Attachments { normal: true, ..COLOR };
        let refused = refusal(normal, |scene, _| scene.geometry.normals.clear()).expect("there are no normals");
        assert!(refused.0.contains("`normal`") && refused.1.contains("without normals"), "{refused:?}");
        // What the job does not read may be missing.
        let textured = |scene: &mut RenderScene, shade: &mut Shade| {
            scene.geometry.texcoords.clear();
            (shade.texture, shade.vertex_colors) = (Some(0), true);
        };
        assert_eq!(refusal(TRIANGLE, textured), None);
        let holes = |scene: &mut RenderScene, shade: &mut Shade| {
            scene.geometry.texcoords.clear();
            (shade.texture, shade.alpha_cutoff) = (Some(0), Some(0.5));
        };
        assert_eq!(refusal(TRIANGLE, holes).map(|refused| refused.0), Some("a textured material"));
        assert_eq!(refusal(COLOR, |_, shade| shade.texture = Some(0)), None);
    }
}
