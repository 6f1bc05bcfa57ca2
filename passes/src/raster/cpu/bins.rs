//! Sorts triangles into the tiles that they may cover.

use super::clip::{self, ClippedTriangle};
use super::frame::{Corners, Part};
use super::simd::Kernel;
use super::surface::{Grid, TILE};
use super::vertex::{Projection, ScreenVertex, UNITS};
use curitiba_pipeline::scene::Geometry;
use std::ops::Range;

/// Triangles whose bounding box touches more tiles go into one list for all tiles, which bounds the memory of a bin.
const MAX_TILES: usize = 16;

/// The parts of a run of triangles, sorted by tile.
#[derive(Debug, Default)]
pub(super) struct Bins {
    /// Sorted by tile; within a tile in the order of the triangles.
    parts: Vec<Part>,
    /// Tile `t` has `parts[starts[t]..starts[t + 1]]`.
    starts: Vec<u32>,
    /// Parts that may touch any tile, in the order of the triangles.
    pub large: Vec<Part>,
    unsorted: Vec<(u32, Part)>,
}

impl Bins {
    /// The parts that may cover a tile, except the large ones.
    #[inline(always)]
    pub fn of_tile(&self, tile: usize) -> &[Part] {
        &self.parts[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }

    fn clear(&mut self, tiles: usize) {
        self.large.clear();
        self.unsorted.clear();
        self.starts.clear();
        self.starts.resize(tiles + 1, 0);
    }

    #[inline(always)]
    fn push(&mut self, grid: &Grid, pixels: &Bounds, part: Part) {
        let (left, right) = (pixels.x.0 as usize / TILE, pixels.x.1 as usize / TILE);
        let (top, bottom) = (pixels.y.0 as usize / TILE, pixels.y.1 as usize / TILE);
        if (right - left + 1) * (bottom - top + 1) > MAX_TILES {
            self.large.push(part);
            return;
        }
        // Whether a part is large is decided over the whole viewport, so that a tile's result does not depend on which
        // other tiles are drawn.
        let [columns, rows] = &grid.drawn;
        for row in top.max(rows.start)..(bottom + 1).min(rows.end) {
            for column in left.max(columns.start)..(right + 1).min(columns.end) {
                let tile = row * grid.columns + column;
                self.unsorted.push((tile as u32, part));
                self.starts[tile + 1] += 1;
            }
        }
    }

    /// Counting sort by tile; it keeps the order within a tile.
    #[inline(always)]
    fn sort(&mut self) {
        let mut total = 0;
        for start in &mut self.starts[1..] {
            // Shifted by one tile: the scatter below advances each start to its end, which is the next tile's start.
            let count = *start;
            *start = total;
            total += count;
        }
        self.parts.clear();
        self.parts.resize(self.unsorted.len(), Part::NONE);
        for (tile, part) in &self.unsorted {
            let next = &mut self.starts[*tile as usize + 1];
            self.parts[*next as usize] = *part;
            *next += 1;
        }
    }
}

/// First and last column and row of the pixels whose centres are in a triangle's bounding box and in the viewport.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Bounds {
    pub x: (i32, i32),
    pub y: (i32, i32),
}

impl Bounds {
    /// The bounds within pixels `low..=high`; empty where a first is above its last.
    #[inline(always)]
    pub fn of([a, b, c]: &Corners<'_>, low: (i32, i32), high: (i32, i32)) -> Self {
        let first = |units: i32| (units + (UNITS / 2 - 1)) >> UNITS.trailing_zeros();
        let last = |units: i32| (units - UNITS / 2) >> UNITS.trailing_zeros();
        Self {
            x: (first(a.x().min(b.x()).min(c.x())).max(low.0), last(a.x().max(b.x()).max(c.x())).min(high.0)),
            y: (first(a.y().min(b.y()).min(c.y())).max(low.1), last(a.y().max(b.y()).max(c.y())).min(high.1)),
        }
    }

    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        (self.x.0 > self.x.1) | (self.y.0 > self.y.1)
    }
}

/// Twice the signed area of a triangle, in square units; above 0 where the corners appear clockwise.
#[inline(always)]
pub(super) fn doubled_area([a, b, c]: &Corners<'_>) -> i64 {
    i64::from(b.x() - a.x()) * i64::from(c.y() - a.y()) - i64::from(b.y() - a.y()) * i64::from(c.x() - a.x())
}

/// Fills the bins of a run of triangles.
pub(super) struct Fill<'a> {
    pub geometry: &'a Geometry,
    pub vertices: &'a [ScreenVertex],
    pub projection: &'a Projection,
    pub grid: &'a Grid,
    /// By material: whether its alpha is tested.
    pub cuts: &'a [bool],
    /// By material: whether it is left out; materials beyond the list are drawn.
    pub hidden: &'a [bool],
    /// By material: whether back faces are culled; those of materials beyond the list are not.
    pub culled: &'a [bool],
    pub triangles: Range<usize>,
    /// Index of the bin in the draw.
    pub index: usize,
    pub bins: &'a mut Bins,
    pub clipped: &'a mut Vec<ClippedTriangle>,
}

impl Kernel for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { geometry, grid, bins, clipped, .. } = self;
        bins.clear(grid.len());
        clipped.clear();
        let high = (grid.viewport.width as i32 - 1, grid.viewport.height as i32 - 1);
        let first_batch = geometry.batches.partition_point(|batch| {
            (batch.first as usize).saturating_add(batch.count as usize) <= self.triangles.start
        });
        for batch in &geometry.batches[first_batch..] {
            let start = (batch.first as usize).max(self.triangles.start);
            let end = (batch.first as usize).saturating_add(batch.count as usize).min(self.triangles.end);
            if batch.first as usize >= self.triangles.end {
                break;
            }
            if self.hidden.get(batch.material as usize) == Some(&true) {
                continue;
            }
            let cut = self.cuts[batch.material as usize];
            let culled = self.culled.get(batch.material as usize) == Some(&true);
            let is_seen = |corners: &Corners<'_>| match doubled_area(corners) {
                0 => false,
                area => area < 0 || !culled,
            };
            for (offset, indices) in geometry.triangles[start..end].iter().enumerate() {
                let triangle = (start + offset) as u32;
                let [a, b, c] = *indices;
                let corners = [&self.vertices[a as usize], &self.vertices[b as usize], &self.vertices[c as usize]];
                if corners.iter().any(|corner| corner.needs_clipping()) {
                    let positions = indices.map(|vertex| geometry.positions[vertex as usize]);
                    clip::clip(self.projection, triangle, positions, |part| {
                        let corners = part.corners.each_ref();
                        let pixels = Bounds::of(&corners, (0, 0), high);
                        // The last index of 16 bits is reserved: in the last bin it would be [`Part::NONE`]. A bin has at
                        // most 65,536 clipped parts, so at most one part is dropped.
                        let room = clipped.len() < usize::from(u16::MAX);
                        if room && !pixels.is_empty() && is_seen(&corners) {
                            bins.push(grid, &pixels, Part::clipped(self.index, clipped.len(), cut));
                            clipped.push(part);
                        }
                    });
                    continue;
                }
                let pixels = Bounds::of(&corners, (0, 0), high);
                if !pixels.is_empty() && is_seen(&corners) {
                    bins.push(grid, &pixels, Part::whole(triangle, cut));
                }
            }
        }
        bins.sort();
    }
}
