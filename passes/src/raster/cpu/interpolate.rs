//! Perspective-correct vertex attributes and textures at the pixels of a triangle.

use super::frame::{Corners, Frame, Placed};
use super::vertex::UNITS;
use curitiba_pipeline::scene::texture::{Place, lod};
use glam::Vec2;
use std::ops::{Add, Mul, Sub};

/// Barycentric coordinates along a row of pixels, exact up to the division by the area.
#[derive(Debug, Clone, Copy)]
pub(super) struct Barycentric {
    /// Edge functions opposite to corners 1 and 2 at the first pixel, and the doubled area. They are products of 24-bit
    /// integers, and exact in 64-bit floats, as are their sums.
    pub(super) edges: [f64; 2],
    pub(super) area: f64,
    pub(super) scale: f64,
    /// Change of the edge functions for a step to the right, and for a step down.
    pub(super) right: [f64; 2],
    pub(super) down: [f64; 2],
    pub(super) inv_w: [f32; 3],
}

impl Barycentric {
    /// Coordinates relative to the pixel (x, y) of the viewport.
    #[inline(always)]
    pub(super) fn new([v0, v1, v2]: &Corners<'_>, x: i32, y: i32) -> Self {
        let dx = f64::from(x * UNITS + UNITS / 2 - v0.x());
        let dy = f64::from(y * UNITS + UNITS / 2 - v0.y());
        let (x1, y1) = (f64::from(v1.x() - v0.x()), f64::from(v1.y() - v0.y()));
        let (x2, y2) = (f64::from(v2.x() - v0.x()), f64::from(v2.y() - v0.y()));
        let area = x1 * y2 - y1 * x2;
        let pixel = f64::from(UNITS);
        Self {
            edges: [dx * y2 - dy * x2, x1 * dy - y1 * dx],
            area,
            scale: 1.0 / area,
            right: [y2 * pixel, -y1 * pixel],
            down: [-x2 * pixel, x1 * pixel],
            inv_w: [v0.inv_w, v1.inv_w, v2.inv_w],
        }
    }

    /// Screen-space barycentric coordinates of the three corners, each times its `1 / w`.
    #[inline(always)]
    pub(super) fn weights(&self, column: f64) -> [f32; 3] {
        let e1 = self.edges[0] + self.right[0] * column;
        let e2 = self.edges[1] + self.right[1] * column;
        let e0 = self.area - e1 - e2;
        [
            (e0 * self.scale) as f32 * self.inv_w[0],
            (e1 * self.scale) as f32 * self.inv_w[1],
            (e2 * self.scale) as f32 * self.inv_w[2],
        ]
    }

    /// The mapping of texture coordinates and a texture of size `size`, for a filter over a square of side `footprint`
    /// (pixels).
    #[inline(always)]
    pub(super) fn mapping(&self, corners: [Vec2; 3], size: Vec2, footprint: f32) -> Mapping {
        let slope = |step: [f64; 2]| step.map(|step| (step * self.scale) as f32 * footprint);
        Mapping { corners, right: slope(self.right), down: slope(self.down), size }
    }
}

/// Texture coordinates over a part of a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mapping {
    /// Texture coordinates at the corners.
    pub(super) corners: [Vec2; 3],
    /// Change of the screen-space coordinates of corners 1 and 2 for one filter width to the right, and one down.
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

    /// Where a repeating texture is read at a pixel, and the level of detail. With screen-space coordinates `l_k`,
    /// which are linear, `uv = sum(l_k uv_k / w_k) / sum(l_k / w_k)`. Its derivatives are
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
    /// Reciprocal of the sum of the weights.
    pub(super) inv_sum: f32,
}

impl Perspective {
    #[inline(always)]
    pub(super) fn new([w0, w1, w2]: [f32; 3]) -> Self {
        let inv_sum = 1.0 / (w0 + w1 + w2);
        Self { u: w1 * inv_sum, v: w2 * inv_sum, inv_sum }
    }
}

/// The values of a vertex attribute at the corners of a part of a triangle; interpolated there if the part was clipped.
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
    let Perspective { u, v, .. } = Perspective::new(Barycentric::new(&placed.corners, x, y).weights(0.0));
    let mut vertices = 1.0;
    if shade.vertex_colors {
        let [a, b, c] = attribute(frame, placed, &frame.geometry.colors).map(|color| color.w);
        vertices = a + ((b - a) * u + (c - a) * v);
    }
    let Some(texture) = shade.texture else { return vertices >= cutoff };
    let [a, b, c] = attribute(frame, placed, &frame.geometry.texcoords);
    frame.job.scene.textures[texture as usize].sample(a + (b - a) * u + (c - a) * v, 0.0).w * vertices >= cutoff
}
