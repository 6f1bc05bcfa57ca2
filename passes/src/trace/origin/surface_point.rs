//! Where secondary rays start.

use crate::trace::ray::Hit;
use crate::trace::rounding::{OFFSET_MARGIN, OFFSET_REACH, OFFSET_UNITS, UNIT_ROUNDOFF};
use curitiba_pipeline::scene::Geometry;
use glam::{DVec3, Vec3};

/// A point on a triangle or an exact sphere, with a bound on its rounding error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Position, world, within [`Self::error`] of the triangle's plane.
    pub position: Vec3,
    /// Unit normal of the triangle's plane, counter-clockwise side; 0 for a degenerate triangle. On a sphere it points outwards.
    pub normal: Vec3,
    /// Where rays start before they are moved off the plane: the position, moved along the plane away from those borders of the triangle
    /// that are nearer than a bound on the position's rounding error.
    pub(crate) start: Vec3,
    /// Bound on the distance between the plane and positions that are computed to lie on it, including those that a ray test computes.
    pub error: f32,
}

impl SurfacePoint {
    /// The projection onto a triangle of a position that was interpolated, stored or reconstructed, and so lies near the triangle but not
    /// exactly on it. A projection outside the triangle is moved to its border.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn snap(geometry: &Geometry, triangle: u32, position: Vec3) -> Self {
        let corners = geometry.corners(triangle).map(|corner| corner.as_dvec3());
        Self::at(corners, project(corners, position.as_dvec3()))
    }

    /// The point that a ray hit.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn from_hit(geometry: &Geometry, hit: &Hit) -> Self {
        let corners = geometry.corners(hit.triangle).map(|corner| corner.as_dvec3());
        Self::at(corners, (f64::from(hit.u), f64::from(hit.v)))
    }

    fn at(corners: [DVec3; 3], shares: (f64, f64)) -> Self {
        let Place { position, normal, error, margin, is_inside } = Place::at(corners, shares);
        let near = !is_inside && Borders::of(corners, normal).is_near(position, margin);
        let start = if near { drawn_in(corners, normal, position, margin) } else { position };
        Self { position: position.as_vec3(), normal: normal.as_vec3(), start: start.as_vec3(), error }
    }

    /// A point that is farther from the borders of its triangle than its rounding error.
    #[inline(always)]
    pub(crate) fn inside(position: Vec3, normal: Vec3, error: f32) -> Self {
        Self { position, normal, start: position, error }
    }

    /// Whether rays start at a point other than the position.
    #[cfg(test)]
    pub(crate) fn is_drawn_in(&self) -> bool {
        self.start != self.position
    }

    /// The origin of a ray that leaves in `direction`. The origin is moved off the plane, to the side of `direction`, by
    /// 32 times 2⁻²⁴ (Σ |nᵢ| (|aᵢ| + |u e1ᵢ| + |v e2ᵢ|) + r / 2). Here n is the normal, a corner 0, e1 and e2 the edges from it, u and v
    /// the barycentric coordinates, and r the largest coordinate distance to a corner. The sum bounds the errors of the point along the
    /// normal and of the triangle test.
    ///
    /// Along the plane the origin is moved away from borders of the triangle that are nearer than
    /// 32 times 2⁻²⁴ (max (|aᵢ| + |u e1ᵢ| + |v e2ᵢ|) + r / 2): otherwise a wall on a border would be at distance 0, or behind the origin.
    ///
    /// The offset contains no fixed distance, so it scales with the scene. Surfaces nearer to the point than the offset are not seen.
    #[must_use]
    #[inline(always)]
    pub fn spawn(&self, direction: Vec3) -> Vec3 {
        let distance = OFFSET_UNITS * self.error;
        self.start + self.normal * if self.normal.dot(direction) < 0.0 { -distance } else { distance }
    }
}

/// Barycentric coordinates of corners 1 and 2 for the projection onto a triangle of a position near it. A projection outside the triangle
/// is clamped to the border; in obtuse triangles the clamped point is not always the nearest.
#[inline(always)]
pub(crate) fn project([a, b, c]: [DVec3; 3], position: DVec3) -> (f64, f64) {
    let (e1, e2, to) = (b - a, c - a, position - a);
    let (d11, d12, d22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
    let (d1, d2) = (to.dot(e1), to.dot(e2));
    let determinant = d11 * d22 - d12 * d12;
    let (u, v) = ((d22 * d1 - d12 * d2) / determinant, (d11 * d2 - d12 * d1) / determinant);
    // Not finite for degenerate triangles or positions that are not finite: then the first corner is as good as any point.
    let finite = (u + v).abs() < f64::INFINITY;
    let u = if finite && u > 0.0 { u } else { 0.0 };
    let v = if finite && v > 0.0 { v } else { 0.0 };
    let sum = if u + v > 1.0 { u + v } else { 1.0 };
    (u / sum, v / sum)
}

/// A point of a triangle, not yet moved away from its borders.
pub(crate) struct Place {
    pub(crate) position: DVec3,
    /// See [`SurfacePoint::normal`].
    pub(crate) normal: DVec3,
    /// See [`SurfacePoint::error`].
    pub(crate) error: f32,
    /// The distance from borders that ray origins keep.
    margin: f64,
    /// Whether the point is certainly farther than `margin` from all borders.
    pub(crate) is_inside: bool,
}

impl Place {
    /// The point with barycentric coordinates `u` and `v` of corners 1 and 2. Without branches, so that loops over several points are
    /// vectorised.
    #[inline(always)]
    pub(crate) fn at([a, b, c]: [DVec3; 3], (u, v): (f64, f64)) -> Self {
        let (e1, e2) = (b - a, c - a);
        let cross = e1.cross(e2);
        let normal = unit_or_zero(cross);
        let magnitude = a.abs() + (u * e1).abs() + (v * e2).abs();
        let position: DVec3 = a + u * e1 + v * e2;
        let (far_a, far_b, far_c) = ((a - position).abs(), (b - position).abs(), (c - position).abs());
        let reach = higher(higher(largest(far_a), largest(far_b)), largest(far_c));
        let error = (normal.abs().dot(magnitude) + OFFSET_REACH * reach) as f32 * UNIT_ROUNDOFF;
        let margin = OFFSET_MARGIN * f64::from(UNIT_ROUNDOFF) * (largest(magnitude) + OFFSET_REACH * reach);
        let is_inside = is_farther([u, v], [e1, e2, e2 - e1], cross, 2.0 * margin);
        Self { position, normal, error, margin, is_inside }
    }
}

/// Whether a point is certainly farther than `margin` from all borders of its triangle; `margin` is far above the rounding of `f64`. The
/// distance from a border is (barycentric coordinate of the opposite corner) · 2 · area / (length of the border).
#[inline(always)]
fn is_farther([u, v]: [f64; 2], edges: [DVec3; 3], cross: DVec3, margin: f64) -> bool {
    let least = lower(lower(u, v), 1.0 - u - v);
    let [a, b, c] = edges.map(|edge| edge.dot(edge));
    let longest = higher(higher(a, b), c);
    (least > 0.0) & (least * least * cross.dot(cross) > margin * margin * longest)
}

#[inline(always)]
pub(crate) fn largest(vector: DVec3) -> f64 {
    higher(vector.z, higher(vector.x, vector.y))
}

#[inline(always)]
fn lower(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(crate) fn higher(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// As [`DVec3::normalize_or_zero`], without a branch.
#[inline(always)]
pub(crate) fn unit_or_zero(vector: DVec3) -> DVec3 {
    let reciprocal = 1.0 / vector.dot(vector).sqrt();
    vector * if reciprocal < f64::INFINITY && reciprocal > 0.0 { reciprocal } else { 0.0 }
}

/// The borders of a triangle: for each a point on it, and its inward normal, as long as the border. A distance times that length is an
/// area, which can be compared without a square root.
struct Borders([(DVec3, DVec3); 3]);

impl Borders {
    #[inline(always)]
    fn of([a, b, c]: [DVec3; 3], normal: DVec3) -> Self {
        Self([(a, normal.cross(b - a)), (b, normal.cross(c - b)), (c, normal.cross(a - c))])
    }

    /// Whether a position is outside the triangle, or nearer to a border than `margin`.
    #[inline(always)]
    fn is_near(&self, position: DVec3, margin: f64) -> bool {
        let mut near = false;
        for (from, inward) in self.0 {
            let area = (position - from).dot(inward);
            near |= (area < 0.0) | (area * area < margin * margin * inward.length_squared());
        }
        near
    }
}

/// A position of a triangle moved along its plane, away from the borders that are nearer than `margin`. Returned unchanged where the
/// triangle has no room for that.
#[cold]
fn drawn_in(corners: [DVec3; 3], normal: DVec3, position: DVec3, margin: f64) -> DVec3 {
    let borders = Borders::of(corners, normal);
    let mut moved = position;
    // Twice, because near a corner, moving away from one border may move the point towards the other border.
    for _ in 0..2 {
        for (from, inward) in borders.0 {
            let inward = inward.normalize_or_zero();
            moved += inward * (margin - (moved - from).dot(inward)).max(0.0);
        }
    }
    if borders.is_near(moved, 0.5 * margin) { position } else { moved }
}
