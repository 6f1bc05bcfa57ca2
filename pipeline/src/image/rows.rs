//! Rows of a picture in the order in which encoders request them. A picture rendered in parts never exists as a whole in memory.

use super::Image;
use std::io;

/// The rows of a picture, from the top.
pub trait Rows {
    /// Pixels a row, and number of rows.
    fn size(&self) -> [u32; 2];

    /// The next `count` rows, or those that are left. Each row is handed out once.
    ///
    /// # Errors
    /// If the rows cannot be made; a writer passes the error on.
    fn next(&mut self, count: u32) -> io::Result<&[[f32; 4]]>;
}

/// The rows of a picture in memory.
#[derive(Debug, Clone)]
pub struct ImageRows<'a> {
    width: u32,
    height: u32,
    left: &'a [[f32; 4]],
}

impl<'a> ImageRows<'a> {
    /// The rows of `width * height` pixels, top row first.
    #[must_use]
    pub fn new(width: u32, height: u32, pixels: &'a [[f32; 4]]) -> Self {
        Self { width, height, left: pixels }
    }
}

impl<'a> From<&'a Image> for ImageRows<'a> {
    fn from(image: &'a Image) -> Self {
        Self::new(image.width, image.height, &image.pixels)
    }
}

impl Rows for ImageRows<'_> {
    fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    fn next(&mut self, count: u32) -> io::Result<&[[f32; 4]]> {
        let pixels = (count as usize).saturating_mul(self.width as usize).min(self.left.len());
        let (rows, left) = self.left.split_at(pixels);
        self.left = left;
        Ok(rows)
    }
}
