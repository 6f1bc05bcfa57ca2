//! Makes a small report with the program, and checks its files, its links, and its page in a browser if there is one.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn report(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).arg("report").args(arguments).env("NO_COLOR", "1");
    // A cache of its own, so that references of other runs have no effect.
    command.env("CURITIBA_CACHE", folder.join("cache")).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("output is UTF-8")
}

/// All values of an attribute in the page.
fn attributes<'a>(html: &'a str, name: &str) -> Vec<&'a str> {
    let start = format!(" {name}=\"");
    html.split(start.as_str()).skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

#[test]
fn a_report_is_one_folder_whose_links_all_resolve_and_whose_page_works_in_a_browser() {
    let place = tempfile::tempdir().expect("a folder");
    let projects = root("xml_projects");
    let projects = projects.to_str().expect("a path in UTF-8");
    // The time limit is long, so that nothing is left out on a busy machine; the run does not take that long.
    let arguments = ["--quick", "--size", "48x48", "--raster", "cpu", "--max-triangles", "10000", "--time", "3000"];
    let made = report(place.path(), &[&arguments[..], &["-o", "out", projects]].concat());
    assert!(made.status.success(), "{}", text(&made.stderr));
    assert!(text(&made.stdout).contains("On this machine, with "), "{}", text(&made.stdout));
    assert!(text(&made.stderr).contains("left: Shadows by rays"), "{}", text(&made.stderr));
    assert!(text(&made.stderr).contains("load average "), "{}", text(&made.stderr));

    let folder = place.path().join("out");
    let html = std::fs::read_to_string(folder.join("index.html")).expect("the page");
    let mut linked = BTreeSet::new();
    for name in ["src", "href", "value"] {
        for target in attributes(&html, name) {
            if let Some(id) = target.strip_prefix('#') {
                assert!(html.contains(&format!(" id=\"{id}\"")), "#{id}");
            } else if target.contains('/') || [".json", ".csv", ".md"].iter().any(|end| target.ends_with(end)) {
                assert!(folder.join(target).is_file(), "{target}");
                linked.insert(target.to_owned());
            }
        }
    }
    assert!(!html.contains("http:") && !html.contains("https:"), "the page asks the network for nothing");
    for part in ["pictures", "plots"] {
        for entry in std::fs::read_dir(folder.join(part)).expect("a folder") {
            let name = format!("{part}/{}", entry.expect("an entry").file_name().to_string_lossy());
            assert!(linked.contains(&name), "{name} is shown");
        }
    }
    for effect in ["shadows", "soft-shadows", "reflection", "refraction", "ao"] {
        for role in ["raster", "rays", "reference", "raster-flip", "rays-flip"] {
            assert!(linked.contains(&format!("pictures/{effect}-{role}.png")), "{effect} {role}: {linked:?}");
        }
        for plot in ["speed", "frames", "passes-1", "passes-2"] {
            assert!(linked.contains(&format!("plots/{effect}-{plot}.svg")), "{effect} {plot}");
        }
    }

    let json = std::fs::read_to_string(folder.join("data.json")).expect("the data");
    let data: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let rows = data["rows"].as_array().expect("rows");
    assert!(rows.len() > 30, "{} rows", rows.len());
    assert!(rows.iter().all(|row| row["frame"]["samples"].as_array().is_some_and(|samples| !samples.is_empty())));
    let samples = |row: &serde_json::Value| row["frame"]["samples"].as_array().map_or(0, Vec::len);
    let again = rows.iter().filter(|row| samples(row) > 5).count();
    assert!(again > 20, "{again} rows have samples of more than one round");
    let judged = rows.iter().filter(|row| row["error"].get("against").is_some()).count();
    assert!(judged > 20, "{judged} rows have an error");
    let csv = std::fs::read_to_string(folder.join("data.csv")).expect("the table");
    assert_eq!(csv.lines().count(), rows.len() + 1);
    let markdown = std::fs::read_to_string(folder.join("data.md")).expect("the table");
    assert!(markdown.contains("| effect | view |") && linked.contains("data.md"));

    assert!(linked.contains("plots/scaling-lights.svg"));
    let traced = |lights: u32, rows: &[serde_json::Value]| -> u64 {
        let of = |row: &&serde_json::Value| {
            let key = row["key"].as_str().unwrap_or_default();
            key.starts_with(&format!("{lights} light")) && key.contains("| SceneShadows.xml |")
        };
        let row = rows.iter().find(of).unwrap_or_else(|| panic!("{lights} lights"));
        let steps = row["steps"].as_array().expect("steps").iter();
        steps.filter_map(|step| step["rays"]["shadow"].as_u64()).sum()
    };
    let several = |aa: &str, technique: &str| {
        let of = |row: &&serde_json::Value| {
            let label = row["label"].as_str().unwrap_or_default();
            label.ends_with(&format!(", {aa} samples a pixel")) && row["technique"] == technique
        };
        rows.iter().filter(of).filter(|row| row["error"].get("against").is_some()).count()
    };
    for (aa, technique) in [("4", "rays"), ("16", "rays"), ("16:0.02", "rays"), ("4", "raster"), ("16", "raster")] {
        assert!(several(aa, technique) > 0, "{aa} samples a pixel by {technique}");
    }
    assert!(html.contains("id=\"pixel-samples\""));
    let [one, two, eight] = [1, 2, 8].map(|lights| traced(lights, rows));
    assert!(one > 100 && two > one && eight > 2 * two, "{one} {two} {eight} shadow rays");

    look_in_a_browser(&folder);
}

/// Runs the browser's checks, or prints why they are skipped.
fn look_in_a_browser(folder: &Path) {
    let required = std::env::var_os("CURITIBA_REQUIRE_BROWSER_TESTS").is_some_and(|value| value == "1");
    let skip = |why: &str| {
        assert!(!required, "the browser's checks are required, and were skipped: {why}");
        println!("skipped: {why}");
    };
    let mut command = Command::new("python3");
    command.arg(root("tests/report/browser.py")).arg(folder);
    command.args(std::env::var_os("CURITIBA_SCREENSHOTS"));
    match command.output() {
        Ok(output) if output.status.code() == Some(77) => skip(text(&output.stdout).trim()),
        Ok(output) => assert!(output.status.success(), "{}\n{}", text(&output.stdout), text(&output.stderr)),
        Err(error) => skip(&format!("python3: {error}")),
    }
}

#[test]
fn a_folder_of_somebody_else_is_refused_before_anything_is_measured() {
    let place = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(place.path().join("out")).expect("a folder");
    std::fs::write(place.path().join("out/cat.jpg"), "a cat").expect("a file");
    let projects = root("xml_projects");
    let refused = report(place.path(), &["-o", "out", projects.to_str().expect("a path in UTF-8")]);
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused.stderr));
    assert!(text(&refused.stderr).contains("`cat.jpg`"), "{}", text(&refused.stderr));
    assert_eq!(std::fs::read(place.path().join("out/cat.jpg")).expect("the file"), b"a cat");
}

#[test]
fn an_error_to_stay_within_is_a_number_from_0_on() {
    let place = tempfile::tempdir().expect("a folder");
    for wrong in ["little", "nan", "inf", "-0.1"] {
        let refused = report(place.path(), &[&format!("--within={wrong}"), "nowhere"]);
        assert_eq!(refused.status.code(), Some(2));
        assert!(text(&refused.stderr).contains("such as 0.02"), "{}", text(&refused.stderr));
    }
}

#[test]
fn a_folder_without_projects_is_named_and_nothing_is_left_behind() {
    let place = tempfile::tempdir().expect("a folder");
    let nowhere = report(place.path(), &["-o", "out", "nowhere"]);
    assert_eq!(nowhere.status.code(), Some(2));
    assert!(text(&nowhere.stderr).contains("nowhere: there is no such folder"), "{}", text(&nowhere.stderr));
    std::fs::create_dir(place.path().join("empty")).expect("a folder");
    let empty = report(place.path(), &["-o", "out", "empty", "--raster", "cpu"]);
    assert_eq!(empty.status.code(), Some(3));
    assert!(text(&empty.stderr).contains("SceneNoEffects.xml"), "{}", text(&empty.stderr));
    let left: Vec<_> =
        std::fs::read_dir(place.path()).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    assert_eq!(left, [place.path().join("empty")]);
}

/// An OBJ file of a floor and a wall on it.
const CORNER: &str = "v -2 0 -2\nv 2 0 -2\nv 2 0 2\nv -2 0 2\nv -1 0 0\nv 1 0 0\nv 1 1.5 0\nv -1 1.5 0\nf 4 3 2\nf 4 2 1\nf 5 6 7\nf 5 7 8\n";

#[test]
fn a_scene_of_one_command_has_errors_of_its_pictures_once_their_references_are_made() {
    let place = tempfile::tempdir().expect("a folder");
    std::fs::write(place.path().join("corner.obj"), CORNER).expect("a scene");
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
        command.current_dir(place.path()).args(arguments).env("NO_COLOR", "1");
        let output = command.env("CURITIBA_CACHE", place.path().join("cache")).output().expect("the program starts");
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    let of_pictures = || {
        let usual = ["report", "corner.obj", "-o", "out", "--quick", "--size", "32x32", "--time", "20"];
        run(&[&usual[..], &["--raster", "cpu", "--backend", "cpu", "--threads", "2"]].concat());
        let json = std::fs::read_to_string(place.path().join("out/data.json")).expect("the data");
        let data: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        let row = |project: &str| {
            let of = |row: &&serde_json::Value| row["project"] == project && row["picture_error"].is_object();
            data["rows"].as_array().expect("rows").iter().find(of).expect("a row")["picture_error"].clone()
        };
        ["SceneShadows.xml", "raster/SceneGTAO.xml"].map(row)
    };
    let made = "this makes it: curitiba scene corner.obj --size 32x32 --projects projects; curitiba reference projects/SceneShadows.xml --size 32x32";
    let [shadows, occlusion] = of_pictures();
    let why = shadows["missing"].as_str().expect("a reason");
    assert!(why.ends_with(made), "{why}");
    assert!(occlusion["missing"].as_str().is_some_and(|why| why.contains("curitiba reference projects/")));

    // The commands as they are printed. The other reference is made from the scene itself.
    let said = run(&["scene", "corner.obj", "--size", "32x32", "--projects", "projects"]);
    assert!(said.contains("wrote") && said.contains("SceneNoEffects.xml"), "{said}");
    run(&["reference", "projects/SceneShadows.xml", "--size", "32x32"]);
    run(&["reference", "corner.obj", "--effects", "ao", "--size", "32x32"]);
    for found in of_pictures() {
        assert!(found["against"]["comparison"]["rmse"].as_f64().is_some_and(|rmse| rmse < 0.1), "{found}");
    }
    // The folder of written projects has the layout that a report expects.
    assert!(place.path().join("projects/raster/SceneGTAO.xml").is_file());
}
