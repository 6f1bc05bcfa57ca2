//! The scripts in `examples/cluster`, run by schedulers.

use super::{clean, json, names, project, root, rows, text, twelve_rows};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn installed(program: &str) -> bool {
    let found = Command::new(program).arg("--version").stdin(Stdio::null()).output();
    found.is_ok_and(|output| output.status.success())
}

/// Runs a script of `examples/cluster`, and returns its output.
fn script(folder: &Path, name: &str, arguments: &[&str]) -> String {
    let output = run_script(folder, name, arguments);
    assert!(output.status.success(), "{name}:\n{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

fn run_script(folder: &Path, name: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new("bash");
    command.current_dir(folder).arg(root("examples/cluster").join(name)).args(arguments);
    clean(&mut command);
    command.env("CURITIBA", env!("CARGO_BIN_EXE_curitiba")).env("CURITIBA_CACHE", folder.join("references"));
    // GNU parallel writes to a folder in the home directory.
    command.env("JOBS", "2").env("HOME", folder).env("HQ_SERVER_DIR", folder.join("hq")).stdin(Stdio::null());
    command.output().expect("bash starts")
}

#[test]
fn gnu_parallel_runs_a_benchmark_and_the_frames_of_a_path() {
    if !installed("parallel") {
        println!("skipped: GNU parallel is not installed");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let arguments = twelve_rows();
    let arguments: Vec<&str> = ["4", "parts"].into_iter().chain(arguments[1..].iter().map(String::as_str)).collect();
    let printed = script(folder, "parallel.sh", &arguments);
    assert!(printed.contains("12 rows of 1 machine\n"), "{printed}");
    let file = json(&folder.join("parts.json"));
    assert_eq!((rows(&file).len(), file["complete"].as_bool()), (12, Some(true)));
    assert!(names(&folder.join("parts")).contains(&"jobs.log".to_owned()));

    let shadows = project("SceneShadows.xml");
    let fixed =
        ["--size", "32x32", "--raster", "cpu", "--backend", "cpu", "--path", "orbit:0,4,0,30,6,15", "-o", "f.png"];
    let printed = script(folder, "frames.sh", &[&["3", &shadows][..], &fixed].concat());
    assert!(printed.contains("6 of 6 frames, 6 of them were there"), "{printed}");
}

/// A HyperQueue server with two workers of one core each, in a folder of its own.
struct Queue<'f> {
    folder: &'f Path,
    processes: Vec<Child>,
}

impl<'f> Queue<'f> {
    fn start(folder: &'f Path) -> Self {
        let mut queue = Self { folder, processes: Vec::new() };
        queue.begin(&["server", "start"]);
        queue.wait_for("server", |queue| queue.ask(&["server", "info"]).status.success());
        for _ in 0..2 {
            queue.begin(&["worker", "start", "--cpus", "1"]);
        }
        queue.wait_for("two workers", |queue| {
            text(&queue.ask(&["worker", "list"]).stdout).matches("RUNNING").count() == 2
        });
        queue
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new("hq");
        command.current_dir(self.folder).env("HQ_SERVER_DIR", self.folder.join("hq")).args(arguments);
        command.stdin(Stdio::null());
        command
    }

    fn ask(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("hq starts")
    }

    fn begin(&mut self, arguments: &[&str]) {
        let process = self.command(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        self.processes.push(process.expect("hq starts"));
    }

    fn wait_for(&self, what: &str, is_there: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        while !is_there(self) {
            assert!(start.elapsed() < Duration::from_secs(30), "HyperQueue's {what} did not come in 30 s");
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Queue<'_> {
    fn drop(&mut self) {
        self.ask(&["server", "stop"]);
        for process in &mut self.processes {
            // Killing a process that has already ended fails.
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

#[test]
fn hyperqueue_runs_a_benchmark_and_says_why_a_task_failed() {
    if !installed("hq") {
        println!("skipped: HyperQueue's program hq is not installed");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let _queue = Queue::start(folder);
    let arguments = twelve_rows();
    let of = |first: &[&'static str]| -> Vec<String> { first.iter().map(|word| (*word).to_owned()).collect() };
    let good: Vec<String> = of(&["3", "parts"]).into_iter().chain(arguments[1..].iter().cloned()).collect();
    let output = run_script(folder, "hyperqueue.sh", &good.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    assert!(text(&output.stdout).contains("12 rows of 1 machine\n"), "{}", text(&output.stdout));
    assert_eq!(rows(&json(&folder.join("parts.json"))).len(), 12);

    // HyperQueue's own exit code does not report the failure.
    let output = run_script(folder, "hyperqueue.sh", &["2", "none", "no_such_project.xml", "--no-error"]);
    assert!(!output.status.success());
    assert!(text(&output.stderr).contains("cannot read no_such_project.xml"), "{}", text(&output.stderr));
}

/// Submits an array, kills node n2 together with its running task, and waits until the queue is empty.
const NODE_DIES: &str = r#"
set -euo pipefail
sbatch --array=1-4 -o out.txt task.sh parts "$@"
for _ in $(seq 600); do
    [ -s n2.pids ] && [ "$(ls parts | grep -c json)" -gt 2 ] && break
    sleep 0.1
done
read -r task step <n2.pids
kill -0 "$task"
kill -9 "$(cat state/n2.pid)" "$step" "$task"
echo "killed n2 with a task that ran on it"
for _ in $(seq 240); do
    [ -n "$(squeue -h)" ] || break
    sleep 1
done
squeue
"#;

/// A task of the array. On node n2 it records its own process and the Slurm process above it.
const TASK: &str = r#"#!/usr/bin/env bash
#SBATCH --requeue
#SBATCH --open-mode=append
echo "task $SLURM_ARRAY_TASK_ID on $SLURMD_NODENAME, restart ${SLURM_RESTART_COUNT:-0}"
[ "$SLURMD_NODENAME" != n2 ] || echo "$$ $PPID" >n2.pids
exec bash "$SCRIPT" "$@"
"#;

#[test]
fn slurm_finishes_a_benchmark_though_one_of_two_nodes_dies() {
    if std::env::var_os("CURITIBA_SLURM_TEST").is_none() {
        println!(
            "skipped: CURITIBA_SLURM_TEST is not set (it needs root, and slurmctld, slurmd, slurm-client and munge)"
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("task.sh"), TASK).expect("written");
    let samples: Vec<String> = (1..=80).map(|samples| samples.to_string()).collect();
    let (ssao, sweep) = (project("SceneSSAO.xml"), format!("samples={}", samples.join(",")));
    let fixed =
        ["--size", "64x64", "--frames", "3", "--raster", "cpu", "--backend", "cpu", "--threads", "1", "--no-error"];
    let mut command = Command::new("bash");
    command
        .current_dir(folder)
        .arg(root("examples/cluster/slurm_on_one_machine.sh"))
        .args(["state", "bash", "-c", NODE_DIES, "x"]);
    command.args([&ssao, "--sweep", &sweep]).args(fixed);
    clean(&mut command);
    command.env("CURITIBA", env!("CARGO_BIN_EXE_curitiba")).env("SCRIPT", root("examples/cluster/slurm.sh"));
    let start = Instant::now();
    let output = command.stdin(Stdio::null()).output().expect("bash starts");
    let told = std::fs::read_to_string(folder.join("out.txt")).unwrap_or_default();
    let tasks: Vec<&str> = told.lines().filter(|line| line.starts_with("task ")).collect();
    println!(
        "{:.0} s:\n{}{}\n{}",
        start.elapsed().as_secs_f64(),
        text(&output.stdout),
        text(&output.stderr),
        tasks.join("\n")
    );
    assert!(output.status.success() && text(&output.stdout).contains("killed n2"));
    assert!(tasks.iter().any(|task| !task.ends_with("restart 0")), "no task was started again");
    super::succeeds(folder, &["merge", "all.json", "parts"]);
    assert_eq!(rows(&json(&folder.join("all.json"))).len(), 80);
}

#[test]
fn every_script_is_one_that_bash_reads() {
    for name in names(&root("examples/cluster")) {
        let output =
            Command::new("bash").arg("-n").arg(root("examples/cluster").join(&name)).output().expect("bash starts");
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
    }
}
