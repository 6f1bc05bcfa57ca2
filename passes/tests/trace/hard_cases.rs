//! Cracks between triangles, and inputs that are hard for trees and clusterings.

use crate::trace_scenes::{Random, geometry, icosphere, passes_ordinary_test, ray, soup};
use curitiba_passes::trace::{Bvh, Fan, Hit, Quality, Ray, Tracer};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;

const OPAQUE: fn(&Hit) -> bool = |_| unreachable!("opaque triangles are accepted without asking");

fn build(geometry: &Geometry) -> Bvh {
    Bvh::build(geometry, &[], Quality::Balanced)
}

/// A ray from inside a closed mesh towards a point on one of its edges, or towards one of its vertices.
fn aimed(sphere: &Geometry, center: Vec3, at_vertex: bool, random: &mut Random) -> Ray {
    let triangle = sphere.corners(random.below(sphere.triangles.len()) as u32);
    let corner = random.below(3);
    let along = if at_vertex { 0.0 } else { random.unit() };
    let target = triangle[corner] + (triangle[(corner + 1) % 3] - triangle[corner]) * along;
    let origin = center + random.cube() * 0.5;
    ray(origin, (target - origin).normalize())
}

#[test]
fn nothing_leaks_through_the_edges_and_vertices_of_a_closed_mesh() {
    const RAYS: usize = 1 << 18;
    for center in [Vec3::ZERO, Vec3::new(1000.0, -700.0, 1300.0)] {
        let sphere = icosphere(5, center);
        assert_eq!(sphere.triangles.len(), 20_480);
        let bvh = build(&sphere);
        for at_vertex in [false, true] {
            let mut random = Random::new(6);
            let mut leaks = [0, 0];
            for _ in 0..RAYS {
                let ray = aimed(&sphere, center, at_vertex, &mut random);
                leaks[0] += usize::from(bvh.closest(&ray, OPAQUE).is_none());
                leaks[1] += usize::from(!bvh.occluded(&ray, OPAQUE));
            }
            assert_eq!(leaks, [0, 0], "centre {center}, at vertex: {at_vertex}");
        }
    }
}

/// Negative control: a common triangle test in `f32`, without a tree, leaks.
#[test]
fn the_same_rays_leak_through_an_ordinary_triangle_test() {
    let sphere = icosphere(3, Vec3::ZERO);
    let mut random = Random::new(6);
    let leaks = (0..2000)
        .map(|_| aimed(&sphere, Vec3::ZERO, false, &mut random))
        .filter(|ray| passes_ordinary_test(&sphere, ray))
        .count();
    assert!(leaks > 20, "{leaks}");
}

/// A floor of 64 x 64 unit cells at this height, with vertices at integers.
fn floor(height: f32) -> Vec<[Vec3; 3]> {
    let mut triangles = Vec::new();
    for x in 0..64 {
        for z in 0..64 {
            let point = |i: i32, j: i32| Vec3::new((x + i) as f32 - 32.0, height, (z + j) as f32 - 32.0);
            triangles.extend([[point(0, 0), point(1, 1), point(1, 0)], [point(0, 0), point(0, 1), point(1, 1)]]);
        }
    }
    triangles
}

#[test]
fn rays_along_an_axis_hit_the_vertices_and_edges_of_a_grid() {
    let zeros = [0.0_f32, -0.0, 1e-45, -1e-45, 1e-39, -1e-39, 1.2e-38, -3e-38, 1e-30];
    let grid = floor(0.0);
    for turn in 0..3 {
        let turned = |p: Vec3| Vec3::from([p[turn], p[(turn + 1) % 3], p[(turn + 2) % 3]]);
        let bvh = build(&geometry(&[(0, grid.iter().map(|t| t.map(turned)).collect())]));
        let mut misses = 0;
        for x in -32..=32 {
            for z in -32..=32 {
                for half in [0.0, 0.5] {
                    for &zero in &zeros {
                        // From the rim of the floor, a ray that is not vertical may miss the floor.
                        let rim = x == 32 || x == -32 || z == 32 || z == -32;
                        if rim && (half != 0.0 || zero.abs() > f32::MIN_POSITIVE) {
                            continue;
                        }
                        let origin = turned(Vec3::new(x as f32, 3.0, z as f32 + half));
                        let ray = ray(origin, turned(Vec3::new(zero, -1.0, -zero)));
                        misses += usize::from(bvh.closest(&ray, OPAQUE).is_none() || !bvh.occluded(&ray, OPAQUE));
                    }
                }
            }
        }
        assert_eq!(misses, 0, "turned by {turn}");
    }
}

#[test]
fn hopeless_input_builds_and_misses_or_hits_what_it_should() {
    let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let probe = ray(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z);
    let hits = |triangles: Vec<[Vec3; 3]>| {
        let scene = geometry(&[(0, triangles)]);
        [Quality::Fast, Quality::Balanced, Quality::Slow].map(|quality| {
            let bvh = Bvh::build(&scene, &[], quality);
            assert_eq!(bvh.occluded(&probe, OPAQUE), bvh.closest(&probe, OPAQUE).is_some());
            let directions = [probe.direction, Vec3::Z];
            let fan = Fan { origin: probe.origin, above: None, t_min: 0.0, t_max: 9.0, directions: &directions };
            assert_eq!(
                bvh.count_open(&fan, OPAQUE) as usize,
                fan.rays().filter(|ray| !bvh.occluded(ray, OPAQUE)).count()
            );
            bvh.closest(&probe, OPAQUE).is_some()
        })
    };
    let all = [true; 3];
    assert_eq!(hits(vec![]), [false; 3]);
    assert_eq!(hits(vec![triangle]), all);
    assert_eq!(hits(vec![triangle, triangle.map(|p| p - Vec3::Z)]), all);
    for count in [9, 1000, 20_000] {
        assert_eq!(hits(vec![triangle; count]), all, "{count} identical triangles");
        assert_eq!(hits(vec![[Vec3::ONE; 3]; count]), [false; 3], "{count} times one point");
        let mut points = vec![[Vec3::splat(0.25); 3]; count];
        points.push(triangle);
        assert_eq!(hits(points), all, "{count} points and a triangle");
        let row: Vec<_> = (0..count).map(|i| triangle.map(|p| p + Vec3::X * i as f32)).collect();
        assert_eq!(hits(row), all, "{count} triangles in a row");
        let line: Vec<_> = (0..count).map(|i| [Vec3::X * i as f32, Vec3::X * (i + 1) as f32, Vec3::X]).collect();
        assert_eq!(hits(line), [false; 3], "{count} degenerate triangles on a line");
        let nested: Vec<_> = (0..count).map(|i| triangle.map(|p| p * 1.02_f32.powi(i.min(2000) as i32))).collect();
        assert_eq!(hits(nested), all, "{count} nested triangles");
    }
    let mut odd = vec![triangle];
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        odd.push([Vec3::splat(bad), Vec3::X, Vec3::Y]);
        odd.push([Vec3::ZERO, Vec3::new(0.0, bad, 0.0), Vec3::Y]);
    }
    assert_eq!(hits(odd.clone()), all);
    odd.push([Vec3::splat(f32::MAX), Vec3::splat(f32::MIN), Vec3::X * f32::MAX]);
    odd.extend((0..1000).map(|i| [Vec3::splat(1e38), Vec3::splat(-1e38), Vec3::Y * i as f32]));
    hits(odd);
    odd = vec![triangle.map(|p| p * 1e-42); 50];
    hits(odd);
}

#[test]
fn indices_out_of_range_and_missing_batches_are_left_out() {
    let mut scene = geometry(&[(0, vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 3])]);
    scene.triangles[0] = [0, 1, 99];
    scene.triangles[2] = [u32::MAX; 3];
    scene.batches.clear();
    let bvh = build(&scene);
    let hit = bvh.closest(&ray(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z), OPAQUE).unwrap();
    assert_eq!(hit.triangle, 1);
}

#[test]
fn rays_that_are_not_rays_miss() {
    let bvh = build(&geometry(&[(0, soup(500, 1.0, &mut Random::new(7)))]));
    let good = Ray { origin: Vec3::ZERO, direction: Vec3::X, t_min: 0.0, t_max: 10.0 };
    assert!(bvh.occluded(&Ray { origin: Vec3::splat(-3.0), direction: Vec3::splat(0.577_350_26), ..good }, OPAQUE));
    let bad = [
        Ray { origin: Vec3::new(f32::NAN, 0.0, 0.0), ..good },
        Ray { origin: Vec3::new(0.0, f32::INFINITY, 0.0), ..good },
        Ray { direction: Vec3::new(0.0, f32::NAN, 0.0), ..good },
        Ray { direction: Vec3::new(f32::INFINITY, 0.0, 0.0), ..good },
        Ray { direction: Vec3::ZERO, ..good },
        Ray { direction: Vec3::splat(1e-42), ..good },
        Ray { t_min: f32::NAN, ..good },
        Ray { t_max: f32::NAN, ..good },
        Ray { t_min: 5.0, t_max: 5.0, ..good },
        Ray { t_min: 0.0, t_max: -1.0, ..good },
        Ray { t_min: f32::INFINITY, t_max: f32::INFINITY, ..good },
    ];
    for ray in bad {
        assert!(bvh.closest(&ray, OPAQUE).is_none() && !bvh.occluded(&ray, OPAQUE), "{ray:?}");
        let Ray { origin, direction, t_min, t_max } = ray;
        let fan = Fan { origin, above: None, t_min, t_max, directions: &[direction; 3] };
        let open = bvh.count_open(&fan, OPAQUE);
        assert_eq!(open, 3, "{ray:?}");
    }
}
