//! Failing ray backends and their replacements: with backends that fail on purpose, and through the command line.

use curitiba::passes::cpu::CpuRays;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use curitiba::pipeline::executor::{Engines, Fallback, Observer, Progress, RenderError, Renderer, Spare, StepKind};
use curitiba::pipeline::glass::Dielectric;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba::pipeline::project;
use curitiba::pipeline::scene::RenderScene;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::rc::Rc;
use std::sync::Arc;

/// The calls in order, such as `cuda build` and `cuda run`.
type Calls = Rc<RefCell<Vec<String>>>;

/// Where a backend fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fails {
    Never,
    Build,
    /// In this run, counted from 1, and all later ones, after half of the picture.
    Run(u32),
    /// When it is asked for support: it says that it cannot run the job.
    Support,
}

/// The processor's backend under another name.
struct Fake {
    name: &'static str,
    fails: Fails,
    calls: Calls,
    runs: u32,
    inner: CpuRays,
}

impl Fake {
    fn error(&self, doing: &str) -> BackendError {
        BackendError::Device { backend: self.name, message: format!("{doing}: the device was lost") }
    }
}

impl RayBackend for Fake {
    fn name(&self) -> &'static str {
        self.name
    }

    fn device(&self) -> String {
        "made up".to_owned()
    }

    fn supports(&self, program: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        if self.fails == Fails::Support {
            let (what, why) = (program.info().stem.to_owned(), "it has no rays".to_owned());
            return Err(BackendError::Unsupported { backend: self.name, what, why });
        }
        Ok(())
    }

    fn supports_glass(&self, _: RayProgram, _: &RayParams, _: &[Dielectric]) -> Result<(), BackendError> {
        Ok(())
    }

    fn traces_sun_discs(&self) -> bool {
        self.name == "cpu"
    }

    fn shoots_photons(&self) -> bool {
        self.name == "cpu"
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.calls.borrow_mut().push(format!("{} build", self.name));
        if self.fails == Fails::Build { Err(self.error("building")) } else { self.inner.build(scene, filtered) }
    }

    fn bytes_per_triangle(&self) -> u64 {
        self.inner.bytes_per_triangle()
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        self.calls.borrow_mut().push(format!("{} run", self.name));
        self.runs += 1;
        if let Fails::Run(first) = self.fails
            && self.runs >= first
        {
            let half = output.pixels.len() / 2;
            output.pixels[..half].fill([f32::NAN; 4]);
            return Err(self.error("running"));
        }
        self.inner.run(job, output, progress)
    }
}

/// Records the fallbacks that it is notified of.
#[derive(Default)]
struct Ears(Vec<Fallback>);

impl Observer for Ears {
    fn begin(&mut self, _: StepKind, _: &str, _: &Arc<Progress>) {}
    fn end(&mut self) {}
    fn fell_back(&mut self, fallback: &Fallback) {
        self.0.push(fallback.clone());
    }
}

fn spare(name: &'static str, fails: Fails, calls: &Calls) -> Spare {
    let calls = Rc::clone(calls);
    Spare::new(name, move || Ok(Box::new(Fake { name, fails, calls, runs: 0, inner: CpuRays::new() })))
}

fn missing(name: &'static str) -> Spare {
    Spare::new(name, move || Err(BackendError::Device { backend: name, message: "there is no driver".to_owned() }))
}

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn plan(project: &str) -> Plan {
    let project = project::load(&root(&format!("xml_projects/{project}.xml"))).expect("the project loads");
    Plan::new(project, Settings { size: Some([32, 24]), ..Settings::default() }).expect("the plan stands")
}

fn renderer(backends: Vec<Spare>, ears: &mut Ears) -> Result<Renderer, RenderError> {
    let engines = Engines::first_of(Box::new(CpuRasteriser::new()), backends).expect("one can be made");
    Renderer::new(plan("SceneShadows"), engines, ears)
}

fn bits(picture: &Image) -> Vec<[u32; 4]> {
    picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn expected() -> Vec<[u32; 4]> {
    let calls = Calls::default();
    let mut renderer = renderer(vec![spare("cpu", Fails::Never, &calls)], &mut Ears::default()).expect("ready");
    bits(&renderer.frame(&mut Ears::default()).expect("rendered"))
}

fn fallback(frame: Option<u32>, failed: &str, why: &str, instead: &str) -> Fallback {
    let [failed, why, instead] = [failed, why, instead].map(str::to_owned);
    Fallback { pass: Some("pass2".to_owned()), frame, failed, why, instead }
}

#[test]
fn a_backend_that_cannot_be_made_is_replaced_and_the_pass_that_missed_it_is_named() {
    let (calls, mut ears) = (Calls::default(), Ears::default());
    let backends = vec![missing("optix"), missing("cuda"), spare("cpu", Fails::Never, &calls)];
    let mut renderer = renderer(backends, &mut ears).expect("the cpu stands in");
    let why = |name: &str| format!("{name}: there is no driver");
    let told = [fallback(None, "optix", &why("optix"), "cuda"), fallback(None, "cuda", &why("cuda"), "cpu")];
    assert_eq!(ears.0, told);
    assert_eq!(renderer.fallbacks(), told);
    assert_eq!(
        told[1].to_string(),
        "pass `pass2`: cuda: there is no driver; cuda is not used again in this run, cpu takes its place"
    );
    assert_eq!(bits(&renderer.frame(&mut ears).expect("rendered")), expected());
    let none = Engines::first_of(Box::new(CpuRasteriser::new()), [missing("optix"), missing("cuda")]);
    assert_eq!(none.err().map(|error| error.to_string()), Some("cuda: there is no driver".to_owned()));
}

#[test]
fn a_backend_that_cannot_build_or_does_not_run_the_program_is_replaced_before_the_first_frame() {
    for (fails, why, called) in [
        (Fails::Build, "cuda: building: the device was lost", &["cuda build", "cpu build", "cpu run"][..]),
        (Fails::Support, "cuda cannot run deferredShadows: it has no rays", &["cpu build", "cpu run"][..]),
    ] {
        let (calls, mut ears) = (Calls::default(), Ears::default());
        let backends = vec![spare("cuda", fails, &calls), spare("cpu", Fails::Never, &calls)];
        let mut renderer = renderer(backends, &mut ears).expect("the cpu stands in");
        assert_eq!(bits(&renderer.frame(&mut ears).expect("rendered")), expected());
        assert_eq!(ears.0, [fallback(None, "cuda", why, "cpu")]);
        assert_eq!(*calls.borrow(), called);
    }
}

#[test]
fn a_backend_that_knows_a_point_of_light_alone_is_replaced_for_a_disc() {
    let soft = |fidelity, backends: Vec<Spare>, ears: &mut Ears| {
        let project = project::load(&root("xml_projects/SceneShadows.xml")).expect("the project loads");
        let set = vec!["pass2.sun=4".to_owned(), "pass2.sunsamples=4".to_owned()];
        let settings = Settings { size: Some([32, 24]), fidelity, set, ..Settings::default() };
        let plan = Plan::new(project, settings).expect("the plan stands");
        Renderer::new(plan, Engines::first_of(Box::new(CpuRasteriser::new()), backends).expect("one can be made"), ears)
    };
    let (calls, mut ears) = (Calls::default(), Ears::default());
    let backends = vec![spare("cuda", Fails::Never, &calls), spare("cpu", Fails::Never, &calls)];
    let mut found = soft(Fidelity::Corrected, backends, &mut ears).expect("the cpu stands in");
    assert_ne!(bits(&found.frame(&mut ears).expect("rendered")), expected(), "the shadows are soft");
    assert_eq!(*calls.borrow(), ["cpu build", "cpu run"]);
    let why = "cuda cannot run deferredShadows with sun=4: its programs know a light that is a point; use --backend cpu, or allow it \
               with --fallback cpu, or set sun=0 on the pass";
    assert_eq!(ears.0, [fallback(None, "cuda", why, "cpu")]);
    let alone = vec![spare("cuda", Fails::Never, &calls)];
    let error = soft(Fidelity::Corrected, alone, &mut Ears::default()).err().expect("refused");
    assert_eq!(error.to_string(), format!("pass `pass2`: {why}"));
    // Thesis fidelity has no disc: the plan says so, and the pass runs.
    let mut ears = Ears::default();
    let thesis = soft(Fidelity::Thesis, vec![spare("cuda", Fails::Never, &calls)], &mut ears).expect("ready");
    assert!(ears.0.is_empty());
    assert!(thesis.plan().decisions.iter().any(|decision| format!("{decision:?}").contains("the light is a point")));
}

#[test]
fn a_backend_that_shows_no_light_of_photons_is_replaced_where_there_are_meshes_to_shoot_at() {
    let open = |project: &str, set: &[&str], backends: Vec<Spare>, ears: &mut Ears| {
        let project = project::load(&root(&format!("xml_projects/glass/{project}.xml"))).expect("the project loads");
        let set = set.iter().map(|one| format!("pass2.{one}")).collect();
        let plan = Plan::new(project, Settings { size: Some([8, 8]), set, ..Settings::default() });
        let engines = Engines::first_of(Box::new(CpuRasteriser::new()), backends).expect("one can be made");
        Renderer::new(plan.expect("the plan stands"), engines, ears)
    };
    let calls = Calls::default();
    let cuda = || vec![spare("cuda", Fails::Never, &calls)];
    let asked = ["sun=0", "photons=500", "texturelod=zero"];
    let refused = open("MeshCaustics", &asked, cuda(), &mut Ears::default()).err().expect("it has photons").to_string();
    for words in ["pass `pass2`: cuda cannot run", "photons=500", "material `", "set photons=0"] {
        assert!(refused.contains(words), "{refused}");
    }
    let mut ears = Ears::default();
    let both = cuda().into_iter().chain([spare("cpu", Fails::Never, &calls)]).collect();
    open("MeshCaustics", &asked, both, &mut ears).expect("the cpu stands in");
    assert_eq!(ears.0.iter().map(|told| (&*told.failed, &*told.instead)).collect::<Vec<_>>(), [("cuda", "cpu")]);
    let straight = ["sun=0", "photons=0", "texturelod=zero"];
    assert!(open("MeshCaustics", &straight, cuda(), &mut Ears::default()).is_ok(), "light goes straight on");
}

#[test]
fn a_backend_that_is_lost_in_a_frame_is_replaced_within_it_and_never_used_again() {
    let (calls, mut ears) = (Calls::default(), Ears::default());
    // The backend is named twice and tried once.
    let backends = vec![
        spare("cuda", Fails::Run(3), &calls),
        spare("cuda", Fails::Never, &calls),
        spare("cpu", Fails::Never, &calls),
    ];
    let mut renderer = renderer(backends, &mut ears).expect("ready");
    let expected = expected();
    for _ in 0..4 {
        assert_eq!(bits(&renderer.frame(&mut ears).expect("rendered")), expected);
    }
    assert_eq!(ears.0, [fallback(Some(3), "cuda", "cuda: running: the device was lost", "cpu")]);
    let runs = ["cuda build", "cuda run", "cuda run", "cuda run", "cpu build", "cpu run", "cpu run"];
    assert_eq!(*calls.borrow(), runs);
    assert_eq!(renderer.engines().rays.name(), "cpu");
    let rows = &renderer.timeline().rows;
    let rays = rows.iter().find(|row| row.kind == StepKind::Rays).expect("a row");
    assert_eq!(rays.host_ms.len(), 4, "no time of the failed run");
    assert!(rays.note.contains("on cpu") && rays.note.contains("before frame 3 on cuda"), "{}", rays.note);
    let builds: Vec<&str> = rows.iter().filter(|row| row.kind == StepKind::Build).map(|row| &*row.name).collect();
    assert_eq!(builds, ["cuda", "cpu"]);
}

#[test]
fn without_permission_the_failure_ends_the_run_and_names_pass_and_frame() {
    let (calls, mut ears) = (Calls::default(), Ears::default());
    let mut lost = renderer(vec![spare("cuda", Fails::Run(2), &calls)], &mut ears).expect("ready");
    let first = bits(&lost.frame(&mut ears).expect("rendered"));
    let error = lost.frame(&mut ears).expect_err("lost");
    assert_eq!(error.to_string(), "pass `pass2` of frame 2: cuda: running: the device was lost");
    assert_eq!(bits(&lost.window_image()), first, "what was rendered before stays");
    let error = renderer(vec![spare("cuda", Fails::Build, &calls)], &mut ears).err().expect("lost");
    assert_eq!(error.to_string(), "pass `pass2`: cuda: building: the device was lost");
    assert!(ears.0.is_empty() && !calls.borrow().iter().any(|call| call.starts_with("cpu")));
}

#[test]
fn where_those_that_stand_in_fail_too_the_last_failure_ends_the_run() {
    let (calls, mut ears) = (Calls::default(), Ears::default());
    let backends = vec![spare("cuda", Fails::Run(1), &calls), missing("optix"), spare("cpu", Fails::Build, &calls)];
    let mut renderer = renderer(backends, &mut ears).expect("ready");
    let error = renderer.frame(&mut ears).expect_err("all failed");
    assert_eq!(error.to_string(), "pass `pass2` of frame 1: cpu: building: the device was lost");
    let first = fallback(Some(1), "cuda", "cuda: running: the device was lost", "optix");
    assert_eq!(ears.0, [first, fallback(Some(1), "optix", "optix: there is no driver", "cpu")]);
    // A second frame finds no backend left, and says so.
    let again = renderer.frame(&mut ears).expect_err("nothing is left");
    assert!(again.to_string().starts_with("pass `pass2` of frame 2: cpu: "), "{again}");
}

/// Runs the program with the machine's GPUs hidden.
fn curitiba(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.env("CUDA_VISIBLE_DEVICES", "-1").env_remove("CURITIBA_GPUS").env("NO_COLOR", "1");
    command.current_dir(folder).args(arguments).output().expect("the program starts")
}

#[test]
fn render_falls_back_only_where_it_may_and_says_so_on_the_terminal_and_in_the_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let project = root("xml_projects/SceneShadows.xml");
    let project = project.to_str().expect("a path in UTF-8");
    let common = ["render", project, "--size", "32x24", "--raster", "cpu", "--backend"];
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    for backend in ["cuda", "optix"] {
        let refused = curitiba(folder.path(), &[&common[..], &[backend, "-o", "none.png"]].concat());
        let message = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(1), "{message}");
        let begin = format!("error: pass `pass2`: {backend}: ");
        assert!(message.contains(&begin) && message.contains("`--fallback cpu` goes on with the cpu"), "{message}");
        assert!(!folder.path().join("none.png").exists());

        let allowed = ["--fallback", "cuda,cpu", "--json", "-o", "fallen.png"];
        let fallen = curitiba(folder.path(), &[&common[..], &[backend], &allowed[..]].concat());
        let warning = text(&fallen.stderr);
        assert!(fallen.status.success(), "{warning}");
        assert!(warning.contains(&format!("warning: pass `pass2`: {backend}: ")), "{warning}");
        assert!(warning.contains("cpu takes its place"), "{warning}");
        let report: serde_json::Value = serde_json::from_slice(&fallen.stdout).expect("JSON alone");
        let fallbacks = report["fallbacks"].as_array().expect("a list");
        assert_eq!(fallbacks[0]["failed"], backend);
        assert_eq!(fallbacks.last().map(|last| last["instead"].clone()), Some("cpu".into()));
        assert_eq!(report["rays"]["name"], "cpu");
        assert_eq!(report["environment"]["fallbacks"].as_array().map(Vec::len), Some(fallbacks.len()));
    }
    let plain = curitiba(folder.path(), &[&common[..], &["cpu", "-o", "plain.png"]].concat());
    assert!(plain.status.success() && plain.stderr.is_empty(), "{}", text(&plain.stderr));
    let read = |name: &str| std::fs::read(folder.path().join(name)).expect("a picture");
    assert_eq!(read("plain.png"), read("fallen.png"));
    let wrong = curitiba(folder.path(), &[&common[..], &["cpu", "--fallback", "auto"]].concat());
    assert_eq!(wrong.status.code(), Some(2), "auto is no backend to fall back to");
}

#[test]
fn the_fastest_backend_is_measured_once_and_then_known() {
    let folder = tempfile::tempdir().expect("a folder");
    let cache = folder.path().join("cache");
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/SceneShadows.xml");
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
        let command = command.current_dir(folder.path()).arg(words[0]).arg(&project).args(&words[1..]);
        let output = command.env("CURITIBA_CACHE", &cache).output().expect("the program starts");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let rendered = ["render", "--size", "64x64", "--backend", "fastest", "-o", "picture.png"];
    let (code, rows, told) = run(&rendered);
    assert_eq!(code, Some(0), "{told}");
    assert!(told.contains("backend fastest: ") && told.contains("measured now, and kept"), "{told}");
    let chosen = told.split("backend fastest: ").nth(1).and_then(|rest| rest.split(' ').next()).expect("a name");
    assert!(rows.contains(&format!("deferredShadows on {chosen}")), "{rows}");
    // For each backend that is not available, the reason is printed.
    let there =
        told.lines().find(|line| line.starts_with("backend fastest: ")).map_or(0, |line| line.matches(" ms").count());
    assert_eq!(there + told.matches("\n       not ").count(), curitiba::BackendChoice::ALL.len(), "{told}");
    let (code, _, told) = run(&rendered);
    assert_eq!(code, Some(0), "{told}");
    assert!(told.contains("measured before: ") && told.contains("fastest.json"), "{told}");
    // The record is not listed as a file of the project, and the row names the chosen backend.
    let (code, listed, told) = run(&["check", "--backend", "fastest"]);
    assert_eq!(code, Some(0), "{told}");
    assert!(!listed.contains("fastest.json"), "{listed}");
    let (code, listed, _) = run(&["bench", "--backend", "fastest", "--list", "--no-error"]);
    assert_eq!(code, Some(0));
    assert!(listed.contains(&format!("--backend {chosen}")) && !listed.contains("fastest"), "{listed}");
    let (code, _, told) = run(&["visibility", "--backend", "fastest", "-o", "rows.csv"]);
    assert_eq!(code, Some(2));
    assert!(told.contains("valid here: auto, cpu"), "{told}");
}
