//! A sky around everything: shadow and occlusion rays pass it, mirrors and glass show it as it is.

use super::world::{Shot, World, assert_close, grid};
use crate::trace::{Bvh, Double, Hit, Quality, Ray, Tracer};
use curitiba_pipeline::backend::{Glow, Shade};
use curitiba_pipeline::glass::{GlassRule, GlassShadow};
use curitiba_pipeline::programs::Fidelity::Corrected;
use curitiba_pipeline::programs::{RayParams, RayProgram};
use curitiba_pipeline::scene::TriangleRanges;
use glam::{Vec3, Vec4};

const BLUE: Vec3 = Vec3::new(0.2, 0.5, 0.9);

/// A floor with the top and a side of a block, and a box around them; `is_sky` says whether the box is a sky. `has_mirror` adds a mirror.
fn covered(has_mirror: bool, is_sky: bool) -> World {
    let mut world = World::lit_along(Vec3::new(0.5, -1.0, -0.3));
    let paint = world.paint(Vec3::new(0.8, 0.7, 0.5));
    world.quad(paint, Vec3::ZERO, Vec3::X * 4.0, Vec3::NEG_Z * 4.0);
    world.quad(paint, Vec3::new(0.0, 1.0, 0.0), Vec3::X, Vec3::Z);
    world.quad(paint, Vec3::new(-1.0, 0.5, 0.0), Vec3::Z, Vec3::Y * 0.5);
    if has_mirror {
        let mirror = world.glass();
        world.quad(mirror, Vec3::new(0.0, 1.5, -3.0), Vec3::X * 2.0, Vec3::Y * 1.5);
    }
    let sky = world.paint(Vec3::ZERO);
    let glow = Some(Glow { color: BLUE, texture: None });
    world.shades[sky as usize] = Shade { diffuse: Vec4::W, glow, ..Shade::default() };
    for (x, y, z) in [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)] {
        for side in [6.0, -6.0] {
            world.quad(sky, z * side, x * -side, y * 6.0);
        }
    }
    let marked: Vec<bool> = (0..=sky).map(|material| is_sky && material == sky).collect();
    world.scene.geometry.sky = TriangleRanges::of_triangles(&world.scene.geometry, &marked);
    world
}

/// What a program writes at points of the floor, with these parameters.
fn floor(world: &World, program: RayProgram, params: RayParams) -> Vec<[f32; 4]> {
    let targets = grid(16, Vec3::new(0.0, 0.0, 1.5), Vec3::X * 3.0, Vec3::Z * 1.5);
    let shot = Shot::of(world, Vec3::new(0.3, 3.0, 5.5), targets).rows(16);
    let job = shot.job(program, Corrected, params);
    let by_force = shot.run(program, Corrected, params).0;
    for (pixels, tracer) in [
        (shot.run_on(&world.tree(), &job).0, "the tree"),
        (shot.run_on(&Double::build(&world.scene.geometry, &[]), &job).0, "the tree in f64"),
    ] {
        let differ = pixels.iter().zip(&by_force).filter(|(a, b)| a != b).count();
        assert!(differ <= 2, "{program:?}: {differ} pixels of {tracer} are others than by brute force");
    }
    by_force
}

#[test]
fn a_sky_throws_no_shadow_and_occludes_nothing() {
    let params = RayParams { samples: 16, radius: 20.0, ..RayParams::default() };
    let soft = RayParams { sun: 4.0, sun_samples: 4, ..params };
    for (program, params) in [
        (RayProgram::DeferredShadows, params),
        (RayProgram::DeferredShadows, soft),
        (RayProgram::Ssao, params),
        (RayProgram::Final, params),
        (RayProgram::Final, soft),
    ] {
        let mut open = covered(false, true);
        let sky = open.scene.geometry.sky.as_slice()[0];
        let under_sky = floor(&open, program, params);
        let under_roof = floor(&covered(false, false), program, params);
        // The same scene without the sky.
        open.scene.geometry.triangles.truncate(sky[0] as usize);
        open.scene.geometry.batches.pop();
        open.scene.geometry.sky = TriangleRanges::default();
        assert!(under_sky == floor(&open, program, params), "{program:?}");
        let darker = under_sky.iter().zip(&under_roof).filter(|(sky, roof)| roof[0] < 0.9 * sky[0]).count();
        assert!(darker > 150, "{program:?}: a roof darkens {darker} points");
        let values: Vec<u32> = under_sky.iter().map(|pixel| pixel[0].to_bits()).collect();
        assert!(values.iter().any(|value| *value != values[0]), "{program:?}: the block is still in the way");
    }
}

#[test]
fn mirrors_and_glass_show_a_sky_as_it_is_and_a_roof_in_its_shadow() {
    let eye = Vec3::new(0.0, 1.4, 0.5);
    let up = Vec3::new(0.2, 2.6, -3.0);
    for (program, params) in [
        (RayProgram::Reflection, RayParams::default()),
        (RayProgram::Final, RayParams { samples: 8, radius: 20.0, ..RayParams::default() }),
        (
            RayProgram::Final,
            RayParams {
                samples: 8,
                radius: 20.0,
                glass: GlassRule::Auto,
                shadow: GlassShadow::Straight,
                ..RayParams::default()
            },
        ),
    ] {
        let seen = |is_sky: bool| {
            let mut world = covered(true, is_sky);
            world.bodies = params.glass == GlassRule::Auto;
            let shot = Shot::of(&world, eye, [up]);
            shot.run_on(&world.tree(), &shot.job(program, Corrected, params)).0[0]
        };
        assert_close(seen(true), BLUE, 1e-6, format!("{program:?}"));
        if program == RayProgram::Final {
            let dimmed = seen(false)[2];
            assert!(dimmed < 0.8 * BLUE.z, "{program:?}: {dimmed}");
        }
    }
}

#[test]
fn the_nearest_hit_may_be_on_the_sky_and_no_other_query_finds_it() {
    let world = covered(false, true);
    let tree = Bvh::build(&world.scene.geometry, &[false, true], Quality::default());
    let sky = &world.scene.geometry.sky;
    let up = Ray { origin: Vec3::new(2.0, 0.5, 2.0), direction: Vec3::Y, t_min: 0.0, t_max: f32::INFINITY };
    let hit = tree.closest(&up, |_| true).expect("the sky");
    assert!(sky.contains(hit.triangle) && hit.t == 5.5, "{hit:?}");
    let mut asked = 0;
    assert_eq!(
        tree.closest(&up, |_: &Hit| {
            asked += 1;
            false
        }),
        None
    );
    assert!(asked > 0, "a sky with holes is asked about");
    assert!(!tree.occluded(&up, |_| true) && tree.any(&up, |_| true).is_none());
    // The block is nearer than the sky; a sky beyond the end of a ray is not hit.
    let down = Ray { origin: Vec3::new(0.0, 3.0, 0.0), direction: Vec3::NEG_Y, ..up };
    assert_eq!(tree.closest(&down, |_| true).map(|hit| (hit.t, sky.contains(hit.triangle))), Some((2.0, false)));
    assert!(tree.occluded(&down, |_| true));
    assert_eq!(tree.closest(&Ray { t_max: 5.0, ..up }, |_| true), None);
}
