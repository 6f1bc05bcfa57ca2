//! `curitiba merge`: joins parts of a benchmark, and puts machines side by side.

use super::bench_table::Table;
use super::{Failure, failure, table};
use clap::{Args, ValueHint};
use curitiba::args::parse_bytes;
use curitiba::bench::merge::{Merged, merge};
use curitiba::bench::model::BenchFile;
use curitiba::bench::{FileError, columns};
use curitiba::pipeline::files::{check_outputs, record_files_read};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Greatest number of missing rows that are printed.
const MOST_PRINTED: usize = 50;

/// Arguments of `merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// The benchmark of all of them
    #[arg(value_name = "OUT.json", value_hint = ValueHint::FilePath)]
    pub output: PathBuf,
    /// Folders of parts, parts, or whole benchmarks
    #[arg(value_name = "PART.json|DIR", value_hint = ValueHint::AnyPath, required = true)]
    pub parts: Vec<PathBuf>,
    /// Replace OUT.json whatever it holds; without this only a merged benchmark is replaced
    #[arg(long)]
    pub overwrite: bool,
    /// Most memory that the program may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

/// Merges, writes, prints, and fails if rows are missing.
pub fn run(args: &MergeArgs) -> Result<(), Failure> {
    check_outputs([(&*args.output, "merged benchmark")])?;
    if !args.overwrite {
        check_ours(&args.output)?;
    }
    // No input file may be replaced.
    record_files_read();
    let Merged { file, missing, warnings } = merge(&args.parts)?;
    check_outputs([(&*args.output, "merged benchmark")])?;
    file.write(&args.output)?;
    warnings.iter().for_each(|warning| failure::print_warning(warning));
    print(&file);
    let count = |number: usize, what: &str| format!("{number} {what}{}", if number == 1 { "" } else { "s" });
    let (rows, machines) = (count(file.rows.len(), "row"), count(file.machines.len(), "machine"));
    crate::say!("wrote {}: {rows} of {machines}", args.output.display());
    if missing.is_empty() {
        return Ok(());
    }
    for row in missing.iter().take(MOST_PRINTED) {
        crate::say!("missing: {} ({}, {})", row.id, row.label, row.view);
    }
    if missing.len() > MOST_PRINTED {
        crate::say!("missing: {} more", missing.len() - MOST_PRINTED);
    }
    let rows = if missing.len() == 1 { "row is" } else { "rows are" };
    Err(Failure::Work(format!(
        "{} {rows} missing\n       run the shards again: they measure what is not there",
        missing.len()
    )))
}

/// Fails if a file would be replaced that is neither empty nor a merged benchmark, such as a part that was named first by mistake.
fn check_ours(path: &Path) -> Result<(), Failure> {
    let help = "name the file to write first, then the parts; --overwrite replaces it";
    match BenchFile::read(path) {
        Ok(None) => Ok(()),
        Ok(Some(file)) if !file.machines.is_empty() => Ok(()),
        Ok(Some(_)) => Err(Failure::Usage(format!(
            "{}: this benchmark was measured, and not merged\n       {help}",
            path.display()
        ))),
        Err(error @ FileError::Io { .. }) => Err(error.into()),
        Err(_) => Err(Failure::Usage(format!("{}: this is no merged benchmark\n       {help}", path.display()))),
    }
}

/// Prints a single machine as `bench` does, and several side by side.
fn print(file: &BenchFile) {
    if let [_] = file.machines[..] {
        let mut table = Table::new(file.rows.iter().map(|row| [row.label.as_str(), &row.view]), file);
        file.rows.iter().for_each(|row| table.print(row));
        table.end(file);
        return;
    }
    let all = file.rows.iter().map(|row| &row.key).collect::<BTreeSet<_>>().len();
    for (index, machine) in file.machines.iter().enumerate() {
        let own = file.rows.iter().filter(|row| row.machine == index).map(|row| &row.key);
        let rows = own.collect::<BTreeSet<_>>().len();
        crate::say!("({}) {}, commit {}: {rows} of {all} rows", index + 1, machine.machine(), machine.commit);
    }
    table::print_aligned(&columns::table(file), 3);
    for missing in &file.unavailable {
        crate::say!("not measured: {}: {}", missing.what, missing.why);
    }
}
