//! The rows that `bench` measures.

use super::Failure;
use super::bench_args::{BenchArgs, EngineArg};
use curitiba::bench::Case;
use curitiba::bench::table2::{self, TableRow};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::PassKind;
use curitiba::{BackendChoice, Choice, OpenError, RasterChoice};
use std::path::Path;

/// A case, and the corresponding row of the report's table, if any.
pub(super) struct Job {
    pub case: Case,
    pub row: Option<TableRow>,
}

impl EngineArg {
    /// The engines of this argument; the rest is as in `choice`.
    pub fn choice(self, choice: Choice) -> Choice {
        match self {
            Self::Cpu => Choice::CPU,
            Self::Wgpu => Choice { raster: RasterChoice::Wgpu, adapter: choice.adapter, ..Choice::CPU },
            Self::WgpuRays => choice.traced_by(BackendChoice::Wgpu),
            Self::Cuda => choice.traced_by(BackendChoice::Cuda),
            Self::Optix => choice.traced_by(BackendChoice::Optix),
        }
    }
}

/// The engines of `--compare`, without repetition; the rest is as in `choice`.
pub(super) fn engines(args: &BenchArgs, choice: Choice) -> impl Iterator<Item = (EngineArg, Choice)> {
    let named = args.compare.iter().enumerate();
    let first = named.filter(|(index, engine)| !args.compare[..*index].contains(engine));
    first.map(move |(_, engine)| (*engine, engine.choice(choice)))
}

/// All engines on which every row is to be measured, whether or not this machine has them: the same on every machine.
pub(super) fn all_choices(args: &BenchArgs, choice: Choice) -> Vec<Choice> {
    if args.compare.is_empty() { vec![choice] } else { engines(args, choice).map(|(_, asked)| asked).collect() }
}

/// All cases to be measured. They are checked before any is measured.
pub(super) fn jobs(args: &BenchArgs, choices: &[Choice]) -> Result<Vec<Job>, Failure> {
    let mut jobs = Vec::new();
    if args.table2 {
        if !args.folder.join(table2::ROWS[0].project).is_file() {
            return Err(Failure::Usage(format!(
                "{}: there is no {} in this folder\n       --projects names the folder of the report's projects",
                args.folder.display(),
                table2::ROWS[0].project
            )));
        }
        for row in table2::ROWS {
            // Parameters set by the user apply to the rows whose pass reads them.
            let settings = args.project(args.folder.join(row.project), None).settings();
            for choice in choices {
                let case = row.case(&args.folder, &settings, *choice)?;
                jobs.push(Job { case, row: Some(row) });
            }
        }
    }
    let cameras: Vec<Option<String>> =
        if args.camera.is_empty() { vec![None] } else { args.camera.iter().cloned().map(Some).collect() };
    for path in &args.projects {
        for camera in &cameras {
            let settings = args.project(path.clone(), camera.clone()).settings();
            let sweep = match &args.sweep {
                Some(sweep) => swept(path, sweep, &settings)?.into_iter().map(Some).collect(),
                None => vec![None],
            };
            for set in sweep {
                let mut settings = settings.clone();
                let value = set.as_deref().and_then(|set| set.split_once('.')).map(|(_, value)| value.to_owned());
                settings.set.extend(set);
                for choice in choices {
                    let mut case = Case::new(path, settings.clone(), *choice)?;
                    if let Some(value) = value.as_ref().filter(|value| !value.starts_with("samples=")) {
                        case.label = format!("{}, {value}", case.label);
                    }
                    if !jobs.iter().any(|job: &Job| job.case.key == case.key) {
                        jobs.push(Job { case, row: None });
                    }
                }
            }
        }
    }
    Ok(jobs)
}

/// The assignments of a sweep: `PASS.NAME=VALUE` for each value.
fn swept(path: &Path, sweep: &str, settings: &Settings) -> Result<Vec<String>, Failure> {
    let wrong = |help: &str| Failure::Usage(format!("`--sweep {sweep}`: {help}"));
    let Some((name, values)) = sweep.split_once('=') else {
        return Err(wrong("this is not NAME=A,B,… such as samples=1,4,9"));
    };
    let pass = if name.contains('.') {
        name.to_owned()
    } else {
        let project = settings.open(path).map_err(OpenError::from)?;
        let index = project.pipeline(settings.pipeline.as_deref()).map_err(Failure::Usage)?;
        let reads = |kind: &PassKind| match kind {
            PassKind::Ray(ray) => ray.program.info().params.contains(&name),
            PassKind::Effect(effect) => effect.program.info().params.contains(&name),
            PassKind::Raster(_) | PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => false,
        };
        let pass = project.pipelines[index].passes.iter().find(|pass| reads(&pass.kind));
        let Some(pass) = pass else {
            return Err(wrong(&format!(
                "no pass of {} reads `{name}`; `curitiba list` names what each program reads",
                path.display()
            )));
        };
        format!("{}.{name}", pass.name)
    };
    let assignments: Vec<String> = values
        .split(',')
        .map(str::trim)
        .filter(|value| !value.is_empty())
        .map(|value| format!("{pass}={value}"))
        .collect();
    if assignments.is_empty() { Err(wrong("it names no value")) } else { Ok(assignments) }
}
