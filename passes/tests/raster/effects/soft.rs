//! Soft shadows from depth maps, against closed forms and rays.

use super::world::{Shot, World, from_above, mean};
use curitiba_pipeline::programs::RayParams;
use curitiba_pipeline::raster_effects::{EffectParams, EffectProgram::ShadowMap};
use glam::Vec3;
use std::f32::consts::PI;

fn params(map_size: u32, cascades: u32, sun: f32) -> EffectParams {
    EffectParams { map_size, cascades, sun, ..EffectParams::default() }
}

fn rays(sun: f32, sun_samples: u32) -> RayParams {
    RayParams { sun, sun_samples, ..RayParams::default() }
}

fn rms(found: &[[f32; 4]], expected: &[[f32; 4]]) -> f64 {
    mean(found.iter().zip(expected).map(|(a, b)| (a[0] - b[0]).powi(2))).sqrt()
}

/// The area share of a disk on one side of a line at a distance of `t` radii from its centre.
fn beyond_chord(t: f32) -> f32 {
    let t = t.clamp(-1.0, 1.0);
    1.0 - (t.acos() - t * (1.0 - t * t).sqrt()) / PI
}

#[test]
fn the_penumbra_of_an_edge_is_as_wide_as_its_distance_says() {
    for height in [0.5_f32, 1.0, 2.0] {
        for sun in [4.0_f32, 8.0] {
            let mut world = World::lit_along(Vec3::NEG_Y);
            world.ground(4.0);
            let black = world.paint(Vec3::ZERO);
            world.quad(black, Vec3::new(-4.0, height, 0.0), Vec3::Z * 9.0, Vec3::X * 4.0);
            // Seen from below the roof's edge, so that the roof hides none of the penumbra.
            let mut shot = world.seen(Vec3::new(0.6, 0.45 * height, 0.8), Vec3::ZERO, 192);
            let radius = height * (sun * 0.5).to_radians().tan();
            let (found, _) = shot.effect(ShadowMap, params(2048, 4, sun));
            let (mut worst, mut squares, mut partly) = (0.0_f32, 0.0, 0);
            // Places where a tenth and nine tenths of the disc are visible.
            let mut ends = [f32::INFINITY, f32::NEG_INFINITY];
            for index in shot.pixels_where(|p| p.y < 1e-3 && p.x.abs() < 2.0 * radius && p.z.abs() < 0.5) {
                let (x, open) = (shot.position(index).x, 2.0 * found[index][0] - 1.0);
                let expected = beyond_chord(x / radius);
                worst = worst.max((open - expected).abs());
                squares += (open - expected).powi(2);
                partly += 1;
                ends = [
                    if open > 0.1 { ends[0].min(x) } else { ends[0] },
                    if open < 0.9 { ends[1].max(x) } else { ends[1] },
                ];
            }
            let rms = (squares / partly as f32).sqrt();
            // A chord at 0.6870 radii cuts off a tenth of the disk.
            let width = (ends[1] - ends[0]) / (2.0 * 0.6870 * radius);
            println!("height {height}, sun {sun}: {partly} pixels, rms {rms:.4}, worst {worst:.4}, width {width:.3}");
            assert!(partly > 300, "{partly}");
            assert!(rms < 0.015 && worst < 0.05 && (width - 1.0).abs() < 0.04, "{height} {sun}: {rms} {worst} {width}");
        }
    }
}

#[test]
fn a_plate_smaller_than_the_disc_has_no_umbra() {
    let (height, sun) = (2.0_f32, 10.0_f32);
    let seen = height * (sun * 0.5).to_radians().tan();
    // Half side of a square inside the disc, in radii of the disc.
    for share in [0.4_f32, 0.65] {
        let mut world = World::lit_along(Vec3::NEG_Y);
        world.ground(3.0);
        let black = world.paint(Vec3::ZERO);
        let side = share * seen;
        world.quad(black, Vec3::Y * height, Vec3::Z * side, Vec3::X * side);
        let mut shot = world.seen(Vec3::new(0.2, 0.4, 0.25), Vec3::ZERO, 192);
        let at_middle = |shot: &mut Shot, params| {
            let (found, _) = shot.effect(ShadowMap, params);
            let near = shot.pixels_where(|p| p.y < 1e-3 && p.length() < 0.02);
            2.0 * mean(near.iter().map(|index| found[*index][0])) - 1.0
        };
        // One map, because the maps of near parts would cut off so wide a penumbra.
        let soft = at_middle(&mut shot, params(2048, 1, sun));
        let expected = f64::from(1.0 - 4.0 * share * share / PI);
        println!("{share}: {soft:.4} of {expected:.4}");
        assert!((soft - expected).abs() < 0.05, "{share}: {soft} of {expected}");
        assert!(at_middle(&mut shot, params(2048, 4, 0.0)) < 1e-6, "without a disc it is dark");
    }
}

#[test]
fn a_plane_does_not_shadow_itself_at_wide_kernels() {
    // The whole disc is above the horizon in each case.
    for (elevation, suns) in [(8f32, [0.53, 2.0]), (30.0, [2.0, 20.0]), (60.0, [8.0, 40.0]), (90.0, [8.0, 90.0])] {
        for azimuth in [0f32, 17.0, 45.0] {
            let (sin, cos) = elevation.to_radians().sin_cos();
            let (z, x) = azimuth.to_radians().sin_cos();
            let mut world = World::lit_along(Vec3::new(x * cos, -sin, z * cos));
            world.ground(20.0);
            let mut shot = world.seen(Vec3::new(0.0, 6.0, 9.0), Vec3::ZERO, 96);
            for sun in suns {
                for count in [1, 4] {
                    let (found, _) = shot.effect(ShadowMap, params(256, count, sun));
                    let dark = found.iter().filter(|pixel| **pixel != [1.0; 4]).count();
                    assert_eq!(dark, 0, "{elevation} {azimuth} {sun} {count}");
                }
            }
        }
    }
}

#[test]
fn light_does_not_leak_through_a_thin_wall_at_wide_kernels() {
    let mut world = World::lit_along(Vec3::new(1.0, -1.0, 0.0));
    world.ground(10.0);
    let white = world.paint(Vec3::ONE);
    // As in the test without a disc: the shadow is -1 < x < 1, and the penumbra widens with the distance from the wall.
    world.quad(white, Vec3::new(-1.0, 1.0, 0.0), Vec3::Y, Vec3::Z * 5.0);
    let mut shot = world.seen(Vec3::new(6.0, 5.0, 0.0), Vec3::ZERO, 256);
    for sun in [0.53, 3.0] {
        let exact = shot.rays(ShadowMap, rays(sun, 64));
        for count in [1, 4] {
            let (found, _) = shot.effect(ShadowMap, params(1024, count, sun));
            let mut umbra = 0;
            for index in shot.pixels_where(|p| p.y < 0.01 && p.x > -0.8 && p.x < 0.9 && p.z.abs() < 4.5) {
                if exact[index][0] == 0.5 {
                    umbra += 1;
                    assert!(found[index][0] < 0.52, "{sun} {count}, {}: {:?}", shot.position(index), found[index]);
                }
            }
            assert!(umbra > 1000, "{umbra}");
        }
    }
}

/// Blocks of several heights on the ground.
fn town() -> World {
    let mut world = World::lit_along(Vec3::new(0.6, -0.7, 0.3));
    world.ground(10.0);
    let white = world.paint(Vec3::ONE);
    world.block(white, Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.5));
    world.block(white, Vec3::new(-2.0, 1.8, -1.5), Vec3::new(0.3, 1.8, 0.3));
    world.block(white, Vec3::new(1.5, 2.5, 2.0), Vec3::new(0.8, 0.1, 0.8));
    world
}

#[test]
fn soft_maps_are_nearer_to_soft_rays_than_hard_ones() {
    let mut shot = town().seen(Vec3::new(5.0, 6.0, 5.0), Vec3::ZERO, 192);
    for sun in [1.0, 3.0, 6.0] {
        let exact = shot.rays(ShadowMap, rays(sun, 256));
        for count in [1, 4] {
            let [soft, hard] = [sun, 0.0].map(|sun| rms(&shot.effect(ShadowMap, params(1024, count, sun)).0, &exact));
            println!("sun {sun}, {count} maps: soft {soft:.4}, hard {hard:.4}");
            assert!(soft < 0.5 * hard || sun < 2.0 && soft < hard, "{sun} {count}: {soft} {hard}");
        }
    }
}

#[test]
fn a_small_disc_gives_nearly_the_hard_shadow() {
    let mut shot = town().seen(Vec3::new(5.0, 6.0, 5.0), Vec3::ZERO, 192);
    let (hard, stats) = shot.effect(ShadowMap, params(1024, 4, 0.0));
    let (soft, soft_stats) = shot.effect(ShadowMap, params(1024, 4, 1e-4));
    assert_eq!((stats.map_count, stats.bytes), (soft_stats.map_count, soft_stats.bytes));
    // The filter differs from the one for a point of light, because it is a disk and not a square.
    let edges = mean(hard.iter().map(|pixel| f32::from(u8::from(pixel[0] > 0.5 && pixel[0] < 1.0))));
    let apart = mean(hard.iter().zip(&soft).map(|(a, b)| f32::from(u8::from((a[0] - b[0]).abs() > 1e-3))));
    println!("{edges:.4} at edges, {apart:.4} apart, rms {:.4}", rms(&soft, &hard));
    assert!(edges > 0.005 && apart < 1.3 * edges && rms(&soft, &hard) < 0.02, "{edges} {apart}");
}

#[test]
fn an_orthographic_camera_and_maps_of_few_texels_are_served() {
    for (size, sun) in [(16, 0.53), (16, 90.0), (64, 30.0)] {
        let mut shot = town().through(from_above(4.0), 64, 64);
        let (found, stats) = shot.effect(ShadowMap, params(size, 4, sun));
        assert_eq!(stats.map_count, 1);
        assert!(found.iter().all(|pixel| (0.5..=1.0).contains(&pixel[0])), "{size} {sun}");
        // With a disc that reaches below the horizon, coarse maps show no shadow at all.
        assert!(found.iter().any(|pixel| pixel[0] < 1.0) || sun == 90.0, "{size} {sun}");
    }
}
