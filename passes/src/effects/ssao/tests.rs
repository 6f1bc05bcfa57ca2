use crate::effects::tests::world::{Shot, World, grid};
use crate::trace::{Bvh, Hit, Quality, Ray, Tracer};
use curitiba_pipeline::backend::{GBuffer, RayCounts, RayJob};
use curitiba_pipeline::camera_programs::CameraParams;
use curitiba_pipeline::glass::{Background, GlassRule, GlassShadow, PathLimits};
use curitiba_pipeline::programs::Fidelity::{self, Corrected, Thesis};
use curitiba_pipeline::programs::{Fresnel, RayParams, RayProgram, Sampler, TextureLod};
use glam::{Mat3, Vec3};
use std::f32::consts::PI;

const LINEAR: RayParams = RayParams { intensity: 1.0, radius: 1.0, ..DEFAULTS };
const DEFAULTS: RayParams = RayParams {
    samples: 100,
    radius: 0.5,
    intensity: 1.6,
    index: 1.1,
    depth: 5,
    sampler: Sampler::Sobol,
    fresnel: Fresnel::Exact,
    glass: GlassRule::Pane,
    background: Background::Clear,
    shadow: GlassShadow::Report,
    wavelengths: 16,
    paths: 16,
    error: 0.0,
    photons: 0,
    photon_radius: 0.0,
    limits: PathLimits::DEFAULT,
    first: 0,
    first_path: 0,
    sun: 0.0,
    sun_samples: 16,
    filter: 0,
    texture_lod: TextureLod::Cones,
    first_sun: 0,
    photon_batch: 0,
    camera: CameraParams::DEFAULT,
};

fn occlusion(shot: &Shot<'_>, fidelity: Fidelity, params: RayParams) -> (Vec<f32>, RayCounts) {
    let (pixels, rays) = shot.run(RayProgram::Ssao, fidelity, params);
    assert_eq!(rays.total(), rays.occlusion);
    (pixels.iter().map(|pixel| pixel[0]).collect(), rays)
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}

/// A floor in z = 0 seen from above, and its material.
fn floor() -> (World, u32) {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let paint = world.paint(Vec3::splat(0.5));
    world.quad(paint, Vec3::ZERO, Vec3::X * 9.0, Vec3::Y * 9.0);
    (world, paint)
}

const EYE: Vec3 = Vec3::new(0.2, 0.1, 0.9);

#[test]
fn the_defaults_here_are_the_programs_defaults() {
    assert_eq!(DEFAULTS, RayParams::default());
}

#[test]
fn a_plane_under_the_open_sky_is_exactly_open() {
    let (world, _) = floor();
    let shot = Shot::of(&world, EYE, grid(8, Vec3::ZERO, Vec3::X, Vec3::Y));
    for sampler in [Sampler::Sobol, Sampler::Strata] {
        let (values, rays) = occlusion(&shot, Corrected, RayParams { sampler, ..DEFAULTS });
        assert_eq!(values, [1.0; 64]);
        assert_eq!(rays.occlusion, 6400);
    }
}

#[test]
fn a_parallel_plane_blocks_all_but_the_flattest_directions() {
    // A roof at height h is hit within the radius where the cosine is above h / radius. So the open share is
    // (h / radius)².
    for height in [0.25f32, 0.5, 0.75, 1.25] {
        let (mut world, paint) = floor();
        world.quad(paint, Vec3::Z * height, Vec3::X * 9.0, Vec3::NEG_Y * 9.0);
        let eye = Vec3::new(0.2, 0.1, 0.2);
        let shot = Shot::of(&world, eye, grid(30, Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5));
        let expected = f64::from(height.min(1.0)).powi(2);
        for sampler in [Sampler::Sobol, Sampler::Strata] {
            let (values, _) = occlusion(&shot, Corrected, RayParams { samples: 64, sampler, ..LINEAR });
            assert!((mean(&values) - expected).abs() < 2e-3, "{height}: {} {expected}", mean(&values));
        }
    }
}

/// Closed form of the open share at distance `c`, in radii, from a perpendicular wall.
fn beside_wall(c: f64) -> f64 {
    1.0 - (c.acos() - c * (1.0 - c * c).sqrt()) / std::f64::consts::PI
}

/// A floor, and a wall at x = 0 that rises from it.
fn wall() -> World {
    let (mut world, paint) = floor();
    world.quad(paint, Vec3::ZERO, Vec3::Y * 9.0, Vec3::Z * 9.0);
    world
}

#[test]
fn a_perpendicular_wall_gives_the_closed_form_at_every_distance() {
    for (c, table) in
        [(0.1, 0.563_556), (0.25, 0.657_481), (0.5, 0.804_499), (0.75, 0.927_853), (0.9, 0.981_307), (0.99, 0.999_401)]
    {
        let expected = beside_wall(c);
        assert!((expected - table).abs() < 1e-4, "{c}: {expected}");
        let world = wall();
        let targets = (0..400).map(|i| Vec3::new(c as f32, -0.5 + i as f32 / 400.0, 0.0));
        let shot = Shot::of(&world, Vec3::new(0.5, 0.1, 0.9), targets);
        for sampler in [Sampler::Sobol, Sampler::Strata] {
            let (values, _) = occlusion(&shot, Corrected, RayParams { samples: 64, sampler, ..LINEAR });
            assert!((mean(&values) - expected).abs() < 4e-3, "{c}: {} {expected}", mean(&values));
        }
    }
}

#[test]
fn the_error_beside_a_wall_is_that_of_the_best_known_samplers() {
    let world = wall();
    let targets = grid(100, Vec3::new(0.3, 0.0, 0.0), Vec3::X * 1e-6, Vec3::Y * 0.5);
    let shot = Shot::of(&world, Vec3::new(0.5, 0.1, 0.9), targets).rows(100);
    let expected = beside_wall(0.3);
    // Independent samples would have an RMS error of 0.116, and the polar map 0.051 and 0.0728.
    for (sampler, limit) in [(Sampler::Sobol, 0.047), (Sampler::Strata, 0.055)] {
        let (values, _) = occlusion(&shot, Corrected, RayParams { samples: 16, sampler, ..LINEAR });
        let square = values.iter().map(|v| (f64::from(*v) - expected).powi(2)).sum::<f64>() / values.len() as f64;
        let bias = mean(&values) - expected;
        println!("{sampler:?}: RMSE {:.4}, bias {bias:.1e}", square.sqrt());
        assert!(square.sqrt() <= limit, "{sampler:?}: RMSE {}", square.sqrt());
        assert!(bias.abs() < 1e-3, "{sampler:?}: bias {bias}");
    }
}

/// An exact sphere over a floor, for the closed form.
struct Sphere {
    center: Vec3,
    radius: f32,
}

impl Tracer for Sphere {
    fn closest(&self, _: &Ray, _: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        unreachable!("occlusion only asks whether something is in the way")
    }

    fn occluded(&self, ray: &Ray, _: impl FnMut(&Hit) -> bool) -> bool {
        let to = (self.center - ray.origin).as_dvec3();
        let along = to.dot(ray.direction.as_dvec3());
        along > 0.0 && to.length_squared() - along * along < f64::from(self.radius).powi(2)
    }
}

#[test]
fn a_sphere_takes_its_cosine_weighted_solid_angle() {
    let (world, _) = floor();
    for (radius, height, x, table) in
        [(1.0f32, 2.0f32, 0.0f32, 0.75f32), (1.0, 1.5, 0.5, 0.620_527), (1.0, 1.5, 2.0, 0.904)]
    {
        let expected = 1.0 - radius * radius * height / (x * x + height * height).powf(1.5);
        assert!((expected - table).abs() < 1e-4);
        let sphere = Sphere { center: Vec3::new(-x, 0.0, height), radius };
        let shot = Shot::of(&world, EYE, grid(30, Vec3::ZERO, Vec3::X * 1e-5, Vec3::Y * 1e-5));
        let params = RayParams { samples: 64, radius: 1e6, ..LINEAR };
        let (pixels, _) = shot.run_on(&sphere, &shot.job(RayProgram::Ssao, Corrected, params));
        let values: Vec<f32> = pixels.iter().map(|pixel| pixel[0]).collect();
        assert!((mean(&values) - f64::from(expected)).abs() < 2e-3, "{} {expected}", mean(&values));
    }
}

#[test]
fn intensity_is_the_exponent_and_zero_samples_switch_occlusion_off() {
    let world = wall();
    let shot = Shot::of(&world, EYE, [Vec3::new(0.3, 0.0, 0.0)]);
    let (linear, _) = occlusion(&shot, Corrected, LINEAR);
    assert!((0.5..0.9).contains(&linear[0]));
    let (squared, _) = occlusion(&shot, Corrected, RayParams { intensity: 2.0, ..LINEAR });
    assert!((squared[0] - linear[0] * linear[0]).abs() < 1e-6);
    for fidelity in [Corrected, Thesis] {
        let (off, rays) = occlusion(&shot, fidelity, RayParams { samples: 0, ..LINEAR });
        assert_eq!((off, rays.total()), (vec![1.0], 0));
    }
}

#[test]
fn directions_below_the_triangle_are_mirrored_so_that_an_open_floor_is_open() {
    let tilt = 50f32.to_radians();
    let (mut world, _) = floor();
    world.bend_normals(Vec3::new(tilt.sin(), 0.0, tilt.cos()));
    let shot = Shot::of(&world, EYE, grid(30, Vec3::ZERO, Vec3::X, Vec3::Y));
    let params = RayParams { samples: 64, ..LINEAR };
    // Brute force never reports that nothing is in reach: every direction is traced, mirrored ones too.
    let (values, rays) = occlusion(&shot, Corrected, params);
    assert!(values.iter().all(|value| *value == 1.0));
    assert_eq!((rays.occlusion, rays.certain), (900 * 64, 0));
    // The tree reports that nothing is in reach, so no ray is traced.
    let (pixels, rays) = shot.run_on(&world.tree(), &shot.job(RayProgram::Ssao, Corrected, params));
    assert!(pixels.iter().all(|pixel| pixel[0] == 1.0));
    assert_eq!((rays.occlusion, rays.certain), (0, 900 * 64));
}

#[test]
fn the_hemisphere_is_on_the_viewers_side_in_corrected_only() {
    // A floor whose normals point down, above a cellar 0.1 deep, seen from above.
    let (mut world, paint) = floor();
    world.bend_normals(Vec3::NEG_Z);
    world.quad(paint, Vec3::Z * -0.1, Vec3::X * 9.0, Vec3::Y * 9.0);
    let shot = Shot::of(&world, EYE, grid(4, Vec3::ZERO, Vec3::X, Vec3::Y));
    assert_eq!(occlusion(&shot, Corrected, LINEAR).0, [1.0; 16]);
    // The report's value would be 0.1 squared if all its directions were inside the hemisphere.
    assert!(mean(&occlusion(&shot, Thesis, LINEAR).0) < 0.3);
}

#[test]
fn the_reports_noise_leaks_light_into_a_closed_box() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let paint = world.paint(Vec3::splat(0.5));
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for side in [axis, -axis] {
            let x = side.any_orthonormal_vector();
            world.quad(paint, side * 0.05 + Vec3::new(0.3, 0.2, 0.1), x * 0.05, x.cross(side) * 0.05);
        }
    }
    let inside = Vec3::new(0.3, 0.2, 0.1);
    let shot = Shot::of(&world, inside, grid(10, inside - Vec3::Z * 0.05, Vec3::X * 0.04, Vec3::Y * 0.04));
    let (values, rays) = occlusion(&shot, Corrected, RayParams { samples: 16, ..LINEAR });
    assert_eq!((values, rays.occlusion), (vec![0.0; 100], 1600));
    // Noise below 0 in the first of four rows of strata gives directions that are not numbers; they count as open.
    let (values, rays) = occlusion(&shot, Thesis, RayParams { samples: 16, ..LINEAR });
    assert!((0.06..0.2).contains(&mean(&values)), "{}", mean(&values));
    let untraced = 1600 - rays.occlusion;
    assert_eq!(untraced, (mean(&values) * 1600.0).round() as u64);
}

#[test]
fn background_is_one_and_traces_nothing() {
    let (world, _) = floor();
    let shot = Shot::of(&world, EYE, [EYE + Vec3::Z]);
    for fidelity in [Corrected, Thesis] {
        let (pixels, rays) = shot.run(RayProgram::Ssao, fidelity, DEFAULTS);
        assert_eq!((pixels, rays.total()), (vec![[1.0; 4]], 0), "in thesis because no direction is a number");
    }
    // An engine may leave a normal in cleared targets: then the report's program traces rays from the origin.
    let mut shot = Shot::of(&world, EYE, [EYE + Vec3::Z]);
    shot.position = vec![[0.0, 0.0, -0.1, 0.0]];
    shot.normal = vec![[0.0, 0.0, 1.0, 0.0]];
    assert!(occlusion(&shot, Thesis, DEFAULTS).1.occlusion > 50);
    assert_eq!(occlusion(&shot, Corrected, DEFAULTS), (vec![1.0], RayCounts::default()));
}

#[test]
fn only_thesis_writes_the_value_into_alpha() {
    let world = wall();
    let shot = Shot::of(&world, EYE, [Vec3::new(0.3, 0.0, 0.0)]);
    let thesis = shot.run(RayProgram::Ssao, Thesis, DEFAULTS).0[0];
    assert!(thesis == [thesis[0]; 4] && thesis[0] < 1.0);
    assert_eq!(shot.run(RayProgram::Ssao, Corrected, DEFAULTS).0[0][3], 1.0);
}

#[test]
fn seeds_change_the_noise_and_nothing_else() {
    let world = wall();
    let shot = Shot::of(&world, Vec3::new(0.5, 0.1, 0.9), grid(20, Vec3::new(0.5, 0.0, 0.0), Vec3::X * 0.1, Vec3::Y));
    let with_seed = |seed| {
        let job = RayJob { seed, ..shot.job(RayProgram::Ssao, Corrected, RayParams { samples: 16, ..LINEAR }) };
        shot.run_on(&world.brute_force(), &job).0.iter().map(|pixel| pixel[0]).collect::<Vec<_>>()
    };
    let (first, second) = (with_seed(1), with_seed(2));
    assert_eq!(first, with_seed(1));
    let differing = first.iter().zip(&second).filter(|(a, b)| a != b).count();
    assert!(differing > 150, "{differing} of 400");
    assert!((mean(&first) - mean(&second)).abs() < 0.01);
}

#[test]
fn a_convex_body_does_not_occlude_itself_at_any_scale_and_place() {
    let rotation = Mat3::from_axis_angle(Vec3::new(-0.5, 0.2, 0.9).normalize(), 2.3);
    for scale in [1e-3f32, 1.0, 1e3] {
        for distance in [0.0f32, 10.0] {
            let mut world = World::lit_along(Vec3::NEG_Z);
            let paint = world.paint(Vec3::splat(0.5));
            sphere(&mut world, paint, 12);
            let offset = Vec3::new(0.7, -0.3, 0.6) * distance * scale;
            world.transform(rotation, scale, offset);
            let place = |p: Vec3| rotation * p * scale + offset;
            let targets = grid(16, Vec3::ZERO, Vec3::X * 0.6, Vec3::Y * 0.6).map(place);
            let shot = Shot::of(&world, place(Vec3::new(0.2, 0.3, 5.0)), targets);
            let params = RayParams { samples: 16, radius: 10.0 * scale, ..LINEAR };
            let (values, rays) = occlusion(&shot, Corrected, params);
            assert_eq!(values, [1.0; 256], "scale {scale}, distance {distance}");
            assert_eq!(rays.occlusion, 256 * 16);
        }
    }
}

/// A unit sphere of flat triangles, each with its own normal.
fn sphere(world: &mut World, material: u32, rings: u32) {
    let at = |i: u32, j: u32| {
        let (theta, phi) = (PI * i as f32 / rings as f32, PI * (j % (2 * rings)) as f32 / rings as f32);
        Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    };
    for i in 0..rings {
        for j in 0..2 * rings {
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let mut add = |triangle: [Vec3; 3]| {
                let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize();
                world.triangle(material, triangle, [normal; 3]);
            };
            if i + 1 < rings {
                add([corners[0], corners[1], corners[2]]);
            }
            if i > 0 {
                add([corners[0], corners[2], corners[3]]);
            }
        }
    }
}

#[test]
fn a_raster_target_of_the_right_shape_is_what_jobs_read() {
    // The G-buffers of the rasterisers have the memory layout that jobs borrow.
    let (world, _) = floor();
    let shot = Shot::of(&world, EYE, [Vec3::ZERO]);
    let buffer = GBuffer {
        origin: [0; 2],
        width: 1,
        height: 1,
        position: shot.position.clone(),
        normal: shot.normal.clone(),
        triangle: shot.triangle.clone(),
        color: Vec::new(),
        depth: Vec::new(),
    };
    let job = RayJob {
        position: &buffer.position,
        normal: &buffer.normal,
        color: &buffer.color,
        triangle: &buffer.triangle,
        ..shot.job(RayProgram::Ssao, Corrected, DEFAULTS)
    };
    assert_eq!(shot.run_on(&world.brute_force(), &job).0, [[1.0; 4]]);
}

/// A tracer that traces ray by ray, and gathers no triangles.
struct OneByOne<'t>(&'t Bvh);

impl Tracer for OneByOne<'_> {
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.0.closest(ray, accept)
    }

    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool {
        self.0.occluded(ray, accept)
    }
}

#[test]
fn pixels_that_share_what_is_near_are_what_they_are_ray_by_ray() {
    let (mut world, paint) = floor();
    let glass = world.glass();
    // Pillars, boards above the floor (some of them tilted) and a pane. The ray grid has fewer rays far from the middle.
    for x in -4..=4_i32 {
        for y in -4..=4_i32 {
            let center = Vec3::new(x as f32 * 0.7, y as f32 * 0.6, 0.0);
            let turn = Mat3::from_rotation_z((3 * x + 5 * y) as f32 * 0.3);
            world.quad(paint, center + Vec3::Z * 0.2, turn * Vec3::X * 0.1, Vec3::Z * 0.2);
            if (x + y) % 3 == 0 {
                let tilt = Mat3::from_rotation_x(x as f32 * 0.2);
                world.quad(paint, center + Vec3::new(0.2, 0.2, 0.35), tilt * Vec3::X * 0.15, tilt * Vec3::Y * 0.2);
            }
        }
    }
    world.quad(glass, Vec3::new(0.3, -1.2, 0.5), Vec3::X * 0.5, Vec3::Z * 0.4);
    for bent in [false, true] {
        if bent {
            world.bend_normals(Vec3::new(0.3, -0.4, 0.9));
        }
        let shot =
            Shot::of(&world, Vec3::new(0.4, -3.0, 2.5), grid(40, Vec3::Z * 0.2, Vec3::X * 3.0, Vec3::Y * 2.5)).rows(40);
        for transparent in [true, false] {
            let tree = Bvh::build(&world.scene.geometry, &[transparent, true], Quality::default());
            for program in [RayProgram::Ssao, RayProgram::Final] {
                for (samples, radius) in [(100, 0.5), (16, 0.3), (300, 0.1), (16, 5.0)] {
                    let params = RayParams { samples, radius, ..DEFAULTS };
                    let job = shot.job(program, Corrected, params);
                    let (together, rays) = shot.run_on(&tree, &job);
                    let (alone, all) = shot.run_on(&OneByOne(&tree), &job);
                    assert_eq!(together, alone, "{program:?} {samples} {radius} {transparent} {bent}");
                    assert_eq!(rays.total() + rays.certain, all.total());
                    assert!(together.iter().any(|pixel| pixel[0] < 0.9), "something is dark");
                    let other = RayParams { radius: radius * 0.8, ..params };
                    assert_ne!(shot.run_on(&tree, &shot.job(program, Corrected, other)).0, together, "radius is seen");
                }
            }
        }
    }
}
