//! The panel on the right: a comparison, and a pixel.

use crate::app::{App, Mode};
use crate::theme::{BLUE, number};
use crate::worker::{Facts, Other, PixelRays};
use curitiba::BackendChoice;
use egui::{Color32, ComboBox, Grid, Panel, RichText, ScrollArea, TextEdit, Ui};

/// Draws it.
pub fn draw(app: &mut App, ui: &mut Ui, facts: Option<&Facts>) {
    Panel::right("side").default_size(290.0).size_range(240.0..=640.0).show(ui, |ui| {
        let Some(facts) = facts else { return };
        ui.add_space(4.0);
        ui.heading("Compare");
        comparison(app, ui, facts);
        ui.add_space(4.0);
        ui.separator();
        ui.heading("Pixel");
        pixel(app, ui);
    });
}

fn comparison(app: &mut App, ui: &mut Ui, facts: &Facts) {
    let now = app.other.as_ref().map_or_else(|| "nothing".to_owned(), Other::name);
    let mut chosen = app.other.clone();
    ui.horizontal(|ui| {
        ui.label("with");
        let combo = ComboBox::from_id_salt("other").width(ui.available_width() - 8.0).selected_text(now).truncate();
        combo.show_ui(ui, |ui| offers(app, ui, facts, &mut chosen));
    });
    ui.horizontal(|ui| {
        let edit = TextEdit::singleline(&mut app.reference).hint_text("picture.png or .exr").desired_width(170.0);
        let response = ui.add(edit);
        let entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        if (ui.button("Open").clicked() || entered) && !app.reference.is_empty() {
            chosen = Some(Other::File(app.reference.clone().into()));
        }
        if ui.button("Keep").on_hover_text("K: keep the picture and compare with it").clicked() {
            app.keep(ui.ctx());
            chosen.clone_from(&app.other);
        }
    });
    let dropped = ui.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
    if let Some(path) = dropped {
        app.reference = path.display().to_string();
        chosen = Some(Other::File(path));
    }
    if chosen != app.other {
        app.compare_with(chosen);
    }
    if app.other.is_none() {
        return;
    }
    ui.horizontal(|ui| {
        ui.selectable_value(&mut app.mode, Mode::Wipe, "Wipe");
        ui.selectable_value(&mut app.mode, Mode::Flicker, "Flicker");
        ui.selectable_value(&mut app.mode, Mode::Difference, "Difference");
    });
    let Some(compared) = &app.state.compared else {
        ui.weak("no numbers yet");
        return;
    };
    Grid::new("numbers").num_columns(2).spacing([14.0, 2.0]).show(ui, |ui| {
        for (name, value) in [("RMSE", compared.rmse), ("FLIP", compared.flip), ("largest", compared.max)] {
            ui.label(name);
            ui.monospace(format!("{value:.6}"));
            ui.end_row();
        }
    });
}

fn offers(app: &App, ui: &mut Ui, facts: &Facts, chosen: &mut Option<Other>) {
    ui.selectable_value(chosen, None, "nothing");
    if let Some(kept) = &app.kept {
        let other = Other::Kept(kept.clone());
        let name = other.name();
        ui.selectable_value(chosen, Some(other), name);
    }
    let available = app.available().unwrap_or_default();
    for backend in BackendChoice::ALL {
        let missing = available.rays.iter().find(|(other, _)| *other == backend).and_then(|(_, why)| why.clone());
        let other = Some(Other::Backend(backend));
        let button = egui::Button::selectable(*chosen == other, format!("result on {}", backend.name()));
        let response = ui.add_enabled(missing.is_none(), button);
        if response.on_disabled_hover_text(missing.unwrap_or_default()).clicked() {
            *chosen = other;
        }
    }
    let outputs = facts.passes.iter().flat_map(|pass| &pass.outputs).map(|output| output.full.clone());
    let mut names: Vec<Option<String>> = outputs.collect();
    names.sort();
    names.dedup();
    for output in names {
        let other = Other::Output(output);
        let name = other.name();
        ui.selectable_value(chosen, Some(other), name);
    }
}

fn pixel(app: &mut App, ui: &mut Ui) {
    let Some(picture) = app.state.picture.clone() else { return };
    // Of one height with and without a pixel: what lies below must not move away from the pointer.
    let pointed = app.pointed.and_then(|at| Some((at, picture.pixel(at)?)));
    match pointed {
        Some(([x, y], _)) => ui.monospace(format!("{x}, {y}")),
        None => ui.weak("point at the picture for values, click for rays"),
    };
    values(ui, "pointed", picture.components, pointed.map(|(_, value)| value));
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

fn values(ui: &mut Ui, id: &str, components: [&str; 4], value: Option<[f32; 4]>) {
    Grid::new(id).num_columns(2).spacing([12.0, 1.0]).show(ui, |ui| {
        for (index, name) in components.iter().enumerate() {
            ui.weak(*name);
            ui.monospace(value.map_or("–".to_owned(), |value| number(value[index])));
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
