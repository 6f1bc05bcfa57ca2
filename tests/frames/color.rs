//! Linear light from the scene file to the picture: `color=linear` and `color=report`, exposure, tone curve, transfer
//! function, and how `compare` treats both.

use curitiba::pipeline::color::{ColorSpace, decode, encode};
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::{Image, read_image, write_png};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::SceneOptions;
use curitiba::{Choice, RasterChoice};
use glam::{DVec3, Vec3};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

const SIZE: [u32; 2] = [64, 32];

/// Two squares in z = 0, seen from +z: the left one has a diffuse factor, the right one a texture of the grey code `code`.
fn patches(folder: &Path, factor: f32, code: u8) {
    let grey = f32::from(code) / 255.0;
    write_png(&folder.join("grey.png"), &Image::filled(2, 2, [grey, grey, grey, 1.0])).expect("a picture");
    let mut bytes = Vec::new();
    for left in [-2.0_f32, 0.0] {
        for [x, y] in [[0.0, -1.0], [2.0, -1.0], [2.0, 1.0], [0.0, 1.0]] {
            bytes.extend([left + x, y, 0.0].into_iter().flat_map(f32::to_le_bytes));
        }
    }
    bytes.extend([0.0_f32, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0].into_iter().flat_map(f32::to_le_bytes));
    bytes.extend([0_u16, 1, 2, 0, 2, 3].into_iter().flat_map(u16::to_le_bytes));
    std::fs::write(folder.join("patches.bin"), &bytes).expect("a file");
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "materials":[{{"name":"factor","pbrMetallicRoughness":{{"baseColorFactor":[{factor},{factor},{factor},1]}}}},
        {{"name":"texel","pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
        "textures":[{{"source":0}}],"images":[{{"uri":"grey.png"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":2}},"indices":3,"material":0}},
        {{"attributes":{{"POSITION":1,"TEXCOORD_0":2}},"indices":3,"material":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[-2,-1,0],"max":[0,1,0]}},
        {{"bufferView":0,"byteOffset":48,"componentType":5126,"count":4,"type":"VEC3","min":[0,-1,0],"max":[2,1,0]}},
        {{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"}},
        {{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":96}},{{"buffer":0,"byteOffset":96,"byteLength":32}},
        {{"buffer":0,"byteOffset":128,"byteLength":12}}],"buffers":[{{"byteLength":140,"uri":"patches.bin"}}]}}"#
    );
    std::fs::write(folder.join("patches.gltf"), text).expect("a file");
}

fn settings(color: Option<ColorSpace>, sun: Vec3) -> Settings {
    let scene = SceneOptions {
        effects: Some("none".parse().expect("effects")),
        look_from: Some(DVec3::new(0.0, 0.0, 6.0)),
        look_at: Some(DVec3::ZERO),
        fov: Some(12.0),
        sun: Some(sun),
        ..SceneOptions::default()
    };
    Settings { size: Some(SIZE), color, scene, ..Settings::default() }
}

/// A frame's window picture, and the codes of its PNG.
fn render(folder: &Path, settings: Settings, choice: Choice) -> (Image, Image) {
    let scene = folder.join("patches.gltf");
    let mut renderer = curitiba::open(&scene, settings, choice, &mut Silent).expect("the scene opens");
    let frame = renderer.frame(&mut Silent).expect("a frame");
    let png = folder.join("frame.png");
    renderer.save(&png, &mut Silent).expect("it is written");
    let mut codes = read_image(&png).expect("a picture").image;
    codes.pixels.iter_mut().flatten().for_each(|value| *value = (*value * 255.0).round());
    (frame, codes)
}

/// The red values in the centres of both squares.
fn middles(image: &Image) -> [f32; 2] {
    [16, 48].map(|x| image.pixels[16 * 64 + x][0])
}

#[test]
fn a_linear_factor_looks_as_the_texel_that_encodes_it_and_light_is_linear() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let albedo = decode(128.0 / 255.0);
    patches(folder, albedo, 128);
    // Ambient light is 0.3 and the sun 0.7, so under perpendicular light an albedo appears unchanged in both colour
    // spaces.
    for (color, value) in
        [(None, albedo), (Some(ColorSpace::Linear), albedo), (Some(ColorSpace::Report), 128.0 / 255.0)]
    {
        let (frame, codes) = render(folder, settings(color, Vec3::Z), Choice::CPU);
        for (seen, code) in middles(&frame).into_iter().zip(middles(&codes)) {
            assert!((seen - value).abs() < 2e-6 && code == 128.0, "{color:?}: {seen} and {code}, not {value} and 128");
        }
    }
    // At 60 degrees the light is 0.3 + 0.7 / 2: code 105 with linear light, and code 83 with display values.
    let aslant = Vec3::new(0.0, 3.0_f32.sqrt(), 1.0);
    for (color, code) in [(ColorSpace::Linear, 105.0), (ColorSpace::Report, 83.0)] {
        let (frame, codes) = render(folder, settings(Some(color), aslant), Choice::CPU);
        assert_eq!(middles(&codes), [code; 2], "{color}");
        let whole = if color == ColorSpace::Linear { albedo } else { 128.0 / 255.0 };
        assert!(middles(&frame).into_iter().all(|seen| (seen - 0.65 * whole).abs() < 2e-6), "{:?}", middles(&frame));
    }
    assert_eq!((255.0 * encode(0.65 * albedo)).round(), 105.0);
    // The factor 0.214 and the texel 128 give codes that differ by at most 1.
    patches(folder, 0.214, 128);
    let (_, codes) = render(folder, settings(None, Vec3::Z), Choice::CPU);
    let [factor, texel] = middles(&codes);
    assert!((factor - texel).abs() <= 1.0 && texel == 128.0, "{factor} and {texel}");
}

#[test]
fn the_background_and_what_is_shown_are_what_was_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    patches(folder, 1.0, 255);
    for color in [ColorSpace::Linear, ColorSpace::Report] {
        let mut settings = settings(Some(color), Vec3::Z);
        settings.scene.background = Some(Vec3::new(0.25, 0.5, 0.75));
        settings.scene.fov = Some(40.0);
        settings.show = vec!["color".to_owned()];
        let (_, codes) = render(folder, settings, Choice::CPU);
        assert_eq!(codes.pixels[0][..3], [64.0, 128.0, 191.0], "{color}: display values");
        let shown = read_image(&folder.join("frame.color.png")).expect("a picture").image;
        let shown: Vec<f32> = shown.pixels.iter().flatten().map(|value| (*value * 255.0).round()).collect();
        assert_eq!(shown, codes.pixels.as_flattened(), "{color}: the window shows that channel");
        let exr = read_image(&folder.join("frame.color.exr")).expect("a picture");
        assert_eq!(exr.space, Some(color));
        let stored = if color == ColorSpace::Linear { decode(0.5) } else { 0.5 };
        assert!((exr.image.pixels[0][1] - stored).abs() < 1e-6);
    }
}

#[test]
fn both_rasterisers_decode_alike() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let wgpu = Choice { raster: RasterChoice::Wgpu, ..Choice::CPU };
    for code in [1, 10, 11, 60, 128, 200, 254] {
        patches(folder, 0.5, code);
        let (mine, _) = render(folder, settings(None, Vec3::Z), Choice::CPU);
        if let Err(error) = curitiba::open(folder.join("patches.gltf"), settings(None, Vec3::Z), wgpu, &mut Silent) {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
            println!("skipped: {error}");
            return;
        }
        let (theirs, codes) = render(folder, settings(None, Vec3::Z), wgpu);
        let exact = decode(f32::from(code) / 255.0);
        let [cpu, gpu] = [&mine, &theirs].map(|image| middles(image)[1]);
        println!("code {code}: {exact}, cpu {cpu}, wgpu {gpu}");
        assert!((cpu - exact).abs() < 1e-6, "code {code}: {cpu}, not {exact}");
        // A device may decode approximately; the displayed code is still right.
        assert!((encode(gpu) - encode(exact)).abs() < 0.5 / 255.0, "code {code}: {gpu}, not {exact}");
        assert_eq!(middles(&codes)[1], f32::from(code));
    }
}

fn curitiba(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).args(arguments).env("NO_COLOR", "1").output().expect("the program starts")
}

#[track_caller]
fn exits_with(code: i32, folder: &Path, arguments: &[&str]) -> String {
    let Output { status, stdout, stderr } = curitiba(folder, arguments);
    let both = [stdout, stderr].map(|bytes| String::from_utf8(bytes).expect("output is UTF-8")).concat();
    assert_eq!(status.code(), Some(code), "{arguments:?} printed:\n{both}");
    both
}

const VIEW: [&str; 12] = [
    "--size",
    "64x32",
    "--look-from",
    "0,0,6",
    "--fov",
    "12",
    "--effects",
    "none",
    "--raster",
    "cpu",
    "--backend",
    "cpu",
];

/// Renders the squares under perpendicular sunlight.
fn command(folder: &Path, output: &str, more: &[&str]) {
    exits_with(0, folder, &[&["render", "patches.gltf", "--sun", "0,0,1", "-o", output], &VIEW[..], more].concat());
}

/// The code of the left square in a PNG.
fn code(folder: &Path, name: &str) -> f32 {
    (middles(&read_image(&folder.join(name)).expect("a picture").image)[0] * 255.0).round()
}

#[test]
fn exposure_and_tone_curve_change_pictures_for_screens_and_not_radiance() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    patches(folder, 0.25, 255);
    let expected = |radiance: f32| (255.0 * encode(radiance)).round();
    for (name, options, radiance) in [
        ("plain.png", &[][..], 0.25),
        ("up.png", &["--exposure", "1"], 0.5),
        ("down.png", &["--exposure", "-1.5"], 0.25 * 0.5_f32.powf(1.5)),
        ("tone.png", &["--tone", "reinhard"], 0.25 * (1.0 + 0.25 / 16.0) / 1.25),
        ("both.png", &["--exposure", "2", "--tone", "reinhard"], (1.0 + 1.0 / 16.0) / 2.0),
    ] {
        command(folder, name, options);
        assert_eq!(code(folder, name), expected(radiance), "{name}");
    }
    command(folder, "plain.exr", &[]);
    command(folder, "up.exr", &["--exposure", "1", "--tone", "reinhard"]);
    let pixels = |name: &str| read_image(&folder.join(name)).expect("a picture").image.pixels;
    assert_eq!(pixels("plain.exr"), pixels("up.exr"));
    // Bands are written while the picture is rendered, by other code.
    command(folder, "bands.png", &["--exposure", "1", "--bands", "2"]);
    assert_eq!(pixels("bands.png"), pixels("up.png"));
    for options in [&["--exposure", "1"][..], &["--tone", "reinhard"]] {
        let arguments = [&["render", "patches.gltf", "--color", "report", "-o", "no.png"], &VIEW[..], options].concat();
        let printed = exits_with(2, folder, &arguments);
        assert!(printed.contains("--color linear"), "{printed}");
    }
    let printed = exits_with(2, folder, &["render", "patches.gltf", "--color", "liner"]);
    assert!(printed.contains("did you mean `linear`?"), "{printed}");
}

#[test]
fn compare_brings_both_sides_to_one_space_and_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    patches(folder, 0.4, 200);
    command(folder, "linear.exr", &[]);
    command(folder, "linear.png", &[]);
    command(folder, "report.exr", &["--color", "report"]);
    let compare = |a: &str, b: &str| -> Value {
        let output = curitiba(folder, &["compare", a, b, "--json"]);
        serde_json::from_slice(&output.stdout).expect("JSON and nothing else")
    };
    let rmse = |found: &Value| found["metrics"]["rmse"].as_f64().expect("a number");
    // Under perpendicular light, display values decode to the linear picture, up to the steps of a PNG.
    for (a, b, most) in
        [("report.exr", "linear.exr", 1e-6), ("linear.exr", "report.exr", 1e-6), ("linear.png", "linear.exr", 2e-3)]
    {
        let found = compare(a, b);
        assert!(found["color"] == "linear" && rmse(&found) < most, "{a} {b}: {found}");
        // Half a code over flat squares gives about 0.008.
        assert!(found["metrics"]["flip"].as_f64().expect("a number") < 0.01, "{a} {b}: {found}");
        assert!(found["notes"].to_string().contains("decoded from sRGB"), "{found}");
    }
    let same = compare("report.exr", "linear.png");
    assert!(same["color"] == "report" && rmse(&same) < 3e-3, "both are display values: {same}");
    // Control: the stored values are far apart.
    let [a, b] =
        ["report.exr", "linear.exr"].map(|name| middles(&read_image(&folder.join(name)).expect("it").image)[0]);
    assert!(a - b > 0.2, "{a} and {b}");
    // A file without a colour space is taken to be in the other side's.
    let unknown = read_image(&folder.join("linear.exr")).expect("a picture").image;
    let layer = curitiba::pipeline::image::Layer { name: "other", channels: ["R", "G", "B", "A"], image: &unknown };
    curitiba::pipeline::image::write_exr(&folder.join("other.exr"), layer).expect("written");
    let found = compare("other.exr", "linear.exr");
    assert!(rmse(&found) == 0.0 && found["notes"].to_string().contains("taken for linear"), "{found}");
    // Renders can be compared in the same way as files.
    let view = "size=64x32,look-from=0/0/6,fov=12,sun=0/0/1,effects=none,raster=cpu";
    let found = compare(&format!("patches.gltf@{view},color=report"), &format!("patches.gltf@{view}"));
    assert!(found["color"] == "linear" && rmse(&found) < 1e-6, "{found}");
}

#[test]
fn projects_say_what_their_colours_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    patches(folder, 0.4, 200);
    exits_with(0, folder, &["scene", "patches.gltf", "--project", "view.xml"]);
    let text = std::fs::read_to_string(folder.join("view.xml")).expect("the project");
    assert!(text.contains("color=\"linear\""), "{text}");
    let planned = exits_with(0, folder, &["plan", "view.xml"]);
    assert!(planned.contains("linear light: color=linear, of the project"), "{planned}");
    let planned = exits_with(0, folder, &["plan", "view.xml", "--color", "report"]);
    assert!(planned.contains("color=report, the user asks for it"), "{planned}");
    std::fs::write(folder.join("old.xml"), text.replace(" color=\"linear\"", "")).expect("a file");
    let planned = exits_with(0, folder, &["plan", "old.xml"]);
    assert!(planned.contains("linear light: color=report, of the project"), "{planned}");
    std::fs::write(folder.join("bad.xml"), text.replace("color=\"linear\"", "color=\"liner\"")).expect("a file");
    let printed = exits_with(3, folder, &["check", "bad.xml"]);
    assert!(printed.contains("`liner` is no `color`") && printed.contains("did you mean `linear`?"), "{printed}");
}

/// A cube of clear glass in front of a white background stays white: reflected and transmitted light add up to all.
#[test]
fn a_white_furnace_stays_white() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let library = "newmtl glass\nKd 1 1 1\nTf 1 1 1\nNi 1.5\nillum 7\nd 0.1\n";
    std::fs::write(folder.join("cube.mtl"), library).expect("a file");
    let text = "mtllib cube.mtl\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\nusemtl glass
f 5 6 7 8\nf 2 1 4 3\nf 6 2 3 7\nf 1 5 8 4\nf 8 7 3 4\nf 1 2 6 5\n";
    std::fs::write(folder.join("cube.obj"), text).expect("a file");
    for color in ["linear", "report"] {
        let options = ["--effects", "glass", "--background", "#ffffff", "--size", "32x32", "--color", color];
        let engines = ["--raster", "cpu", "--backend", "cpu", "-o", "cube.exr"];
        let printed = exits_with(0, folder, &[&["render", "cube.obj"], &options[..], &engines].concat());
        assert!(printed.contains("refracted"), "rays pass the glass: {printed}");
        let image = read_image(&folder.join("cube.exr")).expect("a picture").image;
        let worst =
            image.pixels.iter().flat_map(|pixel| &pixel[..3]).map(|value| (value - 1.0).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-4, "{color}: {worst}");
    }
}

/// glTF's `BLEND` without a texture: the lit colour is weighted with alpha, the background with the rest.
#[test]
fn an_even_blend_shows_what_is_behind_it_by_the_rest_of_its_alpha() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    patches(folder, 0.5, 200);
    let text = std::fs::read_to_string(folder.join("patches.gltf")).expect("the scene");
    let opaque = r#"{"name":"factor","pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1]}}"#;
    assert!(text.contains(opaque));
    for alpha in [0.25_f32, 0.75] {
        let veil = opaque.replace("1]", &format!("{alpha}]")).replace("\"name\"", "\"alphaMode\":\"BLEND\",\"name\"");
        std::fs::write(folder.join("patches.gltf"), text.replace(opaque, &veil)).expect("written");
        let mut settings = settings(Some(ColorSpace::Linear), Vec3::Z);
        settings.scene.effects = Some("glass".parse().expect("effects"));
        settings.scene.background = Some(Vec3::ONE);
        let (frame, _) = render(folder, settings, Choice::CPU);
        let [seen, textured] = middles(&frame);
        let expected = alpha * 0.5 + (1.0 - alpha);
        assert!((seen - expected).abs() < 1e-5, "{alpha}: {seen}, not {expected}");
        assert!((textured - decode(200.0 / 255.0)).abs() < 1e-5, "what is opaque stays");
    }
}

/// glTF's `BLEND` with a texture: the lit colour is weighted with the texel's alpha times the factor's, and the background with the rest. If nearly
/// all texels are clear or opaque, the texture is used as a cut-out.
#[test]
fn a_textured_blend_shows_what_is_behind_it_by_each_texel() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    patches(folder, 0.5, 200);
    let text = std::fs::read_to_string(folder.join("patches.gltf")).expect("the scene");
    let opaque = r#"{"name":"texel","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}"#;
    assert!(text.contains(opaque));
    let blended = |opacity: f32| {
        let factor = format!("\"baseColorFactor\":[1,1,1,{opacity}],\"baseColorTexture\"");
        let material = opaque.replace("\"baseColorTexture\"", &factor);
        text.replace(opaque, &material.replace("\"name\"", "\"alphaMode\":\"BLEND\",\"name\""))
    };
    let picture = |alpha: &dyn Fn(u32) -> u8| {
        let texels = image::RgbaImage::from_fn(64, 2, |x, _| image::Rgba([200, 200, 200, alpha(x)]));
        texels.save(folder.join("grey.png")).expect("a picture");
    };
    let settings = || {
        let mut settings = settings(Some(ColorSpace::Linear), Vec3::Z);
        settings.scene.background = Some(Vec3::ONE);
        settings
    };
    let lit = decode(200.0 / 255.0);
    for (code, opacity) in [(102, 1.0), (204, 1.0), (255, 0.4), (51, 0.5)] {
        let alpha = f32::from(code) / 255.0;
        picture(&|_| code);
        std::fs::write(folder.join("patches.gltf"), blended(opacity)).expect("written");
        let (frame, _) = render(folder, settings_with_glass(settings()), Choice::CPU);
        let share = alpha * opacity;
        let expected = share * lit + (1.0 - share);
        let [plain, seen] = middles(&frame);
        assert!((seen - expected).abs() < 0.5 / 255.0 + 1e-5, "{alpha} {opacity}: {seen}, not {expected}");
        assert!((plain - 0.5).abs() < 1e-5, "what is opaque stays");
        // Without rays, the surface is opaque or a hole, depending on whether the texture's alpha is below a half.
        let (frame, _) = render(folder, settings(), Choice::CPU);
        let cut = if alpha < 0.5 { 1.0 } else { lit };
        assert!((middles(&frame)[1] - cut).abs() < 1e-5, "{alpha} {opacity}: {}, not {cut}", middles(&frame)[1]);
    }
    // The last of these is blended, and the plan says so.
    let said = "material `texel` blended texel by texel";
    assert!(exits_with(0, folder, &["plan", "patches.gltf"]).contains(said));
    // The texture's left quarter is clear and the rest opaque: no pass traces rays for glass, and the opaque part is seen.
    picture(&|x| if x < 16 { 0 } else { 255 });
    std::fs::write(folder.join("patches.gltf"), blended(1.0)).expect("written");
    let planned = exits_with(0, folder, &["plan", "patches.gltf"]);
    assert!(!planned.contains(said) && planned.contains("hardly a texel that is half clear"), "{planned}");
    let mut by_itself = settings();
    by_itself.scene.effects = None;
    let scene = folder.join("patches.gltf");
    let renderer = curitiba::open(&scene, by_itself, Choice::CPU, &mut Silent).expect("the scene opens");
    let notes: Vec<String> = renderer.plan().project.problems.0.iter().map(|note| note.message.clone()).collect();
    assert!(notes.iter().any(|note| note.contains("no material of the scene is glass")), "{notes:?}");
    let (frame, _) = render(folder, settings(), Choice::CPU);
    let [left, right] = [40, 56].map(|x| frame.pixels[16 * 64 + x][0]);
    assert!((left - 1.0).abs() < 1e-5 && (right - lit).abs() < 1e-5, "{left} {right}");
}

/// The same settings with the glass of materials.
fn settings_with_glass(mut settings: Settings) -> Settings {
    settings.scene.effects = Some("glass".parse().expect("effects"));
    settings
}
