//! Where secondary rays start.

use super::Hit;
use super::dispatch::{Detected, Work};
use super::lanes::Simd;
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
        let corners = Corners::of([geometry.corners(triangle)]);
        let (u, v) = corners.project(position.as_dvec3().to_array().map(|coordinate| [coordinate]));
        corners.at(u, v).point(0)
    }

    /// The projections of several positions, as by [`Self::snap`], to the bit.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub(crate) fn snap_all(geometry: &Geometry, positions: &[(u32, Vec3)], mut each: impl FnMut(usize, Self)) {
        for (chunk, positions) in positions.chunks(TOGETHER).enumerate() {
            let count = positions.len();
            // What the last chunk lacks is computed all the same.
            let (mut corners, mut stored) = ([[[0.0; TOGETHER]; 3]; 3], [[0.0; TOGETHER]; 3]);
            for (lane, &(triangle, position)) in (0..TOGETHER).zip(positions) {
                // Axis by axis: of vectors in memory, parts would be read as a whole just after they were written.
                let [a, b, c] = geometry.corners(triangle);
                for axis in 0..3 {
                    corners[0][axis][lane] = a[axis];
                    corners[1][axis][lane] = b[axis];
                    corners[2][axis][lane] = c[axis];
                    stored[axis][lane] = position[axis];
                }
            }
            let snapped = Detected::cached().run(Snap { corners: &corners, positions: &stored });
            for lane in 0..count {
                each(chunk * TOGETHER + lane, snapped.point(lane));
            }
        }
    }

    /// The point that a ray hit.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn from_hit(geometry: &Geometry, hit: &Hit) -> Self {
        Corners::of([geometry.corners(hit.triangle)]).at([f64::from(hit.u)], [f64::from(hit.v)]).point(0)
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

/// Points that are computed together.
const TOGETHER: usize = 16;

struct Snap<'a> {
    corners: &'a [[[f32; TOGETHER]; 3]; 3],
    positions: &'a [[f32; TOGETHER]; 3],
}

impl Work<Points<TOGETHER>> for Snap<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Points<TOGETHER> {
        let corners = Corners([double(&self.corners[0]), double(&self.corners[1]), double(&self.corners[2])]);
        let (u, v) = corners.project(double(self.positions));
        corners.at(u, v)
    }
}

/// The corners of some triangles, `[corner][axis][triangle]`: loops of fixed length over them become vector code.
struct Corners<const N: usize>([[[f64; N]; 3]; 3]);

#[inline(always)]
fn double<const N: usize>(axes: &[[f32; N]; 3]) -> [[f64; N]; 3] {
    let mut doubles = [[0.0; N]; 3];
    for (axis, doubles) in axes.iter().zip(&mut doubles) {
        for (value, double) in axis.iter().zip(doubles) {
            *double = f64::from(*value);
        }
    }
    doubles
}

/// Points of some triangles, and what [`SurfacePoint`] knows of them.
struct Points<const N: usize> {
    position: [[f32; N]; 3],
    normal: [[f32; N]; 3],
    start: [[f32; N]; 3],
    error: [f32; N],
}

impl<const N: usize> Corners<N> {
    #[inline(always)]
    fn of(triangles: [[Vec3; 3]; N]) -> Self {
        let mut corners = [[[0.0; N]; 3]; 3];
        for (lane, triangle) in triangles.iter().enumerate() {
            for (corner, position) in triangle.iter().enumerate() {
                for axis in 0..3 {
                    corners[corner][axis][lane] = f64::from(position[axis]);
                }
            }
        }
        Self(corners)
    }

    #[inline(always)]
    fn corner(&self, corner: usize, lane: usize) -> DVec3 {
        let [x, y, z] = &self.0[corner];
        DVec3::new(x[lane], y[lane], z[lane])
    }

    /// Barycentric coordinates of the points of the triangles that are nearest to positions near them, but for obtuse
    /// corners: a projection outside is drawn in.
    #[inline(always)]
    fn project(&self, positions: [[f64; N]; 3]) -> ([f64; N], [f64; N]) {
        let (mut us, mut vs) = ([0.0; N], [0.0; N]);
        for lane in 0..N {
            let a = self.corner(0, lane);
            let position = DVec3::new(positions[0][lane], positions[1][lane], positions[2][lane]);
            let (e1, e2, to) = (self.corner(1, lane) - a, self.corner(2, lane) - a, position - a);
            let (d11, d12, d22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
            let (d1, d2) = (to.dot(e1), to.dot(e2));
            let determinant = d11 * d22 - d12 * d12;
            let (u, v) = ((d22 * d1 - d12 * d2) / determinant, (d11 * d2 - d12 * d1) / determinant);
            // Not finite for degenerate triangles and positions: then the first corner is as good as any point.
            let finite = (u + v).abs() < f64::INFINITY;
            let u = if finite && u > 0.0 { u } else { 0.0 };
            let v = if finite && v > 0.0 { v } else { 0.0 };
            let sum = if u + v > 1.0 { u + v } else { 1.0 };
            (us[lane], vs[lane]) = (u / sum, v / sum);
        }
        (us, vs)
    }

    #[inline(always)]
    fn at(&self, us: [f64; N], vs: [f64; N]) -> Points<N> {
        let mut points =
            Points { position: [[0.0; N]; 3], normal: [[0.0; N]; 3], start: [[0.0; N]; 3], error: [0.0; N] };
        let (mut margins, mut near) = ([0.0; N], [false; N]);
        for lane in 0..N {
            let (u, v) = (us[lane], vs[lane]);
            let [a, b, c] = [self.corner(0, lane), self.corner(1, lane), self.corner(2, lane)];
            let (e1, e2) = (b - a, c - a);
            let normal = unit_or_zero(e1.cross(e2));
            let magnitude = a.abs() + (u * e1).abs() + (v * e2).abs();
            let position: DVec3 = a + u * e1 + v * e2;
            let far = (a - position).abs();
            let (far_b, far_c) = ((b - position).abs(), (c - position).abs());
            let reach = largest(far).max(largest(far_b)).max(largest(far_c));
            let error = (normal.abs().dot(magnitude) + REACH * reach) as f32 * UNIT_ROUNDOFF;
            let margin = MARGIN * f64::from(UNIT_ROUNDOFF) * (largest(magnitude) + REACH * reach);
            near[lane] = Borders::of([a, b, c], normal).is_near(position, margin);
            margins[lane] = margin;
            points.error[lane] = error;
            for axis in 0..3 {
                points.position[axis][lane] = position[axis] as f32;
                points.normal[axis][lane] = normal[axis] as f32;
            }
        }
        points.start = points.position;
        for lane in 0..N {
            if near[lane] {
                let [a, b, c] = [self.corner(0, lane), self.corner(1, lane), self.corner(2, lane)];
                let (e1, e2) = (b - a, c - a);
                let position: DVec3 = a + us[lane] * e1 + vs[lane] * e2;
                let start = drawn_in([a, b, c], unit_or_zero(e1.cross(e2)), position, margins[lane]);
                for axis in 0..3 {
                    points.start[axis][lane] = start[axis] as f32;
                }
            }
        }
        points
    }
}

impl<const N: usize> Points<N> {
    #[inline(always)]
    fn point(&self, lane: usize) -> SurfacePoint {
        let at = |axes: &[[f32; N]; 3]| Vec3::new(axes[0][lane], axes[1][lane], axes[2][lane]);
        SurfacePoint {
            position: at(&self.position),
            normal: at(&self.normal),
            start: at(&self.start),
            error: self.error[lane],
        }
    }
}

#[inline(always)]
fn largest(vector: DVec3) -> f64 {
    let most = if vector.x > vector.y { vector.x } else { vector.y };
    if vector.z > most { vector.z } else { most }
}

/// As [`DVec3::normalize_or_zero`], without a branch.
#[inline(always)]
fn unit_or_zero(vector: DVec3) -> DVec3 {
    let reciprocal = 1.0 / vector.dot(vector).sqrt();
    vector * if reciprocal < f64::INFINITY && reciprocal > 0.0 { reciprocal } else { 0.0 }
}

/// The borders of a triangle: a point of each, and the direction that leads inward, as long as the border. A distance times
/// that length is an area, which needs no root to be compared.
struct Borders([(DVec3, DVec3); 3]);

impl Borders {
    #[inline(always)]
    fn of([a, b, c]: [DVec3; 3], normal: DVec3) -> Self {
        Self([(a, normal.cross(b - a)), (b, normal.cross(c - b)), (c, normal.cross(a - c))])
    }

    /// Whether a position is outside, or nearer to a border than `margin`.
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

/// A position of a triangle moved along its plane, away from the borders that are nearer than `margin`; as it is where the
/// triangle has no room for that.
#[cold]
fn drawn_in(corners: [DVec3; 3], normal: DVec3, position: DVec3, margin: f64) -> DVec3 {
    let borders = Borders::of(corners, normal);
    let mut moved = position;
    // Twice, because leaving one border of a corner may lead back to the other.
    for _ in 0..2 {
        for (from, inward) in borders.0 {
            let inward = inward.normalize_or_zero();
            moved += inward * (margin - (moved - from).dot(inward)).max(0.0);
        }
    }
    if borders.is_near(moved, 0.5 * margin) { position } else { moved }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::scene::Batch;

    #[test]
    fn points_snapped_together_are_those_snapped_one_by_one() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        };
        let mut vector = move || Vec3::new(random(), random(), random());
        let mut geometry = Geometry::default();
        for index in 0..60 {
            let center = vector() * 10.0;
            let spread = if index % 10 == 9 { 0.0 } else { 1.0 };
            geometry.positions.extend([0, 1, 2].map(|_| center + vector() * spread));
            geometry.triangles.push([3 * index, 3 * index + 1, 3 * index + 2]);
        }
        geometry.batches.push(Batch { material: 0, first: 0, count: 60 });
        let mut positions: Vec<(u32, Vec3)> = (0..60).map(|t| (t, geometry.corners(t)[0] + vector() * 0.7)).collect();
        // On a corner and on a border, where rays start inside; and what is no position.
        positions.extend((0..60).map(|t| (t, geometry.corners(t)[t as usize % 3])));
        positions.extend((0..60).map(|t| (t, geometry.corners(t)[0].midpoint(geometry.corners(t)[1]))));
        positions.push((3, Vec3::NAN));
        let (mut seen, mut drawn) = (0, 0);
        SurfacePoint::snap_all(&geometry, &positions, |index, point| {
            let (triangle, position) = positions[index];
            assert_eq!(point, SurfacePoint::snap(&geometry, triangle, position), "{index}");
            assert_eq!(index, seen);
            drawn += usize::from(point.start != point.position);
            seen += 1;
        });
        assert_eq!(seen, positions.len());
        assert!(drawn > 50, "{drawn}");
        SurfacePoint::snap_all(&geometry, &[], |_, _| panic!("there is none"));
    }
}
