//! `--max-memory` bounds the memory of the process, and refused memory ends the program with an error and an exit code.
//!
//! Each test runs the program as a child. Its peak memory is the system's `VmHWM`, so these tests need `/proc`. The second
//! half of the tests uses the shell's limits (`ulimit -v`).

use crate::capped::Expected::{Done, Refused};
use crate::capped::{
    Expected, MIB, Run, program, shipped, try_cases, watch, write_inputs, write_pattern, write_textured,
};
use std::path::Path;
use std::process::Command;

#[test]
fn the_process_stays_under_its_cap_whatever_it_reads_draws_and_writes() {
    needs_proc!();
    let folder = tempfile::tempdir().expect("a folder");
    write_inputs(folder.path());
    let small = |name: &str, side: &str| {
        format!("render {} --raster cpu --backend cpu --size {side}", shipped(&format!("Scene{name}.xml")).display())
    };
    let textured = |name: &str| format!("render of_{name}.xml --raster cpu --backend cpu --size 64x64");
    // A frame of one pixel with a texture of one texel: the base memory of the program and its engines.
    write_pattern(&folder.path().join("one.png"), 1);
    write_textured(folder.path(), "of_one", "one.png");
    // A run this short may end between two reads, so the greatest of several counts.
    let runs = (0..5).map(|_| {
        let mut command = program(folder.path());
        command.args("render of_one.xml --raster cpu --backend cpu --size 1x1".split(' '));
        let run = watch(command);
        assert!(run.status.success(), "{}", run.errors);
        run.peak
    });
    let empty = runs.max().unwrap_or_default();
    assert!(empty > MIB && empty < 256 * MIB, "an empty frame takes {} MiB", empty / MIB);

    // 6144 x 6144 texels take 144 MiB, and the smaller mip levels 48 MiB.
    let cases: Vec<(String, u64, Expected)> = vec![
        (textured("large"), 224, Done),
        (textured("large"), 184, Refused),
        (textured("large"), 48, Refused),
        (textured("wide"), 64, Done),
        (textured("wide"), 24, Refused),
        (textured("jpeg"), 96, Done),
        (textured("jpeg"), 20, Refused),
        (textured("tga"), 64, Done),
        (textured("tiff"), 64, Done),
        (textured("bmp"), 64, Done),
        (textured("grey"), 112, Done),
        (textured("grey"), 72, Refused),
        // A target of 1536 x 1536 pixels takes 36 MiB; rendered in bands it fits in less.
        (small("NoEffects", "1536x1536"), 128, Done),
        (small("NoEffects", "1536x1536") + " -o a.exr", 128, Done),
        (small("NoEffects", "1536x1536"), 24, Done),
        (small("NoEffects", "1536x1536"), 8, Refused),
        (small("Shadows", "1024x1024"), 192, Done),
        (small("Shadows", "1024x1024") + " --show all -o b.exr", 224, Done),
        (small("Shadows", "1024x1024"), 64, Done),
        (small("Shadows", "1024x1024") + " --show all", 64, Refused),
        (small("Reflect", "512x512") + " --frames 3", 128, Done),
        (small("Final", "512x512") + " --set pass2.samples=4", 128, Done),
        (small("Final", "512x512") + " --set pass2.samples=4", 14, Refused),
        ("compare picture.png picture.png".into(), 1024, Done),
        ("compare picture.png picture.png".into(), 96, Refused),
        ("compare large.png large.png".into(), 320, Refused),
        ("scene --generate 200000 -o square".into(), 512, Done),
        ("scene --generate 2000000 -o other".into(), 48, Refused),
        (
            format!(
                "bench {} --no-error --frames 1 --size 256x256 --raster cpu",
                shipped("SceneShadows.xml").display()
            ),
            160,
            Done,
        ),
    ];
    assert!(cases.len() >= 20);
    try_cases(folder.path(), &cases, empty);
}

/// Runs the program with its address space limited to `kibibytes`.
fn limited(folder: &Path, arguments: &str, kibibytes: u64) -> Run {
    let mut command = Command::new("sh");
    let program = env!("CARGO_BIN_EXE_curitiba");
    command.current_dir(folder).env("NO_COLOR", "1");
    // A graphics driver may crash when it is refused memory, so drivers are hidden.
    command.env("VK_DRIVER_FILES", "/nonexistent").env("VK_ICD_FILENAMES", "/nonexistent");
    command.args(["-c", &format!("ulimit -v {kibibytes} && exec {program} {arguments}")]);
    watch(command)
}

/// Tries a command with increasing limits, from the limit at which the loader can start the program to the one at which
/// the command succeeds. Every run must end by itself.
fn climb(name: &str, arguments: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    write_pattern(&folder.path().join("picture.png"), 700);
    let arguments = arguments.replace("SHIPPED", &shipped("").display().to_string());
    let starts = |kibibytes: &u64| limited(folder.path(), "--version", *kibibytes).status.success();
    let Some(first) = (3..200).map(|step| step * 4096).find(starts) else {
        println!("skipped: no limit of the shell lets the program start");
        return;
    };
    let (mut limit, mut refused, mut done) = (first, 0, 0);
    while done < 2 && limit < 4 << 20 {
        let run = limited(folder.path(), &arguments, limit);
        match run.status.code() {
            Some(0) => done += 1,
            Some(1..=3) if run.errors.contains("error") => refused += 1,
            _ => panic!("{name} with {} MiB: {:?}\n{}", limit / 1024, run.status, run.errors),
        }
        limit += (limit / 12).max(1);
    }
    println!("{name}: {refused} limits from {} MiB were refused, {done} sufficed", first / 1024);
    assert!(refused >= 3 && done == 2, "{name}: {refused} refused, {done} done, up to {} MiB", limit / 1024);
}

macro_rules! ladders {
    ($($test:ident: $arguments:literal;)*) => {
        $(#[test]
        fn $test() {
            climb(stringify!($test), $arguments);
        })*
    };
}

ladders! {
    render_ends_by_itself_under_every_limit: "render SHIPPED/SceneFinal.xml --raster cpu --backend cpu --size 200x200 --set pass2.samples=4 --threads 4";
    bench_ends_by_itself_under_every_limit: "bench SHIPPED/SceneShadows.xml --raster cpu --backend cpu --size 96x96 --frames 1 --no-error --json b.json --threads 3";
    scene_ends_by_itself_under_every_limit: "scene --generate 400000 -o square";
    compare_ends_by_itself_under_every_limit: "compare picture.png picture.png --heat heat.png --threads 2";
    report_ends_by_itself_under_every_limit: "report SHIPPED --quick --time 5 --size 16x16 --max-triangles 1 --raster cpu --backend cpu --threads 2";
}
