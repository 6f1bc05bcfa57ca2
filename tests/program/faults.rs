//! Commands under faults: a full disk, failing reads, refused memory, a limit on file sizes, signals, and 200 kills. Afterwards
//! every file has either its old or its new contents, and no other files are left.

use curitiba::Choice;
use curitiba::bench::model::BenchFile;
use curitiba::camera_path::CameraPath;
use curitiba::environment::Environment;
use curitiba::passes::visibility::PairSource as _;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::files::fault::{Fault, arm};
use curitiba::pipeline::image::{Image, write_png};
use curitiba::pipeline::plan::Settings;
use curitiba::report::folder::Folder;
use curitiba::visibility::ListedPairs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn project(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name)
}

fn curitiba(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.current_dir(folder).args(arguments).env("NO_COLOR", "1").env("CURITIBA_CACHE", folder.join("references"));
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<String> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// The names in a folder, except the folder of references.
fn kept(folder: &Path) -> Vec<String> {
    names(folder).into_iter().filter(|name| name != "references").collect()
}

fn temporaries(folder: &Path) -> Vec<String> {
    names(folder).into_iter().filter(|name| name.starts_with(".curitiba-")).collect()
}

/// Writes while the disk is full, from each of the calls on in turn. Afterwards `file` has either its old contents or those
/// of an undisturbed write.
fn fill_disk(name: &str, folder: &Path, file: &Path, reset: &dyn Fn(), write: &mut dyn FnMut() -> Result<(), String>) {
    reset();
    let old = std::fs::read(file).expect("there");
    write().expect("there is room");
    let new = std::fs::read(file).expect("written");
    assert!(old != new, "{name}");
    let (mut tried, mut kept) = (0, 0);
    for at in 0.. {
        reset();
        let armed = arm(folder, Fault::DiskFull, at);
        let result = write();
        let struck = armed.struck();
        drop(armed);
        if struck == 0 {
            break;
        }
        tried += 1;
        let message = result.expect_err("the disk is full");
        assert!(message.contains("no space left"), "{message}");
        let found = std::fs::read(file).expect("there");
        assert!(found == old || found == new, "{name}: neither old nor new after call {at}");
        kept += u32::from(found == old);
        assert_eq!(temporaries(folder), [""; 0], "{name}: left behind after call {at}");
    }
    assert!(tried > 0, "{name}: no call was counted");
    println!(
        "| {name} | the disk is full | {tried} | {kept} times the old file, {} times the new one, whole |",
        tried - kept
    );
}

#[test]
fn a_full_disk_at_any_write_of_render_bench_and_report_loses_nothing() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let settings = Settings { size: Some([24, 24]), show: vec!["all".to_owned()], ..Settings::default() };
    let mut renderer =
        curitiba::open(project("SceneShadows.xml"), settings, Choice::CPU, &mut Silent).expect("it opens");
    renderer.frame(&mut Silent).expect("it renders");
    // The file that is written last; when it is written, the others are complete.
    let outputs = renderer.outputs(&folder.join("out.exr"));
    let last = outputs.last().expect("shown channels").0.clone();
    let reset = || outputs.iter().for_each(|(file, _)| std::fs::write(file, "before").expect("written"));
    fill_disk("`render --show all`", folder, &last, &reset, &mut || {
        renderer.save(&folder.join("out.exr"), &mut Silent).map(drop).map_err(|error| error.to_string())
    });

    let file = folder.join("bench.json");
    let bench = BenchFile::begin("curitiba bench".to_owned(), Environment::here(), 1, 1);
    let reset = || std::fs::write(&file, "before").expect("written");
    fill_disk("`bench --json`", folder, &file, &reset, &mut || bench.write(&file).map_err(|error| error.to_string()));

    let generator = curitiba::report::page::GENERATOR;
    let page = |text: &str| format!("<html><meta name=\"generator\" content=\"{generator}\">{text}</html>");
    let report = folder.join("report");
    let picture = Image { width: 4, height: 4, pixels: vec![[0.5; 4]; 16] };
    let reset = || {
        let _ = std::fs::remove_dir_all(&report);
        std::fs::create_dir(&report).expect("a folder");
        std::fs::write(report.join("index.html"), page("before")).expect("written");
    };
    fill_disk("`report`", folder, &report.join("index.html"), &reset, &mut || {
        let text = |error: &dyn std::fmt::Display| error.to_string();
        let new = Folder::begin(&report).map_err(|error| text(&error))?;
        write_png(&new.path().join("pictures/a.png"), &picture).map_err(|error| text(&error))?;
        for (name, contents) in [("plots/a.svg", "plot"), ("data.json", "{}"), ("index.html", &page("after"))] {
            new.write(name, contents.as_bytes()).map_err(|error| text(&error))?;
        }
        new.finish().map(drop).map_err(|error| text(&error))
    });
}

/// Reads with a fault at each call in turn: the read fails, or its result is the same.
fn try_reads<T: PartialEq>(name: &str, folder: &Path, read: &dyn Fn() -> Option<T>) {
    let whole = read();
    assert!(whole.is_some(), "{name} cannot be read without a fault");
    for (fault, what) in [(Fault::ReadFails, "a read fails"), (Fault::ReadEndsEarly, "the file ends early")] {
        let (mut tried, mut refused) = (0, 0);
        for at in 0.. {
            let armed = arm(folder, fault, at);
            let found = read();
            if armed.struck() == 0 {
                break;
            }
            tried += 1;
            refused += u32::from(found.is_none());
            assert!(found.is_none() || found == whole, "{name}: {fault:?} at call {at} was not noticed");
        }
        assert!(tried > 0, "{name}: no call was counted");
        println!("| {name} | {what} | {tried} | {refused} | 0 | {} |", tried - refused);
    }
}

#[test]
fn a_fault_at_any_read_of_a_camera_path_or_a_list_of_pairs_is_an_error() {
    let place = tempfile::tempdir().expect("a folder");
    let (keys, list) = (place.path().join("keys.json"), place.path().join("pairs.csv"));
    let key = |frame: u32| format!(r#"{{"frame": {frame}, "position": [0, {frame}, 2], "direction": [0, 0, -1]}}"#);
    let text = format!(r#"{{"keys": [{}, {}]}}"#, key(0), key(5));
    std::fs::write(&keys, text).expect("written");
    let keys = keys.display().to_string();
    try_reads("a camera path", place.path(), &|| CameraPath::open(&keys).ok());
    let pairs: String = (0..3000).map(|i| format!("{},{}\n", i % 14, i % 11)).collect();
    std::fs::write(&list, pairs).expect("written");
    try_reads("a list of pairs", place.path(), &|| {
        let (mut list, mut pairs) = (ListedPairs::open(&list, 14).ok()?, Vec::new());
        while list.cursor()[0] < list.progress()[1] {
            list.fill(1000, &mut pairs).ok()?;
        }
        Some(pairs)
    });
}

/// Runs commands in which one of their large memory blocks is refused, each block in turn. Every run must end with an exit code: success if it
/// could do without the block, or an error that has a message. Afterwards each output is unchanged, or complete.
#[cfg(unix)]
#[test]
fn memory_that_is_refused_once_is_an_error_and_breaks_no_file() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let vertices: String = (0..6000).map(|i| format!("v {} {} {}\n", i % 77, i / 77, i % 5)).collect();
    let faces: String = (1..5900).map(|i| format!("f {i} {} {}\n", i + 1, i + 78)).collect();
    std::fs::write(folder.join("s.obj"), format!("{vertices}{faces}")).expect("written");
    for (name, value) in [("a.png", 0.25), ("b.png", 0.75)] {
        let pixels = vec![[value, 0.5, 0.5, 1.0]; 96 * 96];
        write_png(&folder.join(name), &Image { width: 96, height: 96, pixels }).expect("written");
    }
    let render = "render s.obj --size 64x64 --raster cpu --backend cpu --threads 1 --show color -o out.exr";
    for (name, command, outputs) in [
        ("render", render, &["out.exr", "out.color.exr", "out.color.png"][..]),
        ("scene", "scene s.obj -o s.cbo", &["s.cbo"]),
        ("compare", "compare a.png b.png --heat heat.png --threads 1", &["heat.png"]),
    ] {
        let arguments: Vec<&str> = command.split(' ').collect();
        let run = |block: Option<u32>| {
            for file in outputs {
                std::fs::write(folder.join(file), "before").expect("written");
            }
            let mut command = curitiba(folder, &arguments);
            // Writing a backtrace would take longer than the work.
            command.stderr(Stdio::piped()).env_remove("RUST_BACKTRACE");
            if let Some(block) = block {
                command.env("CURITIBA_TEST_REFUSE_BLOCK", block.to_string());
            }
            let output = command.output().expect("it runs");
            (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
        };
        let (code, told) = run(None);
        assert_eq!(code, Some(0), "{name}: {told}");
        assert!(!told.contains("a test refuses memory"), "{name}: {told}");
        let read = || outputs.iter().map(|file| std::fs::read(folder.join(file)).expect("there")).collect::<Vec<_>>();
        let whole = read();
        let (mut errors, mut done) = (0, 0);
        for block in 0.. {
            let (code, told) = run(Some(block));
            let refused = told.contains("a test refuses memory");
            let found = read();
            for ((file, found), whole) in outputs.iter().zip(&found).zip(&whole) {
                assert!(found == b"before" || found == whole, "{name}: {file} is broken without block {block}");
            }
            match code {
                Some(0) => {
                    assert!(found == whole, "{name}: success without its files, without block {block}");
                    done += u32::from(refused);
                }
                Some(1..=3) if refused && told.contains("error") && !told.contains("panicked") => errors += 1,
                _ => panic!("{name} without block {block}: {code:?}\n{told}"),
            }
            if !refused {
                break;
            }
        }
        assert_eq!(temporaries(folder), [""; 0], "{name}: the last run removes what refused ones left");
        assert!(errors >= 4, "{name}: {errors} errors and {done} successes");
        println!(
            "| `{name}` | a block of memory of 64 KiB or more is refused | {} | {errors} errors with the files as before or whole, \
             {done} times done without it |",
            errors + done
        );
    }
}

/// A pseudo-random number from 0 to 1 (xorshift, Marsaglia 2003).
fn random(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
fn two_hundred_kills_leave_whole_files_and_what_they_leave_is_removed() {
    const KILLS: u32 = 200;
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let scene = folder.join("s.obj");
    let vertices: String = (0..6000).map(|i| format!("v {} {} {}\n", i % 77, i / 77, i % 5)).collect();
    let faces: String = (1..5900).map(|i| format!("f {i} {} {}\n", i + 1, i + 78)).collect();
    std::fs::write(&scene, format!("{vertices}{faces}")).expect("written");
    let shadows = project("SceneShadows.xml").display().to_string();
    let render = |camera: &'static str| {
        [
            "render",
            &shadows,
            "--size",
            "40x40",
            "--raster",
            "cpu",
            "--threads",
            "2",
            "--show",
            "color",
            "--camera",
            camera,
            "-o",
            "out.exr",
        ]
        .map(str::to_owned)
        .to_vec()
    };
    let convert = |output: &str| ["scene", "s.obj", "-o", output].map(str::to_owned).to_vec();
    // Two commands for each group of files, which alternately replace the other's output.
    let commands = [render("MainCamera"), convert("s.cbo"), render("Vidro"), convert("s.nbo")];
    let start = |command: &[String]| -> Child {
        let arguments: Vec<&str> = command.iter().map(String::as_str).collect();
        curitiba(folder, &arguments).spawn().expect("the program starts")
    };
    let outputs = ["out.exr", "out.color.exr", "out.color.png", "s.cbo", "s.nbo"];
    let read = || outputs.map(|name| std::fs::read(folder.join(name)).ok());
    let mut whole = Vec::new();
    let mut longest = [Duration::ZERO; 4];
    for _ in 0..2 {
        for (command, longest) in commands.iter().zip(&mut longest) {
            let begin = Instant::now();
            assert!(start(command).wait().expect("it ends").success(), "{command:?}");
            *longest = begin.elapsed();
            whole.push(read());
        }
    }
    let known = |index: usize, found: &Option<Vec<u8>>| whole[3..].iter().any(|files| files[index] == *found);
    let (mut state, mut finished, mut left, mut changed) = (0x9e37_79b9_7f4a_7c15, 0, 0, 0);
    let mut before = read();
    // Other programs on the machine may make runs slower or faster than the measured ones: waits follow, so that about a third of the runs end.
    let mut slower = 1.1;
    for kill in 0..KILLS {
        let index = kill as usize % commands.len();
        let mut child = start(&commands[index]);
        std::thread::sleep(longest[index].mul_f64(slower * random(&mut state)));
        child.kill().expect("it can be killed");
        let has_ended = child.wait().expect("it ends").success();
        slower *= if has_ended { 0.9 } else { 1.05 };
        finished += u32::from(has_ended);
        let now = read();
        for (index, found) in now.iter().enumerate() {
            assert!(known(index, found), "{} is neither old nor new after kill {kill}", outputs[index]);
        }
        changed += u32::from(now != before);
        left += u32::from(!temporaries(folder).is_empty());
        before = now;
    }
    assert!(finished < KILLS && changed > 0, "no run was killed, or none had written");
    for command in &commands {
        assert!(start(command).wait().expect("it ends").success(), "{command:?}");
    }
    assert_eq!(temporaries(folder), [""; 0], "the next run removes what killed ones left");
    println!(
        "| `render`, `scene` | SIGKILL at a random moment | {KILLS} | every file whole; {finished} runs had ended, {changed} had \
         replaced a file, {left} times a temporary file was there until the next run |"
    );
}

/// Starts a command that works for seconds in a temporary folder, and waits until that folder exists.
#[cfg(unix)]
fn start_report(folder: &Path) -> Child {
    let projects = project("").display().to_string();
    let mut child =
        curitiba(folder, &["report", "--quick", "--size", "64x64", "-o", "r", &projects]).spawn().expect("it starts");
    let begin = Instant::now();
    while temporaries(folder).is_empty() {
        assert!(begin.elapsed() < Duration::from_secs(60), "no temporary folder in a minute");
        assert!(child.try_wait().expect("it can be asked").is_none(), "the report ended by itself");
        std::thread::sleep(Duration::from_millis(5));
    }
    child
}

/// Whether children of this process ignore a signal, as under `nohup`; false where the system does not report it.
#[cfg(unix)]
fn is_ignored(number: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask >> (number - 1) & 1 == 1)
}

#[cfg(unix)]
#[test]
fn signals_that_end_the_program_remove_what_is_half_written() {
    use std::os::unix::process::ExitStatusExt as _;
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    for (name, number) in [("INT", 2), ("TERM", 15), ("HUP", 1)] {
        if is_ignored(number) {
            // The program then ignores the signal, as its caller requested.
            println!("skipped: SIG{name} is ignored here, as under nohup");
            continue;
        }
        let mut child = start_report(folder);
        let sent = Command::new("kill").args([format!("-{name}"), child.id().to_string()]).status();
        assert!(sent.expect("kill is there").success());
        // It dies from the signal, as its parent shell expects.
        assert_eq!(child.wait().expect("it ends").signal(), Some(number), "{name}");
        assert_eq!(kept(folder), [""; 0], "{name}");
    }
    let mut child = start_report(folder);
    child.kill().expect("it can be killed");
    child.wait().expect("it ends");
    assert_eq!(temporaries(folder).len(), 1, "SIGKILL leaves the folder");
    let shadows = project("SceneNoEffects.xml").display().to_string();
    let render = ["render", &shadows, "--size", "8x8", "--raster", "cpu", "-o", "a.png"];
    assert!(curitiba(folder, &render).status().expect("it runs").success());
    assert_eq!(kept(folder), ["a.png"], "the next run removes it");
    println!("| `report` | SIGINT, SIGTERM, SIGHUP, SIGKILL | 4 | nothing left, after SIGKILL from the next run on |");
}

#[cfg(unix)]
#[test]
fn a_limit_on_file_sizes_is_an_error_at_any_size() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let shadows = project("SceneShadows.xml").display().to_string();
    let program = env!("CARGO_BIN_EXE_curitiba");
    let arguments = format!("render '{shadows}' --size 64x64 --raster cpu --show pos -o out.exr");
    let (mut failed, mut limit) = (0, 0);
    loop {
        for name in ["out.exr", "out.pos.exr", "out.pos.png"] {
            std::fs::write(folder.join(name), "before").expect("written");
        }
        // The limit is in blocks of 512 or 1024 bytes, depending on the shell.
        let script = format!("ulimit -f {limit} && exec '{program}' {arguments}");
        let mut command = Command::new("sh");
        let output =
            command.current_dir(folder).args(["-c", &script]).stdin(Stdio::null()).output().expect("sh is there");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(temporaries(folder), [""; 0], "limit {limit}");
        if output.status.success() {
            break;
        }
        // The program ends with the error's exit code, and not by SIGXFSZ.
        assert_eq!(output.status.code(), Some(1), "limit {limit}: {message}");
        assert!(message.contains("error: out.") && message.contains("too large"), "{message}");
        let png = std::fs::read(folder.join("out.pos.png")).expect("there");
        assert!(png == b"before", "the last file cannot be written when one before it failed");
        failed += 1;
        limit = (limit * 2).max(1);
    }
    assert!(failed >= 2, "no limit was too small");
    println!("| `render` | SIGXFSZ: a limit on file sizes | {failed} | an error, the old files stay |");
}

#[test]
fn a_stream_that_cannot_be_written_is_an_error_and_no_panic() {
    let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") else {
        println!("skipped: this system has no /dev/full");
        return;
    };
    let place = tempfile::tempdir().expect("a folder");
    let full = || Stdio::from(full.try_clone().expect("a file"));
    let (shadows, obj) = (project("SceneShadows.xml").display().to_string(), place.path().join("s.obj"));
    std::fs::write(&obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nbad\n").expect("written");
    let commands: [&[&str]; 10] = [
        &["completions", "bash"],
        &["completions", "fish"],
        &["--help"],
        &["--version"],
        &["render", "--help"],
        &["list"],
        &["list", "ssao"],
        &["plan", &shadows],
        &["check", &shadows],
        &["scene", "s.obj", "--json"],
    ];
    for command in commands {
        let output = curitiba(place.path(), command).stdout(full()).stderr(Stdio::piped()).output().expect("it runs");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{command:?}: {message}");
        assert!(message.contains("error: the output stream cannot be written"), "{command:?}: {message}");
    }
    // If the error stream is full, an error keeps its exit code. A run that would succeed exits with 1, since its messages could not be printed.
    for (command, code) in [(&["scene", "s.obj"][..], 1), (&["scene", "missing.obj"], 3), (&["no-command"], 2)] {
        let status = curitiba(place.path(), command).stderr(full()).status().expect("it runs");
        assert_eq!(status.code(), Some(code), "{command:?}");
    }
    println!("| every command | the output or error stream is full | 13 | an exit code of its own, no panic |");
}
