//! The tree against brute force in `f64`, and against itself: instruction sets, bundles of rays, ties, transparent
//! materials.

use crate::trace_scenes::{Random, SETS, bounds, geometry, quads, ray, soup, terrain};
use curitiba_passes::trace::{
    BruteForce, Bvh, Candidates, Directions, Fan, Hit, InstructionSet, Neighbourhood, Quality, Ray, Tracer,
};
use curitiba_pipeline::scene::{Batch, Geometry};
use glam::{DVec3, Vec3};

const NONE: fn(&Hit) -> bool = |_| unreachable!("opaque triangles are accepted without asking");

fn scenes() -> Vec<(&'static str, Geometry)> {
    let mut random = Random::new(1);
    let mut twice = soup(300, 0.3, &mut random);
    twice.extend(twice.clone());
    let far: Vec<_> = soup(800, 0.2, &mut random).iter().map(|t| t.map(|p| p * 5.0 + Vec3::splat(1000.0))).collect();
    vec![
        ("soup", geometry(&[(0, soup(2000, 0.1, &mut random))])),
        ("large triangles", geometry(&[(0, soup(300, 1.0, &mut random))])),
        ("terrain", geometry(&[(0, terrain(40))])),
        ("axis-aligned quads", geometry(&[(0, quads(200, &mut random))])),
        ("every triangle twice", geometry(&[(0, twice)])),
        ("far from the origin", geometry(&[(0, far)])),
    ]
}

fn rays(geometry: &Geometry, count: usize, random: &mut Random) -> Vec<Ray> {
    let (low, high) = bounds(geometry);
    let (center, half) = ((low + high) / 2.0, (high - low) / 2.0);
    (0..count)
        .map(|index| {
            let origin = center + random.cube() * half * 1.5;
            let target = center + random.cube() * half;
            let direction = if index % 3 == 0 { random.direction() } else { (target - origin).normalize_or(Vec3::X) };
            let t_max = if index % 4 == 0 { half.length() * random.unit() } else { f32::INFINITY };
            let t_min = if index % 5 == 0 { half.length() * random.unit() * 0.2 } else { 0.0 };
            Ray { origin, direction, t_min, t_max }
        })
        .collect()
}

/// Whether rounding may decide the answer for this ray: its line passes an edge within 1e-3 in barycentric coordinates, or it hits within a
/// relative 1e-4 of an end of its interval, or it hits a triangle edge-on.
fn delicate(geometry: &Geometry, ray: &Ray) -> bool {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    (0..geometry.triangles.len()).any(|triangle| {
        let [a, b, c] = geometry.corners(triangle as u32).map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a);
        let slope = normal.normalize_or_zero().dot(direction).abs();
        let t = (a - origin).dot(normal) / normal.dot(direction);
        let point = origin + t * direction;
        let weight = |p: DVec3, q: DVec3| (q - p).cross(point - p).dot(normal) / normal.length_squared();
        let least = weight(a, b).min(weight(b, c)).min(weight(c, a));
        let size = t.abs().max(1.0) * 1.0e-4;
        let at_end = (t - f64::from(ray.t_min)).abs() < size || (t - f64::from(ray.t_max)).abs() < size;
        least.abs() < 1.0e-3 || least > -1.0e-3 && (at_end || slope < 1.0e-3)
    })
}

/// The number of rays for which two tracers differ although rounding does not decide.
fn disagreements(geometry: &Geometry, rays: &[Ray], ours: &Bvh, truth: &BruteForce) -> usize {
    let mut different = 0;
    for ray in rays {
        let (a, b) = (ours.closest(ray, NONE), truth.closest(ray, NONE));
        let same = match (a, b) {
            (None, None) => true,
            (Some(a), Some(b)) => {
                let scale = (ray.origin.abs().max_element() + b.t) * 4.0e-6;
                let exact_t = {
                    let [p, q, r] = geometry.corners(a.triangle).map(|corner| corner.as_dvec3());
                    let normal = (q - p).cross(r - p);
                    (p - ray.origin.as_dvec3()).dot(normal) / normal.dot(ray.direction.as_dvec3())
                };
                (a.t - b.t).abs() <= scale + b.t * 1e-5 && (f64::from(a.t) - exact_t).abs() <= f64::from(scale) * 4.0
            }
            _ => false,
        };
        let occluded = ours.occluded(ray, NONE) == a.is_some();
        let agree = same && occluded;
        if !agree && !delicate(geometry, ray) {
            different += 1;
        }
    }
    different
}

#[test]
fn hits_and_distances_agree_with_brute_force() {
    for (name, geometry) in scenes() {
        let rays = rays(&geometry, 3000, &mut Random::new(2));
        let truth = BruteForce::new(&geometry, &[]);
        for quality in [Quality::Fast, Quality::Balanced, Quality::Slow] {
            let bvh = Bvh::build(&geometry, &[], quality);
            assert_eq!(disagreements(&geometry, &rays, &bvh, &truth), 0, "{name}, {quality:?}");
        }
        let decided = rays.iter().filter(|ray| !delicate(&geometry, ray)).count();
        assert!(decided > rays.len() / 10, "{name}: {decided} rays say something");
    }
}

#[test]
fn a_missing_triangle_is_noticed_by_the_comparison() {
    for (name, geometry) in scenes() {
        let rays = rays(&geometry, 3000, &mut Random::new(2));
        let truth = BruteForce::new(&geometry, &[]);
        let seen =
            rays.iter().filter(|ray| !delicate(&geometry, ray)).find_map(|ray| truth.closest(ray, NONE)).unwrap();
        let mut without = geometry.clone();
        let twin = without.corners(seen.triangle);
        for triangle in 0..without.triangles.len() {
            if without.corners(triangle as u32) == twin {
                without.triangles[triangle] = [u32::MAX; 3];
            }
        }
        let bvh = Bvh::build(&without, &[], Quality::Balanced);
        assert!(disagreements(&geometry, &rays, &bvh, &truth) > 0, "{name}");
    }
}

#[test]
fn results_do_not_depend_on_the_tree_or_the_instruction_set() {
    for (name, geometry) in scenes() {
        let rays = rays(&geometry, 5000, &mut Random::new(3));
        let results = |bvh: Bvh| -> Vec<(Option<Hit>, bool)> {
            rays.iter().map(|ray| (bvh.closest(ray, NONE), bvh.occluded(ray, NONE))).collect()
        };
        let expected = results(
            Bvh::build(&geometry, &[], Quality::Balanced).with_instruction_set(InstructionSet::Portable).unwrap(),
        );
        for quality in [Quality::Fast, Quality::Balanced, Quality::Slow] {
            for lanes in SETS {
                match Bvh::build(&geometry, &[], quality).with_instruction_set(lanes) {
                    Some(bvh) => assert!(results(bvh) == expected, "{name}, {quality:?}, {lanes:?}"),
                    None => println!("skipped: this processor lacks {lanes:?}"),
                }
            }
        }
    }
}

#[test]
fn of_equal_distances_the_lowest_triangle_wins() {
    let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    for count in [1, 2, 7, 100, 3000] {
        let bvh = Bvh::build(&geometry(&[(0, vec![triangle; count])]), &[], Quality::Balanced);
        let hit = bvh.closest(&ray(Vec3::new(0.2, 0.3, 1.0), Vec3::NEG_Z), NONE).unwrap();
        assert_eq!((hit.triangle, hit.t), (0, 1.0), "{count}");
        assert!((hit.u - 0.2).abs() < 1e-6 && (hit.v - 0.3).abs() < 1e-6);
    }
}

#[test]
fn hits_at_the_ends_of_the_interval_do_not_count() {
    let scene =
        geometry(&[(0, vec![[Vec3::new(-1.0, -1.0, 0.0), Vec3::new(3.0, -1.0, 0.0), Vec3::new(-1.0, 3.0, 0.0)]])]);
    let bvh = Bvh::build(&scene, &[], Quality::Balanced);
    let truth = BruteForce::new(&scene, &[]);
    let up = 1.0 + f32::EPSILON;
    let down = 1.0 - f32::EPSILON;
    for (t_min, t_max, hit) in [(0.0, 1.0, false), (0.0, up, true), (1.0, 9.0, false), (down, 9.0, true)] {
        let ray = Ray { origin: Vec3::Z, direction: Vec3::NEG_Z, t_min, t_max };
        assert_eq!(bvh.closest(&ray, NONE).is_some(), hit, "{t_min} {t_max}");
        assert_eq!(bvh.occluded(&ray, NONE), hit, "{t_min} {t_max}");
        assert_eq!(truth.occluded(&ray, NONE), hit, "{t_min} {t_max}");
    }
    let on_it = ray(Vec3::ZERO, Vec3::new(0.6, 0.0, 0.8));
    assert!(!bvh.occluded(&on_it, NONE) && bvh.closest(&on_it, NONE).is_none());
}

#[test]
fn only_transparent_triangles_are_shown_to_the_closure_and_the_nearest_accepted_is_kept() {
    let mut random = Random::new(4);
    let scene = geometry(&[
        (2, soup(400, 0.4, &mut random)),
        (0, soup(400, 0.4, &mut random)),
        (1, soup(400, 0.4, &mut random)),
    ]);
    let transparent = [false, true];
    let bvh = Bvh::build(&scene, &transparent, Quality::Balanced);
    let truth = BruteForce::new(&scene, &transparent);
    let (mut asked, mut refused_nearest) = (0, 0);
    for ray in rays(&scene, 2000, &mut random) {
        let keep = |hit: &Hit| hit.triangle.is_multiple_of(3);
        let mut accept = |hit: &Hit| {
            assert_eq!(scene.material_of(hit.triangle), 1);
            asked += 1;
            keep(hit)
        };
        let ours = bvh.closest(&ray, &mut accept);
        let occluded = bvh.occluded(&ray, &mut accept);
        assert_eq!(ours.is_some(), occluded);
        if delicate(&scene, &ray) {
            continue;
        }
        let expected = truth.closest(&ray, keep);
        assert_eq!(ours.map(|hit| hit.triangle), expected.map(|hit| hit.triangle));
        refused_nearest += usize::from(truth.closest(&ray, |_| true).map(|h| h.triangle) != ours.map(|h| h.triangle));
    }
    assert!(asked > 1000 && refused_nearest > 100, "{asked} {refused_nearest}");
}

/// The number of open rays of a fan, each traced alone.
fn open_one_by_one(bvh: &Bvh, fan: &Fan<'_>, accept: impl Fn(&Hit) -> bool) -> usize {
    fan.rays().filter(|ray| !bvh.occluded(ray, &accept)).count()
}

/// The number of open rays of a fan, by gathered triangles; `None` if the triangles could not be gathered.
fn open_gathered(
    bvh: &Bvh,
    fan: &Fan<'_>,
    candidates: &mut Candidates,
    accept: impl Fn(&Hit) -> bool,
) -> Option<usize> {
    let Fan { origin, above, t_min, t_max, directions } = *fan;
    let around = Neighbourhood { origins: [origin; 2], above, t_min, t_max, rays: directions.len() };
    let mut vectors = Directions::default();
    vectors.extend(directions.iter().copied());
    if !bvh.gather(&around, candidates) {
        return None;
    }
    let may_be_blocked = candidates.turn_to(origin, above);
    let open = candidates.count_open(&vectors, &accept)? as usize;
    assert!(may_be_blocked || open == directions.len());
    Some(open)
}

#[test]
fn rays_of_a_neighbourhood_count_what_they_count_one_by_one() {
    for lanes in SETS {
        for (name, mut geometry) in scenes() {
            let half = geometry.triangles.len() as u32 / 2;
            let rest = geometry.triangles.len() as u32 - half;
            geometry.batches =
                vec![Batch { material: 0, first: 0, count: half }, Batch { material: 1, first: half, count: rest }];
            let Some(bvh) = Bvh::build(&geometry, &[false, true], Quality::Balanced).with_instruction_set(lanes) else {
                println!("skipped: this processor has no {lanes:?}");
                continue;
            };
            let accept = |hit: &Hit| !hit.triangle.is_multiple_of(3);
            let mut random = Random::new(9);
            let (mut candidates, mut directions) = (Candidates::default(), Directions::default());
            let (mut partly, mut clear, mut control) = (0, 0, 0);
            for round in 0..600 {
                let t_max = [0.02, 0.1, 0.3][round % 3];
                let corners = geometry.corners(random.below(geometry.triangles.len()) as u32);
                let center = (corners[0] + corners[1] + corners[2]) / 3.0 + random.cube() * 0.02;
                let size = [0.0, 0.01, 0.2][round / 3 % 3];
                let common = (round % 2 == 0).then(|| random.direction());
                let origins: Vec<Vec3> = (0..8).map(|_| center + random.cube() * size).collect();
                let low = origins.iter().fold(Vec3::INFINITY, |low, p| low.min(*p));
                let high = origins.iter().fold(Vec3::NEG_INFINITY, |high, p| high.max(*p));
                let t_min = if round % 5 == 0 { 1e-3 } else { 0.0 };
                let around = Neighbourhood { origins: [low, high], above: common, t_min, t_max, rays: 800 };
                let rays: Vec<Vec<Vec3>> = origins
                    .iter()
                    .map(|_| (0..20).map(|_| random.cosine(common.unwrap_or(Vec3::Y))).collect())
                    .collect();
                let fan = |(origin, directions)| Fan { origin, above: common, t_min, t_max, directions };
                let fans: Vec<Fan<'_>> =
                    origins.iter().copied().zip(rays.iter().map(Vec::as_slice)).map(fan).cycle().take(40).collect();
                let mut open = vec![0; fans.len()];
                bvh.count_open_near(&fans, &mut open, &mut candidates, |_, hit| accept(hit));
                for (fan, open) in fans.iter().zip(open) {
                    assert_eq!(open as usize, open_one_by_one(&bvh, fan, accept), "{name} {lanes:?} {t_max} {size}");
                }
                if !bvh.gather(&around, &mut candidates) {
                    continue;
                }
                for origin in origins {
                    let above = common.unwrap_or_else(|| random.direction());
                    let count = [100, 16, 300][round % 3];
                    let rays: Vec<Vec3> = (0..count).map(|_| random.cosine(above)).collect();
                    directions.clear();
                    directions.extend(rays.iter().copied());
                    let fan = Fan { origin, above: Some(above), t_min, t_max, directions: &rays };
                    let expected = open_one_by_one(&bvh, &fan, accept);
                    let may_be_blocked = candidates.turn_to(origin, Some(above));
                    let found = candidates.count_open(&directions, accept).expect("unit directions") as usize;
                    assert_eq!(found, expected, "{name} {lanes:?} {t_max} {size}");
                    assert!(may_be_blocked || found == rays.len(), "{name} {lanes:?}");
                    partly += usize::from(found > 0 && found < rays.len());
                    clear += usize::from(!may_be_blocked);
                    // Control: another origin, and another rule for transparent triangles, give other counts.
                    let elsewhere = Fan { origin: origin + Vec3::splat(0.05), ..fan };
                    control += usize::from(open_one_by_one(&bvh, &elsewhere, |_| true) != expected);
                }
            }
            assert!(partly > 100 && clear > 10 && control > 100, "{name}: {partly} {clear} {control}");
        }
    }
}

#[test]
fn a_fan_counts_what_its_rays_count() {
    for (name, geometry) in scenes() {
        let bvh = Bvh::build(&geometry, &[], Quality::Balanced);
        let mut random = Random::new(5);
        let (mut partly, mut gathered, mut candidates) = (0, 0, Candidates::default());
        for t_max in [0.01, 0.1, 0.5, 3.0, 50.0, f32::INFINITY] {
            for round in 0..400 {
                let triangle = random.below(geometry.triangles.len()) as u32;
                let corners = geometry.corners(triangle);
                let origin = (corners[0] + corners[1] + corners[2]) / 3.0 + random.cube() * 0.02;
                let above = random.direction();
                let count = if round % 40 == 0 { 300 } else { 16 };
                let mut directions: Vec<Vec3> = (0..count).map(|_| random.cosine(above)).collect();
                // Some rays go to vertices and edges of a nearby triangle, where bounding boxes decide nothing.
                let [a, b, c] = geometry.corners(random.below(geometry.triangles.len()) as u32);
                let targets = [a, b, c, (a + b) / 2.0, a + (c - a) * 0.3].map(|target| (target - origin).normalize());
                directions.extend(targets.iter().filter(|d| d.is_finite() && d.dot(above) > 0.0));
                for above in [None, Some(above)] {
                    let t_min = if round % 3 == 0 { 1e-4 } else { 0.0 };
                    let fan = Fan { origin, above, t_min, t_max, directions: &directions };
                    let open = bvh.count_open(&fan, NONE) as usize;
                    assert_eq!(open, open_one_by_one(&bvh, &fan, NONE), "{name} {t_max}");
                    partly += usize::from(open > 0 && open < directions.len());
                    if let Some(near) = open_gathered(&bvh, &fan, &mut candidates, NONE) {
                        assert_eq!(near, open, "{name} {t_max}, gathered");
                        gathered += usize::from(open > 0 && open < directions.len());
                    }
                }
            }
        }
        assert!(partly > 100 && gathered > 20, "{name}: {partly} {gathered}");
    }
}

#[test]
fn a_fan_counts_rays_of_any_direction_on_every_instruction_set() {
    // Directions along axes and in coordinate planes, with tiny components, not of unit length, and with NaN.
    let odd = [
        Vec3::X,
        Vec3::NEG_Y,
        Vec3::new(0.6, -0.0, 0.8),
        Vec3::new(0.0, 0.6, -0.8),
        Vec3::new(1e-30, 0.6, 0.8),
        Vec3::new(-1e-42, 0.6, 0.8),
        Vec3::new(0.3, 0.4, 3.0),
        Vec3::splat(1e-20),
        Vec3::ZERO,
        Vec3::new(f32::NAN, 0.0, 1.0),
        Vec3::new(f32::INFINITY, 0.0, 1.0),
    ];
    for (name, geometry) in scenes() {
        let mut expected = None;
        for lanes in SETS {
            let Some(bvh) = Bvh::build(&geometry, &[], Quality::Balanced).with_instruction_set(lanes) else { continue };
            let (mut random, mut counts, mut partly) = (Random::new(17), Vec::new(), 0);
            for round in 0..300 {
                let corners = geometry.corners(random.below(geometry.triangles.len()) as u32);
                let origin = (corners[0] + corners[1] + corners[2]) / 3.0 + random.cube() * 0.05;
                // From fewer rays than a packet to more than two packets; some packets contain only odd directions.
                let mut directions: Vec<Vec3> = (0..random.below(40)).map(|_| random.direction()).collect();
                for _ in 0..random.below(20) {
                    let at = random.below(directions.len() + 1);
                    directions.insert(at, odd[random.below(odd.len())]);
                }
                let t_max = [0.3, f32::INFINITY, -1.0][if round % 25 == 0 { 2 } else { round % 2 }];
                let fan = Fan { origin, above: None, t_min: 0.0, t_max, directions: &directions };
                let open = bvh.count_open(&fan, NONE) as usize;
                assert_eq!(open, open_one_by_one(&bvh, &fan, NONE), "{name} {lanes:?} {directions:?}");
                partly += usize::from(open > 0 && open < directions.len());
                counts.push(open);
            }
            assert!(partly > 100, "{name}: {partly}");
            assert_eq!(*expected.get_or_insert_with(|| counts.clone()), counts, "{name} {lanes:?}");
        }
    }
}

#[test]
fn a_fan_asks_for_hits_on_transparent_triangles() {
    let (_, mut geometry) = scenes().swap_remove(0);
    let half = geometry.triangles.len() as u32 / 2;
    let count = geometry.triangles.len() as u32 - half;
    geometry.batches = vec![Batch { material: 0, first: 0, count: half }, Batch { material: 1, first: half, count }];
    let bvh = Bvh::build(&geometry, &[false, true], Quality::Balanced);
    let accept = |hit: &Hit| hit.triangle.is_multiple_of(3);
    let (mut random, mut refused, mut gathered, mut candidates) = (Random::new(6), 0, 0, Candidates::default());
    for _ in 0..2000 {
        let corners = geometry.corners(random.below(geometry.triangles.len()) as u32);
        let origin = (corners[0] + corners[1] + corners[2]) / 3.0 + random.cube() * 0.05;
        let above = random.direction();
        let directions: Vec<Vec3> = (0..40).map(|_| random.cosine(above)).collect();
        let fan = Fan { origin, above: Some(above), t_min: 0.0, t_max: 0.5, directions: &directions };
        let open = bvh.count_open(&fan, accept) as usize;
        assert_eq!(open, open_one_by_one(&bvh, &fan, accept));
        if let Some(near) = open_gathered(&bvh, &fan, &mut candidates, accept) {
            assert_eq!(near, open);
            gathered += 1;
        }
        refused += usize::from(open != open_one_by_one(&bvh, &fan, |_| true));
    }
    assert!(refused > 50 && gathered > 50, "{refused} {gathered}");
}

#[test]
fn fans_agree_whatever_the_scale_and_the_distance_from_the_origin() {
    for (scale, distance) in [(1e-6, 0.0), (1e-3, 10.0), (1.0, 1e3), (1e3, 1e5), (1e6, 0.0), (1e-20, 0.0), (1e17, 0.0)]
    {
        let mut random = Random::new(8);
        let triangles: Vec<[Vec3; 3]> = (0..300)
            .map(|_| {
                let center = random.cube();
                [0, 1, 2].map(|_| (center + random.cube() * 0.2) * scale + Vec3::splat(distance))
            })
            .collect();
        let geometry = geometry(&[(0, triangles)]);
        let bvh = Bvh::build(&geometry, &[], Quality::Balanced);
        let (mut candidates, mut gathered) = (Candidates::default(), 0);
        for _ in 0..500 {
            let origin = random.cube() * scale + Vec3::splat(distance);
            let directions: Vec<Vec3> = (0..50).map(|_| random.direction()).collect();
            let fan = Fan { origin, above: None, t_min: 0.0, t_max: 0.4 * scale, directions: &directions };
            let expected = open_one_by_one(&bvh, &fan, NONE);
            assert_eq!(bvh.count_open(&fan, NONE) as usize, expected, "{scale} {distance}");
            if let Some(near) = open_gathered(&bvh, &fan, &mut candidates, NONE) {
                assert_eq!(near, expected, "{scale} {distance}, gathered");
                gathered += 1;
            }
        }
        assert!(gathered > 20, "{scale} {distance}: {gathered}");
    }
}
