//! Adaptive sampling of glass, in whole projects: its results, what plans say, which backends lack it, and which settings it goes with.

use crate::plain::Plain;
use curitiba::Choice;
use curitiba::passes::cpu::CpuRays;
use curitiba::pipeline::backend::{PathsSpent, Rect};
use curitiba::pipeline::executor::{Goal, Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, PlanError, Settings};
use curitiba::pipeline::programs::{ADAPTIVE_BYTES, Fidelity};
use curitiba::pipeline::project;
use std::path::{Path, PathBuf};

const SIZE: [u32; 2] = [48, 40];

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/glass/Frosted.xml")
}

fn settings(set: &[&str]) -> Settings {
    let set = ["pass2.samples=0"].iter().chain(set).map(|one| (*one).to_owned()).collect();
    Settings { size: Some(SIZE), set, ..Settings::default() }
}

fn plan(settings: Settings) -> Result<Plan, PlanError> {
    Plan::new(project::load(&path()).expect("it loads"), settings)
}

fn opened(settings: Settings) -> Renderer {
    curitiba::open(path(), settings, Choice::CPU, &mut Silent).expect("it opens")
}

/// A picture, with the number of paths that were spent.
fn frame(settings: Settings) -> (Image, Option<PathsSpent>) {
    let mut renderer = opened(settings);
    let image = renderer.frame(&mut Silent).expect("a frame");
    let row = renderer.timeline().rows.iter().find(|row| row.rays.is_some()).expect("a ray pass");
    assert_eq!(row.adaptive.is_some(), row.note.contains("paths a pixel at"), "{}", row.note);
    (image, row.adaptive)
}

#[test]
fn plans_say_that_glass_is_sampled_and_count_what_that_holds() {
    let [without, with] = [&[][..], &["pass2.error=0.05"]].map(|set| plan(settings(set)).expect("a plan"));
    assert_eq!(with.target_bytes() - without.target_bytes(), ADAPTIVE_BYTES * u64::from(SIZE[0] * SIZE[1]));
    let said = with.decisions.iter().find(|decision| decision.what == "adaptive sampling of pass `pass2`");
    assert!(said.is_some_and(|said| said.built && said.why.contains("4 to 16 paths")), "{said:?}");
    assert!(without.decisions.iter().all(|decision| !decision.what.starts_with("adaptive")));
    let error = plan(Settings { max_memory: with.target_bytes() - 1, ..settings(&["pass2.error=0.05"]) });
    let error = error.expect_err("too much").to_string();
    assert!(error.contains("the render targets and adaptive sampling take"), "{error}");
    let few = plan(settings(&["pass2.error=0.05", "pass2.paths=3"])).expect_err("too few").to_string();
    assert!(few.contains("Frosted.xml:") && few.contains("paths=3") && few.contains("paths=4 or more"), "{few}");
    let thesis = Settings { fidelity: Fidelity::Thesis, ..settings(&["pass2.error=0.05"]) };
    let thesis = plan(thesis).expect("a plan");
    assert!(thesis.decisions.iter().any(|one| one.what.starts_with("error=0.05 of pass") && !one.built));
    assert!(thesis.decisions.iter().all(|decision| !decision.what.starts_with("adaptive")));
}

#[test]
fn rows_say_what_was_spent_and_more_is_spent_for_a_smaller_error() {
    let spent = |error: &str| frame(settings(&["pass2.paths=4096", error])).1.expect("it is sampled");
    let [much, little] = ["pass2.error=0.04", "pass2.error=0.02"].map(spent);
    assert!(much.met && little.met && much.pixels == little.pixels && much.pixels > 300, "{much}; {little}");
    assert!(much.error < 0.04 && little.error < 0.02 && little.paths > much.paths, "{much}; {little}");
    assert_eq!(frame(settings(&["pass2.paths=4"])).1, None);
    // With four samples per pixel, each of them is sampled to the error.
    let several =
        Settings { aa: "4".parse().expect("a number"), ..settings(&["pass2.paths=4096", "pass2.error=0.04"]) };
    let several = frame(several).1.expect("it is sampled");
    assert!(several.pixels > 3 * much.pixels && several.met, "{several}");
}

#[test]
fn pixels_depend_on_others_so_that_parts_are_cut_from_the_whole() {
    let of = |crop: Option<[u32; 4]>| {
        let crop = crop.map(|[x, y, width, height]| Rect { x, y, width, height });
        Settings { crop, ..settings(&["pass2.error=0.1", "pass2.paths=64"]) }
    };
    let (whole, part) = (frame(of(None)).0, frame(of(Some([20, 12, 16, 20]))).0);
    assert_eq!([part.width, part.height], [16, 20]);
    for (row, pixels) in part.pixels.chunks(16).enumerate() {
        let first = (row + 12) * SIZE[0] as usize + 20;
        assert!(pixels == &whole.pixels[first..first + 16], "row {row}");
    }
    let error = plan(Settings { bands: Some(2), ..of(None) }).expect_err("refused").to_string();
    assert!(error.contains("as many paths as the error of all of its picture takes"), "{error}");
}

#[test]
fn accumulation_has_an_error_of_its_own() {
    let mut renderer = opened(settings(&["pass2.error=0.1", "pass2.samples=4"]));
    let error = renderer.accumulate(Goal::Samples(4), &mut Silent).expect_err("refused").to_string();
    assert!(error.contains("error=0.1") && error.contains("pass2.error=0"), "{error}");
}

#[test]
fn a_backend_that_has_none_is_named_with_what_to_do() {
    let plain = Plain(CpuRays::new());
    let sampled = plan(settings(&["pass2.error=0.05"])).expect("a plan");
    let (pass, error) = sampled.unsampled(|_| &plain).expect("it is refused");
    let error = error.to_string();
    assert!(pass == "pass2" && error.contains("plain") && error.contains("error=0.05"), "{error}");
    assert!(error.contains("--backend cpu") && error.contains("set error=0"), "{error}");
    assert!(plan(settings(&[])).expect("a plan").unsampled(|_| &plain).is_none());
    assert!(sampled.unsampled(|_| &plain.0).is_none());
}
