//! Runs the fuzz targets of `fuzz/` with a few hundred mutations each, and with all inputs that once broke a target.
//! `docs/robustness.md` records the long runs.

mod fuzz_targets;
#[path = "fuzz_targets/mutate.rs"]
mod mutate;
#[cfg(feature = "glsl")]
#[path = "fuzz_targets/script.rs"]
mod script;
#[path = "fuzz_targets/seeds.rs"]
mod seeds;
#[cfg(feature = "glsl")]
#[path = "fuzz_targets/shader.rs"]
mod shader;

use curitiba_pipeline::image::{Image, Picture, Variance};
use curitiba_pipeline::scene::{BuildOptions, LoadOptions, Object, RenderScene, Scene, load};
use fuzz_targets::check::{self, Outcome};
use fuzz_targets::{Folder, TARGETS, Target, picture};
use glam::{Mat4, Vec3};
use mutate::{Tally, run, run_one};
use std::panic::catch_unwind;
use std::path::Path;

/// Number of mutations of each format; the environment variable `CURITIBA_FUZZ_ROUNDS` overrides it.
const ROUNDS: usize = 400;

fn rounds() -> usize {
    std::env::var("CURITIBA_FUZZ_ROUNDS").map_or(ROUNDS, |rounds| rounds.parse().expect("a number"))
}

/// A change to a value: its name for messages, and the function that makes it.
type Change<T> = (&'static str, fn(&mut T));

/// All targets that this build's features include.
fn targets() -> impl Iterator<Item = &'static Target> {
    #[cfg(feature = "glsl")]
    const WITH_FEATURES: &[Target] =
        &[Target { name: "shader", run: shader::shader }, Target { name: "script", run: script::script }];
    #[cfg(not(feature = "glsl"))]
    const WITH_FEATURES: &[Target] = &[];
    TARGETS.iter().chain(WITH_FEATURES)
}

fn seeds_of(target: &Target) -> Vec<Vec<u8>> {
    seeds::of(target.name).into_iter().map(|(_, bytes)| bytes).collect()
}

#[test]
fn every_seed_loads() {
    for target in targets() {
        for (name, bytes) in seeds::of(target.name) {
            assert_eq!((target.run)(&bytes), Outcome::Loaded, "{}: {name}", target.name);
        }
    }
}

#[test]
fn mutated_seeds_load_as_promised_or_are_refused() {
    for target in targets() {
        match run(target, &seeds_of(target), rounds()) {
            // The OBJ reader does not refuse a file: it skips and counts statements that it cannot read.
            Ok(tally) => assert!(
                tally.loaded > 0 && (tally.refused > 0 || target.name == "obj"),
                "{}: some damage is harmless, some is not: {tally:?}",
                target.name
            ),
            Err(finding) => {
                panic!("{}: {}\ninput: {}", target.name, finding.message, finding.input.escape_ascii());
            }
        }
    }
}

#[test]
fn inputs_that_once_broke_a_loader_do_so_no_more() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz_regressions");
    let mut inputs = 0;
    for target in targets() {
        let Ok(entries) = std::fs::read_dir(folder.join(target.name)) else { continue };
        for entry in entries {
            let path = entry.expect("an entry").path();
            let bytes = std::fs::read(&path).expect("an input");
            if let Err(finding) = run_one(target, &bytes, &mut Tally::default()) {
                panic!("{}: {}", path.display(), finding.message);
            }
            inputs += 1;
        }
    }
    assert!(inputs > 0, "{} holds the inputs", folder.display());
}

/// Control: the fuzzer finds a reader with a typical defect, which is to trust a count in the file.
#[test]
fn a_reader_that_believes_a_count_is_found_out() {
    fn careless(input: &[u8]) -> Outcome {
        let Some((count, rest)) = input.split_first() else { return Outcome::Refused };
        let sum: u32 = (0..usize::from(*count)).map(|index| u32::from(rest[index])).sum();
        if sum > 0 { Outcome::Loaded } else { Outcome::Refused }
    }
    let target = Target { name: "careless", run: careless };
    let seeds = [vec![4, 1, 2, 3, 4], vec![2, 7, 7]];
    assert!(seeds.iter().all(|seed| careless(seed) == Outcome::Loaded));
    let finding = run(&target, &seeds, ROUNDS).expect_err("the harness notices the panic");
    assert!(finding.message.contains("index out of bounds"), "{}", finding.message);
    assert!(catch_unwind(|| careless(&finding.input)).is_err(), "the input it gives breaks the reader again");
}

/// Control of the checks: scenes that each violate one guarantee are detected.
#[test]
fn scenes_that_break_a_promise_are_found_out() {
    let folder = Folder::new();
    let path = folder.write("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let whole = load(&[path], &LoadOptions::default(), &|_| {}).expect("a triangle");
    check::scene(&whole);
    let broken: [Change<Scene>; 7] = [
        ("an object without a mesh", |scene| scene.objects[0].mesh = 9),
        ("a group without a material", |scene| scene.meshes[0].groups[0].material = 9),
        ("a material without its texture", |scene| scene.materials[0].texture = Some(0)),
        ("a colour that is not a number", |scene| scene.materials[0].diffuse.x = f32::NAN),
        ("normals of another number", |scene| scene.meshes[0].normals = vec![Vec3::Z]),
        ("two materials of one name", |scene| scene.materials.push(scene.materials[0].clone())),
        ("an object of no file", |scene| {
            scene.objects.push(Object { name: String::new(), mesh: 0, transform: Mat4::IDENTITY });
        }),
    ];
    for (what, damage) in broken {
        let mut scene = whole.clone();
        damage(&mut scene);
        assert!(catch_unwind(|| check::scene(&scene)).is_err(), "{what} is not noticed");
    }

    let options = BuildOptions::default();
    let (built, _) = RenderScene::build(whole, &options).expect("it is built");
    check::render_scene(&built, &options);
    let broken: [Change<RenderScene>; 5] = [
        ("an index out of range", |built| built.geometry.triangles[0][1] = 3),
        ("a position that is not finite", |built| built.geometry.positions[0].x = f32::INFINITY),
        ("a normal that is not unit length", |built| built.geometry.normals[0] *= 1.01),
        ("a triangle without area", |built| built.geometry.triangles[0] = [0, 1, 1]),
        ("a triangle in no batch", |built| built.geometry.batches.clear()),
    ];
    for (what, damage) in broken {
        let mut built = built.clone();
        damage(&mut built);
        assert!(catch_unwind(|| check::render_scene(&built, &options)).is_err(), "{what} is not noticed");
    }
}

/// Control of the checks: pictures that each violate one guarantee are detected.
#[test]
fn pictures_that_break_a_promise_are_found_out() {
    let pixels = vec![[0.0, 1.0, 102.0 / 255.0, 1.0]; 6];
    let image = Image { width: 3, height: 2, pixels };
    let variance = Some(Variance { of_mean: image.clone(), samples: Some(2) });
    let whole =
        Picture { image, channels: ["R", "G", "B", "A"].map(str::to_owned), steps: Some(255), space: None, variance };
    picture::check(&whole);
    let broken: [Change<Picture>; 7] = [
        ("a pixel too few", |picture| picture.image.pixels.truncate(5)),
        ("no size", |picture| picture.image = Image { width: 0, height: 2, pixels: Vec::new() }),
        ("a value between two steps", |picture| picture.image.pixels[4][2] = 0.4001),
        ("a value above 1", |picture| picture.image.pixels[4][2] = 256.0 / 255.0),
        ("steps of no format", |picture| picture.steps = Some(1)),
        ("one sample", |picture| picture.variance.as_mut().expect("it is there").samples = Some(1)),
        ("a variance of another size", |picture| {
            let of_mean = &mut picture.variance.as_mut().expect("it is there").of_mean;
            std::mem::swap(&mut of_mean.width, &mut of_mean.height);
        }),
    ];
    for (what, damage) in broken {
        let mut picture = whole.clone();
        damage(&mut picture);
        assert!(catch_unwind(|| picture::check(&picture)).is_err(), "{what} is not noticed");
    }
}

/// Control of the round trip: scenes that differ after writing and reading are detected.
#[test]
fn scenes_that_differ_are_not_taken_for_the_same() {
    let folder = Folder::new();
    let path = folder.write("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let whole = load(&[path], &LoadOptions::default(), &|_| {}).expect("a triangle");
    check::same(&whole, &whole);
    let changes: [Change<Scene>; 5] = [
        ("a position", |scene| scene.meshes[0].positions[2].x = -0.0),
        ("a transform", |scene| scene.objects[0].transform = Mat4::from_scale(Vec3::splat(2.0))),
        ("a triangle", |scene| scene.meshes[0].groups[0].triangles[0] = [1, 2, 0]),
        ("a colour", |scene| scene.materials[0].emission.y = 0.5),
        ("an object", |scene| scene.objects.clear()),
    ];
    for (what, change) in changes {
        let mut other = whole.clone();
        change(&mut other);
        assert!(catch_unwind(|| check::same(&whole, &other)).is_err(), "{what} is not noticed");
    }
}
