//! The arguments of the command line; help and completions come from here.

use super::bench_args::BenchArgs;
use super::compare_args::CompareArgs;
use super::man::ManArgs;
use super::merge::MergeArgs;
use super::reference_args::ReferenceArgs;
use super::tune_args::TuneArgs;
use super::visibility_args::VisibilityArgs;
use clap::{ArgGroup, Args, Parser, Subcommand, ValueEnum, ValueHint};
use curitiba::args::{
    Backend, ProjectArgs, Raster, SceneFlags, parse_bytes, parse_error_bound, parse_pixel, parse_size,
};
use curitiba::pipeline::executor::Goal;
use curitiba::shard::Request;
use curitiba::{BackendChoice, Choice, Gpus};
use std::ffi::OsString;
use std::path::PathBuf;
use std::str::FromStr;

/// Renders projects that join rasterisation and ray tracing in one deferred pipeline.
#[derive(Debug, Parser)]
#[command(
    name = "curitiba",
    version,
    max_term_width = 110,
    arg_required_else_help = true,
    after_help = "\
Examples:
  curitiba render xml_projects/SceneFinal.xml
  curitiba render model.glb --size 1024x768
  curitiba render xml_projects/SceneSSAO.xml --set pass2.samples=16 --size 512x512 -o ao.exr
  curitiba plan xml_projects/SceneReflect.xml
  curitiba compare a.exr b.exr --max-flip 0.05
  curitiba scene --generate 100000 -o square/

Exit codes: 0 done; 1 the work failed, or a comparison is beyond a limit; 2 the command line is wrong; 3 a project or scene file is wrong."
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Read and write no file outside this folder, wherever symbolic links lead: for projects of strangers
    #[arg(long, global = true, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub confine: Option<PathBuf>,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a project, or a scene without one, and print what each step took.
    #[command(after_help = "\
Examples:
  curitiba render model.glb
  curitiba render house.obj garden.obj --look-from 12,4,-9 --effects shadows,ao -o house.png
  curitiba render xml_projects/SceneFinal.xml -o final.png
  curitiba render xml_projects/SceneFinal.xml --camera Vidro --fidelity thesis
  curitiba render xml_projects/SceneShadows.xml --show pos --show norm -o out.png
  curitiba render xml_projects/SceneFinal.xml --set pass2.samples=49 --set pass2.sampler=strata
  curitiba render xml_projects/SceneSSAO.xml --frames 10 --json
  curitiba render xml_projects/SceneRefract.xml --camera Vidro --pixel 512,512
  curitiba render xml_projects/SceneFinal.xml --check-numerics
  curitiba render xml_projects/SceneFinal.xml --size 16384x16384 --bands 16 -o large.exr
  curitiba render xml_projects/SceneFinal.xml --backend optix --fallback cuda,cpu
  curitiba render xml_projects/SceneFinal.xml --path orbit:0,4,0,30,120,15 --frames 0..48 -o frames/square.png
  curitiba render xml_projects/SceneFinal.xml --path cameras.json --shard 2/8 -o frames/square.exr")]
    Render(RenderArgs),
    /// Print what would be done for a project, and why.
    Plan(ProjectArgs),
    /// Check a project, its libraries and its scenes; print every problem.
    Check(ProjectArgs),
    /// List programs, parameters, engines and what they can run.
    #[command(after_help = "Examples:\n  curitiba list\n  curitiba list ssao\n  curitiba list gtao")]
    List {
        /// Describe one program and print a pass to paste into a project.
        program: Option<String>,
    },
    /// Compare two pictures, or two ways to render a project; fail beyond a limit.
    ///
    /// A is judged by B, the reference. Each is a picture (.png, .exr) or PROJECT.xml@SETTING,SETTING, which is rendered.
    #[command(after_long_help = super::compare_args::long_help(), after_help = "\
Examples:
  curitiba compare a.exr b.exr --max-rmse 0.01 --max-flip 0.05
  curitiba compare p.xml@fidelity=thesis p.xml@ --strip strip.png
Formulas, settings and exit codes: curitiba compare --help")]
    Compare(Box<CompareArgs>),
    /// Describe scene files, convert them, or generate the square.
    #[command(after_help = "\
Examples:
  curitiba scene model.obj
  curitiba scene model.glb --project model.xml
  curitiba scene a.obj b.obj -o largoCamoes.cbo
  curitiba scene model.glb -o model.nbo
  curitiba scene --generate 1000000 -o square/")]
    Scene(SceneArgs),
    /// Measure what each effect costs per frame, and its error against a reference.
    #[command(after_help = "\
Examples:
  curitiba bench xml_projects/SceneFinal.xml --camera MainCamera --camera Vidro --json final.json
  curitiba bench --table2 --json table2.json --markdown table2.md
  curitiba bench --table2 --json table2.json --resume
  curitiba bench xml_projects/SceneSSAO.xml --sweep samples=1,4,9,16 --size 512x512
  curitiba bench xml_projects/SceneShadows.xml --compare cpu,wgpu
  curitiba bench xml_projects/SceneFinal.xml --sweep-threads 1,2,4,8,16 --json threads.json --plots .
  curitiba bench --table2 --reference-samples 4096 --list
  curitiba bench --table2 --reference-samples 4096 --shard auto --parts parts

A row's error is that of its window picture, in linear values, against a reference that this program renders: in f64 where there is no \
noise, else with so many samples that the reference's own error is a tenth of the row's. References are kept and used again.")]
    Bench(Box<BenchArgs>),
    /// Render the picture that `bench` and `report` judge rows by as a whole, from the camera in f64, and keep it.
    #[command(after_help = "\
Examples:
  curitiba reference xml_projects/SceneFinal.xml --camera Vidro --size 512x512
  curitiba reference xml_projects/SceneSSAO.xml --size 256x256 --samples 256 -o right.exr

It takes minutes, is made once for a project, a camera and a size, and serves every row of them, by rays and by raster: docs/benchmarks.md")]
    Reference(Box<ReferenceArgs>),
    /// Join the parts that `bench --parts` wrote, or benchmarks of several machines, and print them: a column for each machine.
    #[command(after_help = "\
Examples:
  curitiba merge table2.json parts
  curitiba merge both.json first/parts second/parts
  curitiba merge both.json here.json there.json

Parts of other commands, builds, projects, scenes or references are refused. Nothing is averaged: what one machine measured \
twice is there twice. Rows that are missing are listed, and the exit code is then 1: docs/cluster.md")]
    Merge(MergeArgs),
    /// Measure every effect by raster and by rays on this machine, and write a page about it.
    #[command(
        long_about = "\
Measures every effect by raster and by rays on this machine, and writes a folder with an index.html that opens from disk: \
tables, pictures to compare, speed against error, scaling, and which effects to trace and which to rasterise at 60 frames a \
second. Takes at most ten minutes, or one with --quick: what no longer fits is left out, and the page says what and why.",
        after_help = "\
Examples:
  curitiba report
  curitiba report --quick --size 256x256 -o quick-report
  curitiba report --size 1024x1024 my_projects"
    )]
    Report(ReportArgs),
    /// Choose raster or rays for each effect, and their settings, by measuring on this machine; write that project.
    #[command(after_help = "\
Examples:
  curitiba tune xml_projects/SceneSSAO.xml --time 16.6ms
  curitiba tune xml_projects/SceneShadows.xml --error 0.01 -o shadows.xml
  curitiba tune model.glb --size 640x360 --time 33ms --metric flip

Each candidate is a row: `*` is chosen, `+` are the two next best. What is written is rendered again; the exit code is 1 where that misses \
the goal, or where nothing meets it.")]
    Tune(Box<TuneArgs>),
    /// How much triangles see of each other, and form factors, for lists of pairs of any length.
    #[command(after_help = "\
Examples:
  curitiba visibility model.obj -o seen.csv
  curitiba visibility room.glb --pairs all --quantity form-factor -o matrix.npy
  curitiba visibility xml_projects/SceneFinal.xml --pairs near:0.001 --error 0.02 -o square.csv
  curitiba visibility model.obj --pairs list.csv --facing zero -o seen.csv --resume

A pair is exact where it faces away, where nothing is between, or where a surface closes it; else it is sampled, with a \
standard error. Columns, policies and limits: docs/visibility.md")]
    Visibility(VisibilityArgs),
    /// Show a project or scene in a window: what each pass writes and takes, and what its settings change.
    ///
    /// The window is a program of its own, `curitiba-view`, beside this one or on PATH; it takes the same arguments as `render`.
    #[command(
        disable_help_flag = true,
        after_help = "\
Examples:
  curitiba view xml_projects/SceneFinal.xml
  curitiba view --help

It is built by: cargo build --release --package curitiba-view"
    )]
    View {
        /// What is shown, with options as of `render`.
        #[arg(value_name = "PROJECT.xml|SCENE", trailing_var_arg = true, allow_hyphen_values = true, value_hint = ValueHint::AnyPath)]
        arguments: Vec<OsString>,
    },
    /// Print the manual page, or write those of all commands.
    #[command(after_help = "Examples:\n  curitiba man | man -l -\n  curitiba man ~/.local/share/man/man1")]
    Man(ManArgs),
    /// Print completions for a shell.
    #[command(after_help = "Example:\n  curitiba completions bash > /etc/bash_completion.d/curitiba")]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

impl Command {
    /// Limit of the command's memory in bytes; `None` for commands that need almost none.
    pub fn max_memory(&self) -> Option<u64> {
        match self {
            Self::Render(args) => Some(args.project.max_memory),
            Self::Plan(args) | Self::Check(args) => Some(args.max_memory),
            Self::Compare(args) => Some(args.max_memory),
            Self::Scene(args) => Some(args.max_memory),
            Self::Bench(args) => Some(args.max_memory),
            Self::Reference(args) => Some(args.max_memory),
            Self::Report(args) => Some(args.max_memory),
            Self::Tune(args) => Some(args.project.max_memory),
            Self::Visibility(args) => Some(args.max_memory),
            Self::Merge(args) => Some(args.max_memory),
            Self::List { .. } | Self::View { .. } | Self::Man(_) | Self::Completions { .. } => None,
        }
    }
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub project: ProjectArgs,
    /// The picture, .png or .exr [default: the project's name with .png, in this folder]
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub output: Option<PathBuf>,
    /// Frames to render: N of one picture, of which the table shows the median; with --path those from A up to and without B
    /// [default: 1, with --path all]
    #[arg(long, value_name = "N|A..B")]
    pub frames: Option<Frames>,
    /// Move the camera, and write a numbered picture of each frame: a .json of keyframes, or once round a point in N frames. Frames
    /// that are there are not rendered again: docs/cluster.md
    #[arg(long = "path", value_name = "FILE.json|orbit:CX,CY,CZ,R,N[,ELEVATION]", value_hint = ValueHint::FilePath,
          conflicts_with_all = ["accumulate", "pixel", "check_numerics"])]
    pub camera_path: Option<String>,
    /// Render every N-th frame from the K-th, 1/N to N/N, for N processes; auto takes both numbers from the scheduler's variables, auto/N
    /// the first
    #[arg(long, value_name = "K/N|auto[/N]", requires = "camera_path")]
    pub shard: Option<Request>,
    /// Render frames of a path again that are there, whatever they show
    #[arg(long, requires = "camera_path")]
    pub overwrite: bool,
    /// Take more and more samples of the passes that take any (ambient occlusion), and say how far off the picture still is: a number of samples
    /// (64), a time (2s, 500ms), or a standard error (0.002); docs/library.md says what that is
    #[arg(long, value_name = "GOAL", conflicts_with_all = ["frames", "bands", "pixel", "check_numerics"])]
    pub accumulate: Option<Goal>,
    /// Show what passes write in the image viewer tev while it is rendered, and with --accumulate as it gets better. tev listens at
    /// 127.0.0.1:14158, unless its --host says otherwise
    #[arg(long, value_name = "HOST:PORT", conflicts_with_all = ["camera_path", "crop", "bands"])]
    pub display: Option<String>,
    /// Write when each step of each frame began and ended, as trace events that Perfetto and chrome://tracing open
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath, conflicts_with = "camera_path")]
    pub trace: Option<PathBuf>,
    /// Print the report as JSON, with every sample
    #[arg(long)]
    pub json: bool,
    /// Print every ray of one pixel (column and row from the top left): origin, direction, offset, weight and what it hit
    #[arg(long, value_name = "X,Y", value_parser = parse_pixel, conflicts_with = "json")]
    pub pixel: Option<[u32; 2]>,
    /// Count values of every pass that are not numbers, infinite, negative or out of range, and fail if there are any
    #[arg(long)]
    pub check_numerics: bool,
    /// Ray backends that may take over, in this order, where the one before them is not there or fails; each is told as a
    /// warning that names the pass, and is in the JSON. Without it a failure ends the run
    #[arg(long, value_enum, value_name = "BACKENDS", value_delimiter = ',')]
    pub fallback: Vec<FallbackArg>,
}

/// `--frames`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frames {
    /// This number of frames of one picture.
    Count(u32),
    /// Frames of a path, from the first number up to, but not including, the second.
    Range(u32, u32),
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const MOST: u32 = 1_000_000;
        let wrong = || format!("`{text}` is neither N, 1 to {MOST}, nor A..B with A below B, such as 0..48");
        match text.split_once("..") {
            None => text.parse().ok().filter(|n| (1..=MOST).contains(n)).map(Self::Count).ok_or_else(wrong),
            Some((from, to)) => {
                let (from, to) = (from.parse().map_err(|_| wrong())?, to.parse().map_err(|_| wrong())?);
                if from < to && to <= MOST { Ok(Self::Range(from, to)) } else { Err(wrong()) }
            }
        }
    }
}

/// Arguments of `scene`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("written").args(["project", "projects"]).multiple(true))]
pub struct SceneArgs {
    /// Scene files (.cbo, .nbo, .obj, .gltf, .glb, .3ds, .dae, .mesh.xml), or folders of them; several are merged
    #[arg(value_name = "FILE", value_hint = ValueHint::FilePath, required_unless_present = "generate")]
    pub files: Vec<PathBuf>,
    /// Generate the stand-in square with about this many triangles (10 000 to 10 000 000)
    #[arg(long, value_name = "TRIANGLES", conflicts_with = "files", requires = "output",
          value_parser = clap::value_parser!(u32).range(10_000..=10_000_000))]
    pub generate: Option<u32>,
    /// Write a project that shows the scene here: FILE.xml, and FILE.mlib beside it
    #[arg(long, value_name = "FILE.xml", value_hint = ValueHint::FilePath, conflicts_with = "generate")]
    pub project: Option<PathBuf>,
    /// Write the projects that a report is made of into this folder: one for each effect by rays and by raster
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, conflicts_with = "generate")]
    pub projects: Option<PathBuf>,
    /// Window of these projects [default: 1024x1024]
    #[arg(long, value_name = "WxH", value_parser = parse_size, requires = "written")]
    pub size: Option<[u32; 2]>,
    #[command(flatten)]
    pub scene: SceneFlags,
    /// Write the scene here: .cbo (2014 layout), .nbo (today's), or a folder for --generate
    #[arg(short, long, value_name = "PATH", value_hint = ValueHint::AnyPath)]
    pub output: Option<PathBuf>,
    /// Print the description as JSON
    #[arg(long)]
    pub json: bool,
    /// Most memory that the program may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

/// Arguments of `report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// The folder with SceneNoEffects.xml and the other projects, those of raster effects in its folder raster; or a scene
    /// file, or a folder of them, of which these projects are made
    #[arg(value_name = "PROJECTS-DIR|SCENE", default_value = "xml_projects", value_hint = ValueHint::AnyPath)]
    pub projects: PathBuf,
    /// Window size [default: 512x512, with --quick 256x256]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    #[command(flatten)]
    pub scene: SceneFlags,
    /// The report's folder; a report that is there already is replaced when the new one is complete
    #[arg(short, long, value_name = "DIR", default_value = "report", value_hint = ValueHint::DirPath)]
    pub output: PathBuf,
    /// A smaller window, fewer settings and one minute
    #[arg(long)]
    pub quick: bool,
    /// Time allowed, seconds [default: 600, with --quick 60]
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(5..=86_400))]
    pub time: Option<u32>,
    /// Root mean square error of an effect within which the cheapest setting is advised
    #[arg(long, value_name = "RMSE", default_value_t = curitiba::report::model::WITHIN, value_parser = parse_error_bound)]
    pub within: f64,
    /// Most triangles of the generated squares of the scaling plot [default: 10 000 000, with --quick 1 000 000]
    #[arg(long, value_name = "N")]
    pub max_triangles: Option<u32>,
    /// Rasteriser; auto takes a real GPU if there is one, and measures the cpu beside it
    #[arg(long, value_enum, default_value_t = Raster::Auto)]
    pub raster: Raster,
    /// Ray backend of the report; every other one that is there is measured beside it, at the usual settings
    #[arg(long, value_enum, default_value_t = Backend::Auto)]
    pub backend: Backend,
    /// Device of wgpu, for rasteriser and rays: a part of its name, or its place in `curitiba list`, from 0
    #[arg(long, value_name = "NAME", value_parser = curitiba::passes::raster::gpu::named)]
    pub adapter: Option<u8>,
    /// GPUs that share the rays of cuda and optix: a number, or all
    #[arg(long, value_name = "N", default_value_t = Gpus::default())]
    pub gpus: Gpus,
    /// Threads of the cpu engines [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Most memory that the program may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

/// `--fallback`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FallbackArg {
    Cpu,
    Wgpu,
    Cuda,
    Optix,
}

impl RenderArgs {
    /// The choice of engines and fallbacks. A backend that is named twice is tried once.
    pub fn choice(&self) -> Choice {
        let mut fallback = [None; 4];
        let mut named: Vec<FallbackArg> = Vec::new();
        for backend in &self.fallback {
            if !named.contains(backend) {
                named.push(*backend);
            }
        }
        for (slot, backend) in fallback.iter_mut().zip(named) {
            *slot = Some(match backend {
                FallbackArg::Cpu => BackendChoice::Cpu,
                FallbackArg::Wgpu => BackendChoice::Wgpu,
                FallbackArg::Cuda => BackendChoice::Cuda,
                FallbackArg::Optix => BackendChoice::Optix,
            });
        }
        Choice { fallback, ..self.project.choice() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn backends_that_may_take_over_keep_their_order_and_are_named_once() {
        let choice = |words: &[&str]| {
            let parsed =
                Cli::try_parse_from([&["curitiba", "render", "p.xml"], words].concat()).map_err(|e| e.to_string())?;
            let Command::Render(args) = parsed.command else { return Err("another command".to_owned()) };
            Ok(args.choice())
        };
        assert_eq!(choice(&[]), Ok(Choice::default()));
        let both = choice(&["--fallback", "cuda,cpu,cuda", "--fallback", "cpu", "--gpus", "all"]).expect("valid");
        assert_eq!(both.fallback, [Some(BackendChoice::Cuda), Some(BackendChoice::Cpu), None, None]);
        assert_eq!(both.gpus, Gpus::All);
        assert!(choice(&["--gpus", "0"]).expect_err("none is no number").contains("1 to 255, or all"));
        let wgpu = choice(&["--backend", "wgpu", "--fallback", "wgpu,cpu"]).expect("valid");
        assert_eq!((wgpu.backend, wgpu.fallback[0]), (BackendChoice::Wgpu, Some(BackendChoice::Wgpu)));
        assert!(choice(&["--fallback", "vulkan"]).is_err());
    }

    #[test]
    fn frames_are_a_number_or_a_range() {
        assert_eq!("12".parse(), Ok(Frames::Count(12)));
        assert_eq!("0..48".parse(), Ok(Frames::Range(0, 48)));
        for text in ["0", "-1", "3..3", "4..2", "..5", "1..", "0..1000001", "a", "1...3"] {
            assert!(text.parse::<Frames>().is_err(), "{text}");
        }
    }
}
