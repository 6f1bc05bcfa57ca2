//! `curitiba compare` as a user or a script runs it: the table, the JSON, the pictures and the exit codes.

use curitiba::pipeline::image::{Image, Layer, read_image, write_exr, write_exr_layers, write_png};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const RGBA: [&str; 4] = ["R", "G", "B", "A"];

fn spec(name: &str, settings: &str) -> String {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name);
    format!("{}@raster=cpu,{settings}", path.display())
}

fn compare(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).arg("compare").args(arguments).env("NO_COLOR", "1");
    command.output().expect("the program starts")
}

/// Asserts the exit code of a comparison, and returns its output.
#[track_caller]
fn exits_with(code: i32, folder: &Path, arguments: &[&str]) -> String {
    let output = compare(folder, arguments);
    let both = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("output is UTF-8")).concat();
    assert_eq!(output.status.code(), Some(code), "{arguments:?} printed:\n{both}");
    both
}

#[track_caller]
fn json(code: i32, folder: &Path, arguments: &[&str]) -> Value {
    let output = compare(folder, &[arguments, &["--json"]].concat());
    assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON and nothing else")
}

/// A horizontal gradient, with `added` added to every value of the left half.
fn slope(width: u32, height: u32, added: f32) -> Image {
    let pixel = |index: u32| {
        let value = (index % width) as f32 / width as f32 * 0.5;
        let value = if index % width < width / 2 { value + added } else { value };
        [value, value * 0.5, 0.25, 1.0]
    };
    Image { width, height, pixels: (0..width * height).map(pixel).collect() }
}

fn write(folder: &Path, name: &str, image: &Image) {
    let path = folder.join(name);
    if name.ends_with("png") {
        write_png(&path, image).expect("written");
    } else {
        write_exr(&path, Layer { name: "window", channels: RGBA, image }).expect("written");
    }
}

#[test]
fn a_picture_equals_itself_and_meets_the_strictest_limits() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "a.png", &slope(32, 24, 0.0));
    write(folder.path(), "a.exr", &slope(32, 24, 0.0));
    for name in ["a.png", "a.exr"] {
        let limits = ["--max-rmse", "0", "--max-relmse", "0", "--max-flip", "0", "--max-outliers", "0"];
        let more = ["--max-difference", "0", "--min-psnr", "100", "--min-ssim", "0.999999", "--max-energy", "0"];
        let printed = exits_with(0, folder.path(), &[&[name, name], &limits[..], &more[..]].concat());
        assert!(printed.contains("within all limits"), "{printed}");
        assert!(printed.contains("32 x 24") && printed.contains("768 pixels compared"), "{printed}");
        let found = json(0, folder.path(), &[name, name]);
        assert_eq!((&found["metrics"]["rmse"], &found["metrics"]["psnr"]), (&Value::from(0.0), &Value::Null));
        assert_eq!(found["within"], true);
    }
}

#[test]
fn every_limit_is_met_above_and_missed_below_what_was_found() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "a.exr", &slope(32, 24, 0.125));
    write(folder.path(), "b.exr", &slope(32, 24, 0.0));
    let found = json(0, folder.path(), &["a.exr", "b.exr"]);
    let metric = |name: &str| found["metrics"][name].as_f64().expect("a number");
    // Half of the pixels differ: red by 1/8, green by half of that, blue not at all.
    let rmse = (0.5 * (0.015_625 + 0.003_906_25) / 3.0_f64).sqrt();
    assert!((metric("rmse") - rmse).abs() < 1e-7, "{found}");
    assert_eq!((metric("max"), metric("outliers")), (0.125, 0.5));
    for (option, value, higher_is_better) in [
        ("--max-rmse", metric("rmse"), false),
        ("--max-relmse", metric("relative_mse"), false),
        ("--max-difference", metric("max"), false),
        ("--min-psnr", metric("psnr"), true),
        ("--min-ssim", metric("ssim"), true),
        ("--max-flip", metric("flip"), false),
        ("--max-energy", metric("energy_ratio") - 1.0, false),
        ("--max-outliers", metric("outliers"), false),
    ] {
        assert!(value > 0.0, "{option}: {found}");
        let (met, missed) = if higher_is_better { (0.99, 1.01) } else { (1.01, 0.99) };
        let limit = |factor: f64| format!("{option}={}", value * factor);
        exits_with(0, folder.path(), &["a.exr", "b.exr", &limit(met)]);
        let printed = exits_with(1, folder.path(), &["a.exr", "b.exr", &limit(missed)]);
        assert!(printed.contains("beyond: ") && printed.contains(option), "{printed}");
    }
    let both = json(1, folder.path(), &["a.exr", "b.exr", "--max-rmse", "1", "--max-flip", "0"]);
    assert_eq!((&both["limits"][0]["within"], &both["limits"][1]["within"]), (&true.into(), &false.into()));
    assert_eq!(both["within"], false);
}

#[test]
fn chosen_metrics_alone_are_printed() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "a.png", &slope(16, 16, 0.0));
    let printed = exits_with(0, folder.path(), &["a.png", "a.png", "--metric", "rmse,flip"]);
    assert!(printed.contains("RMSE") && printed.contains("FLIP") && !printed.contains("SSIM"), "{printed}");
    let printed = exits_with(2, folder.path(), &["a.png", "a.png", "--metric", "rmes"]);
    assert!(printed.contains("did you mean `rmse`?"), "{printed}");
}

#[test]
fn the_heat_map_and_the_strip_show_where_the_error_is() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "a.png", &slope(64, 16, 0.5));
    write(folder.path(), "b.png", &slope(64, 16, 0.0));
    exits_with(0, folder.path(), &["a.png", "b.png", "--heat", "heat.png", "--strip", "strip.png"]);
    let read = |name: &str| read_image(&folder.path().join(name)).expect("a picture").image;
    let (heat, strip) = (read("heat.png"), read("strip.png"));
    assert_eq!((heat.width, heat.height, strip.width, strip.height), (64, 16, 192, 16));
    assert!(heat.pixels[4][0] > 0.8 && heat.pixels[63][0] < 0.1, "{:?} {:?}", heat.pixels[4], heat.pixels[63]);
    assert_eq!(strip.pixels[..64], read("a.png").pixels[..64]);
    assert_eq!(strip.pixels[64..128], read("b.png").pixels[..64]);
    assert_eq!(strip.pixels[128..192], heat.pixels[..64]);
    for wrong in ["heat.exr", "no/such/folder/heat.png"] {
        exits_with(2, folder.path(), &["a.png", "b.png", "--heat", wrong]);
    }
}

#[test]
fn pictures_that_cannot_be_compared_say_what_to_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let image = slope(8, 8, 0.0);
    write(folder.path(), "a.exr", &image);
    write(folder.path(), "a.png", &image);
    let mut broken = image.clone();
    broken.pixels[8 * 5 + 3][1] = f32::NAN;
    write(folder.path(), "nan.exr", &broken);
    write(folder.path(), "small.exr", &slope(8, 7, 0.0));
    let position = Layer { name: "pos", channels: ["X", "Y", "Z", "cosine"], image: &image };
    write_exr(&folder.path().join("pos.exr"), position).expect("written");
    std::fs::write(folder.path().join("text.png"), "no picture").expect("written");
    for (code, arguments, words) in [
        (3, ["a.exr", "nan.exr"], &["nan.exr", "1 pixel is", "x 3, y 5", "green is NaN", "render it again"][..]),
        (3, ["nan.exr", "nan.exr"], &["green is NaN"]),
        (3, ["a.exr", "small.exr"], &["8 x 8", "8 x 7", "@size=8x7"]),
        (3, ["a.exr", "pos.exr"], &["R G B A", "X Y Z cosine", "same content"]),
        (3, ["text.png", "a.exr"], &["text.png", "no whole PNG"]),
        (3, ["missing.png", "a.exr"], &["missing.png", "cannot be opened"]),
        (2, ["a.jpg", "a.exr"], &["a.jpg", "FILE.png, FILE.exr"]),
        (3, ["missing.xml@", "a.exr"], &["missing.xml"]),
    ] {
        let printed = exits_with(code, folder.path(), &arguments);
        for word in words {
            assert!(printed.contains(word), "{arguments:?}: no `{word}` in\n{printed}");
        }
    }
    let printed = exits_with(0, folder.path(), &["a.png", "a.exr"]);
    assert!(printed.contains("note: a.png is a PNG"), "{printed}");
    let printed = exits_with(0, folder.path(), &["pos.exr", "pos.exr"]);
    assert!(printed.contains("note: the channels are X Y Z"), "{printed}");
    for (wrong, word) in
        [("--max-rmse=-1", "0 or more"), ("--max-z=4", "--seeds"), ("--pixels-per-degree=0", "1 to 1000")]
    {
        let printed = exits_with(2, folder.path(), &["a.exr", "a.exr", wrong]);
        assert!(printed.contains(word), "{wrong}: {printed}");
    }
    exits_with(2, folder.path(), &["a.exr", "a.exr", "--seeds", "4"]);
}

#[test]
fn mistakes_in_a_setting_point_at_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let project = spec("SceneSSAO.xml", "");
    let project = project.split_once('@').expect("a project").0;
    for (setting, words) in [
        ("bakend=cpu", &["did you mean `backend`?", "\n", "^"][..]),
        ("size=8x8,raster=gpu", &["auto, cpu, wgpu"]),
        ("raster=cpu,camera=Vidor", &["did you mean `Vidro`?"]),
        ("raster=cpu,pass2.sampels=4", &["did you mean `samples`?"]),
        ("raster=cpu,pass9.samples=4", &["pass2"]),
        ("raster=cpu,pipeline=none", &["fixedfunction"]),
    ] {
        let printed = exits_with(2, folder.path(), &[&format!("{project}@{setting}"), "a.png"]);
        for word in words {
            assert!(printed.contains(word), "{setting}: no `{word}` in\n{printed}");
        }
    }
}

#[test]
fn a_project_equals_itself_and_differs_from_the_report_as_it_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let corrected = spec("SceneFinal.xml", "size=48x48,pass2.samples=4");
    let thesis = format!("{corrected},fidelity=thesis");
    let printed = exits_with(0, folder.path(), &[&corrected, &corrected, "--max-rmse", "0"]);
    assert_eq!(printed.matches("one frame, without a warm-up; raster cpu, rays cpu").count(), 2, "{printed}");
    let printed = exits_with(1, folder.path(), &[&thesis, &corrected, "--max-rmse", "0.001", "--strip", "strip.png"]);
    assert!(printed.contains("beyond: rmse"), "{printed}");
    assert_eq!(read_image(&folder.path().join("strip.png")).expect("a picture").image.width, 3 * 48);
    let found = json(0, folder.path(), &[&thesis, &corrected]);
    assert!(found["test"]["rendered"]["frame_ms"].as_f64() > Some(0.0), "{found}");
    assert!(found["reference"]["rendered"]["frame_ms"].as_f64() > Some(0.0), "{found}");
}

#[test]
fn a_rendered_file_equals_its_project() {
    let folder = tempfile::tempdir().expect("a folder");
    let project = spec("SceneShadows.xml", "size=32x32");
    let path = project.split_once('@').expect("a project").0;
    let render = ["render", path, "--size", "32x32", "--raster", "cpu", "-o", "out.exr"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    assert!(command.current_dir(folder.path()).args(render).output().expect("it runs").status.success());
    let found = json(0, folder.path(), &["out.exr", &project, "--max-difference", "0"]);
    assert_eq!((&found["test"]["rendered"], &found["z_test"]), (&Value::Null, &Value::Null));
}

#[test]
fn few_and_many_samples_of_occlusion_differ_by_noise_and_a_larger_radius_does_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let occlusion = |settings: &str| spec("SceneSSAO.xml", &format!("size=64x64,pass2.intensity=1,{settings}"));
    let many = occlusion("pass2.samples=100");
    let few = occlusion("pass2.samples=4");
    let found = json(0, folder.path(), &[&few, &many, "--seeds", "8", "--max-z", "4"]);
    assert_eq!(found["z_test"]["verdict"], "noise", "{}", found["z_test"]);
    assert!(found["metrics"]["rmse"].as_f64() > Some(1e-4), "different noise, equal pictures: {found}");
    assert_eq!(
        (&found["test"]["rendered"]["first_seed"], &found["reference"]["rendered"]["first_seed"]),
        (&0.into(), &8.into())
    );
    let farther = occlusion("pass2.samples=4,pass2.radius=0.6");
    let found = json(1, folder.path(), &[&farther, &many, "--seeds", "8", "--max-z", "4"]);
    assert_eq!(found["z_test"]["verdict"], "different", "{}", found["z_test"]);
}

#[test]
fn files_that_carry_a_variance_are_tested_for_noise() {
    let folder = tempfile::tempdir().expect("a folder");
    let variance = Image::filled(32, 24, [0.01, 0.01, 0.01, 0.0]);
    let write = |name: &str, image: &Image| {
        let layers = [
            Layer { name: "window", channels: RGBA, image },
            Layer { name: "variance:16", channels: RGBA, image: &variance },
        ];
        write_exr_layers(&folder.path().join(name), &layers).expect("written");
    };
    write("a.exr", &slope(32, 24, 0.0));
    write("b.exr", &slope(32, 24, 0.01));
    write("c.exr", &slope(32, 24, 0.5));
    let small = json(0, folder.path(), &["b.exr", "a.exr", "--max-z", "4"]);
    assert_eq!((&small["z_test"]["verdict"], &small["z_test"]["values"]), (&"noise".into(), &2304.into()));
    let large = json(1, folder.path(), &["c.exr", "a.exr", "--max-z", "4"]);
    assert_eq!(large["z_test"]["verdict"], "different");
    self::write(folder.path(), "plain.exr", &slope(32, 24, 0.0));
    let printed = exits_with(0, folder.path(), &["a.exr", "plain.exr"]);
    assert!(printed.contains("no z-test") && printed.contains("--seeds N"), "{printed}");
}

#[test]
fn the_long_help_holds_formulas_and_exit_codes() {
    let folder = tempfile::tempdir().expect("a folder");
    let printed = exits_with(0, folder.path(), &["--help"]);
    for word in
        ["sqrt(sum((t - r)^2) / n)", "Wang et al. 2004", "Andersson et al. 2020", "Exit codes: 0 within", "PASS.NAME"]
    {
        let squeezed = printed.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(squeezed.contains(word), "no `{word}` in\n{printed}");
    }
}
