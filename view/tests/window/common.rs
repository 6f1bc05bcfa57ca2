//! A window without a screen: it is laid out, and drawn only if a test asks for a device. Its elements are found by their labels.

use curitiba::Choice;
use curitiba::pipeline::plan::Settings;
use curitiba_view::app::App;
use curitiba_view::worker::{Activity, PassFacts, Picture, Source, Worker};
use eframe::egui_wgpu::{RenderState, RendererOptions};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use egui_kittest::wgpu::{WgpuTestRenderer, create_render_state, default_wgpu_setup};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest time that a test waits for anything.
const PATIENCE: Duration = Duration::from_secs(60);

pub fn project(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../xml_projects").join(format!("{name}.xml"))
}

pub fn settings() -> Settings {
    Settings { size: Some([96, 64]), ..Settings::default() }
}

pub fn source(path: PathBuf, settings: Settings) -> Source {
    Source { path, settings, choice: Choice::CPU, watch: false }
}

/// Whether the window can be drawn. Without a device it prints the reason, or fails if the tests are required.
pub fn can_draw() -> bool {
    let there = !curitiba::passes::raster::gpu::adapters().is_empty();
    if !there {
        let required = std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_some_and(|value| value == "1");
        assert!(!required, "no device was found by wgpu");
        println!("skipped: no device was found by wgpu");
    }
    there
}

pub struct Window {
    pub harness: Harness<'static, App>,
    /// What draws the window; `None` if it is only laid out.
    pub device: Option<RenderState>,
}

impl Window {
    /// Opens a project and waits until nothing is left to do. The window is laid out, but not drawn.
    pub fn open(source: Source) -> Self {
        let mut window = Self::start(source, false);
        window.rest();
        window
    }

    /// As [`Self::open`], for a window that is also drawn.
    pub fn drawn(source: Source) -> Self {
        let mut window = Self::start(source, true);
        window.rest();
        window
    }

    pub fn start(source: Source, draws: bool) -> Self {
        let device = draws.then(|| create_render_state(default_wgpu_setup(), RendererOptions::PREDICTABLE));
        Self::on(source, device)
    }

    /// As [`Self::start`], for a window that this device draws.
    pub fn on(source: Source, device: Option<RenderState>) -> Self {
        let builder = Harness::builder().with_size(egui::vec2(1280.0, 800.0)).with_max_steps(64);
        let builder = match &device {
            Some(device) => builder.renderer(WgpuTestRenderer::from_render_state(device.clone())),
            None => builder,
        };
        // The worker wakes nothing: the tests draw until the awaited state is reached.
        let worker = Worker::start(source, || {}).expect("a thread");
        let app = App::new(&egui::Context::default(), device.as_ref(), worker, None);
        let harness = builder.build_ui_state(|ui, app: &mut App| curitiba_view::draw(app, ui), app);
        curitiba_view::theme::style(&harness.ctx);
        Self { harness, device }
    }

    pub fn app(&self) -> &App {
        self.harness.state()
    }

    /// Draws until a condition holds.
    #[track_caller]
    pub fn until(&mut self, what: &str, holds: impl Fn(&App) -> bool) {
        let start = Instant::now();
        loop {
            self.harness.step();
            if holds(self.app()) {
                return;
            }
            let state = &self.app().state;
            assert!(start.elapsed() < PATIENCE, "waited for {what}: {:?}, {:?}", state.activity, state.error);
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Draws until nothing is left to do.
    #[track_caller]
    pub fn rest(&mut self) {
        // The first step handles the mouse, and the second the requests that followed from it.
        for _ in 0..3 {
            self.harness.step();
        }
        self.until("rest", |app| {
            let all = app.worker.sent() == app.state.taken;
            all && matches!(app.state.activity, Activity::Resting | Activity::Failed | Activity::Paused)
        });
    }

    pub fn pass(&self, name: &str) -> PassFacts {
        let facts = self.app().state.facts.clone().expect("it is open");
        facts.passes.iter().find(|pass| pass.name == name).unwrap_or_else(|| panic!("no pass `{name}`")).clone()
    }

    /// Clicks the element with this label, and moves the pointer to the picture: over a row, the window would show that row's output.
    pub fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.harness.step();
        self.harness.hover_at(egui::pos2(640.0, 400.0));
        self.rest();
    }

    /// The name and the bytes of the shown picture.
    pub fn shown(&self) -> (String, Vec<[u8; 4]>) {
        let picture = self.app().state.picture.clone().expect("there is a picture");
        (picture.name.clone(), bytes(&picture))
    }
}

/// The bytes of a shown picture.
pub fn bytes(picture: &Picture) -> Vec<[u8; 4]> {
    picture.shown.pixels.iter().map(egui::Color32::to_array).collect()
}

/// The bytes of a PNG file that this program wrote.
pub fn png(path: &Path) -> Vec<[u8; 4]> {
    let read = curitiba::pipeline::image::read_image(path).expect("a picture");
    assert_eq!(read.steps, Some(255));
    let byte = |value: f32| (value * 255.0).round() as u8;
    read.image.pixels.iter().map(|[r, g, b, _]| [byte(*r), byte(*g), byte(*b), 255]).collect()
}
