//! The "in short" of a report: which effects to trace and which to rasterise at 60 frames a second, from the numbers.

use super::model::{Effect, ReportData, Section};
use super::number::{error, milliseconds};
use crate::bench::model::{BenchRow, RowError, Technique};

/// Time of a frame at 60 frames a second, milliseconds.
pub const FRAME_60_MS: f64 = 1000.0 / 60.0;

/// One setting as the choice sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// By rays or by raster.
    pub technique: Technique,
    /// The row's label.
    pub label: String,
    /// Median time of a whole frame, milliseconds.
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
    fn known(self) -> f64 {
        self.rmse.max(self.own_error)
    }
}

/// What to do with an effect.
#[derive(Debug, Clone, PartialEq)]
pub enum Advice {
    /// The least error of all settings that fit into the frame.
    Fits(Candidate),
    /// What fits is no better than a frame without the effect.
    LeaveOut {
        /// The least error of what fits.
        best: Candidate,
        /// The frame without the effect.
        without: Candidate,
    },
    /// Something fits, but no setting that fits has an error: the fastest.
    FitsWithUnknownError(Candidate),
    /// Nothing fits.
    NothingFits {
        /// The fastest setting that is better than nothing.
        cheapest: Candidate,
        /// The same by the other technique, where there is one.
        other: Option<Candidate>,
    },
    /// There is no setting at all.
    NotMeasured,
}

/// Advice for one effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Which effect.
    pub effect: Effect,
    /// What to do.
    pub advice: Advice,
}

/// Decides for each effect of the report. `limit_ms` is the time of a whole frame.
#[must_use]
pub fn verdicts(data: &ReportData, limit_ms: f64) -> Vec<Verdict> {
    let verdict = |effect| {
        let candidates = data.section(effect).map(|section| candidates(data, section)).unwrap_or_default();
        let without = data.section(effect).and_then(|section| without(data, section));
        Verdict { effect, advice: advise(&candidates, without.as_ref(), limit_ms) }
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
    let (technique, label) = (row.technique, row.label.clone());
    Candidate { technique, label, frame_ms: row.frame.median, error: quality(&row.error) }
}

fn quality(error: &RowError) -> Result<Quality, String> {
    match error {
        RowError::Against { own_error, comparison, .. } => {
            Ok(Quality { rmse: comparison.rmse, flip: comparison.flip, own_error: *own_error })
        }
        RowError::Missing(why) => Err(why.clone()),
    }
}

/// The least error among what fits, errors below the reference's own counting as equal and the faster of equals, if that is
/// better than a frame `without` the effect; else the fastest of what fits; else the fastest of all that are better than that.
#[must_use]
pub fn advise(candidates: &[Candidate], without: Option<&Candidate>, limit_ms: f64) -> Advice {
    let fits = || candidates.iter().filter(|candidate| candidate.frame_ms <= limit_ms);
    let best = fits()
        .filter_map(|candidate| Some((candidate, candidate.error.as_ref().ok()?.known())))
        .min_by(|(a, x), (b, y)| x.total_cmp(y).then(a.frame_ms.total_cmp(&b.frame_ms)));
    if let Some((best, error)) = best {
        let plain = without.and_then(|without| Some((without, without.error.as_ref().ok()?.known())));
        return match plain.filter(|(_, plain)| *plain <= error) {
            Some((without, _)) => Advice::LeaveOut { best: best.clone(), without: without.clone() },
            None => Advice::Fits(best.clone()),
        };
    }
    let fastest =
        |of: &mut dyn Iterator<Item = &Candidate>| of.min_by(|a, b| a.frame_ms.total_cmp(&b.frame_ms)).cloned();
    if let Some(fastest) = fastest(&mut fits()) {
        return Advice::FitsWithUnknownError(fastest);
    }
    // What is no better than nothing is not worth its time, unless there is nothing else.
    let plain = without.and_then(|without| Some(without.error.as_ref().ok()?.known()));
    let helps = |candidate: &&Candidate| match (&candidate.error, plain) {
        (Ok(quality), Some(plain)) => quality.known() < plain,
        _ => true,
    };
    let worth: Vec<&Candidate> = candidates.iter().filter(helps).collect();
    let worth = if worth.is_empty() { candidates.iter().collect() } else { worth };
    match fastest(&mut worth.iter().copied()) {
        None => Advice::NotMeasured,
        Some(cheapest) => {
            let others = worth.iter().copied().filter(|candidate| candidate.technique != cheapest.technique);
            let other = fastest(&mut { others });
            Advice::NothingFits { cheapest, other }
        }
    }
}

/// Whether a candidate is beaten by none: nothing else is at least as fast and as exact, and better in one of both.
/// Candidates without an error are never on the front. In the order of `candidates`.
#[must_use]
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let beats = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
    points.iter().map(|point| !points.iter().any(|other| beats(other, point))).collect()
}

/// "Trace", "Rasterise" or what else is to be said in a cell.
#[must_use]
pub fn verb(advice: &Advice) -> &'static str {
    match advice {
        Advice::Fits(candidate) | Advice::FitsWithUnknownError(candidate) => match candidate.technique {
            Technique::Rays => "trace",
            Technique::Raster => "rasterise",
            Technique::None => "leave out",
        },
        Advice::LeaveOut { .. } => "leave out",
        Advice::NothingFits { .. } => "nothing fits",
        Advice::NotMeasured => "not measured",
    }
}

/// The paragraph, one sentence an entry.
#[must_use]
pub fn in_short(data: &ReportData) -> Vec<String> {
    let verdicts = verdicts(data, FRAME_60_MS);
    let mut sentences = vec![opening(data, &verdicts)];
    for technique in [Technique::Rays, Technique::Raster] {
        sentences.extend(chosen(&verdicts, technique));
    }
    sentences.extend(left_out(&verdicts));
    sentences.extend(unknown_errors(&verdicts));
    sentences.extend(nothing_fits(&verdicts));
    sentences.extend(together(data, &verdicts));
    let unmeasured: Vec<_> = named(&verdicts, |advice| matches!(advice, Advice::NotMeasured));
    if !unmeasured.is_empty() {
        sentences.push(format!("Not measured: {}; the reasons are listed below.", list(&unmeasured)));
    }
    sentences
}

fn named(verdicts: &[Verdict], which: impl Fn(&Advice) -> bool) -> Vec<String> {
    let chosen = verdicts.iter().filter(|verdict| which(&verdict.advice));
    chosen.map(|verdict| verdict.effect.in_words().to_owned()).collect()
}

fn opening(data: &ReportData, verdicts: &[Verdict]) -> String {
    let [width, height] = data.size;
    let place = format!(
        "On this machine, with {} triangles at {width} × {height} pixels,",
        super::number::grouped(data.scene.triangles)
    );
    let fit = |advice: &Advice| matches!(advice, Advice::Fits(_) | Advice::FitsWithUnknownError(_));
    let fitting = verdicts.iter().filter(|verdict| fit(&verdict.advice)).count();
    let base = data.base("");
    let limit = milliseconds(FRAME_60_MS);
    match (fitting, base) {
        (0, Some(base)) if base.frame.median > FRAME_60_MS => format!(
            "{place} no effect runs at 60 frames a second ({limit} a frame): the frame without any effect takes {} already.",
            milliseconds(base.frame.median)
        ),
        (0, _) => format!("{place} no effect runs at 60 frames a second ({limit} a frame)."),
        (n, _) if n == verdicts.len() => {
            format!("{place} each of the effects, taken alone, can run at 60 frames a second ({limit} a frame).")
        }
        (n, _) => format!(
            "{place} {n} of {} effects, each taken alone, can run at 60 frames a second ({limit} a frame).",
            verdicts.len()
        ),
    }
}

/// "Trace shadows (…) and …" with the errors.
fn chosen(verdicts: &[Verdict], technique: Technique) -> Option<String> {
    let parts: Vec<String> = verdicts
        .iter()
        .filter_map(|verdict| match &verdict.advice {
            Advice::Fits(candidate) if candidate.technique == technique => Some(format!(
                "{} ({}: {}, {})",
                verdict.effect.in_words(),
                setting(verdict.effect, candidate),
                milliseconds(candidate.frame_ms),
                cost(candidate)
            )),
            _ => None,
        })
        .collect();
    let verb = if technique == Technique::Rays { "Trace" } else { "Rasterise" };
    (!parts.is_empty()).then(|| format!("{verb} {}.", list(&parts)))
}

/// The row's label without the effect's name, where it begins with that.
fn setting(effect: Effect, candidate: &Candidate) -> &str {
    candidate.label.strip_prefix(effect.title()).map_or(candidate.label.as_str(), str::trim_start)
}

/// The error in words.
fn cost(candidate: &Candidate) -> String {
    match &candidate.error {
        Ok(quality) if quality.rmse == 0.0 => "no error".to_owned(),
        Ok(quality) if quality.rmse <= quality.own_error => {
            format!("error below the {} that the reference can tell", error(quality.own_error))
        }
        Ok(quality) => format!("RMSE {}, FLIP {}", error(quality.rmse), error(quality.flip)),
        Err(_) => "error unknown".to_owned(),
    }
}

/// "Leave out …: what fits is no better than nothing."
fn left_out(verdicts: &[Verdict]) -> Option<String> {
    let parts: Vec<String> = verdicts
        .iter()
        .filter_map(|verdict| match &verdict.advice {
            Advice::LeaveOut { best, without } => Some(format!(
                "{}, since the best that fits ({}: {}, {}) is no nearer to the reference than a frame without it ({})",
                verdict.effect.in_words(),
                setting(verdict.effect, best),
                milliseconds(best.frame_ms),
                cost(best),
                cost(without)
            )),
            _ => None,
        })
        .collect();
    (!parts.is_empty()).then(|| format!("Leave out {}.", parts.join("; ")))
}

fn unknown_errors(verdicts: &[Verdict]) -> Option<String> {
    let parts: Vec<String> = verdicts
        .iter()
        .filter_map(|verdict| match &verdict.advice {
            Advice::FitsWithUnknownError(candidate) => Some(format!(
                "{} ({}: {}, but its error is not known: {})",
                verdict.effect.in_words(),
                setting(verdict.effect, candidate),
                milliseconds(candidate.frame_ms),
                candidate.error.as_ref().err().map_or("no reason was given", String::as_str)
            )),
            _ => None,
        })
        .collect();
    (!parts.is_empty()).then(|| format!("Fast enough, without a judgement of the picture: {}.", list(&parts)))
}

fn nothing_fits(verdicts: &[Verdict]) -> Option<String> {
    // FLIP stands in the table: a sentence with eight pairs of errors is not read.
    let figures = |candidate: &Candidate| {
        let quality = match &candidate.error {
            Ok(quality) if quality.rmse == 0.0 => "no error".to_owned(),
            Ok(quality) => format!("RMSE {}", error(quality.rmse)),
            Err(_) => "error unknown".to_owned(),
        };
        format!("{}, {quality}", milliseconds(candidate.frame_ms))
    };
    let parts: Vec<String> = verdicts
        .iter()
        .filter_map(|verdict| match &verdict.advice {
            Advice::NothingFits { cheapest, other } => {
                let by = |candidate: &Candidate| setting(verdict.effect, candidate).to_owned();
                let other = other.as_ref().map(|other| format!("; {} {}", by(other), figures(other)));
                let name = verdict.effect.in_words();
                Some(format!("{name} {} ({}{})", by(cheapest), figures(cheapest), other.unwrap_or_default()))
            }
            _ => None,
        })
        .collect();
    (!parts.is_empty())
        .then(|| format!("Where nothing fits, the cheapest that is better than nothing: {}.", parts.join("; ")))
}

/// Whether what was chosen fits together: the frame without effects and what each adds to it.
fn together(data: &ReportData, verdicts: &[Verdict]) -> Option<String> {
    let mut sum = 0.0;
    let mut count = 0;
    let mut base_ms = 0.0_f64;
    for verdict in verdicts {
        if let Advice::Fits(candidate) = &verdict.advice {
            let base = data.base(&data.section(verdict.effect)?.view)?.frame.median;
            base_ms = base_ms.max(base);
            sum += (candidate.frame_ms - base).max(0.0);
            count += 1;
        }
    }
    let total = base_ms + sum;
    let fits = if total <= FRAME_60_MS { "which still fits" } else { "which no longer fits" };
    (count > 1).then(|| {
        format!(
            "All {count} in one frame would take about {}, {fits}, if what each adds to a frame without effects simply adds up (an estimate, not a measurement).",
            milliseconds(total)
        )
    })
}

/// `a`, `a and b`, `a, b and c`.
fn list(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
