//! What devices cannot do, and how they fail.

use super::{bits, picture, rays};
use crate::cpu::CpuRays;
use crate::effects::dielectric::Variant;
use crate::effects::tests::world::{Shot, World, grid};
use crate::raster::gpu::device::Gpu;
use crate::wgpu_rays::WgpuRays;
use curitiba_pipeline::backend::{BackendError, RayBackend, RayJob};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba_pipeline::scene::RenderScene;
use glam::Vec3;
use std::sync::Arc;

const SIDE: u32 = 40;

/// The device of a backend that shares it with nobody.
fn alone(rays: &mut WgpuRays) -> &mut Gpu {
    Arc::get_mut(&mut rays.gpu).expect("nobody else has the device")
}

/// Runs a shadow pass over a small world as a test says.
fn with_job(test: impl FnOnce(&mut WgpuRays, &Arc<RenderScene>, &RayJob<'_>)) {
    let Some(mut rays) = rays() else { return };
    let world = World::scattered();
    let targets = grid(SIDE, Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0);
    let shot = Shot::of(&world, Vec3::new(0.3, 0.8, 9.0), targets).rows(SIDE);
    let scene = Arc::new(world.scene.clone());
    let job = shot.job(RayProgram::DeferredShadows, Fidelity::Corrected, RayParams::default());
    test(&mut rays, &scene, &RayJob { scene: &scene, ..job });
}

fn failure(rays: &mut WgpuRays, job: &RayJob<'_>) -> BackendError {
    let mut output = Image::filled(job.width, job.height, [0.0; 4]);
    rays.run(job, &mut output, &Progress::default()).expect_err("refused")
}

#[test]
fn scenes_that_no_binding_holds_are_refused_by_what_is_too_large() {
    with_job(|rays, scene, _| {
        alone(rays).limits.max_storage_buffer_binding_size = 5000;
        let message = rays.build(scene, &[]).expect_err("refused").to_string();
        for part in ["the vertices of the scene take", "reads 5000 at once at most", "--backend cpu"] {
            assert!(message.contains(part), "{message}");
        }
        alone(rays).limits.max_storage_buffer_binding_size = 1 << 20;
        rays.build(scene, &[]).expect("it fits again");
    });
}

#[test]
fn a_light_with_a_disc_is_refused() {
    with_job(|rays, scene, job| {
        rays.build(scene, &[]).expect("it fits");
        let soft = RayParams { sun: 0.53, ..job.params };
        let message = failure(rays, &RayJob { params: soft, ..*job }).to_string();
        assert!(message.contains("its light has a disc (sun=0.53)") && !rays.traces_sun_discs(), "{message}");
    });
}

#[test]
fn coordinates_that_would_overflow_are_refused() {
    with_job(|rays, scene, _| {
        let mut far = RenderScene::clone(scene);
        far.geometry.positions[0] = Vec3::splat(1.0e16);
        let message = rays.build(&Arc::new(far), &[]).expect_err("refused").to_string();
        assert!(message.contains("coordinates beyond 1e15"), "{message}");
    });
}

#[test]
fn pictures_are_the_same_without_a_clock_and_in_launches_of_any_size() {
    with_job(|rays, scene, job| {
        rays.build(scene, &[]).expect("built");
        let mut cpu = CpuRays::new();
        cpu.build(scene, &[]).expect("built");
        let (expected, theirs) = picture(&mut cpu, job);
        rays.clock = None;
        // One tile a launch in rectangles one group wide, and several launches whose last is short.
        for (tiles, most) in [(1, 1), (7, 3), (100, 65_535)] {
            alone(rays).limits.max_compute_workgroups_per_dimension = most;
            rays.sizes.insert((job.program, Variant::of(job)), Some(tiles));
            let (found, mine) = picture(rays, job);
            assert!(bits(&found) == bits(&expected), "{tiles} tiles a launch");
            assert_eq!((mine.rays.shadow, mine.device_time), (theirs.rays.shadow, None));
        }
    });
}

#[test]
fn pictures_larger_than_the_textures_of_the_device_are_refused() {
    with_job(|rays, scene, job| {
        rays.build(scene, &[]).expect("built");
        alone(rays).limits.max_texture_dimension_2d = SIDE - 1;
        assert_eq!(rays.limits().side, SIDE - 1);
        let message = failure(rays, job).to_string();
        assert!(message.contains("40 x 40") && message.contains("39 x 39"), "{message}");
    });
}

#[test]
fn a_lost_device_is_an_error_that_says_what_to_do() {
    with_job(|rays, scene, job| {
        rays.build(scene, &[]).expect("built");
        picture(rays, job);
        rays.gpu.device.destroy();
        let message = failure(rays, job).to_string();
        assert!(message.contains("wgpu") && message.contains("`--backend cpu` traces without a GPU"), "{message}");
        assert!(!message.contains("--raster"), "{message}");
    });
}

#[test]
fn jobs_whose_scene_was_not_built_or_that_lack_a_buffer_are_refused() {
    with_job(|rays, scene, job| {
        assert!(failure(rays, job).to_string().contains("was not built"));
        rays.build(scene, &[]).expect("built");
        let message = failure(rays, &RayJob { position: &[], ..*job }).to_string();
        assert!(message.contains("pos_buffer"), "{message}");
        let message = failure(rays, &RayJob { shared: Some(1), ..*job }).to_string();
        assert!(message.contains("neither in host memory nor"), "{message}");
    });
}
