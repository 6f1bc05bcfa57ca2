//! Parts of triangles, and the inputs of the stage that draws tiles.

use super::clip::ClippedTriangle;
use super::vertex::ScreenVertex;
use curitiba_pipeline::backend::RasterJob;
use curitiba_pipeline::scene::Geometry;

/// Greatest number of triangles in one [`bin`](super::bins::Bins).
pub(super) const BIN_TRIANGLES: usize = 8192;

/// Greatest number of triangles in a scene, limited by the bits of [`Part`].
pub(super) const MAX_TRIANGLES: usize = BIN_TRIANGLES << 14;

/// A part of a triangle that is drawn, in 32 bits: the whole triangle, or one of the parts that remain after clipping.
///
/// Bit 31 marks a clipped part: bits 16..30 are the bin that clipped it, and bits 0..16 its index in that bin. For a
/// whole triangle, bits 0..30 are the triangle. Bit 30 marks parts whose alpha is tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Part(pub u32);

impl Part {
    const CLIPPED: u32 = 1 << 31;
    const CUT: u32 = 1 << 30;
    /// No part.
    pub const NONE: Self = Self(u32::MAX);

    pub fn whole(triangle: u32, cut: bool) -> Self {
        debug_assert!(triangle < Self::CUT);
        Self(triangle | if cut { Self::CUT } else { 0 })
    }

    pub fn clipped(bin: usize, index: usize, cut: bool) -> Self {
        debug_assert!(bin < 1 << 14 && index < 1 << 16);
        Self(Self::CLIPPED | (bin as u32) << 16 | index as u32 | if cut { Self::CUT } else { 0 })
    }

    #[inline(always)]
    pub fn is_cut(self) -> bool {
        self.0 & Self::CUT != 0
    }

    /// The index of a whole triangle; for a clipped part, its bin and its index in that bin as the error.
    #[inline(always)]
    fn decode(self) -> Result<u32, (usize, usize)> {
        let value = self.0 & !Self::CUT;
        if value & Self::CLIPPED == 0 {
            Ok(value)
        } else {
            Err(((value >> 16 & 0x3fff) as usize, (value & 0xffff) as usize))
        }
    }
}

/// The inputs of one draw.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    pub job: &'a RasterJob<'a>,
    pub geometry: &'a Geometry,
    /// The scene's vertices on the screen, one for each position.
    pub vertices: &'a [ScreenVertex],
    /// The clipped parts of each bin, a run of consecutive triangles. Bins are numbered through all rounds of the draw; those of later rounds are
    /// not filled yet.
    pub clipped: &'a [Vec<ClippedTriangle>],
}

/// The corners of a triangle as references: copies would go through the stack.
pub(super) type Corners<'a> = [&'a ScreenVertex; 3];

/// A part of a triangle on the screen.
pub(super) struct Placed<'a> {
    pub corners: Corners<'a>,
    pub triangle: u32,
    /// The clipped part to which `corners` belong; `None` for a whole triangle.
    pub clipped: Option<&'a ClippedTriangle>,
}

impl<'a> Frame<'a> {
    #[inline(always)]
    pub fn place(&self, part: Part) -> Placed<'a> {
        match part.decode() {
            Ok(triangle) => {
                let [a, b, c] = self.geometry.triangles[triangle as usize];
                let corners = [&self.vertices[a as usize], &self.vertices[b as usize], &self.vertices[c as usize]];
                Placed { corners, triangle, clipped: None }
            }
            Err((bin, index)) => {
                let clipped = &self.clipped[bin][index];
                let [a, b, c] = &clipped.corners;
                Placed { corners: [a, b, c], triangle: clipped.triangle, clipped: Some(clipped) }
            }
        }
    }

    #[inline(always)]
    pub fn triangle_of(&self, part: Part) -> u32 {
        match part.decode() {
            Ok(triangle) => triangle,
            Err((bin, index)) => self.clipped[bin][index].triangle,
        }
    }
}
