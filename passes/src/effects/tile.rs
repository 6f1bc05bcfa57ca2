//! Tiles, the unit of parallel work, and the parts of a tile whose rays share packets.

use super::pass::Pixel;

/// Pixels a side of a tile: the unit of parallel work, small enough that its rays meet the same nodes.
pub const TILE: usize = 16;
/// Pixels a side of the part of a tile whose rays share packets.
pub(super) const PART: usize = 4;
/// Parts of a tile.
pub(super) const PARTS: usize = (TILE / PART) * (TILE / PART);
/// Parts a side of a square of parts.
const SQUARE: usize = 2;
/// Squares a side of a tile.
const SQUARES: usize = TILE / PART / SQUARE;

/// Column and row of the first pixel of a part. Four parts that follow each other are a square.
#[inline(always)]
pub(super) fn corner_of(part: usize) -> (usize, usize) {
    let (square, part) = (part / (SQUARE * SQUARE), part % (SQUARE * SQUARE));
    let (left, top) = (square % SQUARES * SQUARE + part % SQUARE, square / SQUARES * SQUARE + part / SQUARE);
    (left * PART, top * PART)
}

/// The part that a place of a tile lies in, and where there, row by row.
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
    /// The pixels, in parts of 4 x 4, each with its place in the tile (row by row, [`TILE`] a row). Four parts that follow
    /// each other are a square, too.
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
