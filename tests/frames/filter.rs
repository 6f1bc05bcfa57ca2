//! The filter after ray passes, in whole projects: its results, which backends lack it, and which settings it goes with.

use crate::plain::Plain;
use curitiba::Choice;
use curitiba::passes::cpu::CpuRays;
use curitiba::pipeline::executor::{Goal, Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, PlanError, Settings};
use curitiba::pipeline::programs::{FILTER_BYTES, Fidelity};
use curitiba::pipeline::project;
use std::path::{Path, PathBuf};
use std::process::Command;

const SIZE: [u32; 2] = [144, 112];

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name)
}

fn settings(set: &[&str]) -> Settings {
    Settings { size: Some(SIZE), set: set.iter().map(|one| (*one).to_owned()).collect(), ..Settings::default() }
}

fn plan(name: &str, settings: Settings) -> Result<Plan, PlanError> {
    Plan::new(project::load(&path(name)).expect("it loads"), settings)
}

fn opened(name: &str, settings: Settings) -> Renderer {
    curitiba::open(path(name), settings, Choice::CPU, &mut Silent).expect("it opens")
}

fn frame(name: &str, settings: Settings) -> Image {
    opened(name, settings).frame(&mut Silent).expect("a frame")
}

fn off(a: &Image, b: &Image) -> f64 {
    let squares = a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)));
    (squares.sum::<f64>() / (3 * a.pixels.len()) as f64).sqrt()
}

#[test]
fn what_it_holds_is_counted_and_bounded_by_the_memory_allowed() {
    let bytes = FILTER_BYTES * u64::from(SIZE[0]) * u64::from(SIZE[1]);
    for (name, set) in [
        ("SceneSSAO.xml", &["pass2.filter=2"][..]),
        ("raster/SceneGTAO.xml", &["pass2.filter=1"]),
        ("SceneShadows.xml", &["pass2.filter=1", "pass2.sun=2"]),
    ] {
        let [without, with] = [&[][..], set].map(|set| plan(name, settings(set)).expect("a plan"));
        assert_eq!(with.target_bytes() - without.target_bytes(), bytes, "{name}");
        let said = with.decisions.iter().find(|decision| decision.what == "filter of pass `pass2`");
        assert!(said.is_some_and(|said| said.built && said.why.contains("0.5 MiB")), "{name}: {said:?}");
        assert!(without.decisions.iter().all(|decision| !decision.what.starts_with("filter")));
        let most = with.target_bytes() - 1;
        let error = plan(name, Settings { max_memory: most, ..settings(set) }).expect_err("too much");
        assert!(error.message.contains("the render targets and filters take"), "{error}");
    }
    // Without samples nothing is filtered, and thesis fidelity has no filter.
    let hard = plan("SceneShadows.xml", settings(&["pass2.filter=1"])).expect("a plan");
    assert!(hard.decisions.iter().any(|one| one.what.starts_with("filter") && !one.built));
    let thesis = Settings { fidelity: Fidelity::Thesis, ..settings(&["pass2.filter=1"]) };
    let thesis = plan("SceneSSAO.xml", thesis).expect("a plan");
    assert!(thesis.decisions.iter().any(|one| one.what.starts_with("filter=1 of pass") && !one.built));
}

#[test]
fn pixels_depend_on_others_so_that_parts_are_cut_from_the_whole() {
    let of = |crop: Option<[u32; 4]>| {
        let crop = crop.map(|[x, y, width, height]| curitiba::pipeline::backend::Rect { x, y, width, height });
        Settings { crop, ..settings(&["pass2.filter=2", "pass2.samples=4"]) }
    };
    let (whole, part) = (frame("SceneSSAO.xml", of(None)), frame("SceneSSAO.xml", of(Some([70, 30, 20, 40]))));
    assert_eq!([part.width, part.height], [20, 40]);
    for (row, pixels) in part.pixels.chunks(20).enumerate() {
        let first = (row + 30) * SIZE[0] as usize + 70;
        assert!(pixels == &whole.pixels[first..first + 20], "row {row}");
    }
    let banded = Settings { bands: Some(2), ..of(None) };
    let error = plan("SceneSSAO.xml", banded).expect_err("refused").to_string();
    assert!(error.contains("filters what it writes"), "{error}");
}

#[test]
fn a_filter_of_accumulated_samples_is_that_of_all_at_once() {
    let settings = |samples: &str, filter: &str| settings(&[samples, filter, "pass2.radius=4"]);
    let at_once = frame("SceneSSAO.xml", settings("pass2.samples=16", "pass2.filter=2"));
    let mut renderer = opened("SceneSSAO.xml", settings("pass2.samples=100", "pass2.filter=2"));
    renderer.accumulate(Goal::Samples(16), &mut Silent).expect("it takes samples");
    assert!(off(&renderer.window_image(), &at_once) < 1e-6, "{}", off(&renderer.window_image(), &at_once));
    // Control and purpose: with few samples, the filtered picture is nearer to that of many samples.
    let plain = |samples| frame("SceneSSAO.xml", settings(samples, "pass2.filter=0"));
    assert!(off(&plain("pass2.samples=16"), &at_once) > 1e-3);
    let many = plain("pass2.samples=1024");
    let filtered = frame("SceneSSAO.xml", settings("pass2.samples=4", "pass2.filter=1"));
    let [raw, less] = [plain("pass2.samples=4"), filtered].map(|image| off(&image, &many));
    assert!(less < 0.8 * raw, "{less} {raw}");
}

#[test]
fn a_backend_that_has_none_is_named_with_what_to_do() {
    let plain = Plain(CpuRays::new());
    let plan = |set: &[&str]| plan("SceneSSAO.xml", settings(set)).expect("a plan");
    let filtered = plan(&["pass2.filter=1"]);
    let (pass, error) = filtered.unfiltered(|_| &plain).expect("it is refused");
    let error = error.to_string();
    assert!(pass == "pass2" && error.contains("plain") && error.contains("filter=1"), "{error}");
    assert!(error.contains("--backend cpu") && error.contains("filter=0"), "{error}");
    assert!(plan(&[]).unfiltered(|_| &plain).is_none());
    assert!(filtered.unfiltered(|_| &plain.0).is_none());
    let mut listed = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    let listed = listed.args(["list", "ssao"]).env("NO_COLOR", "1").output().expect("the program starts");
    let listed = String::from_utf8_lossy(&listed.stdout).into_owned();
    assert!(listed.contains("filter") && listed.contains("29 x 29"), "{listed}");
}
