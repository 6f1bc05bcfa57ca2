//! Pictures as a screen shows them.

use super::{Image, ImageRows, Rows, write_png_rows};
use crate::color::{ColorSpace, Display};
use crate::memory::{self, Refused};
use rayon::prelude::*;
use std::io;
use std::path::Path;

/// Rows as [`Display::stored`] has them, made while they are written.
pub struct DisplayRows<'a> {
    rows: &'a mut dyn Rows,
    display: Display,
    made: Vec<[f32; 4]>,
}

impl<'a> DisplayRows<'a> {
    /// Of rows.
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

/// What is displayed of a picture: [`Display::displayed`] of each pixel.
///
/// # Errors
/// If there is no memory for it.
pub fn displayed(image: &Image, display: Display) -> Result<Image, Refused> {
    let mut pixels = memory::with_capacity(image.pixels.len())?;
    image.pixels.par_iter().map(|pixel| display.displayed(*pixel)).collect_into_vec(&mut pixels);
    Ok(Image { width: image.width, height: image.height, pixels })
}

/// Writes a picture as an 8-bit PNG of what is displayed of it.
///
/// # Errors
/// Whatever the file system reports.
pub fn write_displayed(path: &Path, image: &Image, display: Display) -> io::Result<()> {
    write_png_rows(path, &mut DisplayRows::new(&mut ImageRows::from(image), display))
}
