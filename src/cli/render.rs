//! `curitiba render`: a picture, and what each step took.

use super::args::RenderArgs;
use super::inspect::Inspector;
use super::progress::Bars;
use super::{Failure, failure, print_warnings, set_threads, table};
use curitiba::environment::{Environment, peak_memory};
use curitiba::pipeline::diagnostic::WarningGroup;
use curitiba::pipeline::executor::{Fallback, Renderer, Row, Written};
use curitiba::pipeline::plan::{Decision, mebibytes};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Renders, writes the pictures and prints the table or the JSON report.
pub fn run(args: &RenderArgs) -> Result<(), Failure> {
    set_threads(args.project.threads)?;
    if args.project.path.is_dir() {
        return Err(Failure::Usage(format!(
            "{}: this is a folder; name a project file in it",
            args.project.path.display()
        )));
    }
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.project.path));
    check_output(&output)?;
    let mut inspector = Inspector::new(Bars::default(), args.pixel, args.check_numerics);
    let settings = args.project.settings();
    let may_fall_back = !args.fallback.is_empty();
    let mut renderer = curitiba::open(&args.project.path, settings, args.choice(), &mut inspector)
        .map_err(|error| Failure::of_rendering(error, may_fall_back))?;
    failure::print_warnings_of(&renderer.plan().project.problems);
    print_warnings(renderer.warnings());
    if !args.json {
        print_header(&renderer);
    }
    if args.pixel.is_some() || args.check_numerics {
        inspector.check_pixel(renderer.plan().window)?;
        renderer.read_back_everything();
    }
    let mut picture = renderer.window_image();
    for _ in 0..args.frames {
        let frame = renderer.frame(&mut inspector);
        picture = frame.map_err(|error| Failure::of_rendering(error, may_fall_back))?;
        inspector.print_pixel()?;
    }
    let bad = picture.count_non_finite();
    if bad > 0 {
        failure::print_warning(&format!(
            "{bad} pixels of the picture are not finite numbers; they are written as 0 to .png"
        ));
    }
    let files = renderer.save(&output, &mut inspector).map_err(Failure::work)?;
    if args.json {
        print_json(&renderer, args.frames, &files)?;
    } else {
        table::print(renderer.timeline(), args.frames);
        if let Some(peak) = peak_memory() {
            crate::say!("peak memory {}", mebibytes(peak));
        }
        for file in &files {
            crate::say!("wrote {} ({})", file.path.display(), file.what);
        }
    }
    inspector.verdict(args.json)
}

fn default_output(project: &Path) -> PathBuf {
    PathBuf::from(project.file_stem().unwrap_or(project.as_os_str())).with_extension("png")
}

/// Found out before the work, not after it.
pub(super) fn check_output(output: &Path) -> Result<(), Failure> {
    let extension = output.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
    if !matches!(extension.as_str(), "png" | "exr") {
        return Err(Failure::Usage(format!("{}: a picture is written as .png or .exr", output.display())));
    }
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return Err(Failure::Usage(format!("there is no folder {}", folder.display())));
    }
    if output.is_dir() {
        return Err(Failure::Usage(format!("{}: this is a folder; a picture needs a file name", output.display())));
    }
    let writable = tempfile::Builder::new().prefix(".curitiba-").tempfile_in(folder);
    writable.map(drop).map_err(|error| {
        Failure::Work(format!("nothing can be written into the folder {}: {}", folder.display(), error.kind()))
    })
}

fn print_header(renderer: &Renderer) {
    let plan = renderer.plan();
    let environment = Environment::here();
    let engines = renderer.engines();
    let [width, height] = plan.window;
    crate::say!(
        "{}: pipeline `{}`, {width} x {height}, {}, seed {}",
        plan.project.path.display(),
        plan.project.pipelines[plan.pipeline].name,
        fidelity(renderer),
        plan.settings.seed
    );
    crate::say!("raster {}: {}", engines.raster.name(), engines.raster.device());
    crate::say!("rays   {}: {}", engines.rays.name(), engines.rays.device());
    crate::say!("{}, {} threads, {} build", environment.cpu, environment.threads, environment.profile);
}

fn fidelity(renderer: &Renderer) -> &'static str {
    match renderer.plan().settings.fidelity {
        curitiba::pipeline::programs::Fidelity::Corrected => "corrected",
        curitiba::pipeline::programs::Fidelity::Thesis => "thesis",
    }
}

#[derive(Serialize)]
struct Report<'a> {
    project: &'a Path,
    pipeline: &'a str,
    window: [u32; 2],
    fidelity: &'static str,
    seed: u32,
    frames: u32,
    environment: Environment,
    raster: Engine,
    rays: Engine,
    fallbacks: &'a [Fallback],
    steps: Vec<Step<'a>>,
    decisions: &'a [Decision],
    warnings: Vec<String>,
    files: &'a [Written],
    peak_memory_bytes: Option<u64>,
}

#[derive(Serialize)]
struct Engine {
    name: &'static str,
    device: String,
}

#[derive(Serialize)]
struct Step<'a> {
    #[serde(flatten)]
    row: &'a Row,
    median_ms: f64,
    mrays_per_second: Option<f64>,
}

fn print_json(renderer: &Renderer, frames: u32, files: &[Written]) -> Result<(), Failure> {
    let plan = renderer.plan();
    let engines = renderer.engines();
    let step = |row| Step { row, median_ms: Row::median_ms(row), mrays_per_second: Row::mrays_per_second(row) };
    let report = Report {
        project: &plan.project.path,
        pipeline: &plan.project.pipelines[plan.pipeline].name,
        window: plan.window,
        fidelity: fidelity(renderer),
        seed: plan.settings.seed,
        frames,
        environment: Environment::here().with_engines(engines),
        raster: Engine { name: engines.raster.name(), device: engines.raster.device() },
        rays: Engine { name: engines.rays.name(), device: engines.rays.device() },
        fallbacks: renderer.fallbacks(),
        steps: renderer.timeline().rows.iter().map(step).collect(),
        decisions: renderer.decisions(),
        warnings: renderer.warnings().groups().iter().map(WarningGroup::to_string).collect(),
        files,
        peak_memory_bytes: peak_memory(),
    };
    crate::say!("{}", serde_json::to_string_pretty(&report).map_err(Failure::work)?);
    Ok(())
}
