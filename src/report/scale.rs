//! Time against pixels, triangles, lights, samples and threads.

use super::Told;
use super::collector::{Collector, Place};
use super::folder::Folder;
use super::lights;
use super::model::{Against, Effect, Scaling, ScalingSeries};
use super::plan::{self, Entry, Stage};
use crate::BackendChoice;
use crate::bench::model::Technique;
use crate::pipeline::diagnostic::Problems;
use crate::pipeline::executor::Observer;
use crate::pipeline::files::{self, TemporaryFolder};
use crate::pipeline::project;
use crate::pipeline::square;
use std::fs;
use std::io;
use std::path::Path;
use std::time::Instant;

/// Largest project file that is copied, bytes; larger ones cannot be loaded either.
const MOST_FILE: u64 = 16 << 20;

fn empty(lines: &[Entry]) -> Vec<ScalingSeries> {
    let series = |line: &Entry| ScalingSeries {
        label: line.label.clone(),
        technique: line.technique,
        rows: Vec::new(),
        amounts: Vec::new(),
    };
    lines.iter().map(series).collect()
}

/// Measures the user's scene in windows of other sizes.
pub(super) fn by_pixels(
    collector: &mut Collector<'_>,
    sizes: &[[u32; 2]],
    told: &mut dyn FnMut(Told<'_>),
    observer: &mut dyn Observer,
) -> Scaling {
    let lines = plan::scaling_lines(&collector.request.wanted);
    let mut series = empty(&lines);
    let projects = collector.request.projects.clone();
    for size in sizes {
        let place = Place {
            projects: &projects,
            size: *size,
            triangles: None,
            lights: None,
            threads: None,
            stage: Stage::Pixels,
        };
        let name = plan::scaling_name(Against::Pixels, u64::from(size[0]) * u64::from(size[1]));
        measure_lines(collector, &lines, &mut series, &place, &name, told, observer);
    }
    Scaling { against: Against::Pixels, series }
}

/// Measures the user's scene on thread pools of different sizes, with the engines of the processor.
pub(super) fn by_threads(
    collector: &mut Collector<'_>,
    counts: &[usize],
    told: &mut dyn FnMut(Told<'_>),
    observer: &mut dyn Observer,
) -> Scaling {
    let on_cpu = |line: Entry| {
        let beside = (line.technique == Technique::Rays).then_some(BackendChoice::Cpu);
        Entry { stage: Stage::Threads, on_cpu: true, beside, ..line }
    };
    let lines: Vec<Entry> = plan::scaling_lines(&collector.request.wanted).into_iter().map(on_cpu).collect();
    let mut series = empty(&lines);
    let (projects, size) = (collector.request.projects.clone(), collector.request.wanted.size);
    for count in counts {
        let place = Place {
            projects: &projects,
            size,
            triangles: None,
            lights: None,
            threads: Some(*count),
            stage: Stage::Threads,
        };
        let name = plan::scaling_name(Against::Threads, *count as u64);
        measure_lines(collector, &lines, &mut series, &place, &name, told, observer);
    }
    Scaling { against: Against::Threads, series }
}

/// Measures the user's scene with other numbers of lights, in temporary copies of the projects.
pub(super) fn by_lights(
    collector: &mut Collector<'_>,
    folder: &Folder,
    told: &mut dyn FnMut(Told<'_>),
    observer: &mut dyn Observer,
) -> Scaling {
    let lines = plan::light_lines(&collector.request.wanted);
    let mut series = empty(&lines);
    let (projects, size) = (collector.request.projects.clone(), collector.request.wanted.size);
    for count in plan::LIGHT_COUNTS {
        let name = plan::scaling_name(Against::Lights, count.into());
        let lit: Vec<Entry> = lines.iter().map(|line| plan::lit_by(line, count)).collect();
        match copy_with_lights(&projects, folder, &lines, count) {
            Ok(copy) => {
                let (lights, stage) = (Some(count), Stage::Lights);
                let place = Place { projects: copy.path(), size, triangles: None, lights, threads: None, stage };
                measure_lines(collector, &lit, &mut series, &place, &name, told, observer);
            }
            Err(why) => collector.miss(&name, why),
        }
    }
    Scaling { against: Against::Lights, series }
}

/// Collects the measured settings of ambient occlusion and soft shadows into one line for each series. Measures nothing.
pub(super) fn by_samples(collector: &Collector<'_>) -> Scaling {
    let mut lines: Vec<(ScalingSeries, Vec<(f64, String)>)> = Vec::new();
    for effect in [Effect::Occlusion, Effect::SoftShadows] {
        for (setting, row) in collector.settings(effect) {
            let Some(samples) = samples(&row.set) else { continue };
            let label = format!("{} by {}", effect.title(), setting.series);
            let index = lines.iter().position(|(line, _)| line.label == label).unwrap_or_else(|| {
                let (technique, rows, amounts) = (row.technique, Vec::new(), Vec::new());
                lines.push((ScalingSeries { label, technique, rows, amounts }, Vec::new()));
                lines.len() - 1
            });
            lines[index].1.push((samples, row.key.clone()));
        }
    }
    let finish = |(mut line, mut points): (ScalingSeries, Vec<(f64, String)>)| {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        (line.amounts, line.rows) = points.into_iter().unzip();
        line
    };
    let series = lines.into_iter().map(finish).filter(|line| line.rows.len() > 1).collect();
    Scaling { against: Against::Samples, series }
}

/// Number of rays, or of depths read, for each point, from the parameters of a row; `None` if the parameters set neither.
fn samples(set: &[String]) -> Option<f64> {
    let number = |name: &str| {
        let of = |one: &String| one.strip_prefix("pass2.")?.strip_prefix(name)?.strip_prefix('=')?.parse::<f64>().ok();
        set.iter().find_map(of)
    };
    let depths = || Some(2.0 * number("slices")? * number("steps")?);
    number("samples").or_else(|| number("sunsamples")).or_else(depths)
}

/// Measures the generated square with other numbers of triangles, in a temporary copy of the projects.
pub(super) fn by_triangles(
    collector: &mut Collector<'_>,
    folder: &Folder,
    told: &mut dyn FnMut(Told<'_>),
    observer: &mut dyn Observer,
) -> Scaling {
    let lines: Vec<Entry> = plan::scaling_lines(&collector.request.wanted)
        .into_iter()
        .map(|line| Entry { stage: Stage::Triangles, ..line })
        .collect();
    let mut series = empty(&lines);
    // Time to generate and write the previous scene; the first value is a guess, mostly for the textures, which all scenes share.
    // A triangle is expected to add 2 microseconds; it takes about 0.7 on an idle machine.
    let mut generation_s = 0.5;
    let per_triangle_s = 2e-6;
    for triangles in collector.request.wanted.triangles.clone() {
        let name = plan::scaling_name(Against::Triangles, triangles.into());
        let room = memory_left().map_or(collector.request.max_memory, |left| left.min(collector.request.max_memory));
        if plan::peak_bytes(triangles) > room {
            let bytes = super::number::bytes;
            let why = format!(
                "left out: it needs about {}, and {} are free",
                bytes(plan::peak_bytes(triangles)),
                bytes(room)
            );
            collector.miss(&name, why);
            continue;
        }
        let start = Instant::now();
        if let Err(why) = collector.time().admit(Stage::Triangles, generation_s + per_triangle_s * f64::from(triangles))
        {
            collector.miss(&name, why);
            continue;
        }
        match copy_with_square(&collector.request.projects, folder, triangles) {
            Ok(copy) => {
                generation_s = start.elapsed().as_secs_f64();
                let size = collector.request.wanted.size;
                let (projects, triangles, stage) = (copy.path(), Some(triangles.into()), Stage::Triangles);
                let place = Place { projects, size, triangles, lights: None, threads: None, stage };
                measure_lines(collector, &lines, &mut series, &place, &name, told, observer);
            }
            Err(error) => collector.miss(&name, format!("it cannot be written: {error}")),
        }
    }
    Scaling { against: Against::Triangles, series }
}

fn measure_lines(
    collector: &mut Collector<'_>,
    lines: &[Entry],
    series: &mut [ScalingSeries],
    place: &Place<'_>,
    name: &str,
    told: &mut dyn FnMut(Told<'_>),
    observer: &mut dyn Observer,
) {
    for (line, series) in lines.iter().zip(series) {
        let shown = Entry { label: format!("{}, {name}", line.label), ..line.clone() };
        match collector.row(&shown, place, told, observer) {
            Ok((_, mut row, _)) => {
                row.label.clone_from(&line.label);
                // The folder of a copied project is temporary.
                row.project = line.file.into();
                row.error = crate::bench::model::RowError::Missing("only the time was asked for".to_owned());
                series.rows.push(row.key.clone());
                let lights = place.lights.map(f64::from);
                series.amounts.extend(lights.or(place.threads.map(|threads| threads as f64)));
                if collector.file.rows.iter().all(|other| other.key != row.key) {
                    collector.file.rows.push(row);
                }
            }
            Err(why) => collector.miss(&shown.label, why),
        }
    }
}

/// Copies the projects of the entries `lines` to a temporary folder. Each pass that has lights gets `count` of them.
fn copy_with_lights(projects: &Path, folder: &Folder, lines: &[Entry], count: u32) -> Result<TemporaryFolder, String> {
    let copy = folder.scratch().map_err(|error| format!("no copy of the projects can be made: {error}"))?;
    let mut files: Vec<&str> = lines.iter().map(|line| line.file).collect();
    files.dedup();
    for file in files {
        let from = projects.join(file);
        let named = |why: String| format!("{}: {why}", from.display());
        let mut project = project::load(&from).map_err(|problems| named(joined(&problems)))?;
        lights::shine(&mut project, count as usize).map_err(named)?;
        project.write(&copy.path().join(file)).map_err(|error| error.to_string())?;
    }
    Ok(copy)
}

fn joined(problems: &Problems) -> String {
    problems.0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

/// Copies project files and material libraries into a temporary folder, with a generated square instead of the scene.
fn copy_with_square(projects: &Path, folder: &Folder, triangles: u32) -> io::Result<TemporaryFolder> {
    let copy = folder.scratch()?;
    copy_files(projects, copy.path(), "xml")?;
    for sub in ["raster", "mlibs"] {
        if projects.join(sub).is_dir() {
            files::create_folder(&copy.path().join(sub))?;
            copy_files(&projects.join(sub), &copy.path().join(sub), if sub == "mlibs" { "mlib" } else { "xml" })?;
        }
    }
    square::generate(triangles).write(&copy.path().join("3dsmodels")).map_err(io::Error::other)?;
    Ok(copy)
}

fn copy_files(from: &Path, to: &Path, extension: &str) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let path = entry?.path();
        let wanted = path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension));
        if let (true, Some(name)) = (wanted && path.is_file(), path.file_name()) {
            files::write_atomically(&to.join(name), &files::read(&path, MOST_FILE)?)?;
        }
    }
    Ok(())
}

/// Memory in bytes that is available without swapping; `None` if the system does not report it.
pub(super) fn memory_left() -> Option<u64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kibibytes: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kibibytes * 1024)
}
