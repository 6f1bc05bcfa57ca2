//! Images: the attachments of render targets and the picture that is shown.

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
}

/// An RGBA picture of 32-bit floats, top row first.
///
/// Narrower formats are rounded when a pass stores into them, so that what a later pass reads has their precision.
#[derive(Debug, Clone, PartialEq)]
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
}
