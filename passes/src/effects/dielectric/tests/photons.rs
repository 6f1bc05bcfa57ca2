//! Light that bodies of glass meshes send to surfaces, by photons.

use super::spheres::run as run_with_spheres;
use super::*;
use crate::cpu;
use crate::effects::dielectric::PhotonMap;
use crate::effects::dielectric::ball::{Ball, Turned};
use crate::effects::{Coverage, Opaque};
use curitiba_pipeline::backend::PhotonCounts;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Greatest number of times that a ball's triangles are divided: 32,768 triangles, with sides of a fortieth of its radius.
const LEVELS: u32 = 6;

fn caustic(photons: u32) -> RayParams {
    RayParams { shadow: GlassShadow::Caustic, photons, ..auto(5) }
}

/// A ball of triangles above a white floor at z = 0, under light that falls straight down.
fn scene(glass: Dielectric, height: f32, levels: u32) -> World {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.dielectric(glass);
    ball(&mut world, glass, Vec3::Z * height, 1.0, levels);
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    world
}

/// Gives every triangle its own normal.
fn flatten(world: &mut World) {
    let geometry = &mut world.scene.geometry;
    for [a, b, c] in &geometry.triangles {
        let [x, y, z] = [a, b, c].map(|corner| geometry.positions[*corner as usize]);
        let normal = (y - x).cross(z - x).normalize();
        [a, b, c].into_iter().for_each(|corner| geometry.normals[*corner as usize] = normal);
    }
}

/// The photons that a pass over a world shoots.
fn shoot(world: &World, params: RayParams, seed: u32) -> PhotonMap {
    shoot_with(world, params, seed, Opaque)
}

fn shoot_with(world: &World, params: RayParams, seed: u32, coverage: impl Coverage) -> PhotonMap {
    let shot = Shot::of(world, Vec3::Z * 9.0, []);
    let job = RayJob { seed, ..shot.job(RayProgram::Final, Corrected, params) };
    let tree = world.tree();
    cpu::new_pass(&job, &tree, coverage, None).expect("a complete job").focused.photons
}

/// A ray that leaves a sphere of radius 1, in a plane with the sphere's axis: x is across the axis, and the light came along -y.
struct Flat {
    at: DVec2,
    along: DVec2,
    share: f64,
}

/// The rays that leave the sphere where one ray meets it at the distance `b` from the axis: the mirrored one, and one after each pass inside.
/// Computed by mirroring and refracting vectors.
fn leaving(b: f64, index: f64, ways: u32) -> Vec<Flat> {
    let normal = DVec2::new(b, (1.0 - b * b).sqrt());
    let (r, inner) = interface(b.asin().to_degrees(), index);
    let down = DVec2::NEG_Y;
    let mirrored = down - 2.0 * down.dot(normal) * normal;
    let mut list = vec![Flat { at: normal, along: mirrored, share: r }];
    let refract = |along: DVec2, normal: DVec2, ratio: f64| {
        let cos = -along.dot(normal);
        let square = 1.0 - (1.0 - cos * cos) / (ratio * ratio);
        (along + cos * normal) / ratio - normal * square.sqrt()
    };
    let (mut at, mut along, mut share) = (normal, refract(down, normal, index), 1.0 - r);
    for _ in 0..ways {
        at += 2.0 * inner * along;
        list.push(Flat { at, along: refract(along, -at, 1.0 / index), share: share * (1.0 - r) });
        (along, share) = (along - 2.0 * along.dot(at) * at, share * r);
    }
    list
}

/// The mean irradiance in each ring of a floor `height` below the centre: of all light, and of the light alone that passes the sphere once.
fn rings(index: f64, height: f64, borders: &[f64]) -> Vec<[f64; 2]> {
    const STEPS: u32 = 200_000;
    let mut sums = vec![[0.0; 2]; borders.len() - 1];
    for step in 0..STEPS {
        let b = ((f64::from(step) + 0.5) / f64::from(STEPS)).sqrt();
        for (order, Flat { at, along, share }) in leaving(b, index, 6).iter().enumerate() {
            if along.y >= 0.0 {
                continue;
            }
            let radius = (at.x + along.x * (at.y + height) / -along.y).abs();
            if let Some(ring) = borders.windows(2).position(|ring| (ring[0]..ring[1]).contains(&radius)) {
                sums[ring][0] += share / f64::from(STEPS);
                sums[ring][1] += if order == 1 { share / f64::from(STEPS) } else { 0.0 };
            }
        }
    }
    let area = |ring: &[f64]| ring[1] * ring[1] - ring[0] * ring[0];
    sums.iter().zip(borders.windows(2)).map(|(sum, ring)| sum.map(|sum| sum / area(ring))).collect()
}

/// The mean irradiance that photons bring to a ring of the floor.
fn ring_of(map: &PhotonMap, low: f64, high: f64) -> f64 {
    let (radii, angles) = (40, 24);
    let mut sum = 0.0;
    for ring in 0..radii {
        let radius = (low * low + (high * high - low * low) * (f64::from(ring) + 0.5) / f64::from(radii)).sqrt();
        for step in 0..angles {
            let (sin, cos) = (2.0 * PI * (f64::from(step) + 0.37 * f64::from(ring)) / f64::from(angles)).sin_cos();
            sum += f64::from(map.irradiance((DVec3::new(cos, sin, 0.0) * radius).as_vec3(), Vec3::Z).x);
        }
    }
    sum / f64::from(radii * angles)
}

#[test]
fn rings_below_a_ball_of_triangles_have_the_means_of_a_sphere() {
    const BORDERS: [f64; 7] = [0.0, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0];
    // The closed form of light that passes once, by an independent computation.
    let expected = rings(1.5, 2.0, &BORDERS);
    for (found, known) in expected.iter().zip([6.807, 4.058, 2.234, 1.039, 0.2768, 0.0384]) {
        assert!((found[1] - known).abs() < 3e-3 * known, "{found:?} {known}");
    }
    for is_flat in [false, true] {
        let mut world = scene(solid(1.5, Vec3::ZERO), 2.0, LEVELS);
        if is_flat {
            flatten(&mut world);
        }
        let map = shoot(&world, caustic(1 << 19), 3);
        for (ring, [expected, _]) in BORDERS.windows(2).zip(&expected) {
            let found = ring_of(&map, ring[0], ring[1]);
            // Flat triangles are a polyhedron that is a little smaller, and bends light by steps.
            let tolerance = if is_flat { 0.03 } else { 0.02 };
            assert!((found - expected).abs() < tolerance * expected, "{is_flat} {ring:?}: {found} {expected}");
            // Control: Epanechnikov's kernel without its factor of 2, and radiance's square of the index.
            assert!([0.5, 1.5 * 1.5].iter().all(|wrong| (found * wrong - expected).abs() > 0.3 * expected));
        }
    }
}

/// The power of all photons that landed, as a share of what meets the ball.
fn landed(map: &PhotonMap) -> Vec3 {
    map.power() / std::f32::consts::PI
}

#[test]
fn what_lands_is_what_passes_both_faces_and_what_faces_mirror_down() {
    // The flux that passes once has a closed form.
    let floor = [0.0, 400.0];
    for (index, once) in [(1.5, 0.83554), (1.33, 0.88230)] {
        let [all, passed] = rings(index, 2.0, &floor)[0].map(|mean| mean * floor[1] * floor[1]);
        assert!((passed - once).abs() < 2e-4, "{index}: {passed}");
        let mut world = scene(solid(index as f32, Vec3::ZERO), 2.0, LEVELS);
        world.quad(1, Vec3::ZERO, Vec3::X * 400.0, Vec3::Y * 400.0);
        let map = shoot(&world, caustic(1 << 17), 1);
        let found = landed(&map);
        assert!((f64::from(found.x) - all).abs() < 1e-2 * all, "{index}: {found} {all}");
        assert!(found.x == found.y && found.y == found.z, "clear glass has no colour");
        assert!((f64::from(found.x) * index * index - all).abs() > 0.5, "control: power is no radiance");
        let PhotonCounts { shot, landed, lost, rays } = map.counts;
        assert!(shot == 1 << 17 && landed < shot && lost == 0 && rays > 3 * shot, "{:?}", map.counts);
        // All photons have the same power, so those that land are counted.
        assert!((landed as f64 / shot as f64 - f64::from(found.x)).abs() < 1e-3);
    }
}

/// The share of the light at places of a surface that are seen from near.
fn light_at(world: &World, places: &[(Vec3, Vec3)], params: RayParams) -> Vec<Vec3> {
    let of = |(place, normal): &(Vec3, Vec3)| {
        let shot = Shot::of(world, *place + 0.05 * *normal, [*place]);
        let (pixels, _) = run_with_spheres(world, &shot, RayProgram::Final, params);
        (Vec3::from_slice(&pixels[0]) / Vec3::from_slice(&shot.color[0]) - 0.5) * 2.0
    };
    places.iter().map(of).collect()
}

#[test]
fn a_ball_of_triangles_lights_a_floor_as_the_exact_sphere_does() {
    let sigma = Vec3::new(0.0, 0.2, 0.7);
    let mesh = scene(solid(1.5, sigma), 2.0, LEVELS);
    let mut sphere = World::lit_along(Vec3::NEG_Z);
    let glass = sphere.dielectric(solid(1.5, sigma));
    sphere.sphere(glass, Vec3::Z * 2.0, 1.0);
    let ground = sphere.paint(Vec3::ONE);
    sphere.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    let places = [0.05_f32, 0.12, 0.2, 0.3, 0.45].map(|radius| (Vec3::new(0.6, 0.8, 0.0) * radius, Vec3::Z));
    let exact = light_at(&sphere, &places, caustic(0));
    let found = light_at(&mesh, &places, RayParams { photon_radius: 0.02, ..caustic(1 << 18) });
    for ((place, found), exact) in places.iter().zip(found).zip(exact) {
        assert!((found - exact).abs().max_element() < 0.05 * exact.max_element(), "{place:?}: {found} {exact}");
    }
}

#[test]
fn light_is_counted_once_under_a_block_that_bends_none() {
    // Light that falls perpendicularly on a block passes it as it passes a wall with two faces: (1 - R) / (1 + R).
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.dielectric(solid(1.5, Vec3::ZERO));
    block(&mut world, glass, Vec3::Z * 2.0, Vec3::ONE, true);
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    let place = |i: i32| (Vec3::new(0.21 * (i % 5 - 2) as f32, 0.23 * (i / 5 - 2) as f32, 0.0), Vec3::Z);
    let below: Vec<_> = (0..25).map(place).collect();
    let mean = |params| light_at(&world, &below, params).iter().map(|share| share.x).sum::<f32>() / 25.0;
    let found = mean(caustic(1 << 16));
    assert!((found - 0.923_077).abs() < 0.02, "{found}");
    // With straight light in addition, it would be nearly twice as much.
    assert!((mean(caustic(0)) - 0.9216).abs() < 1e-3);
    let beside = light_at(&world, &[(Vec3::new(3.0, 0.5, 0.0), Vec3::Z)], caustic(1 << 12));
    assert_eq!(beside, [Vec3::ONE]);
    // With few photons, and none of them near these places, their light is missing: the block throws a shadow.
    let dark = light_at(&world, &below[..3], RayParams { photon_radius: 1e-4, ..caustic(16) });
    assert!(dark.iter().all(|share| *share == Vec3::ZERO), "{dark:?}");
}

#[test]
fn the_error_falls_with_the_number_of_photons_and_over_batches() {
    let world = scene(solid(1.5, Vec3::ZERO), 2.0, 5);
    let ball = Ball::new(1.5);
    let places: Vec<(DVec2, f64)> = (0..160)
        .map(|i| {
            let radius = 0.05 + 0.6 * f64::from(i) / 160.0;
            let (sin, cos) = (2.4 * f64::from(i)).sin_cos();
            let mut exact = 0.0;
            let kept = |ray: &Turned| DVec3::splat((1.0 - interface(ray.cos.acos().to_degrees(), 1.5).0).powi(2));
            ball.bundles(DVec2::new(radius, 2.0), 1e-3, kept, |bundle| {
                exact += bundle.strength.x * bundle.ray.direction.y;
            });
            (DVec2::new(cos, sin) * radius, exact)
        })
        .collect();
    let estimates = |map: &PhotonMap| -> Vec<f64> {
        let at = |(place, _): &(DVec2, f64)| f64::from(map.irradiance(place.extend(0.0).as_vec3(), Vec3::Z).x);
        places.iter().map(at).collect()
    };
    let error = |found: &[f64]| {
        let squares = found.iter().zip(&places).map(|(found, (_, exact))| (found - exact).powi(2));
        (squares.sum::<f64>() / places.len() as f64).sqrt()
    };
    let errors = [12, 15, 18].map(|log| error(&estimates(&shoot(&world, caustic(1 << log), 5))));
    // The error falls as the third root of the number of photons: by half for eight times as many.
    assert!(errors.windows(2).all(|pair| pair[1] < 0.65 * pair[0]), "{errors:?}");
    // 16 batches of 2^12 come near the error of 2^16 at once; one of them does not.
    let mut mean = vec![0.0; places.len()];
    for photon_batch in 0..16 {
        let batch = estimates(&shoot(&world, RayParams { photon_batch, ..caustic(1 << 12) }, 5));
        mean.iter_mut().zip(batch).for_each(|(sum, found)| *sum += found / 16.0);
    }
    let (batches, at_once) = (error(&mean), error(&estimates(&shoot(&world, caustic(1 << 16), 5))));
    assert!(batches < 0.6 * errors[0] && batches < 1.6 * at_once, "{batches} {at_once} {errors:?}");
}

#[test]
fn any_number_of_threads_shoots_the_same_photons_and_another_seed_shoots_others() {
    let mut world = scene(Dielectric { alpha: 0.1, spread: 0.02, ..solid(1.5, Vec3::X) }, 2.0, 4);
    ball(&mut world, 0, Vec3::new(3.0, 0.0, 2.0), 0.5, 3);
    let targets = (0..256).map(|i| Vec3::new((i % 16) as f32 * 0.3 - 1.0, (i / 16) as f32 * 0.1 - 0.8, 0.0));
    let shot = Shot::of(&world, Vec3::new(0.4, 0.3, 0.9), targets).rows(16);
    let picture = |threads: usize, seed: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let job = RayJob { seed, ..shot.job(RayProgram::Final, Corrected, caustic(30_000)) };
        let (pixels, rays) = pool.install(|| shot.run_on(&world.tree(), &job));
        (pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect::<Vec<_>>(), rays)
    };
    let one = picture(1, 7);
    assert!(one.1.photons.shot == 30_000 && one.1.photons.landed > 20_000, "{:?}", one.1);
    assert_eq!(one, picture(3, 7));
    assert_eq!(one, picture(8, 7));
    assert_ne!(one.0, picture(3, 8).0, "control");
}

#[test]
fn what_is_opaque_before_and_behind_the_glass_stops_its_light() {
    let with = |center: Vec3, half: f32| {
        let mut world = scene(solid(1.5, Vec3::ZERO), 2.0, 4);
        world.quad(1, center, Vec3::X * half, Vec3::Y * half);
        shoot(&world, caustic(1 << 14), 0)
    };
    let at = |map: &PhotonMap, place: Vec3| map.irradiance(place, Vec3::Z).x;
    let free = with(Vec3::new(9.0, 0.0, 1.0), 0.1);
    assert!(at(&free, Vec3::ZERO) > 4.0, "{}", at(&free, Vec3::ZERO));
    let before = with(Vec3::Z * 5.0, 2.0);
    assert_eq!((before.counts.landed, before.counts.lost, at(&before, Vec3::ZERO)), (0, 0, 0.0));
    // The quad stops half of the ball's light. Some light that the ball mirrors upwards lands on the quad: about a twentieth.
    let partly = with(Vec3::new(2.0, 0.0, 5.0), 2.0);
    let share = partly.counts.landed as f64 / free.counts.landed as f64;
    assert!((0.49..0.55).contains(&share), "{share}");
    // The quad lies on the focus, which is lit instead of the floor.
    let behind = with(Vec3::Z * 0.5, 0.9);
    assert!(at(&behind, Vec3::ZERO) == 0.0 && at(&behind, Vec3::Z * 0.5) > 50.0, "{}", at(&behind, Vec3::Z * 0.5));
}

#[test]
fn photons_light_the_side_that_they_came_to_and_no_surface_beside_it() {
    let mut world = scene(solid(1.5, Vec3::ZERO), 2.0, 4);
    // A thin shelf, lit from above; and a wall beside the place.
    block(&mut world, 1, Vec3::Z * 0.4, Vec3::new(0.8, 0.8, 1e-3), true);
    let map = shoot(&world, caustic(1 << 15), 0);
    let on_top = Vec3::new(0.05, 0.0, 0.401);
    assert!(map.irradiance(on_top, Vec3::Z).x > 10.0);
    assert_eq!(map.irradiance(on_top - 0.002 * Vec3::Z, Vec3::NEG_Z), Vec3::ZERO, "its lower side");
    assert_eq!(map.irradiance(on_top, Vec3::X), Vec3::ZERO, "a wall");
    assert_eq!(map.irradiance(on_top + 0.2 * Vec3::Z, Vec3::Z), Vec3::ZERO, "above it");
}

#[test]
fn who_asks_for_no_photons_has_the_light_that_was_before() {
    let world = scene(solid(1.5, Vec3::new(0.0, 0.2, 0.7)), 2.0, 3);
    let targets = (0..400).map(|i| Vec3::new((i % 20) as f32 * 0.1 - 1.0, (i / 20) as f32 * 0.1 - 1.0, 0.0));
    let shot = Shot::of(&world, Vec3::new(0.5, 0.4, 0.9), targets).rows(20);
    let render = |params| shot.run_on(&world.tree(), &shot.job(RayProgram::Final, Corrected, params));
    let straight = render(RayParams { shadow: GlassShadow::Straight, photons: 1000, photon_radius: 0.3, ..auto(5) });
    assert_eq!(straight, render(caustic(0)), "other shadows shoot none");
    assert_eq!(straight.1.photons, PhotonCounts::default());
    assert_ne!(straight, render(caustic(1000)), "control");
    let map = shoot(&world, caustic(0), 0);
    assert!(map.is_empty() && map.irradiance(Vec3::ZERO, Vec3::Z) == Vec3::ZERO);
}

#[test]
fn no_light_is_gained() {
    let dye = Vec3::new(1.0, 0.7, 0.4);
    for (name, glass, least) in [
        ("clear", solid(1.5, Vec3::ZERO), 0.9),
        ("diamond", solid(2.42, Vec3::ZERO), 0.7),
        ("dyed", solid(1.33, dye), 0.1),
        ("filtered", Dielectric { filter: dye, ..solid(1.5, Vec3::ZERO) }, 0.2),
        ("rough", Dielectric { alpha: 0.3, ..solid(1.5, Vec3::ZERO) }, 0.6),
    ] {
        // A room that is open where the light comes from: only light that the ball sends back there does not land.
        let mut world = World::lit_along(Vec3::new(1.0, 0.0, -0.2));
        let material = world.dielectric(glass);
        ball(&mut world, material, Vec3::ZERO, 1.0, LEVELS);
        let paint = world.paint(Vec3::ONE);
        for side in [Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            let (x, y) = side.any_orthonormal_pair();
            world.quad(paint, -side * 9.0, x * 9.0, y * 9.0);
        }
        let map = shoot(&world, caustic(1 << 14), 2);
        let share = landed(&map);
        assert!(share.max_element() <= 1.0 && share.min_element() > least, "{name}: {share} {:?}", map.counts);
    }
}

#[test]
fn white_light_that_is_bent_apart_stays_white_in_all() {
    let world = scene(Dielectric { spread: 0.05, ..solid(1.5, Vec3::ZERO) }, 2.0, 4);
    let power = landed(&shoot(&world, caustic(1 << 16), 0));
    let mean = power.element_sum() / 3.0;
    assert!((power - mean).abs().max_element() < 0.01 * mean && mean > 0.8, "{power}");
    // Near the focus of blue light there is more blue; the focus of red light is farther away.
    let near = scene(Dielectric { spread: 0.05, ..solid(1.5, Vec3::ZERO) }, 1.5, 4);
    let focus = shoot(&near, RayParams { photon_radius: 0.03, ..caustic(1 << 16) }, 0).irradiance(Vec3::ZERO, Vec3::Z);
    assert!((focus.x - focus.z).abs() > 0.02 * focus.y, "{focus}");
}

#[test]
fn bodies_in_bodies_are_one_target_and_those_apart_are_several() {
    let mut world = scene(solid(1.5, Vec3::ZERO), 2.0, 4);
    let water = world.dielectric(solid(1.33, Vec3::ZERO));
    ball(&mut world, water, Vec3::Z * 2.0, 0.6, 4);
    let map = shoot(&world, caustic(1 << 15), 0);
    assert_eq!(map.targets(), 1);
    assert!(landed(&map).x > 0.8 && landed(&map).x < 1.0, "{}", landed(&map));
    ball(&mut world, water, Vec3::new(4.0, 0.0, 2.0), 1.0, 4);
    let two = shoot(&world, caustic(1 << 15), 0);
    assert_eq!(two.targets(), 2);
    assert!((landed(&two).x - 2.0 * landed(&map).x).abs() < 0.1, "{}", landed(&two));
}

#[test]
fn thin_glass_before_and_behind_lets_photons_straight_on() {
    let red = Vec3::new(0.9, 0.3, 0.1);
    let mut world = scene(solid(1.5, Vec3::ZERO), 2.0, 4);
    let free = landed(&shoot(&world, caustic(1 << 14), 0));
    let pane = world.dielectric(Dielectric { filter: red, ..thin(1.0) });
    world.quad(pane, Vec3::Z * 5.0, Vec3::X * 3.0, Vec3::Y * 3.0);
    let before = landed(&shoot(&world, caustic(1 << 14), 0));
    assert!((before - free * red).abs().max_element() < 1e-3, "{before} {free}");
    world.quad(pane, Vec3::Z * 0.5, Vec3::X * 19.0, Vec3::Y * 19.0);
    let both = landed(&shoot(&world, caustic(1 << 14), 0));
    assert!((both - free * red * red).abs().max_element() < 1e-2, "{both}");
    // Bodies of index 1 are not there, and throw no shadow.
    let nothing = scene(solid(1.0, Vec3::ZERO), 2.0, 3);
    assert!(shoot(&nothing, caustic(1 << 10), 0).is_empty());
}

/// Photons are shot at a ball of triangles, whether or not it is cut out. Light falls through its holes.
#[test]
fn light_falls_through_what_is_cut_out_of_a_body() {
    let behind = |cut_out: bool| {
        let mut world = scene(solid(1.5, Vec3::ZERO), 2.0, 3);
        if cut_out {
            world.cut_out(0, true);
        }
        // Beside the focus, where hardly any photons land.
        light_at(&world, &[(Vec3::X * 0.8, Vec3::Z)], caustic(1 << 10))[0]
    };
    assert!((behind(true) - 1.0).abs().max_element() < 1e-5, "{}", behind(true));
    assert!(behind(false).max_element() < 0.5, "control: {}", behind(false));
}

#[test]
fn a_disc_of_light_blurs_the_focus() {
    let world = scene(solid(1.5, Vec3::ZERO), 1.5, LEVELS);
    let focus = |sun: f32| {
        let params = RayParams { sun, sun_samples: 4, photon_radius: 0.01, ..caustic(1 << 17) };
        shoot(&world, params, 0).irradiance(Vec3::ZERO, Vec3::Z).x
    };
    let found = [0.0, 4.0, 10.0].map(focus);
    assert!(found[0] > 1.5 * found[1] && found[1] > 1.5 * found[2] && found[2] > 5.0, "{found:?}");
}

#[test]
fn photons_are_seen_through_glass_as_they_are_without() {
    let mut world = scene(solid(1.5, Vec3::ZERO), 2.0, 4);
    let clear = world.dielectric(solid(1.0, Vec3::ZERO));
    let place = Vec3::X * 0.1;
    let plain = light_at(&world, &[(place, Vec3::Z)], caustic(1 << 14))[0];
    block(&mut world, clear, Vec3::new(0.1, 0.0, 0.08), Vec3::splat(0.01), true);
    let shot = Shot::of(&world, Vec3::new(0.1, 0.0, 0.2), [place]);
    let (pixels, rays) = shot.run_on(&world.tree(), &shot.job(RayProgram::Final, Corrected, caustic(1 << 14)));
    let found = (Vec3::from_slice(&pixels[0]) / world.lit(1, 1.0) - 0.5) * 2.0;
    assert!((found - plain).abs().max_element() < 2e-3 && rays.refracted == 2, "{found} {plain} {rays:?}");
    assert!(plain.x > 2.0, "{plain}");
}

#[test]
fn a_pixel_alone_has_no_photons_of_its_own() {
    let world = scene(solid(1.5, Vec3::ZERO), 2.0, 2);
    let shot = Shot::of(&world, Vec3::Z * 0.5, [Vec3::ZERO]);
    let one = |params| cpu::trace_pixel(&world.tree(), &shot.job(RayProgram::Final, Corrected, params), 0, 0);
    let refused = one(caustic(100)).expect_err("it takes all photons").to_string();
    assert!(refused.contains("photons=100") && refused.contains("set photons=0"), "{refused}");
    assert!(one(caustic(0)).is_ok());
}
