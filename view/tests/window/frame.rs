//! The times of a window's frame besides the passes: layout, tessellation, copies to the device, and drawing.

use curitiba_view::app::App;
use curitiba_view::worker::{Activity, Worker};
use eframe::egui_wgpu::{RenderState, RendererOptions, ScreenDescriptor};
use egui::{Context, Event, Pos2, RawInput, Rect, pos2, vec2};
use egui_kittest::wgpu::{create_render_state, default_wgpu_setup};
use std::time::{Duration, Instant};
use wgpu::{PollType, SubmissionIndex};

/// Size of the window, in points and in pixels.
const SIZE: [u32; 2] = [1280, 800];

/// Host times of a frame in milliseconds; each time ends when the device has finished the step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Frame {
    /// Layout, by the program and egui.
    pub layout: f64,
    /// Shapes are turned into triangles.
    pub tessellation: f64,
    /// Copies of pictures, and of letters that are new.
    pub textures: f64,
    /// Number of bytes in these copies.
    pub bytes: u64,
    /// Copies of triangles.
    pub buffers: f64,
    /// Triangles are drawn.
    pub draw: f64,
}

impl Frame {
    pub fn total(&self) -> f64 {
        self.layout + self.tessellation + self.textures + self.buffers + self.draw
    }
}

fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let value = work();
    (start.elapsed().as_secs_f64() * 1e3, value)
}

/// A window without a screen, whose frames are timed step by step.
pub struct TimedWindow {
    pub app: App,
    context: Context,
    device: RenderState,
    target: wgpu::TextureView,
    frames: u32,
}

impl TimedWindow {
    /// Uses the device that egui's tests use: a software one, if available.
    pub fn new(worker: Worker) -> Self {
        let (context, device) =
            (Context::default(), create_render_state(default_wgpu_setup(), RendererOptions::default()));
        let texture = device.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("window"),
            size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: device.target_format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        });
        let target = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Self { app: App::new(&context, Some(&device), worker, None), context, device, target, frames: 0 }
    }

    /// The driver's name for the device that draws.
    pub fn device(&self) -> String {
        self.device.adapter.get_info().name
    }

    fn wait(&self, until: Option<SubmissionIndex>) {
        let wait = PollType::Wait { submission_index: until, timeout: Some(Duration::from_secs(10)) };
        self.device.device.poll(wait).expect("the device works");
    }

    /// Draws a frame, with the pointer moving over the picture.
    pub fn frame(&mut self) -> Frame {
        self.frames += 1;
        let at = pos2(600.0 + (self.frames % 32) as f32, 400.0);
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(SIZE[0] as f32, SIZE[1] as f32))),
            time: Some(f64::from(self.frames) / 60.0),
            max_texture_side: Some(self.device.device.limits().max_texture_dimension_2d as usize),
            events: vec![Event::PointerMoved(at)],
            ..RawInput::default()
        };
        let app = &mut self.app;
        let (layout, mut output) = timed(|| self.context.run_ui(input, |ui| curitiba_view::draw(app, ui)));
        let screen = ScreenDescriptor { size_in_pixels: SIZE, pixels_per_point: output.pixels_per_point };
        let (tessellation, triangles) =
            timed(|| self.context.tessellate(std::mem::take(&mut output.shapes), output.pixels_per_point));
        let (device, queue) = (&self.device.device, &self.device.queue);
        let mut bytes = 0;
        let (textures, ()) = timed(|| {
            let mut renderer = self.device.renderer.write();
            for (id, images) in output.textures_delta.set.drain() {
                for image in images {
                    bytes += 4 * (image.image.width() * image.image.height()) as u64;
                    renderer.update_texture(device, queue, id, &image);
                }
            }
            for id in output.textures_delta.free.drain() {
                renderer.free_texture(&id);
            }
            self.wait(Some(queue.submit([])));
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let (buffers, commands) = timed(|| {
            let mut renderer = self.device.renderer.write();
            let commands = renderer.update_buffers(device, queue, &mut encoder, &triangles, &screen);
            self.wait(Some(queue.submit([])));
            commands
        });
        let (draw, ()) = timed(|| {
            let attachment = wgpu::RenderPassColorAttachment {
                view: &self.target,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
                depth_slice: None,
            };
            let pass = wgpu::RenderPassDescriptor { color_attachments: &[Some(attachment)], ..Default::default() };
            let mut pass = encoder.begin_render_pass(&pass).forget_lifetime();
            self.device.renderer.read().render(&mut pass, &triangles, &screen);
            drop(pass);
            self.wait(Some(queue.submit(commands.into_iter().chain([encoder.finish()]))));
        });
        Frame { layout, tessellation, textures, bytes, buffers, draw }
    }

    /// Draws until nothing is left to do.
    pub fn rest(&mut self) {
        let start = Instant::now();
        loop {
            self.frame();
            let state = &self.app.state;
            if self.app.worker.sent() == state.taken && state.activity == Activity::Resting && self.app.knows_engines()
            {
                return;
            }
            assert!(start.elapsed() < Duration::from_secs(120), "{:?}", state.error);
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
