//! Shards: the share of the work units (rows of a benchmark, frames of a path) that one process does.
//!
//! A scheduler starts the processes; this module neither starts nor watches nor repeats anything. Unit `i`, counted from 0, belongs
//! to shard `K` of `N` if `i mod N = K - 1`, so neighbouring units, which often have similar costs, go to different shards.

use std::fmt;
use std::str::FromStr;

/// Largest number of shards.
pub const MOST: u64 = 1_000_000;

/// A shard: every `count`-th unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Index of the shard, from 0, below [`Self::count`].
    pub index: u64,
    /// Number of shards, 1 to [`MOST`].
    pub count: u64,
}

impl Shard {
    /// All the work.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Whether the unit with this index, from 0, belongs to the shard.
    #[must_use]
    pub fn has(self, unit: usize) -> bool {
        unit as u64 % self.count == self.index
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.count)
    }
}

/// Value of `--shard`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// `K/N`: shard K of N.
    Named(Shard),
    /// `auto`: index and number of shards come from the scheduler. `auto/N`: only the index does.
    Auto(Option<u64>),
}

impl FromStr for Request {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is no shard; valid: K/N with K from 1 to N and N up to {MOST}, such as 2/8; auto, auto/N inside a scheduler"
            )
        };
        let number = |text: &str| text.parse::<u64>().ok().filter(|n| (1..=MOST).contains(n)).ok_or_else(wrong);
        match text.split_once('/') {
            None if text == "auto" => Ok(Self::Auto(None)),
            Some(("auto", count)) => Ok(Self::Auto(Some(number(count)?))),
            Some((index, count)) => {
                let (index, count) = (number(index)?, number(count)?);
                if index > count {
                    return Err(wrong());
                }
                Ok(Self::Named(Shard { index: index - 1, count }))
            }
            None => Err(wrong()),
        }
    }
}

/// The task that this process is, according to a scheduler.
struct Task {
    /// The environment variable that gives the index.
    variable: &'static str,
    /// The task's index, counted as the scheduler does.
    index: u64,
    /// Difference between neighbouring indices; 1 if the scheduler does not say.
    step: u64,
    /// Index from 0 and number of tasks, if the scheduler gives both.
    place: Option<Shard>,
}

/// Variables of array jobs with a known range: index, first, last, step, and number of tasks (if there is such a variable).
const ARRAYS: [[&str; 5]; 2] = [
    [
        "SLURM_ARRAY_TASK_ID",
        "SLURM_ARRAY_TASK_MIN",
        "SLURM_ARRAY_TASK_MAX",
        "SLURM_ARRAY_TASK_STEP",
        "SLURM_ARRAY_TASK_COUNT",
    ],
    ["SGE_TASK_ID", "SGE_TASK_FIRST", "SGE_TASK_LAST", "SGE_TASK_STEPSIZE", ""],
];
/// Variables of MPI launchers: rank from 0, and number of processes.
const RANKS: [[&str; 2]; 2] = [["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"], ["PMI_RANK", "PMI_SIZE"]];
/// Variables with an index only, without the number of tasks: PBS, HyperQueue, GNU parallel.
const INDICES: [&str; 3] = ["PBS_ARRAY_INDEX", "HQ_TASK_ID", "PARALLEL_SEQ"];

impl Request {
    /// The requested shard. `variable` looks up an environment variable of the process.
    ///
    /// # Errors
    /// For `auto`: if there is no scheduler, if variables of several schedulers are set, if the scheduler does not give the number of
    /// tasks (use `auto/N` then), or if a variable is no number.
    pub fn resolve(self, variable: impl Fn(&str) -> Option<String>) -> Result<Shard, String> {
        let count = match self {
            Self::Named(shard) => return Ok(shard),
            Self::Auto(count) => count,
        };
        let mut tasks = tasks(&variable)?;
        // A launcher that starts a single process inside a task of an array carries no information.
        let says = |task: &Task| task.place.is_none_or(|place| place.count > 1);
        if tasks.iter().any(says) {
            tasks.retain(says);
        } else {
            tasks.truncate(1);
        }
        let task = match &tasks[..] {
            [] => {
                return Err(format!(
                    "--shard auto: no scheduler is here; write --shard K/N, or start this by one that sets {}",
                    ARRAYS
                        .iter()
                        .map(|names| names[0])
                        .chain(RANKS.iter().map(|names| names[0]))
                        .chain(INDICES)
                        .collect::<Vec<_>>()
                        .join(", ")
                ));
            }
            [task] => task,
            several => {
                let names: Vec<&str> = several.iter().map(|task| task.variable).collect();
                return Err(format!(
                    "--shard auto: {} are all set, and each may be meant; write --shard K/N with the one that is",
                    names.join(" and ")
                ));
            }
        };
        match (count, task.place) {
            // N consecutive tasks of an array give each of the N shards once, whatever index the array starts at. A task that
            // runs again alone has the same shard, if the step is 1.
            (Some(count), _) => Ok(Shard { index: (task.index / task.step % count + count - 1) % count, count }),
            (None, Some(place)) => Ok(place),
            (None, None) => Err(format!(
                "--shard auto: {} does not say how many tasks there are, or they leave gaps; write --shard auto/N with N indices in a row, or K/N",
                task.variable
            )),
        }
    }
}

/// The tasks that environment variables describe.
fn tasks(variable: &impl Fn(&str) -> Option<String>) -> Result<Vec<Task>, String> {
    // Where a variable does not apply, schedulers give it an empty value or `undefined`.
    let set = |name: &str| variable(name).filter(|value| !value.is_empty() && value != "undefined");
    let number = |name: &str| match set(name) {
        None => Ok(None),
        Some(value) => value
            .parse::<u64>()
            .map(Some)
            .map_err(|_| format!("--shard auto: {name} is `{value}`, which is no number; write --shard K/N")),
    };
    let mut tasks = Vec::new();
    for [index, first, last, step, count] in ARRAYS {
        let Some(value) = number(index)? else { continue };
        let (first, last, step) = (number(first)?, number(last)?, number(step)?.filter(|step| *step > 0));
        let place = place(value, first, last, step, number(count)?);
        tasks.push(Task { variable: index, index: value, step: step.unwrap_or(1), place });
    }
    for [rank, size] in RANKS {
        let Some(index) = number(rank)? else { continue };
        let place = number(size)?.filter(|count| index < *count && *count <= MOST).map(|count| Shard { index, count });
        tasks.push(Task { variable: rank, index, step: 1, place });
    }
    for name in INDICES {
        tasks.extend(number(name)?.map(|index| Task { variable: name, index, step: 1, place: None }));
    }
    Ok(tasks)
}

/// Place of an index in an array; the step is above 0. `None` if a value is missing, or the array has gaps, such as when only some
/// of its tasks run again.
fn place(index: u64, first: Option<u64>, last: Option<u64>, step: Option<u64>, count: Option<u64>) -> Option<Shard> {
    let (first, last, step) = (first?, last?, step?);
    let tasks = last.checked_sub(first)? / step + 1;
    let offset = index.checked_sub(first)?;
    let whole = count.is_none_or(|count| count == tasks) && tasks <= MOST;
    (whole && offset.is_multiple_of(step) && index <= last).then_some(Shard { index: offset / step, count: tasks })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn resolved(request: &str, variables: &[(&str, String)]) -> Result<Shard, String> {
        let variables: HashMap<&str, &String> = variables.iter().map(|(name, value)| (*name, value)).collect();
        request.parse::<Request>().expect("valid").resolve(|name| variables.get(name).map(|value| (*value).clone()))
    }

    /// Asserts that the shards cover each of 97 units exactly once.
    #[track_caller]
    fn partition(shards: &[Shard]) {
        for unit in 0..97 {
            assert_eq!(shards.iter().filter(|shard| shard.has(unit)).count(), 1, "unit {unit} of {shards:?}");
        }
    }

    #[test]
    fn shards_are_a_partition_for_every_number_and_scheduler() {
        let pair = |name: &'static str, value: u64| (name, value.to_string());
        for n in 1..=64_u64 {
            let all = |request: &str, variables: &dyn Fn(u64) -> Vec<(&'static str, String)>| -> Vec<Shard> {
                (0..n)
                    .map(|k| resolved(request, &variables(k)).unwrap_or_else(|error| panic!("{n}: {error}")))
                    .collect()
            };
            partition(&(1..=n).map(|k| resolved(&format!("{k}/{n}"), &[]).expect("a shard")).collect::<Vec<_>>());
            for (first, step) in [(0, 1), (1, 1), (5, 3), (0, 2)] {
                let slurm = |k: u64| {
                    vec![
                        pair("SLURM_ARRAY_TASK_ID", first + k * step),
                        pair("SLURM_ARRAY_TASK_MIN", first),
                        pair("SLURM_ARRAY_TASK_MAX", first + (n - 1) * step),
                        pair("SLURM_ARRAY_TASK_STEP", step),
                        pair("SLURM_ARRAY_TASK_COUNT", n),
                    ]
                };
                partition(&all("auto", &slurm));
                partition(&all(&format!("auto/{n}"), &slurm));
                // Each task of the array starts a single process with a launcher.
                partition(&all("auto", &|k| [slurm(k), vec![pair("PMI_RANK", 0), pair("PMI_SIZE", 1)]].concat()));
                let grid_engine = |k: u64| {
                    vec![
                        pair("SGE_TASK_ID", first + k * step),
                        pair("SGE_TASK_FIRST", first),
                        pair("SGE_TASK_LAST", first + (n - 1) * step),
                        pair("SGE_TASK_STEPSIZE", step),
                    ]
                };
                partition(&all("auto", &grid_engine));
                partition(&all(&format!("auto/{n}"), &grid_engine));
            }
            for [rank, size] in RANKS {
                partition(&all("auto", &|k| vec![pair(rank, k), pair(size, n)]));
            }
            for name in INDICES {
                for first in [0, 1, 7] {
                    partition(&all(&format!("auto/{n}"), &|k| vec![pair(name, first + k)]));
                }
            }
        }
    }

    #[test]
    fn what_is_no_shard_is_refused_with_what_would_be() {
        for text in
            ["", "3", "0/3", "4/3", "1/0", "-1/3", "1/3/5", "auto/0", "auto/x", "1/1000001", "1/99999999999999999999"]
        {
            let error = text.parse::<Request>().expect_err(text);
            assert!(error.contains("K/N"), "{error}");
        }
        assert_eq!("3/3".parse(), Ok(Request::Named(Shard { index: 2, count: 3 })));
        assert_eq!(Shard { index: 2, count: 3 }.to_string(), "3/3");
    }

    #[test]
    fn an_environment_that_does_not_say_is_refused() {
        let of = |name: &'static str, value: &str| (name, value.to_owned());
        let slurm = |id: &str, max: &str, count: &str| {
            [of("SLURM_ARRAY_TASK_ID", id), of("SLURM_ARRAY_TASK_MIN", "1"), of("SLURM_ARRAY_TASK_MAX", max)]
                .into_iter()
                .chain([of("SLURM_ARRAY_TASK_STEP", "1"), of("SLURM_ARRAY_TASK_COUNT", count)])
                .collect::<Vec<_>>()
        };
        let fails = |request: &str, variables: &[(&str, String)], words: &[&str]| {
            let error = resolved(request, variables).expect_err(request);
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        };
        fails("auto", &[], &["no scheduler", "SLURM_ARRAY_TASK_ID", "PARALLEL_SEQ"]);
        fails("auto/8", &[], &["no scheduler"]);
        fails("auto", &[of("PARALLEL_SEQ", "3")], &["PARALLEL_SEQ", "auto/N"]);
        fails("auto", &[of("PARALLEL_SEQ", "three")], &["`three`"]);
        fails("auto", &[of("PMI_RANK", "8"), of("PMI_SIZE", "8")], &["PMI_RANK"]);
        fails(
            "auto",
            &[&slurm("1", "8", "8")[..], &[of("PARALLEL_SEQ", "3")]].concat(),
            &["SLURM", "and PARALLEL_SEQ"],
        );
        // Only tasks 1, 5 and 7.
        fails("auto", &slurm("5", "7", "3"), &["leave gaps"]);
        assert_eq!(resolved("auto", &slurm("5", "8", "8")), Ok(Shard { index: 4, count: 8 }));
        // Task 5 of 8 alone, as it is queued again after a failure.
        let alone = [
            of("SLURM_ARRAY_TASK_ID", "5"),
            of("SLURM_ARRAY_TASK_MIN", "5"),
            of("SLURM_ARRAY_TASK_MAX", "5"),
            of("SLURM_ARRAY_TASK_STEP", "1"),
            of("SLURM_ARRAY_TASK_COUNT", "1"),
        ];
        assert_eq!(resolved("auto/8", &alone), Ok(Shard { index: 4, count: 8 }));
        // Outside arrays, schedulers give these variables an empty value or `undefined`.
        assert_eq!(
            resolved("auto/4", &[of("SGE_TASK_ID", "undefined"), of("HQ_TASK_ID", ""), of("PARALLEL_SEQ", "4")]),
            Ok(Shard { index: 3, count: 4 })
        );
        let alone = [&slurm("1", "1", "1")[..], &[of("PMI_RANK", "0"), of("PMI_SIZE", "1")]].concat();
        assert_eq!(resolved("auto", &alone), Ok(Shard::WHOLE));
    }
}
