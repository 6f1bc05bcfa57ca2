//! The `f64` tracer of reference pictures against brute force over all triangles: hit for hit the same answers.

use crate::trace_scenes::{Random, geometry, quads, soup, terrain};
use curitiba_passes::trace::{BruteForce, Double, Hit, Ray, Tracer};
use curitiba_pipeline::scene::Geometry;
use curitiba_pipeline::square;
use glam::Vec3;

const ALL: fn(&Hit) -> bool = |_| true;

fn rays(geometry: &Geometry, count: usize, random: &mut Random) -> Vec<Ray> {
    (0..count)
        .map(|index| {
            let corners = geometry.corners(random.below(geometry.triangles.len()) as u32);
            let on = corners[0] + (corners[1] - corners[0]) * random.unit() + (corners[2] - corners[0]) * random.unit();
            // Some rays start on surfaces, some go through corners, and some along axes, with zeros of both signs.
            let origin = if index % 3 == 0 { on } else { on + random.cube() * 3.0 };
            let target = if index % 4 == 0 { corners[index % 3] } else { on };
            let direction = match index % 7 {
                0 => [Vec3::X, Vec3::NEG_Y, Vec3::new(-0.0, 0.0, 1.0)][index % 3],
                1..=3 => (target - origin).normalize_or(Vec3::Y),
                _ => random.direction(),
            };
            let t_max = if index % 5 == 0 { random.unit() * 4.0 } else { f32::INFINITY };
            let t_min = if index % 6 == 0 { random.unit() * 0.5 } else { 0.0 };
            Ray { origin, direction, t_min, t_max }
        })
        .collect()
}

/// The number of rays whose answers differ in any bit, and the number that hit something.
fn differences(double: &Double, brute: &BruteForce, rays: &[Ray], accept: fn(&Hit) -> bool) -> (usize, usize) {
    let (mut different, mut hits) = (0, 0);
    for ray in rays {
        let (a, b) = (double.closest(ray, accept), brute.closest(ray, accept));
        different += usize::from(a != b || double.occluded(ray, accept) != b.is_some());
        hits += usize::from(b.is_some());
    }
    (different, hits)
}

fn scenes() -> Vec<(&'static str, Geometry)> {
    let mut random = Random::new(7);
    let mut twice = soup(300, 0.3, &mut random);
    twice.extend(twice.clone());
    let far: Vec<_> = soup(500, 0.2, &mut random).iter().map(|t| t.map(|p| p * 5.0 + Vec3::splat(1.0e5))).collect();
    let point = [Vec3::ONE; 3];
    vec![
        ("soup", geometry(&[(0, soup(1500, 0.1, &mut random))])),
        ("large triangles", geometry(&[(0, soup(300, 1.0, &mut random))])),
        ("terrain", geometry(&[(0, terrain(24))])),
        ("axis-aligned quads", geometry(&[(0, quads(200, &mut random))])),
        ("every triangle twice", geometry(&[(0, twice)])),
        ("far from the origin", geometry(&[(0, far)])),
        ("points", geometry(&[(0, [vec![point; 40], terrain(3)].concat())])),
    ]
}

#[test]
fn answers_are_those_of_brute_force_to_the_bit() {
    for (name, geometry) in scenes() {
        let (double, brute) = (Double::build(&geometry, &[]), BruteForce::new(&geometry, &[]));
        let rays = rays(&geometry, 3000, &mut Random::new(8));
        let (different, hits) = differences(&double, &brute, &rays, ALL);
        assert_eq!(different, 0, "{name}");
        assert!(hits > 500, "{name}: {hits} rays hit");
    }
}

#[test]
fn a_missing_triangle_is_noticed_by_the_comparison() {
    for (name, geometry) in scenes().into_iter().take(4) {
        let brute = BruteForce::new(&geometry, &[]);
        let rays = rays(&geometry, 3000, &mut Random::new(8));
        let hit = rays.iter().find_map(|ray| brute.closest(ray, ALL)).expect("some ray hits");
        let mut without = geometry.clone();
        without.triangles[hit.triangle as usize] = [u32::MAX; 3];
        let (different, _) = differences(&Double::build(&without, &[]), &brute, &rays, ALL);
        assert!(different > 0, "{name}");
    }
}

#[test]
fn transparent_triangles_are_asked_about_and_the_others_are_not() {
    let mut random = Random::new(9);
    let scene = geometry(&[(0, soup(500, 0.4, &mut random)), (1, soup(500, 0.4, &mut random))]);
    let transparent = [false, true];
    let (double, brute) = (Double::build(&scene, &transparent), BruteForce::new(&scene, &transparent));
    let rays = rays(&scene, 3000, &mut random);
    let keep: fn(&Hit) -> bool = |hit| hit.triangle.is_multiple_of(3);
    let (different, _) = differences(&double, &brute, &rays, keep);
    assert_eq!(different, 0);
    let (passing, _) = differences(&double, &BruteForce::new(&scene, &[]), &rays, keep);
    assert!(passing > 100, "only {passing} rays pass through a refused triangle");
}

#[test]
fn the_square_is_traced_as_by_brute_force() {
    let options = curitiba_pipeline::scene::BuildOptions::default();
    let square = square::generate(10_000).scene;
    let (scene, _) = curitiba_pipeline::scene::RenderScene::build(square, &options).expect("the square is sound");
    let transparent: Vec<bool> = scene.materials.iter().map(|material| material.alpha_cutoff.is_some()).collect();
    let geometry = &scene.geometry;
    let (double, brute) = (Double::build(geometry, &transparent), BruteForce::new(geometry, &transparent));
    let rays = rays(geometry, 1500, &mut Random::new(10));
    let (different, hits) = differences(&double, &brute, &rays, |hit| hit.triangle.is_multiple_of(2));
    assert_eq!(different, 0);
    assert!(hits > 500, "{hits}");
}

#[test]
fn nothing_is_hit_without_triangles_or_without_a_direction() {
    let empty = Double::build(&Geometry::default(), &[]);
    let ray = Ray { origin: Vec3::ZERO, direction: Vec3::X, t_min: 0.0, t_max: f32::INFINITY };
    assert!(empty.closest(&ray, ALL).is_none() && !empty.occluded(&ray, ALL));
    let scene = Double::build(&geometry(&[(0, terrain(3))]), &[]);
    for direction in [Vec3::ZERO, Vec3::NAN, Vec3::new(f32::INFINITY, 0.0, 0.0)] {
        assert!(!scene.occluded(&Ray { direction, ..ray }, ALL), "{direction}");
    }
}
