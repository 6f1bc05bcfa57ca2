//! Renders every project and scene file below a folder at a small size, and prints a table: what renders, and for what does not the
//! first reason and the number of others.
//!
//! ```sh
//! cargo run --release --example survey -- path/to/checkout > survey.md
//! ```
//!
//! Paths in the table are relative to the folder. What is looked at are `.xml` files with a `<project>` element, and scene files;
//! `--projects` or `--scenes` leaves the others out. `--sheet FILE.png` puts the pictures side by side in the order of the table; what
//! does not render is a cross there.
//!
//! Scenes that a checkout of projects names and does not hold are refused, unless `--stand-in SCENE` names a scene to take in their place; the
//! table tells how many files it stood in for.
//!
//! In builds with the feature `glsl` projects are drawn with their own shaders, on any adapter that wgpu finds.
//!
//! ```sh
//! cargo run --release --features glsl --example survey -- path/to/checkout --projects --stand-in xml_projects/3dsmodels/largoCamoes.cbo
//! cargo run --release --example survey -- path/to/models --side 300 --sheet models.png
//! ```

use clap::Parser;
use curitiba::pipeline::diagnostic::Severity;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::{Image, write_png};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::{Project, SCENE_EXTENSIONS};
use curitiba::{Choice, OpenError, RasterChoice};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Rays on the processor, which has all programs; own shaders of projects on wgpu.
const ENGINES: Choice = Choice { raster: RasterChoice::Auto, ..Choice::CPU };

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
    /// Where all pictures go, as one
    #[arg(long, value_name = "FILE.png")]
    sheet: Option<PathBuf>,
    /// Pictures a row of the sheet
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..))]
    across: u32,
    /// Scene that projects get in place of the files of theirs that are not there
    #[arg(long, value_name = "SCENE")]
    stand_in: Option<PathBuf>,
    /// Bytes that each may hold
    #[arg(long, default_value_t = 2 << 30)]
    max_memory: u64,
}

/// What became of a file.
enum Outcome {
    /// Whether all pixels have one colour, and how many scene files were not there and replaced.
    Renders(bool, usize),
    /// The first reason, and how many others there are.
    Refused(String, usize),
}

fn main() {
    let arguments = Arguments::parse();
    let mut files = Vec::new();
    collect(&arguments.folder, &mut files);
    files.sort();
    let mut pictures = Vec::new();
    let mut counts: BTreeMap<&'static str, (u32, u32)> = BTreeMap::new();
    println!("| file | outcome | reason |\n|---|---|---|");
    for file in files {
        let is_scene = SCENE_EXTENSIONS.contains(&extension(&file).as_str());
        if is_scene && arguments.projects || !is_scene && (arguments.scenes || !is_project(&file)) {
            continue;
        }
        let mut picture = None;
        let (outcome, reason) = match outcome(&file, &arguments, &mut picture) {
            Outcome::Renders(blank, replaced) => {
                let blank = blank.then(|| "all pixels have one colour".to_owned());
                let replaced = (replaced > 0).then(|| format!("scene files that are not there: {replaced}"));
                ("renders", [blank, replaced].into_iter().flatten().collect::<Vec<_>>().join("; "))
            }
            Outcome::Refused(reason, 0) => ("refused", reason),
            Outcome::Refused(reason, more) => ("refused", format!("{reason} (and {more} more)")),
        };
        let (rendered, all) = counts.entry(if is_scene { "scenes" } else { "projects" }).or_default();
        *rendered += u32::from(outcome == "renders");
        *all += 1;
        pictures.push(picture);
        println!("| {} | {outcome} | {} |", named(&file, &arguments.folder), reason.replace('|', "\\|"));
    }
    println!();
    for (kind, (rendered, all)) in counts {
        println!("Of {all} {kind} {rendered} render.");
    }
    if let Some(path) = &arguments.sheet
        && let Err(error) = write_png(path, &sheet(&pictures, arguments.side, arguments.across))
    {
        eprintln!("{}: {error}", path.display());
        std::process::exit(1);
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

/// The pictures in rows, on grey; a cross for what there is none of.
fn sheet(pictures: &[Option<Image>], side: u32, across: u32) -> Image {
    const GAP: u32 = 4;
    let across = across.min(pictures.len().max(1) as u32);
    let cell = side + GAP;
    let rows = (pictures.len() as u32).div_ceil(across).max(1);
    let mut sheet = Image::filled(across * cell + GAP, rows * cell + GAP, [0.25, 0.25, 0.25, 1.0]);
    let cross = |x: u32, y: u32| if x.abs_diff(y) < 2 || (x + y).abs_diff(side - 1) < 2 { 0.6 } else { 0.15 };
    for (number, picture) in (0..).zip(pictures) {
        let (left, top) = (GAP + number % across * cell, GAP + number / across * cell);
        for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
            let pixel = match picture {
                Some(picture) => picture.pixels[(y * picture.width + x) as usize],
                None => [cross(x, y), 0.1, 0.1, 1.0],
            };
            sheet.pixels[((top + y) * sheet.width + left + x) as usize] = pixel;
        }
    }
    sheet
}

/// What becomes of a file, and its picture as it is displayed where a sheet is asked for.
fn outcome(file: &Path, arguments: &Arguments, shown: &mut Option<Image>) -> Outcome {
    let (size, max_memory) = (Some([arguments.side; 2]), arguments.max_memory);
    let settings = Settings { size, max_memory, ..Settings::default() };
    let mut replaced = 0;
    let opened = settings.open(file).map_err(OpenError::from).and_then(|mut project| {
        if let Some(stand_in) = &arguments.stand_in {
            replaced = replace_missing(&mut project, stand_in);
        }
        curitiba::open_project(project, settings, ENGINES, &mut Silent)
    });
    let rendered = opened.and_then(|mut renderer| {
        let display = renderer.plan().display;
        renderer.frame(&mut Silent).map(|picture| (picture, display)).map_err(OpenError::from)
    });
    match rendered {
        Ok((picture, display)) => {
            if arguments.sheet.is_some() {
                let pixels = picture.pixels.iter().map(|pixel| display.displayed(*pixel)).collect();
                *shown = Some(Image { pixels, ..picture.clone() });
            }
            Outcome::Renders(picture.is_blank(), replaced)
        }
        Err(OpenError::Project(problems)) => {
            let errors: Vec<_> = problems.0.iter().filter(|problem| problem.severity == Severity::Error).collect();
            let first = errors.first().map_or(String::new(), |problem| {
                let place = problem.place.as_ref().map_or(String::new(), |(source, range)| {
                    let (line, column) = source.line_column(range.start);
                    format!("{}:{line}:{column}: ", source.path.display())
                });
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

/// Names the stand-in where a scene file is not there. Returns the number of these.
fn replace_missing(project: &mut Project, stand_in: &Path) -> usize {
    let mut replaced = 0;
    for file in project.scenes.iter_mut().flat_map(|scene| &mut scene.files) {
        if !file.path.exists() {
            stand_in.clone_into(&mut file.path);
            replaced += 1;
        }
    }
    replaced
}

/// A message without the way to the folder.
fn in_folder(message: &str, folder: &Path) -> String {
    message.replace(&format!("{}/", folder.display()), "")
}

fn named(file: &Path, folder: &Path) -> String {
    file.strip_prefix(folder).unwrap_or(file).display().to_string().replace('\\', "/")
}
