//! Exact spheres in programs without bodies of glass, and ten thousand spheres, compared with the processor and with closed forms.

use super::lights::lamps;
use super::pictures::{both_of, both_on, differing};
use super::{bits, picture, rays_in_turn};
use crate::cpu::CpuRays;
use crate::effects::tests::world::{Shot, World, grid};
use crate::wgpu_rays::WgpuRays;
use curitiba_pipeline::backend::{Glow, RayBackend, RayJob};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram, Sampler};
use curitiba_pipeline::progress::Progress;
use curitiba_pipeline::scene::RenderScene;
use glam::Vec3;
use std::sync::Arc;

const SIDE: u32 = 64;

/// The picture of a program in corrected fidelity.
fn shown(rays: &mut WgpuRays, world: &World, shot: &Shot<'_>, program: RayProgram, params: RayParams) -> Vec<[f32; 4]> {
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let job = RayJob { scene: &scene, ..shot.job(program, Fidelity::Corrected, params) };
    rays.build(&scene, &vec![true; scene.materials.len()]).expect("built");
    picture(rays, &job).0
}

/// Spheres of several materials above a ground and beside a textured wall. Texture, bumps, cut-outs and vertex colours of the wall's material
/// do not apply to spheres.
pub(super) fn still() -> World {
    let mut world = World::lit_along(Vec3::new(0.4, -1.0, -0.3));
    let ground = world.paint(Vec3::new(0.9, 0.7, 0.6));
    world.quad(ground, Vec3::ZERO, Vec3::X * 6.0, Vec3::NEG_Z * 6.0);
    let wall = world.picture([[255, 40, 40, 255], [40, 255, 90, 255]], Some(0.5));
    world.quad(wall, Vec3::new(0.0, 3.0, -4.0), Vec3::X * 5.0, Vec3::Y * 3.0);
    let mirror = world.glass();
    let blue = world.paint(Vec3::new(0.1, 0.3, 0.9));
    world.shades[blue as usize].glow = Some(Glow { color: Vec3::new(0.1, 0.0, 0.05), texture: Some(0) });
    for (material, center, radius) in [
        (mirror, Vec3::new(-1.5, 1.2, 0.3), 1.2),
        (blue, Vec3::new(1.4, 0.8, 0.6), 0.8),
        (wall, Vec3::new(0.2, 2.9, -1.0), 0.9),
        (mirror, Vec3::new(0.3, 0.4, 2.0), 0.4),
        (blue, Vec3::new(3.0, 2.0, -1.5), 1.1),
        (wall, Vec3::new(-3.2, 0.3, 2.1), 0.3),
    ] {
        world.sphere(material, center, radius);
    }
    world.bump(wall, [[220, 90, 200, 255], [40, 160, 220, 255]], 1.0);
    world.shades[wall as usize].vertex_colors = true;
    world.scene.geometry.colors = vec![glam::Vec4::new(1.0, 0.8, 0.9, 1.0); world.scene.geometry.positions.len()];
    world
}

/// A G-buffer of the world [`still`].
fn seen(world: &World) -> Shot<'_> {
    Shot::of(world, Vec3::new(0.5, 2.5, 9.0), grid(SIDE, Vec3::new(0.0, 1.6, 0.0), Vec3::X * 3.6, Vec3::Y * 2.6))
        .rows(SIDE)
}

#[test]
fn shadows_of_spheres_are_the_processors_bit_by_bit() {
    let world = still();
    let shot = seen(&world);
    let params = RayParams::default();
    let both = |world| both_of(world, &shot, RayProgram::DeferredShadows, Fidelity::Corrected, params);
    let Some([found, expected]) = both(&world) else { return };
    assert_eq!(bits(&found), bits(&expected));
    let dark = expected.iter().filter(|pixel| pixel[0] < 1.0).count();
    assert!((100..3000).contains(&dark), "{dark} pixels in shadow");
}

#[test]
fn occlusion_by_spheres_is_the_processors() {
    let world = still();
    let shot = seen(&world);
    let Some(mut rays) = rays_in_turn() else { return };
    for (samples, radius) in [(16, 1.5), (100, 0.4), (2, 1.0)] {
        let params = RayParams { samples, radius, ..RayParams::default() };
        let [found, expected] = both_on(&mut rays, &world, &shot, RayProgram::Ssao, Fidelity::Corrected, params);
        // The last bit of a direction may decide on one ray more or less.
        let off = differing(&found, &expected, 1e-6);
        assert!(off <= (SIDE * SIDE) as usize / 200, "{samples} {radius}: {off} pixels are off");
        let covered = expected.iter().filter(|pixel| pixel[0] < 1.0).count();
        assert!(covered > 300, "{samples} {radius}: {covered} pixels are covered");
    }
}

/// The share of the cosine-weighted sky that a sphere covers straight above a point of a plane is (r / d)².
#[test]
fn occlusion_is_the_form_factor_of_the_sphere() {
    let Some(mut rays) = rays_in_turn() else { return };
    let world = |with_ground: bool| {
        let mut world = World::lit_along(Vec3::NEG_Z);
        let (ground, ball) = (world.paint(Vec3::ONE), world.paint(Vec3::ONE));
        if with_ground {
            world.quad(ground, Vec3::ZERO, Vec3::X * 30.0, Vec3::Y * 30.0);
        }
        world.sphere(ball, Vec3::new(0.0, 0.0, 2.0), 1.0);
        world
    };
    let params =
        |radius| RayParams { samples: 4096, radius, intensity: 1.0, sampler: Sampler::Sobol, ..RayParams::default() };
    let open = |rays: &mut WgpuRays, world: &World, radius| {
        let mut shot = Shot::of(world, Vec3::new(9.0, 0.0, 4.0), [Vec3::ZERO, Vec3::new(0.0, 0.0, 3.0)]);
        // The top of the sphere, with an exact position.
        (shot.position[1], shot.normal[1]) = ([0.0, 0.0, 3.0, 1.0], [0.0, 0.0, 1.0, 0.0]);
        shown(rays, world, &shot, RayProgram::Ssao, params(radius)).iter().map(|pixel| pixel[0]).collect::<Vec<_>>()
    };
    let far = open(&mut rays, &world(true), 9.0);
    assert!((far[0] - 0.75).abs() < 2e-3 && far[1] == 1.0, "{far:?}: a convex body does not occlude itself");
    assert_eq!(open(&mut rays, &world(true), 0.9), [1.0, 1.0], "control: out of reach");
    // A scene of spheres alone: there is no tree of triangles.
    assert_eq!(open(&mut rays, &world(false), 9.0)[1], 1.0);
}

#[test]
fn mirrors_that_are_spheres_show_what_the_processors_do() {
    let world = still();
    let shot = seen(&world);
    let params = RayParams { depth: 4, ..RayParams::default() };
    let both = both_of(&world, &shot, RayProgram::Reflection, Fidelity::Corrected, params);
    let Some([found, expected]) = both else { return };
    let off = differing(&found, &expected, 1e-3);
    assert!(off <= (SIDE * SIDE) as usize / 400, "{off} pixels are off");
    let changed = expected.iter().zip(&shot.color).filter(|(pixel, color)| *pixel != *color).count();
    assert!(changed > 300, "{changed} pixels show a mirror");
}

#[test]
fn several_lights_fall_on_spheres_as_on_the_processor() {
    let world = World { sun: None, lights: lamps(), ..still() };
    let shot = seen(&world);
    let params = RayParams::default();
    let both = both_of(&world, &shot, RayProgram::DeferredShadows, Fidelity::Corrected, params);
    let Some([found, expected]) = both else { return };
    let off = differing(&found, &expected, 1e-4);
    assert!(off <= (SIDE * SIDE) as usize / 400, "{off} pixels are off");
    let dark = expected.iter().filter(|pixel| pixel[0] < 0.9).count();
    assert!(dark > 100, "{dark} pixels in shadow");
}

#[test]
fn shares_on_spheres_are_averaged_as_on_the_processor() {
    let world = still();
    let shot = seen(&world);
    let params = RayParams { sun: 12.0, sun_samples: 4, filter: 2, ..RayParams::default() };
    let both = both_of(&world, &shot, RayProgram::DeferredShadows, Fidelity::Corrected, params);
    let Some([found, expected]) = both else { return };
    let off = differing(&found, &expected, 1e-3);
    assert!(off <= (SIDE * SIDE) as usize / 200, "{off} pixels are off");
    let levels: std::collections::BTreeSet<_> = expected.iter().map(|pixel| (pixel[0] * 1e4) as i32).collect();
    assert!(levels.len() > 50, "control: {} shades", levels.len());
}

/// Ten thousand spheres that form a cloud.
fn cloud() -> World {
    let mut world = World::lit_along(Vec3::new(0.4, -1.0, -0.3));
    let (ground, ball) = (world.paint(Vec3::ONE), world.paint(Vec3::new(0.9, 0.5, 0.2)));
    world.quad(ground, Vec3::NEG_Y * 3.5, Vec3::X * 9.0, Vec3::NEG_Z * 9.0);
    let mut random = super::functions::Random(5);
    for _ in 0..10_000 {
        world.sphere(ball, random.vector() * 3.0, 0.02 + 0.04 * random.unit());
    }
    world
}

#[test]
fn ten_thousand_spheres_are_the_processors() {
    let world = cloud();
    let eye = Vec3::new(0.5, 2.5, 9.0);
    let shot = Shot::of(&world, eye, grid(SIDE, Vec3::ZERO, Vec3::X * 3.6, Vec3::Y * 3.6)).rows(SIDE);
    let balls = shot.triangle.iter().filter(|id| **id != u32::MAX && **id >= 2).count();
    assert!(balls > 2000, "{balls} pixels show spheres");
    let Some(mut rays) = rays_in_turn() else { return };
    let fidelity = Fidelity::Corrected;
    let [found, expected] =
        both_on(&mut rays, &world, &shot, RayProgram::DeferredShadows, fidelity, RayParams::default());
    let dark = expected.iter().filter(|pixel| pixel[0] < 1.0).count();
    assert!(dark > 500, "{dark} pixels in shadow");
    let off = differing(&found, &expected, 0.0);
    assert!(off <= 2, "{off} pixels are off");
    let params = RayParams { samples: 8, radius: 0.5, ..RayParams::default() };
    let [found, expected] = both_on(&mut rays, &world, &shot, RayProgram::Ssao, fidelity, params);
    let off = differing(&found, &expected, 1e-6);
    assert!(off <= (SIDE * SIDE) as usize / 200, "{off} pixels are off");
}

#[test]
fn thesis_fidelity_and_coordinates_that_overflow_are_refused_by_name() {
    let Some(mut rays) = rays_in_turn() else { return };
    assert!(rays.traces_spheres() && CpuRays::new().traces_spheres());
    let world = still();
    let shot = seen(&world);
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    rays.build(&scene, &vec![true; scene.materials.len()]).expect("built");
    let mut output = Image::filled(SIDE, SIDE, [0.0; 4]);
    let job = RayJob { scene: &scene, ..shot.job(RayProgram::DeferredShadows, Fidelity::Thesis, RayParams::default()) };
    let refused = rays.run(&job, &mut output, &Progress::default()).expect_err("triangles only").to_string();
    assert!(refused.contains("exact spheres") && refused.contains("corrected"), "{refused}");
    let mut far = still();
    far.sphere(0, Vec3::X * 1e16, 1.0);
    let refused = rays.build(&Arc::new(far.scene), &[]).expect_err("it overflows").to_string();
    assert!(refused.contains("exact spheres with coordinates beyond"), "{refused}");
}
