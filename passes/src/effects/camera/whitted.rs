//! Whitted's recursion ("An Improved Illumination Model for Shaded Display", CACM 23(6), 1980): light and its shadows
//! at painted surfaces, reflection and refraction at glass, one further ray at mirrors and panes.

use super::{CLEAR, Walk};
use crate::effects::coverage::Coverage;
use crate::effects::ray_cone::Cone;
use crate::effects::surface::Surface;
use crate::effects::workspace::Workspace;
use crate::sampling::paths::{Place, Points};
use crate::trace::{Announcement, Hit, Purpose, Ray, Tracer};
use curitiba_pipeline::camera_programs::SurfaceKind;
use glam::Vec3;

impl<T: Tracer, C: Coverage> Walk<'_, '_, T, C> {
    /// The colour of the surface that a ray hits after `bounces` bounces. `cone` is the ray's cone at the surface.
    pub(super) fn whitted(
        &self,
        (ray, hit): (Ray, Hit),
        cone: C::Cone,
        bounces: u32,
        points: &Points,
        work: &mut Workspace,
    ) -> Vec3 {
        let kind = self.kind(&hit);
        if kind == SurfaceKind::Light {
            return Vec3::ONE;
        }
        let view = ray.direction;
        let footprint = self.pass.footprint(cone, &hit, view);
        let surface = self.pass.surface_hit(&ray, &hit, footprint);
        let curvature = || self.pass.curvature(hit.triangle, &surface);
        match kind {
            SurfaceKind::Light | SurfaceKind::Painted | SurfaceKind::CutOut => {
                let arriving = self.arriving(&hit, &surface, || points.at(Place::Light(bounces)), work);
                let share = (arriving + self.params.camera.ambient).min(Vec3::ONE);
                self.pass.base_color(&hit, footprint) * share + self.pass.glow(&hit, footprint)
            }
            SurfaceKind::Clear => {
                CLEAR * self.after(&surface, (view, cone), (Purpose::Refracted, CLEAR), bounces, points, work)
            }
            SurfaceKind::Metal => {
                let (direction, share) = self.mirror(&surface, view, || points.at(Place::Bounce(bounces)));
                let cone = cone.mirrored(curvature, -surface.interface_normal(view).dot(view));
                share * self.after(&surface, (direction, cone), (Purpose::Reflected, share), bounces, points, work)
            }
            SurfaceKind::Glass => {
                let split = self.split(&surface, view);
                let reflectance = split.interface.reflectance;
                let (normal, index) = split.bends;
                let cos = -normal.dot(view);
                let mut color = Vec3::ZERO;
                if reflectance > 0.0 {
                    let way = (Purpose::Reflected, reflectance);
                    let onward = (split.reflected, cone.mirrored(curvature, cos));
                    color += reflectance * self.after(&surface, onward, way, bounces, points, work);
                }
                if let Some(direction) = split.refracted {
                    let share = 1.0 - reflectance;
                    let onward = (direction, cone.refracted(curvature, [cos, split.interface.cos_refracted], index));
                    color += share * self.after(&surface, onward, (Purpose::Refracted, share), bounces, points, work);
                }
                color
            }
        }
    }

    /// The colour along the next ray, which leaves the surface `from` with this direction and cone; black after the last bounce. `weight` is the
    /// ray's weight, for tracers that record it.
    fn after(
        &self,
        from: &Surface,
        (direction, cone): (Vec3, C::Cone),
        (purpose, weight): (Purpose, f32),
        bounces: u32,
        points: &Points,
        work: &mut Workspace,
    ) -> Vec3 {
        if bounces >= self.params.depth {
            return Vec3::ZERO;
        }
        match purpose {
            Purpose::Reflected => work.rays.reflected += 1,
            _ => work.rays.refracted += 1,
        }
        self.pass.tracer.announce(Announcement { purpose, bounce: bounces, weight });
        match self.pass.closest(from.origin(direction), direction) {
            (ray, Some(hit)) => self.whitted((ray, hit), cone.along(hit.t), bounces + 1, points, work),
            _ => self.pass.job.beyond,
        }
    }
}
