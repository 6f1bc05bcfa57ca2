//! Keyboard commands.

use crate::app::{App, Output};
use crate::camera;
use crate::worker::{Command, Facts};
use egui::{Key, Modifiers, Ui};

/// Keys and their actions, for the help and the documentation.
pub const KEYS: &[(&str, &str)] = &[
    ("drag with left", "orbit the camera"),
    ("drag with right", "look around; with W A S D Q E fly, with the wheel change the speed"),
    ("wheel", "zoom the picture; drag with middle moves it"),
    ("click, P", "the rays of the pixel under the pointer"),
    ("hover a row, click it", "show what the pass writes; keep it shown"),
    ("up, down", "pin the output of the pass before, or behind"),
    ("Escape", "show the result; forget the pixel"),
    ("F", "move the camera until all of the scene is seen, or what its far plane lets"),
    ("C", "copy the camera as XML"),
    ("S", "save the picture: PNG, EXR, and JSON that says how to render it"),
    ("K", "keep the picture and compare with it"),
    ("R", "read all files again"),
    ("Space", "render nothing, or go on"),
    ("0, 1", "all of the picture; one pixel as one pixel of the screen"),
    ("F1", "these keys"),
];

/// Performs the actions of the keys that were pressed.
pub fn read(app: &mut App, ui: &Ui, facts: Option<&Facts>) {
    let context = ui.ctx().clone();
    if context.text_edit_focused() {
        return;
    }
    let pressed = |key: Key| context.input_mut(|input| input.consume_key(Modifiers::NONE, key));
    if pressed(Key::F1) {
        app.help = !app.help;
    }
    let flies = context.input(|input| input.pointer.secondary_down());
    if flies {
        return;
    }
    if pressed(Key::Escape) {
        app.pinned = None;
        app.help = false;
        app.pick(None);
    }
    if pressed(Key::R) {
        app.worker.send(Command::Reload);
    }
    if pressed(Key::Num0) {
        app.canvas.fit();
    }
    if pressed(Key::Num1) {
        app.canvas.one_to_one();
    }
    if pressed(Key::P) && app.pointed.is_some() {
        app.pick(app.pointed);
    }
    if pressed(Key::K) {
        app.keep(&context);
    }
    let Some(facts) = facts else { return };
    if pressed(Key::F) {
        fit(app, facts);
    }
    if pressed(Key::C) {
        copy_camera(app, &context, facts);
    }
    if pressed(Key::S) {
        app.worker.send(Command::Save(App::new_file(facts)));
    }
    // A widget with the focus receives Space and the arrow keys itself.
    if context.memory(|memory| memory.focused().is_some()) {
        return;
    }
    if pressed(Key::Space) {
        set_paused(app, !app.paused);
    }
    let step = i32::from(pressed(Key::ArrowDown)) - i32::from(pressed(Key::ArrowUp));
    if step != 0 {
        step_passes(app, facts, step);
    }
}

/// Pauses or continues rendering.
pub fn set_paused(app: &mut App, paused: bool) {
    app.paused = paused;
    app.worker.send(Command::Pause(paused));
}

/// Shows all of the scene, as far as the far plane allows.
pub fn fit(app: &mut App, facts: &Facts) {
    let aspect = facts.window[0] as f32 / facts.window[1].max(1) as f32;
    let far = facts.far;
    app.move_camera(Some(facts), |pose, bounds| camera::fit(pose, bounds, aspect, far));
}

/// Copies the camera to the clipboard as XML, and shows a message.
pub fn copy_camera(app: &mut App, context: &egui::Context, facts: &Facts) {
    let notice = match &facts.camera_xml {
        Ok(xml) => {
            context.copy_text(xml.clone());
            format!("Copied camera {} as XML", facts.seen_by)
        }
        Err(why) => format!("The camera cannot be copied: {why}"),
    };
    app.notify(context, notice);
}

/// Pins the first output of the next or the previous pass.
fn step_passes(app: &mut App, facts: &Facts, step: i32) {
    let outputs: Vec<Output> =
        facts.passes.iter().filter_map(|pass| pass.outputs.first()).map(|output| output.full.clone()).collect();
    let now = outputs.iter().position(|output| app.pinned.as_ref() == Some(output));
    let last = outputs.len() as i32 - 1;
    let next = now.map_or(if step > 0 { 0 } else { last }, |now| (now as i32 + step).clamp(0, last));
    app.pinned = outputs.get(next as usize).cloned();
}

#[cfg(test)]
mod tests {
    use super::KEYS;

    #[test]
    fn the_documentation_has_every_key() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/viewer.md");
        let page = std::fs::read_to_string(path).expect("the page");
        for (key, does) in KEYS {
            assert!(page.contains(&format!("| {key} | {does} |")), "{key}");
        }
    }
}
