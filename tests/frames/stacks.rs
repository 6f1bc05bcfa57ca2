//! Every program on many threads with small stacks does not crash, and gives the same picture bit for bit.
//!
//! A worker of the thread pool that waits for a part of its work runs other work meanwhile, on the same stack. So the stack
//! holds the data of several jobs at once, and the more threads share the work, the deeper the stack gets.

use curitiba::Choice;
use curitiba::bench::Case;
use curitiba::passes::cpu::CpuRays;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::executor::{Engines, Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project;
use curitiba::pipeline::scene::{BuildOptions, LoadOptions, RenderScene, load};
use curitiba::reference::{Made, Of, References};
use curitiba::shard::Shard;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Stack size of each thread in bytes: an eighth of Rust's default.
const STACK: usize = 256 << 10;

/// Stack size for bodies of glass: a path is followed by recursion and meets up to 128 surfaces, each of which takes about 1.6 KiB.
/// The stack holds only one path at a time, because a path runs no other work meanwhile.
const STACK_OF_GLASS: usize = 512 << 10;

/// Pixels along a side: enough for the tiles to be divided many times over 64 threads.
const SIDE: u32 = 400;

/// Pixels along a side for the programs that are not in the report: enough tiles for each of 64 threads to have one.
const SMALL_SIDE: u32 = 128;

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name)
}

/// Runs work on the threads of a pool with small stacks.
fn on_small_stacks<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    on_stacks(STACK, threads, work)
}

fn on_stacks<T: Send>(bytes: usize, threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(bytes).build().expect("threads");
    pool.install(work)
}

/// Loads a project and renders frames, all on the threads of one pool.
fn render<const FRAMES: usize>(
    name: &str,
    side: u32,
    fidelity: Fidelity,
    set: &[&str],
    threads: usize,
) -> [Image; FRAMES] {
    let stack = if name.starts_with("glass/") { STACK_OF_GLASS } else { STACK };
    on_stacks(stack, threads, || {
        let set = set.iter().map(|one| (*one).to_owned()).collect();
        let settings = Settings { size: Some([side, side]), fidelity, set, ..Settings::default() };
        let plan = Plan::new(project::load(&shipped(name)).expect("the project loads"), settings);
        let plan = plan.unwrap_or_else(|error| panic!("{name} {fidelity:?}: {error}"));
        let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new()));
        let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("the scene loads");
        [(); FRAMES].map(|()| renderer.frame(&mut Silent).expect("the frame renders"))
    })
}

fn bits(image: &Image) -> Vec<[u32; 4]> {
    image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn is_the_same_on_any_number_of_threads(name: &str) {
    let set = match name {
        "SSAO" | "Final" => &["pass2.samples=4"][..],
        _ => &[],
    };
    let render = |fidelity, threads| render::<2>(&format!("Scene{name}.xml"), SIDE, fidelity, set, threads);
    for fidelity in [Fidelity::Corrected, Fidelity::Thesis] {
        let [alone, again] = render(fidelity, 1);
        assert!(bits(&alone) == bits(&again), "{name} {fidelity:?}: the second frame differs");
        for threads in [3, 16, 64] {
            for frame in render(fidelity, threads) {
                assert!(bits(&alone) == bits(&frame), "{name} {fidelity:?}: {threads} threads give another picture");
            }
        }
    }
}

macro_rules! programs {
    ($($test:ident: $name:literal;)*) => {
        $(#[test]
        fn $test() {
            is_the_same_on_any_number_of_threads($name);
        })*
    };
}

programs! {
    no_effects_on_small_stacks: "NoEffects";
    dummy_on_small_stacks: "Dummy";
    shadows_on_small_stacks: "Shadows";
    reflection_on_small_stacks: "Reflect";
    refraction_on_small_stacks: "Refract";
    ambient_occlusion_on_small_stacks: "SSAO";
    all_effects_on_small_stacks: "Final";
}

const CORRECTED: &[Fidelity] = &[Fidelity::Corrected];
const BOTH: &[Fidelity] = &[Fidelity::Corrected, Fidelity::Thesis];

/// A project below `xml_projects`, the fidelities that it can be rendered in, and its settings.
type Program = (&'static str, &'static [Fidelity], &'static [&'static str]);

fn are_the_same_on_any_number_of_threads(programs: &[Program]) {
    for (name, fidelities, set) in programs {
        for fidelity in *fidelities {
            let [alone] = render(name, SMALL_SIDE, *fidelity, set, 1);
            let [first, rest @ ..] = &alone.pixels[..] else { panic!("{name}: no pixels") };
            assert!(rest.iter().any(|pixel| pixel != first), "{name} {set:?} {fidelity:?}: nothing is drawn");
            for threads in [16, 64] {
                let [frame] = render(name, SMALL_SIDE, *fidelity, set, threads);
                let same = bits(&alone) == bits(&frame);
                assert!(same, "{name} {set:?} {fidelity:?}: {threads} threads give another picture");
            }
        }
    }
}

#[test]
fn rays_from_the_camera_on_small_stacks() {
    // Thesis fidelity lacks these programs.
    are_the_same_on_any_number_of_threads(&[
        ("camera/SquareColors.xml", CORRECTED, &[]),
        ("camera/SquareLit.xml", CORRECTED, &[]),
        ("camera/SquareOcclusion.xml", CORRECTED, &["pass1.samples=4"]),
        ("camera/SquareShadows.xml", CORRECTED, &["pass1.samples=1"]),
        ("camera/RoomMirrors.xml", CORRECTED, &["pass1.samples=1"]),
        ("camera/RoomGloss.xml", CORRECTED, &["pass1.samples=2"]),
        ("camera/RoomLens.xml", CORRECTED, &["pass1.samples=2"]),
        ("camera/RoomSoftShadows.xml", CORRECTED, &["pass1.samples=2"]),
        ("camera/RoomPaths.xml", CORRECTED, &["pass1.samples=2"]),
    ]);
}

#[test]
fn raster_effects_on_small_stacks() {
    are_the_same_on_any_number_of_threads(&[
        ("raster/SceneCubeReflect.xml", BOTH, &["pass2.mapsize=64", "pass2.probes=1"]),
        ("raster/SceneCubeRefract.xml", BOTH, &["pass2.mapsize=64", "pass2.probes=1", "pass2.parallax=box"]),
        ("raster/SceneDepthOcclusion.xml", BOTH, &[]),
        ("raster/SceneGTAO.xml", BOTH, &[]),
        ("raster/SceneGTAO.xml", CORRECTED, &["pass2.bitmask=true", "pass2.filter=2"]),
        ("raster/ScenePlanarReflect.xml", BOTH, &[]),
        ("raster/SceneScreenReflect.xml", BOTH, &["pass2.mapsize=64", "pass2.probes=1"]),
        ("raster/SceneScreenRefract.xml", CORRECTED, &["pass2.missing=rays", "pass2.texturelod=cones"]),
        ("raster/SceneShadowMap.xml", BOTH, &["pass2.mapsize=256"]),
        ("raster/SceneShadowMap.xml", CORRECTED, &["pass2.mapsize=256", "pass2.sun=2"]),
    ]);
}

#[test]
fn glass_on_small_stacks() {
    let few = &["pass2.samples=1"];
    are_the_same_on_any_number_of_threads(&[
        ("glass/balls.xml", BOTH, few),
        ("glass/filled.xml", CORRECTED, few),
        ("glass/panes.xml", CORRECTED, few),
        ("glass/Spheres.xml", CORRECTED, few),
        ("glass/Shells.xml", CORRECTED, few),
        ("glass/Frosted.xml", CORRECTED, &["pass2.samples=2", "pass2.paths=4"]),
        ("glass/Prism.xml", CORRECTED, &["pass2.samples=2", "pass2.wavelengths=4"]),
        ("glass/Caustics.xml", CORRECTED, &["pass2.samples=2", "pass2.sunsamples=4"]),
        (
            "glass/MeshCaustics.xml",
            CORRECTED,
            &["pass2.samples=2", "pass2.sunsamples=4", "pass2.wavelengths=2", "pass2.photons=20000"],
        ),
    ]);
}

#[test]
fn soft_shadows_filters_and_cones_on_small_stacks() {
    are_the_same_on_any_number_of_threads(&[
        ("SceneShadows.xml", CORRECTED, &["pass2.sun=2", "pass2.sunsamples=4", "pass2.filter=1"]),
        ("SceneSSAO.xml", CORRECTED, &["pass2.samples=4", "pass2.filter=2"]),
        ("SceneReflect.xml", CORRECTED, &["pass2.texturelod=cones"]),
        ("SceneRefract.xml", CORRECTED, &["pass2.texturelod=cones"]),
        ("SceneFinal.xml", CORRECTED, &["pass2.samples=4", "pass2.texturelod=cones"]),
    ]);
}

/// The loader of OBJ files divides them into pieces of at least 64 KiB, and textures are decoded in parallel.
#[test]
fn loading_on_small_stacks() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("s.obj");
    let (side, mut text) = (220, String::from("mtllib s.mtl\n"));
    for i in 0..side * side {
        text += &format!("v {} {} {}\nvt {} {}\n", i % side, i / side, i % 7, i % 3, i % 5);
    }
    let mut library = String::new();
    for (material, extension) in ["png", "jpg", "tga", "bmp", "tiff", "webp"].into_iter().enumerate() {
        let texel = |x, y| image::Rgb([x as u8, y as u8, material as u8]);
        let texture = format!("t.{extension}");
        image::RgbImage::from_fn(64, 64, texel).save(folder.path().join(&texture)).expect("written");
        library += &format!("newmtl m{material}\nmap_Kd {texture}\n");
    }
    for i in (1..side * (side - 1)).filter(|i| i % side != 0) {
        let [a, b, c] = [i, i + 1, i + side];
        text += &format!("usemtl m{}\nf {a}/{a} {b}/{b} {c}/{c}\n", i / side % 6);
    }
    assert!(text.len() > 32 << 16, "at least 32 pieces, not {} bytes", text.len());
    std::fs::write(&path, text).expect("written");
    std::fs::write(folder.path().join("s.mtl"), library).expect("written");
    let read = || {
        let scene = load(std::slice::from_ref(&path), &LoadOptions::default(), &|_| {}).expect("it loads");
        let (scene, warnings) = RenderScene::build(scene, &BuildOptions::default()).expect("it is built");
        assert!(warnings.is_empty() && scene.textures.len() == 6, "{warnings:?}");
        scene.fingerprint()
    };
    let alone = on_small_stacks(1, read);
    for threads in [16, 64] {
        assert_eq!(on_small_stacks(threads, read), alone, "{threads} threads load another scene");
    }
}

/// The reference of the picture, in f64.
#[test]
fn references_on_small_stacks() {
    let picture = |threads: usize| {
        on_small_stacks(threads, || {
            let folder = tempfile::tempdir().expect("a folder");
            let settings = Settings { size: Some([64, 64]), ..Settings::default() };
            let case = Case::new(&shipped("SceneFinal.xml"), settings, Choice::CPU).expect("a valid project");
            let mut references = References::new(folder.path().to_owned(), Duration::ZERO);
            match references.make(&case, Of::Picture, 4, Shard::WHOLE, &mut Silent).expect("rendered") {
                Made::Whole(reference, _) => reference.picture,
                Made::Part(part) => panic!("{part:?}"),
            }
        })
    };
    let alone = picture(1);
    for threads in [16, 64] {
        assert!(bits(&alone) == bits(&picture(threads)), "{threads} threads give another reference");
    }
}
