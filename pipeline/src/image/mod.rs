//! Images: attachments of render targets and displayed pictures; reading, writing and false colours.

pub(crate) mod decode;
mod displayed;
mod read;
mod rows;
mod visible;
mod write;

pub use displayed::{Codes, DisplayRows, code_of, displayed, write_codes, write_displayed};
pub use read::{Picture, ReadImageError, Variance, read_image};
pub use rows::{ImageRows, Rows};
pub use visible::{Content, VisibleRows, legend, make_visible, position_box};
pub use write::{
    COLOR_ATTRIBUTE, Layer, RowLayer, byte, encode_exr, encode_png, write_exr, write_exr_layers, write_exr_of,
    write_exr_rows, write_exr_rows_of, write_png, write_png_codes, write_png_rows,
};

use half::f16;
use half::slice::HalfFloatSliceExt as _;
use rayon::prelude::*;

/// Largest side of a picture or a render target, pixels.
pub const MAX_SIDE: u32 = 65_536;

/// Name of the EXR layer that holds the variance of another layer, which is a mean of samples.
pub const VARIANCE_LAYER: &str = "variance";

/// How a channel of a render target is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PixelFormat {
    /// Four 32-bit floats.
    Rgba32Float,
    /// Four 16-bit floats.
    Rgba16Float,
    /// Four bytes, 0..=1.
    Rgba8Unorm,
    /// One byte, 0..=1, in the red channel.
    R8Unorm,
    /// One 32-bit float in the red channel.
    R32Float,
    /// Two 32-bit floats, in the red and the green channel.
    Rg32Float,
}

/// Number of pixels that are converted to 16-bit floats and back at once.
const PIECE: usize = 64;

impl PixelFormat {
    /// The formats by their names in project files and settings. `RGBA` is the short name of `RGBA8` in the report's engine.
    pub const NAMED: [(&'static str, Self); 7] = [
        ("RGBA32F", Self::Rgba32Float),
        ("RGBA16F", Self::Rgba16Float),
        ("RGBA8", Self::Rgba8Unorm),
        ("RGBA", Self::Rgba8Unorm),
        ("R8", Self::R8Unorm),
        ("R32F", Self::R32Float),
        ("RG32F", Self::Rg32Float),
    ];

    /// The format with this name; case does not matter.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::NAMED.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, format)| *format)
    }

    /// Its name in project files.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMED.iter().find(|(_, format)| *format == self).map_or("", |(name, _)| name)
    }

    /// Rounds pixels to what the format can hold. Colour channels that the format lacks become 0, a missing alpha becomes 1.
    pub fn round(self, pixels: &mut [[f32; 4]]) {
        fn unorm(value: f32) -> f32 {
            (value.clamp(0.0, 1.0) * 255.0).round() / 255.0
        }
        let round: fn([f32; 4]) -> [f32; 4] = match self {
            Self::Rgba32Float => return,
            Self::Rgba16Float => {
                pixels.par_chunks_mut(PIECE).for_each(|piece| {
                    let values = piece.as_flattened_mut();
                    let mut narrow = [f16::ZERO; 4 * PIECE];
                    let narrow = &mut narrow[..values.len()];
                    narrow.convert_from_f32_slice(values);
                    narrow.convert_to_f32_slice(values);
                });
                return;
            }
            Self::Rgba8Unorm => |pixel| pixel.map(unorm),
            Self::R8Unorm => |pixel| [unorm(pixel[0]), 0.0, 0.0, 1.0],
            Self::R32Float => |pixel| [pixel[0], 0.0, 0.0, 1.0],
            Self::Rg32Float => |pixel| [pixel[0], pixel[1], 0.0, 1.0],
        };
        pixels.par_iter_mut().for_each(|pixel| *pixel = round(*pixel));
    }
}

/// Converts pixels of four 16-bit floats in native byte order to 32-bit floats. `bytes` holds 8 bytes for each of `pixels`.
pub fn widen(bytes: &[u8], pixels: &mut [[f32; 4]]) {
    for (bytes, pixels) in bytes.chunks(8 * PIECE).zip(pixels.chunks_mut(PIECE)) {
        let mut narrow = [f16::ZERO; 4 * PIECE];
        for (value, stored) in narrow.iter_mut().zip(bytes.as_chunks().0) {
            *value = f16::from_ne_bytes(*stored);
        }
        let values = pixels.as_flattened_mut();
        narrow[..values.len()].convert_to_f32_slice(values);
    }
}

/// Converts values to the nearest 16-bit floats in native byte order, 2 bytes each. [`widen`] converts them back.
#[must_use]
pub fn narrow(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| f16::from_f32(*value).to_ne_bytes()).collect()
}

/// An RGBA picture of 32-bit floats, top row first.
///
/// Pixels of narrower formats are rounded when a pass stores them, so later passes read values of that precision.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Image {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels, top row first.
    pub pixels: Vec<[f32; 4]>,
}

impl Image {
    /// An image of one colour.
    #[must_use]
    pub fn filled(width: u32, height: u32, color: [f32; 4]) -> Self {
        Self { width, height, pixels: vec![color; width as usize * height as usize] }
    }

    /// Samples `width * height` pixels bilinearly at `u`, `v`: 0..=1 from the top left corner, clamped to the edge.
    #[must_use]
    pub fn bilinear(width: u32, height: u32, pixels: &[[f32; 4]], u: f32, v: f32) -> [f32; 4] {
        let x = (u * width as f32 - 0.5).clamp(0.0, (width - 1) as f32);
        let y = (v * height as f32 - 0.5).clamp(0.0, (height - 1) as f32);
        let (x0, y0) = (x as u32, y as u32);
        let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
        let (fx, fy) = (x - x0 as f32, y - y0 as f32);
        let at = |x: u32, y: u32| pixels[y as usize * width as usize + x as usize];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        std::array::from_fn(|i| {
            let upper = a[i] + (b[i] - a[i]) * fx;
            let lower = c[i] + (d[i] - c[i]) * fx;
            upper + (lower - upper) * fy
        })
    }

    /// Whether all pixels have the same colour; alpha is ignored. `false` for an empty image.
    #[must_use]
    pub fn is_blank(&self) -> bool {
        Colors::of(&self.pixels).is_one()
    }

    /// How many pixels hold a value that is not finite.
    #[must_use]
    pub fn count_non_finite(&self) -> usize {
        count_non_finite(&self.pixels)
    }
}

/// How many pixels hold a value that is not finite.
#[must_use]
pub fn count_non_finite(pixels: &[[f32; 4]]) -> usize {
    pixels.par_iter().filter(|pixel| pixel.iter().any(|value| !value.is_finite())).count()
}

/// The number of distinct colours of pixels: none, one, or more. Alpha is ignored.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum Colors {
    /// No pixel was seen.
    #[default]
    None,
    /// All pixels have this colour.
    One([f32; 3]),
    /// Pixels have different colours.
    Several,
}

impl Colors {
    /// The distinct colours of `pixels`.
    pub fn of(pixels: &[[f32; 4]]) -> Self {
        let mut colors = Self::default();
        colors.see(pixels);
        colors
    }

    /// Adds more pixels.
    pub fn see(&mut self, pixels: &[[f32; 4]]) {
        for &[r, g, b, _] in pixels {
            match *self {
                Self::None => *self = Self::One([r, g, b]),
                Self::One(color) if color == [r, g, b] => {}
                Self::One(_) | Self::Several => {
                    *self = Self::Several;
                    return;
                }
            }
        }
    }

    /// Whether pixels were seen and all have the same colour.
    pub fn is_one(self) -> bool {
        matches!(self, Self::One(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sampling_at_pixel_centres_returns_the_pixels() {
        let pixels: Vec<_> = (0..6).map(|i| [i as f32, 0.0, 1.0, -1.0]).collect();
        for y in 0..2 {
            for x in 0..3 {
                let sampled = Image::bilinear(3, 2, &pixels, (x as f32 + 0.5) / 3.0, (y as f32 + 0.5) / 2.0);
                assert!((sampled[0] - (y * 3 + x) as f32).abs() < 1e-5, "{sampled:?} at {x}, {y}");
            }
        }
        assert_eq!(Image::bilinear(3, 2, &pixels, 0.5, 0.5)[0], 2.5);
    }

    #[test]
    fn narrow_formats_round_to_what_they_hold() {
        let mut pixels = [[0.5, 1.5, -1.0, 0.1]];
        PixelFormat::Rgba8Unorm.round(&mut pixels);
        assert_eq!(pixels, [[128.0 / 255.0, 1.0, 0.0, 26.0 / 255.0]]);
        let mut pixels = [[0.1, 2049.0, 1.0, 0.0]];
        PixelFormat::Rgba16Float.round(&mut pixels);
        assert_eq!(pixels[0][1], 2048.0);
        assert!((pixels[0][0] - 0.1).abs() < 1e-4 && pixels[0][0] != 0.1);
        let mut pixels = [[0.25, 0.5, 0.5, 0.5]];
        PixelFormat::R32Float.round(&mut pixels);
        assert_eq!(pixels, [[0.25, 0.0, 0.0, 1.0]]);
        let mut pixels = [[0.25, -7.5, 0.5, 0.5]];
        PixelFormat::Rg32Float.round(&mut pixels);
        assert_eq!(pixels, [[0.25, -7.5, 0.0, 1.0]]);
    }

    /// The nearest 16-bit float, ties to even, by integer arithmetic (IEEE 754: 5 bits of exponent, 10 of fraction), for magnitudes
    /// below 65,520.
    fn nearest_half(value: f32) -> f32 {
        let exponent = ((value.to_bits() >> 23 & 0xff) as i32 - 127).max(-14);
        let unit = 2f64.powi(exponent - 10);
        ((f64::from(value) / unit).round_ties_even() * unit) as f32
    }

    #[test]
    fn every_16_bit_float_is_kept_and_every_other_number_goes_to_the_nearest() {
        let all: Vec<u16> = (0..=u16::MAX).filter(|bits| bits & 0x7c00 != 0x7c00).collect();
        let bytes: Vec<u8> = all.iter().flat_map(|bits| bits.to_ne_bytes()).collect();
        let mut pixels = vec![[f32::NAN; 4]; all.len() / 4];
        widen(&bytes, &mut pixels);
        let widened = pixels.as_flattened().to_vec();
        for (bits, value) in all.iter().zip(&widened) {
            assert_eq!(*value, nearest_half(*value), "{bits:x}");
        }
        PixelFormat::Rgba16Float.round(&mut pixels);
        assert_eq!(pixels.as_flattened(), widened, "what is a 16-bit float stays");
        // Values between neighbouring halves: below, at and above the middle. 130 pixels are not a multiple of the piece size.
        let mut between: Vec<[f32; 4]> = (0..130u16)
            .map(|i| std::array::from_fn(|k| widened[usize::from(i) * 200] * (1.0 + (k as f32 + 0.5) / 8192.0)))
            .collect();
        let expected: Vec<f32> = between.as_flattened().iter().map(|value| nearest_half(*value)).collect();
        assert!(between.as_flattened() != expected, "control: something is rounded");
        PixelFormat::Rgba16Float.round(&mut between);
        assert_eq!(between.as_flattened(), expected);
    }

    #[test]
    fn non_finite_pixels_are_counted() {
        let mut image = Image::filled(4, 4, [0.0; 4]);
        assert_eq!(image.count_non_finite(), 0);
        image.pixels[3][2] = f32::NAN;
        image.pixels[5][0] = f32::INFINITY;
        assert_eq!(image.count_non_finite(), 2);
    }
}
