//! Where exact spheres differ from triangles. For a tracer without spheres, the compiler removes these branches.

use super::coverage::Coverage;
use super::pass::Pass;
use crate::trace::{Hit, Ray, SurfacePoint, Tracer};
use curitiba_pipeline::scene::Sphere;
use glam::Vec3;

impl<T: Tracer, C> Pass<'_, T, C> {
    /// The sphere of an id; `None` for triangles.
    #[inline(always)]
    pub(super) fn sphere(&self, id: u32) -> Option<&Sphere> {
        if T::SPHERES { self.job.scene.geometry.sphere(id) } else { None }
    }

    /// The material of a triangle or sphere.
    #[inline(always)]
    pub(super) fn material_of(&self, id: u32) -> u32 {
        match self.sphere(id) {
            Some(sphere) => sphere.material,
            None => self.job.scene.geometry.material_of(id),
        }
    }

    /// The outward unit normal of a sphere where a ray meets it; `None` for triangles.
    #[inline(always)]
    pub(super) fn sphere_normal(&self, ray: &Ray, hit: &Hit) -> Option<Vec3> {
        self.sphere(hit.triangle).map(|sphere| SurfacePoint::on_sphere_by(sphere, ray, hit.t).normal)
    }
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// Whether there is a surface at a hit: nothing is cut out of a sphere.
    #[inline(always)]
    pub(super) fn covers(&self, hit: &Hit) -> bool {
        self.sphere(hit.triangle).is_some() || self.coverage.covers(hit)
    }
}
