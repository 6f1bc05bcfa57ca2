use super::world::{BACKGROUND, Shot, World, matrix_of};
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{BackendError, EffectJob, Rasteriser, View};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::raster_effects::{EFFECT_PROGRAMS, EffectParams, EffectProgram};
use glam::{Vec3, Vec4};

fn small() -> EffectParams {
    EffectParams { map_size: 64, ..EffectParams::default() }
}

fn street() -> World {
    let mut world = World::lit_along(Vec3::new(0.4, -1.0, 0.3));
    world.ground(10.0);
    let (white, glass) = (world.paint(Vec3::ONE), world.pane());
    world.block(white, Vec3::new(0.0, 1.0, -2.0), Vec3::ONE);
    world.quad(glass, Vec3::new(1.0, 1.0, 1.0), Vec3::X, Vec3::Y);
    world
}

fn shot(world: World, side: u32) -> Shot {
    world.seen(Vec3::new(2.0, 2.0, 6.0), Vec3::new(0.5, 0.8, 0.0), side)
}

#[test]
fn background_pixels_are_left_as_the_ray_programs_leave_them() {
    let mut shot = shot(street(), 64);
    for info in EFFECT_PROGRAMS {
        let (found, _) = shot.effect(info.program, small());
        let background: Vec<usize> =
            (0..found.len()).filter(|index| shot.buffer.triangle[*index] == u32::MAX).collect();
        assert!(background.len() > 100);
        let expected = if info.glass { BACKGROUND } else { [1.0; 4] };
        assert!(background.iter().all(|index| found[*index] == expected), "{}", info.name);
        let rays = shot.rays(info.program, curitiba_pipeline::programs::RayParams::default());
        assert!(background.iter().all(|index| rays[*index] == expected), "{}", info.name);
    }
}

#[test]
fn every_effect_works_on_one_pixel_none_and_an_empty_scene() {
    for info in EFFECT_PROGRAMS {
        for side in [0, 1, 2, 17] {
            for world in [street(), World::default(), World::lit_along(Vec3::NEG_Y)] {
                let mut shot = shot(world, side);
                let (found, _) = shot.effect(info.program, small());
                assert!(found.iter().flatten().all(|value| value.is_finite()), "{} {side}", info.name);
            }
        }
    }
}

#[test]
fn the_picture_does_not_depend_on_threads_or_on_what_was_drawn_before() {
    for info in EFFECT_PROGRAMS {
        let run = |threads: usize, program: &[EffectProgram]| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
            pool.install(|| {
                let mut shot = shot(street(), 100);
                program.iter().map(|program| shot.effect(*program, small()).0).last().expect("a picture")
            })
        };
        let all: Vec<EffectProgram> = EFFECT_PROGRAMS.iter().map(|info| info.program).chain([info.program]).collect();
        let one = run(1, &[info.program]);
        assert_eq!(one, run(3, &[info.program]), "{}", info.name);
        assert_eq!(one, run(2, &all), "{}", info.name);
    }
}

#[test]
fn positions_and_normals_that_are_not_numbers_spread_to_no_other_pixel() {
    for info in EFFECT_PROGRAMS {
        let mut clean = shot(street(), 48);
        let (expected, _) = clean.effect(info.program, small());
        let mut broken = shot(street(), 48);
        broken.buffer.position[700] = [f32::NAN; 4];
        broken.buffer.position[1500] = [f32::INFINITY, 0.0, 0.0, 1.0];
        broken.buffer.normal[1600] = [f32::NAN; 4];
        let (found, _) = broken.effect(info.program, small());
        assert!(found.iter().flatten().all(|value| value.is_finite()), "{}", info.name);
        let others = expected.iter().zip(&found).filter(|(a, b)| (a[0] - b[0]).abs() > 0.3).count();
        assert!(others < 12, "{}: {others}", info.name);
    }
}

fn refusal(shot: &mut Shot, edit: impl Fn(&mut EffectJob<'_>), program: EffectProgram) -> Option<String> {
    let mut raster = std::mem::take(&mut shot.raster);
    let mut job = shot.job(program, small());
    edit(&mut job);
    let mut output = Image::filled(shot.buffer.width, shot.buffer.height, [0.0; 4]);
    let result = raster.effect(&job, &mut output, &Progress::default());
    shot.raster = raster;
    match result {
        Ok(_) => None,
        Err(BackendError::Unsupported { what, why, .. }) => {
            assert_eq!(what, program.info().name);
            Some(why)
        }
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn jobs_that_lack_something_or_ask_for_too_much_are_refused_with_what_is_valid() {
    use EffectProgram::{CubeReflection, DepthOcclusion, HorizonOcclusion, ShadowMap};
    let mut shot = shot(street(), 16);
    let mut refused = |program, edit: fn(&mut EffectJob<'_>)| {
        refusal(&mut shot, edit, program).unwrap_or_else(|| panic!("{program:?} accepts it"))
    };
    assert!(refused(ShadowMap, |job| job.position = &[]).contains("pos_buffer has 0 pixels; the job has 256"));
    assert!(refused(HorizonOcclusion, |job| job.normal = &job.normal[1..]).contains("norm_buffer"));
    assert!(refused(CubeReflection, |job| job.triangle = &[]).contains("triangle"));
    assert!(refused(CubeReflection, |job| job.color = &[]).contains("color_buffer"));
    assert!(refused(ShadowMap, |job| job.width = 15).contains("16 x 16"));
    assert!(refused(ShadowMap, |job| job.params.map_size = 1 << 20).contains("16..=16384, not 1048576"));
    assert!(refused(ShadowMap, |job| job.params.map_size = 0).contains("16..=16384"));
    assert!(refused(ShadowMap, |job| job.params.cascades = 9).contains("1..=8"));
    // These maps would take 8 GiB.
    let large: fn(&mut EffectJob<'_>) = |job| (job.params.map_size, job.params.cascades) = (16_384, 8);
    assert!(refused(ShadowMap, large).contains("lower `mapsize` or `cascades`"));
    assert!(refused(ShadowMap, |job| job.params.pcf = 9).contains("0..=8"));
    assert!(refused(ShadowMap, |job| job.params.bias = f32::NAN).contains("0..=100"));
    assert!(refused(HorizonOcclusion, |job| job.params.steps = u32::MAX).contains("1..=64"));
    assert!(refused(DepthOcclusion, |job| job.params.radius = f32::INFINITY).contains("above 0"));
    assert!(refused(DepthOcclusion, |job| job.params.intensity = -1.0).contains("0..=100"));
    // One probe would take 24 GiB.
    assert!(refused(CubeReflection, |job| job.params.map_size = 16_384).contains("lower `mapsize` or `probes`"));
    // Parameters that the program does not read are not checked.
    assert_eq!(refusal(&mut shot, |job| job.params.steps = 0, ShadowMap), None);
    let mut stranger = CpuRasteriser::new();
    let mut output = Image::filled(16, 16, [0.0; 4]);
    let job = shot.job(ShadowMap, small());
    let error = stranger.effect(&job, &mut output, &Progress::default()).expect_err("no scene");
    assert!(error.to_string().contains("was not uploaded"), "{error}");
}

#[test]
fn views_and_lights_that_make_no_sense_give_a_picture_without_a_panic() {
    let broken = [
        View::new(matrix_of([Vec4::ZERO; 4]), Vec3::ZERO),
        View::new(matrix_of([Vec4::NAN; 4]), Vec3::NAN),
        View::new(matrix_of([Vec4::splat(1e30); 4]), Vec3::splat(1e30)),
    ];
    for info in EFFECT_PROGRAMS {
        for view in broken {
            let mut shot = shot(street(), 24);
            shot.view = view;
            let (found, _) = shot.effect(info.program, small());
            assert!(found.iter().all(|pixel| pixel.iter().all(|value| value.is_finite())), "{}", info.name);
        }
        for direction in [Vec3::ZERO, Vec3::NAN, Vec3::splat(1e38)] {
            let mut shot = shot(street(), 24);
            shot.sun = shot.sun.map(|sun| curitiba_pipeline::backend::Sun { direction, ..sun });
            shot.effect(info.program, small());
        }
    }
}
