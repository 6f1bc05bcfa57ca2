use crate::world::{Shot, World, mean};
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

/// Mean of an effect minus that of rays, over the pixels where this holds, and the root of the mean square difference.
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

/// A floor and a wall that meet in a right angle.
fn corner() -> Shot {
    let mut world = World::default();
    world.ground(20.0);
    let white = world.paint(Vec3::ONE);
    world.quad(white, Vec3::new(0.0, 10.0, 0.0), Vec3::X * 20.0, Vec3::Y * 10.0);
    world.seen(Vec3::new(0.5, 3.0, 4.0), Vec3::new(0.0, 0.3, 0.4), 160)
}

/// The open share at distance `d` of an endless wall of a right angle, for rays of length 1, in closed form.
///
/// A direction of azimuth φ and polar angle θ meets the wall within reach where `sin θ cos φ >= d`. Cosine-weighted directions
/// are uniform in the unit disk of `(x, y) = sin θ (cos φ, sin φ)`: what is shut is the disk's segment `x >= d`.
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
    // The report's figure 12: a post 2 in front of the camera, a wall 18 behind it. On the wall its outline is at x = 1.
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
    // A share of the disk, as beside a wall: 0.05 to 0.5 from the outline it is 0.68 on average.
    assert!((of(&depths, &beside) - 0.68).abs() < 0.06, "{}", of(&depths, &beside));
    assert_eq!(of(&depths, &far), 1.0);
    // Rays find nothing within reach either.
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
