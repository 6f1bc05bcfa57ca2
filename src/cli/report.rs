//! `curitiba report`: a page that says what each effect costs by raster and by rays here.

use super::args::ReportArgs;
use super::progress::Bars;
use super::{Failure, set_threads};
use curitiba::Choice;
use curitiba::reference::References;
use curitiba::report::{self, ReportError, Request, Told, Wanted, number, summary};

/// Makes the report and prints its summary.
pub fn run(args: &ReportArgs) -> Result<(), Failure> {
    set_threads(args.threads)?;
    if !args.projects.is_dir() {
        return Err(Failure::Usage(format!(
            "{}: there is no such folder; name the one that holds SceneNoEffects.xml and the other projects",
            args.projects.display()
        )));
    }
    if args.size.is_some_and(|size| size.iter().any(|side| !(16..=8192).contains(side))) {
        return Err(Failure::Usage("--size: a report's window has 16 to 8192 pixels a side".to_owned()));
    }
    let mut wanted = Wanted::new(args.quick, args.size);
    if let Some(seconds) = args.time {
        wanted.budget_s = f64::from(seconds);
    }
    if let Some(most) = args.max_triangles {
        wanted.triangles.retain(|triangles| *triangles <= most);
    }
    let request = Request {
        projects: args.projects.clone(),
        wanted,
        choice: Choice {
            raster: args.raster.choice(),
            backend: args.backend.choice(),
            gpus: args.gpus,
            ..Choice::default()
        },
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
        ReportError::Folder(_) | ReportError::Engine(_) => Failure::work(error),
    })?;
    for sentence in summary::in_short(&data) {
        crate::say!("{sentence}");
    }
    let missing = data.bench.unavailable.len();
    if missing > 0 {
        let things = if missing == 1 { "thing" } else { "things" };
        crate::say!("{missing} {things} could not be measured; the report says which and why");
    }
    crate::say!("wrote {} in {}", folder.join("index.html").display(), number::duration(data.took_s));
    Ok(())
}

/// One line a row, on the error stream.
fn print(told: &Told<'_>) {
    let left = (told.time.total_s - told.time.spent_s).max(0.0);
    anstream::eprintln!(
        "{:>3} of {}, {} spent, at most {} left: {}",
        told.done + 1,
        told.of,
        number::duration(told.time.spent_s),
        number::duration(left),
        told.label
    );
}

/// The command as it can be typed again.
fn command() -> String {
    let quote = |argument: String| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@".contains(c);
        if !argument.is_empty() && argument.chars().all(plain) {
            argument
        } else {
            format!("'{}'", argument.replace('\'', "'\\''"))
        }
    };
    let arguments = std::env::args_os().skip(1).map(|argument| quote(argument.to_string_lossy().into_owned()));
    std::iter::once("curitiba".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}
