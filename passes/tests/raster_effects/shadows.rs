use crate::world::{World, from_above, mean};
use curitiba_passes::raster::effects::bounds::Bounds;
use curitiba_passes::raster::effects::shadow::ShadowFit;
use curitiba_pipeline::backend::View;
use curitiba_pipeline::programs::RayParams;
use curitiba_pipeline::raster_effects::{EffectParams, EffectProgram::ShadowMap};
use glam::{Mat4, Vec3};

fn params(map_size: u32, pcf: u32) -> EffectParams {
    EffectParams { map_size, pcf, ..EffectParams::default() }
}

/// The largest part of the picture's pixels that differ from the ray traced ones by more than a rounding.
fn differing(found: &[[f32; 4]], expected: &[[f32; 4]]) -> f64 {
    mean(found.iter().zip(expected).map(|(a, b)| f32::from(u8::from((a[0] - b[0]).abs() > 1e-6))))
}

#[test]
fn the_edge_of_a_half_planes_shadow_is_within_a_texel_of_its_place() {
    for (direction, name) in [(Vec3::NEG_Y, "straight down"), (Vec3::new(0.6, -1.0, 0.2), "at a slant")] {
        let mut world = World::lit_along(direction);
        world.ground(10.0);
        let black = world.paint(Vec3::ZERO);
        // Covers x < 0 at height 2; the camera looks from below it.
        world.quad(black, Vec3::new(-10.0, 2.0, 0.0), Vec3::Z * 30.0, Vec3::X * 10.0);
        let edge = 2.0 * direction.x / -direction.y;
        let bounds = Bounds::of_scene(&world.scene.geometry);
        let sun = world.sun.expect("lit");
        let eye = Vec3::new(3.0, 1.9, 0.0);
        let mut shot = world.seen(eye, Vec3::new(edge, 0.0, 0.0), 256);
        for pcf in [0, 2] {
            let params = params(1024, pcf);
            let texel = ShadowFit::new(&sun, &bounds, &shot.view, &params).expect("a map").texel;
            let slant = direction.truncate().length().max(-direction.y) / -direction.normalize().y;
            let (found, stats) = shot.effect(ShadowMap, params);
            assert_eq!((stats.map_count, stats.triangles, stats.bytes), (1, 4, 4 << 20));
            // The bias lets the light in by so much at the edge; the filter reaches pcf + 1 texels.
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
            for pcf in [0, 1, 4] {
                let (found, _) = shot.effect(ShadowMap, params(256, pcf));
                assert!(found.iter().all(|pixel| *pixel == [1.0; 4]), "{elevation} {azimuth} {pcf}");
            }
            if elevation < 60.0 {
                let (found, _) = shot.effect(ShadowMap, EffectParams { bias: 0.0, ..params(256, 1) });
                let acne = mean(found.iter().map(|pixel| f32::from(u8::from(pixel[0] < 1.0))));
                assert!(acne > 0.3, "without bias: {acne}");
            }
        }
    }
}

#[test]
fn light_does_not_leak_through_a_thin_wall() {
    let mut world = World::lit_along(Vec3::new(1.0, -1.0, 0.0));
    world.ground(10.0);
    let white = world.paint(Vec3::ONE);
    // Without thickness, 2 high, on the ground at x = -1: its shadow is -1 < x < 1.
    world.quad(white, Vec3::new(-1.0, 1.0, 0.0), Vec3::Y, Vec3::Z * 5.0);
    let mut shot = world.seen(Vec3::new(6.0, 5.0, 0.0), Vec3::ZERO, 256);
    let (found, _) = shot.effect(ShadowMap, params(1024, 1));
    let expected = shot.rays(ShadowMap, RayParams::default());
    // 16 texels of at most 3 cm: the bias at 45 degrees is 3 texels.
    for index in shot.pixels_where(|p| p.y < 0.01 && p.x > -0.8 && p.x < 0.9 && p.z.abs() < 4.5) {
        assert_eq!((found[index][0], expected[index][0]), (0.5, 0.5), "{}", shot.position(index));
    }
    // The wall's own dark side is turned from the light: it asks no map, as no ray starts there.
    for index in shot.pixels_where(|p| p.y > 0.1) {
        assert_eq!((found[index], expected[index]), ([1.0; 4], [1.0; 4]));
    }
    // The control: a bias of many texels does leak.
    let (leaking, _) = shot.effect(ShadowMap, EffectParams { bias: 30.0, ..params(1024, 1) });
    assert!(differing(&leaking, &expected) > 2.0 * differing(&found, &expected));
}

#[test]
fn holes_of_cut_out_materials_let_light_through_and_glass_does_not() {
    let mut world = World::lit_along(Vec3::NEG_Y);
    world.ground(10.0);
    let (half, glass) = (world.half_cut_out(), world.pane());
    world.quad(half, Vec3::new(-3.0, 2.0, 0.0), Vec3::X, Vec3::NEG_Z);
    world.quad(glass, Vec3::new(3.0, 2.0, 0.0), Vec3::X, Vec3::NEG_Z);
    let mut shot = world.seen(Vec3::new(0.0, 1.5, 8.0), Vec3::ZERO, 256);
    let (found, _) = shot.effect(ShadowMap, params(1024, 0));
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
    let mut world = World::lit_along(Vec3::new(0.6, -0.5, 0.3));
    world.ground(10.0);
    let white = world.paint(Vec3::ONE);
    world.block(white, Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.5));
    let mut shot = world.seen(Vec3::new(5.0, 6.0, 5.0), Vec3::ZERO, 256);
    let expected = shot.rays(ShadowMap, RayParams::default());
    let share =
        |size: u32, shot: &mut crate::world::Shot| differing(&shot.effect(ShadowMap, params(size, 0)).0, &expected);
    let (coarse, fine) = (share(256, &mut shot), share(4096, &mut shot));
    assert!(fine < 0.002 && fine < 0.2 * coarse, "{coarse} {fine}");
}

#[test]
fn a_camera_that_moves_by_less_than_a_texel_does_not_make_edges_shimmer() {
    // Far reaching, so that the camera's sphere and not the scene's is fitted.
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
        View { clip_from_world: view.clip_from_world * Mat4::from_translation(-moved), eye: view.eye + moved }
    };
    let bounds = Bounds::of_scene(&town().scene.geometry);
    let sun = town().sun.expect("lit");
    let params = params(256, 0);
    let texel = |shift: f32| ShadowFit::new(&sun, &bounds, &view(shift), &params).expect("a map").texel;
    let size = texel(0.0);
    assert!(size < 0.1 * bounds.radius() * 2.0 / 256.0, "the scene's sphere was not fitted");
    // World positions that do not move with the camera: every pixel of both pictures is asked for the same points.
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
