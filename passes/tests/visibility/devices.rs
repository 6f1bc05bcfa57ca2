//! Rows computed with a device against those of the processor.

use super::*;
use curitiba_passes::raster::gpu::AdapterChoice;
use curitiba_passes::trace::{Hit, Ray, SegmentTracer, Segments, Tracer};
use curitiba_passes::visibility::{Class, DeviceEstimator, RowFinder, Sampler};
use curitiba_passes::wgpu_rays::WgpuSegments;
use curitiba_pipeline::backend::BackendError;

/// The processor as a stand-in for a device.
struct Stand<'a>(&'a Surfaces, Bvh);

impl SegmentTracer for Stand<'_> {
    fn name(&self) -> &'static str {
        "stand-in"
    }

    fn device(&self) -> String {
        String::new()
    }

    fn blocked(&mut self, segments: &Segments, bits: &mut Vec<u32>) -> Result<(), BackendError> {
        bits.clear();
        bits.resize(segments.all.len().div_ceil(32), 0);
        for (index, segment) in segments.all.iter().enumerate() {
            let [origin, direction] = [segment.from, segment.along].map(Vec3::from_array);
            let own = segments.own[segment.pair as usize];
            let ray = Ray { origin, direction, t_min: 0.0, t_max: segment.end };
            let accept = |hit: &Hit| !own.contains(&hit.triangle);
            bits[index / 32] |= u32::from(self.1.occluded(&ray, accept)) << (index % 32);
        }
        assert!(self.0.see_through() == 0);
        Ok(())
    }
}

/// A room with two clusters of small triangles, so that many pairs have more than 128 triangles between them.
fn cluttered() -> Vec<Triangle> {
    let mut random = Random(23);
    let mut scene = boxed(v(0.0, 0.0, 0.0), v(3.0, 2.0, 4.0), true);
    for _ in 0..500 {
        let at = v(0.5, 0.4, 1.0) + random.point() * v(2.0, 1.0, 2.0);
        scene.push([0, 1, 2].map(|_| at + (random.point() - 0.5) * 0.15));
    }
    scene
}

/// The unit triangles, and between them the half plane x < `c` as a grid of so many triangles that rays must be traced.
fn half_grid(c: f32) -> Vec<Triangle> {
    let mut scene = facing().to_vec();
    let (across, down) = (32, 64);
    let low = [v(c - 1.0, -0.5, 0.5), v(1.0, 2.0, 0.0)];
    for i in 0..across {
        for j in 0..down {
            let at = |i: i32, j: i32| {
                let x = if i == across { c } else { low[0].x + i as f32 / across as f32 };
                v(x, low[0].y + low[1].y * j as f32 / down as f32, 0.5)
            };
            scene.extend(quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)));
        }
    }
    scene
}

/// A tracer that counts segments.
struct Counted<'a>(Box<dyn SegmentTracer + 'a>, &'a mut usize);

impl SegmentTracer for Counted<'_> {
    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn device(&self) -> String {
        self.0.device()
    }

    fn blocked(&mut self, segments: &Segments, bits: &mut Vec<u32>) -> Result<(), BackendError> {
        *self.1 += segments.all.len();
        self.0.blocked(segments, bits)
    }
}

/// Computes the rows with a device, and asserts that it traces some segments.
fn on_device(
    surfaces: &Surfaces,
    tracer: Box<dyn SegmentTracer + '_>,
    pairs: &[[u32; 2]],
    options: Options,
) -> Vec<Row> {
    let (mut found, mut asked) = (Vec::new(), 0);
    let tracer = Box::new(Counted(tracer, &mut asked));
    let mut estimator = DeviceEstimator::new(surfaces, tracer, options).expect("valid");
    estimator.rows(pairs, &mut found).expect("the device works");
    drop(estimator);
    assert!(asked > 500, "{asked} segments");
    found
}

/// The pairs of the walls, and some pairs of the clutter.
fn pairs_of(scene: &[Triangle]) -> Vec<[u32; 2]> {
    let all = all_pairs(scene.len());
    all.into_iter().filter(|[a, b]| *b < 12 || (a + b) % 97 == 0).collect()
}

#[test]
fn a_device_that_traces_as_the_processor_does_gives_its_bits() {
    let scene = cluttered();
    let surfaces = Surfaces::new(&geometry(&scene), &[]);
    let pairs = pairs_of(&scene);
    for (effort, sampler) in [
        (Effort::Samples(64), Sampler::Sobol),
        (Effort::Samples(1024), Sampler::Hammersley),
        (Effort::Error(0.02), Sampler::Sobol),
        (Effort::Error(0.04), Sampler::Hammersley),
    ] {
        for facing in BOTH {
            let options = Options { effort, sampler, facing, ..options(64) };
            let pairs: Vec<_> =
                pairs.iter().copied().step_by(if effort == Effort::Samples(64) { 1 } else { 9 }).collect();
            let expected = rows(&scene, &pairs, options);
            let stand = Stand(&surfaces, Bvh::build(surfaces.geometry(), &surfaces.marks(), Quality::Fast));
            assert_eq!(on_device(&surfaces, Box::new(stand), &pairs, options), expected, "{options:?}");
        }
    }
}

/// A tracer that only traces single rays.
struct Plain(Bvh);

impl Tracer for Plain {
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.0.closest(ray, accept)
    }

    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool {
        self.0.occluded(ray, accept)
    }
}

#[test]
fn what_stopped_the_rays_before_changes_no_row() {
    let scene = cluttered();
    let surfaces = Surfaces::new(&geometry(&scene), &[]);
    let bvh = || Bvh::build(surfaces.geometry(), &surfaces.marks(), Quality::Fast);
    let (fast, plain) = (bvh(), Plain(bvh()));
    let (fast, plain) = (Estimator::new(&surfaces, &fast, options(64)), Estimator::new(&surfaces, &plain, options(64)));
    let (fast, plain) = (fast.expect("valid"), plain.expect("valid"));
    // One `Room` for all pairs, which remembers the hit of the previous pair.
    let (mut room, mut sampled) = (Room::default(), 0);
    for pair in pairs_of(&scene) {
        let row = fast.row(pair, &mut room);
        assert_eq!(row, plain.row(pair, &mut Room::default()));
        sampled += usize::from(row.class == Class::Sampled);
    }
    assert!(sampled > 100, "{sampled}");
}

#[test]
fn a_device_that_fails_is_told() {
    struct Broken;
    impl SegmentTracer for Broken {
        fn name(&self) -> &'static str {
            "broken"
        }
        fn device(&self) -> String {
            String::new()
        }
        fn blocked(&mut self, _: &Segments, _: &mut Vec<u32>) -> Result<(), BackendError> {
            Err(BackendError::Device { backend: "broken", message: "gone".to_owned() })
        }
    }
    let scene = half_grid(0.25);
    let surfaces = Surfaces::new(&geometry(&scene), &[]);
    let mut estimator = DeviceEstimator::new(&surfaces, Box::new(Broken), options(64)).expect("valid");
    let error = estimator.rows(&[[0, 1]], &mut Vec::new()).expect_err("it is asked");
    assert_eq!(error.to_string(), "broken: gone");
}

/// The backend for the triangles, or `None` with a printed reason where this machine has no device.
fn wgpu(geometry: &Geometry, see_through: &[bool]) -> Option<Box<dyn SegmentTracer>> {
    match WgpuSegments::new(AdapterChoice::Any, geometry, see_through) {
        Ok(tracer) => Some(Box::new(tracer)),
        Err(error) => {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none_or(|value| value != "1"), "{error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}

#[test]
fn wgpu_finds_what_a_half_plane_of_many_triangles_leaves() {
    for (c, visibility) in [(0.1, 0.930_4), (0.25, 0.656_25), (0.5, 1.0 / 6.0)] {
        let scene = half_grid(c);
        let surfaces = Surfaces::new(&geometry(&scene), &[]);
        let Some(tracer) = wgpu(surfaces.geometry(), surfaces.see_through_materials()) else { return };
        let [row] = on_device(&surfaces, tracer, &[[0, 1]], options(4096))[..] else { panic!("one row") };
        assert_eq!((row.class, row.samples), (Class::Sampled, 4096));
        let found = row.visibility.expect("they face each other");
        assert!((found - visibility).abs() < 4.0 * row.error.max(1e-4), "{c}: {found} ± {}", row.error);
    }
}

#[test]
fn wgpu_gives_the_rows_of_the_processor() {
    let scene = cluttered();
    let surfaces = Surfaces::new(&geometry(&scene), &[]);
    let pairs = pairs_of(&scene);
    let Some(tracer) = wgpu(surfaces.geometry(), surfaces.see_through_materials()) else { return };
    let (found, expected) = (on_device(&surfaces, tracer, &pairs, options(64)), rows(&scene, &pairs, options(64)));
    let mut traced = 0;
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!((found.pair, found.class, found.valid), (expected.pair, expected.class, expected.valid));
        traced += usize::from(found.class == Class::Sampled);
        // A driver that fuses products may decide a segment through an edge differently: at most one of 64 here.
        let [seen, as_seen] = [found, expected].map(|row| row.visibility.unwrap_or(-1.0));
        assert!((seen - as_seen).abs() <= 1.0 / 64.0 + 1e-12, "{found:?} {expected:?}");
    }
    let different = found.iter().zip(&expected).filter(|(found, expected)| found != expected).count();
    println!("{different} of {traced} sampled rows differ");
    assert!(traced > 100 && different * 100 <= traced, "{different} of {traced}");
}

#[test]
fn wgpu_leaves_out_what_is_not_opaque() {
    let scene = half_grid(1.0);
    let mut geometry = geometry(&scene);
    let count = scene.len() as u32 - 2;
    geometry.batches = vec![Batch { material: 0, first: 0, count: 2 }, Batch { material: 1, first: 2, count }];
    // The shaft between the pair holds more triangles than are gathered, so segments are traced. Transparent triangles are not counted.
    for (marks, visibility) in [([false, false], 0.0), ([false, true], 1.0)] {
        let surfaces = Surfaces::new(&geometry, &marks);
        let Some(mut tracer) = wgpu(surfaces.geometry(), surfaces.see_through_materials()) else { return };
        let row = DeviceEstimator::new(&surfaces, wgpu(surfaces.geometry(), &marks).expect("there"), options(64));
        let mut found = Vec::new();
        row.expect("valid").rows(&[[0, 1]], &mut found).expect("the device works");
        assert_eq!(found[0].visibility, Some(visibility));
        let segment =
            curitiba_passes::trace::Segment { from: [0.3, 0.3, 0.1], end: 1.0, along: [0.0, 0.0, 0.9], pair: 0 };
        let mut bits = Vec::new();
        let segments = Segments { all: vec![segment; 100], own: vec![[0, 1]] };
        tracer.blocked(&segments, &mut bits).expect("the device works");
        let blocked: u32 = bits.iter().map(|word| word.count_ones()).sum();
        assert_eq!((bits.len(), blocked), (4, if marks[1] { 0 } else { 100 }));
    }
}
