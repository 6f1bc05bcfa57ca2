//! Chooses the technique of each effect: the cheapest setting within an error. Which technique is cheaper is decided only by rounds in which
//! both were measured alternately ([`PairedRounds`]). Rows that were measured one after the other also differ by changes of the
//! machine in the meantime.

use super::model::{Effect, ReportData, Section, Without};
use crate::bench::Interval;
use crate::bench::interval::LEAST_ORDERED;
use crate::bench::model::{BenchRow, PairedRounds, RowError, Technique};
use crate::pipeline::executor::median;

/// Time of a frame at 60 frames a second, milliseconds.
pub const FRAME_60_MS: f64 = 1000.0 / 60.0;

/// One setting counts as cheaper than another only if the whole interval of the ratio of their times is beyond this factor.
const APART: f64 = 1.1;

/// A setting may be the cheapest of its technique if it takes at most this many times as long as the cheapest measured so far. Between
/// two rows that are measured one after the other, the machine's speed may change by as much.
const NEAR: f64 = 1.5;

/// The cheapest setting in paired rounds represents its technique if, in the first measurement, it took at most this many times as long as
/// every other setting. Measurements at different times do not determine the order more precisely.
const STANDS: f64 = 2.0;

/// A setting is useful only if its error is at most this share of the error of a frame without the effect.
const HELPS: f64 = 0.5;

/// A setting with what the choice depends on.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Key of the row.
    pub key: String,
    /// By rays or by raster.
    pub technique: Technique,
    /// The row's label.
    pub label: String,
    /// Median time of a whole frame, milliseconds.
    pub frame_ms: f64,
    /// Confidence interval of that median.
    pub interval: Option<Interval>,
    /// Its error, or the reason why it has none.
    pub error: Result<Quality, String>,
}

/// Error of a candidate's picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Root mean square error.
    pub rmse: f64,
    /// Mean FLIP error.
    pub flip: f64,
    /// Root mean square error of the reference itself; smaller differences are meaningless.
    pub own_error: f64,
}

impl Quality {
    /// The error, or that of the reference if it is larger.
    #[must_use]
    pub fn known(self) -> f64 {
        self.rmse.max(self.own_error)
    }
}

/// Advice for an effect.
#[derive(Debug, Clone, PartialEq)]
pub enum Advice {
    /// The cheapest setting within the error. The other technique is surely slower, or has no setting within the error.
    Choose {
        /// The setting to use.
        best: Candidate,
        /// The other technique's cheapest setting within the error, and the ratio of its time to that of `best`; `None` if it has none.
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
    /// Both techniques have a setting within the error, but there are too few paired rounds to tell which is cheaper.
    NotCertain {
        /// The cheapest setting by rays, as far as known.
        rays: Candidate,
        /// The cheapest setting by raster, as far as known.
        raster: Candidate,
        /// Why there are too few rounds.
        why: String,
    },
    /// A frame without the effect is already within the error.
    LeaveOut {
        /// The frame without the effect.
        without: Candidate,
    },
    /// No setting is within the error and useful.
    NoneWithin {
        /// The setting with the least error.
        nearest: Candidate,
    },
    /// No setting has an error; this is the fastest one.
    UnknownError(Candidate),
    /// No setting of the effect was measured.
    NotMeasured,
}

/// Whether a frame's time is within a limit, by the interval of its median.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fit {
    /// The whole interval is at or below the limit.
    Yes,
    /// The limit lies in the interval, or there is no interval.
    AtTheLimit,
    /// The whole interval is above the limit.
    No,
}

/// Advice for one effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// The effect.
    pub effect: Effect,
    /// The advice.
    pub advice: Advice,
}

impl Verdict {
    /// The setting that the advice is about; of two settings, the one with the lower median time. `None` if no setting was measured.
    #[must_use]
    pub fn setting(&self) -> Option<&Candidate> {
        match &self.advice {
            Advice::Choose { best, .. } => Some(best),
            Advice::NoDifference { rays, raster, .. } | Advice::NotCertain { rays, raster, .. } => {
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
    /// Whether its frame time is within `limit_ms`.
    #[must_use]
    pub fn fit(&self, limit_ms: f64) -> Fit {
        match self.interval {
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
        Verdict { effect, advice: advise(&candidates, without.as_ref(), within, &data.bench.paired) }
    };
    Effect::ALL.into_iter().map(verdict).collect()
}

/// The measured settings of a section.
#[must_use]
pub fn candidates(data: &ReportData, section: &Section) -> Vec<Candidate> {
    data.settings(section).map(|(_, row)| candidate(row)).collect()
}

/// The frame without a section's effect, as a candidate; `None` if it or its error was not measured.
#[must_use]
pub fn without(data: &ReportData, section: &Section) -> Option<Candidate> {
    let without = section.without.as_ref()?;
    without_effect(data.row(&without.row)?, without)
}

/// The row of a frame without an effect, as a candidate; `None` if its error was not measured.
#[must_use]
pub fn without_effect(row: &BenchRow, without: &Without) -> Option<Candidate> {
    let candidate = Candidate { error: quality(&without.error), ..candidate(row) };
    candidate.error.is_ok().then_some(candidate)
}

/// A row as a candidate.
#[must_use]
pub fn candidate(row: &BenchRow) -> Candidate {
    let (key, label, interval) = (row.key.clone(), row.label.clone(), row.frame.interval());
    Candidate { key, technique: row.technique, label, frame_ms: row.frame.median, interval, error: quality(&row.error) }
}

fn quality(error: &RowError) -> Result<Quality, String> {
    match error {
        RowError::Against { own_error, comparison, .. } => {
            Ok(Quality { rmse: comparison.rmse, flip: comparison.flip, own_error: *own_error })
        }
        RowError::Missing(why) => Err(why.clone()),
    }
}

/// The candidates between which paired rounds must decide.
enum Field<'a> {
    /// There are no such candidates: the advice follows without comparing times of different techniques.
    Decided(Box<Advice>),
    /// The settings by rays, and those by raster, that are within the error; the cheapest first.
    Rivals([Vec<&'a Candidate>; 2]),
}

/// Selects the settings whose error is at most `within` and at most half of that of a frame `without` the effect.
fn field<'a>(candidates: &'a [Candidate], without: Option<&Candidate>, within: f64) -> Field<'a> {
    let error = |candidate: &Candidate| candidate.error.as_ref().ok().map(|quality| quality.known());
    let plain = without.and_then(error);
    if let Some(without) = without.filter(|_| plain.is_some_and(|plain| plain <= within)) {
        return Field::Decided(Box::new(Advice::LeaveOut { without: without.clone() }));
    }
    let known: Vec<(&Candidate, f64)> =
        candidates.iter().filter_map(|candidate| Some((candidate, error(candidate)?))).collect();
    let nearest = known.iter().min_by(|(a, x), (b, y)| x.total_cmp(y).then(a.frame_ms.total_cmp(&b.frame_ms)));
    let Some((nearest, _)) = nearest else {
        let fastest = candidates.iter().min_by(|a, b| a.frame_ms.total_cmp(&b.frame_ms));
        let advice = fastest.map_or(Advice::NotMeasured, |fastest| Advice::UnknownError(fastest.clone()));
        return Field::Decided(Box::new(advice));
    };
    let most = plain.map_or(within, |plain| within.min(plain * HELPS));
    let of = |technique| {
        let within = known.iter().filter(|(candidate, error)| candidate.technique == technique && *error <= most);
        let mut found: Vec<&Candidate> = within.map(|(candidate, _)| *candidate).collect();
        found.sort_by(|a, b| a.frame_ms.total_cmp(&b.frame_ms));
        found
    };
    let [rays, raster] = [of(Technique::Rays), of(Technique::Raster)];
    match (rays.first(), raster.first()) {
        (Some(_), Some(_)) => Field::Rivals([rays, raster]),
        (Some(best), None) | (None, Some(best)) => {
            Field::Decided(Box::new(Advice::Choose { best: (*best).clone(), other: None }))
        }
        (None, None) => Field::Decided(Box::new(Advice::NoneWithin { nearest: (*nearest).clone() })),
    }
}

/// The settings that paired rounds must compare: those by rays, and those by raster, the cheapest first. They are within the error, and take at
/// most 1.5 times as long as the cheapest of their technique. `None` if a verdict needs no paired rounds.
#[must_use]
pub fn rivals<'a>(
    candidates: &'a [Candidate],
    without: Option<&Candidate>,
    within: f64,
) -> Option<[Vec<&'a Candidate>; 2]> {
    match field(candidates, without, within) {
        Field::Decided(_) => None,
        Field::Rivals(mut sides) => {
            for side in &mut sides {
                let most = side.first().map_or(0.0, |cheapest| cheapest.frame_ms * NEAR);
                side.retain(|candidate| candidate.frame_ms <= most);
            }
            Some(sides)
        }
    }
}

/// The cheapest setting whose error is at most `within` and at most half of that of a frame `without` the effect. The cheapest settings of the
/// two techniques are compared by the ratio of their times in the `paired` rounds. One of them is cheaper only if the whole interval of the
/// ratio's median is more than a tenth away from 1.
#[must_use]
pub fn advise(candidates: &[Candidate], without: Option<&Candidate>, within: f64, paired: &[PairedRounds]) -> Advice {
    match field(candidates, without, within) {
        Field::Decided(advice) => *advice,
        Field::Rivals([rays, raster]) => compare(&rays, &raster, paired),
    }
}

/// The cheapest setting of one technique in paired rounds, with its times in these rounds. `None` if they contain no setting of `side`, or if
/// another setting of `side` may be far cheaper.
fn cheapest<'a>(side: &[&'a Candidate], rounds: &PairedRounds) -> Option<(&'a Candidate, Vec<f64>)> {
    let timed = |candidate: &&'a Candidate| Some((*candidate, rounds.of(&candidate.key)?));
    let by_median = |(_, a): &(_, Vec<f64>), (_, b): &(_, Vec<f64>)| median(a).total_cmp(&median(b));
    let (best, times) = side.iter().filter_map(timed).min_by(by_median)?;
    let least = side.first().map_or(0.0, |candidate| candidate.frame_ms);
    (best.frame_ms <= least * STANDS).then_some((best, times))
}

fn compare(rays: &[&Candidate], raster: &[&Candidate], paired: &[PairedRounds]) -> Advice {
    let mut why = "they were not measured against each other".to_owned();
    for rounds in paired.iter().rev() {
        let (Some((rays, a)), Some((raster, b))) = (cheapest(rays, rounds), cheapest(raster, rounds)) else { continue };
        if a.len() < LEAST_ORDERED {
            why = rounds.missing.clone().unwrap_or_else(|| format!("only {} paired rounds were measured", a.len()));
            continue;
        }
        let at = |candidate: &Candidate, times: &[f64]| {
            let (frame_ms, interval) = (median(times), Interval::of_ordered(times));
            Candidate { frame_ms, interval, ..candidate.clone() }
        };
        let (rays, raster) = (at(rays, &a), at(raster, &b));
        let ratios: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a / b).collect();
        return match Interval::of_ordered(&ratios) {
            Some(ratio) if ratio.low > APART => Advice::Choose { best: raster, other: Some((rays, ratio)) },
            Some(ratio) if ratio.high < 1.0 / APART => {
                let ratio = Interval { low: 1.0 / ratio.high, high: 1.0 / ratio.low };
                Advice::Choose { best: rays, other: Some((raster, ratio)) }
            }
            Some(ratio) => Advice::NoDifference { rays, raster, ratio },
            None => Advice::NotCertain { rays, raster, why: "a time is not a number".to_owned() },
        };
    }
    Advice::NotCertain { rays: rays[0].clone(), raster: raster[0].clone(), why }
}

/// For each point, whether it is on the Pareto front: no other point is at least as good in both coordinates and better in one.
#[must_use]
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let beats = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
    points.iter().map(|point| !points.iter().any(|other| beats(other, point))).collect()
}

/// The advice in a word or two, for a cell.
#[must_use]
pub fn verb(advice: &Advice) -> &'static str {
    match advice {
        Advice::Choose { best, .. } => match best.technique {
            Technique::Rays => "trace",
            Technique::Raster => "rasterise",
            Technique::None => "leave out",
        },
        Advice::NoDifference { .. } => "no difference here",
        Advice::NotCertain { .. } => "not certain",
        Advice::LeaveOut { .. } => "leave out",
        Advice::NoneWithin { .. } => "none is within it",
        Advice::UnknownError(_) => "errors are not known",
        Advice::NotMeasured => "not measured",
    }
}
