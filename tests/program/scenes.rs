//! Scenes without a project: the command line's defaults for them, and whether the project written for a scene shows the
//! same picture.

use curitiba::pipeline::color::decode;
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::read_image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::project::{Project, SceneOptions, SceneProjects};
use curitiba::{Choice, RasterChoice};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn curitiba(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).args(arguments).env("NO_COLOR", "1").output().expect("the program starts")
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) -> String {
    let output = curitiba(folder, arguments);
    assert!(output.status.success(), "{arguments:?} failed:\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("output is UTF-8")
}

#[track_caller]
fn fails_with(code: i32, folder: &Path, arguments: &[&str]) -> String {
    let output = curitiba(folder, arguments);
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments:?} printed:\n{printed}");
    printed
}

/// A floor, a red block that casts a shadow on it, and a pane of glass in front.
fn obj(folder: &Path) {
    let library = "newmtl floor\nKd 0.8 0.8 0.8\nnewmtl block\nKd 0.9 0.1 0.1\nnewmtl pane\nKd 0.9 0.9 1\nillum 4\n";
    std::fs::write(folder.join("room.mtl"), library).expect("a file");
    let text = "mtllib room.mtl
v -4 0 -4\nv 4 0 -4\nv 4 0 4\nv -4 0 4
v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -1 2 -1\nv 1 2 -1\nv 1 2 1\nv -1 2 1
v 1.5 0 2\nv 3.5 0 2\nv 3.5 2 2\nv 1.5 2 2
usemtl floor\nf 4 3 2 1
usemtl block\nf 5 6 10 9\nf 6 7 11 10\nf 7 8 12 11\nf 8 5 9 12\nf 9 10 11 12
usemtl pane\nf 13 14 15 16\n";
    std::fs::write(folder.join("room.obj"), text).expect("a file");
}

/// A file with two triangles of different materials.
fn gltf(folder: &Path) {
    // Positions (0,0,0), (1,0,0), (0,1,0).
    let data = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1]}}],
        "nodes":[{{"mesh":0}},{{"mesh":1,"translation":[0.2,0.3,1]}}],
        "materials":[{{"name":"a","doubleSided":true,"pbrMetallicRoughness":{{"baseColorFactor":[1,0,0,1]}}}},
        {{"name":"b","doubleSided":true,"pbrMetallicRoughness":{{"baseColorFactor":[0,1,0,1]}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}},
        {{"primitives":[{{"attributes":{{"POSITION":0}},"material":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{data}"}}]}}"#
    );
    std::fs::write(folder.join("two.gltf"), text).expect("a file");
}

const CPU: [&str; 4] = ["--raster", "cpu", "--backend", "cpu"];

/// The share of pixels that are not the background's colour, and the number of different colours.
fn seen(path: &Path) -> (f64, usize) {
    let image = read_image(path).expect("a picture").image;
    // Scenes without a project are rendered in linear light.
    let background = [0.6_f32, 0.7, 0.8].map(decode);
    let shown = image.pixels.iter().filter(|pixel| (0..3).any(|i| (pixel[i] - background[i]).abs() > 0.01)).count();
    let mut colors: Vec<[u32; 3]> = image.pixels.iter().map(|p| [p[0], p[1], p[2]].map(f32::to_bits)).collect();
    colors.sort_unstable();
    colors.dedup();
    (shown as f64 / image.pixels.len() as f64, colors.len())
}

#[test]
fn a_scene_of_each_format_is_shown_and_its_written_project_shows_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    obj(folder);
    gltf(folder);
    std::fs::create_dir(folder.join("square")).expect("a folder");
    let square = root("xml_projects/3dsmodels/largoCamoes.cbo");
    std::fs::copy(&square, folder.join("square/square.cbo")).expect("a copy");
    let both = ["room.obj", "two.gltf"];
    for (name, scene) in [("room", &["room.obj"][..]), ("two", &["two.gltf"]), ("cbo", &["square"]), ("both", &both)] {
        let picture = format!("{name}.exr");
        let options = ["--size", "72x54", "--set", "pass2.samples=4", "-o", &picture];
        let printed = succeeds(folder, &[&["render"], scene, &CPU, &options].concat());
        assert!(printed.contains("final on cpu"), "{printed}");
        let (share, colors) = seen(&folder.join(&picture));
        assert!((0.1..0.95).contains(&share) && colors > 2, "{name}: {share} of the picture, {colors} colours");
        let project = format!("{name}.xml");
        succeeds(folder, &[&["scene"], scene, &["--project", &project, "--size", "72x54"]].concat());
        let again = format!("{name} again.exr");
        let options = ["--set", "pass2.samples=4", "-o", &again];
        succeeds(folder, &[&["render", &project], &CPU[..], &options].concat());
        let [a, b] = [&picture, &again].map(|file| read_image(&folder.join(file)).expect("a picture").image.pixels);
        let bits = |pixels: &[[f32; 4]]| pixels.iter().flatten().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert!(bits(&a) == bits(&b), "{name}: the project's picture is another");
    }
}

/// The room under a dome of these faces, as a file.
fn under_a_dome(folder: &Path, name: &str, material: &str, with_dome: bool) {
    let room = std::fs::read_to_string(folder.join("room.obj")).expect("a file");
    let mut text = format!("{room}o far\nusemtl {material}\n");
    let (rings, sides) = (4, 12);
    for corner in 0..=rings * sides {
        let (up, around) = (f64::from(corner / sides) / f64::from(rings), f64::from(corner % sides) / f64::from(sides));
        let ((height, level), (z, x)) =
            ((std::f64::consts::FRAC_PI_2 * up).sin_cos(), (std::f64::consts::TAU * around).sin_cos());
        text += &format!("v {} {} {}\n", 8.0 * level * x, 8.0 * height - 0.1, 8.0 * level * z);
    }
    let at = |ring: i32, side: i32| 17 + (ring * sides + side % sides).min(rings * sides);
    for (ring, side) in (0..rings * sides).map(|face| (face / sides, face % sides)).filter(|_| with_dome) {
        let [a, b, c, d] = [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
        text += &format!("f {a} {b} {c} {d}\n");
    }
    std::fs::write(folder.join(name), text).expect("a file");
}

#[test]
fn a_sky_dome_is_seen_and_leaves_a_scene_its_shadows_by_rays_and_by_maps() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    obj(folder);
    let library = std::fs::read_to_string(folder.join("room.mtl")).expect("a file");
    std::fs::write(folder.join("room.mtl"), format!("{library}newmtl blue\nKd 0.1 0.3 0.9\n")).expect("a file");
    under_a_dome(folder, "sky.obj", "blue", true);
    under_a_dome(folder, "none.obj", "blue", false);
    let view = ["--look-from", "3,3,6", "--look-at", "0,0.5,0", "--sun", "1,2,1", "--size", "64x48"];
    let render = |what: &str, options: &[&str]| {
        let printed = succeeds(folder, &[&["render", what, "-o", "p.exr"], &CPU[..], &view, options].concat());
        (printed, read_image(&folder.join("p.exr")).expect("a picture").image.pixels)
    };
    let color = [0.1_f32, 0.3, 0.9].map(decode);
    let is_sky = |pixel: &[f32; 4]| (0..3).all(|i| (pixel[i] - color[i]).abs() < 2e-3);
    let effects = ["--effects", "shadows,ao"];
    let planned = String::from_utf8_lossy(&curitiba(folder, &["plan", "sky.obj"]).stderr).into_owned();
    assert!(planned.contains("`blue` shows as it is") && planned.contains("effects: shadows+ao+glass"), "{planned}");
    let (_, with) = render("sky.obj", &effects);
    let (_, without) = render("none.obj", &effects);
    let (mut skies, mut others) = (0, 0);
    for (with, without) in with.iter().zip(&without) {
        let same = (0..3).all(|i| (with[i] - without[i]).abs() < 1e-6);
        skies += usize::from(is_sky(with));
        others += usize::from(!is_sky(with) && same);
    }
    // The occlusion radius is that of the scene under the sky.
    assert!(skies > 300 && skies + others == with.len(), "{skies} {others} of {}", with.len());
    // The sky is also shown by default, where glass shows it, by maps, and as a project, where it can be left out.
    let (printed, glazed) = render("sky.obj", &[]);
    assert!(printed.contains("final on cpu") && glazed.iter().filter(|pixel| is_sky(pixel)).count() > 300, "{printed}");
    succeeds(folder, &[&["scene", "sky.obj", "--project", "sky.xml", "--effects", "shadows"], &view[..]].concat());
    let project = std::fs::read_to_string(folder.join("sky.xml")).expect("a file");
    assert!(project.contains("<sky material=\"blue\"/>"), "{project}");
    std::fs::write(folder.join("roof.xml"), project.replace("<sky material=\"blue\"/>", "")).expect("a file");
    let lit = |file: &str| {
        succeeds(folder, &[&["render", file, "-o", "p.exr"], &CPU[..]].concat());
        let pixels = read_image(&folder.join("p.exr")).expect("a picture").image.pixels;
        pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / pixels.len() as f64
    };
    let (sky, roof) = (lit("sky.xml"), lit("roof.xml"));
    assert!(roof < 0.7 * sky, "{roof} under a roof, {sky} under the sky");
}

#[test]
fn a_sky_is_in_no_shadow_map() {
    let folder = tempfile::tempdir().expect("a folder");
    obj(folder.path());
    under_a_dome(folder.path(), "sky.obj", "blue", true);
    let options = SceneOptions { look_from: Some(DVec3::new(3.0, 3.0, 6.0)), ..SceneOptions::default() };
    let projects = SceneProjects::new(&[folder.path().join("sky.obj")], &options, Some([64, 48]), 1 << 28);
    let projects = projects.expect("a scene").by_technique();
    let named = |name: &str| projects.iter().find(|(file, _)| *file == name).expect("a project").1.clone();
    let mean = |project: Project, choice: Choice, is_sky: bool| {
        let mut project = project;
        if !is_sky {
            project.scenes[0].sky.clear();
        }
        let engines = match curitiba::engines::choose(choice) {
            Ok(engines) => engines,
            Err(error) => {
                assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
                println!("skipped: {error}");
                return None;
            }
        };
        let plan = Plan::new(project, Settings::default()).expect("a plan");
        let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("prepared");
        let pixels = renderer.frame(&mut Silent).expect("a frame").pixels;
        Some(pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / pixels.len() as f64)
    };
    let maps = named("raster/SceneShadowMap.xml");
    let by_rays = mean(named("SceneShadows.xml"), Choice::CPU, true).expect("the cpu is there");
    for raster in [RasterChoice::Cpu, RasterChoice::Wgpu] {
        let of = |is_sky: bool| mean(maps.clone(), Choice { raster, ..Choice::CPU }, is_sky);
        let Some(sky) = of(true) else { continue };
        let roof = of(false).expect("the same engines");
        assert!((sky / by_rays - 1.0).abs() < 0.02 && roof < 0.8 * sky, "{sky} {roof}, and {by_rays} by rays");
    }
}

/// A file with a camera, and a marker at each side at z = 0. There the camera sees 2 units to each side in a picture twice as wide as high.
fn markers(folder: &Path, aspect: &str) -> PathBuf {
    let data = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let lens = format!(r#"{{"yfov":0.39479112,"znear":0.1{aspect}}}"#);
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1,2]}}],
        "nodes":[{{"mesh":0,"translation":[1.6,0,0],"scale":[0.3,0.3,0.3]}},
        {{"mesh":0,"translation":[-1.9,0,0],"scale":[0.3,0.3,0.3]}},{{"camera":0,"translation":[0,0,5]}}],
        "cameras":[{{"type":"perspective","perspective":{lens}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{data}"}}]}}"#
    );
    let path = folder.join("markers.gltf");
    std::fs::write(&path, text).expect("a file");
    path
}

#[test]
fn what_a_files_camera_sees_is_seen_in_narrower_windows_as_well() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let render = |what: &str, size: &str, name: &str| {
        succeeds(folder, &[&["render", what, "--size", size, "-o", name], &CPU[..]].concat());
        let shown = seen(&folder.join(name)).0;
        (shown, read_image(&folder.join(name)).expect("a picture").image.pixels)
    };
    // `found` is the share of the picture that the markers cover, `shown` the area of the window in square units; the markers cover 0.09.
    let whole = |found: f64, shown: f64| assert!((found * shown / 0.09 - 1.0).abs() < 0.2, "{found} of {shown}");
    markers(folder, r#","aspectRatio":2"#);
    whole(render("markers.gltf", "192x96", "wide.exr").0, 4.0 * 2.0);
    whole(render("markers.gltf", "288x96", "wider.exr").0, 6.0 * 2.0);
    let (square, pixels) = render("markers.gltf", "96x96", "square.exr");
    whole(square, 4.0 * 4.0);
    whole(render("markers.gltf", "96x192", "high.exr").0, 4.0 * 8.0);
    succeeds(folder, &["scene", "markers.gltf", "--project", "square.xml", "--size", "96x96"]);
    assert_eq!(render("square.xml", "96x96", "again.exr").1, pixels, "the project's picture is another");
    // Without `aspectRatio`, a square window shows one unit to each side.
    markers(folder, "");
    assert_eq!(render("markers.gltf", "96x96", "open.exr").0, 0.0);
    whole(render("markers.gltf", "192x96", "open.exr").0, 4.0 * 2.0);
    // An invalid `aspectRatio` is ignored, and the camera is kept.
    markers(folder, r#","aspectRatio":0"#);
    let output =
        curitiba(folder, &[&["render", "markers.gltf", "--size", "96x96", "-o", "none.exr"], &CPU[..]].concat());
    assert!(String::from_utf8_lossy(&output.stderr).contains("aspect ratios of cameras"), "{output:?}");
    assert_eq!(seen(&folder.join("none.exr")).0, 0.0);
}

#[test]
fn options_describe_camera_sun_background_and_effects() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    obj(folder);
    let render = |name: &str, options: &[&str]| {
        let common = ["render", "room.obj", "--size", "48x48", "-o", name];
        succeeds(folder, &[&common[..], &CPU, options].concat());
        read_image(&folder.join(name)).expect("a picture").image
    };
    let pixel = |image: &curitiba::pipeline::image::Image, x: usize, y: usize| image.pixels[y * 48 + x];
    // Seen from above, the floor fills the lower left corner. From below, only the block's bottom would be visible.
    let from_above = ["--look-from", "0,30,0", "--look-at", "0,0,0", "--fov", "17", "--effects", "none"];
    let lit = render("lit.exr", &[&from_above[..], &["--sun", "0,1,0", "--background", "#ff0000"]].concat());
    let floor = decode(0.8);
    assert!((pixel(&lit, 6, 40)[0] - floor).abs() < 1e-3, "0.8, decoded, x (0.7 + 0.3): {:?}", pixel(&lit, 6, 40));
    assert_eq!(pixel(&lit, 24, 0)[..3], [1.0, 0.0, 0.0], "the background");
    let aslant = render("aslant.exr", &[&from_above[..], &["--sun", "-1,1,0"]].concat());
    assert!(pixel(&aslant, 6, 40)[0] < 0.85 * floor, "{:?}", pixel(&aslant, 6, 40));
    // The block is 2 high, so light from the left at 45 degrees darkens the floor up to 2 to its right.
    let shadowed = render("shadowed.exr", &[&from_above[..6], &["--sun", "-1,1,0", "--effects", "shadows"]].concat());
    let column = 24 + (2.0 / 30.0 / (17.0_f64.to_radians() * 0.5).tan() * 24.0) as usize;
    let (dark, open) = (pixel(&shadowed, column, 24)[0], pixel(&aslant, column, 24)[0]);
    assert!((dark - open * 0.5).abs() < 1e-3, "{dark} beside {open}");
}

#[test]
fn a_picture_of_one_colour_is_warned_of() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    obj(folder);
    let warned = |options: &[&str]| {
        let common = ["render", "room.obj", "--size", "48x48", "-o", "seen.exr", "--effects", "none"];
        let output = curitiba(folder, &[&common[..], &CPU, options].concat());
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stderr).contains("all pixels of the picture have one colour")
    };
    let away = ["--look-from", "0,30,0", "--look-at", "0,60,0"];
    assert!(warned(&away));
    assert!(warned(&[&away[..], &["--bands", "16"]].concat()));
    assert!(!warned(&["--look-from", "0,30,0", "--look-at", "0,0,0"]));
}

#[test]
fn a_camera_does_not_see_single_sided_materials_from_behind_and_rays_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    gltf(folder);
    let two = std::fs::read_to_string(folder.join("two.gltf")).expect("the file");
    let single = two.replace("\"doubleSided\":true,", "");
    std::fs::write(folder.join("single.gltf"), &single).expect("a file");
    // Mirrored in x, the corners have the opposite order in the world, but the triangles face the same way.
    let mirrored = single.replace("{\"mesh\":0}", "{\"mesh\":0,\"scale\":[-1,1,1]}");
    std::fs::write(folder.join("mirrored.gltf"), mirrored).expect("a file");
    let share = |scene: &str, from: &str, more: &[&str]| {
        let options = ["--size", "48x48", "--look-from", from, "--look-at", "0.3,0.3,0", "-o", "side.exr"];
        succeeds(folder, &[&["render", scene], &CPU[..], &options, more].concat());
        seen(&folder.join("side.exr")).0
    };
    let (front, back) = ("0.3,0.3,4", "0.3,0.3,-4");
    let plain = ["--effects", "none"];
    assert!(share("two.gltf", front, &plain) > 0.02 && share("two.gltf", back, &plain) > 0.02);
    assert!(share("single.gltf", front, &plain) > 0.02);
    assert_eq!(share("single.gltf", back, &plain), 0.0);
    assert!(share("mirrored.gltf", front, &plain) > share("single.gltf", front, &plain));
    assert_eq!(share("mirrored.gltf", back, &plain), 0.0);
    // The report's programs draw both sides.
    assert!(share("single.gltf", back, &["--effects", "none", "--fidelity", "thesis"]) > 0.02);
    // Rays from the red triangle to the sun hit the green one from behind.
    let shadow = ["--sun", "0.2,0.3,1", "--effects", "shadows"];
    let darkest = |scene: &str| {
        share(scene, "3,3,1", &shadow);
        let image = read_image(&folder.join("side.exr")).expect("a picture").image;
        image.pixels.iter().map(|pixel| pixel[0] + pixel[1] + pixel[2]).fold(f32::MAX, f32::min)
    };
    assert_eq!(darkest("single.gltf"), darkest("two.gltf"));
}

#[test]
fn every_command_takes_a_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    obj(folder);
    let plan = succeeds(folder, &["plan", "room.obj", "--effects", "ao"]);
    assert!(plan.contains("runs `ssao`") && plan.contains("acceleration structure"), "{plan}");
    let check = succeeds(folder, &["check", "room.obj"]);
    assert!(check.contains("room.obj: ok"), "{check}");
    let bench = ["bench", "room.obj", "--size", "24x24", "--frames", "1", "--warmup", "0", "--no-error"];
    let bench = succeeds(folder, &[&bench[..], &CPU, &["--effects", "shadows", "--json", "b.json"]].concat());
    assert!(bench.contains("shadows"), "{bench}");
    let command = std::fs::read_to_string(folder.join("b.json")).expect("the file");
    assert!(command.contains("--effects shadows"), "the command can be typed again");
    let sides = ["room.obj@effects=none,size=24x24,raster=cpu", "room.obj@effects=shadows,size=24x24,raster=cpu"];
    let beyond = curitiba(folder, &["compare", sides[0], sides[1], "--max-rmse", "1e-6"]);
    assert_eq!(beyond.status.code(), Some(1), "a shadow differs");
    succeeds(folder, &["compare", sides[1], sides[1], "--max-rmse", "0"]);
    let printed = succeeds(folder, &[&["render", ".", "--size", "24x24"], &CPU[..]].concat());
    let name = std::fs::canonicalize(folder).expect("the folder").file_name().expect("a name").to_owned();
    assert!(printed.contains(&format!("wrote {}.png", name.to_string_lossy())), "{printed}");
}

#[test]
fn what_is_no_scene_is_refused_with_what_is_valid() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    obj(folder);
    std::fs::write(folder.join("a.png"), b"\x89PNG\r\n\x1a\n").expect("a file");
    std::fs::write(folder.join("a.fbx"), b"Kaydara").expect("a file");
    std::fs::create_dir(folder.join("empty")).expect("a folder");
    let project = root("xml_projects/SceneFinal.xml");
    let project = project.to_str().expect("test paths are UTF-8");
    for (code, arguments, words) in [
        (3, &["render", "a.png"][..], &["a.png", "neither a project nor a scene", ".glb"][..]),
        (3, &["render", "a.fbx"], &["Blender"]),
        (3, &["check", "empty"], &["no scene file"]),
        (3, &["render", "no.glb"], &["no.glb", "no such file"]),
        (2, &["render", project, "--fov", "30"], &["--fov", "its own cameras"]),
        (2, &["render", "room.obj", project], &["SceneFinal.xml"]),
        (2, &["plan", "room.obj", "--effects", "shadow"], &["did you mean `shadows`?"]),
        (2, &["plan", "room.obj", "--look-from", "1,2"], &["X,Y,Z"]),
        (2, &["plan", "room.obj", "--look-from", "1,2,3", "--look-at", "1,2,3"], &["the same point"]),
        (2, &["plan", "room.obj", "--background", "2,0,0"], &["from 0 to 1"]),
        (2, &["scene", "room.obj", "--project", "room.txt"], &[".xml"]),
    ] {
        let printed = fails_with(code, folder, arguments);
        for word in words {
            assert!(printed.contains(word), "{arguments:?}: no `{word}` in\n{printed}");
        }
    }
    succeeds(folder, &["scene", "room.obj", "--project", "room.xml"]);
    let again = fails_with(2, folder, &["scene", "room.obj", "--project", "room.xml"]);
    assert!(again.contains("room.xml is there already"), "{again}");
}

/// Every available real scene gives a picture that shows something.
#[test]
fn real_scenes_are_shown() {
    let archives = root("../shared/scenes");
    if !archives.join("unpack.sh").is_file() {
        println!("skipped: {} is not there", archives.display());
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let unpacked = folder.path().join("scenes");
    let script = Command::new("bash").current_dir(&archives).arg("./unpack.sh").arg(&unpacked).output();
    match script {
        Ok(output) if output.status.success() => {}
        other => {
            println!("skipped: the archives cannot be unpacked: {other:?}");
            return;
        }
    }
    let mut files = Vec::new();
    find_scenes(&unpacked, &mut files);
    find_scenes(&archives.join("engine_files"), &mut files);
    let mut shown = 0;
    for file in &files {
        // A million triangles take long without optimisation.
        if std::fs::metadata(file).map_or(0, |metadata| metadata.len()) > 4 << 20 {
            continue;
        }
        let picture = folder.path().join("picture.exr");
        let path = file.to_str().expect("test paths are UTF-8");
        let output = picture.to_str().expect("test paths are UTF-8");
        let options = ["--size", "48x48", "-o", output];
        succeeds(folder.path(), &[&["render", path], &CPU[..], &options].concat());
        let (share, _) = seen(&picture);
        // A bridge on thin pillars fills less than a hundredth of a square window.
        assert!(share > 0.005, "{path}: {share} of the picture shows anything");
        shown += 1;
    }
    assert!(shown >= 12, "only {shown} of {} scenes were tried", files.len());
}

fn find_scenes(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        if path.is_dir() {
            find_scenes(&path, found);
        } else if extension.is_some_and(|e| ["glb", "gltf", "obj", "cbo", "nbo"].contains(&e.as_str())) {
            found.push(path);
        }
    }
    found.sort();
}
