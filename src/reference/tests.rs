use super::*;
use crate::Choice;
use crate::bench::{MeasureOptions, measure};
use crate::pipeline::executor::Silent;
use crate::pipeline::plan::Settings;
use crate::pipeline::programs::Fidelity;
use std::path::Path;

const CPU: Choice = Choice::CPU;

fn case(project: &str, set: &[&str]) -> Case {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(project);
    let set = set.iter().map(|assignment| (*assignment).to_owned()).collect();
    Case::new(&path, Settings { size: Some([24, 24]), set, ..Settings::default() }, CPU).expect("a valid project")
}

fn picture(case: &Case) -> Image {
    measure(case, &MeasureOptions { frames: 1, warmup: 0 }, &mut Silent).expect("measured").picture
}

fn references(folder: &Path, seconds: u64) -> References {
    References::new(folder.to_owned(), Duration::from_secs(seconds))
}

fn own_error_and_rmse(error: &RowError) -> (f64, f64) {
    match error {
        RowError::Against { own_error, comparison, .. } => (*own_error, comparison.rmse),
        RowError::Missing(why) => panic!("{why}"),
    }
}

#[test]
fn the_mean_of_two_renders_and_its_error_are_those_of_known_noise() {
    let first = Image { width: 2, height: 1, pixels: vec![[1.0, 2.0, 3.0, 1.0], [0.0, 0.0, 0.0, 1.0]] };
    let second = Image { width: 2, height: 1, pixels: vec![[3.0, 2.0, 3.0, 1.0], [0.0, 4.0, 0.0, 1.0]] };
    let (mean, error) = mean_of_two(first, &second);
    assert_eq!(mean.pixels, [[2.0, 2.0, 3.0, 1.0], [0.0, 2.0, 0.0, 1.0]]);
    assert!((error - (20.0_f64 / 6.0).sqrt() / 2.0).abs() < 1e-12, "{error}");
}

#[test]
fn a_reference_is_refined_until_its_error_is_ten_times_below_the_rows() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut references = references(folder.path(), 60);
    let rough = case("SceneSSAO.xml", &["pass2.samples=4"]);
    let fine = case("SceneSSAO.xml", &["pass2.samples=1024"]);
    let (own, rmse) = own_error_and_rmse(&references.compare(&rough, &picture(&rough), &mut Silent).expect("compared"));
    assert!(rmse > 0.0 && own <= rmse / MARGIN, "{own} {rmse}");
    let first = references.get(&rough, &mut Silent).expect("held");
    let (own, rmse) = own_error_and_rmse(&references.compare(&fine, &picture(&fine), &mut Silent).expect("compared"));
    assert!(rmse > 0.0 && own <= rmse / MARGIN, "{own} {rmse}");
    let second = references.get(&rough, &mut Silent).expect("held");
    assert!(second.samples > first.samples, "both rows have one reference, and the second asked more of it");
    assert_eq!(references.take_warnings(), Vec::<String>::new());
    let files = std::fs::read_dir(folder.path()).expect("the folder").count();
    assert_eq!(files, 2, "a better reference replaces the one before");
}

#[test]
fn with_a_fixed_number_of_samples_an_error_depends_on_the_row_alone() {
    let cases = [4, 1024].map(|samples| case("SceneSSAO.xml", &[&format!("pass2.samples={samples}")]));
    let pictures = cases.each_ref().map(picture);
    let errors = |order: [usize; 2], samples: Option<u32>| {
        let folder = tempfile::tempdir().expect("a folder");
        let mut found = [None, None];
        for index in order {
            // Each row has its own `References`, as in a process of its own; all share one folder.
            let mut references = references(folder.path(), 60).with_samples(samples);
            let error = references.compare(&cases[index], &pictures[index], &mut Silent).expect("compared");
            found[index] = Some(error);
        }
        found
    };
    let fixed = errors([0, 1], Some(300));
    assert_eq!(fixed, errors([1, 0], Some(300)));
    assert_ne!(errors([0, 1], None), errors([1, 0], None), "refined ones depend on what came before");
    let Some(RowError::Against { reference, .. }) = &fixed[1] else { panic!("{fixed:?}") };
    assert!(reference.contains("300 samples") && reference.contains("the number of samples is fixed"), "{reference}");
    assert!(has_noise(&cases[0]).expect("a plan") && !has_noise(&case("SceneShadows.xml", &[])).expect("a plan"));
}

#[test]
fn a_row_says_by_how_much_its_reference_falls_short() {
    let folder = tempfile::tempdir().expect("a folder");
    let fine = case("SceneSSAO.xml", &["pass2.samples=1024"]);
    let error = references(folder.path(), 0).compare(&fine, &picture(&fine), &mut Silent).expect("compared");
    match &error {
        RowError::Against { reference, .. } => {
            assert!(reference.contains("times below this row's, not 10"), "{reference}")
        }
        RowError::Missing(why) => panic!("{why}"),
    }
    let (own, rmse) = own_error_and_rmse(&error);
    assert!(own > rmse / MARGIN);
}

#[test]
fn rows_without_noise_are_compared_with_f64_rays_and_agree() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut references = references(folder.path(), 60);
    for (project, set) in
        [("SceneShadows.xml", &[][..]), ("SceneReflect.xml", &[]), ("SceneFinal.xml", &["pass2.samples=0"])]
    {
        let case = case(project, set);
        let picture = picture(&case);
        let (own, rmse) = own_error_and_rmse(&references.compare(&case, &picture, &mut Silent).expect("compared"));
        assert!(own == 0.0 && rmse < 1e-3, "{project}: {own} {rmse}");
        let reference = references.get(&case, &mut Silent).expect("held");
        assert!(reference.what.contains("f64"), "{}", reference.what);
        let mut darker = picture;
        darker.pixels.iter_mut().for_each(|pixel| pixel[0] *= 0.9);
        let (_, rmse) = own_error_and_rmse(&references.compare(&case, &darker, &mut Silent).expect("compared"));
        assert!(rmse > 1e-3, "{project}: a darker picture goes unnoticed");
    }
}

#[test]
fn a_raster_effect_has_the_reference_of_the_rays_in_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut references = references(folder.path(), 60);
    for (rays, raster) in [
        ("SceneShadows.xml", "raster/SceneShadowMap.xml"),
        ("SceneReflect.xml", "raster/SceneCubeReflect.xml"),
        ("SceneReflect.xml", "raster/ScenePlanarReflect.xml"),
        ("SceneReflect.xml", "raster/SceneScreenReflect.xml"),
        ("SceneRefract.xml", "raster/SceneCubeRefract.xml"),
        ("SceneRefract.xml", "raster/SceneScreenRefract.xml"),
        ("SceneSSAO.xml", "raster/SceneGTAO.xml"),
        ("SceneSSAO.xml", "raster/SceneDepthOcclusion.xml"),
    ] {
        let of_rays = references.get(&case(rays, &[]), &mut Silent).expect("rendered");
        let of_raster = references.get(&case(raster, &[]), &mut Silent).expect("rendered");
        assert_eq!(of_rays.picture, of_raster.picture, "{raster}");
    }
    let shorter = references.get(&case("raster/SceneGTAO.xml", &["pass2.radius=0.1"]), &mut Silent).expect("rendered");
    let longer = references.get(&case("raster/SceneGTAO.xml", &[]), &mut Silent).expect("rendered");
    assert_ne!(shorter.picture, longer.picture, "the constants of the effect are those of its reference");
}

#[test]
fn the_fidelity_the_seed_and_the_samples_of_a_row_do_not_change_what_is_right() {
    let plain = Request::new(&case("SceneSSAO.xml", &[])).expect("a plan");
    let mut other = case("SceneSSAO.xml", &["pass2.samples=4", "pass2.sampler=strata"]);
    other.settings.fidelity = Fidelity::Thesis;
    other.settings.seed = 7;
    assert_eq!(Request::new(&other).expect("a plan").base(&[]), plain.base(&[]));
    for set in ["norm.format=RGBA16F", "pos.format=RGBA16F"] {
        let narrow = Request::new(&case("SceneSSAO.xml", &[set])).expect("a plan");
        assert_eq!(narrow.base(&[]), plain.base(&[]), "{set}: what is right is in 32-bit floats");
    }
    let exact = Request::new(&case("SceneRefract.xml", &[])).expect("a plan");
    let schlick = Request::new(&case("SceneRefract.xml", &["pass2.fresnel=schlick"])).expect("a plan");
    assert_eq!(exact.base(&[]), schlick.base(&[]), "what is right is exact");
    let denser = Request::new(&case("SceneRefract.xml", &["pass2.index=1.5"])).expect("a plan");
    assert_ne!(exact.base(&[]), denser.base(&[]));
    for set in ["pass2.radius=0.25", "pass2.intensity=1", "pass2.samples=0"] {
        let changed = Request::new(&case("SceneSSAO.xml", &[set])).expect("a plan");
        assert_ne!(changed.base(&[]), plain.base(&[]), "{set}");
    }
    let mut larger = case("SceneSSAO.xml", &[]);
    larger.settings.size = Some([25, 24]);
    assert_ne!(Request::new(&larger).expect("a plan").base(&[]), plain.base(&[]));
    assert_ne!(plain.base(&["a".to_owned()]), plain.base(&["b".to_owned()]));
}

/// The text that determines a reference, from the JSON file beside it.
fn found_material(json: &Path) -> String {
    let text = std::fs::read_to_string(json).expect("text");
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let lines = value["material"].as_array().expect("lines").iter().map(|line| line.as_str().expect("a line"));
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn a_kept_reference_is_used_again_and_a_damaged_one_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let case = case("SceneShadows.xml", &[]);
    let first = references(folder.path(), 60).get(&case, &mut Silent).expect("rendered");
    let (exr, json) = ["exr", "json"].map(|extension| folder.path().join(format!("{}.{extension}", first.key))).into();
    let written = |path: &Path| std::fs::metadata(path).and_then(|data| data.modified()).expect("a time");
    let before = written(&exr);
    let mut again = references(folder.path(), 60);
    assert_eq!(again.get(&case, &mut Silent).expect("read").picture, first.picture);
    assert!(again.take_warnings().is_empty() && written(&exr) == before, "it was rendered again");

    let (good_exr, good_json) = (std::fs::read(&exr).expect("bytes"), std::fs::read(&json).expect("bytes"));
    let mut flipped = good_exr.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    let other = String::from_utf8(good_json.clone()).expect("text").replace("window [24, 24]", "window [24, 25]");
    for (path, bytes) in [
        (&exr, &good_exr[..good_exr.len() / 2]),
        (&exr, &flipped[..]),
        (&exr, &[][..]),
        (&json, &good_json[..good_json.len() / 2]),
        (&json, other.as_bytes()),
    ] {
        std::fs::write(path, bytes).expect("damaged");
        let mut mended = references(folder.path(), 60);
        assert_eq!(mended.get(&case, &mut Silent).expect("rendered").picture, first.picture);
        let warnings = mended.take_warnings();
        assert!(warnings.len() == 1 && warnings[0].contains("rendered again"), "{warnings:?}");
        assert_eq!(
            mended.folder.load(&found_material(&json), [24, 24]).map(|entry| entry.map(|e| e.picture)),
            Ok(Some(first.picture.clone()))
        );
    }
}

#[test]
fn a_reference_is_kept_until_a_better_one_is_stored() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut references = references(folder.path(), 60);
    let fine = case("SceneSSAO.xml", &["pass2.samples=1024"]);
    let first = references.get(&fine, &mut Silent).expect("rendered");
    let base = references.base(&Request::new(&fine).expect("a plan"), &mut Silent).expect("an open scene");
    // Folders stand where the files of better references would be.
    for samples in std::iter::successors(Some(2 * first.samples), |n| (*n < MOST_SAMPLES).then_some(2 * n)) {
        std::fs::create_dir(references.folder.files(&material(&base, samples)).1).expect("a folder");
    }
    references.compare(&fine, &picture(&fine), &mut Silent).expect("compared");
    assert!(references.get(&fine, &mut Silent).expect("held").samples > first.samples, "control: it is refined");
    assert!(!references.take_warnings().is_empty(), "control: the better one is not stored");
    let kept = references.folder.load(&material(&base, first.samples), [24, 24]).expect("undamaged");
    assert_eq!(kept.map(|entry| entry.picture), Some(first.picture));
}

#[test]
fn a_folder_that_cannot_be_written_costs_a_warning_and_no_row() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "not a folder").expect("written");
    let mut references = references(&file, 60);
    assert!(references.get(&case("SceneShadows.xml", &[]), &mut Silent).is_ok());
    assert!(!references.take_warnings().is_empty());
}

#[test]
fn a_reference_with_fewer_samples_deletes_no_better_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut references = references(folder.path(), 0);
    let case = case("SceneSSAO.xml", &[]);
    references.get(&case, &mut Silent).expect("rendered");
    let stored = || std::fs::read_dir(folder.path()).expect("the folder").count();
    let before = stored();
    references.make(&case, Of::Effect, 64, Shard::WHOLE, &mut Silent).expect("rendered");
    assert!(before > 0 && stored() > before, "{before} files, and then {}", stored());
}
