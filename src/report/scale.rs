//! Time against pixels and against triangles.

use super::Told;
use super::collector::{Collector, Place};
use super::folder::Folder;
use super::model::{Against, Scaling, ScalingSeries};
use super::plan::{self, Entry, Stage};
use crate::pipeline::executor::Observer;
use crate::pipeline::files::{self, TemporaryFolder};
use crate::pipeline::square;
use std::fs;
use std::io;
use std::path::Path;
use std::time::Instant;

/// Largest project file that is copied, bytes: no larger one is loaded.
const MOST_FILE: u64 = 16 << 20;

fn empty(lines: &[Entry]) -> Vec<ScalingSeries> {
    let series =
        |line: &Entry| ScalingSeries { label: line.label.clone(), technique: line.technique, rows: Vec::new() };
    lines.iter().map(series).collect()
}

/// The user's scene in windows of other sizes.
pub(super) fn by_pixels(
    collector: &mut Collector<'_>,
    sizes: &[[u32; 2]],
    told: &mut dyn FnMut(Told<'_>),
    observer: &mut dyn Observer,
) -> Scaling {
    let lines = plan::scaling_lines();
    let mut series = empty(&lines);
    let projects = collector.request.projects.clone();
    for size in sizes {
        let place = Place { projects: &projects, size: *size, triangles: None, stage: Stage::Pixels };
        let name = plan::scaling_name(Against::Pixels, u64::from(size[0]) * u64::from(size[1]));
        measure_lines(collector, &lines, &mut series, &place, &name, told, observer);
    }
    Scaling { against: Against::Pixels, series }
}

/// The generated square at other densities, in a temporary copy of the projects.
pub(super) fn by_triangles(
    collector: &mut Collector<'_>,
    folder: &Folder,
    told: &mut dyn FnMut(Told<'_>),
    observer: &mut dyn Observer,
) -> Scaling {
    let lines: Vec<Entry> =
        plan::scaling_lines().into_iter().map(|line| Entry { stage: Stage::Triangles, ..line }).collect();
    let mut series = empty(&lines);
    // What the last scene took to generate and write: its textures, the same for all, take most of it at first. A
    // triangle takes about 0.7 microseconds on an idle machine.
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
                let place =
                    Place { projects: copy.path(), size, triangles: Some(triangles.into()), stage: Stage::Triangles };
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
                // The copy's folder is temporary, and means nothing to a reader.
                row.project = line.file.into();
                row.error = crate::bench::model::RowError::Missing("only the time was asked for".to_owned());
                series.rows.push(row.key.clone());
                if collector.file.rows.iter().all(|other| other.key != row.key) {
                    collector.file.rows.push(row);
                }
            }
            Err(why) => collector.miss(&shown.label, why),
        }
    }
}

/// Copies project files and material libraries into a temporary folder, with a generated square in the scene's place.
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

/// Bytes of memory that programs can have without swapping; `None` where the system does not tell.
fn memory_left() -> Option<u64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kibibytes: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kibibytes * 1024)
}
