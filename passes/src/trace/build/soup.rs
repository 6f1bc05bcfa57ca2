//! Random triangles that tests build trees over.

use curitiba_pipeline::scene::{Batch, Geometry};
use glam::Vec3;

/// `count` random triangles around the point (`center`, `center`, `center`), with corners within `size` of their
/// middles along each axis. The first half has material 0, the rest material 1.
pub(super) fn soup(count: u32, center: f32, size: f32) -> Geometry {
    let mut state = 7_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / 8_388_608.0 - 1.0
    };
    let mut positions = Vec::new();
    for _ in 0..count {
        let middle = Vec3::new(random(), random(), random()) + center;
        positions.extend([0; 3].map(|_| middle + Vec3::new(random(), random(), random()) * size));
    }
    Geometry {
        positions,
        triangles: (0..count).map(|triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2]).collect(),
        batches: vec![
            Batch { material: 0, first: 0, count: count / 2 },
            Batch { material: 1, first: count / 2, count: count - count / 2 },
        ],
        ..Geometry::default()
    }
}
