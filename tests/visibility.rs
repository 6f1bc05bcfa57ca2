//! `curitiba visibility` as a person or a script uses it: rows, errors, and runs that are interrupted.

use std::path::Path;
use std::process::{Command, Output, Stdio};

fn curitiba(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).arg("visibility").args(arguments).env("NO_COLOR", "1").output().expect("it starts")
}

#[track_caller]
fn succeeds(folder: &Path, arguments: &[&str]) -> String {
    let output = curitiba(folder, arguments);
    assert!(output.status.success(), "{arguments:?} failed:\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

#[track_caller]
fn fails_with(code: i32, folder: &Path, arguments: &[&str]) -> String {
    let output = curitiba(folder, arguments);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}");
    String::from_utf8(output.stderr).expect("UTF-8")
}

/// A folder with `room.obj`: a box of 3 x 2 x 4 that looks inward, and a plate in it, one-sided.
fn room() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = String::new();
    for corner in 0..8 {
        let pick = |bit: u32, size: u32| if corner >> bit & 1 == 1 { size } else { 0 };
        text += &format!("v {} {} {}\n", pick(0, 3), pick(1, 2), pick(2, 4));
    }
    for side in [[1, 2, 4, 3], [5, 7, 8, 6], [1, 5, 6, 2], [3, 4, 8, 7], [1, 3, 7, 5], [2, 6, 8, 4]] {
        text += &format!("f {} {} {} {}\n", side[0], side[1], side[2], side[3]);
    }
    text += "v 1 1 1\nv 2 1 1\nv 2 1 2\nv 1 1 2\nf 9 12 11 10\n";
    std::fs::write(folder.path().join("room.obj"), text).expect("written");
    folder
}

fn table(folder: &Path, name: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(folder.join(name)).expect("the rows");
    let lines = text.lines().skip(2);
    lines.map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn an_empty_room_sums_to_one_and_is_all_exact() {
    let folder = room();
    let text = std::fs::read_to_string(folder.path().join("room.obj")).expect("the scene");
    let walls = text.split("v 1 1 1").next().expect("the room");
    std::fs::write(folder.path().join("empty.obj"), walls).expect("written");
    let printed = succeeds(folder.path(), &["empty.obj", "--pairs", "all", "--quantity", "form-factor", "-o", "m.csv"]);
    assert!(printed.contains("12 triangles, 66 pairs, on cpu") && printed.contains("66 pairs are exact"), "{printed}");
    let mut sums = [0.0; 12];
    for row in table(folder.path(), "m.csv") {
        let number = |index: usize| row[index].parse::<f64>().expect("a number");
        sums[number(0) as usize] += number(7);
        sums[number(1) as usize] += number(8);
    }
    assert!(sums.iter().all(|sum: &f64| (sum - 1.0).abs() < 1e-5), "{sums:?}");
}

#[test]
fn arrays_hold_the_same_rows_as_text() {
    let folder = room();
    for output in ["rows.csv", "rows.npy"] {
        succeeds(folder.path(), &["room.obj", "--pairs", "near:0.001", "-o", output]);
    }
    let rows = table(folder.path(), "rows.csv");
    let array = std::fs::read(folder.path().join("rows.npy")).expect("the array");
    assert!(String::from_utf8_lossy(&array[..512]).contains(&format!("'shape': ({},)", rows.len())));
    let records: Vec<&[u8]> = array[512..].chunks(33).collect();
    assert_eq!(records.len(), rows.len());
    assert!(rows.iter().any(|row| row[2] == "sampled"));
    for (row, record) in rows.iter().zip(records) {
        assert_eq!(row[0], u32::from_le_bytes(record[..4].try_into().expect("four bytes")).to_string());
        let seen = f64::from_le_bytes(record[9..17].try_into().expect("eight bytes"));
        assert_eq!(row[3], seen.to_string());
    }
}

#[test]
fn errors_say_what_would_be_valid() {
    let folder = room();
    let here = folder.path();
    assert!(fails_with(2, here, &["room.obj", "-o", "a.txt"]).contains(".csv or .npy"));
    assert!(fails_with(2, here, &["room.obj", "--samples", "7", "-o", "a.csv"]).contains("a multiple of 8"));
    assert!(fails_with(2, here, &["room.obj", "--pairs", "row:99", "-o", "a.csv"]).contains("14 triangles"));
    assert!(fails_with(2, here, &["room.obj", "--pairs", "near:0", "-o", "a.csv"]).contains("near:0.01"));
    let message = fails_with(2, here, &["room.obj", "--backend", "optix", "-o", "a.csv"]);
    assert!(message.contains("does not run on optix") && message.contains("--backend cpu"), "{message}");
    std::fs::write(here.join("list.txt"), "0 1\n2 14\n").expect("written");
    let message = fails_with(3, here, &["room.obj", "--pairs", "list.txt", "-o", "a.csv"]);
    assert!(message.contains("list.txt:2:3: there is no triangle 14"), "{message}");
    assert!(!here.join("a.csv").exists() && !here.join("a.csv.part").exists());
}

#[test]
fn an_interrupted_run_is_gone_on_with_to_the_same_bytes() {
    let folder = room();
    let here = folder.path();
    // Enough pairs for several blocks.
    let list: String = (0..200_000_u32).map(|i| format!("{},{}\n", i % 14, i / 14 % 14)).collect();
    std::fs::write(here.join("list.csv"), list).expect("written");
    let arguments = |output: &'static str| vec!["room.obj", "--pairs", "list.csv", "--samples", "8", "-o", output];
    for (whole, output) in [("whole.csv", "cut.csv"), ("whole.npy", "cut.npy")] {
        succeeds(here, &arguments(whole));
        let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
        command.current_dir(here).arg("visibility").args(arguments(output)).stdout(Stdio::null());
        let mut run = command.spawn().expect("it starts");
        let journal = here.join(format!("{output}.part.journal"));
        let begun = || std::fs::read_to_string(&journal).is_ok_and(|text| text.lines().count() >= 2);
        while !begun() && run.try_wait().expect("it runs").is_none() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let killed = run.kill().is_ok() && !run.wait().expect("it ends").success();
        assert!(killed, "the run was interrupted");
        // What a kill may leave: half a row, half a line of the journal, a block that never reached the disk.
        let part = here.join(format!("{output}.part"));
        let add = |path: &Path, bytes: &[u8]| {
            let old = std::fs::read(path).expect("there");
            std::fs::write(path, [&old, bytes].concat()).expect("written");
        };
        add(&part, b"1,2,op");
        add(&journal, b"123 456");
        let again = fails_with(2, here, &arguments(output));
        assert!(again.contains("--resume goes on with it"), "{again}");
        let other = [vec!["--seed", "1", "--resume"], arguments(output)].concat();
        assert!(fails_with(2, here, &other).contains("of another run"));
        let printed = succeeds(here, &[vec!["--resume"], arguments(output)].concat());
        assert!(printed.contains("were done by the interrupted run"), "{printed}");
        let [whole, cut] = [whole, output].map(|name| std::fs::read(here.join(name)).expect("written"));
        assert!(whole == cut, "the bytes of {output} differ");
        assert!(!part.exists() && !journal.exists());
    }
}
