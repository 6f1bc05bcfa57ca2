//! World to screen: projection, viewport mapping and snapping.

use super::simd::Kernel;
use curitiba_pipeline::backend::{Rect, View};
use glam::{Vec3, Vec4};

/// Sub-pixel units in a pixel.
pub(super) const UNITS: i32 = 256;

/// Fractions into which a sub-pixel unit is divided to store a corner's place before snapping. This is the full precision of an
/// `f32` coordinate in a picture of 1024 pixels.
pub(super) const FINE: i32 = 64;

/// Greatest side of a viewport, in pixels.
pub(super) const MAX_SIDE: u32 = 16384;

/// Corners lie at most this many pixels from the viewport's centre. Then differences of coordinates, in sub-pixels, are at most
/// `2 * 14336 * 256 = 7_340_032`, and an edge function over a tile, in steps of pixels, is below 2^31 (see `Edge`).
const GUARD: u32 = 14336;

/// Value of `fine_x` for a vertex that lies outside the clipping planes: triangles that use the vertex are clipped.
const NEEDS_CLIPPING: i32 = i32::MIN;

/// A homogeneous `w` outside this range counts as on the eye's plane or at infinity. Inside the range nothing
/// overflows.
const W_RANGE: std::ops::RangeInclusive<f32> = 7.888_609e-31..=1.267_650_6e30;

/// A corner on the screen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(16))]
pub(super) struct ScreenVertex {
    /// Distance from the viewport's left border, in 1/64 of 1/256 pixel, or [`NEEDS_CLIPPING`]. [`Self::x`] is the
    /// snapped value.
    fine_x: i32,
    /// Distance from the viewport's top border, in the same unit.
    fine_y: i32,
    /// Depth, 1 near, 0 far.
    pub z: f32,
    /// Reciprocal of the homogeneous `w`.
    pub inv_w: f32,
}

impl ScreenVertex {
    /// Snapped distance from the viewport's left border, in 1/256 pixel.
    #[inline(always)]
    pub fn x(&self) -> i32 {
        snapped(self.fine_x)
    }

    /// Snapped distance from the viewport's top border, in 1/256 pixel.
    #[inline(always)]
    pub fn y(&self) -> i32 {
        snapped(self.fine_y)
    }

    /// The place in 1/64 of 1/256 pixel, after snapping if `snapped`, else before.
    #[inline(always)]
    pub fn fine(&self, snapped: bool) -> [i32; 2] {
        if snapped { [self.x() * FINE, self.y() * FINE] } else { [self.fine_x, self.fine_y] }
    }

    /// The place before snapping, in 1/256 pixel. At this place the depth of the triangle's plane is [`Self::z`].
    #[inline(always)]
    pub fn place(&self) -> [f64; 2] {
        [self.fine_x, self.fine_y].map(|fine| f64::from(fine) * (1.0 / f64::from(FINE)))
    }

    /// Whether triangles that use this vertex must be clipped.
    #[inline(always)]
    pub fn needs_clipping(&self) -> bool {
        self.fine_x == NEEDS_CLIPPING
    }
}

#[inline(always)]
fn snapped(fine: i32) -> i32 {
    fine.wrapping_add(FINE / 2) >> FINE.trailing_zeros()
}

/// The mapping from world positions to a viewport.
#[derive(Debug, Clone, Copy)]
pub(super) struct Projection {
    columns: [[f32; 4]; 4],
    /// Subtracted from positions before the matrix is applied.
    eye: Vec3,
    left: f32,
    top: f32,
    width: f32,
    height: f32,
    origin: [i64; 2],
    /// Greatest `|x / w|` and `|y / w|`; powers of two, so that the clipper's planes and [`Self::inside`] agree exactly.
    pub guard: [f32; 2],
    /// [`View::clip_plane`].
    pub plane: Option<Vec4>,
}

impl Projection {
    /// The viewport's sides must be in `1..=MAX_SIDE`.
    pub fn new(view: &View, viewport: Rect) -> Self {
        let guard = |side: u32| (1u32 << (2 * GUARD / side).ilog2()) as f32;
        let (matrix, eye) = view.projection();
        Self {
            columns: matrix.to_cols_array_2d(),
            eye,
            left: viewport.x as f32,
            top: viewport.y as f32,
            width: viewport.width as f32,
            height: viewport.height as f32,
            origin: [viewport.x, viewport.y].map(|pixels| i64::from(pixels) * i64::from(UNITS)),
            guard: [guard(viewport.width), guard(viewport.height)],
            plane: view.clip_plane,
        }
    }

    /// Clip coordinates of a world position.
    #[inline(always)]
    pub fn clip(&self, p: Vec3) -> [f32; 4] {
        let ([a, b, c, d], p) = (&self.columns, p - self.eye);
        std::array::from_fn(|row| a[row] * p.x + b[row] * p.y + c[row] * p.z + d[row])
    }

    /// Signed distance of a world position from a plane such as [`Self::plane`]: below 0 behind it.
    #[inline(always)]
    pub fn above(&self, plane: Vec4, p: Vec3) -> f32 {
        let p = p - self.eye;
        plane.x * p.x + plane.y * p.y + plane.z * p.z + plane.w
    }

    /// Whether a vertex with these clip coordinates needs no clipping, unless it lies behind [`Self::plane`].
    #[inline(always)]
    pub fn inside(&self, [x, y, z, w]: [f32; 4]) -> bool {
        (z >= 0.0)
            & (z <= w)
            & (x.abs() <= self.guard[0] * w)
            & (y.abs() <= self.guard[1] * w)
            & (w >= *W_RANGE.start())
            & (w <= *W_RANGE.end())
    }

    /// Screen coordinates of a vertex that is [inside](Self::inside), or on the border of that region, as corners of the clipper
    /// are.
    #[inline(always)]
    pub fn screen(&self, [x, y, z, w]: [f32; 4]) -> ScreenVertex {
        let inv_w = 1.0 / w;
        let x = self.left + (x * inv_w * 0.5 + 0.5) * self.width;
        let y = self.top + (0.5 - y * inv_w * 0.5) * self.height;
        ScreenVertex { fine_x: snap(x, self.origin[0]), fine_y: snap(y, self.origin[1]), z: z * inv_w, inv_w }
    }
}

/// A screen coordinate relative to `origin`, in 1/64 unit. It is clamped so that `snapped` turns it into the nearest whole
/// unit (ties to even). `|pixels - origin| < 2^15`, so the result is below 2^29.
///
/// Adding 1.5 * 2^52 leaves the rounded integer in the low bits of the sum; unlike a rounding instruction and a checked
/// conversion this is two vector operations on every instruction set.
#[inline(always)]
fn snap(pixels: f32, origin: i64) -> i32 {
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    let units = f64::from(pixels) * f64::from(UNITS);
    let rounded = units + MAGIC;
    let whole = (rounded.to_bits() as i64).wrapping_sub(MAGIC.to_bits() as i64).wrapping_sub(origin) as i32;
    let rest = (units - (rounded - MAGIC)) * f64::from(FINE) + MAGIC;
    let rest = (rest.to_bits() as i64).wrapping_sub(MAGIC.to_bits() as i64) as i32;
    whole.wrapping_mul(FINE).wrapping_add(rest.clamp(-FINE / 2, FINE / 2 - 1))
}

/// Kernel that projects a run of vertices.
pub(super) struct Project<'a> {
    pub projection: &'a Projection,
    pub positions: &'a [Vec3],
    pub output: &'a mut [ScreenVertex],
}

impl Kernel for Project<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (position, output) in self.positions.iter().zip(self.output) {
            let clip = self.projection.clip(*position);
            let mut vertex = self.projection.screen(clip);
            vertex.fine_x = if self.projection.inside(clip) { vertex.fine_x } else { NEEDS_CLIPPING };
            *output = vertex;
        }
    }
}

/// Kernel that marks the vertices of a run that lie behind a plane: triangles that use them are clipped.
pub(super) struct Behind<'a> {
    pub projection: &'a Projection,
    pub plane: Vec4,
    pub positions: &'a [Vec3],
    pub output: &'a mut [ScreenVertex],
}

impl Kernel for Behind<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (position, vertex) in self.positions.iter().zip(self.output) {
            let above = self.projection.above(self.plane, *position);
            vertex.fine_x = if above >= 0.0 { vertex.fine_x } else { NEEDS_CLIPPING };
        }
    }
}
