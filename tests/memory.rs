//! `--max-memory` bounds the memory of the process, and refused memory ends the program with an error and an exit code.
//!
//! Each test runs the program as a child. Its peak memory is the system's `VmHWM`, so these tests need `/proc`. The
//! second half takes the shell's limits (`ulimit -v`).
#![cfg(unix)]

use curitiba::pipeline::image::{Rows, encode_png};
use image::{DynamicImage, ExtendedColorType, ImageBuffer, ImageFormat, Rgb, Rgba};
use std::fs::{self, File};
use std::io::{self, BufWriter, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;

const MIB: u64 = 1 << 20;

/// Skips a test where the system does not report the memory of a process.
macro_rules! needs_proc {
    () => {
        if peak_of("self").is_none() {
            println!("skipped: /proc does not tell what a process holds");
            return;
        }
    };
}

/// The result of a run.
struct Run {
    status: ExitStatus,
    errors: String,
    /// Peak memory in bytes.
    peak: u64,
}

impl Run {
    fn failed_with_an_error(&self) -> bool {
        matches!(self.status.code(), Some(1..=3)) && self.errors.contains("error")
    }
}

/// Peak memory of a process in bytes; `None` where the system does not report it.
fn peak_of(process: &str) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().trim_end_matches("kB").trim().parse::<u64>().ok().map(|kibibytes| kibibytes * 1024)
}

/// Runs a command and reads its peak memory repeatedly. The system keeps the peak while the process lives, so frequent
/// reads suffice.
fn watch(mut command: Command) -> Run {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program starts");
    let mut stream = child.stderr.take().expect("a pipe");
    let reader = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).map(|_| String::from_utf8_lossy(&bytes).into_owned())
    });
    let id = child.id().to_string();
    let mut peak = 0;
    let status = loop {
        peak = peak.max(peak_of(&id).unwrap_or(0));
        if let Some(status) = child.try_wait().expect("the child is ours") {
            break status;
        }
        std::thread::sleep(Duration::from_micros(500));
    };
    Run { status, errors: reader.join().expect("read").expect("read"), peak }
}

fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    // Without backtraces, because reading the debug information would take memory that is not the program's own.
    command.current_dir(folder).env("NO_COLOR", "1").env_remove("RUST_BACKTRACE");
    command
}

/// Rows of a pattern that are generated one by one and never stored as a whole.
struct Pattern {
    size: [u32; 2],
    row: u32,
    pixels: Vec<[f32; 4]>,
}

impl Rows for Pattern {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn next(&mut self, count: u32) -> io::Result<&[[f32; 4]]> {
        let width = self.size[0];
        let color = |x: u32, y: u32| [(x / 64 % 2) as f32, (y / 64 % 2) as f32, 0.5, 1.0];
        self.pixels =
            (0..count).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| color(x, self.row + y)).collect();
        self.row += count;
        Ok(&self.pixels)
    }
}

fn write_pattern(path: &Path, side: u32) {
    let file = BufWriter::new(File::create(path).expect("created"));
    encode_png(file, &mut Pattern { size: [side; 2], row: 0, pixels: Vec::new() }).expect("written");
}

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name)
}

/// Writes a project `NAME.xml` that draws two triangles with a texture.
fn write_textured(folder: &Path, name: &str, texture: &str) {
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).expect("written");
    write(&format!("{name}.mtl"), &format!("newmtl wall\nKd 1 1 1\nmap_Kd {texture}\n"));
    write(
        &format!("{name}.obj"),
        &format!(
            "mtllib {name}.mtl\nusemtl wall\nv -9 0 9\nv 9 0 9\nv 9 18 9\nv -9 18 9\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
             f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
        ),
    );
    let project = fs::read_to_string(shipped("SceneNoEffects.xml")).expect("the project");
    write(&format!("{name}.xml"), &project.replace("3dsmodels\\largoCamoes.cbo", &format!("{name}.obj")));
    fs::create_dir_all(folder.join("mlibs")).expect("made");
    for library in ["optixTest.mlib", "DeferredRenderTargets.mlib"] {
        fs::copy(shipped("mlibs").join(library), folder.join("mlibs").join(library)).expect("copied");
    }
}

/// Writes the inputs of the cases: small files that become large in memory.
fn write_inputs(folder: &Path) {
    write_pattern(&folder.join("large.png"), 6144);
    write_pattern(&folder.join("picture.png"), 2048);
    let side = 2048;
    let wide = ImageBuffer::from_fn(side, side, |x, y| Rgba([(x * 16) as u16, (y * 16) as u16, 0x7fff, 0xffff]));
    DynamicImage::ImageRgba16(wide).save_with_format(folder.join("wide.png"), ImageFormat::Png).expect("written");
    let plain = ImageBuffer::from_fn(side, side, |x, y| Rgb([(x / 8) as u8, (y / 8) as u8, 0]));
    let plain = DynamicImage::ImageRgb8(plain);
    for (name, format) in [
        ("plain.jpg", ImageFormat::Jpeg),
        ("plain.tga", ImageFormat::Tga),
        ("plain.tif", ImageFormat::Tiff),
        ("plain.bmp", ImageFormat::Bmp),
    ] {
        plain.save_with_format(folder.join(name), format).expect("written");
    }
    let grey = vec![128_u8; 16 << 20];
    image::save_buffer(folder.join("grey.png"), &grey, 4096, 4096, ExtendedColorType::L8).expect("written");
    for (name, texture) in [
        ("large", "large.png"),
        ("wide", "wide.png"),
        ("jpeg", "plain.jpg"),
        ("tga", "plain.tga"),
        ("tiff", "plain.tif"),
        ("bmp", "plain.bmp"),
        ("grey", "grey.png"),
    ] {
        write_textured(folder, &format!("of_{name}"), texture);
    }
}

/// The expected result of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Expected {
    Done,
    Refused,
}
use Expected::{Done, Refused};

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

/// Runs each case with its cap in MiB, and compares its end with what is expected and its peak memory with what is allowed: the cap, a
/// tenth of it, and what an empty frame takes on the same engines.
#[track_caller]
fn try_cases(folder: &Path, cases: &[(String, u64, Expected)], empty: u64) {
    let mut wrong = Vec::new();
    for (arguments, cap, expected) in cases {
        let mut command = program(folder);
        command.args(arguments.split(' ')).args(["--max-memory", &format!("{cap}MiB")]);
        let run = watch(command);
        let allowed = cap * MIB + cap * MIB / 10 + empty;
        let name = arguments.replace(env!("CARGO_MANIFEST_DIR"), "");
        println!("{:>5} of {:>5} MiB, {:?}: {name}", run.peak / MIB, allowed / MIB, run.status.code());
        let right = match expected {
            Done => run.status.success(),
            Refused => run.failed_with_an_error(),
        };
        if !right || run.peak > allowed {
            wrong.push(format!("{name} with {cap} MiB: {:?} with {} MiB, {}", run.status, run.peak / MIB, run.errors));
        }
    }
    assert!(wrong.is_empty(), "an empty frame takes {} MiB; {}", empty / MIB, wrong.join("\n"));
}

/// A software driver keeps textures and targets in the process. They count, too; what the driver needs to compile programs does not, and is
/// in the empty frame.
#[test]
fn the_process_stays_under_its_cap_with_a_driver_that_computes_on_the_processor() {
    needs_proc!();
    let folder = tempfile::tempdir().expect("a folder");
    write_inputs(folder.path());
    write_pattern(&folder.path().join("one.png"), 1);
    write_textured(folder.path(), "of_one", "one.png");
    let lit = fs::read_to_string(shipped("SceneShadows.xml")).expect("the project");
    fs::write(folder.path().join("lit.xml"), lit.replace("3dsmodels\\largoCamoes.cbo", "of_one.obj")).expect("written");
    let engines = |rays: &str| format!("--raster wgpu --backend {rays}");
    for (empty_frame, rays, cases) in [
        (
            "of_one.xml",
            "cpu",
            vec![
                // 192 MiB of texels with their levels in the host, and as many in the driver.
                ("of_large.xml --size 64x64", 512, Done),
                ("of_large.xml --size 64x64", 256, Refused),
                ("of_grey.xml --size 64x64", 256, Done),
                ("of_grey.xml --size 64x64", 128, Refused),
                ("of_jpeg.xml --size 64x64", 144, Done),
                // 36 MiB a target of 1536 x 1536 pixels.
                ("of_one.xml --size 1536x1536", 192, Done),
                ("of_one.xml --size 1536x1536", 64, Refused),
            ],
        ),
        ("lit.xml", "wgpu", vec![("lit.xml --size 1024x1024", 256, Done), ("lit.xml --size 1024x1024", 48, Refused)]),
    ] {
        let mut command = program(folder.path());
        command.args(format!("render {empty_frame} {} --size 1x1", engines(rays)).split(' '));
        let run = watch(command);
        if run.errors.contains("no Vulkan") || run.errors.contains("no graphics driver") {
            println!("skipped: {}", run.errors);
            return;
        }
        assert!(run.status.success(), "{}", run.errors);
        println!("an empty frame on wgpu, rays by {rays}: {} MiB", run.peak / MIB);
        let cases: Vec<(String, u64, Expected)> = cases
            .into_iter()
            .map(|(project, cap, expected)| (format!("render {project} {}", engines(rays)), cap, expected))
            .collect();
        try_cases(folder.path(), &cases, run.peak);
    }
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
    scene_ends_by_itself_under_every_limit: "scene --generate 100000 -o square";
    compare_ends_by_itself_under_every_limit: "compare picture.png picture.png --heat heat.png --threads 2";
    report_ends_by_itself_under_every_limit: "report SHIPPED --quick --time 5 --size 16x16 --max-triangles 1 --raster cpu --backend cpu --threads 2";
}
