//! The result of a raster pass: attachments, and rectangles of them.

use crate::memory::{self, Refused};

/// Side in pixels of the largest tiles into which engines divide pictures: those of the processor's rasteriser.
pub const ALIGNMENT: u32 = 64;

/// A rectangle of pixels; `y` counts from the top row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// The part of a viewport that a target holds, relative to the viewport's corner; `held` is the target's part of the picture.
/// `None` if the part is empty, or if the target cuts the viewport elsewhere than at multiples of [`ALIGNMENT`] pixels from the
/// viewport's corner: a rasteriser that works in tiles would then use other tiles than for the whole viewport.
#[must_use]
pub fn drawn_part(viewport: Rect, held: Rect) -> Option<Rect> {
    let axis = |start: u32, length: u32, held: u32, room: u32| {
        let end = start.checked_add(length)?.min(held.checked_add(room)?);
        let first = start.max(held);
        let (from, part) = (first - start, end.checked_sub(first)?);
        let on_tiles = |pixels: u32| pixels.is_multiple_of(ALIGNMENT);
        (part > 0 && on_tiles(from) && (on_tiles(from + part) || from + part == length)).then_some((from, part))
    };
    let (x, width) = axis(viewport.x, viewport.width, held.x, held.width)?;
    let (y, height) = axis(viewport.y, viewport.height, held.y, held.height)?;
    Some(Rect { x, y, width, height })
}

/// The attachments that a raster pass writes, namely those that are read later.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Attachments {
    /// Shaded colour.
    pub color: bool,
    /// World position; `w` is the light's cosine, at least 0.
    pub position: bool,
    /// Shading normal; `w` is 0.
    pub normal: bool,
    /// Triangle id, for ray passes that start exactly on the surface.
    pub triangle: bool,
}

impl Attachments {
    /// The attachments in either set.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            color: self.color || other.color,
            position: self.position || other.position,
            normal: self.normal || other.normal,
            triangle: self.triangle || other.triangle,
        }
    }

    /// The attachments in this set but not in the other.
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self {
            color: self.color && !other.color,
            position: self.position && !other.position,
            normal: self.normal && !other.normal,
            triangle: self.triangle && !other.triangle,
        }
    }
}

/// Triangle id of a pixel without a surface.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// The attachments of one raster pass, in host memory. Attachments that were not selected are empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GBuffer {
    /// Column and row, in the picture, of the top left pixel held. Viewports are relative to the picture.
    pub origin: [u32; 2],
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Shaded colour, top row first.
    pub color: Vec<[f32; 4]>,
    /// World position and light cosine.
    pub position: Vec<[f32; 4]>,
    /// Shading normal.
    pub normal: Vec<[f32; 4]>,
    /// Triangle id or [`NO_TRIANGLE`].
    pub triangle: Vec<u32>,
    /// Depth, if the pass starts with the depth of an earlier pass or a later pass starts with this depth; otherwise empty. 1 at the near
    /// plane, 0 at the far plane and where nothing is drawn.
    pub depth: Vec<f32>,
}

impl GBuffer {
    /// Allocates the selected attachments, cleared to 0 (triangles to [`NO_TRIANGLE`]). The depth is left empty.
    ///
    /// # Panics
    /// If there is too little memory; [`Self::try_new`] returns an error instead.
    #[must_use]
    pub fn new(width: u32, height: u32, attachments: Attachments) -> Self {
        Self::try_new(width, height, attachments).unwrap_or_else(|error| panic!("{error}"))
    }

    /// The rectangle of the picture that it holds.
    #[must_use]
    pub fn held(&self) -> Rect {
        Rect { x: self.origin[0], y: self.origin[1], width: self.width, height: self.height }
    }

    /// [`Self::new`] that returns an error if there is too little memory.
    ///
    /// # Errors
    /// If there is too little memory.
    pub fn try_new(width: u32, height: u32, attachments: Attachments) -> Result<Self, Refused> {
        let pixels = width as usize * height as usize;
        let channel = |wanted: bool| if wanted { memory::zeroed(pixels) } else { Ok(Vec::new()) };
        Ok(Self {
            origin: [0; 2],
            width,
            height,
            color: channel(attachments.color)?,
            position: channel(attachments.position)?,
            normal: channel(attachments.normal)?,
            triangle: if attachments.triangle { memory::filled(NO_TRIANGLE, pixels)? } else { Vec::new() },
            depth: Vec::new(),
        })
    }
}
