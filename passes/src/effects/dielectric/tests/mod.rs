//! Closed forms of bodies of glass, traced.

mod ball;
mod caustics;
mod dispersion;
mod inside;
mod limits;
mod own;
mod photons;
mod rough;
mod shells;
mod spheres;

use crate::effects::fresnel;
use crate::effects::tests::world::{Shot, World, assert_close};
use curitiba_pipeline::backend::{RayCounts, RayJob};
use curitiba_pipeline::glass::{Dielectric, GlassRule, GlassShadow, Shape};
use curitiba_pipeline::programs::Fidelity::Corrected;
use curitiba_pipeline::programs::{RayParams, RayProgram};
use glam::{Vec3, Vec4};

const FRONT: Vec3 = Vec3::new(0.9, 0.2, 0.1);
const BEHIND: Vec3 = Vec3::new(0.1, 0.6, 0.3);

fn solid(index: f32, extinction: Vec3) -> Dielectric {
    Dielectric { shape: Shape::Solid, index, extinction, filter: Vec3::ONE, ..Dielectric::default() }
}

fn thin(index: f32) -> Dielectric {
    Dielectric { shape: Shape::Thin, ..solid(index, Vec3::ZERO) }
}

/// Six sides that face outwards, or inwards.
fn block(world: &mut World, material: u32, center: Vec3, half: Vec3, outwards: bool) {
    for (x, y, z) in [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)] {
        for side in [1.0, -1.0] {
            let turned = if outwards { side } else { -side };
            world.quad(material, center + z * half * side, x * half * turned, y * half);
        }
    }
}

/// A ball of eight times 4^levels triangles with the normals of a sphere.
fn ball(world: &mut World, material: u32, center: Vec3, radius: f32, levels: u32) {
    fn split(world: &mut World, material: u32, at: (Vec3, f32), corners: [Vec3; 3], levels: u32) {
        let [a, b, c] = corners;
        if levels == 0 {
            return world.triangle(material, corners.map(|corner| at.0 + corner * at.1), corners);
        }
        let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
        for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            split(world, material, at, part, levels - 1);
        }
    }
    for signs in 0..8 {
        let sign = |bit: u32| if signs >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let [x, y, z] = [Vec3::X * sign(0), Vec3::Y * sign(1), Vec3::Z * sign(2)];
        let corners = if sign(0) * sign(1) * sign(2) > 0.0 { [x, y, z] } else { [x, z, y] };
        split(world, material, (center, radius), corners, levels);
    }
}

fn auto(depth: u32) -> RayParams {
    RayParams { glass: GlassRule::Auto, depth, samples: 0, ..RayParams::default() }
}

fn look(world: &World, eye: Vec3, direction: Vec3, params: RayParams) -> ([f32; 4], RayCounts) {
    let shot = Shot::of(world, eye, [eye + direction]);
    let (pixels, rays) = shot.run_on(&world.tree(), &shot.job(RayProgram::Refraction, Corrected, params));
    (pixels[0], rays)
}

fn down(degrees: f32) -> Vec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Vec3::new(sin, 0.0, -cos)
}

/// In `f64`: reflectance from outside at this angle, and the cosine inside.
fn interface(degrees: f64, index: f64) -> (f64, f64) {
    let cos = degrees.to_radians().cos();
    let inner = (1.0 - (1.0 - cos * cos) / (index * index)).sqrt();
    let (s, p) = ((cos - index * inner) / (cos + index * inner), (index * cos - inner) / (index * cos + inner));
    (0.5 * (s * s + p * p), inner)
}

/// A plate of thickness 1 around z = 0, so wide that no path leaves at its sides, in an environment of 1.
fn plate(dielectric: Dielectric) -> World {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let material = world.dielectric(dielectric);
    block(&mut world, material, Vec3::ZERO, Vec3::new(400.0, 400.0, 0.5), true);
    world
}

#[test]
fn a_plate_between_white_sides_is_the_sum_of_all_its_reflections() {
    let sigma = Vec3::new(0.0, 0.5, 2.0);
    for index in [1.33, 1.5, 2.42] {
        let world = plate(solid(index, sigma));
        for degrees in [0.0, 30.0, 60.0, 80.0] {
            let (pixel, rays) = look(&world, Vec3::new(0.3, 0.4, 5.0), down(degrees), auto(16));
            let (r, inner) = interface(f64::from(degrees), f64::from(index));
            let kept = sigma.as_dvec3().to_array().map(|sigma| (-sigma / inner).exp());
            let expected = kept.map(|a| r + (1.0 - r) * (1.0 - r) * a / (1.0 - r * a));
            // Positions on triangles 800 wide are rounded to 6e-5, and so are the lengths of the paths between them.
            assert_close(pixel, Vec3::from(expected.map(|value| value as f32)), 5e-5, format!("{index} {degrees}"));
            assert_eq!(rays.lost, 0);
            // Control: absorption on the first segment alone gives another value.
            let first_way = r + (1.0 - r) * (1.0 - r) * kept[1] / (1.0 - r);
            assert!((first_way - expected[1]).abs() > 1e-3, "{index} {degrees}");
        }
    }
}

#[test]
fn light_is_trapped_beyond_the_critical_angle_and_passes_below() {
    // From inside a plate of half thickness 1/2: of the light that is left at the face, the share (1-R) / (1 - R a) leaves.
    for index in [1.33_f64, 1.5, 2.42] {
        let sigma = Vec3::new(0.0, 0.3, 1.0);
        let world = plate(solid(index as f32, sigma));
        let critical = (1.0 / index).asin().to_degrees();
        let from_inside = |degrees: f64| look(&world, Vec3::new(0.3, 0.4, 0.0), down(degrees as f32), auto(16));
        for inner in [0.0, 0.5 * critical, critical - 1.0] {
            let outer = (inner.to_radians().sin() * index).asin().to_degrees();
            let (r, cos) = interface(outer, index);
            let expected = sigma.as_dvec3().to_array().map(|sigma| {
                let (half, whole) = ((-0.5 * sigma / cos).exp(), (-sigma / cos).exp());
                half * (1.0 - r) / (1.0 - r * whole)
            });
            let (pixel, rays) = from_inside(inner);
            assert_close(pixel, Vec3::from(expected.map(|value| value as f32)), 3e-5, format!("{index} {inner}"));
            assert_eq!(rays.lost, 0);
        }
        let (pixel, rays) = from_inside(critical + 0.1);
        assert_eq!((pixel, rays.lost, rays.refracted), ([0.0, 0.0, 0.0, 1.0], 1, 0), "trapped, and counted");
    }
}

/// The sum over all inner reflections: R + (1-R)² a / (1 - R a) with a = exp(-2 sigma cos t).
#[test]
fn a_ball_in_a_white_environment_has_the_closed_form() {
    for (index, at_0, at_half, at_09) in
        [(1.5, 0.384_101, 0.405_261, 0.485_812), (1.33, 0.375_954, 0.403_650, 0.501_718)]
    {
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
        let glass = world.dielectric(solid(index, Vec3::new(0.0, 0.5, 0.5)));
        ball(&mut world, glass, Vec3::ZERO, 1.0, 5);
        for (b, expected) in [(0.0, at_0), (0.5, at_half), (0.9, at_09)] {
            let eye = Vec3::new(0.6 * b, 0.8 * b, 3.0) + Vec3::new(1e-4, 2e-4, 0.0);
            let (pixel, _) = look(&world, eye, Vec3::NEG_Z, auto(16));
            // Facets are off by half of the square of their size, about 4e-4; no light is lost whatever they do.
            assert_close(pixel, Vec3::new(1.0, expected, expected), 2e-3, format!("{index} {b}"));
            assert!((pixel[0] - 1.0).abs() < 2e-6, "{pixel:?}");
        }
    }
}

#[test]
fn no_depth_loses_light_and_none_gains_any() {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let [glass, water] = [1.5, 1.33].map(|index| world.dielectric(solid(index, Vec3::ZERO)));
    ball(&mut world, glass, Vec3::ZERO, 1.0, 3);
    ball(&mut world, water, Vec3::new(0.1, 0.0, 0.0), 0.7, 3);
    let wall = world.dielectric(thin(1.5));
    world.quad(wall, Vec3::new(0.0, 0.0, 1.5), Vec3::X * 2.0, Vec3::Y * 2.0);
    let mut lost = 0;
    for depth in [0, 1, 3, 8] {
        for step in 0..20 {
            let eye = Vec3::new(0.05 * step as f32, 0.03, 3.0);
            let (pixel, rays) = look(&world, eye, Vec3::NEG_Z, auto(depth));
            assert!(Vec3::from_slice(&pixel).max_element() < 1.0 + 4e-6, "depth {depth}, step {step}: {pixel:?}");
            lost += u64::from(rays.lost > 0);
            if rays.lost == 0 {
                assert_close(pixel, Vec3::ONE, 4e-6, format!("depth {depth}, step {step}: {rays:?}"));
            }
        }
    }
    assert!(lost <= 2, "of 80 pixels {lost} lost a path that is mirrored for ever between facets");
}

#[test]
fn a_thin_wall_reflects_with_both_faces_and_bends_nothing() {
    let mut world = World::lit_along(Vec3::Y);
    let filter = Vec3::new(1.0, 0.5, 0.25);
    let glass = world.dielectric(Dielectric { filter, ..thin(1.5) });
    let (front, behind) = (world.paint(FRONT), world.paint(BEHIND));
    world.quad(glass, Vec3::ZERO, Vec3::X * 300.0, Vec3::Y * 300.0);
    world.quad(front, Vec3::Z * 9.0, Vec3::X * 900.0, Vec3::NEG_Y * 900.0);
    world.quad(behind, Vec3::Z * -9.0, Vec3::X * 900.0, Vec3::Y * 900.0);
    for degrees in [0.0, 30.0, 60.0, 85.0] {
        let (pixel, rays) = look(&world, Vec3::new(0.3, 0.4, 5.0), down(degrees), auto(5));
        let r = fresnel(degrees.to_radians().cos(), 1.5).reflectance;
        let (mirrored, through) = (2.0 * r / (1.0 + r), (1.0 - r) / (1.0 + r));
        assert_close(pixel, 0.3 * (mirrored * FRONT + through * filter * BEHIND), 2e-6, degrees);
        assert_eq!((rays.reflected, rays.refracted), (1, 1));
        let one_face = 0.3 * (r * FRONT + (1.0 - r) * filter * BEHIND);
        assert!((Vec3::from_slice(&pixel) - one_face).abs().max_element() > 3e-3, "control: {degrees}");
    }
}

#[test]
fn light_that_a_surface_scatters_back_comes_from_its_colour() {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::Y) };
    let glass = world.dielectric(Dielectric { veil: 0.25, ..thin(1.5) });
    world.shades[glass as usize].diffuse = FRONT.extend(1.0);
    world.quad(glass, Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0);
    let (pixel, _) = look(&world, Vec3::new(0.3, 0.4, 5.0), Vec3::NEG_Z, auto(5));
    let (mirrored, through) = (0.08 / 1.04, 0.96 / 1.04);
    assert_close(pixel, mirrored + through * (0.75 + 0.25 * 0.3 * FRONT), 2e-6, "veil");
}

/// The texture multiplies a factor of 0.75. One half of the wall keeps the factor; the other lets nothing pass and is a diffuse surface that
/// mirrors.
#[test]
fn a_texture_of_transmission_multiplies_the_factor_by_its_red_channel() {
    let place = |texels: Option<[[u8; 4]; 2]>| {
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::Y) };
        let transmission_texture = texels.map(|texels| {
            world.picture(texels, None);
            world.scene.textures.len() as u32 - 1
        });
        let glass = world.dielectric(Dielectric { veil: 0.25, transmission_texture, ..thin(1.5) });
        world.shades[glass as usize].diffuse = FRONT.extend(1.0);
        world.quad(glass, Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0);
        world
    };
    let at = |world: &World, x: f32| look(world, Vec3::new(x, 0.4, 5.0), Vec3::NEG_Z, auto(5)).0;
    let (mirrored, through) = (0.08 / 1.04, 0.96 / 1.04);
    let expected = |clear: f32| mirrored + through * (clear + (1.0 - clear) * 0.3 * FRONT);
    assert_close(at(&place(None), 0.3), expected(0.75), 2e-6, "the factor alone");
    assert_close(at(&place(Some([[102, 255, 255, 255]; 2])), 0.3), expected(0.75 * 0.4), 2e-6, "0.4 of it");
    // At the centres of both texels.
    let split = place(Some([[255, 9, 9, 255], [0, 255, 255, 255]]));
    assert_close(at(&split, -1.5), expected(0.75), 2e-6, "clear");
    assert_close(at(&split, 1.5), expected(0.0), 2e-6, "opaque");
}

/// Walls of six colours around bodies of glass at the origin.
fn room(world: &mut World) {
    for (axis, [one, other]) in [(0, [FRONT, BEHIND]), (1, [Vec3::X, Vec3::ONE]), (2, [Vec3::Y, Vec3::Z])] {
        for (side, color) in [(9.0, one), (-9.0, other)] {
            let paint = world.paint(color);
            let mut axes = [Vec3::ZERO; 3];
            for (index, vector) in axes.iter_mut().enumerate() {
                vector[(axis + index) % 3] = 1.0;
            }
            world.quad(paint, axes[0] * side, axes[1] * -9.0 * side.signum(), axes[2] * 9.0);
        }
    }
}

#[test]
fn a_body_of_index_one_is_not_there() {
    let place = |with_body: bool| {
        let mut world = World::lit_along(Vec3::new(0.3, -1.0, 0.4));
        let glass = world.dielectric(solid(1.0, Vec3::ZERO));
        if with_body {
            block(&mut world, glass, Vec3::ZERO, Vec3::new(1.0, 1.2, 0.9), true);
            ball(&mut world, glass, Vec3::new(0.0, 3.0, 0.0), 1.0, 3);
        }
        room(&mut world);
        world
    };
    let (with, without) = (place(true), place(false));
    let targets = || (0..60).map(|i| Vec3::new((i % 8) as f32 * 0.3 - 1.0, (i / 8) as f32 * 0.6 - 0.9, 0.1));
    let eye = Vec3::new(0.5, 0.7, 7.0);
    let params = RayParams { shadow: GlassShadow::Straight, ..auto(5) };
    let render = |world: &World| {
        let shot = Shot::of(world, eye, targets());
        shot.run_on(&world.tree(), &shot.job(RayProgram::Final, Corrected, params))
    };
    let ((bodies, rays), (plain, none)) = (render(&with), render(&without));
    assert!(rays.refracted > 40 && none.refracted == 0 && rays.reflected == 0, "{rays:?}");
    for (index, (found, expected)) in bodies.iter().zip(&plain).enumerate() {
        assert_close(*found, Vec3::from_slice(expected), 1e-6, index);
    }
}

#[test]
fn overlapping_bodies_with_priorities_are_as_nested_ones() {
    let water = || solid(1.33, Vec3::new(0.3, 0.05, 0.0));
    let glass = || solid(1.5, Vec3::new(0.0, 0.1, 0.2));
    let mut nested = World::lit_along(Vec3::Y);
    let (outer, inner) = (nested.dielectric(glass()), nested.dielectric(water()));
    block(&mut nested, outer, Vec3::ZERO, Vec3::splat(2.0), true);
    block(&mut nested, inner, Vec3::ZERO, Vec3::splat(1.0), true);
    room(&mut nested);
    // A wall of glass around a cavity, and water that reaches into the wall.
    let overlap = |priority| {
        let mut world = World::lit_along(Vec3::Y);
        let outer = world.dielectric(Dielectric { priority, ..glass() });
        let inner = world.dielectric(Dielectric { priority: 1, ..water() });
        block(&mut world, outer, Vec3::ZERO, Vec3::splat(2.0), true);
        block(&mut world, outer, Vec3::ZERO, Vec3::splat(1.0), false);
        block(&mut world, inner, Vec3::ZERO, Vec3::splat(1.3), true);
        room(&mut world);
        world
    };
    let (mut apart, ranked, unranked) = (0.0_f32, overlap(2), overlap(0));
    for step in 0..24 {
        let (eye, direction) =
            (Vec3::new(0.4, 0.3, 6.0), Vec3::new(-0.2 + 0.013 * step as f32, -0.1, -1.0).normalize());
        let [expected, found, wrong] =
            [&nested, &ranked, &unranked].map(|world| look(world, eye, direction, auto(6)).0);
        assert_close(found, Vec3::from_slice(&expected), 2e-5, step);
        apart = apart.max((Vec3::from_slice(&wrong) - Vec3::from_slice(&expected)).abs().max_element());
    }
    assert!(apart > 0.01, "control: without a rank the water takes the place of the wall: {apart}");
}

#[test]
fn more_bodies_in_bodies_than_are_kept_are_counted() {
    for (bodies, overflows) in [(8, false), (32, true)] {
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
        for body in 0..bodies {
            let glass = world.dielectric(solid(1.0, Vec3::ZERO));
            block(&mut world, glass, Vec3::ZERO, Vec3::splat(40.0 - body as f32), true);
        }
        let (pixel, rays) = look(&world, Vec3::new(0.3, 0.4, 50.0), Vec3::NEG_Z, auto(5));
        assert_eq!(rays.lost > 0, overflows, "{bodies}");
        assert_close(pixel, Vec3::ONE, 1e-6, bodies);
    }
}

/// The light of a point of the ground, as a share from 0 in shadow to 1.
fn light_below(world: &World, place: Vec3, shadow: GlassShadow) -> Vec3 {
    let eye = place + Vec3::new(0.0, 0.0, 0.05);
    let shot = Shot::of(world, eye, [place]);
    let params = RayParams { shadow, ..auto(5) };
    let (pixels, _) = shot.run_on(&world.tree(), &shot.job(RayProgram::Final, Corrected, params));
    let lit = Vec3::from_slice(&shot.color[0]);
    (Vec3::from_slice(&pixels[0]) / lit - 0.5) * 2.0
}

#[test]
fn straight_shadows_are_those_of_fresnel_and_the_way_inside() {
    let sigma = Vec3::new(0.0, 0.2, 0.7);
    for degrees in [0.0_f32, 40.0, 70.0] {
        let mut world = World::lit_along(down(degrees));
        let glass = world.dielectric(solid(1.5, sigma));
        block(&mut world, glass, Vec3::new(0.0, 0.0, 3.0), Vec3::new(90.0, 90.0, 0.5), true);
        let ground = world.paint(Vec3::ONE);
        world.quad(ground, Vec3::ZERO, Vec3::X * 200.0, Vec3::Y * 200.0);
        let place = Vec3::new(0.3, 0.2, 0.0);
        let (r, _) = interface(f64::from(degrees), 1.5);
        let cos = f64::from(degrees).to_radians().cos();
        let expected = sigma.as_dvec3().to_array().map(|sigma| ((1.0 - r).powi(2) * (-sigma / cos).exp()) as f32);
        let found = light_below(&world, place, GlassShadow::Straight);
        assert!((found - Vec3::from(expected)).abs().max_element() < 1e-5, "{degrees}: {found} {expected:?}");
    }
}

/// Light that goes straight through a ball: T(b) = (1 - F(cos i))² exp(-2 sigma cos i).
#[test]
fn the_straight_shadow_of_a_ball_reaches_to_its_rim() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.dielectric(solid(1.5, Vec3::new(0.0, 0.5, 0.5)));
    ball(&mut world, glass, Vec3::new(0.0, 0.0, 2.0), 1.0, 5);
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    // Beyond 1/1.5 a formula with the cosine inside says total reflection: black.
    for b in [0.0_f32, 0.3, 0.6, 0.7, 0.8, 0.9] {
        let place = Vec3::new(0.6 * b, 0.8 * b, 0.0) + Vec3::new(3e-4, 1e-4, 0.0);
        let (r, cos) = (interface(f64::from(b).asin().to_degrees(), 1.5).0, (1.0 - f64::from(b).powi(2)).sqrt());
        let clear = (1.0 - r).powi(2);
        let expected = Vec3::new(clear as f32, (clear * (-cos).exp()) as f32, (clear * (-cos).exp()) as f32);
        let found = light_below(&world, place, GlassShadow::Straight);
        assert!((found - expected).abs().max_element() < 3e-3, "{b}: {found} {expected}");
        assert!(found.x > 0.5, "control: {b}");
        let report = light_below(&world, place, GlassShadow::Report);
        assert!((report - (0.81 - 0.5) * 2.0).abs().max_element() < 1e-5, "{report}");
    }
    assert_eq!(light_below(&world, Vec3::new(1.2, 0.0, 0.0), GlassShadow::Straight), Vec3::ONE);
}

#[test]
fn rays_that_leave_the_scene_show_what_lies_beyond_it() {
    let beyond = Vec3::new(0.2, 0.4, 0.8);
    let mut world = World { beyond, ..World::lit_along(Vec3::Y) };
    let glass = world.glass();
    world.quad(glass, Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0);
    let eye = Vec3::new(0.3, 0.4, 5.0);
    let shot = Shot::of(&world, eye, [Vec3::ZERO]);
    for program in [RayProgram::Reflection, RayProgram::Refraction, RayProgram::Final] {
        let (pixels, _) = shot.run(program, Corrected, RayParams { samples: 0, ..RayParams::default() });
        assert_close(pixels[0], beyond, 1e-6, format!("{program:?}"));
    }
}
