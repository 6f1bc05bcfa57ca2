//! Pictures of errors.

use super::color_spaces::displayed_of_lab;
use super::{MetricError, Options, check};
use crate::image::Image;
use rayon::prelude::*;

/// An error for each pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorMap {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` errors, 0 to 1, top row first.
    pub values: Vec<f64>,
}

impl ErrorMap {
    /// Mean error over the mask, or over all pixels without one; NaN if there is no pixel.
    #[must_use]
    pub fn mean(&self, mask: Option<&[bool]>) -> f64 {
        let compared = |index: usize| mask.is_none_or(|mask| mask.get(index).copied().unwrap_or(false));
        let mut count = 0_u64;
        let chosen = self.values.iter().enumerate().filter(|(index, _)| compared(*index));
        let sum: f64 = chosen.map(|(_, value)| value).inspect(|_| count += 1).sum();
        sum / count as f64
    }
}

/// Control points of the heat map in CIELAB under D65: from black through blue, purple, red and orange to cream. Lightness grows in
/// proportion to the error, so that the map reads the same in grey, and all points between lie in sRGB.
const RAMP: [[f64; 3]; 6] = [
    [3.0, 0.0, -6.0],
    [22.0, 28.0, -52.0],
    [42.0, 62.0, -22.0],
    [60.0, 56.0, 42.0],
    [80.0, 8.0, 62.0],
    [96.0, -3.0, 18.0],
];

/// The map as displayed colours: CIE lightness 3 for an error of 0, 96 for 1, in proportion between.
#[must_use]
pub fn heat_map(map: &ErrorMap) -> Image {
    const STEPS: usize = 1024;
    let table: Vec<[f32; 4]> = (0..=STEPS).map(|step| ramp(step as f64 / STEPS as f64)).collect();
    let color = |value: &f64| table[(value.clamp(0.0, 1.0) * STEPS as f64).round() as usize];
    Image { width: map.width, height: map.height, pixels: map.values.par_iter().map(color).collect() }
}

fn ramp(value: f64) -> [f32; 4] {
    let [first, .., last] = RAMP;
    let lightness = first[0] + value * (last[0] - first[0]);
    let index = RAMP.iter().rposition(|point| point[0] <= lightness).unwrap_or(0).min(RAMP.len() - 2);
    let (low, high) = (RAMP[index], RAMP[index + 1]);
    let part = (lightness - low[0]) / (high[0] - low[0]);
    let [red, green, blue] = displayed_of_lab([0, 1, 2].map(|i| low[i] + part * (high[i] - low[i])));
    [red as f32, green as f32, blue as f32, 1.0]
}

/// `|test - reference| * scale` of each colour; alpha is 1.
///
/// # Errors
/// If the pictures cannot be compared.
pub fn absolute_error(test: &Image, reference: &Image, scale: f32) -> Result<Image, MetricError> {
    check(test, reference, &Options::default())?;
    let error = |(test, reference): (&[f32; 4], &[f32; 4])| {
        [0, 1, 2, 3].map(|i| if i < 3 { (test[i] - reference[i]).abs() * scale } else { 1.0 })
    };
    let pixels = test.pixels.par_iter().zip(&reference.pixels).map(error).collect();
    Ok(Image { width: test.width, height: test.height, pixels })
}

/// Pictures side by side, aligned at the top; the space below shorter ones is black. An empty picture if there are none.
#[must_use]
pub fn strip(images: &[&Image]) -> Image {
    let width = images.iter().map(|image| image.width).fold(0, u32::saturating_add);
    let height = images.iter().map(|image| image.height).max().unwrap_or(0);
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for y in 0..height as usize {
        for image in images {
            let side = image.width as usize;
            match image.pixels.get(y * side..(y + 1) * side) {
                Some(row) => pixels.extend_from_slice(row),
                None => pixels.extend(std::iter::repeat_n([0.0, 0.0, 0.0, 1.0], side)),
            }
        }
    }
    Image { width, height, pixels }
}

#[cfg(test)]
mod tests {
    use super::super::perceived_lightness;
    use super::*;

    #[test]
    fn lightness_of_the_heat_map_is_in_proportion_to_the_error() {
        let values: Vec<f64> = (0..=256).map(|step| f64::from(step) / 256.0).collect();
        let shown = heat_map(&ErrorMap { width: 257, height: 1, values: values.clone() });
        for (value, pixel) in values.iter().zip(&shown.pixels) {
            let lightness = perceived_lightness([pixel[0], pixel[1], pixel[2]]);
            assert!((lightness - (3.0 + 93.0 * value)).abs() < 0.2, "{lightness} at {value}");
        }
        let beyond = heat_map(&ErrorMap { width: 3, height: 1, values: vec![-1.0, 2.0, f64::NAN] });
        assert_eq!((beyond.pixels[0], beyond.pixels[1]), (shown.pixels[0], shown.pixels[256]));
    }

    #[test]
    fn absolute_errors_are_scaled_and_unsigned() {
        let error = absolute_error(
            &Image::filled(2, 1, [0.5, 0.25, 1.0, 0.0]),
            &Image::filled(2, 1, [0.25, 0.5, 1.0, 1.0]),
            2.0,
        );
        assert_eq!(error.expect("comparable").pixels, vec![[0.5, 0.5, 0.0, 1.0]; 2]);
        assert!(absolute_error(&Image::filled(2, 1, [0.0; 4]), &Image::filled(1, 2, [0.0; 4]), 1.0).is_err());
    }

    #[test]
    fn a_strip_sets_pictures_side_by_side() {
        let (red, blue) = (Image::filled(2, 2, [1.0, 0.0, 0.0, 1.0]), Image::filled(1, 1, [0.0, 0.0, 1.0, 1.0]));
        let shown = strip(&[&red, &blue]);
        assert_eq!((shown.width, shown.height, shown.pixels.len()), (3, 2, 6));
        assert_eq!(shown.pixels[2], [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(shown.pixels[3], [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(shown.pixels[5], [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(strip(&[]), Image::default());
    }
}
