//! The list of keys and their actions, in a window of its own.

use super::keys::KEYS;
use crate::app::App;
use egui::{Align2, Grid, RichText, Ui, Window, vec2};

/// Draws the window if it is open.
pub fn draw(app: &mut App, ui: &Ui) {
    let mut open = app.help;
    Window::new("Keys")
        .open(&mut open)
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0))
        .show(ui.ctx(), |ui| {
            Grid::new("keys").num_columns(2).spacing([18.0, 5.0]).show(ui, |ui| {
                for (key, does) in KEYS {
                    ui.label(RichText::new(*key).strong());
                    ui.label(*does);
                    ui.end_row();
                }
            });
        });
    app.help = open && app.help;
}
