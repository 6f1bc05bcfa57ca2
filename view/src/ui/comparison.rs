//! The panel of a comparison: choice of the two sides, display mode, and metrics.

use super::parameters::{named_list, offer};
use crate::app::{App, Mode};
use crate::theme::{RED, milliseconds};
use crate::worker::{Available, Facts, On, Side, Times, What};
use curitiba::pipeline::executor::StepKind;
use curitiba::{BackendChoice, RasterChoice};
use egui::{Align, ComboBox, Grid, Label, Layout, RichText, TextEdit, Ui, vec2};
use std::path::PathBuf;

/// Draws the panel.
pub fn draw(app: &mut App, ui: &mut Ui, facts: &Facts) {
    let mut sides = [Some(app.left.clone()), app.right.clone()];
    for (index, side) in sides.iter_mut().enumerate() {
        // The left side can be chosen only once there is a right side.
        let enabled = index == 1 || app.right.is_some();
        ui.add_enabled_ui(enabled, |ui| ui.horizontal(|ui| choose(app, ui, facts, index, side)));
    }
    for side in app.state.sides.iter().filter(|_| app.right.is_some()) {
        if let Some(why) = &side.missing {
            ui.label(RichText::new(why).color(RED).small());
        }
    }
    ui.horizontal(|ui| {
        let edit = TextEdit::singleline(&mut app.reference).hint_text("picture.png or .exr").desired_width(170.0);
        let response = ui.add(edit);
        let entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        if (ui.button("Open").clicked() || entered) && !app.reference.is_empty() {
            sides[1] = Some(Side::File(app.reference.clone().into()));
        }
        if ui.button("Keep").on_hover_text("K: keep the picture and compare with it").clicked() {
            app.keep(ui.ctx());
            sides[1].clone_from(&app.right);
        }
    });
    let dropped = ui.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
    if let Some(path) = dropped {
        app.reference = path.display().to_string();
        sides[1] = Some(Side::File(path));
    }
    let [left, right] = sides;
    let left = left.unwrap_or(Side::SHOWN);
    if left != app.left || right != app.right {
        app.compare(left, right);
    }
    if app.right.is_none() {
        return;
    }
    ui.horizontal(|ui| {
        ui.selectable_value(&mut app.mode, Mode::Wipe, "Wipe");
        ui.selectable_value(&mut app.mode, Mode::Flicker, "Flicker");
        ui.selectable_value(&mut app.mode, Mode::Difference, "Difference");
        if ui.button("Swap").on_hover_text("left becomes right").clicked()
            && let Some(right) = app.right.clone()
        {
            let left = app.left.clone();
            app.compare(right, Some(left));
        }
    });
    numbers(app, ui);
}

/// Lists for a side: its picture and, if that is rendered, its engines. Only the right side may be `nothing`.
fn choose(app: &App, ui: &mut Ui, facts: &Facts, index: usize, side: &mut Option<Side>) {
    /// Width of the list of engines, points.
    const ENGINES: f32 = 122.0;
    let place = ["left", "right"][index];
    ui.add_sized(vec2(28.0, ui.spacing().interact_size.y), Label::new(place));
    let rendered = match side {
        Some(Side::Rendered { what, on }) => Some((what.clone(), *on)),
        _ => None,
    };
    let width = ui.available_width() - 14.0 - if rendered.is_some() { ENGINES + 6.0 } else { 0.0 };
    let now = side.as_ref().map_or_else(|| "nothing".to_owned(), Side::name);
    // Full names of outputs are `library::channel`. There is room for the channel only, in which outputs mostly differ.
    let channel = now.rsplit("::").next().unwrap_or(&now);
    let combo = ComboBox::from_id_salt(("side", index)).width(width).selected_text(channel).truncate();
    // Long names are cut off at the width of this area: otherwise the list grows with its text, and the panel with the list.
    let place_of = vec2(width, ui.spacing().interact_size.y);
    let list = ui.allocate_ui_with_layout(place_of, Layout::left_to_right(Align::Center), |ui| {
        combo.show_ui(ui, |ui| offers(app, ui, facts, index, side))
    });
    let response = list.inner.response.on_hover_text(&now);
    named_list(&response, &format!("{place} side"), &now);
    let (Some((what, on)), Some(Side::Rendered { .. })) = (rendered, side.as_ref()) else { return };
    let mut chosen = on;
    let combo = ComboBox::from_id_salt(("engines", index)).width(ENGINES - 8.0).selected_text(on.name()).truncate();
    let response = combo.show_ui(ui, |ui| engines_of(app, ui, &mut chosen)).response;
    named_list(&response, &format!("engines of the {place} side"), &on.name());
    if chosen != on {
        *side = Some(Side::Rendered { what, on: chosen });
    }
}

/// The entries of the list of pictures: the same for both sides, except that only the right one has `nothing`.
fn offers(app: &App, ui: &mut Ui, facts: &Facts, index: usize, chosen: &mut Option<Side>) {
    if index == 1 {
        ui.selectable_value(chosen, None, "nothing");
    }
    let on = match chosen {
        Some(Side::Rendered { on, .. }) => *on,
        _ => On::Here,
    };
    let outputs = facts.passes.iter().flat_map(|pass| &pass.outputs).filter_map(|output| output.full.clone());
    let mut outputs: Vec<String> = outputs.collect();
    outputs.sort();
    outputs.dedup();
    let rendered = [What::Shown, What::Result].into_iter().chain(outputs.into_iter().map(What::Output));
    let rendered = rendered.map(|what| Side::Rendered { what, on });
    let kept = app.kept.clone().map(Side::Kept);
    let file = (!app.reference.is_empty()).then(|| Side::File(PathBuf::from(&app.reference)));
    for side in kept.into_iter().chain(file).chain([Side::Reference]).chain(rendered) {
        let name = side.name();
        let help = match side {
            Side::Reference => {
                "from the camera in f64: the stored one of `curitiba reference`, or 64 samples a pixel, which takes a while"
            }
            _ => "",
        };
        let response = ui.selectable_value(chosen, Some(side), name);
        if !help.is_empty() {
            response.on_hover_text(help);
        }
    }
}

fn engines_of(app: &App, ui: &mut Ui, chosen: &mut On) {
    offer(ui, chosen, On::Here, &On::Here.name(), None);
    let Available { raster, rays } = app.available().unwrap_or_default();
    for (_, choice) in RasterChoice::NAMES.into_iter().filter(|(_, choice)| *choice != RasterChoice::Auto) {
        let missing = raster.iter().find(|(other, _)| *other == choice).and_then(|(_, why)| why.as_deref());
        let on = On::Raster(choice);
        offer(ui, chosen, on, &on.name(), missing);
    }
    for backend in BackendChoice::ALL {
        let missing = rays.iter().find(|(other, _)| *other == backend).and_then(|(_, why)| why.as_deref());
        let on = On::Rays(backend);
        offer(ui, chosen, on, &on.name(), missing);
    }
}

/// Metrics of the comparison, and the times of each side.
fn numbers(app: &App, ui: &mut Ui) {
    match (&app.state.compared, &app.state.incomparable) {
        (Some(compared), _) => {
            let [left, right] = &compared.names;
            ui.label(RichText::new(format!("{left} against {right}")).small());
            Grid::new("numbers").num_columns(2).spacing([14.0, 2.0]).show(ui, |ui| {
                for (name, value) in [("RMSE", compared.rmse), ("FLIP", compared.flip), ("largest", compared.max)] {
                    ui.label(name);
                    ui.monospace(format!("{value:.6}"));
                    ui.end_row();
                }
            });
        }
        (None, Some(why)) => {
            ui.label(RichText::new(why).color(RED).small());
        }
        (None, None) => {
            ui.weak("no numbers yet");
        }
    }
    let [left, right] = app.state.sides.each_ref().map(|side| side.times.as_ref());
    let has_far = app.left.is_far() || app.right.as_ref().is_some_and(Side::is_far);
    if has_far && (left.is_some() || right.is_some()) {
        times(ui, [left, right]);
    }
}

/// Host time of a frame by kind of step, one column per side.
fn times(ui: &mut Ui, sides: [Option<&Times>; 2]) {
    let mut kinds: Vec<StepKind> = Vec::new();
    for (kind, _) in sides.iter().flatten().flat_map(|times| &times.0) {
        if !kinds.contains(kind) {
            kinds.push(*kind);
        }
    }
    let row = |ui: &mut Ui, name: &str, of: &dyn Fn(&Times) -> Option<f64>| {
        ui.label(name);
        for side in sides {
            ui.monospace(side.and_then(of).map_or_else(|| "–".to_owned(), milliseconds));
        }
        ui.end_row();
    };
    Grid::new("times").num_columns(3).spacing([14.0, 2.0]).show(ui, |ui| {
        row(ui, "frame", &|times| Some(times.total()));
        for kind in kinds {
            row(ui, kind.name(), &|times| times.of(kind));
        }
    });
}
