//! The visible triangle of each pixel of a tile.

use super::bins::{Bins, Bounds, doubled_area};
use super::frame::{Corners, Frame, Part};
use super::interpolate::is_solid;
use super::surface::{TILE, TileSurface};
use super::vertex::{ScreenVertex, UNITS};
use crate::trace::{higher, lower};

/// Lanes of a vector.
pub(super) const LANES: usize = 8;

/// Floats from one row of a tile's buffers to the next. Vectors that start in the last columns reach beyond the tile.
const STRIDE: usize = TILE + LANES;

/// Side of the blocks by which wide triangles are drawn, in pixels.
const BLOCK: usize = LANES;
const BLOCKS: usize = TILE / BLOCK;

/// Triangles with a wider bounding box, in pixels, are drawn block by block.
const NARROW: i32 = 2 * LANES as i32;

/// Depth and visible triangle of each pixel of a tile.
pub(super) struct Tile {
    /// Bits of non-negative 32-bit floats: as integers they compare in the same order.
    depth: Box<[i32; TILE * STRIDE]>,
    parts: Box<[u32; TILE * STRIDE]>,
    /// By block: a lower bound of the depths of its pixels.
    floor: [f32; BLOCKS * BLOCKS],
    empty: bool,
    /// Whether depths are those of planes through the snapped corners.
    snapped_depth: bool,
    /// The numbers 0 to 7. Read from memory, because the compiler would fold constants into single lanes and split the
    /// vectors.
    lanes: [i32; LANES],
    float_lanes: [f32; LANES],
}

impl Default for Tile {
    #[expect(clippy::large_stack_arrays, reason = "made once a worker, which then keeps them on the heap")]
    fn default() -> Self {
        Self {
            depth: Box::new([0; TILE * STRIDE]),
            parts: Box::new([Part::NONE.0; TILE * STRIDE]),
            floor: [0.0; BLOCKS * BLOCKS],
            empty: true,
            snapped_depth: false,
            lanes: std::array::from_fn(|lane| lane as i32),
            float_lanes: std::array::from_fn(|lane| lane as f32),
        }
    }
}

/// An edge function over pixels. A pixel is inside if `a * column + b * row + c >= 0`; pixels on a top or left edge are
/// inside, too.
///
/// In units of 1/256 pixel the edge function is `E = 256 (a column + b row) + C`, all integers. `E` divided by 256, with
/// `c = floor(C / 256)`, has the sign of `E`.
/// `|a|, |b| <= 7_340_032`, and columns and rows are below 72, so `|a column + b row| < 2^30`. Clamping `c` to `±2^30`
/// keeps the sign, too, and keeps the sum within 32 bits.
#[derive(Debug, Clone, Copy)]
struct Edge {
    a: i32,
    b: i32,
    c: i32,
}

impl Edge {
    /// The edge from one corner to the next, clockwise. Columns and rows count from pixel (x, y).
    #[inline(always)]
    fn new(from: &ScreenVertex, to: &ScreenVertex, x: i32, y: i32) -> Self {
        const LIMIT: i64 = 1 << 30;
        let (a, b) = (from.y() - to.y(), to.x() - from.x());
        // A left edge goes up, and a top edge goes to the right.
        let closed = a > 0 || (a == 0 && b > 0);
        let (dx, dy) = (x * UNITS + UNITS / 2 - from.x(), y * UNITS + UNITS / 2 - from.y());
        let value = i64::from(a) * i64::from(dx) + i64::from(b) * i64::from(dy) - i64::from(!closed);
        Self { a, b, c: (value >> UNITS.trailing_zeros()).clamp(-LIMIT, LIMIT) as i32 }
    }

    #[inline(always)]
    fn at(&self, column: i32, row: i32) -> i32 {
        self.c.wrapping_add(self.a.wrapping_mul(column)).wrapping_add(self.b.wrapping_mul(row))
    }
}

/// Depth over pixels: `((z + dy * row) + dx * column) + dx * lane`, clamped to the corners' depths. `column` is that of
/// a vector's first lane.
///
/// Rounding is monotone, so over a block the largest computed depth is at one of its corners, exactly.
///
/// The plane goes through the corners before they were snapped. Snapping moves a corner by up to half a unit, so a plane
/// through the snapped corners has a different slope, and might show the farther of two layers. Slivers
/// whose orientation snapping reversed, or whose area it changed by a factor of two or more, have no reliable slope:
/// their plane goes through the snapped corners. With `snapped_depth` the plane of every triangle does.
#[derive(Debug, Clone, Copy)]
struct Depth {
    z: f32,
    dx: f32,
    dy: f32,
    low: f32,
    high: f32,
}

impl Depth {
    #[inline(always)]
    fn new([v0, v1, v2]: &Corners<'_>, area: i64, (x, y): (i32, i32), snapped_depth: bool) -> Self {
        let snapped = |v: &ScreenVertex| [f64::from(v.x()), f64::from(v.y())];
        let (mut p0, mut p1, mut p2) = (v0.place(), v1.place(), v2.place());
        let mut doubled = (p1[0] - p0[0]) * (p2[1] - p0[1]) - (p1[1] - p0[1]) * (p2[0] - p0[0]);
        let area = area as f64;
        if snapped_depth || !(doubled > 0.5 * area && doubled < 2.0 * area) {
            (p0, p1, p2, doubled) = (snapped(v0), snapped(v1), snapped(v2), area);
        }
        let scale = 1.0 / doubled;
        let (dz1, dz2) = (f64::from(v1.z) - f64::from(v0.z), f64::from(v2.z) - f64::from(v0.z));
        let across = ((p2[1] - p0[1]) * dz1 - (p1[1] - p0[1]) * dz2) * scale;
        let down = ((p1[0] - p0[0]) * dz2 - (p2[0] - p0[0]) * dz1) * scale;
        let (from_x, from_y) = (f64::from(x * UNITS + UNITS / 2) - p0[0], f64::from(y * UNITS + UNITS / 2) - p0[1]);
        Self {
            z: (f64::from(v0.z) + across * from_x + down * from_y) as f32,
            dx: (across * f64::from(UNITS)) as f32,
            dy: (down * f64::from(UNITS)) as f32,
            // 0 instead of -0, whose bits would compare wrongly.
            low: higher(lower(lower(v0.z, v1.z), v2.z), 0.0),
            high: higher(higher(v0.z, v1.z), v2.z),
        }
    }

    /// Depth at a vector's first lane.
    #[inline(always)]
    fn at(&self, column: i32, row: i32) -> f32 {
        (self.z + self.dy * row as f32) + self.dx * column as f32
    }

    #[inline(always)]
    fn clamp(&self, z: f32) -> f32 {
        higher(lower(z, self.high), self.low)
    }

    /// The greatest depth in a block.
    #[inline(always)]
    fn highest(&self, column: i32, row: i32) -> f32 {
        let last = BLOCK as i32 - 1;
        let left = self.at(column, if self.dy > 0.0 { row + last } else { row });
        self.clamp(left + higher(self.dx * last as f32, 0.0))
    }
}

impl Tile {
    /// The multiples 0 to 7 of a step, one for each lane.
    #[inline(always)]
    fn multiples(&self, step: i32) -> [i32; LANES] {
        let mut multiples = [0; LANES];
        for (multiple, lane) in multiples.iter_mut().zip(&self.lanes) {
            *multiple = step.wrapping_mul(*lane);
        }
        multiples
    }

    #[inline(always)]
    fn float_multiples(&self, step: f32) -> [f32; LANES] {
        let mut multiples = [0.0; LANES];
        for (multiple, lane) in multiples.iter_mut().zip(&self.float_lanes) {
            *multiple = step * lane;
        }
        multiples
    }

    /// Clears the tile.
    #[inline(always)]
    pub fn clear(&mut self) {
        if !self.empty {
            self.depth.fill(0);
            self.parts.fill(Part::NONE.0);
            self.floor.fill(0.0);
            self.empty = true;
        }
    }

    /// Loads the depths of a row, from the left, into a cleared tile. Pixels with loaded depths have no part.
    pub fn load_depths(&mut self, row: usize, depths: &[f32]) {
        for (stored, depth) in self.depth[row * STRIDE..].iter_mut().zip(depths) {
            *stored = depth.to_bits() as i32;
        }
        self.empty = false;
    }

    /// Tests the depth of something other than a triangle, such as a sphere, at a pixel. If it is nearer than the stored depth, or the pixel
    /// is empty, stores the depth without a part, and returns true.
    pub fn cover(&mut self, column: usize, row: usize, depth: f32) -> bool {
        let (at, bits) = (row * STRIDE + column, depth.to_bits() as i32);
        let nearer = bits > self.depth[at] || self.depth[at] == 0 && self.parts[at] == Part::NONE.0;
        if nearer {
            (self.depth[at], self.parts[at], self.empty) = (bits, Part::NONE.0, false);
        }
        nearer
    }

    /// The visible parts in a row, [`Part::NONE`] where there is none. `None` if the whole tile is empty.
    #[inline(always)]
    pub fn row(&self, row: usize) -> Option<&[u32; TILE]> {
        if self.empty {
            return None;
        }
        self.parts[row * STRIDE..][..TILE].first_chunk()
    }

    /// The depths of a row as the bits of floats, 0 where there is nothing. `None` if the whole tile is empty.
    #[inline(always)]
    pub fn depths(&self, row: usize) -> Option<&[i32; TILE]> {
        if self.empty {
            return None;
        }
        self.depth[row * STRIDE..][..TILE].first_chunk()
    }

    /// Draws the parts that the bins hold for this tile, in the order of the triangles.
    #[inline(always)]
    pub fn draw_bins(&mut self, frame: &Frame<'_>, bins: &Bins, tile: usize, surface: &TileSurface<'_>) {
        self.snapped_depth = frame.job.snapped_depth;
        let parts = bins.of_tile(tile);
        let mut large = bins.large.as_slice();
        if large.is_empty() {
            for part in parts {
                self.draw(frame, *part, surface);
            }
            return;
        }
        for part in parts {
            let triangle = frame.triangle_of(*part);
            while let Some((first, rest)) =
                large.split_first().filter(|(first, _)| frame.triangle_of(**first) < triangle)
            {
                self.draw(frame, *first, surface);
                large = rest;
            }
            self.draw(frame, *part, surface);
        }
        for part in large {
            self.draw(frame, *part, surface);
        }
    }

    #[inline(always)]
    fn draw(&mut self, frame: &Frame<'_>, part: Part, surface: &TileSurface<'_>) {
        let placed = frame.place(part);
        let (left, top) = (surface.x as i32, surface.y as i32);
        let high = (left + surface.width as i32 - 1, top + surface.height as i32 - 1);
        let bounds = Bounds::of(&placed.corners, (left, top), high);
        if bounds.is_empty() {
            return;
        }
        let mut corners = placed.corners;
        let mut area = doubled_area(&corners);
        if area < 0 {
            corners.swap(1, 2);
            area = -area;
        }
        self.empty = false;
        let local = Bounds { x: (bounds.x.0 - left, bounds.x.1 - left), y: (bounds.y.0 - top, bounds.y.1 - top) };
        if part.is_cut() {
            self.draw_rows(&corners, area, &bounds, &local, |column, row| {
                if is_solid(frame, &placed, left + column, top + row) { Some(part.0) } else { None }
            });
        } else if bounds.x.1 - bounds.x.0 < NARROW {
            self.draw_narrow(&corners, area, &bounds, &local, part.0);
        } else {
            self.draw_blocks(&corners, area, &bounds, &local, part.0);
        }
    }

    /// Draws a narrow triangle row by row, in vectors that start at the left end of the bounds.
    #[inline(always)]
    fn draw_narrow(&mut self, corners: &Corners<'_>, area: i64, bounds: &Bounds, local: &Bounds, part: u32) {
        let (x, y) = (bounds.x.0, bounds.y.0);
        let [e0, e1, e2] = edges(corners, x, y);
        let depth = Depth::new(corners, area, (x, y), self.snapped_depth);
        let across = [self.multiples(e0.a), self.multiples(e1.a), self.multiples(e2.a)];
        let across_z = self.float_multiples(depth.dx);
        for row in 0..=local.y.1 - local.y.0 {
            let mut column = 0;
            while column <= local.x.1 - local.x.0 {
                let offset = (local.y.0 + row) as usize * STRIDE + (local.x.0 + column) as usize;
                let start = [e0.at(column, row), e1.at(column, row), e2.at(column, row)];
                let z = depth.at(column, row);
                self.write_vector(offset, start, &across, z, &across_z, &depth, part);
                column += LANES as i32;
            }
        }
    }

    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the innermost loop's registers")]
    fn write_vector(
        &mut self,
        offset: usize,
        start: [i32; 3],
        across: &[[i32; LANES]; 3],
        z: f32,
        across_z: &[f32; LANES],
        depth: &Depth,
        part: u32,
    ) {
        let stored: &mut [i32; LANES] = (&mut self.depth[offset..offset + LANES]).try_into().expect("as many as lanes");
        let parts: &mut [u32; LANES] = (&mut self.parts[offset..offset + LANES]).try_into().expect("as many as lanes");
        // Everything is read before anything is written, and masks replace branches, so that the compiler vectorises
        // the loop.
        let (old_depth, old_parts) = (*stored, *parts);
        let (mut new_depth, mut new_parts) = ([0; LANES], [0; LANES]);
        for lane in 0..LANES {
            let inside = start[0].wrapping_add(across[0][lane])
                | start[1].wrapping_add(across[1][lane])
                | start[2].wrapping_add(across[2][lane]);
            let z = depth.clamp(z + across_z[lane]).to_bits() as i32;
            // Negative (all bits set) where the pixel is outside an edge or not nearer than the stored depth.
            let keep = (inside | z.wrapping_sub(old_depth[lane]).wrapping_sub(1)) >> 31;
            new_depth[lane] = (old_depth[lane] & keep) | (z & !keep);
            new_parts[lane] = (old_parts[lane] & keep as u32) | (part & !(keep as u32));
        }
        (*stored, *parts) = (new_depth, new_parts);
    }

    /// Draws a wide triangle block by block. Skips blocks that are outside an edge, or whose pixels already hold nearer depths.
    #[inline(always)]
    fn draw_blocks(&mut self, corners: &Corners<'_>, area: i64, bounds: &Bounds, local: &Bounds, part: u32) {
        let size = BLOCK as i32;
        let (first_column, first_row) = (local.x.0 & -size, local.y.0 & -size);
        let (x, y) = (bounds.x.0 - local.x.0 + first_column, bounds.y.0 - local.y.0 + first_row);
        let edges = edges(corners, x, y);
        let depth = Depth::new(corners, area, (x, y), self.snapped_depth);
        let across = [self.multiples(edges[0].a), self.multiples(edges[1].a), self.multiples(edges[2].a)];
        let across_z = self.float_multiples(depth.dx);
        // Change of each edge function from a block's first pixel to the pixel farthest inside the edge, and to the one
        // farthest outside.
        let inner = edges.map(|edge| (edge.a.max(0) + edge.b.max(0)) * (size - 1));
        let outer = edges.map(|edge| (edge.a.min(0) + edge.b.min(0)) * (size - 1));
        for row in (0..=local.y.1 - first_row).step_by(BLOCK) {
            for column in (0..=local.x.1 - first_column).step_by(BLOCK) {
                let start = edges.map(|edge| edge.at(column, row));
                if (0..3).any(|edge| start[edge].wrapping_add(inner[edge]) < 0) {
                    continue;
                }
                let block = ((first_row + row) / size) as usize * BLOCKS + ((first_column + column) / size) as usize;
                if depth.highest(column, row) <= self.floor[block] {
                    continue;
                }
                for line in 0..size {
                    let offset = (first_row + row + line) as usize * STRIDE + (first_column + column) as usize;
                    let start = [0, 1, 2].map(|edge| start[edge].wrapping_add(edges[edge].b.wrapping_mul(line)));
                    let z = depth.at(column, row + line);
                    self.write_vector(offset, start, &across, z, &across_z, &depth, part);
                }
                if (0..3).all(|edge| start[edge].wrapping_add(outer[edge]) >= 0) {
                    self.raise_floor(block);
                }
            }
        }
    }

    #[inline(always)]
    fn raise_floor(&mut self, block: usize) {
        let first = block / BLOCKS * BLOCK * STRIDE + block % BLOCKS * BLOCK;
        let mut lowest = [i32::MAX; LANES];
        for row in 0..BLOCK {
            let offset = first + row * STRIDE;
            for (lowest, depth) in lowest.iter_mut().zip(&self.depth[offset..offset + BLOCK]) {
                *lowest = (*depth).min(*lowest);
            }
        }
        self.floor[block] = f32::from_bits(lowest.into_iter().fold(i32::MAX, i32::min) as u32);
    }

    /// Draws an alpha-tested triangle pixel by pixel. At each pixel that passes the depth test, the alpha test `part` decides
    /// whether there is a surface; `None` leaves the pixel as it is.
    #[inline(always)]
    fn draw_rows(
        &mut self,
        corners: &Corners<'_>,
        area: i64,
        bounds: &Bounds,
        local: &Bounds,
        part: impl Fn(i32, i32) -> Option<u32>,
    ) {
        let wide = bounds.x.1 - bounds.x.0 >= NARROW;
        // Vectors aligned as for an opaque triangle, so that the same triangle gets the same depths.
        let align = |first: i32| if wide { first & -(BLOCK as i32) } else { first };
        let (first_column, first_row) = (align(local.x.0), align(local.y.0));
        let (x, y) = (bounds.x.0 - local.x.0 + first_column, bounds.y.0 - local.y.0 + first_row);
        let edges = edges(corners, x, y);
        let depth = Depth::new(corners, area, (x, y), self.snapped_depth);
        let across = self.float_multiples(depth.dx);
        for y in local.y.0..=local.y.1 {
            for x in local.x.0..=local.x.1 {
                let (column, row) = (x - first_column, y - first_row);
                if edges.iter().any(|edge| edge.at(column, row) < 0) {
                    continue;
                }
                let offset = y as usize * STRIDE + x as usize;
                let lane = column as usize % LANES;
                let z = depth.clamp(depth.at(column - lane as i32, row) + across[lane]).to_bits() as i32;
                if z > self.depth[offset]
                    && let Some(part) = part(x, y)
                {
                    self.depth[offset] = z;
                    self.parts[offset] = part;
                }
            }
        }
    }
}

#[inline(always)]
fn edges([a, b, c]: &Corners<'_>, x: i32, y: i32) -> [Edge; 3] {
    [Edge::new(a, b, x, y), Edge::new(b, c, x, y), Edge::new(c, a, x, y)]
}
