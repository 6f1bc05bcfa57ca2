//! Fans traced together against their rays traced one by one: every count, and every candidate shown.

use crate::trace_scenes::{Random, SETS, bits, bounds, geometry, quads, soup, terrain};
use curitiba_passes::trace::{BruteForce, Bvh, Candidates, Fan, Hit, Quality, Ray, Tracer};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;
use std::collections::BTreeSet;

fn scenes() -> Vec<(&'static str, Geometry)> {
    let mut random = Random::new(17);
    let far: Vec<_> = soup(800, 0.2, &mut random).iter().map(|t| t.map(|p| p * 5.0 + Vec3::splat(1000.0))).collect();
    vec![
        (
            "soup, a third of it transparent",
            geometry(&[(0, soup(2000, 0.05, &mut random)), (1, soup(1000, 0.05, &mut random))]),
        ),
        ("large triangles", geometry(&[(1, soup(40, 1.0, &mut random))])),
        ("terrain", geometry(&[(0, terrain(50))])),
        ("axis-aligned quads", geometry(&[(0, quads(100, &mut random)), (1, quads(80, &mut random))])),
        ("far from the origin", geometry(&[(0, far)])),
        ("nothing", geometry(&[])),
    ]
}

/// A fan that owns its directions.
struct Owned {
    origin: Vec3,
    normal: Vec3,
    t_min: f32,
    t_max: f32,
    directions: Vec<Vec3>,
}

impl Owned {
    fn fan(&self) -> Fan<'_> {
        let Self { origin, normal, t_min, t_max, ref directions } = *self;
        Fan { origin, above: Some(normal), t_min, t_max, directions }
    }
}

/// Fans with neighbouring origins, long and short, with few and many rays, including fans that hit nothing.
fn fans(geometry: &Geometry, random: &mut Random) -> Vec<Owned> {
    let (low, high) = bounds(geometry);
    let size = (high - low).length();
    let mut fans = Vec::new();
    for group in 0..6 {
        let corner = low.lerp(high, 0.5) + random.cube() * (high - low) * 0.5;
        let normal = [Vec3::Y, random.direction(), Vec3::NEG_X][group % 3];
        let t_max = [f32::INFINITY, size * 0.1, size * 0.02][group / 2];
        for pixel in 0..40 {
            let origin = corner + random.cube() * size * 0.03;
            let origin = if pixel % 5 == 0 { origin.round() } else { origin };
            let count = [16, 16, 1, 0, 30][random.below(5)];
            let mut directions: Vec<Vec3> = (0..count)
                .map(|_| match random.below(40) {
                    0 => normal,
                    1 => Vec3::new(0.6, 0.0, -0.8),
                    2 => Vec3::new(f32::NAN, 1.0, 0.0),
                    3 => Vec3::ZERO,
                    4 => Vec3::new(1e-40, 1.0, -1e-40),
                    5 => Vec3::splat(0.577_350_26),
                    6 => Vec3::new(f32::INFINITY, 1.0, 1.0),
                    _ => random.cosine(normal),
                })
                .collect();
            directions.retain(|direction| direction.is_nan() || direction.dot(normal) >= 0.0);
            let (mut t_min, mut t_max) = (0.0, t_max);
            match random.below(20) {
                0 => t_min = size * 0.01,
                1 => t_max = size * random.unit(),
                2 => t_max = -1.0,
                3 => (t_min, t_max) = (1.0, 1.0),
                4 => t_min = f32::NAN,
                _ => {}
            }
            let origin = if random.below(60) == 0 { Vec3::NAN } else { origin };
            fans.push(Owned { origin, normal, t_min, t_max, directions });
        }
    }
    // Fans of many rays from one origin: one of 5000, and three of 100.
    let corner = low.lerp(high, 0.4);
    for count in [5000, 100, 100, 100] {
        let directions = (0..count).map(|_| random.cosine(Vec3::Y)).collect();
        fans.push(Owned { origin: corner, normal: Vec3::Y, t_min: 0.0, t_max: size, directions });
    }
    fans
}

/// A rule for transparent triangles that depends on the fan and on the hit.
fn accepts(fan: usize, hit: &Hit) -> bool {
    hit.u > 0.4 || (hit.triangle as usize + fan).is_multiple_of(3)
}

#[test]
fn fans_together_count_what_their_rays_find_one_by_one() {
    let mut random = Random::new(23);
    let (mut rays, mut open_rays, mut candidates) = (0, 0, Candidates::default());
    for (name, geometry) in scenes() {
        let owned = fans(&geometry, &mut random);
        let fans: Vec<Fan<'_>> = owned.iter().map(Owned::fan).collect();
        for lanes in SETS {
            let Some(bvh) = Bvh::build(&geometry, &[false, true], Quality::Balanced).with_instruction_set(lanes) else {
                continue;
            };
            let mut open = vec![u32::MAX; fans.len()];
            bvh.count_open_near(&fans, &mut open, &mut candidates, accepts);
            for (index, fan) in fans.iter().enumerate() {
                let alone = fan.rays().filter(|ray| !bvh.occluded(ray, |hit| accepts(index, hit))).count();
                assert_eq!(open[index] as usize, alone, "{name}, {lanes:?}, fan {index}: {:?}", fan.origin);
                rays += fan.directions.len();
                open_rays += alone;
            }
        }
    }
    assert!(open_rays > rays / 10 && open_rays < rays * 9 / 10, "the test saw both: {open_rays} of {rays}");
}

#[test]
fn fans_together_show_every_transparent_hit_of_rays_that_nothing_stops() {
    let mut random = Random::new(5);
    let geometry = geometry(&[(1, soup(1500, 0.2, &mut random)), (0, soup(60, 0.2, &mut random))]);
    let owned = fans(&geometry, &mut random);
    let fans: Vec<Fan<'_>> = owned.iter().map(Owned::fan).collect();
    let bvh = Bvh::build(&geometry, &[false, true], Quality::Balanced);
    let mut shown = vec![BTreeSet::new(); fans.len()];
    bvh.count_open_near(&fans, &mut vec![0; fans.len()], &mut Candidates::default(), |fan, hit| {
        shown[fan].insert(bits(hit));
        false
    });
    let mut crossings = 0;
    for (fan, shown) in fans.iter().zip(&shown) {
        let mut asked = BTreeSet::new();
        for ray in fan.rays() {
            let mut alone = BTreeSet::new();
            let stopped = bvh.occluded(&ray, |hit| {
                alone.insert(bits(hit));
                false
            });
            if !stopped {
                assert!(alone.is_subset(shown), "{ray:?}");
                crossings += alone.len();
            }
            // Which hits a blocked ray is shown depends on the order of traversal. These are all hits that may be shown.
            let mut distances = 0.0_f32;
            while let Some(hit) = bvh.closest(&Ray { t_min: distances, ..ray }, |_| true) {
                asked.insert(hit.triangle);
                distances = hit.t;
            }
        }
        assert!(shown.iter().all(|hit| asked.contains(&hit.0)), "nothing is shown that no ray of the fan meets");
    }
    assert!(crossings > 1000, "{crossings}");
}

#[test]
fn the_comparison_notices_a_ray_that_is_left_out() {
    let geometry = geometry(&[(0, terrain(20))]);
    let bvh = Bvh::build(&geometry, &[], Quality::Balanced);
    let brute = BruteForce::new(&geometry, &[]);
    let down = [Vec3::new(0.1, -0.9, 0.2).normalize(); 40];
    let fan = |directions| Fan { origin: Vec3::new(0.25, 5.0, 0.5), above: None, t_min: 0.0, t_max: 9.0, directions };
    let up = [Vec3::new(0.1, 0.9, 0.2).normalize(); 40];
    let fans = [fan(&down), fan(&down[..39]), fan(&up), fan(&up[..39])];
    let (mut open, mut reference) = ([7; 4], [9; 4]);
    let mut candidates = Candidates::default();
    bvh.count_open_near(&fans, &mut open, &mut candidates, |_, _| true);
    brute.count_open_near(&fans, &mut reference, &mut candidates, |_, _| true);
    assert_eq!(open, [0, 0, 40, 39]);
    assert_eq!(reference, open);
    let blocked = fans.map(|fan| fan.directions.len() as u32);
    assert_ne!(blocked[0] - open[0], blocked[1] - open[1], "a ray more that is stopped is a count more");
}
