use super::world::{Shot, World, mean};
use curitiba_pipeline::programs::RayParams;
use curitiba_pipeline::raster_effects::{
    EffectParams, EffectProgram::CubeReflection, EffectProgram::CubeRefraction, Parallax,
};
use glam::Vec3;

/// A small slanted pane in the middle of a large room whose walls have tiles in seven colours.
fn room(pane: bool) -> World {
    let mut world = World::lit_along(Vec3::new(0.3, -1.0, 0.5));
    let (far, tiles) = (60.0, 5);
    let paints: Vec<u32> = (0..7)
        .map(|index| world.paint(Vec3::new((index & 1) as f32, (index >> 1 & 1) as f32, (index >> 2 & 1) as f32)))
        .collect();
    for (index, axis) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            let (u, v) = (Vec3::new(axis.z, axis.x, axis.y), Vec3::new(axis.y, axis.z, axis.x));
            for tile in 0..tiles * tiles {
                let place = |i: usize| far * ((2 * i + 1) as f32 / tiles as f32 - 1.0);
                let center = axis * far * sign + u * place(tile % tiles) + v * place(tile / tiles);
                let half = far / tiles as f32;
                let paint = paints[(tile * 5 + tile / tiles * 2 + index * 3 + side) % paints.len()];
                world.quad(paint, center, u * -half * sign, v * half);
            }
        }
    }
    let glass = world.pane();
    if pane {
        world.quad(glass, Vec3::ZERO, Vec3::new(0.5, 0.1, 0.0), Vec3::new(-0.1, 0.4, 0.3));
    }
    world
}

fn glass_pixels(shot: &Shot) -> Vec<usize> {
    let geometry = &shot.scene.geometry;
    let is_glass = |id: u32| (id as usize) < geometry.triangles.len() && shot.glass[geometry.material_of(id) as usize];
    (0..shot.buffer.triangle.len()).filter(|index| is_glass(shot.buffer.triangle[*index])).collect()
}

/// Mean difference over the glass pixels, and the share of them that differs by more than 1/100.
fn difference(shot: &Shot, found: &[[f32; 4]], expected: &[[f32; 4]]) -> (f64, f64) {
    let worst = |index: &usize| {
        let (a, b) = (found[*index], expected[*index]);
        (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f32::max)
    };
    let pixels = glass_pixels(shot);
    assert!(pixels.len() > 1000);
    (mean(pixels.iter().map(worst)), mean(pixels.iter().map(|index| f32::from(u8::from(worst(index) > 0.01)))))
}

#[test]
fn a_pane_mirrors_and_refracts_a_far_room_as_rays_do() {
    for eye in [Vec3::new(0.2, 0.3, 1.5), Vec3::new(-1.2, 0.1, 0.4), Vec3::new(0.3, -0.2, -1.4)] {
        let mut shot = room(true).seen(eye, Vec3::ZERO, 128);
        for program in [CubeReflection, CubeRefraction] {
            let params = EffectParams { index: 1.5, map_size: 512, ..EffectParams::default() };
            let (found, stats) = shot.effect(program, params);
            assert_eq!((stats.map_count, stats.triangles, stats.bytes), (1, 6 * 300, 6 * 512 * 512 * 16));
            let expected = shot.rays(program, RayParams { index: 1.5, ..RayParams::default() });
            let (mean, differing) = difference(&shot, &found, &expected);
            println!("{eye} {program:?}: mean {mean}, differing {differing}");
            // The remaining difference is at edges of the room, a texel wide.
            assert!(mean < 0.03 && differing < 0.08, "{eye} {program:?}: {mean} {differing}");
            // Control: the pane's picture upside down is far off.
            let mirrored: Vec<[f32; 4]> = expected.iter().rev().copied().collect();
            assert!(difference(&shot, &found, &mirrored).0 > 0.2);
            let glass = glass_pixels(&shot);
            for (index, pixel) in found.iter().enumerate() {
                if glass.contains(&index) {
                    assert_eq!(pixel[3], 1.0);
                } else {
                    assert_eq!(*pixel, shot.buffer.color[index]);
                }
            }
        }
    }
}

/// A box-shaped room with tiles in seven colours, and a pane in it that is neither small nor in the middle.
fn chamber(low: Vec3, high: Vec3) -> World {
    let mut world = World::lit_along(Vec3::new(0.3, -1.0, 0.5));
    let paints: Vec<u32> = (1..8)
        .map(|index| world.paint(Vec3::new((index & 1) as f32, (index >> 1 & 1) as f32, (index >> 2 & 1) as f32)))
        .collect();
    let (middle, half, tiles) = ((low + high) * 0.5, (high - low) * 0.5, 5);
    for (index, axis) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            let (u, v) = (Vec3::new(axis.z, axis.x, axis.y) * half, Vec3::new(axis.y, axis.z, axis.x) * half);
            for tile in 0..tiles * tiles {
                let place = |i: usize| (2 * i + 1) as f32 / tiles as f32 - 1.0;
                let center = middle + axis * half * sign + u * place(tile % tiles) + v * place(tile / tiles);
                let paint = paints[(tile * 5 + tile / tiles * 2 + index * 3 + side) % paints.len()];
                world.quad(paint, center, u * -sign / tiles as f32, v / tiles as f32);
            }
        }
    }
    let glass = world.pane();
    world.quad(glass, Vec3::new(0.4, -0.2, 0.3), Vec3::new(1.1, 0.2, -0.3), Vec3::new(-0.1, 0.8, 0.2));
    world
}

#[test]
fn in_a_room_that_is_a_box_parallax_is_exact() {
    let (low, high) = (Vec3::new(-3.0, -1.5, -4.0), Vec3::new(7.0, 2.0, 3.0));
    for eye in [Vec3::new(0.5, 0.3, 2.4), Vec3::new(-1.6, 0.9, 1.7)] {
        let mut shot = chamber(low, high).seen(eye, Vec3::new(0.4, -0.2, 0.3), 160);
        for program in [CubeReflection, CubeRefraction] {
            let expected = shot.rays(program, RayParams { index: 1.5, ..RayParams::default() });
            let mut error = |parallax: Parallax| {
                let params = EffectParams { index: 1.5, map_size: 1024, parallax, ..EffectParams::default() };
                let (found, stats) = shot.effect(program, params);
                assert_eq!(stats.map_count, 1);
                difference(&shot, &found, &expected)
            };
            let ((mean, differing), (plain, others)) = (error(Parallax::Box), error(Parallax::None));
            println!("{eye} {program:?}: box {mean:.4} {differing:.3}, none {plain:.4} {others:.3}");
            // The remaining difference is at the edges of tiles, a texel wide, and at single pixels whose rays hit such
            // edges.
            assert!(mean < 0.01 && differing < 0.04, "{eye} {program:?}: {mean} {differing}");
            // Control: without the parallax correction by the box, most of the picture is displaced.
            assert!(plain > 8.0 * mean && others > 0.2, "{eye} {program:?}: {plain} {others}");
        }
    }
}

#[test]
fn total_reflection_leaves_the_mirrored_colour_alone() {
    let mut shot = room(true).seen(Vec3::new(1.4, 0.15, 0.3), Vec3::ZERO, 128);
    let params = EffectParams { index: 0.4, map_size: 128, ..EffectParams::default() };
    let (mirrored, _) = shot.effect(CubeReflection, params);
    let (found, _) = shot.effect(CubeRefraction, params);
    assert!(glass_pixels(&shot).iter().all(|index| found[*index] == mirrored[*index]), "all beyond 23.6 degrees");
    // Control: below the critical angle the pictures differ.
    let mut shot = room(true).seen(Vec3::new(0.05, -0.9, 1.2), Vec3::ZERO, 128);
    let (mirrored, _) = shot.effect(CubeReflection, params);
    let (found, _) = shot.effect(CubeRefraction, params);
    assert_ne!(mirrored, found);
}

#[test]
fn no_map_is_drawn_where_no_glass_is_seen() {
    for program in [CubeReflection, CubeRefraction] {
        let params = EffectParams { map_size: 512, ..EffectParams::default() };
        for (world, target) in [(room(false), Vec3::ZERO), (room(true), Vec3::new(0.0, 0.0, 9.0))] {
            let mut shot = world.seen(Vec3::new(0.0, 0.0, 3.0), target, 64);
            let (found, stats) = shot.effect(program, params);
            assert_eq!(found, shot.buffer.color);
            assert_eq!((stats.maps, stats.map_count, stats.triangles, stats.bytes), (None, 0, 0, 0));
        }
    }
}

#[test]
fn each_pane_has_its_own_probe_and_one_probe_serves_all() {
    // Two panes, one on each side of a wall that is red on the left and green on the right.
    let mut world = World::lit_along(Vec3::NEG_Y);
    let (red, green) = (world.paint(Vec3::X), world.paint(Vec3::Y));
    let glass = world.pane();
    world.quad(red, Vec3::new(-0.01, 0.0, 0.0), Vec3::Z * 5.0, Vec3::Y * 5.0);
    world.quad(green, Vec3::new(0.01, 0.0, 0.0), Vec3::Y * 5.0, Vec3::Z * 5.0);
    for side in [-1.0, 1.0] {
        // At 45 degrees, so that the pane mirrors camera rays into the wall.
        world.quad(glass, Vec3::new(2.0 * side, 0.0, 0.0), Vec3::new(0.5, 0.0, 0.5 * side), Vec3::Y);
    }
    let mut shot = world.seen(Vec3::new(0.0, 0.0, 12.0), Vec3::ZERO, 256);
    let mut shown = |probes: u32| {
        let params = EffectParams { probes, map_size: 64, ..EffectParams::default() };
        let (found, stats) = shot.effect(CubeReflection, params);
        assert_eq!(stats.map_count, probes.min(2));
        let colors = |left: bool| {
            let pixels = glass_pixels(&shot).into_iter().filter(|index| (shot.position(*index).x < 0.0) == left);
            pixels.map(|index| found[index]).collect::<Vec<_>>()
        };
        (colors(true), colors(false))
    };
    let (left, right) = shown(4);
    assert!(left.iter().all(|pixel| pixel[0] > 0.2 && pixel[1] == 0.0), "{:?}", left[0]);
    assert!(right.iter().all(|pixel| pixel[1] > 0.2 && pixel[0] == 0.0), "{:?}", right[0]);
    let (left, right) = shown(1);
    let black = |pixels: &[[f32; 4]]| pixels.iter().all(|pixel| pixel[0] + pixel[1] == 0.0);
    assert!(black(&left) != black(&right), "one probe stands for both panes, and the other looks away from the wall");
}
