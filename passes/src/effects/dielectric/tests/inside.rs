//! A camera in a body, which absorbs light between the eye and the opaque surfaces that the eye sees directly.

use super::spheres::run;
use super::*;
use crate::effects::tests::world::{BACKGROUND, grid};
use curitiba_pipeline::backend::NO_TRIANGLE;
use glam::DVec3;

/// Extinction of the body that the camera is in; `FAR` is the extinction of another body.
const NEAR: Vec3 = Vec3::new(0.1, 0.4, 0.9);
const FAR: Vec3 = Vec3::new(0.7, 0.05, 0.3);
const EYE: Vec3 = Vec3::new(0.3, -0.2, 1.4);
const WALL: f32 = -1.6;
const BALL: (Vec3, f32) = (Vec3::new(0.5, 0.3, -0.6), 0.45);
const SIDE: u32 = 21;
const INDEX: f32 = 1.4;

/// A wall, and an exact ball before it, in bodies of these extinctions and half sizes around the origin, under light that falls along -z. The
/// bodies are blocks or exact spheres.
fn place(bodies: &[(Vec3, f32)], are_spheres: bool) -> World {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let glass: Vec<u32> = bodies.iter().map(|(sigma, _)| world.dielectric(solid(INDEX, *sigma))).collect();
    let (wall, paint) = (world.paint(FRONT), world.paint(BEHIND));
    world.quad(wall, Vec3::Z * WALL, Vec3::X * 1.5, Vec3::Y * 1.5);
    for (material, (_, half)) in glass.iter().zip(bodies) {
        match are_spheres {
            true => world.sphere(*material, Vec3::ZERO, *half),
            false => block(&mut world, *material, Vec3::ZERO, Vec3::splat(*half), true),
        }
    }
    world.sphere(paint, BALL.0, BALL.1);
    world
}

fn targets() -> impl Iterator<Item = Vec3> {
    grid(SIDE, Vec3::Z * WALL, Vec3::X * 1.4, Vec3::Y * 1.4)
}

/// What the eye sees in the direction of a target: the point of the ball, or else of the wall, in `f64`.
fn seen(target: Vec3) -> (DVec3, bool) {
    let (eye, center, radius) = (EYE.as_dvec3(), BALL.0.as_dvec3(), f64::from(BALL.1));
    let (direction, from) = ((target.as_dvec3() - eye).normalize(), eye - center);
    let middle = -from.dot(direction);
    let square = radius * radius - (from.length_squared() - middle * middle);
    match square > 0.0 {
        true => (eye + direction * (middle - square.sqrt()), true),
        false => (eye + direction * ((f64::from(WALL) - eye.z) / direction.z), false),
    }
}

/// exp(-sigma d) by colour, with the distance d to the point that is seen in the direction of a target.
fn kept(sigma: Vec3, target: Vec3) -> Vec3 {
    let length = seen(target).0.distance(EYE.as_dvec3());
    (-sigma.as_dvec3() * length).map(f64::exp).as_vec3()
}

fn colors(pixels: &[[f32; 4]]) -> impl Iterator<Item = Vec3> {
    pixels.iter().map(|pixel| Vec3::from_slice(pixel))
}

/// The largest difference of a channel.
fn off(found: &[[f32; 4]], expected: &[Vec3]) -> f32 {
    assert_eq!(found.len(), expected.len());
    colors(found).zip(expected).map(|(found, expected)| (found - *expected).abs().max_element()).fold(0.0, f32::max)
}

#[test]
fn what_the_camera_sees_in_its_own_body_is_absorbed_by_it() {
    for are_spheres in [false, true] {
        // The camera is in one body; in the inner of two; in the outer of two; in clear glass.
        for (bodies, sigma) in [
            (&[(NEAR, 4.0)][..], NEAR),
            (&[(FAR, 4.0), (NEAR, 3.0)], NEAR),
            (&[(NEAR, 4.0), (FAR, 0.1)], NEAR),
            (&[(Vec3::ZERO, 4.0)], Vec3::ZERO),
        ] {
            let world = place(bodies, are_spheres);
            // Targets are left out where the line to them may meet a small body in the middle.
            let way = |target: &Vec3| bodies.len() < 2 || bodies[1].1 > 1.0 || target.x < -0.9;
            let targets: Vec<Vec3> = targets().filter(way).collect();
            let shot = Shot::of(&world, EYE, targets.iter().copied());
            let stored: Vec<Vec3> = colors(&shot.color).collect();
            let lit = |sigma: Vec3| -> Vec<Vec3> {
                stored.iter().zip(&targets).map(|(color, target)| *color * kept(sigma, *target)).collect()
            };
            let (pixels, rays) = run(&world, &shot, RayProgram::Refraction, auto(5));
            let what = format!("spheres {are_spheres}, {bodies:?}");
            assert!(off(&pixels, &lit(sigma)) < 1e-6, "{what}: {}", off(&pixels, &lit(sigma)));
            assert_eq!((rays.total(), rays.lost), (0, 0), "{what}");
            // Controls: the colour without absorption, and the colour with absorption by the other body.
            for wrong in [Vec3::ZERO, FAR].into_iter().filter(|wrong| *wrong != sigma) {
                assert!(off(&pixels, &lit(wrong)) > 0.1, "{what}: {wrong}");
            }
        }
    }
}

/// The light of the wall comes through the upper side of the body, where the ball does not stop it.
#[test]
fn light_and_shadow_in_the_body_around_the_camera_are_absorbed_once_more_on_the_way_to_it() {
    for (are_spheres, shadows) in [
        (false, &[GlassShadow::Report, GlassShadow::Opaque, GlassShadow::Straight][..]),
        (true, &[GlassShadow::Opaque]),
    ] {
        for shadow in shadows {
            let half = 4.0;
            let mut world = place(&[(NEAR, half)], are_spheres);
            if *shadow == GlassShadow::Opaque {
                world.shadow_glass.fill(false);
            }
            let shot = Shot::of(&world, EYE, targets());
            let (pixels, _) = run(&world, &shot, RayProgram::Final, RayParams { shadow: *shadow, ..auto(5) });
            let arriving = |point: DVec3| match shadow {
                GlassShadow::Opaque => Vec3::splat(0.5),
                GlassShadow::Report => Vec3::splat(0.9),
                _ => {
                    let (r, _) = interface(0.0, f64::from(INDEX));
                    let way = f64::from(half) - point.z;
                    (0.5 + 0.5 * (1.0 - r) * (-NEAR.as_dvec3() * way).map(f64::exp)).as_vec3()
                }
            };
            // How far outside of the ball's shadow a point is; the ball itself is lit where the eye sees it, but for its rim.
            let beside = |point: DVec3| (point - BALL.0.as_dvec3()).truncate().length() - f64::from(BALL.1);
            let mut counts = [0; 3];
            for ((pixel, target), stored) in colors(&pixels).zip(targets()).zip(colors(&shot.color)) {
                let (point, is_ball) = seen(target);
                let share = match () {
                    () if is_ball && beside(point) > -0.02 => continue,
                    () if !is_ball && beside(point).abs() < 1e-3 => continue,
                    () if !is_ball && beside(point) < 0.0 => Vec3::splat(0.5),
                    () => arriving(point),
                };
                counts[if is_ball { 0 } else { 1 + usize::from(beside(point) < 0.0) }] += 1;
                let expected = stored * share * kept(NEAR, target);
                let apart = (pixel - expected).abs().max_element();
                assert!(apart < 2e-6, "{shadow:?}, {target}: {pixel}, not {expected}");
                let control = (pixel - stored * share).abs().max_element();
                assert!(control > 0.03, "{shadow:?}, {target}: {pixel} is not absorbed");
            }
            // The ball hides most of its shadow.
            assert!(counts[0] > 50 && counts[1] > 200 && counts[2] > 1, "ball, wall, shadow: {counts:?}");
        }
    }
}

#[test]
fn occlusion_in_the_body_around_the_camera_is_that_of_a_clear_one() {
    let params = RayParams { samples: 16, radius: 0.8, shadow: GlassShadow::Report, ..auto(5) };
    let render = |sigma: Vec3| {
        let world = place(&[(sigma, 4.0)], false);
        let (pixels, rays) = run(&world, &Shot::of(&world, EYE, targets()), RayProgram::Final, params);
        (pixels, rays.occlusion)
    };
    let ((dyed, count), (clear, same)) = (render(NEAR), render(Vec3::ZERO));
    assert!(count == same && count > 1000, "{count} {same}");
    let absorbed: Vec<Vec3> = colors(&clear).zip(targets()).map(|(clear, target)| clear * kept(NEAR, target)).collect();
    assert!(off(&dyed, &absorbed) < 1e-6, "{}", off(&dyed, &absorbed));
    let open = off(&clear, &colors(&Shot::of(&place(&[], false), EYE, targets()).color).collect::<Vec<_>>());
    assert!(open > 0.1, "control: something is occluded");
}

#[test]
fn who_is_outside_sees_opaque_surfaces_as_they_are_to_the_bit() {
    let outside = Vec3::new(0.3, -0.2, 6.0);
    let mut world = World::lit_along(Vec3::new(0.3, -1.0, -0.4));
    let glass = world.dielectric(solid(INDEX, NEAR));
    block(&mut world, glass, Vec3::ZERO, Vec3::splat(1.0), true);
    room(&mut world);
    world.shadow_glass.fill(false);
    let shot = Shot::of(&world, outside, grid(SIDE, Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0));
    let is_glass = |index: usize| world.glass[world.scene.geometry.material_of(shot.triangle[index]) as usize];
    let params = RayParams { samples: 8, radius: 1.0, ..auto(5) };
    for program in [RayProgram::Refraction, RayProgram::Final] {
        let job = shot.job(program, Corrected, params);
        let (found, _) = shot.run_on(&world.tree(), &job);
        // Programs that support panes alone shade all else in the same way, and ignore that a camera may be in a body.
        let (plain, _) = shot.run_on(&world.tree(), &RayJob { dielectrics: &[], ..job });
        let opaque: Vec<usize> = (0..found.len()).filter(|index| !is_glass(*index)).collect();
        assert!(opaque.len() > 300 && opaque.len() < found.len());
        for index in opaque {
            assert_eq!(found[index].map(f32::to_bits), plain[index].map(f32::to_bits), "{program:?} {index}");
        }
    }
}

/// The near plane cuts the body's surface away. The background has no position and keeps its colour; the wall counts as seen in the body.
#[test]
fn the_background_behind_a_cut_keeps_its_colour() {
    let place = |body: Option<Vec3>| {
        let mut world = World::lit_along(Vec3::NEG_Z);
        let wall = world.paint(FRONT);
        world.quad(wall, Vec3::Z * WALL, Vec3::X * 1.5, Vec3::Y * 1.5);
        if let Some(sigma) = body {
            let glass = world.dielectric(solid(INDEX, sigma));
            block(&mut world, glass, EYE, Vec3::splat(0.05), true);
        }
        world
    };
    let bare = place(None);
    for sigma in [NEAR, Vec3::splat(1e30), Vec3::splat(f32::MAX)] {
        let world = place(Some(sigma));
        let shot = Shot::of(&bare, EYE, targets().chain([EYE + Vec3::Y])).in_world(&world);
        let last = shot.triangle.len() - 1;
        assert_eq!(shot.triangle[last], NO_TRIANGLE);
        for program in [RayProgram::Refraction, RayProgram::Final] {
            let (pixels, _) = shot.run_on(&world.tree(), &shot.job(program, Corrected, auto(5)));
            assert_eq!(pixels[last], BACKGROUND, "{program:?} {sigma}");
            for ((pixel, stored), target) in pixels.iter().zip(colors(&shot.color)).zip(targets()) {
                let way = target.as_dvec3().distance(EYE.as_dvec3());
                let expected = stored * (-sigma.as_dvec3() * way).map(f64::exp).as_vec3();
                // The cut body still dims light, in the middle.
                let is_below = (target - EYE).truncate().abs().max_element() < 0.06;
                let share = if program == RayProgram::Final && is_below { 0.9 } else { 1.0 };
                assert_close(*pixel, expected * share, 1e-6, format!("{program:?} {sigma} {target}"));
            }
        }
    }
}

/// Adaptive sampling follows the paths of rough glass anew; opaque surfaces that are seen in the body stay as they are, to the bit.
#[test]
fn adaptive_sampling_absorbs_alike() {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let glass = world.dielectric(Dielectric { alpha: 0.3, ..solid(INDEX, NEAR) });
    let wall = world.paint(FRONT);
    world.quad(wall, Vec3::Z * WALL, Vec3::X * 1.5, Vec3::Y * 1.5);
    block(&mut world, glass, Vec3::ZERO, Vec3::splat(4.0), true);
    let shot = Shot::of(&world, EYE, grid(SIDE, Vec3::Z * WALL, Vec3::X * 1.8, Vec3::Y * 1.8)).rows(SIDE);
    for program in [RayProgram::Refraction, RayProgram::Final] {
        let plain = RayParams { paths: 16, ..auto(1) };
        let run = |params: RayParams| shot.run_on(&world.tree(), &shot.job(program, Corrected, params)).0;
        let (whole, sampled) = (run(plain), run(RayParams { error: 0.05, ..plain }));
        let mut counts = [0; 2];
        for (index, (whole, sampled)) in whole.iter().zip(&sampled).enumerate() {
            let is_wall = shot.triangle[index] < 2;
            counts[usize::from(is_wall)] += 1;
            assert!(!is_wall || whole.map(f32::to_bits) == sampled.map(f32::to_bits), "{program:?} {index}");
            let stored = Vec3::from_slice(&shot.color[index]);
            let expected =
                stored * (-NEAR * Vec4::from_array(shot.position[index]).truncate().distance(EYE)).map(f32::exp);
            let share = if program == RayProgram::Final { 0.9 } else { 1.0 };
            assert!(
                !is_wall || (Vec3::from_slice(sampled) - share * expected).abs().max_element() < 2e-6,
                "{program:?}"
            );
        }
        assert!(counts.iter().all(|count| *count > 50), "{counts:?}");
        assert_ne!(whole, sampled, "control: the rest is sampled");
    }
}
