//! Passes shared by several GPUs: one GPU used as several, and all GPUs where there are more.

use super::{PROJECTS, project, there};
use curitiba::cuda::device::ordinals;
use curitiba::cuda::{CudaRays, OptixRays};
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use curitiba::pipeline::backend::{BackendError, Rasteriser, RayBackend, RayCounts};
use curitiba::pipeline::executor::{Engines, Renderer, Silent, StepKind};
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project;
use curitiba::{BackendChoice, Choice};

type Made = Result<Box<dyn RayBackend>, BackendError>;
/// The bits of a picture, and its ray counts.
type Frame = (Vec<[u32; 4]>, RayCounts);

fn frame(name: &str, fidelity: Fidelity, seed: u32, rays: Made) -> Frame {
    drawn_frame(Box::new(CpuRasteriser::new()), name, fidelity, seed, rays).0
}

/// The second frame, and the notes on how its G-buffer was passed to the rays.
fn drawn_frame(
    raster: Box<dyn Rasteriser>,
    name: &str,
    fidelity: Fidelity,
    seed: u32,
    rays: Made,
) -> (Frame, Vec<String>) {
    let project = project::load(&project(name)).expect("the project loads");
    let set: &[&str] = match name {
        "SceneSSAO" | "SceneFinal" => &["pass2.samples=9"],
        "glass/Caustics" => &["pass2.samples=9", "pass2.sun=0"],
        _ => &[],
    };
    let camera = if name.starts_with("glass/") { "MainCamera" } else { "Vidro" };
    let settings = Settings {
        // The size is no multiple of any block or tile, and the camera is near the panes.
        size: Some([203, 149]),
        camera: Some(camera.to_owned()),
        fidelity,
        seed,
        set: set.iter().map(|one| (*one).to_owned()).collect(),
        ..Settings::default()
    };
    let engines = Engines::new(raster, rays.expect("it was there before"));
    let plan = Plan::new(project, settings).expect("the plan stands");
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("ready");
    // By the second frame all buffers exist already.
    renderer.frame(&mut Silent).expect("rendered");
    let picture = renderer.frame(&mut Silent).expect("rendered");
    let row = renderer.timeline().rows.iter().find(|row| row.kind == StepKind::Rays).expect("a ray pass ran");
    assert!(row.device_ms.len() == 2 && row.device_ms.iter().all(|ms| *ms > 0.0), "{:?}", row.device_ms);
    let joins = renderer.timeline().rows.iter().filter(|row| row.kind == StepKind::Join);
    let joins = joins.map(|row| row.note.clone()).collect();
    let bits = picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect();
    ((bits, row.rays.expect("rays are counted")), joins)
}

fn copies_from_gpu_to_gpu(backend: BackendChoice, on: impl Fn(&[usize]) -> Made) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let wgpu = || WgpuRasteriser::new(AdapterChoice::RealGpu);
    let mut sets = vec![vec![0], vec![0, 0]];
    let all = ordinals(backend.name(), None).expect("there are some");
    if all.len() > 1 {
        // Any GPU of the set may draw.
        sets.extend([all.clone(), all.into_iter().rev().collect()]);
    }
    let mut before: Option<Frame> = None;
    for set in &sets {
        let shared =
            wgpu().map(|raster| raster.shares().is_some_and(|device| on(set).is_ok_and(|rays| rays.joins(device))));
        match shared {
            Ok(true) => {}
            other => {
                let required = std::env::var_os("CURITIBA_REQUIRE_CUDA_TESTS").is_some_and(|value| value == "1");
                assert!(!required, "GPUs {set:?} do not share a G-buffer: {other:?}");
                println!("skipped: GPUs {set:?} do not share a G-buffer: {other:?}");
                continue;
            }
        }
        let raster = Box::new(wgpu().expect("it was there before"));
        let (frame, joins) = drawn_frame(raster, "SceneFinal", Fidelity::Corrected, 0, on(set));
        let mut expected = vec!["in device memory"];
        expected.extend((set.len() > 1).then_some("copied from GPU to GPU"));
        assert_eq!(joins, expected, "GPUs {set:?}");
        if let Some(before) = &before {
            assert!(frame.0 == before.0, "another picture on GPUs {set:?}");
            assert_eq!(frame.1, before.1, "other rays on GPUs {set:?}");
        }
        before = Some(frame);
    }
}

#[test]
fn a_gbuffer_goes_from_gpu_to_gpu_without_the_host_with_our_own_tracer() {
    copies_from_gpu_to_gpu(BackendChoice::Cuda, |set| Ok(Box::new(CudaRays::on(set)?)));
}

#[test]
fn a_gbuffer_goes_from_gpu_to_gpu_without_the_host_with_optix() {
    copies_from_gpu_to_gpu(BackendChoice::Optix, |set| Ok(Box::new(OptixRays::on(set)?)));
}

fn is_shared(backend: BackendChoice, on: impl Fn(&[usize]) -> Made) {
    let Some(one) = there(Choice::CPU.traced_by(backend)) else { return };
    assert_eq!(one.gpus().len(), 1);
    drop(one);
    let mut sets = vec![vec![0, 0], vec![0, 0, 0]];
    let all = ordinals(backend.name(), None).expect("there are some");
    match all.len() {
        1 => println!("one GPU alone: it was taken as two and as three"),
        _ => sets.push(all),
    }
    for set in &sets {
        let several = on(set).expect("made");
        assert_eq!(several.gpus().len(), set.len());
        assert!(several.device().starts_with(&format!("{} GPUs: ", set.len())), "{}", several.device());
    }
    for name in PROJECTS {
        for fidelity in [Fidelity::Corrected, Fidelity::Thesis] {
            let one = frame(name, fidelity, 0, on(&[0]));
            for set in &sets {
                let several = frame(name, fidelity, 0, on(set));
                assert!(several.0 == one.0, "{name}, {fidelity:?}: another picture on GPUs {set:?}");
                assert_eq!(several.1, one.1, "{name}, {fidelity:?}: other rays on GPUs {set:?}");
            }
        }
    }
    let (one, other) = (0, 1);
    let [one, other] = [one, other].map(|seed| frame("SceneSSAO", Fidelity::Corrected, seed, on(&[0, 0])).0);
    assert!(one != other, "the comparison sees another seed");
}

#[test]
fn several_gpus_make_the_picture_and_trace_the_rays_of_one_with_our_own_tracer() {
    is_shared(BackendChoice::Cuda, |set| Ok(Box::new(CudaRays::on(set)?)));
}

#[test]
fn several_gpus_make_the_picture_and_trace_the_rays_of_one_with_optix() {
    is_shared(BackendChoice::Optix, |set| Ok(Box::new(OptixRays::on(set)?)));
}

/// Surfaces beyond the length of the list are computed by a separate kernel.
#[test]
fn the_picture_does_not_depend_on_the_length_of_the_list_of_surfaces() {
    if there(Choice::CPU.traced_by(BackendChoice::Cuda)).is_none() {
        return;
    }
    for name in ["SceneFinal", "glass/Caustics"] {
        let with_room = |room: Option<u64>| {
            let mut rays = CudaRays::new().expect("it was there before");
            room.into_iter().for_each(|room| rays.limit_surfaces(room));
            frame(name, Fidelity::Corrected, 0, Ok(Box::new(rays)))
        };
        let expected = with_room(None);
        for room in [1, 1000, 30_000] {
            let found = with_room(Some(room));
            assert!(found.0 == expected.0, "{name}: another picture with room for {room}");
            // Which points need no ray depends on the grouping of threads, so the sum is compared.
            let all = |rays: RayCounts| [rays.shadow, rays.reflected, rays.refracted, rays.occlusion + rays.certain];
            assert_eq!(all(found.1), all(expected.1), "{name}: other rays with room for {room}");
        }
    }
}

#[test]
fn more_gpus_than_there_are_are_refused_with_their_number() {
    if there(Choice::CPU.traced_by(BackendChoice::Cuda)).is_none() {
        return;
    }
    let error = ordinals("cuda", Some(255)).expect_err("nobody has so many");
    assert!(error.to_string().contains("255 GPUs were asked for, and there "), "{error}");
    let error = CudaRays::on(&[254]).expect_err("nobody has so many");
    assert!(error.to_string().contains("CUDA_ERROR_INVALID_DEVICE (101); there is no GPU of this number"), "{error}");
}
