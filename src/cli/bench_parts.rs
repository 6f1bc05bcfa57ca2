//! `curitiba bench --list` and `--shard`: rows distributed over several processes, each row in its own file.

use super::bench_args::BenchArgs;
use super::bench_begin::{begin, check_folder_of_references, choices, references_folder};
use super::bench_jobs::{Job, all_choices, jobs};
use super::bench_rows::{Missing, Rows};
use super::bench_table::Table;
use super::{Failure, failure, load};
use curitiba::Choice;
use curitiba::bench::model::{BenchFile, Unavailable};
use curitiba::bench::part::{PartError, Parts, RowList};
use curitiba::environment::Environment;
use curitiba::pipeline::files::check_folder;
use curitiba::reference::has_noise;
use curitiba::shard::{Request, Shard};
use std::path::Path;

impl From<PartError> for Failure {
    fn from(error: PartError) -> Self {
        match error {
            PartError::Broken { .. } => Self::Input(error.to_string()),
            PartError::Other(_) => Self::Usage(error.to_string()),
            _ => Self::work(error),
        }
    }
}

/// The shard that `--shard` selects, resolved with the environment of this process; without it all the work.
pub(super) fn shard(request: Option<Request>) -> Result<Shard, Failure> {
    let variable = |name: &str| std::env::var(name).ok();
    request.map_or(Ok(Shard::WHOLE), |request| request.resolve(variable)).map_err(Failure::Usage)
}

/// Prints a line for each row, separated by tabs: index from 0, id, and the command that measures this row alone.
pub(super) fn list(args: &BenchArgs) -> Result<(), Failure> {
    let shard = shard(args.shard)?;
    let jobs = jobs(args, &all_choices(args, args.choice()))?;
    check_noise(args, &jobs)?;
    let list = row_list(args, &jobs);
    for (index, row) in list.rows.iter().enumerate().filter(|(index, _)| shard.has(*index)) {
        let alone = Shard { index: index as u64, count: jobs.len() as u64 };
        crate::say!("{index}\t{}\t{}", row.id, args.command_of(alone));
    }
    Ok(())
}

fn row_list(args: &BenchArgs, jobs: &[Job]) -> RowList {
    RowList::new(args.command(), jobs.iter().map(|job| &job.case))
}

/// Measures the rows of a shard that the folder does not contain yet, and prints all rows of the shard.
pub(super) fn run(args: &BenchArgs, folder: &Path) -> Result<(), Failure> {
    let shard = shard(args.shard)?;
    check_folder(folder)?;
    let jobs = jobs(args, &all_choices(args, args.choice()))?;
    check_noise(args, &jobs)?;
    let parts = Parts::open(folder, row_list(args, &jobs))?;
    let mine: Vec<usize> = (0..jobs.len()).filter(|index| shard.has(*index)).collect();
    let found = mine.iter().map(|index| parts.find(*index)).collect::<Result<Vec<_>, _>>()?;
    let mut shown = BenchFile::begin(args.command(), Environment::here(), args.frames, args.warmup);
    let rows = mine.iter().map(|index| [jobs[*index].case.label.as_str(), &jobs[*index].case.view]);
    let mut table = Table::new(rows, &shown);
    let there = found.iter().flatten().count();
    crate::say!("shard {shard}: {} of {} rows, {there} of them are there", mine.len(), jobs.len());
    let mut measuring = None;
    let mut first_failure = None;
    for (index, part) in mine.into_iter().zip(found) {
        let part = match part {
            Some(part) => part,
            None => {
                let measuring = match &mut measuring {
                    Some(measuring) => measuring,
                    none => none.insert(Measuring::begin(args)?),
                };
                match measuring.row(&jobs[index], (index, jobs.len())) {
                    Ok(part) => {
                        parts.write(index, part.clone())?;
                        part
                    }
                    Err(failure) => {
                        first_failure.get_or_insert(failure);
                        continue;
                    }
                }
            }
        };
        part.rows.iter().for_each(|row| table.print(row));
        shown.rows.extend(part.rows);
        shown.unavailable.extend(part.unavailable);
    }
    table.end(&shown);
    first_failure.map_or(Ok(()), Err)
}

/// Fails if references would be refined row by row: refined references would depend on the rows that one process happens to measure.
fn check_noise(args: &BenchArgs, jobs: &[Job]) -> Result<(), Failure> {
    if args.no_error || args.reference_samples.is_some() {
        return Ok(());
    }
    for job in jobs {
        if has_noise(&job.case)? {
            return Err(Failure::Usage(format!(
                "{}: its reference has noise, and refining it row by row would make errors depend on how rows are shared out\n       \
                 --reference-samples N takes references of N samples, such as 4096; --no-error measures times only",
                job.case.label
            )));
        }
    }
    Ok(())
}

/// State for measuring, set up when the first row is measured.
struct Measuring {
    /// Benchmark without rows: command and machine.
    file: BenchFile,
    /// The requested engines that this machine has.
    choices: Vec<Choice>,
    rows: Rows,
}

impl Measuring {
    fn begin(args: &BenchArgs) -> Result<Self, Failure> {
        check_folder_of_references(args)?;
        let mut file = begin(args);
        let choices = choices(args, args.choice(), &mut file);
        load::tell(&file.environment);
        Ok(Self { file, choices, rows: Rows::new(args, references_folder(args)) })
    }

    /// Measures a row. If an engine does not support the row at all, the part records the reason instead of a row. If this machine lacks the
    /// engine, the result is an error, so that another machine can measure the row.
    fn row(&mut self, job: &Job, place: (usize, usize)) -> Result<BenchFile, Failure> {
        if !self.choices.contains(&job.case.choice) {
            let engines = job.case.choice.rays_in_words();
            let why: Vec<String> =
                self.file.unavailable.iter().map(|Unavailable { what, why }| format!("{what}: {why}")).collect();
            let message = format!(
                "{}, {} on {engines}: this machine lacks an engine ({})",
                job.case.label,
                job.case.view,
                why.join("; ")
            );
            failure::print_warning(&message);
            return Err(Failure::Work(message));
        }
        let here = Environment { load_average: Environment::here().load_average, ..self.file.environment.clone() };
        let file = BenchFile { environment: here, unavailable: Vec::new(), ..self.file.clone() };
        match self.rows.measure(job, place) {
            Ok(row) => Ok(BenchFile { rows: vec![row], ..file }),
            Err(Missing { what, failure: None }) => Ok(BenchFile { unavailable: vec![what], ..file }),
            Err(Missing { failure: Some(failure), .. }) => Err(failure),
        }
    }
}
