//! `curitiba render`: renders a picture and prints the time of each step.

use super::args::{Frames, RenderArgs};
use super::display::Display;
use super::inspect::Inspector;
use super::progress::Bars;
use super::render_output::{check_extension, default_output, print_header};
use super::{Failure, failure, print_warnings, render_path, say_prose, set_threads, table, tell_fastest};
use curitiba::bench::case::fidelity_name;
use curitiba::environment::{Environment, peak_memory};
use curitiba::pipeline::diagnostic::{Decision, WarningGroup};
use curitiba::pipeline::executor::{AccumulatedPass, Fallback, Goal, RenderError, Renderer, Row, Written};
use curitiba::pipeline::files::{check_outputs, record_files_read};
use curitiba::pipeline::memory::mebibytes;
use curitiba::trace_events;
use serde::Serialize;
use std::path::Path;

/// Renders, writes the pictures and prints the table or the JSON report.
pub fn run(args: &RenderArgs) -> Result<(), Failure> {
    if let Some(path) = &args.camera_path {
        return render_path::run(args, path);
    }
    let frames = match args.frames {
        None => 1,
        Some(Frames::Count(frames)) => frames,
        Some(Frames::Range(from, to)) => {
            let message =
                format!("--frames {from}..{to}: frames have numbers with --path; without it, write --frames N");
            return Err(Failure::Usage(message));
        }
    };
    check_samples(args)?;
    set_threads(args.project.threads)?;
    tell_fastest(args.choice());
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.project.path));
    check_extension(&output)?;
    let trace = args.trace.as_deref().map(|path| (path, "trace"));
    check_outputs([(&*output, "window")].into_iter().chain(trace))?;
    // No file that the project consists of may be replaced.
    record_files_read();
    let mut inspector = Inspector::new(Bars::default(), args.pixel, args.check_numerics);
    let project = args.project.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let display = args.display.as_ref().map(|address| Display::connect(address, project)).transpose()?;
    let settings = args.project.settings();
    let may_fall_back = !args.fallback.is_empty();
    let mut renderer = curitiba::open(&args.project.path, settings, args.choice(), &mut inspector)
        .map_err(|error| Failure::of_rendering(error, may_fall_back))?;
    failure::print_warnings_of(&renderer.plan().project.problems);
    print_warnings(renderer.warnings());
    let outputs = renderer.outputs(&output);
    check_outputs(outputs.iter().map(|(path, what)| (&**path, &**what)).chain(trace))?;
    if !args.json {
        print_header(&renderer);
    }
    if args.pixel.is_some() || args.check_numerics {
        inspector.check_pixel(renderer.plan().window)?;
        if renderer.plan().in_parts() {
            return Err(Failure::Usage(
                "--pixel and --check-numerics look at whole pictures; leave --crop and --bands out, and raise --max-memory \
                 if the picture does not fit"
                    .to_owned(),
            ));
        }
        renderer.read_back_everything();
    }
    if let Some(display) = display {
        if renderer.plan().in_parts() {
            let message = "--display shows whole pictures, and this one is rendered in bands; raise --max-memory";
            return Err(Failure::Usage(message.to_owned()));
        }
        inspector.show_on(display.of(renderer.plan().display.space));
        renderer.read_back_everything();
    }
    for _ in 1..frames {
        let frame = match args.accumulate {
            Some(_) => renderer.draw_frame(&mut inspector),
            None => renderer.draw_frame_for(&output, &mut inspector),
        };
        frame.map_err(|error| Failure::of_rendering(error, may_fall_back))?;
        inspector.print_pixel()?;
    }
    let accumulation = args.accumulate.map(|goal| accumulate(&mut renderer, goal, &mut inspector)).transpose();
    let accumulation = accumulation.map_err(|error| Failure::of_rendering(error, may_fall_back))?.unwrap_or_default();
    let saved = match args.accumulate {
        Some(_) => renderer.save_checked(&output, &mut inspector).map_err(RenderError::from),
        None => renderer.render_and_save(&output, &mut inspector),
    };
    let saved = saved.map_err(|error| Failure::of_rendering(error, may_fall_back))?;
    inspector.print_pixel()?;
    let (files, bad) = (saved.files, saved.not_finite);
    if bad > 0 {
        failure::print_warning(&format!(
            "{bad} pixels of the picture are not finite numbers; they are written as 0 to .png"
        ));
    }
    if saved.is_blank {
        failure::print_warning(
            "all pixels of the picture have one colour: the camera sees nothing, or nothing writes what is shown; `curitiba plan` \
             names the cameras and what each pass reads and writes, --camera, --look-from and --look-at choose what is seen, \
             and --show all writes every target",
        );
    }
    if let Some((path, _)) = trace {
        trace_events::write(path, renderer.timeline(), renderer.engines()).map_err(Failure::work)?;
    }
    if args.json {
        print_json(&renderer, frames, &accumulation, &files)?;
    } else {
        table::print(renderer.timeline(), frames);
        for Accumulated { pass, samples, batches, error, largest } in &accumulation {
            let error = error.zip(*largest).map_or("unknown after one batch".to_owned(), |(error, largest)| {
                format!("{error:.6} (root mean square; largest {largest:.6})")
            });
            crate::say!("{pass}: {samples} samples in {batches} batches, standard error {error}");
        }
        if let Some(peak) = peak_memory() {
            crate::say!("peak memory {}", mebibytes(peak));
        }
        for file in &files {
            crate::say!("wrote {} ({})", file.path.display(), file.what);
            if let Some(legend) = &file.legend {
                say_prose(&format!("  {legend}"), 2);
            }
        }
        if let Some((path, what)) = trace {
            crate::say!("wrote {} ({what})", path.display());
        }
    }
    inspector.verdict(args.json)
}

/// Fails if `--aa` asks for several samples a pixel and another option needs a single one.
fn check_samples(args: &RenderArgs) -> Result<(), Failure> {
    let samples = args.project.aa;
    let refused = |option: &str, help: &str| Err(Failure::Usage(format!("{option} with --aa {samples}: {help}")));
    match samples.are_several() {
        true if args.accumulate.is_some() => refused(
            "--accumulate",
            "samples are accumulated at one place of every pixel; leave it out: samples of passes go on from one sample of a pixel to the \
             next, and --set PASS.samples=N says how many each takes",
        ),
        true if args.pixel.is_some() => {
            refused("--pixel", "it prints the rays of one sample of a pixel; leave --aa out")
        }
        _ => Ok(()),
    }
}

/// Accumulated samples of a pass, for the report.
#[derive(Serialize)]
struct Accumulated {
    pass: String,
    /// Number of samples per point.
    samples: u64,
    batches: u32,
    /// Root mean square of the finite standard errors of pixels; `None` after one batch, or if none is finite.
    error: Option<f64>,
    /// Largest of the finite standard errors of pixels; `None` after one batch.
    largest: Option<f64>,
}

/// Accumulates samples; prints a warning if the goal was not reached or there is nothing to accumulate.
fn accumulate(renderer: &mut Renderer, goal: Goal, inspector: &mut Inspector) -> Result<Vec<Accumulated>, RenderError> {
    let accumulation = renderer.accumulate(goal, inspector)?;
    if accumulation.passes().is_empty() {
        failure::print_warning("no pass takes samples: --accumulate renders the picture once");
    }
    if let Goal::Error(wanted) = goal
        && !accumulation.passes().is_empty()
    {
        let (error, samples) = (accumulation.error(), accumulation.samples());
        if error.is_nan() {
            failure::print_warning(
                "no pixel has a finite standard error, so the error that was asked for says nothing",
            );
        } else if error > wanted {
            failure::print_warning(&format!(
                "a standard error of {error:.6} is left after {samples} samples, the most"
            ));
        }
    }
    let told = |pass: &AccumulatedPass| {
        let errors = pass.standard_error();
        let finite = errors.pixels.iter().flat_map(|pixel| &pixel[..3]).filter(|error| error.is_finite());
        let largest = finite.fold(0.0_f32, |a, b| a.max(*b));
        let known = |value: f64| (pass.estimate().batches() > 1 && value.is_finite()).then_some(value);
        Accumulated {
            pass: pass.name.clone(),
            samples: pass.estimate().samples(),
            batches: pass.estimate().batches(),
            error: known(pass.error()),
            largest: known(largest.into()),
        }
    };
    Ok(accumulation.passes().iter().map(told).collect())
}

#[derive(Serialize)]
struct Report<'a> {
    project: &'a Path,
    pipeline: &'a str,
    window: [u32; 2],
    fidelity: &'static str,
    seed: u32,
    samples_a_pixel: u32,
    frames: u32,
    environment: Environment,
    raster: Engine,
    rays: Engine,
    fallbacks: &'a [Fallback],
    accumulated: &'a [Accumulated],
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

fn print_json(renderer: &Renderer, frames: u32, accumulated: &[Accumulated], files: &[Written]) -> Result<(), Failure> {
    let plan = renderer.plan();
    let engines = renderer.engines();
    let step = |row| Step { row, median_ms: Row::median_ms(row), mrays_per_second: Row::mrays_per_second(row) };
    let report = Report {
        project: &plan.project.path,
        pipeline: &plan.project.pipelines[plan.pipeline].name,
        window: plan.window,
        fidelity: fidelity_name(renderer.plan().settings.fidelity),
        seed: plan.settings.seed,
        samples_a_pixel: plan.settings.aa.count(),
        frames,
        environment: Environment::here().with_engines(engines),
        raster: Engine { name: engines.raster.name(), device: engines.raster.device() },
        rays: Engine { name: engines.rays.name(), device: engines.rays.device() },
        fallbacks: renderer.fallbacks(),
        accumulated,
        steps: renderer.timeline().rows.iter().map(step).collect(),
        decisions: renderer.decisions(),
        warnings: renderer.warnings().groups().iter().map(WarningGroup::to_string).collect(),
        files,
        peak_memory_bytes: peak_memory(),
    };
    crate::say!("{}", serde_json::to_string_pretty(&report).map_err(Failure::work)?);
    Ok(())
}
