//! Tests of internals: rounds.

use super::*;
use curitiba_pipeline::backend::LoadStore;
use curitiba_pipeline::backend::{Attachments, Rect, Shade, View};
use curitiba_pipeline::programs::RasterProgram;
use curitiba_pipeline::scene::{Batch, Geometry};
use glam::{Mat4, Vec3, Vec4};

/// Overlapping triangles; every hundredth covers the whole picture, and every tenth reaches behind the far plane.
fn scene(count: u32) -> RenderScene {
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0 * 2.0 - 1.0
    };
    let mut positions = Vec::new();
    for triangle in 0..count {
        let size = if triangle % 100 == 0 { 3.0 } else { 0.05 };
        let depth = if triangle % 10 == 0 { 0.0 } else { 0.5 };
        let centre = Vec3::new(random(), random(), depth + random() * 0.3);
        for _ in 0..3 {
            positions.push(centre + Vec3::new(random(), random(), random() * 0.1) * size);
        }
    }
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let batches = vec![Batch { material: 0, first: 0, count }];
    let geometry = Geometry { positions, triangles, batches, ..Geometry::default() };
    RenderScene { geometry, ..RenderScene::default() }
}

#[test]
fn the_number_of_rounds_does_not_show() {
    let scene = scene(5 * BIN_TRIANGLES as u32 + 17);
    let attachments = Attachments { position: true, triangle: true, ..Attachments::default() };
    let shade = Shade::default();
    let job = RasterJob {
        scene: &scene,
        program: RasterProgram::Deferred,
        view: View::new(Mat4::IDENTITY, Vec3::ZERO),
        sun: None,
        shades: &[shade],
        culled: &[],
        viewport: Rect { x: 0, y: 0, width: 500, height: 350 },
        clear_color: Vec4::ZERO,
        attachments,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: false,
        load_store: LoadStore::default(),
    };
    let mut pictures = Vec::new();
    let mut rasteriser = CpuRasteriser::new();
    for round in [ROUND, 1, 2, 4, ROUND] {
        rasteriser.round = round;
        let mut target = GBuffer::new(500, 350, attachments);
        rasteriser.draw(&job, &mut target).expect("drawn");
        pictures.push(target);
    }
    assert!(pictures.iter().all(|picture| *picture == pictures[0]));
    let of_bin = |bin: u32| pictures[0].triangle.iter().filter(|id| **id / BIN_TRIANGLES as u32 == bin).count();
    assert!((0..5).all(|bin| of_bin(bin) > 0), "every round shows");
    assert!(rasteriser.clipped.iter().any(|parts| !parts.is_empty()), "some triangles are clipped");
    assert!(rasteriser.bins.iter().any(|bins| !bins.large.is_empty()), "some triangles are large");
}
