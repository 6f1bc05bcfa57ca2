//! Perspective-correct vertex attributes and textures at the pixels of a triangle.

use super::frame::{Corners, Frame, Placed};
use super::vertex::{FINE, UNITS};
use curitiba_pipeline::scene::texture::{Place, lod};
use glam::{DVec2, Vec2};
use std::ops::{Add, Mul, Sub};

/// Barycentric coordinates along a row of pixels, exact up to the division by the area.
///
/// They refer to the corners before snapping. With `snapped_depth` (thesis fidelity, shadow maps and cube maps) they refer to the snapped
/// corners. A pixel that only the snapped triangle covers has the coordinates of the nearest place of the exact triangle on the screen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Barycentric {
    /// Edge functions opposite to corners 1 and 2 at the first pixel, and the doubled area, in squares of [fractions](FINE) of sub-pixel
    /// units. Coordinates are integers below 2^29, so the products are exact if corners are at most 4096 pixels apart.
    pub(super) edges: [f64; 2],
    pub(super) area: f64,
    pub(super) scale: f64,
    /// Change of the edge functions for a step to the right, and for a step down.
    pub(super) right: [f64; 2],
    pub(super) down: [f64; 2],
    pub(super) inv_w: [f32; 3],
}

/// Number of [fractions](FINE) of sub-pixel units in a pixel.
const PIXEL: i32 = UNITS * FINE;

impl Barycentric {
    /// Coordinates relative to the pixel (x, y) of the viewport.
    #[inline(always)]
    pub(super) fn new(frame: &Frame<'_>, [v0, v1, v2]: &Corners<'_>, x: i32, y: i32) -> Self {
        let [[x0, y0], [x1, y1], [x2, y2]] = ways(frame, &[v0, v1, v2], x, y);
        let (x1, y1, x2, y2) = (x1 - x0, y1 - y0, x2 - x0, y2 - y0);
        let area = x1 * y2 - y1 * x2;
        let pixel = f64::from(PIXEL);
        let (mut edges, mut scale) = ([y0 * x2 - x0 * y2, y1 * x0 - x1 * y0], 1.0 / area);
        let mut steps = [[y2 * pixel, -y1 * pixel], [-x2 * pixel, x1 * pixel]];
        // The triangle has no area before snapping, so no pixel is inside it: edge functions 1 and 2 are set to a negative number.
        if area == 0.0 {
            (edges, scale, steps) = ([-1.0; 2], 1.0, [[0.0; 2]; 2]);
        }
        let [right, down] = steps;
        Self { edges, area, scale, right, down, inv_w: [v0.inv_w, v1.inv_w, v2.inv_w] }
    }

    /// Whether the pixel `column` pixels to the right of the first one lies outside of the triangle.
    #[inline(always)]
    pub(super) fn is_outside(&self, column: f64) -> bool {
        let [e1, e2] = [0, 1].map(|edge: usize| self.edges[edge] + self.right[edge] * column);
        let e0 = self.area - e1 - e2;
        [e0, e1, e2].into_iter().any(|edge| edge * self.scale < 0.0)
    }

    /// Screen-space barycentric coordinates of the three corners at the pixel (x, y), each times its `1 / w`.
    #[inline(always)]
    pub(super) fn at(frame: &Frame<'_>, corners: &Corners<'_>, x: i32, y: i32) -> [f32; 3] {
        let this = Self::new(frame, corners, x, y);
        let [e1, e2] = this.edges;
        let mut coordinates = [this.area - e1 - e2, e1, e2].map(|edge| edge * this.scale);
        if this.is_outside(0.0) {
            let [c1, c2] = nearest(frame, corners, x, y);
            coordinates = [1.0 - c1 - c2, c1, c2];
        }
        let [c0, c1, c2] = coordinates;
        [c0 as f32 * this.inv_w[0], c1 as f32 * this.inv_w[1], c2 as f32 * this.inv_w[2]]
    }

    /// The mapping of a texture of size `size` by the texture coordinates `corners`, for a filter over a square of side
    /// `footprint`, in pixels.
    #[inline(always)]
    pub(super) fn mapping(&self, corners: [Vec2; 3], size: Vec2, footprint: f32) -> Mapping {
        let slope = |step: [f64; 2]| step.map(|step| (step * self.scale) as f32 * footprint);
        Mapping { corners, right: slope(self.right), down: slope(self.down), size }
    }
}

/// Vectors from the centre of a pixel to the corners, in fractions of sub-pixel units.
#[inline(always)]
fn ways(frame: &Frame<'_>, corners: &Corners<'_>, x: i32, y: i32) -> [[f64; 2]; 3] {
    corners.map(|corner| {
        let [fine_x, fine_y] = corner.fine(frame.job.snapped_depth);
        [fine_x - (x * PIXEL + PIXEL / 2), fine_y - (y * PIXEL + PIXEL / 2)].map(f64::from)
    })
}

/// Screen-space barycentric coordinates of corners 1 and 2 at the point of the triangle's border that is nearest to a pixel.
#[cold]
#[inline(never)]
pub(super) fn nearest(frame: &Frame<'_>, corners: &Corners<'_>, x: i32, y: i32) -> [f64; 2] {
    let corners = ways(frame, corners, x, y).map(DVec2::from_array);
    let edge = |from: usize, to: usize| {
        let along = corners[to] - corners[from];
        let share = (-corners[from].dot(along) / along.length_squared()).clamp(0.0, 1.0);
        // An edge of length 0 is a single point.
        let share = if share.is_nan() { 0.0 } else { share };
        let mut coordinates = [0.0; 3];
        (coordinates[from], coordinates[to]) = (1.0 - share, share);
        ((corners[from] + along * share).length_squared(), coordinates)
    };
    let nearer = |best: (f64, [f64; 3]), next: (f64, [f64; 3])| if next.0 < best.0 { next } else { best };
    let (_, [_, c1, c2]) = [edge(1, 2), edge(2, 0)].into_iter().fold(edge(0, 1), nearer);
    [c1, c2]
}

/// Texture coordinates over a part of a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mapping {
    /// Texture coordinates at the corners.
    pub(super) corners: [Vec2; 3],
    /// Change of the screen-space barycentric coordinates of corners 1 and 2 for one filter width to the right, and one down.
    pub(super) right: [f32; 2],
    pub(super) down: [f32; 2],
    /// Size of level 0 in texels.
    pub(super) size: Vec2,
}

impl Mapping {
    /// Texture coordinates at a pixel.
    #[inline(always)]
    pub(super) fn uv(&self, u: f32, v: f32) -> Vec2 {
        let [a, b, c] = self.corners;
        a + (b - a) * u + (c - a) * v
    }

    /// Where a repeating texture is read at a pixel, and the level of detail. With screen-space barycentric coordinates
    /// `l_k`, which are linear on the screen, `uv = sum(l_k uv_k / w_k) / sum(l_k / w_k)`. The derivatives of `uv` are
    /// `sum(l_k' (uv_k - uv) / w_k) / sum(l_k / w_k)`.
    #[inline(always)]
    pub(super) fn at(&self, Perspective { u, v, inv_sum }: Perspective, inv_w: [f32; 3]) -> (Place, f32) {
        let [a, b, c] = self.corners;
        let uv = self.uv(u, v);
        let derivative = |[s1, s2]: [f32; 2]| {
            let sum = (a - uv) * ((-s1 - s2) * inv_w[0]) + (b - uv) * (s1 * inv_w[1]) + (c - uv) * (s2 * inv_w[2]);
            sum * inv_sum
        };
        (Place::of(uv), lod(self.size, derivative(self.right), derivative(self.down)))
    }
}

/// Perspective-correct barycentric coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Perspective {
    /// Coordinate of corner 1; `v` is that of corner 2.
    pub(super) u: f32,
    pub(super) v: f32,
    /// Reciprocal of the sum of the three screen-space coordinates, each times its `1 / w`.
    pub(super) inv_sum: f32,
}

impl Perspective {
    #[inline(always)]
    pub(super) fn new([w0, w1, w2]: [f32; 3]) -> Self {
        let inv_sum = 1.0 / (w0 + w1 + w2);
        Self { u: w1 * inv_sum, v: w2 * inv_sum, inv_sum }
    }
}

/// The values of a vertex attribute at the corners of a part of a triangle. Those of a clipped part are interpolated from the whole triangle.
#[inline(always)]
pub(super) fn attribute<T>(frame: &Frame<'_>, placed: &Placed<'_>, values: &[T]) -> [T; 3]
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
{
    let [a, b, c] = frame.geometry.triangles[placed.triangle as usize];
    let (mut a, mut b, mut c) = (values[a as usize], values[b as usize], values[c as usize]);
    if let Some(part) = placed.clipped {
        let at = |[u, v]: [f32; 2]| a + (b - a) * u + (c - a) * v;
        (a, b, c) = (at(part.weights[0]), at(part.weights[1]), at(part.weights[2]));
    }
    [a, b, c]
}

/// Alpha test of a triangle at a pixel of the viewport. The texture's alpha is that of level 0, as for rays
/// ([`AlphaTested`](crate::effects::AlphaTested)), so that light passes where the camera sees through.
pub(super) fn is_solid(frame: &Frame<'_>, placed: &Placed<'_>, x: i32, y: i32) -> bool {
    let shade = &frame.job.shades[frame.geometry.material_of(placed.triangle) as usize];
    let Some(cutoff) = shade.alpha_cutoff.filter(|_| shade.is_cut()) else { return true };
    let Perspective { u, v, .. } = Perspective::new(Barycentric::at(frame, &placed.corners, x, y));
    let mut vertices = 1.0;
    if shade.vertex_colors {
        let [a, b, c] = attribute(frame, placed, &frame.geometry.colors).map(|color| color.w);
        vertices = a + ((b - a) * u + (c - a) * v);
    }
    let Some(texture) = shade.texture else { return vertices >= cutoff };
    let [a, b, c] = attribute(frame, placed, &frame.geometry.texcoords);
    frame.job.scene.textures[texture as usize].sample(a + (b - a) * u + (c - a) * v, 0.0).w * vertices >= cutoff
}
