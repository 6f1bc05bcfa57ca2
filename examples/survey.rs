//! Renders every project and scene file below a folder at a small size, and prints a table: what renders, and for what does not the
//! first reason and the number of others.
//!
//! ```sh
//! cargo run --release --example survey -- path/to/checkout > survey.md
//! ```
//!
//! Paths in the table are relative to the folder. What is looked at are `.xml` files with a `<project>` element, and scene files;
//! `--projects` or `--scenes` leaves the others out.

use clap::Parser;
use curitiba::pipeline::diagnostic::Severity;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::SCENE_EXTENSIONS;
use curitiba::{Choice, OpenError};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(Debug, Parser)]
struct Arguments {
    /// Folder that is searched, with the folders in it
    folder: PathBuf,
    /// Look at projects only
    #[arg(long, conflicts_with = "scenes")]
    projects: bool,
    /// Look at scene files only
    #[arg(long)]
    scenes: bool,
    /// Pixels a side
    #[arg(long, default_value_t = 64)]
    side: u32,
    /// Bytes that each may hold
    #[arg(long, default_value_t = 2 << 30)]
    max_memory: u64,
}

/// What became of a file.
enum Outcome {
    Renders,
    /// All pixels have one colour.
    Blank,
    /// The first reason, and how many others there are.
    Refused(String, usize),
}

fn main() {
    let arguments = Arguments::parse();
    let mut files = Vec::new();
    collect(&arguments.folder, &mut files);
    files.sort();
    let mut counts: BTreeMap<&'static str, (u32, u32)> = BTreeMap::new();
    println!("| file | outcome | reason |\n|---|---|---|");
    for file in files {
        let is_scene = SCENE_EXTENSIONS.contains(&extension(&file).as_str());
        if is_scene && arguments.projects || !is_scene && (arguments.scenes || !is_project(&file)) {
            continue;
        }
        let (outcome, reason) = match outcome(&file, &arguments) {
            Outcome::Renders => ("renders", String::new()),
            Outcome::Blank => ("renders", "all pixels have one colour".to_owned()),
            Outcome::Refused(reason, 0) => ("refused", reason),
            Outcome::Refused(reason, more) => ("refused", format!("{reason} (and {more} more)")),
        };
        let (rendered, all) = counts.entry(if is_scene { "scenes" } else { "projects" }).or_default();
        *rendered += u32::from(outcome == "renders");
        *all += 1;
        println!("| {} | {outcome} | {} |", named(&file, &arguments.folder), reason.replace('|', "\\|"));
    }
    println!();
    for (kind, (rendered, all)) in counts {
        println!("Of {all} {kind} {rendered} render.");
    }
}

/// All files below a folder; links are not followed.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        match entry.file_type() {
            Ok(kind) if kind.is_dir() => collect(&entry.path(), files),
            Ok(kind) if kind.is_file() => files.push(entry.path()),
            _ => {}
        }
    }
}

fn extension(file: &Path) -> String {
    if file.to_string_lossy().to_lowercase().ends_with(".mesh.xml") {
        return "mesh.xml".to_owned();
    }
    file.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase()
}

fn is_project(file: &Path) -> bool {
    extension(file) == "xml"
        && std::fs::read(file).is_ok_and(|bytes| {
            let text = String::from_utf8_lossy(&bytes);
            text.contains("<project") && text.contains("<pipeline")
        })
}

fn outcome(file: &Path, arguments: &Arguments) -> Outcome {
    let (size, max_memory) = (Some([arguments.side; 2]), arguments.max_memory);
    let settings = Settings { size, max_memory, ..Settings::default() };
    let rendered = curitiba::open(file, settings, Choice::CPU, &mut Silent)
        .and_then(|mut renderer| renderer.frame(&mut Silent).map_err(OpenError::from));
    match rendered {
        Ok(picture) => {
            if picture.is_blank() {
                Outcome::Blank
            } else {
                Outcome::Renders
            }
        }
        Err(OpenError::Project(problems)) => {
            let errors: Vec<_> = problems.0.iter().filter(|problem| problem.severity == Severity::Error).collect();
            let first = errors.first().map_or(String::new(), |problem| {
                let line = problem.place.as_ref().map(|(source, range)| source.line_column(range.start).0);
                let place = line.map_or(String::new(), |line| format!("line {line}: "));
                format!("{place}{}", problem.message)
            });
            Outcome::Refused(in_folder(&first, &arguments.folder), errors.len().saturating_sub(1))
        }
        Err(error) => {
            let message = error.to_string();
            Outcome::Refused(in_folder(message.lines().next().unwrap_or_default(), &arguments.folder), 0)
        }
    }
}

/// A message without the way to the folder.
fn in_folder(message: &str, folder: &Path) -> String {
    message.replace(&format!("{}/", folder.display()), "")
}

fn named(file: &Path, folder: &Path) -> String {
    file.strip_prefix(folder).unwrap_or(file).display().to_string().replace('\\', "/")
}
