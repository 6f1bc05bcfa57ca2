//! Clipping of the few triangles that reach behind the eye, beyond the far plane, far off the screen or behind a
//! mirror.

use super::vertex::{Projection, ScreenVertex};
use glam::Vec3;

/// A part of a clipped triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct ClippedTriangle {
    /// Corners on the screen.
    pub corners: [ScreenVertex; 3],
    /// Barycentric coordinates in the whole triangle (of its corners 1 and 2), for each corner.
    pub weights: [[f32; 2]; 3],
    /// Index of the whole triangle.
    pub triangle: u32,
}

/// Greatest number of parts of a triangle: clipping by seven planes turns three corners into at most ten.
pub(super) const MAX_PARTS: usize = 8;
const MAX_CORNERS: usize = MAX_PARTS + 2;

#[derive(Debug, Clone, Copy, Default)]
struct Corner {
    clip: [f64; 4],
    weights: [f64; 2],
}

impl Corner {
    /// The intersection of the edge from `inside` to `outside` with a plane; `inner` and `outer` are the corners'
    /// signed distances from it.
    ///
    /// Always computed from the inside outwards, so that two triangles get the same point on their common edge.
    fn between(inside: &Self, outside: &Self, inner: f64, outer: f64) -> Self {
        let t = inner / (inner - outer);
        Self {
            clip: std::array::from_fn(|i| inside.clip[i] + t * (outside.clip[i] - inside.clip[i])),
            weights: std::array::from_fn(|i| inside.weights[i] + t * (outside.weights[i] - inside.weights[i])),
        }
    }
}

#[derive(Default)]
struct Polygon {
    corners: [Corner; MAX_CORNERS],
    len: usize,
}

impl Polygon {
    /// A convex polygon gains at most one corner for each plane. Should rounding make a sliver cross a plane more
    /// often, corners without room are dropped.
    fn push(&mut self, corner: Corner) {
        if let Some(free) = self.corners.get_mut(self.len) {
            *free = corner;
            self.len += 1;
        }
    }

    /// Clips by one plane: Sutherland and Hodgman, "Reentrant polygon clipping" (1974).
    fn clipped(&self, distance: impl Fn(&Corner) -> f64) -> Self {
        let mut output = Self::default();
        for i in 0..self.len {
            let (from, to) = (&self.corners[i], &self.corners[(i + 1) % self.len]);
            let (start, end) = (distance(from), distance(to));
            if start >= 0.0 {
                output.push(*from);
            }
            if (start >= 0.0) != (end >= 0.0) {
                output.push(if start >= 0.0 {
                    Corner::between(from, to, start, end)
                } else {
                    Corner::between(to, from, end, start)
                });
            }
        }
        output
    }
}

/// Calls `emit` with the parts of a triangle that lie between the near and the far plane, near the viewport and in front
/// of [`Projection::plane`].
pub(super) fn clip(
    projection: &Projection,
    triangle: u32,
    positions: [Vec3; 3],
    mut emit: impl FnMut(ClippedTriangle),
) {
    let above = projection.plane.map(|plane| positions.map(|position| f64::from(projection.above(plane, position))));
    if above.is_some_and(|above| above.iter().all(|value| *value < 0.0)) {
        return;
    }
    let clip = positions.map(|position| projection.clip(position));
    let finite = clip.iter().flatten().all(|value| value.is_finite());
    if !finite || above.iter().flatten().any(|value| !value.is_finite()) {
        return;
    }
    // Early out for triangles whose corners are all beyond the same border of the viewport. Most triangles end here
    // where the view is a small part of the scene, as in a near shadow map.
    let all = |beyond: fn(&[f32; 4]) -> bool| clip.iter().all(beyond);
    if all(|[x, _, _, w]| x > w)
        || all(|[x, _, _, w]| -x > *w)
        || all(|[_, y, _, w]| y > w)
        || all(|[_, y, _, w]| -y > *w)
    {
        return;
    }
    let mut polygon = Polygon::default();
    for (corner, weights) in clip.into_iter().zip([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]) {
        polygon.push(Corner { clip: corner.map(f64::from), weights });
    }
    let [guard_x, guard_y] = projection.guard.map(f64::from);
    if let Some([a, b, c]) = above {
        polygon = polygon.clipped(|Corner { weights: [u, v], .. }| a * (1.0 - u - v) + b * u + c * v);
    }
    polygon = polygon.clipped(|Corner { clip: [_, _, z, w], .. }| w - z);
    polygon = polygon.clipped(|Corner { clip: [_, _, z, _], .. }| *z);
    polygon = polygon.clipped(|Corner { clip: [x, _, _, w], .. }| guard_x * w - x);
    polygon = polygon.clipped(|Corner { clip: [x, _, _, w], .. }| guard_x * w + x);
    polygon = polygon.clipped(|Corner { clip: [_, y, _, w], .. }| guard_y * w - y);
    polygon = polygon.clipped(|Corner { clip: [_, y, _, w], .. }| guard_y * w + y);
    for second in 2..polygon.len {
        let corners = [&polygon.corners[0], &polygon.corners[second - 1], &polygon.corners[second]];
        let clip = corners.map(|corner| corner.clip.map(|value| value as f32));
        // A corner at the eye itself has no direction; a polygon with such a corner has no area on the screen.
        if clip.iter().all(|corner| corner[3] >= f32::MIN_POSITIVE) {
            emit(ClippedTriangle {
                corners: clip.map(|corner| projection.screen(corner)),
                weights: corners.map(|corner| corner.weights.map(|weight| weight as f32)),
                triangle,
            });
        }
    }
}
