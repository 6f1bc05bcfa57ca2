//! Benchmarks whose rows are divided into shards.

use super::{command, fails_with, json, names, project, rows, succeeds, text, twelve_rows, with};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// The fields of a row that do not depend on who measured it.
fn timeless(row: &Value) -> Value {
    let fields = ["key", "label", "view", "size", "seed", "triangles", "error", "inputs", "picture"];
    fields.iter().map(|field| row[*field].clone()).collect()
}

/// Measures the twelve rows in this number of shards, all at once, each with its own references. Returns the merged
/// file.
fn merged(folder: &Path, shards: usize) -> Value {
    let base = twelve_rows();
    let folder = folder.join(shards.to_string());
    std::fs::create_dir(&folder).expect("a folder");
    let mut running = Vec::new();
    for shard in 1..=shards {
        let shard = format!("{shard}/{shards}");
        let mut command = command(&folder, &with(&base, &["--shard", &shard, "--parts", "parts"]));
        running.push(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts"));
    }
    for child in running {
        let output = child.wait_with_output().expect("it ends");
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    let (printed, _) = succeeds(&folder, &["merge", "all.json", "parts"]);
    assert!(printed.contains("AO, 9 samples") && printed.contains("12 rows of 1 machine\n"), "{printed}");
    assert_eq!(names(&folder.join("parts")).len(), 13, "a file for each row, and the list");
    json(&folder.join("all.json"))
}

#[test]
fn errors_pictures_and_order_do_not_depend_on_the_number_of_shards() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = merged(folder.path(), 1);
    assert_eq!((rows(&whole).len(), &whole["complete"]), (12, &Value::Bool(true)));
    let error = |row: &Value| row["error"]["against"]["comparison"]["rmse"].as_f64().expect("an error");
    assert!(rows(&whole).iter().all(|row| error(row) > 0.0 && row["picture"].as_str().is_some_and(|p| p.len() == 32)));
    let pictures: std::collections::BTreeSet<_> = rows(&whole).iter().map(|row| row["picture"].as_str()).collect();
    assert_eq!(pictures.len(), 12, "every row shows something else");
    for shards in [3, 5] {
        let shared = merged(folder.path(), shards);
        let of = |file: &Value| rows(file).iter().map(timeless).collect::<Vec<_>>();
        assert_eq!(of(&shared), of(&whole), "{shards} shards");
        assert_eq!(shared["command"], whole["command"]);
    }
}

#[test]
fn each_line_of_the_list_is_a_command_that_measures_that_row() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let spaced = folder.join("a folder's parts");
    let parts = spaced.to_str().expect("UTF-8");
    let base = twelve_rows();
    let (listed, _) = succeeds(folder, &with(&base, &["--list", "--parts", parts, "--threads", "1"]));
    let lines: Vec<Vec<&str>> = listed.lines().map(|line| line.split('\t').collect()).collect();
    assert_eq!(lines.len(), 12, "{listed}");
    for (index, line) in lines.iter().enumerate() {
        assert_eq!(line.len(), 3, "{line:?}");
        assert_eq!((line[0], line[1].len()), (index.to_string().as_str(), 16));
        assert!(line[2].contains(&format!("--shard {}/12", index + 1)), "{}", line[2]);
    }
    assert!(!spaced.exists(), "listing writes nothing");
    let (third, _) = succeeds(folder, &with(&base, &["--list", "--shard", "3/5"]));
    let indices: Vec<&str> = third.lines().filter_map(|line| line.split('\t').next()).collect();
    assert_eq!(indices, ["2", "7"]);
    // The shell runs the line as it is printed, except for the program's path.
    let words = lines[7][2].strip_prefix("curitiba ").expect("the program's name");
    let mut shell = Command::new("sh");
    shell.current_dir(folder).args(["-c", &format!("\"$0\" {words}"), env!("CARGO_BIN_EXE_curitiba")]);
    super::clean(&mut shell);
    let output = shell.env("CURITIBA_CACHE", folder.join("references")).output().expect("a shell");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(names(&spaced), [format!("{}.json", lines[7][1]), "rows.json".to_owned()]);
}

#[test]
fn rows_that_are_there_are_not_measured_again_by_whatever_shard() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let base = twelve_rows();
    let part = |shard: &str| {
        succeeds(
            folder,
            &with(&base, &["--shard", shard, "--parts", "parts", "--no-error"])
                .iter()
                .filter(|word| !["--reference-samples", "128"].contains(word))
                .copied()
                .collect::<Vec<_>>(),
        )
    };
    let (_, told) = part("2/3");
    assert_eq!(told.matches("row ").count(), 4, "{told}");
    let before: Vec<_> = names(&folder.join("parts"));
    let written =
        |name: &String| std::fs::metadata(folder.join("parts").join(name)).and_then(|m| m.modified()).expect("a time");
    let times: Vec<_> = before.iter().map(written).collect();
    let (printed, told) = part("2/3");
    assert!(told.is_empty() && printed.contains("4 of 12 rows, 4 of them are there"), "{told}{printed}");
    let (_, told) = part("1/1");
    assert_eq!(told.matches("row ").count(), 8, "{told}");
    assert_eq!(before.iter().map(written).collect::<Vec<_>>(), times, "what was there was written again");
    assert_eq!(names(&folder.join("parts")).len(), 13);
}

#[test]
fn a_scheduler_names_the_shard() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let base = twelve_rows();
    let arguments = with(&base, &["--list", "--shard", "auto"]);
    assert!(fails_with(2, folder, &arguments).contains("no scheduler is here"));
    let mut array = command(folder, &arguments);
    for (name, value) in [("ID", "5"), ("MIN", "4"), ("MAX", "7"), ("STEP", "1"), ("COUNT", "4")] {
        array.env(format!("SLURM_ARRAY_TASK_{name}"), value);
    }
    let printed = text(&array.output().expect("the program starts").stdout);
    let indices: Vec<&str> = printed.lines().filter_map(|line| line.split('\t').next()).collect();
    assert_eq!(indices, ["1", "5", "9"]);
}

#[test]
fn what_cannot_be_shared_out_is_refused_before_anything_is_measured() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let base = twelve_rows();
    let refined: Vec<&str> =
        base.iter().map(String::as_str).filter(|word| !["--reference-samples", "128"].contains(word)).collect();
    let noise = fails_with(2, folder, &[&refined[..], &["--shard", "1/2", "--parts", "parts"]].concat());
    assert!(noise.contains("--reference-samples N") && noise.contains("--no-error"), "{noise}");
    assert!(fails_with(2, folder, &[&refined[..], &["--list"]].concat()).contains("--reference-samples"));
    assert!(fails_with(2, folder, &with(&base, &["--shard", "1/2"])).contains("--parts DIR"));
    assert!(fails_with(2, folder, &with(&base, &["--shard", "0/2", "--parts", "parts"])).contains("K from 1 to N"));
    assert!(fails_with(2, folder, &with(&base, &["--parts", "parts", "--json", "a.json"])).contains("--json"));
    assert_eq!(names(folder), [""; 0], "something was written");

    // A folder belongs to one benchmark: another one is refused, and the first one's files are not touched.
    let shadows = project("SceneShadows.xml");
    let own = [
        "bench",
        &shadows,
        "--size",
        "24x24",
        "--frames",
        "1",
        "--raster",
        "cpu",
        "--backend",
        "cpu",
        "--parts",
        "parts",
    ];
    succeeds(folder, &own);
    let files = names(&folder.join("parts"));
    let other = fails_with(2, folder, &[&own[..], &["--seed", "3"]].concat());
    assert!(other.contains("rows.json: command differs") && other.contains("--seed 3"), "{other}");
    assert_eq!(names(&folder.join("parts")), files);
    // A part from another build is refused.
    let path = folder.join("parts").join(files.iter().find(|name| *name != "rows.json").expect("a part"));
    let whole = std::fs::read_to_string(&path).expect("text");
    let mut part = json(&path);
    part["environment"]["commit"] = "0000000".into();
    std::fs::write(&path, part.to_string()).expect("written");
    assert!(fails_with(2, folder, &own).contains("environment.commit differs: `0000000`"));
    // So is half a part.
    std::fs::write(&path, &whole[..whole.len() / 2]).expect("written");
    let torn = fails_with(3, folder, &own);
    assert!(torn.contains("this is no part of a benchmark") && torn.contains("column"), "{torn}");
}
