//! Processes that are killed at any moment.

use super::{command, json, names, project, rows, succeeds};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Starts the program and kills it after each of these times, without a chance to clean up. Returns how often it was
/// still running.
fn kill(folder: &Path, arguments: &[&str], times: impl Iterator<Item = u64>, check: impl Fn()) -> usize {
    let mut killed = 0;
    for time in times {
        let mut child =
            command(folder, arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program starts");
        std::thread::sleep(Duration::from_millis(time));
        killed += usize::from(child.try_wait().expect("its state").is_none());
        child.kill().expect("killed");
        child.wait().expect("it ended");
        check();
    }
    killed
}

/// Pseudo-random numbers below a bound, the same in every run.
fn scattered(count: u64, below: u64) -> impl Iterator<Item = u64> {
    (1..=count).map(move |index| (index.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) % below)
}

#[test]
fn a_benchmark_that_is_killed_fifty_times_is_whole_in_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let ssao = project("SceneSSAO.xml");
    let samples: Vec<String> = (1..=60).map(|samples| samples.to_string()).collect();
    let sweep = format!("samples={}", samples.join(","));
    let fixed =
        ["--size", "32x32", "--frames", "1", "--warmup", "0", "--raster", "cpu", "--backend", "cpu", "--no-error"];
    let arguments =
        [&["bench", &ssao, "--sweep", &sweep, "--camera", "MainCamera", "--camera", "Vidro"][..], &fixed].concat();
    let in_parts = [&arguments[..], &["--shard", "1/1", "--parts", "parts"]].concat();
    let parts = folder.join("parts");
    let whole = || {
        // Every file with a final name is complete.
        let there = if parts.exists() { names(&parts) } else { Vec::new() };
        for name in there.iter().filter(|name| name.ends_with(".json")) {
            let file = json(&parts.join(name));
            assert!(rows(&file).len() == 1 || name == "rows.json", "{name}");
        }
    };
    // The time of the first row on this machine; the kills are spread before, during and after the first rows of a
    // process.
    let start = Instant::now();
    let mut first = command(folder, &in_parts).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts");
    while !parts.exists() || names(&parts).iter().filter(|name| name.ends_with(".json")).count() < 2 {
        assert!(start.elapsed() < Duration::from_secs(120), "no row was measured");
        std::thread::sleep(Duration::from_millis(2));
    }
    let took = start.elapsed().as_millis() as u64;
    first.kill().expect("killed");
    first.wait().expect("it ended");
    // If the machine has become slower since then, no process gets as far as a row. In that case more processes are killed, later.
    let (mut killed, mut left, mut below) = (0, 0, took * 5 / 4);
    for _ in 0..6 {
        killed += kill(folder, &in_parts, scattered(50, below), whole);
        left = names(&parts).iter().filter(|name| name.ends_with(".json")).count() - 1;
        if left > 1 {
            break;
        }
        below *= 2;
    }
    println!("{killed} were still running, and left {left} of 120 rows; the first took {took} ms");
    assert!(killed >= 10 && left > 1, "{killed} were still running, and left {left} rows");
    succeeds(folder, &in_parts);
    let (_, told) = succeeds(folder, &["merge", "all.json", "parts"]);
    assert!(!told.contains("measured 2 times"), "{told}");
    let file = json(&folder.join("all.json"));
    assert_eq!(file["complete"], true);
    let keys: BTreeSet<&str> = rows(&file).iter().filter_map(|row| row["key"].as_str()).collect();
    assert_eq!((rows(&file).len(), keys.len()), (120, 120));
    let left: Vec<String> = names(&parts).into_iter().filter(|name| !name.ends_with(".json")).collect();
    // If all rows existed, the last run wrote nothing, and a temporary file of the previous run may remain.
    assert!(left.len() <= 1, "{left:?}");
}

#[test]
fn frames_that_are_killed_are_whole_in_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let shadows = project("SceneShadows.xml");
    let fixed = ["--size", "64x64", "--raster", "cpu", "--backend", "cpu", "--path", "orbit:0,4,0,30,30,15"];
    let render = |output| [&["render", &shadows][..], &fixed, &["-o", output]].concat();
    succeeds(folder, &render("whole.png"));
    kill(folder, &render("killed.png"), scattered(15, 200), || {});
    succeeds(folder, &render("killed.png"));
    for frame in 0..30 {
        let [whole, killed] =
            ["whole", "killed"].map(|name| std::fs::read(folder.join(format!("{name}.{frame:04}.png"))));
        assert!(whole.expect("a picture") == killed.expect("a picture"), "frame {frame}");
    }
}
