//! Light that exact spheres focus, in pictures.

use super::spheres::run;
use super::*;
use crate::effects::dielectric::ball::{Ball, Turned};
use crate::effects::tests::world::SUN_COLOR;
use glam::{DVec2, DVec3, Mat3};

const CAUSTIC: GlassShadow = GlassShadow::Caustic;

/// A sphere of glass above a white floor at z = 0, under light that falls straight down.
fn scene(index: f32, sigma: Vec3, height: f32) -> World {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.dielectric(solid(index, sigma));
    world.sphere(glass, Vec3::Z * height, 1.0);
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    world
}

/// The share of the light at each place, seen from a point near it, and the ray counts.
fn light_at(world: &World, seen: impl IntoIterator<Item = (Vec3, Vec3)>, params: RayParams) -> (Vec<Vec3>, RayCounts) {
    let mut found = Vec::new();
    let mut counts = RayCounts::default();
    for (place, normal) in seen {
        let shot = Shot::of(world, place + 0.05 * normal, [place]);
        let (pixels, rays) = run(world, &shot, RayProgram::Final, params);
        counts += rays;
        found.push((Vec3::from_slice(&pixels[0]) / Vec3::from_slice(&shot.color[0]) - 0.5) * 2.0);
    }
    (found, counts)
}

fn floor(world: &World, places: impl IntoIterator<Item = Vec3>, shadow: GlassShadow) -> Vec<Vec3> {
    light_at(world, places.into_iter().map(|place| (place, Vec3::Z)), RayParams { shadow, ..auto(5) }).0
}

/// The light of bundles on a floor that the light meets perpendicularly, as a share of the floor's colour.
fn expected(index: f64, sigma: Vec3, at: DVec2) -> Vec3 {
    let mut sum = DVec3::ZERO;
    let kept = |ray: &Turned| {
        let (r, inner) = interface(ray.cos.acos().to_degrees(), index);
        (1.0 - r).powi(2) * DVec3::from(sigma.as_dvec3().to_array().map(|sigma| (-2.0 * sigma * inner).exp()))
    };
    Ball::new(index).bundles(at, 1e-3, kept, |bundle| {
        let taken = |cosine: f64| SUN_COLOR.as_dvec3() * cosine + 0.3;
        sum += bundle.strength * taken(bundle.ray.direction.y.max(0.0)) / taken(1.0);
    });
    sum.as_vec3()
}

#[test]
fn the_floor_below_a_sphere_gets_its_focused_light_and_no_other() {
    let sigma = Vec3::new(0.0, 0.2, 0.7);
    let world = scene(1.5, sigma, 2.0);
    let places = [0.0_f32, 0.05, 0.1, 0.2, 0.4, 0.7, 0.95, 1.3, 3.0].map(|radius| Vec3::new(0.6, 0.8, 0.0) * radius);
    for (place, found) in places.iter().zip(floor(&world, places, CAUSTIC)) {
        let direct = if place.length() < 1.0 { 0.0 } else { 1.0 };
        let expected = direct + expected(1.5, sigma, DVec2::new(f64::from(place.length()), 2.0));
        assert!((found - expected).abs().max_element() < 3e-4 * expected.max_element(), "{place}: {found} {expected}");
    }
    // On the axis it is (1 - R)² / (1 - H / f)², times what the diameter lets pass; the straight shadow is far darker.
    let faces = 0.96_f32.powi(2) * 9.0;
    let [on_axis] = floor(&world, [Vec3::ZERO], CAUSTIC)[..] else { panic!("one place") };
    assert!((on_axis - faces * (-2.0 * sigma).exp()).abs().max_element() < 2e-3, "{on_axis}");
    let [straight] = floor(&world, [Vec3::ZERO], GlassShadow::Straight)[..] else { panic!("one place") };
    assert!((straight - 0.9216 * (-2.0 * sigma).exp()).abs().max_element() < 1e-4, "control: {straight}");
}

#[test]
fn light_is_counted_once_and_none_is_lost() {
    // The floor is far from the focus, so that no ring of the quadrature misses a peak, and its light is hardly slanted.
    let world = scene(1.05, Vec3::ZERO, 1.5);
    let rings = 600;
    let outer = 2.5_f32;
    let place = |ring: u32| Vec3::X * outer * ((ring as f32 + 0.5) / rings as f32).sqrt();
    let shares = floor(&world, (0..rings).map(place), CAUSTIC);
    // The shares summed over the disc of radius `outer`, in units of the light that meets the sphere.
    let sum: f32 = shares.iter().map(|share| share.x).sum::<f32>() / rings as f32 * outer * outer;
    let steps = 20_000;
    let passed = (0..steps).map(|step| {
        let (r, _) = interface(((f64::from(step) + 0.5) / f64::from(steps)).sqrt().asin().to_degrees(), 1.05);
        (1.0 - r).powi(2)
    });
    let through = passed.sum::<f64>() / f64::from(steps);
    let lit = f64::from(outer * outer) - 1.0 + through;
    // Slanted light has a smaller cosine, but the ambient part of its share is as large: the sum is off by 3 in 1000.
    assert!((f64::from(sum) - lit).abs() < 0.03, "{sum} {lit}");
    let straight: f32 =
        floor(&world, (0..rings).map(place), GlassShadow::Straight).iter().map(|share| share.x).sum::<f32>();
    assert!(
        (f64::from(straight / rings as f32 * outer * outer) - lit).abs() < 0.03,
        "the straight shadow has the same"
    );
}

#[test]
fn spheres_of_index_one_are_not_there() {
    let place = |with_sphere: bool| {
        let mut world = World::lit_along(Vec3::new(0.3, -1.0, 0.4));
        let glass = world.dielectric(solid(1.0, Vec3::ZERO));
        if with_sphere {
            world.sphere(glass, Vec3::ZERO, 1.3);
            world.sphere(glass, Vec3::new(0.0, 3.0, 0.0), 1.0);
            world.sphere(glass, Vec3::new(0.5, 0.7, 7.0), 0.5);
        }
        room(&mut world);
        world
    };
    let (with, without) = (place(true), place(false));
    let targets = || (0..400).map(|i| Vec3::new((i % 20) as f32 * 0.2 - 2.0, (i / 20) as f32 * 0.2 - 2.0, 0.1));
    let params = RayParams { shadow: CAUSTIC, ..auto(5) };
    let render = |world: &World| {
        let shot = Shot::of(world, Vec3::new(0.5, 0.7, 7.0), targets());
        run(world, &shot, RayProgram::Final, params).0
    };
    for (index, (found, expected)) in render(&with).iter().zip(render(&without)).enumerate() {
        assert_close(*found, Vec3::from_slice(&expected), 1e-6, index);
    }
}

#[test]
fn what_is_in_the_way_of_the_bent_light_takes_it_and_nothing_else_does() {
    // At this place light arrives from the other side of the axis.
    let place = Vec3::new(0.3, 0.0, 0.0);
    let [free] = floor(&scene(1.5, Vec3::ZERO, 2.0), [place], CAUSTIC)[..] else { panic!("one place") };
    assert!(free.x > 1.5);
    let with = |center: Vec3, half: f32| {
        let mut world = scene(1.5, Vec3::ZERO, 2.0);
        let paint = world.paint(Vec3::splat(0.5));
        world.quad(paint, center, Vec3::X * half, Vec3::Y * half);
        floor(&world, [place], CAUSTIC)[0]
    };
    // Opaque squares above the sphere, inside it and below it: each time one in the path of the refracted rays, and one beside that path.
    for (center, blocks) in [
        (Vec3::new(-0.57, 0.0, 4.0), true),
        (Vec3::new(0.3, 0.0, 4.0), false),
        (Vec3::new(-0.48, 0.0, 2.0), true),
        (Vec3::new(0.3, 0.0, 2.0), false),
        (Vec3::new(0.1, 0.0, 0.5), true),
        (Vec3::new(0.45, 0.0, 0.5), false),
    ] {
        let found = with(center, 0.1);
        let expected = if blocks { Vec3::ZERO } else { free };
        assert!((found - expected).abs().max_element() < 1e-6, "{center}: {found} {expected}");
    }
}

#[test]
fn glass_on_the_way_takes_its_share_and_other_spheres_all() {
    let free = floor(&scene(1.5, Vec3::ZERO, 2.0), [Vec3::ZERO], CAUSTIC)[0];
    let mut world = scene(1.5, Vec3::ZERO, 2.0);
    let red = Vec3::new(0.9, 0.3, 0.1);
    let pane = world.dielectric(Dielectric { filter: red, ..thin(1.0) });
    world.quad(pane, Vec3::Z * 0.5, Vec3::X * 3.0, Vec3::Y * 3.0);
    world.quad(pane, Vec3::Z * 5.0, Vec3::X * 3.0, Vec3::Y * 3.0);
    let found = floor(&world, [Vec3::ZERO], CAUSTIC)[0];
    assert!((found - free * red * red).abs().max_element() < 1e-5, "{found}");
    // Light that two spheres bend is not followed.
    let mut world = scene(1.5, Vec3::ZERO, 2.0);
    world.sphere(0, Vec3::Z * 6.0, 1.0);
    assert_eq!(floor(&world, [Vec3::ZERO], CAUSTIC), [Vec3::ZERO]);
    // Spheres that overlap, or lie in each other, do not focus: light goes straight through them.
    for center in [Vec3::new(0.0, 0.0, 2.2), Vec3::new(1.5, 0.0, 2.0)] {
        let mut world = scene(1.5, Vec3::ZERO, 2.0);
        world.sphere(0, center, 0.7);
        let places = [Vec3::ZERO, Vec3::X * 0.5, Vec3::X * 3.0];
        assert_eq!(floor(&world, places, CAUSTIC), floor(&world, places, GlassShadow::Straight), "{center}");
    }
}

#[test]
fn a_scene_that_is_turned_scaled_and_moved_has_the_same_light() {
    let sigma = Vec3::new(0.0, 0.2, 0.7);
    let world = scene(1.5, sigma, 2.0);
    let places = [Vec3::ZERO, Vec3::new(0.1, 0.05, 0.0), Vec3::new(-0.3, 0.2, 0.0), Vec3::new(0.0, 1.4, 0.0)];
    let plain = floor(&world, places, CAUSTIC);
    for (scale, offset) in [(1.0_f32, Vec3::ZERO), (0.01, Vec3::new(0.3, -0.2, 0.1)), (40.0, Vec3::splat(100.0))] {
        let turn = Mat3::from_rotation_y(0.7) * Mat3::from_rotation_x(-1.1);
        let mut moved = scene(1.5, sigma / scale, 2.0);
        moved.transform(turn, scale, offset);
        for sphere in &mut moved.scene.geometry.spheres {
            (sphere.center, sphere.radius) = (turn * sphere.center * scale + offset, sphere.radius * scale);
        }
        for (place, expected) in places.iter().zip(&plain) {
            let (at, normal) = (turn * *place * scale + offset, turn * Vec3::Z);
            let shot = Shot::of(&moved, at + 0.05 * scale * normal, [at]);
            let (pixels, _) = run(&moved, &shot, RayProgram::Final, RayParams { shadow: CAUSTIC, ..auto(5) });
            let found = (Vec3::from_slice(&pixels[0]) / Vec3::from_slice(&shot.color[0]) - 0.5) * 2.0;
            assert!(
                (found - *expected).abs().max_element() < 2e-3 * expected.max_element(),
                "{scale} {place}: {found} {expected}"
            );
        }
    }
}

#[test]
fn a_wider_sun_blurs_the_focus() {
    let world = scene(1.5, Vec3::ZERO, 1.5);
    let at = |sun: f32, radius: f32| {
        let params = RayParams { shadow: CAUSTIC, sun, sun_samples: 4, ..auto(5) };
        light_at(&world, [(Vec3::X * radius, Vec3::Z)], params).0[0].x
    };
    let peaks = [0.0, 0.53, 2.0].map(|sun| at(sun, 0.0));
    assert!(peaks[0] > 2.0 * peaks[1] && peaks[1] > 2.0 * peaks[2] && peaks[2] > 1.0, "{peaks:?}");
    assert!(peaks.iter().all(|peak| peak.is_finite()));
    // Beside the focus, a blurred focus is brighter.
    assert!(at(2.0, 0.03) > at(0.0, 0.03), "{} {}", at(2.0, 0.03), at(0.0, 0.03));
}

#[test]
fn focused_light_is_seen_through_glass_and_on_walls_that_the_sun_passes_by() {
    let mut world = scene(1.5, Vec3::ZERO, 2.0);
    let clear = world.dielectric(solid(1.0, Vec3::ZERO));
    let paint = world.paint(Vec3::ONE);
    // A wall parallel to the light, beside the axis.
    world.quad(paint, Vec3::new(0.5, 0.0, 0.0), Vec3::Y * 9.0, Vec3::NEG_Z * 0.6);
    let plain = floor(&world, [Vec3::X * 0.1], CAUSTIC)[0];
    world.sphere(clear, Vec3::new(0.1, 0.0, 0.08), 0.01);
    let eye = Vec3::new(0.1, 0.0, 0.2);
    let shot = Shot::of(&world, eye, [Vec3::X * 0.1]);
    let (pixels, rays) = run(&world, &shot, RayProgram::Final, RayParams { shadow: CAUSTIC, ..auto(5) });
    let found = (Vec3::from_slice(&pixels[0]) / world.lit(1, 1.0) - 0.5) * 2.0;
    assert!((found - plain).abs().max_element() < 2e-3 && rays.refracted == 2, "{found} {plain} {rays:?}");
    let wall = [(Vec3::new(0.5, 0.0, 0.2), Vec3::NEG_X)];
    let [on_wall] = light_at(&world, wall, RayParams { shadow: CAUSTIC, ..auto(5) }).0[..] else { panic!("one") };
    let [straight] = light_at(&world, wall, RayParams { shadow: GlassShadow::Straight, ..auto(5) }).0[..] else {
        panic!("one")
    };
    assert!(on_wall.x > 0.2 && straight == Vec3::ZERO, "{on_wall} {straight}");
}

#[test]
fn who_has_no_sphere_that_focuses_traces_what_straight_light_does() {
    let mut world = World::lit_along(Vec3::new(0.2, 0.1, -1.0));
    let glass = world.dielectric(solid(1.5, Vec3::ZERO));
    let ground = world.paint(Vec3::ONE);
    block(&mut world, glass, Vec3::Z * 2.0, Vec3::ONE, true);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    let targets = (0..100).map(|i| Vec3::new((i % 10) as f32 * 0.5 - 2.0, (i / 10) as f32 * 0.5 - 2.0, 0.0));
    let shot = Shot::of(&world, Vec3::new(1.0, 1.0, 9.0), targets);
    let render = |shadow| run(&world, &shot, RayProgram::Final, RayParams { shadow, ..auto(5) });
    assert_eq!(render(CAUSTIC), render(GlassShadow::Straight));
}
