//! What a raster pass leaves: attachments, and rectangles of them.

use crate::memory::{self, Refused};

/// Sides of the tiles that engines cut pictures into, pixels. Those of the rasteriser on the processor are the largest.
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

/// What of a viewport a target holds that is `held` of the picture, in pixels from the viewport's corner. `None` for nothing,
/// and where the target cuts the viewport elsewhere than at multiples of [`ALIGNMENT`] pixels from its corner: a rasteriser that
/// works in tiles would make others than those of the whole viewport.
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

/// Which attachments a raster pass writes: those that something reads later.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Attachments {
    /// Shaded colour.
    pub color: bool,
    /// World position; `w` is the light's cosine, clamped at 0.
    pub position: bool,
    /// Shading normal; `w` is 0.
    pub normal: bool,
    /// Triangle id, for ray passes that start exactly on the surface.
    pub triangle: bool,
}

impl Attachments {
    /// What either has.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            color: self.color || other.color,
            position: self.position || other.position,
            normal: self.normal || other.normal,
            triangle: self.triangle || other.triangle,
        }
    }

    /// What it has and the other has not.
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

/// The triangle id of a pixel that nothing covers.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// The attachments of one raster pass, in host memory. Those not asked for are empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GBuffer {
    /// Column and row, in the picture, of the top left pixel that is held: viewports count from the picture's.
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
}

impl GBuffer {
    /// Allocates the attachments asked for, cleared to 0 (triangles to [`NO_TRIANGLE`]).
    ///
    /// # Panics
    /// If there is not so much memory; [`Self::try_new`] says so.
    #[must_use]
    pub fn new(width: u32, height: u32, attachments: Attachments) -> Self {
        Self::try_new(width, height, attachments).unwrap_or_else(|error| panic!("{error}"))
    }

    /// What it holds of the picture.
    #[must_use]
    pub fn held(&self) -> Rect {
        Rect { x: self.origin[0], y: self.origin[1], width: self.width, height: self.height }
    }

    /// [`Self::new`] where memory may be short.
    ///
    /// # Errors
    /// If there is not so much.
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
        })
    }
}
