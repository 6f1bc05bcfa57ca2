//! Tests of the page and its summary with invented numbers: nothing is rendered.

mod columns;

use super::model::{
    Against, Effect, FlipMap, PassGraph, Picture, ReportData, Scaling, ScalingSeries, SceneFacts, Section, Setting,
    WITHIN, Without,
};
use super::summary::in_short;
use super::verdict::{Advice, advise, candidates, pareto_front, verdicts};
use super::{page, plots};
use crate::bench::model::{
    BenchFile, BenchRow, BenchStep, EngineName, FORMAT, PairedRounds, RowError, Stats, Technique, Unavailable,
};
use crate::bench::{Interval, text};
use crate::environment::Environment;
use crate::pipeline::backend::{PathsSpent, RayCounts};
use crate::pipeline::executor::StepKind;
use crate::pipeline::metrics::Comparison;

fn stats(ms: f64) -> Stats {
    Stats::new(vec![ms, ms * 0.98, ms * 1.05]).expect("samples")
}

fn against(rmse: f64) -> RowError {
    RowError::Against {
        reference: "4096 rays a pixel in f64".to_owned(),
        key: "0123".to_owned(),
        own_error: 0.000_4,
        comparison: Comparison {
            pixels: 4096,
            rmse,
            relative_mse: rmse * rmse,
            max: 0.5,
            psnr: -20.0 * rmse.log10(),
            ssim: 1.0 - rmse,
            flip: rmse * 2.0,
            energy_ratio: 0.999,
            outliers: 0.01,
        },
    }
}

/// A row whose frames take about `ms` milliseconds; each step takes a fixed share of that.
fn row(key: &str, effect: &str, technique: Technique, ms: f64, error: RowError) -> BenchRow {
    let step = |kind, name: &str, share: f64, rays: Option<u64>| BenchStep {
        kind,
        name: name.to_owned(),
        host: stats(ms * share),
        device: None,
        rays: rays.map(|shadow| RayCounts { shadow, ..RayCounts::default() }),
        mrays_per_second: None,
        answers: None,
        adaptive: None,
        note: String::new(),
    };
    let engine = EngineName { name: "cpu".to_owned(), device: "2 threads".to_owned() };
    let mut steps = vec![step(StepKind::Raster, "pass1", 0.4, None)];
    match technique {
        Technique::Rays => steps.push(step(StepKind::Rays, "pass2", 0.55, Some(1_000_000))),
        Technique::Raster => {
            steps.push(step(StepKind::Maps, "pass2", 0.25, None));
            steps.push(step(StepKind::Effect, "pass2", 0.3, None));
        }
        Technique::None => {}
    }
    BenchRow {
        key: key.to_owned(),
        label: format!("Shadows by {key}"),
        effect: effect.to_owned(),
        technique,
        view: "Fonte".to_owned(),
        project: "SceneX.xml".into(),
        set: Vec::new(),
        size: [64, 64],
        fidelity: "corrected".to_owned(),
        seed: 0,
        triangles: 56_000,
        raster: engine.clone(),
        rays: (technique == Technique::Rays).then_some(engine),
        frame: stats(ms),
        interval: None,
        outliers: None,
        frame_device: None,
        frame_processor: None,
        steps,
        setup: Vec::new(),
        ray_share: (technique == Technique::Rays).then_some(0.55),
        peak_memory_bytes: Some(100 << 20),
        held_bytes: 1 << 20,
        error,
        picture_error: None,
        thesis: None,
        inputs: None,
        picture: None,
        machine: 0,
    }
}

/// A report of shadows by both techniques, with these times and errors: `(rays, raster)`.
fn report(base_ms: f64, rays: (f64, RowError), raster: (f64, RowError)) -> ReportData {
    let (rays_ms, raster_ms) = (rays.0, raster.0);
    let rows = vec![
        row("none", "none", Technique::None, base_ms, RowError::Missing("nothing to compare".to_owned())),
        row("shadow <rays>", "shadows", Technique::Rays, rays.0, rays.1),
        row("shadow map", "shadows", Technique::Raster, raster.0, raster.1),
    ];
    let setting = |row: &BenchRow, series: &str, value: &str| Setting {
        row: row.key.clone(),
        series: series.to_owned(),
        value: value.to_owned(),
    };
    let picture = |role: &str, row: Option<&BenchRow>| Picture {
        role: role.to_owned(),
        label: format!("By {role}"),
        file: format!("pictures/shadows-{role}.png"),
        size: [64, 64],
        row: row.map(|row| row.key.clone()),
    };
    let section = Section {
        effect: Effect::Shadows,
        view: "Fonte".to_owned(),
        pictures: vec![picture("raster", Some(&rows[2])), picture("rays", Some(&rows[1])), picture("reference", None)],
        flip_maps: vec![FlipMap {
            label: "By raster".to_owned(),
            file: "pictures/shadows-raster-flip.png".to_owned(),
            size: [64, 64],
            mean: 0.03,
        }],
        graphs: vec![PassGraph {
            row: rows[1].key.clone(),
            label: "By rays".to_owned(),
            passes: ["pass1", "pass2", "pass5"].map(|name| [name.to_owned(), format!("does <{name}>")]).to_vec(),
            edges: vec![
                (0, 1, vec!["pos".to_owned()]),
                (0, 2, vec!["color".to_owned()]),
                (1, 2, vec!["test".to_owned()]),
            ],
        }],
        without: None,
        settings: vec![setting(&rows[1], "rays", "1 ray"), setting(&rows[2], "shadow map", "2048")],
    };
    ReportData {
        scene: SceneFacts { file: "largoCamoes.cbo".to_owned(), triangles: 56_000 },
        size: [64, 64],
        quick: false,
        budget_s: 600.0,
        took_s: 71.0,
        within: WITHIN,
        table: rows.iter().map(|row| row.key.clone()).collect(),
        pixel_samples: Vec::new(),
        sections: vec![section],
        scalings: vec![Scaling {
            against: Against::Triangles,
            series: vec![ScalingSeries {
                label: "no effects".to_owned(),
                technique: Technique::None,
                rows: vec!["none".to_owned()],
                amounts: Vec::new(),
            }],
        }],
        bench: BenchFile {
            format: FORMAT,
            command: "curitiba report".to_owned(),
            started_unix_s: 1_700_000_000,
            environment: Environment::here(),
            frames: 3,
            warmup: 1,
            rounds: 3,
            complete: true,
            paired: vec![PairedRounds {
                rows: vec![rows[1].key.clone(), rows[2].key.clone()],
                rounds: [0.99, 1.0, 1.01, 1.0, 1.02, 0.98].map(|speed| vec![rays_ms * speed, raster_ms]).to_vec(),
                missing: None,
            }],
            rows,
            unavailable: vec![Unavailable { what: "wgpu".to_owned(), why: "no adapter & no driver".to_owned() }],
            machines: Vec::new(),
            part: None,
        },
    }
}

fn missing() -> RowError {
    RowError::Missing("the reference would have taken 9 minutes".to_owned())
}

fn advice(data: &ReportData) -> Advice {
    verdicts(data, data.within).remove(0).advice
}

/// As [`report`], with this error of a frame without shadows.
fn beside_nothing(without: f64, rays: (f64, RowError), raster: (f64, RowError)) -> ReportData {
    let mut data = report(2.0, rays, raster);
    data.sections[0].without = Some(Without { row: "none".to_owned(), error: against(without) });
    data
}

#[test]
fn the_cheapest_setting_within_the_error_is_chosen_and_the_other_technique_stands_beside_it() {
    let mut data = report(2.0, (12.0, against(0.001)), (4.0, against(0.015)));
    let Advice::Choose { best, other: Some((other, ratio)) } = advice(&data) else { panic!("nothing is chosen") };
    assert_eq!((best.technique, other.technique), (Technique::Raster, Technique::Rays));
    assert!(ratio.holds(3.0) && ratio.low > 2.5 && ratio.high < 3.5, "{ratio:?}");
    let text = in_short(&data).join(" ");
    assert!(text.contains("whose error is at most 0.020 (RMSE of the effect)"), "{text}");
    assert!(text.contains("Rasterise shadows (by shadow map: 4.00 ms, RMSE 0.015; by shadow <rays> takes"), "{text}");
    assert!(text.contains("Not measured: soft shadows, reflection, refraction and ambient occlusion"), "{text}");
    // The error by raster, 0.015, exceeds the requested error now.
    data.within = 0.01;
    assert!(matches!(advice(&data), Advice::Choose { best, other: None } if best.technique == Technique::Rays));
    let text = in_short(&data).join(" ");
    assert!(
        text.contains("Trace shadows (by shadow <rays>: 12.0 ms, RMSE 0.0010; nothing by raster is within"),
        "{text}"
    );
}

#[test]
fn an_error_that_the_reference_cannot_tell_is_its_own() {
    let mut data = report(2.0, (12.0, against(0.000_1)), (4.0, against(0.000_3)));
    data.within = 0.000_4;
    assert!(matches!(advice(&data), Advice::Choose { best, .. } if best.technique == Technique::Raster));
    assert!(in_short(&data).join(" ").contains("error below the 0.00040 that the reference can tell"));
    data.within = 0.000_35;
    assert!(matches!(advice(&data), Advice::NoneWithin { .. }));
}

#[test]
fn what_is_hardly_better_than_nothing_is_never_advised() {
    // The raster setting's error, 0.015, is within the requested error, but above half of the error without the effect, 0.025.
    let data = beside_nothing(0.025, (12.0, against(0.001)), (4.0, against(0.015)));
    assert!(matches!(advice(&data), Advice::Choose { best, other: None } if best.technique == Technique::Rays));
    // Here it is below half of it.
    let data = beside_nothing(0.05, (12.0, against(0.001)), (4.0, against(0.015)));
    assert!(matches!(advice(&data), Advice::Choose { best, .. } if best.technique == Technique::Raster));
    // A frame without the effect is within the error.
    let data = beside_nothing(0.012, (12.0, against(0.001)), (4.0, against(0.005)));
    assert!(matches!(advice(&data), Advice::LeaveOut { without } if without.frame_ms == 2.0));
    let text = in_short(&data).join(" ");
    assert!(text.contains("a frame without it is within the error: shadows (RMSE 0.012)"), "{text}");
    assert!(page::build(&data).html.contains("leave out"));
    // The error of a frame without the effect is not known.
    let mut data = report(2.0, (12.0, against(0.001)), (4.0, against(0.015)));
    data.sections[0].without = Some(Without { row: "none".to_owned(), error: missing() });
    assert!(matches!(advice(&data), Advice::Choose { best, .. } if best.technique == Technique::Raster));
}

#[test]
fn where_no_setting_is_within_the_error_the_nearest_is_named() {
    let data = report(2.0, (12.0, against(0.05)), (4.0, against(0.1)));
    assert!(matches!(advice(&data), Advice::NoneWithin { nearest } if nearest.technique == Technique::Rays));
    let text = in_short(&data).join(" ");
    assert!(text.contains("shadows (nearest: by shadow <rays>, 12.0 ms, RMSE 0.050)"), "{text}");
    assert!(page::build(&data).html.contains("nearest: Shadows by shadow &lt;rays&gt;"));
}

#[test]
fn whether_a_frame_is_in_time_is_told_by_the_interval_of_its_median() {
    for (ms, said) in
        [(12.0, "in time: shadows"), (16.6, "at the limit, sometimes over it: shadows"), (30.0, "too slow: shadows")]
    {
        let text = in_short(&report(2.0, (ms, against(0.001)), (90.0, against(0.001)))).join(" ");
        assert!(
            text.contains(&format!("At 60 frames a second (16.7 ms a frame) each alone is {said}")),
            "{ms}: {text}"
        );
    }
    let text = in_short(&report(71.0, (260.0, against(0.001)), (130.0, against(0.002)))).join(" ");
    assert!(text.contains("the frame without any effect takes 71.0 ms already"), "{text}");
}

#[test]
fn without_a_reference_nothing_is_claimed_about_the_picture() {
    let data = report(2.0, (12.0, missing()), (4.0, missing()));
    assert!(matches!(advice(&data), Advice::UnknownError(fastest) if fastest.frame_ms == 4.0));
    let text = in_short(&data).join(" ");
    assert!(text.contains("(by shadow map: 4.00 ms; the reference would have taken 9 minutes)"), "{text}");
    assert!(!text.contains("RMSE 0.0"), "{text}");

    let data = report(2.0, (12.0, against(0.01)), (4.0, missing()));
    assert!(matches!(advice(&data), Advice::Choose { best, .. } if best.technique == Technique::Rays));
}

#[test]
fn an_effect_without_rows_is_said_to_be_not_measured() {
    let mut data = report(2.0, (12.0, missing()), (4.0, missing()));
    data.sections.clear();
    assert!(verdicts(&data, data.within).iter().all(|verdict| verdict.advice == Advice::NotMeasured));
    assert!(
        in_short(&data)
            .join(" ")
            .contains("Not measured: shadows, soft shadows, reflection, refraction and ambient occlusion")
    );
}

#[test]
fn what_the_choices_would_take_together_is_given_as_an_estimate() {
    let mut data = report(2.0, (12.0, against(0.001)), (24.0, against(0.02)));
    for effect in [Effect::Reflection, Effect::Refraction, Effect::Occlusion] {
        let mut section = data.sections[0].clone();
        section.effect = effect;
        data.sections.push(section);
    }
    let text = in_short(&data).join(" ");
    // 2 ms without effects, and 10 ms more for each of four effects.
    assert!(text.contains("All 4 in one frame would take about 42.0 ms, which is too slow"), "{text}");
    assert!(text.contains("an estimate, not a measurement"), "{text}");
}

/// A simulated machine whose frame times have normally distributed noise of 5 %, and whose speed drifts.
struct Machine {
    state: u64,
    drift: Drift,
    /// Present duration of a frame, relative to its duration at first.
    slow: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum Drift {
    /// No drift.
    Still,
    /// Between slots of time, the duration changes by a random factor; its logarithm makes a random walk.
    Walks,
    /// Between slots of time, the duration switches at random between 1 and 1.5 times its first value.
    Steps,
}

impl Machine {
    fn new(drift: Drift) -> Self {
        Self { state: 1, drift, slow: 1.0 }
    }

    fn uniform(&mut self) -> f64 {
        self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.state >> 40) as f64 / f64::from(1 << 24)
    }

    /// The sum of twelve uniform numbers has variance 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn frames(&mut self, ms: f64, frames: usize) -> Vec<f64> {
        (0..frames).map(|_| self.slow * ms * (1.0 + 0.05 * self.normal())).collect()
    }

    /// Lets time pass: with a `share` of 1 the time between two rows that are measured one after the other, with a smaller one the time between two
    /// rows of a round.
    fn pass(&mut self, share: f64) {
        match self.drift {
            Drift::Still => {}
            Drift::Walks => self.slow *= (0.3 * share.sqrt() * self.normal()).exp(),
            Drift::Steps => {
                if self.uniform() < 0.5 * share {
                    self.slow = if self.slow == 1.0 { 1.5 } else { 1.0 };
                }
            }
        }
    }
}

/// Index of the right verdict: trace, rasterise, no difference.
fn right(rays_ms: f64, raster_ms: f64) -> usize {
    match rays_ms / raster_ms {
        ratio if ratio < 1.0 / 1.1 => 0,
        ratio if ratio > 1.1 => 1,
        _ => 2,
    }
}

/// Numbers of verdicts of 300 simulated reports with these numbers of paired rounds and of frames in each: trace, rasterise, no difference.
fn simulated(rays_ms: f64, raster_ms: f64, (rounds, frames): (usize, usize), drift: Drift) -> [usize; 3] {
    let mut machine = Machine::new(drift);
    let mut counts = [0; 3];
    let mut data = report(2.0, (rays_ms, against(0.001)), (raster_ms, against(0.002)));
    let found = candidates(&data, &data.sections[0]);
    let times = [rays_ms, raster_ms];
    for _ in 0..300 {
        machine.slow = 1.0;
        data.bench.paired[0].rounds.clear();
        for round in 0..rounds {
            let mut found = vec![0.0; 2];
            for turn in 0..2 {
                let row = (round + turn) % 2;
                found[row] = Stats::new(machine.frames(times[row], frames)).expect("samples").median;
                // The time from row to row of a round is a hundredth of the time from row to row in the first measurement.
                machine.pass(0.01);
            }
            data.bench.paired[0].rounds.push(found);
        }
        match advise(&found, None, data.within, &data.bench.paired) {
            Advice::Choose { best, .. } => counts[usize::from(best.technique == Technique::Raster)] += 1,
            Advice::NoDifference { .. } => counts[2] += 1,
            other => panic!("{other:?}"),
        }
    }
    counts
}

/// Number of wrong verdicts among 300 that compare the frames of two rows, each measured in a slot of its own.
fn wrong_by_slots(rays_ms: f64, raster_ms: f64, drift: Drift) -> usize {
    let mut machine = Machine::new(drift);
    let wrong = |_: &i32| {
        machine.slow = 1.0;
        // The machine may be in any of its states when the first row is measured.
        machine.pass(1.0);
        let rays = machine.frames(rays_ms, 15);
        machine.pass(1.0);
        let raster = machine.frames(raster_ms, 15);
        let ratio = Interval::of_ratio(&rays, &raster).expect("times are finite");
        let found = if ratio.high < 1.0 / 1.1 { 0 } else { 2 - usize::from(ratio.low > 1.1) };
        found != right(rays_ms, raster_ms)
    };
    (0..300).filter(wrong).count()
}

#[test]
fn noise_of_five_percent_changes_no_verdict() {
    for rounds in [(6, 5), (9, 3), (12, 3), (12, 5)] {
        for (rays, raster) in [(10.0, 15.0), (15.0, 10.0), (10.0, 10.0), (10.0, 12.5), (10.0, 10.4)] {
            let counts = simulated(rays, raster, rounds, Drift::Still);
            assert!(counts[right(rays, raster)] >= 297, "{rounds:?}, {rays} and {raster} ms: {counts:?}");
        }
    }
    // One frame a round, as when the time does not suffice for more.
    assert!(simulated(10.0, 15.0, (6, 1), Drift::Still)[0] >= 297);
    assert!(simulated(10.0, 10.0, (6, 1), Drift::Still)[2] >= 297);
    // Without drift, rows measured one after the other can be told apart.
    assert!(wrong_by_slots(10.0, 15.0, Drift::Still) <= 3);
}

#[test]
fn a_machine_whose_speed_drifts_changes_no_verdict() {
    for drift in [Drift::Walks, Drift::Steps] {
        for (rays, raster) in [(10.0, 12.5), (10.0, 15.0), (12.5, 10.0), (15.0, 10.0), (10.0, 10.0)] {
            let right = right(rays, raster);
            for rounds in [(9, 3), (12, 5)] {
                let counts = simulated(rays, raster, rounds, drift);
                assert!(counts[right] >= 297, "{rounds:?}, {rays} and {raster} ms: {counts:?}");
            }
            // With six rounds, fewer verdicts name the cheaper technique, but none names the more expensive one.
            let counts = simulated(rays, raster, (6, 5), drift);
            assert!(counts[right] >= 270 && counts[right] + counts[2] >= 300, "{rays} and {raster} ms: {counts:?}");
        }
        // Without paired rounds more than one verdict in ten is wrong.
        for (rays, raster) in [(10.0, 12.5), (12.5, 10.0), (10.0, 10.0)] {
            let wrong = wrong_by_slots(rays, raster, drift);
            assert!(wrong > 30, "{rays} and {raster} ms: {wrong} of 300");
        }
    }
}

#[test]
fn without_enough_paired_rounds_nothing_is_certain() {
    let whole = report(2.0, (12.0, against(0.001)), (4.0, against(0.002)));
    let uncertain = |change: &dyn Fn(&mut ReportData)| {
        let mut data = whole.clone();
        change(&mut data);
        let Advice::NotCertain { rays, raster, why } = advice(&data) else { panic!("{:?}", advice(&data)) };
        assert_eq!((rays.frame_ms, raster.frame_ms), (12.0, 4.0));
        let (text, html) = (in_short(&data).join(" "), page::build(&data).html);
        assert!(text.contains("Not certain") && text.contains(&why), "{text}");
        assert!(html.contains("not certain") && !text.contains("Rasterise shadows"), "{text}");
        why
    };
    assert_eq!(uncertain(&|data| data.bench.paired.clear()), "they were not measured against each other");
    assert_eq!(uncertain(&|data| data.bench.paired[0].rounds.truncate(5)), "only 5 paired rounds were measured");
    let late = |data: &mut ReportData| {
        data.bench.paired[0].rounds.clear();
        data.bench.paired[0].missing = Some("left out: it would take about 9 s".to_owned());
    };
    assert_eq!(uncertain(&late), "left out: it would take about 9 s");
    // Paired rounds of other rows do not count.
    uncertain(&|data| data.bench.paired[0].rows[0] = "another".to_owned());
    // Nor do rounds of a setting that takes far longer than another setting within the error.
    uncertain(&|data| {
        let key = data.bench.rows[1].key.clone();
        let slow = BenchRow { key: "slow".to_owned(), frame: stats(30.0), ..data.bench.rows[1].clone() };
        let setting = Setting { row: "slow".to_owned(), ..data.sections[0].settings[0].clone() };
        data.sections[0].settings.push(setting);
        data.bench.rows.push(slow);
        assert_eq!(data.bench.paired[0].rows[0], key);
        data.bench.paired[0].rows[0] = "slow".to_owned();
    });
}

#[test]
fn of_several_settings_the_rounds_tell_the_cheapest() {
    let mut data = report(2.0, (12.0, against(0.001)), (20.0, against(0.002)));
    // Another setting by raster: it took longer at first, but not in the paired rounds.
    let other = BenchRow {
        key: "other map".to_owned(),
        label: "Shadows by another map".to_owned(),
        frame: stats(22.0),
        ..data.bench.rows[2].clone()
    };
    data.bench.rows.push(other);
    let setting = Setting { row: "other map".to_owned(), ..data.sections[0].settings[1].clone() };
    data.sections[0].settings.push(setting);
    data.bench.paired[0].rows.push("other map".to_owned());
    data.bench.paired[0].rounds = vec![vec![12.0, 19.0, 9.0]; 6];
    let Advice::Choose { best, other: Some((other, ratio)) } = advice(&data) else { panic!("{:?}", advice(&data)) };
    assert_eq!((best.key.as_str(), best.frame_ms, other.frame_ms), ("other map", 9.0, 12.0));
    assert_eq!(best.interval, Some(Interval { low: 9.0, high: 9.0 }));
    assert!(ratio.holds(12.0 / 9.0), "{ratio:?}");
}

#[test]
fn verdicts_can_be_made_again_from_what_is_written() {
    let data = report(2.0, (12.0, against(0.001)), (4.0, against(0.002)));
    let text = serde_json::to_string(&data).expect("JSON");
    let again: ReportData = serde_json::from_str(&text).expect("a report");
    assert_eq!((advice(&again), in_short(&again)), (advice(&data), in_short(&data)));
    // Files of earlier versions have no paired rounds.
    let mut old: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert!(old["bench"].as_object_mut().expect("a file").remove("paired").is_some());
    let old: ReportData = serde_json::from_value(old).expect("an older report");
    assert!(matches!(advice(&old), Advice::NotCertain { .. }));
}

#[test]
fn another_round_adds_its_samples_to_a_row() {
    let mut first = row("a", "shadows", Technique::Rays, 10.0, missing());
    first.frame_processor = Some(stats(19.0));
    let mut second = row("a", "shadows", Technique::Rays, 30.0, missing());
    second.peak_memory_bytes = Some(300 << 20);
    let (once, again) = (first.frame.samples.clone(), second.frame.samples.clone());
    first.add(&second);
    assert_eq!(first.frame.samples, [once, again].concat());
    assert_eq!(first.frame.median, (10.5 + 29.4) / 2.0);
    assert_eq!(first.steps[1].host.n(), 6);
    assert!((first.ray_share.expect("it traces") - 0.55).abs() < 1e-12);
    assert_eq!(first.frame_processor, None, "one of the rounds did not tell");
    assert_eq!(first.peak_memory_bytes, Some(300 << 20));
}

#[test]
fn the_pareto_front_holds_what_nothing_beats() {
    let points = [(1.0, 5.0), (2.0, 2.0), (2.0, 3.0), (3.0, 2.0), (9.0, 0.0), (1.0, 5.0)];
    assert_eq!(pareto_front(&points), [true, true, false, false, true, true]);
    assert!(pareto_front(&[]).is_empty());
}

/// Checks that every element is closed, in order, and that there is no stray `<` or `&`. HTML's void elements have no end.
fn assert_well_formed(html: &str) {
    const VOID: [&str; 5] = ["meta", "link", "img", "input", "br"];
    let mut open: Vec<String> = Vec::new();
    let mut rest = html;
    while let Some(start) = rest.find('<') {
        rest = &rest[start + 1..];
        let end = rest.find('>').expect("every tag ends");
        let tag = &rest[..end];
        rest = &rest[end + 1..];
        if tag.starts_with('!') {
            continue;
        }
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name), "`</{name}>` closes what is open");
        } else if !tag.ends_with('/') {
            let name = tag.split_whitespace().next().expect("a name").to_owned();
            if VOID.contains(&name.as_str()) {
                continue;
            }
            if name == "script" || name == "style" {
                rest = &rest[rest.find(&format!("</{name}>")).expect("it ends")..];
            }
            open.push(name);
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
}

#[test]
fn the_page_is_well_formed_escapes_names_and_asks_the_network_for_nothing() {
    let page = page::build(&report(2.0, (12.0, against(0.001)), (4.0, against(0.02))));
    assert_well_formed(&page.html);
    assert!(page.html.contains("shadow &lt;rays&gt;") && !page.html.contains("shadow <rays>"));
    assert!(page.html.contains("no adapter &amp; no driver"));
    // References inside the page, to a filter and to pictures chosen in lists, are allowed.
    let beyond = page.html.replace("url(#", "").replace("url(\"${select.value}\")", "");
    for word in ["http:", "https:", "//cdn", "@import", "url("] {
        assert!(!beyond.contains(word), "`{word}`");
    }
    for (name, svg) in &page.plots {
        assert_well_formed(svg);
        assert!(page.html.contains(&format!("plots/{name}")));
        assert_eq!(svg.matches("http").count(), 1, "the namespace of SVG alone");
    }
    assert!(std::panic::catch_unwind(|| assert_well_formed("<p><b>x</p></b>")).is_err());
}

#[test]
fn every_picture_has_a_text_and_the_page_is_whole_without_its_script() {
    let data = report(2.0, (12.0, against(0.001)), (4.0, against(0.02)));
    let html = page::build(&data).html;
    for image in html.split("<img").skip(1) {
        let tag = image.split('>').next().expect("a tag");
        let alt = tag.split("alt=\"").nth(1).and_then(|rest| rest.split('"').next());
        assert!(alt.is_some_and(|alt| alt.len() > 10), "{tag}");
    }
    for picture in &data.sections[0].pictures {
        assert!(html.split("<script>").next().expect("a page").contains(&picture.file), "{}", picture.file);
    }
    assert!(html.contains("<div class=\"compare\" id=\"compare-shadows\" hidden>"));
    // On paper the comparison stays hidden, and the pictures that the script hides are shown.
    let (_, print) = html.split_once("@media print").expect("rules for paper");
    let (print, _) = print.split_once("</style>").expect("the end of the rules");
    assert!(print.contains(".compare { display: none !important; }") && !print.contains("[hidden]"), "{print}");
    assert!(print.contains(".pictures { display: grid !important;"), "{print}");
    assert_eq!(html.matches("<h1>").count(), 1);
    for id in ["in-short", "missing", "effects", "shadows", "scaling", "method", "machine"] {
        assert!(html.contains(&format!("href=\"#{id}\"")) && html.contains(&format!("id=\"{id}\"")), "{id}");
    }
}

#[test]
fn what_was_not_measured_is_a_dash_and_a_sentence() {
    let mut data = report(2.0, (12.0, missing()), (4.0, missing()));
    data.sections[0].pictures.clear();
    data.scalings[0].series.clear();
    let html = page::build(&data).html;
    assert_well_formed(&html);
    assert!(html.contains("No setting of this effect has both a time and an error."));
    assert!(html.contains("No picture could be rendered.") && html.contains("No scene of another size was measured."));
    assert!(html.contains("<li>No error: the reference would have taken 9 minutes</li>"));
    assert!(html.contains("<td class=\"none\" data-v=\"\">–</td>"));
}

#[test]
fn the_devices_own_time_of_ray_passes_has_a_column_where_it_is_known_for_some_row() {
    let mut data = report(5.0, (9.0, against(0.01)), (7.0, against(0.02)));
    assert!(!page::build(&data).html.contains("on GPU, ms"));
    assert!(data.bench.rows.iter().all(|row| text::ray_device_ms(row).is_none()));
    let step = data.bench.rows[1].steps.iter_mut().find(|step| step.kind == StepKind::Rays).expect("it traces");
    step.device = Some(stats(1.25));
    assert_eq!(text::ray_device_ms(&data.bench.rows[1]), Some(1.25));
    let html = page::build(&data).html;
    assert!(html.contains("on GPU, ms") && html.contains("data-v=\"1.25\""));
    assert_well_formed(&html);
    let csv = text::csv(&data.bench);
    let column = csv.lines().next().and_then(|line| line.split(',').position(|name| name == "ray_device_ms"));
    assert_eq!(csv.lines().nth(2).and_then(|line| line.split(',').nth(column?)), Some("1.25"));
    assert!(text::markdown(&data.bench).contains("| 1.25 |"));
}

#[test]
fn what_adaptive_sampling_spent_is_said() {
    let mut data = report(5.0, (9.0, against(0.01)), (7.0, against(0.02)));
    assert!([page::build(&data).html, text::markdown(&data.bench)].iter().all(|page| !page.contains("Adaptive")));
    let step = data.bench.rows[1].steps.iter_mut().find(|step| step.kind == StepKind::Rays).expect("it traces");
    let spent =
        PathsSpent { asked: 0.01, error: 0.0098, met: true, pixels: 12_000, paths: 446_400, most: 512, exhausted: 0 };
    step.adaptive = Some(spent);
    let said = "error 9.80e-3 for 0.01 asked, 37.2 paths a pixel at 12000 pixels of stochastic glass, at most 512";
    let html = page::build(&data).html;
    assert!(html.contains("Adaptive sampling:") && html.contains(said), "{html}");
    assert_well_formed(&html);
    assert!(text::markdown(&data.bench).contains(said));
    let [none, missed] =
        [PathsSpent { pixels: 0, paths: 0, ..spent }, PathsSpent { met: false, exhausted: 3, ..spent }];
    assert!(none.to_string().contains("no stochastic glass is seen") && none.mean() == 0.0);
    assert!(missed.to_string().starts_with("ERROR NOT MET, paths ran out at 3 pixels: error"), "{missed}");
    let both = spent.together(PathsSpent { error: 0.02, most: 8, ..missed });
    assert!(both.error == 0.02 && !both.met && both.most == 512 && both.exhausted == 3 && both.mean() == spent.mean());
}

#[test]
fn plots_survive_a_single_row_equal_values_and_an_exact_picture() {
    let mut data = report(5.0, (5.0, against(0.0)), (5.0, against(0.0)));
    let plot = plots::speed_against_error(&data, &data.sections[0]).expect("a plot");
    assert!(plot.inline.contains("no error") && !plot.inline.contains("NaN") && !plot.inline.contains("inf"));
    let rows: Vec<&BenchRow> = data.bench.rows.iter().collect();
    let bars = plots::frame_bars("Bars", &rows[..1], "").expect("a plot");
    assert!(bars.inline.contains("5.00 ms"), "{}", bars.inline);
    assert!(plots::frame_bars("Bars", &[], "").is_none());
    assert!(plots::scaling_plot(&data, &data.scalings[0]).is_some());
    data.bench.rows.clear();
    assert!(plots::speed_against_error(&data, &data.sections[0]).is_none());
    assert!(plots::scaling_plot(&data, &data.scalings[0]).is_none());
}

#[test]
fn the_passes_of_a_row_are_drawn_with_their_times_on_the_edges() {
    let data = report(1.0, (4.0, against(0.01)), (3.0, against(0.05)));
    let graph = &data.sections[0].graphs[0];
    let plot = plots::pass_graph(graph, &data.bench.rows[1]).expect("a plot");
    // The steps of `pass1` take 0.4 of 4 ms, and those of `pass2` 0.55.
    for word in
        ["pass2: does &lt;pass2&gt;", "1.60 ms, pos", "1.60 ms, color", "2.20 ms, test", "the window: 4.00 ms a frame"]
    {
        assert!(plot.inline.contains(word), "{word}: {}", plot.inline);
    }
    let html = page::build(&data).html;
    assert!(html.contains("plots/shadows-passes-1.svg") && !html.contains("plots/shadows-passes-2.svg"));
    assert!(plots::pass_graph(&PassGraph { passes: Vec::new(), ..graph.clone() }, &data.bench.rows[1]).is_none());
}

#[test]
fn samples_and_threads_are_told_by_the_line_and_not_by_the_row() {
    let mut data = report(1.0, (4.0, against(0.01)), (3.0, against(0.05)));
    let (label, technique) = ("rays".to_owned(), Technique::Rays);
    let rows = vec![data.bench.rows[1].key.clone(), data.bench.rows[2].key.clone()];
    let series = vec![ScalingSeries { label, technique, rows, amounts: vec![1.0, 16.0] }];
    data.scalings.push(Scaling { against: Against::Samples, series });
    let scaling = &data.scalings[1];
    let amounts: Vec<f64> = data.points(scaling.against, &scaling.series[0]).map(|(_, amount)| amount).collect();
    assert_eq!(amounts, [1.0, 16.0]);
    assert!(plots::scaling_plot(&data, scaling).is_some_and(|plot| plot.inline.contains("depths read")));
    let html = page::build(&data).html;
    assert!(html.contains("Against samples") && html.contains("plots/scaling-samples.svg"));
    assert_well_formed(&html);
}

#[test]
fn lights_have_a_curve_of_their_own() {
    let mut data = report(1.0, (4.0, against(0.01)), (3.0, against(0.05)));
    let (label, technique) = ("Shadows by rays".to_owned(), Technique::Rays);
    let rows = ["none", "shadow map", "shadow <rays>"].map(str::to_owned).to_vec();
    let series = vec![ScalingSeries { label, technique, rows, amounts: vec![1.0, 2.0, 8.0] }];
    data.scalings.push(Scaling { against: Against::Lights, series });
    let html = page::build(&data).html;
    assert!(html.contains("Against lights") && html.contains("plots/scaling-lights.svg"));
    assert!(html.contains("turned about the vertical"));
    let plot = plots::scaling_plot(&data, &data.scalings[1]).expect("a plot").inline;
    // 1, 3 and 4 ms for 1, 2 and 8 lights.
    assert!(plot.contains("exponent 0.60") && plot.contains("Frame time against lights"), "{plot}");
    assert_well_formed(&html);
    data.scalings[1].series[0].rows.clear();
    assert!(page::build(&data).html.contains("No number of lights was measured."));
}

#[test]
fn bars_stand_from_fast_to_slow_and_a_place_of_no_error_is_beyond_a_break() {
    let data = report(1.0, (4.0, against(0.01)), (3.0, against(0.0)));
    let rows: Vec<&BenchRow> = data.bench.rows[1..].iter().collect();
    let bars = plots::frame_bars("Bars", &rows, "").expect("a plot").inline;
    let place = |text: &str| bars.find(text).unwrap_or_else(|| panic!("{text}: {bars}"));
    assert!(place("shadow map") < place("shadow &lt;rays&gt;"));
    let strokes = |data: &ReportData| {
        let plot = plots::speed_against_error(data, &data.sections[0]).expect("a plot").inline;
        (plot.contains(">\n0\n<"), plot.matches("stroke-width=\"2\"").count())
    };
    let exact = strokes(&data);
    let inexact = strokes(&report(1.0, (4.0, against(0.01)), (3.0, against(0.05))));
    assert!(exact.0 && !inexact.0 && exact.1 == inexact.1 + 2, "{exact:?} {inexact:?}");
}

#[test]
fn marks_of_speed_against_error_have_the_intervals_of_their_times() {
    let data = report(1.0, (4.0, against(0.01)), (3.0, against(0.05)));
    let strokes = |data: &ReportData| {
        let plot = plots::speed_against_error(data, &data.sections[0]).expect("a plot").inline;
        let ends = |line: &str| -> Option<[i32; 4]> {
            let (_, points) = line.split_once("points=\"")?;
            let numbers: Vec<i32> =
                points.split('"').next()?.split([' ', ',']).filter_map(|number| number.parse().ok()).collect();
            numbers.try_into().ok()
        };
        // Lengths of the short horizontal lines in the colours of marks.
        let level = |[from, y, to, at]: [i32; 4]| (y == at && (from - to).abs() < 200).then_some((from - to).abs());
        let marked = plot.lines().filter(|line| line.contains("var(--rays") || line.contains("var(--raster"));
        marked.filter_map(|line| level(ends(line)?)).collect::<Vec<i32>>()
    };
    let found = strokes(&data);
    assert_eq!(found.len(), 2, "{found:?}");
    let mut wide = data.clone();
    wide.bench.rows[1].frame = Stats::new(vec![4.0, 3.0, 6.0]).expect("samples");
    assert!(strokes(&wide).iter().max() > found.iter().max(), "{:?} {found:?}", strokes(&wide));
}

#[test]
fn the_words_at_the_line_of_60_frames_a_second_are_never_cut() {
    const WORDS: &str = "60 frames a second";
    let mut sides = Vec::new();
    for slowest_ms in [4.0, 90.0] {
        let data = report(1.0, (slowest_ms, against(0.01)), (3.0, against(0.05)));
        let plot = plots::speed_against_error(&data, &data.sections[0]).expect("a plot").inline;
        let (before, _) = plot.split_once(WORDS).expect("the line is there");
        let (_, tag) = before.rsplit_once("<text ").expect("an element");
        let (_, x) = tag.split_once("x=\"").expect("a place");
        let x: i32 = x.split('"').next().and_then(|x| x.parse().ok()).expect("a number");
        let is_end = tag.contains("text-anchor=\"end\"");
        let right = if is_end { x } else { x + 7 * WORDS.len() as i32 };
        assert!(x > 0 && right < 760, "{slowest_ms} ms: {tag}");
        sides.push(is_end);
    }
    assert_eq!(sides, [true, false], "to the left of the line at the right edge");
}

#[test]
fn errors_of_pictures_have_columns_where_one_is_known_and_else_a_reason() {
    let mut data = report(1.0, (4.0, against(0.01)), (3.0, against(0.05)));
    let none = page::build(&data).html;
    assert!(!none.contains("Error of the picture"), "rows of older files have none");
    let missing = RowError::Missing("the reference of the picture is not made".to_owned());
    data.bench.rows[1].picture_error = Some(missing);
    let reason = page::build(&data).html;
    assert!(!reason.contains("Error of the picture") && reason.contains("the reference of the picture is not made"));
    let RowError::Against { reference, key, comparison, .. } = against(0.123) else { panic!("an error") };
    data.bench.rows[2].picture_error = Some(RowError::Against { reference, key, own_error: 0.1, comparison });
    let known = page::build(&data).html;
    assert!(known.contains("Error of the picture") && known.contains("≤ 0.12"));
    assert!(known.contains("whose own standard error is 0.1000") && known.contains("is not made"));
}

#[test]
fn rows_of_several_samples_a_pixel_have_a_section_where_there_are_any() {
    let mut data = report(1.0, (4.0, against(0.01)), (3.0, against(0.05)));
    assert!(!page::build(&data).html.contains("Samples a pixel"));
    let mut several = row("sixteen", "shadows", Technique::Rays, 60.0, against(0.001));
    "Shadows by rays, 16 samples a pixel".clone_into(&mut several.label);
    let RowError::Against { reference, key, comparison, .. } = against(0.0321) else { panic!("an error") };
    several.picture_error = Some(RowError::Against { reference, key, own_error: 0.001, comparison });
    data.pixel_samples = vec![data.bench.rows[1].key.clone(), several.key.clone()];
    data.bench.rows.push(several);
    let html = page::build(&data).html;
    assert_well_formed(&html);
    let (_, section) = html.split_once("id=\"pixel-samples\"").expect("the section");
    let (section, _) = section.split_once("</section>").expect("its end");
    assert!(section.contains("16 samples a pixel") && section.contains("0.032"), "{section}");
    assert!(section.contains("Error of the picture") && html.contains("href=\"#pixel-samples\""));
}
