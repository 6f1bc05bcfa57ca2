//! Axis-parallel boxes, the camera's frustum, and their intersection.

use curitiba_pipeline::scene::Geometry;
use glam::{DMat4, DVec3, DVec4, Mat4, Vec3};
use rayon::prelude::*;

/// An axis-parallel box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lowest coordinates.
    pub min: Vec3,
    /// Highest coordinates.
    pub max: Vec3,
}

impl Bounds {
    /// The box of no points.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box around all triangles, except those of the sky.
    #[must_use]
    pub fn of_scene(geometry: &Geometry) -> Self {
        if geometry.triangles.is_empty() {
            return Self::EMPTY;
        }
        if !geometry.sky.is_empty() {
            let ids = (0..geometry.triangles.len() as u32).into_par_iter().with_min_len(1 << 14);
            let boxes = ids
                .filter(|id| !geometry.sky.contains(*id))
                .map(|id| geometry.corners(id).into_iter().fold(Self::EMPTY, Self::with));
            return boxes.reduce(|| Self::EMPTY, Self::union);
        }
        // Every vertex belongs to a triangle, so all vertices count.
        let chunks = geometry.positions.par_chunks(1 << 16);
        let boxes = chunks.map(|positions| positions.iter().fold(Self::EMPTY, |bounds, p| bounds.with(*p)));
        boxes.reduce(|| Self::EMPTY, Self::union)
    }

    /// Whether the box contains no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The box extended to contain a point. No coordinate may be NaN: it would replace the bounds along its axis.
    #[must_use]
    pub fn with(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box that contains `self` and `other`.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The centre.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Distance from the centre to a corner.
    #[must_use]
    pub fn radius(&self) -> f32 {
        (self.max * 0.5 - self.min * 0.5).length()
    }

    /// Squared distance from a point to the nearest point of the box.
    #[must_use]
    pub fn distance_squared(&self, point: Vec3) -> f32 {
        (point - point.clamp(self.min, self.max)).length_squared()
    }

    /// Distance from a point to the farthest corner.
    #[must_use]
    pub fn farthest_from(&self, point: DVec3) -> f64 {
        self.corners().iter().map(|corner| corner.distance(point)).fold(0.0, f64::max)
    }

    /// Greatest value of the affine function `dot(plane, (p, 1))` over the points `p` of the box.
    #[must_use]
    pub fn farthest(&self, plane: DVec4) -> f64 {
        self.corners().iter().map(|corner| plane.dot(corner.extend(1.0))).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Corner `index`: its bits 0, 1 and 2 choose the higher x, y and z.
    fn corner(&self, index: usize) -> DVec3 {
        let pick = |bit: usize, low: f32, high: f32| f64::from(if index >> bit & 1 == 0 { low } else { high });
        DVec3::new(pick(0, self.min.x, self.max.x), pick(1, self.min.y, self.max.y), pick(2, self.min.z, self.max.z))
    }

    fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|index| self.corner(index))
    }

    /// The box as the intersection of six half-spaces `dot(plane, (p, 1)) >= 0`.
    fn planes(&self) -> [DVec4; 6] {
        let (min, max) = (self.min.as_dvec3(), self.max.as_dvec3());
        [
            DVec4::new(1.0, 0.0, 0.0, -min.x),
            DVec4::new(-1.0, 0.0, 0.0, max.x),
            DVec4::new(0.0, 1.0, 0.0, -min.y),
            DVec4::new(0.0, -1.0, 0.0, max.y),
            DVec4::new(0.0, 0.0, 1.0, -min.z),
            DVec4::new(0.0, 0.0, -1.0, max.z),
        ]
    }
}

/// Corner numbers (see [`Bounds::corner`]) of the faces of a box: -x, +x, -y, +y, -z, +z, each counter-clockwise as
/// seen from outside.
const FACES: [[usize; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// A convex polygon with room for clipping by six planes.
#[derive(Debug, Clone, Copy)]
struct Polygon {
    points: [DVec3; Self::MOST],
    len: usize,
}

impl Polygon {
    /// Room for points: four corners, one more for each of six planes, and two that rounding may add. Further points are dropped.
    const MOST: usize = 12;

    fn new(corners: [DVec3; 4]) -> Self {
        let mut points = [DVec3::ZERO; Self::MOST];
        points[..4].copy_from_slice(&corners);
        Self { points, len: 4 }
    }

    /// Clips by planes: Sutherland and Hodgman, "Reentrant polygon clipping" (1974).
    fn clipped(self, planes: &[DVec4]) -> Self {
        planes.iter().fold(self, |polygon, plane| {
            let mut inside = Self { points: [DVec3::ZERO; Self::MOST], len: 0 };
            let mut push = |point| {
                if let Some(free) = inside.points.get_mut(inside.len) {
                    *free = point;
                    inside.len += 1;
                }
            };
            for (i, from) in polygon.points[..polygon.len].iter().enumerate() {
                let to = polygon.points[(i + 1) % polygon.len];
                let (start, end) = (plane.dot(from.extend(1.0)), plane.dot(to.extend(1.0)));
                if start >= 0.0 {
                    push(*from);
                }
                if (start >= 0.0) != (end >= 0.0) {
                    push(*from + (to - *from) * (start / (start - end)));
                }
            }
            inside
        })
    }

    fn points(&self) -> &[DVec3] {
        &self.points[..self.len]
    }
}

/// The camera's view volume between its near and far planes.
#[derive(Debug, Clone, Copy)]
pub struct Frustum {
    clip_from_world: DMat4,
    planes: [DVec4; 6],
    /// World positions of the corners of clip space, numbered as in [`Bounds::corner`].
    corners: [DVec3; 8],
}

impl Frustum {
    /// The frustum of a projection; `None` if the matrix has no finite inverse.
    #[must_use]
    pub fn new(clip_from_world: &Mat4) -> Option<Self> {
        let clip_from_world = clip_from_world.as_dmat4();
        let [x, y, z, w] = [0, 1, 2, 3].map(|row| clip_from_world.row(row));
        let world_from_clip = clip_from_world.inverse();
        let corners = std::array::from_fn(|index| {
            let side = |bit: usize, low: f64| if index >> bit & 1 == 0 { low } else { 1.0 };
            let corner = world_from_clip * DVec4::new(side(0, -1.0), side(1, -1.0), side(2, 0.0), 1.0);
            corner.truncate() / corner.w
        });
        let planes = [w + x, w - x, w + y, w - y, z, w - z];
        let finite = corners.iter().all(|corner| corner.is_finite()) && planes.iter().all(|plane| plane.is_finite());
        finite.then_some(Self { clip_from_world, planes, corners })
    }

    /// The plane whose dot product with `(p, 1)` is the depth of `p`: the distance in front of the plane through the
    /// eye that is parallel to the picture. `None` for an orthographic camera.
    #[must_use]
    pub fn depth_plane(&self) -> Option<DVec4> {
        let row = self.clip_from_world.row(3);
        let length = row.truncate().length();
        // For an orthographic camera, `length` is 0, except for a remainder from the matrix's rounding to 32-bit floats. The threshold
        // is the greatest such remainder.
        let scale = self.corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
        (length * scale > 1e-6 * row.w.abs()).then(|| row / length).filter(|plane| plane.is_finite())
    }

    /// Depths of the near and the far plane, measured by the result of [`Self::depth_plane`].
    #[must_use]
    pub fn depths(&self, plane: DVec4) -> [f64; 2] {
        [7, 0].map(|corner: usize| plane.dot(self.corners[corner].extend(1.0)))
    }

    /// The part of the frustum between the depths `near` and `far`, measured by `plane` (the result of [`Self::depth_plane`]).
    #[must_use]
    pub fn slice(&self, plane: DVec4, [near, far]: [f64; 2]) -> Self {
        let corners = std::array::from_fn(|index| {
            let (there, here) = (self.corners[index & 3], self.corners[index & 3 | 4]);
            let (last, first) = (plane.dot(there.extend(1.0)), plane.dot(here.extend(1.0)));
            let depth = if index & 4 == 0 { far } else { near };
            here + (there - here) * ((depth - first) / (last - first))
        });
        let [left, right, bottom, top, ..] = self.planes;
        let planes = [left, right, bottom, top, plane - DVec4::W * near, DVec4::W * far - plane];
        Self { clip_from_world: self.clip_from_world, planes, corners }
    }

    /// Centre and radius of a sphere around the intersection of the frustum and a box; `None` if the intersection is empty.
    #[must_use]
    pub fn sphere_with(&self, bounds: &Bounds) -> Option<(DVec3, f64)> {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.each_corner_with(bounds, |point| (low, high) = (low.min(point), high.max(point)));
        if !low.cmple(high).all() {
            return None;
        }
        let center = (low + high) * 0.5;
        let mut squared = 0f64;
        self.each_corner_with(bounds, |point| squared = squared.max(point.distance_squared(center)));
        Some((center, squared.sqrt()))
    }

    /// Visits points whose convex hull is the intersection with a box: the faces of the frustum clipped by the box, and
    /// the faces of the box clipped by the frustum.
    fn each_corner_with(&self, bounds: &Bounds, mut visit: impl FnMut(DVec3)) {
        let (box_corners, box_planes) = (bounds.corners(), bounds.planes());
        for face in FACES {
            let seen = Polygon::new(face.map(|index| self.corners[index])).clipped(&box_planes);
            let filled = Polygon::new(face.map(|index| box_corners[index])).clipped(&self.planes);
            seen.points().iter().chain(filled.points()).for_each(|point| visit(*point));
        }
    }

    /// The area that a box covers on the screen as seen from `eye`, in units where the whole screen is 4. It is 4 where
    /// the eye is inside the box, unless the box is a single point; 0 for an empty box.
    #[must_use]
    pub fn area_of(&self, bounds: &Bounds, eye: Vec3) -> f64 {
        if bounds.is_empty() {
            return 0.0;
        }
        if bounds.distance_squared(eye) == 0.0 && bounds.min != bounds.max {
            return 4.0;
        }
        let (corners, planes, eye) = (bounds.corners(), bounds.planes(), eye.as_dvec3());
        let mut doubled = 0.0;
        for (face, plane) in FACES.iter().zip(planes) {
            // The half-space of `plane` contains the box. The eye sees the face from outside if the eye is not in that
            // half-space.
            if plane.dot(eye.extend(1.0)) >= 0.0 {
                continue;
            }
            let polygon = Polygon::new(face.map(|index| corners[index])).clipped(&self.planes);
            let points = polygon.points();
            let screen = |point: DVec3| {
                let clip = self.clip_from_world * point.extend(1.0);
                clip.truncate().truncate() / clip.w
            };
            let Some(first) = points.first().map(|point| screen(*point)) else { continue };
            let area: f64 =
                points[1..].windows(2).map(|pair| (screen(pair[0]) - first).perp_dot(screen(pair[1]) - first)).sum();
            doubled += area.abs();
        }
        if doubled.is_finite() { 0.5 * doubled } else { 0.0 }
    }
}
