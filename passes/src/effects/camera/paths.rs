//! Path tracing (Kajiya, "The Rendering Equation", SIGGRAPH 1986). At each surface a path takes one direction, by
//! importance sampling; at diffuse surfaces it also samples a point of the light.
//!
//! No light counts twice. Where a path samples the light, an emitting surface counts only if the path comes to it
//! from the camera, a mirror or glass. In a project without a light, every emitting surface that a path hits counts.
//! Where the light is a material, paths through glass find it, and shadow rays end at glass. A light without a surface
//! is found by shadow rays alone, which glass then dims.

use super::{CLEAR, Walk};
use crate::effects::coverage::Coverage;
use crate::effects::ray_cone::Cone;
use crate::effects::workspace::Workspace;
use crate::sampling::hemisphere::{Basis, cosine, mirrored};
use crate::sampling::paths::{Place, Points};
use crate::trace::{Announcement, Purpose, Tracer};
use curitiba_pipeline::camera_programs::SurfaceKind;
use glam::Vec3;

impl<T: Tracer, C: Coverage> Walk<'_, '_, T, C> {
    /// Radiance along a ray from the camera, with [`depth`](curitiba_pipeline::programs::RayParams::depth) bounces at most.
    pub(super) fn path(&self, origin: Vec3, direction: Vec3, points: &Points, work: &mut Workspace) -> Vec3 {
        let lit = self.camera.lamp.is_some() || self.pass.job.sun.is_some();
        let (mut origin, mut direction) = (origin, direction);
        let mut cone = self.at_eye();
        let (mut sum, mut weight, mut counts) = (Vec3::ZERO, Vec3::ONE, true);
        for bounce in 0..=self.params.depth {
            let (ray, Some(hit)) = self.pass.closest(origin, direction) else {
                return sum + weight * self.pass.job.beyond;
            };
            let kind = self.kind(&hit);
            if kind == SurfaceKind::Light {
                let shines = if counts || !lit { self.params.camera.radiance } else { 0.0 };
                return sum + weight * shines;
            }
            cone = cone.along(hit.t);
            let footprint = self.pass.footprint(cone, &hit, direction);
            let surface = self.pass.surface_hit(&ray, &hit, footprint);
            let curvature = || self.pass.curvature(hit.triangle, &surface);
            let mut purpose = Purpose::Reflected;
            match kind {
                SurfaceKind::Light | SurfaceKind::Painted | SurfaceKind::CutOut => {
                    if counts || !lit {
                        sum += weight * self.pass.glow(&hit, footprint);
                    }
                    weight *= self.pass.base_color(&hit, footprint);
                    if weight == Vec3::ZERO {
                        return sum;
                    }
                    if lit {
                        let place = || points.at(Place::Light(bounce));
                        sum += weight * self.reflected(&hit, &surface, place, work);
                    }
                    let way = cosine(points.at(Place::Bounce(bounce)));
                    direction = mirrored(Basis::around(surface.normal).to_world(way), surface.facing);
                    counts = false;
                }
                SurfaceKind::Metal => {
                    cone = cone.mirrored(curvature, -surface.interface_normal(direction).dot(direction));
                    let (way, share) = self.mirror(&surface, direction, || points.at(Place::Bounce(bounce)));
                    (direction, weight, counts) = (way, weight * share, true);
                }
                SurfaceKind::Clear => {
                    // A pane does not change whether emitting surfaces count: shadow rays already bring the light that falls through it.
                    (weight, purpose) = (weight * CLEAR, Purpose::Refracted);
                }
                SurfaceKind::Glass => {
                    let split = self.split(&surface, direction);
                    let (normal, index) = split.bends;
                    let cos = -normal.dot(direction);
                    let goes_on = points.at(Place::Bounce(bounce)).x >= split.interface.reflectance;
                    (direction, purpose, cone) = match split.refracted.filter(|_| goes_on) {
                        Some(refracted) => {
                            let cos = [cos, split.interface.cos_refracted];
                            (refracted, Purpose::Refracted, cone.refracted(curvature, cos, index))
                        }
                        None => (split.reflected, Purpose::Reflected, cone.mirrored(curvature, cos)),
                    };
                    counts = true;
                }
            }
            if bounce < self.params.depth {
                match purpose {
                    Purpose::Reflected => work.rays.reflected += 1,
                    _ => work.rays.refracted += 1,
                }
                self.pass.tracer.announce(Announcement { purpose, bounce, weight: weight.max_element() });
                origin = surface.origin(direction);
            }
        }
        sum
    }
}
