//! Points on surfaces in corrected fidelity: the exact point of the triangle, the side that is seen, and origins of
//! rays that leave it.

use super::coverage::Coverage;
use super::interpolate::interpolate;
use super::optics::reflect;
use super::pass::{Pass, Pixel};
use super::ray_cone::{Cone, Footprint, curvature};
use crate::trace::{F16, Hit, LANES, Ray, SurfacePoint, SurfacePoints, Tracer, vector_at};
use glam::Vec3;

/// A point of a triangle, seen from one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    point: SurfacePoint,
    /// Unit geometric normal, on the viewer's side.
    pub facing: Vec3,
    /// Unit shading normal, flipped to the same side as [`Self::facing`].
    pub normal: Vec3,
}

impl Surface {
    #[inline(always)]
    fn new(point: SurfacePoint, normal: Vec3, view: Vec3) -> Self {
        let facing = if point.normal.dot(view) > 0.0 { -point.normal } else { point.normal };
        let normal = unit_or(normal, facing);
        Self { point, facing, normal: if normal.dot(facing) < 0.0 { -normal } else { normal } }
    }

    /// The surface at a point that is seen from `eye`, and the unit direction in which it is seen. Free of branches, so
    /// that a loop over several points becomes vector code.
    #[inline(always)]
    fn seen(point: SurfacePoint, normal: Vec3, eye: Vec3) -> (Self, Vec3) {
        let view = unit_or(point.position - eye, -point.normal);
        (Self::new(point, normal, view), view)
    }

    /// Origin of a ray in this direction: off the triangle, on the side to which the ray goes.
    #[inline]
    pub fn origin(&self, direction: Vec3) -> Vec3 {
        self.point.spawn(direction)
    }

    /// The point itself, with its error bound.
    #[inline]
    pub(super) fn point(&self) -> &SurfacePoint {
        &self.point
    }

    /// Position of the point.
    #[inline]
    #[must_use]
    pub fn position(&self) -> Vec3 {
        self.point.position
    }

    /// Whether the viewer is on the front side, where the winding is counter-clockwise. On a closed body this is the
    /// outside.
    #[inline]
    #[must_use]
    pub fn is_front(&self) -> bool {
        self.facing == self.point.normal
    }

    /// Whether the origins of rays lie farther inside the triangle than the point, because the point is near the
    /// triangle's border.
    #[cfg(test)]
    pub(super) fn is_drawn_in(&self) -> bool {
        self.point.is_drawn_in()
    }

    /// The normal by which a mirror or pane bends the direction `view`. It is the shading normal, unless the shading normal faces away from the
    /// viewer or would mirror light into the surface; then it is the geometric normal.
    pub fn interface_normal(&self, view: Vec3) -> Vec3 {
        let usable = self.normal.dot(view) < 0.0 && reflect(view, self.normal).dot(self.facing) > 0.0;
        if usable { self.normal } else { self.facing }
    }
}

/// As [`Vec3::normalize_or`], without a branch.
#[inline(always)]
fn unit_or(vector: Vec3, other: Vec3) -> Vec3 {
    let reciprocal = vector.length_recip();
    if (reciprocal > 0.0) & (reciprocal < f32::INFINITY) { vector * reciprocal } else { other }
}

/// Surfaces of eight points, as `[axis][point]`: bit for bit the results of [`Pass::surface_of`].
pub(super) struct Surfaces {
    facing: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    view: [[f32; LANES]; 3],
    origin: [[f32; LANES]; 3],
}

impl Surfaces {
    /// The surfaces of one half of sixteen pixels, from their points and stored normals.
    #[inline(always)]
    pub(super) fn new(points: &SurfacePoints, normals: &[F16; 3], half: usize, eye: Vec3) -> Self {
        let zero = [[0.0; LANES]; 3];
        let mut surfaces = Self { facing: zero, normal: zero, view: zero, origin: zero };
        for lane in 0..LANES {
            let stored = vector_at(normals, half * LANES + lane);
            let (surface, view) = Surface::seen(points.point(lane), stored, eye);
            let origin = surface.origin(surface.facing);
            for axis in 0..3 {
                surfaces.facing[axis][lane] = surface.facing[axis];
                surfaces.normal[axis][lane] = surface.normal[axis];
                surfaces.view[axis][lane] = view[axis];
                surfaces.origin[axis][lane] = origin[axis];
            }
        }
        surfaces
    }

    /// The surface of one lane, and the unit direction in which it is seen. Wrong where the point may be [near a
    /// border](SurfacePoints::near): such a pixel needs [`Pass::surface_of`].
    #[inline(always)]
    pub(super) fn get(&self, points: &SurfacePoints, lane: usize) -> (Surface, Vec3) {
        let at = |axes: &[[f32; LANES]; 3]| Vec3::new(axes[0][lane], axes[1][lane], axes[2][lane]);
        (Surface { point: points.point(lane), facing: at(&self.facing), normal: at(&self.normal) }, at(&self.view))
    }

    /// Origin of rays to the viewer's side.
    #[inline(always)]
    pub(super) fn origin(&self, lane: usize) -> Vec3 {
        Vec3::new(self.origin[0][lane], self.origin[1][lane], self.origin[2][lane])
    }
}

/// The footprint of a pass's cones on textures.
pub(super) type FootprintOf<C> = <<C as Coverage>::Cone as Cone>::Footprint;

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The surface at the point of `triangle` that a pixel shows, and the unit direction in which it is seen. `normal`
    /// is the stored one.
    pub(super) fn surface_at(&self, pixel: Pixel, triangle: u32, normal: Vec3) -> (Surface, Vec3) {
        self.surface_of(self.point_at(pixel, triangle), normal)
    }

    /// As [`Self::surface_at`], for a point that is already computed.
    pub(super) fn surface_of(&self, point: SurfacePoint, normal: Vec3) -> (Surface, Vec3) {
        Surface::seen(point, normal, self.job.eye)
    }

    /// The point of a triangle nearest to a pixel's stored position.
    pub(super) fn point_at(&self, pixel: Pixel, triangle: u32) -> SurfacePoint {
        self.point_of(triangle, self.position(pixel).truncate())
    }

    /// The point of a triangle nearest to a stored position.
    pub(super) fn point_of(&self, triangle: u32, stored: Vec3) -> SurfacePoint {
        match self.sphere(triangle) {
            Some(sphere) => SurfacePoint::on_sphere(sphere, stored),
            None => SurfacePoint::snap(&self.job.scene.geometry, triangle, stored),
        }
    }

    /// The surface at the point where a ray hits; its normal map is read at the mip level of the footprint.
    pub(super) fn surface_hit(&self, ray: &Ray, hit: &Hit, footprint: impl Footprint) -> Surface {
        if let Some(sphere) = self.sphere(hit.triangle) {
            let point = SurfacePoint::on_sphere_by(sphere, ray, hit.t);
            return Surface::new(point, point.normal, ray.direction);
        }
        let geometry = &self.job.scene.geometry;
        let point = SurfacePoint::from_hit(geometry, hit);
        let vertex = interpolate(geometry, &geometry.normals, hit);
        let normal = self.bent_normal(hit, footprint, [vertex, point.normal]).unwrap_or(vertex);
        Surface::new(point, normal, ray.direction)
    }

    /// The cone of a pixel at the surface that it shows.
    pub(super) fn cone_at(&self, surface: &Surface) -> C::Cone {
        C::Cone::of_pixel(self.job.cone, surface.position().distance(self.job.eye))
    }

    /// The footprint of a cone on the surface that it hits in a unit direction. Spheres have no texture coordinates.
    pub(super) fn footprint(&self, cone: C::Cone, hit: &Hit, direction: Vec3) -> FootprintOf<C> {
        match self.sphere(hit.triangle) {
            Some(_) => Footprint::NONE,
            None => cone.footprint(&self.job.scene.geometry, hit.triangle, direction),
        }
    }

    /// The curvature of a triangle or sphere at a point of its surface, as seen from the viewer's side: above 0 where it is
    /// convex, in 1 / scene units. Normal maps do not count.
    pub(super) fn curvature(&self, id: u32, surface: &Surface) -> f32 {
        if let Some(sphere) = self.sphere(id) {
            let outward = surface.position() - sphere.center;
            return sphere.radius.recip().copysign(outward.dot(surface.facing));
        }
        let geometry = &self.job.scene.geometry;
        let normals = geometry.triangles[id as usize].map(|vertex| geometry.normals[vertex as usize]);
        let curvature = curvature(geometry.corners(id), normals);
        let side = (normals[0] + normals[1] + normals[2]).dot(surface.facing);
        if side < 0.0 { -curvature } else { curvature }
    }

    /// A ray and its closest hit, if there is one. The ray starts at distance 0, so an origin on a surface must be offset from it before.
    pub(super) fn closest(&self, origin: Vec3, direction: Vec3) -> (Ray, Option<Hit>) {
        let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
        (ray, self.tracer.closest(&ray, |hit| self.covers(hit)))
    }
}
