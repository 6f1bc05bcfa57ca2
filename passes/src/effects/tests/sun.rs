//! Soft shadows by rays, against closed forms of the visible share of a disc.

use super::world::{Shot, World, assert_close, grid};
use crate::sampling::cone::ConeSampler;
use crate::sampling::hash::pixel_key;
use curitiba_pipeline::backend::{NO_TRIANGLE, RayCounts};
use curitiba_pipeline::glass::GlassShadow;
use curitiba_pipeline::glass::{Dielectric, Shape};
use curitiba_pipeline::programs::Fidelity::{Corrected, Thesis};
use curitiba_pipeline::programs::RayProgram::{DeferredShadows, Final};
use curitiba_pipeline::programs::{RayParams, RayProgram};
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// Diameter of a disc so small that all its rays go to the centre.
const POINT: f32 = f32::MIN_POSITIVE;

fn soft(sun: f32, sun_samples: u32) -> RayParams {
    RayParams { sun, sun_samples, samples: 0, ..RayParams::default() }
}

/// The open share of the disc, from a pixel of `deferredShadows`.
fn open(pixel: [f32; 4]) -> f64 {
    assert!(pixel[0] == pixel[1] && pixel[1] == pixel[2] && pixel[3] == 1.0, "{pixel:?}");
    f64::from(pixel[0]) * 2.0 - 1.0
}

/// The share of a disc's solid angle on the open side of a plane through the viewer. `above` is the angle of the disc's
/// centre over the plane, and `half` the disc's half angle, both in radians.
///
/// A great circle at angle d from the centre of a spherical cap of half angle a cuts off the area
/// 2 (arccos (sin d / sin a) - cos a arccos (tan d / tan a)): the cap's sector less a spherical triangle (Girard).
pub(super) fn open_beyond_plane(above: f64, half: f64) -> f64 {
    let distance = above.abs();
    if distance >= half {
        return if above > 0.0 { 1.0 } else { 0.0 };
    }
    let cut = 2.0 * ((distance.sin() / half.sin()).acos() - half.cos() * (distance.tan() / half.tan()).acos());
    let share = cut / (TAU * (1.0 - half.cos()));
    if above > 0.0 { 1.0 - share } else { share }
}

/// For small discs the closed form tends to the area of a circle's segment.
#[test]
fn the_cap_cut_by_a_plane_tends_to_the_circle_cut_by_a_chord() {
    let half = 1e-3;
    for step in -20..=20 {
        let t = f64::from(step) / 20.0;
        let flat = 1.0 - (t.acos() - t * (1.0 - t * t).sqrt()) / PI;
        assert!((open_beyond_plane(t * half, half) - flat).abs() < 1e-6, "{t}");
    }
    assert!((open_beyond_plane(0.0, 0.7) - 0.5).abs() < 1e-12);
    // A numerical sum over the cap agrees with the closed form.
    let (half, above) = (0.6_f64, 0.25_f64);
    let (mut seen, mut all) = (0.0, 0.0);
    for ring in 0..2000 {
        let theta = half * (f64::from(ring) + 0.5) / 2000.0;
        for side in 0..2000 {
            let phi = TAU * (f64::from(side) + 0.5) / 2000.0;
            all += theta.sin();
            let height = theta.cos() * above.sin() + theta.sin() * phi.cos() * above.cos();
            seen += if height > 0.0 { theta.sin() } else { 0.0 };
        }
    }
    assert!((open_beyond_plane(above, half) - seen / all).abs() < 1e-4);
}

#[test]
fn directions_are_unit_vectors_uniform_over_the_cone() {
    let axis = Vec3::new(0.3, -0.5, -0.8).normalize();
    for degrees in [0.0, 1e-3, 0.53, 10.0, 90.0, 180.0] {
        let cap = 1.0 - (f64::from(degrees) / 2.0).to_radians().cos();
        let sampler = ConeSampler::new(degrees, 0, 4096).expect("a beginning");
        let mut heights = Vec::new();
        let mut mean = DVec3::ZERO;
        for direction in sampler.directions(axis, pixel_key(3, 5, 1)) {
            assert!((direction.length() - 1.0).abs() < 4e-7, "{direction}");
            mean += direction.as_dvec3() / 4096.0;
            let height = 1.0 - direction.as_dvec3().dot(axis.as_dvec3());
            assert!(height <= cap + 3e-7, "{degrees}: {height} of {cap}");
            heights.push(height / cap);
        }
        // For smaller discs the rounding of the cosine hides the heights.
        if degrees >= 10.0 {
            heights.sort_by(f64::total_cmp);
            for (index, height) in heights.iter().enumerate() {
                assert!((height - (index as f64 + 0.5) / 4096.0).abs() < 0.01, "{degrees}: {height} at {index}");
            }
            assert!((mean - axis.as_dvec3() * (1.0 - cap / 2.0)).length() < 2e-3 * cap.sqrt(), "{degrees}: {mean}");
        }
    }
    // Samplers of consecutive parts of the sequence give, together, the directions of one sampler of the whole, in another order.
    let of = |first, samples| -> Vec<[u32; 3]> {
        let sampler = ConeSampler::new(5.0, first, samples).expect("a part of the sequence");
        sampler.directions(axis, 7).map(|direction| direction.to_array().map(f32::to_bits)).collect()
    };
    let (mut whole, mut parts) = (of(0, 48), [of(0, 16), of(16, 7), of(23, 25)].concat());
    whole.sort_unstable();
    parts.sort_unstable();
    assert_eq!(whole, parts);
    assert!(ConeSampler::new(5.0, u32::MAX, 2).is_err());
}

/// A floor in y = 0 and, at a height of 1, a roof over x < 0 whose other edges hide nothing of the disc.
fn half_plane(towards_light: Vec3) -> World {
    let mut world = World::lit_along(-towards_light);
    let paint = world.paint(Vec3::splat(0.5));
    // The floor is small: rays start off a triangle by the rounding error of its corners, and a small error leaves
    // shadow edges in place.
    world.quad(paint, Vec3::ZERO, Vec3::Z * 4.0, Vec3::X * 4.0);
    world.quad(paint, Vec3::new(-2.0, 1.0, 0.0), Vec3::X * 2.0, Vec3::NEG_Z * 4.0);
    world
}

#[test]
fn the_penumbra_of_an_edge_is_the_part_of_the_disc_that_a_plane_leaves() {
    const SAMPLES: u32 = 1024;
    for (light, sun) in [
        (Vec3::Y, 0.53),
        (Vec3::Y, 4.0),
        (Vec3::Y, 40.0),
        (Vec3::new(-1.0, 1.0, 0.0), 2.0),
        (Vec3::new(-0.5, 1.0, 0.7), 20.0),
    ] {
        let light = light.normalize();
        let world = half_plane(light);
        let half = (f64::from(sun) / 2.0).to_radians();
        // Where the light ray through the roof's edge meets the floor, the hard shadow ends.
        let edge = -light.x / light.y;
        let width = half.tan() as f32 / (light.y * light.y);
        let eye = Vec3::new(edge + 0.4, 0.5, 3.0);
        let targets = grid(24, Vec3::X * edge, Vec3::X * 1.6 * width, Vec3::Z * 0.3);
        let shot = Shot::of(&world, eye, targets).rows(24);
        let (pixels, rays) = shot.run_on(&world.tree(), &shot.job(DeferredShadows, Corrected, soft(sun, SAMPLES)));
        assert_eq!(rays, RayCounts { shadow: 24 * 24 * u64::from(SAMPLES), ..RayCounts::default() });
        let (mut squares, mut sum, mut worst, mut partly) = (0.0, 0.0, 0.0_f64, 0);
        for (pixel, position) in pixels.iter().zip(&shot.position) {
            // The plane through the point and the edge, with its normal towards the open side.
            let to_edge = DVec3::new(-f64::from(position[0]), 1.0, 0.0);
            let normal = DVec3::new(to_edge.y, -to_edge.x, 0.0).normalize();
            let expected = open_beyond_plane(normal.dot(light.as_dvec3()).asin(), half);
            let error = open(*pixel) - expected;
            partly += usize::from((0.01..0.99).contains(&expected));
            (squares, sum, worst) = (squares + error * error, sum + error, worst.max(error.abs()));
        }
        let count = pixels.len() as f64;
        let (rms, bias) = ((squares / count).sqrt(), sum / count);
        println!("sun {sun}: rms {rms:.5}, bias {bias:.6}, worst {worst:.5}, {partly} pixels in the penumbra");
        assert!(partly > 200, "{partly}");
        // Independent rays would have an RMS error of 0.5 / sqrt(1024) = 0.016; the error of these points falls as
        // n^-0.75.
        assert!(rms < 0.004 && bias.abs() < 5e-4 && worst < 0.02, "{light} {sun}: {rms} {bias} {worst}");
    }
}

#[test]
fn of_a_low_disc_what_lies_below_the_surface_is_dark_without_a_ray() {
    for (elevation, sun) in [(3.0_f32, 20.0_f32), (8.0, 20.0), (12.0, 20.0), (1.0, 90.0)] {
        let (sin, cos) = elevation.to_radians().sin_cos();
        let mut world = World::lit_along(-Vec3::new(cos, sin, 0.0));
        let paint = world.paint(Vec3::splat(0.5));
        world.quad(paint, Vec3::ZERO, Vec3::Z, Vec3::X);
        let shot = Shot::of(&world, Vec3::new(0.1, 3.0, 0.2), grid(8, Vec3::ZERO, Vec3::X * 0.5, Vec3::Z * 0.5));
        let (pixels, rays) = shot.run(DeferredShadows, Corrected, soft(sun, 256));
        let [above, half] = [elevation, sun / 2.0].map(|degrees| f64::from(degrees).to_radians());
        let expected = open_beyond_plane(above, half);
        let mean = pixels.iter().map(|pixel| open(*pixel)).sum::<f64>() / 64.0;
        assert!((mean - expected).abs() < 2e-3, "{elevation} {sun}: {mean} of {expected}");
        // Exactly the rays that were traced are open.
        assert_eq!(rays.shadow as f64, (mean * 64.0 * 256.0).round(), "{elevation} {sun}");
        assert_eq!(rays.shadow == 64 * 256, elevation > sun / 2.0);
    }
}

/// A round plate of radius `radius` at a height of 1 over the origin of a floor.
fn plate(radius: f32) -> World {
    let mut world = World::lit_along(Vec3::NEG_Y);
    let paint = world.paint(Vec3::splat(0.5));
    world.quad(paint, Vec3::ZERO, Vec3::Z * 9.0, Vec3::X * 9.0);
    let rim = |index: u32| {
        let (sin, cos) = (std::f32::consts::TAU * index as f32 / 256.0).sin_cos();
        Vec3::new(radius * cos, 1.0, radius * sin)
    };
    (0..256).for_each(|index| world.triangle(paint, [Vec3::Y, rim(index + 1), rim(index)], [Vec3::Y; 3]));
    world
}

#[test]
fn a_plate_smaller_than_the_disc_has_no_umbra() {
    // Slightly off the plate's centre, where its triangles meet.
    let target = Vec3::new(1.3e-4, 0.0, 0.7e-4);
    let at = |radius: f32, params: RayParams| {
        let world = plate(radius);
        let shot = Shot::of(&world, Vec3::new(0.5, 0.4, 0.6), [target]);
        open(shot.run(DeferredShadows, Corrected, params).0[0])
    };
    let sun = 10.0_f32;
    let half = f64::from(sun / 2.0).to_radians();
    for share in [0.25, 0.5, 0.8] {
        let radius = (share * half).tan();
        let expected = 1.0 - (1.0 - (share * half).cos()) / (1.0 - half.cos());
        let found = at(radius as f32, soft(sun, 4096));
        assert!((found - expected).abs() < 0.01, "{share}: {found} of {expected}");
        assert_eq!(at(radius as f32, soft(0.0, 4096)), 0.0, "without a disc it is dark");
    }
    assert_eq!(at((1.1 * half).tan() as f32, soft(sun, 4096)), 0.0, "a larger plate has one");
}

/// Random triangles, a smooth sphere of triangles, exact spheres, and panes.
fn worlds() -> [World; 4] {
    let mut spheres = World::lit_along(Vec3::new(0.4, -1.0, 0.3));
    let paint = spheres.paint(Vec3::splat(0.5));
    spheres.quad(paint, Vec3::NEG_Y, Vec3::Z * 9.0, Vec3::X * 9.0);
    spheres.sphere(paint, Vec3::ZERO, 0.8);
    spheres.sphere(paint, Vec3::new(1.2, 0.5, 0.4), 0.4);
    let mut panes = half_plane(Vec3::new(-0.5, 1.0, 0.2));
    let glass = panes.glass();
    for height in [0.3, 0.5] {
        panes.quad(glass, Vec3::Y * height, Vec3::NEG_Z, Vec3::X * 0.7);
    }
    [World::scattered(), super::terminator::sphere(8, true), spheres, panes]
}

fn seen(world: &World) -> Shot<'_> {
    let targets = grid(40, Vec3::ZERO, Vec3::X * 2.5, Vec3::Z * 2.5);
    Shot::of(world, Vec3::new(0.5, 4.0, 2.0), targets).rows(40)
}

/// Runs a program on the tracer that the backend would choose.
fn run(world: &World, shot: &Shot<'_>, program: RayProgram, params: RayParams) -> (Vec<[f32; 4]>, RayCounts) {
    let job = shot.job(program, Corrected, params);
    if world.scene.geometry.spheres.is_empty() {
        return shot.run_on(&world.tree(), &job);
    }
    let (triangles, spheres) = (world.tree(), world.spheres());
    shot.run_on(&crate::trace::WithSpheres { triangles: &triangles, spheres: &spheres }, &job)
}

#[test]
fn a_disc_that_is_a_point_gives_hard_shadows_and_their_rays_once_a_sample() {
    let (mut dark, mut glass) = (0, 0);
    for (index, world) in worlds().into_iter().enumerate() {
        let shot = seen(&world);
        for program in [DeferredShadows, Final] {
            let (hard, hard_rays) = run(&world, &shot, program, soft(0.0, 16));
            let (pixels, rays) = run(&world, &shot, program, soft(POINT, 16));
            assert!(pixels == hard, "{program:?} in world {index}");
            // Whether the lifted point is cut off is tested once a pixel, not once a sample.
            assert!(rays.shadow > hard_rays.shadow && rays.shadow <= 16 * hard_rays.shadow, "{rays:?} {hard_rays:?}");
            assert_eq!((rays.reflected, rays.refracted), (hard_rays.reflected, hard_rays.refracted));
            dark += pixels.iter().filter(|pixel| pixel[0] == 0.5).count();
            glass += rays.reflected;
        }
        // A disc of visible size changes the picture.
        assert!(
            run(&world, &shot, DeferredShadows, soft(10.0, 16)).0
                != run(&world, &shot, DeferredShadows, soft(0.0, 1)).0
        );
    }
    assert!(dark > 200 && glass > 20, "{dark} {glass}");
}

/// In worlds without smooth normals there are exactly as many rays as samples.
#[test]
fn every_lit_pixel_traces_one_ray_a_sample() {
    let world = half_plane(Vec3::Y);
    let targets = grid(16, Vec3::ZERO, Vec3::X * 0.5, Vec3::Z * 0.5).chain([Vec3::Y * 50.0]);
    let shot = Shot::of(&world, Vec3::new(0.5, 0.8, 2.0), targets);
    assert_eq!(shot.triangle.iter().filter(|id| **id == NO_TRIANGLE).count(), 1);
    for samples in [1, 5, 16, 33, 64, 300] {
        let (pixels, rays) = shot.run(DeferredShadows, Corrected, soft(5.0, samples));
        assert_eq!(rays.shadow, 256 * u64::from(samples));
        // Each share is a whole number of samples.
        for pixel in &pixels {
            let rays = open(*pixel) * f64::from(samples);
            assert!((rays - rays.round()).abs() < 1e-3, "{samples}: {rays}");
        }
    }
    let hard = shot.run(DeferredShadows, Thesis, soft(0.0, 16));
    assert_eq!(shot.run(DeferredShadows, Thesis, soft(5.0, 16)), hard, "thesis fidelity knows no disc");
}

#[test]
fn packets_give_what_brute_force_gives() {
    for (index, world) in worlds().iter().enumerate().filter(|(_, world)| world.scene.geometry.spheres.is_empty()) {
        let shot = seen(world);
        for program in [DeferredShadows, Final] {
            let job = shot.job(program, Corrected, soft(12.0, 20));
            let (expected, expected_rays) = shot.run_on(&world.brute_force(), &job);
            let (found, rays) = shot.run_on(&world.tree(), &job);
            let apart = |(a, b): &(&[f32; 4], &[f32; 4])| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 1e-6);
            // For rays that graze an edge, either result is right.
            let wrong = expected.iter().zip(&found).filter(apart).count();
            assert!(wrong <= 4, "{program:?} in world {index}: {wrong} pixels");
            assert_eq!(rays.shadow, expected_rays.shadow);
        }
    }
}

/// The samples of consecutive batches are those of one large batch: the mean of the batches is the mean of all.
#[test]
fn batches_of_the_sequence_are_all_samples_at_once() {
    let world = half_plane(Vec3::Y);
    let shot = Shot::of(&world, Vec3::new(0.5, 0.8, 2.0), grid(20, Vec3::ZERO, Vec3::X * 0.1, Vec3::Z * 0.5));
    let at = |first_sun: u32, samples: u32| {
        let params = RayParams { first_sun, ..soft(8.0, samples) };
        shot.run(DeferredShadows, Corrected, params).0.into_iter().map(open).collect::<Vec<_>>()
    };
    let (whole, batches) = (at(0, 64), [0, 16, 32, 48].map(|first| at(first, 16)));
    assert!(batches[0] != batches[1] && whole.iter().any(|share| (0.1..0.9).contains(share)));
    for (index, whole) in whole.iter().enumerate() {
        assert_eq!(*whole, batches.iter().map(|batch| batch[index]).sum::<f64>() / 4.0);
    }
}

/// `final` shows the surface colour times the share that `deferredShadows` computes.
#[test]
fn the_first_surfaces_of_final_have_the_shadows_of_the_shadow_program() {
    let world = half_plane(Vec3::new(-0.5, 1.0, 0.2));
    let shot = Shot::of(&world, Vec3::new(0.8, 0.6, 2.0), grid(24, Vec3::X * 0.5, Vec3::X * 0.4, Vec3::Z * 0.5));
    let shares = shot.run(DeferredShadows, Corrected, soft(15.0, 16)).0;
    let (pixels, rays) = shot.run(Final, Corrected, soft(15.0, 16));
    assert_eq!(rays.total(), 24 * 24 * 16);
    for ((pixel, share), color) in pixels.iter().zip(&shares).zip(&shot.color) {
        assert_close(*pixel, Vec3::from_slice(&color[..3]) * share[0], 1e-7, "colour times share");
    }
    assert!(shares.iter().filter(|share| share[0] > 0.51 && share[0] < 0.99).count() > 100);
}

/// Two panes of the report's glass cover the whole disc as seen from the floor; then a solid body, through which light
/// falls straight.
#[test]
fn glass_dims_the_whole_disc() {
    let mut world = World::lit_along(Vec3::NEG_Y);
    let paint = world.paint(Vec3::new(0.5, 0.6, 0.7));
    world.quad(paint, Vec3::ZERO, Vec3::Z * 9.0, Vec3::X * 9.0);
    let glass = world.glass();
    for height in [1.0, 1.5] {
        world.quad(glass, Vec3::Y * height, Vec3::Z * 9.0, Vec3::X * 9.0);
    }
    let look = |world: &World, params: RayParams| {
        let shot = Shot::of(world, Vec3::new(0.3, 0.7, 0.2), [Vec3::ZERO]);
        shot.run(Final, Corrected, params)
    };
    let (pixels, rays) = look(&world, soft(20.0, 100));
    assert_close(pixels[0], world.lit(paint, 1.0) * 0.81, 1e-6, "two surfaces of 0.9");
    assert_eq!(rays.shadow, 100);

    let mut bodies = World::lit_along(Vec3::NEG_Y);
    let paint = bodies.paint(Vec3::new(0.5, 0.6, 0.7));
    bodies.quad(paint, Vec3::ZERO, Vec3::Z * 9.0, Vec3::X * 9.0);
    let solid = bodies.dielectric(Dielectric {
        shape: Shape::Solid,
        filter: Vec3::new(0.9, 0.6, 0.8),
        index: 1.5,
        ..Dielectric::default()
    });
    bodies.quad(solid, Vec3::Y * 1.5, Vec3::Z * 9.0, Vec3::X * 9.0);
    bodies.quad(solid, Vec3::Y, Vec3::X * 9.0, Vec3::Z * 9.0);
    let straight = |sun, samples| RayParams { shadow: GlassShadow::Straight, ..soft(sun, samples) };
    let hard = look(&bodies, straight(0.0, 16)).0[0];
    let (point, rays) = look(&bodies, straight(POINT, 16));
    assert_close(point[0], Vec3::from_slice(&hard[..3]), 1e-6, "a point of light");
    assert_eq!(rays.shadow, 16);
    // The Fresnel reflectance hardly changes near the normal, and the whole disc is seen through the body.
    let (wide, _) = look(&bodies, straight(20.0, 256));
    assert_close(wide[0], Vec3::from_slice(&hard[..3]), 2e-4, "a disc");
    assert!(hard[0] != hard[1] * 0.5 / 0.6, "the body has a colour");
}
