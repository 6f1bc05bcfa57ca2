//! `curitiba bench` as a user runs it: rows, references, continued files, and missing inputs.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn projects() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects")
}

fn project(name: &str) -> String {
    projects().join(name).to_str().expect("test paths are UTF-8").to_owned()
}

/// The program in a folder, with the references of that folder.
fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).arg("bench").args(arguments);
    command.env("NO_COLOR", "1").env("CURITIBA_CACHE", folder.join("references"));
    command
}

fn curitiba(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("output is UTF-8")
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) -> (String, String) {
    let output = curitiba(folder, arguments);
    assert!(output.status.success(), "{arguments:?} failed:\n{}", text(&output.stderr));
    (text(&output.stdout), text(&output.stderr))
}

#[track_caller]
fn fails_with(code: i32, folder: &Path, arguments: &[&str]) -> String {
    let output = curitiba(folder, arguments);
    assert_eq!(output.status.code(), Some(code), "{arguments:?} printed:\n{}", text(&output.stderr));
    text(&output.stderr)
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("the file is there")).expect("JSON")
}

fn rmse(row: &Value) -> f64 {
    row["error"]["against"]["comparison"]["rmse"].as_f64().unwrap_or_else(|| panic!("no error in {row}"))
}

#[test]
fn the_reports_table_has_all_its_rows_with_samples_errors_and_references() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let projects = project("");
    let arguments = [
        "--table2",
        "--projects",
        &projects,
        "--size",
        "24x24",
        "--frames",
        "2",
        "--raster",
        "cpu",
        "--reference-seconds",
        "1",
        "--json",
        "t.json",
        "--csv",
        "t.csv",
        "--markdown",
        "t.md",
    ];
    let (printed, told) = succeeds(folder, &arguments);
    let load = told.lines().find(|line| line.starts_with("load average "));
    assert!(load.is_some_and(|line| line.contains(" thread")), "{told}");
    let file = json(&folder.join("t.json"));
    let rows = file["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 19);
    assert_eq!(file["complete"], true);
    for row in rows {
        assert_eq!(row["frame"]["samples"].as_array().map(Vec::len), Some(2), "{row}");
        let steps = row["steps"].as_array().expect("steps");
        assert!(
            !steps.is_empty()
                && steps.iter().all(|step| step["host"]["samples"].as_array().is_some_and(|s| s.len() == 2))
        );
        let against = &row["error"]["against"];
        assert!(against["reference"].as_str().is_some_and(|name| !name.is_empty()), "{row}");
        assert!(against["key"].as_str().is_some_and(|key| key.len() == 32), "{row}");
        assert!(rmse(row).is_finite());
        assert!(row["thesis"]["frame_ms"].as_f64() > Some(0.0));
        assert!(row["thesis"]["ratio"].is_null(), "frames of another size have no ratio");
        assert!(printed.contains(row["label"].as_str().expect("a label")));
        let traced = row["effect"] != "none";
        assert_eq!(row["ray_share"].is_number(), traced, "{row}");
    }
    let views: Vec<_> = rows.iter().map(|row| row["view"].as_str().expect("a view")).collect();
    assert_eq!(views.iter().filter(|view| **view == "Vidro").count(), 2);
    let occlusion: Vec<f64> = rows.iter().filter(|row| row["effect"] == "ao").map(rmse).collect();
    assert_eq!(occlusion.len(), 10);
    assert!(occlusion[9] < occlusion[0] / 2.0, "more samples, the same error: {occlusion:?}");
    for name in ["cpu", "commit", "profile", "flags", "platform", "version"] {
        assert!(file["environment"][name].as_str().is_some_and(|value| !value.is_empty()), "{name}");
    }
    let csv = std::fs::read_to_string(folder.join("t.csv")).expect("CSV");
    assert_eq!(csv.lines().count(), 20);
    let markdown = std::fs::read_to_string(folder.join("t.md")).expect("Markdown");
    assert!(markdown.contains("| AO, 100 samples | Fonte |") && markdown.contains("GTX 780M"));
}

#[test]
fn a_benchmark_is_continued_only_by_the_command_that_began_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (shadows, reflect) = (project("SceneShadows.xml"), project("SceneReflect.xml"));
    let base = [&shadows, &reflect, "--size", "24x24", "--raster", "cpu", "--json", "b.json"]
        .map(|word: &str| word.to_owned());
    let with =
        |more: &[&str]| -> Vec<String> { base.iter().cloned().chain(more.iter().map(|m| (*m).to_owned())).collect() };
    let words = |list: &[String]| -> Vec<&'static str> { list.iter().map(|word| &*word.clone().leak()).collect() };
    succeeds(folder, &words(&with(&["--frames", "1"])));
    let path = folder.join("b.json");
    let whole = json(&path);

    // The file as if the run had been interrupted after the first row.
    let mut cut = whole.clone();
    cut["rows"].as_array_mut().expect("rows").truncate(1);
    cut["complete"] = Value::Bool(false);
    let interrupted = serde_json::to_string(&cut).expect("JSON");
    std::fs::write(&path, &interrupted).expect("written");
    let refused = fails_with(2, folder, &words(&with(&["--frames", "1"])));
    assert!(refused.contains("--resume"), "{refused}");
    let refused = fails_with(2, folder, &words(&with(&["--frames", "2", "--resume"])));
    assert!(refused.contains("cannot be continued"), "{refused}");
    let refused = fails_with(2, folder, &words(&with(&["--frames", "1", "--seed", "3", "--resume"])));
    assert!(refused.contains("--seed 3"), "{refused}");
    assert_eq!(std::fs::read_to_string(&path).expect("text"), interrupted, "a refused file was changed");

    let (_, progress) = succeeds(folder, &words(&with(&["--frames", "1", "--resume"])));
    assert!(progress.contains("row 2 of 2") && !progress.contains("row 1 of 2"), "{progress}");
    let resumed = json(&path);
    assert_eq!(resumed["complete"], true);
    assert_eq!(resumed["rows"].as_array().map(Vec::len), Some(2));
    assert_eq!(resumed["rows"][0], whole["rows"][0], "the first row was measured again");

    // A truncated file is no benchmark: it is refused and left unchanged.
    std::fs::write(&path, &interrupted[..interrupted.len() / 2]).expect("written");
    let refused = fails_with(3, folder, &words(&with(&["--frames", "1", "--resume"])));
    assert!(refused.contains("no benchmark file"), "{refused}");
    assert_eq!(std::fs::read_to_string(&path).expect("text"), &interrupted[..interrupted.len() / 2]);
}

#[test]
fn rounds_take_turns_over_all_rows_and_are_continued_where_they_were() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (none, shadows) = (project("SceneNoEffects.xml"), project("SceneShadows.xml"));
    let base =
        [&none, &shadows, "--size", "24x24", "--raster", "cpu", "--frames", "2", "--no-error", "--json", "r.json"];
    let samples = |file: &Value| -> Vec<usize> {
        let rows = file["rows"].as_array().expect("rows").iter();
        rows.map(|row| row["frame"]["samples"].as_array().map_or(0, Vec::len)).collect()
    };
    let turns = |told: &str| -> Vec<String> {
        told.lines()
            .filter_map(|line| Some(line.split_once(':')?.0.to_owned()))
            .filter(|line| line.contains("row "))
            .collect()
    };
    let (_, told) = succeeds(folder, &base);
    let once = json(&folder.join("r.json"));
    assert_eq!((samples(&once), turns(&told)), (vec![2, 2], ["row 1 of 2", "row 2 of 2"].map(str::to_owned).to_vec()));
    assert!(once.get("rounds").is_none(), "one round is not written");

    let arguments = [&base[..], &["--rounds", "3"]].concat();
    let (printed, told) = succeeds(folder, &arguments);
    let path = folder.join("r.json");
    let whole = json(&path);
    assert_eq!((samples(&whole), &whole["rounds"]), (vec![6, 6], &Value::from(3)));
    let rounds = (1..=3).flat_map(|round| (1..=2).map(move |row| format!("round {round} of 3, row {row} of 2")));
    assert_eq!(turns(&told), rounds.collect::<Vec<_>>());
    assert!(printed.contains("in each of 3 rounds") && printed.matches(" Fonte  cpu").count() == 2, "{printed}");
    for row in whole["rows"].as_array().expect("rows") {
        let [low, high] = ["low", "high"].map(|end| row["interval"][end].as_f64().expect("an end"));
        let [min, median, max] = ["min", "median", "max"].map(|name| row["frame"][name].as_f64().expect("a time"));
        assert!(min <= low && low <= median && median <= high && high <= max, "{row}");
        assert!(row["outliers"]["severe"].is_u64(), "{row}");
    }

    // The file as if the run had been interrupted after the first row of the second round.
    let mut cut = whole.clone();
    for (row, count) in [(0, 4), (1, 2)] {
        cut["rows"][row]["frame"]["samples"].as_array_mut().expect("samples").truncate(count);
    }
    cut["complete"] = Value::Bool(false);
    std::fs::write(&path, serde_json::to_string(&cut).expect("JSON")).expect("written");
    let (_, told) = succeeds(folder, &[&arguments[..], &["--resume"]].concat());
    assert_eq!(turns(&told), ["round 2 of 3, row 2 of 2", "round 3 of 3, row 1 of 2", "round 3 of 3, row 2 of 2"]);
    assert_eq!(samples(&json(&path)), [6, 6]);
    let refused = fails_with(2, folder, &[&base[..], &["--rounds", "2", "--resume"]].concat());
    assert!(refused.contains("--rounds 3") && refused.contains("--rounds 2"), "{refused}");
    assert!(fails_with(2, folder, &[&shadows, "--rounds", "2", "--parts", "parts"]).contains("--rounds"));
}

#[test]
fn a_sweep_trades_time_for_error_and_keeps_one_reference() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let ssao = project("SceneSSAO.xml");
    let arguments = [
        &ssao,
        "--sweep",
        "samples=1,16,144",
        "--size",
        "32x32",
        "--frames",
        "1",
        "--raster",
        "cpu",
        "--json",
        "s.json",
    ];
    succeeds(folder, &arguments);
    let file = json(&folder.join("s.json"));
    let errors: Vec<f64> = file["rows"].as_array().expect("rows").iter().map(rmse).collect();
    assert!(errors.len() == 3 && errors[0] > errors[1] && errors[1] > errors[2], "{errors:?}");
    let last = &file["rows"][2]["error"]["against"];
    assert!(last["own_error"].as_f64().expect("a number") * 10.0 <= errors[2], "{last}");
    let kept: Vec<_> = std::fs::read_dir(folder.join("references")).expect("references").collect();
    assert_eq!(kept.len(), 2, "one picture and what it is");

    let key = last["key"].as_str().expect("a key");
    let exr = folder.join("references").join(format!("{key}.exr"));
    let good = std::fs::read(&exr).expect("the reference");
    std::fs::remove_file(folder.join("s.json")).expect("removed");
    let (_, warnings) = succeeds(folder, &arguments);
    assert!(!warnings.contains("rendered again"), "{warnings}");
    let again = json(&folder.join("s.json"));
    assert_eq!(again["rows"][2]["error"], file["rows"][2]["error"], "the same picture against the same reference");
    std::fs::write(&exr, &good[..good.len() - 100]).expect("cut");
    let (_, warnings) = succeeds(folder, &arguments);
    assert!(warnings.contains("rendered again"), "{warnings}");
    let mended = json(&folder.join("s.json"));
    assert_eq!(mended["rows"][2]["error"], file["rows"][2]["error"], "the reference was not rendered as before");
    let (_, warnings) = succeeds(folder, &arguments);
    assert!(!warnings.contains("rendered again"), "{warnings}");
}

#[test]
fn engines_that_are_not_there_are_listed_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let shadows = project("SceneShadows.xml");
    let arguments =
        [&shadows, "--compare", "cpu,cuda,optix", "--size", "24x24", "--frames", "1", "--no-error", "--json", "c.json"];
    // No NVIDIA GPU is seen.
    let without = |arguments: &[&str]| -> Output {
        let mut command = command(folder, arguments);
        command.env("CUDA_VISIBLE_DEVICES", "-1").env_remove("CURITIBA_GPUS").output().expect("the program starts")
    };
    let output = without(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    let file = json(&folder.join("c.json"));
    let missing: Vec<_> = file["unavailable"].as_array().expect("a list").iter().map(|m| m["what"].as_str()).collect();
    assert_eq!(missing, [Some("cuda"), Some("optix")]);
    let why = if cfg!(feature = "cuda") { "cuda: " } else { "cuda: this program was built without it" };
    assert!(printed.contains(&format!("not measured: cuda: {why}")), "{printed}");
    assert_eq!(file["rows"].as_array().map(Vec::len), Some(1));
    assert_eq!(file["rows"][0]["error"]["missing"], "--no-error");
    let output = without(&[&shadows, "--compare", "cuda", "--json", "none.json"]);
    let message = text(&output.stderr);
    assert!(output.status.code() == Some(1) && message.contains("none of the engines"), "{message}");
    let none = json(&folder.join("none.json"));
    assert_eq!((&none["unavailable"][0]["what"], &none["complete"]), (&Value::from("cuda"), &Value::Bool(false)));
}

#[test]
fn a_sweep_over_threads_replaces_only_its_own_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let shadows = project("SceneShadows.xml");
    let arguments = [
        &shadows,
        "--sweep-threads",
        "1",
        "--rounds",
        "1",
        "--frames",
        "1",
        "--size",
        "24x24",
        "--markdown",
        "page.md",
    ];
    let page = folder.join("page.md");
    std::fs::write(&page, "# Mine\n").expect("written");
    assert!(fails_with(2, folder, &arguments).contains("--overwrite"));
    assert_eq!(std::fs::read_to_string(&page).expect("text"), "# Mine\n");
    succeeds(folder, &[&arguments[..], &["--overwrite"]].concat());
    assert!(std::fs::read_to_string(&page).expect("text").contains("| frame |"));
    succeeds(folder, &arguments);
}

#[test]
fn a_wrong_command_line_exits_with_2_before_anything_is_measured() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let shadows = project("SceneShadows.xml");
    assert!(fails_with(2, folder, &["--table2"]).contains("--projects"));
    assert!(fails_with(2, folder, &[&shadows, "--sweep", "samples=1"]).contains("no pass of"));
    assert!(fails_with(2, folder, &[&shadows, "--sweep", "samples"]).contains("samples=1,4,9"));
    assert!(fails_with(2, folder, &[&shadows, "--resume"]).contains("--json"));
    assert!(fails_with(2, folder, &[&shadows, "--camera", "MainCamear"]).contains("did you mean"));
    assert!(fails_with(3, folder, &["nowhere.xml"]).contains("nowhere.xml"));
    assert_eq!(std::fs::read_dir(folder).expect("the folder").count(), 0, "something was written");
}
