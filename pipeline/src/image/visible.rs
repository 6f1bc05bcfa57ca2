//! False colours: world positions and normals as colours that a person can read.

use super::Image;
use super::rows::{ImageRows, Rows};
use std::io;

/// What the pixels of an image mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Colours, shown as they are.
    Color,
    /// World positions, shown relative to the bounding box of nearly all of them.
    Position,
    /// Unit vectors, shown as `(n + 1) / 2`.
    Normal,
}

/// Converts a picture to colours for a person; uncovered pixels (all zero) stay black.
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
                let ends = [0, 1, 2].map(|axis| ends(pixels, axis));
                (ends.map(|(low, _)| low), ends.map(|(low, high)| (high - low).max(f32::MIN_POSITIVE)))
            }
        };
        Self { content, low, size }
    }

    fn pixel(&self, pixel: &[f32; 4]) -> [f32; 4] {
        match self.content {
            Content::Color => *pixel,
            _ if !covered(pixel) => [0.0, 0.0, 0.0, 1.0],
            _ => [0, 1, 2, 3]
                .map(|i| if i < 3 { ((pixel[i] - self.low[i]) / self.size[i]).clamp(0.0, 1.0) } else { 1.0 }),
        }
    }
}

/// Most pixels that [`ends`] looks at.
const LOOKED_AT: usize = 1 << 16;
/// Share of the pixels below the low end, and the share above the high end. Without this, one far point would compress the rest
/// into one colour.
const BEYOND: f32 = 0.02;

/// The range of a component over covered pixels, without the outliers on both sides.
fn ends(pixels: &[[f32; 4]], axis: usize) -> (f32, f32) {
    let step = pixels.len().div_ceil(LOOKED_AT).max(1);
    let seen = pixels.iter().step_by(step).filter(|pixel| covered(pixel)).map(|pixel| pixel[axis]);
    let mut seen: Vec<f32> = seen.filter(|value| value.is_finite()).collect();
    let beyond = (seen.len() as f32 * BEYOND) as usize;
    let last = seen.len().saturating_sub(1 + beyond);
    if seen.is_empty() {
        return (0.0, 1.0);
    }
    let (_, low, _) = seen.select_nth_unstable_by(beyond, f32::total_cmp);
    let low = *low;
    let (_, high, _) = seen.select_nth_unstable_by(last, f32::total_cmp);
    (low, *high)
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
    /// Makes the rows of an image visible.
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
    fn a_few_positions_far_off_do_not_darken_the_rest() {
        let near = (0..98).map(|i| [i as f32, 1.0, 2.0, 0.5]);
        let pixels: Vec<[f32; 4]> = near.chain([[1e6, 1.0, 2.0, 0.5], [f32::INFINITY, 1.0, 2.0, 0.5]]).collect();
        let shown = make_visible(&Image { width: 100, height: 1, pixels }, Content::Position);
        assert_eq!((shown.pixels[1][0], shown.pixels[97][0], shown.pixels[98][0]), (0.0, 1.0, 1.0));
        assert!((shown.pixels[49][0] - 0.5).abs() < 0.02);
    }

    #[test]
    fn normals_map_to_their_usual_colours() {
        let shown = make_visible(&Image { width: 1, height: 1, pixels: vec![[0.0, 1.0, 0.0, 0.0]] }, Content::Normal);
        assert_eq!(shown.pixels[0], [0.5, 1.0, 0.5, 1.0]);
    }
}
