//! The reference of a picture agrees with the product's own pictures at their best, is stored and found again, and is
//! refused where it is not supported.

use curitiba::Choice;
use curitiba::bench::Case;
use curitiba::bench::model::RowError;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::metrics::{self, Options};
use curitiba::pipeline::pixel_samples::PixelSamples;
use curitiba::pipeline::plan::Settings;
use curitiba::reference::{Made, Of, Part, Reference, ReferenceError, References};
use curitiba::shard::Shard;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

fn project(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name)
}

fn case(name: &str, settings: Settings) -> Case {
    Case::new(&project(name), settings, Choice::CPU).expect("a valid project")
}

fn of_size(size: [u32; 2], camera: &str, set: &[&str]) -> Settings {
    let set = set.iter().map(|set| (*set).to_owned()).collect();
    Settings { size: Some(size), camera: Some(camera.to_owned()), set, ..Settings::default() }
}

fn references(folder: &Path) -> References {
    References::new(folder.to_owned(), Duration::ZERO)
}

fn make(folder: &Path, case: &Case, samples: u32, shard: Shard) -> Result<Made, ReferenceError> {
    references(folder).make(case, Of::Picture, samples, shard, &mut Silent)
}

fn made_of(folder: &Path, case: &Case, samples: u32) -> (Reference, Option<Duration>) {
    match make(folder, case, samples, Shard::WHOLE).expect("rendered") {
        Made::Whole(reference, took) => (reference, took),
        Made::Part(part) => panic!("{part:?}"),
    }
}

fn frame(case: &Case, samples: u32) -> Image {
    let settings = Settings { aa: PixelSamples::new(samples).expect("so many"), ..case.settings.clone() };
    let mut renderer = curitiba::open(&case.project, settings, Choice::CPU, &mut Silent).expect("opened");
    renderer.frame(&mut Silent).expect("rendered")
}

fn rmse(a: &Image, b: &Image) -> f64 {
    metrics::compare(a, b, &Options::default()).expect("comparable").rmse
}

/// The product and the reference share only the scene; they differ in texture filtering, in the samples of edges, and in noise.
#[test]
fn many_samples_of_the_product_agree_with_the_reference_and_one_does_not() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, set) in [
        ("SceneNoEffects.xml", &[][..]),
        ("SceneDummy.xml", &[]),
        ("SceneShadows.xml", &[]),
        ("SceneShadows.xml", &["pass2.sun=4", "pass2.sunsamples=4"]),
        ("SceneReflect.xml", &[]),
        ("SceneRefract.xml", &[]),
        ("SceneSSAO.xml", &["pass2.samples=64"]),
        ("SceneFinal.xml", &["pass2.samples=64"]),
    ] {
        for camera in ["MainCamera", "Vidro"] {
            let case = case(name, of_size([40, 30], camera, set));
            let (reference, _) = made_of(folder.path(), &case, 64);
            let best = rmse(&frame(&case, 64), &reference.picture);
            let plain = rmse(&frame(&case, 1), &reference.picture);
            println!(
                "{name} {camera}: {best:.4} of 64 samples, {plain:.4} of one, own error {:.4}",
                reference.own_error
            );
            assert!(
                reference.own_error > 0.0 && reference.own_error < 0.02,
                "{name} {camera}: {}",
                reference.own_error
            );
            assert!(best < 2.0 * reference.own_error, "{name} {camera}: {best}, own error {}", reference.own_error);
            assert!(plain > 3.0 * best, "{name} {camera}: control: one sample a pixel is as good");
        }
    }
}

/// Bodies, nested bodies, walls that stain light and the stained light on the floor, exact spheres and shells of them, dispersion, and rough
/// glass. The reference follows all ways of a path; the product follows enough of them to come near it.
#[test]
fn glass_of_materials_and_exact_spheres_agree_with_the_reference_and_another_rule_does_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let (open, still) = ("pass2.samples=0", [28, 28]);
    for (name, size, set, wrong) in [
        ("glass/balls.xml", still, &[open][..], "pass2.shadow=opaque"),
        ("glass/filled.xml", still, &[open], "pass2.depth=1"),
        ("glass/panes.xml", [16, 16], &["pass2.samples=64"], "pass2.shadow=report"),
        ("glass/panes.xml", still, &[open, "pass2.sun=6", "pass2.sunsamples=4"], "pass2.shadow=report"),
        ("glass/Spheres.xml", still, &[open], "pass2.shadow=opaque"),
        ("glass/Shells.xml", still, &[open], "pass2.shadow=report"),
        ("glass/Caustics.xml", still, &[open, "pass2.shadow=straight", "pass2.sun=0"], "pass2.shadow=opaque"),
        ("glass/Prism.xml", [16, 16], &[open, "pass2.wavelengths=64", "pass2.depth=3"], "pass2.shadow=report"),
        ("glass/Frosted.xml", [16, 16], &[open, "pass2.paths=16", "pass2.depth=3"], "pass2.shadow=opaque"),
    ] {
        let case = case(name, of_size(size, "MainCamera", set));
        let (reference, _) = made_of(folder.path(), &case, 64);
        let best = rmse(&frame(&case, 64), &reference.picture);
        let plain = rmse(&frame(&case, 1), &reference.picture);
        let mut other = case.clone();
        other.settings.set.push(wrong.to_owned());
        let other = rmse(&frame(&other, 16), &reference.picture);
        let own = reference.own_error;
        println!(
            "{name} {set:?}: {best:.4} of 64 samples, {plain:.4} of one, {other:.4} by {wrong}, own error {own:.4}"
        );
        assert!(own > 0.0 && own < 0.03, "{name} {set:?}: {own}");
        assert!(best < 2.0 * own, "{name} {set:?}: {best}, own error {own}");
        assert!(plain > 2.0 * best && other > 1.5 * best, "{name} {set:?}: control: {plain}, {other} for {best}");
    }
}

/// Settings that trade light for time, or that decide how well light is sampled, do not change the reference of a picture.
#[test]
fn one_reference_serves_all_ways_to_follow_glass() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |set: &[&str]| case("glass/panes.xml", of_size([8, 8], "MainCamera", set));
    let (made, _) = made_of(folder.path(), &of(&[]), 64);
    let find = |set: &[&str]| references(folder.path()).picture(&of(set), &mut Silent).map(|found| found.key.clone());
    for set in [&["pass2.cutoff=0.1"][..], &["pass2.reflections=1"], &["pass2.paths=4"], &["pass2.wavelengths=1"]] {
        assert_eq!(find(set).unwrap_or_else(|error| panic!("{set:?}: {error}")), made.key);
    }
    for set in [&["pass2.depth=4"][..], &["pass2.shadow=opaque"], &["pass2.shadow=report"], &["pass2.glass=pane"]] {
        let missing = find(set);
        assert!(missing.is_err(), "control: {set:?} is another picture");
    }
}

#[test]
fn it_is_kept_serves_the_raster_twin_and_every_other_row_says_how_it_is_made() {
    let folder = tempfile::tempdir().expect("a folder");
    let rays = case("SceneShadows.xml", of_size([20, 16], "MainCamera", &[]));
    let raster = case("raster/SceneShadowMap.xml", of_size([20, 16], "MainCamera", &["pass2.mapsize=256"]));
    let picture = frame(&rays, 1);
    let compare = |case: &Case, picture: &Image| {
        let mut references = references(folder.path());
        let error = references.compare_picture(case, picture, &mut Silent).expect("compared");
        assert_eq!(references.take_warnings(), Vec::<String>::new());
        error
    };
    let RowError::Missing(why) = compare(&rays, &picture) else { panic!("nothing is made yet") };
    assert!(why.contains("curitiba reference") && why.contains("--camera MainCamera --size 20x16"), "{why}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing is rendered unasked");

    let (made, took) = made_of(folder.path(), &rays, 64);
    assert!(took.is_some() && made.samples == 64);
    let (again, took) = made_of(folder.path(), &rays, 64);
    assert!(took.is_none() && again.picture == made.picture && again.own_error == made.own_error);
    for case in [&rays, &raster] {
        let error = compare(case, &picture);
        let (found, own_error) = error.found().unwrap_or_else(|| panic!("{error:?}"));
        assert!(own_error == made.own_error && found.rmse == rmse(&picture, &made.picture), "{error:?}");
    }
    // The number of samples of a case does not affect its reference; its camera and its size do.
    let smooth = Case {
        settings: Settings { aa: PixelSamples::new(4).expect("four"), ..rays.settings.clone() },
        ..rays.clone()
    };
    assert!(compare(&smooth, &picture).found().is_some());
    let others = [of_size([20, 16], "Vidro", &[]), of_size([16, 16], "MainCamera", &[])];
    for settings in others {
        let other = case("SceneShadows.xml", settings);
        assert!(matches!(compare(&other, &frame(&other, 1)), RowError::Missing(_)));
    }
    // Every raster effect has the reference of the corresponding ray program.
    for (rays, raster) in [
        ("SceneReflect.xml", "raster/SceneCubeReflect.xml"),
        ("SceneReflect.xml", "raster/ScenePlanarReflect.xml"),
        ("SceneReflect.xml", "raster/SceneScreenReflect.xml"),
        ("SceneRefract.xml", "raster/SceneCubeRefract.xml"),
        ("SceneRefract.xml", "raster/SceneScreenRefract.xml"),
        ("SceneSSAO.xml", "raster/SceneGTAO.xml"),
        ("SceneSSAO.xml", "raster/SceneDepthOcclusion.xml"),
    ] {
        let [rays, raster] = [rays, raster].map(|name| case(name, of_size([4, 4], "Vidro", &[])));
        let (made, _) = made_of(folder.path(), &rays, 64);
        let mut references = references(folder.path());
        let found = references.picture(&raster, &mut Silent).unwrap_or_else(|error| panic!("{raster:?}: {error}"));
        assert_eq!(found.key, made.key);
    }
    let shorter = case("SceneSSAO.xml", of_size([4, 4], "Vidro", &["pass2.radius=0.25"]));
    let missing = references(folder.path()).picture(&shorter, &mut Silent).expect_err("another radius");
    assert!(matches!(missing, ReferenceError::NoPicture(_)), "{missing}");
    // A better reference replaces the first one. A damaged one is reported and not used.
    let (better, took) = made_of(folder.path(), &rays, 128);
    assert!(took.is_some() && better.samples == 128 && better.own_error < made.own_error);
    let kept = folder.path().join("pictures");
    let old = kept.join(format!("{}.exr", made.key));
    assert!(!old.exists() && kept.join(format!("{}.exr", better.key)).exists());
    std::fs::write(kept.join(format!("{}.exr", better.key)), "damaged").expect("written");
    let mut damaged = references(folder.path());
    let error = damaged.compare_picture(&rays, &picture, &mut Silent).expect("compared");
    assert!(matches!(error, RowError::Missing(_)) && damaged.take_warnings().len() == 1, "{error:?}");
}

#[test]
fn a_disc_has_a_reference_of_its_own_whatever_samples_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |name, set: &[&str]| case(name, of_size([20, 16], "MainCamera", set));
    let (made, _) = made_of(folder.path(), &of("SceneShadows.xml", &["pass2.sun=8"]), 64);
    let find = |case: &Case| references(folder.path()).picture(case, &mut Silent).map(|found| found.key.clone());
    for (name, set) in [
        ("SceneShadows.xml", &["pass2.sun=8", "pass2.sunsamples=2", "pass2.filter=1"][..]),
        ("raster/SceneShadowMap.xml", &["pass2.sun=8", "pass2.mapsize=256"]),
    ] {
        assert_eq!(find(&of(name, set)).unwrap_or_else(|error| panic!("{name}: {error}")), made.key);
    }
    for set in [&["pass2.sun=7"][..], &[]] {
        let missing = find(&of("SceneShadows.xml", set)).expect_err("another light");
        assert!(matches!(missing, ReferenceError::NoPicture(_)), "{missing}");
    }
    let (hard, _) = made_of(folder.path(), &of("SceneShadows.xml", &[]), 64);
    // Both take the same samples of each pixel, so only the light differs.
    let apart = rmse(&hard.picture, &made.picture);
    assert!(apart > 0.003, "control: {apart}");
}

#[test]
fn what_it_does_not_know_is_refused_with_the_pass_and_the_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, set, expected) in [
        ("camera/SquareShadows.xml", &[][..], "whose rays start at the camera"),
        ("glass/Caustics.xml", &[], "shadow=straight"),
        ("SceneFinal.xml", &["pass2.shadow=straight"], "shadow=report"),
    ] {
        let set = set.iter().map(|set| (*set).to_owned()).collect();
        let case = case(name, Settings { size: Some([8, 8]), set, ..Settings::default() });
        let error = make(folder.path(), &case, 64, Shard::WHOLE).expect_err(name);
        assert!(matches!(error, ReferenceError::Picture(_)), "{name}: {error}");
        assert!(error.to_string().contains(expected), "{name}: {error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0);
}

/// Runs the program in a folder, with references in its folder `cache`. Returns the exit code and the output.
fn run_in(folder: &Path, words: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    let command = command.current_dir(folder).env("CURITIBA_CACHE", folder.join("cache"));
    let output = command.args(words).output().expect("it runs");
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    (output.status.code(), text)
}

/// A reference has the same bits and the sequences of all samples, whether it is rendered by shards, by one process, or by
/// one that continues what shards left.
#[test]
fn references_in_blocks_are_the_same_whoever_renders_them() {
    let case = case("SceneSSAO.xml", of_size([6, 4], "Vidro", &[]));
    for (of, samples, blocks) in [(Of::Picture, 4096, 4), (Of::Effect, 16_384, 4)] {
        let of_shard = |folder: &Path, samples: u32, shard: Shard| {
            references(folder).make(&case, of, samples, shard, &mut Silent).expect("rendered")
        };
        let whole = |folder: &Path, samples: u32| match of_shard(folder, samples, Shard::WHOLE) {
            Made::Whole(reference, _) => reference,
            Made::Part(part) => panic!("{part:?}"),
        };
        let folders = [(); 4].map(|()| tempfile::tempdir().expect("a folder"));
        let [alone, shared, goes_on, fewer] = folders.each_ref().map(tempfile::TempDir::path);
        let once = whole(alone, samples);
        for index in [2, 0, 1] {
            let made = of_shard(shared, samples, Shard { index, count: 3 });
            assert!(matches!(made, Made::Part(Part { found: 0, .. })), "{made:?}");
        }
        let Made::Part(part) = of_shard(shared, samples, Shard { index: 1, count: 2 }) else { panic!("a part") };
        assert_eq!(part, Part { blocks, mine: 2, found: 2, kept: 4 });
        of_shard(goes_on, samples, Shard { index: 0, count: 2 });
        for joined in [whole(shared, samples), whole(goes_on, samples)] {
            assert!(joined.picture == once.picture && joined.own_error.to_bits() == once.own_error.to_bits());
            assert_eq!(joined.key, once.key);
        }
        // The whole reference is better than one of its blocks, and differs from it by no more than the block's error.
        let block = whole(fewer, samples / blocks);
        let apart = rmse(&block.picture, &once.picture);
        println!("{of:?}: apart {apart:.2e}, own errors {:.2e} and {:.2e}", block.own_error, once.own_error);
        assert!(once.own_error < block.own_error && apart < 3.0 * block.own_error && apart > 0.0);
    }
}

#[test]
fn shards_of_a_reference_are_commands_and_a_benchmark_finds_what_is_joined() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |words: &[&str]| run_in(folder.path(), words);
    let path = project("SceneSSAO.xml");
    let path = path.to_str().expect("a path");
    let shard = |shard: &str| {
        run(&["reference", path, "--of", "effect", "--size", "6x4", "--samples", "16384", "--shard", shard])
    };
    let (code, text) = shard("1/2");
    assert!(code == Some(0) && text.contains("shard 1/2: 2 of 4 blocks, 0 of them were there"), "{text}");
    let (code, text) = shard("1/2");
    assert!(code == Some(0) && text.contains("2 of 4 blocks, 2 of them were there"), "{text}");
    let (_, text) = shard("2/2");
    assert!(text.contains("4 of 4 blocks are in"), "{text}");
    let (code, text) =
        run(&["reference", path, "--of", "effect", "--size", "6x4", "--samples", "16384", "-o", "right.exr"]);
    assert!(code == Some(0) && text.contains("mean of 2 renders of 16384 samples"), "{text}");
    assert_eq!(
        std::fs::read_dir(folder.path().join("cache")).expect("the folder").count(),
        2,
        "joined blocks are gone"
    );
    let key = text.split("kept as ").nth(1).and_then(|rest| rest.split(' ').next()).expect("its key").to_owned();
    let mut words = vec!["bench", path, "--size", "6x4", "--frames", "1", "--raster", "cpu", "--backend", "cpu"];
    words.extend(["--reference-samples", "16384", "--json", "rows.json"]);
    let (code, text) = run(&words);
    assert_eq!(code, Some(0), "{text}");
    let json = std::fs::read_to_string(folder.path().join("rows.json")).expect("written");
    assert!(json.contains(&key), "{key} in {json}");
    for (words, said) in [
        (&["reference", path, "--shard", "1/2", "-o", "x.png"][..], "cannot be used with"),
        (&["reference", path, "--shard", "3/2"], "is no shard"),
        (&["reference", path, "--of", "frame"], "picture, effect"),
    ] {
        let (code, text) = run(words);
        assert!(code == Some(2) && text.contains(said), "{text}");
    }
    let shadows = project("SceneShadows.xml");
    let (code, text) = run(&["reference", shadows.to_str().expect("a path"), "--of", "effect"]);
    assert!(code == Some(2) && text.contains("no noise"), "{text}");
}

#[test]
fn the_command_makes_it_and_a_benchmark_finds_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |words: &[&str]| run_in(folder.path(), words);
    let path = project("SceneShadows.xml");
    let path = path.to_str().expect("a path");
    let bench = |name: &str| {
        let (code, text) = run(&[
            "bench",
            path,
            "--size",
            "20x16",
            "--frames",
            "1",
            "--raster",
            "cpu",
            "--backend",
            "cpu",
            "--json",
            name,
        ]);
        assert_eq!(code, Some(0), "{text}");
        let json = std::fs::read_to_string(folder.path().join(name)).expect("written");
        let value: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        (text, value["rows"][0]["picture_error"].clone())
    };
    let (text, error) = bench("before.json");
    assert!(error["missing"].as_str().is_some_and(|why| why.contains("curitiba reference")), "{error}");
    assert!(text.contains("picture: the reference of the picture is not made"), "{text}");
    let (code, text) = run(&["reference", path, "--size", "20x16", "-o", "right.png"]);
    assert!(code == Some(0) && text.contains("standard error") && folder.path().join("right.png").exists(), "{text}");
    let (text, error) = bench("after.json");
    let rmse = error["against"]["comparison"]["rmse"].as_f64().expect("an error");
    assert!(rmse > 0.0 && text.contains(&format!("{rmse:.4}")), "{text}");
    let (code, text) = run(&["reference", path, "--size", "20x16"]);
    assert!(code == Some(0) && text.contains("kept already"), "{text}");
    let operand = |settings: &str| format!("{path}@size=20x16,{settings}");
    let compare = [operand("raster=cpu,backend=cpu"), operand("reference=picture")];
    let (code, text) = run(&["compare", &compare[0], &compare[1], "--json"]);
    assert!(code == Some(0) && text.contains(&format!("\"rmse\": {rmse}")), "{rmse}: {text}");
    let (code, text) = run(&["compare", &compare[0], &operand("reference=picture,camera=Vidro")]);
    assert!(code == Some(2) && text.contains("curitiba reference") && text.contains("--camera Vidro"), "{text}");
    let (code, text) = run(&["reference", path, "--samples", "63"]);
    assert!(code == Some(2) && text.contains("powers of two"), "{text}");
}
