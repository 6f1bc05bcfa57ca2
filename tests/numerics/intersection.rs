//! Meshes through which rays may slip: needles, triangles far smaller than a pixel, copies, origins on the surface.

use crate::trace_scenes::{Random, geometry, icosphere, passes_ordinary_test, ray};
use curitiba_passes::trace::{Bvh, Hit, Quality, Ray, Tracer};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;
use rayon::prelude::*;

const OPAQUE: fn(&Hit) -> bool = |_| unreachable!("opaque triangles are accepted without asking");

fn build(geometry: &Geometry) -> Bvh {
    Bvh::build(geometry, &[], Quality::Balanced)
}

/// A random point on an edge of a mesh, or a random vertex.
fn seam(mesh: &Geometry, at_vertex: bool, random: &mut Random) -> Vec3 {
    let triangle = mesh.corners(random.below(mesh.triangles.len()) as u32);
    let corner = random.below(3);
    let along = if at_vertex { 0.0 } else { random.unit() };
    triangle[corner] + (triangle[(corner + 1) % 3] - triangle[corner]) * along
}

fn leaks(mesh: &Geometry, bvh: &Bvh, center: Vec3, spread: Vec3, rays: u64, seed: u64) -> [u64; 2] {
    const PART: u64 = 1 << 14;
    let parts = rays.div_ceil(PART);
    let part = |part: u64| {
        let mut random = Random::new(seed.wrapping_add(part.wrapping_mul(7919)));
        let mut leaks = [0, 0];
        for index in 0..PART {
            let target = seam(mesh, index % 2 == 0, &mut random);
            let origin = center + random.cube() * spread;
            let ray = ray(origin, (target - origin).normalize());
            leaks[0] += u64::from(bvh.closest(&ray, OPAQUE).is_none());
            leaks[1] += u64::from(!bvh.occluded(&ray, OPAQUE));
        }
        leaks
    };
    (0..parts).into_par_iter().map(part).reduce(|| [0, 0], |a, b| [a[0] + b[0], a[1] + b[1]])
}

/// A closed sphere, scaled along the axes.
fn stretched(levels: u32, by: Vec3) -> Geometry {
    let mut mesh = icosphere(levels, Vec3::ZERO);
    mesh.positions.iter_mut().for_each(|position| *position *= by);
    mesh
}

#[test]
fn nothing_leaks_through_a_mesh_of_needles() {
    // Triangles up to ten thousand times as long as wide, and flat bodies ten thousand times as wide as thick.
    for by in [Vec3::new(1.0, 1.0, 1e4), Vec3::new(1e-4, 1.0, 1.0), Vec3::new(1e3, 1.0, 1e-3)] {
        let mesh = stretched(4, by);
        let found = leaks(&mesh, &build(&mesh), Vec3::ZERO, by * 0.4, 200_000, 1);
        assert_eq!(found, [0, 0], "stretched by {by}");
        let mut random = Random::new(2);
        let naive = (0..400)
            .map(|_| {
                let origin = random.cube() * by * 0.4;
                ray(origin, (seam(&mesh, false, &mut random) - origin).normalize())
            })
            .filter(|ray| passes_ordinary_test(&mesh, ray))
            .count();
        assert!(naive > 0, "the ordinary test does not leak when stretched by {by}");
    }
}

#[test]
fn a_mesh_far_smaller_than_a_pixel_is_hit_wherever_it_is_met() {
    // 1280 triangles within a thousandth, seen from a distance of a thousand: a triangle covers a hundred-thousandth of
    // a pixel.
    let mesh = stretched(3, Vec3::splat(1e-3));
    let bvh = build(&mesh);
    let mut random = Random::new(3);
    let (mut missed, mut naive) = (0, 0);
    for index in 0..200_000 {
        let side = random.direction();
        let origin = side * 1000.0;
        // A vertex, or a point of an edge, that faces the origin and is not on the silhouette.
        let target = seam(&mesh, index % 2 == 0, &mut random);
        let target = if target.dot(side) < 0.0 { -target } else { target };
        if target.dot(side) < 0.5e-3 {
            continue;
        }
        let ray = ray(origin, (target - origin).normalize());
        missed += usize::from(bvh.closest(&ray, OPAQUE).is_none() || !bvh.occluded(&ray, OPAQUE));
        naive += usize::from(index < 2000 && passes_ordinary_test(&mesh, &ray));
    }
    assert_eq!(missed, 0);
    println!("the ordinary test misses {naive} of 2000");
    assert!(naive > 5, "the ordinary test misses {naive} of 2000");
}

#[test]
fn a_thousand_coplanar_copies_neither_hide_each_other_nor_shadow_themselves() {
    use curitiba_passes::trace::SurfacePoint;
    let mut random = Random::new(4);
    for _ in 0..20 {
        let a = random.cube() * 3.0;
        let (e1, e2) = (random.direction(), random.direction());
        let triangle = [a, a + e1, a + e2];
        let normal = e1.cross(e2);
        if normal.length() < 0.1 {
            continue;
        }
        let scene = geometry(&[(0, vec![triangle; 1000])]);
        let bvh = build(&scene);
        let mut naive = 0;
        for _ in 0..500 {
            let target = a + e1 * (0.2 + 0.3 * random.unit()) + e2 * (0.2 + 0.3 * random.unit());
            let origin = target + random.cosine(normal.normalize()) * 4.0;
            let primary = ray(origin, (target - origin).normalize());
            let hit = bvh.closest(&primary, OPAQUE).expect("every copy is in the way");
            assert_eq!(hit.triangle, 0, "of equal distances the lowest triangle");
            let point = SurfacePoint::from_hit(&scene, &hit);
            for onward in [random.cosine(normal.normalize()), -random.cosine(normal.normalize())] {
                assert!(!bvh.occluded(&ray(point.spawn(onward), onward), OPAQUE), "a copy is hit");
                naive += usize::from(bvh.occluded(&ray(primary.origin + primary.direction * hit.t, onward), OPAQUE));
            }
        }
        assert!(naive > 50, "without an offset {naive} of 1000 hit a copy");
    }
}

#[test]
fn rays_from_the_vertices_and_edges_of_a_closed_mesh_meet_its_other_side() {
    let mesh = icosphere(4, Vec3::ZERO);
    let bvh = build(&mesh);
    let mut random = Random::new(5);
    for index in 0..200_000 {
        let origin = seam(&mesh, index % 2 == 0, &mut random);
        // The direction goes well inward: along the surface, the ray would hit neighbouring triangles.
        let direction = (random.direction() * 0.5 - origin).normalize();
        let hit = bvh.closest(&ray(origin, direction), OPAQUE).expect("the other side is in the way");
        assert!(hit.t > 0.0, "never at distance 0: {hit:?}");
        // The hit is on the surface where the ray starts, at most at the distance of rounding, or on the other side.
        assert!(hit.t < 1e-6 || hit.t > 0.2, "{hit:?}");
        assert!(bvh.occluded(&Ray { t_min: 1e-6, ..ray(origin, direction) }, OPAQUE));
    }
}

#[test]
fn directions_with_denormal_zero_and_huge_components_hit_what_they_should() {
    let mesh = icosphere(3, Vec3::new(0.0, 0.0, 0.0));
    let bvh = build(&mesh);
    let tiny = [0.0_f32, -0.0, 1e-45, -1e-45, 1e-40, -1e-39, f32::MIN_POSITIVE, -1e-30];
    for axis in 0..3 {
        for sign in [1.0_f32, -1.0] {
            for &a in &tiny {
                for &b in &tiny {
                    let mut direction = Vec3::ZERO;
                    direction[axis] = sign;
                    direction[(axis + 1) % 3] = a;
                    direction[(axis + 2) % 3] = b;
                    for origin in [Vec3::ZERO, direction * -5.0, Vec3::new(1e-42, -1e-44, 0.0)] {
                        let hit = bvh.closest(&ray(origin, direction), OPAQUE);
                        assert!(hit.is_some_and(|hit| hit.t.is_finite()), "{direction} from {origin}: {hit:?}");
                    }
                }
            }
        }
    }
}

/// To be run once for each release: `cargo test --release -p curitiba-numerics -- --ignored --nocapture`.
#[test]
#[ignore = "a hundred million rays take minutes"]
fn nothing_leaks_in_a_hundred_million_rays() {
    const RAYS: u64 = 100_000_000;
    let start = std::time::Instant::now();
    for center in [Vec3::ZERO, Vec3::new(1000.0, -700.0, 1300.0)] {
        let sphere = icosphere(5, center);
        let found = leaks(&sphere, &build(&sphere), center, Vec3::splat(0.5), RAYS / 2, 6);
        println!(
            "{} rays at edges and vertices of a sphere at {center}: {found:?} leaks, {:.0?}",
            RAYS / 2,
            start.elapsed()
        );
        assert_eq!(found, [0, 0], "centre {center}");
    }
}
