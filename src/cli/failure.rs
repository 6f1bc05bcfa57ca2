//! Failures of commands: their messages and exit codes.

use anstyle::{AnsiColor, Style};
use curitiba::OpenError;
use curitiba::pipeline::diagnostic::{Problem, Problems, Severity};
use curitiba::pipeline::executor::RenderError;
use curitiba::pipeline::files::OutputError;
use curitiba::pipeline::project::WriteError;
use curitiba::pipeline::scene::SceneError;
use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteDiagnostic, NamedSource, Report};
use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal as _};
use std::process::ExitCode;

const ERROR: Style = AnsiColor::Red.on_default().bold();
const WARNING: Style = AnsiColor::Yellow.on_default().bold();

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// The work failed, because of a device or a file that cannot be written, for example. Exit code 1.
    Work(String),
    /// A comparison exceeds these limits. Exit code 1.
    Beyond(String),
    /// The command line is wrong, or does not fit the project. Exit code 2.
    Usage(String),
    /// A project, scene or picture file is in error. Exit code 3.
    Input(String),
    /// The project's files have these errors. Exit code 3.
    Problems(Problems),
}

impl Failure {
    /// A failure of the work.
    pub fn work(error: impl Display) -> Self {
        Self::Work(error.to_string())
    }

    /// A failure of rendering. If a ray backend failed and no fallback was allowed, the message says how to allow one.
    pub fn of_rendering(error: impl Into<OpenError>, may_fall_back: bool) -> Self {
        let error = error.into();
        let of_device = match &error {
            OpenError::Engine(error) | OpenError::Render(RenderError::Pass { error, .. }) => {
                matches!(error.backend(), "cuda" | "optix")
            }
            _ => false,
        };
        match Self::from(error) {
            Self::Work(message) if of_device && !may_fall_back => Self::Work(format!(
                "{message}\n       `--fallback cpu` goes on with the cpu where another ray backend fails"
            )),
            failure => failure,
        }
    }

    /// The exit code.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Work(_) | Self::Beyond(_) => 1,
            Self::Usage(_) => 2,
            Self::Input(_) | Self::Problems(_) => 3,
        })
    }

    /// Prints the failure to the error stream.
    pub fn print(&self) {
        match self {
            Self::Work(message) | Self::Usage(message) | Self::Input(message) => {
                print_error(message);
            }
            Self::Beyond(metrics) => crate::tell!("{ERROR}beyond:{ERROR:#} {metrics}"),
            Self::Problems(problems) => print_problems(problems),
        }
    }
}

impl From<OpenError> for Failure {
    fn from(error: OpenError) -> Self {
        match error {
            OpenError::Project(problems) => Self::Problems(problems),
            OpenError::Source(error) => error.into(),
            OpenError::Option(message) => Self::Usage(message),
            OpenError::Plan(error) => Self::Usage(error.to_string()),
            OpenError::Render(error) => error.into(),
            error => Self::work(error),
        }
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match error {
            error @ RenderError::Scene { .. } => Self::Input(error.to_string()),
            RenderError::Plan(error) => Self::Usage(error.to_string()),
            error => Self::work(error),
        }
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        match &error {
            OutputError::Io { error: found, .. } => match found.kind() {
                ErrorKind::NotFound | ErrorKind::IsADirectory | ErrorKind::NotADirectory | ErrorKind::InvalidInput => {
                    Self::Usage(error.to_string())
                }
                _ => Self::work(error),
            },
            _ => Self::Usage(error.to_string()),
        }
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::Exists(_) => Self::Usage(error.to_string()),
            WriteError::Text(_) => Self::Input(error.to_string()),
            error => Self::work(error),
        }
    }
}

impl From<Problems> for Failure {
    fn from(problems: Problems) -> Self {
        Self::Problems(problems)
    }
}

/// Prints a warning.
pub fn print_warning(text: &str) {
    crate::tell!("{WARNING}warning:{WARNING:#} {text}");
}

/// Prints the warnings and errors among the problems, but no notes; `check` and `plan` print the notes too.
pub fn print_warnings_of(problems: &Problems) {
    let warnings = problems.0.iter().filter(|problem| problem.severity != Severity::Note);
    print_problems(&Problems(warnings.cloned().collect()));
}

/// Prints an error that does not by itself end the command.
pub fn print_error(message: &str) {
    crate::tell!("{ERROR}error:{ERROR:#} {message}");
}

/// Prints every problem with its place; on a terminal, warnings and errors with the surrounding lines. If there are errors, counts follow.
pub fn print_problems(problems: &Problems) {
    let graphical = std::io::stderr().is_terminal();
    for problem in &problems.0 {
        if graphical && problem.severity != Severity::Note && may_be_shown(problem) {
            crate::tell!("{}", graphical_problem(problem).trim_end_matches('\n'));
        } else {
            crate::tell!("{problem}");
        }
    }
    let count = |severity: Severity| problems.0.iter().filter(|problem| problem.severity == severity).count();
    let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
    if errors > 0 {
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        crate::tell!("{errors} error{}, {warnings} warning{}", plural(errors), plural(warnings));
    }
}

/// Whether the lines around a problem may be printed. They are not for a file that is no XML: a project may name such a file in
/// order to have its contents shown.
fn may_be_shown(problem: &Problem) -> bool {
    problem.place.as_ref().is_none_or(|(source, _)| source.text.trim_start().starts_with('<'))
}

fn graphical_problem(problem: &Problem) -> String {
    let mut diagnostic = MietteDiagnostic::new(&problem.message);
    diagnostic.severity = Some(match problem.severity {
        Severity::Note => miette::Severity::Advice,
        Severity::Warning => miette::Severity::Warning,
        Severity::Error => miette::Severity::Error,
    });
    diagnostic.help.clone_from(&problem.help);
    let report = match &problem.place {
        Some((source, range)) => {
            let label = LabeledSpan::underline(range.clone());
            let named = NamedSource::new(source.path.display().to_string(), source.text.to_string());
            Report::new(diagnostic.and_label(label)).with_source_code(named)
        }
        None => Report::new(diagnostic),
    };
    let mut text = String::new();
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode());
    match handler.render_report(&mut text, report.as_ref()) {
        Ok(()) => text,
        // The same information without the source lines.
        Err(_) => format!("{problem}\n"),
    }
}
