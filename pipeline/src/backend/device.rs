//! Limits of an engine, and the description of its device.

/// The largest pictures that an engine can make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Greatest number of pixels along a side.
    pub side: u32,
    /// Whether a picture can be rendered in parts, each of which equals that region of the picture rendered as a whole.
    pub parts: bool,
}

impl Limits {
    /// No limit but memory; parts are possible.
    pub const NONE: Self = Self { side: u32::MAX, parts: true };
}

/// Description of a graphics device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Gpu {
    /// Name and capabilities, in words.
    pub name: String,
    /// The driver, in words.
    pub driver: String,
}
