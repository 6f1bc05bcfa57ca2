//! Graph of the times of the last frames, stacked by pass.

use crate::app::App;
use crate::theme::{color, milliseconds};
use crate::worker::{FRAMES, Facts};
use egui::{Align2, Color32, FontId, Panel, Rect, Sense, Stroke, Ui, pos2};

/// Width of a frame's bar, points.
const WIDTH: f32 = 3.0;

/// Draws the graph; the pass under the pointer is highlighted.
pub fn draw(app: &mut App, ui: &mut Ui, facts: Option<&Facts>) {
    let history = std::sync::Arc::clone(&app.state.history);
    Panel::bottom("graph").exact_size(84.0).show(ui, |ui| {
        let (response, painter) = ui.allocate_painter(ui.available_size(), Sense::hover());
        let area = response.rect;
        let longest = history.longest();
        painter.rect_filled(area, 2.0, Color32::from_gray(22));
        if history.frames().len() == 0 {
            let middle = area.center();
            painter.text(middle, Align2::CENTER_CENTER, "no frame yet", FontId::proportional(12.0), Color32::GRAY);
            return;
        }
        let scale = area.height() * 0.92 / longest.max(1e-3);
        let shown = ((area.width() / WIDTH) as usize).min(FRAMES).min(history.frames().len());
        let pointer = response.hover_pos();
        let mut told = None;
        for (index, frame) in history.frames().rev().take(shown).enumerate() {
            let right = area.right() - index as f32 * WIDTH;
            let mut bottom = area.bottom();
            for (pass, ms) in frame.iter().enumerate().filter(|(_, ms)| **ms > 0.0) {
                let bar = Rect::from_min_max(pos2(right - WIDTH + 0.5, bottom - ms * scale), pos2(right, bottom));
                let over = pointer.is_some_and(|at| bar.x_range().contains(at.x) && bar.y_range().contains(at.y));
                if over {
                    app.marked = Some(pass);
                    told = Some((pass, *ms));
                }
                bottom = bar.top();
                let faint = app.was_marked.is_some_and(|marked| marked != pass);
                painter.rect_filled(bar, 0.0, color(pass).gamma_multiply(if faint { 0.35 } else { 1.0 }));
            }
        }
        let line = area.bottom() - longest * scale;
        painter.hline(area.x_range(), line, Stroke::new(1.0, Color32::from_gray(70)));
        let font = FontId::proportional(11.0);
        let (count, time) = (history.frames().len(), milliseconds(longest.into()));
        let text = format!("longest of {count} frame{} {time}", if count == 1 { "" } else { "s" });
        let at = pos2(area.left() + 6.0, line + 2.0);
        let galley = painter.layout_no_wrap(text, font, Color32::from_gray(190));
        painter.rect_filled(Rect::from_min_size(at, galley.size()).expand(2.0), 2.0, Color32::from_black_alpha(160));
        painter.galley(at, galley, Color32::WHITE);
        if let (Some((pass, ms)), Some(facts)) = (told, facts)
            && let Some(pass) = facts.passes.get(pass)
        {
            response.on_hover_text_at_pointer(format!("{}: {}", pass.name, milliseconds(ms.into())));
        }
    });
}
