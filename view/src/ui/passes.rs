//! The table of passes in their order: whether they run, their outputs, times and parameters.

use super::parameters::{self, named_list, offer};
use crate::app::App;
use crate::theme::{BLUE, YELLOW, color, milliseconds};
use crate::worker::{Available, Command, Facts, PassFacts, PassState};
use curitiba::{BackendChoice, Choice, RasterChoice};
use egui::{Align, ComboBox, Frame, Layout, Panel, RichText, Role, ScrollArea, Sense, Stroke, Ui, WidgetInfo, vec2};

/// Draws the table.
pub fn draw(app: &mut App, ui: &mut Ui, facts: Option<&Facts>) {
    Panel::left("passes").default_size(340.0).size_range(336.0..=520.0).show(ui, |ui| {
        let Some(facts) = facts else {
            ui.add_space(6.0);
            ui.weak(super::status::activity(&app.state.activity));
            return;
        };
        ui.add_space(4.0);
        engines(app, ui, facts);
        ui.separator();
        ScrollArea::vertical().auto_shrink([false; 2]).show(ui, |ui| {
            let frame = facts.frame_ms();
            for (index, pass) in facts.passes.iter().enumerate() {
                row(app, ui, facts, (index, pass), frame);
            }
        });
    });
}

/// Lists of rasterisers and ray backends; entries that are not available give the reason.
fn engines(app: &App, ui: &mut Ui, facts: &Facts) {
    let available = app.available().unwrap_or_else(|| Available {
        raster: RasterChoice::NAMES.iter().map(|(_, choice)| (*choice, None)).collect(),
        rays: BackendChoice::NAMES.iter().map(|(_, choice)| (*choice, None)).collect(),
    });
    let mut choice: Choice = facts.choice;
    egui::Grid::new("engines").num_columns(3).spacing([8.0, 4.0]).show(ui, |ui| {
        ui.label("Raster");
        let combo = ComboBox::from_id_salt("raster").width(78.0).selected_text(choice.raster.name());
        let list = combo.show_ui(ui, |ui| {
            for (raster, missing) in &available.raster {
                offer(ui, &mut choice.raster, *raster, raster.name(), missing.as_deref());
            }
        });
        named_list(&list.response, "rasteriser", facts.choice.raster.name());
        engine(ui, &facts.raster);
        ui.end_row();
        ui.label("Rays");
        let combo = ComboBox::from_id_salt("rays").width(78.0).selected_text(choice.backend.name());
        let list = combo.show_ui(ui, |ui| {
            for (backend, missing) in &available.rays {
                offer(ui, &mut choice.backend, *backend, backend.name(), missing.as_deref());
            }
        });
        named_list(&list.response, "ray backend", facts.choice.backend.name());
        engine(ui, &facts.rays);
        ui.end_row();
    });
    if choice != facts.choice {
        app.worker.send(Command::Engines(choice));
    }
}

fn engine(ui: &mut Ui, [name, device]: &[String; 2]) {
    let text = RichText::new(format!("{name}: {device}")).weak().small();
    ui.add(egui::Label::new(text).truncate()).on_hover_text(device);
}

/// The row of a pass. Hovering over it shows the pass's first output.
fn row(app: &mut App, ui: &mut Ui, facts: &Facts, (index, pass): (usize, &PassFacts), frame: f64) {
    let pinned = pass.outputs.iter().any(|output| app.pinned.as_ref() == Some(&output.full));
    let fill = if pinned { BLUE.gamma_multiply(0.16) } else { egui::Color32::from_gray(36) };
    let edge = if app.marked == Some(index) || app.was_marked == Some(index) {
        color(index)
    } else {
        egui::Color32::from_gray(48)
    };
    let drawn = Frame::new().fill(fill).stroke(Stroke::new(1.0, edge)).corner_radius(4.0).inner_margin(6.0);
    let response = drawn.show(ui, |ui| {
        ui.set_width(ui.available_width());
        head(app, ui, index, pass);
        bar(ui, index, pass, frame);
        if pass.outputs.len() > 1 {
            outputs(app, ui, pass);
        }
        if let PassState::LeftOut(why) = &pass.state {
            ui.label(RichText::new(format!("left out: {why}")).small().weak());
        }
        notes(ui, facts, pass);
        if !pass.parameters.is_empty() {
            parameters::draw(app, ui, pass);
        }
    });
    let rect = response.response.rect;
    if ui.rect_contains_pointer(rect) {
        app.marked = Some(index);
        if app.hovered.is_none() {
            app.hovered = pass.outputs.first().map(|output| output.full.clone());
        }
    }
    ui.add_space(2.0);
}

fn head(app: &mut App, ui: &mut Ui, index: usize, pass: &PassFacts) {
    ui.horizontal(|ui| {
        let mut on = pass.state != PassState::Off;
        let label = format!("run {}", pass.name);
        let switch = ui.checkbox(&mut on, "");
        switch.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, on, &label));
        if switch.changed() {
            app.worker.send(Command::Enable { pass: pass.name.clone(), on });
        }
        let (dot, _) = ui.allocate_exact_size(vec2(8.0, 8.0), Sense::hover());
        ui.painter().rect_filled(dot, 2.0, color(index));
        let output = pass.outputs.first().map(|output| output.full.clone());
        let pinned = output.is_some() && app.pinned == output;
        let name = ui.selectable_label(pinned, RichText::new(&pass.name).strong());
        if name.on_hover_text(pass.about).clicked() {
            app.pinned = if pinned { None } else { output };
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let time = match pass.state {
                PassState::Off => "off".to_owned(),
                PassState::LeftOut(_) => "–".to_owned(),
                PassState::Runs => milliseconds(pass.times.host_ms),
            };
            let steps = pass
                .times
                .steps
                .iter()
                .map(|(kind, ms, note)| format!("{} {}  {note}", kind.name(), milliseconds(*ms)));
            let text = ui.label(RichText::new(time).monospace());
            if !pass.times.steps.is_empty() {
                text.on_hover_text(steps.collect::<Vec<_>>().join("\n"));
            }
            let what =
                pass.program.map_or_else(|| pass.kind.to_owned(), |program| format!("{} · {program}", pass.kind));
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                ui.add(egui::Label::new(RichText::new(what).weak()).truncate());
            });
        });
    });
}

/// A bar for the pass's share of the frame's time.
fn bar(ui: &mut Ui, index: usize, pass: &PassFacts, frame: f64) {
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), 3.0), Sense::hover());
    ui.painter().rect_filled(rect, 1.0, egui::Color32::from_gray(50));
    if frame > 0.0 && pass.state == PassState::Runs {
        let mut share = rect;
        share.set_width(rect.width() * (pass.times.host_ms / frame) as f32);
        ui.painter().rect_filled(share, 1.0, color(index));
    }
}

fn outputs(app: &mut App, ui: &mut Ui, pass: &PassFacts) {
    ui.horizontal_wrapped(|ui| {
        for output in &pass.outputs {
            let pinned = app.pinned.as_ref() == Some(&output.full);
            let response = ui.selectable_label(pinned, RichText::new(&output.name).small());
            if response.hovered() {
                app.hovered = Some(output.full.clone());
            }
            if response.clicked() {
                app.pinned = if pinned { None } else { Some(output.full.clone()) };
            }
        }
    });
}

/// Number of rays, device time, and the pass that overwrites this pass's first output.
fn notes(ui: &mut Ui, facts: &Facts, pass: &PassFacts) {
    let mut parts = Vec::new();
    if let Some(rays) = pass.times.rays.filter(|rays| *rays > 0 && pass.state == PassState::Runs) {
        let speed = pass.times.mrays_per_second().unwrap_or_default();
        parts.push(format!("{:.2} Mrays, {speed:.1} Mrays/s", rays as f64 / 1e6));
    }
    if let Some(device) = pass.times.device_ms {
        parts.push(format!("device {}", milliseconds(device)));
    }
    if !parts.is_empty() {
        ui.label(RichText::new(parts.join(" · ")).small().weak());
    }
    let output = pass.outputs.first().and_then(|output| output.full.as_deref());
    if let Some(last) = facts.last_writer(output).filter(|last| last.name != pass.name && pass.state == PassState::Runs)
    {
        ui.label(RichText::new(format!("{} writes over it", last.name)).small().color(YELLOW));
    }
}
