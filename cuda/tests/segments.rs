//! Compares rows of pairs between an NVIDIA GPU, which traces their segments, and the processor.
//!
//! Without a GPU the tests print `skipped: why` and pass; with `CURITIBA_REQUIRE_CUDA_TESTS=1` they fail instead. The binary runs on any
//! machine: where it was not built, it looks for the square in the current folder.

use curitiba_cuda::{CudaSegments, OptixSegments};
use curitiba_passes::trace::{Bvh, Quality, Ray, Recent, Segment, SegmentTracer, Segments, Tracer as _};
use curitiba_passes::visibility::{
    Class, DeviceEstimator, Effort, Estimator, NearPairs, Options, PairSource, Row, RowFinder, Sampler, Surfaces,
};
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::scene::{self, Batch, BuildOptions, Geometry, LoadOptions, RenderScene};
use glam::Vec3;
use std::path::Path;
use std::time::Instant;

const BOTH: [&str; 2] = ["cuda", "optix"];

/// The tracer, or `None` if it is missing; the reason is printed.
fn there(backend: &str, geometry: &Geometry, see_through: &[bool]) -> Option<Box<dyn SegmentTracer>> {
    let made = || -> Result<Box<dyn SegmentTracer>, BackendError> {
        Ok(if backend == "cuda" {
            Box::new(CudaSegments::new(geometry, see_through)?)
        } else {
            Box::new(OptixSegments::new(geometry, see_through)?)
        })
    };
    match made() {
        Ok(tracer) => Some(tracer),
        Err(error) => {
            let required = std::env::var_os("CURITIBA_REQUIRE_CUDA_TESTS").is_some_and(|value| value == "1");
            assert!(!required, "{error}");
            println!("skipped: {error}");
            None
        }
    }
}

struct Random(u64);

impl Random {
    fn number(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.number(), self.number(), self.number())
    }
}

fn geometry(triangles: &[[Vec3; 3]]) -> Geometry {
    let count = triangles.len() as u32;
    Geometry {
        positions: triangles.iter().flatten().copied().collect(),
        triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        batches: vec![Batch { material: 0, first: 0, count }],
        ..Geometry::default()
    }
}

/// Two triangles that face each other. Between them, at x < `c`, lies a grid of more triangles than are gathered.
fn half_grid(c: f32) -> Vec<[Vec3; 3]> {
    let v = Vec3::new;
    let mut scene = vec![
        [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)],
        [v(0.0, 0.0, 1.0), v(0.0, 1.0, 1.0), v(1.0, 0.0, 1.0)],
    ];
    for i in 0..32 {
        for j in 0..64 {
            let at =
                |i: i32, j: i32| v(if i == 32 { c } else { c - 1.0 + i as f32 / 32.0 }, j as f32 / 32.0 - 0.5, 0.5);
            scene.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            scene.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    scene
}

/// Some large triangles around a cloud of small ones, of two materials.
fn soup(seed: u64) -> Geometry {
    let mut random = Random(seed);
    let mut scene = Vec::new();
    for _ in 0..60 {
        let at = random.point() * 8.0 - 2.0;
        scene.push([0; 3].map(|_| at + (random.point() - 0.5) * 3.0));
    }
    for _ in 0..4000 {
        let at = random.point() * 4.0;
        scene.push([0; 3].map(|_| at + (random.point() - 0.5) * 0.2));
    }
    let mut geometry = geometry(&scene);
    geometry.batches =
        vec![Batch { material: 0, first: 0, count: 3060 }, Batch { material: 1, first: 3060, count: 1000 }];
    geometry
}

fn on_processor(surfaces: &Surfaces, pairs: &[[u32; 2]], options: Options) -> Vec<Row> {
    let bvh = Bvh::build(surfaces.geometry(), &surfaces.marks(), Quality::default());
    let mut rows = Vec::new();
    Estimator::new(surfaces, &bvh, options).expect("valid").rows(pairs, &mut rows);
    rows
}

fn on_device(surfaces: &Surfaces, tracer: Box<dyn SegmentTracer>, pairs: &[[u32; 2]], options: Options) -> Vec<Row> {
    let mut rows = Vec::new();
    let start = Instant::now();
    let name = tracer.name();
    let mut finder = DeviceEstimator::new(surfaces, tracer, options).expect("valid");
    finder.rows(pairs, &mut rows).expect("the device works");
    let samples: u64 = rows.iter().map(|row| u64::from(row.samples)).sum();
    println!("{name}: {} pairs, {samples} samples in {:?}", pairs.len(), start.elapsed());
    rows
}

/// The number of rows that differ; for `cuda` none may.
fn compare(backend: &str, found: &[Row], expected: &[Row]) -> usize {
    let different = found.iter().zip(expected).filter(|(found, expected)| found != expected);
    let different: Vec<_> = different.collect();
    if backend == "cuda" {
        assert_eq!(different, []);
    }
    for (found, expected) in &different {
        assert_eq!((found.pair, found.class, found.samples), (expected.pair, expected.class, expected.samples));
        let [seen, as_seen] = [found, expected].map(|row| row.visibility.unwrap_or(-1.0));
        // Segments that graze an edge may be decided differently.
        assert!((seen - as_seen).abs() <= 2.0 / f64::from(found.valid.max(1)) + 1e-12, "{found:?} {expected:?}");
    }
    println!("{backend}: {} of {} rows differ", different.len(), expected.len());
    different.len()
}

fn options(samples: u32) -> Options {
    Options { effort: Effort::Samples(samples), form_factors: true, ..Options::default() }
}

#[test]
fn a_half_plane_of_many_triangles_leaves_what_the_polynomial_says() {
    for (c, visibility, form_factor) in
        [(0.1, 0.930_4, 0.106_266), (0.25, 0.656_25, 0.072_889), (0.5, 1.0 / 6.0, 0.019_89)]
    {
        let surfaces = Surfaces::new(&geometry(&half_grid(c)), &[]);
        for backend in BOTH {
            let Some(tracer) = there(backend, surfaces.geometry(), &[]) else { continue };
            let [row] = on_device(&surfaces, tracer, &[[0, 1]], options(8192))[..] else { panic!("one row") };
            let found = row.visibility.expect("they face each other");
            assert_eq!((row.class, row.samples), (Class::Sampled, 8192), "{backend}");
            assert!((found - visibility).abs() < 4.0 * row.error.max(1e-4), "{backend} {c}: {found} ± {}", row.error);
            let ([f, _], error) = (row.form_factors.expect("asked for"), row.form_factor_errors[0]);
            assert!((f - form_factor).abs() < 4.0 * error.max(1e-5), "{backend} {c}: {f} ± {error}");
        }
    }
}

#[test]
fn rows_of_random_soups_are_those_of_the_processor() {
    for (seed, see_through) in [(1, vec![]), (2, vec![false, true]), (3, vec![])] {
        let surfaces = Surfaces::new(&soup(seed), &see_through);
        let pairs: Vec<[u32; 2]> =
            (0..200).flat_map(|a| (a + 1..400).map(move |b| [b, a])).filter(|[a, b]| (a * 7 + b) % 3 == 0).collect();
        let all = [
            options(64),
            Options { effort: Effort::Error(0.05), sampler: Sampler::Hammersley, form_factors: false, ..options(64) },
        ];
        for options in all {
            let expected = on_processor(&surfaces, &pairs, options);
            let sampled = expected.iter().filter(|row| row.class == Class::Sampled).count();
            assert!(sampled > 500, "{sampled}");
            for backend in BOTH {
                let Some(tracer) = there(backend, surfaces.geometry(), surfaces.see_through_materials()) else {
                    continue;
                };
                let found = on_device(&surfaces, tracer, &pairs, options);
                let different = compare(backend, &found, &expected);
                assert!(different * 200 <= sampled, "{backend}: {different} of {sampled}");
            }
        }
    }
}

/// The square that is shipped with the repository.
fn square() -> Surfaces {
    let built = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let root = if built.is_dir() { built.as_path() } else { Path::new(".") };
    let file = root.join("xml_projects/3dsmodels/largoCamoes.cbo");
    let scene = scene::load(&[file], &LoadOptions::default(), &|_| {}).expect("the square loads");
    let (scene, _) = RenderScene::build(scene, &BuildOptions::default()).expect("it is built");
    Surfaces::new(&scene.geometry, &[])
}

#[test]
fn rows_of_the_square_are_those_of_the_processor() {
    let surfaces = square();
    let (mut source, mut pairs) = (NearPairs::new(&surfaces, 0.01), Vec::new());
    source.seek([2000, 0]).expect("its own");
    source.fill(20_000, &mut pairs).expect("no errors");
    pairs.truncate(20_000);
    let options = Options { form_factors: false, ..options(64) };
    let expected = on_processor(&surfaces, &pairs, options);
    for backend in BOTH {
        let Some(tracer) = there(backend, surfaces.geometry(), surfaces.see_through_materials()) else { continue };
        let different = compare(backend, &on_device(&surfaces, tracer, &pairs, options), &expected);
        assert!(different * 100 <= pairs.len(), "{backend}: {different}");
    }
}

/// Also prints the device's throughput: answers per second for segments made in advance, including the copies in both directions.
#[test]
fn millions_of_segments_of_the_square_are_answered_as_the_processor_does() {
    let surfaces = square();
    let geometry = surfaces.geometry();
    let (mut random, count) = (Random(5), geometry.triangles.len() as f32);
    let mut place = || {
        let id = (random.number() * count) as u32;
        let [a, b, c] = geometry.corners(id);
        let (u, v) = (random.number(), random.number());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        (a + u * (b - a) + v * (c - a), id)
    };
    let reach = 1024.0;
    let mut segments = Segments::default();
    for pair in 0..1 << 22 {
        let ((from, first), (to, second)) = (place(), place());
        let along = (to - from) / reach;
        segments.all.push(Segment { from: from.to_array(), end: reach, along: along.to_array(), pair });
        segments.own.push([first, second]);
    }
    let bvh = Bvh::build(geometry, &surfaces.marks(), Quality::default());
    let blocked = |segment: &Segment| {
        let [origin, direction] = [segment.from, segment.along].map(Vec3::from_array);
        let ray = Ray { origin, direction, t_min: 0.0, t_max: segment.end };
        let own = segments.own[segment.pair as usize];
        bvh.blocked_by(&[ray], &mut Recent::default(), |id| !own.contains(&id))
    };
    let expected: Vec<u64> = segments.all[..64 * 1000]
        .chunks(64)
        .map(|some| some.iter().enumerate().map(|(index, segment)| blocked(segment) << index).sum())
        .collect();
    for backend in BOTH {
        let Some(mut tracer) = there(backend, geometry, &[]) else { continue };
        let (mut bits, mut best) = (Vec::new(), f64::INFINITY);
        for _ in 0..5 {
            let start = Instant::now();
            tracer.blocked(&segments, &mut bits).expect("the device works");
            best = best.min(start.elapsed().as_secs_f64());
        }
        let blocked: u32 = bits.iter().map(|word| word.count_ones()).sum();
        let rate = segments.all.len() as f64 / best * 1e-6;
        println!("{backend}: {} segments, {blocked} blocked, {rate:.0} million a second", segments.all.len());
        let found = bits.chunks(2).map(|words| u64::from(words[0]) | u64::from(words[1]) << 32);
        let different: u32 = found.zip(&expected).map(|(found, expected)| (found ^ expected).count_ones()).sum();
        assert!(different <= if backend == "cuda" { 0 } else { 640 }, "{backend}: {different} of 64000 differ");
    }
}

/// Counts below, at and above the limit of a launch, and counts that are not a multiple of a word's bits.
#[test]
fn any_number_of_segments_is_answered() {
    let wall = [Vec3::new(-9.0, -9.0, 0.5), Vec3::new(30.0, -9.0, 0.5), Vec3::new(-9.0, 30.0, 0.5)];
    let geometry = geometry(&[wall]);
    for backend in BOTH {
        let Some(mut tracer) = there(backend, &geometry, &[]) else { continue };
        let mut bits = vec![7];
        tracer.blocked(&Segments::default(), &mut bits).expect("nothing is asked");
        assert!(bits.is_empty());
        for count in [1, 31, 33, 1000, (1 << 22) + 77] {
            // Every third segment ends before the wall; every fifth has the wall as one of its own triangles.
            let segment = |index: usize| Segment {
                from: [0.1, 0.1, 0.0],
                end: if index.is_multiple_of(3) { 0.4 } else { 1.0 },
                along: [0.0, 0.0, 1.0],
                pair: u32::from(index.is_multiple_of(5)),
            };
            let segments = Segments { all: (0..count).map(segment).collect(), own: vec![[7, 8], [0, 7]] };
            tracer.blocked(&segments, &mut bits).expect("the device works");
            assert_eq!(bits.len(), count.div_ceil(32));
            for index in 0..count {
                let expected = !index.is_multiple_of(3) && !index.is_multiple_of(5);
                assert_eq!(bits[index / 32] >> (index % 32) & 1 == 1, expected, "{backend}: {index} of {count}");
            }
        }
    }
}
