//! `curitiba merge`.

use super::{fails_with, json, names, project, rows, succeeds};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Writes the parts of three rows in a folder, and returns their paths.
fn three_parts(folder: &Path) -> Vec<PathBuf> {
    let projects = ["SceneShadows.xml", "SceneReflect.xml", "SceneRefract.xml"].map(project);
    let fixed = ["--size", "24x24", "--frames", "1", "--raster", "cpu", "--backend", "cpu", "--parts", "parts"];
    succeeds(folder, &[&["bench"][..], &projects.each_ref().map(String::as_str), &fixed].concat());
    let parts = folder.join("parts");
    names(&parts).into_iter().filter(|name| name != "rows.json").map(|name| parts.join(name)).collect()
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir(to).expect("a folder");
    for name in names(from) {
        std::fs::copy(from.join(&name), to.join(&name)).expect("copied");
    }
}

/// Changes every part in a folder.
fn change(folder: &Path, change: impl Fn(&mut Value)) {
    for name in names(folder).into_iter().filter(|name| name != "rows.json") {
        let path = folder.join(name);
        let mut part = json(&path);
        change(&mut part);
        std::fs::write(&path, part.to_string()).expect("written");
    }
}

#[test]
fn rows_that_are_missing_are_named_and_the_rest_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let parts = three_parts(folder);
    let id = parts[1].file_stem().and_then(|stem| stem.to_str()).expect("UTF-8").to_owned();
    let label = json(&parts[1])["rows"][0]["label"].as_str().expect("a label").to_owned();
    std::fs::remove_file(&parts[1]).expect("removed");
    let output = super::run(folder, &["merge", "all.json", "parts"]);
    assert_eq!(output.status.code(), Some(1));
    let printed = super::text(&output.stdout);
    assert!(printed.contains(&format!("missing: {id} ({label}, Fonte)")), "{printed}");
    let file = json(&folder.join("all.json"));
    assert_eq!((rows(&file).len(), &file["complete"]), (2, &Value::Bool(false)));
    // Parts may be named one by one; the list of all rows is taken from their folder.
    let named: Vec<&str> = [&parts[0], &parts[2]].map(|path| path.to_str().expect("UTF-8")).to_vec();
    assert!(fails_with(1, folder, &[&["merge", "all.json"][..], &named].concat()).contains("1 row is missing"));
    std::fs::remove_file(folder.join("parts/rows.json")).expect("removed");
    assert!(fails_with(1, folder, &["merge", "all.json", "parts"]).contains("the list of all rows is missing"));
}

#[test]
fn machines_are_columns_and_nothing_is_averaged() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    three_parts(folder);
    copy(&folder.join("parts"), &folder.join("other"));
    change(&folder.join("other"), |part| {
        part["environment"]["cpu"] = "A processor of another kind".into();
        part["rows"][0]["frame"] = serde_json::json!({"samples": [1234.5], "median": 1234.5, "mean": 1234.5, "sd": 0.0, "min": 1234.5, "max": 1234.5});
    });
    let (printed, told) = succeeds(folder, &["merge", "all.json", "parts", "other"]);
    assert!(!told.contains("measured 2 times"), "{told}");
    assert!(printed.contains("A processor of another kind") && printed.contains("6 rows of 2 machines"), "{printed}");
    assert_eq!(printed.matches(": 3 of 3 rows\n").count(), 2, "{printed}");
    let lines: Vec<&str> = printed.lines().filter(|line| line.contains("1234 (1234 to 1234)")).collect();
    assert_eq!(lines.len(), 3, "a line for each row:\n{printed}");
    assert!(lines.iter().all(|line| line.matches(" to ").count() == 2), "each with both machines:\n{printed}");
    let file = json(&folder.join("all.json"));
    assert_eq!(file["machines"].as_array().map(Vec::len), Some(2));
    let keys: Vec<&str> = rows(&file).iter().map(|row| row["key"].as_str().expect("a key")).collect();
    assert!(keys[0] == keys[1] && keys[2] == keys[3] && keys[4] == keys[5] && keys[0] != keys[2], "{keys:?}");
    // The order of the arguments does not matter, and merged files can be merged again.
    succeeds(folder, &["merge", "turned.json", "other", "parts"]);
    assert_eq!(json(&folder.join("turned.json")), file);
    succeeds(folder, &["merge", "again.json", "all.json"]);
    assert_eq!(json(&folder.join("again.json")), file);
    // A merged file cannot be resumed.
    let shadows = project("SceneShadows.xml");
    assert!(fails_with(2, folder, &["bench", &shadows, "--json", "all.json", "--resume"]).contains("merged"));

    // Rows that the same machine measured twice are both kept,
    copy(&folder.join("parts"), &folder.join("twice"));
    let (_, told) = succeeds(folder, &["merge", "twice.json", "parts", "twice"]);
    assert_eq!(told.matches("measured 2 times, and all are kept").count(), 3, "{told}");
    assert_eq!(rows(&json(&folder.join("twice.json"))).len(), 6);
    // unless the user names another machine.
    change(&folder.join("twice"), |part| part["environment"]["host"] = "second".into());
    let (printed, told) = succeeds(folder, &["merge", "twice.json", "parts", "twice"]);
    assert!(!told.contains("measured 2 times") && printed.contains("second: "), "{told}{printed}");
}

#[test]
fn what_does_not_belong_together_is_refused_with_file_and_field() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    three_parts(folder);
    let other = folder.join("other");
    let refused = |code: i32, set: &dyn Fn(&mut Value), words: &[&str]| {
        copy(&folder.join("parts"), &other);
        change(&other, |part| {
            part["environment"]["cpu"] = "another".into();
            set(part);
        });
        let message = fails_with(code, folder, &["merge", "all.json", "parts", "other"]);
        for word in words.iter().chain(&["other/"]) {
            assert!(message.contains(word), "{message}");
        }
        assert!(!folder.join("all.json").exists());
        std::fs::remove_dir_all(&other).expect("removed");
    };
    refused(
        2,
        &|p| p["environment"]["commit"] = "0000000".into(),
        &["environment.commit differs: `0000000` there", "parts/"],
    );
    refused(2, &|p| p["command"] = "curitiba bench other.xml".into(), &["command differs", "other.xml"]);
    refused(2, &|p| p["frames"] = 7.into(), &["frames differs: `7 after"]);
    refused(2, &|p| p["rows"][0]["inputs"]["project"] = "0".into(), &["rows[0].inputs.project differs: `0` there"]);
    refused(2, &|p| p["rows"][0]["inputs"]["scenes"] = "0".into(), &["rows[0].inputs.scenes differs"]);
    refused(2, &|p| p["rows"][0]["error"]["against"]["key"] = "0".into(), &["rows[0].error.against.key differs"]);
    refused(2, &|p| p["part"]["of"] = 9.into(), &["part differs"]);
    refused(3, &|p| p["format"] = 9.into(), &["format: it is 9"]);
    refused(3, &|p| p["rows"][0]["frame"] = Value::Null, &["rows[0]: invalid type: null"]);
    refused(3, &|p| p["rows"][0]["machine"] = 4.into(), &["rows[0].machine"]);
    refused(
        3,
        &|p| *p = serde_json::json!({"name": "of something else"}),
        &["no part of a benchmark", "format: it is missing"],
    );

    std::fs::write(folder.join("parts/zz.json"), "{\"format\": 1, \"comm").expect("written");
    let torn = fails_with(3, folder, &["merge", "all.json", "parts"]);
    assert!(torn.contains("zz.json") && torn.contains("line 1 column"), "{torn}");
    std::fs::remove_file(folder.join("parts/zz.json")).expect("removed");
    assert!(fails_with(1, folder, &["merge", "all.json", "nowhere"]).contains("nowhere"));
    std::fs::create_dir(folder.join("empty")).expect("a folder");
    assert!(fails_with(1, folder, &["merge", "all.json", "empty"]).contains("it holds no parts"));
}

#[test]
fn nothing_that_was_measured_is_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let parts = three_parts(folder);
    let first = parts[0].to_str().expect("UTF-8");
    let before = std::fs::read(first).expect("bytes");
    assert!(fails_with(2, folder, &["merge", first, "parts"]).contains("name the file to write first"));
    assert!(fails_with(2, folder, &["merge", first, "parts", "--overwrite"]).contains("read"));
    assert_eq!(std::fs::read(first).expect("bytes"), before);
    std::fs::write(folder.join("notes.json"), "[]").expect("written");
    assert!(fails_with(2, folder, &["merge", "notes.json", "parts"]).contains("no merged benchmark"));
    succeeds(folder, &["merge", "notes.json", "parts", "--overwrite"]);
    succeeds(folder, &["merge", "notes.json", "parts"]);
}

#[test]
fn ten_thousand_rows_are_merged_in_seconds() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let part = json(&three_parts(folder)[0]);
    let many = folder.join("many");
    std::fs::create_dir(&many).expect("a folder");
    let mut list = json(&folder.join("parts/rows.json"));
    let listed = |index: usize| serde_json::json!({"id": format!("{index:016x}"), "key": format!("row {index}"), "label": "x", "view": "y"});
    list["rows"] = (0..10_000).map(listed).collect();
    std::fs::write(many.join("rows.json"), list.to_string()).expect("written");
    for index in 0..10_000 {
        let mut part = part.clone();
        part["rows"][0]["key"] = format!("row {index}").into();
        part["part"] = serde_json::json!({"id": format!("{index:016x}"), "index": index, "of": 10_000});
        std::fs::write(many.join(format!("{index:016x}.json")), part.to_string()).expect("written");
    }
    let start = Instant::now();
    succeeds(folder, &["merge", "all.json", "many"]);
    let took = start.elapsed().as_secs_f64();
    println!("10000 rows merged in {took:.2} s");
    let file = json(&folder.join("all.json"));
    assert_eq!((rows(&file).len(), &file["complete"]), (10_000, &Value::Bool(true)));
    assert_eq!(rows(&file)[9_999]["key"], "row 9999");
    assert!(took < 30.0, "{took} s");
}
