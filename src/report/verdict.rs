//! Which technique an effect should use: the cheapest setting within an error, from the intervals of the measured times.

use super::model::{Effect, ReportData, Section};
use crate::bench::Interval;
use crate::bench::model::{BenchRow, RowError, Technique};

/// Time of a frame at 60 frames a second, milliseconds.
pub const FRAME_60_MS: f64 = 1000.0 / 60.0;

/// Two settings are told apart where one surely takes this many times as long as the other.
const APART: f64 = 1.1;

/// A setting helps where its error is at most this share of the error of a frame without the effect.
const HELPS: f64 = 0.5;

/// One setting as the choice sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// By rays or by raster.
    pub technique: Technique,
    /// The row's label.
    pub label: String,
    /// Times of whole frames, milliseconds.
    pub frames_ms: Vec<f64>,
    /// Their median.
    pub frame_ms: f64,
    /// Its error, or why it has none.
    pub error: Result<Quality, String>,
}

/// Error of a candidate's picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Root mean square error.
    pub rmse: f64,
    /// Mean FLIP error.
    pub flip: f64,
    /// Root mean square error of the reference: smaller differences mean nothing.
    pub own_error: f64,
}

impl Quality {
    /// The error as far as the reference can tell it.
    #[must_use]
    pub fn known(self) -> f64 {
        self.rmse.max(self.own_error)
    }
}

/// What to do with an effect.
#[derive(Debug, Clone, PartialEq)]
pub enum Advice {
    /// The cheapest setting within the error; the other technique is surely slower, or has no setting within it.
    Choose {
        /// What to use.
        best: Candidate,
        /// The cheapest setting of the other technique within the error, and how many times as long it takes.
        other: Option<(Candidate, Interval)>,
    },
    /// Both techniques have a setting within the error, and neither is surely cheaper.
    NoDifference {
        /// The cheapest by rays.
        rays: Candidate,
        /// The cheapest by raster.
        raster: Candidate,
        /// Time by rays divided by time by raster.
        ratio: Interval,
    },
    /// A frame without the effect is within the error already.
    LeaveOut {
        /// The frame without the effect.
        without: Candidate,
    },
    /// No setting is within the error and better than nothing.
    NoneWithin {
        /// The setting with the least error.
        nearest: Candidate,
    },
    /// No setting has an error: the fastest.
    UnknownError(Candidate),
    /// There is no setting at all.
    NotMeasured,
}

/// Whether a frame can be shown in time, by the interval of its median.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fit {
    /// The whole interval is below the limit.
    Yes,
    /// The limit lies in the interval.
    AtTheLimit,
    /// The whole interval is above the limit.
    No,
}

/// Advice for one effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Which effect.
    pub effect: Effect,
    /// What to do.
    pub advice: Advice,
}

impl Verdict {
    /// The setting that the advice is about: of two that are equal, the one with the lower median.
    #[must_use]
    pub fn setting(&self) -> Option<&Candidate> {
        match &self.advice {
            Advice::Choose { best, .. } => Some(best),
            Advice::NoDifference { rays, raster, .. } => {
                Some(if rays.frame_ms <= raster.frame_ms { rays } else { raster })
            }
            Advice::LeaveOut { without } => Some(without),
            Advice::NoneWithin { nearest } => Some(nearest),
            Advice::UnknownError(fastest) => Some(fastest),
            Advice::NotMeasured => None,
        }
    }
}

impl Candidate {
    /// Whether its frames can be shown every `limit_ms` milliseconds.
    #[must_use]
    pub fn fit(&self, limit_ms: f64) -> Fit {
        match Interval::of_median(&self.frames_ms) {
            Some(interval) if interval.high <= limit_ms => Fit::Yes,
            Some(interval) if interval.low > limit_ms => Fit::No,
            _ => Fit::AtTheLimit,
        }
    }
}

/// Decides for each effect of the report. `within` is the root mean square error that is allowed.
#[must_use]
pub fn verdicts(data: &ReportData, within: f64) -> Vec<Verdict> {
    let verdict = |effect| {
        let candidates = data.section(effect).map(|section| candidates(data, section)).unwrap_or_default();
        let without = data.section(effect).and_then(|section| without(data, section));
        Verdict { effect, advice: advise(&candidates, without.as_ref(), within) }
    };
    Effect::ALL.into_iter().map(verdict).collect()
}

/// The measured settings of a section.
#[must_use]
pub fn candidates(data: &ReportData, section: &Section) -> Vec<Candidate> {
    data.settings(section).map(|(_, row)| candidate(row)).collect()
}

/// A frame without a section's effect, as a candidate; `None` where it or its error was not measured.
#[must_use]
pub fn without(data: &ReportData, section: &Section) -> Option<Candidate> {
    let without = section.without.as_ref()?;
    let row = data.row(&without.row)?;
    let candidate = Candidate { error: quality(&without.error), ..candidate(row) };
    candidate.error.is_ok().then_some(candidate)
}

fn candidate(row: &BenchRow) -> Candidate {
    let (technique, label, frames_ms) = (row.technique, row.label.clone(), row.frame.samples.clone());
    Candidate { technique, label, frames_ms, frame_ms: row.frame.median, error: quality(&row.error) }
}

fn quality(error: &RowError) -> Result<Quality, String> {
    match error {
        RowError::Against { own_error, comparison, .. } => {
            Ok(Quality { rmse: comparison.rmse, flip: comparison.flip, own_error: *own_error })
        }
        RowError::Missing(why) => Err(why.clone()),
    }
}

/// The cheapest setting whose error is at most `within` and at most half of that of a frame `without` the effect. The cheapest
/// of the two techniques are compared by the interval of the ratio of their times: only where all of it is beyond a tenth is
/// one of them the cheaper.
#[must_use]
pub fn advise(candidates: &[Candidate], without: Option<&Candidate>, within: f64) -> Advice {
    let error = |candidate: &Candidate| candidate.error.as_ref().ok().map(|quality| quality.known());
    let plain = without.and_then(error);
    if let Some(without) = without.filter(|_| plain.is_some_and(|plain| plain <= within)) {
        return Advice::LeaveOut { without: without.clone() };
    }
    let known: Vec<(&Candidate, f64)> =
        candidates.iter().filter_map(|candidate| Some((candidate, error(candidate)?))).collect();
    let nearest = known.iter().min_by(|(a, x), (b, y)| x.total_cmp(y).then(a.frame_ms.total_cmp(&b.frame_ms)));
    let Some((nearest, _)) = nearest else {
        let fastest = candidates.iter().min_by(|a, b| a.frame_ms.total_cmp(&b.frame_ms));
        return fastest.map_or(Advice::NotMeasured, |fastest| Advice::UnknownError(fastest.clone()));
    };
    let most = plain.map_or(within, |plain| within.min(plain * HELPS));
    let cheapest = |technique| {
        let within = known.iter().filter(|(candidate, error)| candidate.technique == technique && *error <= most);
        within.map(|(candidate, _)| *candidate).min_by(|a, b| a.frame_ms.total_cmp(&b.frame_ms))
    };
    match (cheapest(Technique::Rays), cheapest(Technique::Raster)) {
        (Some(rays), Some(raster)) => compare(rays, raster),
        (Some(best), None) | (None, Some(best)) => Advice::Choose { best: best.clone(), other: None },
        (None, None) => Advice::NoneWithin { nearest: (*nearest).clone() },
    }
}

fn compare(rays: &Candidate, raster: &Candidate) -> Advice {
    let choose = |best: &Candidate, other: &Candidate, ratio| Advice::Choose {
        best: best.clone(),
        other: Some((other.clone(), ratio)),
    };
    match Interval::of_ratio(&rays.frames_ms, &raster.frames_ms) {
        Some(ratio) if ratio.low > APART => choose(raster, rays, ratio),
        Some(ratio) if ratio.high < 1.0 / APART => {
            choose(rays, raster, Interval { low: 1.0 / ratio.high, high: 1.0 / ratio.low })
        }
        ratio => Advice::NoDifference {
            rays: rays.clone(),
            raster: raster.clone(),
            // Times that are no numbers tell nothing.
            ratio: ratio.unwrap_or(Interval { low: 0.0, high: f64::INFINITY }),
        },
    }
}

/// Whether a candidate is beaten by none: nothing else is at least as fast and as exact, and better in one of both.
/// Candidates without an error are never on the front. In the order of `candidates`.
#[must_use]
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let beats = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
    points.iter().map(|point| !points.iter().any(|other| beats(other, point))).collect()
}

/// What is to be said in a cell.
#[must_use]
pub fn verb(advice: &Advice) -> &'static str {
    match advice {
        Advice::Choose { best, .. } => match best.technique {
            Technique::Rays => "trace",
            Technique::Raster => "rasterise",
            Technique::None => "leave out",
        },
        Advice::NoDifference { .. } => "no difference here",
        Advice::LeaveOut { .. } => "leave out",
        Advice::NoneWithin { .. } => "none is within it",
        Advice::UnknownError(_) => "errors are not known",
        Advice::NotMeasured => "not measured",
    }
}
