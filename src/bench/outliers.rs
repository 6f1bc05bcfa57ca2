//! Frames whose times are far from the others': outside of Tukey's fences, which are 1.5 and 3 interquartile ranges beyond the
//! quartiles (Tukey, "Exploratory data analysis", 1977). Median and interval hardly notice them; mean and standard deviation do.

use serde::{Deserialize, Serialize};

/// Interquartile ranges from a quartile to the inner fence.
const INNER: f64 = 1.5;
/// Interquartile ranges from a quartile to the outer fence.
const OUTER: f64 = 3.0;

/// Number of outliers among samples.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outliers {
    /// Samples between the inner and the outer fences.
    pub mild: usize,
    /// Samples beyond the outer fences.
    pub severe: usize,
}

impl Outliers {
    /// The outliers among `samples`, fast ones as well as slow ones. Fewer than four samples have none. If more than a quarter of the samples lie
    /// far away on one side, the quartile is one of them, and they are no outliers.
    #[must_use]
    pub fn of(samples: &[f64]) -> Self {
        let mut sorted = samples.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        if sorted.is_empty() {
            return Self::default();
        }
        let (first, third) = (quantile(&sorted, 0.25), quantile(&sorted, 0.75));
        let range = third - first;
        let beyond = |fence: f64| {
            let (low, high) = (first - fence * range, third + fence * range);
            sorted.iter().filter(|sample| **sample < low || **sample > high).count()
        };
        let severe = beyond(OUTER);
        Self { mild: beyond(INNER) - severe, severe }
    }
}

/// The value below which a share of the sorted samples lies, linear between neighbours.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = (sorted.len() - 1) as f64 * share;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - place.floor()) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `more`, and samples from 20 to 28 whose quartiles are at 22 and 26: the inner fences are at 16 and 32, the outer ones at 10 and 38.
    fn with(more: &[f64]) -> Vec<f64> {
        let regular = (20..=28).map(f64::from);
        // Equal numbers of copies of the two quartiles do not move them, and outweigh `more`.
        let steady = [22.0, 26.0].into_iter().cycle().take(2 * more.len() + 200);
        regular.chain(steady).chain(more.iter().copied()).collect()
    }

    #[test]
    fn samples_beyond_the_fences_are_counted_on_both_sides() {
        assert_eq!(Outliers::of(&with(&[])), Outliers { mild: 0, severe: 0 });
        assert_eq!(Outliers::of(&with(&[16.0, 32.0])), Outliers { mild: 0, severe: 0 }, "on the inner fences");
        assert_eq!(Outliers::of(&with(&[15.9, 32.1])), Outliers { mild: 2, severe: 0 });
        assert_eq!(Outliers::of(&with(&[10.0, 38.0])), Outliers { mild: 2, severe: 0 }, "on the outer fences");
        assert_eq!(Outliers::of(&with(&[9.9, 38.1, 33.0, 900.0])), Outliers { mild: 1, severe: 3 });
    }

    #[test]
    fn quartiles_lie_between_samples() {
        let sorted = [1.0, 2.0, 4.0, 8.0, 16.0];
        assert_eq!([0.0, 0.25, 0.5, 0.75, 1.0].map(|share| quantile(&sorted, share)), sorted);
        assert_eq!(quantile(&sorted[..4], 0.25), 1.75);
        assert_eq!(quantile(&[3.0], 0.75), 3.0);
    }

    #[test]
    fn few_samples_have_none_and_one_of_five_can_be_one() {
        assert_eq!(Outliers::of(&[]), Outliers::default());
        assert_eq!(Outliers::of(&[1.0, 1.0, 100.0]), Outliers::default());
        assert_eq!(Outliers::of(&[1.0, 1.1, 1.2, 1.3, 100.0]), Outliers { mild: 0, severe: 1 });
        assert_eq!(Outliers::of(&[1.0, 1.1, 1.2, 100.0, 100.0]), Outliers::default(), "two of five are the rule");
    }

    #[test]
    fn order_does_not_count() {
        let mut samples = with(&[9.0, 33.0]);
        assert_eq!(Outliers::of(&samples), Outliers { mild: 1, severe: 1 });
        samples.reverse();
        assert_eq!(Outliers::of(&samples), Outliers { mild: 1, severe: 1 });
    }
}
