//! Paired rounds: measures the rows that verdicts compare, alternately.

use super::Told;
use super::collector::{Collector, Place};
use super::model::Effect;
use super::number::significant;
use super::plan::{self, Entry, OUT_OF_TIME, Stage, Wanted};
use super::scale::memory_left;
use super::verdict;
use crate::bench::interval::LEAST_ORDERED;
use crate::bench::measure::frames;
use crate::bench::model::{BenchRow, PairedRounds};
use crate::pipeline::executor::{Observer, StepKind};

/// Greatest number of rounds of one effect.
const MOST_ROUNDS: u32 = 12;
/// More than two rows are measured only if at least this number of rounds fits into the time.
const MANY: u32 = 9;
/// Greatest number of settings of each technique that take part.
const SETTINGS: usize = 2;
/// Greatest and least number of frames of a row in a round. If the time is too short even for the least, a row has a single frame.
const FRAMES: (u32, u32) = (5, 3);

/// A row that takes part.
#[derive(Debug, Clone)]
struct Rival {
    entry: Entry,
    key: String,
    label: String,
    /// Time of a frame, milliseconds.
    frame_ms: f64,
    /// Time to build its structures, seconds. The scene is kept and not loaded again.
    setup_s: f64,
    /// Approximate memory while its project is open, bytes.
    bytes: u64,
}

/// The measurement that fits into the time.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Fitting {
    /// Number of settings of each technique.
    settings: usize,
    rounds: u32,
    /// Whether each row has a single frame in a round.
    single: bool,
}

/// Measures the rows that verdicts compare against each other, effect by effect, and adds the frames to their rows.
pub(super) fn measure(collector: &mut Collector<'_>, told: &mut dyn FnMut(Told<'_>), observer: &mut dyn Observer) {
    // The references hold a scene, whose memory this part needs.
    collector.references.close();
    let mut left: Vec<(Effect, [Vec<Rival>; 2])> =
        plan::IN_TURN.into_iter().filter_map(|effect| Some((effect, rivals(collector, effect)?))).collect();
    collector.done += Effect::ALL.len() - left.len();
    while !left.is_empty() {
        let share = 1.0 / left.len() as f64;
        let (effect, sides) = left.remove(0);
        collector.done += 1;
        let label = format!("{}: rays and raster against each other", effect.title());
        let left_s = collector.time().left_s(Stage::Paired);
        let free = memory_left().unwrap_or(u64::MAX);
        let slot_ms = slot_ms(&collector.request.wanted);
        let rounds = match fitting(&sides, slot_ms, [left_s * share, left_s], free) {
            Ok(fitting) => {
                told(Told { label: &label, done: collector.done - 1, of: collector.to_do, time: collector.time() });
                alternate(collector, &taking_part(&sides, fitting.settings), &fitting, observer)
            }
            Err(why) => {
                let rows = taking_part(&sides, 1).into_iter().map(|rival| rival.key.clone()).collect();
                PairedRounds { rows, rounds: Vec::new(), missing: Some(why) }
            }
        };
        if let Some(why) = &rounds.missing {
            collector.miss(&label, why.clone());
        }
        collector.file.paired.push(rounds);
    }
}

/// The settings of an effect between which a verdict must decide by paired rounds; `None` if it needs none.
fn rivals(collector: &Collector<'_>, effect: Effect) -> Option<[Vec<Rival>; 2]> {
    let section = collector.sections.get(&effect)?;
    let row = |key: &str| collector.file.rows.iter().find(|row| row.key == key);
    let candidates: Vec<_> = collector.settings(effect).map(|(_, row)| verdict::candidate(row)).collect();
    let without = section.without.as_ref().and_then(|without| verdict::without_effect(row(&without.row)?, without));
    let sides = verdict::rivals(&candidates, without.as_ref(), collector.request.wanted.within)?;
    let rival = |candidate: &&verdict::Candidate| {
        let row = row(&candidate.key)?;
        let (entry, key) = collector.measured.iter().find(|(_, key)| *key == candidate.key)?.clone();
        let built = row.setup.iter().filter(|step| step.kind != StepKind::Load);
        let setup_s = built.map(|step| step.host.median).sum::<f64>() / 1e3;
        let triangles = u32::try_from(row.triangles).unwrap_or(u32::MAX);
        let bytes = row.held_bytes + plan::peak_bytes(triangles);
        Some(Rival { entry, key, label: candidate.label.clone(), frame_ms: row.frame.median, setup_s, bytes })
    };
    Some(sides.map(|side| side.iter().filter_map(rival).collect()))
}

/// The time allowed for a row's frames in a round, milliseconds.
fn slot_ms(wanted: &Wanted) -> f64 {
    wanted.frames().1 / 3.0
}

/// The cheapest settings of each technique.
fn taking_part(sides: &[Vec<Rival>; 2], settings: usize) -> Vec<&Rival> {
    sides.iter().flat_map(|side| side.iter().take(settings)).collect()
}

fn turn_frames(rival: &Rival, slot_ms: f64, single: bool) -> u32 {
    let fitting = (slot_ms / rival.frame_ms.max(1e-3)).floor() as u32;
    if single { 1 } else { fitting.clamp(FRAMES.1, FRAMES.0) }
}

/// The largest measurement that fits into the effect's share of the time, or else into all the time that is left.
///
/// # Errors
/// If nothing fits, with the reason.
fn fitting(sides: &[Vec<Rival>; 2], slot_ms: f64, left_s: [f64; 2], free: u64) -> Result<Fitting, String> {
    let seconds = |settings, single, rounds: u32| {
        let rows = taking_part(sides, settings).into_iter();
        let of = |rival: &Rival| {
            let frame_s = rival.frame_ms / 1e3;
            [rival.setup_s + frame_s, frame_s * f64::from(turn_frames(rival, slot_ms, single))]
        };
        let [setup, round] = rows.map(of).fold([0.0; 2], |[a, b], [x, y]| [a + x, b + y]);
        (setup, round, setup + round * f64::from(rounds))
    };
    let bytes = |settings| taking_part(sides, settings).iter().map(|rival| rival.bytes).sum::<u64>();
    if bytes(1) > free {
        let bytes_of = super::number::bytes;
        return Err(format!(
            "left out: two scenes at once need about {}, and {} are free",
            bytes_of(bytes(1)),
            bytes_of(free)
        ));
    }
    let least = LEAST_ORDERED as u32;
    for left in left_s {
        for (settings, single, needed) in
            [(SETTINGS, false, MANY), (1, false, MANY), (1, false, least), (1, true, least)]
        {
            let (setup, round, expected) = seconds(settings, single, needed);
            if expected <= left && bytes(settings) <= free {
                let rounds = ((left - setup) / round.max(1e-6)).floor().min(f64::from(MOST_ROUNDS)) as u32;
                return Ok(Fitting { settings, rounds: rounds.max(needed), single });
            }
        }
    }
    let expected = seconds(1, true, least).2;
    let needs = format!("about {} s for {least} rounds", significant(expected));
    Err(format!("{OUT_OF_TIME} {needs}, and {} s were left for this part of the report", significant(left_s[1])))
}

/// Measures rows alternately. Each has a renderer of its own, and all of them stay open.
fn alternate(
    collector: &mut Collector<'_>,
    rivals: &[&Rival],
    fitting: &Fitting,
    observer: &mut dyn Observer,
) -> PairedRounds {
    let mut found =
        PairedRounds { rows: rivals.iter().map(|rival| rival.key.clone()).collect(), ..PairedRounds::default() };
    let mut totals: Vec<Option<BenchRow>> = vec![None; rivals.len()];
    if let Err(why) = rounds(collector, rivals, fitting, &mut found, &mut totals, observer) {
        found.missing = Some(why);
    }
    for (rival, total) in rivals.iter().zip(totals) {
        let row = collector.file.rows.iter_mut().find(|row| row.key == rival.key);
        if let (Some(row), Some(total)) = (row, total) {
            row.add(&total);
        }
    }
    found
}

fn rounds(
    collector: &Collector<'_>,
    rivals: &[&Rival],
    fitting: &Fitting,
    found: &mut PairedRounds,
    totals: &mut [Option<BenchRow>],
    observer: &mut dyn Observer,
) -> Result<(), String> {
    let wanted = &collector.request.wanted;
    let (projects, size, stage) = (collector.request.projects.as_path(), wanted.size, Stage::Paired);
    let place = Place { projects, size, triangles: None, lights: None, threads: None, stage };
    let mut open = Vec::new();
    for rival in rivals {
        let named = |why: String| format!("{}: {why}", rival.label);
        let case = collector.case(&rival.entry, &place).map_err(named)?;
        let mut renderer = case.open(observer).map_err(|error| named(error.joined()))?;
        frames(&mut renderer, &case, 1, observer).map_err(|error| named(error.to_string()))?;
        open.push((case, renderer));
    }
    for round in 0..fitting.rounds {
        if collector.time().left_s(Stage::Rounds) == 0.0 {
            let done = found.rounds.len();
            let short = done < LEAST_ORDERED;
            return if short { Err(format!("the time was over after {done} paired rounds")) } else { Ok(()) };
        }
        let mut order: Vec<usize> = (0..rivals.len()).collect();
        if round % 2 == 1 {
            order.reverse();
        }
        let mut times = vec![0.0; rivals.len()];
        for index in order {
            let (case, renderer) = &mut open[index];
            let rival = rivals[index];
            let count = turn_frames(rival, slot_ms(wanted), fitting.single);
            let mut row = frames(renderer, case, count, observer)
                .map_err(|error| format!("{}, in a paired round: {error}", rival.label))?;
            times[index] = row.frame.median;
            match &mut totals[index] {
                Some(total) => {
                    // The setup was done once, and the first round's row has it.
                    row.setup.clear();
                    total.add(&row);
                }
                empty => *empty = Some(row),
            }
        }
        found.rounds.push(times);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::model::Technique;

    fn rival(technique: Technique, frame_ms: f64, setup_s: f64) -> Rival {
        let of = |entry: &Entry| entry.effect == "shadows" && entry.technique == technique;
        let entry = plan::entries(&Wanted::new(true, None), false, &[]).into_iter().find(of).expect("an entry");
        Rival { entry, key: String::new(), label: String::new(), frame_ms, setup_s, bytes: 1 << 20 }
    }

    fn sides(frame_ms: f64, setup_s: f64) -> [Vec<Rival>; 2] {
        [Technique::Rays, Technique::Raster].map(|technique| vec![rival(technique, frame_ms, setup_s); 3])
    }

    #[test]
    fn the_time_decides_how_many_rows_and_rounds_there_are() {
        let sides = sides(50.0, 1.0);
        let of = |left_s: f64| fitting(&sides, 100.0, [left_s / 2.0, left_s], u64::MAX);
        // Two settings of each technique with three frames each: a round takes 0.6 s, and opening takes 4.2 s.
        assert_eq!(of(100.0), Ok(Fitting { settings: 2, rounds: 12, single: false }));
        assert_eq!(of(20.0), Ok(Fitting { settings: 2, rounds: 9, single: false }));
        assert_eq!(of(14.0), Ok(Fitting { settings: 1, rounds: 12, single: false }));
        assert_eq!(of(8.0), Ok(Fitting { settings: 1, rounds: 6, single: false }));
        assert_eq!(of(6.1), Ok(Fitting { settings: 1, rounds: 9, single: true }));
        // The effect's share of the time does not suffice, but all the time that is left does.
        assert_eq!(of(4.3), Ok(Fitting { settings: 1, rounds: 7, single: false }));
        let why = of(2.5).expect_err("no time");
        assert!(why.starts_with(OUT_OF_TIME) && why.contains("2.70 s for 6 rounds") && why.contains("2.50 s"), "{why}");
    }

    #[test]
    fn fast_rows_have_more_frames_in_a_round_and_memory_is_looked_after() {
        let [fast, slow] = [5.0, 500.0].map(|ms| rival(Technique::Rays, ms, 0.0));
        assert_eq!((turn_frames(&fast, 100.0, false), turn_frames(&slow, 100.0, false)), (5, 3));
        assert_eq!(turn_frames(&fast, 100.0, true), 1);
        let sides = sides(5.0, 0.1);
        let of = |free: u64| fitting(&sides, 100.0, [60.0; 2], free << 20);
        assert_eq!(of(4).map(|fitting| fitting.settings), Ok(2));
        assert_eq!(of(3).map(|fitting| fitting.settings), Ok(1));
        assert!(of(1).expect_err("too little").contains("two scenes at once need about 2.00 MiB"));
    }
}
