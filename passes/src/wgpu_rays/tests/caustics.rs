//! Light that exact spheres and photons bring to surfaces, in pictures: closed forms, and the processor's pictures.

use super::glass::{FEW, auto, block, both, picture_on, shot, solid};
use super::pictures::differing;
use super::{picture, rays_in_turn};
use crate::cpu::CpuRays;
use crate::effects::dielectric::ball::Turned;
use crate::effects::tests::terminator;
use crate::effects::tests::world::{Shot, World};
use crate::raster::gpu::AdapterKind;
use crate::wgpu_rays::CUT_FOCUS;
use crate::wgpu_rays::layout::{COUNT_BYTES, COUNTS_BUFFER_BYTES};
use curitiba_pipeline::backend::{PhotonCounts, RayBackend, RayCounts, RayJob, Sun};
use curitiba_pipeline::glass::{Dielectric, GlassShadow, Shape};
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba_pipeline::scene::RenderScene;
use glam::{Vec2, Vec3};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// A sphere of glass at this height above a white floor at z = 0, under light that falls straight down.
fn above_a_floor(index: f32, height: f32) -> World {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.dielectric(solid(index));
    world.sphere(glass, Vec3::Z * height, 1.0);
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    world
}

/// Irradiance of the floor at these distances from the axis, in units of the light's, seen from below the sphere. The light is so strong that
/// ambient light is negligible.
fn irradiance(rays: &mut dyn RayBackend, world: &World, radii: impl Iterator<Item = f32>) -> Vec<f64> {
    let places = radii.map(|radius| Vec3::new(0.6, 0.8, 0.0) * radius);
    let shot = Shot::of(world, Vec3::new(0.01, 0.02, 0.3), places);
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let sun = world.sun.map(|sun| Sun { color: Vec3::splat(1e7), ..sun });
    let params = auto(2, GlassShadow::Caustic, 0);
    let job = RayJob { scene: &scene, sun, ..shot.job(RayProgram::Final, Fidelity::Corrected, params) };
    rays.build(&scene, &vec![true; scene.materials.len()]).expect("built");
    let (pixels, _) = picture(rays, &job);
    let share = |(pixel, color): (&[f32; 4], &[f32; 4])| (f64::from(pixel[0]) / f64::from(color[0]) - 0.5) * 2.0;
    pixels.iter().zip(&shot.color).map(share).collect()
}

/// The closed form of the irradiance of a plane below a sphere, without any blur: the sum of T b db / (rho drho) over the rays that arrive at
/// `radius` from the axis. The roots of rho(i) = `radius` and -`radius` are found between steps of the angle of incidence.
fn closed_form(index: f64, height: f64, radius: f64) -> f64 {
    let reaches = |incidence: f64| {
        let ray = Turned::at(incidence, index);
        let (sin, cos) = incidence.sin_cos();
        let inner = (1.0 - (sin / index).powi(2)).sqrt();
        // Where the ray leaves the sphere, and its direction.
        let (angle, turned) =
            (incidence + std::f64::consts::PI - 2.0 * (sin / index).asin(), 2.0 * (incidence - (sin / index).asin()));
        let rho = angle.sin() - turned.tan() * (angle.cos() + height);
        let (s, p) = ((cos - index * inner) / (cos + index * inner), (index * cos - inner) / (index * cos + inner));
        let passes = (1.0 - 0.5 * (s * s + p * p)).powi(2);
        (rho, passes, ray.direction.y > 0.0)
    };
    let steps = 2_000;
    let at = |step: f64| FRAC_PI_2 * step / f64::from(steps);
    let mut sum = 0.0;
    for side in [radius, -radius] {
        for step in 0..steps {
            let [low, high] = [f64::from(step), f64::from(step + 1)].map(|step| (at(step), reaches(at(step))));
            let down = low.1.2 && high.1.2;
            if !down || (low.1.0 - side) * (high.1.0 - side) > 0.0 || low.1.0 == side {
                continue;
            }
            let (mut a, mut b) = (low.0, high.0);
            for _ in 0..60 {
                let middle = 0.5 * (a + b);
                if (reaches(middle).0 - side) * (low.1.0 - side) > 0.0 { a = middle } else { b = middle }
            }
            let h = 1e-6;
            let slope = (reaches(a + h).0 - reaches(a - h).0) / (2.0 * h);
            sum += reaches(a).1 * (a.sin() * a.cos() / (radius * slope)).abs();
        }
    }
    sum
}

#[test]
fn the_irradiance_below_a_sphere_has_the_closed_form() {
    let Some(mut rays) = rays_in_turn() else { return };
    // On the axis (1 - R)^4 / (1 - H / f)^2, with f = n / (2 (n - 1)).
    for (height, expected) in [(2.0_f32, 8.2944), (3.0, 0.9216)] {
        let found = irradiance(&mut *rays, &above_a_floor(1.5, height), [0.0].into_iter())[0];
        println!("on the axis at {height}: {found}, and {expected}");
        assert!((found / expected - 1.0).abs() < 1e-3, "{height}: {found} {expected}");
    }
    let world = above_a_floor(1.5, 2.0);
    // Means over rings, to four digits. Where the sun also shines directly, its light is subtracted.
    const STEPS: u16 = 50;
    for ([inner, outer], expected) in [
        ([0.0_f32, 0.1], 6.807),
        ([0.1, 0.2], 4.058),
        ([0.2, 0.3], 2.234),
        ([0.3, 0.5], 1.039),
        ([0.5, 1.0], 0.2768),
        ([1.0, 2.0], 0.0384),
    ] {
        let square =
            |step: u16| inner * inner + (outer * outer - inner * inner) * (f32::from(step) + 0.5) / f32::from(STEPS);
        let all = irradiance(&mut *rays, &world, (0..STEPS).map(|step| square(step).sqrt()));
        let direct = if inner >= 1.0 { 1.0 } else { 0.0 };
        let mean = all.iter().sum::<f64>() / f64::from(STEPS) - direct;
        println!("ring {inner} to {outer}: {mean}, and {expected}");
        assert!((mean - expected).abs() < 2e-3 * expected + 2e-4, "{inner} to {outer}: {mean} {expected}");
    }
    // Point by point, where the closed form is finite and nearly linear over the width.
    for (index, height) in [(1.5_f32, 2.0_f32), (1.33, 3.0), (2.42, 1.5)] {
        let radii = || (0..300).map(|step| 0.02 + 0.003 * step as f32);
        let found = irradiance(&mut *rays, &above_a_floor(index, height), radii());
        let (mut square, mut number, mut worst) = (0.0, 0.0, 0.0_f64);
        for (radius, found) in radii().zip(&found) {
            let [before, here, after] =
                [-4e-3, 0.0, 4e-3].map(|way| closed_form(index.into(), height.into(), f64::from(radius) + way));
            if (before - here).abs().max((after - here).abs()) > 0.1 * here {
                continue;
            }
            let error = (found - here) / here;
            square += error * error;
            number += 1.0;
            worst = worst.max(error.abs());
        }
        let rmse = (square / number).sqrt();
        println!("index {index} at {height}: {number} points, RMSE {rmse:.1e}, worst {worst:.1e}");
        assert!(number > 200.0 && rmse < 1e-4 && worst < 1e-3, "{index} {height}: {rmse} {worst}");
    }
    // Control: another index.
    let other = irradiance(&mut *rays, &above_a_floor(1.53, 2.0), [0.0].into_iter())[0];
    assert!((other / 8.2944 - 1.0).abs() > 0.05, "{other}");
}

const EYE: Vec3 = Vec3::new(0.2, 0.4, 7.0);

/// Spheres over a floor and before a wall, of which some focus light: a clear one, one that absorbs, one in a block of glass, two that overlap, and
/// one of index 1. A red thin wall absorbs some of the focused light.
fn spheres() -> World {
    let mut world = World { beyond: Vec3::new(0.2, 0.5, 0.9), ..World::lit_along(Vec3::new(-0.25, -0.8, -0.5)) };
    let floor = world.paint(Vec3::new(0.8, 0.7, 0.5));
    world.quad(floor, Vec3::new(0.0, -1.7, 0.0), Vec3::Z * 9.0, Vec3::X * 9.0);
    world.quad(floor, Vec3::new(0.0, 0.0, -2.0), Vec3::X * 9.0, Vec3::Y * 9.0);
    let clear = world.dielectric(solid(1.5));
    world.sphere(clear, Vec3::new(-0.9, -0.4, 0.6), 0.7);
    let blue = world.dielectric(Dielectric { extinction: Vec3::new(1.2, 0.5, 0.1), veil: 0.1, ..solid(1.33) });
    world.sphere(blue, Vec3::new(0.9, -0.8, 0.3), 0.6);
    world.sphere(clear, Vec3::new(2.0, 0.9, 0.0), 0.4);
    world.sphere(blue, Vec3::new(2.4, 1.4, 0.0), 0.4);
    let air = world.dielectric(solid(1.0));
    world.sphere(air, Vec3::new(-2.0, 1.2, 0.0), 0.5);
    let around = world.dielectric(Dielectric { priority: 1, ..solid(1.2) });
    block(&mut world, around, Vec3::new(0.2, 1.3, 0.0), Vec3::splat(0.5));
    let bead = world.dielectric(solid(1.8));
    world.sphere(bead, Vec3::new(0.2, 1.3, 0.0), 0.3);
    let wall = Dielectric { shape: Shape::Thin, thickness: 0.1, filter: Vec3::new(0.9, 0.3, 0.2), ..solid(1.5) };
    let wall = world.dielectric(wall);
    world.quad(wall, Vec3::new(-1.2, -1.4, -0.2), Vec3::X * 0.4, Vec3::Z * 0.5);
    world
}

/// Number of pixels that differ, on the processor, between focused and straight light.
fn seen(world: &World, params: RayParams, expected: &[[f32; 4]]) -> usize {
    let straight = RayParams { shadow: GlassShadow::Straight, ..params };
    let (without, _) = picture_on(&mut CpuRays::new(), world, EYE, RayProgram::Final, straight);
    differing(&without, expected, 0.02)
}

#[test]
fn focused_light_falls_where_the_processors_does() {
    let world = spheres();
    // Several kernels, one after the other: without occlusion under a light that is a point, and with occlusion under a disc. A software driver
    // takes minutes to compile the second; there the picture of `glass/Caustics` in `tests/frames/wgpu_rays` has a disc and occlusion.
    let all =
        [auto(2, GlassShadow::Caustic, 0), RayParams { sun: 1.5, sun_samples: 4, ..auto(2, GlassShadow::Caustic, 2) }];
    let is_slow = rays_in_turn().is_none_or(|rays| rays.gpu.adapter.kind == AdapterKind::Software);
    for params in &all[..if is_slow { 1 } else { 2 }] {
        let params = *params;
        let Some([found, expected]) = both(&world, EYE, RayProgram::Final, params) else { return };
        let (off, changed) = (differing(&found, &expected, 0.01), seen(&world, params, &expected));
        println!("{off} pixels are off by more than a hundredth; focused light changes {changed}");
        assert!(off <= FEW, "{params:?}: {off} pixels are off");
        assert!(changed > 4 * FEW, "{changed} pixels show focused light");
    }
}

#[test]
fn pixels_whose_points_do_not_fit_have_the_same_light() {
    let Some(mut rays) = rays_in_turn() else { return };
    let cuts = super::selftest::cuts_loops(&rays.gpu).expect("tried");
    for (world, params) in [(spheres(), auto(2, GlassShadow::Caustic, 0)), (meshes(), photons(0))] {
        if cuts && params.photons == 0 {
            eprintln!(
                "skipped: one thread finds the light of several points, for which this driver leaves loops and says so"
            );
            continue;
        }
        let (expected, _) = picture_on(&mut *rays, &world, EYE, RayProgram::Final, params);
        // Room for one point of each pixel and a few seen through glass. There is one launch, however slow the driver is: each launch counts its
        // own points.
        rays.room = Some(64 * 64 + 10);
        rays.sizes.values_mut().for_each(|tiles| *tiles = Some(u32::MAX));
        let (found, _) = picture_on(&mut *rays, &world, EYE, RayProgram::Final, params);
        rays.room = None;
        assert_eq!(differing(&found, &expected, 1e-3), 0);
        // The number of points lies behind the ray counts.
        let mut listed = 0;
        let mut encoder = rays.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: None });
        encoder.copy_buffer_to_buffer(&rays.counts, 0, &rays.counts_staging, 0, COUNTS_BUFFER_BYTES);
        let finished = Some(encoder.finish());
        let read = rays.gpu.read_mapped(&rays.counts_staging, COUNTS_BUFFER_BYTES, finished, "reading", |bytes| {
            listed = bytemuck::cast_slice::<u8, u32>(bytes)[COUNT_BYTES as usize / 4];
        });
        read.expect("read");
        assert!(listed > 64 * 64 + 100, "control: {listed} points, and all fit");
    }
}

/// Checks that with `shadow=caustic` a pass has the picture, the rays and the programs of `shadow=straight`.
fn has_straight_light(world: &World, photons: u32) {
    let Some(mut rays) = rays_in_turn() else { return };
    // Drops the launch sizes of other tests, whose keys are the kinds of the kernels that ran.
    rays.sizes.clear();
    let [caustic, straight] = [GlassShadow::Caustic, GlassShadow::Straight].map(|shadow| {
        let params = RayParams { photons, ..auto(2, shadow, 0) };
        picture_on(&mut *rays, world, EYE, RayProgram::Final, params)
    });
    assert!(super::bits(&caustic.0) == super::bits(&straight.0) && caustic.1.rays == straight.1.rays);
    let kinds: Vec<_> = rays.sizes.keys().map(|(kind, _)| kind).collect();
    assert!(!kinds.is_empty() && kinds.iter().all(|kind| !kind.focuses), "{kinds:?}");
}

#[test]
fn spheres_that_focus_nothing_have_the_programs_of_straight_light() {
    let mut world = World::lit_along(Vec3::new(0.3, 0.2, -1.0));
    let air = world.dielectric(solid(1.0));
    world.sphere(air, Vec3::Z * 2.0, 1.0);
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    // Photons are shot at no sphere.
    for photons in [0, 5000] {
        has_straight_light(&world, photons);
    }
}

#[test]
fn meshes_without_photons_have_the_programs_of_straight_light() {
    has_straight_light(&meshes(), 0);
}

/// Settings for a pass that shoots photons.
fn photons(samples: u32) -> RayParams {
    RayParams { photons: 20_000, ..auto(2, GlassShadow::Caustic, samples) }
}

/// A ball of triangles.
fn ball(world: &mut World, material: u32, center: Vec3, radius: f32) {
    let unit = terminator::sphere(16, true).scene.geometry;
    for triangle in &unit.triangles {
        let corners = triangle.map(|corner| unit.positions[corner as usize]);
        world.triangle(material, corners.map(|corner| center + radius * corner), corners);
    }
}

/// Bodies of triangles over a floor and before a wall: a clear ball, a block that absorbs, a clear block, and a block of index 1, at which no photons
/// are shot.
pub(super) fn meshes() -> World {
    let mut world = World { beyond: Vec3::new(0.2, 0.5, 0.9), ..World::lit_along(Vec3::new(-0.25, -0.8, -0.5)) };
    let floor = world.paint(Vec3::new(0.8, 0.7, 0.5));
    world.quad(floor, Vec3::new(0.0, -1.7, 0.0), Vec3::Z * 9.0, Vec3::X * 9.0);
    world.quad(floor, Vec3::new(0.0, 0.0, -2.0), Vec3::X * 9.0, Vec3::Y * 9.0);
    let clear = world.dielectric(solid(1.5));
    ball(&mut world, clear, Vec3::new(-0.9, -0.4, 0.6), 0.8);
    let blue = world.dielectric(Dielectric { extinction: Vec3::new(1.2, 0.5, 0.1), veil: 0.1, ..solid(1.33) });
    block(&mut world, blue, Vec3::new(1.2, -0.7, 0.3), Vec3::new(0.6, 0.5, 0.4));
    let flint = world.dielectric(solid(1.7));
    block(&mut world, flint, Vec3::new(1.5, 1.3, 0.4), Vec3::new(0.5, 0.3, 0.4));
    let air = world.dielectric(solid(1.0));
    block(&mut world, air, Vec3::new(-1.9, 1.2, 0.0), Vec3::splat(0.4));
    world
}

/// [`meshes`] with an exact sphere that focuses light, and one that does not since it lies in the ball.
fn meshes_and_spheres() -> World {
    let mut world = meshes();
    let clear = world.dielectric(solid(1.5));
    world.sphere(clear, Vec3::new(0.2, 0.5, 0.5), 0.5);
    let bubble = world.dielectric(Dielectric { priority: 1, ..solid(1.2) });
    world.sphere(bubble, Vec3::new(-0.9, -0.3, 0.6), 0.3);
    world
}

#[test]
fn photons_light_what_they_light_on_the_processor() {
    let Some(mut rays) = rays_in_turn() else { return };
    assert!(rays.shoots_photons());
    // Bodies of triangles alone; beside spheres of which one focuses light, and of which none does; and under a disc. Without occlusion, with few
    // occlusion rays, and with so many that they are settled.
    let mut bubble = meshes_and_spheres();
    bubble.scene.geometry.spheres.remove(0);
    let soft = RayParams { sun: 1.5, sun_samples: 4, ..photons(2) };
    let mut cut_out = meshes();
    // The blue block.
    cut_out.cut_out(2, false);
    for (world, params) in [
        (meshes(), photons(0)),
        (cut_out, photons(0)),
        (meshes(), photons(9)),
        (meshes_and_spheres(), photons(0)),
        (bubble, photons(0)),
        (meshes(), soft),
    ] {
        let (found, mine) = picture_on(&mut *rays, &world, EYE, RayProgram::Final, params);
        let mut cpu = CpuRays::new();
        let (expected, theirs) = picture_on(&mut cpu, &world, EYE, RayProgram::Final, params);
        let (without, _) = picture_on(&mut cpu, &world, EYE, RayProgram::Final, RayParams { photons: 0, ..params });
        let (mine, theirs) = (mine.rays, theirs.rays);
        let is_glass: Vec<bool> = shot(&world, EYE).color.iter().map(|color| *color == [1.0, 0.0, 1.0, 0.0]).collect();
        let changed = [true, false].map(|glass| {
            let of = |pixels: &[[f32; 4]]| -> Vec<[f32; 4]> {
                pixels.iter().zip(&is_glass).filter(|(_, is)| **is == glass).map(|(pixel, _)| *pixel).collect()
            };
            differing(&of(&without), &of(&expected), 0.01)
        });
        let off = differing(&found, &expected, 0.01);
        println!("{off} pixels are off; photons change {changed:?}, through glass and beside it; {mine:?} {theirs:?}");
        assert!(off <= FEW, "{params:?}: {off} pixels are off");
        assert!(changed[0] > 2 * FEW && changed[1] > 8 * FEW, "{changed:?} pixels show photons");
        let PhotonCounts { shot, landed, .. } = mine.photons;
        assert!(mine.photons == theirs.photons && shot == 20_000 && landed > 2000, "{mine:?} {theirs:?}");
        // The processor traces a second ray from surfaces whose light passes glass.
        assert!(mine.shadow.abs_diff(theirs.shadow) <= theirs.shadow / 20, "{mine:?} {theirs:?}");
        let paths = |rays: RayCounts| rays.reflected + rays.refracted;
        assert!(paths(mine).abs_diff(paths(theirs)) <= paths(theirs) / 100 + 2, "{mine:?} {theirs:?}");
    }
}

/// On a driver that leaves loops, most of the light of a thousand spheres would be missing without an error.
#[test]
fn more_spheres_than_a_driver_takes_in_one_loop_are_refused() {
    let Some(mut rays) = rays_in_turn() else { return };
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.dielectric(solid(1.5));
    for index in 0..1000 {
        let at = Vec2::new((index % 32) as f32, (index / 32) as f32) - 16.0;
        world.sphere(glass, (at * 0.3).extend(1.0), 0.1);
    }
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    let shot = Shot::of(&world, Vec3::Z * 0.5, [Vec3::ZERO, Vec3::X]);
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let params = auto(2, GlassShadow::Caustic, 0);
    let job = RayJob { scene: &scene, ..shot.job(RayProgram::Final, Fidelity::Corrected, params) };
    rays.build(&scene, &vec![true; scene.materials.len()]).expect("built");
    let mut output = curitiba_pipeline::image::Image::filled(2, 1, [0.0; 4]);
    match rays.run(&job, &mut output, &super::Progress::default()) {
        Ok(_) => assert!(!super::selftest::cuts_loops(&rays.gpu).expect("tried"), "light is missing"),
        Err(error) => assert!(error.to_string().contains(CUT_FOCUS), "{error}"),
    }
}
