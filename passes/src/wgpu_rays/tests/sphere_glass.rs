//! Exact spheres of glass, alone and beside glass of triangles, compared with the processor and with closed forms.

use super::glass::{FEW, auto, both, picture_on, several, several_of, solid, ways};
use super::pictures::differing;
use super::rays_in_turn;
use crate::effects::tests::world::{Shot, World};
use crate::wgpu_rays::WgpuRays;
use curitiba_pipeline::backend::{RayBackend, RayJob};
use curitiba_pipeline::glass::{Dielectric, GlassShadow, Shape};
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram, TextureLod};
use curitiba_pipeline::scene::RenderScene;
use glam::Vec3;
use std::sync::Arc;

const EYE: Vec3 = Vec3::new(0.2, 0.4, 7.0);

/// Adds spheres to a world of triangles: an absorbing one; a core and a bubble that overlap it, which have precedence over it; a bubble in the tinted
/// block, a bead in a block of triangles, a thin one, a veiled one, and an opaque one.
fn with_spheres(mut world: World) -> World {
    let sigma = Vec3::new(0.1, 0.4, 0.9);
    let shell = world.dielectric(Dielectric { extinction: sigma, priority: 1, ..solid(1.5) });
    world.sphere(shell, Vec3::new(0.3, 0.9, 2.0), 0.8);
    let core = world.dielectric(Dielectric { priority: 2, extinction: sigma.zyx(), ..solid(1.33) });
    world.sphere(core, Vec3::new(0.9, 1.1, 2.1), 0.5);
    let air = world.dielectric(Dielectric { priority: 3, ..solid(1.0) });
    world.sphere(air, Vec3::new(0.1, 0.9, 2.0), 0.3);
    world.sphere(air, Vec3::new(-1.6, 0.9, 0.6), 0.25);
    let bead = world.dielectric(Dielectric { priority: 4, extinction: Vec3::splat(0.5), ..solid(2.4) });
    world.sphere(bead, Vec3::new(1.3, -0.6, -0.2), 0.4);
    let film = world.dielectric(Dielectric { shape: Shape::Thin, thickness: 0.1, ..solid(1.4) });
    world.sphere(film, Vec3::new(-0.5, -1.2, 2.2), 0.5);
    let veiled = world.dielectric(Dielectric { veil: 0.4, filter: Vec3::new(1.0, 0.6, 0.8), ..solid(1.6) });
    world.sphere(veiled, Vec3::new(1.0, -1.3, 2.0), 0.4);
    let red = world.paint(Vec3::new(0.9, 0.2, 0.1));
    world.sphere(red, Vec3::new(-0.6, 0.1, -2.0), 0.7);
    world
}

trait Swizzle {
    fn zyx(self) -> Self;
}

impl Swizzle for Vec3 {
    fn zyx(self) -> Self {
        Self::new(self.z, self.y, self.x)
    }
}

#[test]
fn spheres_and_bodies_of_triangles_show_what_the_processors_do() {
    let world = with_spheres(several());
    for (program, params) in [
        (RayProgram::Refraction, auto(5, GlassShadow::Report, 0)),
        (RayProgram::Refraction, RayParams { texture_lod: TextureLod::Cones, ..auto(3, GlassShadow::Report, 0) }),
        // One kernel; software drivers take seconds to compile each.
        (RayProgram::Final, auto(3, GlassShadow::Straight, 0)),
    ] {
        let Some([found, expected]) = both(&world, EYE, program, params) else { return };
        let off = differing(&found, &expected, 0.01);
        println!("{program:?}: {off} pixels are off by more than a hundredth");
        assert!(off <= FEW, "{program:?} {params:?}: {off} pixels are off");
        let (without, _) = picture_on(&mut crate::cpu::CpuRays::new(), &several(), EYE, program, params);
        let changed = differing(&without, &expected, 0.02);
        assert!(changed > 10 * FEW, "{program:?}: {changed} pixels show spheres");
    }
}

#[test]
fn spheres_that_are_rough_or_bend_colours_apart_are_the_processors() {
    let world = |rough: bool| {
        let alpha = if rough { 0.2 } else { 0.0 };
        let spread = if rough { 0.1 } else { 0.0 };
        let mut world = several_of(ways([0.0; 3], [0.0; 3]));
        let frosted = world.dielectric(Dielectric { alpha, ..solid(1.5) });
        world.sphere(frosted, Vec3::new(-0.5, -0.4, 2.2), 0.8);
        let flint = world.dielectric(Dielectric { spread, ..solid(1.7) });
        world.sphere(flint, Vec3::new(0.9, 0.9, 2.0), 0.7);
        world
    };
    let params = RayParams { paths: 3, first_path: 8, wavelengths: 3, ..auto(2, GlassShadow::Report, 0) };
    let Some([found, expected]) = both(&world(true), EYE, RayProgram::Refraction, params) else { return };
    let off = differing(&found, &expected, 0.01);
    assert!(off <= FEW, "{off} pixels are off");
    let (smooth, _) = picture_on(&mut crate::cpu::CpuRays::new(), &world(false), EYE, RayProgram::Refraction, params);
    assert!(differing(&smooth, &expected, 0.003) > 5 * FEW, "control: it is seen");
}

/// The colour that the program `refraction` gives a pixel that looks from `eye` along `direction`.
fn look(rays: &mut WgpuRays, world: &World, eye: Vec3, direction: Vec3, params: RayParams) -> Vec3 {
    let shot = Shot::of(world, eye, [eye + direction]);
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let job = RayJob { scene: &scene, ..shot.job(RayProgram::Refraction, Fidelity::Corrected, params) };
    rays.build(&scene, &vec![true; scene.materials.len()]).expect("built");
    Vec3::from_slice(&super::picture(rays, &job).0[0])
}

/// The reflectance of an interface between air and this index for a ray at impact `b` (in radii), and the length of the path inside.
fn impact(b: f64, index: f64) -> (f64, f64) {
    let (outer, inner) = ((1.0 - b * b).sqrt(), (1.0 - b * b / (index * index)).sqrt());
    let across = (outer - index * inner) / (outer + index * inner);
    let along = (index * outer - inner) / (index * outer + inner);
    (0.5 * (across * across + along * along), 2.0 * inner)
}

/// The colour is R + (1-R)² a / (1 - R a), with a = exp(-sigma 2 r cos t). Through the centre of a sphere of index 1 it is exp(-sigma 2 r).
#[test]
fn a_sphere_in_a_white_environment_has_the_closed_form() {
    let Some(mut rays) = rays_in_turn() else { return };
    for (scale, offset) in [(1.0_f32, Vec3::ZERO), (250.0, Vec3::splat(300.0)), (1e-3, Vec3::new(0.02, -0.01, 0.03))] {
        for index in [1.0, 1.5, 2.42] {
            let sigma = Vec3::new(0.0, 0.5, 2.0) / scale;
            let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
            let glass = world.dielectric(Dielectric { extinction: sigma, ..solid(index) });
            world.sphere(glass, offset, scale);
            for b in [0.0, 0.5, 0.9] {
                let eye = offset + Vec3::new(0.6 * b, 0.8 * b, 3.0) * scale;
                let from = (eye - offset).as_dvec3().truncate().length() / f64::from(scale);
                let (r, length) = impact(from, index.into());
                let white = |sigma: f32| {
                    let a = (-f64::from(sigma * scale) * length).exp();
                    (r + (1.0 - r).powi(2) * a / (1.0 - r * a)) as f32
                };
                let expected = Vec3::new(white(sigma.x), white(sigma.y), white(sigma.z));
                let found = look(&mut rays, &world, eye, Vec3::NEG_Z, auto(16, GlassShadow::Report, 0));
                // Positions are rounded to 2^-24 of the sphere's coordinates, not of its size.
                let allowed = 5e-6 * (1.0 + 0.3 * offset.abs().max_element() / scale);
                assert!((found - expected).abs().max_element() <= allowed, "{scale} {index} {b}: {found} {expected}");
                if b == 0.0 && index == 1.0 {
                    let through = (-2.0 * sigma * scale).exp();
                    assert!((found - through).abs().max_element() < allowed, "{found}: exp(-sigma 2 r)");
                }
                // Control: another index, and half of the path.
                let (other, _) = impact(from, f64::from(index) * 1.02);
                let half = (-0.5 * f64::from(sigma.y * scale) * length).exp() as f32;
                assert!((f64::from(expected.y) - f64::from(half)).abs() > 1e-2 && (other != r || b == 0.0), "control");
            }
        }
    }
}

#[test]
fn a_camera_in_a_sphere_sees_out_of_it() {
    let Some(mut rays) = rays_in_turn() else { return };
    for index in [1.33_f64, 1.5] {
        let sigma = Vec3::new(0.0, 0.3, 1.0);
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
        let glass = world.dielectric(Dielectric { extinction: sigma, ..solid(index as f32) });
        world.sphere(glass, Vec3::new(4.0, 5.0, 6.0), 2.0);
        for share in [0.0, 0.3, 0.6 / index] {
            let eye = Vec3::new(4.0 + 2.0 * share as f32, 5.0, 6.0);
            let share = f64::from(eye.x - 4.0) / 2.0;
            let (r, _) = impact(share * index, index);
            let half = 2.0 * (1.0 - share * share).sqrt();
            let expected = sigma.to_array().map(|sigma| {
                let (half, whole) = ((-f64::from(sigma) * half).exp(), (-2.0 * f64::from(sigma) * half).exp());
                (half * (1.0 - r) / (1.0 - r * whole)) as f32
            });
            let found = look(&mut rays, &world, eye, Vec3::Z, auto(16, GlassShadow::Report, 0));
            assert!((found - Vec3::from(expected)).abs().max_element() < 6e-6, "{index} {share}: {found} {expected:?}");
            // Control: from outside, the path is twice as long.
            assert!(share > 0.0 || (found.z - (-4.0_f32).exp()).abs() > 0.05, "{found}");
        }
    }
}

/// A bubble in a sphere of glass: only the path through the glass around the bubble absorbs light.
#[test]
fn a_bubble_in_a_sphere_takes_the_glass_out_of_the_way() {
    let Some(mut rays) = rays_in_turn() else { return };
    let sigma = Vec3::new(0.3, 0.7, 1.5);
    let of = |bubble: f32| {
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
        // The index is 1 throughout, so that nothing is reflected: the path through the glass is 2 R - 2 r on the axis, and absorbs
        // exp(-sigma (2 R - 2 r)).
        let wall = world.dielectric(Dielectric { extinction: sigma, ..solid(1.0) });
        let air = world.dielectric(Dielectric { priority: 1, ..solid(1.0) });
        world.sphere(wall, Vec3::ZERO, 1.0);
        if bubble > 0.0 {
            world.sphere(air, Vec3::ZERO, bubble);
        }
        world
    };
    for bubble in [0.0, 0.3, 0.8] {
        for b in [0.0_f32, 0.2, 0.6] {
            let inside = (bubble * bubble - b * b).max(0.0).sqrt();
            let way = 2.0 * ((1.0 - b * b).sqrt() - inside);
            let found =
                look(&mut rays, &of(bubble), Vec3::new(b, 0.0, 4.0), Vec3::NEG_Z, auto(8, GlassShadow::Report, 0));
            let expected = (-sigma * way).exp();
            assert!((found - expected).abs().max_element() < 4e-6, "{bubble} {b}: {found} {expected}");
            let filled = (-sigma * 2.0 * (1.0 - b * b).sqrt()).exp();
            assert!(inside == 0.0 || (found - filled).abs().max_element() > 0.02, "control: {bubble} {b}");
        }
    }
}

/// A shadow through a sphere of glass: (1 - F(cos i))² exp(-2 sigma cos i). Spheres of index 1 throw no shadow.
#[test]
fn straight_shadows_of_spheres_have_the_closed_form() {
    let Some(mut rays) = rays_in_turn() else { return };
    let world = |index: f32, sigma: Vec3| {
        let mut world = World::lit_along(Vec3::NEG_Z);
        let glass = world.dielectric(Dielectric { extinction: sigma, ..solid(index) });
        world.sphere(glass, Vec3::new(0.0, 0.0, 2.0), 1.0);
        let ground = world.paint(Vec3::ONE);
        world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
        world
    };
    let shares: [f32; 8] = [0.0, 0.3, 0.6, 0.7, 0.8, 0.9, 0.99, 1.2];
    let mut light = |world: &World| {
        let shot = Shot::of(world, Vec3::new(0.3, 0.4, 0.2), shares.map(|b| Vec3::new(0.6 * b, 0.8 * b, 0.0)));
        let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
        let params = auto(2, GlassShadow::Straight, 0);
        let job = RayJob { scene: &scene, ..shot.job(RayProgram::Final, Fidelity::Corrected, params) };
        rays.build(&scene, &vec![true; scene.materials.len()]).expect("built");
        let (pixels, _) = super::picture(&mut *rays, &job);
        let share =
            |(pixel, color): (&[f32; 4], &[f32; 4])| (Vec3::from_slice(pixel) / Vec3::from_slice(color) - 0.5) * 2.0;
        pixels.iter().zip(&shot.color).map(share).collect::<Vec<_>>()
    };
    let sigma = Vec3::new(0.0, 0.5, 1.5);
    for (b, found) in shares.into_iter().zip(light(&world(1.5, sigma))) {
        let (r, _) = if b < 1.0 { impact(b.into(), 1.5) } else { (0.0, 0.0) };
        let cos = f64::from(1.0 - b * b).max(0.0).sqrt();
        let expected = sigma.to_array().map(|sigma| ((1.0 - r).powi(2) * (-2.0 * f64::from(sigma) * cos).exp()) as f32);
        let allowed = if b == 0.99 { 1e-4 } else { 1e-5 };
        assert!((found - Vec3::from(expected)).abs().max_element() < allowed, "{b}: {found} {expected:?}");
    }
    let none = light(&world(1.0, Vec3::ZERO));
    assert!(none.iter().all(|share| (*share - Vec3::ONE).abs().max_element() < 1e-5), "index 1 is not there: {none:?}");
}
