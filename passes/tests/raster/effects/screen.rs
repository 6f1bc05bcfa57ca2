//! Screen-space rays against rays in `f64` that share no code with them.

use super::mirrors::{Camera, SIDE, nearest};
use super::world::{Shot, World};
use curitiba_passes::raster::effects::screen::camera::ScreenCamera;
use curitiba_passes::raster::effects::screen::march::{Answer, Screen};
use curitiba_passes::raster::effects::screen::pyramid::Pyramid;
use curitiba_pipeline::backend::{Answers, NO_TRIANGLE};
use curitiba_pipeline::programs::RayParams;
use curitiba_pipeline::raster_effects::EffectProgram::{
    CubeReflection, CubeRefraction, ScreenReflection, ScreenRefraction,
};
use curitiba_pipeline::raster_effects::{EffectParams, EffectProgram, Missing};
use curitiba_pipeline::scene::TriangleRanges;
use glam::{DVec3, Vec3, Vec4};

/// Depth behind surfaces within which rays hit them.
const THIN: f32 = 0.002;

/// A pane on the ground, with boxes of many colours behind it, on both its sides and in the air.
fn court() -> World {
    let mut world = World::lit_along(Vec3::new(0.4, -1.0, -0.3));
    let paints: Vec<u32> = (1..8)
        .map(|index| world.paint(Vec3::new((index & 1) as f32, (index >> 1 & 1) as f32, (index >> 2 & 1) as f32)))
        .collect();
    for i in 0..12u32 {
        let x = -2.2 + 0.4 * i as f32;
        let height = 0.25 + 0.1 * (i * 5 % 7) as f32;
        let center = Vec3::new(x, height, -2.0 - 0.3 * (i * 3 % 5) as f32);
        world.block(paints[i as usize % 7], center, Vec3::new(0.16, height, 0.12));
    }
    world.block(paints[2], Vec3::new(0.3, 1.1, -1.5), Vec3::new(0.5, 0.1, 0.1));
    world.ground(12.0);
    let glass = world.pane();
    world.quad(glass, Vec3::new(0.0, 0.01, 0.2), Vec3::Z * 1.5, Vec3::X * 1.6);
    world
}

fn court_seen(perspective: bool) -> (Shot, Camera) {
    let mut camera = Camera::new(Vec3::new(0.2, 1.6, 4.0), Vec3::new(0.0, 0.5, -1.0), 0.5);
    if !perspective {
        (camera.perspective, camera.half) = (false, 2.2);
    }
    (court().through(camera.view(), SIDE, SIDE), camera)
}

/// Calls `look` with the picture through which rays are marched.
fn marched<T>(shot: &Shot, thickness: f32, look: impl FnOnce(&Screen<'_>) -> T) -> T {
    let size = [shot.buffer.width, shot.buffer.height];
    let camera = ScreenCamera::new(&shot.view, size[0], size[1]).expect("a camera");
    let mut pyramid = Pyramid::default();
    pyramid.build(&camera, size, &shot.buffer.position, &shot.buffer.normal).expect("host memory");
    let glass = TriangleRanges::new(&shot.scene.geometry, &shot.glass);
    look(&Screen {
        camera: &camera,
        size,
        position: &shot.buffer.position,
        normal: &shot.buffer.normal,
        pyramid: &pyramid,
        glass: Some((&shot.buffer.triangle, &glass)),
        thickness,
    })
}

fn is_glass(shot: &Shot, index: usize) -> bool {
    let id = shot.buffer.triangle[index];
    id != NO_TRIANGLE && shot.glass[shot.scene.geometry.material_of(id) as usize]
}

/// The hit of the exact ray from a glass pixel: its column and row, and whether the camera sees that place. `None`
/// where nothing is hit in front of the camera.
fn exact(shot: &Shot, camera: &Camera, index: usize) -> Option<(f64, f64, bool)> {
    let start = shot.position(index).as_dvec3();
    let seen_from = camera.ray((index as u32 % SIDE) as f64 + 0.5, (index as u32 / SIDE) as f64 + 0.5);
    let view = if camera.perspective { (start - camera.eye.as_dvec3()).normalize() } else { seen_from.1 };
    // The pane is horizontal.
    let onward = DVec3::new(view.x, -view.y, view.z);
    let (_, distance) = nearest(shot, start, onward, false)?;
    let met = start + onward * distance;
    let away = met - camera.eye.as_dvec3();
    let depth = away.dot(camera.forward);
    if depth <= 0.05 {
        return Some((f64::NAN, f64::NAN, false));
    }
    let scale = if camera.perspective { depth } else { 1.0 };
    let place = |offset: f64| (offset / scale / camera.half + 1.0) * 0.5 * f64::from(SIDE);
    let (x, y) = (place(away.dot(camera.right)), place(-away.dot(camera.up)));
    let (eye, direction) = camera.ray(x, y);
    let far = (met - eye).dot(direction);
    let first = [true, false].map(|glass| nearest(shot, eye, direction, glass).map_or(f64::INFINITY, |(_, t)| t));
    let inside = [x, y].iter().all(|at| (0.0..f64::from(SIDE)).contains(at));
    Some((x, y, inside && (first[0].min(first[1]) - far).abs() < 1e-6 * far))
}

#[test]
fn answers_lie_within_a_texel_of_what_exact_rays_meet() {
    for perspective in [true, false] {
        let (shot, camera) = court_seen(perspective);
        let (mut seen, mut answered, mut near, mut hidden, mut astray) = (0, 0, 0, 0, 0);
        marched(&shot, THIN, |screen| {
            for index in (0..shot.buffer.triangle.len()).filter(|index| is_glass(&shot, *index)) {
                let position = shot.position(index);
                let view = if perspective { (position - shot.view.eye).normalize() } else { camera.forward.as_vec3() };
                let onward = Vec3::new(view.x, -view.y, view.z);
                let found = screen.ask(position, onward, false);
                let truth = exact(&shot, &camera, index);
                let is_seen = truth.is_some_and(|(.., seen)| seen);
                seen += usize::from(is_seen);
                hidden += usize::from(!is_seen);
                if let Answer::Pixel(pixel) = found {
                    answered += 1;
                    let (column, row) = ((pixel as u32 % SIDE) as f64, (pixel as u32 / SIDE) as f64);
                    let off = |(x, y, _): (f64, f64, bool)| (x.floor() - column).abs().max((y.floor() - row).abs());
                    let within = truth.is_some_and(|truth| off(truth) <= 1.0);
                    near += usize::from(within);
                    // At an outline, the ray may pass beside the part of the pixel that shows the surface.
                    let away = shot.position(pixel) - position;
                    let aside = (away - onward * away.dot(onward)).length();
                    let depth = (shot.position(pixel) - camera.eye).dot(camera.forward.as_vec3());
                    let side = 2.0 * camera.half as f32 / SIDE as f32 * if perspective { depth } else { 1.0 };
                    astray += usize::from(aside > 1.5 * side + THIN);
                }
            }
        });
        println!(
            "perspective {perspective}: {seen} seen, {hidden} not; {answered} answered, {near} within a texel, {astray} astray"
        );
        assert!(seen > 1000 && hidden > 300, "the picture tests both");
        assert!(answered as f64 > 0.95 * seen as f64 && near as f64 > 0.95 * answered as f64);
        assert!(answered < seen + seen / 50, "what is not seen is not answered");
        assert_eq!(astray, 0, "every answer lies on the way of its ray");
    }
}

/// Control: the same comparison with rays that are slightly bent must find differences.
#[test]
fn the_comparison_finds_out_rays_that_are_off() {
    let (shot, camera) = court_seen(true);
    let (mut answered, mut near) = (0, 0);
    marched(&shot, THIN, |screen| {
        for index in (0..shot.buffer.triangle.len()).filter(|index| is_glass(&shot, *index)) {
            let position = shot.position(index);
            let view = (position - shot.view.eye).normalize();
            let bent = Vec3::new(view.x + 0.05, -view.y, view.z);
            if let (Answer::Pixel(pixel), Some((x, y, true))) =
                (screen.ask(position, bent, false), exact(&shot, &camera, index))
            {
                answered += 1;
                let (column, row) = ((pixel as u32 % SIDE) as f64, (pixel as u32 / SIDE) as f64);
                near += usize::from((x.floor() - column).abs().max((y.floor() - row).abs()) <= 1.0);
            }
        }
    });
    assert!(answered > 500 && near < answered / 2, "{near} of {answered}");
}

#[test]
fn rays_that_leave_the_screen_or_come_to_the_camera_are_not_answered() {
    let (shot, _) = court_seen(true);
    let index = (0..shot.buffer.triangle.len()).find(|index| is_glass(&shot, *index)).expect("glass");
    let position = shot.position(index);
    marched(&shot, 0.5, |screen| {
        let ask = |x, y, z| screen.ask(position, Vec3::new(x, y, z).normalize(), false);
        // Rays that leave the picture to the left, to the right and at the top, and one that goes back to the camera.
        for direction in [(-1.0, 0.3, 0.2), (1.0, 0.3, 0.2), (0.0, 1.0, 0.0), (0.05, 0.35, 1.0)] {
            assert_eq!(ask(direction.0, direction.1, direction.2), Answer::Missing, "{direction:?}");
        }
    });
    // A single pane above nothing: rays that leave for infinity within the picture hit nothing.
    let mut world = World::lit_along(Vec3::NEG_Y);
    let glass = world.pane();
    world.quad(glass, Vec3::ZERO, Vec3::Z, Vec3::X);
    let shot = world.seen(Vec3::new(0.0, 1.0, 4.0), Vec3::new(0.0, 0.5, 0.0), SIDE);
    let index = (0..shot.buffer.triangle.len()).find(|index| is_glass(&shot, *index)).expect("glass");
    marched(&shot, 0.5, |screen| {
        let ask = |direction: Vec3| screen.ask(shot.position(index), direction.normalize(), false);
        assert_eq!(ask(Vec3::new(0.0, 0.05, -1.0)), Answer::Nothing);
        assert_eq!(ask(Vec3::new(3.0, 0.05, -1.0)), Answer::Missing);
    });
}

/// A plate without thickness between the camera and the rays.
#[test]
fn a_plate_in_front_is_met_within_the_thickness_only() {
    let mut world = World::lit_along(Vec3::new(0.2, -1.0, -0.4));
    let (red, white) = (world.paint(Vec3::X), world.paint(Vec3::ONE));
    world.quad(white, Vec3::new(0.0, 2.0, -4.0), Vec3::X * 6.0, Vec3::Y * 6.0);
    // The plate is half a unit in front of rays that go to the side.
    world.quad(red, Vec3::new(0.6, 0.5, 0.5), Vec3::X * 0.2, Vec3::Y * 0.5);
    let shot = world.seen(Vec3::new(0.0, 0.5, 5.0), Vec3::new(0.0, 0.5, 0.0), SIDE);
    let start = Vec3::new(-0.5, 0.5, 0.0);
    let ask = |thickness: f32| marched(&shot, thickness, |screen| screen.ask(start, Vec3::new(1.0, 0.0, -0.001), true));
    assert_eq!(ask(0.1), Answer::Missing);
    assert_eq!(ask(0.4), Answer::Missing);
    let Answer::Pixel(pixel) = ask(0.6) else { panic!("within the thickness the plate is met") };
    assert!(shot.buffer.color[pixel][0] > 2.0 * shot.buffer.color[pixel][1], "{:?}", shot.buffer.color[pixel]);
    // A ray from behind the plate that passes through it hits its unseen side.
    let from_behind = Vec3::new(0.2, 0.0, 0.6);
    let behind = marched(&shot, 2.0, |screen| screen.ask(Vec3::new(0.45, 0.5, -0.2), from_behind, true));
    assert_eq!(behind, Answer::Missing);
    // In front of the plate the way to the wall is free.
    let free = marched(&shot, 0.1, |screen| screen.ask(Vec3::new(0.5, 0.5, 1.0), Vec3::new(-0.6, 0.1, -1.0), true));
    let Answer::Pixel(pixel) = free else { panic!("it meets the wall: {free:?}") };
    assert_eq!(shot.buffer.color[pixel][0], shot.buffer.color[pixel][1]);
}

#[test]
fn every_pixel_of_glass_is_counted_once_and_what_is_missing_is_what_was_asked_for() {
    for (program, cube) in [(ScreenReflection, CubeReflection), (ScreenRefraction, CubeRefraction)] {
        let (mut shot, _) = court_seen(true);
        let base = EffectParams { map_size: 64, thickness: 0.02, index: 1.4, ..EffectParams::default() };
        let glass = (0..shot.buffer.triangle.len()).filter(|index| is_glass(&shot, *index)).count() as u64;
        let mut run = |program: EffectProgram, missing| {
            let (picture, stats) = shot.effect(program, EffectParams { missing, ..base });
            (picture, stats)
        };
        let (own, owned) = run(program, Missing::Own);
        let (filled, cubes) = run(program, Missing::Cube);
        let (left, leaving) = run(program, Missing::Rays);
        let (by_cubes, _) = run(cube, Missing::Cube);
        let answers = [owned, cubes, leaving].map(|stats| stats.answers.expect("counted"));
        for found in answers {
            assert_eq!(found.glass(), glass, "{program:?}: {found:?}");
            assert_eq!(found.screen, answers[0].screen, "{program:?}");
        }
        assert!(answers[0].screen < glass, "some are missing");
        assert_eq!([answers[0].kept, answers[1].cube, answers[2].rays], [glass - answers[0].screen; 3]);
        let maps = u32::from(program == ScreenRefraction);
        assert_eq!([owned, cubes, leaving].map(|stats| stats.map_count), [maps, maps + 1, maps], "{program:?}");
        let mut missing = 0;
        for index in 0..own.len() {
            let color = shot.buffer.color[index];
            if !is_glass(&shot, index) {
                assert!([own[index], filled[index], left[index]] == [color; 3], "other pixels keep their colour");
            } else if left[index][3] == Answers::LEFT {
                missing += 1;
                if program == ScreenReflection {
                    assert_eq!((own[index], filled[index]), (with_alpha(color), by_cubes[index]));
                }
            } else {
                assert_eq!((own[index], filled[index]), (left[index], left[index]));
            }
        }
        assert_eq!(missing, answers[2].rays);
    }
}

fn with_alpha(color: [f32; 4]) -> [f32; 4] {
    Vec4::from_array(color).truncate().extend(1.0).to_array()
}

/// Pixels that the effect answers have the same colours and weights as with the ray program.
#[test]
fn answered_pixels_show_what_rays_show() {
    for (program, least) in [(ScreenReflection, 1000), (ScreenRefraction, 300)] {
        let (mut shot, _) = court_seen(true);
        let params = EffectParams {
            missing: Missing::Rays,
            map_size: 64,
            thickness: 0.02,
            index: 1.4,
            ..EffectParams::default()
        };
        let (found, stats) = shot.effect(program, params);
        let expected = shot.rays(program, params.by_rays());
        let other = shot.rays(program, RayParams { index: 2.2, ..params.by_rays() });
        let answered: Vec<usize> =
            (0..found.len()).filter(|index| is_glass(&shot, *index) && found[*index][3] == 1.0).collect();
        assert_eq!(answered.len() as u64, stats.answers.expect("counted").screen);
        let near = |picture: &[[f32; 4]]| {
            let same = |index: &&usize| (0..3).all(|i| (found[**index][i] - picture[**index][i]).abs() < 2e-3);
            answered.iter().filter(same).count()
        };
        println!("{program:?}: {} of {} answered pixels as by rays", near(&expected), answered.len());
        assert!(answered.len() > least, "{program:?}: {}", answered.len());
        assert!(near(&expected) as f64 > 0.93 * answered.len() as f64, "{program:?}");
        if program == ScreenRefraction {
            assert!(near(&other) < answered.len() / 4, "another index is found out");
        }
    }
}
