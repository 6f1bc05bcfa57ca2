//! The parts of the window.

mod comparison;
mod graph;
mod help;
mod keys;
mod notice;
mod overlay;
mod parameters;
mod passes;
mod picture;
mod side;
mod status;
mod top;

use crate::app::App;
use egui::Ui;
use std::time::Instant;

/// Draws the window.
pub fn draw(app: &mut App, ui: &mut Ui) {
    let start = Instant::now();
    app.canvas.set_density(ui.ctx().pixels_per_point());
    app.state = app.worker.state();
    let facts = app.state.facts.clone();
    let hovered = app.hovered.take();
    app.was_marked = app.marked.take();
    keys::read(app, ui, facts.as_deref());
    top::draw(app, ui, facts.as_deref());
    status::draw(app, ui, facts.as_deref());
    graph::draw(app, ui, facts.as_deref());
    passes::draw(app, ui, facts.as_deref());
    side::draw(app, ui, facts.as_deref());
    picture::draw(app, ui, facts.as_deref());
    help::draw(app, ui);
    notice::draw(app, ui);
    app.look_for_engines(ui.ctx());
    if app.hovered != hovered || app.marked != app.was_marked {
        ui.ctx().request_repaint();
    }
    app.ask_for_output();
    app.drawn += u32::from(app.state.picture.is_some());
    app.drawing_ms = start.elapsed().as_secs_f32() * 1e3;
}
