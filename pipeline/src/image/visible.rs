//! False colours: world positions and normals as colours that a person can read.

use super::Image;
use super::rows::{ImageRows, Rows};
use std::io;

/// What the pixels of an image mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Colours, shown as they are.
    Color,
    /// World positions, shown relative to the [bounding box](position_box) of nearly all near positions.
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
                let ends = position_box(pixels).unwrap_or([[0.0, 1.0]; 3]);
                (ends.map(|[low, _]| low), ends.map(|[low, high]| (high - low).max(f32::MIN_POSITIVE)))
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

/// Greatest number of pixels that [`position_box`] looks at.
const LOOKED_AT: usize = 1 << 16;
/// Share of the near pixels that lie below the low end of the box, and share that lies above the high end. Without this margin a single
/// point could compress all others into one colour.
const BEYOND: f32 = 0.02;
/// A position is near if its distance from the middle is at most this many times the median distance. Without this limit sky and
/// mountains, which may cover a third of the pixels, would leave only black for the objects in front of them.
const NEAR: f64 = 4.0;

/// The box in which positions are shown, as the low and high end of each axis. It contains nearly all covered pixels that are near the
/// middle, which is the median of each coordinate. `None` if no pixel is covered by a finite position.
#[must_use]
pub fn position_box(pixels: &[[f32; 4]]) -> Option<[[f32; 2]; 3]> {
    let step = pixels.len().div_ceil(LOOKED_AT).max(1);
    let seen = pixels.iter().step_by(step).filter(|pixel| covered(pixel)).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
    let seen: Vec<[f32; 3]> = seen.filter(|place| place.iter().all(|value| value.is_finite())).collect();
    let middle_of = seen.len() / 2;
    let along = |places: &[[f32; 3]], axis: usize| places.iter().map(|place| place[axis]).collect::<Vec<_>>();
    if seen.is_empty() {
        return None;
    }
    let middle = [0, 1, 2].map(|axis| ranked(&mut along(&seen, axis), middle_of));
    let from_middle = |place: &[f32; 3]| {
        let apart = [0, 1, 2].map(|axis| (f64::from(place[axis]) - f64::from(middle[axis])).powi(2));
        (apart.iter().sum::<f64>() as f32).sqrt()
    };
    let mut distances: Vec<f32> = seen.iter().map(from_middle).collect();
    let usual = ranked(&mut distances, middle_of);
    let is_near = |place: &&[f32; 3]| usual == 0.0 || f64::from(from_middle(place)) <= NEAR * f64::from(usual);
    let near: Vec<[f32; 3]> = seen.iter().filter(is_near).copied().collect();
    let beyond = (near.len() as f32 * BEYOND) as usize;
    let last = near.len().saturating_sub(1 + beyond);
    Some([0, 1, 2].map(|axis| [beyond, last].map(|rank| ranked(&mut along(&near, axis), rank))))
}

/// The value with this rank, counted from 0 for the smallest.
fn ranked(values: &mut [f32], rank: usize) -> f32 {
    *values.select_nth_unstable_by(rank, f32::total_cmp).1
}

/// A sentence that says which positions the colours stand for; `None` unless `content` is [`Content::Position`] and a pixel is covered.
#[must_use]
pub fn legend(pixels: &[[f32; 4]], content: Content) -> Option<String> {
    let ends = position_box(pixels).filter(|_| content == Content::Position)?;
    let words = ["x", "y", "z"].iter().zip(["red", "green", "blue"]).zip(ends);
    let words =
        words.map(|((axis, color), [low, high])| format!("{color} is {axis} from {} to {}", short(low), short(high)));
    Some(words.collect::<Vec<_>>().join(", "))
}

/// A coordinate with about three digits.
fn short(value: f32) -> String {
    let digits = (2.0 - f64::from(value.abs().max(0.01)).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{value:.digits$}")
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
    fn a_sky_leaves_the_colours_to_what_stands_in_front_of_it() {
        // Two fifths of the picture are a sky a thousand times as far off.
        let ground = (0..60).map(|i| [i as f32, 0.5 * i as f32, -(i as f32), 0.5]);
        let sky = (0..40).map(|i| [1e3 * (i as f32 - 20.0), 3e4, -4e4, 1.0]);
        let pixels: Vec<[f32; 4]> = ground.chain(sky).collect();
        let words = legend(&pixels, Content::Position).expect("a legend");
        let shown = make_visible(&Image { width: 100, height: 1, pixels: pixels.clone() }, Content::Position);
        for axis in 0..2 {
            assert!(shown.pixels[50][axis] > 0.75, "{:?}: {words}", shown.pixels[50]);
        }
        assert_eq!(
            (shown.pixels[99][1], shown.pixels[99][2]),
            (1.0, 0.0),
            "far places have the colours of the box's faces"
        );
        assert_eq!(words, "red is x from 1.00 to 58.0, green is y from 0.500 to 29.0, blue is z from -58.0 to -1.00");
        assert!(legend(&pixels, Content::Normal).is_none() && legend(&[[0.0; 4]], Content::Position).is_none());
    }

    #[test]
    fn normals_map_to_their_usual_colours() {
        let shown = make_visible(&Image { width: 1, height: 1, pixels: vec![[0.0, 1.0, 0.0, 0.0]] }, Content::Normal);
        assert_eq!(shown.pixels[0], [0.5, 1.0, 0.5, 1.0]);
    }
}
