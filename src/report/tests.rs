//! The page and its summary from invented numbers: nothing is rendered.

use super::model::{
    Against, Effect, FlipMap, Picture, ReportData, Scaling, ScalingSeries, SceneFacts, Section, Setting, Without,
};
use super::summary::{Advice, FRAME_60_MS, in_short, pareto_front, verdicts};
use super::{page, plots};
use crate::bench::model::{
    BenchFile, BenchRow, BenchStep, EngineName, FORMAT, RowError, Stats, Technique, Unavailable,
};
use crate::bench::text;
use crate::environment::Environment;
use crate::pipeline::backend::RayCounts;
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

/// A row of `ms` milliseconds. `rmse` of 0 is an exact picture.
fn row(key: &str, effect: &str, technique: Technique, ms: f64, error: RowError) -> BenchRow {
    let step = |kind, name: &str, share: f64, rays: Option<u64>| BenchStep {
        kind,
        name: name.to_owned(),
        host: stats(ms * share),
        device: None,
        rays: rays.map(|shadow| RayCounts { shadow, ..RayCounts::default() }),
        mrays_per_second: None,
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
        frame_device: None,
        steps,
        setup: Vec::new(),
        ray_share: (technique == Technique::Rays).then_some(0.55),
        peak_memory_bytes: Some(100 << 20),
        held_bytes: 1 << 20,
        error,
        thesis: None,
    }
}

/// A report of shadows by both techniques, with these times and errors: `(rays, raster)`.
fn report(base_ms: f64, rays: (f64, RowError), raster: (f64, RowError)) -> ReportData {
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
        without: None,
        settings: vec![setting(&rows[1], "rays", "1 ray"), setting(&rows[2], "shadow map", "2048")],
    };
    ReportData {
        scene: SceneFacts { file: "largoCamoes.cbo".to_owned(), triangles: 56_000 },
        size: [64, 64],
        quick: false,
        budget_s: 600.0,
        took_s: 71.0,
        table: rows.iter().map(|row| row.key.clone()).collect(),
        sections: vec![section],
        scalings: vec![Scaling {
            against: Against::Triangles,
            series: vec![ScalingSeries {
                label: "no effects".to_owned(),
                technique: Technique::None,
                rows: vec!["none".to_owned()],
            }],
        }],
        bench: BenchFile {
            format: FORMAT,
            command: "curitiba report".to_owned(),
            started_unix_s: 1_700_000_000,
            environment: Environment::here(),
            frames: 3,
            warmup: 1,
            complete: true,
            rows,
            unavailable: vec![Unavailable { what: "wgpu".to_owned(), why: "no adapter & no driver".to_owned() }],
        },
    }
}

fn missing() -> RowError {
    RowError::Missing("the reference would have taken 9 minutes".to_owned())
}

fn advice(data: &ReportData) -> Advice {
    verdicts(data, FRAME_60_MS).remove(0).advice
}

#[test]
fn the_most_exact_setting_that_fits_is_chosen_and_its_error_is_told() {
    let data = report(2.0, (12.0, against(0.001)), (4.0, against(0.02)));
    assert!(matches!(advice(&data), Advice::Fits(chosen) if chosen.technique == Technique::Rays));
    let text = in_short(&data).join(" ");
    assert!(text.contains("Trace shadows (by shadow <rays>: 12.0 ms, RMSE 0.0010, FLIP 0.0020)."), "{text}");
    assert!(text.contains("1 of 4 effects"), "{text}");
    assert!(text.contains("Not measured: reflection, refraction and ambient occlusion"), "{text}");

    let data = report(2.0, (17.0, against(0.001)), (4.0, against(0.02)));
    assert!(matches!(advice(&data), Advice::Fits(chosen) if chosen.technique == Technique::Raster));
    assert!(in_short(&data).join(" ").contains("Rasterise shadows (by shadow map: 4.00 ms, RMSE 0.020"));
}

#[test]
fn errors_that_the_reference_cannot_tell_are_equal_and_the_faster_wins() {
    let data = report(2.0, (12.0, against(0.000_1)), (4.0, against(0.000_3)));
    assert!(matches!(advice(&data), Advice::Fits(chosen) if chosen.technique == Technique::Raster));
    assert!(in_short(&data).join(" ").contains("error below the 0.00040 that the reference can tell"));
}

#[test]
fn what_fits_is_advised_only_where_it_is_better_than_nothing() {
    let mut data = report(2.0, (17.0, against(0.001)), (4.0, against(0.02)));
    data.sections[0].without = Some(Without { row: "none".to_owned(), error: against(0.05) });
    assert!(matches!(advice(&data), Advice::Fits(chosen) if chosen.technique == Technique::Raster));
    data.sections[0].without = Some(Without { row: "none".to_owned(), error: against(0.015) });
    let Advice::LeaveOut { best, without } = advice(&data) else { panic!("an effect that harms is advised") };
    assert_eq!((best.frame_ms, without.frame_ms), (4.0, 2.0));
    let text = in_short(&data).join(" ");
    let expected = "Leave out shadows, since the best that fits (by shadow map: 4.00 ms, RMSE 0.020";
    assert!(text.contains(expected) && text.contains("(RMSE 0.015"), "{text}");
    assert!(page::build(&data).html.contains("leave out"));
    // Rays that fit are better.
    let mut data = report(2.0, (12.0, against(0.001)), (4.0, against(0.02)));
    data.sections[0].without = Some(Without { row: "none".to_owned(), error: against(0.015) });
    assert!(matches!(advice(&data), Advice::Fits(chosen) if chosen.technique == Technique::Rays));
    data.sections[0].without = Some(Without { row: "none".to_owned(), error: missing() });
    assert!(matches!(advice(&data), Advice::Fits(_)));
}

#[test]
fn where_nothing_fits_the_cheapest_is_named_with_the_other_technique_beside_it() {
    let data = report(71.0, (260.0, against(0.001)), (130.0, against(0.02)));
    let Advice::NothingFits { cheapest, other } = advice(&data) else { panic!("something fits") };
    assert_eq!((cheapest.frame_ms, other.map(|other| other.frame_ms)), (130.0, Some(260.0)));
    let text = in_short(&data).join(" ");
    assert!(text.contains("no effect runs at 60 frames a second"), "{text}");
    assert!(text.contains("the frame without any effect takes 71.0 ms already"), "{text}");
    assert!(text.contains("shadows by shadow map (130 ms, RMSE 0.020; by shadow <rays> 260 ms"), "{text}");
}

#[test]
fn where_nothing_fits_what_is_worse_than_nothing_is_not_the_cheapest() {
    let mut data = report(71.0, (260.0, against(0.001)), (130.0, against(0.02)));
    data.sections[0].without = Some(Without { row: "none".to_owned(), error: against(0.01) });
    let Advice::NothingFits { cheapest, other } = advice(&data) else { panic!("something fits") };
    assert_eq!((cheapest.frame_ms, other), (260.0, None));
    data.sections[0].without = Some(Without { row: "none".to_owned(), error: against(0.000_1) });
    assert!(matches!(advice(&data), Advice::NothingFits { cheapest, .. } if cheapest.frame_ms == 130.0));
}

#[test]
fn without_a_reference_nothing_is_claimed_about_the_picture() {
    let data = report(2.0, (12.0, missing()), (4.0, missing()));
    assert!(matches!(advice(&data), Advice::FitsWithUnknownError(chosen) if chosen.frame_ms == 4.0));
    let text = in_short(&data).join(" ");
    assert!(text.contains("its error is not known: the reference would have taken 9 minutes"), "{text}");
    assert!(!text.contains("RMSE"), "{text}");

    let data = report(2.0, (12.0, against(0.5)), (4.0, missing()));
    assert!(matches!(advice(&data), Advice::Fits(chosen) if chosen.technique == Technique::Rays));
}

#[test]
fn an_effect_without_rows_is_said_to_be_not_measured() {
    let mut data = report(2.0, (12.0, missing()), (4.0, missing()));
    data.sections.clear();
    assert!(verdicts(&data, FRAME_60_MS).iter().all(|verdict| verdict.advice == Advice::NotMeasured));
    assert!(in_short(&data).join(" ").contains("Not measured: shadows, reflection, refraction and ambient occlusion"));
}

#[test]
fn where_everything_fits_the_sum_of_what_is_added_is_given_as_an_estimate() {
    let mut data = report(2.0, (12.0, against(0.001)), (4.0, against(0.02)));
    for effect in [Effect::Reflection, Effect::Refraction, Effect::Occlusion] {
        let mut section = data.sections[0].clone();
        section.effect = effect;
        data.sections.push(section);
    }
    let text = in_short(&data).join(" ");
    assert!(text.contains("each of the effects, taken alone, can run"), "{text}");
    // 2 ms without effects and 10 ms more for each of four.
    assert!(text.contains("All 4 in one frame would take about 42.0 ms, which no longer fits"), "{text}");
    assert!(text.contains("an estimate, not a measurement"), "{text}");
}

#[test]
fn the_pareto_front_holds_what_nothing_beats() {
    let points = [(1.0, 5.0), (2.0, 2.0), (2.0, 3.0), (3.0, 2.0), (9.0, 0.0), (1.0, 5.0)];
    assert_eq!(pareto_front(&points), [true, true, false, false, true, true]);
    assert!(pareto_front(&[]).is_empty());
}

/// Every element is closed, in order; the page has no stray `<` or `&`. HTML's void elements have no end.
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
    for word in ["http:", "https:", "//cdn", "@import", "url("] {
        assert!(!page.html.contains(word), "`{word}`");
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
    assert_eq!(html.matches("<h1>").count(), 1);
    for id in ["in-short", "missing", "effects", "shadows", "scaling", "method"] {
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
