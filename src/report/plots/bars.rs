//! Times of the steps of a frame: one bar per row, one piece per step, the shortest frame first.

use super::Plot;
use super::canvas::{
    Entry, FONT, GRID, INK, Ink, MUTED, Mark, NEUTRAL, RASTER, RAYS, draw, lay_out, legend, text, text_width,
};
use crate::bench::Interval;
use crate::bench::model::BenchRow;
use crate::pipeline::executor::StepKind;
use crate::report::number::milliseconds;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

const WIDTH: u32 = 760;
const BAR: i32 = 17;
const PITCH: i32 = 26;

/// Steps of a frame in the order of the pieces.
const KINDS: [(StepKind, Ink, &str); 7] = [
    (StepKind::Raster, NEUTRAL, "G-buffer"),
    (StepKind::ReadBack, RASTER[2], "read-back"),
    (StepKind::Join, RAYS[2], "join"),
    (StepKind::Maps, RASTER[1], "maps"),
    (StepKind::Effect, RASTER[0], "raster effect"),
    (StepKind::Rays, RAYS[0], "rays"),
    (StepKind::Quad, RAYS[1], "quad"),
];

/// Horizontal bars of the median time of each kind of step, the shortest frame first. The end of each bar shows the median of the whole frame
/// and its 95 % interval. `common` is the beginning of all labels, and left out of them. `None` without rows.
#[must_use]
pub fn frame_bars(title: &str, rows: &[&BenchRow], common: &str) -> Option<Plot> {
    let mut rows = rows.to_vec();
    rows.sort_by(|a, b| a.frame.median.total_cmp(&b.frame.median));
    let intervals: Vec<Option<Interval>> = rows.iter().map(|row| row.frame.interval()).collect();
    let ends = rows.iter().zip(&intervals).map(|(row, interval)| {
        interval.map_or(0.0, |interval| interval.high).max(row.frame.median).max(pieces(row).iter().sum())
    });
    let most = ends.fold(0.0, f64::max);
    if !(most > 0.0 && most.is_finite()) {
        return None;
    }
    let used = |kind: StepKind| rows.iter().any(|row| row.steps.iter().any(|step| step.kind == kind));
    let entries: Vec<Entry> = KINDS
        .iter()
        .filter(|(kind, _, _)| used(*kind))
        .map(|(_, ink, label)| Entry { mark: Mark::Square, ink: *ink, label: (*label).to_owned() })
        .collect();
    let labels: Vec<String> =
        rows.iter().map(|row| shorten(row.label.strip_prefix(common).unwrap_or(&row.label).trim_start())).collect();
    let names = labels.iter().map(|label| text_width(label, FONT)).max().unwrap_or(0) + 12;
    let (places, legend_height) = lay_out(&entries, WIDTH as i32 - names - 16);
    let height = legend_height + 10 + PITCH * rows.len() as i32 + 46;
    draw((WIDTH, height as u32), title, |root| {
        legend(root, &entries, &places, (names, 6))?;
        let (_, body) = root.split_vertically(legend_height + 8);
        let count = rows.len() as f64;
        let mut chart = ChartBuilder::on(&body)
            .margin_right(16)
            .x_label_area_size(44)
            .y_label_area_size(names)
            .build_cartesian_2d(0.0..most * 1.16, 0.0..count)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .disable_y_axis()
            .x_labels(6)
            .axis_style(MUTED.color())
            .bold_line_style(GRID.color())
            .light_line_style(TRANSPARENT)
            .label_style(text(FONT, INK, HPos::Left, VPos::Top))
            .axis_desc_style(text(FONT, INK, HPos::Left, VPos::Top))
            .x_desc("median time, ms")
            .x_label_formatter(&|value| if *value == 0.0 { "0".to_owned() } else { trim(*value) })
            .draw()?;
        let area = chart.plotting_area();
        for (index, row) in rows.iter().enumerate() {
            // The first row is at the top.
            let middle = count - index as f64 - 0.5;
            let mut from = 0.0;
            for ((_, ink, _), piece) in KINDS.iter().zip(pieces(row)) {
                if piece > 0.0 {
                    let (left, y) = area.map_coordinate(&(from, middle));
                    let (right, _) = area.map_coordinate(&(from + piece, middle));
                    let corners = [(left, y - BAR / 2), (right.max(left + 1), y + BAR / 2)];
                    root.draw(&Rectangle::new(corners, ink.color().filled()))?;
                    from += piece;
                }
            }
            let (left, y) = area.map_coordinate(&(0.0, middle));
            root.draw_text(&labels[index], &text(FONT, INK, HPos::Right, VPos::Center), (left - 8, y))?;
            let mut reach = from.max(row.frame.median);
            if let Some(Interval { low, high }) = intervals[index] {
                let [low, high] = [low, high].map(|end| area.map_coordinate(&(end, middle)).0);
                for line in [[(low, y), (high, y)], [(low, y - 4), (low, y + 4)], [(high, y - 4), (high, y + 4)]] {
                    root.draw(&PathElement::new(line.to_vec(), INK.color().stroke_width(1)))?;
                }
                reach = reach.max(intervals[index].map_or(0.0, |interval| interval.high));
            }
            let (end, _) = area.map_coordinate(&(reach, middle));
            let total = milliseconds(row.frame.median);
            root.draw_text(&total, &text(12, INK, HPos::Left, VPos::Center), (end + 6, y))?;
        }
        Ok(())
    })
}

/// Times of each of [`KINDS`], milliseconds.
fn pieces(row: &BenchRow) -> [f64; KINDS.len()] {
    KINDS.map(|(kind, _, _)| row.steps.iter().filter(|step| step.kind == kind).map(|step| step.host.median).sum())
}

fn shorten(label: &str) -> String {
    const LONGEST: usize = 44;
    if label.chars().count() <= LONGEST {
        return label.to_owned();
    }
    let kept: String = label.chars().take(LONGEST - 1).collect();
    format!("{}…", kept.trim_end())
}

/// A tick's value, without rounding errors of floats.
fn trim(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
