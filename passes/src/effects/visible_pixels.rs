//! The pixels of a tile that show a triangle or sphere and that a program wants. They are read sixteen at a time.

use super::coverage::Coverage;
use super::pass::{Pass, Pixel};
use super::tile::{Area, TILE};
use crate::trace::{PACKET, Simd, Tracer};

/// Pixels of a tile.
const PIXELS: usize = TILE * TILE;
/// Stored positions in a cache line.
const PIXELS_A_LINE: usize = 4;

/// Pixels of a tile that show a triangle, as a structure of arrays.
#[derive(Debug)]
pub(super) struct VisiblePixels {
    places: [u8; PIXELS],
    /// Index in the image.
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
    /// Finds the wanted pixels of a tile: those with a triangle id for which `wanted` is true.
    ///
    /// Meanwhile prefetches positions and triangles of the next tile. For each cache line of positions of the next tile, `fetch` gets the index of
    /// one pixel, to prefetch more. The rows of a tile are short and too far apart for the processor's own prefetcher.
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

    /// Forgets the previous pass: the next may have a smaller picture or another scene.
    pub(super) fn forget(&mut self) {
        self.count = 0;
        self.pixels.fill(0);
        self.triangles.fill(0);
    }

    /// Forgets the pixels of the previous tile.
    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// For each pixel its place in the tile, its index in the image, and its triangle.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, usize, u32)> {
        let pixels = self.places.iter().zip(&self.pixels).zip(&self.triangles).take(self.count);
        pixels.map(|((place, pixel), triangle)| (usize::from(*place), *pixel as usize, *triangle))
    }

    /// Adds a pixel: its place in the tile, its index in the image, and its triangle.
    ///
    /// # Panics
    /// If the list already holds all pixels of a tile.
    pub(super) fn push(&mut self, place: usize, pixel: usize, triangle: u32) {
        self.places[self.count] = place as u8;
        self.pixels[self.count] = pixel as u32;
        self.triangles[self.count] = triangle;
        self.count += 1;
    }

    /// All pixels found, sixteen at a time. Unused lanes of the last sixteen hold pixels found before (here or in
    /// another tile of the pass), or else pixel 0 and triangle 0.
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

/// The sixteen entries of a list that start at `first`, a multiple of sixteen.
#[inline(always)]
fn chunk<V>(list: &[V; PIXELS], first: usize) -> &[V; PACKET] {
    let (chunks, _) = list.as_chunks();
    &chunks[first / PACKET]
}

/// Sixteen pixels.
pub(super) struct Sixteen<'a> {
    pub(super) places: &'a [u8; PACKET],
    /// Index in the image.
    pub(super) pixels: &'a [u32; PACKET],
    pub(super) triangles: &'a [u32; PACKET],
    /// One bit a lane: lanes that hold a pixel.
    pub(super) used: u16,
}
