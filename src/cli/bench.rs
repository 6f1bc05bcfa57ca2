//! `curitiba bench`: the cost and the error of each effect.

use super::bench_args::BenchArgs;
use super::bench_begin::{begin, check_folder_of_references, check_ours, choices, references_folder};
use super::bench_jobs::{Job, jobs};
use super::bench_rows::{Missing, Rows};
use super::bench_table::Table;
use super::{Failure, bench_parts, bench_threads, load, set_threads, tell_fastest};
use curitiba::bench::model::BenchFile;
use curitiba::bench::{FileError, text};
use curitiba::environment::Environment;
use curitiba::pipeline::files::{check_outputs, write_atomically};

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Other { .. } | FileError::Interrupted { .. } => Self::Usage(error.to_string()),
            FileError::Broken { .. } => Self::Input(error.to_string()),
            _ => Self::work(error),
        }
    }
}

/// Measures row after row; prints and writes each one as soon as it is measured.
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    if !args.sweep_threads.is_empty() {
        return bench_threads::run(args);
    }
    if args.list {
        return bench_parts::list(args);
    }
    set_threads(args.threads)?;
    tell_fastest(args.choice());
    if let Some(folder) = &args.parts {
        return bench_parts::run(args, folder);
    }
    if args.shard.is_some() {
        return Err(Failure::Usage("--shard: --parts DIR names the folder for the rows that are measured".to_owned()));
    }
    let mut file = begin(args);
    let outputs = [(&args.json, "--json"), (&args.csv, "--csv"), (&args.markdown, "--markdown")];
    check_outputs(outputs.iter().filter_map(|(path, what)| Some((path.as_deref()?, *what))))?;
    check_folder_of_references(args)?;
    if !args.overwrite {
        [&args.csv, &args.markdown].into_iter().flatten().try_for_each(|path| check_ours(path, text::is_ours))?;
        if let Some(path) = &args.json {
            file = file.continued(path, args.resume)?;
        }
    }
    let choices = choices(args, args.choice(), &mut file);
    let jobs = jobs(args, &choices)?;
    write(args, &file)?;
    load::tell(&Environment::here());
    let failure = measure_all(args, &jobs, &mut file)?;
    file.complete = failure.is_none() && !choices.is_empty();
    write(args, &file)?;
    if choices.is_empty() {
        return Err(Failure::Work("none of the engines that were asked for is there".to_owned()));
    }
    failure.map_or(Ok(()), Err)
}

/// Measures the rows and rounds that the file lacks. Returns the first failure of a row; the other rows are still measured.
fn measure_all(args: &BenchArgs, jobs: &[Job], file: &mut BenchFile) -> Result<Option<Failure>, Failure> {
    let mut rows = Rows::new(args, references_folder(args));
    let mut table = Table::new(jobs.iter().map(|job| [job.case.label.as_str(), &job.case.view]), file);
    let mut first_failure = None;
    for round in 1..=file.rounds {
        for (index, job) in jobs.iter().enumerate() {
            let place = (index, jobs.len());
            let known = file.rows.iter_mut().find(|row| row.key == job.case.key);
            let measured = match known {
                None if round == 1 => Some(rows.measure(job, place).map(|row| file.rows.push(row))),
                Some(row) if row.frame.n() < (round * file.frames) as usize => {
                    Some(rows.again(job, place, round).map(|more| row.add(&more)))
                }
                // The row has its frames of this round already, or failed in the first round.
                Some(_) | None => None,
            };
            if let Some(row) = file.row(&job.case.key).filter(|_| round == file.rounds) {
                table.print(row);
            }
            let Some(measured) = measured else { continue };
            if let Err(Missing { what, failure }) = measured {
                file.unavailable.push(what);
                if let Some(failure) = failure {
                    first_failure.get_or_insert(failure);
                }
            }
            write(args, file)?;
        }
    }
    table.end(file);
    Ok(first_failure)
}

/// Writes every requested file.
fn write(args: &BenchArgs, file: &BenchFile) -> Result<(), Failure> {
    if let Some(path) = &args.json {
        file.write(path)?;
    }
    for (path, text) in [(&args.csv, text::csv as fn(&BenchFile) -> String), (&args.markdown, text::markdown)] {
        if let Some(path) = path {
            write_atomically(path, text(file).as_bytes())
                .map_err(|error| Failure::Work(format!("{}: {error}", path.display())))?;
        }
    }
    Ok(())
}
