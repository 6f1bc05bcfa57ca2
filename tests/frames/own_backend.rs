//! Ray backends for single passes: `--set PASS.backend=NAME`.

use curitiba::passes::cpu::CpuRays;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use curitiba::pipeline::executor::{Engines, Progress, Renderer, Silent, Spare, StepKind};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, PlanError, Settings};
use curitiba::pipeline::programs::{Fidelity, RayProgram};
use curitiba::pipeline::project::SceneOptions;
use curitiba::pipeline::scene::RenderScene;
use curitiba::{BackendChoice, Choice, engines};
use std::cell::RefCell;
use std::path::Path;
use std::process::Command;
use std::rc::Rc;
use std::sync::Arc;

/// The calls in order, such as `cuda build` and `cuda run`.
type Calls = Rc<RefCell<Vec<String>>>;

/// The processor's backend under another name. If `lost` is set, its device is lost when it runs.
struct Fake {
    name: &'static str,
    lost: bool,
    calls: Calls,
    inner: CpuRays,
}

impl Fake {
    fn boxed(name: &'static str, lost: bool, calls: &Calls) -> Box<dyn RayBackend> {
        Box::new(Self { name, lost, calls: Rc::clone(calls), inner: CpuRays::new() })
    }
}

impl RayBackend for Fake {
    fn name(&self) -> &'static str {
        self.name
    }

    fn device(&self) -> String {
        "made up".to_owned()
    }

    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }

    fn supports_glass(
        &self,
        program: RayProgram,
        params: &curitiba::pipeline::programs::RayParams,
        dielectrics: &[curitiba::pipeline::glass::Dielectric],
    ) -> Result<(), BackendError> {
        self.inner.supports_glass(program, params, dielectrics)
    }

    fn sees_skies(&self) -> bool {
        self.inner.sees_skies()
    }

    fn traces_cones(&self) -> bool {
        self.inner.traces_cones()
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.calls.borrow_mut().push(format!("{} build", self.name));
        self.inner.build(scene, filtered)
    }

    fn bytes_per_triangle(&self) -> u64 {
        self.inner.bytes_per_triangle()
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        self.calls.borrow_mut().push(format!("{} run", self.name));
        if self.lost {
            output.pixels.fill([f32::NAN; 4]);
            return Err(BackendError::Device { backend: self.name, message: "the device was lost".to_owned() });
        }
        self.inner.run(job, output, progress)
    }
}

/// A red pane in front of a grey wall; `pass2` computes the glass, and `pass3` the occlusion.
const SCENE: &str = "mtllib s.mtl\nv -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
usemtl wall\nf 1 2 3 4\nusemtl pane\nf 5 6 7 8\n";
const MATERIALS: &str = "newmtl wall\nKd .6 .6 .6\nnewmtl pane\nKd .8 .1 .1\nd .3\nillum 4\nNi 1.5\n";

fn settings(set: &[&str]) -> Settings {
    let scene = SceneOptions { effects: Some("ao,glass".parse().expect("effects")), ..SceneOptions::default() };
    let set = set.iter().map(|set| (*set).to_owned()).collect();
    Settings { size: Some([24, 20]), scene, set, ..Settings::default() }
}

fn plan(folder: &Path, set: &[&str]) -> Result<Plan, PlanError> {
    std::fs::write(folder.join("s.obj"), SCENE).expect("written");
    std::fs::write(folder.join("s.mtl"), MATERIALS).expect("written");
    let settings = settings(set);
    let project = settings.open(&folder.join("s.obj")).unwrap_or_else(|_| panic!("the scene is read"));
    Plan::new(project, settings)
}

/// Engines with fake backends: `cpu` for all passes, others for single ones. `optix` is missing, and `cuda` is lost
/// when it runs.
fn fakes(calls: &Calls, fallback: bool) -> Engines {
    let spare = |name: &'static str| {
        let calls = Rc::clone(calls);
        Spare::new(name, move || Ok(Fake::boxed(name, false, &calls)))
    };
    let all = std::iter::once(spare("cpu")).chain(fallback.then(|| spare("spare")));
    let engines = Engines::first_of(Box::new(CpuRasteriser::new()), all).expect("made");
    let calls = Rc::clone(calls);
    engines.with_own(move |name| match name {
        "wgpu" => Ok(Fake::boxed("wgpu", false, &calls)),
        "cuda" => Ok(Fake::boxed("cuda", true, &calls)),
        _ => Err(BackendError::Device { backend: "optix", message: "there is no driver".to_owned() }),
    })
}

fn bits(picture: &Image) -> Vec<[u32; 4]> {
    picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn notes(renderer: &Renderer) -> Vec<String> {
    let rays = renderer.timeline().rows.iter().filter(|row| row.kind == StepKind::Rays);
    rays.map(|row| row.note.split(':').next().unwrap_or_default().to_owned()).collect()
}

#[test]
fn passes_run_on_the_backends_that_they_name_and_the_picture_is_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let (alone, calls) = (Calls::default(), Calls::default());
    let plain = plan(folder.path(), &[]).expect("planned");
    let mut plain = Renderer::new(plain, fakes(&alone, false), &mut Silent).expect("ready");
    let expected = bits(&plain.frame(&mut Silent).expect("rendered"));
    assert_eq!(*alone.borrow(), ["cpu build", "cpu run", "cpu run"]);

    let mixed = plan(folder.path(), &["pass3.backend=wgpu"]).expect("planned");
    let mut mixed = Renderer::new(mixed, fakes(&calls, false), &mut Silent).expect("ready");
    assert_eq!(bits(&mixed.frame(&mut Silent).expect("rendered")), expected);
    assert_eq!(*calls.borrow(), ["cpu build", "wgpu build", "cpu run", "wgpu run"]);
    let notes = notes(&mixed);
    assert!(notes[0].ends_with("on cpu") && notes[1].ends_with("on wgpu"), "{notes:?}");

    // A backend without a pass to trace builds nothing.
    calls.borrow_mut().clear();
    let all = plan(folder.path(), &["pass2.backend=wgpu", "pass3.backend=wgpu"]).expect("planned");
    let mut all = Renderer::new(all, fakes(&calls, false), &mut Silent).expect("ready");
    assert_eq!(bits(&all.frame(&mut Silent).expect("rendered")), expected);
    assert_eq!(*calls.borrow(), ["wgpu build", "wgpu run", "wgpu run"]);
}

#[test]
fn a_setter_gives_a_pass_another_backend_and_only_what_depends_on_it_runs_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let calls = Calls::default();
    let plan = plan(folder.path(), &[]).expect("planned");
    let mut renderer = Renderer::new(plan, fakes(&calls, false), &mut Silent).expect("ready");
    let expected = bits(&renderer.update(&mut Silent).expect("rendered"));
    calls.borrow_mut().clear();
    renderer.set_parameter("pass3", "backend", "wgpu").expect("set");
    assert_eq!(bits(&renderer.update(&mut Silent).expect("rendered")), expected);
    assert_eq!(renderer.passes_run().collect::<Vec<_>>(), ["pass3", "pass5"]);
    assert_eq!(*calls.borrow(), ["cpu build", "wgpu build", "wgpu run"]);
    // A missing backend is an error, and the renderer continues with the previous one.
    renderer.set_parameter("pass3", "backend", "optix").expect("it is known when the frame begins");
    let error = renderer.update(&mut Silent).expect_err("missing").to_string();
    assert_eq!(error, "pass `pass3`: optix: there is no driver");
    calls.borrow_mut().clear();
    assert_eq!(bits(&renderer.update(&mut Silent).expect("rendered")), expected);
    assert_eq!(renderer.engines().rays_of("pass3").name(), "wgpu");
    assert!(calls.borrow().is_empty(), "{calls:?}");
    renderer.set_parameter("pass3", "backend", "auto").expect("set");
    assert_eq!(bits(&renderer.update(&mut Silent).expect("rendered")), expected);
    assert_eq!(renderer.engines().rays_of("pass3").name(), "cpu");
}

#[test]
fn where_a_backend_of_one_pass_is_lost_another_takes_its_place_for_that_pass_if_it_may() {
    let folder = tempfile::tempdir().expect("a folder");
    let calls = Calls::default();
    let plain = plan(folder.path(), &[]).expect("planned");
    let mut plain = Renderer::new(plain, fakes(&calls, false), &mut Silent).expect("ready");
    let expected = bits(&plain.frame(&mut Silent).expect("rendered"));
    let lost = || plan(folder.path(), &["pass3.backend=cuda"]).expect("planned");
    let mut refused = Renderer::new(lost(), fakes(&calls, false), &mut Silent).expect("ready");
    let error = refused.frame(&mut Silent).expect_err("lost").to_string();
    assert_eq!(error, "pass `pass3` of frame 1: cuda: the device was lost");
    let mut replaced = Renderer::new(lost(), fakes(&calls, true), &mut Silent).expect("ready");
    assert_eq!(bits(&replaced.frame(&mut Silent).expect("rendered")), expected);
    let told: Vec<String> = replaced.fallbacks().iter().map(ToString::to_string).collect();
    let message = "cuda: the device was lost; cuda is not used again in this run, spare takes its place";
    assert_eq!(told, [format!("pass `pass3` of frame 1: {message}")]);
    let engines = replaced.engines();
    assert_eq!([engines.rays_of("pass2").name(), engines.rays_of("pass3").name()], ["cpu", "spare"]);
    calls.borrow_mut().clear();
    assert_eq!(bits(&replaced.frame(&mut Silent).expect("rendered")), expected);
    assert_eq!(*calls.borrow(), ["cpu run", "spare run"]);
}

#[test]
fn what_names_no_backend_of_a_pass_is_refused_with_what_is_valid() {
    let folder = tempfile::tempdir().expect("a folder");
    for (set, said, help) in [
        ("pass1.backend=cpu", "pass `pass1` traces no rays", "pass2"),
        ("pas2.backend=cpu", "there is no pass `pas2`", "pass2"),
        ("pass2.backend=cdua", "there is no ray backend `cdua`", "cuda"),
    ] {
        let error = plan(folder.path(), &[set]).expect_err(set).to_string();
        assert!(error.contains(said) && error.contains(help), "{error}");
    }
    let other = Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new()));
    let plan = plan(folder.path(), &["pass2.backend=wgpu"]).expect("planned");
    let error = Renderer::new(plan, other, &mut Silent).err().expect("nothing makes it").to_string();
    assert!(error.starts_with("pass `pass2`: ") && error.contains("without other ray backends"), "{error}");
    for backend in BackendChoice::ALL {
        assert!(Plan::new(plan_of(folder.path(), backend).0, plan_of(folder.path(), backend).1).is_ok());
    }
}

fn plan_of(folder: &Path, backend: BackendChoice) -> (curitiba::pipeline::project::Project, Settings) {
    let set = format!("pass2.backend={}", backend.name());
    let settings = settings(&[&set]);
    (settings.open(&folder.join("s.obj")).unwrap_or_else(|_| panic!("the scene is read")), settings)
}

#[test]
fn the_program_renders_passes_on_two_backends_and_check_asks_both() {
    let folder = tempfile::tempdir().expect("a folder");
    let _ = plan(folder.path(), &[]).expect("written");
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
        let output = command.current_dir(folder.path()).args(words).output().expect("it runs");
        let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        (output.status.code(), text)
    };
    let scene = ["s.obj", "--effects", "ao,glass", "--size", "24x20", "--raster", "cpu", "--backend", "cpu"];
    let set = ["--set", "pass3.backend=wgpu"];
    let (code, text) = run(&[&["check"], &scene[..], &["--set", "pass2.backend=cdua"]].concat());
    assert!(code == Some(2) && text.contains("there is no ray backend `cdua`"), "{text}");
    if let Err(error) = engines::ray_backend(Choice::CPU.traced_by(BackendChoice::Wgpu)) {
        assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
        println!("skipped: {error}");
        let (code, text) = run(&[&["render"], &scene[..], &set].concat());
        assert!(code == Some(1) && text.contains("pass `pass3`: wgpu"), "{text}");
        return;
    }
    let (code, text) = run(&[&["check"], &scene[..], &set].concat());
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = run(&[&["render"], &scene[..], &set, &["-o", "mixed.png"]].concat());
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("on cpu: ") && text.contains("ssao on wgpu: "), "{text}");
    let (code, text) = run(&[&["render"], &scene[..], &["-o", "cpu.png"]].concat());
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = run(&["compare", "cpu.png", "mixed.png", "--max-rmse", "0.002"]);
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn a_backend_whose_pass_is_switched_on_later_gets_its_structure() {
    let folder = tempfile::tempdir().expect("a folder");
    let calls = Calls::default();
    let Plan { declared, settings, .. } = plan(folder.path(), &["pass3.backend=wgpu"]).expect("planned");
    let off = Settings { off: vec!["pass3".to_owned()], ..settings };
    let plan = Plan::new(declared, off).expect("planned");
    let mut renderer = Renderer::new(plan, fakes(&calls, false), &mut Silent).expect("ready");
    renderer.frame(&mut Silent).expect("rendered");
    renderer.set_enabled("pass3", true).expect("set");
    renderer.frame(&mut Silent).expect("rendered");
    assert!(calls.borrow().iter().any(|call| call == "wgpu build"), "{calls:?}");
}
