//! Renders every project and scene file below a folder at a small size, and prints a table: which files render, and for the others the first
//! reason why not and the number of further reasons.
//!
//! ```sh
//! cargo run --release --example survey -- path/to/checkout > survey.md
//! ```
//!
//! Paths in the table are relative to the folder. The survey covers `.xml` files with a `<project>` element, and scene files; `--projects` or
//! `--scenes` leaves the others out. `--sheet FILE.png` puts the pictures side by side in the order of the table; a cross stands for a file
//! that does not render. `--page FOLDER` makes a contact sheet: a page with the name, time, warnings or reason below each picture
//! (`index.html`), the pictures, the sheet (`sheet.png`) and the list (`files.json`). Files are rendered one after the other, and a file that
//! fails does not stop the others.
//!
//! Projects that name scenes which are missing from the checkout are refused, unless `--stand-in SCENE` names a scene to use instead. The table
//! tells how many files it replaced.
//!
//! In builds with the feature `glsl`, projects are drawn with their own shaders, on any adapter that wgpu finds. The table says which projects.
//!
//! ```sh
//! cargo run --release --features glsl --example survey -- path/to/checkout --projects --stand-in xml_projects/3dsmodels/largoCamoes.cbo
//! cargo run --release --example survey -- path/to/models --side 300 --sheet models.png
//! cargo run --release --example survey -- path/to/models --scenes --page models
//! ```

use clap::Parser;
use curitiba::args::parse_bytes;
use curitiba::pipeline::color::Display;
use curitiba::pipeline::diagnostic::Severity;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::pixel_samples::PixelSamples;
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::{Project, SCENE_EXTENSIONS};
use curitiba::{Choice, OpenError, RasterChoice};
use image::{Rgb, RgbImage};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde::Serialize;
use std::collections::BTreeMap;
use std::error::Error;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Instant;

const RENDERS: &str = "renders";
/// Name of the folder for pictures in the page's folder.
const PICTURES: &str = "pictures";

/// Rays run on the processor, which has all programs; projects' own shaders run on wgpu.
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
    /// Pixels a side [default: 64, and 256 with --page]
    #[arg(long)]
    side: Option<u32>,
    /// Samples of every pixel: 1, 2, 4, 8, 16, 32 or 64
    #[arg(long, value_name = "N", default_value_t = PixelSamples::ONE)]
    aa: PixelSamples,
    /// Where all pictures go, as one
    #[arg(long, value_name = "FILE.png")]
    sheet: Option<PathBuf>,
    /// Pictures a row of the sheet
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..))]
    across: u32,
    /// Folder that gets a page of all pictures with their names (index.html), the pictures, all as one (sheet.png) and a list (files.json)
    #[arg(long, value_name = "FOLDER")]
    page: Option<PathBuf>,
    /// Scene that projects get in place of the files of theirs that are not there
    #[arg(long, value_name = "SCENE")]
    stand_in: Option<PathBuf>,
    /// Threads of the cpu engines [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Bytes that each may hold, with or without a unit: 512MiB
    #[arg(long, value_name = "BYTES", default_value = "2GiB", value_parser = parse_bytes)]
    max_memory: u64,
}

impl Arguments {
    fn side(&self) -> u32 {
        self.side.unwrap_or(if self.page.is_some() { 256 } else { 64 })
    }
}

/// The outcome for a file.
enum Outcome {
    Renders {
        /// `None` if no picture was requested.
        picture: Option<RgbImage>,
        /// Whether all pixels have one colour.
        is_blank: bool,
        /// Number of missing scene files that were replaced.
        replaced: usize,
        /// Whether passes are drawn with the project's own shaders.
        draws_own: bool,
        warnings: Vec<String>,
    },
    /// The first reason, and how many others there are.
    Refused(String, usize),
}

/// A row of the table.
#[derive(Serialize)]
struct Entry {
    file: String,
    /// `projects` or `scenes`.
    kind: &'static str,
    bytes: u64,
    outcome: &'static str,
    /// Why the file is refused, or what is odd about its picture.
    reason: String,
    warnings: Vec<String>,
    /// Time to read and render it.
    milliseconds: u128,
    /// Path below the page's folder.
    picture: Option<String>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    curitiba::threads::start(arguments.threads)?;
    if let Some(page) = &arguments.page {
        std::fs::create_dir_all(page.join(PICTURES)).map_err(|error| format!("{}: {error}", page.display()))?;
    }
    let mut files = Vec::new();
    collect(&arguments.folder, &mut files);
    files.sort();
    let (mut entries, mut pictures): (Vec<Entry>, Vec<Option<RgbImage>>) = Default::default();
    println!("| file | outcome | reason |\n|---|---|---|");
    for file in files {
        let is_scene = SCENE_EXTENSIONS.contains(&extension(&file).as_str());
        if is_scene && arguments.projects || !is_scene && (arguments.scenes || !is_project(&file)) {
            continue;
        }
        let (mut entry, picture) = entry(&file, if is_scene { "scenes" } else { "projects" }, &arguments);
        println!("| {} | {} | {} |", entry.file, entry.outcome, entry.reason.replace('|', "\\|"));
        if let (Some(page), Some(picture)) = (&arguments.page, &picture) {
            let name = format!("{PICTURES}/{}.png", entries.len() + 1);
            write_picture(&page.join(&name), picture)?;
            entry.picture = Some(name);
        }
        entries.push(entry);
        pictures.push(picture);
    }
    println!();
    let mut counts: BTreeMap<&'static str, (u32, u32)> = BTreeMap::new();
    for entry in &entries {
        let (rendered, all) = counts.entry(entry.kind).or_default();
        *rendered += u32::from(entry.outcome == RENDERS);
        *all += 1;
    }
    let counts: Vec<String> =
        counts.iter().map(|(kind, (rendered, all))| format!("Of {all} {kind} {rendered} render.")).collect();
    counts.iter().for_each(|count| println!("{count}"));
    if let Some(path) = &arguments.sheet {
        write_picture(path, &sheet(&pictures, arguments.side(), arguments.across))?;
    }
    if let Some(page) = &arguments.page {
        write_picture(&page.join("sheet.png"), &sheet(&pictures, arguments.side(), arguments.across))?;
        let json = serde_json::to_string_pretty(&entries)?;
        let html = document(&entries, &counts, arguments.side()).into_string();
        for (name, text) in [("files.json", json), ("index.html", html)] {
            let path = page.join(name);
            std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
        }
    }
    Ok(())
}

fn write_picture(path: &Path, picture: &RgbImage) -> Result<(), Box<dyn Error>> {
    Ok(picture.save(path).map_err(|error| format!("{}: {error}", path.display()))?)
}

/// The row of a file, and its picture. A panic is a reason like any other.
fn entry(file: &Path, kind: &'static str, arguments: &Arguments) -> (Entry, Option<RgbImage>) {
    let start = Instant::now();
    let found = catch_unwind(AssertUnwindSafe(|| outcome(file, arguments))).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or_default();
        Outcome::Refused(format!("the program panicked: {text}"), 0)
    });
    let mut entry = Entry {
        file: named(file, &arguments.folder),
        kind,
        bytes: std::fs::metadata(file).map_or(0, |metadata| metadata.len()),
        outcome: RENDERS,
        reason: String::new(),
        warnings: Vec::new(),
        milliseconds: start.elapsed().as_millis(),
        picture: None,
    };
    match found {
        Outcome::Renders { picture, is_blank, replaced, draws_own, warnings } => {
            let own = draws_own.then(|| "own shaders".to_owned());
            let is_blank = is_blank.then(|| "all pixels have one colour".to_owned());
            let replaced = (replaced > 0).then(|| format!("scene files that are not there: {replaced}"));
            entry.reason = [own, is_blank, replaced].into_iter().flatten().collect::<Vec<_>>().join("; ");
            entry.warnings = warnings;
            (entry, picture)
        }
        Outcome::Refused(reason, more) => {
            entry.outcome = "refused";
            entry.reason = if more == 0 { reason } else { format!("{reason} (and {more} more)") };
            (entry, None)
        }
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

/// The pictures in rows, on grey; a cross stands for a missing picture.
fn sheet(pictures: &[Option<RgbImage>], side: u32, across: u32) -> RgbImage {
    const GAP: u32 = 4;
    let across = across.min(pictures.len().max(1) as u32);
    let cell = side + GAP;
    let rows = (pictures.len() as u32).div_ceil(across).max(1);
    let mut sheet = RgbImage::from_pixel(across * cell + GAP, rows * cell + GAP, Rgb([64; 3]));
    let is_on_cross = |x: u32, y: u32| x.abs_diff(y) < 2 || (x + y).abs_diff(side - 1) < 2;
    for (number, picture) in (0..).zip(pictures) {
        let (left, top) = (GAP + number % across * cell, GAP + number / across * cell);
        for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
            let pixel = match picture {
                Some(picture) => *picture.get_pixel(x, y),
                None => Rgb([if is_on_cross(x, y) { 153 } else { 38 }, 26, 26]),
            };
            sheet.put_pixel(left + x, top + y, pixel);
        }
    }
    sheet
}

/// The page: for every file its picture, or the reason why there is none.
fn document(entries: &[Entry], counts: &[String], side: u32) -> Markup {
    const STYLE: &str = "body{font:14px/1.4 system-ui,sans-serif;margin:1.5em;background:#1d1f21;color:#e6e6e6}a{color:#8ab4f8}\
        main{display:grid;gap:1em}figure{margin:0;overflow-wrap:anywhere}\
        figure img{width:100%;height:auto;display:block}figcaption{padding:.3em 0}.refused{border:1px solid #d06c6c;padding:.5em}\
        .note{color:#b4b4b4}summary{cursor:pointer}";
    let columns = format!("grid-template-columns:repeat(auto-fill,minmax(min({side}px,100%),1fr))");
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width,initial-scale=1";
                title { "Contact sheet" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "Contact sheet" }
                p { (counts.join(" ")) " " a href="sheet.png" { "All pictures as one" } ", " a href="files.json" { "the list" } "." }
                main style=(columns) {
                    @for entry in entries {
                        figure class=(entry.outcome) {
                            @if let Some(picture) = &entry.picture {
                                img src=(picture) width=(side) height=(side) loading="lazy" alt=(entry.file);
                            }
                            figcaption {
                                strong { (entry.file) }
                                @if entry.outcome != RENDERS { " is refused" }
                                div class="note" { (entry.milliseconds) " ms, " (entry.bytes.div_ceil(1024)) " KiB" }
                                @if !entry.reason.is_empty() { div { (entry.reason) } }
                                @if !entry.warnings.is_empty() {
                                    details {
                                        summary { "Warnings: " (entry.warnings.len()) }
                                        @for warning in &entry.warnings { p class="note" { (warning) } }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A picture as it is displayed.
fn displayed(picture: &Image, display: Display) -> RgbImage {
    RgbImage::from_fn(picture.width, picture.height, |x, y| {
        let shown = display.displayed(picture.pixels[(y * picture.width + x) as usize]);
        Rgb([shown[0], shown[1], shown[2]].map(|value| (value * 255.0).round() as u8))
    })
}

/// The outcome for a file, with its picture if a sheet or a page is asked for.
fn outcome(file: &Path, arguments: &Arguments) -> Outcome {
    let (size, max_memory) = (Some([arguments.side(); 2]), arguments.max_memory);
    let settings = Settings { size, max_memory, aa: arguments.aa, ..Settings::default() };
    let mut replaced = 0;
    let opened = settings.open(file).map_err(OpenError::from).and_then(|mut project| {
        if let Some(stand_in) = &arguments.stand_in {
            replaced = replace_missing(&mut project, stand_in);
        }
        curitiba::open_project(project, settings, ENGINES, &mut Silent)
    });
    let rendered = opened.and_then(|mut renderer| {
        let display = renderer.plan().display;
        let told = |warning: &dyn std::fmt::Display| in_folder(&warning.to_string(), &arguments.folder);
        let problems = renderer.plan().project.problems.0.iter();
        let problems = problems.filter(|problem| problem.severity == Severity::Warning);
        let mut warnings: Vec<String> = problems.map(|problem| told(&problem.message)).collect();
        warnings.extend(renderer.warnings().groups().iter().map(|group| told(group)));
        let plan = renderer.plan();
        let draws_own = plan.passes.iter().any(|planned| {
            plan.draws_own(planned) && plan.pass(planned).kind.shaders().any(|shader| !shader.is_pattern())
        });
        let picture = renderer.frame(&mut Silent).map_err(OpenError::from)?;
        let asked_for = arguments.sheet.is_some() || arguments.page.is_some();
        let is_blank = picture.is_blank();
        let picture = asked_for.then(|| displayed(&picture, display));
        Ok(Outcome::Renders { picture, is_blank, replaced, draws_own, warnings })
    });
    match rendered {
        Ok(outcome) => outcome,
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

/// Replaces missing scene files by the stand-in. Returns the number of replaced files.
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

/// A message without the path of the folder.
fn in_folder(message: &str, folder: &Path) -> String {
    message.replace(&format!("{}/", folder.display()), "")
}

fn named(file: &Path, folder: &Path) -> String {
    file.strip_prefix(folder).unwrap_or(file).display().to_string().replace('\\', "/")
}
