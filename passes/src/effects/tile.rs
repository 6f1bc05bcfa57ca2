//! Tiles, the units of parallel work, and their parts, whose rays share packets.

use super::pass::Pixel;

/// Pixels along a side of a tile, the unit of parallel work; small enough that its rays visit the same nodes.
pub const TILE: usize = 16;
/// Pixels along a side of a part, whose rays share packets.
pub(super) const PART: usize = 4;
/// Number of parts in a tile.
pub(super) const PARTS: usize = (TILE / PART) * (TILE / PART);
/// Parts along a side of a square of parts.
const SQUARE: usize = 2;
/// Squares along a side of a tile.
const SQUARES: usize = TILE / PART / SQUARE;

/// Column and row of a part's first pixel. Parts 4 k to 4 k + 3 form a square of 8 x 8 pixels.
#[inline(always)]
pub(super) fn corner_of(part: usize) -> (usize, usize) {
    let (square, part) = (part / (SQUARE * SQUARE), part % (SQUARE * SQUARE));
    let (left, top) = (square % SQUARES * SQUARE + part % SQUARE, square / SQUARES * SQUARE + part / SQUARE);
    (left * PART, top * PART)
}

/// The part that contains a place of a tile, and the index in that part, row by row.
pub(super) fn part_of(place: usize) -> (usize, usize) {
    let (x, y) = (place % TILE, place / TILE);
    let (left, top) = (x / PART, y / PART);
    let square = top / SQUARE * SQUARES + left / SQUARE;
    (square * SQUARE * SQUARE + top % SQUARE * SQUARE + left % SQUARE, y % PART * PART + x % PART)
}

/// A tile, cut off at the image's border.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Area {
    /// Left column.
    pub x: usize,
    /// Top row.
    pub y: usize,
    /// Columns, [`TILE`] at most.
    pub width: usize,
    /// Rows, [`TILE`] at most.
    pub height: usize,
    /// Pixels a row of the image.
    pub stride: usize,
}

impl Area {
    /// The pixels, part by part (4 x 4 pixels), each with its place in the tile (row by row, [`TILE`] a row). Parts 4 k to 4 k + 3 form a square of
    /// 8 x 8 pixels.
    pub fn pixels(self) -> impl Iterator<Item = (usize, Pixel)> {
        let place = |index: usize| {
            let (part, inner) = (index / (PART * PART), index % (PART * PART));
            let (left, top) = corner_of(part);
            (left + inner % PART, top + inner / PART)
        };
        let places = (0..TILE * TILE).map(place);
        places.filter(move |&(x, y)| x < self.width && y < self.height).map(move |(right, down)| {
            let (x, y) = (self.x + right, self.y + down);
            (down * TILE + right, Pixel { x: x as u32, y: y as u32, index: y * self.stride + x })
        })
    }
}
