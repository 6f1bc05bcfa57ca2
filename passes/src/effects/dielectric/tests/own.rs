//! Reflectances and colours that materials have of their own, against closed forms.

use super::spheres::{impact, look, run};
use super::*;
use curitiba_pipeline::glass::Reflectance;

const CURVE: Reflectance = Reflectance { minimum: 0.1, maximum: 0.7, exponent: 3.0 };

/// Share reflected at this cosine outside.
fn share(cos: f64) -> f64 {
    0.1 + (0.7 - 0.1) * (1.0 - cos).powi(3)
}

/// A sphere of radius 1 in light of 1.
fn white_sphere(dielectric: Dielectric) -> World {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let glass = world.dielectric(dielectric);
    world.sphere(glass, Vec3::ZERO, 1.0);
    world
}

/// R c + (1-R)² f² a / (1 - R c a) with colours c of what is reflected and f of what passes, a for absorption.
#[test]
fn a_sphere_with_a_curve_and_colours_has_the_closed_form() {
    let (mirrors, filter, sigma) = (Vec3::new(1.0, 0.5, 0.2), Vec3::new(0.9, 1.0, 0.6), Vec3::new(0.0, 0.4, 0.1));
    let dielectric = Dielectric { reflectance: Some(CURVE), reflection: Some(mirrors), filter, ..solid(1.5, sigma) };
    let world = white_sphere(dielectric);
    for b in [0.0_f64, 0.3, 0.6, 0.8, 0.9] {
        let (fresnel, length) = impact(f64::from(b as f32), 1.5);
        let r = share((1.0 - b * b).sqrt());
        let of_colour = |c: f32, f: f32, sigma: f32, r: f64| {
            let (c, f, a) = (f64::from(c), f64::from(f), (-f64::from(sigma) * length).exp());
            r * c + (1.0 - r).powi(2) * f * f * a / (1.0 - r * c * a)
        };
        let expected = [0, 1, 2].map(|k| of_colour(mirrors[k], filter[k], sigma[k], r));
        let (pixel, rays) = look(&world, Vec3::new(b as f32, 0.0, 3.0), Vec3::NEG_Z, auto(16));
        assert_close(pixel, Vec3::from(expected.map(|value| value as f32)), 2e-4, b);
        assert_eq!(rays.lost, 0);
        // Control: Fresnel's share in the place of the curve.
        let other = of_colour(mirrors[1], filter[1], sigma[1], fresnel);
        assert!((other - expected[1]).abs() > 5e-3, "{b}: {other} {}", expected[1]);
    }
}

#[test]
fn no_curve_gains_light_and_total_reflection_stays_total() {
    for exponent in [0.0, 1.0, 5.0, 1000.0] {
        for (minimum, maximum) in [(0.0, 1.0), (0.3, 0.3), (0.0, 0.0), (1.0, 1.0)] {
            let curve = Reflectance { minimum, maximum, exponent };
            let glass = Dielectric { reflectance: Some(curve), ..solid(1.5, Vec3::ZERO) };
            let world = white_sphere(glass);
            for b in [0.0, 0.5, 0.95] {
                let (pixel, _) = look(&world, Vec3::new(b, 0.0, 3.0), Vec3::NEG_Z, auto(5));
                assert_close(pixel, Vec3::ONE, 2e-6, format!("{curve:?} {b}"));
            }
            // From inside, beyond the critical angle, light stays there for ever; straight out it leaves by the curve.
            let (pixel, rays) = look(&world, Vec3::new(0.7, 0.0, 0.0), Vec3::Z, auto(5));
            assert_eq!((pixel, rays.lost), ([0.0, 0.0, 0.0, 1.0], 1), "{curve:?}");
        }
    }
}

/// A wall: c (R + (1-R)² R / (1 - R²)) + f (1-R)² / (1 - R²).
#[test]
fn a_thin_wall_reflects_by_its_curve_and_colour() {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let colors = (Vec3::new(0.2, 0.9, 0.5), Vec3::new(0.7, 1.0, 0.4));
    let wall = Dielectric { reflectance: Some(CURVE), reflection: Some(colors.0), filter: colors.1, ..thin(1.5) };
    let wall = world.dielectric(wall);
    world.quad(wall, Vec3::ZERO, Vec3::X * 50.0, Vec3::Y * 50.0);
    for degrees in [0.0_f32, 40.0, 75.0] {
        let (pixel, _) = super::look(&world, Vec3::new(0.1, 0.2, 1.0), down(degrees), auto(1));
        let r = share(f64::from(degrees).to_radians().cos()) as f32;
        let (back, on) = (2.0 * r / (1.0 + r), (1.0 - r) / (1.0 + r));
        assert_close(pixel, back * colors.0 + on * colors.1, 3e-6, degrees);
    }
}

#[test]
fn straight_shadows_are_those_of_the_curve() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let glass = Dielectric { reflectance: Some(CURVE), ..solid(1.5, Vec3::ZERO) };
    let glass = world.dielectric(glass);
    world.sphere(glass, Vec3::new(0.0, 0.0, 2.0), 1.0);
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    for b in [0.0_f32, 0.5, 0.9] {
        let place = Vec3::new(b, 0.0, 0.0);
        let shot = Shot::of(&world, place + Vec3::new(0.0, 0.0, 0.05), [place]);
        let params = RayParams { shadow: GlassShadow::Straight, ..auto(5) };
        let (pixels, _) = run(&world, &shot, RayProgram::Final, params);
        let found = (pixels[0][0] / shot.color[0][0] - 0.5) * 2.0;
        let expected = (1.0 - share((1.0 - f64::from(b * b)).sqrt())).powi(2);
        assert!((f64::from(found) - expected).abs() < 1e-5, "{b}: {found} {expected}");
    }
}

/// The curve of Schlick's numbers is Schlick's approximation.
#[test]
fn schlicks_own_numbers_are_the_approximation_of_the_pass() {
    use crate::effects::{interface_of, schlick};
    for index in [1.0 / 2.42_f32, 1.0 / 1.5, 1.33, 1.5, 2.42] {
        let glass = Dielectric { reflectance: Some(Reflectance::of_index(index)), ..solid(1.5, Vec3::ZERO) };
        for step in 0..=90 {
            let cos = (step as f32).to_radians().cos();
            let found = interface_of(&glass, curitiba_pipeline::programs::Fresnel::Exact, cos, index);
            let expected = schlick(cos, index);
            assert!((found.reflectance - expected.reflectance).abs() < 2e-6, "{index} {step}");
        }
    }
}
