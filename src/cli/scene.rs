//! `curitiba scene`: describes scene files, converts them, or generates the square.

use super::args::SceneArgs;
use super::progress::Bars;
use super::{Failure, print_warnings, set_threads};
use anstyle::Style;
use curitiba::OpenError;
use curitiba::pipeline::executor::{Observer as _, Progress, StepKind};
use curitiba::pipeline::files::{self, check_outputs};
use curitiba::pipeline::project::{self, SceneProjects};
use curitiba::pipeline::scene::{self, Layout, LoadOptions, Needs, Scene, Statistics, statistics};
use curitiba::pipeline::square;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const HEADER: Style = Style::new().bold();

/// Loads or generates a scene, describes it, and writes it if an output is given.
pub fn run(args: &SceneArgs) -> Result<(), Failure> {
    set_threads(None)?;
    let output = args.output.as_deref();
    if let Some(triangles) = args.generate {
        let folder = output.ok_or_else(|| Failure::Usage("--generate needs a folder: -o FOLDER".to_owned()))?;
        files::check_folder(folder)?;
        let square = working(StepKind::Load, "generating the square", || square::generate(triangles));
        describe(&square.scene, args.json)?;
        let path = working(StepKind::Write, "writing", || square.write(folder))?;
        say(args.json, &format!("wrote {} and its textures", path.display()));
        return Ok(());
    }
    let layout = output.map(layout_of).transpose()?;
    check_outputs(output.map(|path| (path, "scene")))?;
    // No file that is read may be replaced.
    files::record_files_read();
    if let Some(path) = &args.project {
        write_project(args, path)?;
    }
    if let Some(folder) = &args.projects {
        files::check_folder(folder)?;
        let made = projects_of(args)?;
        for file in write_by_technique(&made, folder)? {
            say(args.json, &format!("wrote {}", file.display()));
        }
    }
    let options = LoadOptions { needs: Needs::ALL, max_bytes: args.max_memory };
    let mut files = Vec::new();
    for path in &args.files {
        // Files that are no scenes are refused when they are read.
        let found = project::scene_files(path).map_err(OpenError::from)?;
        files.extend(found.unwrap_or_else(|| vec![path.clone()]));
    }
    let scene = working(StepKind::Load, "scene files", || scene::load(&files, &options, &|_| {}))?;
    print_warnings(&scene.warnings);
    check_outputs(output.map(|path| (path, "scene")))?;
    describe(&scene, args.json)?;
    if let (Some(path), Some(layout)) = (output, layout) {
        print_warnings(&working(StepKind::Write, "scene file", || scene::write_cbo(&scene, path, layout))?);
        say(args.json, &format!("wrote {}", path.display()));
    }
    Ok(())
}

/// Writes a project that shows the scene.
fn write_project(args: &SceneArgs, path: &Path) -> Result<(), Failure> {
    if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml")) {
        return Err(Failure::Usage(format!("{}: a project is written as .xml", path.display())));
    }
    for file in projects_of(args)?.project().write(path)? {
        say(args.json, &format!("wrote {}", file.display()));
    }
    Ok(())
}

/// The projects that are made of the scene files.
fn projects_of(args: &SceneArgs) -> Result<SceneProjects, Failure> {
    let [first, more @ ..] = &args.files[..] else { unreachable!("a file is required where none is generated") };
    let options = args.scene.options(more);
    let made = working(StepKind::Load, "scene files", || {
        project::open_scenes(first, &options, args.size, args.max_memory).map_err(OpenError::from)
    })?;
    made.ok_or_else(|| Failure::Usage(format!("{}: this is a project already", first.display())))
}

/// Writes a project for each effect by rays and by raster into a folder, and returns the files.
pub fn write_by_technique(projects: &SceneProjects, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    files::create_folder(&folder.join("raster")).map_err(Failure::work)?;
    let mut files = Vec::new();
    for (file, project) in projects.by_technique() {
        files.extend(project.write(&folder.join(file))?);
    }
    Ok(files)
}

/// Runs `work` with a progress bar.
fn working<T>(kind: StepKind, name: &str, work: impl FnOnce() -> T) -> T {
    let mut bars = Bars::default();
    bars.begin(kind, name, &Arc::new(Progress::default()));
    let result = work();
    bars.end();
    result
}

/// The layout for a file name.
fn layout_of(path: &Path) -> Result<Layout, Failure> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
    match extension.as_str() {
        "cbo" => Ok(Layout::Cbo2014),
        "nbo" => Ok(Layout::NboToday),
        _ => Err(Failure::Usage(format!(
            "{}: scenes are written as .cbo (2014 layout) or .nbo (today's)",
            path.display()
        ))),
    }
}

/// Prints a line. With `--json` it goes to the error stream, since the output stream holds only JSON.
fn say(json: bool, line: &str) {
    if json { crate::tell!("{line}") } else { crate::say!("{line}") }
}

fn describe(scene: &Scene, json: bool) -> Result<(), Failure> {
    let statistics = statistics(scene);
    if json {
        crate::say!("{}", serde_json::to_string_pretty(&statistics).map_err(Failure::work)?);
    } else {
        print(&statistics);
    }
    Ok(())
}

fn print(statistics: &Statistics) {
    for file in &statistics.files {
        crate::say!("{}: {} triangles in {} objects", file.path.display(), file.triangles, file.objects);
    }
    crate::say!(
        "{HEADER}{} triangles, {} vertices, {} objects, {} meshes{HEADER:#}",
        statistics.triangles,
        statistics.vertices,
        statistics.objects,
        statistics.meshes
    );
    if let Some([low, high]) = statistics.bounds {
        crate::say!("from {low:?} to {high:?}");
    }
    let width = statistics.materials.iter().map(|material| material.name.chars().count()).max().unwrap_or(0).max(8);
    crate::say!("{HEADER}{:width$}  {:>10}  texture{HEADER:#}", "material", "triangles");
    for material in &statistics.materials {
        let line = format!(
            "{:width$}  {:>10}  {}",
            material.name,
            material.triangles,
            material.texture.as_deref().unwrap_or_default()
        );
        crate::say!("{}", line.trim_end());
    }
}
