//! Making attachments visible: world positions and normals as colours that a person can read.

use super::Image;

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
    let covered = |pixel: &[f32; 4]| pixel.iter().any(|value| *value != 0.0);
    let (low, size) = match content {
        Content::Color => return image.clone(),
        Content::Normal => ([-1.0; 3], [2.0; 3]),
        Content::Position => {
            let mut low = [f32::INFINITY; 3];
            let mut high = [f32::NEG_INFINITY; 3];
            for pixel in image.pixels.iter().filter(|pixel| covered(pixel)) {
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
    let map = |pixel: &[f32; 4]| [0, 1, 2, 3].map(|i| if i < 3 { (pixel[i] - low[i]) / size[i] } else { 1.0 });
    let shown = |pixel: &[f32; 4]| if covered(pixel) { map(pixel) } else { [0.0, 0.0, 0.0, 1.0] };
    Image { width: image.width, height: image.height, pixels: image.pixels.iter().map(shown).collect() }
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
