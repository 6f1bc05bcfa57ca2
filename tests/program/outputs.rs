//! The files that are written and read: names of outputs, which files may be replaced, and `--confine`.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn project(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name)
}

fn curitiba(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).args(arguments).env("NO_COLOR", "1").env("CURITIBA_CACHE", folder.join("references"));
    command.output().expect("the program starts")
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) -> (String, String) {
    let output = curitiba(folder, arguments);
    let [printed, told] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8"));
    assert!(output.status.success(), "{arguments:?} failed:\n{told}");
    (printed, told)
}

#[track_caller]
fn fails_with(code: i32, folder: &Path, arguments: &[&str]) -> String {
    let output = curitiba(folder, arguments);
    let told = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(code), "{arguments:?} printed:\n{told}");
    told
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<String> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A changed copy of one of the report's projects with its libraries; the square itself is not copied.
fn changed(folder: &Path, change: impl Fn(String) -> String) -> String {
    let copy = |from: PathBuf, to: PathBuf| {
        let text = std::fs::read_to_string(&from).expect("a file of the project");
        let models = project("3dsmodels").display().to_string();
        std::fs::write(to, change(text.replace("3dsmodels", &models))).expect("written");
    };
    std::fs::create_dir_all(folder.join("mlibs")).expect("a folder");
    for entry in std::fs::read_dir(project("mlibs")).expect("libraries") {
        let path = entry.expect("an entry").path();
        copy(path.clone(), folder.join("mlibs").join(path.file_name().expect("a name")));
    }
    copy(project("SceneShadows.xml"), folder.join("p.xml"));
    folder.join("p.xml").display().to_string()
}

const SMALL: [&str; 4] = ["--size", "16x16", "--raster", "cpu"];

#[test]
fn no_exr_file_has_a_channel_that_viewers_take_for_opacity() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let xml = project("SceneShadows.xml").display().to_string();
    succeeds(folder, &[&["render", xml.as_str()][..], &SMALL, &["--show", "all", "-o", "out.exr"]].concat());
    let read = |name: &str| curitiba::pipeline::image::read_image(&folder.join(name)).expect("a picture");
    for (name, channels) in [
        ("out.exr", "R G B W"),
        ("out.color.exr", "R G B W"),
        ("out.pos.exr", "X Y Z cosine"),
        ("out.norm.exr", "X Y Z W"),
    ] {
        assert_eq!(read(name).channels.join(" "), channels, "{name}");
    }
    // The channel itself is written as before: here it is the light's cosine, which is neither 0 nor 1 everywhere.
    let color = read("out.color.exr").image;
    assert!(color.pixels.iter().any(|pixel| pixel[3] > 0.0 && pixel[3] < 1.0));
}

#[test]
fn names_of_outputs_are_safe_and_no_two_are_one_file() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    // A channel whose name looks like a path.
    let xml = changed(folder, |text| text.replace("\"norm\"", "\"a/b\"").replace("::norm", "::a/b"));
    let xml = xml.as_str();
    succeeds(folder, &[&["render", xml][..], &SMALL, &["--show", "a/b", "-o", "out.png"]].concat());
    assert!(names(folder).contains(&"out.a_b.exr".to_owned()), "{:?}", names(folder));

    // Two libraries with channels of the same name.
    let xml =
        changed(folder, |text| text.replace("\"offscreenrender\"", "\"pos\"").replace("::offscreenrender", "::pos"));
    succeeds(folder, &[&["render", &xml][..], &SMALL, &["--show", "all", "-o", "both.png"]].concat());
    let [one, other] = ["Deferred Render Targets", "Optix Ray Tracer Render Target"]
        .map(|library| std::fs::read(folder.join(format!("both.{library}.pos.exr"))).expect("both are written"));
    assert!(one != other);
    let written = names(folder).into_iter().filter(|name| name.starts_with("both")).count();
    assert_eq!(written, 9, "{:?}", names(folder));
    assert!(folder.join("both.norm.exr").exists());

    // Two channels of one library whose files would have the same name.
    let xml = changed(folder, |text| {
        let text = text.replace("\"norm\"", "\"a/b\"").replace("::norm", "::a/b");
        text.replace("\"pos\"", "\"a_b\"").replace("::pos", "::a_b")
    });
    let all = [&["render", &xml][..], &SMALL, &["--show", "all", "-o", "twice.png"]].concat();
    let told = fails_with(2, folder, &all);
    assert!(told.contains("written twice") && told.contains("a/b") && told.contains("a_b"), "{told}");
    assert!(!names(folder).iter().any(|name| name.starts_with("twice")), "nothing is rendered: {:?}", names(folder));
}

#[test]
fn outputs_that_cannot_be_written_are_errors_before_anything_is_rendered() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let (shadows, models) = (project("SceneShadows.xml").display().to_string(), project("3dsmodels"));
    let texture = names(&models.join("Texturas")).into_iter().find(|name| name.ends_with(".png")).expect("a texture");
    std::fs::create_dir_all(folder.join("d.png")).expect("a folder");
    let fails = |code: i32, output: &str, word: &str| {
        let told =
            fails_with(code, folder, &[&["render", &shadows][..], &SMALL, &["--show", "pos", "-o", output]].concat());
        assert!(told.contains(word), "{output}: {told}");
    };
    fails(2, "no/such/a.png", "there is no folder no/such");
    fails(2, "d.png", "this is a folder");
    fails(1, &format!("{}.png", "x".repeat(260)), "too long");
    // The picture's own name fits, but a channel's is too long.
    fails(1, &format!("{}.png", "x".repeat(248)), "too long");
    assert_eq!(names(folder), ["d.png"]);
    // Inputs are never replaced.
    let texture = models.join("Texturas").join(texture).display().to_string();
    let before = std::fs::read(&texture).expect("a texture");
    fails(2, &texture, "this file is read, and would be replaced");
    assert!(std::fs::read(&texture).expect("a texture") == before);

    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        assert!(Command::new("mkfifo").arg(folder.join("pipe.png")).status().expect("mkfifo is there").success());
        fails(2, "pipe.png", "not a regular file");
        std::os::unix::fs::symlink("circle.png", folder.join("circle.png")).expect("a link");
        fails(1, "circle.png", "circle");
        std::fs::create_dir(folder.join("locked")).expect("a folder");
        std::fs::write(folder.join("fixed.png"), "x").expect("a file");
        for (name, mode) in [("locked", 0o555), ("fixed.png", 0o444)] {
            std::fs::set_permissions(folder.join(name), std::fs::Permissions::from_mode(mode)).expect("set");
        }
        if std::fs::write(folder.join("locked/x"), "").is_ok() {
            println!("skipped: this user may write into read-only folders");
        } else {
            fails(1, "locked/a.png", "nothing can be written into its folder");
            fails(1, "fixed.png", "ermission denied");
        }
    }
}

#[cfg(unix)]
#[test]
fn a_replaced_file_keeps_its_mode_and_a_link_stays_a_link() {
    use std::os::unix::fs::PermissionsExt as _;
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    std::fs::create_dir(folder.join("real")).expect("a folder");
    std::fs::write(folder.join("real/a.png"), "before").expect("a file");
    std::fs::set_permissions(folder.join("real/a.png"), std::fs::Permissions::from_mode(0o640)).expect("set");
    std::os::unix::fs::symlink("real/a.png", folder.join("a.png")).expect("a link");
    std::os::unix::fs::symlink("real/new.png", folder.join("b.png")).expect("a link to nothing yet");
    let shadows = project("SceneNoEffects.xml").display().to_string();
    for output in ["a.png", "b.png"] {
        succeeds(folder, &[&["render", &shadows][..], &SMALL, &["-o", output]].concat());
        assert!(folder.join(output).symlink_metadata().expect("there").is_symlink());
    }
    let written = std::fs::metadata(folder.join("real/a.png")).expect("there");
    assert_eq!(written.permissions().mode() & 0o7777, 0o640);
    assert!(written.len() > 6 && std::fs::metadata(folder.join("real/new.png")).expect("there").len() == written.len());
    assert_eq!(names(&folder.join("real")), ["a.png", "new.png"]);
}

#[test]
fn bench_and_compare_replace_no_file_of_anybody_else() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let shadows = project("SceneShadows.xml").display().to_string();
    let measured = [&["bench", shadows.as_str(), "--frames", "1", "--no-error"][..], &SMALL].concat();
    let bench = |more: &[&'static str]| [measured.clone(), more.to_vec()].concat();
    std::fs::write(folder.join("notes.txt"), "my notes").expect("a file");
    for (option, code) in [("--json", 3), ("--csv", 2), ("--markdown", 2)] {
        let told = fails_with(code, folder, &bench(&[option, "notes.txt"]));
        assert!(told.contains("--overwrite"), "{told}");
        assert_eq!(std::fs::read(folder.join("notes.txt")).expect("there"), b"my notes", "{option}");
    }
    let told = fails_with(2, folder, &bench(&["--csv", "x", "--markdown", "x"]));
    assert!(told.contains("written twice, as --csv and as --markdown"), "{told}");
    std::fs::write(folder.join("empty"), "").expect("a file");
    let files = ["--json", "empty", "--csv", "t.csv", "--markdown", "t.md"];
    for _ in 0..2 {
        // In the second round, each run replaces its own outputs of the first round.
        succeeds(folder, &bench(&files));
    }
    succeeds(folder, &bench(&["--json", "notes.txt", "--overwrite"]));
    assert!(std::fs::read_to_string(folder.join("notes.txt")).expect("there").contains("\"rows\""));

    succeeds(folder, &[&["render", &shadows][..], &SMALL, &["-o", "a.png"]].concat());
    let told = fails_with(2, folder, &["compare", "a.png", "a.png", "--heat", "a.png"]);
    assert!(told.contains("this file is read"), "{told}");
    let told = fails_with(2, folder, &["compare", "a.png", "a.png", "--heat", "b.png", "--strip", "./b.png"]);
    assert!(told.contains("written twice, as --heat and as --strip"), "{told}");
    #[cfg(unix)]
    {
        assert!(Command::new("mkfifo").arg(folder.join("pipe.png")).status().expect("mkfifo is there").success());
        std::os::unix::fs::symlink("/dev/zero", folder.join("zero.exr")).expect("a link");
        for other in ["pipe.png", "zero.exr"] {
            let told = fails_with(3, folder, &["compare", "a.png", other]);
            assert!(told.contains("not a regular file"), "{told}");
        }
    }
}

#[cfg(unix)]
#[test]
fn confine_refuses_every_file_that_lies_outside_wherever_links_lead() {
    let place = tempfile::tempdir().expect("a folder");
    let (inside, outside) = (place.path().join("in"), place.path().join("out"));
    for folder in [&inside, &outside] {
        std::fs::create_dir(folder).expect("a folder");
    }
    let write = |path: PathBuf, text: &str| std::fs::write(path, text).expect("written");
    let link = |from: &Path, name: &str| std::os::unix::fs::symlink(from, inside.join(name)).expect("a link");
    write(outside.join("m.mtl"), "newmtl a\n");
    write(outside.join("s.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    std::fs::write(outside.join("b.bin"), [0; 36]).expect("written");
    write(outside.join("l.mlib"), "<materialLib name=\"x\"></materialLib>");
    let texture = project("3dsmodels/Texturas");
    let texture = texture.join(names(&texture).into_iter().find(|name| name.ends_with(".png")).expect("a texture"));
    std::fs::copy(&texture, outside.join("t.png")).expect("copied");
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";
    write(inside.join("own.obj"), triangle);
    write(inside.join("mtl.obj"), &format!("mtllib ../out/m.mtl\n{triangle}"));
    write(inside.join("tex.obj"), &format!("mtllib tex.mtl\n{triangle}"));
    write(inside.join("tex.mtl"), "newmtl a\nmap_Kd link.png\n");
    write(inside.join("mask.obj"), &format!("mtllib mask.mtl\n{triangle}"));
    write(inside.join("mask.mtl"), "newmtl a\nmap_Kd link.png\nmap_d link.png\n");
    let gltf = |buffer: &str| {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"uri": "{buffer}", "byteLength": 36}}],
                "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "nodes": [{{"mesh": 0}}], "scenes": [{{"nodes": [0]}}],
                "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}}], "scene": 0,
                "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}]}}"#
        )
    };
    write(inside.join("buffer.gltf"), &gltf("../out/b.bin"));
    write(outside.join("notes.txt"), "no project and no scene");
    link(&outside.join("t.png"), "link.png");
    link(&outside.join("s.obj"), "link.obj");
    link(&outside, "folder");
    let refused = |arguments: &[&str], what: &str| {
        let output = curitiba(&inside, &[arguments, &["--confine", "."]].concat());
        let told = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(matches!(output.status.code(), Some(1..=3)), "{arguments:?}: {told}");
        assert!(told.contains("--confine") && told.contains(what), "{arguments:?}: {told}");
    };
    succeeds(&inside, &["scene", "own.obj", "-o", "own.cbo", "--confine", "."]);
    for (file, what) in [
        ("mtl.obj", "m.mtl"),
        ("buffer.gltf", "b.bin"),
        ("link.obj", "s.obj"),
        ("../out/s.obj", "s.obj"),
        ("mask.obj", "t.png"),
    ] {
        refused(&["scene", file], what);
        succeeds(&inside, &["scene", file]);
    }
    // Not even the first bytes of a file of an unknown kind are read, so the message says nothing about its contents.
    refused(&["check", "../out/notes.txt"], "notes.txt");
    let told = fails_with(3, &inside, &["check", "../out/notes.txt"]);
    assert!(told.contains("neither a project nor a scene"), "{told}");
    for output in ["../out/new.cbo", "folder/new.cbo"] {
        refused(&["scene", "own.obj", "-o", output], "new.cbo");
    }
    refused(&["scene", "--generate", "10000", "-o", "../out/square"], "square");
    refused(&["scene", "--generate", "10000", "-o", "missing/../../out/square"], "square");
    assert_eq!(names(&outside), ["b.bin", "l.mlib", "m.mtl", "notes.txt", "s.obj", "t.png"], "nothing was written");

    // Textures are decoded when a project is rendered; projects name libraries and scenes.
    let xml = |scene: &str, library: &str| {
        let text = std::fs::read_to_string(project("SceneNoEffects.xml")).expect("a project");
        let start = text.find("3dsmodels/").or_else(|| text.find("3dsmodels\\")).expect("the square is named");
        let end = start + text[start..].find(['"', '<', '\'']).expect("its name ends");
        let text = format!("{}{scene}{}", &text[..start], &text[end..]);
        let libraries = project("mlibs").display().to_string();
        let _ = std::fs::create_dir(inside.join("mlibs"));
        for name in names(Path::new(&libraries)) {
            std::fs::copy(Path::new(&libraries).join(&name), inside.join("mlibs").join(name)).expect("copied");
        }
        std::fs::write(inside.join("p.xml"), text.replacen("</materialLibs>", &format!("{library}</materialLibs>"), 1))
            .expect("written");
    };
    let render = [&["render", "p.xml"][..], &SMALL, &["-o", "p.png"]].concat();
    xml("own.obj", "");
    succeeds(&inside, &[&render[..], &["--confine", "."]].concat());
    xml("tex.obj", "");
    refused(&render, "t.png");
    refused(&["check", "p.xml"], "t.png");
    xml("link.obj", "");
    refused(&render, "s.obj");
    xml("own.obj", "<mlib filename=\"../out/l.mlib\"/>");
    refused(&render, "l.mlib");
    xml("own.obj", "");
    refused(&["render", "p.xml", "-o", "folder/p.png"], "p.png");
    refused(&["compare", "p.png", "link.png"], "t.png");
    refused(&["compare", "p.png", "p.png", "--heat", "folder/h.png"], "h.png");
    refused(&["bench", "p.xml", "--no-error", "--json", "folder/b.json"], "b.json");
    refused(&["bench", "p.xml", "--references", "folder/references"], "references");
    refused(&["report", "-o", "folder/report", "."], "out");
    let told = fails_with(2, &inside, &["check", "p.xml", "--confine", "p.xml"]);
    assert!(told.contains("not a folder"), "{told}");
}

#[test]
fn check_and_plan_list_the_files_that_lie_outside_the_projects_folder() {
    let place = tempfile::tempdir().expect("a folder");
    let xml = changed(place.path(), |text| text);
    for command in ["check", "plan"] {
        let (printed, _) = succeeds(place.path(), &[command, &xml]);
        assert!(printed.contains("files outside the project's folder"), "{printed}");
        for file in ["largoCamoes.cbo", "Texturas"] {
            assert!(printed.contains(file), "{command}: no {file} in {printed}");
        }
        assert!(!printed.contains("/mlibs/"), "{printed}");
        let (printed, _) = succeeds(place.path(), &[command, project("SceneShadows.xml").to_str().expect("UTF-8")]);
        assert!(!printed.contains("outside"), "{printed}");
    }
}

#[test]
fn files_of_another_kind_are_not_quoted() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let secret = "root:x:0:0:secret:/root:/bin/sh\nKd secret\nnewmtl a\nsecret secret\nKd secret\nmap_bump secret\n";
    std::fs::write(folder.join("passwd"), secret).expect("written");
    std::fs::write(folder.join("passwd.obj"), "root:x:0:0:secret\nsecret 1\n").expect("written");
    std::fs::write(folder.join("s.obj"), "mtllib passwd\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("written");
    let (_, told) = succeeds(folder, &["scene", "s.obj"]);
    assert!(told.contains("unknown material statements: line 4") && !told.contains("secret"), "{told}");
    let output = curitiba(folder, &["scene", "passwd.obj"]);
    assert!(!String::from_utf8_lossy(&output.stderr).contains("secret"));
    std::fs::write(folder.join("secret.txt"), "root:x:0:0:hidden:/root\n").expect("written");
    let xml =
        changed(folder, |text| text.replacen("</materialLibs>", "<mlib filename=\"secret.txt\"/></materialLibs>", 1));
    let told = fails_with(3, folder, &["check", &xml]);
    assert!(told.contains("secret.txt") && !told.contains("hidden"), "{told}");
}

#[test]
fn a_trace_has_every_step_of_every_frame_one_after_the_other() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let input = project("SceneShadows.xml").display().to_string();
    let arguments =
        [&["render", &input, "--backend", "cpu", "--frames", "3", "--json", "--trace", "t.json"], &SMALL[..]].concat();
    let (printed, _) = succeeds(folder, &arguments);
    let report: serde_json::Value = serde_json::from_str(&printed).expect("a report");
    let text = std::fs::read_to_string(folder.join("t.json")).expect("a trace");
    let trace: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let events = trace["traceEvents"].as_array().expect("events");
    let number = |event: &serde_json::Value, key: &str| event[key].as_f64().expect("a number");
    let mut spans: Vec<(f64, f64)> = Vec::new();
    for step in report["steps"].as_array().expect("steps") {
        let name = format!("{} {}", step["kind"].as_str().expect("a kind"), step["name"].as_str().expect("a name"));
        let of_step: Vec<_> = events.iter().filter(|event| event["ph"] == "X" && event["name"] == *name).collect();
        let expected = step["host_ms"].as_array().expect("samples");
        assert_eq!(of_step.len(), expected.len(), "{name}");
        for (event, host) in of_step.iter().zip(expected) {
            assert!((number(event, "dur") - 1e3 * host.as_f64().expect("a number")).abs() < 1e-6, "{name}");
            spans.push((number(event, "ts"), number(event, "ts") + number(event, "dur")));
        }
    }
    let rays = events.iter().filter(|event| event["cat"] == "rays");
    assert_eq!(rays.clone().count(), 3, "{text}");
    assert!(rays.clone().all(|event| number(&event["args"], "rays") > 0.0), "{text}");
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!(spans[0].0 == 0.0 && spans.windows(2).all(|pair| pair[1].0 >= pair[0].1 - 1.0), "{spans:?}");

    // Steps that a frame runs more than once are one row of the report, but separate events of the trace.
    succeeds(
        folder,
        &[&["render", &input, "--backend", "cpu", "--aa", "2", "--trace", "aa.json"], &SMALL[..]].concat(),
    );
    let text = std::fs::read_to_string(folder.join("aa.json")).expect("a trace");
    let trace: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let events = trace["traceEvents"].as_array().expect("events");
    let rays: Vec<_> = events.iter().filter(|event| event["cat"] == "rays").collect();
    assert_eq!(rays.len(), 2, "{text}");
    assert!(number(rays[1], "ts") >= number(rays[0], "ts") + number(rays[0], "dur") - 1.0, "{text}");

    let told = fails_with(2, folder, &[&["render", &input, "--trace", "no/t.json"], &SMALL[..]].concat());
    assert!(told.contains("no/t.json"), "{told}");
    assert_eq!(
        names(folder),
        ["SceneShadows.png", "aa.json", "t.json"],
        "nothing is rendered for a trace that cannot be written"
    );
}
