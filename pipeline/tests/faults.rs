//! Tests of failing files. Every loader runs with a reader that fails or ends early, at each of its calls in turn. Such a load must be
//! refused, warn of what is missing, or give the whole result. Writers run with a disk that becomes full at each of their calls in turn.

#[allow(dead_code, reason = "only the seeds are of use here")]
mod fuzz_targets;
mod scene_support;
#[allow(dead_code, reason = "only the seeds of scenes and textures are of use here")]
#[path = "fuzz_targets/seeds.rs"]
mod seeds;

use curitiba_pipeline::files::fault::{Armed, Fault, arm};
use curitiba_pipeline::files::{Resumable, write_atomically};
use curitiba_pipeline::image::{Image, Layer, read_image, write_exr, write_png};
use curitiba_pipeline::project::{self, SceneOptions};
use curitiba_pipeline::scene::{BuildOptions, Layout, LoadOptions, RenderScene, load, write_cbo};
use curitiba_pipeline::square;
use scene_support::Folder;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Result of a load.
enum Outcome {
    Refused,
    /// Description of what was loaded, and the warnings.
    Loaded(String, Vec<String>),
}

/// Number of faults by their effect, for one loader.
#[derive(Default)]
struct Count {
    tried: u64,
    refused: u64,
    warned: u64,
    /// The result was unchanged: the failed call was repeated, or was not needed.
    same: u64,
}

/// Loads with a fault at each call of the reader in turn; only files of `folder` can fail.
fn try_all(name: &str, folder: &Path, load: &dyn Fn() -> Outcome) {
    let Outcome::Loaded(whole, known) = load() else { panic!("{name} cannot be loaded without a fault") };
    for fault in [Fault::ReadFails, Fault::ReadEndsEarly] {
        let mut count = Count::default();
        for at in 0.. {
            let armed = arm(folder, fault, at);
            let outcome = load();
            if armed.struck() == 0 {
                break;
            }
            count.tried += 1;
            match outcome {
                Outcome::Refused => count.refused += 1,
                Outcome::Loaded(_, warnings) if warnings.iter().any(|warning| !known.contains(warning)) => {
                    count.warned += 1;
                }
                Outcome::Loaded(loaded, _) => {
                    assert!(loaded == whole, "{name}: {fault:?} at call {at} was not noticed");
                    count.same += 1;
                }
            }
        }
        assert!(count.tried > 0, "{name}: no call was counted");
        let what = if fault == Fault::ReadFails { "a read fails" } else { "the file ends early" };
        let Count { tried, refused, warned, same } = count;
        println!("| {name} | {what} | {tried} | {refused} | {warned} | {same} |");
    }
}

fn scene(path: PathBuf) -> impl Fn() -> Outcome {
    move || {
        let loaded = load(std::slice::from_ref(&path), &LoadOptions::default(), &|_| {});
        let built = loaded.and_then(|mut scene| {
            let mut warnings = std::mem::take(&mut scene.warnings);
            let told = format!("{:?} {:?} {:?}", scene.meshes, scene.materials, scene.objects);
            let (built, more) = RenderScene::build(scene, &BuildOptions::default())?;
            warnings.append(more);
            Ok((format!("{told} {:?} {:?}", built.materials, built.textures), warnings))
        });
        match built {
            Ok((told, warnings)) => Outcome::Loaded(told, warnings.groups().iter().map(ToString::to_string).collect()),
            Err(_) => Outcome::Refused,
        }
    }
}

fn picture(path: PathBuf) -> impl Fn() -> Outcome {
    move || read_image(&path).map_or(Outcome::Refused, |picture| Outcome::Loaded(format!("{picture:?}"), Vec::new()))
}

const TRIANGLE: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n\
                        usemtl b\nf 1/1 3/3 2/2\n";

/// A picture in which no two rows are equal.
fn numbered(side: u32) -> Image {
    let pixels = (0..side * side).map(|i| [(i % 7) as f32 / 7.0, (i % 31) as f32 / 31.0, 0.5, 1.0]).collect();
    Image { width: side, height: side, pixels }
}

/// An OBJ file with a library and two textures, one of them with a mask.
fn obj(folder: &Folder) -> PathBuf {
    let texels =
        image::RgbaImage::from_fn(40, 40, |x, y| image::Rgba([x as u8, y as u8, 9, if x < 20 { 0 } else { 255 }]));
    let texture = folder.write("t.png", []);
    texels.save(&texture).expect("written");
    image::DynamicImage::from(texels).into_rgb8().save(folder.path("u.bmp")).expect("written");
    folder.write("m.mtl", "newmtl a\nmap_Kd t.png\nmap_d t.png\nnewmtl b\nKd 1 0 0\nmap_Kd u.bmp\n");
    folder.write("s.obj", TRIANGLE)
}

#[test]
fn a_fault_at_any_read_of_any_loader_is_an_error_or_a_warning() {
    println!(
        "| loader | fault | faults tried | refused | loaded with a warning | loaded whole |\n|---|---|---:|---:|---:|---:|"
    );
    let folder = Folder::new();
    let root = folder.path("");
    let obj = obj(&folder);
    try_all("OBJ, MTL and textures", &root, &scene(obj.clone()));

    let loaded = load(&[obj], &LoadOptions::default(), &|_| {}).expect("it loads");
    for (name, file, layout) in [("CBO", "s.cbo", Layout::Cbo2014), ("NBO", "s.nbo", Layout::NboToday)] {
        write_cbo(&loaded, &folder.path(file), layout).expect("written");
        try_all(name, &root, &scene(folder.path(file)));
    }

    let floats: Vec<u8> = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
        .as_flattened()
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    folder.write("b.bin", floats);
    let gltf = folder.write(
        "s.gltf",
        r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "b.bin", "byteLength": 36}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "images": [{"uri": "t.png"}], "textures": [{"source": 0}],
            "materials": [{"name": "m", "alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
            "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}"#,
    );
    try_all("glTF, its buffer and texture", &root, &scene(gltf));

    let texels = image::DynamicImage::from(image::open(folder.path("t.png")).expect("a picture").into_rgb8());
    for extension in ["jpg", "tga", "tiff", "bmp", "webp"] {
        let name = format!("v.{extension}");
        texels.save(folder.path(&name)).expect("written");
        folder.write("v.mtl", format!("newmtl a\nmap_Kd {name}\n"));
        let obj = folder.write("v.obj", TRIANGLE.replace("m.mtl", "v.mtl"));
        try_all(&format!("a texture, .{extension}"), &root, &scene(obj));
    }

    let (png, exr) = (folder.path("p.png"), folder.path("p.exr"));
    write_png(&png, &numbered(30)).expect("written");
    write_exr(&exr, Layer { name: "window", channels: ["R", "G", "B", "A"], image: &numbered(30) }).expect("written");
    try_all("a picture, .png", &root, &picture(png));
    try_all("a picture, .exr", &root, &picture(exr));

    let xml = folder.write("p.xml", include_str!("fuzz_targets/everything.xml"));
    folder.write("everything.mlib", include_str!("fuzz_targets/everything.mlib"));
    try_all("a project and its library", &root, &opened(xml));
}

fn opened(path: PathBuf) -> impl Fn() -> Outcome {
    move || match project::open(&path, &SceneOptions::default(), None, 1 << 30) {
        Ok(project) => {
            let told = format!("{:?}", (&project.targets, &project.pipelines, &project.cameras, &project.scenes));
            Outcome::Loaded(told, project.problems.0.iter().map(ToString::to_string).collect())
        }
        Err(_) => Outcome::Refused,
    }
}

#[test]
fn a_fault_at_any_read_of_other_formats_is_an_error_or_a_warning() {
    let folder = Folder::new();
    let root = folder.path("");
    folder.write("t.tga", fuzz_targets::tga(&[[200, 10, 20, 255], [10, 200, 20, 90]]));
    for (name, target, seed) in [
        ("3DS", "studio", "square.3ds"),
        ("COLLADA and its texture", "collada", "square.dae"),
        ("Ogre XML", "ogre", "square.mesh.xml"),
        ("GLB", "gltf", "binary.glb"),
        ("GLB with Draco", "gltf", "draco.glb"),
        ("GLB with meshopt", "gltf", "meshopt.glb"),
    ] {
        let seeds = seeds::of(target);
        let (_, bytes) = seeds.iter().find(|(name, _)| *name == seed).expect("a seed");
        try_all(name, &root, &scene(folder.write(seed, bytes)));
    }

    let seeds = seeds::of("texture");
    let (_, bytes) = seeds.iter().find(|(name, _)| *name == "dxt1.dds").expect("a seed");
    folder.write("v.dds", bytes);
    folder.write("v.mtl", "newmtl a\nmap_Kd v.dds\n");
    try_all("a texture, .dds", &root, &scene(folder.write("v.obj", TRIANGLE.replace("m.mtl", "v.mtl"))));

    // The first bytes of a file without an extension determine its format.
    let (_, glb) = &seeds::of("gltf")[2];
    try_all("a scene without an extension", &root, &opened(folder.write("scene", glb)));
    folder.write("everything.mlib", fuzz_targets::LIBRARY);
    try_all("a project without an extension", &root, &opened(folder.write("project", fuzz_targets::PROJECT)));
}

#[cfg(feature = "glsl")]
#[test]
fn a_fault_at_any_read_of_own_shaders_is_an_error() {
    let folder = Folder::new();
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../xml_projects/shaders");
    for file in ["Bands.xml", "Bands.mlib", "glsl/bands.vert", "glsl/bands.frag"] {
        folder.write(file, std::fs::read(shipped.join(file)).expect("a file of the project"));
    }
    try_all("own GLSL", &folder.path(""), &opened(folder.path("Bands.xml")));
}

/// Runs a writer with a disk that becomes full at each of its calls in turn, or at every `step`-th one. Afterwards each file of `names`
/// must hold its old or its new contents, and no temporary file may exist.
fn fill_disk(name: &str, folder: &Folder, names: &[&str], step: usize, write: &dyn Fn() -> Result<(), String>) {
    let before = |file: &str| format!("before {file}").into_bytes();
    let reset = || names.iter().for_each(|file| drop(folder.write(file, before(file))));
    reset();
    write().expect("there is room");
    let after: Vec<Vec<u8>> = names.iter().map(|file| std::fs::read(folder.path(file)).expect("written")).collect();
    let (mut tried, mut old, mut new) = (0_u64, 0_u64, 0_u64);
    for at in (0..).step_by(step) {
        reset();
        let armed: Armed = arm(&folder.path(""), Fault::DiskFull, at);
        let result = write();
        let struck = armed.struck();
        drop(armed);
        if struck == 0 {
            break;
        }
        tried += 1;
        let message = result.expect_err("the disk is full");
        assert!(message.contains("no space left"), "{message}");
        for (file, after) in names.iter().zip(&after) {
            let found = std::fs::read(folder.path(file)).expect("there");
            assert!(found == before(file) || found == *after, "{name}: {file} is neither old nor new after call {at}");
            *(if found == *after { &mut new } else { &mut old }) += 1;
        }
        assert_eq!(temporaries(&folder.path("")), [""; 0], "{name}: left behind after call {at}");
    }
    assert!(tried > 0, "{name}: no call was counted");
    println!("| {name} | the disk is full | {tried} | {old} files as before, {new} whole new ones, none else |");
}

/// Names of temporary files in a folder and its subfolders.
fn temporaries(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry")) {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with(".curitiba-") {
            found.push(name);
        } else if entry.path().is_dir() {
            found.extend(temporaries(&entry.path()));
        }
    }
    found
}

#[test]
fn a_full_disk_leaves_every_file_as_it_was_or_whole() {
    println!("| writer | fault | faults tried | outcome |\n|---|---|---:|---|");
    let folder = Folder::new();
    let text = |error: std::io::Error| error.to_string();
    fill_disk("any file", &folder, &["a"], 1, &|| write_atomically(&folder.path("a"), &[7; 5000]).map_err(text));
    fill_disk("a file of several runs", &folder, &["b"], 1, &|| {
        // Continues the file that an earlier fault left behind.
        let file = Resumable::at(&folder.path("b")).map_err(text)?;
        let [mut part, mut journal] = file.open().map_err(|(_, error)| text(error))?;
        part.shorten(0).map_err(text)?;
        for block in 0..3 {
            part.write_all(&[block; 5000]).map_err(text)?;
            journal.write_all(b"5000\n").map_err(text)?;
        }
        file.commit(part).map_err(text)
    });
    assert!(!folder.path("b.part").exists() && !folder.path("b.part.journal").exists());
    let picture = numbered(64);
    fill_disk("a picture, .png", &folder, &["a.png"], 1, &|| write_png(&folder.path("a.png"), &picture).map_err(text));

    let scenes = Folder::new();
    let png = std::fs::read(scenes.png("x.png", 3, 3, [1, 2, 3, 255])).expect("written");
    let mut scene = load(&[obj(&scenes)], &LoadOptions::default(), &|_| {}).expect("it loads");
    scene.textures[0] = curitiba_pipeline::scene::TextureSource::Embedded { name: "t".to_owned(), bytes: png.into() };
    // More vertices than the writer's buffer holds.
    scene.meshes[0].positions.resize(3000, glam::Vec3::ONE);
    scene.meshes[0].normals.clear();
    scene.meshes[0].texcoords.clear();
    fill_disk("`scene`, with a texture beside it", &folder, &["o.cbo", "o.texture0.png"], 1, &|| {
        write_cbo(&scene, &folder.path("o.cbo"), Layout::Cbo2014).map(drop).map_err(|error| error.to_string())
    });

    let square = Folder::new();
    fill_disk("`scene --generate`", &square, &["q/largoCamoes.cbo"], 23, &|| {
        square::generate(10_000).write(&square.path("q")).map(drop).map_err(|error| error.to_string())
    });
}
