//! Batches of samples that continue a sequence: accumulated pictures, and several samples a pixel.

use super::{project, there};
use curitiba::cuda::{CudaRays, OptixRays};
use curitiba::engines::ray_backend;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use curitiba::pipeline::backend::{Rasteriser, RayBackend};
use curitiba::pipeline::executor::{Engines, Goal, Renderer, Silent, StepKind};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::pixel_samples::PixelSamples;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::project;
use curitiba::{BackendChoice, Choice};

/// Projects that take samples, with the settings of the ray pass other than the number of samples.
const CASES: [(&str, &[&str]); 4] = [
    ("SceneSSAO", &[]),
    ("SceneShadows", &["pass2.sun=8"]),
    ("SceneFinal", &["pass2.intensity=1"]),
    ("SceneFinal", &["pass2.intensity=1", "pass2.sun=8"]),
];

/// Batches that add up to 64 samples. The second begins and ends between blocks of the sequence, and uses other kernels than the last.
const BATCHES: [u32; 4] = [7, 25, 28, 4];

fn renderer(
    raster: Box<dyn Rasteriser>,
    rays: Box<dyn RayBackend>,
    name: &str,
    set: &[&str],
    more: Settings,
) -> Renderer {
    let project = project::load(&project(name)).expect("the project loads");
    let settings = Settings {
        // The size is no multiple of any block or tile, and the camera is near the panes.
        size: Some([203, 149]),
        camera: Some("Vidro".to_owned()),
        set: set.iter().map(|one| (*one).to_owned()).collect(),
        ..more
    };
    let plan = Plan::new(project, settings).expect("the plan stands");
    Renderer::new(plan, Engines::new(raster, rays), &mut Silent).expect("ready")
}

fn on(choice: BackendChoice, name: &str, set: &[&str]) -> Renderer {
    let rays = ray_backend(Choice::CPU.traced_by(choice)).expect("it was there before");
    renderer(Box::new(CpuRasteriser::new()), rays, name, set, Settings::default())
}

/// The settings of a case, with the given number of samples for each kind of sample that it takes.
fn taking(name: &str, set: &[&str], samples: u32) -> Vec<String> {
    let of_occlusion = (name != "SceneShadows").then(|| format!("pass2.samples={samples}"));
    let of_disc = set.contains(&"pass2.sun=8").then(|| format!("pass2.sunsamples={samples}"));
    set.iter().map(|one| (*one).to_owned()).chain(of_occlusion).chain(of_disc).collect()
}

fn frame(renderer: &mut Renderer) -> Image {
    renderer.frame(&mut Silent).expect("rendered")
}

/// The accumulated picture of successive batches, and its error.
fn accumulated(renderer: &mut Renderer, batches: &[u32]) -> (Image, f64) {
    let mut accumulation = renderer.accumulation(&mut Silent).expect("it takes samples");
    for samples in batches {
        accumulation.add(renderer, *samples, &mut Silent).expect("a batch");
    }
    accumulation.show(renderer, &mut Silent).expect("the frame");
    assert_eq!(accumulation.samples(), u64::from(batches.iter().sum::<u32>()));
    (renderer.window_image(), accumulation.error())
}

fn largest(a: &Image, b: &Image) -> f32 {
    let pairs = a.pixels.iter().zip(&b.pixels);
    pairs
        .flat_map(|(a, b)| (0..4).map(|i| (a[i] - b[i]).abs()))
        .fold(0.0, |most, off| if off > most || off.is_nan() { off } else { most })
}

fn rms(a: &Image, b: &Image) -> f64 {
    let squares = a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)));
    (squares.sum::<f64>() / (3 * a.pixels.len()) as f64).sqrt()
}

fn rays_of(renderer: &Renderer) -> u64 {
    let rays = renderer.timeline().rows.iter().find_map(|row| row.rays).expect("rays were traced");
    rays.occlusion + rays.certain
}

fn accumulates(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    // Hits of OptiX differ in their last bits, and at edges they are other hits.
    let alike = if backend == BackendChoice::Cuda { 1e-6 } else { 1e-3 };
    for (name, set) in CASES {
        // With a disc and occlusion, each batch gives the product of two shares, and the mean of products is not the product of means.
        let product = name == "SceneFinal" && set.contains(&"pass2.sun=8");
        let rounding = if product { 0.02 } else { 16.0 * f32::EPSILON };
        let of = |choice, samples: u32| {
            let set = taking(name, set, samples);
            on(choice, name, &set.iter().map(String::as_str).collect::<Vec<_>>())
        };
        let (mut one, mut batches) = (of(backend, 64), of(backend, 100));
        let at_once = frame(&mut one);
        let (found, error) = accumulated(&mut batches, &BATCHES);
        let off = largest(&found, &at_once);
        assert!(off <= rounding, "{name} {set:?}: batches are off by {off}");
        assert_eq!(rays_of(&batches), rays_of(&one), "{name} {set:?}: other rays");
        // Batches whose size is a power of two each form a block of the sequence, so shares are not rounded.
        let sixteen = accumulated(&mut of(backend, 4), &[4; 16]).0;
        let off = largest(&sixteen, &at_once);
        assert!(off <= if name == "SceneFinal" { rounding } else { 0.0 }, "{name} {set:?}: sixteen are off by {off}");
        // The goal of the command chooses the batches.
        let mut goal = of(backend, 4);
        let accumulation = goal.accumulate(Goal::Samples(64), &mut Silent).expect("it takes samples");
        assert_eq!((accumulation.samples(), accumulation.passes()[0].estimate().batches()), (64, 16));
        assert!(goal.window_image().pixels == sixteen.pixels, "{name} {set:?}");
        // The same batches on the processor.
        let (expected, told) = accumulated(&mut of(BackendChoice::Cpu, 100), &BATCHES);
        let off = rms(&found, &expected);
        println!(
            "{name} {set:?} on {backend:?}: {off:.2e} from the processor, standard error {error:.5} and {told:.5}"
        );
        assert!(off <= alike, "{name} {set:?}: {off} from the processor");
        if backend == BackendChoice::Cuda && matches!(name, "SceneSSAO" | "SceneShadows") {
            assert!(found.pixels == expected.pixels, "{name} {set:?}: not every bit");
        }
        assert!(error > 1e-4 && (error - told).abs() <= 0.02 * told, "{name} {set:?}: {error} and {told}");
        // Control: the first batch alone is another picture.
        let first = accumulated(&mut of(backend, 100), &BATCHES[..1]).0;
        assert!(rms(&first, &at_once) > 1e-3, "{name} {set:?}: the first batch is the picture of all");
        // A frame after an accumulation equals one before it.
        assert!(frame(&mut batches).pixels == frame(&mut of(backend, 100)).pixels, "{name} {set:?}");
    }
}

#[test]
fn batches_on_our_own_tracer_are_all_samples_at_once_and_the_processors() {
    accumulates(BackendChoice::Cuda);
}

#[test]
fn batches_on_optix_are_all_samples_at_once_and_the_processors() {
    accumulates(BackendChoice::Optix);
}

/// Samples of a pixel continue the sequence, as on the processor.
fn pixels_have_several(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let of = |choice, seed| {
        let rays = ray_backend(Choice::CPU.traced_by(choice)).expect("it was there before");
        let more = Settings { aa: PixelSamples::new(4).expect("a valid number"), seed, ..Settings::default() };
        frame(&mut renderer(Box::new(CpuRasteriser::new()), rays, "SceneSSAO", &["pass2.samples=9"], more))
    };
    let (found, expected) = (of(backend, 0), of(BackendChoice::Cpu, 0));
    let off = rms(&found, &expected);
    assert!(off <= if backend == BackendChoice::Cuda { 0.0 } else { 3e-3 }, "{off}");
    assert!(rms(&of(backend, 1), &expected) > 1e-2, "the comparison sees other random numbers");
}

#[test]
fn samples_of_a_pixel_on_our_own_tracer_continue_the_processors_sequence() {
    pixels_have_several(BackendChoice::Cuda);
}

#[test]
fn samples_of_a_pixel_on_optix_continue_the_processors_sequence() {
    pixels_have_several(BackendChoice::Optix);
}

/// Batches on a G-buffer that the rays read in device memory, and batches on one GPU used as two.
fn batches_elsewhere<T: RayBackend + 'static>(backend: BackendChoice, gpus: impl Fn(&[usize]) -> T) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let set = ["pass2.samples=64"];
    let two = || {
        let rays = Box::new(gpus(&[0, 0]));
        renderer(Box::new(CpuRasteriser::new()), rays, "SceneSSAO", &set, Settings::default())
    };
    let expected = accumulated(&mut on(backend, "SceneSSAO", &set), &BATCHES).0;
    assert!(accumulated(&mut two(), &BATCHES).0.pixels == expected.pixels, "another picture on two GPUs");
    let drawn = || WgpuRasteriser::new(AdapterChoice::RealGpu);
    let shared = drawn().map(|raster| raster.shares().is_some_and(|device| gpus(&[0]).joins(device)));
    if !matches!(shared, Ok(true)) {
        let required = std::env::var_os("CURITIBA_REQUIRE_CUDA_TESTS").is_some_and(|value| value == "1");
        assert!(!required, "no G-buffer is shared: {shared:?}");
        println!("skipped: no G-buffer is shared: {shared:?}");
        return;
    }
    let joined = || {
        let raster = Box::new(drawn().expect("it was there before"));
        renderer(raster, Box::new(gpus(&[0])), "SceneSSAO", &set, Settings::default())
    };
    let (mut one, mut batches) = (joined(), joined());
    let at_once = frame(&mut one);
    let found = accumulated(&mut batches, &BATCHES).0;
    assert!(batches.timeline().rows.iter().any(|row| row.kind == StepKind::Join), "the G-buffer went through the host");
    let off = largest(&found, &at_once);
    assert!(off <= 16.0 * f32::EPSILON, "batches of a shared G-buffer are off by {off}");
}

#[test]
fn batches_on_our_own_tracer_go_with_a_shared_gbuffer_and_several_gpus() {
    batches_elsewhere(BackendChoice::Cuda, |set| CudaRays::on(set).expect("it was there before"));
}

#[test]
fn batches_on_optix_go_with_a_shared_gbuffer_and_several_gpus() {
    batches_elsewhere(BackendChoice::Optix, |set| OptixRays::on(set).expect("it was there before"));
}
