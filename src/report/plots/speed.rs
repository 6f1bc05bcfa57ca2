//! Speed against error: all settings of an effect, and the Pareto front among them.

use super::Plot;
use super::canvas::{
    Entry, FONT, INK, Ink, LogAxis, MUTED, Mark, NEUTRAL, RASTER, RAYS, Root, draw, lay_out, legend, log_chart, text,
    text_width,
};
use crate::bench::Interval;
use crate::bench::model::Technique;
use crate::report::model::{ReportData, Section, rmse};
use crate::report::verdict::{FRAME_60_MS, pareto_front};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

const SIZE: (u32, u32) = (760, 440);

struct Point {
    series: usize,
    value: String,
    frame_ms: f64,
    interval: Option<Interval>,
    error: f64,
}

/// Horizontal: frame time with the 95 % interval of its median. Vertical: RMSE. Both axes are logarithmic. The Pareto front is drawn, and its
/// points are named. `None` if no setting has an error.
#[must_use]
pub fn speed_against_error(data: &ReportData, section: &Section) -> Option<Plot> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut points: Vec<Point> = Vec::new();
    let mut own_error = 0.0_f64;
    for (setting, row) in data.settings(section) {
        let Some((error, own)) = rmse(row) else { continue };
        own_error = own_error.max(own);
        let series = entries.iter().position(|entry| entry.label == setting.series).unwrap_or_else(|| {
            let before = entries.iter().filter(|entry| colors(row.technique).contains(&entry.ink)).count();
            let ink = colors(row.technique)[before % colors(row.technique).len()];
            entries.push(Entry { mark: Mark::of(entries.len()), ink, label: setting.series.clone() });
            entries.len() - 1
        });
        let value = if error == 0.0 { format!("{}: no error", setting.value) } else { setting.value.clone() };
        points.push(Point { series, value, frame_ms: row.frame.median, interval: row.frame.interval(), error });
    }
    // A logarithmic axis has no place for errors of zero. They are drawn below its least tick, with a label.
    let least = points.iter().map(|point| point.error).filter(|error| *error > 0.0).fold(f64::INFINITY, f64::min);
    let least = if least.is_finite() { least } else { 1e-5 };
    let exact = points.iter().any(|point| point.error == 0.0);
    let lowest = if own_error > 0.0 { least.min(own_error) } else { least };
    let floor = lowest / if exact { 4.0 } else { 1.5 };
    let limit = points.iter().any(|point| point.frame_ms < FRAME_60_MS * 6.0).then_some(FRAME_60_MS);
    let ends = |point: &Point| match point.interval {
        Some(Interval { low, high }) if low > 0.0 => [low, point.frame_ms, high],
        _ => [point.frame_ms; 3],
    };
    let x = LogAxis::around(points.iter().flat_map(ends).chain(limit))?;
    let mut y = LogAxis::around(points.iter().map(|point| point.error.max(floor)).chain(Some(floor)))?;
    if exact {
        y.ticks.retain(|tick| *tick > floor.log10() + 0.3);
    }
    let front = pareto_front(&points.iter().map(|point| (point.frame_ms, point.error)).collect::<Vec<_>>());
    let title = format!("{}: error against frame time", section.effect.title());
    draw(SIZE, &title, |root| {
        let (places, height) = lay_out(&entries, SIZE.0 as i32 - 80);
        legend(root, &entries, &places, (70, 8))?;
        let (_, body) = root.split_vertically(height + 10);
        let mut chart = log_chart(
            &body,
            24,
            [&x, &y],
            ["time of a frame, ms (less is better)", "RMSE against the reference (less is better)"],
        )?;
        if own_error > 0.0 && own_error.log10() > y.range.0 {
            let line = [(x.range.0, own_error.log10()), (x.range.1, own_error.log10())];
            chart.draw_series(DashedLineSeries::new(line, 4, 4, MUTED.color().into()))?;
        }
        if let Some(limit) = limit {
            let line = [(limit.log10(), y.range.0), (limit.log10(), y.range.1)];
            chart.draw_series(DashedLineSeries::new(line, 8, 4, INK.color().into()))?;
        }
        let at = |point: &Point| (point.frame_ms.log10(), point.error.max(floor).log10());
        let mut line: Vec<_> = points.iter().zip(&front).filter(|(_, on)| **on).map(|(point, _)| at(point)).collect();
        line.sort_by(|a, b| a.0.total_cmp(&b.0));
        chart.draw_series(LineSeries::new(line, INK.color().stroke_width(1)))?;
        let area = chart.plotting_area();
        let pixel = |place: (f64, f64)| area.map_coordinate(&place);
        let marks: Vec<_> = points.iter().map(|point| pixel(at(point))).collect();
        for (point, (_, py)) in points.iter().zip(&marks) {
            let ink = entries[point.series].ink;
            let [low, _, high] = ends(point).map(|ms| pixel((ms.log10(), y.range.0)).0);
            for line in [[(low, *py), (high, *py)], [(low, py - 3), (low, py + 3)], [(high, py - 3), (high, py + 3)]] {
                root.draw(&PathElement::new(line.to_vec(), ink.color().stroke_width(1)))?;
            }
        }
        for (point, place) in points.iter().zip(&marks) {
            let entry = &entries[point.series];
            entry.mark.draw(root, *place, entry.ink)?;
        }
        if exact {
            break_axis(root, pixel((x.range.0, floor.log10())), pixel((x.range.0, lowest.log10())).1)?;
        }
        if let Some(limit) = limit {
            let (px, py) = pixel((limit.log10(), y.range.1));
            let words = "60 frames a second";
            // Placed left of its line if the right edge would cut it off.
            let fits = px + 5 + text_width(words, 12) < SIZE.0 as i32 - 4;
            let (from, dx) = if fits { (HPos::Left, 5) } else { (HPos::Right, -5) };
            root.draw_text(words, &text(12, INK, from, VPos::Top), (px + dx, py + 3))?;
        }
        if own_error > 0.0 && own_error.log10() > y.range.0 {
            let (px, py) = pixel((x.range.1, own_error.log10()));
            let style = text(12, MUTED, HPos::Right, VPos::Bottom);
            root.draw_text("error of the reference itself", &style, (px - 4, py - 3))?;
        }
        let (width, bottom) = (SIZE.0 as i32, pixel((x.range.0, y.range.0)).1);
        let named: Vec<_> =
            points.iter().zip(&marks).zip(&front).filter(|(_, on)| **on).map(|(named, _)| named).collect();
        label(root, &named, &marks, width, bottom)
    })
}

/// Two strokes across the axis between the least error and the place of zero: below them there is no scale.
fn break_axis(root: &Root<'_>, (x, zero): (i32, i32), least: i32) -> Result<(), super::canvas::Failed> {
    let middle = (zero + least) / 2;
    for y in [middle - 3, middle + 3] {
        root.draw(&PathElement::new(vec![(x - 7, y + 3), (x + 7, y - 3)], INK.color().stroke_width(2)))?;
    }
    root.draw(&PathElement::new(vec![(x - 5, zero), (x, zero)], MUTED.color().stroke_width(1)))?;
    root.draw_text("0", &text(FONT, INK, HPos::Right, VPos::Center), (x - 9, zero))
}

/// Writes names of points where there is room: at the upper right, else at the other corners. A name without room is left out;
/// the table has it.
fn label(
    root: &Root<'_>,
    named: &[(&Point, &(i32, i32))],
    marks: &[(i32, i32)],
    width: i32,
    bottom: i32,
) -> Result<(), super::canvas::Failed> {
    let mut taken: Vec<[i32; 4]> = marks.iter().map(|(x, y)| [x - 5, y - 5, x + 5, y + 5]).collect();
    for (point, place) in named {
        let (x, y) = **place;
        let wide = text_width(&point.value, 12);
        let corners = [(8, -16), (-8 - wide, -16), (8, 4), (-8 - wide, 4), (8, -7), (-8 - wide, -7)];
        let place = corners.into_iter().find(|(dx, dy)| {
            let frame = [x + dx, y + dy, x + dx + wide, y + dy + 12];
            let free = taken.iter().all(|t| frame[2] < t[0] || frame[0] > t[2] || frame[3] < t[1] || frame[1] > t[3]);
            free && frame[0] > 72 && frame[2] < width - 4 && frame[3] < bottom
        });
        if let Some((dx, dy)) = place {
            taken.push([x + dx, y + dy, x + dx + wide, y + dy + 12]);
            root.draw_text(&point.value, &text(12, INK, HPos::Left, VPos::Top), (x + dx, y + dy))?;
        }
    }
    Ok(())
}

/// The colours of a technique's series.
pub(super) fn colors(technique: Technique) -> &'static [Ink] {
    match technique {
        Technique::Rays => &RAYS,
        Technique::Raster => &RASTER,
        Technique::None => &[NEUTRAL],
    }
}
