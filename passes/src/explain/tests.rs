use super::{PixelRays, pixel, pixel_on};
use crate::effects::fresnel;
use crate::effects::tests::world::{Shot, World, grid};
use crate::trace::{Event, Outcome, Purpose, RecordedRay, SurfacePoint};
use curitiba_pipeline::backend::{RayCounts, RayJob};
use curitiba_pipeline::glass::{Dielectric, Shape};
use curitiba_pipeline::programs::Fidelity::{Corrected, Thesis};
use curitiba_pipeline::programs::{RayParams, RayProgram, Sampler};
use glam::Vec3;

const PROGRAMS: [RayProgram; 5] =
    [RayProgram::DeferredShadows, RayProgram::Reflection, RayProgram::Refraction, RayProgram::Ssao, RayProgram::Final];

/// A floor with a wall, below two panes and, if `awning` is set, below an alpha-tested awning.
fn yard(awning: bool) -> World {
    let mut world = World::lit_along(Vec3::new(0.4, 0.1, -1.0));
    let stone = world.paint(Vec3::new(0.5, 0.6, 0.7));
    let glass = world.glass();
    let leaf = world.picture([[200, 250, 90, 255], [90, 90, 90, 0]], Some(0.5));
    world.quad(stone, Vec3::ZERO, Vec3::X * 9.0, Vec3::Y * 9.0);
    world.quad(stone, Vec3::new(0.6, 0.0, 0.0), Vec3::Y * 9.0, Vec3::Z * 1.5);
    if awning {
        world.quad(leaf, Vec3::new(-1.0, 0.0, 3.0), Vec3::X, Vec3::Y);
    }
    world.quad(glass, Vec3::Z * 0.8, Vec3::X * 0.5, Vec3::Y * 0.5);
    world.quad(glass, Vec3::Z * 0.3, Vec3::X * 0.5, Vec3::Y * 0.5);
    world
}

fn shot(world: &World) -> Shot<'_> {
    Shot::of(world, Vec3::new(-0.7, 0.2, 2.6), grid(12, Vec3::ZERO, Vec3::X * 1.2, Vec3::Y * 1.2)).rows(12)
}

fn rays<'r>(explained: &'r PixelRays<'_>) -> impl Iterator<Item = &'r RecordedRay> {
    explained.events.iter().filter_map(|event| match event {
        Event::Ray(ray) => Some(ray),
        Event::Certain { .. } => None,
    })
}

fn counts(explained: &PixelRays<'_>, samples: u64) -> RayCounts {
    let mut counts = RayCounts::default();
    for event in &explained.events {
        match event {
            Event::Certain { .. } => counts.certain += samples,
            Event::Ray(ray) => match ray.purpose {
                Purpose::Shadow => counts.shadow += 1,
                Purpose::Occlusion => counts.occlusion += 1,
                Purpose::Reflected => counts.reflected += 1,
                Purpose::Refracted => counts.refracted += 1,
                Purpose::Camera => counts.camera += 1,
            },
        }
    }
    counts
}

#[test]
fn an_explained_pixel_has_the_value_and_the_rays_of_the_whole_pass() {
    let world = yard(true);
    let shot = shot(&world);
    let tree = world.tree();
    for program in PROGRAMS {
        for fidelity in [Corrected, Thesis] {
            let job =
                shot.job(program, fidelity, RayParams { samples: 9, sampler: Sampler::Strata, ..RayParams::default() });
            let (picture, total) = shot.run_on(&tree, &job);
            let mut sum = RayCounts::default();
            for y in 0..12 {
                for x in 0..12 {
                    let explained = pixel_on(&tree, &job, x, y).expect("a complete job");
                    let expected = picture[(y * 12 + x) as usize];
                    assert_eq!(explained.value.map(f32::to_bits), expected.map(f32::to_bits), "{program:?} {x},{y}");
                    sum += counts(&explained, 9);
                }
            }
            assert_eq!(sum, total, "{program:?} {fidelity:?}");
            assert!(sum.total() > 20, "{program:?} {fidelity:?}: {sum:?}");
        }
    }
}

#[test]
fn the_weights_of_a_panes_rays_are_fresnels_and_add_up_to_the_pixel() {
    let world = yard(false);
    let shot = shot(&world);
    let mut panes = 0;
    for fidelity in [Corrected, Thesis] {
        let job = shot.job(RayProgram::Refraction, fidelity, RayParams::default());
        for index in (0..144).filter(|index| shot.color[*index] == [1.0, 0.0, 1.0, 0.0]) {
            panes += 1;
            let explained = pixel(&job, index as u32 % 12, index as u32 / 12).expect("a complete job");
            let first: Vec<&RecordedRay> = rays(&explained).filter(|ray| ray.bounce == 0).collect();
            let position = Vec3::from_slice(&shot.position[index]);
            let cos = (job.eye - position).normalize().z.abs();
            let (reflected, refracted) = (first[0].weight, first[1].weight);
            assert!((reflected + refracted - 1.0).abs() < 1e-6, "{reflected} {refracted}");
            let expected = if fidelity == Corrected { fresnel(cos, 1.1).reflectance } else { 1.21 * (1.0 - cos * cos) };
            assert!((reflected - expected).abs() < 1e-5, "{fidelity:?}: {reflected} {expected}");
            // Each ray that hits an opaque surface contributes its colour times its weight; other rays contribute
            // nothing.
            let mut sum = Vec3::ZERO;
            for ray in rays(&explained) {
                let Outcome::Hit(hit) = &ray.outcome else { continue };
                let material = world.scene.geometry.material_of(hit.triangle);
                if !world.glass[material as usize] {
                    let normal = SurfacePoint::from_hit(&world.scene.geometry, hit).normal;
                    let facing = if normal.dot(ray.ray.direction) > 0.0 { -normal } else { normal };
                    sum +=
                        ray.weight * world.lit(material, facing.dot(job.sun.map_or(Vec3::ZERO, |sun| -sun.direction)));
                }
            }
            let found = Vec3::from_slice(&explained.value);
            assert!((found - sum).abs().max_element() < 1e-5, "{fidelity:?} pixel {index}: {found} {sum}");
        }
    }
    assert!(panes > 20, "{panes}");
}

#[test]
fn rays_leave_by_the_bound_of_their_points_error_in_corrected_and_where_the_position_is_stored_in_thesis() {
    let world = yard(true);
    let shot = shot(&world);
    let index = (0..144).find(|index| shot.triangle[*index] < 2).expect("the floor is seen");
    let [x, y] = [index as u32 % 12, index as u32 / 12];
    let job = shot.job(RayProgram::DeferredShadows, Corrected, RayParams::default());
    let explained = pixel(&job, x, y).expect("a complete job");
    let shadow = rays(&explained).next().expect("a shadow ray");
    let point =
        SurfacePoint::snap(&world.scene.geometry, shot.triangle[index], Vec3::from_slice(&shot.position[index]));
    assert_eq!(shadow.leaves, Some(shot.triangle[index]));
    let bound = f64::from(32.0 * point.error);
    assert!((shadow.offset - bound).abs() < 0.1 * bound && bound > 0.0, "{} {bound}", shadow.offset);
    let thesis = RayJob { triangle: &[], ..shot.job(RayProgram::DeferredShadows, Thesis, RayParams::default()) };
    let explained = pixel(&thesis, x, y).expect("a complete job");
    let shadow = rays(&explained).next().expect("a shadow ray");
    assert_eq!((shadow.ray.origin, shadow.ray.t_min), (Vec3::from_slice(&shot.position[index]), 1e-4));
    assert_eq!((shadow.leaves, shadow.offset), (None, 0.0));
}

#[test]
fn what_blocks_and_what_is_passed_is_named() {
    let world = yard(false);
    let shot = Shot::of(&world, Vec3::new(-0.7, 0.2, 0.2), [Vec3::new(0.1, 0.05, 0.0)]);
    // Both panes lie towards the sun: shadow rays of `final` pass them, those of `deferredShadows` do not.
    let explained = pixel(&shot.job(RayProgram::Final, Corrected, RayParams::default()), 0, 0).expect("a complete job");
    let shadow = rays(&explained).find(|ray| ray.purpose == Purpose::Shadow).expect("a shadow ray");
    assert_eq!(shadow.outcome, Outcome::Open);
    assert!(shadow.asked.iter().any(|(hit, stops)| world.scene.geometry.material_of(hit.triangle) == 1 && !stops));
    let text = explained.to_string();
    for part in [
        "position",
        "shows",
        "snapped",
        "shadow ray, weight 1",
        "passes triangle",
        "glass",
        "occlusion ray",
        "off triangle",
    ] {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    let job = shot.job(RayProgram::DeferredShadows, Corrected, RayParams::default());
    let explained = pixel(&job, 0, 0).expect("a complete job");
    let Some(RecordedRay { outcome: Outcome::Blocked(hit), .. }) = rays(&explained).next() else {
        panic!("not blocked:\n{explained}");
    };
    assert_eq!(world.scene.geometry.material_of(hit.triangle), 1);
    assert!((hit.t - 0.3 * Vec3::new(0.4, 0.1, 1.0).length()).abs() < 1e-4, "the nearer pane: {}", hit.t);
    assert!(explained.to_string().contains("blocked by"));
}

#[test]
fn rays_that_find_the_bodies_around_the_camera_are_not_the_pixels() {
    let mut world = yard(true);
    let glass = Dielectric { shape: Shape::Solid, index: 1.5, filter: Vec3::ONE, ..Dielectric::default() };
    let body = world.dielectric(glass);
    // Above the camera, which no pixel shows.
    world.quad(body, Vec3::Z * 4.5, Vec3::X * 9.0, Vec3::Y * 9.0);
    let (shot, tree) = (shot(&world), world.tree());
    for program in [RayProgram::Refraction, RayProgram::Final] {
        let job =
            shot.job(program, Corrected, RayParams { samples: 9, sampler: Sampler::Strata, ..RayParams::default() });
        let (_, total) = shot.run_on(&tree, &job);
        let mut sum = RayCounts::default();
        for index in 0..144 {
            sum += counts(&pixel_on(&tree, &job, index % 12, index / 12).expect("a complete job"), 9);
        }
        assert_eq!(sum, total, "{program:?}");
    }
}
