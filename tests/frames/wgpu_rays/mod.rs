//! Tests of the ray backend `wgpu`: it computes what the processor's does (the conformance matrix), refuses what it cannot do, and shares a device with
//! the rasteriser.
//!
//! Without an adapter these tests print `skipped: why` and pass; with `CURITIBA_REQUIRE_GPU_TESTS=1` they fail instead.

mod in_place;

use crate::lamps::add_lamps;
use curitiba::conformance::{Beside, Found, Record, compare};
use curitiba::engines::ray_backend;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::raster::gpu::{AdapterKind, adapters};
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use curitiba::pipeline::color::ColorSpace;
use curitiba::pipeline::executor::{Engines, Progress, Renderer, Silent, StepKind};
use curitiba::pipeline::glass::Dielectric;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba::pipeline::project::{self, Project};
use curitiba::pipeline::scene::RenderScene;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;
use std::sync::{Arc, Mutex};

/// Pixels along a side; software drivers take a second for each picture of 128 pixels.
const SIDE: u32 = 64;
/// A small number of occlusion samples.
const OCCLUSION: &[&str] = &["samples=9"];

fn is_there() -> bool {
    match ray_backend(Choice::CPU.traced_by(BackendChoice::Wgpu)) {
        Ok(_) => true,
        Err(error) => {
            let required = std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_some_and(|value| value == "1");
            assert!(!required, "{error}");
            println!("skipped: {error}");
            false
        }
    }
}

/// One backend for many renderers, one after the other. With software drivers, most of these tests' time is the
/// compilation of programs, and a backend keeps its compiled programs.
#[derive(Clone)]
struct Lent(Rc<RefCell<Box<dyn RayBackend>>>);

impl Lent {
    fn wgpu() -> Self {
        let backend = ray_backend(Choice::CPU.traced_by(BackendChoice::Wgpu)).expect("it was there before");
        Self(Rc::new(RefCell::new(backend)))
    }
}

impl RayBackend for Lent {
    fn name(&self) -> &'static str {
        self.0.borrow().name()
    }

    fn device(&self) -> String {
        self.0.borrow().device()
    }

    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        self.0.borrow().supports(program, fidelity)
    }

    fn supports_glass(
        &self,
        program: RayProgram,
        params: &RayParams,
        dielectrics: &[Dielectric],
    ) -> Result<(), BackendError> {
        self.0.borrow().supports_glass(program, params, dielectrics)
    }

    fn traces_spheres(&self) -> bool {
        self.0.borrow().traces_spheres()
    }

    fn shoots_photons(&self) -> bool {
        self.0.borrow().shoots_photons()
    }

    fn traces_cones(&self) -> bool {
        self.0.borrow().traces_cones()
    }

    fn traces_sun_discs(&self) -> bool {
        self.0.borrow().traces_sun_discs()
    }

    fn knows_lights(&self) -> bool {
        self.0.borrow().knows_lights()
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.0.borrow_mut().build(scene, filtered)
    }

    fn bytes_per_triangle(&self) -> u64 {
        self.0.borrow().bytes_per_triangle()
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        self.0.borrow_mut().run(job, output, progress)
    }
}

/// Runs a project's ray pass on the processor and on `wgpu`, in the project's colours.
fn record(lent: &Lent, name: &str, camera: &str, fidelity: Fidelity, set: &[&str], found: &Arc<Mutex<Found>>) {
    record_in(None, lent, name, camera, fidelity, set, found);
}

/// As [`record`], in another colour space.
fn record_in(
    color: Option<ColorSpace>,
    lent: &Lent,
    name: &str,
    camera: &str,
    fidelity: Fidelity,
    set: &[&str],
    found: &Arc<Mutex<Found>>,
) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("xml_projects/{name}.xml"));
    let project = project::load(&path).expect("the project loads");
    record_of(project, color, lent, name, camera, fidelity, set, found);
}

/// As [`record_in`], for a loaded project.
#[expect(clippy::too_many_arguments, reason = "each test names all of them")]
fn record_of(
    project: Project,
    color: Option<ColorSpace>,
    lent: &Lent,
    name: &str,
    camera: &str,
    fidelity: Fidelity,
    set: &[&str],
    found: &Arc<Mutex<Found>>,
) {
    let settings = Settings {
        camera: Some(camera.to_owned()),
        size: Some([SIDE, SIDE]),
        fidelity,
        color,
        set: set.iter().map(|one| format!("pass2.{one}")).collect(),
        ..Settings::default()
    };
    let beside = Beside {
        cpu: ray_backend(Choice::CPU).expect("always there"),
        others: vec![Box::new(lent.clone())],
        found: Arc::clone(found),
        project: name.to_owned(),
        camera: Some(camera.to_owned()),
        runs: 2,
        compare: true,
    };
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(beside));
    let plan = Plan::new(project, settings).expect("the plan stands");
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("ready");
    renderer.frame(&mut Silent).expect("rendered");
}

fn check(record: &Record, nothing_fuses: bool) {
    let words = record.in_words();
    println!("{words}");
    assert!(record.within_limits, "farther off than it may be: {words}");
    let compared = record.comparison.as_ref().expect("compared");
    if record.program == "dummy" || nothing_fuses && record.program == "deferredShadows" {
        assert_eq!(compared.identical, compared.pixels, "not every bit: {words}");
    }
    // Rays that the processor finds unnecessary may be traced on the device; the sum is the same.
    let (mine, theirs) = (record.rays, record.cpu_rays.expect("the processor ran"));
    if record.program != "final" && record.program != "refraction" {
        // In thesis fidelity, the last bit may decide whether the report's noise gives a direction of numbers or NaN. Chains of
        // mirrors depend on the last bit in the same way.
        let few = if record.fidelity == "thesis" { theirs.total() / 1000 } else { 0 };
        assert!((mine.occlusion + mine.certain).abs_diff(theirs.occlusion + theirs.certain) <= few, "{words}");
        assert!(mine.shadow == theirs.shadow && mine.reflected.abs_diff(theirs.reflected) <= few, "{words}");
    }
}

/// All programs in one fidelity, from both views. The fidelities share no device program, so each has a test of its
/// own; a software driver compiles the two in parallel.
fn matrix(lent: &Lent, fidelity: Fidelity, found: &Arc<Mutex<Found>>) {
    for camera in ["MainCamera", "Vidro"] {
        for name in ["SceneDummy", "SceneShadows", "SceneReflect", "SceneRefract"] {
            record(lent, name, camera, fidelity, &[], found);
        }
        for name in ["SceneSSAO", "SceneFinal"] {
            record(lent, name, camera, fidelity, OCCLUSION, found);
        }
    }
}

/// Checks all records; `count` is their expected number.
fn check_all(found: &Mutex<Found>, count: usize) {
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), count, "a pass of the matrix did not run");
    // The known software driver does not fuse multiplications and additions.
    let nothing_fuses = adapters().first().is_some_and(|adapter| adapter.kind == AdapterKind::Software);
    found.records.iter().for_each(|record| check(record, nothing_fuses));
}

#[test]
fn every_corrected_program_computes_what_the_processor_does() {
    if !is_there() {
        return;
    }
    let (lent, found) = (&Lent::wgpu(), Arc::default());
    matrix(lent, Fidelity::Corrected, &found);
    for camera in ["MainCamera", "Vidro"] {
        record(lent, "SceneRefract", camera, Fidelity::Corrected, &["fresnel=schlick"], &found);
        record(lent, "SceneSSAO", camera, Fidelity::Corrected, &["sampler=strata", "samples=4"], &found);
        // The panes show textured surfaces, so texels are decoded.
        let linear = Some(ColorSpace::Linear);
        record_in(linear, lent, "SceneReflect", camera, Fidelity::Corrected, &[], &found);
        record_in(linear, lent, "SceneFinal", camera, Fidelity::Corrected, OCCLUSION, &found);
        let cones = &["texturelod=cones"];
        record_in(linear, lent, "SceneReflect", camera, Fidelity::Corrected, cones, &found);
        record(lent, "SceneRefract", camera, Fidelity::Corrected, cones, &found);
    }
    check_all(&found, 2 * (6 + 2 + 2 + 2));
}

#[test]
fn every_program_of_the_report_computes_what_the_processor_does() {
    if !is_there() {
        return;
    }
    let found = Arc::default();
    matrix(&Lent::wgpu(), Fidelity::Thesis, &found);
    check_all(&found, 2 * 6);
}

/// The sun with a point light and two spot lights.
#[test]
fn several_lights_are_the_processors() {
    if !is_there() {
        return;
    }
    let (lent, found) = (&Lent::wgpu(), Arc::default());
    for (name, camera) in [("SceneShadows", "MainCamera"), ("SceneShadows", "Vidro"), ("SceneReflect", "Vidro")] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("xml_projects/{name}.xml"));
        let mut project = project::load(&path).expect("the project loads");
        add_lamps(&mut project, camera);
        record_of(project, None, lent, name, camera, Fidelity::Corrected, &[], &found);
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 3, "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words} {:?} {:?}", record.rays, record.cpu_rays);
        assert!(record.within_limits, "farther off than it may be: {words}");
        let (mine, theirs) = (record.rays, record.cpu_rays.expect("the processor ran"));
        let pixels = u64::from(SIDE * SIDE);
        assert!(record.program == "reflection" || theirs.shadow > pixels, "a light throws no shadows: {words}");
        assert!(mine.shadow.abs_diff(theirs.shadow) <= theirs.shadow / 500, "{words}");
    }
}

/// Glass as each material says, in front of a background: balls of several kinds, a filled drinking glass with a bubble, panes, and exact
/// spheres, alone and nested.
#[test]
fn glass_as_each_material_says_is_the_processors() {
    if !is_there() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    // Software drivers abort long loops, so on them the backend refuses glass of greater depth
    // (`deep_glass_is_whole_or_refused`).
    let is_software = adapters().first().is_some_and(|adapter| adapter.kind == AdapterKind::Software);
    let set: &[&str] = if is_software { &["samples=9", "depth=2"] } else { &["samples=9"] };
    let lent = &Lent::wgpu();
    for name in ["glass/balls", "glass/filled", "glass/panes", "glass/Spheres", "glass/Shells"] {
        record(lent, name, "MainCamera", Fidelity::Corrected, set, &found);
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 5, "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        assert!(record.rays.refracted > 1000, "no glass is seen: {words}");
    }
}

/// Light that exact spheres focus, seen directly and through glass.
#[test]
fn caustics_of_exact_spheres_are_the_processors() {
    if !is_there() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    let is_software = adapters().first().is_some_and(|adapter| adapter.kind == AdapterKind::Software);
    let set: &[&str] = if is_software { &["samples=9", "sunsamples=4", "depth=2"] } else { &["samples=9"] };
    let lent = &Lent::wgpu();
    record(lent, "glass/Caustics", "MainCamera", Fidelity::Corrected, set, &found);
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 1, "a pass did not run");
    let record = &found.records[0];
    let words = record.in_words();
    println!("{words} {:?} {:?}", record.rays, record.cpu_rays);
    assert!(record.within_limits, "farther off than it may be: {words}");
    let (mine, theirs) = (record.rays, record.cpu_rays.expect("the processor ran"));
    assert!(mine.shadow.abs_diff(theirs.shadow) <= theirs.shadow / 100, "{words}");
    // Control: without focused light, a pixel would have little more than a ray to each point of the disc.
    assert!(theirs.shadow > 5 * u64::from(SIDE * SIDE), "{theirs:?}");
}

/// Light that meshes focus, which photons bring: the processor shoots them, and the device finds those near each point.
#[test]
fn caustics_of_meshes_are_the_processors() {
    if !is_there() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    let is_software = adapters().first().is_some_and(|adapter| adapter.kind == AdapterKind::Software);
    let few: &[&str] = &["photons=50000", "samples=9", "sunsamples=4", "wavelengths=1"];
    let set = if is_software { [few, &["depth=2"]].concat() } else { few.to_vec() };
    record(&Lent::wgpu(), "glass/MeshCaustics", "MainCamera", Fidelity::Corrected, &set, &found);
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 1, "a pass did not run");
    let record = &found.records[0];
    let words = record.in_words();
    println!("{words} {:?} {:?}", record.rays, record.cpu_rays);
    assert!(record.within_limits, "farther off than it may be: {words}");
    let (mine, theirs) = (record.rays, record.cpu_rays.expect("the processor ran"));
    assert!(mine.photons == theirs.photons && mine.photons.landed > 10_000, "{words}");
    assert!(mine.shadow.abs_diff(theirs.shadow) <= theirs.shadow / 100, "{words}");
}

/// A driver that aborts long loops would darken glass without any error.
#[test]
fn deep_glass_is_whole_or_refused() {
    if !is_there() {
        return;
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/glass/filled.xml");
    let picture = |backend| {
        let settings =
            Settings { size: Some([SIDE, SIDE]), set: vec!["pass2.samples=1".into()], ..Settings::default() };
        let choice = Choice { backend, ..Choice::CPU };
        let mut renderer = curitiba::open(&path, settings, choice, &mut Silent)?;
        Ok::<_, curitiba::OpenError>(renderer.frame(&mut Silent)?.pixels)
    };
    let expected = picture(BackendChoice::Cpu).expect("the processor renders it");
    match picture(BackendChoice::Wgpu) {
        Ok(found) => {
            let compared = compare(&expected, &found);
            assert!(compared.above_1e_2 * 500 <= compared.pixels, "{compared:?}");
        }
        Err(refused) => {
            let words = refused.to_string();
            assert!(words.contains("bodies of glass to depth 5") && words.contains("depth=2"), "{words}");
        }
    }
}

/// The steps of a frame: kind, note and median milliseconds.
type Steps = Vec<(StepKind, String, f64)>;

/// A frame's picture and its steps.
fn frame(choice: Choice) -> (Vec<[f32; 4]>, Steps) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/SceneShadows.xml");
    let settings = Settings { size: Some([96, 64]), ..Settings::default() };
    let mut renderer = curitiba::open(path, settings, choice, &mut Silent).expect("opened");
    // The second frame draws over the first one's attachments.
    renderer.frame(&mut Silent).expect("rendered");
    let picture = renderer.frame(&mut Silent).expect("rendered");
    let row = |row: &curitiba::pipeline::executor::Row| (row.kind, row.note.clone(), row.median_ms());
    (picture.pixels, renderer.timeline().rows.iter().map(row).collect())
}

#[test]
fn raster_and_rays_on_one_device_copy_nothing_and_show_the_same() {
    if !is_there() {
        return;
    }
    let together = Choice { raster: RasterChoice::Wgpu, backend: BackendChoice::Wgpu, ..Choice::CPU };
    let (picture, rows) = frame(together);
    let (expected, apart) = frame(together.traced_by(BackendChoice::Cpu));
    assert!(expected.iter().any(|pixel| *pixel != expected[0]), "something is seen");
    let differing = picture.iter().zip(&expected).filter(|(a, b)| a != b).count();
    assert!(differing * 500 <= picture.len(), "{differing} pixels differ");
    let of = |rows: &[(StepKind, String, f64)], kind: StepKind| -> Vec<f64> {
        rows.iter().filter(|(own, ..)| *own == kind).map(|(.., ms)| *ms).collect()
    };
    assert_eq!(of(&rows, StepKind::Join), [0.0], "{rows:?}");
    // Two targets are read back: the colour, which the quad pass lights, and the picture of the rays. With rays on the
    // processor, the whole G-buffer is read back at once.
    assert_eq!((of(&rows, StepKind::ReadBack).len(), of(&apart, StepKind::ReadBack).len()), (2, 1), "{rows:?}");
    assert!(rows.iter().any(|(kind, note, _)| *kind == StepKind::Join && note == "in device memory"), "{rows:?}");
}
