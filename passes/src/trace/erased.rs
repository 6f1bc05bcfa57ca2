//! Tracers behind a pointer, so that programs are compiled once for all of them.

use super::ray::{Hit, Ray};
use super::tracer::{Announcement, Tracer};
use glam::Vec3;

/// The queries of [`Tracer`] for single rays, as a trait that can be pointed to. Packets, fans and neighbourhoods are traced ray by ray:
/// for reference pictures and for inspecting a pixel, not for speed.
pub trait DynTracer: Sync {
    /// [`Tracer::SPHERES`].
    fn knows_spheres(&self) -> bool;

    /// [`Tracer::closest`].
    fn closest_of(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit>;

    /// [`Tracer::occluded`].
    fn is_occluded(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> bool;

    /// [`Tracer::clear_above`].
    fn is_clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool;

    /// [`Tracer::announce`].
    fn hears(&self, rays: Announcement);
}

impl<T: Tracer> DynTracer for T {
    fn knows_spheres(&self) -> bool {
        T::SPHERES
    }

    fn closest_of(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        self.closest(ray, accept)
    }

    fn is_occluded(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> bool {
        self.occluded(ray, accept)
    }

    fn is_clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        self.clear_above(origin, normal, t_max)
    }

    fn hears(&self, rays: Announcement) {
        self.announce(rays);
    }
}

/// A [`Tracer`] that forwards to another through a pointer. `SPHERES` says whether programs are compiled with exact spheres; if so, they
/// also serve tracers that have none.
#[derive(Clone, Copy)]
pub(crate) struct Erased<'a, const SPHERES: bool>(pub(crate) &'a dyn DynTracer);

impl<const SPHERES: bool> Tracer for Erased<'_, SPHERES> {
    const SPHERES: bool = SPHERES;

    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.0.closest_of(ray, &mut accept)
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        self.0.is_occluded(ray, &mut accept)
    }

    fn clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        self.0.is_clear_above(origin, normal, t_max)
    }

    fn announce(&self, rays: Announcement) {
        self.0.hears(rays);
    }
}
