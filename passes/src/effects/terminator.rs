//! The shadow terminator: light on triangles that are turned away from the light while the smooth surface that they
//! approximate is not.
//!
//! A point of such a triangle is lifted onto the smooth surface, which the normals at the corners describe. The point
//! is projected onto the tangent plane at each corner, where it lies below that plane, and the three projections are
//! weighted by the barycentric coordinates (Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021, chapter
//! 4). The shadow ray starts at the lifted point. A second ray tests the way from the triangle to the lifted point, so
//! that no light comes through what lies between. Triangles that face the light are treated as without vertex normals.

use super::coverage::Coverage;
use super::interpolate::locate;
use super::light::SHADOWED;
use super::pass::Pass;
use crate::trace::{Hit, Purpose, Ray, SurfacePoint, Tracer, higher};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;

/// Least cosine between a triangle's normal and those at its corners for which the triangle counts as a piece of a
/// round surface.
pub const ROUND: f32 = 0.85;

/// A point of a triangle lifted onto the smooth surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lifted {
    /// Origin off the triangle, on the lit side.
    from: Vec3,
    /// Vector from there to the smooth surface; not 0.
    way: Vec3,
}

impl Lifted {
    /// Origin of the ray to the light.
    pub(super) fn origin(&self) -> Vec3 {
        self.from + self.way
    }

    /// Ray from the triangle to the lifted point.
    fn ray(&self) -> Ray {
        let length = self.way.length();
        Ray { origin: self.from, direction: self.way * (1.0 / length), t_min: 0.0, t_max: length }
    }
}

/// Vector from a point of a triangle to the smooth surface. The point is on the side of unit normal `facing`, which is
/// turned away from the light; `to_light` is the unit direction to the light.
///
/// The vector is 0 where the shading normal gets no light, where a corner's normal is more than 32 degrees off the
/// triangle's ([`ROUND`], so the triangle stands for an edge and no round body), and where the triangle is flat.
///
/// # Panics
/// If there is no such triangle.
#[must_use]
pub fn way_onto_round(
    geometry: &Geometry,
    triangle: u32,
    point: &SurfacePoint,
    (facing, to_light): (Vec3, Vec3),
) -> Vec3 {
    if geometry.normals.is_empty() {
        return Vec3::ZERO;
    }
    let [na, nb, nc] = geometry.triangles[triangle as usize].map(|corner| geometry.normals[corner as usize]);
    if na == nb && nb == nc {
        return Vec3::ZERO;
    }
    let at = locate(geometry, triangle, point.position);
    let normal = na * (1.0 - at.u - at.v) + nb * at.u + nc * at.v;
    let side = 1f32.copysign(normal.dot(facing));
    let round = |normal: Vec3| normal.dot(facing) * side >= ROUND;
    if !(normal.dot(to_light) * side > 0.0 && round(na) && round(nb) && round(nc)) {
        return Vec3::ZERO;
    }
    let [a, b, c] = geometry.corners(triangle);
    let lift = |corner: Vec3, normal: Vec3| normal * higher(0.0, -(point.position - corner).dot(normal));
    let way = lift(a, na * side) * (1.0 - at.u - at.v) + lift(b, nb * side) * at.u + lift(c, nc * side) * at.v;
    if way.is_finite() { way } else { Vec3::ZERO }
}

impl<T: Tracer, C> Pass<'_, T, C> {
    /// Lifts a point of a triangle whose side of normal `facing` is turned away from light in direction `to_light`.
    /// `None` where the point is dark without a ray ([`way_onto_round`]), and on spheres.
    pub(super) fn lifted(
        &self,
        triangle: u32,
        point: &SurfacePoint,
        (facing, to_light): (Vec3, Vec3),
    ) -> Option<Lifted> {
        if self.sphere(triangle).is_some() {
            return None;
        }
        let way = way_onto_round(&self.job.scene.geometry, triangle, point, (facing, to_light));
        (way != Vec3::ZERO).then(|| Lifted { from: point.spawn(facing), way })
    }
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// Whether something lies between a triangle and the lifted point. Traces a shadow ray.
    pub(super) fn is_cut_off(&self, lifted: &Lifted, rays: &mut u64, stops: impl FnMut(&Hit) -> bool) -> bool {
        *rays += 1;
        self.announce_visibility(Purpose::Shadow, 1.0);
        self.tracer.occluded(&lifted.ray(), stops)
    }

    /// The light's share in `deferredShadows` at a lifted point.
    pub(super) fn light_at_lifted(&self, lifted: &Lifted, rays: &mut u64) -> f32 {
        let covers = |hit: &Hit| self.covers(hit);
        if self.is_cut_off(lifted, rays, covers) {
            return SHADOWED;
        }
        *rays += 1;
        if self.sees_light(lifted.origin(), covers) { 1.0 } else { SHADOWED }
    }
}
