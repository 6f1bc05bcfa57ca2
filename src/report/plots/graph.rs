//! The graph of a row's passes, from the first down to the window. Its edges show each pass's time and the attachments that it writes.

use super::Plot;
use super::canvas::{FONT, INK, MUTED, NEUTRAL, RASTER, RAYS, Root, draw, text, text_width};
use crate::bench::model::BenchRow;
use crate::pipeline::executor::StepKind;
use crate::report::model::PassGraph;
use crate::report::number::milliseconds;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

const WIDTH: i32 = 760;
const BOX: i32 = 34;
const PITCH: i32 = 84;
const LEFT: i32 = 16;
/// Distance between the boxes and the edges that bypass boxes, and between such edges.
const LANE: i32 = 26;

/// Draws the passes as boxes, one below the other. `None` for a row without passes.
#[must_use]
pub fn pass_graph(graph: &PassGraph, row: &BenchRow) -> Option<Plot> {
    if graph.passes.is_empty() {
        return None;
    }
    let names: Vec<String> = graph.passes.iter().map(|[name, what]| format!("{name}: {what}")).collect();
    let wide = names.iter().map(|name| text_width(name, FONT)).max().unwrap_or(0) + 32;
    let right = LEFT + wide;
    let count = graph.passes.len() as i32;
    let height = PITCH * count + BOX + 16;
    let top = |index: i32| 8 + PITCH * index;
    draw((WIDTH as u32, height as u32), &format!("Passes of {}", graph.label), |root| {
        for (index, name) in names.iter().enumerate() {
            let (y, ink) = (top(index as i32), ink(row, &graph.passes[index][0]));
            let corners = [(LEFT, y), (right, y + BOX)];
            root.draw(&Rectangle::new(corners, ink.color().stroke_width(2)))?;
            root.draw_text(name, &text(FONT, INK, HPos::Left, VPos::Center), (LEFT + 14, y + BOX / 2))?;
        }
        let y = top(count);
        root.draw(&Rectangle::new([(LEFT, y), (right, y + BOX)], MUTED.color().stroke_width(1)))?;
        let window = format!("the window: {} a frame", milliseconds(row.frame.median));
        root.draw_text(&window, &text(FONT, INK, HPos::Left, VPos::Center), (LEFT + 14, y + BOX / 2))?;
        let middle = LEFT + 40;
        // Edges that bypass boxes lie beside each other.
        let mut lanes = 0;
        for (from, to, attachments) in &graph.edges {
            let (from, to) = (*from as i32, *to as i32);
            let label = label(row, &graph.passes[from as usize][0], attachments);
            if to == from + 1 {
                arrow(root, &[(middle, top(from) + BOX), (middle, top(to))])?;
                let at = (middle + 12, (top(from) + BOX + top(to)) / 2);
                root.draw_text(&label, &text(FONT, INK, HPos::Left, VPos::Center), at)?;
            } else {
                lanes += 1;
                let x = right + LANE * lanes;
                let (begin, end) = (top(from) + BOX / 2, top(to) + BOX / 2 - 5 * (lanes - 1));
                arrow(root, &[(right, begin), (x, begin), (x, end), (right, end)])?;
                let at = (x + 8, (top(to - 1) + top(to) + BOX) / 2);
                root.draw_text(&label, &text(FONT, INK, HPos::Left, VPos::Center), at)?;
            }
        }
        arrow(root, &[(middle, top(count - 1) + BOX), (middle, top(count))])?;
        let last = label(row, &graph.passes[graph.passes.len() - 1][0], &[]);
        let at = (middle + 12, (top(count - 1) + BOX + top(count)) / 2);
        root.draw_text(&last, &text(FONT, INK, HPos::Left, VPos::Center), at)
    })
}

/// Host time of a pass's steps: the sum of their medians.
fn pass_ms(row: &BenchRow, pass: &str) -> f64 {
    row.steps.iter().filter(|step| step.name == pass).map(|step| step.host.median).sum()
}

fn label(row: &BenchRow, pass: &str, attachments: &[String]) -> String {
    let time = milliseconds(pass_ms(row, pass));
    if attachments.is_empty() { time } else { format!("{time}, {}", attachments.join(", ")) }
}

fn ink(row: &BenchRow, pass: &str) -> super::canvas::Ink {
    let is = |kind| row.steps.iter().any(|step| step.name == pass && step.kind == kind);
    match () {
        () if is(StepKind::Rays) => RAYS[0],
        () if is(StepKind::Effect) => RASTER[0],
        () => NEUTRAL,
    }
}

/// A line with an arrow head at its end, which points down or to the left.
fn arrow(root: &Root<'_>, points: &[(i32, i32)]) -> Result<(), super::canvas::Failed> {
    let [.., before, (x, y)] = points else { return Ok(()) };
    let head = if before.0 == *x {
        vec![(*x, *y), (x - 5, y - 9), (x + 5, y - 9)]
    } else {
        vec![(*x, *y), (x + 9, y - 5), (x + 9, y + 5)]
    };
    root.draw(&PathElement::new(points.to_vec(), INK.color().stroke_width(1)))?;
    root.draw(&Polygon::new(head, INK.color().filled()))
}
