//! Scenes and pictures that exceed a device's limits, other jobs that are refused, and devices that fail.

use super::caustics::meshes;
use super::glass::auto;
use super::{bits, picture, rays};
use crate::adaptive::Sampling;
use crate::cpu::CpuRays;
use crate::effects::tests::world::{Shot, World, grid};
use crate::raster::cpu::CpuRasteriser;
use crate::raster::gpu::RAY_BUFFERS;
use crate::raster::gpu::device::Gpu;
use crate::wgpu_rays::programs::Kind;
use crate::wgpu_rays::split::Split;
use crate::wgpu_rays::tables::Tables;
use crate::wgpu_rays::{NAME, WgpuRays, selftest};
use curitiba_pipeline::backend::{BackendError, RayBackend, RayJob};
use curitiba_pipeline::executor::{Engines, Fallback, Observer, Progress, Renderer, Silent, Spare, StepKind};
use curitiba_pipeline::glass::{Dielectric, GlassRule, GlassShadow};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::plan::{Plan, Settings};
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba_pipeline::project;
use curitiba_pipeline::scene::{Batch, RenderScene};
use glam::Vec3;
use std::path::Path;
use std::sync::Arc;

const SIDE: u32 = 40;

/// The device of a backend that does not share it.
fn alone(rays: &mut WgpuRays) -> &mut Gpu {
    Arc::get_mut(&mut rays.gpu).expect("nobody else has the device")
}

/// Runs `test` with a shadow pass over a small world.
fn with_job(test: impl FnOnce(&mut WgpuRays, &Arc<RenderScene>, &RayJob<'_>)) {
    with_job_of(RayProgram::DeferredShadows, SIDE, test);
}

/// Runs `test` with a pass of a program over a small world, in a picture of `side` x `side` pixels.
fn with_job_of(program: RayProgram, side: u32, test: impl FnOnce(&mut WgpuRays, &Arc<RenderScene>, &RayJob<'_>)) {
    let Some(mut rays) = rays() else { return };
    let world = World::scattered();
    let targets = grid(side, Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0);
    let shot = Shot::of(&world, Vec3::new(0.3, 0.8, 9.0), targets).rows(side);
    let scene = Arc::new(world.scene.clone());
    let job = shot.job(program, Fidelity::Corrected, RayParams::default());
    test(&mut rays, &scene, &RayJob { scene: &scene, ..job });
}

fn failure(rays: &mut WgpuRays, job: &RayJob<'_>) -> BackendError {
    let mut output = Image::filled(job.width, job.height, [0.0; 4]);
    rays.run(job, &mut output, &Progress::default()).expect_err("refused")
}

#[test]
fn scenes_that_no_bindings_hold_are_refused_by_what_is_too_large() {
    with_job(|rays, scene, job| {
        rays.build(scene, &[]).expect("it fits");
        let (expected, _) = picture(rays, job);
        alone(rays).limits.max_storage_buffer_binding_size = 5000;
        let gpu = alone(rays);
        gpu.limits.max_storage_buffers_per_shader_stage = RAY_BUFFERS + gpu.parameters.storage_buffers();
        let message = rays.build(scene, &[]).expect_err("refused").to_string();
        for part in ["its arrays take", "binds 5 buffers of 5000 bytes for them", "--backend cpu"] {
            assert!(message.contains(part), "{message}");
        }
        alone(rays).limits.max_storage_buffer_binding_size = 1 << 20;
        rays.build(scene, &[]).expect("it fits again");
        assert!(bits(&picture(rays, job).0) == bits(&expected));
    });
}

/// Each array has several bindings: nodes, triangles of leaves, vertices, the mesh and texels.
#[test]
fn scenes_in_several_bindings_are_traced_to_the_same_bits() {
    let Some(mut rays) = rays() else { return };
    let mut world = super::pictures::world();
    // More triangles between the vertices make the arrays about equally large, so that few bindings hold them.
    let geometry = &mut world.scene.geometry;
    let (first, vertices) = (geometry.triangles.len() as u32, geometry.positions.len() as u32);
    geometry.batches.push(Batch { material: 0, first, count: 1100 });
    geometry.triangles.extend((0..1100).map(|i| [i, i + 1, i + 3].map(|vertex| vertex % vertices)));
    // More texels than a binding holds, all different.
    let texel = |i: u32| (i.wrapping_mul(2_654_435_761) | 0xff00_0000).to_le_bytes();
    let texels: Vec<[u8; 4]> = (0..64 * 64).map(texel).collect();
    for texture in &mut world.scene.textures {
        texture.levels.truncate(1);
        let level = &mut texture.levels[0];
        (level.width, level.height, level.texels) = (64, 64, texels.clone());
    }
    let targets = grid(SIDE, Vec3::ZERO, Vec3::X * 4.5, Vec3::Y * 4.5);
    let shot = Shot::of(&world, Vec3::new(0.3, 0.8, 9.0), targets).rows(SIDE);
    let scene = Arc::new(world.scene.clone());
    let filtered = vec![true; scene.materials.len()];
    let shadows = RayParams::default();
    let occlusion = RayParams { samples: 9, radius: 1.5, ..RayParams::default() };
    let jobs =
        [(RayProgram::DeferredShadows, shadows), (RayProgram::Reflection, shadows), (RayProgram::Ssao, occlusion)];
    let jobs = jobs.map(|(program, params)| RayJob { scene: &scene, ..shot.job(program, Fidelity::Corrected, params) });
    rays.build(&scene, &filtered).expect("it fits");
    let whole = jobs.each_ref().map(|job| picture(&mut rays, job));
    assert_eq!(rays.kernels.split, Split::default());
    let several = |rays: &WgpuRays| {
        rays.built.as_ref().is_some_and(|(_, scene)| scene.split.bindings.iter().all(|count| *count > 1))
    };
    let enough = rays.gpu.limits.max_storage_buffers_per_shader_stage >= 32;
    // The largest limit that splits every array.
    for shift in (8..16).rev() {
        alone(&mut rays).limits.max_storage_buffer_binding_size = 1 << shift;
        rays.built = None;
        match rays.build(&scene, &filtered) {
            Ok(_) if several(&rays) => break,
            Err(error) if enough => panic!("{error}"),
            Err(error) => return eprintln!("skipped: {error}"),
            Ok(_) => {}
        }
    }
    assert!(several(&rays), "every array is split");
    for (job, (expected, theirs)) in jobs.iter().zip(whole) {
        let (found, mine) = picture(&mut rays, job);
        assert!(bits(&found) == bits(&expected), "{:?}", job.program);
        assert_eq!(mine.rays, theirs.rays, "{:?}", job.program);
        assert!(expected.iter().filter(|pixel| **pixel != expected[0]).count() > 100, "something is seen");
    }
    assert_ne!(rays.kernels.split, Split::default());
}

#[test]
fn more_rays_to_a_disc_than_a_driver_takes_in_one_loop_are_refused() {
    with_job(|rays, scene, job| {
        rays.build(scene, &[]).expect("it fits");
        let of = |sun_samples| RayParams { sun: 0.53, sun_samples, ..job.params };
        let few = RayJob { params: of(16), ..*job };
        let (soft, _) = picture(rays, &few);
        assert!(bits(&soft) != bits(&picture(rays, job).0), "the shadows are soft");
        if !selftest::cuts_loops(&rays.gpu).expect("tried") {
            return eprintln!("skipped: this driver leaves no loop");
        }
        let message = failure(rays, &RayJob { params: of(65_536), ..*job }).to_string();
        assert!(message.contains("sunsamples lower"), "{message}");
        assert!(bits(&picture(rays, &few).0) == bits(&soft), "it goes on");
    });
}

#[test]
fn more_occlusion_rays_than_a_driver_takes_in_one_loop_are_refused() {
    // Few pixels: a software driver computes each for seconds before it leaves the loop.
    with_job_of(RayProgram::Ssao, 8, |rays, scene, job| {
        rays.build(scene, &[]).expect("it fits");
        let of =
            |samples, fidelity| RayJob { params: RayParams { samples, radius: 6.0, ..job.params }, fidelity, ..*job };
        for fidelity in [Fidelity::Corrected, Fidelity::Thesis] {
            let (few, _) = picture(rays, &of(16, fidelity));
            if !selftest::cuts_loops(&rays.gpu).expect("tried") {
                return eprintln!("skipped: this driver leaves no loop");
            }
            let message = failure(rays, &of(65_536, fidelity)).to_string();
            assert!(message.contains("set samples"), "{message}");
            assert!(bits(&picture(rays, &of(16, fidelity)).0) == bits(&few), "it goes on");
        }
    });
}

#[test]
fn more_photons_than_the_device_binds_are_refused() {
    let Some(mut rays) = rays() else { return };
    let world = meshes();
    let shot = Shot::of(&world, Vec3::Z * 7.0, [Vec3::NEG_Y]);
    let scene = Arc::new(world.scene.clone());
    let job = |photons| {
        let params = RayParams { photons, ..auto(2, GlassShadow::Caustic, 0) };
        RayJob { scene: &scene, ..shot.job(RayProgram::Final, Fidelity::Corrected, params) }
    };
    rays.build(&scene, &vec![true; scene.materials.len()]).expect("it fits");
    alone(&mut rays).limits.max_storage_buffer_binding_size = 1 << 20;
    let message = failure(&mut rays, &job(60_000)).to_string();
    for part in ["with the photons, take", "reads 1.0 MiB at once", "set photons lower", "--backend cpu"] {
        assert!(message.contains(part), "{message}");
    }
    let fewer = job(6000);
    let focused = rays.focused.of(NAME, &fewer, &Progress::default()).expect("they are shot");
    let tables = Tables::of(&fewer, Sampling::All, &focused, false).expect("complete");
    assert!(rays.check_tables(&fewer, &tables).is_ok(), "control");
}

#[test]
fn sampling_to_an_error_in_the_memory_of_the_device_is_refused() {
    with_job(|rays, scene, job| {
        rays.build(scene, &[]).expect("it fits");
        let rough = vec![Dielectric { alpha: 0.1, ..Dielectric::default() }; scene.materials.len()];
        let params = RayParams { error: 0.01, glass: GlassRule::Auto, ..job.params };
        let job = RayJob { program: RayProgram::Refraction, params, dielectrics: &rough, ..*job };
        let message = failure(rays, &RayJob { shared: Some(1), ..job }).to_string();
        assert!(message.contains("not in host memory"), "{message}");
        let refused = rays.run_in_place(&job, 0, &Progress::default()).expect_err("refused").to_string();
        assert!(refused.contains("not in host memory"), "{refused}");
        assert!(rays.samples_adaptively());
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
        // One tile a launch, in dispatches that are one group wide; and several launches, the last of them short.
        for (tiles, most) in [(1, 1), (7, 3), (100, 65_535)] {
            alone(rays).limits.max_compute_workgroups_per_dimension = most;
            rays.sizes.insert((Kind::of(job, false), 0), Some(tiles));
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

/// Loses the device when the ray pass of the second frame begins.
struct Loses {
    device: wgpu::Device,
    passes: u32,
    told: Vec<Fallback>,
}

impl Observer for Loses {
    fn begin(&mut self, kind: StepKind, _: &str, _: &Arc<Progress>) {
        if kind == StepKind::Rays {
            self.passes += 1;
            if self.passes == 2 {
                self.device.destroy();
            }
        }
    }
    fn end(&mut self) {}
    fn fell_back(&mut self, fallback: &Fallback) {
        self.told.push(fallback.clone());
    }
}

#[test]
fn a_device_that_is_lost_within_a_frame_is_replaced_in_it_or_named_with_the_pass() {
    let renderer = |rays: Box<dyn RayBackend>, spare: bool, observer: &mut dyn Observer| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../xml_projects/SceneShadows.xml");
        let settings = Settings { size: Some([32, 32]), ..Settings::default() };
        let plan = Plan::new(project::load(&path).expect("the project loads"), settings).expect("the plan stands");
        let mut engines = Engines::new(Box::new(CpuRasteriser::new()), rays);
        if spare {
            engines.spares.push_back(Spare::new("cpu", || Ok(Box::new(CpuRays::new()))));
        }
        Renderer::new(plan, engines, observer).expect("ready")
    };
    let mut cpu = renderer(Box::new(CpuRays::new()), false, &mut Silent);
    let expected = cpu.frame(&mut Silent).expect("rendered");
    for spare in [true, false] {
        let Some(rays) = rays() else { return };
        let mut loses = Loses { device: rays.gpu.device.clone(), passes: 0, told: Vec::new() };
        let mut renderer = renderer(Box::new(rays), spare, &mut loses);
        renderer.frame(&mut loses).expect("rendered");
        let second = renderer.frame(&mut loses);
        if spare {
            assert!(bits(&second.expect("another took over").pixels) == bits(&expected.pixels));
            let [told] = &loses.told[..] else { panic!("{:?}", loses.told) };
            assert_eq!(
                (told.pass.as_deref(), told.frame, &*told.failed, &*told.instead),
                (Some("pass2"), Some(2), "wgpu", "cpu")
            );
        } else {
            let message = second.expect_err("nothing may take over").to_string();
            assert!(message.starts_with("pass `pass2` of frame 2: wgpu: "), "{message}");
        }
    }
}

#[test]
fn a_device_without_memory_is_an_error_after_which_it_goes_on() {
    with_job(|rays, scene, job| {
        let out_of_memory = || wgpu::Error::OutOfMemory { source: "a test".into() };
        rays.gpu.fail_next(&out_of_memory());
        let message = rays.build(scene, &[]).expect_err("no memory").to_string();
        assert!(message.contains("the device is out of memory; `--backend cpu` traces without a GPU"), "{message}");
        rays.build(scene, &[]).expect("there is memory again");
        let (expected, _) = picture(rays, job);
        rays.gpu.fail_next(&out_of_memory());
        assert!(failure(rays, job).to_string().contains("the device is out of memory"));
        assert!(bits(&picture(rays, job).0) == bits(&expected));
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
