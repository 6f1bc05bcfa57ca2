use super::world::{Shot, World, mean};
use curitiba_pipeline::programs::RayParams;
use curitiba_pipeline::raster_effects::{
    EffectParams, EffectProgram, EffectProgram::DepthOcclusion, EffectProgram::HorizonOcclusion,
};
use glam::Vec3;

const RADIUS: f32 = 1.0;

fn params(slices: u32, steps: u32) -> EffectParams {
    EffectParams { radius: RADIUS, intensity: 1.0, slices, steps, ..EffectParams::default() }
}

fn rays() -> RayParams {
    RayParams { samples: 1024, radius: RADIUS, intensity: 1.0, ..RayParams::default() }
}

/// Mean difference of an effect from rays, over the pixels for which `at` holds, and the root mean square difference.
fn error(shot: &mut Shot, program: EffectProgram, params: EffectParams, at: impl Fn(Vec3) -> bool) -> (f64, f64) {
    let (found, _) = shot.effect(program, params);
    let expected = shot.rays(program, rays());
    let pixels = shot.pixels_where(at);
    let bias = mean(pixels.iter().map(|index| found[*index][0] - expected[*index][0]));
    let square = mean(pixels.iter().map(|index| (found[*index][0] - expected[*index][0]).powi(2)));
    (bias, square.sqrt())
}

#[test]
fn an_open_plane_is_open_from_every_direction_and_distance() {
    for program in [DepthOcclusion, HorizonOcclusion] {
        for eye in [Vec3::new(0.0, 5.0, 0.1), Vec3::new(3.0, 2.0, 4.0), Vec3::new(8.0, 0.3, 1.0), Vec3::Y * 200.0] {
            for offset in [Vec3::ZERO, Vec3::new(1000.0, 0.0, -3000.0)] {
                let mut world = World::default();
                world.ground(30.0);
                world.scene.geometry.positions.iter_mut().for_each(|p| *p += offset);
                let mut shot = world.seen(eye + offset, offset, 96);
                let (found, stats) = shot.effect(program, params(3, 6));
                assert_eq!((stats.maps, stats.map_count), (None, 0));
                let lowest = found.iter().map(|pixel| pixel[0]).fold(1.0, f32::min);
                assert!(lowest > 0.999, "{program:?} {eye} {offset}: {lowest}");
                assert!(found.iter().all(|pixel| pixel[3] == 1.0 && pixel[0] == pixel[1] && pixel[0] == pixel[2]));
            }
        }
    }
}

/// A floor and a wall that meet at a right angle.
fn corner() -> Shot {
    let mut world = World::default();
    world.ground(20.0);
    let white = world.paint(Vec3::ONE);
    world.quad(white, Vec3::new(0.0, 10.0, 0.0), Vec3::X * 20.0, Vec3::Y * 10.0);
    world.seen(Vec3::new(0.5, 3.0, 4.0), Vec3::new(0.0, 0.3, 0.4), 160)
}

/// Closed form of the open share at distance `d` from an endless perpendicular wall, for rays of length 1.
///
/// A direction of azimuth φ and polar angle θ hits the wall within reach where `sin θ cos φ >= d`. Cosine-weighted
/// directions are uniform in the unit disk of `(x, y) = sin θ (cos φ, sin φ)`, so the occluded part is the disk's
/// segment `x >= d`.
fn open_beside_a_wall(d: f32) -> f32 {
    let d = d.min(1.0);
    1.0 - (d.acos() - d * (1.0 - d * d).sqrt()) / std::f32::consts::PI
}

#[test]
fn horizons_in_a_corner_have_the_closed_form() {
    let mut shot = corner();
    let (found, _) = shot.effect(HorizonOcclusion, params(8, 32));
    let traced = shot.rays(HorizonOcclusion, rays());
    let (mut worst, mut bias) = (0f32, Vec::new());
    for bin in 1..12 {
        let near = bin as f32 * 0.1;
        let pixels = shot.pixels_where(|p| p.y < 1e-3 && p.z > near && p.z < near + 0.1 && p.x.abs() < 1.0);
        let of = |image: &[[f32; 4]]| mean(pixels.iter().map(|index| image[*index][0])) as f32;
        let expected = mean(pixels.iter().map(|index| open_beside_a_wall(shot.position(*index).z))) as f32;
        assert!((of(&traced) - expected).abs() < 4e-3, "rays: {} {expected}", of(&traced));
        println!("{near:.1}: {:.4}, closed form {expected:.4}", of(&found));
        worst = worst.max((of(&found) - expected).abs());
        bias.push(of(&found) - expected);
    }
    assert!(worst < 0.02, "{worst} {bias:?}");
}

#[test]
fn horizons_agree_with_rays_among_boxes() {
    let mut world = World::default();
    world.ground(20.0);
    let white = world.paint(Vec3::ONE);
    world.block(white, Vec3::new(-0.6, 0.5, 0.0), Vec3::new(0.4, 0.5, 0.6));
    world.block(white, Vec3::new(0.8, 0.2, 0.3), Vec3::new(0.5, 0.2, 0.4));
    let mut shot = world.seen(Vec3::new(0.8, 3.0, 3.5), Vec3::new(0.0, 0.2, 0.0), 128);
    let near = |p: Vec3| p.x.abs() < 2.5 && p.z.abs() < 2.0;
    let (bias, rms) = error(&mut shot, HorizonOcclusion, params(8, 16), near);
    let (plain_bias, plain_rms) = error(&mut shot, DepthOcclusion, params(8, 16), near);
    println!("horizons {bias:.4} {rms:.4}, depths {plain_bias:.4} {plain_rms:.4}");
    assert!(bias.abs() < 0.03 && rms < 0.06, "{bias} {rms}");
    assert!(plain_rms > 1.3 * rms, "the plain method is worse: {plain_rms}");
}

/// Parameters of `gtao` by bitmasks.
fn sectors(slices: u32, steps: u32, thickness: f32) -> EffectParams {
    EffectParams { bitmask: true, thickness, ..params(slices, steps) }
}

#[test]
fn sectors_leave_an_open_plane_open_and_find_the_closed_form_in_a_corner() {
    for eye in [Vec3::new(0.0, 5.0, 0.1), Vec3::new(3.0, 2.0, 4.0), Vec3::new(8.0, 0.3, 1.0)] {
        let mut world = World::default();
        world.ground(30.0);
        let mut shot = world.seen(eye, Vec3::ZERO, 96);
        let (found, _) = shot.effect(HorizonOcclusion, sectors(3, 6, 0.1));
        let lowest = found.iter().map(|pixel| pixel[0]).fold(1.0, f32::min);
        assert!(lowest > 0.999, "{eye}: {lowest}");
    }
    let mut shot = corner();
    // With this thickness the wall counts as the front of a solid that is as deep as the radius.
    let (found, _) = shot.effect(HorizonOcclusion, sectors(8, 32, 1.0));
    // Control: a thin wall lets light through between the steps.
    let (thin, _) = shot.effect(HorizonOcclusion, sectors(8, 4, 0.01));
    let (mut worst, mut least_off) = (0f32, f32::MAX);
    for bin in 1..8 {
        let near = bin as f32 * 0.1;
        let pixels = shot.pixels_where(|p| p.y < 1e-3 && p.z > near && p.z < near + 0.1 && p.x.abs() < 1.0);
        let of = |image: &[[f32; 4]]| mean(pixels.iter().map(|index| image[*index][0])) as f32;
        let expected = mean(pixels.iter().map(|index| open_beside_a_wall(shot.position(*index).z))) as f32;
        println!("{near:.1}: {:.4}, thin {:.4}, closed form {expected:.4}", of(&found), of(&thin));
        worst = worst.max((of(&found) - expected).abs());
        least_off = least_off.min((of(&thin) - expected) / (1.0 - expected));
    }
    assert!(worst < 0.02, "{worst}");
    assert!(least_off > 0.3, "{least_off}");
}

/// The open share of a plane below an endless bar, by cosine-weighted directions in `f64`. The bar's cross-section
/// spans these `x` and heights; rays of length 1 start at the origin.
fn open_below_a_bar(x: [f64; 2], heights: [f64; 2]) -> f64 {
    let cells = 400;
    let (mut open, mut all) = (0u32, 0u32);
    for index in 0..cells * cells {
        let at = |cell: i32| (2.0 * f64::from(cell) + 1.0) / f64::from(cells) - 1.0;
        let (across, along) = (at(index % cells), at(index / cells));
        let up = 1.0 - across * across - along * along;
        if up <= 0.0 {
            continue;
        }
        // The interval of the ray in each slab.
        let stretch = |[low, high]: [f64; 2], rate: f64| {
            let (a, b) = (low / rate, high / rate);
            [a.min(b), a.max(b)]
        };
        let (in_x, in_height) = (stretch(x, across), stretch(heights, up.sqrt()));
        let (first, last) = (in_x[0].max(in_height[0]).max(0.0), in_x[1].min(in_height[1]).min(1.0));
        all += 1;
        open += u32::from(first >= last);
    }
    f64::from(open) / f64::from(all)
}

#[test]
fn light_passes_behind_a_bar_by_sectors_and_not_by_horizons() {
    // A bar of 0.1 x 0.04 floats 0.4 above a floor, seen from above.
    let mut world = World::default();
    world.ground(20.0);
    let white = world.paint(Vec3::ONE);
    let (half_width, middle, half_height) = (0.05, 0.4, 0.02);
    world.block(white, Vec3::Y * middle, Vec3::new(half_width, half_height, 10.0));
    let mut shot = world.seen(Vec3::new(0.0, 9.0, 0.0), Vec3::ZERO, 400);
    let (horizons, _) = shot.effect(HorizonOcclusion, params(8, 32));
    // The distance between steps is less than the bar's thickness; otherwise light would pass between them.
    let (found, _) = shot.effect(HorizonOcclusion, sectors(8, 64, 2.0 * half_height));
    let (deep, _) = shot.effect(HorizonOcclusion, sectors(8, 32, 1.0));
    let traced = shot.rays(HorizonOcclusion, rays());
    for x in [0.15f32, 0.3, 0.5] {
        let pixels = shot.pixels_where(|p| p.y < 1e-3 && (p.x - x).abs() < 0.03 && p.z.abs() < 3.0);
        let of = |image: &[[f32; 4]]| mean(pixels.iter().map(|index| image[*index][0]));
        let exact = |index: &usize| {
            let place = f64::from(shot.position(*index).x);
            let (half_width, middle, half_height) = (f64::from(half_width), f64::from(middle), f64::from(half_height));
            open_below_a_bar([-half_width - place, half_width - place], [middle - half_height, middle + half_height])
        };
        // All rows are alike.
        let row: Vec<f64> = pixels.iter().take(8).map(exact).collect();
        let expected = row.iter().sum::<f64>() / row.len() as f64;
        let [rays, horizons, found, deep] = [&traced, &horizons, &found, &deep].map(|image| of(image));
        println!(
            "{x}: exact {expected:.4}, rays {rays:.4}, horizons {horizons:.4}, sectors {found:.4}, deep {deep:.4}"
        );
        assert!((rays - expected).abs() < 6e-3, "{rays} {expected}");
        assert!((found - expected).abs() < 0.03, "{x}: {found} {expected}");
        // Control: a horizon occludes everything below the bar, and so does a deep bar.
        let off = (found - expected).abs();
        assert!(expected - horizons > 5.0 * off && expected - deep > 5.0 * off, "{x}: {horizons} {deep} {expected}");
    }
}

#[test]
fn more_slices_leave_less_noise() {
    let mut shot = corner();
    let near = |p: Vec3| p.y < 1e-3 && p.z > 0.1 && p.z < 0.8 && p.x.abs() < 1.0;
    let (_, few) = error(&mut shot, HorizonOcclusion, params(1, 16), near);
    let (_, many) = error(&mut shot, HorizonOcclusion, params(16, 16), near);
    assert!(many < 0.5 * few, "{few} {many}");
}

#[test]
fn a_near_object_darkens_what_is_far_behind_it_by_depths_and_not_by_horizons() {
    // Figure 12 of the report: a post 2 in front of the camera, and a wall 18 behind the post. On the wall, the post's
    // outline is at x = 1.
    let mut world = World::default();
    let white = world.paint(Vec3::ONE);
    world.quad(white, Vec3::new(0.0, 0.0, -20.0), Vec3::X * 20.0, Vec3::Y * 20.0);
    world.quad(white, Vec3::new(0.0, 0.0, -2.0), Vec3::X * 0.1, Vec3::Y * 5.0);
    let mut shot = world.seen(Vec3::ZERO, Vec3::NEG_Z, 256);
    let beside = shot.pixels_where(|p| p.z < -10.0 && p.x.abs() > 1.05 && p.x.abs() < 1.5);
    let far = shot.pixels_where(|p| p.z < -10.0 && p.x.abs() > 2.2);
    let (depths, _) = shot.effect(DepthOcclusion, params(8, 8));
    let (horizons, _) = shot.effect(HorizonOcclusion, params(8, 8));
    let of = |image: &[[f32; 4]], pixels: &[usize]| mean(pixels.iter().map(|index| image[*index][0]));
    println!("beside the post: depths {:.3}, horizons {:.3}", of(&depths, &beside), of(&horizons, &beside));
    // The open share of the disk is the same as beside a wall: on average 0.68 between 0.05 and 0.5 from the outline.
    assert!((of(&depths, &beside) - 0.68).abs() < 0.06, "{}", of(&depths, &beside));
    assert_eq!(of(&depths, &far), 1.0);
    // Rays find no occluder within reach either.
    let traced = shot.rays(HorizonOcclusion, RayParams { samples: 64, ..rays() });
    assert!(of(&horizons, &beside) > 1.0 - 1e-6);
    assert_eq!(of(&traced, &beside), 1.0);
}

#[test]
fn intensity_is_an_exponent_and_the_seed_only_changes_the_noise() {
    let mut shot = corner();
    for program in [DepthOcclusion, HorizonOcclusion] {
        let (plain, _) = shot.effect(program, params(4, 8));
        let (squared, _) = shot.effect(program, EffectParams { intensity: 2.0, ..params(4, 8) });
        assert!(plain.iter().zip(&squared).all(|(a, b)| (a[0] * a[0] - b[0]).abs() < 1e-6));
        let (off, _) = shot.effect(program, EffectParams { intensity: 0.0, ..params(4, 8) });
        assert!(off.iter().all(|pixel| *pixel == [1.0; 4]));
    }
}
