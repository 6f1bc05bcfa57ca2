//! The picture, and the mouse over it.

use super::overlay;
use crate::app::{App, Mode};
use crate::camera;
use crate::canvas::SQUARES;
use crate::theme::RED;
use crate::worker::{Activity, Facts, Picture};
use egui::{
    Align2, CentralPanel, Color32, CursorIcon, Frame, Key, PointerButton, Pos2, Rect, Response, RichText, Role,
    ScrollArea, Sense, Stroke, Ui, WidgetInfo, pos2, vec2,
};
use glam::Vec3;
use std::time::Duration;

/// Rotation of the camera, radians, for each point that the mouse is dragged.
const TURN: f32 = 0.005;
/// Time after which [`Mode::Flicker`] changes the picture.
const FLICKER: Duration = Duration::from_millis(500);
/// Distance in points within which the line of a wipe can be grabbed.
const HOLD: f32 = 7.0;

/// Draws the picture, and handles the mouse over it.
pub fn draw(app: &mut App, ui: &mut Ui, facts: Option<&Facts>) {
    CentralPanel::default().frame(Frame::new().fill(Color32::from_gray(18))).show(ui, |ui| {
        if app.seen().is_none() {
            return nothing(app, ui);
        }
        let (area, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let shown = show(app, ui, area, facts);
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, format!("picture of {shown}")));
        mouse(app, ui, area, &response, facts);
    });
}

/// Says why there is no picture.
fn nothing(app: &App, ui: &mut Ui) {
    let error = app.state.error.as_ref().filter(|_| app.state.activity == Activity::Failed);
    let Some(error) = error else {
        ui.centered_and_justified(|ui| ui.weak(super::status::activity(&app.state.activity)));
        return;
    };
    ScrollArea::vertical().auto_shrink([false; 2]).show(ui, |ui| {
        ui.add_space(16.0);
        ui.label(RichText::new("There is nothing to show").heading());
        ui.add_space(8.0);
        ui.label(RichText::new(error).monospace().color(RED));
        ui.add_space(8.0);
        ui.weak("It is opened again when a file changes, or with R.");
    });
}

/// Draws the pictures and their overlays; returns the name of what is shown.
fn show(app: &App, ui: &Ui, area: Rect, facts: Option<&Facts>) -> String {
    let Some(picture) = app.seen() else { return String::new() };
    let size = picture.whole;
    let (canvas, context) = (app.canvas, ui.ctx().clone());
    let (rect, scale) = (canvas.rect(area, size), canvas.scale(area, size));
    let squares = scale * context.pixels_per_point() >= SQUARES;
    let painter = ui.painter_at(area);
    let other = app.compared().map(|[_, right]| right);
    let values = |of: &Picture, part: Rect| {
        overlay::values(&painter.with_clip_rect(part.intersect(area)), &canvas, area, of);
    };
    let draw = |picture: &Picture, part: Rect| {
        // Without a device, nothing is drawn at all.
        let Some(device) = &app.device else { return };
        let texture = match picture.on(device) {
            Ok(texture) => texture.id(device, squares),
            Err(why) => return overlay::missing(&painter, part.intersect(area), why),
        };
        let share = |at: Pos2| pos2((at.x - rect.left()) / rect.width(), (at.y - rect.top()) / rect.height());
        painter.image(texture, part, Rect::from_min_max(share(part.min), share(part.max)), Color32::WHITE);
    };
    let corner = area.intersect(rect).left_top() + vec2(8.0, 8.0);
    let heat = app.state.compared.clone();
    let name = named(&picture);
    let mut shown = name.clone();
    match (app.mode, other, heat) {
        (Mode::Difference, Some(_), Some(compared)) => {
            draw(&compared.heat, rect);
            values(&picture, rect);
            shown = format!("FLIP of {} and {}", compared.names[0], compared.names[1]);
            overlay::name(&painter, corner, Align2::LEFT_TOP, &shown);
        }
        (Mode::Flicker, Some(other), _) => {
            let second = context.input(|input| input.time / FLICKER.as_secs_f64()) as u64 % 2 == 1;
            context.request_repaint_after(FLICKER / 4);
            let (name, shown) = if second { (&named(&other), &other) } else { (&name, &picture) };
            draw(shown, rect);
            values(shown, rect);
            overlay::name(&painter, corner, Align2::LEFT_TOP, name);
        }
        (Mode::Wipe, Some(other), _) => {
            let [left, right] = overlay::halves(rect, app.wipe);
            draw(&picture, left);
            draw(&other, right);
            values(&picture, left);
            values(&other, right);
            painter.vline(left.right(), rect.y_range(), Stroke::new(1.5, Color32::WHITE));
            overlay::name(&painter, corner, Align2::LEFT_TOP, &name);
            let other_corner = area.intersect(rect).right_top() + vec2(-8.0, 8.0);
            overlay::name(&painter, other_corner, Align2::RIGHT_TOP, &named(&other));
        }
        _ => {
            draw(&picture, rect);
            values(&picture, rect);
            overlay::name(&painter, corner, Align2::LEFT_TOP, &name);
        }
    }
    let is_here = app.state.picture.as_ref().is_some_and(|here| here.whole == size);
    if let Some(rays) = app.state.pixel.as_ref().filter(|_| is_here) {
        let clip = facts.and_then(|facts| facts.clip_from_world.as_ref());
        overlay::rays(&painter, &canvas, area, size, clip, rays);
    }
    shown
}

/// The picture's name, with its size if that is reduced.
fn named(picture: &Picture) -> String {
    let (name, [width, height]) = (&picture.name, [picture.image.width, picture.image.height]);
    if picture.is_reduced() { format!("{name}, {width} × {height} while the camera moves") } else { name.clone() }
}

fn mouse(app: &mut App, ui: &Ui, area: Rect, response: &Response, facts: Option<&Facts>) {
    let Some(picture) = app.seen() else { return };
    let size = picture.whole;
    app.pointed = response.hover_pos().and_then(|at| app.canvas.pixel(area, size, at));
    let context = ui.ctx();
    let flies = response.dragged_by(PointerButton::Secondary)
        || response.is_pointer_button_down_on() && context.input(|i| i.pointer.secondary_down());
    let scroll = context.input(|input| input.smooth_scroll_delta().y);
    if let Some(at) = response.hover_pos().filter(|_| scroll != 0.0) {
        if flies {
            app.speed = (app.speed * (scroll * 0.004).exp()).clamp(1e-4, 100.0);
        } else {
            app.canvas.zoom(area, size, at, (scroll * 0.004).exp());
        }
    }
    if response.dragged_by(PointerButton::Middle) {
        app.canvas.pan(area, size, response.drag_delta());
    }
    if response.clicked() {
        app.pick(app.pointed);
    }
    let turn = response.drag_delta() * TURN;
    if response.dragged_by(PointerButton::Primary)
        && !hold_line(app, area, size, response, context)
        && turn != vec2(0.0, 0.0)
    {
        app.move_camera(facts, |pose, bounds| camera::orbit(pose, camera::pivot(pose, bounds), turn.x, -turn.y));
    }
    if response.dragged_by(PointerButton::Secondary) && turn != vec2(0.0, 0.0) {
        app.move_camera(facts, |pose, _| camera::look(pose, turn.x, -turn.y));
    }
    if flies {
        fly(app, context, facts);
    }
    // At rest the renderer reports the camera's pose, so the window drops its own copy.
    if app.state.activity == Activity::Resting && !flies && !response.dragged() {
        app.pose = None;
    }
}

/// Whether the line of a wipe is being dragged; if so, the line follows the pointer.
fn hold_line(app: &mut App, area: Rect, size: [u32; 2], response: &Response, context: &egui::Context) -> bool {
    let rect = app.canvas.rect(area, size);
    let (start, now) = context.input(|input| (input.pointer.press_origin(), input.pointer.interact_pos()));
    if response.drag_started() {
        let line = rect.left() + rect.width() * app.wipe;
        let wipes = app.mode == Mode::Wipe && app.compared().is_some();
        app.holds_line = wipes && start.is_some_and(|start| (start.x - line).abs() <= HOLD);
    }
    if let Some(now) = now.filter(|_| app.holds_line) {
        context.set_cursor_icon(CursorIcon::ResizeHorizontal);
        app.wipe = ((now.x - rect.left()) / rect.width().max(1.0)).clamp(0.0, 1.0);
    }
    app.holds_line
}

/// Moves the camera by the keys that are held down.
fn fly(app: &mut App, context: &egui::Context, facts: Option<&Facts>) {
    let (by, time) = context.input(|input| {
        let axis = |ahead: Key, back: Key| f32::from(input.key_down(ahead)) - f32::from(input.key_down(back));
        (Vec3::new(axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S)), input.stable_dt.min(0.1))
    });
    if by == Vec3::ZERO {
        return;
    }
    let speed = app.speed;
    app.move_camera(facts, |pose, bounds| camera::fly(pose, by * (speed * bounds.radius() * time)));
    context.request_repaint();
}
