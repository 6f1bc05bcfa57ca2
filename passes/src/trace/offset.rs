//! Where secondary rays start.

use super::Hit;
use super::query::UNIT_ROUNDOFF;
use curitiba_pipeline::scene::Geometry;
use glam::{DVec3, Vec3};

/// Units of rounding error by which [`SurfacePoint::spawn`] moves off the surface. Of 4.8 million hits over twelve
/// combinations of scale and distance from the origin, 8 units left a few self-intersections and 16 none.
pub(super) const UNITS: f32 = 32.0;

/// Units of rounding error of the triangle test for each unit of distance to the farthest corner, relative to [`UNITS`]: the
/// test sees the corners from the ray's origin, so it errs even where the coordinates along the normal are exactly 0.
pub(super) const REACH: f64 = 0.5;

/// Units of rounding error of the point, along its worst axis, by which rays start inside the borders of their triangle:
/// another surface that stands on a border is then in front of a ray that goes to it, not behind its origin or through it.
pub(super) const MARGIN: f64 = 32.0;

/// A point on a triangle, with what is known of its error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Position, world, within [`Self::error`] of the triangle's plane.
    pub position: Vec3,
    /// Unit normal of the triangle's plane, counter-clockwise side; 0 for a degenerate triangle.
    pub normal: Vec3,
    /// Where rays start before they are moved off the plane: the position, drawn in from the borders of the triangle by
    /// its rounding error along them.
    start: Vec3,
    /// Bound of the distance from the plane to positions computed on it, including those a ray test computes.
    pub error: f32,
}

impl SurfacePoint {
    /// The projection onto a triangle of a position that was interpolated, stored or reconstructed, and so lies near the
    /// triangle but not on it; a projection outside the triangle is drawn in to its border.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn snap(geometry: &Geometry, triangle: u32, position: Vec3) -> Self {
        let corners = geometry.corners(triangle);
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let (e1, e2, to) = (b - a, c - a, position.as_dvec3() - a);
        let (d11, d12, d22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
        let (d1, d2) = (to.dot(e1), to.dot(e2));
        let determinant = d11 * d22 - d12 * d12;
        let (u, v) = ((d22 * d1 - d12 * d2) / determinant, (d11 * d2 - d12 * d1) / determinant);
        // Not finite for degenerate triangles and positions: then the first corner is as good as any point.
        let (u, v) = if (u + v).is_finite() { (u, v) } else { (0.0, 0.0) };
        let (u, v) = (u.max(0.0), v.max(0.0));
        let sum = (u + v).max(1.0);
        Self::at(corners, u / sum, v / sum)
    }

    /// The point that a ray hit.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn from_hit(geometry: &Geometry, hit: &Hit) -> Self {
        Self::at(geometry.corners(hit.triangle), f64::from(hit.u), f64::from(hit.v))
    }

    fn at(corners: [Vec3; 3], u: f64, v: f64) -> Self {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2).normalize_or_zero();
        let magnitude = a.abs() + (u * e1).abs() + (v * e2).abs();
        let position: DVec3 = a + u * e1 + v * e2;
        let reach = [a, b, c].map(|corner| (corner - position).abs().max_element()).into_iter().fold(0.0, f64::max);
        let error = (normal.abs().dot(magnitude) + REACH * reach) as f32 * UNIT_ROUNDOFF;
        let margin = MARGIN * f64::from(UNIT_ROUNDOFF) * (magnitude.max_element() + REACH * reach);
        let start = drawn_in([a, b, c], normal, position, margin).as_vec3();
        Self { position: position.as_vec3(), normal: normal.as_vec3(), start, error }
    }

    /// The origin of a ray that leaves in `direction`: off the plane to the side the ray leaves on, by 32 times
    /// 2⁻²⁴ (Σ |nᵢ| (|aᵢ| + |u e1ᵢ| + |v e2ᵢ|) + r / 2), where r is the largest coordinate distance to a corner: the errors of
    /// the point along the normal and of the triangle test.
    ///
    /// Before that it is moved along the plane, away from borders of the triangle that are nearer than 32 times
    /// 2⁻²⁴ (max (|aᵢ| + |u e1ᵢ| + |v e2ᵢ|) + r / 2): a wall on a border would else be at distance 0, or behind.
    ///
    /// There is no fixed distance in it: it scales with the scene. Surfaces nearer than the offset are not seen.
    #[must_use]
    #[inline]
    pub fn spawn(&self, direction: Vec3) -> Vec3 {
        let distance = UNITS * self.error;
        self.start + self.normal * if self.normal.dot(direction) < 0.0 { -distance } else { distance }
    }
}

/// A position of a triangle moved along its plane, away from the borders that are nearer than `margin`; as it is where the
/// triangle has no room for that. Positions farther inside are returned to the bit.
fn drawn_in(corners: [DVec3; 3], normal: DVec3, position: DVec3, margin: f64) -> DVec3 {
    let [a, b, c] = corners;
    // Inward, and as long as the border: a distance times that length is an area, which needs no root to be compared.
    let borders = [(a, b - a), (b, c - b), (c, a - c)].map(|(from, along)| (from, normal.cross(along)));
    let near = |position: DVec3, (from, inward): (DVec3, DVec3), margin: f64| {
        let area = (position - from).dot(inward);
        area < 0.0 || area * area < margin * margin * inward.length_squared()
    };
    if !borders.iter().any(|border| near(position, *border, margin)) {
        return position;
    }
    let mut moved = position;
    // Twice, because leaving one border of a corner may lead back to the other.
    for _ in 0..2 {
        for (from, inward) in borders {
            let inward = inward.normalize_or_zero();
            moved += inward * (margin - (moved - from).dot(inward)).max(0.0);
        }
    }
    if borders.iter().any(|border| near(moved, *border, 0.5 * margin)) { position } else { moved }
}
