//! Exact spheres of glass against their closed forms.

use super::*;
use crate::trace::WithSpheres;

pub(super) fn run(
    world: &World,
    shot: &Shot<'_>,
    program: RayProgram,
    params: RayParams,
) -> (Vec<[f32; 4]>, RayCounts) {
    let (triangles, spheres) = (&world.tree(), &world.spheres());
    shot.run_on(&WithSpheres { triangles, spheres }, &shot.job(program, Corrected, params))
}

pub(super) fn look(world: &World, eye: Vec3, direction: Vec3, params: RayParams) -> ([f32; 4], RayCounts) {
    let shot = Shot::of(world, eye, [eye + direction]);
    let (pixels, rays) = run(world, &shot, RayProgram::Refraction, params);
    (pixels[0], rays)
}

/// The reflectance where a ray meets a sphere at the impact parameter `b` (in radii), and the length of the path inside, in `f64`.
pub(super) fn impact(b: f64, index: f64) -> (f64, f64) {
    let (r, inner) = interface(b.asin().to_degrees(), index);
    (r, 2.0 * inner)
}

/// The sum over all inner reflections: R + (1-R)² a / (1 - R a) with a = exp(-2 sigma cos t).
fn white(b: f64, index: f64, sigma: f64) -> f64 {
    let (r, length) = impact(b, index);
    let a = (-sigma * length).exp();
    r + (1.0 - r).powi(2) * a / (1.0 - r * a)
}

#[test]
fn a_sphere_in_a_white_environment_has_the_closed_form_to_rounding() {
    // Numbers of an independent computation check that the closed form is written down right.
    for (index, sigma, expected) in [
        (1.5, 0.5, [0.384_101, 0.405_261, 0.485_812, 0.635_384]),
        (1.33, 0.5, [0.375_954, 0.403_650, 0.501_718, 0.640_266]),
        (2.42, 0.5, [0.441_429, 0.448_367, 0.487_698, 0.620_486]),
        (1.5, 0.0, [1.0; 4]),
    ] {
        for (b, expected) in [0.0, 0.5, 0.9, 0.99].into_iter().zip(expected) {
            assert!((white(b, index, sigma) - expected).abs() < 6e-7, "{index} {sigma} {b}");
        }
    }
    for (scale, offset) in [(1.0_f32, Vec3::ZERO), (1e-3, Vec3::new(0.02, -0.01, 0.03)), (250.0, Vec3::splat(300.0))] {
        for index in [1.0, 1.33, 1.5, 2.42] {
            let sigma = Vec3::new(0.0, 0.5, 2.0) / scale;
            let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
            let glass = world.dielectric(solid(index, sigma));
            world.sphere(glass, offset, scale);
            for b in [0.0, 0.1, 0.5, 0.7, 0.9, 0.99] {
                let eye = offset + Vec3::new(0.6 * b, 0.8 * b, 3.0) * scale;
                // The impact parameter of the eye as it is rounded.
                let from = (eye - offset).as_dvec3().truncate().length() / f64::from(scale);
                let expected = sigma.to_array().map(|sigma| white(from, index.into(), f64::from(sigma * scale)) as f32);
                let (pixel, rays) = look(&world, eye, Vec3::NEG_Z, auto(16));
                // Positions are rounded to 2^-24 of the sphere's distance from the origin, not of its size.
                let steep = if b > 0.95 { 2e-5 } else { 3e-6 } * (1.0 + 0.3 * offset.abs().max_element() / scale);
                assert_close(pixel, Vec3::from(expected), steep, format!("{scale} {index} {b}"));
                assert_eq!(rays.lost, 0);
            }
        }
    }
    // Controls: an index two percent off, light that leaves after the first segment inside, and absorption on the first segment alone.
    let (r, length) = impact(0.9, 1.5);
    let (a, whole) = ((-0.5 * length).exp(), white(0.9, 1.5, 0.5));
    assert!((white(0.9, 1.53, 0.5) - whole).abs() > 1e-3);
    assert!((r + (1.0 - r).powi(2) * a - whole).abs() > 5e-3 && (r + (1.0 - r) * a - whole).abs() > 5e-3);
}

#[test]
fn each_inner_reflection_adds_what_the_series_says() {
    // Down to `depth` surfaces, paths are split. Light that is left then leaves with the weight of both branches, after the absorption of its last
    // segment.
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let glass = world.dielectric(solid(1.5, Vec3::new(0.0, 0.5, 3.0)));
    world.sphere(glass, Vec3::ZERO, 1.0);
    for b in [0.0, 0.5, 0.9] {
        for depth in 1..8_u32 {
            let (pixel, rays) = look(&world, Vec3::new(b, 0.0, 3.0), Vec3::NEG_Z, auto(depth));
            let (r, length) = impact(b.into(), 1.5);
            let expected = [0.0, 0.5, 3.0].map(|sigma: f64| {
                let a = (-sigma * length).exp();
                let ways = depth - 1;
                let left: f64 = (0..ways).map(|k| (r * a).powi(k as i32)).sum::<f64>() * a * (1.0 - r);
                (r + (1.0 - r) * (left + a * (r * a).powi(ways as i32))) as f32
            });
            assert_close(pixel, Vec3::from(expected), 2e-6, format!("{b} {depth}"));
            assert_eq!(rays.lost, 0);
        }
    }
}

#[test]
fn an_eye_in_a_sphere_sees_out_of_it() {
    for index in [1.33_f64, 1.5, 2.42] {
        let sigma = Vec3::new(0.0, 0.3, 1.0);
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
        let glass = world.dielectric(solid(index as f32, sigma));
        world.sphere(glass, Vec3::new(4.0, 5.0, 6.0), 2.0);
        for share in [0.0, 0.3, 0.6 / index, 0.95 / index] {
            // A ray that passes the centre at `share` of the radius leaves at the angle whose sine is `share` times the index.
            let eye = Vec3::new(4.0 + 2.0 * share as f32, 5.0, 6.0);
            let share = f64::from(eye.x - 4.0) / 2.0;
            let (r, _) = interface((share * index).asin().to_degrees(), index);
            let half = 2.0 * (1.0 - share * share).sqrt();
            let expected = sigma.as_dvec3().to_array().map(|sigma| {
                let (half, whole) = ((-sigma * half).exp(), (-2.0 * sigma * half).exp());
                (half * (1.0 - r) / (1.0 - r * whole)) as f32
            });
            let (pixel, rays) = look(&world, eye, Vec3::Z, auto(16));
            assert_close(pixel, Vec3::from(expected), 4e-6, format!("{index} {share}"));
            assert_eq!(rays.lost, 0);
        }
        // Beyond the critical angle light stays inside, and is counted as lost.
        let eye = Vec3::new(4.0 + 2.0 * (1.02 / index) as f32, 5.0, 6.0);
        let (pixel, rays) = look(&world, eye, Vec3::Z, auto(16));
        assert_eq!((pixel, rays.lost, rays.refracted), ([0.0, 0.0, 0.0, 1.0], 1, 0));
    }
}

#[test]
fn a_sphere_of_index_one_is_not_there() {
    let place = |with_sphere: bool| {
        let mut world = World::lit_along(Vec3::new(0.3, -1.0, 0.4));
        let glass = world.dielectric(solid(1.0, Vec3::ZERO));
        if with_sphere {
            world.sphere(glass, Vec3::ZERO, 1.3);
            world.sphere(glass, Vec3::new(0.0, 3.0, 0.0), 1.0);
            world.sphere(glass, Vec3::new(0.5, 0.7, 7.0), 0.5);
        }
        room(&mut world);
        world
    };
    let (with, without) = (place(true), place(false));
    let targets = || (0..400).map(|i| Vec3::new((i % 20) as f32 * 0.2 - 2.0, (i / 20) as f32 * 0.2 - 2.0, 0.1));
    let eye = Vec3::new(0.5, 0.7, 7.0);
    let params = RayParams { shadow: GlassShadow::Straight, ..auto(5) };
    let render = |world: &World| {
        let shot = Shot::of(world, eye, targets());
        run(world, &shot, RayProgram::Final, params)
    };
    let ((spheres, rays), (plain, none)) = (render(&with), render(&without));
    assert!(rays.refracted > 400 && none.refracted == 0 && rays.reflected == 0, "{rays:?}");
    for (index, (found, expected)) in spheres.iter().zip(&plain).enumerate() {
        assert_close(*found, Vec3::from_slice(expected), 1e-6, index);
    }
}

fn light_below(world: &World, place: Vec3, shadow: GlassShadow) -> Vec3 {
    let eye = place + Vec3::new(0.0, 0.0, 0.05);
    let shot = Shot::of(world, eye, [place]);
    let (pixels, _) = run(world, &shot, RayProgram::Final, RayParams { shadow, ..auto(5) });
    let lit = Vec3::from_slice(&shot.color[0]);
    (Vec3::from_slice(&pixels[0]) / lit - 0.5) * 2.0
}

/// T(b) = (1 - F(cos i))² exp(-2 sigma cos i).
#[test]
fn the_straight_shadow_of_a_sphere_has_the_closed_form_and_its_flux() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = world.dielectric(solid(1.5, Vec3::new(0.0, 0.5, 1.5)));
    world.sphere(glass, Vec3::new(0.0, 0.0, 2.0), 1.0);
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    let expected = |b: f64| {
        let (r, cos) = (interface(b.asin().to_degrees(), 1.5).0, (1.0 - b * b).sqrt());
        [0.0, 0.5, 1.5].map(|sigma: f64| (1.0 - r).powi(2) * (-2.0 * sigma * cos).exp())
    };
    for b in [0.0_f32, 0.3, 0.6, 0.7, 0.8, 0.9, 0.99] {
        let place = Vec3::new(0.6 * b, 0.8 * b, 0.0);
        let found = light_below(&world, place, GlassShadow::Straight);
        let expected = Vec3::from(expected(f64::from(place.length())).map(|value| value as f32));
        assert!((found - expected).abs().max_element() < 1e-5, "{b}: {found} {expected}");
        let report = light_below(&world, place, GlassShadow::Report);
        assert!((report - (0.81 - 0.5) * 2.0).abs().max_element() < 1e-5, "{report}");
    }
    for outside in [1.0001, 1.2] {
        let place = Vec3::new(0.0, outside, 0.0);
        assert_eq!(light_below(&world, place, GlassShadow::Straight), Vec3::ONE);
    }
    // The mean over rings of equal area is the share of the light that passes the whole disc, .83554 without absorption.
    let rings = 400;
    let sum: f32 = (0..rings)
        .map(|ring| light_below(&world, Vec3::X * ((ring as f32 + 0.5) / rings as f32).sqrt(), GlassShadow::Straight).x)
        .sum();
    assert!((sum / rings as f32 - 0.835_54).abs() < 3e-4, "{}", sum / rings as f32);
}

#[test]
fn overlapping_spheres_with_priorities_are_as_nested_ones() {
    let water = || solid(1.33, Vec3::new(0.3, 0.05, 0.0));
    let glass = || solid(1.5, Vec3::new(0.0, 0.1, 0.2));
    let air = || solid(1.0, Vec3::ZERO);
    let mut nested = World::lit_along(Vec3::Y);
    let (outer, inner) = (nested.dielectric(glass()), nested.dielectric(water()));
    nested.sphere(outer, Vec3::ZERO, 2.0);
    nested.sphere(inner, Vec3::ZERO, 1.0);
    room(&mut nested);
    // A cavity of air in the wall, filled with water that reaches into the wall.
    let overlap = |cavity, wall, content| {
        let mut world = World::lit_along(Vec3::Y);
        let outer = world.dielectric(Dielectric { priority: wall, ..glass() });
        let hole = world.dielectric(Dielectric { priority: cavity, ..air() });
        let inner = world.dielectric(Dielectric { priority: content, ..water() });
        world.sphere(outer, Vec3::ZERO, 2.0);
        world.sphere(hole, Vec3::ZERO, 0.8);
        world.sphere(inner, Vec3::ZERO, 1.0);
        room(&mut world);
        world
    };
    let (mut apart, ranked, unranked) = (0.0_f32, overlap(0, 1, 2), overlap(3, 1, 2));
    for step in 0..24 {
        let (eye, direction) =
            (Vec3::new(0.4, 0.3, 6.0), Vec3::new(-0.2 + 0.013 * step as f32, -0.1, -1.0).normalize());
        let [expected, found, wrong] =
            [&nested, &ranked, &unranked].map(|world| look(world, eye, direction, auto(6)).0);
        assert_close(found, Vec3::from_slice(&expected), 2e-5, step);
        apart = apart.max((Vec3::from_slice(&wrong) - Vec3::from_slice(&expected)).abs().max_element());
    }
    assert!(apart > 0.01, "control: a cavity above all takes the place of the water: {apart}");
}

/// A sphere deflects light that leaves it after k passes inside by 2 (i - t) + (k - 1) (180 - 2 t) degrees. The rainbow of water is where this
/// angle is least for k = 2.
#[test]
fn light_leaves_a_sphere_by_the_angles_of_the_rainbow() {
    use crate::cpu;
    use crate::trace::{Event, Outcome, Recorder};
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let glass = world.dielectric(solid(1.333, Vec3::ZERO));
    world.sphere(glass, Vec3::new(1.0, 2.0, -3.0), 0.7);
    let (triangles, spheres) = (&world.tree(), &world.spheres());
    let tracer = WithSpheres { triangles, spheres };
    let mut least = f64::INFINITY;
    for step in 1..=199 {
        let b = step as f32 / 200.0;
        let eye = Vec3::new(1.0 + 0.7 * b, 2.0, 5.0);
        let shot = Shot::of(&world, eye, [eye + Vec3::NEG_Z]);
        let job = shot.job(RayProgram::Refraction, Corrected, auto(4));
        let recorder = Recorder::new(&tracer, &world.scene.geometry, Some(shot.triangle[0]));
        cpu::trace_pixel(&recorder, &job, 0, 0).expect("a complete job");
        let i = (f64::from(eye.x - 1.0) / 0.7).asin();
        let t = (i.sin() / 1.333).asin();
        let leaving = recorder.events().into_iter().filter_map(|event| match event {
            Event::Ray(ray) if ray.outcome == Outcome::Miss => Some(ray.ray.direction.as_dvec3()),
            _ => None,
        });
        let leaving: Vec<_> = leaving.collect();
        for ways in 1..=3 {
            let turned = 2.0 * (i - t) + f64::from(ways - 1) * (std::f64::consts::PI - 2.0 * t);
            let expected = glam::DVec3::new(-turned.sin(), 0.0, -turned.cos());
            let off = leaving.iter().map(|found| found.distance(expected)).fold(f64::INFINITY, f64::min);
            assert!(off < 1e-4, "{b} {ways}: {off}");
            if ways == 2 {
                least = least.min(turned.to_degrees());
            }
        }
    }
    assert!((180.0 - least - 42.078).abs() < 0.01, "{least}");
}
