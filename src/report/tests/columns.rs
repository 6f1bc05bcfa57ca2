//! Tests of columns and sentences that appear only if there is something to show.

use super::{against, assert_well_formed, report};
use crate::bench::model::Stats;
use crate::bench::{Outliers, text};
use crate::pipeline::backend::Answers;
use crate::report::model::ReportData;
use crate::report::page;

/// A cell of the CSV file; no field of these rows has a comma.
fn csv_cell(data: &ReportData, row: usize, name: &str) -> Option<String> {
    let csv = text::csv(&data.bench);
    let mut lines = csv.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let column = lines.next()?.iter().position(|found| found == name)?;
    lines.nth(row)?.get(column).cloned()
}

#[test]
fn what_answered_the_glass_has_columns_where_it_is_known_for_some_row() {
    let mut data = report(5.0, (9.0, against(0.01)), (7.0, against(0.02)));
    let pages = |data: &ReportData| [page::build(data).html, text::markdown(&data.bench)];
    assert!(pages(&data).iter().all(|page| !page.contains("answered") && !page.contains("of glass")));
    assert_eq!(csv_cell(&data, 2, "glass_by_screen").as_deref(), Some(""));
    data.bench.rows[2].steps[2].answers = Some(Answers { screen: 250, cube: 625, rays: 125, kept: 0 });
    let [html, markdown] = pages(&data);
    assert!(
        html.contains("Glass pixels answered") && html.contains("<td class=\"extra\" data-v=\"0.625\">62.5 %</td>")
    );
    assert_well_formed(&html);
    let said = "1000 pixels of glass: screen 25.00 %, cube 62.50 %, rays 12.50 %";
    assert!(markdown.contains(&format!("| {said} |\n")) && markdown.contains("| glass answered by |"), "{markdown}");
    assert_eq!(markdown.matches("of glass").count(), 1, "the other rows have a dash");
    assert_eq!(text::of_answers(&data.bench.rows), [format!("Shadows by shadow map, Fonte: {said}")]);
    assert_eq!(csv_cell(&data, 2, "glass_pixels").as_deref(), Some("1000"));
    assert_eq!(csv_cell(&data, 2, "glass_by_screen").as_deref(), Some("0.25"));
    assert_eq!(csv_cell(&data, 1, "glass_pixels").as_deref(), Some(""));
    // No glass is visible.
    data.bench.rows[2].steps[2].answers = Some(Answers::default());
    assert!(!page::build(&data).html.contains("Glass pixels answered"));
    assert_eq!(csv_cell(&data, 2, "glass_pixels").as_deref(), Some("0"));
    assert_eq!(csv_cell(&data, 2, "glass_by_screen").as_deref(), Some(""));
}

#[test]
fn outlying_frames_are_counted_on_the_page_in_tables_and_in_one_sentence() {
    let mut data = report(5.0, (9.0, against(0.01)), (7.0, against(0.02)));
    assert_eq!(text::of_outliers(&data.bench.rows), None, "three samples have no outliers");
    // Quartiles at 1.1 and 1.3: the fences are at 1.6 and 1.9.
    let steady = [1.0, 1.1, 1.2, 1.3];
    let samples = |more: &[f64]| Stats::new([&steady, more].concat()).expect("samples");
    data.bench.rows[1].frame = samples(&[1.5]);
    assert_eq!(text::of_outliers(&data.bench.rows), None);
    data.bench.rows[1].frame = samples(&[1.7]);
    assert_eq!(csv_cell(&data, 1, "mild_outliers").as_deref(), Some("1"));
    assert_eq!(text::of_outliers(&data.bench.rows), None, "mild ones are not worth a sentence");
    data.bench.rows[2].frame = samples(&[90.0]);
    assert_eq!(csv_cell(&data, 2, "severe_outliers").as_deref(), Some("1"));
    let said = "severe outliers: 1 of 13 frames; most in Shadows by shadow map, Fonte: 1 of 5";
    assert_eq!(text::of_outliers(&data.bench.rows).as_deref(), Some(said));
    let markdown = text::markdown(&data.bench);
    assert!(
        markdown.contains("| 5 | 1 + 0 |") && markdown.contains("| 5 | 0 + 1 |") && markdown.contains("| 3 | 0 + 0 |")
    );
    let html = page::build(&data).html;
    assert!(html.contains("Outlying frames") && html.contains("<td class=\"extra\" data-v=\"1\">1</td>"));
    assert_well_formed(&html);
    // With another round, outliers are counted again over all samples.
    let more = data.bench.rows[2].clone();
    data.bench.rows[2].add(&more);
    assert_eq!(data.bench.rows[2].outliers, Some(Outliers { mild: 0, severe: 2 }));
}

#[test]
fn a_busy_machine_is_told_beside_the_result() {
    let mut data = report(5.0, (9.0, against(0.01)), (7.0, against(0.02)));
    data.bench.environment.threads = 16;
    for (load, said) in [(Some(4.0), false), (Some(4.1), true), (None, false)] {
        data.bench.environment.load_average = load;
        let html = page::build(&data).html;
        assert_eq!(html.contains("Other programs were at work"), said, "{load:?}");
    }
}
