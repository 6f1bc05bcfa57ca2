//! Pictures as textures of the window's device: their pixels on the screen, and how many textures there are. A software device will do.

use super::common::{Window, can_draw, project, settings, source};
use curitiba::pipeline::plan::Settings;
use curitiba_view::app::Mode;
use curitiba_view::worker::{Activity, Command, Side, What};
use eframe::egui_wgpu::{RendererOptions, WgpuSetup};
use egui::{Color32, ColorImage, Rect, TextureFilter, TextureHandle, TextureOptions, pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use egui_kittest::wgpu::{create_render_state, default_wgpu_setup};
use std::sync::Arc;

const OUTPUTS: [&str; 2] = ["Deferred Render Targets::pos", "Deferred Render Targets::norm"];

/// Where a window shows its picture.
struct Place {
    area: Rect,
    rect: Rect,
    squares: bool,
}

fn place(window: &Window) -> Place {
    let (app, shown) = (window.app(), window.app().seen().expect("a picture"));
    let label = |name: &str| window.harness.query_by_label(&format!("picture of {name}")).map(|node| node.rect());
    let other = app.compared().map(|[_, right]| right.name.clone());
    let map = other.as_ref().map(|other| format!("FLIP of {} and {other}", shown.name));
    let area = label(&shown.name).or_else(|| label(&map?)).expect("it is shown");
    let (canvas, size) = (app.canvas, shown.whole);
    Place { area, rect: canvas.rect(area, size), squares: canvas.scale(area, size) >= curitiba_view::canvas::SQUARES }
}

/// The pixels that the picture covers, without the names above it and the line of a wipe.
fn covered<T>(place: &Place, harness: &mut Harness<'_, T>) -> Vec<[u8; 4]> {
    let window = harness.render().expect("a device draws it");
    let inside = place.rect.intersect(place.area);
    let line = place.rect.center().x;
    let range = |from: f32, to: f32| from.ceil() as u32 + 1..to.floor() as u32 - 1;
    let columns = range(inside.left(), inside.right()).filter(|x| (*x as f32 - line).abs() > 4.0);
    let rows = range(inside.top() + 45.0, inside.bottom());
    rows.flat_map(|y| columns.clone().map(move |x| (x, y))).map(|(x, y)| window.get_pixel(x, y).0).collect()
}

fn drawn(window: &mut Window) -> Vec<[u8; 4]> {
    covered(&place(window), &mut window.harness)
}

/// The same pixels where egui has made the textures, one for each part from left to right.
fn by_egui(place: &Place, options: RendererOptions, pictures: &[Arc<ColorImage>]) -> Vec<[u8; 4]> {
    let &Place { area, rect, squares } = place;
    let (pictures, mut textures) = (pictures.to_vec(), Vec::<TextureHandle>::new());
    let share = 1.0 / pictures.len() as f32;
    let builder = Harness::builder().with_size(egui::vec2(1280.0, 800.0)).with_render_options(options).wgpu();
    let mut harness = builder.build_ui(move |ui| {
        let magnification = if squares { TextureFilter::Nearest } else { TextureFilter::Linear };
        let options = TextureOptions { magnification, ..TextureOptions::LINEAR };
        if textures.is_empty() {
            let load = |picture: &Arc<ColorImage>| ui.ctx().load_texture("picture", Arc::clone(picture), options);
            textures = pictures.iter().map(load).collect();
        }
        let painter = ui.painter_at(area);
        painter.rect_filled(area, 0.0, Color32::from_gray(18));
        for (index, texture) in textures.iter().enumerate() {
            let [from, to] = [index, index + 1].map(|index| index as f32 * share);
            let x = |share: f32| rect.left() + rect.width() * share;
            let part = Rect::from_min_max(pos2(x(from), rect.top()), pos2(x(to), rect.bottom()));
            painter.image(texture.id(), part, Rect::from_min_max(pos2(from, 0.0), pos2(to, 1.0)), Color32::WHITE);
        }
    });
    harness.step();
    covered(place, &mut harness)
}

#[test]
fn pictures_have_the_pixels_of_textures_that_egui_makes() {
    if !can_draw() {
        return;
    }
    // Magnified as squares, magnified and blended, and reduced.
    let sizes = [[96, 64], [480, 320], [1200, 1000]];
    for (size, options) in sizes
        .map(|size| (size, RendererOptions::default()))
        .into_iter()
        .chain([(sizes[0], RendererOptions::PREDICTABLE), (sizes[1], RendererOptions::PREDICTABLE)])
    {
        let device = create_render_state(default_wgpu_setup(), options);
        let of_size = Settings { size: Some(size), ..Settings::default() };
        let mut window = Window::on(source(project("SceneShadows"), of_size), Some(device));
        window.rest();
        let at = place(&window);
        assert_eq!(at.squares, size == sizes[0]);
        let picture = Arc::clone(&window.app().seen().expect("a picture").shown);
        let one = drawn(&mut window);
        assert!(one.len() > 50_000 && one == by_egui(&at, options, &[Arc::clone(&picture)]), "{size:?}");
        let wrong = Place { squares: !at.squares, ..at };
        assert!(size == sizes[2] || one != by_egui(&wrong, options, &[Arc::clone(&picture)]), "control");
        // Another picture takes the place of the first, and the first comes back.
        for name in [Some(OUTPUTS[1]), None] {
            window.harness.state_mut().pinned = Some(name.map(str::to_owned));
            window.rest();
            let shown = window.app().seen().expect("a picture");
            assert_eq!(shown.name, name.unwrap_or("result"));
            let expected = by_egui(&place(&window), options, &[Arc::clone(&shown.shown)]);
            let pixels = drawn(&mut window);
            assert!(pixels == expected && (pixels == one) == name.is_none(), "{size:?}: {}", shown.name);
        }
        window.harness.state_mut().compare_with(Some(Side::here(What::Output(OUTPUTS[1].to_owned()))));
        window.rest();
        let [left, right] = window.app().compared().expect("both").map(|picture| Arc::clone(&picture.shown));
        let at = place(&window);
        let wipe = by_egui(&at, options, &[Arc::clone(&left), Arc::clone(&right)]);
        assert!(drawn(&mut window) == wipe, "{size:?}: wipe");
        window.harness.state_mut().mode = Mode::Flicker;
        let expected = [left, right].map(|picture| by_egui(&at, options, &[picture]));
        let mut seen = [false; 2];
        for _ in 0..6 {
            window.harness.step();
            // The pixels tell which of the two is shown.
            let pixels = covered(&at, &mut window.harness);
            let index = expected.iter().position(|expected| *expected == pixels);
            seen[index.unwrap_or_else(|| panic!("{size:?}: flicker"))] = true;
        }
        assert_eq!(seen, [true; 2], "{size:?}");
        window.harness.state_mut().mode = Mode::Difference;
        window.rest();
        let heat = Arc::clone(&window.app().state.compared.as_ref().expect("numbers").heat.shown);
        assert!(drawn(&mut window) == by_egui(&at, options, &[heat]), "{size:?}: difference");
    }
}

#[test]
fn new_pictures_use_the_textures_of_old_ones() {
    if !can_draw() {
        return;
    }
    let mut window = Window::drawn(source(project("SceneShadows"), settings()));
    let mut turn = 0;
    let mut textures = |window: &mut Window, pictures: u32| {
        for _ in 0..pictures {
            turn += 1;
            let name = OUTPUTS[turn % 2];
            window.harness.state_mut().pinned = Some(Some(name.to_owned()));
            window.until(name, |app| app.state.picture.as_ref().is_some_and(|picture| picture.name == name));
        }
        let device = &window.device.as_ref().expect("it is drawn").device;
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
        // Every texture has one view.
        device.get_internal_counters().hal.texture_views.read()
    };
    let few = textures(&mut window, 4);
    assert!(few > 1, "control: textures are counted: {few}");
    // The renderer's thread may be one picture ahead of the window.
    let many = textures(&mut window, 50);
    assert!(many <= few + 1, "{few} {many}");
    // The textures of a comparison are freed after it, at the next picture; but the result keeps its own.
    window.harness.state_mut().compare_with(Some(Side::here(What::Result)));
    window.rest();
    let compared = textures(&mut window, 4);
    assert!(compared > few, "control: {few} {compared}");
    window.harness.state_mut().compare_with(None);
    window.rest();
    let after = textures(&mut window, 50);
    assert!(after <= few + 2, "{few} {compared} {after}");
}

#[test]
fn a_picture_larger_than_the_devices_textures_is_shown_by_every_second_pixel() {
    if !can_draw() {
        return;
    }
    let WgpuSetup::CreateNew(mut setup) = default_wgpu_setup() else { panic!("egui's tests create their device") };
    let whole = Arc::clone(&setup.device_descriptor);
    setup.device_descriptor = Arc::new(move |adapter| {
        let mut descriptor = whole(adapter);
        descriptor.required_limits.max_texture_dimension_2d = 2048;
        descriptor
    });
    let device = create_render_state(WgpuSetup::CreateNew(setup), RendererOptions::PREDICTABLE);
    let large = Settings { size: Some([2401, 801]), ..Settings::default() };
    let mut window = Window::on(source(project("SceneShadows"), large), Some(device));
    window.rest();
    let picture = Arc::clone(&window.app().seen().expect("a picture").shown);
    let pixels = (0..801).step_by(2).flat_map(|y| (0..2401).step_by(2).map(move |x| (x, y)));
    let half = ColorImage::new([1201, 401], pixels.map(|at| picture[at]).collect());
    let expected = by_egui(&place(&window), RendererOptions::PREDICTABLE, &[Arc::new(half)]);
    assert!(drawn(&mut window) == expected);
}

#[test]
fn a_device_that_is_lost_does_not_end_the_renderer() {
    if !can_draw() {
        return;
    }
    let mut window = Window::drawn(source(project("SceneShadows"), settings()));
    window.device.as_ref().expect("it is drawn").device.destroy();
    for name in OUTPUTS {
        window.app().worker.send(Command::Show(Some(name.to_owned())));
        let start = std::time::Instant::now();
        loop {
            let state = window.app().worker.state();
            assert_ne!(state.activity, Activity::Failed, "{:?}", state.error);
            if state.picture.is_some_and(|picture| picture.name == name) {
                break;
            }
            assert!(start.elapsed().as_secs() < 60, "waited for {name}");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        window.harness.step();
    }
}
