//! Confidence intervals of medians and of ratios of medians, by the bootstrap: the samples are resampled with replacement many
//! times, and the interval holds the middle 95 % of the resampled values (Efron, "Bootstrap methods: another look at the
//! jackknife", 1979).
//!
//! Intervals from few samples are too narrow: for 5 samples they contain the true median in about 9 of 10 cases, for 15 in 94 of
//! 100. Samples of several rounds are resampled in two steps, rounds and then the samples of each (Davison and Hinkley, "Bootstrap
//! methods and their application", 1997, section 3.8).
//!
//! Intervals of the median of independent values of any distribution need no resampling: they lie between two of the values in order. The
//! smallest and the largest of 6 values hold the median with a probability of 1 - 2 / 2^6 = 96.9 % (Thompson, "On confidence ranges for
//! the median and other expectation distributions for populations of unknown distribution form", Annals of Mathematical Statistics 7,
//! 1936).

use crate::pipeline::executor::median;
use serde::{Deserialize, Serialize};

/// Number of resamplings for one interval.
const DRAWS: usize = 2000;
/// Share of the resampled values below the interval, and the share above it.
const TAIL: f64 = 0.025;

/// Least number of values whose smallest and largest hold the median with 95 % probability.
pub const LEAST_ORDERED: usize = 6;

/// A 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end, at least [`Self::low`].
    pub high: f64,
}

impl Interval {
    /// Interval of the median of `samples`. Deterministic: equal samples give equal intervals. `None` if there are no samples, or
    /// one is not finite.
    #[must_use]
    pub fn of_median(samples: &[f64]) -> Option<Self> {
        Self::of(draw_medians(samples, 1)?)
    }

    /// [`Self::of_median`] of the samples of all rounds: rounds are resampled, and then the samples of each. `None` if there are no
    /// samples, or one is not finite.
    #[must_use]
    pub fn of_rounds(rounds: &[&[f64]]) -> Option<Self> {
        if let [only] = rounds {
            return Self::of_median(only);
        }
        if rounds.is_empty() || rounds.iter().any(|round| !are_finite(round)) {
            return None;
        }
        let mut random = SplitMix(3);
        let draw = |_| {
            let mut drawn = Vec::new();
            for _ in rounds {
                let round = rounds[random.below(rounds.len())];
                drawn.extend((0..round.len()).map(|_| round[random.below(round.len())]));
            }
            median(&drawn)
        };
        Self::of((0..DRAWS).map(draw).collect())
    }

    /// Interval of the median of the distribution of `values`, by their order: from the k-th smallest to the k-th largest, with the largest k
    /// that leaves a probability of at least 95 %. The values must be independent; their distribution does not matter. `None` if one is not
    /// finite, or for more than 1000 values, whose probabilities cannot be represented. `None` also for fewer than [`LEAST_ORDERED`] values,
    /// where even the smallest and the largest do not suffice.
    #[must_use]
    pub fn of_ordered(values: &[f64]) -> Option<Self> {
        if !(LEAST_ORDERED..=1000).contains(&values.len()) || !are_finite(values) {
            return None;
        }
        let mut ordered = values.to_vec();
        ordered.sort_unstable_by(f64::total_cmp);
        let n = ordered.len();
        // `below` is the probability that at most `k` of the `n` values are below the median, for `k` from 0 on.
        let mut term = 0.5_f64.powi(n as i32);
        let (mut below, mut k) = (term, 0);
        while below <= TAIL && 2 * (k + 1) <= n {
            k += 1;
            term *= (n - k + 1) as f64 / k as f64;
            below += term;
        }
        let k = k.max(1);
        Some(Self { low: ordered[k - 1], high: ordered[n - k] })
    }

    /// Interval of the median of `a` divided by the median of `b`; all samples must be above 0. `None` if either has no interval.
    #[must_use]
    pub fn of_ratio(a: &[f64], b: &[f64]) -> Option<Self> {
        let (a, b) = (draw_medians(a, 1)?, draw_medians(b, 2)?);
        Self::of(a.iter().zip(&b).map(|(a, b)| a / b).collect())
    }

    /// Whether a value lies in the interval, ends included.
    #[must_use]
    pub fn holds(self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    fn of(mut draws: Vec<f64>) -> Option<Self> {
        if draws.iter().any(|draw| !draw.is_finite()) {
            return None;
        }
        draws.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| draws[((draws.len() - 1) as f64 * share).round() as usize];
        Some(Self { low: at(TAIL), high: at(1.0 - TAIL) })
    }
}

/// Whether there are samples, all of them finite.
fn are_finite(samples: &[f64]) -> bool {
    !samples.is_empty() && samples.iter().all(|sample| sample.is_finite())
}

/// Medians of [`DRAWS`] resamplings; `None` unless [`are_finite`]. Different streams have different random numbers.
fn draw_medians(samples: &[f64], stream: u64) -> Option<Vec<f64>> {
    if !are_finite(samples) {
        return None;
    }
    let mut random = SplitMix(stream);
    let mut drawn = vec![0.0; samples.len()];
    let draw = |_| {
        drawn.iter_mut().for_each(|value| *value = samples[random.below(samples.len())]);
        median(&drawn)
    };
    Some((0..DRAWS).map(draw).collect())
}

/// Random numbers with a fixed seed, by SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014).
struct SplitMix(u64);

impl SplitMix {
    /// A random number in `0..end`.
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^= mixed >> 31;
        ((u128::from(mixed) * end as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A random sample with median 1 and a distribution like that of times: most are near 1, some far above.
    fn time(random: &mut SplitMix) -> f64 {
        let spread = random.below(2_000_001) as f64 / 1e6 - 1.0;
        if spread > 0.0 { 1.0 + spread * spread } else { 1.0 + 0.1 * spread }
    }

    #[test]
    fn equal_samples_have_an_interval_without_width() {
        assert_eq!(Interval::of_median(&[3.0; 7]), Some(Interval { low: 3.0, high: 3.0 }));
        assert_eq!(Interval::of_ratio(&[6.0; 3], &[2.0; 9]), Some(Interval { low: 3.0, high: 3.0 }));
        assert_eq!(Interval::of_median(&[]), None);
        assert_eq!(Interval::of_median(&[1.0, f64::NAN]), None);
        assert_eq!(Interval::of_ratio(&[1.0], &[0.0]), None);
    }

    #[test]
    fn the_interval_holds_the_true_median_as_often_as_it_says() {
        let mut random = SplitMix(7_000);
        for (samples, expected) in [(5, 850..=970), (15, 910..=975), (45, 925..=975)] {
            let covered = (0..1000).filter(|_| {
                let times: Vec<f64> = (0..samples).map(|_| time(&mut random)).collect();
                Interval::of_median(&times).is_some_and(|interval| interval.holds(1.0))
            });
            let covered = covered.count();
            assert!(expected.contains(&covered), "{covered} of 1000 intervals of {samples} samples");
        }
    }

    #[test]
    fn ordered_values_hold_the_median_from_six_on() {
        let values: Vec<f64> = (1..=20).map(f64::from).collect();
        let of = |n: usize| Interval::of_ordered(&values[..n]).map(|interval| (interval.low, interval.high));
        assert_eq!((of(0), of(5)), (None, None));
        // Ranks as in tables of the sign test.
        assert_eq!((of(6), of(8), of(9)), (Some((1.0, 6.0)), Some((1.0, 8.0)), Some((2.0, 8.0))));
        assert_eq!((of(12), of(20)), (Some((3.0, 10.0)), Some((6.0, 15.0))));
        assert_eq!(Interval::of_ordered(&[1.0, 2.0, 3.0, f64::NAN, 5.0, 6.0]), None);
        let mut random = SplitMix(9_000);
        for n in [6, 9, 12] {
            let covered = (0..2000).filter(|_| {
                let times: Vec<f64> = (0..n).map(|_| time(&mut random)).collect();
                Interval::of_ordered(&times).is_some_and(|interval| interval.holds(1.0))
            });
            let covered = covered.count();
            assert!(covered >= 1880, "{covered} of 2000 intervals of {n} values");
        }
    }

    #[test]
    fn a_machine_that_changes_between_rounds_widens_the_interval() {
        let mut random = SplitMix(10_000);
        let (mut by_rounds, mut by_frames) = (0, 0);
        for _ in 0..500 {
            let rounds: Vec<Vec<f64>> = (0..6)
                .map(|_| {
                    let speed = time(&mut random);
                    (0..5).map(|_| speed * (1.0 + 0.05 * (time(&mut random) - 1.0))).collect()
                })
                .collect();
            let slices: Vec<&[f64]> = rounds.iter().map(Vec::as_slice).collect();
            let holds = |interval: Option<Interval>| usize::from(interval.is_some_and(|interval| interval.holds(1.0)));
            by_rounds += holds(Interval::of_rounds(&slices));
            by_frames += holds(Interval::of_median(&rounds.concat()));
        }
        assert!(by_rounds >= 425, "{by_rounds} of 500");
        assert!(by_frames < 400, "{by_frames} of 500: frames of a round are not independent");
        assert_eq!((Interval::of_rounds(&[]), Interval::of_rounds(&[&[1.0], &[f64::NAN]])), (None, None));
    }

    #[test]
    fn the_interval_of_a_ratio_holds_the_true_ratio() {
        let mut random = SplitMix(8_000);
        let covered = (0..1000).filter(|_| {
            let mut times = |scale: f64| -> Vec<f64> { (0..15).map(|_| scale * time(&mut random)).collect() };
            let (a, b) = (times(3.0), times(2.0));
            Interval::of_ratio(&a, &b).is_some_and(|interval| interval.holds(1.5))
        });
        let covered = covered.count();
        assert!((910..=985).contains(&covered), "{covered} of 1000");
    }
}
