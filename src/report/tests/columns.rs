//! Columns that stand on the page and in tables only where some row has something to say there.

use super::{against, assert_well_formed, report};
use crate::bench::text;
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
    // No glass is seen.
    data.bench.rows[2].steps[2].answers = Some(Answers::default());
    assert!(!page::build(&data).html.contains("Glass pixels answered"));
    assert_eq!(csv_cell(&data, 2, "glass_pixels").as_deref(), Some("0"));
    assert_eq!(csv_cell(&data, 2, "glass_by_screen").as_deref(), Some(""));
}
