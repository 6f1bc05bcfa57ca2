//! The window as a person uses it: elements are found by their labels, hovered, clicked and dragged, and the shown picture is checked.
//!
//! No screen is needed. Tests that also draw need a device (a software one will do). Without one, those tests print `skipped: why` and pass; with
//! `CURITIBA_REQUIRE_GPU_TESTS=1` they fail instead.

mod common;
mod compared;
mod drawn;
mod frame;
mod measured;
mod textures;

use common::{Window, bytes, png, project, settings, source};
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::plan::Settings;
use curitiba::{BackendChoice, Choice};
use curitiba_view::worker::{Activity, Command, PassState, Side};
use egui_kittest::kittest::Queryable as _;
use glam::Vec3;
use std::time::{Duration, Instant};

/// The picture that `curitiba render` shows with these settings.
fn rendered(name: &str, settings: Settings) -> curitiba::pipeline::image::Image {
    let mut renderer = curitiba::open(project(name), settings, Choice::CPU, &mut Silent).expect("it opens");
    renderer.frame(&mut Silent).expect("it renders")
}

fn few() -> Settings {
    Settings { set: vec!["pass2.samples=4".to_owned()], ..settings() }
}

#[test]
fn every_shipped_project_is_shown_as_it_is_rendered() {
    let names =
        ["SceneDummy", "SceneFinal", "SceneNoEffects", "SceneReflect", "SceneRefract", "SceneSSAO", "SceneShadows"];
    let effects = [
        "CubeReflect",
        "CubeRefract",
        "PlanarReflect",
        "ScreenReflect",
        "ScreenRefract",
        "DepthOcclusion",
        "GTAO",
        "ShadowMap",
    ];
    let raster = effects.map(|name| format!("raster/Scene{name}"));
    for name in names.into_iter().chain(raster.iter().map(String::as_str)) {
        let mut window = Window::start(source(project(name), settings()), false);
        // The first picture, before more samples are taken.
        window.until("a picture", |app| app.state.picture.is_some());
        window.harness.state_mut().refine = false;
        window.app().worker.send(Command::Refine(false));
        window.rest();
        assert_eq!(window.app().state.error, None, "{name}");
        let picture = window.app().state.picture.clone().expect("a picture");
        assert!(picture.image == rendered(name, settings()), "{name}: not the picture of `render`");
        for pass in &window.app().state.facts.clone().expect("it is open").passes {
            window.harness.get_by_label(&pass.name);
            window.harness.get_by_label(&format!("run {}", pass.name));
        }
    }
}

#[test]
fn hovering_a_row_shows_what_render_writes_of_it_and_clicking_keeps_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut window = Window::open(source(project("SceneFinal"), few()));
    window.harness.state_mut().refine = false;
    window.app().worker.send(Command::Refine(false));
    window.rest();
    let result = window.shown();
    let show = Settings { show: vec!["all".to_owned()], ..few() };
    let mut renderer = curitiba::open(project("SceneFinal"), show, Choice::CPU, &mut Silent).expect("it opens");
    renderer.render_and_save(&folder.path().join("out.png"), &mut Silent).expect("written");
    for (label, file) in [("pos", "pos"), ("norm", "norm"), ("color", "color"), ("pass2", "offscreenrender")] {
        window.harness.get_by_label(label).hover();
        window.rest();
        let (name, bytes) = window.shown();
        assert!(name.ends_with(&format!("::{file}")), "{label}: {name}");
        assert!(bytes == png(&folder.path().join(format!("out.{file}.png"))), "{label}: another picture than --show's");
    }
    window.harness.hover_at(egui::pos2(640.0, 400.0));
    window.rest();
    assert!(window.shown() == result, "without a row under the pointer the result is shown");
    window.harness.get_by_label("norm").click();
    window.harness.step();
    window.harness.hover_at(egui::pos2(640.0, 400.0));
    window.rest();
    assert!(window.shown().0.ends_with("::norm"), "a click keeps it");
    window.harness.key_press(egui::Key::Escape);
    window.rest();
    assert!(window.shown() == result);
}

#[test]
fn a_pass_is_switched_off_and_on_again() {
    let mut window = Window::open(source(project("SceneShadows"), settings()));
    let (lit, off) = (window.shown(), Settings { off: vec!["pass2".to_owned()], ..settings() });
    window.click("run pass2");
    assert_eq!(window.pass("pass2").state, PassState::Off);
    let picture = window.app().state.picture.clone().expect("a picture");
    assert!(picture.image == rendered("SceneShadows", off) && window.shown() != lit);
    window.click("run pass2");
    assert!(window.pass("pass2").state == PassState::Runs && window.shown() == lit);
    // A pass whose output others read cannot be switched off: the window says so, and nothing changes.
    window.click("run pass1");
    let error = window.app().state.error.clone().expect("it is refused");
    assert!(error.contains("pass2") && error.contains("switched off"), "{error}");
    assert!(window.pass("pass1").state == PassState::Runs && window.shown() == lit);
}

#[test]
fn a_slider_times_only_the_later_rows_again() {
    let mut window = Window::open(source(project("SceneSSAO"), few()));
    let runs = |window: &Window| ["pass1", "pass2", "pass5"].map(|name| window.pass(name).times.runs);
    let before = runs(&window);
    window.harness.get_by_label("pass2 samples").set_value_accesskit(9.0);
    window.rest();
    let set = window.app().state.facts.clone().expect("it is open").settings.set.clone();
    assert!(set == ["pass2.samples=9"], "{set:?}");
    let after = runs(&window);
    assert_eq!(after[0], before[0], "the G-buffer is not drawn again");
    assert!(after[1] > before[1] && after[2] > before[2], "{before:?} {after:?}");
}

#[test]
fn more_samples_at_rest_lower_the_error() {
    let reference = rendered("SceneSSAO", Settings { set: vec!["pass2.samples=4096".to_owned()], ..settings() });
    let rmse = |picture: &curitiba::pipeline::image::Image| {
        let options = curitiba::pipeline::metrics::Options::default();
        curitiba::pipeline::metrics::compare(picture, &reference, &options).expect("comparable").rmse
    };
    let mut window = Window::open(source(project("SceneSSAO"), few()));
    window.click("Refine at rest");
    let first = window.app().state.picture.clone().expect("a picture");
    assert!(first.image == rendered("SceneSSAO", few()), "without more samples it is that of the project");
    window.click("Refine at rest");
    let refinement = window.app().state.refinement.clone().expect("samples were added");
    assert_eq!((refinement.samples, refinement.goal), (256, 256));
    let last = window.app().state.picture.clone().expect("a picture");
    let (before, after) = (rmse(&first.image), rmse(&last.image));
    assert!(after < 0.3 * before, "{after} after {before}");
    // The stated error is an upper estimate; here it must stay below ten times the real one.
    assert!(refinement.error > after && refinement.error < 10.0 * after, "{} for {after}", refinement.error);
    // The same number of samples at once gives the same picture.
    assert!(last.image == rendered("SceneSSAO", Settings { set: vec!["pass2.samples=256".to_owned()], ..settings() }));
}

#[test]
fn what_is_wrong_with_a_project_is_shown_with_its_line_until_it_is_mended() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("broken.xml");
    let text = std::fs::read_to_string(project("SceneShadows")).expect("the project");
    let absolute = project("").parent().expect("a folder").canonicalize().expect("it is there");
    let text = text.replace("3dsmodels\\", &format!("{}/3dsmodels/", absolute.display()));
    let text = text.replace("mlibs\\", &format!("{}/mlibs/", absolute.display()));
    let line = 1 + text.lines().position(|line| line.contains("class=\"optix\"")).expect("a ray pass");
    std::fs::write(&path, text.replace("class=\"optix\"", "class=\"optiks\"")).expect("written");
    curitiba::pipeline::files::record_files_read();
    let mut window =
        Window::start(curitiba_view::worker::Source { watch: true, ..source(path.clone(), settings()) }, false);
    window.until("a failure", |app| app.state.activity == Activity::Failed);
    let error = window.app().state.error.clone().expect("it says why");
    assert!(error.contains(&format!("broken.xml:{line}:")) && error.contains("optiks"), "{error}");
    window.harness.get_by_label("There is nothing to show");
    std::fs::write(&path, &text).expect("written");
    window.until("the mended project", |app| app.state.picture.is_some());
    assert_eq!(window.app().state.error, None);
    let before = window.shown();
    // Once the project is open, a mistake in the file leaves the picture as it was, and a change is shown without a request.
    std::fs::write(&path, text.replace("class=\"optix\"", "class=\"optiks\"")).expect("written");
    window.until("the mistake", |app| app.state.error.as_deref().is_some_and(|error| error.contains("optiks")));
    assert!(window.shown() == before);
    std::fs::write(&path, text.replace("fov=\"60.0\"", "fov=\"30.0\"")).expect("written");
    window.until("the new picture", |app| app.state.picture.as_ref().is_some_and(|picture| bytes(picture) != before.1));
    assert_eq!(window.app().state.error, None);
}

#[test]
fn a_camera_that_was_moved_and_copied_gives_the_same_picture_elsewhere() {
    let mut window = Window::open(source(project("SceneShadows"), settings()));
    let before = window.shown();
    // The camera is turned by dragging over the picture, and flown.
    window.harness.drag_at(egui::pos2(600.0, 400.0));
    window.harness.step();
    for x in [620.0, 650.0, 700.0] {
        window.harness.hover_at(egui::pos2(x, 380.0));
        window.harness.step();
    }
    window.harness.drop_at(egui::pos2(700.0, 380.0));
    window.rest();
    let facts = window.app().state.facts.clone().expect("it is open");
    let pose = facts.pose.expect("a camera");
    let pose = curitiba_view::camera::fly(&pose, Vec3::new(0.3, 0.1, 2.7));
    window.app().worker.send(Command::Move(pose));
    window.rest();
    assert!(window.shown() != before, "it has moved");
    window.harness.key_down(egui::Key::C);
    window.harness.step();
    let copied = window.harness.output().platform_output.commands.iter().find_map(|command| match command {
        egui::OutputCommand::CopyText(text) => Some(text.clone()),
        _ => None,
    });
    let copied = copied.expect("C copies");
    window.harness.step();
    window.harness.get_by_label("Copied camera MainCamera as XML");
    let text = std::fs::read_to_string(project("SceneShadows")).expect("the project");
    let start = text.find("<camera name=\"MainCamera\"").expect("the camera");
    let end = start + text[start..].find("</camera>").expect("its end") + "</camera>".len();
    let folder = project("").parent().expect("a folder").canonicalize().expect("it is there");
    let pasted = format!("{}{}{}", &text[..start], copied.trim(), &text[end..])
        .replace("3dsmodels\\", &format!("{}/3dsmodels/", folder.display()))
        .replace("mlibs\\", &format!("{}/mlibs/", folder.display()));
    let elsewhere = tempfile::tempdir().expect("a folder");
    let path = elsewhere.path().join("pasted.xml");
    std::fs::write(&path, pasted).expect("written");
    let mut renderer = curitiba::open(&path, settings(), Choice::CPU, &mut Silent).expect("it opens");
    let expected = renderer.frame(&mut Silent).expect("it renders");
    assert!(window.app().state.picture.clone().expect("a picture").image == expected, "not the same to the bit");
}

/// Drags over the picture; `look` checks what is shown after each move.
fn drag(window: &mut Window, moves: usize, mut look: impl FnMut(&mut Window) -> bool) {
    window.harness.drag_at(egui::pos2(560.0, 400.0));
    window.harness.step();
    for step in 0..moves {
        window.harness.hover_at(egui::pos2(570.0 + (step % 40) as f32 * 3.0, 400.0 - (step % 40) as f32));
        window.harness.step();
        std::thread::sleep(Duration::from_millis(8));
        if look(window) {
            break;
        }
    }
    window.harness.drop_at(egui::pos2(690.0, 362.0));
}

#[test]
fn a_slow_picture_has_fewer_pixels_while_the_camera_moves_and_all_of_them_at_rest() {
    // Far above 50 ms for a frame of one sample.
    let slow = Settings { size: Some([2049, 1537]), set: vec!["pass2.samples=1".to_owned()], ..Settings::default() };
    let mut window = Window::start(source(project("SceneSSAO"), slow.clone()), false);
    window.until("a picture", |app| app.state.picture.is_some());
    window.click("Refine at rest");
    let area = window.harness.get_by_label("picture of result").rect();
    let before = window.app().canvas.rect(area, [2049, 1537]);
    let mut small = None;
    drag(&mut window, 2000, |window| {
        let picture = window.app().state.picture.clone().expect("a picture");
        small = picture.is_reduced().then_some(picture);
        small.is_some()
    });
    let small = small.expect("fewer pixels");
    let [width, height] = [small.image.width, small.image.height];
    assert!(small.whole == [2049, 1537] && [[1025, 769], [513, 385]].contains(&[width, height]), "{width} x {height}");
    // The small picture has the place of the whole one, and a label that says so. The pixel under the pointer is the one that is seen there.
    window.harness.get_by_label(&format!("picture of result, {width} × {height} while the camera moves"));
    assert_eq!(window.app().canvas.rect(area, small.whole), before);
    assert_eq!(small.pixel([2048, 1536]), small.image.pixels.last().copied());
    let middle = (height / 2 * width + width / 2) as usize;
    assert_eq!(small.pixel([1024, 768]), Some(small.image.pixels[middle]));
    assert_eq!((small.pixel([2049, 0]), small.pixel([0, 1537])), (None, None));
    // The small picture cannot be kept.
    window.harness.key_press(egui::Key::K);
    window.harness.step();
    window.harness.get_by_label("the picture is not whole: keep it when the camera rests");
    assert!(window.app().right.is_none());
    // The size and the parameters that are shown are those of the whole picture.
    let facts = window.app().state.facts.clone().expect("it is open");
    assert_eq!((facts.window, &facts.settings.set), ([2049, 1537], &slow.set));
    window.rest();
    let facts = window.app().state.facts.clone().expect("it is open");
    let picture = window.app().state.picture.clone().expect("a picture");
    assert!(!picture.is_reduced() && facts.settings.preview.is_none());
    let mut renderer = curitiba::open(project("SceneSSAO"), slow, Choice::CPU, &mut Silent).expect("it opens");
    renderer.set_pose("MainCamera", facts.pose.expect("a camera")).expect("a pose");
    assert!(picture.image == renderer.frame(&mut Silent).expect("it renders"), "at rest nothing is left out");
}

#[test]
fn a_quick_picture_keeps_its_pixels_while_the_camera_moves_and_refines_at_rest() {
    let mut window = Window::open(source(project("SceneSSAO"), Settings { size: Some([48, 32]), ..few() }));
    let before = window.app().state.frames;
    drag(&mut window, 40, |window| {
        // If two frames in a row waited for other tests, the window may render fewer pixels.
        let waited = window.app().state.history.frames().rev().take(4).filter(|frame| frame.iter().sum::<f32>() > 40.0);
        let waited = waited.count() > 1;
        assert!(waited || !window.app().state.picture.clone().expect("a picture").is_reduced());
        waited
    });
    assert!(window.app().state.frames > before, "control: it has moved");
    window.rest();
    let refinement = window.app().state.refinement.clone().expect("more samples");
    assert_eq!(refinement.samples, 256);
}

#[test]
fn fitting_shows_the_scene_although_its_far_plane_is_near() {
    let mut window = Window::open(source(project("SceneShadows"), settings()));
    let drawn = |window: &Window| {
        let picture = window.app().state.picture.clone().expect("a picture");
        let lit = picture.image.pixels.iter().filter(|[r, g, b, _]| r + g + b > 0.05).count();
        lit as f32 / picture.image.pixels.len() as f32
    };
    let before = window.shown();
    window.click("Fit");
    window.rest();
    assert!(window.shown() != before && drawn(&window) > 0.3, "{}", drawn(&window));
}

#[test]
fn a_frame_that_is_not_wanted_any_more_is_given_up() {
    let slow = Settings { size: Some([512, 512]), set: vec!["pass2.samples=4096".to_owned()], ..Settings::default() };
    let mut window = Window::start(source(project("SceneSSAO"), slow), false);
    window.until("the first frame", |app| app.state.activity == Activity::Rendering);
    std::thread::sleep(Duration::from_millis(300));
    let start = Instant::now();
    let (pass, name, value) = ("pass2".to_owned(), "samples".to_owned(), "1".to_owned());
    window.app().worker.send(Command::Parameter { pass, name, value });
    window.until("the other picture", |app| app.state.picture.is_some());
    assert!(start.elapsed() < Duration::from_secs(30), "{:?}", start.elapsed());
    let took = window.app().state.gave_up_after.expect("a frame was given up");
    println!("given up after {:.2} ms", took.as_secs_f64() * 1e3);
    assert!(took < Duration::from_secs(2), "{took:?}");
}

#[test]
fn a_pixel_tells_its_values_and_its_rays() {
    let mut window = Window::open(source(project("SceneFinal"), few()));
    window.harness.hover_at(egui::pos2(640.0, 400.0));
    window.harness.step();
    window.harness.key_press(egui::Key::P);
    window.until("its rays", |app| app.state.pixel.is_some());
    window.rest();
    let rays = window.app().state.pixel.clone().expect("its rays");
    let picture = window.app().state.picture.clone().expect("a picture");
    let value = picture.pixel(rays.pixel).expect("it is inside");
    assert_eq!(
        rays.values.last().map(|(pass, output, value)| (pass.as_str(), output.as_str(), *value)),
        Some(("pass5", "window", value))
    );
    assert!(rays.values.iter().any(|(_, output, _)| output.ends_with("::pos")));
    let traced = rays.lines.iter().filter(|line| line.contains(" ray")).count();
    assert!(!rays.segments.is_empty() && traced >= rays.segments.len(), "{:?}", rays.lines);
    window.click("Forget");
    assert_eq!(window.app().state.pixel, None);
}

#[test]
fn a_filter_has_a_slider_and_a_pixel_says_that_the_picture_has_an_average() {
    let mut window = Window::open(source(project("SceneSSAO"), few()));
    window.click("Refine at rest");
    window.harness.get_by_label("pass2 filter").set_value_accesskit(2.0);
    window.rest();
    let filtered = Settings { set: vec!["pass2.samples=4".to_owned(), "pass2.filter=2".to_owned()], ..settings() };
    let picture = window.app().state.picture.clone().expect("a picture");
    assert!(picture.image == rendered("SceneSSAO", filtered) && picture.image != rendered("SceneSSAO", few()));
    window.harness.hover_at(egui::pos2(640.0, 400.0));
    window.harness.step();
    window.harness.key_press(egui::Key::P);
    window.until("its rays", |app| app.state.pixel.is_some());
    let lines = window.app().state.pixel.clone().expect("its rays").lines.clone();
    assert!(lines.iter().any(|line| line.contains("filter=2") && line.contains("average")), "{lines:?}");
}

#[test]
fn two_pictures_are_compared_with_numbers() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("reference.exr");
    let mut renderer = curitiba::open(project("SceneSSAO"), few(), Choice::CPU, &mut Silent).expect("it opens");
    renderer.render_and_save(&file, &mut Silent).expect("written");
    let mut window = Window::open(source(project("SceneSSAO"), few()));
    window.harness.state_mut().compare_with(Some(Side::File(file.clone())));
    window.until("the numbers", |app| app.state.compared.is_some());
    window.rest();
    let expected = {
        let reference = curitiba::pipeline::image::read_image(&file).expect("a picture").image;
        let shown = window.app().state.picture.clone().expect("a picture");
        curitiba::pipeline::metrics::compare(&shown.image, &reference, &Default::default()).expect("comparable")
    };
    let compared = window.app().state.compared.clone().expect("numbers");
    assert_eq!((compared.rmse, compared.flip, compared.max), (expected.rmse, expected.flip, expected.max));
    assert!(expected.rmse > 0.0, "256 samples differ from 4");
    // The difference is 0 once the picture is that of the file again.
    window.harness.get_by_label("Refine at rest").click();
    window.rest();
    window.until("equal pictures", |app| app.state.compared.as_ref().is_some_and(|compared| compared.max == 0.0));
    for label in ["Wipe", "Flicker", "Difference"] {
        window.harness.get_by_label(label).click();
        window.harness.run_steps(3);
    }
    // A missing file is reported, and nothing is compared.
    window.harness.state_mut().compare_with(Some(Side::File(folder.path().join("absent.png"))));
    window
        .until("the error", |app| app.state.sides[1].missing.as_deref().is_some_and(|why| why.contains("absent.png")));
    assert!(window.app().state.compared.is_none());
}

#[test]
fn other_engines_take_over_and_what_is_not_there_changes_nothing() {
    let mut window = Window::open(source(project("SceneShadows"), settings()));
    let before = window.shown();
    let optix = Choice::CPU.traced_by(BackendChoice::Optix);
    window.app().worker.send(Command::Engines(optix));
    window.rest();
    if let Some(error) = window.app().state.error.clone() {
        assert!(error.contains("optix"), "{error}");
        assert!(window.shown() == before);
        assert_eq!(window.app().state.facts.clone().expect("it is open").rays[0], "cpu");
    } else {
        println!("skipped: OptiX is there");
    }
    window.app().worker.send(Command::Engines(Choice { raster: curitiba::RasterChoice::Auto, ..Choice::CPU }));
    window.rest();
    assert_eq!(window.app().state.error, None);
    assert_eq!(window.app().state.facts.clone().expect("it is open").choice.raster, curitiba::RasterChoice::Auto);
}

#[test]
fn a_pass_takes_a_ray_backend_of_its_own_and_one_that_is_not_there_changes_nothing() {
    let mut window = Window::open(source(project("SceneShadows"), settings()));
    let before = window.shown();
    let mut give = |backend: &str| {
        let [pass, name, value] = ["pass2", "backend", backend].map(str::to_owned);
        window.app().worker.send(Command::Parameter { pass, name, value });
        window.rest();
        let facts = window.pass("pass2");
        let shown = facts.parameters.iter().find(|parameter| parameter.info.name == "backend").expect("it is offered");
        (shown.value.clone(), window.app().state.error.clone(), window.shown())
    };
    let (value, error, shown) = give("cpu");
    assert!(value == "cpu" && error.is_none() && shown == before, "{value} {error:?}");
    let (value, error, shown) = give("optix");
    match error {
        Some(error) => {
            assert!(error.contains("pass2") && error.contains("optix") && value == "cpu" && shown == before, "{error}");
        }
        None => println!("skipped: OptiX is there"),
    }
    assert!(window.pass("pass1").parameters.is_empty(), "a raster pass has none");
}

#[test]
fn a_saved_picture_says_how_to_render_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut window = Window::open(source(project("SceneSSAO"), few()));
    window.app().worker.send(Command::Save(folder.path().join("shot")));
    window.until("the files", |app| app.state.told.as_deref().is_some_and(|told| told.contains("shot.json")));
    assert!(png(&folder.path().join("shot.png")) == window.shown().1);
    let text = std::fs::read_to_string(folder.path().join("shot.json")).expect("JSON");
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(json["accumulated"], 256);
    let command = json["command"].as_str().expect("a command");
    assert!(command.contains("SceneSSAO.xml") && command.contains("--accumulate 256"), "{command}");
}

#[test]
fn nothing_is_drawn_or_done_while_nothing_changes() {
    let woken = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(0));
    let count = std::sync::Arc::clone(&woken);
    let watched = curitiba_view::worker::Source { watch: true, ..source(project("SceneShadows"), settings()) };
    let worker = curitiba_view::worker::Worker::start(watched, move || {
        count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    });
    let worker = worker.expect("a thread");
    let start = Instant::now();
    while worker.state().activity != Activity::Resting {
        assert!(start.elapsed() < Duration::from_secs(60), "{:?}", worker.state().error);
        std::thread::sleep(Duration::from_millis(10));
    }
    let before = woken.load(std::sync::atomic::Ordering::Relaxed);
    assert!(before > 0, "control: pictures wake the window");
    std::thread::sleep(Duration::from_millis(1300));
    assert_eq!(woken.load(std::sync::atomic::Ordering::Relaxed), before);
    // The window does not ask to be drawn again by itself either.
    let mut window = Window::open(source(project("SceneShadows"), settings()));
    window.until("which engines there are", curitiba_view::app::App::knows_engines);
    std::thread::sleep(Duration::from_millis(100));
    window.harness.run_steps(3);
    assert!(!window.harness.ctx.has_requested_repaint());
    let mut times: Vec<f32> = (0..50)
        .map(|_| {
            window.harness.step();
            window.app().drawing_ms
        })
        .collect();
    times.sort_by(f32::total_cmp);
    println!("laying out the window takes {:.2} ms (median of {})", times[25], times.len());
}

#[test]
fn what_no_pass_reads_is_written_only_while_it_is_looked_at() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut window = Window::open(source(project("SceneShadows"), settings()));
    let show = |window: &Window| window.app().state.facts.clone().expect("it is open").settings.show.clone();
    assert!(show(&window).is_empty());
    let mut renderer = {
        let show = Settings { show: vec!["norm".to_owned()], ..settings() };
        curitiba::open(project("SceneShadows"), show, Choice::CPU, &mut Silent).expect("it opens")
    };
    renderer.render_and_save(&folder.path().join("out.png"), &mut Silent).expect("written");
    window.harness.get_by_label("norm").hover();
    window.rest();
    let (name, bytes) = window.shown();
    assert!(name.ends_with("::norm") && bytes == png(&folder.path().join("out.norm.png")), "{name}");
    window.harness.hover_at(egui::pos2(640.0, 400.0));
    window.rest();
    window.app().worker.send(Command::Camera(Some("Vidro".to_owned())));
    window.rest();
    assert!(show(&window).is_empty());
    let moved = Settings { camera: Some("Vidro".to_owned()), ..settings() };
    let picture = window.app().state.picture.clone().expect("a picture");
    assert!(picture.image == rendered("SceneShadows", moved), "another camera");
}

#[test]
fn the_line_of_a_wipe_follows_the_pointer_and_the_camera_stays() {
    let mut window = Window::open(source(project("SceneShadows"), settings()));
    window.harness.key_press(egui::Key::K);
    window.until("what was kept", |app| app.state.sides[1].picture.is_some());
    window.rest();
    let pose = window.app().state.facts.clone().expect("it is open").pose;
    let area = window.harness.get_by_label("picture of result").rect();
    let rect = window.app().canvas.rect(area, [96, 64]);
    window.harness.drag_at(rect.center());
    window.harness.step();
    for share in [0.6, 0.7, 0.75] {
        window.harness.hover_at(egui::pos2(rect.left() + share * rect.width(), rect.center().y + 20.0));
        window.harness.step();
    }
    window.harness.drop_at(egui::pos2(rect.left() + 0.75 * rect.width(), rect.center().y));
    window.rest();
    assert!((window.app().wipe - 0.75).abs() < 0.01, "{}", window.app().wipe);
    assert_eq!(window.app().state.facts.clone().expect("it is open").pose, pose);
}
