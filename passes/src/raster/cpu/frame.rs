//! What all stages of one draw read.

use super::clip::ClippedTriangle;
use super::vertex::ScreenVertex;
use curitiba_pipeline::backend::RasterJob;
use curitiba_pipeline::scene::Geometry;

/// Triangles that one [`bin`](super::bins::Bins) holds at most.
pub(super) const BIN_TRIANGLES: usize = 8192;

/// Most triangles of a scene: what [`Part`] can name.
pub(super) const MAX_TRIANGLES: usize = BIN_TRIANGLES << 14;

/// A drawn part of a triangle in 32 bits: the triangle itself, or one of the parts that clipping left of it.
///
/// Bit 31: a part (bits 16..30 say which bin clipped it, 0..16 which of its parts it is); else bits 0..30 are the triangle.
/// Bit 30: its texture's alpha decides where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Part(pub u32);

impl Part {
    const CLIPPED: u32 = 1 << 31;
    const CUT: u32 = 1 << 30;
    /// Nothing.
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

    /// Bin and index of a clipped part, or else the triangle.
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

/// One draw.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    pub job: &'a RasterJob<'a>,
    pub geometry: &'a Geometry,
    /// As many as positions.
    pub vertices: &'a [ScreenVertex],
    /// By bin of the whole draw.
    pub clipped: &'a [Vec<ClippedTriangle>],
}

/// The corners of a triangle, where they lie in memory: copies would go through the stack.
pub(super) type Corners<'a> = [&'a ScreenVertex; 3];

/// Where a part of a triangle is on the screen.
pub(super) struct Placed<'a> {
    pub corners: Corners<'a>,
    pub triangle: u32,
    /// Set if `corners` are not the triangle's own.
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
