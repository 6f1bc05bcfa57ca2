//! A pass in a project's graph that runs a function of the caller.

use super::*;
use curitiba::passes::cpu::CpuRays;
use curitiba::passes::own::{At, OwnProgram};
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::trace::{Ray, Tracer as _};
use curitiba::pipeline::backend::{BuildStats, NO_TRIANGLE, RayBackend};
use curitiba::pipeline::executor::{Cancellation, Engines, Progress};
use curitiba::pipeline::plan::Plan;
use curitiba::pipeline::programs::RayProgram;
use curitiba::pipeline::project;
use curitiba::pipeline::scene::{Batch, Geometry, Material, RenderScene};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// A frame of a project with this ray backend, and the note of its pass.
fn rendered(name: &str, rays: impl RayBackend + 'static) -> (Image, String) {
    let project = project::load(&file(name)).expect("the project loads");
    let plan = Plan::new(project, settings(name)).expect("the plan stands");
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(rays));
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("the scene loads");
    let image = frame(&mut renderer);
    let row = renderer.timeline().rows.iter().find(|row| row.name.starts_with("pass2")).expect("the ray pass");
    (image, row.note.clone())
}

/// Whether anything is straight above the pixel's surface.
fn covered(at: At<'_>) -> [f32; 4] {
    if at.job.triangle[at.pixel.index] == NO_TRIANGLE {
        return [0.0, 0.0, 1.0, 1.0];
    }
    let [x, y, z, _] = at.job.position[at.pixel.index];
    at.rays.shadow += 1;
    let ray = Ray { origin: Vec3::new(x, y + 1e-3, z), direction: Vec3::Y, t_min: 0.0, t_max: f32::INFINITY };
    let share = if at.tracer.occluded(&ray, |_| true) { 0.25 } else { 1.0 };
    [share, share, share, 1.0]
}

#[test]
fn a_function_of_ones_own_is_a_pass_of_the_graph() {
    let (image, note) = rendered("SceneFinal", OwnProgram::new(RayProgram::Final, covered));
    let has = |value: f32| image.pixels.iter().filter(|pixel| (pixel[0] - value).abs() < 1.0 / 255.0).count();
    assert!(has(0.25) > 50 && has(1.0) > 1000 && has(0.25) + has(1.0) + has(0.0) == image.pixels.len(), "{note}");
    // Each pixel that shows the square traces one ray.
    let seen = image.pixels.len() - has(0.0);
    assert!(note.contains(&seen.to_string()), "{note}: {seen} rays");
}

#[test]
fn a_function_of_ones_own_may_share_its_work_out() {
    let shared = |at: At<'_>| {
        let sum: u32 = (0..64_u32).into_par_iter().map(|number| number ^ at.pixel.x).sum();
        [sum as f32, 0.0, 0.0, 1.0]
    };
    let alone = |at: At<'_>| [(0..64_u32).map(|number| number ^ at.pixel.x).sum::<u32>() as f32, 0.0, 0.0, 1.0];
    // A thread that waits for its own share is given other tiles meanwhile, where there are several threads.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().expect("threads");
    let (shared, _) = pool.install(|| rendered("SceneFinal", OwnProgram::new(RayProgram::Final, shared)));
    let (alone, _) = rendered("SceneFinal", OwnProgram::new(RayProgram::Final, alone));
    assert_eq!(bits(&shared), bits(&alone));
}

#[test]
fn passes_of_other_programs_are_those_of_the_processor() {
    let (own, note) = rendered("SceneReflect", OwnProgram::new(RayProgram::Ssao, covered));
    let (expected, as_expected) = rendered("SceneReflect", CpuRays::new());
    assert_eq!(bits(&own), bits(&expected));
    assert_eq!(note, as_expected);
}

#[test]
fn a_structure_that_is_given_up_is_not_built() {
    let scene = Arc::new(RenderScene {
        geometry: Geometry {
            positions: vec![Vec3::X, Vec3::Y, Vec3::Z],
            triangles: vec![[0, 1, 2]; 1000],
            batches: vec![Batch { material: 0, first: 0, count: 1000 }],
            ..Geometry::default()
        },
        materials: vec![Material::default()],
        ..RenderScene::default()
    });
    let mut own = OwnProgram::new(RayProgram::Final, covered);
    let mut built = |stop: bool| {
        let cancellation = Cancellation::new();
        if stop {
            cancellation.cancel();
        }
        own.build_until(&scene, &[false], &Progress::until(&cancellation)).expect("the processor holds it")
    };
    assert_eq!(built(true), BuildStats::default());
    assert_ne!(built(false), BuildStats::default());
}
