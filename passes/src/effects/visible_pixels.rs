//! The visible pixels of a tile: those that show a triangle which a program asks about, sixteen at a time.

use super::coverage::Coverage;
use super::pass::{Pass, Pixel};
use super::tile::{Area, TILE};
use crate::trace::{PACKET, Simd, Tracer};

/// Pixels of a tile.
const PIXELS: usize = TILE * TILE;
/// Stored positions in a line of the cache.
const PIXELS_A_LINE: usize = 4;

/// Pixels of a tile that show a triangle, structure of arrays.
#[derive(Debug)]
pub(super) struct VisiblePixels {
    places: [u8; PIXELS],
    /// By pixel of the image.
    pixels: [u32; PIXELS],
    triangles: [u32; PIXELS],
    count: usize,
}

impl Default for VisiblePixels {
    fn default() -> Self {
        Self { places: [0; PIXELS], pixels: [0; PIXELS], triangles: [0; PIXELS], count: 0 }
    }
}

impl VisiblePixels {
    /// Finds those that are wanted.
    ///
    /// Positions and triangles of the next tile are fetched meanwhile, and what `fetch` names for a pixel of it and those in its
    /// line: the short rows of a tile are too far apart for the processor to expect them.
    #[inline(always)]
    pub(super) fn collect<S: Simd, T: Tracer, C: Coverage>(
        &mut self,
        simd: S,
        (pass, area): (&Pass<'_, T, C>, Area),
        wanted: impl Fn(Pixel, u32) -> bool,
        fetch: impl Fn(usize),
    ) {
        let mut count = 0;
        for (place, pixel) in area.pixels() {
            let next = pixel.index + TILE;
            if place.is_multiple_of(PIXELS_A_LINE)
                && let Some(position) = pass.job.position.get(next)
            {
                simd.prefetch(position);
                simd.prefetch(&pass.job.triangle[next]);
                fetch(next);
            }
            let Some(triangle) = pass.triangle(pixel).filter(|triangle| wanted(pixel, *triangle)) else { continue };
            self.places[count] = place as u8;
            self.pixels[count] = pixel.index as u32;
            self.triangles[count] = triangle;
            count += 1;
        }
        self.count = count;
    }

    /// Forgets the pass before: the next may be of a smaller picture, or of another scene.
    pub(super) fn forget(&mut self) {
        self.count = 0;
        self.pixels.fill(0);
        self.triangles.fill(0);
    }

    /// Forgets all pixels of the tile before.
    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Their places in the tile, their pixels of the image, and their triangles.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, usize, u32)> {
        let pixels = self.places.iter().zip(&self.pixels).zip(&self.triangles).take(self.count);
        pixels.map(|((place, pixel), triangle)| (usize::from(*place), *pixel as usize, *triangle))
    }

    /// Adds a pixel: its place in the tile, the pixel of the image, and the triangle.
    ///
    /// # Panics
    /// If all pixels of a tile are there.
    pub(super) fn push(&mut self, place: usize, pixel: usize, triangle: u32) {
        self.places[self.count] = place as u8;
        self.pixels[self.count] = pixel as u32;
        self.triangles[self.count] = triangle;
        self.count += 1;
    }

    /// All that were found. What the last sixteen lack are pixels that were found before, here or in another tile of the pass, or the
    /// first pixel and triangle.
    #[inline(always)]
    pub(super) fn sixteens(&self) -> impl Iterator<Item = Sixteen<'_>> {
        (0..self.count).step_by(PACKET).map(|first| Sixteen {
            places: chunk(&self.places, first),
            pixels: chunk(&self.pixels, first),
            triangles: chunk(&self.triangles, first),
            used: u16::MAX >> (PACKET - PACKET.min(self.count - first)),
        })
    }
}

/// Some of a list that is a multiple of sixteen long.
#[inline(always)]
fn chunk<V>(list: &[V; PIXELS], first: usize) -> &[V; PACKET] {
    let (chunks, _) = list.as_chunks();
    &chunks[first / PACKET]
}

/// Sixteen pixels.
pub(super) struct Sixteen<'a> {
    pub(super) places: &'a [u8; PACKET],
    /// By pixel of the image.
    pub(super) pixels: &'a [u32; PACKET],
    pub(super) triangles: &'a [u32; PACKET],
    /// One bit a pixel: those that were found.
    pub(super) used: u16,
}
