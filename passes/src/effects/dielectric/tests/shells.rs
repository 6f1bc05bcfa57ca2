//! Spheres in spheres: shells around a cavity, against closed forms in `f64`.
//!
//! By Bouguer's formula, n ρ sin(angle) is constant along a ray through concentric spheres, where ρ is the radius. So the ray meets each
//! layer at the same angles again and again.

use super::spheres::{look, run};
use super::*;
use crate::cpu;
use crate::trace::{Event, Outcome, Recorder, WithSpheres};
use glam::DVec3;
use std::f64::consts::PI;

/// A sphere of radius 1 about the origin, with a cavity in the middle.
#[derive(Clone, Copy)]
struct Shell {
    /// Indices of the wall and of what fills the cavity.
    indices: [f64; 2],
    /// Their extinctions.
    sigmas: [f64; 2],
    /// Radius of the cavity.
    cavity: f64,
}

/// What happens to a ray at an impact parameter.
#[derive(Debug, PartialEq, Clone, Copy)]
enum Way {
    /// It passes beside the cavity.
    Beside,
    /// It is reflected totally at the cavity.
    Mirrored,
    /// It goes through the cavity.
    Through,
}

impl Shell {
    fn way(&self, b: f64) -> Way {
        let [wall, inner] = self.indices;
        match () {
            () if b >= wall * self.cavity => Way::Beside,
            () if b >= inner * self.cavity => Way::Mirrored,
            () => Way::Through,
        }
    }

    /// Sines of the angles at the impact parameter `b`: outside, in the wall at its outer and at its inner side, in the cavity.
    fn sines(&self, b: f64) -> [f64; 4] {
        let [wall, inner] = self.indices;
        [b, b / wall, b / (wall * self.cavity), b / (inner * self.cavity)]
    }

    /// What is seen in a white environment: the sum over all reflections in the wall and in the cavity.
    fn white(&self, b: f64) -> f64 {
        let [i, t, at_cavity, inner] = self.sines(b);
        let cos = |sine: f64| (1.0 - sine * sine).sqrt();
        let outer = reflectance(cos(i), self.indices[0]);
        if self.way(b) == Way::Beside {
            let a = (-2.0 * self.sigmas[0] * cos(t)).exp();
            return outer + (1.0 - outer).powi(2) * a / (1.0 - outer * a);
        }
        let across = (-self.sigmas[0] * (cos(t) - self.cavity * cos(at_cavity))).exp();
        // Of the light that comes to the cavity, the share that leaves it again, on the same side or on the other one.
        let sends = match self.way(b) {
            Way::Mirrored => 1.0,
            _ => {
                let face = reflectance(cos(at_cavity), self.indices[1] / self.indices[0]);
                let chord = (-2.0 * self.sigmas[1] * self.cavity * cos(inner)).exp();
                face + (1.0 - face).powi(2) * chord / (1.0 - face * chord)
            }
        };
        let round = across * across * sends;
        outer + (1.0 - outer).powi(2) * round / (1.0 - outer * round)
    }

    /// Deflection of light towards the axis, in radians, if it passes without any reflection but a total one. Refraction deflects it towards the
    /// axis where it enters and where it leaves; a mirror or the cavity deflects it away from the axis.
    fn turned(&self, b: f64) -> f64 {
        let [i, t, at_cavity, inner] = self.sines(b).map(|sine| sine.min(1.0).asin());
        match self.way(b) {
            Way::Beside => 2.0 * (i - t),
            Way::Mirrored => 2.0 * (i - t) - (PI - 2.0 * at_cavity),
            Way::Through => 2.0 * (i - t) - 2.0 * (inner - at_cavity),
        }
    }

    fn world(&self, scale: f32) -> World {
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
        for (layer, radius) in [1.0, self.cavity as f32].into_iter().enumerate() {
            let sigma = Vec3::splat(self.sigmas[layer] as f32 / scale);
            let material = world.dielectric(solid(self.indices[layer] as f32, sigma));
            world.sphere(material, CENTER * scale, radius * scale);
        }
        world
    }

    /// The impact parameter of the eye as it is rounded, the colour that the program shows there, and the counts of rays.
    fn seen(&self, world: &World, scale: f32, b: f64, depth: u32) -> (f64, f32, RayCounts) {
        let eye = eye_at(b, scale);
        let (pixel, rays) = look(world, eye, Vec3::NEG_Z, auto(depth));
        assert!(pixel[0] == pixel[1] && pixel[1] == pixel[2]);
        let place = (eye - CENTER * scale).as_dvec3().truncate().length() / f64::from(scale);
        (place, pixel[0], rays)
    }
}

const CENTER: Vec3 = Vec3::new(0.25, -0.5, 0.125);

fn eye_at(b: f64, scale: f32) -> Vec3 {
    (CENTER + Vec3::new(0.6 * b as f32, 0.8 * b as f32, 3.0)) * scale
}

/// Fresnel's share for unpolarised light, by the cosine outside and the index behind over that before.
fn reflectance(cos: f64, index: f64) -> f64 {
    let inner = (1.0 - (1.0 - cos * cos) / (index * index)).sqrt();
    let (s, p) = ((cos - index * inner) / (cos + index * inner), (index * cos - inner) / (index * cos + inner));
    0.5 * (s * s + p * p)
}

const HOLLOW: Shell = Shell { indices: [1.5, 1.0], sigmas: [0.4, 0.0], cavity: 0.6 };

#[test]
fn shells_in_a_white_environment_have_the_closed_form() {
    let filled = Shell { indices: [1.5, 1.33], sigmas: [0.2, 0.9], cavity: 0.8 };
    let dense = Shell { indices: [1.33, 2.42], sigmas: [0.6, 0.3], cavity: 0.5 };
    let thin = Shell { indices: [1.5, 1.0], sigmas: [2.0, 0.0], cavity: 0.99 };
    let impacts = [0.0, 0.2, 0.45, 0.58, 0.62, 0.75, 0.88, 0.92, 0.97];
    for scale in [1.0_f32, 1e-3, 250.0] {
        for shell in [HOLLOW, filled, dense, thin] {
            let world = shell.world(scale);
            for b in impacts {
                let (b, found, rays) = shell.seen(&world, scale, b, 16);
                let expected = shell.white(b) as f32;
                let what = format!("{:?} {:?} {b}: {found} {expected}", shell.indices, shell.way(b));
                // Towards the rim, light is reflected more often than a depth of sixteen follows.
                assert!((found - expected).abs() < if b > 0.9 { 2e-4 } else { 1e-5 }, "{what}");
                assert_eq!(rays.lost, 0, "{what}");
            }
        }
    }
    // All three ways were met.
    let ways: Vec<_> = [0.2, 0.75, 0.92].map(|b| HOLLOW.way(b)).into();
    assert_eq!(ways, [Way::Through, Way::Mirrored, Way::Beside]);
    // Controls: a ball without its cavity; an index two percent off; absorption along the whole chord of the outer sphere.
    let (b, whole) = (0.3, HOLLOW.white(0.3));
    let full = Shell { cavity: 1e-9, ..HOLLOW };
    let off = Shell { indices: [1.53, 1.0], ..HOLLOW };
    let saved = Shell { sigmas: [0.4; 2], ..HOLLOW };
    for (other, least) in [(full, 0.1), (off, 5e-4), (saved, 0.1)] {
        assert!((other.white(b) - whole).abs() > least, "{} {whole}", other.white(b));
    }
}

#[test]
fn clear_shells_of_any_filling_are_white() {
    for indices in [[1.5, 1.0], [1.5, 1.33], [1.33, 1.5], [2.42, 1.0]] {
        let shell = Shell { indices, sigmas: [0.0; 2], cavity: 0.8 };
        let world = shell.world(1.0);
        for step in 0..40 {
            let b = f64::from(step) * 0.0249;
            assert!((shell.white(b) - 1.0).abs() < 1e-12, "the closed form keeps light");
            for depth in [1, 5] {
                let (_, found, rays) = shell.seen(&world, 1.0, b, depth);
                assert!((found - 1.0).abs() < 1e-6 && rays.lost == 0, "{indices:?} {b} {depth}: {found}");
            }
        }
    }
}

/// Unit directions in which light leaves.
fn leaving(world: &World, eye: Vec3, depth: u32) -> Vec<DVec3> {
    let (triangles, spheres) = (&world.tree(), &world.spheres());
    let tracer = WithSpheres { triangles, spheres };
    let shot = Shot::of(world, eye, [eye + Vec3::NEG_Z]);
    let job = shot.job(RayProgram::Refraction, Corrected, auto(depth));
    let recorder = Recorder::new(&tracer, &world.scene.geometry, Some(shot.triangle[0]));
    cpu::trace_pixel(&recorder, &job, 0, 0).expect("a complete job");
    let left = recorder.events().into_iter().filter_map(|event| match event {
        Event::Ray(ray) if ray.outcome == Outcome::Miss => Some(ray.ray.direction.as_dvec3()),
        _ => None,
    });
    left.collect()
}

/// With index 1.5 and a cavity of 0.6 of the radius, light goes through the cavity below an impact parameter of 0.6. From there to 0.9 the cavity
/// mirrors it totally; above, it passes beside the cavity.
#[test]
fn light_leaves_a_hollow_ball_by_bouguers_angles() {
    for cavity in [0.3, 0.6, 0.9, 0.999] {
        let shell = Shell { sigmas: [0.0; 2], cavity, ..HOLLOW };
        let world = shell.world(1.0);
        for step in 1..50 {
            let eye = eye_at(f64::from(step) / 50.0, 1.0);
            let across = (eye - CENTER).as_dvec3().truncate();
            let (b, side) = (across.length(), across.normalize());
            // Next to the borders between the ways, the angle changes with the square root of the distance.
            if [1.5 * cavity, cavity].iter().any(|border| (b - border).abs() < 2e-3) {
                continue;
            }
            let (sin, cos) = shell.turned(b).sin_cos();
            let expected = DVec3::new(-sin * side.x, -sin * side.y, -cos);
            let off = leaving(&world, eye, 3).into_iter().map(|found| found.distance(expected));
            let off = off.fold(f64::INFINITY, f64::min);
            assert!(off < 2e-4, "{cavity} {b} {:?}: {off}", shell.way(b));
        }
    }
    // A very thin wall deflects nothing; control: a full ball does.
    let bubble = Shell { cavity: 0.999_99, ..HOLLOW };
    assert!(bubble.turned(0.5).abs() < 1e-4 && Shell { cavity: 1e-9, ..HOLLOW }.turned(0.5) > 0.3);
}

/// (1 - F)² (1 - F')² exp(-sigma (length in the wall)), with the angles of a line that is not bent.
#[test]
fn the_straight_shadow_of_a_hollow_ball_has_the_closed_form() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    for (index, sigma, radius) in [(1.5, 0.5, 1.0), (1.0, 0.0, 0.75)] {
        let material = world.dielectric(solid(index, Vec3::splat(sigma)));
        world.sphere(material, Vec3::new(0.0, 0.0, 2.0), radius);
    }
    let ground = world.paint(Vec3::ONE);
    world.quad(ground, Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0);
    let params = RayParams { shadow: GlassShadow::Straight, ..auto(5) };
    let half = |b: f64, radius: f64| (radius * radius - b * b).max(0.0).sqrt();
    for b in [0.0_f32, 0.3, 0.6, 0.74, 0.76, 0.9, 0.99] {
        let place = Vec3::new(0.6 * b, 0.8 * b, 0.0);
        let shot = Shot::of(&world, place + Vec3::new(0.0, 0.0, 0.05), [place]);
        let (pixels, _) = run(&world, &shot, RayProgram::Final, params);
        let found = (pixels[0][0] / shot.color[0][0] - 0.5) * 2.0;
        let b = f64::from(place.length());
        let (outer, inner) = (half(b, 1.0), half(b, 0.75));
        let face = |cos: f64| (1.0 - reflectance(cos, 1.5)).powi(2);
        let cavity = if b < 0.75 { face(inner / 0.75) } else { 1.0 };
        let expected = face(outer) * cavity * (-0.5 * 2.0 * (outer - inner)).exp();
        assert!((f64::from(found) - expected).abs() < 1e-5, "{b}: {found} {expected}");
        // Control: a full ball.
        assert!(b > 0.75 || (face(outer) * (-outer).exp() - expected).abs() > 0.02, "{b}");
    }
}

#[test]
fn shells_in_shells_are_followed_down_to_what_is_kept_and_counted_beyond() {
    for (bodies, overflows) in [(8, false), (32, true)] {
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
        for body in 0..bodies {
            let index = if body % 2 == 0 { 1.5 } else { 1.0 };
            let glass = world.dielectric(solid(index, Vec3::ZERO));
            world.sphere(glass, CENTER, 1.0 - body as f32 / 40.0);
        }
        let (pixel, rays) = look(&world, eye_at(0.1, 1.0), Vec3::NEG_Z, auto(3));
        assert_eq!(rays.lost > 0, overflows, "{bodies}: {rays:?}");
        assert!(pixel.iter().all(|value| (0.0..=1.0 + 1e-5).contains(value)), "{pixel:?}");
        if !overflows {
            assert_close(pixel, Vec3::ONE, 2e-6, bodies);
        }
    }
}
