//! The two sides of a comparison, each chosen from the same list.

use super::common::{Window, can_draw, project, settings, source};
use curitiba::pipeline::executor::{Silent, StepKind};
use curitiba::pipeline::metrics;
use curitiba::pipeline::plan::Settings;
use curitiba::{BackendChoice, Choice, RasterChoice};
use curitiba_view::worker::{Activity, Command, On, Side, What};
use egui_kittest::kittest::Queryable as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const NORM: &str = "Deferred Render Targets::norm";

/// A window that shows the project with its own number of samples.
fn unrefined(name: &str, settings: Settings) -> Window {
    let mut window = Window::open(source(project(name), settings));
    window.harness.state_mut().refine = false;
    window.app().worker.send(Command::Refine(false));
    window.rest();
    window
}

fn written(name: &str, settings: Settings, folder: &Path) -> PathBuf {
    let file = folder.join(format!("{name}.exr"));
    let mut renderer = curitiba::open(project(name), settings, Choice::CPU, &mut Silent).expect("it opens");
    renderer.render_and_save(&file, &mut Silent).expect("written");
    file
}

/// Chooses an entry of a list.
fn choose(window: &mut Window, list: &str, entry: &str) {
    window.harness.get_by_label(list).click();
    window.harness.run_steps(3);
    window.harness.get_by_label(entry).click();
    window.harness.run_steps(3);
    window.harness.hover_at(egui::pos2(640.0, 400.0));
    window.rest();
}

#[test]
fn both_sides_are_chosen_from_one_list_and_the_numbers_name_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = written("SceneNoEffects", settings(), folder.path());
    let mut window = unrefined("SceneShadows", settings());
    window.harness.state_mut().compare_with(Some(Side::File(file.clone())));
    window.rest();
    let read = |path: &Path| curitiba::pipeline::image::read_image(path).expect("a picture").image;
    let rmse = |a: &curitiba::pipeline::image::Image, b: &curitiba::pipeline::image::Image| {
        metrics::compare(a, b, &metrics::Options::default()).expect("comparable").rmse
    };
    let compared = window.app().state.compared.clone().expect("numbers");
    assert_eq!(compared.names, ["result", "SceneNoEffects.exr"]);
    // Both sides are chosen from their lists. Then a file is compared with an output, whatever output is shown.
    choose(&mut window, "right side", NORM);
    // The list shows the channel alone, and a tooltip the whole name.
    let names = |window: &Window| window.harness.query_all_by_label(NORM).count();
    let before = names(&window);
    window.harness.get_by_label("right side").hover();
    window.harness.run_steps(8);
    assert_eq!(names(&window), before + 1);
    choose(&mut window, "left side", "result");
    window.harness.state_mut().compare(Side::File(file.clone()), Some(Side::here(What::Output(NORM.to_owned()))));
    window.rest();
    let compared = window.app().state.compared.clone().expect("numbers");
    assert_eq!(compared.names, ["SceneNoEffects.exr", NORM]);
    window.harness.get_by_label(&format!("SceneNoEffects.exr against {NORM}"));
    let norm = window.app().state.sides[1].picture.clone().expect("it is there");
    assert_eq!(compared.rmse, rmse(&read(&file), &norm.image));
    window.harness.get_by_label("picture of SceneNoEffects.exr");
    // Looking at another output changes nothing here, and swapping exchanges the sides.
    window.harness.get_by_label("color").hover();
    window.rest();
    assert_eq!(window.app().state.compared.clone().expect("numbers").names, compared.names);
    window.click("Swap");
    let swapped = window.app().state.compared.clone().expect("numbers");
    assert_eq!(swapped.names, [NORM, "SceneNoEffects.exr"]);
    assert_eq!(swapped.rmse, compared.rmse);
    choose(&mut window, "right side", "nothing");
    assert!(window.app().right.is_none() && window.app().state.compared.is_none());
}

#[test]
fn pictures_of_other_sizes_and_engines_that_are_not_there_say_why() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = written("SceneShadows", Settings { size: Some([32, 32]), ..settings() }, folder.path());
    let mut window = unrefined("SceneShadows", settings());
    window.harness.state_mut().compare_with(Some(Side::File(file)));
    window.rest();
    let why = window.app().state.incomparable.clone().expect("it is said");
    assert!(why.contains("`result` is 96 x 64") && why.contains("`SceneShadows.exr` is 32 x 32"), "{why}");
    window.harness.get_by_label(&why);
    window.harness.get_by_label("picture of result");
    assert!(window.app().state.compared.is_none() && window.app().compared().is_none());
    let optix = Side::Rendered { what: What::Result, on: On::Rays(BackendChoice::Optix) };
    window.harness.state_mut().compare_with(Some(optix));
    window.until("an answer", |app| app.state.sides[1].missing.is_some() || app.state.sides[1].picture.is_some());
    match window.app().state.sides[1].missing.clone() {
        Some(why) => {
            assert!(why.contains("optix"), "{why}");
            window.harness.step();
            window.harness.get_by_label(&why);
        }
        None => println!("skipped: OptiX is there"),
    }
}

#[test]
fn an_output_on_other_engines_is_that_of_a_renderer_with_them_and_has_its_time() {
    let set = vec!["pass2.samples=4".to_owned()];
    let mut window = unrefined("SceneSSAO", Settings { set: set.clone(), ..settings() });
    let choices = if can_draw() { vec![RasterChoice::Cpu, RasterChoice::Wgpu] } else { vec![RasterChoice::Cpu] };
    for raster in choices {
        let (what, on) = (What::Output(NORM.to_owned()), On::Raster(raster));
        window.harness.state_mut().compare(Side::here(what.clone()), Some(Side::Rendered { what, on }));
        window.rest();
        let [left, right] = window.app().compared().expect("both are there");
        let show = Settings { set: set.clone(), show: vec![NORM.to_owned()], ..settings() };
        let choice = Choice { raster, ..Choice::CPU };
        let mut renderer = curitiba::open(project("SceneSSAO"), show, choice, &mut Silent).expect("it opens");
        renderer.frame(&mut Silent).expect("it renders");
        let channel = renderer.plan().channel_named(NORM).expect("it is written");
        assert!(right.image.pixels == renderer.channel(channel), "{}", right.name);
        assert_eq!(right.name, format!("{NORM} on raster {}", raster.name()));
        let compared = window.app().state.compared.clone().expect("numbers");
        assert_eq!(compared.names, [left.name.clone(), right.name.clone()]);
        assert_eq!(compared.max == 0.0, raster == RasterChoice::Cpu, "control: another rasteriser differs");
        let [here, there] = window.app().state.sides.each_ref().map(|side| side.times.clone().expect("its time"));
        for times in [here, there] {
            let raster = times.of(StepKind::Raster).expect("it draws");
            assert!(raster > 0.0 && times.total() > raster, "{times:?}");
        }
        // A change of the project affects both sides.
        let [pass, name] = ["pass2", "radius"].map(str::to_owned);
        window.app().worker.send(Command::Camera(Some("Vidro".to_owned())));
        window.app().worker.send(Command::Parameter { pass, name, value: "2".to_owned() });
        window.rest();
        let [_, moved] = window.app().compared().expect("both are there");
        assert!(moved.image != right.image, "it is rendered again");
        window.app().worker.send(Command::Camera(None));
        window.rest();
    }
}

#[test]
fn other_engines_take_as_many_samples_as_are_shown() {
    let few = Settings { set: vec!["pass2.samples=4".to_owned()], ..settings() };
    let mut window = Window::open(source(project("SceneSSAO"), few));
    let side = Side::Rendered { what: What::Shown, on: On::Rays(BackendChoice::Cpu) };
    window.harness.state_mut().compare_with(Some(side));
    window.rest();
    let compared = window.app().state.compared.clone().expect("numbers");
    assert_eq!(compared.names, ["result", "result on rays cpu, 256 samples"]);
    assert_eq!(compared.max, 0.0);
    // The output that is shown is compared, on both sides.
    window.harness.get_by_label("norm").click();
    window.harness.step();
    window.harness.hover_at(egui::pos2(640.0, 400.0));
    window.rest();
    let compared = window.app().state.compared.clone().expect("numbers");
    assert_eq!(compared.names[0], NORM);
    assert!(compared.names[1].starts_with(&format!("{NORM} on rays cpu")) && compared.max == 0.0, "{compared:?}");
}

#[test]
fn the_reference_is_that_of_the_camera_as_it_stands_and_can_be_given_up() {
    let mut window = unrefined("SceneShadows", Settings { size: Some([48, 32]), ..settings() });
    let rmse = |window: &Window| window.app().state.compared.clone().expect("numbers").rmse;
    window.harness.state_mut().compare_with(Some(Side::Reference));
    window.rest();
    let names = window.app().state.compared.clone().expect("numbers").names.clone();
    assert!(names[1].starts_with("reference, 64 samples, standard error 0.0"), "{names:?}");
    let first = rmse(&window);
    assert!(first < 0.15, "{first}");
    // With the camera moved, the picture is another, and so is its reference.
    let facts = window.app().state.facts.clone().expect("it is open");
    let pose = facts.pose.expect("a camera");
    let before = window.app().compared().expect("both")[1].clone();
    window.app().worker.send(Command::Move(curitiba_view::camera::fly(&pose, glam::Vec3::new(3.0, 1.0, 5.0))));
    window.rest();
    let [left, after] = window.app().compared().expect("both");
    let options = metrics::Options::default();
    let old = metrics::compare(&left.image, &before.image, &options).expect("comparable").rmse;
    assert!(after.image != before.image && rmse(&window) < 0.7 * old, "{} {old}", rmse(&window));
    // A large reference is cancelled at once by another choice, and the window goes on meanwhile.
    let mut window = unrefined("SceneShadows", Settings { size: Some([1024, 1024]), ..settings() });
    window.harness.state_mut().compare_with(Some(Side::Reference));
    window.until("how far it is", |app| app.state.doing.as_ref().is_some_and(|doing| doing.what.contains("reference")));
    assert_eq!(window.app().state.activity, Activity::Comparing);
    window.harness.step();
    window.harness.get_by_label("Comparing…");
    let start = Instant::now();
    window.harness.state_mut().compare_with(None);
    window.rest();
    window.until("its end", |app| app.state.doing.is_none());
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
}

#[test]
fn what_has_no_reference_says_why() {
    let mut window = unrefined("raster/SceneShadowMap", Settings { size: Some([24, 16]), ..settings() });
    window.harness.state_mut().compare_with(Some(Side::Reference));
    window.rest();
    assert!(window.app().state.sides[1].picture.is_some(), "raster effects have that of their rays");
    let mut window = unrefined("glass/Caustics", Settings { size: Some([24, 16]), ..settings() });
    window.harness.state_mut().compare_with(Some(Side::Reference));
    window.rest();
    let why = window.app().state.sides[1].missing.clone().expect("light that spheres focus has none");
    assert!(why.contains("exact spheres"), "{why}");
}
