//! Merging benchmarks: joins parts, and puts machines side by side.
//!
//! Nothing is averaged. Rows from different machines stay separate, and so do repeated measurements of one machine. The result
//! depends only on the rows, and not on how they were distributed over files.

use super::model::{BenchFile, BenchRow, Inputs, RowError};
use super::part::{self, Difference, LIST, ListedRow, PartError, RowList};
use crate::environment::Environment;
use crate::pipeline::files;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::{Path, PathBuf};

/// Greatest number of files of a folder that are merged.
const MOST_PARTS: usize = 1_000_000;

/// A benchmark to be merged, with the path of its file.
struct Source {
    path: PathBuf,
    file: BenchFile,
}

/// Result of a merge.
#[derive(Debug, Clone)]
pub struct Merged {
    /// The benchmark. Its rows have the order of the list; rows with the same key have the order of the machines.
    pub file: BenchFile,
    /// Rows that no machine has measured.
    pub missing: Vec<ListedRow>,
    /// Findings that may not be intended.
    pub warnings: Vec<String>,
}

/// Merges benchmarks, given as folders of parts, as single parts, or as whole files.
///
/// # Errors
/// At the first file that cannot be read, is no benchmark, or differs from the others in command, numbers of frames, build, list of rows,
/// project, scenes or references.
pub fn merge(paths: &[PathBuf]) -> Result<Merged, PartError> {
    let (files, folders) = named(paths)?;
    let mut sources: Vec<Source> = files.into_par_iter().map(read).collect::<Result<_, _>>()?;
    let list = list(&sources, folders)?;
    check(&sources, list.as_ref())?;
    let mut warnings = interrupted(&sources);
    let (machines, places) = machines(&sources);
    let order: HashMap<&str, usize> =
        list.iter().flat_map(|list| &list.rows).enumerate().map(|(index, row)| (row.key.as_str(), index)).collect();
    let missing = missing(list.as_ref(), &sources);
    let whole = missing.is_empty() && sources.iter().all(|source| source.file.complete);
    let rows = take_rows(&mut sources, &machines, &order);
    warnings.extend(repeated(&rows, &machines));
    warnings.extend(machines.first().and_then(changed));
    let Some(first) = sources.first() else {
        return Err(PartError::Io {
            path: paths.first().cloned().unwrap_or_default(),
            message: "it holds no parts".to_owned(),
        });
    };
    let mut unavailable = Vec::new();
    for item in places.iter().flat_map(|index| &sources[*index].file.unavailable) {
        if !unavailable.contains(item) {
            unavailable.push(item.clone());
        }
    }
    let file = BenchFile {
        started_unix_s: sources.iter().map(|source| source.file.started_unix_s).min().unwrap_or(0),
        environment: machines[0].clone(),
        complete: whole,
        rows,
        unavailable,
        machines,
        part: None,
        ..first.file.clone()
    };
    Ok(Merged { file, missing, warnings })
}

fn io_error(path: &Path, error: &io::Error) -> PartError {
    PartError::Io { path: path.to_owned(), message: error.to_string() }
}

/// The named files, sorted by name within each folder, and all folders that may contain a list.
fn named(paths: &[PathBuf]) -> Result<(Vec<PathBuf>, Vec<PathBuf>), PartError> {
    let (mut found, mut folders) = (Vec::new(), Vec::new());
    for path in paths {
        if !path.is_dir() {
            found.push(path.clone());
            continue;
        }
        files::check_place(path).map_err(|error| io_error(path, &error))?;
        let entries = std::fs::read_dir(path).map_err(|error| io_error(path, &error))?;
        let mut parts = Vec::new();
        for entry in entries.take(MOST_PARTS) {
            let part = entry.map_err(|error| io_error(path, &error))?.path();
            let is_json = part.extension().is_some_and(|extension| extension == "json");
            if is_json && part.file_name().is_some_and(|name| name != LIST) {
                parts.push(part);
            }
        }
        parts.sort();
        found.extend(parts);
        folders.push(path.clone());
    }
    Ok((found, folders))
}

fn read(path: PathBuf) -> Result<Source, PartError> {
    match part::read(&path)? {
        Some(file) => Ok(Source { path, file }),
        None => Err(PartError::Io { path, message: "there is no such file or folder".to_owned() }),
    }
}

/// The list of all rows, if there are parts; all folders must have the same list.
fn list(sources: &[Source], mut folders: Vec<PathBuf>) -> Result<Option<RowList>, PartError> {
    for source in sources.iter().filter(|source| source.file.part.is_some()) {
        let folder = source.path.parent().unwrap_or(Path::new("")).to_owned();
        if !folders.contains(&folder) {
            folders.push(folder);
        }
    }
    let mut first: Option<(RowList, PathBuf)> = None;
    for folder in folders {
        let path = folder.join(LIST);
        let Some(list) = RowList::read(&folder)? else {
            let has_parts = |s: &Source| s.file.part.is_some() && s.path.parent() == Some(&folder);
            if sources.iter().any(has_parts) {
                let message = format!("the list of all rows is missing; copy {LIST} with the parts");
                return Err(PartError::Io { path, message });
            }
            continue;
        };
        match &first {
            None => first = Some((list, path)),
            Some((known, by)) => {
                if let Some((field, found, wanted)) = known.differs_from(&list) {
                    return Err(other(&path, &field, found, wanted, by));
                }
            }
        }
    }
    Ok(first.map(|(list, _)| list))
}

fn other(path: &Path, field: &str, found: String, wanted: String, by: &Path) -> PartError {
    let difference = Difference {
        path: path.to_owned(),
        field: field.to_owned(),
        found,
        wanted,
        wanted_by: format!("in {}", by.display()),
        help: "only parts of one benchmark, measured by one program from one project, are merged".to_owned(),
    };
    difference.into()
}

/// Values that several files must agree on, each with the file that stated it first.
#[derive(Default)]
struct Agreed<'s>(HashMap<String, (String, &'s Path)>);

impl<'s> Agreed<'s> {
    /// Records the value that a file states; fails if another file stated a different one.
    fn note(&mut self, of: String, field: impl Fn() -> String, says: &str, path: &'s Path) -> Result<(), PartError> {
        match self.0.get(&of) {
            None => {
                self.0.insert(of, (says.to_owned(), path));
                Ok(())
            }
            Some((known, _)) if known == says => Ok(()),
            Some((known, by)) => Err(other(path, &field(), says.to_owned(), known.clone(), by)),
        }
    }
}

/// Fails if the benchmarks do not belong together.
fn check(sources: &[Source], list: Option<&RowList>) -> Result<(), PartError> {
    let Some(first) = sources.first() else { return Ok(()) };
    let mut agreed = Agreed::default();
    for Source { path, file } in sources {
        let refuse = |field: &str, found: String, wanted: String| Err(other(path, field, found, wanted, &first.path));
        if file.command != first.file.command {
            return refuse("command", file.command.clone(), first.file.command.clone());
        }
        if let (Some(part), Some(list)) = (&file.part, list) {
            let listed = list.rows.get(part.index).map_or("no such row", |row| &row.id);
            if part.id != listed || part.of != list.rows.len() {
                return refuse(
                    "part",
                    format!("{} of {}", part.id, part.of),
                    format!("{listed} of {}", list.rows.len()),
                );
            }
        }
        if (file.frames, file.warmup) != (first.file.frames, first.file.warmup) {
            let words = |file: &BenchFile| format!("{} after {} of warm-up", file.frames, file.warmup);
            return refuse("frames", words(file), words(&first.file));
        }
        for environment in file.machines.iter().chain([&file.environment]) {
            if let Some((field, found, wanted)) = environment.build_differs_from(&first.file.environment) {
                return refuse(&format!("environment.{field}"), found, wanted);
            }
        }
        for (index, row) in file.rows.iter().enumerate() {
            agree(&mut agreed, row, index, path)?;
        }
    }
    Ok(())
}

/// Checks a row: rows of the same project file must have the same project hash; if their scene attributes are the same too, the same hash
/// of scene contents; and rows with the same key must have the same references.
fn agree<'s>(agreed: &mut Agreed<'s>, row: &BenchRow, index: usize, path: &'s Path) -> Result<(), PartError> {
    let project = row.project.display();
    if let Some(Inputs { project: hash, needs, scenes }) = &row.inputs {
        agreed.note(format!("project {project}"), || format!("rows[{index}].inputs.project"), hash, path)?;
        agreed.note(format!("{needs} of {project}"), || format!("rows[{index}].inputs.scenes"), scenes, path)?;
    }
    if let RowError::Against { key, .. } = &row.error {
        agreed.note(format!("row {}", row.key), || format!("rows[{index}].error.against.key"), key, path)?;
    }
    if let Some(RowError::Against { key, .. }) = &row.picture_error {
        let what = format!("the picture of row {}", row.key);
        agreed.note(what, || format!("rows[{index}].picture_error.against.key"), key, path)?;
    }
    Ok(())
}

/// Warnings about whole benchmarks that were interrupted or have failed rows.
fn interrupted(sources: &[Source]) -> Vec<String> {
    let cut = sources.iter().filter(|source| !source.file.complete);
    cut.map(|source| {
        format!(
            "{}: this benchmark was interrupted, or rows of it failed: rows that it lacks are not known",
            source.path.display()
        )
    })
    .collect()
}

/// The machines, sorted by their descriptions, and the indices of the sources, sorted by machine.
fn machines(sources: &[Source]) -> (Vec<Environment>, Vec<usize>) {
    let mut machines: Vec<Environment> = Vec::new();
    for source in sources {
        let of = if source.file.machines.is_empty() {
            std::slice::from_ref(&source.file.environment)
        } else {
            &source.file.machines
        };
        for environment in of {
            match machines.iter_mut().find(|known| known.same_machine(environment)) {
                None => machines.push(environment.clone()),
                Some(known) => join(known, environment),
            }
        }
    }
    machines.sort_by_cached_key(|machine| (machine.machine(), machine.platform.clone(), machine.driver.clone()));
    let place = |index: &usize| {
        let environment = &sources[*index].file.environment;
        machines.iter().position(|machine| machine.same_machine(environment))
    };
    let mut places: Vec<usize> = (0..sources.len()).collect();
    places.sort_by_cached_key(place);
    (machines, places)
}

/// Merges what was recorded of one machine: the highest load, and all fallbacks.
fn join(known: &mut Environment, other: &Environment) {
    known.load_average = match (known.load_average, other.load_average) {
        (Some(a), Some(b)) => Some(a.max(b)),
        (a, b) => a.or(b),
    };
    for fallback in &other.fallbacks {
        if !known.fallbacks.contains(fallback) {
            known.fallbacks.push(fallback.clone());
        }
    }
}

/// Moves all rows out of the sources, and sets their machines. Rows are in the order of the list; rows that the list lacks follow, in the order
/// of the sources. Rows with the same key are ordered by machine, then in the order of the sources.
fn take_rows(sources: &mut [Source], machines: &[Environment], order: &HashMap<&str, usize>) -> Vec<BenchRow> {
    let mut unlisted: HashMap<String, usize> = HashMap::new();
    let mut rows: Vec<(usize, BenchRow)> = Vec::new();
    for source in sources {
        for row in std::mem::take(&mut source.file.rows) {
            let environment = source.file.environment_of(&row);
            let machine = machines.iter().position(|machine| machine.same_machine(environment)).unwrap_or(0);
            let next = order.len() + unlisted.len();
            let place = match order.get(row.key.as_str()) {
                Some(place) => *place,
                None => *unlisted.entry(row.key.clone()).or_insert(next),
            };
            rows.push((place, BenchRow { machine, ..row }));
        }
    }
    rows.sort_by_key(|(place, row)| (*place, row.machine));
    rows.into_iter().map(|(_, row)| row).collect()
}

/// Warnings about rows that one machine measured more than once.
fn repeated(rows: &[BenchRow], machines: &[Environment]) -> Vec<String> {
    let mut times: BTreeMap<(usize, &str), usize> = BTreeMap::new();
    for row in rows {
        *times.entry((row.machine, &row.key)).or_default() += 1;
    }
    let several = times.into_iter().filter(|(_, times)| *times > 1);
    several
        .map(|((machine, key), times)| {
            format!("{}: measured {times} times, and all are kept: {key}", machines[machine].machine())
        })
        .collect()
}

/// A warning if the commit of the build is unknown, or the build had uncommitted changes.
fn changed(machine: &Environment) -> Option<String> {
    let unsure = machine.commit == "unknown" || machine.commit.ends_with("-dirty");
    unsure.then(|| format!("the commit is `{}`: whether all were measured by one program is not known", machine.commit))
}

/// The rows of the list that no source contains, neither with a measurement nor with a reason why there is none.
fn missing(list: Option<&RowList>, sources: &[Source]) -> Vec<ListedRow> {
    let Some(list) = list else { return Vec::new() };
    let mut there = vec![false; list.rows.len()];
    let index: HashMap<&str, usize> = list.rows.iter().enumerate().map(|(i, row)| (row.key.as_str(), i)).collect();
    for Source { file, .. } in sources {
        let part = file.part.as_ref().map(|part| part.index);
        for found in part.into_iter().chain(file.rows.iter().filter_map(|row| index.get(row.key.as_str()).copied())) {
            if let Some(there) = there.get_mut(found) {
                *there = true;
            }
        }
    }
    list.rows.iter().zip(there).filter(|(_, there)| !there).map(|(row, _)| row.clone()).collect()
}
