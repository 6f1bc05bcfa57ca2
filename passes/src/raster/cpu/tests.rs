//! Tests of internals: rounds.

use super::*;
use curitiba_pipeline::backend::LoadStore;
use curitiba_pipeline::backend::{Attachments, Cone, Light, Rect, Shade, View};
use curitiba_pipeline::programs::RasterProgram;
use curitiba_pipeline::scene::{Batch, Geometry};
use glam::{Mat4, Vec3, Vec4};

/// Overlapping triangles; every hundredth is about as large as the picture, and every tenth lies near the far plane, on either side of it.
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
        lights: &[],
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

#[test]
fn lamps_light_a_floor_by_the_inverse_square_add_and_end_at_their_cones() {
    // A floor from -1 to 1. A camera above it sees all of it.
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let positions: Vec<Vec3> = corners.map(|(x, y)| Vec3::new(x, y, 0.5)).into();
    let normals = vec![Vec3::Z; 4];
    let triangles = vec![[0, 1, 2], [0, 2, 3]];
    let batches = vec![Batch { material: 0, first: 0, count: 2 }];
    let scene = RenderScene {
        geometry: Geometry { positions, normals, triangles, batches, ..Geometry::default() },
        ..RenderScene::default()
    };
    let lamp = |place: Vec3, color: Vec3| Light {
        place: Some(place),
        direction: Vec3::ZERO,
        color,
        attenuation: [0.0, 0.0, 1.0],
        range: f32::INFINITY,
        cone: None,
    };
    let bulb = lamp(Vec3::new(0.3, -0.2, 1.5), Vec3::new(2.0, 1.0, 0.5));
    let cosine = 0.5_f32.atan().cos();
    let cone = Some(Cone { inner: cosine, outer: cosine, exponent: 0.0 });
    let spot = Light { direction: Vec3::NEG_Z, cone, ..lamp(Vec3::new(0.0, 0.0, 1.5), Vec3::ONE) };
    let behind = lamp(Vec3::new(0.0, 0.0, -0.5), Vec3::splat(100.0));
    let inside = lamp(Vec3::new(0.1, 0.1, 0.5), Vec3::splat(100.0));
    let shades = [Shade { diffuse: Vec4::new(0.8, 0.6, 0.4, 1.0), ..Shade::default() }];
    let asked = Attachments { color: true, position: true, normal: true, triangle: false };
    let job = RasterJob {
        scene: &scene,
        program: RasterProgram::Deferred,
        view: View::new(Mat4::IDENTITY, Vec3::Z),
        sun: None,
        lights: &[bulb, spot, behind, inside],
        shades: &shades,
        culled: &[],
        viewport: Rect { x: 0, y: 0, width: 67, height: 67 },
        clear_color: Vec4::ZERO,
        attachments: asked,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: false,
        load_store: LoadStore::default(),
    };
    let draw = |job: &RasterJob<'_>| {
        let mut target = GBuffer::new(67, 67, job.attachments);
        CpuRasteriser::new().draw(job, &mut target).expect("drawn");
        target
    };
    let target = draw(&job);
    let mut cones = [0; 2];
    for (color, position) in target.color.iter().zip(&target.position) {
        let point = Vec4::from(*position).truncate().as_dvec3();
        let from = |light: &Light| {
            let way = light.place.expect("a lamp").as_dvec3() - point;
            (light.color.as_dvec3() * (way.z / way.length().powi(3)), way.z / way.length())
        };
        let ((sum, cosine), (more, axis)) = (from(&bulb), from(&spot));
        let radius = point.truncate().length();
        if (radius - 0.5).abs() < 1e-4 {
            continue;
        }
        let is_inside = radius < 0.5;
        cones[usize::from(is_inside)] += 1;
        let sum = if is_inside { sum + more } else { sum };
        let expected = glam::DVec3::new(0.8, 0.6, 0.4) * (0.3 + sum);
        let off = (Vec4::from(*color).truncate().as_dvec3() - expected).abs().max_element();
        assert!(off < 2e-6, "{point}: {color:?} is not {expected}");
        let cosine = if is_inside { cosine.max(axis) } else { cosine };
        assert!((f64::from(position[3]) - cosine).abs() < 1e-6, "{point}");
    }
    assert!(cones[0] > 500 && cones[1] > 500, "{cones:?}");
    // The colour is the same if the job has no position attachment. Where no light arrives, the colour is the ambient share.
    let alone = Attachments { color: true, ..Attachments::default() };
    assert_eq!(draw(&RasterJob { attachments: alone, ..job }).color, target.color);
    let dark = draw(&RasterJob { lights: &[behind], ..job });
    assert!(dark.color.iter().all(|color| (color[0] - 0.24).abs() < 1e-6) && dark.position.iter().all(|p| p[3] == 0.0));
}
