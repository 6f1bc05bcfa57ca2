//! The summary of a report ("in short") in sentences, from the verdicts.

use super::model::{Effect, ReportData};
use super::number::{error, milliseconds, significant};
use super::verdict::{Advice, Candidate, FRAME_60_MS, Fit, Verdict, verdicts};
use crate::bench::Interval;
use crate::bench::model::Technique;

/// The sentences of the summary.
#[must_use]
pub fn in_short(data: &ReportData) -> Vec<String> {
    let verdicts = verdicts(data, data.within);
    let mut sentences = vec![opening(data)];
    for technique in [Technique::Rays, Technique::Raster] {
        sentences.extend(chosen(&verdicts, technique));
    }
    sentences.extend(no_difference(&verdicts));
    sentences.extend(not_certain(&verdicts));
    sentences.extend(left_out(&verdicts));
    sentences.extend(none_within(&verdicts));
    sentences.extend(unknown_errors(&verdicts));
    sentences.extend(in_time(data, &verdicts));
    sentences.extend(together(data, &verdicts));
    let unmeasured = named(verdicts.iter().filter(|verdict| verdict.advice == Advice::NotMeasured));
    if !unmeasured.is_empty() {
        sentences.push(format!("Not measured: {}; the reasons are listed below.", list(&unmeasured)));
    }
    sentences
}

fn opening(data: &ReportData) -> String {
    let [width, height] = data.size;
    let triangles = super::number::grouped(data.scene.triangles);
    format!(
        "On this machine, with {triangles} triangles at {width} × {height} pixels, the cheapest settings whose error is at most {} (RMSE of the effect):",
        error(data.within)
    )
}

fn named<'a>(verdicts: impl Iterator<Item = &'a Verdict>) -> Vec<String> {
    verdicts.map(|verdict| verdict.effect.in_words().to_owned()).collect()
}

/// "Trace shadows (by rays: 12.0 ms, RMSE 0.0010; by shadow map takes 2.10 to 2.30 times as long)."
fn chosen(verdicts: &[Verdict], technique: Technique) -> Option<String> {
    let part = |verdict: &Verdict| {
        let Advice::Choose { best, other } = &verdict.advice else { return None };
        let beside = match other {
            Some((other, ratio)) => {
                format!("{} takes {} times as long", setting(verdict.effect, other), range(*ratio))
            }
            None if best.technique == Technique::Rays => "nothing by raster is within the error".to_owned(),
            None => "nothing by rays is within the error".to_owned(),
        };
        (best.technique == technique).then(|| {
            let (name, by) = (verdict.effect.in_words(), setting(verdict.effect, best));
            format!("{name} ({by}: {}, {}; {beside})", milliseconds(best.frame_ms), cost(best))
        })
    };
    let parts: Vec<String> = verdicts.iter().filter_map(part).collect();
    let verb = if technique == Technique::Rays { "Trace" } else { "Rasterise" };
    (!parts.is_empty()).then(|| format!("{verb} {}.", list(&parts)))
}

fn no_difference(verdicts: &[Verdict]) -> Option<String> {
    let part = |verdict: &Verdict| {
        let Advice::NoDifference { rays, raster, ratio } = &verdict.advice else { return None };
        Some(format!(
            "{} ({} {}, {} {}: {} times)",
            verdict.effect.in_words(),
            setting(verdict.effect, rays),
            milliseconds(rays.frame_ms),
            setting(verdict.effect, raster),
            milliseconds(raster.frame_ms),
            range(*ratio)
        ))
    };
    let parts: Vec<String> = verdicts.iter().filter_map(part).collect();
    (!parts.is_empty()).then(|| format!("No difference here between rays and raster: {}.", list(&parts)))
}

fn not_certain(verdicts: &[Verdict]) -> Option<String> {
    let part = |verdict: &Verdict| {
        let Advice::NotCertain { rays, raster, why } = &verdict.advice else { return None };
        Some(format!(
            "{} ({} {}, {} {}, measured at different times; {why})",
            verdict.effect.in_words(),
            setting(verdict.effect, rays),
            milliseconds(rays.frame_ms),
            setting(verdict.effect, raster),
            milliseconds(raster.frame_ms),
        ))
    };
    let parts: Vec<String> = verdicts.iter().filter_map(part).collect();
    (!parts.is_empty()).then(|| {
        format!("Not certain, both by rays and by raster within the error; more --time may tell: {}.", list(&parts))
    })
}

/// The ends of an interval.
fn range(interval: Interval) -> String {
    format!("{} to {}", significant(interval.low), significant(interval.high))
}

/// The row's label, without the effect's name if it begins with that.
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
        Ok(quality) => format!("RMSE {}", error(quality.rmse)),
        Err(_) => "error unknown".to_owned(),
    }
}

fn left_out(verdicts: &[Verdict]) -> Option<String> {
    let part = |verdict: &Verdict| {
        let Advice::LeaveOut { without } = &verdict.advice else { return None };
        Some(format!("{} ({})", verdict.effect.in_words(), cost(without)))
    };
    let parts: Vec<String> = verdicts.iter().filter_map(part).collect();
    (!parts.is_empty()).then(|| {
        format!("Leave out what the view hardly shows; a frame without it is within the error: {}.", list(&parts))
    })
}

fn none_within(verdicts: &[Verdict]) -> Option<String> {
    let part = |verdict: &Verdict| {
        let Advice::NoneWithin { nearest } = &verdict.advice else { return None };
        let (name, by) = (verdict.effect.in_words(), setting(verdict.effect, nearest));
        Some(format!("{name} (nearest: {by}, {}, {})", milliseconds(nearest.frame_ms), cost(nearest)))
    };
    let parts: Vec<String> = verdicts.iter().filter_map(part).collect();
    (!parts.is_empty()).then(|| {
        format!(
            "No setting is within the error and at least twice as near as a frame without the effect: {}.",
            list(&parts)
        )
    })
}

fn unknown_errors(verdicts: &[Verdict]) -> Option<String> {
    let part = |verdict: &Verdict| {
        let Advice::UnknownError(fastest) = &verdict.advice else { return None };
        Some(format!(
            "{} ({}: {}; {})",
            verdict.effect.in_words(),
            setting(verdict.effect, fastest),
            milliseconds(fastest.frame_ms),
            fastest.error.as_ref().err().map_or("no reason was given", String::as_str)
        ))
    };
    let parts: Vec<String> = verdicts.iter().filter_map(part).collect();
    (!parts.is_empty()).then(|| format!("The fastest, without a judgement of the picture: {}.", list(&parts)))
}

/// A sentence about which of the chosen settings, each alone, run at 60 frames a second.
fn in_time(data: &ReportData, verdicts: &[Verdict]) -> Option<String> {
    let measured: Vec<(&Verdict, Fit)> =
        verdicts.iter().filter_map(|verdict| Some((verdict, verdict.setting()?.fit(FRAME_60_MS)))).collect();
    let of = |fit| named(measured.iter().filter(|(_, found)| *found == fit).map(|(verdict, _)| *verdict));
    let (yes, limit, no) = (of(Fit::Yes), of(Fit::AtTheLimit), of(Fit::No));
    let base = data.base("").map(|row| row.frame.median).filter(|median| *median > FRAME_60_MS);
    let mut parts = Vec::new();
    for (said, which) in [("in time", yes), ("at the limit, sometimes over it", limit), ("too slow", no)] {
        if !which.is_empty() {
            parts.push(format!("{said}: {}", list(&which)));
        }
    }
    if let Some(base) = base {
        parts.push(format!("the frame without any effect takes {} already", milliseconds(base)));
    }
    let ms = milliseconds(FRAME_60_MS);
    (!parts.is_empty()).then(|| format!("At 60 frames a second ({ms} a frame) each alone is {}.", parts.join("; ")))
}

/// A sentence about the time of all chosen settings in one frame: the frame without effects, plus what each setting adds. `None` for fewer
/// than two settings.
fn together(data: &ReportData, verdicts: &[Verdict]) -> Option<String> {
    let mut sum = 0.0;
    let mut count = 0;
    let mut base_ms = 0.0_f64;
    let soft = |verdict: &&Verdict| verdict.effect != Effect::SoftShadows;
    // A frame has either hard or soft shadows, so soft ones are left out of the sum.
    for verdict in verdicts.iter().filter(soft) {
        if let Advice::Choose { .. } | Advice::NoDifference { .. } | Advice::NotCertain { .. } = &verdict.advice {
            let base = data.base(&data.section(verdict.effect)?.view)?.frame.median;
            base_ms = base_ms.max(base);
            sum += (verdict.setting()?.frame_ms - base).max(0.0);
            count += 1;
        }
    }
    let total = base_ms + sum;
    let fits = if total <= FRAME_60_MS { "which is in time" } else { "which is too slow" };
    let has_soft = verdicts.iter().any(|verdict| !soft(&verdict) && verdict.setting().is_some());
    let all = format!("All {count}{}", if has_soft { " but soft shadows" } else { "" });
    (count > 1).then(|| {
        format!(
            "{all} in one frame would take about {}, {fits}, if what each adds to a frame without effects simply adds up (an estimate, not a measurement).",
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
