//! `curitiba render --path`: renders the frames of a moving camera.

use super::args::{Frames, RenderArgs};
use super::bench_parts::shard;
use super::progress::Bars;
use super::render_output::{check_extension, default_output, print_header};
use super::{Failure, failure, print_warnings, set_threads, tell_fastest};
use curitiba::camera_path::{CameraPath, FrameRecord, Origin, PathError, RecordError, mean_and_p99};
use curitiba::environment::Environment;
use curitiba::pipeline::executor::Renderer;
use curitiba::pipeline::files::{check_outputs, record_files_read};
use curitiba::pipeline::project::{PassKind, Pose};
use serde::Serialize;
use std::path::{Path, PathBuf};

impl From<PathError> for Failure {
    fn from(error: PathError) -> Self {
        match error {
            PathError::File(message) => Self::Input(message),
            error => Self::Usage(error.to_string()),
        }
    }
}

impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Broken { .. } | RecordError::Other { .. } => Self::Usage(error.to_string()),
            _ => Self::work(error),
        }
    }
}

/// A frame in the table.
#[derive(Serialize)]
struct Told {
    #[serde(flatten)]
    record: FrameRecord,
    /// Whether the frame existed already.
    found: bool,
}

/// Mean times of one machine.
#[derive(Serialize)]
struct Times {
    machine: String,
    frames: usize,
    mean_ms: f64,
    p99_ms: f64,
}

/// Names of the frames' files.
struct Names {
    output: PathBuf,
    digits: usize,
}

impl Names {
    /// `out.png` with the frame's number before its extension: `out.0007.png`.
    fn picture(&self, frame: u32) -> PathBuf {
        let extension = self.output.extension().unwrap_or_default().to_string_lossy();
        self.output.with_extension(format!("{frame:0digits$}.{extension}", digits = self.digits))
    }

    fn record(&self, frame: u32) -> PathBuf {
        self.picture(frame).with_extension("json")
    }
}

/// Renders the frames of a shard that do not exist yet, and prints the times of each.
pub(super) fn run(args: &RenderArgs, named: &str) -> Result<(), Failure> {
    let path = CameraPath::open(named)?;
    let shard = shard(args.shard)?;
    let range = range(args.frames, path.frames())?;
    let frames: Vec<u32> = range.filter(|frame| shard.has(*frame as usize)).collect();
    set_threads(args.project.threads)?;
    tell_fastest(args.choice());
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.project.path));
    check_extension(&output)?;
    let names = Names { output, digits: (path.frames() - 1).to_string().len().max(4) };
    if let Some(first) = frames.first() {
        check_outputs([(&*names.picture(*first), "frame"), (&*names.record(*first), "its record")])?;
    }
    // No file that the project consists of may be replaced.
    record_files_read();
    let mut bars = Bars::default();
    let (settings, may_fall_back) = (args.project.settings(), !args.fallback.is_empty());
    let mut renderer = curitiba::open(&args.project.path, settings, args.choice(), &mut bars)
        .map_err(|error| Failure::of_rendering(error, may_fall_back))?;
    failure::print_warnings_of(&renderer.plan().project.problems);
    print_warnings(renderer.warnings());
    let camera = moved_camera(&renderer, &path)?;
    if !args.json {
        print_header(&renderer);
        crate::say!("{:>7}  {:>10}  {:>10}  {:>10}  {:>12}  file", "frame", "ms", "rays ms", "write ms", "rays");
    }
    let told = render(args, &mut renderer, &path, &camera, &names, &frames)?;
    let times = times(&told);
    if args.json {
        return print_json(&renderer, &told, &times);
    }
    for Times { machine, frames, mean_ms, p99_ms } in &times {
        crate::say!("{frames} frames: mean {mean_ms:.2} ms, p99 {p99_ms:.2} ms ({machine})");
    }
    let found = told.iter().filter(|frame| frame.found).count();
    crate::say!("shard {shard}: {} of {} frames, {found} of them were there", told.len(), path.frames());
    let film = names.output.with_extension("mp4");
    if told.len() == path.frames() as usize && names.picture(0).extension().is_some_and(|e| e == "png") {
        let pattern = names.output.with_extension(format!("%0{}d.png", names.digits));
        crate::say!("a film of them: ffmpeg -framerate 24 -i {} {}", pattern.display(), film.display());
    }
    Ok(())
}

/// The requested range of frames.
fn range(frames: Option<Frames>, of: u32) -> Result<std::ops::Range<u32>, Failure> {
    match frames {
        None => Ok(0..of),
        Some(Frames::Range(from, to)) if to <= of => Ok(from..to),
        Some(Frames::Range(from, to)) => Err(Failure::Usage(format!(
            "--frames {from}..{to}: the path has the frames 0 to {}; valid: A..B with B up to {of}",
            of - 1
        ))),
        Some(Frames::Count(count)) => Err(Failure::Usage(format!(
            "--frames {count}: of a path, write --frames A..B, from A up to and without B; without it all {of} are rendered"
        ))),
    }
}

/// Name of the camera that the path moves: given by --camera or the path, otherwise the camera of all passes.
fn moved_camera(renderer: &Renderer, path: &CameraPath) -> Result<String, Failure> {
    let plan = renderer.plan();
    let project = &plan.project;
    let of_pass = |kind: &PassKind| match kind {
        PassKind::Raster(raster) => Some(raster.camera),
        PassKind::Ray(ray) => Some(ray.camera),
        PassKind::Effect(effect) => Some(effect.camera),
        PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => None,
    };
    let mut cameras: Vec<usize> = match &plan.settings.camera {
        Some(name) => vec![project.camera(name).map_err(Failure::Usage)?],
        None => plan.passes.iter().filter_map(|planned| of_pass(&plan.pass(planned).kind)).collect(),
    };
    cameras.sort_unstable();
    cameras.dedup();
    let names =
        || cameras.iter().map(|camera| format!("`{}`", project.cameras[*camera].name)).collect::<Vec<_>>().join(", ");
    let moved = match path.camera() {
        Some(name) => {
            let moved = project.camera(name).map_err(Failure::Usage)?;
            if !cameras.contains(&moved) {
                return Err(Failure::Usage(format!(
                    "the path moves camera `{name}`, and no pass sees through it; passes see through {}",
                    names()
                )));
            }
            moved
        }
        None => match cameras[..] {
            [camera] => camera,
            [] => {
                return Err(Failure::Usage(
                    "no pass of this pipeline sees through a camera: there is nothing to move".to_owned(),
                ));
            }
            _ => {
                return Err(Failure::Usage(format!(
                    "passes see through {}: --camera NAME gives all passes the one that is moved, or the path's file names it",
                    names()
                )));
            }
        },
    };
    Ok(project.cameras[moved].name.clone())
}

/// Renders the missing frames, and prints a line for each frame.
fn render(
    args: &RenderArgs,
    renderer: &mut Renderer,
    path: &CameraPath,
    camera: &str,
    names: &Names,
    frames: &[u32],
) -> Result<Vec<Told>, Failure> {
    let own: Pose = renderer.project().pose(camera).map_err(Failure::Usage)?;
    let origin = Origin::of(renderer, args.choice());
    let (mut blank, mut bad) = (0, 0);
    let mut told = Vec::new();
    for frame in frames.iter().copied() {
        let (picture, record_file) = (names.picture(frame), names.record(frame));
        let pose = path.pose(frame, own);
        let origin = origin.with_pose(pose);
        let outputs: Vec<PathBuf> = renderer.outputs(&picture).into_iter().map(|(path, _)| path).collect();
        let found = if args.overwrite { None } else { FrameRecord::find(&record_file, &origin, &outputs)? };
        let frame = match found {
            Some(record) => Told { record, found: true },
            None => {
                let wrong = |error| Failure::Usage(format!("frame {frame}: {error}"));
                renderer.set_pose(camera, pose).map_err(wrong)?;
                check_outputs(outputs.iter().map(|path| (&**path, "frame")))?;
                renderer.forget_frames();
                let saved = renderer.render_and_save(&picture, &mut Bars::default());
                let saved = saved.map_err(|error| Failure::of_rendering(error, !args.fallback.is_empty()))?;
                blank += usize::from(saved.is_blank);
                bad += saved.not_finite;
                let record = FrameRecord::new(frame, origin, renderer, &saved.files);
                record.write(&record_file)?;
                Told { record, found: false }
            }
        };
        if !args.json {
            print_frame(&frame, &picture);
        }
        told.push(frame);
    }
    if bad > 0 {
        failure::print_warning(&format!(
            "{bad} pixels of the frames are not finite numbers; they are written as 0 to .png"
        ));
    }
    if blank > 0 {
        failure::print_warning(&format!("{blank} frames have one colour: the camera sees nothing there"));
    }
    Ok(told)
}

fn print_frame(Told { record, found }: &Told, picture: &Path) {
    let note = if *found { " (was there)" } else { "" };
    crate::say!(
        "{:>7}  {:>10.2}  {:>10.2}  {:>10.2}  {:>12}  {}{note}",
        record.frame,
        record.ms,
        record.ray_ms,
        record.write_ms,
        record.rays,
        picture.display()
    );
}

/// Mean times of each machine; times of different machines are not averaged.
fn times(told: &[Told]) -> Vec<Times> {
    let mut machines: Vec<&str> = told.iter().map(|frame| frame.record.machine.as_str()).collect();
    machines.sort_unstable();
    machines.dedup();
    let of = |machine: &str| {
        let same = told.iter().filter(|frame| frame.record.machine == machine);
        let times: Vec<f64> = same.map(|frame| frame.record.ms).collect();
        let (mean_ms, p99_ms) = mean_and_p99(&times)?;
        Some(Times { machine: machine.to_owned(), frames: times.len(), mean_ms, p99_ms })
    };
    machines.into_iter().filter_map(of).collect()
}

fn print_json(renderer: &Renderer, frames: &[Told], machines: &[Times]) -> Result<(), Failure> {
    #[derive(Serialize)]
    struct Report<'a> {
        project: &'a Path,
        window: [u32; 2],
        environment: Environment,
        frames: &'a [Told],
        machines: &'a [Times],
    }
    let plan = renderer.plan();
    let environment = Environment::here().with_engines(renderer.engines());
    let report = Report { project: &plan.project.path, window: plan.window, environment, frames, machines };
    crate::say!("{}", serde_json::to_string_pretty(&report).map_err(Failure::work)?);
    Ok(())
}
