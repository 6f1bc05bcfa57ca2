//! `curitiba visibility` as a user or a script runs it: rows, errors, and interrupted runs.

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

/// A folder with `room.obj`: a box of 3 x 2 x 4 whose faces look inward, and a one-sided plate in it.
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

/// The form factor between equal rectangles of `a` by `b` that face each other at distance `c`: Howell's catalogue,
/// C-11.
fn parallel(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let log = (p * p * q * q / (1.0 + x * x + y * y)).sqrt().ln();
    let arcs = x * q * (x / q).atan() + y * p * (y / p).atan() - x * x.atan() - y * y.atan();
    2.0 / (std::f64::consts::PI * x * y) * (log + arcs)
}

/// The form factor from a rectangle of width `w` to a perpendicular one of width `h` at the common edge `l`: Howell's
/// catalogue, C-14.
fn perpendicular(w: f64, h: f64, l: f64) -> f64 {
    let (w, h) = (w / l, h / l);
    let (ww, hh) = (w * w, h * h);
    let both = ww + hh;
    let arcs = w * (1.0 / w).atan() + h * (1.0 / h).atan() - both.sqrt() * (1.0 / both.sqrt()).atan();
    let first = ((1.0 + ww) * (1.0 + hh) / (1.0 + both)).ln();
    let second = ww * (ww * (1.0 + both) / ((1.0 + ww) * both)).ln();
    let third = hh * (hh * (1.0 + both) / ((1.0 + hh) * both)).ln();
    (arcs + 0.25 * (first + second + third)) / (std::f64::consts::PI * w)
}

/// The walls of the room, in the order of the file, with the axis perpendicular to each.
const WALLS: [(&str, usize); 6] = [("back", 2), ("front", 2), ("floor", 1), ("ceiling", 1), ("left", 0), ("right", 0)];

#[test]
fn the_page_shows_the_matrix_of_a_room_which_is_that_of_the_catalogue() {
    let folder = room();
    let text = std::fs::read_to_string(folder.path().join("room.obj")).expect("the scene");
    let walls = text.split("v 1 1 1").next().expect("the room");
    std::fs::write(folder.path().join("empty.obj"), walls).expect("written");
    succeeds(folder.path(), &["empty.obj", "--pairs", "all", "--quantity", "form-factor", "-o", "m.csv"]);
    // Each triangle of a wall has half of its area.
    let mut matrix = [[0.0; 6]; 6];
    for row in table(folder.path(), "m.csv") {
        let number = |index: usize| row[index].parse::<f64>().expect("a number");
        let [a, b] = [0, 1].map(|index| number(index) as usize / 2);
        matrix[a][b] += 0.5 * number(7);
        matrix[b][a] += 0.5 * number(8);
    }
    let size = [3.0, 2.0, 4.0];
    let mut page =
        "| from, to | back | front | floor | ceiling | left | right | sum |\n|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    for (i, (name, own)) in WALLS.into_iter().enumerate() {
        page += &format!("| {name} |");
        for (j, (_, other)) in WALLS.into_iter().enumerate() {
            let exact = if i == j {
                0.0
            } else if own == other {
                parallel(size[(own + 1) % 3], size[(own + 2) % 3], size[own])
            } else {
                perpendicular(size[other], size[own], size[3 - own - other])
            };
            assert!((matrix[i][j] - exact).abs() < 1e-6, "{name} {j}: {} {exact}", matrix[i][j]);
            page += &format!(" {:.5} |", matrix[i][j]);
        }
        let sum: f64 = matrix[i].iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "{name}: {sum}");
        page += &format!(" {sum:.5} |\n");
    }
    let document = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/visibility.md"));
    assert!(document.expect("the page").contains(&page), "docs/visibility.md does not hold\n{page}");
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
    std::fs::write(here.join("list.txt"), "0 1\n2 14\n").expect("written");
    let message = fails_with(3, here, &["room.obj", "--pairs", "list.txt", "-o", "a.csv"]);
    assert!(message.contains("list.txt:2:3: there is no triangle 14"), "{message}");
    assert!(!here.join("a.csv").exists() && !here.join("a.csv.part").exists());
}

#[test]
fn every_backend_gives_rows_or_says_what_is_missing() {
    let folder = room();
    let here = folder.path();
    let printed = succeeds(here, &["room.obj", "--pairs", "all", "--backend", "cpu", "-o", "cpu.csv"]);
    assert!(printed.contains("pairs, on cpu (") && !here.join("cpu.csv.part").exists(), "{printed}");
    let expected = table(here, "cpu.csv");
    for backend in ["auto", "cuda", "optix", "wgpu"] {
        let output = format!("{backend}.csv");
        let found = curitiba(here, &["room.obj", "--pairs", "all", "--backend", backend, "-o", &output]);
        if found.status.success() {
            // There are so few occluders that no segment is traced on the device; the rows are the same.
            assert_eq!(table(here, &output), expected, "{backend}");
        } else {
            let message = String::from_utf8_lossy(&found.stderr);
            assert_eq!(found.status.code(), Some(1), "{backend}: {message}");
            assert!(backend != "auto" && message.contains(backend) && message.contains("--backend cpu"), "{message}");
            assert!(!here.join(&output).exists() && !here.join(format!("{output}.part")).exists());
            let required = backend == "wgpu" && std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_some();
            assert!(!required, "{message}");
            println!("skipped: {backend}: {message}");
        }
    }
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
        // Remains that a kill may leave: half a row, half a line of the journal, and a block that never reached the disk.
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
        // Killed again at several arbitrary moments.
        let resumed = [vec!["--resume"], arguments(output)].concat();
        let mut ended = false;
        for milliseconds in [3, 19, 41, 67] {
            let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
            command.current_dir(here).arg("visibility").args(&resumed).stdout(Stdio::null());
            let mut run = command.spawn().expect("it starts");
            std::thread::sleep(std::time::Duration::from_millis(milliseconds));
            ended = run.try_wait().expect("it runs").is_some_and(|status| status.success());
            if ended {
                break;
            }
            run.kill().expect("it is killed");
            run.wait().expect("it ends");
        }
        if !ended {
            let printed = succeeds(here, &resumed);
            assert!(printed.contains("were done by the interrupted run"), "{printed}");
        }
        let [whole, cut] = [whole, output].map(|name| std::fs::read(here.join(name)).expect("written"));
        assert!(whole == cut, "the bytes of {output} differ");
        assert!(!part.exists() && !journal.exists());
    }
}

#[cfg(unix)]
#[test]
fn a_replaced_file_keeps_its_mode_and_a_link_stays_a_link() {
    use std::os::unix::fs::{PermissionsExt as _, symlink};
    let folder = room();
    let here = folder.path();
    std::fs::create_dir(here.join("real")).expect("a folder");
    std::fs::write(here.join("real/rows.csv"), "old").expect("written");
    std::fs::set_permissions(here.join("real/rows.csv"), std::fs::Permissions::from_mode(0o640)).expect("set");
    symlink("real/rows.csv", here.join("rows.csv")).expect("a link");
    symlink("real/new.csv", here.join("new.csv")).expect("a link to nothing yet");
    for output in ["rows.csv", "new.csv"] {
        succeeds(here, &["room.obj", "--pairs", "row:0", "-o", output]);
        assert!(here.join(output).symlink_metadata().expect("there").is_symlink());
        assert!(!table(&here.join("real"), output).is_empty());
    }
    let mode = std::fs::metadata(here.join("real/rows.csv")).expect("there").permissions().mode();
    assert_eq!(mode & 0o7777, 0o640);
    let left = std::fs::read_dir(here.join("real")).expect("a folder").count();
    assert_eq!(left, 2, "neither .part nor a journal is left");
}

#[cfg(unix)]
#[test]
fn a_part_or_journal_that_is_a_link_is_refused_before_it_is_read() {
    let place = room();
    let inside = place.path().join("in");
    std::fs::create_dir(&inside).expect("a folder");
    std::fs::rename(place.path().join("room.obj"), inside.join("room.obj")).expect("moved");
    for ending in ["part", "part.journal"] {
        for (name, outside) in [("there", true), ("missing", false)] {
            let (real, link) = (place.path().join(name), inside.join(format!("rows.csv.{ending}")));
            std::fs::write(place.path().join("there"), "secret of another\n").expect("written");
            std::os::unix::fs::symlink(&real, &link).expect("a link");
            for resume in [&[][..], &["--resume"]] {
                let run = [&["room.obj", "--pairs", "row:0", "-o", "rows.csv"][..], resume].concat();
                let confined = fails_with(1, &inside, &[&run[..], &["--confine", "."]].concat());
                assert!(confined.contains("which --confine names") && confined.contains(name), "{confined}");
                let free = fails_with(2, &inside, &run);
                assert!(free.contains(ending) && free.contains("symbolic link"), "{free}");
                assert!(!confined.contains("secret") && !free.contains("secret"), "{confined}{free}");
            }
            assert_eq!(real.exists(), outside, "nothing is made where the link leads");
            assert!(!inside.join("rows.csv").exists());
            std::fs::remove_file(link).expect("removed");
        }
        let unread = std::fs::read_to_string(place.path().join("there")).expect("there");
        assert_eq!(unread, "secret of another\n");
    }
    // Control: without a link the same run succeeds.
    succeeds(&inside, &["room.obj", "--pairs", "row:0", "-o", "rows.csv", "--confine", "."]);
}
