//! The reference renderer against closed forms, each with a control that must fail.

mod glass;

use super::{Camera, Job, Look, ReferenceError, Seen, Traced, Value, render};
use curitiba_pipeline::backend::{Cone, Light, Shade, Sun};
use curitiba_pipeline::executor::Cancellation;
use curitiba_pipeline::glass::{Dielectric, GlassRule, GlassShadow, Shape};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{RayParams, RayProgram};
use curitiba_pipeline::progress::Progress;
use curitiba_pipeline::project::{self, Orthographic};
use curitiba_pipeline::scene::texture::Texture;
use curitiba_pipeline::scene::{Batch, RenderScene, Sphere};
use glam::{DVec2, DVec3, DVec4, Vec2, Vec3, Vec4};

/// A scene of quads, each with a material of its own.
#[derive(Default)]
struct Stage {
    scene: RenderScene,
    shades: Vec<Shade>,
    glass: Vec<bool>,
    /// Properties of glass by material; empty if all glass is the report's panes.
    dielectrics: Vec<Dielectric>,
    sun: Option<Sun>,
    lights: Vec<Light>,
    /// Colour of rays that leave the scene.
    beyond: DVec3,
}

impl Stage {
    /// Adds a quad around a centre. `right` and `up` are half its sides, and its normal is their cross product. Its
    /// material shows `color` without light.
    fn quad(&mut self, color: Vec3, center: Vec3, right: Vec3, up: Vec3) -> &mut Self {
        let geometry = &mut self.scene.geometry;
        let (first, material) = (geometry.positions.len() as u32, self.shades.len() as u32);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        geometry.positions.extend(corners.map(|(x, y)| center + right * x + up * y));
        geometry.normals.extend([right.cross(up).normalize(); 4]);
        geometry.texcoords.extend(corners.map(|(x, y)| Vec2::new(x, y) * 0.5 + 0.5));
        geometry.batches.push(Batch { material, first: geometry.triangles.len() as u32, count: 2 });
        geometry.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        self.shades.push(Shade { diffuse: (color / 0.3).extend(1.0), ..Shade::WHITE });
        self.glass.push(false);
        self
    }

    fn look(&self) -> Look<'_> {
        Look {
            shades: &self.shades,
            glass: &self.glass,
            shadow_glass: &self.glass,
            dielectrics: &self.dielectrics,
            sun: self.sun,
            lights: self.lights.clone(),
        }
    }

    fn job<'a>(&'a self, camera: Camera, size: [u32; 2], value: Value<'a>) -> Job<'a> {
        let seen = Seen { scene: &self.scene, camera, look: self.look(), culled: &[], clear_color: DVec4::W };
        Job { seen, value, size, samples: 0..32 }
    }

    fn traced(&self, program: RayProgram, params: RayParams) -> Value<'_> {
        let pass = Traced { program, params, look: self.look(), beyond: self.beyond };
        Value::Traced(Box::new(pass), Box::new(Value::Drawn))
    }
}

fn picture(job: &Job<'_>) -> [Image; 2] {
    render(job, &Progress::default()).expect("rendered")
}

/// The red channel of the mean of both estimates.
fn reds([first, second]: &[Image; 2]) -> Vec<f64> {
    first.pixels.iter().zip(&second.pixels).map(|(a, b)| (f64::from(a[0]) + f64::from(b[0])) / 2.0).collect()
}

/// Half the root mean square difference of the two estimates: the standard error of their mean.
fn own_error([first, second]: &[Image; 2]) -> f64 {
    let differences = first.pixels.iter().zip(&second.pixels).map(|(a, b)| f64::from(a[0]) - f64::from(b[0]));
    rms(&differences.collect::<Vec<_>>()) / 2.0
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

fn off(found: &[f64], expected: impl Fn(usize) -> f64) -> f64 {
    rms(&found.iter().enumerate().map(|(index, found)| found - expected(index)).collect::<Vec<_>>())
}

fn look_from(position: DVec3, target: DVec3, up: Vec3) -> project::Camera {
    project::Camera {
        name: String::new(),
        position,
        direction: (target - position).as_vec3().normalize(),
        up,
        fov_y: 1.0,
        near: 0.01,
        far: 1e4,
        orthographic: None,
        viewport: None,
    }
}

/// A camera that looks straight down on z = 0. A pixel is one unit wide; the first pixel's corner is at (0, 0), and y
/// decreases downwards in the picture.
fn from_above(side: u32) -> Camera {
    let side = side as f32;
    let orthographic = Some(Orthographic { left: 0.0, right: side, bottom: -side, top: 0.0 });
    let camera = look_from(DVec3::new(0.0, 0.0, 50.0), DVec3::ZERO, Vec3::Y);
    Camera::new(&project::Camera { orthographic, far: 100.0, ..camera }, DVec3::ZERO, 1.0)
}

/// The mean of a function over a pixel of [`from_above`], by midpoint sums.
fn over_pixel(index: usize, side: usize, function: impl Fn(DVec2) -> f64) -> f64 {
    const STEPS: usize = 64;
    let corner = DVec2::new((index % side) as f64, -((index / side) as f64));
    let at = |step: usize| {
        let (x, y) = (step % STEPS, step / STEPS);
        corner + DVec2::new(x as f64 + 0.5, -(y as f64 + 0.5)) / STEPS as f64
    };
    (0..STEPS * STEPS).map(|step| function(at(step))).sum::<f64>() / (STEPS * STEPS) as f64
}

#[test]
fn an_edge_covers_its_share_of_each_pixel_and_the_error_is_as_told() {
    let mut stage = Stage::default();
    // A quad covers everything to the right of the line through (6, 0) with slope 3 : 10.
    let (along, across) = (Vec3::new(3.0, -10.0, 0.0) * 4.0, Vec3::new(10.0, 3.0, 0.0) * 4.0);
    stage.quad(Vec3::ONE, Vec3::new(6.0, 0.0, 0.0) + across, across, along);
    let found = picture(&stage.job(from_above(16), [16, 16], Value::Drawn));
    let line = |slope: f64| {
        move |index: usize| over_pixel(index, 16, |at| f64::from(u8::from((at.x - 6.0) * 10.0 + at.y * slope > 0.0)))
    };
    let (error, own) = (off(&reds(&found), line(3.0)), own_error(&found));
    assert!(error < 0.004 && own > 0.5 * error && own < 2.0 * error, "{error}, told {own}");
    assert!(off(&reds(&found), line(2.9)) > 2.0 * own, "control: another slope goes unnoticed");
}

#[test]
fn textures_are_filtered_by_the_samples() {
    // A checker whose texels are a quarter of a pixel wide, and one whose texels are four pixels wide.
    for (texels, most) in [(64_usize, 0.03), (4, 0.003)] {
        let mut stage = Stage::default();
        stage.quad(Vec3::ONE, Vec3::new(8.0, -8.0, 0.0), Vec3::X * 8.0, Vec3::Y * 8.0);
        let checker = (0..texels * texels).map(|i| [255 * ((i % texels + i / texels) % 2) as u8; 4]);
        let side = texels as u32;
        stage.scene.textures.push(Texture::new("checker".into(), side, side, checker.collect()));
        stage.shades[0] = Shade { diffuse: Vec4::ONE, texture: Some(0), emission: Vec4::splat(0.7), ..Shade::WHITE };
        let found = picture(&stage.job(from_above(16), [16, 16], Value::Drawn));
        // Bilinear filtering of a checker is a product of triangle waves around one half.
        let wave = |at: f64| 1.0 - 2.0 * ((at * texels as f64 / 16.0 - 0.5).rem_euclid(2.0) - 1.0).abs();
        let shown =
            |shift: f64| move |index: usize| over_pixel(index, 16, |at| 0.5 - 0.5 * wave(at.x + shift) * wave(-at.y));
        let (error, own) = (off(&reds(&found), shown(0.0)), own_error(&found));
        assert!(error < 1.5 * own && own < most, "{texels}: {error}, told {own}");
        if texels == 4 {
            assert!(off(&reds(&found), shown(0.5)) > 0.05, "control: a texture that is moved goes unnoticed");
        }
    }
}

#[test]
fn a_mirror_shows_what_stands_mirrored_behind_it() {
    let camera =
        || Camera::new(&look_from(DVec3::new(0.3, -6.0, 2.0), DVec3::new(0.0, 0.0, 0.0), Vec3::Z), DVec3::ZERO, 1.0);
    let wall = |stage: &mut Stage, side: f32| {
        let colors = [Vec3::new(0.9, 0.2, 0.1), Vec3::new(0.1, 0.4, 0.8)];
        for (color, x) in colors.into_iter().zip([-2.0, 2.0]) {
            stage.quad(color, Vec3::new(x, 3.0, side * 2.5), Vec3::X * 2.0, Vec3::Z * (2.0 + 0.2 * x));
        }
    };
    let (mut stage, mut image) = (Stage::default(), Stage::default());
    stage.quad(Vec3::ONE, Vec3::ZERO, Vec3::X * 100.0, Vec3::Y * 100.0);
    stage.glass[0] = true;
    wall(&mut stage, 1.0);
    wall(&mut image, -1.0);
    wall(&mut image, 1.0);
    let size = [24, 24];
    let mirrored = stage.traced(RayProgram::Reflection, RayParams::default());
    let [found, _] = picture(&stage.job(camera(), size, mirrored));
    let [expected, _] = picture(&image.job(camera(), size, Value::Drawn));
    let furthest = |a: &Image, b: &Image| {
        let pixels = a.pixels.iter().zip(&b.pixels);
        pixels.flat_map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).abs())).fold(0.0_f32, f32::max)
    };
    assert!(furthest(&found, &expected) < 1e-6, "{}", furthest(&found, &expected));
    // Control: a wall that is not at its mirror image's place.
    let mut moved = Stage::default();
    wall(&mut moved, -1.02);
    wall(&mut moved, 1.0);
    assert!(furthest(&found, &picture(&moved.job(camera(), size, Value::Drawn))[0]) > 0.01);
}

#[test]
fn a_square_throws_its_shadow_along_the_light() {
    let mut stage = Stage::default();
    stage.quad(Vec3::ONE, Vec3::new(8.0, -8.0, 0.0), Vec3::X * 20.0, Vec3::Y * 20.0);
    // A square from 1.3 to 5.3 at a height of 6; the light displaces its shadow by (6, -3).
    stage.quad(Vec3::ONE, Vec3::new(3.3, -3.3, 6.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    stage.sun = Some(Sun { direction: Vec3::new(6.0, -3.0, -6.0).normalize(), color: Vec3::ONE });
    let found =
        picture(&stage.job(from_above(16), [16, 16], stage.traced(RayProgram::DeferredShadows, RayParams::default())));
    let shadow = |shift: f64| {
        move |index: usize| {
            over_pixel(index, 16, |at| {
                let from = at - DVec2::new(6.0 + shift, -3.0);
                let on = |at: DVec2| (1.3..5.3).contains(&at.x) && (1.3..5.3).contains(&-at.y);
                // The square itself is lit, and hides the part of its shadow below it.
                if on(from) && !on(at) { 0.5 } else { 1.0 }
            })
        }
    };
    let (error, own) = (off(&reds(&found), shadow(0.0)), own_error(&found));
    assert!(error < 3.0 * own.max(1e-3) && error < 0.005, "{error}, told {own}");
    assert!(off(&reds(&found), shadow(0.2)) > 3.0 * error, "control: a shadow that is moved goes unnoticed");
}

/// The visible fraction of a disc light at the zenith, `degrees` across. A half-plane, 6 units above the ground, hides the rest. The point on the
/// ground is not below the half-plane, at the horizontal distance `distance` from its edge.
fn seen_beside_an_edge(degrees: f64, distance: f64) -> f64 {
    const STEPS: usize = 256;
    let height = 1.0 - (degrees / 2.0).to_radians().cos();
    let at = |step: usize| (step as f64 + 0.5) / STEPS as f64;
    let seen = |cell: usize| {
        let cosine = 1.0 - height * at(cell % STEPS);
        let slope = (1.0 - cosine * cosine).sqrt() / cosine;
        6.0 * slope * (std::f64::consts::TAU * at(cell / STEPS)).cos() < distance
    };
    (0..STEPS * STEPS).filter(|cell| seen(*cell)).count() as f64 / (STEPS * STEPS) as f64
}

#[test]
fn a_disc_throws_the_penumbra_of_the_part_that_is_seen() {
    // A half-plane from x = 8 on, 6 above the ground: it is seen itself, and is lit.
    let mut stage = Stage::default();
    stage.quad(Vec3::splat(0.3), Vec3::new(8.0, -8.0, 0.0), Vec3::X * 40.0, Vec3::Y * 40.0);
    stage.quad(Vec3::splat(0.3), Vec3::new(48.0, -8.0, 6.0), Vec3::X * 40.0, Vec3::Y * 40.0);
    let sun = Sun { direction: Vec3::NEG_Z, color: Vec3::splat(0.7) };
    let params = |sun| RayParams { sun, sun_samples: 1, samples: 0, ..RayParams::default() };
    // Ambient light is 0.3 and the light adds 0.7: a point without the light has 0.3.
    let share = |dark: f64, degrees: f64| {
        let table: Vec<f64> = (0..=512).map(|step| seen_beside_an_edge(degrees, f64::from(step) / 64.0)).collect();
        let lit = move |seen: f64| dark + (1.0 - dark) * seen;
        move |index: usize| {
            over_pixel(index, 16, |at| match at.x < 8.0 {
                true => lit(table[((8.0 - at.x) * 64.0).round() as usize]),
                false => lit(1.0),
            })
        }
    };
    let light = Light { place: None, direction: Vec3::NEG_Z, color: sun.color, ..lamp(Vec3::ZERO, Vec3::ONE) };
    for (several, program, dark) in [
        (false, RayProgram::DeferredShadows, 0.5),
        (true, RayProgram::DeferredShadows, 0.3),
        (false, RayProgram::Final, 0.5),
        (true, RayProgram::Final, 0.3),
    ] {
        (stage.sun, stage.lights) = if several { (None, vec![light]) } else { (Some(sun), Vec::new()) };
        let found = picture(&stage.job(from_above(16), [16, 16], stage.traced(program, params(40.0))));
        let (error, own) = (off(&reds(&found), share(dark, 40.0)), own_error(&found));
        assert!(error < 2.0 * own && own < 0.006, "{program:?}, {several}: {error}, told {own}");
        let other = off(&reds(&found), share(dark, 34.0));
        assert!(other > 2.0 * error && other > 0.004, "control: {program:?}, {several}: {other} for {error}");
    }
}

#[test]
fn beside_a_wall_the_open_share_is_the_closed_form_whatever_its_power() {
    let mut stage = Stage::default();
    stage.quad(Vec3::ONE, Vec3::ZERO, Vec3::X * 3000.0, Vec3::Y * 3000.0);
    // A wall at x = 0, two units high and practically endless.
    stage.quad(Vec3::ONE, Vec3::new(-1e-3, 0.0, 0.0), Vec3::Z * 2.0, Vec3::Y * 3000.0);
    for intensity in [1.0_f32, 1.6] {
        let params = RayParams { samples: 1, radius: 1e5, intensity, ..RayParams::default() };
        let found = picture(&stage.job(from_above(12), [12, 12], stage.traced(RayProgram::Ssao, params)));
        // Form factor of the wall at distance d: (1 - d / sqrt(d^2 + h^2)) / 2.
        let open = |power: f64| {
            move |index: usize| over_pixel(index, 12, |at| (0.5 + 0.5 * at.x / (at.x * at.x + 4.0).sqrt()).powf(power))
        };
        let power = f64::from(intensity);
        let (reds, own) = (reds(&found), own_error(&found));
        let error = off(&reds, open(power));
        assert!(error < 1.5 * own && own < 0.01, "{intensity}: {error}, told {own}");
        let bias = |power: f64| {
            let differences = reds.iter().enumerate().map(|(index, red)| red - open(power)(index));
            (differences.sum::<f64>() / 144.0).abs()
        };
        assert!(bias(power) < 4e-4, "{intensity}: {}", bias(power));
        assert!(bias(power * 1.05) > 2e-3, "control: another power goes unnoticed");
    }
}

#[test]
fn a_pane_shows_fresnels_share_of_what_it_mirrors_and_the_rest_of_what_is_behind() {
    let mut stage = Stage::default();
    stage.quad(Vec3::ONE, Vec3::new(8.0, -8.0, 0.0), Vec3::X * 50.0, Vec3::Y * 50.0);
    stage.glass[0] = true;
    stage.quad(Vec3::new(0.2, 0.4, 0.6), Vec3::new(8.0, -8.0, -9.0), Vec3::X * 50.0, Vec3::Y * 50.0);
    for index in [1.1_f32, 1.5] {
        let params = RayParams { index, ..RayParams::default() };
        let pass = Traced { program: RayProgram::Refraction, params, look: stage.look(), beyond: DVec3::ONE };
        let job = stage.job(from_above(4), [4, 4], Value::Traced(Box::new(pass), Box::new(Value::Drawn)));
        let share = ((f64::from(index) - 1.0) / (f64::from(index) + 1.0)).powi(2);
        for pixel in &picture(&job)[0].pixels {
            for (found, behind) in pixel.iter().zip([0.2, 0.4, 0.6]) {
                assert!((f64::from(*found) - (share + (1.0 - share) * behind)).abs() < 1e-6, "{index}: {pixel:?}");
                assert!((f64::from(*found) - behind).abs() > 1e-4, "control");
            }
        }
    }
}

/// A small scene with several kinds of surfaces, displaced by `moved`.
fn crowd(moved: Vec3) -> Stage {
    let mut stage = Stage::default();
    stage.quad(Vec3::splat(0.7), moved, Vec3::X * 8.0, Vec3::Y * 8.0);
    stage.quad(Vec3::new(0.8, 0.3, 0.2), moved + Vec3::new(-2.0, 3.0, 1.5), Vec3::X * 2.0, Vec3::Z * 1.5);
    stage.quad(Vec3::ONE, moved + Vec3::new(1.5, -1.0, 1.0), Vec3::new(1.5, 0.5, 0.0), Vec3::Z);
    stage.glass[2] = true;
    stage.quad(Vec3::new(0.2, 0.6, 0.4), moved + Vec3::new(2.0, 2.0, 2.5), Vec3::X, Vec3::new(0.0, 1.0, 0.5));
    stage.sun = Some(Sun { direction: Vec3::new(0.4, 0.5, -0.8).normalize(), color: Vec3::splat(0.9) });
    stage
}

fn of_crowd(moved: Vec3, samples: u32) -> [Image; 2] {
    let stage = crowd(moved);
    let camera = look_from(moved.as_dvec3() + DVec3::new(3.0, -8.0, 5.0), moved.as_dvec3(), Vec3::Z);
    let value = stage.traced(RayProgram::Final, RayParams { samples: 1, radius: 2.0, ..RayParams::default() });
    picture(&Job { samples: 0..samples / 2, ..stage.job(Camera::new(&camera, DVec3::ZERO, 1.0), [40, 40], value) })
}

#[test]
fn a_scene_far_away_shows_the_same() {
    let here = of_crowd(Vec3::ZERO, 64);
    // With this displacement all coordinates stay exact in f32.
    let far = of_crowd(Vec3::new(65_536.0, -32_768.0, 8192.0), 64);
    let differ = here[0].pixels.iter().zip(&far[0].pixels).filter(|(a, b)| (0..3).any(|i| (a[i] - b[i]).abs() > 1e-6));
    let count = differ.count();
    assert!(count <= 2, "{count} of 1600 pixels differ");
    // Control: in f32 alone, half of a pixel's samples would change there. This camera is displaced by one step of f32.
    let camera = look_from(DVec3::new(3.0 + 0.0078, -8.0, 5.0), DVec3::new(0.0078, 0.0, 0.0), Vec3::Z);
    let stage = crowd(Vec3::ZERO);
    let value = stage.traced(RayProgram::Final, RayParams { samples: 1, radius: 2.0, ..RayParams::default() });
    let moved = picture(&Job { samples: 0..32, ..stage.job(Camera::new(&camera, DVec3::ZERO, 1.0), [40, 40], value) });
    let differ =
        here[0].pixels.iter().zip(&moved[0].pixels).filter(|(a, b)| (0..3).any(|i| (a[i] - b[i]).abs() > 1e-6));
    let count = differ.count();
    assert!(count > 20, "control: {count}");
}

/// A light at a place whose light falls off with the square of the distance.
fn lamp(place: Vec3, color: Vec3) -> Light {
    let attenuation = [0.0, 0.0, 1.0];
    Light { place: Some(place), direction: Vec3::ZERO, color, attenuation, range: f32::INFINITY, cone: None }
}

#[test]
fn lamps_light_a_plane_by_the_inverse_square_add_and_end_at_their_cones() {
    let mut stage = Stage::default();
    stage.quad(Vec3::splat(0.3), Vec3::new(8.0, -8.0, 0.0), Vec3::X * 20.0, Vec3::Y * 20.0);
    let cosine = 0.75_f32.atan().cos();
    let cone = Some(Cone { inner: cosine, outer: cosine, exponent: 2.0 });
    let spot = Light { direction: Vec3::NEG_Z, cone, ..lamp(Vec3::new(10.0, -10.0, 6.0), Vec3::new(60.0, 30.0, 0.0)) };
    stage.lights = vec![lamp(Vec3::new(4.0, -4.0, 5.0), Vec3::splat(40.0)), spot];
    let arriving = |at: DVec2, place: DVec3, most: f64| {
        let way = place - at.extend(0.0);
        let cosine = way.z / way.length();
        if cosine >= most { cosine / way.length_squared() } else { 0.0 }
    };
    let lit = |radius: f64| {
        move |index: usize| {
            over_pixel(index, 16, |at| {
                let spot = DVec3::new(10.0, -10.0, 6.0);
                let slope = 6.0 / (at.extend(0.0) - spot).length();
                let edge = 6.0 / (36.0 + radius * radius).sqrt();
                let spot = 60.0 * arriving(at, spot, edge) * slope * slope;
                0.3 + 40.0 * arriving(at, DVec3::new(4.0, -4.0, 5.0), 0.0) + spot
            })
        }
    };
    let found = picture(&stage.job(from_above(16), [16, 16], Value::Drawn));
    let (error, own) = (off(&reds(&found), lit(4.5)), own_error(&found));
    assert!(error < 2.0 * own && own < 0.01, "{error}, told {own}");
    assert!(off(&reds(&found), lit(4.3)) > 3.0 * error, "control: another cone goes unnoticed");
}

#[test]
fn a_square_below_a_lamp_throws_a_larger_shadow() {
    let mut stage = Stage::default();
    stage.quad(Vec3::splat(0.3), Vec3::new(8.0, -8.0, 0.0), Vec3::X * 20.0, Vec3::Y * 20.0);
    // A square from 7 to 9 at half the height of a lamp above its middle: the square's shadow is from 6 to 10, and the square hides the
    // middle of that shadow.
    stage.quad(Vec3::splat(0.3), Vec3::new(8.0, -8.0, 4.0), Vec3::X, Vec3::Y);
    // A square above the lamp casts no shadow; the camera stands below this square.
    stage.quad(Vec3::splat(0.3), Vec3::new(8.0, -8.0, 90.0), Vec3::X * 20.0, Vec3::Y * 20.0);
    stage.lights = vec![lamp(Vec3::new(8.0, -8.0, 8.0), Vec3::splat(50.0))];
    let traced = stage.traced(RayProgram::DeferredShadows, RayParams::default());
    let found = picture(&stage.job(from_above(16), [16, 16], traced));
    let share = |side: f64| {
        move |index: usize| {
            over_pixel(index, 16, |at| {
                let from = (at - DVec2::new(8.0, -8.0)).abs().max_element();
                let way = DVec3::new(8.0, -8.0, 8.0) - at.extend(0.0);
                let light = 50.0 * way.z / way.length().powi(3);
                if (1.0..side).contains(&from) { 0.3 / (0.3 + light) } else { 1.0 }
            })
        }
    };
    let error = off(&reds(&found), share(2.0));
    assert!(error < 1e-4 && off(&reds(&found), share(2.1)) > 1e-3, "{error}");
}

#[test]
fn pictures_depend_neither_on_threads_nor_on_the_estimate_beside() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| of_crowd(Vec3::ZERO, 8))
    };
    let [first, second] = on(1);
    assert_eq!([first.clone(), second.clone()], on(3));
    assert_ne!(first, second, "two estimates have random numbers of their own");
}

#[test]
fn what_it_cannot_do_is_refused_and_it_can_be_given_up() {
    let stage = crowd(Vec3::ZERO);
    let request = Cancellation::new();
    request.cancel();
    let given_up = render(&stage.job(from_above(4), [4, 4], Value::Drawn), &Progress::until(&request));
    assert!(matches!(given_up, Err(ReferenceError::Cancelled)));
    let sphere = |material| Sphere { center: Vec3::ZERO, radius: 1.0, material };
    let solid = Dielectric { shape: Shape::Solid, index: 1.5, filter: Vec3::ONE, ..Dielectric::default() };
    let table = [Dielectric::default(), solid, Dielectric { index: 1.0, ..solid }];
    let look = |dielectrics, dims: &'static [bool]| Look { shadow_glass: dims, dielectrics, ..stage.look() };
    let (plain, bodies, clear) = (look(&[], &[true]), look(&table, &[false, true, true]), look(&table, &[]));
    let refused = |program, params: RayParams, look: &Look<'_>, spheres: &[Sphere]| {
        Traced::unsupported(program, &params, look, spheres)
    };
    let report = RayParams::default();
    for program in [RayProgram::DeferredShadows, RayProgram::Reflection, RayProgram::Ssao, RayProgram::Final] {
        assert_eq!(refused(program, report, &plain, &[]), None);
        assert_eq!(refused(program, report, &bodies, &[sphere(1)]), None);
    }
    assert!(refused(RayProgram::PathTracing, report, &plain, &[]).is_some_and(|why| why.contains("camera")));
    let straight = RayParams { shadow: GlassShadow::Straight, ..report };
    assert!(refused(RayProgram::Final, straight, &plain, &[]).is_some_and(|why| why.contains("shadow=report")));
    assert_eq!(refused(RayProgram::Final, straight, &clear, &[sphere(1)]), None, "nothing lets light through");
    assert_eq!(refused(RayProgram::Final, straight, &bodies, &[sphere(1)]), None);
    let caustic = RayParams { shadow: GlassShadow::Caustic, ..report };
    let focuses = refused(RayProgram::Final, caustic, &bodies, &[sphere(0), sphere(1)]);
    assert!(focuses.is_some_and(|why| why.contains("shadow=straight")));
    assert_eq!(refused(RayProgram::Final, caustic, &bodies, &[sphere(0), sphere(2)]), None, "they bend nothing");
    let shot = RayParams { photons: 1000, glass: GlassRule::Auto, ..caustic };
    assert!(refused(RayProgram::Final, shot, &bodies, &[]).is_some_and(|why| why.contains("photons=1000")));
    let flat = look(&table[..1], &[true]);
    assert_eq!(refused(RayProgram::Final, shot, &flat, &[]), None, "photons are shot at nothing");
}
