//! The bar at the top: the open project, its camera, and actions.

use super::keys;
use super::parameters::named_list;
use crate::app::App;
use crate::worker::{Command, Facts};
use egui::{ComboBox, Panel, RichText, Ui};

/// Draws the bar.
pub fn draw(app: &mut App, ui: &mut Ui, facts: Option<&Facts>) {
    Panel::top("top").show(ui, |ui| {
        ui.add_space(2.0);
        ui.horizontal(|ui| {
            let Some(facts) = facts else {
                ui.label(RichText::new("curitiba").strong());
                return;
            };
            let name = facts.source.file_name().map_or_else(String::new, |name| name.display().to_string());
            ui.label(RichText::new(name).strong()).on_hover_text(facts.source.display().to_string());
            let [width, height] = facts.window;
            ui.weak(format!("{width} × {height}"));
            ui.separator();
            cameras(app, ui, facts);
            let help = format!("F: move the camera until all of the scene is seen; its far plane is at {}", facts.far);
            if ui.button("Fit").on_hover_text(help).clicked() {
                keys::fit(app, facts);
            }
            let copy = ui.add_enabled(facts.camera_xml.is_ok(), egui::Button::new("Copy camera"));
            if copy.on_hover_text("C: the camera as an element of a project, to the bit").clicked() {
                keys::copy_camera(app, ui.ctx(), facts);
            }
            ui.separator();
            if ui.button("Save").on_hover_text("S: PNG, EXR, and JSON that says how to render it").clicked() {
                app.worker.send(Command::Save(App::new_file(facts)));
            }
            if ui
                .button("Reload")
                .on_hover_text("R: read all files again; files that change are read by themselves")
                .clicked()
            {
                app.worker.send(Command::Reload);
            }
            let refine = ui.checkbox(&mut app.refine, "Refine at rest");
            if refine.on_hover_text("more samples of ambient occlusion while nothing changes").changed() {
                app.worker.send(Command::Refine(app.refine));
            }
            let mut paused = app.paused;
            if ui.checkbox(&mut paused, "Pause").on_hover_text("Space: render nothing").changed() {
                keys::set_paused(app, paused);
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if ui.button("Keys").on_hover_text("F1").clicked() {
                    app.help = !app.help;
                }
                if ui.button("1:1").on_hover_text("1: one pixel as one pixel of the screen").clicked() {
                    app.canvas.one_to_one();
                }
                if ui.button("All").on_hover_text("0: all of the picture").clicked() {
                    app.canvas.fit();
                }
            });
        });
        ui.add_space(2.0);
    });
}

fn cameras(app: &mut App, ui: &mut Ui, facts: &Facts) {
    ui.label("Camera");
    let own = || format!("{} (of the passes)", facts.seen_by);
    let selected = facts.camera.clone().unwrap_or_else(own);
    let mut chosen = facts.camera.clone();
    let combo = ComboBox::from_id_salt("camera").width(170.0).selected_text(&selected);
    let list = combo.show_ui(ui, |ui| {
        ui.selectable_value(&mut chosen, None, "each pass its own");
        for name in &facts.cameras {
            ui.selectable_value(&mut chosen, Some(name.clone()), name);
        }
    });
    named_list(&list.response, "camera of all passes", &selected);
    if chosen != facts.camera {
        app.pose = None;
        app.worker.send(Command::Camera(chosen));
    }
}
