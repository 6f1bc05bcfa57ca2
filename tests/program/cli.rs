//! The command line as a user or a script runs it: its output, its files, and its exit codes.

use curitiba::pipeline::programs::RAY_PROGRAMS;
use curitiba::pipeline::raster_effects::EFFECT_PROGRAMS;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn project(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name)
}

fn curitiba(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).args(arguments).env("NO_COLOR", "1").output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("output is UTF-8")
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) -> String {
    let output = curitiba(folder, arguments);
    assert!(output.status.success(), "{arguments:?} failed:\n{}", text(&output.stderr));
    text(&output.stdout)
}

#[track_caller]
fn fails_with(code: i32, folder: &Path, arguments: &[&str]) -> String {
    let output = curitiba(folder, arguments);
    assert_eq!(output.status.code(), Some(code), "{arguments:?} printed:\n{}", text(&output.stderr));
    text(&output.stderr)
}

fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("the folder exists");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn path(path: &Path) -> &str {
    path.to_str().expect("test paths are UTF-8")
}

#[test]
fn rendering_writes_the_picture_and_prints_a_row_for_each_step() {
    let folder = tempfile::tempdir().expect("a folder");
    let printed = succeeds(
        folder.path(),
        &["render", path(&project("SceneFinal.xml")), "--size", "48x48", "--raster", "cpu", "--set", "pass2.samples=4"],
    );
    for word in ["load", "build", "raster", "rays", "quad", "write", "pass1", "pass2", "pass5", "wrote SceneFinal.png"]
    {
        assert!(printed.contains(word), "no `{word}` in\n{printed}");
    }
    assert_eq!(files(folder.path()), ["SceneFinal.png"]);
    let png = std::fs::read(folder.path().join("SceneFinal.png")).expect("the picture");
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    let side = |offset: usize| u32::from_be_bytes(png[offset..offset + 4].try_into().expect("four bytes"));
    assert_eq!((side(16), side(20)), (48, 48));
}

#[test]
fn the_json_report_holds_every_sample_and_nothing_else_is_printed() {
    let folder = tempfile::tempdir().expect("a folder");
    let printed = succeeds(
        folder.path(),
        &[
            "render",
            path(&project("SceneShadows.xml")),
            "--size",
            "32x32",
            "--raster",
            "cpu",
            "--frames",
            "3",
            "--json",
        ],
    );
    let report: serde_json::Value = serde_json::from_str(&printed).expect("JSON");
    let steps = report["steps"].as_array().expect("steps");
    let rays = steps.iter().find(|step| step["kind"] == "rays").expect("a rays step");
    assert_eq!(rays["host_ms"].as_array().map(Vec::len), Some(3));
    assert!(rays["rays"]["shadow"].as_u64() > Some(0));
    assert_eq!(report["raster"]["name"], "cpu");
    assert_eq!(report["files"][0]["path"], "SceneShadows.png");
}

#[test]
fn shown_targets_are_written_as_exr_and_as_png() {
    let folder = tempfile::tempdir().expect("a folder");
    succeeds(
        folder.path(),
        &[
            "render",
            path(&project("SceneShadows.xml")),
            "--size",
            "32x32",
            "--raster",
            "cpu",
            "--show",
            "pos",
            "--show",
            "norm",
            "-o",
            "out.exr",
        ],
    );
    assert_eq!(files(folder.path()), ["out.exr", "out.norm.exr", "out.norm.png", "out.pos.exr", "out.pos.png"]);
}

#[test]
fn the_picture_does_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let render = |threads: &str, output: &str| {
        let project = project("SceneFinal.xml");
        let arguments =
            ["render", path(&project), "--size", "64x64", "--raster", "cpu", "--set", "pass2.samples=9", "-o", output];
        succeeds(folder.path(), &[&arguments[..], &["--threads", threads]].concat());
        std::fs::read(folder.path().join(output)).expect("the picture")
    };
    let (one, three) = (render("1", "one.exr"), render("3", "three.exr"));
    assert!(one == three, "1 and 3 threads give different pictures");
    let project = project("SceneFinal.xml");
    let arguments = ["render", path(&project), "--size", "64x64", "--raster", "cpu", "--set", "pass2.samples=9"];
    succeeds(folder.path(), &[&arguments[..], &["--seed", "1", "-o", "other.exr"]].concat());
    assert!(
        std::fs::read(folder.path().join("other.exr")).expect("the picture") != one,
        "another seed, the same picture"
    );
}

#[test]
fn a_wrong_command_line_exits_with_2_and_says_what_is_valid() {
    let folder = tempfile::tempdir().expect("a folder");
    let final_scene = project("SceneFinal.xml");
    let render = ["render", path(&final_scene), "--raster", "cpu"];
    let with = |more: &[&str]| fails_with(2, folder.path(), &[&render[..], more].concat());
    assert!(with(&["--camera", "Vidor"]).contains("did you mean `Vidro`?"));
    assert!(with(&["-o", "picture.bmp"]).contains(".png or .exr"));
    assert!(with(&["-o", "no/such/folder/picture.png"]).contains("no folder"));
    assert!(with(&["--set", "pass2.sampels=4"]).contains("did you mean `samples`?"));
    assert!(with(&["--set", "pass9.samples=4"]).contains("pass2"));
    assert!(with(&["--set", "pass2.samples=4.5"]).contains("0..=65536"));
    assert!(with(&["--set", "pass2.samples=7", "--fidelity", "thesis"]).contains("such as 4"));
    assert!(with(&["--show", "position"]).contains("pos"));
    assert!(with(&["--size", "70000x1"]).contains("65536"));
    assert!(with(&["--size", "65536x65536", "--max-memory", "64MiB"]).contains("--max-memory"));
    assert!(with(&["--size", "64x64", "--crop", "40,0,32x32"]).contains("does not lie in the window"));
    assert!(with(&["--crop", "0,0,8x8,8"]).contains("512,256,128x64"));
    assert!(with(&["--bands", "2", "--show", "pos", "--size", "64x256"]).contains("--show"));
    assert!(with(&["--crop", "0,0,8x8", "--size", "640x640", "--pixel", "1,1"]).contains("whole pictures"));
    assert_eq!(files(folder.path()), [] as [&str; 0]);
}

#[test]
fn a_wrong_project_exits_with_3_and_names_file_line_and_column() {
    let folder = tempfile::tempdir().expect("a folder");
    let missing = fails_with(3, folder.path(), &["render", "nowhere.xml"]);
    assert!(missing.contains("nowhere.xml"), "{missing}");
    std::fs::write(folder.path().join("broken.xml"), "<?xml version=\"1.0\"?>\n<project name=\"x\">\n  <assets>\n")
        .expect("written");
    let broken = fails_with(3, folder.path(), &["check", "broken.xml"]);
    assert!(broken.contains("broken.xml:"), "{broken}");
    assert!(broken.contains("1 error"), "{broken}");
}

#[test]
fn a_scene_that_is_missing_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = std::fs::read_to_string(project("SceneFinal.xml")).expect("the project");
    std::fs::write(folder.path().join("p.xml"), text.replace("largoCamoes", "elsewhere")).expect("written");
    std::fs::create_dir(folder.path().join("mlibs")).expect("made");
    for library in ["optixTest.mlib", "DeferredRenderTargets.mlib"] {
        std::fs::copy(project("mlibs").join(library), folder.path().join("mlibs").join(library)).expect("copied");
    }
    let message = fails_with(3, folder.path(), &["render", "p.xml", "--raster", "cpu"]);
    assert!(message.contains("elsewhere.cbo"), "{message}");
    assert_eq!(files(folder.path()), ["mlibs", "p.xml"]);

    // `check` reports both errors: the one in the XML, and the missing scene file.
    let wrong = text.replace("largoCamoes", "elsewhere").replacen("<camera name=", "<camera nane=", 1);
    std::fs::write(folder.path().join("q.xml"), wrong).expect("written");
    let message = fails_with(3, folder.path(), &["check", "q.xml"]);
    assert!(message.contains("elsewhere.cbo: there is no such file"), "{message}");
    assert!(message.contains("lacks `name`"), "{message}");
}

#[test]
fn too_little_memory_is_said_before_anything_is_rendered() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = project("SceneFinal.xml");
    let arguments = ["render", path(&scene), "--raster", "cpu", "--size", "64x64", "--max-memory", "1MiB"];
    let output = curitiba(folder.path(), &arguments);
    assert!(!output.status.success());
    assert!(text(&output.stderr).contains("--max-memory"), "{}", text(&output.stderr));
    assert_eq!(files(folder.path()), [] as [&str; 0]);
}

#[test]
fn every_shipped_project_checks_without_a_problem() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["NoEffects", "Dummy", "Shadows", "Reflect", "Refract", "SSAO", "Final"] {
        let printed = succeeds(folder.path(), &["check", path(&project(&format!("Scene{name}.xml")))]);
        assert!(printed.contains(": ok"), "{printed}");
    }
}

#[test]
fn the_plan_says_what_is_left_out_and_why() {
    let folder = tempfile::tempdir().expect("a folder");
    let shadows = succeeds(folder.path(), &["plan", path(&project("SceneShadows.xml"))]);
    assert!(
        shadows.contains("no  attachment `Deferred Render Targets::norm` of pass `pass1`: no pass reads it"),
        "{shadows}"
    );
    assert!(shadows.contains("yes acceleration structure for pass `pass2`"), "{shadows}");
    let dummy = succeeds(folder.path(), &["plan", path(&project("SceneDummy.xml"))]);
    assert!(dummy.contains("no  acceleration structure for pass `pass2`"), "{dummy}");
    assert!(dummy.contains("no  attachment `Deferred Render Targets::pos` of pass `pass1`"), "{dummy}");
}

#[test]
fn the_plan_recommends_a_filter_to_few_rays_of_a_long_radius() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |set: &[&str]| {
        let project = project("SceneSSAO.xml");
        let set = set.iter().flat_map(|set| ["--set", set]);
        let arguments: Vec<&str> = ["plan", path(&project)].into_iter().chain(set).collect();
        succeeds(folder.path(), &arguments)
    };
    let said = of(&["pass2.samples=4", "pass2.radius=90"]);
    let reason = "no  filter of pass `pass2`: recommended, and not asked for: of 4 samples and a radius of 5 % of the";
    assert!(said.contains(reason) && said.contains("filter=2"), "{said}");
    for set in [
        &["pass2.samples=4", "pass2.radius=40"][..],
        &["pass2.samples=64", "pass2.radius=90"],
        &["pass2.samples=4", "pass2.radius=90", "pass2.filter=2"],
    ] {
        assert!(!of(set).contains("recommended"), "{set:?}");
    }
}

#[test]
fn the_list_names_every_program_and_its_snippets_load() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = succeeds(folder.path(), &["list"]);
    let whole = std::fs::read_to_string(project("SceneFinal.xml")).expect("the project");
    let start = whole.find("<pass class=\"optix\"").expect("a ray pass");
    let end = start + whole[start..].find("</pass>").expect("its end") + "</pass>".len();
    let rays = RAY_PROGRAMS.iter().map(|info| info.stem);
    for program in rays.chain(EFFECT_PROGRAMS.iter().map(|info| info.name)) {
        assert!(all.contains(program), "{all}");
        let described = succeeds(folder.path(), &["list", program]);
        let snippet = &described[described.find("<pass").expect("a snippet")..];
        let file = folder.path().join(format!("{program}.xml"));
        let mut text = format!("{}{snippet}{}", &whole[..start], &whole[end..]);
        for inside in ["3dsmodels", "mlibs"] {
            text = text.replace(&format!("{inside}\\"), &format!("{}/", path(&project(inside))));
        }
        std::fs::write(&file, text).expect("written");
        let output = curitiba(folder.path(), &["check", path(&file)]);
        assert!(output.status.success(), "{program}:\n{}", text_of_both(&output));
    }
    let wrong = fails_with(2, folder.path(), &["list", "sao"]);
    assert!(wrong.contains("did you mean `ssao`?"), "{wrong}");
}

fn text_of_both(output: &Output) -> String {
    format!("{}{}", text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_generated_square_is_described_converted_and_described_alike() {
    let folder = tempfile::tempdir().expect("a folder");
    succeeds(folder.path(), &["scene", "--generate", "10000", "-o", "square"]);
    let triangles = |file: &str| {
        let printed = succeeds(folder.path(), &["scene", file, "--json"]);
        let statistics: serde_json::Value = serde_json::from_str(&printed).expect("JSON");
        statistics["triangles"].as_u64().expect("a count")
    };
    let generated = triangles("square/largoCamoes.cbo");
    assert!((8_500..=11_500).contains(&generated), "{generated}");
    succeeds(folder.path(), &["scene", "square/largoCamoes.cbo", "-o", "today.nbo"]);
    assert_eq!(triangles("today.nbo"), generated);
    assert!(fails_with(2, folder.path(), &["scene", "today.nbo", "-o", "x.obj"]).contains(".cbo"));
    assert!(fails_with(3, folder.path(), &["scene", "missing.obj"]).contains("missing.obj"));
}

#[test]
fn completions_are_printed_for_every_shell() {
    let folder = tempfile::tempdir().expect("a folder");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(succeeds(folder.path(), &["completions", shell]).contains("curitiba"));
    }
}

#[test]
fn every_command_has_a_manual_page_that_man_reads() {
    let folder = tempfile::tempdir().expect("a folder");
    let help = succeeds(folder.path(), &["--help"]);
    let list = help.split("Commands:").nth(1).and_then(|rest| rest.split("\n\n").next()).expect("a list of commands");
    // Command names are indented by two columns, and their descriptions by more.
    let names = list.lines().filter_map(|line| line.strip_prefix("  ")).filter(|line| !line.starts_with(' '));
    let names: Vec<&str> =
        names.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help").collect();
    assert!(names.len() > 10 && names.contains(&"render"), "{names:?}");
    let printed = succeeds(folder.path(), &["man", "pages"]);
    assert!(printed.starts_with(&format!("wrote {} pages", names.len() + 1)), "{printed}");
    let mut pages: Vec<PathBuf> =
        names.iter().map(|name| folder.path().join(format!("pages/curitiba-{name}.1"))).collect();
    pages.push(folder.path().join("pages/curitiba.1"));
    assert_eq!(succeeds(folder.path(), &["man"]), std::fs::read_to_string(&pages[names.len()]).expect("a page"));
    let render = std::fs::read_to_string(folder.path().join("pages/curitiba-render.1")).expect("a page");
    for part in [".SH NAME\ncuritiba\\-render", ".SH OPTIONS", "\\-\\-frames", ".SH EXAMPLES\n.nf\n"] {
        assert!(render.contains(part), "{part}: {render}");
    }
    if Command::new("groff").arg("--version").output().is_err() {
        println!("skipped: groff is not installed");
        return;
    }
    for page in pages {
        let output = Command::new("groff").args(["-man", "-Kutf8", "-Tutf8", "-ww", "-z"]).arg(&page).output();
        let told = String::from_utf8(output.expect("groff starts").stderr).expect("text");
        assert_eq!(told, "", "{}", page.display());
    }
}

#[test]
fn an_existing_picture_survives_a_run_that_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("out.png"), b"precious").expect("written");
    fails_with(3, folder.path(), &["render", "nowhere.xml", "-o", "out.png"]);
    assert_eq!(std::fs::read(folder.path().join("out.png")).expect("still there"), b"precious");
}

#[test]
fn a_pixel_is_explained_by_its_rays_in_both_fidelities() {
    let folder = tempfile::tempdir().expect("a folder");
    let explain = |name: &str, more: &[&str]| {
        let project = project(name);
        let arguments = ["render", path(&project), "--size", "48x48", "--raster", "cpu", "-o", "p.png"];
        succeeds(folder.path(), &[&arguments[..], more].concat())
    };
    for fidelity in ["corrected", "thesis"] {
        let printed = explain("SceneShadows.xml", &["--pixel", "24,40", "--fidelity", fidelity]);
        for part in ["pixel 24,40", fidelity, "position", "shadow ray, weight 1", "from", "along", "wrote"] {
            assert!(printed.contains(part), "no `{part}` in\n{printed}");
        }
        assert!(!printed.contains("another ray backend"), "the explained value is the pass's:\n{printed}");
        let printed = explain("SceneRefract.xml", &["--camera", "Vidro", "--pixel", "24,24", "--fidelity", fidelity]);
        assert!(printed.contains("reflected ray, weight") && printed.contains("refracted ray, weight"), "{printed}");
    }
    let printed = explain("SceneSSAO.xml", &["--pixel", "30,30", "--set", "pass2.samples=4", "--frames", "2"]);
    assert!(printed.contains("occlusion ray, weight 0.25") || printed.contains("certain without a ray"), "{printed}");
    assert_eq!(printed.matches("ssao, corrected, pixel 30,30").count(), 1, "once, in the first frame");
    let project = project("SceneShadows.xml");
    let arguments = ["render", path(&project), "--size", "48x48", "--raster", "cpu"];
    let outside = fails_with(2, folder.path(), &[&arguments[..], &["--pixel", "48,0"]].concat());
    assert!(outside.contains("outside the window of 48 x 48"), "{outside}");
    assert!(fails_with(2, folder.path(), &[&arguments[..], &["--pixel", "4"]].concat()).contains("512,300"));
}

#[test]
fn sound_numbers_pass_the_check() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["NoEffects", "Dummy", "Shadows", "Reflect", "Refract", "SSAO", "Final"] {
        let project = project(&format!("Scene{name}.xml"));
        let set: &[&str] = if matches!(name, "SSAO" | "Final") { &["--set", "pass2.samples=4"] } else { &[] };
        let arguments =
            ["render", path(&project), "--size", "64x64", "--raster", "cpu", "--check-numerics", "-o", "p.png"];
        let printed = succeeds(folder.path(), &[&arguments[..], set].concat());
        assert!(printed.contains("channels checked, every value is finite and in its range"), "{printed}");
    }
}

#[test]
fn numbers_out_of_range_fail_the_check_with_1_and_name_pass_and_channel() {
    let folder = tempfile::tempdir().expect("a folder");
    // The report's Fresnel weights are outside 0..1 on a pane seen at a grazing angle.
    let refract = project("SceneRefract.xml");
    let arguments = ["render", path(&refract), "--camera", "Vidro", "--size", "64x64", "--raster", "cpu"];
    let arguments = [&arguments[..], &["--fidelity", "thesis", "--check-numerics", "-o", "p.png"]].concat();
    let message = fails_with(1, folder.path(), &arguments);
    assert!(message.contains("pass `pass2`") && message.contains(".red: ") && message.contains(" negative; first at"));
    assert!(message.contains("--pixel "), "{message}");
    assert_eq!(files(folder.path()), ["p.png"], "the picture is written, to look at");

    // Positions beyond the range of 16-bit floats, in a scene too wide for recentring to help: the declared format of
    // the target makes them infinite.
    std::fs::create_dir(folder.path().join("mlibs")).expect("made");
    for library in ["optixTest.mlib", "DeferredRenderTargets.mlib"] {
        let text = std::fs::read_to_string(project("mlibs").join(library)).expect("the library");
        std::fs::write(folder.path().join("mlibs").join(library), text.replace("RGBA32F", "RGBA16F")).expect("written");
    }
    std::fs::write(
        folder.path().join("far.obj"),
        "v -100010 -10 -5\nv 100010 -10 -5\nv 100000 10 -5\nvn 0 0 1\nf 1//1 2//1 3//1\n",
    )
    .expect("written");
    let text = std::fs::read_to_string(project("SceneShadows.xml")).expect("the project");
    let camera = text.find("<position ").expect("a camera");
    let end = camera + text[camera..].find("<up ").expect("its end");
    let text = format!(
        "{}<position x=\"100000.0\" y=\"0.0\" z=\"5.0\"/><view x=\"0.0\" y=\"0.0\" z=\"-1.0\"/>{}",
        &text[..camera],
        &text[end..]
    );
    std::fs::write(folder.path().join("p.xml"), text.replace("3dsmodels\\largoCamoes.cbo", "far.obj"))
        .expect("written");
    let arguments = ["render", "p.xml", "--size", "32x32", "--raster", "cpu", "--check-numerics"];
    let message = fails_with(1, folder.path(), &arguments);
    assert!(
        message.contains("pass `pass1`") && message.contains("::pos.x: ") && message.contains(" infinite"),
        "{message}"
    );
}

#[test]
#[cfg(unix)]
fn the_window_is_started_with_the_same_arguments_and_its_absence_says_how_to_build_it() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().expect("a folder");
    // `cp` writes the programs in another process. A descriptor of this process that is open for writing would be inherited by the children
    // that other tests start, and the system refuses to start a program that is open for writing.
    let put = |from: &Path, name: &str| {
        let to = folder.path().join(name);
        assert!(Command::new("cp").arg(from).arg(&to).status().expect("cp starts").success());
        to
    };
    // A copy of the program in a folder whose other files are known.
    let program = put(Path::new(env!("CARGO_BIN_EXE_curitiba")), "curitiba");
    let start = |arguments: &[&str]| {
        let mut command = Command::new(&program);
        command.current_dir(folder.path()).args(arguments).env("PATH", "").output().expect("the program starts")
    };
    let absent = start(&["view", "p.xml"]);
    let printed = text(&absent.stderr);
    assert_eq!(absent.status.code(), Some(1), "{printed}");
    assert!(printed.contains("curitiba-view") && printed.contains("--package curitiba-view"), "{printed}");
    let script = folder.path().join("script");
    std::fs::write(&script, "#!/bin/sh\nfor word; do printf '<%s>' \"$word\"; done\nexit 7\n").expect("written");
    std::fs::set_permissions(&script, std::fs::Permissions::from_mode(0o755)).expect("made executable");
    put(&script, "curitiba-view");
    let there = start(&["view", "a b.xml", "--size", "64x48", "--help"]);
    assert_eq!((text(&there.stdout).as_str(), there.status.code()), ("<a b.xml><--size><64x48><--help>", Some(7)));
    let confined = start(&["--confine", ".", "view", "p.xml"]);
    assert_eq!(text(&confined.stdout), "<--confine><.><p.xml>", "{}", text(&confined.stderr));
}
