//! The panel on the right: a comparison, and a pixel.

use super::comparison;
use crate::app::App;
use crate::theme::{BLUE, number};
use crate::worker::{Facts, PixelRays};
use egui::{Color32, Grid, Panel, RichText, ScrollArea, Ui};

/// Draws the panel.
pub fn draw(app: &mut App, ui: &mut Ui, facts: Option<&Facts>) {
    Panel::right("side").default_size(290.0).size_range(240.0..=640.0).show(ui, |ui| {
        let Some(facts) = facts else { return };
        ui.add_space(4.0);
        ui.heading("Compare");
        comparison::draw(app, ui, facts);
        ui.add_space(4.0);
        ui.separator();
        ui.heading("Pixel");
        pixel(app, ui);
    });
}

fn pixel(app: &mut App, ui: &mut Ui) {
    let Some(picture) = app.seen() else { return };
    let right = app.compared().map(|[_, right]| right);
    // The values have the same height with and without a pointed pixel, so that the rows below them do not move.
    let pointed = app.pointed.and_then(|at| Some((at, picture.pixel(at)?)));
    match pointed {
        Some(([x, y], _)) => ui.monospace(format!("{x}, {y}")),
        None => ui.weak("point at the picture for values, click for rays"),
    };
    let of_right = pointed.and_then(|(at, _)| right.as_ref()?.pixel(at));
    let mut columns = vec![pointed.map(|(_, value)| value)];
    if right.is_some() {
        columns.push(of_right);
    }
    values(ui, "pointed", picture.components, &columns);
    let Some(rays) = app.state.pixel.clone() else {
        if let Some([x, y]) = app.picked {
            ui.weak(format!("looking into {x}, {y} …"));
        }
        return;
    };
    ui.separator();
    ui.horizontal(|ui| {
        let [x, y] = rays.pixel;
        ui.label(RichText::new(format!("rays of {x}, {y}")).strong().color(BLUE));
        if ui.small_button("Forget").clicked() {
            app.pick(None);
        }
        if ui.small_button("Copy").clicked() {
            ui.ctx().copy_text(rays.lines.join("\n"));
        }
    });
    lines(ui, &rays);
}

/// The four numbers of a pixel, in a column for each side; dashes where a side has no such pixel.
fn values(ui: &mut Ui, id: &str, components: [&str; 4], columns: &[Option<[f32; 4]>]) {
    Grid::new(id).num_columns(1 + columns.len()).spacing([12.0, 1.0]).show(ui, |ui| {
        for (index, name) in components.iter().enumerate() {
            ui.weak(*name);
            for value in columns {
                ui.monospace(value.map_or("–".to_owned(), |value| number(value[index])));
            }
            ui.end_row();
        }
    });
}

fn lines(ui: &mut Ui, rays: &PixelRays) {
    for (pass, output, value) in &rays.values {
        let name = output.rsplit("::").next().unwrap_or(output);
        let text = value.map(number).join(" ");
        ui.label(RichText::new(format!("{pass} {name}: {text}")).small().monospace());
    }
    ui.separator();
    let height = ui.text_style_height(&egui::TextStyle::Small);
    ScrollArea::both().auto_shrink([false; 2]).show_rows(ui, height, rays.lines.len(), |ui, rows| {
        ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Extend);
        for line in &rays.lines[rows] {
            ui.label(RichText::new(line).small().monospace().color(Color32::from_gray(190)));
        }
    });
}
