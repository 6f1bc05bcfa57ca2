//! The arguments of `bench`.

use clap::{Args, ValueEnum, ValueHint};
use curitiba::args::{
    Backend, FidelityArg, MAX_MEMORY, ProjectArgs, Raster, SceneFlags, parse_bytes, parse_size, quoted,
};
use curitiba::pipeline::color::{ColorSpace, Tone};
use curitiba::pipeline::pixel_samples::PixelSamples;
use curitiba::shard::{Request, Shard};
use curitiba::{Choice, Gpus};
use std::path::PathBuf;

/// Arguments of `bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Project files, one row each; or scene files or folders of them, one project each
    #[arg(value_name = "PROJECT.xml|SCENE", value_hint = ValueHint::FilePath, required_unless_present = "table2")]
    pub projects: Vec<PathBuf>,
    /// Measure the 19 rows of the report's table 2, beside its figures
    #[arg(long, conflicts_with_all = ["projects", "camera", "sweep", "pipeline"])]
    pub table2: bool,
    /// Folder of the projects of --table2
    #[arg(long = "projects", value_name = "DIR", value_hint = ValueHint::DirPath, default_value = "xml_projects")]
    pub folder: PathBuf,
    /// Window size; render targets scale with it [default: the project's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Camera of every pass; several make a row each [default: each pass's own]
    #[arg(long, value_name = "NAME")]
    pub camera: Vec<String>,
    /// Pipeline to run [default: the project's]
    #[arg(long, value_name = "NAME")]
    pub pipeline: Option<String>,
    /// Frames measured of each row
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub frames: u32,
    /// Frames rendered before them, and not counted
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(0..=1_000_000))]
    pub warmup: u32,
    /// Measure each row on each of these; what is not there is listed with the reason
    #[arg(long, value_enum, value_name = "ENGINES", value_delimiter = ',', conflicts_with = "raster")]
    pub compare: Vec<EngineArg>,
    /// Measure each row with each value of a parameter, of the first pass that reads it or of the pass named,
    /// or a texture with each format: norm.format=RGBA32F,RGBA16F
    #[arg(long, value_name = "[PASS.]NAME=A,B,…")]
    pub sweep: Option<String>,
    /// Measure time against threads instead: every step on a pool of each of these sizes, with wall time and processor time
    /// (auto takes the cpu here); no errors
    #[arg(long, value_name = "N,N,…", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..=1024),
          conflicts_with_all = ["table2", "sweep", "compare", "csv", "resume", "threads"])]
    pub sweep_threads: Vec<u16>,
    /// Rounds over all rows, or with --sweep-threads over all numbers of threads: each opens every project again and measures --frames of
    /// it, in turns, so that a while in which the machine is slow falls on all of them alike [default: 1, with --sweep-threads 3]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000), conflicts_with_all = ["parts", "list"])]
    pub rounds: Option<u32>,
    /// Folder for an SVG of the curves of each project and camera, with --sweep-threads
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, requires = "sweep_threads")]
    pub plots: Option<PathBuf>,
    /// Rasteriser; auto takes a real GPU if there is one, else the cpu
    #[arg(long, value_enum, default_value_t = Raster::Auto)]
    pub raster: Raster,
    /// Ray backend; a row that it fails for is listed with the reason, and never measured on another
    #[arg(long, value_enum, default_value_t = Backend::Auto)]
    pub backend: Backend,
    /// Device of wgpu, for rasteriser and rays: a part of its name, or its place in `curitiba list`, from 0
    #[arg(long, value_name = "NAME", value_parser = curitiba::passes::raster::gpu::named)]
    pub adapter: Option<u8>,
    /// GPUs that share the rays of cuda and optix: a number, or all
    #[arg(long, value_name = "N", default_value_t = Gpus::default())]
    pub gpus: Gpus,
    /// The report's programs with their defects mended, or as they were written; errors are against the mended ones
    #[arg(long, value_enum, default_value_t = FidelityArg::Corrected)]
    pub fidelity: FidelityArg,
    /// What colours are: used as stored (report), or decoded from sRGB and shaded as linear radiance (linear) [default: the project's]
    #[arg(long, value_name = "report|linear")]
    pub color: Option<ColorSpace>,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// Samples of every pixel, 1, 2, 4, 8, 16, 32 or 64: a frame has them all, and its error is against a reference that has them, too;
    /// 16:0.02 traces rays for fewer where shadows, occlusion and glass differ by at most 0.02, and its reference for all
    #[arg(long, value_name = "N[:TOLERANCE]", default_value_t = PixelSamples::ONE)]
    pub aa: PixelSamples,
    /// Set a parameter of a ray or effect pass, which `curitiba list` names, or a texture's format: norm.format=RGBA16F
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    pub set: Vec<String>,
    /// Write all samples and the machine here, after every row
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub json: Option<PathBuf>,
    /// Write one line a row here
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub csv: Option<PathBuf>,
    /// Write a page of tables here
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub markdown: Option<PathBuf>,
    /// Go on with the benchmark that the file of --json holds; rows that are there are not measured again
    #[arg(long, requires = "json")]
    pub resume: bool,
    /// Replace the files of --json, --csv and --markdown whatever they hold, also an interrupted benchmark
    #[arg(long, conflicts_with = "resume")]
    pub overwrite: bool,
    /// Print the rows instead of measuring them: index from 0, id, and the command that measures the row alone, with tabs between
    #[arg(long, conflicts_with_all = ["sweep_threads", "json", "csv", "markdown", "resume", "overwrite"])]
    pub list: bool,
    /// Measure every N-th row from the K-th, 1/N to N/N, for N processes with one folder of --parts; auto takes both numbers from the
    /// scheduler's variables (Slurm, Grid Engine, MPI), auto/N the first (also PBS, HyperQueue, GNU parallel): docs/cluster.md
    #[arg(long, value_name = "K/N|auto[/N]", conflicts_with = "sweep_threads")]
    pub shard: Option<Request>,
    /// Write each row into a file of its own in this folder, named by the row's id; rows that are there are not measured again, and
    /// `curitiba merge` joins them
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath,
          conflicts_with_all = ["sweep_threads", "json", "csv", "markdown", "resume", "overwrite"])]
    pub parts: Option<PathBuf>,
    /// A name for this machine in the files, so that `curitiba merge` tells it from others of equal parts; names of hosts are not recorded
    #[arg(long, value_name = "NAME", conflicts_with = "sweep_threads")]
    pub host: Option<String>,
    /// Measure times only, and no error
    #[arg(long)]
    pub no_error: bool,
    /// Folder in which references are kept [default: CURITIBA_CACHE, or curitiba/references in the user's cache folder]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub references: Option<PathBuf>,
    /// Longest time for refining one reference; rows say where it was not enough
    #[arg(long, value_name = "SECONDS", default_value_t = 120, value_parser = clap::value_parser!(u32).range(0..=1_000_000))]
    pub reference_seconds: u32,
    /// Take references of N samples (of each of two renders), however long they take, instead of refining them row by row: then a row's
    /// error depends on nothing but the row
    #[arg(long, value_name = "N", conflicts_with = "no_error",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(curitiba::reference::MOST_SAMPLES)))]
    pub reference_samples: Option<u32>,
    #[command(flatten)]
    pub scene: SceneFlags,
    /// Threads of the cpu engines [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Most memory that the program may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

/// An engine of `--compare`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum EngineArg {
    /// Rasteriser and rays on the processor
    Cpu,
    /// Rasteriser on the GPU, rays on the processor
    Wgpu,
    /// Rays on any GPU through wgpu
    WgpuRays,
    /// NVIDIA GPUs through CUDA
    Cuda,
    /// NVIDIA GPUs through OptiX
    Optix,
}

impl EngineArg {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Wgpu => "wgpu",
            Self::WgpuRays => "wgpu-rays",
            Self::Cuda => "cuda",
            Self::Optix => "optix",
        }
    }
}

impl BenchArgs {
    /// The equivalent arguments of `render` for one project.
    pub fn project(&self, path: PathBuf, camera: Option<String>) -> ProjectArgs {
        ProjectArgs {
            path,
            more: Vec::new(),
            scene: self.scene.clone(),
            size: self.size,
            camera,
            pipeline: self.pipeline.clone(),
            raster: self.raster,
            backend: self.backend,
            gpus: self.gpus,
            adapter: self.adapter,
            fidelity: self.fidelity,
            color: self.color,
            exposure: 0.0,
            tone: Tone::None,
            seed: self.seed,
            show: Vec::new(),
            set: self.set.clone(),
            off: Vec::new(),
            threads: self.threads,
            max_memory: self.max_memory,
            crop: None,
            bands: None,
            aa: self.aa,
        }
    }

    /// The choice of engines, unless --compare names some.
    pub fn choice(&self) -> Choice {
        self.project(PathBuf::new(), None).choice()
    }

    /// Number of rounds over all that is measured.
    pub fn rounds(&self) -> u32 {
        self.rounds.unwrap_or(if self.sweep_threads.is_empty() { 1 } else { 3 })
    }

    /// A canonical form of the command: all options that affect the rows, with their defaults, but no output files. Equal commands
    /// give equal rows.
    pub fn command(&self) -> String {
        self.words().join(" ")
    }

    /// The command that measures a shard of the rows, with this command's folders, threads and memory limit; quoted for a shell.
    pub fn command_of(&self, shard: Shard) -> String {
        let mut words = self.words();
        words.extend(["--shard".to_owned(), shard.to_string()]);
        let parts = self.parts.as_deref().unwrap_or("parts".as_ref());
        words.extend(["--parts".to_owned(), parts.display().to_string()]);
        words.extend(self.references.iter().flat_map(|folder| named("references", folder.display().to_string())));
        words.extend(self.threads.iter().flat_map(|threads| named("threads", threads.to_string())));
        if self.max_memory != MAX_MEMORY {
            words.extend(named("max-memory", self.max_memory.to_string()));
        }
        words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
    }

    fn words(&self) -> Vec<String> {
        let value = |value: Option<String>| value.unwrap_or_else(|| "auto".to_owned());
        let mut words = vec!["curitiba".to_owned(), "bench".to_owned()];
        if self.table2 {
            words.push("--table2".to_owned());
            words.extend(named("projects", self.folder.display().to_string()));
        }
        words.extend(self.projects.iter().map(|path| path.display().to_string()));
        if let Some([width, height]) = self.size {
            words.extend(named("size", format!("{width}x{height}")));
        }
        words.extend(self.camera.iter().flat_map(|camera| named("camera", camera.clone())));
        words.extend(self.pipeline.iter().flat_map(|pipeline| named("pipeline", pipeline.clone())));
        words.extend(named("frames", self.frames.to_string()));
        words.extend(named("warmup", self.warmup.to_string()));
        if self.compare.is_empty() {
            words.extend(named("raster", value(name_of(self.raster))));
        } else {
            let engines: Vec<&str> = self.compare.iter().map(|engine| engine.name()).collect();
            words.extend(named("compare", engines.join(",")));
        }
        // `fastest` is replaced by the backend found here, since another machine's may differ.
        words.extend(named("backend", self.choice().backend.name().to_owned()));
        // The adapter is given by name, since its index may differ on the machine that runs the command.
        words.extend(self.choice().adapter_name().into_iter().flat_map(|name| named("adapter", name.to_owned())));
        if self.gpus != Gpus::default() {
            words.extend(named("gpus", self.gpus.to_string()));
        }
        if !self.sweep_threads.is_empty() {
            let threads: Vec<String> = self.sweep_threads.iter().map(u16::to_string).collect();
            words.extend(named("sweep-threads", threads.join(",")));
        }
        if !self.sweep_threads.is_empty() || self.rounds() > 1 {
            words.extend(named("rounds", self.rounds().to_string()));
        }
        words.extend(self.sweep.iter().flat_map(|sweep| named("sweep", sweep.clone())));
        words.extend(named("fidelity", value(name_of(self.fidelity))));
        words.extend(self.color.into_iter().flat_map(|color| named("color", color.to_string())));
        words.extend(named("seed", self.seed.to_string()));
        if self.aa.are_several() {
            words.extend(named("aa", self.aa.to_string()));
        }
        words.extend(self.set.iter().flat_map(|set| named("set", set.clone())));
        words.extend(self.scene.options(&[]).given().into_iter().flat_map(|(name, value)| named(name, value)));
        match self.reference_samples {
            _ if self.no_error => words.push("--no-error".to_owned()),
            Some(samples) => words.extend(named("reference-samples", samples.to_string())),
            None => words.extend(named("reference-seconds", self.reference_seconds.to_string())),
        }
        words
    }
}

/// An option and its value as words.
fn named(name: &str, value: String) -> [String; 2] {
    [format!("--{name}"), value]
}

fn name_of(value: impl ValueEnum) -> Option<String> {
    value.to_possible_value().map(|value| value.get_name().to_owned())
}
