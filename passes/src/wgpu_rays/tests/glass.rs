//! Glass as defined by each material, textures that do not repeat and surfaces that emit light, compared with the processor.

use super::pictures::differing;
use super::{picture, rays};
use crate::cpu::CpuRays;
use crate::effects::tests::world::{Shot, World, grid};
use curitiba_pipeline::backend::{Glow, RayBackend, RayJob};
use curitiba_pipeline::glass::{Dielectric, GlassRule, GlassShadow, Shape};
use curitiba_pipeline::programs::{Fidelity, Fresnel, RayParams, RayProgram};
use curitiba_pipeline::scene::RenderScene;
use curitiba_pipeline::scene::texture::Wrap;
use glam::Vec3;
use std::sync::Arc;

const SIDE: u32 = 64;
/// Number of pixels that may differ by more than a hundredth, where the last bit of a direction decides what a ray hits.
const FEW: usize = (SIDE * SIDE) as usize / 200;

fn solid(index: f32) -> Dielectric {
    Dielectric { shape: Shape::Solid, index, filter: Vec3::ONE, ..Dielectric::default() }
}

/// A box with six outward faces.
fn block(world: &mut World, material: u32, center: Vec3, half: Vec3) {
    for (x, y, z) in [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)] {
        for side in [1.0, -1.0] {
            world.quad(material, center + z * half * side, x * half * side, y * half);
        }
    }
}

/// Tinted, veiled and overlapping bodies, one inside another, an absorbing wall and a pane, over a floor with a textured block.
fn several() -> World {
    let mut world = World { beyond: Vec3::new(0.2, 0.5, 0.9), ..World::lit_along(Vec3::new(-0.4, -0.8, -0.5)) };
    let floor = world.paint(Vec3::new(0.8, 0.7, 0.5));
    block(&mut world, floor, Vec3::new(0.0, -2.0, 0.0), Vec3::new(9.0, 0.2, 9.0));
    let tinted = world.dielectric(Dielectric { extinction: Vec3::new(0.1, 0.4, 0.9), ..solid(1.5) });
    block(&mut world, tinted, Vec3::new(-1.6, 0.2, 0.3), Vec3::new(0.9, 1.1, 0.8));
    let water = world.dielectric(solid(1.33));
    block(&mut world, water, Vec3::new(-1.6, 0.1, 0.3), Vec3::new(0.5, 0.6, 0.4));
    let veiled = Dielectric { veil: 0.3, filter: Vec3::new(0.9, 1.0, 0.8), priority: 1, ..solid(1.8) };
    let veiled = world.dielectric(veiled);
    block(&mut world, veiled, Vec3::new(1.3, -0.6, -0.4), Vec3::new(0.7, 0.8, 0.7));
    let light = world.dielectric(solid(1.2));
    block(&mut world, light, Vec3::new(1.9, -0.5, -0.3), Vec3::new(0.8, 0.4, 0.5));
    let wall = world.dielectric(Dielectric {
        shape: Shape::Thin,
        index: 1.5,
        thickness: 0.2,
        extinction: Vec3::new(2.0, 0.5, 0.1),
        filter: Vec3::new(1.0, 0.8, 0.9),
        ..Dielectric::default()
    });
    world.quad(wall, Vec3::new(0.1, 0.6, 1.6), Vec3::X * 0.7, Vec3::Y * 1.1);
    let pane = world.glass();
    world.quad(pane, Vec3::new(2.2, 1.2, 1.5), Vec3::X * 0.6, Vec3::Y * 0.7);
    let red = world.paint(Vec3::new(0.9, 0.1, 0.2));
    block(&mut world, red, Vec3::new(0.3, 0.4, -3.0), Vec3::new(0.8, 1.2, 0.4));
    world
}

/// Pictures of a world from both backends; compares and prints ray counts.
fn both(world: &World, eye: Vec3, program: RayProgram, params: RayParams) -> Option<[Vec<[f32; 4]>; 2]> {
    let mut rays = rays()?;
    let targets = grid(SIDE, eye - Vec3::Z * 4.0, Vec3::X * 2.6, Vec3::Y * 2.2);
    let shot = Shot::of(world, eye, targets).rows(SIDE);
    // A job identifies its scene by address.
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let job = RayJob { scene: &scene, ..shot.job(program, Fidelity::Corrected, params) };
    let mut cpu = CpuRays::new();
    let filtered = vec![true; scene.materials.len()];
    rays.build(&scene, &filtered).expect("built");
    cpu.build(&scene, &filtered).expect("built");
    let ((found, mine), (expected, theirs)) = (picture(&mut rays, &job), picture(&mut cpu, &job));
    let counts = |rays: curitiba_pipeline::backend::RayCounts| [rays.reflected, rays.refracted];
    println!("{program:?}: {:?} {:?}", mine.rays, theirs.rays);
    for (mine, theirs) in counts(mine.rays).into_iter().zip(counts(theirs.rays)) {
        assert!(mine.abs_diff(theirs) <= theirs / 100 + 2, "{mine} rays, and {theirs} on the processor");
    }
    Some([found, expected])
}

fn auto(depth: u32, shadow: GlassShadow, samples: u32) -> RayParams {
    RayParams { glass: GlassRule::Auto, depth, shadow, samples, radius: 1.5, ..RayParams::default() }
}

#[test]
fn bodies_walls_and_panes_show_what_the_processors_do() {
    let world = several();
    let eye = Vec3::new(0.2, 0.4, 7.0);
    for (program, params) in [
        (RayProgram::Refraction, auto(5, GlassShadow::Report, 0)),
        (RayProgram::Refraction, RayParams { fresnel: Fresnel::Schlick, ..auto(1, GlassShadow::Report, 0) }),
        // Several kernels, one after the other; the last one contains everything that a single kernel would. Software drivers take seconds
        // to compile each.
        (RayProgram::Final, auto(4, GlassShadow::Straight, 2)),
        (RayProgram::Final, auto(4, GlassShadow::Report, 2)),
    ] {
        let Some([found, expected]) = both(&world, eye, program, params) else { return };
        let off = differing(&found, &expected, 0.01);
        assert!(off <= FEW, "{program:?} {params:?}: {off} pixels are off");
        let changed = expected.iter().filter(|pixel| **pixel != expected[0]).count();
        assert!(changed > 1000, "{changed} pixels show something");
    }
}

#[test]
fn panes_before_a_background_show_it() {
    let mut world = World { beyond: Vec3::new(0.3, 0.6, 0.9), ..World::lit_along(Vec3::NEG_Y) };
    let pane = world.glass();
    world.quad(pane, Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0);
    world.quad(pane, Vec3::new(0.5, 0.2, -1.0), Vec3::X * 2.0, Vec3::new(0.0, 1.5, 0.4));
    for program in [RayProgram::Reflection, RayProgram::Refraction] {
        let params = RayParams { depth: 1, samples: 0, ..RayParams::default() };
        let Some([found, expected]) = both(&world, Vec3::new(0.1, 0.3, 5.0), program, params) else { return };
        assert_eq!(differing(&found, &expected, 1e-4), 0, "{program:?}");
        let blue = expected.iter().filter(|pixel| pixel[2] > 0.8 && pixel[0] < 0.4).count();
        assert!(blue > 500, "{program:?}: {blue} pixels show the background in or through glass");
    }
}

#[test]
fn the_camera_may_be_in_a_body() {
    let mut world = World { beyond: Vec3::splat(0.8), ..World::lit_along(Vec3::NEG_Y) };
    let water = world.dielectric(Dielectric { extinction: Vec3::new(0.3, 0.1, 0.02), ..solid(1.33) });
    block(&mut world, water, Vec3::ZERO, Vec3::splat(2.0));
    let bubble = world.dielectric(Dielectric { priority: 1, ..solid(1.0) });
    block(&mut world, bubble, Vec3::new(0.2, 0.1, -0.8), Vec3::splat(0.4));
    let params = auto(6, GlassShadow::Report, 0);
    let Some([found, expected]) = both(&world, Vec3::new(0.1, 0.2, 1.5), RayProgram::Refraction, params) else {
        return;
    };
    let off = differing(&found, &expected, 0.01);
    assert!(off <= FEW, "{off} pixels are off");
    // Control: with a camera taken to be in air, refraction and absorption differ.
    let outside = World { dielectrics: vec![solid(1.33), solid(1.0)], ..world };
    let Some([other, _]) = both(&outside, Vec3::new(0.1, 0.2, 1.5), RayProgram::Refraction, params) else { return };
    assert!(differing(&other, &expected, 0.01) > 10 * FEW, "absorption is seen");
}

#[test]
fn textures_that_do_not_repeat_and_light_of_surfaces_are_seen_in_mirrors() {
    let mut world = World::lit_along(Vec3::new(-0.3, -0.5, -1.0));
    let mut scene = |wrap: [Wrap; 2], place: Vec3| {
        let material = world.picture([[255, 30, 60, 255], [20, 90, 250, 255]], None);
        let textures = &mut world.scene.textures;
        let texture = textures.pop().expect("just made").wrapped(wrap);
        textures.push(texture);
        let glow = textures.len() as u32 - 1;
        world.shades[material as usize].glow = Some(Glow { color: Vec3::new(0.5, 0.25, 0.1), texture: Some(glow) });
        let first = world.scene.geometry.texcoords.len();
        world.quad(material, place, Vec3::X * 0.9, Vec3::Y * 0.9);
        world.scene.geometry.texcoords[first..].iter_mut().for_each(|uv| *uv = *uv * 3.0 - 1.0);
    };
    scene([Wrap::Clamp, Wrap::Repeat], Vec3::new(-1.0, 1.0, 8.0));
    scene([Wrap::Mirror, Wrap::Clamp], Vec3::new(1.0, 1.0, 8.0));
    scene([Wrap::Repeat, Wrap::Mirror], Vec3::new(-1.0, -1.0, 8.0));
    let plain = world.paint(Vec3::new(0.2, 0.8, 0.3));
    world.shades[plain as usize].glow = Some(Glow { color: Vec3::new(0.0, 0.4, 0.9), texture: None });
    world.quad(plain, Vec3::new(1.0, -1.0, 8.0), Vec3::X * 0.9, Vec3::Y * 0.9);
    let mirror = world.glass();
    world.quad(mirror, Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0);
    let Some([found, expected]) = both(&world, Vec3::new(0.0, 0.0, 5.0), RayProgram::Reflection, RayParams::default())
    else {
        return;
    };
    assert_eq!(differing(&found, &expected, 1e-5), 0);
    let seen = expected.iter().filter(|pixel| pixel[0] + pixel[1] + pixel[2] > 0.5).count();
    assert!(seen > 500, "{seen} pixels show what shines");
}
