use super::{CpuRays, Whole, new_pass, run_corrected};
use crate::effects::tests::world::{Shot, World, grid};
use crate::effects::{Coverage, LevelZero};
use crate::sampling::hash::{pcg4d, unit};
use crate::trace::{Bvh, Hit, Quality, Ray, SurfacePoint, Tracer};
use curitiba_pipeline::backend::{BackendError, RayBackend, RayCounts, RayJob, Shade};
use curitiba_pipeline::executor::{Cancellation, Progress};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::Fidelity::{self, Corrected, Thesis};
use curitiba_pipeline::programs::{RayParams, RayProgram, Sampler};
use curitiba_pipeline::scene::RenderScene;
use glam::Vec3;
use std::sync::Arc;

const TRACING: [RayProgram; 5] =
    [RayProgram::DeferredShadows, RayProgram::Reflection, RayProgram::Refraction, RayProgram::Ssao, RayProgram::Final];

/// A floor, and many triangles of four materials, one of them glass and one with cut-outs.
fn crowd() -> World {
    let mut world = World::lit_along(Vec3::new(0.3, -0.2, -1.0));
    let materials = [
        world.paint(Vec3::new(0.8, 0.4, 0.2)),
        world.glass(),
        world.picture([[250, 200, 20, 255], [20, 90, 200, 30]], Some(0.5)),
        world.paint(Vec3::new(0.2, 0.7, 0.3)),
    ];
    world.quad(materials[0], Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0);
    let random = |i: u32| pcg4d([i, 17, 0, 0]).map(|bits| 2.0 * unit(bits) - 1.0);
    for i in 0..80 {
        let [x, y, z, _] = random(4 * i);
        let corner = Vec3::new(2.0 * x, 2.0 * y, 0.8 + 0.6 * z);
        let edge = |i| Vec3::from_slice(&random(i)[..3]) * 0.7;
        let corners = [corner, corner + edge(4 * i + 1), corner + edge(4 * i + 2)];
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        world.triangle(materials[i as usize % 4], corners, [normal; 3]);
    }
    world
}

fn look(world: &World) -> Shot<'_> {
    // An odd size, so that tiles at the right and lower border are not whole. Some pixels show no surface.
    Shot::of(world, Vec3::new(0.1, 0.2, 6.0), grid(37, Vec3::ZERO, Vec3::X * 3.3, Vec3::Y * 3.3)).rows(37)
}

fn params() -> RayParams {
    RayParams { samples: 16, depth: 3, ..RayParams::default() }
}

/// The backend, with the structure of a copy of a world's scene built.
fn backend(world: &World) -> (CpuRays, Arc<RenderScene>) {
    let scene = Arc::new(world.scene.clone());
    let mut backend = CpuRays::new();
    let stats = backend.build(&scene, &vec![true; world.shades.len()]).expect("enough memory");
    assert!(stats.bytes > 0 && stats.nodes > 0);
    (backend, scene)
}

fn run(backend: &mut CpuRays, job: &RayJob<'_>) -> (Vec<[f32; 4]>, RayCounts) {
    let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
    let stats = backend.run(job, &mut output, &Progress::default()).expect("a complete job");
    (output.pixels, stats.rays)
}

fn differing(a: &[[f32; 4]], b: &[[f32; 4]]) -> usize {
    assert_eq!(a.len(), b.len());
    let apart = |(a, b): (&f32, &f32)| (a - b).is_nan() || (a - b).abs() > 2e-5;
    a.iter().zip(b).filter(|(a, b)| a.iter().zip(*b).any(apart)).count()
}

#[test]
fn every_program_gives_what_brute_force_gives() {
    let world = crowd();
    let shot = look(&world);
    let (mut backend, scene) = backend(&world);
    for program in TRACING {
        for fidelity in [Corrected, Thesis] {
            let expected = shot.run(program, fidelity, params());
            let found = run(&mut backend, &RayJob { scene: &scene, ..shot.job(program, fidelity, params()) });
            let wrong = differing(&expected.0, &found.0);
            // Rays that graze an edge, and thesis rays that graze 1e-4, may fall on either side.
            assert!(wrong <= 6, "{program:?} {fidelity:?}: {wrong} of 1369 pixels differ");
            assert!(found.0.iter().flatten().all(|v| v.is_finite()), "every pixel is written");
            assert!(found.1.total() > 50, "{program:?} {fidelity:?}: {:?}", found.1);
            assert!(differing(&found.0, &shot.color) > 30, "{program:?}: the comparer sees differences (control)");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let world = crowd();
    let shot = look(&world);
    let (mut backend, scene) = backend(&world);
    let soft = RayParams { sun: 5.0, ..params() };
    for (program, fidelity, params) in [
        (RayProgram::Final, Corrected, params()),
        (RayProgram::Final, Thesis, params()),
        (RayProgram::Ssao, Corrected, params()),
        (RayProgram::Final, Corrected, soft),
        (RayProgram::DeferredShadows, Corrected, soft),
    ] {
        let job = RayJob { scene: &scene, ..shot.job(program, fidelity, params) };
        let pictures = [1, 2, 3, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| run(&mut backend, &job))
        });
        assert_eq!(pictures[0], pictures[1]);
        assert_eq!(pictures[0], pictures[2]);
        assert_eq!(pictures[0], pictures[3]);
    }
}

/// Cancels the pass at the first hit whose coverage is tested, if it holds a cancellation.
struct GivesUp(Option<Cancellation>);

impl Coverage for GivesUp {
    type Cone = LevelZero;

    fn covers(&self, _: &Hit) -> bool {
        self.0.iter().for_each(Cancellation::cancel);
        true
    }
}

#[test]
fn a_pass_is_given_up_before_its_next_pixel() {
    let world = crowd();
    let shot = look(&world);
    let (backend, scene) = backend(&world);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let soft = RayParams { sun: 5.0, ..params() };
    for (program, params) in [
        (RayProgram::Ssao, params()),
        (RayProgram::Final, params()),
        (RayProgram::DeferredShadows, soft),
        (RayProgram::Reflection, params()),
    ] {
        let job = RayJob { scene: &scene, ..shot.job(program, Corrected, params) };
        let traced = |gives_up: bool| {
            let stop = Cancellation::new();
            let progress = Progress::until(&stop);
            let mut output = Image::filled(job.width, job.height, [0.0; 4]);
            let tree = &backend.tracer(&job).expect("a structure").expect("it was built").triangles;
            let pass =
                new_pass(&job, tree, GivesUp(gives_up.then_some(stop)), Some(&progress)).expect("a complete job");
            let whole = Whole { output: &mut output, progress: &progress, tiles: 1 };
            let rays = pool.install(|| run_corrected(&pass, whole));
            (progress.is_given_up(), rays.total())
        };
        let ((never, all), (given_up, some)) = (traced(false), traced(true));
        // The picture has 1369 pixels in nine tiles, and the first hit is in one of its first rows.
        assert!(!never && given_up && 20 * some < all, "{program:?}: {some} of {all} rays");
    }
}

#[test]
fn dummy_copies_the_colour_without_a_scene() {
    let world = crowd();
    let shot = look(&world);
    for fidelity in [Corrected, Thesis] {
        let job = RayJob {
            position: &[],
            normal: &[],
            triangle: &[],
            shades: &[],
            glass: &[],
            shadow_glass: &[],
            sun: None,
            ..shot.job(RayProgram::Dummy, fidelity, params())
        };
        let (pixels, rays) = run(&mut CpuRays::new(), &job);
        assert_eq!((pixels, rays.total()), (shot.color.clone(), 0));
    }
}

#[test]
fn empty_images_and_scenes_are_no_error() {
    let world = World::lit_along(Vec3::X);
    let shot = Shot::of(&world, Vec3::ZERO, [Vec3::X]);
    let scene = Arc::new(world.scene.clone());
    let mut backend = CpuRays::new();
    backend.build(&scene, &[]).expect("nothing to build");
    for program in TRACING {
        let job = RayJob { scene: &scene, ..shot.job(program, Corrected, params()) };
        assert_eq!(run(&mut backend, &job).1.total(), 0);
        let none = RayJob { width: 0, height: 0, position: &[], normal: &[], color: &[], triangle: &[], ..job };
        assert!(run(&mut backend, &none).0.is_empty());
    }
}

/// The reason why a job is refused.
fn refusal(backend: &mut CpuRays, job: &RayJob<'_>) -> String {
    let mut output = Image::filled(job.width, job.height, [0.0; 4]);
    match backend.run(job, &mut output, &Progress::default()) {
        Err(BackendError::Unsupported { backend: "cpu", what, why }) => format!("{what}: {why}"),
        other => panic!("not refused: {other:?}"),
    }
}

#[test]
fn incomplete_jobs_are_refused_with_what_is_missing() {
    let world = crowd();
    let shot = look(&world);
    let (mut backend, scene) = backend(&world);
    let job = |program, fidelity: Fidelity| RayJob { scene: &scene, ..shot.job(program, fidelity, params()) };
    let complete = job(RayProgram::Final, Corrected);
    run(&mut backend, &complete);

    let mut refused = |job: RayJob<'_>, part: &str| {
        let why = refusal(&mut backend, &job);
        assert!(why.contains(part), "{why}");
    };
    refused(RayJob { position: &[], ..complete }, "final: it reads pos_buffer, which is absent");
    refused(RayJob { normal: &shot.normal[1..], ..complete }, "norm_buffer, which is 1368 pixels; it needs 37 x 37");
    refused(RayJob { color: &[], ..job(RayProgram::Reflection, Thesis) }, "color_buffer");
    refused(RayJob { triangle: &[], ..job(RayProgram::DeferredShadows, Corrected) }, "the triangle ids");
    refused(RayJob { sun: None, ..job(RayProgram::DeferredShadows, Thesis) }, "lightDir");
    refused(RayJob { shades: &world.shades[1..], ..complete }, "`shades` has 3 entries for 4 materials");
    refused(RayJob { glass: &[], ..complete }, "`glass`");
    refused(RayJob { shadow_glass: &[], ..complete }, "`shadow_glass`");
    let sampled = |samples, sampler| RayParams { samples, sampler, ..params() };
    refused(RayJob { params: sampled(10, Sampler::Strata), ..complete }, "nearest are 9 and 16");
    refused(RayJob { params: sampled(10, Sampler::Sobol), ..job(RayProgram::Ssao, Thesis) }, "nearest are 9 and 16");
    let mut beyond = shot.triangle.clone();
    beyond[5] = 1_000_000;
    refused(RayJob { triangle: &beyond, ..complete }, "name more than the scene's 82 triangles");
    refused(RayJob { scene: &world.scene, ..complete }, "acceleration structure was not built");
    let mut shades: Vec<Shade> = world.shades.clone();
    shades[0].texture = Some(9);
    refused(RayJob { shades: &shades, ..complete }, "material `material 0` has a texture that was not loaded");

    let mut output = Image::filled(36, 37, [0.0; 4]);
    let error = backend.run(&complete, &mut output, &Progress::default()).expect_err("another size");
    assert!(error.to_string().contains("the output is 36 x 37"), "{error}");
    assert!(backend.run(&job(RayProgram::Dummy, Corrected), &mut output, &Progress::default()).is_err());
}

#[test]
fn scenes_without_the_attributes_that_hits_read_are_refused() {
    let mut world = crowd();
    world.scene.geometry.texcoords.clear();
    let shot = look(&world);
    let (mut bare, scene) = backend(&world);
    let refused =
        refusal(&mut bare, &RayJob { scene: &scene, ..shot.job(RayProgram::Refraction, Corrected, params()) });
    assert!(refused.contains("without texture coordinates"), "{refused}");
    // Thesis shadows read only positions.
    run(&mut bare, &RayJob { scene: &scene, shades: &[], ..shot.job(RayProgram::DeferredShadows, Thesis, params()) });

    let mut flat = world.scene.clone();
    flat.geometry.normals.clear();
    let flat = Arc::new(flat);
    bare.build(&flat, &vec![true; world.shades.len()]).expect("enough memory");
    let refused = refusal(&mut bare, &RayJob { scene: &flat, ..shot.job(RayProgram::Reflection, Thesis, params()) });
    assert!(refused.contains("vertex normals"), "{refused}");
}

#[test]
fn the_backend_describes_itself() {
    let backend = CpuRays::new();
    assert_eq!(backend.name(), "cpu");
    assert!(backend.device().contains("thread"));
    for program in TRACING {
        assert!(backend.supports(program, Thesis).is_ok() && backend.supports(program, Corrected).is_ok());
    }
}

#[test]
fn rays_that_leave_planes_through_the_origin_do_not_meet_them() {
    // Along the normal every coordinate is 0, and so is its rounding error; the triangle test's error is not.
    for (x, y) in [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X), (Vec3::new(1.0, 1.0, 0.0), Vec3::Z)] {
        let mut world = World::lit_along(Vec3::NEG_Z);
        let paint = world.paint(Vec3::ONE);
        world.quad(paint, Vec3::ZERO, x * 30.0, y * 7.0);
        let geometry = &world.scene.geometry;
        let bvh = Bvh::build(geometry, &[], Quality::default());
        let mut met = 0;
        for i in 0..100_000u32 {
            let [a, b, c, d] = pcg4d([i, 1, 0, 0]).map(|bits| 2.0 * unit(bits) - 1.0);
            let near = x * 30.0 * a + y * 7.0 * b;
            let point = SurfacePoint::snap(geometry, i % 2, near);
            let direction = (x * c + y * d + point.normal * unit(pcg4d([i, 2, 0, 0])[0]).powi(3)).normalize();
            if direction.dot(point.normal) > 0.0 {
                let ray = Ray { origin: point.spawn(direction), direction, t_min: 0.0, t_max: f32::INFINITY };
                met += usize::from(bvh.occluded(&ray, |_| true));
            }
        }
        assert_eq!(met, 0, "{x} {y}");
    }
}
