//! Glass as its materials say, and exact spheres, against closed forms.

use super::super::facets::Facet;
use super::super::optics::Interface;
use super::super::points::{Points, Purpose};
use super::super::spectrum;
use super::super::world::World;
use super::*;
use curitiba_pipeline::glass::Reflectance;

fn solid(index: f32, extinction: Vec3) -> Dielectric {
    Dielectric { shape: Shape::Solid, index, extinction, filter: Vec3::ONE, ..Dielectric::default() }
}

fn thin(index: f32) -> Dielectric {
    Dielectric { shape: Shape::Thin, ..solid(index, Vec3::ZERO) }
}

impl Stage {
    /// A stage in white surroundings.
    fn white() -> Self {
        Self { beyond: DVec3::ONE, ..Self::default() }
    }

    /// Makes the material that was added last one of glass.
    fn of_glass(&mut self, dielectric: Dielectric) -> &mut Self {
        let last = self.shades.len() - 1;
        self.dielectrics.resize(last, Dielectric::default());
        self.dielectrics.push(dielectric);
        self.glass[last] = true;
        self
    }

    /// Adds an exact sphere of glass.
    fn sphere(&mut self, dielectric: Dielectric, center: Vec3, radius: f32) -> &mut Self {
        self.shades.push(Shade::WHITE);
        self.glass.push(false);
        let material = self.shades.len() as u32 - 1;
        self.scene.geometry.spheres.push(Sphere { center, radius, material });
        self.of_glass(dielectric)
    }

    /// Adds a block of glass: six quads of one material that face outwards.
    fn block(&mut self, dielectric: Dielectric, center: Vec3, half: Vec3) -> &mut Self {
        let (material, first) = (self.shades.len(), self.scene.geometry.batches.len());
        for (x, y, z) in [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)] {
            for side in [1.0, -1.0] {
                self.quad(Vec3::ONE, center + z * half * side, x * half * side, y * half);
            }
        }
        self.scene.geometry.batches[first..].iter_mut().for_each(|batch| batch.material = material as u32);
        self.shades.truncate(material + 1);
        self.glass.truncate(material + 1);
        self.of_glass(dielectric)
    }

    /// Gives default properties to the materials that are not glass. It must be the last call before pictures.
    fn settled(mut self) -> Self {
        self.dielectrics.resize(self.shades.len(), Dielectric::default());
        self
    }

    /// The colour that is seen along a ray.
    fn along(&self, origin: DVec3, direction: DVec3, params: RayParams) -> DVec3 {
        self.shown_by(RayProgram::Refraction, (origin, direction), params)
    }

    /// The colour that a program shows along a ray.
    fn shown_by(&self, program: RayProgram, (origin, direction): (DVec3, DVec3), params: RayParams) -> DVec3 {
        let narrow = project::Camera { fov_y: 1e-9, ..look_from(origin, origin + direction, Vec3::Y) };
        let value = self.traced(program, params);
        let job = Job { samples: 0..4, ..self.job(Camera::new(&narrow, DVec3::ZERO, 1.0), [1, 1], value) };
        let [first, second] = picture(&job).map(|image| Vec4::from_array(image.pixels[0]).as_dvec4().truncate());
        0.5 * (first + second)
    }

    fn straight(&self, origin: DVec3, direction: DVec3, reach: f64) -> DVec3 {
        let world = World::new(&self.scene, &self.glass).expect("there is memory");
        self.look().straight(&world, (origin, direction), reach)
    }
}

fn to_depth(depth: u32) -> RayParams {
    RayParams { depth, samples: 0, ..RayParams::default() }
}

/// The direction that leans by this angle from straight down, in the plane of x and z.
fn down(degrees: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    DVec3::new(sin, 0.0, -cos)
}

/// The reflectance from both angles (Hecht, Optics, section 4.6), and the cosine of the refracted angle.
fn by_angles(degrees: f64, index: f64) -> (f64, f64) {
    let angle = degrees.to_radians().max(1e-7);
    let inner = (angle.sin() / index).asin();
    let across = ((angle - inner).sin() / (angle + inner).sin()).powi(2);
    let parallel = ((angle - inner).tan() / (angle + inner).tan()).powi(2);
    (0.5 * (across + parallel), inner.cos())
}

fn close(found: DVec3, expected: DVec3, most: f64) -> bool {
    (found - expected).abs().max_element() < most
}

#[test]
fn a_plate_in_white_surroundings_is_the_sum_of_all_its_reflections() {
    let extinction = Vec3::new(0.0, 0.5, 2.0);
    for index in [1.33_f32, 1.5, 2.42] {
        let mut stage = Stage::white();
        stage.block(solid(index, extinction), Vec3::ZERO, Vec3::new(400.0, 400.0, 0.5));
        let stage = stage.settled();
        for degrees in [0.0, 30.0, 60.0, 80.0] {
            let (r, inner) = by_angles(degrees, f64::from(index));
            let a = extinction.as_dvec3().map(|extinction| (-extinction / inner).exp());
            let expected = r + (1.0 - r) * (1.0 - r) * a / (1.0 - r * a);
            let found = stage.along(DVec3::new(0.3, 0.4, 5.0), down(degrees), to_depth(24));
            assert!(close(found, expected, 2e-6), "{index} {degrees}: {found} {expected}");
            let once = r + (1.0 - r) * (1.0 - r) * a / (1.0 - r);
            assert!(!close(once, expected, 1e-3), "control: absorption on the first way alone");
        }
        // From the middle of the plate: white light that enters through the faces, after reflections at both of them.
        let critical = (1.0 / f64::from(index)).asin().to_degrees();
        for inside in [0.0, 0.9 * critical] {
            let outside = (f64::from(index) * inside.to_radians().sin()).asin().to_degrees();
            let ((r, _), cos) = (by_angles(outside, f64::from(index)), inside.to_radians().cos());
            let [half, whole] = [0.5, 1.0].map(|length: f64| (-extinction.as_dvec3() * length / cos).map(f64::exp));
            let expected = half * (1.0 - r) / (1.0 - r * whole);
            let found = stage.along(DVec3::new(0.3, 0.4, 0.0), down(inside), to_depth(24));
            assert!(close(found, expected, 2e-6), "{index}, from inside at {inside}: {found} {expected}");
        }
        let trapped = stage.along(DVec3::new(0.3, 0.4, 0.0), down(critical + 1.0), to_depth(24));
        assert_eq!(trapped, DVec3::ZERO, "{index}: beyond the critical angle no light comes in");
    }
}

#[test]
fn a_sphere_in_white_surroundings_is_the_sum_of_all_its_reflections() {
    let extinction = Vec3::new(0.0, 0.3, 1.5);
    let (center, radius) = (Vec3::new(3.0, -2.0, 1.0), 0.75_f32);
    let filter = Vec3::new(1.0, 0.5, 0.8);
    for index in [1.0_f32, 1.33, 1.5, 2.42] {
        let mut stage = Stage::white();
        stage.sphere(Dielectric { filter, ..solid(index, extinction) }, center, radius);
        let stage = stage.settled();
        for sine in [0.0_f64, 0.4, 0.9, 0.999] {
            let (r, inner) = by_angles(sine.asin().to_degrees(), f64::from(index));
            let a = extinction.as_dvec3().map(|share| (-share * 2.0 * f64::from(radius) * inner).exp());
            let f = filter.as_dvec3();
            let expected = r + (1.0 - r) * (1.0 - r) * f * f * a / (1.0 - r * a);
            let from = center.as_dvec3() + DVec3::new(sine * f64::from(radius), 0.0, 4.0);
            let found = stage.along(from, DVec3::NEG_Z, to_depth(24));
            assert!(close(found, expected, 1e-5), "{index} {sine}: {found} {expected}");
            let unfiltered = r + (1.0 - r) * (1.0 - r) * a / (1.0 - r * a);
            assert!(!close(unfiltered, expected, 1e-3), "control");
            let beside = from + DVec3::X * 2.0 * f64::from(radius);
            assert_eq!(
                stage.along(beside, DVec3::NEG_Z, to_depth(24)),
                DVec3::ZERO,
                "what is not hit is what is drawn"
            );
        }
    }
}

/// What two layers reflect and transmit together, seen from the first: the sum of all reflections between them.
fn joined(first: [DVec3; 2], second: [DVec3; 2]) -> [DVec3; 2] {
    let rounds = (DVec3::ONE - first[0] * second[0]).recip();
    [first[0] + first[1] * first[1] * second[0] * rounds, first[1] * second[1] * rounds]
}

#[test]
fn shells_are_layers_one_behind_another() {
    let (glass, water) = (Vec3::new(0.1, 0.4, 0.0), Vec3::new(0.5, 0.0, 0.2));
    let mut stage = Stage::white();
    // Around one centre: glass, water in it, and a bubble in the water.
    stage.sphere(solid(1.5, glass), Vec3::ZERO, 1.0);
    stage.sphere(solid(1.33, water), Vec3::ZERO, 0.8);
    stage.sphere(solid(1.0, Vec3::ZERO), Vec3::ZERO, 0.5);
    let found = stage.settled().along(DVec3::Z * 3.0, DVec3::NEG_Z, to_depth(12));
    let border = |ratio: f64| {
        let r = ((ratio - 1.0) / (ratio + 1.0)).powi(2);
        [DVec3::splat(r), DVec3::splat(1.0 - r)]
    };
    let way = |extinction: Vec3, length: f64| [DVec3::ZERO, (-extinction.as_dvec3() * length).map(f64::exp)];
    let half = [border(1.5), way(glass, 0.2), border(1.33 / 1.5), way(water, 0.3), border(1.0 / 1.33)];
    let bubble = [DVec3::ZERO, DVec3::ONE];
    let layers = half.into_iter().chain([bubble]).chain(half.into_iter().rev());
    let [reflected, passed] = layers.rev().reduce(|behind, layer| joined(layer, behind)).expect("layers");
    assert!(close(found, reflected + passed, 1e-5), "{found} {}", reflected + passed);
    let full = way(glass, 2.0)[1];
    assert!(!close(found, full, 0.1), "control: a full ball");
}

#[test]
fn a_wall_has_the_sum_of_its_reflections_and_its_filter() {
    let own = Dielectric {
        thickness: 0.4,
        extinction: Vec3::new(0.0, 1.0, 3.0),
        filter: Vec3::new(0.9, 0.6, 0.3),
        ..thin(1.5)
    };
    let behind = DVec3::new(0.2, 0.4, 0.6);
    let mut stage = Stage::white();
    stage.quad(Vec3::ONE, Vec3::ZERO, Vec3::X * 400.0, Vec3::Y * 400.0).of_glass(own);
    stage.quad(behind.as_vec3(), Vec3::NEG_Z * 9.0, Vec3::X * 900.0, Vec3::Y * 900.0);
    let stage = stage.settled();
    for degrees in [0.0, 40.0, 75.0] {
        let (r, inner) = by_angles(degrees, 1.5);
        let a = own.extinction.as_dvec3().map(|extinction| (-extinction * 0.4_f32 as f64 / inner).exp());
        let (mut reflected, mut passed) = (DVec3::splat(r), DVec3::ZERO);
        let mut inside = (1.0 - r) * a;
        for _ in 0..60 {
            passed += (1.0 - r) * inside;
            reflected += (1.0 - r) * r * a * inside;
            inside *= r * r * a * a;
        }
        let found = stage.along(DVec3::new(0.2, 0.1, 3.0), down(degrees), to_depth(5));
        let expected = reflected + passed * own.filter.as_dvec3() * behind;
        assert!(close(found, expected, 1e-6), "{degrees}: {found} {expected}");
        assert!(!close(found, r + (1.0 - r) * own.filter.as_dvec3() * behind, 1e-2), "control: one face alone");
    }
}

#[test]
fn index_1_is_not_seen_and_neither_is_its_shadow() {
    let picture_of = |index: Option<f32>| {
        let mut stage = crowd(Vec3::ZERO);
        stage.of_glass(Dielectric::default());
        stage.glass = vec![false; 4];
        if let Some(index) = index {
            stage.sphere(solid(index, Vec3::ZERO), Vec3::new(0.0, -1.0, 1.5), 1.2);
            stage.block(solid(index, Vec3::ZERO), Vec3::new(-2.5, -2.0, 1.0), Vec3::splat(0.7));
        }
        let stage = stage.settled();
        let params = RayParams { shadow: GlassShadow::Straight, ..to_depth(5) };
        let camera = look_from(DVec3::new(3.0, -8.0, 5.0), DVec3::ZERO, Vec3::Z);
        let job = stage.job(Camera::new(&camera, DVec3::ZERO, 1.0), [40, 40], stage.traced(RayProgram::Final, params));
        let [image, _] = picture(&Job { samples: 0..8, ..job });
        image
    };
    let most = |a: &Image, b: &Image| {
        let pixels = a.pixels.iter().zip(&b.pixels);
        pixels.flat_map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).abs())).fold(0.0_f32, f32::max)
    };
    let without = picture_of(None);
    let off = most(&picture_of(Some(1.0)), &without);
    assert!(off < 1e-6, "{off}");
    assert!(most(&picture_of(Some(1.05)), &without) > 0.1, "control");
}

#[test]
fn straight_light_keeps_what_surfaces_and_ways_leave() {
    let (glass, water) = (Vec3::new(0.1, 0.4, 0.0), Vec3::new(0.5, 0.0, 0.2));
    let filter = Vec3::new(0.9, 0.8, 0.7);
    let block = |priority, index, extinction| Dielectric { priority, filter, ..solid(index, extinction) };
    // Water from z = 0 to 3 reaches by 0.5 into glass from 2.5 to 4.
    let stage = |priorities: [u8; 2]| {
        let mut stage = Stage::default();
        stage.block(block(priorities[0], 1.5, glass), Vec3::Z * 3.25, Vec3::new(90.0, 90.0, 0.75));
        stage.block(block(priorities[1], 1.33, water), Vec3::Z * 1.5, Vec3::new(80.0, 80.0, 1.5));
        stage.settled()
    };
    let expected = |degrees: f64, [in_glass, in_water]: [f64; 2], seen: i32| {
        let slant = degrees.to_radians().cos();
        let kept = |extinction: Vec3, length: f64| (-extinction.as_dvec3() * length / slant).map(f64::exp);
        let faces = [1.5, 1.5 / 1.33, 1.33].map(|ratio| 1.0 - by_angles(degrees, ratio).0);
        faces.iter().product::<f64>()
            * filter.as_dvec3().powf(seen.into())
            * kept(glass, in_glass)
            * kept(water, in_water)
    };
    for degrees in [0.0, 50.0] {
        for (priorities, lengths) in [([2, 1], [1.5, 2.5]), ([1, 2], [1.0, 3.0])] {
            let stage = stage(priorities);
            let (up, to) = (-down(degrees), expected(degrees, lengths, 3));
            let found = stage.straight(DVec3::new(0.2, 0.3, -1.0), up, f64::INFINITY);
            assert!(close(found, to, 1e-6), "{degrees} {priorities:?}: {found} {to}");
            let back = stage.straight(DVec3::new(0.2, 0.3, 5.0), -up, f64::INFINITY);
            assert!(close(back, to, 1e-6), "{degrees} {priorities:?}, the other way: {back} {to}");
            assert!(!close(found, expected(degrees, [1.5, 3.0], 4), 1e-2), "control: both fill the same place");
        }
    }
    // From inside the water to a lamp in the glass: one border, and a path in each body.
    let found = stage([2, 1]).straight(DVec3::new(0.0, 0.0, 2.0), DVec3::Z, 1.5);
    let r = ((1.5 / 1.33_f64 - 1.0) / (1.5 / 1.33 + 1.0)).powi(2);
    let kept = (-0.5 * water.as_dvec3() - glass.as_dvec3()).map(f64::exp);
    assert!(close(found, (1.0 - r) * filter.as_dvec3() * kept, 1e-6), "{found}");
    // A sphere hit off its middle: the angle that counts is the one outside.
    let mut ball = Stage::default();
    ball.sphere(solid(1.5, glass), Vec3::ZERO, 1.0);
    let found = ball.settled().straight(DVec3::new(0.8, 0.0, -3.0), DVec3::Z, f64::INFINITY);
    let (r, _) = by_angles(0.8_f64.asin().to_degrees(), 1.5);
    assert!(close(found, (1.0 - r) * (1.0 - r) * (-glass.as_dvec3() * 1.2).map(f64::exp), 1e-6), "{found}");
}

#[test]
fn a_block_throws_the_shadow_that_straight_light_leaves() {
    let glass = Dielectric { filter: Vec3::new(0.9, 0.5, 0.2), ..solid(1.5, Vec3::new(0.0, 0.2, 0.4)) };
    let mut stage = Stage::default();
    stage.quad(Vec3::splat(0.6), Vec3::new(8.0, -8.0, 0.0), Vec3::X * 40.0, Vec3::Y * 40.0);
    stage.block(glass, Vec3::new(4.0, -4.0, 6.0), Vec3::new(3.0, 3.0, 0.5));
    let mut stage = stage.settled();
    let direction = Vec3::new(1.0, -1.0, -1.0).normalize();
    let sun = Sun { direction, color: Vec3::ZERO };
    let lamp = Light { place: None, direction, color: Vec3::splat(0.5), ..lamp(Vec3::ZERO, Vec3::ONE) };
    let slant = 3.0_f64.sqrt();
    let (r, _) = by_angles((1.0 / slant).acos().to_degrees(), 1.5);
    let (filter, kept) = (glass.filter.as_dvec3(), (-glass.extinction.as_dvec3() * slant).map(f64::exp));
    let passes = (1.0 - r) * (1.0 - r) * filter * filter * kept;
    let (diffuse, arriving) = (DVec3::splat(2.0), 0.5 / slant);
    // The sun's shadow takes at most half of the colour; with several lights, ambient light stays.
    let cases =
        [(Some(sun), Vec::new(), 0.6 * (0.5 + 0.5 * passes)), (None, vec![lamp], diffuse * (0.3 + arriving * passes))];
    for (sun, lights, expected) in cases {
        (stage.sun, stage.lights) = (sun, lights);
        for (shadow, sees) in [(GlassShadow::Straight, true), (GlassShadow::Report, false)] {
            let params = RayParams { shadow, ..to_depth(5) };
            let [image, _] = picture(&stage.job(from_above(16), [16, 16], stage.traced(RayProgram::Final, params)));
            let found = Vec4::from_array(image.pixels[16 * 10 + 10]).as_dvec4().truncate();
            assert_eq!(close(found, expected, 1e-6), sees, "{shadow:?}: {found} {expected}");
        }
    }
}

#[test]
fn a_surface_scatters_back_what_it_does_not_let_pass_and_has_a_reflectance_of_its_own() {
    let veiled = Dielectric { veil: 0.25, filter: Vec3::new(0.9, 0.6, 0.3), ..thin(1.5) };
    let curve = Reflectance { minimum: 0.1, maximum: 0.9, exponent: 3.0 };
    let tinted = Dielectric { reflectance: Some(curve), reflection: Some(Vec3::new(1.0, 0.5, 0.0)), ..veiled };
    for (glass, degrees) in [(veiled, 40.0_f64), (tinted, 40.0), (tinted, 70.0)] {
        let mut stage = Stage::white();
        stage.quad(Vec3::splat(0.4), Vec3::ZERO, Vec3::X * 400.0, Vec3::Y * 400.0).of_glass(glass);
        let found = stage.settled().along(DVec3::Z, down(degrees), to_depth(5));
        let r = match glass.reflectance {
            None => by_angles(degrees, 1.5).0,
            Some(_) => 0.1 + 0.8 * (1.0 - degrees.to_radians().cos()).powi(3),
        };
        let passes = (1.0 - r) * (1.0 - r) / (1.0 - r * r);
        let color = glass.reflection.unwrap_or(Vec3::ONE).as_dvec3();
        let clear = 0.75 * glass.filter.as_dvec3();
        let expected = (1.0 - passes) * color + passes * (clear + 0.25 * 0.4);
        assert!(close(found, expected, 1e-6), "{degrees}: {found} {expected}");
    }
}

#[test]
fn beyond_the_depth_light_goes_through_with_the_weight_of_both() {
    let mut stage = Stage { beyond: DVec3::new(0.0, 0.0, 1.0), ..Stage::default() };
    stage.block(solid(1.5, Vec3::ZERO), Vec3::ZERO, Vec3::new(400.0, 400.0, 0.5));
    stage.quad(Vec3::X, Vec3::NEG_Z * 2.0, Vec3::X * 900.0, Vec3::Y * 900.0);
    let stage = stage.settled();
    // Blue comes from above: the upper face reflects it, and so does the lower one. From depth 3 on, the upper face takes a part of what the
    // lower one reflects.
    for (depth, blue) in [(0, 0.0), (1, 0.04), (2, 0.04 + 0.96 * 0.04), (3, 0.04 + 0.96 * 0.04 * 0.96)] {
        let found = stage.along(DVec3::Z * 5.0, DVec3::NEG_Z, to_depth(depth));
        assert!(close(found, DVec3::new(1.0 - blue, 0.0, blue), 1e-6), "{depth}: {found}");
    }
}

#[test]
fn a_body_bends_each_wavelength_by_its_own_index() {
    // A screen in the glass. It is white from the place on where green light (540 nm) falls.
    let (spread, degrees) = (0.05_f32, 60.0_f64);
    let index = |wavelength: f64| 1.6 + f64::from(spread) * (523_655.0 / (wavelength * wavelength) - 1.5168);
    let place = |wavelength: f64| (degrees.to_radians().sin() / index(wavelength)).asin().tan() * 10.0;
    let edge = place(540.0);
    let stage = |spread| {
        let mut stage = Stage::default();
        stage.block(Dielectric { spread, ..solid(1.6, Vec3::ZERO) }, Vec3::NEG_Z * 20.0, Vec3::new(400.0, 400.0, 20.0));
        stage.quad(Vec3::ZERO, Vec3::NEG_Z * 11.0, Vec3::X * 300.0, Vec3::Y * 300.0);
        stage.quad(Vec3::ONE, Vec3::new(edge as f32 + 50.0, 0.0, -10.0), Vec3::X * 50.0, Vec3::Y * 300.0);
        stage.settled()
    };
    let count = 1 << 14;
    let of_number = |number: u32| {
        let (wavelength, weight) = spectrum::chosen((f64::from(number) + 0.5) / f64::from(count));
        let passes = 1.0 - by_angles(degrees, index(wavelength)).0;
        if place(wavelength) > edge { weight * passes } else { DVec3::ZERO }
    };
    let expected = (0..count).map(of_number).sum::<DVec3>() / f64::from(count);
    let narrow = |stage: &Stage, wavelengths| {
        let origin = -down(degrees) * 5.0;
        let camera = project::Camera { fov_y: 1e-6, ..look_from(origin, DVec3::ZERO, Vec3::Y) };
        let value = stage.traced(RayProgram::Refraction, RayParams { wavelengths, ..to_depth(3) });
        let job = Job { samples: 0..256, ..stage.job(Camera::new(&camera, DVec3::ZERO, 1.0), [1, 1], value) };
        picture(&job).map(|image| Vec4::from_array(image.pixels[0]).as_dvec4().truncate())
    };
    let [first, second] = narrow(&stage(spread), 16);
    let (found, own) = (0.5 * (first + second), 0.5 * (first - second).abs().max_element());
    assert!(own < 0.02 && close(found, expected, 0.02), "{found} {expected}, own error {own}");
    assert!(
        expected.x > 0.5 && expected.z < 0.1,
        "control: red light falls on the screen, and blue beside it: {expected}"
    );
    for alike in [narrow(&stage(0.0), 16)[0], narrow(&stage(spread), 1)[0]] {
        assert!(alike.x == alike.z && !close(alike, expected, 0.1), "control: all colours alike: {alike}");
    }
}

/// Values of Mitsuba 3.9.1 for light of 1 on both sides, R + T / n², each within 0.0009; 0.466667 would be lossless.
#[test]
fn rough_surfaces_lose_what_single_scattering_loses() {
    let points = Points::new(11, Purpose::Facet);
    for (width, expected) in [(0.05, 0.46737), (0.1, 0.46668), (0.2, 0.46364), (0.3, 0.45917), (0.5, 0.44592)] {
        let each = |number: u32| {
            let facet = Facet::seen(width, DVec3::Z, DVec3::NEG_Z, points.at(number));
            let interface = Interface::new(facet.normal.z, 1.5);
            let back = super::super::optics::mirrored(DVec3::NEG_Z, facet.normal);
            let through = interface.refracted(DVec3::NEG_Z, facet.normal, 1.5).expect("it passes");
            let reflected = if back.z > 0.0 { interface.share * facet.passes(back) } else { 0.0 };
            let passed = if through.z < 0.0 { (1.0 - interface.share) * facet.passes(through) } else { 0.0 };
            reflected + passed / 2.25
        };
        let found = (0..1 << 14).map(each).sum::<f64>() / f64::from(1 << 14);
        assert!((found - expected).abs() < 1.1e-3, "{width}: {found}");
    }
}

#[test]
fn a_frosted_wall_blurs_what_is_behind_it_and_gains_no_light() {
    // The right half of the background is white.
    let stage = |alpha: f32| {
        let mut stage = Stage::default();
        stage.quad(Vec3::ONE, Vec3::new(8.0, -8.0, 0.0), Vec3::X * 90.0, Vec3::Y * 90.0);
        stage.of_glass(Dielectric { alpha, ..thin(1.5) });
        stage.quad(Vec3::ONE, Vec3::new(108.0, -8.0, -5.0), Vec3::X * 100.0, Vec3::Y * 300.0);
        stage.settled()
    };
    let row = |alpha: f32| {
        let stage = stage(alpha);
        let found = picture(&stage.job(from_above(16), [16, 16], stage.traced(RayProgram::Refraction, to_depth(3))));
        let (reds, own) = (reds(&found), own_error(&found));
        let column = |x: usize| (0..16).map(|y| reds[y * 16 + x]).sum::<f64>() / 16.0;
        ((0..16).map(column).collect::<Vec<_>>(), own)
    };
    let (smooth, _) = row(0.0);
    let (frosted, own) = row(0.3);
    // A wall of index 1.5 lets 12/13 through at normal incidence.
    assert!(
        smooth[..8].iter().all(|red| *red == 0.0) && smooth[8..].iter().all(|red| (red - 12.0 / 13.0).abs() < 1e-6)
    );
    let (low, high) = (frosted[0], frosted[15]);
    assert!(frosted.windows(2).all(|pair| pair[1] > pair[0] - 4.0 * own), "{frosted:?}, own error {own}");
    // Pixels on both sides of the edge together show all light that passes. A facet that is tilted by m deflects light by 2 m; that light
    // is lost where it goes beyond the horizon, or where other facets block it.
    let passing = |alpha: f64| {
        let count = 10_000;
        let of_facet = |number: i32| {
            let part = (f64::from(number) + 0.5) / f64::from(count);
            let lean = (alpha * (part / (1.0 - part)).sqrt()).atan();
            let cosine = (2.0 * lean).cos();
            let r = by_angles(lean.to_degrees(), 1.5).0;
            let masked = 0.5 * ((1.0 + alpha * alpha * (1.0 / (cosine * cosine) - 1.0)).sqrt() - 1.0);
            if cosine > 0.0 { (1.0 - r) / (1.0 + r) / (1.0 + masked) } else { 0.0 }
        };
        (0..count).map(of_facet).sum::<f64>() / f64::from(count)
    };
    let both = (frosted[3] + frosted[12], passing(0.3), passing(0.2));
    assert!(low > 0.0 && high < 12.0 / 13.0 && (both.0 - both.1).abs() < 0.02, "{both:?} {frosted:?}");
    assert!(both.2 > both.0 + 0.02, "control: a narrower distribution: {both:?}");
    assert!(own > 1e-3 && own < 0.05, "its noise is told: {own}");
}

/// A wall that a camera sees inside the body around it: its colour, times the transmittance of the path.
#[test]
fn a_camera_in_a_body_sees_opaque_surfaces_through_it() {
    let (near, far) = (Vec3::new(0.1, 0.4, 0.9), Vec3::new(0.7, 0.05, 0.3));
    let color = DVec3::new(0.5, 0.25, 0.125);
    let eye = DVec3::new(0.3, -0.2, 1.4);
    // The bodies around the middle, blocks or spheres, each with its half size; in the last case the eye is in no body.
    for (bodies, around) in [
        (&[(near, 4.0)][..], near),
        (&[(far, 4.0), (near, 3.0)], near),
        (&[(near, 4.0), (far, 0.1)], near),
        (&[], Vec3::ZERO),
    ] {
        for are_spheres in [false, true] {
            let mut stage = Stage::white();
            for (extinction, half) in bodies {
                match are_spheres {
                    true => stage.sphere(solid(1.4, *extinction), Vec3::ZERO, *half),
                    false => stage.block(solid(1.4, *extinction), Vec3::ZERO, Vec3::splat(*half)),
                };
            }
            stage.quad(color.as_vec3(), Vec3::new(0.0, 0.0, -1.6), Vec3::X * 2.0, Vec3::Y * 2.0);
            stage.sun = Some(Sun { direction: Vec3::NEG_Z, color: Vec3::ZERO });
            let stage = stage.settled();
            for target in [DVec3::new(-1.2, 0.7, -1.6), DVec3::new(1.4, -1.1, -1.6)] {
                let expected = color * (-around.as_dvec3() * target.distance(eye)).map(f64::exp);
                let what = format!("{bodies:?} {are_spheres} {target}");
                let found = stage.along(eye, target - eye, to_depth(4));
                assert!(close(found, expected, 1e-6), "{what}: {found} {expected}");
                assert!(around == Vec3::ZERO || !close(found, color, 0.05), "control: {what}");
                // By the report's rule each surface above the wall leaves nine tenths of the light there.
                let above = bodies.iter().filter(|(_, half)| *half > 1.0).count();
                let found = stage.shown_by(RayProgram::Final, (eye, target - eye), to_depth(4));
                let expected = 0.9_f64.powi(above as i32) * expected;
                assert!(close(found, expected, 1e-6), "final, {what}: {found} {expected}");
            }
        }
    }
}
