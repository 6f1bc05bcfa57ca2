//! A message over the picture about the last action, for a moment.

use crate::app::App;
use egui::{Align2, Area, Color32, Frame, Id, Label, RichText, Ui, vec2};

/// Draws the message if there is one.
pub fn draw(app: &mut App, ui: &Ui) {
    let context = ui.ctx();
    let Some((text, until)) = &app.notice else { return };
    if context.input(|input| input.time) >= *until {
        app.notice = None;
        return;
    }
    Area::new(Id::unique("notice")).anchor(Align2::CENTER_BOTTOM, vec2(0.0, -130.0)).interactable(false).show(
        context,
        |ui| {
            Frame::popup(ui.style()).fill(Color32::from_black_alpha(220)).show(ui, |ui| {
                ui.add(Label::new(RichText::new(text).color(Color32::WHITE)).extend());
            });
        },
    );
}
