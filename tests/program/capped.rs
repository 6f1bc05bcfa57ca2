//! Runs of the program under a cap of memory, shared by the tests of memory.

use curitiba::pipeline::image::{Rows, encode_png};
use image::{DynamicImage, ExtendedColorType, ImageBuffer, ImageFormat, Rgb, Rgba};
use std::fs::{self, File};
use std::io::{self, BufWriter, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;

pub const MIB: u64 = 1 << 20;

/// Skips a test where the system does not report the memory of a process.
macro_rules! needs_proc {
    () => {
        if $crate::capped::peak_of("self").is_none() {
            println!("skipped: /proc does not tell what a process holds");
            return;
        }
    };
}

/// The result of a run.
pub struct Run {
    pub status: ExitStatus,
    pub errors: String,
    /// Peak memory in bytes.
    pub peak: u64,
}

impl Run {
    pub fn failed_with_an_error(&self) -> bool {
        matches!(self.status.code(), Some(1..=3)) && self.errors.contains("error")
    }
}

/// Peak memory of a process in bytes; `None` where the system does not report it.
pub fn peak_of(process: &str) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().trim_end_matches("kB").trim().parse::<u64>().ok().map(|kibibytes| kibibytes * 1024)
}

/// Runs a command and reads its peak memory repeatedly. The system keeps the peak while the process lives, so frequent
/// reads suffice.
pub fn watch(mut command: Command) -> Run {
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

pub fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    // Without backtraces, because reading the debug information would take memory that is not the program's own.
    command.current_dir(folder).env("NO_COLOR", "1").env_remove("RUST_BACKTRACE");
    command
}

/// Rows of a pattern that are generated one by one and never stored as a whole.
pub struct Pattern {
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

pub fn write_pattern(path: &Path, side: u32) {
    let file = BufWriter::new(File::create(path).expect("created"));
    encode_png(file, &mut Pattern { size: [side; 2], row: 0, pixels: Vec::new() }).expect("written");
}

pub fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(name)
}

/// Writes a project `NAME.xml` that draws two triangles with a texture.
pub fn write_textured(folder: &Path, name: &str, texture: &str) {
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
pub fn write_inputs(folder: &Path) {
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
pub enum Expected {
    Done,
    Refused,
}
/// Runs each case with its cap in MiB. Compares its result with the expected one, and its peak memory with the allowed one: the cap, a tenth of
/// it, and the memory of an empty frame on the same engines.
#[track_caller]
pub fn try_cases(folder: &Path, cases: &[(String, u64, Expected)], empty: u64) {
    let mut wrong = Vec::new();
    for (arguments, cap, expected) in cases {
        let mut command = program(folder);
        command.args(arguments.split(' ')).args(["--max-memory", &format!("{cap}MiB")]);
        let run = watch(command);
        let allowed = cap * MIB + cap * MIB / 10 + empty;
        let name = arguments.replace(env!("CARGO_MANIFEST_DIR"), "");
        println!("{:>5} of {:>5} MiB, {:?}: {name}", run.peak / MIB, allowed / MIB, run.status.code());
        let right = match expected {
            Expected::Done => run.status.success(),
            Expected::Refused => run.failed_with_an_error(),
        };
        if !right || run.peak > allowed {
            wrong.push(format!("{name} with {cap} MiB: {:?} with {} MiB, {}", run.status, run.peak / MIB, run.errors));
        }
    }
    assert!(wrong.is_empty(), "an empty frame takes {} MiB; {}", empty / MIB, wrong.join("\n"));
}
