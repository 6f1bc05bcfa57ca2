//! `curitiba-view`: the window. Exit codes: 0 if it was closed; 1 if it cannot be opened, an option cannot be applied or, with `--quit-after`,
//! the picture cannot be rendered or the window's picture cannot be written; 2 if the command line is wrong.
#![forbid(unsafe_code)]

use clap::Parser as _;
use curitiba::pipeline::files;
use curitiba::pipeline::image::{Image, write_png};
use curitiba_view::app::App;
use curitiba_view::args::ViewArgs;
use curitiba_view::worker::{Source, Worker};
use eframe::{NativeOptions, Renderer};
use egui::{ViewportBuilder, ViewportCommand, vec2};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// The window, with the condition under which it closes by itself.
struct Window {
    app: App,
    quit_after: Option<u32>,
    window_png: Option<PathBuf>,
    asked: bool,
    failed: Arc<AtomicBool>,
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        curitiba_view::draw(&mut self.app, ui);
        let Some(frames) = self.quit_after else { return };
        let context = ui.ctx();
        context.request_repaint();
        let never = self.app.state.activity == curitiba_view::worker::Activity::Failed;
        if never {
            let error = self.app.state.error.as_deref().unwrap_or("there is no picture");
            if !self.failed.swap(true, Ordering::Relaxed) {
                eprintln!("error: {}", error.strip_prefix("error: ").unwrap_or(error));
            }
            context.send_viewport_cmd(ViewportCommand::Close);
        } else if self.app.drawn >= frames {
            self.close(context);
        }
    }
}

impl Window {
    /// Closes the window, after its screenshot is written if that was asked for.
    fn close(&mut self, context: &egui::Context) {
        let Some(path) = self.window_png.clone() else { return context.send_viewport_cmd(ViewportCommand::Close) };
        if std::mem::replace(&mut self.asked, true) {
            return;
        }
        let (failed, closing) = (Arc::clone(&self.failed), context.clone());
        context.request_screenshot(move |picture| {
            let pixels =
                picture.pixels.iter().map(|color| color.to_array().map(|byte| f32::from(byte) / 255.0)).collect();
            let [width, height] = picture.size.map(|side| side as u32);
            if let Err(error) = write_png(&path, &Image { width, height, pixels }) {
                eprintln!("error: {}: {error}", path.display());
                failed.store(true, Ordering::Relaxed);
            }
            closing.send_viewport_cmd(ViewportCommand::Close);
        });
    }
}

fn main() -> ExitCode {
    let args = ViewArgs::parse();
    match run(args) {
        Ok(code) => code,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: ViewArgs) -> Result<ExitCode, String> {
    if args.project.aa.are_several() {
        let samples = args.project.aa;
        eprintln!(
            "error: --aa {samples}: the window shows one sample of every pixel; leave it out, and write pictures with `curitiba render`"
        );
        return Ok(ExitCode::from(2));
    }
    if let Some(folder) = &args.confine {
        files::confine(folder).map_err(|error| format!("--confine {}: {error}", folder.display()))?;
    }
    curitiba::threads::start(args.project.threads)?;
    // Files that are read from here on are recorded, and watched for changes.
    files::record_files_read();
    let source = Source {
        path: args.project.path.clone(),
        settings: args.project.settings(),
        choice: args.project.choice(),
        watch: true,
    };
    let title = format!("{} – curitiba", source.path.display());
    // The renderer's thread starts before the window: it reads and renders while the window and its device are created.
    let awake: Arc<OnceLock<egui::Context>> = Arc::default();
    let wakes = Arc::clone(&awake);
    let wake = move || wakes.get().into_iter().for_each(egui::Context::request_repaint);
    let worker = Worker::start(source, wake).map_err(|error| format!("no thread can be started: {error}"))?;
    let worker = Arc::new(Mutex::new(Some(worker)));
    let take = move || worker.lock().unwrap_or_else(PoisonError::into_inner).take();
    let viewport = ViewportBuilder::default()
        .with_title(title)
        .with_app_id("curitiba-view")
        .with_inner_size(vec2(1280.0, 800.0))
        .with_min_inner_size(vec2(760.0, 480.0));
    let options = NativeOptions { viewport, renderer: Renderer::Wgpu, ..NativeOptions::default() };
    let (failed, taken) = (Arc::new(AtomicBool::new(false)), take.clone());
    let told = Arc::clone(&failed);
    let ViewArgs { reference, quit_after, window_png, .. } = args;
    eframe::run_native(
        "curitiba-view",
        options,
        Box::new(move |context| {
            let worker = taken().ok_or("the renderer is gone")?;
            // The first frame of the window shows whatever the thread reported before this.
            let _ = awake.set(context.egui_ctx.clone());
            let app = App::new(&context.egui_ctx, context.wgpu_render_state.as_ref(), worker, reference);
            Ok(Box::new(Window { app, quit_after, window_png, asked: false, failed: told }))
        }),
    )
    .map_err(|error| {
        // The thread may still be reading files; forgetting the worker avoids waiting for it.
        std::mem::forget(take());
        format!(
            "no window can be opened: {error}\n       `curitiba render` needs no window; over ssh, `ssh -X` lends one"
        )
    })?;
    Ok(if failed.load(Ordering::Relaxed) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}
