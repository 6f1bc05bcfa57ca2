//! Several lights, and positional lights, against closed forms: the share of a floor's colour that shadows leave.

use super::sun::open_beyond_plane;
use super::world::{SUN_COLOR, Shot, World, assert_close, grid};
use crate::effects::Preparation;
use curitiba_pipeline::backend::{Cone, Light, Sun};
use curitiba_pipeline::glass::GlassShadow;
use curitiba_pipeline::programs::Fidelity::{Corrected, Thesis};
use curitiba_pipeline::programs::RayProgram::{DeferredShadows, Final, Reflection, Whitted};
use curitiba_pipeline::programs::{RayParams, RayProgram};
use glam::{DVec3, Vec3, Vec4};

const AMBIENT: f64 = 0.3;
const EYE: Vec3 = Vec3::new(0.0, 0.5, 40.0);

/// A positional light that falls off with the square of the distance.
fn lamp(place: Vec3, color: Vec3) -> Light {
    let attenuation = [0.0, 0.0, 1.0];
    Light { place: Some(place), direction: Vec3::ZERO, color, attenuation, range: f32::INFINITY, cone: None }
}

/// A floor at z = 0 under these lights.
fn floor(lights: &[Light]) -> World {
    let mut world = World { lights: lights.to_vec(), ..World::default() };
    let paint = world.paint(Vec3::new(0.8, 0.6, 0.4));
    world.quad(paint, Vec3::ZERO, Vec3::X * 50.0, Vec3::Y * 50.0);
    world
}

/// Points of the floor, seen from above what stands on it.
fn points() -> impl Iterator<Item = Vec3> + Clone {
    grid(24, Vec3::new(0.013, 0.007, 0.0), Vec3::X * 3.0, Vec3::Y * 3.0).collect::<Vec<_>>().into_iter()
}

/// The shares that `deferredShadows` writes for points of the floor. The G-buffer shows the floor alone, so nothing hides these points.
fn shares(world: &World, targets: impl IntoIterator<Item = Vec3>) -> Vec<Vec4> {
    shares_of(world, targets, RayParams::default())
}

fn shares_of(world: &World, targets: impl IntoIterator<Item = Vec3>, params: RayParams) -> Vec<Vec4> {
    let mut seen = floor(&world.lights);
    seen.sun = world.sun;
    let shot = Shot::of(&seen, EYE, targets).in_world(world);
    let (pixels, _) = shot.run(DeferredShadows, Corrected, params);
    pixels.into_iter().map(Vec4::from_array).collect()
}

/// The light of a lamp that arrives on the floor, in `f64`.
fn arriving(light: &Light, point: Vec3) -> DVec3 {
    let way = (light.place.expect("a lamp") - point).as_dvec3();
    light.color.as_dvec3() * (way.z.max(0.0) / way.length().powi(3))
}

fn close(found: Vec4, expected: DVec3, what: impl std::fmt::Display) {
    assert_eq!(found.w, 1.0, "{what}");
    assert_close(found.to_array(), expected.as_vec3(), 2e-6, what);
}

#[test]
fn a_square_below_a_lamp_throws_a_larger_shadow_and_one_above_it_none() {
    let light = lamp(Vec3::new(0.0, 0.0, 4.0), Vec3::new(8.0, 4.0, 0.5));
    let mut world = floor(&[light]);
    // Half a unit at a height of 2 shades a unit of the floor.
    world.quad(0, Vec3::Z * 2.0, Vec3::X * 0.5, Vec3::Y * 0.5);
    world.quad(0, Vec3::Z * 4.5, Vec3::X * 9.0, Vec3::Y * 9.0);
    let mut dark = 0;
    for (point, found) in points().zip(shares(&world, points())) {
        let edge = point.x.abs().max(point.y.abs());
        if (edge - 1.0).abs() < 1e-3 {
            continue;
        }
        let light = arriving(&light, point);
        let left = if edge < 1.0 { AMBIENT / (AMBIENT + light) } else { DVec3::ONE };
        close(found, left, point);
        dark += usize::from(edge < 1.0);
    }
    assert!(dark > 40 && dark < 100, "{dark}");
    // Control: along an infinite ray, the square above the lamp would shade the whole floor.
    let sun = Light { place: None, direction: Vec3::NEG_Z, ..light };
    world.lights = vec![sun, sun];
    assert!(shares(&world, points()).iter().all(|share| share.x < 0.5));
}

#[test]
fn each_light_throws_a_shadow_that_the_others_fill() {
    let [red, blue] = [(-1.0, Vec3::X), (1.0, Vec3::Z)].map(|(x, color)| lamp(Vec3::new(x, 0.0, 4.0), color * 9.0));
    let mut world = floor(&[red, blue]);
    world.quad(0, Vec3::Z * 2.0, Vec3::X * 0.4, Vec3::Y * 0.4);
    // The shadow of each lamp has half side 0.8, and lies one unit off the middle, on the side of the other lamp.
    let in_shadow = |point: Vec3, x: f32| (point.x - x).abs().max(point.y.abs()) - 0.8;
    let mut kinds = [0; 4];
    for (point, found) in points().zip(shares(&world, points())) {
        let of = [in_shadow(point, 1.0), in_shadow(point, -1.0)];
        if of.iter().any(|edge| edge.abs() < 1e-3) {
            continue;
        }
        let (whole, seen) =
            [red, blue].iter().zip(of).fold((DVec3::ZERO, DVec3::ZERO), |(whole, seen), (light, edge)| {
                let light = arriving(light, point);
                (whole + light, if edge > 0.0 { seen + light } else { seen })
            });
        close(found, (AMBIENT + seen) / (AMBIENT + whole), point);
        kinds[usize::from(of[0] < 0.0) + 2 * usize::from(of[1] < 0.0)] += 1;
    }
    assert!(kinds[0] > 300 && kinds[1] > 30 && kinds[2] > 30, "{kinds:?}");
}

#[test]
fn the_final_picture_is_the_colour_times_the_share_and_glass_takes_its_tenth() {
    let lights =
        [lamp(Vec3::new(0.0, 1.0, 4.0), Vec3::new(6.0, 5.0, 4.0)), lamp(Vec3::new(2.0, 0.0, 3.0), Vec3::splat(4.0))];
    let mut world = floor(&lights);
    world.quad(0, Vec3::Z * 2.0, Vec3::X * 0.5, Vec3::Y * 0.5);
    let params = RayParams { samples: 0, ..RayParams::default() };
    let seen = floor(&lights);
    let run = |world: &World, program| {
        let shot = Shot::of(&seen, EYE, points()).in_world(world);
        let color = shot.color.clone();
        (color, shot.run(program, Corrected, params).0)
    };
    let (color, combined) = run(&world, Final);
    let (_, share) = run(&world, DeferredShadows);
    for ((color, combined), share) in color.iter().zip(combined).zip(share) {
        let product = (Vec4::from(*color) * Vec4::from(share)).truncate();
        assert_close(combined, product, 1e-6, "the product");
    }
    // A pane over all of the floor dims both lights; `deferredShadows` knows no glass.
    let mut glazed = floor(&lights);
    let pane = glazed.glass();
    glazed.quad(pane, Vec3::Z * 1.0, Vec3::X * 20.0, Vec3::Y * 20.0);
    let (color, dimmed) = run(&glazed, Final);
    for ((point, color), dimmed) in points().zip(color).zip(dimmed) {
        let whole: DVec3 = lights.iter().map(|light| arriving(light, point)).sum();
        let left = (AMBIENT + 0.9 * whole) / (AMBIENT + whole);
        assert_close(dimmed, Vec4::from(color).truncate() * left.as_vec3(), 2e-6, point);
    }
}

#[test]
fn lights_at_behind_and_inside_of_things_and_far_away() {
    let white = Vec3::splat(2.0);
    // In the floor, below it, and exactly at a point that is seen: nothing arrives, so nothing is in shadow.
    for place in [Vec3::new(0.5, 0.5, 0.0), Vec3::new(0.0, 0.0, -1.0), Vec3::ZERO] {
        let world = floor(&[lamp(place, white)]);
        let targets = || points().chain([Vec3::ZERO]);
        assert!(shares(&world, targets()).iter().all(|share| *share == Vec4::ONE), "{place}");
    }
    // On a ceiling, which is no obstacle.
    let light = lamp(Vec3::new(0.1, 0.3, 3.0), white);
    let mut world = floor(&[light]);
    world.quad(0, Vec3::Z * 3.0, Vec3::X * 9.0, Vec3::NEG_Y * 9.0);
    assert!(shares(&world, points()).iter().all(|share| *share == Vec4::ONE));
    // In a closed box: the floor has ambient light alone.
    let mut world = floor(&[light]);
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        let (u, v) = axis.any_orthonormal_pair();
        for side in [axis, -axis] {
            world.quad(0, Vec3::new(0.1, 0.3, 3.0) + side * 0.5, u * 0.5, v * 0.5);
        }
    }
    for (point, found) in points().zip(shares(&world, points())) {
        close(found, AMBIENT / (AMBIENT + arriving(&light, point)), point);
    }
    // A million units away, and a million squared times as bright, a lamp is a sun.
    let direction = Vec3::new(0.6, 0.0, -0.8);
    let far = Light { color: white * 1e12, ..lamp(direction * -1e6, white) };
    let sun = Light { place: None, direction, attenuation: [1.0, 0.0, 0.0], ..lamp(Vec3::ZERO, white) };
    let [far, near] = [far, sun].map(|light| {
        let mut world = floor(&[light, lamp(Vec3::new(0.0, 0.0, 5.0), white)]);
        world.quad(0, Vec3::Z * 2.0, Vec3::X * 0.5, Vec3::Y * 0.5);
        shares(&world, points())
    });
    let most = far.iter().zip(near).map(|(a, b)| (*a - b).abs().max_element()).fold(0.0, f32::max);
    assert!(most < 2e-5, "{most}");
}

#[test]
fn a_spot_light_ends_at_its_cone() {
    let cosine = 0.25_f32.atan().cos();
    let cone = Some(Cone { inner: cosine, outer: cosine, exponent: 0.0 });
    let light = Light { direction: Vec3::NEG_Z, cone, ..lamp(Vec3::Z * 4.0, Vec3::splat(9.0)) };
    // Everything is in shadow: what is left says how much light would arrive.
    let mut world = floor(&[light]);
    world.quad(0, Vec3::Z * 2.0, Vec3::X * 9.0, Vec3::Y * 9.0);
    let mut lit = 0;
    for (point, found) in points().zip(shares(&world, points())) {
        let radius = point.truncate().length();
        if (radius - 1.0).abs() < 1e-3 {
            continue;
        }
        let whole = if radius < 1.0 { arriving(&light, point) } else { DVec3::ZERO };
        close(found, AMBIENT / (AMBIENT + whole), point);
        lit += usize::from(radius < 1.0);
    }
    assert!(lit > 40 && lit < 80, "{lit}");
}

#[test]
fn what_rays_meet_is_lit_by_all_lights() {
    let lights =
        [lamp(Vec3::new(0.0, 0.0, 4.0), Vec3::new(6.0, 5.0, 4.0)), lamp(Vec3::new(2.0, 0.0, 3.0), Vec3::splat(4.0))];
    // A mirror that stands on the floor shows it.
    let mut world = floor(&lights);
    let pane = world.glass();
    world.quad(pane, Vec3::new(0.0, 6.0, 3.0), Vec3::X * 5.0, Vec3::Z * 3.0);
    let eye = Vec3::new(0.0, -6.0, 3.0);
    let targets: Vec<Vec3> = grid(8, Vec3::new(0.0, 6.0, 1.5), Vec3::X, Vec3::Z * 0.3).collect();
    let shot = Shot::of(&world, eye, targets.iter().copied());
    let (pixels, _) = shot.run(Reflection, Corrected, RayParams::default());
    for (target, found) in targets.iter().zip(pixels) {
        let way = *target - eye;
        let onward = Vec3::new(way.x, -way.y, way.z);
        let met = *target + onward * (target.z / -onward.z);
        let whole: DVec3 = lights.iter().map(|light| arriving(light, met)).sum();
        let expected = DVec3::new(0.8, 0.6, 0.4) * (AMBIENT + whole);
        assert_close(found, expected.as_vec3(), 2e-5, met);
    }
}

fn sun(direction: Vec3, color: Vec3) -> Light {
    Light { place: None, direction: direction.normalize(), attenuation: [1.0, 0.0, 0.0], ..lamp(Vec3::ZERO, color) }
}

/// A floor of these lights under a roof whose edge is the line x = 0, z = 1.
fn roofed(lights: &[Light]) -> World {
    let mut world = floor(lights);
    world.quad(0, Vec3::new(-20.0, 0.0, 1.0), Vec3::X * 20.0, Vec3::Y * 20.0);
    world
}

#[test]
fn of_each_directional_light_the_part_of_its_disc_is_seen_that_an_edge_leaves() {
    // Both penumbrae are where nothing covers the floor.
    let directions = [Vec3::new(-0.5, 0.1, -1.0), Vec3::new(-0.3, 0.4, -1.0)];
    let lights = [sun(directions[0], Vec3::X * 0.7), sun(directions[1], Vec3::Z * 0.9)];
    let params = RayParams { sun: 20.0, sun_samples: 256, ..RayParams::default() };
    let targets = || grid(24, Vec3::new(-0.35, 0.3, 0.0), Vec3::X * 0.3, Vec3::Y * 0.2);
    // From the side, below the roof.
    let look = |world: &World, program: RayProgram, params: RayParams| {
        let shot = Shot::of(world, Vec3::new(3.0, 0.3, 0.8), targets());
        let color = shot.color.clone();
        (color, shot.run(program, Corrected, params))
    };
    let world = roofed(&lights);
    let (color, (soft, rays)) = look(&world, DeferredShadows, params);
    assert_eq!(rays.shadow, 2 * 24 * 24 * 256);
    let half = 10f64.to_radians();
    for (channel, light) in [(0, &lights[0]), (2, &lights[1])] {
        let towards = -light.direction.as_dvec3();
        let (mut squares, mut partly) = (0.0, 0);
        for (target, share) in targets().zip(&soft) {
            assert_eq!(share[1], 1.0, "no light is green");
            let arrives = f64::from(light.color[channel]) * towards.z;
            let seen = (f64::from(share[channel]) * (AMBIENT + arrives) - AMBIENT) / arrives;
            // The plane through the point and the edge, with its normal towards the open side.
            let normal = DVec3::new(1.0, 0.0, f64::from(target.x)).normalize();
            let expected = open_beyond_plane(normal.dot(towards).asin(), half);
            squares += (seen - expected).powi(2);
            partly += usize::from((0.05..0.95).contains(&expected));
        }
        let error = (squares / 576.0).sqrt();
        assert!(error < 0.008 && partly > 150, "channel {channel}: {error}, {partly} in the penumbra");
    }
    // `final` has the product, with each kind of shadow; there is no glass.
    for shadow in [GlassShadow::Report, GlassShadow::Straight] {
        let mut world = roofed(&lights);
        world.bodies = true;
        let (_, (combined, rays)) = look(&world, Final, RayParams { shadow, samples: 0, ..params });
        assert_eq!(rays.shadow, 2 * 24 * 24 * 256);
        for ((color, combined), share) in color.iter().zip(combined).zip(&soft) {
            assert_close(combined, (Vec4::from(*color) * Vec4::from(*share)).truncate(), 1e-6, "the product");
        }
    }
    // Two lights of one direction have samples of their own.
    let twins = roofed(&[lights[0], sun(directions[0], Vec3::Z * 0.7)]);
    let (_, (soft, _)) = look(&twins, DeferredShadows, RayParams { sun_samples: 4, ..params });
    assert!(soft.iter().filter(|share| share[0] != share[2]).count() > 100);
}

#[test]
fn discs_that_are_points_give_the_hard_shadows_of_several_lights_and_lamps_are_points() {
    let lights = [
        sun(Vec3::new(-0.5, 0.1, -1.0), Vec3::new(0.4, 0.3, 0.1)),
        lamp(Vec3::new(1.5, 0.0, 4.0), Vec3::new(2.0, 3.0, 4.0)),
        sun(Vec3::new(0.3, 0.2, -1.0), Vec3::splat(0.2)),
    ];
    let mut world = floor(&lights);
    world.quad(0, Vec3::Z * 2.0, Vec3::X * 0.5, Vec3::Y * 0.5);
    let soft = |degrees| RayParams { sun: degrees, sun_samples: 16, ..RayParams::default() };
    let hard = shares(&world, points());
    assert_eq!(shares_of(&world, points(), soft(f32::MIN_POSITIVE)), hard);
    assert!(shares_of(&world, points(), soft(6.0)) != hard, "a disc of visible size is seen");
    world.lights = vec![lights[1]];
    assert_eq!(shares_of(&world, points(), soft(6.0)), shares(&world, points()), "a lamp has no disc");
}

#[test]
fn what_is_not_known_of_several_lights_is_refused() {
    let world = floor(&[lamp(Vec3::Z, Vec3::ONE)]);
    let shot = Shot::of(&world, EYE, points());
    let refused = |program: RayProgram, fidelity, params| {
        let job = shot.job(program, fidelity, params);
        let error = crate::cpu::check::scene("cpu", &job, true).expect_err("refused").to_string();
        assert!(error.contains("several lights, or a point or spot light"), "{error}");
    };
    let plain = RayParams::default();
    refused(DeferredShadows, Thesis, plain);
    refused(DeferredShadows, Corrected, RayParams { sun: 1.0, filter: 1, ..plain });
    refused(Final, Corrected, RayParams { shadow: GlassShadow::Caustic, ..plain });
    refused(Whitted, Corrected, plain);
    let job = shot.job(DeferredShadows, Corrected, plain);
    assert!(crate::cpu::check::scene("cpu", &job, true).is_ok());
    // A single directional light is still prepared as `to_light`.
    let sun = World { sun: Some(Sun { direction: Vec3::NEG_Z, color: SUN_COLOR }), ..floor(&[]) };
    let shot = Shot::of(&sun, EYE, points());
    let job = shot.job(DeferredShadows, Corrected, plain);
    assert_eq!(Preparation::of(&job).expect("prepared").to_light, Vec3::Z);
}
