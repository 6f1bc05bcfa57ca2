//! Decides which variants are measured, and how often.

use super::choose::{Goal, Trial, ranked};
use super::{Machine, Run, Variant};

/// Number of combinations of several passes that are measured: those with the best estimates.
const COMBINATIONS: usize = 6;
/// Number of combinations above which only the promising ones are estimated further.
const MANY: usize = 2_000;
/// Number of best variants that are measured again: the chosen one and the two next best.
const FINALISTS: usize = 3;
/// Number of further runs of each finalist in a round.
const AGAIN: usize = 2;
/// Greatest number of rounds in which the finalists are measured again. The rounds end earlier when the best three stay the same.
const TURNS: usize = 4;

/// Result of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// All measured variants, in the order of measurement.
    pub trials: Vec<Trial>,
    /// Indices of the trials within the goal, the best first; empty if none is.
    pub ranked: Vec<usize>,
    /// Variants that could not be measured, and why.
    pub missing: Vec<(Variant, String)>,
}

/// Measures variants and ranks them. `counts` is the number of candidates of each slot; candidate 0 of each slot is the declared pass. `told` is
/// called with each variant before it is measured.
pub fn search(counts: &[usize], goal: Goal, machine: &mut dyn Machine, told: &mut dyn FnMut(&[usize])) -> Found {
    let mut search = Search { goal, machine, told, trials: Vec::new(), missing: Vec::new() };
    let declared = vec![0; counts.len()];
    search.first(declared.clone());
    for (slot, count) in counts.iter().enumerate() {
        for candidate in 1..*count {
            let mut variant = declared.clone();
            variant[slot] = candidate;
            search.first(variant);
        }
    }
    if counts.len() > 1 {
        search.combinations(counts).into_iter().for_each(|variant| search.first(variant));
    }
    for _ in 0..TURNS {
        let first = |search: &Search<'_>| ranked(&search.trials, goal).into_iter().take(FINALISTS).collect::<Vec<_>>();
        let before = first(&search);
        (0..AGAIN).for_each(|_| before.iter().for_each(|trial| search.again(*trial)));
        if first(&search) == before {
            break;
        }
    }
    let ranked = ranked(&search.trials, goal);
    Found { trials: search.trials, ranked, missing: search.missing }
}

struct Search<'a> {
    goal: Goal,
    machine: &'a mut dyn Machine,
    told: &'a mut dyn FnMut(&[usize]),
    trials: Vec<Trial>,
    missing: Vec<(Variant, String)>,
}

impl Search<'_> {
    fn run(&mut self, variant: &[usize]) -> Option<Run> {
        (self.told)(variant);
        match self.machine.run(variant) {
            Ok(run) => Some(run),
            Err(why) => {
                self.missing.push((variant.to_vec(), why));
                None
            }
        }
    }

    fn first(&mut self, variant: Variant) {
        if let Some(run) = self.run(&variant) {
            self.trials.push(Trial::new(variant, run));
        }
    }

    /// Measures a trial again. A trial that fails now gets an infinite error.
    fn again(&mut self, trial: usize) {
        let variant = self.trials[trial].variant.clone();
        match self.run(&variant) {
            Some(run) => {
                self.trials[trial].frames_ms.extend(run.frames_ms);
                self.trials[trial].error = self.trials[trial].error.max(run.error);
            }
            None => self.trials[trial].error = f64::INFINITY,
        }
    }

    /// The variants with the best estimates among those that change more than one slot. The estimated time is the declared frame's time plus
    /// the difference that each candidate makes. Differences of squared errors are added likewise, as if the errors of passes were independent.
    fn combinations(&self, counts: &[usize]) -> Vec<Variant> {
        let alone = |slot: usize, candidate: usize| {
            self.trials.iter().find(|trial| {
                trial
                    .variant
                    .iter()
                    .enumerate()
                    .all(|(other, index)| *index == if other == slot { candidate } else { 0 })
            })
        };
        let Some(declared) = alone(0, 0) else { return Vec::new() };
        let mut sums = vec![Sum { variant: Vec::new(), time: declared.median(), square: declared.error.powi(2) }];
        for (slot, count) in counts.iter().enumerate() {
            let measured = (0..*count).filter_map(|candidate| Some((candidate, alone(slot, candidate)?)));
            let added = measured.flat_map(|(candidate, trial)| {
                let time = trial.median() - declared.median();
                let square = trial.error.powi(2) - declared.error.powi(2);
                sums.iter().map(move |sum| Sum {
                    variant: [&sum.variant[..], &[candidate]].concat(),
                    time: sum.time + time,
                    square: sum.square + square,
                })
            });
            sums = added.collect();
            if sums.len() > MANY {
                sums = promising(sums);
            }
        }
        let estimates: Vec<Trial> = sums
            .into_iter()
            .filter(|sum| sum.variant.iter().filter(|candidate| **candidate != 0).count() > 1)
            .map(|sum| {
                let run = Run { frames_ms: vec![sum.time.max(0.0)], error: sum.square.max(0.0).sqrt() };
                Trial::new(sum.variant, run)
            })
            .collect();
        let best = ranked(&estimates, self.goal);
        best.into_iter().take(COMBINATIONS).map(|index| estimates[index].variant.clone()).collect()
    }
}

/// Candidates of the first slots, with the estimate for a frame whose other slots are as declared.
struct Sum {
    variant: Variant,
    /// Milliseconds.
    time: f64,
    /// Squared error.
    square: f64,
}

/// Leaves out each sum that [`COMBINATIONS`] others equal or beat in time and in error. They still do with the same candidates in the
/// other slots, so such a sum leads only to combinations that as many others equal or beat. Some of these others may change one pass alone,
/// and have been measured already.
fn promising(mut sums: Vec<Sum>) -> Vec<Sum> {
    sums.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.square.total_cmp(&b.square)));
    // The least squared errors of the sums so far, in ascending order.
    let mut least: Vec<f64> = Vec::new();
    sums.retain(|sum| {
        let place = least.partition_point(|square| *square <= sum.square);
        let stays = place < COMBINATIONS;
        if stays {
            least.insert(place, sum.square);
            least.truncate(COMBINATIONS);
        }
        stays
    });
    sums
}
