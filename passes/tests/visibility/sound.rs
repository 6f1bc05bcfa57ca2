//! A decision without rays must hold for every segment between the two triangles.

use super::*;
use curitiba_passes::trace::{BruteForce, Hit, Ray, Tracer};
use curitiba_passes::visibility::{AllPairs, Class, NearPairs, PairSource, RowPairs};
use proptest::prelude::*;

/// Samples random segments that leave the front of both triangles. Returns the number of segments, of blocked ones and of open ones.
/// Segments for which rounding may decide are counted as neither.
fn segments([a, b]: [u32; 2], scene: &[Triangle], count: u32, random: &mut Random) -> [u32; 3] {
    let (first, second) = (scene[a as usize], scene[b as usize]);
    let (mut valid, mut blocked, mut open) = (0, 0, 0);
    for _ in 0..count {
        let from = on(&first, random.number(), random.number());
        let to = on(&second, random.number(), random.number());
        let distance = known_distance(from, to);
        if is_valid(&first, &second, from, to, distance) {
            let any = |distance: f64| {
                let mut others = (0_u32..).zip(scene).filter(|(id, _)| *id != a && *id != b);
                others.any(|(_, triangle)| blocks(triangle, from, to, distance))
            };
            valid += 1;
            blocked += u32::from(any(distance));
            open += u32::from(!any(-distance));
        }
    }
    [valid, blocked, open]
}

/// Whether a triangle is thinner than the rounding of its corners, so that its orientation is unknown.
fn is_thin([a, b, c]: &Triangle) -> bool {
    let [a, b, c] = [a, b, c].map(|corner| corner.as_dvec3());
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    (b - a).cross(c - a).length() < 1e-5 * longest
}

fn check(scene: &[Triangle], count: u32, random: &mut Random) -> Result<[u32; 4], TestCaseError> {
    let mut classes = [0; 4];
    for row in rows(scene, &all_pairs(scene.len()), Options { form_factors: false, ..options(64) }) {
        classes[row.class as usize] += 1;
        if row.pair.iter().any(|id| is_thin(&scene[*id as usize])) {
            continue;
        }
        let [valid, blocked, open] = segments(row.pair, scene, count, random);
        match row.class {
            Class::Never => prop_assert_eq!(valid, 0, "{:?}", row),
            Class::Open => prop_assert_eq!(blocked, 0, "{:?}", row),
            Class::Closed => prop_assert_eq!(open, 0, "{:?}", row),
            Class::Sampled => {}
        }
    }
    Ok(classes)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn random_soups_hold_no_pair_that_is_decided_wrongly(
        corners in prop::collection::vec(prop::array::uniform9(-8_i8..8), 2..14),
        size in prop::sample::select(vec![0.01_f32, 1.0, 300.0]),
        seed in any::<u64>(),
    ) {
        // Integer coordinates, so that many corners, edges and planes coincide.
        let at = |c: &[i8; 9], k: usize| v(f32::from(c[k]), f32::from(c[k + 1]), f32::from(c[k + 2])) * size;
        let scene: Vec<Triangle> = corners.iter().map(|c| [at(c, 0), at(c, 3), at(c, 6)]).collect();
        check(&scene, 200, &mut Random(seed))?;
    }
}

#[test]
fn large_walls_and_small_triangles_hold_none_either_and_all_classes_occur() {
    let mut random = Random(77);
    let mut seen = [0; 4];
    for _ in 0..12 {
        let mut scene = Vec::new();
        for _ in 0..30 {
            let at = random.point() * 4.0;
            scene.push([0, 1, 2].map(|_| at + (random.point() - 0.5) * 0.3));
        }
        for _ in 0..6 {
            let at = random.point() * 4.0;
            let (x, y) = ((random.point() - 0.5) * 6.0, (random.point() - 0.5) * 6.0);
            scene.extend(quad(at - x - y, at + x - y, at + x + y, at - x + y));
        }
        let classes = check(&scene, 300, &mut random).expect("sound");
        for (all, some) in seen.iter_mut().zip(classes) {
            *all += some;
        }
    }
    assert!(seen.iter().all(|count| *count > 100), "{seen:?}");
}

/// Environment variable that checks a million pairs of random soups, which takes minutes in a release build.
const MANY: &str = "CURITIBA_MILLION_PAIRS";

#[test]
fn a_million_pairs_hold_none_that_is_decided_wrongly() {
    let wanted = if std::env::var_os(MANY).is_some() { 1_000_000 } else { 3_000 };
    let (mut random, mut seen) = (Random(4242), [0_u32; 4]);
    while seen.iter().sum::<u32>() < wanted {
        let small = 8 + (random.number() * 16.0) as usize;
        let mut scene: Vec<Triangle> = (0..small)
            .map(|_| {
                let (at, size) = (random.point() * 4.0, 0.05 + 2.0 * (random.number() as f32).powi(3));
                [0; 3].map(|_| at + (random.point() - 0.5) * size)
            })
            .collect();
        for _ in 0..3 {
            let at = random.point() * 4.0;
            let (x, y) = ((random.point() - 0.5) * 6.0, (random.point() - 0.5) * 6.0);
            scene.extend(quad(at - x - y, at + x - y, at + x + y, at - x + y));
        }
        let classes = check(&scene, 100, &mut random).expect("sound");
        for (all, some) in seen.iter_mut().zip(classes) {
            *all += some;
        }
    }
    println!("{seen:?} of never, open, closed, sampled");
}

/// A tracer that counts rays.
struct Counted(BruteForce, std::sync::atomic::AtomicU32);

impl Tracer for Counted {
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.0.closest(ray, accept)
    }

    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool {
        self.1.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.0.occluded(ray, accept)
    }
}

#[test]
fn pairs_with_many_triangles_between_them_are_traced_and_agree_with_the_truth() {
    for (count, traced) in [(100, false), (400, true)] {
        let mut random = Random(3);
        let mut scene = facing().to_vec();
        for _ in 0..count {
            // Small triangles in the middle of the shaft between the pair.
            let at = v(0.05, 0.05, 0.3) + random.point() * v(0.4, 0.4, 0.4);
            scene.push([0, 1, 2].map(|_| at + (random.point() - 0.5) * 0.1));
        }
        let surfaces = Surfaces::new(&geometry(&scene), &[]);
        let tracer = Counted(BruteForce::new(surfaces.geometry(), &surfaces.marks()), 0.into());
        let estimator = Estimator::new(&surfaces, &tracer, options(1024)).expect("valid");
        let row = estimator.row([0, 1], &mut Room::default());
        assert_eq!(tracer.1.into_inner() > 0, traced);
        let truth = truth(&scene, 60_000).expect("they face each other");
        assert!((row.visibility.expect("seen") - truth).abs() < 4.0 * row.error, "{row:?} {truth}");
        assert!(truth > 0.05 && truth < 0.95);
        let fast = super::row(&scene, [0, 1], options(1024));
        assert!((fast.visibility.expect("seen") - row.visibility.expect("seen")).abs() < 2.0 / 1024.0);
    }
}

#[test]
fn what_is_not_opaque_blocks_nothing() {
    let scene = [facing(), half_plane(20.0)].concat();
    let mut geometry = geometry(&scene);
    geometry.batches = vec![Batch { material: 0, first: 0, count: 2 }, Batch { material: 1, first: 2, count: 2 }];
    for (marks, visibility) in [([false, false], 0.0), ([false, true], 1.0), ([true, false], 0.0)] {
        let surfaces = Surfaces::new(&geometry, &marks);
        let bvh = Bvh::build(surfaces.geometry(), &surfaces.marks(), Quality::Fast);
        let row = Estimator::new(&surfaces, &bvh, options(64)).expect("valid").row([0, 1], &mut Room::default());
        assert_eq!(row.visibility, Some(visibility));
        assert_eq!(surfaces.see_through(), if marks.contains(&true) { 2 } else { 0 });
    }
}

fn drain(source: &mut impl PairSource, most: usize) -> Vec<[u32; 2]> {
    let mut all = Vec::new();
    loop {
        let before = all.len();
        source.fill(most, &mut all).expect("no errors");
        if all.len() == before {
            return all;
        }
    }
}

#[test]
fn streams_give_every_pair_once_and_go_on_from_any_cursor() {
    assert_eq!(drain(&mut AllPairs::new(7), 4), all_pairs(7));
    assert!(drain(&mut AllPairs::new(1), 4).is_empty() && drain(&mut AllPairs::new(0), 4).is_empty());
    assert_eq!(drain(&mut RowPairs::new(4, 2), 2), [[2, 0], [2, 1], [2, 3]]);
    let mut source = AllPairs::new(9);
    let mut pairs = Vec::new();
    source.fill(10, &mut pairs).expect("no errors");
    assert_eq!(source.progress(), [10, 36]);
    let cursor = source.cursor();
    let mut other = AllPairs::new(9);
    other.seek(cursor).expect("its own");
    pairs.extend(drain(&mut other, 100));
    assert_eq!(pairs, all_pairs(9));
}

#[test]
fn near_pairs_are_those_that_the_bound_leaves() {
    let mut random = Random(11);
    let scene: Vec<Triangle> = (0..300)
        .map(|_| {
            let (at, size) = (random.point() * 10.0, 0.1 + 2.0 * (random.number() as f32).powi(4));
            [0, 1, 2].map(|_| at + random.point() * size)
        })
        .collect();
    let surfaces = Surfaces::new(&geometry(&scene), &[]);
    let rows = rows(&scene, &all_pairs(scene.len()), options(64));
    for least in [0.3, 0.01, 1e-4] {
        let expected: Vec<[u32; 2]> = rows
            .iter()
            .filter(|row| row.class != Class::Never)
            .map(|row| row.pair)
            .filter(|[a, b]| {
                let extent = |id: u32| {
                    let [a, b, c] = scene[id as usize];
                    [a.min(b).min(c), a.max(b).max(c)]
                };
                let ([low, high], [l, h]) = (extent(*a), extent(*b));
                let gap = (l - high).max(low - h).max(Vec3::ZERO).as_dvec3().length_squared();
                surfaces.area(*a).max(surfaces.area(*b)) >= least * std::f64::consts::PI * gap
            })
            .collect();
        assert_eq!(drain(&mut NearPairs::new(&surfaces, least), 1000), expected, "{least}");
        assert!(!expected.is_empty() && expected.len() < 40_000);
    }
    // No pair that is left out has a form factor above the bound.
    let near = drain(&mut NearPairs::new(&surfaces, 0.01), 1000);
    let missed = rows.iter().filter(|row| near.binary_search(&row.pair).is_err());
    assert!(missed.into_iter().all(|row| row.form_factors.expect("asked for").iter().all(|f| *f < 0.01 + 1e-6)));
}
