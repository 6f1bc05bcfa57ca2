//! The times and the processor load of the window, for the targets of `docs/viewer.md`. Run on an idle machine in release mode, with
//! `cargo test --release … --test window -- --ignored --nocapture --test-threads 1`. `CURITIBA_ENGINES=wgpu,cuda` measures with that
//! rasteriser and that ray backend; without it both run on the processor.

use super::common::{can_draw, project, source};
use super::frame::{Frame, TimedWindow};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::SceneOptions;
use curitiba::{BackendChoice, Choice, RasterChoice};
use curitiba_view::camera;
use curitiba_view::worker::{Activity, Command, Facts, Side, Source, State, What, Worker};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Processor time of this process in seconds, at a resolution of clock ticks of 10 ms.
fn processor() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    [11, 12].iter().filter_map(|index| fields.get(*index)?.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[track_caller]
fn wait(worker: &Worker, what: &str, holds: impl Fn(&State) -> bool) -> State {
    let start = Instant::now();
    loop {
        let state = worker.state();
        if holds(&state) {
            return state;
        }
        assert!(start.elapsed() < Duration::from_secs(120), "waited for {what}: {:?}", state.error);
        std::thread::sleep(Duration::from_micros(200));
    }
}

/// The engines that are measured.
fn engines() -> Choice {
    let Ok(names) = std::env::var("CURITIBA_ENGINES") else { return Choice::CPU };
    let (raster, backend) = names.split_once(',').expect("CURITIBA_ENGINES is RASTERISER,BACKEND");
    let raster = RasterChoice::NAMES.into_iter().find(|(name, _)| *name == raster).expect("a rasteriser").1;
    let backend = BackendChoice::NAMES.into_iter().find(|(name, _)| *name == backend).expect("a ray backend").1;
    Choice { raster, backend, ..Choice::CPU }
}

fn large(set: &[&str], effects: Option<&str>) -> Settings {
    let set = set.iter().map(|set| (*set).to_owned()).collect();
    let effects = effects.map(|effects| effects.parse().expect("effects"));
    let scene = SceneOptions { effects, ..SceneOptions::default() };
    Settings { size: Some([1024, 1024]), set, scene, ..Settings::default() }
}

/// The moves of a camera that orbits its scene from where it is, by their number.
fn orbit(facts: &Facts) -> impl Fn(usize) -> Command + use<> {
    let (start, bounds) = (facts.pose.expect("a camera"), facts.bounds.expect("a scene"));
    let pivot = camera::pivot(&start, &bounds);
    move |turn| Command::Move(camera::orbit(&start, pivot, turn as f32 * 1e-3, 0.0))
}

#[test]
#[ignore = "measures"]
fn frames_a_second_while_the_camera_is_dragged() {
    let square = project("SceneFinal").with_file_name("3dsmodels").join("largoCamoes.cbo");
    let inputs: [(&str, PathBuf, Settings); 2] = [
        ("shadows and occlusion", square, large(&[], Some("shadows,ao"))),
        ("SceneFinal", project("SceneFinal"), large(&[], None)),
    ];
    for (name, path, settings) in inputs {
        let worker =
            Worker::start(Source { path, settings, choice: engines(), watch: false }, || {}).expect("a thread");
        let state = wait(&worker, "a picture", |state| state.picture.is_some());
        let orbit = orbit(&state.facts.expect("it is open"));
        let (mut seconds, mut processors, mut passes) = (Vec::new(), Vec::new(), Vec::new());
        let mut moved = 0;
        // As a mouse does: a move every 8 ms, whether or not a picture is ready. The first frames choose the number of samples.
        for run in 0..6 {
            let (began, before, used) = (Instant::now(), worker.state().frames, processor());
            while began.elapsed() < Duration::from_secs(3) {
                moved += 1;
                worker.send(orbit(moved));
                std::thread::sleep(Duration::from_millis(8));
            }
            let state = worker.state();
            let frames = (state.frames - before) as f64;
            if run > 0 {
                seconds.push(frames / began.elapsed().as_secs_f64());
                processors.push((processor() - used) * 1e3 / frames);
                passes.push(state.facts.expect("it is open").frame_ms());
            }
        }
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        println!(
            "{name}, {}: {:.1} frames/s, {:.1} ms of processor time a frame, passes {:.1} ms (medians of 5 times 3 s), {} threads, load {}",
            std::env::var("CURITIBA_ENGINES").unwrap_or_else(|_| "cpu,cpu".to_owned()),
            median(seconds),
            median(processors),
            median(passes),
            std::thread::available_parallelism().map_or(0, usize::from),
            load.trim()
        );
    }
}

#[test]
#[ignore = "measures"]
fn time_until_a_long_frame_is_given_up() {
    let settings = large(&["pass2.samples=4096", "pass2.radius=2"], None);
    let worker = Worker::start(source(project("SceneSSAO"), settings), || {}).expect("a thread");
    let mut times = Vec::new();
    for turn in 0..21 {
        wait(&worker, "a long frame", |state| state.activity == Activity::Rendering);
        // The reload falls somewhere in the ray pass.
        std::thread::sleep(Duration::from_millis(400 + 37 * turn));
        let last = worker.state().gave_up_after;
        worker.send(Command::Reload);
        let state = wait(&worker, "its end", |state| state.gave_up_after != last);
        times.push(state.gave_up_after.expect("it was given up").as_secs_f64() * 1e3);
    }
    let most = times.iter().copied().fold(0.0, f64::max);
    let threads = std::thread::available_parallelism().map_or(0, usize::from);
    let (middle, count) = (median(times.clone()), times.len());
    println!("given up after {middle:.2} ms (median of {count}; at most {most:.2}), {threads} threads");
}

/// Prints the medians of the parts of the window's frames, and the median of the whole frames.
fn print_parts(what: &str, frames: &[Frame]) {
    let of = |part: fn(&Frame) -> f64| median(frames.iter().map(part).collect());
    println!(
        "{what}: layout {:.2} ms, tessellation {:.2} ms, textures {:.2} ms ({:.1} MB), buffers {:.2} ms, drawing {:.2} ms; \
         whole {:.2} ms (medians of {})",
        of(|frame| frame.layout),
        of(|frame| frame.tessellation),
        of(|frame| frame.textures),
        of(|frame| frame.bytes as f64) / 1e6,
        of(|frame| frame.buffers),
        of(|frame| frame.draw),
        of(Frame::total),
        frames.len()
    );
}

#[test]
#[ignore = "measures"]
fn time_of_the_window_beside_the_passes() {
    /// Number of frames of each kind: a software device takes tenths of a second for one.
    const FRAMES: usize = 60;
    if !can_draw() {
        return;
    }
    let source = Source { choice: engines(), ..source(project("SceneFinal"), large(&["pass2.samples=4"], None)) };
    let mut window = TimedWindow::new(Worker::start(source, || {}).expect("a thread"));
    window.app.refine = false;
    window.app.worker.send(Command::Refine(false));
    window.rest();
    let threads = std::thread::available_parallelism().map_or(0, usize::from);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("drawn by {}, {threads} threads, load {}", window.device(), load.trim());
    let same: Vec<Frame> = (0..FRAMES).map(|_| window.frame()).collect();
    print_parts("the same picture", &same);
    let pictures: Vec<String> = ["pos", "norm"].map(|name| format!("Deferred Render Targets::{name}")).to_vec();
    let mut others = Vec::new();
    for turn in 0..FRAMES {
        let name = &pictures[turn % 2];
        let shown = |state: &State| state.picture.as_ref().is_some_and(|picture| picture.name == *name);
        // As if its row were clicked.
        window.app.pinned = Some(Some(name.clone()));
        window.frame();
        wait(&window.app.worker, name, shown);
        others.push(window.frame());
    }
    print_parts("another picture of 1024 x 1024 pixels", &others[FRAMES / 4..]);
    // Pictures come while the window lays out a frame.
    let orbit = orbit(window.app.state.facts.as_ref().expect("it is open"));
    let mut dragged = Vec::new();
    for turn in 0..FRAMES {
        window.app.worker.send(orbit(turn));
        dragged.push(window.frame());
    }
    print_parts("while the camera is dragged", &dragged[FRAMES / 4..]);
    window.rest();
    let side = Side::here(What::Result);
    window.app.compare_with(Some(side));
    window.rest();
    let wiped: Vec<Frame> = (0..FRAMES).map(|_| window.frame()).collect();
    print_parts("a wipe of two pictures", &wiped);
}
