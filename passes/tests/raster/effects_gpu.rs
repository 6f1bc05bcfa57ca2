//! The raster effects on wgpu compute the same pictures as on the processor.
//!
//! Needs a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without one, tests print `skipped`, or fail
//! with `CURITIBA_REQUIRE_GPU_TESTS=1`. `CURITIBA_PICTURES=DIR` writes the pictures.

use crate::effects::world::{self, BACKGROUND, Shot, World};
use crate::support::rasteriser;
use curitiba_passes::raster::gpu::WgpuRasteriser;
use curitiba_pipeline::backend::{
    Answers, Attachments, BackendError, EffectJob, EffectStats, GBuffer, LoadStore, RasterJob, Rasteriser, Rect, View,
};
use curitiba_pipeline::executor::{Cancellation, Progress};
use curitiba_pipeline::image::{Image, write_png};
use curitiba_pipeline::programs::{Fresnel, RasterProgram};
use curitiba_pipeline::raster_effects::{Border, EFFECT_PROGRAMS, EffectParams, EffectProgram, Missing, Parallax};
use glam::{Vec3, Vec4};
use std::time::{Duration, Instant};

const SIDE: u32 = 160;

/// Greatest difference of a component that counts as rounding; interpolation, filters and sums use 32-bit floats.
const ROUNDING: f32 = 2e-3;

/// Greatest share of pixels that may differ by more. In such pixels a coordinate rounds differently and selects another
/// texel or pixel, or the two rasterisers cover a map texel at an outline differently. On lavapipe 22.3.6 they are at
/// most 2 of 25,600 pixels, but 24 for `depthOcclusion`: it counts every step whose height is above a tolerance, and a
/// height computed from a depth may be above it where a height from a position is not.
const OUTLIERS: f64 = 1e-3;

fn params() -> EffectParams {
    EffectParams { map_size: 256, index: 1.5, ..EffectParams::default() }
}

/// A street with boxes, a fence with holes, and two panes; one of the panes is seen from behind.
fn street() -> World {
    let mut world = World::lit_along(Vec3::new(0.4, -1.0, -0.3));
    world.ground(12.0);
    let (white, red, glass, fence) =
        (world.paint(Vec3::ONE), world.paint(Vec3::new(0.9, 0.2, 0.1)), world.pane(), world.half_cut_out());
    world.block(white, Vec3::new(-2.0, 1.0, -2.0), Vec3::new(1.0, 1.0, 0.7));
    world.block(red, Vec3::new(2.5, 0.5, -1.0), Vec3::new(0.5, 0.5, 1.5));
    world.block(white, Vec3::new(0.2, 0.15, 1.5), Vec3::splat(0.15));
    world.quad(fence, Vec3::new(0.5, 1.0, -3.5), Vec3::new(1.0, 0.0, 0.3), Vec3::Y);
    // Blocks behind the camera, for the panes to mirror.
    for i in 0..6u8 {
        let x = 3.0 * f32::from(i) - 8.0;
        world.block([red, white][usize::from(i % 2)], Vec3::new(x, 2.0, 9.0), Vec3::new(0.7, 2.0, 0.4));
    }
    world.quad(glass, Vec3::new(1.4, 0.9, 0.8), Vec3::new(0.6, 0.0, -0.3), Vec3::Y * 0.8);
    world.quad(glass, Vec3::new(-1.6, 0.8, 0.9), Vec3::new(-0.5, 0.0, 0.3), Vec3::new(0.1, 0.6, 0.0));
    world
}

/// Orange blocks of many sizes; no glass.
fn hollow() -> World {
    let mut world = World::lit_along(Vec3::new(-0.6, -0.8, 0.2));
    world.ground(6.0);
    let orange = world.paint(Vec3::new(0.9, 0.5, 0.2));
    for i in 0..40u32 {
        let turn = i as f32 * 2.4;
        let away = 0.25 * (i as f32).sqrt() * 2.0;
        let center = Vec3::new(away * turn.cos(), 0.1 + 0.01 * i as f32, away * turn.sin());
        world.block(orange, center, Vec3::new(0.12, 0.1 + 0.01 * i as f32, 0.2));
    }
    world
}

fn shots() -> [(&'static str, Shot); 3] {
    [
        ("street", street().seen(Vec3::new(1.0, 0.8, 5.5), Vec3::new(0.1, 0.9, 0.0), SIDE)),
        ("beside the street", street().seen(Vec3::new(-4.0, 1.0, 3.0), Vec3::new(0.3, 0.9, -0.5), SIDE)),
        ("hollow", hollow().seen(Vec3::new(2.0, 3.0, 3.0), Vec3::new(0.0, 0.1, 0.0), SIDE)),
    ]
}

fn run(gpu: &mut WgpuRasteriser, job: &EffectJob<'_>) -> Result<(Vec<[f32; 4]>, EffectStats), BackendError> {
    let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
    let progress = Progress::default();
    let stats = gpu.effect(job, &mut output, &progress)?;
    let (done, total) = progress.get();
    assert_eq!(done, total, "progress arrives");
    Ok((output.pixels, stats))
}

/// The effect's picture, from the shot's own G-buffer.
fn uploaded(gpu: &mut WgpuRasteriser, shot: &Shot, program: EffectProgram) -> (Vec<[f32; 4]>, EffectStats) {
    let job = EffectJob { resident: false, ..shot.job(program, params()) };
    run(gpu, &job).expect("a whole job")
}

/// The share of pixels with a component that differs by more than [`ROUNDING`], and the mean difference.
fn difference(a: &[[f32; 4]], b: &[[f32; 4]]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let (mut outliers, mut sum) = (0usize, 0.0);
    for (a, b) in a.iter().zip(b) {
        let worst =
            (0..4).map(|i| (a[i] - b[i]).abs()).fold(0.0, |m, d| if d.is_nan() { f32::INFINITY } else { d.max(m) });
        outliers += usize::from(worst > ROUNDING);
        sum += f64::from(worst);
    }
    (outliers as f64 / a.len() as f64, sum / a.len() as f64)
}

fn keep_picture(name: &str, pixels: &[[f32; 4]]) {
    if let Some(folder) = std::env::var_os("CURITIBA_PICTURES") {
        let image = Image { width: SIDE, height: SIDE, pixels: pixels.to_vec() };
        let path = std::path::Path::new(&folder).join(format!("{name}.png"));
        write_png(&path, &image).expect("the picture is written");
    }
}

#[test]
fn every_effect_agrees_with_the_processors() {
    let Some(mut gpu) = rasteriser() else { return };
    let mut failed = Vec::new();
    for (name, mut shot) in shots() {
        gpu.upload(&shot.scene).expect("uploads");
        for info in EFFECT_PROGRAMS {
            let (expected, cpu) = shot.effect(info.program, params());
            let (found, stats) = uploaded(&mut gpu, &shot, info.program);
            let (outlying, mean) = difference(&found, &expected);
            println!("{name}, {}: outliers {outlying:.5}, mean {mean:.2e}", info.name);
            keep_picture(&format!("{name} {} gpu", info.name), &found);
            keep_picture(&format!("{name} {} cpu", info.name), &expected);
            if outlying > OUTLIERS || mean.is_nan() {
                failed.push((name, info.name, outlying));
            }
            assert_eq!((stats.map_count, stats.triangles), (cpu.map_count, cpu.triangles), "{name}, {}", info.name);
            assert_eq!(stats.maps.is_some(), cpu.maps.is_some(), "{name}, {}", info.name);
            assert_eq!(stats.glass_pixels, cpu.glass_pixels, "{name}, {}", info.name);
            answers_agree(stats.answers, cpu.answers, &format!("{name}, {}", info.name));
            assert!(stats.transfer.is_some() && stats.bytes >= cpu.bytes, "{name}, {}", info.name);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn options_of_effects_agree_with_the_processors() {
    let Some(mut gpu) = rasteriser() else { return };
    let corrected = EffectParams { parallax: Parallax::Box, ..params() };
    let filtered = |filter| EffectParams { filter, ..params() };
    let sectors = EffectParams { bitmask: true, thickness: 0.3, ..params() };
    for (name, mut shot) in shots() {
        gpu.upload(&shot.scene).expect("uploads");
        for (program, params) in [
            (EffectProgram::CubeReflection, corrected),
            (EffectProgram::CubeRefraction, corrected),
            (EffectProgram::ScreenReflection, corrected),
            (EffectProgram::HorizonOcclusion, sectors),
            (EffectProgram::HorizonOcclusion, filtered(2)),
            (EffectProgram::DepthOcclusion, filtered(3)),
        ] {
            let (expected, _) = shot.effect(program, params);
            let (plain, _) =
                shot.effect(program, EffectParams { parallax: Parallax::None, bitmask: false, filter: 0, ..params });
            let job = EffectJob { resident: false, ..shot.job(program, params) };
            let (found, _) = run(&mut gpu, &job).expect("a whole job");
            let (outlying, mean) = difference(&found, &expected);
            println!("{name}, {program:?}: outliers {outlying:.5}, mean {mean:.2e}");
            // A sector is a 32nd of one of four slices, so a single direction at its edge that rounds differently has a
            // large effect. A filter spreads the effect of a single step over its pixels.
            let most = match params {
                EffectParams { bitmask: true, .. } => 1e-2,
                EffectParams { filter: 1.., .. } => 3.0 * OUTLIERS,
                _ => OUTLIERS,
            };
            assert!(outlying <= most && mean < 1e-3, "{name}, {program:?}: {outlying} {mean}");
            // Control: the option changes the picture where it shows glass or occluders.
            assert!(name != "street" || difference(&plain, &expected).0 > 0.01, "{program:?}");
        }
    }
}

#[test]
fn occlusions_agree_without_perspective() {
    let Some(mut gpu) = rasteriser() else { return };
    let mut shot = street().through(world::from_above(4.0), SIDE, SIDE);
    gpu.upload(&shot.scene).expect("uploads");
    for (program, bitmask) in [
        (EffectProgram::HorizonOcclusion, false),
        (EffectProgram::HorizonOcclusion, true),
        (EffectProgram::DepthOcclusion, false),
    ] {
        let params = EffectParams { bitmask, thickness: 0.3, ..params() };
        let (expected, _) = shot.effect(program, params);
        let job = EffectJob { resident: false, ..shot.job(program, params) };
        let (found, _) = run(&mut gpu, &job).expect("a whole job");
        let (outlying, mean) = difference(&found, &expected);
        println!("{program:?}, bitmask {bitmask}: outliers {outlying:.5}, mean {mean:.2e}");
        assert!(
            outlying <= if bitmask { 1e-2 } else { 2.0 * OUTLIERS } && mean < 1e-3,
            "{program:?}: {outlying} {mean}"
        );
        // Control: there is occlusion to compare.
        let shut = expected.iter().filter(|pixel| pixel[0] < 0.9).count();
        assert!(shut > 100, "{program:?}: {shut}");
    }
}

/// Asserts that the numbers of glass pixels are equal, and that answers differ only for single rays at outlines.
fn answers_agree(found: Option<Answers>, expected: Option<Answers>, what: &str) {
    let (Some(found), Some(expected)) = (found, expected) else { return assert_eq!(found, expected, "{what}") };
    println!("{what}: {found}; on the cpu {expected}");
    assert_eq!(found.glass(), expected.glass(), "{what}");
    for (found, expected) in [
        (found.screen, expected.screen),
        (found.cube, expected.cube),
        (found.rays, expected.rays),
        (found.kept, expected.kept),
    ] {
        assert!(found.abs_diff(expected) <= 3 + expected / 200, "{what}: {found} {expected}");
    }
}

#[test]
fn marches_agree_whatever_stands_for_what_is_missing() {
    let Some(mut gpu) = rasteriser() else { return };
    // The street through an orthographic camera straight above, and the street with a further pane on the ground, which
    // mirrors what the picture shows.
    let sideways = street().through(world::from_above(4.0), SIDE, SIDE);
    let floor = {
        let mut world = street();
        let glass = world.pane();
        world.quad(glass, Vec3::new(0.5, 0.01, 2.6), Vec3::Z * 1.2, Vec3::X * 1.6);
        world.seen(Vec3::new(0.5, 1.2, 5.5), Vec3::new(0.3, 0.4, 0.0), SIDE)
    };
    for (name, mut shot) in [("sideways", sideways), ("floor", floor)] {
        gpu.upload(&shot.scene).expect("uploads");
        for program in [EffectProgram::ScreenReflection, EffectProgram::ScreenRefraction] {
            for missing in [Missing::Own, Missing::Cube, Missing::Rays, Missing::Own] {
                let params = EffectParams { missing, thickness: 0.05, ..params() };
                let (expected, cpu) = shot.effect(program, params);
                let job = EffectJob { resident: false, ..shot.job(program, params) };
                let (found, stats) = run(&mut gpu, &job).expect("a whole job");
                let (outlying, mean) = difference(&found, &expected);
                let what = format!("{name}, {program:?}, {missing:?}");
                println!("{what}: outliers {outlying:.5}, mean {mean:.2e}");
                keep_picture(&format!("{what} gpu"), &found);
                keep_picture(&format!("{what} cpu"), &expected);
                assert!(outlying <= 2.0 * OUTLIERS, "{what}: {outlying}");
                answers_agree(stats.answers, cpu.answers, &what);
                assert_eq!(stats.map_count, cpu.map_count, "{what}");
            }
        }
    }
}

#[test]
fn a_camera_without_a_picture_has_no_answers_of_an_earlier_run() {
    let Some(mut gpu) = rasteriser() else { return };
    let (_, mut shot) = shots().into_iter().next().expect("one");
    gpu.upload(&shot.scene).expect("uploads");
    let seen = shot.view;
    for program in [EffectProgram::ScreenReflection, EffectProgram::ScreenRefraction] {
        shot.view = seen;
        let (_, earlier) = uploaded(&mut gpu, &shot, program);
        assert!(earlier.answers.expect("counted").glass() > 100, "{program:?}");
        // The G-buffer shows glass, but the matrix of the camera has no inverse.
        shot.view = View::new(world::matrix_of([Vec4::ZERO; 4]), Vec3::ZERO);
        let (expected, cpu) = shot.effect(program, params());
        let (found, stats) = uploaded(&mut gpu, &shot, program);
        assert_eq!((stats.answers, cpu.answers), (Some(Answers::default()), Some(Answers::default())), "{program:?}");
        assert!(found == expected && found == shot.buffer.color, "{program:?}");
    }
}

#[test]
fn an_effect_that_is_given_up_writes_nothing_and_leaves_the_next_run_as_it_is() {
    let Some(mut gpu) = rasteriser() else { return };
    let (_, shot) = shots().into_iter().next().expect("one");
    gpu.upload(&shot.scene).expect("uploads");
    for info in EFFECT_PROGRAMS {
        let (whole, expected) = uploaded(&mut gpu, &shot, info.program);
        let job = EffectJob { resident: false, ..shot.job(info.program, params()) };
        let unwritten = [7.0_f32; 4];
        let is_unwritten = |output: &Image| output.pixels.iter().all(|pixel| *pixel == unwritten);

        let stop = Cancellation::new();
        let (progress, mut output) = (Progress::until(&stop), Image::filled(SIDE, SIDE, unwritten));
        stop.cancel();
        gpu.effect(&job, &mut output, &progress).expect("given up");
        assert!(progress.is_given_up() && progress.get().0 == 0 && is_unwritten(&output), "{}", info.name);

        // Another thread stops it after the first submission. The effect may end before that; then its picture is whole.
        let (stop, latest) = (Cancellation::new(), Instant::now() + Duration::from_secs(20));
        let (progress, mut output) = (Progress::until(&stop), Image::filled(SIDE, SIDE, unwritten));
        let result = std::thread::scope(|scope| {
            scope.spawn(|| {
                while progress.get().0 == 0 && Instant::now() < latest {
                    std::thread::yield_now();
                }
                stop.cancel();
            });
            gpu.effect(&job, &mut output, &progress)
        });
        result.expect("given up, or whole");
        println!("{}: given up in its middle: {}", info.name, progress.is_given_up());
        assert!(if progress.is_given_up() { is_unwritten(&output) } else { output.pixels == whole }, "{}", info.name);

        let (again, stats) = uploaded(&mut gpu, &shot, info.program);
        assert!(again == whole, "{}", info.name);
        assert_eq!((stats.map_count, stats.answers), (expected.map_count, expected.answers), "{}", info.name);
    }
}

#[test]
fn shadows_agree_for_every_number_of_maps_and_differ_between_numbers() {
    let Some(mut gpu) = rasteriser() else { return };
    for (name, mut shot) in shots() {
        gpu.upload(&shot.scene).expect("uploads");
        let mut pictures = Vec::new();
        for cascades in [1, 2, 8] {
            let params = EffectParams { cascades, ..params() };
            let (expected, cpu) = shot.effect(EffectProgram::ShadowMap, params);
            let job = EffectJob { resident: false, ..shot.job(EffectProgram::ShadowMap, params) };
            let (found, stats) = run(&mut gpu, &job).expect("a whole job");
            let (outlying, _) = difference(&found, &expected);
            println!("{name}, {} maps: outliers {outlying:.5}", stats.map_count);
            assert!(outlying <= OUTLIERS, "{name}, {cascades}: {outlying}");
            assert_eq!((stats.map_count, stats.triangles, stats.bytes), (cpu.map_count, cpu.triangles, cpu.bytes));
            pictures.push(found);
        }
        for pair in pictures.windows(2) {
            assert!(difference(&pair[0], &pair[1]).0 > OUTLIERS, "{name}");
        }
    }
}

#[test]
fn the_borders_of_shadows_that_are_left_to_rays_agree() {
    let Some(mut gpu) = rasteriser() else { return };
    for (name, mut shot) in shots() {
        gpu.upload(&shot.scene).expect("uploads");
        for pcf in [0, 1] {
            let params = EffectParams { border: Border::Rays, pcf, ..params() };
            let (expected, _) = shot.effect(EffectProgram::ShadowMap, params);
            let job = EffectJob { resident: false, ..shot.job(EffectProgram::ShadowMap, params) };
            let (found, _) = run(&mut gpu, &job).expect("a whole job");
            let (outlying, _) = difference(&found, &expected);
            let left = |picture: &[[f32; 4]]| picture.iter().filter(|pixel| pixel[3] == Answers::LEFT).count();
            println!("{name}, pcf {pcf}: outliers {outlying:.5}, {} and {} left", left(&found), left(&expected));
            assert!(outlying <= OUTLIERS && left(&found) > 0, "{name}, {pcf}: {outlying}");
        }
    }
}

#[test]
fn soft_shadows_agree_and_differ_from_hard_ones() {
    let Some(mut gpu) = rasteriser() else { return };
    for (name, mut shot) in shots() {
        gpu.upload(&shot.scene).expect("uploads");
        let mut pictures = Vec::new();
        // The last round has a point of light again, and so runs another shader on the same maps and output.
        for sun in [0.0, 0.53, 6.0, 0.0] {
            let params = EffectParams { sun, ..params() };
            let (expected, cpu) = shot.effect(EffectProgram::ShadowMap, params);
            let job = EffectJob { resident: false, ..shot.job(EffectProgram::ShadowMap, params) };
            let (found, stats) = run(&mut gpu, &job).expect("a whole job");
            let (outlying, mean) = difference(&found, &expected);
            println!("{name}, sun {sun}: outliers {outlying:.5}, mean {mean:.2e}");
            assert!(outlying <= OUTLIERS, "{name}, {sun}: {outlying}");
            assert_eq!((stats.map_count, stats.bytes), (cpu.map_count, cpu.bytes));
            keep_picture(&format!("{name} sun {sun} gpu"), &found);
            pictures.push(found);
        }
        assert_eq!(pictures[0], pictures[3], "{name}");
        assert!(difference(&pictures[0], &pictures[2]).0 > OUTLIERS, "{name}");
    }
}

#[test]
fn a_wrong_light_eye_or_parameter_is_found_out() {
    let Some(mut gpu) = rasteriser() else { return };
    let (_, mut shot) = shots().into_iter().next().expect("one");
    gpu.upload(&shot.scene).expect("uploads");
    for info in EFFECT_PROGRAMS {
        let (expected, _) = shot.effect(info.program, params());
        let mut job = EffectJob { resident: false, ..shot.job(info.program, params()) };
        match info.program {
            EffectProgram::ShadowMap => {
                job.sun = job.sun.map(|mut sun| {
                    sun.direction = (sun.direction + Vec3::X * 0.02).normalize();
                    sun
                });
            }
            EffectProgram::CubeReflection => job.view.eye += Vec3::X * 0.5,
            // The camera itself is mirrored.
            EffectProgram::PlanarReflection => {
                let moved = glam::Mat4::from_translation(Vec3::X * 0.5);
                job.view = View::new(job.view.clip_from_world * moved, job.view.eye - Vec3::X * 0.5);
            }
            EffectProgram::CubeRefraction | EffectProgram::ScreenRefraction => job.params.index = 1.6,
            EffectProgram::ScreenReflection => job.params.missing = Missing::Own,
            EffectProgram::DepthOcclusion => job.params.radius *= 1.1,
            EffectProgram::HorizonOcclusion => job.seed = 1,
        }
        let (found, _) = run(&mut gpu, &job).expect("a whole job");
        let (outlying, _) = difference(&found, &expected);
        assert!(outlying > OUTLIERS, "{}: {outlying}", info.name);
    }
}

const ALL: Attachments = Attachments { color: true, position: true, normal: true, triangle: true };

/// Draws the shot on the device and reads the G-buffer back into it, so that both hold the same.
fn draw(gpu: &mut WgpuRasteriser, shot: &mut Shot) {
    draw_as(gpu, shot, Attachments::default());
}

/// As [`draw`], with some attachments as 16-bit floats.
fn draw_as(gpu: &mut WgpuRasteriser, shot: &mut Shot, half: Attachments) {
    let (width, height) = (shot.buffer.width, shot.buffer.height);
    let mut buffer = GBuffer::new(width, height, ALL);
    let job = RasterJob { half, ..raster_job(shot, ALL) };
    gpu.draw(&job, &mut buffer).expect("draws");
    gpu.read_back(&job, ALL, &mut buffer).expect("reads back");
    shot.buffer = buffer;
}

fn raster_job(shot: &Shot, attachments: Attachments) -> RasterJob<'_> {
    RasterJob {
        scene: &shot.scene,
        program: RasterProgram::Deferred,
        view: shot.view,
        lights: &[],
        sun: shot.sun,
        shades: &shot.shades,
        culled: &[],
        viewport: Rect { x: 0, y: 0, width: shot.buffer.width, height: shot.buffer.height },
        clear_color: Vec4::from_array(BACKGROUND),
        attachments,
        shared: Attachments::default(),
        half: Attachments::default(),
        snapped_depth: false,
        load_store: LoadStore::default(),
    }
}

fn resident<'a>(shot: &'a Shot, program: EffectProgram) -> EffectJob<'a> {
    let job = shot.job(program, params());
    EffectJob { resident: true, position: &[], normal: &[], color: &[], triangle: &[], ..job }
}

#[test]
fn what_was_drawn_last_is_read_in_place_and_survives_the_maps() {
    let Some(mut gpu) = rasteriser() else { return };
    for (name, mut shot) in shots() {
        gpu.upload(&shot.scene).expect("uploads");
        draw(&mut gpu, &mut shot);
        for info in EFFECT_PROGRAMS {
            let (in_place, stats) = run(&mut gpu, &resident(&shot, info.program)).expect("a whole job");
            let (copied, other) = uploaded(&mut gpu, &shot, info.program);
            assert!(in_place == copied, "{name}, {}", info.name);
            let counts = |stats: EffectStats| (stats.map_count, stats.triangles, stats.bytes, stats.glass_pixels);
            assert_eq!(counts(stats), counts(other), "{name}, {}", info.name);
        }
        let job = raster_job(&shot, ALL);
        let mut buffer = GBuffer::new(SIDE, SIDE, ALL);
        gpu.read_back(&job, ALL, &mut buffer).expect("still there");
        assert!(buffer == shot.buffer, "{name}: the effects changed what was drawn");
    }
}

#[test]
fn effects_read_16_bit_floats_where_they_were_drawn() {
    let Some(mut gpu) = rasteriser() else { return };
    let (_, mut shot) = shots().into_iter().next().expect("one");
    gpu.upload(&shot.scene).expect("uploads");
    let half = Attachments { color: true, normal: true, ..Attachments::default() };
    draw_as(&mut gpu, &mut shot, half);
    let rounded = shot.buffer.clone();
    for info in EFFECT_PROGRAMS {
        let (in_place, _) = run(&mut gpu, &resident(&shot, info.program)).expect("a whole job");
        let (copied, _) = uploaded(&mut gpu, &shot, info.program);
        assert!(in_place == copied, "{}", info.name);
    }
    draw(&mut gpu, &mut shot);
    assert!(shot.buffer.position == rounded.position && shot.buffer.normal != rounded.normal, "control");
    // A job with the same attachments in another format is not what was drawn last.
    let job = RasterJob { half, ..raster_job(&shot, ALL) };
    let mut buffer = GBuffer::new(SIDE, SIDE, ALL);
    let message = gpu.read_back(&job, ALL, &mut buffer).expect_err("not what was drawn").to_string();
    assert!(message.contains("drawn last"), "{message}");
}

#[test]
fn weights_of_interfaces_agree_with_the_processors_and_differ_from_each_other() {
    let Some(mut gpu) = rasteriser() else { return };
    let program = EffectProgram::CubeRefraction;
    for index in [1.5, 2.42, 0.8] {
        let (_, mut shot) = shots().into_iter().next().expect("one");
        gpu.upload(&shot.scene).expect("uploads");
        let exact = EffectParams { index, ..params() };
        let weights = [Fresnel::Exact, Fresnel::Schlick, Fresnel::S, Fresnel::P];
        let pictures = weights.map(|fresnel| {
            let params = EffectParams { fresnel, ..exact };
            let (expected, _) = shot.effect(program, params);
            let job = EffectJob { resident: false, ..shot.job(program, params) };
            let (found, _) = run(&mut gpu, &job).expect("a whole job");
            let (outlying, _) = difference(&found, &expected);
            assert!(outlying <= OUTLIERS, "index {index}: {outlying}");
            found
        });
        for (one, other) in [(0, 1), (0, 2), (0, 3), (2, 3)] {
            let differ = difference(&pictures[one], &pictures[other]).0;
            assert!(differ > OUTLIERS, "index {index}: {:?} and {:?} are the same", weights[one], weights[other]);
        }
    }
}

#[test]
fn a_g_buffer_that_is_not_the_one_drawn_last_is_refused() {
    let Some(mut gpu) = rasteriser() else { return };
    let (_, mut shot) = shots().into_iter().next().expect("one");
    gpu.upload(&shot.scene).expect("uploads");
    let refused = |gpu: &mut WgpuRasteriser, shot: &Shot, program| {
        run(gpu, &resident(shot, program)).expect_err("not what was drawn").to_string()
    };
    let message = refused(&mut gpu, &shot, EffectProgram::HorizonOcclusion);
    assert!(message.contains("drawn last") && message.contains("`--raster cpu`"), "{message}");
    draw(&mut gpu, &mut shot);
    // A smaller draw, and a draw with fewer attachments: the larger set stays on the device, but is not the last draw.
    let mut buffer = GBuffer::new(SIDE, SIDE, ALL);
    let half = Rect { x: 0, y: 0, width: SIDE / 2, height: SIDE };
    gpu.draw(&RasterJob { viewport: half, ..raster_job(&shot, ALL) }, &mut buffer).expect("draws");
    assert!(refused(&mut gpu, &shot, EffectProgram::ShadowMap).contains("drawn last"));
    let position = Attachments { position: true, ..Attachments::default() };
    gpu.draw(&raster_job(&shot, position), &mut buffer).expect("draws");
    assert!(refused(&mut gpu, &shot, EffectProgram::HorizonOcclusion).contains("no `normal`"));
    gpu.draw(&raster_job(&shot, Attachments::default()), &mut buffer).expect("draws");
    assert!(refused(&mut gpu, &shot, EffectProgram::HorizonOcclusion).contains("drawn last"));
}

#[test]
fn a_frame_like_the_last_allocates_nothing_and_is_the_same() {
    let Some(mut gpu) = rasteriser() else { return };
    let (_, mut shot) = shots().into_iter().next().expect("one");
    gpu.upload(&shot.scene).expect("uploads");
    draw(&mut gpu, &mut shot);
    let frame = |gpu: &mut WgpuRasteriser| -> Vec<Vec<[f32; 4]>> {
        EFFECT_PROGRAMS.iter().map(|info| run(gpu, &resident(&shot, info.program)).expect("a whole job").0).collect()
    };
    let first = frame(&mut gpu);
    let memory = gpu.memory();
    // Texels of a map, and pixels of the picture.
    let (map, pixels) = (256 * 256, u64::from(SIDE * SIDE));
    // Memory of the pyramid (blocks of 1, 2, 4 ... pixels along a side), and of the picture without glass.
    let sides = [160_u64, 80, 40, 20, 10, 5, 3, 2, 1];
    let marched = 4 * sides.iter().map(|side| side * side).sum::<u64>() + (3 * 16 + 4) * pixels;
    // Memory of the depths of the occlusions.
    let depths = 4 * pixels;
    // Memory of four shadow maps, of cube maps for two panes with a depth buffer, and of two mirrors that share a layer, with their depth
    // buffer.
    let maps = 4 * 4 * map + (2 * 6 * 16 + 4) * map + (16 + 4) * pixels;
    // The output takes 16 bytes a pixel.
    assert_eq!(memory.effects, maps + 16 * pixels + marched + depths);
    assert!(first == frame(&mut gpu));
    assert_eq!(gpu.memory(), memory);
}

#[test]
fn no_map_is_drawn_where_no_glass_is_seen() {
    let Some(mut gpu) = rasteriser() else { return };
    let away = street().seen(Vec3::new(0.0, 1.0, 5.0), Vec3::new(0.0, 0.5, 30.0), 64);
    // The panes are inside the view, but behind a wall.
    let mut hidden = street();
    let wall = hidden.paint(Vec3::ONE);
    hidden.quad(wall, Vec3::new(0.0, 0.0, 3.0), Vec3::X * 20.0, Vec3::Y * 20.0);
    let hidden = hidden.seen(Vec3::new(1.0, 2.2, 5.5), Vec3::new(0.1, 0.7, 0.0), 64);
    for mut shot in [hollow().seen(Vec3::new(2.0, 3.0, 3.0), Vec3::ZERO, 64), away, hidden] {
        gpu.upload(&shot.scene).expect("uploads");
        draw(&mut gpu, &mut shot);
        for program in EFFECT_PROGRAMS.iter().filter(|info| info.glass).map(|info| info.program) {
            for job in [resident(&shot, program), EffectJob { resident: false, ..shot.job(program, params()) }] {
                let (found, stats) = run(&mut gpu, &job).expect("a whole job");
                assert!(found == shot.buffer.color);
                assert_eq!((stats.maps, stats.map_count, stats.triangles, stats.bytes), (None, 0, 0, 0));
            }
        }
    }
}

#[test]
fn no_shadow_map_is_drawn_where_nothing_faces_the_light() {
    let Some(mut gpu) = rasteriser() else { return };
    let mut world = street();
    world.sun = World::lit_along(Vec3::Y).sun;
    let mut shot = world.seen(Vec3::new(0.0, 6.0, 0.1), Vec3::ZERO, 64);
    gpu.upload(&shot.scene).expect("uploads");
    draw(&mut gpu, &mut shot);
    let program = EffectProgram::ShadowMap;
    for job in [resident(&shot, program), EffectJob { resident: false, ..shot.job(program, params()) }] {
        let (found, stats) = run(&mut gpu, &job).expect("a whole job");
        let lit = shot.buffer.position.iter().any(|position| position[3] > 0.0);
        assert_eq!(stats.maps.is_some(), lit);
        assert!(lit || found.iter().all(|pixel| *pixel == [1.0; 4]));
        assert!(!lit, "from above, only what looks up is seen");
    }
}

#[test]
fn maps_and_parameters_beyond_what_is_valid_are_refused() {
    use EffectProgram::{CubeReflection, HorizonOcclusion, ShadowMap};
    let Some(mut gpu) = rasteriser() else { return };
    let (_, shot) = shots().into_iter().next().expect("one");
    let job = |program| EffectJob { resident: false, ..shot.job(program, params()) };
    let message = run(&mut gpu, &job(ShadowMap)).expect_err("no scene").to_string();
    assert!(message.contains("not uploaded"), "{message}");
    gpu.upload(&shot.scene).expect("uploads");
    let mut refused = |program, edit: fn(&mut EffectJob<'_>)| {
        let mut job = job(program);
        edit(&mut job);
        run(&mut gpu, &job).expect_err("refused").to_string()
    };
    let message = refused(ShadowMap, |job| job.sun = None);
    assert!(message.contains("light"), "{message}");
    let message = refused(ShadowMap, |job| job.params.map_size = 1 << 20);
    assert!(message.contains("16..=16384"), "{message}");
    let message = refused(ShadowMap, |job| (job.params.map_size, job.params.cascades) = (16_384, 8));
    assert!(
        message.contains("texels a side at most") || message.contains("lower `mapsize` or `cascades`"),
        "{message}"
    );
    let message = refused(CubeReflection, |job| job.params.map_size = 16_384);
    assert!(message.contains("lower `mapsize` or `probes`"), "{message}");
    let message = refused(HorizonOcclusion, |job| job.normal = &[]);
    assert!(message.contains("norm_buffer"), "{message}");
    let message = refused(CubeReflection, |job| job.shades = &job.shades[..1]);
    assert!(message.contains("material 1"), "{message}");
    run(&mut gpu, &job(ShadowMap)).expect("the device goes on");
}

#[test]
fn values_that_are_not_numbers_spread_to_no_other_pixel() {
    let Some(mut gpu) = rasteriser() else { return };
    let (_, shot) = shots().into_iter().next().expect("one");
    gpu.upload(&shot.scene).expect("uploads");
    for info in EFFECT_PROGRAMS {
        let (clean, _) = uploaded(&mut gpu, &shot, info.program);
        let mut position = shot.buffer.position.clone();
        let mut normal = shot.buffer.normal.clone();
        position[7000] = [f32::NAN; 4];
        position[15_000] = [f32::INFINITY, 0.0, 0.0, 1.0];
        normal[16_000] = [f32::NAN; 4];
        let job =
            EffectJob { resident: false, position: &position, normal: &normal, ..shot.job(info.program, params()) };
        let (found, _) = run(&mut gpu, &job).expect("a whole job");
        assert!(found.iter().flatten().all(|value| value.is_finite()), "{}", info.name);
        let changed = clean.iter().zip(&found).filter(|(a, b)| (a[0] - b[0]).abs() > 0.3).count();
        assert!(changed < 12, "{}: {changed}", info.name);
    }
}

#[test]
fn every_effect_works_on_few_pixels_and_empty_scenes() {
    let Some(mut gpu) = rasteriser() else { return };
    for side in [0, 1, 2, 17] {
        for world in [street(), World::default(), World::lit_along(Vec3::NEG_Y)] {
            let shot = world.seen(Vec3::new(1.0, 2.2, 5.5), Vec3::new(0.1, 0.7, 0.0), side);
            gpu.upload(&shot.scene).expect("uploads");
            for info in EFFECT_PROGRAMS {
                let job = EffectJob { resident: false, ..shot.job(info.program, params()) };
                match run(&mut gpu, &job) {
                    Ok((found, _)) => assert!(found.iter().flatten().all(|value| value.is_finite()), "{}", info.name),
                    Err(error) => assert!(info.lit && job.sun.is_none(), "{}: {error}", info.name),
                }
            }
        }
    }
}
