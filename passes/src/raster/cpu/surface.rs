//! Hands out the pixels of a G-buffer tile by tile, so that several threads can draw tiles.
#![allow(unsafe_code, reason = "rectangles of one image are disjoint, which slices cannot express")]

use curitiba_pipeline::backend::{Attachments, GBuffer, Rect, drawn_part};
use rayon::prelude::*;
use std::marker::PhantomData;
use std::ops::Range;

/// Side of a tile, in pixels.
pub(super) const TILE: usize = 64;
// Pictures are split into parts only at the borders of tiles.
const _: () = assert!(TILE == curitiba_pipeline::gbuffer::ALIGNMENT as usize);

/// A viewport divided into tiles, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Grid {
    /// The viewport, in pixels of the target.
    pub viewport: Rect,
    /// Number of tiles in a row of tiles.
    pub columns: usize,
    /// Number of rows of tiles.
    pub rows: usize,
    /// Range of columns and of rows of the tiles that are drawn: all, unless the target is a part of the picture.
    pub drawn: [Range<usize>; 2],
}

impl Grid {
    /// The grid of a viewport, for a target that holds the rectangle `target` of the picture. `None` where the target
    /// holds nothing of the viewport, or does not end with whole tiles: the target's tiles would then differ from those
    /// of the whole viewport.
    pub fn new(viewport: Rect, target: Rect) -> Option<Self> {
        let tiles = |pixels: u32| (pixels as usize).div_ceil(TILE);
        let part = drawn_part(viewport, target)?;
        let columns = tiles(part.x)..tiles(part.x + part.width);
        let rows = tiles(part.y)..tiles(part.y + part.height);
        Some(Self { viewport, columns: tiles(viewport.width), rows: tiles(viewport.height), drawn: [columns, rows] })
    }

    /// Number of tiles of the viewport.
    pub fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Number of tiles that are drawn.
    pub fn drawn(&self) -> usize {
        self.drawn[0].len() * self.drawn[1].len()
    }
}

/// The writable attachments of one tile.
pub(super) struct TileSurface<'a> {
    /// Left column of the tile, relative to the viewport.
    pub x: usize,
    /// Top row of the tile, relative to the viewport.
    pub y: usize,
    /// Number of pixels in a row of the tile, at most [`TILE`].
    pub width: usize,
    /// Number of rows of the tile, at most [`TILE`].
    pub height: usize,
    color: Option<Plane<'a, [f32; 4]>>,
    position: Option<Plane<'a, [f32; 4]>>,
    normal: Option<Plane<'a, [f32; 4]>>,
    triangle: Option<Plane<'a, u32>>,
    depth: Option<Plane<'a, f32>>,
    left: Option<Plane<'a, f32>>,
}

/// The output of a draw.
pub(super) enum Target<'a> {
    /// Attachments of a G-buffer.
    Attachments(&'a mut GBuffer, Attachments),
    /// The depth of the nearest triangle only, 0 where there is none.
    Depth(&'a mut DepthMap),
}

impl Target<'_> {
    /// The rectangle of the picture that the target holds.
    pub fn held(&self) -> Rect {
        match self {
            Self::Attachments(buffer, _) => buffer.held(),
            Self::Depth(map) => Rect { x: 0, y: 0, width: map.size, height: map.size },
        }
    }
}

/// A square map of depths: 1 near, 0 far or empty.
#[derive(Debug, Default)]
pub(super) struct DepthMap {
    size: u32,
    depths: Vec<f32>,
}

impl DepthMap {
    /// Sets the number of texels along a side. The texels are undefined until a draw fills the map.
    pub fn resize(&mut self, size: u32) {
        self.size = size;
        self.depths.resize(size as usize * size as usize, 0.0);
    }

    /// The depths, top row first.
    pub fn depths(&self) -> &[f32] {
        &self.depths
    }
}

macro_rules! row_accessors {
    ($($name:ident: $pixel:ty),*) => {
        $(
            /// The tile's part of one row of this attachment; `None` if the attachment was not asked for.
            #[inline(always)]
            pub fn $name(&mut self, row: usize) -> Option<&mut [$pixel]> {
                assert!(row < self.height);
                let plane = self.$name.as_mut()?;
                // SAFETY: `row` is in the tile, and the tile is in the attachment (`for_each_tile` checks both).
                Some(unsafe { plane.row(row, self.width) })
            }
        )*
    };
}

impl TileSurface<'_> {
    row_accessors!(color: [f32; 4], position: [f32; 4], normal: [f32; 4], triangle: u32, depth: f32, left: f32);

    /// Whether the target is a depth map, whose texels are [`Self::depth`]. The depths of a G-buffer are [`Self::left`] instead.
    #[inline(always)]
    pub fn is_depth(&self) -> bool {
        self.depth.is_some()
    }
}

/// One attachment, seen from the top left pixel of a tile.
struct Plane<'a, T> {
    first: *mut T,
    stride: usize,
    pixels: PhantomData<&'a mut [T]>,
}

impl<T> Plane<'_, T> {
    /// # Safety
    /// The row and its width must be inside the tile.
    #[inline(always)]
    unsafe fn row(&mut self, row: usize, width: usize) -> &mut [T] {
        // SAFETY: the tile's pixels are inside the attachment, and no other tile has them. `self` is the tile's only
        // surface and is borrowed mutably, so no other reference to the pixels exists.
        unsafe { std::slice::from_raw_parts_mut(self.first.add(row * self.stride), width) }
    }
}

/// An attachment from which all threads can take their tiles.
struct Shared<T> {
    pixels: *mut T,
    stride: usize,
}

// SAFETY: the pointer is only used through `tile`, whose callers give each tile to one thread.
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Shared<T> {
    fn new(pixels: &mut Vec<T>, target: (usize, usize), wanted: bool) -> Option<Self> {
        wanted.then(|| {
            assert_eq!(pixels.len(), target.0 * target.1, "an attachment has the wrong size");
            Self { pixels: pixels.as_mut_ptr(), stride: target.0 }
        })
    }

    /// # Safety
    /// The pixel must be in the attachment, and no other `Plane` of the same tile and attachment may exist.
    unsafe fn tile<'a>(&self, x: usize, y: usize) -> Plane<'a, T> {
        // SAFETY: the pixel is in the attachment.
        Plane { first: unsafe { self.pixels.add(y * self.stride + x) }, stride: self.stride, pixels: PhantomData }
    }
}

/// Calls `draw` with every drawn tile of the grid, on all threads of the current pool. `draw` gets the tile's number
/// among the drawn tiles, its number in the viewport, and its pixels.
///
/// # Panics
/// If a tile is not inside the target or an attachment asked for has another size.
pub(super) fn for_each_tile(target: &mut Target<'_>, grid: &Grid, draw: impl Fn(usize, usize, TileSurface<'_>) + Sync) {
    let held = target.held();
    let size = (held.width as usize, held.height as usize);
    let Rect { x, y, width, height } = grid.viewport;
    let (width, height) = (width as usize, height as usize);
    let [columns, rows] = &grid.drawn;
    // Position of the viewport's corner relative to the target; negative if the target begins to its right or below.
    let (left, top) = (i64::from(x) - i64::from(held.x), i64::from(y) - i64::from(held.y));
    let inside = |start: i64, tiles: &Range<usize>, side: usize, room: usize| {
        let (first, last) = (start + (tiles.start * TILE) as i64, start + (tiles.end * TILE).min(side) as i64);
        tiles.is_empty() || (first >= 0 && last <= room as i64)
    };
    assert!(inside(left, columns, width, size.0) && inside(top, rows, height, size.1), "a tile is outside the target");
    assert!(columns.end <= grid.columns && rows.end <= grid.rows, "a tile is outside the viewport");
    let all = match target {
        Target::Attachments(target, attachments) => (
            Shared::new(&mut target.color, size, attachments.color),
            Shared::new(&mut target.position, size, attachments.position),
            Shared::new(&mut target.normal, size, attachments.normal),
            Shared::new(&mut target.triangle, size, attachments.triangle),
            None,
            {
                let held = !target.depth.is_empty();
                Shared::new(&mut target.depth, size, held)
            },
        ),
        Target::Depth(map) => (None, None, None, None, Shared::new(&mut map.depths, size, true), None),
    };
    let all = &all;
    (0..grid.drawn()).into_par_iter().with_max_len(1).for_each(|number| {
        let (column, row) = (columns.start + number % columns.len(), rows.start + number / columns.len());
        let (x, y) = (column * TILE, row * TILE);
        let (from_left, from_top) = ((left + x as i64) as usize, (top + y as i64) as usize);
        // SAFETY: the tile is in the target (asserted above, for the first and the last column and row); each number is
        // visited once and the tiles of different numbers are disjoint. `target` is borrowed for the whole call.
        let surface = unsafe {
            TileSurface {
                x,
                y,
                width: TILE.min(width - x),
                height: TILE.min(height - y),
                color: all.0.as_ref().map(|plane| plane.tile(from_left, from_top)),
                position: all.1.as_ref().map(|plane| plane.tile(from_left, from_top)),
                normal: all.2.as_ref().map(|plane| plane.tile(from_left, from_top)),
                triangle: all.3.as_ref().map(|plane| plane.tile(from_left, from_top)),
                depth: all.4.as_ref().map(|plane| plane.tile(from_left, from_top)),
                left: all.5.as_ref().map(|plane| plane.tile(from_left, from_top)),
            }
        };
        draw(number, row * grid.columns + column, surface);
    });
}
