//! Rendering a picture part by part, and drawing targets beyond the rasteriser's limits in blocks.

use super::{Observer, Progress, RenderError, Renderer};
use crate::backend::{Attachments, BackendError, GBuffer, NO_TRIANGLE, RasterJob, Rasteriser, Rect, View};
use crate::image::{Colors, Image, Rows, count_non_finite};
use crate::memory::{self, Refused};
use glam::{DMat4, DVec4};
use std::io;
use std::time::{Duration, Instant};

/// The intersection of two rectangles; `None` if it is empty.
fn common(a: Rect, b: Rect) -> Option<Rect> {
    let (x, y) = (a.x.max(b.x), a.y.max(b.y));
    let (right, bottom) = ((a.x + a.width).min(b.x + b.width), (a.y + a.height).min(b.y + b.height));
    (x < right && y < bottom).then(|| Rect { x, y, width: right - x, height: bottom - y })
}

impl GBuffer {
    /// Makes the buffer hold another part of the picture. Its contents are undefined until they are drawn.
    fn place(&mut self, part: Rect) -> Result<(), Refused> {
        let pixels = part.width as usize * part.height as usize;
        for channel in [&mut self.color, &mut self.position, &mut self.normal] {
            if !channel.is_empty() {
                memory::resize(channel, pixels, [0.0; 4])?;
            }
        }
        if !self.triangle.is_empty() {
            memory::resize(&mut self.triangle, pixels, NO_TRIANGLE)?;
        }
        if !self.depth.is_empty() {
            memory::resize(&mut self.depth, pixels, 0.0)?;
        }
        (self.origin, self.width, self.height) = ([part.x, part.y], part.width, part.height);
        Ok(())
    }
}

impl Renderer {
    /// Begins a frame.
    pub(super) fn begin_frame(&mut self) {
        self.frame = self.frame.saturating_add(1);
        self.given_up = false;
        if let Some(displayed) = self.displayed.take() {
            self.room_for_codes = displayed.codes.pixels;
        }
        if self.runs_often() {
            self.timeline.begin_parts();
        }
    }

    /// Whether passes run more than once a frame: for parts of the picture, or for several samples a pixel.
    fn runs_often(&self) -> bool {
        self.plan.parts.list.len() > 1 || self.samples().are_several()
    }

    /// Ends a frame after its last part.
    pub(super) fn end_frame(&mut self) {
        if self.runs_often() {
            self.timeline.end_parts();
        }
    }

    /// Makes the targets hold a part of the picture.
    pub(super) fn place_targets(&mut self, part: usize) -> Result<(), Refused> {
        self.part = part;
        if self.plan.in_parts() {
            let rendered = self.plan.parts.list[part].rendered;
            self.targets.iter_mut().chain([&mut self.window]).try_for_each(|buffer| buffer.place(rendered))?;
        }
        Ok(())
    }

    /// A copy of a rectangle of the picture, from the window.
    pub(super) fn picture(&self, rectangle: Rect) -> Result<Image, Refused> {
        cut(self.window.held(), &self.window.color, rectangle)
    }

    /// Appends a rectangle of the picture, from the window, to `pixels`.
    pub(super) fn copy_rows(&self, rectangle: Rect, pixels: &mut Vec<[f32; 4]>) {
        append(self.window.held(), &self.window.color, rectangle, pixels);
    }

    /// Views and viewports with which a raster pass is drawn into a target: the given ones, or one pair for each block if the
    /// rasteriser cannot draw the target at once.
    pub(super) fn blocks(&self, view: View, viewport: Rect, target: &GBuffer) -> Vec<(View, Rect)> {
        let Some(side) = self.plan.block else { return vec![(view, viewport)] };
        let held = target.held();
        let starts = |length: u32| (0..length).step_by(side as usize);
        let all = starts(viewport.height).flat_map(|y| starts(viewport.width).map(move |x| (x, y)));
        let block = |(x, y)| Rect { x, y, width: side.min(viewport.width - x), height: side.min(viewport.height - y) };
        let seen = all.map(block).filter(|block| common(*block, held).is_some());
        seen.map(|block| (view_of_block(view, viewport, block), block)).collect()
    }

    /// Renders a frame for an encoder that requests its rows.
    pub(super) fn rows<'a>(&'a mut self, observer: &'a mut dyn Observer) -> PartRows<'a> {
        self.begin_frame();
        PartRows { renderer: self, observer, next: 0, given: 0, rows: Vec::new(), told: Told::default() }
    }
}

/// A copy of a rectangle of the picture. `channel` holds the pixels of `held`, which contains the rectangle.
pub(super) fn cut(held: Rect, channel: &[[f32; 4]], rectangle: Rect) -> Result<Image, Refused> {
    let mut pixels = memory::with_capacity(rectangle.width as usize * rectangle.height as usize)?;
    append(held, channel, rectangle, &mut pixels);
    Ok(Image { width: rectangle.width, height: rectangle.height, pixels })
}

/// Appends a rectangle of the picture to `pixels`. `channel` holds the pixels of `held`, which contains the rectangle.
fn append(held: Rect, channel: &[[f32; 4]], rectangle: Rect, pixels: &mut Vec<[f32; 4]>) {
    let (left, top) = ((rectangle.x - held.x) as usize, (rectangle.y - held.y) as usize);
    let rows = channel.chunks_exact((held.width as usize).max(1)).skip(top).take(rectangle.height as usize);
    for row in rows {
        pixels.extend_from_slice(&row[left..left + rectangle.width as usize]);
    }
}

/// The camera of a block of a viewport: its clip space spans the block instead of the whole viewport.
fn view_of_block(view: View, whole: Rect, block: Rect) -> View {
    let axis = |start: u32, length: u32, first: u32, side: u32| {
        let [length, side] = [length, side].map(f64::from);
        let before = f64::from(first - start);
        // Maps -1..1 over the whole viewport to -1..1 over the block.
        (length / side, (length - 2.0 * before - side) / side)
    };
    let (across, right) = axis(whole.x, whole.width, block.x, block.width);
    // Rows count downwards, while the y axis points up.
    let (up, down) = axis(whole.y, whole.height, block.y, block.height);
    let to_block = DMat4::from_cols(
        DVec4::new(across, 0.0, 0.0, 0.0),
        DVec4::new(0.0, up, 0.0, 0.0),
        DVec4::Z,
        DVec4::new(right, -down, 0.0, 1.0),
    );
    view.mapped(to_block)
}

/// Draws a job block by block; returns the number of triangles submitted.
pub(super) fn draw_blocks(
    raster: &mut dyn Rasteriser,
    job: &RasterJob<'_>,
    blocks: &[(View, Rect)],
    host: Attachments,
    target: &mut GBuffer,
    progress: &Progress,
) -> Result<u64, BackendError> {
    let mut triangles = 0;
    for (view, viewport) in blocks {
        if progress.is_cancelled() {
            break;
        }
        let job = RasterJob { view: *view, viewport: *viewport, ..*job };
        triangles += raster.draw_until(&job, target, progress)?.triangles;
        if raster.needs_read_back() && (host != Attachments::default() || job.load_store.store_depth) {
            raster.read_back(&job, host, target)?;
        }
    }
    Ok(triangles)
}

/// The rows of a frame, rendered on request.
pub(super) struct PartRows<'a> {
    renderer: &'a mut Renderer,
    observer: &'a mut dyn Observer,
    /// The next part to render.
    next: usize,
    /// Rows of the current part that were handed out.
    given: u32,
    rows: Vec<[f32; 4]>,
    told: Told,
}

/// Result of a frame whose rows were requested by an encoder.
#[derive(Debug, Default)]
pub(super) struct Told {
    /// Why rendering ended early.
    pub failed: Option<RenderError>,
    /// Number of pixels with a value that is not finite.
    pub not_finite: usize,
    /// Whether the pixels have no, one or several colours.
    pub colors: Colors,
    /// Time spent rendering.
    pub took: Duration,
}

impl PartRows<'_> {
    /// The result, once the encoder is done.
    pub fn told(self) -> Told {
        self.told
    }
}

impl Rows for PartRows<'_> {
    fn size(&self) -> [u32; 2] {
        let crop = self.renderer.plan.parts.crop;
        [crop.width, crop.height]
    }

    fn next(&mut self, count: u32) -> io::Result<&[[f32; 4]]> {
        self.rows.clear();
        let mut wanted = count;
        while wanted > 0 {
            let parts = &self.renderer.plan.parts.list;
            let left = self.next.checked_sub(1).map_or(0, |last| parts[last].written.height - self.given);
            if left == 0 {
                if self.next == parts.len() {
                    break;
                }
                let start = Instant::now();
                let drawn = self.renderer.draw_part(self.next, self.renderer.all_passes(), self.observer);
                self.told.took += start.elapsed();
                if let Err(error) = drawn {
                    let message = error.to_string();
                    self.told.failed = Some(error);
                    return Err(io::Error::other(message));
                }
                (self.next, self.given) = (self.next + 1, 0);
                if self.next == self.renderer.plan.parts.list.len() {
                    self.renderer.end_frame();
                }
                continue;
            }
            let taken = left.min(wanted);
            let written = self.renderer.plan.parts.list[self.next - 1].written;
            let part = Rect { y: written.y + self.given, height: taken, ..written };
            self.renderer.copy_rows(part, &mut self.rows);
            self.given += taken;
            wanted -= taken;
        }
        self.told.not_finite += count_non_finite(&self.rows);
        self.told.colors.see(&self.rows);
        Ok(&self.rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Mat4, Vec3};

    #[test]
    fn a_block_shows_what_the_whole_shows_there() {
        let eye = Vec3::new(1.0, 2.0, 3.0);
        let projection = glam::camera::rh::proj::directx::perspective(1.0, 1.5, 100.0, 0.1);
        let look = glam::camera::rh::view::look_to_mat4(eye, Vec3::new(0.2, -0.1, -1.0).normalize(), Vec3::Y);
        let view = View::new(projection * look, eye);
        assert_ne!(view.clip_from_world, Mat4::IDENTITY);
        let whole = Rect { x: 0, y: 0, width: 3000, height: 2000 };
        let pixel = |view: &View, viewport: Rect, point: Vec3| {
            let clip = view.clip_from_world * point.extend(1.0);
            let (x, y) = (clip.x / clip.w * 0.5 + 0.5, 0.5 - clip.y / clip.w * 0.5);
            let (width, height) = (viewport.width as f32, viewport.height as f32);
            [viewport.x as f32 + x * width, viewport.y as f32 + y * height, clip.z / clip.w]
        };
        for block in [Rect { x: 0, y: 0, width: 512, height: 512 }, Rect { x: 2560, y: 1536, width: 440, height: 464 }]
        {
            let part = view_of_block(view, whole, block);
            for point in [Vec3::new(0.0, 0.0, -9.0), Vec3::new(3.0, 1.0, -20.0), Vec3::new(-4.0, 5.0, -7.5)] {
                let (expected, found) = (pixel(&view, whole, point), pixel(&part, block, point));
                for (expected, found) in expected.into_iter().zip(found) {
                    assert!((expected - found).abs() < 2e-3, "{expected} and {found} in {block:?}");
                }
            }
        }
    }
}
