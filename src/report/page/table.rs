//! Tables of rows, which the page's script makes sortable.

use super::tag;
use crate::bench::model::{BenchRow, RowError, Stats};
use crate::bench::text::{answered_shares, of_pictures, ray_device_ms, spent};
use crate::pipeline::metrics::Comparison;
use crate::report::model::{Against, ReportData, Scaling};
use crate::report::number::{bytes, error, grouped, significant};
use maud::{Markup, html};

/// A table of rows with columns in groups. Optional columns appear if at least one row has a value for them.
pub fn rows(data: &ReportData, rows: &[&BenchRow], caption: &str) -> Markup {
    let device = rows.iter().any(|row| row.frame_device.is_some());
    let processor = rows.iter().any(|row| row.frame_processor.is_some());
    let rays = rows.iter().any(|row| row.rays.is_some());
    let thesis = rows.iter().any(|row| row.thesis.is_some());
    let mut columns = vec!["Row", "By", "View", "median", "RMSE", "FLIP", "SSIM", "against"];
    let pictures = rows.iter().any(|row| of_picture(row).is_some());
    if pictures {
        columns.extend(["RMSE", "FLIP"]);
    }
    let on_device = rows.iter().any(|row| ray_device_ms(row).is_some());
    if rays {
        columns.extend(["in rays", "rays", "M/s"]);
    }
    if on_device {
        columns.push("on GPU, ms");
    }
    let answered = rows.iter().any(|row| answered_shares(row).is_some());
    if answered {
        columns.extend(GLASS);
    }
    columns.extend(["95 %", "min", "max", "n"]);
    if processor {
        columns.push("processor");
    }
    if device {
        columns.push("device");
    }
    columns.extend(OUTLIERS);
    columns.extend(["rel. MSE", "PSNR, dB", "energy", "outliers", "Memory"]);
    if thesis {
        columns.extend(["ms", "ratio"]);
    }
    let references = References::of(rows);
    html! {
        div.scroll.wide tabindex="0" role="group" aria-label=(format!("Table: {caption}")) {
            table.sortable {
                caption { (caption) "; " (data.size[0]) " × " (data.size[1]) " pixels" }
                thead {
                    tr.groups {
                        th colspan="3" {}
                        th scope="colgroup" { "Frame, ms" }
                        th scope="colgroup" colspan="4" { "Error of the effect" }
                        @if pictures { th scope="colgroup" colspan="2" { "Error of the picture" } }
                        @if rays { th scope="colgroup" colspan=(3 + usize::from(on_device)) { "Rays of a frame" } }
                        @if answered { th.extra scope="colgroup" colspan=(GLASS.len()) { "Glass pixels answered" } }
                        th scope="colgroup" colspan=(4 + usize::from(processor) + usize::from(device)) { "Time of a frame, ms" }
                        th.extra scope="colgroup" colspan="2" { "Outlying frames" }
                        th.extra scope="colgroup" colspan="4" { "More errors" }
                        th {}
                        @if thesis { th scope="colgroup" colspan="2" { "2014" } }
                    }
                    tr {
                        @for (index, column) in columns.iter().enumerate() {
                            @let text = matches!(*column, "Row" | "By" | "View");
                            @let extra = [&EXTRA[..], &GLASS, &OUTLIERS].iter().any(|extra| extra.contains(column));
                            th.text[text].extra[extra] scope="col" data-column=(index) { (column) }
                        }
                    }
                }
                tbody {
                    @for row in rows {
                        tr {
                            th scope="row" { (row.label) }
                            td.text { (tag(row.technique)) }
                            td.text { (row.view) }
                            td data-v=(row.frame.median) { strong { (significant(row.frame.median)) } }
                            (errors(row))
                            (references.cell(row))
                            @if pictures { (picture_errors(row)) }
                            @if rays { (traced(row)) }
                            @if on_device { (number(ray_device_ms(row), significant)) }
                            @if answered { (glass(row)) }
                            (spread(&row.frame))
                            @if processor { (number(row.frame_processor.as_ref().map(|stats| stats.median), significant)) }
                            @if device { (number(row.frame_device.as_ref().map(|stats| stats.median), significant)) }
                            (outliers(&row.frame))
                            (more_errors(row))
                            (extra(row.peak_memory_bytes.map(|held| held as f64), |held| bytes(held as u64)))
                            @if thesis {
                                (number(row.thesis.as_ref().map(|thesis| thesis.frame_ms), significant))
                                (number(row.thesis.as_ref().and_then(|thesis| thesis.ratio), significant))
                            }
                        }
                    }
                }
            }
        }
        p.note.on-paper { "More columns are on the screen and in data.csv." }
        (references.list())
        (pictures_list(rows))
        (spent_list(rows))
    }
}

/// Number of paths of adaptive sampling of glass.
fn spent_list(rows: &[&BenchRow]) -> Markup {
    let lines: Vec<String> = rows.iter().flat_map(|row| spent(row)).collect();
    html! {
        @if !lines.is_empty() {
            p.note { "Adaptive sampling:" }
            ul.references.note { @for line in &lines { li { (line) } } }
        }
    }
}

/// The error of a row's picture, and whether it is only an upper bound; `None` if there is no error.
pub fn of_picture(row: &BenchRow) -> Option<(&Comparison, bool)> {
    let error = row.picture_error.as_ref()?;
    error.found().map(|(found, _)| (found, error.is_at_most()))
}

fn picture_errors(row: &BenchRow) -> Markup {
    let found = of_picture(row);
    let at_most = if found.is_some_and(|(_, at_most)| at_most) { "≤ " } else { "" };
    html! {
        (number(found.map(|(found, _)| found.rmse), |rmse| format!("{at_most}{}", error(rmse))))
        (number(found.map(|(found, _)| found.flip), error))
    }
}

/// A list of the references of pictures, and of reasons why rows have none; cut off after `MOST` lines, since a table may have many rows.
fn pictures_list(rows: &[&BenchRow]) -> Markup {
    const MOST: usize = 4;
    let lines = of_pictures(rows.iter().copied());
    let more = lines.len().saturating_sub(MOST);
    html! {
        @if !lines.is_empty() {
            p.note {
                "Errors of the picture are of all that is wrong in it, edges and textures as well; those of the effect are of the effect alone:"
            }
            ul.references.note {
                @for line in lines.iter().take(MOST) { li { (line) } }
                @if more > 0 { li { "and " (more) " more, in data.csv" } }
            }
        }
    }
}

/// A cell with the value by which the table's script sorts it; a dash for `None`.
fn number(value: Option<f64>, print: impl Fn(f64) -> String) -> Markup {
    html! {
        @match value {
            Some(value) => td data-v=(value) { (print(value)) },
            None => td.none data-v="" { "–" },
        }
    }
}

/// Columns that are left out on paper for lack of room.
const EXTRA: [&str; 5] = ["rel. MSE", "PSNR, dB", "energy", "outliers", "Memory"];

/// Columns of the shares of glass pixels, for effects that march rays through the picture; also left out on paper.
const GLASS: [&str; 4] = ["by screen", "by cube", "by rays", "by nothing"];

fn glass(row: &BenchRow) -> Markup {
    let shares = answered_shares(row);
    html! {
        @for index in 0..GLASS.len() {
            (extra(shares.map(|shares| shares[index]), |share| format!("{:.1} %", share * 100.0)))
        }
    }
}

/// [`number`] in a column that is left out on paper.
fn extra(value: Option<f64>, print: impl Fn(f64) -> String) -> Markup {
    html! {
        @match value {
            Some(value) => td.extra data-v=(value) { (print(value)) },
            None => td.extra.none data-v="" { "–" },
        }
    }
}

fn times(stats: &Stats) -> Markup {
    html! {
        td data-v=(stats.median) { strong { (significant(stats.median)) } }
        (spread(stats))
    }
}

fn spread(stats: &Stats) -> Markup {
    html! {
        @match stats.interval() {
            Some(of) => td data-v=(of.low) { (significant(of.low)) " – " (significant(of.high)) },
            None => td.none data-v="" { "–" },
        }
        (number(Some(stats.min), significant))
        (number(Some(stats.max), significant))
        (number(Some(stats.n() as f64), |n| format!("{n:.0}")))
    }
}

/// Columns of [`outliers`].
const OUTLIERS: [&str; 2] = ["mild", "severe"];

fn outliers(stats: &Stats) -> Markup {
    let found = stats.outliers();
    html! {
        @for count in [found.mild, found.severe] { (extra(Some(count as f64), |count| format!("{count:.0}"))) }
    }
}

fn traced(row: &BenchRow) -> Markup {
    let steps = || row.steps.iter().filter_map(|step| Some((step.rays?.total(), step.host.median)));
    let rays: Option<u64> = row.rays.is_some().then(|| steps().map(|(rays, _)| rays).sum());
    let ms: f64 = steps().map(|(_, ms)| ms).sum();
    let speed = rays.filter(|rays| *rays > 0 && ms > 0.0).map(|rays| rays as f64 / 1e3 / ms);
    html! {
        (number(row.ray_share, |share| format!("{:.0} %", share * 100.0)))
        (number(rays.map(|rays| rays as f64), |rays| grouped(rays as u64)))
        (number(speed, significant))
    }
}

fn comparison(row: &BenchRow) -> Option<&Comparison> {
    match &row.error {
        RowError::Against { comparison, .. } => Some(comparison),
        RowError::Missing(_) => None,
    }
}

fn errors(row: &BenchRow) -> Markup {
    let found = comparison(row);
    html! {
        (number(found.map(|found| found.rmse), error))
        (number(found.map(|found| found.flip), error))
        (number(found.map(|found| found.ssim), |ssim| format!("{ssim:.4}")))
    }
}

fn more_errors(row: &BenchRow) -> Markup {
    let found = comparison(row);
    html! {
        (extra(found.map(|found| found.relative_mse), error))
        (extra(found.map(|found| found.psnr), |psnr| if psnr.is_finite() { format!("{psnr:.1}") } else { "∞".to_owned() }))
        (extra(found.map(|found| found.energy_ratio), |ratio| format!("{ratio:.4}")))
        (extra(found.map(|found| found.outliers), |share| format!("{:.2} %", share * 100.0)))
    }
}

/// The references of a table's errors, each once, numbered for the cells.
struct References(Vec<String>);

impl References {
    fn of(rows: &[&BenchRow]) -> Self {
        let mut found = Vec::new();
        for row in rows {
            let words = Self::words(row);
            if !found.contains(&words) {
                found.push(words);
            }
        }
        Self(found)
    }

    fn words(row: &BenchRow) -> String {
        match &row.error {
            RowError::Against { reference, own_error, .. } if *own_error > 0.0 => {
                format!("{reference}; its own error: {}", error(*own_error))
            }
            RowError::Against { reference, .. } => reference.clone(),
            RowError::Missing(why) => format!("No error: {why}"),
        }
    }

    fn cell(&self, row: &BenchRow) -> Markup {
        let words = Self::words(row);
        let index = self.0.iter().position(|known| *known == words).unwrap_or_default() + 1;
        html! { td data-v=(index) { (index) } }
    }

    fn list(&self) -> Markup {
        html! {
            p.note { "References:" }
            ol.references.note { @for words in &self.0 { li { (words) } } }
        }
    }
}

/// The numbers of a scaling plot.
pub fn scaling(data: &ReportData, scaling: &Scaling) -> Markup {
    let quantity = match scaling.against {
        Against::Triangles => "Triangles",
        Against::Pixels => "Pixels",
        Against::Lights => "Lights",
        Against::Samples => "Samples",
        Against::Threads => "Threads",
    };
    html! {
        @if scaling.series.iter().any(|series| !series.rows.is_empty()) {
            div.scroll tabindex="0" role="group" aria-label=(format!("Table: time against {}", quantity.to_lowercase())) {
                table.sortable {
                    thead {
                        tr {
                            th.text scope="col" data-column="0" { "Row" }
                            th.text scope="col" data-column="1" { "By" }
                            th scope="col" data-column="2" { (quantity) }
                            th scope="col" data-column="3" { "Window" }
                            th scope="col" data-column="4" { "median, ms" }
                            th scope="col" data-column="5" { "95 %" }
                            th scope="col" data-column="6" { "min" }
                            th scope="col" data-column="7" { "max" }
                            th scope="col" data-column="8" { "n" }
                            th scope="col" data-column="9" { "processor" }
                            @for (index, kind) in OUTLIERS.iter().enumerate() {
                                th.extra scope="col" data-column=(10 + index) { (kind) " outliers" }
                            }
                        }
                    }
                    tbody {
                        @for series in &scaling.series {
                            @for (row, amount) in data.points(scaling.against, series) {
                                @let pixels = u64::from(row.size[0]) * u64::from(row.size[1]);
                                tr {
                                    th scope="row" { (series.label) }
                                    td.text { (tag(series.technique)) }
                                    (number(Some(amount), |value| grouped(value as u64)))
                                    td data-v=(pixels) { (row.size[0]) " × " (row.size[1]) }
                                    (times(&row.frame))
                                    (number(row.frame_processor.as_ref().map(|stats| stats.median), significant))
                                    (outliers(&row.frame))
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}
