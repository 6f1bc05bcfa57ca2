//! Traces rays without rendering: from the centre of a tetrahedron, every ray hits.
//!
//! ```sh
//! cargo run --release --example rays
//! ```

use curitiba::passes::trace::{Bvh, Quality, Ray, Tracer as _};
use curitiba::pipeline::scene::{Batch, Geometry};
use glam::Vec3;

fn main() {
    let positions = vec![
        Vec3::new(1.0, 1.0, 1.0),
        Vec3::new(1.0, -1.0, -1.0),
        Vec3::new(-1.0, 1.0, -1.0),
        Vec3::new(-1.0, -1.0, 1.0),
    ];
    let triangles = vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
    let batches = vec![Batch { material: 0, first: 0, count: 4 }];
    let geometry = Geometry { positions, triangles, batches, ..Geometry::default() };
    let bvh = Bvh::build(&geometry, &[], Quality::default());
    for direction in [Vec3::X, Vec3::Y, Vec3::NEG_ONE.normalize()] {
        let ray = Ray { origin: Vec3::ZERO, direction, t_min: 0.0, t_max: f32::INFINITY };
        match bvh.closest(&ray, |_| true) {
            Some(hit) => println!("{direction}: triangle {} at {:.4}", hit.triangle, hit.t),
            None => println!("{direction}: nothing"),
        }
    }
}
