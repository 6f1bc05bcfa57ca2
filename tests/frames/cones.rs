//! Texture lookups by ray cones, in whole projects: what plans say, which backends lack them, and which settings they go with.

use crate::plain::Plain;
use curitiba::Choice;
use curitiba::passes::cpu::CpuRays;
use curitiba::pipeline::backend::Rect;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, PlanError, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project;
use std::path::{Path, PathBuf};

const SIZE: [u32; 2] = [64, 48];
const CONES: &str = "pass2.texturelod=cones";

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/SceneReflect.xml")
}

/// A view that shows much glass.
fn settings(set: &[&str]) -> Settings {
    let set = set.iter().map(|one| (*one).to_owned()).collect();
    Settings { size: Some(SIZE), camera: Some("Vidro".to_owned()), set, ..Settings::default() }
}

fn plan(settings: Settings) -> Result<Plan, PlanError> {
    Plan::new(project::load(&path()).expect("it loads"), settings)
}

fn frame(settings: Settings) -> Image {
    let mut renderer = curitiba::open(path(), settings, Choice::CPU, &mut Silent).expect("it opens");
    renderer.frame(&mut Silent).expect("a frame")
}

#[test]
fn plans_say_which_passes_have_cones() {
    let [without, with] = [&[][..], &[CONES]].map(|set| plan(settings(set)).expect("a plan"));
    let said = with.decisions.iter().find(|decision| decision.what == "ray cones of pass `pass2`");
    assert!(said.is_some_and(|said| said.built && said.why.contains("texturelod=cones")), "{said:?}");
    assert!(without.decisions.iter().all(|decision| !decision.what.starts_with("ray cones")));
    // A project that does not set `texturelod` uses cones, except in thesis fidelity.
    for (name, pass) in [("glass/balls.xml", "pass2"), ("camera/SquareColors.xml", "pass1")] {
        let silent = |fidelity| {
            let project = project::load(&path().with_file_name(name)).expect("it loads");
            Plan::new(project, Settings { fidelity, ..Settings::default() }).expect("a plan")
        };
        let cones = |plan: &Plan| plan.decisions.iter().any(|one| one.what == format!("ray cones of pass `{pass}`"));
        assert!(cones(&silent(Fidelity::Corrected)), "{name}");
        if name.starts_with("glass") {
            assert!(silent(Fidelity::Thesis).decisions.iter().all(|one| !one.what.contains("cones")));
        }
    }
    let thesis = plan(Settings { fidelity: Fidelity::Thesis, ..settings(&[CONES]) }).expect("a plan");
    assert!(thesis.decisions.iter().all(|one| !one.what.contains("cones")));
    // Rays for pixels that a raster effect leaves open use the pass's `texturelod`.
    let left = |lod: &str| {
        let file = path().with_file_name("raster/SceneScreenReflect.xml");
        let set = vec!["pass2.missing=rays".to_owned(), format!("pass2.texturelod={lod}")];
        Plan::new(project::load(&file).expect("it loads"), Settings { set, ..Settings::default() }).expect("a plan")
    };
    let asks = ["zero", "cones"].map(|lod| left(lod).decisions.iter().any(|one| one.what.starts_with("ray cones")));
    assert_eq!(asks, [false, true]);
    let wrong = plan(settings(&["pass2.texturelod=2"])).expect_err("no value").to_string();
    assert!(wrong.contains("zero, cones"), "{wrong}");
}

#[test]
fn cones_change_glass_alone_and_parts_are_cut_from_the_whole() {
    let [zero, cones] = [&["pass2.texturelod=zero"][..], &[CONES]].map(|set| frame(settings(set)));
    assert_eq!(zero, frame(settings(&[])));
    let glass = frame(Settings { off: vec!["pass2".to_owned()], ..settings(&[]) });
    let differ = |a: &Image, b: &Image| a.pixels.iter().zip(&b.pixels).map(|(a, b)| a != b).collect::<Vec<bool>>();
    let (changed, is_glass) = (differ(&zero, &cones), differ(&zero, &glass));
    assert!(changed.iter().filter(|changed| **changed).count() > 300);
    assert!(changed.iter().zip(&is_glass).all(|(changed, is_glass)| !changed || *is_glass));
    let part = frame(Settings { crop: Some(Rect { x: 20, y: 12, width: 16, height: 20 }), ..settings(&[CONES]) });
    for (row, pixels) in part.pixels.chunks(16).enumerate() {
        let first = (row + 12) * SIZE[0] as usize + 20;
        assert!(pixels == &cones.pixels[first..first + 16], "row {row}");
    }
    assert_eq!(frame(Settings { bands: Some(3), ..settings(&[CONES]) }), cones);
}

/// For the square's mirrors, many samples per pixel give the mean over the pixel. A picture with cones is nearer to it than one without.
#[test]
fn cones_are_nearer_to_many_samples_a_pixel() {
    let aa = |count: &str, set: &[&str]| Settings { aa: count.parse().expect("a number"), ..settings(set) };
    let many = frame(aa("64", &[]));
    let error = |picture: &Image| {
        let square = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)).sum::<f64>();
        (picture.pixels.iter().zip(&many.pixels).map(square).sum::<f64>() / many.pixels.len() as f64 / 3.0).sqrt()
    };
    let of = |count: &str| [&[][..], &[CONES]].map(|set| error(&frame(aa(count, set))));
    let ([zero, cones], [zero_of_4, cones_of_4]) = (of("1"), of("4"));
    println!("1 sample: {zero:.4} and {cones:.4}; 4 samples: {zero_of_4:.4} and {cones_of_4:.4}");
    // Most of the error is at edges.
    assert!(cones < 0.93 * zero && cones_of_4 < 0.9 * zero_of_4);
    // Each sample has a part of the pixel's cone, so that all samples together do not blur.
    let blurred = error(&frame(aa("64", &[CONES])));
    println!("64 samples: {blurred:.4}");
    assert!(blurred < 0.3 * cones_of_4);
}

#[test]
fn a_backend_that_has_none_is_named_with_what_to_do() {
    let plain = Plain(CpuRays::new());
    let asks = plan(settings(&[CONES])).expect("a plan");
    let (pass, error) = asks.without_cones(|_| &plain).expect("it is refused");
    let error = error.to_string();
    assert!(pass == "pass2" && error.contains("plain") && error.contains("texturelod=cones"), "{error}");
    assert!(error.contains("--backend cpu") && error.contains("set texturelod=zero"), "{error}");
    assert!(plan(settings(&[])).expect("a plan").without_cones(|_| &plain).is_none());
    assert!(asks.without_cones(|_| &plain.0).is_none());
}
