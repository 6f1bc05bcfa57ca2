//! Bodies that disperse light.

use super::*;
use crate::cpu;
use crate::trace::{Event, Outcome, Purpose, Ray, Recorder};
use curitiba_pipeline::glass::strata;

/// Glass like BK7, with `times` its dispersion.
fn crown(times: f32) -> Dielectric {
    Dielectric { spread: times * 0.5168 / 64.17, ..solid(1.5168, Vec3::ZERO) }
}

fn colors(wavelengths: u32, depth: u32) -> RayParams {
    RayParams { wavelengths, ..auto(depth) }
}

/// A prism of 60 degrees along y whose edge is on the side of +x, with sides of length 2.
fn prism(world: &mut World, material: u32) {
    let half = 60_f32.to_radians().cos();
    let [edge, front, back] = [Vec3::X * 3_f32.sqrt() * half * 2.0, Vec3::Z, Vec3::NEG_Z];
    let (up, long) = (Vec3::Y, 50.0);
    let mut side = |from: Vec3, to: Vec3| {
        world.quad(material, from.midpoint(to), (to - from) * 0.5, up * long);
    };
    side(front, edge);
    side(edge, back);
    side(back, front);
    for end in [1.0, -1.0] {
        let corners = [front, edge, back].map(|corner| corner + up * long * end);
        let [a, b, c] = corners;
        let corners = if end > 0.0 { [a, b, c] } else { [a, c, b] };
        world.triangle(material, corners, [up * end; 3]);
    }
}

/// The rays that leave the world after they were refracted twice.
fn leaves(world: &World, eye: Vec3, direction: Vec3, params: RayParams) -> Vec<Ray> {
    let shot = Shot::of(world, eye, [eye + direction]);
    let job = shot.job(RayProgram::Refraction, Corrected, params);
    let tree = world.tree();
    let recorder = Recorder::new(&tree, &world.scene.geometry, Some(shot.triangle[0]));
    cpu::trace_pixel(&recorder, &job, 0, 0).expect("a complete job");
    let mut entered = false;
    let found = recorder.events().into_iter().filter_map(|event| {
        let Event::Ray(ray) = event else { return None };
        let refracted = ray.purpose == Purpose::Refracted;
        if ray.bounce == 0 {
            entered = refracted;
        }
        (entered && refracted && ray.bounce == 1 && ray.outcome == Outcome::Miss).then_some(ray.ray)
    });
    found.collect()
}

/// The deviation by a prism of 60 degrees, in `f64` and degrees, for an angle of incidence in its principal section.
fn turned(degrees: f64, index: f64) -> f64 {
    let first = (degrees.to_radians().sin() / index).asin();
    let last = (index * (60_f64.to_radians() - first).sin()).asin();
    degrees + last.to_degrees() - 60.0
}

#[test]
fn a_prism_turns_each_wavelength_by_the_closed_form() {
    let at = |degrees: f64| {
        // Towards the middle of the front side, whose normal is 30 degrees from +z.
        let angle = (30.0 - degrees).to_radians();
        let direction = -Vec3::new(angle.sin() as f32, 0.0, angle.cos() as f32);
        (Vec3::new(0.866, 0.1, 0.5) - direction * 4.0, direction)
    };
    let between = |a: Vec3, b: Vec3| a.as_dvec3().angle_between(b.as_dvec3()).to_degrees();
    // Minimum deviation of a glass like BK7 at the lines F, d and C, each as a glass of that index.
    for (line, degrees) in [(486.13, 39.1428), (587.56, 38.6467), (656.27, 38.4339)] {
        let index = crown(1.0).index_at(line);
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
        let glass = world.dielectric(solid(index, Vec3::ZERO));
        prism(&mut world, glass);
        let (eye, direction) = at((f64::from(index) * 0.5).asin().to_degrees());
        let found = leaves(&world, eye, direction, colors(16, 5));
        assert_eq!(found.len(), 1);
        assert!((between(found[0].direction, direction) - degrees).abs() < 5e-4, "{line}: {:?}", found[0]);
    }
    // The strata of one ray, fanned out.
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let glass = world.dielectric(crown(3.0));
    prism(&mut world, glass);
    let (eye, direction) = at(50.0);
    let found = leaves(&world, eye, direction, colors(16, 5));
    assert_eq!(found.len(), 16);
    let mut widest = [f64::INFINITY, 0.0];
    for (stratum, found) in strata(16).iter().zip(&found) {
        let found = between(found.direction, direction);
        let expected = turned(50.0, f64::from(crown(3.0).index_at(stratum.wavelength)));
        assert!((found - expected).abs() < 5e-4, "{}: {found} {expected}", stratum.wavelength);
        widest = [widest[0].min(found), widest[1].max(found)];
    }
    assert!(widest[1] - widest[0] > 3.0, "{widest:?}");
}

/// The sum over wavelengths of w (R + (1-R)² a / (1 - R a)), by colour: w is the weight of the wavelength, and a the transmittance across.
#[test]
fn a_plate_that_disperses_is_the_weighted_sum_of_its_colours() {
    let sigma = Vec3::new(0.0, 0.5, 2.0);
    let glass = Dielectric { spread: 0.1, ..solid(1.6, sigma) };
    let world = plate(glass);
    for degrees in [0.0, 60.0, 80.0] {
        let (pixel, rays) = look(&world, Vec3::new(0.3, 0.4, 5.0), down(degrees), colors(16, 16));
        let mut expected = glam::DVec3::ZERO;
        for stratum in strata(16) {
            let (r, inner) = interface(f64::from(degrees), f64::from(glass.index_at(stratum.wavelength)));
            let kept = sigma.as_dvec3().map(|sigma| (-sigma / inner).exp());
            expected += stratum.weight.as_dvec3() * kept.map(|a| r + (1.0 - r) * (1.0 - r) * a / (1.0 - r * a));
        }
        assert_close(pixel, expected.as_vec3(), 5e-5, degrees);
        assert_eq!(rays.lost, 0);
    }
}

#[test]
fn white_stays_white_at_every_depth_and_number_of_strata() {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let [glass, water] = [1.6, 1.33]
        .map(|index| world.dielectric(Dielectric { spread: 0.05 * (index - 1.0), ..solid(index, Vec3::ZERO) }));
    ball(&mut world, glass, Vec3::ZERO, 1.0, 3);
    ball(&mut world, water, Vec3::new(0.1, 0.0, 0.0), 0.7, 3);
    for (depth, wavelengths) in [(0, 16), (1, 16), (3, 2), (3, 7), (5, 16)] {
        for step in 0..10 {
            let eye = Vec3::new(0.09 * step as f32, 0.03, 3.0);
            let (pixel, rays) = look(&world, eye, Vec3::NEG_Z, colors(wavelengths, depth));
            if rays.lost == 0 {
                assert_close(pixel, Vec3::ONE, 6e-6, format!("depth {depth}, {wavelengths} strata, step {step}"));
            }
        }
    }
}

#[test]
fn who_bends_no_colour_apart_costs_and_shows_what_it_did() {
    let place = |spread: f32| {
        let mut world = World::lit_along(Vec3::new(0.3, -1.0, 0.4));
        let plain = world.dielectric(solid(1.5, Vec3::new(0.1, 0.2, 0.3)));
        let other = world.dielectric(Dielectric { spread, ..solid(1.6, Vec3::ZERO) });
        ball(&mut world, plain, Vec3::new(-1.5, 0.0, 0.0), 1.0, 3);
        ball(&mut world, other, Vec3::new(1.5, 0.0, 0.0), 1.0, 3);
        room(&mut world);
        world
    };
    let (apart, plain) = (place(0.05), place(0.0));
    let render = |world: &World, x: f32, wavelengths: u32| {
        let targets = (0..36).map(|i| Vec3::new(x + (i % 6) as f32 * 0.3 - 0.8, (i / 6) as f32 * 0.3 - 0.8, 0.1));
        let shot = Shot::of(world, Vec3::new(x, 0.2, 7.0), targets);
        shot.run_on(&world.tree(), &shot.job(RayProgram::Final, Corrected, colors(wavelengths, 5)))
    };
    let other = [render(&apart, 1.5, 16), render(&plain, 1.5, 16), render(&apart, 1.5, 1)];
    assert_eq!(other[1], other[2], "one stratum is none");
    assert_ne!(other[0].0, other[1].0, "control");
    assert!(other[0].1.refracted > 8 * other[1].1.refracted, "{:?} {:?}", other[0].1, other[1].1);
    // Some rays through the dispersive ball reach the plain one; at the plain ball's rim none do.
    let beside = |world: &World| {
        let shot = Shot::of(world, Vec3::new(-9.0, 0.2, 7.0), [Vec3::new(-2.4, 0.0, 0.0)]);
        shot.run_on(&world.tree(), &shot.job(RayProgram::Final, Corrected, colors(16, 0)))
    };
    assert_eq!(beside(&apart), beside(&plain), "to the bit, and with the same rays");
}

/// The border of a black and a white half of a wall, seen through a prism.
#[test]
fn three_bands_are_no_spectrum() {
    let mut world = World::lit_along(Vec3::Y);
    let glass = world.dielectric(crown(3.0));
    prism(&mut world, glass);
    let white = world.paint(Vec3::ONE);
    let (eye, far) = (Vec3::new(-1.0, 0.1, 4.0), 30.0);
    // The ray on which light of the line d that meets the prism in the middle leaves the prism.
    let direction = (Vec3::new(0.866, 0.1, 0.5) - eye).normalize();
    let Ray { origin, direction: middle, .. } = leaves(&world, eye, direction, colors(1, 5))[0];
    let across = middle.cross(Vec3::Y).normalize();
    world.quad(white, origin + middle * far + across * 50.0, across * 50.0, across.cross(-middle).normalize() * 50.0);
    let render = |wavelengths: u32| -> Vec<Vec3> {
        let targets = (0..64).map(|step| Vec3::new(0.866, 0.1, 0.5) + Vec3::X * (step as f32 - 32.0) * 0.004);
        let shot = Shot::of(&world, eye, targets);
        let (pixels, _) =
            shot.run_on(&world.tree(), &shot.job(RayProgram::Refraction, Corrected, colors(wavelengths, 5)));
        pixels.iter().map(|pixel| Vec3::from_slice(pixel) / 0.3).collect()
    };
    let reference = render(256);
    let error = |pixels: &[Vec3]| {
        let squares: f32 = pixels.iter().zip(&reference).map(|(a, b)| (*a - *b).length_squared()).sum();
        (squares / (3 * reference.len()) as f32).sqrt()
    };
    let [three, sixteen, many] = [3, 16, 32].map(|count| error(&render(count)));
    assert!(many < 0.02 && sixteen < 0.035 && three > 0.09, "{three} {sixteen} {many}");
}
