//! Real faults of a GPU lead to a message that names the pass and what to do, and the process can continue.
//!
//! Without a GPU the tests print `skipped: why` and pass; with `CURITIBA_REQUIRE_CUDA_TESTS=1` they fail instead. The binary runs on any
//! machine: where it was not built, it looks for the projects in the current folder.
#![allow(unsafe_code, reason = "launches a kernel that fails on purpose")]

use cudarc::driver::{CudaContext, CudaSlice, LaunchConfig};
use cudarc::nvrtc::Ptx;
use curitiba_cuda::device::Device;
use curitiba_cuda::{CudaRays, OptixRays};
use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use curitiba_pipeline::executor::{Engines, Progress, Renderer, Silent, Spare};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::plan::{Plan, Settings};
use curitiba_pipeline::programs::{Fidelity, RayProgram};
use curitiba_pipeline::project;
use curitiba_pipeline::scene::RenderScene;
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, Mutex, PoisonError};

/// Environment variable that names the backend of [`loses_its_device`], which runs in a process of its own.
const LOSE: &str = "CURITIBA_TEST_LOSES";

/// Runs one test at a time: one of them takes all memory.
static GPU: Mutex<()> = Mutex::new(());

/// A kernel that traps at once.
const FAILS: &str = "\
.version 6.5
.target sm_75
.address_size 64
.visible .entry fails()
{
    trap;
    ret;
}
";

fn made(backend: &str) -> Result<Box<dyn RayBackend>, BackendError> {
    Ok(if backend == "cuda" { Box::new(CudaRays::new()?) } else { Box::new(OptixRays::new()?) })
}

/// The backend, or `None` if it is missing; the reason is printed.
fn there(backend: &str) -> Option<Box<dyn RayBackend>> {
    match made(backend) {
        Ok(rays) => Some(rays),
        Err(error) => {
            let required = std::env::var_os("CURITIBA_REQUIRE_CUDA_TESTS").is_some_and(|value| value == "1");
            assert!(!required, "{error}");
            println!("skipped: {error}");
            None
        }
    }
}

fn renderer(backends: Vec<Spare>) -> Renderer {
    let built = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let root = if built.is_dir() { built.as_path() } else { Path::new(".") };
    let project = project::load(&root.join("xml_projects/SceneShadows.xml")).expect("the project loads");
    let plan = Plan::new(project, Settings { size: Some([96, 64]), ..Settings::default() }).expect("the plan stands");
    let engines = Engines::first_of(Box::new(CpuRasteriser::new()), backends).expect("made");
    Renderer::new(plan, engines, &mut Silent).expect("ready")
}

fn cpu() -> Spare {
    Spare::new("cpu", || Ok(Box::new(CpuRays::new())))
}

fn bits(picture: &Image) -> Vec<[u32; 4]> {
    picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn expected() -> Vec<[u32; 4]> {
    bits(&renderer(vec![cpu()]).frame(&mut Silent).expect("rendered"))
}

/// Allocates all memory of a GPU, except for small pieces.
fn take_all(device: &Device) -> Vec<CudaSlice<u8>> {
    let (mut taken, mut piece) = (Vec::new(), device.context().mem_get_info().expect("memory is counted").0);
    while piece >= 1 << 16 {
        match device.stream().alloc_zeros(piece) {
            Ok(slice) => taken.push(slice),
            Err(_) => piece /= 2,
        }
    }
    taken
}

#[test]
fn full_memory_is_told_with_what_is_free_and_the_run_goes_on_with_the_cpu() {
    let _alone = GPU.lock().unwrap_or_else(PoisonError::into_inner);
    if there("cuda").is_none() {
        return;
    }
    let device = Device::first("cuda").expect("it was there before");
    let total = device.context().total_mem().expect("memory is counted");
    let error = device.stream().alloc_zeros::<u8>(4 * total).expect_err("no GPU holds four times its memory");
    let message = device.fault("making room", &error).to_string();
    assert!(message.starts_with("cuda: making room with ") && message.contains(" MiB free"), "{message}");
    assert!(message.contains("CUDA_ERROR_OUT_OF_MEMORY (2)") && message.contains("smaller scene"), "{message}");
    device.bind().expect("nothing was lost");

    let expected = expected();
    for backend in ["cuda", "optix"] {
        if there(backend).is_none() {
            continue;
        }
        let taken = take_all(&device);
        let spare = Spare::new(if backend == "cuda" { "cuda" } else { "optix" }, move || made(backend));
        let mut fallen = renderer(vec![spare, cpu()]);
        assert_eq!(bits(&fallen.frame(&mut Silent).expect("the cpu goes on")), expected, "{backend}");
        let fallback = fallen.fallbacks().first().expect("it is recorded");
        println!("{fallback}");
        assert_eq!((fallback.pass.as_deref(), fallback.instead.as_str()), (Some("pass2"), "cpu"));
        assert!(fallback.failed == backend, "{fallback}");
        if backend == "cuda" {
            assert!(fallback.why.contains("CUDA_ERROR_OUT_OF_MEMORY"), "{fallback}");
        }
        drop(taken);
        device.stream().synchronize().expect("released memory goes back to the driver");
        let mut again = renderer(vec![Spare::new("gpu", move || made(backend))]);
        again.frame(&mut Silent).expect("with free memory the GPU is of use again");
        assert!(again.fallbacks().is_empty());
    }
}

/// A backend that loses its device in the second run.
struct Sabotaged {
    inner: Box<dyn RayBackend>,
    runs: u32,
}

fn sabotage() {
    let context = CudaContext::new(0).expect("it was there before");
    let module = context.load_module(Ptx::from_src(FAILS)).expect("the kernel loads");
    let kernel = module.load_function("fails").expect("it is in there");
    let stream = context.default_stream();
    let config = LaunchConfig { grid_dim: (1, 1, 1), block_dim: (1, 1, 1), shared_mem_bytes: 0 };
    // SAFETY: the kernel takes no argument and touches no memory.
    unsafe { stream.launch_builder(&kernel).launch(config) }.expect("launches tell nothing yet");
    stream.synchronize().expect_err("the kernel fails");
}

impl RayBackend for Sabotaged {
    fn name(&self) -> &'static str {
        self.inner.name()
    }
    fn device(&self) -> String {
        self.inner.device()
    }
    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        self.inner.supports(program, fidelity)
    }
    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.inner.build(scene, filtered)
    }
    fn bytes_per_triangle(&self) -> u64 {
        self.inner.bytes_per_triangle()
    }
    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        self.runs += 1;
        if self.runs != 2 {
            return self.inner.run(job, output, progress);
        }
        sabotage();
        let first = self.inner.run(job, output, progress).expect_err("the device is lost");
        let second = self.inner.run(job, output, progress).expect_err("it stays lost");
        let built = self.inner.build(&Arc::new(RenderScene::default()), &[]).expect_err("for everything");
        for later in [second, built] {
            assert!(later.to_string().contains("the GPU was lost before ("), "{later}");
        }
        Err(first)
    }
}

#[test]
fn loses_its_device() {
    let Some(backend) = std::env::var_os(LOSE) else {
        println!("skipped: it is run by the test beside it, in a process of its own");
        return;
    };
    let backend = if backend == "cuda" { "cuda" } else { "optix" };
    let spare = Spare::new(backend, move || Ok(Box::new(Sabotaged { inner: made(backend)?, runs: 0 })));
    let mut renderer = renderer(vec![spare, cpu()]);
    renderer.frame(&mut Silent).expect("the first frame needs nobody else");
    assert!(renderer.fallbacks().is_empty());
    let picture = renderer.frame(&mut Silent).expect("the cpu goes on");
    assert_eq!(bits(&picture), expected());
    let fallback = renderer.fallbacks().first().expect("it is recorded");
    println!("{fallback}");
    assert_eq!((fallback.pass.as_deref(), fallback.frame, &*fallback.instead), (Some("pass2"), Some(2), "cpu"));
    assert!(fallback.why.starts_with(backend) && fallback.why.contains("lost to this program"), "{fallback}");
    renderer.frame(&mut Silent).expect("and goes on");
    assert_eq!(renderer.fallbacks().len(), 1);
    // Releasing the resources of a lost device must not panic either, and this process may end normally.
    drop(renderer);
    println!("ended in peace");
}

#[test]
fn a_lost_device_is_told_with_the_pass_and_the_run_goes_on_with_the_cpu() {
    let _alone = GPU.lock().unwrap_or_else(PoisonError::into_inner);
    for backend in ["cuda", "optix"] {
        if there(backend).is_none() {
            continue;
        }
        let mut child = Command::new(std::env::current_exe().expect("tests know their program"));
        child.args(["--exact", "loses_its_device", "--nocapture"]).env(LOSE, backend);
        let output = child.output().expect("it starts");
        let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        println!("{text}");
        assert!(output.status.success() && text.contains("ended in peace"), "{backend}: {text}");
    }
}
