//! `curitiba report`: writes a page about the cost of each effect by rasterisation and by rays on this machine.

use super::args::ReportArgs;
use super::progress::Bars;
use super::scene::write_by_technique;
use super::{Failure, check_references, load, say_prose, set_threads, tell_fastest, tell_prose};
use curitiba::args::quoted;
use curitiba::bench::text;
use curitiba::environment::Environment;
use curitiba::pipeline::files::TemporaryFolder;
use curitiba::pipeline::project::{self, names_scenes};
use curitiba::reference::References;
use curitiba::report::{self, ReportError, Request, Told, Wanted, number, summary};
use curitiba::{Choice, OpenError};
use std::path::{Path, PathBuf};

/// Makes the report and prints its summary.
pub fn run(args: &ReportArgs) -> Result<(), Failure> {
    set_threads(args.threads)?;
    let made = projects_of_scene(args)?;
    if made.is_none() && !args.projects.is_dir() {
        return Err(Failure::Usage(format!(
            "{}: there is no such folder; name the one that holds SceneNoEffects.xml and the other projects, or a scene",
            args.projects.display()
        )));
    }
    if args.size.is_some_and(|size| size.iter().any(|side| !(16..=8192).contains(side))) {
        return Err(Failure::Usage("--size: a report's window has 16 to 8192 pixels a side".to_owned()));
    }
    check_references(&References::default_folder(), "the variable CURITIBA_CACHE names another folder")?;
    let mut wanted = Wanted::new(args.quick, args.size);
    wanted.within = args.within;
    if let Some(seconds) = args.time {
        wanted.budget_s = f64::from(seconds);
    }
    if let Some(most) = args.max_triangles {
        wanted.triangles.retain(|triangles| *triangles <= most);
    }
    if made.is_some() {
        // The scaling by triangles would measure the generated square, not the scene of the report.
        wanted.triangles.clear();
    }
    load::tell(&Environment::here());
    let raster = args.raster.choice();
    let choice = args.backend.chosen(Choice { raster, gpus: args.gpus, adapter: args.adapter, ..Choice::default() });
    tell_fastest(choice);
    let request = Request {
        projects: made.as_ref().map_or(&args.projects, |made| &made.1).clone(),
        made: made.is_some().then(|| command_of_projects(args)),
        wanted,
        choice,
        references: References::default_folder(),
        command: command(),
        max_memory: args.max_memory,
    };
    let mut bars = Bars::default();
    let made = report::make(&request, &args.output, &mut |told| print(&told), &mut bars);
    drop(bars);
    let (folder, data) = made.map_err(|error| match error {
        ReportError::Folder(report::folder::FolderError::Occupied { .. }) => Failure::Usage(error.to_string()),
        ReportError::Nothing { .. } => Failure::Input(error.to_string()),
        _ => Failure::work(error),
    })?;
    for sentence in summary::in_short(&data) {
        say_prose(&sentence, 0);
    }
    if let Some(sentence) = text::of_outliers(&data.bench.rows) {
        say_prose(&sentence, 0);
    }
    let missing = data.bench.unavailable.len();
    if missing > 0 {
        let things = if missing == 1 { "thing" } else { "things" };
        crate::say!("{missing} {things} could not be measured; the report says which and why");
    }
    crate::say!("wrote {} in {}", folder.join("index.html").display(), number::duration(data.took_s));
    Ok(())
}

/// The projects of a scene, one for each effect and technique, in a temporary folder that exists as long as the first value; `None` if a
/// folder of projects is given.
fn projects_of_scene(args: &ReportArgs) -> Result<Option<(TemporaryFolder, PathBuf)>, Failure> {
    const FIRST: &str = "SceneNoEffects.xml";
    let options = args.scene.options(&[]);
    // A folder without scenes counts as a folder of projects; if it has none either, the report fails.
    let has_scenes = !args.projects.is_dir() || project::scene_files(&args.projects).is_ok();
    let is_scene = names_scenes(&args.projects) && has_scenes && !args.projects.join(FIRST).is_file();
    if !is_scene {
        return match options.given().first() {
            None => Ok(None),
            Some((first, _)) => Err(Failure::Usage(format!(
                "{}: projects have their own cameras, lights and passes; leave out --{first}, or name a scene",
                args.projects.display()
            ))),
        };
    }
    let projects =
        project::open_scenes(&args.projects, &options, args.size, args.max_memory).map_err(OpenError::from)?;
    let Some(projects) = projects else { return Ok(None) };
    // The temporary folder lies beside the report, and so in the folder of --confine.
    let beside = args.output.parent().unwrap_or(Path::new("."));
    let folder = TemporaryFolder::new(beside).map_err(Failure::work)?;
    // Written projects name their scenes by absolute paths.
    let path = std::fs::canonicalize(folder.path()).map_err(Failure::work)?;
    write_by_technique(&projects, &path)?;
    Ok(Some((folder, path)))
}

/// The command that writes the projects of a scene into a folder that stays.
fn command_of_projects(args: &ReportArgs) -> String {
    let options = args.scene.options(&[]);
    let words = ["curitiba".to_owned(), "scene".to_owned(), args.projects.display().to_string()]
        .into_iter()
        .chain(options.given().into_iter().flat_map(|(name, value)| [format!("--{name}"), value]))
        // The projects' camera depends on the window's shape.
        .chain(args.size.into_iter().flat_map(|[width, height]| ["--size".to_owned(), format!("{width}x{height}")]))
        .chain(["--projects".to_owned(), report::PROJECTS.to_owned()]);
    words.map(|word| quoted(&word)).collect::<Vec<_>>().join(" ")
}

/// Prints a line for a row to the error stream.
fn print(told: &Told<'_>) {
    let left = (told.time.total_s - told.time.spent_s).max(0.0);
    let [spent, left] = [told.time.spent_s, left].map(number::duration);
    tell_prose(&format!("{:>3} of {}, {spent} spent, at most {left} left: {}", told.done + 1, told.of, told.label), 4);
}

/// The command line, quoted so that it can be typed again.
fn command() -> String {
    let arguments = std::env::args_os().skip(1).map(|argument| quoted(&argument.to_string_lossy()));
    std::iter::once("curitiba".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}
