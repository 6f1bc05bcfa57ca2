//! Pictures as a screen shows them.

use super::{Image, ImageRows, Rows, byte, write_png_codes, write_png_rows};
use crate::color::{ColorSpace, DECODED, Display};
use crate::memory::{self, Refused};
use rayon::prelude::*;
use std::io;
use std::path::Path;

/// Rows of another picture, converted by [`Display::stored`] while they are written.
pub struct DisplayRows<'a> {
    rows: &'a mut dyn Rows,
    display: Display,
    made: Vec<[f32; 4]>,
}

impl<'a> DisplayRows<'a> {
    /// Converts `rows` for `display`.
    #[must_use]
    pub fn new(rows: &'a mut dyn Rows, display: Display) -> Self {
        Self { rows, display, made: Vec::new() }
    }
}

impl Rows for DisplayRows<'_> {
    fn size(&self) -> [u32; 2] {
        self.rows.size()
    }

    fn next(&mut self, count: u32) -> io::Result<&[[f32; 4]]> {
        let rows = self.rows.next(count)?;
        if self.display.space == ColorSpace::Report {
            return Ok(rows);
        }
        let display = self.display;
        rows.par_iter().with_min_len(1024).map(|pixel| display.stored(*pixel)).collect_into_vec(&mut self.made);
        Ok(&self.made)
    }
}

/// Applies [`Display::displayed`] to each pixel.
///
/// # Errors
/// If there is no memory for it.
pub fn displayed(image: &Image, display: Display) -> Result<Image, Refused> {
    let mut pixels = memory::with_capacity(image.pixels.len())?;
    image.pixels.par_iter().map(|pixel| display.displayed(*pixel)).collect_into_vec(&mut pixels);
    Ok(Image { width: image.width, height: image.height, pixels })
}

/// Writes the display values of a picture as an 8-bit PNG.
///
/// # Errors
/// Whatever the file system reports.
pub fn write_displayed(path: &Path, image: &Image, display: Display) -> io::Result<()> {
    write_png_rows(path, &mut DisplayRows::new(&mut ImageRows::from(image), display))
}

/// The 8-bit code with which a PNG file stores the display value of a grey.
#[must_use]
pub fn code_of(display: Display, value: f32) -> u8 {
    byte(display.stored([value; 4])[0])
}

/// A picture as a screen shows it: after exposure, tone curve and encoding, 8 bits a channel.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Codes {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green and blue as PNG files store them, and alpha, 0 to 255; `width * height` pixels, top row first.
    pub pixels: Vec<[u8; 4]>,
}

impl Codes {
    /// The codes of `image`.
    ///
    /// # Errors
    /// If there is no memory for it.
    pub fn of(image: &Image, display: Display) -> Result<Self, Refused> {
        let mut pixels = memory::with_capacity(image.pixels.len())?;
        let codes = |pixel: &[f32; 4]| display.stored(*pixel).map(byte);
        image.pixels.par_iter().with_min_len(1024).map(codes).collect_into_vec(&mut pixels);
        Ok(Self { width: image.width, height: image.height, pixels })
    }

    /// A picture that displays as these codes: each value decodes its code exactly, so it is the middle of the values with that
    /// code.
    ///
    /// # Errors
    /// If there is no memory for it.
    pub fn decoded(&self, space: ColorSpace) -> Result<Image, Refused> {
        let mut pixels = memory::with_capacity(self.pixels.len())?;
        let value = |code: u8| match space {
            ColorSpace::Report => f32::from(code) / 255.0,
            ColorSpace::Linear => DECODED[usize::from(code)],
        };
        let pixel = |&[r, g, b, a]: &[u8; 4]| [value(r), value(g), value(b), f32::from(a) / 255.0];
        self.pixels.par_iter().with_min_len(1024).map(pixel).collect_into_vec(&mut pixels);
        Ok(Image { width: self.width, height: self.height, pixels })
    }
}

/// Writes codes as an 8-bit RGB PNG: the same file that [`write_displayed`] makes of the original picture.
///
/// # Errors
/// Whatever the file system reports.
pub fn write_codes(path: &Path, codes: &Codes) -> io::Result<()> {
    write_png_codes(path, codes.width, codes.height, &codes.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Image {
        let pixel = |i: u32| {
            let value = (i as f32 / 900.0 - 0.1) * 1.3;
            [value, value * value, if i.is_multiple_of(97) { f32::NAN } else { 1.0 - value }, value]
        };
        Image { width: 30, height: 40, pixels: (0..1200).map(pixel).collect() }
    }

    #[test]
    fn codes_are_what_a_png_file_holds() {
        let folder = tempfile::tempdir().expect("a folder");
        for display in [
            Display::default(),
            Display { exposure: 0.7, tone: crate::color::Tone::Reinhard, ..Display::of(ColorSpace::Linear) },
        ] {
            let (image, [a, b]) = (picture(), ["a.png", "b.png"].map(|name| folder.path().join(name)));
            write_displayed(&a, &image, display).expect("written");
            let codes = Codes::of(&image, display).expect("made");
            write_codes(&b, &codes).expect("written");
            assert!(std::fs::read(a).expect("read") == std::fs::read(b).expect("read"), "{display:?}");
            let again = Codes::of(&codes.decoded(display.space).expect("made"), Display::of(display.space));
            assert_eq!(again.expect("made"), codes, "{display:?}");
        }
    }
}
