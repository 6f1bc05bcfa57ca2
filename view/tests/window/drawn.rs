//! The look of the window, drawn on a device (a software one will do).

use super::common::{Window, can_draw, project, source};
use curitiba::RasterChoice;
use curitiba::pipeline::plan::Settings;
use curitiba_view::app::Mode;
use curitiba_view::worker::{On, Side, What};
use egui_kittest::kittest::Queryable as _;

/// The window's pixels; `CURITIBA_PICTURES=DIR` writes them.
fn drawn(window: &mut Window, name: &str) -> (u32, Vec<[u8; 4]>) {
    window.harness.step();
    let picture = window.harness.render().expect("a device draws it");
    let (width, height) = (picture.width(), picture.height());
    assert_eq!((width, height), (1280, 800));
    let bytes: Vec<[u8; 4]> = picture.pixels().map(|pixel| pixel.0).collect();
    if let Some(folder) = std::env::var_os("CURITIBA_PICTURES") {
        let pixels = bytes.iter().map(|pixel| pixel.map(|byte| f32::from(byte) / 255.0)).collect();
        let image = curitiba::pipeline::image::Image { width, height, pixels };
        let path = std::path::Path::new(&folder).join(format!("window-{name}.png"));
        curitiba::pipeline::image::write_png(&path, &image).expect("written");
    }
    (width, bytes)
}

#[test]
fn the_picture_lies_in_the_window_pixel_by_pixel() {
    if !can_draw() {
        return;
    }
    let settings = Settings { size: Some([480, 480]), ..Settings::default() };
    let mut window = Window::drawn(source(project("SceneShadows"), settings));
    window.harness.key_press(egui::Key::Num1);
    window.harness.step();
    let (width, bytes) = drawn(&mut window, "one-to-one");
    let picture = window.app().state.picture.clone().expect("a picture");
    let area = window.harness.get_by_label("picture of result").rect();
    let rect = window.app().canvas.rect(area, [480, 480]);
    let [left, top] = [rect.left(), rect.top()].map(|side| side.round() as usize);
    // If the picture is not aligned with the screen's pixels, it is filtered, so edges are allowed to differ.
    let near = |a: [u8; 4], b: [u8; 4]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 2);
    let mut same = 0;
    for (y, x) in (40..440).flat_map(|y| (0..480).map(move |x| (y, x))) {
        let own = picture.shown[(x, y)].to_array();
        same += usize::from(near(bytes[(top + y) * width as usize + left + x], own));
    }
    assert!(same > 400 * 480 * 98 / 100, "{same} of {} pixels", 400 * 480);
}

#[test]
fn all_parts_are_drawn_beside_one_another() {
    if !can_draw() {
        return;
    }
    let settings = Settings { size: Some([512, 512]), ..Settings::default() };
    let mut window = Window::drawn(source(project("SceneFinal"), settings));
    let (_, plain) = drawn(&mut window, "final");
    let colors: std::collections::HashSet<[u8; 4]> = plain.into_iter().collect();
    assert!(colors.len() > 1000, "{} colours", colors.len());
    // No element overlaps another: the panels share the window.
    let picture = window.harness.get_by_label("picture of result").rect();
    for label in ["pass1", "pass2", "pass5", "Compare", "Pixel", "Fit", "Ready"] {
        let rect = window.harness.get_by_label(label).rect();
        assert!(
            !rect.intersects(picture) && rect.min.x >= 0.0 && rect.max.x <= 1280.0 && rect.max.y <= 800.0,
            "{label}: {rect}"
        );
    }
    assert!(picture.width() > 500.0 && picture.height() > 500.0, "{picture}");
    window.harness.get_by_label("pass2").hover();
    window.rest();
    drawn(&mut window, "hovered");
    window.harness.hover_at(picture.center());
    window.harness.step();
    window.harness.key_press(egui::Key::P);
    window.until("rays", |app| app.state.pixel.is_some());
    window.rest();
    drawn(&mut window, "pixel");
    window.harness.key_press(egui::Key::Escape);
    let norm = What::Output("Deferred Render Targets::norm".to_owned());
    window.harness.state_mut().compare_with(Some(Side::here(norm.clone())));
    window.rest();
    for (mode, name) in [(Mode::Wipe, "wipe"), (Mode::Difference, "difference")] {
        window.harness.state_mut().mode = mode;
        window.harness.run_steps(2);
        drawn(&mut window, name);
    }
    // An output by another rasteriser, with numbers and times, and the list of outputs.
    let there = Side::Rendered { what: norm.clone(), on: On::Raster(RasterChoice::Wgpu) };
    window.harness.state_mut().compare(Side::here(norm), Some(there));
    window.harness.state_mut().mode = Mode::Wipe;
    window.rest();
    window.harness.run_steps(2);
    let [of, numbers] = ["engines of the left side", "RMSE"].map(|label| window.harness.get_by_label(label).rect());
    assert!(of.right() <= 1280.0 && numbers.top() > of.bottom(), "{of} {numbers}");
    drawn(&mut window, "engines");
    window.harness.get_by_label("left side").click();
    window.harness.run_steps(3);
    drawn(&mut window, "list");
    window.harness.key_press(egui::Key::Escape);
    window.harness.state_mut().compare_with(None);
    window.harness.key_press(egui::Key::C);
    window.harness.run_steps(2);
    let notice = window.harness.get_by_label("Copied camera MainCamera as XML").rect();
    assert!(picture.contains_rect(notice), "{notice}");
    drawn(&mut window, "copied");
    window.harness.key_press(egui::Key::F1);
    window.harness.run_steps(2);
    drawn(&mut window, "keys");
}
