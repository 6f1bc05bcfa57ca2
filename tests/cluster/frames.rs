//! `curitiba render --path`.

use super::{fails_with, json, names, project, succeeds};
use std::path::Path;

const FIXED: [&str; 6] = ["--size", "48x32", "--raster", "cpu", "--backend", "cpu"];

fn render<'a>(project: &'a str, path: &'a str, output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["render", project, "--path", path, "-o", output][..], &FIXED, more].concat()
}

fn keys(folder: &Path) {
    let text = r#"{"camera": "MainCamera", "keys": [
        {"frame": 0, "position": [7.42, 18.61, -38.62], "look_at": [0, 3, 0]},
        {"frame": 5, "position": [12, 14, -30], "look_at": [0, 4, 0], "fov": 50},
        {"frame": 11, "position": [20, 9, -18], "look_at": [0, 3, 5]}]}"#;
    std::fs::write(folder.join("cameras.json"), text).expect("written");
}

#[test]
fn a_frame_alone_is_that_of_the_sequence_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    keys(folder);
    let name = project("SceneFinal.xml");
    let few = ["--set", "pass2.samples=4"];
    succeeds(folder, &render(&name, "cameras.json", "all.exr", &few));
    let pictures: Vec<String> = names(folder).into_iter().filter(|name| name.ends_with(".exr")).collect();
    assert_eq!(pictures.len(), 12);
    assert_eq!((pictures[0].as_str(), pictures[11].as_str()), ("all.0000.exr", "all.0011.exr"));
    let bytes = |name: &str| std::fs::read(folder.join(name)).expect("a picture");
    for frame in [0, 4, 11] {
        let range = format!("{frame}..{}", frame + 1);
        succeeds(folder, &render(&name, "cameras.json", "one.exr", &[&few[..], &["--frames", &range]].concat()));
        assert!(bytes(&format!("one.{frame:04}.exr")) == bytes(&format!("all.{frame:04}.exr")), "frame {frame}");
    }
    assert!(bytes("all.0004.exr") != bytes("all.0005.exr"), "the camera moves");
    // The keys have the camera's own position and direction, so nothing moves and the picture is that of `render`.
    let still = r#"{"keys": [{"frame": 0, "position": [7.42, 18.61, -38.62], "direction": [0.31, -0.36, 0.87]},
        {"frame": 1, "position": [7.42, 18.61, -38.62], "direction": [0.31, -0.36, 0.87]}]}"#;
    std::fs::write(folder.join("still.json"), still).expect("written");
    succeeds(folder, &render(&name, "still.json", "still.exr", &few));
    succeeds(folder, &[&["render", &name, "-o", "plain.exr"][..], &FIXED, &few].concat());
    assert!(bytes("still.0000.exr") == bytes("plain.exr"));
}

#[test]
fn shards_make_the_same_frames_and_what_is_there_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let name = project("SceneShadows.xml");
    let path = "orbit:0,4,0,30,10,15";
    let (printed, _) = succeeds(folder, &render(&name, path, "all.png", &["--show", "pos"]));
    assert!(
        printed.contains("10 frames: mean ") && printed.contains(" ms, p99 ") && printed.contains("ffmpeg"),
        "{printed}"
    );
    for shard in ["1/3", "2/3", "3/3"] {
        let (printed, _) = succeeds(folder, &render(&name, path, "part.png", &["--show", "pos", "--shard", shard]));
        assert!(printed.contains(" of 10 frames, 0 of them were there"), "{printed}");
    }
    let bytes = |name: String| std::fs::read(folder.join(name)).expect("a picture");
    for frame in 0..10 {
        for kind in ["png", "pos.exr", "pos.png"] {
            let [all, part] = ["all", "part"].map(|name| bytes(format!("{name}.{frame:04}.{kind}")));
            assert!(all == part, "frame {frame}, {kind}");
        }
    }
    // A frame whose picture is missing or truncated is rendered again; other frames are not.
    std::fs::remove_file(folder.join("part.0003.pos.exr")).expect("removed");
    std::fs::write(folder.join("part.0006.png"), "cut off").expect("written");
    let (printed, _) = succeeds(folder, &render(&name, path, "part.png", &["--show", "pos", "--json"]));
    let report: serde_json::Value = serde_json::from_str(&printed).expect("JSON");
    let found: Vec<bool> = report["frames"].as_array().expect("frames").iter().map(|f| f["found"] == true).collect();
    assert_eq!(found, [true, true, true, false, true, true, false, true, true, true]);
    assert_eq!(report["machines"][0]["frames"], 10);
    assert!(bytes("part.0006.png".to_owned()) == bytes("all.0006.png".to_owned()));
    let record = json(&folder.join("part.0006.json"));
    assert!(record["ms"].as_f64() > Some(0.0) && record["rays"].as_u64() > Some(0), "{record}");
}

#[test]
fn frames_of_something_else_are_not_taken_for_these() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let name = project("SceneShadows.xml");
    let path = "orbit:0,4,0,30,3,15";
    succeeds(folder, &render(&name, path, "f.png", &[]));
    let before = std::fs::read(folder.join("f.0000.png")).expect("a picture");
    for (path, more, field) in [
        (path, &["--seed", "9"][..], "origin.settings"),
        ("orbit:0,4,0,31,3,15", &[], "origin.pose"),
        (path, &["--fidelity", "thesis"], "differs"),
    ] {
        let message = fails_with(2, folder, &render(&name, path, "f.png", more));
        assert!(
            message.contains("f.0000.json") && message.contains(field) && message.contains("--overwrite"),
            "{message}"
        );
    }
    let other = project("SceneReflect.xml");
    assert!(fails_with(2, folder, &render(&other, path, "f.png", &[])).contains("origin.inputs.project"));
    assert!(std::fs::read(folder.join("f.0000.png")).expect("a picture") == before);
    succeeds(folder, &render(&name, "orbit:0,4,0,31,3,15", "f.png", &["--overwrite"]));
    assert!(std::fs::read(folder.join("f.0000.png")).expect("a picture") != before);
}

#[test]
fn a_wrong_path_says_where_and_what_would_be_valid() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let name = project("SceneShadows.xml");
    std::fs::write(folder.join("bad.json"), r#"{"keys": [{"frame": 0, "position": [0, 0], "direction": [0, 0, 1]}]}"#)
        .expect("written");
    std::fs::write(
        folder.join("unknown.json"),
        r#"{"camera": "MainCamear", "keys": [{"frame": 0, "position": [0,0,0], "direction": [0,0,1]}, {"frame": 1, "position": [0,0,0], "direction": [0,0,1]}]}"#,
    )
    .expect("written");
    std::fs::write(
        folder.join("down.json"),
        r#"{"keys": [{"frame": 0, "position": [0,9,0], "direction": [0,-1,0]}, {"frame": 1, "position": [0,9,0], "direction": [0,-1,0]}]}"#,
    )
    .expect("written");
    for (path, more, code, words) in [
        ("nowhere.json", &[][..], 3, &["nowhere.json"][..]),
        ("bad.json", &[], 3, &["bad.json", "line 1 column"]),
        ("unknown.json", &[], 2, &["did you mean `MainCamera`"]),
        ("down.json", &[], 2, &["frame 0", "parallel"]),
        ("orbit:0,0,0,1", &[], 2, &["orbit:CX,CY,CZ,R,N"]),
        ("orbit:0,4,0,30,8", &["--frames", "4..9"], 2, &["frames 0 to 7"]),
        ("orbit:0,4,0,30,8", &["--frames", "4"], 2, &["A..B"]),
        ("orbit:0,4,0,30,8", &["--accumulate", "4"], 2, &["--accumulate"]),
    ] {
        let message = fails_with(code, folder, &render(&name, path, "f.png", more));
        assert!(words.iter().all(|word| message.contains(word)), "{path}: {message}");
    }
    assert!(fails_with(2, folder, &["render", &name, "--frames", "0..3"]).contains("--path"));
    assert!(fails_with(2, folder, &["render", &name, "--shard", "1/3"]).contains("--path"));
    assert!(names(folder).iter().all(|name| !name.starts_with("f.")), "something was written");
}
