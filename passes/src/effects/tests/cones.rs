//! Texture lookups by ray cones against those of a camera that is mirrored, and against rays that are followed in `f64`.

use super::world::{SUN_COLOR, Shot, World};
use crate::cpu;
use crate::trace::WithSpheres;
use curitiba_pipeline::backend::{FromCamera, Glow, PixelCone, RayCounts, RayJob, View};
use curitiba_pipeline::camera_programs::{CameraParams, SurfaceKind};
use curitiba_pipeline::color::decode;
use curitiba_pipeline::glass::{Dielectric, GlassRule, Shape};
use curitiba_pipeline::programs::Fidelity::Corrected;
use curitiba_pipeline::programs::{RayParams, RayProgram, TextureLod};
use curitiba_pipeline::scene::texture::{Texture, Wrap, lod};
use glam::camera::rh;
use glam::{DMat2, DVec2, DVec3, Vec2, Vec3};

/// With depth 0 light goes through bodies, and they mirror nothing.
fn params(texture_lod: TextureLod) -> RayParams {
    RayParams { texture_lod, depth: 0, glass: GlassRule::Auto, samples: 0, ..RayParams::default() }
}

/// Texels along each side of the textures.
const SIDE: u32 = 512;

/// By how much the texels of a level are brighter than those of the one before.
const STEP: u8 = 25;

/// A texture that shows at which level it is read.
fn graded() -> Texture {
    let mut texture = Texture::new("graded".to_owned(), SIDE, SIDE, vec![[0; 4]; (SIDE * SIDE) as usize]);
    for (level, grey) in texture.levels.iter_mut().zip((0..).step_by(usize::from(STEP))) {
        level.texels.fill([grey, grey, grey, 255]);
    }
    texture
}

/// The level that a colour was read at, in ambient light.
fn level_of(color: [f32; 4]) -> f64 {
    f64::from(color[0]) / 0.3 * 255.0 / f64::from(STEP)
}

/// Pixels of a camera: a square with `count` pixels along each side, each of the side `pixel` at distance 1.
#[derive(Clone, Copy)]
struct Camera {
    eye: Vec3,
    towards: Vec3,
    count: u32,
    pixel: f32,
    /// Shift of the picture, in pixels.
    shift: DVec2,
}

impl Camera {
    /// The direction of a place in the picture, in pixels.
    fn direction(&self, at: DVec2) -> DVec3 {
        let forward = (self.towards - self.eye).as_dvec3().normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let at = (at + self.shift - 0.5 * f64::from(self.count)) * f64::from(self.pixel);
        forward + right * at.x - right.cross(forward) * at.y
    }

    fn pixels(self) -> impl Iterator<Item = DVec2> {
        (0..self.count * self.count)
            .map(move |i| DVec2::new(f64::from(i % self.count), f64::from(i / self.count)) + 0.5)
    }

    fn shot(self, world: &World) -> Shot<'_> {
        let targets = self.pixels().map(|at| self.eye + self.direction(at).as_vec3());
        let mut shot = Shot::of(world, self.eye, targets).rows(self.count);
        shot.cone = PixelCone { width: 0.0, spread: self.pixel };
        shot
    }
}

/// A plane y = 0 with a texture that repeats `repeat` times in each scene unit. It is lit from below, so its upper side is in ambient light.
fn floor(world: &mut World, texture: Texture, repeat: f32) {
    let material = world.picture([[0; 4]; 2], None);
    *world.scene.textures.last_mut().expect("it was added") = texture;
    let (before, half) = (world.scene.geometry.texcoords.len(), 64.0);
    world.quad(material, Vec3::ZERO, Vec3::Z * half, Vec3::X * half);
    for texcoord in &mut world.scene.geometry.texcoords[before..] {
        *texcoord *= 2.0 * half * repeat;
    }
}

/// The texture coordinates at which a ray meets the floor; NaN where it does not.
fn on_floor(origin: DVec3, direction: DVec3, repeat: f32) -> DVec2 {
    let t = -origin.y / direction.y;
    let at = origin + direction * if t > 0.0 { t } else { f64::NAN };
    DVec2::new(at.z, at.x) * f64::from(repeat)
}

/// By how much a function of a place in the picture changes over a pixel, along both sides.
fn over_a_pixel(at: DVec2, place: impl Fn(DVec2) -> DVec2) -> [DVec2; 2] {
    let step = 1e-3;
    [DVec2::X, DVec2::Y].map(|side| (place(at + side * step) - place(at - side * step)) / (2.0 * step))
}

/// `log2` of the longer axis of the ellipse that a pixel covers, in texels.
fn longer_side([along, down]: [DVec2; 2]) -> f64 {
    let map = DMat2::from_cols(along, down) * f64::from(SIDE);
    let square = map * map.transpose();
    let half = 0.5 * (square.x_axis.x + square.y_axis.y);
    (half + (half * half - square.determinant()).max(0.0).sqrt()).sqrt().log2()
}

/// The largest difference of levels between a picture and what is expected, and the number of pixels that were compared: those whose level is
/// neither the first nor the last.
fn largest(pixels: &[[f32; 4]], expected: impl Iterator<Item = f64>) -> (f64, usize) {
    let last = f64::from(SIDE.ilog2());
    let between = |(_, expected): &(&[f32; 4], f64)| (0.5..last - 0.5).contains(expected);
    let compared: Vec<f64> =
        pixels.iter().zip(expected).filter(between).map(|(pixel, expected)| level_of(*pixel) - expected).collect();
    let mean = compared.iter().sum::<f64>() / compared.len() as f64;
    let most = compared.iter().fold(0.0_f64, |most, off| most.max(off.abs()));
    println!("levels: {} pixels, mean {mean:.3}, largest {most:.3}", compared.len());
    (most, compared.len())
}

/// A floor before a mirror at z = 0, from the floor to a height of 3.
fn before_mirror(texture: Texture, repeat: f32) -> World {
    let mut world = World::lit_along(Vec3::Y);
    let glass = world.glass();
    world.quad(glass, Vec3::new(0.0, 1.5, 0.0), Vec3::X * 4.0, Vec3::Y * 1.5);
    floor(&mut world, texture, repeat);
    world
}

/// Looks at the mirror.
const AT_MIRROR: Camera = Camera {
    eye: Vec3::new(0.3, 1.3, 4.0),
    towards: Vec3::new(0.0, 1.0, 0.0),
    count: 48,
    pixel: 0.01,
    shift: DVec2::ZERO,
};

/// The texture coordinates of the floor that the mirrored camera sees; NaN where the line of sight does not meet the mirror.
fn in_mirror(camera: &Camera, at: DVec2, repeat: f32) -> DVec2 {
    let turned = DVec3::new(1.0, 1.0, -1.0);
    let (eye, direction) = (camera.eye.as_dvec3(), camera.direction(at));
    let met = eye + direction * (eye.z / -direction.z);
    if met.y > 0.0 { on_floor(eye * turned, direction * turned, repeat) } else { DVec2::NAN }
}

#[test]
fn a_mirrored_floor_is_read_at_the_level_of_a_mirrored_camera() {
    let camera = AT_MIRROR;
    for repeat in [0.3_f32, 1.5] {
        let shot_of =
            |lod| camera.shot(&before_mirror(graded(), repeat)).run(RayProgram::Reflection, Corrected, params(lod)).0;
        let pixels = shot_of(TextureLod::Cones);
        let over = |at| over_a_pixel(at, |at| in_mirror(&camera, at, repeat));
        let expected = camera.pixels().map(|at| {
            let [along, down] = over(at).map(|side| side.as_vec2());
            let level = f64::from(lod(Vec2::splat(SIDE as f32), along, down));
            if along.is_nan() { f64::NAN } else { level }
        });
        let (most, count) = largest(&pixels, expected);
        assert!(most < 0.2 && count > 700, "{repeat}: {most} at {count} pixels");
        // Control: a cone that does not grow behind the mirror.
        let short = camera.pixels().map(|at| {
            let whole = -f64::from(camera.eye.y) / camera.direction(at).y;
            let to_mirror = f64::from(camera.eye.z) / -camera.direction(at).z;
            longer_side(over(at)) + (to_mirror / whole).log2()
        });
        assert!(largest(&pixels, short).0 > 0.5);
        assert!(shot_of(TextureLod::Zero).iter().all(|pixel| level_of(*pixel) <= 0.0), "control: without cones");
    }
}

/// Bright slabs with dark joints, eight along each side.
fn paving() -> Texture {
    let grey = |at: u32| if (at % 64) < 8 { 0 } else { 1 };
    let texels = (0..SIDE * SIDE).map(|i| {
        let slab = grey(i % SIDE) * grey(i / SIDE);
        [20 + 200 * slab, 20 + 200 * slab, 20 + 200 * slab, 255]
    });
    Texture::new("paving".to_owned(), SIDE, SIDE, texels.collect())
}

/// A paved floor in a mirror: the error against means of 4096 lines of sight a pixel, and the variance over shifts of the picture by
/// parts of a pixel, which measures how much the paving glitters.
#[test]
fn mirrored_paving_does_not_glitter() {
    let repeat = 0.6;
    let camera = Camera { count: 24, pixel: 0.02, ..AT_MIRROR };
    let world = before_mirror(paving(), repeat);
    let shown = |shift: DVec2, lod| {
        let shot = Camera { shift, ..camera }.shot(&world);
        let pixels = shot.run_on(&world.tree(), &shot.job(RayProgram::Reflection, Corrected, params(lod))).0;
        pixels.iter().map(|pixel| f64::from(pixel[0]) / 0.3).collect::<Vec<f64>>()
    };
    let texture = &world.scene.textures[0];
    let reference: Vec<f64> = camera
        .pixels()
        .map(|at| {
            let parts = |i: u32| DVec2::new(f64::from(i % 64), f64::from(i / 64)) / 64.0 + 0.5 / 64.0 - 0.5;
            let seen = (0..4096).map(|i| in_mirror(&camera, at + parts(i), repeat).as_vec2());
            seen.map(|uv| if uv.is_nan() { f64::NAN } else { f64::from(texture.sample(uv, 0.0).x) }).sum::<f64>()
                / 4096.0
        })
        .collect();
    let counted: Vec<usize> = (0..reference.len()).filter(|index| reference[*index].is_finite()).collect();
    let judge = |lod| {
        let mean =
            |of: &dyn Fn(usize) -> f64| counted.iter().map(|index| of(*index)).sum::<f64>() / counted.len() as f64;
        let pictures: Vec<Vec<f64>> =
            (0..16).map(|i| shown(DVec2::new(f64::from(i % 4), f64::from(i / 4)) / 4.0 - 0.375, lod)).collect();
        let middle = shown(DVec2::ZERO, lod);
        let error = mean(&|index| (middle[index] - reference[index]).powi(2)).sqrt();
        let variance = mean(&|index| {
            let sum: f64 = pictures.iter().map(|picture| picture[index]).sum();
            pictures.iter().map(|picture| (picture[index] - sum / 16.0).powi(2)).sum::<f64>() / 16.0
        });
        println!("{lod:?}: error {error:.4}, variance {variance:.2e}, {} pixels", counted.len());
        (error, variance)
    };
    let (zero, cones) = (judge(TextureLod::Zero), judge(TextureLod::Cones));
    assert!(counted.len() > 150, "{}", counted.len());
    assert!(cones.0 < 0.06 && cones.0 < 0.2 * zero.0, "errors {} {}", cones.0, zero.0);
    assert!(cones.1 < 0.1 * zero.1, "variances {} {}", cones.1, zero.1);
}

/// The direction after a smooth interface by the vector form of Snell's law, or mirrored where `ratio` is `None`, in `f64`.
fn onward(direction: DVec3, normal: DVec3, ratio: Option<f64>) -> DVec3 {
    let (direction, normal) = (direction.normalize(), normal.normalize());
    let cos = -normal.dot(direction);
    match ratio {
        None => direction + 2.0 * cos * normal,
        Some(ratio) => {
            let inner = (1.0 - (1.0 - cos * cos) / (ratio * ratio)).sqrt();
            direction / ratio + (cos / ratio - inner) * normal
        }
    }
}

/// Where a ray meets a sphere, first or last; NaN where it does not.
fn on_sphere(origin: DVec3, direction: DVec3, (center, radius): (DVec3, f64), last: bool) -> DVec3 {
    let (from, direction) = (origin - center, direction.normalize());
    let middle = -from.dot(direction);
    let half = (radius * radius - (from + direction * middle).length_squared()).sqrt();
    origin + direction * if last { middle + half } else { middle - half }
}

/// A world with a ball of this glass, of radius 1, over the floor; and the centre and radius of the ball.
fn with_ball(dielectric: Dielectric, height: f32, repeat: f32) -> (World, (DVec3, f64)) {
    let mut world = World::lit_along(Vec3::Y);
    let glass = world.dielectric(dielectric);
    floor(&mut world, graded(), repeat);
    world.sphere(glass, Vec3::Y * height, 1.0);
    (world, (DVec3::Y * f64::from(height), 1.0))
}

/// The front of a ball of radius 1, of triangles with the normals of a sphere.
fn ball_of_triangles(world: &mut World, material: u32, center: Vec3, steps: u32) {
    let on_ball = |i: u32, j: u32| {
        let [across, up] = [i, j].map(|step| (step as f32 / steps as f32 - 0.5) * 3.0);
        Vec3::new(across.sin() * up.cos(), up.sin(), across.cos() * up.cos())
    };
    for (i, j) in (0..steps * steps).map(|cell| (cell % steps, cell / steps)) {
        let corners = [on_ball(i, j), on_ball(i + 1, j), on_ball(i + 1, j + 1), on_ball(i, j + 1)];
        for normals in [[corners[0], corners[1], corners[2]], [corners[2], corners[3], corners[0]]] {
            world.triangle(material, normals.map(|normal| center + normal), normals);
        }
    }
}

/// Paving with a half ball and a wall of glass on it. Behind the camera stands a wall with bumps that emits light; its textures do not repeat
/// and their sides are no powers of two. Texture 0 is a roughness and texture 1 a filter.
pub(crate) fn court([ball, wall]: [Dielectric; 2], bodies: bool) -> World {
    let mut world = World { beyond: Vec3::new(0.2, 0.4, 0.7), ..World::lit_along(Vec3::new(0.3, -1.0, -0.4)) };
    let [ball, wall] = [ball, wall].map(|dielectric| world.dielectric(dielectric));
    let of_places = |name: &str, width: u32, height: u32| {
        let texels =
            (0..width * height).map(|i| [31 * i, 97 * i, 59 * i, 255].map(|code| (code % 256) as u8)).collect();
        Texture::new(name.to_owned(), width, height, texels)
    };
    world.scene.textures.extend([of_places("roughness", 37, 50), of_places("filter", 64, 3)]);
    floor(&mut world, paving(), 0.7);
    ball_of_triangles(&mut world, ball, Vec3::new(-1.1, 1.2, 0.0), 12);
    world.quad(wall, Vec3::new(1.2, 1.2, -0.4), Vec3::new(0.9, 0.0, -0.3), Vec3::Y * 1.1);
    let back = world.picture([[0; 4]; 2], None);
    *world.scene.textures.last_mut().expect("it was added") =
        of_places("back", 41, 29).wrapped([Wrap::Clamp, Wrap::Mirror]);
    let texture = world.shades[back as usize].texture;
    world.shades[back as usize].glow = Some(Glow { color: Vec3::new(0.1, 0.3, 0.2), texture });
    world.quad(back, Vec3::new(0.0, 3.0, 9.0), Vec3::NEG_X * 6.0, Vec3::Y * 3.0);
    world.bump(back, [[90, 150, 230, 255], [170, 110, 220, 255]], 1.0);
    let last = world.scene.textures.len() - 1;
    world.scene.textures[last] = of_places("bumps", 33, 64);
    world.bodies = bodies;
    world
}

/// Looks at the court.
pub(crate) fn at_court(world: &World) -> Shot<'_> {
    Camera { eye: Vec3::new(0.2, 1.8, 5.0), towards: Vec3::Y, count: 64, pixel: 0.012, ..AT_MIRROR }.shot(world)
}

fn run(world: &World, camera: Camera, program: RayProgram) -> Vec<[f32; 4]> {
    let (triangles, spheres) = (&world.tree(), &world.spheres());
    let shot = camera.shot(world);
    shot.run_on(&WithSpheres { triangles, spheres }, &shot.job(program, Corrected, params(TextureLod::Cones))).0
}

pub(crate) fn solid(index: f32) -> Dielectric {
    Dielectric { shape: Shape::Solid, index, filter: Vec3::ONE, ..Dielectric::default() }
}

#[test]
fn a_ball_spreads_what_it_mirrors() {
    let repeat = 1.0;
    let (eye, towards) = (Vec3::new(0.0, 1.2, 5.0), Vec3::Y * 1.2);
    let camera = Camera { eye, towards, pixel: 0.004, ..AT_MIRROR };
    let (world, ball) = with_ball(solid(1.5), 1.6, repeat);
    let pixels = run(&world, camera, RayProgram::Reflection);
    let eye = camera.eye.as_dvec3();
    let expected = camera.pixels().map(|at| {
        longer_side(over_a_pixel(at, |at| {
            let met = on_sphere(eye, camera.direction(at), ball, false);
            on_floor(met, onward(camera.direction(at), met - ball.0, None), repeat)
        }))
    });
    let expected: Vec<f64> = expected.collect();
    let (most, count) = largest(&pixels, expected.iter().copied());
    assert!(most < 0.5 && count > 1500, "{most} at {count} pixels");
    // Control: cones that a curved mirror does not spread.
    let flat = camera.pixels().map(|at| {
        let met = on_sphere(eye, camera.direction(at), ball, false);
        let on = onward(camera.direction(at), met - ball.0, None);
        let (way, cos) = (eye.distance(met) + met.y / -on.y, -on.y);
        (f64::from(camera.pixel) * way / cos * f64::from(SIDE) * f64::from(repeat)).log2()
    });
    assert!(largest(&pixels, flat).0 > 1.5);
    let mut world = World::lit_along(Vec3::Y);
    let glass = world.glass();
    ball_of_triangles(&mut world, glass, ball.0.as_vec3(), 64);
    floor(&mut world, graded(), repeat);
    let shot = camera.shot(&world);
    let job = shot.job(RayProgram::Reflection, Corrected, params(TextureLod::Cones));
    let (pixels, _) = shot.run_on(&world.tree(), &job);
    let (most, count) = largest(&pixels, expected.iter().copied());
    assert!(most < 0.7 && count > 1500, "{most} at {count} pixels");
}

#[test]
fn water_narrows_what_is_seen_through_it() {
    let repeat = 2.0;
    let mut world = World::lit_along(Vec3::Y);
    let water = world.dielectric(solid(1.33));
    world.quad(water, Vec3::Y, Vec3::Z * 40.0, Vec3::X * 40.0);
    floor(&mut world, graded(), repeat);
    let camera = Camera { eye: Vec3::new(0.5, 2.0, 6.0), towards: Vec3::Y * 0.4, ..AT_MIRROR };
    let pixels = run(&world, camera, RayProgram::Refraction);
    let eye = camera.eye.as_dvec3();
    let through = |at: DVec2| {
        let direction = camera.direction(at);
        let met = eye + direction * ((1.0 - eye.y) / direction.y);
        on_floor(met, onward(direction, DVec3::Y, Some(1.33)), repeat)
    };
    let expected = camera.pixels().map(|at| longer_side(over_a_pixel(at, through)));
    let (most, count) = largest(&pixels, expected);
    assert!(most < 0.2 && count > 1000, "{most} at {count} pixels");
}

#[test]
fn a_ball_of_glass_gathers_what_is_seen_through_it() {
    let repeat = 4.0;
    // Before the focus and behind it. At the focus, everything that is seen is one point.
    for (height, tolerance) in [(1.1, 0.6), (3.0, 0.1)] {
        let camera = Camera { eye: Vec3::new(0.0, height + 4.0, 0.5), towards: Vec3::ZERO, pixel: 0.008, ..AT_MIRROR };
        let (world, ball) = with_ball(solid(1.5), height, repeat);
        let pixels = run(&world, camera, RayProgram::Refraction);
        let eye = camera.eye.as_dvec3();
        let expected = camera.pixels().map(|at| {
            let passes = (ball.0 - eye).reject_from(camera.direction(at)).length();
            if passes > 0.5 {
                return f64::NAN;
            }
            longer_side(over_a_pixel(at, |at| {
                let met = on_sphere(eye, camera.direction(at), ball, false);
                let inside = onward(camera.direction(at), met - ball.0, Some(1.5));
                let left = on_sphere(met, inside, ball, true);
                on_floor(left, onward(inside, ball.0 - left, Some(1.0 / 1.5)), repeat)
            }))
        });
        let (most, count) = largest(&pixels, expected);
        assert!(most < tolerance && count > 700, "{most} at {count} pixels");
    }
}

/// Texel 0 at level 0, texel 1 at all others.
fn first_and_rest(texels: [[u8; 4]; 2]) -> Texture {
    let mut texture = Texture::new("first".to_owned(), SIDE, SIDE, vec![texels[0]; (SIDE * SIDE) as usize]);
    texture.levels[1..].iter_mut().for_each(|level| level.texels.fill(texels[1]));
    texture
}

/// A camera at the distance 1 from a square of the side 1, of which the picture shows the middle; and the number of texels along a pixel.
const SQUARE: (Camera, f32) =
    (Camera { eye: Vec3::Z, towards: Vec3::ZERO, count: 12, pixel: 0.01, shift: DVec2::ZERO }, (SIDE as f32) * 0.01);

#[test]
fn roughness_and_filters_of_glass_are_read_at_the_level_of_the_pixel() {
    let (camera, texels) = SQUARE;
    let square = |dielectric: Dielectric, texture: Texture| {
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::Y) };
        let glass = world.dielectric(dielectric);
        world.scene.textures.push(texture);
        world.quad(glass, Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5);
        world
    };
    let draw = |world: &World, params: RayParams| camera.shot(world).run(RayProgram::Refraction, Corrected, params);
    // A wall without a reflection; shares of light are linear.
    let filter = Dielectric { shape: Shape::Thin, filter_texture: Some(0), ..solid(1.0) };
    let colored = square(filter, graded());
    let [zero, cones] = [TextureLod::Zero, TextureLod::Cones].map(|lod| draw(&colored, params(lod)).0);
    let shown = |level: f32| decode(level * f32::from(STEP) / 255.0);
    for (zero, cones) in zero.iter().zip(&cones) {
        let level = texels.log2();
        assert_eq!(zero[0], 0.0);
        assert!((shown(level - 0.01)..shown(level + 0.05)).contains(&cones[0]), "{} {}", cones[0], shown(level));
    }
    // Level 0 alone is rough: the pixels show a smooth surface, whose paths are not divided.
    let rough = Dielectric { alpha: 0.3, roughness_texture: Some(0), ..solid(1.5) };
    let frosted = square(rough, first_and_rest([[0, 255, 0, 255], [0, 0, 0, 255]]));
    let rays = |params: RayParams| draw(&frosted, params).1.refracted;
    assert_eq!(rays(params(TextureLod::Cones)), 144);
    assert_eq!(rays(RayParams { paths: 8, ..params(TextureLod::Zero) }), 8 * 144, "control");
    // Adaptive sampling reads the same levels.
    let sampled = RayParams { error: 0.01, paths: 64, ..params(TextureLod::Cones) };
    assert_eq!(draw(&frosted, sampled), draw(&frosted, params(TextureLod::Cones)));
    assert!(rays(RayParams { texture_lod: TextureLod::Zero, ..sampled }) > 8 * 144, "control");
}

#[test]
fn bumps_and_glow_in_a_mirror_are_read_at_the_level_of_the_cone() {
    let (camera, _) = SQUARE;
    // A wall behind the camera, lit along its normal; level 0 of its normal map tilts the normals.
    let mut world = World::lit_along(Vec3::Z);
    let (glass, wall) = (world.glass(), world.paint(Vec3::splat(0.5)));
    world.quad(glass, Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5);
    world.quad(wall, Vec3::Z * 2.0, Vec3::NEG_X * 4.0, Vec3::Y * 4.0);
    world.bump(wall, [[0; 4]; 2], 1.0);
    world.scene.textures[0] = first_and_rest([[255, 128, 192, 255], [128, 128, 255, 255]]);
    world.scene.textures.push(graded());
    world.shades[wall as usize].glow = Some(Glow { color: Vec3::X, texture: Some(1) });
    let draw = |lod| camera.shot(&world).run(RayProgram::Reflection, Corrected, params(lod)).0;
    // 3 units along the cone, and 512 texels over 8.
    let level = (3.0 * 0.01 * 64.0_f32).log2();
    for (zero, cones) in draw(TextureLod::Zero).iter().zip(draw(TextureLod::Cones)) {
        let green = |cosine: f32| 0.5 * (SUN_COLOR.y * cosine + 0.3);
        assert!(zero[1] < green(0.6), "{zero:?}");
        // The normal map is read between level 0, which tilts the normals, and level 1, which does not.
        let glow = cones[0] - 0.5 * (SUN_COLOR.x * (cones[1] / 0.5 - 0.3) / SUN_COLOR.y + 0.3);
        assert!((glow / (level * f32::from(STEP) / 255.0) - 1.0).abs() < 0.02, "{glow} {level}");
        assert!(cones[1] > green(0.9), "{cones:?}");
    }
}

#[test]
fn holes_are_those_of_level_0() {
    let (camera, _) = SQUARE;
    let mut world = World { beyond: Vec3::X, ..World::lit_along(Vec3::Z) };
    let glass = world.glass();
    let leaf = world.picture([[0, 255, 0, 255], [0, 255, 0, 0]], Some(0.5));
    world.quad(glass, Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5);
    let first = world.scene.geometry.texcoords.len();
    world.quad(leaf, Vec3::Z * 2.0, Vec3::NEG_X * 4.0, Vec3::Y * 4.0);
    world.scene.geometry.texcoords[first..].iter_mut().for_each(|texcoord| *texcoord *= 200.0);
    let draw = |lod| camera.shot(&world).run(RayProgram::Reflection, Corrected, params(lod)).0;
    let [zero, cones] = [TextureLod::Zero, TextureLod::Cones].map(draw);
    let holes = |pixels: &[[f32; 4]]| pixels.iter().map(|pixel| pixel[0] == 1.0).collect::<Vec<bool>>();
    let count = holes(&zero).iter().filter(|hole| **hole).count();
    assert!((20..124).contains(&count) && holes(&zero) == holes(&cones), "{count}");
}

/// Shadows, occlusion and glass over paving.
fn yard() -> World {
    let (mut world, _) = with_ball(solid(1.5), 1.6, 0.7);
    *world.scene.textures.last_mut().expect("the floor has one") = paving();
    world.sun = World::lit_along(Vec3::new(0.3, -1.0, 0.2)).sun;
    world
}

#[test]
fn pictures_by_cones_do_not_depend_on_the_threads() {
    let world = yard();
    let (triangles, spheres) = (&world.tree(), &world.spheres());
    let tracer = WithSpheres { triangles, spheres };
    let camera = Camera { eye: Vec3::new(0.5, 2.0, 6.0), towards: Vec3::Y, count: 40, ..AT_MIRROR };
    let shot = camera.shot(&world);
    let asked = RayParams { samples: 4, depth: 3, ..params(TextureLod::Cones) };
    for program in [RayProgram::Reflection, RayProgram::Refraction, RayProgram::Final] {
        let job = shot.job(program, Corrected, asked);
        let of_threads = |threads: usize| -> (Vec<[f32; 4]>, RayCounts) {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
            pool.install(|| shot.run_on(&tracer, &job))
        };
        let one = of_threads(1);
        assert_eq!([of_threads(3), of_threads(16)], [one.clone(), one.clone()], "{program:?}");
        let zero = shot.job(program, Corrected, RayParams { texture_lod: TextureLod::Zero, ..asked });
        let zero = shot.run_on(&tracer, &zero);
        assert!(zero.0 != one.0 && zero.1 == one.1, "control: other levels by the same rays");
        let pixel = cpu::trace_pixel(&tracer, &job, 20, 17).expect("a complete job");
        assert_eq!(pixel, one.0[17 * 40 + 20]);
    }
}

#[test]
fn rays_from_the_camera_read_the_levels_of_their_cones() {
    let (camera, repeat) = (Camera { towards: Vec3::Y * 0.2, ..AT_MIRROR }, 0.3);
    let fov = 2.0 * (0.5 * camera.count as f32 * camera.pixel).atan();
    let look = rh::view::look_at_mat4(camera.eye, camera.towards, Vec3::Y);
    let view = View::new(rh::proj::directx::perspective(fov, 1.0, 1000.0, 0.05) * look, camera.eye);
    assert!((PixelCone::of(&view, [camera.count; 2]).spread / camera.pixel - 1.0).abs() < 1e-4);
    let draw = |world: &World, program, samples| {
        let surfaces = [SurfaceKind::Metal, SurfaceKind::Painted];
        let from = FromCamera { view, picture: [camera.count; 2], lamp: None, surfaces: &surfaces };
        let ambient = CameraParams { ambient: 1.0, ..CameraParams::default() };
        let asked = RayParams { samples, depth: 1, camera: ambient, ..params(TextureLod::Cones) };
        let shot = camera.shot(world);
        let job = RayJob { from_camera: Some(from), sun: None, ..shot.job(program, Corrected, asked) };
        shot.run_on(&world.tree(), &job).0
    };
    // Compares the levels at which pixels show the floor: directly, and in the mirror, which keeps the share `mirrored`.
    let shown = |pixels: &[[f32; 4]], mirrored: f32, finer: f64| {
        let in_mirror = |at| in_mirror(&camera, at, repeat).is_finite();
        let share = |at| if in_mirror(at) { mirrored } else { 1.0 };
        let pixels: Vec<[f32; 4]> =
            camera.pixels().zip(pixels).map(|(at, pixel)| [0.3 * pixel[0] / share(at), 0.0, 0.0, 1.0]).collect();
        let directly = |at| on_floor(camera.eye.as_dvec3(), camera.direction(at), repeat);
        // Several rays of a pixel at the mirror's border show both.
        let is_mixed = |at: DVec2| in_mirror(at - 0.5) != in_mirror(at + 0.5);
        let expected = camera.pixels().map(|at| match in_mirror(at) {
            _ if is_mixed(at) => f64::NAN,
            true if mirrored > 0.0 => longer_side(over_a_pixel(at, |at| self::in_mirror(&camera, at, repeat))) - finer,
            true => f64::NAN,
            false => longer_side(over_a_pixel(at, directly)) - finer,
        });
        largest(&pixels, expected)
    };
    let world = before_mirror(graded(), repeat);
    let mut glowing = before_mirror(graded(), repeat);
    glowing.shades[1].glow = Some(Glow { color: Vec3::ONE, texture: Some(0) });
    for (world, program, mirrored, samples) in [
        (&world, RayProgram::Albedo, 0.0, 0),
        (&world, RayProgram::Albedo, 0.0, 16),
        (&world, RayProgram::Lambert, 0.0, 0),
        (&world, RayProgram::Whitted, 0.8, 0),
        (&glowing, RayProgram::PathTracing, 0.8, 0),
    ] {
        // Each of a pixel's 16 rays covers a quarter of its side.
        let finer = if samples == 16 { 2.0 } else { 0.0 };
        let (most, count) = shown(&draw(world, program, samples), mirrored, finer);
        let (least, tolerance) = if mirrored > 0.0 { (1500, 0.2) } else { (600, 0.25) };
        assert!(most < tolerance && count > least, "{program:?}: {most} at {count} pixels");
    }
}
