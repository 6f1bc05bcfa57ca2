use super::world::{Shot, World, from_above, mean};
use curitiba_passes::raster::effects::bounds::Bounds;
use curitiba_passes::raster::effects::cascades::{Cascades, lit_depths};
use curitiba_passes::raster::effects::shadow::ShadowFit;
use curitiba_pipeline::backend::{Answers, View};
use curitiba_pipeline::programs::RayParams;
use curitiba_pipeline::raster_effects::{Border, EffectParams, EffectProgram::ShadowMap};
use glam::{Mat4, Vec3};

/// The numbers of maps for which every test runs.
const COUNTS: [u32; 2] = [1, 4];

fn params(map_size: u32, pcf: u32, cascades: u32) -> EffectParams {
    EffectParams { map_size, pcf, cascades, ..EffectParams::default() }
}

/// The cascaded maps of a picture.
fn cascades(shot: &Shot, params: EffectParams) -> Cascades {
    let job = shot.job(ShadowMap, params);
    let depths = lit_depths(&job).expect("something is lit");
    let bounds = Bounds::of_scene(&shot.scene.geometry);
    Cascades::new(&shot.sun.expect("lit"), &bounds, &shot.view, depths, &params)
}

/// A box of height 2 whose half width is `x` and half depth `z`, seen from `eye`, and its ray-traced shadows.
fn box_on_the_ground([x, z]: [f32; 2], eye: Vec3) -> (Shot, Vec<[f32; 4]>) {
    let mut world = World::lit_along(Vec3::new(0.6, -0.5, 0.3));
    world.ground(10.0);
    let white = world.paint(Vec3::ONE);
    world.block(white, Vec3::Y, Vec3::new(x, 1.0, z));
    let shot = world.seen(eye, Vec3::ZERO, 256);
    let expected = shot.rays(ShadowMap, RayParams::default());
    (shot, expected)
}

/// The share of pixels that differ from the ray-traced ones by more than rounding.
fn differing(found: &[[f32; 4]], expected: &[[f32; 4]]) -> f64 {
    mean(found.iter().zip(expected).map(|(a, b)| f32::from(u8::from((a[0] - b[0]).abs() > 1e-6))))
}

#[test]
fn the_edge_of_a_half_planes_shadow_is_within_a_texel_of_its_place() {
    for (direction, name) in [(Vec3::NEG_Y, "straight down"), (Vec3::new(0.6, -1.0, 0.2), "at a slant")] {
        let mut world = World::lit_along(direction);
        world.ground(10.0);
        let black = world.paint(Vec3::ZERO);
        // A roof over x < 0 at height 2; the camera looks from below it.
        world.quad(black, Vec3::new(-10.0, 2.0, 0.0), Vec3::Z * 30.0, Vec3::X * 10.0);
        let edge = 2.0 * direction.x / -direction.y;
        let eye = Vec3::new(3.0, 1.9, 0.0);
        let mut shot = world.seen(eye, Vec3::new(edge, 0.0, 0.0), 256);
        for (pcf, count) in [0, 2].into_iter().flat_map(|pcf| COUNTS.map(|count| (pcf, count))) {
            let params = params(1024, pcf, count);
            let fits = cascades(&shot, params).fits;
            assert_eq!(fits.len(), count as usize);
            let texel = fits.iter().map(|fit| fit.texel).fold(0.0, f32::max);
            let slant = direction.truncate().length().max(-direction.y) / -direction.normalize().y;
            let (found, stats) = shot.effect(ShadowMap, params);
            let maps = u64::from(count);
            assert_eq!((stats.map_count, stats.triangles, stats.bytes), (count, 4 * maps, maps * (4 << 20)));
            // Pixels this close to the edge are left out: the bias lets light in, and the filter reaches pcf + 1 texels.
            let reach = (pcf + 1) as f32 * texel * slant * (1.0 + 1.5 * 0.7);
            let (mut dark, mut bright) = (0, 0);
            for index in shot.pixels_where(|p| p.y < 0.1 && (p.x - edge).abs() > reach) {
                let expected = if shot.position(index).x < edge { 0.5 } else { 1.0 };
                assert_eq!(found[index], [expected, expected, expected, 1.0], "{name}, {}", shot.position(index));
                *(if expected < 1.0 { &mut dark } else { &mut bright }) += 1;
            }
            assert!(dark > 1000 && bright > 1000 && reach < 0.25, "{name}: {dark} {bright} {reach}");
        }
    }
}

#[test]
fn a_plane_does_not_shadow_itself_however_grazing_the_sun_and_would_without_bias() {
    for elevation in [3f32, 8.0, 30.0, 60.0, 90.0] {
        for azimuth in [0f32, 17.0, 45.0, 100.0] {
            let (sin, cos) = elevation.to_radians().sin_cos();
            let (z, x) = azimuth.to_radians().sin_cos();
            let mut world = World::lit_along(Vec3::new(x * cos, -sin, z * cos));
            world.ground(20.0);
            let mut shot = world.seen(Vec3::new(0.0, 6.0, 9.0), Vec3::ZERO, 128);
            for count in COUNTS {
                for pcf in [0, 1, 4] {
                    let (found, _) = shot.effect(ShadowMap, params(256, pcf, count));
                    assert!(found.iter().all(|pixel| *pixel == [1.0; 4]), "{elevation} {azimuth} {pcf} {count}");
                }
                if elevation < 60.0 {
                    let (found, _) = shot.effect(ShadowMap, EffectParams { bias: 0.0, ..params(256, 1, count) });
                    let acne = mean(found.iter().map(|pixel| f32::from(u8::from(pixel[0] < 1.0))));
                    assert!(acne > 0.3, "without bias: {acne}");
                }
            }
        }
    }
}

#[test]
fn light_does_not_leak_through_a_thin_wall() {
    let mut world = World::lit_along(Vec3::new(1.0, -1.0, 0.0));
    world.ground(10.0);
    let white = world.paint(Vec3::ONE);
    // A wall without thickness, 2 high, on the ground at x = -1: its shadow is -1 < x < 1.
    world.quad(white, Vec3::new(-1.0, 1.0, 0.0), Vec3::Y, Vec3::Z * 5.0);
    let mut shot = world.seen(Vec3::new(6.0, 5.0, 0.0), Vec3::ZERO, 256);
    let expected = shot.rays(ShadowMap, RayParams::default());
    for count in COUNTS {
        let (found, _) = shot.effect(ShadowMap, params(1024, 1, count));
        // 16 texels of at most 3 cm: the bias at 45 degrees is 3 texels.
        for index in shot.pixels_where(|p| p.y < 0.01 && p.x > -0.8 && p.x < 0.9 && p.z.abs() < 4.5) {
            assert_eq!((found[index][0], expected[index][0]), (0.5, 0.5), "{}", shot.position(index));
        }
        // The wall's dark side faces away from the light. No map is read there, just as no shadow ray starts there.
        for index in shot.pixels_where(|p| p.y > 0.1) {
            assert_eq!((found[index], expected[index]), ([1.0; 4], [1.0; 4]));
        }
        // Control: a bias of many texels does leak light.
        let (leaking, _) = shot.effect(ShadowMap, EffectParams { bias: 30.0, ..params(1024, 1, count) });
        assert!(differing(&leaking, &expected) > 2.0 * differing(&found, &expected));
    }
}

/// Number of pixels that are left to rays, and number of others whose value differs from the ray-traced one.
fn bordered(shot: &mut Shot, params: EffectParams, expected: &[[f32; 4]]) -> [usize; 2] {
    let (mean, _) = shot.effect(ShadowMap, params);
    let (found, _) = shot.effect(ShadowMap, EffectParams { border: Border::Rays, ..params });
    let (mut left, mut wrong) = (0, 0);
    for ((found, mean), expected) in found.iter().zip(&mean).zip(expected) {
        if found[3] == Answers::LEFT {
            left += 1;
            continue;
        }
        assert!((found[0] == 0.5 || found[0] == 1.0) && found[3] == 1.0, "{found:?}");
        // The sum of the filter weights behind `mean` is rounded.
        assert!((found[0] - mean[0]).abs() < 1e-6, "{found:?}, {mean:?}");
        wrong += usize::from(found[0] != expected[0]);
    }
    [left, wrong]
}

#[test]
fn pixels_whose_tests_differ_are_left_to_rays_and_the_others_are_as_rays_say() {
    let (mut shot, expected) = box_on_the_ground([1.0, 0.5], Vec3::new(5.0, 6.0, 5.0));
    for count in COUNTS {
        let mut before = 0;
        for pcf in [0, 1, 2] {
            let [left, wrong] = bordered(&mut shot, params(1024, pcf, count), &expected);
            assert!(left > before + 50 && left < expected.len() / 8, "{count}, {pcf}: {left}, {before}");
            assert_eq!(wrong, 0, "{count}, {pcf}");
            before = left;
        }
        // Control: too large a bias removes parts of the shadow from the map that are not left to rays either.
        let [_, wrong] = bordered(&mut shot, EffectParams { bias: 30.0, ..params(1024, 1, count) }, &expected);
        assert!(wrong > 20, "{count}: {wrong}");
    }
}

#[test]
fn what_is_thinner_than_a_texel_can_be_missed_by_maps_and_by_their_borders() {
    let (mut shot, expected) = box_on_the_ground([0.02; 2], Vec3::splat(3.0));
    let [coarse, fine] = [32, 4096].map(|size| bordered(&mut shot, params(size, 1, 4), &expected)[1]);
    assert!(coarse > 20 && fine == 0, "{coarse} {fine}");
}

#[test]
fn holes_of_cut_out_materials_let_light_through_and_glass_does_not() {
    let mut world = World::lit_along(Vec3::NEG_Y);
    world.ground(10.0);
    let (half, glass) = (world.half_cut_out(), world.pane());
    world.quad(half, Vec3::new(-3.0, 2.0, 0.0), Vec3::X, Vec3::NEG_Z);
    world.quad(glass, Vec3::new(3.0, 2.0, 0.0), Vec3::X, Vec3::NEG_Z);
    let mut shot = world.seen(Vec3::new(0.0, 1.5, 8.0), Vec3::ZERO, 256);
    let (found, _) = shot.effect(ShadowMap, params(1024, 0, 4));
    let expected = shot.rays(ShadowMap, RayParams::default());
    let check = |x: [f32; 2], value: f32| {
        for index in shot.pixels_where(|p| p.y < 0.01 && p.x > x[0] && p.x < x[1] && p.z.abs() < 0.9) {
            assert_eq!((found[index][0], expected[index][0]), (value, value), "{}", shot.position(index));
        }
    };
    check([-3.9, -3.1], 1.0);
    check([-2.9, -2.1], 0.5);
    check([2.1, 3.9], 0.5);
}

#[test]
fn a_box_on_the_ground_is_shadowed_as_rays_say_but_for_edges() {
    let (mut shot, expected) = box_on_the_ground([1.0, 0.5], Vec3::new(5.0, 6.0, 5.0));
    let share = |size: u32, count: u32, shot: &mut Shot| {
        differing(&shot.effect(ShadowMap, params(size, 0, count)).0, &expected)
    };
    for count in COUNTS {
        let (coarse, fine) = (share(256, count, &mut shot), share(4096, count, &mut shot));
        assert!(fine < 0.002 && fine < 0.25 * coarse, "{count}: {coarse} {fine}");
    }
}

/// A street of blocks, seen along its length, so that each map shows some of their shadows.
fn street() -> World {
    let mut world = World::lit_along(Vec3::new(0.6, -0.5, 0.3));
    world.ground(200.0);
    let white = world.paint(Vec3::ONE);
    for i in 0..60u8 {
        let x = if i % 2 == 0 { -2.0 } else { 1.5 };
        world.block(white, Vec3::new(x, 0.4, -2.0 * f32::from(i)), Vec3::new(0.3, 0.4, 0.5));
    }
    world
}

#[test]
fn each_further_map_brings_shadows_nearer_to_the_rays() {
    let mut shot = street().seen(Vec3::new(0.0, 1.5, 4.0), Vec3::new(0.0, 0.5, 0.0), 256);
    let expected = shot.rays(ShadowMap, RayParams::default());
    let found = [1, 2, 4, 8].map(|count| {
        let (found, stats) = shot.effect(ShadowMap, params(256, 1, count));
        assert_eq!(stats.map_count, count);
        mean(found.iter().zip(&expected).map(|(a, b)| (a[0] - b[0]).powi(2))).sqrt()
    });
    println!("{found:?}");
    assert!(found.windows(2).all(|pair| pair[1] < pair[0]) && found[2] < 0.5 * found[0], "{found:?}");
}

#[test]
fn a_camera_that_flies_along_a_street_does_not_make_the_edges_of_any_map_shimmer() {
    let eye = Vec3::new(0.1, 1.5, 4.3);
    let shot_at = |shift: f32| {
        let by = Vec3::new(0.3, 0.1, -1.0) * shift;
        street().seen(eye + by, eye + by - Vec3::new(0.0, 1.0, 4.0), 192)
    };
    let params = params(256, 0, 4);
    let still = shot_at(0.0);
    let points = still.buffer.position.clone();
    let texels = |shot: &Shot| cascades(shot, params).fits.iter().map(|fit| fit.texel).collect::<Vec<_>>();
    let first = texels(&still);
    assert_eq!(first.len(), 4);
    // World positions that stay the same when the camera moves.
    let lookup = |mut shot: Shot, params| {
        shot.buffer.position.clone_from(&points);
        shot.effect(ShadowMap, params).0
    };
    let unmoved = lookup(still, params);
    let changed = |other: &[[f32; 4]]| {
        mean(unmoved.iter().zip(other).map(|(a, b)| f32::from(u8::from((a[0] - b[0]).abs() > 2e-3))))
    };
    let mut kept = 0;
    for step in 1..12 {
        let mut shot = shot_at(step as f32 * 0.37 * first[0]);
        shot.buffer.position.clone_from(&points);
        if texels(&shot) == first {
            kept += 1;
            // Only positions at the borders of maps change, where the next map now serves them.
            let share = changed(&lookup(shot, params));
            assert!(share < 0.002, "{step}: {share}");
        }
    }
    assert!(kept > 5, "{kept}");
    // Control: texels of another size.
    let share = changed(&lookup(shot_at(0.0), EffectParams { map_size: 251, ..params }));
    assert!(share > 0.005, "{share}");
}

#[test]
fn a_camera_that_moves_by_less_than_a_texel_does_not_make_edges_shimmer() {
    // A large scene, so that the map is fitted to the camera's sphere and not to the scene's.
    let town = || {
        let mut world = World::lit_along(Vec3::new(0.4, -1.0, 0.25));
        world.ground(200.0);
        let white = world.paint(Vec3::ONE);
        world.block(white, Vec3::new(0.0, 1.5, 0.0), Vec3::new(1.0, 0.5, 1.0));
        world
    };
    let view = |shift: f32| {
        let view = from_above(4.0);
        let moved = Vec3::new(shift, 0.0, 0.3 * shift);
        View::new(view.clip_from_world * Mat4::from_translation(-moved), view.eye + moved)
    };
    let bounds = Bounds::of_scene(&town().scene.geometry);
    let sun = town().sun.expect("lit");
    let params = params(256, 0, 4);
    let texel = |shift: f32| ShadowFit::new(&sun, &bounds, &view(shift), &params).expect("a map").texel;
    let size = texel(0.0);
    assert!(size < 0.1 * bounds.radius() * 2.0 / 256.0, "the scene's sphere was not fitted");
    // World positions that stay the same when the camera moves: every pixel of both pictures looks up the same point.
    let points: Vec<[f32; 4]> = {
        let shot = town().through(view(0.0), 128, 128);
        shot.buffer.position
    };
    let lookup = |shift: f32| {
        let mut shot = town().through(view(shift), 128, 128);
        shot.buffer.position.clone_from(&points);
        shot.effect(ShadowMap, params).0
    };
    let still = lookup(0.0);
    assert!(still.iter().any(|pixel| pixel[0] < 1.0));
    for step in 1..6 {
        let shift = step as f32 * 0.19 * size;
        assert_eq!(texel(shift), size);
        let moved = lookup(shift);
        let changed = still.iter().zip(&moved).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
        assert!(changed < 2e-3, "{step}: {changed}");
    }
}
