//! Points on surfaces in corrected fidelity: exact triangles, a side, and origins for rays that leave them.

use super::material::interpolate;
use super::optics::reflect;
use super::{Coverage, Pass, Pixel};
use crate::trace::{Hit, Ray, SurfacePoint, Tracer};
use glam::Vec3;

/// A point of a triangle, seen from one side.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    point: SurfacePoint,
    /// Unit geometric normal, on the viewer's side.
    pub facing: Vec3,
    /// Unit shading normal, turned to the same side as [`Self::facing`].
    pub normal: Vec3,
}

impl Surface {
    fn new(point: SurfacePoint, normal: Vec3, view: Vec3) -> Self {
        let facing = if point.normal.dot(view) > 0.0 { -point.normal } else { point.normal };
        let normal = normal.try_normalize().unwrap_or(facing);
        Self { point, facing, normal: if normal.dot(facing) < 0.0 { -normal } else { normal } }
    }

    /// Where a ray in this direction starts: off the triangle on the side to which it goes.
    pub fn origin(&self, direction: Vec3) -> Vec3 {
        self.point.spawn(direction)
    }

    /// The normal that a mirror or pane bends the direction `view` by: the shading normal, or the geometric one where the
    /// former looks away from the viewer or would mirror light into the surface.
    pub fn interface_normal(&self, view: Vec3) -> Vec3 {
        let usable = self.normal.dot(view) < 0.0 && reflect(view, self.normal).dot(self.facing) > 0.0;
        if usable { self.normal } else { self.facing }
    }
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The point of a triangle that a pixel shows, and the unit direction in which it is seen.
    pub(super) fn surface_at(&self, pixel: Pixel, triangle: u32, normal: Vec3) -> (Surface, Vec3) {
        self.surface_of(self.point_at(pixel, triangle), normal)
    }

    /// The same of a point that is known.
    pub(super) fn surface_of(&self, point: SurfacePoint, normal: Vec3) -> (Surface, Vec3) {
        let view = (point.position - self.job.eye).try_normalize().unwrap_or(-point.normal);
        (Surface::new(point, normal, view), view)
    }

    /// The point of a triangle nearest to a pixel's stored position.
    pub(super) fn point_at(&self, pixel: Pixel, triangle: u32) -> SurfacePoint {
        self.point_of(triangle, self.position(pixel).truncate())
    }

    /// The same of a stored position.
    pub(super) fn point_of(&self, triangle: u32, stored: Vec3) -> SurfacePoint {
        SurfacePoint::snap(&self.job.scene.geometry, triangle, stored)
    }

    /// The point that a ray meets.
    pub(super) fn surface_hit(&self, ray: &Ray, hit: &Hit) -> Surface {
        let geometry = &self.job.scene.geometry;
        let point = SurfacePoint::from_hit(geometry, hit);
        Surface::new(point, interpolate(geometry, &geometry.normals, hit), ray.direction)
    }

    /// The nearest surface from an origin that lies off its own.
    pub(super) fn closest(&self, origin: Vec3, direction: Vec3) -> (Ray, Option<Hit>) {
        let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
        (ray, self.tracer.closest(&ray, |hit| self.coverage.covers(hit)))
    }
}
