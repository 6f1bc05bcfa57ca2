//! Making attachments visible: world positions and normals as colours that a person can read.

use super::Image;
use super::rows::{ImageRows, Rows};
use std::io;

/// What the pixels of an image mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Colours, shown as they are.
    Color,
    /// World positions, shown as their place in the box around them.
    Position,
    /// Unit vectors, shown as `(n + 1) / 2`.
    Normal,
}

/// Colours for a person to look at; uncovered pixels (all zero) stay black.
#[must_use]
pub fn make_visible(image: &Image, content: Content) -> Image {
    let shown = Visible::new(&image.pixels, content);
    Image { width: image.width, height: image.height, pixels: image.pixels.iter().map(|p| shown.pixel(p)).collect() }
}

/// How the pixels of an image are made visible.
#[derive(Debug, Clone, Copy)]
struct Visible {
    content: Content,
    low: [f32; 3],
    size: [f32; 3],
}

impl Visible {
    fn new(pixels: &[[f32; 4]], content: Content) -> Self {
        let (low, size) = match content {
            Content::Color | Content::Normal => ([-1.0; 3], [2.0; 3]),
            Content::Position => {
                let mut low = [f32::INFINITY; 3];
                let mut high = [f32::NEG_INFINITY; 3];
                for pixel in pixels.iter().filter(|pixel| covered(pixel)) {
                    for axis in 0..3 {
                        if pixel[axis].is_finite() {
                            low[axis] = low[axis].min(pixel[axis]);
                            high[axis] = high[axis].max(pixel[axis]);
                        }
                    }
                }
                (low, [0, 1, 2].map(|axis| (high[axis] - low[axis]).max(f32::MIN_POSITIVE)))
            }
        };
        Self { content, low, size }
    }

    fn pixel(&self, pixel: &[f32; 4]) -> [f32; 4] {
        match self.content {
            Content::Color => *pixel,
            _ if !covered(pixel) => [0.0, 0.0, 0.0, 1.0],
            _ => [0, 1, 2, 3].map(|i| if i < 3 { (pixel[i] - self.low[i]) / self.size[i] } else { 1.0 }),
        }
    }
}

fn covered(pixel: &[f32; 4]) -> bool {
    pixel.iter().any(|value| *value != 0.0)
}

/// The rows of [`make_visible`], without a copy of the picture.
#[derive(Debug)]
pub struct VisibleRows<'a> {
    rows: ImageRows<'a>,
    shown: Visible,
    made: Vec<[f32; 4]>,
}

impl<'a> VisibleRows<'a> {
    /// Of an image.
    #[must_use]
    pub fn new(image: &'a Image, content: Content) -> Self {
        Self { rows: image.into(), shown: Visible::new(&image.pixels, content), made: Vec::new() }
    }
}

impl Rows for VisibleRows<'_> {
    fn size(&self) -> [u32; 2] {
        self.rows.size()
    }

    fn next(&mut self, count: u32) -> io::Result<&[[f32; 4]]> {
        self.made.clear();
        self.made.extend(self.rows.next(count)?.iter().map(|pixel| self.shown.pixel(pixel)));
        Ok(&self.made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_fill_the_colour_cube_and_uncovered_pixels_stay_black() {
        let pixels = vec![[0.0; 4], [10.0, -5.0, 100.0, 0.5], [20.0, 5.0, 300.0, 0.1]];
        let shown = make_visible(&Image { width: 3, height: 1, pixels }, Content::Position);
        assert_eq!(shown.pixels, vec![[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0, 1.0]]);
    }

    #[test]
    fn normals_map_to_their_usual_colours() {
        let shown = make_visible(&Image { width: 1, height: 1, pixels: vec![[0.0, 1.0, 0.0, 0.0]] }, Content::Normal);
        assert_eq!(shown.pixels[0], [0.5, 1.0, 0.5, 1.0]);
    }
}
