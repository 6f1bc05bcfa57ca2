//! Several lights, lights with a place, and lights that are discs, compared with the processor's.

use super::pictures::{both_of, both_on, differing, world};
use super::rays_in_turn;
use crate::effects::tests::world::{Shot, World, grid};
use curitiba_pipeline::backend::{Cone, Light};
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram, TextureLod};
use glam::{Vec3, Vec4};

const SIDE: u32 = 64;
/// Number of pixels that may differ by more than a hundredth, where the last bit of a direction decides what a ray hits.
const FEW: usize = (SIDE * SIDE) as usize / 500;

/// A directional light, a lamp whose light ends, a spot light with a soft edge, and a spot light with a sharp edge whose light decreases
/// away from the axis.
pub(super) fn lamps() -> Vec<Light> {
    let spot = |place: Vec3, cone: Cone| Light {
        place: Some(place),
        direction: -place.normalize(),
        color: Vec3::new(0.2, 0.5, 1.4),
        attenuation: [1.0, 0.02, 0.0],
        range: f32::INFINITY,
        cone: Some(cone),
    };
    vec![
        Light {
            place: None,
            direction: Vec3::new(0.4, -1.0, 0.3).normalize(),
            color: Vec3::new(0.3, 0.3, 0.25),
            attenuation: [1.0, 0.0, 0.0],
            range: f32::INFINITY,
            cone: None,
        },
        Light {
            place: Some(Vec3::new(-2.5, 1.5, 4.5)),
            direction: Vec3::ZERO,
            color: Vec3::new(1.5, 0.5, 0.1),
            attenuation: [0.3, 0.0, 0.08],
            range: 9.0,
            cone: None,
        },
        spot(Vec3::new(3.0, 4.5, 5.0), Cone { inner: 0.9, outer: 0.7, exponent: 0.0 }),
        spot(Vec3::new(-1.0, 6.0, 3.0), Cone { inner: 0.8, outer: 0.8, exponent: 6.5 }),
    ]
}

/// The world of the picture tests under these lights, without a sun. Its textured surfaces emit light of one colour.
fn lit_by(lights: Vec<Light>) -> World {
    let mut world = World { sun: None, lights, ..world() };
    for shade in world.shades.iter_mut().filter(|shade| shade.texture.is_some()) {
        shade.emission = Vec4::new(0.3, 0.1, 0.0, 0.0);
    }
    world
}

fn shot(world: &World) -> Shot<'_> {
    let targets = grid(SIDE, Vec3::ZERO, Vec3::X * 4.5, Vec3::Y * 4.5);
    Shot::of(world, Vec3::new(0.3, 0.8, 9.0), targets).rows(SIDE)
}

/// Compares a program on both backends; returns the picture.
fn agrees(program: RayProgram, params: RayParams) -> Option<Vec<[f32; 4]>> {
    let world = lit_by(lamps());
    let [found, expected] = both_of(&world, &shot(&world), program, Fidelity::Corrected, params)?;
    let off = differing(&found, &expected, 0.01);
    assert!(off <= FEW, "{program:?} {params:?}: {off} pixels are off");
    Some(found)
}

/// Checks that the picture changes if any one of the lights is removed.
fn shows_each_light(found: &[[f32; 4]], program: RayProgram, params: RayParams) {
    for left_out in 0..lamps().len() {
        let mut fewer = lamps();
        fewer.remove(left_out);
        let world = lit_by(fewer);
        let shot = shot(&world);
        let (without, _) = shot.run_on(&world.tree(), &shot.job(program, Fidelity::Corrected, params));
        let changed = differing(found, &without, 0.01);
        assert!(changed > 4 * FEW, "{program:?} without light {left_out}: {changed} pixels change");
    }
}

#[test]
fn each_light_throws_the_shadows_of_the_processor() {
    let (program, params) = (RayProgram::DeferredShadows, RayParams::default());
    let Some(found) = agrees(program, params) else { return };
    shows_each_light(&found, program, params);
}

#[test]
fn mirrors_show_what_several_lights_light() {
    let cones = RayParams { texture_lod: TextureLod::Cones, ..RayParams::default() };
    let Some(found) = agrees(RayProgram::Reflection, cones) else { return };
    shows_each_light(&found, RayProgram::Reflection, cones);
}

/// The lamps with a second directional light.
fn two_suns() -> Vec<Light> {
    let mut lights = lamps();
    let direction = Vec3::new(-0.5, -1.0, -0.2).normalize();
    lights.push(Light { direction, color: Vec3::new(0.1, 0.2, 0.5), ..lights[0] });
    lights
}

fn soft(sun_samples: u32) -> RayParams {
    RayParams { sun: 8.0, sun_samples, ..RayParams::default() }
}

#[test]
fn discs_throw_the_soft_shadows_of_the_processor() {
    let (program, fidelity) = (RayProgram::DeferredShadows, Fidelity::Corrected);
    for world in [world(), lit_by(lamps()), lit_by(two_suns())] {
        let shot = shot(&world);
        let Some([found, expected]) = both_of(&world, &shot, program, fidelity, soft(9)) else { return };
        let count = world.lights.len();
        let off = differing(&found, &expected, 0.01);
        assert!(off <= FEW, "{count} lights: {off} pixels are off");
        let (hard, _) = shot.run_on(&world.tree(), &shot.job(program, fidelity, RayParams::default()));
        let changed = differing(&found, &hard, 0.01);
        assert!(changed > 20 * FEW, "{count} lights: {changed} pixels are in a penumbra");
    }
}

/// `final` runs in several kernels. The last kernel contains all the code that a single kernel would.
#[test]
fn all_effects_together_know_several_lights_and_discs() {
    let Some(mut rays) = rays_in_turn() else { return };
    let hard = RayParams { samples: 9, radius: 1.5, ..RayParams::default() };
    let soft = RayParams { sun: 8.0, sun_samples: 4, ..hard };
    for (world, params) in [(lit_by(lamps()), hard), (lit_by(two_suns()), soft), (world(), soft)] {
        let shot = shot(&world);
        let [found, expected] = both_on(&mut rays, &world, &shot, RayProgram::Final, Fidelity::Corrected, params);
        let off = differing(&found, &expected, 0.01);
        assert!(off <= FEW, "{} lights, sun {}: {off} pixels are off", world.lights.len(), params.sun);
    }
}
