//! The bar at the bottom: the activity, and every deviation from the request, such as fallbacks.

use crate::app::App;
use crate::theme::{RED, YELLOW, milliseconds};
use crate::worker::{Activity, Doing, Facts, NO_SAMPLES};
use egui::{Align, Layout, Panel, RichText, ScrollArea, Ui};
use std::time::Duration;

/// Draws the bar, and above it the errors and warnings.
pub fn draw(app: &mut App, ui: &mut Ui, facts: Option<&Facts>) {
    Panel::bottom("status").show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.label(activity(&app.state.activity));
            if let Some(doing) = &app.state.doing {
                doing_now(ui, doing);
            }
            if let Some(refinement) = &app.state.refinement {
                let crate::worker::Refinement { samples, goal, error } = refinement;
                let error = if error.is_nan() { String::new() } else { format!(", standard error {error:.5}") };
                ui.label(format!("{samples} of {goal} samples{error}"));
            } else if let Some(why) = app.state.not_refined.as_ref().filter(|why| app.refine && *why != NO_SAMPLES) {
                let first = why.lines().next().unwrap_or_default();
                ui.weak("samples of the project").on_hover_text(format!("not refined: {first}"));
            }
            if let Some(told) = &app.state.told {
                ui.separator();
                ui.add(egui::Label::new(RichText::new(told).weak()).truncate());
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| right(app, ui, facts));
        });
    });
    let Some(error) = &app.state.error else { return warnings(app, ui, facts) };
    Panel::bottom("error").show(ui, |ui| {
        ScrollArea::vertical().max_height(90.0).show(ui, |ui| {
            ui.label(RichText::new(error).color(RED).monospace());
        });
    });
    warnings(app, ui, facts);
}

/// Shows the step of the renderer that makes a side of a comparison.
fn doing_now(ui: &mut Ui, doing: &Doing) {
    /// Period of reading the step's progress.
    const LOOKED_AT: Duration = Duration::from_millis(200);
    let (done, total) = doing.progress.get();
    let share = (100 * done.min(total)).checked_div(total).map_or_else(String::new, |share| format!(", {share} %"));
    ui.weak(format!("{}{share}", doing.what));
    ui.ctx().request_repaint_after(LOOKED_AT);
}

fn right(app: &mut App, ui: &mut Ui, facts: Option<&Facts>) {
    let Some(facts) = facts else { return };
    ui.weak(format!("window {}", milliseconds(app.drawing_ms.into())))
        .on_hover_text("what laying out the window took last, beside the passes");
    ui.separator();
    let frame = facts.frame_ms();
    let once = facts.once.iter().map(|(what, ms)| format!("{what}: {}", milliseconds(*ms)));
    ui.label(format!("passes {}", milliseconds(frame))).on_hover_text(once.collect::<Vec<_>>().join("\n"));
    ui.separator();
    let count = facts.warnings.len();
    if count > 0 {
        let text = RichText::new(if count == 1 { "1 warning".to_owned() } else { format!("{count} warnings") });
        if ui.selectable_label(app.list_warnings, text.color(YELLOW)).clicked() {
            app.list_warnings = !app.list_warnings;
        }
    } else {
        ui.weak("no warnings");
    }
}

fn warnings(app: &App, ui: &mut Ui, facts: Option<&Facts>) {
    let Some(facts) = facts.filter(|facts| app.list_warnings && !facts.warnings.is_empty()) else { return };
    Panel::bottom("warnings").show(ui, |ui| {
        ScrollArea::vertical().max_height(72.0).auto_shrink([false, true]).show(ui, |ui| {
            for warning in &facts.warnings {
                ui.label(RichText::new(warning).color(YELLOW).small());
            }
        });
    });
}

/// The activity as text.
pub fn activity(activity: &Activity) -> &'static str {
    match activity {
        Activity::Opening => "Opening…",
        Activity::Rendering => "Rendering…",
        Activity::Moving => "Moving",
        Activity::Refining => "Refining…",
        Activity::Comparing => "Comparing…",
        Activity::Resting => "Ready",
        Activity::Paused => "Paused",
        Activity::Failed => "Cannot render",
    }
}
