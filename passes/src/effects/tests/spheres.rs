//! Exact spheres against closed forms, in all programs but those of glass.

use super::world::{Shot, World, assert_close, grid};
use crate::cpu;
use crate::trace::{Ray, SurfacePoint, Tracer, WithSpheres};
use curitiba_pipeline::backend::RayCounts;
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::Fidelity::{Corrected, Thesis};
use curitiba_pipeline::programs::{RayParams, RayProgram, Sampler};
use curitiba_pipeline::scene::Sphere;
use glam::Vec3;

fn run(world: &World, shot: &Shot<'_>, program: RayProgram, params: RayParams) -> (Vec<[f32; 4]>, RayCounts) {
    let (triangles, spheres) = (&world.tree(), &world.spheres());
    let tracer = WithSpheres { triangles, spheres };
    let job = shot.job(program, Corrected, params);
    let (pixels, rays) = shot.run_on(&tracer, &job);
    // A pixel traced alone has the same value as in its tile.
    for (index, pixel) in pixels.iter().enumerate() {
        let (x, y) = (index as u32 % job.width, index as u32 / job.width);
        assert_eq!(cpu::trace_pixel(&tracer, &job, x, y).expect("a complete job"), *pixel, "{program:?} {x} {y}");
    }
    (pixels, rays)
}

#[test]
fn no_ray_that_leaves_a_sphere_meets_it_where_it_starts() {
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 8_388_608.0 - 1.0
    };
    let (mut hits, mut misses) = (0, 0);
    for scale in [1e-4_f32, 1.0, 1e3] {
        for away in [0.0_f32, 1.0, 100.0, 3e3] {
            let mut again = [0, 0];
            for index in 0..20_000 {
                let mut vector = || Vec3::new(random(), random(), random());
                let sphere = Sphere { center: vector() * away * scale, radius: scale, material: 0 };
                let mut world = World::default();
                world.scene.geometry.spheres.push(sphere);
                let near = sphere.center + vector().normalize_or(Vec3::X) * scale * 1.0001;
                let point = SurfacePoint::on_sphere(&sphere, near);
                // A third of the directions are tangent to the surface, up to rounding.
                let tilt = [1.0, 1e-3, 1e-7][index % 3];
                let along = vector().cross(point.normal).normalize_or(Vec3::X);
                let direction = (along + point.normal * tilt * vector().x).normalize();
                let ray = Ray { origin: point.spawn(direction), direction, t_min: 0.0, t_max: f32::INFINITY };
                let triangles = &world.tree();
                let tracer = WithSpheres { triangles, spheres: &world.spheres() };
                let hit = tracer.closest(&ray, |_| true);
                assert_eq!(hit.is_some(), tracer.occluded(&ray, |_| true));
                let chord = -2.0 * direction.dot(point.normal) * scale;
                if direction.dot(point.normal) >= 0.0 {
                    again[0] += usize::from(hit.is_some());
                    misses += 1;
                } else if chord > 1e-2 * scale {
                    let t = hit.expect("it goes through").t;
                    // The origin is off the true sphere by some units in the last place. For a flat chord that error
                    // grows by 1 / cos at the other end.
                    let allowed = 2e-5 * (1.0 + away) * scale * scale / chord;
                    again[1] += usize::from((t - chord).abs() > allowed);
                    hits += 1;
                }
            }
            assert_eq!(again, [0, 0], "{scale} {away}: met where they start; ended elsewhere");
        }
    }
    assert!(hits > 20_000 && misses > 40_000, "{hits} {misses}");
}

/// A sphere above a ground at z = 0, with light from above.
fn above(light: Vec3) -> World {
    let mut world = World::lit_along(light);
    let (ground, ball) = (world.paint(Vec3::ONE), world.paint(Vec3::new(0.2, 0.5, 0.8)));
    world.quad(ground, Vec3::ZERO, Vec3::X * 30.0, Vec3::Y * 30.0);
    world.sphere(ball, Vec3::new(0.5, -0.3, 2.0), 1.0);
    world
}

#[test]
fn a_shadow_is_the_cylinder_behind_the_sphere() {
    let light = Vec3::new(0.3, -0.2, -1.0).normalize();
    let world = above(light);
    let targets = grid(32, Vec3::new(0.8, -0.7, 0.0), Vec3::X * 3.0, Vec3::Y * 3.0);
    let shot = Shot::of(&world, Vec3::new(1.0, 2.0, 9.0), targets).rows(32);
    let (pixels, rays) = run(&world, &shot, RayProgram::DeferredShadows, RayParams::default());
    let center = Vec3::new(0.5, -0.3, 2.0);
    let (mut dark, mut own) = (0, 0);
    for (index, pixel) in pixels.iter().enumerate() {
        let position = Vec3::from_slice(&shot.position[index]);
        let expected = if shot.triangle[index] >= 2 {
            own += 1;
            // A point that faces away from the light is in its own shadow. The colour of such a pixel is dark already, so the program writes 1.
            1.0
        } else {
            let from = position - center;
            let aside = (from - from.dot(light) * light).length();
            assert!((aside - 1.0).abs() > 1e-4, "no pixel is on the border");
            dark += usize::from(aside < 1.0);
            if aside < 1.0 { 0.5 } else { 1.0 }
        };
        assert_eq!(*pixel, [expected, expected, expected, 1.0], "{index} {position}");
    }
    assert!(dark > 20 && own > 100 && rays.shadow > 900, "{dark} {own} {rays:?}");
    let (all, _) = run(&world, &shot, RayProgram::Final, RayParams { samples: 0, ..RayParams::default() });
    for (index, (all, light)) in all.iter().zip(&pixels).enumerate() {
        let dim = if shot.triangle[index] >= 2 && shot.position[index][3] == 0.0 { 0.5 } else { light[0] };
        assert_close(*all, Vec3::from_slice(&shot.color[index]) * dim, 1e-6, index);
    }
}

/// The share of the cosine-weighted sky that a sphere covers straight above a point of a plane is (r / d)².
#[test]
fn occlusion_is_the_form_factor_of_the_sphere() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let (ground, ball) = (world.paint(Vec3::ONE), world.paint(Vec3::ONE));
    world.quad(ground, Vec3::ZERO, Vec3::X * 30.0, Vec3::Y * 30.0);
    world.sphere(ball, Vec3::new(0.0, 0.0, 2.0), 1.0);
    let params =
        |radius| RayParams { samples: 4096, radius, intensity: 1.0, sampler: Sampler::Sobol, ..RayParams::default() };
    let mut shot = Shot::of(&world, Vec3::new(9.0, 0.0, 4.0), [Vec3::ZERO, Vec3::new(0.0, 0.0, 3.0)]);
    // The top of the sphere, with an exact position.
    (shot.position[1], shot.normal[1]) = ([0.0, 0.0, 3.0, 1.0], [0.0, 0.0, 1.0, 0.0]);
    let (pixels, rays) = run(&world, &shot, RayProgram::Ssao, params(9.0));
    assert!((pixels[0][0] - 0.75).abs() < 2e-3, "{:?}", pixels[0]);
    assert!(rays.occlusion >= 4096);
    // A convex body does not occlude itself, and what is out of reach does not count.
    assert_eq!(pixels[1][0], 1.0);
    let (pixels, rays) = run(&world, &shot, RayProgram::Ssao, params(0.9));
    assert_eq!(
        (pixels[0][0], pixels[1][0], rays.occlusion),
        (1.0, 1.0, 4096),
        "on the ground it is certain without a ray"
    );
}

#[test]
fn a_mirror_sphere_shows_what_lies_in_the_mirrored_direction() {
    let mut world = World::lit_along(Vec3::NEG_Y);
    let mirror = world.glass();
    world.sphere(mirror, Vec3::new(0.0, 0.0, 0.0), 1.0);
    let colors = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 1.0), Vec3::ONE];
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    for (axis, color) in axes.into_iter().zip(colors) {
        let paint = world.paint(color);
        let side = axis.any_orthonormal_vector();
        world.quad(paint, axis * 50.0, side * 50.0, -axis.cross(side) * 50.0);
    }
    let eye = Vec3::new(0.0, 0.0, 8.0);
    let shot = Shot::of(&world, eye, grid(40, Vec3::ZERO, Vec3::X, Vec3::Y)).rows(40);
    let (pixels, rays) = run(&world, &shot, RayProgram::Reflection, RayParams::default());
    let mut seen = [0; 6];
    for (index, pixel) in pixels.iter().enumerate() {
        if shot.triangle[index] < world.scene.geometry.triangles.len() as u32 {
            continue;
        }
        let normal = Vec3::from_slice(&shot.normal[index]).as_dvec3();
        let at = Vec3::from_slice(&shot.position[index]).as_dvec3();
        let view = (at - eye.as_dvec3()).normalize();
        let mirrored = view - 2.0 * view.dot(normal) * normal;
        // Of the six walls, which are perpendicular to the axes, the mirrored ray meets the one at the least distance.
        let to = |axis: &Vec3| (50.0 - at.dot(axis.as_dvec3())) / mirrored.dot(axis.as_dvec3());
        let mut walls: Vec<(f64, usize)> = axes.iter().map(to).zip(0..).filter(|(t, _)| *t > 0.0).collect();
        walls.sort_by(|a, b| a.0.total_cmp(&b.0));
        if walls[1].0 - walls[0].0 < 1e-3 {
            continue;
        }
        let wall = walls[0].1;
        seen[wall] += 1;
        let cos = if axes[wall] == Vec3::NEG_Y { 1.0 } else { 0.0 };
        assert_close(*pixel, world.lit(wall as u32 + 1, cos), 1e-6, format!("{index} {wall}"));
    }
    assert!(seen.iter().all(|count| *count > 3) && rays.reflected > 1000, "{seen:?} {rays:?}");
}

#[test]
fn who_knows_no_spheres_refuses_them() {
    let world = above(Vec3::NEG_Z);
    let shot = Shot::of(&world, Vec3::new(0.0, 0.0, 9.0), [Vec3::ZERO]);
    let (triangles, spheres) = (&world.tree(), &world.spheres());
    for (fidelity, knows) in [(Corrected, false), (Thesis, true)] {
        let job = shot.job(RayProgram::DeferredShadows, fidelity, RayParams::default());
        let mut output = Image::filled(1, 1, [0.0; 4]);
        let refused = if knows {
            cpu::trace(&WithSpheres { triangles, spheres }, &job, &mut output, &Progress::default())
        } else {
            cpu::trace(triangles, &job, &mut output, &Progress::default())
        };
        let refused = refused.expect_err("triangles only").to_string();
        assert!(refused.contains("exact spheres") && refused.contains("corrected"), "{refused}");
    }
}
