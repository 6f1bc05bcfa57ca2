//! The arguments of the command line; help and completions come from here.

use clap::{Args, Parser, Subcommand, ValueEnum, ValueHint};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::programs::Fidelity;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::path::PathBuf;

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
  curitiba render xml_projects/SceneSSAO.xml --set pass2.samples=16 --size 512x512 -o ao.exr
  curitiba plan xml_projects/SceneReflect.xml
  curitiba scene --generate 100000 -o square/

Exit codes: 0 done; 1 the work failed; 2 the command line is wrong; 3 a project or scene file is wrong."
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a project and print what each step took.
    #[command(after_help = "\
Examples:
  curitiba render xml_projects/SceneFinal.xml -o final.png
  curitiba render xml_projects/SceneFinal.xml --camera Vidro --fidelity thesis
  curitiba render xml_projects/SceneShadows.xml --show pos --show norm -o out.png
  curitiba render xml_projects/SceneFinal.xml --set pass2.samples=49 --set pass2.sampler=strata
  curitiba render xml_projects/SceneSSAO.xml --frames 10 --json")]
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
    /// Describe scene files, convert them, or generate the square.
    #[command(after_help = "\
Examples:
  curitiba scene model.obj
  curitiba scene a.obj b.obj -o largoCamoes.cbo
  curitiba scene model.glb -o model.nbo
  curitiba scene --generate 1000000 -o square/")]
    Scene(SceneArgs),
    /// Print completions for a shell.
    #[command(after_help = "Example:\n  curitiba completions bash > /etc/bash_completion.d/curitiba")]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub project: ProjectArgs,
    /// The picture, .png or .exr [default: the project's name with .png, in this folder]
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub output: Option<PathBuf>,
    /// Frames to render; the table shows the median of their times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub frames: u32,
    /// Print the report as JSON, with every sample
    #[arg(long)]
    pub json: bool,
}

/// A project and what is asked of it.
#[derive(Debug, Args)]
pub struct ProjectArgs {
    /// The project file
    #[arg(value_name = "PROJECT.xml", value_hint = ValueHint::FilePath)]
    pub path: PathBuf,
    /// Window size; render targets scale with it [default: the project's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Camera of every pass [default: each pass's own]
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Pipeline to run [default: the project's]
    #[arg(long, value_name = "NAME")]
    pub pipeline: Option<String>,
    /// Rasteriser; auto takes a real GPU if there is one, else the cpu
    #[arg(long, value_enum, default_value_t = Raster::Auto)]
    pub raster: Raster,
    /// Ray backend; auto takes the cpu, cuda and optix need an NVIDIA GPU and a build with the feature `cuda`
    #[arg(long, value_enum, default_value_t = Backend::Auto)]
    pub backend: Backend,
    /// The report's programs with their defects mended, or as they were written
    #[arg(long, value_enum, default_value_t = FidelityArg::Corrected)]
    pub fidelity: FidelityArg,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// Also write a texture of a render target, as .exr and made visible as .png; `all` writes every one
    #[arg(long, value_name = "TARGET")]
    pub show: Vec<String>,
    /// Set a parameter of a ray pass; `curitiba list` names them
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    pub set: Vec<String>,
    /// Threads of the cpu engines [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Most memory that scenes and targets may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

/// Arguments of `scene`.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// Scene files (.cbo, .nbo, .obj, .gltf, .glb); several are merged
    #[arg(value_name = "FILE", value_hint = ValueHint::FilePath, required_unless_present = "generate")]
    pub files: Vec<PathBuf>,
    /// Generate the stand-in square with about this many triangles (10 000 to 10 000 000)
    #[arg(long, value_name = "TRIANGLES", conflicts_with = "files", requires = "output",
          value_parser = clap::value_parser!(u32).range(10_000..=10_000_000))]
    pub generate: Option<u32>,
    /// Write the scene here: .cbo (2014 layout), .nbo (today's), or a folder for --generate
    #[arg(short, long, value_name = "PATH", value_hint = ValueHint::AnyPath)]
    pub output: Option<PathBuf>,
    /// Print the description as JSON
    #[arg(long)]
    pub json: bool,
    /// Most memory that the scene may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

/// `--raster`.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Raster {
    Auto,
    Cpu,
    Wgpu,
}

/// `--backend`.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Backend {
    Auto,
    Cpu,
    Cuda,
    Optix,
}

/// `--fidelity`.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum FidelityArg {
    Corrected,
    Thesis,
}

impl ProjectArgs {
    /// What the plan is made from.
    pub fn settings(&self) -> Settings {
        Settings {
            pipeline: self.pipeline.clone(),
            camera: self.camera.clone(),
            size: self.size,
            fidelity: match self.fidelity {
                FidelityArg::Corrected => Fidelity::Corrected,
                FidelityArg::Thesis => Fidelity::Thesis,
            },
            seed: self.seed,
            show: self.show.clone(),
            set: self.set.clone(),
            max_memory: self.max_memory,
        }
    }

    /// Which engines.
    pub fn choice(&self) -> Choice {
        Choice {
            raster: match self.raster {
                Raster::Auto => RasterChoice::Auto,
                Raster::Cpu => RasterChoice::Cpu,
                Raster::Wgpu => RasterChoice::Wgpu,
            },
            backend: match self.backend {
                Backend::Auto => BackendChoice::Auto,
                Backend::Cpu => BackendChoice::Cpu,
                Backend::Cuda => BackendChoice::Cuda,
                Backend::Optix => BackendChoice::Optix,
            },
        }
    }
}

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let wrong = || format!("`{text}` is not WIDTHxHEIGHT, such as 1024x1024");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    Ok([width.trim().parse().map_err(|_| wrong())?, height.trim().parse().map_err(|_| wrong())?])
}

fn parse_bytes(text: &str) -> Result<u64, String> {
    let wrong = || format!("`{text}` is not a number of bytes, such as 512MiB or 8GiB");
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let shift = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 0,
        "k" | "kib" => 10,
        "m" | "mib" => 20,
        "g" | "gib" => 30,
        _ => return Err(wrong()),
    };
    let number: u64 = number.parse().map_err(|_| wrong())?;
    number.checked_mul(1 << shift).ok_or_else(wrong)
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
    fn sizes_and_bytes_are_read_with_their_units() {
        assert_eq!(parse_size("640x480"), Ok([640, 480]));
        assert!(parse_size("640").is_err() && parse_size("axb").is_err() && parse_size("-1x2").is_err());
        assert_eq!(parse_bytes("512MiB"), Ok(512 << 20));
        assert_eq!(parse_bytes("1000"), Ok(1000));
        assert!(parse_bytes("8 parsecs").is_err() && parse_bytes("99999999999GiB").is_err());
    }
}
